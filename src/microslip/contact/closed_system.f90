!> The linear system behind a set of contact states, with the compliance as an operator.
!>
!> Point by point, forces v that may change and gaps that must vanish:
!>     open         v = 0
!>     stick        v free;                     gap_n = 0, slip = 0
!>     slip         v_t = mu v_n d + v_e e;     gap_n = 0, slip_e + drag v_e = 0          (e normal to d)
!>     frictionless v = v_n;                    gap_n = 0
!> d is the direction of the friction force and drag = |slip| / |friction force|, from the semismooth Newton method on
!> the disk (METHOD section 4): what is left of the law when d is eliminated. With E the directions that remain,
!>     J = E^T G (E + mu d n^T) + drag,   symmetric but for the friction that follows the normal force.
!> Left-preconditioned GMRES, so that residuals are forces. The preconditioner is B of the operator restricted by E, with
!> the structure's part, a few directions far above the rest, found by Lanczos and scaled away (`learn`).
!>
!> Soft directions that the problem keeps apart have an amplitude z each, J x + E^T V z = rhs, z = V^T (E + mu d n^T) x + s:
!> one more solution for each direction, and a small system (`solve`).
module microslip_contact_closed_system
   use microslip_contact_compliance_operator, only: contact_compliance_t
   use microslip_contact_laws, only: state_open, state_stick, state_slip
   use microslip_core_error, only: error_t, failure
   use microslip_core_kinds, only: wp
   use microslip_core_text, only: to_text
   use microslip_linalg_dense, only: eigen_symmetric, product_of, solve_general
   implicit none(type, external)
   private

   public :: closed_system_t, state_frictionless

   !> A state beside those of the laws: the point is closed and carries no friction.
   integer, parameter :: state_frictionless = 3
   !> Eigenvalues of the preconditioned operator within these bounds are left alone.
   real(wp), parameter :: well_above = 2.0_wp, well_below = 0.5_wp
   !> Of `solve_columns`: relative accuracy and most Krylov steps.
   real(wp), parameter :: column_accuracy = 1.0e-10_wp
   integer, parameter :: column_steps = 150
   !> What soft directions are solved for to at least: their amplitudes follow from all of it.
   real(wp), parameter :: soft_accuracy = 1.0e-6_wp
   !> Lanczos steps of `learn`.
   integer, parameter :: lanczos_steps = 60

   type :: closed_system_t
      !> (points) states
      integer, allocatable :: states(:)
      !> (2, points) d, of slipping points
      real(wp), allocatable :: direction(:, :)
      !> (points)
      real(wp), allocatable :: friction(:)
      !> (points) m/N, of slipping points
      real(wp), allocatable :: drag(:)
      !> (3, points) N/m, from the operator
      real(wp), allocatable :: stiffness(:, :)
      !> (3 points, directions) what `learn` found, and 1 - 1/eigenvalue of each
      real(wp), allocatable, private :: learned(:, :), excess(:)
      !> (3 points, directions) V
      real(wp), allocatable, private :: soft(:, :)
   contains
      procedure :: set_up
      procedure :: apply
      procedure :: project
      procedure :: follow_friction
      procedure :: precondition
      procedure :: along_soft
      procedure :: add_soft_gap
      procedure :: solve
      procedure :: solve_columns
      procedure :: learn
   end type closed_system_t

contains

   !> A system with the given states and no slipping points yet.
   subroutine set_up(self, compliance, friction, states, soft)
      class(closed_system_t), intent(out) :: self
      class(contact_compliance_t), intent(in) :: compliance
      !> (points)
      real(wp), intent(in) :: friction(:)
      !> (points) state_open, state_stick or state_frictionless
      integer, intent(in) :: states(:)
      !> (3 points, directions) V; default: none
      real(wp), intent(in), optional :: soft(:, :)

      if (present(soft)) then
         self%soft = soft
      else
         allocate (self%soft(3*size(states), 0))
      end if
      self%states = states
      self%friction = friction
      self%stiffness = compliance%local_stiffness()
      allocate (self%direction(2, size(states)), self%drag(size(states)), source=0.0_wp)
      allocate (self%learned(3*size(states), 0), self%excess(0))
   end subroutine set_up

   !> x <- E E^T x, with the e-component times what the drag leaves of it, (1 + drag stiffness)^-power.
   pure subroutine restrict(self, x, power)
      class(closed_system_t), intent(in) :: self
      real(wp), intent(inout) :: x(:, :)
      !> 0: the projection alone; 1: for the preconditioner
      integer, intent(in) :: power
      real(wp) :: e(2)
      integer :: p

      do p = 1, size(x, 2)
         select case (self%states(p))
         case (state_open)
            x(:, p) = 0.0_wp
         case (state_slip)
            e = [-self%direction(2, p), self%direction(1, p)]
            x(2:3, p) = e*dot_product(e, x(2:3, p))
            if (power > 0) x(2:3, p) = x(2:3, p)/(1.0_wp + self%drag(p)*self%stiffness(2, p))
         case (state_frictionless)
            x(2:3, p) = 0.0_wp
         end select
      end do
   end subroutine restrict

   !> x <- E E^T x.
   pure subroutine project(self, x)
      class(closed_system_t), intent(in) :: self
      !> (3, points)
      real(wp), intent(inout) :: x(:, :)
      call restrict(self, x, 0)
   end subroutine project

   !> v <- (E + mu d n^T) v: friction follows the normal force.
   pure subroutine follow_friction(self, v)
      class(closed_system_t), intent(in) :: self
      !> (3, points) N
      real(wp), intent(inout) :: v(:, :)
      integer :: p

      do p = 1, size(v, 2)
         if (self%states(p) == state_slip) v(2:3, p) = v(2:3, p) + self%friction(p)*v(1, p)*self%direction(:, p)
      end do
   end subroutine follow_friction

   !> y = J v.
   subroutine apply(self, compliance, v, y)
      class(closed_system_t), intent(in) :: self
      class(contact_compliance_t), intent(in) :: compliance
      !> (3, points) in the range of E, N
      real(wp), intent(in), contiguous :: v(:, :)
      !> (3, points) m
      real(wp), intent(out), contiguous :: y(:, :)
      real(wp), allocatable :: force(:, :)
      integer :: p

      force = v
      call self%follow_friction(force)
      call compliance%product(force, y)
      call restrict(self, y, 0)
      do p = 1, size(v, 2)
         if (self%states(p) == state_slip) y(2:3, p) = y(2:3, p) + self%drag(p)*v(2:3, p)
      end do
   end subroutine apply

   !> z = B r, near J^-1 r. With t = 1/(1 + drag k) the inverse of G + drag is near t B t + t (1 - t) k, k: local stiffness.
   subroutine precondition(self, compliance, r, z)
      class(closed_system_t), intent(in) :: self
      class(contact_compliance_t), intent(in) :: compliance
      !> (3, points) in the range of E, m
      real(wp), intent(in), contiguous :: r(:, :)
      !> (3, points) in the range of E, N
      real(wp), intent(out), contiguous :: z(:, :)
      real(wp), allocatable :: x(:, :), along(:, :), part(:, :)
      integer :: p

      x = r
      call restrict(self, x, 1)
      call compliance%precondition(x, z)
      if (size(self%excess) > 0) then
         allocate (along(size(self%excess), 1), part(size(r), 1))
         call product_of(self%learned, reshape(x, [size(x), 1]), along, transpose_a=.true.)
         along(:, 1) = self%excess*along(:, 1)
         call product_of(self%learned, along, part)
         z = z - reshape(part, shape(z))
      end if
      call restrict(self, z, 1)
      do p = 1, size(r, 2)
         if (self%states(p) == state_slip) z(2:3, p) = z(2:3, p) &
            & + self%drag(p)*self%stiffness(2, p)**2/(1.0_wp + self%drag(p)*self%stiffness(2, p))**2*r(2:3, p)
      end do
   end subroutine precondition

   !> V^T force, (directions).
   pure function along_soft(self, force) result(along)
      class(closed_system_t), intent(in) :: self
      !> (3, points) N
      real(wp), intent(in) :: force(:, :)
      real(wp) :: along(size(self%soft, 2))

      along = 0.0_wp
      if (size(along) > 0) along = matmul(reshape(force, [size(force)]), self%soft)
   end function along_soft

   !> gap <- gap + V z.
   pure subroutine add_soft_gap(self, z, gap)
      class(closed_system_t), intent(in) :: self
      !> (directions)
      real(wp), intent(in) :: z(:)
      !> (3, points) m
      real(wp), intent(inout) :: gap(:, :)

      if (size(z) > 0) gap = gap + reshape(matmul(self%soft, z), shape(gap))
   end subroutine add_soft_gap

   !> Solve J x + V z = rhs, z = V^T (E + mu d n^T) x + balance, from x = 0, to the accuracy of `solve_stiff`.
   subroutine solve(self, compliance, rhs, accuracy, target, max_steps, x, steps, first, last, balance, z)
      class(closed_system_t), intent(in) :: self
      class(contact_compliance_t), intent(in) :: compliance
      !> (3, points) m; its part in the range of E counts
      real(wp), intent(in), contiguous :: rhs(:, :)
      !> Relative, and N
      real(wp), intent(in) :: accuracy, target
      integer, intent(in) :: max_steps
      !> (3, points) in the range of E, N
      real(wp), intent(out), contiguous :: x(:, :)
      integer, intent(out) :: steps
      !> N, 2-norm of the preconditioned residual at the start and at the end
      real(wp), intent(out) :: first, last
      !> (directions) where there are any
      real(wp), intent(in), optional :: balance(:)
      real(wp), intent(out), optional :: z(:)
      real(wp), dimension(size(self%soft, 2), size(self%soft, 2)) :: rest
      real(wp) :: moved(size(rhs), size(self%soft, 2)), part(size(self%soft, 2), 1), own, left
      real(wp), allocatable :: force(:, :), direction(:, :)
      type(error_t), allocatable :: error
      integer :: k, more

      call solve_stiff(self, compliance, rhs, accuracy, target, max_steps, x, steps, first, last)
      if (size(rest) == 0) return
      allocate (direction, mold=x)
      rest = 0.0_wp
      do k = 1, size(rest, 1)
         call solve_stiff(self, compliance, reshape(self%soft(:, k), shape(x)), min(accuracy, soft_accuracy), 0.0_wp, max_steps, &
            & direction, more, own, left)
         moved(:, k) = reshape(direction, [size(x)])
         steps = steps + more
         rest(k, k) = 1.0_wp
         force = direction
         call self%follow_friction(force)
         rest(:, k) = rest(:, k) + self%along_soft(force)
      end do
      force = x
      call self%follow_friction(force)
      part(:, 1) = balance + self%along_soft(force)
      call solve_general(rest, part, error)
      z = 0.0_wp
      if (allocated(error)) return
      z = part(:, 1)
      x = x - reshape(matmul(moved, z), shape(x))
   end subroutine solve

   !> Solve J x = rhs by GMRES from x = 0 until |B (rhs - J x)| <= max(accuracy |B rhs|, target), or max_steps.
   subroutine solve_stiff(self, compliance, rhs, accuracy, target, max_steps, x, steps, first, last)
      class(closed_system_t), intent(in) :: self
      class(contact_compliance_t), intent(in) :: compliance
      !> (3, points) m; its part in the range of E counts
      real(wp), intent(in), contiguous :: rhs(:, :)
      !> Relative, and N
      real(wp), intent(in) :: accuracy, target
      integer, intent(in) :: max_steps
      !> (3, points) in the range of E, N
      real(wp), intent(out), contiguous :: x(:, :)
      integer, intent(out) :: steps
      !> N, 2-norm of the preconditioned residual at the start and at the end
      real(wp), intent(out) :: first, last
      real(wp), allocatable :: basis(:, :, :), w(:, :), r(:, :)
      real(wp) :: h(max_steps + 1, max_steps), cosine(max_steps), sine(max_steps), g(max_steps + 1), y(max_steps), t
      integer :: i, j

      allocate (w, r, mold=rhs)
      r = rhs
      call restrict(self, r, 0)
      call self%precondition(compliance, r, w)
      first = norm2(w)
      last = first
      x = 0.0_wp
      steps = 0
      if (first <= target .or. first == 0.0_wp) return
      allocate (basis(3, size(rhs, 2), max_steps + 1))
      basis(:, :, 1) = w/first
      g = 0.0_wp
      g(1) = first
      do j = 1, max_steps
         call self%apply(compliance, basis(:, :, j), r)
         call self%precondition(compliance, r, w)
         do i = 1, j
            h(i, j) = sum(basis(:, :, i)*w)
            w = w - h(i, j)*basis(:, :, i)
         end do
         h(j + 1, j) = norm2(w)
         do i = 1, j - 1
            t = cosine(i)*h(i, j) + sine(i)*h(i + 1, j)
            h(i + 1, j) = -sine(i)*h(i, j) + cosine(i)*h(i + 1, j)
            h(i, j) = t
         end do
         t = hypot(h(j, j), h(j + 1, j))
         cosine(j) = h(j, j)/t
         sine(j) = h(j + 1, j)/t
         g(j + 1) = -sine(j)*g(j)
         g(j) = cosine(j)*g(j)
         steps = j
         last = abs(g(j + 1))
         h(j, j) = t
         if (last <= max(target, accuracy*first) .or. h(j + 1, j) <= epsilon(1.0_wp)*t) exit
         basis(:, :, j + 1) = w/h(j + 1, j)
      end do
      do i = steps, 1, -1
         y(i) = (g(i) - dot_product(h(i, i + 1:steps), y(i + 1:steps)))/h(i, i)
      end do
      do i = 1, steps
         x = x + y(i)*basis(:, :, i)
      end do
   end subroutine solve_stiff

   !> Solve J X + V Z = rhs, Z = V^T (E + mu d n^T) X + balance, column by column.
   subroutine solve_columns(self, compliance, rhs, x, error, balance, z)
      class(closed_system_t), intent(in) :: self
      class(contact_compliance_t), intent(in) :: compliance
      !> (3 points, columns) m
      real(wp), intent(in) :: rhs(:, :)
      !> (3 points, columns) N
      real(wp), intent(out) :: x(:, :)
      !> Where it does not converge
      type(error_t), allocatable, intent(out) :: error
      !> (directions, columns) where there are any directions
      real(wp), intent(in), optional :: balance(:, :)
      real(wp), intent(out), optional :: z(:, :)
      real(wp), allocatable :: one(:, :), solution(:, :)
      real(wp), dimension(size(self%soft, 2)) :: given, found
      real(wp) :: first, last
      integer :: k, steps

      allocate (solution, mold=self%stiffness)
      given = 0.0_wp
      do k = 1, size(rhs, 2)
         one = reshape(rhs(:, k), shape(solution))
         if (present(balance)) given = balance(:, k)
         call self%solve(compliance, one, column_accuracy, 0.0_wp, column_steps, solution, steps, first, last, given, found)
         if (present(z)) z(:, k) = found
         if (last > column_accuracy*first) then
            call failure(error, 'contact compliance: the iteration for stuck points does not converge (residual '// &
               & to_text(last/first, 2)//' after '//to_text(steps)//' steps)')
            return
         end if
         x(:, k) = reshape(solution, [size(solution)])
      end do
   end subroutine solve_columns

   !> Find the directions in which B J is far from 1, by Lanczos on the present states (no slipping points).
   !>
   !> With z = B q, q_i . z_j = delta_ij, the matrix T = z^T J z is tridiagonal; its eigenvectors w give directions z w that B
   !> weighs 1 and J weighs the eigenvalue. B - sum (1 - 1/eigenvalue) z z^T weighs them right and stays positive definite.
   subroutine learn(self, compliance, error)
      class(closed_system_t), intent(inout) :: self
      class(contact_compliance_t), intent(in) :: compliance
      type(error_t), allocatable, intent(out) :: error
      real(wp), allocatable :: q(:, :), z(:, :), w(:, :), bw(:, :), T(:, :), values(:), along(:, :)
      integer, allocatable :: far(:)
      real(wp) :: length
      integer :: j, n, k

      n = size(self%stiffness)
      self%learned = reshape([real(wp) ::], [n, 0])
      self%excess = [real(wp) ::]
      allocate (q(n, lanczos_steps), z(n, lanczos_steps), T(lanczos_steps, lanczos_steps), source=0.0_wp)
      allocate (w, bw, mold=self%stiffness)
      ! A start with a bit of everything, most of it where J is large.
      bw = reshape([(modulo(0.6180339887_wp*k*k, 1.0_wp) - 0.4_wp, k=1, n)], shape(bw))
      call restrict(self, bw, 0)
      call self%apply(compliance, bw, w)
      do j = 1, lanczos_steps
         if (j > 1) then
            do k = 1, 2
               along = reshape(matmul(reshape(w, [n]), z(:, :j - 1)), [j - 1, 1])
               w = w - reshape(matmul(q(:, :j - 1), along(:, 1)), shape(w))
            end do
         end if
         call compliance%precondition(w, bw)
         call restrict(self, bw, 0)
         length = sqrt(max(0.0_wp, sum(w*bw)))
         if (j > 1) then
            T(j, j - 1) = length
            T(j - 1, j) = length
            if (length <= 1.0e-10_wp*T(j - 1, j - 1)) exit
         else if (length == 0.0_wp) then
            return
         end if
         q(:, j) = reshape(w/length, [n])
         z(:, j) = reshape(bw/length, [n])
         call self%apply(compliance, bw/length, w)
         T(j, j) = dot_product(reshape(w, [n]), z(:, j))
      end do
      n = min(j, lanczos_steps + 1) - 1
      T = T(:n, :n)
      allocate (values(n))
      call eigen_symmetric(T, values, error)
      if (allocated(error)) return
      far = pack([(k, k=1, n)], values > well_above .or. (values < well_below .and. values > 0.0_wp))
      self%excess = 1.0_wp - 1.0_wp/values(far)
      self%learned = matmul(z(:, :n), T(:, far))
   end subroutine learn

end module microslip_contact_closed_system
