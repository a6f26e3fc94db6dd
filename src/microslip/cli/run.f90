!> A case on its way through the analyses, and what several analyses need of it: options of the contact solver and of the
!> preload, linear modes, damping and loads that refer to them.
module microslip_cli_run
   use microslip_analysis_linear_modes, only: linear_modes_t, solve_linear_modes
   use microslip_analysis_operating_state, only: operating_state_t
   use microslip_analysis_preload, only: preload_options_t
   use microslip_cli_demand, only: demand_t
   use microslip_cli_log, only: log_t, listed
   use microslip_cli_scene, only: scene_t
   use microslip_contact_factory, only: contact_options_t
   use microslip_core_error, only: error_t, bad_input
   use microslip_core_kinds, only: wp, pi
   use microslip_core_stopwatch, only: stopwatch_t
   use microslip_core_text, only: to_text
   use microslip_core_warning_list, only: severity_note, warning_list_t
   use microslip_fe_reduced_model, only: reduced_model_t
   use microslip_io_case, only: case_t
   use microslip_io_checkpoint, only: checkpoint_t
   use microslip_io_results, only: results_t
   use microslip_system_jointed_system, only: jointed_system_t
   implicit none(type, external)
   private

   public :: run_t, write_system, contact_options, preload_options, sensor_names, damping
   public :: find_modes, shape_of_mode, settle_damping, add_modal_loads

   !> A case on its way through the analyses.
   type :: run_t
      type(case_t) :: case
      type(scene_t) :: scene
      !> What it will ask of the machine
      type(demand_t) :: demand
      type(reduced_model_t) :: reduced
      type(jointed_system_t) :: system
      type(operating_state_t) :: state
      type(linear_modes_t) :: modes
      type(results_t) :: results
      !> What an interrupted run left behind; nothing in it otherwise
      type(checkpoint_t) :: checkpoint
      type(stopwatch_t) :: clock
      type(log_t) :: log
      !> What is doubtful about the input and the results
      type(warning_list_t) :: warnings
   end type run_t

contains

   !> Sizes and interfaces into the result file; again when the potential contact set has grown.
   subroutine write_system(run, error)
      type(run_t), intent(inout) :: run
      type(error_t), allocatable, intent(out) :: error

      call run%results%write_model(run%system, run%reduced, error)
      if (.not. allocated(error)) call run%results%write_interfaces(run%system, error)
   end subroutine write_system

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

   !> Names of the sensors.
   function sensor_names(run) result(names)
      type(run_t), intent(in) :: run
      character(len=64), allocatable :: names(:)

      allocate (names(0))
      if (allocated(run%case%output%sensors)) names = run%case%output%sensors
   end function sensor_names

   !> Diagonal of D from the damping asked for, (modes), 1/s. Coordinates that carry residual mass are no tied modes: of modal
   !> damping they take the smallest, since what they do at low frequencies is to move with bodies that slide or lift.
   function damping(run) result(d)
      type(run_t), intent(in) :: run
      real(wp), allocatable :: d(:)
      integer :: k, tied

      allocate (d(size(run%reduced%frequency)), source=0.0_wp)
      tied = run%reduced%tied_modes
      associate (record => run%case%damping, omega => 2.0_wp*pi*run%reduced%frequency)
         if (allocated(record%mass_proportional)) d = record%mass_proportional
         if (allocated(record%ratio)) d = 2.0_wp*record%ratio*omega(min(record%reference_mode, tied))
         if (allocated(record%ratio) .and. record%reference == 'preloaded' .and. allocated(run%modes%frequency)) &
            & d = 4.0_wp*pi*record%ratio*run%modes%frequency(record%reference_mode)
         if (allocated(record%modal_ratio)) then
            do k = 1, tied
               d(k) = 2.0_wp*record%modal_ratio(min(k, size(record%modal_ratio)))*omega(k)
            end do
            d(tied + 1:) = minval(d(:tied))
         end if
      end associate
   end function damping

   !> Linear modes about the present state.
   subroutine find_modes(run, error)
      type(run_t), intent(inout) :: run
      type(error_t), allocatable, intent(out) :: error
      integer :: n

      n = run%case%linear_modes%n_modes
      if (any(run%case%loads%kind == 'modal')) n = max(n, maxval(run%case%loads%mode))
      if (run%case%damping%reference == 'preloaded') n = max(n, run%case%damping%reference_mode)
      call solve_linear_modes(run%system, run%state%contact%status, n, run%modes, error)
      if (allocated(error)) return
      if (run%case%linear_modes%n_modes > size(run%modes%frequency) .and. run%case%linear_modes%asked) &
         & call run%warnings%add(severity_note, '&linear_modes: n_modes = '//to_text(run%case%linear_modes%n_modes) &
         & //' are asked for, the reduced model has '//to_text(size(run%modes%frequency))//': keep more in &reduction')
      call run%clock%stop('linear modes')
      call run%log%line('linear modes about the preload, Hz:'//listed(run%modes%frequency(:min(10, size(run%modes%frequency)))) &
         & //' (residual '//to_text(run%modes%residual, 2)//')')
   end subroutine find_modes

   !> Shape of a linear mode.
   subroutine shape_of_mode(run, analysis, mode, phi, error)
      type(run_t), intent(in) :: run
      !> Who asks
      character(len=*), intent(in) :: analysis
      integer, intent(in) :: mode
      real(wp), allocatable, intent(out) :: phi(:)
      type(error_t), allocatable, intent(out) :: error

      if (mode > size(run%modes%frequency)) then
         call bad_input(error, analysis//': mode '//to_text(mode)//' is asked for, but only ' &
            & //to_text(size(run%modes%frequency))//' are retained')
      else
         phi = run%modes%shape(:, mode)
      end if
   end subroutine shape_of_mode

   !> Damping that refers to the preloaded structure.
   subroutine settle_damping(run, error)
      type(run_t), intent(inout) :: run
      type(error_t), allocatable, intent(out) :: error

      if (run%case%damping%reference /= 'preloaded') return
      if (.not. allocated(run%modes%frequency)) call find_modes(run, error)
      if (.not. allocated(error)) run%system%damping = damping(run)
   end subroutine settle_damping

   !> Loads f = M phi join the system; linear modes are computed if they were not.
   subroutine add_modal_loads(run, error)
      type(run_t), intent(inout) :: run
      type(error_t), allocatable, intent(out) :: error
      integer :: k

      if (.not. any(run%case%loads%kind == 'modal') .or. run%system%n_loads > size(run%scene%load_names)) return
      if (.not. allocated(run%modes%frequency)) call find_modes(run, error)
      if (allocated(error)) return
      do k = 1, size(run%case%loads)
         associate (load => run%case%loads(k))
            if (load%kind /= 'modal') cycle
            if (load%mode > size(run%modes%frequency)) then
               call bad_input(error, "load '"//trim(load%name)//"': mode "//to_text(load%mode)//' is asked for, but only ' &
                  & //to_text(size(run%modes%frequency))//' are retained')
               return
            end if
            call run%system%add_modal_load(run%modes%shape(:, load%mode))
            run%state%amplitude = [run%state%amplitude, 0.0_wp]
         end associate
      end do
      run%state%contact%q = [run%state%modal, run%state%amplitude]
   end subroutine add_modal_loads

end module microslip_cli_run
