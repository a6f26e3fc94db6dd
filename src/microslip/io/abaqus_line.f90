!> Lines of Abaqus and CalculiX decks: parameters of cards, fields of data lines, and what is wrong with a field.
module microslip_io_abaqus_line
   use microslip_core_kinds, only: wp
   use microslip_core_text, only: lower_case, to_text
   use microslip_io_line_reader, only: next_integer, next_real
   implicit none(type, external)
   private

   public :: parameter_value, has_parameter, keyword_of, unquoted, upper_case, without_tabs, skip_comma
   public :: at_field_end, field, field_count, label_fault, real_fault

contains

   !> The card's name in lower case.
   pure function keyword_of(line) result(keyword)
      !> '*NODE, NSET=all'
      character(len=*), intent(in) :: line
      character(len=:), allocatable :: keyword
      keyword = lower_case(trim(adjustl(line(2:scan(line//',', ',') - 1))))
   end function keyword_of

   !> Value of 'name=value' on a card, empty if it is not there.
   pure function parameter_value(line, name) result(value)
      !> The card, and the parameter in lower case
      character(len=*), intent(in) :: line, name
      character(len=:), allocatable :: value
      character(len=:), allocatable :: part
      integer :: start, comma, equals

      value = ''
      start = scan(line//',', ',') + 1
      do while (start <= len(line))
         comma = start + scan(line(start:)//',', ',') - 2
         part = line(start:comma)
         equals = index(part, '=')
         if (equals > 0) then
            if (lower_case(trim(adjustl(part(:equals - 1)))) == name) value = unquoted(part(equals + 1:))
         end if
         start = comma + 2
      end do
   end function parameter_value

   !> Whether a card carries a parameter, with or without a value.
   pure logical function has_parameter(line, name)
      !> The card, and the parameter in lower case
      character(len=*), intent(in) :: line, name
      integer :: start, comma

      has_parameter = .false.
      start = scan(line//',', ',') + 1
      do while (start <= len(line))
         comma = start + scan(line(start:)//',', ',') - 2
         if (lower_case(trim(adjustl(line(start:start + scan(line(start:comma)//'=', '=') - 2)))) == name) &
            has_parameter = .true.
         start = comma + 2
      end do
   end function has_parameter

   !> Without surrounding blanks and quotes.
   pure function unquoted(text)
      character(len=*), intent(in) :: text
      character(len=:), allocatable :: unquoted

      unquoted = trim(adjustl(text))
      if (len(unquoted) < 2) return
      if (unquoted(1:1) == '"' .and. unquoted(len(unquoted):) == '"') unquoted = unquoted(2:len(unquoted) - 1)
   end function unquoted

   pure function upper_case(text)
      character(len=*), intent(in) :: text
      character(len=len(text)) :: upper_case
      integer :: k

      upper_case = text
      do k = 1, len(text)
         if (text(k:k) >= 'a' .and. text(k:k) <= 'z') upper_case(k:k) = achar(iachar(text(k:k)) - 32)
      end do
   end function upper_case

   !> A blank in place of every tabulator, and none around the line.
   pure function without_tabs(text) result(line)
      character(len=*), intent(in) :: text
      character(len=:), allocatable :: line
      integer :: k

      line = text
      k = scan(line, achar(9))
      do while (k > 0)
         line(k:k) = ' '
         k = scan(line, achar(9))
      end do
      line = trim(adjustl(line))
   end function without_tabs

   !> Move behind blanks and one comma.
   pure subroutine skip_comma(line, p)
      character(len=*), intent(in) :: line
      integer, intent(inout) :: p
      logical :: behind_comma

      behind_comma = .false.
      do while (p <= len(line))
         if (line(p:p) == ',' .and. .not. behind_comma) then
            behind_comma = .true.
         else if (line(p:p) /= ' ') then
            return
         end if
         p = p + 1
      end do
   end subroutine skip_comma

   !> Whether nothing but blanks stands before the next comma or the end. (CalculiX removes blanks: '1 2' is 12 to it.)
   pure logical function at_field_end(line, p)
      character(len=*), intent(in) :: line
      integer, intent(in) :: p
      integer :: k

      k = verify(line(p:), ' ')
      at_field_end = k == 0
      if (k > 0) at_field_end = line(p + k - 1:p + k - 1) == ','
   end function at_field_end

   !> Number of fields of a data line; a comma at its end begins no other one.
   pure integer function field_count(line)
      character(len=*), intent(in) :: line
      integer :: k

      field_count = 0
      if (line == '') return
      field_count = 1 + count([(line(k:k) == ',', k=1, len_trim(line) - 1)])
   end function field_count

   !> One field of a data line, '' if there is none.
   pure function field(line, number) result(text)
      character(len=*), intent(in) :: line
      !> From 1
      integer, intent(in) :: number
      character(len=:), allocatable :: text
      integer :: k, start, comma

      text = ''
      start = 1
      do k = 1, number
         if (start > len(line)) return
         comma = start + scan(line(start:)//',', ',') - 1
         if (k == number) text = trim(adjustl(line(start:comma - 1)))
         start = comma + 1
      end do
   end function field

   !> What is wrong with a node or element number; '' if it is right.
   pure function label_fault(text) result(fault)
      character(len=*), intent(in) :: text
      character(len=:), allocatable :: fault
      integer :: p, value
      logical :: ok

      fault = ''
      p = 1
      call next_integer(text, p, value, ok)
      if (ok) ok = text(p:) == ''
      if (ok .and. value >= 1) return
      if (verify(trim(text), '0123456789') == 0 .and. len_trim(text) > 0 .and. .not. ok) then
         fault = "the number '"//trim(text)//"' is larger than "//to_text(huge(1))//', the largest that can be read'
      else
         fault = "'"//trim(text)//"' is not a number from 1"
      end if
   end function label_fault

   !> What is wrong with a real number; '' if it is right, or empty.
   pure function real_fault(text) result(fault)
      character(len=*), intent(in) :: text
      character(len=:), allocatable :: fault
      real(wp) :: value
      integer :: p, sign
      logical :: ok

      fault = ''
      if (text == '') return
      p = 1
      call next_real(text, p, value, ok)
      if (ok) ok = text(p:) == ''
      if (ok) return
      fault = "'"//trim(text)//"' is not a finite number"
      sign = scan(trim(text), '+-', back=.true.)
      if (sign < 2 .or. verify(trim(text), '0123456789.+-') > 0) return
      if (scan(text(sign - 1:sign - 1), '0123456789.') == 0 .or. sign == len_trim(text)) return
      fault = "'"//trim(text)//"' is not a number: its exponent needs a letter ('"//text(:sign - 1)//'E'//trim(text(sign:))// &
         "'), CalculiX does not read it either"
   end function real_fault

end module microslip_io_abaqus_line
