module test_analysis_harmonic_balance
   use microslip_analysis_continuation, only: curve_record_t
   use microslip_analysis_excitation, only: excitation_t, kind_harmonic
   use microslip_analysis_fourier, only: fourier_t, new_fourier, series_coefficients
   use microslip_analysis_harmonic_balance, only: harmonic_balance_options_t, run_harmonic_balance
   use microslip_analysis_linear_modes, only: stuck_stiffness
   use microslip_analysis_operating_state, only: operating_state_t
   use microslip_analysis_periodic_balance, only: periodic_balance_t
   use microslip_analysis_periodic_contact, only: contact_cycle_t, periodic_contact_t
   use microslip_analysis_response_point, only: truncation_t
   use microslip_analysis_transient, only: transient_record_t
   use microslip_contact_factory, only: contact_options_t
   use microslip_core_error, only: error_t, status_bad_input, status_failed
   use microslip_core_kinds, only: wp, pi
   use microslip_core_text, only: to_text
   use microslip_linalg_dense, only: solve_general
   use microslip_system_jointed_system, only: jointed_system_t
   use support_checks, only: good
   use support_history, only: history_t, integrate
   use support_periodic, only: collector_t, condensed, make_jenkins, make_preloaded
   use testdrive, only: check, new_unittest, testing_error => error_type, unittest_type
   implicit none(type, external)
   private

   public :: collect_analysis_harmonic_balance

   integer, parameter :: impact_load = 3

contains

   subroutine collect_analysis_harmonic_balance(testsuite)
      type(unittest_type), allocatable, intent(out) :: testsuite(:)

      testsuite = [ &
         & new_unittest('Fourier series', test_fourier), &
         & new_unittest('derivative of the contact forces, friction', test_derivative_friction), &
         & new_unittest('derivative of the contact forces, lift-off', test_derivative_lift_off), &
         & new_unittest('stuck: the linear response', test_stuck), &
         & new_unittest('dry-friction oscillator: closed form', test_jenkins), &
         & new_unittest('dry-friction oscillator: harmonics converge to the time integration', test_harmonics), &
         & new_unittest('gross slip: agrees with the time integration', test_gross_slip), &
         & new_unittest('lift-off: agrees with the time integration', test_lift_off), &
         & new_unittest('points left out that close join', test_left_out), &
         & new_unittest('Fourier series on samples that are closer in places', test_refined), &
         & new_unittest('sliding body: cold start, closed form, estimated error', test_sliding_body), &
         & new_unittest('estimated error against a finer run', test_estimate), &
         & new_unittest('tolerance of 1e-12; one that rounding does not allow', test_tolerance), &
         & new_unittest('30 periods: forces stay within what is claimed', test_thirty_periods), &
         & new_unittest('what cannot be done is told', test_failures)]
   end subroutine collect_analysis_harmonic_balance

   !> Samples to coefficients and back; the derivative by phase.
   subroutine test_fourier(error)
      type(testing_error), allocatable, intent(out) :: error
      type(fourier_t) :: fourier
      real(wp) :: x(2, 7), tau
      real(wp), allocatable :: samples(:, :), slope(:, :)
      integer :: k
      real(wp), parameter :: rounding = 100*epsilon(1.0_wp)

      fourier = new_fourier(3, 16)
      x = reshape([(sin(real(k, wp)), k=1, size(x))], shape(x))
      samples = matmul(x, fourier%basis)
      call check(error, maxval(abs(matmul(samples, transpose(fourier%projection)) - x)) <= rounding, 'not the coefficients')
      if (allocated(error)) return
      slope = matmul(fourier%phase_derivative(x), fourier%basis)
      do k = 1, 16
         tau = 2.0_wp*pi*(k - 1)/16
         call check(error, maxval(abs(samples(:, k) - x(:, 1) - x(:, 2)*cos(tau) - x(:, 3)*sin(tau) - x(:, 4)*cos(2*tau) &
            & - x(:, 5)*sin(2*tau) - x(:, 6)*cos(3*tau) - x(:, 7)*sin(3*tau))) <= rounding, 'not the series')
         if (allocated(error)) return
         call check(error, maxval(abs(slope(:, k) + x(:, 2)*sin(tau) - x(:, 3)*cos(tau) + 2*x(:, 4)*sin(2*tau) &
            & - 2*x(:, 5)*cos(2*tau) + 3*x(:, 6)*sin(3*tau) - 3*x(:, 7)*cos(3*tau))) <= rounding, 'not its derivative')
         if (allocated(error)) return
      end do
   end subroutine test_fourier

   !> Coefficients of a series come back from any samples; those of a jump are as good as the interval it lies in.
   subroutine test_refined(error)
      type(testing_error), allocatable, intent(out) :: error
      type(fourier_t) :: fourier
      real(wp) :: x(2, 7), square(1, 7), expected(1, 7)
      logical, allocatable :: split(:)
      real(wp), allocatable :: phase(:)
      real(wp) :: shift
      integer :: h, k
      real(wp), parameter :: rounding = 1000*epsilon(1.0_wp), turn = 1.1_wp

      fourier = new_fourier(3, 16)
      x = reshape([(sin(real(k, wp)), k=1, size(x))], shape(x))
      do k = 1, 7
         ! Split where the jumps at turn and turn + pi lie.
         phase = atan2(fourier%basis(3, :), fourier%basis(2, :))
         where (phase < 0.0_wp) phase = phase + 2.0_wp*pi
         split = abs(phase - turn) <= fourier%widths() .or. abs(phase - turn - pi) <= fourier%widths()
         split = split .and. fourier%can_be_split()
         split(1) = split(1) .or. k == 2
         if (.not. any(split)) exit
         fourier = fourier%refined(split)
         call check(error, maxval(abs(matmul(matmul(x, fourier%basis), transpose(fourier%projection)) - x)) <= rounding &
            & .and. abs(sum(fourier%widths()) - 2.0_wp*pi) <= rounding, 'not the coefficients')
         if (allocated(error)) return
      end do
      call check(error, size(phase) == fourier%samples .and. fourier%samples > 60, 'not split: '//to_text(fourier%samples))
      if (allocated(error)) return
      square = series_coefficients(fourier, reshape(sign(1.0_wp, sin(phase - turn)), [1, size(phase)]), 3)
      expected = 0.0_wp
      do h = 1, 3, 2
         expected(1, 2*h:2*h + 1) = 4.0_wp/(pi*h)*[-sin(h*turn), cos(h*turn)]
      end do
      ! Two jumps of 2, each known to the finest interval; between them the trapezoidal rule has w^2/12 h^2 of 4/pi.
      shift = 2.0_wp*2.0_wp/pi*2.0_wp*pi/(16*4.0_wp**5) + 9.0_wp/12.0_wp*(2.0_wp*pi/16)**2*4.0_wp/pi
      call check(error, maxval(abs(square - expected)) <= shift, 'square wave: '//to_text(maxval(abs(square - expected)), 3))
   end subroutine test_refined

   !> dF/dx against central differences along random directions.
   subroutine check_derivative(size_of, seen, error)
      !> Amplitude of the modal coordinates, m sqrt(kg)
      real(wp), intent(in) :: size_of
      !> Most points open and slipping
      integer, intent(out) :: seen(3)
      type(testing_error), allocatable, intent(out) :: error
      type(error_t), allocatable :: lib
      type(jointed_system_t) :: system
      type(operating_state_t) :: state
      type(periodic_balance_t) :: balance
      real(wp), allocatable :: x(:), direction(:), J(:, :), plus(:, :), minus(:, :), predicted(:)
      real(wp) :: h, deviation
      integer :: k, trial
      !> Of the differences: third order in h, rounding 1e-12 of the force over h; and kinks within h of the motion
      real(wp), parameter :: accuracy = 1.0e-5_wp

      call make_preloaded([5, 3], 0.0_wp, 0.4_wp, system, state, lib)
      if (.not. allocated(lib)) call balance%set_up(system, state, [1], 2, 24, condensed(), lib)
      call good(error, lib)
      if (allocated(error)) return
      x = [(0.3_wp*size_of*sin(3.0_wp*k), k=1, balance%unknowns())]
      x(:system%n_modes) = 0.1_wp*x(:system%n_modes)
      x(system%n_modes + 1) = size_of
      call balance%evaluate(x)
      seen = balance%cycle%counts
      call check(error, balance%cycle%repeats(), 'no periodic forces: '//to_text(balance%cycle%repeat_error))
      if (allocated(error)) return
      call balance%renew_derivative(lib)
      call good(error, lib)
      if (allocated(error)) return
      allocate (J(size(x), size(x)))
      call balance%stiffness_matrix(0.0_wp, 0.0_wp, J)
      h = 1.0e-6_wp*size_of
      do trial = 1, 4
         direction = [(cos(real(trial*k*k, wp)), k=1, size(x))]
         call balance%evaluate(x + h*direction)
         plus = balance%linear_force(balance%x, 0.0_wp, 0.0_wp) - balance%force
         call balance%evaluate(x - h*direction)
         minus = balance%linear_force(balance%x, 0.0_wp, 0.0_wp) - balance%force
         predicted = matmul(J, direction)
         deviation = norm2(reshape(plus - minus, [size(x)])/(2.0_wp*h) - predicted)/norm2(predicted)
         call check(error, deviation <= accuracy, 'trial '//to_text(trial)//': deviation '//to_text(deviation, 3))
         if (allocated(error)) return
      end do
   end subroutine check_derivative

   subroutine test_derivative_friction(error)
      type(testing_error), allocatable, intent(out) :: error
      integer :: seen(3)

      call check_derivative(8.0e-5_wp, seen, error)
      if (allocated(error)) return
      call check(error, seen(3) > 5, 'hardly any slip')
   end subroutine test_derivative_friction

   subroutine test_derivative_lift_off(error)
      type(testing_error), allocatable, intent(out) :: error
      integer :: seen(3)

      call check_derivative(4.0e-4_wp, seen, error)
      if (allocated(error)) return
      call check(error, seen(3) > 5 .and. seen(1) > 5, 'hardly any slip or lift-off')
   end subroutine test_derivative_lift_off

   !> With friction that never lets go: (K - w^2 + i w D) x = f.
   subroutine test_stuck(error)
      type(testing_error), allocatable, intent(out) :: error
      type(error_t), allocatable :: lib
      type(jointed_system_t) :: system
      type(operating_state_t) :: state
      type(harmonic_balance_options_t) :: options
      type(collector_t) :: collector
      type(curve_record_t), allocatable :: records(:)
      real(wp), allocatable :: stiffness(:, :), matrix(:, :), x(:, :)
      real(wp) :: omega, largest
      integer :: j, k, n
      real(wp), parameter :: accuracy = 1.0e-10_wp

      call make_preloaded([4, 3], 0.0_wp, 1.0e3_wp, system, state, lib)
      if (.not. allocated(lib)) call stuck_stiffness(system, state%contact%status, stiffness, lib)
      options%sensors = [1]
      options%load = impact_load
      options%levels = [0.1_wp, 4.0_wp]
      options%frequency_range = [180.0_wp, 300.0_wp]
      options%frequency_step = 5.0_wp
      options%harmonics = 3
      options%samples = 20
      options%tolerance = 1.0e-11_wp
      if (.not. allocated(lib)) call run_harmonic_balance(system, state, options, condensed(), collector, records, lib)
      call good(error, lib)
      if (allocated(error)) return
      n = system%n_modes
      largest = 0.0_wp
      do j = 1, size(collector%points)
         associate (point => collector%points(j))
            omega = 2.0_wp*pi*point%frequency
            matrix = reshape(spread(0.0_wp, 1, 4*n*n), [2*n, 2*n])
            matrix(:n, :n) = stiffness
            matrix(n + 1:, n + 1:) = stiffness
            do k = 1, n
               matrix(k, k) = matrix(k, k) - omega**2
               matrix(n + k, n + k) = matrix(n + k, n + k) - omega**2
               matrix(k, n + k) = omega*system%damping(k)
               matrix(n + k, k) = -omega*system%damping(k)
            end do
            x = reshape([point%level*system%load_modal(:, impact_load), spread(0.0_wp, 1, n)], [2*n, 1])
            call solve_general(matrix, x, lib)
            call good(error, lib)
            if (allocated(error)) return
            largest = max(largest, norm2(point%modal(:, 2:3) - reshape(x, [n, 2]))/norm2(x), &
               & norm2(point%modal(:, 4:))/norm2(x), norm2(point%modal(:, 1))/norm2(x))
         end associate
      end do
      call check(error, largest <= accuracy, 'deviation '//to_text(largest, 3))
      if (allocated(error)) return
      call check(error, size(collector%points) == sum(records%points) .and. minval(records%points) > 20, 'points missing')
   end subroutine test_stuck

   !> One harmonic of a Jenkins element under x = A cos(tau), beyond its limit displacement b = limit/spring:
   !>     in phase      spring A/pi (theta - sin(2 theta)/2),  cos(theta) = 1 - 2 b/A
   !>     out of phase  spring A/pi sin(theta)^2 = 4 limit (A - b)/(pi A)
   !> The balance of one harmonic is then an equation for A; samples of a period see the kinks to second order.
   subroutine test_jenkins(error)
      type(testing_error), allocatable, intent(out) :: error
      type(error_t), allocatable :: lib
      type(jointed_system_t) :: system
      type(operating_state_t) :: state
      type(harmonic_balance_options_t) :: options
      type(collector_t) :: collector
      type(curve_record_t), allocatable :: records(:)
      real(wp), parameter :: spring = 1.0e4_wp, element = 6.0e3_wp, limit = 3.0_wp, damping = 0.5_wp, load = 2.0_wp
      real(wp) :: a, b, theta, in_phase, loss, balance, largest, omega
      integer :: k

      call make_jenkins(spring, damping, element, limit, system, state, lib)
      options%sensors = [1]
      options%load = 1
      options%levels = [load]
      options%frequency_range = [10.0_wp, 30.0_wp]
      options%frequency_step = 1.0_wp
      options%harmonics = 1
      options%samples = 400
      if (.not. allocated(lib)) call run_harmonic_balance(system, state, options, condensed(), collector, records, lib)
      call good(error, lib)
      if (allocated(error)) return
      largest = 0.0_wp
      b = limit/element
      do k = 1, size(collector%points)
         a = collector%points(k)%amplitude
         omega = 2.0_wp*pi*collector%points(k)%frequency
         in_phase = element*a
         loss = 0.0_wp
         if (a > b) then
            theta = acos(1.0_wp - 2.0_wp*b/a)
            in_phase = element*a/pi*(theta - 0.5_wp*sin(2.0_wp*theta))
            loss = 4.0_wp*limit*(a - b)/(pi*a)
         end if
         balance = norm2([in_phase + (spring - omega**2)*a, loss + omega*damping*a])/load - 1.0_wp
         largest = max(largest, abs(balance))
      end do
      call check(error, maxval(collector%points%friction_loss) > 0.0_wp .and. largest <= 10.0_wp*(2.0_wp*pi/400)**2, &
         & 'deviation '//to_text(largest, 3))
   end subroutine test_jenkins

   !> The response at one frequency by harmonic balance.
   subroutine respond(system, state, load, level, frequency, harmonics, samples, modal, friction_loss, lib)
      type(jointed_system_t), intent(in) :: system
      type(operating_state_t), intent(in) :: state
      integer, intent(in) :: load, harmonics, samples
      real(wp), intent(in) :: level, frequency
      !> (modes, 2H + 1)
      real(wp), allocatable, intent(out) :: modal(:, :)
      real(wp), intent(out) :: friction_loss
      type(error_t), allocatable, intent(out) :: lib
      type(jointed_system_t) :: copy
      type(operating_state_t) :: start
      type(harmonic_balance_options_t) :: options
      type(collector_t) :: collector
      type(curve_record_t), allocatable :: records(:)

      copy = system
      start = state
      options%sensors = [1]
      options%load = load
      options%levels = [level]
      options%frequency_range = frequency
      options%frequency_step = 1.0_wp
      options%harmonics = harmonics
      options%samples = samples
      options%max_iterations = 30
      call run_harmonic_balance(copy, start, options, condensed(), collector, records, lib)
      if (allocated(lib)) return
      modal = collector%points(1)%modal
      friction_loss = collector%points(1)%friction_loss
   end subroutine respond

   !> The steady state of a time integration: Fourier coefficients of the last of so many periods.
   subroutine settle(system, state, load, level, frequency, harmonics, periods, steps, modal, friction_loss, lib)
      type(jointed_system_t), intent(in) :: system
      type(operating_state_t), intent(in) :: state
      integer, intent(in) :: load, harmonics, periods
      !> Of a period
      integer, intent(in) :: steps
      real(wp), intent(in) :: level, frequency
      real(wp), allocatable, intent(out) :: modal(:, :)
      real(wp), intent(out) :: friction_loss
      type(error_t), allocatable, intent(out) :: lib
      type(history_t) :: history
      type(transient_record_t) :: record
      type(fourier_t) :: fourier
      real(wp), allocatable :: motion(:, :)
      integer :: n

      fourier = new_fourier(harmonics, steps)
      call integrate(system, state, 1.0_wp/(frequency*steps), periods*steps, [excitation_t(load=load, kind=kind_harmonic, &
         & amplitude=level, frequency=frequency)], condensed(), history, record, lib)
      if (allocated(lib)) return
      motion = history%modal()
      n = periods*steps
      modal = matmul(motion(:, n - steps + 1:n) - spread(state%modal, 2, steps), transpose(fourier%projection))
      friction_loss = history%samples(n + 1)%energy%friction_loss - history%samples(n + 1 - steps)%energy%friction_loss
   end subroutine settle

   !> Largest difference of the first harmonics over the size of the vibration.
   pure real(wp) function difference(one, other, columns)
      real(wp), intent(in) :: one(:, :), other(:, :)
      integer, intent(in) :: columns(:)
      difference = norm2(one(:, columns) - other(:, columns))/norm2(other(:, 2:))
   end function difference

   !> Near resonance: the more harmonics, the closer to the time integration, by which the leapfrog's error is extrapolated.
   subroutine test_harmonics(error)
      type(testing_error), allocatable, intent(out) :: error
      type(error_t), allocatable :: lib
      type(jointed_system_t) :: system
      type(operating_state_t) :: state
      real(wp), allocatable :: coarse(:, :), fine(:, :), balance(:, :)
      real(wp), parameter :: spring = 1.0e4_wp, element = 6.0e3_wp, limit = 3.0_wp, damping = 8.0_wp, load = 6.0_wp, &
         & frequency = 18.0_wp
      real(wp) :: deviation(3), loss, dissipated
      integer :: k
      integer, parameter :: harmonics(3) = [1, 3, 21], steps = 600, periods = 45
      real(wp), parameter :: accuracy = 1.0e-4_wp

      call make_jenkins(spring, damping, element, limit, system, state, lib)
      if (.not. allocated(lib)) call settle(system, state, 1, load, frequency, 21, periods, steps, coarse, loss, lib)
      if (.not. allocated(lib)) call settle(system, state, 1, load, frequency, 21, periods, 2*steps, fine, loss, lib)
      call good(error, lib)
      if (allocated(error)) return
      fine = fine + (fine - coarse)/3.0_wp
      do k = 1, 3
         call respond(system, state, 1, load, frequency, harmonics(k), 600, balance, dissipated, lib)
         call good(error, lib)
         if (allocated(error)) return
         deviation(k) = difference(balance, fine, [2, 3])
      end do
      call check(error, deviation(3) <= accuracy .and. all(deviation(2:) < 0.5_wp*deviation(:2)) &
         & .and. abs(dissipated/loss - 1.0_wp) < 1.0e-2_wp, &
         & 'deviations '//to_text(deviation(1), 3)//' '//to_text(deviation(2), 3)//' '//to_text(deviation(3), 3) &
         & //', losses '//to_text(dissipated)//' '//to_text(loss))
   end subroutine test_harmonics

   !> Harmonic balance and time integration of a joint, both converged.
   subroutine compare(level, opens, error)
      !> Of the load
      real(wp), intent(in) :: level
      !> Whether points are to open
      logical, intent(in) :: opens
      type(testing_error), allocatable, intent(out) :: error
      type(error_t), allocatable :: lib
      type(jointed_system_t) :: system
      type(operating_state_t) :: state
      type(periodic_balance_t) :: motion
      real(wp), allocatable :: coarse(:, :), fine(:, :), balance(:, :)
      real(wp) :: loss, dissipated, deviation
      integer, parameter :: harmonics = 15, samples = 300, periods = 25, steps = 400
      real(wp), parameter :: frequency = 150.0_wp, accuracy = 1.0e-4_wp, ratio = 0.1_wp

      call make_preloaded([5, 3], 0.0_wp, 0.4_wp, system, state, lib)
      system%damping = 4.0_wp*pi*ratio*frequency
      if (.not. allocated(lib)) call settle(system, state, impact_load, level, frequency, harmonics, periods, steps, coarse, &
         & loss, lib)
      if (.not. allocated(lib)) call settle(system, state, impact_load, level, frequency, harmonics, periods, 2*steps, fine, &
         & loss, lib)
      if (.not. allocated(lib)) call respond(system, state, impact_load, level, frequency, harmonics, samples, balance, &
         & dissipated, lib)
      if (.not. allocated(lib)) call motion%set_up(system, state, [1], harmonics, samples, condensed(), lib)
      call good(error, lib)
      if (allocated(error)) return
      call motion%evaluate(reshape(balance, [size(balance)]))
      call check(error, motion%cycle%counts(3) > 0 .and. (opens .eqv. motion%cycle%counts(1) > 0), 'states')
      if (allocated(error)) return
      fine = fine + (fine - coarse)/3.0_wp
      deviation = difference(balance, fine, [2, 3, 4, 5, 6, 7])
      call check(error, deviation <= accuracy .and. abs(dissipated/loss - 1.0_wp) < 1.0e-2_wp, &
         & 'deviation '//to_text(deviation, 3)//', losses '//to_text(dissipated)//' '//to_text(loss))
   end subroutine compare

   subroutine test_gross_slip(error)
      type(testing_error), allocatable, intent(out) :: error
      call compare(400.0_wp, .false., error)
   end subroutine test_gross_slip

   subroutine test_lift_off(error)
      type(testing_error), allocatable, intent(out) :: error
      call compare(1600.0_wp, .true., error)
   end subroutine test_lift_off

   !> Only the closed points in the potential contact set at first: those that close join, and the result is that of all.
   subroutine test_left_out(error)
      type(testing_error), allocatable, intent(out) :: error
      type(error_t), allocatable :: lib
      type(jointed_system_t) :: system, few
      type(operating_state_t) :: state, start
      type(harmonic_balance_options_t) :: options
      type(collector_t) :: full, grown
      type(curve_record_t), allocatable :: records(:)
      logical, allocatable :: closed(:)
      real(wp), parameter :: same = 1.0e-5_wp

      call make_preloaded([9, 6], 8.0e-6_wp, 0.4_wp, system, state, lib)
      call good(error, lib)
      if (allocated(error)) return
      closed = state%contact%status /= 0
      system%damping = 4.0_wp*pi*0.1_wp*150.0_wp
      few = system
      call few%restrict(closed, lib)
      start = state
      start%contact%force = reshape(pack(state%contact%force, spread(closed, 1, 3)), [3, count(closed)])
      start%contact%gap = reshape(pack(state%contact%gap, spread(closed, 1, 3)), [3, count(closed)])
      start%contact%status = pack(state%contact%status, closed)
      options%sensors = [1]
      options%load = impact_load
      options%levels = [3200.0_wp]
      options%frequency_range = [150.0_wp, 150.0_wp]
      options%frequency_step = 1.0_wp
      ! So many that none are added: which ones are depends on the motions on the way.
      options%samples = 400
      if (.not. allocated(lib)) call run_harmonic_balance(few, start, options, condensed(), grown, records, lib)
      if (.not. allocated(lib)) call run_harmonic_balance(system, state, options, condensed(), full, records, lib)
      call good(error, lib)
      if (allocated(error)) return
      call check(error, few%problem%n_points > count(closed) .and. size(start%contact%status) == few%problem%n_points, &
         & 'nobody joined')
      if (allocated(error)) return
      associate (a => grown%points(size(grown%points)), b => full%points(size(full%points)))
         call check(error, abs(a%frequency - b%frequency) <= 0.0_wp .and. norm2(a%modal - b%modal) <= same*norm2(b%modal), &
            & to_text(norm2(a%modal - b%modal)/norm2(b%modal), 3))
      end associate
   end subroutine test_left_out

   !> Amplitude (L2) of a mass on a spring with dry friction that slides without stops, harmonics up to H (Den Hartog's
   !> motion for H to infinity). Friction is a square wave that turns where the velocity of those harmonics does, at theta:
   !>     sin(theta) = 4 limit/(pi load) D_1 sum over odd h of 1/D_h,    D_h = spring - (h omega)^2
   !> The tail of that sum falls with 1/H, and with it the error of the amplitude.
   pure real(wp) function sliding_amplitude(spring, limit, load, omega, harmonics)
      real(wp), intent(in) :: spring, limit, load, omega
      integer, intent(in) :: harmonics
      real(wp) :: theta, wave
      integer :: h

      wave = 4.0_wp*limit/pi
      theta = asin(wave/load*(spring - omega**2)*sum([(1.0_wp/(spring - (h*omega)**2), h=1, harmonics, 2)]))
      sliding_amplitude = 0.0_wp
      do h = 3, harmonics, 2
         sliding_amplitude = sliding_amplitude + (wave/(h*(spring - (h*omega)**2)))**2
      end do
      ! The fundamental: load less friction, whose phase is theta against the velocity.
      sliding_amplitude = sqrt(sliding_amplitude + (load**2 - 2.0_wp*load*wave*sin(theta) + wave**2)/(spring - omega**2)**2)
   end function sliding_amplitude

   !> A body that slides as a whole: found from a cold start, above and below resonance; agrees with the closed form of the
   !> same number of harmonics, and the estimated error with what is missing to all harmonics.
   subroutine test_sliding_body(error)
      type(testing_error), allocatable, intent(out) :: error
      type(error_t), allocatable :: lib
      type(jointed_system_t) :: system
      type(operating_state_t) :: state
      type(harmonic_balance_options_t) :: options
      type(collector_t) :: collector
      type(curve_record_t), allocatable :: records(:)
      type(truncation_t), allocatable :: truncation(:)
      real(wp), parameter :: spring = 1.0e4_wp, element = 1.0e10_wp, limit = 1.0_wp, load = 2.0_wp
      !> The element gives way by 2 limit/element of an amplitude a of 1e-4 m: friction turns over sqrt(8 limit/(element a))
      real(wp), parameter :: turning = 3.0e-3_wp
      !> Harmonics beyond 20 H are a twentieth of what is missing, steps that are left off another one
      real(wp), parameter :: share = 0.15_wp
      real(wp) :: here, everything, deviation
      integer :: k
      integer, parameter :: harmonics = 7, all_harmonics = 4001

      options%sensors = [1]
      options%load = 1
      options%levels = [load]
      ! So short that the curve is looked at straight along the amplitude: the error at the same frequency
      options%frequency_step = 1.0e-9_wp
      options%harmonics = harmonics
      options%samples = 128
      do k = 1, 2
         call make_jenkins(spring, 0.0_wp, element, limit, system, state, lib)
         options%frequency_range = merge(28.0_wp, 20.0_wp, k == 1)
         if (allocated(collector%points)) deallocate (collector%points)
         if (.not. allocated(lib)) call run_harmonic_balance(system, state, options, condensed(), collector, records, lib, &
            & truncation)
         call good(error, lib)
         if (allocated(error)) return
         here = sliding_amplitude(spring, limit, load, 2.0_wp*pi*options%frequency_range(1), harmonics)
         everything = sliding_amplitude(spring, limit, load, 2.0_wp*pi*options%frequency_range(1), all_harmonics)
         deviation = collector%points(1)%amplitude/here - 1.0_wp
         call check(error, abs(deviation) <= turning, 'not the closed form: '//to_text(deviation, 3))
         if (allocated(error)) return
         call check(error, truncation(1)%known .and. abs(truncation(1)%by_both(1) - (everything/here - 1.0_wp)) &
            & <= share*abs(everything/here - 1.0_wp) + turning, 'estimate '//to_text(truncation(1)%by_both(1), 3)//' of ' &
            & //to_text(everything/here - 1.0_wp, 3))
         if (allocated(error)) return
      end do
   end subroutine test_sliding_body

   !> The estimate at few harmonics and samples against a run with many.
   subroutine test_estimate(error)
      type(testing_error), allocatable, intent(out) :: error
      type(error_t), allocatable :: lib
      type(jointed_system_t) :: system
      type(operating_state_t) :: state
      type(harmonic_balance_options_t) :: options
      type(collector_t) :: coarse, fine
      type(curve_record_t), allocatable :: records(:)
      type(truncation_t), allocatable :: truncation(:)
      real(wp), parameter :: share = 0.3_wp
      real(wp) :: missing

      call make_jenkins(1.0e4_wp, 8.0_wp, 6.0e4_wp, 3.0_wp, system, state, lib)
      options%sensors = [1]
      options%load = 1
      options%levels = [6.0_wp]
      options%frequency_range = 18.0_wp
      ! So short that the curve is looked at straight along the amplitude: the error at the same frequency
      options%frequency_step = 1.0e-9_wp
      options%harmonics = 3
      options%samples = 64
      if (.not. allocated(lib)) call run_harmonic_balance(system, state, options, condensed(), coarse, records, lib, truncation)
      options%harmonics = 41
      options%samples = 800
      if (.not. allocated(lib)) call run_harmonic_balance(system, state, options, condensed(), fine, records, lib)
      call good(error, lib)
      if (allocated(error)) return
      missing = fine%points(1)%amplitude/coarse%points(1)%amplitude - 1.0_wp
      call check(error, abs(missing) > 1.0e-3_wp .and. abs(truncation(1)%by_both(1) - missing) <= share*abs(missing), &
         & 'estimate '//to_text(truncation(1)%by_both(1), 3)//' of '//to_text(missing, 3))
   end subroutine test_estimate

   !> Partial slip at a tolerance of 1e-12; 1e-15 is below the rounding of the forces and refused with what is allowed.
   subroutine test_tolerance(error)
      type(testing_error), allocatable, intent(out) :: error
      type(error_t), allocatable :: lib
      type(jointed_system_t) :: system
      type(operating_state_t) :: state
      type(harmonic_balance_options_t) :: options
      type(collector_t) :: collector
      type(curve_record_t), allocatable :: records(:)
      real(wp), parameter :: tight = 1.0e-12_wp

      call make_preloaded([5, 3], 4.0e-6_wp, 0.4_wp, system, state, lib)
      options%sensors = [1]
      options%load = impact_load
      options%levels = [400.0_wp]
      options%frequency_range = [140.0_wp, 150.0_wp]
      options%frequency_step = 5.0_wp
      options%tolerance = tight
      options%max_iterations = 40
      if (.not. allocated(lib)) call run_harmonic_balance(system, state, options, condensed(), collector, records, lib)
      call good(error, lib)
      if (allocated(error)) return
      call check(error, size(collector%points) > 2 .and. maxval(collector%points%correction%residual) <= tight &
         & .and. maxval(collector%points%counts(3)) > 0, 'residual')
      if (allocated(error)) return
      options%tolerance = 1.0e-15_wp
      call run_harmonic_balance(system, state, options, condensed(), collector, records, lib)
      call check(error, allocated(lib))
      if (.not. allocated(error)) call check(error, lib%status == status_bad_input .and. index(lib%message, 'allowed here') > 0, &
         & lib%message)
   end subroutine test_tolerance

   !> Solutions marched for 30 periods from the preload: from where the bound is within the tolerance the forces stay within
   !> it. At these loads some points hardly slip, and the forces take long to repeat.
   subroutine test_thirty_periods(error)
      type(testing_error), allocatable, intent(out) :: error
      type(error_t), allocatable :: lib
      type(jointed_system_t) :: system
      type(operating_state_t) :: state
      type(harmonic_balance_options_t) :: options
      type(collector_t) :: collector
      type(curve_record_t), allocatable :: records(:)
      type(periodic_contact_t) :: contact
      type(contact_cycle_t) :: cycle
      type(fourier_t) :: fourier
      real(wp), allocatable :: q(:, :), reaction(:, :, :)
      type(contact_options_t) :: exact
      real(wp) :: bound(30), solver, largest
      integer :: k, n, p
      integer, parameter :: periods = 30

      call make_preloaded([9, 6], 8.0e-6_wp, 0.4_wp, system, state, lib)
      options%sensors = [1]
      options%load = impact_load
      options%levels = [50.0_wp, 100.0_wp, 200.0_wp, 400.0_wp]
      options%frequency_range = [140.0_wp, 150.0_wp]
      options%frequency_step = 5.0_wp
      options%tolerance = 1.0e-8_wp
      options%max_iterations = 40
      if (.not. allocated(lib)) call run_harmonic_balance(system, state, options, condensed(), collector, records, lib)
      if (.not. allocated(lib)) call contact%set_up(system, state, condensed(), lib)
      call good(error, lib)
      if (allocated(error)) return
      fourier = new_fourier(options%harmonics, options%samples)
      exact = condensed()
      largest = maxval(state%contact%force(1, :))
      n = system%n_modes
      allocate (reaction(n, options%samples, periods))
      do k = 1, size(collector%points)
         associate (point => collector%points(k))
            q = spread([state%modal, state%amplitude], 2, options%samples)
            q(:n, :) = q(:n, :) + matmul(point%modal, fourier%basis)
            q(n + impact_load, :) = q(n + impact_load, :) + point%level*fourier%basis(2, :)
            ! Two periods, each of which the contact solver finds to its tolerance
            solver = 2.0_wp*exact%tolerance*largest*maxval(sum(abs(system%problem%R(:, :n)), 1))
            call contact%begin(.false., cycle)
            do p = 1, periods
               call contact%march_period(system, q, cycle)
               reaction(:, :, p) = cycle%reaction
               bound(p) = cycle%remaining + cycle%noise + solver
            end do
            do p = 3, periods
               ! What is claimed of a solution
               if (bound(p) - solver > options%tolerance*norm2(point%level*system%load_modal(:, impact_load))) cycle
               call check(error, maxval(abs(reaction(:, :, periods) - reaction(:, :, p))) <= bound(p), 'point '//to_text(k) &
                  & //', period '//to_text(p)//': '//to_text(maxval(abs(reaction(:, :, periods) - reaction(:, :, p))), 3) &
                  & //' of '//to_text(bound(p), 3))
               if (allocated(error)) return
            end do
         end associate
      end do
   end subroutine test_thirty_periods

   subroutine test_failures(error)
      type(testing_error), allocatable, intent(out) :: error
      type(error_t), allocatable :: lib
      type(jointed_system_t) :: system
      type(operating_state_t) :: state
      type(harmonic_balance_options_t) :: options
      type(collector_t) :: collector
      type(curve_record_t), allocatable :: records(:)

      call make_jenkins(1.0e4_wp, 0.5_wp, 6.0e3_wp, 3.0_wp, system, state, lib)
      call good(error, lib)
      if (allocated(error)) return
      options%sensors = [1]
      options%load = 1
      options%levels = [1.0_wp, 2.0_wp]
      options%frequency_range = [10.0_wp, 30.0_wp]
      options%frequency_step = 1.0_wp
      options%max_points = 3
      call run_harmonic_balance(system, state, options, condensed(), collector, records, lib)
      call check(error, allocated(lib))
      if (allocated(error)) return
      call check(error, lib%status == status_failed .and. index(lib%message, 'level 1') > 0 .and. size(collector%points) == 3, &
         & lib%message)
      if (allocated(error)) return
      deallocate (system%problem%G)
      call run_harmonic_balance(system, state, options, condensed(), collector, records, lib)
      call check(error, allocated(lib))
      if (.not. allocated(error)) call check(error, index(lib%message, "compliance = 'dense'") > 0, lib%message)
   end subroutine test_failures

end module test_analysis_harmonic_balance
