!> No file of the user is lost: what a command line would write is compared with all that it reads, and with what else it writes,
!> before anything is written.
module microslip_cli_file_guard
   use microslip_core_error, only: bad_input, error_t
   use microslip_core_fault_list, only: fault_list_t
   use microslip_core_warning_list, only: warning_list_t
   use microslip_io_case, only: case_t
   use microslip_io_case_inputs, only: case_input_t, list_inputs
   use microslip_io_file_identity, only: file_identity_t, identity_of, kind_in_words, kind_regular, kind_unknown, &
      & link_target, place_of, same_file
   use microslip_io_input_files, only: input_count, input_path
   use microslip_io_own_files, only: cache_file, check_leftover, check_replaceable, copy_of, model_file, own_file_t, part_of, &
      & result_file
   use microslip_io_reduction_cache, only: check_cache
   implicit none(type, external)
   private

   public :: file_guard_t

   !> A file that a case reads or writes.
   type :: guarded_t
      !> Number of the case on the command line, its path
      integer :: number = 0
      character(len=:), allocatable :: case
      !> What it is, in words
      character(len=:), allocatable :: role
      character(len=:), allocatable :: path
      type(file_identity_t) :: identity
      !> What is written; that of the main file for a working file
      type(own_file_t) :: kind
      logical :: is_working_file = .false.
   end type guarded_t

   type :: list_t
      type(guarded_t), allocatable :: files(:)
   contains
      procedure :: add
   end type list_t

   !> All files of a command line.
   type :: file_guard_t
      type(list_t), private :: inputs, outputs
   contains
      procedure :: note_case
      procedure :: check_between
      procedure :: check_case
      procedure :: check_read
   end type file_guard_t

contains

   !> One more case: what it names to be read, and what it will write.
   subroutine note_case(self, number, case, result_path, model_path)
      class(file_guard_t), intent(inout) :: self
      !> On the command line
      integer, intent(in) :: number
      type(case_t), intent(in) :: case
      !> Where its results go
      character(len=*), intent(in) :: result_path
      !> Where its model goes; present: that is all that is written
      character(len=*), intent(in), optional :: model_path
      type(case_input_t), allocatable :: inputs(:)
      integer :: k

      call list_inputs(case, inputs)
      do k = 1, size(inputs)
         call self%inputs%add(number, case%path, inputs(k)%role, inputs(k)%path)
      end do
      if (present(model_path)) then
         call note_output(model_file, model_path)
         return
      end if
      call note_output(result_file, result_path, with_part=.true.)
      if (case%reduction%cache /= '') call note_output(cache_file, case%located(case%reduction%cache))

   contains

      subroutine note_output(kind, path, with_part)
         type(own_file_t), intent(in) :: kind
         character(len=*), intent(in) :: path
         logical, intent(in), optional :: with_part
         character(len=:), allocatable :: place

         call self%outputs%add(number, case%path, trim(kind%name), path, kind)
         ! Working files lie beside the file itself, even if the path is a link.
         place = path
         if (link_target(path) /= '') place = place_of(path)
         if (present(with_part)) call self%outputs%add(number, case%path, 'working file', part_of(place), kind, .true.)
         call self%outputs%add(number, case%path, 'working file', copy_of(place), kind, .true.)
      end subroutine note_output

   end subroutine note_case

   !> Append a file.
   subroutine add(self, number, case, role, path, kind, is_working_file)
      class(list_t), intent(inout) :: self
      integer, intent(in) :: number
      character(len=*), intent(in) :: case, role, path
      type(own_file_t), intent(in), optional :: kind
      logical, intent(in), optional :: is_working_file
      type(guarded_t), allocatable :: more(:)
      integer :: n

      n = 0
      if (allocated(self%files)) n = size(self%files)
      allocate (more(n + 1))
      if (n > 0) more(:n) = self%files
      more(n + 1)%number = number
      more(n + 1)%case = case
      more(n + 1)%role = role
      more(n + 1)%path = path
      more(n + 1)%identity = identity_of(path)
      if (present(kind)) more(n + 1)%kind = kind
      if (present(is_working_file)) more(n + 1)%is_working_file = is_working_file
      call move_alloc(more, self%files)
   end subroutine add

   !> No case writes what another one reads or writes. (Cases may share a cache.)
   subroutine check_between(self, error)
      class(file_guard_t), intent(in) :: self
      type(error_t), allocatable, intent(out) :: error
      type(fault_list_t) :: faults
      integer :: i, k

      if (.not. allocated(self%outputs%files)) return
      associate (outputs => self%outputs%files, inputs => self%inputs%files)
         do i = 1, size(outputs)
            do k = 1, size(inputs)
               if (inputs(k)%number /= outputs(i)%number) call compare(outputs(i), inputs(k), faults)
            end do
            do k = 1, i - 1
               if (outputs(k)%number /= outputs(i)%number) call compare(outputs(i), outputs(k), faults)
            end do
         end do
      end associate
      call faults%raise(error)
   end subroutine check_between

   !> What a case writes is not what it reads, and replaces nothing that is the user's.
   subroutine check_case(self, number, warnings, error)
      class(file_guard_t), intent(in) :: self
      !> On the command line
      integer, intent(in) :: number
      !> What will not be used is added
      type(warning_list_t), intent(inout) :: warnings
      type(error_t), allocatable, intent(out) :: error
      type(fault_list_t) :: faults
      integer :: i, k

      associate (outputs => self%outputs%files, inputs => self%inputs%files)
         do i = 1, size(outputs)
            if (outputs(i)%number /= number) cycle
            do k = 1, size(inputs)
               if (inputs(k)%number == number) call compare(outputs(i), inputs(k), faults)
            end do
            do k = 1, i - 1
               if (outputs(k)%number == number) call compare(outputs(i), outputs(k), faults)
            end do
         end do
         if (faults%number() == 0) then
            do i = 1, size(outputs)
               if (outputs(i)%number == number) call check_output(outputs(i), faults, warnings)
            end do
         end if
      end associate
      call faults%raise(error)
   end subroutine check_case

   !> The same for all files that were read for a case, those that other files name included.
   subroutine check_read(self, number, error)
      class(file_guard_t), intent(in) :: self
      integer, intent(in) :: number
      type(error_t), allocatable, intent(out) :: error
      type(fault_list_t) :: faults
      type(list_t) :: read
      integer :: i, k

      do k = 1, input_count()
         call read%add(number, '', 'file', input_path(k))
      end do
      do i = 1, size(self%outputs%files)
         if (self%outputs%files(i)%number /= number) cycle
         do k = 1, input_count()
            read%files(k)%case = self%outputs%files(i)%case
            call compare(self%outputs%files(i), read%files(k), faults)
         end do
      end do
      call faults%raise(error)
   end subroutine check_read

   !> Two files that must not be one.
   subroutine compare(output, other, faults)
      type(guarded_t), intent(in) :: output, other
      type(fault_list_t), intent(inout) :: faults

      if (.not. same_file(output%identity, other%identity)) return
      if (output%kind%format == cache_file%format .and. other%kind%format == cache_file%format .and. &
         & (output%is_working_file .eqv. other%is_working_file)) return
      call faults%add(output%case//': the '//output%role//" '"//output%path//"' is the same file as the "//other%role//" '"// &
         & other%path//"' of "//other%case//', which would be lost: '//trim(output%kind%renaming))
   end subroutine compare

   !> One file that is to be written.
   subroutine check_output(output, faults, warnings)
      type(guarded_t), intent(in) :: output
      type(fault_list_t), intent(inout) :: faults
      type(warning_list_t), intent(inout) :: warnings
      type(error_t), allocatable :: error
      logical :: ignored

      if (output%kind%format == cache_file%format) then
         ! A run does without its cache, but it does not try to replace a folder or a device.
         if (output%is_working_file) return
         if (output%identity%exists() .and. output%identity%kind /= kind_regular .and. output%identity%kind /= kind_unknown) &
            & call bad_input(error, output%path//': is '//kind_in_words(output%identity%kind)//', which cannot be a '// &
            & trim(cache_file%name))
         if (.not. allocated(error)) call check_cache(output%path, warnings, ignored)
      else if (output%is_working_file) then
         call check_leftover(output%path, output%kind, error)
      else
         call check_replaceable(output%path, output%kind, error)
      end if
      if (allocated(error)) call faults%add(output%case//': '//error%message)
   end subroutine check_output

end module microslip_cli_file_guard
