!> Free decay by its peaks: extremes of the signal, and straight lines through them.
!>
!> The extremes are followed from one to the next, half a period on. Around each, a least-squares fit of
!> c + a cos(omega t) + b sin(omega t) over half a period gives its time and its value: samples need not hit the extreme,
!> and oscillations that are faster average out. Amplitude of an extreme: half of its distance from the mean of its
!> neighbours, which no offset disturbs. In a window, the slope of the times gives the half period and that of the log
!> amplitudes the decay; both are free of what all extremes have in common.
module microslip_analysis_peaks
   use microslip_core_error, only: error_t, failure
   use microslip_core_kinds, only: wp, pi
   use microslip_linalg_dense, only: solve_general
   implicit none(type, external)
   private

   public :: peaks_t, find_peaks

   !> Extremes of a signal but for the first and the last one, which lack a neighbour.
   type :: peaks_t
      !> (peaks) s from the first sample
      real(wp), allocatable :: time(:)
      !> (peaks)
      real(wp), allocatable :: amplitude(:)
   contains
      procedure :: fit_window
   end type peaks_t

contains

   !> Follow the extremes of a signal.
   subroutine find_peaks(signal, interval, frequency, peaks, error)
      real(wp), intent(in) :: signal(:)
      !> s
      real(wp), intent(in) :: interval
      !> Hz, about
      real(wp), intent(in) :: frequency
      type(peaks_t), intent(out) :: peaks
      type(error_t), allocatable, intent(out) :: error
      real(wp), allocatable :: time(:), value(:)
      real(wp) :: half, near, at, height
      integer :: n

      half = 0.5_wp/frequency
      near = half
      allocate (time(0), value(0))
      do while (near + 0.5_wp*half <= (size(signal) - 1)*interval)
         call fit_extreme(signal, interval, half, near, at, height, error)
         if (allocated(error)) return
         time = [time, at]
         value = [value, height]
         n = size(time)
         if (n > 1) half = time(n) - time(n - 1)
         if (half < 0.25_wp/frequency .or. half > 1.0_wp/frequency) then
            call failure(error, 'ringdown: the peaks do not follow one another like those of one oscillation')
            return
         end if
         near = at + half
      end do
      n = size(time)
      peaks%time = time(2:n - 1)
      peaks%amplitude = 0.5_wp*abs(value(2:n - 1) - 0.5_wp*(value(:n - 2) + value(3:)))
   end subroutine find_peaks

   !> Time and value of the extreme that is nearest to a time.
   subroutine fit_extreme(signal, interval, half, near, at, height, error)
      real(wp), intent(in) :: signal(:), interval, half, near
      real(wp), intent(out) :: at, height
      type(error_t), allocatable, intent(out) :: error
      real(wp), allocatable :: basis(:, :), matrix(:, :), x(:, :)
      real(wp) :: phase
      integer :: first, last, j

      first = 1 + max(0, ceiling((near - 0.5_wp*half)/interval))
      last = min(size(signal), 1 + floor((near + 0.5_wp*half)/interval))
      allocate (basis(last - first + 1, 3))
      do j = first, last
         phase = pi*((j - 1)*interval - near)/half
         basis(j - first + 1, :) = [1.0_wp, cos(phase), sin(phase)]
      end do
      matrix = matmul(transpose(basis), basis)
      x = matmul(transpose(basis), reshape(signal(first:last), [last - first + 1, 1]))
      call solve_general(matrix, x, error)
      if (allocated(error)) then
         error%message = 'ringdown: too few samples around a peak: '//error%message
         return
      end if
      ! The maximum lies at the phase atan2(b, a), the minimum half a turn from there.
      phase = atan2(x(3, 1), x(2, 1))
      height = x(1, 1) + norm2(x(2:3, 1))
      if (abs(phase) > 0.5_wp*pi) then
         phase = phase - sign(pi, phase)
         height = x(1, 1) - norm2(x(2:3, 1))
      end if
      at = near + half*phase/pi
   end subroutine fit_extreme

   !> Straight lines through the peaks of a window; NaN-free: zeros if it holds less than three.
   pure subroutine fit_window(self, middle, length, amplitude, frequency, damping_ratio)
      class(peaks_t), intent(in) :: self
      !> s from the first sample
      real(wp), intent(in) :: middle, length
      !> At the middle
      real(wp), intent(out) :: amplitude
      !> Hz
      real(wp), intent(out) :: frequency
      real(wp), intent(out) :: damping_ratio
      real(wp), allocatable :: time(:), logarithm(:), index(:)
      real(wp) :: half, decay
      integer :: k

      time = pack(self%time, abs(self%time - middle) <= 0.5_wp*length)
      logarithm = log(pack(self%amplitude, abs(self%time - middle) <= 0.5_wp*length))
      index = [(real(k, wp), k=1, size(time))]
      amplitude = 0.0_wp
      frequency = 0.0_wp
      damping_ratio = 0.0_wp
      if (size(time) < 3) return
      half = slope(index, time)
      decay = -slope(time, logarithm)
      frequency = 0.5_wp/half
      damping_ratio = decay/hypot(decay, pi/half)
      amplitude = exp(sum(logarithm)/size(time) - decay*(middle - sum(time)/size(time)))
   end subroutine fit_window

   !> Slope of the straight line through points.
   pure real(wp) function slope(x, y)
      real(wp), intent(in) :: x(:), y(:)
      associate (dx => x - sum(x)/size(x))
         slope = sum(dx*y)/sum(dx**2)
      end associate
   end function slope

end module microslip_analysis_peaks
