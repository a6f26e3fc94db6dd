!> Normal contact without friction: 0 <= force _|_ gap >= 0 with gap = r + G_nn force.
!> Primal-dual active set; used to guess the closed points and the loads of a preload.
module microslip_contact_frictionless
   use microslip_core_error, only: error_t, failure
   use microslip_core_kinds, only: wp
   use microslip_linalg_dense, only: cholesky_factor, cholesky_solve
   implicit none(type, external)
   private

   public :: solve_frictionless

   integer, parameter :: max_steps = 100

contains

   !> Find the normal forces, and how they change with the free gap where the closed set stays as it is.
   subroutine solve_frictionless(G, r, slope, closed, force, sensitivity, error)
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
      real(wp), allocatable :: factor(:, :), rhs(:, :), gap(:)
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
         force(set) = rhs(:, 1)
         sensitivity(set, :) = rhs(:, 2:)
         deallocate (rhs)
         gap = r + matmul(G(:, set), force(set))
         ! Closed points that pull open, open points that penetrate close.
         next = merge(force > 0.0_wp, gap < 0.0_wp, closed)
         if (all(next .eqv. closed)) return
         closed = next
      end do
      call failure(error, 'frictionless contact: the closed set does not settle')
   end subroutine solve_frictionless

end module microslip_contact_frictionless
