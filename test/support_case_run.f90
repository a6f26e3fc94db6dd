!> Cases as text, changed and run: from a case file to its result file, in silence.
module support_case_run
   use microslip_cli_command_line, only: command_line_t, text_t
   use microslip_cli_driver, only: run_cases
   use microslip_core_error, only: error_t
   implicit none(type, external)
   private

   public :: file_text, write_text, changed, run_case

   !> A text with one or several others replaced.
   interface changed
      module procedure :: changed_one, changed_several
   end interface changed

contains

   !> All that is in a file.
   function file_text(path) result(text)
      character(len=*), intent(in) :: path
      character(len=:), allocatable :: text
      integer :: unit, length

      open (newunit=unit, file=path, access='stream', form='unformatted', status='old', action='read')
      inquire (unit=unit, size=length)
      allocate (character(len=length) :: text)
      read (unit) text
      close (unit)
   end function file_text

   !> Make a file of a text.
   subroutine write_text(path, text)
      character(len=*), intent(in) :: path, text
      integer :: unit

      open (newunit=unit, file=path, access='stream', form='unformatted', status='replace')
      write (unit) text
      close (unit)
   end subroutine write_text

   !> `old` replaced wherever it stands; that it stands nowhere is told in the text, which no case reader takes.
   function changed_one(text, old, new, once) result(other)
      character(len=*), intent(in) :: text, old, new
      !> Replace the first one only
      logical, intent(in), optional :: once
      character(len=:), allocatable :: other
      integer :: at, from

      other = ''
      from = 1
      do
         at = index(text(from:), old)
         if (at == 0) exit
         other = other//text(from:from + at - 2)//new
         from = from + at - 1 + len(old)
         if (present(once)) then
            if (once) exit
         end if
      end do
      if (from == 1) other = 'no such text: '//old//' '
      other = other//text(from:)
   end function changed_one

   !> One after the other; trailing blanks do not count.
   function changed_several(text, old, new) result(other)
      character(len=*), intent(in) :: text, old(:), new(:)
      character(len=:), allocatable :: other
      integer :: k

      other = text
      do k = 1, size(old)
         other = changed_one(other, trim(old(k)), trim(new(k)))
      end do
   end function changed_several

   !> Write a case and run it, or check it only.
   subroutine run_case(text, case_path, result_path, lib, check_only)
      character(len=*), intent(in) :: text, case_path, result_path
      type(error_t), allocatable, intent(out) :: lib
      logical, intent(in), optional :: check_only
      type(command_line_t) :: line

      call write_text(case_path, text)
      line%cases = [text_t(case_path)]
      line%output = result_path
      line%quiet = .true.
      if (present(check_only)) line%check = check_only
      call run_cases(line, lib)
   end subroutine run_case

end module support_case_run
