!> Mid-side nodes of 20-node bricks: other programs number them in other orders, and none of the matrices would show it.
module microslip_fe_mid_sides
   use microslip_core_error, only: bad_input, error_t
   use microslip_core_kinds, only: wp
   use microslip_core_text, only: to_text
   use microslip_fe_model, only: fe_model_t
   implicit none(type, external)
   private

   public :: check_mid_sides

   !> Corners of the edges whose middles are nodes 9 to 20.
   integer, parameter :: edge(2, 12) = reshape([1, 2, 2, 3, 3, 4, 4, 1, 5, 6, 6, 7, 7, 8, 8, 5, 1, 5, 2, 6, 3, 7, 4, 8], [2, 12])
   !> Node 8 + k of Abaqus is node order(k) of gmsh, and of Nastran, Ansys and I-DEAS.
   integer, parameter :: gmsh(12) = [9, 12, 14, 10, 17, 19, 20, 18, 11, 13, 15, 16], &
      nastran(12) = [9, 10, 11, 12, 17, 18, 19, 20, 13, 14, 15, 16], own(12) = [9, 10, 11, 12, 13, 14, 15, 16, 17, 18, 19, 20]
   !> Farthest place from the middle of an edge, over its length: that of a semicircle.
   real(wp), parameter :: farthest = 0.5_wp

contains

   !> Every mid-side node is near the middle of its edge.
   subroutine check_mid_sides(model, error)
      type(fe_model_t), intent(in) :: model
      !> Names the first element; not the file
      type(error_t), allocatable, intent(out) :: error
      integer :: b, e, k, wrong, first

      if (.not. allocated(model%elements)) return
      do b = 1, size(model%elements)
         associate (nodes => model%elements(b)%connectivity)
            if (size(nodes, 1) /= 20) cycle
            wrong = 0
            first = 0
            do e = 1, size(nodes, 2)
               if (misplaced(model, nodes(:, e), own) == 0) cycle
               if (wrong == 0) first = e
               wrong = wrong + 1
            end do
            if (wrong == 0) cycle
            k = misplaced(model, nodes(:, first), own)
            call bad_input(error, to_text(wrong)//' of '//to_text(size(nodes, 2))//' elements of type '// &
               model%elements(b)%type//' have mid-side nodes far from the middles of their edges; the first has node '// &
               to_text(model%node_label(nodes(8 + k, first)))//' between '// &
               to_text(model%node_label(nodes(edge(1, k), first)))//' and '// &
               to_text(model%node_label(nodes(edge(2, k), first)))//order_in_words(nodes(:, first)))
            return
         end associate
      end do

   contains

      !> Whose order it is.
      function order_in_words(nodes) result(text)
         integer, intent(in) :: nodes(:)
         character(len=:), allocatable :: text

         text = ': the mid-side nodes are not in the order of Abaqus'
         if (misplaced(model, nodes, gmsh) == 0) text = ': they are in the order of gmsh, not in that of Abaqus'
         if (misplaced(model, nodes, nastran) == 0) text = ': they are in the order of Nastran and Ansys, not in that of Abaqus'
      end function order_in_words

   end subroutine check_mid_sides

   !> The first edge whose middle is not where the node is, 0 if there is none.
   pure integer function misplaced(model, nodes, order)
      type(fe_model_t), intent(in) :: model
      !> (20) of one element
      integer, intent(in) :: nodes(:)
      !> Which node belongs to the middle of which edge
      integer, intent(in) :: order(12)
      integer :: k

      do k = 1, 12
         misplaced = k
         associate (a => model%coordinates(:, nodes(edge(1, k))), b => model%coordinates(:, nodes(edge(2, k))))
            if (norm2(model%coordinates(:, nodes(order(k))) - 0.5_wp*(a + b)) > farthest*norm2(b - a)) return
         end associate
      end do
      misplaced = 0
   end function misplaced

end module microslip_fe_mid_sides
