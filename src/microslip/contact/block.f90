!> The points that a step looks at: rows of the condensed problem, and among them those that may move.
!>
!>     force = predicted + M_n x_n + M_t x_t,    gap_n = gap_old + x_n,    slip = x_t
!> A row is a point whose force is followed in every step; a column is a point that may slip or open. The first
!> rows are those of the columns, in the same order. Rows and columns of M = G_AA^-1 are copied here once, side by
!> side, so that a product reads memory in order: the block grows with the slip zone and is emptied when the motion
!> turns.
!>
!> A point without friction never slips here: its tangential increments stay zero, as their columns of M are, and where it is
!> closed it sticks as far as the block is concerned.
module microslip_contact_block
   use, intrinsic :: iso_fortran_env, only: real32
   use microslip_contact_base_set, only: base_set_t
   use microslip_contact_laws, only: state_open, state_slip, state_stick
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
      !> (3, columns) increments of normal gap and slip, m
      real(wp), allocatable :: x(:, :)
      !> (columns) augmentation, N/m: normal, and the one of both tangential components
      real(wp), allocatable :: stiffness_n(:), stiffness_t(:)
      !> (columns) normal gap before the step, m
      real(wp), allocatable :: gap_old(:)
      !> (columns) no force here whatever the gap (velocity level)
      logical, allocatable :: forced_open(:)
      !> (columns)
      integer, allocatable :: status(:)
      !> (3, columns) what the laws miss at the trial forces, N, and the largest of it
      real(wp), allocatable :: violation(:, :)
      real(wp) :: residual = 0.0_wp
      !> (3, columns) m: changes of the increments, for `apply`, and the largest change of a force by it, N
      real(wp), allocatable :: dx(:, :)
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
      procedure :: assess
   end type contact_block_t

contains

   !> No rows, no columns; the memory is kept.
   subroutine clear(self, base)
      class(contact_block_t), intent(inout) :: self
      type(base_set_t), intent(in) :: base
      self%rows = 0
      self%columns = 0
      self%residual = 0.0_wp
      if (.not. allocated(self%place)) then
         allocate (self%place(0), self%friction(0), self%stiffness_n(0), self%stiffness_t(0), self%gap_old(0), &
            & self%forced_open(0), self%status(0))
         allocate (self%M_t(0, 0), self%M_n(0, 0), self%slope(0, size(base%slope, 1)), self%force(3, 0), self%predicted(3, 0), &
            & self%trial(3, 0), self%change(3, 0), self%x(3, 0), self%dx(3, 0), self%violation(3, 0), self%M_single(0, 0), &
            & self%basis(0, size(base%basis, 1)), self%basis_t(size(base%basis, 1), 0))
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
      ! M is symmetric: its columns are read, one after the other, for the rows.
      do a = 1, self%columns
         k = 3*self%place(a)
         self%M_n(3*r - 2:3*r, a) = base%M(k - 2, 3*place - 2:3*place)
         self%M_t(3*r - 2:3*r, 2*a - 1) = base%M(k - 1, 3*place - 2:3*place)
         self%M_t(3*r - 2:3*r, 2*a) = base%M(k, 3*place - 2:3*place)
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
      call add_product(3*self%rows, size(dq), self%slope, size(self%slope, 1), dq, self%predicted)
   end subroutine predict

   !> trial = predicted + M x in rows `first` to `last`, without what other groups cause.
   subroutine evaluate(self, first, last)
      class(contact_block_t), intent(inout) :: self
      integer, intent(in) :: first, last
      real(wp) :: change(3, max(0, last - first + 1)), x_t(2, self%columns)
      integer :: a

      if (last < first) return
      change = 0.0_wp
      if (self%columns > 0) then
         x_t = self%x(2:3, :self%columns)
         call add_product(size(change), 2*self%columns, self%M_t(3*first - 2, 1), size(self%M_t, 1), x_t, change)
      end if
      do a = 1, self%columns
         if (self%x(1, a) == 0.0_wp) cycle
         call add_product(size(change), 1, self%M_n(3*first - 2, a), size(self%M_n, 1), self%x(1, a), change)
      end do
      self%trial(:, first:last) = self%predicted(:, first:last) + change
   end subroutine evaluate

   !> x = x + dx and trial = trial + M dx in the rows of the columns, dx small: tangential part in single precision.
   subroutine apply(self)
      class(contact_block_t), intent(inout) :: self
      real(real32) :: change(3, self%columns), dx_t(2, self%columns)
      real(wp) :: unit
      integer :: a, n

      n = self%columns
      self%last_change = 0.0_wp
      if (n == 0) return
      unit = max(maxval(abs(self%dx(2:3, :n))), tiny(1.0_wp))
      dx_t = real(self%dx(2:3, :n)/unit, real32)
      change = 0.0_real32
      call add_product_single(3*n, 2*n, self%M_single, size(self%M_single, 1), dx_t, change)
      self%trial(:, :n) = self%trial(:, :n) + unit*change
      self%last_change = unit*maxval(abs(change))
      do a = 1, n
         if (self%dx(1, a) == 0.0_wp) cycle
         call add_product(3*n, 1, self%M_n(1, a), size(self%M_n, 1), self%dx(1, a), self%trial)
      end do
      self%x(:, :n) = self%x(:, :n) + self%dx(:, :n)
   end subroutine apply

   !> What other groups feel of increments: Z^T x, (rank).
   function outgoing(self, x) result(c)
      class(contact_block_t), intent(in) :: self
      !> (3, columns) m, or more
      real(wp), intent(in), contiguous :: x(:, :)
      real(wp) :: c(size(self%basis, 2))

      c = 0.0_wp
      call add_product(size(c), 3*self%columns, self%basis_t, size(c), x, c)
   end function outgoing

   !> trial = trial + Z incoming in rows `first` to `last`.
   subroutine add_incoming(self, incoming, first, last)
      class(contact_block_t), intent(inout) :: self
      !> (rank) N
      real(wp), intent(in) :: incoming(:)
      integer, intent(in) :: first, last

      if (last < first .or. size(incoming) == 0) return
      call add_product(3*(last - first + 1), size(incoming), self%basis(3*first - 2, 1), size(self%basis, 1), incoming, &
         & self%trial(:, first:last))
   end subroutine add_incoming

   !> States of all columns from their trial forces and increments (unless they are held), what the laws miss, and the
   !> largest of it: open points have a force, closed ones a gap, sticking ones slip, the others are off the rim.
   subroutine assess(self, changed, hold)
      class(contact_block_t), intent(inout) :: self
      !> Becomes true where a state changes
      logical, intent(inout) :: changed
      logical, intent(in) :: hold
      real(wp) :: square, augmented, length, w(2)
      integer :: a, state

      square = 0.0_wp
      do a = 1, self%columns
         associate (force => self%trial(:, a), missed => self%violation(:, a))
            augmented = force(1) - self%stiffness_n(a)*(self%gap_old(a) + self%x(1, a))
            w = force(2:3) - self%stiffness_t(a)*self%x(2:3, a)
            length = sqrt(w(1)**2 + w(2)**2)
            state = state_open
            if (hold) then
               state = self%status(a)
            else if (augmented > 0.0_wp .and. .not. self%forced_open(a)) then
               state = state_stick
               if (length > self%friction(a)*augmented) state = state_slip
            end if
            changed = changed .or. state /= self%status(a)
            self%status(a) = state
            missed = force
            if (state /= state_open) then
               missed(1) = force(1) - augmented
               if (state == state_slip) w = w*(self%friction(a)*max(0.0_wp, force(1))/max(length, tiny(1.0_wp)))
               missed(2:3) = force(2:3) - w
            end if
            square = max(square, missed(1)**2, missed(2)**2 + missed(3)**2)
         end associate
      end do
      self%residual = sqrt(square)
   end subroutine assess

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
      self%stiffness_n = [self%stiffness_n(:m), spread(0.0_wp, 1, room - m)]
      self%stiffness_t = [self%stiffness_t(:m), spread(0.0_wp, 1, room - m)]
      self%gap_old = [self%gap_old(:m), spread(0.0_wp, 1, room - m)]
      self%forced_open = [self%forced_open(:m), spread(.false., 1, room - m)]
      self%status = [self%status(:m), spread(state_stick, 1, room - m)]
      call widen(self%x, 3, m, 3, room)
      call widen(self%dx, 3, m, 3, room)
      call widen(self%violation, 3, m, 3, room)
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
