!> Named sets of a mesh file while it is read: node sets, element sets, surfaces. They may name one another before they are
!> defined, so they are resolved when the whole file is read. A set that cannot be resolved is no fault of the mesh: it is kept
!> with its fault, and refused where it is used.
module microslip_io_mesh_sets
   use microslip_core_kinds, only: i8
   use microslip_core_text, only: lower_case, to_text
   use microslip_io_label_list, only: label_list_t
   implicit none(type, external)
   private

   public :: set_list_t, named_set_t

   !> A set as the file has it.
   type :: named_set_t
      character(len=:), allocatable :: name
      type(label_list_t) :: labels
      !> Indices of the sets of the same kind it includes; of the element sets whose nodes it includes
      integer, allocatable :: included(:), of_elements(:)
      !> (3, faces) of a surface: index of the element set or 0, else the label of the element, and the face from 1
      integer, allocatable :: faces(:, :)
      !> Whether the file defines it, and in which *PART ('': in none)
      logical :: defined = .false.
      character(len=:), allocatable :: part
      !> What is wrong with it; not allocated: nothing so far
      character(len=:), allocatable :: fault
   end type named_set_t

   !> The sets of one kind.
   type :: set_list_t
      !> 'node set', 'element set' or 'surface'
      character(len=:), allocatable :: kind
      type(named_set_t), allocatable :: items(:)
      integer :: count = 0
   contains
      procedure :: find
      procedure :: index_of
      procedure :: define
      procedure :: include
      procedure :: blame
      procedure :: collect
   end type set_list_t

contains

   !> Index of the set with this name, 0 if there is none. Case does not matter.
   pure integer function find(self, name)
      class(set_list_t), intent(in) :: self
      character(len=*), intent(in) :: name
      character(len=:), allocatable :: wanted

      wanted = lower_case(name)
      do find = self%count, 1, -1
         if (len(self%items(find)%name) /= len(wanted)) cycle
         if (lower_case(self%items(find)%name) == wanted) return
      end do
   end function find

   !> Index of the set with this name, made if there is none.
   subroutine index_of(self, name, index)
      class(set_list_t), intent(inout) :: self
      !> Name of the set
      character(len=*), intent(in) :: name
      !> Its index
      integer, intent(out) :: index
      type(named_set_t), allocatable :: more(:)

      index = self%find(name)
      if (index > 0) return
      if (.not. allocated(self%items)) allocate (self%items(8))
      if (self%count == size(self%items)) then
         allocate (more(2*self%count))
         more(:self%count) = self%items
         call move_alloc(more, self%items)
      end if
      self%count = self%count + 1
      index = self%count
      self%items(index)%name = name
      allocate (self%items(index)%included(0), self%items(index)%of_elements(0), self%items(index)%faces(3, 0))
   end subroutine index_of

   !> The file defines a set, or adds to it.
   subroutine define(self, index, part)
      class(set_list_t), intent(inout) :: self
      !> From `index_of`
      integer, intent(in) :: index
      !> The *PART in which it stands, '' for none
      character(len=*), intent(in) :: part

      associate (set => self%items(index))
         if (.not. set%defined) then
            set%defined = .true.
            set%part = part
         else if (lower_case(set%part) /= lower_case(part)) then
            call self%blame(index, 'its name is used for two sets, '//where_defined(set%part)//' and '//where_defined(part)// &
               ': give them different names')
         end if
      end associate

   contains

      pure function where_defined(name) result(text)
         character(len=*), intent(in) :: name
         character(len=:), allocatable :: text
         if (name == '') then
            text = 'outside of the parts'
         else
            text = "in part '"//name//"'"
         end if
      end function where_defined

   end subroutine define

   !> A set includes another one of its kind.
   pure subroutine include(self, index, other)
      class(set_list_t), intent(inout) :: self
      !> The set that grows, from `index_of`
      integer, intent(in) :: index
      !> The set it includes
      integer, intent(in) :: other
      self%items(index)%included = [self%items(index)%included, other]
   end subroutine include

   !> Note what is wrong with a set; the first fault counts.
   pure subroutine blame(self, index, fault)
      class(set_list_t), intent(inout) :: self
      !> From `index_of`
      integer, intent(in) :: index
      !> In words
      character(len=*), intent(in) :: fault
      if (.not. allocated(self%items(index)%fault)) self%items(index)%fault = fault
   end subroutine blame

   !> The labels of a set and of those it includes, among the labels that exist.
   subroutine collect(self, index, known, inside, visited, absent)
      class(set_list_t), intent(inout) :: self
      !> From `index_of`
      integer, intent(in) :: index
      !> Labels that exist, strictly ascending
      integer, intent(in) :: known(:)
      !> (known) those in the set
      logical, allocatable, intent(out) :: inside(:)
      !> (sets) the set itself and those it includes
      logical, allocatable, intent(out) :: visited(:)
      !> How many labels of ranges do not exist
      integer(i8), intent(out) :: absent
      integer, allocatable :: waiting(:)
      integer(i8) :: more
      integer :: current, missing

      allocate (inside(size(known)), visited(self%count), source=.false.)
      absent = 0
      waiting = [index]
      do while (size(waiting) > 0)
         current = waiting(1)
         waiting = waiting(2:)
         if (visited(current)) cycle
         visited(current) = .true.
         associate (set => self%items(current))
            if (.not. set%defined) call self%blame(index, "it includes '"//set%name//"', which is not defined")
            if (allocated(set%fault) .and. current /= index) call self%blame(index, "it includes '"//set%name//"': "//set%fault)
            waiting = [waiting, set%included]
            call set%labels%mark(known, inside, missing, more)
            absent = absent + more
            if (missing == 0) cycle
            if (current == index) call self%blame(index, 'it lists '//word(self%kind)//to_text(missing)//', which is not defined')
            if (current /= index) call self%blame(index, "it includes '"//set%name//"', which lists "//word(self%kind)// &
               to_text(missing)//', which is not defined')
         end associate
      end do
   end subroutine collect

   !> What a set is made of.
   pure function word(kind)
      character(len=*), intent(in) :: kind
      character(len=:), allocatable :: word
      word = 'node '
      if (kind == 'element set') word = 'element '
   end function word

end module microslip_io_mesh_sets
