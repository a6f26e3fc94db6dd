!> Cold starts with friction: from nothing into contact and partial or gross slip in one step, where friction follows normal
!> forces that are far off at first. The laws have a solution for any symmetric positive definite compliance, so the condensed
!> solver must find it.
module test_contact_cold_starts
   use microslip_contact_condensed, only: condensed_solver_t
   use microslip_contact_factory, only: contact_options_t, new_contact_solver
   use microslip_contact_problem, only: contact_problem_t, contact_solver_t, contact_state_t, solve_record_t, new_state
   use microslip_core_error, only: mslip_error => error_t
   use microslip_core_kinds, only: wp
   use microslip_halfspace_love_cerruti, only: elastic_material, half_space_pair, material_t
   use microslip_linalg_dense, only: product_of
   use support_contact_verdict, only: all_solvers, law_violation
   use support_dense_compliance, only: with_operator
   use support_half_space, only: new_spheres, spheres_t
   use support_mesh, only: pseudo_random
   use test_contact_solvers, only: half_space_like_problem
   use testdrive, only: new_unittest, unittest_type, error_type, check
   implicit none(type, external)
   private

   public :: collect_contact_cold_starts

   !> Of the solver, and what a violation by the definition may be: the gaps of all points are sums of forces that are each right
   !> to the tolerance.
   real(wp), parameter :: tolerance = 1.0e-10_wp, allowed = 1.0e3_wp*tolerance

contains

   subroutine collect_contact_cold_starts(testsuite)
      type(unittest_type), allocatable, intent(out) :: testsuite(:)
      testsuite = [ &
         & new_unittest('a structure softer than the contact', test_soft_structure), &
         & new_unittest('steel on aluminium and on rubber', test_unequal_materials), &
         & new_unittest('random compliances', test_random), &
         & new_unittest('the limit of iterations holds for every solver', test_limit)]
   end subroutine collect_contact_cold_starts

   !> One step from no contact to driver q.
   subroutine step_from_nothing(problem, q, solved)
      type(contact_problem_t), intent(in) :: problem
      real(wp), intent(in) :: q(:)
      !> Called converged, and obeys the laws; wrong: called converged, and does not
      logical, intent(out) :: solved
      type(condensed_solver_t) :: solver
      type(contact_state_t) :: before, state
      type(solve_record_t) :: record
      type(mslip_error), allocatable :: failure

      solver%tolerance = tolerance
      before = new_state(problem)
      state = before
      call solver%start(problem, state, failure)
      solved = .not. allocated(failure)
      if (.not. solved) return
      call solver%advance(problem, q, state, record)
      solved = record%converged .and. law_violation(problem, before, state) <= allowed*maxval(state%force)
   end subroutine step_from_nothing

   !> A structure that shifts, tilts, and tilts where it is sheared, up to a hundred times softer than the contact.
   subroutine test_soft_structure(error)
      type(error_type), allocatable, intent(out) :: error
      type(contact_problem_t) :: problem
      real(wp), allocatable :: r(:, :)
      real(wp) :: q(3), softness
      integer :: k, solved_ones
      logical :: solved
      integer, parameter :: cases = 24

      solved_ones = 0
      do k = 1, cases
         problem = half_space_like_problem(10, 8, 0.2_wp + 0.2_wp*mod(k, 6))
         softness = 3.0_wp*10.0_wp**(mod(k, 3) - 1)
         r = problem%R
         r(:, 2) = r(:, 2) + 0.3_wp*r(:, 3)
         call product_of(r, r, problem%G, transpose_b=.true., factor=softness, keep=1.0_wp)
         q = [1.0_wp, 0.3_wp*cos(0.9_wp*k), 0.02_wp*sin(1.7_wp*k)]*20.0_wp*(1 + mod(k, 8))
         call step_from_nothing(problem, q, solved)
         if (solved) solved_ones = solved_ones + 1
      end do
      call check(error, solved_ones == cases, 'not all are solved')
   end subroutine test_soft_structure

   !> Spheres pressed together and sheared at once: normal and tangential displacements are coupled.
   subroutine test_unequal_materials(error)
      type(error_type), allocatable, intent(out) :: error
      type(spheres_t) :: spheres
      type(material_t) :: steel, other
      type(mslip_error), allocatable :: failure
      real(wp) :: q(3)
      integer :: k, solved_ones
      logical :: solved
      integer, parameter :: cases = 24

      solved_ones = 0
      call elastic_material(steel, 2.1e11_wp, 0.3_wp, failure)
      do k = 1, cases
         if (mod(k, 2) == 0) call elastic_material(other, 7.0e10_wp, 0.33_wp, failure)
         if (mod(k, 2) == 1) call elastic_material(other, 1.0e7_wp, 0.0_wp, failure)
         call new_spheres(spheres, half_space_pair(steel, other), 0.1_wp, 1.0e-3_wp, 4 + mod(k, 3), 0.05_wp + 0.3_wp*mod(k, 6))
         q = spheres%approach*[1.0_wp, 0.4_wp*(1 + mod(k, 5))*cos(0.7_wp*k), 0.4_wp*(1 + mod(k, 5))*sin(0.7_wp*k)]
         call step_from_nothing(spheres%problem, q, solved)
         if (solved) solved_ones = solved_ones + 1
      end do
      call check(error, solved_ones == cases, 'not all are solved')
   end subroutine test_unequal_materials

   !> Compliances B B^T + 0.01 of random B: as strong a coupling of normal and tangential as there can be.
   subroutine test_random(error)
      type(error_type), allocatable, intent(out) :: error
      type(contact_problem_t) :: problem
      real(wp), allocatable :: B(:, :)
      integer :: i, k, n, start, solved_ones
      logical :: solved
      integer, parameter :: cases = 60

      solved_ones = 0
      do k = 1, cases
         n = 4 + 4*mod(k, 5)
         start = 7919*k + 13
         problem%n_points = n
         B = reshape([(pseudo_random(start + i) - 0.5_wp, i=1, 9*n*n)], [3*n, 3*n])
         problem%G = matmul(B, transpose(B))
         problem%G = 0.5_wp*(problem%G + transpose(problem%G))
         do i = 1, 3*n
            problem%G(i, i) = problem%G(i, i) + 1.0e-2_wp
         end do
         problem%r_0 = spread(0.0_wp, 1, 3*n)
         problem%friction = [(2.0_wp*pseudo_random(start + 31*i), i=1, n)]
         problem%R = reshape([(pseudo_random(start + 57*i) - 0.6_wp, i=1, 3*n)], [3*n, 1])
         call step_from_nothing(problem, [1.0_wp], solved)
         if (solved) solved_ones = solved_ones + 1
      end do
      call check(error, solved_ones == cases, 'not all are solved')
   end subroutine test_random

   !> Half of the iterations that a step takes are not enough, and no more are made.
   subroutine test_limit(error)
      type(error_type), allocatable, intent(out) :: error
      class(contact_solver_t), allocatable :: solver
      type(contact_problem_t) :: problem, given
      type(contact_state_t) :: state
      type(solve_record_t) :: record
      type(mslip_error), allocatable :: failure
      integer, parameter :: plenty = 100000
      integer :: k, limit, try

      problem = half_space_like_problem(7, 5, 0.4_wp)
      do k = 1, size(all_solvers)
         given = problem
         if (all_solvers(k) == 'matrix_free') given = with_operator(problem)
         limit = plenty
         do try = 1, 2
            call new_contact_solver(contact_options_t(trim(all_solvers(k)), tolerance, limit), solver, failure)
            state = new_state(given)
            call solver%start(given, state, failure)
            call solver%advance(given, [1.0_wp, 0.3_wp, 0.05_wp], state, record)
            deallocate (solver)
            call check(error, record%converged .eqv. limit == plenty, trim(all_solvers(k))//': converged or not')
            if (.not. allocated(error)) call check(error, record%iterations <= limit, trim(all_solvers(k))//': too many')
            if (allocated(error)) return
            limit = record%iterations/2
         end do
      end do
   end subroutine test_limit

end module test_contact_cold_starts
