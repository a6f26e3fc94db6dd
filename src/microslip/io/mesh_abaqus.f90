!> Meshes in the input language of Abaqus and CalculiX: *NODE, *ELEMENT, *NSET, *ELSET, *SURFACE, *INCLUDE, and *PART with
!> *INSTANCE. Cards that make, move or turn nodes in other ways are refused; cards that do not are skipped.
!>
!> An included file is read as if its lines stood in place of the card: it may begin with data lines of the card before.
module microslip_io_mesh_abaqus
   use microslip_core_error, only: bad_input, error_t
   use microslip_core_kinds, only: wp
   use microslip_core_text, only: lower_case, to_text
   use microslip_core_warning_list, only: severity_doubtful, severity_note
   use microslip_io_abaqus_line, only: at_field_end, field, field_count, has_parameter, keyword_of, label_fault, &
      parameter_value, real_fault, skip_comma, unquoted, upper_case, without_tabs
   use microslip_io_abaqus_parts, only: parts_t
   use microslip_io_element_types, only: most_nodes, nodes_per_element
   use microslip_io_line_reader, only: line_reader_t, next_integer, next_real
   use microslip_io_mesh_builder, only: mesh_builder_t
   implicit none(type, external)
   private

   public :: read_mesh_abaqus

   !> Files included by files included by ...
   integer, parameter :: deepest_include = 10

   !> What the data lines belong to.
   type :: card_t
      !> 'node', 'element', ...; empty for a card whose data lines are skipped
      character(len=:), allocatable :: keyword
      character(len=:), allocatable :: element_type
      !> Set that the nodes, elements or faces go into, 0 for none
      integer :: set = 0
      logical :: generate = .false., of_nodes = .false.
      !> Element under construction: whether its label is known, its label, nodes so far, and their labels
      logical :: has_label = .false.
      integer :: element = 0, found = 0
      integer :: nodes(most_nodes) = 0
   end type card_t

   !> A deck while it is read.
   type :: deck_t
      !> Folder of the deck, with '/' at its end, or ''
      character(len=:), allocatable :: folder
      type(card_t) :: card
      type(parts_t) :: parts
      !> Whether the coordinates that follow are those of a *SYSTEM
      logical :: in_system = .false.
   end type deck_t

contains

   !> Read a mesh.
   subroutine read_mesh_abaqus(path, builder, error)
      !> Where it is
      character(len=*), intent(in) :: path
      !> Takes nodes, elements and sets
      type(mesh_builder_t), intent(inout) :: builder
      type(error_t), allocatable, intent(out) :: error
      type(deck_t) :: deck

      deck%folder = path(:index(path, '/', back=.true.))
      deck%card%keyword = ''
      deck%parts%name = ''
      call read_lines(path, 1, deck, builder, error)
      if (.not. allocated(error)) call deck%parts%check(path, builder%warnings, error)
   end subroutine read_mesh_abaqus

   !> Read one file.
   recursive subroutine read_lines(path, level, deck, builder, error)
      character(len=*), intent(in) :: path
      integer, intent(in) :: level
      type(deck_t), intent(inout) :: deck
      type(mesh_builder_t), intent(inout) :: builder
      type(error_t), allocatable, intent(out) :: error
      type(line_reader_t) :: lines
      character(len=:), allocatable :: line, included
      logical :: found

      call lines%open(path, error)
      if (allocated(error)) return
      do
         call lines%next_line(found, error)
         if (allocated(error) .or. .not. found) exit
         line = without_tabs(lines%text())
         if (line == '') cycle
         if (line(1:1) /= '*') then
            call read_data(line, lines, deck, builder, error)
         else if (index(line, '**') /= 1) then
            call read_card_line(lines, line, error)
            if (.not. allocated(error)) call start_card(line, lines, deck, builder, included, error)
            if (.not. allocated(error) .and. allocated(included)) call include_file()
         end if
         if (allocated(error)) exit
      end do
      if (.not. allocated(error) .and. level == 1) call end_card(deck%card, lines, builder, error)
      call lines%close()

   contains

      subroutine include_file()
         character(len=:), allocatable :: there

         if (level >= deepest_include) then
            call bad_input(error, lines%place()//'too many *INCLUDE within each other')
            return
         end if
         call find_included(included, deck%folder, path, lines%place(), builder, there, error)
         if (.not. allocated(error)) call read_lines(there, level + 1, deck, builder, error)
      end subroutine include_file

   end subroutine read_lines

   !> Where an included file is. CalculiX looks in the folder where it runs, which is that of the deck as a rule; others look
   !> beside the file that includes. Two files are one too many.
   subroutine find_included(name, deck_folder, path, place, builder, there, error)
      !> As the card has it; the folder of the deck; the file that includes, and its line for messages
      character(len=*), intent(in) :: name, deck_folder, path, place
      type(mesh_builder_t), intent(inout) :: builder
      character(len=:), allocatable, intent(out) :: there
      type(error_t), allocatable, intent(out) :: error
      character(len=:), allocatable :: beside
      logical :: in_deck_folder, is_beside, here

      there = name
      if (name(1:1) == '/') return
      there = deck_folder//name
      beside = path(:index(path, '/', back=.true.))//name
      inquire (file=there, exist=in_deck_folder)
      inquire (file=beside, exist=is_beside)
      inquire (file=name, exist=here)
      if (in_deck_folder .and. is_beside .and. beside /= there) then
         call bad_input(error, place//'*INCLUDE, INPUT='//name//' can be '//there//' (which CalculiX reads if it runs in the '// &
            'folder of the deck) and '//beside//': remove one of them, or name it with its folder')
      else if (in_deck_folder) then
         return
      else if (is_beside) then
         there = beside
         call builder%warnings%add(severity_note, place//'*INCLUDE, INPUT='//name//' is read from '//there//'; CalculiX would '// &
            'look for '//deck_folder//name//' if it runs in the folder of the deck')
      else if (here) then
         there = name
         call builder%warnings%add(severity_doubtful, place//'*INCLUDE, INPUT='//name//' is read from the folder where the '// &
            'program runs; '//deck_folder//name//' does not exist')
      else
         call bad_input(error, place//'*INCLUDE, INPUT='//name//': there is no '//deck_folder//name//other_place())
      end if

   contains

      function other_place() result(text)
         character(len=:), allocatable :: text
         text = ''
         if (beside /= there) text = ' and no '//beside
         if (index(name, '\') > 0) text = text//' (folders are separated by /)'
      end function other_place

   end subroutine find_included

   !> Append the continuation lines of a card that ends in a comma.
   subroutine read_card_line(lines, line, error)
      type(line_reader_t), intent(inout) :: lines
      character(len=:), allocatable, intent(inout) :: line
      type(error_t), allocatable, intent(out) :: error
      logical :: found

      do while (line(len(line):) == ',')
         call lines%next_line(found, error)
         if (allocated(error) .or. .not. found) return
         line = line//without_tabs(lines%text())
      end do
   end subroutine read_card_line

   !> A new card: note what its data lines mean.
   subroutine start_card(line, lines, deck, builder, included, error)
      character(len=*), intent(in) :: line
      type(line_reader_t), intent(in) :: lines
      type(deck_t), intent(inout) :: deck
      type(mesh_builder_t), intent(inout) :: builder
      !> File to be read in place of this card
      character(len=:), allocatable, intent(out) :: included
      type(error_t), allocatable, intent(out) :: error
      character(len=:), allocatable :: keyword, system

      keyword = keyword_of(line)
      if (keyword == 'include') then
         included = parameter_value(line, 'input')
         if (included == '') call bad_input(error, lines%place()//'*INCLUDE without INPUT=file')
         return
      end if
      call end_card(deck%card, lines, builder, error)
      if (allocated(error)) return
      deck%card = card_t()
      deck%card%keyword = keyword
      associate (card => deck%card)
         select case (keyword)
         case ('node')
            system = lower_case(parameter_value(line, 'system'))
            if (deck%in_system .or. .not. any(system == ['r', ' '])) then
               call refuse('its coordinates are not along the global x, y, z axes')
               return
            end if
            call use_set(parameter_value(line, 'nset'), required=.false.)
         case ('nset')
            card%generate = has_parameter(line, 'generate')
            call use_set(parameter_value(line, 'nset'), required=.true.)
            if (.not. allocated(error) .and. has_parameter(line, 'elset')) call add_elements_of(parameter_value(line, 'elset'))
         case ('elset')
            card%generate = has_parameter(line, 'generate')
            call use_element_set(parameter_value(line, 'elset'), required=.true.)
         case ('surface')
            call start_surface()
         case ('element')
            card%element_type = upper_case(parameter_value(line, 'type'))
            if (card%element_type == '') call bad_input(error, lines%place()//'*ELEMENT without TYPE=')
            if (.not. allocated(error)) call use_element_set(parameter_value(line, 'elset'), required=.false.)
         case ('part')
            builder%has_parts = .true.
            call deck%parts%begin(parameter_value(line, 'name'), builder%nodes)
         case ('end part')
            call deck%parts%end(builder%nodes)
            deck%in_system = .false.
         case ('instance')
            if (has_parameter(line, 'library') .or. has_parameter(line, 'instance')) then
               call refuse('it takes its nodes from another analysis')
            else
               call deck%parts%place(parameter_value(line, 'part'), parameter_value(line, 'name'), lines%place(), error)
            end if
         case ('end instance')
            call deck%parts%move(builder)
         case ('system')
            deck%in_system = .false.
         case ('ncopy', 'nfill', 'ngen', 'nmap', 'elgen', 'elcopy', 'imperfection', 'symmetric model generation', 'import', &
               'parameter', 'model change', 'submodel generation', 'adjust')
            call refuse('it makes or moves nodes or elements')
         case ('nodes', 'elements', 'nsets', 'elsets')
            call refuse('this card is not known, *'//upper_case(keyword(:len(keyword) - 1))//' probably is meant')
         case default
            if (keyword == 'keyword' .or. index(keyword, 'element_') == 1) then
               call bad_input(error, lines%place()//'this is a card of LS-DYNA: the format is not known; readable are '// &
                  'Abaqus/CalculiX decks (.inp) and gmsh meshes (.msh, ASCII, 4.1 and 2.2)')
            end if
            card%keyword = ''
         end select
      end associate
      if (.not. allocated(error) .and. any(keyword == ['node   ', 'element']) .and. has_parameter(line, 'input')) &
         included = parameter_value(line, 'input')

   contains

      subroutine refuse(why)
         character(len=*), intent(in) :: why
         call bad_input(error, lines%place()//"'"//line//"' is not read: "//why//'. Write the mesh with every node and every '// &
            'element listed, in global x, y, z (the preprocessor''s export of the flat mesh, or "send all abq" of CalculiX '// &
            'GraphiX)')
      end subroutine refuse

      subroutine use_set(name, required)
         character(len=*), intent(in) :: name
         logical, intent(in) :: required
         if (name == '') then
            if (required) call bad_input(error, lines%place()//'*NSET without NSET=name')
            return
         end if
         call builder%node_sets%index_of(name, deck%card%set)
         call builder%node_sets%define(deck%card%set, deck%parts%name)
      end subroutine use_set

      subroutine use_element_set(name, required)
         character(len=*), intent(in) :: name
         logical, intent(in) :: required
         if (name == '') then
            if (required) call bad_input(error, lines%place()//'*ELSET without ELSET=name')
            return
         end if
         call builder%element_sets%index_of(name, deck%card%set)
         call builder%element_sets%define(deck%card%set, deck%parts%name)
      end subroutine use_element_set

      subroutine add_elements_of(name)
         character(len=*), intent(in) :: name
         integer :: elements
         call builder%element_sets%index_of(name, elements)
         associate (set => builder%node_sets%items(deck%card%set))
            set%of_elements = [set%of_elements, elements]
         end associate
      end subroutine add_elements_of

      subroutine start_surface()
         character(len=:), allocatable :: name, type

         name = parameter_value(line, 'name')
         type = lower_case(parameter_value(line, 'type'))
         if (name == '') then
            call bad_input(error, lines%place()//'*SURFACE without NAME=name')
            return
         end if
         call builder%surfaces%index_of(name, deck%card%set)
         call builder%surfaces%define(deck%card%set, deck%parts%name)
         deck%card%of_nodes = type == 'node'
         if (.not. any(type == ['       ', 'element', 'node   ']) .or. has_parameter(line, 'combine')) &
            call builder%surfaces%blame(deck%card%set, 'surfaces of this kind are not supported ('//lines%place()//line// &
            '): list its elements and faces, or make a node set')
      end subroutine start_surface

   end subroutine start_card

   !> A card ends: its last element must be complete.
   subroutine end_card(card, lines, builder, error)
      type(card_t), intent(inout) :: card
      type(line_reader_t), intent(in) :: lines
      type(mesh_builder_t), intent(inout) :: builder
      type(error_t), allocatable, intent(out) :: error

      if (.not. card%has_label) return
      if (nodes_per_element(card%element_type) == 0 .and. card%found > 0) then
         call keep_element(card, builder)
      else
         call bad_input(error, lines%path//': element '//to_text(card%element)//' has '// &
            to_text(card%found)//' nodes, '//card%element_type//' needs '//to_text(nodes_per_element(card%element_type)))
      end if
   end subroutine end_card

   !> A data line.
   subroutine read_data(line, lines, deck, builder, error)
      character(len=*), intent(in) :: line
      type(line_reader_t), intent(in) :: lines
      type(deck_t), intent(inout) :: deck
      type(mesh_builder_t), intent(inout) :: builder
      type(error_t), allocatable, intent(out) :: error

      select case (deck%card%keyword)
      case ('node')
         call read_node(line, lines, deck%card, builder, error)
      case ('element')
         call read_element(line, lines, deck%card, builder, error)
      case ('nset', 'elset')
         call read_set(line, lines, deck%card, builder, error)
      case ('surface')
         call read_surface(line, deck%card, builder)
      case ('instance')
         call deck%parts%read_position(line, lines%place(), error)
      case ('system')
         deck%in_system = .true.
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
      integer :: label, p, k, given
      logical :: ok

      p = 1
      call next_integer(line, p, label, ok)
      if (ok) ok = at_field_end(line, p)
      x = 0.0_wp
      given = 0
      do k = 1, 3
         call skip_comma(line, p)
         if (.not. ok .or. p > len(line)) exit
         given = k
         if (line(p:p) == ',') cycle
         call next_real(line, p, x(k), ok)
         if (ok) ok = at_field_end(line, p)
      end do
      call skip_comma(line, p)
      if (.not. ok .or. p <= len(line) .or. label < 1) then
         call bad_input(error, lines%place()//"'"//lines%shown()//"' is not a node (label, x, y, z): "//node_fault(line))
         return
      end if
      call builder%add_node(label, x, given)
      if (card%set > 0) call builder%node_sets%items(card%set)%labels%add(label)
   end subroutine read_node

   !> What is wrong with the line of a node.
   function node_fault(line) result(fault)
      character(len=*), intent(in) :: line
      character(len=:), allocatable :: fault
      integer :: k

      fault = label_fault(field(line, 1))
      do k = 2, 4
         if (fault == '') fault = real_fault(field(line, k))
      end do
      if (fault == '' .and. field_count(line) > 4) fault = 'it has '//to_text(field_count(line))//' fields, 4 are expected'
      if (fault == '' .or. index(line, ',') == 0) fault = 'its fields must be separated by commas'
   end function node_fault

   !> 'label, node, node, ...' over as many lines as it takes. An element of a type that is not known goes on where a line
   !> ends in a comma.
   subroutine read_element(line, lines, card, builder, error)
      character(len=*), intent(in) :: line
      type(line_reader_t), intent(in) :: lines
      type(card_t), intent(inout) :: card
      type(mesh_builder_t), intent(inout) :: builder
      type(error_t), allocatable, intent(out) :: error
      integer :: number, p, needed
      logical :: ok

      needed = nodes_per_element(card%element_type)
      p = 1
      do
         call skip_comma(line, p)
         if (p > len(line)) exit
         call next_integer(line, p, number, ok)
         if (ok) ok = at_field_end(line, p)
         if (.not. ok .or. (card%has_label .and. card%found == merge(needed, most_nodes, needed > 0))) then
            call bad_input(error, lines%place()//"'"//lines%shown()//"' does not fit an element "//card%element_type// &
               ' (label and '//to_text(needed)//' nodes)'//number_fault())
            return
         end if
         if (card%has_label) then
            card%found = card%found + 1
            card%nodes(card%found) = number
         else
            card%has_label = .true.
            card%element = number
         end if
      end do
      if (card%found < needed .or. (needed == 0 .and. line(len(line):) == ',')) return
      if (card%found > 0) call keep_element(card, builder)

   contains

      function number_fault() result(text)
         character(len=:), allocatable :: text
         integer :: k

         text = ''
         do k = 1, field_count(line)
            if (text == '' .and. field(line, k) /= '') text = label_fault(field(line, k))
         end do
         if (text /= '') text = ': '//text
      end function number_fault

   end subroutine read_element

   !> An element is complete.
   subroutine keep_element(card, builder)
      type(card_t), intent(inout) :: card
      type(mesh_builder_t), intent(inout) :: builder

      call builder%add_element(card%element_type, card%element, card%nodes(:card%found))
      if (card%set > 0) call builder%element_sets%items(card%set)%labels%add(card%element)
      card%found = 0
      card%has_label = .false.
   end subroutine keep_element

   !> Labels, names of other sets, or 'first, last, step'.
   subroutine read_set(line, lines, card, builder, error)
      character(len=*), intent(in) :: line
      type(line_reader_t), intent(in) :: lines
      type(card_t), intent(in) :: card
      type(mesh_builder_t), intent(inout) :: builder
      type(error_t), allocatable, intent(out) :: error

      if (card%keyword == 'nset') then
         call read_set_of(builder%node_sets)
      else
         call read_set_of(builder%element_sets)
      end if

   contains

      subroutine read_set_of(sets)
         use microslip_io_mesh_sets, only: set_list_t
         type(set_list_t), intent(inout) :: sets
         integer :: numbers(3), k, other
         character(len=:), allocatable :: text
         logical :: ok

         numbers = [0, 0, 1]
         do k = 1, field_count(line)
            text = field(line, k)
            if (text == '') cycle
            ok = label_fault(text) == ''
            if (card%generate) then
               if (ok .and. k <= 3) read (text, *) numbers(k)
               if (.not. ok .or. k > 3) numbers(1) = 0
               if (numbers(1) == 0) exit
            else if (ok) then
               read (text, *) numbers(1)
               call sets%items(card%set)%labels%add(numbers(1))
            else if (scan(text(1:1), '+-0123456789') == 1 .and. verify(text(2:), '0123456789') == 0) then
               call bad_input(error, lines%place()//"'"//lines%shown()//"': "//label_fault(text))
               return
            else
               call sets%index_of(unquoted(text), other)
               call sets%include(card%set, other)
            end if
         end do
         if (.not. card%generate) return
         if (numbers(1) < 1 .or. numbers(2) < numbers(1) .or. numbers(3) < 1) then
            call bad_input(error, lines%place()//"'"//lines%shown()//"' is not 'first, last, step' with first <= last")
         else if (mod(numbers(2) - numbers(1), numbers(3)) /= 0) then
            call bad_input(error, lines%place()//"'"//lines%shown()//"' is not 'first, last, step': no number of steps of "// &
               to_text(numbers(3))//' leads from '//to_text(numbers(1))//' to '//to_text(numbers(2)))
         else
            call sets%items(card%set)%labels%add_range(numbers(1), numbers(2), numbers(3))
         end if
      end subroutine read_set_of

   end subroutine read_set

   !> 'elements, face', elements being an element set or a label; of a surface of nodes, a node set or a label.
   subroutine read_surface(line, card, builder)
      character(len=*), intent(in) :: line
      type(card_t), intent(in) :: card
      type(mesh_builder_t), intent(inout) :: builder
      character(len=:), allocatable :: text, face
      integer :: label, other, number
      logical :: is_label

      text = field(line, 1)
      face = upper_case(field(line, 2))
      is_label = label_fault(text) == ''
      label = 0
      other = 0
      if (is_label) read (text, *) label
      associate (set => builder%surfaces%items(card%set))
         if (card%of_nodes .and. is_label) then
            call set%labels%add(label)
         else if (card%of_nodes) then
            call builder%node_sets%index_of(unquoted(text), other)
            set%of_elements = [set%of_elements, other]
         else
            if (.not. is_label) call builder%element_sets%index_of(unquoted(text), other)
            number = 0
            if (len(face) == 2) number = index('S1S2S3S4S5S6', face)/2 + 1
            if (len(face) /= 2 .or. (number == 1 .and. face /= 'S1')) then
               call builder%surfaces%blame(card%set, "the line '"//line//"' names no face S1 to S6")
            else
               set%faces = reshape([set%faces, other, label, number], [3, size(set%faces, 2) + 1])
            end if
         end if
      end associate
   end subroutine read_surface

end module microslip_io_mesh_abaqus
