!> The long waves of a field on a contact grid, those that the FE mesh of the interface represents by itself (METHOD
!> section 3, scale-split coupling).
!>
!>     m_k = sum_j N_kj A_j              area that belongs to node k
!>     T   = diag(1/m) N A               averages of the field round the nodes (zero row where m_k = 0)
!>     S   = N^T T                       long waves; I - S: short waves
!>
!> N (nodes x points): hat functions of the nodes at the points, A: areas of the points. On 4-node faces the hat functions
!> are the shape functions. The shape functions of 8-node faces have negative integrals at the corners and make no
!> averages: the hat functions there are those of the four quarters of the face, with a node in its middle.
!> Hat functions are >= 0 and sum to 1, so that S keeps constants, A S is symmetric, and its eigenvalues lie in [0, 1]:
!> S^T keeps a constant pressure, and (I - S) C (I - S)^T is symmetric and positive semidefinite as C is.
module microslip_halfspace_scale_filter
   use microslip_core_error, only: error_t
   use microslip_core_kinds, only: wp
   use microslip_fe_element, only: face_size
   use microslip_fe_face_location, only: locate_points
   use microslip_fe_interface, only: contact_interface_t
   use microslip_fe_shape_functions, only: shape_values
   use microslip_halfspace_coupling, only: coupling_t, check_located, points_on_faces
   use microslip_halfspace_grid, only: be_grid_t
   implicit none(type, external)
   private

   public :: scale_filter_t, new_scale_filter, cell_areas

   type :: scale_filter_t
      !> N: the hat functions. Its nodes are the pairs of the interface, then the middles of the 8-node faces
      type(coupling_t) :: hats
      !> (points) A, m^2
      real(wp), allocatable :: area(:)
      !> (nodes) 1/m, 0 for nodes that no point is near, 1/m^2
      real(wp), allocatable :: inverse_area(:)
   contains
      procedure :: average
      procedure :: spread_forces
      procedure :: remove_long_waves
      procedure :: remove_long_waves_component
      procedure :: remove_long_forces
   end type scale_filter_t

   !> Quarters of an 8-node face: (4 corners, quarter), 9 is its middle; quarters left and right, low then high.
   integer, parameter :: quarters(4, 4) = reshape([1, 5, 9, 8, 5, 2, 6, 9, 8, 9, 7, 4, 9, 6, 3, 7], [4, 4])

contains

   !> The filter of a grid on an interface; every grid point must lie on a face.
   subroutine new_scale_filter(filter, contact, grid, overhang, error)
      type(scale_filter_t), intent(out) :: filter
      type(contact_interface_t), intent(in) :: contact
      !> All contact points of the interface, whether in potential contact or not
      type(be_grid_t), intent(in) :: grid
      !> Points this far outside a face, in its local coordinates (width 2), count as on its edge
      real(wp), intent(in) :: overhang
      type(error_t), allocatable, intent(out) :: error
      !> Relative to the area of a cell: a node with less is near no point
      real(wp), parameter :: nothing = 1.0e-12_wp
      integer :: face(grid%point_count())
      real(wp) :: local(2, grid%point_count()), belongs(grid%point_count())
      real(wp), allocatable :: area(:)
      integer :: p, m

      call locate_points(contact%position, contact%faces, grid%position, face, local, overhang)
      call check_located(contact%name, face, grid%position, error)
      if (allocated(error)) return
      call make_hats(contact, face, min(max(local, -1.0_wp), 1.0_wp), filter%hats)
      belongs = cell_areas(contact, grid)
      filter%area = belongs
      allocate (area(filter%hats%pairs), source=0.0_wp)
      do p = 1, filter%hats%points
         do m = filter%hats%start(p), filter%hats%start(p + 1) - 1
            area(filter%hats%pair(m)) = area(filter%hats%pair(m)) + filter%hats%weight(m)*belongs(p)
         end do
      end do
      allocate (filter%inverse_area(size(area)), source=0.0_wp)
      where (area > nothing*grid%cell_area()) filter%inverse_area = 1.0_wp/area
   end subroutine new_scale_filter

   !> N in compressed columns, four entries each.
   pure subroutine make_hats(contact, face, local, hats)
      type(contact_interface_t), intent(in) :: contact
      !> (points) face of every point
      integer, intent(in) :: face(:)
      !> (2, points) its place there, within [-1, 1]
      real(wp), intent(in) :: local(:, :)
      type(coupling_t), intent(out) :: hats
      integer :: middle(size(contact%faces, 2)), nodes(9), side(2), p, f

      hats%pairs = contact%pair_count()
      do f = 1, size(middle)
         if (face_size(contact%faces(:, f)) == 8) hats%pairs = hats%pairs + 1
         middle(f) = hats%pairs
      end do
      hats%points = size(face)
      hats%start = [(4*p - 3, p=1, hats%points + 1)]
      allocate (hats%pair(4*hats%points), hats%weight(4*hats%points))
      do p = 1, hats%points
         nodes = [contact%faces(:, face(p)), middle(face(p))]
         associate (own => [4*p - 3, 4*p - 2, 4*p - 1, 4*p])
            if (nodes(5) == 0) then
               hats%pair(own) = nodes(:4)
               hats%weight(own) = shape_values(4, local(:, p))
            else
               side = merge(1, 0, local(:, p) > 0.0_wp)
               hats%pair(own) = nodes(quarters(:, 1 + side(1) + 2*side(2)))
               hats%weight(own) = shape_values(4, 2.0_wp*(local(:, p) - side) + 1.0_wp)
            end if
         end associate
      end do
   end subroutine make_hats

   !> Area of every cell that lies on faces of the interface, by samples in the cells at its edges, (points), m^2.
   pure function cell_areas(contact, grid) result(area)
      type(contact_interface_t), intent(in) :: contact
      type(be_grid_t), intent(in) :: grid
      real(wp), allocatable :: area(:)
      integer, parameter :: samples = 5
      real(wp) :: sample(2, samples**2)
      integer :: p, i, j

      allocate (area(grid%point_count()), source=grid%cell_area())
      do p = 1, size(area)
         if (surrounded(grid, grid%ix(p), grid%iy(p))) cycle
         do j = 1, samples
            do i = 1, samples
               sample(:, i + samples*(j - 1)) = grid%position(:, p) &
                  & + [grid%dx, grid%dy]*((real([i, j], wp) - 0.5_wp)/samples - 0.5_wp)
            end do
         end do
         ! A cell whose centre lies on the faces is not without any area.
         area(p) = area(p)*max(1, count(points_on_faces(contact, sample)))/samples**2
      end do
   end function cell_areas

   !> Whether all eight neighbours of a cell carry contact points.
   pure logical function surrounded(grid, ix, iy)
      type(be_grid_t), intent(in) :: grid
      integer, intent(in) :: ix, iy

      surrounded = ix > 1 .and. ix < grid%nx .and. iy > 1 .and. iy < grid%ny
      if (surrounded) surrounded = all(grid%inside(ix - 1:ix + 1, iy - 1:iy + 1))
   end function surrounded

   !> T u: averages round the nodes.
   pure subroutine average(self, u, nodal)
      class(scale_filter_t), intent(in) :: self
      !> (3, points)
      real(wp), intent(in), contiguous :: u(:, :)
      !> (3, nodes)
      real(wp), intent(out), contiguous :: nodal(:, :)
      integer :: p, m, k
      real(wp) :: weighted(3)

      nodal = 0.0_wp
      do p = 1, self%hats%points
         weighted = self%area(p)*u(:, p)
         do m = self%hats%start(p), self%hats%start(p + 1) - 1
            nodal(:, self%hats%pair(m)) = nodal(:, self%hats%pair(m)) + self%hats%weight(m)*weighted
         end do
      end do
      do k = 1, size(nodal, 2)
         nodal(:, k) = self%inverse_area(k)*nodal(:, k)
      end do
   end subroutine average

   !> T^T f: nodal forces as pressures round the nodes.
   pure subroutine spread_forces(self, nodal, force)
      class(scale_filter_t), intent(in) :: self
      !> (3, nodes) N
      real(wp), intent(in), contiguous :: nodal(:, :)
      !> (3, points) N
      real(wp), intent(out), contiguous :: force(:, :)
      integer :: p, m, k

      do p = 1, self%hats%points
         force(:, p) = 0.0_wp
         do m = self%hats%start(p), self%hats%start(p + 1) - 1
            k = self%hats%pair(m)
            force(:, p) = force(:, p) + self%hats%weight(m)*self%inverse_area(k)*nodal(:, k)
         end do
         force(:, p) = self%area(p)*force(:, p)
      end do
   end subroutine spread_forces

   !> u <- (I - S) u.
   pure subroutine remove_long_waves(self, u)
      class(scale_filter_t), intent(in) :: self
      !> (3, points) displacements
      real(wp), intent(inout), contiguous :: u(:, :)
      real(wp), allocatable :: nodal(:, :)
      integer :: p, m

      allocate (nodal(3, self%hats%pairs))
      call self%average(u, nodal)
      do p = 1, self%hats%points
         do m = self%hats%start(p), self%hats%start(p + 1) - 1
            u(:, p) = u(:, p) - self%hats%weight(m)*nodal(:, self%hats%pair(m))
         end do
      end do
   end subroutine remove_long_waves

   !> u <- (I - S) u for one component.
   pure subroutine remove_long_waves_component(self, u)
      class(scale_filter_t), intent(in) :: self
      !> (points) displacements
      real(wp), intent(inout), contiguous :: u(:)
      real(wp) :: nodal(self%hats%pairs)
      integer :: p, m

      nodal = 0.0_wp
      do p = 1, self%hats%points
         do m = self%hats%start(p), self%hats%start(p + 1) - 1
            nodal(self%hats%pair(m)) = nodal(self%hats%pair(m)) + self%hats%weight(m)*self%area(p)*u(p)
         end do
      end do
      nodal = self%inverse_area*nodal
      do p = 1, self%hats%points
         do m = self%hats%start(p), self%hats%start(p + 1) - 1
            u(p) = u(p) - self%hats%weight(m)*nodal(self%hats%pair(m))
         end do
      end do
   end subroutine remove_long_waves_component

   !> f <- (I - S)^T f.
   pure subroutine remove_long_forces(self, force)
      class(scale_filter_t), intent(in) :: self
      !> (3, points) N
      real(wp), intent(inout), contiguous :: force(:, :)
      real(wp), allocatable :: nodal(:, :), long(:, :)

      allocate (nodal(3, self%hats%pairs), long(3, self%hats%points))
      call self%hats%distribute(force, nodal)
      call self%spread_forces(nodal, long)
      force = force - long
   end subroutine remove_long_forces

end module microslip_halfspace_scale_filter
