!> Errors as values: library code never stops, it hands an `error_t` to its caller.
!>
!> Convention: a procedure that can fail ends in `type(error_t), allocatable, intent(out) :: error`;
!> the caller tests `allocated(error)`. Only `app/main.f90` turns an error into an exit status.
module microslip_core_error
   implicit none(type, external)
   private

   public :: error_t, failure, bad_input, status_failed, status_bad_input

   !> Exit status of the program for a computation that failed.
   integer, parameter :: status_failed = 1
   !> Exit status of the program for a wrong input or command line.
   integer, parameter :: status_bad_input = 2

   !> What went wrong, in words for the user, and the exit status it leads to.
   type :: error_t
      integer :: status = status_failed
      character(len=:), allocatable :: message
   end type error_t

contains

   !> Report a computation that failed (not converged, out of memory, disk full).
   subroutine failure(error, message)
      !> The error to be set
      type(error_t), allocatable, intent(out) :: error
      !> What failed and where
      character(len=*), intent(in) :: message

      allocate (error)
      error%status = status_failed
      error%message = message
   end subroutine failure

   !> Report an input that is wrong (the message names the file and the place in it).
   subroutine bad_input(error, message)
      !> The error to be set
      type(error_t), allocatable, intent(out) :: error
      !> Which file, which place, which value, and what is allowed
      character(len=*), intent(in) :: message

      allocate (error)
      error%status = status_bad_input
      error%message = message
   end subroutine bad_input

end module microslip_core_error
