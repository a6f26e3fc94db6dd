!> Frequency response and nonlinear mode from a case file to the result file: the shipped coarse S4 Beam on a coarser grid
!> and with fewer modes.
module test_cli_periodic_motions
   use microslip_core_error, only: error_t, status_failed
   use microslip_core_kinds, only: wp
   use microslip_core_text, only: to_text
   use microslip_io_hdf5, only: hdf5_file_t
   use support_case_run, only: changed, file_text, run_case
   use support_checks, only: good, remove
   use testdrive, only: check, new_unittest, testing_error => error_type, unittest_type
   implicit none(type, external)
   private

   public :: collect_cli_periodic_motions

   !> Files of these tests, removed by each; the tests run in the folder of the checkout.
   character(len=*), parameter :: case_path = 'build/test_cli_periodic.nml', result_path = 'build/test_cli_periodic.h5', &
      & shipped = 'input/s4_frf.nml'
   !> Changes for all tests; cells larger than elements have no part in a coupling split by scale
   character(len=*), parameter :: old(6) = [character(len=32) :: "file = 's4_coarse", 'nx = 42, ny = 26', 'n_modes = 30', &
      & 'levels = 0.2, 1.0', 'frequency_range = 195.0, 215.0', 'amplitude_range = 1e-7, 1.5e-4']
   character(len=*), parameter :: new(6) = [character(len=48) :: "file = '../input/s4_coarse", &
      & "nx = 10, ny = 6, coupling = 'series'", 'n_modes = 6', 'levels = 1.5', &
      & 'frequency_range = 205.0, 210.0', 'amplitude_range = 1.55e-4, 1.9e-4, points = 6']

contains

   subroutine collect_cli_periodic_motions(testsuite)
      type(unittest_type), allocatable, intent(out) :: testsuite(:)

      testsuite = [new_unittest('S4 Beam: the peak of the response lies on the nonlinear mode', test_peak), &
         & new_unittest('a curve given up: status 1, its points are kept', test_given_up)]
   end subroutine collect_cli_periodic_motions

   !> The largest response is one of the nonlinear mode, at its frequency, and its damping carries the load:
   !> amplitude times damping does not depend on how the mode is scaled.
   subroutine test_peak(error)
      type(testing_error), allocatable, intent(out) :: error
      type(error_t), allocatable :: lib
      type(hdf5_file_t) :: file
      real(wp), allocatable, dimension(:) :: frequency, amplitude, mode_frequency, mode_amplitude, damping, residual
      integer, allocatable :: complete(:)
      character(len=*), parameter :: promised(*) = [character(len=40) :: 'phase', 'peak', &
         & 'neglected_velocity', 'curve/truncation_error', &
         & 'curve/samples_error', 'curve/frequency_error', 'curve/error_at', 'level', 'harmonics', 'sensor_harmonics', &
         & 'sensor_name', 'friction_loss', 'contact/open', 'contact/stick', 'contact/slip', 'iterations', 'evaluations', &
         & 'periods', 'repeat_error', 'curve/points', 'curve/failed_steps', 'curve/evaluations', 'curve/jacobians']
      !> Between two points of the curves
      real(wp), parameter :: close_by = 5.0e-4_wp
      integer :: k, peak

      call run_case(changed(file_text(shipped), old, new), case_path, result_path, lib)
      if (.not. allocated(lib)) call file%open(result_path, lib)
      call good(error, lib)
      if (allocated(error)) return
      do k = 1, size(promised)
         if (.not. allocated(error)) call check(error, file%has('/harmonic_balance/'//trim(promised(k))), 'missing: '//promised(k))
      end do
      if (.not. allocated(error)) call check(error, file%has('/epmc/modal_amplitude') .and. file%has('/epmc/harmonics') &
         & .and. .not. file%has('/epmc/phase'), 'epmc')
      call file%read('/harmonic_balance/frequency', frequency, lib)
      if (.not. allocated(lib)) call file%read('/harmonic_balance/amplitude', amplitude, lib)
      if (.not. allocated(lib)) call file%read('/harmonic_balance/residual', residual, lib)
      if (.not. allocated(lib)) call file%read('/harmonic_balance/curve/complete', complete, lib)
      if (.not. allocated(lib)) call file%read('/epmc/frequency', mode_frequency, lib)
      if (.not. allocated(lib)) call file%read('/epmc/amplitude', mode_amplitude, lib)
      if (.not. allocated(lib)) call file%read('/epmc/damping_ratio', damping, lib)
      if (.not. allocated(error)) call good(error, lib)
      call file%close(lib)
      call remove(case_path)
      call remove(result_path)
      if (allocated(error)) return
      call check(error, all(complete == 1) .and. all(residual <= 1.0e-6_wp) .and. size(frequency) > 10 .and. &
         & size(mode_frequency) == 6, 'points: '//to_text(size(frequency))//' '//to_text(size(mode_frequency)))
      if (allocated(error)) return
      peak = maxloc(amplitude, dim=1)
      k = max(1, min(size(mode_amplitude) - 1, count(mode_amplitude <= amplitude(peak))))
      associate (a => mode_amplitude, share => (amplitude(peak) - mode_amplitude(k))/(mode_amplitude(k + 1) - mode_amplitude(k)))
         call check(error, a(1) < amplitude(peak) .and. amplitude(peak) < a(size(a)), 'peak: '//to_text(amplitude(peak)))
         if (allocated(error)) return
         call check(error, abs(frequency(peak)/(mode_frequency(k) + share*(mode_frequency(k + 1) - mode_frequency(k))) - 1.0_wp) &
            & < close_by .and. damping(size(damping)) > damping(1), 'frequency of the peak: '//to_text(frequency(peak)))
      end associate
   end subroutine test_peak

   subroutine test_given_up(error)
      type(testing_error), allocatable, intent(out) :: error
      type(error_t), allocatable :: lib
      type(hdf5_file_t) :: file
      real(wp), allocatable :: frequency(:)
      integer, allocatable :: complete(:)

      call run_case(changed(file_text(shipped), &
         & [character(len=48) :: old, 'frequency_range = 205.0, 210.0'], &
         & [character(len=64) :: new, 'frequency_range = 205, 210, max_points = 3']), case_path, result_path, lib)
      call check(error, allocated(lib))
      if (.not. allocated(error)) call check(error, lib%status == status_failed .and. &
         & index(lib%message, 'more points than allowed') > 0, lib%message)
      call file%open(result_path, lib)
      if (.not. allocated(lib)) call file%read('/harmonic_balance/frequency', frequency, lib)
      if (.not. allocated(lib)) call file%read('/harmonic_balance/curve/complete', complete, lib)
      if (.not. allocated(error)) call good(error, lib)
      call file%close(lib)
      call remove(case_path)
      call remove(result_path)
      if (.not. allocated(error)) call check(error, size(frequency) == 3 .and. all(complete == 0), 'points')
   end subroutine test_given_up

end module test_cli_periodic_motions
