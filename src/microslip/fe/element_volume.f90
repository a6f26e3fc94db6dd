!> What the mesh says of every node: volume and area vector,
!>
!>     V_i = sum int N_i dV,        D_i = sum int N_i^2 dV,        A_i = sum int grad N_i dV        over its elements.
!>
!> In one material of density rho the mass of node i under a rigid translation is rho V_i, and the diagonal entry of a consistent
!> mass matrix rho D_i. Under a constant stress sigma the
!> nodal force is sigma A_i; A_i is zero inside the body, and the consistent nodal share of the surface, outward, on it.
!> Gauss points: 2 x 2 x 2, as the elements have them; 3 x 3 x 3 for the 20-node brick with full integration.
module microslip_fe_element_volume
   use microslip_core_kinds, only: wp
   use microslip_fe_element, only: cross_product
   use microslip_fe_model, only: fe_model_t
   implicit none(type, external)
   private

   public :: node_volumes

   !> (3, 20) local coordinates of the nodes of a brick, Abaqus order
   integer, parameter :: brick(3, 20) = reshape([ &
      -1, -1, -1, 1, -1, -1, 1, 1, -1, -1, 1, -1, -1, -1, 1, 1, -1, 1, 1, 1, 1, -1, 1, 1, &
      0, -1, -1, 1, 0, -1, 0, 1, -1, -1, 0, -1, 0, -1, 1, 1, 0, 1, 0, 1, 1, -1, 0, 1, &
      -1, -1, 0, 1, -1, 0, 1, 1, 0, -1, 1, 0], [3, 20])

contains

   !> V_i, D_i and A_i of all nodes.
   subroutine node_volumes(model, volume, square, area, size_of_area, measured)
      type(fe_model_t), intent(in) :: model
      !> (nodes) V_i and D_i, m^3; D_i is 0 at nodes of 20-node bricks
      real(wp), allocatable, intent(out) :: volume(:), square(:)
      !> (3, nodes) m^2
      real(wp), allocatable, intent(out) :: area(:, :)
      !> (nodes) sum of the sizes of the elements' parts of A_i, m^2
      real(wp), allocatable, intent(out) :: size_of_area(:)
      !> (nodes) whether all elements of the node are bricks with 8 or 20 nodes
      logical, allocatable, intent(out) :: measured(:)
      real(wp), allocatable :: part_volume(:), part_square(:), part_area(:, :)
      logical, allocatable :: eight(:)
      integer :: k, e, m, n

      n = model%node_count()
      allocate (eight(n), source=.true.)
      allocate (volume(n), square(n), area(3, n), size_of_area(n), source=0.0_wp)
      allocate (measured(n), source=.false.)
      do k = 1, size(model%elements)
         measured(pack(model%elements(k)%connectivity, .true.)) = .true.
      end do
      if (allocated(model%other_elements)) then
         do k = 1, size(model%other_elements)
            measured(pack(model%other_elements(k)%connectivity, .true.)) = .false.
         end do
      end if
      do k = 1, size(model%elements)
         associate (connectivity => model%elements(k)%connectivity, type => model%elements(k)%type)
            n = size(connectivity, 1)
            if (.not. (index(type, 'C3D8') == 1 .and. n == 8 .or. index(type, 'C3D20') == 1 .and. n == 20)) then
               measured(pack(connectivity, .true.)) = .false.
               cycle
            end if
            allocate (part_volume(n), part_square(n), part_area(3, n))
            do e = 1, size(connectivity, 2)
               call integrate(model%coordinates(:, connectivity(:, e)), merge(3, 2, type == 'C3D20'), part_volume, &
                  & part_square, part_area)
               if (n == 20) eight(connectivity(:, e)) = .false.
               do m = 1, n
                  associate (node => connectivity(m, e))
                     volume(node) = volume(node) + part_volume(m)
                     square(node) = square(node) + part_square(m)
                     area(:, node) = area(:, node) + part_area(:, m)
                     size_of_area(node) = size_of_area(node) + norm2(part_area(:, m))
                  end associate
               end do
            end do
            deallocate (part_volume, part_square, part_area)
         end associate
      end do
      where (.not. eight) square = 0.0_wp
   end subroutine node_volumes

   !> The integrals of one brick.
   pure subroutine integrate(x, points, volume, square, area)
      !> (3, 8 or 20) m
      real(wp), intent(in) :: x(:, :)
      !> Gauss points along each edge, 2 or 3
      integer, intent(in) :: points
      !> (nodes) int N dV and int N^2 dV; (3, nodes) int grad N dV
      real(wp), intent(out) :: volume(:), square(:), area(:, :)
      real(wp) :: at(3), weight(3), value(size(x, 2)), gradient(3, size(x, 2)), jacobian(3, 3), cofactor(3, 3), w, w_det
      integer :: i, j, k

      at = [-sqrt(0.6_wp), 0.0_wp, sqrt(0.6_wp)]
      weight = [5.0_wp, 8.0_wp, 5.0_wp]/9.0_wp
      if (points == 2) then
         at(:2) = [-1.0_wp, 1.0_wp]/sqrt(3.0_wp)
         weight(:2) = 1.0_wp
      end if
      volume = 0.0_wp
      square = 0.0_wp
      area = 0.0_wp
      do k = 1, points
         do j = 1, points
            do i = 1, points
               call shape_of_brick(size(x, 2), [at(i), at(j), at(k)], value, gradient)
               jacobian = matmul(x, transpose(gradient))
               w = weight(i)*weight(j)*weight(k)
               ! grad N det J = cof(J) dN/dxi
               cofactor(:, 1) = cross_product(jacobian(:, 2), jacobian(:, 3))
               cofactor(:, 2) = cross_product(jacobian(:, 3), jacobian(:, 1))
               cofactor(:, 3) = cross_product(jacobian(:, 1), jacobian(:, 2))
               w_det = w*dot_product(jacobian(:, 1), cofactor(:, 1))
               volume = volume + w_det*value
               square = square + w_det*value**2
               area = area + w*matmul(cofactor, gradient)
            end do
         end do
      end do
   end subroutine integrate

   !> Shape functions of the 8-node brick and of the 20-node serendipity brick, and their gradients.
   pure subroutine shape_of_brick(nodes, local, value, gradient)
      !> 8 or 20
      integer, intent(in) :: nodes
      real(wp), intent(in) :: local(3)
      !> (nodes); (3, nodes)
      real(wp), intent(out) :: value(:), gradient(:, :)
      real(wp) :: one(3), slope(3), bracket
      integer :: k, c

      do k = 1, nodes
         do c = 1, 3
            if (brick(c, k) == 0) then
               one(c) = 1.0_wp - local(c)**2
               slope(c) = -2.0_wp*local(c)
            else
               one(c) = 1.0_wp + local(c)*brick(c, k)
               slope(c) = brick(c, k)
            end if
         end do
         value(k) = product(one)
         gradient(:, k) = slope*[one(2)*one(3), one(1)*one(3), one(1)*one(2)]
         if (nodes == 8) then
            value(k) = value(k)/8.0_wp
            gradient(:, k) = gradient(:, k)/8.0_wp
         else if (k <= 8) then
            bracket = dot_product(local, real(brick(:, k), wp)) - 2.0_wp
            gradient(:, k) = (gradient(:, k)*bracket + value(k)*brick(:, k))/8.0_wp
            value(k) = value(k)*bracket/8.0_wp
         else
            value(k) = value(k)/4.0_wp
            gradient(:, k) = gradient(:, k)/4.0_wp
         end if
      end do
   end subroutine shape_of_brick

end module microslip_fe_element_volume
