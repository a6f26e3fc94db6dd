!> Least-squares planes, for levelling and filtering of height profiles.
module microslip_surface_plane
   use microslip_core_kinds, only: wp
   implicit none(type, external)
   private

   public :: plane_t, fit_plane

   !> z = level + slope . (position - centre).
   type :: plane_t
      !> Mean of the fitted positions, m
      real(wp) :: centre(2) = 0.0_wp
      !> Height at the centre, m
      real(wp) :: level = 0.0_wp
      real(wp) :: slope(2) = 0.0_wp
   contains
      procedure :: at
   end type plane_t

contains

   !> The plane through points (x, y, z) in the least-squares sense: S slope = q with the centred second
   !> moments S = sum (r - c)(r - c)^T and q = sum (r - c)(z - mean z). Where the points lie on one line,
   !> only the slope along it is determined, and the slope across it is taken as zero.
   pure function fit_plane(position, z) result(plane)
      !> (2, points) m, at least one point
      real(wp), intent(in) :: position(:, :)
      !> (points) heights, m
      real(wp), intent(in) :: z(:)
      type(plane_t) :: plane
      real(wp) :: sxx, sxy, syy, q(2), determinant

      plane%centre = sum(position, dim=2)/size(z)
      plane%level = sum(z)/size(z)
      associate (x => position(1, :) - plane%centre(1), y => position(2, :) - plane%centre(2), h => z - plane%level)
         sxx = sum(x*x)
         sxy = sum(x*y)
         syy = sum(y*y)
         q = [sum(x*h), sum(y*h)]
      end associate
      determinant = sxx*syy - sxy*sxy
      if (determinant > epsilon(1.0_wp)*(sxx + syy)**2) then
         plane%slope = [syy*q(1) - sxy*q(2), sxx*q(2) - sxy*q(1)]/determinant
      else if (sxx + syy > 0.0_wp) then
         plane%slope = q/(sxx + syy)
      end if
   end function fit_plane

   !> Height of the plane at a position, m.
   pure real(wp) function at(self, x, y)
      class(plane_t), intent(in) :: self
      !> m
      real(wp), intent(in) :: x, y
      at = self%level + self%slope(1)*(x - self%centre(1)) + self%slope(2)*(y - self%centre(2))
   end function at

end module microslip_surface_plane
