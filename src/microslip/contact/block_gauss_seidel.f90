!> Block Gauss-Seidel on the points off stick, in gap increments: the rescue where Newton cycles.
!>
!> Point after point, the three increments of a point are set so that its own laws hold with all others
!> fixed. Slower than Newton and far more robust; used to give Newton a better start.
module microslip_contact_block_gauss_seidel
   use microslip_contact_block, only: contact_block_t
   use microslip_contact_coupled_blocks, only: assess_all, evaluate_columns
   use microslip_contact_laws, only: state_open, state_stick, state_slip
   use microslip_core_kinds, only: wp
   implicit none(type, external)
   private

   public :: sweep_gauss_seidel, solve_point

contains

   !> Sweep over all points until the residual is below the limit.
   subroutine sweep_gauss_seidel(blocks, coupling, limit, max_sweeps, sweeps, residual)
      type(contact_block_t), intent(inout) :: blocks(:)
      !> C of the base set, N/m
      real(wp), intent(in) :: coupling(:, :)
      !> Residual to stop at, N
      real(wp), intent(in) :: limit
      integer, intent(in) :: max_sweeps
      integer, intent(out) :: sweeps
      !> Largest violation of the laws, N
      real(wp), intent(out) :: residual
      logical :: changed
      integer :: g

      call evaluate_columns(blocks, coupling)
      do sweeps = 1, max_sweeps
         do g = 1, size(blocks)
            call sweep_block(blocks(g))
         end do
         call evaluate_columns(blocks, coupling)
         call assess_all(blocks, changed, .false., residual)
         if (residual <= limit) exit
      end do
      sweeps = min(sweeps, max_sweeps)
   end subroutine sweep_gauss_seidel

   !> One sweep over a block, with what other groups cause held.
   subroutine sweep_block(block)
      type(contact_block_t), intent(inout) :: block
      real(wp) :: own(3, 3), others(3), x(3), old(3), dx(3)
      integer :: a, p

      do a = 1, block%columns
         own(:, 1) = block%M_n(3*a - 2:3*a, a)
         own(:, 2:3) = block%M_t(3*a - 2:3*a, 2*a - 1:2*a)
         old = block%x(:, a)
         others = block%trial(:, a) - matmul(own, old)
         call solve_point(own, others, block%gap_old(a), block%friction(a), block%forced_open(a), x, block%status(a))
         dx = x - old
         block%x(:, a) = x
         do p = 1, block%columns
            block%trial(:, p) = block%trial(:, p) + block%M_n(3*p - 2:3*p, a)*dx(1) &
               & + block%M_t(3*p - 2:3*p, 2*a - 1)*dx(2) + block%M_t(3*p - 2:3*p, 2*a)*dx(3)
         end do
      end do
   end subroutine sweep_block

   !> One point alone: force = others + own x obeying the contact laws.
   pure subroutine solve_point(own, others, gap_old, friction, forced_open, x, status)
      !> (3, 3) N/m, symmetric positive definite; without friction the normal part alone, the rest zero
      real(wp), intent(in) :: own(3, 3)
      !> (3) force at x = 0, N
      real(wp), intent(in) :: others(3)
      !> Normal gap before the step, m
      real(wp), intent(in) :: gap_old
      real(wp), intent(in) :: friction
      logical, intent(in) :: forced_open
      !> (3) increments: gap and slip, m
      real(wp), intent(out) :: x(3)
      integer, intent(out) :: status
      real(wp) :: a(2), normal, radius, settled
      integer :: k

      if (friction > 0.0_wp) then
         x = -solve_3(own, others)
      else
         x = [-others(1)/own(1, 1), 0.0_wp, 0.0_wp]
      end if
      status = state_open
      if (forced_open .or. gap_old + x(1) > 0.0_wp) return

      x = [-gap_old, 0.0_wp, 0.0_wp]
      a = others(2:3) + own(2:3, 1)*x(1)
      normal = others(1) + own(1, 1)*x(1)
      status = state_stick
      if (norm2(a) <= friction*normal) return
      status = state_slip
      ! The slip changes the normal force through own(1, 2:3): a few substitutions settle the radius.
      settled = -1.0_wp
      do k = 1, 20
         radius = friction*max(0.0_wp, normal + dot_product(own(1, 2:3), x(2:3)))
         if (abs(radius - settled) <= 2.0_wp*epsilon(1.0_wp)*radius) exit
         settled = radius
         x(2:3) = slip_for_radius(own(2:3, 2:3), a, radius)
      end do
   end subroutine solve_point

   !> Slip x with |a + K x| = radius and a + K x opposite to x: (K + kappa I) x = -a, kappa |x| = radius.
   pure function slip_for_radius(K, a, radius) result(x)
      real(wp), intent(in) :: K(2, 2), a(2), radius
      real(wp) :: x(2)
      real(wp) :: low, high, kappa, trace
      integer :: step

      x = shifted_solve(0.0_wp)
      if (radius <= 0.0_wp .or. norm2(a) <= radius) return
      trace = K(1, 1) + K(2, 2)
      low = 0.0_wp
      high = trace*radius/(norm2(a) - radius)
      ! kappa |x(kappa)| grows with kappa: bisection to full precision.
      do step = 1, 80
         kappa = 0.5_wp*(low + high)
         x = shifted_solve(kappa)
         if (kappa*norm2(x) > radius) then
            high = kappa
         else
            low = kappa
         end if
         if (high - low <= 2.0_wp*epsilon(1.0_wp)*high) exit
      end do

   contains

      pure function shifted_solve(shift) result(y)
         real(wp), intent(in) :: shift
         real(wp) :: y(2)
         real(wp) :: p, q, determinant
         p = K(1, 1) + shift
         q = K(2, 2) + shift
         determinant = p*q - K(1, 2)*K(2, 1)
         y = -[q*a(1) - K(1, 2)*a(2), p*a(2) - K(2, 1)*a(1)]/determinant
      end function shifted_solve

   end function slip_for_radius

   !> Solution of a symmetric positive definite 3 x 3 system.
   pure function solve_3(A, b) result(x)
      real(wp), intent(in) :: A(3, 3), b(3)
      real(wp) :: x(3)
      real(wp) :: l(3, 3), y(3)
      integer :: i, j

      l = 0.0_wp
      do j = 1, 3
         l(j, j) = sqrt(A(j, j) - sum(l(j, :j - 1)**2))
         do i = j + 1, 3
            l(i, j) = (A(i, j) - sum(l(i, :j - 1)*l(j, :j - 1)))/l(j, j)
         end do
      end do
      do i = 1, 3
         y(i) = (b(i) - sum(l(i, :i - 1)*y(:i - 1)))/l(i, i)
      end do
      do i = 3, 1, -1
         x(i) = (y(i) - sum(l(i + 1:, i)*x(i + 1:)))/l(i, i)
      end do
   end function solve_3

end module microslip_contact_block_gauss_seidel
