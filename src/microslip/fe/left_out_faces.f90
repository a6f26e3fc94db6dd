!> Places beside an interface where the two bodies meet as well, but no interface is: faces that were left out.
!>
!> Two faces of the surface of the mesh that lie on each other with opposite normals, share no node, touch nodes of an
!> interface on either side, and do not belong to one interface with all their corners.
module microslip_fe_left_out_faces
   use microslip_core_kinds, only: wp
   use microslip_fe_element, only: area_vector, shortest_edge, surface_faces
   use microslip_fe_interface, only: contact_interface_t
   use microslip_fe_model, only: fe_model_t
   use microslip_fe_pairing, only: match_points
   implicit none(type, external)
   private

   public :: left_out_t, find_left_out

   !> Cosine of the angle between a face's normal and the interface's from which on the face lies in its plane.
   real(wp), parameter :: in_plane = 0.99_wp
   !> Centres of faces closer than this part of the shortest edge lie on each other.
   real(wp), parameter :: same_place = 1.0e-2_wp

   type :: left_out_t
      !> Faces left out on one side, and of the interface itself; their areas, m^2
      integer :: faces = 0, faces_of_interface = 0
      real(wp) :: area = 0.0_wp, area_of_interface = 0.0_wp
      !> Index of a corner of the first one, 0 if there is none
      integer :: first_node = 0
   end type left_out_t

contains

   !> What was left out beside every interface.
   subroutine find_left_out(model, contacts, left_out)
      type(fe_model_t), intent(in) :: model
      !> (interfaces)
      type(contact_interface_t), intent(in) :: contacts(:)
      !> (interfaces)
      type(left_out_t), allocatable, intent(out) :: left_out(:)
      integer, allocatable :: faces(:, :), owner(:)
      logical, allocatable :: candidate(:)
      integer :: k, f, last

      allocate (left_out(size(contacts)), owner(model%node_count()))
      if (.not. allocated(model%elements)) return
      faces = surface_faces(model%elements, spread(.true., 1, model%node_count()))
      ! Side A of interface k owns a node as 2 k, side B as 2 k + 1.
      owner = 0
      do k = 1, size(contacts)
         owner(contacts(k)%node_a) = 2*k
         owner(pack(contacts(k)%node_b, contacts(k)%node_b > 0)) = 2*k + 1
      end do
      allocate (candidate(size(faces, 2)))
      do f = 1, size(faces, 2)
         last = owner(faces(1, f))
         candidate(f) = any(owner(faces(:4, f)) > 0) .and. (last == 0 .or. any(owner(faces(:4, f)) /= last))
      end do
      faces = faces(:, pack([(f, f=1, size(faces, 2))], candidate))
      do k = 1, size(contacts)
         left_out(k)%faces_of_interface = size(contacts(k)%faces, 2)
         do f = 1, size(contacts(k)%faces, 2)
            left_out(k)%area_of_interface = left_out(k)%area_of_interface + &
               & norm2(area_vector(model%coordinates(:, contacts(k)%node_a(contacts(k)%faces(:4, f)))))
         end do
         call look_beside(model, contacts(k), faces, owner, k, left_out(k))
      end do
   end subroutine find_left_out

   !> Faces of both sides beside one interface that lie on each other.
   subroutine look_beside(model, contact, faces, owner, k, left_out)
      type(fe_model_t), intent(in) :: model
      type(contact_interface_t), intent(in) :: contact
      !> (8, faces) candidates; (nodes) owner
      integer, intent(in) :: faces(:, :), owner(:)
      !> Number of the interface
      integer, intent(in) :: k
      type(left_out_t), intent(inout) :: left_out
      integer, allocatable :: of_a(:), of_b(:), partner(:)
      real(wp), allocatable :: centre_a(:, :), centre_b(:, :)
      integer :: m

      of_a = faces_facing(-contact%frame(:, 1), 2*k)
      of_b = faces_facing(contact%frame(:, 1), 2*k + 1)
      if (size(of_a) == 0 .or. size(of_b) == 0) return
      centre_a = centres(of_a)
      centre_b = centres(of_b)
      partner = match_points(centre_a, centre_b, same_place*shortest_edge(model%coordinates, faces(:, of_a)))
      do m = 1, size(of_a)
         if (partner(m) == 0) cycle
         left_out%faces = left_out%faces + 1
         left_out%area = left_out%area + norm2(area_vector(model%coordinates(:, faces(:4, of_a(m)))))
         if (left_out%first_node == 0) left_out%first_node = faces(findloc(owner(faces(:4, of_a(m))) /= 2*k, .true., 1), of_a(m))
      end do

   contains

      !> Candidates that touch a side and face a direction.
      function faces_facing(direction, side) result(list)
         real(wp), intent(in) :: direction(3)
         integer, intent(in) :: side
         integer, allocatable :: list(:)
         real(wp) :: area(3)
         integer :: f

         allocate (list(0))
         do f = 1, size(faces, 2)
            if (.not. any(owner(faces(:4, f)) == side)) cycle
            area = area_vector(model%coordinates(:, faces(:4, f)))
            if (dot_product(area, direction) > in_plane*norm2(area)) list = [list, f]
         end do
      end function faces_facing

      !> Middle of the corners, (3, list), m.
      function centres(list) result(x)
         integer, intent(in) :: list(:)
         real(wp), allocatable :: x(:, :)
         integer :: f

         allocate (x(3, size(list)))
         do f = 1, size(list)
            x(:, f) = sum(model%coordinates(:, faces(:4, list(f))), 2)/4.0_wp
         end do
      end function centres

   end subroutine look_beside

end module microslip_fe_left_out_faces
