module test_analysis_continuation
   use microslip_analysis_continuation, only: correction_t, curve_options_t, curve_problem_t, curve_record_t, &
      & ended_at_last, ended_before_first, ended_by_user, go_on, no_start, no_step, solve_again, stop_here, too_many_points, &
      & trace_curve, why_ended
   use microslip_core_error, only: error_t
   use microslip_core_kinds, only: wp
   use microslip_core_text, only: to_text
   use support_checks, only: good
   use testdrive, only: check, new_unittest, testing_error => error_type, unittest_type
   implicit none(type, external)
   private

   public :: collect_analysis_continuation

   !> Duffing oscillator, one harmonic, undamped terms over the load:
   !>     [(1 - w^2 + 3/4 (c^2 + s^2)) c + 2 zeta w s - f; (...) s - 2 zeta w c]/f,       y = [c, s, w]
   type, extends(curve_problem_t) :: duffing_t
      real(wp) :: f = 0.1_wp, zeta = 0.02_wp
      real(wp), allocatable :: points(:, :)
      type(correction_t), allocatable :: corrections(:)
      !> No residual beyond this frequency; stop after so many points; change f at the third point
      real(wp) :: wall = huge(1.0_wp)
      integer :: stop_after = huge(1)
      logical :: changes = .false.
   contains
      procedure :: residual
      procedure :: jacobian
      procedure :: lengths
      procedure :: take
   end type duffing_t

   real(wp), parameter :: tolerance = 1.0e-10_wp

contains

   subroutine collect_analysis_continuation(testsuite)
      type(unittest_type), allocatable, intent(out) :: testsuite(:)

      testsuite = [ &
         & new_unittest('both folds of a Duffing oscillator', test_folds), &
         & new_unittest('the other way', test_backwards), &
         & new_unittest('one point only', test_one_point), &
         & new_unittest('a curve that cannot go on', test_wall), &
         & new_unittest('no start', test_no_start), &
         & new_unittest('a curve that turns back', test_turns_back), &
         & new_unittest('stopped and limited', test_stopped), &
         & new_unittest('a problem that changes is solved again', test_changes)]
   end subroutine collect_analysis_continuation

   subroutine residual(self, y, first, r, error)
      class(duffing_t), intent(inout) :: self
      real(wp), intent(in) :: y(:)
      logical, intent(in) :: first
      real(wp), intent(out) :: r(:)
      type(error_t), allocatable, intent(out) :: error
      real(wp) :: k

      if (allocated(error)) return
      k = 1.0_wp - y(3)**2 + 0.75_wp*(y(1)**2 + y(2)**2)
      r = [k*y(1) + 2.0_wp*self%zeta*y(3)*y(2) - self%f, k*y(2) - 2.0_wp*self%zeta*y(3)*y(1)]/self%f
      if (y(3) > self%wall) r = huge(1.0_wp)
   end subroutine residual

   subroutine jacobian(self, y, anew, J, error)
      class(duffing_t), intent(inout) :: self
      real(wp), intent(in) :: y(:)
      logical, intent(in) :: anew
      real(wp), intent(out) :: J(:, :)
      type(error_t), allocatable, intent(out) :: error
      real(wp) :: k

      if (allocated(error) .or. (anew .and. size(y) /= 3)) return
      associate (c => y(1), s => y(2), w => y(3), zeta => self%zeta)
         k = 1.0_wp - w**2 + 0.75_wp*(c**2 + s**2)
         J(1, :) = [k + 1.5_wp*c*c, 1.5_wp*c*s + 2.0_wp*zeta*w, -2.0_wp*w*c + 2.0_wp*zeta*s]
         J(2, :) = [1.5_wp*c*s - 2.0_wp*zeta*w, k + 1.5_wp*s*s, -2.0_wp*w*s - 2.0_wp*zeta*c]
         J = J/self%f
      end associate
   end subroutine jacobian

   function lengths(self, y) result(w)
      class(duffing_t), intent(in) :: self
      real(wp), intent(in) :: y(:)
      real(wp) :: w(size(y))
      w = 0.25_wp*norm2(y(:2))
      w(3) = 0.05_wp*min(1.0_wp, self%f*huge(1.0_wp))
   end function lengths

   subroutine take(self, y, correction, verdict, error)
      class(duffing_t), intent(inout) :: self
      real(wp), intent(in) :: y(:)
      type(correction_t), intent(in) :: correction
      integer, intent(out) :: verdict
      type(error_t), allocatable, intent(out) :: error
      integer :: n

      verdict = go_on
      if (allocated(error)) return
      n = 0
      if (allocated(self%points)) n = size(self%points, 2)
      if (self%changes .and. n == 2) then
         self%changes = .false.
         self%f = 1.01_wp*self%f
         verdict = solve_again
         return
      end if
      if (n == 0) then
         self%points = reshape(y, [3, 1])
         self%corrections = [correction]
      else
         self%points = reshape([self%points, y], [3, n + 1])
         self%corrections = [self%corrections, correction]
      end if
      if (n + 1 >= self%stop_after) verdict = stop_here
   end subroutine take

   subroutine trace(problem, first, last, record, lib, options)
      type(duffing_t), intent(inout) :: problem
      real(wp), intent(in) :: first, last
      type(curve_record_t), intent(out) :: record
      type(error_t), allocatable, intent(out) :: lib
      type(curve_options_t), intent(in), optional :: options
      type(curve_options_t) :: chosen

      chosen%tolerance = tolerance
      if (present(options)) chosen = options
      call trace_curve(problem, [0.1_wp, 0.0_wp, first], last, chosen, record, lib)
   end subroutine trace

   !> Largest deviation of the points from the amplitude equation ((1 - w^2 + 3/4 A^2)^2 + (2 zeta w)^2) A^2 = f^2.
   pure real(wp) function deviation(problem)
      type(duffing_t), intent(in) :: problem
      real(wp) :: amplitude_2
      integer :: k

      deviation = 0.0_wp
      do k = 1, size(problem%points, 2)
         associate (w => problem%points(3, k))
            amplitude_2 = sum(problem%points(:2, k)**2)
            deviation = max(deviation, abs(((1.0_wp - w**2 + 0.75_wp*amplitude_2)**2 + (2.0_wp*problem%zeta*w)**2)* &
               & amplitude_2/problem%f**2 - 1.0_wp))
         end associate
      end do
   end function deviation

   subroutine test_folds(error)
      type(testing_error), allocatable, intent(out) :: error
      type(error_t), allocatable :: lib
      type(duffing_t) :: problem
      type(curve_record_t) :: record
      integer :: n, turns

      call trace(problem, 0.5_wp, 3.0_wp, record, lib)
      call good(error, lib)
      if (allocated(error)) return
      n = size(problem%points, 2)
      call check(error, record%reason == ended_at_last .and. record%points == n .and. why_ended(record) == '', 'not at its end')
      if (allocated(error)) return
      call check(error, abs(problem%points(3, 1) - 0.5_wp) <= 0.0_wp .and. abs(problem%points(3, n) - 3.0_wp) <= 0.0_wp, &
         & 'the ends are not exact')
      if (allocated(error)) return
      turns = count((problem%points(3, 2:n - 1) - problem%points(3, :n - 2)) &
         & *(problem%points(3, 3:) - problem%points(3, 2:n - 1)) < 0.0_wp)
      call check(error, turns == 2, 'folds: '//to_text(turns))
      if (allocated(error)) return
      ! Both residuals are below the tolerance, and so their squares' sum deviates by no more than some of it.
      call check(error, deviation(problem) <= 4.0_wp*tolerance, 'points off the curve')
      if (allocated(error)) return
      call check(error, all(problem%corrections%converged) .and. all(problem%corrections%residual <= tolerance) &
         & .and. all(problem%corrections(2:)%step <= 2.0_wp), 'corrections')
      if (allocated(error)) return
      ! The peak is passed: there damping alone carries the load, 2 zeta w A = f.
      call check(error, any(2.0_wp*problem%zeta*problem%points(3, :)*norm2(problem%points(:2, :), dim=1) &
         & > 0.99_wp*problem%f), 'no point near the peak')
   end subroutine test_folds

   subroutine test_backwards(error)
      type(testing_error), allocatable, intent(out) :: error
      type(error_t), allocatable :: lib
      type(duffing_t) :: problem
      type(curve_record_t) :: record

      call trace(problem, 3.0_wp, 0.5_wp, record, lib)
      call good(error, lib)
      if (allocated(error)) return
      call check(error, record%reason == ended_at_last .and. deviation(problem) <= 4.0_wp*tolerance)
   end subroutine test_backwards

   subroutine test_one_point(error)
      type(testing_error), allocatable, intent(out) :: error
      type(error_t), allocatable :: lib
      type(duffing_t) :: problem
      type(curve_record_t) :: record

      call trace(problem, 0.5_wp, 0.5_wp, record, lib)
      call good(error, lib)
      if (allocated(error)) return
      call check(error, record%reason == ended_at_last .and. record%points == 1)
   end subroutine test_one_point

   subroutine test_wall(error)
      type(testing_error), allocatable, intent(out) :: error
      type(error_t), allocatable :: lib
      type(duffing_t) :: problem
      type(curve_record_t) :: record
      integer :: n

      problem%wall = 0.9_wp
      call trace(problem, 0.5_wp, 3.0_wp, record, lib)
      call good(error, lib)
      if (allocated(error)) return
      n = size(problem%points, 2)
      call check(error, record%reason == no_step .and. record%failures > 5 .and. index(why_ended(record), 'points') > 0)
      if (allocated(error)) return
      ! What was found goes up to the wall, closer than the shortest step of 1e-3 x 0.05 (doubled: it is halved once more).
      call check(error, problem%points(3, n) > 0.9_wp - 1.0e-3_wp .and. problem%points(3, n) <= 0.9_wp, 'not up to the wall')
   end subroutine test_wall

   subroutine test_no_start(error)
      type(testing_error), allocatable, intent(out) :: error
      type(error_t), allocatable :: lib
      type(duffing_t) :: problem
      type(curve_record_t) :: record

      problem%wall = 0.1_wp
      call trace(problem, 0.5_wp, 3.0_wp, record, lib)
      call good(error, lib)
      if (allocated(error)) return
      call check(error, record%reason == no_start .and. record%points == 0 .and. .not. allocated(problem%points) &
         & .and. index(why_ended(record), '0 points') > 0)
   end subroutine test_no_start

   !> Begun on the upper branch between the folds, the curve goes up to the peak and comes back on the middle branch.
   subroutine test_turns_back(error)
      type(testing_error), allocatable, intent(out) :: error
      type(error_t), allocatable :: lib
      type(duffing_t) :: problem
      type(curve_record_t) :: record
      type(curve_options_t) :: options

      options%tolerance = tolerance
      call trace_curve(problem, [0.8_wp, 1.0_wp, 1.5_wp], 5.0_wp, options, record, lib)
      call good(error, lib)
      if (allocated(error)) return
      call check(error, record%reason == ended_before_first .and. index(why_ended(record), 'first') > 0, 'not told')
      if (allocated(error)) return
      call check(error, maxval(problem%points(3, :)) > 1.6_wp, 'not past the peak')
   end subroutine test_turns_back

   subroutine test_stopped(error)
      type(testing_error), allocatable, intent(out) :: error
      type(error_t), allocatable :: lib
      type(duffing_t) :: problem
      type(curve_record_t) :: record

      problem%stop_after = 3
      call trace(problem, 0.5_wp, 3.0_wp, record, lib)
      call good(error, lib)
      if (allocated(error)) return
      call check(error, record%reason == ended_by_user .and. record%points == 3)
      if (allocated(error)) return
      problem = duffing_t()
      call trace(problem, 0.5_wp, 3.0_wp, record, lib, curve_options_t(max_points=4))
      call good(error, lib)
      if (allocated(error)) return
      call check(error, record%reason == too_many_points .and. record%points == 4)
   end subroutine test_stopped

   subroutine test_changes(error)
      type(testing_error), allocatable, intent(out) :: error
      type(error_t), allocatable :: lib
      type(duffing_t) :: problem
      type(curve_record_t) :: record
      real(wp) :: amplitude_2

      problem%changes = .true.
      problem%stop_after = 3
      call trace(problem, 0.5_wp, 3.0_wp, record, lib)
      call good(error, lib)
      if (allocated(error)) return
      amplitude_2 = sum(problem%points(:2, 3)**2)
      associate (w => problem%points(3, 3))
         call check(error, abs(((1.0_wp - w**2 + 0.75_wp*amplitude_2)**2 + (2.0_wp*problem%zeta*w)**2)*amplitude_2 &
            & - problem%f**2) <= 4.0_wp*tolerance*problem%f**2, 'the third point belongs to the old problem')
      end associate
   end subroutine test_changes

end module test_analysis_continuation
