!> The fast contact solver: stick predictor, slip/lift-off corrector (METHOD section 5).
!>
!> On the base set, closed points stick unless they must not: only points that are open, slip, or leave
!> their cone carry unknowns. Without friction a closed point has none either: it slides freely, and its
!> tangential gap follows from the definition when it is asked for (`complete`). Newton with kept factors
!> solves for the unknowns (`block_newton`), with block Gauss-Seidel as the rescue, or the paper's projected
!> Jacobi with the sticking points eliminated. A step that both do not solve is solved in the contact forces (`rescue`).
!> All others are looked at only where a bound says that their margin may be used up (`lookout`), and the
!> forces on the structure come from what moved alone (`reference`): a step without slip costs what a
!> linear system of the drivers costs.
module microslip_contact_condensed
   use microslip_contact_base_set, only: base_set_t
   use microslip_contact_block, only: contact_block_t
   use microslip_contact_block_gauss_seidel, only: sweep_gauss_seidel
   use microslip_contact_block_jacobi, only: solve_jacobi
   use microslip_contact_block_newton, only: solve_newton
   use microslip_contact_coupled_blocks, only: count_columns, evaluate_others, predict_all
   use microslip_contact_kept_factor, only: kept_factor_t
   use microslip_contact_laws, only: smallest_force, state_at_rest, state_open, state_slip, state_stick
   use microslip_contact_lookout, only: lookout_t, margin_of
   use microslip_contact_problem, only: contact_problem_t, contact_state_t, solve_record_t, contact_solver_t, book_step, &
      & count_states, friction_work, gap_of, gap_of_point
   use microslip_contact_reference, only: reference_t, moves_t
   use microslip_contact_rescue, only: solve_by_forces
   use microslip_core_error, only: error_t, failure
   use microslip_core_kinds, only: wp
   implicit none(type, external)
   private

   public :: condensed_solver_t

   !> Newton steps before Gauss-Seidel is asked, sweeps it may take, rounds of both, and rescues of a step in all.
   integer, parameter :: newton_steps = 40, rescue_sweeps = 400, rescue_rounds = 10, most_rescues = 3*rescue_rounds
   !> Rounds after which a residual above the largest force is taken for divergence.
   integer, parameter :: patience = 3
   !> Part of the tolerance that Newton is asked for.
   real(wp), parameter :: newton_share = 1.0e-1_wp
   !> Rounds of solving and checking the rest.
   integer, parameter :: max_rounds = 200
   !> Open points of the base set that are carried along, and for how many steps the others are.
   integer, parameter :: open_carried = 16, open_steps = 400
   !> Steps after which everything is computed anew from the definition (rounding); the first times earlier, because
   !> by then it is known how far the drivers move in a step.
   integer, parameter :: refresh_after = 500, first_refresh = 10
   !> A point that would need a look again within so many steps is followed.
   real(wp), parameter :: look_ahead = 12.0_wp
   !> Points outside that would close in so many more steps join with those that close.
   real(wp), parameter :: steps_ahead = 8.0_wp
   !> Rows that are kept while nothing moves.
   integer, parameter :: rows_at_rest = 32
   !> Residual of a step that did not converge, over the tolerance, with which its forces are taken all the same.
   real(wp), parameter :: acceptable = 1.0e3_wp
   !> Forces that grow by more than this in a step are no measure for its residual.
   real(wp), parameter :: runaway = 1.0e6_wp

   type, extends(contact_solver_t) :: condensed_solver_t
      !> Solve the blocks by the paper's projected Jacobi instead of Newton
      logical :: by_jacobi = .false.
      !> (points) points expected to close in the first step: they are in the base set from the start
      logical, allocatable :: expected_closed(:)
      type(base_set_t), private :: base
      !> (groups)
      type(contact_block_t), allocatable, private :: blocks(:)
      type(kept_factor_t), allocatable, private :: kept(:)
      type(lookout_t), private :: lookout
      type(reference_t), private :: reference
      !> (3, points) gap increments of the last step, and a guess for the next; (points) steps that a point is open
      real(wp), allocatable, private :: last_increment(:, :), guess(:, :)
      integer, allocatable, private :: steps_open(:)
      !> (drivers) largest |dq| since the reference was taken
      real(wp), allocatable, private :: largest_dq(:)
      integer, private :: steps_since_refresh = 0, refresh_due = first_refresh
      !> Largest contact force of the last step, and when all were last known, N
      real(wp), private :: last_scale = 0.0_wp, known_scale = 0.0_wp
      !> Nothing but the state, which is complete, can be relied on: a step came to nothing, or was solved in the forces
      logical, private :: lost = .false.
      !> The rescue in the forces failed, and no step has converged since
      logical, private :: beyond_rescue = .false.
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

      if (.not. is_symmetric(problem%G)) then
         call failure(error, 'contact compliance G is not symmetric')
         return
      end if
      in_base = state%status /= state_open
      if (allocated(self%guess)) deallocate (self%last_increment, self%guess, self%steps_open, self%largest_dq)
      if (allocated(self%blocks)) deallocate (self%blocks, self%kept)
      allocate (self%last_increment(3, problem%n_points), self%guess(3, problem%n_points), source=0.0_wp)
      allocate (self%steps_open(problem%n_points), source=0)
      allocate (self%largest_dq(size(problem%R, 2)), source=0.0_wp)
      if (allocated(self%expected_closed)) then
         where (self%expected_closed .and. .not. in_base) self%guess(1, :) = -state%gap(1, :)
         in_base = in_base .or. self%expected_closed
         deallocate (self%expected_closed)
      end if
      self%refresh_due = first_refresh
      call begin_with(self, problem, state, in_base, error)
   end subroutine start

   !> Build the base set and count from the state.
   subroutine begin_with(self, problem, state, in_base, error)
      class(condensed_solver_t), intent(inout) :: self
      type(contact_problem_t), intent(in) :: problem
      type(contact_state_t), intent(in) :: state
      !> (points)
      logical, intent(in) :: in_base(:)
      type(error_t), allocatable, intent(out) :: error
      integer :: p

      call self%base%build(problem, pack([(p, p=1, problem%n_points)], in_base), error)
      self%lost = allocated(error)
      if (self%lost) return
      call self%lookout%survey(problem, self%base)
      call refresh(self, problem, state)
   end subroutine begin_with

   !> Symmetry up to rounding, seen by a vector: only one triangle of G enters.
   pure logical function is_symmetric(G)
      real(wp), intent(in) :: G(:, :)
      real(wp) :: x(size(G, 1)), largest
      integer :: k

      x = [(sin(real(k, wp)**2), k=1, size(x))]
      largest = maxval([(abs(G(k, k)), k=1, size(x))])
      is_symmetric = all(abs(matmul(G, x) - matmul(x, G)) <= 1.0e-10_wp*largest*sqrt(real(size(x), wp)))
   end function is_symmetric

   !> Take the state, up to its driver in the gaps of the base set, as the new reference.
   subroutine refresh(self, problem, state)
      class(condensed_solver_t), intent(inout) :: self
      type(contact_problem_t), intent(in) :: problem
      type(contact_state_t), intent(in) :: state

      call self%reference%take(problem, self%base, state)
      self%known_scale = max(0.0_wp, maxval(self%reference%force(1, :)))
      if (maxval(self%largest_dq) > 0.0_wp) then
         call self%lookout%weigh(problem, self%base, self%largest_dq)
      else
         call self%lookout%weigh(problem, self%base, spread(1.0_wp, 1, size(self%largest_dq)))
      end if
      self%largest_dq = 0.0_wp
      call self%lookout%watch_all(problem, self%base, self%reference%force, self%reference%gap)
      call renew_blocks(self, problem, state, self%reference%force)
      self%steps_since_refresh = 0
   end subroutine refresh

   !> Empty the blocks but for the points that slip against friction or are open.
   subroutine renew_blocks(self, problem, state, force)
      class(condensed_solver_t), intent(inout) :: self
      type(contact_problem_t), intent(in) :: problem
      type(contact_state_t), intent(in) :: state
      !> (3, inside) forces; only those of slipping and open points need be right
      real(wp), intent(in) :: force(:, :)
      integer :: g, j, p

      if (allocated(self%blocks)) then
         if (size(self%blocks) /= self%base%groups .or. size(self%blocks(1)%basis, 2) /= size(self%base%basis, 1)) &
            & deallocate (self%blocks, self%kept)
      end if
      if (.not. allocated(self%blocks)) allocate (self%blocks(self%base%groups), self%kept(self%base%groups))
      do g = 1, size(self%blocks)
         call self%blocks(g)%clear(self%base)
         call self%kept(g)%drop()
      end do
      do j = 1, size(self%base%inside)
         p = self%base%inside(j)
         if (any(state%status(p) == [state_stick, state_at_rest(problem%friction(p))])) cycle
         call follow(self, problem, state, j, force(:, j), moves=.true.)
      end do
   end subroutine renew_blocks

   !> A point of the base set is followed from now on, and may move.
   subroutine follow(self, problem, state, place, force, moves)
      class(condensed_solver_t), intent(inout) :: self
      type(contact_problem_t), intent(in) :: problem
      type(contact_state_t), intent(in) :: state
      integer, intent(in) :: place
      !> Its force in the state, N
      real(wp), intent(in) :: force(3)
      logical, intent(in) :: moves

      associate (block => self%blocks(self%base%group(place)))
         call block%add_row(self%base, place, problem%friction(self%base%inside(place)))
         block%force(:, block%rows) = force
         block%predicted(:, block%rows) = force
         block%trial(:, block%rows) = force
         block%change(:, block%rows) = 0.0_wp
         call self%lookout%forget(place)
         if (moves) call free_row(self%base, problem, state, block, block%rows)
      end associate
   end subroutine follow

   !> The point of a row may move from now on.
   subroutine free_row(base, problem, state, block, row)
      type(base_set_t), intent(in) :: base
      type(contact_problem_t), intent(in) :: problem
      type(contact_state_t), intent(in) :: state
      type(contact_block_t), intent(inout) :: block
      integer, intent(in) :: row
      integer :: p

      call block%add_column(base, row)
      p = base%inside(block%place(block%columns))
      call set_start(block, block%columns, problem, state, p, [0.0_wp, 0.0_wp, 0.0_wp])
   end subroutine free_row

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
      integer :: round
      real(wp) :: scale
      logical :: more, hopeless
      type(error_t), allocatable :: error

      if (self%lost) call begin_with(self, problem, state, state%status /= state_open, error)
      if (self%lost) then
         call rescue(self, problem, q, state, record)
         return
      end if
      if (self%steps_since_refresh >= self%refresh_due) then
         self%refresh_due = min(5*self%refresh_due, refresh_after)
         call refresh(self, problem, state)
      end if
      self%steps_since_refresh = self%steps_since_refresh + 1
      record%converged = .true.
      call shed_open_points(self, problem, state, record)
      if (self%lost) then
         call rescue(self, problem, q, state, record)
         return
      end if
      call begin_step(self, problem, q, state)
      call guess_violated(self, problem, state)
      do round = 1, max_rounds
         scale = force_scale(self)
         call solve_blocks(self, scale, record)
         hopeless = record%rescues >= most_rescues .or. (record%iterations >= self%max_iterations .and. .not. record%converged)
         if (hopeless) exit
         call evaluate_others(self%blocks, self%base%coupling)
         scale = force_scale(self)
         call free_violated(self, problem, state, self%tolerance*scale, more)
         if (more) cycle
         call spend(self, q - state%q, spent)
         call look_inside(self, problem, q, state, spent, looked, self%tolerance*scale, more)
         if (more) cycle
         closing = closing_points(self, problem, q, state, spent, looked, scale)
         if (size(closing) == 0) exit
         ! Points that close join at the state before this step.
         if (.not. problem%velocity_level) closing = points_closing_soon(self, closing, q, state)
         call take_in(self, problem, closing, state, record)
         if (self%lost) then
            call rescue(self, problem, q, state, record)
            return
         end if
         call begin_step(self, problem, q, state)
      end do
      hopeless = hopeless .or. round > max_rounds
      record%converged = record%converged .and. .not. hopeless
      self%last_scale = force_scale(self)
      record%residual = maxval(self%blocks%residual)/self%last_scale
      if (hopeless .or. .not. record%converged) then
         call rescue(self, problem, q, state, record)
         if (record%converged .or. hopeless .or. .not. record%residual <= acceptable*self%tolerance) return
         self%lost = .false.
      end if
      self%beyond_rescue = self%beyond_rescue .and. .not. record%converged
      call commit(self, problem, q, state, spent, looked, record)
      if (.not. self%lazy) call self%complete(problem, state)
   end subroutine advance

   !> Where the blocks do not get there: solve the step in the contact forces. If that fails too, the state stays as it was
   !> before the step: forces that break the laws would mislead the steps to come.
   subroutine rescue(self, problem, q, state, record)
      class(condensed_solver_t), intent(inout) :: self
      type(contact_problem_t), intent(in) :: problem
      real(wp), intent(in) :: q(:)
      type(contact_state_t), intent(inout) :: state
      type(solve_record_t), intent(inout) :: record
      logical :: closed(problem%n_points)
      integer :: a, g

      call self%complete(problem, state)
      closed = state%status /= state_open
      if (.not. self%lost) then
         do g = 1, size(self%blocks)
            do a = 1, self%blocks(g)%columns
               closed(self%base%inside(self%blocks(g)%place(a))) = self%blocks(g)%status(a) /= state_open
            end do
         end do
      end if
      self%lost = .true.
      record%converged = .false.
      if (.not. (self%by_jacobi .or. self%beyond_rescue)) call solve_by_forces(problem, self%base, self%tolerance, &
         & self%max_iterations, q, closed, state, record)
      self%beyond_rescue = .not. record%converged
      if (.not. record%converged) call book_step(problem, state, state, record)
      self%guess = 0.0_wp
      self%last_increment = 0.0_wp
   end subroutine rescue

   !> Predictions and start values of a step.
   subroutine begin_step(self, problem, q, state)
      class(condensed_solver_t), intent(inout) :: self
      type(contact_problem_t), intent(in) :: problem
      real(wp), intent(in) :: q(:)
      type(contact_state_t), intent(in) :: state
      integer :: a, g, p

      call predict_all(self%blocks, q - state%q)
      do g = 1, size(self%blocks)
         do a = 1, self%blocks(g)%columns
            p = self%base%inside(self%blocks(g)%place(a))
            call set_start(self%blocks(g), a, problem, state, p, self%guess(:, p))
         end do
      end do
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
      block%x(:, a) = guess
      if (.not. block%forced_open(a)) block%x(1, a) = max(block%x(1, a), -block%gap_old(a))
   end subroutine set_start

   !> Size of the largest contact force in the step, as last known, N.
   pure real(wp) function force_scale(self)
      class(condensed_solver_t), intent(in) :: self
      real(wp) :: expected
      integer :: a, g
      logical :: all_open

      force_scale = self%known_scale
      expected = max(self%known_scale, self%last_scale)
      all_open = count_columns(self%blocks) == size(self%base%inside)
      do g = 1, size(self%blocks)
         associate (block => self%blocks(g))
            force_scale = max(force_scale, maxval(block%trial(1, :block%columns)), maxval(block%predicted(1, :block%rows)))
            expected = max(expected, maxval(block%predicted(1, :block%rows)), &
               & maxval(block%stiffness_n(:block%columns)*abs(block%gap_old(:block%columns))))
            all_open = all_open .and. all(block%status(:block%columns) == state_open)
         end associate
      end do
      ! Where nothing is closed any more, what is left of the forces is rounding, and the scale stays.
      if (all_open) force_scale = max(force_scale, self%last_scale)
      ! Points that close from afar: what it takes to close them alone.
      do g = 1, size(self%blocks)
         do a = 1, self%blocks(g)%columns
            if (force_scale > 0.0_wp) exit
            force_scale = max(force_scale, self%blocks(g)%stiffness_n(a)*abs(self%blocks(g)%gap_old(a)))
         end do
      end do
      force_scale = max(min(force_scale, runaway*expected), smallest_force)
   end function force_scale

   !> A first guess which followed points must move: those that would leave their cones if the last step were repeated.
   subroutine guess_violated(self, problem, state)
      class(condensed_solver_t), intent(inout) :: self
      type(contact_problem_t), intent(in) :: problem
      type(contact_state_t), intent(in) :: state
      integer :: g
      logical :: any_freed

      do g = 1, size(self%blocks)
         associate (block => self%blocks(g))
            block%trial(:, :block%rows) = block%force(:, :block%rows) + block%change(:, :block%rows)
         end associate
      end do
      call free_violated(self, problem, state, 0.0_wp, any_freed)
   end subroutine guess_violated

   !> Followed points outside their cones may move from now on.
   subroutine free_violated(self, problem, state, slack, more)
      class(condensed_solver_t), intent(inout) :: self
      type(contact_problem_t), intent(in) :: problem
      type(contact_state_t), intent(in) :: state
      !> Violation that is let pass, N
      real(wp), intent(in) :: slack
      !> Whether there are any
      logical, intent(out) :: more
      integer :: g, r

      more = .false.
      do g = 1, size(self%blocks)
         associate (block => self%blocks(g))
            do r = block%columns + 1, block%rows
               if (.not. leaves_cone(block%trial(:, r), block%friction(r), slack)) cycle
               call free_row(self%base, problem, state, block, r)
               more = .true.
            end do
         end associate
      end do
   end subroutine free_violated

   !> Whether a sticking point cannot stick with this force.
   pure logical function leaves_cone(force, friction, slack)
      real(wp), intent(in) :: force(3), friction, slack
      leaves_cone = norm2(force(2:3)) > friction*force(1) + slack .or. force(1) < -slack
   end function leaves_cone

   !> Solve the blocks: Newton with Gauss-Seidel to the rescue, or the paper's projected Jacobi.
   subroutine solve_blocks(self, scale, record)
      class(condensed_solver_t), intent(inout) :: self
      !> Force that tolerances refer to, N
      real(wp), intent(in) :: scale
      type(solve_record_t), intent(inout) :: record
      real(wp) :: residual, force_error
      integer :: g, steps, sweeps, round, most

      if (count_columns(self%blocks) == 0) return
      if (self%by_jacobi) then
         most = max(0, self%max_iterations - record%iterations)
         call solve_jacobi(self%blocks, self%base, self%tolerance, most, sweeps, record%error_estimate)
         record%iterations = record%iterations + sweeps
         record%converged = record%error_estimate <= self%tolerance
         return
      end if
      do round = 1, rescue_rounds
         most = max(0, self%max_iterations - record%iterations)
         call solve_newton(self%blocks, self%kept, self%base%coupling, scale, newton_share*self%tolerance*scale, &
            & min(newton_steps, most), steps, residual, force_error)
         record%iterations = record%iterations + steps
         record%error_estimate = force_error/scale
         if (residual <= self%tolerance*scale .or. (round > patience .and. .not. residual <= scale)) exit
         most = self%max_iterations - record%iterations
         if (most <= 0) exit
         record%rescues = record%rescues + 1
         do g = 1, size(self%blocks)
            call self%kept(g)%drop()
            associate (block => self%blocks(g))
               if (.not. all(abs(block%x(:, :block%columns)) < huge(1.0_wp))) block%x = 0.0_wp
            end associate
         end do
         call sweep_gauss_seidel(self%blocks, self%base%coupling, self%tolerance*scale, min(rescue_sweeps, most), sweeps, residual)
         record%iterations = record%iterations + sweeps
      end do
      record%converged = residual <= self%tolerance*scale
   end subroutine solve_blocks

   !> What the step would have used up of the margins, (watched).
   subroutine spend(self, dq, spent)
      class(condensed_solver_t), intent(in) :: self
      real(wp), intent(in) :: dq(:)
      real(wp), allocatable, intent(out) :: spent(:)
      integer :: g

      spent = self%lookout%used
      call self%lookout%spend_drivers(dq, spent)
      do g = 1, size(self%blocks)
         associate (block => self%blocks(g))
            call self%lookout%spend_moves(block%place(:block%columns), block%x, spent)
         end associate
      end do
   end subroutine spend

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
      type(moves_t) :: moves, moves_before
      integer, allocatable :: due(:)
      logical, allocatable :: leaves(:)
      integer :: j, k, p

      allocate (looked(size(spent)), source=huge(1.0_wp))
      more = .false.
      j = size(self%base%inside)
      due = pack([(k, k=1, j)], spent(:j) >= self%lookout%margin(:j))
      if (size(due) == 0) return
      moves = self%reference%moves(q, self%blocks)
      allocate (leaves(size(due)))
      do k = 1, size(due)
         j = due(k)
         p = self%base%inside(j)
         force = self%reference%force_of(self%base, j, moves)
         leaves(k) = leaves_cone(force, problem%friction(p), slack)
         looked(j) = margin_of(force, problem%friction(p))
      end do
      more = any(leaves)
      if (.not. more) return
      moves_before = self%reference%moves(state%q)
      do k = 1, size(due)
         if (.not. leaves(k)) cycle
         force = self%reference%force_of(self%base, due(k), moves_before)
         call follow(self, problem, state, due(k), force, moves=.true.)
      end do
      call predict_all(self%blocks, q - state%q)
   end subroutine look_inside

   !> Points outside the base set that penetrate.
   function closing_points(self, problem, q, state, spent, looked, scale) result(points)
      class(condensed_solver_t), intent(in) :: self
      type(contact_problem_t), intent(in) :: problem
      real(wp), intent(in) :: q(:)
      type(contact_state_t), intent(in) :: state
      real(wp), intent(in) :: spent(:)
      !> Gaps are added where points outside were looked at, m
      real(wp), intent(inout) :: looked(:)
      !> Largest contact force, N
      real(wp), intent(in) :: scale
      integer, allocatable :: points(:)
      integer, allocatable :: due(:)
      logical, allocatable :: closes(:)
      type(moves_t) :: moves
      integer :: k, p, n

      n = size(self%base%inside)
      due = pack([(k, k=1, size(self%base%outside))], spent(n + 1:) >= self%lookout%margin(n + 1:) .or. problem%velocity_level)
      points = due
      if (size(due) == 0) return
      moves = self%reference%moves(q, self%blocks)
      allocate (closes(size(due)), source=.false.)
      do k = 1, size(due)
         looked(n + due(k)) = self%reference%gap_outside(self%base, due(k), moves)
         p = self%base%outside(due(k))
         ! On velocity level a point joins in the step after it was seen closed.
         if (problem%velocity_level .and. state%gap(1, p) > 0.0_wp) cycle
         closes(k) = looked(n + due(k)) < -self%tolerance*scale*problem%G(3*p - 2, 3*p - 2)
      end do
      points = self%base%outside(pack(due, closes))
   end function closing_points

   !> The points that close, and those that would in the next steps if the last one were repeated: a change of the base
   !> set costs about the same for one as for many.
   function points_closing_soon(self, closing, q, state) result(points)
      class(condensed_solver_t), intent(in) :: self
      integer, intent(in) :: closing(:)
      real(wp), intent(in) :: q(:)
      type(contact_state_t), intent(in) :: state
      integer, allocatable :: points(:)
      type(moves_t) :: before, after
      logical :: closes(size(self%base%outside))
      real(wp) :: gap, gap_before
      integer :: j

      before = self%reference%moves(state%q)
      after = self%reference%moves(q, self%blocks)
      do j = 1, size(closes)
         gap = self%reference%gap_outside(self%base, j, after)
         gap_before = self%reference%gap_outside(self%base, j, before)
         closes(j) = gap + steps_ahead*(gap - gap_before) < 0.0_wp .or. any(closing == self%base%outside(j))
      end do
      points = pack(self%base%outside, closes)
   end function points_closing_soon

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
      self%lost = allocated(error)
      record%converged = .not. self%lost
      if (self%lost) return
      call self%lookout%survey(problem, self%base)
      call refresh(self, problem, state)
   end subroutine take_in

   !> Put open points of the base set outside when there are many of them that have been open for long.
   subroutine shed_open_points(self, problem, state, record)
      class(condensed_solver_t), intent(inout) :: self
      type(contact_problem_t), intent(in) :: problem
      type(contact_state_t), intent(inout) :: state
      type(solve_record_t), intent(inout) :: record
      type(error_t), allocatable :: error
      integer, allocatable :: open(:)

      open = pack(self%base%inside, self%steps_open(self%base%inside) >= open_steps)
      if (size(open) <= open_carried .or. size(open) == size(self%base%inside)) return
      call self%complete(problem, state)
      call self%base%leave(problem, open, error)
      record%set_changes = record%set_changes + size(open)
      self%lost = allocated(error)
      record%converged = .not. self%lost
      if (self%lost) return
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
      integer :: g

      self%largest_dq = max(self%largest_dq, abs(q - state%q))
      do g = 1, size(self%blocks)
         call commit_block(self, problem, g, q, state, record)
      end do
      state%q = q
      call commit_looks(self, problem, state, spent, looked)
      call self%reference%report(self%base, q, record)
      record%counts = count_states(state)
      call retire_sticking(self, problem, state)
   end subroutine commit

   !> Increments and forces of a block become the state.
   subroutine commit_block(self, problem, g, q, state, record)
      class(condensed_solver_t), intent(inout) :: self
      type(contact_problem_t), intent(in) :: problem
      integer, intent(in) :: g
      real(wp), intent(in) :: q(:)
      type(contact_state_t), intent(inout) :: state
      type(solve_record_t), intent(inout) :: record
      real(wp) :: x(3)
      integer :: a, p, r

      associate (block => self%blocks(g))
         call self%reference%add(self%base, block, state%q, q)
         do a = 1, block%columns
            p = self%base%inside(block%place(a))
            x = block%x(:, a)
            state%status(p) = block%status(a)
            if (block%status(a) == state_stick) state%status(p) = state_at_rest(problem%friction(p))
            ! Slip that goes on goes on changing as it did.
            self%guess(:, p) = x
            if (any(self%last_increment(2:3, p) /= 0.0_wp)) self%guess(2:3, p) = 2.0_wp*x(2:3) - self%last_increment(2:3, p)
            self%last_increment(:, p) = x
            self%steps_open(p) = merge(self%steps_open(p) + 1, 0, block%status(a) == state_open)
            if (all(x == 0.0_wp)) cycle
            record%friction_loss = record%friction_loss + friction_work(state%status(p), block%friction(a), block%force(1, a), &
               & block%trial(:, a), x(2:3))
            state%gap(:, p) = state%gap(:, p) + x
            ! What the states prescribe holds to the last bit.
            if (state%status(p) /= state_open .and. .not. problem%velocity_level) state%gap(1, p) = 0.0_wp
         end do
         do r = 1, block%rows
            p = self%base%inside(block%place(r))
            if (state%status(p) == state_open) block%trial(:, r) = 0.0_wp
            block%change(:, r) = block%trial(:, r) - block%force(:, r)
            block%force(:, r) = block%trial(:, r)
            state%force(:, p) = block%trial(:, r)
         end do
      end associate
   end subroutine commit_block

   !> What the step used up of the margins, and what was seen; points that would soon need a look again are followed.
   subroutine commit_looks(self, problem, state, spent, looked)
      class(condensed_solver_t), intent(inout) :: self
      type(contact_problem_t), intent(in) :: problem
      type(contact_state_t), intent(inout) :: state
      !> (watched)
      real(wp), intent(in) :: spent(:), looked(:)
      type(moves_t) :: moves
      real(wp) :: rate
      integer :: j, n

      n = size(self%base%inside)
      do j = 1, size(spent)
         rate = spent(j) - self%lookout%used(j)
         self%lookout%used(j) = spent(j)
         if (looked(j) == huge(1.0_wp)) cycle
         self%lookout%margin(j) = looked(j)
         self%lookout%used(j) = 0.0_wp
         if (j > n) then
            state%gap(1, self%base%outside(j - n)) = looked(j)
         else if (looked(j) < look_ahead*rate) then
            if (.not. allocated(moves%x)) moves = self%reference%moves(state%q)
            call follow(self, problem, state, j, self%reference%force_of(self%base, j, moves), moves=.false.)
         end if
      end do
   end subroutine commit_looks

   !> When most columns stick again, the blocks start anew: the others are left to the lookout.
   subroutine retire_sticking(self, problem, state)
      class(condensed_solver_t), intent(inout) :: self
      type(contact_problem_t), intent(in) :: problem
      type(contact_state_t), intent(in) :: state
      real(wp), allocatable :: force(:, :)
      real(wp), allocatable :: gap(:)
      integer :: g, columns, sticking

      columns = count_columns(self%blocks)
      sticking = sum([(count(self%blocks(g)%status(:self%blocks(g)%columns) == state_stick), g=1, size(self%blocks))])
      if (columns == 0 .and. sum(self%blocks%rows) <= rows_at_rest) return
      if (columns > 0 .and. 2*sticking <= columns + 16) return
      ! The motion turns: the next looks need not go back beyond here.
      call present(self, state%q, force, gap)
      call self%reference%move_up(state%q, force, gap)
      call self%lookout%watch_all(problem, self%base, force, gap)
      call renew_blocks(self, problem, state, force)
   end subroutine retire_sticking

   !> Forces of the base set, (3, inside), and gaps outside it, (outside), at the state's driver.
   subroutine present(self, q, force, gap)
      class(condensed_solver_t), intent(in) :: self
      real(wp), intent(in) :: q(:)
      real(wp), allocatable, intent(out) :: force(:, :), gap(:)
      integer :: g, r

      call self%reference%everywhere(self%base, q, force, gap)
      do g = 1, size(self%blocks)
         do r = 1, self%blocks(g)%rows
            force(:, self%blocks(g)%place(r)) = self%blocks(g)%force(:, r)
         end do
      end do
   end subroutine present

   !> Bring the forces of all points, the gaps of those outside, and the slip of those without friction up to the state's
   !> driver.
   subroutine complete(self, problem, state)
      class(condensed_solver_t), intent(inout) :: self
      type(contact_problem_t), intent(in) :: problem
      type(contact_state_t), intent(inout) :: state
      real(wp), allocatable :: force(:, :), gap(:), whole_gap(:, :)
      integer, allocatable :: free(:)
      integer :: j, n

      if (self%lost) return
      n = size(self%base%inside)
      call present(self, state%q, force, gap)
      self%known_scale = max(0.0_wp, maxval(force(1, :)))
      do j = 1, n
         state%force(:, self%base%inside(j)) = force(:, j)
         if (self%lookout%margin(j) < huge(1.0_wp)) call self%lookout%watch(j, force(:, j), problem%friction(self%base%inside(j)))
      end do
      state%force(:, self%base%outside) = 0.0_wp
      state%status(self%base%outside) = state_open
      state%gap(1, self%base%outside) = gap
      self%lookout%margin(n + 1:) = gap
      self%lookout%used(n + 1:) = 0.0_wp
      free = pack(self%base%inside, problem%friction(self%base%inside) <= 0.0_wp)
      if (size(free) == 0) return
      whole_gap = gap_of(problem, state%q, state%force)
      state%gap(2:3, free) = whole_gap(2:3, free)
   end subroutine complete

end module microslip_contact_condensed
