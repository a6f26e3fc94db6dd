!> For tests of periodic motions: a preloaded joint, an oscillator with one dry-friction element, and a recorder.
module support_periodic
   use microslip_analysis_operating_state, only: operating_state_t
   use microslip_analysis_preload, only: preload_options_t, preload_record_t, run_preload
   use microslip_analysis_response_point, only: response_point_t, response_recorder_t
   use microslip_contact_factory, only: contact_options_t
   use microslip_contact_laws, only: state_stick
   use microslip_contact_problem, only: new_state
   use microslip_core_error, only: error_t
   use microslip_core_kinds, only: wp
   use microslip_fe_reduced_model, only: reduced_model_t
   use microslip_system_jointed_system, only: jointed_system_t
   use support_joint, only: make_joint
   implicit none(type, external)
   private

   public :: make_preloaded, make_jenkins, condensed, collector_t

   !> Keeps the points.
   type, extends(response_recorder_t) :: collector_t
      type(response_point_t), allocatable :: points(:)
   contains
      procedure :: record
   end type collector_t

contains

   !> The condensed solver, exact.
   function condensed() result(options)
      type(contact_options_t) :: options
      options%solver = 'condensed'
      options%tolerance = 1.0e-12_wp
   end function condensed

   !> A preloaded joint, all grid points in potential contact.
   subroutine make_preloaded(cells, peak_to_peak, friction, system, state, lib)
      integer, intent(in) :: cells(2)
      !> m, of the hills
      real(wp), intent(in) :: peak_to_peak, friction
      type(jointed_system_t), intent(out) :: system
      type(operating_state_t), intent(out) :: state
      type(error_t), allocatable, intent(out) :: lib
      type(reduced_model_t) :: reduced
      type(preload_options_t) :: options
      type(preload_record_t) :: record

      call make_joint(cells(1), cells(2), peak_to_peak, reduced, system, lib)
      if (allocated(lib)) return
      system%pads%friction = friction
      call system%restrict(spread(.true., 1, system%grid_point_count()), lib)
      if (allocated(lib)) return
      options%loads = [1, 2]
      options%interface_force = [2210.0_wp, 2210.0_wp]
      call run_preload(system, options, condensed(), state, record, lib)
   end subroutine make_preloaded

   !> One mode of unit mass on a spring, and like friction elements in parallel: springs in series with sliders.
   !> Load 1 acts on the mode, its displacement is sensor 1.
   subroutine make_jenkins(spring, damping, element_spring, element_limit, system, state, lib)
      !> 1/s^2 and 1/s
      real(wp), intent(in) :: spring, damping
      !> N/m and N, of all elements together
      real(wp), intent(in) :: element_spring, element_limit
      type(jointed_system_t), intent(out) :: system
      type(operating_state_t), intent(out) :: state
      type(error_t), allocatable, intent(out) :: lib
      type(reduced_model_t) :: reduced
      real(wp) :: normal
      integer :: k
      integer, parameter :: points = 4

      call make_joint(2, 1, 0.0_wp, reduced, system, lib)
      if (.not. allocated(lib)) call system%restrict(spread(.true., 1, points), lib)
      if (allocated(lib)) return
      system%n_modes = 1
      system%n_loads = 1
      system%stiffness = reshape([spring], [1, 1])
      system%damping = [damping]
      system%held = [0.0_wp]
      system%imposed = [.false.]
      system%load_modal = reshape([1.0_wp], [1, 1])
      system%load_load = reshape([0.0_wp], [1, 1])
      system%sensor_modal = reshape([1.0_wp], [1, 1])
      system%sensor_load = reshape([0.0_wp], [1, 1])
      associate (problem => system%problem)
         problem%friction = 0.5_wp
         problem%G = 0.0_wp
         do k = 1, 3*points
            problem%G(k, k) = points/element_spring
         end do
         deallocate (problem%R, problem%outputs)
         allocate (problem%R(3*points, 2), problem%outputs(3*points, 1), source=0.0_wp)
         problem%R(2::3, 1) = 1.0_wp
         ! Each element's normal force: its share of the limit over the friction coefficient.
         normal = element_limit/(points*problem%friction(1))
         problem%r_0 = 0.0_wp
         problem%r_0(1::3) = -problem%G(1, 1)*normal
         state%modal = [0.0_wp]
         state%amplitude = [0.0_wp]
         state%contact = new_state(problem)
         state%contact%status = state_stick
         state%contact%force(1, :) = normal
         state%contact%gap(1, :) = 0.0_wp
      end associate
   end subroutine make_jenkins

   subroutine record(self, point, error)
      class(collector_t), intent(inout) :: self
      type(response_point_t), intent(in) :: point
      type(error_t), allocatable, intent(out) :: error
      type(response_point_t), allocatable :: longer(:)
      integer :: n

      if (allocated(error)) return
      n = 0
      if (allocated(self%points)) n = size(self%points)
      allocate (longer(n + 1))
      if (n > 0) longer(:n) = self%points
      longer(n + 1) = point
      call move_alloc(longer, self%points)
   end subroutine record

end module support_periodic
