!> A contact pad: one interface with everything the contact needs there - grid, surface, half space, coupling.
!>
!> Two couplings of half space and FE model: in series, C + W^T F W (the paper's, (6)), or split by scale, C_s + W^T F W,
!> where C_s is what C has beyond the waves that the FE mesh represents (METHOD section 3).
!> With contact points at the FE nodes there is no half space: C = 0, and G is W^T F W alone.
!> An initial pressure p takes the place of the heights: the undeformed pad carries lambda_0 = p A without any gap.
module microslip_system_pad
   use microslip_core_error, only: error_t
   use microslip_core_kinds, only: wp
   use microslip_fe_interface, only: contact_interface_t
   use microslip_halfspace_compliance, only: compliance_t, new_compliance
   use microslip_halfspace_convolution, only: convolution_t, new_convolution
   use microslip_halfspace_coupling, only: coupling_t, build_coupling
   use microslip_halfspace_grid, only: be_grid_t
   use microslip_halfspace_love_cerruti, only: half_space_pair_t
   use microslip_halfspace_node_points, only: points_at_nodes
   use microslip_halfspace_scale_filter, only: scale_filter_t, new_scale_filter
   use microslip_halfspace_split_compliance, only: add_split_to_dense, local_normal_product, local_product, &
      & nodal_response_t, new_nodal_response
   implicit none(type, external)
   private

   public :: pad_t, new_pad, new_node_pad

   type :: pad_t
      type(contact_interface_t) :: contact
      type(be_grid_t) :: grid
      type(coupling_t) :: coupling
      !> Whether the bodies are half spaces at the points: C and its products
      logical :: half_space = .true.
      type(compliance_t) :: compliance
      type(convolution_t) :: convolution
      !> The waves that are left to the FE model; not allocated: none, the coupling is in series
      type(scale_filter_t), allocatable :: filter
      !> What the filter's dense form is made from, kept from one choice of the points to the next
      type(nodal_response_t), allocatable, private :: nodal_response
      !> (grid points) height of the composite surface, <= 0 with the highest point at 0, m
      real(wp), allocatable :: height(:)
      real(wp) :: friction = 0.0_wp
      !> Normal pressure in the undeformed state, Pa
      real(wp) :: initial_pressure = 0.0_wp
      !> Boundary coordinates of the pads before this one
      integer :: boundary_offset = 0
      !> Points in potential contact: their indices in the grid, ascending
      integer, allocatable :: potential(:)
      !> Contact points of the pads before this one
      integer :: point_offset = 0
   contains
      procedure :: boundary_count
      procedure :: initial_force
      procedure :: initial_gap
      procedure :: add_local_compliance
      procedure :: displacement
      procedure :: normal_displacement
   end type pad_t

contains

   !> Bring the parts of a pad together. All grid points are in potential contact at first.
   subroutine new_pad(contact, grid, height, material, friction, overhang, pad, error, scale_split)
      type(contact_interface_t), intent(in) :: contact
      type(be_grid_t), intent(in) :: grid
      !> (grid points) m
      real(wp), intent(in) :: height(:)
      !> The two bodies
      type(half_space_pair_t), intent(in) :: material
      !> Friction coefficient
      real(wp), intent(in) :: friction
      !> How far outside the faces a point may lie, in face coordinates (width 2)
      real(wp), intent(in) :: overhang
      type(pad_t), intent(out) :: pad
      type(error_t), allocatable, intent(out) :: error
      !> Leave the long waves to the FE model; default: no
      logical, intent(in), optional :: scale_split
      integer :: k

      pad%contact = contact
      pad%grid = grid
      pad%height = height
      pad%friction = friction
      call build_coupling(contact, grid%position, pad%coupling, overhang, error)
      if (allocated(error)) return
      call new_compliance(pad%compliance, material, grid)
      call new_convolution(pad%convolution, pad%compliance)
      if (present(scale_split)) then
         if (scale_split) then
            allocate (pad%filter)
            call new_scale_filter(pad%filter, contact, grid, overhang, error)
            if (allocated(error)) return
         end if
      end if
      pad%potential = [(k, k=1, grid%point_count())]
   end subroutine new_pad

   !> A pad whose contact points are its node pairs, without a half space. All are in potential contact at first.
   subroutine new_node_pad(contact, friction, pad, error)
      type(contact_interface_t), intent(in) :: contact
      !> Friction coefficient
      real(wp), intent(in) :: friction
      !> Flat: its heights may be set afterwards
      type(pad_t), intent(out) :: pad
      type(error_t), allocatable, intent(out) :: error
      integer :: k

      pad%contact = contact
      pad%half_space = .false.
      pad%friction = friction
      call points_at_nodes(contact, pad%grid, pad%coupling, error)
      if (allocated(error)) return
      allocate (pad%height(pad%grid%point_count()), source=0.0_wp)
      pad%potential = [(k, k=1, pad%grid%point_count())]
   end subroutine new_node_pad

   !> lambda_0 = p A of the undeformed state, (3, grid points), N.
   pure function initial_force(self) result(force)
      class(pad_t), intent(in) :: self
      real(wp), allocatable :: force(:, :)

      allocate (force(3, self%grid%point_count()), source=0.0_wp)
      force(1, :) = self%initial_pressure*self%grid%area
   end function initial_force

   !> Gap of the undeformed bodies without contact forces, (3, grid points), m: -h, or -C lambda_0 under an initial
   !> pressure (the boundary's share -W^T F W lambda_0 comes from the system's load of that name).
   function initial_gap(self) result(gap)
      class(pad_t), intent(in) :: self
      real(wp), allocatable :: gap(:, :)

      allocate (gap(3, self%grid%point_count()), source=0.0_wp)
      if (self%half_space .and. self%initial_pressure > 0.0_wp) &
         & call local_product(self%convolution, self%initial_force(), gap, self%filter)
      gap = -gap
      gap(1, :) = gap(1, :) - self%height
   end function initial_gap

   !> Number of boundary coordinates, three per node pair.
   pure integer function boundary_count(self)
      class(pad_t), intent(in) :: self
      boundary_count = 3*self%contact%pair_count()
   end function boundary_count

   !> g <- g + C, or C_s, on the points in potential contact.
   subroutine add_local_compliance(self, g)
      class(pad_t), intent(inout) :: self
      !> (3 points, 3 points) m/N
      real(wp), intent(inout), contiguous :: g(:, :)

      call self%compliance%add_to_dense(self%potential, g)
      if (.not. allocated(self%filter)) return
      if (.not. allocated(self%nodal_response)) then
         allocate (self%nodal_response)
         call new_nodal_response(self%convolution, self%filter, self%nodal_response)
      end if
      call add_split_to_dense(self%filter, self%nodal_response, self%potential, g)
   end subroutine add_local_compliance

   !> Relative displacement C lambda + W^T d_b (C_s in place of C) at all grid points, (3, grid points), m.
   function displacement(self, force, boundary) result(u)
      class(pad_t), intent(in) :: self
      !> (3, grid points) contact forces, N
      real(wp), intent(in), contiguous :: force(:, :)
      !> (3, pairs) relative displacements of the node pairs, m
      real(wp), intent(in), contiguous :: boundary(:, :)
      real(wp), allocatable :: u(:, :), far(:, :)

      allocate (u, mold=force)
      call self%coupling%interpolate(boundary, u)
      if (.not. self%half_space) return
      allocate (far, mold=force)
      call local_product(self%convolution, force, far, self%filter)
      u = u + far
   end function displacement

   !> The normal component of `displacement`, in the workspace of the pad itself.
   subroutine normal_displacement(self, force, boundary, u_n)
      class(pad_t), intent(inout) :: self
      !> (3, grid points) contact forces, N
      real(wp), intent(in), contiguous :: force(:, :)
      !> (pairs) normal relative displacements of the node pairs, m
      real(wp), intent(in), contiguous :: boundary(:)
      !> (grid points) m
      real(wp), intent(out), contiguous :: u_n(:)
      real(wp) :: far(size(u_n))

      call self%coupling%interpolate_component(boundary, u_n)
      if (.not. self%half_space) return
      call local_normal_product(self%convolution, force, far, self%filter)
      u_n = u_n + far
   end subroutine normal_displacement

end module microslip_system_pad
