!> How well the FE model and the short waves of the half space make up the half space together: the scale-split coupling's
!> own error estimate (METHOD section 3).
!>
!> Deep inside a pad, far from its edges and bores, the surface is that of a half space, and the identity
!>
!>     C_s lambda + W^T F_s W lambda = C lambda,      F_s: flexibility of the structure in statics
!>
!> should hold. It is tried with the forces of an even traction on a disc, held in balance by a ring round it, so that the
!> rest of the structure is not bent; what is left of it, a constant and linear terms, is taken off.
module microslip_system_coupling_error
   use microslip_core_error, only: error_t
   use microslip_core_kinds, only: wp
   use microslip_halfspace_grid, only: be_grid_t
   use microslip_linalg_dense, only: cholesky_factor, cholesky_solve
   use microslip_system_jointed_system, only: jointed_system_t
   use microslip_system_pad, only: pad_t
   implicit none(type, external)
   private

   public :: coupling_error_t, estimate_coupling_error

   type :: coupling_error_t
      !> Of the disc, m; 0: the pad has no room for one
      real(wp) :: radius = 0.0_wp
      !> Norm of the deviation over that of C lambda, on disc and ring: traction along n, t1, t2
      real(wp) :: deviation(3) = 0.0_wp
   end type coupling_error_t

   !> Radius of the disc, in distances of the FE nodes: the least, and what is taken where there is room.
   real(wp), parameter :: least_radius = 1.5_wp, wanted_radius = 3.0_wp

contains

   !> Try the identity on one pad.
   subroutine estimate_coupling_error(system, k, spacing, estimate, error)
      type(jointed_system_t), intent(in) :: system
      !> Which pad
      integer, intent(in) :: k
      !> Distance of its FE nodes, m
      real(wp), intent(in) :: spacing
      type(coupling_error_t), intent(out) :: estimate
      type(error_t), allocatable, intent(out) :: error
      real(wp), allocatable :: force(:, :), whole(:, :), split(:, :), boundary(:, :), distance(:), traction(:)
      real(wp) :: centre(2), room
      integer :: c

      associate (pad => system%pads(k))
         call widest_place(pad%grid, centre, room)
         estimate%radius = min(wanted_radius*spacing, room/sqrt(2.0_wp))
         if (estimate%radius < least_radius*spacing) then
            estimate%radius = 0.0_wp
            return
         end if
         distance = norm2(pad%grid%position - spread(centre, 2, pad%grid%point_count()), 1)
         traction = balanced_traction(distance, estimate%radius)
         allocate (force(3, size(distance)), whole(3, size(distance)))
         do c = 1, 3
            force = 0.0_wp
            force(c, :) = traction
            call pad%convolution%apply(force, whole)
            call system%static_boundary(k, force, boundary, error)
            if (allocated(error)) return
            split = pad%displacement(force, boundary)
            call compare(pad%grid%position, distance < sqrt(2.0_wp)*estimate%radius, centre, whole(c, :), split(c, :), &
               & estimate%deviation(c), error)
            if (allocated(error)) return
         end do
      end associate
   end subroutine estimate_coupling_error

   !> 1 on the disc, and the opposite on the ring of about the same area.
   pure function balanced_traction(distance, radius) result(traction)
      !> (points) from the centre, m
      real(wp), intent(in) :: distance(:), radius
      real(wp) :: traction(size(distance))
      logical :: disc(size(distance)), ring(size(distance))

      disc = distance < radius
      ring = .not. disc .and. distance < sqrt(2.0_wp)*radius
      traction = merge(1.0_wp, 0.0_wp, disc)
      where (ring) traction = -real(count(disc), wp)/count(ring)
   end function balanced_traction

   !> The grid point that is farthest from all edges and bores.
   pure subroutine widest_place(grid, centre, room)
      type(be_grid_t), intent(in) :: grid
      real(wp), intent(out) :: centre(2)
      !> Its distance from them, m
      real(wp), intent(out) :: room
      real(wp) :: free
      integer :: p, ix, iy

      centre = 0.0_wp
      room = 0.0_wp
      do p = 1, grid%point_count()
         free = min(grid%dx*(min(grid%ix(p), grid%nx + 1 - grid%ix(p)) - 0.5_wp), &
            & grid%dy*(min(grid%iy(p), grid%ny + 1 - grid%iy(p)) - 0.5_wp))
         do iy = 1, grid%ny
            if (free <= room) exit
            if (abs(grid%y(iy) - grid%position(2, p)) > free) cycle
            do ix = 1, grid%nx
               if (.not. grid%inside(ix, iy)) free = min(free, hypot(grid%x(ix) - grid%position(1, p), &
                  & grid%y(iy) - grid%position(2, p)))
            end do
         end do
         if (free <= room) cycle
         room = free
         centre = grid%position(:, p)
      end do
   end subroutine widest_place

   !> Relative norm of the difference less its best linear fit.
   subroutine compare(position, used, centre, whole, split, deviation, error)
      !> (2, points) m
      real(wp), intent(in) :: position(:, :)
      !> (points)
      logical, intent(in) :: used(:)
      real(wp), intent(in) :: centre(2)
      !> (points) m: C lambda, and what the coupling makes of it
      real(wp), intent(in) :: whole(:), split(:)
      real(wp), intent(out) :: deviation
      type(error_t), allocatable, intent(out) :: error
      real(wp), allocatable :: basis(:, :), difference(:)
      real(wp) :: normal(3, 3), coefficients(3), width
      integer :: n

      n = count(used)
      allocate (basis(n, 3))
      basis(:, 1) = 1.0_wp
      basis(:, 2) = pack(position(1, :) - centre(1), used)
      basis(:, 3) = pack(position(2, :) - centre(2), used)
      width = maxval(abs(basis(:, 2:)))
      basis(:, 2:) = basis(:, 2:)/width
      difference = pack(split - whole, used)
      normal = matmul(transpose(basis), basis)
      coefficients = matmul(difference, basis)
      call cholesky_factor(normal, error)
      if (allocated(error)) return
      call cholesky_solve(normal, coefficients)
      difference = difference - matmul(basis, coefficients)
      deviation = norm2(difference)/norm2(pack(whole, used))
   end subroutine compare

end module microslip_system_coupling_error
