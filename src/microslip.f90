!> microslip: vibration and friction damping of bolted structures with resolved contact topography.
!> The facade: re-exports what users of the library need.
module microslip
   use microslip_core_error, only: error_t
   use microslip_core_kinds, only: wp
   implicit none(type, external)
   public
end module microslip
