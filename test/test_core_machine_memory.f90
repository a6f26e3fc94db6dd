!> What control groups leave of the memory: from files laid out as the system lays them out.
module test_core_machine_memory
   use microslip_core_kinds, only: wp
   use microslip_core_machine_memory, only: available_memory, group_memory
   use testdrive, only: check, new_unittest, testing_error => error_type, unittest_type
   implicit none(type, external)
   private

   public :: collect_core_machine_memory

   character(len=*), parameter :: root = 'build/test_groups', list = root//'/list'

contains

   subroutine collect_core_machine_memory(testsuite)
      type(unittest_type), allocatable, intent(out) :: testsuite(:)

      testsuite = [new_unittest('version 2: the group and all above it count', test_version_2), &
         & new_unittest('version 1: only the memory controller counts', test_version_1), &
         & new_unittest('no limit, no groups', test_none), &
         & new_unittest('this machine has memory', test_here)]
   end subroutine collect_core_machine_memory

   !> Write a file of one text.
   subroutine write_file(path, text)
      character(len=*), intent(in) :: path, text
      integer :: unit

      call execute_command_line('mkdir -p '//root//'/a/b '//root//'/memory/a')
      open (newunit=unit, file=path, status='replace', action='write')
      write (unit, '(a)') text
      close (unit)
   end subroutine write_file

   !> The group has 600 of 1000 bytes left, of which 100 are file pages; the one above has 500.
   subroutine test_version_2(error)
      type(testing_error), allocatable, intent(out) :: error

      call write_file(list, '0::/a/b')
      call write_file(root//'/a/b/memory.max', '1000')
      call write_file(root//'/a/b/memory.current', '500')
      call write_file(root//'/a/b/memory.stat', 'anon 400'//new_line('a')//'inactive_file 100')
      call write_file(root//'/a/memory.max', 'max')
      call check(error, group_memory(list, root), 600.0_wp)
      if (allocated(error)) return
      call write_file(root//'/a/memory.max', '2000')
      call write_file(root//'/a/memory.current', '1500')
      call check(error, group_memory(list, root), 500.0_wp)
   end subroutine test_version_2

   subroutine test_version_1(error)
      type(testing_error), allocatable, intent(out) :: error

      call write_file(list, '3:cpuset:/'//new_line('a')//'4:hugetlb,memory:/a'//new_line('a')//'2:cpu,cpuacct:/a')
      call write_file(root//'/memory/a/memory.limit_in_bytes', '3000')
      call write_file(root//'/memory/a/memory.usage_in_bytes', '1000')
      call check(error, group_memory(list, root), 2000.0_wp)
      if (allocated(error)) return
      ! As it is written where there is no limit
      call write_file(root//'/memory/a/memory.limit_in_bytes', '9223372036854771712')
      call check(error, group_memory(list, root), 0.0_wp)
   end subroutine test_version_1

   subroutine test_none(error)
      type(testing_error), allocatable, intent(out) :: error

      call check(error, group_memory(root//'/not_there', root), 0.0_wp)
      if (allocated(error)) return
      call write_file(list, '0::/')
      call check(error, group_memory(list, root//'/memory'), 0.0_wp)
   end subroutine test_none

   subroutine test_here(error)
      type(testing_error), allocatable, intent(out) :: error
      call check(error, available_memory() > 1.0e6_wp, 'available memory')
   end subroutine test_here

end module test_core_machine_memory
