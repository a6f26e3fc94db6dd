!> Sparse symmetric matrices: one triangle in compressed rows.
module microslip_linalg_sparse
   use microslip_core_kinds, only: wp
   implicit none(type, external)
   private

   public :: symmetric_sparse_t, from_triplets

   !> Symmetric n x n matrix, upper triangle (column >= row) in compressed sparse rows.
   !> Columns ascend within a row and the diagonal entry of every row is stored first.
   type :: symmetric_sparse_t
      integer :: n = 0
      !> (n + 1) first entry of every row, 1-based
      integer, allocatable :: row_start(:)
      !> (entries)
      integer, allocatable :: column(:)
      real(wp), allocatable :: value(:)
   contains
      procedure :: entries
      procedure :: multiply
      procedure :: diagonal
   end type symmetric_sparse_t

contains

   !> Number of stored entries.
   pure integer function entries(self)
      class(symmetric_sparse_t), intent(in) :: self
      entries = 0
      if (allocated(self%row_start)) entries = self%row_start(self%n + 1) - 1
   end function entries

   !> y = A x.
   pure subroutine multiply(self, x, y)
      class(symmetric_sparse_t), intent(in) :: self
      !> (n)
      real(wp), intent(in) :: x(:)
      !> (n)
      real(wp), intent(out) :: y(:)
      integer :: row, k, col
      real(wp) :: total

      y = 0.0_wp
      do row = 1, self%n
         total = self%value(self%row_start(row))*x(row)
         do k = self%row_start(row) + 1, self%row_start(row + 1) - 1
            col = self%column(k)
            total = total + self%value(k)*x(col)
            y(col) = y(col) + self%value(k)*x(row)
         end do
         y(row) = y(row) + total
      end do
   end subroutine multiply

   !> The diagonal, (n).
   pure function diagonal(self) result(d)
      class(symmetric_sparse_t), intent(in) :: self
      real(wp), allocatable :: d(:)
      d = self%value(self%row_start(:self%n))
   end function diagonal

   !> Assemble from triplets (any triangle, any order); entries of the same place are added.
   !> A diagonal entry is stored for every row, zero if none was given.
   pure function from_triplets(n, row, column, value) result(matrix)
      !> Size of the matrix
      integer, intent(in) :: n
      !> (entries) 1-based; each off-diagonal pair must be given once, in either triangle
      integer, intent(in) :: row(:), column(:)
      !> (entries)
      real(wp), intent(in) :: value(:)
      type(symmetric_sparse_t) :: matrix
      integer, allocatable :: by_column(:), start(:), position(:), col(:)
      real(wp), allocatable :: val(:)
      integer :: k, i, j, m, total, kept, first

      ! Two stable counting sorts, by column and then by row, with the n diagonal places in front.
      total = size(value) + n
      allocate (start(n + 1), by_column(total))
      start = 0
      do k = 1, total
         j = column_of(k)
         start(j + 1) = start(j + 1) + 1
      end do
      start(1) = 1
      do j = 1, n
         start(j + 1) = start(j + 1) + start(j)
      end do
      position = start
      do k = 1, total
         j = column_of(k)
         by_column(position(j)) = k
         position(j) = position(j) + 1
      end do
      start = 0
      do k = 1, total
         i = row_of(k)
         start(i + 1) = start(i + 1) + 1
      end do
      start(1) = 1
      do i = 1, n
         start(i + 1) = start(i + 1) + start(i)
      end do
      position = start
      allocate (col(total), val(total))
      do m = 1, total
         k = by_column(m)
         i = row_of(k)
         col(position(i)) = column_of(k)
         val(position(i)) = 0.0_wp
         if (k > n) val(position(i)) = value(k - n)
         position(i) = position(i) + 1
      end do

      matrix%n = n
      allocate (matrix%row_start(n + 1))
      kept = 0
      do i = 1, n
         matrix%row_start(i) = kept + 1
         first = kept + 1
         do m = start(i), start(i + 1) - 1
            if (kept >= first) then
               if (col(kept) == col(m)) then
                  val(kept) = val(kept) + val(m)
                  cycle
               end if
            end if
            kept = kept + 1
            col(kept) = col(m)
            val(kept) = val(m)
         end do
      end do
      matrix%row_start(n + 1) = kept + 1
      matrix%column = col(:kept)
      matrix%value = val(:kept)

   contains

      pure integer function row_of(k)
         integer, intent(in) :: k
         if (k <= n) then
            row_of = k
         else
            row_of = min(row(k - n), column(k - n))
         end if
      end function row_of

      pure integer function column_of(k)
         integer, intent(in) :: k
         if (k <= n) then
            column_of = k
         else
            column_of = max(row(k - n), column(k - n))
         end if
      end function column_of

   end function from_triplets

end module microslip_linalg_sparse
