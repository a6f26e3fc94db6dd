!> The finite-element model as the program sees it: mesh, node sets, sparse matrices. SI units.
module microslip_fe_model
   use microslip_core_kinds, only: wp
   use microslip_core_text, only: to_text
   use microslip_linalg_sparse, only: symmetric_sparse_t
   implicit none(type, external)
   private

   public :: fe_model_t, element_block_t, node_set_t, element_counts
   public :: has_row, row_supported, row_dependent, row_unknown

   !> Why a component of a node has no row in the matrices: it has one; it is supported; it depends on others by a
   !> constraint (an equation, a rigid body, tied surfaces); one of the two.
   integer, parameter :: has_row = 0, row_supported = 1, row_dependent = 2, row_unknown = 3

   !> All elements of one type.
   type :: element_block_t
      !> As in Abaqus and CalculiX, in capitals
      character(len=:), allocatable :: type
      !> (nodes per element, elements) indices into the node list, Abaqus/CalculiX node order
      integer, allocatable :: connectivity(:, :)
   end type element_block_t

   !> Nodes with a name.
   type :: node_set_t
      character(len=:), allocatable :: name
      !> Indices into the node list, ascending
      integer, allocatable :: nodes(:)
      !> What is wrong with the set, in words: it is refused where it is used. Not allocated: nothing
      character(len=:), allocatable :: fault
   end type node_set_t

   !> Mesh and matrices. Supported and dependent degrees of freedom have no row in the matrices.
   type :: fe_model_t
      !> (3, nodes) m
      real(wp), allocatable :: coordinates(:, :)
      !> (nodes) the numbers the nodes have in the FE program, ascending
      integer, allocatable :: node_label(:)
      !> Bricks (C3D8, C3D8I, C3D20, C3D20R), whose faces can be joints
      type(element_block_t), allocatable :: elements(:)
      !> All other elements, down to springs and masses with one node: they join nodes, and have no faces that are known
      type(element_block_t), allocatable :: other_elements(:)
      type(node_set_t), allocatable :: node_sets(:)
      !> (rows) node index and component (1, 2, 3 = x, y, z) of every matrix row
      integer, allocatable :: row_node(:), row_component(:)
      !> N/m
      type(symmetric_sparse_t) :: stiffness
      !> kg
      type(symmetric_sparse_t) :: mass
      !> (3, nodes) why a component has no row, as the matrices show it (`microslip_fe_model_survey`); not allocated: as said
      !> by who made the model, components without a row are supported
      integer, allocatable :: absence(:, :)
   contains
      procedure :: node_count
      procedure :: row_count
      procedure :: rows_of_nodes
      procedure :: find_node_set
      procedure :: absence_of
   end type fe_model_t

contains

   !> Number of nodes of the mesh.
   pure integer function node_count(self)
      class(fe_model_t), intent(in) :: self
      node_count = size(self%node_label)
   end function node_count

   !> Number of rows of the matrices (unsupported degrees of freedom).
   pure integer function row_count(self)
      class(fe_model_t), intent(in) :: self
      row_count = size(self%row_node)
   end function row_count

   !> (3, nodes) matrix row of every component of every node, 0 where it is supported.
   pure function rows_of_nodes(self) result(rows)
      class(fe_model_t), intent(in) :: self
      integer, allocatable :: rows(:, :)
      integer :: k

      allocate (rows(3, self%node_count()), source=0)
      do k = 1, self%row_count()
         rows(self%row_component(k), self%row_node(k)) = k
      end do
   end function rows_of_nodes

   !> Why a component of a node has no row; `has_row` if it has one.
   pure integer function absence_of(self, node, component)
      class(fe_model_t), intent(in) :: self
      !> Node index, and 1, 2, 3 = x, y, z
      integer, intent(in) :: node, component
      if (allocated(self%absence)) then
         absence_of = self%absence(component, node)
      else
         absence_of = row_supported
         if (any(self%row_node == node .and. self%row_component == component)) absence_of = has_row
      end if
   end function absence_of

   !> Index of the node set with this name (case does not matter), 0 if there is none.
   pure integer function find_node_set(self, name)
      use microslip_core_text, only: lower_case
      class(fe_model_t), intent(in) :: self
      character(len=*), intent(in) :: name
      integer :: k

      find_node_set = 0
      do k = 1, size(self%node_sets)
         if (lower_case(self%node_sets(k)%name) == lower_case(name)) find_node_set = k
      end do
   end function find_node_set

   !> '48 C3D8, 12 SPRING1'
   pure function element_counts(blocks) result(text)
      type(element_block_t), intent(in) :: blocks(:)
      character(len=:), allocatable :: text
      integer :: k

      text = ''
      do k = 1, size(blocks)
         if (k > 1) text = text//', '
         text = text//to_text(size(blocks(k)%connectivity, 2))//' '//blocks(k)%type
      end do
   end function element_counts

end module microslip_fe_model
