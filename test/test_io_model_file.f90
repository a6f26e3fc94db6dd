!> Tests of the model file: exact round trips, both forms of the mass, damaged contents.
module test_io_model_file
   use, intrinsic :: ieee_arithmetic, only: ieee_quiet_nan, ieee_value
   use microslip_core_error, only: error_t
   use microslip_core_kinds, only: wp
   use microslip_core_text, only: to_text
   use microslip_fe_model, only: fe_model_t
   use microslip_fe_model_check, only: check_model
   use microslip_io_calculix, only: read_model_calculix
   use microslip_io_hdf5, only: hdf5_file_t
   use microslip_io_model_file, only: read_model_hdf5, write_model_hdf5
   use microslip_linalg_sparse, only: symmetric_sparse_t
   use testdrive, only: check, new_unittest, test_failed, testing_error => error_type, unittest_type
   implicit none(type, external)
   private

   public :: collect_io_model_file

   character(len=*), parameter :: scratch = 'build/test_io_model_file.h5'

contains

   subroutine collect_io_model_file(testsuite)
      type(unittest_type), allocatable, intent(out) :: testsuite(:)

      testsuite = [ &
         new_unittest('a model with a general mass comes back exactly', test_general), &
         new_unittest('a model with a mass per node comes back exactly', test_nodal), &
         new_unittest('partly supported nodes', test_supported), &
         new_unittest('damaged contents are named', test_damaged), &
         new_unittest('what no structure has is refused', test_no_structure), &
         new_unittest('other units are refused', test_units)]
   end subroutine collect_io_model_file

   !> The two bricks of CalculiX.
   subroutine bricks(model, with_mass)
      type(fe_model_t), intent(out) :: model
      logical, intent(in) :: with_mass
      type(error_t), allocatable :: lib
      call read_model_calculix('test/data/bricks', 'test/data/bricks.inp', 1.0e-3_wp, 1.0e3_wp, 1.0_wp, model, lib, with_mass)
      deallocate (model%other_elements)
      allocate (model%other_elements(2))
      model%other_elements(1)%type = 'C3D4'
      model%other_elements(1)%connectivity = reshape([1, 2, 3, 5, 2, 3, 4, 6], [4, 2])
      model%other_elements(2)%type = 'MASS'
      model%other_elements(2)%connectivity = reshape([7], [1, 1])
   end subroutine bricks

   subroutine test_general(error)
      type(testing_error), allocatable, intent(out) :: error
      type(fe_model_t) :: model
      call bricks(model, .true.)
      call round_trip(error, model, 'rows')
   end subroutine test_general

   subroutine test_nodal(error)
      type(testing_error), allocatable, intent(out) :: error
      type(fe_model_t) :: model
      call bricks(model, .false.)
      call round_trip(error, model, 'nodes')
   end subroutine test_nodal

   !> Without the first row (x of the first free node) the mass of that node's y and z is still there.
   subroutine test_supported(error)
      type(testing_error), allocatable, intent(out) :: error
      type(fe_model_t) :: model
      call bricks(model, .false.)
      model%row_node = model%row_node(2:)
      model%row_component = model%row_component(2:)
      call drop_first_row(model%stiffness)
      call drop_first_row(model%mass)
      call round_trip(error, model, 'nodes')
   end subroutine test_supported

   subroutine drop_first_row(matrix)
      type(symmetric_sparse_t), intent(inout) :: matrix
      integer :: skip
      skip = matrix%row_start(2) - 1
      matrix%n = matrix%n - 1
      matrix%row_start = matrix%row_start(2:) - skip
      matrix%column = matrix%column(skip + 1:) - 1
      matrix%value = matrix%value(skip + 1:)
   end subroutine drop_first_row

   subroutine round_trip(error, model, form)
      type(testing_error), allocatable, intent(out) :: error
      type(fe_model_t), intent(in) :: model
      character(len=*), intent(in) :: form
      type(fe_model_t) :: back
      type(hdf5_file_t) :: file
      type(error_t), allocatable :: lib
      character(len=:), allocatable :: text
      integer :: k, j

      call write_model_hdf5(scratch, model, lib, title='two bricks', source='CalculiX')
      if (.not. allocated(lib)) call read_model_hdf5(scratch, back, lib)
      if (.not. allocated(lib)) call file%open(scratch, lib)
      if (.not. allocated(lib)) call file%get_attribute('/mass', 'form', text, lib)
      if (allocated(lib)) then
         call test_failed(error, lib%message)
         return
      end if
      call file%close(lib)
      call check(error, text, form)
      if (allocated(error)) return
      call check(error, all(back%coordinates == model%coordinates) .and. all(back%node_label == model%node_label), 'nodes')
      if (allocated(error)) return
      call check(error, all(back%row_node == model%row_node) .and. all(back%row_component == model%row_component), 'rows')
      if (allocated(error)) return
      call check(error, back%elements(1)%type == 'C3D8I' .and. &
         all(back%elements(1)%connectivity == model%elements(1)%connectivity), 'elements')
      if (allocated(error)) return
      call check(error, size(back%other_elements), 2)
      if (allocated(error)) return
      do k = 1, 2
         call check(error, back%other_elements(k)%type == model%other_elements(k)%type .and. &
            all(back%other_elements(k)%connectivity == model%other_elements(k)%connectivity), 'other elements')
         if (allocated(error)) return
      end do
      do k = 1, size(model%node_sets)
         j = back%find_node_set(model%node_sets(k)%name)
         call check(error, j > 0, 'set is missing')
         if (allocated(error)) return
         call check(error, all(back%node_sets(j)%nodes == model%node_sets(k)%nodes), 'sets')
         if (allocated(error)) return
      end do
      call check(error, same(back%stiffness, model%stiffness), 'stiffness')
      if (allocated(error)) return
      call check(error, same(back%mass, model%mass), 'mass')
      call remove()
   end subroutine round_trip

   pure logical function same(a, b)
      type(symmetric_sparse_t), intent(in) :: a, b
      same = a%n == b%n .and. size(a%value) == size(b%value) .and. size(a%column) == size(b%column)
      if (same) same = all(a%row_start == b%row_start) .and. all(a%column == b%column) .and. all(a%value == b%value)
   end function same

   subroutine test_damaged(error)
      type(testing_error), allocatable, intent(out) :: error
      type(fe_model_t) :: model
      integer, allocatable :: i(:)
      real(wp), allocatable :: x(:)

      call bricks(model, .false.)
      i = model%row_node
      i(3) = 99
      call damage_integers('/rows/node', i)
      if (allocated(error)) return
      i(3) = model%row_node(4)
      i(2) = i(3)
      call damage_integers('/rows/node', i)
      if (allocated(error)) return
      i = model%row_component
      i(5) = 0
      call damage_integers('/rows/component', i)
      if (allocated(error)) return
      call damage_integers('/rows/component', i(2:))
      if (allocated(error)) return
      i = model%node_label
      i(3) = i(2)
      call damage_integers('/node_label', i)
      if (allocated(error)) return
      call damage_integers('/node_sets/CLAMP', [2, 1])
      if (allocated(error)) return
      call damage_integers('/elements/C3D10', [2, 1])
      if (allocated(error)) return
      call damage_integers('/stiffness/column_step', [0])
      if (allocated(error)) return
      i = spread(1, 1, model%stiffness%entries())
      call damage_integers('/stiffness/column_step', i)
      if (allocated(error)) return
      i = spread(huge(1), 1, model%row_count())
      call damage_integers('/stiffness/row_length', i)
      if (allocated(error)) return
      x = model%stiffness%value
      x(7) = ieee_value(1.0_wp, ieee_quiet_nan)
      call damage_reals('/stiffness/value', x)
      if (allocated(error)) return
      x = model%stiffness%value
      x(1) = -x(1)
      call damage_reals('/stiffness/value', x)
      if (allocated(error)) return
      call damage_version()
      call remove()

   contains

      !> The message names the first part of the path.
      subroutine damage_integers(path, value)
         character(len=*), intent(in) :: path
         integer, intent(in) :: value(:)
         type(hdf5_file_t) :: file
         type(error_t), allocatable :: lib
         call write_model_hdf5(scratch, model, lib)
         call file%open(scratch, lib, writable=.true.)
         call file%write(path, value, '1', 'damaged', lib)
         call file%close(lib)
         call expect(path(2:scan(path(2:)//'/', '/')))
      end subroutine damage_integers

      subroutine damage_reals(path, value)
         character(len=*), intent(in) :: path
         real(wp), intent(in) :: value(:)
         type(hdf5_file_t) :: file
         type(error_t), allocatable :: lib
         call write_model_hdf5(scratch, model, lib)
         call file%open(scratch, lib, writable=.true.)
         call file%write(path, value, 'N/m', 'damaged', lib)
         call file%close(lib)
         call expect('stiffness')
      end subroutine damage_reals

      subroutine damage_version()
         type(hdf5_file_t) :: file
         type(error_t), allocatable :: lib
         call write_model_hdf5(scratch, model, lib)
         call file%open(scratch, lib, writable=.true.)
         call file%set_attribute('/', 'format_version', 99, lib)
         call file%close(lib)
         call expect('format_version 99')
         if (allocated(error)) return
         call file%create(scratch, lib)
         call file%close(lib)
         call expect('not a model file')
      end subroutine damage_version

      subroutine expect(needle)
         character(len=*), intent(in) :: needle
         type(fe_model_t) :: back
         type(error_t), allocatable :: lib
         call read_model_hdf5(scratch, back, lib)
         if (.not. allocated(lib)) then
            call test_failed(error, 'no error reported, expected one about '//needle)
         else if (index(lib%message, needle) == 0) then
            call test_failed(error, 'message does not name '//needle//': '//lib%message)
         end if
      end subroutine expect

   end subroutine test_damaged

   !> Nodes far away, elements inside out, entries that no positive matrix has.
   subroutine test_no_structure(error)
      type(testing_error), allocatable, intent(out) :: error
      type(fe_model_t) :: model
      type(error_t), allocatable :: lib

      call bricks(model, .true.)
      call check_model(model, lib)
      call check(error, .not. allocated(lib), 'the bricks are refused')
      if (allocated(error)) return
      model%coordinates(2, 5) = 1.0e300_wp
      call expect_fault('node '//to_text(model%node_label(5))//' is at 1.0')
      call bricks(model, .true.)
      model%elements(1)%connectivity(:, 2) = model%elements(1)%connectivity([5, 6, 7, 8, 1, 2, 3, 4], 2)
      call expect_fault('element 2 of type C3D8I')
      call bricks(model, .true.)
      model%elements(1)%connectivity(5:8, 1) = model%elements(1)%connectivity(1:4, 1)
      call expect_fault('element 1 of type C3D8I')
      call bricks(model, .true.)
      model%stiffness%value(2) = 1.01_wp*product(sqrt(model%stiffness%value(model%stiffness%row_start([1, 2]))))
      call expect_fault('the stiffness matrix')
      call bricks(model, .true.)
      model%mass%value = 0.0_wp
      call expect_fault('the mass matrix is zero')

   contains

      subroutine expect_fault(needle)
         character(len=*), intent(in) :: needle
         if (allocated(error)) return
         call check_model(model, lib)
         call check(error, allocated(lib), 'no error reported, expected one about '//needle)
         if (allocated(error)) return
         call check(error, index(lib%message, needle) > 0, needle//' is not named in: '//lib%message)
      end subroutine expect_fault

   end subroutine test_no_structure

   !> Model files are in SI units.
   subroutine test_units(error)
      type(testing_error), allocatable, intent(out) :: error
      type(fe_model_t) :: model, back
      type(hdf5_file_t) :: file
      type(error_t), allocatable :: lib
      character(len=*), parameter :: path(3) = [character(len=16) :: '/coordinates', '/stiffness/value', '/mass/value']
      integer :: k

      call bricks(model, .false.)
      do k = 1, size(path)
         call write_model_hdf5(scratch, model, lib)
         call file%open(scratch, lib, writable=.true.)
         call file%set_attribute(trim(path(k)), 'units', 'mm', lib)
         call file%close(lib)
         call read_model_hdf5(scratch, back, lib)
         call check(error, allocated(lib), trim(path(k))//' in mm is taken')
         if (allocated(error)) return
         call check(error, index(lib%message, "'"//trim(path(k)(2:))//"' is in 'mm'") > 0, lib%message)
         if (allocated(error)) return
      end do
      call remove()
   end subroutine test_units

   subroutine remove()
      integer :: unit
      open (newunit=unit, file=scratch)
      close (unit, status='delete')
   end subroutine remove

end module test_io_model_file
