!> The set-valued contact laws of one point and the residual that measures how well they hold.
!>
!> Per point (n, t1, t2), METHOD section 4 and paper eqs. (3), (7):
!>     normal       0 <= gap_n  _|_  force_n >= 0
!>     tangential   force_t = proj_disk(mu force_n) (force_t - eps slip),   slip = gap_t - gap_t_old
!> force_n > 0 is compression; friction opposes the slip. Both tangential components share one eps:
!> with different ones the fixed point has friction that is not antiparallel to the slip.
module microslip_contact_laws
   use microslip_core_kinds, only: wp
   implicit none(type, external)
   private

   public :: state_open, state_stick, state_slip
   public :: smallest_force, project_on_disk, classify, law_residual, state_at_rest

   !> Contact states of a point.
   integer, parameter :: state_open = 0, state_stick = 1, state_slip = 2

   !> N: stands for the largest force where there is none. What is divided by it does not overflow.
   real(wp), parameter :: smallest_force = 1.0e-150_wp

contains

   !> Radial return of a tangential force to the disk of the given radius.
   pure function project_on_disk(force, radius) result(projected)
      !> (2) N
      real(wp), intent(in) :: force(2)
      !> N, not negative
      real(wp), intent(in) :: radius
      real(wp) :: projected(2)
      real(wp) :: length

      length = norm2(force)
      projected = force
      if (length > radius) projected = force*(radius/length)
   end function project_on_disk

   !> State of a closed point that has not been found to slip: without friction nothing holds it, and it slips.
   elemental integer function state_at_rest(friction)
      !> Friction coefficient
      real(wp), intent(in) :: friction

      state_at_rest = merge(state_stick, state_slip, friction > 0.0_wp)
   end function state_at_rest

   !> Contact state that the augmented forces force - stiffness * (gap, slip) select.
   pure integer function classify(force, gap, slip, stiffness_n, stiffness_t, friction, limit)
      !> (3) N
      real(wp), intent(in) :: force(3)
      !> Normal gap, m
      real(wp), intent(in) :: gap
      !> (2) tangential slip of this step, m
      real(wp), intent(in) :: slip(2)
      !> Augmentation, N/m: normal, and the one shared by both tangential components
      real(wp), intent(in) :: stiffness_n, stiffness_t
      !> Friction coefficient
      real(wp), intent(in) :: friction
      !> Largest friction force, N, where it is held (Tresca); else it follows the normal force
      real(wp), intent(in), optional :: limit
      real(wp) :: augmented, largest

      augmented = force(1) - stiffness_n*gap
      largest = friction*augmented
      if (present(limit)) largest = limit
      if (augmented <= 0.0_wp) then
         classify = state_open
      else if (norm2(force(2:3) - stiffness_t*slip) <= largest) then
         classify = state_at_rest(friction)
      else
         classify = state_slip
      end if
   end function classify

   !> Largest violation of the laws at one point as a force: |force - projection of the augmented force|.
   !> It is zero exactly where all laws hold.
   pure real(wp) function law_residual(force, gap, slip, stiffness_n, stiffness_t, friction, limit)
      !> (3) N
      real(wp), intent(in) :: force(3)
      !> Normal gap, m
      real(wp), intent(in) :: gap
      !> (2) tangential slip of this step, m
      real(wp), intent(in) :: slip(2)
      !> Augmentation, N/m
      real(wp), intent(in) :: stiffness_n, stiffness_t
      !> Friction coefficient
      real(wp), intent(in) :: friction
      !> Largest friction force of a closed point, N, where it is held
      real(wp), intent(in), optional :: limit
      real(wp) :: normal, tangential(2), largest

      normal = max(0.0_wp, force(1) - stiffness_n*gap)
      largest = friction*max(0.0_wp, force(1))
      if (present(limit)) largest = merge(limit, 0.0_wp, normal > 0.0_wp)
      tangential = project_on_disk(force(2:3) - stiffness_t*slip, largest)
      law_residual = max(abs(force(1) - normal), norm2(force(2:3) - tangential))
   end function law_residual

end module microslip_contact_laws
