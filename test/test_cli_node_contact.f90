!> The shipped cases with contact at the FE nodes, from the case file to the result file, with fewer modes.
module test_cli_node_contact
   use microslip_core_error, only: error_t
   use microslip_core_kinds, only: wp
   use microslip_core_text, only: to_text
   use microslip_io_hdf5, only: hdf5_file_t
   use support_case_run, only: changed, file_text, run_case
   use support_checks, only: good, remove
   use testdrive, only: check, new_unittest, testing_error => error_type, unittest_type
   implicit none(type, external)
   private

   public :: collect_cli_node_contact

   !> Files of these tests, removed by each; the tests run in the folder of the checkout.
   character(len=*), parameter :: case_path = 'build/test_cli_node_contact.nml', result_path = 'build/test_cli_node_contact.h5', &
      & table_path = 'build/test_cli_turn.txt', nl = new_line('a')

contains

   subroutine collect_cli_node_contact(testsuite)
      type(unittest_type), allocatable, intent(out) :: testsuite(:)

      testsuite = [new_unittest('S4 Beam: preload, linear modes, qsma, settling, transient', test_joint), &
         & new_unittest('S4 Beam on a table that turns: torque of friction, energy balance', test_table)]
   end subroutine collect_cli_node_contact

   !> Run a shipped case with other analyses and with `tail` in place of all from `cut` on.
   subroutine run_with(shipped, analyses, cut, tail, lib)
      character(len=*), intent(in) :: shipped, analyses, cut, tail
      type(error_t), allocatable, intent(out) :: lib
      character(len=:), allocatable :: text
      integer :: at

      text = file_text(shipped)
      text = text(:index(text, cut) - 1)//tail
      text = changed(text, "file = 's4_coarse", "file = '../input/s4_coarse")
      text = changed(text, 'n_modes = 30', 'n_modes = 8')
      at = index(text, 'analyses = ') + len('analyses = ')
      text = text(:at - 1)//analyses//text(at + index(text(at:), nl) - 1:)
      call run_case(text, case_path, result_path, lib)
   end subroutine run_with

   !> All analyses run; fields are lists over the points, whose pressures and areas make the interface force.
   subroutine test_joint(error)
      type(testing_error), allocatable, intent(out) :: error
      real(wp), parameter :: wanted = 2210.0_wp, rounding = 1.0e-9_wp
      type(error_t), allocatable :: lib, ignored
      type(hdf5_file_t) :: file
      real(wp), allocatable :: x(:), y(:), area(:), pressure(:), snapshot(:, :), slip(:, :), frequency(:), tied(:), height(:)
      real(wp) :: balance
      integer, allocatable :: potential(:)

      call run_with('input/s4_fe_nodes.nml', "'preload', 'linear_modes', 'qsma', 'settling', 'transient'", '&qsma', &
         & "&qsma largest_amplitude = 1e-4, levels = 3 /"//nl// &
         & "&settling load = 'impact', amplitude = 500.0, duration = 0.5e-3, interval = 0.06 /"//nl// &
         & "&transient duration = 2e-3 /"//nl// &
         & "&excitation load = 'impact', kind = 'half_sine', amplitude = 510.0, duration = 0.5e-3 /"//nl// &
         & "&output sensors = 'sensor', snapshots = 1e-3, 2e-3 /", lib)
      if (.not. allocated(lib)) call file%open(result_path, lib)
      if (.not. allocated(lib)) call file%read('/interface_1/x', x, lib)
      if (.not. allocated(lib)) call file%read('/interface_1/y', y, lib)
      if (.not. allocated(lib)) call file%read('/interface_1/area', area, lib)
      if (.not. allocated(lib)) call file%read('/interface_1/height', height, lib)
      if (.not. allocated(lib)) call file%read('/interface_1/potential', potential, lib)
      if (.not. allocated(lib)) call file%read('/preload/interface_1/pressure', pressure, lib)
      if (.not. allocated(lib)) call file%read('/transient/snapshot/interface_1/pressure', snapshot, lib)
      if (.not. allocated(lib)) call file%read('/settling/interface_1/slip_1', slip, lib)
      if (.not. allocated(lib)) call file%read('/linear_modes/frequency', frequency, lib)
      if (.not. allocated(lib)) call file%read('/model/tied_frequency', tied, lib)
      if (.not. allocated(lib)) call file%read('/transient/largest_balance_error', balance, lib)
      call file%close(ignored)
      call remove(case_path)
      call remove(result_path)
      call good(error, lib)
      if (allocated(error)) return
      associate (n => size(x))
         call check(error, all([size(y), size(area), size(height), size(potential), size(pressure)] == n) .and. &
            & all(shape(snapshot) == [n, 2]) .and. all(shape(slip) == [n, 2]), 'shapes')
      end associate
      if (allocated(error)) return
      call check(error, sum(pressure*area), wanted, rel=.true., thr=rounding)
      if (allocated(error)) return
      call check(error, sum(snapshot(:, 1)*area) > 0.9_wp*wanted .and. all(potential*(1 - potential) == 0), 'snapshot')
      if (allocated(error)) return
      ! Points that are open leave the structure softer than the tied one.
      call check(error, frequency(1) < tied(1) .and. frequency(1) > 0.8_wp*tied(1), to_text(frequency(1), 6))
      if (allocated(error)) return
      call check(error, balance < 1.0e-2_wp, to_text(balance))
   end subroutine test_joint

   !> A table that turns fast about the pad's middle: everything slides, the friction on the beam is along the motion of the
   !> table (but for the velocity of the beam, some 1 % of it), and its torque mu N r summed. Friction is booked with the
   !> force at the end of a step, the work with the mean: in the step that begins to slide the books differ by half its work.
   subroutine test_table(error)
      type(testing_error), allocatable, intent(out) :: error
      real(wp), parameter :: beam_velocity = 0.05_wp, friction = 0.3_wp, rate = 300.0_wp, duration = 1.0e-3_wp
      type(error_t), allocatable :: lib, ignored
      type(hdf5_file_t) :: file
      real(wp), allocatable :: x(:), y(:), area(:), p(:, :), t1(:, :), t2(:, :), work(:), loss(:), miss(:)
      real(wp) :: torque, expected
      integer :: unit

      open (newunit=unit, file=table_path, status='replace')
      write (unit, '(2es24.16)') 0.0_wp, 0.0_wp, duration, duration*rate
      close (unit)
      call run_with('input/s4_moving_table.nml', "'linear_modes', 'transient'", '&load', &
         & "&load name = 'turn', kind = 'motion', interface = 'table', motion = 'rotation', direction = 2, 0, 0 /"//nl// &
         & "&transient duration = 1e-3, time_step = 1e-5 /"//nl// &
         & "&excitation load = 'turn', kind = 'file', file = 'test_cli_turn.txt' /"//nl// &
         & "&output sensors = 'sensor', snapshots = 0.5e-3 /", lib)
      if (.not. allocated(lib)) call file%open(result_path, lib)
      if (.not. allocated(lib)) call file%read('/interface_1/x', x, lib)
      if (.not. allocated(lib)) call file%read('/interface_1/y', y, lib)
      if (.not. allocated(lib)) call file%read('/interface_1/area', area, lib)
      if (.not. allocated(lib)) call file%read('/transient/snapshot/interface_1/pressure', p, lib)
      if (.not. allocated(lib)) call file%read('/transient/snapshot/interface_1/traction_1', t1, lib)
      if (.not. allocated(lib)) call file%read('/transient/snapshot/interface_1/traction_2', t2, lib)
      if (.not. allocated(lib)) call file%read('/transient/energy/external_work', work, lib)
      if (.not. allocated(lib)) call file%read('/transient/energy/friction_loss', loss, lib)
      if (.not. allocated(lib)) call file%read('/transient/energy/balance_error', miss, lib)
      call file%close(ignored)
      call remove(table_path)
      call remove(case_path)
      call remove(result_path)
      call good(error, lib)
      if (allocated(error)) return
      ! n x r = (-y, x) in the plane
      torque = sum(area*(x*t2(:, 1) - y*t1(:, 1)))
      expected = friction*sum(area*p(:, 1)*norm2(reshape([x, y], [size(x), 2]), dim=2))
      call check(error, torque, expected, rel=.true., thr=beam_velocity)
      if (allocated(error)) return
      associate (last => size(work))
         call check(error, abs(work(last)/loss(last) - 1.0_wp) < 0.02_wp .and. loss(last) > 0.0_wp, &
            & 'the work goes into friction: '//to_text(work(last))//' '//to_text(loss(last)))
         if (allocated(error)) return
         call check(error, maxval(abs(miss)) < 1.0e-2_wp*work(last), 'balance: '//to_text(maxval(abs(miss))/work(last)))
      end associate
   end subroutine test_table

end module test_cli_node_contact
