!> Lines to standard output and standard error that never end the program: the log may go to a full disk, to a pipe that nobody
!> reads, or nowhere. What was computed must not be lost by that.
module microslip_core_standard_streams
   use, intrinsic :: iso_c_binding, only: c_associated, c_char, c_int, c_null_char, c_ptr
   use, intrinsic :: iso_fortran_env, only: output_unit
   implicit none(type, external)
   private

   public :: open_streams, put_line, output_fault

   !> Why standard output takes no more; '' while it does.
   character(len=200), save :: fault = ''

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
   end interface

contains

   !> Put /dev/null in place of standard streams that the process was started without: else the first file that is opened
   !> takes their place, and messages of libraries would be written into it.
   subroutine open_streams()
      type(c_ptr) :: stream
      integer(c_int) :: ignored

      do
         stream = c_fopen('/dev/null'//c_null_char, 'r+b'//c_null_char)
         if (.not. c_associated(stream)) return
         if (c_fileno(stream) > 2) exit
      end do
      ignored = c_fclose(stream)
   end subroutine open_streams

   !> Write a line, if that is possible, and hand it over at once.
   subroutine put_line(unit, text, advance)
      !> Standard output, standard error, or a file
      integer, intent(in) :: unit
      character(len=*), intent(in) :: text
      !> Whether the line ends here (yes by default)
      logical, intent(in), optional :: advance
      character(len=len(fault)) :: reason
      logical :: ends
      integer :: status

      if (unit == output_unit .and. fault /= '') return
      ends = .true.
      if (present(advance)) ends = advance
      reason = ''
      if (ends) then
         write (unit, '(a)', iostat=status, iomsg=reason) text
      else
         write (unit, '(a)', advance='no', iostat=status, iomsg=reason) text
      end if
      if (status == 0) flush (unit, iostat=status, iomsg=reason)
      if (status == 0 .or. unit /= output_unit) return
      fault = reason
      if (fault == '') fault = 'not known why'
   end subroutine put_line

   !> Why standard output takes no more; '' while it does.
   function output_fault() result(text)
      character(len=:), allocatable :: text
      text = trim(fault)
   end function output_fault

end module microslip_core_standard_streams
