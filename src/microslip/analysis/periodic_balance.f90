!> The balance of harmonics of a jointed structure (METHOD section 7), shared by forced response and nonlinear modes.
!>
!> x: Fourier coefficients of d_i less the operating state, (modes, 2H + 1). With ' the derivative by tau = omega t:
!>     omega^2 x'' + omega (D + delta I) x' + Khat x  =  f_ex + F(x)
!> F: coefficients of R^T lambda less that of the operating state, from samples of the motion. The boundary follows
!> d_i in every sample, so that it needs no series. dF/dx is kept: computed from the contact states when asked for,
!> improved by Broyden's rank-one update with every evaluation.
!>
!> A body that slides as a whole turns between two samples: friction then jumps from one limit to the other, and the
!> instant would be known to a part of the interval only. Intervals with such a jump are split until it is spread over several
!> of them (contacts are elastic), so that F is a smooth function of x. A march that does not go onward from another one
!> begins with equal spacing.
module microslip_analysis_periodic_balance
   use microslip_analysis_fourier, only: fourier_t, new_fourier, series_coefficients
   use microslip_analysis_operating_state, only: operating_state_t
   use microslip_analysis_periodic_contact, only: contact_cycle_t, periodic_contact_t
   use microslip_analysis_potential_set, only: carry_over, potential_points
   use microslip_analysis_response_point, only: response_point_t
   use microslip_contact_factory, only: contact_options_t
   use microslip_core_error, only: error_t
   use microslip_core_kinds, only: wp, pi
   use microslip_linalg_dense, only: solve_general
   use microslip_system_jointed_system, only: jointed_system_t
   implicit none(type, external)
   private

   public :: periodic_balance_t, repeat_share, fit_contact

   !> Periods after which a march that does not repeat is given up.
   integer, parameter :: max_periods = 100
   !> Change of the forces over a period, in parts of what is missing in the balance, from which marching on would not help.
   real(wp), parameter :: small_change = 0.03_wp

   !> Change of a motion, in parts of itself, up to which its march goes onward from where that before the change ended: what
   !> points remember of another motion may take many periods to be forgotten.
   real(wp), parameter :: near = 0.02_wp
   !> How well forces should repeat, in parts of the residual that is tolerated.
   real(wp), parameter :: repeat_share = 0.1_wp
   !> Part of forces that is rounding, in sums over contact points and modes.
   real(wp), parameter :: rounding = 64.0_wp*epsilon(1.0_wp)
   !> Finest tolerance that the contact solver is asked for: what it can do in double precision.
   real(wp), parameter :: finest_contact = 1.0e-12_wp
   !> Change of the forces over an interval between samples, over their range, from which it is split: this, or twice what
   !> the steepest sine of that range changes by in equal intervals.
   real(wp), parameter :: largest_jump = 0.1_wp
   !> Error of the trapezoidal rule over an interval, in parts of that range (times rad), from which it is split: this, or four
   !> times that of a sine of that range in equal intervals w, w^3/16.
   real(wp), parameter :: largest_error = 1.0e-3_wp
   !> Width of an interval over that beside it, from which it is split: the jump begins where the motion turns, which must not
   !> lie in a wide interval beside narrow ones.
   real(wp), parameter :: widest_beside = 4.5_wp
   !> Samples that splitting may add, in parts of those of equal spacing
   integer, parameter :: most_added = 15
   !> Harmonics whose size is told from the spectrum of the forces, in parts of those of the series.
   integer, parameter, public :: spectrum = 20

   type :: periodic_balance_t
      !> The potential contact set may grow
      type(jointed_system_t), pointer :: system => null()
      type(operating_state_t) :: operating
      type(contact_options_t) :: contact_options
      type(fourier_t) :: fourier
      !> Load with the amplitude level cos(tau), 0: none
      integer :: load = 0
      real(wp) :: level = 0.0_wp
      !> Sensors whose amplitude is told: the directions of one
      integer, allocatable :: sensors(:)
      !> (modes, 2H + 1) of the last evaluation: x, F
      real(wp), allocatable :: x(:, :), force(:, :)
      !> The march of the last evaluation
      type(contact_cycle_t) :: cycle
      type(periodic_contact_t), private :: contact
      !> (modes, 2H + 1) x of the motion that was accepted last
      real(wp), allocatable, private :: accepted(:, :)
      !> Whether its forces repeat as well as was asked for
      logical, private :: settled = .false.
      !> The next evaluation goes onward whatever motion it is
      logical, private :: resumes = .false.
      !> With the derivative by the level of the load
      logical :: level_varies = .false.
      !> (unknowns) dF by the level
      real(wp), allocatable :: by_level(:)
      !> Equal spacing
      type(fourier_t), private :: equal
      !> (drivers, samples) of the last evaluation
      real(wp), allocatable, private :: q(:, :)
      !> (modes columns, modes columns) dF/dx as it is known
      real(wp), allocatable :: derivative(:, :)
      !> (modes) R^T lambda and (sensors) displacement of the operating state
      real(wp), allocatable, private :: reaction(:), sensor(:)
   contains
      procedure :: set_up
      procedure :: unknowns
      procedure :: evaluate
      procedure :: accept
      procedure :: doubt
      procedure :: linear_force
      procedure :: renew_derivative
      procedure :: stiffness_matrix
      procedure :: describe
      procedure :: confirm
      procedure :: noise_of
      procedure :: neglected
      procedure :: neglected_velocity
      procedure :: spectrum_harmonics
      procedure :: samples
      procedure :: resample
   end type periodic_balance_t

contains

   !> Prepare at the operating state.
   subroutine set_up(self, system, operating, sensors, harmonics, samples, contact_options, error)
      class(periodic_balance_t), intent(inout) :: self
      !> It must outlive this object
      type(jointed_system_t), intent(inout), target :: system
      type(operating_state_t), intent(in) :: operating
      !> The directions of the sensor whose amplitude is told
      integer, intent(in) :: sensors(:)
      !> H and N > 2H
      integer, intent(in) :: harmonics, samples
      type(contact_options_t), intent(in) :: contact_options
      type(error_t), allocatable, intent(out) :: error

      self%system => system
      self%operating = operating
      self%contact_options = contact_options
      self%sensors = sensors
      self%equal = new_fourier(harmonics, samples)
      self%fourier = self%equal
      system%problem%velocity_level = contact_options%velocity_level
      call begin(self, error)
   end subroutine set_up

   !> Go over to other harmonics and samples; the operating state and the contact solver stay.
   subroutine resample(self, harmonics, samples)
      class(periodic_balance_t), intent(inout) :: self
      !> H and N > 2H
      integer, intent(in) :: harmonics, samples

      self%equal = new_fourier(harmonics, samples)
      self%fourier = self%equal
      if (allocated(self%x)) deallocate (self%x, self%force)
      if (allocated(self%accepted)) deallocate (self%accepted)
      if (allocated(self%derivative)) deallocate (self%derivative)
      self%contact%can_go_onward = .false.
      self%resumes = .false.
   end subroutine resample

   !> What belongs to the operating state.
   subroutine begin(self, error)
      class(periodic_balance_t), intent(inout) :: self
      type(error_t), allocatable, intent(out) :: error

      associate (operating => self%operating)
         self%reaction = self%system%modal_force(operating%contact%force)
         self%sensor = self%system%sensor_values(operating%modal, operating%contact%force, operating%amplitude)
      end associate
      self%resumes = .false.
      call self%contact%set_up(self%system, self%operating, self%contact_options, error)
   end subroutine begin

   !> Number of Fourier coefficients.
   pure integer function unknowns(self)
      class(periodic_balance_t), intent(in) :: self
      unknowns = self%system%n_modes*self%fourier%columns()
   end function unknowns

   !> Contact options with which the forces are found to this accuracy: as they are, or a finer tolerance.
   function fit_contact(options, system, operating, accuracy) result(fitting)
      type(contact_options_t), intent(in) :: options
      type(jointed_system_t), intent(in) :: system
      type(operating_state_t), intent(in) :: operating
      !> N per unit of the modal coordinate
      real(wp), intent(in) :: accuracy
      type(contact_options_t) :: fitting
      real(wp) :: largest

      fitting = options
      largest = maxval(abs(system%modal_force(operating%contact%force)))
      if (largest > 0.0_wp) fitting%tolerance = min(options%tolerance, max(finest_contact, accuracy/largest))
   end function fit_contact

   !> Contact forces of a motion, F(x); `cycle` tells whether they could be found. They repeat to the contact solver's
   !> accuracy or, with `rest` and `accuracy`, as well as the balance rest - F = 0 needs.
   subroutine evaluate(self, x, first, rest, accuracy)
      class(periodic_balance_t), intent(inout) :: self
      !> (modes columns)
      real(wp), intent(in) :: x(:)
      !> Begin at the operating state (default), not at the end of the motion that was accepted last even if that is near
      logical, intent(in), optional :: first
      !> (modes, 2H + 1) N per unit of the modal coordinate
      real(wp), intent(in), optional :: rest(:, :), accuracy
      real(wp) :: change(self%unknowns()), missed(self%unknowns()), old_x(self%unknowns()), old_force(self%unknowns())
      integer :: n
      logical :: learns, onward

      n = self%system%n_modes
      learns = allocated(self%x) .and. allocated(self%derivative)
      if (learns) then
         old_x = reshape(self%x, [size(old_x)])
         old_force = reshape(self%force, [size(old_x)])
      end if
      self%x = reshape(x, [n, self%fourier%columns()])
      onward = .false.
      if (present(first)) onward = .not. first
      if (onward) onward = self%contact%can_go_onward
      if (onward) onward = norm2(self%x - self%accepted) <= near*norm2(self%x)
      onward = onward .or. self%resumes
      self%resumes = .false.
      if (.not. onward) self%fourier = self%equal
      call find_drivers(self)
      call self%contact%begin(onward, self%cycle)
      do
         call self%contact%march_period(self%system, self%q, self%cycle)
         if (self%cycle%unconverged == 0 .and. self%cycle%periods < max_periods) then
            if (splits(self)) cycle
         end if
         call find_force(self)
         if (present(rest)) then
            self%settled = self%cycle%unconverged == 0 .and. self%cycle%last_change <= max(accuracy, self%cycle%noise, &
               & small_change*maxval(abs(rest - self%force)))
         else
            self%settled = self%cycle%repeats()
         end if
         if (self%settled .or. self%cycle%unconverged > 0 .or. self%cycle%periods >= max_periods) exit
      end do
      if (.not. (learns .and. self%settled)) return
      change = x - old_x
      if (.not. norm2(change) > 0.0_wp) return
      missed = reshape(self%force, [size(x)]) - old_force - matmul(self%derivative, change)
      change = change/dot_product(change, change)
      do n = 1, size(x)
         self%derivative(:, n) = self%derivative(:, n) + missed*change(n)
      end do
   end subroutine evaluate

   !> Modal coordinates and load amplitudes at the samples.
   subroutine find_drivers(self)
      class(periodic_balance_t), intent(inout) :: self
      integer :: n

      n = self%system%n_modes
      self%q = spread([self%operating%modal, self%operating%amplitude], 2, self%fourier%samples)
      self%q(:n, :) = self%q(:n, :) + matmul(self%x, self%fourier%basis)
      if (self%load > 0) self%q(n + self%load, :) = self%q(n + self%load, :) + self%level*self%fourier%basis(2, :)
   end subroutine find_drivers

   !> F of the last period.
   subroutine find_force(self)
      class(periodic_balance_t), intent(inout) :: self
      self%force = matmul(self%cycle%reaction - spread(self%reaction, 2, self%fourier%samples), &
         & transpose(self%fourier%projection))
   end subroutine find_force

   !> Split intervals over which the forces jump; whether there were any: the march then goes on with these samples.
   logical function splits(self)
      class(periodic_balance_t), intent(inout) :: self
      logical, allocatable :: jumping(:)
      real(wp), allocatable :: jump(:), width(:), slope(:), bend(:)
      real(wp) :: w

      w = 2.0_wp*pi/self%equal%samples
      jump = self%cycle%jumps()
      width = self%fourier%widths()
      slope = jump/width
      ! In its first period a march comes from elsewhere.
      if (self%cycle%periods == 1) slope(1) = slope(2)
      bend = max(abs(slope - cshift(slope, 1)), abs(slope - cshift(slope, -1)))
      jumping = self%fourier%can_be_split() .and. (jump > max(largest_jump, 2.0_wp*w) .or. &
         & min(0.5_wp*width*jump, 0.125_wp*width**2*bend) > max(largest_error, 0.25_wp*w**3) .or. &
         & width > widest_beside*min(cshift(width, 1), cshift(width, -1)))
      if (self%cycle%periods == 1) jumping(1) = .false.
      splits = any(jumping) .and. self%fourier%samples <= most_added*self%equal%samples
      if (.not. splits) return
      self%fourier = self%fourier%refined(jumping)
      call find_drivers(self)
      call self%cycle%restart()
   end function splits

   !> Take the last evaluation for one to be corrected: the next ones can begin where its march ended.
   subroutine accept(self)
      class(periodic_balance_t), intent(inout) :: self
      self%accepted = self%x
      call self%contact%accept(self%cycle)
   end subroutine accept

   !> What the contact forces of the last evaluation may be wrong by because they do not repeat as well as they should;
   !> huge where they were not found. A motion is no solution before this is small.
   pure real(wp) function doubt(self)
      class(periodic_balance_t), intent(in) :: self

      doubt = 0.0_wp
      if (.not. self%settled) doubt = self%cycle%last_change
      if (self%cycle%unconverged > 0) doubt = huge(1.0_wp)
   end function doubt

   !> omega^2 x'' + omega (D + delta I) x' + Khat x, (modes, 2H + 1).
   pure function linear_force(self, x, omega, delta) result(f)
      class(periodic_balance_t), intent(in) :: self
      !> (modes, 2H + 1)
      real(wp), intent(in) :: x(:, :)
      !> rad/s, 1/s
      real(wp), intent(in) :: omega, delta
      real(wp) :: f(size(x, 1), size(x, 2)), velocity(size(x, 1), size(x, 2))

      velocity = omega*self%fourier%phase_derivative(x)
      f = matmul(self%system%stiffness, x) + omega*self%fourier%phase_derivative(velocity) &
         & + spread(self%system%damping + delta, 2, size(x, 2))*velocity
   end function linear_force

   !> Compute dF/dx at the last evaluation from the contact states.
   subroutine renew_derivative(self, error)
      class(periodic_balance_t), intent(inout) :: self
      type(error_t), allocatable, intent(out) :: error

      real(wp), allocatable :: whole(:, :)
      integer, allocatable :: rows(:)
      integer :: c, k, n

      if (.not. allocated(self%derivative)) allocate (self%derivative(self%unknowns(), self%unknowns()))
      if (.not. self%level_varies) then
         call self%contact%derivative(self%system, self%fourier, self%cycle, 0, self%derivative, error)
         return
      end if
      n = self%system%n_modes
      allocate (whole((n + 1)*self%fourier%columns(), (n + 1)*self%fourier%columns()))
      call self%contact%derivative(self%system, self%fourier, self%cycle, self%load, whole, error)
      if (allocated(error)) return
      rows = [(((c - 1)*(n + 1) + k, k=1, n), c=1, self%fourier%columns())]
      self%derivative = whole(rows, rows)
      ! The load is level cos(tau): the second column of the series.
      self%by_level = whole(rows, 2*(n + 1))
   end subroutine renew_derivative

   !> Derivative of linear_force - F by x, (modes columns, modes columns), with dF/dx as it is known.
   subroutine stiffness_matrix(self, omega, delta, matrix)
      class(periodic_balance_t), intent(in) :: self
      !> rad/s, 1/s
      real(wp), intent(in) :: omega, delta
      real(wp), intent(out) :: matrix(:, :)
      integer :: c, h, k, m, n

      n = self%system%n_modes
      matrix = -self%derivative
      do c = 1, self%fourier%columns()
         k = (c - 1)*n
         h = c/2
         matrix(k + 1:k + n, k + 1:k + n) = matrix(k + 1:k + n, k + 1:k + n) + self%system%stiffness
         do m = k + 1, k + n
            matrix(m, m) = matrix(m, m) - (h*omega)**2
            if (c == 2*h) then
               matrix(m, m + n) = matrix(m, m + n) + h*omega*(self%system%damping(m - k) + delta)
            else if (c > 1) then
               matrix(m, m - n) = matrix(m, m - n) - h*omega*(self%system%damping(m - k) + delta)
            end if
         end do
      end do
   end subroutine stiffness_matrix

   !> The last evaluation as a point of a curve.
   function describe(self) result(point)
      class(periodic_balance_t), intent(in) :: self
      type(response_point_t) :: point
      real(wp) :: u(size(self%sensor), self%fourier%samples)
      integer :: n

      n = self%system%n_modes
      u = matmul(transpose(self%system%sensor_modal), self%q(:n, :)) &
         & + matmul(transpose(self%system%sensor_load), self%q(n + 1:, :)) + self%cycle%output &
         & - spread(self%sensor, 2, self%fourier%samples)
      point%modal = self%x
      point%sensor = matmul(u, transpose(self%fourier%projection))
      point%amplitude = norm2(point%sensor(self%sensors, 2:))
      point%peak = maxval(norm2(u(self%sensors, :) - spread(point%sensor(self%sensors, 1), 2, size(u, 2)), dim=1))
      n = self%sensors(maxloc(norm2(point%sensor(self%sensors, 2:3), dim=2), dim=1))
      point%phase = atan2(-point%sensor(n, 3), point%sensor(n, 2))
      point%counts = self%cycle%counts
      point%periods = self%cycle%periods
      point%repeat_error = self%cycle%repeat_error
      point%friction_loss = self%cycle%friction_loss
   end function describe

   !> March a solution on until it is known that it stays one: what is missing in its balance, and all that later periods may
   !> change, within what is allowed. The points left out of the potential contact set are looked at; those that would
   !> close join.
   subroutine confirm(self, rest, allowed, missing, added, error)
      class(periodic_balance_t), intent(inout) :: self
      !> (modes, 2H + 1) rest - F = 0 is the balance
      real(wp), intent(in) :: rest(:, :)
      !> N per unit of the modal coordinate; largest part that is missing, later changes included. Where that is more than
      !> allowed, the motion must be corrected once more, and is marched onward from here.
      real(wp), intent(in) :: allowed
      real(wp), intent(out) :: missing
      !> Number of points that joined: the motion must be solved again
      integer, intent(out) :: added
      type(error_t), allocatable, intent(out) :: error
      logical, allocatable :: before(:)

      before = potential_points(self%system)
      missing = huge(1.0_wp)
      call self%contact%march_period(self%system, self%q, self%cycle, added, error)
      if (allocated(error)) return
      if (added > 0) then
         call carry_over(self%system, before, self%operating%contact)
         call begin(self, error)
         return
      end if
      do
         call find_force(self)
         if (self%cycle%unconverged > 0) exit
         missing = maxval(abs(rest - self%force)) + min(self%cycle%remaining, maxval(abs(self%cycle%reaction)))
         if (missing <= allowed .or. self%cycle%remaining <= max(repeat_share*allowed, self%cycle%noise)) exit
         if (self%cycle%periods >= max_periods) exit
         call self%contact%march_period(self%system, self%q, self%cycle)
      end do
      if (missing <= allowed) return
      call self%accept()
      self%resumes = .true.
   end subroutine confirm

   !> What of the balance of a motion is rounding: of the contact forces under the preload, and of the sums that they are
   !> balanced with, N per unit of the modal coordinate.
   real(wp) function noise_of(self, x)
      class(periodic_balance_t), intent(in) :: self
      !> (modes columns)
      real(wp), intent(in) :: x(:)
      real(wp) :: largest(self%system%n_modes)

      largest = maxval(abs(reshape(x, [self%system%n_modes, self%fourier%columns()])), 2)
      noise_of = rounding*(maxval(abs(self%reaction)) + maxval(matmul(abs(self%system%stiffness), largest)))
   end function noise_of

   !> N with equal spacing.
   pure integer function samples(self)
      class(periodic_balance_t), intent(in) :: self
      samples = self%equal%samples
   end function samples

   !> Harmonics beyond the series that twice the samples can tell.
   pure integer function spectrum_harmonics(self)
      class(periodic_balance_t), intent(in) :: self
      spectrum_harmonics = max(self%equal%harmonics, min(self%equal%samples - 1, spectrum*self%equal%harmonics))
   end function spectrum_harmonics

   !> What the harmonics beyond the series would add to the velocity of the sensor where they all meet, over the size of its
   !> velocity.
   real(wp) function neglected_velocity(self, point, omega, delta)
      class(periodic_balance_t), intent(inout) :: self
      !> The last motion
      type(response_point_t), intent(in) :: point
      real(wp), intent(in) :: omega, delta
      real(wp), allocatable :: x(:, :), u(:, :)
      real(wp) :: whole, beyond
      type(error_t), allocatable :: error
      integer :: h

      neglected_velocity = 0.0_wp
      call self%neglected(omega, delta, max(self%equal%harmonics, min((self%equal%samples - 1)/2, &
         & spectrum*self%equal%harmonics)), x, error)
      if (allocated(error)) return
      u = matmul(transpose(self%system%sensor_modal(:, self%sensors)), x)
      beyond = 0.0_wp
      do h = self%equal%harmonics + 1, (size(u, 2) - 1)/2
         beyond = beyond + h*norm2(u(:, 2*h:2*h + 1))
      end do
      whole = norm2(self%fourier%phase_derivative(point%sensor(self%sensors, :)))
      if (whole > 0.0_wp) neglected_velocity = beyond/whole
   end function neglected_velocity

   !> Harmonics of the last motion beyond the series, (modes, 2 harmonics + 1): what the forces of its contact would move.
   !> Columns of the series are zero. The contact answers on average as it does to the highest harmonic of the series.
   subroutine neglected(self, omega, delta, harmonics, x, error, seen_by)
      class(periodic_balance_t), intent(inout) :: self
      !> rad/s, 1/s: as in `linear_force`
      real(wp), intent(in) :: omega, delta
      !> Up to which
      integer, intent(in) :: harmonics
      real(wp), allocatable, intent(out) :: x(:, :)
      type(error_t), allocatable, intent(out) :: error
      !> Another balance that has evaluated the same motion, with more samples
      class(periodic_balance_t), intent(in), optional :: seen_by
      type(error_t), allocatable :: singular
      real(wp), allocatable :: force(:, :), stiffness(:, :), matrix(:, :), b(:, :)
      integer :: c, h, k, n

      n = self%system%n_modes
      allocate (x(n, 2*harmonics + 1), source=0.0_wp)
      if (.not. allocated(self%derivative)) call self%renew_derivative(error)
      if (allocated(error)) return
      if (present(seen_by)) then
         force = series_coefficients(seen_by%fourier, seen_by%cycle%reaction, harmonics)
      else
         force = series_coefficients(self%fourier, self%cycle%reaction, harmonics)
      end if
      c = n*(self%fourier%columns() - 2)
      stiffness = self%system%stiffness - 0.5_wp*(self%derivative(c + 1:c + n, c + 1:c + n) &
         & + self%derivative(c + n + 1:c + 2*n, c + n + 1:c + 2*n))
      allocate (matrix(2*n, 2*n), b(2*n, 1))
      do h = self%fourier%harmonics + 1, harmonics
         matrix = 0.0_wp
         matrix(:n, :n) = stiffness
         matrix(n + 1:, n + 1:) = stiffness
         do k = 1, n
            matrix(k, k) = matrix(k, k) - (h*omega)**2
            matrix(n + k, n + k) = matrix(n + k, n + k) - (h*omega)**2
            matrix(k, n + k) = h*omega*(self%system%damping(k) + delta)
            matrix(n + k, k) = -matrix(k, n + k)
         end do
         b(:, 1) = [force(:, 2*h), force(:, 2*h + 1)]
         call solve_general(matrix, b, singular)
         if (.not. allocated(singular)) x(:, 2*h:2*h + 1) = reshape(b, [n, 2])
      end do
   end subroutine neglected

end module microslip_analysis_periodic_balance
