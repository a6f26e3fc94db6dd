!> Every contact solver on a collection of frictional contact problems in the format of FCLib.
!>
!>     frictional_contact LIST TABLE
!>
!> LIST names the problem files, one a line, relative to its own folder; TABLE is the CSV file to write: one line per
!> problem and solver. A problem is solved where the natural map, which knows nothing of solvers, is at most
!> `wanted_error`. Solvers that read one triangle of a W that is not symmetric can converge and not have solved it.
program frictional_contact
   use, intrinsic :: iso_fortran_env, only: output_unit, error_unit
   use microslip_cli_process_environment, only: prepare_process
   use microslip_contact_factory, only: contact_options_t, contact_solver_names, new_contact_solver
   use microslip_contact_natural_map, only: natural_map_error
   use microslip_contact_problem, only: contact_problem_t, contact_state_t, contact_solver_t, solve_record_t, new_state
   use microslip_core_error, only: error_t
   use microslip_core_kinds, only: wp
   use microslip_core_stopwatch, only: wall_time
   use microslip_core_text, only: to_text
   use microslip_core_warning_list, only: warning_list_t
   use microslip_io_fclib, only: read_fclib
   implicit none(type, external)

   !> Of the natural map.
   real(wp), parameter :: wanted_error = 1.0e-10_wp
   !> Of the solvers: relative to the largest force, which reaches 4e5 in these problems.
   real(wp), parameter :: tolerance = 1.0e-12_wp
   integer, parameter :: max_iterations = 30000
   !> Solves that are repeated for the time if they are short, s.
   real(wp), parameter :: short_time = 0.05_wp
   integer, dimension(size(contact_solver_names)) :: solved, converged, off
   integer :: problems, list, table, status, k
   real(wp) :: seconds(size(contact_solver_names))
   character(len=1024) :: list_path, table_path, name
   type(warning_list_t) :: warnings
   type(contact_problem_t) :: problem
   type(error_t), allocatable :: error

   call prepare_process(warnings, error)
   if (allocated(error)) call give_up(error%message)
   call get_command_argument(1, list_path)
   call get_command_argument(2, table_path)
   if (table_path == '') call give_up('usage: frictional_contact LIST TABLE')
   open (newunit=list, file=trim(list_path), status='old', action='read', iostat=status)
   if (status /= 0) call give_up(trim(list_path)//': no such file')
   open (newunit=table, file=trim(table_path), status='replace', action='write', iostat=status)
   if (status /= 0) call give_up(trim(table_path)//': cannot write')

   write (table, '(a)') 'problem,contacts,solver,solved,converged,error,residual,iterations,seconds,remark'
   problems = 0
   solved = 0
   converged = 0
   off = 0
   seconds = 0.0_wp
   do
      read (list, '(a)', iostat=status) name
      if (status /= 0) exit
      if (name == '') cycle
      call read_fclib(list_path(:index(list_path, '/', back=.true.))//trim(name), problem, error)
      if (allocated(error)) call give_up(error%message)
      problems = problems + 1
      do k = 1, size(contact_solver_names)
         call solve(k)
      end do
   end do
   write (output_unit, '(a,i0,a)') 'of ', problems, ' problems:'
   write (output_unit, '(a)') 'solver               solved  converged too  else converged  seconds for the solved'
   do k = 1, size(contact_solver_names)
      write (output_unit, '(a,i10,i15,i16,f12.3)') contact_solver_names(k), solved(k), converged(k), off(k), seconds(k)
   end do

contains

   !> One problem by one solver: its line of the table.
   subroutine solve(k)
      !> Solver
      integer, intent(in) :: k
      class(contact_solver_t), allocatable :: solver
      type(contact_state_t) :: state
      type(solve_record_t) :: record
      type(error_t), allocatable :: failed
      real(wp) :: started, time, distance
      integer :: repeats

      time = huge(1.0_wp)
      do repeats = 1, 3
         call new_contact_solver(contact_options_t(contact_solver_names(k), tolerance, max_iterations), solver, failed)
         if (allocated(failed)) call give_up(failed%message)
         started = wall_time()
         state = new_state(problem)
         call solver%start(problem, state, failed)
         if (.not. allocated(failed)) call solver%advance(problem, [1.0_wp], state, record)
         time = min(time, wall_time() - started)
         if (time > short_time) exit
      end do
      distance = natural_map_error(problem%G, problem%R(:, 1), problem%friction, reshape(state%force, [3*problem%n_points]))
      if (distance <= wanted_error) then
         solved(k) = solved(k) + 1
         if (record%converged) converged(k) = converged(k) + 1
         seconds(k) = seconds(k) + time
      else if (record%converged) then
         off(k) = off(k) + 1
      end if
      write (table, '(a,",",i0,3(",",a),2(",",es7.1),",",i0,",",f0.6,",")', advance='no') &
         & name(:index(name, '.', back=.true.) - 1), problem%n_points, trim(contact_solver_names(k)), &
         & to_text(distance <= wanted_error), to_text(record%converged), distance, record%residual, record%iterations, time
      if (allocated(failed)) write (table, '(3a)', advance='no') '"', failed%message, '"'
      if (record%converged .and. distance > wanted_error) write (table, '(a,es7.1)', advance='no') &
         & 'solved for one triangle of W: its asymmetry is ', &
         & maxval(abs(problem%G - transpose(problem%G)))/maxval(abs(problem%G))
      write (table, '()')
   end subroutine solve

   !> Print and end.
   subroutine give_up(message)
      character(len=*), intent(in) :: message
      write (error_unit, '(a)') message
      stop 1, quiet=.true.
   end subroutine give_up

end program frictional_contact
