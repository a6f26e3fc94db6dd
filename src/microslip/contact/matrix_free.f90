!> The contact solver for grids whose compliance matrix does not fit: forces as unknowns, G as an operator.
!>
!> Stick predictor: with all closed points stuck (those without friction slide freely), forces and gaps follow the
!> drivers, S = -G_AA^-1 R_A and N = R + G S, solved for once per driver, so that a stuck step is two small products.
!> Where the laws do not hold then: semismooth Newton (Alart-Curnier) on all points, one Krylov solution of the
!> `closed_system_t` per step. If Newton cycles, friction limits are held and follow the normal forces in rounds; if
!> that fails the step is approached in parts, each the start of the next. Friction remembers the state before the step all
!> the way.
!>
!> Amplitudes z of soft directions (`microslip_contact_problem`) are unknowns: as the difference z_0 + D q + V^T force they would
!> lose the digits that the gaps live on. Newton brings the two together.
module microslip_contact_matrix_free
   use microslip_contact_closed_system, only: closed_system_t, state_frictionless
   use microslip_contact_laws, only: smallest_force, classify, law_residual, state_at_rest, state_open, state_stick, state_slip
   use microslip_contact_problem, only: contact_problem_t, contact_state_t, solve_record_t, contact_solver_t, gap_of, &
      & book_step, free_gap, soft_amplitude
   use microslip_core_error, only: error_t, failure
   use microslip_core_kinds, only: wp
   implicit none(type, external)
   private

   public :: matrix_free_solver_t

   !> Newton steps of an attempt, rounds of held friction limits, and the most parts that a step is approached in.
   integer, parameter :: newton_steps = 60, most_rounds = 20, most_parts = 8
   !> Steps with an unchanged closed set after which points that were held may slip.
   integer, parameter :: settled_enough = 3
   !> Steps after which the closed set must have settled.
   integer, parameter :: longest_hold = 20
   !> A friction limit that nothing reaches, N.
   real(wp), parameter :: unlimited = 1.0e30_wp
   !> Residual over the largest force from which on it is rounding that stops Newton, not cycling, and how far below the
   !> tolerance it is followed.
   real(wp), parameter :: near = 1.0e-6_wp, sharpest = 1.0e-5_wp
   !> Most halvings of a Newton step.
   integer, parameter :: most_halvings = 6
   !> Krylov steps of a Newton step.
   integer, parameter :: krylov_steps = 100
   !> Relative accuracy of a Newton step while states change and when they do not.
   real(wp), parameter :: rough = 1.0e-3_wp, fine = 1.0e-5_wp
   !> Steps after which gaps are computed anew from the forces (rounding).
   integer, parameter :: refresh_after = 100
   !> Largest force over what closes the largest gap at one point alone: forces beyond that are no measure.
   real(wp), parameter :: runaway = 1.0e3_wp
   !> Largest drag over the local compliance: beyond it a point's friction is as good as known.
   real(wp), parameter :: most_drag = 1.0e8_wp

   !> Forces on the way, and the gaps they make.
   type :: trial_t
      !> (3, points) N
      real(wp), allocatable :: force(:, :)
      !> (3, points) r_0 + R q + G force + V z, m
      real(wp), allocatable :: gap(:, :)
      !> (directions) z, and what z_0 + D q + V^T force - z is beyond its rounding
      real(wp), allocatable :: z(:), balance(:)
      !> (points) contact states that forces and gaps select
      integer, allocatable :: status(:)
      !> Largest violation of the laws of a point, and the 2-norm over the points, N
      real(wp) :: residual = huge(1.0_wp), merit = huge(1.0_wp)
   end type trial_t

   type, extends(contact_solver_t) :: matrix_free_solver_t
      !> (points) points expected to close in the first step
      logical, allocatable :: expected_closed(:)
      !> Whether `start` solves for the stuck response; for a single step it does not pay
      logical :: predicts = .true.
      !> (3, points) N: where a similar step led to; one of the starts of Newton
      real(wp), allocatable :: expected_force(:, :)
      type(closed_system_t), private :: system
      !> (3 points, drivers) forces and gaps per unit of the drivers while nothing slips, opens or closes
      real(wp), allocatable, private :: S(:, :), N(:, :)
      !> (directions, drivers) and the amplitudes of soft directions
      real(wp), allocatable, private :: Z_slope(:, :)
      !> (3, points) r_0 + R q + G force + V z at the present state, m, and (directions) z
      real(wp), allocatable, private :: gap(:, :), z(:)
      !> (3, points) what the last step had beyond the stick predictor: N and m; (directions)
      real(wp), allocatable, private :: force_beyond(:, :), gap_beyond(:, :), z_beyond(:)
      !> (points) friction limits while they are held (Tresca), N
      real(wp), allocatable, private :: limit(:)
      integer, private :: steps_since_refresh = 0
      !> Most that tolerances may refer to in the present step, N
      real(wp), private :: largest_scale = huge(1.0_wp)
   contains
      procedure :: start
      procedure :: advance
   end type matrix_free_solver_t

contains

   !> Learn the structure's part and solve for the stuck response.
   subroutine start(self, problem, state, error)
      class(matrix_free_solver_t), intent(inout) :: self
      type(contact_problem_t), intent(in) :: problem
      type(contact_state_t), intent(in) :: state
      type(error_t), allocatable, intent(out) :: error
      integer :: states(problem%n_points)

      if (.not. allocated(problem%compliance)) then
         call failure(error, 'the matrix-free contact solver needs the compliance as an operator')
         return
      end if
      states = merge(state_stick, state_open, state%status /= state_open)
      if (allocated(self%expected_closed)) where (self%expected_closed) states = state_stick
      call self%system%set_up(problem%compliance, problem%friction, system_states(problem, states), problem%soft)
      if (allocated(self%S)) deallocate (self%S, self%N, self%Z_slope)
      if (any(states == state_stick)) then
         call self%system%learn(problem%compliance, error)
         if (allocated(error)) return
      end if
      ! Where nothing carries force yet there is no sticking to predict from.
      if (self%predicts .and. any(state%status /= state_open)) call solve_stuck_response(self, problem, error)
      if (allocated(error)) return
      self%z = soft_amplitude(problem, state%q, state%force)
      self%gap = gap_of(problem, state%q, state%force, self%z)
      if (allocated(self%force_beyond)) deallocate (self%force_beyond, self%gap_beyond, self%z_beyond)
      self%steps_since_refresh = 0
   end subroutine start

   !> States of the linear system: closed points without friction have no tangential unknowns, whatever they do.
   pure function system_states(problem, status) result(states)
      type(contact_problem_t), intent(in) :: problem
      !> (points) contact states
      integer, intent(in) :: status(:)
      integer :: states(size(status))

      states = merge(state_frictionless, status, status /= state_open .and. problem%friction <= 0.0_wp)
   end function system_states

   !> S and N, driver by driver.
   subroutine solve_stuck_response(self, problem, error)
      class(matrix_free_solver_t), intent(inout) :: self
      type(contact_problem_t), intent(in) :: problem
      type(error_t), allocatable, intent(out) :: error
      real(wp) :: x(3, problem%n_points), y(3, problem%n_points)
      real(wp), allocatable :: drive(:, :)
      integer :: k

      drive = soft_drive(problem)
      allocate (self%S(size(x), size(problem%R, 2)), self%Z_slope(size(drive, 1), size(problem%R, 2)))
      call self%system%solve_columns(problem%compliance, -problem%R, self%S, error, drive, self%Z_slope)
      if (allocated(error)) return
      self%N = problem%R
      if (size(drive) > 0) self%N = self%N + matmul(problem%soft, self%Z_slope)
      do k = 1, size(problem%R, 2)
         x = reshape(self%S(:, k), shape(x))
         call problem%compliance%product(x, y)
         self%N(:, k) = self%N(:, k) + reshape(y, [size(x)])
      end do
   end subroutine solve_stuck_response

   !> D, without directions where nothing is kept apart, (directions, drivers).
   pure function soft_drive(problem) result(drive)
      type(contact_problem_t), intent(in) :: problem
      real(wp), allocatable :: drive(:, :)

      if (allocated(problem%soft)) then
         drive = problem%soft_drive
      else
         allocate (drive(0, size(problem%R, 2)))
      end if
   end function soft_drive

   !> Take the state to driver q.
   subroutine advance(self, problem, q, state, record)
      class(matrix_free_solver_t), intent(inout) :: self
      type(contact_problem_t), intent(in) :: problem
      !> (drivers)
      real(wp), intent(in) :: q(:)
      type(contact_state_t), intent(inout) :: state
      type(solve_record_t), intent(out) :: record
      type(contact_state_t) :: before
      type(trial_t) :: stuck, trial
      real(wp) :: scale

      before = state
      if (self%steps_since_refresh >= refresh_after) self%gap = gap_of(problem, state%q, state%force, self%z)
      if (self%steps_since_refresh >= refresh_after) self%steps_since_refresh = 0
      self%steps_since_refresh = self%steps_since_refresh + 1
      self%largest_scale = huge(1.0_wp)
      call predict(self, problem, state, q, stuck)
      call choose_start(self, problem, state, q, stuck, trial)
      scale = force_scale(self, trial)
      record%converged = trial%residual <= self%tolerance*scale
      if (.not. record%converged) then
         self%largest_scale = runaway*unhindered_scale(self, problem, state, q)
         call newton(self, problem, state, q, trial, record, hold=allocated(self%expected_closed))
         if (.not. record%converged .and. trial%residual > near*force_scale(self, trial)) &
            & call rescue(self, problem, state, q, trial, record)
         self%steps_since_refresh = 0
      end if
      scale = force_scale(self, trial)
      record%residual = trial%residual/scale
      record%error_estimate = error_of(self, problem, state, trial)/scale
      self%force_beyond = trial%force - stuck%force
      self%gap_beyond = trial%gap - stuck%gap
      self%z_beyond = trial%z - stuck%z
      call commit(self, problem, q, trial, state)
      call book_step(problem, before, state, record)
      if (allocated(self%expected_force)) deallocate (self%expected_force)
      if (allocated(self%expected_closed)) deallocate (self%expected_closed)
   end subroutine advance

   !> All closed points stuck.
   subroutine predict(self, problem, state, q, trial)
      class(matrix_free_solver_t), intent(in) :: self
      type(contact_problem_t), intent(in) :: problem
      type(contact_state_t), intent(in) :: state
      real(wp), intent(in) :: q(:)
      type(trial_t), intent(out) :: trial

      if (allocated(self%S)) then
         trial%force = state%force + reshape(matmul(self%S, q - state%q), shape(state%force))
         trial%gap = self%gap + reshape(matmul(self%N, q - state%q), shape(state%force))
         trial%z = self%z + matmul(self%Z_slope, q - state%q)
      else
         trial%force = state%force
         trial%gap = self%gap + reshape(free_gap(problem, q) - free_gap(problem, state%q), shape(state%force))
         trial%z = self%z + matmul(soft_drive(problem), q - state%q)
      end if
      call weigh_balance(problem, q, trial)
      call judge(self, problem, state, trial)
   end subroutine predict

   !> The best of the starts at hand: stuck, like the last step, or what the caller expects.
   subroutine choose_start(self, problem, state, q, stuck, trial)
      class(matrix_free_solver_t), intent(in) :: self
      type(contact_problem_t), intent(in) :: problem
      type(contact_state_t), intent(in) :: state
      real(wp), intent(in) :: q(:)
      type(trial_t), intent(in) :: stuck
      type(trial_t), intent(out) :: trial
      type(trial_t) :: other

      trial = stuck
      if (trial%residual <= self%tolerance*force_scale(self, trial)) return
      if (allocated(self%force_beyond)) then
         other%force = stuck%force + self%force_beyond
         other%gap = stuck%gap + self%gap_beyond
         other%z = stuck%z + self%z_beyond
         call weigh_balance(problem, q, other)
         call judge(self, problem, state, other)
         if (other%residual < trial%residual) trial = other
      end if
      if (allocated(self%expected_force)) then
         other%force = self%expected_force
         call find_gap(problem, q, other)
         call judge(self, problem, state, other)
         if (other%residual < trial%residual) trial = other
      else if (allocated(self%expected_closed)) then
         trial%status = merge(state_stick, state_open, self%expected_closed)
      end if
   end subroutine choose_start

   !> Amplitudes and gaps that follow from the forces of a trial.
   subroutine find_gap(problem, q, trial)
      type(contact_problem_t), intent(in) :: problem
      real(wp), intent(in) :: q(:)
      type(trial_t), intent(inout) :: trial

      trial%z = soft_amplitude(problem, q, trial%force)
      trial%balance = 0.0_wp*trial%z
      trial%gap = gap_of(problem, q, trial%force, trial%z)
   end subroutine find_gap

   !> What the amplitudes of a trial lack, beyond the rounding of the sums that they follow from.
   subroutine weigh_balance(problem, q, trial)
      type(contact_problem_t), intent(in) :: problem
      real(wp), intent(in) :: q(:)
      type(trial_t), intent(inout) :: trial
      real(wp) :: rounding
      integer :: k

      trial%balance = soft_amplitude(problem, q, trial%force) - trial%z
      do k = 1, size(trial%z)
         rounding = sqrt(real(size(trial%force), wp))*epsilon(1.0_wp)*(abs(problem%soft_0(k)) &
            & + sum(abs(problem%soft_drive(k, :)*q)) + sum(abs(problem%soft(:, k)*reshape(trial%force, [size(trial%force)]))))
         if (abs(trial%balance(k)) <= rounding) trial%balance(k) = 0.0_wp
      end do
   end subroutine weigh_balance

   !> Contact states of a trial and how far it is from the laws.
   subroutine judge(self, problem, state, trial)
      class(matrix_free_solver_t), intent(in) :: self
      type(contact_problem_t), intent(in) :: problem
      !> Before the step
      type(contact_state_t), intent(in) :: state
      type(trial_t), intent(inout) :: trial
      real(wp) :: gap(3), violation(problem%n_points), force_lacking
      integer :: p

      if (.not. allocated(trial%status)) allocate (trial%status(problem%n_points))
      do p = 1, problem%n_points
         associate (k => self%system%stiffness(:, p), force => trial%force(:, p))
            if (forced_open(problem, state, p)) then
               trial%status(p) = state_open
               violation(p) = maxval(abs(force))
               cycle
            end if
            gap = increment(problem, state, trial, p)
            if (allocated(self%limit)) then
               trial%status(p) = classify(force, gap(1), gap(2:3), k(1), min(k(2), k(3)), problem%friction(p), self%limit(p))
               violation(p) = law_residual(force, gap(1), gap(2:3), k(1), min(k(2), k(3)), problem%friction(p), self%limit(p))
            else
               trial%status(p) = classify(force, gap(1), gap(2:3), k(1), min(k(2), k(3)), problem%friction(p))
               violation(p) = law_residual(force, gap(1), gap(2:3), k(1), min(k(2), k(3)), problem%friction(p))
            end if
         end associate
      end do
      trial%residual = maxval(violation)
      trial%merit = norm2(violation)
      ! What is out of balance would have to be carried by the points.
      do p = 1, size(trial%z)
         force_lacking = abs(trial%balance(p))/maxval(abs(problem%soft(:, p)))
         trial%residual = max(trial%residual, force_lacking)
         trial%merit = hypot(trial%merit, force_lacking)
      end do
   end subroutine judge

   !> Normal gap and slip of a point in the step (on velocity level the normal gap's increment).
   pure function increment(problem, state, trial, p) result(gap)
      type(contact_problem_t), intent(in) :: problem
      type(contact_state_t), intent(in) :: state
      type(trial_t), intent(in) :: trial
      integer, intent(in) :: p
      real(wp) :: gap(3)

      gap = trial%gap(:, p)
      gap(2:3) = gap(2:3) - state%gap(2:3, p)
      if (problem%velocity_level) gap(1) = gap(1) - state%gap(1, p)
   end function increment

   !> On velocity level points that are open stay so for this step.
   pure logical function forced_open(problem, state, p)
      type(contact_problem_t), intent(in) :: problem
      type(contact_state_t), intent(in) :: state
      integer, intent(in) :: p

      forced_open = problem%velocity_level .and. state%force(1, p) <= 0.0_wp .and. state%gap(1, p) > 0.0_wp
   end function forced_open

   !> Force that tolerances refer to: the largest one, or what it takes to undo the deepest penetration, N.
   pure real(wp) function force_scale(self, trial)
      class(matrix_free_solver_t), intent(in) :: self
      type(trial_t), intent(in) :: trial

      force_scale = maxval(trial%force(1, :))
      if (force_scale <= 0.0_wp) force_scale = maxval(-self%system%stiffness(1, :)*trial%gap(1, :))
      force_scale = max(min(force_scale, self%largest_scale), smallest_force)
   end function force_scale

   !> What it takes to undo, at one point alone, the largest gap and slip that there would be without contact forces, N.
   real(wp) function unhindered_scale(self, problem, state, q) result(scale)
      class(matrix_free_solver_t), intent(in) :: self
      type(contact_problem_t), intent(in) :: problem
      !> Before the step
      type(contact_state_t), intent(in) :: state
      real(wp), intent(in) :: q(:)
      real(wp) :: gap(3, problem%n_points)

      gap = reshape(free_gap(problem, q), shape(gap))
      gap(2:3, :) = gap(2:3, :) - state%gap(2:3, :)
      scale = maxval(self%system%stiffness*abs(gap))
   end function unhindered_scale

   !> Newton steps from the trial until the laws hold.
   !>
   !> With `hold` points stick until the closed set has settled: friction that follows forces which are far off yet leads
   !> astray. Newton then finds the closed set by full steps, as in frictionless contact, if it does so soon.
   subroutine newton(self, problem, state, q, trial, record, hold)
      class(matrix_free_solver_t), intent(inout) :: self
      type(contact_problem_t), intent(in) :: problem
      !> Before the step
      type(contact_state_t), intent(in) :: state
      real(wp), intent(in) :: q(:)
      type(trial_t), intent(inout) :: trial
      type(solve_record_t), intent(inout) :: record
      logical, intent(in) :: hold
      type(trial_t) :: old
      real(wp) :: dx(3, problem%n_points), rhs(3, problem%n_points), dz(size(trial%z)), first, last, target, sharpness
      integer :: before(problem%n_points)
      integer :: step, krylov, settled
      logical :: holding

      before = -1
      holding = hold
      settled = 0
      ! The Krylov method stops at the 2-norm of an even spread of errors; where they are not even it must go on.
      sharpness = 0.03_wp
      do step = 1, newton_steps
         if (record%iterations >= self%max_iterations) return
         record%iterations = record%iterations + 1
         old = trial
         call linearise(self, problem, state, trial)
         trial%gap = gap_of(problem, q, trial%force, trial%z)
         call weigh_balance(problem, q, trial)
         call right_hand_side(self, problem, state, trial, rhs)
         target = sharpness*self%tolerance*force_scale(self, trial)*sqrt(real(max(1, count(trial%status /= state_open)), wp))
         call self%system%solve(problem%compliance, rhs, merge(fine, rough, all(trial%status == before)), target, &
            & krylov_steps, dx, krylov, first, last, trial%balance, dz)
         before = trial%status
         call self%system%follow_friction(dx)
         trial%force = trial%force + dx
         trial%z = trial%z + dz
         trial%gap = gap_of(problem, q, trial%force, trial%z)
         call weigh_balance(problem, q, trial)
         call judge(self, problem, state, trial)
         if (holding) then
            ! Closed points have no gap by construction: what the Krylov method left of it must not open them.
            trial%status = merge(state_at_rest(problem%friction), state_open, merge(trial%force(1, :) > 0.0_wp, &
               & trial%status /= state_open, self%system%states /= state_open))
            settled = merge(settled + 1, 0, all(trial%status == before))
            holding = settled < settled_enough
            if (.not. holding) call judge(self, problem, state, trial)
            if (holding .and. step == longest_hold) return
         else
            call shorten(self, problem, state, old, trial)
         end if
         record%converged = trial%residual <= self%tolerance*force_scale(self, trial)
         if (record%converged) return
         if (last <= target) sharpness = 0.1_wp*sharpness
         if (sharpness < sharpest) return
      end do
   end subroutine newton

   !> Where a full step does not bring the laws nearer, take the best of shorter ones. Gaps are linear in the forces.
   subroutine shorten(self, problem, state, old, trial)
      class(matrix_free_solver_t), intent(in) :: self
      type(contact_problem_t), intent(in) :: problem
      type(contact_state_t), intent(in) :: state
      !> Before the Newton step
      type(trial_t), intent(in) :: old
      !> After it
      type(trial_t), intent(inout) :: trial
      type(trial_t) :: full, part
      real(wp) :: length
      integer :: k

      if (trial%merit < old%merit) return
      full = trial
      do k = 1, most_halvings
         length = 0.5_wp**k
         part%force = old%force + length*(full%force - old%force)
         part%gap = old%gap + length*(full%gap - old%gap)
         part%z = old%z + length*(full%z - old%z)
         part%balance = old%balance + length*(full%balance - old%balance)
         call judge(self, problem, state, part)
         if (part%merit < trial%merit) trial = part
         if (trial%merit < (1.0_wp - 0.5_wp*length)*old%merit) return
      end do
   end subroutine shorten

   !> Take the linear system of the trial's states, and from its forces what the states exclude: open points carry none,
   !> friction of slipping points is mu force_n along d, and the part across.
   subroutine linearise(self, problem, state, trial)
      class(matrix_free_solver_t), intent(inout) :: self
      type(contact_problem_t), intent(in) :: problem
      type(contact_state_t), intent(in) :: state
      type(trial_t), intent(inout) :: trial
      real(wp) :: gap(3), w(2), stiffness, limit, length, across(2)
      integer :: p

      self%system%states = system_states(problem, trial%status)
      do p = 1, problem%n_points
         if (self%system%states(p) == state_open) then
            trial%force(:, p) = 0.0_wp
         else if (self%system%states(p) == state_frictionless) then
            trial%force(2:3, p) = 0.0_wp
         else if (self%system%states(p) == state_slip) then
            stiffness = minval(self%system%stiffness(2:3, p))
            gap = increment(problem, state, trial, p)
            w = trial%force(2:3, p) - stiffness*gap(2:3)
            limit = problem%friction(p)*max(0.0_wp, trial%force(1, p) - self%system%stiffness(1, p)*gap(1))
            if (allocated(self%limit)) limit = self%limit(p)
            length = norm2(w)
            self%system%direction(:, p) = w/length
            ! beta = limit/length of the return to the disk: drag = (1 - beta)/(beta stiffness)
            self%system%drag(p) = max(0.0_wp, length/max(limit, length/most_drag) - 1.0_wp)/stiffness
            across = [-w(2), w(1)]/length
            trial%force(2:3, p) = across*dot_product(across, trial%force(2:3, p)) &
               & + merge(limit, problem%friction(p)*trial%force(1, p), allocated(self%limit))*w/length
         end if
      end do
   end subroutine linearise

   !> What the linear system misses at the trial, with its sign: - gap, and for slipping points - (slip + drag force) across.
   subroutine right_hand_side(self, problem, state, trial, rhs)
      class(matrix_free_solver_t), intent(in) :: self
      type(contact_problem_t), intent(in) :: problem
      type(contact_state_t), intent(in) :: state
      type(trial_t), intent(in) :: trial
      real(wp), intent(out) :: rhs(:, :)
      integer :: p

      do p = 1, problem%n_points
         rhs(:, p) = -increment(problem, state, trial, p)
         if (self%system%states(p) == state_slip) rhs(2:3, p) = rhs(2:3, p) - self%system%drag(p)*trial%force(2:3, p)
      end do
   end subroutine right_hand_side

   !> Where Newton fails: held friction limits. If they do not lead there either, the step is approached in parts, each the
   !> start of the next; twice as many until the last one converges.
   subroutine rescue(self, problem, state, q, trial, record)
      class(matrix_free_solver_t), intent(inout) :: self
      type(contact_problem_t), intent(in) :: problem
      type(contact_state_t), intent(in) :: state
      real(wp), intent(in) :: q(:)
      type(trial_t), intent(inout) :: trial
      type(solve_record_t), intent(inout) :: record
      type(trial_t) :: part
      integer :: parts, k

      parts = 1
      do while (parts <= most_parts .and. record%iterations < self%max_iterations)
         record%rescues = record%rescues + 1
         part%force = state%force
         do k = 1, parts
            call solve_with_held_limits(self, problem, state, state%q + (real(k, wp)/parts)*(q - state%q), part, record)
         end do
         if (record%converged .or. part%residual < trial%residual) trial = part
         if (record%converged) return
         parts = 2*parts
      end do
   end subroutine rescue

   !> Rounds in which no friction limit is reached first, then those are held that the normal forces of the round before
   !> allow (Panagiotopoulos), then Newton on the laws as they are. With limits that do not follow the normal forces the
   !> problem is that of a minimum, and Newton with shortened steps finds it.
   subroutine solve_with_held_limits(self, problem, state, q, trial, record)
      class(matrix_free_solver_t), intent(inout) :: self
      type(contact_problem_t), intent(in) :: problem
      type(contact_state_t), intent(in) :: state
      real(wp), intent(in) :: q(:)
      type(trial_t), intent(inout) :: trial
      type(solve_record_t), intent(inout) :: record
      real(wp) :: last
      integer :: round

      call find_gap(problem, q, trial)
      call judge(self, problem, state, trial)
      do round = 0, most_rounds
         last = trial%residual
         if (last <= near*force_scale(self, trial)) exit
         self%limit = problem%friction*max(0.0_wp, trial%force(1, :))
         if (round == 0) self%limit = unlimited
         self%system%friction = 0.0_wp
         call judge(self, problem, state, trial)
         call newton(self, problem, state, q, trial, record, hold=.false.)
         deallocate (self%limit)
         self%system%friction = problem%friction
         call judge(self, problem, state, trial)
         if (round > 1 .and. trial%residual > last) exit
      end do
      call newton(self, problem, state, q, trial, record, hold=.false.)
   end subroutine solve_with_held_limits

   !> What a further Newton step would change at most, N: twice the preconditioned residual.
   real(wp) function error_of(self, problem, state, trial)
      class(matrix_free_solver_t), intent(inout) :: self
      type(contact_problem_t), intent(in) :: problem
      type(contact_state_t), intent(in) :: state
      type(trial_t), intent(in) :: trial
      type(trial_t) :: final
      real(wp) :: rhs(3, problem%n_points), z(3, problem%n_points)

      final = trial
      call linearise(self, problem, state, final)
      call right_hand_side(self, problem, state, final, rhs)
      call self%system%project(rhs)
      call self%system%precondition(problem%compliance, rhs, z)
      call self%system%follow_friction(z)
      error_of = maxval(abs(final%force - trial%force)) + 2.0_wp*maxval(abs(z))
   end function error_of

   !> The solved step becomes the state. What the contact states prescribe holds to the last bit.
   subroutine commit(self, problem, q, trial, state)
      class(matrix_free_solver_t), intent(inout) :: self
      type(contact_problem_t), intent(in) :: problem
      real(wp), intent(in) :: q(:)
      type(trial_t), intent(inout) :: trial
      type(contact_state_t), intent(inout) :: state
      integer :: p

      do p = 1, problem%n_points
         if (trial%status(p) == state_stick) then
            state%gap(1, p) = trial%gap(1, p)
         else
            state%gap(:, p) = trial%gap(:, p)
         end if
         if (trial%status(p) /= state_open .and. .not. problem%velocity_level) state%gap(1, p) = 0.0_wp
         if (trial%status(p) == state_open) trial%force(:, p) = 0.0_wp
      end do
      state%q = q
      state%force = trial%force
      state%status = trial%status
      call move_alloc(trial%gap, self%gap)
      call move_alloc(trial%z, self%z)
   end subroutine commit

end module microslip_contact_matrix_free
