!> Excitations and settling from a case file to the result file: the shipped coarse S4 Beam on a coarser grid and with
!> fewer modes.
module test_cli_excitations
   use microslip_core_error, only: error_t, status_bad_input
   use microslip_core_kinds, only: wp
   use microslip_core_text, only: to_text
   use microslip_io_hdf5, only: hdf5_file_t
   use support_case_run, only: changed, file_text, run_case
   use support_checks, only: good, remove
   use testdrive, only: check, new_unittest, testing_error => error_type, unittest_type
   implicit none(type, external)
   private

   public :: collect_cli_excitations

   !> Files of these tests, removed by each; the tests run in the folder of the checkout.
   character(len=*), parameter :: case_path = 'build/test_cli_excitations.nml', result_path = 'build/test_cli_excitations.h5', &
      & shipped = 'input/s4_ringdown.nml', table_path = 'build/test_cli_blow.txt'
   !> Begin of the part of the shipped case that is replaced.
   character(len=*), parameter :: cut = '&transient'
   !> Changes for all tests
   character(len=*), parameter :: old(4) = [character(len=20) :: "file = 's4_coarse", 'nx = 42, ny = 26', 'n_modes = 30', &
      & 'ratio = 0.001'], new(4) = [character(len=27) :: "file = '../input/s4_coarse", 'nx = 10, ny = 6', 'n_modes = 8', &
      & 'ratio = 0.05']

contains

   subroutine collect_cli_excitations(testsuite)
      type(unittest_type), allocatable, intent(out) :: testsuite(:)

      testsuite = [new_unittest('S4 Beam: settling, then a stepped sine from the settled state', test_settling_stepped), &
         & new_unittest('a half-sine and the same from a file', test_file), &
         & new_unittest('a file that is wrong: status 2', test_wrong_file)]
   end subroutine collect_cli_excitations

   !> Run the shipped case with other analyses and with `tail` in place of its last groups.
   subroutine run_with(analyses, tail, lib)
      character(len=*), intent(in) :: analyses, tail
      type(error_t), allocatable, intent(out) :: lib
      character(len=:), allocatable :: text

      text = file_text(shipped)
      text = changed(text(:index(text, cut) - 1), old, new)//tail
      call run_case(changed(text, "'preload', 'linear_modes', 'transient'", analyses), case_path, result_path, lib)
   end subroutine run_with

   subroutine test_settling_stepped(error)
      type(testing_error), allocatable, intent(out) :: error
      type(error_t), allocatable :: lib
      type(hdf5_file_t) :: file
      real(wp), allocatable :: position(:, :), ratio(:, :, :), amplitude(:, :, :), frequency(:), at(:), rest(:, :), stepped(:, :)
      integer :: k
      character(len=*), parameter :: promised(*) = [character(len=40) :: '/settling/time', '/settling/sensor', &
         & '/settling/energy/friction_loss', '/settling/interface_2/slip_1', '/settling/interface_1/largest_slip', &
         & '/settling/interface_1/largest_slip_ratio', '/settling/rest/interface_2/pressure', '/settling/rest/residual', &
         & '/settling/ringdown_2/damping_ratio', '/transient/harmonics/time', '/transient/harmonics/phase', &
         & '/transient/harmonics/change', '/transient/harmonics/step']

      call run_with("'preload', 'linear_modes', 'settling', 'transient'", &
         & "&settling load = 'impact', amplitude = 2000.0, impacts = 2, duration = 0.5e-3, interval = 0.3, ringdown = .true. /"// &
         & "&transient /"//new_line('a')// &
         & "&excitation load = 'impact', kind = 'stepped_sine', amplitude = 2.0, frequencies = 190.0, 200.0, ramp = 0.01, "// &
         & "settle_periods = 5, measure_periods = 4, harmonics = 2 /"//new_line('a')//"&output sensors = 'sensor', "// &
         & "stride = 4 /", lib)
      if (.not. allocated(lib)) call file%open(result_path, lib)
      call good(error, lib)
      if (allocated(error)) return
      do k = 1, size(promised)
         if (.not. allocated(error)) call check(error, file%has(trim(promised(k))), 'missing: '//promised(k))
      end do
      call file%read('/settling/static_position', position, lib)
      if (.not. allocated(lib)) call file%read('/settling/interface_1/slip_ratio', ratio, lib)
      if (.not. allocated(lib)) call file%read('/transient/harmonics/amplitude', amplitude, lib)
      if (.not. allocated(lib)) call file%read('/transient/harmonics/frequency', frequency, lib)
      if (.not. allocated(lib)) call file%read('/transient/time', at, lib)
      if (.not. allocated(lib)) call file%read('/settling/sensor', rest, lib)
      if (.not. allocated(lib)) call file%read('/transient/sensor', stepped, lib)
      if (.not. allocated(error)) call good(error, lib)
      call file%close(lib)
      call remove(case_path)
      call remove(result_path)
      if (allocated(error)) return
      call check(error, all(shape(position) == [1, 3]) .and. all(shape(ratio) == [10, 6, 3]) .and. &
         & all(shape(amplitude) == [1, 3, 2]) .and. all(abs(frequency - [190.0_wp, 200.0_wp]) < 1.0e-9_wp), 'shapes')
      if (allocated(error)) return
      call check(error, abs(at(size(at)) - 9.0_wp*(1.0_wp/190.0_wp + 1.0_wp/200.0_wp)) < 1.0e-3_wp, 'the sine sets the end')
      if (allocated(error)) return
      ! Closer to the resonance it moves more; the motion begins where the settling ended.
      call check(error, amplitude(1, 2, 2) > amplitude(1, 2, 1) .and. amplitude(1, 2, 1) > 0.0_wp, 'amplitudes')
      if (allocated(error)) return
      call check(error, abs(stepped(1, 1) - position(1, 3)) < 0.05_wp*abs(position(1, 3) - position(1, 1)), &
         & 'rest: '//to_text(stepped(1, 1), 9)//' '//to_text(position(1, 3), 9)//' '//to_text(position(1, 1), 9))
   end subroutine test_settling_stepped

   !> Last modal displacements of a run of 5 ms with an excitation.
   subroutine run_pulse(keys, modal, lib)
      character(len=*), intent(in) :: keys
      real(wp), allocatable, intent(out) :: modal(:, :)
      type(error_t), allocatable, intent(out) :: lib
      type(hdf5_file_t) :: file
      type(error_t), allocatable :: ignored

      call run_with("'preload', 'linear_modes', 'transient'", "&transient duration = 5e-3 /"//new_line('a')// &
         & "&excitation load = 'impact', "//keys//" /"//new_line('a')//"&output sensors = 'sensor' /", lib)
      if (.not. allocated(lib)) call file%open(result_path, lib)
      if (.not. allocated(lib)) call file%read('/transient/modal_displacement', modal, lib)
      call file%close(ignored)
   end subroutine run_pulse

   subroutine test_file(error)
      type(testing_error), allocatable, intent(out) :: error
      type(error_t), allocatable :: lib
      real(wp), allocatable :: one(:, :), other(:, :)
      integer :: unit, k
      real(wp), parameter :: pi = acos(-1.0_wp)
      integer, parameter :: points = 100
      !> Straight lines miss a half-sine by (pi h/T)^2/8 at most.
      real(wp), parameter :: interpolation = (pi/points)**2/8.0_wp

      open (newunit=unit, file=table_path, status='replace')
      write (unit, '(a)') '# s, force'
      write (unit, '(es23.16,a,es23.16)') (0.5e-3_wp*k/points, ', ', sin(pi*k/points), k=0, points)
      close (unit)
      call run_pulse("kind = 'half_sine', amplitude = 510.0, duration = 0.5e-3", one, lib)
      if (.not. allocated(lib)) call run_pulse("kind = 'file', file = 'test_cli_blow.txt', amplitude = 510.0", other, lib)
      call remove(table_path)
      call remove(case_path)
      call remove(result_path)
      call good(error, lib)
      if (allocated(error)) return
      call check(error, maxval(abs(one - other)) < 2.0_wp*interpolation*maxval(abs(one - spread(one(:, 1), 2, size(one, 2)))), &
         & to_text(maxval(abs(one - other))))
   end subroutine test_file

   subroutine test_wrong_file(error)
      type(testing_error), allocatable, intent(out) :: error
      type(error_t), allocatable :: lib
      real(wp), allocatable :: modal(:, :)

      call run_pulse("kind = 'file', file = 'test_cli_blow.txt'", modal, lib)
      call remove(case_path)
      call remove(result_path)
      call check(error, allocated(lib))
      if (.not. allocated(error)) call check(error, lib%status == status_bad_input .and. &
         & index(lib%message, 'no such file') > 0, lib%message)
   end subroutine test_wrong_file

end module test_cli_excitations
