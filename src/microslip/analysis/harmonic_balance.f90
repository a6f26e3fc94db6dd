!> Frequency response to a harmonic load by harmonic balance (METHOD section 7; paper, appendix B).
!>
!>     r = omega^2 x'' + omega D x' + Khat x - F(x) - level f e_cos = 0,       y = [x; omega]
!> x: Fourier coefficients of the modal coordinates, F: those of the contact forces (`periodic_balance_t`). r is scaled
!> by |level f|. Each level's curve is followed over the frequency by `trace_curve`, from the response of the
!> structure with all closed points stuck.
module microslip_analysis_harmonic_balance
   use microslip_analysis_continuation, only: correction_t, curve_options_t, curve_problem_t, curve_record_t, &
      & go_on, solve_again, trace_curve, why_ended
   use microslip_analysis_linear_modes, only: stuck_stiffness
   use microslip_analysis_operating_state, only: operating_state_t
   use microslip_analysis_periodic_balance, only: periodic_balance_t, repeat_share
   use microslip_analysis_response_point, only: response_point_t, response_recorder_t
   use microslip_contact_factory, only: contact_options_t
   use microslip_core_error, only: error_t, failure
   use microslip_core_kinds, only: wp, pi
   use microslip_core_text, only: to_text
   use microslip_linalg_dense, only: solve_general
   use microslip_system_jointed_system, only: jointed_system_t
   implicit none(type, external)
   private

   public :: harmonic_balance_options_t, run_harmonic_balance

   type :: harmonic_balance_options_t
      !> Index of the load in the system
      integer :: load = 0
      !> The directions of the sensor whose amplitude is told
      integer, allocatable :: sensors(:)
      !> Factors on the load pattern, one curve each
      real(wp), allocatable :: levels(:)
      !> Hz, from where to where
      real(wp) :: frequency_range(2) = 0.0_wp
      !> H and N
      integer :: harmonics = 5, samples = 50
      !> Longest step: Hz, or this part of the response, whichever is met first
      real(wp) :: frequency_step = 0.0_wp, response_step = 0.25_wp
      !> Shortest step, in parts of the longest
      real(wp) :: smallest_step = 1.0e-3_wp
      !> Largest residual over the load
      real(wp) :: tolerance = 1.0e-6_wp
      integer :: max_iterations = 12, max_points = 1000
   end type harmonic_balance_options_t

   !> The equations of one level.
   type, extends(curve_problem_t) :: forced_response_t
      type(periodic_balance_t) :: balance
      !> (modes) level f
      real(wp), allocatable :: load(:)
      !> Lengths of the frequency, Hz, and of the others
      real(wp) :: frequency_step = 0.0_wp, response_step = 0.0_wp
      !> Largest scaled residual of a point
      real(wp) :: tolerance = 0.0_wp
      class(response_recorder_t), pointer :: recorder => null()
   contains
      procedure :: residual
      procedure :: jacobian
      procedure :: lengths
      procedure :: take
   end type forced_response_t

contains

   !> The curves of all levels; what was found before a failure is with the recorder.
   subroutine run_harmonic_balance(system, operating, options, contact_options, recorder, records, error)
      !> Its potential contact set may grow
      type(jointed_system_t), intent(inout), target :: system
      !> It follows the potential contact set
      type(operating_state_t), intent(inout) :: operating
      type(harmonic_balance_options_t), intent(in) :: options
      type(contact_options_t), intent(in) :: contact_options
      class(response_recorder_t), intent(inout), target :: recorder
      !> (levels)
      type(curve_record_t), allocatable, intent(out) :: records(:)
      type(error_t), allocatable, intent(out) :: error
      type(forced_response_t) :: problem
      type(curve_options_t) :: curve
      real(wp), allocatable :: start(:)
      integer :: k

      allocate (records(size(options%levels)))
      call problem%balance%set_up(system, operating, options%sensors, options%harmonics, options%samples, &
         & contact_options, error)
      if (allocated(error)) return
      problem%balance%load = options%load
      problem%frequency_step = options%frequency_step
      problem%response_step = options%response_step
      problem%tolerance = options%tolerance
      problem%recorder => recorder
      curve = curve_options_t(tolerance=options%tolerance, max_iterations=options%max_iterations, &
         & smallest_step=options%smallest_step, max_points=options%max_points)
      do k = 1, size(options%levels)
         problem%balance%level = options%levels(k)
         problem%load = options%levels(k)*system%load_modal(:, options%load)
         call stuck_response(problem, 2.0_wp*pi*options%frequency_range(1), start, error)
         if (.not. allocated(error)) call trace_curve(problem, start, 2.0_wp*pi*options%frequency_range(2), curve, &
            & records(k), error)
         operating = problem%balance%operating
         if (allocated(error)) return
         if (why_ended(records(k)) /= '') then
            call failure(error, 'harmonic balance, level '//to_text(options%levels(k))//': '//why_ended(records(k)))
            return
         end if
      end do
   end subroutine run_harmonic_balance

   !> Response with all closed points stuck, [x; omega].
   subroutine stuck_response(problem, omega, y, error)
      type(forced_response_t), intent(in) :: problem
      real(wp), intent(in) :: omega
      real(wp), allocatable, intent(out) :: y(:)
      type(error_t), allocatable, intent(out) :: error
      real(wp), allocatable :: stiffness(:, :), matrix(:, :), x(:, :)
      integer :: k, n

      associate (balance => problem%balance)
         call stuck_stiffness(balance%system, balance%operating%contact%status, stiffness, error)
         if (allocated(error)) return
         n = size(stiffness, 1)
         allocate (matrix(2*n, 2*n), x(2*n, 1), source=0.0_wp)
         matrix(:n, :n) = stiffness
         matrix(n + 1:, n + 1:) = stiffness
         do k = 1, n
            matrix(k, k) = matrix(k, k) - omega**2
            matrix(n + k, n + k) = matrix(n + k, n + k) - omega**2
            matrix(k, n + k) = omega*balance%system%damping(k)
            matrix(n + k, k) = -omega*balance%system%damping(k)
         end do
         x(:n, 1) = problem%load
         call solve_general(matrix, x, error)
         if (allocated(error)) return
         allocate (y(balance%unknowns() + 1), source=0.0_wp)
         y(n + 1:3*n) = x(:, 1)
         y(size(y)) = omega
      end associate
   end subroutine stuck_response

   !> r over |level f|; not small where the contact forces do not repeat.
   subroutine residual(self, y, first, r, error)
      class(forced_response_t), intent(inout) :: self
      real(wp), intent(in) :: y(:)
      logical, intent(in) :: first
      real(wp), intent(out) :: r(:)
      type(error_t), allocatable, intent(out) :: error
      real(wp), allocatable :: rest(:, :)
      real(wp) :: doubt
      integer :: n

      if (allocated(error)) return
      n = size(y) - 1
      rest = self%balance%linear_force(reshape(y(:n), [size(self%load), n/size(self%load)]), y(n + 1), 0.0_wp)
      rest(:, 2) = rest(:, 2) - self%load
      call self%balance%evaluate(y(:n), first, rest, repeat_share*self%tolerance*norm2(self%load))
      r = reshape(rest - self%balance%force, [size(r)])/norm2(self%load)
      doubt = self%balance%doubt()
      if (doubt > 0.0_wp) r(1) = merge(huge(1.0_wp), abs(r(1)) + doubt/norm2(self%load), doubt >= huge(1.0_wp))
   end subroutine residual

   !> Its derivative by [x; omega].
   subroutine jacobian(self, y, anew, J, error)
      class(forced_response_t), intent(inout) :: self
      real(wp), intent(in) :: y(:)
      logical, intent(in) :: anew
      real(wp), intent(out) :: J(:, :)
      type(error_t), allocatable, intent(out) :: error
      real(wp), allocatable :: by_omega(:, :)
      integer :: n

      n = size(J, 1)
      if (anew) call self%balance%renew_derivative(error)
      if (allocated(error)) return
      call self%balance%accept()
      associate (omega => y(size(y)), balance => self%balance)
         call balance%stiffness_matrix(omega, 0.0_wp, J(:, :n))
         by_omega = balance%fourier%phase_derivative(balance%x)
         by_omega = 2.0_wp*omega*balance%fourier%phase_derivative(by_omega) &
            & + spread(balance%system%damping, 2, size(by_omega, 2))*by_omega
         J(:, n + 1) = reshape(by_omega, [n])
         J = J/norm2(self%load)
      end associate
   end subroutine jacobian

   !> A part of the response, and the frequency step.
   function lengths(self, y) result(w)
      class(forced_response_t), intent(in) :: self
      real(wp), intent(in) :: y(:)
      real(wp) :: w(size(y))

      w = self%response_step*max(norm2(y(:size(y) - 1)), tiny(1.0_wp))
      w(size(w)) = 2.0_wp*pi*self%frequency_step
   end function lengths

   !> Check the points left out, and hand the point on.
   subroutine take(self, y, correction, verdict, error)
      class(forced_response_t), intent(inout) :: self
      real(wp), intent(in) :: y(:)
      type(correction_t), intent(in) :: correction
      integer, intent(out) :: verdict
      type(error_t), allocatable, intent(out) :: error
      type(response_point_t) :: point
      integer :: added

      verdict = solve_again
      call self%balance%check_left_out(added, error)
      if (allocated(error) .or. added > 0) return
      verdict = go_on
      point = self%balance%describe()
      point%level = self%balance%level
      point%frequency = y(size(y))/(2.0_wp*pi)
      point%correction = correction
      call self%recorder%record(point, error)
   end subroutine take

end module microslip_analysis_harmonic_balance
