!> Node sets of a model from the node sets, element sets and surfaces of a mesh file.
module microslip_io_mesh_node_sets
   use microslip_core_kinds, only: i8
   use microslip_core_text, only: to_text
   use microslip_core_warning_list, only: severity_doubtful, severity_note, warning_list_t
   use microslip_fe_element, only: element_faces, face_size
   use microslip_fe_model, only: element_block_t, node_set_t
   use microslip_io_label_list, only: find_label
   use microslip_io_mesh_elements, only: element_table_t
   use microslip_io_mesh_sets, only: set_list_t
   implicit none(type, external)
   private

   public :: make_node_sets

   !> What all sets refer to.
   type :: mesh_t
      !> Ascending
      integer, allocatable :: node_label(:)
      type(element_table_t) :: table
      type(element_block_t), allocatable :: blocks(:)
   end type mesh_t

contains

   !> All node sets; where names are the same, a node set comes before a surface, and a surface before an element set.
   subroutine make_node_sets(node_sets, element_sets, surfaces, path, node_label, table, blocks, warnings, sets)
      type(set_list_t), intent(inout) :: node_sets, element_sets, surfaces
      !> Name of the file, for messages
      character(len=*), intent(in) :: path
      !> Ascending
      integer, intent(in) :: node_label(:)
      type(element_table_t), intent(in) :: table
      !> With node indices
      type(element_block_t), intent(in) :: blocks(:)
      type(warning_list_t), intent(inout) :: warnings
      type(node_set_t), allocatable, intent(out) :: sets(:)
      type(mesh_t) :: mesh
      integer :: k, made

      mesh%node_label = node_label
      mesh%table = table
      mesh%blocks = blocks
      allocate (sets(count([(is_made(node_sets, k), k=1, node_sets%count)]) &
         + count([(is_made(surfaces, k) .and. node_sets%find(surfaces%items(k)%name) == 0, k=1, surfaces%count)]) &
         + count([(is_made(element_sets, k) .and. max(node_sets%find(element_sets%items(k)%name), &
         surfaces%find(element_sets%items(k)%name)) == 0, k=1, element_sets%count)])))
      made = 0
      do k = 1, node_sets%count
         if (is_made(node_sets, k)) call keep(node_sets, k, nodes_in_set(node_sets, k, element_sets, mesh, path, warnings))
      end do
      do k = 1, surfaces%count
         if (.not. is_made(surfaces, k) .or. node_sets%find(surfaces%items(k)%name) > 0) cycle
         call keep(surfaces, k, nodes_on_surface(surfaces, k, node_sets, element_sets, mesh, path, warnings))
      end do
      do k = 1, element_sets%count
         if (.not. is_made(element_sets, k) .or. max(node_sets%find(element_sets%items(k)%name), &
            surfaces%find(element_sets%items(k)%name)) > 0) cycle
         call keep(element_sets, k, nodes_of_elements(element_sets, k, mesh))
      end do

   contains

      pure logical function is_made(list, k)
         type(set_list_t), intent(in) :: list
         integer, intent(in) :: k
         is_made = list%items(k)%defined
      end function is_made

      subroutine keep(list, k, inside)
         type(set_list_t), intent(in) :: list
         integer, intent(in) :: k
         logical, intent(in) :: inside(:)
         integer :: node

         made = made + 1
         sets(made)%name = list%items(k)%name
         sets(made)%nodes = pack([(node, node=1, size(inside))], inside)
         if (.not. allocated(list%items(k)%fault)) return
         sets(made)%fault = path//': '//list%items(k)%fault
         call warnings%add(severity_note, path//': the '//list%kind//" '"//list%items(k)%name//"' cannot be used: "// &
            list%items(k)%fault)
      end subroutine keep

   end subroutine make_node_sets

   !> (nodes) those of a node set.
   function nodes_in_set(node_sets, index, element_sets, mesh, path, warnings) result(inside)
      type(set_list_t), intent(inout) :: node_sets, element_sets
      integer, intent(in) :: index
      type(mesh_t), intent(in) :: mesh
      character(len=*), intent(in) :: path
      type(warning_list_t), intent(inout) :: warnings
      logical, allocatable :: inside(:), visited(:)
      integer(i8) :: absent
      integer :: k, j

      call node_sets%collect(index, mesh%node_label, inside, visited, absent)
      associate (name => node_sets%items(index)%name)
         if (absent > 0 .and. .not. any(inside)) then
            call node_sets%blame(index, 'none of the nodes it lists is defined')
         else if (absent > 0) then
            call warnings%add(severity_doubtful, path//": node set '"//name//"': "//to_text(absent)// &
               ' of the nodes it lists by GENERATE are not defined and left out, '//to_text(count(inside))//' are')
         end if
      end associate
      do k = 1, size(visited)
         if (.not. visited(k)) cycle
         do j = 1, size(node_sets%items(k)%of_elements)
            associate (set => element_sets%items(node_sets%items(k)%of_elements(j)))
               inside = inside .or. nodes_of_elements(element_sets, node_sets%items(k)%of_elements(j), mesh)
               if (allocated(set%fault)) call node_sets%blame(index, "element set '"//set%name//"': "//set%fault)
            end associate
         end do
      end do
   end function nodes_in_set

   !> (nodes) those of the elements of an element set.
   function nodes_of_elements(element_sets, index, mesh) result(inside)
      type(set_list_t), intent(inout) :: element_sets
      integer, intent(in) :: index
      type(mesh_t), intent(in) :: mesh
      logical, allocatable :: inside(:), elements(:), visited(:)
      integer(i8) :: absent
      integer :: k

      allocate (inside(size(mesh%node_label)), source=.false.)
      call element_sets%collect(index, mesh%table%label, elements, visited, absent)
      if (absent > 0 .and. .not. any(elements)) call element_sets%blame(index, 'none of the elements it lists is defined')
      do k = 1, size(elements)
         if (.not. elements(k)) cycle
         associate (connectivity => mesh%blocks(mesh%table%block(k))%connectivity)
            if (mesh%table%place(k) <= size(connectivity, 2)) inside(connectivity(:, mesh%table%place(k))) = .true.
         end associate
      end do
   end function nodes_of_elements

   !> (nodes) those of a surface.
   function nodes_on_surface(surfaces, index, node_sets, element_sets, mesh, path, warnings) result(inside)
      type(set_list_t), intent(inout) :: surfaces, node_sets, element_sets
      integer, intent(in) :: index
      type(mesh_t), intent(in) :: mesh
      character(len=*), intent(in) :: path
      type(warning_list_t), intent(inout) :: warnings
      logical, allocatable :: inside(:), visited(:), elements(:)
      integer(i8) :: absent
      integer :: k, other, place

      call surfaces%collect(index, mesh%node_label, inside, visited, absent)
      ! A surface of nodes names node sets, which are kept as element sets are for node sets.
      do k = 1, size(surfaces%items(index)%of_elements)
         other = surfaces%items(index)%of_elements(k)
         inside = inside .or. nodes_in_set(node_sets, other, element_sets, mesh, path, warnings)
         if (.not. node_sets%items(other)%defined) call node_sets%blame(other, 'it is not defined')
         if (allocated(node_sets%items(other)%fault)) call surfaces%blame(index, "node set '"//node_sets%items(other)%name// &
            "': "//node_sets%items(other)%fault)
      end do
      do k = 1, size(surfaces%items(index)%faces, 2)
         associate (face => surfaces%items(index)%faces(:, k))
            if (face(1) > 0) then
               call element_sets%collect(face(1), mesh%table%label, elements, visited, absent)
               if (allocated(element_sets%items(face(1))%fault)) call surfaces%blame(index, "element set '"// &
                  element_sets%items(face(1))%name//"': "//element_sets%items(face(1))%fault)
               do place = 1, size(elements)
                  if (elements(place)) call add_face(place, face(3))
               end do
            else
               place = find_label(mesh%table%label, face(2))
               if (place == 0) then
                  call surfaces%blame(index, 'it names element '//to_text(face(2))//', which is not defined')
               else
                  call add_face(place, face(3))
               end if
            end if
         end associate
      end do

   contains

      subroutine add_face(place, face)
         integer, intent(in) :: place, face
         integer, allocatable :: table(:, :)
         integer :: n

         associate (block => mesh%blocks(mesh%table%block(place)))
            table = element_faces(block%type)
            if (size(table, 2) == 0) then
               call surfaces%blame(index, 'it has faces of '//block%type//' elements, which are not supported yet: bricks '// &
                  '(C3D8, C3D8I, C3D20, C3D20R) are')
            else if (face < 1 .or. face > size(table, 2)) then
               call surfaces%blame(index, 'it names face S'//to_text(face)//' of element '// &
                  to_text(mesh%table%label(place))//', bricks have S1 to S6')
            else
               n = face_size(table(:, face))
               inside(block%connectivity(table(:n, face), mesh%table%place(place))) = .true.
            end if
         end associate
      end subroutine add_face

   end function nodes_on_surface

end module microslip_io_mesh_node_sets
