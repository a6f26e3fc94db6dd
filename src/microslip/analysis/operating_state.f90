!> The state that one analysis hands to the next: a static equilibrium with its contact.
module microslip_analysis_operating_state
   use microslip_contact_laws, only: state_open
   use microslip_contact_problem, only: contact_state_t, gap_of
   use microslip_core_kinds, only: wp
   use microslip_system_jointed_system, only: jointed_system_t
   implicit none(type, external)
   private

   public :: operating_state_t, follow_set

   type :: operating_state_t
      !> (modes) modal coordinates
      real(wp), allocatable :: modal(:)
      !> (loads) amplitudes of the load patterns that stay on
      real(wp), allocatable :: amplitude(:)
      !> Contact at the points in potential contact; its driver is [modal; amplitude]
      type(contact_state_t) :: contact
   end type operating_state_t

contains

   !> Bring a contact state up to the potential contact set of the system after it has grown: the points that joined are
   !> open.
   subroutine follow_set(system, contact)
      type(jointed_system_t), intent(in) :: system
      !> Of the set before
      type(contact_state_t), intent(inout) :: contact
      type(contact_state_t) :: old
      integer :: p

      old = contact
      deallocate (contact%force, contact%gap, contact%status)
      allocate (contact%force(3, system%problem%n_points), source=0.0_wp)
      allocate (contact%status(system%problem%n_points), source=state_open)
      associate (previous => system%previous_index)
         do p = 1, system%problem%n_points
            if (previous(p) > 0) contact%force(:, p) = old%force(:, previous(p))
         end do
         contact%gap = gap_of(system%problem, contact%q, contact%force)
         do p = 1, system%problem%n_points
            if (previous(p) == 0) cycle
            contact%status(p) = old%status(previous(p))
            if (contact%status(p) /= state_open) contact%gap(:, p) = old%gap(:, previous(p))
         end do
      end associate
   end subroutine follow_set

end module microslip_analysis_operating_state
