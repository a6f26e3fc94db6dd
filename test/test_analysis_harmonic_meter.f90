!> Tests of the harmonics that are found while stepping, and of the time integration under sines: with all points stuck
!> the structure is linear, and the leapfrog's response to e^(i omega t) is known to the last digits,
!>     -(2 sin(omega dt/2)/dt)^2 + i D sin(omega dt)/dt + K  in place of  -omega^2 + i omega D + K.
module test_analysis_harmonic_meter
   use microslip_analysis_excitation, only: excitation_t, kind_half_sine, kind_stepped_sine, kind_swept_sine, kind_table
   use microslip_analysis_harmonic_meter, only: harmonic_meter_t, harmonic_window_t
   use microslip_analysis_linear_modes, only: linear_modes_t, solve_linear_modes
   use microslip_analysis_operating_state, only: operating_state_t
   use microslip_analysis_preload, only: preload_options_t, preload_record_t, run_preload
   use microslip_analysis_transient, only: transient_record_t
   use microslip_contact_factory, only: contact_options_t
   use microslip_core_error, only: error_t
   use microslip_core_kinds, only: wp, pi
   use microslip_core_text, only: to_text
   use microslip_fe_reduced_model, only: reduced_model_t
   use microslip_system_jointed_system, only: jointed_system_t
   use support_checks, only: good
   use support_history, only: history_t, integrate
   use support_joint, only: make_joint
   use testdrive, only: check, new_unittest, testing_error => error_type, unittest_type
   implicit none(type, external)
   private

   public :: collect_analysis_harmonic_meter

   !> Of the fits, relative.
   real(wp), parameter :: rounding = 1.0e-9_wp
   !> Mass-proportional damping, 1/s: transients are gone soon; friction that never lets go; omega_max dt.
   real(wp), parameter :: beta = 200.0_wp, sticky = 1.0e3_wp, safety = 0.74_wp
   integer, parameter :: impact_load = 3

contains

   subroutine collect_analysis_harmonic_meter(testsuite)
      type(unittest_type), allocatable, intent(out) :: testsuite(:)

      testsuite = [ &
         & new_unittest('a made-up motion is found to rounding', test_made_up), &
         & new_unittest('whole steps in a window: the Fourier transform of the samples', test_fourier), &
         & new_unittest('too few time steps for the harmonics', test_too_few), &
         & new_unittest('stepped sine: response of the linear structure', test_stepped), &
         & new_unittest('stepped sine: goes on when the motion is steady', test_steady), &
         & new_unittest('swept sine: response of the linear structure', test_swept), &
         & new_unittest('friction: harmonics of the samples, whatever joins', test_friction), &
         & new_unittest('a half-sine from a table', test_table)]
   end subroutine collect_analysis_harmonic_meter

   !> A stepped sine and its meter: `windows` windows of 4 periods behind `settling` periods.
   pure subroutine stepped(frequencies, settling, windows, sine, meter)
      real(wp), intent(in) :: frequencies(:)
      integer, intent(in) :: settling, windows
      type(excitation_t), intent(out) :: sine
      type(harmonic_meter_t), intent(out) :: meter

      sine = excitation_t(load=impact_load, kind=kind_stepped_sine, amplitude=100.0_wp, phase=0.3_wp, &
         & frequencies=frequencies, periods=spread(settling + 4*windows, 1, size(frequencies)))
      meter = harmonic_meter_t(excitation=1, harmonics=3, window=4, settling=settling, most_windows=windows)
   end subroutine stepped

   !> Two sensors, three harmonics, two frequencies, no whole number of steps.
   subroutine test_made_up(error)
      type(testing_error), allocatable, intent(out) :: error
      type(error_t), allocatable :: lib
      type(excitation_t) :: sine
      type(harmonic_meter_t) :: meter
      real(wp), parameter :: dt = 1.234e-3_wp, size_of(0:3) = [-2.0_wp, 1.0_wp, 0.1_wp, 0.01_wp], &
         & lag(0:3) = [0.0_wp, -1.0_wp, 0.7_wp, 2.9_wp]
      real(wp) :: time, theta, u
      integer :: k, h

      call stepped([20.0_wp, 31.0_wp], 1, 2, sine, meter)
      call meter%start(sine, dt, 2, lib)
      call good(error, lib)
      if (allocated(error)) return
      do k = 0, int(sine%end()/dt)
         time = k*dt
         theta = sine%angle(time)
         u = sum(size_of*cos([(h*theta, h=0, 3)] + lag))
         call meter%observe(sine, time, dt, [u, -2.0_wp*u])
      end do
      call check(error, size(meter%done), 4)
      if (allocated(error)) return
      do k = 1, 4
         associate (window => meter%done(k))
            call check(error, maxval(abs(window%amplitude(1, :) - [size_of])) < rounding .and. &
               & maxval(abs(window%phase(1, :) - lag)) < rounding/size_of(3) .and. &
               & maxval(abs(window%amplitude(2, 2:) - 2.0_wp*size_of(1:))) < rounding, 'window '//to_text(k))
            if (.not. allocated(error)) call check(error, window%step == (k + 1)/2 .and. &
               & abs(window%frequency - merge(20.0_wp, 31.0_wp, k < 3)) < rounding .and. &
               & (window%change < 0.0_wp .eqv. mod(k, 2) == 1), 'frequency of window '//to_text(k))
         end associate
         if (allocated(error)) return
      end do
   end subroutine test_made_up

   !> Any samples: with 32 steps of a period the fit is the Hann-weighted Fourier sum.
   subroutine test_fourier(error)
      type(testing_error), allocatable, intent(out) :: error
      type(error_t), allocatable :: lib
      type(excitation_t) :: sine
      type(harmonic_meter_t) :: meter
      real(wp), parameter :: dt = 1.0_wp/(32.0_wp*50.0_wp)
      real(wp) :: u(0:159), w
      complex(wp) :: sums(0:3)
      integer :: k, h

      call stepped([50.0_wp], 1, 1, sine, meter)
      sine%phase = 0.0_wp
      call meter%start(sine, dt, 1, lib)
      call good(error, lib)
      if (allocated(error)) return
      sums = 0.0_wp
      do k = 0, 159
         u(k) = exp(-0.02_wp*k)*sin(0.35_wp*k) + merge(1.0_wp, 0.0_wp, mod(k, 7) == 3)
         call meter%observe(sine, k*dt, dt, [u(k)])
         if (k < 32) cycle
         w = sin(pi*(k - 32)/128.0_wp)**2/64.0_wp
         sums = sums + [(w*merge(2.0_wp, 1.0_wp, h > 0)*u(k)*exp(cmplx(0.0_wp, -2.0_wp*pi*h*k/32.0_wp, wp)), h=0, 3)]
      end do
      call check(error, size(meter%done), 1)
      if (allocated(error)) return
      associate (window => meter%done(1))
         call check(error, maxval(abs(window%amplitude(1, 2:)*exp(cmplx(0.0_wp, window%phase(1, 2:), wp)) - sums(1:))) &
            & < rounding .and. abs(window%amplitude(1, 1) - real(sums(0))) < rounding)
      end associate
   end subroutine test_fourier

   subroutine test_too_few(error)
      type(testing_error), allocatable, intent(out) :: error
      type(error_t), allocatable :: lib
      type(excitation_t) :: sine
      type(harmonic_meter_t) :: meter

      call stepped([50.0_wp, 100.0_wp], 1, 1, sine, meter)
      call meter%start(sine, 1.0_wp/(7.5_wp*100.0_wp), 1, lib)
      call check(error, allocated(lib))
      if (.not. allocated(error)) call check(error, index(lib%message, '8 are needed') > 0, lib%message)
   end subroutine test_too_few

   !> Contact solver by default.
   function solver() result(options)
      type(contact_options_t) :: options
      options%solver = 'condensed'
   end function solver

   !> A preloaded joint and its modes.
   subroutine make_preloaded(friction, system, state, modes, lib)
      real(wp), intent(in) :: friction
      type(jointed_system_t), intent(out) :: system
      type(operating_state_t), intent(out) :: state
      type(linear_modes_t), intent(out) :: modes
      type(error_t), allocatable, intent(out) :: lib
      type(reduced_model_t) :: reduced
      type(preload_options_t) :: options
      type(preload_record_t) :: record

      call make_joint(3, 2, 0.0_wp, reduced, system, lib)
      if (allocated(lib)) return
      system%pads%friction = friction
      system%damping = beta
      call system%restrict(spread(.true., 1, system%grid_point_count()), lib)
      options%loads = [1, 2]
      options%interface_force = [2210.0_wp, 2210.0_wp]
      if (.not. allocated(lib)) call run_preload(system, options, solver(), state, record, lib)
      if (.not. allocated(lib)) call solve_linear_modes(system, state%contact%status, system%n_modes, modes, lib)
   end subroutine make_preloaded

   !> Response of the sensors to the unit load at a frequency, by the leapfrog with this time step.
   pure function response(system, modes, frequency, dt) result(u)
      type(jointed_system_t), intent(in) :: system
      type(linear_modes_t), intent(in) :: modes
      real(wp), intent(in) :: frequency, dt
      complex(wp) :: u(size(system%sensor_modal, 2)), q
      real(wp) :: omega
      integer :: k

      omega = 2.0_wp*pi*frequency
      u = 0.0_wp
      do k = 1, size(modes%frequency)
         q = (2.0_wp*pi*modes%frequency(k))**2 - (2.0_wp*sin(0.5_wp*omega*dt)/dt)**2 &
            & + cmplx(0.0_wp, beta*sin(omega*dt)/dt, wp)
         q = dot_product(modes%shape(:, k), system%load_modal(:, impact_load))/q
         u = u + q*sensors_of_mode(system, modes, k)
      end do
   end function response

   !> Displacement of the sensors in a mode with all points stuck; here they sit on the modes alone.
   pure function sensors_of_mode(system, modes, k) result(u)
      type(jointed_system_t), intent(in) :: system
      type(linear_modes_t), intent(in) :: modes
      integer, intent(in) :: k
      real(wp) :: u(size(system%sensor_modal, 2))
      u = matmul(modes%shape(:, k), system%sensor_modal)
   end function sensors_of_mode

   !> First harmonic of a window over the load.
   pure function first_harmonic(window, amplitude) result(u)
      type(harmonic_window_t), intent(in) :: window
      real(wp), intent(in) :: amplitude
      complex(wp) :: u(size(window%amplitude, 1))
      u = window%amplitude(:, 2)/amplitude*exp(cmplx(0.0_wp, window%phase(:, 2), wp))
   end function first_harmonic

   !> e^(-beta t/2) after 40 periods of 220 Hz is 1e-8.
   subroutine test_stepped(error)
      type(testing_error), allocatable, intent(out) :: error
      type(error_t), allocatable :: lib
      type(jointed_system_t) :: system
      type(operating_state_t) :: state
      type(linear_modes_t) :: modes
      type(excitation_t) :: sine
      type(harmonic_meter_t) :: meter
      type(history_t) :: history
      type(transient_record_t) :: record
      complex(wp) :: exact(2)
      real(wp) :: dt, difference
      integer :: k
      real(wp), parameter :: transient_left = 1.0e-6_wp

      call make_preloaded(sticky, system, state, modes, lib)
      call good(error, lib)
      if (allocated(error)) return
      dt = safety/system%highest_angular_frequency()
      call stepped(modes%frequency(1)*[0.9_wp, 1.0_wp, 1.15_wp], 40, 1, sine, meter)
      call integrate(system, state, dt, 0, [sine], solver(), history, record, lib, stride=100, meter=meter)
      call good(error, lib)
      if (allocated(error)) return
      call check(error, size(history%windows) == 3 .and. record%steps == ceiling(sine%end()/dt), 'windows')
      do k = 1, size(history%windows)
         exact = response(system, modes, history%windows(k)%frequency, dt)
         difference = maxval(abs(first_harmonic(history%windows(k), sine%amplitude) - exact))/maxval(abs(exact))
         if (.not. allocated(error)) call check(error, difference < transient_left, to_text(difference, 2))
         ! Nothing but the first harmonic, and the static displacement.
         if (.not. allocated(error)) call check(error, maxval(history%windows(k)%amplitude(:, 3:)) < &
            & transient_left*maxval(history%windows(k)%amplitude(:, 2)), 'higher harmonics')
      end do
   end subroutine test_stepped

   !> As in the test before, but left early; without a steady state all windows are used.
   subroutine test_steady(error)
      type(testing_error), allocatable, intent(out) :: error
      type(error_t), allocatable :: lib
      type(jointed_system_t) :: system
      type(operating_state_t) :: state
      type(linear_modes_t) :: modes
      type(excitation_t) :: sine
      type(harmonic_meter_t) :: meter
      type(history_t) :: history
      type(transient_record_t) :: record
      complex(wp) :: exact(2)
      real(wp) :: dt
      integer :: k, used(2)
      !> Windows of 4 periods leave e^(-beta 4/(2 f)) of the transient: the change is about five times what is left.
      real(wp), parameter :: tolerance = 1.0e-4_wp

      call make_preloaded(sticky, system, state, modes, lib)
      call good(error, lib)
      if (allocated(error)) return
      dt = safety/system%highest_angular_frequency()
      call stepped(modes%frequency(1)*[1.0_wp, 1.02_wp], 0, 20, sine, meter)
      meter%tolerance = tolerance
      call integrate(system, state, dt, 0, [sine], solver(), history, record, lib, stride=100, meter=meter)
      call good(error, lib)
      if (allocated(error)) return
      used = [(count(history%windows%step == k), k=1, 2)]
      call check(error, all(used >= 3) .and. all(used < 15), 'windows: '//to_text(used(1))//' '//to_text(used(2)))
      if (allocated(error)) return
      call check(error, record%steps == ceiling((4*used(1)/modes%frequency(1) + 4*used(2)/(1.02_wp*modes%frequency(1)))/dt), &
         & 'the run ends with the last window')
      do k = 1, size(history%windows)
         associate (window => history%windows(k))
            if (allocated(error)) return
            if (k < size(history%windows)) then
               if (history%windows(k + 1)%step == window%step) then
                  call check(error, window%change < 0.0_wp .or. window%change > tolerance, 'should have gone on')
                  cycle
               end if
            end if
            exact = response(system, modes, window%frequency, dt)
            call check(error, window%change <= tolerance .and. maxval(abs(first_harmonic(window, sine%amplitude) - exact)) < &
               & tolerance*maxval(abs(exact)), 'not steady')
         end associate
      end do
   end subroutine test_steady

   !> A slow sweep lags behind: by about (change of frequency within a time constant over the half width)^1.
   subroutine test_swept(error)
      type(testing_error), allocatable, intent(out) :: error
      type(error_t), allocatable :: lib
      type(jointed_system_t) :: system
      type(operating_state_t) :: state
      type(linear_modes_t) :: modes
      type(excitation_t) :: sweep
      type(history_t) :: history
      type(transient_record_t) :: record
      complex(wp) :: exact(2)
      real(wp) :: dt, difference, largest(2)
      integer :: k, round
      !> Of the slower sweep; it falls in proportion to the rate.
      real(wp), parameter :: lag = 2.0e-2_wp

      call make_preloaded(sticky, system, state, modes, lib)
      call good(error, lib)
      if (allocated(error)) return
      dt = safety/system%highest_angular_frequency()
      do round = 1, 2
         sweep = excitation_t(load=impact_load, kind=kind_swept_sine, amplitude=100.0_wp, frequency=0.9_wp*modes%frequency(1), &
            & frequency_to=1.1_wp*modes%frequency(1), rate=60.0_wp/2**round, ramp=0.05_wp)
         call integrate(system, state, dt, 0, [sweep], solver(), history, record, lib, stride=100, &
            & meter=harmonic_meter_t(excitation=1, harmonics=2, window=8))
         call good(error, lib)
         if (allocated(error)) return
         largest(round) = 0.0_wp
         exact = response(system, modes, modes%frequency(1), dt)
         difference = maxval(abs(exact))
         do k = 1, size(history%windows)
            if (history%windows(k)%time < 0.2_wp) cycle
            exact = response(system, modes, history%windows(k)%frequency, dt)
            largest(round) = max(largest(round), maxval(abs(first_harmonic(history%windows(k), sweep%amplitude) - exact)) &
               & /difference)
         end do
      end do
      call check(error, largest(2) < lag .and. abs(largest(1)/largest(2) - 2.0_wp) < 0.3_wp, to_text(largest(1), 3)//' '// &
         & to_text(largest(2), 3))
      if (allocated(error)) return
      ! A window begins every 4 periods.
      call check(error, all(history%windows%step == [(k, k=1, size(history%windows))]) .and. &
         & abs(size(history%windows) - sweep%cycles(sweep%end())/4) < 2.5_wp, 'windows')
   end subroutine test_swept

   !> Partial slip: the harmonics are the fit of the stored samples, and do not depend on how often points are checked.
   subroutine test_friction(error)
      type(testing_error), allocatable, intent(out) :: error
      type(error_t), allocatable :: lib
      type(jointed_system_t) :: system
      type(operating_state_t) :: state
      type(linear_modes_t) :: modes
      type(excitation_t) :: sine, again
      type(harmonic_meter_t) :: meter, other
      type(history_t) :: history, checked
      type(transient_record_t) :: record
      real(wp) :: dt
      integer :: k

      call make_preloaded(0.6_wp, system, state, modes, lib)
      call good(error, lib)
      if (allocated(error)) return
      dt = safety/system%highest_angular_frequency()
      call stepped(modes%frequency(1)*[0.95_wp, 1.0_wp], 2, 2, sine, meter)
      sine%amplitude = 3000.0_wp
      call integrate(system, state, dt, 0, [sine], solver(), history, record, lib, meter=meter)
      if (.not. allocated(lib)) call integrate(system, state, dt, 0, [sine], solver(), checked, record, lib, &
         & meter=meter, verify_stride=3)
      call good(error, lib)
      if (allocated(error)) return
      call check(error, any([(history%samples(k)%counts(3) > 0, k=1, size(history%samples))]), 'no slip')
      if (allocated(error)) return
      again = sine
      other = meter
      call other%start(again, dt, 2, lib)
      do k = 1, size(history%samples)
         call other%observe(again, history%samples(k)%time, dt, history%samples(k)%sensor)
      end do
      call check(error, size(history%windows) == 4 .and. size(other%done) == 4 .and. size(checked%windows) == 4, 'windows')
      do k = 1, size(history%windows)
         if (.not. allocated(error)) call check(error, maxval(abs(history%windows(k)%amplitude - other%done(k)%amplitude)) < &
            & rounding*maxval(history%windows(k)%amplitude) .and. maxval(abs(history%windows(k)%amplitude - &
            & checked%windows(k)%amplitude)) < 1.0e-6_wp*maxval(history%windows(k)%amplitude), 'window '//to_text(k))
      end do
   end subroutine test_friction

   !> Straight lines miss a half-sine by (pi h/T)^2/8 at most.
   subroutine test_table(error)
      type(testing_error), allocatable, intent(out) :: error
      type(error_t), allocatable :: lib
      type(jointed_system_t) :: system
      type(operating_state_t) :: state
      type(linear_modes_t) :: modes
      type(excitation_t) :: pulse, table
      type(history_t) :: history, other
      type(transient_record_t) :: record
      real(wp), allocatable :: one(:, :), two(:, :)
      real(wp) :: dt
      integer :: k
      integer, parameter :: points = 50
      real(wp), parameter :: duration = 2.0e-3_wp, interpolation = (pi/points)**2/8.0_wp

      call make_preloaded(0.6_wp, system, state, modes, lib)
      call good(error, lib)
      if (allocated(error)) return
      dt = safety/system%highest_angular_frequency()
      pulse = excitation_t(load=impact_load, kind=kind_half_sine, amplitude=3000.0_wp, duration=duration)
      table = excitation_t(load=impact_load, kind=kind_table, amplitude=1000.0_wp)
      table%table = reshape([(duration*k/points, 3.0_wp*sin(pi*k/points), k=0, points)], [2, points + 1])
      call integrate(system, state, dt, 300, [pulse], solver(), history, record, lib)
      if (.not. allocated(lib)) call integrate(system, state, dt, 300, [table], solver(), other, record, lib)
      call good(error, lib)
      if (allocated(error)) return
      one = history%modal()
      two = other%modal()
      call check(error, maxval(abs(one - two)) < 2.0_wp*interpolation*maxval(abs(one - spread(one(:, 1), 2, size(one, 2)))), &
         & to_text(maxval(abs(one - two))/maxval(abs(one - spread(one(:, 1), 2, size(one, 2)))), 2))
   end subroutine test_table

end module test_analysis_harmonic_meter
