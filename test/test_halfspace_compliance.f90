!> The compliance matrix by table: blocks, symmetry, definiteness, subsets.
module test_halfspace_compliance
   use microslip_core_error, only: error_t
   use microslip_core_kinds, only: wp
   use microslip_halfspace_compliance, only: compliance_t, new_compliance
   use microslip_halfspace_grid, only: be_grid_t, new_grid
   use microslip_halfspace_love_cerruti, only: material_t, elastic_material, half_space_pair_t, half_space_pair, influence
   use testdrive, only: new_unittest, unittest_type, test_error => error_type, check
   implicit none(type, external)
   private

   public :: collect_halfspace_compliance, make_compliance

   interface
      subroutine dsyev(jobz, uplo, n, a, lda, w, work, lwork, info)
         import :: wp
         implicit none(type, external)
         character(len=1), intent(in) :: jobz, uplo
         integer, intent(in) :: n, lda, lwork
         real(wp), intent(inout) :: a(lda, *), work(*)
         real(wp), intent(out) :: w(*)
         integer, intent(out) :: info
      end subroutine dsyev
   end interface

contains

   subroutine collect_halfspace_compliance(testsuite)
      type(unittest_type), allocatable, intent(out) :: testsuite(:)

      testsuite = [ &
         & new_unittest('blocks', test_blocks), &
         & new_unittest('equal-materials', test_equal_materials), &
         & new_unittest('positive-definite', test_positive_definite), &
         & new_unittest('subsets', test_subsets) &
         & ]
   end subroutine collect_halfspace_compliance

   !> A grid with a hole and two materials on it.
   subroutine make_compliance(nx, ny, nu_b, compliance, grid, pair)
      integer, intent(in) :: nx, ny
      real(wp), intent(in) :: nu_b
      type(compliance_t), intent(out) :: compliance
      type(be_grid_t), intent(out) :: grid
      type(half_space_pair_t), intent(out) :: pair
      type(material_t) :: a, b
      type(error_t), allocatable :: problem

      call new_grid(grid, [-1.0_wp, -0.8_wp], [1.0_wp, 0.8_wp], nx, ny, problem, holes=reshape([0.1_wp, 0.0_wp, 0.4_wp], [3, 1]))
      if (.not. allocated(problem)) call elastic_material(a, 2.0_wp, 0.2854_wp, problem)
      if (.not. allocated(problem)) call elastic_material(b, 2.0_wp, nu_b, problem)
      if (allocated(problem)) error stop 'test set-up refused'
      pair = half_space_pair(a, b)
      call new_compliance(compliance, pair, grid)
   end subroutine make_compliance

   !> All pairs of points, dense.
   function dense(compliance) result(c)
      type(compliance_t), intent(in) :: compliance
      real(wp), allocatable :: c(:, :)
      integer :: k

      allocate (c(3*compliance%point_count(), 3*compliance%point_count()))
      call compliance%gather([(k, k=1, compliance%point_count())], [(k, k=1, compliance%point_count())], c)
   end function dense

   !> Every block is the closed form at the distance of its points, and the matrix is symmetric to the last bit.
   subroutine test_blocks(error)
      type(test_error), allocatable, intent(out) :: error
      type(compliance_t) :: compliance
      type(be_grid_t) :: grid
      type(half_space_pair_t) :: pair
      real(wp), allocatable :: c(:, :)
      real(wp) :: r(2), deviation, by_entry
      integer :: j, k

      call make_compliance(9, 7, 0.1_wp, compliance, grid, pair)
      c = dense(compliance)
      call check(error, all(c == transpose(c)), 'not symmetric')
      if (allocated(error)) return
      deviation = 0.0_wp
      by_entry = 0.0_wp
      do k = 1, grid%point_count()
         do j = 1, grid%point_count()
            r = grid%position(:, j) - grid%position(:, k)
            deviation = max(deviation, maxval(abs(c(3*j - 2:3*j, 3*k - 2:3*k) - influence(pair, r(1), r(2), grid%dx, grid%dy))))
            by_entry = max(by_entry, maxval(abs(c(3*j - 2:3*j, 3*k - 2:3*k) &
               & - compliance%entry(grid%ix(j) - grid%ix(k), grid%iy(j) - grid%iy(k)))))
         end do
      end do
      call check(error, deviation <= 1.0e-14_wp*maxval(c), 'not the closed form')
      if (allocated(error)) return
      call check(error, by_entry <= 0.0_wp, 'entry and gather differ')
   end subroutine test_blocks

   !> No stored and no assembled normal-tangential coupling.
   subroutine test_equal_materials(error)
      type(test_error), allocatable, intent(out) :: error
      type(compliance_t) :: compliance
      type(be_grid_t) :: grid
      type(half_space_pair_t) :: pair
      real(wp), allocatable :: c(:, :)

      call make_compliance(5, 4, 0.2854_wp, compliance, grid, pair)
      c = dense(compliance)
      call check(error, .not. compliance%coupled() .and. size(compliance%table, 1) == 4)
      if (allocated(error)) return
      call check(error, all(c(1::3, 2::3) == 0.0_wp) .and. all(c(1::3, 3::3) == 0.0_wp) .and. all(c(2::3, 1::3) == 0.0_wp))
   end subroutine test_equal_materials

   !> Positive definite for equal and for coupled materials.
   subroutine test_positive_definite(error)
      type(test_error), allocatable, intent(out) :: error
      type(compliance_t) :: compliance
      type(be_grid_t) :: grid
      type(half_space_pair_t) :: pair
      real(wp), allocatable :: c(:, :), eigenvalue(:), work(:)
      integer :: info, scene

      do scene = 1, 2
         call make_compliance(8, 6, merge(0.2854_wp, -0.3_wp, scene == 1), compliance, grid, pair)
         c = dense(compliance)
         allocate (eigenvalue(size(c, 1)), work(10*size(c, 1)))
         call dsyev('N', 'U', size(c, 1), c, size(c, 1), eigenvalue, work, size(work), info)
         call check(error, info == 0 .and. eigenvalue(1) > 1.0e-2_wp*eigenvalue(size(eigenvalue)))
         if (allocated(error)) return
         deallocate (eigenvalue, work)
      end do
   end subroutine test_positive_definite

   !> gather and add_to_dense of some points are the rows and columns of the whole.
   subroutine test_subsets(error)
      type(test_error), allocatable, intent(out) :: error
      integer, parameter :: some(4) = [7, 2, 31, 12], others(3) = [1, 7, 30]
      type(compliance_t) :: compliance
      type(be_grid_t) :: grid
      type(half_space_pair_t) :: pair
      real(wp), allocatable :: c(:, :)
      real(wp) :: part(12, 9), g(12, 12)
      integer :: rows(12), columns(9)

      call make_compliance(7, 6, 0.45_wp, compliance, grid, pair)
      c = dense(compliance)
      rows = unknowns(some)
      columns = unknowns(others)
      call compliance%gather(some, others, part)
      call check(error, all(part == c(rows, columns)))
      if (allocated(error)) return
      g = 1.0_wp
      call compliance%add_to_dense(some, g)
      call check(error, all(g == 1.0_wp + c(rows, rows)))
   end subroutine test_subsets

   !> Rows of the unknowns (n, t1, t2) of some points.
   pure function unknowns(points) result(rows)
      integer, intent(in) :: points(:)
      integer, allocatable :: rows(:)
      integer :: k, component

      rows = [((3*(points(k) - 1) + component, component=1, 3), k=1, size(points))]
   end function unknowns

end module test_halfspace_compliance
