!> Semismooth Newton (Alart-Curnier) on the points off stick, in gap increments.
!>
!> The block of a condensed contact problem:
!>     force = predicted + M x,    gap_n = gap_old + x_n,    slip = x_t
!> with M the inverse contact compliance of the base set restricted to these points (METHOD section 5).
!> Open points carry three unknowns (force = 0), slipping points two (x_n = -gap_old is known), sticking
!> points none. Converges in a few steps to rounding; it may cycle, which the caller detects by the record.
module microslip_contact_block_newton
   use microslip_contact_laws, only: classify, law_residual, state_open, state_stick, state_slip
   use microslip_core_error, only: error_t
   use microslip_core_kinds, only: wp
   use microslip_linalg_dense, only: solve_general
   implicit none(type, external)
   private

   public :: contact_block_t, solve_newton, block_residual

   !> A condensed contact problem over the points off stick.
   type :: contact_block_t
      integer :: n = 0
      !> (3 n, 3 n) N/m, symmetric positive definite
      real(wp), allocatable :: M(:, :)
      !> (3 n) N, forces if no gap changed
      real(wp), allocatable :: predicted(:)
      !> (n) normal gap before the step, m
      real(wp), allocatable :: gap_old(:)
      !> (n)
      real(wp), allocatable :: friction(:)
      !> (n) no force here whatever the gap (velocity level)
      logical, allocatable :: forced_open(:)
      !> (3 n) solution: gap increments, m
      real(wp), allocatable :: x(:)
      !> (3 n) solution: forces, N
      real(wp), allocatable :: force(:)
      !> (n) solution: contact states
      integer, allocatable :: status(:)
   end type contact_block_t

contains

   !> States of all points of the block from its forces and increments.
   pure subroutine update_states(block)
      type(contact_block_t), intent(inout) :: block
      integer :: j, k

      do j = 1, block%n
         k = 3*j - 2
         if (block%forced_open(j)) then
            block%status(j) = state_open
         else
            block%status(j) = classify(block%force(k:k + 2), block%gap_old(j) + block%x(k), block%x(k + 1:k + 2), &
               & block%M(k, k), tangential_stiffness(block, k), block%friction(j))
         end if
      end do
   end subroutine update_states

   !> The one augmentation of both tangential components of the point whose first unknown is k, N/m.
   pure real(wp) function tangential_stiffness(block, k)
      type(contact_block_t), intent(in) :: block
      integer, intent(in) :: k
      tangential_stiffness = min(block%M(k + 1, k + 1), block%M(k + 2, k + 2))
   end function tangential_stiffness

   !> Largest violation of the contact laws in the block, N.
   pure real(wp) function block_residual(block)
      type(contact_block_t), intent(in) :: block
      integer :: j, k

      block_residual = 0.0_wp
      do j = 1, block%n
         k = 3*j - 2
         if (block%forced_open(j)) then
            block_residual = max(block_residual, maxval(abs(block%force(k:k + 2))))
         else
            block_residual = max(block_residual, law_residual(block%force(k:k + 2), block%gap_old(j) + block%x(k), &
               & block%x(k + 1:k + 2), block%M(k, k), tangential_stiffness(block, k), block%friction(j)))
         end if
      end do
   end function block_residual

   !> Newton steps until the residual is below the limit or `max_steps` are used up.
   !>
   !> Start value: block%x. Exit: residual <= limit (converged), or steps = max_steps, or a singular matrix.
   subroutine solve_newton(block, limit, max_steps, steps, residual, force_error)
      type(contact_block_t), intent(inout) :: block
      !> Residual to stop at, N
      real(wp), intent(in) :: limit
      integer, intent(in) :: max_steps
      integer, intent(out) :: steps
      !> Largest violation of the laws, N
      real(wp), intent(out) :: residual
      !> Estimated error of the forces, N: what a further step would change, by the largest ratio of change to
      !> residual of the steps taken
      real(wp), intent(out) :: force_error
      real(wp), allocatable :: dx(:), change(:)
      real(wp) :: amplification
      logical :: singular

      amplification = 1.0_wp
      block%force = block%predicted + matmul(block%M, block%x)
      do steps = 0, max_steps
         call update_states(block)
         residual = block_residual(block)
         if (residual <= limit .or. steps == max_steps) exit
         call newton_step(block, dx, singular)
         if (singular) exit
         block%x = block%x + dx
         change = matmul(block%M, dx)
         amplification = max(amplification, maxval(abs(change))/residual)
         block%force = block%predicted + matmul(block%M, block%x)
      end do
      force_error = amplification*residual
   end subroutine solve_newton

   !> One step: the increments that satisfy the laws linearised in the current states.
   subroutine newton_step(block, dx, singular)
      type(contact_block_t), intent(in) :: block
      real(wp), allocatable, intent(out) :: dx(:)
      logical, intent(out) :: singular
      type(error_t), allocatable :: error
      integer, allocatable :: unknown(:)
      real(wp), allocatable :: matrix(:, :), rhs(:, :), force(:)
      integer :: j, k, row, n

      ! What the states prescribe: closed points have no gap, sticking points no slip.
      allocate (dx(3*block%n), source=0.0_wp)
      allocate (unknown(3*block%n))
      n = 0
      do j = 1, block%n
         k = 3*j - 2
         if (block%status(j) == state_open) then
            unknown(n + 1:n + 3) = [k, k + 1, k + 2]
            n = n + 3
         else
            dx(k) = -block%gap_old(j) - block%x(k)
            if (block%status(j) == state_stick) then
               dx(k + 1:k + 2) = -block%x(k + 1:k + 2)
            else
               unknown(n + 1:n + 2) = [k + 1, k + 2]
               n = n + 2
            end if
         end if
      end do
      singular = .false.
      if (n == 0) return
      force = block%force + matmul(block%M, dx)

      allocate (matrix(n, n), rhs(n, 1))
      row = 0
      do j = 1, block%n
         k = 3*j - 2
         if (block%status(j) == state_open) then
            matrix(row + 1:row + 3, :) = block%M(k:k + 2, unknown(:n))
            rhs(row + 1:row + 3, 1) = -force(k:k + 2)
            row = row + 3
         else if (block%status(j) == state_slip) then
            call slip_rows(block, j, force(k:k + 2), unknown(:n), matrix(row + 1:row + 2, :), rhs(row + 1:row + 2, 1))
            row = row + 2
         end if
      end do
      call solve_general(matrix, rhs, error)
      singular = allocated(error)
      if (.not. singular) dx(unknown(:n)) = dx(unknown(:n)) + rhs(:, 1)
   end subroutine newton_step

   !> The two rows of a slipping point: force_t = mu force_n w/|w|, w = force_t - stiffness slip, linearised.
   pure subroutine slip_rows(block, j, force, unknown, rows, rhs)
      type(contact_block_t), intent(in) :: block
      !> Point of the block
      integer, intent(in) :: j
      !> (3) forces with the prescribed increments of this step already in, N
      real(wp), intent(in) :: force(3)
      !> Unknowns of the step
      integer, intent(in) :: unknown(:)
      real(wp), intent(out) :: rows(:, :), rhs(:)
      real(wp) :: w(2), direction(2), rim(2, 2), beta, stiffness, limit, length
      integer :: k, c

      k = 3*j - 2
      stiffness = tangential_stiffness(block, k)
      w = block%force(k + 1:k + 2) - stiffness*block%x(k + 1:k + 2)
      length = norm2(w)
      direction = w/length
      limit = block%friction(j)*max(0.0_wp, block%force(k))
      beta = min(1.0_wp, limit/length)
      ! rim = beta (I - direction direction^T)
      rim(1, :) = beta*[1.0_wp - direction(1)**2, -direction(1)*direction(2)]
      rim(2, :) = beta*[-direction(1)*direction(2), 1.0_wp - direction(2)**2]
      do c = 1, size(unknown)
         associate (column => block%M(k:k + 2, unknown(c)))
            rows(:, c) = column(2:3) - matmul(rim, column(2:3)) - block%friction(j)*direction*column(1)
         end associate
         if (unknown(c) == k + 1) rows(:, c) = rows(:, c) + stiffness*rim(:, 1)
         if (unknown(c) == k + 2) rows(:, c) = rows(:, c) + stiffness*rim(:, 2)
      end do
      ! The residual at the current iterate, plus what the prescribed increments change in it.
      rhs = -(block%force(k + 1:k + 2) - limit*direction) &
         & - (force(2:3) - block%force(k + 1:k + 2) - matmul(rim, force(2:3) - block%force(k + 1:k + 2))) &
         & + block%friction(j)*direction*(force(1) - block%force(k))
   end subroutine slip_rows

end module microslip_contact_block_newton
