!> Files that appear and vanish as a whole: under its name there is always either the old one or the new one.
module microslip_io_whole_files
   use, intrinsic :: iso_c_binding, only: c_associated, c_char, c_int, c_int8_t, c_null_char, c_ptr, c_size_t
   use microslip_core_error, only: error_t, failure
   implicit none(type, external)
   private

   public :: copy_file, move_file, remove_file, can_be_replaced

   !> Bytes that are copied together.
   integer, parameter :: block_size = 2**20

   interface
      function c_fopen(path, mode) bind(c, name='fopen') result(stream)
         import :: c_char, c_ptr
         implicit none(type, external)
         character(kind=c_char), intent(in) :: path(*), mode(*)
         type(c_ptr) :: stream
      end function c_fopen

      function c_fread(bytes, length, count, stream) bind(c, name='fread') result(done)
         import :: c_int8_t, c_ptr, c_size_t
         implicit none(type, external)
         integer(c_int8_t), intent(out) :: bytes(*)
         integer(c_size_t), value :: length, count
         type(c_ptr), value :: stream
         integer(c_size_t) :: done
      end function c_fread

      function c_fwrite(bytes, length, count, stream) bind(c, name='fwrite') result(done)
         import :: c_int8_t, c_ptr, c_size_t
         implicit none(type, external)
         integer(c_int8_t), intent(in) :: bytes(*)
         integer(c_size_t), value :: length, count
         type(c_ptr), value :: stream
         integer(c_size_t) :: done
      end function c_fwrite

      function c_ferror(stream) bind(c, name='ferror') result(status)
         import :: c_int, c_ptr
         implicit none(type, external)
         type(c_ptr), value :: stream
         integer(c_int) :: status
      end function c_ferror

      function c_fflush(stream) bind(c, name='fflush') result(status)
         import :: c_int, c_ptr
         implicit none(type, external)
         type(c_ptr), value :: stream
         integer(c_int) :: status
      end function c_fflush

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

      function c_fclose(stream) bind(c, name='fclose') result(status)
         import :: c_int, c_ptr
         implicit none(type, external)
         type(c_ptr), value :: stream
         integer(c_int) :: status
      end function c_fclose

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
   end interface

contains

   !> Copy a file. Until the copy is complete and on the disk, it has the name `to`.new.
   subroutine copy_file(from, to, error)
      character(len=*), intent(in) :: from, to
      type(error_t), allocatable, intent(out) :: error
      integer(c_int8_t), allocatable :: bytes(:)
      type(c_ptr) :: source, target
      integer(c_size_t) :: length
      logical :: good

      source = c_fopen(from//c_null_char, 'rb'//c_null_char)
      if (.not. c_associated(source)) then
         call failure(error, from//': cannot be read')
         return
      end if
      target = c_fopen(to//'.new'//c_null_char, 'wb'//c_null_char)
      good = c_associated(target)
      if (good) then
         allocate (bytes(block_size))
         do
            length = c_fread(bytes, 1_c_size_t, int(block_size, c_size_t), source)
            if (length == 0) exit
            good = c_fwrite(bytes, 1_c_size_t, length, target) == length
            if (.not. good) exit
         end do
         good = good .and. c_ferror(source) == 0
         if (good) good = c_fflush(target) == 0
         if (good) good = c_fsync(c_fileno(target)) == 0
         good = c_fclose(target) == 0 .and. good
         if (good) good = c_rename(to//'.new'//c_null_char, to//c_null_char) == 0
         if (.not. good) call remove_file(to//'.new')
      end if
      if (c_fclose(source) /= 0) good = .false.
      if (.not. good) call failure(error, to//': cannot be written (disk full?)')
   end subroutine copy_file

   !> Give a file another name, in place of what has that name, once it is on the disk.
   subroutine move_file(from, to, error)
      character(len=*), intent(in) :: from, to
      type(error_t), allocatable, intent(out) :: error
      type(c_ptr) :: stream
      logical :: good

      stream = c_fopen(from//c_null_char, 'rb'//c_null_char)
      good = c_associated(stream)
      if (good) good = c_fsync(c_fileno(stream)) == 0
      if (c_associated(stream)) good = c_fclose(stream) == 0 .and. good
      if (good) good = c_rename(from//c_null_char, to//c_null_char) == 0
      if (.not. good) call failure(error, to//': cannot be written; '//from//' has what was to be there')
   end subroutine move_file

   !> Whether a file may get this name: there is none, or one that may be written (no folder).
   logical function can_be_replaced(path)
      character(len=*), intent(in) :: path
      type(c_ptr) :: stream

      inquire (file=path, exist=can_be_replaced)
      can_be_replaced = .not. can_be_replaced
      if (can_be_replaced) return
      stream = c_fopen(path//c_null_char, 'r+b'//c_null_char)
      can_be_replaced = c_associated(stream)
      if (can_be_replaced) can_be_replaced = c_fclose(stream) == 0
   end function can_be_replaced

   !> Remove a file; harmless if there is none.
   subroutine remove_file(path)
      character(len=*), intent(in) :: path
      integer(c_int) :: ignored
      ignored = c_remove(path//c_null_char)
   end subroutine remove_file

end module microslip_io_whole_files
