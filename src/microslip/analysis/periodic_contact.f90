!> Contact forces under a periodic motion: the time part of the alternating frequency-time scheme (METHOD section 7).
!>
!> The quasi-static contact is marched from the operating state through the samples of a period, period after period,
!> until the forces on the structure repeat. What they then are depends on the operating state only where points never
!> slip. A motion that corrects another one may be marched onward from where that one ended, which takes fewer periods. The
!> derivative of the last period's forces is that of the whole march (`contact_tangent_t`); from a long march, only its
!> first and last periods are used.
!>
!> Points that hardly slip forget the start slowly: the forces then change by a constant factor less from period to period.
!> With the change c of a period, over all of its samples, and that factor rho, later periods change them by
!> c rho/(1 - rho) in all; 2 c/(1 - rho) is taken for the bound, since the factor grows as fewer points slip. rho is
!> that of the ends of the periods, where the first period counts already, and of all samples, where it does not (it
!> begins with the virgin curve).
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

   !> What all later periods may still change the forces by, over their range.
   real(wp), parameter :: repeat_tolerance = 1.0e-9_wp
   !> First and last periods of a march that its derivative is made of: those between change little.
   integer, parameter :: kept_periods = 2
   !> Part of the forces themselves that a change of them may have by rounding: sums over the contact points, of which
   !> the solver keeps some for many steps.
   real(wp), parameter :: rounding = 64.0_wp*epsilon(1.0_wp)
   !> Samples of a period at which the points left out of the potential contact set are checked.
   integer, parameter :: checks = 8

   !> A march and its last period.
   type :: contact_cycle_t
      !> (modes, samples) R^T force, N per unit of the modal coordinate
      real(wp), allocatable :: reaction(:, :)
      !> (outputs, samples) contact forces' part of the sensors, m
      real(wp), allocatable :: output(:, :)
      !> (samples, 2 kept_periods) steps of the first and the last periods; the last ones take turns
      type(contact_step_t), allocatable :: steps(:, :)
      !> (points) whether a point was ever closed
      logical, allocatable :: closes(:)
      !> Periods marched, iterations of the contact solver
      integer :: periods = 0, iterations = 0
      !> Contact solves that did not converge
      integer :: unconverged = 0
      !> Bound of what later periods would still change the forces by, over their range
      real(wp) :: repeat_error = huge(1.0_wp)
      !> N per unit of the modal coordinate: largest change of the last period from the one before at its end, over all
      !> samples; bound of the changes still to come; what of these is rounding
      real(wp) :: last_change = huge(1.0_wp), change = huge(1.0_wp), remaining = huge(1.0_wp), noise = 0.0_wp
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
      procedure :: restart
      procedure :: jumps
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
      !> Whether a march has been accepted
      logical, public :: can_go_onward = .false.
      !> (points) points that were ever closed
      logical, allocatable :: closes(:)
   contains
      procedure :: set_up
      procedure :: begin
      procedure :: march_period
      procedure :: accept
      procedure :: derivative
   end type periodic_contact_t

contains

   !> Whether the forces repeat.
   pure logical function repeats(self)
      class(contact_cycle_t), intent(in) :: self
      repeats = self%repeat_error <= repeat_tolerance .and. self%unconverged == 0
   end function repeats

   !> Go on from here with other samples: a march of its own.
   subroutine restart(self)
      class(contact_cycle_t), intent(inout) :: self

      if (allocated(self%steps)) deallocate (self%steps)
      if (allocated(self%reaction)) deallocate (self%reaction, self%output)
      self%periods = 0
      self%repeat_error = huge(1.0_wp)
      self%last_change = huge(1.0_wp)
      self%change = huge(1.0_wp)
      self%remaining = huge(1.0_wp)
   end subroutine restart

   !> Change of the forces over the interval that ends at a sample, over their range, both taken over all modes.
   pure function jumps(self) result(jump)
      class(contact_cycle_t), intent(in) :: self
      real(wp) :: jump(size(self%reaction, 2))
      real(wp) :: range
      integer :: k, n

      n = size(jump)
      range = norm2(maxval(self%reaction, 2) - minval(self%reaction, 2))
      do k = 1, n
         jump(k) = norm2(self%reaction(:, k) - self%reaction(:, modulo(k - 2, n) + 1))
      end do
      ! Forces that do not change but for rounding do not jump.
      jump = jump/max(range, self%noise/repeat_tolerance, tiny(1.0_wp))
   end function jumps

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
      self%can_go_onward = .false.
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
   end subroutine begin

   !> Go on with a march by one period. With `added`, the points left out of the potential contact set are looked at on the
   !> way: where some would close, they join the system, and the operating state with it; the analysis must set up anew.
   subroutine march_period(self, system, q, cycle, added, error)
      class(periodic_contact_t), intent(inout) :: self
      type(jointed_system_t), intent(inout) :: system
      !> (drivers, samples) one period
      real(wp), intent(in) :: q(:, :)
      type(contact_cycle_t), intent(inout) :: cycle
      !> Number of points that joined: the march can not be gone on with
      integer, intent(out), optional :: added
      type(error_t), allocatable, intent(out), optional :: error
      type(contact_state_t) :: before
      type(solve_record_t) :: solved
      real(wp) :: range, change, last_change, largest, rate
      integer :: k, n, slot
      logical :: looks

      n = size(q, 2)
      looks = .false.
      if (present(added)) then
         added = 0
         looks = system%problem%n_points < system%grid_point_count()
      end if
      if (cycle%periods == 0) then
         allocate (cycle%reaction(system%n_modes, n), cycle%output(size(system%sensor_modal, 2), n), source=0.0_wp)
         allocate (cycle%steps(n, 2*kept_periods))
      end if
      slot = slot_of(cycle%periods + 1)
      change = 0.0_wp
      last_change = 0.0_wp
      cycle%counts = 0
      cycle%friction_loss = 0.0_wp
      do k = 1, n
         before = cycle%state
         call cycle%solver%advance(system%problem, q(:, k), cycle%state, solved)
         cycle%steps(k, slot) = new_step(system%problem, before, cycle%state)
         last_change = maxval(abs(solved%reaction(:system%n_modes) - cycle%reaction(:, k)))
         change = max(change, last_change)
         cycle%reaction(:, k) = solved%reaction(:system%n_modes)
         if (size(cycle%output) > 0) cycle%output(:, k) = solved%output
         cycle%closes = cycle%closes .or. cycle%state%status /= state_open
         cycle%counts = max(cycle%counts, solved%counts)
         cycle%friction_loss = cycle%friction_loss + solved%friction_loss
         cycle%iterations = cycle%iterations + solved%iterations
         cycle%set_changes = cycle%set_changes + solved%set_changes
         if (.not. solved%converged) cycle%unconverged = cycle%unconverged + 1
         if (.not. looks .or. mod(k, max(1, n/checks)) /= 0) cycle
         call cycle%solver%complete(system%problem, cycle%state)
         call system%widen_where_closed(q(:system%n_modes, k), cycle%state%force, q(system%n_modes + 1:, k), added, error)
         if (allocated(error) .or. added > 0) return
      end do
      cycle%periods = cycle%periods + 1
      self%closes = self%closes .or. cycle%closes
      largest = maxval(abs(cycle%reaction))
      cycle%noise = rounding*largest
      if (cycle%periods == 1) return
      range = maxval(maxval(cycle%reaction, 2) - minval(cycle%reaction, 2)) + cycle%noise/repeat_tolerance
      rate = 0.0_wp
      if (cycle%periods > 2) rate = last_change/max(cycle%last_change, cycle%noise, tiny(1.0_wp))
      if (cycle%periods > 3) rate = max(rate, change/max(cycle%change, tiny(1.0_wp)))
      cycle%last_change = last_change
      cycle%change = change
      cycle%remaining = huge(1.0_wp)
      if (change <= cycle%noise) then
         cycle%remaining = change
      else if (rate < 1.0_wp) then
         cycle%remaining = 2.0_wp*change/(1.0_wp - rate)
      end if
      cycle%repeat_error = min(cycle%remaining, largest)/max(range, tiny(1.0_wp))
   end subroutine march_period

   !> Where the steps of a period of a march are kept.
   pure integer function slot_of(period)
      integer, intent(in) :: period
      slot_of = period
      if (period > kept_periods) slot_of = kept_periods + 1 + modulo(period - 1, kept_periods)
   end function slot_of

   !> Keep where a march ended: the next ones may go onward from there. The march itself can not be gone on with.
   subroutine accept(self, cycle)
      class(periodic_contact_t), intent(inout) :: self
      type(contact_cycle_t), intent(inout) :: cycle

      if (.not. allocated(cycle%solver)) return
      self%accepted = cycle%state
      call move_alloc(cycle%solver, self%accepted_solver)
      self%can_go_onward = .true.
   end subroutine accept

   !> Derivative of the Fourier coefficients of the last period's forces by those of the motion:
   !> rows and columns (driver, coefficient), the drivers being the modes, and a load if there is one.
   subroutine derivative(self, system, fourier, cycle, load, J, error)
      class(periodic_contact_t), intent(inout) :: self
      type(jointed_system_t), intent(in) :: system
      type(fourier_t), intent(in) :: fourier
      type(contact_cycle_t), intent(in) :: cycle
      !> A load whose amplitude is one more driver, 0: none
      integer, intent(in) :: load
      real(wp), intent(out) :: J(:, :)
      type(error_t), allocatable, intent(out) :: error
      type(contact_step_t), allocatable :: steps(:)
      real(wp), allocatable :: basis(:, :), weight(:, :)
      integer, allocatable :: drivers(:)
      integer :: j_period, k, n, periods

      drivers = [(k, k=1, system%n_modes)]
      if (load > 0) drivers = [drivers, system%n_modes + load]
      if (.not. self%tangent%covers(cycle%closes, drivers)) &
         & call self%tangent%set_up(system%problem, self%closes, drivers, error)
      if (allocated(error)) return
      n = fourier%samples
      periods = min(cycle%periods, 2*kept_periods)
      allocate (steps(n*periods), basis(size(fourier%basis, 1), n*periods))
      do k = 1, periods
         j_period = k
         if (k > kept_periods) j_period = cycle%periods - periods + k
         steps((k - 1)*n + 1:k*n) = cycle%steps(:, slot_of(j_period))
         basis(:, (k - 1)*n + 1:k*n) = fourier%basis
      end do
      allocate (weight, mold=basis)
      weight = 0.0_wp
      weight(:, size(steps) - n + 1:) = fourier%projection
      call self%tangent%path_derivative(steps, basis, weight, J, error)
   end subroutine derivative

end module microslip_analysis_periodic_contact
