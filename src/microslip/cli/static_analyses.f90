!> Analyses without time: preload, linear modes about it, quasi-static modal analysis.
module microslip_cli_static_analyses
   use microslip_analysis_preload, only: preload_options_t, preload_record_t, run_preload
   use microslip_analysis_qsma, only: loops_always, loops_never, modal_parameters_t, qsma_options_t, qsma_record_t, run_qsma, &
      & spaced_amplitudes
   use microslip_analysis_slip_size, only: slip_in_cells
   use microslip_cli_log, only: listed
   use microslip_cli_result_checks, only: check_masing, check_preload, check_slip
   use microslip_cli_run, only: run_t, contact_options, preload_options, write_system, find_modes, settle_damping, &
      & shape_of_mode
   use microslip_cli_surface_input, only: check_closed_points
   use microslip_core_error, only: error_t, failure
   use microslip_core_interruption, only: hold_signals, release_signals
   use microslip_core_kinds, only: wp
   use microslip_core_text, only: to_text
   use microslip_io_modal_results, only: qsma_results_t, write_qsma
   implicit none(type, external)
   private

   public :: preload, linear_modes, qsma

contains

   !> Static equilibrium under the preload; points left out that would close join, and it is run again.
   subroutine preload(run, error)
      type(run_t), intent(inout) :: run
      type(error_t), allocatable, intent(out) :: error
      type(preload_options_t) :: options
      type(preload_record_t) :: record
      integer :: added, round, k, first, last

      do round = 1, 20
         call run_preload(run%system, preload_options(run), contact_options(run), run%state, record, error)
         if (allocated(error)) return
         call run%system%widen_where_closed(run%state%modal, run%state%contact%force, run%state%amplitude, added, error)
         if (allocated(error)) return
         if (added == 0) exit
         if (run%log%verbose) call run%log%line('preload: '//to_text(added)//' points left out would close: taken in, run again')
      end do
      if (added > 0) then
         call failure(error, 'preload: the set of points in potential contact does not settle')
         return
      end if
      call run%clock%stop('preload')
      call run%log%line('preload: interface forces'//listed(record%interface_force)//' N (deviation ' &
         & //to_text(record%force_deviation, 2)//'), '//to_text(count(run%state%contact%status > 0))//' points closed, ' &
         & //to_text(record%solves)//' solves, '//to_text(record%iterations)//' iterations, residual ' &
         & //to_text(record%residual, 2)//', error estimate '//to_text(record%error_estimate, 2))
      call check_pressure(run, record, error)
      if (allocated(error)) return
      options = preload_options(run)
      call check_preload(run%system, run%state, run%scene%load_names(options%loads), run%state%amplitude(options%loads), &
         & run%system%imposed(options%loads), allocated(options%interface_force), run%warnings)
      call check_slip('preload', slip_in_cells(run%system, run%state%contact), run%warnings)
      do k = 1, size(run%system%pads)
         associate (pad => run%system%pads(k))
            first = pad%point_offset + 1
            last = pad%point_offset + size(pad%potential)
            call check_closed_points(run%scene%surfaces(k), pad%potential, run%state%contact%status(first:last) > 0, &
               & run%state%contact%force(1, first:last), run%warnings)
         end associate
      end do
      if (round > 1) call write_system(run, error)
      if (.not. allocated(error)) call run%results%write_preload(run%system, run%state, record, run%scene%load_names, error)
      call run%clock%stop('write')
   end subroutine preload

   !> No body carries a mean pressure beyond its Young's modulus.
   subroutine check_pressure(run, record, error)
      type(run_t), intent(in) :: run
      type(preload_record_t), intent(in) :: record
      type(error_t), allocatable, intent(out) :: error
      real(wp) :: pressure
      integer :: k

      do k = 1, size(run%system%pads)
         if (.not. allocated(run%case%interfaces(k)%young_modulus)) cycle
         pressure = record%interface_force(k)/sum(run%system%pads(k)%grid%area)
         if (pressure <= minval(run%case%interfaces(k)%young_modulus)) cycle
         call failure(error, "preload: interface '"//trim(run%case%interfaces(k)%name)//"' would carry a mean pressure of " &
            & //to_text(pressure, 3)//" Pa, more than Young's modulus: are the loads right?")
         return
      end do
   end subroutine check_pressure

   !> Linear modes about the present state.
   subroutine linear_modes(run, error)
      type(run_t), intent(inout) :: run
      type(error_t), allocatable, intent(out) :: error

      call find_modes(run, error)
      if (.not. allocated(error)) call run%results%write_linear_modes(run%modes, error)
   end subroutine linear_modes

   !> Quasi-static modal analysis.
   subroutine qsma(run, error)
      type(run_t), intent(inout), target :: run
      type(error_t), allocatable, intent(out) :: error
      type(qsma_options_t) :: options
      type(qsma_record_t) :: record
      type(qsma_results_t) :: recorder

      options = qsma_options(run)
      call shape_of_mode(run, 'qsma', run%case%qsma%mode, options%phi, error)
      if (.not. allocated(error)) call settle_damping(run, error)
      if (allocated(error)) return
      options%frequency = run%modes%frequency(run%case%qsma%mode)
      recorder%results => run%results
      call hold_signals()
      call run_qsma(run%system, run%state, options, contact_options(run), record, error, recorder)
      call release_signals()
      call run%clock%stop('qsma')
      if (allocated(error)) return
      call report_modes(run, record)
      call check_masing(record, options%loops == loops_never, run%warnings)
      call check_slip('qsma', record%largest_slip, run%warnings)
      call run%log%line('qsma: '//to_text(record%iterations)//' iterations ('//to_text(record%points_added) &
         & //' points taken in), largest residual '//to_text(record%residual, 2)//', error estimate ' &
         & //to_text(record%error_estimate, 2))
      call write_qsma(run%results%file, record, error)
      if (.not. allocated(error) .and. record%points_added > 0) call write_system(run, error)
      call run%clock%stop('write')
      if (.not. allocated(error) .and. record%unconverged > 0) call failure(error, 'qsma: '// &
         & to_text(record%unconverged)//' load steps did not converge')
   end subroutine qsma

   !> Frequency and damping over amplitude in the log, with the largest damping.
   subroutine report_modes(run, record)
      type(run_t), intent(in) :: run
      type(qsma_record_t), intent(in) :: record
      type(modal_parameters_t) :: modes(size(record%combined))
      integer :: last, peak

      modes = record%modes()
      last = size(modes)
      peak = maxloc(modes%damping_ratio, dim=1)
      call run%log%line('qsma: '//to_text(last)//' amplitudes, '//to_text(1.0e6_wp*modes(1)%amplitude, 3)//' to ' &
         & //to_text(1.0e6_wp*modes(last)%amplitude, 4)//' um; frequency '//to_text(modes(1)%frequency, 6)//' to ' &
         & //to_text(modes(last)%frequency, 6)//' Hz; damping ratio '//to_text(modes(1)%damping_ratio, 3)//' to ' &
         & //to_text(modes(last)%damping_ratio, 3)//', largest '//to_text(modes(peak)%damping_ratio, 3)//' at ' &
         & //to_text(1.0e6_wp*modes(peak)%amplitude, 4)//' um ('//trim(merge('hysteresis loops', "Masing's rule   ", &
         & allocated(record%loop)))//')')
   end subroutine report_modes

   !> Options of the quasi-static modal analysis, but for the mode.
   function qsma_options(run) result(options)
      type(run_t), intent(in) :: run
      type(qsma_options_t) :: options
      real(wp) :: smallest

      associate (record => run%case%qsma)
         if (allocated(record%amplitudes)) then
            options%amplitude = record%amplitudes
         else
            smallest = record%largest_amplitude/merge(100, record%levels, record%spacing == 'log')
            if (allocated(record%smallest_amplitude)) smallest = record%smallest_amplitude
            options%amplitude = spaced_amplitudes(smallest, record%largest_amplitude, record%levels, record%spacing == 'log')
         end if
         options%sensors = run%case%find_sensors(record%sensor)
         options%steps = record%steps
         if (allocated(record%cycle)) options%loops = merge(loops_always, loops_never, record%cycle)
         options%cycle_steps = record%cycle_steps
      end associate
   end function qsma_options

end module microslip_cli_static_analyses
