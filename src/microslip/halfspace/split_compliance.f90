!> The compliance that the half space adds to the FE model: all of it (series coupling), or only its short waves
!> (scale-split coupling, METHOD section 3):
!>
!>     series        C
!>     scale split   C_s = (I - S) C (I - S)^T = C - N^T Q - Q^T N + N^T (Q T^T) N,    Q = T C
!>
!> with the filter S = N^T T of `microslip_halfspace_scale_filter`. A filter that is absent stands for the series coupling.
!> Units m/N; order (n, t1, t2) per point.
module microslip_halfspace_split_compliance
   use microslip_core_kinds, only: wp
   use microslip_halfspace_convolution, only: convolution_t
   use microslip_halfspace_scale_filter, only: scale_filter_t
   implicit none(type, external)
   private

   public :: local_product, local_normal_product, nodal_response_t, new_nodal_response, add_split_to_dense

   !> What unit forces of the nodes, spread by T^T, do on the half space, m/N. It does not depend on the choice of points.
   type :: nodal_response_t
      !> Q^T = C T^T, (3 grid points, 3 nodes)
      real(wp), allocatable :: at_points(:, :)
      !> Q T^T, (3 nodes, 3 nodes)
      real(wp), allocatable :: at_nodes(:, :)
   end type nodal_response_t

contains

   !> u = C lambda or C_s lambda at all points.
   subroutine local_product(convolution, force, u, filter)
      !> C
      type(convolution_t), intent(in) :: convolution
      !> (3, points) N
      real(wp), intent(in), contiguous :: force(:, :)
      !> (3, points) m
      real(wp), intent(out), contiguous :: u(:, :)
      type(scale_filter_t), intent(in), optional :: filter
      real(wp), allocatable :: short(:, :)

      if (present(filter)) then
         short = force
         call filter%remove_long_forces(short)
         call convolution%apply(short, u)
         call filter%remove_long_waves(u)
      else
         call convolution%apply(force, u)
      end if
   end subroutine local_product

   !> The normal part of `local_product`.
   subroutine local_normal_product(convolution, force, u_n, filter)
      !> C
      type(convolution_t), intent(in) :: convolution
      !> (3, points) N
      real(wp), intent(in), contiguous :: force(:, :)
      !> (points) m
      real(wp), intent(out), contiguous :: u_n(:)
      type(scale_filter_t), intent(in), optional :: filter
      real(wp), allocatable :: short(:, :)

      if (present(filter)) then
         short = force
         call filter%remove_long_forces(short)
         call convolution%apply_normal(short, u_n)
         call filter%remove_long_waves_component(u_n)
      else
         call convolution%apply_normal(force, u_n)
      end if
   end subroutine local_normal_product

   !> The half space under unit forces of the nodes: one product by FFT for every node and direction.
   subroutine new_nodal_response(convolution, filter, response)
      !> C
      type(convolution_t), intent(in) :: convolution
      type(scale_filter_t), intent(in) :: filter
      type(nodal_response_t), intent(out) :: response
      real(wp), allocatable :: unit(:, :), force(:, :), u(:, :)
      integer :: node, c, column

      associate (nodes => filter%hats%pairs, points => filter%hats%points)
         allocate (response%at_points(3*points, 3*nodes), response%at_nodes(3*nodes, 3*nodes))
      end associate
      !$omp parallel default(none) shared(convolution, filter, response) private(node, c, column, unit, force, u)
      allocate (unit(3, filter%hats%pairs), force(3, filter%hats%points), u(3, filter%hats%points))
      !$omp do schedule(static)
      do node = 1, filter%hats%pairs
         do c = 1, 3
            column = 3*node - 3 + c
            unit = 0.0_wp
            unit(c, node) = 1.0_wp
            call filter%spread_forces(unit, force)
            call convolution%apply(force, u)
            response%at_points(:, column) = reshape(u, [size(u)])
            call filter%average(u, unit)
            response%at_nodes(:, column) = reshape(unit, [size(unit)])
         end do
      end do
      !$omp end do
      !$omp end parallel
   end subroutine new_nodal_response

   !> g <- g + C_s - C on a subset of the points: what the filter takes from the dense half space there. The averages go over
   !> all points of the grid.
   subroutine add_split_to_dense(filter, response, points, g)
      type(scale_filter_t), intent(in) :: filter
      type(nodal_response_t), intent(in) :: response
      !> Point numbers of rows and columns
      integer, intent(in) :: points(:)
      !> (3 points, 3 points) m/N
      real(wp), intent(inout), contiguous :: g(:, :)
      real(wp), allocatable :: at_points(:, :), column(:, :), nodal(:, :)
      integer :: l, m, c, first

      at_points = response%at_points([((3*points(l) - 3 + c, c=1, 3), l=1, size(points))], :)
      !$omp parallel default(none) shared(filter, response, points, g, at_points) private(l, m, c, first, column, nodal)
      allocate (column(3*size(points), 3), nodal(3*filter%hats%pairs, 3))
      !$omp do schedule(static)
      do l = 1, size(points)
         nodal = -transpose(at_points(3*l - 2:3*l, :))
         column = 0.0_wp
         do m = filter%hats%start(points(l)), filter%hats%start(points(l) + 1) - 1
            first = 3*filter%hats%pair(m) - 3
            do c = 1, 3
               nodal(:, c) = nodal(:, c) + filter%hats%weight(m)*response%at_nodes(:, first + c)
               column(:, c) = column(:, c) - filter%hats%weight(m)*at_points(:, first + c)
            end do
         end do
         call filter%hats%interpolate_columns(points, nodal, column)
         g(:, 3*l - 2:3*l) = g(:, 3*l - 2:3*l) + column
      end do
      !$omp end do
      !$omp end parallel
   end subroutine add_split_to_dense

end module microslip_halfspace_split_compliance
