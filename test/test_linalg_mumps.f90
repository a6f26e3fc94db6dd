module test_linalg_mumps
   use microslip_core_error, only: error_t
   use microslip_core_kinds, only: wp
   use microslip_core_text, only: to_text
   use microslip_fe_interface, only: contact_interface_t
   use microslip_fe_model, only: fe_model_t
   use microslip_linalg_dense, only: eigen_symmetric, inverse_spd
   use microslip_linalg_mumps, only: symmetric_factor_t
   use microslip_linalg_sparse, only: from_triplets, symmetric_sparse_t
   use microslip_linalg_sparse_algebra, only: combination, multiply_many
   use support_brick, only: block_model, block_t, to_dense, two_blocks
   use testdrive, only: new_unittest, unittest_type, error_type, check
   implicit none(type, external)
   private

   public :: collect_linalg_mumps

   !> Rounding times the condition of the small models (some 1e5)
   real(wp), parameter :: tolerance = 1.0e-10_wp

contains

   subroutine collect_linalg_mumps(testsuite)
      type(unittest_type), allocatable, intent(out) :: testsuite(:)
      testsuite = [ &
                  new_unittest('solve', test_solve), &
                  new_unittest('schur_complement', test_schur_complement), &
                  new_unittest('solve_interior', test_solve_interior), &
                  new_unittest('inertia', test_inertia), &
                  new_unittest('free_body', test_free_body), &
                  new_unittest('unattached_row', test_unattached_row), &
                  new_unittest('not_positive_definite', test_not_positive_definite), &
                  new_unittest('full_matrix', test_full_matrix), &
                  new_unittest('reproducible', test_reproducible)]
   end subroutine collect_linalg_mumps

   !> A held block of bricks.
   subroutine held_block(model)
      type(fe_model_t), intent(out) :: model
      call block_model([block_t('beam', extent=[0.3_wp, 0.02_wp, 0.03_wp], cells=[5, 2, 2])], ['beam_xmin'], model)
   end subroutine held_block

   pure real(wp) function relative_difference(a, b)
      real(wp), intent(in) :: a(:, :), b(:, :)
      relative_difference = maxval(abs(a - b))/maxval(abs(b))
   end function relative_difference

   subroutine test_solve(error)
      type(error_type), allocatable, intent(out) :: error
      type(error_t), allocatable :: fault
      type(fe_model_t) :: model
      type(symmetric_factor_t) :: factor
      real(wp), allocatable :: x(:, :), b(:, :), y(:)
      integer :: k

      call held_block(model)
      allocate (b(model%row_count(), 40))
      b = reshape([(sin(real(k, wp)), k=1, size(b))], shape(b))
      call factor%factorise(model%stiffness, fault, positive_definite=.true.)
      call check(error,.not. allocated(fault))
      if (allocated(error)) return
      x = b
      call factor%solve(x)
      y = b(:, 7)
      call factor%solve(y)
      call check(error, maxval(abs(y - x(:, 7))) < tolerance*maxval(abs(x)))
      if (allocated(error)) return
      call check(error, relative_difference(matmul(to_dense(model%stiffness), x), b) < tolerance)
      if (allocated(error)) return
      call factor%factorise(model%mass, fault)
      y = b(:, 7)
      call factor%solve(y)
      call check(error, relative_difference(matmul(to_dense(model%mass), reshape(y, [size(y), 1])), b(:, 7:7)) < tolerance)
   end subroutine test_solve

   subroutine test_schur_complement(error)
      type(error_type), allocatable, intent(out) :: error
      type(error_t), allocatable :: fault
      type(fe_model_t) :: model
      type(symmetric_factor_t) :: factor
      real(wp), allocatable :: schur(:, :), full(:, :), exact(:, :)
      integer, allocatable :: b(:)

      call held_block(model)
      b = [100, 5, 77, 6, 33]
      call factor%factorise(model%stiffness, fault, positive_definite=.true., schur_rows=b, schur=schur)
      call check(error,.not. allocated(fault))
      if (allocated(error)) return
      full = to_dense(model%stiffness)
      call inverse_spd(full, fault)
      exact = full(b, b)
      call inverse_spd(exact, fault)
      call check(error, relative_difference(schur, exact) < tolerance)
      if (allocated(error)) return
      call check(error, maxval(abs(schur - transpose(schur))) <= tolerance*maxval(abs(schur)))
   end subroutine test_schur_complement

   !> With Schur rows the factor solves with the interior block, whatever the right-hand side holds on these rows.
   subroutine test_solve_interior(error)
      type(error_type), allocatable, intent(out) :: error
      type(error_t), allocatable :: fault
      type(fe_model_t) :: model
      type(symmetric_factor_t) :: factor
      real(wp), allocatable :: schur(:, :), x(:, :), b(:, :), residual(:, :)
      integer, allocatable :: rows(:), active(:)
      integer :: k

      call held_block(model)
      rows = [100, 5, 77, 6, 33]
      call factor%factorise(model%stiffness, fault, positive_definite=.true., schur_rows=rows, schur=schur)
      allocate (b(model%row_count(), 3))
      b = reshape([(sin(real(k, wp)), k=1, size(b))], shape(b))
      x = b
      call factor%solve(x)
      call check(error, maxval(abs(x(rows, :))) <= 0.0_wp)
      if (allocated(error)) return
      allocate (residual, mold=x)
      call multiply_many(model%stiffness, x, residual)
      residual = residual - b
      active = factor%active_rows()
      call check(error, size(active), model%row_count() - size(rows))
      if (allocated(error)) return
      call check(error, maxval(abs(residual(active, :))) < tolerance)
   end subroutine test_solve_interior

   !> Negative pivots of K - sigma M are the eigenvalues below sigma.
   subroutine test_inertia(error)
      type(error_type), allocatable, intent(out) :: error
      type(error_t), allocatable :: fault
      type(fe_model_t) :: model
      type(symmetric_factor_t) :: factor
      type(symmetric_sparse_t) :: identity
      real(wp), allocatable :: full(:, :), lambda(:)
      integer :: k, count

      call held_block(model)
      full = to_dense(model%stiffness)
      allocate (lambda(size(full, 1)))
      call eigen_symmetric(full, lambda, fault, values_only=.true.)
      identity = from_triplets(size(lambda), [(k, k=1, size(lambda))], [(k, k=1, size(lambda))], &
                               [(1.0_wp, k=1, size(lambda))])
      do count = 0, 12, 4
         call factor%factorise(combination(model%stiffness, -0.5_wp*(lambda(count + 1) + lambda(max(count, 1))) &
                                           *merge(0.5_wp, 1.0_wp, count == 0), identity), fault)
         if (allocated(fault)) then
            call check(error, .false., fault%message)
            return
         end if
         call check(error, factor%negative_pivots(), count)
         if (allocated(error)) return
      end do
   end subroutine test_inertia

   !> A second block without supports: the row that is named belongs to it.
   subroutine test_free_body(error)
      type(error_type), allocatable, intent(out) :: error
      type(error_t), allocatable :: fault
      type(fe_model_t) :: model
      type(symmetric_factor_t) :: factor
      real(wp), allocatable :: schur(:, :)
      integer :: row

      call block_model([block_t('held', cells=[2, 2, 2]), block_t('loose', origin=[3.0_wp, 0.0_wp, 0.0_wp], cells=[6, 3, 2])], &
                       ['held_xmin'], model)
      call factor%factorise(model%stiffness, fault, positive_definite=.true., singular_row=row)
      call check(error, allocated(fault) .and. row > 0)
      if (allocated(error)) return
      call check(error, model%coordinates(1, model%row_node(row)) > 2.0_wp)
      if (allocated(error)) return
      call check(error, index(fault%message, to_text(row)) > 0, fault%message)
      if (allocated(error)) return
      ! One node left out does not hold it either: it can still rotate.
      call factor%factorise(model%stiffness, fault, schur_rows=pack([(row, row=1, model%row_count())], &
                                                                    model%row_node == model%row_node(model%row_count())), &
                            schur=schur, singular_row=row)
      call check(error, allocated(fault) .and. row > 0)
   end subroutine test_free_body

   subroutine test_unattached_row(error)
      type(error_type), allocatable, intent(out) :: error
      type(error_t), allocatable :: fault
      type(symmetric_factor_t) :: factor
      real(wp), allocatable :: schur(:, :)
      integer :: row

      call factor%factorise(from_triplets(5, [1, 2, 4, 5, 1], [1, 2, 4, 5, 2], [3.0_wp, 2.0_wp, 1.0_wp, 5.0_wp, -1.0_wp]), &
                            fault, positive_definite=.true., singular_row=row)
      call check(error, allocated(fault) .and. row == 3)
      if (allocated(error)) return
      call factor%factorise(from_triplets(5, [1, 2, 4, 5, 1], [1, 2, 4, 5, 2], [3.0_wp, 2.0_wp, 1.0_wp, 5.0_wp, -1.0_wp]), &
                            fault, schur_rows=[1, 4], schur=schur, singular_row=row)
      call check(error, allocated(fault) .and. row == 3)
   end subroutine test_unattached_row

   subroutine test_not_positive_definite(error)
      type(error_type), allocatable, intent(out) :: error
      type(error_t), allocatable :: fault
      type(symmetric_factor_t) :: factor
      type(symmetric_sparse_t) :: matrix

      matrix = from_triplets(3, [1, 2, 3, 1], [1, 2, 3, 2], [3.0_wp, 2.0_wp, 1.0_wp, -4.0_wp])
      call factor%factorise(matrix, fault, positive_definite=.true.)
      call check(error, allocated(fault))
      if (allocated(error)) return
      call factor%factorise(matrix, fault)
      call check(error,.not. allocated(fault))
      if (allocated(error)) return
      call check(error, factor%negative_pivots(), 1)
   end subroutine test_not_positive_definite

   !> Every row coupled to every other one.
   subroutine test_full_matrix(error)
      type(error_type), allocatable, intent(out) :: error
      type(error_t), allocatable :: fault
      type(fe_model_t) :: model
      type(symmetric_factor_t) :: factor
      real(wp), allocatable :: x(:)

      call block_model([block_t('brick')], ['brick_xmin'], model)
      call factor%factorise(model%stiffness, fault, positive_definite=.true.)
      call check(error,.not. allocated(fault))
      if (allocated(error)) return
      x = model%stiffness%diagonal()
      call factor%solve(x)
      x = matmul(to_dense(model%stiffness), x) - model%stiffness%diagonal()
      call check(error, maxval(abs(x)) < tolerance*maxval(model%stiffness%diagonal()))
   end subroutine test_full_matrix

   subroutine test_reproducible(error)
      type(error_type), allocatable, intent(out) :: error
      type(error_t), allocatable :: fault
      type(fe_model_t) :: model
      type(contact_interface_t), allocatable :: joints(:)
      type(symmetric_factor_t) :: first, second
      real(wp), allocatable :: schur(:, :), again(:, :), x(:), y(:)
      integer, parameter :: rows(3) = [4, 8, 90]

      call two_blocks(model, joints, [4, 3, 2])
      call first%factorise(model%stiffness, fault, schur_rows=rows, schur=schur)
      call second%factorise(model%stiffness, fault, schur_rows=rows, schur=again)
      x = model%stiffness%diagonal()
      y = x
      call first%solve(x)
      call second%solve(y)
      call check(error, all(abs(schur - again) <= 0.0_wp) .and. all(abs(x - y) <= 0.0_wp))
   end subroutine test_reproducible

end module test_linalg_mumps
