!> Frequency response to a harmonic load by harmonic balance (METHOD section 7; paper, appendix B).
!>
!>     r = omega^2 x'' + omega D x' + Khat x - F(x) - level f e_cos = 0,       y = [x; omega]
!> x: Fourier coefficients of the modal coordinates, F: those of the contact forces (`periodic_balance_t`). r is scaled
!> by |level f|. Each level's curve is followed over the frequency by `trace_curve`, from the response of the
!> structure with all closed points stuck. Where no motion is found from there (a body that slides as a whole moves
!> thousands of times further than it does when stuck), the response without friction is the next guess; then the response
!> at the first frequency is followed over the load, y = [x; log10(load over that of the level)]: down from a load so large that
!> friction hardly counts, or up from one that leaves all points stuck.
module microslip_analysis_harmonic_balance
   use microslip_analysis_continuation, only: correction_t, curve_options_t, curve_problem_t, curve_record_t, &
      & go_on, no_start, ended_at_last, solve_again, step_to_curve, trace_curve, why_ended
   use microslip_analysis_linear_modes, only: stuck_stiffness
   use microslip_analysis_operating_state, only: operating_state_t
   use microslip_analysis_periodic_balance, only: fit_contact, periodic_balance_t, repeat_share, spectrum
   use microslip_analysis_response_point, only: response_point_t, response_recorder_t, truncation_t, most_refinements, &
      & changes_on, no_velocity, much_velocity
   use microslip_contact_factory, only: contact_options_t
   use microslip_core_error, only: error_t, bad_input, failure
   use microslip_core_kinds, only: wp, pi
   use microslip_core_text, only: to_text
   use microslip_linalg_dense, only: solve_general
   use microslip_system_jointed_system, only: jointed_system_t
   implicit none(type, external)
   private

   public :: harmonic_balance_options_t, run_harmonic_balance

   !> Largest residual of a response that is only passed on the way from a small load, lengths of a step in parts of the
   !> response and in decades of the load, shortest step in parts of that, smallest load to begin with.
   real(wp), parameter :: path_tolerance = 1.0e-4_wp, path_response = 0.5_wp, path_decades = 0.25_wp, path_shortest = 1.0e-3_wp, &
      & smallest_load = 1.0e-8_wp
   !> Load that friction hardly counts against, over that of the level.
   real(wp), parameter :: large_load = 30.0_wp
   !> Most points on that way.
   integer, parameter :: path_points = 200

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
      !> (n + 1) the point of the largest neglected velocity
      real(wp), allocatable :: worst(:)
      real(wp) :: worst_velocity = -1.0_wp
      !> dF/dx as it was known there
      real(wp), allocatable :: worst_derivative(:, :)
   contains
      procedure :: residual
      procedure :: jacobian
      procedure :: lengths
      procedure :: take
   end type forced_response_t

   !> The response at one frequency over the load.
   type, extends(curve_problem_t) :: load_path_t
      type(forced_response_t), pointer :: forced => null()
      !> rad/s; level and load at its end
      real(wp) :: omega = 0.0_wp, level = 0.0_wp
      real(wp), allocatable :: load(:)
      !> (n) residual of the last evaluation; (n + 1) the last point
      real(wp), allocatable :: r(:), last(:)
   contains
      procedure :: residual => path_residual
      procedure :: jacobian => path_jacobian
      procedure :: lengths => path_lengths
      procedure :: take => path_take
   end type load_path_t

contains

   !> The curves of all levels; what was found before a failure is with the recorder.
   subroutine run_harmonic_balance(system, operating, options, contact_options, recorder, records, error, truncation)
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
      !> (levels) What harmonics and samples miss
      type(truncation_t), allocatable, intent(out), optional :: truncation(:)
      type(forced_response_t), target :: problem
      type(curve_options_t) :: curve
      real(wp), allocatable :: start(:)
      integer :: attempt, k
      logical :: found

      allocate (records(size(options%levels)))
      if (present(truncation)) allocate (truncation(size(options%levels)))
      call problem%balance%set_up(system, operating, options%sensors, options%harmonics, options%samples, &
         & fit_contact(contact_options, system, operating, repeat_share*options%tolerance*minval(options%levels) &
         & *norm2(system%load_modal(:, options%load))), error)
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
         problem%worst_velocity = -1.0_wp
         call held_response(problem, 2.0_wp*pi*options%frequency_range(1), .true., start, error)
         if (.not. allocated(error)) call check_tolerance(problem, start, error)
         do attempt = 1, 4
            if (allocated(error)) exit
            if (attempt > 1) call guess_anew(problem, options, attempt, start, found, error)
            if (allocated(error)) exit
            if (attempt > 2 .and. .not. found) cycle
            call trace_curve(problem, start, 2.0_wp*pi*options%frequency_range(2), curve, records(k), error)
            if (records(k)%reason /= no_start) exit
         end do
         operating = problem%balance%operating
         if (allocated(error)) return
         if (present(truncation) .and. records(k)%points > 0) call estimate_truncation(problem, truncation(k))
         if (why_ended(records(k)) /= '') then
            call failure(error, 'harmonic balance, level '//to_text(options%levels(k))//': '//why_ended(records(k)))
            return
         end if
      end do
   end subroutine run_harmonic_balance

   !> A tolerance below what rounding leaves of the balance can not be met.
   subroutine check_tolerance(problem, start, error)
      type(forced_response_t), intent(in) :: problem
      !> (n + 1)
      real(wp), intent(in) :: start(:)
      type(error_t), allocatable, intent(out) :: error
      real(wp) :: floor

      floor = problem%balance%noise_of(start(:size(start) - 1))/norm2(problem%load)
      if (problem%tolerance < floor) call bad_input(error, '&harmonic_balance: tolerance = '//to_text(problem%tolerance) &
         & //' can not be reached at level '//to_text(problem%balance%level)//', rounding of the contact forces under the '// &
         & 'preload alone leaves more; allowed here: >= '//to_text(floor, 2))
   end subroutine check_tolerance

   !> Another guess of the first point: the response without friction, or what is found from a large or a small load.
   subroutine guess_anew(problem, options, attempt, start, found, error)
      type(forced_response_t), intent(inout) :: problem
      type(harmonic_balance_options_t), intent(in) :: options
      !> 2, 3 or 4
      integer, intent(in) :: attempt
      !> (n + 1)
      real(wp), intent(inout) :: start(:)
      logical, intent(out) :: found
      type(error_t), allocatable, intent(out) :: error
      real(wp), allocatable :: held(:)
      real(wp) :: level, share
      integer :: n

      n = size(start) - 1
      found = .true.
      call held_response(problem, start(n + 1), attempt == 4, held, error)
      if (allocated(error)) return
      start = held
      if (attempt == 2) return
      share = large_load
      if (attempt == 4) then
         level = problem%balance%level
         share = 1.0_wp
         do
            share = 0.1_wp*share
            problem%balance%level = share*level
            call problem%balance%evaluate(share*start(:n))
            if (problem%balance%cycle%counts(3) == 0 .or. share <= smallest_load) exit
         end do
         problem%balance%level = level
      end if
      start(:n) = share*start(:n)
      call follow_load(problem, options, share, start, found, error)
   end subroutine guess_anew

   !> The response at one frequency, followed over the load to that of the level.
   subroutine follow_load(problem, options, share, start, found, error)
      type(forced_response_t), intent(inout), target :: problem
      type(harmonic_balance_options_t), intent(in) :: options
      !> First load over that of the level
      real(wp), intent(in) :: share
      !> (n + 1) the response to it, roughly, on entry; that of the level on return
      real(wp), intent(inout) :: start(:)
      !> Whether it could be followed
      logical, intent(out) :: found
      type(error_t), allocatable, intent(out) :: error
      type(load_path_t) :: path
      type(curve_record_t) :: record
      type(curve_options_t) :: curve
      integer :: n

      n = size(start) - 1
      path%forced => problem
      path%omega = start(n + 1)
      path%level = problem%balance%level
      path%load = problem%load
      problem%balance%level_varies = .true.
      curve = curve_options_t(tolerance=max(path_tolerance, options%tolerance), max_iterations=options%max_iterations, &
         & first_step=1.0_wp, smallest_step=path_shortest, max_points=path_points)
      call trace_curve(path, [start(:n), log10(share)], 0.0_wp, curve, record, error)
      problem%balance%level_varies = .false.
      problem%balance%level = path%level
      problem%load = path%load
      found = record%reason == ended_at_last
      if (found) start(:n) = path%last(:n)
   end subroutine follow_load

   subroutine path_residual(self, y, first, r, error)
      class(load_path_t), intent(inout) :: self
      real(wp), intent(in) :: y(:)
      logical, intent(in) :: first
      real(wp), intent(out) :: r(:)
      type(error_t), allocatable, intent(out) :: error
      real(wp) :: share

      share = 10.0_wp**y(size(y))
      self%forced%balance%level = share*self%level
      self%forced%load = share*self%load
      call self%forced%residual([y(:size(y) - 1), self%omega], first, r, error)
      self%r = r
   end subroutine path_residual

   !> r by log10(share): r is over |load|, which the balance and the forces at the contact have too.
   subroutine path_jacobian(self, y, anew, J, error)
      class(load_path_t), intent(inout) :: self
      real(wp), intent(in) :: y(:)
      logical, intent(in) :: anew
      real(wp), intent(out) :: J(:, :)
      type(error_t), allocatable, intent(out) :: error
      integer :: m, n

      call self%forced%jacobian([y(:size(y) - 1), self%omega], anew, J, error)
      if (allocated(error)) return
      m = size(self%load)
      n = size(J, 1)
      associate (problem => self%forced)
         J(:, n + 1) = -problem%balance%level*problem%balance%by_level/norm2(problem%load) - self%r
         J(m + 1:2*m, n + 1) = J(m + 1:2*m, n + 1) - problem%load/norm2(problem%load)
         J(:, n + 1) = log(10.0_wp)*J(:, n + 1)
      end associate
   end subroutine path_jacobian

   !> A part of the response, and of a decade.
   function path_lengths(self, y) result(w)
      class(load_path_t), intent(in) :: self
      real(wp), intent(in) :: y(:)
      real(wp) :: w(size(y))

      w = path_response*max(norm2(y(:size(y) - 1)), tiny(1.0_wp))
      w(size(w)) = path_decades
   end function path_lengths

   !> Points on the way are only kept to go on from.
   subroutine path_take(self, y, correction, verdict, error)
      class(load_path_t), intent(inout) :: self
      real(wp), intent(in) :: y(:)
      type(correction_t), intent(in) :: correction
      integer, intent(out) :: verdict
      type(error_t), allocatable, intent(out) :: error

      verdict = go_on
      self%last = y
   end subroutine path_take

   !> What harmonics and samples miss at the point of the curve where most is missing.
   subroutine estimate_truncation(problem, truncation)
      type(forced_response_t), intent(inout) :: problem
      type(truncation_t), intent(out) :: truncation
      type(forced_response_t) :: fine
      type(response_point_t) :: point, fine_point
      type(error_t), allocatable :: error
      real(wp), allocatable :: y(:), r(:), fine_y(:), fine_r(:), step(:, :), beyond(:, :), sensor(:, :)
      real(wp) :: change(2, most_refinements + 2)
      integer :: harmonics, k, first, last, m, n
      logical :: fresh

      y = problem%worst
      associate (balance => problem%balance)
         m = balance%system%n_modes
         n = size(y) - 1
         harmonics = balance%spectrum_harmonics()
         allocate (r(n), step(n + 1, 0:most_refinements + 2), source=0.0_wp)
         call problem%residual(y, .true., r, error)
         if (allocated(error)) return
         ! Computing it anew would take most of the time of the estimate.
         fresh = problem%worst_velocity > much_velocity
         if (.not. fresh) balance%derivative = problem%worst_derivative
         point = balance%describe()
         fine%load = problem%load
         fine%tolerance = problem%tolerance
         fine%balance = balance
         call fine%balance%resample(harmonics, 2*balance%samples())
         allocate (fine_y(fine%balance%unknowns() + 1), fine_r(fine%balance%unknowns()), source=0.0_wp)
         fine_y(:n) = y(:n)
         fine_y(size(fine_y)) = y(n + 1)
         do k = 1, size(change, 2)
            call fine%residual(fine_y, k == 1, fine_r, error)
            if (allocated(error) .or. fine%balance%doubt() > 0.0_wp) return
            call fine%balance%accept()
            ! The residual at y was evaluated before, the Jacobian is that of the coarse problem.
            call step_to_curve(problem, y, fine_r(:n), .false., fresh .and. k == 1, step(:, k), error)
            if (allocated(error)) return
            fine_point = fine%balance%describe()
            sensor = fine_point%sensor
            sensor(:, :n/m) = sensor(:, :n/m) + matmul(transpose(balance%system%sensor_modal), reshape(step(:n, k), [m, n/m]))
            ! From the second on the motion has changed by the steps before already.
            if (k > 2) step(:, k) = step(:, k) + step(:, k - 1)
            change(:, k) = [norm2(sensor(balance%sensors, 2:))/point%amplitude - 1.0_wp, step(n + 1, k)/y(n + 1)]
            last = k
            if (k == size(change, 2) .or. problem%worst_velocity < no_velocity) exit
            if (k > 2) then
               if (.not. changes_on(change(:, k), change(:, k - 1))) exit
            else if (k == 2) then
               if (.not. changes_on(change(:, k), 0.0_wp*change(:, k))) exit
            end if
            ! What the same forces, seen by more samples, excite beyond the series
            call balance%neglected(y(n + 1), 0.0_wp, harmonics, beyond, error, fine%balance)
            if (allocated(error)) return
            if (k > 1) then
               fine_y(:n) = y(:n) + step(:n, k)
               fine_y(size(fine_y)) = y(n + 1) + step(n + 1, k)
            end if
            fine_y(n + 1:size(fine_y) - 1) = reshape(beyond(:, n/m + 1:), [size(fine_y) - 1 - n])
         end do
         truncation%frequency = y(n + 1)/(2.0_wp*pi)
         truncation%amplitude = point%amplitude
         truncation%by_samples = change(:, 1)
         ! The steps follow one another's forces, and in motions with stops they do not come closer: the larger of the first
         ! and the last counts.
         first = min(2, last)
         truncation%by_both = merge(change(:, first), change(:, last), abs(change(:, first)) > abs(change(:, last)))
         truncation%known = .true.
      end associate
   end subroutine estimate_truncation

   !> Response with all closed points stuck, or sliding without friction, [x; omega].
   subroutine held_response(problem, omega, stuck, y, error)
      type(forced_response_t), intent(in) :: problem
      real(wp), intent(in) :: omega
      logical, intent(in) :: stuck
      real(wp), allocatable, intent(out) :: y(:)
      type(error_t), allocatable, intent(out) :: error
      real(wp), allocatable :: stiffness(:, :), matrix(:, :), x(:, :), friction(:)
      type(jointed_system_t), pointer :: system
      integer :: k, n

      associate (balance => problem%balance)
         friction = balance%system%problem%friction
         ! The system is another object than the problem, which only points to it.
         system => balance%system
         if (.not. stuck) system%problem%friction = 0.0_wp
         call stuck_stiffness(balance%system, balance%operating%contact%status, stiffness, error)
         system%problem%friction = friction
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
   end subroutine held_response

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
      rest = rest_of(self, y)
      call self%balance%evaluate(y(:n), first, rest, repeat_share*self%tolerance*norm2(self%load))
      r = reshape(rest - self%balance%force, [size(r)])/norm2(self%load)
      doubt = self%balance%doubt()
      if (doubt > 0.0_wp) r(1) = merge(huge(1.0_wp), abs(r(1)) + doubt/norm2(self%load), doubt >= huge(1.0_wp))
   end subroutine residual

   !> The balance but for the contact forces, (modes, 2H + 1).
   function rest_of(self, y) result(rest)
      class(forced_response_t), intent(in) :: self
      real(wp), intent(in) :: y(:)
      real(wp), allocatable :: rest(:, :)
      integer :: n

      n = size(y) - 1
      rest = self%balance%linear_force(reshape(y(:n), [size(self%load), n/size(self%load)]), y(n + 1), 0.0_wp)
      rest(:, 2) = rest(:, 2) - self%load
   end function rest_of

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

   !> See whether the point stays one, check the points left out, and hand it on.
   subroutine take(self, y, correction, verdict, error)
      class(forced_response_t), intent(inout) :: self
      real(wp), intent(in) :: y(:)
      type(correction_t), intent(in) :: correction
      integer, intent(out) :: verdict
      type(error_t), allocatable, intent(out) :: error
      type(response_point_t) :: point
      real(wp) :: missing
      integer :: added

      verdict = solve_again
      call self%balance%confirm(rest_of(self, y), self%tolerance*norm2(self%load), missing, added, error)
      if (allocated(error) .or. added > 0 .or. missing > self%tolerance*norm2(self%load)) return
      verdict = go_on
      point = self%balance%describe()
      point%level = self%balance%level
      point%frequency = y(size(y))/(2.0_wp*pi)
      point%correction = correction
      point%correction%residual = missing/norm2(self%load)
      point%neglected_velocity = self%balance%neglected_velocity(point, y(size(y)), 0.0_wp)
      if (point%neglected_velocity > self%worst_velocity) then
         self%worst = y
         self%worst_derivative = self%balance%derivative
         self%worst_velocity = point%neglected_velocity
      end if
      call self%recorder%record(point, error)
   end subroutine take

end module microslip_analysis_harmonic_balance
