!> The solver for operators against the condensed one, on random problems driven through stick, slip, lift-off and
!> re-closing, and its linear systems against dense ones.
module test_contact_matrix_free
   use microslip_contact_closed_system, only: closed_system_t, state_frictionless
   use microslip_contact_condensed, only: condensed_solver_t
   use microslip_contact_laws, only: state_open, state_stick, state_slip
   use microslip_contact_matrix_free, only: matrix_free_solver_t
   use microslip_contact_problem, only: contact_problem_t, contact_state_t, solve_record_t, new_state, count_states
   use microslip_core_error, only: mslip_error => error_t
   use microslip_core_kinds, only: wp
   use microslip_linalg_dense, only: solve_general
   use support_dense_compliance, only: with_operator
   use test_contact_solvers, only: half_space_like_problem
   use testdrive, only: new_unittest, unittest_type, error_type, check
   implicit none(type, external)
   private

   public :: collect_contact_matrix_free

contains

   subroutine collect_contact_matrix_free(testsuite)
      type(unittest_type), allocatable, intent(out) :: testsuite(:)
      testsuite = [ &
         & new_unittest('equals condensed', test_equals_condensed), &
         & new_unittest('equals condensed on velocity level', test_velocity_level), &
         & new_unittest('pressed and sheared in one step', test_one_step), &
         & new_unittest('linear system = dense', test_linear_system), &
         & new_unittest('learning: fewer steps', test_learning), &
         & new_unittest('unconverged is reported', test_unconverged), &
         & new_unittest('needs an operator', test_needs_operator)]
   end subroutine collect_contact_matrix_free

   !> The drivers of step k: press, shear back and forth into gross slip, tilt into lift-off, unload.
   pure function driver(k) result(q)
      integer, intent(in) :: k
      real(wp) :: q(3)
      real(wp) :: t
      t = real(k, wp)
      q = [min(1.0_wp, 0.2_wp*t) - merge(1.2_wp*max(0.0_wp, sin(0.3_wp*t)), 0.0_wp, k > 30), &
         & merge(0.6_wp*sin(0.45_wp*(t - 4.0_wp)), 0.0_wp, k > 4), merge(0.12_wp*sin(0.7_wp*t), 0.0_wp, k > 12)]
   end function driver

   !> Drive both solvers along the same path.
   subroutine drive_both(problem, tolerance, error)
      type(contact_problem_t), intent(in) :: problem
      !> Of the forces over the largest force
      real(wp), intent(in) :: tolerance
      type(error_type), allocatable, intent(out) :: error
      type(contact_problem_t) :: operator_problem
      type(condensed_solver_t) :: dense
      type(matrix_free_solver_t) :: free
      type(contact_state_t) :: a, b
      type(solve_record_t) :: record_a, record_b
      type(mslip_error), allocatable :: failure
      real(wp) :: difference, scale
      integer :: k, visited(3)

      operator_problem = with_operator(problem)
      a = new_state(problem)
      b = a
      call dense%start(problem, a, failure)
      if (.not. allocated(failure)) call free%start(operator_problem, b, failure)
      call check(error,.not. allocated(failure), 'start failed')
      if (allocated(error)) return
      difference = 0.0_wp
      scale = 0.0_wp
      visited = 0
      do k = 1, 60
         call dense%advance(problem, driver(k), a, record_a)
         call free%advance(operator_problem, driver(k), b, record_b)
         call check(error, record_a%converged .and. record_b%converged, 'not converged')
         if (allocated(error)) return
         scale = max(scale, maxval(a%force))
         difference = max(difference, maxval(abs(a%force - b%force)))
         visited = max(visited, [count(b%status == state_open), count(b%status == state_stick), &
            & count(b%status == state_slip)])
         ! As after a preload: the stuck response is known from here on.
         if (k == 4) call free%start(operator_problem, b, failure)
      end do
      call check(error, difference <= tolerance*scale, 'forces differ')
      if (allocated(error)) return
      call check(error, visited(1) == problem%n_points .and. visited(2) > 10 .and. visited(3) > 10, &
         & 'a regime was not visited')
   end subroutine drive_both

   subroutine test_equals_condensed(error)
      type(error_type), allocatable, intent(out) :: error

      call drive_both(half_space_like_problem(9, 7, 0.4_wp), 60*1.0e-9_wp, error)
   end subroutine test_equals_condensed

   subroutine test_velocity_level(error)
      type(error_type), allocatable, intent(out) :: error
      type(contact_problem_t) :: problem

      problem = half_space_like_problem(6, 4, 0.4_wp)
      problem%velocity_level = .true.
      call drive_both(problem, 60*1.0e-9_wp, error)
   end subroutine test_velocity_level

   !> From nothing into partial slip at once, in many directions: both solvers find the same forces, though friction follows
   !> normal forces that are far off at first.
   subroutine test_one_step(error)
      type(error_type), allocatable, intent(out) :: error
      type(contact_problem_t) :: problem, operator_problem
      type(condensed_solver_t) :: dense
      type(matrix_free_solver_t) :: free
      type(contact_state_t) :: a, b
      type(solve_record_t) :: record_a, record_b
      type(mslip_error), allocatable :: failure
      real(wp), allocatable :: r(:, :)
      real(wp) :: q(3)
      integer :: k, rescues
      !> Both residuals are 1e-10 of the largest force; the structure makes forces out of them
      real(wp), parameter :: tolerance = 1.0e-7_wp

      ! A structure far softer than the pad: it shifts, tilts, and tilts where it is sheared.
      problem = half_space_like_problem(22, 16, 0.6_wp)
      r = problem%R
      r(:, 2) = r(:, 2) + 0.3_wp*r(:, 3)
      problem%G = problem%G + 3.0_wp*matmul(r, transpose(r))
      operator_problem = with_operator(problem)
      rescues = 0
      do k = 1, 8
         free%expected_closed = problem%r_0(1::3) < 0.3_wp
         q = [1.0_wp, 0.3_wp*cos(0.9_wp*k), 0.02_wp*sin(1.7_wp*k)]*20.0_wp*k
         a = new_state(problem)
         b = a
         call dense%start(problem, a, failure)
         if (.not. allocated(failure)) call free%start(operator_problem, b, failure)
         call check(error,.not. allocated(failure), 'start failed')
         if (allocated(error)) return
         call dense%advance(problem, q, a, record_a)
         call free%advance(operator_problem, q, b, record_b)
         rescues = rescues + record_b%rescues
         call check(error, record_a%converged .and. record_b%converged, 'not converged')
         if (allocated(error)) return
         call check(error, maxval(abs(a%force - b%force)) <= tolerance*maxval(a%force), 'forces differ')
         if (allocated(error)) return
      end do
      call check(error, rescues > 0, 'Newton did it alone')
   end subroutine test_one_step

   !> Open, sticking, slipping and frictionless points, against the matrix written out from the definition.
   subroutine test_linear_system(error)
      type(error_type), allocatable, intent(out) :: error
      type(contact_problem_t) :: problem, operator_problem
      type(closed_system_t) :: system
      type(mslip_error), allocatable :: failure
      real(wp), allocatable :: E(:, :), friction_part(:, :), J(:, :), rhs(:, :), x(:, :), exact(:, :)
      real(wp) :: d(2), first, last
      integer :: p, n, columns, steps
      real(wp), parameter :: exactness = 1.0e-9_wp

      problem = half_space_like_problem(6, 5, 0.4_wp)
      operator_problem = with_operator(problem)
      n = problem%n_points
      call system%set_up(operator_problem%compliance, problem%friction, &
         & [(merge(state_open, state_stick, mod(p, 4) == 0), p=1, n)])
      call system%learn(operator_problem%compliance, failure)
      allocate (E(3*n, 3*n), friction_part(3*n, 3*n), source=0.0_wp)
      columns = 0
      do p = 1, n
         if (mod(p, 4) == 1) system%states(p) = state_slip
         if (mod(p, 8) == 2) system%states(p) = state_frictionless
         if (system%states(p) == state_open) cycle
         E(3*p - 2, columns + 1) = 1.0_wp
         columns = columns + 1
         select case (system%states(p))
         case (state_stick)
            E(3*p - 1, columns + 1) = 1.0_wp
            E(3*p, columns + 2) = 1.0_wp
            columns = columns + 2
         case (state_slip)
            d = [cos(1.3_wp*p), sin(1.3_wp*p)]
            system%direction(:, p) = d
            system%drag(p) = 10.0_wp**mod(p, 5)
            E(3*p - 1:3*p, columns + 1) = [-d(2), d(1)]
            friction_part(3*p - 1:3*p, columns) = problem%friction(p)*d
            columns = columns + 1
         end select
      end do
      E = E(:, :columns)
      friction_part = E + friction_part(:, :columns)
      J = matmul(problem%G, friction_part)
      J = matmul(transpose(E), J)
      do p = 1, columns
         n = findloc(E(:, p) /= 0.0_wp, .true., dim=1)
         if (mod(n, 3) /= 1 .and. system%states((n + 2)/3) == state_slip) J(p, p) = J(p, p) + system%drag((n + 2)/3)
      end do
      allocate (rhs(3, problem%n_points), x(3, problem%n_points))
      call random_number(rhs)
      exact = matmul(transpose(E), reshape(rhs, [size(rhs), 1]))
      call solve_general(J, exact, failure)
      call check(error, .not. allocated(failure))
      if (allocated(error)) return
      exact = matmul(E, exact)
      call system%solve(operator_problem%compliance, rhs, 1.0e-12_wp, 0.0_wp, 100, x, steps, first, last)
      call check(error, last <= 1.0e-12_wp*first, 'not converged')
      if (allocated(error)) return
      call check(error, maxval(abs(reshape(x, [size(x)]) - exact(:, 1))) <= exactness*maxval(abs(exact)), 'solutions differ')
   end subroutine test_linear_system

   !> A few strong directions cost nothing once they are known.
   subroutine test_learning(error)
      type(error_type), allocatable, intent(out) :: error
      type(contact_problem_t) :: problem
      type(closed_system_t) :: system
      type(mslip_error), allocatable :: failure
      real(wp), allocatable :: rhs(:, :), x(:, :)
      real(wp) :: first, last
      integer :: p, before, after

      problem = with_operator(half_space_like_problem(12, 10, 0.4_wp))
      call system%set_up(problem%compliance, problem%friction, [(state_stick, p=1, problem%n_points)])
      allocate (rhs(3, problem%n_points), x(3, problem%n_points))
      call random_number(rhs)
      call system%solve(problem%compliance, rhs, 1.0e-8_wp, 0.0_wp, 200, x, before, first, last)
      call system%learn(problem%compliance, failure)
      call system%solve(problem%compliance, rhs, 1.0e-8_wp, 0.0_wp, 200, x, after, first, last)
      call check(error, .not. allocated(failure) .and. last <= 1.0e-8_wp*first .and. 3*after < 2*before)
   end subroutine test_learning

   !> A tolerance below rounding cannot be met: the record says so, and how far it came.
   subroutine test_unconverged(error)
      type(error_type), allocatable, intent(out) :: error
      type(contact_problem_t) :: problem
      type(matrix_free_solver_t) :: solver
      type(contact_state_t) :: state
      type(solve_record_t) :: record
      type(mslip_error), allocatable :: failure

      problem = with_operator(half_space_like_problem(4, 3, 0.4_wp))
      solver%tolerance = 1.0e-25_wp
      state = new_state(problem)
      call solver%start(problem, state, failure)
      call solver%advance(problem, driver(6), state, record)
      call check(error, .not. allocated(failure) .and. .not. record%converged)
      if (allocated(error)) return
      call check(error, record%residual > solver%tolerance .and. record%error_estimate > solver%tolerance)
      if (allocated(error)) return
      call check(error, all(record%counts == count_states(state)) .and. allocated(record%reaction), 'books')
   end subroutine test_unconverged

   subroutine test_needs_operator(error)
      type(error_type), allocatable, intent(out) :: error
      type(contact_problem_t) :: problem
      type(matrix_free_solver_t) :: solver
      type(mslip_error), allocatable :: failure

      problem = half_space_like_problem(3, 3, 0.4_wp)
      call solver%start(problem, new_state(problem), failure)
      call check(error, allocated(failure))
      if (allocated(error)) return
      call check(error, index(failure%message, 'operator') > 0)
   end subroutine test_needs_operator

end module test_contact_matrix_free
