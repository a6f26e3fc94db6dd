!> The FFT product against the dense matrix.
module test_halfspace_convolution
   use microslip_core_kinds, only: wp
   use microslip_halfspace_compliance, only: compliance_t
   use microslip_halfspace_convolution, only: convolution_t, new_convolution
   use microslip_halfspace_grid, only: be_grid_t
   use microslip_halfspace_love_cerruti, only: half_space_pair_t
   use test_halfspace_compliance, only: make_compliance
   use testdrive, only: new_unittest, unittest_type, test_error => error_type, check
   implicit none(type, external)
   private

   public :: collect_halfspace_convolution

   !> Rounding of an FFT of a few thousand cells, relative to the largest displacement.
   real(wp), parameter :: tol = 1.0e-13_wp

contains

   subroutine collect_halfspace_convolution(testsuite)
      type(unittest_type), allocatable, intent(out) :: testsuite(:)

      testsuite = [ &
         & new_unittest('equal-materials', test_equal_materials), &
         & new_unittest('coupled-materials', test_coupled_materials), &
         & new_unittest('single-row', test_single_row), &
         & new_unittest('copies', test_copies) &
         & ]
   end subroutine collect_halfspace_convolution

   subroutine test_equal_materials(error)
      type(test_error), allocatable, intent(out) :: error
      call compare_with_dense(error, 16, 12, 0.2854_wp)
      if (allocated(error)) return
      call compare_with_dense(error, 13, 11, 0.2854_wp)
   end subroutine test_equal_materials

   subroutine test_coupled_materials(error)
      type(test_error), allocatable, intent(out) :: error
      call compare_with_dense(error, 12, 16, 0.05_wp)
      if (allocated(error)) return
      call compare_with_dense(error, 17, 9, 0.49_wp)
   end subroutine test_coupled_materials

   subroutine test_single_row(error)
      type(test_error), allocatable, intent(out) :: error
      call compare_with_dense(error, 19, 2, 0.1_wp)
      if (allocated(error)) return
      call compare_with_dense(error, 1, 24, 0.1_wp)
   end subroutine test_single_row

   !> A copy works on, with its own workspace.
   subroutine test_copies(error)
      type(test_error), allocatable, intent(out) :: error
      type(compliance_t) :: compliance
      type(be_grid_t) :: grid
      type(half_space_pair_t) :: pair
      type(convolution_t) :: original, copy
      real(wp), allocatable :: lambda(:, :), first(:, :), second(:, :)

      call make_compliance(10, 9, 0.1_wp, compliance, grid, pair)
      call new_convolution(original, compliance)
      copy = original
      allocate (lambda(3, grid%point_count()), first(3, grid%point_count()), second(3, grid%point_count()))
      call random_number(lambda)
      call original%apply(lambda, first)
      call copy%apply(lambda, second)
      call original%release()
      call check(error, maxval(abs(first - second)) <= tol*maxval(abs(first)))
   end subroutine test_copies

   !> Random forces on a grid with a hole.
   subroutine compare_with_dense(error, nx, ny, nu_b)
      type(test_error), allocatable, intent(out) :: error
      integer, intent(in) :: nx, ny
      real(wp), intent(in) :: nu_b
      type(compliance_t) :: compliance
      type(be_grid_t) :: grid
      type(half_space_pair_t) :: pair
      type(convolution_t) :: convolution
      real(wp), allocatable :: c(:, :), lambda(:, :), u(:, :), u_n(:), reference(:, :)
      integer :: k, n

      call make_compliance(nx, ny, nu_b, compliance, grid, pair)
      n = grid%point_count()
      allocate (c(3*n, 3*n), lambda(3, n), u(3, n), u_n(n))
      call compliance%gather([(k, k=1, n)], [(k, k=1, n)], c)
      call new_convolution(convolution, compliance)
      do k = 1, 2
         call random_number(lambda)
         lambda(2:3, :) = lambda(2:3, :) - 0.5_wp
         call convolution%apply(lambda, u)
         reference = reshape(matmul(c, reshape(lambda, [3*n])), [3, n])
         call check(error, maxval(abs(u - reference)) <= tol*maxval(abs(reference)))
         if (allocated(error)) exit
         call convolution%apply_normal(lambda, u_n)
         call check(error, maxval(abs(u_n - reference(1, :))) <= tol*maxval(abs(reference)), 'normal part')
         if (allocated(error)) exit
      end do
      call convolution%release()
   end subroutine compare_with_dense

end module test_halfspace_convolution
