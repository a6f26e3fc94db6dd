!> The program: reads the command line, runs the cases, ends with an exit status.
program main
   use, intrinsic :: iso_fortran_env, only: error_unit, output_unit
   use microslip_cli_process_environment, only: prepare_process
   use microslip_cli_command_line, only: command_line_t, parse_command_line, process_arguments, help_text
   use microslip_cli_driver, only: run_cases
   use microslip_core_error, only: error_t
   use microslip_core_interruption, only: stop_requested, watch_signals
   use microslip_core_standard_streams, only: open_streams, output_fault, put_line
   use microslip_core_version, only: program_version
   use microslip_core_warning_list, only: warning_list_t
   implicit none(type, external)

   type(command_line_t) :: line
   type(error_t), allocatable :: error
   type(warning_list_t) :: warnings

   call open_streams()
   call prepare_process(warnings, error)
   if (.not. allocated(error)) then
      call watch_signals()
      call parse_command_line(process_arguments(), line, error)
   end if
   if (.not. allocated(error)) then
      if (line%help) then
         call put_line(output_unit, help_text())
      else if (line%version) then
         call put_line(output_unit, 'microslip '//program_version)
      else
         call run_cases(line, error, warnings)
      end if
   end if
   if (.not. allocated(error)) call stop_requested(error)
   if (output_fault() /= '') call put_line(error_unit, 'microslip: warning: standard output could not be written to the end ('// &
      & output_fault()//'): a log that is kept there is not complete')
   if (allocated(error)) then
      call put_line(error_unit, 'microslip: '//error%message)
      stop error%status, quiet=.true.
   end if
end program main
