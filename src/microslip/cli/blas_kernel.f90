!> OpenBLAS picks its kernels by a list of processors; older versions fall back to SSE3 kernels on newer
!> processors, several times slower. The choice is made when the library is loaded, so the remedy is to name
!> the right kernels in the environment and to start the program anew, once.
module microslip_cli_blas_kernel
   use, intrinsic :: iso_c_binding, only: c_char, c_int, c_null_char, c_null_ptr, c_ptr, c_f_pointer, c_loc, c_associated
   use microslip_core_text, only: lower_case
   implicit none(type, external)
   private

   public :: ensure_fast_blas, blas_kernel_name

   character(len=*), parameter :: kernel_variable = 'OPENBLAS_CORETYPE', restarted_variable = 'MICROSLIP_BLAS_RESTARTED'
   !> Kernels that know neither AVX2 nor FMA.
   character(len=*), parameter :: slow_kernels(*) = [character(len=12) :: 'generic', 'katmai', 'coppermine', 'northwood', &
      & 'prescott', 'banias', 'atom', 'core2', 'penryn', 'dunnington', 'nehalem', 'sandybridge', 'athlon', 'opteron', &
      & 'opteron_sse3', 'barcelona', 'bobcat', 'nano', 'bulldozer', 'piledriver', 'core']

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

   !> Start the program anew with fast kernels where OpenBLAS has chosen slow ones; warn where that fails.
   !> To be called first thing; it returns when nothing is (or can be) done.
   subroutine ensure_fast_blas(warning)
      !> What to tell the user, empty if all is well
      character(len=:), allocatable, intent(out) :: warning
      character(len=:), allocatable :: better
      character(len=64) :: value
      integer :: length, status

      warning = ''
      if (.not. any(slow_kernels == lower_case(blas_kernel_name()))) return
      better = better_kernel()
      if (better == '') return
      call get_environment_variable(kernel_variable, value, length, status)
      if (status == 0 .and. length > 0) then
         warning = 'OpenBLAS runs its slow '//blas_kernel_name()//' kernels because '//kernel_variable// &
            & ' asks for them; this processor can run '//better
         return
      end if
      call get_environment_variable(restarted_variable, length=length, status=status)
      if (status /= 0) then
         if (c_setenv(kernel_variable//c_null_char, better//c_null_char, 1_c_int) == 0 .and. &
            & c_setenv(restarted_variable//c_null_char, '1'//c_null_char, 1_c_int) == 0) call start_anew()
      end if
      warning = 'OpenBLAS runs its slow '//blas_kernel_name()//' kernels; set '//kernel_variable//'='//better// &
         & ' in the environment'
   end subroutine ensure_fast_blas

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

end module microslip_cli_blas_kernel
