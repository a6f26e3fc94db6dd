!> Gaussian low-pass filter for height profiles with missing values.
!>
!> Weight s(r) ~ exp(-pi (r/(alpha L))^2) with alpha = sqrt(ln 2/pi): a wave of the cut-off wavelength L keeps
!> half its amplitude (ISO 16610-21 for lines, 16610-61 for surfaces). Weights are normalised over the known
!> values, so edges and gaps are no trouble, and the least-squares plane is taken out before and put back
!> after: a plane passes unchanged. The filter is separable.
module microslip_surface_gaussian_filter
   use, intrinsic :: ieee_arithmetic, only: ieee_is_nan
   use microslip_core_kinds, only: wp, pi
   use microslip_surface_plane, only: plane_t, fit_plane
   implicit none(type, external)
   private

   public :: low_pass

   !> Weights are cut off at this many wavelengths, where they are exp(-14 * 1.5^2), below 1e-14.
   real(wp), parameter :: reach = 1.5_wp

contains

   !> Smooth z(x, y) in place. NaN stays NaN and has no influence.
   subroutine low_pass(x, y, cutoff, z)
      !> (nx), (ny) ascending coordinates, spacing may vary, m
      real(wp), intent(in) :: x(:), y(:)
      !> Wavelength that keeps half its amplitude, > 0, m
      real(wp), intent(in) :: cutoff
      !> (nx, ny) heights, NaN where unknown, m
      real(wp), intent(inout) :: z(:, :)
      real(wp), allocatable :: trend(:, :), weighted(:, :), weight(:, :)
      logical, allocatable :: known(:, :)

      known = .not. ieee_is_nan(z)
      if (.not. any(known)) return
      trend = plane_of_known(x, y, z, known)
      weight = merge(1.0_wp, 0.0_wp, known)
      weighted = merge(z - trend, 0.0_wp, known)
      call smooth_columns(x, cutoff, weight)
      call smooth_columns(x, cutoff, weighted)
      weight = transpose(weight)
      weighted = transpose(weighted)
      call smooth_columns(y, cutoff, weight)
      call smooth_columns(y, cutoff, weighted)
      where (known) z = trend + transpose(weighted)/transpose(weight)
   end subroutine low_pass

   !> Least-squares plane of the known values, everywhere.
   pure function plane_of_known(x, y, z, known) result(trend)
      real(wp), intent(in) :: x(:), y(:), z(:, :)
      logical, intent(in) :: known(:, :)
      real(wp), allocatable :: trend(:, :)
      type(plane_t) :: plane
      real(wp), allocatable :: position(:, :)
      integer :: i, j

      allocate (position(2, count(known)))
      position(1, :) = pack(spread(x, 2, size(y)), known)
      position(2, :) = pack(spread(y, 1, size(x)), known)
      plane = fit_plane(position, pack(z, known))
      allocate (trend(size(x), size(y)))
      do j = 1, size(y)
         do i = 1, size(x)
            trend(i, j) = plane%at(x(i), y(j))
         end do
      end do
   end function plane_of_known

   !> Replace every column f(:, j) by its Gaussian-weighted sums.
   subroutine smooth_columns(x, cutoff, f)
      real(wp), intent(in) :: x(:), cutoff
      real(wp), intent(inout) :: f(:, :)
      real(wp), allocatable :: row(:, :), weight(:)
      integer :: i, first, last

      allocate (row, mold=f)
      first = 1
      last = 1
      do i = 1, size(x)
         do while (x(i) - x(first) > reach*cutoff)
            first = first + 1
         end do
         do while (last < size(x))
            if (x(last + 1) - x(i) > reach*cutoff) exit
            last = last + 1
         end do
         weight = cell_width(x, first, last)*exp(-pi**2/log(2.0_wp)*((x(first:last) - x(i))/cutoff)**2)
         row(i, :) = matmul(weight, f(first:last, :))
      end do
      f = row
   end subroutine smooth_columns

   !> Lengths that the sample points first..last stand for, up to a common factor.
   pure function cell_width(x, first, last) result(width)
      real(wp), intent(in) :: x(:)
      integer, intent(in) :: first, last
      real(wp) :: width(last - first + 1)
      integer :: k, low, high

      width = 1.0_wp
      if (size(x) < 2) return
      do k = first, last
         low = max(k - 1, 1)
         high = min(k + 1, size(x))
         width(k - first + 1) = (x(high) - x(low))/(high - low)
      end do
   end function cell_width

end module microslip_surface_gaussian_filter
