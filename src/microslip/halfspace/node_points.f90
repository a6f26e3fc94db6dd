!> Contact points at the FE nodes of an interface, without a half space: their areas and their coupling W.
!>
!> With the shape functions N_k of the faces, a uniform pressure p acts on the nodes with p c_k, c_k = integral of N_k dA.
!> 4-node faces: every node pair is a point, W = 1 and A_k = c_k > 0.
!> 8-node faces: c_k < 0 at the corners (-1/12 of a rectangle, 1/3 at the mid-side nodes), where no unilateral contact could
!> carry a uniform pressure node by node. With the shape functions transformed (Popp, Wohlmuth, Gee, Wall, SIAM J. Sci.
!> Comput. 34 (2012), dual quadratic mortar elements; s: share),
!>     N~_corner = N_corner + s (N_m + N_m'),    N~_m = (1 - 2 s) N_m,       m, m': the mid-side nodes beside the corner
!>     gap at a corner  = d_corner,    gap at a mid-side node = [d_m - s (d_1 + d_2)]/(1 - 2 s),   1, 2: ends of its edge
!> all areas are positive for 1/8 < s < 1/2, A_k = integral of N~_k dA (1/20 and 1/5 of a rectangle with s = 1/5). Forces and
!> moments are kept (linear fields are interpolated exactly), and W A = c: a uniform pressure is carried exactly.
module microslip_halfspace_node_points
   use microslip_core_error, only: error_t, bad_input
   use microslip_core_kinds, only: wp
   use microslip_core_text, only: to_text
   use microslip_fe_element, only: face_size
   use microslip_fe_interface, only: contact_interface_t
   use microslip_fe_shape_functions, only: shape_gradients, shape_values
   use microslip_halfspace_coupling, only: coupling_t
   use microslip_halfspace_grid, only: be_grid_t, scattered_grid
   implicit none(type, external)
   private

   public :: points_at_nodes, consistent_areas

   !> s of the transformation of 8-node faces.
   real(wp), parameter :: share = 0.2_wp
   !> Gauss points and weights of three points on [-1, 1]: exact for curved 8-node faces.
   real(wp), parameter :: gauss(3) = [-sqrt(0.6_wp), 0.0_wp, sqrt(0.6_wp)], weight(3) = [5.0_wp, 8.0_wp, 5.0_wp]/9.0_wp

contains

   !> One contact point per node pair.
   subroutine points_at_nodes(contact, grid, coupling, error)
      type(contact_interface_t), intent(in) :: contact
      !> The points in the order of the pairs, and their areas
      type(be_grid_t), intent(out) :: grid
      !> W
      type(coupling_t), intent(out) :: coupling
      type(error_t), allocatable, intent(out) :: error
      integer :: ends(2, contact%pair_count())
      real(wp) :: area(contact%pair_count()), nodal(contact%pair_count())
      integer :: k

      ends = edge_ends(contact)
      nodal = consistent_areas(contact)
      area = nodal
      do k = 1, size(area)
         if (ends(1, k) == 0) cycle
         area(k) = (1.0_wp - 2.0_wp*share)*nodal(k)
         area(ends(:, k)) = area(ends(:, k)) + share*nodal(k)
      end do
      if (any(area <= 0.0_wp)) then
         k = minloc(area, dim=1)
         call bad_input(error, to_text(count(area <= 0.0_wp))//' contact points at nodes have no area, first at (t1, t2) = (' &
            & //to_text(contact%position(1, k))//', '//to_text(contact%position(2, k)) &
            & //') m: the faces there are too distorted, or there are none')
         return
      end if
      grid = scattered_grid(contact%position, area)
      call couple(ends, coupling)
   end subroutine points_at_nodes

   !> c_k = integral of N_k dA, (pairs), m^2.
   pure function consistent_areas(contact) result(area)
      type(contact_interface_t), intent(in) :: contact
      real(wp) :: area(contact%pair_count())
      real(wp) :: jacobian(2, 2), local(2)
      integer :: f, n, i, j

      area = 0.0_wp
      do f = 1, size(contact%faces, 2)
         n = face_size(contact%faces(:, f))
         associate (pairs => contact%faces(:n, f))
            do j = 1, 3
               do i = 1, 3
                  local = [gauss(i), gauss(j)]
                  jacobian = matmul(contact%position(:, pairs), transpose(shape_gradients(n, local)))
                  area(pairs) = area(pairs) + weight(i)*weight(j)*shape_values(n, local) &
                     & *(jacobian(1, 1)*jacobian(2, 2) - jacobian(1, 2)*jacobian(2, 1))
               end do
            end do
         end associate
      end do
   end function consistent_areas

   !> (2, pairs) both ends of the edge of a mid-side node; zeros for corners.
   pure function edge_ends(contact) result(ends)
      type(contact_interface_t), intent(in) :: contact
      integer :: ends(2, contact%pair_count())
      integer :: f, k

      ends = 0
      do f = 1, size(contact%faces, 2)
         if (face_size(contact%faces(:, f)) < 8) cycle
         do k = 1, 4
            ends(:, contact%faces(4 + k, f)) = contact%faces([k, mod(k, 4) + 1], f)
         end do
      end do
   end function edge_ends

   !> W: the gap at every point from the relative displacements of one node pair or, at mid-side nodes, three.
   pure subroutine couple(ends, coupling)
      integer, intent(in) :: ends(:, :)
      type(coupling_t), intent(inout) :: coupling
      integer :: k

      coupling%pairs = size(ends, 2)
      coupling%points = size(ends, 2)
      allocate (coupling%start(size(ends, 2) + 1), coupling%pair(0), coupling%weight(0))
      do k = 1, size(ends, 2)
         coupling%start(k) = size(coupling%pair) + 1
         if (ends(1, k) == 0) then
            coupling%pair = [coupling%pair, k]
            coupling%weight = [coupling%weight, 1.0_wp]
         else
            coupling%pair = [coupling%pair, k, ends(:, k)]
            coupling%weight = [coupling%weight, [1.0_wp, -share, -share]/(1.0_wp - 2.0_wp*share)]
         end if
      end do
      coupling%start(size(ends, 2) + 1) = size(coupling%pair) + 1
   end subroutine couple

end module microslip_halfspace_node_points
