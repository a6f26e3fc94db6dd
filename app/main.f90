program main
   use microslip_cli_scene, only: scene_t, build_scene, read_model
   use microslip_cli_scene_report, only: report_scene
   use microslip_cli_log, only: log_t
   use microslip_io_case, only: case_t
   use microslip_io_case_file, only: read_case
   use microslip_io_reduction_cache, only: read_cache, write_cache
   use microslip_io_model_file, only: write_model_hdf5
   use microslip_core_error, only: error_t
   use microslip_core_kinds, only: wp
   use microslip_core_stopwatch, only: wall_time
   use microslip_fe_model, only: fe_model_t
   use microslip_fe_reduction, only: reduction_options_t, reduce
   use microslip_fe_reduced_model, only: reduced_model_t
   use microslip_system_jointed_system, only: jointed_system_t, new_system
   use microslip_analysis_preload
   use microslip_analysis_potential_set
   use microslip_analysis_linear_modes
   use microslip_analysis_operating_state
   use microslip_contact_factory
   implicit none(type, external)
   type(case_t) :: case
   type(scene_t) :: scene
   type(error_t), allocatable :: error
   type(reduced_model_t) :: reduced
   type(reduction_options_t) :: ro
   type(jointed_system_t) :: system
   type(preload_options_t) :: po
   type(contact_options_t) :: co
   type(operating_state_t) :: state
   type(preload_record_t) :: record
   type(linear_modes_t) :: modes
   character(len=200) :: arg
   real(wp), allocatable :: d(:)
   real(wp) :: t0
   integer :: k
   logical :: found
   call get_command_argument(1, arg)
   t0 = wall_time()
   call read_case(trim(arg), case, error); call chk()
   call build_scene(case, scene, error); call chk()
   call report_scene(log_t(), case, scene)
   call lap('scene')
   if (command_argument_count() > 1) then
      call get_command_argument(2, arg)
      call write_model_hdf5(trim(arg), scene%model, error); call chk()
      stop
   end if
   ro%method = 'craig_bampton_massless'; ro%modes = 30
   call read_cache(trim(arg)//'.cache', 'x', reduced, found)
   if (.not. found) call reduce(scene%model, [(scene%pads(k)%contact, k=1,size(scene%pads))], scene%patterns, &
 ro, reduced, error); call chk()
   if (.not. found) call write_cache(trim(arg)//'.cache', 'x', reduced, error); call chk()
   call lap('reduce')
   print '(a,*(1x,f9.3))', 'tied', reduced%frequency
   allocate(d(size(reduced%frequency)), source=0.0_wp)
   call new_system(reduced, scene%pads, scene%n_node_loads, d, system, error); call chk()
   call lap('system')
   po%loads = [1,2]; po%interface_force = case%preload%interface_force; po%steps = case%preload%steps
   call choose_potential_set(system, po, [.false., .false.], [-1.0_wp, -1.0_wp], error); call chk()
   print *, 'potential', system%problem%n_points, system%grid_point_count()
   call lap('potential')
   co%solver = 'condensed'
   call run_preload(system, po, co, state, record, error); call chk()
   call lap('preload')
   print *, record%interface_force, record%solves, record%iterations, record%residual, &
 record%error_estimate, record%force_deviation, record%elastic_energy, record%work, record%friction_loss, state%amplitude
   print *, 'states', count(state%contact%status==0), count(state%contact%status==1), count(state%contact%status==2)
   call system%widen_where_closed(state%modal, state%contact%force, state%amplitude, k, error); call chk()
   print *, 'added', k
   call solve_linear_modes(system, state%contact%status, 30, modes, error); call chk()
   print '(a,*(1x,f9.3))', 'modes', modes%frequency
   call lap('modes')
contains
   subroutine chk()
      if (allocated(error)) then
         print '(a)', error%message
         stop 1
      end if
   end subroutine
   subroutine lap(s)
      character(*), intent(in) :: s
      print '(a,f8.2)', s, wall_time()-t0
      t0 = wall_time()
   end subroutine
end program main
