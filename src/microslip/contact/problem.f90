!> What a contact solver knows: the linear relation between gap, driver and contact force, and the state.
!>
!>     gap = r_0 + R q + G force          (paper eqs. (18)-(20), METHOD section 4)
!>
!> with the driver q: modal coordinates and load amplitudes in dynamics, load amplitudes in statics.
!>
!> A structure that is held by weak springs gives way, in a few directions V, many orders of magnitude more than the contact
!> does. In one sum with the rest they would leave nothing of the digits of G, so they may be kept apart, as amplitudes z:
!>     gap = r_0 + R q + G force + V z,    z = z_0 + D q + V^T force
!> Solvers advance the state from one q to the next; they know nothing of structures or time.
module microslip_contact_problem
   use microslip_contact_compliance_operator, only: contact_compliance_t
   use microslip_core_archive, only: archive_t
   use microslip_core_error, only: error_t
   use microslip_core_kinds, only: wp
   use microslip_contact_laws, only: state_open, state_stick, state_slip
   use microslip_linalg_dense, only: solve_general
   implicit none(type, external)
   private

   public :: contact_problem_t, contact_state_t, solve_record_t, contact_solver_t
   public :: new_state, gap_of, gap_of_point, free_gap, soft_amplitude, settled_amplitude, count_states, contact_energy
   public :: book_step, friction_work

   !> The points in potential contact and their linear relation. Unknown order (n, t1, t2) per point.
   type :: contact_problem_t
      integer :: n_points = 0
      !> (3 points, 3 points) symmetric, m/N
      real(wp), allocatable :: G(:, :)
      !> G as an operator, in place of the matrix
      class(contact_compliance_t), allocatable :: compliance
      !> (3 points, drivers) m per unit of the driver
      real(wp), allocatable :: R(:, :)
      !> (3 points) m
      real(wp), allocatable :: r_0(:)
      !> (points)
      real(wp), allocatable :: friction(:)
      !> (points) points of one interface have the same number, counted from 1; one group where not allocated.
      !> Groups are coupled through the structure alone, smoothly: solvers may make use of that.
      integer, allocatable :: group(:)
      !> (3 points, outputs) sums of the contact forces that are wanted in every step; none where not allocated
      real(wp), allocatable :: outputs(:, :)
      !> Normal law on velocity level, closed points only (the paper's option), instead of gap level
      logical :: velocity_level = .false.
      !> V, (3 points, directions); not allocated: G and R hold everything
      real(wp), allocatable :: soft(:, :)
      !> D, (directions, drivers), and z_0, (directions)
      real(wp), allocatable :: soft_drive(:, :), soft_0(:)
   end type contact_problem_t

   !> Where the contact is now.
   type :: contact_state_t
      !> (drivers)
      real(wp), allocatable :: q(:)
      !> (3, points) N
      real(wp), allocatable :: force(:, :)
      !> (3, points) m; the tangential part is the total relative displacement
      real(wp), allocatable :: gap(:, :)
      !> (points) state_open, state_stick or state_slip
      integer, allocatable :: status(:)
   contains
      procedure :: pass => pass_state
   end type contact_state_t

   !> How a solve went. An unconverged solve is a result, not an exception.
   type :: solve_record_t
      logical :: converged = .false.
      !> Iterations of the nonlinear solver (sweeps, or Newton steps)
      integer :: iterations = 0
      !> Largest violation of the contact laws over the largest contact force
      real(wp) :: residual = 0.0_wp
      !> Estimate of the error of the contact forces over the largest contact force: what a further Newton
      !> step would change, or the last change of the projected Jacobi over its contraction gap (a bound)
      real(wp) :: error_estimate = 0.0_wp
      !> How often a rescue (block Gauss-Seidel) was needed
      integer :: rescues = 0
      !> Points that joined or left the condensed base set
      integer :: set_changes = 0
      !> Points that are open, stick, slip after the step
      integer :: counts(3) = 0
      !> (drivers) R^T force and (outputs) outputs^T force after the step
      real(wp), allocatable :: reaction(:), output(:)
      !> 1/2 force^T G force after the step, J
      real(wp) :: contact_energy = 0.0_wp
      !> Work that friction took in the step, J: see `friction_work`
      real(wp) :: friction_loss = 0.0_wp
   contains
      procedure :: pass => pass_record
   end type solve_record_t

   !> A contact solver: takes the state to a new driver value.
   type, abstract :: contact_solver_t
      !> Wanted relative accuracy of the contact forces
      real(wp) :: tolerance = 1.0e-10_wp
      integer :: max_iterations = 100000
      !> `advance` may leave the forces of sticking points and the gaps of open ones behind, for `complete`
      logical :: lazy = .false.
   contains
      procedure(start_interface), deferred :: start
      procedure(advance_interface), deferred :: advance
      procedure :: complete
   end type contact_solver_t

   abstract interface
      !> Prepare for a problem from a state in equilibrium (factorisations, step lengths).
      subroutine start_interface(self, problem, state, error)
         use microslip_core_error, only: error_t
         import :: contact_solver_t, contact_problem_t, contact_state_t
         implicit none(type, external)
         class(contact_solver_t), intent(inout) :: self
         type(contact_problem_t), intent(in) :: problem
         type(contact_state_t), intent(in) :: state
         type(error_t), allocatable, intent(out) :: error
      end subroutine start_interface

      !> Find forces and gaps at driver q; friction remembers the tangential gap of `state`.
      subroutine advance_interface(self, problem, q, state, record)
         import :: contact_solver_t, contact_problem_t, contact_state_t, solve_record_t, wp
         implicit none(type, external)
         class(contact_solver_t), intent(inout) :: self
         type(contact_problem_t), intent(in) :: problem
         real(wp), intent(in) :: q(:)
         type(contact_state_t), intent(inout) :: state
         type(solve_record_t), intent(out) :: record
      end subroutine advance_interface
   end interface

contains

   !> Bring all forces and gaps of the state up to its driver. Solvers that are never behind have nothing to do.
   subroutine complete(self, problem, state)
      class(contact_solver_t), intent(inout) :: self
      type(contact_problem_t), intent(in) :: problem
      type(contact_state_t), intent(inout) :: state
   end subroutine complete

   !> The state at the beginning: driver zero, no force, all points open (or just touching). Where there is a force from
   !> the beginning, its points stick at no gap.
   pure function new_state(problem, force) result(state)
      type(contact_problem_t), intent(in) :: problem
      !> (3, points) N: normal forces, in equilibrium with all gaps zero where there are any; default: none
      real(wp), intent(in), optional :: force(:, :)
      type(contact_state_t) :: state
      integer :: p

      allocate (state%q(size(problem%R, 2)), source=0.0_wp)
      allocate (state%force(3, problem%n_points), source=0.0_wp)
      state%gap = reshape(problem%r_0, [3, problem%n_points])
      allocate (state%status(problem%n_points), source=state_open)
      if (.not. present(force)) return
      state%force = force
      do p = 1, problem%n_points
         if (force(1, p) <= 0.0_wp) cycle
         state%gap(:, p) = 0.0_wp
         state%status(p) = state_stick
      end do
   end function new_state

   !> Store a state, or take it back.
   subroutine pass_state(self, archive)
      class(contact_state_t), intent(inout) :: self
      type(archive_t), intent(inout) :: archive

      call archive%pass(self%q)
      call archive%pass(self%force)
      call archive%pass(self%gap)
      call archive%pass(self%status)
   end subroutine pass_state

   !> Store how a solve went, or take it back.
   subroutine pass_record(self, archive)
      class(solve_record_t), intent(inout) :: self
      type(archive_t), intent(inout) :: archive
      integer :: k

      call archive%pass(self%converged)
      call archive%pass(self%iterations)
      call archive%pass(self%residual)
      call archive%pass(self%error_estimate)
      call archive%pass(self%rescues)
      call archive%pass(self%set_changes)
      do k = 1, size(self%counts)
         call archive%pass(self%counts(k))
      end do
      call archive%pass(self%reaction)
      call archive%pass(self%output)
      call archive%pass(self%contact_energy)
      call archive%pass(self%friction_loss)
   end subroutine pass_record

   !> z = z_0 + D q + V^T force, (directions), none where nothing is kept apart.
   pure function soft_amplitude(problem, q, force) result(z)
      type(contact_problem_t), intent(in) :: problem
      !> (drivers)
      real(wp), intent(in) :: q(:)
      !> (3, points) N
      real(wp), intent(in) :: force(:, :)
      real(wp), allocatable :: z(:)

      if (allocated(problem%soft)) then
         z = problem%soft_0 + matmul(problem%soft_drive, q) + matmul(reshape(force, [size(force)]), problem%soft)
      else
         z = [real(wp) ::]
      end if
   end function soft_amplitude

   !> z of a state in equilibrium, (directions): that with which the gaps of its closed points agree best. Weak springs feel
   !> nothing of a rigid motion that is no more than the rounding of the forces' sum; gaps do.
   function settled_amplitude(problem, state) result(z)
      type(contact_problem_t), intent(in) :: problem
      type(contact_state_t), intent(in) :: state
      real(wp), allocatable :: z(:)
      real(wp), allocatable :: V(:, :), matrix(:, :), rhs(:, :), off(:, :)
      type(error_t), allocatable :: error
      logical :: known(3, problem%n_points)
      integer, allocatable :: rows(:)
      integer :: k

      z = soft_amplitude(problem, state%q, state%force)
      if (size(z) == 0) return
      known = spread(state%status /= state_open, 1, 3)
      rows = pack([(k, k=1, size(known))], reshape(known, [size(known)]))
      V = problem%soft(rows, :)
      off = state%gap - gap_of(problem, state%q, state%force, z)
      rhs = matmul(transpose(V), reshape(pack(off, known), [size(rows), 1]))
      matrix = matmul(transpose(V), V)
      call solve_general(matrix, rhs, error)
      if (.not. allocated(error)) z = z + rhs(:, 1)
   end function settled_amplitude

   !> What the gaps would be without contact forces, (3 points), m.
   pure function free_gap(problem, q) result(gap)
      type(contact_problem_t), intent(in) :: problem
      !> (drivers)
      real(wp), intent(in) :: q(:)
      real(wp) :: gap(3*problem%n_points)

      gap = problem%r_0 + matmul(problem%R, q)
      if (allocated(problem%soft)) gap = gap + matmul(problem%soft, problem%soft_0 + matmul(problem%soft_drive, q))
   end function free_gap

   !> gap = r_0 + R q + G force + V z at all points, (3, points).
   function gap_of(problem, q, force, z) result(gap)
      type(contact_problem_t), intent(in) :: problem
      !> (drivers)
      real(wp), intent(in) :: q(:)
      !> (3, points) N
      real(wp), intent(in), contiguous :: force(:, :)
      !> (directions) where it is known better than as the difference that it is
      real(wp), intent(in), optional :: z(:)
      real(wp), allocatable :: gap(:, :)
      real(wp), allocatable :: work(:)
      integer :: k, column

      work = problem%r_0 + matmul(problem%R, q)
      if (present(z)) then
         if (size(z) > 0) work = work + matmul(problem%soft, z)
      else if (allocated(problem%soft)) then
         work = work + matmul(problem%soft, soft_amplitude(problem, q, force))
      end if
      if (allocated(problem%compliance)) then
         allocate (gap(3, problem%n_points))
         call problem%compliance%product(force, gap)
         gap = gap + reshape(work, [3, problem%n_points])
         return
      end if
      do k = 1, problem%n_points
         if (all(force(:, k) == 0.0_wp)) cycle
         do column = 1, 3
            work = work + problem%G(:, 3*k - 3 + column)*force(column, k)
         end do
      end do
      gap = reshape(work, [3, problem%n_points])
   end function gap_of

   !> gap = r_0 + R q + G force + V z of one point in the state.
   function gap_of_point(problem, state, point) result(gap)
      type(contact_problem_t), intent(in) :: problem
      type(contact_state_t), intent(in) :: state
      integer, intent(in) :: point
      real(wp) :: gap(3)
      real(wp), allocatable :: z(:)
      integer :: c, k, p

      if (allocated(problem%soft)) z = soft_amplitude(problem, state%q, state%force)
      do c = 1, 3
         k = 3*point - 3 + c
         gap(c) = problem%r_0(k) + dot_product(problem%R(k, :), state%q)
         if (allocated(z)) gap(c) = gap(c) + dot_product(problem%soft(k, :), z)
         do p = 1, problem%n_points
            gap(c) = gap(c) + dot_product(problem%G(3*p - 2:3*p, k), state%force(:, p))
         end do
      end do
   end function gap_of_point

   !> 1/2 force^T (G + V V^T) force of a state in equilibrium, J (from G force + V z = gap - r_0 - R q on the loaded points).
   pure real(wp) function contact_energy(problem, state)
      type(contact_problem_t), intent(in) :: problem
      type(contact_state_t), intent(in) :: state
      integer :: p, c

      contact_energy = 0.0_wp
      do p = 1, problem%n_points
         if (all(state%force(:, p) == 0.0_wp)) cycle
         do c = 1, 3
            contact_energy = contact_energy + 0.5_wp*state%force(c, p)*(state%gap(c, p) - problem%r_0(3*p - 3 + c) &
               & - dot_product(problem%R(3*p - 3 + c, :), state%q))
         end do
      end do
      if (allocated(problem%soft)) contact_energy = contact_energy - 0.5_wp*dot_product(problem%soft_0 &
         & + matmul(problem%soft_drive, state%q), matmul(reshape(state%force, [3*problem%n_points]), problem%soft))
   end function contact_energy

   !> Counts, reaction, outputs and energies of a step between two states that are known in full.
   subroutine book_step(problem, before, after, record)
      type(contact_problem_t), intent(in) :: problem
      type(contact_state_t), intent(in) :: before, after
      type(solve_record_t), intent(inout) :: record
      real(wp), allocatable :: gap_before(:, :)
      real(wp) :: slip(2)
      integer :: p

      record%counts = count_states(after)
      record%reaction = matmul(reshape(after%force, [3*problem%n_points]), problem%R)
      if (allocated(problem%soft)) record%reaction = record%reaction &
         & + matmul(matmul(reshape(after%force, [3*problem%n_points]), problem%soft), problem%soft_drive)
      if (allocated(problem%outputs)) record%output = matmul(reshape(after%force, [3*problem%n_points]), problem%outputs)
      record%contact_energy = contact_energy(problem, after)
      record%friction_loss = 0.0_wp
      do p = 1, problem%n_points
         if (all(after%force(2:3, p) == 0.0_wp)) cycle
         slip = after%gap(2:3, p) - before%gap(2:3, p)
         if (before%status(p) == state_open) then
            ! A solver need not follow the tangential displacement of open points: here it is from the definition.
            if (.not. allocated(gap_before)) gap_before = gap_of(problem, before%q, before%force)
            slip = after%gap(2:3, p) - gap_before(2:3, p)
         end if
         record%friction_loss = record%friction_loss + friction_work(after%status(p), problem%friction(p), before%force(1, p), &
            & after%force(:, p), slip)
      end do
   end subroutine book_step

   !> Work that friction takes from a point in a step, J: mu (lambda_n before + lambda_n after)/2 |slip| where it slips.
   !>
   !> The contact law is met at the end of the step, but slip happens on the way there, at the limit that the normal force
   !> has meanwhile. With its mean the loss is of second order in the step; with the force at the end it is of first order
   !> wherever the normal force changes. (The mean of the friction force itself would not do: it is no limit in the step in
   !> which slip begins or turns.)
   pure real(wp) function friction_work(status, friction, normal_before, force, slip) result(work)
      !> After the step
      integer, intent(in) :: status
      real(wp), intent(in) :: friction
      !> N
      real(wp), intent(in) :: normal_before
      !> (n, t1, t2) after the step, N
      real(wp), intent(in) :: force(3)
      !> Of the step, m
      real(wp), intent(in) :: slip(2)

      if (status == state_slip) then
         work = friction*0.5_wp*(normal_before + force(1))*norm2(slip)
      else
         ! Nothing, but for the tolerance of the solver.
         work = -dot_product(force(2:3), slip)
      end if
   end function friction_work

   !> Number of points that are open, stick and slip, (3).
   pure function count_states(state) result(counts)
      type(contact_state_t), intent(in) :: state
      integer :: counts(3)
      counts = [count(state%status == state_open), count(state%status == state_stick), &
         & count(state%status == state_slip)]
   end function count_states

end module microslip_contact_problem
