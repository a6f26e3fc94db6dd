!> The solvers that take any compliance, Gauss-Seidel and Newton on the contact forces: one point in closed form, the
!> error measure, agreement with the condensed solver, singular and contradictory problems, and problems of FCLib.
module test_contact_any_compliance
   use microslip_contact_condensed, only: condensed_solver_t
   use microslip_contact_factory, only: contact_options_t, contact_solver_names, new_contact_solver
   use microslip_contact_laws, only: state_open, state_stick, state_slip
   use microslip_contact_natural_map, only: natural_map_error, project_on_cone
   use microslip_contact_one_point, only: solve_one_point
   use microslip_contact_problem, only: contact_problem_t, contact_state_t, contact_solver_t, solve_record_t, new_state
   use microslip_core_error, only: mslip_error => error_t
   use microslip_core_kinds, only: wp
   use microslip_io_fclib, only: read_fclib
   use support_checks, only: good
   use test_contact_solvers, only: half_space_like_problem
   use testdrive, only: new_unittest, unittest_type, error_type, check
   implicit none(type, external)
   private

   public :: collect_contact_any_compliance

   character(len=*), parameter :: force_solvers(2) = [character(len=12) :: 'gauss_seidel', 'newton']
   !> Of forces and gaps of order one.
   real(wp), parameter :: rounding = 1.0e3_wp*epsilon(1.0_wp)

contains

   subroutine collect_contact_any_compliance(testsuite)
      type(unittest_type), allocatable, intent(out) :: testsuite(:)
      testsuite = [ &
         & new_unittest('one point: open, stick, slip', test_one_point), &
         & new_unittest('one point: any compliance', test_one_point_random), &
         & new_unittest('one point without compliance sideways', test_one_point_singular), &
         & new_unittest('projection on the cone', test_projection), &
         & new_unittest('natural map measures violations', test_natural_map), &
         & new_unittest('equal to the condensed solver', test_equals_condensed), &
         & new_unittest('velocity level equal to condensed', test_velocity_level), &
         & new_unittest('hyperstatic contact', test_hyperstatic), &
         & new_unittest('contradictory contact is not converged', test_contradictory), &
         & new_unittest('too few iterations are not converged', test_few_iterations), &
         & new_unittest('bad compliance is refused', test_refused), &
         & new_unittest('FCLib problems by Newton', test_fclib_newton), &
         & new_unittest('FCLib problems by Gauss-Seidel', test_fclib_gauss_seidel)]
   end subroutine collect_contact_any_compliance

   !> Own compliance a I: the three states in closed form.
   subroutine test_one_point(error)
      type(error_type), allocatable, intent(out) :: error
      real(wp), parameter :: a = 2.0_wp, friction = 0.5_wp
      real(wp) :: own(3, 3), force(3)
      integer :: status, k

      own = 0.0_wp
      do k = 1, 3
         own(k, k) = a
      end do
      call solve_one_point(own, [0.1_wp, 3.0_wp, 4.0_wp], friction, force, status)
      call check(error, status == state_open .and. all(force == 0.0_wp), 'open')
      if (allocated(error)) return
      call solve_one_point(own, [-1.0_wp, 0.3_wp, -0.2_wp], friction, force, status)
      call check(error, status == state_stick .and. norm2(force - [0.5_wp, -0.15_wp, 0.1_wp]) < rounding, 'stick')
      if (allocated(error)) return
      call solve_one_point(own, [-1.0_wp, 3.0_wp, -4.0_wp], friction, force, status)
      call check(error, status == state_slip .and. norm2(force - 0.5_wp*[1.0_wp, -0.3_wp, 0.4_wp]) < rounding, 'slip')
      if (allocated(error)) return
      call solve_one_point(own, [-1.0_wp, 3.0_wp, -4.0_wp], 0.0_wp, force, status)
      call check(error, status == state_slip .and. norm2(force - [0.5_wp, 0.0_wp, 0.0_wp]) < rounding, 'no friction')
   end subroutine test_one_point

   !> Full, coupled, badly conditioned compliances: the laws hold to rounding.
   subroutine test_one_point_random(error)
      type(error_type), allocatable, intent(out) :: error
      real(wp) :: B(3, 3), own(3, 3), free(3), force(3), friction, worst
      integer :: status, k, j, seen(0:2)

      worst = 0.0_wp
      seen = 0
      do k = 1, 2000
         B = reshape([(sin(real(7*k*j + j*j, wp)), j=1, 9)], [3, 3])
         B(:, 3) = B(:, 3)*10.0_wp**(-mod(k, 4))
         own = matmul(B, transpose(B))
         free = [cos(real(k, wp)), sin(real(5*k, wp)), sin(real(11*k, wp))]
         friction = 0.1_wp*mod(k, 13)
         call solve_one_point(own, free, friction, force, status)
         worst = max(worst, natural_map_error(own, free, [friction], force)/max(1.0_wp, norm2(force)))
         seen(status) = seen(status) + 1
      end do
      call check(error, worst < rounding, 'laws violated')
      if (allocated(error)) return
      call check(error, minval(seen) > 50, 'a state does not occur')
   end subroutine test_one_point_random

   !> A point that its tangential force does not move slips, or sticks where nothing drives it.
   subroutine test_one_point_singular(error)
      type(error_type), allocatable, intent(out) :: error
      real(wp) :: own(3, 3), force(3)
      integer :: status

      own = 0.0_wp
      own(1, 1) = 1.0_wp
      call solve_one_point(own, [-1.0_wp, 0.3_wp, 0.0_wp], 0.5_wp, force, status)
      call check(error, status == state_slip .and. norm2(force - [1.0_wp, -0.5_wp, 0.0_wp]) < rounding)
      if (allocated(error)) return
      call solve_one_point(own, [-1.0_wp, 0.0_wp, 0.0_wp], 0.5_wp, force, status)
      call check(error, status == state_stick .and. norm2(force - [1.0_wp, 0.0_wp, 0.0_wp]) < rounding)
   end subroutine test_one_point_singular

   !> Moreau: x = P(x) + N with P in the cone, N in its polar cone, and both orthogonal.
   subroutine test_projection(error)
      type(error_type), allocatable, intent(out) :: error
      real(wp) :: x(3), inside(3), rest(3), friction
      integer :: k

      do k = 1, 200
         x = [sin(real(k, wp)), sin(real(3*k, wp)), cos(real(7*k, wp))]
         friction = 0.2_wp*mod(k, 6)
         inside = project_on_cone(x, friction)
         rest = x - inside
         call check(error, norm2(inside(2:3)) <= friction*inside(1) + rounding .and. &
            & friction*norm2(rest(2:3)) <= -rest(1) + rounding .and. abs(dot_product(inside, rest)) < rounding)
         if (allocated(error)) return
      end do
   end subroutine test_projection

   !> A point that penetrates by d without force has the error d; so has a normal force d on an open point that is
   !> wider open than that; sticking with a force d outside the disk less than d.
   subroutine test_natural_map(error)
      type(error_type), allocatable, intent(out) :: error
      real(wp), parameter :: none(3, 3) = 0.0_wp, d = 1.0e-3_wp, mu(1) = 0.5_wp
      real(wp) :: outside

      call check(error, natural_map_error(none, [-d, 0.0_wp, 0.0_wp], mu, [0.0_wp, 0.0_wp, 0.0_wp]), d, thr=rounding)
      if (allocated(error)) return
      call check(error, natural_map_error(none, [0.5_wp, 0.0_wp, 0.0_wp], mu, [d, 0.0_wp, 0.0_wp]), d, thr=rounding)
      if (allocated(error)) return
      outside = natural_map_error(none, [0.0_wp, 0.0_wp, 0.0_wp], mu, [1.0_wp, 0.5_wp + d, 0.0_wp])
      call check(error, outside > 0.5_wp*d .and. outside <= d)
      if (allocated(error)) return
      ! Slip against the force is right, slip along it is not.
      call check(error, natural_map_error(none, [0.0_wp, -d, 0.0_wp], mu, [1.0_wp, 0.5_wp, 0.0_wp]), 0.0_wp, thr=rounding)
      if (allocated(error)) return
      call check(error, natural_map_error(none, [0.0_wp, d, 0.0_wp], mu, [1.0_wp, 0.5_wp, 0.0_wp]) > 0.5_wp*d)
   end subroutine test_natural_map

   !> Largest difference of the forces to those of the condensed solver on a path through all states.
   subroutine compare_with_condensed(velocity_level, error)
      logical, intent(in) :: velocity_level
      type(error_type), allocatable, intent(out) :: error
      type(contact_problem_t) :: problem
      type(condensed_solver_t) :: condensed
      class(contact_solver_t), allocatable :: solver
      type(contact_state_t) :: a, b
      type(solve_record_t) :: record_a, record_b
      type(mslip_error), allocatable :: failed
      integer :: k, s
      real(wp) :: q(3)

      problem = half_space_like_problem(5, 4, 0.4_wp)
      problem%velocity_level = velocity_level
      do s = 1, size(force_solvers)
         call new_contact_solver(contact_options_t(trim(force_solvers(s)), tolerance=1.0e-12_wp), solver, failed)
         if (.not. allocated(failed)) call solver%start(problem, new_state(problem), failed)
         if (.not. allocated(failed)) call condensed%start(problem, new_state(problem), failed)
         call good(error, failed)
         if (allocated(error)) return
         a = new_state(problem)
         b = a
         do k = 1, 40
            q = [min(1.0_wp, 0.2_wp*k) - merge(0.9_wp*sin(0.3_wp*k), 0.0_wp, k > 25), &
               & 0.6_wp*sin(0.45_wp*k), &
               & 0.1_wp*sin(0.7_wp*k)]
            call condensed%advance(problem, q, a, record_a)
            call solver%advance(problem, q, b, record_b)
            call check(error, record_a%converged .and. record_b%converged, trim(force_solvers(s))//': not converged')
            if (allocated(error)) return
            call check(error, maxval(abs(a%force - b%force)), 0.0_wp, thr=1.0e-8_wp)
            if (allocated(error)) return
            call check(error, all(b%status == state_open .eqv. b%force(1, :) == 0.0_wp), 'open points with forces')
            if (allocated(error)) return
         end do
      end do
   end subroutine compare_with_condensed

   subroutine test_equals_condensed(error)
      type(error_type), allocatable, intent(out) :: error
      call compare_with_condensed(.false., error)
   end subroutine test_equals_condensed

   subroutine test_velocity_level(error)
      type(error_type), allocatable, intent(out) :: error
      call compare_with_condensed(.true., error)
   end subroutine test_velocity_level

   !> Four points that carry one rigid body: 12 forces, 6 motions. The driver is c.
   function table_on_four_legs(c) result(problem)
      !> (6) free motion of the body: along n, t1, t2, and rotations about them
      real(wp), intent(in) :: c(6)
      type(contact_problem_t) :: problem
      real(wp), parameter :: place(2, 4) = reshape([1.0_wp, 1.0_wp, -1.0_wp, 1.0_wp, -1.0_wp, -1.0_wp, 1.0_wp, -1.0_wp], [2, 4])
      real(wp) :: H(12, 6)
      integer :: p, k

      H = 0.0_wp
      do p = 1, 4
         k = 3*p - 2
         H(k, 1) = 1.0_wp
         H(k + 1, 2) = 1.0_wp
         H(k + 2, 3) = 1.0_wp
         H(k + 1, 4) = -place(2, p)
         H(k + 2, 4) = place(1, p)
         H(k, 5) = place(2, p)
         H(k, 6) = -place(1, p)
      end do
      problem%n_points = 4
      problem%G = matmul(H, transpose(H))
      problem%R = reshape(matmul(H, c), [12, 1])
      allocate (problem%r_0(12), source=0.0_wp)
      problem%friction = spread(0.3_wp, 1, 4)
   end function table_on_four_legs

   !> Forces are not unique, motions are: the body sticks, slides, tilts.
   subroutine test_hyperstatic(error)
      type(error_type), allocatable, intent(out) :: error
      real(wp), parameter :: motion(6, 3) = reshape([ &
         & -1.0_wp, 0.2_wp, 0.0_wp, 0.0_wp, 0.0_wp, 0.0_wp, &
         & -1.0_wp, 0.9_wp, 0.3_wp, 0.2_wp, 0.0_wp, 0.0_wp, &
         & -1.0_wp, 0.9_wp, 0.0_wp, 0.0_wp, 0.3_wp, 1.4_wp], [6, 3])
      integer :: k, s
      type(contact_problem_t) :: problem

      do k = 1, size(motion, 2)
         problem = table_on_four_legs(motion(:, k))
         do s = 1, size(force_solvers)
            call solve_to(problem, trim(force_solvers(s)), 1.0e-10_wp, error)
            if (allocated(error)) return
         end do
      end do
   end subroutine test_hyperstatic

   !> Solve the step to driver 1 and check that what is called converged has at most this natural map.
   subroutine solve_to(problem, name, wanted, error)
      type(contact_problem_t), intent(in) :: problem
      character(len=*), intent(in) :: name
      real(wp), intent(in) :: wanted
      type(error_type), allocatable, intent(out) :: error
      class(contact_solver_t), allocatable :: solver
      type(contact_state_t) :: state
      type(solve_record_t) :: record
      type(mslip_error), allocatable :: failed
      real(wp) :: distance

      call new_contact_solver(contact_options_t(name, tolerance=1.0e-12_wp), solver, failed)
      state = new_state(problem)
      if (.not. allocated(failed)) call solver%start(problem, state, failed)
      call good(error, failed)
      if (allocated(error)) return
      call solver%advance(problem, [1.0_wp], state, record)
      call check(error, record%converged .and. record%residual <= solver%tolerance, name//': not converged')
      if (allocated(error)) return
      distance = natural_map_error(problem%G, problem%r_0 + problem%R(:, 1), problem%friction, &
         & reshape(state%force, [3*problem%n_points]))
      call check(error, distance <= wanted, name//': converged, but the laws do not hold')
   end subroutine solve_to

   !> Two points on opposite sides of a body that is wider than the room between two walls: no forces help.
   subroutine test_contradictory(error)
      type(error_type), allocatable, intent(out) :: error
      type(contact_problem_t) :: problem
      class(contact_solver_t), allocatable :: solver
      type(contact_state_t) :: state
      type(solve_record_t) :: record
      type(mslip_error), allocatable :: failed
      integer :: k

      problem%n_points = 2
      allocate (problem%G(6, 6), problem%r_0(6), source=0.0_wp)
      do k = 1, 6
         problem%G(k, k) = 1.0_wp
      end do
      problem%G(1, 4) = -1.0_wp
      problem%G(4, 1) = -1.0_wp
      problem%R = reshape([-1.0_wp, 0.1_wp, 0.0_wp, -1.0_wp, 0.0_wp, 0.2_wp], [6, 1])
      problem%friction = [0.3_wp, 0.3_wp]
      do k = 1, size(force_solvers)
         call new_contact_solver(contact_options_t(trim(force_solvers(k)), max_iterations=2000), solver, failed)
         state = new_state(problem)
         call solver%start(problem, state, failed)
         call solver%advance(problem, [1.0_wp], state, record)
         call check(error,.not. record%converged .and. record%residual > solver%tolerance, trim(force_solvers(k)))
         if (allocated(error)) return
      end do
   end subroutine test_contradictory

   subroutine test_few_iterations(error)
      type(error_type), allocatable, intent(out) :: error
      type(contact_problem_t) :: problem
      class(contact_solver_t), allocatable :: solver
      type(contact_state_t) :: state
      type(solve_record_t) :: record
      type(mslip_error), allocatable :: failed
      integer :: k

      problem = half_space_like_problem(5, 5, 0.5_wp)
      do k = 1, size(force_solvers)
         call new_contact_solver(contact_options_t(trim(force_solvers(k)), max_iterations=3), solver, failed)
         state = new_state(problem)
         call solver%start(problem, state, failed)
         call solver%advance(problem, [1.0_wp, 0.3_wp, 0.0_wp], state, record)
         call check(error,.not. record%converged .and. record%iterations == 3 .and. &
            & record%error_estimate > solver%tolerance, trim(force_solvers(k)))
         if (allocated(error)) return
      end do
   end subroutine test_few_iterations

   !> No matrix, a point without compliance, a state of another problem, an unknown name.
   subroutine test_refused(error)
      type(error_type), allocatable, intent(out) :: error
      type(contact_problem_t) :: problem, other
      class(contact_solver_t), allocatable :: solver
      type(mslip_error), allocatable :: failed
      integer :: k

      do k = 1, size(force_solvers)
         call new_contact_solver(contact_options_t(trim(force_solvers(k))), solver, failed)
         problem = half_space_like_problem(2, 2, 0.5_wp)
         other = half_space_like_problem(3, 2, 0.5_wp)
         call solver%start(problem, new_state(other), failed)
         call check(error, allocated(failed), 'state of another problem')
         if (allocated(error)) return
         problem%G(4, 4) = 0.0_wp
         call solver%start(problem, new_state(problem), failed)
         call check(error, allocated(failed), 'point without compliance')
         if (allocated(error)) return
         deallocate (problem%G)
         call solver%start(problem, new_state(problem), failed)
         call check(error, allocated(failed), 'no matrix')
         if (allocated(error)) return
      end do
      call new_contact_solver(contact_options_t('simplex'), solver, failed)
      call check(error, index(failed%message, "'"//trim(contact_solver_names(5))//"'") > 0, 'known names are not listed')
   end subroutine test_refused

   subroutine solve_fclib(name, solver, error)
      character(len=*), intent(in) :: name, solver
      type(error_type), allocatable, intent(out) :: error
      type(contact_problem_t) :: problem
      type(mslip_error), allocatable :: failed

      call read_fclib('example/frictional_contact/problems/'//name//'.hdf5', problem, failed)
      call good(error, failed)
      if (.not. allocated(error)) call solve_to(problem, solver, 1.0e-8_wp, error)
   end subroutine solve_fclib

   !> Singular compliances, badly scaled ones, and one that no other solver here takes (boxes).
   subroutine test_fclib_newton(error)
      type(error_type), allocatable, intent(out) :: error
      character(len=*), parameter :: names(6) = [character(len=36) :: 'Rover1040', 'OneObject-i100000-499', &
         & 'BoxesStack1-i100000-32', 'LMGC_100_PR_PerioBox-i00361-60-03000', 'Confeti-ex03-Fc3D-SBM', &
         & 'Confeti-ex13-4contact-Fc3D-SBM']
      integer :: k

      do k = 1, size(names)
         call solve_fclib(trim(names(k)), 'newton', error)
         if (allocated(error)) return
      end do
   end subroutine test_fclib_newton

   subroutine test_fclib_gauss_seidel(error)
      type(error_type), allocatable, intent(out) :: error
      character(len=*), parameter :: names(5) = [character(len=24) :: 'FrictionContact3D_RR_1c', 'FC3D_Example1', &
         & 'Rover9770', 'NESpheres_10_1', 'Confeti-ex03-Fc3D-SBM']
      integer :: k

      do k = 1, size(names)
         call solve_fclib(trim(names(k)), 'gauss_seidel', error)
         if (allocated(error)) return
      end do
   end subroutine test_fclib_gauss_seidel

end module test_contact_any_compliance
