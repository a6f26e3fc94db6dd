!> Ranges of allowed numbers that can say in words what they allow.
module microslip_io_value_range
   use microslip_core_kinds, only: wp
   use microslip_core_text, only: to_text
   implicit none(type, external)
   private

   public :: range_t, any_value, positive, non_negative, at_least, between

   !> Numbers from `lower` to `upper`; an open end does not belong to the range.
   type :: range_t
      real(wp) :: lower = -huge(1.0_wp), upper = huge(1.0_wp)
      logical :: lower_open = .false., upper_open = .false.
   contains
      procedure :: includes
      procedure :: describe
   end type range_t

   !> Any finite number.
   type(range_t), parameter :: any_value = range_t()
   !> x > 0
   type(range_t), parameter :: positive = range_t(lower=0.0_wp, lower_open=.true.)
   !> x >= 0
   type(range_t), parameter :: non_negative = range_t(lower=0.0_wp)

contains

   !> x >= lower, and x <= upper where it is given.
   pure type(range_t) function at_least(lower, upper)
      !> Least allowed value
      integer, intent(in) :: lower
      !> Greatest allowed value
      integer, intent(in), optional :: upper
      at_least%lower = real(lower, wp)
      if (present(upper)) at_least%upper = real(upper, wp)
   end function at_least

   !> lower < x < upper; an end belongs to the range where `closed_*` says so.
   pure type(range_t) function between(lower, upper, closed_lower, closed_upper)
      !> Ends of the range
      real(wp), intent(in) :: lower, upper
      !> Whether the ends are allowed values (no by default)
      logical, intent(in), optional :: closed_lower, closed_upper
      between = range_t(lower, upper, .true., .true.)
      if (present(closed_lower)) between%lower_open = .not. closed_lower
      if (present(closed_upper)) between%upper_open = .not. closed_upper
   end function between

   !> Whether x lies in the range.
   pure logical function includes(self, x)
      class(range_t), intent(in) :: self
      !> The number to test
      real(wp), intent(in) :: x
      includes = x >= self%lower .and. x <= self%upper
      if (self%lower_open .and. .not. x > self%lower) includes = .false.
      if (self%upper_open .and. .not. x < self%upper) includes = .false.
   end function includes

   !> '> 0 and <= 0.5', '' for any finite number.
   pure function describe(self) result(text)
      class(range_t), intent(in) :: self
      character(len=:), allocatable :: text

      text = ''
      if (self%lower > -huge(1.0_wp)) text = trim(merge('> ', '>=', self%lower_open))//' '//to_text(self%lower)
      if (self%upper < huge(1.0_wp)) then
         if (len(text) > 0) text = text//' and '
         text = text//trim(merge('< ', '<=', self%upper_open))//' '//to_text(self%upper)
      end if
   end function describe

end module microslip_io_value_range
