!> Nodes of the model by the name of a set, and nodes in words, for messages that name the place.
module microslip_fe_selection
   use microslip_core_error, only: error_t, bad_input
   use microslip_core_kinds, only: wp
   use microslip_core_nearest_name, only: nearest_name
   use microslip_core_text, only: to_text
   use microslip_fe_model, only: fe_model_t, row_dependent, row_supported
   implicit none(type, external)
   private

   public :: nodes_of_set, node_text, coordinates_text, absence_text

contains

   !> The nodes of a node set; an unknown name and an empty set are wrong input.
   subroutine nodes_of_set(model, name, nodes, error)
      type(fe_model_t), intent(in) :: model
      !> Name of the set, case does not matter
      character(len=*), intent(in) :: name
      !> Node indices
      integer, allocatable, intent(out) :: nodes(:)
      type(error_t), allocatable, intent(out) :: error
      integer :: set

      set = 0
      if (allocated(model%node_sets)) set = model%find_node_set(name)
      if (set == 0) then
         call bad_input(error, "there is no node set '"//name//"'; the model has "//known_sets(model)//suggestion(model, name))
         return
      end if
      if (allocated(model%node_sets(set)%fault)) then
         call bad_input(error, "the node set '"//name//"' cannot be used: "//model%node_sets(set)%fault)
         return
      end if
      nodes = model%node_sets(set)%nodes
      if (size(nodes) == 0) call bad_input(error, "the node set '"//name//"' is empty")
   end subroutine nodes_of_set

   !> The names of the sets, for messages; of many sets the first.
   pure function known_sets(model) result(list)
      type(fe_model_t), intent(in) :: model
      character(len=:), allocatable :: list
      integer, parameter :: most = 30
      integer :: k

      list = ''
      if (allocated(model%node_sets)) then
         do k = 1, min(size(model%node_sets), most)
            if (k > 1) list = list//', '
            list = list//"'"//model%node_sets(k)%name//"'"
         end do
         if (size(model%node_sets) > most) list = list//' and '//to_text(size(model%node_sets) - most)//' more'
      end if
      if (list == '') list = 'no node sets'
   end function known_sets

   !> '; is NAME meant?' where a set has nearly the same name.
   pure function suggestion(model, name) result(text)
      type(fe_model_t), intent(in) :: model
      character(len=*), intent(in) :: name
      character(len=:), allocatable :: text
      character(len=:), allocatable :: known(:)
      integer :: k

      text = ''
      if (.not. allocated(model%node_sets)) return
      allocate (character(len=maxval([(len(model%node_sets(k)%name), k=1, size(model%node_sets))])) :: &
         known(size(model%node_sets)))
      do k = 1, size(known)
         known(k) = model%node_sets(k)%name
      end do
      text = nearest_name(name, known)
      if (text /= '') text = "; is '"//trim(text)//"' meant?"
   end function suggestion

   !> Label and coordinates of a node, for messages.
   pure function node_text(model, node) result(text)
      type(fe_model_t), intent(in) :: model
      !> Node index
      integer, intent(in) :: node
      character(len=:), allocatable :: text
      text = 'node '//to_text(model%node_label(node))//' at '//coordinates_text(model%coordinates(:, node))
   end function node_text

   !> Why a component of a node has no row, for messages: 'node 7 is supported in z', or what else it may be.
   pure function absence_text(model, node, component) result(text)
      type(fe_model_t), intent(in) :: model
      !> Node index, and 1, 2, 3 = x, y, z
      integer, intent(in) :: node, component
      character(len=:), allocatable :: text
      character(len=3), parameter :: axes = 'xyz'

      text = 'node '//to_text(model%node_label(node))
      select case (model%absence_of(node, component))
      case (row_supported)
         text = text//' is supported in '//axes(component:component)
      case (row_dependent)
         text = text//' depends on other nodes in '//axes(component:component)// &
            & ' by a constraint (an equation, a rigid body, tied surfaces), and has no row in the matrices'
      case default
         text = text//' has no row for '//axes(component:component)// &
            & ' in the matrices: it is supported, or depends on others by a constraint'
      end select
   end function absence_text

   !> (x, y, z), for messages.
   pure function coordinates_text(x) result(text)
      real(wp), intent(in) :: x(3)
      character(len=:), allocatable :: text
      text = '('//to_text(x(1))//', '//to_text(x(2))//', '//to_text(x(3))//')'
   end function coordinates_text

end module microslip_fe_selection
