!> The points that a step looks at: rows of the condensed problem, and among them those that may move.
!>
!>     force = predicted + M_n x_n + M_t x_t,    gap_n = gap_old + x_n,    slip = x_t
!> A row is a point whose force is followed in every step; a column is a point that may slip or open. The first
!> rows are those of the columns, in the same order. Rows and columns of M = G_AA^-1 are copied here once, side by
!> side, so that a product reads memory in order: the block grows with the slip zone and is emptied when the motion
!> turns.
module microslip_contact_block
   use, intrinsic :: iso_fortran_env, only: real32
   use microslip_contact_base_set, only: base_set_t
   use microslip_contact_laws, only: classify, law_residual, state_open, state_stick
   use microslip_core_kinds, only: wp
   use microslip_linalg_dense, only: add_product, add_product_single
   implicit none(type, external)
   private

   public :: contact_block_t

   type :: contact_block_t
      !> Points followed and points that may move
      integer :: rows = 0, columns = 0
      !> (rows) place in the base set
      integer, allocatable :: place(:)
      !> (3 rows, 2 columns) and (3 rows, columns) tangential and normal columns of M, N/m
      real(wp), allocatable :: M_t(:, :), M_n(:, :)
      !> (3 columns, 2 columns) the tangential columns in single precision, for small changes
      real(real32), allocatable :: M_single(:, :)
      !> (3 rows, rank) basis of the coupling to other groups, and transposed: what comes in and what goes out
      real(wp), allocatable :: basis(:, :), basis_t(:, :)
      !> (3 rows, drivers)
      real(wp), allocatable :: slope(:, :)
      !> (rows)
      real(wp), allocatable :: friction(:)
      !> (3, rows) N: in the state before the step, if no gap changed, and with the increments x
      real(wp), allocatable :: force(:, :), predicted(:, :), trial(:, :)
      !> (3, rows) N: what the step before changed
      real(wp), allocatable :: change(:, :)
      !> (columns), (2, columns) increments of normal gap and slip, m
      real(wp), allocatable :: x_n(:), x_t(:, :)
      !> (columns) augmentation, N/m: normal, and the one of both tangential components
      real(wp), allocatable :: stiffness_n(:), stiffness_t(:)
      !> (columns) normal gap before the step, m
      real(wp), allocatable :: gap_old(:)
      !> (columns) no force here whatever the gap (velocity level)
      logical, allocatable :: forced_open(:)
      !> (columns)
      integer, allocatable :: status(:)
      !> (columns), (2, columns) m: changes of the increments, for `apply`, and the largest change of a force by it, N
      real(wp), allocatable :: dx_n(:), dx_t(:, :)
      real(wp) :: last_change = 0.0_wp
   contains
      procedure :: clear
      procedure :: add_row
      procedure :: add_column
      procedure :: predict
      procedure :: evaluate
      procedure :: apply
      procedure :: outgoing
      procedure :: add_incoming
      procedure :: update_states
      procedure :: residual
   end type contact_block_t

contains

   !> No rows, no columns; the memory is kept.
   subroutine clear(self, base)
      class(contact_block_t), intent(inout) :: self
      type(base_set_t), intent(in) :: base
      self%rows = 0
      self%columns = 0
      if (.not. allocated(self%place)) then
         allocate (self%place(0), self%friction(0), self%x_n(0), self%stiffness_n(0), &
            & self%stiffness_t(0), self%gap_old(0), self%forced_open(0), self%status(0))
         allocate (self%M_t(0, 0), self%M_n(0, 0), self%slope(0, size(base%slope, 1)), self%force(3, 0), self%predicted(3, 0), &
            & self%trial(3, 0), self%change(3, 0), self%x_t(2, 0), self%dx_n(0), self%dx_t(2, 0), self%M_single(0, 0), &
            & self%basis(0, size(base%basis, 1)), &
            & self%basis_t(size(base%basis, 1), 0))
      end if
   end subroutine clear

   !> Follow a point; its forces are to be set by the caller.
   subroutine add_row(self, base, place, friction)
      class(contact_block_t), intent(inout) :: self
      type(base_set_t), intent(in) :: base
      !> Its place in the base set
      integer, intent(in) :: place
      real(wp), intent(in) :: friction
      integer :: r, a, k

      if (self%rows == size(self%place)) call make_room_for_rows(self, base, 2*self%rows + 16)
      self%rows = self%rows + 1
      r = self%rows
      self%place(r) = place
      self%friction(r) = friction
      self%slope(3*r - 2:3*r, :) = transpose(base%slope(:, 3*place - 2:3*place))
      self%basis_t(:, 3*r - 2:3*r) = base%basis(:, 3*place - 2:3*place)
      self%basis(3*r - 2:3*r, :) = transpose(base%basis(:, 3*place - 2:3*place))
      do a = 1, self%columns
         k = 3*self%place(a)
         self%M_n(3*r - 2:3*r, a) = base%M(3*place - 2:3*place, k - 2)
         self%M_t(3*r - 2:3*r, 2*a - 1) = base%M(3*place - 2:3*place, k - 1)
         self%M_t(3*r - 2:3*r, 2*a) = base%M(3*place - 2:3*place, k)
      end do
   end subroutine add_row

   !> Let the point of a row move; its gap and start values are to be set by the caller. It becomes the last column.
   subroutine add_column(self, base, row)
      class(contact_block_t), intent(inout) :: self
      type(base_set_t), intent(in) :: base
      integer, intent(in) :: row
      integer :: a, k, r, p

      if (self%columns == size(self%status)) call make_room_for_columns(self, 2*self%columns + 16)
      a = self%columns + 1
      call exchange_rows(self, a, row)
      self%columns = a
      k = 3*self%place(a)
      do r = 1, self%rows
         p = 3*self%place(r)
         self%M_n(3*r - 2:3*r, a) = base%M(p - 2:p, k - 2)
         self%M_t(3*r - 2:3*r, 2*a - 1) = base%M(p - 2:p, k - 1)
         self%M_t(3*r - 2:3*r, 2*a) = base%M(p - 2:p, k)
      end do
      self%M_single(:3*a, 2*a - 1:2*a) = real(self%M_t(:3*a, 2*a - 1:2*a), real32)
      self%M_single(3*a - 2:3*a, :2*a - 2) = real(self%M_t(3*a - 2:3*a, :2*a - 2), real32)
      self%stiffness_n(a) = base%M(k - 2, k - 2)
      self%stiffness_t(a) = min(base%M(k - 1, k - 1), base%M(k, k))
   end subroutine add_column

   !> Exchange two rows in the order.
   subroutine exchange_rows(self, one, other)
      type(contact_block_t), intent(inout) :: self
      integer, intent(in) :: one, other
      integer :: c, i, j

      if (one == other) return
      self%place([one, other]) = self%place([other, one])
      self%friction([one, other]) = self%friction([other, one])
      self%force(:, [one, other]) = self%force(:, [other, one])
      self%predicted(:, [one, other]) = self%predicted(:, [other, one])
      self%trial(:, [one, other]) = self%trial(:, [other, one])
      self%change(:, [one, other]) = self%change(:, [other, one])
      do c = 1, 3
         i = 3*one - 3 + c
         j = 3*other - 3 + c
         self%slope([i, j], :) = self%slope([j, i], :)
         self%basis([i, j], :) = self%basis([j, i], :)
         self%basis_t(:, [i, j]) = self%basis_t(:, [j, i])
         self%M_n([i, j], :self%columns) = self%M_n([j, i], :self%columns)
         self%M_t([i, j], :2*self%columns) = self%M_t([j, i], :2*self%columns)
      end do
   end subroutine exchange_rows

   !> Forces in all rows if no gap changed.
   subroutine predict(self, dq)
      class(contact_block_t), intent(inout) :: self
      !> (drivers) change of the driver
      real(wp), intent(in) :: dq(:)

      self%predicted(:, :self%rows) = self%force(:, :self%rows)
      call add_product(3*self%rows, size(dq), self%slope, dq, self%predicted)
   end subroutine predict

   !> trial = predicted + M x in rows `first` to `last`, without what other groups cause.
   subroutine evaluate(self, first, last)
      class(contact_block_t), intent(inout) :: self
      integer, intent(in) :: first, last
      real(wp) :: change(3, max(0, last - first + 1))
      integer :: a, r

      if (last < first) return
      change = 0.0_wp
      call add_product(size(change), 2*self%columns, self%M_t(3*first - 2:, :), self%x_t, change)
      do a = 1, self%columns
         if (self%x_n(a) == 0.0_wp) cycle
         do r = first, last
            change(:, r - first + 1) = change(:, r - first + 1) + self%M_n(3*r - 2:3*r, a)*self%x_n(a)
         end do
      end do
      self%trial(:, first:last) = self%predicted(:, first:last) + change
   end subroutine evaluate

   !> x = x + dx and trial = trial + M dx in the rows of the columns, dx small: tangential part in single precision.
   subroutine apply(self)
      class(contact_block_t), intent(inout) :: self
      real(real32) :: change(3, self%columns), dx(2, self%columns)
      real(wp) :: unit
      integer :: a, r, n

      n = self%columns
      self%last_change = 0.0_wp
      if (n == 0) return
      unit = max(maxval(abs(self%dx_t(:, :n))), tiny(1.0_wp))
      dx = real(self%dx_t(:, :n)/unit, real32)
      change = 0.0_real32
      call add_product_single(3*n, 2*n, self%M_single, dx, change)
      self%trial(:, :n) = self%trial(:, :n) + unit*change
      self%last_change = unit*maxval(abs(change))
      do a = 1, n
         if (self%dx_n(a) == 0.0_wp) cycle
         do r = 1, n
            self%trial(:, r) = self%trial(:, r) + self%M_n(3*r - 2:3*r, a)*self%dx_n(a)
         end do
      end do
      self%x_n(:n) = self%x_n(:n) + self%dx_n(:n)
      self%x_t(:, :n) = self%x_t(:, :n) + self%dx_t(:, :n)
   end subroutine apply

   !> What other groups feel of increments: Z^T x, (rank).
   function outgoing(self, x_n, x_t) result(c)
      class(contact_block_t), intent(in) :: self
      !> (columns) and (2, columns) m
      real(wp), intent(in) :: x_n(:), x_t(:, :)
      real(wp) :: c(size(self%basis, 2)), x(3*self%columns)
      integer :: a

      do a = 1, self%columns
         x(3*a - 2:3*a) = [x_n(a), x_t(1, a), x_t(2, a)]
      end do
      c = 0.0_wp
      call add_product(size(c), size(x), self%basis_t, x, c)
   end function outgoing

   !> trial = trial + Z incoming in rows `first` to `last`.
   subroutine add_incoming(self, incoming, first, last)
      class(contact_block_t), intent(inout) :: self
      !> (rank) N
      real(wp), intent(in) :: incoming(:)
      integer, intent(in) :: first, last

      if (last < first .or. size(incoming) == 0) return
      call add_product(3*(last - first + 1), size(incoming), self%basis(3*first - 2:, :), incoming, self%trial(:, first:last))
   end subroutine add_incoming

   !> States of all columns from their forces and increments.
   subroutine update_states(self, changed)
      class(contact_block_t), intent(inout) :: self
      !> Becomes true where a state changes
      logical, intent(inout) :: changed
      integer :: a, before

      do a = 1, self%columns
         before = self%status(a)
         if (self%forced_open(a)) then
            self%status(a) = state_open
         else
            self%status(a) = classify(self%trial(:, a), self%gap_old(a) + self%x_n(a), self%x_t(:, a), &
               & self%stiffness_n(a), self%stiffness_t(a), self%friction(a))
         end if
         changed = changed .or. self%status(a) /= before
      end do
   end subroutine update_states

   !> Largest violation of the contact laws in the columns, N.
   pure real(wp) function residual(self)
      class(contact_block_t), intent(in) :: self
      integer :: a

      residual = 0.0_wp
      do a = 1, self%columns
         if (self%forced_open(a)) then
            residual = max(residual, maxval(abs(self%trial(:, a))))
         else
            residual = max(residual, law_residual(self%trial(:, a), self%gap_old(a) + self%x_n(a), self%x_t(:, a), &
               & self%stiffness_n(a), self%stiffness_t(a), self%friction(a)))
         end if
      end do
   end function residual

   !> Larger arrays for the rows.
   subroutine make_room_for_rows(self, base, room)
      type(contact_block_t), intent(inout) :: self
      type(base_set_t), intent(in) :: base
      integer, intent(in) :: room
      integer :: n, m

      n = self%rows
      m = self%columns
      self%place = [self%place(:n), spread(0, 1, room - n)]
      self%friction = [self%friction(:n), spread(0.0_wp, 1, room - n)]
      call widen(self%slope, 3*n, size(base%slope, 1), 3*room, size(base%slope, 1))
      call widen(self%basis, 3*n, size(base%basis, 1), 3*room, size(base%basis, 1))
      call widen(self%basis_t, size(base%basis, 1), 3*n, size(base%basis, 1), 3*room)
      call widen(self%force, 3, n, 3, room)
      call widen(self%predicted, 3, n, 3, room)
      call widen(self%trial, 3, n, 3, room)
      call widen(self%change, 3, n, 3, room)
      call widen(self%M_t, 3*n, 2*m, 3*room, size(self%M_t, 2))
      call widen(self%M_n, 3*n, m, 3*room, size(self%M_n, 2))
   end subroutine make_room_for_rows

   !> Larger arrays for the columns.
   subroutine make_room_for_columns(self, room)
      type(contact_block_t), intent(inout) :: self
      integer, intent(in) :: room
      real(real32), allocatable :: single(:, :)
      integer :: n, m

      n = size(self%M_t, 1)
      m = self%columns
      self%x_n = [self%x_n(:m), spread(0.0_wp, 1, room - m)]
      self%stiffness_n = [self%stiffness_n(:m), spread(0.0_wp, 1, room - m)]
      self%stiffness_t = [self%stiffness_t(:m), spread(0.0_wp, 1, room - m)]
      self%gap_old = [self%gap_old(:m), spread(0.0_wp, 1, room - m)]
      self%forced_open = [self%forced_open(:m), spread(.false., 1, room - m)]
      self%status = [self%status(:m), spread(state_stick, 1, room - m)]
      self%dx_n = self%x_n
      call widen(self%x_t, 2, m, 2, room)
      call widen(self%dx_t, 2, m, 2, room)
      call widen(self%M_t, 3*self%rows, 2*m, n, 2*room)
      call widen(self%M_n, 3*self%rows, m, n, room)
      allocate (single(3*room, 2*room))
      if (m > 0) single(:3*m, :2*m) = self%M_single(:3*m, :2*m)
      call move_alloc(single, self%M_single)
   end subroutine make_room_for_columns

   !> Reallocate, keeping the leading part.
   subroutine widen(array, kept_rows, kept_columns, rows, columns)
      real(wp), allocatable, intent(inout) :: array(:, :)
      integer, intent(in) :: kept_rows, kept_columns, rows, columns
      real(wp), allocatable :: larger(:, :)

      allocate (larger(rows, columns))
      if (kept_rows > 0 .and. kept_columns > 0) larger(:kept_rows, :kept_columns) = array(:kept_rows, :kept_columns)
      call move_alloc(larger, array)
   end subroutine widen

end module microslip_contact_block
