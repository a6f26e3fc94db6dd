!> Nonsmooth block Gauss-Seidel on the contact forces: slow, and robust on any compliance.
!>
!> Point after point, the three forces of a point are set so that its own laws hold with all others fixed
!> (`one_point`, exact), over- or under-relaxed. Needs no factor of G: G may be singular (hyperstatic contact)
!> and need not be symmetric to the last digit. Where one relaxation does not get there, the next starts anew: from
!> where the other stagnates it would stagnate as well.
!>
!> Jean & Moreau (1992), Unilaterality and dry friction in the dynamics of rigid body collections; Acary, Bremond
!> & Huber (2018), On solving contact problems with Coulomb friction, section 6 (NSGS, relaxation).
module microslip_contact_gauss_seidel
   use microslip_contact_force_step, only: force_step_t, begin_step, end_step, update_gap, step_residual, force_scale, &
      & step_states, point_stiffness
   use microslip_contact_one_point, only: solve_one_point
   use microslip_contact_problem, only: contact_problem_t, contact_state_t, solve_record_t, contact_solver_t
   use microslip_core_error, only: error_t
   use microslip_core_kinds, only: wp
   implicit none(type, external)
   private

   public :: gauss_seidel_t, sweep_forces

   !> Relaxations, tried in turn with an equal part of the iterations.
   real(wp), parameter :: relaxations(3) = [1.0_wp, 1.4_wp, 0.7_wp]
   !> Sweeps after which the gaps are computed anew from the definition (rounding).
   integer, parameter :: refresh_after = 50

   type, extends(contact_solver_t) :: gauss_seidel_t
      !> (points) augmentation of the residual, N/m
      real(wp), allocatable, private :: stiffness(:)
   contains
      procedure :: start
      procedure :: advance
   end type gauss_seidel_t

contains

   !> Scales of the problem.
   subroutine start(self, problem, state, error)
      class(gauss_seidel_t), intent(inout) :: self
      type(contact_problem_t), intent(in) :: problem
      type(contact_state_t), intent(in) :: state
      !> Where the problem has no matrix, or a point without compliance
      type(error_t), allocatable, intent(out) :: error

      call point_stiffness(problem, state, self%stiffness, error)
   end subroutine start

   !> Take the state to driver q.
   subroutine advance(self, problem, q, state, record)
      class(gauss_seidel_t), intent(inout) :: self
      type(contact_problem_t), intent(in) :: problem
      !> (drivers)
      real(wp), intent(in) :: q(:)
      type(contact_state_t), intent(inout) :: state
      type(solve_record_t), intent(out) :: record
      type(force_step_t) :: step, best
      real(wp) :: residual, estimate
      integer :: k, sweeps

      best = begin_step(problem, q, state)
      record%residual = huge(1.0_wp)
      do k = 1, size(relaxations)
         step = begin_step(problem, q, state)
         call sweep_forces(problem%G, self%stiffness, relaxations(k), self%tolerance, &
            & (self%max_iterations - record%iterations)/(size(relaxations) - k + 1), step, sweeps, residual, estimate)
         record%iterations = record%iterations + sweeps
         if (residual >= record%residual) cycle
         best = step
         record%residual = residual
         record%error_estimate = estimate
         record%converged = residual <= self%tolerance
         if (record%converged) exit
      end do
      call end_step(problem, q, best, step_states(best, self%stiffness), state, record)
   end subroutine advance

   !> Sweep over all points until the residual is below the limit; `step%gap` fits `step%force` on return.
   !>
   !> Exit: residual <= limit with gaps computed from the definition, or sweeps = max_sweeps.
   subroutine sweep_forces(G, stiffness, relaxation, limit, max_sweeps, step, sweeps, residual, error_estimate)
      !> (3 points, 3 points) m/N
      real(wp), intent(in), contiguous :: G(:, :)
      !> (points) augmentation of the residual, N/m
      real(wp), intent(in) :: stiffness(:)
      !> Factor on the change of a point's forces
      real(wp), intent(in) :: relaxation
      !> Residual to stop at, over the largest force
      real(wp), intent(in) :: limit
      integer, intent(in) :: max_sweeps
      !> Start forces in, solution out
      type(force_step_t), intent(inout) :: step
      integer, intent(out) :: sweeps
      !> Largest violation of the laws over the largest force
      real(wp), intent(out) :: residual
      !> What further sweeps would change the forces, over the largest one: the last change, summed up at the rate
      !> at which the changes fall
      real(wp), intent(out) :: error_estimate
      real(wp) :: change(0:2), scale

      change = 0.0_wp
      call update_gap(G, step)
      scale = force_scale(step, stiffness)
      residual = step_residual(step, stiffness)/scale
      do sweeps = 1, max_sweeps
         change = [change(1:2), 0.0_wp]
         call sweep_once(G, relaxation, step, change(2))
         if (mod(sweeps, refresh_after) == 0 .or. sweeps == max_sweeps) call update_gap(G, step)
         scale = force_scale(step, stiffness)
         residual = step_residual(step, stiffness)/scale
         if (residual > limit) cycle
         call update_gap(G, step)
         residual = step_residual(step, stiffness)/scale
         if (residual <= limit) exit
      end do
      sweeps = min(sweeps, max_sweeps)
      error_estimate = max(residual, change(2)/scale)
      if (change(0) > change(2)) error_estimate = max(residual, change(2)/(1.0_wp - sqrt(change(2)/change(0)))/scale)
   end subroutine sweep_forces

   !> One sweep over all points, the gaps following the forces.
   pure subroutine sweep_once(G, relaxation, step, change)
      real(wp), intent(in), contiguous :: G(:, :)
      real(wp), intent(in) :: relaxation
      type(force_step_t), intent(inout) :: step
      !> Largest change of a force, N
      real(wp), intent(out) :: change
      real(wp) :: own(3, 3), force(3), d(3)
      integer :: p, k, status

      change = 0.0_wp
      do p = 1, size(step%friction)
         k = 3*p - 2
         own = G(k:k + 2, k:k + 2)
         force = 0.0_wp
         if (.not. step%forced_open(p)) call solve_one_point(own, step%gap(k:k + 2) - matmul(own, step%force(k:k + 2)), &
            & step%friction(p), force, status)
         d = relaxation*(force - step%force(k:k + 2))
         if (all(d == 0.0_wp)) cycle
         step%force(k:k + 2) = step%force(k:k + 2) + d
         step%gap = step%gap + G(:, k)*d(1) + G(:, k + 1)*d(2) + G(:, k + 2)*d(3)
         change = max(change, maxval(abs(d)))
      end do
   end subroutine sweep_once

end module microslip_contact_gauss_seidel
