!> A small mesh for tests: two stacked blocks that touch in z = 0 with matching nodes. No matrices.
!>
!> Block A (top) is 0 < z < 0.01 m, block B is its mirror image; 0.05 x 0.03 m in the plane. Node sets:
!> 'top_pad', 'bottom_pad' (z = 0), 'top_end', 'bottom_end' (far ends), 'empty'. The far end of B is
!> supported. Nodes come in a shuffled order, labels are 10, 17, 24, ...
module support_mesh
   use microslip_core_kinds, only: wp, pi
   use microslip_fe_model, only: fe_model_t
   implicit none(type, external)
   private

   public :: two_blocks, pseudo_random, pad_size, block_height, turn

   real(wp), parameter :: pad_size(2) = [0.05_wp, 0.03_wp]
   real(wp), parameter :: block_height = 0.01_wp

   !> Positions of the 20 nodes of a brick on a lattice of half cells.
   integer, parameter :: brick(3, 20) = reshape([ &
      0, 0, 0, 2, 0, 0, 2, 2, 0, 0, 2, 0, 0, 0, 2, 2, 0, 2, 2, 2, 2, 0, 2, 2, &
      1, 0, 0, 2, 1, 0, 1, 2, 0, 0, 1, 0, 1, 0, 2, 2, 1, 2, 1, 2, 2, 0, 1, 2, &
      0, 0, 1, 2, 0, 1, 2, 2, 1, 0, 2, 1], [3, 20])

contains

   !> Mesh of the two blocks.
   function two_blocks(type, cells, hole, distortion, rotation) result(model)
      !> Element type
      character(len=*), intent(in) :: type
      !> Cells of one block along x, y, z
      integer, intent(in) :: cells(3)
      !> Leave out the column of cells in the middle (a square bore)
      logical, intent(in), optional :: hole
      !> Random in-plane shift of inner nodes as a part of the cell, the same on both sides
      real(wp), intent(in), optional :: distortion
      !> Rotation of the whole model
      real(wp), intent(in), optional :: rotation(3, 3)
      type(fe_model_t) :: model
      integer, allocatable :: number(:, :, :, :), order(:), connectivity(:, :)
      real(wp), allocatable :: x(:, :)
      integer :: side, i, j, k, n, m, at(3), nodes

      nodes = merge(20, 8, type(:4) == 'C3D2')
      allocate (number(0:2*cells(1), 0:2*cells(2), 0:2*cells(3), 2), source=0)
      allocate (connectivity(nodes, 2*product(cells)), x(3, 2*product(2*cells + 1)))
      n = 0
      m = 0
      do side = 1, 2
         do k = 0, cells(3) - 1
            do j = 0, cells(2) - 1
               do i = 0, cells(1) - 1
                  if (present(hole)) then
                     if (hole .and. i == cells(1)/2 .and. j == cells(2)/2) cycle
                  end if
                  m = m + 1
                  call add_brick(2*[i, j, k])
               end do
            end do
         end do
      end do

      order = shuffled(n)
      allocate (model%coordinates(3, n))
      model%coordinates(:, order) = x(:, :n)
      model%node_label = [(3 + 7*k, k=1, n)]
      allocate (model%elements(1))
      model%elements(1)%type = type
      model%elements(1)%connectivity = reshape(order(reshape(connectivity(:, :m), [nodes*m])), [nodes, m])
      call add_sets_and_rows()
      if (present(rotation)) model%coordinates = matmul(rotation, model%coordinates)

   contains

      !> Number the nodes of the brick that has none yet and list them.
      subroutine add_brick(corner)
         integer, intent(in) :: corner(3)
         integer :: v

         do v = 1, nodes
            at = corner + brick(:, v)
            if (side == 2) at(3) = corner(3) + 2 - brick(3, v)
            if (number(at(1), at(2), at(3), side) == 0) then
               n = n + 1
               number(at(1), at(2), at(3), side) = n
               x(:, n) = place_of(at)
            end if
            connectivity(v, m) = number(at(1), at(2), at(3), side)
         end do
      end subroutine add_brick

      !> Position of a lattice point; mid-side nodes lie halfway between the corners.
      function place_of(at) result(place)
         integer, intent(in) :: at(3)
         real(wp) :: place(3)
         place(:2) = 0.5_wp*(corner_at(at(:2)/2) + corner_at((at(:2) + 1)/2))
         place(3) = block_height*at(3)/(2*cells(3))*merge(1, -1, side == 1)
      end function place_of

      function corner_at(c) result(place)
         integer, intent(in) :: c(2)
         real(wp) :: place(2)
         integer :: a

         place = c
         if (present(distortion)) then
            do a = 1, 2
               if (c(a) > 0 .and. c(a) < cells(a)) &
                  place(a) = place(a) + distortion*(2*pseudo_random(c(1) + 97*c(2) + 1009*a) - 1)
            end do
         end if
         place = place*pad_size/cells(:2)
      end function corner_at

      subroutine add_sets_and_rows()
         integer :: v, c
         logical :: free(n)

         allocate (model%node_sets(5))
         model%node_sets(1)%name = 'top_pad'
         model%node_sets(1)%nodes = in_order(number(:, :, 0, 1))
         model%node_sets(2)%name = 'bottom_pad'
         model%node_sets(2)%nodes = in_order(number(:, :, 0, 2))
         model%node_sets(3)%name = 'top_end'
         model%node_sets(3)%nodes = in_order(number(:, :, 2*cells(3), 1))
         model%node_sets(4)%name = 'bottom_end'
         model%node_sets(4)%nodes = in_order(number(:, :, 2*cells(3), 2))
         model%node_sets(5)%name = 'empty'
         allocate (model%node_sets(5)%nodes(0))
         free = .true.
         free(model%node_sets(4)%nodes) = .false.
         model%row_node = [(([(v, c=1, 3)]), v=1, n)]
         model%row_component = [(([(c, c=1, 3)]), v=1, n)]
         model%row_component = pack(model%row_component, free(model%row_node))
         model%row_node = pack(model%row_node, free(model%row_node))
      end subroutine add_sets_and_rows

      !> Final indices of lattice nodes, ascending.
      function in_order(lattice) result(list)
         integer, intent(in) :: lattice(:, :)
         integer, allocatable :: list(:)
         logical :: chosen(n)
         integer :: v

         chosen = .false.
         chosen(order(pack(lattice, lattice > 0))) = .true.
         list = pack([(v, v=1, n)], chosen)
      end function in_order

   end function two_blocks

   !> A random order of 1 ... n, the same in every run.
   function shuffled(n) result(order)
      integer, intent(in) :: n
      integer :: order(n), k, other

      order = [(k, k=1, n)]
      do k = n, 2, -1
         other = 1 + int(k*pseudo_random(k))
         order([k, other]) = order([other, k])
      end do
   end function shuffled

   !> A number in [0, 1) that looks random, the same for the same k.
   elemental real(wp) function pseudo_random(k)
      integer, intent(in) :: k
      pseudo_random = modulo(sin(12.9898_wp*k)*43758.5453_wp, 1.0_wp)
   end function pseudo_random

   !> Some rotation that leaves no axis along another.
   pure function turn() result(rotation)
      real(wp) :: rotation(3, 3)
      real(wp) :: c, s
      c = cos(0.2_wp*pi)
      s = sin(0.2_wp*pi)
      rotation = matmul(reshape([c, s, 0.0_wp, -s, c, 0.0_wp, 0.0_wp, 0.0_wp, 1.0_wp], [3, 3]), &
                        reshape([1.0_wp, 0.0_wp, 0.0_wp, 0.0_wp, c, s, 0.0_wp, -s, c], [3, 3]))
   end function turn

end module support_mesh
