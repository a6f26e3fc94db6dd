!> Load patterns and sensors on the rows of the FE matrices.
!>
!> A load of a total size along a direction is shared among the nodes of a set equally, or by area: a
!> uniform traction on the element faces that lie entirely in the set, by consistent nodal forces
!> (int N_k dA; for 8-node faces the corners carry -1/12 and the mid-side nodes 1/3 of a face). Faces
!> inside the body count too, each geometric face once.
!>
!> Base excitation: with displacements relative to a base that moves by r u_g (r: rigid translation),
!>     M u'' + ... = -M r u_g''
!> is a load like any other, and its reduction is exact for the static part as theirs is. Supported degrees of freedom have
!> no rows; where M couples them to the others that part of M r is not known, and the load is refused.
module microslip_fe_load_pattern
   use microslip_core_error, only: error_t, bad_input
   use microslip_core_kinds, only: wp
   use microslip_core_text, only: to_text
   use microslip_fe_element, only: faces_within, twin_faces, face_size, cross_product
   use microslip_fe_foreign_faces, only: foreign_faces
   use microslip_fe_model, only: fe_model_t, row_supported
   use microslip_fe_selection, only: absence_text, nodes_of_set
   use microslip_fe_shape_functions, only: shape_values, shape_gradients
   use microslip_linalg_sparse, only: symmetric_sparse_t
   implicit none(type, external)
   private

   public :: load_vector, base_load, sensor_row

contains

   !> The force vector of a load on a node set.
   !>
   !> A node that carries load in a supported direction is an error: that part would go into the support.
   subroutine load_vector(model, set, direction, force, distribution, load, error)
      type(fe_model_t), intent(in) :: model
      !> Name of the node set
      character(len=*), intent(in) :: set
      !> Direction, any length
      real(wp), intent(in) :: direction(3)
      !> Total force along the direction, N
      real(wp), intent(in) :: force
      !> 'uniform': the same for every node, or 'area': a uniform traction
      character(len=*), intent(in) :: distribution
      !> (rows) N
      real(wp), allocatable, intent(out) :: load(:)
      type(error_t), allocatable, intent(out) :: error
      integer, allocatable :: nodes(:), rows(:, :)
      real(wp), allocatable :: share(:)
      real(wp) :: unit_direction(3)
      integer :: k, c

      call select_nodes(model, 'load', set, direction, nodes, unit_direction, error)
      if (allocated(error)) return
      select case (distribution)
      case ('uniform')
         allocate (share(size(nodes)), source=1.0_wp/size(nodes))
      case ('area')
         call area_shares(model, set, nodes, share, error)
         if (allocated(error)) return
      case default
         call bad_input(error, "load on node set '"//set//"': unknown distribution '"//distribution// &
            "'; known are 'uniform' and 'area'")
         return
      end select

      rows = model%rows_of_nodes()
      allocate (load(model%row_count()), source=0.0_wp)
      do c = 1, 3
         if (abs(unit_direction(c)) <= epsilon(1.0_wp)) cycle
         do k = 1, size(nodes)
            if (share(k) == 0.0_wp) cycle
            if (rows(c, nodes(k)) == 0) then
               call bad_input(error, "load on node set '"//set//"': "//absence_text(model, nodes(k), c)// &
                  '; it cannot carry load there'//advice(model, nodes(k), c))
               return
            end if
            load(rows(c, nodes(k))) = force*unit_direction(c)*share(k)
         end do
      end do
   end subroutine load_vector

   !> The force vector -M r of a unit acceleration of the base along a direction.
   subroutine base_load(model, direction, load, error)
      type(fe_model_t), intent(in) :: model
      !> Direction, any length
      real(wp), intent(in) :: direction(3)
      !> (rows) N per m/s^2
      real(wp), allocatable, intent(out) :: load(:)
      type(error_t), allocatable, intent(out) :: error
      integer, allocatable :: rows(:, :)
      logical, allocatable :: in_mesh(:)
      real(wp), allocatable :: translation(:)
      real(wp) :: unit_direction(3)
      integer :: c, k

      unit_direction = direction/norm2(direction)
      rows = model%rows_of_nodes()
      in_mesh = any(rows > 0, dim=1)
      if (allocated(model%elements)) then
         do k = 1, size(model%elements)
            in_mesh(pack(model%elements(k)%connectivity, .true.)) = .true.
         end do
      end if
      if (allocated(model%other_elements)) then
         do k = 1, size(model%other_elements)
            if (couples_mass(model%other_elements(k)%type)) &
               in_mesh(pack(model%other_elements(k)%connectivity, .true.)) = .true.
         end do
      end if
      allocate (translation(model%row_count()), source=0.0_wp)
      do c = 1, 3
         if (abs(unit_direction(c)) <= epsilon(1.0_wp)) cycle
         translation(pack(rows(c, :), rows(c, :) > 0)) = unit_direction(c)
         if (any(rows(c, :) == 0 .and. in_mesh) .and. couples(model%mass)) then
            k = findloc(rows(c, :) == 0 .and. in_mesh, .true., 1)
            call bad_input(error, 'base excitation: '//absence_text(model, k, c)//'; what the mass matrix couples to it is '// &
               'not in the model; springs to the base in place of the support, or a lumped mass matrix, make the load known')
            return
         end if
      end do
      allocate (load(model%row_count()))
      call model%mass%multiply(translation, load)
      load = -load
   end subroutine base_load

   !> Whether elements of a type that is no brick can couple the mass of their nodes: springs and the like do not.
   pure logical function couples_mass(type)
      character(len=*), intent(in) :: type
      character(len=*), parameter :: without(9) = [character(len=7) :: 'MASS', 'ROTARYI', 'SPRING', 'DASHPOT', 'GAP', 'DCOUP', &
         'CONN', 'JOINTC', 'R3D']
      integer :: k

      couples_mass = .not. any([(index(type, trim(without(k))) == 1, k=1, size(without))])
   end function couples_mass

   !> Whether a matrix has entries beside the diagonal.
   pure logical function couples(matrix)
      type(symmetric_sparse_t), intent(in) :: matrix
      integer :: row

      couples = .true.
      do row = 1, matrix%n
         if (any(matrix%value(matrix%row_start(row) + 1:matrix%row_start(row + 1) - 1) /= 0.0_wp)) return
      end do
      couples = .false.
   end function couples

   !> The row that gives the mean displacement of a node set along a direction (supported: zero; dependent: refused).
   subroutine sensor_row(model, set, direction, row, error)
      type(fe_model_t), intent(in) :: model
      !> Name of the node set
      character(len=*), intent(in) :: set
      !> Direction, any length
      real(wp), intent(in) :: direction(3)
      !> (rows)
      real(wp), allocatable, intent(out) :: row(:)
      type(error_t), allocatable, intent(out) :: error
      integer, allocatable :: nodes(:), rows(:, :)
      real(wp) :: unit_direction(3)
      integer :: k, c

      call select_nodes(model, 'sensor', set, direction, nodes, unit_direction, error)
      if (allocated(error)) return
      rows = model%rows_of_nodes()
      allocate (row(model%row_count()), source=0.0_wp)
      do k = 1, size(nodes)
         do c = 1, 3
            if (rows(c, nodes(k)) > 0) then
               row(rows(c, nodes(k))) = unit_direction(c)/size(nodes)
            else if (abs(unit_direction(c)) > epsilon(1.0_wp) .and. model%absence_of(nodes(k), c) /= row_supported) then
               call bad_input(error, "sensor on node set '"//set//"': "//absence_text(model, nodes(k), c)// &
                  '; its displacement is not known'//advice(model, nodes(k), c))
               return
            end if
         end do
      end do
      if (maxval(abs(row)) <= epsilon(1.0_wp)/size(nodes)) call bad_input(error, "sensor on node set '"//set// &
         "': all its nodes are supported in the given direction")
   end subroutine sensor_row

   !> The nodes of the set and the direction at length 1.
   subroutine select_nodes(model, purpose, set, direction, nodes, unit_direction, error)
      type(fe_model_t), intent(in) :: model
      !> 'load' or 'sensor', for messages
      character(len=*), intent(in) :: purpose
      character(len=*), intent(in) :: set
      real(wp), intent(in) :: direction(3)
      integer, allocatable, intent(out) :: nodes(:)
      real(wp), intent(out) :: unit_direction(3)
      type(error_t), allocatable, intent(out) :: error

      call nodes_of_set(model, set, nodes, error)
      if (allocated(error)) then
         error%message = purpose//': '//error%message
         return
      end if
      if (.not. norm2(direction) > 0.0_wp) then
         call bad_input(error, purpose//" on node set '"//set//"': the direction has no length")
         return
      end if
      unit_direction = direction/norm2(direction)
   end subroutine select_nodes

   !> The part of a uniform traction that each node carries; the shares sum to 1.
   subroutine area_shares(model, set, nodes, share, error)
      type(fe_model_t), intent(in) :: model
      character(len=*), intent(in) :: set
      integer, intent(in) :: nodes(:)
      !> (nodes of the set)
      real(wp), allocatable, intent(out) :: share(:)
      type(error_t), allocatable, intent(out) :: error
      integer, allocatable :: faces(:, :), twin(:)
      logical, allocatable :: selected(:)
      real(wp), allocatable :: area(:)
      character(len=:), allocatable :: foreign
      integer :: f, n

      allocate (faces(8, 0))
      allocate (selected(model%node_count()), source=.false.)
      selected(nodes) = .true.
      if (allocated(model%elements)) faces = faces_within(model%elements, selected)
      foreign = foreign_faces(model, nodes, faces)
      if (foreign /= '') then
         call bad_input(error, "load on node set '"//set//"': its faces of elements other than bricks ("//foreign// &
            ") are not supported yet: a load by area needs faces of bricks; distribution = 'uniform' does not")
         return
      end if
      if (size(faces, 2) == 0) then
         call bad_input(error, "load on node set '"//set//"': no element face has all its nodes in the set; "// &
            "a load by area needs faces (distribution = 'uniform' does not)")
         return
      end if
      twin = twin_faces(faces)
      allocate (area(model%node_count()), source=0.0_wp)
      do f = 1, size(faces, 2)
         if (twin(f) > f) cycle
         n = face_size(faces(:, f))
         area(faces(:n, f)) = area(faces(:n, f)) + nodal_areas(model%coordinates(:, faces(:n, f)))
      end do
      share = area(nodes)/sum(area(nodes))
   end subroutine area_shares

   !> int N_k dA over a face of 4 or 8 nodes, by 3 x 3 Gauss points.
   pure function nodal_areas(corners) result(area)
      !> (3, 4 or 8) m
      real(wp), intent(in) :: corners(:, :)
      real(wp) :: area(size(corners, 2))
      real(wp), parameter :: gauss = sqrt(0.6_wp)
      real(wp), parameter :: abscissa(3) = [-gauss, 0.0_wp, gauss], &
         weight(3) = [5.0_wp, 8.0_wp, 5.0_wp]/9.0_wp
      real(wp) :: tangents(3, 2), local(2)
      integer :: i, j

      area = 0.0_wp
      do j = 1, 3
         do i = 1, 3
            local = [abscissa(i), abscissa(j)]
            tangents = matmul(corners, transpose(shape_gradients(size(area), local)))
            area = area + weight(i)*weight(j)*norm2(cross_product(tangents(:, 1), tangents(:, 2))) &
               *shape_values(size(area), local)
         end do
      end do
   end function nodal_areas

   !> What to do about a component that is not known to be supported.
   pure function advice(model, node, component) result(text)
      type(fe_model_t), intent(in) :: model
      integer, intent(in) :: node, component
      character(len=:), allocatable :: text
      text = ''
      if (model%absence_of(node, component) /= row_supported) text = ' (use the node or nodes that it follows)'
   end function advice

end module microslip_fe_load_pattern
