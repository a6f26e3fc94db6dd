!> Contact forces under a periodic motion: the time part of the alternating frequency-time scheme (METHOD section 7).
!>
!> The quasi-static contact is marched from the operating state through the samples of a period, period after period,
!> until the forces on the structure repeat. What they then are depends on the operating state only where points never
!> slip. A motion that corrects another one may be marched onward from where that one ended, which takes fewer periods. The
!> derivative of the last period's forces is that of the whole march (`contact_tangent_t`); from a long march, only its
!> first and last periods are used.
module microslip_analysis_periodic_contact
   use microslip_analysis_fourier, only: fourier_t
   use microslip_analysis_operating_state, only: operating_state_t
   use microslip_contact_condensed, only: condensed_solver_t
   use microslip_contact_factory, only: contact_options_t, new_contact_solver
   use microslip_contact_laws, only: state_open
   use microslip_contact_problem, only: contact_solver_t, contact_state_t, solve_record_t
   use microslip_contact_tangent, only: contact_step_t, contact_tangent_t, new_step
   use microslip_core_error, only: error_t, failure
   use microslip_core_kinds, only: wp
   use microslip_system_jointed_system, only: jointed_system_t
   implicit none(type, external)
   private

   public :: periodic_contact_t, contact_cycle_t

   !> Largest change of the forces from the end of one period to the next, over their range.
   real(wp), parameter :: repeat_tolerance = 1.0e-9_wp
   !> First and last periods of a march that its derivative is made of: those between change little.
   integer, parameter :: kept_periods = 2
   !> Part of the forces themselves that a change of them may have by rounding.
   real(wp), parameter :: rounding = 1.0e-13_wp
   !> Samples of a period at which the points left out of the potential contact set are checked.
   integer, parameter :: checks = 8

   !> A march and its last period.
   type :: contact_cycle_t
      !> (modes, samples) R^T force, N per unit of the modal coordinate
      real(wp), allocatable :: reaction(:, :)
      !> (outputs, samples) contact forces' part of the sensors, m
      real(wp), allocatable :: output(:, :)
      !> All steps of the march
      type(contact_step_t), allocatable :: steps(:)
      !> (points) whether a point was ever closed
      logical, allocatable :: closes(:)
      !> Periods marched, iterations of the contact solver
      integer :: periods = 0, iterations = 0
      !> Contact solves that did not converge
      integer :: unconverged = 0
      !> How far the forces are from repeating, over their range
      real(wp) :: repeat_error = huge(1.0_wp)
      !> The same as it is: what they changed by over the last period
      real(wp) :: last_change = huge(1.0_wp)
      !> Most points that were open, stuck, slipped in one sample of the last period
      integer :: counts(3) = 0
      !> J, friction loss of the last period
      real(wp) :: friction_loss = 0.0_wp
      !> Points that joined or left the solver's base set
      integer :: set_changes = 0
      !> Contact and its solver at the end
      type(contact_state_t) :: state
      class(contact_solver_t), allocatable :: solver
   contains
      procedure :: repeats
   end type contact_cycle_t

   type :: periodic_contact_t
      private
      !> The operating state, and the solver ready to march from there
      type(contact_state_t) :: start
      class(contact_solver_t), allocatable :: solver
      !> The end of the march that was accepted last
      type(contact_state_t) :: accepted
      class(contact_solver_t), allocatable :: accepted_solver
      type(contact_tangent_t) :: tangent
      !> (points) points that were ever closed
      logical, allocatable :: closes(:)
   contains
      procedure :: set_up
      procedure :: begin
      procedure :: march_period
      procedure :: accept
      procedure :: derivative
      procedure :: check_left_out
   end type periodic_contact_t

contains

   !> Whether the forces repeat.
   pure logical function repeats(self)
      class(contact_cycle_t), intent(in) :: self
      repeats = self%repeat_error <= repeat_tolerance .and. self%unconverged == 0
   end function repeats

   !> Prepare the contact solver at the operating state.
   subroutine set_up(self, system, operating, options, error)
      class(periodic_contact_t), intent(inout) :: self
      type(jointed_system_t), intent(in) :: system
      type(operating_state_t), intent(in) :: operating
      type(contact_options_t), intent(in) :: options
      type(error_t), allocatable, intent(out) :: error

      if (.not. allocated(system%problem%G)) then
         call failure(error, "periodic motions need the contact compliance as a matrix: compliance = 'dense' in &contact")
         return
      end if
      self%start = operating%contact
      self%closes = self%start%status /= state_open
      self%tangent = contact_tangent_t()
      if (allocated(self%solver)) deallocate (self%solver)
      if (allocated(self%accepted_solver)) deallocate (self%accepted_solver)
      call new_contact_solver(options, self%solver, error)
      if (allocated(error)) return
      self%solver%lazy = .true.
      call self%solver%start(system%problem, self%start, error)
   end subroutine set_up

   !> Begin a march: from the operating state, or onward from where the one that was accepted last ended.
   subroutine begin(self, onward, cycle)
      class(periodic_contact_t), intent(in) :: self
      logical, intent(in) :: onward
      type(contact_cycle_t), intent(out) :: cycle

      if (onward .and. allocated(self%accepted_solver)) then
         cycle%state = self%accepted
         cycle%solver = self%accepted_solver
      else
         cycle%state = self%start
         cycle%solver = self%solver
      end if
      cycle%closes = cycle%state%status /= state_open
      allocate (cycle%steps(0))
   end subroutine begin

   !> Go on with a march by one period.
   subroutine march_period(self, system, q, cycle)
      class(periodic_contact_t), intent(inout) :: self
      type(jointed_system_t), intent(in) :: system
      !> (drivers, samples) one period
      real(wp), intent(in) :: q(:, :)
      type(contact_cycle_t), intent(inout) :: cycle
      type(contact_state_t) :: before
      type(solve_record_t) :: solved
      real(wp) :: last(system%n_modes), range
      integer :: k, n

      n = size(q, 2)
      if (cycle%periods == 0) allocate (cycle%reaction(system%n_modes, n), &
         & cycle%output(size(system%sensor_modal, 2), n), source=0.0_wp)
      last = cycle%reaction(:, n)
      cycle%counts = 0
      cycle%friction_loss = 0.0_wp
      call extend(cycle%steps, n)
      do k = 1, n
         before = cycle%state
         call cycle%solver%advance(system%problem, q(:, k), cycle%state, solved)
         cycle%steps(cycle%periods*n + k) = new_step(system%problem, before, cycle%state)
         cycle%reaction(:, k) = solved%reaction(:system%n_modes)
         if (size(cycle%output) > 0) cycle%output(:, k) = solved%output
         cycle%closes = cycle%closes .or. cycle%state%status /= state_open
         cycle%counts = max(cycle%counts, solved%counts)
         cycle%friction_loss = cycle%friction_loss + solved%friction_loss
         cycle%iterations = cycle%iterations + solved%iterations
         cycle%set_changes = cycle%set_changes + solved%set_changes
         if (.not. solved%converged) cycle%unconverged = cycle%unconverged + 1
      end do
      cycle%periods = cycle%periods + 1
      self%closes = self%closes .or. cycle%closes
      if (cycle%periods == 1) return
      range = maxval(maxval(cycle%reaction, 2) - minval(cycle%reaction, 2)) &
         & + rounding/repeat_tolerance*maxval(abs(cycle%reaction))
      cycle%last_change = maxval(abs(cycle%reaction(:, n) - last))
      cycle%repeat_error = cycle%last_change/max(range, tiny(1.0_wp))
   end subroutine march_period

   !> Keep where a march ended: the next ones may go onward from there. The march itself can not be gone on with.
   subroutine accept(self, cycle)
      class(periodic_contact_t), intent(inout) :: self
      type(contact_cycle_t), intent(inout) :: cycle

      if (.not. allocated(cycle%solver)) return
      self%accepted = cycle%state
      call move_alloc(cycle%solver, self%accepted_solver)
   end subroutine accept

   !> Room for so many more steps.
   pure subroutine extend(steps, more)
      type(contact_step_t), allocatable, intent(inout) :: steps(:)
      integer, intent(in) :: more
      type(contact_step_t), allocatable :: longer(:)

      allocate (longer(size(steps) + more))
      longer(:size(steps)) = steps
      call move_alloc(longer, steps)
   end subroutine extend

   !> Derivative of the Fourier coefficients of the last period's forces by those of the motion:
   !> rows and columns (mode, coefficient).
   subroutine derivative(self, system, fourier, cycle, J, error)
      class(periodic_contact_t), intent(inout) :: self
      type(jointed_system_t), intent(in) :: system
      type(fourier_t), intent(in) :: fourier
      type(contact_cycle_t), intent(in) :: cycle
      real(wp), intent(out) :: J(:, :)
      type(error_t), allocatable, intent(out) :: error
      real(wp), allocatable :: basis(:, :), weight(:, :)
      integer, allocatable :: kept(:)
      integer :: k, n

      if (.not. self%tangent%covers(cycle%closes)) call self%tangent%set_up(system%problem, self%closes, system%n_modes, error)
      if (allocated(error)) return
      n = fourier%samples
      kept = [(k, k=1, size(cycle%steps))]
      kept = pack(kept, kept <= kept_periods*n .or. kept > (cycle%periods - kept_periods)*n)
      basis = fourier%basis(:, [(modulo(kept(k) - 1, n) + 1, k=1, size(kept))])
      allocate (weight, mold=basis)
      weight = 0.0_wp
      weight(:, size(kept) - n + 1:) = fourier%projection
      call self%tangent%path_derivative(cycle%steps(kept), basis, weight, J, error)
   end subroutine derivative

   !> March a further period and look at the points left out of the potential contact set. Where some would close,
   !> they join the system, and the operating state with it: the analysis must set up anew.
   subroutine check_left_out(self, system, q, cycle, added, error)
      class(periodic_contact_t), intent(in) :: self
      type(jointed_system_t), intent(inout) :: system
      !> (drivers, samples)
      real(wp), intent(in) :: q(:, :)
      type(contact_cycle_t), intent(inout) :: cycle
      !> Number of points that joined
      integer, intent(out) :: added
      type(error_t), allocatable, intent(out) :: error
      type(solve_record_t) :: solved
      integer :: k

      added = 0
      if (system%problem%n_points == system%grid_point_count()) return
      do k = 1, size(q, 2)
         call cycle%solver%advance(system%problem, q(:, k), cycle%state, solved)
         if (mod(k, max(1, size(q, 2)/checks)) /= 0) cycle
         call cycle%solver%complete(system%problem, cycle%state)
         call system%widen_where_closed(q(:system%n_modes, k), cycle%state%force, q(system%n_modes + 1:, k), added, error)
         if (allocated(error) .or. added > 0) return
      end do
   end subroutine check_left_out

end module microslip_analysis_periodic_contact
