!> Small FE models for tests: rectangular blocks of 8-node bricks (full integration, consistent mass), stacked
!> or side by side, with node sets, supports and matching interfaces. Steel unless told otherwise; SI units.
!>
!> A block called `name` brings the node sets `name`, `name_xmin`, `name_xmax`, `name_ymin`, ... `name_zmax`.
module support_brick
   use microslip_core_kinds, only: wp
   use microslip_fe_interface, only: contact_interface_t
   use microslip_fe_model, only: element_block_t, fe_model_t, node_set_t
   use microslip_linalg_sparse, only: from_triplets
   implicit none(type, external)
   private

   public :: block_t, block_model, facing_interface, two_blocks, to_dense

   !> A rectangular block and its mesh.
   type :: block_t
      character(len=:), allocatable :: name
      !> Corner with the smallest coordinates and edge lengths, m
      real(wp) :: origin(3) = 0.0_wp, extent(3) = 1.0_wp
      !> Number of elements along x, y, z
      integer :: cells(3) = 1
      !> Young's modulus, Pa; Poisson's ratio; density, kg/m^3
      real(wp) :: youngs_modulus = 2.0e11_wp, poisson_ratio = 0.3_wp, density = 7800.0_wp
   end type block_t

   !> Corner c of a brick lies at local coordinates corner(:, c) (Abaqus/CalculiX order).
   integer, parameter :: corner(3, 8) = reshape( &
                         [-1, -1, -1, 1, -1, -1, 1, 1, -1, -1, 1, -1, -1, -1, 1, 1, -1, 1, 1, 1, 1, -1, 1, 1], [3, 8])

contains

   !> Two blocks of steel, `upper` of 60 x 40 x 30 mm on `lower` of 60 x 40 x 20 mm (unequal, as a symmetric pair
   !> would couple nothing), with a contact at z = 0, both held at their end x = 0.
   subroutine two_blocks(model, interfaces, cells)
      type(fe_model_t), intent(out) :: model
      !> One interface, side A = upper, n = +z, t1 = x, t2 = y; the supported end is no part of it
      type(contact_interface_t), allocatable, intent(out) :: interfaces(:)
      !> Elements of each block along x, y, z
      integer, intent(in) :: cells(3)

      call block_model([block_t('lower', [0.0_wp, 0.0_wp, -0.02_wp], [0.06_wp, 0.04_wp, 0.02_wp], cells), &
                        block_t('upper', [0.0_wp, 0.0_wp, 0.0_wp], [0.06_wp, 0.04_wp, 0.03_wp], cells)], &
                       ['lower_xmin', 'upper_xmin'], model)
      interfaces = [facing_interface(model, 'upper_zmin', 'lower_zmax', 'joint')]
   end subroutine two_blocks

   !> Mesh and matrices of some blocks that are not joined; all nodes of the named sets are fixed.
   subroutine block_model(blocks, supports, model)
      type(block_t), intent(in) :: blocks(:)
      !> Names of node sets whose nodes are fixed in x, y and z; may have size 0
      character(len=*), intent(in) :: supports(:)
      type(fe_model_t), intent(out) :: model
      integer :: k, nodes, sets

      nodes = sum([(product(blocks(k)%cells + 1), k=1, size(blocks))])
      allocate (model%coordinates(3, nodes), model%elements(size(blocks)), model%node_sets(7*size(blocks)))
      model%node_label = [(10*k, k=1, nodes)]
      nodes = 0
      sets = 0
      do k = 1, size(blocks)
         call add_mesh(blocks(k), model, k, nodes, sets)
      end do
      call number_rows(model, supports)
      call assemble(model, blocks)
   end subroutine block_model

   !> Nodes, elements and node sets of one block.
   subroutine add_mesh(block, model, which, nodes, sets)
      type(block_t), intent(in) :: block
      type(fe_model_t), intent(inout) :: model
      !> Index of the block
      integer, intent(in) :: which
      !> Nodes and sets made so far
      integer, intent(inout) :: nodes, sets
      character(len=*), parameter :: axis = 'xyz'
      integer :: i, j, k, c, first, element, place(3), d
      integer, allocatable :: all_nodes(:), index(:, :)

      first = nodes
      allocate (index(3, product(block%cells + 1)))
      do k = 0, block%cells(3)
         do j = 0, block%cells(2)
            do i = 0, block%cells(1)
               nodes = nodes + 1
               index(:, nodes - first) = [i, j, k]
               model%coordinates(:, nodes) = block%origin + block%extent*real([i, j, k], wp)/real(block%cells, wp)
            end do
         end do
      end do

      model%elements(which)%type = 'C3D8'
      allocate (model%elements(which)%connectivity(8, product(block%cells)))
      element = 0
      do k = 1, block%cells(3)
         do j = 1, block%cells(2)
            do i = 1, block%cells(1)
               element = element + 1
               do c = 1, 8
                  place = [i, j, k] + (corner(:, c) - 1)/2
                  model%elements(which)%connectivity(c, element) = &
                     first + 1 + place(1) + (block%cells(1) + 1)*(place(2) + (block%cells(2) + 1)*place(3))
               end do
            end do
         end do
      end do

      all_nodes = [(k, k=first + 1, nodes)]
      ! Not by the structure constructor: gfortran 12 loses the length of the name
      model%node_sets(sets + 1)%name = block%name
      model%node_sets(sets + 1)%nodes = all_nodes
      do d = 1, 3
         model%node_sets(sets + 2*d) = node_set_t(block%name//'_'//axis(d:d)//'min', pack(all_nodes, index(d, :) == 0))
         model%node_sets(sets + 2*d + 1) = &
            node_set_t(block%name//'_'//axis(d:d)//'max', pack(all_nodes, index(d, :) == block%cells(d)))
      end do
      sets = sets + 7
   end subroutine add_mesh

   !> A row for every component of every node that is not fixed.
   subroutine number_rows(model, supports)
      type(fe_model_t), intent(inout) :: model
      character(len=*), intent(in) :: supports(:)
      logical, allocatable :: fixed(:)
      integer, allocatable :: free(:)
      integer :: k, c

      allocate (fixed(model%node_count()), source=.false.)
      do k = 1, size(supports)
         fixed(model%node_sets(model%find_node_set(trim(supports(k))))%nodes) = .true.
      end do
      free = pack([(k, k=1, model%node_count())],.not. fixed)
      model%row_node = [((free(k), c=1, 3), k=1, size(free))]
      model%row_component = [((c, c=1, 3), k=1, size(free))]
   end subroutine number_rows

   !> Stiffness and mass of all elements (all bricks of a block are alike).
   subroutine assemble(model, blocks)
      type(fe_model_t), intent(inout) :: model
      type(block_t), intent(in) :: blocks(:)
      real(wp) :: stiffness(24, 24), mass(24, 24)
      real(wp), allocatable :: k_value(:), m_value(:)
      integer, allocatable :: rows(:, :), row(:), column(:)
      integer :: b, e, i, j, m, element_rows(24), room

      rows = model%rows_of_nodes()
      room = 300*sum([(size(model%elements(b)%connectivity, 2), b=1, size(blocks))])
      allocate (row(room), column(room), k_value(room), m_value(room))
      m = 0
      do b = 1, size(blocks)
         call brick_matrices(blocks(b), stiffness, mass)
         do e = 1, size(model%elements(b)%connectivity, 2)
            element_rows = reshape(rows(:, model%elements(b)%connectivity(:, e)), [24])
            do j = 1, 24
               do i = 1, j
                  if (element_rows(i) == 0 .or. element_rows(j) == 0) cycle
                  m = m + 1
                  row(m) = element_rows(i)
                  column(m) = element_rows(j)
                  k_value(m) = stiffness(i, j)
                  m_value(m) = mass(i, j)
               end do
            end do
         end do
      end do
      model%stiffness = from_triplets(model%row_count(), row(:m), column(:m), k_value(:m))
      model%mass = from_triplets(model%row_count(), row(:m), column(:m), m_value(:m))
   end subroutine assemble

   !> Trilinear brick with 2 x 2 x 2 Gauss points.
   pure subroutine brick_matrices(block, stiffness, mass)
      type(block_t), intent(in) :: block
      real(wp), intent(out) :: stiffness(24, 24), mass(24, 24)
      real(wp) :: edge(3), lame, shear, volume, shape(8), gradient(3, 8), strain(6, 24), law(6, 6), at(3)
      integer :: g, c, d, j

      edge = block%extent/real(block%cells, wp)
      volume = product(edge)/8.0_wp
      shear = block%youngs_modulus/(2.0_wp*(1.0_wp + block%poisson_ratio))
      lame = 2.0_wp*shear*block%poisson_ratio/(1.0_wp - 2.0_wp*block%poisson_ratio)
      law = 0.0_wp
      law(:3, :3) = lame
      do d = 1, 3
         law(d, d) = lame + 2.0_wp*shear
         law(d + 3, d + 3) = shear
      end do

      stiffness = 0.0_wp
      mass = 0.0_wp
      do g = 1, 8
         at = real(corner(:, g), wp)/sqrt(3.0_wp)
         do c = 1, 8
            shape(c) = product(1.0_wp + at*corner(:, c))/8.0_wp
            do d = 1, 3
               gradient(d, c) = shape(c)/(1.0_wp + at(d)*corner(d, c))*corner(d, c)*2.0_wp/edge(d)
            end do
         end do
         strain = 0.0_wp
         do c = 1, 8
            do d = 1, 3
               strain(d, 3*c - 3 + d) = gradient(d, c)
            end do
            strain(4, [3*c - 2, 3*c - 1]) = gradient([2, 1], c)
            strain(5, [3*c - 1, 3*c]) = gradient([3, 2], c)
            strain(6, [3*c - 2, 3*c]) = gradient([3, 1], c)
         end do
         stiffness = stiffness + volume*matmul(transpose(strain), matmul(law, strain))
         do c = 1, 8
            do j = 1, 8
               do d = 1, 3
                  mass(3*c - 3 + d, 3*j - 3 + d) = mass(3*c - 3 + d, 3*j - 3 + d) &
                                                   + volume*block%density*shape(c)*shape(j)
               end do
            end do
         end do
      end do
   end subroutine brick_matrices

   !> Interface between two horizontal faces (n = +z, t1 = x, t2 = y) whose nodes match; fixed nodes are left out.
   function facing_interface(model, set_a, set_b, name) result(joint)
      type(fe_model_t), intent(in) :: model
      !> Node sets of the upper side A and of the lower side B; set_b = '' for rigid ground
      character(len=*), intent(in) :: set_a, set_b
      character(len=*), intent(in) :: name
      type(contact_interface_t) :: joint
      integer, allocatable :: rows(:, :), candidates(:), pair_of(:)
      integer :: b, e, k, quad(4)

      rows = model%rows_of_nodes()
      joint%name = name
      joint%frame = reshape([0.0_wp, 0.0_wp, 1.0_wp, 1.0_wp, 0.0_wp, 0.0_wp, 0.0_wp, 1.0_wp, 0.0_wp], [3, 3])
      candidates = model%node_sets(model%find_node_set(set_a))%nodes
      joint%node_a = pack(candidates, all(rows(:, candidates) > 0, dim=1))
      joint%node_b = [(0, k=1, size(joint%node_a))]
      if (set_b /= '') then
         candidates = model%node_sets(model%find_node_set(set_b))%nodes
         do k = 1, size(joint%node_a)
            joint%node_b(k) = candidates(minloc(distance(model%coordinates(:, candidates), &
                                                         model%coordinates(:, joint%node_a(k))), dim=1))
         end do
      end if
      joint%origin = model%coordinates(:, joint%node_a(1))
      joint%position = matmul(transpose(joint%frame(:, 2:)), model%coordinates(:, joint%node_a) &
                              - spread(joint%origin, 2, size(joint%node_a)))

      allocate (pair_of(model%node_count()), source=0)
      pair_of(joint%node_a) = [(k, k=1, size(joint%node_a))]
      allocate (joint%faces(8, 0))
      do b = 1, size(model%elements)
         do e = 1, size(model%elements(b)%connectivity, 2)
            ! The lower face of a brick, counter-clockwise seen from above
            quad = pair_of(model%elements(b)%connectivity([1, 2, 3, 4], e))
            if (any(quad == 0)) cycle
            joint%faces = reshape([joint%faces, [quad, 0, 0, 0, 0]], [8, size(joint%faces, 2) + 1])
         end do
      end do
   end function facing_interface

   !> Distances of some points from a place.
   pure function distance(points, place)
      real(wp), intent(in) :: points(:, :), place(3)
      real(wp) :: distance(size(points, 2))
      integer :: k
      do k = 1, size(points, 2)
         distance(k) = norm2(points(:, k) - place)
      end do
   end function distance

   !> A sparse symmetric matrix written out in full.
   pure function to_dense(matrix) result(full)
      use microslip_linalg_sparse, only: symmetric_sparse_t
      type(symmetric_sparse_t), intent(in) :: matrix
      real(wp), allocatable :: full(:, :)
      integer :: i, k

      allocate (full(matrix%n, matrix%n), source=0.0_wp)
      do i = 1, matrix%n
         do k = matrix%row_start(i), matrix%row_start(i + 1) - 1
            full(i, matrix%column(k)) = matrix%value(k)
            full(matrix%column(k), i) = matrix%value(k)
         end do
      end do
   end function to_dense

end module support_brick
