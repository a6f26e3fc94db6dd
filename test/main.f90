!> Runs the tests: all of them, one suite, or one test (`tester [suite [test]]`).
program main
   use, intrinsic :: iso_fortran_env, only: error_unit
   use test_contact_solvers, only: collect_contact_solvers
   use testdrive, only: run_testsuite, run_selected, new_testsuite, testsuite_type, select_suite, get_argument
   implicit none(type, external)
   type(testsuite_type), allocatable :: suites(:)
   character(len=:), allocatable :: suite, test
   integer :: k, failed

   suites = [new_testsuite('contact_solvers', collect_contact_solvers)]

   failed = 0
   call get_argument(1, suite)
   call get_argument(2, test)
   if (allocated(suite)) then
      k = select_suite(suites, suite)
      if (k == 0) then
         write (error_unit, '(2a)') 'no such suite: ', suite
         error stop
      end if
      if (allocated(test)) then
         call run_selected(suites(k)%collect, test, error_unit, failed)
      else
         call run_testsuite(suites(k)%collect, error_unit, failed, parallel=.false.)
      end if
   else
      do k = 1, size(suites)
         write (error_unit, '(2a)') '# ', suites(k)%name
         call run_testsuite(suites(k)%collect, error_unit, failed, parallel=.false.)
      end do
   end if
   if (failed > 0) then
      write (error_unit, '(i0,a)') failed, ' test(s) failed'
      error stop
   end if
end program main
