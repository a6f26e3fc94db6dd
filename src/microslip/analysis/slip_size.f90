!> How far closed points have moved along the interface, against the size of the grid's cells.
!>
!> Slip is taken to be small: pairs of points, heights and the coupling with the FE mesh stay where they are. From half a
!> cell on, a point faces the height that belongs to its neighbour.
module microslip_analysis_slip_size
   use microslip_contact_laws, only: state_open
   use microslip_contact_problem, only: contact_state_t
   use microslip_core_kinds, only: wp
   use microslip_system_jointed_system, only: jointed_system_t
   implicit none(type, external)
   private

   public :: slip_in_cells

contains

   !> Largest tangential displacement of a closed point over the width of its pad's cells (root of the largest area).
   pure real(wp) function slip_in_cells(system, contact) result(slip)
      type(jointed_system_t), intent(in) :: system
      !> On the points in potential contact
      type(contact_state_t), intent(in) :: contact
      real(wp) :: largest
      integer :: k, p

      slip = 0.0_wp
      do k = 1, size(system%pads)
         associate (pad => system%pads(k))
            largest = 0.0_wp
            do p = pad%point_offset + 1, pad%point_offset + size(pad%potential)
               if (contact%status(p) /= state_open) largest = max(largest, sum(contact%gap(2:3, p)**2))
            end do
            slip = max(slip, sqrt(largest/maxval(pad%grid%area)))
         end associate
      end do
   end function slip_in_cells

end module microslip_analysis_slip_size
