!> The fast contact solver: stick predictor, slip/lift-off corrector (METHOD section 5).
!>
!> On the base set, closed points stick unless they must not: only points that are open, slip, or leave
!> their cone carry unknowns. Newton with a kept factor solves for them (`block_newton`), with block
!> Gauss-Seidel as the rescue, or the paper's projected Jacobi with the sticking points eliminated.
!> All others are looked at only where a bound says that their margin may be used up (`lookout`).
!>
!> What a step must know of all points - the forces on the structure and the contact's energy - follows from
!> the few that moved. With y = gap - r_0 on the base set:
!>     R^T force     = stiffness q - h,                  h = S^T y
!>     force^T G force = c + 2 q^T h - q^T stiffness q,  c = y^T M y
module microslip_contact_condensed
   use microslip_contact_base_set, only: base_set_t
   use microslip_contact_block, only: contact_block_t
   use microslip_contact_block_gauss_seidel, only: sweep_gauss_seidel
   use microslip_contact_block_newton, only: solve_newton
   use microslip_contact_kept_factor, only: kept_factor_t
   use microslip_contact_laws, only: state_open, state_stick
   use microslip_contact_lookout, only: lookout_t
   use microslip_contact_problem, only: contact_problem_t, contact_state_t, solve_record_t, contact_solver_t
   use microslip_contact_projected_jacobi, only: step_lengths, contraction_gap, iterate_projected_jacobi, states_of_forces
   use microslip_core_error, only: error_t
   use microslip_core_kinds, only: wp
   use microslip_linalg_dense, only: inverse_spd, product_symmetric
   implicit none(type, external)
   private

   public :: condensed_solver_t

   !> Newton steps before Gauss-Seidel is asked, sweeps it may take, and rounds of both.
   integer, parameter :: newton_steps = 40, rescue_sweeps = 400, rescue_rounds = 10
   !> Rounds of solving and checking the rest.
   integer, parameter :: max_rounds = 200
   !> Open points of the base set that are carried along, and for how many steps the others are.
   integer, parameter :: open_carried = 16, open_steps = 200
   !> Steps after which everything is computed anew from the definition (rounding); the first times earlier, because
   !> by then it is known how far the drivers move in a step.
   integer, parameter :: refresh_after = 500, first_refresh = 10
   !> A point that would need a look again within so many steps is followed.
   real(wp), parameter :: look_ahead = 4.0_wp

   type, extends(contact_solver_t) :: condensed_solver_t
      !> Solve the block by the paper's projected Jacobi instead of Newton
      logical :: by_jacobi = .false.
      !> (points) points expected to close in the first step: they are in the base set from the start
      logical, allocatable :: expected_closed(:)
      type(base_set_t), private :: base
      type(contact_block_t), private :: block
      type(kept_factor_t), private :: kept
      type(lookout_t), private :: lookout
      !> (3 inside) and (outside): forces and outside gaps of the reference; (drivers) its driver
      real(wp), allocatable, private :: force_ref(:), gap_ref(:), q_ref(:)
      !> (3, inside) gap increments since the reference, and the places where there are any
      real(wp), allocatable, private :: moved(:, :)
      logical, allocatable, private :: has_moved(:)
      !> h for drivers and outputs, and c
      real(wp), allocatable, private :: h(:), h_output(:)
      real(wp), private :: c = 0.0_wp
      !> (3, points) gap increments of the last step: start value of the next; (points) steps that a point is open
      real(wp), allocatable, private :: last_increment(:, :)
      integer, allocatable, private :: steps_open(:)
      !> (drivers) largest |dq| since the reference
      real(wp), allocatable, private :: largest_dq(:)
      integer, private :: steps_since_refresh = 0, refresh_due = first_refresh
      !> Largest contact force of the last step, N
      real(wp), private :: last_scale = 0.0_wp
   contains
      procedure :: start
      procedure :: advance
      procedure :: complete
   end type condensed_solver_t

contains

   !> Choose the base set for the state and factorise it.
   subroutine start(self, problem, state, error)
      class(condensed_solver_t), intent(inout) :: self
      type(contact_problem_t), intent(in) :: problem
      type(contact_state_t), intent(in) :: state
      type(error_t), allocatable, intent(out) :: error
      logical :: in_base(problem%n_points)
      integer :: p

      in_base = state%status /= state_open
      if (allocated(self%last_increment)) deallocate (self%last_increment, self%steps_open, self%largest_dq)
      allocate (self%last_increment(3, problem%n_points), source=0.0_wp)
      allocate (self%steps_open(problem%n_points), source=0)
      allocate (self%largest_dq(size(problem%R, 2)), source=0.0_wp)
      if (allocated(self%expected_closed)) then
         where (self%expected_closed .and. .not. in_base) self%last_increment(1, :) = -state%gap(1, :)
         in_base = in_base .or. self%expected_closed
         deallocate (self%expected_closed)
      end if
      self%refresh_due = first_refresh
      call self%base%build(problem, pack([(p, p=1, problem%n_points)], in_base), error)
      if (allocated(error)) return
      call self%lookout%survey(problem, self%base)
      call refresh(self, problem, state)
   end subroutine start

   !> Take the state, complete in the gaps of the base set, as the new reference.
   subroutine refresh(self, problem, state)
      class(condensed_solver_t), intent(inout) :: self
      type(contact_problem_t), intent(in) :: problem
      type(contact_state_t), intent(in) :: state
      real(wp), allocatable :: y(:), force(:), My(:)
      integer :: j, p, k, n

      n = size(self%base%inside)
      allocate (y(3*n), My(3*n))
      do j = 1, n
         p = self%base%inside(j)
         k = 3*p - 2
         y(3*j - 2:3*j) = state%gap(:, p) - problem%r_0(k:k + 2)
      end do
      call product_symmetric(self%base%M, y, My)
      force = My + matmul(state%q, self%base%slope)
      self%force_ref = force
      self%gap_ref = problem%r_0(3*self%base%outside - 2) + matmul(state%q, self%base%slope_outside)
      self%gap_ref = self%gap_ref + matmul(y, self%base%T_t)
      self%q_ref = state%q
      self%h = matmul(self%base%slope, y)
      self%h_output = matmul(self%base%output_slope, y)
      self%c = dot_product(y, My)
      if (allocated(self%moved)) deallocate (self%moved, self%has_moved)
      allocate (self%moved(3, n), source=0.0_wp)
      allocate (self%has_moved(n), source=.false.)

      if (maxval(self%largest_dq) > 0.0_wp) then
         call self%lookout%weigh(problem, self%base, self%largest_dq)
      else
         call self%lookout%weigh(problem, self%base, spread(1.0_wp, 1, size(self%h)))
      end if
      self%largest_dq = 0.0_wp
      call renew_block(self, problem, state, reshape(self%force_ref, [3, n]))
      do j = 1, n
         if (.not. any(self%block%place(:self%block%rows) == j)) &
            & call watch_inside(self, problem, j, self%force_ref(3*j - 2:3*j))
      end do
      self%lookout%margin(n + 1:) = self%gap_ref
      self%lookout%used(n + 1:) = 0.0_wp
      self%steps_since_refresh = 0
   end subroutine refresh

   !> Empty the block but for the points that slip or are open.
   subroutine renew_block(self, problem, state, force)
      class(condensed_solver_t), intent(inout) :: self
      type(contact_problem_t), intent(in) :: problem
      type(contact_state_t), intent(in) :: state
      !> (3, inside) forces; only those of slipping and open points need be right
      real(wp), intent(in) :: force(:, :)
      integer :: j, p

      call self%block%clear()
      call self%kept%drop()
      do j = 1, size(self%base%inside)
         p = self%base%inside(j)
         if (state%status(p) /= state_stick) call follow_point(self, problem, state, j, force(:, j), moves=.true.)
      end do
   end subroutine renew_block

   !> A point of the base set is followed from now on, and may move.
   subroutine follow_point(self, problem, state, place, force, moves)
      class(condensed_solver_t), intent(inout) :: self
      type(contact_problem_t), intent(in) :: problem
      type(contact_state_t), intent(in) :: state
      integer, intent(in) :: place
      !> Its force in the state, N
      real(wp), intent(in) :: force(3)
      logical, intent(in) :: moves

      call self%block%add_row(self%base, place, problem%friction(self%base%inside(place)))
      self%block%force(:, self%block%rows) = force
      self%block%change(:, self%block%rows) = 0.0_wp
      self%lookout%margin(place) = huge(1.0_wp)
      self%lookout%used(place) = 0.0_wp
      if (moves) call free_row(self, problem, state, self%block%rows)
   end subroutine follow_point

   !> The point of a row may move from now on.
   subroutine free_row(self, problem, state, row)
      class(condensed_solver_t), intent(inout) :: self
      type(contact_problem_t), intent(in) :: problem
      type(contact_state_t), intent(in) :: state
      integer, intent(in) :: row
      integer :: p

      call self%block%add_column(self%base, row)
      p = self%base%inside(self%block%place(row))
      call set_start(self%block, self%block%columns, problem, state, p, [0.0_wp, 0.0_wp, 0.0_wp])
   end subroutine free_row

   !> A sticking point is left to the lookout.
   subroutine watch_inside(self, problem, place, force)
      class(condensed_solver_t), intent(inout) :: self
      type(contact_problem_t), intent(in) :: problem
      integer, intent(in) :: place
      !> Its force, N
      real(wp), intent(in) :: force(3)

      self%lookout%margin(place) = problem%friction(self%base%inside(place))*force(1) - norm2(force(2:3))
      self%lookout%used(place) = 0.0_wp
   end subroutine watch_inside

   !> Take the state to driver q.
   subroutine advance(self, problem, q, state, record)
      class(condensed_solver_t), intent(inout) :: self
      type(contact_problem_t), intent(in) :: problem
      !> (drivers)
      real(wp), intent(in) :: q(:)
      type(contact_state_t), intent(inout) :: state
      type(solve_record_t), intent(out) :: record
      real(wp), allocatable :: spent(:), looked(:)
      integer, allocatable :: closing(:)
      integer :: round, inside_before
      real(wp) :: scale
      logical :: more

      if (self%steps_since_refresh >= self%refresh_due) then
         if (self%refresh_due < refresh_after) self%refresh_due = min(5*self%refresh_due, refresh_after)
         call refresh(self, problem, state)
      end if
      self%steps_since_refresh = self%steps_since_refresh + 1
      call shed_open_points(self, problem, state, record)
      call begin_step(self, problem, q, state)
      ! A first guess which points must move: those that would leave their cones if the last step were repeated.
      self%block%trial(:, :self%block%rows) = self%block%force(:, :self%block%rows) + self%block%change(:, :self%block%rows)
      call free_violated(self, problem, state, 0.0_wp, more)
      call self%block%evaluate(columns_only=.true.)
      do round = 1, max_rounds
         scale = force_scale(self, state)
         call solve_block(self, scale, record)
         call self%block%evaluate(columns_only=.false.)
         scale = force_scale(self, state)
         call free_violated(self, problem, state, self%tolerance*scale, more)
         if (more) cycle
         spent = self%lookout%spent(q - state%q, self%block%place(:self%block%columns), increments(self%block))
         call look_inside(self, problem, q, state, spent, looked, self%tolerance*scale, more)
         if (more) cycle
         closing = closing_points(self, problem, q, state, spent, looked, scale)
         if (size(closing) == 0) exit
         ! Points that close join at the state before this step.
         inside_before = size(self%base%inside)
         call take_in(self, problem, closing, state, record)
         if (size(self%base%inside) == inside_before) exit
         call begin_step(self, problem, q, state)
      end do
      record%converged = record%converged .and. round <= max_rounds
      self%last_scale = force_scale(self, state)
      record%residual = self%block%residual()/self%last_scale
      if (.not. record%converged) print *, 'NC', round, self%block%columns, size(self%base%inside), record%residual, &
      & record%iterations, record%rescues, &
         & scale, self%block%status(:self%block%columns)
      if (mod(self%steps_since_refresh, 10) == 0) print *, 'DBG', self%steps_since_refresh, round, record%iterations, &
         & self%block%rows, self%block%columns, &
         & count(looked < huge(1.0_wp)), count(self%has_moved), count(state%status /= state_open)
      call commit(self, problem, q, state, spent, looked, record)
      if (.not. self%lazy) call self%complete(problem, state)
   end subroutine advance

   !> Predictions and start values of a step.
   subroutine begin_step(self, problem, q, state)
      class(condensed_solver_t), intent(inout) :: self
      type(contact_problem_t), intent(in) :: problem
      real(wp), intent(in) :: q(:)
      type(contact_state_t), intent(in) :: state
      integer :: a, p

      call self%block%predict(q - state%q)
      do a = 1, self%block%columns
         p = self%base%inside(self%block%place(a))
         call set_start(self%block, a, problem, state, p, self%last_increment(:, p))
      end do
      call self%block%evaluate(columns_only=.true.)
   end subroutine begin_step

   !> Gap before the step and first guess of the increments of a column.
   subroutine set_start(block, a, problem, state, p, guess)
      type(contact_block_t), intent(inout) :: block
      integer, intent(in) :: a
      type(contact_problem_t), intent(in) :: problem
      type(contact_state_t), intent(in) :: state
      !> Point
      integer, intent(in) :: p
      real(wp), intent(in) :: guess(3)

      block%status(a) = state%status(p)
      block%gap_old(a) = state%gap(1, p)
      block%forced_open(a) = .false.
      if (problem%velocity_level) then
         block%forced_open(a) = state%force(1, p) <= 0.0_wp .and. state%gap(1, p) > 0.0_wp
         block%gap_old(a) = 0.0_wp
      end if
      block%x_n(a) = guess(1)
      block%x_t(:, a) = guess(2:3)
      if (.not. block%forced_open(a)) block%x_n(a) = max(block%x_n(a), -block%gap_old(a))
   end subroutine set_start

   !> (3, columns) increments of the block.
   pure function increments(block) result(x)
      type(contact_block_t), intent(in) :: block
      real(wp) :: x(3, block%columns)

      x(1, :) = block%x_n(:block%columns)
      x(2:3, :) = block%x_t(:, :block%columns)
   end function increments

   !> Size of the largest contact force in the step, as last known, N.
   pure real(wp) function force_scale(self, state)
      class(condensed_solver_t), intent(in) :: self
      type(contact_state_t), intent(in) :: state
      integer :: a

      associate (trial => self%block%trial(1, :self%block%rows), predicted => self%block%predicted(1, :self%block%rows))
         force_scale = max(maxval(state%force(1, :)), maxval(trial), maxval(predicted))
      end associate
      ! Where nothing is closed any more, what is left of the forces is rounding, and the scale stays.
      if (self%block%columns == size(self%base%inside) .and. all(self%block%status(:self%block%columns) == state_open)) &
         & force_scale = max(force_scale, self%last_scale)
      ! Points that close from afar: what it takes to close them alone.
      do a = 1, self%block%columns
         if (force_scale > 0.0_wp) exit
         force_scale = max(force_scale, self%block%stiffness_n(a)*abs(self%block%gap_old(a)))
      end do
      force_scale = max(force_scale, tiny(1.0_wp))
   end function force_scale

   !> Followed points outside their cones may move from now on.
   subroutine free_violated(self, problem, state, slack, more)
      class(condensed_solver_t), intent(inout) :: self
      type(contact_problem_t), intent(in) :: problem
      type(contact_state_t), intent(in) :: state
      !> Violation that is let pass, N
      real(wp), intent(in) :: slack
      !> Whether there are any
      logical, intent(out) :: more
      integer :: r

      more = .false.
      do r = self%block%columns + 1, self%block%rows
         if (.not. leaves_cone(self%block%trial(:, r), self%block%friction(r), slack)) cycle
         call free_row(self, problem, state, r)
         more = .true.
      end do
   end subroutine free_violated

   !> Whether a sticking point cannot stick with this force.
   pure logical function leaves_cone(force, friction, slack)
      real(wp), intent(in) :: force(3), friction, slack
      leaves_cone = norm2(force(2:3)) > friction*force(1) + slack .or. force(1) < -slack
   end function leaves_cone

   !> Solve the block: Newton with Gauss-Seidel to the rescue, or the paper's projected Jacobi.
   subroutine solve_block(self, scale, record)
      class(condensed_solver_t), intent(inout) :: self
      !> Force that tolerances refer to, N
      real(wp), intent(in) :: scale
      type(solve_record_t), intent(inout) :: record
      real(wp) :: limit, residual, force_error
      integer :: steps, sweeps, round

      record%converged = .true.
      if (self%block%columns == 0) return
      if (self%by_jacobi) then
         call solve_block_by_jacobi(self, record)
         return
      end if
      limit = 0.05_wp*self%tolerance*scale
      do round = 1, rescue_rounds
         call solve_newton(self%block, self%kept, limit, newton_steps, steps, residual, force_error)
         record%iterations = record%iterations + steps
         record%error_estimate = force_error/scale
         if (residual <= self%tolerance*scale) exit
         record%rescues = record%rescues + 1
         call self%kept%drop()
         associate (x_n => self%block%x_n(:self%block%columns), x_t => self%block%x_t(:, :self%block%columns))
            if (.not. (all(abs(x_n) < huge(1.0_wp)) .and. all(abs(x_t) < huge(1.0_wp)))) then
               x_n = 0.0_wp
               x_t = 0.0_wp
            end if
         end associate
         call sweep_gauss_seidel(self%block, self%tolerance*scale, rescue_sweeps, sweeps, residual)
         record%iterations = record%iterations + sweeps
      end do
      record%converged = residual <= self%tolerance*scale
   end subroutine solve_block

   !> The paper's way: projected Jacobi on the compliance with the sticking points eliminated, M_block^-1.
   subroutine solve_block_by_jacobi(self, record)
      class(condensed_solver_t), intent(inout) :: self
      type(solve_record_t), intent(inout) :: record
      type(error_t), allocatable :: error
      real(wp), allocatable :: M(:, :), compliance(:, :), predicted(:), c(:), eps(:), force(:), x(:)
      integer :: a, b, n, sweeps

      n = self%block%columns
      allocate (M(3*n, 3*n), predicted(3*n), force(3*n))
      do b = 1, n
         do a = 1, n
            M(3*a - 2:3*a, 3*b - 2) = self%block%M_n(3*a - 2:3*a, b)
            M(3*a - 2:3*a, 3*b - 1:3*b) = self%block%M_t(3*a - 2:3*a, 2*b - 1:2*b)
         end do
         predicted(3*b - 2:3*b) = self%block%predicted(:, b)
         force(3*b - 2:3*b) = self%block%trial(:, b)
      end do
      compliance = M
      call inverse_spd(compliance, error)
      if (allocated(error)) then
         record%converged = .false.
         return
      end if
      c = -matmul(compliance, predicted)
      c(1::3) = c(1::3) + self%block%gap_old(:n)
      eps = step_lengths(compliance)
      associate (friction => self%block%friction(:n))
         call iterate_projected_jacobi(compliance, c, eps, contraction_gap(M, eps), friction, self%block%forced_open(:n), &
            & 0.0_wp, self%tolerance, self%max_iterations, force, sweeps, record%error_estimate)
         self%block%status(:n) = states_of_forces(reshape(force, [3, n]), friction)
      end associate
      record%iterations = record%iterations + sweeps
      record%converged = record%error_estimate <= self%tolerance
      x = matmul(compliance, force - predicted)
      self%block%x_n(:n) = x(1::3)
      self%block%x_t(:, :n) = reshape([x(2::3), x(3::3)], [2, n], order=[2, 1])
      call self%block%evaluate(columns_only=.false.)
      do a = 1, n
         self%block%trial(:, a) = force(3*a - 2:3*a)
      end do
   end subroutine solve_block_by_jacobi

   !> Look at the sticking points whose margin may be used up: those that must move are freed.
   subroutine look_inside(self, problem, q, state, spent, looked, slack, more)
      class(condensed_solver_t), intent(inout) :: self
      type(contact_problem_t), intent(in) :: problem
      real(wp), intent(in) :: q(:)
      type(contact_state_t), intent(in) :: state
      !> (watched)
      real(wp), intent(in) :: spent(:)
      !> (watched) margin where it was looked at, else huge
      real(wp), allocatable, intent(out) :: looked(:)
      real(wp), intent(in) :: slack
      logical, intent(out) :: more
      real(wp) :: force(3)
      real(wp), allocatable :: x(:, :)
      integer, allocatable :: moved(:), leaving(:)
      integer :: j, k, p
      logical :: gathered

      allocate (looked(size(spent)), source=huge(1.0_wp))
      more = .false.
      gathered = .false.
      allocate (leaving(0))
      do j = 1, size(self%base%inside)
         if (spent(j) < self%lookout%margin(j)) cycle
         if (.not. gathered) call gather_moved(self, .true., moved, x)
         gathered = .true.
         force = force_of(self, j, q, moved, x)
         p = self%base%inside(j)
         if (leaves_cone(force, problem%friction(p), slack)) then
            more = .true.
            leaving = [leaving, j]
         else
            looked(j) = problem%friction(p)*force(1) - norm2(force(2:3))
         end if
      end do
      if (.not. more) return
      call gather_moved(self, .false., moved, x)
      do k = 1, size(leaving)
         call follow_point(self, problem, state, leaving(k), force_of(self, leaving(k), state%q, moved, x), moves=.true.)
      end do
      call self%block%predict(q - state%q)
      call self%block%evaluate(columns_only=.true.)
   end subroutine look_inside

   !> Places and increments since the reference, with those of the present step or without them.
   subroutine gather_moved(self, with_step, moved, x)
      class(condensed_solver_t), intent(in) :: self
      logical, intent(in) :: with_step
      integer, allocatable, intent(out) :: moved(:)
      !> (3, moved) m
      real(wp), allocatable, intent(out) :: x(:, :)
      real(wp) :: all_x(3, size(self%has_moved))
      logical :: flag(size(self%has_moved))
      integer :: a, j

      all_x = self%moved
      flag = self%has_moved
      if (with_step) then
         do a = 1, self%block%columns
            j = self%block%place(a)
            all_x(1, j) = all_x(1, j) + self%block%x_n(a)
            all_x(2:3, j) = all_x(2:3, j) + self%block%x_t(:, a)
            flag(j) = .true.
         end do
      end if
      moved = pack([(j, j=1, size(flag))], flag)
      x = all_x(:, moved)
   end subroutine gather_moved

   !> Force of a point of the base set at a driver, N.
   pure function force_of(self, j, q, moved, x) result(force)
      class(condensed_solver_t), intent(in) :: self
      !> Place in the base set
      integer, intent(in) :: j
      real(wp), intent(in) :: q(:)
      !> Places that moved since the reference, and (3, moved) by how much
      integer, intent(in) :: moved(:)
      real(wp), intent(in) :: x(:, :)
      real(wp) :: force(3)
      integer :: c, k, m

      do c = 1, 3
         k = 3*j - 3 + c
         force(c) = self%force_ref(k) + dot_product(self%base%slope(:, k), q - self%q_ref)
         do m = 1, size(moved)
            force(c) = force(c) + dot_product(self%base%M(3*moved(m) - 2:3*moved(m), k), x(:, m))
         end do
      end do
   end function force_of

   !> Points outside the base set that penetrate.
   function closing_points(self, problem, q, state, spent, looked, scale) result(points)
      class(condensed_solver_t), intent(in) :: self
      type(contact_problem_t), intent(in) :: problem
      real(wp), intent(in) :: q(:)
      type(contact_state_t), intent(in) :: state
      real(wp), intent(in) :: spent(:)
      real(wp), intent(inout) :: looked(:)
      !> Largest contact force, N
      real(wp), intent(in) :: scale
      integer, allocatable :: points(:)
      logical :: closes(size(self%base%outside))
      integer, allocatable :: moved(:)
      real(wp), allocatable :: x(:, :)
      integer :: j, k, p, m
      real(wp) :: gap
      logical :: gathered

      closes = .false.
      gathered = .false.
      do j = 1, size(closes)
         k = size(self%base%inside) + j
         if (spent(k) < self%lookout%margin(k) .and. .not. problem%velocity_level) cycle
         if (.not. gathered) call gather_moved(self, .true., moved, x)
         gathered = .true.
         gap = self%gap_ref(j) + dot_product(self%base%slope_outside(:, j), q - self%q_ref)
         do m = 1, size(moved)
            gap = gap + dot_product(self%base%T_t(3*moved(m) - 2:3*moved(m), j), x(:, m))
         end do
         looked(k) = gap
         p = self%base%outside(j)
         ! On velocity level a point joins in the step after it was seen closed.
         if (problem%velocity_level .and. state%gap(1, p) > 0.0_wp) cycle
         closes(j) = gap < -self%tolerance*scale*problem%G(3*p - 2, 3*p - 2)
      end do
      points = pack(self%base%outside, closes)
   end function closing_points

   !> Take points into the base set at the state before the step, with their tangential gap there.
   subroutine take_in(self, problem, points, state, record)
      class(condensed_solver_t), intent(inout) :: self
      type(contact_problem_t), intent(in) :: problem
      integer, intent(in) :: points(:)
      type(contact_state_t), intent(inout) :: state
      type(solve_record_t), intent(inout) :: record
      type(error_t), allocatable :: error
      integer :: j

      call self%complete(problem, state)
      do j = 1, size(points)
         state%gap(:, points(j)) = gap_of_point(problem, state, points(j))
      end do
      call self%base%enter(problem, points, error)
      record%set_changes = record%set_changes + size(points)
      record%converged = record%converged .and. .not. allocated(error)
      call self%lookout%survey(problem, self%base)
      call refresh(self, problem, state)
   end subroutine take_in

   !> gap = r_0 + R q + G force of one point in the state.
   function gap_of_point(problem, state, point) result(gap)
      type(contact_problem_t), intent(in) :: problem
      type(contact_state_t), intent(in) :: state
      integer, intent(in) :: point
      real(wp) :: gap(3)
      integer :: c, k, p

      do c = 1, 3
         k = 3*point - 3 + c
         gap(c) = problem%r_0(k) + dot_product(problem%R(k, :), state%q)
         do p = 1, problem%n_points
            gap(c) = gap(c) + dot_product(problem%G(3*p - 2:3*p, k), state%force(:, p))
         end do
      end do
   end function gap_of_point

   !> Put open points of the base set outside when there are many of them that have been open for long.
   subroutine shed_open_points(self, problem, state, record)
      class(condensed_solver_t), intent(inout) :: self
      type(contact_problem_t), intent(in) :: problem
      type(contact_state_t), intent(inout) :: state
      type(solve_record_t), intent(inout) :: record
      type(error_t), allocatable :: error
      integer, allocatable :: open(:)

      if (count(self%steps_open(self%base%inside) >= open_steps) <= open_carried) return
      open = pack(self%base%inside, self%steps_open(self%base%inside) >= open_steps)
      if (size(open) == size(self%base%inside)) return
      call self%complete(problem, state)
      call self%base%leave(problem, open, error)
      record%set_changes = record%set_changes + size(open)
      record%converged = record%converged .and. .not. allocated(error)
      call self%lookout%survey(problem, self%base)
      call refresh(self, problem, state)
   end subroutine shed_open_points

   !> The solved step becomes the state.
   subroutine commit(self, problem, q, state, spent, looked, record)
      class(condensed_solver_t), intent(inout) :: self
      type(contact_problem_t), intent(in) :: problem
      real(wp), intent(in) :: q(:)
      type(contact_state_t), intent(inout) :: state
      !> (watched)
      real(wp), intent(in) :: spent(:), looked(:)
      type(solve_record_t), intent(inout) :: record
      real(wp) :: x(3), dq(size(q)), slopes(3), rate
      integer :: a, j, p, r, n, k
      integer, allocatable :: moved(:)
      real(wp), allocatable :: moves(:, :)

      dq = q - state%q
      self%largest_dq = max(self%largest_dq, abs(dq))
      associate (block => self%block, base => self%base)
         do a = 1, block%columns
            j = block%place(a)
            p = base%inside(j)
            x = [block%x_n(a), block%x_t(:, a)]
            state%status(p) = block%status(a)
            self%last_increment(:, p) = x
            self%steps_open(p) = merge(self%steps_open(p) + 1, 0, block%status(a) == state_open)
            if (all(x == 0.0_wp)) cycle
            do k = 1, 3
               slopes(k) = dot_product(base%slope(:, 3*j - 3 + k), state%q + q)
            end do
            self%c = self%c + dot_product(x, block%force(:, a) + block%trial(:, a) - slopes)
            self%h = self%h + matmul(base%slope(:, 3*j - 2:3*j), x)
            self%h_output = self%h_output + matmul(base%output_slope(:, 3*j - 2:3*j), x)
            record%friction_loss = record%friction_loss - dot_product(block%trial(2:3, a), x(2:3))
            state%gap(:, p) = state%gap(:, p) + x
            ! What the states prescribe holds to the last bit.
            if (state%status(p) /= state_open .and. .not. problem%velocity_level) state%gap(1, p) = 0.0_wp
            self%moved(:, j) = self%moved(:, j) + x
            self%has_moved(j) = .true.
         end do
         do r = 1, block%rows
            p = base%inside(block%place(r))
            block%change(:, r) = block%trial(:, r) - block%force(:, r)
            block%force(:, r) = block%trial(:, r)
            if (state%status(p) == state_open) block%force(:, r) = 0.0_wp
            state%force(:, p) = block%force(:, r)
         end do
         n = size(base%inside)
         rate = 0.0_wp
         allocate (moved(0), moves(3, 0))
         do j = 1, size(spent)
            rate = spent(j) - self%lookout%used(j)
            self%lookout%used(j) = spent(j)
            if (looked(j) == huge(1.0_wp)) cycle
            self%lookout%margin(j) = looked(j)
            self%lookout%used(j) = 0.0_wp
            if (j > n) then
               state%gap(1, base%outside(j - n)) = looked(j)
            else if (looked(j) < look_ahead*rate) then
               moved = [moved, j]
            end if
         end do
         state%q = q
         if (size(moved) > 0) call follow_looked(self, problem, state, moved)
         record%reaction = matmul(base%stiffness, q) - self%h
         record%output = matmul(base%output_stiffness, q) - self%h_output
         record%contact_energy = 0.5_wp*(self%c + dot_product(q, self%h - record%reaction))
         record%counts(1) = count(state%status == state_open)
         record%counts(2) = count(state%status == state_stick)
         record%counts(3) = problem%n_points - record%counts(1) - record%counts(2)
      end associate
      call retire_sticking(self, problem, state)
   end subroutine commit

   !> Points that were looked at and would soon be again are followed.
   subroutine follow_looked(self, problem, state, places)
      class(condensed_solver_t), intent(inout) :: self
      type(contact_problem_t), intent(in) :: problem
      type(contact_state_t), intent(in) :: state
      integer, intent(in) :: places(:)
      integer, allocatable :: moved(:)
      real(wp), allocatable :: x(:, :)
      integer :: k

      call gather_moved(self, .false., moved, x)
      do k = 1, size(places)
         call follow_point(self, problem, state, places(k), force_of(self, places(k), state%q, moved, x), moves=.false.)
      end do
   end subroutine follow_looked

   !> When most columns stick again, the block starts anew: the others are left to the lookout.
   subroutine retire_sticking(self, problem, state)
      class(condensed_solver_t), intent(inout) :: self
      type(contact_problem_t), intent(in) :: problem
      type(contact_state_t), intent(in) :: state
      real(wp) :: force(3, size(self%base%inside))
      integer :: r, sticking

      sticking = count(self%block%status(:self%block%columns) == state_stick)
      if (2*sticking <= self%block%columns + 16 .and. (self%block%columns > 0 .or. self%block%rows <= 32)) return
      do r = 1, self%block%rows
         force(:, self%block%place(r)) = self%block%force(:, r)
         call watch_inside(self, problem, self%block%place(r), self%block%force(:, r))
      end do
      call renew_block(self, problem, state, force)
   end subroutine retire_sticking

   !> Bring the forces of all points and the gaps of those outside up to the state's driver.
   subroutine complete(self, problem, state)
      class(condensed_solver_t), intent(inout) :: self
      type(contact_problem_t), intent(in) :: problem
      type(contact_state_t), intent(inout) :: state
      real(wp), allocatable :: force(:), gap(:)
      integer :: j, m, k, n, r

      n = size(self%base%inside)
      force = self%force_ref + matmul(state%q - self%q_ref, self%base%slope)
      gap = self%gap_ref + matmul(state%q - self%q_ref, self%base%slope_outside)
      if (any(self%has_moved)) gap = gap + matmul(reshape(self%moved, [3*n]), self%base%T_t)
      do m = 1, n
         if (.not. self%has_moved(m)) cycle
         do k = 1, 3
            if (self%moved(k, m) == 0.0_wp) cycle
            force = force + self%base%M(:, 3*m - 3 + k)*self%moved(k, m)
         end do
      end do
      do r = 1, self%block%rows
         j = self%block%place(r)
         force(3*j - 2:3*j) = self%block%force(:, r)
      end do
      do j = 1, n
         state%force(:, self%base%inside(j)) = force(3*j - 2:3*j)
         if (self%lookout%margin(j) < huge(1.0_wp)) call watch_inside(self, problem, j, force(3*j - 2:3*j))
      end do
      state%force(:, self%base%outside) = 0.0_wp
      state%status(self%base%outside) = state_open
      state%gap(1, self%base%outside) = gap
      self%lookout%margin(n + 1:) = gap
      self%lookout%used(n + 1:) = 0.0_wp
   end subroutine complete

end module microslip_contact_condensed
