!> Runs the cases of a command line: reads, builds, analyses, writes; errors and exit status.
module microslip_cli_driver
   use microslip_cli_analyses, only: analyse
   use microslip_cli_command_line, only: command_line_t
   use microslip_cli_coupling_report, only: check_mesh, report_mesh
   use microslip_cli_demand, only: check_demand, check_grids, check_reading, estimate_demand, in_words, memory_estimate
   use microslip_cli_file_guard, only: file_guard_t
   use microslip_cli_interface_checks, only: check_interfaces
   use microslip_cli_log, only: listed, log_t, warnings_in_words
   use microslip_cli_model_report, only: report_model, report_tied
   use microslip_cli_motion_checks, only: check_loads, check_times
   use microslip_cli_restart, only: examine_results, open_results
   use microslip_cli_run, only: run_t
   use microslip_cli_scene, only: build_scene, read_model
   use microslip_cli_scene_report, only: report_elements, report_scene
   use microslip_cli_set_up, only: reduce_model, build_system
   use microslip_cli_surface_input, only: report_surface
   use microslip_cli_threads, only: choose_threads, thread_count
   use microslip_core_error, only: error_t
   use microslip_core_interruption, only: hold_signals, release_signals, status_of_signal, stop_requested
   use microslip_core_kinds, only: wp
   use microslip_core_machine_memory, only: peak_memory
   use microslip_core_version, only: program_version
   use microslip_core_warning_list, only: warning_list_t
   use microslip_fe_model, only: fe_model_t
   use microslip_io_case, only: case_t
   use microslip_io_case_file, only: read_case, resolved_text
   use microslip_io_checkpoint, only: end_checkpoints
   use microslip_io_input_files, only: forget_inputs, note_input
   use microslip_io_model_file, only: write_model_hdf5
   implicit none(type, external)
   private

   public :: run_cases

   !> A case of the command line, or what is wrong with it.
   type :: read_case_t
      type(case_t) :: case
      type(error_t), allocatable :: error
   end type read_case_t

contains

   !> Run all cases; a case that fails does not keep the others from running, a signal does, and so does a case that would
   !> write what another one reads or writes.
   subroutine run_cases(line, error, process_warnings)
      type(command_line_t), intent(in) :: line
      !> All failures, with the highest exit status
      type(error_t), allocatable, intent(out) :: error
      !> What is doubtful about the process, noted in every case
      type(warning_list_t), intent(in), optional :: process_warnings
      type(warning_list_t) :: warnings
      type(read_case_t), allocatable :: cases(:)
      type(file_guard_t) :: guard
      type(error_t), allocatable :: one
      character(len=:), allocatable :: command
      integer :: k, length

      call get_command(length=length)
      allocate (character(len=length) :: command)
      call get_command(command)
      if (present(process_warnings)) warnings = process_warnings
      call choose_threads(line%threads, warnings, error)
      if (allocated(error)) return
      allocate (cases(size(line%cases)))
      do k = 1, size(cases)
         call read_case(line%cases(k)%text, cases(k)%case, cases(k)%error)
         if (.not. allocated(cases(k)%error)) call guard%note_case(k, cases(k)%case, output_path(cases(k)%case, line), &
            & line%write_model)
      end do
      call guard%check_between(error)
      if (allocated(error)) return
      do k = 1, size(cases)
         if (allocated(cases(k)%error)) then
            call move_alloc(cases(k)%error, one)
         else
            call run_case(cases(k)%case, k, guard, line, command, warnings, one)
            ! One that came too late to stop the case stops the others.
            if (.not. allocated(one)) call stop_requested(one)
         end if
         if (.not. allocated(one)) cycle
         if (index(one%message, line%cases(k)%text) == 0) one%message = line%cases(k)%text//': '//one%message
         if (allocated(error)) then
            error%message = error%message//new_line('a')//one%message
            error%status = max(error%status, one%status)
         else
            call move_alloc(one, error)
         end if
         if (error%status > status_of_signal) return
      end do
   end subroutine run_cases

   !> Run one case.
   subroutine run_case(case, number, guard, line, command, warnings, error)
      type(case_t), intent(in) :: case
      !> On the command line
      integer, intent(in) :: number
      !> Knows the files of all cases
      type(file_guard_t), intent(in) :: guard
      !> Options
      type(command_line_t), intent(in) :: line
      !> The command line as text, for the record
      character(len=*), intent(in) :: command
      !> Of the process
      type(warning_list_t), intent(in) :: warnings
      type(error_t), allocatable, intent(out) :: error
      type(run_t), target :: run
      type(fe_model_t) :: model
      integer :: k

      run%log = log_t(quiet=line%quiet, verbose=line%verbose)
      run%warnings = warnings
      call run%clock%start()
      run%case = case
      call run%log%title('microslip '//program_version//': '//trim(case%title)//' ('//case%path//')')
      call guard%check_case(number, run%warnings, error)
      if (allocated(error)) return
      call check_reading(run%case, error)
      if (allocated(error)) return
      call forget_inputs()
      call note_input(case%path)
      if (allocated(line%write_model) .and. .not. line%check) then
         call read_model(run%case, model, run%scene%survey, run%warnings, error)
         if (.not. allocated(error)) call guard%check_read(number, error)
         if (.not. allocated(error)) call write_model_hdf5(line%write_model, model, error)
         call run%log%warnings(run%warnings)
         if (.not. allocated(error)) call run%log%line('FE model written to '//line%write_model)
         return
      end if
      call check_grids(run%case, error)
      if (.not. allocated(error)) call build_scene(run%case, run%scene, error)
      call run%warnings%append(run%scene%warnings)
      if (allocated(error)) then
         call run%log%warnings(run%warnings)
         return
      end if
      call guard%check_read(number, error)
      if (.not. allocated(error) .and. line%check .and. line%restart) call examine_results(run, output_path(case, line), error)
      if (allocated(error)) return
      call run%clock%stop('read')
      call check_interfaces(run%case, run%scene, run%warnings)
      call check_loads(run%case, run%scene, run%warnings)
      run%demand = estimate_demand(run%case, run%scene, run%reduced)
      call report_elements(run%log, run%scene%model)
      call report_model(run%log, run%scene)
      if (line%check) call report_tied(run%log, run%scene)
      if (line%check .or. line%verbose) call report_scene(run%log, run%case, run%scene, run%demand)
      do k = 1, size(run%scene%pads)
         if (line%check .or. line%verbose .or. allocated(run%scene%pads(k)%filter)) &
            & call report_mesh(run%log, run%scene%pads(k), run%scene%meshes(k))
         call report_surface(run%log, run%scene%surfaces(k))
         call check_mesh(run%scene%pads(k), run%scene%meshes(k), run%warnings)
      end do
      call check_demand(run%demand, output_path(run%case, line), error)
      if (.not. (allocated(error) .or. line%check)) call compute(run, line, command, error)
      call run%log%warnings(run%warnings)
      if (allocated(error)) return
      if (line%check) call run%log%line('checked, nothing was run'//warnings_in_words(run%warnings))
      if (.not. line%check) call run%log%line('results in '//output_path(run%case, line)//warnings_in_words(run%warnings))
   end subroutine run_case

   !> Everything after the input is known to be right.
   subroutine compute(run, line, command, error)
      type(run_t), intent(inout), target :: run
      type(command_line_t), intent(in) :: line
      character(len=*), intent(in) :: command
      type(error_t), allocatable, intent(out) :: error
      logical :: finished
      real(wp) :: before

      call open_results(run, output_path(run%case, line), line%restart, thread_count(), finished, error)
      if (allocated(error)) then
         call run%results%discard()
         return
      end if
      if (finished) then
         call run%log%line('restart: '//output_path(run%case, line)//' is complete, nothing is left to be done')
         return
      end if
      call reduce_model(run, error)
      if (.not. allocated(error)) call run%log%line( &
         & 'tied frequencies, Hz:'//listed(run%reduced%frequency(:min(6, run%reduced%tied_modes))))
      if (.not. allocated(error)) call check_times(run%case, run%scene, &
         & run%reduced%frequency(:run%reduced%tied_modes), run%warnings)
      ! Now the number of time steps is known.
      if (.not. allocated(error)) then
         before = memory_estimate(run%demand)
         run%demand = estimate_demand(run%case, run%scene, run%reduced)
         run%demand%memory_before = before
         call check_demand(run%demand, output_path(run%case, line), error)
      end if
      if (allocated(error)) then
         call run%results%discard()
         return
      end if
      if (.not. allocated(run%checkpoint%digest)) then
         call run%results%write_provenance(program_version, commit(), command, thread_count(), error)
         if (.not. allocated(error)) call run%results%write_setup(run%case%text, resolved_text(run%case), error)
      end if
      if (.not. allocated(error)) call build_system(run, error)
      if (.not. allocated(error)) call analyse(run, error)
      if (.not. allocated(error)) call end_checkpoints(run%results, error)
      call finish(run, output_path(run%case, line), error)
   end subroutine compute

   !> Close the result file and say how it went.
   subroutine finish(run, path, error)
      type(run_t), intent(inout) :: run
      !> Result file
      character(len=*), intent(in) :: path
      !> Of the analyses on entry
      type(error_t), allocatable, intent(inout) :: error
      type(error_t), allocatable :: ignored

      ! A signal does not come between the results and their place.
      call hold_signals()
      call run%results%write_timing(run%clock%stage, run%clock%seconds, run%clock%count, ignored)
      if (.not. allocated(ignored)) call run%results%write_warnings(run%warnings, ignored)
      call run%results%close(ignored)
      call release_signals()
      call run%log%timing(run%clock)
      call run%log%line('memory: '//in_words(peak_memory())//' at the peak, '// &
         & in_words(memory_estimate(run%demand))//' were estimated')
      if (.not. allocated(error) .and. allocated(ignored)) call move_alloc(ignored, error)
      if (.not. allocated(error)) return
      if (error%status > status_of_signal) error%message = run%case%path//': '//error%message//'; '//path &
         & //' has the results up to here, --restart goes on'
   end subroutine finish

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

end module microslip_cli_driver
