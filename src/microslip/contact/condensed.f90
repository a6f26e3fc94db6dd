!> The fast contact solver: stick predictor, slip/lift-off corrector (METHOD section 5).
!>
!> On the base set, closed points stick unless they must not: only points that are open, slip, or leave
!> their cone carry unknowns. Their dense block is solved exactly by Newton (`block_newton`), with block
!> Gauss-Seidel as the rescue, or by the paper's projected Jacobi with the sticking points eliminated.
!> The rest is checked afterwards: sticking points against their cones, points outside against closing.
module microslip_contact_condensed
   use microslip_contact_base_set, only: base_set_t
   use microslip_contact_block_gauss_seidel, only: sweep_gauss_seidel
   use microslip_contact_block_newton, only: contact_block_t, solve_newton, block_residual
   use microslip_contact_laws, only: state_open, state_stick
   use microslip_contact_problem, only: contact_problem_t, contact_state_t, solve_record_t, contact_solver_t
   use microslip_contact_projected_jacobi, only: step_lengths, contraction_gap, iterate_projected_jacobi, states_of_forces
   use microslip_core_error, only: error_t
   use microslip_core_kinds, only: wp
   use microslip_linalg_dense, only: inverse_spd, product_symmetric
   implicit none(type, external)
   private

   public :: condensed_solver_t

   !> Newton steps before Gauss-Seidel is asked, sweeps it may take, and rounds of both.
   integer, parameter :: newton_steps = 25, rescue_sweeps = 400, rescue_rounds = 10
   !> Rounds of solving and checking the rest.
   integer, parameter :: max_rounds = 200
   !> Open points of the base set that are carried along before they are put outside.
   integer, parameter :: open_carried = 16
   !> Steps after which forces and outside gaps are computed anew from the definition (rounding).
   integer, parameter :: refresh_after = 500

   type, extends(contact_solver_t) :: condensed_solver_t
      !> Solve the block by the paper's projected Jacobi instead of Newton
      logical :: by_jacobi = .false.
      !> (points) points expected to close in the first step: they are in the base set from the start
      logical, allocatable :: expected_closed(:)
      type(base_set_t), private :: base
      !> (3 inside) N, (outside) m: current values
      real(wp), allocatable, private :: force(:), gap_outside(:)
      !> (3, points) gap increments of the last step: start value of the next
      real(wp), allocatable, private :: last_increment(:, :)
      integer, private :: steps_since_refresh = 0
   contains
      procedure :: start
      procedure :: advance
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
      if (allocated(self%last_increment)) deallocate (self%last_increment)
      allocate (self%last_increment(3, problem%n_points), source=0.0_wp)
      if (allocated(self%expected_closed)) then
         where (self%expected_closed .and. .not. in_base) self%last_increment(1, :) = -state%gap(1, :)
         in_base = in_base .or. self%expected_closed
      end if
      call self%base%build(problem, pack([(p, p=1, problem%n_points)], in_base), error)
      if (allocated(error)) return
      call refresh(self, problem, state)
   end subroutine start

   !> Forces of the base set and gaps outside it from the definition: force = M (gap - r_0 - R q).
   subroutine refresh(self, problem, state)
      class(condensed_solver_t), intent(inout) :: self
      type(contact_problem_t), intent(in) :: problem
      type(contact_state_t), intent(in) :: state
      real(wp), allocatable :: difference(:), force(:), gap_outside(:)
      integer :: j, p, k

      allocate (difference(3*size(self%base%inside)))
      do j = 1, size(self%base%inside)
         p = self%base%inside(j)
         k = 3*p - 2
         difference(3*j - 2:3*j) = state%gap(:, p) - problem%r_0(k:k + 2)
      end do
      force = difference
      call product_symmetric(self%base%M, difference, force)
      force = force + matmul(self%base%S, state%q)
      gap_outside = problem%r_0(3*self%base%outside - 2)
      gap_outside = gap_outside + matmul(self%base%N, state%q)
      gap_outside = gap_outside + matmul(self%base%T, difference)
      call move_alloc(force, self%force)
      call move_alloc(gap_outside, self%gap_outside)
      self%steps_since_refresh = 0
   end subroutine refresh

   !> Take the state to driver q.
   subroutine advance(self, problem, q, state, record)
      class(condensed_solver_t), intent(inout) :: self
      type(contact_problem_t), intent(in) :: problem
      !> (drivers)
      real(wp), intent(in) :: q(:)
      type(contact_state_t), intent(inout) :: state
      type(solve_record_t), intent(out) :: record
      type(contact_block_t) :: block
      real(wp), allocatable :: predicted(:), predicted_outside(:)
      logical, allocatable :: active(:)
      integer, allocatable :: closing(:), list(:)
      integer :: round, inside_before
      real(wp) :: scale, slack

      if (self%steps_since_refresh >= refresh_after) call refresh(self, problem, state)
      self%steps_since_refresh = self%steps_since_refresh + 1
      call shed_open_points(self, problem, state, record)
      call predict(self, q - state%q, predicted, predicted_outside)
      allocate (active(problem%n_points))
      call choose_active(self, problem, state, predicted, active)

      do round = 1, max_rounds
         list = pack(self%base%inside, active(self%base%inside))
         call gather_block(self, problem, state, predicted, list, block)
         scale = force_scale(state, predicted, block)
         call solve_block(self, block, scale, record)
         call apply_increments(self, predicted, predicted_outside, list, block)
         ! Where nothing is closed any more, the forces are rounding and the scale stays.
         if (size(list) < size(self%base%inside) .or. any(block%status /= state_open)) &
            & scale = max(maxval(self%force), tiny(1.0_wp))
         slack = self%tolerance*scale
         call add_violated(self, problem, slack, active)
         if (count(active(self%base%inside)) > size(list)) cycle
         closing = closing_points(self, problem, state, scale)
         if (size(closing) == 0) exit
         ! Points that close join at the state before this step.
         inside_before = size(self%base%inside)
         call take_in(self, problem, closing, state, record)
         if (size(self%base%inside) == inside_before) exit
         active(closing) = .true.
         call predict(self, q - state%q, predicted, predicted_outside)
      end do
      record%converged = record%converged .and. round <= max_rounds
      record%residual = block_residual(block)/scale
      call commit(self, problem, q, list, block, state)
   end subroutine advance

   !> Forces and outside gaps if no gap of the base set changed.
   subroutine predict(self, dq, predicted, predicted_outside)
      class(condensed_solver_t), intent(in) :: self
      real(wp), intent(in) :: dq(:)
      real(wp), allocatable, intent(out) :: predicted(:), predicted_outside(:)

      predicted = self%force + matmul(self%base%S, dq)
      predicted_outside = self%gap_outside + matmul(self%base%N, dq)
   end subroutine predict

   !> Points that carry unknowns: open or slipping before, or outside their cone if they stuck.
   subroutine choose_active(self, problem, state, predicted, active)
      class(condensed_solver_t), intent(in) :: self
      type(contact_problem_t), intent(in) :: problem
      type(contact_state_t), intent(in) :: state
      real(wp), intent(in) :: predicted(:)
      logical, intent(out) :: active(:)
      integer :: j, p

      active = .false.
      do j = 1, size(self%base%inside)
         p = self%base%inside(j)
         active(p) = state%status(p) /= state_stick &
            & .or. norm2(predicted(3*j - 1:3*j)) > problem%friction(p)*predicted(3*j - 2)
      end do
   end subroutine choose_active

   !> The condensed problem over the listed points of the base set.
   subroutine gather_block(self, problem, state, predicted, list, block)
      class(condensed_solver_t), intent(in) :: self
      type(contact_problem_t), intent(in) :: problem
      type(contact_state_t), intent(in) :: state
      real(wp), intent(in) :: predicted(:)
      integer, intent(in) :: list(:)
      type(contact_block_t), intent(inout) :: block
      integer, allocatable :: rows(:)
      integer :: j

      rows = base_unknowns(self, list)
      block%n = size(list)
      block%M = self%base%M(rows, rows)
      block%predicted = predicted(rows)
      block%gap_old = state%gap(1, list)
      block%friction = problem%friction(list)
      block%forced_open = spread(.false., 1, size(list))
      block%status = state%status(list)
      block%x = reshape(self%last_increment(:, list), [3*size(list)])
      if (problem%velocity_level) then
         block%forced_open = state%force(1, list) <= 0.0_wp .and. state%gap(1, list) > 0.0_wp
         block%gap_old = 0.0_wp
      end if
      do j = 1, size(list)
         if (.not. block%forced_open(j)) block%x(3*j - 2) = max(block%x(3*j - 2), -block%gap_old(j))
      end do
      block%force = block%predicted
   end subroutine gather_block

   !> Places of the three unknowns of the listed points in the base set.
   pure function base_unknowns(self, list) result(rows)
      class(condensed_solver_t), intent(in) :: self
      integer, intent(in) :: list(:)
      integer :: rows(3*size(list))
      integer :: j

      do j = 1, size(list)
         rows(3*j - 2:3*j) = 3*self%base%place(list(j)) - [2, 1, 0]
      end do
   end function base_unknowns

   !> Size of the largest contact force in the step, before it or to be expected after it, N.
   pure real(wp) function force_scale(state, predicted, block)
      type(contact_state_t), intent(in) :: state
      real(wp), intent(in) :: predicted(:)
      type(contact_block_t), intent(in) :: block
      integer :: j

      force_scale = max(0.0_wp, maxval(state%force(1, :)))
      do j = 1, size(predicted), 3
         force_scale = max(force_scale, predicted(j))
      end do
      ! Points that close from afar: what it takes to close them alone.
      do j = 1, block%n
         if (force_scale > 0.0_wp) exit
         force_scale = max(force_scale, block%M(3*j - 2, 3*j - 2)*abs(block%gap_old(j)))
      end do
      force_scale = max(force_scale, tiny(1.0_wp))
   end function force_scale

   !> Solve the block: Newton with Gauss-Seidel to the rescue, or the paper's projected Jacobi.
   subroutine solve_block(self, block, scale, record)
      class(condensed_solver_t), intent(in) :: self
      type(contact_block_t), intent(inout) :: block
      !> Force that tolerances refer to, N
      real(wp), intent(in) :: scale
      type(solve_record_t), intent(inout) :: record
      real(wp) :: limit, residual, force_error
      integer :: steps, sweeps, round

      record%converged = .true.
      if (block%n == 0) return
      if (self%by_jacobi) then
         call solve_block_by_jacobi(self, block, record)
         return
      end if
      ! Newton converges in one more step from the tolerance to rounding: ask for a good part of it.
      limit = min(1.0e-2_wp*self%tolerance, 1.0e-12_wp)*scale
      do round = 1, rescue_rounds
         call solve_newton(block, limit, newton_steps, steps, residual, force_error)
         record%iterations = record%iterations + steps
         record%error_estimate = force_error/scale
         if (residual <= self%tolerance*scale) exit
         record%rescues = record%rescues + 1
         if (.not. all(abs(block%x) < huge(1.0_wp))) block%x = 0.0_wp
         call sweep_gauss_seidel(block, self%tolerance*scale, rescue_sweeps, sweeps, residual)
         record%iterations = record%iterations + sweeps
      end do
      record%converged = residual <= self%tolerance*scale
   end subroutine solve_block

   !> The paper's way: projected Jacobi on the compliance with the sticking points eliminated, M_block^-1.
   subroutine solve_block_by_jacobi(self, block, record)
      class(condensed_solver_t), intent(in) :: self
      type(contact_block_t), intent(inout) :: block
      type(solve_record_t), intent(inout) :: record
      type(error_t), allocatable :: error
      real(wp), allocatable :: compliance(:, :), c(:), eps(:)
      integer :: j, sweeps

      compliance = block%M
      call inverse_spd(compliance, error)
      if (allocated(error)) then
         record%converged = .false.
         return
      end if
      c = -matmul(compliance, block%predicted)
      do j = 1, block%n
         c(3*j - 2) = c(3*j - 2) + block%gap_old(j)
      end do
      eps = step_lengths(compliance)
      block%force = block%predicted + matmul(block%M, block%x)
      call iterate_projected_jacobi(compliance, c, eps, contraction_gap(block%M, eps), block%friction, &
         & block%forced_open, 0.0_wp, self%tolerance, self%max_iterations, block%force, sweeps, record%error_estimate)
      record%iterations = record%iterations + sweeps
      record%converged = record%error_estimate <= self%tolerance
      block%x = matmul(compliance, block%force - block%predicted)
      block%status = states_of_forces(reshape(block%force, [3, block%n]), block%friction)
   end subroutine solve_block_by_jacobi

   !> Forces of the whole base set and gaps outside it for the solved increments.
   subroutine apply_increments(self, predicted, predicted_outside, list, block)
      class(condensed_solver_t), intent(inout) :: self
      real(wp), intent(in) :: predicted(:), predicted_outside(:)
      integer, intent(in) :: list(:)
      type(contact_block_t), intent(in) :: block
      integer, allocatable :: rows(:)
      integer :: k

      self%force = predicted
      self%gap_outside = predicted_outside
      rows = base_unknowns(self, list)
      do k = 1, size(rows)
         if (block%x(k) == 0.0_wp) cycle
         self%force = self%force + self%base%M(:, rows(k))*block%x(k)
         self%gap_outside = self%gap_outside + self%base%T(:, rows(k))*block%x(k)
      end do
      self%force(rows) = block%force
   end subroutine apply_increments

   !> Sticking points outside their cones become active.
   subroutine add_violated(self, problem, slack, active)
      class(condensed_solver_t), intent(in) :: self
      type(contact_problem_t), intent(in) :: problem
      !> Violation that is let pass, N
      real(wp), intent(in) :: slack
      logical, intent(inout) :: active(:)
      integer :: j, p

      do j = 1, size(self%base%inside)
         p = self%base%inside(j)
         if (active(p)) cycle
         active(p) = norm2(self%force(3*j - 1:3*j)) > problem%friction(p)*self%force(3*j - 2) + slack
      end do
   end subroutine add_violated

   !> Points outside the base set that penetrate.
   function closing_points(self, problem, state, scale) result(points)
      class(condensed_solver_t), intent(in) :: self
      type(contact_problem_t), intent(in) :: problem
      type(contact_state_t), intent(in) :: state
      !> Largest contact force, N
      real(wp), intent(in) :: scale
      integer, allocatable :: points(:)
      logical :: closes(size(self%base%outside))
      integer :: j, p

      do j = 1, size(closes)
         p = self%base%outside(j)
         ! On velocity level a point joins in the step after it was seen closed.
         if (problem%velocity_level .and. state%gap(1, p) > 0.0_wp) then
            closes(j) = .false.
         else
            closes(j) = self%gap_outside(j) < -self%tolerance*scale*problem%G(3*p - 2, 3*p - 2)
         end if
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

      do j = 1, size(points)
         state%gap(:, points(j)) = gap_of_point(problem, state, points(j))
      end do
      call self%base%enter(problem, points, error)
      record%set_changes = record%set_changes + size(points)
      record%converged = record%converged .and. .not. allocated(error)
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

   !> Put open points of the base set outside when there are too many of them, unless they are expected back.
   subroutine shed_open_points(self, problem, state, record)
      class(condensed_solver_t), intent(inout) :: self
      type(contact_problem_t), intent(in) :: problem
      type(contact_state_t), intent(inout) :: state
      type(solve_record_t), intent(inout) :: record
      type(error_t), allocatable :: error
      integer, allocatable :: open(:)

      if (allocated(self%expected_closed)) then
         deallocate (self%expected_closed)
         return
      end if
      open = pack(self%base%inside, state%status(self%base%inside) == state_open)
      if (size(open) <= open_carried .or. size(open) == size(self%base%inside)) return
      call self%base%leave(problem, open, error)
      record%set_changes = record%set_changes + size(open)
      record%converged = record%converged .and. .not. allocated(error)
      call refresh(self, problem, state)
   end subroutine shed_open_points

   !> The solved step becomes the state.
   subroutine commit(self, problem, q, list, block, state)
      class(condensed_solver_t), intent(inout) :: self
      type(contact_problem_t), intent(in) :: problem
      real(wp), intent(in) :: q(:)
      integer, intent(in) :: list(:)
      type(contact_block_t), intent(in) :: block
      type(contact_state_t), intent(inout) :: state
      integer :: j, p

      state%q = q
      state%gap(1, self%base%outside) = self%gap_outside
      state%status(self%base%inside) = state_stick
      self%last_increment(:, self%base%inside) = 0.0_wp
      do j = 1, size(list)
         p = list(j)
         self%last_increment(:, p) = block%x(3*j - 2:3*j)
         state%gap(:, p) = state%gap(:, p) + block%x(3*j - 2:3*j)
         state%status(p) = block%status(j)
         ! What the states prescribe holds to the last bit.
         if (state%status(p) /= state_open .and. .not. problem%velocity_level) state%gap(1, p) = 0.0_wp
         if (state%status(p) == state_open) self%force(3*self%base%place(p) - [2, 1, 0]) = 0.0_wp
      end do
      do j = 1, size(self%base%inside)
         state%force(:, self%base%inside(j)) = self%force(3*j - 2:3*j)
      end do
      state%force(:, self%base%outside) = 0.0_wp
      state%status(self%base%outside) = state_open
   end subroutine commit

end module microslip_contact_condensed
