!> The solver for operators against the condensed one, on random problems driven through stick, slip, lift-off and
!> re-closing, and its linear systems against dense ones.
module test_contact_matrix_free
   use microslip_contact_condensed, only: condensed_solver_t
   use microslip_contact_laws, only: state_open, state_stick, state_slip
   use microslip_contact_matrix_free, only: matrix_free_solver_t
   use microslip_contact_problem, only: contact_problem_t, contact_state_t, solve_record_t, new_state
   use microslip_core_error, only: mslip_error => error_t
   use microslip_core_kinds, only: wp
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
         & new_unittest('equals condensed on velocity level', test_velocity_level)]
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

end module test_contact_matrix_free
