!> Settling: a sequence of half-sine impacts, the contact keeping its memory from one to the next (paper section 3.5).
!>
!> The residual state after an impact is the mean over the last periods before the next one: of the contact forces, whose
!> slip ratio |mean lambda_t|/(mu mean lambda_n) is at most 1 (the friction cone is convex), of the tangential displacement
!> and of the sensors. Sixteen samples of a period give the means of all that has fewer than sixteen harmonics.
!> On the way, the largest slip ratio is 1 where a point slipped in any step, and else the largest at the checks of the
!> transient, which is where the motion turns; the largest slip, from the residual state before the impact, likewise.
!>
!> In the end the inertia forces are taken away: with d the motion's last displacement and e = d - Khat^-1 (f + R^T lambda),
!>     gap = r_0 + R Khat^-1 f + (G + R Khat^-1 R^T) lambda + R e s,    s from 1 to 0,
!> a static path from the last contact state to an equilibrium, which the next analysis can start from.
module microslip_analysis_settling
   use, intrinsic :: ieee_arithmetic, only: ieee_quiet_nan, ieee_value
   use microslip_analysis_excitation, only: excitation_t, kind_half_sine
   use microslip_analysis_free_motion, only: free_motion_t
   use microslip_analysis_operating_state, only: operating_state_t
   use microslip_analysis_potential_set, only: carry_over, potential_points
   use microslip_analysis_statics, only: static_problem
   use microslip_analysis_transient, only: run_transient, sample_t, transient_options_t, transient_record_t, &
      & transient_recorder_t
   use microslip_contact_factory, only: contact_options_t, new_contact_solver
   use microslip_contact_laws, only: state_open
   use microslip_contact_problem, only: contact_problem_t, contact_solver_t, contact_state_t, gap_of, solve_record_t
   use microslip_core_archive, only: archive_t
   use microslip_core_error, only: error_t, failure
   use microslip_core_kinds, only: wp
   use microslip_core_stopwatch, only: stopwatch_t
   use microslip_core_text, only: to_text
   use microslip_system_jointed_system, only: jointed_system_t
   implicit none(type, external)
   private

   public :: settling_options_t, settling_record_t, residual_t, run_settling

   !> Samples of a period that the means are made of; steps of the way to rest.
   integer, parameter :: samples_of_period = 16, rest_steps = 10

   type :: settling_options_t
      !> Index of the load in the system
      integer :: load = 0
      !> (impacts) factors on the load pattern
      real(wp), allocatable :: amplitude(:)
      !> s, of an impact, from one to the next, and of the vibration
      real(wp) :: duration = 0.0_wp, interval = 0.0_wp, period = 0.0_wp
      !> How many periods before the next impact count
      integer :: periods = 10
      !> s
      real(wp) :: time_step = 0.0_wp
      !> Every `stride`-th step is recorded
      integer :: stride = 1
      !> Steps between two restart points
      integer :: restart_stride = 20000
   end type settling_options_t

   !> What an impact left behind, and what happened during it. Fields on the grid points of all pads; NaN where a point
   !> carries no force, or where its tangential displacement is not known because it was open.
   type :: residual_t
      !> (sensors) m
      real(wp), allocatable :: sensor(:)
      !> (grid points)
      real(wp), allocatable :: slip_ratio(:), largest_slip_ratio(:)
      !> (2, grid points) along t1, t2 since the start of the settling, m; (grid points) since before this impact, m
      real(wp), allocatable :: slip(:, :), largest_slip(:)
   end type residual_t

   !> How it went.
   type :: settling_record_t
      !> (0:impacts) 0: before the first one
      type(residual_t), allocatable :: after(:)
      type(transient_record_t) :: transient
      !> Of the way to rest: residual and estimated error of the contact forces, over the largest
      real(wp) :: residual = 0.0_wp, error_estimate = 0.0_wp
   end type settling_record_t

   !> Sums up what the time integration tells, and hands it on.
   type, extends(transient_recorder_t) :: settling_recorder_t
      class(transient_recorder_t), pointer :: onward => null()
      !> Snapshots after an impact, and impacts whose residual state is known
      integer :: wanted = 0, impacts = 0
      type(residual_t), allocatable :: after(:)
      !> Snapshots so far
      integer :: taken = 0
      !> (sensors), (3, grid points) and (2, grid points): sums over the snapshots
      real(wp), allocatable :: sensor(:), force(:, :), slip(:, :)
      !> (grid points) whether the tangential displacement was known in all snapshots, and at the start
      logical, allocatable :: known(:), known_at_start(:)
      !> (2, grid points) tangential displacement at the start, and before the impact
      real(wp), allocatable :: start(:, :), before(:, :)
      logical, allocatable :: known_before(:)
      !> (grid points) since the residual state before; negative: never closed
      real(wp), allocatable :: largest_slip_ratio(:), largest_slip(:)
      !> The contact at the last check
      type(contact_state_t) :: last
   contains
      procedure :: record
      procedure :: snapshot
      procedure :: progress
      procedure :: verified
      procedure :: restart_point
   end type settling_recorder_t

contains

   !> Run the impacts, or go on from a restart point; the state becomes the equilibrium that they end in.
   subroutine run_settling(system, state, options, contact_options, onward, clock, record, error, point)
      !> Its potential contact set may grow
      type(jointed_system_t), intent(inout) :: system
      !> Equilibrium to start from, equilibrium in the end
      type(operating_state_t), intent(inout) :: state
      type(settling_options_t), intent(in) :: options
      type(contact_options_t), intent(in) :: contact_options
      !> Who takes the time series
      class(transient_recorder_t), intent(inout), target :: onward
      !> Running; the time integration books its stages
      type(stopwatch_t), intent(inout) :: clock
      type(settling_record_t), intent(out) :: record
      type(error_t), allocatable, intent(out) :: error
      !> Of the same run, as `onward` was given it
      integer, intent(in), optional :: point(:)
      type(settling_recorder_t) :: recorder
      logical, allocatable :: before(:)

      if (options%periods*options%period > options%interval - options%duration) then
         call failure(error, 'settling: '//to_text(options%periods)//' periods of '//to_text(options%period, 4)// &
            & ' s do not fit between two impacts')
         return
      end if
      recorder%onward => onward
      recorder%wanted = samples_of_period*options%periods
      allocate (recorder%after(0:size(options%amplitude)))
      call begin(recorder, system, state)
      before = potential_points(system)
      call run_transient(system, state, transient_of(options), contact_options, recorder, clock, record%transient, error, &
         & point)
      allocate (record%after(0:recorder%impacts))
      record%after = recorder%after(:recorder%impacts)
      if (record%transient%points_added > 0) call carry_over(system, before, state%contact)
      if (allocated(error)) return
      if (record%transient%unconverged > 0) then
         call failure(error, 'settling: '//to_text(record%transient%unconverged)//' of '// &
            & to_text(record%transient%steps)//' steps did not converge')
         return
      end if
      call come_to_rest(system, recorder%last, contact_options, state, record, error)
   end subroutine run_settling

   !> The time integration with all impacts, and snapshots where the means are taken.
   pure function transient_of(options) result(transient)
      type(settling_options_t), intent(in) :: options
      type(transient_options_t) :: transient
      integer :: k, j, n

      n = samples_of_period*options%periods
      transient%duration = size(options%amplitude)*options%interval
      transient%time_step = options%time_step
      transient%stride = options%stride
      transient%restart_stride = options%restart_stride
      allocate (transient%excitations(size(options%amplitude)))
      do k = 1, size(options%amplitude)
         transient%excitations(k) = excitation_t(load=options%load, kind=kind_half_sine, amplitude=options%amplitude(k), &
            & start=(k - 1)*options%interval, duration=options%duration)
      end do
      transient%snapshots = [((k*options%interval - (n - j + 0.5_wp)*options%period/samples_of_period, j=1, n), &
         & k=1, size(options%amplitude))]
   end function transient_of

   !> Row of every point in potential contact among the grid points of all pads, (points).
   pure function grid_rows(system) result(rows)
      type(jointed_system_t), intent(in) :: system
      integer :: rows(system%problem%n_points)
      integer :: p
      rows = pack([(p, p=1, system%grid_point_count())], potential_points(system))
   end function grid_rows

   !> The state before the first impact.
   subroutine begin(recorder, system, state)
      type(settling_recorder_t), intent(inout) :: recorder
      type(jointed_system_t), intent(in) :: system
      type(operating_state_t), intent(in) :: state
      integer :: n

      n = system%grid_point_count()
      allocate (recorder%force(3, n), recorder%slip(2, n), recorder%start(2, n), recorder%before(2, n), &
         & recorder%largest_slip_ratio(n), recorder%largest_slip(n), source=0.0_wp)
      allocate (recorder%sensor(size(system%sensor_modal, 2)), source=0.0_wp)
      allocate (recorder%known(n), recorder%known_at_start(n), recorder%known_before(n), source=.true.)
      call add_state(recorder, system, state%contact)
      recorder%start = recorder%slip
      recorder%before = recorder%slip
      recorder%known_at_start = recorder%known
      recorder%known_before = recorder%known
      call recorder%verified(system, state%contact, spread(.false., 1, system%problem%n_points))
      call close_impact(recorder, system, 0)
   end subroutine begin

   !> Add a contact state to the sums.
   subroutine add_state(self, system, contact)
      class(settling_recorder_t), intent(inout) :: self
      type(jointed_system_t), intent(in) :: system
      type(contact_state_t), intent(in) :: contact
      logical :: closed(size(self%known))
      integer, allocatable :: rows(:)

      rows = grid_rows(system)
      closed = .false.
      closed(rows) = contact%status /= state_open
      self%known = self%known .and. closed
      self%force(:, rows) = self%force(:, rows) + contact%force
      self%slip(:, rows) = self%slip(:, rows) + contact%gap(2:3, :)
      associate (n => system%n_modes)
         self%sensor = self%sensor + system%sensor_values(contact%q(:n), contact%force, contact%q(n + 1:))
      end associate
      self%taken = self%taken + 1
   end subroutine add_state

   !> Means of an impact; the sums become zero.
   subroutine close_impact(self, system, impact)
      class(settling_recorder_t), intent(inout) :: self
      type(jointed_system_t), intent(in) :: system
      integer, intent(in) :: impact
      real(wp) :: nan
      real(wp), allocatable :: friction(:)
      integer :: k, p

      nan = ieee_value(1.0_wp, ieee_quiet_nan)
      friction = [(spread(system%pads(k)%friction, 1, system%pads(k)%grid%point_count()), k=1, size(system%pads))]
      self%slip = self%slip/self%taken
      associate (after => self%after(impact), n => size(friction))
         after%sensor = self%sensor/self%taken
         allocate (after%slip_ratio(n), after%largest_slip_ratio(n), after%largest_slip(n), after%slip(2, n), source=nan)
         do p = 1, n
            if (friction(p)*self%force(1, p) > 0.0_wp) &
               & after%slip_ratio(p) = norm2(self%force(2:3, p))/(friction(p)*self%force(1, p))
            if (self%known(p) .and. self%known_at_start(p)) after%slip(:, p) = self%slip(:, p) - self%start(:, p)
            if (self%largest_slip_ratio(p) >= 0.0_wp) after%largest_slip_ratio(p) = self%largest_slip_ratio(p)
            if (self%largest_slip(p) >= 0.0_wp) after%largest_slip(p) = self%largest_slip(p)
         end do
      end associate
      self%impacts = impact
      self%before = self%slip
      self%known_before = self%known
      self%known = .true.
      self%taken = 0
      self%force = 0.0_wp
      self%slip = 0.0_wp
      self%sensor = 0.0_wp
      self%largest_slip_ratio = -1.0_wp
      self%largest_slip = -1.0_wp
   end subroutine close_impact

   !> Hand on.
   subroutine record(self, samples, error)
      class(settling_recorder_t), intent(inout) :: self
      type(sample_t), intent(in) :: samples(:)
      type(error_t), allocatable, intent(out) :: error
      call self%onward%record(samples, error)
   end subroutine record

   !> A sample of the residual state.
   subroutine snapshot(self, system, time, contact, error)
      class(settling_recorder_t), intent(inout) :: self
      type(jointed_system_t), intent(in) :: system
      real(wp), intent(in) :: time
      type(contact_state_t), intent(in) :: contact
      type(error_t), allocatable, intent(out) :: error

      call add_state(self, system, contact)
      if (self%taken == self%wanted) call close_impact(self, system, self%impacts + 1)
   end subroutine snapshot

   !> Hand on.
   subroutine progress(self, time, counts)
      class(settling_recorder_t), intent(inout) :: self
      real(wp), intent(in) :: time
      integer, intent(in) :: counts(3)
      call self%onward%progress(time, counts)
   end subroutine progress

   !> The sums and the impacts so far.
   subroutine restart_point(self, archive, error)
      class(settling_recorder_t), intent(inout) :: self
      type(archive_t), intent(inout) :: archive
      type(error_t), allocatable, intent(out) :: error
      integer :: k

      call archive%pass(self%impacts)
      do k = 1, min(self%impacts, ubound(self%after, 1))
         associate (after => self%after(k))
            call archive%pass(after%sensor)
            call archive%pass(after%slip_ratio)
            call archive%pass(after%largest_slip_ratio)
            call archive%pass(after%slip)
            call archive%pass(after%largest_slip)
         end associate
      end do
      call archive%pass(self%taken)
      call archive%pass(self%sensor)
      call archive%pass(self%force)
      call archive%pass(self%slip)
      call archive%pass(self%known)
      call archive%pass(self%before)
      call archive%pass(self%known_before)
      call archive%pass(self%largest_slip_ratio)
      call archive%pass(self%largest_slip)
      call self%last%pass(archive)
      call self%onward%restart_point(archive, error)
   end subroutine restart_point

   !> The largest slip ratio and slip up to here.
   subroutine verified(self, system, contact, slipped)
      class(settling_recorder_t), intent(inout) :: self
      type(jointed_system_t), intent(in) :: system
      type(contact_state_t), intent(in) :: contact
      logical, intent(in) :: slipped(:)
      integer, allocatable :: rows(:)
      real(wp) :: limit
      integer :: p

      self%last = contact
      rows = grid_rows(system)
      do p = 1, size(rows)
         associate (ratio => self%largest_slip_ratio(rows(p)), slip => self%largest_slip(rows(p)))
            limit = system%problem%friction(p)*contact%force(1, p)
            if (limit > 0.0_wp) ratio = max(ratio, norm2(contact%force(2:3, p))/limit)
            if (slipped(p)) ratio = max(ratio, 1.0_wp)
            if (contact%status(p) /= state_open .and. self%known_before(rows(p))) &
               & slip = max(slip, norm2(contact%gap(2:3, p) - self%before(:, rows(p))))
         end associate
      end do
   end subroutine verified

   !> Take the inertia forces away.
   subroutine come_to_rest(system, last, contact_options, state, record, error)
      type(jointed_system_t), intent(in) :: system
      !> The contact in motion
      type(contact_state_t), intent(in) :: last
      type(contact_options_t), intent(in) :: contact_options
      !> Its loads are held
      type(operating_state_t), intent(inout) :: state
      type(settling_record_t), intent(inout) :: record
      type(error_t), allocatable, intent(out) :: error
      class(contact_solver_t), allocatable :: solver
      type(contact_problem_t) :: problem
      type(solve_record_t) :: solved
      type(free_motion_t) :: free
      real(wp), allocatable :: response(:, :), held(:), gap(:, :), rest(:), anchor(:)
      integer :: k, m, n

      m = system%n_loads
      n = 3*system%problem%n_points
      call static_problem(system, [(k, k=1, m)], problem, response, error, free=free)
      if (allocated(error)) return
      held = matmul(response(:, :m), state%amplitude)
      state%contact = last
      state%contact%q = [1.0_wp]
      rest = last%q(:system%n_modes) - held - matmul(response(:, m + 1:), reshape(last%force, [n]))
      if (free%count > 0) then
         ! The anchors begin where the structure is.
         anchor = matmul(last%q(:system%n_modes), free%shape)
         rest = rest - matmul(free%shape, anchor)
         state%contact%q = [1.0_wp, anchor]
         free%constant = matmul(matmul(system%load_modal, state%amplitude), free%shape)
         free%load = reshape(free%spring*matmul(rest, free%shape), [free%count, 1])
         free%reference = 0.0_wp
      end if
      problem%R = reshape([matmul(system%problem%R(:, :system%n_modes), rest), problem%R(:, m + 1:)], [n, 1 + free%count])
      problem%r_0 = 0.0_wp
      problem%r_0 = reshape(last%gap - gap_of(problem, state%contact%q, last%force), [n])
      call new_contact_solver(contact_options, solver, error)
      if (.not. allocated(error)) call solver%start(problem, state%contact, error)
      if (allocated(error)) return
      do k = rest_steps - 1, 0, -1
         call free%advance(problem, solver, [real(k, wp)/rest_steps], state%contact, solved)
         record%residual = max(record%residual, solved%residual)
         record%error_estimate = max(record%error_estimate, solved%error_estimate)
         if (solved%converged) cycle
         call failure(error, 'settling: the contact did not converge on the way to rest (residual '// &
            & to_text(solved%residual)//' of the largest force)')
         return
      end do
      state%modal = held + matmul(response(:, m + 1:), reshape(state%contact%force, [n]))
      if (free%count > 0) state%modal = state%modal + matmul(free%shape, state%contact%q(2:))
      gap = gap_of(problem, state%contact%q, state%contact%force)
      do k = 1, problem%n_points
         if (state%contact%status(k) == state_open) state%contact%gap(:, k) = gap(:, k)
      end do
      state%contact%q = [state%modal, state%amplitude]
   end subroutine come_to_rest

end module microslip_analysis_settling
