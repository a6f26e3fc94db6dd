!> Collects the nodes, elements and sets of a mesh file in any order and makes a model of them.
!>
!> Bricks become `elements`, all others `other_elements`. Element sets and surfaces become node sets too, unless a node set of
!> the same name is there. Labels may be as large as an integer: they are sorted, no memory grows with them.
module microslip_io_mesh_builder
   use microslip_core_error, only: bad_input, error_t
   use microslip_core_kinds, only: wp
   use microslip_core_text, only: to_text
   use microslip_core_warning_list, only: severity_doubtful, warning_list_t
   use microslip_fe_model, only: element_block_t, element_counts, fe_model_t
   use microslip_io_element_types, only: is_brick
   use microslip_io_label_list, only: ascending_order
   use microslip_io_mesh_node_sets, only: make_node_sets
   use microslip_io_mesh_elements, only: element_table_t, element_list_t, index_elements
   use microslip_io_mesh_sets, only: set_list_t
   implicit none(type, external)
   private

   public :: mesh_builder_t

   !> A mesh under construction.
   type :: mesh_builder_t
      !> Node sets, element sets, surfaces
      type(set_list_t) :: node_sets, element_sets, surfaces
      !> What is doubtful about the file
      type(warning_list_t) :: warnings
      !> Whether the file has parts with numbers of their own
      logical :: has_parts = .false.
      !> Number of nodes and of elements so far
      integer :: nodes = 0
      integer, private :: elements = 0
      integer, allocatable, private :: label(:)
      real(wp), allocatable, private :: coordinates(:, :)
      type(element_list_t), allocatable, private :: lists(:)
      !> Nodes with fewer than three coordinates: how many, the first one, most coordinates of any node
      integer, private :: short = 0, first_short = 0, most_coordinates = 0
   contains
      procedure :: start
      procedure :: add_node
      procedure :: move_nodes
      procedure :: add_element
      procedure :: finish
   end type mesh_builder_t

contains

   !> An empty mesh.
   subroutine start(self)
      class(mesh_builder_t), intent(inout) :: self

      self%node_sets%kind = 'node set'
      self%element_sets%kind = 'element set'
      self%surfaces%kind = 'surface'
      allocate (self%label(1000), self%coordinates(3, 1000), self%lists(0))
   end subroutine start

   !> Add a node.
   pure subroutine add_node(self, label, position, given)
      class(mesh_builder_t), intent(inout) :: self
      !> Its number
      integer, intent(in) :: label
      !> (3)
      real(wp), intent(in) :: position(3)
      !> How many coordinates the file gives (3 by default)
      integer, intent(in), optional :: given
      integer, allocatable :: more_labels(:)
      real(wp), allocatable :: more(:, :)

      if (self%nodes == size(self%label)) then
         allocate (more_labels(2*self%nodes), more(3, 2*self%nodes))
         more_labels(:self%nodes) = self%label
         more(:, :self%nodes) = self%coordinates
         call move_alloc(more_labels, self%label)
         call move_alloc(more, self%coordinates)
      end if
      self%nodes = self%nodes + 1
      self%label(self%nodes) = label
      self%coordinates(:, self%nodes) = position
      if (.not. present(given)) return
      self%most_coordinates = max(self%most_coordinates, given)
      if (given >= 3) return
      if (self%short == 0) self%first_short = label
      self%short = self%short + 1
   end subroutine add_node

   !> Move nodes: a translation, then a rotation.
   pure subroutine move_nodes(self, first, last, translation, point, rotation)
      class(mesh_builder_t), intent(inout) :: self
      !> The nodes from the first-th to the last-th that were added
      integer, intent(in) :: first, last
      !> (3)
      real(wp), intent(in) :: translation(3)
      !> A point of the axis, and the matrix of the rotation
      real(wp), intent(in) :: point(3), rotation(3, 3)
      integer :: k

      do k = first, last
         self%coordinates(:, k) = point + matmul(rotation, self%coordinates(:, k) + translation - point)
      end do
   end subroutine move_nodes

   !> Add an element.
   pure subroutine add_element(self, type, label, nodes)
      class(mesh_builder_t), intent(inout) :: self
      !> Element type, in capitals
      character(len=*), intent(in) :: type
      !> Its number
      integer, intent(in) :: label
      !> Labels of its nodes, Abaqus order
      integer, intent(in) :: nodes(:)
      type(element_list_t), allocatable :: longer(:)
      integer :: k, which

      which = 0
      do k = 1, size(self%lists)
         if (self%lists(k)%type == type .and. size(self%lists(k)%label, 1) == size(nodes)) which = k
      end do
      if (which == 0) then
         which = size(self%lists) + 1
         allocate (longer(which))
         longer(:which - 1) = self%lists
         longer(which)%type = type
         allocate (longer(which)%element_label(16), longer(which)%label(size(nodes), 16))
         call move_alloc(longer, self%lists)
      end if
      call self%lists(which)%add(label, nodes)
      self%elements = self%elements + 1
   end subroutine add_element

   !> Sort the nodes, replace labels by indices and hand out mesh and sets.
   subroutine finish(self, path, model, error)
      class(mesh_builder_t), intent(inout) :: self
      !> Name of the file, for messages
      character(len=*), intent(in) :: path
      !> Mesh and node sets; no matrices
      type(fe_model_t), intent(out) :: model
      type(error_t), allocatable, intent(out) :: error
      type(element_block_t), allocatable :: blocks(:)
      type(element_table_t) :: table

      if (self%nodes == 0 .or. self%elements == 0) then
         call bad_input(error, path//': holds '//trim(merge('no nodes   ', 'no elements', self%nodes == 0)))
         return
      end if
      call finish_nodes(self, path, model, error)
      if (allocated(error)) return
      call index_elements(self%lists, model%node_label, path, self%has_parts, self%warnings, table, blocks, error)
      if (allocated(error)) return
      if (self%most_coordinates < 3 .and. self%short == self%nodes) then
         call bad_input(error, path//': every node has '//to_text(self%most_coordinates)//' coordinates only, three are '// &
            'needed: is the mesh plane, or is a column missing?')
         return
      else if (self%short > 0) then
         call self%warnings%add(severity_doubtful, path//': '//to_text(self%short)//' nodes have fewer than three coordinates, '// &
            'the missing ones are read as 0, as CalculiX does (first node '//to_text(self%first_short)//')')
      end if
      call make_node_sets(self%node_sets, self%element_sets, self%surfaces, path, model%node_label, table, blocks, &
         self%warnings, model%node_sets)
      call share_out(blocks, model)
      if (size(model%elements) == 0) call bad_input(error, path//': holds no bricks, only '// &
         element_counts(model%other_elements)//': '//model%other_elements(1)%type//' faces at joints are not supported yet, '// &
         'mesh the bodies with bricks (C3D8, C3D8I, C3D20, C3D20R) at the joints')
   end subroutine finish

   !> Nodes by ascending label. A node that is given twice at the same place is one node.
   subroutine finish_nodes(self, path, model, error)
      type(mesh_builder_t), intent(inout) :: self
      character(len=*), intent(in) :: path
      type(fe_model_t), intent(inout) :: model
      type(error_t), allocatable, intent(out) :: error
      integer, allocatable :: order(:)
      logical, allocatable :: first(:)
      integer :: k

      order = ascending_order(self%label(:self%nodes))
      model%node_label = self%label(order)
      model%coordinates = self%coordinates(:, order)
      deallocate (self%label, self%coordinates)
      allocate (first(self%nodes), source=.true.)
      do k = 2, self%nodes
         if (model%node_label(k) /= model%node_label(k - 1)) cycle
         first(k) = .false.
         if (all(abs(model%coordinates(:, k) - model%coordinates(:, k - 1)) <= 0.0_wp)) cycle
         call bad_input(error, path//': node '//to_text(model%node_label(k))//' is defined twice, at '// &
            place(model%coordinates(:, k - 1))//' and at '//place(model%coordinates(:, k))//twice_in_parts(self%has_parts))
         return
      end do
      if (all(first)) return
      call self%warnings%add(severity_doubtful, path//': '//to_text(count(.not. first))//' nodes are defined twice, at the '// &
         'same places (first node '//to_text(model%node_label(findloc(first, .false., dim=1)))//'); each counts once')
      model%coordinates = model%coordinates(:, pack([(k, k=1, self%nodes)], first))
      model%node_label = pack(model%node_label, first)
   end subroutine finish_nodes

   !> What to do where parts have numbers of their own.
   pure function twice_in_parts(has_parts) result(text)
      logical, intent(in) :: has_parts
      character(len=:), allocatable :: text

      text = ''
      if (has_parts) text = ': every *PART of the deck has its own numbers, the matrices have one for every node. Write the '// &
         'deck without parts and assemblies (in Abaqus/CAE: Do not use parts and assemblies in input files), and make the '// &
         'matrices from that'
   end function twice_in_parts

   !> (x, y, z)
   pure function place(x) result(text)
      real(wp), intent(in) :: x(3)
      character(len=:), allocatable :: text
      text = '('//to_text(x(1))//', '//to_text(x(2))//', '//to_text(x(3))//')'
   end function place

   !> Bricks and other elements.
   subroutine share_out(blocks, model)
      type(element_block_t), intent(inout) :: blocks(:)
      type(fe_model_t), intent(inout) :: model
      integer :: k, bricks, others

      bricks = count([(is_brick(blocks(k)%type), k=1, size(blocks))])
      allocate (model%elements(bricks), model%other_elements(size(blocks) - bricks))
      bricks = 0
      others = 0
      do k = 1, size(blocks)
         if (is_brick(blocks(k)%type)) then
            bricks = bricks + 1
            call move_block(blocks(k), model%elements(bricks))
         else
            others = others + 1
            call move_block(blocks(k), model%other_elements(others))
         end if
      end do
   end subroutine share_out

   subroutine move_block(from, to)
      type(element_block_t), intent(inout) :: from
      type(element_block_t), intent(out) :: to
      call move_alloc(from%type, to%type)
      call move_alloc(from%connectivity, to%connectivity)
   end subroutine move_block

end module microslip_io_mesh_builder
