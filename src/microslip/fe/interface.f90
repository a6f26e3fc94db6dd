!> A contact interface of the FE model: matching node pairs, local frame, faces (METHOD section 1).
!>
!> Built from two node sets (side B may be rigid ground) or from a plane that cuts the mesh along
!> coincident nodes. Both ways end in the same steps: pairs by position, frame, faces by pair index.
module microslip_fe_interface
   use microslip_core_error, only: error_t, bad_input
   use microslip_core_kinds, only: wp
   use microslip_core_text, only: to_text, lower_case
   use microslip_fe_element, only: faces_within, surface_faces, nodes_of_faces, face_size, area_vector, &
      shortest_edge, cross_product
   use microslip_fe_foreign_faces, only: foreign_faces
   use microslip_fe_model, only: fe_model_t
   use microslip_fe_pairing, only: find_partners
   use microslip_fe_selection, only: nodes_of_set, node_text, coordinates_text
   implicit none(type, external)
   private

   public :: contact_interface_t, interface_from_sets, interface_from_plane, rigid_ground

   !> Name that stands for rigid ground as side B.
   character(len=*), parameter :: rigid_ground = 'ground'

   !> Two nodes form a pair when they are closer than this part of the shortest edge.
   real(wp), parameter :: pair_tolerance = 1.0e-3_wp
   !> Largest deviation from the plane as a part of the diagonal of the interface.
   real(wp), parameter :: planarity = 1.0e-3_wp
   !> Nodes this close to a cutting plane lie on it, as a part of the diagonal of the mesh.
   real(wp), parameter :: plane_thickness = 1.0e-6_wp

   !> Matching nodes of the two sides and the faces they span.
   !>
   !> Sign convention: n is the outward normal of body B, from B towards A; the relative displacement
   !> of pair j is d_b,j = R^T (u_a,j - u_b,j), so a positive normal part opens the contact.
   type :: contact_interface_t
      character(len=:), allocatable :: name
      !> Point of the plane that has the local in-plane coordinates (0, 0), m
      real(wp) :: origin(3) = 0.0_wp
      !> R = [n t1 t2], columns; right-handed
      real(wp) :: frame(3, 3) = 0.0_wp
      !> (pairs) node indices of side A and of side B; node_b = 0: rigid ground
      integer, allocatable :: node_a(:), node_b(:)
      !> (2, pairs) coordinates along t1, t2 from the origin, m
      real(wp), allocatable :: position(:, :)
      !> (8, faces) pair indices, corners first, then mid-side nodes; zeros for 4-node faces.
      !> Counter-clockwise in the (t1, t2) plane
      integer, allocatable :: faces(:, :)
   contains
      procedure :: pair_count
   end type contact_interface_t

contains

   !> Number of node pairs.
   pure integer function pair_count(self)
      class(contact_interface_t), intent(in) :: self
      pair_count = size(self%node_a)
   end function pair_count

   !> Build an interface from a node set on each body.
   subroutine interface_from_sets(model, name, set_a, set_b, contact, normal, tangent, origin, error)
      type(fe_model_t), intent(in) :: model
      !> Name of the interface, for messages and results
      character(len=*), intent(in) :: name
      !> Node set of side A; node set of side B or 'ground'
      character(len=*), intent(in) :: set_a, set_b
      type(contact_interface_t), intent(out) :: contact
      !> Direction from B towards A; default: from the faces
      real(wp), intent(in), optional :: normal(3)
      !> Direction of t1, projected into the plane; default: x, or y where n is along x
      real(wp), intent(in), optional :: tangent(3)
      !> Point with the in-plane coordinates (0, 0), m; default: centre of the bounding rectangle
      real(wp), intent(in), optional :: origin(3)
      type(error_t), allocatable, intent(out) :: error
      integer, allocatable :: nodes_a(:), nodes_b(:), faces(:, :), faces_b(:, :)
      real(wp) :: n(3), outward

      call nodes_of_set(model, set_a, nodes_a, error)
      if (.not. allocated(error)) then
         if (lower_case(set_b) == rigid_ground) then
            allocate (nodes_b(0))
         else
            call nodes_of_set(model, set_b, nodes_b, error)
         end if
      end if
      if (allocated(error)) then
         error%message = place(name)//error%message
         return
      end if

      faces = faces_among(model, nodes_a)
      faces_b = faces_among(model, nodes_b)
      call refuse_foreign(set_a, nodes_a, faces)
      if (.not. allocated(error)) call refuse_foreign(set_b, nodes_b, faces_b)
      if (.not. allocated(error)) call check_shared(model, nodes_a, nodes_b, error)
      if (allocated(error)) then
         error%message = place(name)//error%message
         return
      end if
      outward = -1.0_wp
      if (size(faces, 2) == 0) then
         faces = faces_b
         outward = 1.0_wp
      else if (size(faces_b, 2) > 0) then
         if (dot_product(total_area(model, faces), total_area(model, faces_b)) > 0.0_wp) then
            call bad_input(error, place(name)//"the faces of '"//set_a//"' and of '"//set_b//"' point the same way: the two "// &
               'bodies are on the same side of the interface, one within the other')
            return
         end if
      end if
      if (size(faces, 2) == 0) then
         call bad_input(error, place(name)//"no face of the surface of the mesh has all its nodes in the set '"// &
            set_a//"' or in '"//set_b//"' (of 20-node bricks the mid-side nodes too)"//inner_text(model, [nodes_a, nodes_b]))
         return
      end if
      call common_normal(model, name, faces, outward, normal, n, error)
      if (allocated(error)) return
      call complete(model, name, nodes_a, nodes_b, faces, n, tangent, origin, contact, error)

   contains

      !> Faces that the program has no shape functions for.
      subroutine refuse_foreign(set, nodes, known)
         character(len=*), intent(in) :: set
         integer, intent(in) :: nodes(:), known(:, :)
         character(len=:), allocatable :: foreign

         foreign = foreign_faces(model, nodes, known)
         if (foreign /= '') call bad_input(error, foreign_text(foreign)//" in the node set '"//set//"'")
      end subroutine refuse_foreign

   end subroutine interface_from_sets

   !> '12 of C3D10' in a message.
   pure function foreign_text(foreign) result(text)
      character(len=*), intent(in) :: foreign
      character(len=:), allocatable :: text
      text = foreign(index(foreign, ' of ') + 4:)
      if (index(text, ',') > 0) text = 'tetrahedron, wedge or shell'
      text = text//' faces at joints are not supported yet: mesh the bodies with bricks (C3D8, C3D8I, C3D20, C3D20R) at the '// &
         'joint; there are '//foreign
   end function foreign_text

   !> Inner faces among nodes, in words: two bodies that share their nodes have no surface between them.
   function inner_text(model, nodes) result(text)
      type(fe_model_t), intent(in) :: model
      integer, intent(in) :: nodes(:)
      character(len=:), allocatable :: text
      logical, allocatable :: selected(:)
      integer :: inner

      text = ''
      if (.not. allocated(model%elements)) return
      allocate (selected(model%node_count()), source=.false.)
      selected(nodes) = .true.
      inner = size(faces_within(model%elements, selected), 2)/2
      if (inner > 0) text = ': '//to_text(inner)//' faces there lie between two elements, the joint is merged in the mesh (its '// &
         'two sides share their nodes); every side needs nodes of its own'
   end function inner_text

   !> No node belongs to both sides.
   subroutine check_shared(model, nodes_a, nodes_b, error)
      type(fe_model_t), intent(in) :: model
      integer, intent(in) :: nodes_a(:), nodes_b(:)
      type(error_t), allocatable, intent(out) :: error
      logical, allocatable :: of_a(:)
      integer :: shared

      allocate (of_a(model%node_count()), source=.false.)
      of_a(nodes_a) = .true.
      shared = count(of_a(nodes_b))
      if (shared == 0) return
      call bad_input(error, 'both sides share '//to_text(shared)//' of the '//to_text(size(nodes_b))//' nodes of side B, the '// &
         'first is '//node_text(model, nodes_b(findloc(of_a(nodes_b), .true., dim=1)))//': the joint is merged in the mesh, or '// &
         'the sets are not those of two bodies; every side needs nodes of its own, two at every place')
   end subroutine check_shared

   !> Sum of the outward area vectors of faces, m^2.
   pure function total_area(model, faces) result(total)
      type(fe_model_t), intent(in) :: model
      integer, intent(in) :: faces(:, :)
      real(wp) :: total(3)
      integer :: k

      total = 0.0_wp
      do k = 1, size(faces, 2)
         total = total + area_vector(model%coordinates(:, faces(:4, k)))
      end do
   end function total_area

   !> Build an interface from a plane on which the nodes of two bodies coincide.
   !>
   !> Side A are the nodes of the faces of elements on the positive side, side B those of the negative
   !> side. Faces that elements of both sides share (solid material) are no part of the interface.
   subroutine interface_from_plane(model, name, point, normal, contact, region, tangent, origin, error)
      type(fe_model_t), intent(in) :: model
      !> Name of the interface, for messages and results
      character(len=*), intent(in) :: name
      !> A point of the plane, m
      real(wp), intent(in) :: point(3)
      !> Normal of the plane, from side B towards side A, any length
      real(wp), intent(in) :: normal(3)
      type(contact_interface_t), intent(out) :: contact
      !> (3, low and high) box that bounds the nodes, m; default: no bound
      real(wp), intent(in), optional :: region(3, 2)
      !> Direction of t1, projected into the plane; default: x, or y where n is along x
      real(wp), intent(in), optional :: tangent(3)
      !> Point with the in-plane coordinates (0, 0), m; default: centre of the bounding rectangle
      real(wp), intent(in), optional :: origin(3)
      type(error_t), allocatable, intent(out) :: error
      integer, allocatable :: faces(:, :), nodes_a(:), nodes_b(:)
      logical, allocatable :: on_plane(:), of_a(:)
      character(len=:), allocatable :: foreign
      real(wp) :: n(3), tolerance
      integer :: k

      if (norm2(normal) <= 0.0_wp) then
         call bad_input(error, place(name)//'the normal of the plane has no length')
         return
      end if
      n = normal/norm2(normal)
      tolerance = plane_thickness*norm2(maxval(model%coordinates, dim=2) - minval(model%coordinates, dim=2))
      on_plane = abs(matmul(n, model%coordinates - spread(point, 2, model%node_count()))) <= tolerance
      if (present(region)) then
         do k = 1, 3
            on_plane = on_plane .and. model%coordinates(k, :) >= region(k, 1) - tolerance &
               .and. model%coordinates(k, :) <= region(k, 2) + tolerance
         end do
      end if
      faces = faces_among(model, pack([(k, k=1, size(on_plane))], on_plane))
      foreign = foreign_faces(model, pack([(k, k=1, size(on_plane))], on_plane), faces)
      if (foreign /= '') then
         call bad_input(error, place(name)//foreign_text(foreign)//' on the plane through '//coordinates_text(point)// &
            ' (a region leaves out what is no part of the joint)')
         return
      end if
      of_a = [(dot_product(n, area_vector(model%coordinates(:, faces(:4, k)))) < 0.0_wp, k=1, size(faces, 2))]
      nodes_a = nodes_of_faces(faces(:, pack([(k, k=1, size(of_a))], of_a)))
      nodes_b = nodes_of_faces(faces(:, pack([(k, k=1, size(of_a))], .not. of_a)))
      if (size(nodes_a) == 0 .or. size(nodes_b) == 0) then
         call bad_input(error, place(name)//'on the plane through '//coordinates_text(point)//' ('// &
            to_text(count(on_plane))//' nodes) the positive side has '//to_text(count(of_a))// &
            ' free element faces and the negative side '//to_text(count(.not. of_a))//'; both need some'// &
            inner_text(model, pack([(k, k=1, size(on_plane))], on_plane)))
         return
      end if
      faces = faces(:, pack([(k, k=1, size(of_a))], of_a))
      call complete(model, name, nodes_a, nodes_b, faces, n, tangent, origin, contact, error)
   end subroutine interface_from_plane

   !> The element faces on the surface of the mesh whose nodes are all in a list.
   pure function faces_among(model, nodes) result(faces)
      type(fe_model_t), intent(in) :: model
      integer, intent(in) :: nodes(:)
      !> (8, faces) node indices, outward
      integer, allocatable :: faces(:, :)
      logical, allocatable :: selected(:)

      allocate (faces(8, 0))
      if (.not. allocated(model%elements)) return
      allocate (selected(model%node_count()), source=.false.)
      selected(nodes) = .true.
      faces = surface_faces(model%elements, selected)
   end function faces_among

   !> The normal from B towards A: the given one, or the mean normal of the faces.
   subroutine common_normal(model, name, faces, outward, given, normal, error)
      type(fe_model_t), intent(in) :: model
      character(len=*), intent(in) :: name
      integer, intent(in) :: faces(:, :)
      !> 1 for faces of side B, -1 for faces of side A
      real(wp), intent(in) :: outward
      real(wp), intent(in), optional :: given(3)
      real(wp), intent(out) :: normal(3)
      type(error_t), allocatable, intent(out) :: error
      real(wp) :: total(3), area(3), size_sum
      integer :: k

      total = 0.0_wp
      size_sum = 0.0_wp
      do k = 1, size(faces, 2)
         area = outward*area_vector(model%coordinates(:, faces(:4, k)))
         total = total + area
         size_sum = size_sum + norm2(area)
      end do
      if (norm2(total) < 0.5_wp*size_sum .or. .not. size_sum > 0.0_wp) then
         call bad_input(error, place(name)//'the '//to_text(size(faces, 2))// &
            ' element faces in the node sets do not point one way; an interface must be plane')
         return
      end if
      normal = total/norm2(total)
      if (.not. present(given)) return
      if (.not. dot_product(given, normal) > 0.0_wp) then
         call bad_input(error, place(name)//'the normal '//coordinates_text(given)// &
            ' does not point from side B to side A; the element faces give '//coordinates_text(normal))
         return
      end if
      normal = given/norm2(given)
   end subroutine common_normal

   !> From the nodes of both sides, faces of one side and the normal to the finished interface.
   subroutine complete(model, name, nodes_a, nodes_b, faces, normal, tangent, origin, contact, error)
      type(fe_model_t), intent(in) :: model
      character(len=*), intent(in) :: name
      !> Nodes of both sides; no nodes B: rigid ground
      integer, intent(in) :: nodes_a(:), nodes_b(:)
      !> (8, faces) node indices, of one side
      integer, intent(in) :: faces(:, :)
      !> From B towards A, unit length
      real(wp), intent(in) :: normal(3)
      real(wp), intent(in), optional :: tangent(3), origin(3)
      type(contact_interface_t), intent(out) :: contact
      type(error_t), allocatable, intent(out) :: error

      contact%name = name
      contact%node_a = nodes_a
      call check_plane(model, name, nodes_a, normal, error)
      if (allocated(error)) return
      if (size(nodes_b) == 0) then
         allocate (contact%node_b(size(nodes_a)), source=0)
      else
         call find_partners(model, nodes_a, nodes_b, pair_tolerance*shortest_edge(model%coordinates, faces), &
            contact%node_b, error)
         if (allocated(error)) then
            error%message = place(name)//error%message
            return
         end if
      end if
      call set_frame(model, normal, tangent, origin, contact, error)
      if (allocated(error)) return
      call set_faces(model, faces, contact, error)
   end subroutine complete

   !> Error where a node lies too far from the plane through the middle of the nodes.
   subroutine check_plane(model, name, nodes, normal, error)
      type(fe_model_t), intent(in) :: model
      character(len=*), intent(in) :: name
      integer, intent(in) :: nodes(:)
      real(wp), intent(in) :: normal(3)
      type(error_t), allocatable, intent(out) :: error
      real(wp), allocatable :: points(:, :), height(:)
      real(wp) :: limit
      integer :: worst

      points = model%coordinates(:, nodes)
      height = matmul(normal, points)
      height = abs(height - sum(height)/size(height))
      limit = planarity*norm2(maxval(points, dim=2) - minval(points, dim=2))
      worst = maxloc(height, dim=1)
      if (height(worst) <= limit) return
      call bad_input(error, place(name)//'not plane: '//node_text(model, nodes(worst))//' lies '// &
         to_text(height(worst), 3)//' m off the mean plane (allowed '//to_text(limit, 3)//' m)')
   end subroutine check_plane

   !> Frame, origin and in-plane coordinates of the pairs.
   subroutine set_frame(model, normal, tangent, origin, contact, error)
      type(fe_model_t), intent(in) :: model
      real(wp), intent(in) :: normal(3)
      real(wp), intent(in), optional :: tangent(3), origin(3)
      type(contact_interface_t), intent(inout) :: contact
      type(error_t), allocatable, intent(out) :: error
      real(wp), parameter :: nearly_along = 0.9_wp, parallel = 1.0e-3_wp
      real(wp) :: along(3), height
      real(wp), allocatable :: points(:, :)

      along = [1.0_wp, 0.0_wp, 0.0_wp]
      if (abs(normal(1)) > nearly_along) along = [0.0_wp, 1.0_wp, 0.0_wp]
      if (present(tangent)) then
         along = tangent
         if (.not. norm2(cross_product(normal, tangent)) > parallel*norm2(tangent)) then
            call bad_input(error, place(contact%name)//'the tangent '//coordinates_text(tangent)// &
               ' has no part in the plane with the normal '//coordinates_text(normal))
            return
         end if
      end if
      along = along - dot_product(along, normal)*normal
      contact%frame(:, 1) = normal
      contact%frame(:, 2) = along/norm2(along)
      contact%frame(:, 3) = cross_product(normal, contact%frame(:, 2))

      points = matmul(transpose(contact%frame), model%coordinates(:, contact%node_a))
      height = sum(points(1, :))/size(points, 2)
      if (present(origin)) then
         contact%origin = origin + (height - dot_product(normal, origin))*normal
      else
         contact%origin = matmul(contact%frame, [height, &
            0.5_wp*(maxval(points(2:, :), dim=2) + minval(points(2:, :), dim=2))])
      end if
      contact%position = points(2:, :) &
         - spread(matmul(contact%origin, contact%frame(:, 2:)), 2, size(points, 2))
   end subroutine set_frame

   !> Faces by pair index, counter-clockwise in the (t1, t2) plane.
   subroutine set_faces(model, faces, contact, error)
      type(fe_model_t), intent(in) :: model
      !> (8, faces) node indices
      integer, intent(in) :: faces(:, :)
      type(contact_interface_t), intent(inout) :: contact
      type(error_t), allocatable, intent(out) :: error
      integer, parameter :: reversed(8) = [1, 4, 3, 2, 8, 7, 6, 5]
      integer, allocatable :: pair_of(:)
      logical :: on_face(contact%pair_count())
      integer :: k, lonely
      real(wp) :: area(3)

      allocate (pair_of(0:model%node_count()), source=0)
      do k = 1, contact%pair_count()
         pair_of([contact%node_a(k), contact%node_b(k)]) = k
      end do
      pair_of(0) = 0
      on_face = .false.
      allocate (contact%faces(8, size(faces, 2)))
      do k = 1, size(faces, 2)
         contact%faces(:, k) = pair_of(faces(:, k))
         on_face(contact%faces(:face_size(faces(:, k)), k)) = .true.
         area = area_vector(model%coordinates(:, faces(:4, k)))
         if (dot_product(area, contact%frame(:, 1)) < 0.0_wp) contact%faces(:, k) = contact%faces(reversed, k)
      end do
      lonely = findloc(on_face, .false., dim=1)
      if (lonely > 0) call bad_input(error, place(contact%name)//to_text(count(.not. on_face))// &
         ' nodes lie on no element face of the interface, first '//node_text(model, contact%node_a(lonely)))
   end subroutine set_faces

   !> Start of every message.
   pure function place(name) result(text)
      character(len=*), intent(in) :: name
      character(len=:), allocatable :: text
      text = "interface '"//name//"': "
   end function place

end module microslip_fe_interface
