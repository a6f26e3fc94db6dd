!> Analyses by time integration: transient, settling, and the modal parameters of a ring-down.
module microslip_cli_time_analyses
   use microslip_analysis_excitation, only: end_of_all
   use microslip_analysis_potential_set, only: potential_points, carry_over
   use microslip_analysis_ringdown, only: decay_t, ringdown_options_t, ringdown_t, identify_ringdown
   use microslip_analysis_settling, only: settling_options_t, settling_record_t, run_settling
   use microslip_analysis_transient, only: transient_options_t, transient_record_t, run_transient
   use microslip_cli_log, only: listed
   use microslip_cli_motion_input, only: excitations_of, meter_of
   use microslip_cli_result_checks, only: check_energy, check_slip
   use microslip_cli_run, only: run_t, contact_options, write_system, sensor_names, settle_damping, add_modal_loads, &
      & shape_of_mode
   use microslip_core_error, only: error_t, failure
   use microslip_core_kinds, only: wp
   use microslip_core_text, only: to_text
   use microslip_io_decay_series, only: read_decay
   use microslip_io_modal_results, only: write_ringdown
   use microslip_io_settling_results, only: write_settling
   use microslip_io_transient_results, only: transient_results_t
   implicit none(type, external)
   private

   public :: transient, settling, ringdown

contains

   !> Time integration.
   subroutine transient(run, error)
      type(run_t), intent(inout), target :: run
      type(error_t), allocatable, intent(out) :: error
      type(transient_options_t) :: options
      type(transient_results_t) :: recorder
      type(transient_record_t) :: record
      type(error_t), allocatable :: ignored
      logical, allocatable :: before(:)
      integer, allocatable :: point(:)

      call add_modal_loads(run, error)
      if (.not. allocated(error)) call settle_damping(run, error)
      if (allocated(error)) return
      options = transient_options(run)
      call move_alloc(run%checkpoint%point, point)
      call recorder%create(run%results, run%system, sensor_names(run), error, resuming=allocated(point))
      if (allocated(error)) return
      call recorder%line%start('transient', merge(options%duration, end_of_all(options%excitations), &
         & options%duration > 0.0_wp), run%log%quiet)
      before = potential_points(run%system)
      call run_transient(run%system, run%state, options, contact_options(run), recorder, run%clock, record, error, point)
      call run%clock%stop(merge('transient', 'write    ', allocated(error)))
      call recorder%write_summary(record, ignored)
      call recorder%close(ignored)
      if (record%points_added > 0) call carry_over(run%system, before, run%state%contact)
      if (record%points_added > 0 .and. .not. allocated(ignored)) call write_system(run, ignored)
      call run%clock%stop('write')
      call run%log%line('transient: '//to_text(record%steps)//' steps of '//to_text(options%time_step)//' s, ' &
         & //to_text(record%iterations)//' iterations ('//to_text(record%rescues)//' rescues, '//to_text(record%set_changes) &
         & //' set changes, '//to_text(record%points_added)//' points taken in), largest residual ' &
         & //to_text(record%residual, 2)//', error estimate '//to_text(record%error_estimate, 2)//', energy balance error ' &
         & //to_text(record%balance_error, 2)//' of the largest kinetic energy')
      call check_energy('transient', record%unaccounted_energy, run%warnings)
      call check_slip('transient', record%largest_slip, run%warnings)
      if (allocated(error)) return
      if (allocated(ignored)) call move_alloc(ignored, error)
      if (record%unconverged > 0) call failure(error, 'transient: '//to_text(record%unconverged)//' of ' &
         & //to_text(record%steps)//' steps did not converge')
   end subroutine transient

   !> Options of the time integration.
   function transient_options(run) result(options)
      type(run_t), intent(in) :: run
      type(transient_options_t) :: options

      associate (record => run%case%transient)
         options%duration = record%duration
         options%time_step = record%safety/run%system%highest_angular_frequency()
         if (allocated(record%time_step)) options%time_step = record%time_step
      end associate
      options%stride = run%case%output%stride
      options%restart_stride = run%case%output%checkpoint_steps
      if (allocated(run%case%output%snapshots)) options%snapshots = run%case%output%snapshots
      options%excitations = excitations_of(run%case, run%scene)
      options%meter = meter_of(run%case)
   end function transient_options

   !> Impact sequence; the state becomes the equilibrium that it ends in.
   subroutine settling(run, error)
      type(run_t), intent(inout), target :: run
      type(error_t), allocatable, intent(out) :: error
      type(settling_options_t) :: options
      type(settling_record_t) :: record
      type(transient_results_t) :: series
      type(error_t), allocatable :: ignored
      real(wp), allocatable :: phi(:)
      integer, allocatable :: point(:)

      call add_modal_loads(run, error)
      if (.not. allocated(error)) call settle_damping(run, error)
      if (.not. allocated(error)) call shape_of_mode(run, 'settling', run%case%settling%mode, phi, error)
      call move_alloc(run%checkpoint%point, point)
      if (.not. allocated(error)) call series%create(run%results, run%system, sensor_names(run), error, '/settling', &
         & allocated(point))
      if (allocated(error)) return
      options = settling_options(run)
      call series%line%start('settling', size(options%amplitude)*options%interval, run%log%quiet)
      call run_settling(run%system, run%state, options, contact_options(run), series, run%clock, record, error, point)
      call run%clock%stop('settling')
      call series%write_summary(record%transient, ignored)
      call series%close(ignored)
      if (record%transient%points_added > 0 .and. .not. allocated(ignored)) call write_system(run, ignored)
      if (allocated(error)) return
      if (allocated(ignored)) call move_alloc(ignored, error)
      associate (last => ubound(record%after, 1))
         call run%log%line('settling: '//to_text(last)//' impacts, '//to_text(record%transient%steps)//' steps; static ' &
            & //'position shifted, um:'//listed(1.0e6_wp*(record%after(last)%sensor - record%after(0)%sensor)) &
            & //'; energy balance error '//to_text(record%transient%balance_error, 2)//' of the largest kinetic energy')
      end associate
      call check_energy('settling', record%transient%unaccounted_energy, run%warnings)
      call check_slip('settling', record%transient%largest_slip, run%warnings)
      if (.not. allocated(error)) call write_settling(run%results%file, run%system, options%amplitude, record, run%state, error)
      if (.not. allocated(error) .and. run%case%settling%ringdown) call identify_decays(run, options, phi, error)
      call run%clock%stop('write')
   end subroutine settling

   !> Options of the impact sequence.
   function settling_options(run) result(options)
      type(run_t), intent(in) :: run
      type(settling_options_t) :: options

      associate (record => run%case%settling)
         options%load = run%scene%load_index(run%case%find_load(record%load))
         options%amplitude = record%amplitude
         if (size(record%amplitude) == 1) options%amplitude = spread(record%amplitude(1), 1, record%impacts)
         options%duration = record%duration
         options%interval = record%interval
         options%period = 1.0_wp/run%modes%frequency(record%mode)
         options%periods = record%periods
         options%time_step = record%safety/run%system%highest_angular_frequency()
         if (allocated(record%time_step)) options%time_step = record%time_step
         options%stride = run%case%output%stride
         options%restart_stride = run%case%output%checkpoint_steps
      end associate
   end function settling_options

   !> Modal parameters from the free decay after every impact.
   subroutine identify_decays(run, options, phi, error)
      type(run_t), intent(in) :: run
      type(settling_options_t), intent(in) :: options
      !> (modes) shape of the mode
      real(wp), intent(in) :: phi(:)
      type(error_t), allocatable, intent(out) :: error
      type(decay_t) :: decay
      type(ringdown_t) :: found
      integer :: k

      do k = 1, size(options%amplitude)
         call read_decay(run%results%file, '/settling', decay, error, phi, &
            & [(k - 1)*options%interval + options%duration, k*options%interval])
         if (allocated(error)) return
         call identify_ringdown(decay, ringdown_options_t(frequency=1.0_wp/options%period, &
            & sensors=run%case%find_sensors('')), found, error)
         if (.not. allocated(error)) call write_ringdown(run%results%file, found, error, '/settling/ringdown_'//to_text(k))
         if (allocated(error)) then
            error%message = 'settling, impact '//to_text(k)//': '//error%message
            return
         end if
         call run%log%line('settling: impact '//to_text(k)//': amplitude '//to_text(1.0e6_wp*found%amplitude(1), 4)//' um, ' &
            & //'frequency '//to_text(found%frequency(1), 6)//' to '//to_text(found%frequency(size(found%time)), 6) &
            & //' Hz, damping ratio '//to_text(found%damping_ratio(1), 3)//' to ' &
            & //to_text(found%damping_ratio(size(found%time)), 3))
      end do
   end subroutine identify_decays

   !> Modal parameters from the free decay that the time integration left.
   subroutine ringdown(run, error)
      type(run_t), intent(inout) :: run
      type(error_t), allocatable, intent(out) :: error
      type(ringdown_options_t) :: options
      type(ringdown_t) :: found
      type(decay_t) :: decay
      real(wp), allocatable :: phi(:)

      associate (record => run%case%ringdown)
         options%periods = record%periods
         options%overlap = record%overlap
         options%sensors = run%case%find_sensors(record%sensor)
         options%start = end_of_all(excitations_of(run%case, run%scene))
         if (allocated(record%start)) options%start = record%start
         if (allocated(record%mode)) options%frequency = run%modes%frequency(record%mode)
      end associate
      if (allocated(run%case%ringdown%mode)) call shape_of_mode(run, 'ringdown', run%case%ringdown%mode, phi, error)
      if (.not. allocated(error)) call read_decay(run%results%file, '/transient', decay, error, phi)
      if (.not. allocated(error)) call identify_ringdown(decay, options, found, error)
      call run%clock%stop('ringdown')
      if (allocated(error)) return
      associate (last => size(found%time))
         call run%log%line('ringdown: '//to_text(last)//' windows of '//to_text(found%window, 3)//' s; amplitude ' &
            & //to_text(1.0e6_wp*found%amplitude(1), 4)//' to '//to_text(1.0e6_wp*found%amplitude(last), 4)//' um, frequency ' &
            & //to_text(found%frequency(1), 6)//' to '//to_text(found%frequency(last), 6)//' Hz, damping ratio ' &
            & //to_text(found%damping_ratio(1), 3)//' to '//to_text(found%damping_ratio(last), 3))
      end associate
      call write_ringdown(run%results%file, found, error)
      call run%clock%stop('write')
   end subroutine ringdown

end module microslip_cli_time_analyses
