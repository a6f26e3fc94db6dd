!> Topography from gridded data, such as a surface scan or a composite gap.
!>
!> Data coordinates d and interface coordinates p = (t1, t2) are related by p = offset + Rot(angle) F d, with F
!> mirroring the data where asked. Between data points the height is bilinear. Unknown values (NaN) are
!> estimated from their neighbours, layer by layer, each as the mean of those of its 8 neighbours that are known
!> or were estimated before; outside the data the nearest edge value is taken. Contact points that rest on
!> such estimates are counted, and refused when they are too many.
module microslip_surface_height_map
   use, intrinsic :: ieee_arithmetic, only: ieee_is_finite, ieee_is_nan
   use microslip_core_error, only: error_t, bad_input
   use microslip_core_kinds, only: wp
   use microslip_core_text, only: to_text, lower_case
   use microslip_surface_gaussian_filter, only: low_pass
   use microslip_surface_scan_check, only: about_plane, find_outliers
   use microslip_surface_topography, only: topography_t
   implicit none(type, external)
   private

   public :: height_map_t, new_height_map, scan_record_t, sampling_t

   !> What a map is made of.
   type :: scan_record_t
      !> Points along x and y, and how many of them are unknown
      integer :: points(2) = 0, unknown = 0
      !> Ends of x and of y, m
      real(wp) :: lower(2) = 0.0_wp, upper(2) = 0.0_wp
      !> Root mean square and largest deviation from the mean plane, before and after the filter, m
      real(wp) :: rms(2) = 0.0_wp, largest(2) = 0.0_wp
      !> Points that deviate from their neighbours as no other does; where the worst is, m, and by how much, m
      integer :: outliers = 0
      real(wp) :: outlier_at(2) = 0.0_wp, outlier = 0.0_wp
   end type scan_record_t

   !> How cells of a grid compare with the scan points in them.
   type :: sampling_t
      !> Known scan points in all cells, and cells with enough of them for a plane
      integer :: points = 0, cells = 0
      !> Root mean square of the heights about the plane of their cell, m: waves shorter than a cell
      real(wp) :: within = 0.0_wp
      !> (cells of the grid) whether there are enough points, and mean height at the centre, m
      logical, allocatable :: filled(:)
      real(wp), allocatable :: mean(:)
   end type sampling_t

   !> Heights on a rectangular grid and how it lies on the interface.
   type, extends(topography_t) :: height_map_t
      private
      !> (nx), (ny) ascending data coordinates, m
      real(wp), allocatable :: x(:), y(:)
      !> (nx, ny) heights, gaps filled, m
      real(wp), allocatable :: z(:, :)
      !> (nx, ny) false where the height was filled in
      logical, allocatable :: known(:, :)
      !> Interface position of the data's origin, m
      real(wp) :: offset(2) = 0.0_wp
      !> From t1 to the data's x axis, rad
      real(wp) :: angle = 0.0_wp
      !> -1 where the data coordinate is mirrored
      real(wp) :: mirror(2) = 1.0_wp
      !> Largest accepted share of contact points without known heights
      real(wp) :: max_estimated = 0.1_wp
      type(scan_record_t), public :: record
   contains
      procedure :: evaluate
      procedure :: sample
      procedure :: place
   end type height_map_t

contains

   !> Take over gridded data: z in the sense of a height or of a gap, scaled, then filtered, then gaps filled.
   subroutine new_height_map(map, x, y, z, sense, error, scale, cutoff, max_estimated)
      !> The surface, lying unmoved on the interface (see `place`)
      type(height_map_t), intent(out) :: map
      !> (nx), (ny) coordinates, strictly ascending, m
      real(wp), intent(in) :: x(:), y(:)
      !> (nx, ny) values, NaN where unknown, m after scaling
      real(wp), intent(in) :: z(:, :)
      !> 'height' (larger sticks out) or 'gap' (larger is more distant)
      character(len=*), intent(in) :: sense
      !> Set when the data make no surface
      type(error_t), allocatable, intent(out) :: error
      !> Factor on z, 1 by default
      real(wp), intent(in), optional :: scale
      !> Cut-off wavelength of a Gaussian low-pass filter, m; no filter by default
      real(wp), intent(in), optional :: cutoff
      !> Largest accepted share of contact points without known heights, 0.1 by default
      real(wp), intent(in), optional :: max_estimated

      call check_data(x, y, z, error)
      if (allocated(error)) return
      map%x = x
      map%y = y
      select case (lower_case(trim(sense)))
      case ('height')
         map%z = z
      case ('gap')
         map%z = -z
      case default
         call bad_input(error, 'unknown sense '''//trim(sense)//''' of the topography, known are ''height'' and ''gap''')
         return
      end select
      if (present(scale)) then
         if (.not. ieee_is_finite(scale)) then
            call bad_input(error, 'the scale of the topography must be finite')
            return
         end if
         map%z = scale*map%z
      end if
      if (present(max_estimated)) map%max_estimated = max_estimated
      call look_at_data(map)
      if (present(cutoff)) then
         if (.not. cutoff > 0.0_wp) then
            call bad_input(error, 'the cut-off wavelength must be positive, got '//to_text(cutoff))
            return
         end if
         call low_pass(x, y, cutoff, map%z)
      end if
      call measure(map, 2)
      map%known = .not. ieee_is_nan(map%z)
      call fill_gaps(map%z)
   end subroutine new_height_map

   !> The record of the data before the filter.
   subroutine look_at_data(map)
      type(height_map_t), intent(inout) :: map
      integer :: worst(2)

      associate (record => map%record)
         record%points = [size(map%x), size(map%y)]
         record%unknown = count(ieee_is_nan(map%z))
         record%lower = [map%x(1), map%y(1)]
         record%upper = [map%x(size(map%x)), map%y(size(map%y))]
         call find_outliers(map%x, map%y, map%z, record%outliers, worst, record%outlier)
         if (record%outliers > 0) record%outlier_at = [map%x(worst(1)), map%y(worst(2))]
      end associate
      call measure(map, 1)
   end subroutine look_at_data

   !> Deviation of the heights from their mean plane.
   subroutine measure(map, stage)
      type(height_map_t), intent(inout) :: map
      !> 1: before the filter, 2: after it
      integer, intent(in) :: stage
      real(wp), allocatable :: flat(:)

      flat = about_plane(map%x, map%y, map%z, .not. ieee_is_nan(map%z))
      map%record%largest(stage) = maxval(abs(flat))
      ! Heights may be so small that their squares vanish.
      if (map%record%largest(stage) > 0.0_wp) map%record%rms(stage) = map%record%largest(stage) &
         & *norm2(flat/map%record%largest(stage))/sqrt(real(size(flat), wp))
   end subroutine measure

   !> What `new_height_map` asks of the data.
   subroutine check_data(x, y, z, error)
      real(wp), intent(in) :: x(:), y(:), z(:, :)
      type(error_t), allocatable, intent(out) :: error

      if (size(x) < 2 .or. size(y) < 2) then
         call bad_input(error, 'the topography needs at least two points each way')
      else if (size(z, 1) /= size(x) .or. size(z, 2) /= size(y)) then
         call bad_input(error, 'the topography has '//to_text(size(z, 1))//' x '//to_text(size(z, 2))//' values for ' &
            & //to_text(size(x))//' x '//to_text(size(y))//' coordinates')
      else if (.not. (all(ieee_is_finite(x)) .and. all(ieee_is_finite(y)))) then
         call bad_input(error, 'the coordinates of the topography must be finite')
      else if (.not. (all(x(2:) > x(:size(x) - 1)) .and. all(y(2:) > y(:size(y) - 1)))) then
         call bad_input(error, 'the coordinates of the topography must ascend strictly')
      else if (all(ieee_is_nan(z))) then
         call bad_input(error, 'the topography has no known value')
      else if (.not. all(ieee_is_finite(z) .or. ieee_is_nan(z))) then
         call bad_input(error, 'the topography has infinite values')
      end if
   end subroutine check_data

   !> Replace NaN, from the known values outwards.
   subroutine fill_gaps(z)
      real(wp), intent(inout) :: z(:, :)
      real(wp), allocatable :: next(:, :)
      integer :: i, j

      do while (any(ieee_is_nan(z)))
         next = z
         do j = 1, size(z, 2)
            do i = 1, size(z, 1)
               if (ieee_is_nan(z(i, j))) next(i, j) = mean_of_known(z(max(i - 1, 1):min(i + 1, size(z, 1)), &
                  & max(j - 1, 1):min(j + 1, size(z, 2))), z(i, j))
            end do
         end do
         z = next
      end do
   end subroutine fill_gaps

   !> Mean of the values that are not NaN; the default if there are none.
   pure real(wp) function mean_of_known(values, default)
      real(wp), intent(in) :: values(:, :), default
      integer :: known

      known = count(.not. ieee_is_nan(values))
      mean_of_known = default
      if (known > 0) mean_of_known = sum(values, mask=.not. ieee_is_nan(values))/known
   end function mean_of_known

   !> Move the data over the interface: p = offset + Rot(angle) F d.
   subroutine place(self, offset, angle, flip, error)
      class(height_map_t), intent(inout) :: self
      !> Interface position (t1, t2) of the data's origin, m
      real(wp), intent(in) :: offset(2)
      !> From t1 to the data's x axis, counter-clockwise, rad
      real(wp), intent(in) :: angle
      !> 'none', 'x', 'y' or 'xy': data coordinates whose sign is changed first
      character(len=*), intent(in) :: flip
      !> Set for an unknown flip or a number that is not finite
      type(error_t), allocatable, intent(out) :: error

      if (.not. (all(ieee_is_finite(offset)) .and. ieee_is_finite(angle))) then
         call bad_input(error, 'offset and rotation of the topography must be finite')
         return
      end if
      select case (lower_case(trim(flip)))
      case ('none', 'x', 'y', 'xy')
         self%mirror = 1.0_wp
         if (index(lower_case(flip), 'x') > 0) self%mirror(1) = -1.0_wp
         if (index(lower_case(flip), 'y') > 0) self%mirror(2) = -1.0_wp
      case default
         call bad_input(error, 'unknown flip '''//trim(flip)//''', known are ''none'', ''x'', ''y'' and ''xy''')
         return
      end select
      self%offset = offset
      self%angle = angle
   end subroutine place

   !> Bilinear heights at the contact points.
   subroutine evaluate(self, position, height, estimated, error)
      class(height_map_t), intent(in) :: self
      !> (2, points) along t1, t2, m
      real(wp), intent(in) :: position(:, :)
      !> (points) m
      real(wp), intent(out) :: height(:)
      !> (points) whether they are outside the data or next to unknown values
      logical, intent(out) :: estimated(:)
      !> Set when the estimated points are too many
      type(error_t), allocatable, intent(out) :: error
      real(wp) :: d(2)
      logical :: known
      integer :: k, guesses

      do k = 1, size(height)
         d = data_coordinates(self, position(:, k))
         call interpolate(self, d, height(k), known)
         estimated(k) = .not. known
      end do
      guesses = count(estimated)
      if (guesses > self%max_estimated*size(height)) then
         call bad_input(error, to_text(guesses)//' of '//to_text(size(height))//' contact points have no known '// &
            & 'topography (outside the data or in its gaps); the largest accepted share is '//to_text(self%max_estimated))
      end if
   end subroutine evaluate

   !> Where in the data a point of the interface lies.
   pure function data_coordinates(self, position) result(d)
      type(height_map_t), intent(in) :: self
      !> t1, t2, m
      real(wp), intent(in) :: position(2)
      real(wp) :: d(2), moved(2)

      moved = position - self%offset
      d = self%mirror*[cos(self%angle)*moved(1) + sin(self%angle)*moved(2), &
         & cos(self%angle)*moved(2) - sin(self%angle)*moved(1)]
   end function data_coordinates

   !> Compare the cells of a regular grid with the known scan points in them: a plane through the points of every cell,
   !>
   !>     z = m + a xi + b eta + e,      xi, eta = -1/2 ... 1/2 in the cell,
   !>
   !> by least squares. m is the mean height at the centre; `within` is the standard deviation of e over all cells, with the
   !> three parameters of every plane taken off the number of points.
   function sample(self, lower, upper, nx, ny) result(sampling)
      class(height_map_t), intent(in) :: self
      !> Corners of the grid along t1, t2, m
      real(wp), intent(in) :: lower(2), upper(2)
      !> Cells along t1, t2
      integer, intent(in) :: nx, ny
      type(sampling_t) :: sampling
      !> Fewest points for a plane and an estimate of the rest
      integer, parameter :: fewest = 4
      real(wp), allocatable :: sums(:, :)
      real(wp) :: p(2), xi(2), total, left, unit
      integer :: i, j, cell, k(2), freedom

      unit = max(self%record%largest(2), tiny(1.0_wp))
      allocate (sums(10, nx*ny), source=0.0_wp)
      do j = 1, size(self%y)
         do i = 1, size(self%x)
            if (.not. self%known(i, j)) cycle
            p = self%mirror*[self%x(i), self%y(j)]
            p = self%offset + [cos(self%angle)*p(1) - sin(self%angle)*p(2), sin(self%angle)*p(1) + cos(self%angle)*p(2)]
            if (any(p < lower) .or. any(p > upper)) cycle
            xi = (p - lower)/(upper - lower)*[nx, ny]
            k = min(int(xi), [nx, ny] - 1)
            xi = xi - k - 0.5_wp
            cell = 1 + k(1) + nx*k(2)
            associate (z => self%z(i, j)/unit)
               sums(:, cell) = sums(:, cell) + [1.0_wp, xi, xi(1)**2, xi(1)*xi(2), xi(2)**2, z, xi*z, z**2]
            end associate
         end do
      end do
      allocate (sampling%filled(nx*ny), source=.false.)
      allocate (sampling%mean(nx*ny), source=0.0_wp)
      sampling%points = nint(sum(sums(1, :)))
      total = 0.0_wp
      freedom = 0
      do cell = 1, nx*ny
         if (nint(sums(1, cell)) < fewest) cycle
         call plane_of_cell(sums(:, cell), sampling%mean(cell), left, sampling%filled(cell))
         if (.not. sampling%filled(cell)) cycle
         total = total + left
         freedom = freedom + nint(sums(1, cell)) - 3
      end do
      sampling%cells = count(sampling%filled)
      sampling%mean = unit*sampling%mean
      sampling%within = unit*sqrt(max(0.0_wp, total)/max(1, freedom))
   end function sample

   !> Plane through the points of a cell from their sums (1, xi, eta, xi^2, xi eta, eta^2, z, xi z, eta z, z^2).
   pure subroutine plane_of_cell(s, mean, left, found)
      real(wp), intent(in) :: s(10)
      !> Height at the centre
      real(wp), intent(out) :: mean
      !> Sum of the squares of what is left
      real(wp), intent(out) :: left
      !> False where the points are on one line
      logical, intent(out) :: found
      real(wp) :: c(2), q(2), slope(2), sxx, sxy, syy, determinant

      c = s(2:3)/s(1)
      sxx = s(4) - s(1)*c(1)**2
      sxy = s(5) - s(1)*c(1)*c(2)
      syy = s(6) - s(1)*c(2)**2
      q = s(8:9) - c*s(7)
      determinant = sxx*syy - sxy**2
      found = determinant > 1.0e-6_wp*(sxx + syy)**2
      mean = 0.0_wp
      left = 0.0_wp
      if (.not. found) return
      slope = [syy*q(1) - sxy*q(2), sxx*q(2) - sxy*q(1)]/determinant
      mean = s(7)/s(1) - dot_product(slope, c)
      left = max(0.0_wp, s(10) - s(7)**2/s(1) - dot_product(slope, q))
   end subroutine plane_of_cell

   !> Bilinear value at data coordinates d. It is known if d lies within the data (to rounding) and every corner
   !> of its cell that has weight is known.
   pure subroutine interpolate(self, d, value, known)
      type(height_map_t), intent(in) :: self
      real(wp), intent(in) :: d(2)
      real(wp), intent(out) :: value
      logical, intent(out) :: known
      real(wp) :: wx(2), wy(2), weight(2, 2)
      integer :: i, j
      logical :: inside_x, inside_y

      call bracket(self%x, d(1), i, wx, inside_x)
      call bracket(self%y, d(2), j, wy, inside_y)
      weight = spread(wx, 2, 2)*spread(wy, 1, 2)
      value = sum(weight*self%z(i:i + 1, j:j + 1))
      known = inside_x .and. inside_y .and. all(self%known(i:i + 1, j:j + 1) .or. weight < 1.0e-9_wp)
   end subroutine interpolate

   !> Interval i of ascending x that holds s, and the weights of its ends; s is moved to the nearest end outside.
   pure subroutine bracket(x, s, i, weight, inside)
      real(wp), intent(in) :: x(:), s
      integer, intent(out) :: i
      real(wp), intent(out) :: weight(2)
      logical, intent(out) :: inside
      real(wp) :: slack
      integer :: high, middle

      i = 1
      high = size(x)
      do while (high - i > 1)
         middle = (i + high)/2
         if (x(middle) <= s) then
            i = middle
         else
            high = middle
         end if
      end do
      weight(2) = min(1.0_wp, max(0.0_wp, (s - x(i))/(x(i + 1) - x(i))))
      weight(1) = 1.0_wp - weight(2)
      slack = 1.0e-9_wp*(x(size(x)) - x(1))
      inside = s >= x(1) - slack .and. s <= x(size(x)) + slack
   end subroutine bracket

end module microslip_surface_height_map
