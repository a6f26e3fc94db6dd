!> Tests of the time integration: exact properties of the leapfrog where the system is linear, order and energy
!> books where there is friction, and agreement of everything that must not change the history.
module test_analysis_transient
   use microslip_analysis_excitation, only: excitation_t, kind_half_sine, kind_harmonic
   use microslip_analysis_linear_modes, only: linear_modes_t, solve_linear_modes
   use microslip_analysis_operating_state, only: operating_state_t
   use microslip_analysis_preload, only: preload_options_t, preload_record_t, run_preload
   use microslip_analysis_transient, only: transient_record_t
   use microslip_contact_factory, only: contact_options_t
   use microslip_contact_problem, only: new_state
   use microslip_core_error, only: error_t, status_failed
   use microslip_core_kinds, only: wp, pi
   use microslip_core_text, only: to_text
   use microslip_fe_reduced_model, only: reduced_model_t
   use microslip_halfspace_convolution, only: new_convolution
   use microslip_linalg_dense, only: eigen_symmetric
   use microslip_system_jointed_system, only: jointed_system_t, new_system
   use microslip_system_pad, only: pad_t
   use support_history, only: history_t, integrate
   use support_joint, only: make_joint
   use support_checks, only: good
   use testdrive, only: check, new_unittest, testing_error => error_type, unittest_type
   implicit none(type, external)
   private

   public :: collect_analysis_transient

   !> omega_max dt of the paper.
   real(wp), parameter :: safety = 0.74_wp
   !> Relative accuracy of the contact forces in a step.
   real(wp), parameter :: solver_tolerance = 1.0e-10_wp
   !> Normal force of each interface, N; length of the impact, s.
   real(wp), parameter :: interface_force = 2210.0_wp, pulse = 5.0e-4_wp
   !> Amplitudes of the impact on the hills of 4 um: some points slip, gross slip with lift-off.
   real(wp), parameter :: light = 1600.0_wp, medium = 6400.0_wp, heavy = 25600.0_wp, hill = 4.0e-6_wp
   !> Friction that never lets go.
   real(wp), parameter :: sticky = 1.0e3_wp
   integer, parameter :: impact_load = 3

contains

   subroutine collect_analysis_transient(testsuite)
      type(unittest_type), allocatable, intent(out) :: testsuite(:)

      testsuite = [ &
         & new_unittest('free oscillation has the leapfrog frequency', test_free_oscillation), &
         & new_unittest('stuck: energy is conserved over 100 000 steps', test_conservation), &
         & new_unittest('stuck: a mode decays with its damping ratio', test_damping), &
         & new_unittest('friction: second order in the time step', test_order), &
         & new_unittest('friction: energy books', test_energy), &
         & new_unittest('gross slip and lift-off: all solvers agree', test_solvers), &
         & new_unittest('the law on velocity level stays close', test_velocity_level), &
         & new_unittest('a time step past the limit is refused', test_time_step_limit), &
         & new_unittest('points left out that close join', test_left_out), &
         & new_unittest('repeatable, whatever the number of threads', test_threads), &
         & new_unittest('loads on the boundary keep the books', test_boundary_load), &
         & new_unittest('independent of the system of units', test_units)]
   end subroutine collect_analysis_transient

   !> A preloaded joint, all grid points in potential contact.
   subroutine make_preloaded(cells, peak_to_peak, friction, damped, system, state, lib)
      integer, intent(in) :: cells(2)
      !> m, of the hills
      real(wp), intent(in) :: peak_to_peak, friction
      logical, intent(in) :: damped
      type(jointed_system_t), intent(out) :: system
      type(operating_state_t), intent(out) :: state
      type(error_t), allocatable, intent(out) :: lib
      type(reduced_model_t) :: reduced

      call make_joint(cells(1), cells(2), peak_to_peak, reduced, system, lib)
      if (allocated(lib)) return
      system%pads%friction = friction
      if (.not. damped) system%damping = 0.0_wp
      call system%restrict(spread(.true., 1, system%grid_point_count()), lib)
      if (.not. allocated(lib)) call press(system, 1.0_wp, state, lib)
   end subroutine make_preloaded

   !> Preload with `unit` newtons written as 1.
   subroutine press(system, unit, state, lib)
      type(jointed_system_t), intent(in) :: system
      real(wp), intent(in) :: unit
      type(operating_state_t), intent(out) :: state
      type(error_t), allocatable, intent(out) :: lib
      type(preload_options_t) :: options
      type(preload_record_t) :: record

      options%loads = [1, 2]
      options%interface_force = [interface_force, interface_force]/unit
      call run_preload(system, options, by('condensed'), state, record, lib)
   end subroutine press

   !> Contact options with a solver.
   function by(solver) result(options)
      character(len=*), intent(in) :: solver
      type(contact_options_t) :: options
      options%solver = solver
      options%tolerance = solver_tolerance
   end function by

   !> Half-sine impact on the modes.
   pure function impact(amplitude) result(excitation)
      real(wp), intent(in) :: amplitude
      type(excitation_t) :: excitation
      excitation = excitation_t(load=impact_load, kind=kind_half_sine, amplitude=amplitude, duration=pulse)
   end function impact

   !> Largest number of open, sticking and slipping points seen.
   pure function most_seen(history) result(counts)
      type(history_t), intent(in) :: history
      integer :: counts(3), k
      counts = 0
      do k = 1, size(history%samples)
         counts = max(counts, history%samples(k)%counts)
      end do
   end function most_seen

   !> Largest difference of two histories of modal coordinates over the largest motion.
   pure real(wp) function difference(one, other)
      real(wp), intent(in) :: one(:, :), other(:, :)
      difference = maxval(abs(one - other))/maxval(abs(other - spread(other(:, 1), 2, size(other, 2))))
   end function difference

   !> Open joint, one mode of the structure: d = d_0 cos(omega_h t) with sin(omega_h dt/2) = omega dt/2 to the last
   !> digits, and so the error against cos(omega t) is of second order.
   subroutine test_free_oscillation(error)
      type(testing_error), allocatable, intent(out) :: error
      type(error_t), allocatable :: lib
      type(reduced_model_t) :: reduced
      type(jointed_system_t) :: system
      type(operating_state_t) :: state
      type(history_t) :: history
      type(transient_record_t) :: record
      real(wp), allocatable :: vectors(:, :), lambda(:), modal(:, :), exact(:, :)
      real(wp) :: dt, omega, omega_h, deviation(3)
      integer :: k, level
      integer, parameter :: mode = 3, steps = 400
      !> The phase of the recursion drifts by rounding at most like steps^2.
      real(wp), parameter :: rounding = steps**2*16*epsilon(1.0_wp)

      call make_joint(5, 3, 0.0_wp, reduced, system, lib)
      if (.not. allocated(lib)) call system%restrict(spread(.true., 1, system%grid_point_count()), lib)
      if (.not. allocated(lib)) then
         vectors = system%stiffness
         allocate (lambda(system%n_modes))
         call eigen_symmetric(vectors, lambda, lib)
      end if
      call good(error, lib)
      if (allocated(error)) return
      system%damping = 0.0_wp
      system%problem%r_0(1::3) = 1.0_wp
      state%modal = 1.0e-3_wp*vectors(:, mode)
      allocate (state%amplitude(system%n_loads), source=0.0_wp)
      state%contact = new_state(system%problem)
      omega = sqrt(lambda(mode))
      do level = 1, 3
         dt = safety/system%highest_angular_frequency()/2**(level - 1)
         omega_h = 2.0_wp*asin(0.5_wp*omega*dt)/dt
         call integrate(system, state, dt, steps/4*2**(level - 1), [excitation_t ::], by('condensed'), history, record, lib)
         call good(error, lib)
         if (allocated(error)) return
         call check(error, all(most_seen(history) == [system%problem%n_points, 0, 0]), 'the joint did not stay open')
         if (allocated(error)) return
         modal = history%modal()
         exact = matmul(reshape(state%modal, [system%n_modes, 1]), &
            & reshape([(cos(omega_h*history%samples(k)%time), k=1, size(history%samples))], [1, size(history%samples)]))
         call check(error, maxval(abs(modal - exact)) <= rounding*maxval(abs(exact)), 'not the leapfrog solution')
         if (allocated(error)) return
         k = size(history%samples)
         deviation(level) = norm2(modal(:, k) - state%modal*cos(omega*history%samples(k)%time))
      end do
      ! The leapfrog is too fast by (omega dt)^2/24; halving dt leaves a quarter.
      call check(error, all(abs(deviation(:2)/deviation(2:) - 4.0_wp) < 0.2_wp), &
         & 'not second order: '//to_text(deviation(1)/deviation(2), 4)//' '//to_text(deviation(2)/deviation(3), 4))
   end subroutine test_free_oscillation

   !> All points stuck, no damping: the books close over 100 000 steps.
   subroutine test_conservation(error)
      type(testing_error), allocatable, intent(out) :: error
      type(error_t), allocatable :: lib
      type(jointed_system_t) :: system
      type(operating_state_t) :: state
      type(history_t) :: history
      type(transient_record_t) :: record
      integer :: n
      integer, parameter :: steps = 100000
      real(wp), parameter :: conservation = 1.0e-10_wp

      call make_preloaded([3, 2], 0.0_wp, sticky, .false., system, state, lib)
      if (.not. allocated(lib)) call integrate(system, state, safety/system%highest_angular_frequency(), steps, &
         & [impact(light)], by('condensed'), history, record, lib, stride=100)
      call good(error, lib)
      if (allocated(error)) return
      n = size(history%samples)
      call check(error, all(most_seen(history) == [0, system%problem%n_points, 0]), 'not all points stuck')
      if (allocated(error)) return
      call check(error, record%steps == steps .and. history%steps == steps .and. n == steps/100 + 1, &
         & 'steps are missing')
      if (allocated(error)) return
      associate (e => history%samples(n)%energy)
         call check(error, abs(e%kinetic + e%elastic - e%external_work) <= conservation*e%external_work, &
            & 'energy is not conserved')
      end associate
      if (allocated(error)) return
      call check(error, record%balance_error <= conservation, 'balance error '//to_text(record%balance_error, 3))
   end subroutine test_conservation

   !> All points stuck, mass-proportional damping, one linear mode excited. The leapfrog with centred damping has
   !> y_k = r^k cos(...), r^2 = (1 - b)/(1 + b), b = beta dt/2, and so y_k^2 - y_{k-1} y_{k+1} falls as r^(2k).
   subroutine test_damping(error)
      type(testing_error), allocatable, intent(out) :: error
      type(error_t), allocatable :: lib
      type(jointed_system_t) :: system
      type(operating_state_t) :: state
      type(linear_modes_t) :: modes
      type(history_t) :: history
      type(transient_record_t) :: record
      real(wp), allocatable :: y(:), rest(:, :)
      real(wp) :: dt, omega, measured, b
      integer :: first, last
      integer, parameter :: steps = 2000, mode = 2
      real(wp), parameter :: ratio = 0.01_wp, rounding = 1.0e-9_wp

      call make_preloaded([5, 3], 0.0_wp, sticky, .false., system, state, lib)
      if (.not. allocated(lib)) call solve_linear_modes(system, state%contact%status, mode, modes, lib)
      call good(error, lib)
      if (allocated(error)) return
      omega = 2.0_wp*pi*modes%frequency(mode)
      system%damping = 2.0_wp*ratio*omega
      call system%add_modal_load(modes%shape(:, mode))
      state%amplitude = [state%amplitude, 0.0_wp]
      state%contact%q = [state%modal, state%amplitude]
      dt = safety/system%highest_angular_frequency()
      call integrate(system, state, dt, steps, [excitation_t(load=4, kind=kind_half_sine, amplitude=300.0_wp, &
         & duration=pulse)], by('condensed'), history, record, lib)
      call good(error, lib)
      if (allocated(error)) return
      call check(error, all(most_seen(history) == [0, system%problem%n_points, 0]), 'not all points stuck')
      if (allocated(error)) return
      rest = history%modal() - spread(state%modal, 2, steps + 1)
      y = matmul(modes%shape(:, mode), rest)
      rest = rest - spread(modes%shape(:, mode), 2, steps + 1)*spread(y, 1, system%n_modes)
      call check(error, maxval(abs(rest)) <= rounding*maxval(abs(y)), 'other modes move')
      if (allocated(error)) return
      first = ceiling(pulse/dt) + 2
      last = steps
      measured = log((y(first)**2 - y(first - 1)*y(first + 1))/(y(last)**2 - y(last - 1)*y(last + 1))) &
         & /(2.0_wp*(last - first)*dt*omega)
      b = ratio*omega*dt
      call check(error, abs(measured*omega*dt - 0.5_wp*log((1.0_wp + b)/(1.0_wp - b))) <= rounding*b, &
         & 'not the decay of the leapfrog')
      if (allocated(error)) return
      ! atanh(b) = b (1 + b^2/3 + ...)
      call check(error, abs(measured - ratio) <= ratio*b**2/2.0_wp, 'damping ratio '//to_text(measured))
      if (allocated(error)) return
      call check(error, record%balance_error <= rounding, 'balance error '//to_text(record%balance_error, 3))
   end subroutine test_damping

   !> Sensor histories with slipping points against a fine reference: halving dt leaves about a quarter of the error.
   subroutine test_order(error)
      type(testing_error), allocatable, intent(out) :: error
      type(error_t), allocatable :: lib
      type(jointed_system_t) :: system
      type(operating_state_t) :: state
      type(history_t) :: fine, history
      type(transient_record_t) :: record
      real(wp), allocatable :: reference(:, :)
      type(excitation_t) :: blow
      real(wp) :: deviation(3), order(2)
      integer :: level
      integer, parameter :: steps = 200, finest = 32

      call make_preloaded([6, 4], hill, 0.6_wp, .true., system, state, lib)
      call good(error, lib)
      if (allocated(error)) return
      associate (dt => safety/system%highest_angular_frequency())
         ! The kinks of the pulse lie on steps, at every dt.
         blow = impact(light)
         blow%duration = 12*dt
         call integrate(system, state, dt/finest, steps*finest, [blow], by('condensed'), fine, record, lib, stride=finest)
         call good(error, lib)
         if (allocated(error)) return
         associate (counts => most_seen(fine))
            call check(error, counts(3) >= 10, 'too few points slip')
         end associate
         if (allocated(error)) return
         reference = fine%modal()
         do level = 1, 3
            call integrate(system, state, dt/2**(level - 1), steps*2**(level - 1), [blow], by('condensed'), history, record, &
               & lib, stride=2**(level - 1))
            call good(error, lib)
            if (allocated(error)) return
            deviation(level) = difference(history%modal(), reference)
         end do
      end associate
      order = log(deviation(:2)/deviation(2:))/log(2.0_wp)
      call check(error, all(abs(order - 2.0_wp) < 0.3_wp), 'order '//to_text(order(1), 3)//', '//to_text(order(2), 3))
   end subroutine test_order

   !> Books with friction: the balance error is small at the paper's time step and falls with dt^2, no step gains.
   subroutine test_energy(error)
      type(testing_error), allocatable, intent(out) :: error
      type(error_t), allocatable :: lib
      type(jointed_system_t) :: system
      type(operating_state_t) :: state
      type(history_t) :: history
      type(transient_record_t) :: record
      real(wp) :: balance(3), gain, loss
      integer :: level, k, amplitude
      integer, parameter :: steps = 200
      real(wp), parameter :: allowed = 3.0e-3_wp

      call make_preloaded([8, 5], hill, 0.6_wp, .true., system, state, lib)
      call good(error, lib)
      if (allocated(error)) return
      do amplitude = 1, 2
         do level = 1, 3
            call integrate(system, state, safety/system%highest_angular_frequency()/2**(level - 1), steps*2**(level - 1), &
               & [impact(merge(light, heavy, amplitude == 1))], by('condensed'), history, record, lib)
            call good(error, lib)
            if (allocated(error)) return
            call check(error, record%unconverged == 0, 'steps did not converge')
            if (allocated(error)) return
            balance(level) = record%balance_error
            gain = 0.0_wp
            do k = 2, size(history%samples)
               gain = min(gain, history%samples(k)%energy%friction_loss - history%samples(k - 1)%energy%friction_loss)
            end do
            loss = history%samples(size(history%samples))%energy%friction_loss
            call check(error, loss > 0.0_wp .and. gain >= -1.0e-9_wp*loss, 'friction gives energy')
            if (allocated(error)) return
         end do
         call check(error, balance(1) < allowed, 'balance error '//to_text(balance(1), 3))
         if (allocated(error)) return
         ! A quarter, were it not for points that open and close.
         call check(error, all(balance(2:) < balance(:2)/2.5_wp), 'the balance error is not of second order: '// &
            & to_text(balance(1), 3)//' '//to_text(balance(2), 3)//' '//to_text(balance(3), 3))
         if (allocated(error)) return
      end do
   end subroutine test_energy

   !> Gross slip, lift-off, re-closing: three solvers, one history and one friction loss.
   subroutine test_solvers(error)
      type(testing_error), allocatable, intent(out) :: error
      type(error_t), allocatable :: lib
      type(jointed_system_t) :: system
      type(operating_state_t) :: state
      type(history_t) :: one, other
      type(transient_record_t) :: record
      integer :: k, seen(3), n, closed
      integer, parameter :: steps = 100
      character(len=*), parameter :: solvers(2) = [character(len=17) :: 'jacobi', 'jacobi_eliminated']

      call make_preloaded([6, 4], hill, 0.6_wp, .true., system, state, lib)
      call good(error, lib)
      if (allocated(error)) return
      associate (dt => safety/system%highest_angular_frequency())
         call integrate(system, state, dt, steps, [impact(heavy)], by('condensed'), one, record, lib)
         call good(error, lib)
         if (allocated(error)) return
         n = system%problem%n_points
         closed = count(state%contact%status > 0)
         seen = most_seen(one)
         ! Points that were open close, and at some time none sticks.
         call check(error, n - minval([(one%samples(k)%counts(1), k=1, steps)]) > closed .and. seen(1) >= n - closed &
            & .and. minval([(one%samples(k)%counts(2), k=1, steps)]) == 0 .and. record%set_changes > 0, &
            & 'not the scene that was meant')
         if (allocated(error)) return
         do k = 1, size(solvers)
            call integrate(system, state, dt, steps, [impact(heavy)], by(trim(solvers(k))), other, record, lib)
            call good(error, lib)
            if (allocated(error)) return
            call check(error, record%unconverged == 0, trim(solvers(k))//': not converged')
            if (allocated(error)) return
            call check(error, difference(one%modal(), other%modal()) < steps*solver_tolerance, &
               & trim(solvers(k))//': another motion')
            if (allocated(error)) return
            call check(error, abs(one%samples(steps + 1)%energy%friction_loss/other%samples(steps + 1)%energy%friction_loss &
               & - 1.0_wp) < steps*solver_tolerance, trim(solvers(k))//': another friction loss')
            if (allocated(error)) return
         end do
      end associate
   end subroutine test_solvers

   !> The paper's normal law: other books at closing, nearly the same motion.
   subroutine test_velocity_level(error)
      type(testing_error), allocatable, intent(out) :: error
      type(error_t), allocatable :: lib
      type(jointed_system_t) :: system
      type(operating_state_t) :: state
      type(history_t) :: gap_level, velocity_level
      type(transient_record_t) :: record
      type(contact_options_t) :: contact
      integer, parameter :: steps = 200
      !> METHOD section 5, item 2: 3e-4 in general, 7e-3 at gross slip.
      real(wp), parameter :: close = 3.0e-4_wp

      call make_preloaded([6, 4], hill, 0.6_wp, .true., system, state, lib)
      call good(error, lib)
      if (allocated(error)) return
      contact = by('condensed')
      associate (dt => safety/system%highest_angular_frequency())
         call integrate(system, state, dt, steps, [impact(heavy)], contact, gap_level, record, lib)
         contact%velocity_level = .true.
         if (.not. allocated(lib)) call integrate(system, state, dt, steps, [impact(heavy)], contact, velocity_level, &
            & record, lib)
      end associate
      call good(error, lib)
      if (allocated(error)) return
      call check(error, record%unconverged == 0, 'not converged')
      if (allocated(error)) return
      associate (apart => difference(velocity_level%modal(), gap_level%modal()))
         call check(error, apart > solver_tolerance .and. apart < close, 'difference '//to_text(apart, 3))
      end associate
   end subroutine test_velocity_level

   !> omega_max dt >= 2 is refused, with the limit in the message; just below the run stays finite.
   subroutine test_time_step_limit(error)
      type(testing_error), allocatable, intent(out) :: error
      type(error_t), allocatable :: lib
      type(jointed_system_t) :: system
      type(operating_state_t) :: state
      type(history_t) :: history
      type(transient_record_t) :: record
      real(wp) :: limit

      call make_preloaded([5, 3], 0.0_wp, sticky, .true., system, state, lib)
      call good(error, lib)
      if (allocated(error)) return
      limit = 2.0_wp/system%highest_angular_frequency()
      call integrate(system, state, 1.001_wp*limit, 10, [impact(light)], by('condensed'), history, record, lib)
      call check(error, allocated(lib), 'a time step past the limit was taken')
      if (allocated(error)) return
      call check(error, lib%status == status_failed .and. index(lib%message, to_text(limit)) > 0, lib%message)
      if (allocated(error)) return
      call check(error, size(history%samples) == 0, 'samples of a run that was refused')
      if (allocated(error)) return
      call integrate(system, state, 0.5_wp*limit, huge(1), [impact(light)], by('condensed'), history, record, lib)
      call check(error, allocated(lib), 'more steps than can be counted were begun')
      if (allocated(error)) return
      call check(error, index(lib%message, 'time steps of') > 0, lib%message)
      if (allocated(error)) return
      call integrate(system, state, 0.999_wp*limit, 2000, [impact(light)], by('condensed'), history, record, lib)
      call good(error, lib)
      if (allocated(error)) return
      call check(error, maxval(abs(history%sensor())) < 1.0e-2_wp, 'unstable below the limit')
   end subroutine test_time_step_limit

   !> Start from the points that the preload closes: those that close later join. Checked every step, the history is
   !> that of all points; checked less often, a point that closes only between two checks is missed, with little effect.
   subroutine test_left_out(error)
      type(testing_error), allocatable, intent(out) :: error
      type(error_t), allocatable :: lib
      type(jointed_system_t) :: system, few
      type(operating_state_t) :: state, few_state
      type(history_t) :: full, grown
      type(transient_record_t) :: record
      integer :: k, most_joining
      integer, parameter :: steps = 150, stride(2) = [1, 25]
      ! Checks where the motion turns find the points in time, whatever the stride.
      real(wp), parameter :: allowed = steps*solver_tolerance

      call make_preloaded([8, 5], hill, 0.6_wp, .true., system, state, lib)
      if (.not. allocated(lib)) then
         few = system
         call few%restrict(state%contact%status > 0, lib)
      end if
      if (.not. allocated(lib)) call press(few, 1.0_wp, few_state, lib)
      call good(error, lib)
      if (allocated(error)) return
      most_joining = system%problem%n_points - few%problem%n_points
      call check(error, most_joining > 0, 'nothing was left out')
      if (allocated(error)) return
      associate (dt => safety/system%highest_angular_frequency())
         call integrate(system, state, dt, steps, [impact(medium)], by('condensed'), full, record, lib)
         do k = 1, size(stride)
            if (.not. allocated(lib)) call integrate(few, few_state, dt, steps, [impact(medium)], by('condensed'), grown, &
               & record, lib, verify_stride=stride(k))
            call good(error, lib)
            if (allocated(error)) return
            call check(error, record%points_added > 0 .and. record%points_added < most_joining, 'no point joined, or all')
            if (allocated(error)) return
            call check(error, record%steps == steps .and. size(grown%samples) == steps + 1, 'samples missing or doubled')
            if (allocated(error)) return
            associate (apart => difference(grown%modal(), full%modal()))
               call check(error, apart < allowed, 'another history, '//to_text(apart, 3))
            end associate
            if (allocated(error)) return
         end do
      end associate
   end subroutine test_left_out

   !> The same run twice is the same to the last bit; with two threads it is the same to rounding.
   subroutine test_threads(error)
      use omp_lib, only: omp_get_max_threads, omp_set_num_threads
      type(testing_error), allocatable, intent(out) :: error
      interface
         subroutine openblas_set_num_threads(n) bind(c)
            use, intrinsic :: iso_c_binding, only: c_int
            implicit none
            integer(c_int), value :: n
         end subroutine openblas_set_num_threads
      end interface
      type(history_t) :: first, again, two
      type(error_t), allocatable :: lib
      integer :: threads
      integer, parameter :: steps = 15

      threads = omp_get_max_threads()
      call omp_set_num_threads(1)
      call openblas_set_num_threads(1)
      call run(first)
      if (.not. allocated(lib)) call run(again)
      call omp_set_num_threads(2)
      call openblas_set_num_threads(2)
      if (.not. allocated(lib)) call run(two)
      call omp_set_num_threads(threads)
      call openblas_set_num_threads(threads)
      call good(error, lib)
      if (allocated(error)) return
      call check(error, all(first%modal() == again%modal()) .and. all(first%sensor() == again%sensor()), &
         & 'the run does not repeat')
      if (allocated(error)) return
      call check(error, difference(two%modal(), first%modal()) < steps*solver_tolerance, 'depends on the threads')

   contains

      !> Everything from the set-up on.
      subroutine run(history)
         type(history_t), intent(out) :: history
         type(jointed_system_t) :: system
         type(operating_state_t) :: state
         type(transient_record_t) :: record

         call make_preloaded([6, 4], hill, 0.6_wp, .true., system, state, lib)
         if (.not. allocated(lib)) call integrate(system, state, safety/system%highest_angular_frequency(), steps, &
            & [impact(heavy)], by('condensed'), history, record, lib)
      end subroutine run

   end subroutine test_threads

   !> A load that acts on the boundary coordinates and changes with time does work that the books account for:
   !> exactly where all points stick, with the error of friction where they slip.
   subroutine test_boundary_load(error)
      type(testing_error), allocatable, intent(out) :: error
      type(error_t), allocatable :: lib
      type(reduced_model_t) :: reduced
      type(jointed_system_t) :: made, system
      type(operating_state_t) :: state
      type(history_t) :: history
      type(transient_record_t) :: record
      type(excitation_t) :: shake
      integer :: k, n
      integer, parameter :: steps = 400

      shake = excitation_t(load=impact_load, kind=kind_harmonic, frequency=300.0_wp, phase=-0.5_wp*pi)
      do k = 1, 2
         call make_joint(5, 3, merge(0.0_wp, hill, k == 1), reduced, made, lib)
         ! The third load shears the first pad at its nodes, and nothing else.
         n = size(reduced%pattern_b, 1)/2
         reduced%pattern_i(:, impact_load) = 0.0_wp
         reduced%pattern_b(2:n:3, impact_load) = 3.0_wp/n
         made%pads%friction = merge(sticky, 0.6_wp, k == 1)
         if (.not. allocated(lib)) call new_system(reduced, made%pads, made%n_loads, made%damping, system, lib)
         if (.not. allocated(lib)) call system%restrict(spread(.true., 1, system%grid_point_count()), lib)
         if (.not. allocated(lib)) call press(system, 1.0_wp, state, lib)
         shake%amplitude = merge(800.0_wp, 3000.0_wp, k == 1)
         if (.not. allocated(lib)) call integrate(system, state, safety/system%highest_angular_frequency(), steps, [shake], &
            & by('condensed'), history, record, lib)
         call good(error, lib)
         if (allocated(error)) return
         associate (e => history%samples(steps + 1)%energy, seen => most_seen(history))
            call check(error, (k == 1) .eqv. (seen(2) == system%problem%n_points .and. seen(3) == 0), &
               & 'not the scene that was meant')
            if (allocated(error)) return
            call check(error, abs(e%external_work) > 0.1_wp*e%kinetic, 'the load does no work')
            if (allocated(error)) return
            ! The load is slow: most of its work is stored, not kinetic.
            call check(error, abs(e%balance_error) < merge(1.0e-10_wp, 3.0e-3_wp, k == 1)*abs(e%external_work), &
               & 'balance error '//to_text(e%balance_error/e%external_work, 3))
            if (allocated(error)) return
         end associate
      end do
   end subroutine test_boundary_load

   !> The same physical system written in units 1/L m, 1/M kg, 1/T s: the numbers scale.
   subroutine test_units(error)
      type(testing_error), allocatable, intent(out) :: error
      type(error_t), allocatable :: lib
      type(reduced_model_t) :: reduced
      type(jointed_system_t) :: si, other
      type(operating_state_t) :: si_state, other_state
      type(history_t) :: si_history, other_history
      type(transient_record_t) :: record
      type(excitation_t) :: blow
      real(wp) :: dt
      integer :: k, n
      integer, parameter :: steps = 150
      !> mm, t, ms: a newton is the number F.
      real(wp), parameter :: L = 1.0e3_wp, M = 1.0e-3_wp, T = 1.0e3_wp, F = M*L/T**2
      real(wp), parameter :: scaling = 1.0e-10_wp

      call make_joint(6, 4, hill, reduced, si, lib)
      if (.not. allocated(lib)) call rescaled(reduced, si, other, lib)
      if (.not. allocated(lib)) call si%restrict(spread(.true., 1, si%grid_point_count()), lib)
      if (.not. allocated(lib)) call other%restrict(spread(.true., 1, si%grid_point_count()), lib)
      if (.not. allocated(lib)) call press(si, 1.0_wp, si_state, lib)
      if (.not. allocated(lib)) call press(other, 1.0_wp/F, other_state, lib)
      call good(error, lib)
      if (allocated(error)) return
      dt = safety/si%highest_angular_frequency()
      call check(error, abs(si%highest_angular_frequency()/T/other%highest_angular_frequency() - 1.0_wp) < scaling, &
         & 'highest frequency')
      if (allocated(error)) return
      blow = impact(heavy)
      call integrate(si, si_state, dt, steps, [blow], by('condensed'), si_history, record, lib)
      blow%amplitude = blow%amplitude*F
      blow%duration = blow%duration*T
      if (.not. allocated(lib)) call integrate(other, other_state, dt*T, steps, [blow], by('condensed'), other_history, &
         & record, lib)
      call good(error, lib)
      if (allocated(error)) return
      call check(error, difference(other_history%modal()/(L*sqrt(M)), si_history%modal()) < scaling, 'modal coordinates')
      if (allocated(error)) return
      call check(error, difference(other_history%sensor()/L, si_history%sensor()) < scaling, 'sensors')
      if (allocated(error)) return
      n = steps + 1
      call check(error, abs(other_history%samples(n)%energy%friction_loss/(F*L)/si_history%samples(n)%energy%friction_loss &
         & - 1.0_wp) < scaling, 'friction loss')
      if (allocated(error)) return
      call check(error, all([(all(si_history%samples(k)%counts == other_history%samples(k)%counts), k=1, n)]), &
         & 'contact states')

   contains

      !> The system with all lengths, forces, ... written in the other units.
      subroutine rescaled(reduced, system, scaled, lib)
         type(reduced_model_t), intent(in) :: reduced
         type(jointed_system_t), intent(in) :: system
         type(jointed_system_t), intent(out) :: scaled
         type(error_t), allocatable, intent(out) :: lib
         type(reduced_model_t) :: model
         type(pad_t), allocatable :: pads(:)
         integer :: p

         model = reduced
         model%frequency = model%frequency/T
         model%K_ii = model%K_ii/T**2
         model%K_bi = model%K_bi*F/(L*sqrt(M))
         model%K_bb = model%K_bb*F/L
         ! Load patterns are per newton, sensor rows plain numbers; both are per sqrt(kg) on the modes.
         model%pattern_i = model%pattern_i/sqrt(M)
         pads = system%pads
         do p = 1, size(pads)
            pads(p)%height = pads(p)%height*L
            pads(p)%compliance%table = pads(p)%compliance%table*L/F
            call new_convolution(pads(p)%convolution, pads(p)%compliance)
         end do
         call new_system(model, pads, system%n_loads, system%damping/T, scaled, lib)
      end subroutine rescaled

   end subroutine test_units

end module test_analysis_transient
