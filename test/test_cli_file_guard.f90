!> Tests of what a command line may write, held against what it reads.
module test_cli_file_guard
   use microslip_cli_file_guard, only: file_guard_t
   use microslip_core_error, only: error_t, status_bad_input
   use microslip_core_warning_list, only: warning_list_t
   use microslip_io_case, only: case_t
   use microslip_io_case_file, only: case_from_text
   use microslip_io_input_files, only: forget_inputs, note_input
   use support_checks, only: good
   use testdrive, only: check, new_unittest, testing_error => error_type, unittest_type
   implicit none(type, external)
   private

   public :: collect_cli_file_guard

   character(len=*), parameter :: nl = new_line('a')

contains

   subroutine collect_cli_file_guard(testsuite)
      type(unittest_type), allocatable, intent(out) :: testsuite(:)

      testsuite = [ &
         & new_unittest('a result that is an input', test_inputs), &
         & new_unittest('a result that is a file named within an input', test_read), &
         & new_unittest('cases that meet', test_between)]
   end subroutine collect_cli_file_guard

   !> A case in the folder build, which need not be there.
   subroutine make(name, case, error)
      character(len=*), intent(in) :: name
      type(case_t), intent(out) :: case
      type(testing_error), allocatable, intent(inout) :: error
      type(error_t), allocatable :: lib

      if (allocated(error)) return
      call case_from_text("&case analyses = 'preload', 'transient' /"//nl// &
         & "&model source = 'calculix', file = 'guard', mesh_file = 'guard.inp',"//nl// &
         & "  unit_length = 'mm', unit_mass = 't', unit_time = 's' /"//nl// &
         & "&interface side_a = 'a', side_b = 'b', friction = 0.5, young_modulus = 2e11, poisson_ratio = 0.3,"//nl// &
         & "  nx = 8, ny = 6, topography = 'scan' /"//nl// &
         & "&topography name = 'scan', source = 'file', file = 'guard_scan.h5', sense = 'height' /"//nl// &
         & "&reduction n_modes = 6, cache = 'guard_cache.h5' /"//nl// &
         & "&load name = 'push', node_set = 'a', direction = 0, 0, -1, size = 1.0 /"//nl// &
         & "&preload loads = 'push', load_scale = 100.0 /"//nl//"&transient duration = 1e-4 /"//nl// &
         & "&excitation load = 'push', kind = 'file', file = 'guard_table.txt' /"//nl, 'build/'//name, case, lib)
      call good(error, lib)
   end subroutine make

   subroutine test_inputs(error)
      type(testing_error), allocatable, intent(out) :: error
      character(len=*), parameter :: inputs(*) = [character(len=24) :: 'guard.nml', 'guard.sti', 'guard.mas', 'guard.dof', &
         & 'guard.inp', 'guard_scan.h5', 'guard_table.txt', 'guard_cache.h5', 'guard_cache.h5.new']
      type(case_t) :: case
      integer :: k

      call make('guard.nml', case, error)
      do k = 1, size(inputs)
         call expect('build/'//trim(inputs(k)), trim(inputs(k)))
         call expect('./build/../build//'//trim(inputs(k)), trim(inputs(k)))
      end do
      call expect('build/guard_result.h5', '')

   contains

      !> The result is refused with a message that names the input, or taken.
      subroutine expect(path, part)
         character(len=*), intent(in) :: path, part
         type(file_guard_t) :: guard
         type(warning_list_t) :: warnings
         type(error_t), allocatable :: lib

         if (allocated(error)) return
         call guard%note_case(1, case, path)
         call guard%check_case(1, warnings, lib)
         if (part == '') call good(error, lib)
         if (part == '' .or. allocated(error)) return
         call check(error, allocated(lib), path//' would be lost')
         if (.not. allocated(error)) call check(error, lib%status == status_bad_input .and. index(lib%message, part) > 0 .and. &
            & index(lib%message, 'same file') > 0, lib%message)
      end subroutine expect

   end subroutine test_inputs

   subroutine test_read(error)
      type(testing_error), allocatable, intent(out) :: error
      type(case_t) :: case
      type(file_guard_t) :: guard
      type(error_t), allocatable :: lib

      call make('guard.nml', case, error)
      if (allocated(error)) return
      call forget_inputs()
      call guard%note_case(1, case, 'build/guard_included.inp')
      call guard%check_read(1, lib)
      call good(error, lib)
      call note_input('build/guard_other.inp')
      call note_input('build/./guard_included.inp')
      call guard%check_read(1, lib)
      if (.not. allocated(error)) call check(error, allocated(lib), 'it would be lost')
      if (.not. allocated(error)) call check(error, index(lib%message, 'guard_included.inp') > 0, lib%message)
      call forget_inputs()
   end subroutine test_read

   subroutine test_between(error)
      type(testing_error), allocatable, intent(out) :: error
      type(case_t) :: one, other

      call make('guard.nml', one, error)
      call make('guard_2.nml', other, error)
      ! They share the cache, and all files that they read.
      call expect('build/guard_1.h5', 'build/guard_2.h5', .true.)
      call expect('build/guard_1.h5', './build/guard_1.h5', .false.)
      call expect('build/guard_1.h5', 'build/guard_1.h5.part', .false.)
      call expect('build/guard_2.nml', 'build/guard_2.h5', .false.)

   contains

      subroutine expect(result_of_one, result_of_other, allowed)
         character(len=*), intent(in) :: result_of_one, result_of_other
         logical, intent(in) :: allowed
         type(file_guard_t) :: guard
         type(error_t), allocatable :: lib

         if (allocated(error)) return
         call guard%note_case(1, one, result_of_one)
         call guard%note_case(2, other, result_of_other)
         call guard%check_between(lib)
         call check(error, allocated(lib) .neqv. allowed, result_of_one//' and '//result_of_other)
      end subroutine expect

   end subroutine test_between

end module test_cli_file_guard
