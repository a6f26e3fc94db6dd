!> Nonlinear modes by the extended periodic motion concept (METHOD section 7; paper, section 3.3).
!>
!> The load is replaced by a negative damping, f_ex = 2 zeta omega v, that makes the free motion periodic:
!>     r = omega^2 x'' + omega (D - 2 zeta omega I) x' + Khat x - F(x) = 0,     x = a psi
!>     |psi_1|^2 = 1        (fundamental harmonic: a is the modal amplitude, the modal mass is the identity)
!>     phi^T psi_s,1 = 0    (phase: the linear mode phi is at its extreme at tau = 0)
!> y = [psi; omega/omega_0; zeta; log10 a] with the linear frequency omega_0; r is scaled by omega_0^2 a. The curve over a
!> begins with the linear mode about the operating state; where no motion is found from there at the first amplitude, it is
!> followed from one that leaves all points stuck.
module microslip_analysis_epmc
   use microslip_analysis_continuation, only: correction_t, curve_options_t, curve_problem_t, curve_record_t, &
      & ended_at_last, go_on, no_start, solve_again, step_to_curve, trace_curve, why_ended
   use microslip_analysis_operating_state, only: operating_state_t
   use microslip_analysis_periodic_balance, only: fit_contact, periodic_balance_t, repeat_share
   use microslip_analysis_response_point, only: response_point_t, no_velocity, much_velocity, response_recorder_t, truncation_t
   use microslip_contact_factory, only: contact_options_t
   use microslip_core_error, only: error_t, bad_input, failure
   use microslip_core_kinds, only: wp, pi
   use microslip_core_text, only: to_text
   use microslip_system_jointed_system, only: jointed_system_t
   implicit none(type, external)
   private

   public :: epmc_options_t, run_epmc

   !> Smallest part of the first amplitude to come from, and decades of a step on that way.
   real(wp), parameter :: smallest_amplitude = 1.0e-8_wp, path_decades = 0.25_wp

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
      !> (n + 1) the last point, and that of the largest neglected velocity
      real(wp), allocatable :: last(:), worst(:)
      real(wp) :: worst_velocity = -1.0_wp
      !> dF/dx as it was known there
      real(wp), allocatable :: worst_derivative(:, :)
      !> Points on the way to the first amplitude are not handed on
      logical :: on_the_way = .false.
   contains
      procedure :: residual
      procedure :: jacobian
      procedure :: lengths
      procedure :: take
   end type nonlinear_mode_t

contains

   !> The mode over its amplitude; what was found before a failure is with the recorder.
   subroutine run_epmc(system, operating, options, contact_options, recorder, record, error, truncation)
      !> Its potential contact set may grow
      type(jointed_system_t), intent(inout), target :: system
      !> It follows the potential contact set
      type(operating_state_t), intent(inout) :: operating
      type(epmc_options_t), intent(in) :: options
      type(contact_options_t), intent(in) :: contact_options
      class(response_recorder_t), intent(inout), target :: recorder
      type(curve_record_t), intent(out) :: record
      type(error_t), allocatable, intent(out) :: error
      !> What harmonics and samples miss
      type(truncation_t), intent(out), optional :: truncation
      type(nonlinear_mode_t) :: problem
      type(curve_options_t) :: curve
      real(wp), allocatable :: y(:)
      character(len=:), allocatable :: way
      real(wp) :: per_sensor, least

      way = ''
      least = minval(options%amplitude_range)/max(tiny(1.0_wp), &
         & maxval(norm2(matmul(reshape(options%shape, [1, size(options%shape)]), system%sensor_modal(:, options%sensors)), 1)))
      call problem%balance%set_up(system, operating, options%sensors, options%harmonics, options%samples, &
         & fit_contact(contact_options, system, operating, repeat_share*options%tolerance*(2.0_wp*pi*options%frequency)**2*least), &
         & error)
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
         call check_tolerance(problem, y, error)
         if (.not. allocated(error)) call trace_curve(problem, y, range(2), curve, record, error)
         if (.not. allocated(error) .and. record%reason == no_start) then
            call come_from_small_amplitude(problem, curve, y, way, error)
            if (.not. allocated(error) .and. way == '') call trace_curve(problem, y, range(2), curve, record, error)
         end if
      end associate
      operating = problem%balance%operating
      if (allocated(error)) return
      if (present(truncation) .and. record%points > 0) call estimate_truncation(problem, truncation)
      if (why_ended(record) /= '') call failure(error, 'epmc: '//why_ended(record)//way)
   end subroutine run_epmc

   !> A tolerance below what rounding leaves of the balance can not be met.
   subroutine check_tolerance(problem, y, error)
      type(nonlinear_mode_t), intent(in) :: problem
      !> The linear mode at the first amplitude
      real(wp), intent(in) :: y(:)
      type(error_t), allocatable, intent(out) :: error
      real(wp) :: a, floor

      a = 10.0_wp**y(size(y))
      floor = problem%balance%noise_of(a*y(:problem%balance%unknowns()))/(problem%omega**2*a)
      if (problem%tolerance < floor) call bad_input(error, '&epmc: tolerance = '//to_text(problem%tolerance) &
         & //' can not be reached at the first amplitude, rounding of the contact forces under the preload alone leaves '// &
         & 'more; allowed here: >= '//to_text(floor, 2))
   end subroutine check_tolerance

   !> The mode at the first amplitude, followed from one that leaves all closed points stuck.
   subroutine come_from_small_amplitude(problem, options, y, way, error)
      type(nonlinear_mode_t), intent(inout) :: problem
      type(curve_options_t), intent(in) :: options
      !> (n + 1) the linear mode on entry, the one that was found on return
      real(wp), intent(inout) :: y(:)
      !> How far it could be followed, blank if to the end
      character(len=:), allocatable, intent(out) :: way
      type(error_t), allocatable, intent(out) :: error
      type(curve_record_t) :: record
      real(wp) :: amplitude_step, decades, last

      way = ''
      amplitude_step = problem%amplitude_step
      last = y(size(y))
      decades = 0.0_wp
      do
         decades = decades - 1.0_wp
         call problem%balance%evaluate(10.0_wp**(last + decades)*y(:problem%balance%unknowns()))
         if (problem%balance%cycle%counts(3) == 0 .or. decades <= log10(smallest_amplitude)) exit
      end do
      y(size(y)) = last + decades
      problem%amplitude_step = path_decades
      problem%on_the_way = .true.
      call trace_curve(problem, y, last, options, record, error)
      problem%on_the_way = .false.
      problem%amplitude_step = amplitude_step
      if (allocated(error)) return
      if (allocated(problem%last)) y = problem%last
      if (record%reason /= ended_at_last) way = '; from a small amplitude it could be followed to ' &
         & //to_text(10.0_wp**(y(size(y)) - last), 3)//' of the first one'
   end subroutine come_from_small_amplitude

   !> What harmonics and samples miss at the point of the curve where most is missing.
   subroutine estimate_truncation(problem, truncation)
      type(nonlinear_mode_t), intent(inout) :: problem
      type(truncation_t), intent(out) :: truncation
      type(nonlinear_mode_t) :: fine
      type(response_point_t) :: point
      type(error_t), allocatable :: error
      real(wp), allocatable :: y(:), r(:), fine_y(:), fine_r(:), step(:), beyond(:, :)
      real(wp) :: a, change(2, 2)
      integer :: harmonics, k, m, n
      logical :: fresh

      y = problem%worst
      associate (balance => problem%balance)
         m = balance%system%n_modes
         n = size(y) - 3
         a = 10.0_wp**y(n + 3)
         harmonics = balance%spectrum_harmonics()
         allocate (r(n + 2), step(n + 3))
         call problem%residual(y, .true., r, error)
         if (allocated(error)) return
         ! Computing it anew would take most of the time of the estimate.
         fresh = problem%worst_velocity > much_velocity
         if (.not. fresh) balance%derivative = problem%worst_derivative
         point = balance%describe()
         fine%shape = problem%shape
         fine%omega = problem%omega
         fine%tolerance = problem%tolerance
         fine%balance = balance
         call fine%balance%resample(harmonics, 2*balance%samples())
         allocate (fine_y(fine%balance%unknowns() + 3), fine_r(fine%balance%unknowns() + 2), source=0.0_wp)
         fine_y(:n) = y(:n)
         fine_y(size(fine_y) - 2:) = y(n + 1:)
         do k = 1, 2
            call fine%residual(fine_y, k == 1, fine_r, error)
            if (allocated(error) .or. fine%balance%doubt() > 0.0_wp) return
            call fine%balance%accept()
            call step_to_curve(problem, y, [fine_r(:n), fine_r(size(fine_r) - 1:)], .true., fresh .and. k == 1, step, error)
            if (allocated(error)) return
            change(:, k) = step([n + 2, n + 1])/y([n + 2, n + 1])
            if (k == 2 .or. problem%worst_velocity < no_velocity) exit
            call balance%neglected(problem%omega*y(n + 1), -2.0_wp*y(n + 2)*problem%omega*y(n + 1), harmonics, beyond, error, &
               & fine%balance)
            if (allocated(error)) return
            fine_y(n + 1:size(fine_y) - 3) = reshape(beyond(:, n/m + 1:), [size(fine_y) - 3 - n])/a
         end do
         truncation%frequency = problem%omega*y(n + 1)/(2.0_wp*pi)
         truncation%amplitude = point%amplitude
         truncation%by_samples = change(:, 1)
         truncation%by_both = change(:, min(k, 2))
         truncation%known = .true.
      end associate
   end subroutine estimate_truncation

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
      rest = rest_of(self, y)
      call self%balance%evaluate(a*y(:n), first, rest, repeat_share*self%tolerance*self%omega**2*a)
      r(:n) = reshape(rest - self%balance%force, [n])/(self%omega**2*a)
      r(n + 1) = sum(psi(:, 2:3)**2) - 1.0_wp
      r(n + 2) = dot_product(self%shape, psi(:, 3))
      doubt = self%balance%doubt()
      if (doubt > 0.0_wp) r(1) = merge(huge(1.0_wp), abs(r(1)) + doubt/(self%omega**2*a), doubt >= huge(1.0_wp))
   end subroutine residual

   !> The balance but for the contact forces, (modes, 2H + 1).
   function rest_of(self, y) result(rest)
      class(nonlinear_mode_t), intent(in) :: self
      real(wp), intent(in) :: y(:)
      real(wp), allocatable :: rest(:, :)
      real(wp), allocatable :: psi(:, :)
      integer :: n

      n = size(y) - 3
      psi = reshape(y(:n), [size(self%shape), n/size(self%shape)])
      associate (omega => self%omega*y(n + 1), zeta => y(n + 2))
         rest = self%balance%linear_force(10.0_wp**y(n + 3)*psi, omega, -2.0_wp*zeta*omega)
      end associate
   end function rest_of

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

   !> See whether the point stays one, check the points left out, and hand it on.
   subroutine take(self, y, correction, verdict, error)
      class(nonlinear_mode_t), intent(inout) :: self
      real(wp), intent(in) :: y(:)
      type(correction_t), intent(in) :: correction
      integer, intent(out) :: verdict
      type(error_t), allocatable, intent(out) :: error
      type(response_point_t) :: point
      real(wp) :: missing, scale
      integer :: added, n

      n = size(y) - 3
      scale = self%omega**2*10.0_wp**y(n + 3)
      verdict = solve_again
      call self%balance%confirm(rest_of(self, y), self%tolerance*scale, missing, added, error)
      if (allocated(error) .or. added > 0 .or. missing > self%tolerance*scale) return
      verdict = go_on
      self%last = y
      if (self%on_the_way) return
      point = self%balance%describe()
      point%frequency = self%omega*y(n + 1)/(2.0_wp*pi)
      point%damping_ratio = y(n + 2)
      point%modal_amplitude = 10.0_wp**y(n + 3)
      point%correction = correction
      point%correction%residual = max(correction%residual, missing/scale)
      point%neglected_velocity = self%balance%neglected_velocity(point, self%omega*y(n + 1), &
         & -2.0_wp*y(n + 2)*self%omega*y(n + 1))
      if (point%neglected_velocity > self%worst_velocity) then
         self%worst = y
         self%worst_derivative = self%balance%derivative
         self%worst_velocity = point%neglected_velocity
      end if
      call self%recorder%record(point, error)
   end subroutine take

end module microslip_analysis_epmc
