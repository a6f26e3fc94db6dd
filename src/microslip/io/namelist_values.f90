!> Values of a namelist key: from the text to elements and numbers, and numbers back to text.
module microslip_io_namelist_values
   use, intrinsic :: ieee_arithmetic, only: ieee_is_finite
   use, intrinsic :: ieee_exceptions, only: ieee_overflow, ieee_get_halting_mode, ieee_set_halting_mode, &
      ieee_get_flag, ieee_set_flag
   use microslip_core_kinds, only: wp
   use microslip_core_text, only: to_text, lower_case
   use microslip_io_namelist_text, only: namelist_group_t, namelist_assignment_t, namelist_value_t
   implicit none(type, external)
   private

   public :: gather_elements, text_to_real, text_to_integer, real_literal, string_literal

contains

   !> The elements of a key in array element order, from all its assignments in a group.
   pure subroutine gather_elements(group, key, rows, most, elements, problem)
      !> The group's text
      type(namelist_group_t), intent(in) :: group
      !> Key in lower case
      character(len=*), intent(in) :: key
      !> Rows of the array; 1: a list, otherwise a table (rows, :)
      integer, intent(in) :: rows
      !> Most elements there may be
      integer, intent(in) :: most
      !> Elements 1 to the last given one; text not allocated: not given
      type(namelist_value_t), allocatable, intent(out) :: elements(:)
      !> What is wrong with the subscripts, '' if nothing
      character(len=:), allocatable, intent(out) :: problem
      type(namelist_value_t), allocatable :: work(:)
      integer :: line(most), k, v, position, last

      allocate (work(most))
      line = 0
      last = 0
      problem = ''
      do k = 1, size(group%assignments)
         if (group%assignments(k)%key /= key) cycle
         do v = 1, group%assignments(k)%count
            call locate(group%assignments(k), v, rows, position, problem)
            if (problem == '' .and. position > most) problem = 'too many values'
            if (problem == '') then
               if (line(position) > 0) problem = 'given twice (lines '//to_text(line(position))//' and '// &
                  to_text(group%assignments(k)%line)//')'
            end if
            if (problem /= '') then
               allocate (elements(0))
               return
            end if
            last = max(last, position)
            if (.not. allocated(group%assignments(k)%values(v)%text)) cycle
            line(position) = group%assignments(k)%line
            work(position) = group%assignments(k)%values(v)
         end do
         if (group%assignments(k)%count < section_size(group%assignments(k), rows)) then
            problem = 'fewer values than the subscript names'
            allocate (elements(0))
            return
         end if
      end do
      elements = work(:last)
   end subroutine gather_elements

   !> How many elements a subscript names; 0 where it leaves that open.
   pure integer function section_size(assignment, rows) result(elements)
      type(namelist_assignment_t), intent(in) :: assignment
      integer, intent(in) :: rows
      integer :: first, last, d

      elements = 0
      associate (given => assignment%subscript)
         if (size(given, 2) == 0) return
         ! a(2) = 1, 2, 3 fills a list from its second element on.
         if (size(given, 2) == 1 .and. given(1, 1) == given(2, 1)) return
         elements = 1
         do d = 1, size(given, 2)
            first = max(1, given(1, d))
            last = given(2, d)
            if (last <= 0 .and. d == 1 .and. rows > 1) last = rows
            if (last <= 0) then
               elements = 0
               return
            end if
            if (last - first >= huge(1)/elements) return
            elements = elements*(last - first + 1)
         end do
      end associate
   end function section_size

   !> Position in the array, in element order, of the v-th value of an assignment.
   pure subroutine locate(assignment, v, rows, position, problem)
      type(namelist_assignment_t), intent(in) :: assignment
      integer, intent(in) :: v, rows
      integer, intent(out) :: position
      character(len=:), allocatable, intent(inout) :: problem
      integer :: first(2), last(2), height
      logical :: runs_on

      position = v
      if (size(assignment%subscript, 2) == 0) return
      if (size(assignment%subscript, 2) /= merge(1, 2, rows == 1)) then
         problem = 'takes '//trim(merge('one subscript ', 'two subscripts', rows == 1))
         return
      end if
      ! A list is a table with one row
      first = 1
      last = [rows, huge(1)]
      associate (given => assignment%subscript)
         where (given(1, :) > 0) first(3 - size(given, 2):) = given(1, :)
         where (given(2, :) > 0) last(3 - size(given, 2):) = given(2, :)
         ! a(2) = 1, 2, 3 fills a list from its second element on, as gfortran does. For table(2,1) = 1, 2, 3
         ! gfortran skips elements: refused here
         runs_on = rows == 1 .and. given(1, 1) == given(2, 1) .and. given(1, 1) > 0
      end associate
      position = huge(1)
      if (last(1) > rows .or. last(1) < first(1)) then
         problem = 'the first subscript goes from 1 to '//to_text(rows)
      else if (runs_on) then
         position = first(2) + v - 1
      else
         height = last(1) - first(1) + 1
         if (first(2) + (v - 1)/height > last(2)) then
            problem = 'more values than elements'
         else if (first(2) < huge(1)/rows - v) then
            position = (first(2) - 1 + (v - 1)/height)*rows + first(1) + mod(v - 1, height)
         end if
      end if
   end subroutine locate

   !> Read a real number in Fortran notation; false for anything else, NaN, infinity and numbers too large included.
   impure elemental logical function text_to_real(text, value)
      !> The text
      character(len=*), intent(in) :: text
      !> The number, 0 if there is none
      real(wp), intent(out) :: value
      integer :: status, sign
      logical :: halting, overflow

      value = 0.0_wp
      text_to_real = verify(lower_case(text), '0123456789+-.ed') == 0 .and. scan(text, '0123456789') > 0
      ! '1-2' is 0.01 for Fortran, and a typing error for us: a sign stands in front or behind the exponent letter
      sign = scan(text, '+-', back=.true.)
      if (sign > 1) text_to_real = text_to_real .and. scan(text(sign - 1:sign - 1), 'eEdD') == 1
      if (.not. text_to_real) return
      ! A number like 1e400 must not stop a program that traps overflow, and leave no flag behind
      call ieee_get_halting_mode(ieee_overflow, halting)
      call ieee_get_flag(ieee_overflow, overflow)
      call ieee_set_halting_mode(ieee_overflow, .false.)
      read (text, *, iostat=status) value
      call ieee_set_flag(ieee_overflow, overflow)
      call ieee_set_halting_mode(ieee_overflow, halting)
      text_to_real = status == 0
      if (status == 0) text_to_real = ieee_is_finite(value)
      if (.not. text_to_real) value = 0.0_wp
   end function text_to_real

   !> Read an integer; false for anything else.
   impure elemental logical function text_to_integer(text, value)
      !> The text
      character(len=*), intent(in) :: text
      !> The number, 0 if there is none
      integer, intent(out) :: value
      integer :: status

      value = 0
      text_to_integer = verify(text, '0123456789+-') == 0 .and. scan(text, '0123456789') > 0
      if (.not. text_to_integer) return
      read (text, *, iostat=status) value
      text_to_integer = status == 0
      if (status /= 0) value = 0
   end function text_to_integer

   !> The shortest text that reads back as exactly this number.
   function real_literal(value) result(text)
      !> A finite number
      real(wp), intent(in) :: value
      character(len=:), allocatable :: text
      real(wp) :: again
      integer :: digits, sign, exponent, last

      do digits = 6, 17
         text = to_text(value, digits)
         ! Fortran writes 1.0-120 for 1.0E-120
         sign = scan(text, '+-', back=.true.)
         if (sign > 1) then
            if (text(sign - 1:sign - 1) /= 'E') text = text(:sign - 1)//'E'//text(sign:)
         end if
         if (.not. text_to_real(text, again)) cycle
         if (abs(again - value) <= 0.0_wp) exit
      end do
      ! 1.94000E+11 to 1.94E+11, 1.00000E+11 to 1.0E+11
      exponent = index(text, 'E')
      if (exponent == 0) return
      last = verify(text(:exponent - 1), '0', back=.true.)
      if (text(last:last) == '.') last = last + 1
      text = text(:last)//text(exponent:)
   end function real_literal

   !> The string in single quotes, single quotes in it doubled.
   pure function string_literal(string) result(text)
      !> Any string without line ends; trailing blanks are dropped
      character(len=*), intent(in) :: string
      character(len=:), allocatable :: text
      integer :: k

      text = "'"
      do k = 1, len_trim(string)
         text = text//string(k:k)
         if (string(k:k) == "'") text = text//"'"
      end do
      text = text//"'"
   end function string_literal

end module microslip_io_namelist_values
