!> What is doubtful about an input or a result, collected so that the user sees all of it in one place, worst first.
!>
!> A warning never stops a run: what cannot be right is an error (`microslip_core_error`).
module microslip_core_warning_list
   implicit none(type, external)
   private

   public :: warning_list_t, severity_note, severity_doubtful, severity_wrong

   !> Worth a look: the result is probably right.
   integer, parameter :: severity_note = 1
   !> Doubtful: the result may be less accurate than it looks, or the input may not mean what it says.
   integer, parameter :: severity_doubtful = 2
   !> Most likely wrong: a unit, a sign or a file that is another one than meant.
   integer, parameter :: severity_wrong = 3

   type :: warning_t
      integer :: severity = severity_note
      character(len=:), allocatable :: text
   end type warning_t

   !> An empty list means: nothing to warn of so far.
   type :: warning_list_t
      private
      type(warning_t), allocatable :: items(:)
   contains
      procedure :: add
      procedure :: append
      procedure :: number
      procedure :: severity
      procedure :: text
   end type warning_list_t

contains

   !> Note one more warning. One with the same words as an earlier one is not repeated. The list stays sorted, worst first;
   !> of equal severity the earlier one comes first.
   pure subroutine add(self, severity, text)
      class(warning_list_t), intent(inout) :: self
      !> One of the named severities
      integer, intent(in) :: severity
      !> What was found, where, what it probably is, what to do; one line
      character(len=*), intent(in) :: text
      type(warning_t), allocatable :: longer(:)
      integer :: k, place

      place = 1
      do k = 1, self%number()
         if (self%items(k)%text == text) return
         if (self%items(k)%severity >= severity) place = k + 1
      end do
      allocate (longer(self%number() + 1))
      do k = 1, self%number()
         longer(merge(k, k + 1, k < place)) = self%items(k)
      end do
      longer(place)%severity = severity
      longer(place)%text = text
      call move_alloc(longer, self%items)
   end subroutine add

   !> Note all warnings of another list.
   pure subroutine append(self, other)
      class(warning_list_t), intent(inout) :: self
      type(warning_list_t), intent(in) :: other
      integer :: k

      do k = 1, other%number()
         call self%add(other%items(k)%severity, other%items(k)%text)
      end do
   end subroutine append

   !> How many there are.
   pure integer function number(self)
      class(warning_list_t), intent(in) :: self
      number = 0
      if (allocated(self%items)) number = size(self%items)
   end function number

   !> Severity of warning k, worst first.
   pure integer function severity(self, k)
      class(warning_list_t), intent(in) :: self
      !> 1 to `number()`
      integer, intent(in) :: k
      severity = self%items(k)%severity
   end function severity

   !> Words of warning k, worst first.
   pure function text(self, k)
      class(warning_list_t), intent(in) :: self
      !> 1 to `number()`
      integer, intent(in) :: k
      character(len=:), allocatable :: text
      text = self%items(k)%text
   end function text

end module microslip_core_warning_list
