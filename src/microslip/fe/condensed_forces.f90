!> Forces on the FE rows condensed to the boundary: f_b - K_br K_rr^-1 f_r, in relative coordinates, N.
module microslip_fe_condensed_forces
   use microslip_core_kinds, only: wp
   use microslip_linalg_mumps, only: symmetric_factor_t
   use microslip_linalg_sparse, only: symmetric_sparse_t
   use microslip_linalg_sparse_algebra, only: multiply_many
   implicit none(type, external)
   private

   public :: condensed_forces

contains

   !> f~_b - K~_br K~_rr^-1 f~_r.
   function condensed_forces(stiffness, factor, boundary, forces) result(condensed)
      !> K~
      type(symmetric_sparse_t), intent(in) :: stiffness
      !> Of K~_rr
      type(symmetric_factor_t), intent(inout) :: factor
      !> (n_b) boundary rows
      integer, intent(in) :: boundary(:)
      !> (rows, patterns)
      real(wp), intent(in), contiguous :: forces(:, :)
      !> (n_b, patterns)
      real(wp), allocatable :: condensed(:, :)
      real(wp), allocatable :: x(:, :), reaction(:, :)

      x = forces
      call factor%solve(x)
      allocate (reaction, mold=x)
      call multiply_many(stiffness, x, reaction)
      condensed = forces(boundary, :) - reaction(boundary, :)
   end function condensed_forces

end module microslip_fe_condensed_forces
