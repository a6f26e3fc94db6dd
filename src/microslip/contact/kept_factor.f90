!> The Jacobian of the contact laws on the moving points, inverted once and kept while the points change.
!>
!> Unknowns: two slips of a slipping point, three increments of an open one, or the normal one alone where there is no
!> friction. With w = force_t - k slip, direction = w/|w| and rim = beta (I - direction direction^T),
!> beta = mu force_n/|w| (at most 1):
!>     slipping   J = M_t - rim M_t - mu direction M_n + k rim        open   J = M
!> An inverse in single precision is enough: the residual, in double, decides; and a product with it, unlike two
!> triangular solves, runs at the speed of memory. Unknowns that came or went since border it (their Schur
!> complement), until so many have that a new inverse is cheaper.
module microslip_contact_kept_factor
   use, intrinsic :: iso_fortran_env, only: real32
   use microslip_contact_block, only: contact_block_t
   use microslip_contact_laws, only: state_open, state_slip
   use microslip_core_kinds, only: wp
   use microslip_linalg_dense, only: add_product_single, inverse_single, product_single
   implicit none(type, external)
   private

   public :: kept_factor_t

   !> An unknown is code = 5 (column - 1) + kind, kinds 1, 2: slip; 3, 4, 5: increments of an open point.
   integer, parameter :: kinds = 5

   type :: kept_factor_t
      logical :: exists = .false.
      !> Codes of the inverted unknowns, and of the border: code > 0 came, -(place in `codes`) went
      integer, allocatable, private :: codes(:), border(:)
      !> Places of the inverted unknowns among the increments
      integer, allocatable, private :: entries(:)
      !> J^-1
      real(real32), allocatable, private :: inverse(:, :)
      !> (inverted, border) J^-1 times the border's columns; (border, inverted) its rows; inverse of its Schur complement
      real(real32), allocatable, private :: right(:, :), below(:, :), schur_inverse(:, :)
      !> (2, columns), (columns) linearisation of the laws
      real(wp), allocatable, private :: direction(:, :), beta(:)
   contains
      procedure :: drop
      procedure :: linearise
      procedure :: follow
      procedure :: rebuild
      procedure :: solve
   end type kept_factor_t

contains

   !> Forget the factor.
   pure subroutine drop(self)
      class(kept_factor_t), intent(inout) :: self
      self%exists = .false.
   end subroutine drop

   !> Directions and radii of the slipping points at the block's present forces.
   subroutine linearise(self, block)
      class(kept_factor_t), intent(inout) :: self
      type(contact_block_t), intent(in) :: block
      real(wp) :: w(2), length
      integer :: a

      if (allocated(self%beta)) then
         if (size(self%beta) < block%columns) deallocate (self%beta, self%direction)
      end if
      if (.not. allocated(self%beta)) allocate (self%beta(2*block%columns), self%direction(2, 2*block%columns), &
         & source=0.0_wp)
      do a = 1, block%columns
         if (block%status(a) /= state_slip) cycle
         w = block%trial(2:3, a) - block%stiffness_t(a)*block%x(2:3, a)
         length = max(norm2(w), tiny(1.0_wp))
         self%direction(:, a) = w/length
         self%beta(a) = min(1.0_wp, block%friction(a)*max(0.0_wp, block%trial(1, a))/length)
      end do
   end subroutine linearise

   !> Unknowns that the states ask for.
   pure function unknowns_of(block) result(codes)
      type(contact_block_t), intent(in) :: block
      integer, allocatable :: codes(:)
      integer :: list(3*block%columns)
      integer :: a, n

      n = 0
      do a = 1, block%columns
         if (block%status(a) == state_slip) then
            list(n + 1:n + 2) = kinds*(a - 1) + [1, 2]
            n = n + 2
         else if (block%status(a) == state_open) then
            list(n + 1:n + 3) = kinds*(a - 1) + [3, 4, 5]
            n = n + merge(3, 1, block%friction(a) > 0.0_wp)
         end if
      end do
      codes = list(:n)
   end function unknowns_of

   !> Make the factor fit the states, by its border or anew. `linearise` comes first.
   subroutine follow(self, block, singular)
      class(kept_factor_t), intent(inout) :: self
      type(contact_block_t), intent(in) :: block
      logical, intent(out) :: singular
      integer, allocatable :: wanted(:), border(:), place(:)
      logical, allocatable :: is_wanted(:)
      integer :: k, n

      singular = .false.
      if (.not. self%exists) then
         call self%rebuild(block, singular)
         return
      end if
      wanted = unknowns_of(block)
      allocate (is_wanted(kinds*block%columns), source=.false.)
      allocate (place(kinds*block%columns), source=0)
      is_wanted(wanted) = .true.
      place(self%codes) = [(k, k=1, size(self%codes))]
      border = [pack(wanted, place(wanted) == 0), -pack([(k, k=1, size(self%codes))],.not. is_wanted(self%codes))]
      n = size(self%codes)
      if (4*size(border) > n + 32) then
         call self%rebuild(block, singular)
         return
      end if
      ! Entries that are still right stay, in their order; the rest is appended.
      if (all([(any(border == self%border(k)), k=1, size(self%border))])) then
         border = [self%border, pack(border, [(all(self%border /= border(k)), k=1, size(border))])]
         if (size(border) > size(self%border)) call extend_border(self, block, border, size(self%border), singular)
      else
         call extend_border(self, block, border, 0, singular)
      end if
   end subroutine follow

   !> Invert for the present states and linearisation.
   subroutine rebuild(self, block, singular)
      class(kept_factor_t), intent(inout) :: self
      type(contact_block_t), intent(in) :: block
      logical, intent(out) :: singular

      self%codes = unknowns_of(block)
      self%entries = entry_of(self%codes)
      self%border = [integer ::]
      call fill_jacobian(self, block, self%codes, self%codes, self%inverse)
      call inverse_single(self%inverse, singular)
      self%exists = .not. singular
   end subroutine rebuild

   !> J between the unknowns `rows` and `columns`; J is allocated where its shape is another.
   subroutine fill_jacobian(self, block, rows, columns, J)
      type(kept_factor_t), intent(in) :: self
      type(contact_block_t), intent(in) :: block
      integer, intent(in) :: rows(:), columns(:)
      real(real32), allocatable, intent(inout) :: J(:, :)
      real(wp) :: tangential(2), along, factor
      integer :: i, k, a, b, r, n

      if (allocated(J)) then
         if (any(shape(J) /= [size(rows), size(columns)])) deallocate (J)
      end if
      if (.not. allocated(J)) allocate (J(size(rows), size(columns)))
      do k = 1, size(columns)
         b = (columns(k) - 1)/kinds + 1
         select case (mod(columns(k) - 1, kinds) + 1)
         case (3)
            call fill_column(block%M_n(:, b), 0)
         case (1, 4)
            call fill_column(block%M_t(:, 2*b - 1), 1)
         case (2, 5)
            call fill_column(block%M_t(:, 2*b), 2)
         end select
      end do

   contains

      !> One column from the column of M; `component` is 1 or 2 for a tangential increment.
      subroutine fill_column(M, component)
         real(wp), intent(in) :: M(:)
         integer, intent(in) :: component

         i = 1
         do while (i <= size(rows))
            a = (rows(i) - 1)/kinds + 1
            r = 3*a - 2
            select case (mod(rows(i) - 1, kinds) + 1)
            case (1)
               tangential = M(r + 1:r + 2)
               along = dot_product(self%direction(:, a), tangential)
               factor = self%beta(a)*along - block%friction(a)*M(r)
               tangential = (1.0_wp - self%beta(a))*tangential + factor*self%direction(:, a)
               if (a == b .and. component > 0) then
                  tangential = tangential - block%stiffness_t(a)*self%beta(a)*self%direction(component, a)*self%direction(:, a)
                  tangential(component) = tangential(component) + block%stiffness_t(a)*self%beta(a)
               end if
               J(i:i + 1, k) = real(tangential, real32)
               i = i + 2
            case (3)
               ! Without friction the normal increment is alone.
               n = merge(3, 1, block%friction(a) > 0.0_wp)
               J(i:i + n - 1, k) = real(M(r:r + n - 1), real32)
               i = i + n
            end select
         end do
      end subroutine fill_column

   end subroutine fill_jacobian

   !> Border the factor by the unknowns that came and went; the first `kept` entries of the border are there already.
   subroutine extend_border(self, block, border, kept, singular)
      class(kept_factor_t), intent(inout) :: self
      type(contact_block_t), intent(in) :: block
      integer, intent(in) :: border(:), kept
      logical, intent(out) :: singular
      real(real32), allocatable :: right(:, :), below(:, :), new_right(:, :), new_below(:, :), S_12(:, :), S_21(:, :), &
         & S_22(:, :), part(:, :)
      integer, allocatable :: came(:), old(:), place(:), rows(:)
      integer :: n, m, k

      n = size(self%codes)
      m = size(border) - kept
      ! New columns and rows of the bordered matrix: what came has its own, what went has a unit vector.
      allocate (new_right(n, m), new_below(m, n), S_12(kept, m), S_21(m, kept), S_22(m, m), source=0.0_real32)
      rows = pack([(k, k=1, m)], border(kept + 1:) > 0)
      came = border(kept + rows)
      call fill_jacobian(self, block, self%codes, came, part)
      new_right(:, rows) = part
      call fill_jacobian(self, block, came, self%codes, part)
      new_below(rows, :) = part
      call fill_jacobian(self, block, came, came, part)
      S_22(rows, rows) = part
      place = pack([(k, k=1, kept)], border(:kept) > 0)
      old = border(place)
      call fill_jacobian(self, block, old, came, part)
      S_12(place, rows) = part
      call fill_jacobian(self, block, came, old, part)
      S_21(rows, place) = part
      do k = 1, m
         if (border(kept + k) > 0) cycle
         new_right(-border(kept + k), k) = 1.0_real32
         new_below(k, -border(kept + k)) = 1.0_real32
      end do
      new_right = product_single(self%inverse, new_right)
      S_22 = S_22 - product_single(new_below, new_right)
      if (kept == 0) then
         call move_alloc(new_right, self%right)
         call move_alloc(new_below, self%below)
         call move_alloc(S_22, self%schur_inverse)
         call inverse_single(self%schur_inverse, singular)
      else
         S_12 = S_12 - product_single(self%below, new_right)
         S_21 = S_21 - product_single(new_below, self%right)
         call extend_inverse(self%schur_inverse, S_12, S_21, S_22, singular)
         allocate (right(n, kept + m), below(kept + m, n))
         right(:, :kept) = self%right
         right(:, kept + 1:) = new_right
         below(:kept, :) = self%below
         below(kept + 1:, :) = new_below
         call move_alloc(right, self%right)
         call move_alloc(below, self%below)
      end if
      self%border = border
      if (singular) self%exists = .false.
   end subroutine extend_border

   !> The inverse of [S_11 S_12; S_21 S_22] from that of S_11.
   subroutine extend_inverse(inverse, S_12, S_21, S_22, singular)
      real(real32), allocatable, intent(inout) :: inverse(:, :)
      real(real32), intent(in), contiguous :: S_12(:, :), S_21(:, :)
      !> Becomes the lower right part of the inverse
      real(real32), intent(inout), contiguous :: S_22(:, :)
      logical, intent(out) :: singular
      real(real32), allocatable :: larger(:, :), U(:, :), V(:, :), UT(:, :)
      integer :: n, m

      n = size(S_12, 1)
      m = size(S_12, 2)
      U = product_single(inverse, S_12)
      V = product_single(S_21, inverse)
      S_22 = S_22 - product_single(S_21, U)
      call inverse_single(S_22, singular)
      if (singular) return
      UT = product_single(U, S_22)
      allocate (larger(n + m, n + m))
      larger(:n, :n) = inverse + product_single(UT, V)
      larger(:n, n + 1:) = -UT
      larger(n + 1:, :n) = -product_single(S_22, V)
      larger(n + 1:, n + 1:) = S_22
      call move_alloc(larger, inverse)
   end subroutine extend_inverse

   !> Increments dx with J dx = -violation: slipping points have tangential ones, open points all three.
   subroutine solve(self, columns, violation, dx)
      class(kept_factor_t), intent(in) :: self
      integer, intent(in) :: columns
      !> (3 columns) N
      real(wp), intent(in) :: violation(3*columns)
      !> (3 columns) m: zero where nothing is unknown
      real(wp), intent(out) :: dx(3*columns)
      real(real32) :: x(size(self%codes)), z(size(self%border))
      real(wp) :: scale
      integer :: n, m, k

      dx = 0.0_wp
      n = size(self%codes)
      m = size(self%border)
      if (columns == 0) return
      ! Single precision has a short range of exponents: solve for a violation of order one.
      scale = max(maxval(abs(violation)), tiny(1.0_wp))
      x = 0.0_real32
      call add_product_single(n, n, self%inverse, n, real(-violation(self%entries)/scale, real32), x)
      if (m > 0) then
         do k = 1, m
            z(k) = 0.0_real32
            if (self%border(k) > 0) z(k) = -real(violation(entry_of(self%border(k)))/scale, real32)
         end do
         z = matmul(self%schur_inverse, z - matmul(self%below, x))
         call add_product_single(n, m, self%right, n, -z, x)
         do k = 1, m
            if (self%border(k) < 0) x(-self%border(k)) = 0.0_real32
         end do
      end if
      ! An unknown may be there twice: gone from the inverse, and back in the border.
      dx(self%entries) = x*scale
      do k = 1, m
         if (self%border(k) > 0) dx(entry_of(self%border(k))) = dx(entry_of(self%border(k))) + z(k)*scale
      end do
   end subroutine solve

   !> Place of an unknown among the three increments of all columns.
   elemental integer function entry_of(code)
      integer, intent(in) :: code
      integer, parameter :: component(kinds) = [2, 3, 1, 2, 3]

      entry_of = 3*((code - 1)/kinds) + component(mod(code - 1, kinds) + 1)
   end function entry_of

end module microslip_contact_kept_factor
