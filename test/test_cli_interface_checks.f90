!> Tests of what is doubted about a case: one key of a right case is changed, and the warning names what it probably is.
module test_cli_interface_checks
   use microslip_cli_interface_checks, only: check_interfaces
   use microslip_cli_motion_checks, only: check_loads, check_times
   use microslip_cli_scene, only: build_scene, scene_t
   use microslip_core_error, only: error_t, status_bad_input
   use microslip_core_kinds, only: wp
   use microslip_core_text, only: to_text
   use microslip_core_warning_list, only: severity_doubtful, severity_note, severity_wrong, warning_list_t
   use microslip_fe_model, only: fe_model_t, node_set_t
   use microslip_io_case, only: case_t
   use microslip_io_case_file, only: case_from_text
   use microslip_io_model_file, only: write_model_hdf5
   use support_brick, only: block_model, block_t
   use support_case_run, only: changed, write_text
   use support_checks, only: remove
   use testdrive, only: check, new_unittest, test_failed, testing_error => error_type, unittest_type
   implicit none(type, external)
   private

   public :: collect_cli_interface_checks

   character(len=*), parameter :: folder = 'build/', model_name = 'test_cli_interface_checks.h5', &
      & table_name = 'test_cli_interface_checks.txt', nl = new_line('a')
   !> Modes that are kept, Hz.
   real(wp), parameter :: modes(3) = [100.0_wp, 500.0_wp, 1000.0_wp]

contains

   subroutine collect_cli_interface_checks(testsuite)
      type(unittest_type), allocatable, intent(out) :: testsuite(:)

      testsuite = [ &
         & new_unittest('interfaces', test_interfaces), &
         & new_unittest('loads and damping', test_loads), &
         & new_unittest('times and frequencies', test_times)]
   end subroutine collect_cli_interface_checks

   !> A right case.
   function right_case() result(text)
      character(len=:), allocatable :: text

      text = "&case analyses = 'preload', 'transient' /"//nl// &
         & "&model source = 'hdf5', file = '"//model_name//"' /"//nl// &
         & "&interface name = 'joint', side_a = 'upper_pad', side_b = 'lower_pad', friction = 0.5,"//nl// &
         & "  young_modulus = 2e11, poisson_ratio = 0.3, nx = 8, ny = 6 /"//nl// &
         & "&topography source = 'hill', height = 1e-6 /"//nl// &
         & "&reduction n_modes = 12 /"//nl// &
         & "&damping modal_ratio = 0.01 /"//nl// &
         & "&load name = 'press', node_set = 'top_face', direction = 0, 0, -1, size = 1.0 /"//nl// &
         & "&load name = 'push', node_set = 'top_face', direction = 1, 0, 0, size = 1.0 /"//nl// &
         & "&preload loads = 'press', load_scale = 2000.0 /"//nl// &
         & "&transient duration = 0.05 /"//nl// &
         & "&excitation load = 'push', kind = 'half_sine', amplitude = 20.0, duration = 5e-3 /"//nl// &
         & "&output sensors = 'top_face' /"//nl
   end function right_case

   !> Two blocks held at one end, on each other: the pad is 45 mm x 40 mm.
   subroutine write_blocks()
      type(fe_model_t) :: model
      type(node_set_t) :: extra(3)
      type(error_t), allocatable :: lib
      character(len=*), parameter :: from(3) = ['upper_zmin', 'lower_zmax', 'upper_zmax']
      character(len=*), parameter :: names(3) = ['upper_pad', 'lower_pad', 'top_face ']
      integer, parameter :: cells(3) = [4, 3, 2]
      integer, allocatable :: rows(:, :)
      integer :: k

      call block_model([block_t('lower', [0.0_wp, 0.0_wp, -0.02_wp], [0.06_wp, 0.04_wp, 0.02_wp], cells, density=7800.0_wp), &
         & block_t('upper', [0.0_wp, 0.0_wp, 0.0_wp], [0.06_wp, 0.04_wp, 0.02_wp], cells, density=7800.0_wp)], &
         & ['lower_xmin', 'upper_xmin'], model)
      rows = model%rows_of_nodes()
      do k = 1, size(extra)
         associate (nodes => model%node_sets(model%find_node_set(from(k)))%nodes)
            extra(k)%name = trim(names(k))
            extra(k)%nodes = pack(nodes, rows(1, nodes) > 0)
         end associate
      end do
      model%node_sets = [model%node_sets, extra]
      call write_model_hdf5(folder//model_name, model, lib)
   end subroutine write_blocks

   !> The warnings of a case.
   subroutine find_warnings(text, warnings, lib, frequency)
      character(len=*), intent(in) :: text
      type(warning_list_t), intent(out) :: warnings
      type(error_t), allocatable, intent(out) :: lib
      !> Hz
      real(wp), intent(in), optional :: frequency(:)
      type(case_t) :: case
      type(scene_t) :: scene

      call case_from_text(text, folder//'case.nml', case, lib)
      if (.not. allocated(lib)) call build_scene(case, scene, lib)
      if (allocated(lib)) return
      call check_interfaces(case, scene, warnings)
      call check_loads(case, scene, warnings)
      if (present(frequency)) then
         call check_times(case, scene, frequency, warnings)
      else
         call check_times(case, scene, modes, warnings)
      end if
   end subroutine find_warnings

   !> One warning, of this severity and with these words, after one change of the right case. Severity 0: none.
   subroutine expect(error, old, new, severity, words, frequency)
      type(testing_error), allocatable, intent(out) :: error
      character(len=*), intent(in) :: old, new
      integer, intent(in) :: severity
      character(len=*), intent(in) :: words
      real(wp), intent(in), optional :: frequency(:)
      type(warning_list_t) :: warnings
      type(error_t), allocatable :: lib

      call find_warnings(changed(right_case(), old, new), warnings, lib, frequency)
      if (allocated(lib)) then
         call test_failed(error, new//': '//lib%message)
      else if (warnings%number() /= merge(1, 0, severity > 0)) then
         call test_failed(error, new//': '//to_text(warnings%number())//' warnings')
      else if (severity > 0) then
         call check(error, warnings%severity(1), severity, new//': '//warnings%text(1))
         if (.not. allocated(error)) call check(error, index(warnings%text(1), words) > 0, new//': '//warnings%text(1))
      end if
   end subroutine expect

   subroutine test_interfaces(error)
      type(testing_error), allocatable, intent(out) :: error

      call write_blocks()
      call expect(error, 'n_modes = 12', 'n_modes = 11', 0, '')
      if (.not. allocated(error)) call expect(error, 'friction = 0.5', 'friction = 30', severity_wrong, '30 % are 0.3')
      if (.not. allocated(error)) call expect(error, 'ratio = 0.3', 'ratio = 0.5', severity_note, 'metals have')
      if (.not. allocated(error)) call expect(error, 'nx = 8, ny = 6', 'nx = 5, ny = 25', severity_doubtful, 'exchanged?')
      if (.not. allocated(error)) call expect(error, 'nx = 8', 'axis_1 = 1, 0, 1, nx = 8', severity_doubtful, '45 degrees')
      if (.not. allocated(error)) call expect(error, 'nx = 8', 'holes = 10, 0, 8, nx = 8', severity_wrong, 'is it in mm?')
      if (.not. allocated(error)) call expect(error, 'nx = 8', 'holes = 30e-3, 20e-3, 5e-3, nx = 8', severity_wrong, &
         & 'from a corner?')
      if (.not. allocated(error)) call expect(error, 'nx = 8', 'holes = 0, 0, 0.1e-3, nx = 8', severity_wrong, 'cuts no cell')
      if (.not. allocated(error)) call expect(error, 'nx = 8', 'holes = 0, 0, 20e-3, nx = 8', severity_doubtful, &
         & 'the radius, in m?')
      if (.not. allocated(error)) call expect(error, 'nx = 8', 'extent = -30e-3, 22.5e-3, -20e-3, 20e-3, nx = 8', severity_note, &
         & 'goes beyond the nodes')
      if (.not. allocated(error)) call expect(error, 'nx = 8', 'extent = -8e-3, 8e-3, -8e-3, 8e-3, nx = 8', severity_doubtful, &
         & 'of the faces, less than 50 %')
      if (.not. allocated(error)) call expect(error, 'nx = 8', 'potential_margin = 5, nx = 8', severity_doubtful, 'um or mm?')
      if (.not. allocated(error)) call expect(error, 'nx = 8', 'potential_margin = 1e-9, nx = 8', severity_note, '1 % of the range')
      call remove(folder//model_name)
   end subroutine test_interfaces

   subroutine test_loads(error)
      type(testing_error), allocatable, intent(out) :: error
      type(warning_list_t) :: warnings
      type(error_t), allocatable :: lib

      call write_blocks()
      call expect(error, 'modal_ratio = 0.01', 'modal_ratio = 0.1', severity_doubtful, '10 % of critical damping')
      if (.not. allocated(error)) call expect(error, 'modal_ratio = 0.01', 'mass_proportional = 1e3', severity_doubtful, &
         & 'in the lowest mode (100 Hz)')
      if (.not. allocated(error)) call expect(error, 'amplitude = 20.0', 'amplitude = 0', severity_doubtful, 'it does nothing')
      if (.not. allocated(error)) call expect(error, 'load_scale = 2000.0', 'load_scale = 0', severity_doubtful, 'no part of the')
      if (.not. allocated(error)) call expect(error, "'top_face', direction = 1, 0, 0, size = 1.0", &
         & "'top_face', 'top_face', direction = 1, 0, 0, -1, 0, 0, size = 1.0, 1.0", severity_wrong, 'it has no force')
      if (.not. allocated(error)) then
         call find_warnings(changed(right_case(), 'size = 1.0', 'size = 0.0'), warnings, lib)
         call check(error, allocated(lib), 'a load of size 0 was accepted')
         if (.not. allocated(error)) call check(error, lib%status, status_bad_input)
      end if
      call remove(folder//model_name)
   end subroutine test_loads

   subroutine test_times(error)
      type(testing_error), allocatable, intent(out) :: error
      character(len=*), parameter :: pulse = "kind = 'half_sine', amplitude = 20.0, duration = 5e-3", &
         & sine = "kind = 'harmonic', amplitude = 20.0, frequency = ", &
         & table = "kind = 'file', file = '"//table_name//"', amplitude = 1.0"

      call write_blocks()
      call expect(error, 'duration = 0.05', 'duration = 500', severity_doubtful, 'more than 10000: is it in ms?')
      if (.not. allocated(error)) call expect(error, 'duration = 0.05', 'duration = 6e-3', severity_doubtful, &
         & 'less than 1: is it in s?')
      if (.not. allocated(error)) call expect(error, 'duration = 5e-3', 'duration = 5e-5', severity_doubtful, 'highest mode')
      if (.not. allocated(error)) call expect(error, 'amplitude', 'start = 0.048, amplitude', severity_doubtful, 'behind the end')
      if (.not. allocated(error)) call expect(error, pulse, sine//'150', 0, '')
      if (.not. allocated(error)) call expect(error, pulse, sine//'3000', severity_wrong, 'in rad/s (477.465 Hz)')
      if (.not. allocated(error)) call expect(error, pulse, sine//'0.05', severity_doubtful, 'is it in kHz?')
      if (.not. allocated(error)) call expect(error, pulse, sine//'628', severity_note, '99.9493 Hz is near one', &
         & [100.0_wp, 2000.0_wp])
      if (.not. allocated(error)) call expect(error, pulse, sine//'150, ramp = 0.06', severity_doubtful, 'its ramp ends')
      if (.not. allocated(error)) call expect(error, "'top_face' /", "'top_face', stride = 1000 /", severity_doubtful, 'hardly')
      if (.not. allocated(error)) call expect(error, "'top_face' /", "'top_face', stride = 40 /", severity_doubtful, '2.1 samples')
      if (.not. allocated(error)) call expect(error, 'duration = 0.05', 'duration = 0.05, time_step = 1e-6', severity_note, &
         & 'stable')
      call write_text(folder//table_name, '100 0'//nl//'150 1'//nl)
      if (.not. allocated(error)) call expect(error, pulse, table, severity_wrong, 'are its times in ms?')
      call write_text(folder//table_name, '0 0'//nl//'0.04 0'//nl)
      if (.not. allocated(error)) call expect(error, pulse, table, severity_doubtful, 'zero at all times')
      call write_text(folder//table_name, '0 0'//nl//'0.04 1'//nl//'0.06 0'//nl)
      if (.not. allocated(error)) call expect(error, pulse, table, severity_note, 'goes on to 0.06 s')
      call remove(folder//table_name)
      call remove(folder//model_name)
   end subroutine test_times

end module test_cli_interface_checks
