module test_linalg_eigenpairs
   use microslip_core_error, only: error_t
   use microslip_core_kinds, only: wp
   use microslip_fe_model, only: fe_model_t
   use microslip_linalg_dense, only: eigen_generalised
   use microslip_linalg_eigenpairs, only: eigen_record_t, nearest_eigenpairs
   use microslip_linalg_mumps, only: symmetric_factor_t
   use microslip_linalg_sparse, only: from_triplets, symmetric_sparse_t
   use microslip_linalg_sparse_algebra, only: combination, submatrix
   use support_brick, only: block_model, block_t, to_dense
   use testdrive, only: new_unittest, unittest_type, error_type, check
   implicit none(type, external)
   private

   public :: collect_linalg_eigenpairs

   !> Rounding of the dense reference: epsilon times largest over smallest eigenvalue, which is 1e7 here
   real(wp), parameter :: tolerance = 10.0_wp*epsilon(1.0_wp)*1.0e7_wp

contains

   subroutine collect_linalg_eigenpairs(testsuite)
      type(unittest_type), allocatable, intent(out) :: testsuite(:)
      testsuite = [ &
                  new_unittest('lowest', test_lowest), &
                  new_unittest('double_eigenvalues', test_double_eigenvalues), &
                  new_unittest('shift_inside', test_shift_inside), &
                  new_unittest('schur_rows_held', test_schur_rows_held), &
                  new_unittest('massless_rows', test_massless_rows), &
                  new_unittest('all_pairs', test_all_pairs), &
                  new_unittest('too_many', test_too_many), &
                  new_unittest('reproducible', test_reproducible)]
   end subroutine collect_linalg_eigenpairs

   !> A cantilever; `width` = `height` gives double bending frequencies.
   subroutine cantilever(model, height, cells)
      type(fe_model_t), intent(out) :: model
      real(wp), intent(in) :: height
      integer, intent(in) :: cells(3)
      call block_model([block_t('beam', extent=[0.3_wp, 0.02_wp, height], cells=cells)], ['beam_xmin'], model)
   end subroutine cantilever

   !> All eigenvalues by the dense solver.
   function dense_eigenvalues(stiffness, mass) result(lambda)
      type(symmetric_sparse_t), intent(in) :: stiffness, mass
      real(wp), allocatable :: lambda(:), a(:, :), b(:, :)
      type(error_t), allocatable :: fault

      a = to_dense(stiffness)
      b = to_dense(mass)
      allocate (lambda(size(a, 1)))
      call eigen_generalised(a, b, lambda, fault, values_only=.true.)
   end function dense_eigenvalues

   !> Relative error of the eigenvalues, and |X^T M X - I|.
   subroutine compare(error, mass, lambda, exact, vectors)
      type(error_type), allocatable, intent(out) :: error
      type(symmetric_sparse_t), intent(in) :: mass
      real(wp), intent(in) :: lambda(:), exact(:), vectors(:, :)
      real(wp), allocatable :: gram(:, :)
      integer :: k

      call check(error, maxval(abs(lambda/exact - 1.0_wp)), 0.0_wp, thr=tolerance)
      if (allocated(error)) return
      gram = matmul(transpose(vectors), matmul(to_dense(mass), vectors))
      do k = 1, size(lambda)
         gram(k, k) = gram(k, k) - 1.0_wp
      end do
      call check(error, maxval(abs(gram)), 0.0_wp, thr=tolerance)
      if (allocated(error)) return
      call check(error, all(maxval(vectors, dim=1) >= -minval(vectors, dim=1)), 'largest component is negative')
   end subroutine compare

   subroutine test_lowest(error)
      type(error_type), allocatable, intent(out) :: error
      type(error_t), allocatable :: fault
      type(fe_model_t) :: model
      type(symmetric_factor_t) :: factor
      type(eigen_record_t) :: record
      real(wp), allocatable :: lambda(:), vectors(:, :), exact(:), residual(:, :)
      integer :: k

      call cantilever(model, 0.03_wp, [14, 2, 2])
      exact = dense_eigenvalues(model%stiffness, model%mass)
      call factor%factorise(model%stiffness, fault)
      call nearest_eigenpairs(model%mass, factor, 0.0_wp, 12, lambda, vectors, record, fault)
      call check(error,.not. allocated(fault))
      if (allocated(error)) return
      call compare(error, model%mass, lambda, exact(:12), vectors)
      if (allocated(error)) return
      residual = matmul(to_dense(model%stiffness), vectors) &
                 - matmul(to_dense(model%mass), vectors*spread(lambda, 1, size(vectors, 1)))
      ! The stiffness of 1e10 N/m magnifies the last digits of the vectors.
      call check(error, maxval(abs(residual)) < 1.0e-9_wp*maxval(abs(to_dense(model%stiffness)))*maxval(abs(vectors)))
      if (allocated(error)) return
      call check(error, record%residual < tolerance .and. record%basis < model%row_count() .and. &
                 record%solves >= record%basis)
      if (allocated(error)) return
      call check(error, all([(lambda(k + 1) >= lambda(k), k=1, 11)]))
   end subroutine test_lowest

   subroutine test_double_eigenvalues(error)
      type(error_type), allocatable, intent(out) :: error
      type(error_t), allocatable :: fault
      type(fe_model_t) :: model
      type(symmetric_factor_t) :: factor
      type(eigen_record_t) :: record
      real(wp), allocatable :: lambda(:), vectors(:, :), exact(:)

      call cantilever(model, 0.02_wp, [14, 2, 2])
      exact = dense_eigenvalues(model%stiffness, model%mass)
      call check(error, exact(2), exact(1), thr=1.0e-8_wp, rel=.true.)
      if (allocated(error)) return
      call factor%factorise(model%stiffness, fault)
      call nearest_eigenpairs(model%mass, factor, 0.0_wp, 9, lambda, vectors, record, fault)
      call compare(error, model%mass, lambda, exact(:9), vectors)
   end subroutine test_double_eigenvalues

   !> The pairs nearest to a shift inside the spectrum.
   subroutine test_shift_inside(error)
      type(error_type), allocatable, intent(out) :: error
      type(error_t), allocatable :: fault
      type(fe_model_t) :: model
      type(symmetric_factor_t) :: factor
      type(eigen_record_t) :: record
      real(wp), allocatable :: lambda(:), vectors(:, :), exact(:)
      real(wp) :: shift

      call cantilever(model, 0.03_wp, [10, 2, 2])
      exact = dense_eigenvalues(model%stiffness, model%mass)
      shift = 0.5_wp*(exact(5) + exact(6))
      call factor%factorise(combination(model%stiffness, -shift, model%mass), fault)
      call nearest_eigenpairs(model%mass, factor, shift, 4, lambda, vectors, record, fault)
      exact = pack(exact, abs(exact - shift) <= maxval(abs(lambda - shift))*(1.0_wp + tolerance))
      call check(error, size(exact), 4)
      if (allocated(error)) return
      call compare(error, model%mass, lambda, exact, vectors)
   end subroutine test_shift_inside

   !> Rows left out of the factor do not move.
   subroutine test_schur_rows_held(error)
      type(error_type), allocatable, intent(out) :: error
      type(error_t), allocatable :: fault
      type(fe_model_t) :: model
      type(symmetric_factor_t) :: factor
      type(eigen_record_t) :: record
      real(wp), allocatable :: lambda(:), vectors(:, :), exact(:), schur(:, :)
      integer, allocatable :: active(:)
      integer :: k

      call cantilever(model, 0.03_wp, [10, 2, 2])
      call factor%factorise(model%stiffness, fault, schur_rows=[(k, k=100, 130)], schur=schur)
      active = factor%active_rows()
      exact = dense_eigenvalues(submatrix(model%stiffness, active), submatrix(model%mass, active))
      call nearest_eigenpairs(model%mass, factor, 0.0_wp, 6, lambda, vectors, record, fault)
      call compare(error, model%mass, lambda, exact(:6), vectors)
      if (allocated(error)) return
      call check(error, maxval(abs(vectors(100:130, :))) <= 0.0_wp)
   end subroutine test_schur_rows_held

   !> A chain in which every second mass is missing behaves like the chain of the others with half the stiffness.
   subroutine test_massless_rows(error)
      type(error_type), allocatable, intent(out) :: error
      type(error_t), allocatable :: fault
      type(symmetric_sparse_t) :: stiffness, mass, coarse, unit
      type(symmetric_factor_t) :: factor
      type(eigen_record_t) :: record
      real(wp), allocatable :: lambda(:), vectors(:, :), exact(:)
      integer, parameter :: n = 40
      integer :: k

      stiffness = chain(n, 2.0_wp)
      mass = from_triplets(n, [(k, k=1, n)], [(k, k=1, n)], [(real(1 - mod(k, 2), wp), k=1, n)])
      coarse = chain(n/2, 1.0_wp)
      unit = from_triplets(n/2, [(k, k=1, n/2)], [(k, k=1, n/2)], [(1.0_wp, k=1, n/2)])
      exact = dense_eigenvalues(coarse, unit)
      call factor%factorise(stiffness, fault)
      call nearest_eigenpairs(mass, factor, 0.0_wp, 5, lambda, vectors, record, fault)
      call compare(error, mass, lambda, exact(:5), vectors)
      if (allocated(error)) return
      call nearest_eigenpairs(mass, factor, 0.0_wp, n/2, lambda, vectors, record, fault)
      call compare(error, mass, lambda, exact, vectors)
      if (allocated(error)) return
      call nearest_eigenpairs(mass, factor, 0.0_wp, n/2 + 1, lambda, vectors, record, fault)
      call check(error, allocated(fault))

   contains

      !> Masses in a row between springs, the first one fixed to the ground, the last one free.
      function chain(masses, spring) result(matrix)
         integer, intent(in) :: masses
         real(wp), intent(in) :: spring
         type(symmetric_sparse_t) :: matrix
         integer :: i
         matrix = from_triplets(masses, [(i, i=1, masses), (i, i=1, masses - 1)], [(i, i=1, masses), (i + 1, i=1, masses - 1)], &
                                [(2.0_wp*spring, i=1, masses - 1), spring, (-spring, i=1, masses - 1)])
      end function chain

   end subroutine test_massless_rows

   subroutine test_all_pairs(error)
      type(error_type), allocatable, intent(out) :: error
      type(error_t), allocatable :: fault
      type(fe_model_t) :: model
      type(symmetric_factor_t) :: factor
      type(eigen_record_t) :: record
      real(wp), allocatable :: lambda(:), vectors(:, :), exact(:)

      call block_model([block_t('cube', cells=[2, 2, 2])], ['cube_xmin'], model)
      exact = dense_eigenvalues(model%stiffness, model%mass)
      call factor%factorise(model%stiffness, fault)
      call nearest_eigenpairs(model%mass, factor, 0.0_wp, model%row_count(), lambda, vectors, record, fault)
      call check(error,.not. allocated(fault))
      if (allocated(error)) return
      call compare(error, model%mass, lambda, exact, vectors)
   end subroutine test_all_pairs

   subroutine test_too_many(error)
      type(error_type), allocatable, intent(out) :: error
      type(error_t), allocatable :: fault
      type(fe_model_t) :: model
      type(symmetric_factor_t) :: factor
      type(eigen_record_t) :: record
      real(wp), allocatable :: lambda(:), vectors(:, :)

      call block_model([block_t('cube', cells=[1, 1, 1])], ['cube_xmin'], model)
      call factor%factorise(model%stiffness, fault)
      call nearest_eigenpairs(model%mass, factor, 0.0_wp, 13, lambda, vectors, record, fault)
      call check(error, allocated(fault))
      if (allocated(error)) return
      call check(error, index(fault%message, 'only 12 exist') > 0, fault%message)
   end subroutine test_too_many

   subroutine test_reproducible(error)
      type(error_type), allocatable, intent(out) :: error
      type(error_t), allocatable :: fault
      type(fe_model_t) :: model
      type(symmetric_factor_t) :: factor
      type(eigen_record_t) :: record
      real(wp), allocatable :: lambda(:), vectors(:, :), lambda_2(:), vectors_2(:, :)

      call cantilever(model, 0.03_wp, [10, 2, 2])
      call factor%factorise(model%stiffness, fault)
      call nearest_eigenpairs(model%mass, factor, 0.0_wp, 6, lambda, vectors, record, fault)
      call nearest_eigenpairs(model%mass, factor, 0.0_wp, 6, lambda_2, vectors_2, record, fault)
      call check(error, maxval(abs(lambda_2/lambda - 1.0_wp)) < tolerance .and. &
                 maxval(abs(vectors - vectors_2)) < tolerance*maxval(abs(vectors)))
   end subroutine test_reproducible

end module test_linalg_eigenpairs
