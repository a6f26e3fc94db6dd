!> A reading position in a text of several lines.
module microslip_io_text_cursor
   use microslip_core_text, only: to_text
   implicit none(type, external)
   private

   public :: text_cursor_t, cursor_at_start, letters, digits, blanks, newline

   character(len=*), parameter :: letters = 'abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ'
   character(len=*), parameter :: digits = '0123456789'
   character(len=*), parameter :: newline = achar(10)
   !> Blank, tab, and the carriage return of Windows files
   character(len=*), parameter :: blanks = ' '//achar(9)//achar(13)

   !> The text always ends in a newline, so there is a letter under the cursor until `finished`.
   type :: text_cursor_t
      character(len=:), allocatable :: text
      !> Name of the file, for fault lines
      character(len=:), allocatable :: file
      !> Position, number of the line, position of the newline at its end
      integer :: at = 1, line = 1, line_end = 0
   contains
      procedure :: finished
      procedure :: letter
      procedure :: rest
      procedure :: skip_blank
      procedure :: skip_line
      procedure :: take_name
      procedure :: place
   end type text_cursor_t

contains

   !> A cursor on the first letter of a text (behind a byte order mark, if there is one).
   pure type(text_cursor_t) function cursor_at_start(text, file) result(cursor)
      !> The text, lines separated by newlines
      character(len=*), intent(in) :: text
      !> Name of the file, for fault lines
      character(len=*), intent(in) :: file

      cursor%text = text//newline
      cursor%file = file
      if (index(text, char(239)//char(187)//char(191)) == 1) cursor%at = 4
      cursor%line_end = index(cursor%text, newline)
   end function cursor_at_start

   !> Whether the whole text has been read.
   pure logical function finished(self)
      class(text_cursor_t), intent(in) :: self
      finished = self%at > len(self%text)
   end function finished

   !> The letter under the cursor, a blank when finished.
   pure character(len=1) function letter(self)
      class(text_cursor_t), intent(in) :: self
      letter = ' '
      if (self%at <= len(self%text)) letter = self%text(self%at:self%at)
   end function letter

   !> The rest of the line with the newline at its end.
   pure function rest(self)
      class(text_cursor_t), intent(in) :: self
      character(len=:), allocatable :: rest
      rest = self%text(self%at:self%line_end)
   end function rest

   !> Move behind blanks, line ends and comments.
   pure subroutine skip_blank(self)
      class(text_cursor_t), intent(inout) :: self

      do while (.not. self%finished())
         if (self%letter() == '!' .or. self%letter() == newline) then
            call self%skip_line()
         else if (index(blanks, self%letter()) > 0) then
            self%at = self%at + 1
         else
            exit
         end if
      end do
   end subroutine skip_blank

   !> Move to the beginning of the next line.
   pure subroutine skip_line(self)
      class(text_cursor_t), intent(inout) :: self
      self%at = self%line_end + 1
      self%line = self%line + 1
      self%line_end = self%line_end + index(self%text(self%at:), newline)
   end subroutine skip_line

   !> Take letters, digits and underscores.
   function take_name(self) result(name)
      class(text_cursor_t), intent(inout) :: self
      character(len=:), allocatable :: name
      integer :: length

      length = verify(self%rest(), letters//digits//'_') - 1
      name = self%text(self%at:self%at + length - 1)
      self%at = self%at + length
   end function take_name

   !> 'file, line 12: '
   pure function place(self) result(text)
      class(text_cursor_t), intent(in) :: self
      character(len=:), allocatable :: text
      text = self%file//', line '//to_text(self%line)//': '
   end function place

end module microslip_io_text_cursor
