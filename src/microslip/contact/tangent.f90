!> Derivative of the contact forces along a path by the drivers of all its steps.
!>
!> On the points A that are closed at any time (METHOD section 5, M = G_AA^-1, S = -M R_A), in every step
!>     d force = M d gap + S dq,        d reaction = R^T d force = stiffness dq - S^T d gap,   stiffness = R_A^T S
!> and the laws, differentiated in the states that the step ended in, give d gap from that of the step before:
!>     stick    d gap_n = 0,   d gap_t = d gap_t,before
!>     slip     d gap_n = 0,   d force_t = -mu e d force_n - kappa (I - e e^T) (d gap_t - d gap_t,before)
!>     open     d force = 0
!> with the direction e of the slip and kappa = mu force_n/|slip|. Only the points that do not stick carry unknowns.
!> Where no point changes its state this is the exact derivative of the path that the contact solvers march.
module microslip_contact_tangent
   use microslip_contact_laws, only: state_open, state_slip, state_stick
   use microslip_contact_problem, only: contact_problem_t, contact_state_t
   use microslip_core_error, only: error_t
   use microslip_core_kinds, only: wp
   use microslip_linalg_dense, only: inverse_spd, product_of, product_symmetric, solve_general
   implicit none(type, external)
   private

   public :: contact_tangent_t, contact_step_t, new_step

   !> Largest kappa over the stiffness of the point itself: slip that has just begun.
   real(wp), parameter :: largest_kappa = 1.0e8_wp

   !> What the derivative must know of a step: the points that do not stick at its end.
   type :: contact_step_t
      !> (moving points)
      integer, allocatable :: point(:)
      !> (moving points) state_slip or state_open
      integer, allocatable :: status(:)
      !> (2, moving points) e
      real(wp), allocatable :: direction(:, :)
      !> (moving points) kappa, N/m
      real(wp), allocatable :: kappa(:)
   end type contact_step_t

   type :: contact_tangent_t
      private
      !> (points) place of a point in A, 0 outside
      integer, allocatable :: place(:)
      !> Drivers that are differentiated by
      integer, allocatable :: drivers(:)
      !> (3 in A, 3 in A) N/m
      real(wp), allocatable :: M(:, :)
      !> (3 in A, drivers) and (drivers, drivers)
      real(wp), allocatable :: S(:, :), stiffness(:, :)
      !> (3 in A) friction coefficient of the point that a row belongs to
      real(wp), allocatable :: friction(:)
   contains
      procedure :: set_up
      procedure :: covers
      procedure :: path_derivative
   end type contact_tangent_t

contains

   !> Factorise for the points that close.
   subroutine set_up(self, problem, closes, drivers, error)
      class(contact_tangent_t), intent(inout) :: self
      type(contact_problem_t), intent(in) :: problem
      !> (points) whether a point is closed at any time
      logical, intent(in) :: closes(:)
      !> These are differentiated by
      integer, intent(in) :: drivers(:)
      type(error_t), allocatable, intent(out) :: error
      real(wp), allocatable :: R(:, :)
      integer, allocatable :: rows(:)
      integer :: p, c

      rows = pack([(p, p=1, size(closes))], closes)
      self%drivers = drivers
      self%place = unpack([(p, p=1, size(rows))], closes, 0)
      rows = [((3*rows(p) - 3 + c, c=1, 3), p=1, size(rows))]
      self%friction = problem%friction((rows + 2)/3)
      self%M = problem%G(rows, rows)
      call inverse_spd(self%M, error)
      if (allocated(error)) then
         error%message = 'contact compliance G is not positive definite on the points that close: '//error%message
         return
      end if
      R = problem%R(rows, drivers)
      self%S = R
      call product_symmetric(self%M, R, self%S)
      self%S = -self%S
      self%stiffness = matmul(transpose(R), self%S)
   end subroutine set_up

   !> Whether it is set up for these drivers, and all these points.
   pure logical function covers(self, closes, drivers)
      class(contact_tangent_t), intent(in) :: self
      !> (points)
      logical, intent(in) :: closes(:)
      integer, intent(in) :: drivers(:)

      covers = allocated(self%place)
      if (covers) covers = size(self%place) == size(closes) .and. size(self%drivers) == size(drivers)
      if (covers) covers = all(self%drivers == drivers)
      if (covers) covers = all(self%place > 0 .or. .not. closes)
   end function covers

   !> What the derivative must know of a step.
   pure function new_step(problem, before, after) result(step)
      type(contact_problem_t), intent(in) :: problem
      type(contact_state_t), intent(in) :: before, after
      type(contact_step_t) :: step
      real(wp) :: slip, limit, friction_force
      integer :: k, p

      step%point = pack([(p, p=1, size(after%status))], after%status /= state_stick)
      step%status = after%status(step%point)
      allocate (step%direction(2, size(step%point)), step%kappa(size(step%point)), source=0.0_wp)
      do k = 1, size(step%point)
         if (step%status(k) == state_open) cycle
         p = step%point(k)
         limit = largest_kappa/problem%G(3*p - 1, 3*p - 1)
         slip = norm2(after%gap(2:3, p) - before%gap(2:3, p))
         friction_force = norm2(after%force(2:3, p))
         if (friction_force <= 0.0_wp) cycle
         step%direction(:, k) = -after%force(2:3, p)/friction_force
         step%kappa(k) = limit
         if (friction_force < limit*slip) step%kappa(k) = friction_force/slip
      end do
   end function new_step

   !> With driver values q_k = sum over j of basis(j, k) x(:, j) in step k, the derivative of
   !> sum over k of weight(i, k) reaction_k by x: row (driver, i), column (driver, j).
   subroutine path_derivative(self, steps, basis, weight, derivative, error)
      class(contact_tangent_t), intent(in) :: self
      type(contact_step_t), intent(in) :: steps(:)
      !> (functions, steps)
      real(wp), intent(in) :: basis(:, :), weight(:, :)
      !> (drivers functions, drivers functions) N per unit of the driver
      real(wp), intent(out) :: derivative(:, :)
      type(error_t), allocatable, intent(out) :: error
      !> Of the points that ever move: M, S, derivative of their gaps
      real(wp), allocatable :: M(:, :), S(:, :), U(:, :), reaction(:, :)
      integer, allocatable :: place(:), rows(:), position(:)
      logical, allocatable :: moves(:), has_moved(:)
      integer :: i, j, k, c, n

      allocate (moves(size(self%place)), source=.false.)
      do k = 1, size(steps)
         moves(steps(k)%point) = .true.
      end do
      moves = moves .and. self%place > 0
      place = pack(self%place, moves)
      position = unpack([(k, k=1, size(place))], moves, 0)
      rows = [((3*place(k) - 3 + c, c=1, 3), k=1, size(place))]
      M = self%M(rows, rows)
      S = self%S(rows, :)
      n = size(self%stiffness, 1)
      allocate (U(size(rows), size(derivative, 2)), reaction(n, size(derivative, 2)), source=0.0_wp)
      allocate (has_moved(size(place)), source=.false.)
      derivative = 0.0_wp
      do k = 1, size(steps)
         call take_step(steps(k), position, self%friction(rows), M, S, basis(:, k), U, has_moved, error)
         if (allocated(error)) return
         if (all(weight(:, k) == 0.0_wp)) cycle
         call product_of(S, U, reaction, transpose_a=.true., factor=-1.0_wp)
         do j = 1, size(basis, 1)
            reaction(:, (j - 1)*n + 1:j*n) = reaction(:, (j - 1)*n + 1:j*n) + basis(j, k)*self%stiffness
         end do
         do i = 1, size(weight, 1)
            derivative((i - 1)*n + 1:i*n, :) = derivative((i - 1)*n + 1:i*n, :) + weight(i, k)*reaction
         end do
      end do
   end subroutine path_derivative

   !> Derivative of the gaps after a step from that before it.
   subroutine take_step(step, position, friction, M, S, basis, U, has_moved, error)
      type(contact_step_t), intent(in) :: step
      !> (points) position among the points that ever move, 0: never closed
      integer, intent(in) :: position(:)
      !> (3 moving)
      real(wp), intent(in) :: friction(:)
      !> (3 moving, 3 moving) and (3 moving, drivers)
      real(wp), intent(in) :: M(:, :), S(:, :)
      !> (functions) at this step
      real(wp), intent(in) :: basis(:)
      !> (3 moving, drivers functions)
      real(wp), intent(inout) :: U(:, :)
      !> (moving) whether U of a point is not zero
      logical, intent(inout) :: has_moved(:)
      type(error_t), allocatable, intent(out) :: error
      real(wp), allocatable :: matrix(:, :), right(:, :), own(:, :), known(:, :), solution(:, :)
      real(wp) :: across(2, 2)
      integer, allocatable :: state(:), from(:), rows(:), free(:), held(:), moving(:)
      integer :: k, c, a, n

      state = spread(state_stick, 1, size(has_moved))
      from = spread(0, 1, size(has_moved))
      do k = 1, size(step%point)
         if (position(step%point(k)) == 0) cycle
         state(position(step%point(k))) = step%status(k)
         from(position(step%point(k))) = k
      end do
      do k = 1, size(state)
         if (state(k) /= state_open) U(3*k - 2, :) = 0.0_wp
      end do
      free = pack([((3*k - 3 + c, c=1, 3), k=1, size(state))], &
         & [((state(k) == state_open .or. (state(k) == state_slip .and. c > 1), c=1, 3), k=1, size(state))])
      if (size(free) == 0) return
      held = pack([((3*k - 3 + c, c=2, 3), k=1, size(state))], &
         & [((state(k) == state_stick .and. has_moved(k), c=2, 3), k=1, size(state))])

      ! Forces of the moving points from the drivers and from the gaps that are known.
      rows = [((3*k - 3 + c, c=1, 3), k=1, size(state))]
      rows = pack(rows, state((rows + 2)/3) /= state_stick)
      n = size(S, 2)
      allocate (right(size(rows), size(U, 2)))
      do k = 1, size(basis)
         right(:, (k - 1)*n + 1:k*n) = basis(k)*S(rows, :)
      end do
      if (size(held) > 0) then
         own = M(rows, held)
         known = U(held, :)
         call product_of(own, known, right, keep=1.0_wp)
      end if
      own = M(rows, free)

      ! Rows of open points: no change of the force. Rows of slipping points: the friction law.
      moving = pack([(k, k=1, size(state))], state /= state_stick)
      allocate (matrix(size(free), size(free)), solution(size(free), size(U, 2)))
      do c = 1, size(free)
         call apply_laws(own(:, c), matrix(:, c))
      end do
      do c = 1, size(U, 2)
         call apply_laws(right(:, c), solution(:, c))
      end do
      solution = -solution
      a = 0
      do k = 1, size(moving)
         if (state(moving(k)) == state_slip) then
            across = across_slip(step%direction(:, from(moving(k))), step%kappa(from(moving(k))))
            matrix(a + 1:a + 2, a + 1:a + 2) = matrix(a + 1:a + 2, a + 1:a + 2) + across
            do c = 1, size(U, 2)
               solution(a + 1:a + 2, c) = solution(a + 1:a + 2, c) + matmul(across, U(3*moving(k) - 1:3*moving(k), c))
            end do
            a = a + 2
         else
            a = a + 3
         end if
      end do
      call solve_general(matrix, solution, error)
      if (allocated(error)) return
      U(free, :) = solution
      has_moved = has_moved .or. state /= state_stick

   contains

      !> One column of the equations: the force of open points, force_t + mu e force_n of slipping ones.
      pure subroutine apply_laws(force, column)
         !> (3 moving)
         real(wp), intent(in) :: force(:)
         !> (free)
         real(wp), intent(out) :: column(:)
         integer :: k, a

         a = 0
         do k = 1, size(moving)
            if (state(moving(k)) == state_open) then
               column(a + 1:a + 3) = force(3*k - 2:3*k)
               a = a + 3
            else
               column(a + 1:a + 2) = force(3*k - 1:3*k) + friction(3*moving(k))*force(3*k - 2) &
                  & *step%direction(:, from(moving(k)))
               a = a + 2
            end if
         end do
      end subroutine apply_laws

   end subroutine take_step

   !> kappa (I - e e^T)
   pure function across_slip(e, kappa) result(across)
      real(wp), intent(in) :: e(2), kappa
      real(wp) :: across(2, 2)

      across(1, :) = kappa*[1.0_wp - e(1)*e(1), -e(1)*e(2)]
      across(2, :) = kappa*[-e(2)*e(1), 1.0_wp - e(2)*e(2)]
   end function across_slip

end module microslip_contact_tangent
