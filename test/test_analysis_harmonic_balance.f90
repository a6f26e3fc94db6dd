module test_analysis_harmonic_balance
   use microslip_analysis_continuation, only: curve_record_t
   use microslip_analysis_excitation, only: excitation_t, kind_harmonic
   use microslip_analysis_fourier, only: fourier_t, new_fourier
   use microslip_analysis_harmonic_balance, only: harmonic_balance_options_t, run_harmonic_balance
   use microslip_analysis_linear_modes, only: stuck_stiffness
   use microslip_analysis_operating_state, only: operating_state_t
   use microslip_analysis_periodic_balance, only: periodic_balance_t
   use microslip_analysis_transient, only: transient_record_t
   use microslip_core_error, only: error_t, status_failed
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
