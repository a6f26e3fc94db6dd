!> Meshes of gmsh (.msh, ASCII, versions 4.1 and 2.2); physical groups become node sets.
!>
!> gmsh does not tell a formulation: bricks are called C3D8 and C3D20, tetrahedra and wedges C3D4, C3D10, C3D6, C3D15. Points,
!> lines and faces only say which nodes are in a group.
module microslip_io_mesh_gmsh
   use microslip_core_error, only: bad_input, error_t
   use microslip_core_kinds, only: i8, wp
   use microslip_core_text, only: to_text
   use microslip_core_warning_list, only: severity_note
   use microslip_io_line_reader, only: line_reader_t, next_integer, next_real
   use microslip_io_mesh_builder, only: mesh_builder_t
   implicit none(type, external)
   private

   public :: read_mesh_gmsh

   !> Node k of an Abaqus C3D20 is node abaqus_order(k) of a gmsh 20-node brick.
   integer, parameter :: abaqus_order(20) = [1, 2, 3, 4, 5, 6, 7, 8, 9, 12, 14, 10, 17, 19, 20, 18, 11, 13, 15, 16]

   !> Most tags of an element of version 2.2 (gmsh writes 2, and partitions).
   integer, parameter :: most_tags = 10000

   !> Name of a physical group.
   type :: group_t
      integer :: dimension = 0, tag = 0
      character(len=:), allocatable :: name
   end type group_t

   !> Physical groups of a geometric entity.
   type :: entity_t
      integer :: dimension = 0, tag = 0
      integer, allocatable :: group(:)
   end type entity_t

   !> What is known while a file is read.
   type :: gmsh_t
      type(line_reader_t) :: lines
      logical :: version_4 = .false., has_format = .false.
      type(group_t), allocatable :: groups(:)
      type(entity_t), allocatable :: entities(:)
   contains
      procedure :: expect_line
      procedure :: integers
      procedure :: complain
   end type gmsh_t

contains

   !> Read a mesh.
   subroutine read_mesh_gmsh(path, builder, error)
      !> Where it is
      character(len=*), intent(in) :: path
      !> Takes nodes, elements and sets
      type(mesh_builder_t), intent(inout) :: builder
      type(error_t), allocatable, intent(out) :: error
      type(gmsh_t) :: file
      logical :: found

      call file%lines%open(path, error)
      if (allocated(error)) return
      allocate (file%groups(0), file%entities(0))
      do
         call file%lines%next_line(found, error)
         if (allocated(error) .or. .not. found) exit
         select case (trim(adjustl(file%lines%text())))
         case ('$MeshFormat')
            call read_format(file, error)
         case ('$PhysicalNames')
            call read_names(file, error)
         case ('$Entities')
            call read_entities(file, error)
         case ('$Nodes')
            call read_nodes(file, builder, error)
         case ('$Elements')
            call read_elements(file, builder, error)
         end select
         if (allocated(error)) exit
      end do
      if (.not. (allocated(error) .or. file%has_format)) call bad_input(error, path//': no section $MeshFormat: version 1 of '// &
         '.msh is not known, save it in version 4.1 or 2.2 (Mesh.MshFileVersion = 4.1)')
      if (builder%node_sets%count == 0) call builder%warnings%add(severity_note, path//': no element is in a physical group, '// &
         'so there are no node sets (in version 2.2, Mesh.SaveAll = 1 leaves the groups out)')
      call file%lines%close()
   end subroutine read_mesh_gmsh

   !> '4.1 0 8' or '2.2 0 8'.
   subroutine read_format(file, error)
      type(gmsh_t), intent(inout) :: file
      type(error_t), allocatable, intent(out) :: error
      character(len=:), allocatable :: line

      call file%expect_line(error)
      if (allocated(error)) return
      line = adjustl(file%lines%text())
      file%has_format = .true.
      file%version_4 = index(line, '4.1 ') == 1
      if (.not. file%version_4 .and. index(line, '2.2 ') /= 1) then
         call bad_input(error, file%lines%place()//"the .msh format '"//file%lines%shown()//"' is not known: save it in "// &
            'version 4.1 or 2.2 (Mesh.MshFileVersion = 4.1)')
      else if (index(line(4:), ' 1 ') == 1) then
         call bad_input(error, file%lines%place()//'a binary .msh file: save it as ASCII (Mesh.Binary = 0)')
      end if
   end subroutine read_format

   !> Physical groups: dimension, tag, "name".
   subroutine read_names(file, error)
      type(gmsh_t), intent(inout) :: file
      type(error_t), allocatable, intent(out) :: error
      type(group_t) :: group
      integer :: head(2), count(1), k, first, last

      call file%expect_line(error)
      if (.not. allocated(error)) call file%integers(count, error)
      if (allocated(error)) return
      do k = 1, count(1)
         call file%expect_line(error)
         if (.not. allocated(error)) call file%integers(head, error)
         if (allocated(error)) return
         first = index(file%lines%text(), '"')
         last = index(file%lines%text(), '"', back=.true.)
         if (last <= first) then
            call file%complain('a physical group (dimension tag "name")', error)
            return
         end if
         group = group_t(dimension=head(1), tag=head(2))
         group%name = file%lines%buffer(file%lines%first + first:file%lines%first + last - 2)
         file%groups = [file%groups, group]
      end do
   end subroutine read_names

   !> Version 4.1: the physical groups of the points, curves, surfaces and volumes.
   subroutine read_entities(file, error)
      type(gmsh_t), intent(inout) :: file
      type(error_t), allocatable, intent(out) :: error
      type(entity_t) :: entity
      character(len=:), allocatable :: line
      real(wp) :: number
      integer :: counts(4), dimension, k, j, p, groups
      logical :: ok

      call file%expect_line(error)
      if (.not. allocated(error)) call file%integers(counts, error)
      if (allocated(error)) return
      do dimension = 0, 3
         do k = 1, counts(dimension + 1)
            call file%expect_line(error)
            if (allocated(error)) return
            ! tag, then a point (3 numbers) or a box (6), then the number of groups and the groups.
            line = file%lines%text()
            p = 1
            entity%dimension = dimension
            call next_integer(line, p, entity%tag, ok)
            do j = 1, merge(3, 6, dimension == 0)
               if (ok) call next_real(line, p, number, ok)
            end do
            if (ok) call next_integer(line, p, groups, ok)
            if (ok) ok = groups >= 0 .and. groups <= len(line)
            if (ok) then
               entity%group = spread(0, 1, groups)
               do j = 1, groups
                  if (ok) call next_integer(line, p, entity%group(j), ok)
                  entity%group(j) = abs(entity%group(j))
               end do
            end if
            if (.not. ok) then
               call file%complain('an entity', error)
               return
            end if
            file%entities = [file%entities, entity]
         end do
      end do
   end subroutine read_entities

   !> Nodes of both versions.
   subroutine read_nodes(file, builder, error)
      type(gmsh_t), intent(inout) :: file
      type(mesh_builder_t), intent(inout) :: builder
      type(error_t), allocatable, intent(out) :: error
      integer :: head(4), count(1), b, k, tag(1)
      integer(i8) :: bytes
      integer, allocatable :: tags(:)

      call file%expect_line(error)
      if (allocated(error)) return
      if (.not. file%version_4) then
         call file%integers(count, error)
         do k = 1, count(1)
            if (.not. allocated(error)) call file%expect_line(error)
            if (.not. allocated(error)) call take_node(.true., 0)
            if (allocated(error)) return
         end do
         return
      end if
      call file%integers(count, error)
      if (allocated(error)) return
      do b = 1, count(1)
         call file%expect_line(error)
         if (.not. allocated(error)) call file%integers(head, error)
         if (allocated(error)) return
         inquire (file=file%lines%path, size=bytes)
         if (head(4) < 0 .or. head(4) > bytes/2) then
            call file%complain('a block of nodes (dimension, entity, 0 or 1, number of nodes)', error)
            return
         end if
         allocate (tags(head(4)))
         do k = 1, size(tags)
            call file%expect_line(error)
            if (.not. allocated(error)) call file%integers(tag, error)
            if (allocated(error)) return
            tags(k) = tag(1)
         end do
         do k = 1, size(tags)
            call file%expect_line(error)
            if (.not. allocated(error)) call take_node(.false., tags(k))
            if (allocated(error)) return
         end do
         deallocate (tags)
      end do

   contains

      !> Three coordinates, in version 2.2 behind the label.
      subroutine take_node(with_label, known_label)
         logical, intent(in) :: with_label
         integer, intent(in) :: known_label
         real(wp) :: x(3)
         integer :: label, p, i
         logical :: ok

         associate (line => file%lines%buffer(file%lines%first:file%lines%last))
            p = 1
            ok = .true.
            label = known_label
            if (with_label) call next_integer(line, p, label, ok)
            do i = 1, 3
               if (ok) call next_real(line, p, x(i), ok)
            end do
         end associate
         if (ok) then
            call builder%add_node(label, x)
         else
            call file%complain('a node', error)
         end if
      end subroutine take_node

   end subroutine read_nodes

   !> Elements of both versions.
   subroutine read_elements(file, builder, error)
      type(gmsh_t), intent(inout) :: file
      type(mesh_builder_t), intent(inout) :: builder
      type(error_t), allocatable, intent(out) :: error
      integer :: head(4), start(3), count(1), b, k
      integer, allocatable :: sets(:)

      call file%expect_line(error)
      if (.not. allocated(error)) call file%integers(count, error)
      if (allocated(error)) return
      do b = 1, count(1)
         call file%expect_line(error)
         if (allocated(error)) return
         if (file%version_4) then
            call file%integers(head, error)
            if (allocated(error)) return
            sets = sets_of_entity(file, builder, head(1), head(2))
            do k = 1, head(4)
               call file%expect_line(error)
               if (.not. allocated(error)) call take_element(file, builder, head(3), 1, sets, error)
               if (allocated(error)) return
            end do
         else
            ! label, type, number of tags, tags (the first is the physical group), nodes
            call file%integers(start, error)
            if (allocated(error)) return
            if (start(3) < 0 .or. start(3) > most_tags) then
               call file%complain('an element (label, type, number of tags, tags, nodes)', error)
               return
            end if
            head(:1) = 0
            if (start(3) > 0) call file%integers(head, error)
            if (allocated(error)) return
            sets = [integer ::]
            if (start(3) > 0 .and. head(4) /= 0) sets = [set_of_group(file, builder, dimension_of(start(2)), abs(head(4)))]
            call take_element(file, builder, start(2), 3 + start(3), sets, error)
            if (allocated(error)) return
         end if
      end do
   end subroutine read_elements

   !> One element from the current line; `skip` numbers stand in front of its nodes.
   subroutine take_element(file, builder, type, skip, sets, error)
      type(gmsh_t), intent(inout) :: file
      type(mesh_builder_t), intent(inout) :: builder
      integer, intent(in) :: type, skip
      integer, intent(in) :: sets(:)
      type(error_t), allocatable, intent(out) :: error
      integer, allocatable :: numbers(:)
      integer :: n, k, s

      n = node_count(type)
      if (n == 0) then
         call bad_input(error, file%lines%place()//'gmsh element type '//to_text(type)//' ('//type_name(type)// &
            ') is not known')
         return
      end if
      allocate (numbers(skip + n))
      call file%integers(numbers, error)
      if (allocated(error)) return
      associate (nodes => numbers(skip + 1:))
         do s = 1, size(sets)
            do k = 1, n
               call builder%node_sets%items(sets(s))%labels%add(nodes(k))
            end do
         end do
         if (type == 17) then
            call builder%add_element('C3D20', numbers(1), nodes(abaqus_order))
         else if (solid_name(type) /= '') then
            call builder%add_element(trim(solid_name(type)), numbers(1), nodes)
         end if
      end associate
   end subroutine take_element

   !> Number of nodes of a gmsh element type, 0 for one that is refused.
   pure integer function node_count(type)
      integer, intent(in) :: type
      select case (type)
      case (15); node_count = 1
      case (1); node_count = 2
      case (2, 8); node_count = 3
      case (3, 4); node_count = 4
      case (7); node_count = 5
      case (6, 9); node_count = 6
      case (5, 16); node_count = 8
      case (10); node_count = 9
      case (11); node_count = 10
      case (19); node_count = 13
      case (18); node_count = 15
      case (17); node_count = 20
      case default; node_count = 0
      end select
   end function node_count

   !> A solid's name in Abaqus; '' for points, lines and faces. The order of the nodes of those without faces does not matter.
   pure character(len=5) function solid_name(type)
      integer, intent(in) :: type
      select case (type)
      case (5); solid_name = 'C3D8'
      case (17); solid_name = 'C3D20'
      case (4); solid_name = 'C3D4'
      case (11); solid_name = 'C3D10'
      case (6); solid_name = 'C3D6'
      case (18); solid_name = 'C3D15'
      case (7); solid_name = 'C3D5'
      case (19); solid_name = 'C3D13'
      case default; solid_name = ''
      end select
   end function solid_name

   !> Dimension of a gmsh element type.
   pure integer function dimension_of(type)
      integer, intent(in) :: type
      select case (type)
      case (15); dimension_of = 0
      case (1, 8); dimension_of = 1
      case (2, 3, 9, 10, 16); dimension_of = 2
      case default; dimension_of = 3
      end select
   end function dimension_of

   !> In words, for messages.
   pure function type_name(type) result(name)
      integer, intent(in) :: type
      character(len=:), allocatable :: name
      select case (type)
      case (12); name = '27-node brick: set Mesh.SecondOrderIncomplete = 1'
      case (13); name = '18-node prism: set Mesh.SecondOrderIncomplete = 1'
      case (14); name = '14-node pyramid: set Mesh.SecondOrderIncomplete = 1'
      case (21:); name = 'of an order above 2: set Mesh.ElementOrder = 1 or 2'
      case default; name = 'not used here'
      end select
   end function type_name

   !> Sets of an entity's physical groups.
   function sets_of_entity(file, builder, dimension, tag) result(sets)
      type(gmsh_t), intent(in) :: file
      type(mesh_builder_t), intent(inout) :: builder
      integer, intent(in) :: dimension, tag
      integer, allocatable :: sets(:)
      integer :: k, g

      allocate (sets(0))
      do k = 1, size(file%entities)
         if (file%entities(k)%dimension /= dimension .or. file%entities(k)%tag /= tag) cycle
         do g = 1, size(file%entities(k)%group)
            sets = [sets, set_of_group(file, builder, dimension, file%entities(k)%group(g))]
         end do
      end do
   end function sets_of_entity

   !> Set of a physical group; one without a name is called physical_DIMENSION_TAG.
   integer function set_of_group(file, builder, dimension, tag) result(set)
      type(gmsh_t), intent(in) :: file
      type(mesh_builder_t), intent(inout) :: builder
      integer, intent(in) :: dimension, tag
      character(len=:), allocatable :: name
      integer :: k

      name = 'physical_'//to_text(dimension)//'_'//to_text(tag)
      do k = 1, size(file%groups)
         if (file%groups(k)%dimension == dimension .and. file%groups(k)%tag == tag) name = file%groups(k)%name
      end do
      call builder%node_sets%index_of(name, set)
      call builder%node_sets%define(set, '')
   end function set_of_group

   !> Go to a line that must be there.
   subroutine expect_line(self, error)
      class(gmsh_t), intent(inout) :: self
      type(error_t), allocatable, intent(out) :: error
      logical :: found

      call self%lines%next_line(found, error)
      if (.not. found .and. .not. allocated(error)) call bad_input(error, self%lines%path//': ends too early')
   end subroutine expect_line

   !> The first integers of the current line.
   subroutine integers(self, values, error)
      class(gmsh_t), intent(in) :: self
      integer, intent(out) :: values(:)
      type(error_t), allocatable, intent(out) :: error
      integer :: p, k
      logical :: ok

      values = 0
      p = 1
      do k = 1, size(values)
         call next_integer(self%lines%buffer(self%lines%first:self%lines%last), p, values(k), ok)
         if (.not. ok) then
            call self%complain(to_text(size(values))//' integers', error)
            return
         end if
      end do
   end subroutine integers

   !> The current line is not what it should be.
   subroutine complain(self, expected, error)
      class(gmsh_t), intent(in) :: self
      character(len=*), intent(in) :: expected
      type(error_t), allocatable, intent(out) :: error
      call bad_input(error, self%lines%place()//"expected "//expected//", found '"//self%lines%shown()//"'")
   end subroutine complain

end module microslip_io_mesh_gmsh
