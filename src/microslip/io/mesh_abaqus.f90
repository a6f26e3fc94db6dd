!> Meshes in the input language of Abaqus and CalculiX: *NODE, *ELEMENT, *NSET, *INCLUDE. Other cards are skipped.
module microslip_io_mesh_abaqus
   use microslip_core_error, only: bad_input, error_t
   use microslip_core_kinds, only: wp
   use microslip_core_text, only: lower_case, to_text
   use microslip_io_line_reader, only: line_reader_t, next_integer, next_real
   use microslip_io_mesh_builder, only: mesh_builder_t, nodes_per_element
   implicit none(type, external)
   private

   public :: read_mesh_abaqus

   !> Files included by files included by ...
   integer, parameter :: deepest_include = 10

   !> What the data lines belong to.
   type :: card_t
      !> 'node', 'element', 'nset', or empty for a card that is skipped
      character(len=:), allocatable :: keyword
      character(len=:), allocatable :: element_type
      !> Set that the nodes go into, 0 for none
      integer :: set = 0
      logical :: generate = .false.
      !> Element under construction: its label, nodes so far, and its node labels
      integer :: element = 0, found = 0
      integer :: nodes(20) = 0
   end type card_t

contains

   !> Read a mesh.
   recursive subroutine read_mesh_abaqus(path, builder, error, depth)
      !> Where it is
      character(len=*), intent(in) :: path
      !> Takes nodes, elements and sets
      type(mesh_builder_t), intent(inout) :: builder
      type(error_t), allocatable, intent(out) :: error
      !> How many files include this one
      integer, intent(in), optional :: depth
      type(line_reader_t) :: lines
      type(card_t) :: card
      character(len=:), allocatable :: line, included
      logical :: found

      call lines%open(path, error)
      if (allocated(error)) return
      card%keyword = ''
      do
         call lines%next_line(found, error)
         if (allocated(error) .or. .not. found) exit
         line = trim(adjustl(lines%text()))
         if (line == '') cycle
         if (line(1:1) /= '*') then
            call read_data(line, lines, card, builder, error)
         else if (index(line, '**') /= 1) then
            call end_card(card, lines, error)
            if (.not. allocated(error)) call read_card_line(lines, line, error)
            if (.not. allocated(error)) call start_card(line, lines, card, builder, included, error)
            if (.not. allocated(error) .and. allocated(included)) call include_file()
         end if
         if (allocated(error)) exit
      end do
      if (.not. allocated(error)) call end_card(card, lines, error)
      call lines%close()

   contains

      subroutine include_file()
         integer :: level, slash

         level = 1
         if (present(depth)) level = depth + 1
         slash = index(path, '/', back=.true.)
         if (included(1:1) /= '/') included = path(:slash)//included
         if (level > deepest_include) then
            call bad_input(error, lines%place()//'too many *INCLUDE within each other')
         else
            call read_mesh_abaqus(included, builder, error, level)
         end if
      end subroutine include_file

   end subroutine read_mesh_abaqus

   !> Append the continuation lines of a card that ends in a comma.
   subroutine read_card_line(lines, line, error)
      type(line_reader_t), intent(inout) :: lines
      character(len=:), allocatable, intent(inout) :: line
      type(error_t), allocatable, intent(out) :: error
      logical :: found

      do while (line(len(line):) == ',')
         call lines%next_line(found, error)
         if (allocated(error) .or. .not. found) return
         line = line//trim(adjustl(lines%text()))
      end do
   end subroutine read_card_line

   !> A new card: note what its data lines mean.
   subroutine start_card(line, lines, card, builder, included, error)
      character(len=*), intent(in) :: line
      type(line_reader_t), intent(in) :: lines
      type(card_t), intent(inout) :: card
      type(mesh_builder_t), intent(inout) :: builder
      !> File to be read in place of this card
      character(len=:), allocatable, intent(out) :: included
      type(error_t), allocatable, intent(out) :: error
      character(len=:), allocatable :: name

      card = card_t()
      card%keyword = lower_case(trim(adjustl(line(2:scan(line//',', ',') - 1))))
      select case (card%keyword)
      case ('node')
         name = parameter_value(line, 'nset')
         if (name /= '') call use_set()
      case ('nset')
         name = parameter_value(line, 'nset')
         if (name == '') then
            call bad_input(error, lines%place()//'*NSET without NSET=name')
            return
         end if
         if (has_parameter(line, 'elset')) then
            call bad_input(error, lines%place()//'*NSET with ELSET= is not known: list the nodes')
            return
         end if
         card%generate = has_parameter(line, 'generate')
         call use_set()
      case ('element')
         card%element_type = upper_case(parameter_value(line, 'type'))
         if (nodes_per_element(card%element_type) == 0) call bad_input(error, lines%place()//"element type '"// &
            card%element_type//"' is not known (C3D8, C3D8I, C3D20, C3D20R are)")
      case ('include')
         included = parameter_value(line, 'input')
         if (included == '') call bad_input(error, lines%place()//'*INCLUDE without INPUT=file')
         card%keyword = ''
      case default
         card%keyword = ''
      end select

   contains

      subroutine use_set()
         call builder%set_index(name, card%set)
         call builder%define_set(card%set)
      end subroutine use_set

   end subroutine start_card

   !> A card ends: its last element must be complete.
   subroutine end_card(card, lines, error)
      type(card_t), intent(in) :: card
      type(line_reader_t), intent(in) :: lines
      type(error_t), allocatable, intent(out) :: error

      if (card%found > 0) call bad_input(error, lines%path//': element '//to_text(card%element)//' has '// &
         to_text(card%found)//' nodes, '//card%element_type//' needs '//to_text(nodes_per_element(card%element_type)))
   end subroutine end_card

   !> A data line.
   subroutine read_data(line, lines, card, builder, error)
      character(len=*), intent(in) :: line
      type(line_reader_t), intent(in) :: lines
      type(card_t), intent(inout) :: card
      type(mesh_builder_t), intent(inout) :: builder
      type(error_t), allocatable, intent(out) :: error

      select case (card%keyword)
      case ('node')
         call read_node(line, lines, card, builder, error)
      case ('element')
         call read_element(line, lines, card, builder, error)
      case ('nset')
         call read_set(line, lines, card, builder, error)
      end select
   end subroutine read_data

   !> 'label, x, y, z'; what is missing is zero.
   subroutine read_node(line, lines, card, builder, error)
      character(len=*), intent(in) :: line
      type(line_reader_t), intent(in) :: lines
      type(card_t), intent(in) :: card
      type(mesh_builder_t), intent(inout) :: builder
      type(error_t), allocatable, intent(out) :: error
      real(wp) :: x(3)
      integer :: label, p, k
      logical :: ok

      p = 1
      call next_integer(line, p, label, ok)
      x = 0.0_wp
      do k = 1, 3
         call skip_comma(line, p)
         if (ok .and. p <= len(line)) call next_real(line, p, x(k), ok)
      end do
      call skip_comma(line, p)
      if (.not. ok .or. p <= len(line) .or. label < 1) then
         call bad_input(error, lines%place()//"'"//line//"' is not a node (label, x, y, z)")
         return
      end if
      call builder%add_node(label, x)
      if (card%set > 0) call builder%add_to_set(card%set, label)
   end subroutine read_node

   !> 'label, node, node, ...' over as many lines as it takes.
   subroutine read_element(line, lines, card, builder, error)
      character(len=*), intent(in) :: line
      type(line_reader_t), intent(in) :: lines
      type(card_t), intent(inout) :: card
      type(mesh_builder_t), intent(inout) :: builder
      type(error_t), allocatable, intent(out) :: error
      integer :: number, p, needed
      logical :: ok, has_label

      needed = nodes_per_element(card%element_type)
      has_label = card%found > 0
      p = 1
      do
         call skip_comma(line, p)
         if (p > len(line)) exit
         call next_integer(line, p, number, ok)
         if (.not. ok .or. (has_label .and. card%found == needed)) then
            call bad_input(error, lines%place()//"'"//line//"' does not fit an element "//card%element_type// &
               ' (label and '//to_text(needed)//' nodes)')
            return
         end if
         if (has_label) then
            card%found = card%found + 1
            card%nodes(card%found) = number
         else
            has_label = .true.
            card%element = number
         end if
      end do
      if (card%found < needed) return
      call builder%add_element(card%element_type, card%element, card%nodes(:needed))
      card%found = 0
   end subroutine read_element

   !> Node labels, names of other sets, or 'first, last, step'.
   subroutine read_set(line, lines, card, builder, error)
      character(len=*), intent(in) :: line
      type(line_reader_t), intent(in) :: lines
      type(card_t), intent(in) :: card
      type(mesh_builder_t), intent(inout) :: builder
      type(error_t), allocatable, intent(out) :: error
      integer :: numbers(3), count, number, p, comma, other
      logical :: ok

      numbers = [0, 0, 1]
      count = 0
      p = 1
      do
         call skip_comma(line, p)
         if (p > len(line)) exit
         comma = p + scan(line(p:)//',', ',') - 2
         call next_integer(line(:comma), p, number, ok)
         if (ok) ok = line(p:comma) == ''
         if (card%generate) then
            count = count + 1
            if (.not. ok .or. count > 3) exit
            numbers(count) = number
         else if (ok) then
            call builder%add_to_set(card%set, number)
         else
            call builder%set_index(unquoted(line(p:comma)), other)
            call builder%include_set(card%set, other)
         end if
         p = comma + 1
      end do
      if (.not. card%generate) return
      if (p <= len(line) .or. count < 2 .or. numbers(3) < 1) then
         call bad_input(error, lines%place()//"'"//line//"' is not 'first, last, step'")
         return
      end if
      do number = numbers(1), numbers(2), numbers(3)
         call builder%add_to_set(card%set, number)
      end do
   end subroutine read_set

   !> Move behind blanks and one comma.
   pure subroutine skip_comma(line, p)
      character(len=*), intent(in) :: line
      integer, intent(inout) :: p
      logical :: behind_comma

      behind_comma = .false.
      do while (p <= len(line))
         if (line(p:p) == ',' .and. .not. behind_comma) then
            behind_comma = .true.
         else if (line(p:p) /= ' ' .and. line(p:p) /= achar(9)) then
            return
         end if
         p = p + 1
      end do
   end subroutine skip_comma

   !> Value of 'name=value' on a card, empty if it is not there.
   pure function parameter_value(line, name) result(value)
      character(len=*), intent(in) :: line, name
      character(len=:), allocatable :: value
      character(len=:), allocatable :: part
      integer :: start, comma, equals

      value = ''
      start = scan(line//',', ',') + 1
      do while (start <= len(line))
         comma = start + scan(line(start:)//',', ',') - 2
         part = line(start:comma)
         equals = index(part, '=')
         if (equals > 0) then
            if (lower_case(trim(adjustl(part(:equals - 1)))) == name) value = unquoted(part(equals + 1:))
         end if
         start = comma + 2
      end do
   end function parameter_value

   !> Whether a card carries a parameter, with or without a value.
   pure logical function has_parameter(line, name)
      character(len=*), intent(in) :: line, name
      integer :: start, comma

      has_parameter = .false.
      start = scan(line//',', ',') + 1
      do while (start <= len(line))
         comma = start + scan(line(start:)//',', ',') - 2
         if (lower_case(trim(adjustl(line(start:start + scan(line(start:comma)//'=', '=') - 2)))) == name) &
            has_parameter = .true.
         start = comma + 2
      end do
   end function has_parameter

   !> Without surrounding blanks and quotes.
   pure function unquoted(text)
      character(len=*), intent(in) :: text
      character(len=:), allocatable :: unquoted

      unquoted = trim(adjustl(text))
      if (len(unquoted) < 2) return
      if (unquoted(1:1) == '"' .and. unquoted(len(unquoted):) == '"') unquoted = unquoted(2:len(unquoted) - 1)
   end function unquoted

   pure function upper_case(text)
      character(len=*), intent(in) :: text
      character(len=len(text)) :: upper_case
      integer :: k

      upper_case = text
      do k = 1, len(text)
         if (text(k:k) >= 'a' .and. text(k:k) <= 'z') upper_case(k:k) = achar(iachar(text(k:k)) - 32)
      end do
   end function upper_case

end module microslip_io_mesh_abaqus
