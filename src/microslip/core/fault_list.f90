!> All faults of an input, collected so that the user sees them at once, one line each.
module microslip_core_fault_list
   use microslip_core_error, only: error_t, bad_input
   implicit none(type, external)
   private

   public :: fault_list_t

   !> Lines of text, one per fault. An empty list means: nothing wrong so far.
   type :: fault_list_t
      private
      integer :: lines = 0
      character(len=:), allocatable :: text
   contains
      procedure :: add
      procedure :: append
      procedure :: number
      procedure :: raise
   end type fault_list_t

contains

   !> Note one more fault.
   pure subroutine add(self, line)
      class(fault_list_t), intent(inout) :: self
      !> File, place, value and what is allowed; one line
      character(len=*), intent(in) :: line

      if (self%lines == 0) then
         self%text = line
      else
         self%text = self%text//new_line('a')//line
      end if
      self%lines = self%lines + 1
   end subroutine add

   !> Note all faults of another list.
   pure subroutine append(self, other)
      class(fault_list_t), intent(inout) :: self
      !> The list whose lines are added behind
      class(fault_list_t), intent(in) :: other

      if (other%lines == 0) return
      call self%add(other%text)
      self%lines = self%lines + other%lines - 1
   end subroutine append

   !> How many faults are noted.
   pure integer function number(self)
      class(fault_list_t), intent(in) :: self
      number = self%lines
   end function number

   !> Turn the list into an error (status of a bad input); no error if the list is empty.
   subroutine raise(self, error)
      class(fault_list_t), intent(in) :: self
      !> Its message holds all lines
      type(error_t), allocatable, intent(out) :: error

      if (self%lines > 0) call bad_input(error, self%text)
   end subroutine raise

end module microslip_core_fault_list
