!> The reference solver: the projected Jacobi iteration on all points in potential contact.
!> Slow by construction; the condensed solver is measured against it.
module microslip_contact_plain_jacobi
   use microslip_contact_force_step, only: force_step_t, begin_step, end_step, update_gap, step_residual
   use microslip_contact_laws, only: smallest_force
   use microslip_contact_problem, only: contact_problem_t, contact_state_t, solve_record_t, contact_solver_t
   use microslip_contact_projected_jacobi, only: step_lengths, contraction_gap, iterate_projected_jacobi, states_of_forces
   use microslip_core_error, only: error_t, failure
   use microslip_core_kinds, only: wp
   use microslip_core_text, only: to_text
   use microslip_linalg_dense, only: inverse_spd
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
      type(force_step_t) :: step

      step = begin_step(problem, q, state)
      call iterate_projected_jacobi(problem%G, step%c, self%eps, self%gamma, problem%friction, step%forced_open, 0.0_wp, &
         & self%tolerance, self%max_iterations, step%force, record%iterations, record%error_estimate)
      record%converged = record%error_estimate <= self%tolerance
      call update_gap(problem%G, step)
      record%residual = step_residual(step, self%eps(1::3))/max(maxval(step%force), smallest_force)
      call end_step(problem, q, step, states_of_forces(reshape(step%force, [3, problem%n_points]), problem%friction), &
         & state, record)
   end subroutine advance

end module microslip_contact_plain_jacobi
