!> Tests of what a run asks of the machine: the estimates against what it takes, and refusals that leave nothing behind.
!> The shipped coarse S4 Beam on coarser grids.
module test_cli_demand
   use microslip_cli_demand, only: demand_t, estimate_demand
   use microslip_cli_scene, only: build_scene, scene_t
   use microslip_core_error, only: error_t, status_failed
   use microslip_core_kinds, only: wp, i8
   use microslip_core_machine_disk, only: free_space
   use microslip_core_machine_memory, only: available_memory, peak_memory, resident_memory
   use microslip_core_text, only: to_text
   use microslip_fe_reduced_model, only: reduced_model_t
   use microslip_io_case, only: case_t
   use microslip_io_case_file, only: read_case
   use support_case_run, only: changed, file_text, run_case, write_text
   use support_checks, only: good, remove
   use testdrive, only: check, new_unittest, testing_error => error_type, unittest_type
   implicit none(type, external)
   private

   public :: collect_cli_demand

   character(len=*), parameter :: case_path = 'build/test_cli_demand.nml', result_path = 'build/test_cli_demand.h5', &
      & shipped = 'input/s4_ringdown.nml', cut = '&transient'

contains

   subroutine collect_cli_demand(testsuite)
      type(unittest_type), allocatable, intent(out) :: testsuite(:)

      testsuite = [ &
         & new_unittest('what the machine tells', test_machine), &
         & new_unittest('size of the result file', test_file_size), &
         & new_unittest('peak of the memory', test_memory), &
         & new_unittest('a file that is too large is refused before anything is computed', test_disk), &
         & new_unittest('the same where the reduction tells the time step', test_disk_behind_reduction), &
         & new_unittest('matrices that are too large are refused', test_matrices), &
         & new_unittest('grids that are too large are refused', test_grids)]
   end subroutine collect_cli_demand

   !> The shipped case on grids of nx x ny, all points in potential contact, with other groups for time and output.
   function case_text(grid, rest) result(text)
      character(len=*), intent(in) :: grid, rest
      character(len=:), allocatable :: text

      text = file_text(shipped)
      text = changed(text(:index(text, cut) - 1), [character(len=64) :: "file = 's4_coarse", 'nx = 42, ny = 26', 'n_modes = 30'], &
         & [character(len=64) :: "file = '../input/s4_coarse", grid//", potential = 'all'", 'n_modes = 8'])
      text = text//"&excitation load = 'impact', kind = 'half_sine', amplitude = 500.0, duration = 0.5e-3 /"//new_line('a')//rest &
         & //new_line('a')
   end function case_text

   subroutine clean_up()
      call remove(case_path)
      call remove(result_path)
   end subroutine clean_up

   !> A refusal with the words and nothing left behind.
   subroutine check_refused(error, lib, words)
      type(testing_error), allocatable, intent(out) :: error
      type(error_t), allocatable, intent(in) :: lib
      character(len=*), intent(in) :: words
      logical :: there

      call check(error, allocated(lib), 'accepted')
      if (allocated(error)) return
      call check(error, lib%status == status_failed .and. index(lib%message, words) > 0 .and. index(lib%message, ' GB') > 0, &
         & lib%message)
      if (allocated(error)) return
      inquire (file=result_path, exist=there)
      if (.not. there) inquire (file=result_path//'.part', exist=there)
      call check(error, .not. there, 'something was written')
   end subroutine check_refused

   subroutine test_machine(error)
      type(testing_error), allocatable, intent(out) :: error

      ! Only Linux tells.
      if (available_memory() <= 0.0_wp) return
      call check(error, resident_memory() > 1.0e6_wp .and. resident_memory() <= peak_memory(), 'memory of the process')
      if (allocated(error)) return
      call check(error, free_space('') > 0.0_wp .and. free_space('build/') > 0.0_wp, 'free space')
      if (allocated(error)) return
      call check(error, free_space('no such folder/') < 0.0_wp, 'free space of nothing')
   end subroutine test_machine

   !> The estimate of a case before it is run.
   subroutine estimate(text, demand, lib)
      character(len=*), intent(in) :: text
      type(demand_t), intent(out) :: demand
      type(error_t), allocatable, intent(out) :: lib
      type(case_t) :: case
      type(scene_t) :: scene
      type(reduced_model_t) :: reduced

      call write_text(case_path, text)
      call read_case(case_path, case, lib)
      if (.not. allocated(lib)) call build_scene(case, scene, lib)
      if (.not. allocated(lib)) demand = estimate_demand(case, scene, reduced)
   end subroutine estimate

   subroutine test_file_size(error)
      type(testing_error), allocatable, intent(out) :: error
      !> Of estimate over size: compression depends on the numbers
      real(wp), parameter :: least = 0.9_wp, most = 1.6_wp
      type(error_t), allocatable :: lib
      type(demand_t) :: demand
      character(len=:), allocatable :: text
      real(wp) :: ratio
      integer(i8) :: bytes
      integer :: k

      do k = 1, 2
         text = case_text('nx = 10, ny = 6', &
            & "&transient duration = 0.05, time_step = 2e-5 / &output sensors = 'sensor', stride = "//to_text(9*k - 8)// &
            & ", snapshots = 0.01, 0.02, 0.05 /")
         call estimate(text, demand, lib)
         call good(error, lib)
         if (allocated(error)) exit
         call run_case(text, case_path, result_path, lib)
         call good(error, lib)
         if (allocated(error)) exit
         inquire (file=result_path, size=bytes)
         ratio = (demand%file + demand%samples*demand%sample)/bytes
         call check(error, ratio > least .and. ratio < most, 'estimate over size: '//to_text(ratio))
         if (allocated(error)) exit
      end do
      call clean_up()
   end subroutine test_file_size

   subroutine test_memory(error)
      type(testing_error), allocatable, intent(out) :: error
      !> Of peak over estimate: tests before this one have raised the peak already, so that only the upper side is looked at
      real(wp), parameter :: most = 1.2_wp
      type(error_t), allocatable :: lib
      type(demand_t) :: demand
      character(len=:), allocatable :: text
      real(wp) :: before

      before = peak_memory()
      if (before <= 0.0_wp) return
      text = case_text('nx = 16, ny = 10', "&transient duration = 1e-3 / &output sensors = 'sensor' /")
      call estimate(text, demand, lib)
      call good(error, lib)
      if (allocated(error)) return
      call run_case(text, case_path, result_path, lib)
      call good(error, lib)
      if (.not. allocated(error)) call check(error, peak_memory() <= max(before, most*(demand%memory_now + demand%memory_more)), &
         & to_text(peak_memory())//' B, estimated '//to_text(demand%memory_now + demand%memory_more))
      call clean_up()
   end subroutine test_memory

   subroutine test_disk(error)
      type(testing_error), allocatable, intent(out) :: error
      type(error_t), allocatable :: lib
      character(len=:), allocatable :: text

      if (free_space('build/') < 0.0_wp) return
      text = case_text('nx = 10, ny = 6', "&transient duration = 9e3, time_step = 1e-5 / &output sensors = 1000*'sensor' /")
      call run_case(text, case_path, result_path, lib)
      call check_refused(error, lib, 'recorded steps of')
      if (.not. allocated(error)) then
         call run_case(text, case_path, result_path, lib, check_only=.true.)
         call check_refused(error, lib, 'would need about')
      end if
      call clean_up()
   end subroutine test_disk

   subroutine test_disk_behind_reduction(error)
      type(testing_error), allocatable, intent(out) :: error
      type(error_t), allocatable :: lib

      if (free_space('build/') < 0.0_wp) return
      call run_case(case_text('nx = 10, ny = 6', &
         & "&transient duration = 9e3 / &output sensors = 1000*'sensor' /"), case_path, result_path, lib)
      call check_refused(error, lib, 'recorded steps of')
      call clean_up()
   end subroutine test_disk_behind_reduction

   subroutine test_matrices(error)
      type(testing_error), allocatable, intent(out) :: error
      type(error_t), allocatable :: lib
      character(len=:), allocatable :: text

      ! 340 000 unknowns: 3.7 TB.
      if (available_memory() <= 0.0_wp .or. available_memory() > 3.0e12_wp) return
      text = case_text('nx = 240, ny = 240', "&contact compliance = 'dense' / &transient duration = 1e-3 / "// &
         & "&output sensors = 'sensor' /")
      call run_case(text, case_path, result_path, lib)
      call check_refused(error, lib, 'contact matrices of')
      call clean_up()
   end subroutine test_matrices

   subroutine test_grids(error)
      type(testing_error), allocatable, intent(out) :: error
      type(error_t), allocatable :: lib
      character(len=:), allocatable :: text

      ! Two grids of 10^8 points: 80 GB before any matrix.
      if (available_memory() <= 0.0_wp .or. available_memory() > 6.0e10_wp) return
      text = case_text('nx = 10000, ny = 10000', "&transient duration = 1e-3 / &output sensors = 'sensor' /")
      call run_case(text, case_path, result_path, lib)
      call check_refused(error, lib, 'grids of')
      call clean_up()
   end subroutine test_grids

end module test_cli_demand
