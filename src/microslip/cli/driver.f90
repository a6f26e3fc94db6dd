!> Runs the cases of a command line: reads, builds, analyses in the order asked for, writes.
module microslip_cli_driver
   use microslip_analysis_decay_recorder, only: decay_recorder_t
   use microslip_analysis_continuation, only: curve_record_t
   use microslip_analysis_epmc, only: epmc_options_t, run_epmc
   use microslip_analysis_excitation, only: end_of_all, excitation_t, kind_half_sine, kind_harmonic
   use microslip_analysis_harmonic_balance, only: harmonic_balance_options_t, run_harmonic_balance
   use microslip_analysis_linear_modes, only: linear_modes_t, solve_linear_modes
   use microslip_analysis_operating_state, only: operating_state_t, undeformed_state
   use microslip_analysis_potential_set, only: choose_potential_set, potential_points, carry_over
   use microslip_analysis_preload, only: preload_options_t, preload_record_t, run_preload
   use microslip_analysis_qsma, only: qsma_options_t, qsma_record_t, run_qsma, spaced_amplitudes
   use microslip_analysis_ringdown, only: decay_t, ringdown_options_t, ringdown_t, identify_ringdown
   use microslip_analysis_settling, only: settling_options_t, settling_record_t, run_settling
   use microslip_analysis_transient, only: transient_options_t, transient_record_t, run_transient
   use microslip_cli_command_line, only: command_line_t
   use microslip_cli_log, only: log_t
   use microslip_cli_motion_input, only: excitations_of, meter_of
   use microslip_cli_scene, only: scene_t, add_motions, build_scene, read_model
   use microslip_cli_scene_report, only: report_scene, expected_unknowns
   use microslip_contact_factory, only: contact_options_t
   use microslip_core_error, only: error_t, failure
   use microslip_core_kinds, only: wp, pi
   use microslip_core_stopwatch, only: stopwatch_t
   use microslip_core_text, only: to_text
   use microslip_core_version, only: program_version
   use microslip_fe_model, only: fe_model_t
   use microslip_fe_reduced_model, only: reduced_model_t
   use microslip_fe_reduction, only: reduction_options_t, reduce
   use microslip_io_case, only: case_t
   use microslip_io_case_file, only: read_case, resolved_text
   use microslip_io_modal_results, only: write_qsma, write_ringdown
   use microslip_io_model_file, only: write_model_hdf5
   use microslip_io_reduction_cache, only: reduction_digest, read_cache, write_cache
   use microslip_io_response_results, only: response_results_t
   use microslip_io_results, only: results_t
   use microslip_io_settling_results, only: write_settling
   use microslip_io_transient_results, only: transient_results_t
   use microslip_system_compliance_choice, only: compliance_fft, compliance_named, takes_fft, why_form
   use microslip_system_jointed_system, only: jointed_system_t, new_system
   implicit none(type, external)
   private

   public :: run_cases

   !> A case on its way through the analyses.
   type :: run_t
      type(case_t) :: case
      type(scene_t) :: scene
      type(reduced_model_t) :: reduced
      type(jointed_system_t) :: system
      type(operating_state_t) :: state
      type(linear_modes_t) :: modes
      !> What the time integration leaves for the identification of the ring-down
      type(decay_t) :: decay
      type(results_t) :: results
      type(stopwatch_t) :: clock
      type(log_t) :: log
   end type run_t

contains

   !> Run all cases; a case that fails does not keep the others from running.
   subroutine run_cases(line, error)
      type(command_line_t), intent(in) :: line
      !> All failures, with the highest exit status
      type(error_t), allocatable, intent(out) :: error
      type(error_t), allocatable :: one
      character(len=:), allocatable :: command
      integer :: k, length

      call get_command(length=length)
      allocate (character(len=length) :: command)
      call get_command(command)
      if (line%threads > 0) call set_threads(line%threads)
      do k = 1, size(line%cases)
         call run_case(line%cases(k)%text, line, command, one)
         if (.not. allocated(one)) cycle
         if (allocated(error)) then
            error%message = error%message//new_line('a')//one%message
            error%status = max(error%status, one%status)
         else
            call move_alloc(one, error)
         end if
      end do
   end subroutine run_cases

   !> Number of threads of OpenMP and of the BLAS.
   subroutine set_threads(n)
      use omp_lib, only: omp_set_num_threads
      integer, intent(in) :: n
      interface
         subroutine openblas_set_num_threads(n) bind(c)
            use, intrinsic :: iso_c_binding, only: c_int
            implicit none
            integer(c_int), value :: n
         end subroutine openblas_set_num_threads
      end interface
      call omp_set_num_threads(n)
      call openblas_set_num_threads(n)
   end subroutine set_threads

   !> Run one case file.
   subroutine run_case(path, line, command, error)
      !> The case file
      character(len=*), intent(in) :: path
      !> Options
      type(command_line_t), intent(in) :: line
      !> The command line as text, for the record
      character(len=*), intent(in) :: command
      type(error_t), allocatable, intent(out) :: error
      type(run_t) :: run
      type(fe_model_t) :: model

      run%log = log_t(quiet=line%quiet, verbose=line%verbose)
      call run%clock%start()
      call read_case(path, run%case, error)
      if (allocated(error)) return
      call run%log%title('microslip '//program_version//': '//trim(run%case%title)//' ('//path//')')
      if (allocated(line%write_model)) then
         call read_model(run%case, model, error)
         if (.not. allocated(error)) call write_model_hdf5(line%write_model, model, error)
         if (.not. allocated(error)) call run%log%line('FE model written to '//line%write_model)
         return
      end if
      call build_scene(run%case, run%scene, error)
      if (allocated(error)) return
      call run%clock%stop('read')
      if (line%check .or. line%verbose) call report_scene(run%log, run%case, run%scene)
      if (line%check) return
      call compute(run, line, command, error)
   end subroutine run_case

   !> Everything after the input is known to be right.
   subroutine compute(run, line, command, error)
      type(run_t), intent(inout) :: run
      type(command_line_t), intent(in) :: line
      character(len=*), intent(in) :: command
      type(error_t), allocatable, intent(out) :: error
      type(error_t), allocatable :: ignored

      call reduce_model(run, error)
      if (allocated(error)) return
      call run%results%create(output_path(run%case, line), error)
      if (allocated(error)) return
      call run%results%write_provenance(program_version, commit(), command, thread_count(), error)
      if (.not. allocated(error)) call run%results%write_setup(run%case%text, resolved_text(run%case), error)
      if (.not. allocated(error)) call build_system(run, error)
      if (.not. allocated(error)) call analyse(run, line, error)
      call run%results%write_timing(run%clock%stage, run%clock%seconds, run%clock%count, ignored)
      call run%results%close(ignored)
      call run%log%timing(run%clock)
      if (.not. allocated(error) .and. allocated(ignored)) call move_alloc(ignored, error)
      if (.not. allocated(error)) call run%log%line('results in '//output_path(run%case, line))
   end subroutine compute

   !> Where the results go.
   function output_path(case, line) result(path)
      type(case_t), intent(in) :: case
      type(command_line_t), intent(in) :: line
      character(len=:), allocatable :: path
      integer :: dot

      if (allocated(line%output)) then
         path = line%output
      else if (case%output%file /= '') then
         path = trim(case%output%file)
      else
         path = case%path(index(case%path, '/', back=.true.) + 1:)
         dot = index(path, '.', back=.true.)
         if (dot > 1) path = path(:dot - 1)
         path = path//'.h5'
      end if
   end function output_path

   !> The commit the program was built from, if the environment tells it.
   function commit() result(text)
      character(len=:), allocatable :: text
      integer :: length, status

      call get_environment_variable('MICROSLIP_COMMIT', length=length, status=status)
      if (status /= 0 .or. length == 0) then
         text = 'unknown'
      else
         allocate (character(len=length) :: text)
         call get_environment_variable('MICROSLIP_COMMIT', text)
      end if
   end function commit

   !> Threads that OpenMP will use.
   integer function thread_count()
      use omp_lib, only: omp_get_max_threads
      thread_count = omp_get_max_threads()
   end function thread_count

   !> The reduced model, from the cache where it fits.
   subroutine reduce_model(run, error)
      type(run_t), intent(inout) :: run
      type(error_t), allocatable, intent(out) :: error
      type(reduction_options_t) :: options
      character(len=16) :: digest
      character(len=:), allocatable :: cache
      logical :: found
      integer :: k

      options%method = trim(run%case%reduction%method)
      if (allocated(run%case%reduction%n_modes)) options%modes = run%case%reduction%n_modes
      if (allocated(run%case%reduction%cutoff_frequency)) options%cutoff_frequency = run%case%reduction%cutoff_frequency
      found = .false.
      associate (interfaces => [(run%scene%pads(k)%contact, k=1, size(run%scene%pads))])
         if (run%case%reduction%cache /= '') then
            cache = run%case%located(run%case%reduction%cache)
            digest = reduction_digest(run%scene%model, interfaces, run%scene%patterns, options)
            call read_cache(cache, digest, run%reduced, found)
         end if
         if (found) then
            call run%log%line('reduction: taken from '//cache//' (digest '//digest//')')
         else
            call reduce(run%scene%model, interfaces, run%scene%patterns, options, run%reduced, error)
            if (allocated(error)) return
            if (allocated(cache)) call write_cache(cache, digest, run%reduced, error)
            if (allocated(error)) return
         end if
      end associate
      call run%clock%stop('reduction')
      call run%log%line('reduction: '//to_text(run%scene%model%row_count())//' rows to ' &
         & //to_text(size(run%reduced%frequency))//' modes (to '//to_text(maxval(run%reduced%frequency))//' Hz) and ' &
         & //to_text(size(run%reduced%K_bb, 1))//' boundary coordinates; residual of the modes ' &
         & //to_text(run%reduced%record%residual, 2))
      call run%log%detail('tied frequencies, Hz:', run%reduced%frequency)
   end subroutine reduce_model

   !> The system on its potential contact set.
   subroutine build_system(run, error)
      type(run_t), intent(inout) :: run
      type(error_t), allocatable, intent(out) :: error
      real(wp), allocatable :: margin(:)
      logical, allocatable :: everything(:)
      integer :: k

      call new_system(run%reduced, run%scene%pads, run%scene%n_pattern_loads, damping(run), run%system, error)
      if (allocated(error)) return
      call add_motions(run%case, run%system)
      run%system%compliance = compliance_named(run%case%contact%compliance, run%case%contact%solver, &
         & all(run%system%pads%half_space))
      ! The search for the points in potential contact is not to begin with matrices that will not do in the end.
      if (takes_fft(run%system%compliance, nint(expected_unknowns(run%case, run%scene)))) run%system%compliance = compliance_fft
      everything = run%case%interfaces%potential == 'all'
      if (all(everything) .or. .not. run%case%runs('preload')) then
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
         & //why_form(allocated(run%system%problem%compliance), 3*run%system%problem%n_points))
      call write_system(run, error)
      call run%clock%stop('write')
   end subroutine build_system

   !> Sizes and interfaces into the result file; again when the potential contact set has grown.
   subroutine write_system(run, error)
      type(run_t), intent(inout) :: run
      type(error_t), allocatable, intent(out) :: error

      call run%results%write_model(run%system, run%reduced, error)
      if (.not. allocated(error)) call run%results%write_interfaces(run%system, error)
   end subroutine write_system

   !> Diagonal of D from the damping asked for, (modes), 1/s.
   function damping(run) result(d)
      type(run_t), intent(in) :: run
      real(wp), allocatable :: d(:)
      integer :: k

      allocate (d(size(run%reduced%frequency)), source=0.0_wp)
      associate (record => run%case%damping, omega => 2.0_wp*pi*run%reduced%frequency)
         if (allocated(record%mass_proportional)) d = record%mass_proportional
         if (allocated(record%ratio)) d = 2.0_wp*record%ratio*omega(min(record%reference_mode, size(omega)))
         if (allocated(record%ratio) .and. record%reference == 'preloaded' .and. allocated(run%modes%frequency)) &
            & d = 4.0_wp*pi*record%ratio*run%modes%frequency(record%reference_mode)
         if (allocated(record%modal_ratio)) then
            do k = 1, size(d)
               d(k) = 2.0_wp*record%modal_ratio(min(k, size(record%modal_ratio)))*omega(k)
            end do
         end if
      end associate
   end function damping

   !> The analyses in the order asked for.
   subroutine analyse(run, line, error)
      type(run_t), intent(inout) :: run
      type(command_line_t), intent(in) :: line
      type(error_t), allocatable, intent(out) :: error
      integer :: k

      ! Without a preload analyses start from the undeformed structure.
      run%state = undeformed_state(run%system)
      do k = 1, size(run%case%analyses)
         select case (trim(run%case%analyses(k)))
         case ('preload')
            call preload(run, error)
         case ('linear_modes')
            call linear_modes(run, error)
            if (.not. allocated(error)) call run%results%write_linear_modes(run%modes, error)
         case ('transient')
            call transient(run, line, error)
         case ('qsma')
            call qsma(run, error)
         case ('ringdown')
            call ringdown(run, error)
         case ('harmonic_balance')
            call harmonic_balance(run, error)
         case ('epmc')
            call epmc(run, error)
         case ('settling')
            call settling(run, line, error)
         end select
         if (allocated(error)) return
      end do
   end subroutine analyse

   !> Options of the contact solver.
   function contact_options(run) result(options)
      type(run_t), intent(in) :: run
      type(contact_options_t) :: options

      options%solver = trim(run%case%contact%solver)
      if (allocated(run%system%problem%compliance)) options%solver = 'matrix_free'
      options%tolerance = run%case%contact%tolerance
      options%max_iterations = run%case%contact%max_iterations
      options%velocity_level = run%case%contact%normal_law == 'velocity'
   end function contact_options

   !> Options of the preload.
   function preload_options(run) result(options)
      type(run_t), intent(in) :: run
      type(preload_options_t) :: options
      integer :: k

      associate (record => run%case%preload)
         options%loads = [(run%scene%load_index(run%case%find_load(record%loads(k))), k=1, size(record%loads))]
         if (allocated(record%interface_force)) options%interface_force = record%interface_force
         if (allocated(record%load_scale)) options%scale = record%load_scale
         options%steps = record%steps
      end associate
   end function preload_options

   !> Static equilibrium under the preload; points left out that would close join, and it is run again.
   subroutine preload(run, error)
      type(run_t), intent(inout) :: run
      type(error_t), allocatable, intent(out) :: error
      type(preload_record_t) :: record
      integer :: added, round

      do round = 1, 20
         call run_preload(run%system, preload_options(run), contact_options(run), run%state, record, error)
         if (allocated(error)) return
         call run%system%widen_where_closed(run%state%modal, run%state%contact%force, run%state%amplitude, added, error)
         if (allocated(error)) return
         if (added == 0) exit
         call run%log%line('preload: '//to_text(added)//' points left out would close: taken in, run again')
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
      if (round > 1) call write_system(run, error)
      if (.not. allocated(error)) call run%results%write_preload(run%system, run%state, record, run%scene%load_names, error)
      call run%clock%stop('write')
   end subroutine preload

   !> Numbers with blanks in front.
   pure function listed(values) result(text)
      real(wp), intent(in) :: values(:)
      character(len=:), allocatable :: text
      integer :: k

      text = ''
      do k = 1, size(values)
         text = text//' '//to_text(values(k), 7)
      end do
   end function listed

   !> Linear modes about the present state.
   subroutine linear_modes(run, error)
      type(run_t), intent(inout) :: run
      type(error_t), allocatable, intent(out) :: error
      integer :: n

      n = run%case%linear_modes%n_modes
      if (any(run%case%loads%kind == 'modal')) n = max(n, maxval(run%case%loads%mode))
      if (run%case%damping%reference == 'preloaded') n = max(n, run%case%damping%reference_mode)
      call solve_linear_modes(run%system, run%state%contact%status, n, run%modes, error)
      if (allocated(error)) return
      call run%clock%stop('linear modes')
      call run%log%line('linear modes about the preload, Hz:'//listed(run%modes%frequency(:min(10, size(run%modes%frequency)))) &
         & //' (residual '//to_text(run%modes%residual, 2)//')')
   end subroutine linear_modes

   !> Time integration.
   subroutine transient(run, line, error)
      type(run_t), intent(inout) :: run
      type(command_line_t), intent(in) :: line
      type(error_t), allocatable, intent(out) :: error
      type(transient_options_t) :: options
      type(transient_results_t), target :: recorder
      type(decay_recorder_t) :: keeper
      type(transient_record_t) :: record
      type(error_t), allocatable :: ignored
      logical, allocatable :: before(:)

      call add_modal_loads(run, error)
      if (.not. allocated(error)) call settle_damping(run, error)
      if (allocated(error)) return
      options = transient_options(run)
      call recorder%create(run%results, run%system, sensor_names(run), error)
      if (allocated(error)) return
      call recorder%line%start('transient', merge(options%duration, end_of_all(options%excitations), &
         & options%duration > 0.0_wp), line%quiet)
      before = potential_points(run%system)
      if (run%case%runs('ringdown')) then
         keeper%onward => recorder
         if (allocated(run%case%ringdown%mode)) then
            call shape_of_mode(run, 'ringdown', run%case%ringdown%mode, keeper%phi, error)
            if (allocated(error)) return
            keeper%origin = run%state%modal
         end if
         call run_transient(run%system, run%state, options, contact_options(run), keeper, run%clock, record, error)
         run%decay = keeper%decay()
      else
         call run_transient(run%system, run%state, options, contact_options(run), recorder, run%clock, record, error)
      end if
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
      if (allocated(error)) return
      if (allocated(ignored)) call move_alloc(ignored, error)
      if (record%unconverged > 0) call failure(error, 'transient: '//to_text(record%unconverged)//' of ' &
         & //to_text(record%steps)//' steps did not converge')
   end subroutine transient

   !> Impact sequence; the state becomes the equilibrium that it ends in.
   subroutine settling(run, line, error)
      type(run_t), intent(inout) :: run
      type(command_line_t), intent(in) :: line
      type(error_t), allocatable, intent(out) :: error
      type(settling_options_t) :: options
      type(settling_record_t) :: record
      type(transient_results_t), target :: series
      type(decay_recorder_t), target :: keeper
      type(error_t), allocatable :: ignored

      call add_modal_loads(run, error)
      if (.not. allocated(error)) call settle_damping(run, error)
      if (.not. allocated(error)) call shape_of_mode(run, 'settling', run%case%settling%mode, keeper%phi, error)
      if (.not. allocated(error)) call series%create(run%results, run%system, sensor_names(run), error, '/settling')
      if (allocated(error)) return
      options = settling_options(run)
      keeper%onward => series
      keeper%origin = run%state%modal
      call series%line%start('settling', size(options%amplitude)*options%interval, line%quiet)
      if (run%case%settling%ringdown) then
         call run_settling(run%system, run%state, options, contact_options(run), keeper, run%clock, record, error)
      else
         call run_settling(run%system, run%state, options, contact_options(run), series, run%clock, record, error)
      end if
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
      if (.not. allocated(error)) call write_settling(run%results%file, run%system, options%amplitude, record, run%state, error)
      if (.not. allocated(error) .and. run%case%settling%ringdown) call identify_decays(run, options, keeper%decay(), error)
      call run%clock%stop('write')
   end subroutine settling

   !> Modal parameters from the free decay after every impact.
   subroutine identify_decays(run, options, decay, error)
      type(run_t), intent(in) :: run
      type(settling_options_t), intent(in) :: options
      !> Of all impacts
      type(decay_t), intent(in) :: decay
      type(error_t), allocatable, intent(out) :: error
      type(decay_t) :: part
      type(ringdown_t) :: found
      integer, allocatable :: samples(:)
      integer :: k, j

      do k = 1, size(options%amplitude)
         samples = pack([(j, j=1, size(decay%time))], decay%time >= (k - 1)*options%interval + options%duration &
            & .and. decay%time < k*options%interval)
         part%time = decay%time(samples)
         part%sensor = decay%sensor(:, samples)
         part%modal = decay%modal(samples)
         call identify_ringdown(part, ringdown_options_t(frequency=1.0_wp/options%period, &
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
      end associate
   end function settling_options

   !> Damping that refers to the preloaded structure.
   subroutine settle_damping(run, error)
      type(run_t), intent(inout) :: run
      type(error_t), allocatable, intent(out) :: error

      if (run%case%damping%reference /= 'preloaded') return
      if (.not. allocated(run%modes%frequency)) call linear_modes(run, error)
      if (.not. allocated(error)) run%system%damping = damping(run)
   end subroutine settle_damping

   !> Shape of a linear mode.
   subroutine shape_of_mode(run, analysis, mode, phi, error)
      type(run_t), intent(in) :: run
      !> Who asks
      character(len=*), intent(in) :: analysis
      integer, intent(in) :: mode
      real(wp), allocatable, intent(out) :: phi(:)
      type(error_t), allocatable, intent(out) :: error

      if (mode > size(run%modes%frequency)) then
         call failure(error, analysis//': mode '//to_text(mode)//' is asked for, but only ' &
            & //to_text(size(run%modes%frequency))//' are retained')
      else
         phi = run%modes%shape(:, mode)
      end if
   end subroutine shape_of_mode

   !> Quasi-static modal analysis.
   subroutine qsma(run, error)
      type(run_t), intent(inout) :: run
      type(error_t), allocatable, intent(out) :: error
      type(qsma_options_t) :: options
      type(qsma_record_t) :: record

      options = qsma_options(run)
      call shape_of_mode(run, 'qsma', run%case%qsma%mode, options%phi, error)
      if (.not. allocated(error)) call settle_damping(run, error)
      if (allocated(error)) return
      options%frequency = run%modes%frequency(run%case%qsma%mode)
      call run_qsma(run%system, run%state, options, contact_options(run), record, error)
      call run%clock%stop('qsma')
      if (allocated(error)) return
      associate (last => size(record%combined))
         call run%log%line('qsma: '//to_text(last)//' amplitudes, '//to_text(1.0e6_wp*record%combined(1)%amplitude, 3)//' to ' &
            & //to_text(1.0e6_wp*record%combined(last)%amplitude, 4)//' um; frequency ' &
            & //to_text(record%combined(1)%frequency, 6)//' to '//to_text(record%combined(last)%frequency, 6) &
            & //' Hz; damping ratio '//to_text(record%combined(1)%damping_ratio, 3)//' to ' &
            & //to_text(record%combined(last)%damping_ratio, 3))
      end associate
      call run%log%line('qsma: '//to_text(record%iterations)//' iterations ('//to_text(record%points_added) &
         & //' points taken in), largest residual '//to_text(record%residual, 2)//', error estimate ' &
         & //to_text(record%error_estimate, 2))
      call write_qsma(run%results%file, record, error)
      if (.not. allocated(error) .and. record%points_added > 0) call write_system(run, error)
      call run%clock%stop('write')
      if (.not. allocated(error) .and. record%unconverged > 0) call failure(error, 'qsma: '// &
         & to_text(record%unconverged)//' load steps did not converge')
   end subroutine qsma

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
         options%cycle = record%cycle
         options%cycle_steps = record%cycle_steps
      end associate
   end function qsma_options

   !> Modal parameters from the free decay that the time integration left.
   subroutine ringdown(run, error)
      type(run_t), intent(inout) :: run
      type(error_t), allocatable, intent(out) :: error
      type(ringdown_options_t) :: options
      type(ringdown_t) :: found

      associate (record => run%case%ringdown)
         options%periods = record%periods
         options%overlap = record%overlap
         options%sensors = run%case%find_sensors(record%sensor)
         options%start = end_of_all(excitations_of(run%case, run%scene))
         if (allocated(record%start)) options%start = record%start
         if (allocated(record%mode)) options%frequency = run%modes%frequency(record%mode)
      end associate
      call identify_ringdown(run%decay, options, found, error)
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

   !> Frequency response.
   subroutine harmonic_balance(run, error)
      type(run_t), intent(inout), target :: run
      type(error_t), allocatable, intent(out) :: error
      type(harmonic_balance_options_t) :: options
      type(response_results_t) :: recorder
      type(curve_record_t), allocatable :: records(:)

      call add_modal_loads(run, error)
      if (.not. allocated(error)) call settle_damping(run, error)
      if (allocated(error)) return
      associate (record => run%case%harmonic_balance)
         options = harmonic_balance_options_t(load=run%scene%load_index(run%case%find_load(record%load)), &
            & sensors=run%case%find_sensors(record%sensor), levels=record%levels, frequency_range=record%frequency_range, &
            & harmonics=record%harmonics, samples=record%samples, response_step=record%response_step, &
            & tolerance=record%tolerance, max_points=record%max_points)
         options%frequency_step = max(0.02_wp*abs(record%frequency_range(2) - record%frequency_range(1)), tiny(1.0_wp))
         if (allocated(record%frequency_step)) options%frequency_step = record%frequency_step
      end associate
      call recorder%create(run%results%file, 'harmonic_balance', sensor_names(run), run%system%n_modes, options%harmonics, error)
      if (allocated(error)) return
      call run_harmonic_balance(run%system, run%state, options, contact_options(run), recorder, records, error)
      call finish_response(run, 'harmonic balance', recorder, records, error)
   end subroutine harmonic_balance

   !> Nonlinear mode.
   subroutine epmc(run, error)
      type(run_t), intent(inout), target :: run
      type(error_t), allocatable, intent(out) :: error
      type(epmc_options_t) :: options
      type(response_results_t) :: recorder
      type(curve_record_t) :: record

      call settle_damping(run, error)
      if (.not. allocated(error)) call shape_of_mode(run, 'epmc', run%case%epmc%mode, options%shape, error)
      if (allocated(error)) return
      associate (chosen => run%case%epmc)
         options%frequency = run%modes%frequency(chosen%mode)
         options%sensors = run%case%find_sensors(chosen%sensor)
         options%amplitude_range = chosen%amplitude_range
         options%points = chosen%points
         options%harmonics = chosen%harmonics
         options%samples = chosen%samples
         options%response_step = chosen%response_step
         options%tolerance = chosen%tolerance
         options%max_points = chosen%max_points
      end associate
      call recorder%create(run%results%file, 'epmc', sensor_names(run), run%system%n_modes, options%harmonics, error)
      if (allocated(error)) return
      call run_epmc(run%system, run%state, options, contact_options(run), recorder, record, error)
      call finish_response(run, 'epmc', recorder, [record], error)
   end subroutine epmc

   !> What follows when response curves have been traced, or given up.
   subroutine finish_response(run, analysis, recorder, records, error)
      type(run_t), intent(inout) :: run
      character(len=*), intent(in) :: analysis
      type(response_results_t), intent(inout) :: recorder
      type(curve_record_t), intent(in) :: records(:)
      !> Of the curves on entry
      type(error_t), allocatable, intent(inout) :: error
      type(error_t), allocatable :: ignored

      call run%clock%stop(analysis)
      call recorder%write_summary(records, ignored)
      call recorder%close()
      if (.not. allocated(ignored)) call write_system(run, ignored)
      call run%log%line(analysis//': '//to_text(recorder%points)//' points, '//to_text(sum(records%evaluations)) &
         & //' evaluations of the contact forces, '//to_text(sum(records%jacobians))//' of their derivative, ' &
         & //to_text(sum(records%failures))//' steps shortened')
      call run%clock%stop('write')
      if (.not. allocated(error) .and. allocated(ignored)) call move_alloc(ignored, error)
   end subroutine finish_response

   !> Names of the sensors.
   function sensor_names(run) result(names)
      type(run_t), intent(in) :: run
      character(len=64), allocatable :: names(:)

      allocate (names(0))
      if (allocated(run%case%output%sensors)) names = run%case%output%sensors
   end function sensor_names

   !> Loads f = M phi join the system; linear modes are computed if they were not.
   subroutine add_modal_loads(run, error)
      type(run_t), intent(inout) :: run
      type(error_t), allocatable, intent(out) :: error
      integer :: k

      if (.not. any(run%case%loads%kind == 'modal') .or. run%system%n_loads > size(run%scene%load_names)) return
      if (.not. allocated(run%modes%frequency)) call linear_modes(run, error)
      if (allocated(error)) return
      do k = 1, size(run%case%loads)
         associate (load => run%case%loads(k))
            if (load%kind /= 'modal') cycle
            if (load%mode > size(run%modes%frequency)) then
               call failure(error, "load '"//trim(load%name)//"': mode "//to_text(load%mode)//' is asked for, but only ' &
                  & //to_text(size(run%modes%frequency))//' are retained')
               return
            end if
            call run%system%add_modal_load(run%modes%shape(:, load%mode))
            run%state%amplitude = [run%state%amplitude, 0.0_wp]
         end associate
      end do
      run%state%contact%q = [run%state%modal, run%state%amplitude]
   end subroutine add_modal_loads

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
      if (allocated(run%case%output%snapshots)) options%snapshots = run%case%output%snapshots
      options%excitations = excitations_of(run%case, run%scene)
      options%meter = meter_of(run%case)
   end function transient_options

end module microslip_cli_driver
