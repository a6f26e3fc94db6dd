!> A contact interface of the FE model: matching node pairs, local frame, faces (METHOD section 1).
module microslip_fe_interface
   use microslip_core_kinds, only: wp
   implicit none(type, external)
   private

   public :: contact_interface_t

   !> Matching nodes of the two sides and the faces they span.
   !>
   !> Sign convention: n is the outward normal of body B, from B towards A; the relative displacement
   !> of pair j is d_b,j = R^T (u_a,j - u_b,j), so a positive normal part opens the contact.
   type :: contact_interface_t
      character(len=:), allocatable :: name
      !> Point of the plane that has the local in-plane coordinates (0, 0), m
      real(wp) :: origin(3) = 0.0_wp
      !> R = [n t1 t2], columns; right-handed
      real(wp) :: frame(3, 3) = 0.0_wp
      !> (pairs) node indices of side A and of side B; node_b = 0: rigid ground
      integer, allocatable :: node_a(:), node_b(:)
      !> (2, pairs) coordinates along t1, t2 from the origin, m
      real(wp), allocatable :: position(:, :)
      !> (8, faces) pair indices, corners first, then mid-side nodes; zeros for 4-node faces.
      !> Counter-clockwise in the (t1, t2) plane
      integer, allocatable :: faces(:, :)
   contains
      procedure :: pair_count
   end type contact_interface_t

contains

   !> Number of node pairs.
   pure integer function pair_count(self)
      class(contact_interface_t), intent(in) :: self
      pair_count = size(self%node_a)
   end function pair_count

end module microslip_fe_interface
