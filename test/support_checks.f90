!> Small helpers that many tests share.
module support_checks
   use microslip_core_error, only: error_t
   use testdrive, only: test_failed, testing_error => error_type
   implicit none(type, external)
   private

   public :: good, remove

contains

   !> Fail the test if a library call failed.
   subroutine good(error, lib)
      type(testing_error), allocatable, intent(out) :: error
      type(error_t), allocatable, intent(in) :: lib
      if (allocated(lib)) call test_failed(error, lib%message)
   end subroutine good

   !> Delete a file if it is there.
   subroutine remove(path)
      character(len=*), intent(in) :: path
      integer :: unit, status
      open (newunit=unit, file=path, iostat=status)
      if (status == 0) close (unit, status='delete')
   end subroutine remove

end module support_checks
