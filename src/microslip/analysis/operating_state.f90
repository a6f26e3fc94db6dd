!> The state that one analysis hands to the next: a static equilibrium with its contact.
module microslip_analysis_operating_state
   use microslip_contact_problem, only: contact_state_t
   use microslip_core_kinds, only: wp
   implicit none(type, external)
   private

   public :: operating_state_t

   type :: operating_state_t
      !> (modes) modal coordinates
      real(wp), allocatable :: modal(:)
      !> (loads) amplitudes of the load patterns that stay on
      real(wp), allocatable :: amplitude(:)
      !> Contact at the points in potential contact; its driver is [modal; amplitude]
      type(contact_state_t) :: contact
   end type operating_state_t

end module microslip_analysis_operating_state
