!> Tests of the CalculiX reader on matrices that CalculiX wrote, and of its errors on files written here.
module test_io_calculix
   use microslip_core_error, only: error_t
   use microslip_core_kinds, only: pi, wp
   use microslip_fe_model, only: fe_model_t
   use microslip_io_calculix, only: calculix_matrices_t, read_calculix_matrices, read_model_calculix
   use microslip_linalg_sparse, only: symmetric_sparse_t
   use testdrive, only: check, new_unittest, test_failed, testing_error => error_type, unittest_type
   implicit none(type, external)
   private

   public :: collect_io_calculix

   !> Two C3D8I elements with hidden nodes, units mm, t, s.
   character(len=*), parameter :: bricks = 'test/data/bricks', mesh = 'test/data/bricks.inp'
   !> Their first frequencies in Hz as CalculiX printed them, in 7 digits.
   real(wp), parameter :: printed(4) = [1063.750_wp, 1492.209_wp, 10141.23_wp, 13935.90_wp]
   real(wp), parameter :: printed_accuracy = 1.0e-6_wp
   !> Base of the files that the tests write.
   character(len=*), parameter :: scratch = 'build/test_io_calculix'

   interface
      subroutine dsygv(itype, jobz, uplo, n, a, lda, b, ldb, w, work, lwork, info)
         import :: wp
         integer, intent(in) :: itype, n, lda, ldb, lwork
         character(len=1), intent(in) :: jobz, uplo
         real(wp), intent(inout) :: a(lda, *), b(ldb, *), work(*)
         real(wp), intent(out) :: w(*)
         integer, intent(out) :: info
      end subroutine dsygv
   end interface

contains

   subroutine collect_io_calculix(testsuite)
      type(unittest_type), allocatable, intent(out) :: testsuite(:)

      testsuite = [ &
         new_unittest('matrices give the frequencies that CalculiX printed', test_frequencies), &
         new_unittest('a model without hidden nodes, SI units', test_model), &
         new_unittest('a small matrix in either triangle', test_small), &
         new_unittest('wrong files are named', test_wrong)]
   end subroutine collect_io_calculix

   !> Dense form of a sparse matrix.
   function dense(matrix) result(a)
      type(symmetric_sparse_t), intent(in) :: matrix
      real(wp), allocatable :: a(:, :)
      integer :: row, k
      allocate (a(matrix%n, matrix%n), source=0.0_wp)
      do row = 1, matrix%n
         do k = matrix%row_start(row), matrix%row_start(row + 1) - 1
            a(row, matrix%column(k)) = matrix%value(k)
            a(matrix%column(k), row) = matrix%value(k)
         end do
      end do
   end function dense

   !> Frequencies in ascending order from the largest eigenvalues of M x = omega^-2 K x (CalculiX's mass of the hidden
   !> nodes is not positive definite).
   function frequencies(stiffness, mass, count) result(f)
      real(wp), intent(in) :: stiffness(:, :), mass(:, :)
      integer, intent(in) :: count
      real(wp) :: f(count)
      real(wp), allocatable :: a(:, :), b(:, :), w(:), work(:)
      integer :: n, info

      n = size(mass, 1)
      a = mass
      b = stiffness
      allocate (w(n), work(10*n))
      call dsygv(1, 'N', 'U', n, a, n, b, n, w, work, size(work), info)
      f = huge(1.0_wp)
      if (info == 0) f = 1.0_wp/(2.0_wp*pi*sqrt(w(n:n - count + 1:-1)))
   end function frequencies

   subroutine test_frequencies(error)
      type(testing_error), allocatable, intent(out) :: error
      type(calculix_matrices_t) :: matrices
      type(error_t), allocatable :: lib
      real(wp) :: f(size(printed))

      call read_calculix_matrices(bricks, matrices, lib)
      call good(error, lib)
      if (allocated(error)) return
      f = frequencies(dense(matrices%stiffness), dense(matrices%mass), size(f))
      call check(error, maxval(abs(f/printed - 1.0_wp)) < printed_accuracy, 'frequencies differ from those printed')
   end subroutine test_frequencies

   !> Guyan's frequencies err by about (f/f_h)^2, f_h the lowest frequency of the hidden nodes on their own.
   subroutine test_model(error)
      type(testing_error), allocatable, intent(out) :: error
      real(wp), parameter :: mm = 1.0e-3_wp, tonne = 1.0e3_wp, second = 1.0_wp
      type(calculix_matrices_t) :: matrices
      type(fe_model_t) :: model, without
      type(error_t), allocatable :: lib
      real(wp), allocatable :: k(:, :), m(:, :)
      real(wp) :: f(size(printed)), f_hidden(1)
      integer, allocatable :: hidden(:)
      integer :: row

      call read_model_calculix(bricks, mesh, mm, tonne, second, model, lib)
      if (.not. allocated(lib)) call read_calculix_matrices(bricks, matrices, lib)
      call good(error, lib)
      if (allocated(error)) return
      call check(error, model%row_count() == 24 .and. model%stiffness%n == 24 .and. model%mass%n == 24, 'wrong size')
      if (allocated(error)) return
      call check(error, maxval(abs(model%node_label(model%row_node) - matrices%label(:24))), 0)
      if (allocated(error)) return
      hidden = pack([(row, row=1, size(matrices%label))], matrices%label > maxval(model%node_label))
      k = dense(matrices%stiffness)
      m = dense(matrices%mass)
      f_hidden = frequencies(k(hidden, hidden), m(hidden, hidden), 1)
      f = frequencies(dense(model%stiffness), dense(model%mass), size(f))
      call check(error, all(abs(f/printed - 1.0_wp) < (f/f_hidden(1))**2 + printed_accuracy), 'frequencies differ')
      if (allocated(error)) return
      ! Without the hidden mass: the same stiffness, and equal components only.
      call read_model_calculix(bricks, mesh, mm, tonne, second, without, lib, condense_hidden_mass=.false.)
      call good(error, lib)
      if (allocated(error)) return
      call check(error, all(without%stiffness%value == model%stiffness%value), 'stiffness differs')
      if (allocated(error)) return
      m = m(:24, :24)*tonne
      call check(error, maxval(abs(dense(without%mass) - m)) <= epsilon(1.0_wp)*maxval(m), 'mass differs')
   end subroutine test_model

   subroutine test_small(error)
      type(testing_error), allocatable, intent(out) :: error
      type(calculix_matrices_t) :: matrices
      type(error_t), allocatable :: lib

      call write_file('.dof', [character(len=40) :: '3.1', '3.2', '70.3'])
      call write_file('.sti', [character(len=40) :: '1 1  2.0000000000000e+00', '2 1 -1.0000000000000e+00', &
         '2 2  1.2345678901234e-30', ' 3  3 3d0', '3 1 0.0'])
      call write_file('.mas', [character(len=40) :: '1 1 .1', '2 2 5', '3 3 9007199254740993e-3'])
      call read_calculix_matrices(scratch, matrices, lib)
      call remove_files()
      call good(error, lib)
      if (allocated(error)) return
      call check(error, all(matrices%label == [3, 3, 70]) .and. all(matrices%component == [1, 2, 3]), 'rows differ')
      if (allocated(error)) return
      call check(error, all(matrices%stiffness%column == [1, 2, 2, 3]), 'pattern differs')
      if (allocated(error)) return
      call check(error, all(matrices%stiffness%value == [2.0_wp, -1.0_wp, 1.2345678901234e-30_wp, 3.0_wp]), 'values differ')
      if (allocated(error)) return
      call check(error, all(matrices%mass%value == [0.1_wp, 5.0_wp, 9007199254740993e-3_wp]), 'values not correctly rounded')
   end subroutine test_small

   subroutine test_wrong(error)
      type(testing_error), allocatable, intent(out) :: error
      character(len=*), parameter :: d(*) = [character(len=40) :: '3.1', '3.2']
      character(len=*), parameter :: k(*) = [character(len=40) :: '1 1 1.0', '2 2 1.0']

      call expect(d(:0), k, k, '.dof')
      if (.not. allocated(error)) call expect([d(:1), '3:2 '//d(1) (5:)], k, k, '.dof, line 2')
      if (.not. allocated(error)) call expect([d(:1), '3.0 '//d(1) (5:)], k, k, '.dof, line 2')
      if (.not. allocated(error)) call expect(d, k(:1), k, 'row 2')
      if (.not. allocated(error)) call expect(d, k, k(2:), '.mas')
      if (.not. allocated(error)) call expect(d, [character(len=40) :: '1 1 1.0', '1 2 nan'], k, '.sti, line 2')
      if (.not. allocated(error)) call expect(d, [character(len=40) :: '1 1 1.0', '1 2 1e400'], k, '.sti, line 2')
      if (.not. allocated(error)) call expect(d, [character(len=40) :: '1 1 1.0', '1 2'], k, '.sti, line 2')
      if (.not. allocated(error)) call expect(d, [character(len=40) :: '1 1 1.0', '1 2 3.0 4'], k, '.sti, line 2')
      if (.not. allocated(error)) call expect(d, [k, '3 1 1.0'//k(1) (8:)], k, '.sti, line 3')
      if (.not. allocated(error)) call expect(d, [k, '1 2 1.0'//k(1) (8:), '2 1 1.0'//k(1) (8:)], k, &
         'one triangle of a symmetric matrix is expected, and the file holds both')
      if (.not. allocated(error)) call expect([character(len=40) :: '3.1', '3.2', '7.1', '3.1'], k, k, &
         'the lines 1 and 4 are both node 3, component 1: CalculiX writes so')
      if (.not. allocated(error)) call expect([d, '7.1'//d(1) (4:)], k, k, 'None of the 3 rows from there on has one')
      if (.not. allocated(error)) call expect_cut_off()
      if (.not. allocated(error)) call expect(d, [k, k(1)], k, 'twice')
      if (.not. allocated(error)) call expect(d, [character(len=40) :: '1 1 1.0', '2 2 0.0'], k, 'row 2')
      if (.not. allocated(error)) call expect(d, k, [character(len=40) :: '1 1 1.0', '2 2 -1.0'], 'row 2')
      if (.not. allocated(error)) call expect_in_model()
      call remove_files()

   contains

      subroutine expect(dof, sti, mas, needle)
         character(len=*), intent(in) :: dof(:), sti(:), mas(:), needle
         type(calculix_matrices_t) :: matrices
         type(error_t), allocatable :: lib
         call write_file('.dof', dof)
         call write_file('.sti', sti)
         call write_file('.mas', mas)
         call read_calculix_matrices(scratch, matrices, lib)
         call bad(error, lib, needle)
      end subroutine expect

      !> A number that lost its last digits would be another number.
      subroutine expect_cut_off()
         type(calculix_matrices_t) :: matrices
         type(error_t), allocatable :: lib
         integer :: unit

         call write_file('.dof', d)
         call write_file('.mas', k)
         open (newunit=unit, file=scratch//'.sti', access='stream', form='unformatted', status='replace')
         write (unit) '1 1 1.0'//new_line('a')//'2 2 1.2345678'
         close (unit)
         call read_calculix_matrices(scratch, matrices, lib)
         call bad(error, lib, '.sti, line 2: the last line has no end: the file is cut off')
      end subroutine expect_cut_off

      !> A row of a node that the mesh does not have.
      subroutine expect_in_model()
         type(fe_model_t) :: model
         type(error_t), allocatable :: lib
         call write_file('.dof', d)
         call write_file('.sti', k)
         call write_file('.mas', k)
         call read_model_calculix(scratch, mesh, 1.0_wp, 1.0_wp, 1.0_wp, model, lib)
         call bad(error, lib, 'node 3')
         if (allocated(error)) return
         call read_model_calculix('build/no_such_base', mesh, 1.0_wp, 1.0_wp, 1.0_wp, model, lib)
         call bad(error, lib, 'build/no_such_base.dof')
      end subroutine expect_in_model

   end subroutine test_wrong

   subroutine write_file(suffix, lines)
      character(len=*), intent(in) :: suffix, lines(:)
      integer :: unit, i
      open (newunit=unit, file=scratch//suffix, status='replace')
      write (unit, '(a)') (trim(lines(i)), i=1, size(lines))
      close (unit)
   end subroutine write_file

   subroutine remove_files()
      character(len=*), parameter :: suffix(*) = ['.dof', '.sti', '.mas']
      integer :: unit, i
      do i = 1, size(suffix)
         open (newunit=unit, file=scratch//suffix(i))
         close (unit, status='delete')
      end do
   end subroutine remove_files

   subroutine good(error, lib)
      type(testing_error), allocatable, intent(out) :: error
      type(error_t), allocatable, intent(in) :: lib
      if (allocated(lib)) call test_failed(error, lib%message)
   end subroutine good

   subroutine bad(error, lib, needle)
      type(testing_error), allocatable, intent(out) :: error
      type(error_t), allocatable, intent(in) :: lib
      character(len=*), intent(in) :: needle
      if (.not. allocated(lib)) then
         call test_failed(error, 'no error reported, expected one about '//needle)
      else if (index(lib%message, needle) == 0) then
         call test_failed(error, 'message does not name '//needle//': '//lib%message)
      end if
   end subroutine bad

end module test_io_calculix
