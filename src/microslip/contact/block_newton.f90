!> Semismooth Newton (Alart-Curnier) on the moving points, in gap increments, with kept factors.
!>
!> Open points carry three unknowns (force = 0), slipping points two (x_n = -gap_old is known), sticking points
!> none. The Jacobian is factorised rarely, and for every group alone (`kept_factor`): the residual is evaluated
!> exactly, so what the factors miss costs steps, not accuracy. Most steps move the forces by products in single
!> precision; they are computed anew in double precision before the last ones. The iteration may cycle, which the
!> caller detects by the residual.
module microslip_contact_block_newton
   use microslip_contact_block, only: contact_block_t
   use microslip_contact_coupled_blocks, only: apply_changes, assess_all, count_columns, evaluate_columns
   use microslip_contact_kept_factor, only: kept_factor_t
   use microslip_contact_laws, only: state_open, state_slip
   use microslip_core_kinds, only: wp
   implicit none(type, external)
   private

   public :: solve_newton

   !> A step that leaves more than this part of the residual is slow; after so many the factors are renewed.
   real(wp), parameter :: slow = 0.3_wp
   integer, parameter :: patience = 3
   integer, parameter :: max_secants = 10
   !> N: an iteration that is here has diverged; further on its squares overflow.
   real(wp), parameter :: no_force = 1.0e100_wp
   !> Below this part of the largest force the residual is from forces in double precision, but for changes smaller than
   !> the second part.
   real(wp), parameter :: exact_below = 1.0e-6_wp, small_change = 1.0e-5_wp

   !> Steps taken with the same states and factors.
   type :: secants_t
      integer :: count = 0
      !> (3, columns of all groups, steps) m, and their squared lengths
      real(wp), allocatable :: step(:, :, :)
      real(wp) :: square(max_secants) = 0.0_wp
   end type secants_t

contains

   !> Newton steps until the residual is below the limit or `max_steps` are used up.
   !>
   !> Start value: the blocks' increments. Exit: residual <= limit (converged; the trial forces of the columns are
   !> exact), or steps = max_steps, or a singular matrix, or divergence.
   subroutine solve_newton(blocks, kept, coupling, scale, limit, max_steps, steps, residual, force_error)
      type(contact_block_t), intent(inout) :: blocks(:)
      !> (groups)
      type(kept_factor_t), intent(inout) :: kept(:)
      !> C of the base set, N/m
      real(wp), intent(in) :: coupling(:, :)
      !> Largest contact force and residual to stop at, N
      real(wp), intent(in) :: scale, limit
      integer, intent(in) :: max_steps
      integer, intent(out) :: steps
      !> Largest violation of the laws, N
      real(wp), intent(out) :: residual
      !> Estimated error of the forces, N: what a further step would change, by the largest ratio of change to
      !> residual of the steps taken
      real(wp), intent(out) :: force_error
      type(secants_t) :: secants
      real(wp) :: amplification, previous, change
      logical :: singular, exact, new_states, renew, some
      integer :: g, last_renewal

      call start_single(blocks, coupling)
      exact = .false.
      amplification = 1.0_wp
      previous = huge(1.0_wp)
      singular = .false.
      last_renewal = 0
      do steps = 0, max_steps
         new_states = steps == 0
         call assess_all(blocks, new_states, .false., residual)
         if (.not. exact .and. (residual <= max(limit, exact_below*scale) .or. steps == max_steps)) then
            call evaluate_columns(blocks, coupling)
            exact = .true.
            call assess_all(blocks, new_states, .false., residual)
         end if
         if (residual <= limit .or. steps == max_steps .or. residual > no_force) exit
         ! New factors cure what is stale in them, not what groups cause in one another: that is for the secants.
         renew = residual > slow*previous .and. steps > last_renewal + patience
         if (renew) last_renewal = steps + 2*patience
         if (new_states .or. renew) then
            secants%count = 0
            call prescribe(blocks, coupling, some)
            if (some) exact = exact .and. largest_change(blocks) <= small_change*scale
            call fit_factors(blocks, kept, renew, singular)
            if (singular) exit
         end if
         do g = 1, size(blocks)
            call kept(g)%solve(blocks(g)%columns, blocks(g)%violation, blocks(g)%dx)
         end do
         call correct_by_secants(secants, blocks)
         call apply_changes(blocks, coupling)
         change = largest_change(blocks)
         exact = exact .and. change <= small_change*scale
         amplification = max(amplification, change/residual)
         previous = residual
      end do
      force_error = amplification*residual
   end subroutine solve_newton

   !> Factors for the states of all blocks, linearised at their trial forces.
   subroutine fit_factors(blocks, kept, renew, singular)
      type(contact_block_t), intent(in) :: blocks(:)
      type(kept_factor_t), intent(inout) :: kept(:)
      !> Anew, although what is kept could be bordered
      logical, intent(in) :: renew
      logical, intent(out) :: singular
      integer :: g

      do g = 1, size(blocks)
         call kept(g)%linearise(blocks(g))
         if (renew) call kept(g)%drop()
         call kept(g)%follow(blocks(g), singular)
         if (singular) return
      end do
   end subroutine fit_factors

   !> Largest change of a force by the last `apply_changes`, N.
   pure real(wp) function largest_change(blocks)
      type(contact_block_t), intent(in) :: blocks(:)
      integer :: g

      largest_change = 0.0_wp
      do g = 1, size(blocks)
         largest_change = max(largest_change, blocks(g)%last_change)
      end do
   end function largest_change

   !> Trial forces of the start values in single precision.
   subroutine start_single(blocks, coupling)
      type(contact_block_t), intent(inout) :: blocks(:)
      real(wp), intent(in) :: coupling(:, :)
      integer :: g, n

      do g = 1, size(blocks)
         n = blocks(g)%columns
         blocks(g)%dx(:, :n) = blocks(g)%x(:, :n)
         blocks(g)%x(:, :n) = 0.0_wp
         blocks(g)%trial(:, :n) = blocks(g)%predicted(:, :n)
      end do
      call apply_changes(blocks, coupling)
   end subroutine start_single

   !> Broyden's correction of a step of the kept factors by the steps taken before it (C. T. Kelley, Iterative methods
   !> for linear and nonlinear equations, 1995, algorithm brsol): stale factors learn what they miss.
   subroutine correct_by_secants(secants, blocks)
      type(secants_t), intent(inout) :: secants
      !> Their changes: step of the factors in, corrected step out
      type(contact_block_t), intent(inout) :: blocks(:)
      real(wp) :: step(3, count_columns(blocks)), share
      integer :: k, g, first, n

      first = 0
      do g = 1, size(blocks)
         n = blocks(g)%columns
         step(:, first + 1:first + n) = blocks(g)%dx(:, :n)
         first = first + n
      end do
      do k = 1, secants%count - 1
         step = step + secants%step(:, :, k + 1)*(sum(secants%step(:, :, k)*step)/secants%square(k))
      end do
      k = secants%count
      if (k > 0) then
         share = sum(secants%step(:, :, k)*step)/secants%square(k)
         if (share < 0.9_wp) step = step/(1.0_wp - share)
         if (share >= 0.9_wp .or. k == max_secants) secants%count = 0
      end if
      if (sum(step**2) == 0.0_wp) return
      if (.not. allocated(secants%step)) allocate (secants%step(3, size(step, 2), max_secants))
      secants%count = secants%count + 1
      secants%step(:, :, secants%count) = step
      secants%square(secants%count) = sum(step**2)
      first = 0
      do g = 1, size(blocks)
         n = blocks(g)%columns
         blocks(g)%dx(:, :n) = step(:, first + 1:first + n)
         first = first + n
      end do
   end subroutine correct_by_secants

   !> Apply the changes that the states prescribe: closed points have no gap, sticking points no slip.
   subroutine prescribe(blocks, coupling, some)
      type(contact_block_t), intent(inout) :: blocks(:)
      real(wp), intent(in) :: coupling(:, :)
      !> Whether there were any
      logical, intent(out) :: some
      real(wp) :: residual
      logical :: changed
      integer :: a, g

      some = .false.
      do g = 1, size(blocks)
         associate (block => blocks(g))
            block%dx(:, :block%columns) = 0.0_wp
            do a = 1, block%columns
               if (block%status(a) == state_open) cycle
               block%dx(1, a) = -block%gap_old(a) - block%x(1, a)
               if (block%status(a) /= state_slip) block%dx(2:3, a) = -block%x(2:3, a)
            end do
            some = some .or. any(block%dx(:, :block%columns) /= 0.0_wp)
         end associate
      end do
      if (.not. some) return
      call apply_changes(blocks, coupling)
      changed = .false.
      call assess_all(blocks, changed, .true., residual)
   end subroutine prescribe

end module microslip_contact_block_newton
