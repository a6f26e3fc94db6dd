!> The reference solver: the projected Jacobi iteration on all points in potential contact.
!> Slow by construction; the condensed solver is measured against it.
module microslip_contact_plain_jacobi
   use microslip_contact_laws, only: law_residual
   use microslip_contact_problem, only: contact_problem_t, contact_state_t, solve_record_t, contact_solver_t, book_step
   use microslip_contact_projected_jacobi, only: step_lengths, contraction_gap, iterate_projected_jacobi, states_of_forces
   use microslip_core_error, only: error_t, failure
   use microslip_core_kinds, only: wp
   use microslip_core_text, only: to_text
   use microslip_linalg_dense, only: inverse_spd, product_symmetric
   implicit none(type, external)
   private

   public :: plain_jacobi_t

   type, extends(contact_solver_t) :: plain_jacobi_t
      private
      real(wp), allocatable :: eps(:)
      real(wp) :: gamma = 1.0_wp
   contains
      procedure :: start
      procedure :: advance
   end type plain_jacobi_t

contains

   !> Step lengths and contraction gap of the problem.
   subroutine start(self, problem, state, error)
      class(plain_jacobi_t), intent(inout) :: self
      type(contact_problem_t), intent(in) :: problem
      type(contact_state_t), intent(in) :: state
      type(error_t), allocatable, intent(out) :: error
      real(wp), allocatable :: inverse(:, :)

      if (size(state%status) /= problem%n_points) then
         call failure(error, 'contact state of '//to_text(size(state%status))//' points for a problem of '// &
            & to_text(problem%n_points))
         return
      end if
      self%eps = step_lengths(problem%G)
      inverse = problem%G
      call inverse_spd(inverse, error)
      if (allocated(error)) then
         error%message = 'contact compliance G is not positive definite: '//error%message
         return
      end if
      self%gamma = contraction_gap(inverse, self%eps)
   end subroutine start

   !> Take the state to driver q.
   subroutine advance(self, problem, q, state, record)
      class(plain_jacobi_t), intent(inout) :: self
      type(contact_problem_t), intent(in) :: problem
      !> (drivers)
      real(wp), intent(in) :: q(:)
      type(contact_state_t), intent(inout) :: state
      type(solve_record_t), intent(out) :: record
      real(wp), allocatable :: c(:), force(:), gap(:)
      logical :: forced_open(problem%n_points)
      integer :: p, k
      type(contact_state_t) :: before
      real(wp) :: scale

      before = state
      c = problem%r_0 + matmul(problem%R, q)
      forced_open = .false.
      do p = 1, problem%n_points
         k = 3*p - 2
         c(k + 1:k + 2) = c(k + 1:k + 2) - state%gap(2:3, p)
         if (problem%velocity_level) then
            ! Closed set by prediction (paper, before eq. (7)): open stays open while its gap is positive.
            forced_open(p) = state%force(1, p) <= 0.0_wp .and. state%gap(1, p) > 0.0_wp
            c(k) = c(k) - state%gap(1, p)
         end if
      end do
      force = reshape(state%force, [3*problem%n_points])
      call iterate_projected_jacobi(problem%G, c, self%eps, self%gamma, problem%friction, forced_open, 0.0_wp, &
         & self%tolerance, self%max_iterations, force, record%iterations, record%error_estimate)
      record%converged = record%error_estimate <= self%tolerance
      allocate (gap(size(c)))
      call product_symmetric(problem%G, force, gap)
      gap = gap + c

      scale = max(maxval(force), tiny(1.0_wp))
      state%force = reshape(force, [3, problem%n_points])
      state%status = states_of_forces(state%force, problem%friction)
      do p = 1, problem%n_points
         k = 3*p - 2
         if (.not. forced_open(p)) record%residual = max(record%residual, law_residual(force(k:k + 2), gap(k), &
            & gap(k + 1:k + 2), self%eps(k), self%eps(k + 1), problem%friction(p))/scale)
         state%gap(2:3, p) = state%gap(2:3, p) + gap(k + 1:k + 2)
         if (problem%velocity_level) then
            state%gap(1, p) = state%gap(1, p) + gap(k)
         else
            state%gap(1, p) = gap(k)
         end if
      end do
      state%q = q
      call book_step(problem, before, state, record)
   end subroutine advance

end module microslip_contact_plain_jacobi
