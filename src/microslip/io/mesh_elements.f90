!> The elements of a mesh file: lists by type while it is read, then node indices and a table of all element labels.
module microslip_io_mesh_elements
   use microslip_core_error, only: bad_input, error_t
   use microslip_core_kinds, only: i8
   use microslip_core_text, only: to_text
   use microslip_core_warning_list, only: severity_doubtful, warning_list_t
   use microslip_fe_model, only: element_block_t
   use microslip_io_element_types, only: is_brick, nodes_per_element
   use microslip_io_label_list, only: ascending_order, find_label
   implicit none(type, external)
   private

   public :: element_list_t, element_table_t, index_elements

   !> Elements of one type, with node labels.
   type :: element_list_t
      character(len=:), allocatable :: type
      integer :: count = 0
      integer, allocatable :: element_label(:)
      !> (nodes per element, elements)
      integer, allocatable :: label(:, :)
   contains
      procedure :: add
   end type element_list_t

   !> Where the element with a label is.
   type :: element_table_t
      !> Ascending labels; the block and the element in it
      integer, allocatable :: label(:), block(:), place(:)
   end type element_table_t

contains

   !> Add an element.
   pure subroutine add(self, label, nodes)
      class(element_list_t), intent(inout) :: self
      !> Its number
      integer, intent(in) :: label
      !> Labels of its nodes
      integer, intent(in) :: nodes(:)
      integer, allocatable :: more_labels(:), more(:, :)

      if (self%count == size(self%element_label)) then
         allocate (more_labels(2*self%count), more(size(nodes), 2*self%count))
         more_labels(:self%count) = self%element_label
         more(:, :self%count) = self%label
         call move_alloc(more_labels, self%element_label)
         call move_alloc(more, self%label)
      end if
      self%count = self%count + 1
      self%element_label(self%count) = label
      self%label(:, self%count) = nodes
   end subroutine add

   !> Node indices for node labels, and the table of the elements. The lists are given up.
   subroutine index_elements(lists, node_label, path, has_parts, warnings, table, blocks, error)
      type(element_list_t), allocatable, intent(inout) :: lists(:)
      !> Ascending
      integer, intent(in) :: node_label(:)
      !> Name of the file, for messages
      character(len=*), intent(in) :: path
      !> Whether the file has parts with numbers of their own
      logical, intent(in) :: has_parts
      type(warning_list_t), intent(inout) :: warnings
      type(element_table_t), intent(out) :: table
      !> One for every list
      type(element_block_t), allocatable, intent(out) :: blocks(:)
      type(error_t), allocatable, intent(out) :: error
      integer, allocatable :: order(:)
      integer :: k, n, last

      n = sum(lists%count)
      allocate (table%label(n), table%block(n), table%place(n))
      last = 0
      do k = 1, size(lists)
         associate (range => [last + 1, last + lists(k)%count])
            table%label(range(1):range(2)) = lists(k)%element_label(:lists(k)%count)
            table%block(range(1):range(2)) = k
            table%place(range(1):range(2)) = [(last, last=1, lists(k)%count)]
            last = range(2)
         end associate
      end do
      order = ascending_order(table%label)
      table%label = table%label(order)
      table%block = table%block(order)
      table%place = table%place(order)
      call check_labels(lists, path, has_parts, table, error)
      if (allocated(error)) return
      allocate (blocks(size(lists)))
      do k = 1, size(lists)
         call index_list(lists(k), node_label, path, blocks(k), warnings, error)
         if (allocated(error)) return
      end do
      call check_twins(blocks, lists, path, error)
      deallocate (lists)
   end subroutine index_elements

   !> No element has two meanings. One that is given twice in the same words (gmsh: once for every physical group) is one.
   subroutine check_labels(lists, path, has_parts, table, error)
      type(element_list_t), intent(inout) :: lists(:)
      character(len=*), intent(in) :: path
      logical, intent(in) :: has_parts
      type(element_table_t), intent(inout) :: table
      type(error_t), allocatable, intent(out) :: error
      logical, allocatable :: first(:)
      integer :: k, j, b

      allocate (first(size(table%label)), source=.true.)
      do k = 2, size(first)
         if (table%label(k) /= table%label(k - 1)) cycle
         first(k) = .false.
         if (table%block(k) == table%block(k - 1)) then
            associate (label => lists(table%block(k))%label)
               if (all(label(:, table%place(k)) == label(:, table%place(k - 1)))) cycle
            end associate
         end if
         call bad_input(error, path//': element '//to_text(table%label(k))//' is defined twice, with different nodes')
         if (has_parts) error%message = error%message//': every *PART of the deck has its own numbers, write it without parts'
         return
      end do
      if (all(first)) return
      ! The later copies go.
      do b = 1, size(lists)
         call drop(b)
      end do
      table%label = pack(table%label, first)
      table%block = pack(table%block, first)
      table%place = pack(table%place, first)

   contains

      subroutine drop(b)
         integer, intent(in) :: b
         logical, allocatable :: keep(:)
         integer, allocatable :: moved(:)

         allocate (keep(lists(b)%count), source=.true.)
         allocate (moved(lists(b)%count))
         do j = 1, size(first)
            if (table%block(j) == b .and. .not. first(j)) keep(table%place(j)) = .false.
         end do
         moved(1:1) = merge(1, 0, keep(1:1))
         do j = 2, size(keep)
            moved(j) = moved(j - 1) + merge(1, 0, keep(j))
         end do
         do j = 1, size(first)
            if (table%block(j) == b) table%place(j) = moved(table%place(j))
         end do
         do j = 1, size(keep)
            if (.not. keep(j)) cycle
            lists(b)%element_label(moved(j)) = lists(b)%element_label(j)
            lists(b)%label(:, moved(j)) = lists(b)%label(:, j)
         end do
         lists(b)%count = count(keep)
      end subroutine drop

   end subroutine check_labels

   !> One type with node indices. Of a type that is not known, what looks like a node may be none: such elements are left out.
   subroutine index_list(list, node_label, path, block, warnings, error)
      type(element_list_t), intent(in) :: list
      integer, intent(in) :: node_label(:)
      character(len=*), intent(in) :: path
      type(element_block_t), intent(out) :: block
      type(warning_list_t), intent(inout) :: warnings
      type(error_t), allocatable, intent(out) :: error
      integer :: e, k, n

      n = size(list%label, 1)
      block%type = list%type
      allocate (block%connectivity(n, list%count))
      do e = 1, list%count
         do k = 1, n
            block%connectivity(k, e) = find_label(node_label, list%label(k, e))
            if (block%connectivity(k, e) > 0) cycle
            if (nodes_per_element(list%type) == 0) then
               call warnings%add(severity_doubtful, path//": elements of the type '"//list%type//"' are left out: the "// &
                  'program does not know it, and their nodes are not those of the mesh (first element '// &
                  to_text(list%element_label(e))//')')
               deallocate (block%connectivity)
               allocate (block%connectivity(n, 0))
               return
            end if
            call bad_input(error, path//': element '//to_text(list%element_label(e))//' ('//list%type//') uses node '// &
               to_text(list%label(k, e))//', which is not defined')
            return
         end do
      end do
   end subroutine index_list

   !> No two bricks have the same nodes.
   subroutine check_twins(blocks, lists, path, error)
      type(element_block_t), intent(in) :: blocks(:)
      type(element_list_t), intent(in) :: lists(:)
      character(len=*), intent(in) :: path
      type(error_t), allocatable, intent(out) :: error
      integer, allocatable :: key(:), order(:)
      integer :: b, k, first, second

      do b = 1, size(blocks)
         if (.not. is_brick(blocks(b)%type)) cycle
         associate (nodes => blocks(b)%connectivity)
            allocate (key(size(nodes, 2)))
            do k = 1, size(key)
               key(k) = int(mod(sum(int(nodes(:8, k), i8)**2), int(huge(1), i8)))
            end do
            order = ascending_order(key)
            do k = 2, size(order)
               if (key(order(k)) /= key(order(k - 1))) cycle
               first = order(k - 1)
               second = order(k)
               if (.not. same_nodes(nodes(:8, first), nodes(:8, second))) cycle
               call bad_input(error, path//': the elements '//to_text(lists(b)%element_label(first))//' and '// &
                  to_text(lists(b)%element_label(second))//' have the same corner nodes: the body is there twice')
               return
            end do
            deallocate (key)
         end associate
      end do
   end subroutine check_twins

   !> Whether two lists of different nodes are the same but for their order.
   pure logical function same_nodes(a, b)
      integer, intent(in) :: a(:), b(:)
      integer :: k

      same_nodes = .true.
      do k = 1, size(a)
         same_nodes = same_nodes .and. any(b == a(k))
      end do
   end function same_nodes

end module microslip_io_mesh_elements
