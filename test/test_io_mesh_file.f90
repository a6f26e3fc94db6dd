!> Tests of the mesh readers on files written here.
module test_io_mesh_file
   use microslip_core_error, only: error_t
   use microslip_core_kinds, only: wp
   use microslip_core_text, only: to_text
   use microslip_core_warning_list, only: warning_list_t
   use microslip_fe_model, only: fe_model_t
   use microslip_io_mesh_file, only: read_mesh
   use support_checks, only: good, remove
   use testdrive, only: check, new_unittest, test_failed, testing_error => error_type, unittest_type
   implicit none(type, external)
   private

   public :: collect_io_mesh_file

   character(len=*), parameter :: scratch = 'build/test_io_mesh_file', inp = scratch//'.inp', msh = scratch//'.msh'
   integer, parameter :: width = 80
   !> Unit cube: corners in Abaqus order, then the corner pairs whose middles are nodes 9 to 20 of a C3D20.
   integer, parameter :: corner(3, 8) = reshape([0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0, &
      0, 0, 1, 1, 0, 1, 1, 1, 1, 0, 1, 1], [3, 8])
   integer, parameter :: edge(2, 12) = reshape([1, 2, 2, 3, 3, 4, 4, 1, 5, 6, 6, 7, 7, 8, 8, 5, 1, 5, 2, 6, 3, 7, 4, 8], [2, 12])
   !> Nodes of the cube with labels 10, 20, ... 80 in descending order.
   character(len=width), parameter :: cube(8) = [character(len=width) :: ' 80, 0., 1., 1.', '70, 1, 1, 1', &
      '60,1.0d0, 0,1.', '50, 0, 0, 1.E0', '40,0,1,0', '30,1,1', '20, 1., 0, 0', '10']

contains

   subroutine collect_io_mesh_file(testsuite)
      type(unittest_type), allocatable, intent(out) :: testsuite(:)

      testsuite = [ &
         new_unittest('Abaqus: nodes, elements, sets', test_abaqus), &
         new_unittest('Abaqus: 20 nodes over two lines, include', test_abaqus_20), &
         new_unittest('gmsh 4.1', test_gmsh_4), &
         new_unittest('gmsh 2.2: 20-node order', test_gmsh_2), &
         new_unittest('wrong files are named', test_wrong)]
   end subroutine collect_io_mesh_file

   subroutine test_abaqus(error)
      type(testing_error), allocatable, intent(out) :: error
      type(fe_model_t) :: model
      type(warning_list_t) :: warnings
      type(error_t), allocatable :: lib

      call write_file(inp, [character(len=width) :: '*Heading', ' * not a card', '** comment', '*node, NSET="all nodes"', &
         cube, '*NODE FILE', 'U', '*element, elset=e,', ' type=c3d8i', '7, 10,20,30,40, 50,60,70,80', '', '*NSET,NSET=odd', &
         '10, 30,', '** comment', '50', '*nset, nset=Even, GENERATE', '20,80,20', '*NSET,NSET=BOTH', 'ODD, 20', 'even,', &
         '*NSET,NSET=odd', '70', '*STEP', '*CLOAD', 'ODD,3,1.', '*END STEP'])
      call read_mesh(inp, model, warnings, lib)
      call good(error, lib)
      if (allocated(error)) return
      call check(error, all(model%node_label == [10, 20, 30, 40, 50, 60, 70, 80]), 'labels differ')
      if (allocated(error)) return
      call check(error, all(model%coordinates == real(corner, wp)), 'coordinates differ')
      if (allocated(error)) return
      call check(error, size(model%elements) == 1 .and. model%elements(1)%type == 'C3D8I', 'element type differs')
      if (allocated(error)) return
      call check(error, all(model%elements(1)%connectivity(:, 1) == [1, 2, 3, 4, 5, 6, 7, 8]), 'elements differ')
      if (allocated(error)) return
      call expect_set(error, model, 'all nodes', [1, 2, 3, 4, 5, 6, 7, 8])
      if (.not. allocated(error)) call expect_set(error, model, 'odd', [1, 3, 5, 7])
      if (.not. allocated(error)) call expect_set(error, model, 'even', [2, 4, 6, 8])
      if (.not. allocated(error)) call expect_set(error, model, 'both', [1, 2, 3, 4, 5, 6, 7, 8])
      call remove(inp)
   end subroutine test_abaqus

   subroutine test_abaqus_20(error)
      type(testing_error), allocatable, intent(out) :: error
      type(fe_model_t) :: model
      type(warning_list_t) :: warnings
      type(error_t), allocatable :: lib
      character(len=width) :: nodes(20)
      integer :: k

      do k = 1, 20
         write (nodes(k), '(i0,3(",",es20.13))') k, position_of(k)
      end do
      call write_file(scratch//'_nodes.inc', [character(len=width) :: '*NODE', nodes])
      call write_file(inp, [character(len=width) :: '*INCLUDE, INPUT=test_io_mesh_file_nodes.inc', &
         '*ELEMENT, TYPE=C3D20R', '1,1,2,3,4,5,6,7,8,9,10,11,12,13,14,15,', '16,17,18,19,20'])
      call read_mesh(inp, model, warnings, lib)
      call good(error, lib)
      if (allocated(error)) return
      call check_middles(error, model, 'C3D20R')
      call remove(inp)
      call remove(scratch//'_nodes.inc')
   end subroutine test_abaqus_20

   !> Position of node k of a C3D20 in the unit cube.
   pure function position_of(k) result(x)
      integer, intent(in) :: k
      real(wp) :: x(3)
      if (k <= 8) then
         x = corner(:, k)
      else
         x = 0.5_wp*(corner(:, edge(1, k - 8)) + corner(:, edge(2, k - 8)))
      end if
   end function position_of

   !> The only element is the unit cube with its mid-side nodes in Abaqus order.
   subroutine check_middles(error, model, type)
      type(testing_error), allocatable, intent(out) :: error
      type(fe_model_t), intent(in) :: model
      character(len=*), intent(in) :: type
      integer :: k
      call check(error, model%elements(1)%type, type)
      do k = 1, 20
         if (allocated(error)) return
         call check(error, all(model%coordinates(:, model%elements(1)%connectivity(k, 1)) == position_of(k)), &
            'node '//to_text(k)//' is elsewhere')
      end do
   end subroutine check_middles

   subroutine test_gmsh_4(error)
      type(testing_error), allocatable, intent(out) :: error
      type(fe_model_t) :: model
      type(warning_list_t) :: warnings
      type(error_t), allocatable :: lib

      call write_file(msh, [character(len=width) :: '$MeshFormat', '4.1 0 8', '$EndMeshFormat', &
         '$PhysicalNames', '2', '2 2 "pad left"', '3 1 "body"', '$EndPhysicalNames', &
         '$Entities', '1 0 1 1', '1 0 0 0 1 9', '5 -1e-7 0 0 1 1 1 1 2 2 3 -4', '1 0 0 0 1 1 1 1 1 1 5', '$EndEntities', &
         '$Nodes', '2 8 1 8', '2 5 0 4', '1', '4', '5', '8', '0 0 0', '0 1 0', '0 0 1', '0 1 1', &
         '3 1 0 4', '2', '3', '6', '7', '1 0 0', '1 1 0', '1 0 1', '1 1 1', '$EndNodes', &
         '$Elements', '3 3 1 3', '0 1 15 1', '1 1', '2 5 3 1', '2 1 5 8 4', '3 1 5 1', '3 1 2 3 4 5 6 7 8', '$EndElements'])
      call read_mesh(msh, model, warnings, lib)
      call good(error, lib)
      if (allocated(error)) return
      call check(error, all(model%coordinates == real(corner, wp)), 'coordinates differ')
      if (allocated(error)) return
      call check(error, model%elements(1)%type == 'C3D8', 'element type differs')
      if (allocated(error)) return
      call expect_set(error, model, 'pad left', [1, 4, 5, 8])
      if (.not. allocated(error)) call expect_set(error, model, 'body', [1, 2, 3, 4, 5, 6, 7, 8])
      if (.not. allocated(error)) call expect_set(error, model, 'physical_0_9', [1])
      call remove(msh)
   end subroutine test_gmsh_4

   !> The order that gmsh itself wrote for a box of 2 x 1 x 1.
   subroutine test_gmsh_2(error)
      type(testing_error), allocatable, intent(out) :: error
      type(fe_model_t) :: model
      type(warning_list_t) :: warnings
      type(error_t), allocatable :: lib
      character(len=width) :: nodes(20)
      !> gmsh's edges of a brick
      integer, parameter :: gmsh_edge(2, 12) = reshape([1, 2, 1, 4, 1, 5, 2, 3, 2, 6, 3, 4, 3, 7, 4, 8, 5, 6, 5, 8, 6, 7, 7, 8], &
         [2, 12])
      integer :: k

      do k = 1, 8
         write (nodes(k), '(i0,3(1x,i0))') k, corner(:, k)
      end do
      do k = 1, 12
         write (nodes(8 + k), '(i0,3(1x,f3.1))') 8 + k, 0.5_wp*(corner(:, gmsh_edge(1, k)) + corner(:, gmsh_edge(2, k)))
      end do
      call write_file(msh, [character(len=width) :: '$MeshFormat', '2.2 0 8', '$EndMeshFormat', '$Nodes', '20', nodes, &
         '$EndNodes', '$Elements', '2', '1 16 2 4 1 1 5 8 4 11 18 16 10', &
         '2 17 2 1 1 1 2 3 4 5 6 7 8 9 10 11 12 13 14 15 16 17 18 19 20', '$EndElements'])
      call read_mesh(msh, model, warnings, lib)
      call good(error, lib)
      if (allocated(error)) return
      call check_middles(error, model, 'C3D20')
      if (.not. allocated(error)) call expect_set(error, model, 'physical_2_4', [1, 4, 5, 8, 10, 11, 16, 18])
      call remove(msh)
   end subroutine test_gmsh_2

   subroutine test_wrong(error)
      type(testing_error), allocatable, intent(out) :: error
      character(len=width), parameter :: brick(2) = [character(len=width) :: '*ELEMENT, TYPE=C3D8', '1,10,20,30,40,50,60,70,80']

      call expect_inp([character(len=width) :: '1, 2, x'], "line 2: '1, 2, x' is not a node (label, x, y, z): 'x' is not")
      if (.not. allocated(error)) call expect_inp(cube, 'no elements')
      if (.not. allocated(error)) call expect_inp(brick, 'no nodes')
      if (.not. allocated(error)) call expect_inp([character(len=width) :: cube, '10, 1', brick], 'node 10 is defined twice')
      if (.not. allocated(error)) call expect_inp([character(len=width) :: cube(:7), brick], 'element 1 (C3D8) uses node 10')
      if (.not. allocated(error)) call expect_inp([character(len=width) :: cube, brick(1), '1,10,20'], 'element 1 has 2 nodes')
      if (.not. allocated(error)) call expect_inp([character(len=width) :: cube, brick, '*NSET,NSET=a,GENERATE', '5'], 'line 13')
      if (.not. allocated(error)) call expect_inp([character(len=width) :: '*INCLUDE, INPUT=no_such_file'], 'no_such_file')
      if (.not. allocated(error)) call expect_inp([character(len=width) :: '*INCLUDE, INPUT=test_io_mesh_file.inp'], 'too many')
      if (.not. allocated(error)) call expect_msh([character(len=width) :: '$MeshFormat', '4.1 1 8'], 'binary')
      if (.not. allocated(error)) call expect_msh([character(len=width) :: '$MeshFormat', '3.0 0 8'], '3.0')
      if (.not. allocated(error)) call expect_msh([character(len=width) :: '$MeshFormat', '2.2 0 8', '$Nodes', '5'], &
         'ends too early')
      if (.not. allocated(error)) call expect_msh([character(len=width) :: '$MeshFormat', '2.2 0 8', '$Elements', '1', &
         '1 12 0 1 2 3 4'], '27-node brick')

   contains

      subroutine expect_inp(lines, needle)
         character(len=*), intent(in) :: lines(:), needle
         character(len=width) :: padded(size(lines) + 1)
         padded(1) = '*NODE'
         padded(2:) = lines
         call expect(inp, padded, needle)
      end subroutine expect_inp

      subroutine expect_msh(lines, needle)
         character(len=*), intent(in) :: lines(:), needle
         call expect(msh, lines, needle)
      end subroutine expect_msh

      subroutine expect(path, lines, needle)
         character(len=*), intent(in) :: path, lines(:), needle
         type(fe_model_t) :: model
         type(warning_list_t) :: warnings
         type(error_t), allocatable :: lib
         call write_file(path, lines)
         call read_mesh(path, model, warnings, lib)
         call remove(path)
         if (.not. allocated(lib)) then
            call test_failed(error, 'no error reported, expected one about '//needle)
         else if (index(lib%message, needle) == 0) then
            call test_failed(error, 'message does not name '//needle//': '//lib%message)
         end if
      end subroutine expect

   end subroutine test_wrong

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

end module test_io_mesh_file
