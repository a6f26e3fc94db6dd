!> Faces of elements that the program has no shape functions for (tetrahedra, wedges, shells): a joint or a load by area that
!> has some of them would leave them out, and is refused.
module microslip_fe_foreign_faces
   use microslip_core_text, only: to_text
   use microslip_fe_model, only: element_block_t, fe_model_t
   implicit none(type, external)
   private

   public :: foreign_faces

   !> Corners of the faces; 0 behind the third of a triangle.
   integer, parameter :: tetrahedron(4, 4) = reshape([1, 2, 3, 0, 1, 4, 2, 0, 2, 4, 3, 0, 3, 4, 1, 0], [4, 4])
   integer, parameter :: wedge(4, 5) = reshape([1, 2, 3, 0, 4, 6, 5, 0, 1, 4, 5, 2, 2, 5, 6, 3, 3, 6, 4, 1], [4, 5])
   integer, parameter :: pyramid(4, 5) = reshape([1, 2, 3, 4, 1, 5, 2, 0, 2, 5, 3, 0, 3, 5, 4, 0, 4, 5, 1, 0], [4, 5])

contains

   !> Which elements have faces among nodes that no known face covers: "12 faces of C3D10 elements"; '' if there are none.
   pure function foreign_faces(model, nodes, faces) result(text)
      type(fe_model_t), intent(in) :: model
      !> Node indices
      integer, intent(in) :: nodes(:)
      !> (8, faces) node indices of the faces that are known
      integer, intent(in) :: faces(:, :)
      character(len=:), allocatable :: text
      logical, allocatable :: selected(:), covered(:)
      integer, allocatable :: table(:, :)
      integer :: b, e, f, n, found

      text = ''
      if (.not. allocated(model%other_elements)) return
      allocate (selected(model%node_count()), covered(model%node_count()), source=.false.)
      selected(nodes) = .true.
      do f = 1, size(faces, 2)
         covered(faces(:4, f)) = .true.
      end do
      do b = 1, size(model%other_elements)
         associate (block => model%other_elements(b))
            table = faces_of(block)
            found = 0
            do e = 1, size(block%connectivity, 2)
               do f = 1, size(table, 2)
                  n = count(table(:, f) > 0)
                  associate (corners => block%connectivity(table(:n, f), e))
                     if (.not. all(selected(corners))) cycle
                     ! A quadrangle may be the face of a brick as well, a triangle cannot.
                     if (n == 4 .and. all(covered(corners))) cycle
                     found = found + 1
                  end associate
               end do
            end do
            if (found == 0) cycle
            if (text /= '') text = text//', '
            text = text//to_text(found)//' of '//block%type
         end associate
      end do
   end function foreign_faces

   !> Corners of the faces of a solid; a shell or a plane element is a face itself.
   pure function faces_of(block) result(table)
      type(element_block_t), intent(in) :: block
      integer, allocatable :: table(:, :)
      integer :: n, k

      n = size(block%connectivity, 1)
      allocate (table(4, 0))
      if (index(block%type, 'C3D') > 0) then
         if (n == 4 .or. n == 10) table = tetrahedron
         if (n == 6 .or. n == 15) table = wedge
         if (n == 5 .or. n == 13) table = pyramid
      else if (any(n == [3, 4, 6, 8]) .and. scan(block%type(:1), 'SM') == 1) then
         k = merge(3, 4, n == 3 .or. n == 6)
         table = reshape([1, 2, 3, merge(4, 0, k == 4)], [4, 1])
      end if
   end function faces_of

end module microslip_fe_foreign_faces
