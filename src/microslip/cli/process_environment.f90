!> Settings that libraries read from the environment when they are loaded, too early for the program to make
!> them: it makes them and starts itself anew, once.
!>
!> OpenBLAS picks its kernels by a list of processors; older versions fall back to SSE3 kernels on newer
!> processors, several times slower. OpenMP threads that wait spin for milliseconds by default, and on a busy
!> machine take the processor from those they wait for: everything is tens of times slower then. They shall sleep
!> after some microseconds; not at once, which makes the many short parallel regions of the BLAS slow.
module microslip_cli_process_environment
   use, intrinsic :: iso_c_binding, only: c_char, c_int, c_null_char, c_null_ptr, c_ptr, c_f_pointer, c_loc, c_associated
   use microslip_core_error, only: error_t, failure
   use microslip_core_kinds, only: wp
   use microslip_core_process_limits, only: raise_stack_limit, stack_limit
   use microslip_core_text, only: lower_case, to_text
   use microslip_core_warning_list, only: severity_note, warning_list_t
   implicit none(type, external)
   private

   public :: prepare_process, blas_kernel_name

   character(len=*), parameter :: kernel_variable = 'OPENBLAS_CORETYPE', spin_variable = 'GOMP_SPINCOUNT', &
      & restarted_variable = 'MICROSLIP_RESTARTED'
   !> Kernels that know neither AVX2 nor FMA.
   character(len=*), parameter :: slow_kernels(*) = [character(len=12) :: 'generic', 'katmai', 'coppermine', 'northwood', &
      & 'prescott', 'banias', 'atom', 'core2', 'penryn', 'dunnington', 'nehalem', 'sandybridge', 'athlon', 'opteron', &
      & 'opteron_sse3', 'barcelona', 'bobcat', 'nano', 'bulldozer', 'piledriver', 'core']

   !> Bytes of stack: what is asked for, and the least with which the program runs (512 kB were measured to do).
   integer, parameter :: good_stack = 8*2**20, least_stack = 2**20
   !> Variables with the stack size of the other threads.
   character(len=*), parameter :: stack_variables(*) = [character(len=13) :: 'OMP_STACKSIZE', 'GOMP_STACKSIZE']

   interface
      function openblas_get_corename() bind(c) result(name)
         import :: c_ptr
         implicit none
         type(c_ptr) :: name
      end function openblas_get_corename

      function c_setenv(name, value, overwrite) bind(c, name='setenv') result(status)
         import :: c_char, c_int
         implicit none
         character(kind=c_char), intent(in) :: name(*), value(*)
         integer(c_int), value :: overwrite
         integer(c_int) :: status
      end function c_setenv

      function c_execv(path, argv) bind(c, name='execv') result(status)
         import :: c_char, c_int, c_ptr
         implicit none
         character(kind=c_char), intent(in) :: path(*)
         type(c_ptr), intent(in) :: argv(*)
         integer(c_int) :: status
      end function c_execv
   end interface

contains

   !> Name of the kernels that OpenBLAS runs.
   function blas_kernel_name() result(name)
      character(len=:), allocatable :: name
      character(kind=c_char), pointer :: text(:)
      type(c_ptr) :: pointer
      integer :: k

      name = ''
      pointer = openblas_get_corename()
      if (.not. c_associated(pointer)) return
      call c_f_pointer(pointer, text, [64])
      do k = 1, size(text)
         if (text(k) == c_null_char) exit
         name = name//text(k)
      end do
   end function blas_kernel_name

   !> Make the settings that are missing and start the program anew; warn where slow kernels stay. To be called
   !> first thing; it returns when nothing is (or can be) done. What the user has set is left alone, and refused if the
   !> program would crash with it.
   subroutine prepare_process(warnings, error)
      type(warning_list_t), intent(inout) :: warnings
      !> If the stack is too small
      type(error_t), allocatable, intent(out) :: error
      character(len=:), allocatable :: kernel
      logical :: changed

      call raise_stack_limit(good_stack)
      call check_stacks(error)
      if (allocated(error)) return
      kernel = ''
      if (any(slow_kernels == lower_case(blas_kernel_name()))) kernel = better_kernel()
      changed = .false.
      if (.not. is_set(restarted_variable)) then
         if (kernel /= '' .and. .not. is_set(kernel_variable)) changed = set(kernel_variable, kernel)
         if (.not. (is_set(spin_variable) .or. is_set('OMP_WAIT_POLICY'))) changed = set(spin_variable, '20000') .or. changed
         if (changed) changed = set(restarted_variable, '1')
         if (changed) call start_anew()
      end if
      if (kernel /= '') call warnings%add(severity_note, 'OpenBLAS runs its slow '//blas_kernel_name()//' kernels; set ' &
         & //kernel_variable//'='//kernel//' in the environment')
   end subroutine prepare_process

   !> Stacks that are too small end in a segmentation fault somewhere in the run.
   subroutine check_stacks(error)
      type(error_t), allocatable, intent(out) :: error
      character(len=40) :: text
      real(wp) :: bytes
      integer :: k

      if (stack_limit() < least_stack) then
         call failure(error, 'the stack is limited to '//to_text(stack_limit()/1024.0_wp, 6)//' kB, needed are ' &
            & //to_text(least_stack/1024)//' kB: raise the limit (ulimit -s)')
         return
      end if
      do k = 1, size(stack_variables)
         call get_environment_variable(trim(stack_variables(k)), text)
         bytes = bytes_in(text)
         if (bytes > 0.0_wp .and. bytes < least_stack) call failure(error, trim(stack_variables(k))//'='//trim(text) &
            & //': too small a stack for the threads, needed are '//to_text(least_stack/1024)//' kB at least')
      end do
   end subroutine check_stacks

   !> A size as OpenMP writes it: a number and B, K, M or G (K if nothing is given); 0 if it is none.
   pure real(wp) function bytes_in(text)
      character(len=*), intent(in) :: text
      character(len=*), parameter :: units = 'bkmg'
      integer :: last, status, unit

      bytes_in = 0.0_wp
      last = verify(text, ' 0123456789') - 1
      if (last < 0) last = len(text)
      read (text(:last), *, iostat=status) bytes_in
      if (status /= 0) bytes_in = 0.0_wp
      unit = 2
      if (len_trim(text) > last) unit = index(units, lower_case(text(last + 1:last + 1)))
      if (unit > 0) bytes_in = bytes_in*1024.0_wp**(unit - 1)
   end function bytes_in

   !> Whether an environment variable is there and not empty.
   logical function is_set(name)
      character(len=*), intent(in) :: name
      integer :: length, status

      call get_environment_variable(name, length=length, status=status)
      is_set = status == 0 .and. length > 0
   end function is_set

   !> Set an environment variable; whether that worked.
   logical function set(name, value)
      character(len=*), intent(in) :: name, value
      set = c_setenv(name//c_null_char, value//c_null_char, 1_c_int) == 0
   end function set

   !> Kernels this processor can run, empty if it knows no AVX2 (or is no x86).
   function better_kernel() result(kernel)
      character(len=:), allocatable :: kernel
      character(len=8192) :: line
      integer :: unit, status

      kernel = ''
      open (newunit=unit, file='/proc/cpuinfo', status='old', action='read', iostat=status)
      if (status /= 0) return
      do
         read (unit, '(a)', iostat=status) line
         if (status /= 0) exit
         if (line(:5) /= 'flags') cycle
         if (index(line, ' avx2 ') > 0 .and. index(line, ' fma ') > 0) kernel = 'HASWELL'
         if (index(line, ' avx512f ') > 0 .and. index(line, ' avx512vl ') > 0 .and. index(line, ' avx512bw ') > 0 &
            & .and. index(line, ' avx512dq ') > 0) kernel = 'SKYLAKEX'
         exit
      end do
      close (unit)
   end function better_kernel

   !> Replace this process by a new start of the same program with the same arguments. Returns on failure only.
   subroutine start_anew()
      integer, parameter :: longest = 4096
      character(kind=c_char, len=longest), allocatable, target :: argument(:)
      type(c_ptr), allocatable :: argv(:)
      integer :: k, n, length
      integer(c_int) :: status

      n = command_argument_count()
      allocate (argument(0:n), argv(0:n + 1))
      do k = 0, n
         call get_command_argument(k, argument(k), length)
         if (length >= longest) return
         argument(k) (length + 1:length + 1) = c_null_char
         argv(k) = c_loc(argument(k))
      end do
      argv(n + 1) = c_null_ptr
      status = c_execv('/proc/self/exe'//c_null_char, argv)
   end subroutine start_anew

end module microslip_cli_process_environment
