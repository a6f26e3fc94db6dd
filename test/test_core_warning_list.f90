!> Warnings: worst first, none twice.
module test_core_warning_list
   use microslip_core_warning_list, only: severity_doubtful, severity_note, severity_wrong, warning_list_t
   use testdrive, only: check, new_unittest, testing_error => error_type, unittest_type
   implicit none(type, external)
   private

   public :: collect_core_warning_list

contains

   subroutine collect_core_warning_list(testsuite)
      type(unittest_type), allocatable, intent(out) :: testsuite(:)

      testsuite = [new_unittest('worst first, in the order they came', test_order), &
         & new_unittest('the same words are noted once', test_once)]
   end subroutine collect_core_warning_list

   subroutine test_order(error)
      type(testing_error), allocatable, intent(out) :: error
      type(warning_list_t) :: list, other

      call check(error, list%number(), 0)
      if (allocated(error)) return
      call list%add(severity_note, 'a')
      call list%add(severity_wrong, 'b')
      call other%add(severity_doubtful, 'c')
      call other%add(severity_wrong, 'd')
      call list%append(other)
      call check(error, list%text(1)//list%text(2)//list%text(3)//list%text(4), 'bdca')
      if (allocated(error)) return
      call check(error, list%severity(3), severity_doubtful)
   end subroutine test_order

   subroutine test_once(error)
      type(testing_error), allocatable, intent(out) :: error
      type(warning_list_t) :: list

      call list%add(severity_note, 'a')
      call list%append(list)
      call list%add(severity_note, 'a')
      call check(error, list%number(), 1)
   end subroutine test_once

end module test_core_warning_list
