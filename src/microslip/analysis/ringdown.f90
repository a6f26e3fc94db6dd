!> Modal parameters from a free decay (paper section 3.2, METHOD section 7), by two independent ways.
!>
!> 1. Short-time Fourier transform X(t, omega) with a Hann window w. Its derivative along time follows from the window's,
!>    and is the decay of the fundamental and the rate of its phase:
!>        s = -delta + i omega_d = i omega - X_w' / X_w,      zeta = delta / |s|,     frequency = omega_d / (2 pi)
!>    exact for one exponential. The offset and the mirror image at -omega, which leak into X, are taken out with the
!>    amplitude A found, until nothing changes; A is that of the decaying oscillation at the middle of the window.
!> 2. Peaks (`microslip_analysis_peaks`): straight lines through log amplitude and time of the extremes of a window.
!>
!> Amplitudes at the sensor are L2 norms over its directions of the amplitudes of the fundamental, by the first way.
module microslip_analysis_ringdown
   use, intrinsic :: iso_c_binding, only: c_double, c_double_complex, c_int, c_ptr
   use microslip_analysis_peaks, only: peaks_t, find_peaks
   use microslip_core_error, only: error_t, failure
   use microslip_core_kinds, only: wp, pi
   use microslip_core_text, only: to_text
   use microslip_linalg_fftw, only: fftw_plan_dft_r2c_1d, fftw_execute_dft_r2c, fftw_destroy_plan, FFTW_ESTIMATE
   implicit none(type, external)
   private

   public :: decay_t, ringdown_options_t, ringdown_t, identify_ringdown

   !> Fewest samples of a period.
   real(wp), parameter :: fewest_samples = 8.0_wp
   !> Of the iteration of a window: most rounds, and relative change at its end.
   integer, parameter :: most_rounds = 50
   real(wp), parameter :: settled = 1.0e-12_wp

   !> What was recorded.
   type :: decay_t
      !> (samples) s, equally spaced
      real(wp), allocatable :: time(:)
      !> (sensors, samples) m
      real(wp), allocatable :: sensor(:, :)
      !> (samples) m sqrt(kg), coordinate of the mode that is looked at; not allocated: the sensor is looked at
      real(wp), allocatable :: modal(:)
   end type decay_t

   type :: ringdown_options_t
      !> s, begin of the free decay
      real(wp) :: start = 0.0_wp
      !> Window in periods, and the part of it that the next one shares
      real(wp) :: periods = 10.0_wp, overlap = 0.9_wp
      !> Hz, about; 0: not known
      real(wp) :: frequency = 0.0_wp
      !> Sensors whose L2 norm is the amplitude
      integer, allocatable :: sensors(:)
   end type ringdown_options_t

   !> (windows) everything at the middle of the windows.
   type :: ringdown_t
      !> s
      real(wp), allocatable :: time(:)
      !> m, at the sensor
      real(wp), allocatable :: amplitude(:)
      !> Hz and 1
      real(wp), allocatable :: frequency(:), damping_ratio(:)
      !> Of the signal that was looked at: m sqrt(kg) of a mode, m of a sensor
      real(wp), allocatable :: signal_amplitude(:)
      !> The same by way of the peaks
      real(wp), allocatable :: peak_amplitude(:), peak_frequency(:), peak_damping_ratio(:)
      !> s, length of the window
      real(wp) :: window = 0.0_wp
   end type ringdown_t

contains

   !> Identify a ring-down.
   subroutine identify_ringdown(decay, options, found, error)
      type(decay_t), intent(in) :: decay
      type(ringdown_options_t), intent(in) :: options
      type(ringdown_t), intent(out) :: found
      type(error_t), allocatable, intent(out) :: error
      real(wp), allocatable :: signal(:)
      type(peaks_t) :: peaks
      real(wp) :: interval, frequency
      integer :: first, window, hop, k

      if (size(decay%time) < 2) then
         call failure(error, 'ringdown: nothing was recorded')
         return
      end if
      interval = (decay%time(size(decay%time)) - decay%time(1))/(size(decay%time) - 1)
      first = 1 + max(0, ceiling((options%start - decay%time(1))/interval - 1.0e-6_wp))
      if (first < size(decay%time)) then
         signal = signal_of(decay, options, first)
      else
         signal = [0.0_wp]
      end if
      if (all(signal == signal(1))) then
         call failure(error, 'ringdown: there is no motion after '//to_text(options%start)//' s')
         return
      end if
      frequency = options%frequency
      if (frequency <= 0.0_wp) frequency = strongest_frequency(signal, interval)
      window = nint(options%periods/(frequency*interval))
      call check_sampling(options, frequency, interval, window, size(signal), error)
      if (allocated(error)) return

      hop = max(1, nint((1.0_wp - options%overlap)*window))
      found%window = window*interval
      call make_room(found, 1 + (size(signal) - window)/hop)
      found%time = [(decay%time(first) + interval*((k - 1)*hop + 0.5_wp*(window - 1)), k=1, size(found%time))]
      call follow_windows(signal, decay%sensor(options%sensors, first:), interval, frequency, window, hop, found)
      call find_peaks(signal, interval, frequency, peaks, error)
      if (allocated(error)) return
      do k = 1, size(found%time)
         call peaks%fit_window(found%time(k) - decay%time(first), found%window, found%peak_amplitude(k), &
            & found%peak_frequency(k), found%peak_damping_ratio(k))
      end do
   end subroutine identify_ringdown

   !> The signal from a sample on: the mode's coordinate, or the direction of the sensor that moves most.
   pure function signal_of(decay, options, first) result(signal)
      type(decay_t), intent(in) :: decay
      type(ringdown_options_t), intent(in) :: options
      integer, intent(in) :: first
      real(wp), allocatable :: signal(:)
      real(wp) :: range(size(options%sensors))

      if (allocated(decay%modal)) then
         signal = decay%modal(first:)
      else
         associate (moving => decay%sensor(options%sensors, first:))
            range = maxval(moving, dim=2) - minval(moving, dim=2)
            signal = moving(maxloc(range, dim=1), :)
         end associate
      end if
   end function signal_of

   !> Whether there are enough samples, of a period and in all.
   subroutine check_sampling(options, frequency, interval, window, samples, error)
      type(ringdown_options_t), intent(in) :: options
      real(wp), intent(in) :: frequency, interval
      integer, intent(in) :: window, samples
      type(error_t), allocatable, intent(out) :: error

      if (frequency*interval*fewest_samples > 1.0_wp) then
         call failure(error, 'ringdown: '//to_text(1.0_wp/(frequency*interval), 3)//' samples of a period ('// &
            & to_text(frequency, 5)//' Hz) are too few, '//to_text(fewest_samples)//' are needed: a smaller stride in &output')
      else if (samples < window) then
         call failure(error, 'ringdown: '//to_text(samples*interval*frequency, 3)//' periods of free decay are less than ' &
            & //'one window, '//to_text(options%periods))
      end if
   end subroutine check_sampling

   pure subroutine make_room(found, windows)
      type(ringdown_t), intent(inout) :: found
      integer, intent(in) :: windows

      allocate (found%time(windows), found%amplitude(windows), found%frequency(windows), found%damping_ratio(windows), &
         & found%signal_amplitude(windows), found%peak_amplitude(windows), found%peak_frequency(windows), &
         & found%peak_damping_ratio(windows))
   end subroutine make_room

   !> From window to window, the rate found in one being the start of the next.
   pure subroutine follow_windows(signal, sensor, interval, frequency, window, hop, found)
      real(wp), intent(in) :: signal(:), interval, frequency
      !> (directions, samples)
      real(wp), intent(in) :: sensor(:, :)
      integer, intent(in) :: window, hop
      type(ringdown_t), intent(inout) :: found
      complex(wp) :: rate, amplitude, fundamental(size(sensor, 1))
      integer :: k, c, first, last

      rate = cmplx(0.0_wp, 2.0_wp*pi*frequency, wp)
      do k = 1, size(found%time)
         first = 1 + (k - 1)*hop
         last = first + window - 1
         call fit_window(signal(first:last), interval, .true., rate, amplitude)
         do c = 1, size(sensor, 1)
            call fit_window(sensor(c, first:last), interval, .false., rate, fundamental(c))
         end do
         found%frequency(k) = aimag(rate)/(2.0_wp*pi)
         found%damping_ratio(k) = -real(rate)/abs(rate)
         found%signal_amplitude(k) = abs(amplitude)
         found%amplitude(k) = norm2(abs(fundamental))
      end do
   end subroutine follow_windows

   !> x = offset + Re(A e^(s t)) in a window, t from its middle, by the Fourier transform with a Hann window.
   pure subroutine fit_window(x, interval, find_rate, rate, amplitude)
      real(wp), intent(in) :: x(:)
      !> s
      real(wp), intent(in) :: interval
      !> Whether s is sought too, or given
      logical, intent(in) :: find_rate
      !> s = -delta + i omega_d, near enough on entry (within the main lobe of the window), 1/s
      complex(wp), intent(inout) :: rate
      complex(wp), intent(out) :: amplitude
      real(wp), dimension(size(x)) :: t, hann, slope
      complex(wp), dimension(size(x)) :: carrier, other
      complex(wp) :: transform, before
      real(wp) :: length, omega, offset
      integer :: j, round

      length = size(x)*interval
      t = [(interval*(j - 0.5_wp*(size(x) + 1)), j=1, size(x))]
      hann = 0.5_wp*(1.0_wp + cos(2.0_wp*pi*t/length))
      slope = -pi/length*sin(2.0_wp*pi*t/length)
      amplitude = 0.0_wp
      do round = 1, most_rounds
         before = amplitude
         other = amplitude*exp(rate*t)
         offset = sum(hann*(x - real(other)))/sum(hann)
         other = x - offset - 0.5_wp*conjg(other)
         omega = aimag(rate)
         carrier = exp(cmplx(0.0_wp, -omega*t, wp))
         transform = sum(hann*other*carrier)
         if (abs(transform) <= 0.0_wp) return
         if (find_rate) rate = cmplx(0.0_wp, omega, wp) - sum(slope*other*carrier)/transform
         amplitude = 2.0_wp*transform/sum(hann*exp((rate - cmplx(0.0_wp, omega, wp))*t))
         if (abs(amplitude - before) <= settled*abs(amplitude)) return
      end do
   end subroutine fit_window

   !> Hz, where the spectrum of the whole signal (Hann window, without its mean) is largest.
   function strongest_frequency(signal, interval) result(frequency)
      real(wp), intent(in) :: signal(:), interval
      real(wp) :: frequency
      real(c_double) :: x(size(signal))
      complex(c_double_complex) :: spectrum(size(signal)/2 + 1)
      type(c_ptr) :: plan
      integer :: n, j

      n = size(signal)
      plan = fftw_plan_dft_r2c_1d(int(n, c_int), x, spectrum, FFTW_ESTIMATE)
      x = (signal - sum(signal)/n)*[(sin(pi*(j - 0.5_wp)/n)**2, j=1, n)]
      call fftw_execute_dft_r2c(plan, x, spectrum)
      call fftw_destroy_plan(plan)
      frequency = (maxloc(abs(spectrum), dim=1) - 1)/(n*interval)
   end function strongest_frequency

end module microslip_analysis_ringdown
