!> A file that is worked on: one run has it for itself, from its beginning until it gets its final name or is given up.
!>
!> What is there already is only taken if it is the remains of a run that has ended (`microslip_io_own_files`) and no
!> other run has it. The system gives the lock back when a process ends, however it ends; it holds across machines that
!> share a file system with locks.
module microslip_io_working_file
   use, intrinsic :: iso_c_binding, only: c_associated, c_char, c_int, c_null_char, c_null_ptr, c_ptr
   use microslip_core_error, only: bad_input, error_t, failure
   use microslip_io_file_identity, only: file_identity_t, identity_of, identity_of_descriptor, kind_unknown, link_target, &
      & same_file
   use microslip_io_file_lock, only: lock_alone, lock_refused, lock_shared, lock_unknown
   use microslip_io_own_files, only: check_leftover, is_leftover, own_file_t
   implicit none(type, external)
   private

   public :: working_file_t

   !> How often to look again where other runs come and go in between.
   integer, parameter :: most_attempts = 100
   integer, parameter :: permission_bits = int(o'777')

   type :: working_file_t
      character(len=:), allocatable :: path
      type(c_ptr), private :: stream = c_null_ptr
      type(own_file_t), private :: kind
   contains
      procedure :: take
      procedure :: is_held
      procedure :: publish_as
      procedure :: give_up
   end type working_file_t

   interface
      function c_fopen(path, mode) bind(c, name='fopen') result(stream)
         import :: c_char, c_ptr
         implicit none(type, external)
         character(kind=c_char), intent(in) :: path(*), mode(*)
         type(c_ptr) :: stream
      end function c_fopen

      function c_fclose(stream) bind(c, name='fclose') result(status)
         import :: c_int, c_ptr
         implicit none(type, external)
         type(c_ptr), value :: stream
         integer(c_int) :: status
      end function c_fclose

      function c_fileno(stream) bind(c, name='fileno') result(descriptor)
         import :: c_int, c_ptr
         implicit none(type, external)
         type(c_ptr), value :: stream
         integer(c_int) :: descriptor
      end function c_fileno

      function c_fsync(descriptor) bind(c, name='fsync') result(status)
         import :: c_int
         implicit none(type, external)
         integer(c_int), value :: descriptor
         integer(c_int) :: status
      end function c_fsync

      function c_rename(from, to) bind(c, name='rename') result(status)
         import :: c_char, c_int
         implicit none(type, external)
         character(kind=c_char), intent(in) :: from(*), to(*)
         integer(c_int) :: status
      end function c_rename

      function c_remove(path) bind(c, name='remove') result(status)
         import :: c_char, c_int
         implicit none(type, external)
         character(kind=c_char), intent(in) :: path(*)
         integer(c_int) :: status
      end function c_remove

      function c_chmod(path, mode) bind(c, name='chmod') result(status)
         import :: c_char, c_int
         implicit none(type, external)
         character(kind=c_char), intent(in) :: path(*)
         integer(c_int), value :: mode
         integer(c_int) :: status
      end function c_chmod
   end interface

contains

   !> Get the file for this run alone: a new, empty one, or what an ended run left.
   subroutine take(self, path, kind, error, in_use)
      class(working_file_t), intent(inout) :: self
      character(len=*), intent(in) :: path
      !> What is worked on
      type(own_file_t), intent(in) :: kind
      type(error_t), allocatable, intent(out) :: error
      !> Whether another run has it
      logical, intent(out), optional :: in_use
      integer :: attempt, lock
      logical :: new

      if (present(in_use)) in_use = .false.
      self%path = path
      self%kind = kind
      do attempt = 1, most_attempts
         ! 'x': only if there is no such file.
         self%stream = c_fopen(path//c_null_char, 'wbx'//c_null_char)
         new = c_associated(self%stream)
         if (.not. new) then
            call check_leftover(path, kind, error)
            if (allocated(error)) return
            self%stream = c_fopen(path//c_null_char, 'r+b'//c_null_char)
            if (.not. c_associated(self%stream)) exit
         end if
         lock = lock_alone(c_fileno(self%stream))
         if (lock == lock_refused) then
            if (present(in_use)) in_use = .true.
            call bad_input(error, path//': another run is at work on this file')
         else if (lock == lock_unknown .and. .not. new) then
            call bad_input(error, path//': is there already, and this file system cannot tell whether a run is at work on it: ' &
               & //'remove it if there is none')
         else if (.not. self%is_held()) then
            ! Whoever had it has just given it its final name, or given it up.
            call let_go(self)
            cycle
         else if (is_leftover(path, kind)) then
            return
         else
            call check_leftover(path, kind, error)
         end if
         call let_go(self)
         if (allocated(error)) return
      end do
      call bad_input(error, path//': cannot be written (does its folder exist, may it be written?)')
   end subroutine take

   !> Whether this run has the file, and it is still the one of that name.
   logical function is_held(self)
      class(working_file_t), intent(in) :: self
      type(file_identity_t) :: mine, there

      is_held = c_associated(self%stream)
      if (.not. is_held) return
      mine = identity_of_descriptor(c_fileno(self%stream))
      there = identity_of(self%path)
      is_held = there%kind == kind_unknown .or. (same_file(mine, there) .and. link_target(self%path) == '')
   end function is_held

   !> Give the file its final name once it is on the disk, in place of what has that name; then it is no longer this run's.
   subroutine publish_as(self, path, error)
      class(working_file_t), intent(inout) :: self
      character(len=*), intent(in) :: path
      type(error_t), allocatable, intent(out) :: error
      type(file_identity_t) :: before
      integer :: ignored

      if (.not. self%is_held()) then
         call failure(error, self%path//': is no longer there: it was removed or replaced while the program ran')
         call let_go(self)
         return
      end if
      before = identity_of(path)
      if (before%exists()) ignored = c_chmod(self%path//c_null_char, iand(int(before%permissions, c_int), permission_bits))
      if (c_fsync(c_fileno(self%stream)) /= 0) call failure(error, self%path//': cannot be written (disk full?)')
      ! From here on readers may lock it too.
      ignored = lock_shared(c_fileno(self%stream))
      if (.not. allocated(error)) then
         if (c_rename(self%path//c_null_char, path//c_null_char) /= 0) &
            & call failure(error, path//': cannot be written; '//self%path//' has what was to be there')
      end if
      call let_go(self)
   end subroutine publish_as

   !> Remove the file, if it is still this run's; harmless if there is none.
   subroutine give_up(self)
      class(working_file_t), intent(inout) :: self
      integer(c_int) :: ignored

      if (self%is_held()) ignored = c_remove(self%path//c_null_char)
      call let_go(self)
   end subroutine give_up

   !> Close it, which opens the lock.
   subroutine let_go(self)
      class(working_file_t), intent(inout) :: self
      integer(c_int) :: ignored

      if (c_associated(self%stream)) ignored = c_fclose(self%stream)
      self%stream = c_null_ptr
   end subroutine let_go

end module microslip_io_working_file
