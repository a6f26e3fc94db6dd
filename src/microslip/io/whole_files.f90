!> Files that appear and vanish as a whole: under its name there is always either the old one or the new one.
module microslip_io_whole_files
   use, intrinsic :: iso_c_binding, only: c_associated, c_char, c_int, c_int8_t, c_null_char, c_ptr, c_size_t
   use microslip_core_error, only: error_t, failure
   use microslip_io_own_files, only: copy_of, own_file_t
   use microslip_io_working_file, only: working_file_t
   implicit none(type, external)
   private

   public :: copy_file, copy_bytes

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

      function c_fclose(stream) bind(c, name='fclose') result(status)
         import :: c_int, c_ptr
         implicit none(type, external)
         type(c_ptr), value :: stream
         integer(c_int) :: status
      end function c_fclose

   end interface

contains

   !> Copy a file. Until the copy is complete and on the disk, its name is that of `copy_of`.
   subroutine copy_file(from, to, kind, error)
      character(len=*), intent(in) :: from, to
      !> What it is
      type(own_file_t), intent(in) :: kind
      type(error_t), allocatable, intent(out) :: error
      type(working_file_t) :: copy

      call copy%take(copy_of(to), kind, error)
      if (allocated(error)) return
      call copy_bytes(from, copy%path, error)
      if (.not. allocated(error)) call copy%publish_as(to, error)
      if (allocated(error)) call copy%give_up()
   end subroutine copy_file

   !> Write what is in a file into another one, in place of what is there.
   subroutine copy_bytes(from, to, error)
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
      target = c_fopen(to//c_null_char, 'wb'//c_null_char)
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
         good = c_fclose(target) == 0 .and. good
      end if
      if (c_fclose(source) /= 0) good = .false.
      if (.not. good) call failure(error, to//': cannot be written (disk full?)')
   end subroutine copy_bytes

end module microslip_io_whole_files
