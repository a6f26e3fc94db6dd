!> Static condensation of hidden degrees of freedom, such as the incompatible modes of 8-node bricks.
!>
!> The hidden rows h fall into small blocks that are coupled to each other only through kept rows k. Per block
!>
!>     T   = -K_hh^-1 K_hk,      u_h = T u_k
!>     K' += K_kh T,             M' += M_kh T + T^T M_hk + T^T M_hh T
!>
!> The stiffness is exact for loads on the kept rows; the mass is Guyan's, whose frequencies err by a term that grows
!> with (f / lowest frequency of a hidden block)^2.
module microslip_fe_condensation
   use microslip_core_error, only: bad_input, error_t
   use microslip_core_kinds, only: wp
   use microslip_core_text, only: to_text
   use microslip_linalg_dense, only: cholesky_factor, cholesky_solve
   use microslip_linalg_sparse, only: from_triplets, symmetric_sparse_t
   implicit none(type, external)
   private

   public :: condense_hidden

   !> A pivot below this part of the block's diagonal entry means a singular block.
   real(wp), parameter :: smallest_pivot = 1.0e3_wp*epsilon(1.0_wp)

   !> Entries of a matrix while it is assembled.
   type :: triplets_t
      integer :: count = 0
      integer, allocatable :: row(:), column(:)
      real(wp), allocatable :: value(:)
   contains
      procedure :: add
   end type triplets_t

   !> Both triangles of the hidden rows of a matrix: for hidden row h (counted among the hidden ones) the columns
   !> and values from start(h) to start(h + 1) - 1.
   type :: hidden_rows_t
      integer, allocatable :: start(:), column(:)
      real(wp), allocatable :: value(:)
   end type hidden_rows_t

contains

   !> Remove the hidden rows from stiffness and mass.
   subroutine condense_hidden(stiffness, mass, hidden, with_mass, kept, error)
      !> (n x n) on return (kept x kept)
      type(symmetric_sparse_t), intent(inout) :: stiffness
      !> (n x n) on return (kept x kept)
      type(symmetric_sparse_t), intent(inout) :: mass
      !> (n) rows to be removed
      logical, intent(in) :: hidden(:)
      !> Whether the mass is condensed too (Guyan); otherwise the hidden rows' mass is left out
      logical, intent(in) :: with_mass
      !> Numbers the kept rows had before, ascending
      integer, allocatable, intent(out) :: kept(:)
      !> A hidden block that is not positive definite
      type(error_t), allocatable, intent(out) :: error
      integer, allocatable :: place(:), block_start(:), member(:)
      type(hidden_rows_t) :: rows_k, rows_m
      type(triplets_t) :: k_new, m_new
      integer :: n, row, b, kept_count, hidden_count

      n = size(hidden)
      ! place > 0: new number of a kept row; place < 0: minus the number among the hidden rows.
      allocate (place(n))
      kept_count = 0
      hidden_count = 0
      do row = 1, n
         if (hidden(row)) then
            hidden_count = hidden_count + 1
            place(row) = -hidden_count
         else
            kept_count = kept_count + 1
            place(row) = kept_count
         end if
      end do
      kept = pack([(row, row=1, n)],.not. hidden)
      call split(stiffness, place, hidden_count, k_new, rows_k)
      call split(mass, place, hidden_count, m_new, rows_m)
      call find_blocks(rows_k, rows_m, place, hidden_count, block_start, member)
      do b = 1, size(block_start) - 1
         call condense_block(rows_k, rows_m, place, member(block_start(b):block_start(b + 1) - 1), with_mass, &
            k_new, m_new, error)
         if (allocated(error)) return
      end do
      stiffness = assembled(k_new, kept_count)
      mass = assembled(m_new, kept_count)
   end subroutine condense_hidden

   !> Separate the kept part of a matrix (new numbers) from its hidden rows (both triangles, old column numbers).
   subroutine split(matrix, place, hidden_count, kept_part, rows)
      type(symmetric_sparse_t), intent(in) :: matrix
      integer, intent(in) :: place(:)
      integer, intent(in) :: hidden_count
      type(triplets_t), intent(out) :: kept_part
      type(hidden_rows_t), intent(out) :: rows
      integer, allocatable :: next(:)
      integer :: i, j, k, pass

      allocate (kept_part%row(matrix%entries()), kept_part%column(matrix%entries()), kept_part%value(matrix%entries()))
      allocate (rows%start(hidden_count + 1), source=0)
      do pass = 1, 2
         if (pass == 2) then
            rows%start(1) = 1
            do i = 1, hidden_count
               rows%start(i + 1) = rows%start(i) + rows%start(i + 1)
            end do
            next = rows%start
            allocate (rows%column(rows%start(hidden_count + 1) - 1), rows%value(rows%start(hidden_count + 1) - 1))
         end if
         do i = 1, matrix%n
            do k = matrix%row_start(i), matrix%row_start(i + 1) - 1
               j = matrix%column(k)
               if (place(i) > 0 .and. place(j) > 0) then
                  if (pass == 1) call kept_part%add(place(i), place(j), matrix%value(k))
               else
                  if (place(i) < 0) call note(-place(i), j, matrix%value(k))
                  if (place(j) < 0 .and. i /= j) call note(-place(j), i, matrix%value(k))
               end if
            end do
         end do
      end do

   contains

      !> Count an entry of a hidden row, then store it.
      subroutine note(h, column, value)
         integer, intent(in) :: h, column
         real(wp), intent(in) :: value
         if (pass == 1) then
            rows%start(h + 1) = rows%start(h + 1) + 1
         else
            rows%column(next(h)) = column
            rows%value(next(h)) = value
            next(h) = next(h) + 1
         end if
      end subroutine note

   end subroutine split

   !> Hidden rows that are coupled directly with each other: block b holds member(block_start(b):block_start(b+1)-1).
   subroutine find_blocks(rows_k, rows_m, place, hidden_count, block_start, member)
      type(hidden_rows_t), intent(in) :: rows_k, rows_m
      integer, intent(in) :: place(:)
      integer, intent(in) :: hidden_count
      integer, allocatable, intent(out) :: block_start(:), member(:)
      logical, allocatable :: seen(:)
      integer, allocatable :: start(:)
      integer :: h, done, found, blocks

      allocate (seen(hidden_count), source=.false.)
      allocate (member(hidden_count), start(hidden_count + 1))
      blocks = 0
      found = 0
      do h = 1, hidden_count
         if (seen(h)) cycle
         blocks = blocks + 1
         start(blocks) = found + 1
         done = found
         call reach(h)
         do while (done < found)
            done = done + 1
            call reach_neighbours(rows_k, member(done))
            call reach_neighbours(rows_m, member(done))
         end do
      end do
      start(blocks + 1) = found + 1
      block_start = start(:blocks + 1)

   contains

      subroutine reach(row)
         integer, intent(in) :: row
         if (seen(row)) return
         seen(row) = .true.
         found = found + 1
         member(found) = row
      end subroutine reach

      subroutine reach_neighbours(rows, row)
         type(hidden_rows_t), intent(in) :: rows
         integer, intent(in) :: row
         integer :: k
         do k = rows%start(row), rows%start(row + 1) - 1
            if (place(rows%column(k)) < 0) call reach(-place(rows%column(k)))
         end do
      end subroutine reach_neighbours

   end subroutine find_blocks

   !> Condense one block and add what it leaves on the kept rows.
   subroutine condense_block(rows_k, rows_m, place, block, with_mass, k_new, m_new, error)
      type(hidden_rows_t), intent(in) :: rows_k, rows_m
      integer, intent(in) :: place(:)
      !> Numbers among the hidden rows
      integer, intent(in) :: block(:)
      logical, intent(in) :: with_mass
      type(triplets_t), intent(inout) :: k_new, m_new
      type(error_t), allocatable, intent(out) :: error
      integer, allocatable :: neighbour(:)
      real(wp), allocatable :: k_hh(:, :), k_hk(:, :), m_hh(:, :), m_hk(:, :), t(:, :), factor(:, :), k_add(:, :), m_add(:, :)
      logical :: singular
      integer :: i, j, n

      n = size(block)
      call list_neighbours()
      call gather(rows_k, k_hh, k_hk)
      call gather(rows_m, m_hh, m_hk)
      allocate (factor, source=k_hh)
      call cholesky_factor(factor, error)
      singular = allocated(error)
      do i = 1, n
         if (.not. singular) singular = factor(i, i)**2 <= smallest_pivot*k_hh(i, i)
      end do
      if (singular) then
         call bad_input(error, 'hidden row '//to_text(findloc(place, -block(1), dim=1))// &
            ': the stiffness of its block is singular, so that it cannot be condensed')
         return
      end if
      t = -k_hk
      call cholesky_solve(factor, t)
      k_add = matmul(transpose(k_hk), t)
      m_add = matmul(transpose(m_hk), t)
      m_add = m_add + transpose(m_add) + matmul(transpose(t), matmul(m_hh, t))
      do j = 1, size(neighbour)
         do i = 1, j
            call k_new%add(place(neighbour(i)), place(neighbour(j)), 0.5_wp*(k_add(i, j) + k_add(j, i)))
            if (with_mass) call m_new%add(place(neighbour(i)), place(neighbour(j)), 0.5_wp*(m_add(i, j) + m_add(j, i)))
         end do
      end do

   contains

      !> Kept rows that the block is coupled to.
      subroutine list_neighbours()
         integer :: h, k, r
         allocate (neighbour(0))
         do h = 1, n
            r = block(h)
            do k = rows_k%start(r), rows_k%start(r + 1) - 1
               call note_neighbour(rows_k%column(k))
            end do
            do k = rows_m%start(r), rows_m%start(r + 1) - 1
               call note_neighbour(rows_m%column(k))
            end do
         end do
      end subroutine list_neighbours

      subroutine note_neighbour(column)
         integer, intent(in) :: column
         if (place(column) < 0) return
         if (.not. any(neighbour == column)) neighbour = [neighbour, column]
      end subroutine note_neighbour

      !> The block's dense matrices: among itself and with its neighbours.
      subroutine gather(rows, hh, hk)
         type(hidden_rows_t), intent(in) :: rows
         real(wp), allocatable, intent(out) :: hh(:, :), hk(:, :)
         integer :: h, k, column
         allocate (hh(n, n), hk(n, size(neighbour)), source=0.0_wp)
         do h = 1, n
            do k = rows%start(block(h)), rows%start(block(h) + 1) - 1
               column = rows%column(k)
               if (place(column) > 0) then
                  hk(h, findloc(neighbour, column, dim=1)) = rows%value(k)
               else
                  hh(h, findloc(block, -place(column), dim=1)) = rows%value(k)
               end if
            end do
         end do
      end subroutine gather

   end subroutine condense_block

   !> Append an entry.
   subroutine add(self, row, column, value)
      class(triplets_t), intent(inout) :: self
      integer, intent(in) :: row, column
      real(wp), intent(in) :: value

      if (self%count == size(self%row)) then
         self%row = [self%row, spread(0, 1, self%count/2 + 1000)]
         self%column = [self%column, spread(0, 1, self%count/2 + 1000)]
         self%value = [self%value, spread(0.0_wp, 1, self%count/2 + 1000)]
      end if
      self%count = self%count + 1
      self%row(self%count) = row
      self%column(self%count) = column
      self%value(self%count) = value
   end subroutine add

   !> The matrix of the triplets.
   function assembled(triplets, n) result(matrix)
      type(triplets_t), intent(in) :: triplets
      integer, intent(in) :: n
      type(symmetric_sparse_t) :: matrix

      associate (m => triplets%count)
         matrix = from_triplets(n, triplets%row(:m), triplets%column(:m), triplets%value(:m))
      end associate
   end function assembled

end module microslip_fe_condensation
