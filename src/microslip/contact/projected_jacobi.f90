!> The paper's contact iteration: projected Jacobi on the augmented Lagrangian.
!>
!>     force <- proj_C( force - eps (G force + c) ),   normal part first, then the disk of the new normal force
!>
!> eps per row after Studer (2009), eqs. (4.59)-(4.60): 1/G_kk where 2|G_kk| >= sum_l |G_kl| for all rows,
!> else 1/sum_l |G_kl|; the smaller of the two for both tangential rows of a point (METHOD section 4).
!>
!> The change between two sweeps is no bound on the error: in the metric of eps the iteration contracts by
!> 1 - gamma, gamma the smallest eigenvalue of eps^(1/2) G eps^(1/2), so error <= change / gamma. The iteration
!> stops on that bound.
module microslip_contact_projected_jacobi
   use microslip_contact_laws, only: project_on_disk, smallest_force, state_open, state_stick, state_slip
   use microslip_core_kinds, only: wp
   use microslip_linalg_dense, only: product_symmetric
   implicit none(type, external)
   private

   public :: step_lengths, contraction_gap, iterate_projected_jacobi, states_of_forces

contains

   !> eps of every row, N/m.
   pure function step_lengths(G) result(eps)
      !> (3 points, 3 points) m/N
      real(wp), intent(in) :: G(:, :)
      real(wp), allocatable :: eps(:)
      real(wp), allocatable :: row_sum(:)
      integer :: k
      logical :: dominant

      allocate (eps(size(G, 1)), row_sum(size(G, 1)))
      dominant = .true.
      do k = 1, size(G, 2)
         row_sum(k) = sum(abs(G(:, k)))
         eps(k) = 1.0_wp/G(k, k)
         dominant = dominant .and. 2.0_wp*abs(G(k, k)) >= row_sum(k)
      end do
      if (.not. dominant) eps = 1.0_wp/row_sum
      do k = 1, size(G, 1), 3
         eps(k + 1:k + 2) = minval(eps(k + 1:k + 2))
      end do
   end function step_lengths

   !> Smallest eigenvalue of eps^(1/2) G eps^(1/2), from the inverse of G by power iteration.
   !> The iteration approaches it from above and is stopped at 2 digits; one tenth is taken off.
   function contraction_gap(G_inverse, eps) result(gamma)
      !> (3 points, 3 points) N/m
      real(wp), intent(in), contiguous :: G_inverse(:, :)
      !> (3 points) N/m
      real(wp), intent(in) :: eps(:)
      real(wp) :: gamma
      real(wp), allocatable :: x(:), y(:), root(:)
      real(wp) :: largest, previous
      integer :: k

      allocate (x(size(eps)), y(size(eps)))
      root = sqrt(eps)
      do k = 1, size(x)
         x(k) = 1.0_wp + 0.5_wp*sin(real(k, wp))
      end do
      largest = 0.0_wp
      do k = 1, 200
         x = x/norm2(x)
         call product_symmetric(G_inverse, x/root, y)
         y = y/root
         previous = largest
         largest = norm2(y)
         x = y
         if (abs(largest - previous) <= 1.0e-3_wp*largest) exit
      end do
      gamma = 0.9_wp/largest
   end function contraction_gap

   !> Iterate until the error bound is below the tolerance.
   !>
   !> The problem: gap = G force + c with the normal part of `gap` the gap and the tangential part the slip
   !> of this step; 0 <= gap_n _|_ force_n >= 0 and Coulomb friction.
   subroutine iterate_projected_jacobi(G, c, eps, gamma, friction, forced_open, force_scale, tolerance, &
         & max_iterations, force, iterations, error_bound)
      !> (3 points, 3 points) m/N
      real(wp), intent(in), contiguous :: G(:, :)
      !> (3 points) m
      real(wp), intent(in), contiguous :: c(:)
      !> (3 points) N/m
      real(wp), intent(in) :: eps(:)
      !> Contraction gap
      real(wp), intent(in) :: gamma
      !> (points)
      real(wp), intent(in) :: friction(:)
      !> (points) no force here whatever the gap (velocity level)
      logical, intent(in) :: forced_open(:)
      !> Force that the error is measured against where the iterate has none larger, N
      real(wp), intent(in) :: force_scale
      !> Wanted error of the force over the largest force
      real(wp), intent(in) :: tolerance
      integer, intent(in) :: max_iterations
      !> (3 points) N: start value in, solution out
      real(wp), intent(inout), contiguous :: force(:)
      integer, intent(out) :: iterations
      !> Bound on the error of the force over the largest force
      real(wp), intent(out) :: error_bound
      real(wp), allocatable :: gap(:)
      real(wp) :: new(3), change, largest
      integer :: k, p

      allocate (gap(size(force)))
      error_bound = huge(1.0_wp)
      do iterations = 1, max_iterations
         call product_symmetric(G, force, gap)
         change = 0.0_wp
         largest = force_scale
         do p = 1, size(friction)
            k = 3*p - 2
            new = force(k:k + 2) - eps(k:k + 2)*(gap(k:k + 2) + c(k:k + 2))
            new(1) = max(0.0_wp, new(1))
            if (forced_open(p)) new(1) = 0.0_wp
            new(2:3) = project_on_disk(new(2:3), friction(p)*new(1))
            change = max(change, maxval(abs(new - force(k:k + 2))))
            largest = max(largest, new(1))
            force(k:k + 2) = new
         end do
         error_bound = change/(gamma*max(largest, smallest_force))
         if (error_bound <= tolerance .or. change == 0.0_wp) exit
      end do
      iterations = min(iterations, max_iterations)
   end subroutine iterate_projected_jacobi

   !> Contact states that forces on or inside their cones stand for, (points).
   pure function states_of_forces(force, friction) result(status)
      !> (3, points) N
      real(wp), intent(in) :: force(:, :)
      !> (points)
      real(wp), intent(in) :: friction(:)
      integer, allocatable :: status(:)
      integer :: p

      allocate (status(size(friction)))
      do p = 1, size(friction)
         if (force(1, p) <= 0.0_wp) then
            status(p) = state_open
         else if (norm2(force(2:3, p)) < friction(p)*force(1, p)*(1.0_wp - 4.0_wp*epsilon(1.0_wp))) then
            status(p) = state_stick
         else
            status(p) = state_slip
         end if
      end do
   end function states_of_forces

end module microslip_contact_projected_jacobi
