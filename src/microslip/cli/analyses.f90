!> The analyses of a case, in the order asked for: the one place that knows them by name, and the place to add one.
module microslip_cli_analyses
   use microslip_analysis_operating_state, only: undeformed_state
   use microslip_cli_periodic_analyses, only: harmonic_balance, epmc
   use microslip_cli_restart, only: keep_run
   use microslip_cli_run, only: run_t
   use microslip_cli_static_analyses, only: preload, linear_modes, qsma
   use microslip_cli_time_analyses, only: transient, settling, ringdown
   use microslip_core_error, only: error_t
   use microslip_core_interruption, only: hold_signals, release_signals, stop_requested
   implicit none(type, external)
   private

   public :: analyse

contains

   !> The analyses in the order asked for, but those that an interrupted run has finished.
   subroutine analyse(run, error)
      type(run_t), intent(inout), target :: run
      type(error_t), allocatable, intent(out) :: error
      integer :: k

      if (.not. allocated(run%checkpoint%run)) then
         ! Without a preload analyses start from the undeformed structure.
         run%state = undeformed_state(run%system)
         call keep_run(run, 0, error)
         if (allocated(error)) return
      end if
      do k = run%checkpoint%analyses + 1, size(run%case%analyses)
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
         ! A signal does not come between the results and their place.
         call hold_signals()
         if (.not. allocated(error) .and. k < size(run%case%analyses)) call keep_run(run, k, error)
         call release_signals()
         if (.not. allocated(error) .and. k < size(run%case%analyses)) call stop_requested(error)
         if (allocated(error)) return
      end do
   end subroutine analyse

end module microslip_cli_analyses
