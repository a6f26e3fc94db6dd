!> Semismooth Newton (Alart-Curnier) on the contact forces, for any compliance, with Gauss-Seidel to the rescue.
!>
!> With augmented forces z = force - s gap (s the stiffness of a point) the contact laws are the equation
!>
!>     F(force) = force - P(z) = 0,    P(z) = (z_n^+, proj_disk(mu z_n^+) z_t)
!>
!> A Newton step solves its linearisation in the states that z selects. Open points carry no unknowns. G may be
!> singular (hyperstatic contact: the forces are not unique then): the matrix of the step, not F, holds
!> G + shift/s on its diagonal, a proximal regularisation that leaves the solutions where they are. The step is
!> shortened until ||F|| is below the largest of the last values (non-monotone line search).
!>
!> Newton cycles or stalls far from a solution; so rounds of Gauss-Seidel (`gauss_seidel`), each longer than the
!> one before, give it better and better starts, and relaxation and shift change from round to round.
!>
!> Alart & Curnier (1991), A mixed formulation for frictional contact problems prone to Newton like solution
!> methods; Acary, Bremond & Huber (2018), On solving contact problems with Coulomb friction, sections 5 and 8.
module microslip_contact_newton
   use microslip_contact_force_step, only: force_step_t, begin_step, end_step, update_gap, step_residual, force_scale, &
      & step_states, point_stiffness
   use microslip_contact_gauss_seidel, only: sweep_forces
   use microslip_contact_laws, only: project_on_disk, state_open, state_slip
   use microslip_contact_problem, only: contact_problem_t, contact_state_t, solve_record_t, contact_solver_t
   use microslip_core_error, only: error_t
   use microslip_core_kinds, only: wp
   use microslip_linalg_dense, only: solve_general
   implicit none(type, external)
   private

   public :: newton_t

   !> Rounds of Gauss-Seidel and Newton, sweeps of the first (twice as many in each further one, up to the most),
   !> Newton steps of each, and halvings of a step.
   integer, parameter :: max_rounds = 12, first_sweeps = 40, most_sweeps = 2560, newton_steps = 30, halvings = 12
   !> Values of ||F|| that the line search looks back at.
   integer, parameter :: memory = 5
   !> Relaxations of Gauss-Seidel and shifts of Newton, round after round.
   real(wp), parameter :: relaxations(2) = [1.0_wp, 1.4_wp], shifts(2) = [1.0e-6_wp, 1.0e-9_wp]

   type, extends(contact_solver_t) :: newton_t
      !> (points) augmentation s, N/m
      real(wp), allocatable, private :: stiffness(:)
   contains
      procedure :: start
      procedure :: advance
   end type newton_t

contains

   !> Scales of the problem.
   subroutine start(self, problem, state, error)
      class(newton_t), intent(inout) :: self
      type(contact_problem_t), intent(in) :: problem
      type(contact_state_t), intent(in) :: state
      !> Where the problem has no matrix, or a point without compliance
      type(error_t), allocatable, intent(out) :: error

      call point_stiffness(problem, state, self%stiffness, error)
   end subroutine start

   !> Take the state to driver q.
   subroutine advance(self, problem, q, state, record)
      class(newton_t), intent(inout) :: self
      type(contact_problem_t), intent(in) :: problem
      !> (drivers)
      real(wp), intent(in) :: q(:)
      type(contact_state_t), intent(inout) :: state
      type(solve_record_t), intent(out) :: record
      type(force_step_t) :: step
      integer :: round, count, budget

      step = begin_step(problem, q, state)
      do round = 1, max_rounds
         budget = self%max_iterations - record%iterations
         if (budget <= 0) exit
         call sweep_forces(problem%G, self%stiffness, relaxations(1 + mod(round - 1, 2)), self%tolerance, &
            & min(budget, most_sweeps, first_sweeps*2**(round - 1)), step, count, record%residual, record%error_estimate)
         record%iterations = record%iterations + count
         call solve_newton(problem%G, self%stiffness, shifts(1 + mod(round - 1, 2)), self%tolerance, &
            & min(budget - count, newton_steps), step, count, record%residual, record%error_estimate)
         record%iterations = record%iterations + count
         record%converged = record%residual <= self%tolerance
         if (record%converged) exit
         record%rescues = record%rescues + 1
      end do
      call end_step(problem, q, step, step_states(step, self%stiffness), state, record)
   end subroutine advance

   !> Newton steps until the residual is below the limit; the best iterate, the start among them, is returned.
   !>
   !> Exit: residual <= limit and either a hundredth of it or no longer halved by a step; or steps = max_steps; or
   !> a singular matrix.
   subroutine solve_newton(G, stiffness, shift, limit, max_steps, step, steps, residual, error_estimate)
      !> (3 points, 3 points) m/N
      real(wp), intent(in), contiguous :: G(:, :)
      !> (points) augmentation, N/m
      real(wp), intent(in) :: stiffness(:)
      !> Regularisation of the matrix, relative to the points' own compliance
      real(wp), intent(in) :: shift
      !> Residual to stop at, over the largest force
      real(wp), intent(in) :: limit
      integer, intent(in) :: max_steps
      !> Start forces in, solution out
      type(force_step_t), intent(inout) :: step
      integer, intent(out) :: steps
      !> Largest violation of the laws over the largest force
      real(wp), intent(out) :: residual
      !> Estimated error of the forces over the largest one: what a further step would change, by the largest ratio
      !> of change to residual of the steps taken
      real(wp), intent(out) :: error_estimate
      type(force_step_t) :: best
      real(wp) :: direction(size(step%force)), history(memory), current, previous, amplification, scale
      logical :: singular

      call update_gap(G, step)
      history = norm2(law_equations(step, stiffness))
      amplification = 1.0_wp
      residual = huge(1.0_wp)
      previous = residual
      do steps = 0, max_steps
         scale = force_scale(step, stiffness)
         current = step_residual(step, stiffness)/scale
         if (current < residual) then
            best = step
            residual = current
         end if
         if (current <= limit .and. (current <= 1.0e-2_wp*limit .or. current > 0.5_wp*previous)) exit
         if (steps == max_steps) exit
         call newton_direction(G, stiffness, shift, step, direction, singular)
         if (singular) exit
         amplification = max(amplification, maxval(abs(direction))/scale/current)
         call search_along(G, stiffness, direction, step, history)
         previous = current
      end do
      if (allocated(best%force)) step = best
      error_estimate = amplification*residual
   end subroutine solve_newton

   !> F(force), N.
   pure function law_equations(step, stiffness) result(F)
      type(force_step_t), intent(in) :: step
      real(wp), intent(in) :: stiffness(:)
      real(wp) :: F(size(step%force))
      real(wp) :: z(3)
      integer :: p, k

      F = step%force
      do p = 1, size(stiffness)
         if (step%forced_open(p)) cycle
         k = 3*p - 2
         z = step%force(k:k + 2) - stiffness(p)*step%gap(k:k + 2)
         z(1) = max(0.0_wp, z(1))
         F(k:k + 2) = F(k:k + 2) - [z(1), project_on_disk(z(2:3), step%friction(p)*z(1))]
      end do
   end function law_equations

   !> Halve the step until ||F|| is below the largest of the last values; the shortest one is taken as it is.
   subroutine search_along(G, stiffness, direction, step, history)
      real(wp), intent(in), contiguous :: G(:, :)
      real(wp), intent(in) :: stiffness(:), direction(:)
      type(force_step_t), intent(inout) :: step
      !> Last values of ||F||, the newest last
      real(wp), intent(inout) :: history(:)
      real(wp) :: start(size(direction)), length, size_now
      integer :: k

      start = step%force
      length = 1.0_wp
      do k = 0, halvings
         step%force = start + length*direction
         call update_gap(G, step)
         size_now = norm2(law_equations(step, stiffness))
         if (size_now <= (1.0_wp - 1.0e-4_wp*length)*maxval(history)) exit
         length = 0.5_wp*length
      end do
      history = [history(2:), size_now]
   end subroutine search_along

   !> The change of the forces that solves the laws linearised in their current states.
   subroutine newton_direction(G, stiffness, shift, step, direction, singular)
      real(wp), intent(in), contiguous :: G(:, :)
      real(wp), intent(in) :: stiffness(:), shift
      type(force_step_t), intent(in) :: step
      !> (3 points) N
      real(wp), intent(out) :: direction(:)
      logical, intent(out) :: singular
      type(error_t), allocatable :: error
      real(wp), allocatable :: matrix(:, :), rhs(:, :)
      real(wp) :: gap(size(direction))
      integer :: status(size(stiffness)), j, k, p
      integer, allocatable :: closed(:), unknown(:)

      ! Open points give up their forces; `gap` has what that changes.
      status = step_states(step, stiffness)
      closed = pack([(p, p=1, size(status))], status /= state_open)
      unknown = [((3*closed(j) - 3 + k, k=1, 3), j=1, size(closed))]
      direction = -step%force
      direction(unknown) = 0.0_wp
      gap = step%gap
      do k = 1, size(direction)
         if (direction(k) /= 0.0_wp) gap = gap + G(:, k)*direction(k)
      end do
      singular = .false.
      if (size(closed) == 0) return

      matrix = G(unknown, unknown)
      allocate (rhs(size(unknown), 1))
      do j = 1, size(closed)
         p = closed(j)
         k = 3*j - 2
         matrix(k:k + 2, :) = stiffness(p)*matrix(k:k + 2, :)
         matrix(k, k) = matrix(k, k) + shift
         matrix(k + 1, k + 1) = matrix(k + 1, k + 1) + shift
         matrix(k + 2, k + 2) = matrix(k + 2, k + 2) + shift
         rhs(k:k + 2, 1) = -stiffness(p)*gap(3*p - 2:3*p)
         if (status(p) == state_slip) call slip_rows(step%friction(p), step%force(3*p - 2:3*p), &
            & stiffness(p)*step%gap(3*p - 2:3*p), k, matrix(k:k + 2, :), rhs(k:k + 2, 1))
      end do
      call solve_general(matrix, rhs, error)
      singular = allocated(error)
      if (.not. singular) singular = .not. all(abs(rhs) < sqrt(huge(1.0_wp)))
      if (.not. singular) direction(unknown) = rhs(:, 1)
   end subroutine newton_direction

   !> Turn the rows of a sticking point, s dgap = -s gap, into those of a slipping one. With e = z_t/|z_t| and
   !> B = mu z_n/|z_t| (I - e e^T), dz = dforce - s dgap, the linearised force_t = mu z_n e is
   !>
   !>     (I - B) dforce_t - mu e dforce_n + mu e s dgap_n + B s dgap_t = mu z_n e - force_t
   !>
   !> and dgap is what the unknowns and the open points change: rhs holds -s (gap + change by the open points).
   pure subroutine slip_rows(friction, force, augmentation, place, rows, rhs)
      real(wp), intent(in) :: friction
      !> (3) force, and stiffness times gap, of the point, N
      real(wp), intent(in) :: force(3), augmentation(3)
      !> Column of the point's normal force
      integer, intent(in) :: place
      real(wp), intent(inout) :: rows(:, :), rhs(:)
      real(wp) :: z(3), e(2), length, B(2, 2), T(2, 3), open_change(3)
      integer :: c

      z = force - augmentation
      length = max(norm2(z(2:3)), tiny(1.0_wp))   ! zero only without friction
      e = z(2:3)/length
      B(:, 1) = friction*z(1)/length*[1.0_wp - e(1)**2, -e(1)*e(2)]
      B(:, 2) = friction*z(1)/length*[-e(1)*e(2), 1.0_wp - e(2)**2]
      T(:, 1) = friction*e
      T(:, 2:3) = B
      do c = 1, size(rows, 2)
         rows(2:3, c) = matmul(T, rows(:, c))
      end do
      rows(2:3, place) = rows(2:3, place) - friction*e
      rows(2:3, place + 1:place + 2) = rows(2:3, place + 1:place + 2) - B
      rows(2, place + 1) = rows(2, place + 1) + 1.0_wp
      rows(3, place + 2) = rows(3, place + 2) + 1.0_wp
      open_change = -(rhs + augmentation)
      rhs(2:3) = friction*z(1)*e - force(2:3) - matmul(T, open_change)
   end subroutine slip_rows

end module microslip_contact_newton
