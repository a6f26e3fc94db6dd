!> Nonlinear modes by the extended periodic motion concept (METHOD section 7; paper, section 3.3).
!>
!> The load is replaced by a negative damping, f_ex = 2 zeta omega v, that makes the free motion periodic:
!>     r = omega^2 x'' + omega (D - 2 zeta omega I) x' + Khat x - F(x) = 0,     x = a psi
!>     |psi_1|^2 = 1        (fundamental harmonic: a is the modal amplitude, the modal mass is the identity)
!>     phi^T psi_s,1 = 0    (phase: the linear mode phi is at its extreme at tau = 0)
!> y = [psi; omega/omega_0; zeta; log10 a] with the linear frequency omega_0; r is scaled by omega_0^2 a. The curve over a
!> begins with the linear mode about the operating state.
module microslip_analysis_epmc
   use microslip_analysis_continuation, only: correction_t, curve_options_t, curve_problem_t, curve_record_t, &
      & go_on, solve_again, trace_curve, why_ended
   use microslip_analysis_operating_state, only: operating_state_t
   use microslip_analysis_periodic_balance, only: periodic_balance_t, repeat_share
   use microslip_analysis_response_point, only: response_point_t, response_recorder_t
   use microslip_contact_factory, only: contact_options_t
   use microslip_core_error, only: error_t, failure
   use microslip_core_kinds, only: wp, pi
   use microslip_system_jointed_system, only: jointed_system_t
   implicit none(type, external)
   private

   public :: epmc_options_t, run_epmc

   type :: epmc_options_t
      !> (modes) linear mode about the operating state, of unit modal mass, and its frequency in Hz
      real(wp), allocatable :: shape(:)
      real(wp) :: frequency = 0.0_wp
      !> The directions of the sensor that the amplitudes refer to
      integer, allocatable :: sensors(:)
      !> m, first and last amplitude at the sensor, by the shape of the linear mode
      real(wp) :: amplitude_range(2) = 0.0_wp
      !> Points on the curve if no step need be shortened
      integer :: points = 20
      !> H and N
      integer :: harmonics = 5, samples = 50
      !> Longest step: relative change of shape, frequency or damping
      real(wp) :: response_step = 0.5_wp
      !> Shortest step, in parts of the longest
      real(wp) :: smallest_step = 1.0e-3_wp
      !> Largest residual over the restoring force of the linear mode
      real(wp) :: tolerance = 1.0e-8_wp
      integer :: max_iterations = 12, max_points = 1000
   end type epmc_options_t

   type, extends(curve_problem_t) :: nonlinear_mode_t
      type(periodic_balance_t) :: balance
      !> (modes)
      real(wp), allocatable :: shape(:)
      !> omega_0, rad/s
      real(wp) :: omega = 0.0_wp
      !> Lengths of log10 a and of the others
      real(wp) :: amplitude_step = 0.0_wp, response_step = 0.0_wp
      !> Largest scaled residual of a point
      real(wp) :: tolerance = 0.0_wp
      class(response_recorder_t), pointer :: recorder => null()
   contains
      procedure :: residual
      procedure :: jacobian
      procedure :: lengths
      procedure :: take
   end type nonlinear_mode_t

contains

   !> The mode over its amplitude; what was found before a failure is with the recorder.
   subroutine run_epmc(system, operating, options, contact_options, recorder, record, error)
      !> Its potential contact set may grow
      type(jointed_system_t), intent(inout), target :: system
      !> It follows the potential contact set
      type(operating_state_t), intent(inout) :: operating
      type(epmc_options_t), intent(in) :: options
      type(contact_options_t), intent(in) :: contact_options
      class(response_recorder_t), intent(inout), target :: recorder
      type(curve_record_t), intent(out) :: record
      type(error_t), allocatable, intent(out) :: error
      type(nonlinear_mode_t) :: problem
      type(curve_options_t) :: curve
      real(wp), allocatable :: y(:)
      real(wp) :: per_sensor

      call problem%balance%set_up(system, operating, options%sensors, options%harmonics, options%samples, &
         & contact_options, error)
      if (allocated(error)) return
      problem%shape = options%shape
      problem%omega = 2.0_wp*pi*options%frequency
      problem%response_step = options%response_step
      problem%tolerance = options%tolerance
      problem%recorder => recorder
      call modal_amplitude_per_sensor(problem, options, per_sensor, error)
      if (allocated(error)) return
      associate (range => log10(options%amplitude_range*per_sensor))
         problem%amplitude_step = abs(range(2) - range(1))/max(1, options%points - 1)
         curve = curve_options_t(tolerance=options%tolerance, max_iterations=options%max_iterations, first_step=1.0_wp, &
            & smallest_step=options%smallest_step, max_points=options%max_points)
         y = linear_mode(problem, range(1))
         call trace_curve(problem, y, range(2), curve, record, error)
      end associate
      operating = problem%balance%operating
      if (.not. allocated(error) .and. why_ended(record) /= '') call failure(error, 'epmc: '//why_ended(record))
   end subroutine run_epmc

   !> Modal amplitude of the linear mode per amplitude at the sensor, sqrt(kg).
   subroutine modal_amplitude_per_sensor(problem, options, per_sensor, error)
      type(nonlinear_mode_t), intent(inout) :: problem
      type(epmc_options_t), intent(in) :: options
      real(wp), intent(out) :: per_sensor
      type(error_t), allocatable, intent(out) :: error
      type(response_point_t) :: point
      real(wp), allocatable :: y(:)
      real(wp) :: seen, a

      seen = norm2(matmul(problem%shape, problem%balance%system%sensor_modal(:, options%sensors)))
      ! What a sensor does not see as a whole it may see by the contact forces.
      if (seen <= sqrt(epsilon(1.0_wp))*norm2(problem%shape)) seen = norm2(problem%shape)
      a = minval(options%amplitude_range)/seen
      y = linear_mode(problem, log10(a))
      call problem%balance%evaluate(a*y(:problem%balance%unknowns()))
      point = problem%balance%describe()
      if (.not. point%amplitude > epsilon(1.0_wp)*a*norm2(problem%shape)) then
         call failure(error, 'epmc: the sensor does not see the mode')
      else
         per_sensor = a/point%amplitude
      end if
   end subroutine modal_amplitude_per_sensor

   !> [psi; omega/omega_0; zeta; log10 a] of the linear mode.
   pure function linear_mode(problem, log_amplitude) result(y)
      type(nonlinear_mode_t), intent(in) :: problem
      real(wp), intent(in) :: log_amplitude
      real(wp) :: y(problem%balance%unknowns() + 3)
      integer :: n

      n = size(problem%shape)
      y = 0.0_wp
      y(n + 1:2*n) = problem%shape
      y(size(y) - 2:) = [1.0_wp, 0.5_wp*dot_product(problem%shape, problem%balance%system%damping*problem%shape) &
         & /problem%omega, log_amplitude]
   end function linear_mode

   !> r over omega_0^2 a, amplitude and phase condition; not small where the contact forces do not repeat.
   subroutine residual(self, y, first, r, error)
      class(nonlinear_mode_t), intent(inout) :: self
      real(wp), intent(in) :: y(:)
      logical, intent(in) :: first
      real(wp), intent(out) :: r(:)
      type(error_t), allocatable, intent(out) :: error
      real(wp), allocatable :: rest(:, :), psi(:, :)
      real(wp) :: a, doubt
      integer :: n

      if (allocated(error)) return
      n = size(y) - 3
      a = 10.0_wp**y(n + 3)
      psi = reshape(y(:n), [size(self%shape), n/size(self%shape)])
      associate (omega => self%omega*y(n + 1), zeta => y(n + 2))
         rest = self%balance%linear_force(a*psi, omega, -2.0_wp*zeta*omega)
      end associate
      call self%balance%evaluate(a*y(:n), first, rest, repeat_share*self%tolerance*self%omega**2*a)
      r(:n) = reshape(rest - self%balance%force, [n])/(self%omega**2*a)
      r(n + 1) = sum(psi(:, 2:3)**2) - 1.0_wp
      r(n + 2) = dot_product(self%shape, psi(:, 3))
      doubt = self%balance%doubt()
      if (doubt > 0.0_wp) r(1) = merge(huge(1.0_wp), abs(r(1)) + doubt/(self%omega**2*a), doubt >= huge(1.0_wp))
   end subroutine residual

   !> Its derivative.
   subroutine jacobian(self, y, anew, J, error)
      class(nonlinear_mode_t), intent(inout) :: self
      real(wp), intent(in) :: y(:)
      logical, intent(in) :: anew
      real(wp), intent(out) :: J(:, :)
      type(error_t), allocatable, intent(out) :: error
      real(wp), allocatable :: x(:, :), velocity(:, :), acceleration(:, :)
      real(wp) :: omega, zeta, a, scale
      integer :: m, n

      if (anew) call self%balance%renew_derivative(error)
      if (allocated(error)) return
      call self%balance%accept()
      n = size(y) - 3
      m = self%balance%system%n_modes
      omega = self%omega*y(n + 1)
      zeta = y(n + 2)
      a = 10.0_wp**y(n + 3)
      scale = self%omega**2*a
      x = self%balance%x
      velocity = self%balance%fourier%phase_derivative(x)
      acceleration = self%balance%fourier%phase_derivative(velocity)
      J = 0.0_wp
      call self%balance%stiffness_matrix(omega, -2.0_wp*zeta*omega, J(:n, :n))
      ! r by log10 a: (dr/dx x - r) ln 10, with r as it is.
      J(:n, n + 3) = log(10.0_wp)*(matmul(J(:n, :n), reshape(x, [n])) - reshape( &
         & self%balance%linear_force(x, omega, -2.0_wp*zeta*omega) - self%balance%force, [n]))/scale
      J(:n, :n) = J(:n, :n)*(a/scale)
      J(:n, n + 1) = reshape(2.0_wp*omega*acceleration &
         & + spread(self%balance%system%damping - 4.0_wp*zeta*omega, 2, size(x, 2))*velocity, [n])*(self%omega/scale)
      J(:n, n + 2) = reshape(-2.0_wp*omega**2*velocity, [n])/scale
      J(n + 1, m + 1:3*m) = 2.0_wp*reshape(x(:, 2:3), [2*m])/a
      J(n + 2, 2*m + 1:3*m) = self%shape
   end subroutine jacobian

   !> A part of the shape, of the frequency, a hundredth of that in damping; the step of the amplitude.
   function lengths(self, y) result(w)
      class(nonlinear_mode_t), intent(in) :: self
      real(wp), intent(in) :: y(:)
      real(wp) :: w(size(y))

      w = self%response_step
      w(size(w)) = self%amplitude_step
   end function lengths

   !> Check the points left out, and hand the point on.
   subroutine take(self, y, correction, verdict, error)
      class(nonlinear_mode_t), intent(inout) :: self
      real(wp), intent(in) :: y(:)
      type(correction_t), intent(in) :: correction
      integer, intent(out) :: verdict
      type(error_t), allocatable, intent(out) :: error
      type(response_point_t) :: point
      integer :: added, n

      verdict = solve_again
      call self%balance%check_left_out(added, error)
      if (allocated(error) .or. added > 0) return
      verdict = go_on
      n = size(y) - 3
      point = self%balance%describe()
      point%frequency = self%omega*y(n + 1)/(2.0_wp*pi)
      point%damping_ratio = y(n + 2)
      point%modal_amplitude = 10.0_wp**y(n + 3)
      point%correction = correction
      call self%recorder%record(point, error)
   end subroutine take

end module microslip_analysis_epmc
