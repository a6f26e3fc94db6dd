!> Keys of contact at the FE nodes, of initial pressures and of imposed motions, and the faults in them.
module test_io_case_node_contact
   use microslip_core_error, only: error_t, status_bad_input
   use microslip_core_kinds, only: wp
   use microslip_io_case, only: case_t
   use microslip_io_case_file, only: case_from_text, resolved_text
   use support_case_run, only: changed
   use testdrive, only: check, new_unittest, test_failed, testing_error => error_type, unittest_type
   implicit none(type, external)
   private

   public :: collect_io_case_node_contact

   character(len=*), parameter :: nl = new_line('a')
   !> A valid case: one interface at nodes, one on a grid under an initial pressure, a table that moves and turns.
   character(len=*), parameter :: valid = &
      "&case analyses = 'preload', 'linear_modes', 'transient' /"//nl// &
      "&model source = 'hdf5', file = 'beam.h5' /"//nl// &
      "&interface name = 'table', side_a = 'la', side_b = 'Ground', grid = 'fe_nodes', friction = 0.6 /"//nl// &
      "&interface name = 'joint', side_a = 'ra', side_b = 'rb', friction = 0.5, initial_pressure = 1e6,"//nl// &
      "   young_modulus = 194e9, poisson_ratio = 0.2854, nx = 80, ny = 50 /"//nl// &
      "&topography name = 'hill', source = 'hill', height = 12.14e-6 /"//nl// &
      "&reduction n_modes = 30 /"//nl// &
      "&load name = 'press', kind = 'motion', interface = 'table', direction = 1, 0, 0 /"//nl// &
      "&load name = 'twist', kind = 'motion', interface = 'Table', motion = 'rotation', direction = 1, 0, 0,"//nl// &
      "   center = 0.01, 0.02 /"//nl// &
      "&preload loads = 'press', load_scale = 1e-6 /"//nl// &
      "&transient duration = 0.1 /"//nl// &
      "&excitation load = 'twist', kind = 'harmonic', amplitude = 1e-3, frequency = 50.0 /"//nl

contains

   subroutine collect_io_case_node_contact(testsuite)
      type(unittest_type), allocatable, intent(out) :: testsuite(:)
      testsuite = [new_unittest('what is read, and read again', test_read), &
         & new_unittest('no preload where all is pressed together', test_without_preload), &
         & new_unittest('faults of the interface', test_interface_faults), &
         & new_unittest('faults of motions', test_motion_faults)]
   end subroutine collect_io_case_node_contact

   subroutine test_read(error)
      type(testing_error), allocatable, intent(out) :: error
      type(case_t) :: input, again
      type(error_t), allocatable :: lib

      call case_from_text(valid, 'beam.nml', input, lib)
      if (.not. allocated(lib)) call case_from_text(resolved_text(input), 'again.nml', again, lib)
      if (allocated(lib)) then
         call test_failed(error, lib%message)
         return
      end if
      call check(error, resolved_text(input) == resolved_text(again), 'the resolved input is read differently')
      if (allocated(error)) return
      associate (table => again%interfaces(1), joint => again%interfaces(2), twist => again%loads(2))
         call check(error, table%grid == 'fe_nodes' .and. table%side_b == 'ground' .and. table%topography == 'hill' &
            & .and. .not. allocated(table%young_modulus), 'table')
         if (allocated(error)) return
         call check(error, joint%grid == 'half_space' .and. joint%topography == '' .and. joint%initial_pressure == 1.0e6_wp, &
            & 'joint')
         if (allocated(error)) return
         call check(error, again%find_interface(twist%interface) == 1 .and. twist%motion == 'rotation' &
            & .and. all(twist%center == [0.01_wp, 0.02_wp]) .and. all(twist%direction(:, 1) == [1.0_wp, 0.0_wp, 0.0_wp]), 'twist')
      end associate
   end subroutine test_read

   !> Under an initial pressure on all interfaces the analyses start from the undeformed state; loads are still watched.
   subroutine test_without_preload(error)
      type(testing_error), allocatable, intent(out) :: error
      character(len=:), allocatable :: text

      text = changed(changed(valid, "'preload', 'linear", "'linear"), "&preload loads = 'press', load_scale = 1e-6 /", '')
      call has_fault(error, text, "'preload' first, the other analyses start from its result (none needed", 2)
      text = changed(changed(text, "friction = 0.6", "friction = 0.6, initial_pressure = 2e6"), &
         & "&topography name = 'hill', source = 'hill', height = 12.14e-6 /", '')
      call has_fault(error, text, "&load 1 'press': allowed: a &load that", 1)
      text = changed(text, "&load name = 'press', kind = 'motion', interface = 'table', direction = 1, 0, 0 /", '')
      if (.not. allocated(error)) call check(error, faults_of(text) == '', faults_of(text))
   end subroutine test_without_preload

   subroutine test_interface_faults(error)
      type(testing_error), allocatable, intent(out) :: error
      character(len=*), parameter :: node = "grid = 'fe_nodes'", only_grid = ": allowed: only with grid = 'half_space'"
      character(len=*), parameter :: ignored(6) = [character(len=21) :: 'young_modulus = 2e11', 'poisson_ratio = 0.3', 'nx = 4', &
         & 'ny = 4', 'extent = 0, 1, 0, 1', 'holes = 0, 0, 1']
      integer :: k

      do k = 1, size(ignored)
         call one_fault(error, node, node//', '//trim(ignored(k)), trim(ignored(k))//only_grid)
      end do
      call one_fault(error, node, "grid = 'nodes'", "grid = 'nodes': allowed: 'half_space', 'fe_nodes'")
      call one_fault(error, 'initial_pressure = 1e6', 'initial_pressure = 0', 'initial_pressure = 0: allowed: a finite number > 0')
      call one_fault(error, 'initial_pressure = 1e6', "initial_pressure = 1e6, topography = 'hill'", &
         & "topography = 'hill': allowed: only without initial_pressure")
      call one_fault(error, 'friction = 0.6', 'friction = 0.6, initial_pressure = 1e6', &
         & "&topography 1 'hill': allowed: a &topography that an &interface uses")
      call one_fault(error, '&reduction', "&contact compliance = 'fft' /"//nl//'&reduction', &
         & "compliance = 'fft': allowed: 'auto' or 'dense'")
      call one_fault(error, "loads = 'press', load_scale = 1e-6", "loads = 'press', 'twist', interface_force = 2*100.0", &
         & "interface_force = 100.0, 100.0: allowed: load_scale in its place: interface 'joint' has an initial_pressure")
   end subroutine test_interface_faults

   subroutine test_motion_faults(error)
      type(testing_error), allocatable, intent(out) :: error
      character(len=*), parameter :: press = "kind = 'motion', interface = 'table', direction = 1, 0, 0"

      call one_fault(error, press, "kind = 'motion', interface = 'tabel', direction = 1, 0, 0", &
         & "interface = 'tabel': allowed: the name of a &interface, did you mean 'table'?")
      call one_fault(error, press, "kind = 'motion', direction = 1, 0, 0", 'interface: missing')
      call one_fault(error, press, "kind = 'motion', interface = 'table'", 'direction: missing')
      call one_fault(error, press, "kind = 'motion', interface = 'table', direction = 3*0", &
         & 'direction = 0, 0, 0: allowed: three numbers per direction that are not all 0')
      call one_fault(error, press, press//', center = 0, 0', "center = 0, 0: allowed: only with motion = 'rotation'")
      call one_fault(error, press, press//", motion = 'turn'", "motion = 'turn': allowed: 'translation', 'rotation'")
      call one_fault(error, press, press//", node_set = 'up'", "node_set = 'up': allowed: only with kind = 'nodes'")
      call one_fault(error, press, press//', mode = 1', "mode = 1: allowed: only with kind = 'modal'")
      call one_fault(error, press, "kind = 'base', interface = 'table', direction = 1, 0, 0", &
         & "interface = 'table': allowed: only with kind = 'motion'")
      call one_fault(error, "'transient' /", "'transient', 'harmonic_balance' /"//nl//"&output sensors = 'a' /"//nl// &
         & "&harmonic_balance load = 'twist', levels = 1.0, frequency_range = 190, 210 /", &
         & "load = 'twist': allowed: a load of another kind than 'motion'")
   end subroutine test_motion_faults

   !> Change the valid case in one place: some lines of faults (default: one), with this text in one of them.
   subroutine one_fault(error, old, new, expected, lines)
      type(testing_error), allocatable, intent(inout) :: error
      character(len=*), intent(in) :: old, new, expected
      integer, intent(in), optional :: lines
      integer :: wanted

      wanted = 1
      if (present(lines)) wanted = lines
      call has_fault(error, changed(valid, old, new), expected, wanted)
   end subroutine one_fault

   !> A case has so many faults, and this text in one of them.
   subroutine has_fault(error, text, expected, lines)
      type(testing_error), allocatable, intent(inout) :: error
      character(len=*), intent(in) :: text, expected
      integer, intent(in) :: lines
      character(len=:), allocatable :: faults
      integer :: k

      if (allocated(error)) return
      faults = faults_of(text)
      if (count([(faults(k:k) == nl, k=1, len(faults))]) + 1 /= lines .or. index(faults, expected) == 0) &
         & call test_failed(error, nl//'expected: '//expected//nl//'got:      '//faults)
   end subroutine has_fault

   !> The message for a case text, '' if it is valid.
   function faults_of(text) result(faults)
      character(len=*), intent(in) :: text
      character(len=:), allocatable :: faults
      type(case_t) :: input
      type(error_t), allocatable :: lib

      faults = ''
      call case_from_text(text, 'beam.nml', input, lib)
      if (.not. allocated(lib)) return
      if (lib%status == status_bad_input) faults = lib%message
   end function faults_of

end module test_io_case_node_contact
