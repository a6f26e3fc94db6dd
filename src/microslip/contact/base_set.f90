!> The condensed operators on a base set of (mostly closed) contact points, METHOD section 5.
!>
!> With A the base set, M = G_AA^-1, S = -M R_A:
!>     force_A  = force_A,ref + S (q - q_ref) + M x          x: gap increments of the base points
!>     gap_n,o  = gap_n,o,ref + N (q - q_ref) + T x          o: points outside, whose force is zero
!>     R_A^T force_A = stiffness q - S^T y                   y = gap_A - r_0,A, stiffness = R_A^T S
!> with T = G_n,oA M and N = R_n,o + G_n,oA S. S, N and T are kept by point (transposed).
!>
!> Soft directions of the problem (G + V V^T in place of G, R + V D in place of R) go through their own small matrices, for
!> their digits are not those of G. With M_0 = G_AA^-1:
!>     H = (I + V_A^T M_0 V_A)^-1,    M V_A = M_0 V_A H,    M = M_0 - M V_A (M_0 V_A)^T,    V_A^T M V_A = I - H
!>     E = V_o^T - V_A^T T^T = H V_o^T - (M V_A)^T G_A,o
!> No difference of large numbers is left in what follows from them, however soft the directions are.
!>
!> Points enter by bordering M with their Schur complement and
!> leave by the reverse; both keep M symmetric, and where a probe finds it inaccurate M is factorised anew.
!>
!> Points without friction carry normal forces alone: G_AA^-1 is that of the unknowns that can carry force, and the
!> tangential rows and columns of such points are zero in M, S, T^T and the output slopes.
!>
!> Groups (interfaces) are coupled in M by a low rank only: between groups g and h, M_gh = Z_g C_gh Z_h^T with an
!> orthonormal basis Z_g of what the other groups cause in g. Z_g is found by products with random vectors and
!> verified; where it does not pay, all points are one group.
module microslip_contact_base_set
   use, intrinsic :: iso_fortran_env, only: int64
   use microslip_contact_problem, only: contact_problem_t
   use microslip_core_error, only: error_t, failure
   use microslip_core_kinds, only: wp
   use microslip_core_text, only: to_text
   use microslip_linalg_dense, only: inverse_spd, mirror_upper, orthonormalise, product_of, product_symmetric
   implicit none(type, external)
   private

   public :: base_set_t

   !> Bordered operators are given up where they miss more than this, and ten times more than a factorisation.
   real(wp), parameter :: most_missed = 1.0e-11_wp
   !> Where even a factorisation misses more than this, G is as good as singular.
   real(wp), parameter :: singular_missed = 1.0e-8_wp
   !> Rows that are looked at to find out.
   integer, parameter :: probed_rows = 64
   !> Vectors per group that the coupling is first tried with.
   integer, parameter :: first_rank = 24

   type :: base_set_t
      !> Points of the base set and points outside it
      integer, allocatable :: inside(:), outside(:)
      !> (points) place of a point in `inside`, 0 if it is outside
      integer, allocatable :: place(:)
      !> (3 inside, 3 inside) N/m
      real(wp), allocatable :: M(:, :)
      !> (3 inside, outside) T^T
      real(wp), allocatable :: T_t(:, :)
      !> (drivers, 3 inside) S^T and (drivers, outside) N^T
      real(wp), allocatable :: slope(:, :), slope_outside(:, :)
      !> (outputs, 3 inside) -outputs_A^T M
      real(wp), allocatable :: output_slope(:, :)
      !> (outputs, directions) -outputs_A^T M V_A
      real(wp), allocatable :: output_soft(:, :)
      !> (drivers, drivers) R_A^T S and (outputs, drivers) outputs_A^T S
      real(wp), allocatable :: stiffness(:, :), output_stiffness(:, :)
      !> Number of groups, and (inside) the group of each point
      integer :: groups = 1
      integer, allocatable :: group(:)
      !> (3 inside, directions) M V_A; (directions, directions) H; (directions, outside) E; (directions, drivers) V_A^T S
      real(wp), allocatable :: soft(:, :), soft_rest(:, :), soft_outside(:, :), soft_slope(:, :)
      !> (rank, 3 inside) Z^T and (rank groups, rank groups) C, N/m
      real(wp), allocatable :: basis(:, :), coupling(:, :)
      !> What the operators of the last factorisation missed (`missed`)
      real(wp), private :: missed_at_first = 0.0_wp
   contains
      procedure :: build
      procedure :: enter
      procedure :: leave
   end type base_set_t

contains

   !> Factorise for the given base points. Where that fails the set stays as it was.
   subroutine build(self, problem, points, error)
      class(base_set_t), intent(inout) :: self
      type(contact_problem_t), intent(in) :: problem
      !> Points of the base set
      integer, intent(in) :: points(:)
      type(error_t), allocatable, intent(out) :: error
      real(wp), allocatable :: cross(:, :), M(:, :), soft(:, :), soft_rest(:, :)
      integer, allocatable :: rows(:)
      real(wp) :: missed_now

      rows = unknowns(points)
      M = problem%G(rows, rows)
      call invert_carrying(M, can_carry(problem, points), error)
      if (allocated(error)) then
         error%message = 'contact compliance G is not positive definite on the closed points: '//error%message
         return
      end if
      call soften(problem, rows, M, soft, soft_rest, error)
      if (allocated(error)) return
      missed_now = missed(M, soft, problem, points)
      if (.not. missed_now <= singular_missed) then
         call failure(error, 'contact compliance G is singular to working precision on the closed points: its inverse misses '// &
            & to_text(missed_now, 2)//' (at most '//to_text(singular_missed, 2)//' may be missed)')
         return
      end if
      self%missed_at_first = missed_now
      call partition(self, problem%n_points, points)
      call move_alloc(M, self%M)
      call move_alloc(soft, self%soft)
      call move_alloc(soft_rest, self%soft_rest)
      cross = problem%G(rows, 3*self%outside - 2)
      self%T_t = multiply(self%M, cross)
      if (size(self%soft, 2) > 0) then
         cross = problem%soft(3*self%outside - 2, :)
         call product_of(self%soft, cross, self%T_t, transpose_b=.true., keep=1.0_wp)
      end if
      call update_slopes(self, problem)
   end subroutine build

   !> M_0 becomes M, by the soft directions of the problem.
   subroutine soften(problem, rows, M, soft, soft_rest, error)
      type(contact_problem_t), intent(in) :: problem
      !> Unknowns of the base set
      integer, intent(in) :: rows(:)
      real(wp), intent(inout), contiguous :: M(:, :)
      !> M V_A and H; no directions where the problem has none
      real(wp), allocatable, intent(out) :: soft(:, :), soft_rest(:, :)
      type(error_t), allocatable, intent(out) :: error
      real(wp), allocatable :: V(:, :), stiff(:, :)
      integer :: k

      if (.not. allocated(problem%soft)) then
         allocate (soft(size(rows), 0), soft_rest(0, 0))
         return
      end if
      V = problem%soft(rows, :)
      stiff = multiply(M, V)
      soft_rest = matmul(transpose(V), stiff)
      do k = 1, size(soft_rest, 1)
         soft_rest(k, k) = soft_rest(k, k) + 1.0_wp
      end do
      call inverse_spd(soft_rest, error)
      if (allocated(error)) return
      soft = multiply(stiff, soft_rest)
      call product_of(soft, stiff, M, transpose_b=.true., factor=-1.0_wp, keep=1.0_wp)
      call mirror_upper(M)
   end subroutine soften

   !> Points join the base set (they are placed last, in the given order).
   subroutine enter(self, problem, points, error)
      class(base_set_t), intent(inout) :: self
      type(contact_problem_t), intent(in) :: problem
      integer, intent(in) :: points(:)
      type(error_t), allocatable, intent(out) :: error
      real(wp), allocatable :: cross(:, :), U(:, :), U_t(:, :), schur(:, :), US(:, :), M(:, :), T_t(:, :), border(:, :), &
         & V(:, :), left(:, :)
      integer, allocatable :: rows(:), new(:), kept(:)
      integer :: n, k, j

      if (4*size(points) > size(self%inside)) then
         call self%build(problem, [self%inside, points], error)
         return
      end if
      rows = unknowns(self%inside)
      new = unknowns(points)
      n = size(rows)
      k = size(new)
      cross = problem%G(rows, new)
      U = multiply(self%M, cross)
      if (size(self%soft, 2) > 0) then
         ! D = V_n H - G_nA M V_A: what is left of V_n when the base points hold still.
         V = problem%soft(new, :)
         left = matmul(V, self%soft_rest)
         U_t = matmul(transpose(cross), self%soft)
         schur = problem%G(new, new) - matmul(transpose(U), cross) - matmul(U_t, transpose(V)) + matmul(V, transpose(left - U_t))
         left = left - U_t
         call product_of(self%soft, V, U, transpose_b=.true., keep=1.0_wp)
         U_t = transpose(U)
      else
         U_t = transpose(U)
         schur = problem%G(new, new) - multiply(U_t, cross)
      end if
      schur = 0.5_wp*(schur + transpose(schur))
      call invert_carrying(schur, can_carry(problem, points), error)
      if (allocated(error)) then
         call self%build(problem, [self%inside, points], error)
         return
      end if
      US = multiply(U, schur)

      allocate (M(n + k, n + k))
      call product_of(US, U_t, self%M, keep=1.0_wp)
      M(:n, :n) = self%M
      M(:n, n + 1:) = -US
      M(n + 1:, n + 1:) = schur
      call mirror_upper(M)

      ! Columns of T^T for the points that stay outside.
      kept = pack([(j, j=1, size(self%outside))], [(all(points /= self%outside(j)), j=1, size(self%outside))])
      self%T_t = self%T_t(:, kept)
      border = transpose(cross)
      border = problem%G(new, 3*self%outside(kept) - 2) - multiply(border, self%T_t)
      if (size(self%soft, 2) > 0) border = border + matmul(V, self%soft_outside(:, kept))
      border = multiply(schur, border)
      allocate (T_t(n + k, size(kept)))
      T_t(:n, :) = self%T_t - multiply(U, border)
      T_t(n + 1:, :) = border

      call move_alloc(M, self%M)
      call move_alloc(T_t, self%T_t)
      if (size(self%soft, 2) > 0) then
         U_t = matmul(schur, left)
         V = self%soft - multiply(U, U_t)
         deallocate (self%soft)
         allocate (self%soft(n + k, size(V, 2)))
         self%soft(:n, :) = V
         self%soft(n + 1:, :) = U_t
         self%soft_rest = self%soft_rest - matmul(transpose(left), U_t)
      else
         deallocate (self%soft)
         allocate (self%soft(n + k, 0))
      end if
      call partition(self, problem%n_points, [self%inside, points])
      if (.not. is_accurate(self, problem)) then
         call self%build(problem, [self%inside], error)
         return
      end if
      call update_slopes(self, problem)
   end subroutine enter

   !> Points that are open leave the base set.
   subroutine leave(self, problem, points, error)
      class(base_set_t), intent(inout) :: self
      type(contact_problem_t), intent(in) :: problem
      integer, intent(in) :: points(:)
      type(error_t), allocatable, intent(out) :: error
      real(wp), allocatable :: W(:, :), own(:, :), cross(:, :), M(:, :), T_t(:, :), soft(:, :), held(:, :)
      integer, allocatable :: stay(:), gone(:), rows(:), outside(:)
      integer :: j, k

      stay = pack(self%inside, [(all(points /= self%inside(j)), j=1, size(self%inside))])
      if (4*size(points) > size(self%inside)) then
         call self%build(problem, stay, error)
         return
      end if
      gone = unknowns(self%place(points))
      rows = unknowns(self%place(stay))
      own = self%M(gone, gone)
      call invert_carrying(own, can_carry(problem, points), error)
      if (allocated(error)) then
         call self%build(problem, stay, error)
         return
      end if
      cross = self%M(gone, rows)
      W = multiply(own, cross)   ! = -G_gone,stay M_new
      cross = self%M(rows, gone)
      M = self%M(rows, rows)
      call product_of(cross, W, M, factor=-1.0_wp, keep=1.0_wp)
      call mirror_upper(M)
      soft = self%soft(rows, :)
      if (size(soft, 2) > 0) then
         held = matmul(own, self%soft(gone, :))
         soft = soft - multiply(cross, held)
         self%soft_rest = self%soft_rest + matmul(transpose(self%soft(gone, :)), held)
      end if
      call move_alloc(soft, self%soft)

      outside = self%outside
      k = size(outside)
      allocate (T_t(size(rows), k + size(points)))
      cross = transpose(W)
      own = self%T_t(gone, :)
      T_t(:, :k) = self%T_t(rows, :) - multiply(cross, own)
      do j = 1, size(points)
         T_t(:, k + j) = -W(3*j - 2, :)
      end do
      call move_alloc(M, self%M)
      call partition(self, problem%n_points, stay)
      if (.not. is_accurate(self, problem)) then
         call self%build(problem, stay, error)
         return
      end if
      ! `partition` lists the points outside in ascending order: sort the columns of T^T the same way.
      outside = [outside, points]
      self%T_t = T_t(:, order_of(outside, problem%n_points))
      call update_slopes(self, problem)
   end subroutine leave

   !> Whether M is as good as a new one, nearly.
   logical function is_accurate(self, problem)
      type(base_set_t), intent(in) :: self
      type(contact_problem_t), intent(in) :: problem
      is_accurate = missed(self%M, self%soft, problem, self%inside) <= max(most_missed, 10.0_wp*self%missed_at_first)
   end function is_accurate

   !> Largest |(G + V V^T)_AA M x - x| in some rows that can carry force, for an x without pattern and |x| <= 1.
   real(wp) function missed(M, soft, problem, points)
      !> (G + V V^T)_AA^-1, N/m
      real(wp), intent(in), contiguous :: M(:, :)
      !> M V_A
      real(wp), intent(in), contiguous :: soft(:, :)
      type(contact_problem_t), intent(in) :: problem
      !> A
      integer, intent(in) :: points(:)
      real(wp), allocatable :: x(:, :), Mx(:), along(:)
      integer, allocatable :: rows(:)
      logical, allocatable :: carries(:)
      real(wp) :: found
      integer :: k

      missed = 0.0_wp
      rows = unknowns(points)
      allocate (x(size(rows), 1), Mx(size(rows)))
      call fill_random(x)
      call product_symmetric(M, x(:, 1), Mx)
      along = matmul(x(:, 1), soft)
      carries = can_carry(problem, points)
      do k = 1, size(rows), max(1, size(rows)/probed_rows)
         if (.not. carries(k)) cycle
         found = dot_product(problem%G(rows, rows(k)), Mx)
         if (size(along) > 0) found = found + dot_product(problem%soft(rows(k), :), along)
         missed = max(missed, abs(found - x(k, 1)))
      end do
   end function missed

   !> S = -M R_A, N = R_n,o + G_n,oA S = R_n,o - T R_A, and what the forces add up to.
   subroutine update_slopes(self, problem)
      class(base_set_t), intent(inout) :: self
      type(contact_problem_t), intent(in) :: problem
      real(wp), allocatable :: R_A(:, :), R_A_t(:, :), outputs_A(:, :), S(:, :)

      R_A = problem%R(unknowns(self%inside), :)
      S = -multiply(self%M, R_A)
      if (size(self%soft, 2) > 0) call product_of(self%soft, problem%soft_drive, S, factor=-1.0_wp, keep=1.0_wp)
      R_A_t = transpose(R_A)
      self%slope = transpose(S)
      self%slope_outside = transpose(problem%R(3*self%outside - 2, :)) - multiply(R_A_t, self%T_t)
      self%stiffness = multiply(R_A_t, S)
      call update_soft(self, problem, R_A)
      if (allocated(problem%outputs)) then
         outputs_A = problem%outputs(unknowns(self%inside), :)
         self%output_slope = -transpose(multiply(self%M, outputs_A))
         self%output_soft = -matmul(transpose(outputs_A), self%soft)
         self%output_stiffness = matmul(transpose(outputs_A), S)
      else
         self%output_slope = reshape([real(wp) ::], [0, size(S, 1)])
         self%output_soft = reshape([real(wp) ::], [0, size(self%soft, 2)])
         self%output_stiffness = reshape([real(wp) ::], [0, size(S, 2)])
      end if
      call update_coupling(self, problem)
   end subroutine update_slopes

   !> What the soft directions do outside, and what they add to the slopes.
   subroutine update_soft(self, problem, R_A)
      class(base_set_t), intent(inout) :: self
      type(contact_problem_t), intent(in) :: problem
      !> (3 inside, drivers)
      real(wp), intent(in), contiguous :: R_A(:, :)
      real(wp), allocatable :: cross(:, :), V(:, :)

      if (size(self%soft, 2) == 0) then
         self%soft_outside = reshape([real(wp) ::], [0, size(self%outside)])
         self%soft_slope = reshape([real(wp) ::], [0, size(R_A, 2)])
         return
      end if
      V = problem%soft(3*self%outside - 2, :)
      cross = problem%G(unknowns(self%inside), 3*self%outside - 2)
      self%soft_outside = matmul(self%soft_rest, transpose(V))
      call product_of(self%soft, cross, self%soft_outside, transpose_a=.true., factor=-1.0_wp, keep=1.0_wp)
      self%slope_outside = self%slope_outside + matmul(transpose(problem%soft_drive), self%soft_outside)
      self%soft_slope = matmul(self%soft_rest, problem%soft_drive) - problem%soft_drive
      call product_of(self%soft, R_A, self%soft_slope, transpose_a=.true., factor=-1.0_wp, keep=1.0_wp)
      self%stiffness = self%stiffness + matmul(transpose(problem%soft_drive), self%soft_slope)
   end subroutine update_soft

   !> Groups of the base points and their coupling.
   subroutine update_coupling(self, problem)
      class(base_set_t), intent(inout) :: self
      type(contact_problem_t), intent(in) :: problem
      integer :: rank, g
      logical :: found

      if (allocated(problem%group)) then
         self%group = problem%group(self%inside)
         self%groups = maxval(problem%group)
         rank = first_rank
         do while (self%groups > 1)
            if (8*rank > minval([(size(unknowns_of(self, problem, g)), g=1, self%groups)])) exit
            call find_coupling(self, problem, rank, found)
            if (found) return
            rank = 2*rank
         end do
      end if
      self%group = spread(1, 1, size(self%inside))
      self%groups = 1
      self%basis = reshape([real(wp) ::], [0, 3*size(self%inside)])
      self%coupling = reshape([real(wp) ::], [0, 0])
   end subroutine update_coupling

   !> Low-rank coupling with `rank` vectors per group, checked on two vectors that were not used to find it.
   subroutine find_coupling(self, problem, rank, found)
      class(base_set_t), intent(inout) :: self
      type(contact_problem_t), intent(in) :: problem
      integer, intent(in) :: rank
      logical, intent(out) :: found
      integer, parameter :: probes = 2
      real(wp), allocatable :: random(:, :), masked(:, :), caused(:, :), Z(:, :), Z_t(:, :), part(:, :)
      integer, allocatable :: own(:), others(:)
      integer :: g, k, n
      real(wp) :: largest

      n = 3*size(self%inside)
      allocate (random(n, rank + probes), masked(n, (rank + probes)*self%groups), source=0.0_wp)
      call fill_random(random)
      if (allocated(self%basis)) deallocate (self%basis)
      if (allocated(self%coupling)) deallocate (self%coupling)
      allocate (self%basis(rank, n), self%coupling(rank*self%groups, rank*self%groups), source=0.0_wp)
      largest = maxval([(self%M(k, k), k=1, n)])
      ! What the random increments of all other groups cause in every group.
      do g = 1, self%groups
         others = unknowns(pack([(k, k=1, n/3)], self%group /= g))
         masked(others, (g - 1)*(rank + probes) + 1:g*(rank + probes)) = random(others, :)
      end do
      caused = multiply(self%M, masked)
      found = .true.
      do g = 1, self%groups
         own = unknowns_of(self, problem, g)
         part = caused(own, (g - 1)*(rank + probes) + 1:g*(rank + probes))
         Z = part(:, :rank)
         call orthonormalise(Z)
         Z_t = transpose(Z)
         self%basis(:, own) = Z_t
         part = part(:, rank + 1:)
         part = part - matmul(Z, matmul(Z_t, part))
         found = found .and. maxval(abs(part)) <= 1.0e-13_wp*largest*sqrt(real(n, wp))
      end do
      if (.not. found) return
      deallocate (masked)
      allocate (masked(n, rank*self%groups), source=0.0_wp)
      do g = 1, self%groups
         own = unknowns_of(self, problem, g)
         masked(own, (g - 1)*rank + 1:g*rank) = transpose(self%basis(:, own))
      end do
      caused = multiply(self%M, masked)
      self%coupling = matmul(transpose(masked), caused)
      do g = 1, self%groups
         self%coupling((g - 1)*rank + 1:g*rank, (g - 1)*rank + 1:g*rank) = 0.0_wp
      end do
   end subroutine find_coupling

   !> Unknowns of a group that can carry force.
   function unknowns_of(self, problem, group) result(own)
      type(base_set_t), intent(in) :: self
      type(contact_problem_t), intent(in) :: problem
      integer, intent(in) :: group
      integer, allocatable :: own(:)
      integer :: k

      own = unknowns(pack([(k, k=1, size(self%inside))], self%group == group))
      own = pack(own, can_carry(problem, pack(self%inside, self%group == group)))
   end function unknowns_of

   !> Numbers between -1 and 1 without pattern, the same ones every time.
   pure subroutine fill_random(values)
      real(wp), intent(out) :: values(:, :)
      integer :: i, k
      integer(int64) :: seed

      seed = 20261122_int64
      do k = 1, size(values, 2)
         do i = 1, size(values, 1)
            seed = mod(seed*16807_int64, 2147483647_int64)
            values(i, k) = 2.0_wp*real(seed, wp)/2147483647.0_wp - 1.0_wp
         end do
      end do
   end subroutine fill_random

   !> Lists of the points inside (as given) and outside (ascending).
   subroutine partition(self, n_points, points)
      class(base_set_t), intent(inout) :: self
      integer, intent(in) :: n_points
      integer, intent(in) :: points(:)
      integer :: k

      self%inside = points
      if (allocated(self%place)) deallocate (self%place)
      allocate (self%place(n_points), source=0)
      self%place(self%inside) = [(k, k=1, size(points))]
      self%outside = pack([(k, k=1, n_points)], self%place == 0)
   end subroutine partition

   !> Indices that list `points` (distinct, at most n_points) in ascending order.
   pure function order_of(points, n_points) result(order)
      integer, intent(in) :: points(:), n_points
      integer, allocatable :: order(:)
      integer :: where_is(n_points), k

      where_is = 0
      where_is(points) = [(k, k=1, size(points))]
      order = pack(where_is, where_is > 0)
   end function order_of

   !> Which of the three unknowns of every point can carry force: without friction the normal one alone.
   pure function can_carry(problem, points) result(carries)
      type(contact_problem_t), intent(in) :: problem
      integer, intent(in) :: points(:)
      logical :: carries(3*size(points))

      carries = .true.
      carries(2::3) = problem%friction(points) > 0.0_wp
      carries(3::3) = carries(2::3)
   end function can_carry

   !> The inverse of A among the unknowns that can carry force, zero in the other rows and columns.
   subroutine invert_carrying(A, carries, error)
      real(wp), allocatable, intent(inout) :: A(:, :)
      logical, intent(in) :: carries(:)
      type(error_t), allocatable, intent(out) :: error
      real(wp), allocatable :: part(:, :)
      integer, allocatable :: list(:)
      integer :: k

      if (all(carries)) then
         call inverse_spd(A, error)
         return
      end if
      list = pack([(k, k=1, size(carries))], carries)
      part = A(list, list)
      call inverse_spd(part, error)
      if (allocated(error)) return
      A = 0.0_wp
      A(list, list) = part
   end subroutine invert_carrying

   !> A B as a function.
   function multiply(a, b) result(c)
      real(wp), intent(in), contiguous :: a(:, :), b(:, :)
      real(wp), allocatable :: c(:, :)

      allocate (c(size(a, 1), size(b, 2)))
      call product_of(a, b, c)
   end function multiply

   !> The three unknowns of every point: 3p - 2, 3p - 1, 3p.
   pure function unknowns(points) result(rows)
      integer, intent(in) :: points(:)
      integer :: rows(3*size(points))
      integer :: j

      do j = 1, size(points)
         rows(3*j - 2:3*j) = 3*points(j) - [2, 1, 0]
      end do
   end function unknowns

end module microslip_contact_base_set
