!> Dense linear algebra: thin wrappers over BLAS and LAPACK with contiguous arrays and errors as values.
!>
!> Symmetric matrices are stored in full. Where a procedure reads one triangle only, it is the upper one.
module microslip_linalg_dense
   use, intrinsic :: iso_fortran_env, only: real32
   use microslip_core_error, only: error_t, failure
   use microslip_core_kinds, only: wp
   use microslip_core_text, only: to_text
   implicit none(type, external)
   private

   public :: cholesky_factor, cholesky_solve, inverse_spd, solve_general
   public :: eigen_symmetric, eigen_generalised
   public :: product_of, product_symmetric, add_product, add_dots, gram_product, mirror_upper
   public :: inverse_single, product_single, add_product_single, orthonormalise

   !> Size below which a product with a vector is done here: OpenBLAS shares out even the smallest one among the
   !> threads, which takes longer than the product.
   integer, parameter :: threading_pays = 512
   !> Size from which a factor in single precision with refinement is faster than one in double.
   integer, parameter :: single_precision_pays = 128
   !> ... with so many rows for every right-hand side: each is refined by products in double.
   integer, parameter :: few_columns = 20

   !> Solve A X = B with the Cholesky factor of A; B holds X on return.
   interface cholesky_solve
      module procedure :: cholesky_solve_one
      module procedure :: cholesky_solve_many
   end interface cholesky_solve

   !> Product with a symmetric matrix stored in full: y = A x, or Y = A X.
   interface product_symmetric
      module procedure :: product_symmetric_one
      module procedure :: product_symmetric_many
   end interface product_symmetric

   interface
      subroutine dpotrf(uplo, n, a, lda, info)
         import :: wp
         character(len=1), intent(in) :: uplo
         integer, intent(in) :: n, lda
         real(wp), intent(inout) :: a(lda, *)
         integer, intent(out) :: info
      end subroutine dpotrf

      subroutine dpotrs(uplo, n, nrhs, a, lda, b, ldb, info)
         import :: wp
         character(len=1), intent(in) :: uplo
         integer, intent(in) :: n, nrhs, lda, ldb
         real(wp), intent(in) :: a(lda, *)
         real(wp), intent(inout) :: b(ldb, *)
         integer, intent(out) :: info
      end subroutine dpotrs

      subroutine dpotri(uplo, n, a, lda, info)
         import :: wp
         character(len=1), intent(in) :: uplo
         integer, intent(in) :: n, lda
         real(wp), intent(inout) :: a(lda, *)
         integer, intent(out) :: info
      end subroutine dpotri

      subroutine dgesv(n, nrhs, a, lda, pivot, b, ldb, info)
         import :: wp
         integer, intent(in) :: n, nrhs, lda, ldb
         real(wp), intent(inout) :: a(lda, *), b(ldb, *)
         integer, intent(out) :: pivot(*), info
      end subroutine dgesv

      subroutine dsgesv(n, nrhs, a, lda, pivot, b, ldb, x, ldx, work, swork, iter, info)
         import :: wp, real32
         integer, intent(in) :: n, nrhs, lda, ldb, ldx
         real(wp), intent(inout) :: a(lda, *), b(ldb, *)
         real(wp), intent(out) :: x(ldx, *), work(n, *)
         real(real32), intent(out) :: swork(*)
         integer, intent(out) :: pivot(*), iter, info
      end subroutine dsgesv

      subroutine dsyevd(jobz, uplo, n, a, lda, w, work, lwork, iwork, liwork, info)
         import :: wp
         character(len=1), intent(in) :: jobz, uplo
         integer, intent(in) :: n, lda, lwork, liwork
         real(wp), intent(inout) :: a(lda, *)
         real(wp), intent(out) :: w(*), work(*)
         integer, intent(out) :: iwork(*), info
      end subroutine dsyevd

      subroutine dsygvd(itype, jobz, uplo, n, a, lda, b, ldb, w, work, lwork, iwork, liwork, info)
         import :: wp
         integer, intent(in) :: itype, n, lda, ldb, lwork, liwork
         character(len=1), intent(in) :: jobz, uplo
         real(wp), intent(inout) :: a(lda, *), b(ldb, *)
         real(wp), intent(out) :: w(*), work(*)
         integer, intent(out) :: iwork(*), info
      end subroutine dsygvd

      subroutine dsymv(uplo, n, alpha, a, lda, x, incx, beta, y, incy)
         import :: wp
         character(len=1), intent(in) :: uplo
         integer, intent(in) :: n, lda, incx, incy
         real(wp), intent(in) :: alpha, beta, a(lda, *), x(*)
         real(wp), intent(inout) :: y(*)
      end subroutine dsymv

      subroutine dsymm(side, uplo, m, n, alpha, a, lda, b, ldb, beta, c, ldc)
         import :: wp
         character(len=1), intent(in) :: side, uplo
         integer, intent(in) :: m, n, lda, ldb, ldc
         real(wp), intent(in) :: alpha, beta, a(lda, *), b(ldb, *)
         real(wp), intent(inout) :: c(ldc, *)
      end subroutine dsymm

      subroutine dgeqrf(m, n, a, lda, tau, work, lwork, info)
         import :: wp
         integer, intent(in) :: m, n, lda, lwork
         real(wp), intent(inout) :: a(lda, *)
         real(wp), intent(out) :: tau(*), work(*)
         integer, intent(out) :: info
      end subroutine dgeqrf

      subroutine dorgqr(m, n, k, a, lda, tau, work, lwork, info)
         import :: wp
         integer, intent(in) :: m, n, k, lda, lwork
         real(wp), intent(inout) :: a(lda, *)
         real(wp), intent(in) :: tau(*)
         real(wp), intent(out) :: work(*)
         integer, intent(out) :: info
      end subroutine dorgqr

      subroutine sgetrf(m, n, a, lda, pivot, info)
         import :: real32
         integer, intent(in) :: m, n, lda
         real(real32), intent(inout) :: a(lda, *)
         integer, intent(out) :: pivot(*), info
      end subroutine sgetrf

      subroutine sgetri(n, a, lda, pivot, work, lwork, info)
         import :: real32
         integer, intent(in) :: n, lda, pivot(*), lwork
         real(real32), intent(inout) :: a(lda, *)
         real(real32), intent(out) :: work(*)
         integer, intent(out) :: info
      end subroutine sgetri

      subroutine sgemm(transa, transb, m, n, k, alpha, a, lda, b, ldb, beta, c, ldc)
         import :: real32
         character(len=1), intent(in) :: transa, transb
         integer, intent(in) :: m, n, k, lda, ldb, ldc
         real(real32), intent(in) :: alpha, beta, a(lda, *), b(ldb, *)
         real(real32), intent(inout) :: c(ldc, *)
      end subroutine sgemm

      subroutine dgemm(transa, transb, m, n, k, alpha, a, lda, b, ldb, beta, c, ldc)
         import :: wp
         character(len=1), intent(in) :: transa, transb
         integer, intent(in) :: m, n, k, lda, ldb, ldc
         real(wp), intent(in) :: alpha, beta, a(lda, *), b(ldb, *)
         real(wp), intent(inout) :: c(ldc, *)
      end subroutine dgemm

      subroutine dsyrk(uplo, trans, n, k, alpha, a, lda, beta, c, ldc)
         import :: wp
         character(len=1), intent(in) :: uplo, trans
         integer, intent(in) :: n, k, lda, ldc
         real(wp), intent(in) :: alpha, beta, a(lda, *)
         real(wp), intent(inout) :: c(ldc, *)
      end subroutine dsyrk
   end interface

contains

   !> A = U^T U; the upper triangle of `a` becomes U, the lower one is left alone.
   subroutine cholesky_factor(a, error)
      !> (n, n) symmetric positive definite, its factor on return
      real(wp), intent(inout), contiguous :: a(:, :)
      !> The leading minor that is not positive, where A is not positive definite
      type(error_t), allocatable, intent(out) :: error
      integer :: info

      if (size(a) == 0) return
      call dpotrf('U', size(a, 2), a, size(a, 1), info)
      if (info > 0) call failure(error, 'matrix of '//to_text(size(a, 2))// &
                                 ' rows is not positive definite: leading minor '//to_text(info))
   end subroutine cholesky_factor

   subroutine cholesky_solve_one(factor, b)
      !> (n, n) from `cholesky_factor`
      real(wp), intent(in), contiguous :: factor(:, :)
      !> (n) right-hand side, the solution on return
      real(wp), intent(inout), contiguous, target :: b(:)
      real(wp), pointer, contiguous :: block(:, :)

      block(1:size(b), 1:1) => b
      call cholesky_solve_many(factor, block)
   end subroutine cholesky_solve_one

   subroutine cholesky_solve_many(factor, b)
      !> (n, n) from `cholesky_factor`
      real(wp), intent(in), contiguous :: factor(:, :)
      !> (n, columns) right-hand sides, the solutions on return
      real(wp), intent(inout), contiguous :: b(:, :)
      integer :: info

      if (size(b) == 0) return
      call dpotrs('U', size(b, 1), size(b, 2), factor, size(factor, 1), b, size(b, 1), info)
   end subroutine cholesky_solve_many

   !> A <- A^-1, both triangles filled.
   subroutine inverse_spd(a, error)
      !> (n, n) symmetric positive definite, its inverse on return
      real(wp), intent(inout), contiguous :: a(:, :)
      !> Where A is not positive definite
      type(error_t), allocatable, intent(out) :: error
      integer :: info

      call cholesky_factor(a, error)
      if (allocated(error) .or. size(a) == 0) return
      call dpotri('U', size(a, 2), a, size(a, 1), info)
      call mirror_upper(a)
   end subroutine inverse_spd

   !> Solve A X = B by LU factorisation with partial pivoting, to double precision.
   !>
   !> Larger matrices are factorised in single precision, in half the time, and the solution is refined to double;
   !> LAPACK goes back to a factor in double where that does not converge.
   subroutine solve_general(a, b, error)
      !> (n, n), destroyed
      real(wp), intent(inout), contiguous :: a(:, :)
      !> (n, columns) right-hand sides, the solutions on return
      real(wp), intent(inout), contiguous :: b(:, :)
      !> Where A is singular
      type(error_t), allocatable, intent(out) :: error
      integer, allocatable :: pivot(:)
      real(wp), allocatable :: x(:, :), work(:, :)
      real(real32), allocatable :: single(:)
      integer :: n, m, info, refinements

      if (size(b) == 0) return
      n = size(a, 1)
      m = size(b, 2)
      allocate (pivot(n))
      if (n < max(single_precision_pays, few_columns*m)) then
         call dgesv(n, m, a, n, pivot, b, n, info)
      else
         allocate (x(n, m), work(n, m), single(n*(n + m)))
         call dsgesv(n, m, a, n, pivot, b, n, x, n, work, single, refinements, info)
         b = x
      end if
      if (info > 0) call failure(error, 'matrix of '//to_text(size(a, 1))//' rows is singular: pivot '//to_text(info))
   end subroutine solve_general

   !> A x = lambda x; eigenvalues ascend, eigenvectors are orthonormal.
   subroutine eigen_symmetric(a, lambda, error, values_only)
      !> (n, n) symmetric; its columns are the eigenvectors on return (destroyed with `values_only`)
      real(wp), intent(inout), contiguous :: a(:, :)
      !> (n)
      real(wp), intent(out), contiguous :: lambda(:)
      !> Where the iteration fails
      type(error_t), allocatable, intent(out) :: error
      !> No eigenvectors (default false)
      logical, intent(in), optional :: values_only
      character(len=1) :: job
      real(wp), allocatable :: work(:)
      integer, allocatable :: iwork(:)
      real(wp) :: room(1)
      integer :: n, info, iroom(1)

      n = size(lambda)
      if (n == 0) return
      job = job_of(values_only)
      call dsyevd(job, 'U', n, a, size(a, 1), lambda, room, -1, iroom, -1, info)
      allocate (work(int(room(1))), iwork(iroom(1)))
      call dsyevd(job, 'U', n, a, size(a, 1), lambda, work, size(work), iwork, size(iwork), info)
      if (info > 0) call failure(error, 'eigenvalues of a matrix of '//to_text(n)//' rows did not converge')
   end subroutine eigen_symmetric

   !> A x = lambda B x; eigenvalues ascend, X^T B X = I.
   subroutine eigen_generalised(a, b, lambda, error, values_only)
      !> (n, n) symmetric; its columns are the eigenvectors on return (destroyed with `values_only`)
      real(wp), intent(inout), contiguous :: a(:, :)
      !> (n, n) symmetric positive definite; its Cholesky factor on return
      real(wp), intent(inout), contiguous :: b(:, :)
      !> (n)
      real(wp), intent(out), contiguous :: lambda(:)
      !> Where B is not positive definite or the iteration fails
      type(error_t), allocatable, intent(out) :: error
      !> No eigenvectors (default false)
      logical, intent(in), optional :: values_only
      character(len=1) :: job
      real(wp), allocatable :: work(:)
      integer, allocatable :: iwork(:)
      real(wp) :: room(1)
      integer :: n, info, iroom(1)

      n = size(lambda)
      if (n == 0) return
      job = job_of(values_only)
      call dsygvd(1, job, 'U', n, a, size(a, 1), b, size(b, 1), lambda, room, -1, iroom, -1, info)
      allocate (work(int(room(1))), iwork(iroom(1)))
      call dsygvd(1, job, 'U', n, a, size(a, 1), b, size(b, 1), lambda, work, size(work), iwork, size(iwork), info)
      if (info > n) then
         call failure(error, 'generalised eigenvalue problem: the second matrix is not positive definite: leading minor ' &
                      //to_text(info - n))
      else if (info > 0) then
         call failure(error, 'generalised eigenvalues of a matrix of '//to_text(n)//' rows did not converge')
      end if
   end subroutine eigen_generalised

   !> LAPACK's letter for "with or without eigenvectors".
   pure character(len=1) function job_of(values_only)
      logical, intent(in), optional :: values_only
      job_of = 'V'
      if (present(values_only)) job_of = merge('N', 'V', values_only)
   end function job_of

   subroutine product_symmetric_one(a, x, y)
      !> (n, n)
      real(wp), intent(in), contiguous :: a(:, :)
      !> (n)
      real(wp), intent(in), contiguous :: x(:)
      !> (n)
      real(wp), intent(out), contiguous :: y(:)

      if (size(y) == 0) return
      if (size(y) < threading_pays) then
         y = matmul(a, x)
         return
      end if
      call dsymv('U', size(x), 1.0_wp, a, size(a, 1), x, 1, 0.0_wp, y, 1)
   end subroutine product_symmetric_one

   subroutine product_symmetric_many(a, x, y)
      !> (n, n)
      real(wp), intent(in), contiguous :: a(:, :)
      !> (n, columns)
      real(wp), intent(in), contiguous :: x(:, :)
      !> (n, columns)
      real(wp), intent(out), contiguous :: y(:, :)

      if (size(y) == 0) return
      call dsymm('L', 'U', size(x, 1), size(x, 2), 1.0_wp, a, size(a, 1), x, size(x, 1), 0.0_wp, y, size(y, 1))
   end subroutine product_symmetric_many

   !> y <- y + A x with the leading m rows and n columns of A. Written out, not BLAS: it is called by threads of its own,
   !> and a product that is bound by memory gains nothing from a kernel.
   subroutine add_product(m, n, a, lda, x, y)
      integer, intent(in) :: m, n, lda
      !> Leading dimension lda
      real(wp), intent(in) :: a(lda, *)
      !> n values
      real(wp), intent(in) :: x(*)
      !> m values (at least)
      real(wp), intent(inout) :: y(*)
      integer :: i, j

      do j = 1, n - 7, 8
         !$omp simd
         do i = 1, m
            y(i) = y(i) + (a(i, j)*x(j) + a(i, j + 1)*x(j + 1) + a(i, j + 2)*x(j + 2) + a(i, j + 3)*x(j + 3)) &
               & + (a(i, j + 4)*x(j + 4) + a(i, j + 5)*x(j + 5) + a(i, j + 6)*x(j + 6) + a(i, j + 7)*x(j + 7))
         end do
      end do
      do j = n - mod(n, 8) + 1, n
         y(:m) = y(:m) + a(:m, j)*x(j)
      end do
   end subroutine add_product

   !> The same in single precision.
   subroutine add_product_single(m, n, a, lda, x, y)
      integer, intent(in) :: m, n, lda
      real(real32), intent(in) :: a(lda, *)
      !> n values
      real(real32), intent(in) :: x(*)
      !> m values (at least)
      real(real32), intent(inout) :: y(*)
      integer :: i, j

      do j = 1, n - 7, 8
         !$omp simd
         do i = 1, m
            y(i) = y(i) + (a(i, j)*x(j) + a(i, j + 1)*x(j + 1) + a(i, j + 2)*x(j + 2) + a(i, j + 3)*x(j + 3)) &
               & + (a(i, j + 4)*x(j + 4) + a(i, j + 5)*x(j + 5) + a(i, j + 6)*x(j + 6) + a(i, j + 7)*x(j + 7))
         end do
      end do
      do j = n - mod(n, 8) + 1, n
         y(:m) = y(:m) + a(:m, j)*x(j)
      end do
   end subroutine add_product_single

   !> sums = sums + A^T x for a few columns of n rows.
   pure subroutine add_dots(n, a, lda, x, sums)
      integer, intent(in) :: n, lda
      !> Leading dimension lda, as many columns as sums
      real(wp), intent(in) :: a(lda, *)
      !> n values
      real(wp), intent(in) :: x(*)
      real(wp), intent(inout) :: sums(:)
      real(wp) :: total
      integer :: i, j

      do j = 1, size(sums)
         total = 0.0_wp
         !$omp simd reduction(+:total)
         do i = 1, n
            total = total + a(i, j)*x(i)
         end do
         sums(j) = sums(j) + total
      end do
   end subroutine add_dots

   !> C = A B in single precision.
   function product_single(a, b) result(c)
      real(real32), intent(in), contiguous :: a(:, :), b(:, :)
      real(real32) :: c(size(a, 1), size(b, 2))
      integer :: m, n, k

      m = size(a, 1)
      k = size(a, 2)
      n = size(b, 2)
      c = 0.0_real32
      if (min(m, n, k) > 0) call sgemm('N', 'N', m, n, k, 1.0_real32, a, m, b, k, 0.0_real32, c, m)
   end function product_single

   !> A becomes its inverse, in single precision.
   subroutine inverse_single(a, singular)
      !> (n, n)
      real(real32), intent(inout), contiguous :: a(:, :)
      logical, intent(out) :: singular
      real(real32), allocatable :: work(:)
      integer :: pivot(size(a, 1)), n, info

      n = size(a, 1)
      singular = .false.
      if (n == 0) return
      call sgetrf(n, n, a, n, pivot, info)
      singular = info /= 0
      if (singular) return
      allocate (work(64*n))
      call sgetri(n, a, n, pivot, work, size(work), info)
   end subroutine inverse_single

   !> The columns of A become an orthonormal basis of what they span (Householder; rows >= columns).
   subroutine orthonormalise(a)
      real(wp), intent(inout), contiguous :: a(:, :)
      real(wp), allocatable :: tau(:), work(:)
      real(wp) :: room(1)
      integer :: m, n, info

      m = size(a, 1)
      n = size(a, 2)
      if (n == 0) return
      allocate (tau(n))
      call dgeqrf(m, n, a, m, tau, room, -1, info)
      allocate (work(int(room(1))))
      call dgeqrf(m, n, a, m, tau, work, size(work), info)
      call dorgqr(m, n, n, a, m, tau, room, -1, info)
      if (size(work) < int(room(1))) then
         deallocate (work)
         allocate (work(int(room(1))))
      end if
      call dorgqr(m, n, n, a, m, tau, work, size(work), info)
   end subroutine orthonormalise

   !> C <- factor op(A) op(B) + keep C, with op(X) = X or X^T.
   subroutine product_of(a, b, c, transpose_a, transpose_b, factor, keep)
      !> (m, k), or (k, m) with `transpose_a`
      real(wp), intent(in), contiguous :: a(:, :)
      !> (k, n), or (n, k) with `transpose_b`
      real(wp), intent(in), contiguous :: b(:, :)
      !> (m, n)
      real(wp), intent(inout), contiguous :: c(:, :)
      !> Default false
      logical, intent(in), optional :: transpose_a, transpose_b
      !> Default 1 and 0 (with `keep` = 0, C need not be defined)
      real(wp), intent(in), optional :: factor, keep
      character(len=1) :: letter_a, letter_b
      real(wp) :: alpha, beta
      integer :: inner

      letter_a = 'N'
      letter_b = 'N'
      alpha = 1.0_wp
      beta = 0.0_wp
      if (present(transpose_a)) letter_a = merge('T', 'N', transpose_a)
      if (present(transpose_b)) letter_b = merge('T', 'N', transpose_b)
      if (present(factor)) alpha = factor
      if (present(keep)) beta = keep
      inner = merge(size(a, 2), size(a, 1), letter_a == 'N')
      if (size(c) == 0) return
      call dgemm(letter_a, letter_b, size(c, 1), size(c, 2), inner, alpha, a, max(1, size(a, 1)), &
                 b, max(1, size(b, 1)), beta, c, size(c, 1))
   end subroutine product_of

   !> C <- factor A^T A + keep C, both triangles filled (C symmetric).
   subroutine gram_product(a, c, factor, keep)
      !> (k, n)
      real(wp), intent(in), contiguous :: a(:, :)
      !> (n, n)
      real(wp), intent(inout), contiguous :: c(:, :)
      !> Default 1 and 0 (with `keep` = 0, C need not be defined)
      real(wp), intent(in), optional :: factor, keep
      real(wp) :: alpha, beta

      alpha = 1.0_wp
      beta = 0.0_wp
      if (present(factor)) alpha = factor
      if (present(keep)) beta = keep
      if (size(c) == 0) return
      call dsyrk('U', 'T', size(c, 2), size(a, 1), alpha, a, max(1, size(a, 1)), beta, c, size(c, 1))
      call mirror_upper(c)
   end subroutine gram_product

   !> Copy the upper triangle into the lower one, tile by tile so that large matrices stay in the cache.
   pure subroutine mirror_upper(a)
      !> (n, n)
      real(wp), intent(inout), contiguous :: a(:, :)
      integer, parameter :: tile = 64
      integer :: i, j, first_i, first_j, n

      n = size(a, 2)
      do first_j = 1, n, tile
         do first_i = first_j, n, tile
            do j = first_j, min(first_j + tile - 1, n)
               do i = max(first_i, j + 1), min(first_i + tile - 1, n)
                  a(i, j) = a(j, i)
               end do
            end do
         end do
      end do
   end subroutine mirror_upper

end module microslip_linalg_dense
