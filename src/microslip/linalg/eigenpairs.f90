!> Eigenpairs of K x = lambda M x nearest a shift, by ARPACK's implicitly restarted Lanczos method.
!>
!> Shift and invert (ARPACK's mode 3): OP = (K - shift M)^-1 M is self-adjoint in the M inner product and has
!> the eigenvalues theta = 1/(lambda - shift). M may be singular: the start vector is in the range of OP.
!> ARPACK cannot deliver (nearly) all pairs of a problem; where so many are wanted, dense matrices serve.
!> Reference: Lehoucq, Sorensen, Yang, ARPACK Users' Guide, SIAM 1998.
module microslip_linalg_eigenpairs
   use microslip_core_error, only: error_t, failure
   use microslip_core_kinds, only: wp, i8
   use microslip_core_text, only: to_text
   use microslip_linalg_dense, only: eigen_symmetric, product_of
   use microslip_linalg_mumps, only: symmetric_factor_t
   use microslip_linalg_sparse, only: symmetric_sparse_t
   use microslip_linalg_sparse_algebra, only: multiply_many
   implicit none(type, external)
   private

   public :: nearest_eigenpairs, eigen_record_t

   !> What the iteration did.
   type :: eigen_record_t
      !> Restarts, and vectors of the basis
      integer :: iterations = 0, basis = 0
      !> Solutions with the factor
      integer :: solves = 0
      !> Largest relative residual |OP x - theta x|_M / |theta|
      real(wp) :: residual = 0.0_wp
   end type eigen_record_t

   !> Relative accuracy asked of the Ritz values; the eigenvalues' own error is of the residual's square.
   real(wp), parameter :: tolerance = 1.0e-12_wp
   integer, parameter :: max_restarts = 300
   !> Below this share of the largest, |theta| is rounding: there is no further eigenpair.
   real(wp), parameter :: rounding = 1.0e-13_wp

   interface
      subroutine dsaupd(ido, bmat, n, which, nev, tol, resid, ncv, v, ldv, iparam, ipntr, workd, workl, lworkl, info)
         import :: wp
         implicit none
         integer, intent(inout) :: ido, info
         character(len=1), intent(in) :: bmat
         character(len=2), intent(in) :: which
         integer, intent(in) :: n, nev, ncv, ldv, lworkl
         real(wp), intent(in) :: tol
         real(wp), intent(inout) :: resid(*), v(ldv, *), workd(*), workl(*)
         integer, intent(inout) :: iparam(*), ipntr(*)
      end subroutine dsaupd

      subroutine dseupd(rvec, howmny, select, d, z, ldz, sigma, bmat, n, which, nev, tol, resid, ncv, v, ldv, &
            iparam, ipntr, workd, workl, lworkl, info)
         import :: wp
         implicit none
         logical, intent(in) :: rvec
         character(len=1), intent(in) :: howmny, bmat
         character(len=2), intent(in) :: which
         integer, intent(in) :: ldz, n, nev, ncv, ldv, lworkl
         logical, intent(inout) :: select(*)
         real(wp), intent(in) :: sigma, tol
         real(wp), intent(inout) :: d(*), z(ldz, *), resid(*), v(ldv, *), workd(*), workl(*)
         integer, intent(inout) :: iparam(*), ipntr(*)
         integer, intent(out) :: info
      end subroutine dseupd
   end interface

contains

   !> The `count` eigenpairs nearest the shift, eigenvalues ascending, X^T M X = I, largest component positive.
   subroutine nearest_eigenpairs(mass, factor, shift, count, lambda, vectors, record, error)
      !> M, positive semidefinite
      type(symmetric_sparse_t), intent(in) :: mass
      !> Factor of K - shift M; rows that are not in the factor (Schur rows) are held at zero
      type(symmetric_factor_t), intent(inout) :: factor
      real(wp), intent(in) :: shift
      integer, intent(in) :: count
      !> (count)
      real(wp), allocatable, intent(out) :: lambda(:)
      !> (n, count)
      real(wp), allocatable, intent(out) :: vectors(:, :)
      type(eigen_record_t), intent(out) :: record
      !> Fewer pairs exist than are wanted, or no convergence
      type(error_t), allocatable, intent(out) :: error
      integer, allocatable :: active(:)
      real(wp), allocatable :: theta(:)

      active = factor%active_rows()
      if (count > size(active)) then
         call failure(error, to_text(count)//' eigenpairs wanted, but only '//to_text(size(active))//' exist')
         return
      end if
      allocate (lambda(count), vectors(mass%n, count), theta(count))
      if (count == 0) return
      if (3*count + 20 > size(active)) then
         call solve_dense(mass, factor, active, theta, vectors, record, error)
      else
         call iterate(mass, factor, active, shift, theta, vectors, record, error)
      end if
      if (allocated(error)) return
      lambda = shift + 1.0_wp/theta
      call sort_and_sign(lambda, vectors)
      call measure_residual(mass, factor, active, lambda - shift, vectors, record)
   end subroutine nearest_eigenpairs

   !> ARPACK's reverse communication.
   subroutine iterate(mass, factor, active, shift, theta, vectors, record, error)
      type(symmetric_sparse_t), intent(in) :: mass
      type(symmetric_factor_t), intent(inout) :: factor
      integer, intent(in) :: active(:)
      real(wp), intent(in) :: shift
      real(wp), intent(out) :: theta(:)
      real(wp), intent(out), contiguous :: vectors(:, :)
      type(eigen_record_t), intent(inout) :: record
      type(error_t), allocatable, intent(out) :: error
      real(wp), allocatable :: residual(:), v(:, :), workd(:), workl(:), x(:), value(:)
      logical, allocatable :: selected(:)
      integer :: n, wanted, basis, ido, info, iparam(11), ipntr(11), first

      n = mass%n
      wanted = size(theta)
      basis = min(size(active), max(2*wanted + 1, 20))
      allocate (v(n, basis), workd(3*n), workl(basis*(basis + 8)), selected(basis), value(basis), x(n))
      call start_vector(mass, factor, active, residual, record)
      iparam = 0
      iparam([1, 3, 7]) = [1, max_restarts, 3]
      ipntr = 0
      ido = 0
      info = 1
      do
         call dsaupd(ido, 'G', n, 'LM', wanted, tolerance, residual, basis, v, n, iparam, ipntr, workd, workl, &
            & size(workl), info)
         select case (ido)
         case (-1)
            call multiply_active(mass, active, workd(ipntr(1):ipntr(1) + n - 1), x)
         case (1)
            first = ipntr(3)
            x = workd(first:first + n - 1)
         case (2)
            call multiply_active(mass, active, workd(ipntr(1):ipntr(1) + n - 1), x)
         case default
            exit
         end select
         if (ido /= 2) then
            call factor%solve(x)
            record%solves = record%solves + 1
         end if
         workd(ipntr(2):ipntr(2) + n - 1) = x
      end do
      record%iterations = iparam(3)
      record%basis = basis
      if (info < 0 .or. iparam(5) < wanted) then
         call failure(error, to_text(wanted)//' eigenpairs wanted, '//to_text(iparam(5))//' found after '// &
            & to_text(iparam(3))//' restarts (ARPACK, code '//to_text(info)//')')
         return
      end if
      call dseupd(.true., 'A', selected, value, v, n, shift, 'G', n, 'LM', wanted, tolerance, residual, basis, v, n, &
         & iparam, ipntr, workd, workl, size(workl), info)
      if (info /= 0) then
         call failure(error, 'eigenvectors: ARPACK, code '//to_text(info))
         return
      end if
      theta = 1.0_wp/(value(:wanted) - shift)
      vectors = v(:, :wanted)
      call check_existence(theta, error)
   end subroutine iterate

   !> Eigenvalues at infinity (massless motions) are no eigenpairs.
   subroutine check_existence(theta, error)
      real(wp), intent(in) :: theta(:)
      type(error_t), allocatable, intent(out) :: error
      integer :: found

      found = count(abs(theta) > rounding*maxval(abs(theta)))
      if (found < size(theta)) call failure(error, to_text(size(theta))//' eigenpairs wanted, but only '// &
         & to_text(found)//' exist')
   end subroutine check_existence

   !> y = M x on the rows that are in the factor, zero elsewhere.
   subroutine multiply_active(mass, active, x, y)
      type(symmetric_sparse_t), intent(in) :: mass
      integer, intent(in) :: active(:)
      real(wp), intent(in) :: x(:)
      real(wp), intent(out) :: y(:)
      real(wp) :: all_rows(size(x))

      call mass%multiply(x, all_rows)
      y = 0.0_wp
      y(active) = all_rows(active)
   end subroutine multiply_active

   !> The same pseudo-random vector every time, moved into the range of OP.
   subroutine start_vector(mass, factor, active, x, record)
      type(symmetric_sparse_t), intent(in) :: mass
      type(symmetric_factor_t), intent(inout) :: factor
      integer, intent(in) :: active(:)
      real(wp), allocatable, intent(out) :: x(:)
      type(eigen_record_t), intent(inout) :: record
      integer(i8), parameter :: multiplier = 48271_i8, modulus = 2147483647_i8
      real(wp), allocatable :: random(:)
      integer(i8) :: state
      integer :: k

      allocate (random(mass%n), source=0.0_wp)
      allocate (x(mass%n))
      state = 20260503_i8
      do k = 1, size(active)
         state = mod(multiplier*state, modulus)
         random(active(k)) = real(state, wp)/real(modulus, wp) - 0.5_wp
      end do
      call multiply_active(mass, active, random, x)
      call factor%solve(x)
      record%solves = record%solves + 1
   end subroutine start_vector

   !> All of a small problem: with M = U D U^T, the eigenpairs of D^1/2 U^T (K - shift M)^-1 U D^1/2.
   subroutine solve_dense(mass, factor, active, theta, vectors, record, error)
      type(symmetric_sparse_t), intent(in) :: mass
      type(symmetric_factor_t), intent(inout) :: factor
      integer, intent(in) :: active(:)
      real(wp), intent(out) :: theta(:)
      real(wp), intent(out), contiguous :: vectors(:, :)
      type(eigen_record_t), intent(inout) :: record
      type(error_t), allocatable, intent(out) :: error
      real(wp), allocatable :: root(:, :), moved(:, :), b(:, :), d(:), value(:), y(:, :)
      integer, allocatable :: order(:)
      integer :: k, n

      n = size(active)
      allocate (root(n, n), d(n), value(n), b(n, n), moved(mass%n, n), y(mass%n, 1))
      do k = 1, n
         y = 0.0_wp
         y(active(k), 1) = 1.0_wp
         call mass%multiply(y(:, 1), moved(:, k))
      end do
      root = moved(active, :)
      call eigen_symmetric(root, d, error)
      if (allocated(error)) return
      do k = 1, n
         root(:, k) = root(:, k)*sqrt(max(0.0_wp, d(k)))
      end do
      moved = 0.0_wp
      moved(active, :) = root
      call factor%solve(moved)
      record%solves = record%solves + n
      b = matmul(transpose(root), moved(active, :))
      b = 0.5_wp*(b + transpose(b))
      call eigen_symmetric(b, value, error)
      if (allocated(error)) return
      order = largest_first(abs(value))
      theta = value(order(:size(theta)))
      call check_existence(theta, error)
      if (allocated(error)) return
      b = b(:, order(:size(theta)))
      call product_of(moved, b, vectors)
      do k = 1, size(theta)
         vectors(:, k) = vectors(:, k)/theta(k)
      end do
      record%basis = n
   end subroutine solve_dense

   !> Largest |OP x - theta x|_M / |theta|: all vectors in one pass through the factor.
   subroutine measure_residual(mass, factor, active, distance, x, record)
      type(symmetric_sparse_t), intent(in) :: mass
      type(symmetric_factor_t), intent(inout) :: factor
      integer, intent(in) :: active(:)
      !> (pairs) lambda - shift = 1/theta
      real(wp), intent(in) :: distance(:)
      !> (n, pairs)
      real(wp), intent(in), contiguous :: x(:, :)
      type(eigen_record_t), intent(inout) :: record
      real(wp), allocatable :: y(:, :), my(:, :)
      integer :: k

      allocate (y, my, mold=x)
      call multiply_many(mass, x, y)
      call factor%solve(y)
      record%solves = record%solves + size(x, 2)
      do k = 1, size(x, 2)
         y(:, k) = distance(k)*y(:, k) - x(:, k)
      end do
      call multiply_many(mass, y, my)
      do k = 1, size(x, 2)
         record%residual = max(record%residual, sqrt(max(0.0_wp, dot_product(y(active, k), my(active, k)))))
      end do
   end subroutine measure_residual

   !> Eigenvalues ascending; the largest component of every vector positive.
   subroutine sort_and_sign(lambda, vectors)
      real(wp), intent(inout) :: lambda(:)
      real(wp), intent(inout) :: vectors(:, :)
      integer :: order(size(lambda)), k

      order = largest_first(-lambda)
      lambda = lambda(order)
      vectors = vectors(:, order)
      do k = 1, size(lambda)
         if (vectors(maxloc(abs(vectors(:, k)), dim=1), k) < 0.0_wp) vectors(:, k) = -vectors(:, k)
      end do
   end subroutine sort_and_sign

   !> Indices that put the values in descending order (insertion sort: the lists are short).
   pure function largest_first(value) result(order)
      real(wp), intent(in) :: value(:)
      integer :: order(size(value)), k, m, item

      order = [(k, k=1, size(value))]
      do k = 2, size(value)
         item = order(k)
         m = k - 1
         do while (m >= 1)
            if (value(order(m)) >= value(item)) exit
            order(m + 1) = order(m)
            m = m - 1
         end do
         order(m + 1) = item
      end do
   end function largest_first

end module microslip_linalg_eigenpairs
