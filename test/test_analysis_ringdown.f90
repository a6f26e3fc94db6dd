!> Tests of the identification of ring-downs: synthetic decays of known frequency and damping.
module test_analysis_ringdown
   use microslip_analysis_ringdown, only: decay_t, identify_ringdown, ringdown_options_t, ringdown_t
   use microslip_core_error, only: error_t
   use microslip_core_kinds, only: wp, pi
   use microslip_core_text, only: to_text
   use support_checks, only: good
   use testdrive, only: check, new_unittest, test_failed, testing_error => error_type, unittest_type
   implicit none(type, external)
   private

   public :: collect_analysis_ringdown

   !> Hz, s, m: like the S4 Beam's first mode, sampled in every 20th step.
   real(wp), parameter :: frequency = 208.3_wp, interval = 4.8e-4_wp, largest = 1.3e-4_wp
   integer, parameter :: samples = 2000
   !> Ten periods of ten samples: sums in place of integrals cost the decay rate (h/T)^2, the rest next to nothing.
   real(wp), parameter :: sum_error = 1.0e-6_wp, decay_error = 5.0e-4_wp
   !> Peaks of a decaying cosine, fitted by one that does not decay: of its time, of the decay rate, of its height.
   real(wp), parameter :: peak_time = 2.0e-5_wp, peak_decay = 1.0e-2_wp, peak_height = 1.0e-3_wp
   !> Bias where all changes with the amplitude, which falls by about a fifth in a window: frequency, damping, amplitude.
   real(wp), parameter :: transform_bias(3) = [2.0e-4_wp, 1.0e-2_wp, 2.0e-3_wp], peak_bias(3) = [3.0e-4_wp, 1.0e-2_wp, 5.0e-3_wp]

contains

   subroutine collect_analysis_ringdown(testsuite)
      type(unittest_type), allocatable, intent(out) :: testsuite(:)

      testsuite = [ &
         & new_unittest('an exponential decay with offset', test_exponential), &
         & new_unittest('bias where frequency and damping depend on the amplitude', test_amplitude_dependent), &
         & new_unittest('other modes at a distance do not disturb', test_other_mode), &
         & new_unittest('the sensor in place of a mode, frequency unknown, two directions', test_sensor), &
         & new_unittest('windows: start, length, overlap', test_windows), &
         & new_unittest('what cannot be identified is refused', test_refused)]
   end subroutine collect_analysis_ringdown

   !> A decay at equidistant times whose modal coordinate is `signal`; the sensor is its multiple.
   pure function recorded(signal) result(decay)
      real(wp), intent(in) :: signal(:)
      type(decay_t) :: decay
      integer :: k

      decay%time = [(interval*(k - 1), k=1, size(signal))]
      decay%modal = signal
      decay%sensor = reshape(2.0_wp*signal, [1, size(signal)])
   end function recorded

   !> a e^(-zeta omega t) cos(omega t sqrt(1 - zeta^2) + phase) at the sampling times.
   pure function exponential(amplitude, hertz, zeta, phase) result(x)
      real(wp), intent(in) :: amplitude, hertz, zeta, phase
      real(wp) :: x(samples), t(samples)
      integer :: k

      t = [(interval*(k - 1), k=1, samples)]
      x = amplitude*exp(-zeta*2.0_wp*pi*hertz*t)*cos(2.0_wp*pi*hertz*sqrt(1.0_wp - zeta**2)*t + phase)
   end function exponential

   pure real(wp) function deviation(values, wanted)
      real(wp), intent(in) :: values(:), wanted
      deviation = maxval(abs(values/wanted - 1.0_wp))
   end function deviation

   !> The offset is ten times the oscillation; the transform is exact but for the sums.
   subroutine test_exponential(error)
      type(testing_error), allocatable, intent(out) :: error
      type(error_t), allocatable :: lib
      type(ringdown_t) :: found
      real(wp), parameter :: zeta = 2.0e-3_wp, damped = frequency*sqrt(1.0_wp - zeta**2)

      call identify_ringdown(recorded(1.3e-3_wp + exponential(largest, frequency, zeta, 0.3_wp)), &
         & ringdown_options_t(frequency=1.03_wp*frequency, sensors=[1]), found, lib)
      call good(error, lib)
      if (allocated(error)) return
      associate (exact => largest*exp(-zeta*2.0_wp*pi*frequency*found%time))
         call check(error, deviation(found%frequency, damped) < sum_error .and. deviation(found%damping_ratio, zeta) &
            & < decay_error .and. deviation(found%amplitude/exact, 2.0_wp) < sum_error, 'transform: '// &
            & to_text(deviation(found%frequency, damped))//' '//to_text(deviation(found%damping_ratio, zeta))//' '// &
            & to_text(deviation(found%amplitude/exact, 2.0_wp)))
         if (allocated(error)) return
         call check(error, deviation(found%peak_frequency, damped) < peak_time .and. &
            & deviation(found%peak_damping_ratio, zeta) < peak_decay .and. &
            & deviation(found%peak_amplitude/exact, 1.0_wp) < peak_height, 'peaks: '// &
            & to_text(deviation(found%peak_frequency, damped))//' '//to_text(deviation(found%peak_damping_ratio, zeta))//' '// &
            & to_text(deviation(found%peak_amplitude/exact, 1.0_wp)))
      end associate
   end subroutine test_exponential

   !> zeta = z_0 + z_1 a, omega = omega_0 (1 - c a), integrated by fine steps: the bias of both ways.
   subroutine test_amplitude_dependent(error)
      type(testing_error), allocatable, intent(out) :: error
      type(error_t), allocatable :: lib
      type(ringdown_t) :: found
      real(wp), parameter :: z_0 = 1.0e-3_wp, z_1 = 4.0e-3_wp/largest, c = 0.02_wp/largest, omega_0 = 2.0_wp*pi*frequency
      integer, parameter :: fine = 50
      real(wp) :: signal(samples), amplitude(samples), a, phase, h, k1, k2
      real(wp), allocatable :: a_there(:), f_there(:), z_there(:)
      integer :: k, j

      a = largest
      phase = 0.2_wp
      h = interval/fine
      do k = 1, samples
         amplitude(k) = a
         signal(k) = a*cos(phase)
         do j = 1, fine
            k1 = -(z_0 + z_1*a)*omega_0*(1.0_wp - c*a)*a
            associate (middle => a + 0.5_wp*h*k1)
               k2 = -(z_0 + z_1*middle)*omega_0*(1.0_wp - c*middle)*middle
               phase = phase + h*omega_0*(1.0_wp - c*middle)
            end associate
            a = a + h*k2
         end do
      end do
      call identify_ringdown(recorded(signal), ringdown_options_t(frequency=frequency, sensors=[1]), found, lib)
      call good(error, lib)
      if (allocated(error)) return
      ! An even number of samples puts the middle of a window between two of them.
      a_there = [(sqrt(amplitude(floor(found%time(k)/interval) + 1)*amplitude(ceiling(found%time(k)/interval) + 1)), &
         & k=1, size(found%time))]
      f_there = frequency*(1.0_wp - c*a_there)
      z_there = z_0 + z_1*a_there
      call check(error, deviation(found%frequency/f_there, 1.0_wp) < transform_bias(1) .and. &
         & deviation(found%damping_ratio/z_there, 1.0_wp) < transform_bias(2) .and. &
         & deviation(found%signal_amplitude/a_there, 1.0_wp) < transform_bias(3), 'transform: '// &
         & to_text(deviation(found%frequency/f_there, 1.0_wp))//' '//to_text(deviation(found%damping_ratio/z_there, 1.0_wp))// &
         & ' '//to_text(deviation(found%signal_amplitude/a_there, 1.0_wp)))
      if (allocated(error)) return
      call check(error, deviation(found%peak_frequency/f_there, 1.0_wp) < peak_bias(1) .and. &
         & deviation(found%peak_damping_ratio/z_there, 1.0_wp) < peak_bias(2) .and. &
         & deviation(found%peak_amplitude/a_there, 1.0_wp) < peak_bias(3), 'peaks: '// &
         & to_text(deviation(found%peak_frequency/f_there, 1.0_wp))//' '// &
         & to_text(deviation(found%peak_damping_ratio/z_there, 1.0_wp))//' '// &
         & to_text(deviation(found%peak_amplitude/a_there, 1.0_wp)))
   end subroutine test_amplitude_dependent

   !> A second mode of a tenth of the amplitude, three octaves up.
   subroutine test_other_mode(error)
      type(testing_error), allocatable, intent(out) :: error
      type(error_t), allocatable :: lib
      type(ringdown_t) :: found
      real(wp), parameter :: zeta = 1.0e-3_wp

      call identify_ringdown(recorded(exponential(largest, frequency, zeta, 0.0_wp) &
         & + exponential(0.1_wp*largest, 4.37_wp*frequency, zeta, 1.0_wp)), &
         & ringdown_options_t(frequency=frequency, sensors=[1]), found, lib)
      call good(error, lib)
      if (allocated(error)) return
      call check(error, deviation(found%frequency, frequency) < 1.0e-4_wp .and. &
         & deviation(found%damping_ratio, zeta) < 1.0e-2_wp, 'transform')
      if (.not. allocated(error)) call check(error, deviation(found%peak_frequency, frequency) < 1.0e-3_wp .and. &
         & deviation(found%peak_damping_ratio, zeta) < 0.3_wp, 'peaks: '// &
         & to_text(deviation(found%peak_frequency, frequency))//' '//to_text(deviation(found%peak_damping_ratio, zeta)))
   end subroutine test_other_mode

   !> Directions with 3 and 4 parts of the motion: the amplitude has 5.
   subroutine test_sensor(error)
      type(testing_error), allocatable, intent(out) :: error
      type(error_t), allocatable :: lib
      type(decay_t) :: decay
      type(ringdown_t) :: found
      real(wp), parameter :: zeta = 1.0e-3_wp
      real(wp) :: signal(samples)

      signal = exponential(largest, frequency, zeta, 0.0_wp)
      decay = recorded(signal)
      deallocate (decay%modal)
      decay%sensor = reshape([0.5_wp*signal, 3.0_wp*signal, 1.0e-3_wp - 4.0_wp*signal], [3, samples], order=[2, 1])
      call identify_ringdown(decay, ringdown_options_t(sensors=[2, 3]), found, lib)
      call good(error, lib)
      if (allocated(error)) return
      associate (exact => largest*exp(-zeta*2.0_wp*pi*frequency*found%time))
         call check(error, deviation(found%frequency, frequency) < 2.0_wp*sum_error .and. &
            & deviation(found%amplitude/exact, 5.0_wp) < sum_error .and. &
            & deviation(found%signal_amplitude/exact, 4.0_wp) < sum_error)
      end associate
   end subroutine test_sensor

   subroutine test_windows(error)
      type(testing_error), allocatable, intent(out) :: error
      type(error_t), allocatable :: lib
      type(ringdown_t) :: found
      real(wp), parameter :: start = 0.1_wp
      integer, parameter :: window = nint(20.0_wp/(frequency*interval))
      integer :: k, windows

      call identify_ringdown(recorded(exponential(largest, frequency, 1.0e-3_wp, 0.0_wp)), &
         & ringdown_options_t(start=start, periods=20.0_wp, overlap=0.0_wp, frequency=frequency, sensors=[1]), found, lib)
      call good(error, lib)
      if (allocated(error)) return
      windows = (samples - ceiling(start/interval))/window
      call check(error, size(found%time), windows)
      if (allocated(error)) return
      call check(error, all(abs(found%time - [(interval*(ceiling(start/interval) + (k - 1)*window + 0.5_wp*(window - 1)), &
         & k=1, windows)]) < 1.0e-9_wp), 'middles of the windows')
   end subroutine test_windows

   subroutine test_refused(error)
      type(testing_error), allocatable, intent(out) :: error
      real(wp) :: signal(samples)
      type(decay_t) :: nothing

      signal = exponential(largest, frequency, 1.0e-3_wp, 0.0_wp)
      call refused(error, recorded(signal), ringdown_options_t(frequency=1.3_wp*frequency, sensors=[1]), 'samples of a period')
      call refused(error, recorded(signal), ringdown_options_t(frequency=frequency, sensors=[1], start=0.93_wp), &
         & 'less than one window')
      call refused(error, recorded(signal), ringdown_options_t(frequency=frequency, sensors=[1], start=10.0_wp), 'no motion')
      call refused(error, recorded(0.0_wp*signal + 1.0_wp), ringdown_options_t(frequency=frequency, sensors=[1]), 'no motion')
      allocate (nothing%time(0), nothing%sensor(1, 0))
      call refused(error, nothing, ringdown_options_t(sensors=[1]), 'nothing was recorded')
   end subroutine test_refused

   subroutine refused(error, decay, options, reason)
      type(testing_error), allocatable, intent(inout) :: error
      type(decay_t), intent(in) :: decay
      type(ringdown_options_t), intent(in) :: options
      !> Part of the message
      character(len=*), intent(in) :: reason
      type(error_t), allocatable :: lib
      type(ringdown_t) :: found

      if (allocated(error)) return
      call identify_ringdown(decay, options, found, lib)
      if (.not. allocated(lib)) then
         call test_failed(error, 'not refused: '//reason)
      else
         call check(error, index(lib%message, reason) > 0, lib%message)
      end if
   end subroutine refused

end module test_analysis_ringdown
