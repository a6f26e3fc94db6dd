!> The balance of harmonics of a jointed structure (METHOD section 7), shared by forced response and nonlinear modes.
!>
!> x: Fourier coefficients of d_i less the operating state, (modes, 2H + 1). With ' the derivative by tau = omega t:
!>     omega^2 x'' + omega (D + delta I) x' + Khat x  =  f_ex + F(x)
!> F: coefficients of R^T lambda less that of the operating state, from samples of the motion. The boundary follows
!> d_i in every sample, so that it needs no series. dF/dx is kept: computed from the contact states when asked for,
!> improved by Broyden's rank-one update with every evaluation.
module microslip_analysis_periodic_balance
   use microslip_analysis_fourier, only: fourier_t, new_fourier
   use microslip_analysis_operating_state, only: operating_state_t
   use microslip_analysis_periodic_contact, only: contact_cycle_t, periodic_contact_t
   use microslip_analysis_potential_set, only: carry_over, potential_points
   use microslip_analysis_response_point, only: response_point_t
   use microslip_contact_factory, only: contact_options_t
   use microslip_core_error, only: error_t
   use microslip_core_kinds, only: wp
   use microslip_system_jointed_system, only: jointed_system_t
   implicit none(type, external)
   private

   public :: periodic_balance_t, repeat_share

   !> Periods after which a march that does not repeat is given up.
   integer, parameter :: max_periods = 25
   !> Change of the forces over a period, in parts of what is missing in the balance, from which marching on would not help.
   real(wp), parameter :: small_change = 0.03_wp

   !> Change of a motion, in parts of itself, up to which its march goes onward from where that before the change ended: what
   !> points remember of another motion may take many periods to be forgotten.
   real(wp), parameter :: near = 0.02_wp
   !> How well forces should repeat, in parts of the residual that is tolerated.
   real(wp), parameter :: repeat_share = 0.1_wp

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
      !> (drivers, samples) of the last evaluation
      real(wp), allocatable, private :: q(:, :)
      !> (modes columns, modes columns) dF/dx
      real(wp), allocatable, private :: derivative(:, :)
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
      procedure :: check_left_out
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
      self%fourier = new_fourier(harmonics, samples)
      system%problem%velocity_level = contact_options%velocity_level
      call begin(self, error)
   end subroutine set_up

   !> What belongs to the operating state.
   subroutine begin(self, error)
      class(periodic_balance_t), intent(inout) :: self
      type(error_t), allocatable, intent(out) :: error

      associate (operating => self%operating)
         self%reaction = self%system%modal_force(operating%contact%force)
         self%sensor = self%system%sensor_values(operating%modal, operating%contact%force, operating%amplitude)
      end associate
      call self%contact%set_up(self%system, self%operating, self%contact_options, error)
   end subroutine begin

   !> Number of Fourier coefficients.
   pure integer function unknowns(self)
      class(periodic_balance_t), intent(in) :: self
      unknowns = self%system%n_modes*self%fourier%columns()
   end function unknowns

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
      self%q = spread([self%operating%modal, self%operating%amplitude], 2, self%fourier%samples)
      self%q(:n, :) = self%q(:n, :) + matmul(self%x, self%fourier%basis)
      if (self%load > 0) self%q(n + self%load, :) = self%q(n + self%load, :) + self%level*self%fourier%basis(2, :)
      onward = .false.
      if (present(first)) onward = .not. first
      if (onward) onward = norm2(self%x - self%accepted) <= near*norm2(self%x)
      call self%contact%begin(onward, self%cycle)
      do
         call self%contact%march_period(self%system, self%q, self%cycle)
         self%force = matmul(self%cycle%reaction - spread(self%reaction, 2, self%fourier%samples), &
            & transpose(self%fourier%projection))
         self%settled = self%cycle%repeats()
         if (present(rest)) self%settled = self%settled .or. self%cycle%unconverged == 0 .and. &
            & self%cycle%last_change <= max(accuracy, small_change*maxval(abs(rest - self%force)))
         if (self%settled .or. self%cycle%unconverged > 0 .or. self%cycle%periods == max_periods) exit
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

      if (.not. allocated(self%derivative)) allocate (self%derivative(self%unknowns(), self%unknowns()))
      call self%contact%derivative(self%system, self%fourier, self%cycle, self%derivative, error)
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
      n = self%sensors(maxloc(norm2(point%sensor(self%sensors, 2:3), dim=2), dim=1))
      point%phase = atan2(-point%sensor(n, 3), point%sensor(n, 2))
      point%counts = self%cycle%counts
      point%periods = self%cycle%periods
      point%repeat_error = self%cycle%repeat_error
      point%friction_loss = self%cycle%friction_loss
   end function describe

   !> Look at the points left out of the potential contact set in the last motion; those that would close join.
   subroutine check_left_out(self, added, error)
      class(periodic_balance_t), intent(inout) :: self
      !> Number of points that joined: the motion must be solved again
      integer, intent(out) :: added
      type(error_t), allocatable, intent(out) :: error

      logical, allocatable :: before(:)

      before = potential_points(self%system)
      call self%contact%check_left_out(self%system, self%q, self%cycle, added, error)
      if (allocated(error) .or. added == 0) return
      call carry_over(self%system, before, self%operating%contact)
      call begin(self, error)
   end subroutine check_left_out

end module microslip_analysis_periodic_balance
