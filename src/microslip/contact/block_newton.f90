!> Semismooth Newton (Alart-Curnier) on the moving points, in gap increments, with a kept factor.
!>
!> Open points carry three unknowns (force = 0), slipping points two (x_n = -gap_old is known), sticking points
!> none. The Jacobian is factorised rarely (`kept_factor`): the residual is evaluated exactly in every step, so a
!> stale factor costs steps, not accuracy. It may cycle, which the caller detects by the residual.
module microslip_contact_block_newton
   use microslip_contact_block, only: contact_block_t
   use microslip_contact_kept_factor, only: kept_factor_t
   use microslip_contact_laws, only: state_open, state_slip
   use microslip_core_kinds, only: wp
   implicit none(type, external)
   private

   public :: solve_newton

   !> A step must bring the residual down to this part, or the factor is renewed.
   real(wp), parameter :: slow = 0.3_wp
   integer, parameter :: patience = 3
   integer, parameter :: max_secants = 10

   !> Steps taken with the same states and factor.
   type :: secants_t
      integer :: count = 0
      !> (3, columns, steps) m, and their squared lengths
      real(wp), allocatable :: step(:, :, :)
      real(wp) :: square(max_secants) = 0.0_wp
   end type secants_t

contains

   !> Newton steps until the residual is below the limit or `max_steps` are used up.
   !>
   !> Start value: the block's increments and trial forces. Exit: residual <= limit (converged), or
   !> steps = max_steps, or a singular matrix.
   subroutine solve_newton(block, kept, limit, max_steps, steps, residual, force_error)
      type(contact_block_t), intent(inout) :: block
      type(kept_factor_t), intent(inout) :: kept
      !> Residual to stop at, N
      real(wp), intent(in) :: limit
      integer, intent(in) :: max_steps
      integer, intent(out) :: steps
      !> Largest violation of the laws, N
      real(wp), intent(out) :: residual
      !> Estimated error of the forces, N: what a further step would change, by the largest ratio of change to
      !> residual of the steps taken
      real(wp), intent(out) :: force_error
      real(wp) :: dx_n(block%columns), dx_t(2, block%columns), violation(3, block%columns), before(3, block%columns)
      integer :: status_before(block%columns)
      type(secants_t) :: secants
      real(wp) :: amplification, previous
      logical :: singular

      amplification = 1.0_wp
      previous = huge(1.0_wp)
      status_before = -1
      do steps = 0, max_steps
         call block%update_states()
         residual = block%residual()
         if (residual <= limit .or. steps == max_steps) exit
         before = block%trial(:, :block%columns)
         call prescribe(block, dx_n, dx_t)
         call kept%linearise(block)
         if (any(status_before /= block%status(:block%columns))) then
            secants%count = 0
            call kept%follow(block, singular)
         else if (residual > slow*previous .and. steps > patience) then
            secants%count = 0
            call kept%rebuild(block, singular)
         else
            singular = .false.
         end if
         if (singular) exit
         call violations(block, violation)
         call kept%solve(violation, dx_n, dx_t)
         call correct_by_secants(secants, dx_n, dx_t)
         block%x_n(:block%columns) = block%x_n(:block%columns) + dx_n
         block%x_t(:, :block%columns) = block%x_t(:, :block%columns) + dx_t
         call block%apply(dx_n, dx_t)
         amplification = max(amplification, maxval(abs(block%trial(:, :block%columns) - before))/residual)
         previous = residual
         status_before = block%status(:block%columns)
      end do
      force_error = amplification*residual
   end subroutine solve_newton

   !> Broyden's correction of a step of the kept factor by the steps taken before it (C. T. Kelley, Iterative methods
   !> for linear and nonlinear equations, 1995, algorithm brsol): a stale factor learns what it misses.
   subroutine correct_by_secants(secants, dx_n, dx_t)
      type(secants_t), intent(inout) :: secants
      !> (columns) and (2, columns) step of the factor in, corrected step out, m
      real(wp), intent(inout) :: dx_n(:), dx_t(:, :)
      real(wp) :: step(3, size(dx_n)), share
      integer :: k

      step(1, :) = dx_n
      step(2:3, :) = dx_t
      do k = 1, secants%count - 1
         step = step + secants%step(:, :, k + 1)*(sum(secants%step(:, :, k)*step)/secants%square(k))
      end do
      k = secants%count
      if (k > 0) then
         share = sum(secants%step(:, :, k)*step)/secants%square(k)
         if (share < 0.5_wp) step = step/(1.0_wp - share)
         if (share >= 0.5_wp .or. k == max_secants) secants%count = 0
      end if
      if (sum(step**2) == 0.0_wp) return
      if (.not. allocated(secants%step)) allocate (secants%step(3, size(dx_n), max_secants))
      secants%count = secants%count + 1
      secants%step(:, :, secants%count) = step
      secants%square(secants%count) = sum(step**2)
      dx_n = step(1, :)
      dx_t = step(2:3, :)
   end subroutine correct_by_secants

   !> What the states prescribe: closed points have no gap, sticking points no slip.
   subroutine prescribe(block, dx_n, dx_t)
      type(contact_block_t), intent(inout) :: block
      !> (columns) and (2, columns) work space
      real(wp), intent(out) :: dx_n(:), dx_t(:, :)
      integer :: a

      dx_n = 0.0_wp
      dx_t = 0.0_wp
      do a = 1, block%columns
         if (block%status(a) == state_open) cycle
         dx_n(a) = -block%gap_old(a) - block%x_n(a)
         if (block%status(a) /= state_slip) dx_t(:, a) = -block%x_t(:, a)
      end do
      if (all(dx_n == 0.0_wp) .and. all(dx_t == 0.0_wp)) return
      block%x_n(:block%columns) = block%x_n(:block%columns) + dx_n
      block%x_t(:, :block%columns) = block%x_t(:, :block%columns) + dx_t
      call block%apply(dx_n, dx_t)
   end subroutine prescribe

   !> What the laws miss in the unknowns of the present states: open force = 0, slipping force_t = mu force_n direction.
   subroutine violations(block, violation)
      type(contact_block_t), intent(in) :: block
      !> (3, columns) N
      real(wp), intent(out) :: violation(:, :)
      real(wp) :: w(2)
      integer :: a

      violation = 0.0_wp
      do a = 1, block%columns
         if (block%status(a) == state_open) then
            violation(:, a) = block%trial(:, a)
         else if (block%status(a) == state_slip) then
            w = block%trial(2:3, a) - block%stiffness_t(a)*block%x_t(:, a)
            violation(2:3, a) = block%trial(2:3, a) &
               & - w*(block%friction(a)*max(0.0_wp, block%trial(1, a))/max(norm2(w), tiny(1.0_wp)))
         end if
      end do
   end subroutine violations

end module microslip_contact_block_newton
