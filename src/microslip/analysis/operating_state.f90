!> The state that one analysis hands to the next: a static equilibrium with its contact.
module microslip_analysis_operating_state
   use microslip_contact_problem, only: contact_state_t, new_state
   use microslip_core_kinds, only: wp
   use microslip_system_jointed_system, only: jointed_system_t
   implicit none(type, external)
   private

   public :: operating_state_t, undeformed_state

   type :: operating_state_t
      !> (modes) modal coordinates
      real(wp), allocatable :: modal(:)
      !> (loads) amplitudes of the load patterns that stay on
      real(wp), allocatable :: amplitude(:)
      !> Contact at the points in potential contact; its driver is [modal; amplitude]
      type(contact_state_t) :: contact
   end type operating_state_t

contains

   !> The undeformed structure: no load, and no contact force but that of an initial pressure.
   function undeformed_state(system) result(state)
      type(jointed_system_t), intent(in) :: system
      type(operating_state_t) :: state

      allocate (state%modal(system%n_modes), source=0.0_wp)
      state%amplitude = system%held
      state%contact = new_state(system%problem, system%initial_force())
      state%contact%q = [state%modal, state%amplitude]
   end function undeformed_state

end module microslip_analysis_operating_state
