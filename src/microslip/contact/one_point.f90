!> The contact laws of one point alone, solved exactly in force space.
!>
!>     gap = free + own force,   0 <= gap_n _|_ force_n >= 0,   force_t in the disk of radius mu force_n,
!>     opposite to the slip gap_t on the rim
!>
!> The three states are tried in turn. Where the point slips, gap_n = 0 gives the normal force in terms of the
!> tangential one, and with slip = -kappa force_t one unknown is left:
!>
!>     (S + kappa I) force_t = -b,       |force_t| = mu force_n,       kappa >= 0
!>     S = own_tt - own_tn own_nt/own_nn,   b = free_t - own_tn free_n/own_nn
!>
!> |force_t| - mu force_n is positive at kappa = 0 (else the point sticks) and negative for large kappa, so a
!> bracketed Newton iteration always finds a root. The quartic in kappa behind it: Bonnefon & Daviet, Quartic
!> formulation of Coulomb 3D frictional contact, INRIA RT-0400 (2011).
module microslip_contact_one_point
   use microslip_contact_laws, only: state_open, state_stick, state_slip
   use microslip_core_kinds, only: wp
   implicit none(type, external)
   private

   public :: solve_one_point

   !> Most steps to bracket or polish the root.
   integer, parameter :: max_steps = 200

contains

   !> The force of one point that obeys its laws.
   pure subroutine solve_one_point(own, free, friction, force, status)
      !> (3, 3) compliance of the point, m/N; own_nn > 0 and S positive semidefinite
      real(wp), intent(in) :: own(3, 3)
      !> (3) gap and slip without the point's own force, m
      real(wp), intent(in) :: free(3)
      !> Friction coefficient
      real(wp), intent(in) :: friction
      !> (3) N
      real(wp), intent(out) :: force(3)
      !> Contact state
      integer, intent(out) :: status
      real(wp) :: S(2, 2), b(2), coupling(2), normal

      force = 0.0_wp
      status = state_open
      if (free(1) >= 0.0_wp .or. own(1, 1) <= 0.0_wp) return
      coupling = own(1, 2:3)/own(1, 1)
      normal = -free(1)/own(1, 1)
      S(:, 1) = own(2:3, 2) - own(2:3, 1)*coupling(1)
      S(:, 2) = own(2:3, 3) - own(2:3, 1)*coupling(2)
      b = free(2:3) + own(2:3, 1)*normal

      force(2:3) = shifted_solve(S, b, 0.0_wp)
      force(1) = normal - dot_product(coupling, force(2:3))
      status = state_stick
      if (norm2(force(2:3)) <= friction*force(1)) return
      status = state_slip
      force(2:3) = slip_force(S, b, coupling, normal, friction)
      force(1) = normal - dot_product(coupling, force(2:3))
   end subroutine solve_one_point

   !> Tangential force on the rim of the disk.
   pure function slip_force(S, b, coupling, normal, friction) result(force)
      real(wp), intent(in) :: S(2, 2), b(2), coupling(2), normal, friction
      real(wp) :: force(2)
      real(wp) :: low, high, kappa, excess, slope, derivative(2)
      integer :: step

      force = 0.0_wp
      if (friction <= 0.0_wp) return
      low = 0.0_wp
      high = huge(1.0_wp)
      ! A start that is the root where S is a multiple of I and nothing is coupled.
      kappa = max(norm2(b)/(friction*normal) - 0.5_wp*(S(1, 1) + S(2, 2)), 1.0e-3_wp*abs(S(1, 1) + S(2, 2)))
      do step = 1, max_steps
         force = shifted_solve(S, b, kappa)
         excess = norm2(force) - friction*(normal - dot_product(coupling, force))
         if (excess > 0.0_wp) then
            low = kappa
         else
            high = kappa
         end if
         if (abs(excess) <= epsilon(1.0_wp)*norm2(force) .or. high - low <= epsilon(1.0_wp)*high) exit
         derivative = shifted_solve(S, force, kappa)
         slope = dot_product(force, derivative)/norm2(force) + friction*dot_product(coupling, derivative)
         if (slope < 0.0_wp) kappa = kappa - excess/slope
         if (slope >= 0.0_wp .or. kappa <= low .or. kappa >= high .or. mod(step, 8) == 0) &
            & kappa = merge(0.5_wp*(low + high), 4.0_wp*max(low, tiny(1.0_wp)), high < huge(1.0_wp))
      end do
   end function slip_force

   !> -(S + shift I)^-1 b; huge where the matrix is singular, so that the point cannot stick.
   pure function shifted_solve(S, b, shift) result(x)
      real(wp), intent(in) :: S(2, 2), b(2), shift
      real(wp) :: x(2)
      real(wp) :: p, q, determinant

      p = S(1, 1) + shift
      q = S(2, 2) + shift
      determinant = p*q - S(1, 2)*S(2, 1)
      x = -[q*b(1) - S(1, 2)*b(2), p*b(2) - S(2, 1)*b(1)]
      if (determinant > 16.0_wp*epsilon(1.0_wp)*p*q .and. p > 0.0_wp) then
         x = x/determinant
      else
         x = -sqrt(huge(1.0_wp))*b
      end if
   end function shifted_solve

end module microslip_contact_one_point
