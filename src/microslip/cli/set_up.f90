!> From the scene to the system that the analyses see: reduction, potential contact set, contact matrices.
module microslip_cli_set_up
   use microslip_analysis_potential_set, only: choose_potential_set
   use microslip_cli_coupling_report, only: report_estimate
   use microslip_cli_reduction_report, only: report_reduction
   use microslip_cli_restart, only: take_run_back
   use microslip_cli_result_checks, only: check_coupling
   use microslip_cli_run, only: run_t, preload_options, write_system, damping
   use microslip_cli_scene, only: add_motions, contact_interfaces
   use microslip_cli_demand, only: uses_fft
   use microslip_core_error, only: error_t, bad_input
   use microslip_core_kinds, only: wp
   use microslip_core_text, only: to_text
   use microslip_fe_interface, only: contact_interface_t
   use microslip_fe_reduction, only: reduction_options_t, reduce
   use microslip_io_coupling_results, only: write_couplings
   use microslip_io_reduction_cache, only: reduction_digest, read_cache, write_cache
   use microslip_system_compliance_choice, only: compliance_fft, compliance_named, why_form
   use microslip_system_coupling_error, only: coupling_error_t, estimate_coupling_error
   use microslip_system_jointed_system, only: new_system
   implicit none(type, external)
   private

   public :: reduce_model, build_system

contains

   !> The reduced model, from the cache where it fits.
   subroutine reduce_model(run, error)
      type(run_t), intent(inout) :: run
      type(error_t), allocatable, intent(out) :: error
      type(reduction_options_t) :: options
      character(len=16) :: digest
      type(contact_interface_t), allocatable :: interfaces(:)
      character(len=:), allocatable :: cache
      logical :: found

      options%method = trim(run%case%reduction%method)
      if (allocated(run%case%reduction%n_modes)) options%modes = run%case%reduction%n_modes
      if (allocated(run%case%reduction%cutoff_frequency)) options%cutoff_frequency = run%case%reduction%cutoff_frequency
      options%residual_mass = run%case%reduction%residual_mass == 'kept'
      found = .false.
      interfaces = contact_interfaces(run%scene)
      if (run%case%reduction%cache /= '') then
         cache = run%case%located(run%case%reduction%cache)
         digest = reduction_digest(run%scene%model, interfaces, run%scene%patterns, options)
         call read_cache(cache, digest, run%reduced, found, run%warnings)
      end if
      if (found) then
         call run%log%line('reduction: taken from '//cache//' (digest '//digest//')')
      else
         call reduce(run%scene%model, interfaces, run%scene%patterns, options, run%reduced, error)
         if (allocated(error)) return
         if (allocated(cache)) call write_cache(cache, digest, run%reduced, run%warnings)
      end if
      call run%clock%stop('reduction')
      call report_reduction(run%log, run%scene%model%row_count(), run%reduced, run%warnings)
      if (allocated(run%case%damping%ratio) .and. run%case%damping%reference == 'tied' .and. &
         & run%case%damping%reference_mode > run%reduced%tied_modes) call bad_input(error, &
         & '&damping reference_mode = '//to_text(run%case%damping%reference_mode)//': &reduction keeps '// &
         & to_text(run%reduced%tied_modes)//' modes; allowed is one of them')
   end subroutine reduce_model

   !> The system on its potential contact set; that of an interrupted run is as it was.
   subroutine build_system(run, error)
      type(run_t), intent(inout) :: run
      type(error_t), allocatable, intent(out) :: error
      real(wp), allocatable :: margin(:)
      type(coupling_error_t), allocatable :: estimates(:)
      logical, allocatable :: everything(:)
      integer :: k

      call new_system(run%reduced, run%scene%pads, run%scene%n_pattern_loads, damping(run), run%system, error)
      if (allocated(error)) return
      call try_couplings(run, estimates, error)
      if (allocated(error)) return
      call add_motions(run%case, run%system)
      run%system%compliance = compliance_named(run%case%contact%compliance, run%case%contact%solver, &
         & all(run%system%pads%half_space))
      ! The search for the points in potential contact is not to begin with matrices that will not do in the end.
      if (uses_fft(run%case, run%scene)) run%system%compliance = compliance_fft
      everything = run%case%interfaces%potential == 'all'
      if (allocated(run%checkpoint%run)) then
         call take_run_back(run, error)
      else if (all(everything) .or. .not. run%case%runs('preload')) then
         call run%system%restrict(spread(.true., 1, run%system%grid_point_count()), error)
      else
         allocate (margin(size(everything)), source=-1.0_wp)
         do k = 1, size(margin)
            if (allocated(run%case%interfaces(k)%potential_margin)) margin(k) = run%case%interfaces(k)%potential_margin
         end do
         call choose_potential_set(run%system, preload_options(run), everything, margin, error)
      end if
      if (allocated(error)) return
      call run%clock%stop('contact matrices')
      call run%log%line('contact: '//to_text(run%system%problem%n_points)//' of ' &
         & //to_text(run%system%grid_point_count())//' grid points in potential contact; compliance: ' &
         & //why_form(allocated(run%system%problem%compliance), 3.0_wp*run%system%problem%n_points))
      if (.not. allocated(run%checkpoint%run)) then
         call write_system(run, error)
         if (.not. allocated(error)) call write_couplings(run%results%file, run%system%pads, run%scene%meshes, estimates, error)
      end if
      call run%clock%stop('write')
   end subroutine build_system

   !> The scale-split coupling's estimates of its own error.
   subroutine try_couplings(run, estimates, error)
      type(run_t), intent(inout) :: run
      !> (pads)
      type(coupling_error_t), allocatable, intent(out) :: estimates(:)
      type(error_t), allocatable, intent(out) :: error
      integer :: k

      allocate (estimates(size(run%system%pads)))
      do k = 1, size(estimates)
         if (.not. allocated(run%system%pads(k)%filter)) cycle
         call estimate_coupling_error(run%system, k, run%scene%meshes(k)%spacing, estimates(k), error)
         if (allocated(error)) return
         call report_estimate(run%log, run%system%pads(k), estimates(k))
         call check_coupling(run%system%pads(k), estimates(k), run%warnings)
      end do
   end subroutine try_couplings

end module microslip_cli_set_up
