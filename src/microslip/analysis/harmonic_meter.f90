!> Amplitude and phase of the sensors under a sine excitation, found while stepping: nothing is stored but sums.
!>
!> In a window of n periods, least squares with the Hann weight w = sin^2(pi (c - c_0)/n) over the cycles c,
!>     u(t) = u_0 + sum_h a_h cos(h theta + p_h),   h = 1..H,   theta: the argument of the excitation's cosine,
!> by summing the normal equations. It is exact for such motions whatever the time step; with a whole number of steps
!> in the window it is the discrete Fourier transform with a Hann window. Phases count from the excitation.
!>
!> Stepped sine: at every frequency windows follow one another behind the settling periods. With a tolerance, the
!> frequency is left as soon as two successive windows agree: `change` is the largest over the sensors of
!> |difference of all harmonics|, over the largest |harmonics 1 to H|. Other sines: a window begins every n/2 periods.
module microslip_analysis_harmonic_meter
   use microslip_analysis_excitation, only: excitation_t, kind_stepped_sine
   use microslip_core_archive, only: archive_t
   use microslip_core_error, only: error_t, failure
   use microslip_core_kinds, only: wp, pi
   use microslip_core_text, only: to_text
   use microslip_linalg_dense, only: cholesky_factor, cholesky_solve
   implicit none(type, external)
   private

   public :: harmonic_meter_t, harmonic_window_t

   !> Rounding of cycles.
   real(wp), parameter :: cycle_rounding = 1.0e-9_wp

   !> What was measured in a window.
   type :: harmonic_window_t
      !> s, middle of the window, and frequency of the excitation there, Hz
      real(wp) :: time = 0.0_wp, frequency = 0.0_wp
      !> Which frequency of a stepped sine, or which window of another
      integer :: step = 0
      !> From the window before at the same frequency; negative where there is none
      real(wp) :: change = -1.0_wp
      !> (sensors, 1 + H) m and rad, from harmonic 0 on, whose amplitude is the mean with its sign
      real(wp), allocatable :: amplitude(:, :), phase(:, :)
   end type harmonic_window_t

   !> Sums over the samples of a window.
   type :: fit_t
      !> Cycles at the begin of the window
      real(wp) :: first = 0.0_wp
      !> Sum of w, of w t
      real(wp) :: weight = 0.0_wp, moment = 0.0_wp
      !> (1 + 2H, 1 + 2H) and (1 + 2H, sensors): normal equations in 1, cos theta, sin theta, cos 2 theta, ...
      real(wp), allocatable :: normal(:, :), right(:, :)
   end type fit_t

   !> Follows an excitation; copying it is a checkpoint in memory.
   type :: harmonic_meter_t
      !> Index of the excitation that is followed; 0: nothing is measured
      integer :: excitation = 0
      !> H, and periods of a window (n)
      integer :: harmonics = 5, window = 10
      !> stepped_sine: periods before the first window, most windows at a frequency, and the tolerance; 0: all windows
      integer :: settling = 50, most_windows = 1
      real(wp) :: tolerance = 0.0_wp
      !> What was measured since the last time that somebody took it
      type(harmonic_window_t), allocatable :: done(:)
      integer, private :: step = 1, windows = 0
      !> (sensors, 0:H) of the window before
      complex(wp), allocatable, private :: before(:, :)
      type(fit_t), private :: fit(2)
   contains
      procedure :: start
      procedure :: observe
      procedure :: pass
   end type harmonic_meter_t

contains

   !> Begin; the time step must resolve the highest harmonic.
   subroutine start(self, excitation, time_step, sensors, error)
      class(harmonic_meter_t), intent(inout) :: self
      !> The one that is followed
      type(excitation_t), intent(in) :: excitation
      !> s
      real(wp), intent(in) :: time_step
      !> How many
      integer, intent(in) :: sensors
      type(error_t), allocatable, intent(out) :: error
      real(wp) :: highest
      integer :: n, k

      highest = max(excitation%frequency, excitation%frequency_to)
      if (allocated(excitation%frequencies)) highest = maxval(excitation%frequencies)
      if (2.0_wp*(self%harmonics + 1)*highest*time_step > 1.0_wp) then
         call failure(error, 'harmonics: '//to_text(1.0_wp/(highest*time_step), 3)//' time steps of a period ('// &
            & to_text(highest, 5)//' Hz) are too few for harmonic '//to_text(self%harmonics)//', '// &
            & to_text(2*(self%harmonics + 1))//' are needed')
         return
      end if
      n = 1 + 2*self%harmonics
      do k = 1, size(self%fit)
         allocate (self%fit(k)%normal(n, n), self%fit(k)%right(n, sensors), source=0.0_wp)
      end do
      allocate (self%done(0))
      self%fit(1)%first = 0.0_wp
      if (excitation%kind == kind_stepped_sine) self%fit(1)%first = self%settling
      self%fit(2)%first = 0.5_wp*self%window
   end subroutine start

   !> Take a time step; a stepped sine that has settled is led on to its next frequency.
   subroutine observe(self, excitation, time, time_step, sensor)
      class(harmonic_meter_t), intent(inout) :: self
      type(excitation_t), intent(inout) :: excitation
      !> s, of the sample, and until the next one
      real(wp), intent(in) :: time, time_step
      !> (sensors) m
      real(wp), intent(in) :: sensor(:)
      real(wp) :: next
      integer :: k

      if (time < excitation%start) return
      do k = 1, merge(1, 2, excitation%kind == kind_stepped_sine)
         if (self%fit(k)%first > 0.5_wp*huge(1.0_wp)) cycle
         call add(self%fit(k), self%harmonics, (excitation%cycles(time) - self%fit(k)%first)/self%window, &
            & excitation%angle(time), time, sensor)
         next = excitation%cycles(time + time_step)
         if (next >= self%fit(k)%first + self%window - cycle_rounding) call finish_window(self, k, excitation)
      end do
   end subroutine observe

   !> Store what changes after `start`, or take it back. What was measured must have been taken.
   subroutine pass(self, archive)
      class(harmonic_meter_t), intent(inout) :: self
      type(archive_t), intent(inout) :: archive
      integer :: k

      call archive%pass(self%step)
      call archive%pass(self%windows)
      call archive%pass(self%before)
      do k = 1, size(self%fit)
         call archive%pass(self%fit(k)%first)
         call archive%pass(self%fit(k)%weight)
         call archive%pass(self%fit(k)%moment)
         call archive%pass(self%fit(k)%normal)
         call archive%pass(self%fit(k)%right)
      end do
   end subroutine pass

   !> Add a sample to the sums.
   subroutine add(fit, harmonics, place, theta, time, sensor)
      type(fit_t), intent(inout) :: fit
      integer, intent(in) :: harmonics
      !> In the window, 0 to 1; rad; s
      real(wp), intent(in) :: place, theta, time
      real(wp), intent(in) :: sensor(:)
      real(wp) :: basis(1 + 2*harmonics), w
      integer :: h, k

      if (place <= 0.0_wp .or. place >= 1.0_wp) return
      w = sin(pi*place)**2
      basis(1) = 1.0_wp
      do h = 1, harmonics
         basis(2*h) = cos(h*theta)
         basis(2*h + 1) = sin(h*theta)
      end do
      do k = 1, size(basis)
         fit%normal(:, k) = fit%normal(:, k) + w*basis(k)*basis
      end do
      do k = 1, size(sensor)
         fit%right(:, k) = fit%right(:, k) + w*sensor(k)*basis
      end do
      fit%weight = fit%weight + w
      fit%moment = fit%moment + w*time
   end subroutine add

   !> Solve the normal equations, note the window, and begin the next one.
   subroutine finish_window(self, k, excitation)
      type(harmonic_meter_t), intent(inout) :: self
      !> Which of the sums
      integer, intent(in) :: k
      type(excitation_t), intent(inout) :: excitation
      complex(wp) :: values(size(self%fit(k)%right, 2), 0:self%harmonics)
      type(harmonic_window_t) :: window

      window%time = self%fit(k)%moment/self%fit(k)%weight
      window%frequency = excitation%frequency_at(window%time)
      call solve(self%fit(k), values)
      window%amplitude = abs(values)
      window%amplitude(:, 1) = real(values(:, 0))
      window%phase = atan2(aimag(values), real(values))
      window%phase(:, 1) = 0.0_wp
      self%windows = self%windows + 1
      if (excitation%kind == kind_stepped_sine) then
         window%step = self%step
         if (self%windows > 1) window%change = change_of(values, self%before)
         self%before = values
         call lead_on(self, excitation, window%change)
      else
         window%step = self%windows
         self%fit(k)%first = self%fit(k)%first + self%window
      end if
      self%done = [self%done, window]
   end subroutine finish_window

   !> Complex amplitudes of a window, (sensors, 0:H); the sums become zero.
   subroutine solve(fit, values)
      type(fit_t), intent(inout) :: fit
      complex(wp), intent(out) :: values(:, 0:)
      type(error_t), allocatable :: impossible
      integer :: h

      ! `start` has seen to it that there are more samples than unknowns.
      call cholesky_factor(fit%normal, impossible)
      call cholesky_solve(fit%normal, fit%right)
      values(:, 0) = fit%right(1, :)
      do h = 1, ubound(values, 2)
         values(:, h) = cmplx(fit%right(2*h, :), -fit%right(2*h + 1, :), wp)
      end do
      fit%normal = 0.0_wp
      fit%right = 0.0_wp
      fit%weight = 0.0_wp
      fit%moment = 0.0_wp
   end subroutine solve

   !> Difference of two windows.
   pure real(wp) function change_of(values, before)
      !> (sensors, 0:H)
      complex(wp), intent(in) :: values(:, 0:), before(:, 0:)
      real(wp) :: difference, size_of_all
      integer :: k

      difference = 0.0_wp
      size_of_all = 0.0_wp
      do k = 1, size(values, 1)
         difference = max(difference, norm2(abs(values(k, :) - before(k, :))))
         size_of_all = max(size_of_all, norm2(abs(values(k, 1:))))
      end do
      change_of = difference/max(size_of_all, tiny(1.0_wp))
   end function change_of

   !> The next window of a stepped sine: at this frequency, or at the next one.
   subroutine lead_on(self, excitation, change)
      type(harmonic_meter_t), intent(inout) :: self
      type(excitation_t), intent(inout) :: excitation
      real(wp), intent(in) :: change

      if (self%windows < self%most_windows .and. .not. (change >= 0.0_wp .and. change <= self%tolerance)) then
         self%fit(1)%first = self%fit(1)%first + self%window
         return
      end if
      excitation%periods(self%step) = self%settling + self%windows*self%window
      self%step = self%step + 1
      self%windows = 0
      self%fit(1)%first = huge(1.0_wp)
      if (self%step <= size(excitation%periods)) &
         & self%fit(1)%first = sum(excitation%periods(:self%step - 1)) + self%settling
   end subroutine lead_on

end module microslip_analysis_harmonic_meter
