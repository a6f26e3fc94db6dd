!> Directions in which the structure gives way far more than the contact, kept apart in the problem: pressed, tilted into partial
!> lift-off and sheared by loads on three of them, as a block on weak springs is.
module test_contact_soft_directions
   use microslip_contact_base_set, only: base_set_t
   use microslip_contact_condensed, only: condensed_solver_t
   use microslip_contact_laws, only: state_open, state_stick, state_slip
   use microslip_contact_matrix_free, only: matrix_free_solver_t
   use microslip_contact_problem, only: contact_problem_t, contact_solver_t, contact_state_t, new_state, solve_record_t
   use microslip_core_error, only: mslip_error => error_t
   use microslip_core_kinds, only: wp
   use support_dense_compliance, only: with_operator
   use test_contact_solvers, only: half_space_like_problem
   use testdrive, only: new_unittest, unittest_type, error_type, check
   implicit none(type, external)
   private

   public :: collect_contact_soft_directions

   integer, parameter :: nx = 8, ny = 6, steps = 40
   real(wp), parameter :: friction = 0.4_wp, weight = 20.0_wp
   !> Of the solvers, and how far two of them may be apart: each is as near to the laws as its tolerance says, on the way there
   !> and in the memory of friction.
   real(wp), parameter :: tolerance = 1.0e-11_wp, alike = 2*steps*1.0e-9_wp

contains

   subroutine collect_contact_soft_directions(testsuite)
      type(unittest_type), allocatable, intent(out) :: testsuite(:)
      testsuite = [ &
         & new_unittest('apart equals joined', test_joined), &
         & new_unittest('forces do not depend on how weak the springs are', test_weak_springs), &
         & new_unittest('by operator', test_operator), &
         & new_unittest('points that join and leave', test_bordering)]
   end subroutine collect_contact_soft_directions

   !> Points of the half-space-like problem on a block that shifts along n, tilts and shifts along t1 on springs of stiffness
   !> 1/softness; drivers: force down, moment, force along t1.
   function block_on_springs(softness) result(problem)
      real(wp), intent(in) :: softness
      type(contact_problem_t) :: problem
      integer :: p

      problem = half_space_like_problem(nx, ny, friction)
      problem%R = 0.0_wp*problem%R
      allocate (problem%soft(3*nx*ny, 3), source=0.0_wp)
      problem%soft(1::3, 1) = 1.0_wp
      problem%soft(1::3, 2) = [(real(mod(p - 1, nx), wp) - 0.5_wp*(nx - 1), p=1, nx*ny)]
      problem%soft(2::3, 3) = 1.0_wp
      problem%soft = sqrt(softness)*problem%soft
      problem%soft_drive = sqrt(softness)*reshape([-1.0_wp, 0.0_wp, 0.0_wp, 0.0_wp, 1.0_wp, 0.0_wp, 0.0_wp, 0.0_wp, 1.0_wp], [3, 3])
      problem%soft_0 = [0.0_wp, 0.0_wp, 0.0_wp]
   end function block_on_springs

   !> The same with the directions in G and R.
   function joined(apart) result(problem)
      type(contact_problem_t), intent(in) :: apart
      type(contact_problem_t) :: problem

      problem = apart
      problem%G = problem%G + matmul(apart%soft, transpose(apart%soft))
      problem%R = problem%R + matmul(apart%soft, apart%soft_drive)
      deallocate (problem%soft, problem%soft_drive, problem%soft_0)
   end function joined

   !> Press, tilt until half of it is off, and shear to and fro near to sliding.
   pure function driver(k) result(q)
      integer, intent(in) :: k
      real(wp) :: q(3)
      real(wp) :: t

      t = real(k, wp)
      q = weight*[min(1.0_wp, 0.01_wp*4.0_wp**(k - 1)), merge(2.6_wp*sin(0.3_wp*t)**2, 0.0_wp, k > 8), &
         & merge(0.9_wp*friction*sin(0.5_wp*(t - 6.0_wp)), 0.0_wp, k > 6)]
   end function driver

   !> Forces along the path, (3, points, steps).
   subroutine drive(problem, solver, forces, records, visited, error)
      type(contact_problem_t), intent(in) :: problem
      class(contact_solver_t), intent(inout) :: solver
      real(wp), allocatable, intent(out) :: forces(:, :, :)
      type(solve_record_t), intent(out) :: records(steps)
      !> Largest number of points seen open, sticking, slipping
      integer, intent(out) :: visited(3)
      type(error_type), allocatable, intent(out) :: error
      type(contact_state_t) :: state
      type(mslip_error), allocatable :: failure
      integer :: k

      solver%tolerance = tolerance
      state = new_state(problem)
      call solver%start(problem, state, failure)
      call check(error, .not. allocated(failure), 'start failed')
      if (allocated(error)) return
      allocate (forces(3, problem%n_points, steps))
      visited = 0
      do k = 1, steps
         call solver%advance(problem, driver(k), state, records(k))
         call check(error, records(k)%converged, 'not converged')
         if (allocated(error)) return
         forces(:, :, k) = state%force
         if (k > 8) visited = max(visited, [count(state%status == state_open), count(state%status == state_stick), &
            & count(state%status == state_slip)])
      end do
   end subroutine drive

   !> Where the directions are no softer than the contact, it makes no difference where they are.
   subroutine test_joined(error)
      type(error_type), allocatable, intent(out) :: error
      type(contact_problem_t) :: problem
      type(condensed_solver_t) :: one, other
      type(solve_record_t) :: apart_records(steps), joined_records(steps)
      real(wp), allocatable :: apart_forces(:, :, :), joined_forces(:, :, :)
      integer :: visited(3), k

      problem = block_on_springs(10.0_wp)
      call drive(problem, one, apart_forces, apart_records, visited, error)
      if (allocated(error)) return
      call check(error, minval(visited) > 5, 'a regime was not visited')
      if (allocated(error)) return
      call drive(joined(problem), other, joined_forces, joined_records, visited, error)
      if (allocated(error)) return
      call check(error, maxval(abs(apart_forces - joined_forces)) <= alike*maxval(joined_forces), 'forces differ')
      if (allocated(error)) return
      do k = 1, steps
         call check(error, maxval(abs(apart_records(k)%reaction - joined_records(k)%reaction)) &
            & <= alike*maxval(abs(joined_records(steps)%reaction)), 'reactions differ')
         if (allocated(error)) return
         call check(error, abs(apart_records(k)%contact_energy - joined_records(k)%contact_energy) &
            & <= alike*joined_records(steps)%contact_energy, 'energies differ')
         if (allocated(error)) return
      end do
   end subroutine test_joined

   !> Springs carry displacement/softness, which is next to nothing: forces stay what they are when the springs are a million
   !> times weaker, and carry the loads.
   subroutine test_weak_springs(error)
      type(error_type), allocatable, intent(out) :: error
      real(wp), parameter :: softness(2) = [1.0e8_wp, 1.0e14_wp]
      !> Displacements, and what a force on the block makes of them at a point, are below this
      real(wp), parameter :: displacement = 100.0_wp
      type(contact_problem_t) :: problem
      type(condensed_solver_t) :: solver
      type(solve_record_t) :: records(steps)
      real(wp), allocatable :: forces(:, :, :), weaker(:, :, :)
      real(wp) :: q(3)
      integer :: visited(3), k

      call drive(block_on_springs(softness(1)), solver, forces, records, visited, error)
      if (allocated(error)) return
      problem = block_on_springs(softness(2))
      call drive(problem, solver, weaker, records, visited, error)
      if (allocated(error)) return
      call check(error, maxval(abs(forces - weaker)) <= displacement/softness(1) + alike*maxval(forces), 'forces differ')
      if (allocated(error)) return
      do k = 1, steps
         q = driver(k)
         call check(error, abs(sum(weaker(1, :, k)) - q(1)) + abs(sum(weaker(2, :, k)) + q(3)) &
            & <= displacement/softness(2) + 1.0e-12_wp*weight, 'loads are not carried')
         if (allocated(error)) return
      end do
   end subroutine test_weak_springs

   !> The solver for operators, however weak the springs are.
   subroutine test_operator(error)
      type(error_type), allocatable, intent(out) :: error
      real(wp), parameter :: softness(3) = [10.0_wp, 1.0e8_wp, 1.0e14_wp]
      type(contact_problem_t) :: problem
      type(condensed_solver_t) :: condensed
      type(matrix_free_solver_t) :: free
      type(solve_record_t) :: records(steps)
      real(wp), allocatable :: forces(:, :, :), by_operator(:, :, :)
      integer :: visited(3), k

      do k = 1, size(softness)
         problem = block_on_springs(softness(k))
         call drive(problem, condensed, forces, records, visited, error)
         if (allocated(error)) return
         call drive(with_operator(problem), free, by_operator, records, visited, error)
         if (allocated(error)) return
         call check(error, maxval(abs(forces - by_operator)) <= alike*maxval(forces), 'forces differ')
         if (allocated(error)) return
      end do
   end subroutine test_operator

   !> Operators of a base set that points joined and left equal those factorised for the same points, and are not those.
   subroutine test_bordering(error)
      type(error_type), allocatable, intent(out) :: error
      real(wp), parameter :: softness(2) = [10.0_wp, 1.0e14_wp]
      type(contact_problem_t) :: problem
      type(base_set_t) :: bordered, factorised
      type(mslip_error), allocatable :: failure
      integer :: k, p

      do k = 1, size(softness)
         problem = block_on_springs(softness(k))
         problem%R(:, 1) = [(sin(real(p, wp)), p=1, 3*problem%n_points)]
         call bordered%build(problem, [(p, p=1, 30)], failure)
         if (.not. allocated(failure)) call bordered%enter(problem, [40, 33, 45], failure)
         if (.not. allocated(failure)) call factorised%build(problem, [(p, p=1, 30), 40, 33, 45], failure)
         call check(error, .not. allocated(failure), 'not factorised')
         if (.not. allocated(error)) call compare(bordered, factorised, error)
         if (allocated(error)) return
         call bordered%leave(problem, [7, 33, 12, 13], failure)
         if (.not. allocated(failure)) call factorised%build(problem, bordered%inside, failure)
         call check(error, .not. allocated(failure), 'not factorised')
         if (.not. allocated(error)) call compare(bordered, factorised, error)
         if (allocated(error)) return
      end do
   end subroutine test_bordering

   !> All operators of two base sets.
   subroutine compare(one, other, error)
      type(base_set_t), intent(in) :: one, other
      type(error_type), allocatable, intent(out) :: error
      !> Rounding times the condition of G without the soft directions, which is 1e2
      real(wp), parameter :: rounding = 1.0e2_wp*1.0e2_wp*epsilon(1.0_wp)

      call check(error, any(one%M /= other%M), 'points did not join or leave by bordering')
      if (.not. allocated(error)) call check(error, alike_to(one%M, other%M), 'M')
      if (.not. allocated(error)) call check(error, alike_to(one%T_t, other%T_t), 'T')
      if (.not. allocated(error)) call check(error, alike_to(one%slope, other%slope), 'S')
      if (.not. allocated(error)) call check(error, alike_to(one%slope_outside, other%slope_outside), 'N')
      if (.not. allocated(error)) call check(error, alike_to(one%stiffness, other%stiffness), 'stiffness')
      if (.not. allocated(error)) call check(error, alike_to(one%soft, other%soft), 'M V')
      if (.not. allocated(error)) call check(error, alike_to(one%soft_rest, other%soft_rest), 'H')
      if (.not. allocated(error)) call check(error, alike_to(one%soft_outside, other%soft_outside), 'E')

   contains

      logical function alike_to(a, b)
         real(wp), intent(in) :: a(:, :), b(:, :)
         alike_to = maxval(abs(a - b)) <= rounding*maxval(abs(b))
      end function alike_to

   end subroutine compare

end module test_contact_soft_directions
