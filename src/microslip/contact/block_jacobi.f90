!> The paper's projected Jacobi iteration on the points off stick: on their compliance with the sticking points
!> eliminated, M_block^-1.
module microslip_contact_block_jacobi
   use, intrinsic :: ieee_arithmetic, only: ieee_positive_inf, ieee_value
   use microslip_contact_base_set, only: base_set_t
   use microslip_contact_block, only: contact_block_t
   use microslip_contact_coupled_blocks, only: count_columns
   use microslip_contact_laws, only: state_slip, state_stick
   use microslip_contact_projected_jacobi, only: step_lengths, contraction_gap, iterate_projected_jacobi, states_of_forces
   use microslip_core_error, only: error_t
   use microslip_core_kinds, only: wp
   use microslip_linalg_dense, only: inverse_spd
   implicit none(type, external)
   private

   public :: solve_jacobi

contains

   !> Iterate all blocks together until the estimated error of the forces is small enough.
   subroutine solve_jacobi(blocks, base, tolerance, max_sweeps, sweeps, error_estimate)
      type(contact_block_t), intent(inout) :: blocks(:)
      type(base_set_t), intent(in) :: base
      !> Wanted accuracy, over the largest force
      real(wp), intent(in) :: tolerance
      integer, intent(in) :: max_sweeps
      integer, intent(out) :: sweeps
      !> Likewise; infinite where M is singular
      real(wp), intent(out) :: error_estimate
      type(error_t), allocatable :: error
      real(wp), allocatable :: M(:, :), compliance(:, :), predicted(:, :), c(:), eps(:), force(:), friction(:), x(:, :)
      logical, allocatable :: forced_open(:)
      integer, allocatable :: place(:), status(:)
      logical :: changed
      integer :: a, b, g, n

      place = [integer ::]
      n = count_columns(blocks)
      allocate (M(3*n, 3*n), predicted(3, n), force(3*n), c(3*n), friction(n), forced_open(n))
      b = 0
      do g = 1, size(blocks)
         associate (block => blocks(g))
            do a = 1, block%columns
               b = b + 1
               place = [place, block%place(a)]
               predicted(:, b) = block%predicted(:, a)
               force(3*b - 2:3*b) = block%force(:, a)
               c(3*b - 2:3*b) = [block%gap_old(a), 0.0_wp, 0.0_wp]
               friction(b) = block%friction(a)
               forced_open(b) = block%forced_open(a)
            end do
         end associate
      end do
      do b = 1, n
         do a = 1, n
            M(3*a - 2:3*a, 3*b - 2:3*b) = base%M(3*place(a) - 2:3*place(a), 3*place(b) - 2:3*place(b))
         end do
         ! Without friction the tangential springs are not in M: any of their own keep it regular, under no force.
         if (friction(b) > 0.0_wp) cycle
         M(3*b - 1, 3*b - 1) = M(3*b - 2, 3*b - 2)
         M(3*b, 3*b) = M(3*b - 2, 3*b - 2)
      end do
      compliance = M
      call inverse_spd(compliance, error)
      sweeps = 0
      error_estimate = ieee_value(1.0_wp, ieee_positive_inf)
      if (allocated(error)) return
      c = c - matmul(compliance, reshape(predicted, [3*n]))
      eps = step_lengths(compliance)
      call iterate_projected_jacobi(compliance, c, eps, contraction_gap(M, eps), friction, forced_open, &
         & 0.0_wp, tolerance, max_sweeps, force, sweeps, error_estimate)
      status = states_of_forces(reshape(force, [3, n]), friction)
      where (status == state_slip .and. friction <= 0.0_wp) status = state_stick
      x = reshape(matmul(compliance, force - reshape(predicted, [3*n])), [3, n])
      b = 0
      do g = 1, size(blocks)
         associate (block => blocks(g))
            block%x(:, :block%columns) = x(:, b + 1:b + block%columns)
            block%trial(:, :block%columns) = reshape(force(3*b + 1:3*(b + block%columns)), [3, block%columns])
            call block%assess(changed, .false.)
            block%status(:block%columns) = status(b + 1:b + block%columns)
            b = b + block%columns
         end associate
      end do
   end subroutine solve_jacobi

end module microslip_contact_block_jacobi
