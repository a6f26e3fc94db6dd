!> Contact scenes at the limits by every contact solver, as a table.
!>
!>     stress TABLE [LIST [NAME]]
!>
!> TABLE is the CSV file to write; the same as Markdown goes to stdout. LIST names problem files of FCLib, one a line,
!> relative to its own folder; '' for none. NAME: only scenes whose names hold it. Exit status 1 if a verdict is WRONG.
!> What the columns are: `support_contact_verdict`.
program stress
   use, intrinsic :: iso_fortran_env, only: error_unit, output_unit
   use microslip_cli_process_environment, only: prepare_process
   use microslip_cli_threads, only: choose_threads
   use microslip_core_warning_list, only: warning_list_t
   use microslip_contact_problem, only: contact_problem_t
   use microslip_core_error, only: error_t
   use microslip_core_kinds, only: wp
   use microslip_io_fclib, only: read_fclib
   use support_contact_verdict, only: all_solvers, judge_solver, verdict_t
   use support_stress_dynamics, only: judge_motion, motion_scene_t, motion_scenes
   use support_stress_scenes, only: contact_scene, in_units, random_scene, stress_scene_t, stress_scenes
   implicit none(type, external)

   !> Of the solvers, and what they may use.
   real(wp), parameter :: tolerance = 1.0e-10_wp
   integer, parameter :: max_iterations = 20000
   !> Violation that the tolerance excuses: iterations stop on estimates.
   real(wp), parameter :: allowed = 1.0e3_wp*tolerance
   !> Random problems of each kind, their points, and the rank of the hyperstatic ones.
   integer, parameter :: seeds = 20, points = 8, low_rank = 10
   !> Scenes and solvers for other units of length, these per metre, and what their forces may differ by.
   character(len=*), parameter :: in_other_units(2) = [character(len=19) :: 'friction 1', 'different materials'], &
      & direct(2) = [character(len=9) :: 'condensed', 'newton'], unit(2) = ['mm', 'um']
   real(wp), parameter :: per_metre(2) = [1.0e3_wp, 1.0e6_wp], sharp = 1.0e-12_wp, same_forces = 1.0e-12_wp
   !> Longer motions are for the fast solver alone.
   integer, parameter :: most_steps = 100000
   type(stress_scene_t), allocatable :: scenes(:)
   type(motion_scene_t), allocatable :: motions(:)
   character(len=1024) :: table_path, list_path, wanted
   type(warning_list_t) :: warnings
   type(error_t), allocatable :: error
   integer :: table, wrong, k

   call prepare_process(warnings, error)
   if (.not. allocated(error)) call choose_threads(0, warnings, error)
   if (allocated(error)) call give_up(error%message)
   call get_command_argument(1, table_path)
   call get_command_argument(2, list_path)
   call get_command_argument(3, wanted)
   if (table_path == '') call give_up('usage: stress TABLE [LIST [NAME]]')
   open (newunit=table, file=trim(table_path), status='replace', action='write', iostat=k)
   if (k /= 0) call give_up(trim(table_path)//': cannot write')

   scenes = stress_scenes(short=.false.)
   do k = 1, seeds
      scenes = [scenes, random_scene(k, points, 3*points), random_scene(k, points, low_rank)]
   end do
   if (list_path /= '') call add_files(trim(list_path))

   write (table, '(a)') 'scene,solver,verdict,steps,unconverged,residual,energy_error,seconds,message'
   write (output_unit, '(a)') '| scene | solver | verdict | steps | unconverged | largest violation | energy error | s |'
   write (output_unit, '(a)') '| --- | --- | --- | --- | --- | --- | --- | --- |'
   wrong = 0
   do k = 1, size(scenes)
      if (index(scenes(k)%name, trim(wanted)) > 0) call run(scenes(k))
      if (any(scenes(k)%name == in_other_units)) call run_in_units(scenes(k))
   end do
   motions = motion_scenes(short=.false.)
   do k = 1, size(motions)
      if (index(motions(k)%name, trim(wanted)) > 0) call run_motion(motions(k))
   end do
   if (wrong > 0) stop 1, quiet=.true.

contains

   !> One scene by all solvers: their lines of the table.
   subroutine run(scene)
      type(stress_scene_t), intent(in) :: scene
      type(verdict_t) :: verdict
      integer :: s

      do s = 1, size(all_solvers)
         call judge_solver(scene%problem, scene%path, trim(all_solvers(s)), tolerance, max_iterations, allowed, verdict)
         call report(scene%name, s, verdict)
      end do
   end subroutine run

   !> The same forces whatever the unit of length: their difference stands in place of the violation.
   subroutine run_in_units(scene)
      type(stress_scene_t), intent(in) :: scene
      type(stress_scene_t) :: same
      type(verdict_t) :: metre, verdict
      character(len=:), allocatable :: name
      integer :: s, u

      do u = 1, size(unit)
         name = scene%name//' in '//unit(u)
         if (index(name, trim(wanted)) == 0) cycle
         same = in_units(scene, per_metre(u))
         do s = 1, size(all_solvers)
            if (.not. any(all_solvers(s) == direct)) cycle
            call judge_solver(scene%problem, scene%path, trim(all_solvers(s)), sharp, max_iterations, allowed, metre)
            call judge_solver(same%problem, same%path, trim(all_solvers(s)), sharp, max_iterations, allowed, verdict)
            verdict%residual = maxval(abs(verdict%force - metre%force))/maxval(metre%force)
            if (verdict%residual > same_forces) verdict%word = 'WRONG'
            call report(name, s, verdict)
         end do
      end do
   end subroutine run_in_units

   !> One time integration by all solvers; the long one by the fast solver alone.
   subroutine run_motion(motion)
      type(motion_scene_t), intent(in) :: motion
      type(verdict_t) :: verdict
      integer :: s

      do s = 1, merge(1, size(all_solvers), motion%steps > most_steps)
         call judge_motion(motion, trim(all_solvers(s)), tolerance, max_iterations, verdict)
         call report(motion%name, s, verdict)
      end do
   end subroutine run_motion

   !> Line of the tables.
   subroutine report(name, s, verdict)
      character(len=*), intent(in) :: name
      !> Solver
      integer, intent(in) :: s
      type(verdict_t), intent(in) :: verdict

      if (verdict%word == 'WRONG') wrong = wrong + 1
      write (table, '(3(a,","),2(i0,","),2(es9.2,","),f0.3,",")', advance='no') name, trim(all_solvers(s)), &
         & trim(verdict%word), verdict%steps, verdict%unconverged, verdict%residual, verdict%energy_error, verdict%seconds
      if (allocated(verdict%message)) write (table, '(3a)', advance='no') '"', verdict%message, '"'
      write (table, '()')
      flush (table)
      write (output_unit, '(3("| ",a," "),2("| ",i0," "),2("| ",es7.1," "),"| ",f0.3," |")') name, &
         & trim(all_solvers(s)), trim(verdict%word), verdict%steps, verdict%unconverged, verdict%residual, &
         & verdict%energy_error, verdict%seconds
      flush (output_unit)
   end subroutine report

   !> The FCLib problems of a list.
   subroutine add_files(list_path)
      character(len=*), intent(in) :: list_path
      type(contact_problem_t) :: problem
      type(error_t), allocatable :: error
      character(len=1024) :: name
      integer :: list, status

      open (newunit=list, file=list_path, status='old', action='read', iostat=status)
      if (status /= 0) call give_up(list_path//': no such file')
      do
         read (list, '(a)', iostat=status) name
         if (status /= 0) exit
         if (name == '') cycle
         call read_fclib(list_path(:index(list_path, '/', back=.true.))//trim(name), problem, error)
         if (allocated(error)) call give_up(error%message)
         scenes = [scenes, contact_scene(name(:index(name, '.', back=.true.) - 1), problem)]
      end do
      close (list)
   end subroutine add_files

   !> Print and end.
   subroutine give_up(message)
      character(len=*), intent(in) :: message
      write (error_unit, '(a)') message
      stop 2, quiet=.true.
   end subroutine give_up

end program stress
