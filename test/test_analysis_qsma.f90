!> Tests of the quasi-static modal analysis: the linear limit, Masing's rule where it holds and where not, symmetry,
!> energy balance, and agreement with a ring-down by time integration.
module test_analysis_qsma
   use microslip_analysis_excitation, only: excitation_t, kind_half_sine
   use microslip_analysis_linear_modes, only: linear_modes_t, solve_linear_modes
   use microslip_analysis_operating_state, only: operating_state_t
   use microslip_analysis_preload, only: preload_options_t, preload_record_t, run_preload
   use microslip_analysis_qsma, only: loops_always, loops_never, loops_where_needed, masing_tolerance, modal_parameters_t, &
      & qsma_options_t, qsma_record_t, qsma_recorder_t, run_qsma, spaced_amplitudes
   use microslip_analysis_ringdown, only: decay_t, identify_ringdown, ringdown_options_t, ringdown_t
   use microslip_analysis_transient, only: run_transient, transient_options_t, transient_record_t
   use microslip_contact_factory, only: contact_options_t
   use microslip_core_error, only: error_t, failure
   use microslip_core_kinds, only: wp, pi
   use microslip_core_stopwatch, only: stopwatch_t
   use microslip_core_text, only: to_text
   use microslip_fe_reduced_model, only: reduced_model_t
   use microslip_system_compliance_choice, only: compliance_fft
   use microslip_system_jointed_system, only: jointed_system_t, new_system
   use support_checks, only: good
   use support_history, only: history_t
   use support_joint, only: make_joint
   use support_lap_joint, only: make_lap_joint
   use testdrive, only: check, new_unittest, test_failed, testing_error => error_type, unittest_type
   implicit none(type, external)
   private

   public :: collect_analysis_qsma

   !> N, normal force of each interface; m, hills; loads of the joint.
   real(wp), parameter :: interface_force = 2210.0_wp, hill = 4.0e-6_wp
   integer, parameter :: n_loads = 3, cells(2) = [10, 8]
   !> Friction that never lets go, and one that does.
   real(wp), parameter :: sticky = 1.0e3_wp, slippery = 0.3_wp
   !> m, at the first sensor: microslip to nearly gross slip
   real(wp), parameter :: small = 2.0e-6_wp, large = 2.0e-4_wp
   !> Relative accuracy of the contact forces.
   real(wp), parameter :: solver_tolerance = 1.0e-10_wp
   !> Impact on the lap joint, m sqrt(kg)/s^2.
   real(wp), parameter :: lap_hit = 400.0_wp
   !> What the joint's modes tilt the pads more where normal forces are to vary.
   real(wp), parameter :: tilt = 10.0_wp

   !> Hears of the levels, and stops the analysis at one.
   type, extends(qsma_recorder_t) :: stopper_t
      integer :: last = 0
      !> (levels so far) of both directions together, m
      real(wp), allocatable :: amplitude(:)
   contains
      procedure :: level => stop_at_last
   end type stopper_t

contains

   subroutine collect_analysis_qsma(testsuite)
      type(unittest_type), allocatable, intent(out) :: testsuite(:)

      testsuite = [ &
         & new_unittest('amplitudes at equal distances and ratios', test_amplitudes), &
         & new_unittest('stuck: the linear modes, no loss', test_linear_limit), &
         & new_unittest('constant normal forces: loops obey Masing, sides are alike', test_masing), &
         & new_unittest('varying normal forces: they do not', test_no_masing), &
         & new_unittest('loops are the result where Masing does not hold', test_loops_where_needed), &
         & new_unittest('a lap joint in bending: the damping of its ring-down', test_lap_joint), &
         & new_unittest('energy balance of second order in the load steps', test_energy), &
         & new_unittest('all contact solvers and forms of the compliance agree', test_solvers), &
         & new_unittest('points left out that close join', test_left_out), &
         & new_unittest('frequency and damping of a ring-down', test_ringdown), &
         & new_unittest('every level is told when it is finished', test_levels), &
         & new_unittest('a sensor that does not see the mode is refused', test_blind_sensor)]
   end subroutine collect_analysis_qsma

   !> A preloaded joint, all grid points in potential contact. Without `lifting` the modes move the pads along t1 only
   !> and the normal forces stay as they are; with it they tilt the pads a lot.
   subroutine make_preloaded(friction, lifting, system, state, lib, form)
      real(wp), intent(in) :: friction
      logical, intent(in) :: lifting
      type(jointed_system_t), intent(out) :: system
      type(operating_state_t), intent(out) :: state
      type(error_t), allocatable, intent(out) :: lib
      !> How the compliance is held
      integer, intent(in), optional :: form
      type(reduced_model_t) :: reduced
      type(jointed_system_t) :: complete
      real(wp), allocatable :: alpha(:, :)
      integer :: k

      call make_joint(cells(1), cells(2), hill, reduced, complete, lib)
      if (allocated(lib)) return
      allocate (alpha(size(reduced%K_bi, 2), size(reduced%K_bi, 1)))
      do k = 1, size(alpha, 1)
         alpha(k, :) = -reduced%K_bi(:, k)/reduced%K_ii(k, k)
      end do
      reduced%K_bb = reduced%K_bb + matmul(transpose(alpha), transpose(reduced%K_bi))
      if (lifting) then
         alpha(:, 1::3) = tilt*alpha(:, 1::3)
      else
         alpha(:, 1::3) = 0.0_wp
         alpha(:, 3::3) = 0.0_wp
      end if
      reduced%K_bi = -matmul(transpose(alpha), reduced%K_ii)
      reduced%K_bb = reduced%K_bb - matmul(transpose(alpha), transpose(reduced%K_bi))
      call new_system(reduced, complete%pads, n_loads, 2.0e-3_wp*2.0_wp*pi*reduced%frequency, system, lib)
      if (allocated(lib)) return
      if (present(form)) system%compliance = form
      system%pads%friction = friction
      call system%restrict(spread(.true., 1, system%grid_point_count()), lib)
      if (.not. allocated(lib)) call press(system, state, lib)
   end subroutine make_preloaded

   subroutine press(system, state, lib)
      type(jointed_system_t), intent(in) :: system
      type(operating_state_t), intent(out) :: state
      type(error_t), allocatable, intent(out) :: lib
      type(preload_options_t) :: options
      type(preload_record_t) :: record

      options%loads = [1, 2]
      options%interface_force = [interface_force, interface_force]
      call run_preload(system, options, by(system), state, record, lib)
   end subroutine press

   !> The solver that suits the system.
   function by(system) result(options)
      type(jointed_system_t), intent(in) :: system
      type(contact_options_t) :: options

      options%solver = 'condensed'
      if (allocated(system%problem%compliance)) options%solver = 'matrix_free'
      options%tolerance = solver_tolerance
   end function by

   !> QSMA of a mode between two amplitudes.
   subroutine analyse(system, state, mode, amplitude, record, lib, steps, loops, where_needed, solver, recorder)
      type(jointed_system_t), intent(inout) :: system
      type(operating_state_t), intent(inout) :: state
      integer, intent(in) :: mode
      real(wp), intent(in) :: amplitude(:)
      type(qsma_record_t), intent(out) :: record
      type(error_t), allocatable, intent(out) :: lib
      !> Load steps of half a loop: loops always, or where they are needed; without either never
      integer, intent(in), optional :: steps, loops, where_needed
      character(len=*), intent(in), optional :: solver
      class(qsma_recorder_t), intent(inout), optional :: recorder
      type(linear_modes_t) :: modes
      type(qsma_options_t) :: options
      type(contact_options_t) :: contact

      call solve_linear_modes(system, state%contact%status, mode, modes, lib)
      if (allocated(lib)) return
      options%phi = modes%shape(:, mode)
      options%frequency = modes%frequency(mode)
      options%amplitude = amplitude
      options%sensors = [1]
      if (present(steps)) options%steps = steps
      options%loops = merge(loops_always, loops_never, present(loops))
      if (present(loops)) options%cycle_steps = loops
      if (present(where_needed)) options%loops = loops_where_needed
      if (present(where_needed)) options%cycle_steps = where_needed
      contact = by(system)
      if (present(solver)) contact%solver = solver
      call run_qsma(system, state, options, contact, record, lib, recorder)
   end subroutine analyse

   pure real(wp) function largest(values)
      real(wp), intent(in) :: values(:)
      largest = maxval(abs(values))
   end function largest

   subroutine test_amplitudes(error)
      type(testing_error), allocatable, intent(out) :: error
      real(wp), parameter :: rounding = 8*epsilon(1.0_wp)

      call check(error, largest(spaced_amplitudes(1.0_wp, 8.0_wp, 4, .true.)/[1.0_wp, 2.0_wp, 4.0_wp, 8.0_wp] - 1.0_wp) <= rounding)
      if (.not. allocated(error)) call check(error, &
         & largest(spaced_amplitudes(2.0_wp, 8.0_wp, 4, .false.)/[2.0_wp, 4.0_wp, 6.0_wp, 8.0_wp] - 1.0_wp) <= rounding)
      if (.not. allocated(error)) call check(error, &
         & largest(spaced_amplitudes(2.0_wp, 8.0_wp, 1, .true.)/[8.0_wp] - 1.0_wp) <= rounding)
   end subroutine test_amplitudes

   !> Nothing slips and nothing lifts off at a millionth of the large amplitude: secant = tangent.
   subroutine test_linear_limit(error)
      type(testing_error), allocatable, intent(out) :: error
      type(error_t), allocatable :: lib
      type(jointed_system_t) :: system
      type(operating_state_t) :: state
      type(linear_modes_t) :: modes
      type(qsma_record_t) :: record
      real(wp), parameter :: linear = 1.0e-8_wp, no_loss = 1.0e-8_wp
      real(wp) :: viscous
      integer :: mode

      call make_preloaded(sticky, .true., system, state, lib)
      if (.not. allocated(lib)) call solve_linear_modes(system, state%contact%status, 3, modes, lib)
      do mode = 1, 3
         if (.not. allocated(lib)) call analyse(system, state, mode, [1.0e-5_wp*large], record, lib, loops=2)
         call good(error, lib)
         if (allocated(error)) return
         viscous = dot_product(modes%shape(:, mode), system%damping*modes%shape(:, mode))/(4.0_wp*pi*modes%frequency(mode))
         call check(error, largest([record%combined%frequency, record%loop%frequency, record%direction%frequency] &
            & /modes%frequency(mode) - 1.0_wp) < linear, 'frequency of mode '//to_text(mode)//': '// &
            & to_text(record%combined(1)%frequency)//' '//to_text(modes%frequency(mode)))
         if (allocated(error)) return
         call check(error, largest([record%combined%friction_damping_ratio, record%loop%friction_damping_ratio]) < no_loss, &
            & 'loss of mode '//to_text(mode)//': '//to_text(record%combined(1)%friction_damping_ratio))
         if (allocated(error)) return
         call check(error, abs(record%combined(1)%damping_ratio/viscous - 1.0_wp) < linear*10.0_wp, 'viscous damping')
         if (allocated(error)) return
      end do
   end subroutine test_linear_limit

   !> One-dimensional slip but for Poisson's cross coupling: Masing holds nearly exactly, both sides are mirror images.
   subroutine test_masing(error)
      type(testing_error), allocatable, intent(out) :: error
      type(error_t), allocatable :: lib
      type(jointed_system_t) :: system
      type(operating_state_t) :: state
      type(qsma_record_t) :: record
      real(wp), parameter :: mirror = 1.0e-8_wp, cross = 2.0e-3_wp

      call make_preloaded(slippery, .false., system, state, lib)
      if (.not. allocated(lib)) call analyse(system, state, 1, spaced_amplitudes(small, large, 6, .true.), record, lib, &
         & steps=4, loops=8)
      call good(error, lib)
      if (allocated(error)) return
      call check(error, record%unconverged == 0 .and. record%combined(6)%friction_damping_ratio > 1.0e-3_wp .and. &
         & record%combined(6)%frequency < 0.995_wp*record%combined(1)%frequency, 'the joint slips: '// &
         & to_text(record%combined(6)%friction_damping_ratio)//' '//to_text(record%combined(6)%frequency)//' '// &
         & to_text(record%combined(1)%frequency))
      if (allocated(error)) return
      call check(error, largest(record%direction(:, 1)%frequency/record%direction(:, 2)%frequency - 1.0_wp) < mirror .and. &
         & largest(record%direction(:, 1)%dissipated_energy - record%direction(:, 2)%dissipated_energy) &
         & < mirror*record%combined(6)%dissipated_energy, 'both sides')
      if (allocated(error)) return
      call check(error, largest(record%loop%frequency/record%combined%frequency - 1.0_wp) < cross .and. &
         & all(abs(record%loop%dissipated_energy - record%combined%dissipated_energy) &
         & <= cross*abs(record%combined%dissipated_energy)), 'Masing: '// &
         & to_text(largest(record%loop%frequency/record%combined%frequency - 1.0_wp)))
      if (allocated(error)) return
      call check(error, all(record%rounds <= 2 .and. record%closure < 1.0e-6_wp), 'loops close')
   end subroutine test_masing

   !> The modes tilt the pads: the sides differ, and loops lose another energy than Masing's rule says.
   subroutine test_no_masing(error)
      type(testing_error), allocatable, intent(out) :: error
      type(error_t), allocatable :: lib
      type(jointed_system_t) :: system
      type(operating_state_t) :: state
      type(qsma_record_t) :: record

      call make_preloaded(slippery, .true., system, state, lib)
      if (.not. allocated(lib)) call analyse(system, state, 1, [large], record, lib, steps=4, loops=8)
      call good(error, lib)
      if (allocated(error)) return
      call check(error, abs(record%direction(1, 1)%frequency/record%direction(1, 2)%frequency - 1.0_wp) > 1.0e-4_wp .and. &
         & abs(record%loop(1)%dissipated_energy/record%combined(1)%dissipated_energy - 1.0_wp) > 1.0e-2_wp, &
         & to_text(record%direction(1, 1)%frequency/record%direction(1, 2)%frequency - 1.0_wp)//' '// &
         & to_text(record%loop(1)%dissipated_energy/record%combined(1)%dissipated_energy - 1.0_wp))
   end subroutine test_no_masing

   !> Without being asked: loops where the sides differ, none where they agree, none where they are ruled out.
   subroutine test_loops_where_needed(error)
      type(testing_error), allocatable, intent(out) :: error
      type(error_t), allocatable :: lib
      type(jointed_system_t) :: system
      type(operating_state_t) :: state
      type(qsma_record_t) :: record, loops
      type(modal_parameters_t) :: modes(2)
      type(stopper_t) :: listener
      real(wp), parameter :: amplitude(2) = [0.2_wp*large, large]

      call make_preloaded(slippery, .true., system, state, lib)
      if (.not. allocated(lib)) call analyse(system, state, 1, amplitude, loops, lib, loops=2)
      if (.not. allocated(lib)) call analyse(system, state, 1, amplitude, record, lib, where_needed=2, recorder=listener)
      call good(error, lib)
      if (allocated(error)) return
      call check(error,.not. record%masing_holds .and. maxval(record%contradiction) > masing_tolerance &
         & .and. allocated(record%loop), 'Masing is believed')
      if (allocated(error)) return
      modes = record%modes()
      call check(error, all(modes%damping_ratio == loops%loop%damping_ratio) &
         & .and. all(modes%frequency == loops%loop%frequency) .and. size(listener%amplitude) == 2, 'not what the loops say')
      if (allocated(error)) return
      call analyse(system, state, 1, amplitude, record, lib)
      call good(error, lib)
      if (allocated(error)) return
      modes = record%modes()
      call check(error,.not. record%masing_holds .and. .not. allocated(record%loop) &
         & .and. all(modes%damping_ratio == record%combined%damping_ratio), 'loops although they are ruled out')
      if (allocated(error)) return
      call make_preloaded(slippery, .false., system, state, lib)
      if (.not. allocated(lib)) call analyse(system, state, 1, amplitude, record, lib, where_needed=2)
      call good(error, lib)
      if (allocated(error)) return
      call check(error, record%masing_holds .and. .not. allocated(record%loop) .and. record%masing_error < masing_tolerance, &
         & 'loops without need: '//to_text(maxval(record%contradiction))//' '//to_text(record%masing_error))
   end subroutine test_loops_where_needed

   !> The single-lap joint with the options that a case has by default, against its free decay without viscous damping at
   !> the amplitude in the middle of each window: within 5 %, where Masing's rule is far from that.
   subroutine test_lap_joint(error)
      type(testing_error), allocatable, intent(out) :: error
      type(error_t), allocatable :: lib
      type(jointed_system_t) :: system
      type(operating_state_t) :: state
      type(qsma_record_t) :: record
      type(modal_parameters_t), allocatable :: modes(:)
      type(ringdown_t) :: found
      real(wp), parameter :: same_damping = 0.05_wp
      real(wp), allocatable :: ratio(:), masing(:)
      integer :: n

      call make_lap_joint(system, state, lib)
      if (.not. allocated(lib)) call decay_of(system, state, lap_hit, 30.0_wp, found, lib)
      n = size(found%time)
      if (.not. allocated(lib)) call analyse(system, state, 1, found%amplitude(n:1:-1), record, lib, where_needed=5)
      call good(error, lib)
      if (allocated(error)) return
      modes = record%modes()
      ratio = modes%friction_damping_ratio/found%damping_ratio(n:1:-1)
      masing = record%combined%friction_damping_ratio/found%damping_ratio(n:1:-1)
      call check(error, n >= 3 .and. all(abs(ratio - 1.0_wp) < same_damping), 'over the ring-down: '//to_text(minval(ratio)) &
         & //' to '//to_text(maxval(ratio))//', damping '//to_text(found%damping_ratio(1)))
      if (allocated(error)) return
      call check(error, any(abs(masing - 1.0_wp) > 2.0_wp*same_damping), "Masing's rule would do: "//to_text(minval(masing)) &
         & //' to '//to_text(maxval(masing)))
   end subroutine test_lap_joint

   !> Work by trapezoids, friction loss with the mean normal force: four times the steps, a sixteenth of the error and of
   !> the change of the damping (a sixth is asked for: slip sets in point by point).
   subroutine test_energy(error)
      type(testing_error), allocatable, intent(out) :: error
      type(error_t), allocatable :: lib
      type(jointed_system_t) :: system
      type(operating_state_t) :: state
      type(qsma_record_t) :: record
      real(wp) :: balance(4), ratio(4), change(3)
      integer :: k

      call make_preloaded(slippery, .true., system, state, lib)
      do k = 1, 4
         if (.not. allocated(lib)) call analyse(system, state, 1, [0.5_wp*large, large], record, lib, steps=4**(k - 1))
         call good(error, lib)
         if (allocated(error)) return
         balance(k) = largest(record%curve(2, :)%balance_error/record%curve(2, :)%friction_loss)
         ratio(k) = record%combined(2)%friction_damping_ratio
      end do
      call check(error, all(balance(2:) < balance(:3)/6.0_wp), 'balance: '//to_text(balance(1))//' '//to_text(balance(2)) &
         & //' '//to_text(balance(3))//' '//to_text(balance(4)))
      if (allocated(error)) return
      change = abs(ratio(2:) - ratio(:3))
      call check(error, all(change(2:) < change(:2)/6.0_wp), 'damping changes by '//to_text(change(1))//' '// &
         & to_text(change(2))//' '//to_text(change(3)))
   end subroutine test_energy

   !> Also with the compliance as an operator.
   subroutine test_solvers(error)
      type(testing_error), allocatable, intent(out) :: error
      type(error_t), allocatable :: lib
      type(jointed_system_t) :: system, by_fft
      type(operating_state_t) :: state, other_state
      type(qsma_record_t) :: record, other
      real(wp), parameter :: same_frequency = 1.0e-8_wp, same_loss = 1.0e-6_wp
      character(len=*), parameter :: solvers(2) = [character(len=12) :: 'newton', 'gauss_seidel']
      integer :: k

      call make_preloaded(slippery, .true., system, state, lib)
      if (.not. allocated(lib)) call analyse(system, state, 1, [0.5_wp*large, large], record, lib)
      do k = 0, size(solvers)
         if (k == 0) then
            if (.not. allocated(lib)) call make_preloaded(slippery, .true., by_fft, other_state, lib, form=compliance_fft)
            if (.not. allocated(lib)) call analyse(by_fft, other_state, 1, [0.5_wp*large, large], other, lib)
         else
            if (.not. allocated(lib)) call analyse(system, state, 1, [0.5_wp*large, large], other, lib, solver=trim(solvers(k)))
         end if
         call good(error, lib)
         if (allocated(error)) return
         call check(error, largest(other%combined%frequency/record%combined%frequency - 1.0_wp) < same_frequency .and. &
            & largest(other%combined%dissipated_energy/record%combined%dissipated_energy - 1.0_wp) < same_loss, &
            & 'solver '//to_text(k)//': '//to_text(largest(other%combined%frequency/record%combined%frequency - 1.0_wp))//' '// &
            & to_text(largest(other%combined%dissipated_energy/record%combined%dissipated_energy - 1.0_wp)))
         if (allocated(error)) return
      end do
   end subroutine test_solvers

   !> Only the points that the preload closes are in potential contact at first: the result is that of all points.
   subroutine test_left_out(error)
      type(testing_error), allocatable, intent(out) :: error
      type(error_t), allocatable :: lib
      type(jointed_system_t) :: system
      type(operating_state_t) :: state
      type(qsma_record_t) :: record, few
      real(wp), parameter :: lifting_off = 4.0_wp*large, same = 1.0e-7_wp

      call make_preloaded(slippery, .true., system, state, lib)
      if (.not. allocated(lib)) call analyse(system, state, 1, [lifting_off], record, lib)
      if (.not. allocated(lib)) call system%restrict(state%contact%status > 0, lib)
      if (.not. allocated(lib)) call press(system, state, lib)
      if (.not. allocated(lib)) call analyse(system, state, 1, [lifting_off], few, lib)
      call good(error, lib)
      if (allocated(error)) return
      call check(error, few%points_added > 0 .and. size(state%contact%status) == system%problem%n_points, 'points join')
      if (allocated(error)) return
      call check(error, abs(few%combined(1)%frequency/record%combined(1)%frequency - 1.0_wp) < same, 'frequency')
   end subroutine test_left_out

   !> The free decay after an impact in the first mode, without viscous damping.
   subroutine decay_of(system, state, hit, periods, found, lib)
      type(jointed_system_t), intent(inout) :: system
      type(operating_state_t), intent(inout) :: state
      !> Amplitude of the impact, and how long the decay is looked at, in periods of the mode
      real(wp), intent(in) :: hit, periods
      type(ringdown_t), intent(out) :: found
      type(error_t), allocatable, intent(out) :: lib
      type(linear_modes_t) :: modes
      type(history_t) :: history
      type(decay_t) :: decay
      type(transient_options_t) :: options
      type(transient_record_t) :: summary
      type(stopwatch_t) :: clock
      real(wp), parameter :: length = 5.0e-4_wp
      integer :: k

      call solve_linear_modes(system, state%contact%status, 1, modes, lib)
      if (allocated(lib)) return
      system%damping = 0.0_wp
      call system%add_modal_load(modes%shape(:, 1))
      state%amplitude = [state%amplitude, 0.0_wp]
      state%contact%q = [state%modal, state%amplitude]
      options%time_step = 0.3_wp/system%highest_angular_frequency()
      options%duration = periods/modes%frequency(1)
      allocate (options%excitations(1))
      options%excitations(1) = excitation_t(load=system%n_loads, kind=kind_half_sine, amplitude=hit, duration=length)
      allocate (history%samples(0))
      call clock%start()
      call run_transient(system, state, options, by(system), history, clock, summary, lib)
      if (allocated(lib)) return
      if (size(history%samples) /= summary%steps + 1) call failure(lib, 'samples are missing')
      associate (samples => history%samples)
         decay%time = samples%time
         decay%sensor = reshape([(samples(k)%sensor, k=1, size(samples))], [size(system%sensor_modal, 2), size(samples)])
         decay%modal = [(dot_product(modes%shape(:, 1), samples(k)%modal - state%modal), k=1, size(samples))]
      end associate
      if (.not. allocated(lib)) call identify_ringdown(decay, ringdown_options_t(start=length, &
         & frequency=modes%frequency(1), overlap=0.5_wp, sensors=[1]), found, lib)
   end subroutine decay_of

   !> QSMA against a free decay at the same amplitudes.
   subroutine test_ringdown(error)
      type(testing_error), allocatable, intent(out) :: error
      type(error_t), allocatable :: lib
      type(jointed_system_t) :: system
      type(operating_state_t) :: state
      type(qsma_record_t) :: record
      type(ringdown_t) :: found
      !> Mean over a window of ten periods against the value at its middle, other modes, order of the time step.
      real(wp), parameter :: same_frequency = 2.0e-3_wp, same_damping = 0.1_wp
      integer :: k

      call make_preloaded(slippery, .false., system, state, lib)
      if (.not. allocated(lib)) call decay_of(system, state, 900.0_wp, 30.0_wp, found, lib)
      if (.not. allocated(lib)) call analyse(system, state, 1, found%amplitude(size(found%time):1:-1), record, lib)
      call good(error, lib)
      if (allocated(error)) return
      k = size(found%time)
      call check(error, largest(found%frequency(k:1:-1)/record%combined%frequency - 1.0_wp) < same_frequency .and. &
         & largest(found%damping_ratio(k:1:-1)/record%combined%friction_damping_ratio - 1.0_wp) < same_damping, &
         & to_text(found%amplitude(1))//' '//to_text(found%damping_ratio(1))//' '// &
         & to_text(largest(found%frequency(k:1:-1)/record%combined%frequency - 1.0_wp))//' '// &
         & to_text(largest(found%damping_ratio(k:1:-1)/record%combined%friction_damping_ratio - 1.0_wp)))
   end subroutine test_ringdown

   subroutine stop_at_last(self, record, levels, error)
      class(stopper_t), intent(inout) :: self
      type(qsma_record_t), intent(in) :: record
      integer, intent(in) :: levels
      type(error_t), allocatable, intent(out) :: error

      self%amplitude = record%combined(:levels)%amplitude
      if (levels == self%last) call failure(error, 'that will do')
   end subroutine stop_at_last

   !> What is told of the first levels are the bits of the whole analysis.
   subroutine test_levels(error)
      type(testing_error), allocatable, intent(out) :: error
      type(error_t), allocatable :: lib
      type(jointed_system_t) :: system
      type(operating_state_t) :: state
      type(qsma_record_t) :: whole, part
      type(stopper_t) :: stopper
      real(wp), parameter :: amplitude(3) = [small, 10.0_wp*small, large]

      call make_preloaded(slippery, .true., system, state, lib)
      if (.not. allocated(lib)) call analyse(system, state, 1, amplitude, whole, lib, loops=2)
      call good(error, lib)
      if (allocated(error)) return
      stopper%last = 2
      call analyse(system, state, 1, amplitude, part, lib, loops=2, recorder=stopper)
      call check(error, allocated(lib), 'the analysis goes on')
      if (allocated(error)) return
      call check(error, lib%message, 'that will do')
      if (allocated(error)) return
      call check(error, size(stopper%amplitude), 2)
      if (allocated(error)) return
      call check(error, all(stopper%amplitude == whole%combined(:2)%amplitude) .and. &
         & all(part%loop(:2)%dissipated_energy == whole%loop(:2)%dissipated_energy) .and. &
         & all(part%direction(:2, :)%frequency == whole%direction(:2, :)%frequency), 'other bits')
      if (allocated(error)) return
      call check(error, part%iterations > 0, 'nothing is booked')
   end subroutine test_levels

   subroutine test_blind_sensor(error)
      type(testing_error), allocatable, intent(out) :: error
      type(error_t), allocatable :: lib
      type(jointed_system_t) :: system
      type(operating_state_t) :: state
      type(qsma_record_t) :: record

      call make_preloaded(slippery, .true., system, state, lib)
      call good(error, lib)
      if (allocated(error)) return
      system%sensor_modal = 0.0_wp
      system%problem%outputs = 0.0_wp
      call analyse(system, state, 1, [large], record, lib)
      call check(error, allocated(lib))
      if (.not. allocated(error)) call check(error, index(lib%message, 'the sensor does not move') > 0, lib%message)
   end subroutine test_blind_sensor

end module test_analysis_qsma
