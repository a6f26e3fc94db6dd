!> Normal contact without friction: 0 <= force _|_ gap >= 0 with gap = r + G_nn force + V z, z = s + V^T force where soft
!> directions V are kept apart (`microslip_contact_problem`).
!> Primal-dual active set; used to guess the closed points and the loads of a preload.
module microslip_contact_frictionless
   use microslip_contact_closed_system, only: closed_system_t, state_frictionless
   use microslip_contact_compliance_operator, only: contact_compliance_t
   use microslip_contact_laws, only: state_open
   use microslip_core_error, only: error_t, failure
   use microslip_core_kinds, only: wp
   use microslip_linalg_dense, only: cholesky_factor, cholesky_solve
   implicit none(type, external)
   private

   public :: solve_frictionless, solve_frictionless_by_operator, solve_beside_soft

   integer, parameter :: max_steps = 100
   !> By operator: relative accuracy of the forces (they are a guess only), of a solution on the way, and Krylov steps.
   real(wp), parameter :: accuracy = 1.0e-7_wp, on_the_way = 1.0e-2_wp
   integer, parameter :: krylov_steps = 150

contains

   !> Find the normal forces, and how they change with the free gap where the closed set stays as it is.
   subroutine solve_frictionless(G, r, slope, closed, force, sensitivity, error, soft, soft_free)
      !> (points, points) normal-normal part of the contact compliance, m/N
      real(wp), intent(in), contiguous :: G(:, :)
      !> (points) gap without contact forces, m
      real(wp), intent(in) :: r(:)
      !> (points, drivers) derivative of r by the drivers
      real(wp), intent(in) :: slope(:, :)
      !> (points) start guess in, closed points out
      logical, intent(inout) :: closed(:)
      !> (points) N
      real(wp), intent(out) :: force(:)
      !> (points, drivers) derivative of the force by the drivers
      real(wp), intent(out) :: sensitivity(:, :)
      type(error_t), allocatable, intent(out) :: error
      !> (points, directions) normal part of V, and (directions, 1 + drivers) s and its derivative by the drivers
      real(wp), intent(in), optional :: soft(:, :), soft_free(:, :)
      real(wp), allocatable :: factor(:, :), rhs(:, :), gap(:), z(:, :), V(:, :)
      integer, allocatable :: set(:)
      logical :: next(size(closed))
      integer :: step, k

      do step = 1, max_steps
         set = pack([(k, k=1, size(closed))], closed)
         force = 0.0_wp
         sensitivity = 0.0_wp
         allocate (rhs(size(set), 1 + size(slope, 2)))
         rhs(:, 1) = -r(set)
         rhs(:, 2:) = -slope(set, :)
         factor = G(set, set)
         if (size(set) > 0) then
            call cholesky_factor(factor, error)
            if (allocated(error)) return
            call cholesky_solve(factor, rhs)
         end if
         if (present(soft)) then
            V = soft(set, :)
            z = soft_free
            call solve_beside_soft(factor, V, rhs, z, error)
            if (allocated(error)) return
         end if
         force(set) = rhs(:, 1)
         sensitivity(set, :) = rhs(:, 2:)
         deallocate (rhs)
         gap = r + matmul(G(:, set), force(set))
         if (present(soft)) gap = gap + matmul(soft, z(:, 1))
         ! Closed points that pull open, open points that penetrate close.
         next = merge(force > 0.0_wp, gap < 0.0_wp, closed)
         if (all(next .eqv. closed)) return
         closed = next
      end do
      call failure(error, 'frictionless contact: the closed set does not settle')
   end subroutine solve_frictionless

   !> Forces with G force + V z = rhs, z = s + V^T force, from those for V = 0.
   subroutine solve_beside_soft(factor, V, x, z, error)
      !> (unknowns, unknowns) Cholesky factor of G
      real(wp), intent(in), contiguous :: factor(:, :)
      !> (unknowns, directions)
      real(wp), intent(in), contiguous :: V(:, :)
      !> (unknowns, columns) G^-1 rhs in, forces out
      real(wp), intent(inout), contiguous :: x(:, :)
      !> (directions, columns) s in, z out
      real(wp), intent(inout), contiguous :: z(:, :)
      type(error_t), allocatable, intent(out) :: error
      real(wp) :: moved(size(V, 1), size(V, 2)), rest(size(V, 2), size(V, 2))
      integer :: k

      moved = V
      if (size(moved) > 0) call cholesky_solve(factor, moved)
      rest = matmul(transpose(V), moved)
      do k = 1, size(rest, 1)
         rest(k, k) = rest(k, k) + 1.0_wp
      end do
      z = z + matmul(transpose(V), x)
      call cholesky_factor(rest, error)
      if (allocated(error)) return
      call cholesky_solve(rest, z)
      x = x - matmul(moved, z)
   end subroutine solve_beside_soft

   !> The same with the compliance as an operator, to `accuracy`: closed points change while the forces are still rough.
   subroutine solve_frictionless_by_operator(compliance, system, r, slope, closed, force, sensitivity, error, soft_free)
      class(contact_compliance_t), intent(in) :: compliance
      !> Set up for the compliance and the soft directions; its states are changed
      type(closed_system_t), intent(inout) :: system
      !> (points) gap without contact forces, m
      real(wp), intent(in) :: r(:)
      !> (points, drivers) derivative of r by the drivers
      real(wp), intent(in) :: slope(:, :)
      !> (points) start guess in, closed points out
      logical, intent(inout) :: closed(:)
      !> (points) start guess in, N
      real(wp), intent(inout) :: force(:)
      !> (points, drivers) derivative of the force by the drivers
      real(wp), intent(out) :: sensitivity(:, :)
      type(error_t), allocatable, intent(out) :: error
      !> (directions, 1 + drivers) s and its derivative by the drivers; no directions: nothing is kept apart
      real(wp), intent(in) :: soft_free(:, :)
      real(wp), dimension(3, size(r)) :: forces, gap, change
      real(wp) :: z(size(soft_free, 1)), balance(size(soft_free, 1)), dz(size(soft_free, 1))
      logical :: next(size(r))
      real(wp) :: first, last, target
      integer :: step, k, krylov

      forces = 0.0_wp
      forces(1, :) = force
      target = 0.0_wp
      z = 0.0_wp
      do step = 1, max_steps
         system%states = merge(state_frictionless, state_open, closed)
         where (.not. closed) forces(1, :) = 0.0_wp
         call compliance%product(forces, gap)
         call system%add_soft_gap(z, gap)
         gap(1, :) = -(gap(1, :) + r)
         balance = soft_free(:, 1) + system%along_soft(forces) - z
         call system%solve(compliance, gap, on_the_way, target, krylov_steps, change, krylov, first, last, balance, dz)
         forces = forces + change
         z = z + dz
         target = accuracy*norm2(forces)
         call compliance%product(forces, gap)
         call system%add_soft_gap(z, gap)
         next = merge(forces(1, :) > 0.0_wp, gap(1, :) + r < 0.0_wp, closed)
         if (all(next .eqv. closed) .and. last <= target) exit
         closed = next
      end do
      if (step > max_steps) then
         call failure(error, 'frictionless contact: the closed set does not settle')
         return
      end if
      force = forces(1, :)
      do k = 1, size(slope, 2)
         gap = 0.0_wp
         gap(1, :) = -slope(:, k)
         balance = soft_free(:, 1 + k)
         call system%solve(compliance, gap, accuracy, 0.0_wp, krylov_steps, change, krylov, first, last, balance, dz)
         sensitivity(:, k) = change(1, :)
      end do
   end subroutine solve_frictionless_by_operator

end module microslip_contact_frictionless
