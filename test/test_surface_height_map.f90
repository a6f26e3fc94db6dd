!> Measured surfaces: interpolation, placement, missing values, filter, refused data.
module test_surface_height_map
   use, intrinsic :: ieee_arithmetic, only: ieee_value, ieee_quiet_nan, ieee_is_nan
   use microslip_core_error, only: error_t, status_bad_input
   use microslip_core_kinds, only: wp, pi
   use microslip_surface_gaussian_filter, only: low_pass
   use microslip_surface_height_map, only: height_map_t, new_height_map, sampling_t
   use testdrive, only: new_unittest, unittest_type, test_error => error_type, check
   implicit none(type, external)
   private

   public :: collect_surface_height_map

   integer, parameter :: nx = 9, ny = 7
   !> Rounding relative to heights of order one
   real(wp), parameter :: tol = 1.0e-13_wp

contains

   subroutine collect_surface_height_map(testsuite)
      type(unittest_type), allocatable, intent(out) :: testsuite(:)

      testsuite = [ &
         & new_unittest('plane', test_plane), &
         & new_unittest('sense-and-scale', test_sense), &
         & new_unittest('placement', test_placement), &
         & new_unittest('levelling', test_levelling), &
         & new_unittest('gaps', test_gaps), &
         & new_unittest('outside', test_outside), &
         & new_unittest('filter-plane', test_filter_plane), &
         & new_unittest('filter-wave', test_filter_wave), &
         & new_unittest('cells-of-a-grid', test_cells), &
         & new_unittest('record', test_record), &
         & new_unittest('bad-data', test_bad_data) &
         & ]
   end subroutine collect_surface_height_map

   !> Unevenly spaced coordinates and a plane over them.
   subroutine make_plane(x, y, z)
      real(wp), allocatable, intent(out) :: x(:), y(:), z(:, :)
      integer :: k

      x = [(-1.0_wp + 0.3_wp*k + 0.01_wp*k**2, k=0, nx - 1)]
      y = [(0.2_wp*k - 0.5_wp, k=0, ny - 1)]
      z = spread(2.0_wp*x, 2, ny) - spread(0.7_wp*y, 1, nx) + 0.1_wp
   end subroutine make_plane

   !> Scattered points within the data.
   function some_points() result(position)
      real(wp) :: position(2, 20)
      integer :: k

      position(1, :) = [(-0.95_wp + 2.8_wp*modulo(0.618_wp*k, 1.0_wp), k=1, 20)]
      position(2, :) = [(-0.45_wp + 1.1_wp*modulo(0.377_wp*k, 1.0_wp), k=1, 20)]
   end function some_points

   !> Heights without levelling and touching; the set-up must be accepted.
   function raw_heights(map, position) result(h)
      type(height_map_t), intent(inout) :: map
      real(wp), intent(in) :: position(:, :)
      real(wp), allocatable :: h(:)
      type(error_t), allocatable :: problem

      call map%set_levelling('none', problem, touching=.false.)
      call map%heights(position, h, problem)
      if (allocated(problem)) error stop 'heights refused'
   end function raw_heights

   !> Bilinear interpolation is exact on a plane, data points and edges included.
   subroutine test_plane(error)
      type(test_error), allocatable, intent(out) :: error
      real(wp), allocatable :: x(:), y(:), z(:, :), position(:, :)
      type(height_map_t) :: map
      type(error_t), allocatable :: problem

      call make_plane(x, y, z)
      call new_height_map(map, x, y, z, 'height', problem)
      call check(error, .not. allocated(problem))
      if (allocated(error)) return
      position = reshape([some_points(), x(1), y(1), x(nx), y(ny), x(4), y(ny)], [2, 23])
      call check(error, maxval(abs(raw_heights(map, position) - (2.0_wp*position(1, :) - 0.7_wp*position(2, :) + 0.1_wp))) <= tol)
   end subroutine test_plane

   subroutine test_sense(error)
      type(test_error), allocatable, intent(out) :: error
      real(wp), allocatable :: x(:), y(:), z(:, :)
      type(height_map_t) :: map, gap
      type(error_t), allocatable :: problem

      call make_plane(x, y, z)
      call new_height_map(map, x, y, z, 'height', problem)
      call new_height_map(gap, x, y, z, 'Gap', problem, scale=1.0e-3_wp)
      call check(error, maxval(abs(raw_heights(map, some_points()) + 1.0e3_wp*raw_heights(gap, some_points()))) <= tol)
   end subroutine test_sense

   !> Data moved over the interface: the mark at d is found at offset + Rot F d.
   subroutine test_placement(error)
      type(test_error), allocatable, intent(out) :: error
      real(wp), parameter :: angle = 0.4_wp, offset(2) = [0.3_wp, -0.2_wp], d(2) = [0.35_wp, 0.12_wp]
      real(wp), allocatable :: x(:), y(:), z(:, :)
      real(wp) :: p(2), mirror(2)
      type(height_map_t) :: map
      type(error_t), allocatable :: problem
      character(len=4), parameter :: flips(4) = ['none', 'x   ', 'y   ', 'xy  ']
      integer :: k

      call make_plane(x, y, z)
      call new_height_map(map, x, y, z, 'height', problem)
      do k = 1, size(flips)
         call map%place(offset, angle, flips(k), problem)
         mirror = [merge(-1, 1, index(flips(k), 'x') > 0), merge(-1, 1, index(flips(k), 'y') > 0)]
         p = offset + [cos(angle)*mirror(1)*d(1) - sin(angle)*mirror(2)*d(2), &
            & sin(angle)*mirror(1)*d(1) + cos(angle)*mirror(2)*d(2)]
         call check(error, maxval(abs(raw_heights(map, reshape(p, [2, 1])) - (2.0_wp*d(1) - 0.7_wp*d(2) + 0.1_wp))) <= tol)
         if (allocated(error)) return
      end do
   end subroutine test_placement

   !> Levelling takes the plane out of a measured surface.
   subroutine test_levelling(error)
      type(test_error), allocatable, intent(out) :: error
      real(wp), allocatable :: x(:), y(:), z(:, :), h(:)
      type(height_map_t) :: map
      type(error_t), allocatable :: problem

      call make_plane(x, y, z)
      call new_height_map(map, x, y, z, 'height', problem)
      call map%set_levelling('plane', problem)
      call map%heights(some_points(), h, problem)
      call check(error, maxval(abs(h)) <= tol)
   end subroutine test_levelling

   !> Gaps are filled within the range of the known values; points there are counted, and refused when too many.
   subroutine test_gaps(error)
      type(test_error), allocatable, intent(out) :: error
      real(wp), allocatable :: x(:), y(:), z(:, :), h(:), position(:, :)
      type(height_map_t) :: map
      type(error_t), allocatable :: problem
      logical, allocatable :: estimated(:)

      call make_plane(x, y, z)
      position = reshape([x(4), y(3), x(5), y(4), x(8), y(6), x(8), y(5)], [2, 4])
      z(3:5, 2:4) = ieee_value(1.0_wp, ieee_quiet_nan)
      z(nx, ny) = ieee_value(1.0_wp, ieee_quiet_nan)
      call new_height_map(map, x, y, z, 'height', problem, max_estimated=0.5_wp)
      call map%set_levelling('none', problem, touching=.false.)
      call map%heights(position, h, problem, estimated)
      call check(error, .not. allocated(problem) .and. count(estimated) == 2)
      if (allocated(error)) return
      call check(error, h(1) > z(2, 3) .and. h(1) < z(6, 3) .and. h(2) > z(2, 4) .and. h(2) < z(6, 4))
      if (allocated(error)) return
      call check(error, maxval(abs(h(3:4) - [z(8, 6), z(8, 5)])) <= tol)
      if (allocated(error)) return
      call new_height_map(map, x, y, z, 'height', problem)
      call map%heights(position, h, problem)
      call check(error, allocated(problem), 'too many unknown heights accepted')
   end subroutine test_gaps

   !> Beyond the data the nearest edge value, counted.
   subroutine test_outside(error)
      type(test_error), allocatable, intent(out) :: error
      real(wp), allocatable :: x(:), y(:), z(:, :), h(:)
      type(height_map_t) :: map
      type(error_t), allocatable :: problem
      logical, allocatable :: estimated(:)

      call make_plane(x, y, z)
      call new_height_map(map, x, y, z, 'height', problem, max_estimated=1.0_wp)
      call map%set_levelling('none', problem, touching=.false.)
      call map%heights(reshape([x(1) - 1.0_wp, y(3), x(nx) + 1.0_wp, y(ny) + 1.0_wp, x(2), y(2)], [2, 3]), h, problem, estimated)
      call check(error, .not. allocated(problem) .and. count(estimated) == 2)
      if (allocated(error)) return
      call check(error, maxval(abs(h - [z(1, 3), z(nx, ny), z(2, 2)])) <= tol)
   end subroutine test_outside

   !> A plane passes the filter, with gaps and uneven spacing.
   subroutine test_filter_plane(error)
      type(test_error), allocatable, intent(out) :: error
      real(wp), allocatable :: x(:), y(:), z(:, :), smooth(:, :)

      call make_plane(x, y, z)
      z(4:5, 3) = ieee_value(1.0_wp, ieee_quiet_nan)
      smooth = z
      call low_pass(x, y, 0.8_wp, smooth)
      call check(error, all(ieee_is_nan(smooth) .eqv. ieee_is_nan(z)))
      if (allocated(error)) return
      call check(error, maxval(abs(pack(smooth - z, .not. ieee_is_nan(z)))) <= tol)
   end subroutine test_filter_plane

   !> A wave of the cut-off wavelength keeps half its amplitude, one of twice the wavelength 2^(-1/4), away from edges.
   subroutine test_filter_wave(error)
      type(test_error), allocatable, intent(out) :: error
      integer, parameter :: n = 401, middle = 201
      real(wp) :: x(n), y(2), z(n, 2)
      integer :: k

      x = [(0.05_wp*(k - middle), k=1, n)]
      y = [0.0_wp, 1.0_wp]
      do k = 1, 2
         z = spread(cos(2.0_wp*pi*x/(2.0_wp*k)), 2, 2)
         call low_pass(x, y, 2.0_wp, z)
         ! the plane that is taken out before and put back after is a constant of about 1/n here
         call check(error, z(middle, 1), 0.5_wp**(1.0_wp/k**2), thr=2.0_wp/n)
         if (allocated(error)) return
      end do
   end subroutine test_filter_wave

   !> A plane with a checkerboard of +-a, 4 x 4 points in every cell, turned by 90 degrees: the planes of the cells are exact,
   !> and 16 a^2 are left in each of them for 16 - 3 degrees of freedom.
   subroutine test_cells(error)
      type(test_error), allocatable, intent(out) :: error
      integer, parameter :: cells(2) = [3, 2]
      real(wp), parameter :: a = 0.01_wp
      real(wp) :: x(4*cells(1)), y(4*cells(2)), z(size(x), size(y)), center(2)
      type(height_map_t) :: map
      type(sampling_t) :: sampling
      type(error_t), allocatable :: problem
      integer :: i, j

      x = [(0.25_wp*i - 0.125_wp, i=1, size(x))]
      y = [(0.25_wp*i - 0.125_wp, i=1, size(y))]
      do j = 1, size(y)
         z(:, j) = 2.0_wp*x - 0.7_wp*y(j) + a*[((-1)**(i + j), i=1, size(x))]
      end do
      call new_height_map(map, x, y, z, 'height', problem)
      ! (x, y) comes to (-y, x).
      call map%place([0.0_wp, 0.0_wp], 0.5_wp*pi, 'none', problem)
      sampling = map%sample([-2.0_wp, 0.0_wp], [0.0_wp, 3.0_wp], cells(2), cells(1))
      call check(error, sampling%points == size(z) .and. sampling%cells == product(cells))
      if (allocated(error)) return
      ! What is left is a difference of sums of squares: their rounding is eps (z/a)^2 of it per point.
      call check(error, sampling%within, a*sqrt(16.0_wp/13.0_wp), thr=16*epsilon(a)*(maxval(abs(z))/a)**2*a)
      if (allocated(error)) return
      do j = 1, cells(1)
         do i = 1, cells(2)
            center = [j - 0.5_wp, cells(2) - i + 0.5_wp]
            call check(error, sampling%mean(i + cells(2)*(j - 1)), 2.0_wp*center(1) - 0.7_wp*center(2), thr=10.0_wp*tol)
            if (allocated(error)) return
         end do
      end do
   end subroutine test_cells

   !> Rms and largest deviation before and after the filter, unknown points and an outlier.
   subroutine test_record(error)
      type(test_error), allocatable, intent(out) :: error
      real(wp), parameter :: height = 100.0_wp
      real(wp), allocatable :: x(:), y(:), z(:, :)
      type(height_map_t) :: map
      type(error_t), allocatable :: problem

      call make_plane(x, y, z)
      z(2, 2) = ieee_value(1.0_wp, ieee_quiet_nan)
      z(5, 4) = z(5, 4) - height
      call new_height_map(map, x, y, z, 'gap', problem, cutoff=1.0_wp)
      associate (record => map%record)
         call check(error, all(record%points == [nx, ny]) .and. record%unknown == 1 .and. record%outliers == 1)
         if (allocated(error)) return
         ! A gap that is smaller sticks out. The plane over a distance of one point is less than 3.
         call check(error, record%outlier, height, thr=3.0_wp)
         if (allocated(error)) return
         call check(error, abs(record%outlier_at(1) - x(5)) <= 0.0_wp .and. abs(record%outlier_at(2) - y(4)) <= 0.0_wp)
         if (allocated(error)) return
         call check(error, record%largest(1) < height .and. record%rms(1) < record%largest(1))
         if (allocated(error)) return
         call check(error, record%largest(2) < record%largest(1) .and. record%rms(2) < record%rms(1))
      end associate
   end subroutine test_record

   subroutine test_bad_data(error)
      type(test_error), allocatable, intent(out) :: error
      real(wp), allocatable :: x(:), y(:), z(:, :)
      type(height_map_t) :: map
      type(error_t), allocatable :: problem

      call make_plane(x, y, z)
      call new_height_map(map, x, y, transpose(z), 'height', problem)
      call expect('transposed data')
      if (allocated(error)) return
      call new_height_map(map, x(nx:1:-1), y, z, 'height', problem)
      call expect('descending coordinates')
      if (allocated(error)) return
      call new_height_map(map, x, y, z, 'depth', problem)
      call expect('unknown sense')
      if (allocated(error)) return
      call new_height_map(map, x, y, z, 'height', problem, scale=ieee_value(1.0_wp, ieee_quiet_nan))
      call expect('scale that is no number')
      if (allocated(error)) return
      call new_height_map(map, x, y, z, 'height', problem, cutoff=0.0_wp)
      call expect('cut-off zero')
      if (allocated(error)) return
      call new_height_map(map, x, y, z, 'height', problem)
      call map%place([0.0_wp, 0.0_wp], 0.0_wp, 'z', problem)
      call expect('unknown flip')
      if (allocated(error)) return
      z = ieee_value(1.0_wp, ieee_quiet_nan)
      call new_height_map(map, x, y, z, 'height', problem)
      call expect('no known value')

   contains

      subroutine expect(what)
         character(len=*), intent(in) :: what
         call check(error, allocated(problem), what//' accepted')
         if (allocated(error)) return
         call check(error, problem%status, status_bad_input)
      end subroutine expect

   end subroutine test_bad_data

end module test_surface_height_map
