!> The coupling W_b between boundary-element points and the node pairs of an interface (METHOD section 3).
!>
!> Column j of W holds the shape functions of the face with point j at that point, one number per pair,
!> the same for the three components n, t1, t2:
!>
!>     W^T d_b    relative displacement at the points         (interpolate)
!>     W lambda   nodal forces of the contact forces          (distribute)
!>     W^T F W    compliance of the boundary at the points    (add_gathered), in G = C + W_b^T F W_b (19)
!>
!> The columns sum to 1 and reproduce linear fields: rigid relative motion is exact, and the nodal
!> forces have the total and the moment of the contact forces. Vectors are ordered (n, t1, t2) per
!> pair and per point.
module microslip_halfspace_coupling
   use microslip_core_error, only: error_t, bad_input
   use microslip_core_kinds, only: wp
   use microslip_core_text, only: to_text
   use microslip_fe_element, only: face_size
   use microslip_fe_face_location, only: locate_points
   use microslip_fe_interface, only: contact_interface_t
   use microslip_fe_shape_functions, only: shape_values
   implicit none(type, external)
   private

   public :: coupling_t, build_coupling, points_on_faces, check_located, add_gathered

   !> W (pairs x points) in compressed columns.
   type :: coupling_t
      integer :: pairs = 0
      integer :: points = 0
      !> (points + 1) first entry of every column
      integer, allocatable :: start(:)
      !> (entries) pair index
      integer, allocatable :: pair(:)
      !> (entries) shape function
      real(wp), allocatable :: weight(:)
   contains
      procedure :: interpolate
      procedure :: interpolate_component
      procedure :: interpolate_columns
      procedure :: distribute
   end type coupling_t

contains

   !> Which positions lie on faces of the interface: the natural cut-out of a grid.
   pure function points_on_faces(contact, position, overhang) result(inside)
      type(contact_interface_t), intent(in) :: contact
      !> (2, points) coordinates along t1, t2, m
      real(wp), intent(in) :: position(:, :)
      !> Points this far outside a face, in its local coordinates (width 2), count as on it; default 0
      real(wp), intent(in), optional :: overhang
      !> (points)
      logical, allocatable :: inside(:)
      integer :: face(size(position, 2))
      real(wp) :: local(2, size(position, 2))

      call locate_points(contact%position, contact%faces, position, face, local, overhang)
      inside = face > 0
   end function points_on_faces

   !> W for points of an interface; every point must lie on a face.
   subroutine build_coupling(contact, position, coupling, overhang, error)
      type(contact_interface_t), intent(in) :: contact
      !> (2, points) coordinates along t1, t2, m
      real(wp), intent(in) :: position(:, :)
      type(coupling_t), intent(out) :: coupling
      !> Points this far outside a face, in its local coordinates (width 2), are extrapolated; default 0
      real(wp), intent(in), optional :: overhang
      type(error_t), allocatable, intent(out) :: error
      integer :: face(size(position, 2)), p, nodes, first
      real(wp) :: local(2, size(position, 2))

      call locate_points(contact%position, contact%faces, position, face, local, overhang)
      call check_located(contact%name, face, position, error)
      if (allocated(error)) return
      coupling%pairs = contact%pair_count()
      coupling%points = size(face)
      allocate (coupling%start(size(face) + 1))
      coupling%start(1) = 1
      do p = 1, size(face)
         coupling%start(p + 1) = coupling%start(p) + face_size(contact%faces(:, face(p)))
      end do
      allocate (coupling%pair(coupling%start(size(face) + 1) - 1), &
                coupling%weight(coupling%start(size(face) + 1) - 1))
      do p = 1, size(face)
         first = coupling%start(p)
         nodes = coupling%start(p + 1) - first
         coupling%pair(first:first + nodes - 1) = contact%faces(:nodes, face(p))
         coupling%weight(first:first + nodes - 1) = shape_values(nodes, local(:, p))
      end do
   end subroutine build_coupling

   !> Error where points lie on no face.
   subroutine check_located(name, face, position, error)
      !> Of the interface
      character(len=*), intent(in) :: name
      !> (points) face of every point, 0 if it lies on none
      integer, intent(in) :: face(:)
      !> (2, points) coordinates along t1, t2, m
      real(wp), intent(in) :: position(:, :)
      type(error_t), allocatable, intent(out) :: error
      integer :: p

      if (all(face > 0)) return
      p = findloc(face, 0, dim=1)
      call bad_input(error, "interface '"//name//"': "//to_text(count(face == 0))//' of '// &
         to_text(size(face))//' grid points lie on no element face, first (t1, t2) = ('// &
         to_text(position(1, p))//', '//to_text(position(2, p))//') m')
   end subroutine check_located

   !> W^T x: the field at the points from its values at the pairs.
   pure subroutine interpolate(self, nodal, at_points)
      class(coupling_t), intent(in) :: self
      !> (3, pairs)
      real(wp), intent(in), contiguous :: nodal(:, :)
      !> (3, points)
      real(wp), intent(out), contiguous :: at_points(:, :)
      integer :: p, m

      do p = 1, self%points
         at_points(:, p) = 0.0_wp
         do m = self%start(p), self%start(p + 1) - 1
            at_points(:, p) = at_points(:, p) + self%weight(m)*nodal(:, self%pair(m))
         end do
      end do
   end subroutine interpolate

   !> W^T x of one component alone.
   pure subroutine interpolate_component(self, nodal, at_points)
      class(coupling_t), intent(in) :: self
      !> (pairs)
      real(wp), intent(in), contiguous :: nodal(:)
      !> (points)
      real(wp), intent(out), contiguous :: at_points(:)
      integer :: p, m
      real(wp) :: total

      do p = 1, self%points
         total = 0.0_wp
         do m = self%start(p), self%start(p + 1) - 1
            total = total + self%weight(m)*nodal(self%pair(m))
         end do
         at_points(p) = total
      end do
   end subroutine interpolate_component

   !> W x: the nodal forces that do the same work as forces at the points.
   pure subroutine distribute(self, at_points, nodal)
      class(coupling_t), intent(in) :: self
      !> (3, points)
      real(wp), intent(in), contiguous :: at_points(:, :)
      !> (3, pairs)
      real(wp), intent(out), contiguous :: nodal(:, :)
      integer :: p, m

      nodal = 0.0_wp
      do p = 1, self%points
         if (all(at_points(:, p) == 0.0_wp)) cycle
         do m = self%start(p), self%start(p + 1) - 1
            nodal(:, self%pair(m)) = nodal(:, self%pair(m)) + self%weight(m)*at_points(:, p)
         end do
      end do
   end subroutine distribute

   !> Y = Y + W^T X at chosen points, for matrices whose rows are the coordinates of the pairs.
   pure subroutine interpolate_columns(self, points, x, y)
      class(coupling_t), intent(in) :: self
      !> Indices of the chosen points
      integer, intent(in) :: points(:)
      !> (3 pairs, columns), rows (n, t1, t2) per pair
      real(wp), intent(in) :: x(:, :)
      !> (3 chosen points, columns)
      real(wp), intent(inout) :: y(:, :)
      integer :: column, j, m, row
      real(wp) :: total(3)

      do column = 1, size(x, 2)
         do j = 1, size(points)
            total = 0.0_wp
            do m = self%start(points(j)), self%start(points(j) + 1) - 1
               row = 3*self%pair(m)
               total = total + self%weight(m)*x(row - 2:row, column)
            end do
            y(3*j - 2:3*j, column) = y(3*j - 2:3*j, column) + total
         end do
      end do
   end subroutine interpolate_columns

   !> G = G + W_row^T F W_column at chosen points of two interfaces, or of one with itself.
   !>
   !> Two sparse passes: three columns F W of one point at a time, then W^T of those. F and G may be
   !> sections of the matrices of all interfaces; the columns of G are shared out among the threads.
   subroutine add_gathered(row_coupling, row_points, column_coupling, column_points, f, g)
      type(coupling_t), intent(in) :: row_coupling
      !> Indices of the chosen points of the rows
      integer, intent(in) :: row_points(:)
      type(coupling_t), intent(in) :: column_coupling
      !> Indices of the chosen points of the columns
      integer, intent(in) :: column_points(:)
      !> (3 row pairs, 3 column pairs) block of F, m/N
      real(wp), intent(in) :: f(:, :)
      !> (3 row points, 3 column points) block of G, m/N
      real(wp), intent(inout) :: g(:, :)
      real(wp), allocatable :: fw(:, :)
      integer :: k, m, c, first

      !$omp parallel default(none) &
      !$omp shared(row_coupling, row_points, column_coupling, column_points, f, g) private(fw, k, m, c, first)
      allocate (fw(3*row_coupling%pairs, 3))
      !$omp do schedule(static)
      do k = 1, size(column_points)
         fw = 0.0_wp
         do m = column_coupling%start(column_points(k)), column_coupling%start(column_points(k) + 1) - 1
            first = 3*column_coupling%pair(m) - 3
            do c = 1, 3
               fw(:, c) = fw(:, c) + column_coupling%weight(m)*f(:, first + c)
            end do
         end do
         call row_coupling%interpolate_columns(row_points, fw, g(:, 3*k - 2:3*k))
      end do
      !$omp end do
      !$omp end parallel
   end subroutine add_gathered

end module microslip_halfspace_coupling
