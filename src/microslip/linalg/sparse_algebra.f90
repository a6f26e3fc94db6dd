!> Operations that make or use whole sparse symmetric matrices: sums, parts, products with many vectors.
module microslip_linalg_sparse_algebra
   use microslip_core_kinds, only: wp
   use microslip_linalg_sparse, only: symmetric_sparse_t
   implicit none(type, external)
   private

   public :: combination, submatrix, multiply_many

contains

   !> A + factor B.
   pure function combination(a, factor, b) result(c)
      type(symmetric_sparse_t), intent(in) :: a, b
      real(wp), intent(in) :: factor
      type(symmetric_sparse_t) :: c
      integer, allocatable :: column(:)
      real(wp), allocatable :: value(:)
      integer :: i, k_a, k_b, end_a, end_b, m

      c%n = a%n
      allocate (c%row_start(a%n + 1), column(a%entries() + b%entries()), value(a%entries() + b%entries()))
      m = 0
      do i = 1, a%n
         c%row_start(i) = m + 1
         k_a = a%row_start(i)
         k_b = b%row_start(i)
         end_a = a%row_start(i + 1)
         end_b = b%row_start(i + 1)
         do while (k_a < end_a .or. k_b < end_b)
            m = m + 1
            column(m) = huge(1)
            if (k_a < end_a) column(m) = a%column(k_a)
            if (k_b < end_b) column(m) = min(column(m), b%column(k_b))
            value(m) = 0.0_wp
            if (k_a < end_a) then
               if (a%column(k_a) == column(m)) then
                  value(m) = a%value(k_a)
                  k_a = k_a + 1
               end if
            end if
            if (k_b < end_b) then
               if (b%column(k_b) == column(m)) then
                  value(m) = value(m) + factor*b%value(k_b)
                  k_b = k_b + 1
               end if
            end if
         end do
      end do
      c%row_start(a%n + 1) = m + 1
      c%column = column(:m)
      c%value = value(:m)
   end function combination

   !> The part of a matrix that belongs to some of its rows, numbered anew in their order.
   pure function submatrix(matrix, rows) result(part)
      type(symmetric_sparse_t), intent(in) :: matrix
      !> Ascending
      integer, intent(in) :: rows(:)
      type(symmetric_sparse_t) :: part
      integer, allocatable :: new_row(:), column(:)
      real(wp), allocatable :: value(:)
      integer :: i, k, m

      allocate (new_row(matrix%n), source=0)
      new_row(rows) = [(i, i=1, size(rows))]
      part%n = size(rows)
      allocate (part%row_start(part%n + 1), column(matrix%entries()), value(matrix%entries()))
      m = 0
      do i = 1, part%n
         part%row_start(i) = m + 1
         do k = matrix%row_start(rows(i)), matrix%row_start(rows(i) + 1) - 1
            if (new_row(matrix%column(k)) == 0) cycle
            m = m + 1
            column(m) = new_row(matrix%column(k))
            value(m) = matrix%value(k)
         end do
      end do
      part%row_start(part%n + 1) = m + 1
      part%column = column(:m)
      part%value = value(:m)
   end function submatrix

   !> Y = A X.
   subroutine multiply_many(matrix, x, y)
      type(symmetric_sparse_t), intent(in) :: matrix
      !> (n, columns)
      real(wp), intent(in), contiguous :: x(:, :)
      !> (n, columns)
      real(wp), intent(out), contiguous :: y(:, :)
      integer :: j

      !$omp parallel do default(none) shared(matrix, x, y) private(j)
      do j = 1, size(x, 2)
         call matrix%multiply(x(:, j), y(:, j))
      end do
   end subroutine multiply_many

end module microslip_linalg_sparse_algebra
