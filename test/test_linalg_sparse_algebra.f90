module test_linalg_sparse_algebra
   use microslip_core_kinds, only: wp
   use microslip_linalg_sparse, only: from_triplets, symmetric_sparse_t
   use microslip_linalg_sparse_algebra, only: combination, multiply_many, submatrix
   use support_brick, only: to_dense
   use testdrive, only: new_unittest, unittest_type, error_type, check
   implicit none(type, external)
   private

   public :: collect_linalg_sparse_algebra

   real(wp), parameter :: rounding = 100.0_wp*epsilon(1.0_wp)

contains

   subroutine collect_linalg_sparse_algebra(testsuite)
      type(unittest_type), allocatable, intent(out) :: testsuite(:)
      testsuite = [ &
                  new_unittest('combination', test_combination), &
                  new_unittest('submatrix', test_submatrix), &
                  new_unittest('multiply_many', test_multiply_many)]
   end subroutine collect_linalg_sparse_algebra

   !> A matrix of 6 rows.
   function small(row, column) result(matrix)
      integer, intent(in) :: row(:), column(:)
      type(symmetric_sparse_t) :: matrix
      integer :: k
      matrix = from_triplets(6, row, column, [(cos(real(k, wp)), k=1, size(row))])
   end function small

   subroutine test_combination(error)
      type(error_type), allocatable, intent(out) :: error
      type(symmetric_sparse_t) :: a, b, c

      a = small([1, 1, 2, 3, 6, 4], [1, 4, 5, 3, 2, 4])
      b = small([5, 1, 2, 3, 5], [5, 4, 3, 6, 2])
      c = combination(a, -2.5_wp, b)
      call check(error, maxval(abs(to_dense(c) - to_dense(a) + 2.5_wp*to_dense(b))) < rounding)
      if (allocated(error)) return
      call check(error, c%entries(), 6 + 5)
   end subroutine test_combination

   subroutine test_submatrix(error)
      type(error_type), allocatable, intent(out) :: error
      integer, parameter :: rows(3) = [2, 4, 6]
      type(symmetric_sparse_t) :: a
      real(wp), allocatable :: full(:, :)

      a = small([1, 1, 2, 3, 6, 4, 4], [1, 4, 5, 3, 2, 4, 6])
      full = to_dense(a)
      call check(error, maxval(abs(to_dense(submatrix(a, rows)) - full(rows, rows))) <= 0.0_wp)
   end subroutine test_submatrix

   subroutine test_multiply_many(error)
      type(error_type), allocatable, intent(out) :: error
      type(symmetric_sparse_t) :: a
      real(wp) :: x(6, 5), y(6, 5)
      integer :: k

      a = small([1, 1, 2, 3, 6, 4, 4], [1, 4, 5, 3, 2, 4, 6])
      x = reshape([(sin(real(k, wp)), k=1, 30)], [6, 5])
      call multiply_many(a, x, y)
      call check(error, maxval(abs(y - matmul(to_dense(a), x))) < rounding)
   end subroutine test_multiply_many

end module test_linalg_sparse_algebra
