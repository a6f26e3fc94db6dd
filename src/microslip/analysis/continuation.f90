!> Solution curves of n equations in n + 1 unknowns, r(y) = 0, by a predictor along the tangent and a Newton corrector
!> at right angles to it (pseudo-arc-length): folds in the last unknown, the parameter, are passed like any other point.
!>
!> With lengths w (the change of each unknown that counts as one) and z = y/w:
!>     predictor   z + s t,   J_z t = 0, |t| = 1; from the third point on, the parabola through the last three points
!>     corrector   [J_z; t^T] dz = -[r; 0],   halved while the residual grows
!> The step s grows after quick corrections, and is halved where the corrector fails or moves further than the
!> predictor. The curve ends where the parameter reaches its last value (that point is computed exactly), returns beyond its
!> first, or no step works any more.
module microslip_analysis_continuation
   use microslip_core_error, only: error_t
   use microslip_core_kinds, only: wp
   use microslip_core_text, only: to_text
   use microslip_linalg_dense, only: solve_general
   implicit none(type, external)
   private

   public :: curve_problem_t, curve_options_t, curve_record_t, correction_t, trace_curve, why_ended, step_to_curve
   public :: ended_at_last, ended_before_first, ended_by_user, no_start, no_step, too_many_points

   !> How a curve ended.
   integer, parameter :: ended_at_last = 0, ended_before_first = 1, ended_by_user = 2, no_start = 3, no_step = 4, &
      & too_many_points = 5

   !> Reduction of the residual by one correction from which the Jacobian is kept.
   real(wp), parameter :: good_contraction = 0.3_wp
   !> Part by which the last step may be stretched.
   real(wp), parameter :: almost = 0.05_wp
   !> Most halvings of a correction.
   integer, parameter :: max_halvings = 4
   !> Times that a point is solved again because the problem is not content with it.
   integer, parameter :: max_rejections = 10
   !> Corrections after which a step is neither lengthened nor shortened.
   integer, parameter :: usual_iterations = 4

   type :: curve_options_t
      !> A point is solved when no scaled residual is larger
      real(wp) :: tolerance = 1.0e-6_wp
      integer :: max_iterations = 12
      !> Steps in units of the problem's lengths
      real(wp) :: first_step = 0.5_wp, largest_step = 1.0_wp, smallest_step = 1.0e-3_wp
      integer :: max_points = 1000
   end type curve_options_t

   !> How the correction of one point went.
   type :: correction_t
      logical :: converged = .false.
      !> Corrections, evaluations of the residual, and Jacobians computed anew
      integer :: iterations = 0, evaluations = 0, jacobians = 0
      !> Largest scaled residual
      real(wp) :: residual = huge(1.0_wp)
      !> Step that led here, in units of the problem's lengths
      real(wp) :: step = 0.0_wp
   end type correction_t

   !> How the curve went.
   type :: curve_record_t
      !> Points on the curve, steps that failed
      integer :: points = 0, failures = 0
      !> One of the reasons above
      integer :: reason = no_start
      !> Totals, failed steps included
      integer :: evaluations = 0, jacobians = 0
      !> The correction that failed last
      type(correction_t) :: failed
   end type curve_record_t

   !> Equations with one unknown more than there are of them; the last one is the parameter.
   type, abstract :: curve_problem_t
   contains
      procedure(residual_interface), deferred :: residual
      procedure(jacobian_interface), deferred :: jacobian
      procedure(lengths_interface), deferred :: lengths
      procedure(take_interface), deferred :: take
   end type curve_problem_t

   abstract interface
      !> Scaled residual at y: the `first` one of a point, or at a correction of where the Jacobian was asked for last.
      subroutine residual_interface(self, y, first, r, error)
         import :: curve_problem_t, error_t, wp
         implicit none(type, external)
         class(curve_problem_t), intent(inout) :: self
         !> (n + 1)
         real(wp), intent(in) :: y(:)
         logical, intent(in) :: first
         !> (n)
         real(wp), intent(out) :: r(:)
         type(error_t), allocatable, intent(out) :: error
      end subroutine residual_interface

      !> Its derivative at the y of the last residual, (n, n + 1); an approximation will do unless `anew`.
      subroutine jacobian_interface(self, y, anew, J, error)
         import :: curve_problem_t, error_t, wp
         implicit none(type, external)
         class(curve_problem_t), intent(inout) :: self
         real(wp), intent(in) :: y(:)
         logical, intent(in) :: anew
         real(wp), intent(out) :: J(:, :)
         type(error_t), allocatable, intent(out) :: error
      end subroutine jacobian_interface

      !> The change of each unknown that counts as one, (n + 1).
      function lengths_interface(self, y) result(w)
         import :: curve_problem_t, wp
         implicit none(type, external)
         class(curve_problem_t), intent(in) :: self
         real(wp), intent(in) :: y(:)
         real(wp) :: w(size(y))
      end function lengths_interface

      !> Take a solved point; the last residual was evaluated there.
      subroutine take_interface(self, y, correction, verdict, error)
         import :: curve_problem_t, correction_t, error_t, wp
         implicit none(type, external)
         class(curve_problem_t), intent(inout) :: self
         real(wp), intent(in) :: y(:)
         type(correction_t), intent(in) :: correction
         !> go_on, solve_again (the problem has changed, or is not content) or stop_here
         integer, intent(out) :: verdict
         type(error_t), allocatable, intent(out) :: error
      end subroutine take_interface
   end interface

   !> Verdicts on a point.
   integer, parameter, public :: go_on = 0, solve_again = 1, stop_here = 2

contains

   !> Trace the curve from y, whose parameter is kept for the first point, until the parameter is `last`.
   subroutine trace_curve(problem, start, last, options, record, error)
      class(curve_problem_t), intent(inout) :: problem
      !> (n + 1) guess of the first point
      real(wp), intent(in) :: start(:)
      real(wp), intent(in) :: last
      type(curve_options_t), intent(in) :: options
      type(curve_record_t), intent(out) :: record
      type(error_t), allocatable, intent(out) :: error
      real(wp) :: y(size(start)), trial(size(start)), w(size(start)), tangent(size(start)), before(size(start), 2)
      type(correction_t) :: correction
      real(wp) :: step
      logical :: at_end
      integer :: n, solved

      n = size(start)
      y = start
      solved = 1
      call correct(problem, options, parameter_row(n), problem%lengths(y), y, correction, record, error)
      record%failed = correction
      if (allocated(error) .or. .not. correction%converged) return
      call hand_over(problem, options, parameter_row(n), y, correction, record, error)
      record%failed = correction
      if (allocated(error) .or. record%reason == ended_by_user .or. .not. correction%converged) return
      if (last == start(n)) then
         record%reason = ended_at_last
         return
      end if
      tangent = sign(1.0_wp, last - start(n))*parameter_row(n)
      step = min(options%first_step, options%largest_step)
      call find_tangent(problem, y, record%jacobians == 0, problem%lengths(y), tangent, error)
      if (allocated(error)) return
      record%reason = no_step
      do
         w = problem%lengths(y)
         if (solved > 2) then
            call predict(before, y, w, step, trial, tangent)
         else
            trial = y + step*w*tangent
         end if
         at_end = (trial(n) - last + almost*(trial(n) - y(n)))*(last - start(n)) >= 0.0_wp
         if (at_end) then
            trial = y + (trial - y)*(last - y(n))/(trial(n) - y(n))
            trial(n) = last
            call correct(problem, options, parameter_row(n), w, trial, correction, record, error)
         else
            call correct(problem, options, tangent, w, trial, correction, record, error)
         end if
         if (allocated(error)) return
         correction%step = norm2((trial - y)/w)
         if (correction%converged .and. correction%step <= 2.0_wp*max(step, options%smallest_step)) then
            call hand_over(problem, options, merge(parameter_row(n), tangent, at_end), trial, correction, record, error)
            if (allocated(error) .or. record%reason == ended_by_user) return
         end if
         if (.not. correction%converged .or. correction%step > 2.0_wp*max(step, options%smallest_step)) then
            record%failures = record%failures + 1
            record%failed = correction
            step = 0.5_wp*step
            if (step < options%smallest_step) return
            cycle
         end if
         before = reshape([before(:, 2), y], [n, 2])
         solved = solved + 1
         y = trial
         record%reason = ended_at_last
         if (at_end) return
         record%reason = ended_before_first
         if ((y(n) - start(n))*(last - start(n)) < 0.0_wp) return
         record%reason = too_many_points
         if (record%points >= options%max_points) return
         record%reason = no_step
         if (solved < 3) then
            tangent = tangent*w/problem%lengths(y)
            call find_tangent(problem, y, record%jacobians == 0, problem%lengths(y), tangent, error)
            if (allocated(error)) return
         end if
         step = min(options%largest_step, step*2.0_wp**(real(usual_iterations - correction%iterations, wp)/3.0_wp))
      end do
   end subroutine trace_curve

   !> Extrapolate the parabola through three points, over the length of their chords.
   pure subroutine predict(before, y, w, step, trial, tangent)
      !> (n, 2) the two points before y
      real(wp), intent(in) :: before(:, :), y(:)
      !> (n) lengths
      real(wp), intent(in) :: w(:)
      !> Length beyond y
      real(wp), intent(in) :: step
      real(wp), intent(out) :: trial(:)
      !> (n) of the parabola there, in units of w, of length one
      real(wp), intent(out) :: tangent(:)
      real(wp) :: chord(2), slope(size(y)), bend(size(y))

      chord = [norm2((before(:, 2) - before(:, 1))/w), norm2((y - before(:, 2))/w)]
      slope = (y - before(:, 2))/chord(2)
      bend = (slope - (before(:, 2) - before(:, 1))/chord(1))/sum(chord)
      trial = y + step*(slope + (step + chord(2))*bend)
      tangent = (slope + (2.0_wp*step + chord(2))*bend)/w
      tangent = tangent/norm2(tangent)
   end subroutine predict

   !> Why a curve ended before its last point, blank if it did not.
   pure function why_ended(record) result(reason)
      type(curve_record_t), intent(in) :: record
      character(len=:), allocatable :: reason

      select case (record%reason)
      case (ended_at_last)
         reason = ''
      case (ended_before_first)
         reason = 'the curve turned back beyond its first point'
      case (ended_by_user)
         reason = 'stopped'
      case (too_many_points)
         reason = 'the curve has more points than allowed'
      case default
         reason = 'no solution found after '//to_text(record%points)//' points (residual '// &
            & to_text(record%failed%residual, 2)//' after '//to_text(record%failed%iterations)//' iterations)'
      end select
   end function why_ended

   !> Unit vector of the parameter.
   pure function parameter_row(n) result(row)
      integer, intent(in) :: n
      real(wp) :: row(n)
      row = 0.0_wp
      row(n) = 1.0_wp
   end function parameter_row

   !> Hand a point to the problem; where that has changed thereby, or is not content, solve it again.
   subroutine hand_over(problem, options, row, y, correction, record, error)
      class(curve_problem_t), intent(inout) :: problem
      type(curve_options_t), intent(in) :: options
      real(wp), intent(in) :: row(:)
      real(wp), intent(inout) :: y(:)
      type(correction_t), intent(inout) :: correction
      type(curve_record_t), intent(inout) :: record
      type(error_t), allocatable, intent(out) :: error
      type(correction_t) :: again
      integer :: rejections, verdict

      do rejections = 0, max_rejections
         call problem%take(y, correction, verdict, error)
         if (allocated(error)) return
         if (verdict /= solve_again) exit
         again = correction
         call correct(problem, options, row, problem%lengths(y), y, correction, record, error)
         if (allocated(error)) return
         correction%iterations = correction%iterations + again%iterations
         correction%evaluations = correction%evaluations + again%evaluations
         correction%jacobians = correction%jacobians + again%jacobians
         correction%step = again%step
         if (.not. correction%converged) return
      end do
      correction%converged = rejections <= max_rejections
      if (.not. correction%converged) return
      record%points = record%points + 1
      if (verdict == stop_here) record%reason = ended_by_user
   end subroutine hand_over

   !> Newton's method from y at right angles to `row`.
   subroutine correct(problem, options, row, w, y, correction, record, error)
      class(curve_problem_t), intent(inout) :: problem
      type(curve_options_t), intent(in) :: options
      !> (n + 1) in units of w
      real(wp), intent(in) :: row(:), w(:)
      real(wp), intent(inout) :: y(:)
      type(correction_t), intent(out) :: correction
      type(curve_record_t), intent(inout) :: record
      type(error_t), allocatable, intent(out) :: error
      real(wp) :: r(size(y) - 1), step(size(y), 1), before
      logical :: anew, singular
      integer :: halving

      call problem%residual(y, .true., r, error)
      if (allocated(error)) return
      correction%evaluations = 1
      correction%residual = maxval(abs(r))
      anew = .true.
      do while (correction%residual > options%tolerance .and. correction%iterations < options%max_iterations)
         ! Where there is no residual, or no correction, the step was too long.
         if (.not. correction%residual < huge(1.0_wp)) exit
         step(:, 1) = [-r, 0.0_wp]
         call solve_bordered(problem, y, anew, row, w, step, singular, error)
         if (allocated(error) .or. singular) exit
         correction%iterations = correction%iterations + 1
         if (anew) correction%jacobians = correction%jacobians + 1
         before = correction%residual
         do halving = 0, max_halvings
            call problem%residual(y + w*step(:, 1), .false., r, error)
            if (allocated(error)) exit
            correction%evaluations = correction%evaluations + 1
            correction%residual = maxval(abs(r))
            if (correction%residual < before) exit
            if (halving < max_halvings) step = 0.5_wp*step
         end do
         if (allocated(error)) exit
         y = y + w*step(:, 1)
         anew = correction%residual > good_contraction*before
      end do
      correction%converged = correction%residual <= options%tolerance
      record%evaluations = record%evaluations + correction%evaluations
      record%jacobians = record%jacobians + correction%jacobians
   end subroutine correct

   !> The change of y that takes a residual away, to first order: at the same parameter, or at right angles to the curve.
   !> The last residual was evaluated at y.
   subroutine step_to_curve(problem, y, r, same_parameter, anew, step, error)
      class(curve_problem_t), intent(inout) :: problem
      !> (n + 1) a point of the curve
      real(wp), intent(in) :: y(:)
      !> (n) what is missing there
      real(wp), intent(in) :: r(:)
      logical, intent(in) :: same_parameter
      !> Whether the Jacobian must be computed anew
      logical, intent(in) :: anew
      !> (n + 1)
      real(wp), intent(out) :: step(:)
      type(error_t), allocatable, intent(out) :: error
      real(wp) :: w(size(y)), row(size(y)), b(size(y), 1)
      logical :: singular

      w = problem%lengths(y)
      row = parameter_row(size(y))
      if (.not. same_parameter) call find_tangent(problem, y, anew, w, row, error)
      if (allocated(error)) return
      b(:, 1) = [-r, 0.0_wp]
      call solve_bordered(problem, y, anew .and. same_parameter, row, w, b, singular, error)
      step = huge(1.0_wp)
      if (.not. (allocated(error) .or. singular)) step = w*b(:, 1)
   end subroutine step_to_curve

   !> The tangent at a solved point, in units of w; it goes on in the direction of the last one.
   subroutine find_tangent(problem, y, anew, w, tangent, error)
      class(curve_problem_t), intent(inout) :: problem
      real(wp), intent(in) :: y(:)
      logical, intent(in) :: anew
      real(wp), intent(in) :: w(:)
      real(wp), intent(inout) :: tangent(:)
      type(error_t), allocatable, intent(out) :: error
      real(wp) :: x(size(y), 1)
      logical :: singular

      x(:, 1) = parameter_row(size(y))
      call solve_bordered(problem, y, anew, tangent, w, x, singular, error)
      if (.not. (allocated(error) .or. singular)) tangent = x(:, 1)/norm2(x(:, 1))
   end subroutine find_tangent

   !> Solve [J_z; row] x = b.
   subroutine solve_bordered(problem, y, anew, row, w, b, singular, error)
      class(curve_problem_t), intent(inout) :: problem
      real(wp), intent(in) :: y(:)
      logical, intent(in) :: anew
      real(wp), intent(in) :: row(:), w(:)
      !> (n + 1, 1) right-hand side, the solution on return
      real(wp), intent(inout), contiguous :: b(:, :)
      logical, intent(out) :: singular
      type(error_t), allocatable, intent(out) :: error
      type(error_t), allocatable :: no_solution
      real(wp) :: matrix(size(y), size(y)), J(size(y) - 1, size(y))
      integer :: k

      singular = .false.
      call problem%jacobian(y, anew, J, error)
      if (allocated(error)) return
      do k = 1, size(y)
         matrix(:, k) = [J(:, k)*w(k), row(k)]
      end do
      call solve_general(matrix, b, no_solution)
      singular = allocated(no_solution)
   end subroutine solve_bordered

end module microslip_analysis_continuation
