!> Collects the nodes, elements and node sets of a mesh file in any order and makes a model of them.
module microslip_io_mesh_builder
   use microslip_core_error, only: bad_input, error_t
   use microslip_core_kinds, only: wp
   use microslip_core_text, only: lower_case, to_text
   use microslip_fe_model, only: element_block_t, fe_model_t, node_set_t
   implicit none(type, external)
   private

   public :: mesh_builder_t, nodes_per_element

   !> Names that a set list refers to, resolved when the whole file is read.
   type :: named_labels_t
      character(len=:), allocatable :: name
      integer :: count = 0
      integer, allocatable :: label(:)
      !> Indices of the sets it includes
      integer, allocatable :: included(:)
      logical :: defined = .false.
   end type named_labels_t

   !> Elements of one type, with node labels.
   type :: element_list_t
      character(len=:), allocatable :: type
      integer :: count = 0
      integer, allocatable :: element_label(:)
      integer, allocatable :: label(:, :)
   end type element_list_t

   !> A mesh under construction.
   type :: mesh_builder_t
      private
      integer :: nodes = 0
      integer, allocatable :: label(:)
      real(wp), allocatable :: coordinates(:, :)
      type(element_list_t), allocatable :: elements(:)
      type(named_labels_t), allocatable :: sets(:)
   contains
      procedure :: add_node
      procedure :: add_element
      procedure :: set_index
      procedure :: define_set
      procedure :: add_to_set
      procedure :: include_set
      procedure :: finish
   end type mesh_builder_t

contains

   !> Number of nodes of an element type, 0 for a type the program does not know.
   pure integer function nodes_per_element(type)
      !> As in Abaqus and CalculiX, in capitals
      character(len=*), intent(in) :: type

      select case (type)
      case ('C3D8', 'C3D8I')
         nodes_per_element = 8
      case ('C3D20', 'C3D20R')
         nodes_per_element = 20
      case default
         nodes_per_element = 0
      end select
   end function nodes_per_element

   !> Add a node.
   pure subroutine add_node(self, label, position)
      class(mesh_builder_t), intent(inout) :: self
      !> Its number
      integer, intent(in) :: label
      !> (3)
      real(wp), intent(in) :: position(3)
      integer, allocatable :: more_labels(:)
      real(wp), allocatable :: more(:, :)

      if (.not. allocated(self%label)) allocate (self%label(1000), self%coordinates(3, 1000))
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
   end subroutine add_node

   !> Add an element; its type must be known to `nodes_per_element`.
   pure subroutine add_element(self, type, label, nodes)
      class(mesh_builder_t), intent(inout) :: self
      !> Element type
      character(len=*), intent(in) :: type
      !> Its number
      integer, intent(in) :: label
      !> Labels of its nodes, Abaqus order
      integer, intent(in) :: nodes(:)
      integer, allocatable :: more_labels(:), more(:, :)
      integer :: k, which

      if (.not. allocated(self%elements)) allocate (self%elements(0))
      which = 0
      do k = 1, size(self%elements)
         if (self%elements(k)%type == type) which = k
      end do
      if (which == 0) then
         self%elements = [self%elements, element_list_t(type=type)]
         which = size(self%elements)
         allocate (self%elements(which)%element_label(1000), self%elements(which)%label(size(nodes), 1000))
      end if
      associate (list => self%elements(which))
         if (list%count == size(list%element_label)) then
            allocate (more_labels(2*list%count), more(size(nodes), 2*list%count))
            more_labels(:list%count) = list%element_label
            more(:, :list%count) = list%label
            call move_alloc(more_labels, list%element_label)
            call move_alloc(more, list%label)
         end if
         list%count = list%count + 1
         list%element_label(list%count) = label
         list%label(:, list%count) = nodes
      end associate
   end subroutine add_element

   !> Index of the node set with this name, made if there is none. Case does not matter.
   subroutine set_index(self, name, index)
      class(mesh_builder_t), intent(inout) :: self
      !> Name of the set
      character(len=*), intent(in) :: name
      !> Its index
      integer, intent(out) :: index
      type(named_labels_t) :: new

      if (.not. allocated(self%sets)) allocate (self%sets(0))
      do index = 1, size(self%sets)
         if (lower_case(self%sets(index)%name) == lower_case(name)) return
      end do
      new%name = name
      allocate (new%label(16), new%included(0))
      self%sets = [self%sets, new]
   end subroutine set_index

   !> Mark a set as defined (one that is only referred to is an error).
   pure subroutine define_set(self, index)
      class(mesh_builder_t), intent(inout) :: self
      !> From `set_index`
      integer, intent(in) :: index
      self%sets(index)%defined = .true.
   end subroutine define_set

   !> Add a node to a set.
   pure subroutine add_to_set(self, index, label)
      class(mesh_builder_t), intent(inout) :: self
      !> From `set_index`
      integer, intent(in) :: index
      !> Node label
      integer, intent(in) :: label

      associate (set => self%sets(index))
         if (set%count == size(set%label)) set%label = [set%label, spread(0, 1, set%count)]
         set%count = set%count + 1
         set%label(set%count) = label
      end associate
   end subroutine add_to_set

   !> Add the nodes of one set to another, when the mesh is finished.
   pure subroutine include_set(self, index, other)
      class(mesh_builder_t), intent(inout) :: self
      !> The set that grows, from `set_index`
      integer, intent(in) :: index
      !> The set it includes
      integer, intent(in) :: other
      self%sets(index)%included = [self%sets(index)%included, other]
   end subroutine include_set

   !> Sort the nodes, replace labels by indices and hand out mesh and sets.
   subroutine finish(self, path, model, error)
      class(mesh_builder_t), intent(inout) :: self
      !> Name of the file, for messages
      character(len=*), intent(in) :: path
      !> Mesh and node sets; no matrices
      type(fe_model_t), intent(out) :: model
      type(error_t), allocatable, intent(out) :: error
      integer, allocatable :: order(:)
      integer :: k

      if (self%nodes == 0 .or. .not. allocated(self%elements)) then
         call bad_input(error, path//': holds '//trim(merge('no nodes   ', 'no elements', self%nodes == 0)))
         return
      end if
      order = ascending(self%label(:self%nodes))
      model%node_label = self%label(order)
      model%coordinates = self%coordinates(:, order)
      do k = 2, self%nodes
         if (model%node_label(k) == model%node_label(k - 1)) then
            call bad_input(error, path//': node '//to_text(model%node_label(k))//' is defined twice')
            return
         end if
      end do
      allocate (model%elements(size(self%elements)))
      do k = 1, size(self%elements)
         call finish_elements(self%elements(k), path, model%node_label, model%elements(k), error)
         if (allocated(error)) return
      end do
      if (.not. allocated(self%sets)) allocate (self%sets(0))
      allocate (model%node_sets(size(self%sets)))
      do k = 1, size(self%sets)
         call finish_set(self%sets, k, path, model%node_label, model%node_sets(k), error)
         if (allocated(error)) return
      end do
   end subroutine finish

   !> Elements with node indices.
   subroutine finish_elements(list, path, node_label, block, error)
      type(element_list_t), intent(in) :: list
      character(len=*), intent(in) :: path
      integer, intent(in) :: node_label(:)
      type(element_block_t), intent(out) :: block
      type(error_t), allocatable, intent(out) :: error
      integer :: e, k

      block%type = list%type
      allocate (block%connectivity(size(list%label, 1), list%count))
      do e = 1, list%count
         do k = 1, size(list%label, 1)
            block%connectivity(k, e) = find(node_label, list%label(k, e))
            if (block%connectivity(k, e) == 0) then
               call bad_input(error, path//': element '//to_text(list%element_label(e))//' uses node '// &
                  to_text(list%label(k, e))//', which is not defined')
               return
            end if
         end do
      end do
   end subroutine finish_elements

   !> A set with those it includes, as ascending node indices without repetition.
   subroutine finish_set(sets, index, path, node_label, set, error)
      type(named_labels_t), intent(in) :: sets(:)
      integer, intent(in) :: index
      character(len=*), intent(in) :: path
      integer, intent(in) :: node_label(:)
      type(node_set_t), intent(out) :: set
      type(error_t), allocatable, intent(out) :: error
      logical, allocatable :: inside(:), visited(:)
      integer, allocatable :: waiting(:)
      integer :: k, node, current

      allocate (inside(size(node_label)), visited(size(sets)), source=.false.)
      waiting = [index]
      do while (size(waiting) > 0)
         current = waiting(1)
         waiting = waiting(2:)
         if (visited(current)) cycle
         visited(current) = .true.
         if (.not. sets(current)%defined) then
            call bad_input(error, path//": node set '"//sets(index)%name//"' includes '"//sets(current)%name// &
               "', which is not defined")
            return
         end if
         waiting = [waiting, sets(current)%included]
         do k = 1, sets(current)%count
            node = find(node_label, sets(current)%label(k))
            if (node == 0) then
               call bad_input(error, path//": node set '"//sets(current)%name//"' lists node "// &
                  to_text(sets(current)%label(k))//', which is not defined')
               return
            end if
            inside(node) = .true.
         end do
      end do
      set%name = sets(index)%name
      set%nodes = pack([(k, k=1, size(node_label))], inside)
   end subroutine finish_set

   !> Place of a value in an ascending list, 0 if it is not there.
   pure integer function find(list, value)
      integer, intent(in) :: list(:)
      integer, intent(in) :: value
      integer :: low, high, middle

      find = 0
      low = 1
      high = size(list)
      do while (low <= high)
         middle = (low + high)/2
         if (list(middle) == value) then
            find = middle
            return
         else if (list(middle) < value) then
            low = middle + 1
         else
            high = middle - 1
         end if
      end do
   end function find

   !> The order that sorts a list, by merging.
   pure function ascending(list) result(order)
      integer, intent(in) :: list(:)
      integer, allocatable :: order(:)
      integer, allocatable :: merged(:)
      integer :: n, width, left, middle, right, i, j, k

      n = size(list)
      order = [(k, k=1, n)]
      allocate (merged(n))
      width = 1
      do while (width < n)
         do left = 1, n, 2*width
            middle = min(left + width, n + 1)
            right = min(left + 2*width, n + 1)
            i = left
            j = middle
            do k = left, right - 1
               if (i < middle .and. j < right) then
                  if (list(order(i)) <= list(order(j))) then
                     merged(k) = order(i)
                     i = i + 1
                  else
                     merged(k) = order(j)
                     j = j + 1
                  end if
               else if (i < middle) then
                  merged(k) = order(i)
                  i = i + 1
               else
                  merged(k) = order(j)
                  j = j + 1
               end if
            end do
         end do
         order = merged
         width = 2*width
      end do
   end function ascending

end module microslip_io_mesh_builder
