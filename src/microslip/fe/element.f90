!> Faces of the brick elements, in the node order of Abaqus and CalculiX.
!>
!> A face is a column of 8 node indices: 4 corners, then the mid-side nodes of the edges 1-2, 2-3, 3-4,
!> 4-1 (zeros for a 4-node face). The corners run counter-clockwise seen from outside the element, so
!> that their right-hand normal is the outward normal.
module microslip_fe_element
   use microslip_core_kinds, only: wp
   use microslip_fe_model, only: element_block_t
   implicit none(type, external)
   private

   public :: element_faces, faces_within, surface_faces, twin_faces, nodes_of_faces, face_size
   public :: area_vector, shortest_edge, cross_product

   !> Faces S1 ... S6: corners.
   integer, parameter :: brick_corners(4, 6) = reshape([ &
      1, 4, 3, 2, 5, 6, 7, 8, 1, 2, 6, 5, 2, 3, 7, 6, 3, 4, 8, 7, 4, 1, 5, 8], [4, 6])
   !> Faces S1 ... S6: mid-side nodes of the 20-node brick.
   integer, parameter :: brick_midsides(4, 6) = reshape([ &
      12, 11, 10, 9, 13, 14, 15, 16, 9, 18, 13, 17, 10, 19, 14, 18, 11, 20, 15, 19, 12, 17, 16, 20], [4, 6])

contains

   !> Local node numbers of the faces of an element type; no faces for a type that is not known.
   pure function element_faces(type) result(faces)
      !> 'C3D8', 'C3D8I', 'C3D8R', 'C3D20' or 'C3D20R'
      character(len=*), intent(in) :: type
      !> (8, faces)
      integer, allocatable :: faces(:, :)

      select case (type)
      case ('C3D8', 'C3D8I', 'C3D8R')
         allocate (faces(8, 6), source=0)
         faces(:4, :) = brick_corners
      case ('C3D20', 'C3D20R')
         allocate (faces(8, 6))
         faces(:4, :) = brick_corners
         faces(5:, :) = brick_midsides
      case default
         allocate (faces(8, 0))
      end select
   end function element_faces

   !> All element faces whose nodes are all selected. A face inside the body appears twice.
   pure function faces_within(elements, selected) result(faces)
      type(element_block_t), intent(in) :: elements(:)
      !> (nodes)
      logical, intent(in) :: selected(:)
      !> (8, faces) node indices
      integer, allocatable :: faces(:, :)
      integer, allocatable :: table(:, :)
      integer :: pass, found, block, element, f, k

      do pass = 1, 2
         found = 0
         do block = 1, size(elements)
            table = element_faces(elements(block)%type)
            do element = 1, size(elements(block)%connectivity, 2)
               associate (nodes => elements(block)%connectivity(:, element))
                  do f = 1, size(table, 2)
                     k = face_size(table(:, f))
                     if (.not. all(selected(nodes(table(:k, f))))) cycle
                     found = found + 1
                     if (pass == 2) faces(:k, found) = nodes(table(:k, f))
                  end do
               end associate
            end do
         end do
         if (pass == 1) allocate (faces(8, found), source=0)
      end do
   end function faces_within

   !> The faces of the surface of the mesh whose nodes are all selected.
   pure function surface_faces(elements, selected) result(faces)
      type(element_block_t), intent(in) :: elements(:)
      !> (nodes)
      logical, intent(in) :: selected(:)
      !> (8, faces) node indices
      integer, allocatable :: faces(:, :)
      integer :: k

      faces = faces_within(elements, selected)
      faces = faces(:, pack([(k, k=1, size(faces, 2))], twin_faces(faces) == 0))
   end function surface_faces

   !> For every face the other face with the same corners, 0 if there is none (a face of the surface).
   pure function twin_faces(faces) result(twin)
      !> (8, faces) node indices
      integer, intent(in) :: faces(:, :)
      !> (faces)
      integer, allocatable :: twin(:)
      integer, allocatable :: last(:), previous(:)
      integer :: f, g, lowest, k

      allocate (twin(size(faces, 2)), previous(size(faces, 2)), last(maxval([1, faces])), source=0)
      do f = 1, size(faces, 2)
         lowest = minval(faces(:4, f))
         g = last(lowest)
         do while (g > 0)
            if (all([(any(faces(k, f) == faces(:4, g)), k=1, 4)])) then
               twin(f) = g
               twin(g) = f
            end if
            g = previous(g)
         end do
         previous(f) = last(lowest)
         last(lowest) = f
      end do
   end function twin_faces

   !> The nodes of faces, ascending.
   pure function nodes_of_faces(faces) result(nodes)
      !> (8, faces) node indices
      integer, intent(in) :: faces(:, :)
      integer, allocatable :: nodes(:)
      logical, allocatable :: used(:)
      integer :: k

      allocate (used(0:maxval([0, faces])), source=.false.)
      do k = 1, size(faces, 2)
         used(faces(:, k)) = .true.
      end do
      nodes = pack([(k, k=1, ubound(used, 1))], used(1:))
   end function nodes_of_faces

   !> Number of nodes of a face, 4 or 8.
   pure integer function face_size(face)
      !> (8)
      integer, intent(in) :: face(:)
      face_size = merge(8, 4, face(5) > 0)
   end function face_size

   !> Area times right-hand normal of the quadrilateral with these corners, m^2.
   pure function area_vector(corners) result(area)
      !> (3, 4) m
      real(wp), intent(in) :: corners(:, :)
      real(wp) :: area(3)
      area = 0.5_wp*cross_product(corners(:, 3) - corners(:, 1), corners(:, 4) - corners(:, 2))
   end function area_vector

   !> The shortest edge of faces, m.
   pure real(wp) function shortest_edge(coordinates, faces)
      !> (3, nodes) m
      real(wp), intent(in) :: coordinates(:, :)
      !> (8, faces) node indices
      integer, intent(in) :: faces(:, :)
      integer :: f, k

      shortest_edge = huge(1.0_wp)
      do f = 1, size(faces, 2)
         do k = 1, 4
            shortest_edge = min(shortest_edge, norm2(coordinates(:, faces(k, f)) &
               - coordinates(:, faces(1 + mod(k, 4), f))))
         end do
      end do
   end function shortest_edge

   !> a x b.
   pure function cross_product(a, b) result(c)
      real(wp), intent(in) :: a(3), b(3)
      real(wp) :: c(3)
      c = [a(2)*b(3) - a(3)*b(2), a(3)*b(1) - a(1)*b(3), a(1)*b(2) - a(2)*b(1)]
   end function cross_product

end module microslip_fe_element
