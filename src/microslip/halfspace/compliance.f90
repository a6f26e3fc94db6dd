!> The half-space compliance matrix C of one interface, by table (METHOD section 3).
!>
!> C is block-Toeplitz: the 3 x 3 block of two points depends on their index offset only, and its entries
!> are even or odd in both offsets. The table holds the non-negative offsets; it is the one source for
!> dense blocks and, through `microslip_halfspace_convolution`, for products by FFT.
!> Units m/N (displacement per force); order (n, t1, t2) per point; C_jk = C_kj^T exactly.
module microslip_halfspace_compliance
   use microslip_core_kinds, only: wp
   use microslip_halfspace_grid, only: be_grid_t
   use microslip_halfspace_love_cerruti, only: half_space_pair_t, influence
   implicit none(type, external)
   private

   public :: compliance_t, new_compliance
   public :: part_nn, part_11, part_22, part_12, part_n1, part_n2

   !> Rows of the table. nn, 11, 22 are even in both offsets, 12 is odd in both, n1 is odd in x and even in
   !> y, n2 even in x and odd in y; 1n = -n1 and 2n = -n2.
   integer, parameter :: part_nn = 1, part_11 = 2, part_22 = 3, part_12 = 4, part_n1 = 5, part_n2 = 6

   !> Influence coefficients by index offset, and the cells of the contact points.
   type :: compliance_t
      !> (4 or 6, 0:nx-1, 0:ny-1) m/N; the last two parts only when the materials couple n with t
      real(wp), allocatable :: table(:, :, :)
      !> (points) cell indices
      integer, allocatable :: ix(:), iy(:)
   contains
      procedure :: point_count
      procedure :: coupled
      procedure :: entry => entry_at
      procedure :: gather
      procedure :: add_to_dense
   end type compliance_t

contains

   !> Tabulate the influence coefficients of a grid.
   subroutine new_compliance(compliance, pair, grid)
      !> The compliance
      type(compliance_t), intent(out) :: compliance
      !> The materials of both bodies
      type(half_space_pair_t), intent(in) :: pair
      !> Cells and contact points
      type(be_grid_t), intent(in) :: grid
      real(wp) :: block(3, 3)
      integer :: parts, i, j

      parts = merge(part_12, part_n2, pair%coupling == 0.0_wp)
      allocate (compliance%table(parts, 0:grid%nx - 1, 0:grid%ny - 1))
      do j = 0, grid%ny - 1
         do i = 0, grid%nx - 1
            block = influence(pair, i*grid%dx, j*grid%dy, grid%dx, grid%dy)
            compliance%table(:part_12, i, j) = [block(1, 1), block(2, 2), block(3, 3), block(2, 3)]
            if (parts > part_12) compliance%table(part_n1:, i, j) = block(1, 2:3)
         end do
      end do
      compliance%ix = grid%ix
      compliance%iy = grid%iy
   end subroutine new_compliance

   !> Number of contact points.
   pure integer function point_count(self)
      class(compliance_t), intent(in) :: self
      point_count = size(self%ix)
   end function point_count

   !> True when normal forces cause tangential displacements (different materials).
   pure logical function coupled(self)
      class(compliance_t), intent(in) :: self
      coupled = size(self%table, 1) > part_12
   end function coupled

   !> The block C(field, source), order (n, t1, t2), m/N.
   pure function entry_at(self, offset_x, offset_y) result(block)
      class(compliance_t), intent(in) :: self
      !> Cell indices of the field point less those of the source point
      integer, intent(in) :: offset_x, offset_y
      real(wp) :: block(3, 3)
      integer :: sign_x, sign_y

      sign_x = sign(1, offset_x)
      sign_y = sign(1, offset_y)
      associate (part => self%table(:, abs(offset_x), abs(offset_y)))
         block = 0.0_wp
         block(1, 1) = part(part_nn)
         block(2, 2) = part(part_11)
         block(3, 3) = part(part_22)
         block(2, 3) = sign_x*sign_y*part(part_12)
         block(3, 2) = block(2, 3)
         if (self%coupled()) then
            block(1, 2) = sign_x*part(part_n1)
            block(1, 3) = sign_y*part(part_n2)
            block(2:3, 1) = -block(1, 2:3)
         end if
      end associate
   end function entry_at

   !> The dense block of two lists of points.
   subroutine gather(self, points_j, points_k, c)
      class(compliance_t), intent(in) :: self
      !> Point numbers of the rows
      integer, intent(in) :: points_j(:)
      !> Point numbers of the columns
      integer, intent(in) :: points_k(:)
      !> (3 rows, 3 columns) m/N, unknowns ordered (n, t1, t2) per point
      real(wp), intent(out), contiguous :: c(:, :)

      call fill_zero(c)
      call add_block(self%table, self%ix, self%iy, points_j, points_k, c)
   end subroutine gather

   !> g <- g + C of a subset of the points.
   subroutine add_to_dense(self, points, g)
      class(compliance_t), intent(in) :: self
      !> Point numbers of rows and columns
      integer, intent(in) :: points(:)
      !> (3 points, 3 points) m/N, unknowns ordered (n, t1, t2) per point
      real(wp), intent(inout), contiguous :: g(:, :)

      call add_block(self%table, self%ix, self%iy, points, points, g)
   end subroutine add_to_dense

   !> Set a matrix to zero, by columns in parallel as `add_block` will touch them.
   subroutine fill_zero(c)
      real(wp), intent(out), contiguous :: c(:, :)
      integer :: column

      !$omp parallel do default(none) shared(c) schedule(static)
      do column = 1, size(c, 2)
         c(:, column) = 0.0_wp
      end do
   end subroutine fill_zero

   !> g <- g + C for two lists of points.
   subroutine add_block(table, ix, iy, points_j, points_k, g)
      real(wp), intent(in), contiguous :: table(:, 0:, 0:)
      integer, intent(in), contiguous :: ix(:), iy(:)
      integer, intent(in) :: points_j(:), points_k(:)
      real(wp), intent(inout), contiguous :: g(:, :)
      integer :: j, k, row, col, ox, oy
      real(wp) :: c12, cn1, cn2
      logical :: coupled

      coupled = size(table, 1) > part_12
      !$omp parallel do default(none) shared(table, ix, iy, points_j, points_k, g, coupled) &
      !$omp private(j, row, col, ox, oy, c12, cn1, cn2) schedule(static)
      do k = 1, size(points_k)
         col = 3*k - 2
         do j = 1, size(points_j)
            row = 3*j - 2
            ox = ix(points_j(j)) - ix(points_k(k))
            oy = iy(points_j(j)) - iy(points_k(k))
            associate (part => table(:, abs(ox), abs(oy)))
               c12 = sign(1, ox)*sign(1, oy)*part(part_12)
               g(row, col) = g(row, col) + part(part_nn)
               g(row + 1, col + 1) = g(row + 1, col + 1) + part(part_11)
               g(row + 2, col + 1) = g(row + 2, col + 1) + c12
               g(row + 1, col + 2) = g(row + 1, col + 2) + c12
               g(row + 2, col + 2) = g(row + 2, col + 2) + part(part_22)
               if (coupled) then
                  cn1 = sign(1, ox)*part(part_n1)
                  cn2 = sign(1, oy)*part(part_n2)
                  g(row, col + 1) = g(row, col + 1) + cn1
                  g(row, col + 2) = g(row, col + 2) + cn2
                  g(row + 1, col) = g(row + 1, col) - cn1
                  g(row + 2, col) = g(row + 2, col) - cn2
               end if
            end associate
         end do
      end do
   end subroutine add_block

end module microslip_halfspace_compliance
