!> Numbers to text and small string helpers, for messages and logs.
module microslip_core_text
   use microslip_core_kinds, only: wp, i8
   implicit none(type, external)
   private

   public :: to_text, lower_case

   !> The shortest readable form of a number.
   interface to_text
      module procedure :: integer_to_text
      module procedure :: long_to_text
      module procedure :: real_to_text
      module procedure :: logical_to_text
   end interface to_text

contains

   pure function integer_to_text(value) result(text)
      integer, intent(in) :: value
      character(len=:), allocatable :: text
      text = long_to_text(int(value, i8))
   end function integer_to_text

   pure function long_to_text(value) result(text)
      integer(i8), intent(in) :: value
      character(len=:), allocatable :: text
      character(len=24) :: buffer
      write (buffer, '(i0)') value
      text = trim(buffer)
   end function long_to_text

   !> Real number with `digits` significant digits (6 by default); plain notation where it is short.
   pure function real_to_text(value, digits) result(text)
      real(wp), intent(in) :: value
      integer, intent(in), optional :: digits
      character(len=:), allocatable :: text
      character(len=40) :: buffer, form
      integer :: d, last

      d = 6
      if (present(digits)) d = digits
      if (value == 0.0_wp) then
         text = '0'
      else if (abs(value) >= 1.0e-3_wp .and. abs(value) < 10.0_wp**min(d, 9)) then
         write (form, '(a,i0,a)') '(f0.', max(0, d - 1 - floor(log10(abs(value)))), ')'
         write (buffer, form) value
         text = trim(adjustl(buffer))
         if (index(text, '.') > 0) then
            last = verify(text, '0', back=.true.)
            if (text(last:last) == '.') last = last - 1
            text = text(:last)
         end if
         if (text(1:1) == '.') text = '0'//text
         if (len(text) > 1) then
            if (text(1:2) == '-.') text = '-0'//text(2:)
         end if
      else
         write (form, '(a,i0,a)') '(es24.', d - 1, ')'
         write (buffer, form) value
         text = trim(adjustl(buffer))
      end if
   end function real_to_text

   pure function logical_to_text(value) result(text)
      logical, intent(in) :: value
      character(len=:), allocatable :: text
      text = trim(merge('true ', 'false', value))
   end function logical_to_text

   !> The string with A-Z made a-z.
   pure function lower_case(string) result(lower)
      character(len=*), intent(in) :: string
      character(len=len(string)) :: lower
      integer :: k, code

      do k = 1, len(string)
         code = iachar(string(k:k))
         if (code >= iachar('A') .and. code <= iachar('Z')) code = code + 32
         lower(k:k) = achar(code)
      end do
   end function lower_case

end module microslip_core_text
