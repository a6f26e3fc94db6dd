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
      integer, allocatable :: upper_row(:), upper_column(:), order(:), start(:)
      real(wp), allocatable :: entry(:)
      integer :: i, m, k, kept, first

      ! The diagonal comes first, so that every row has its place there.
      upper_row = [(i, i=1, n), min(row, column)]
      upper_column = [(i, i=1, n), max(row, column)]
      entry = [spread(0.0_wp, 1, n), value]
      order = [(i, i=1, size(entry))]
      call sort_stably(upper_column, n, order, start)
      call sort_stably(upper_row, n, order, start)

      matrix%n = n
      allocate (matrix%row_start(n + 1), matrix%column(size(entry)), matrix%value(size(entry)))
      kept = 0
      do i = 1, n
         first = kept + 1
         matrix%row_start(i) = first
         do m = start(i), start(i + 1) - 1
            k = order(m)
            if (kept >= first) then
               if (matrix%column(kept) == upper_column(k)) then
                  matrix%value(kept) = matrix%value(kept) + entry(k)
                  cycle
               end if
            end if
            kept = kept + 1
            matrix%column(kept) = upper_column(k)
            matrix%value(kept) = entry(k)
         end do
      end do
      matrix%row_start(n + 1) = kept + 1
      matrix%column = matrix%column(:kept)
      matrix%value = matrix%value(:kept)
   end function from_triplets

   !> Counting sort that keeps the order of equal keys.
   pure subroutine sort_stably(key, n, order, start)
      !> Keys from 1 to n
      integer, intent(in) :: key(:), n
      !> Indices of the keys: any order in, by ascending key out
      integer, allocatable, intent(inout) :: order(:)
      !> (n + 1) first place of every key
      integer, allocatable, intent(out) :: start(:)
      integer, allocatable :: place(:), sorted(:)
      integer :: m, k

      allocate (start(n + 1), source=0)
      do m = 1, size(key)
         start(key(m) + 1) = start(key(m) + 1) + 1
      end do
      start(1) = 1
      do k = 1, n
         start(k + 1) = start(k + 1) + start(k)
      end do
      place = start
      allocate (sorted(size(order)))
      do m = 1, size(order)
         k = key(order(m))
         sorted(place(k)) = order(m)
         place(k) = place(k) + 1
      end do
      call move_alloc(sorted, order)
   end subroutine sort_stably

end module microslip_linalg_sparse
