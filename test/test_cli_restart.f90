!> Runs that are stopped and continued from a case file: the shipped coarse S4 Beam on a coarser grid.
module test_cli_restart
   use microslip_cli_command_line, only: command_line_t, text_t
   use microslip_cli_driver, only: run_cases
   use microslip_core_error, only: error_t, status_bad_input
   use microslip_core_interruption, only: forget_request, request_stop
   use microslip_core_kinds, only: wp
   use microslip_io_hdf5, only: hdf5_file_t
   use support_case_run, only: changed, file_text, write_text
   use support_checks, only: good, remove
   use testdrive, only: check, new_unittest, testing_error => error_type, unittest_type
   implicit none(type, external)
   private

   public :: collect_cli_restart

   character(len=*), parameter :: case_path = 'build/test_cli_restart.nml', result_path = 'build/test_cli_restart.h5', &
      & whole_path = 'build/test_cli_restart_whole.h5', shipped = 'input/s4_ringdown.nml', cut = '&transient'
   integer, parameter :: sigterm = 15

contains

   subroutine collect_cli_restart(testsuite)
      type(unittest_type), allocatable, intent(out) :: testsuite(:)

      testsuite = [ &
         & new_unittest('stopped and continued: the same bits', test_stopped), &
         & new_unittest('what cannot be continued', test_faults), &
         & new_unittest('a folder in place of the result file', test_folder)]
   end subroutine collect_cli_restart

   !> Run the case as it stands in its file.
   subroutine run(path, restart, lib)
      character(len=*), intent(in) :: path
      logical, intent(in) :: restart
      type(error_t), allocatable, intent(out) :: lib
      type(command_line_t) :: line

      line%cases = [text_t(case_path)]
      line%output = path
      line%quiet = .true.
      line%restart = restart
      call run_cases(line, lib)
   end subroutine run

   subroutine write_case()
      character(len=:), allocatable :: text

      text = file_text(shipped)
      text = changed(text(:index(text, cut) - 1), [character(len=60) :: "file = 's4_coarse", 'nx = 42, ny = 26', &
         & 'n_modes = 30', "'preload', 'linear_modes', 'transient'"], [character(len=60) :: "file = '../input/s4_coarse", &
         & 'nx = 10, ny = 6', 'n_modes = 8', "'preload', 'linear_modes', 'transient', 'ringdown'"])
      call write_text(case_path, text//"&transient duration = 0.1 /"//new_line('a')// &
         & "&excitation load = 'impact', kind = 'half_sine', amplitude = 500.0, duration = 0.5e-3 /"//new_line('a')// &
         & "&ringdown mode = 1 /"//new_line('a')// &
         & "&output sensors = 'sensor', snapshots = 0.05, checkpoint_steps = 500 /"//new_line('a'))
   end subroutine write_case

   subroutine clean_up()
      call remove(case_path)
      call remove(result_path)
      call remove(whole_path)
   end subroutine clean_up

   subroutine test_stopped(error)
      type(testing_error), allocatable, intent(out) :: error
      type(error_t), allocatable :: lib

      call write_case()
      call run(whole_path, .false., lib)
      call good(error, lib)
      if (allocated(error)) return
      ! Without a file to go on with: from the beginning, to the first look at the signal.
      call request_stop(sigterm)
      call run(result_path, .true., lib)
      call forget_request()
      call check(error, allocated(lib), 'not stopped')
      if (.not. allocated(error)) call check(error, lib%status == 143 .and. index(lib%message, '--restart goes on') > 0, &
         & lib%message)
      if (.not. allocated(error)) call check_stopped(error)
      if (.not. allocated(error)) then
         call run(result_path, .true., lib)
         call good(error, lib)
      end if
      if (.not. allocated(error)) call compare(error)
      ! Once more: there is nothing to be done.
      if (.not. allocated(error)) then
         call run(result_path, .true., lib)
         call good(error, lib)
      end if
      if (.not. allocated(error)) call compare(error)
      call clean_up()
   end subroutine test_stopped

   !> What was finished is there and marked as such.
   subroutine check_stopped(error)
      type(testing_error), allocatable, intent(out) :: error
      type(error_t), allocatable :: lib
      type(hdf5_file_t) :: file
      integer :: finished

      call file%open(result_path, lib)
      if (.not. allocated(lib)) call file%read('/checkpoint/analyses', finished, lib)
      call good(error, lib)
      if (allocated(error)) return
      call check(error, finished >= 1 .and. file%has('/preload/contact/stick') .and. .not. file%has('/ringdown'), 'contents')
      call file%close(lib)
   end subroutine check_stopped

   !> The same bits.
   subroutine compare(error)
      type(testing_error), allocatable, intent(out) :: error
      type(error_t), allocatable :: lib
      type(hdf5_file_t) :: whole, file
      character(len=*), parameter :: rows(*) = [character(len=40) :: '/linear_modes/frequency', '/transient/time', &
         & '/transient/energy/friction_loss', '/transient/contact/residual', '/ringdown/frequency', '/ringdown/damping_ratio'], &
         & tables(*) = [character(len=40) :: '/preload/interface_1/gap', '/transient/sensor', '/transient/modal_displacement']
      real(wp), allocatable :: row(:), other_row(:), table(:, :), other_table(:, :)
      integer :: k

      call whole%open(whole_path, lib)
      if (.not. allocated(lib)) call file%open(result_path, lib)
      do k = 1, size(rows)
         if (.not. allocated(lib)) call whole%read(trim(rows(k)), row, lib)
         if (.not. allocated(lib)) call file%read(trim(rows(k)), other_row, lib)
         call good(error, lib)
         if (.not. allocated(error)) call check(error, size(row), size(other_row))
         if (.not. allocated(error)) call check(error, all(row == other_row .or. row /= row), trim(rows(k)))
         if (allocated(error)) return
      end do
      do k = 1, size(tables)
         if (.not. allocated(lib)) call whole%read(trim(tables(k)), table, lib)
         if (.not. allocated(lib)) call file%read(trim(tables(k)), other_table, lib)
         call good(error, lib)
         if (.not. allocated(error)) call check(error, size(table), size(other_table))
         if (.not. allocated(error)) call check(error, all(table == other_table .or. table /= table), trim(tables(k)))
         if (allocated(error)) return
      end do
      call check(error,.not. file%has('/checkpoint'), '/checkpoint is left')
      call whole%close(lib)
      call file%close(lib)
   end subroutine compare

   subroutine test_faults(error)
      type(testing_error), allocatable, intent(out) :: error
      type(error_t), allocatable :: lib

      call write_case()
      call request_stop(sigterm)
      call run(result_path, .false., lib)
      call forget_request()
      call write_text(case_path, changed(file_text(case_path), 'amplitude = 500.0', 'amplitude = 501.0'))
      call run(result_path, .true., lib)
      call check(error, allocated(lib), 'another case was continued')
      if (.not. allocated(error)) call check(error, lib%status == status_bad_input .and. &
         & index(lib%message, 'the results of another case') > 0, lib%message)
      if (.not. allocated(error)) call check_stopped(error)
      call write_text(result_path, 'no result file')
      if (.not. allocated(error)) then
         call run(result_path, .true., lib)
         call check(error, allocated(lib), 'no result file')
      end if
      if (.not. allocated(error)) call check(error, lib%status == status_bad_input, lib%message)
      call clean_up()
   end subroutine test_faults

   subroutine test_folder(error)
      type(testing_error), allocatable, intent(out) :: error
      type(error_t), allocatable :: lib

      call write_case()
      call run('build', .false., lib)
      call check(error, allocated(lib), 'a folder was replaced')
      if (.not. allocated(error)) call check(error, lib%status == status_bad_input .and. &
         & index(lib%message, 'cannot be replaced') > 0, lib%message)
      call clean_up()
   end subroutine test_folder

end module test_cli_restart
