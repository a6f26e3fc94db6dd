!> One step of a contact problem in the contact forces: what the solvers that iterate on forces share.
!>
!>     gap = c + G force,    c = r_0 + R q - (0, gap_t before the step)
!>
!> with the normal part of `gap` the gap and its tangential part the slip of this step. On velocity level the
!> normal part is the change of the gap, and points that were open with a positive gap carry no force.
module microslip_contact_force_step
   use microslip_contact_laws, only: classify, law_residual, smallest_force, state_open
   use microslip_contact_problem, only: contact_problem_t, contact_state_t, solve_record_t, book_step
   use microslip_core_error, only: error_t, failure
   use microslip_core_kinds, only: wp
   use microslip_core_text, only: to_text
   implicit none(type, external)
   private

   public :: force_step_t, begin_step, end_step, update_gap, step_residual, force_scale, step_states, point_stiffness

   !> Largest force over what closes the largest gap at one point alone.
   real(wp), parameter :: runaway = 1.0e3_wp

   !> The step and its unknowns.
   type :: force_step_t
      !> (3 points) gap and slip without contact forces, m
      real(wp), allocatable :: c(:)
      !> (points)
      real(wp), allocatable :: friction(:)
      !> (points) no force here whatever the gap (velocity level)
      logical, allocatable :: forced_open(:)
      !> (3 points) N
      real(wp), allocatable :: force(:)
      !> (3 points) gap and slip of `force`, m
      real(wp), allocatable :: gap(:)
   end type force_step_t

contains

   !> The step from a state to the driver q; the forces start at those of the state.
   pure function begin_step(problem, q, state) result(step)
      type(contact_problem_t), intent(in) :: problem
      !> (drivers)
      real(wp), intent(in) :: q(:)
      type(contact_state_t), intent(in) :: state
      type(force_step_t) :: step
      integer :: p, k

      step%c = problem%r_0 + matmul(problem%R, q)
      step%friction = problem%friction
      step%force = reshape(state%force, [3*problem%n_points])
      step%gap = step%c
      allocate (step%forced_open(problem%n_points), source=.false.)
      do p = 1, problem%n_points
         k = 3*p - 2
         step%c(k + 1:k + 2) = step%c(k + 1:k + 2) - state%gap(2:3, p)
         if (.not. problem%velocity_level) cycle
         ! Closed set by prediction (paper, before eq. (7)): open stays open while its gap is positive.
         step%forced_open(p) = state%force(1, p) <= 0.0_wp .and. state%gap(1, p) > 0.0_wp
         step%c(k) = step%c(k) - state%gap(1, p)
      end do
   end function begin_step

   !> The solved step becomes the state, and is booked in the record.
   subroutine end_step(problem, q, step, status, state, record)
      type(contact_problem_t), intent(in) :: problem
      !> (drivers)
      real(wp), intent(in) :: q(:)
      type(force_step_t), intent(in) :: step
      !> (points) contact states
      integer, intent(in) :: status(:)
      type(contact_state_t), intent(inout) :: state
      type(solve_record_t), intent(inout) :: record
      type(contact_state_t) :: before
      real(wp) :: gap(3)
      integer :: p

      before = state
      state%q = q
      state%status = status
      state%force = reshape(step%force, [3, problem%n_points])
      do p = 1, problem%n_points
         gap = step%gap(3*p - 2:3*p)
         state%gap(2:3, p) = state%gap(2:3, p) + gap(2:3)
         state%gap(1, p) = gap(1) + merge(state%gap(1, p), 0.0_wp, problem%velocity_level)
      end do
      call book_step(problem, before, state, record)
   end subroutine end_step

   !> gap = c + G force.
   pure subroutine update_gap(G, step)
      !> (3 points, 3 points) m/N, need not be symmetric to the last digit
      real(wp), intent(in), contiguous :: G(:, :)
      type(force_step_t), intent(inout) :: step
      integer :: k

      step%gap = step%c
      do k = 1, size(step%force)
         if (step%force(k) /= 0.0_wp) step%gap = step%gap + G(:, k)*step%force(k)
      end do
   end subroutine update_gap

   !> Largest violation of the contact laws, N.
   pure real(wp) function step_residual(step, stiffness)
      type(force_step_t), intent(in) :: step
      !> (points) augmentation, N/m
      real(wp), intent(in) :: stiffness(:)
      integer :: p, k

      step_residual = 0.0_wp
      do p = 1, size(step%friction)
         k = 3*p - 2
         if (step%forced_open(p)) then
            step_residual = max(step_residual, maxval(abs(step%force(k:k + 2))))
         else
            step_residual = max(step_residual, law_residual(step%force(k:k + 2), step%gap(k), step%gap(k + 1:k + 2), &
               & stiffness(p), stiffness(p), step%friction(p)))
         end if
      end do
   end function step_residual

   !> Force that residuals are measured against, N: the largest one, but no more than `runaway` allows. Where the laws
   !> contradict each other, forces grow without bound, and any violation would be small against them.
   pure real(wp) function force_scale(step, stiffness)
      type(force_step_t), intent(in) :: step
      !> (points) augmentation, N/m
      real(wp), intent(in) :: stiffness(:)
      integer :: p

      force_scale = 0.0_wp
      do p = 1, size(stiffness)
         force_scale = max(force_scale, stiffness(p)*norm2(step%c(3*p - 2:3*p)))
      end do
      force_scale = max(min(maxval(step%force), runaway*force_scale), smallest_force)
   end function force_scale

   !> Contact states that forces and gaps select, (points).
   pure function step_states(step, stiffness) result(status)
      type(force_step_t), intent(in) :: step
      !> (points) augmentation, N/m
      real(wp), intent(in) :: stiffness(:)
      integer :: status(size(step%friction))
      integer :: p, k

      status = state_open
      do p = 1, size(status)
         k = 3*p - 2
         if (.not. step%forced_open(p)) status(p) = classify(step%force(k:k + 2), step%gap(k), step%gap(k + 1:k + 2), &
            & stiffness(p), stiffness(p), step%friction(p))
      end do
   end function step_states

   !> Augmentation of every point, N/m: the inverse of its mean own compliance.
   subroutine point_stiffness(problem, state, stiffness, error)
      type(contact_problem_t), intent(in) :: problem
      type(contact_state_t), intent(in) :: state
      !> (points) N/m
      real(wp), allocatable, intent(out) :: stiffness(:)
      !> Where the state is another problem's, there is no matrix, or a point without compliance
      type(error_t), allocatable, intent(out) :: error
      real(wp) :: trace
      integer :: p, c

      if (size(state%status) /= problem%n_points) then
         call failure(error, 'contact state of '//to_text(size(state%status))//' points for a problem of '// &
            & to_text(problem%n_points))
         return
      end if
      if (.not. allocated(problem%G)) then
         call failure(error, 'this contact solver needs the compliance G as a matrix')
         return
      end if
      allocate (stiffness(problem%n_points))
      do p = 1, problem%n_points
         trace = sum([(problem%G(3*p - c, 3*p - c), c=0, 2)])
         if (.not. (trace > 0.0_wp .and. problem%G(3*p - 2, 3*p - 2) > 0.0_wp)) then
            call failure(error, 'contact compliance G of point '//to_text(p)//' is not positive')
            return
         end if
         stiffness(p) = 3.0_wp/trace
      end do
   end subroutine point_stiffness

end module microslip_contact_force_step
