!> Time integrations at the limits, judged by their energy books: two pads on six modes under an impact.
module support_stress_dynamics
   use microslip, only: transient_record_t
   use microslip_analysis_excitation, only: excitation_t, kind_half_sine
   use microslip_analysis_operating_state, only: operating_state_t
   use microslip_analysis_preload, only: preload_options_t, preload_record_t, run_preload
   use microslip_contact_factory, only: contact_options_t
   use microslip_contact_problem, only: new_state
   use microslip_core_error, only: error_t
   use microslip_core_kinds, only: wp
   use microslip_core_stopwatch, only: wall_time
   use microslip_fe_reduced_model, only: reduced_model_t
   use microslip_system_compliance_choice, only: compliance_fft
   use microslip_system_jointed_system, only: jointed_system_t
   use support_contact_verdict, only: verdict_t
   use support_history, only: history_t, integrate
   use support_joint, only: make_joint
   implicit none(type, external)
   private

   public :: motion_scene_t, motion_scenes, judge_motion

   !> s, length of the impact; index of its load.
   real(wp), parameter :: pulse = 5.0e-4_wp
   integer, parameter :: impact_load = 3

   type :: motion_scene_t
      character(len=:), allocatable :: name
      !> Time step over the stability limit
      real(wp) :: step_ratio = 0.37_wp
      integer :: steps = 400
      !> N, of each interface before the impact; 0: apart by `apart`
      real(wp) :: interface_force = 2210.0_wp
      !> m
      real(wp) :: apart = 0.0_wp
      !> Of the impact, and the friction coefficient
      real(wp) :: amplitude = 6400.0_wp, friction = 0.6_wp
      !> m, hills on the pads
      real(wp) :: hill = 4.0e-6_wp
      !> Error of the energy books over the largest kinetic energy that the time step excuses: the books see the contact at
      !> the ends of a step only, which is an error of second order in what moves fast
      real(wp) :: allowed = 0.05_wp
   end type motion_scene_t

   !> Friction that never lets go.
   real(wp), parameter :: sticky = 1.0e3_wp

contains

   !> Time steps about the limit, impacts, and a long run.
   function motion_scenes(short) result(scenes)
      logical, intent(in) :: short
      type(motion_scene_t), allocatable :: scenes(:)

      allocate (scenes(9))
      scenes(1)%name = 'time step 0.5 of the limit'
      scenes(2)%name = 'time step 0.74 of the limit'
      scenes(3)%name = 'time step 0.99 of the limit'
      scenes(4)%name = 'time step 1.01 of the limit'
      scenes(:4)%step_ratio = [0.5_wp, 0.74_wp, 0.99_wp, 1.01_wp]
      scenes(:3)%allowed = [0.05_wp, 0.1_wp, 0.5_wp]
      scenes(5)%name = 'thrown together from afar'
      scenes(5)%interface_force = 0.0_wp
      scenes(5)%apart = 2.0e-6_wp
      scenes(5:6)%amplitude = 6.4e5_wp
      scenes(6)%name = 'thrown together at step 1e-2'
      scenes(6)%interface_force = 0.0_wp
      scenes(6)%apart = 2.0e-6_wp
      scenes(6)%step_ratio = 1.0e-2_wp
      scenes(6)%steps = merge(2000, 20000, short)
      scenes(7)%name = 'blow of a thousandth'
      scenes(7)%amplitude = 6.4_wp
      scenes(8)%name = 'blow of a hundredfold'
      scenes(8)%amplitude = 6.4e5_wp
      scenes(9)%name = 'stuck for long'
      scenes(9)%friction = sticky
      scenes(9)%hill = 0.0_wp
      scenes(9)%amplitude = 1600.0_wp
      scenes(9)%steps = merge(20000, 10000000, short)
      ! Linear: nothing but rounding, which adds up like the root of the steps, or like the steps at worst.
      scenes(9)%allowed = 1.0e-14_wp*scenes(9)%steps
   end function motion_scenes

   !> Integrate with a solver; residual and books are those of the run's record.
   subroutine judge_motion(scene, solver, tolerance, max_iterations, verdict)
      type(motion_scene_t), intent(in) :: scene
      character(len=*), intent(in) :: solver
      real(wp), intent(in) :: tolerance
      integer, intent(in) :: max_iterations
      type(verdict_t), intent(out) :: verdict
      type(jointed_system_t) :: system
      type(operating_state_t) :: state
      type(history_t) :: history
      type(transient_record_t) :: record
      type(error_t), allocatable :: error
      real(wp) :: started

      call make_scene(scene, solver == 'matrix_free', system, state, error)
      if (.not. allocated(error)) then
         started = wall_time()
         call integrate(system, state, scene%step_ratio*2.0_wp/system%highest_angular_frequency(), scene%steps, &
            & [excitation_t(load=impact_load, kind=kind_half_sine, amplitude=scene%amplitude, duration=pulse)], &
            & contact_options_t(solver, tolerance, max_iterations), history, record, error, stride=max(1, scene%steps/100))
         verdict%seconds = wall_time() - started
      end if
      if (allocated(error)) then
         verdict%word = 'refused'
         verdict%message = error%message
         return
      end if
      verdict%steps = record%steps
      verdict%unconverged = record%unconverged
      verdict%residual = record%residual
      verdict%energy_error = record%balance_error
      if (record%unconverged > 0) then
         verdict%word = 'reported'
      else if (record%residual <= 1.0e3_wp*tolerance .and. record%balance_error <= scene%allowed) then
         verdict%word = 'holds'
      end if
   end subroutine judge_motion

   !> The system in its state before the impact.
   subroutine make_scene(scene, by_operator, system, state, error)
      type(motion_scene_t), intent(in) :: scene
      logical, intent(in) :: by_operator
      type(jointed_system_t), intent(out) :: system
      type(operating_state_t), intent(out) :: state
      type(error_t), allocatable, intent(out) :: error
      type(reduced_model_t) :: reduced
      type(preload_options_t) :: options
      type(preload_record_t) :: record
      character(len=*), parameter :: condensed = 'condensed', matrix_free = 'matrix_free'

      call make_joint(5, 3, scene%hill, reduced, system, error)
      if (allocated(error)) return
      system%pads%friction = scene%friction
      if (scene%friction >= sticky) system%damping = 0.0_wp
      if (by_operator) system%compliance = compliance_fft
      call system%restrict(spread(.true., 1, system%grid_point_count()), error)
      if (allocated(error)) return
      if (scene%interface_force > 0.0_wp) then
         options%loads = [1, 2]
         options%interface_force = spread(scene%interface_force, 1, 2)
         call run_preload(system, options, contact_options_t(trim(merge(matrix_free, condensed//'  ', by_operator)), &
            & 1.0e-10_wp), state, record, error)
         return
      end if
      system%problem%r_0(1::3) = system%problem%r_0(1::3) + scene%apart
      allocate (state%modal(system%n_modes), state%amplitude(system%n_loads), source=0.0_wp)
      state%contact = new_state(system%problem)
   end subroutine make_scene

end module support_stress_dynamics
