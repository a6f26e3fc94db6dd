!> An error measure for frictional contact that is independent of solvers and their laws: the natural map of the
!> Coulomb cone with De Saxce's shift.
!>
!>     error = ||force - proj_K(force - u^)|| / max(1, ||c||),   u^ = u + (mu |u_t|, 0, 0),   u = c + G force
!>
!> K is the product of the cones |force_t| <= mu force_n. The error is zero exactly where Signorini's and Coulomb's
!> laws hold: force in K, u^ in the dual cone, and the two orthogonal. It is an absolute measure with the unit of a
!> force equal to that of u.
!>
!> De Saxce & Feng (1998), The bipotential method; Acary, Bremond & Huber (2018), On solving contact problems with
!> Coulomb friction, section 4 (the measure of the FCLib benchmark).
module microslip_contact_natural_map
   use microslip_core_kinds, only: wp
   implicit none(type, external)
   private

   public :: natural_map_error, project_on_cone

contains

   !> The error of forces for the problem u = c + G force.
   pure real(wp) function natural_map_error(G, c, friction, force) result(error)
      !> (3 points, 3 points) compliance
      real(wp), intent(in), contiguous :: G(:, :)
      !> (3 points) gap and slip without forces
      real(wp), intent(in) :: c(:)
      !> (points)
      real(wp), intent(in) :: friction(:)
      !> (3 points)
      real(wp), intent(in) :: force(:)
      real(wp) :: u(size(c)), shifted(3)
      integer :: p, k

      u = c + matmul(G, force)
      error = 0.0_wp
      do p = 1, size(friction)
         k = 3*p - 2
         shifted = u(k:k + 2)
         shifted(1) = shifted(1) + friction(p)*norm2(u(k + 1:k + 2))
         error = hypot(error, norm2(force(k:k + 2) - project_on_cone(force(k:k + 2) - shifted, friction(p))))
      end do
      error = error/max(1.0_wp, norm2(c))
   end function natural_map_error

   !> Euclidean projection on the cone |x_t| <= mu x_n.
   pure function project_on_cone(x, friction) result(projected)
      !> (3) normal part first
      real(wp), intent(in) :: x(3)
      real(wp), intent(in) :: friction
      real(wp) :: projected(3)
      real(wp) :: length

      length = norm2(x(2:3))
      if (length <= friction*x(1)) then
         projected = x
      else if (friction*length <= -x(1)) then
         projected = 0.0_wp
      else
         projected(1) = (x(1) + friction*length)/(1.0_wp + friction**2)
         projected(2:3) = x(2:3)*(friction*projected(1)/length)
      end if
   end function project_on_cone

end module microslip_contact_natural_map
