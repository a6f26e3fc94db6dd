!> The analyses of a case, in the order asked for: the one place that knows them by name, and the place to add one.
module microslip_cli_analyses
   use microslip_analysis_operating_state, only: undeformed_state
   use microslip_cli_periodic_analyses, only: harmonic_balance, epmc
   use microslip_cli_run, only: run_t
   use microslip_cli_static_analyses, only: preload, linear_modes, qsma
   use microslip_cli_time_analyses, only: transient, settling, ringdown
   use microslip_core_error, only: error_t
   implicit none(type, external)
   private

   public :: analyse

contains

   !> The analyses in the order asked for.
   subroutine analyse(run, error)
      type(run_t), intent(inout) :: run
      type(error_t), allocatable, intent(out) :: error
      integer :: k

      ! Without a preload analyses start from the undeformed structure.
      run%state = undeformed_state(run%system)
      do k = 1, size(run%case%analyses)
         select case (trim(run%case%analyses(k)))
         case ('preload'); call preload(run, error)
         case ('linear_modes'); call linear_modes(run, error)
         case ('transient'); call transient(run, error)
         case ('qsma'); call qsma(run, error)
         case ('ringdown'); call ringdown(run, error)
         case ('harmonic_balance'); call harmonic_balance(run, error)
         case ('epmc'); call epmc(run, error)
         case ('settling'); call settling(run, error)
         end select
         if (allocated(error)) return
      end do
   end subroutine analyse

end module microslip_cli_analyses
