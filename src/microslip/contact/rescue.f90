!> The rescue of solvers that work on gap increments: the step once more in the contact forces, by the solver for operators with
!> the matrix G behind the operator (`microslip_contact_matrix_free`), which approaches what Newton does not reach by held
!> friction limits and in parts of the step; and by Newton with Gauss-Seidel (`microslip_contact_newton`) where that fails and
!> the matrix is small enough for sweeps over all of it.
module microslip_contact_rescue
   use microslip_contact_base_set, only: base_set_t
   use microslip_contact_compliance_operator, only: contact_compliance_t
   use microslip_contact_matrix_free, only: matrix_free_solver_t
   use microslip_contact_newton, only: newton_t
   use microslip_contact_problem, only: contact_problem_t, contact_state_t, solve_record_t
   use microslip_core_error, only: error_t
   use microslip_core_kinds, only: wp
   use microslip_linalg_dense, only: inverse_spd, product_symmetric
   implicit none(type, external)
   private

   public :: solve_by_forces

   !> Unknowns up to which Gauss-Seidel is asked.
   integer, parameter :: few_unknowns = 3000

   !> G behind the operator. It lives for one step: what it points to belongs to the caller.
   type, extends(contact_compliance_t) :: matrix_compliance_t
      private
      real(wp), pointer, contiguous :: G(:, :) => null()
      !> The inverse on a set of points, and the unknowns of the set; not associated: the diagonal has to do
      real(wp), pointer, contiguous :: M(:, :) => null()
      integer, allocatable :: unknowns(:)
      !> M V and H^-1: M + M V H^-1 (M V)^T is the inverse without the soft directions; not associated: there are none
      real(wp), pointer, contiguous :: soft(:, :) => null()
      real(wp), allocatable :: held(:, :)
      !> (3 points) N/m
      real(wp), allocatable :: stiffness(:)
   contains
      procedure :: product => product_with
      procedure :: precondition
      procedure :: local_stiffness
   end type matrix_compliance_t

contains

   !> Take the state to driver q. Where it does not get there the state stays as it was.
   subroutine solve_by_forces(problem, base, tolerance, max_iterations, q, expected_closed, state, record)
      !> With its matrix
      type(contact_problem_t), intent(in), target :: problem
      !> Its inverse is the preconditioner, if it has one
      type(base_set_t), intent(in), target :: base
      !> Wanted relative accuracy of the contact forces
      real(wp), intent(in) :: tolerance
      !> Of the step, those in the record included
      integer, intent(in) :: max_iterations
      !> (drivers)
      real(wp), intent(in) :: q(:)
      !> (points) points that are taken for closed first
      logical, intent(in) :: expected_closed(:)
      type(contact_state_t), intent(inout) :: state
      !> Iterations and rescues are counted on
      type(solve_record_t), intent(inout) :: record
      type(contact_problem_t) :: same
      type(matrix_free_solver_t) :: solver
      type(newton_t) :: newton
      type(contact_state_t) :: trial
      type(solve_record_t) :: tried
      type(error_t), allocatable :: error

      call put_behind_operator(problem, base, same)
      solver%tolerance = tolerance
      solver%max_iterations = max_iterations - record%iterations
      solver%expected_closed = expected_closed
      solver%predicts = .false.
      trial = state
      call solver%start(same, trial, error)
      if (.not. allocated(error) .and. solver%max_iterations > 0) then
         call solver%advance(same, q, trial, tried)
         call take_over(tried, trial, state, record)
      end if
      if (record%converged .or. 3*problem%n_points > few_unknowns .or. allocated(problem%soft)) return
      newton%tolerance = tolerance
      newton%max_iterations = max_iterations - record%iterations
      trial = state
      call newton%start(problem, trial, error)
      if (allocated(error) .or. newton%max_iterations <= 0) return
      call newton%advance(problem, q, trial, tried)
      call take_over(tried, trial, state, record)
   end subroutine solve_by_forces

   !> The record of an attempt after those before it, and its state if it got there.
   subroutine take_over(tried, trial, state, record)
      type(solve_record_t), intent(in) :: tried
      type(contact_state_t), intent(in) :: trial
      type(contact_state_t), intent(inout) :: state
      type(solve_record_t), intent(inout) :: record
      integer :: iterations, rescues, set_changes

      iterations = record%iterations + tried%iterations
      rescues = record%rescues + 1 + tried%rescues
      set_changes = record%set_changes
      if (tried%converged) then
         record = tried
         state = trial
      else if (record%residual <= 0.0_wp) then
         record%residual = tried%residual
         record%error_estimate = tried%error_estimate
      end if
      record%iterations = iterations
      record%rescues = rescues
      record%set_changes = set_changes
   end subroutine take_over

   !> The same problem with its matrix behind an operator.
   subroutine put_behind_operator(problem, base, same)
      type(contact_problem_t), intent(in), target :: problem
      type(base_set_t), intent(in), target :: base
      type(contact_problem_t), intent(out) :: same
      type(matrix_compliance_t), allocatable :: compliance
      type(error_t), allocatable :: error
      integer :: j, k

      same%n_points = problem%n_points
      same%R = problem%R
      same%r_0 = problem%r_0
      same%friction = problem%friction
      same%velocity_level = problem%velocity_level
      if (allocated(problem%outputs)) same%outputs = problem%outputs
      if (allocated(problem%soft)) then
         same%soft = problem%soft
         same%soft_drive = problem%soft_drive
         same%soft_0 = problem%soft_0
      end if
      allocate (compliance)
      compliance%G => problem%G
      compliance%stiffness = [(1.0_wp/problem%G(k, k), k=1, size(problem%G, 1))]
      if (allocated(base%M)) then
         compliance%M => base%M
         compliance%unknowns = [((3*base%inside(j) - 3 + k, k=1, 3), j=1, size(base%inside))]
         do j = 1, size(compliance%unknowns)
            ! Unknowns that carry no force have no inverse.
            if (base%M(j, j) > 0.0_wp) compliance%stiffness(compliance%unknowns(j)) = base%M(j, j)
         end do
         if (size(base%soft, 2) > 0) then
            compliance%soft => base%soft
            compliance%held = base%soft_rest
            call inverse_spd(compliance%held, error)
            if (allocated(error)) nullify (compliance%soft)
         end if
      end if
      call move_alloc(compliance, same%compliance)
   end subroutine put_behind_operator

   !> y = G x.
   subroutine product_with(self, x, y)
      class(matrix_compliance_t), intent(in) :: self
      !> (3, points) N
      real(wp), intent(in), contiguous :: x(:, :)
      !> (3, points) m
      real(wp), intent(out), contiguous :: y(:, :)
      real(wp) :: force(size(x)), gap(size(x))

      force = reshape(x, [size(x)])
      call product_symmetric(self%G, force, gap)
      y = reshape(gap, shape(y))
   end subroutine product_with

   !> y = B x: M on the set, the diagonal elsewhere.
   subroutine precondition(self, x, y)
      class(matrix_compliance_t), intent(in) :: self
      !> (3, points) m
      real(wp), intent(in), contiguous :: x(:, :)
      !> (3, points) N
      real(wp), intent(out), contiguous :: y(:, :)
      real(wp) :: gap(size(x)), force(size(x))
      real(wp), allocatable :: part(:), moved(:)

      gap = reshape(x, [size(x)])
      force = self%stiffness*gap
      if (associated(self%M)) then
         part = gap(self%unknowns)
         allocate (moved, mold=part)
         call product_symmetric(self%M, part, moved)
         if (associated(self%soft)) moved = moved + matmul(self%soft, matmul(self%held, matmul(part, self%soft)))
         force(self%unknowns) = moved
      end if
      y = reshape(force, shape(y))
   end subroutine precondition

   !> Diagonal of B, (3, points), N/m.
   function local_stiffness(self) result(stiffness)
      class(matrix_compliance_t), intent(in) :: self
      real(wp), allocatable :: stiffness(:, :)

      stiffness = reshape(self%stiffness, [3, size(self%stiffness)/3])
   end function local_stiffness

end module microslip_contact_rescue
