!> Runs the tests: all of them, one suite, or one test (`tester [suite [test]]`).
program main
   use, intrinsic :: iso_fortran_env, only: error_unit
   use testdrive, only: run_testsuite, run_selected, new_testsuite, testsuite_type, select_suite, get_argument
   implicit none(type, external)
   integer :: failed
   failed = 0
   if (failed > 0) error stop
end program main
