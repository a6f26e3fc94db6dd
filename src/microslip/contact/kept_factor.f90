!> The Jacobian of the contact laws on the moving points, factorised once and kept while the points change.
!>
!> Unknowns: two slips of a slipping point, three increments of an open one. With w = force_t - k slip,
!> direction = w/|w| and rim = beta (I - direction direction^T), beta = mu force_n/|w| (at most 1):
!>     slipping   J = M_t - rim M_t - mu direction M_n + k rim        open   J = M
!> A factor in single precision is enough: the residual, in double, decides. Unknowns that came or went since
!> the factorisation border it (their Schur complement), until so many have that a new factor is cheaper.
module microslip_contact_kept_factor
   use, intrinsic :: iso_fortran_env, only: real32
   use microslip_contact_block, only: contact_block_t
   use microslip_contact_laws, only: state_open, state_slip
   use microslip_core_kinds, only: wp
   use microslip_linalg_dense, only: factor_single, solve_single
   implicit none(type, external)
   private

   public :: kept_factor_t

   !> An unknown is code = 5 (column - 1) + kind, kinds 1, 2: slip; 3, 4, 5: increments of an open point.
   integer, parameter :: kinds = 5

   type :: kept_factor_t
      logical :: exists = .false., fresh = .false.
      !> Codes of the factorised unknowns, and of the border: code > 0 came, -(place in `codes`) went
      integer, allocatable, private :: codes(:), border(:)
      real(real32), allocatable, private :: lu(:, :)
      integer, allocatable, private :: pivot(:)
      !> (factorised, border) J^-1 times the border's columns; (border, factorised) its rows; Schur complement
      real(real32), allocatable, private :: right(:, :), below(:, :), schur(:, :), schur_factor(:, :)
      integer, allocatable, private :: schur_pivot(:)
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
      self%fresh = .false.
      do a = 1, block%columns
         if (block%status(a) /= state_slip) cycle
         w = block%trial(2:3, a) - block%stiffness_t(a)*block%x_t(:, a)
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
            n = n + 3
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
      if (4*size(border) > n + 32 .or. size(border) > 120) then
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

   !> Factorise for the present states and linearisation.
   subroutine rebuild(self, block, singular)
      class(kept_factor_t), intent(inout) :: self
      type(contact_block_t), intent(in) :: block
      logical, intent(out) :: singular
      integer :: n

      self%codes = unknowns_of(block)
      self%border = [integer ::]
      n = size(self%codes)
      if (allocated(self%lu)) then
         if (size(self%lu, 1) < n) deallocate (self%lu, self%pivot)
      end if
      if (.not. allocated(self%lu)) allocate (self%lu(n + n/2 + 16, n + n/2 + 16), self%pivot(n + n/2 + 16))
      call fill_jacobian(self, block, self%codes, self%codes, self%lu)
      call factor_single(n, self%lu, self%pivot, singular)
      self%exists = .not. singular
      self%fresh = .true.
   end subroutine rebuild

   !> J between the unknowns `rows` and `columns`, into the leading part of `J`.
   subroutine fill_jacobian(self, block, rows, columns, J)
      type(kept_factor_t), intent(in) :: self
      type(contact_block_t), intent(in) :: block
      integer, intent(in) :: rows(:), columns(:)
      real(real32), intent(inout) :: J(:, :)
      real(wp) :: tangential(2), along, factor
      integer :: i, k, a, b, r

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
               J(i:i + 2, k) = real(M(r:r + 2), real32)
               i = i + 3
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
      real(real32), allocatable :: right(:, :), below(:, :), schur(:, :), part(:, :)
      integer, allocatable :: came(:), rows(:)
      integer :: n, m, k

      n = size(self%codes)
      m = size(border)
      allocate (right(n, m), below(m, n), schur(m, m), source=0.0_real32)
      if (kept > 0) then
         right(:, :kept) = self%right
         below(:kept, :) = self%below
         schur(:kept, :kept) = self%schur
      end if
      rows = pack([(k, k=kept + 1, m)], border(kept + 1:) > 0)
      came = border(rows)
      allocate (part(max(n, m), max(n, m)))
      call fill_jacobian(self, block, self%codes, came, part)
      right(:, rows) = part(:n, :size(came))
      call fill_jacobian(self, block, came, self%codes, part)
      below(rows, :) = part(:size(came), :n)
      call fill_jacobian(self, block, came, came, part)
      schur(rows, rows) = part(:size(came), :size(came))
      if (kept > 0) then
         associate (old => pack(border(:kept), border(:kept) > 0), place => pack([(k, k=1, kept)], border(:kept) > 0))
            call fill_jacobian(self, block, old, came, part)
            schur(place, rows) = part(:size(old), :size(came))
            call fill_jacobian(self, block, came, old, part)
            schur(rows, place) = part(:size(came), :size(old))
         end associate
      end if
      do k = kept + 1, m
         if (border(k) > 0) cycle
         right(-border(k), k) = 1.0_real32
         below(k, -border(k)) = 1.0_real32
      end do
      call solve_single(n, m - kept, self%lu, self%pivot, right(:, kept + 1:))
      schur(:, kept + 1:) = schur(:, kept + 1:) - matmul(below, right(:, kept + 1:))
      schur(kept + 1:, :kept) = schur(kept + 1:, :kept) - matmul(below(kept + 1:, :), right(:, :kept))
      self%schur_factor = schur
      if (allocated(self%schur_pivot)) deallocate (self%schur_pivot)
      allocate (self%schur_pivot(m))
      call factor_single(m, self%schur_factor, self%schur_pivot, singular)
      self%border = border
      call move_alloc(right, self%right)
      call move_alloc(below, self%below)
      call move_alloc(schur, self%schur)
      if (singular) self%exists = .false.
   end subroutine extend_border

   !> Increments dx with J dx = -residual: slipping points dx_t, open points dx_n and dx_t.
   subroutine solve(self, residual, dx_n, dx_t)
      class(kept_factor_t), intent(in) :: self
      !> (3, columns) N
      real(wp), intent(in) :: residual(:, :)
      !> (columns) and (2, columns) m: zero where nothing is unknown
      real(wp), intent(out) :: dx_n(:), dx_t(:, :)
      real(real32) :: x(size(self%codes), 1), z(size(self%border), 1)
      real(wp) :: scale
      integer :: n, m, k

      dx_n = 0.0_wp
      dx_t = 0.0_wp
      n = size(self%codes)
      m = size(self%border)
      ! Single precision has a short range of exponents: solve for a residual of order one.
      scale = max(maxval(abs(residual)), tiny(1.0_wp))
      do k = 1, n
         x(k, 1) = entry(self%codes(k))
      end do
      call solve_single(n, 1, self%lu, self%pivot, x)
      if (m > 0) then
         do k = 1, m
            z(k, 1) = 0.0_real32
            if (self%border(k) > 0) z(k, 1) = entry(self%border(k))
         end do
         z(:, 1) = z(:, 1) - matmul(self%below, x(:, 1))
         call solve_single(m, 1, self%schur_factor, self%schur_pivot, z)
         x(:, 1) = x(:, 1) - matmul(self%right, z(:, 1))
         do k = 1, m
            if (self%border(k) > 0) call put(self%border(k), z(k, 1))
            if (self%border(k) < 0) x(-self%border(k), 1) = 0.0_real32
         end do
      end if
      do k = 1, n
         call put(self%codes(k), x(k, 1))
      end do

   contains

      pure real(real32) function entry(code)
         integer, intent(in) :: code
         integer :: a
         a = (code - 1)/kinds + 1
         select case (mod(code - 1, kinds) + 1)
         case (1, 4)
            entry = -real(residual(2, a)/scale, real32)
         case (2, 5)
            entry = -real(residual(3, a)/scale, real32)
         case default
            entry = -real(residual(1, a)/scale, real32)
         end select
      end function entry

      subroutine put(code, value)
         integer, intent(in) :: code
         real(real32), intent(in) :: value
         integer :: a
         if (value == 0.0_real32) return
         a = (code - 1)/kinds + 1
         select case (mod(code - 1, kinds) + 1)
         case (1, 4)
            dx_t(1, a) = dx_t(1, a) + real(value, wp)*scale
         case (2, 5)
            dx_t(2, a) = dx_t(2, a) + real(value, wp)*scale
         case default
            dx_n(a) = dx_n(a) + real(value, wp)*scale
         end select
      end subroutine put

   end subroutine solve

end module microslip_contact_kept_factor
