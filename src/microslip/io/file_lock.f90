!> Locks that tell runs of each other: flock(2), which the system takes back when a process ends, however it ends.
!>
!> They are independent of HDF5's own locks, which HDF5_USE_FILE_LOCKING may have switched off.
module microslip_io_file_lock
   use, intrinsic :: iso_c_binding, only: c_associated, c_char, c_int, c_null_char, c_ptr
   implicit none(type, external)
   private

   public :: lock_alone, lock_shared, is_locked, lock_taken, lock_refused, lock_unknown

   !> What became of a lock: it is ours, another has it, this file system has none.
   integer, parameter :: lock_taken = 0, lock_refused = 1, lock_unknown = 2

   !> flock(2)
   integer(c_int), parameter :: lock_sh = 1, lock_ex = 2, lock_nb = 4
   !> EWOULDBLOCK on Linux
   integer, parameter :: would_block = 11

   interface
      function c_flock(descriptor, operation) bind(c, name='flock') result(status)
         import :: c_int
         implicit none(type, external)
         integer(c_int), value :: descriptor, operation
         integer(c_int) :: status
      end function c_flock

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
   end interface

contains

   !> Have a file for this process alone; does not wait.
   integer function lock_alone(descriptor)
      integer(c_int), intent(in) :: descriptor
      lock_alone = outcome_of(descriptor, lock_ex)
   end function lock_alone

   !> Let others read what this process had alone.
   integer function lock_shared(descriptor)
      integer(c_int), intent(in) :: descriptor
      lock_shared = outcome_of(descriptor, lock_sh)
   end function lock_shared

   !> What the system says.
   integer function outcome_of(descriptor, operation)
      integer(c_int), intent(in) :: descriptor, operation
      intrinsic :: ierrno

      outcome_of = lock_taken
      if (c_flock(descriptor, ior(operation, lock_nb)) == 0) return
      outcome_of = merge(lock_refused, lock_unknown, ierrno() == would_block)
   end function outcome_of

   !> Whether another program has a file for itself, to write it. The file must be a regular one.
   logical function is_locked(path)
      character(len=*), intent(in) :: path
      type(c_ptr) :: stream
      integer(c_int) :: ignored

      is_locked = .false.
      stream = c_fopen(path//c_null_char, 'rb'//c_null_char)
      if (.not. c_associated(stream)) return
      is_locked = lock_shared(c_fileno(stream)) == lock_refused
      ignored = c_fclose(stream)
   end function is_locked

end module microslip_io_file_lock
