!> The state that the condensed solver counts from: forces and gaps of all points follow from it and from the few
!> gap increments since.
!>
!>     force = force_ref + S (q - q_ref) + M moved,     gap outside = gap_ref + N (q - q_ref) + T moved
!> What a step must know of all points follows from sums over those that moved. With y = gap - r_0 on the base set:
!>     R^T force       = stiffness q - h,                    h = S^T y
!>     force^T G force = c + 2 q^T h - q^T stiffness q,      c = y^T M y
!> Where the problem keeps soft directions apart, y = gap - r_0 - V z_0, and h and c are those of G + V V^T and R + V D.
module microslip_contact_reference
   use microslip_contact_base_set, only: base_set_t
   use microslip_contact_block, only: contact_block_t
   use microslip_contact_problem, only: contact_problem_t, contact_state_t, solve_record_t
   use microslip_core_kinds, only: wp
   use microslip_linalg_dense, only: add_dots, product_symmetric
   implicit none(type, external)
   private

   public :: reference_t, moves_t

   type :: reference_t
      !> (3, inside) N and (outside) m
      real(wp), allocatable :: force(:, :), gap(:)
      !> (drivers)
      real(wp), allocatable :: q(:)
      !> (3, inside) gap increments since, m
      real(wp), allocatable :: moved(:, :)
      !> (inside)
      logical, allocatable :: has_moved(:)
      !> h for drivers and outputs, and c
      real(wp), allocatable, private :: h(:), h_output(:)
      real(wp), private :: c = 0.0_wp
   contains
      procedure :: take
      procedure :: move_up
      procedure :: moves
      procedure :: force_of
      procedure :: gap_outside
      procedure :: everywhere
      procedure :: add
      procedure :: report
   end type reference_t

   !> By how much the base points moved since the reference.
   type :: moves_t
      !> (3 inside) m
      real(wp), allocatable :: x(:)
      !> First and last unknown of the runs of points outside of which x = 0
      integer, allocatable :: first(:), last(:)
      !> (drivers) q - q_ref
      real(wp), allocatable :: dq(:)
   end type moves_t

   !> So many points at rest between two that moved do not end a run.
   integer, parameter :: bridged = 4

contains

   !> Count from this state, from the definition: force = M (gap - r_0 - R q).
   subroutine take(self, problem, base, state)
      class(reference_t), intent(inout) :: self
      type(contact_problem_t), intent(in) :: problem
      type(base_set_t), intent(in) :: base
      !> Its gaps in the base set must be up to its driver
      type(contact_state_t), intent(in) :: state
      real(wp), allocatable :: y(:), My(:), force(:)
      integer :: j, p, n

      n = size(base%inside)
      allocate (y(3*n), My(3*n))
      do j = 1, n
         p = base%inside(j)
         y(3*j - 2:3*j) = state%gap(:, p) - problem%r_0(3*p - 2:3*p)
      end do
      call product_symmetric(base%M, y, My)
      force = matmul(state%q, base%slope)
      self%force = reshape(force + My, [3, n])
      self%gap = problem%r_0(3*base%outside - 2) + matmul(state%q, base%slope_outside)
      self%gap = self%gap + matmul(y, base%T_t)
      self%q = state%q
      self%h = matmul(base%slope, y)
      self%h_output = matmul(base%output_slope, y)
      self%c = dot_product(y, My)
      if (size(base%soft, 2) > 0) call shift_by_soft(self, problem, base, y)
      if (allocated(self%moved)) deallocate (self%moved, self%has_moved)
      allocate (self%moved(3, n), source=0.0_wp)
      allocate (self%has_moved(n), source=.false.)
   end subroutine take

   !> The part of y that is -V z_0.
   subroutine shift_by_soft(self, problem, base, y)
      type(reference_t), intent(inout) :: self
      type(contact_problem_t), intent(in) :: problem
      type(base_set_t), intent(in) :: base
      !> (3 inside) gap - r_0, m
      real(wp), intent(in) :: y(:)

      associate (z_0 => problem%soft_0)
         self%force = self%force - reshape(matmul(base%soft, z_0), shape(self%force))
         self%gap = self%gap + matmul(z_0, base%soft_outside)
         self%h = self%h - matmul(z_0, base%soft_slope)
         self%h_output = self%h_output - matmul(base%output_soft, z_0)
         self%c = self%c - 2.0_wp*dot_product(z_0, matmul(y, base%soft)) + dot_product(z_0, z_0 - matmul(base%soft_rest, z_0))
      end associate
   end subroutine shift_by_soft

   !> Count from the present on: forces and gaps as they are at driver q, nothing has moved.
   subroutine move_up(self, q, force, gap)
      class(reference_t), intent(inout) :: self
      real(wp), intent(in) :: q(:)
      !> (3, inside) N and (outside) m
      real(wp), intent(in) :: force(:, :), gap(:)

      self%q = q
      self%force = force
      self%gap = gap
      self%moved = 0.0_wp
      self%has_moved = .false.
   end subroutine move_up

   !> What moved since, up to a driver, with the increments of the present step (in the blocks) or without.
   function moves(self, q, blocks) result(list)
      class(reference_t), intent(in) :: self
      real(wp), intent(in) :: q(:)
      type(contact_block_t), intent(in), optional :: blocks(:)
      type(moves_t) :: list
      logical :: moved(size(self%has_moved))
      integer :: first(size(moved)), last(size(moved))
      integer :: a, g, j, runs

      list%x = reshape(self%moved, [size(self%moved)])
      list%dq = q - self%q
      moved = self%has_moved
      if (present(blocks)) then
         do g = 1, size(blocks)
            do a = 1, blocks(g)%columns
               j = blocks(g)%place(a)
               list%x(3*j - 2:3*j) = list%x(3*j - 2:3*j) + blocks(g)%x(:, a)
               moved(j) = .true.
            end do
         end do
      end if
      runs = 0
      do j = 1, size(moved)
         if (.not. moved(j)) cycle
         if (runs > 0) then
            if (3*j - 2 - last(runs) <= 3*bridged) then
               last(runs) = 3*j
               cycle
            end if
         end if
         runs = runs + 1
         first(runs) = 3*j - 2
         last(runs) = 3*j
      end do
      list%first = first(:runs)
      list%last = last(:runs)
   end function moves

   !> Force of a point of the base set after moves, N.
   pure function force_of(self, base, place, moves) result(force)
      class(reference_t), intent(in) :: self
      type(base_set_t), intent(in) :: base
      !> Its place in the base set
      integer, intent(in) :: place
      type(moves_t), intent(in) :: moves
      real(wp) :: force(3)
      integer :: i, k

      k = 3*place - 2
      force = self%force(:, place)
      call add_dots(size(moves%dq), base%slope(1, k), size(base%slope, 1), moves%dq, force)
      do i = 1, size(moves%first)
         ! M is symmetric: the column of the point is its row.
         call add_dots(moves%last(i) - moves%first(i) + 1, base%M(moves%first(i), k), size(base%M, 1), &
            & moves%x(moves%first(i)), force)
      end do
   end function force_of

   !> Normal gap of a point outside the base set after moves, m.
   pure real(wp) function gap_outside(self, base, place, moves)
      class(reference_t), intent(in) :: self
      type(base_set_t), intent(in) :: base
      !> Its place among the points outside
      integer, intent(in) :: place
      type(moves_t), intent(in) :: moves
      real(wp) :: gap(1)
      integer :: i

      gap = self%gap(place)
      call add_dots(size(moves%dq), base%slope_outside(1, place), size(base%slope_outside, 1), moves%dq, gap)
      do i = 1, size(moves%first)
         call add_dots(moves%last(i) - moves%first(i) + 1, base%T_t(moves%first(i), place), size(base%T_t, 1), &
            & moves%x(moves%first(i)), gap)
      end do
      gap_outside = gap(1)
   end function gap_outside

   !> Forces of all points of the base set and gaps of all outside.
   subroutine everywhere(self, base, q, force, gap)
      class(reference_t), intent(in) :: self
      type(base_set_t), intent(in) :: base
      real(wp), intent(in) :: q(:)
      !> (3, inside) N and (outside) m
      real(wp), allocatable, intent(out) :: force(:, :), gap(:)
      real(wp) :: x(3*size(self%has_moved)), work(3*size(self%has_moved))
      integer :: k

      x = reshape(self%moved, [size(x)])
      work = matmul(q - self%q, base%slope)
      gap = self%gap + matmul(q - self%q, base%slope_outside)
      if (any(self%has_moved)) then
         do k = 1, size(x)
            if (x(k) /= 0.0_wp) work = work + base%M(:, k)*x(k)
         end do
         gap = gap + matmul(x, base%T_t)
      end if
      force = self%force + reshape(work, shape(self%force))
   end subroutine everywhere

   !> Count in what the columns of a block move in a step; their forces before and after belong to q_before and q.
   subroutine add(self, base, block, q_before, q)
      class(reference_t), intent(inout) :: self
      type(base_set_t), intent(in) :: base
      !> Its forces are those before the step, its trial forces those after it
      type(contact_block_t), intent(in) :: block
      real(wp), intent(in) :: q_before(:), q(:)
      real(wp) :: dh(size(q))
      integer :: a, c, k

      dh = 0.0_wp
      do a = 1, block%columns
         do c = 1, 3
            if (block%x(c, a) == 0.0_wp) cycle
            k = 3*block%place(a) - 3 + c
            dh(:) = dh + base%slope(:, k)*block%x(c, a)
            self%h_output(:) = self%h_output + base%output_slope(:, k)*block%x(c, a)
            ! M y = force - S q, and the change of y^T M y is x^T (M y before + M y after).
            self%c = self%c + block%x(c, a)*(block%force(c, a) + block%trial(c, a))
         end do
         if (all(block%x(:, a) == 0.0_wp)) cycle
         self%moved(:, block%place(a)) = self%moved(:, block%place(a)) + block%x(:, a)
         self%has_moved(block%place(a)) = .true.
      end do
      self%h = self%h + dh
      self%c = self%c - dot_product(dh, q_before + q)
   end subroutine add

   !> Reaction, outputs and energy at a driver.
   subroutine report(self, base, q, record)
      class(reference_t), intent(in) :: self
      type(base_set_t), intent(in) :: base
      real(wp), intent(in) :: q(:)
      type(solve_record_t), intent(inout) :: record

      record%reaction = matmul(base%stiffness, q) - self%h
      record%output = matmul(base%output_stiffness, q) - self%h_output
      record%contact_energy = 0.5_wp*(self%c + dot_product(q, self%h - record%reaction))
   end subroutine report

end module microslip_contact_reference
