!> The contact points of one interface: as a rule the cells of a regular boundary-element grid (METHOD section 3).
!>
!> A rectangle in the local coordinates (t1, t2) is divided into nx x ny equal cells; cells whose centre
!> lies in a hole are cut out. The centres of the others are the contact points, numbered with ix fastest.
!> Scattered points with areas of their own (FE nodes) are a grid of one row, whose x and y are those of its points.
module microslip_halfspace_grid
   use, intrinsic :: ieee_arithmetic, only: ieee_is_finite, ieee_value, ieee_quiet_nan
   use microslip_core_error, only: error_t, bad_input
   use microslip_core_kinds, only: wp
   use microslip_core_text, only: to_text
   implicit none(type, external)
   private

   public :: be_grid_t, new_grid, scattered_grid

   !> Cells, contact points and the way between the two.
   type :: be_grid_t
      !> Number of cells along t1 and t2
      integer :: nx = 0, ny = 0
      !> Whether these are the cells of a rectangle, not scattered points
      logical :: regular = .true.
      !> Corners of the rectangle, or of the bounding box of scattered points, in (t1, t2), m
      real(wp) :: lower(2) = 0.0_wp, upper(2) = 0.0_wp
      !> Cell widths, m
      real(wp) :: dx = 0.0_wp, dy = 0.0_wp
      !> (nx), (ny) cell centres along t1 and t2, m; (points) both, of scattered points
      real(wp), allocatable :: x(:), y(:)
      !> (nx, ny) cells that carry a contact point
      logical, allocatable :: inside(:, :)
      !> (points) cell indices of every contact point
      integer, allocatable :: ix(:), iy(:)
      !> (2, points) coordinates of the contact points along t1 and t2, m
      real(wp), allocatable :: position(:, :)
      !> (points) area of every contact point, m^2
      real(wp), allocatable :: area(:)
   contains
      procedure :: point_count
      procedure :: cell_area
      procedure :: to_map
      procedure :: from_map
   end type be_grid_t

contains

   !> Divide a rectangle into cells and cut out the holes and whatever the mask leaves out.
   subroutine new_grid(grid, lower, upper, nx, ny, error, holes, mask)
      !> The grid
      type(be_grid_t), intent(out) :: grid
      !> Corners of the rectangle in (t1, t2), m
      real(wp), intent(in) :: lower(2), upper(2)
      !> Number of cells along t1 and t2
      integer, intent(in) :: nx, ny
      !> Set when the input makes no grid
      type(error_t), allocatable, intent(out) :: error
      !> (3, holes) circular holes: centre along t1, t2 and radius, m
      real(wp), intent(in), optional :: holes(:, :)
      !> (nx, ny) false where there is no contact
      logical, intent(in), optional :: mask(:, :)
      integer :: k

      call check_input(lower, upper, nx, ny, error, holes, mask)
      if (allocated(error)) return
      grid%nx = nx
      grid%ny = ny
      grid%lower = lower
      grid%upper = upper
      grid%dx = (upper(1) - lower(1))/nx
      grid%dy = (upper(2) - lower(2))/ny
      grid%x = [(lower(1) + (k - 0.5_wp)*grid%dx, k=1, nx)]
      grid%y = [(lower(2) + (k - 0.5_wp)*grid%dy, k=1, ny)]
      allocate (grid%inside(nx, ny), source=.true.)
      if (present(mask)) grid%inside = mask
      if (present(holes)) call cut_holes(grid%x, grid%y, holes, grid%inside)
      if (.not. any(grid%inside)) then
         call bad_input(error, 'the holes leave no contact point on the grid')
         return
      end if
      call number_points(grid)
      grid%area = spread(grid%dx*grid%dy, 1, size(grid%ix))
   end subroutine new_grid

   !> Scattered points as a grid of one row.
   pure function scattered_grid(position, area) result(grid)
      !> (2, points) coordinates along t1 and t2, m
      real(wp), intent(in) :: position(:, :)
      !> (points) m^2
      real(wp), intent(in) :: area(:)
      type(be_grid_t) :: grid

      grid%nx = size(area)
      grid%ny = 1
      grid%regular = .false.
      grid%lower = minval(position, dim=2)
      grid%upper = maxval(position, dim=2)
      allocate (grid%inside(grid%nx, 1), source=.true.)
      allocate (grid%x(grid%nx), grid%y(grid%nx))
      grid%x = position(1, :)
      grid%y = position(2, :)
      call number_points(grid)
      grid%position = position
      grid%area = area
   end function scattered_grid

   !> What `new_grid` asks of its arguments.
   subroutine check_input(lower, upper, nx, ny, error, holes, mask)
      real(wp), intent(in) :: lower(2), upper(2)
      integer, intent(in) :: nx, ny
      type(error_t), allocatable, intent(out) :: error
      real(wp), intent(in), optional :: holes(:, :)
      logical, intent(in), optional :: mask(:, :)

      if (nx < 1 .or. ny < 1) then
         call bad_input(error, 'the grid needs at least one cell each way, got nx = '//to_text(nx)//', ny = '//to_text(ny))
      else if (.not. (all(ieee_is_finite(lower)) .and. all(ieee_is_finite(upper)))) then
         call bad_input(error, 'the extent of the grid must be finite')
      else if (.not. all(upper > lower)) then
         call bad_input(error, 'the upper corner of the grid ('//to_text(upper(1))//', '//to_text(upper(2))// &
            & ') must lie above the lower one ('//to_text(lower(1))//', '//to_text(lower(2))//')')
      end if
      if (allocated(error)) return
      if (present(holes)) then
         if (size(holes, 1) /= 3) then
            call bad_input(error, 'a hole needs three numbers: centre along t1 and t2, radius')
         else if (.not. (all(ieee_is_finite(holes)) .and. all(holes(3, :) > 0.0_wp))) then
            call bad_input(error, 'every hole needs a finite centre and a positive radius')
         end if
      end if
      if (allocated(error)) return
      if (present(mask)) then
         if (any(shape(mask) /= [nx, ny])) call bad_input(error, 'the mask must have nx x ny = '//to_text(nx)//' x ' &
            & //to_text(ny)//' values, got '//to_text(size(mask, 1))//' x '//to_text(size(mask, 2)))
      end if
   end subroutine check_input

   !> Take out the cells whose centre lies in a hole.
   pure subroutine cut_holes(x, y, holes, inside)
      real(wp), intent(in) :: x(:), y(:), holes(:, :)
      logical, intent(inout) :: inside(:, :)
      integer :: hole, ix, iy

      do hole = 1, size(holes, 2)
         do iy = 1, size(y)
            do ix = 1, size(x)
               if (hypot(x(ix) - holes(1, hole), y(iy) - holes(2, hole)) < holes(3, hole)) inside(ix, iy) = .false.
            end do
         end do
      end do
   end subroutine cut_holes

   !> List the contact points, ix fastest.
   pure subroutine number_points(grid)
      type(be_grid_t), intent(inout) :: grid
      integer :: ix, iy

      grid%ix = pack(spread([(ix, ix=1, grid%nx)], 2, grid%ny), grid%inside)
      grid%iy = pack(spread([(iy, iy=1, grid%ny)], 1, grid%nx), grid%inside)
      allocate (grid%position(2, size(grid%ix)))
      grid%position(1, :) = grid%x(grid%ix)
      grid%position(2, :) = grid%y(grid%iy)
   end subroutine number_points

   !> Number of contact points.
   pure integer function point_count(self)
      class(be_grid_t), intent(in) :: self
      point_count = size(self%ix)
   end function point_count

   !> Area of one cell, m^2.
   pure real(wp) function cell_area(self)
      class(be_grid_t), intent(in) :: self
      cell_area = self%dx*self%dy
   end function cell_area

   !> (nx, ny) map of point values, NaN where there is no contact point.
   pure function to_map(self, values) result(map)
      class(be_grid_t), intent(in) :: self
      !> (points)
      real(wp), intent(in) :: values(:)
      real(wp), allocatable :: map(:, :)

      map = unpack(values, self%inside, spread(spread(ieee_value(1.0_wp, ieee_quiet_nan), 1, self%nx), 2, self%ny))
   end function to_map

   !> (points) the values of a map at the contact points.
   pure function from_map(self, map) result(values)
      class(be_grid_t), intent(in) :: self
      !> (nx, ny)
      real(wp), intent(in) :: map(:, :)
      real(wp), allocatable :: values(:)

      values = pack(map, self%inside)
   end function from_map

end module microslip_halfspace_grid
