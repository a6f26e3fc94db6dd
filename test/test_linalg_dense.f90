module test_linalg_dense
   use microslip_core_error, only: error_t
   use microslip_core_kinds, only: wp
   use microslip_linalg_dense, only: cholesky_factor, cholesky_solve, eigen_generalised, eigen_symmetric, &
                                     gram_product, inverse_spd, product_of, product_symmetric, solve_general
   use testdrive, only: new_unittest, unittest_type, error_type, check
   implicit none(type, external)
   private

   public :: collect_linalg_dense

   integer, parameter :: n = 70
   !> Rounding of products and solutions with well-conditioned matrices of n rows
   real(wp), parameter :: rounding = 1.0e3_wp*n*epsilon(1.0_wp)

contains

   subroutine collect_linalg_dense(testsuite)
      type(unittest_type), allocatable, intent(out) :: testsuite(:)
      testsuite = [ &
                  new_unittest('cholesky', test_cholesky), &
                  new_unittest('not_positive_definite', test_not_positive_definite), &
                  new_unittest('general_solve', test_general_solve), &
                  new_unittest('eigenvalues', test_eigenvalues), &
                  new_unittest('products', test_products)]
   end subroutine collect_linalg_dense

   !> A symmetric positive definite matrix and a general one.
   subroutine make(spd, general)
      real(wp), allocatable, intent(out) :: spd(:, :), general(:, :)
      integer :: i, j

      allocate (spd(n, n))
      general = reshape([((sin(real(i*j + 3*i, wp)), i=1, n), j=1, n)], [n, n])
      spd = matmul(general, transpose(general))
      do i = 1, n
         spd(i, i) = spd(i, i) + n
      end do
   end subroutine make

   subroutine test_cholesky(error)
      type(error_type), allocatable, intent(out) :: error
      type(error_t), allocatable :: fault
      real(wp), allocatable :: a(:, :), b(:, :), factor(:, :), x(:, :), inverse(:, :), one(:)

      call make(a, b)
      factor = a
      call cholesky_factor(factor, fault)
      call check(error,.not. allocated(fault))
      if (allocated(error)) return
      x = b
      call cholesky_solve(factor, x)
      call check(error, maxval(abs(matmul(a, x) - b)) < rounding)
      if (allocated(error)) return
      one = b(:, 2)
      call cholesky_solve(factor, one)
      call check(error, maxval(abs(one - x(:, 2))) < rounding)
      if (allocated(error)) return
      inverse = a
      call inverse_spd(inverse, fault)
      call check(error, maxval(abs(matmul(inverse, b) - x)) < rounding .and. &
                 maxval(abs(inverse - transpose(inverse))) <= 0.0_wp)
   end subroutine test_cholesky

   subroutine test_not_positive_definite(error)
      type(error_type), allocatable, intent(out) :: error
      type(error_t), allocatable :: fault
      real(wp), allocatable :: a(:, :), b(:, :), lambda(:)

      call make(a, b)
      a(17, 17) = -1.0_wp
      b = a
      call cholesky_factor(b, fault)
      call check(error, allocated(fault))
      if (allocated(error)) return
      call check(error, index(fault%message, 'leading minor 17') > 0, fault%message)
      if (allocated(error)) return
      allocate (lambda(n))
      b = 1.0_wp
      call eigen_generalised(b, a, lambda, fault)
      call check(error, allocated(fault))
      if (allocated(error)) return
      call check(error, index(fault%message, 'leading minor 17') > 0, fault%message)
   end subroutine test_not_positive_definite

   subroutine test_general_solve(error)
      type(error_type), allocatable, intent(out) :: error
      type(error_t), allocatable :: fault
      real(wp), allocatable :: spd(:, :), a(:, :), b(:, :), lu(:, :), x(:, :)
      integer :: i

      call make(spd, a)
      do i = 1, n
         a(i, i) = a(i, i) + n
      end do
      b = spd
      lu = a
      x = b
      call solve_general(lu, x, fault)
      call check(error,.not. allocated(fault))
      if (allocated(error)) return
      call check(error, maxval(abs(matmul(a, x) - b)) < rounding*maxval(abs(b)))
      if (allocated(error)) return
      lu = a
      lu(:, 5) = 0.0_wp
      call solve_general(lu, x, fault)
      call check(error, allocated(fault))
   end subroutine test_general_solve

   subroutine test_eigenvalues(error)
      type(error_type), allocatable, intent(out) :: error
      type(error_t), allocatable :: fault
      real(wp), allocatable :: a(:, :), b(:, :), general(:, :), x(:, :), factor(:, :), lambda(:), values(:), ax(:, :)
      integer :: k

      call make(b, general)
      a = general + transpose(general)
      allocate (lambda(n), values(n))
      x = a
      call eigen_symmetric(x, lambda, fault)
      ax = matmul(a, x)
      do k = 1, n
         ax(:, k) = ax(:, k) - lambda(k)*x(:, k)
      end do
      call check(error, maxval(abs(ax)) < rounding*maxval(abs(lambda)))
      if (allocated(error)) return

      x = a
      factor = b
      call eigen_generalised(x, factor, lambda, fault)
      ax = matmul(a, x)
      do k = 1, n
         ax(:, k) = ax(:, k) - lambda(k)*matmul(b, x(:, k))
      end do
      call check(error, maxval(abs(ax)) < rounding .and. all(lambda(2:) >= lambda(:n - 1)))
      if (allocated(error)) return
      x = a
      factor = b
      call eigen_generalised(x, factor, values, fault, values_only=.true.)
      call check(error, maxval(abs(values - lambda)) < rounding)
   end subroutine test_eigenvalues

   subroutine test_products(error)
      type(error_type), allocatable, intent(out) :: error
      real(wp), allocatable :: a(:, :), b(:, :), c(:, :), y(:), tall(:, :)

      call make(a, b)
      tall = b(:, :9)
      c = b(:9, :9)
      call product_of(tall, tall, c, transpose_a=.true., factor=-2.0_wp, keep=3.0_wp)
      call check(error, maxval(abs(c - 3.0_wp*b(:9, :9) + 2.0_wp*matmul(transpose(tall), tall))) < rounding)
      if (allocated(error)) return
      c = 0.0_wp*a
      call product_of(tall, tall, c, transpose_b=.true.)
      call check(error, maxval(abs(c - matmul(tall, transpose(tall)))) < rounding)
      if (allocated(error)) return
      c = a(:9, :9)
      call gram_product(tall, c, factor=0.5_wp, keep=1.0_wp)
      call check(error, maxval(abs(c - a(:9, :9) - 0.5_wp*matmul(transpose(tall), tall))) < rounding)
      if (allocated(error)) return
      c = 0.0_wp*tall
      call product_symmetric(a, tall, c)
      y = c(:, 1)
      call product_symmetric(a, tall(:, 4), y)
      call check(error, maxval(abs(c - matmul(a, tall))) < rounding*n .and. maxval(abs(c(:, 4) - y)) < rounding*n)
   end subroutine test_products

end module test_linalg_dense
