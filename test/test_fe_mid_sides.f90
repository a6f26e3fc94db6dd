!> Tests of the order of mid-side nodes.
module test_fe_mid_sides
   use microslip_core_error, only: error_t
   use microslip_core_kinds, only: wp
   use microslip_fe_mid_sides, only: check_mid_sides
   use microslip_fe_model, only: fe_model_t
   use support_mesh, only: two_blocks
   use testdrive, only: check, error_type, new_unittest, unittest_type
   implicit none(type, external)
   private

   public :: collect_fe_mid_sides

   !> Place of node k of a gmsh brick, and of one of Nastran, in the order of Abaqus
   integer, parameter :: gmsh(20) = [1, 2, 3, 4, 5, 6, 7, 8, 9, 12, 17, 10, 18, 11, 19, 20, 13, 16, 14, 15]
   integer, parameter :: nastran(20) = [1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 17, 18, 19, 20, 13, 14, 15, 16]

contains

   subroutine collect_fe_mid_sides(testsuite)
      type(unittest_type), allocatable, intent(out) :: testsuite(:)

      testsuite = [ &
         new_unittest('other orders are named', test_orders), &
         new_unittest('curved edges are right', test_curved)]
   end subroutine collect_fe_mid_sides

   subroutine test_orders(error)
      type(error_type), allocatable, intent(out) :: error
      type(fe_model_t) :: model, wrong
      type(error_t), allocatable :: failed

      model = two_blocks('C3D20R', [3, 2, 1])
      call check_mid_sides(model, failed)
      call check(error, .not. allocated(failed))
      if (allocated(error)) return
      wrong = model
      wrong%elements(1)%connectivity = wrong%elements(1)%connectivity(gmsh, :)
      call expect(wrong, '12 of 12 elements of type C3D20R')
      if (.not. allocated(error)) call expect(wrong, 'they are in the order of gmsh')
      if (allocated(error)) return
      wrong = model
      wrong%elements(1)%connectivity(:, 2:3) = wrong%elements(1)%connectivity(nastran, 2:3)
      call expect(wrong, '2 of 12 elements')
      if (.not. allocated(error)) call expect(wrong, 'in the order of Nastran and Ansys')
      if (allocated(error)) return
      wrong = model
      wrong%elements(1)%connectivity(9:10, :) = wrong%elements(1)%connectivity([10, 9], :)
      call expect(wrong, 'the mid-side nodes are not in the order of Abaqus')

   contains

      subroutine expect(model, words)
         type(fe_model_t), intent(in) :: model
         character(len=*), intent(in) :: words

         call check_mid_sides(model, failed)
         call check(error, allocated(failed), 'refused: '//words)
         if (.not. allocated(error)) call check(error, index(failed%message, words) > 0, failed%message)
      end subroutine expect

   end subroutine test_orders

   !> Edges that are arcs of a right angle: their middles are (sqrt(2) - 1)/2 of the chord off it.
   subroutine test_curved(error)
      type(error_type), allocatable, intent(out) :: error
      type(fe_model_t) :: model
      type(error_t), allocatable :: failed
      integer :: k

      model = two_blocks('C3D20', [1, 1, 1])
      associate (nodes => model%elements(1)%connectivity(:, 1))
         do k = 9, 15, 2
            model%coordinates(2, nodes(k)) = model%coordinates(2, nodes(k)) + 0.5_wp*(sqrt(2.0_wp) - 1.0_wp) &
               & *norm2(model%coordinates(:, nodes(2)) - model%coordinates(:, nodes(1)))
         end do
      end associate
      call check_mid_sides(model, failed)
      call check(error, .not. allocated(failed), 'a curved edge is refused')
   end subroutine test_curved

end module test_fe_mid_sides
