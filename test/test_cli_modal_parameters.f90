!> Modal parameters over amplitude from a case file to the result file: the shipped coarse S4 Beam on a coarser grid and
!> with fewer modes, by quasi-static modal analysis and from its ring-down.
module test_cli_modal_parameters
   use microslip_core_error, only: error_t, status_failed
   use microslip_core_kinds, only: wp
   use microslip_core_text, only: to_text
   use microslip_io_hdf5, only: hdf5_file_t
   use support_case_run, only: changed, file_text, run_case
   use support_checks, only: good, remove
   use testdrive, only: check, new_unittest, testing_error => error_type, unittest_type
   implicit none(type, external)
   private

   public :: collect_cli_modal_parameters

   !> Files of these tests, removed by each; the tests run in the folder of the checkout.
   character(len=*), parameter :: case_path = 'build/test_cli_modal.nml', result_path = 'build/test_cli_modal.h5', &
      & shipped = 'input/s4_modal_parameters.nml'

contains

   subroutine collect_cli_modal_parameters(testsuite)
      type(unittest_type), allocatable, intent(out) :: testsuite(:)

      testsuite = [new_unittest('S4 Beam: ring-down agrees with QSMA', test_s4), &
         & new_unittest('too few samples: status 1, the rest is kept', test_stride)]
   end subroutine collect_cli_modal_parameters

   !> Where one amplitude lies between those of a curve, linearly.
   pure real(wp) function between(x, y, at)
      real(wp), intent(in) :: x(:), y(:), at
      integer :: k

      k = max(1, min(size(x) - 1, count(x <= at)))
      between = y(k) + (y(k + 1) - y(k))*(at - x(k))/(x(k + 1) - x(k))
   end function between

   !> Symmetric beams, one mode in phase: the assumptions of QSMA hold.
   subroutine test_s4(error)
      type(testing_error), allocatable, intent(out) :: error
      type(error_t), allocatable :: lib
      type(hdf5_file_t) :: file
      real(wp), allocatable, dimension(:) :: amplitude, frequency, damping, loops, masing, decay, at, peaks, ratio
      character(len=*), parameter :: promised(*) = [character(len=40) :: '/qsma/viscous_damping_ratio', &
         & '/qsma/dissipated_energy', '/qsma/positive/load', '/qsma/negative/modal_displacement', '/qsma/positive/sensor', &
         & '/qsma/positive/work', '/qsma/positive/stored_energy', '/qsma/positive/friction_loss', &
         & '/qsma/positive/balance_error', '/qsma/negative/residual', '/qsma/positive/contact/slip', '/qsma/cycle/closure', &
         & '/qsma/iterations', '/ringdown/time', '/ringdown/signal_amplitude', '/ringdown/peaks/frequency', '/ringdown/window']
      !> The leapfrog with 12 modes raises the frequency by 3.4e-4; the curves are not straight between the levels.
      real(wp), parameter :: same_frequency = 8.0e-4_wp, same_damping = 5.0e-2_wp, same_ways = 2.0e-2_wp
      real(wp) :: difference(3)
      integer :: k

      call run_case(changed(file_text(shipped), &
         & [character(len=32) :: "file = 's4_coarse", 'nx = 42, ny = 26', 'n_modes = 30', 'duration = 0.4', &
         & 'cycle = .true.'], [character(len=32) :: "file = '../input/s4_coarse", 'nx = 22, ny = 14', 'n_modes = 12', &
         & 'duration = 0.15', 'cycle = .TRUE.']), case_path, result_path, lib)
      if (.not. allocated(lib)) call file%open(result_path, lib)
      call good(error, lib)
      if (allocated(error)) return
      do k = 1, size(promised)
         if (.not. allocated(error)) call check(error, file%has(trim(promised(k))), 'missing: '//promised(k))
      end do
      call file%read('/qsma/amplitude', amplitude, lib)
      if (.not. allocated(lib)) call file%read('/qsma/frequency', frequency, lib)
      if (.not. allocated(lib)) call file%read('/qsma/damping_ratio', damping, lib)
      if (.not. allocated(lib)) call file%read('/qsma/friction_damping_ratio', masing, lib)
      if (.not. allocated(lib)) call file%read('/qsma/cycle/friction_damping_ratio', loops, lib)
      if (.not. allocated(lib)) call file%read('/ringdown/amplitude', at, lib)
      if (.not. allocated(lib)) call file%read('/ringdown/frequency', decay, lib)
      if (.not. allocated(lib)) call file%read('/ringdown/damping_ratio', ratio, lib)
      if (.not. allocated(lib)) call file%read('/ringdown/peaks/damping_ratio', peaks, lib)
      if (.not. allocated(error)) call good(error, lib)
      call file%close(lib)
      call remove(case_path)
      call remove(result_path)
      if (allocated(error)) return
      call check(error, size(amplitude) == 20 .and. abs(amplitude(20)/1.5e-4_wp - 1.0_wp) < 1.0e-2_wp .and. &
         & frequency(20) < frequency(1), 'levels: '//to_text(amplitude(20))//' '//to_text(frequency(1)))
      if (allocated(error)) return
      difference = 0.0_wp
      do k = 1, size(at)
         difference(1) = max(difference(1), abs(decay(k)/between(amplitude, frequency, at(k)) - 1.0_wp))
         difference(2) = max(difference(2), abs(ratio(k)/between(amplitude, damping, at(k)) - 1.0_wp))
         difference(3) = max(difference(3), abs(ratio(k)/peaks(k) - 1.0_wp))
      end do
      call check(error, size(at) > 10 .and. all(difference < [same_frequency, same_damping, same_ways]), &
         & to_text(difference(1))//' '//to_text(difference(2))//' '//to_text(difference(3)))
      if (allocated(error)) return
      call check(error, all(abs(loops - masing) <= same_ways*abs(masing)), 'Masing: '//to_text(maxval(abs(loops - masing))))
   end subroutine test_s4

   !> Every 60th of the steps of about 23 us leaves 3.5 samples of a period.
   subroutine test_stride(error)
      type(testing_error), allocatable, intent(out) :: error
      type(error_t), allocatable :: lib
      type(hdf5_file_t) :: file
      logical :: kept

      call run_case(changed(file_text(shipped), &
         & [character(len=32) :: "file = 's4_coarse", 'nx = 42, ny = 26', 'n_modes = 30', 'duration = 0.4', &
         & 'cycle = .true.', "  sensors"], [character(len=32) :: "file = '../input/s4_coarse", 'nx = 10, ny = 6', &
         & 'n_modes = 12', 'duration = 0.1', 'levels = 2', ' stride = 60, sensors']), case_path, result_path, lib)
      call check(error, allocated(lib))
      if (.not. allocated(error)) call check(error, lib%status == status_failed .and. &
         & index(lib%message, 'samples of a period') > 0, lib%message)
      call file%open(result_path, lib)
      kept = file%has('/qsma/frequency') .and. file%has('/transient/steps') .and. .not. file%has('/ringdown/time')
      call file%close(lib)
      call remove(case_path)
      call remove(result_path)
      if (.not. allocated(error)) call check(error, kept, 'results')
   end subroutine test_stride

end module test_cli_modal_parameters
