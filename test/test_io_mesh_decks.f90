!> Tests of decks as they come: parts, element sets, surfaces, included files, elements without faces, and what is refused.
module test_io_mesh_decks
   use microslip_core_error, only: error_t
   use microslip_core_kinds, only: wp
   use microslip_core_text, only: to_text
   use microslip_core_warning_list, only: warning_list_t
   use microslip_fe_model, only: fe_model_t
   use microslip_fe_selection, only: nodes_of_set
   use microslip_io_mesh_file, only: read_mesh
   use support_checks, only: good, remove
   use testdrive, only: check, new_unittest, test_failed, testing_error => error_type, unittest_type
   implicit none(type, external)
   private

   public :: collect_io_mesh_decks

   character(len=*), parameter :: scratch = 'build/test_io_mesh_decks', inp = scratch//'.inp'
   integer, parameter :: width = 80
   !> A unit cube whose nodes are 1 to 8, in Abaqus order.
   character(len=width), parameter :: cube(8) = [character(len=width) :: '1,0,0,0', '2,1,0,0', '3,1,1,0', '4,0,1,0', &
      '5,0,0,1', '6,1,0,1', '7,1,1,1', '8,0,1,1']
   character(len=width), parameter :: brick(2) = [character(len=width) :: '*ELEMENT, TYPE=C3D8, ELSET=all', '1,1,2,3,4,5,6,7,8']
   character(len=1), parameter :: tab = achar(9), cr = achar(13), lf = achar(10)

contains

   subroutine collect_io_mesh_decks(testsuite)
      type(unittest_type), allocatable, intent(out) :: testsuite(:)

      testsuite = [ &
         new_unittest('line ends, byte order mark, tabulators', test_bytes), &
         new_unittest('parts are placed by their instances', test_parts), &
         new_unittest('elements without faces are read and counted', test_other_elements), &
         new_unittest('node sets from element sets and surfaces', test_sets), &
         new_unittest('a set with a fault is refused where it is used', test_faulty_sets), &
         new_unittest('included files', test_include), &
         new_unittest('large labels', test_large_labels), &
         new_unittest('nodes and elements given twice', test_twice), &
         new_unittest('what makes or moves nodes is refused', test_refused_cards), &
         new_unittest('what is wrong with a number', test_numbers), &
         new_unittest('files of other formats', test_formats)]
   end subroutine collect_io_mesh_decks

   !> The same cube in files that differ in their bytes.
   subroutine test_bytes(error)
      type(testing_error), allocatable, intent(out) :: error
      character(len=:), allocatable :: text

      text = joined(lf)
      call expect_cube(error, char(239)//char(187)//char(191)//text)
      if (.not. allocated(error)) call expect_cube(error, joined(cr))
      if (.not. allocated(error)) call expect_cube(error, joined(cr//lf))
      if (.not. allocated(error)) call expect_cube(error, joined(cr//cr//lf))
      if (.not. allocated(error)) call expect_cube(error, joined(tab//lf))
      if (.not. allocated(error)) call expect_cube(error, replaced(text, ', ', ','//tab))
      if (.not. allocated(error)) call expect_cube(error, replaced(text, '=', tab//'='//tab))

   contains

      function joined(ending) result(text)
         character(len=*), intent(in) :: ending
         character(len=:), allocatable :: text
         integer :: k

         text = '*NODE, NSET=points'//ending
         do k = 1, 8
            text = text//trim(cube(k))//ending
         end do
         text = text//trim(brick(1))//ending//trim(brick(2))
      end function joined

      function replaced(text, old, new) result(changed)
         character(len=*), intent(in) :: text, old, new
         character(len=:), allocatable :: changed
         integer :: p, k

         changed = ''
         p = 1
         do
            k = index(text(p:), old)
            if (k == 0) exit
            changed = changed//text(p:p + k - 2)//new
            p = p + k - 1 + len(old)
         end do
         changed = changed//text(p:)
      end function replaced

      subroutine expect_cube(error, bytes)
         type(testing_error), allocatable, intent(out) :: error
         character(len=*), intent(in) :: bytes
         type(fe_model_t) :: model
         type(warning_list_t) :: warnings
         type(error_t), allocatable :: lib
         integer :: unit

         open (newunit=unit, file=inp, access='stream', form='unformatted', status='replace')
         write (unit) bytes
         close (unit)
         call read_mesh(inp, model, warnings, lib)
         call remove(inp)
         call good(error, lib)
         if (.not. allocated(error)) call check(error, model%node_count(), 8)
         if (.not. allocated(error)) call check(error, sum(model%coordinates), 12.0_wp)
         if (.not. allocated(error)) call expect_set(error, model, 'points', [1, 2, 3, 4, 5, 6, 7, 8])
         if (.not. allocated(error)) call check(error, warnings%number(), 0)
      end subroutine expect_cube

   end subroutine test_bytes

   !> A part that is moved by (0, 0, 1) and turned by 90 degrees about an axis along x through (0, 1, 1): (x, y, z) goes to
   !> (x, 1 - z, y).
   subroutine test_parts(error)
      type(testing_error), allocatable, intent(out) :: error
      type(fe_model_t) :: model
      type(warning_list_t) :: warnings
      type(error_t), allocatable :: lib
      character(len=width) :: deck(30)
      !> Rounding of a turn of lengths about 1
      real(wp), parameter :: rounding = 8.0_wp*epsilon(1.0_wp)

      deck = ''
      deck(:22) = [character(len=width) :: '*PART, NAME=Block', '*NODE', cube, brick, '*NSET, NSET=base', '1,2,3,4', '*END PART', &
         '*ASSEMBLY, NAME=all', '*INSTANCE, NAME=Block-1, PART=block', '0, 0, 1', '0, 1, 1, 2, 1, 1, 90.', '*END INSTANCE', &
         '*NSET, NSET=top, INSTANCE=Block-1', '5,6,7,8']
      call read(deck, model, warnings, lib)
      call good(error, lib)
      if (allocated(error)) return
      call check(error, maxval(abs(model%coordinates(:, 1) - [0.0_wp, 1.0_wp, 0.0_wp])) <= rounding, 'node 1 is elsewhere')
      if (allocated(error)) return
      call check(error, maxval(abs(model%coordinates(:, 8) - [0.0_wp, 0.0_wp, 1.0_wp])) <= rounding, 'node 8 is elsewhere')
      if (.not. allocated(error)) call expect_set(error, model, 'top', [5, 6, 7, 8])
      if (allocated(error)) return
      deck(23:25) = [character(len=width) :: '*INSTANCE, NAME=Block-2, PART=Block', '5,0,0', '*END INSTANCE']
      call expect(error, deck, "'Block-2' is the second one of part 'Block'")
      if (.not. allocated(error)) call expect(error, [character(len=width) :: '*PART,NAME=a', '*NODE', cube, brick, '*END PART', &
         '*PART,NAME=b', '*NODE', '1,5,5,5', '*END PART'], 'every *PART of the deck has its own numbers')
      if (.not. allocated(error)) call expect(error, [character(len=width) :: '*PART,NAME=a', '*NODE', cube, brick, '*END PART', &
         '*INSTANCE, NAME=a-1, PART=a', '1, 0, x'], "line 15: '1, 0, x' is not a position")
      if (.not. allocated(error)) call expect(error, [character(len=width) :: '*PART,NAME=a', '*NODE', cube, brick, '*END PART', &
         '*INSTANCE, NAME=a-1, PART=c'], "no part 'c'")
   end subroutine test_parts

   subroutine test_other_elements(error)
      type(testing_error), allocatable, intent(out) :: error
      type(fe_model_t) :: model
      type(warning_list_t) :: warnings
      type(error_t), allocatable :: lib

      call read([character(len=width) :: '*NODE', cube, '9,.5,.5,2', brick, '*ELEMENT,TYPE=C3D6', '2,1,2,3,5,6,7', &
         '*ELEMENT, TYPE=MASS', '3, 9', '4, 8', '*ELEMENT, TYPE=SPRINGA', '5, 8, 9', '*ELEMENT, TYPE=U7', '6, 1, 2,', '3', &
         '7, 2, 3, 4', '*ELEMENT,TYPE=C3D8R', '8,5,6,7,8,1,2,3,4'], model, warnings, lib)
      ! The last element has the corners of the first, but another type.
      call good(error, lib)
      if (allocated(error)) return
      call check(error, size(model%elements), 2)
      if (.not. allocated(error)) call check(error, size(model%other_elements), 4)
      if (allocated(error)) return
      call check(error, model%other_elements(2)%type, 'MASS')
      if (.not. allocated(error)) call check(error, all(model%other_elements(2)%connectivity(1, :) == [9, 8]), 'masses differ')
      if (.not. allocated(error)) call check(error, model%other_elements(4)%type, 'U7')
      if (.not. allocated(error)) call check(error, all(model%other_elements(4)%connectivity == reshape([1, 2, 3, 2, 3, 4], &
         [3, 2])), 'elements of an unknown type differ')
      if (.not. allocated(error)) call expect(error, [character(len=width) :: '*NODE', cube, '*ELEMENT, TYPE=C3D4', '1,1,2,3,5'], &
         'holds no bricks, only 1 C3D4: C3D4 faces at joints are not supported yet')
      if (.not. allocated(error)) call expect(error, [character(len=width) :: '*NODE', cube, brick, '*ELEMENT, TYPE=B31', &
         '2,8,77'], 'element 2 (B31) uses node 77')
   end subroutine test_other_elements

   subroutine test_sets(error)
      type(testing_error), allocatable, intent(out) :: error
      type(fe_model_t) :: model
      type(warning_list_t) :: warnings
      type(error_t), allocatable :: lib

      call read([character(len=width) :: '*NODE', cube, '9,.5,.5,2', brick, '*ELEMENT,TYPE=SPRINGA,ELSET=springs', '7, 8, 9', &
         '*NSET, NSET=held, ELSET=springs', '*NSET, NSET=held', '1', '*ELSET, ELSET=one, GENERATE', '1, 3, 2', &
         '*ELSET, ELSET=both', 'one, springs', '*SURFACE, NAME=lower', 'one, S1', '*SURFACE, NAME=side', '1, S3', &
         '*SURFACE, NAME=points, TYPE=NODE', 'held', '4', '*NSET, NSET=some, GENERATE', '2, 900000002, 100000000'], &
         model, warnings, lib)
      call good(error, lib)
      if (allocated(error)) return
      call expect_set(error, model, 'held', [1, 8, 9])
      if (.not. allocated(error)) call expect_set(error, model, 'springs', [8, 9])
      if (.not. allocated(error)) call expect_set(error, model, 'both', [1, 2, 3, 4, 5, 6, 7, 8, 9])
      if (.not. allocated(error)) call expect_set(error, model, 'lower', [1, 2, 3, 4])
      if (.not. allocated(error)) call expect_set(error, model, 'side', [1, 2, 5, 6])
      if (.not. allocated(error)) call expect_set(error, model, 'points', [1, 4, 8, 9])
      if (.not. allocated(error)) call expect_set(error, model, 'some', [2])
      if (allocated(error)) return
      call check(error, warnings%number(), 1)
      if (.not. allocated(error)) call check(error, index(warnings%text(1), "'some': 9 of the nodes") > 0, warnings%text(1))
   end subroutine test_sets

   subroutine test_faulty_sets(error)
      type(testing_error), allocatable, intent(out) :: error
      type(fe_model_t) :: model
      type(warning_list_t) :: warnings
      type(error_t), allocatable :: lib

      call read([character(len=width) :: '*NODE', cube, brick, '*ELEMENT,TYPE=C3D4,ELSET=tets', '2,1,2,3,5', '*NSET, NSET=good', &
         '1', '*NSET, NSET=a', '5, 77', '*NSET, NSET=b', 'good, c', '*NSET, NSET=d', 'a', '*NSET, NSET=e, ELSET=f', &
         '*SURFACE, NAME=g', 'tets, S1', '*SURFACE, NAME=h', 'all, SPOS', '*NSET, NSET=two', '1', &
         '*PART, NAME=p', '*NSET,NSET=two', '2', '*END PART'], &
         model, warnings, lib)
      call good(error, lib)
      if (.not. allocated(error)) call expect_fault('a', 'it lists node 77, which is not defined')
      if (.not. allocated(error)) call expect_fault('b', "includes 'c', which is not defined")
      if (.not. allocated(error)) call expect_fault('d', "includes 'a'")
      if (.not. allocated(error)) call expect_fault('e', "includes 'f', which is not defined")
      if (.not. allocated(error)) call expect_fault('g', 'faces of C3D4 elements')
      if (.not. allocated(error)) call expect_fault('h', "'all, SPOS' names no face")
      if (.not. allocated(error)) call expect_fault('two', 'its name is used for two sets')

   contains

      subroutine expect_fault(name, needle)
         character(len=*), intent(in) :: name, needle
         integer, allocatable :: nodes(:)
         type(error_t), allocatable :: fault
         integer :: k

         call nodes_of_set(model, name, nodes, fault)
         call check(error, allocated(fault), name//' can be used')
         if (allocated(error)) return
         call check(error, index(fault%message, needle) > 0, name//': '//fault%message)
         if (allocated(error)) return
         call check(error, any([(index(warnings%text(k), "'"//name//"'") > 0, k=1, warnings%number())]), 'no warning of '//name)
      end subroutine expect_fault

   end subroutine test_faulty_sets

   !> The lines of an included file stand in place of its card, wherever they come from.
   subroutine test_include(error)
      type(testing_error), allocatable, intent(out) :: error
      type(fe_model_t) :: model
      type(warning_list_t) :: warnings
      type(error_t), allocatable :: lib
      character(len=*), parameter :: folder = scratch//'.folder'

      call execute_command_line('mkdir -p '//folder)
      call write_file(scratch//'.nodes', cube(2:))
      call write_file(folder//'/more.inp', [character(len=width) :: '*INCLUDE, INPUT=brick.inp', '*NSET,NSET=b', '3'])
      call write_file(folder//'/brick.inp', brick)
      call read([character(len=width) :: '*NODE, NSET=a', cube(1), '*INCLUDE, INPUT=test_io_mesh_decks.nodes', '9,5,5,5', &
         '*INCLUDE, INPUT=test_io_mesh_decks.folder/more.inp'], model, warnings, lib)
      call good(error, lib)
      if (.not. allocated(error)) call expect_set(error, model, 'a', [1, 2, 3, 4, 5, 6, 7, 8, 9])
      if (.not. allocated(error)) call expect_set(error, model, 'b', [3])
      if (.not. allocated(error)) call check(error, warnings%number(), 1)
      if (.not. allocated(error)) call check(error, index(warnings%text(1), 'is read from '//folder//'/brick.inp') > 0, &
         warnings%text(1))
      call read([character(len=width) :: '*NODE, INPUT=test_io_mesh_decks.nodes', cube(1), &
         '*ELEMENT, TYPE=C3D8, INPUT=test_io_mesh_decks.one'], model, warnings, lib)
      if (.not. allocated(error)) call check(error, allocated(lib), 'a missing file is read')
      if (.not. allocated(error)) call check(error, index(lib%message, 'there is no build/test_io_mesh_decks.one') > 0, lib%message)
      call write_file('build/brick.inp', brick)
      if (.not. allocated(error)) call expect(error, [character(len=width) :: '*NODE', cube, &
         '*INCLUDE, INPUT=test_io_mesh_decks.folder/more.inp'], 'remove one of them')
      call remove('build/brick.inp')
      call remove(scratch//'.nodes')
      call execute_command_line('rm -r '//folder)
   end subroutine test_include

   subroutine test_large_labels(error)
      type(testing_error), allocatable, intent(out) :: error
      type(fe_model_t) :: model
      type(warning_list_t) :: warnings
      type(error_t), allocatable :: lib

      call read([character(len=width) :: '*NODE', cube, '2147483647,5,5,5', brick, '*NSET,NSET=all,GENERATE', &
         '1,2147483647', '*NSET,NSET=far', '2147483647', '*ELEMENT,TYPE=MASS', '2147483647, 2147483647'], model, warnings, lib)
      call good(error, lib)
      if (.not. allocated(error)) call expect_set(error, model, 'far', [9])
      if (.not. allocated(error)) call expect_set(error, model, 'all', [1, 2, 3, 4, 5, 6, 7, 8, 9])
      if (.not. allocated(error)) call expect(error, [character(len=width) :: '*NODE', '2147483648,0,0,0'], &
         "the number '2147483648' is larger than 2147483647")
   end subroutine test_large_labels

   subroutine test_twice(error)
      type(testing_error), allocatable, intent(out) :: error
      type(fe_model_t) :: model
      type(warning_list_t) :: warnings
      type(error_t), allocatable :: lib

      call read([character(len=width) :: '*NODE', cube, cube(3), brick, brick(2), '*NSET,NSET=n', '3'], model, warnings, lib)
      call good(error, lib)
      if (.not. allocated(error)) call check(error, model%node_count(), 8)
      if (.not. allocated(error)) call check(error, size(model%elements(1)%connectivity, 2), 1)
      if (.not. allocated(error)) call expect_set(error, model, 'n', [3])
      if (.not. allocated(error)) call check(error, warnings%number(), 1)
      if (.not. allocated(error)) call expect(error, [character(len=width) :: '*NODE', cube, '3,1,1,.5', brick], &
         'node 3 is defined twice, at (1, 1, 0) and at (1, 1, 0.5)')
      if (.not. allocated(error)) call expect(error, [character(len=width) :: '*NODE', cube, brick, '1,8,7,6,5,4,3,2,1'], &
         'element 1 is defined twice, with different nodes')
      if (.not. allocated(error)) call expect(error, [character(len=width) :: '*NODE', cube, brick, '2,2,3,4,1,6,7,8,5'], &
         'the elements 1 and 2 have the same corner nodes')
   end subroutine test_twice

   subroutine test_refused_cards(error)
      type(testing_error), allocatable, intent(out) :: error
      character(len=width), parameter :: cards(8) = [character(len=width) :: '*NCOPY, CHANGE NUMBER=8, OLD SET=a, SHIFT', &
         '*NFILL', '*NGEN, NSET=a', '*NMAP, NSET=a', '*ELGEN', '*ELCOPY', '*NODE, SYSTEM=C', '*NODES']
      integer :: k

      do k = 1, size(cards)
         if (.not. allocated(error)) call expect(error, [character(len=width) :: '*NODE', cube, brick, cards(k), '1,2,3,4'], &
            "line 12: '"//trim(cards(k))//"' is not read")
      end do
      if (.not. allocated(error)) call expect(error, [character(len=width) :: '*SYSTEM', '1,0,0,0,1,0', '*NODE', cube, brick], &
         "line 3: '*NODE' is not read: its coordinates are not along the global x, y, z axes")
      if (.not. allocated(error)) call expect(error, [character(len=width) :: '*NODE', cube, brick, '*NSET,NSET=a,GENERATE', &
         '1, 8, 3'], 'no number of steps of 3 leads from 1 to 8')
   end subroutine test_refused_cards

   subroutine test_numbers(error)
      type(testing_error), allocatable, intent(out) :: error

      call expect_node('1, 1.0+3, 0, 0', "its exponent needs a letter ('1.0E+3')")
      if (.not. allocated(error)) call expect_node('1, 0, nan, 0', "'nan' is not a finite number")
      if (.not. allocated(error)) call expect_node('1, 0, 0, 1e999', "'1e999' is not a finite number")
      if (.not. allocated(error)) call expect_node('1, 0, 0, 0, 0', 'it has 5 fields')
      if (.not. allocated(error)) call expect_node('1; 0; 0; 0', 'its fields must be separated by commas')
      if (.not. allocated(error)) call expect_node('1 0 0 0', 'separated by commas')
      if (.not. allocated(error)) call expect_node('1, 0 1, 0, 0', "'0 1' is not a finite number")
      if (.not. allocated(error)) call expect_node('-1, 0, 0, 0', "'-1' is not a number from 1")
      if (.not. allocated(error)) call expect(error, [character(len=width) :: '*NODE', '1,0,0', '2,1,0', '3,1,1', '4,0,1', &
         '5,0,0', '6,1,0', '7,1,1', '8,0,1', brick], 'every node has 2 coordinates only')

   contains

      subroutine expect_node(line, needle)
         character(len=*), intent(in) :: line, needle
         call expect(error, [character(len=width) :: '*NODE', line], needle)
      end subroutine expect_node

   end subroutine test_numbers

   subroutine test_formats(error)
      type(testing_error), allocatable, intent(out) :: error

      call expect(error, [character(len=width) :: 'SOL 101', 'CEND', 'BEGIN BULK', 'GRID,1,,0.,0.,0.'], 'looks like a Nastran deck')
      if (.not. allocated(error)) call expect(error, [character(len=width) :: '# vtk DataFile Version 3.0'], 'a VTK file')
      if (.not. allocated(error)) call expect(error, [character(len=width) :: 'ISO-10303-21;', 'HEADER;'], 'a STEP geometry')
      if (.not. allocated(error)) call expect(error, [character(len=width) :: '    -1', '  2411'], 'I-DEAS universal')
      if (.not. allocated(error)) call expect(error, [character(len=width) :: 'PK'//achar(3)//achar(4)//'...'], 'a zip archive')
      if (.not. allocated(error)) call expect(error, [character(len=width) :: '*KEYWORD', '*NODE', '1 0 0 0'], 'LS-DYNA')
      if (.not. allocated(error)) call expect(error, [character(len=width) :: '*NODE', '1,0,0,0', '*ELEMENT_SOLID'], 'LS-DYNA')
      if (.not. allocated(error)) call expect(error, [character(len=width) :: "&case title='x' /", '&model /'], 'a case file')
      if (.not. allocated(error)) call expect(error, [character(len=width) :: char(255)//char(254)//'*'//achar(0)], 'UTF-16')
      if (.not. allocated(error)) call expect(error, [character(len=width) :: 'a note', 'and another'], 'format not known, there')
   end subroutine test_formats

   subroutine expect(error, lines, needle)
      type(testing_error), allocatable, intent(out) :: error
      character(len=*), intent(in) :: lines(:), needle
      type(fe_model_t) :: model
      type(warning_list_t) :: warnings
      type(error_t), allocatable :: lib

      call read(lines, model, warnings, lib)
      if (.not. allocated(lib)) then
         call test_failed(error, 'no error reported, expected one about '//needle)
      else if (index(lib%message, needle) == 0) then
         call test_failed(error, 'message does not name '//needle//': '//lib%message)
      end if
   end subroutine expect

   subroutine read(lines, model, warnings, lib)
      character(len=*), intent(in) :: lines(:)
      type(fe_model_t), intent(out) :: model
      type(warning_list_t), intent(out) :: warnings
      type(error_t), allocatable, intent(out) :: lib

      call write_file(inp, lines)
      call read_mesh(inp, model, warnings, lib)
      call remove(inp)
   end subroutine read

   subroutine expect_set(error, model, name, nodes)
      type(testing_error), allocatable, intent(out) :: error
      type(fe_model_t), intent(in) :: model
      character(len=*), intent(in) :: name
      integer, intent(in) :: nodes(:)
      integer :: k

      k = model%find_node_set(name)
      call check(error, k > 0, 'no set '//name)
      if (allocated(error)) return
      call check(error, size(model%node_sets(k)%nodes), size(nodes))
      if (allocated(error)) return
      call check(error, all(model%node_sets(k)%nodes == nodes), 'set differs: '//name)
   end subroutine expect_set

   subroutine write_file(path, lines)
      character(len=*), intent(in) :: path, lines(:)
      integer :: unit, i
      open (newunit=unit, file=path, status='replace')
      write (unit, '(a)') (trim(lines(i)), i=1, size(lines))
      close (unit)
   end subroutine write_file

end module test_io_mesh_decks
