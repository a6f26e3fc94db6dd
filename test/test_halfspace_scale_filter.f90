!> The filter of the scale-split coupling and what it makes of the half space: constants, symmetry, definiteness, dense =
!> FFT, and nothing left where the FE mesh is finer than the grid.
module test_halfspace_scale_filter
   use microslip_core_error, only: error_t, status_bad_input
   use microslip_core_kinds, only: wp
   use microslip_fe_interface, only: contact_interface_t, interface_from_sets
   use microslip_halfspace_compliance, only: compliance_t, new_compliance
   use microslip_halfspace_convolution, only: convolution_t, new_convolution
   use microslip_halfspace_coupling, only: points_on_faces
   use microslip_halfspace_grid, only: be_grid_t, new_grid
   use microslip_halfspace_love_cerruti, only: elastic_material, half_space_pair, material_t
   use microslip_halfspace_scale_filter, only: cell_areas, new_scale_filter, scale_filter_t
   use microslip_halfspace_split_compliance, only: add_split_to_dense, local_normal_product, local_product, &
      & new_nodal_response, nodal_response_t
   use microslip_linalg_dense, only: eigen_symmetric
   use support_checks, only: good
   use support_mesh, only: pad_size, pseudo_random, turn, two_blocks
   use testdrive, only: check, error_type, new_unittest, unittest_type
   implicit none(type, external)
   private

   public :: collect_halfspace_scale_filter

   character(len=*), parameter :: types(2) = ['C3D8I ', 'C3D20R']
   real(wp), parameter :: rounding = 1000*epsilon(1.0_wp), overhang = 0.2_wp

   !> A pad with everything of the half space.
   type :: place_t
      type(contact_interface_t) :: contact
      type(be_grid_t) :: grid
      type(scale_filter_t) :: filter
      type(compliance_t) :: compliance
      type(convolution_t) :: convolution
   end type place_t

contains

   subroutine collect_halfspace_scale_filter(testsuite)
      type(unittest_type), allocatable, intent(out) :: testsuite(:)
      testsuite = [new_unittest('constants_are_long_waves', test_constants), &
                   new_unittest('averages_are_those_of_areas', test_averages), &
                   new_unittest('symmetric_within_0_and_1', test_spectrum), &
                   new_unittest('areas_of_cut_cells', test_areas), &
                   new_unittest('dense_equals_products', test_dense), &
                   new_unittest('semidefinite_and_less_than_the_whole', test_definite), &
                   new_unittest('without_filter_the_whole', test_series), &
                   new_unittest('refined_mesh_leaves_nothing', test_refined), &
                   new_unittest('points_off_the_faces_are_refused', test_refused)]
   end subroutine collect_halfspace_scale_filter

   !> A distorted pad with a square bore, turned against the grid so that its edges cut cells; unequal materials.
   subroutine make_place(type, cells, place, lib)
      character(len=*), intent(in) :: type
      !> Of the grid
      integer, intent(in) :: cells(2)
      type(place_t), intent(out) :: place
      type(error_t), allocatable, intent(out) :: lib
      type(material_t) :: body(2)
      real(wp) :: lower(2), upper(2)
      logical, allocatable :: mask(:, :)

      call interface_from_sets(two_blocks(trim(type), [5, 3, 1], .true., 0.3_wp, turn()), 'pad', 'top_pad', 'bottom_pad', &
                               place%contact, error=lib)
      if (allocated(lib)) return
      lower = minval(place%contact%position, dim=2)
      upper = maxval(place%contact%position, dim=2)
      call new_grid(place%grid, lower, upper, cells(1), cells(2), lib)
      if (allocated(lib)) return
      mask = reshape(points_on_faces(place%contact, place%grid%position, overhang), cells)
      call new_grid(place%grid, lower, upper, cells(1), cells(2), lib, mask=mask)
      if (.not. allocated(lib)) call new_scale_filter(place%filter, place%contact, place%grid, overhang, lib)
      if (.not. allocated(lib)) call elastic_material(body(1), 2.0e11_wp, 0.3_wp, lib)
      if (.not. allocated(lib)) call elastic_material(body(2), 0.7e11_wp, 0.2_wp, lib)
      if (allocated(lib)) return
      call new_compliance(place%compliance, half_space_pair(body(1), body(2)), place%grid)
      call new_convolution(place%convolution, place%compliance)
   end subroutine make_place

   function noise(columns) result(x)
      integer, intent(in) :: columns
      real(wp) :: x(3, columns)
      integer :: i, j
      x = reshape([((pseudo_random(i + 7*j) - 0.5_wp, i=1, 3), j=1, columns)], [3, columns])
   end function noise

   !> S keeps a rigid translation, S^T an even traction; nodes that no point is near stay out of it.
   subroutine test_constants(error)
      type(error_type), allocatable, intent(out) :: error
      type(error_t), allocatable :: lib
      type(place_t) :: place
      real(wp), allocatable :: u(:, :), u_n(:), force(:, :), even(:, :)
      real(wp), parameter :: shift(3) = [0.3_wp, -1.1_wp, 0.7_wp]
      integer :: t, n

      do n = 8, 24, 16
         do t = 1, 2
            call make_place(types(t), [n, n], place, lib)
            call good(error, lib)
            if (allocated(error)) return
            u = spread(shift, 2, place%grid%point_count())
            u_n = u(1, :)
            call place%filter%remove_long_waves(u)
            call place%filter%remove_long_waves_component(u_n)
            call check(error, maxval(abs(u)) <= rounding .and. maxval(abs(u_n)) <= rounding, 'translation')
            if (allocated(error)) return
            even = spread(shift, 2, place%grid%point_count())*spread(place%filter%area, 1, 3)
            force = even
            call place%filter%remove_long_forces(force)
            call check(error, maxval(abs(force)) <= rounding*maxval(abs(even)), 'traction')
            if (allocated(error)) return
            call check(error, n == 24 .or. any(place%filter%inverse_area <= 0.0_wp) .or. t == 1, 'no node without points')
            if (allocated(error)) return
         end do
      end do
   end subroutine test_constants

   !> T is the mean over the hat functions, and T^T its transpose.
   subroutine test_averages(error)
      type(error_type), allocatable, intent(out) :: error
      type(error_t), allocatable :: lib
      type(place_t) :: place
      real(wp), allocatable :: u(:, :), nodal(:, :), averages(:, :), force(:, :)
      integer :: t

      do t = 1, 2
         call make_place(types(t), [21, 15], place, lib)
         call good(error, lib)
         if (allocated(error)) return
         u = noise(place%grid%point_count())
         allocate (averages(3, place%filter%hats%pairs))
         nodal = noise(size(averages, 2) + 1)
         nodal = nodal(:, 2:)
         force = u
         call place%filter%average(u, averages)
         call place%filter%spread_forces(nodal, force)
         call check(error, sum(averages*nodal), sum(u*force), thr=rounding*norm2(averages)*norm2(nodal))
         if (allocated(error)) return
         call check(error, maxval(averages(1, :)) <= maxval(u(1, :)) .and. minval(averages(1, :)) >= minval(u(1, :)), 'mean')
         if (allocated(error)) return
         deallocate (averages)
      end do
   end subroutine test_averages

   !> A^(1/2) S A^(-1/2) is symmetric with eigenvalues in [0, 1], 1 among them.
   subroutine test_spectrum(error)
      type(error_type), allocatable, intent(out) :: error
      type(error_t), allocatable :: lib
      type(place_t) :: place
      real(wp), allocatable :: S(:, :), u(:), eigenvalues(:)
      integer :: t, p

      do t = 1, 2
         call make_place(types(t), [17, 12], place, lib)
         call good(error, lib)
         if (allocated(error)) return
         associate (n => place%grid%point_count(), root => sqrt(place%filter%area))
            allocate (S(n, n), u(n), eigenvalues(n))
            do p = 1, n
               u = 0.0_wp
               u(p) = 1.0_wp/root(p)
               S(:, p) = root*u
               call place%filter%remove_long_waves_component(u)
               S(:, p) = S(:, p) - root*u
            end do
            call check(error, maxval(abs(S - transpose(S))) <= rounding, 'not symmetric')
            if (allocated(error)) return
            call eigen_symmetric(S, eigenvalues, lib, values_only=.true.)
            call check(error, minval(eigenvalues) >= -rounding .and. abs(maxval(eigenvalues) - 1.0_wp) <= rounding, 'spectrum')
            if (allocated(error)) return
            deallocate (S, u, eigenvalues)
         end associate
      end do
   end subroutine test_spectrum

   !> The areas of the cells make up that of the pad, and a rim of cells with their centres just outside (overhang).
   subroutine test_areas(error)
      type(error_type), allocatable, intent(out) :: error
      type(error_t), allocatable :: lib
      type(place_t) :: place
      real(wp), allocatable :: area(:)
      real(wp), parameter :: slivers = 0.015_wp
      real(wp) :: faces
      integer :: f

      call make_place(types(1), [60, 60], place, lib)
      call good(error, lib)
      if (allocated(error)) return
      area = cell_areas(place%contact, place%grid)
      call check(error, all(area > 0.0_wp .and. area <= (1.0_wp + rounding)*place%grid%cell_area()) &
         .and. minval(area) < 0.7_wp*place%grid%cell_area(), 'areas of cells')
      if (allocated(error)) return
      faces = 0.0_wp
      do f = 1, size(place%contact%faces, 2)
         associate (corner => place%contact%position(:, place%contact%faces(:4, f)))
            faces = faces + 0.5_wp*abs((corner(1, 3) - corner(1, 1))*(corner(2, 4) - corner(2, 2)) &
               & - (corner(2, 3) - corner(2, 1))*(corner(1, 4) - corner(1, 2)))
         end associate
      end do
      call check(error, sum(area), faces, thr=slivers*faces)
   end subroutine test_areas

   !> C + (C_s - C) on some of the points, by the matrix, by products, and by its definition.
   subroutine test_dense(error)
      type(error_type), allocatable, intent(out) :: error
      type(error_t), allocatable :: lib
      type(place_t) :: place
      type(nodal_response_t) :: response
      real(wp), allocatable :: G(:, :), force(:, :), short(:, :), u(:, :), whole(:, :), u_n(:)
      integer, allocatable :: points(:)
      integer :: t, k

      do t = 1, 2
         call make_place(types(t), [14, 11], place, lib)
         call good(error, lib)
         if (allocated(error)) return
         points = [(k, k=2, place%grid%point_count(), 3)]
         allocate (G(3*size(points), 3*size(points)), source=0.0_wp)
         call place%compliance%add_to_dense(points, G)
         call new_nodal_response(place%convolution, place%filter, response)
         call add_split_to_dense(place%filter, response, points, G)
         allocate (force(3, place%grid%point_count()), source=0.0_wp)
         force(:, points) = noise(size(points))
         allocate (u, whole, mold=force)
         allocate (u_n(size(u, 2)))
         call local_product(place%convolution, force, u, place%filter)
         call local_normal_product(place%convolution, force, u_n, place%filter)
         short = force
         call place%filter%remove_long_forces(short)
         call place%convolution%apply(short, whole)
         call place%filter%remove_long_waves(whole)
         call check(error, maxval(abs(u - whole)) <= rounding*maxval(abs(u)), 'definition')
         if (allocated(error)) return
         call check(error, maxval(abs(u(1, :) - u_n)) <= rounding*maxval(abs(u)), 'normal part')
         if (allocated(error)) return
         call check(error, maxval(abs(reshape(matmul(G, reshape(force(:, points), [size(G, 1)])), [3, size(points)]) &
            & - u(:, points))) <= rounding*maxval(abs(G)), 'dense')
         if (allocated(error)) return
         call check(error, maxval(abs(G - transpose(G))) <= rounding*maxval(abs(G)), 'not symmetric')
         if (allocated(error)) return
         deallocate (G, force, u, whole, u_n)
      end do
   end subroutine test_dense

   !> 0 <= C_s, and much smaller than C for loads as wide as the pad.
   subroutine test_definite(error)
      type(error_type), allocatable, intent(out) :: error
      type(error_t), allocatable :: lib
      type(place_t) :: place
      type(nodal_response_t) :: response
      real(wp), allocatable :: G(:, :), values(:), wide(:)
      real(wp) :: largest
      integer :: t, k

      do t = 1, 2
         call make_place(types(t), [14, 11], place, lib)
         call good(error, lib)
         if (allocated(error)) return
         associate (points => [(k, k=1, place%grid%point_count())])
            allocate (G(3*size(points), 3*size(points)), source=0.0_wp)
            allocate (values(size(G, 1)))
            call place%compliance%add_to_dense(points, G)
            wide = reshape(spread([1.0_wp, 0.0_wp, 0.0_wp], 2, size(points)), [size(G, 1)])
            largest = dot_product(wide, matmul(G, wide))
            call new_nodal_response(place%convolution, place%filter, response)
            call add_split_to_dense(place%filter, response, points, G)
         end associate
         call check(error, dot_product(wide, matmul(G, wide)) <= 0.01_wp*largest, 'even load')
         if (allocated(error)) return
         call eigen_symmetric(G, values, lib, values_only=.true.)
         call check(error, minval(values) >= -rounding*maxval(values), 'not semidefinite')
         if (allocated(error)) return
         deallocate (G, values)
      end do
   end subroutine test_definite

   !> An absent filter stands for the series coupling.
   subroutine test_series(error)
      type(error_type), allocatable, intent(out) :: error
      type(error_t), allocatable :: lib
      type(place_t) :: place
      type(scale_filter_t), allocatable :: none
      real(wp), allocatable :: force(:, :), u(:, :), whole(:, :), u_n(:)

      call make_place(types(1), [9, 8], place, lib)
      call good(error, lib)
      if (allocated(error)) return
      force = noise(place%grid%point_count())
      allocate (u, whole, mold=force)
      allocate (u_n(size(u, 2)))
      call place%convolution%apply(force, whole)
      call local_product(place%convolution, force, u, none)
      call local_normal_product(place%convolution, force, u_n, none)
      call check(error, maxval(abs(u - whole)) <= 0.0_wp .and. maxval(abs(u_n - whole(1, :))) <= rounding*maxval(abs(whole)))
   end subroutine test_series

   !> The finer the FE mesh, the less is left to the half space; a point that has all its nodes for itself keeps nothing.
   subroutine test_refined(error)
      type(error_type), allocatable, intent(out) :: error
      type(error_t), allocatable :: lib
      integer, parameter :: elements(4) = [3, 6, 12, 40]
      real(wp) :: left(size(elements))
      integer :: k

      do k = 1, size(elements)
         left(k) = norm_of_split(elements(k), lib)
         call good(error, lib)
         if (allocated(error)) return
      end do
      call check(error, all(left(2:) < left(:3)), 'grows')
      if (allocated(error)) return
      call check(error, left(4) <= rounding*left(1), 'does not vanish')
   end subroutine test_refined

   !> Largest displacement under forces on half of 10 x 6 cells, over a mesh of n x 3n/5 elements or so.
   real(wp) function norm_of_split(n, lib)
      integer, intent(in) :: n
      type(error_t), allocatable, intent(out) :: lib
      type(contact_interface_t) :: contact
      type(be_grid_t) :: grid
      type(scale_filter_t) :: filter
      type(compliance_t) :: compliance
      type(convolution_t) :: convolution
      type(material_t) :: body
      real(wp), allocatable :: force(:, :), u(:, :)

      norm_of_split = 0.0_wp
      call interface_from_sets(two_blocks('C3D8', [n, max(2, (3*n)/5), 1]), 'pad', 'top_pad', 'bottom_pad', contact, error=lib)
      if (.not. allocated(lib)) call new_grid(grid, -0.5_wp*pad_size, 0.5_wp*pad_size, 10, 6, lib)
      if (.not. allocated(lib)) call new_scale_filter(filter, contact, grid, overhang, lib)
      if (.not. allocated(lib)) call elastic_material(body, 2.0e11_wp, 0.3_wp, lib)
      if (allocated(lib)) return
      call new_compliance(compliance, half_space_pair(body, body), grid)
      call new_convolution(convolution, compliance)
      allocate (force(3, grid%point_count()), source=0.0_wp)
      allocate (u, mold=force)
      force(1, :) = merge(1.0_wp, 0.0_wp, grid%ix <= 5)
      call local_product(convolution, force, u, filter)
      norm_of_split = maxval(abs(u))
   end function norm_of_split

   subroutine test_refused(error)
      type(error_type), allocatable, intent(out) :: error
      type(error_t), allocatable :: lib
      type(place_t) :: place
      type(be_grid_t) :: grid

      call make_place(types(1), [9, 8], place, lib)
      call new_grid(grid, -pad_size, pad_size, 5, 5, lib)
      call new_scale_filter(place%filter, place%contact, grid, overhang, lib)
      call check(error, allocated(lib))
      if (allocated(error)) return
      call check(error, lib%status == status_bad_input .and. index(lib%message, 'lie on no element face') > 0)
   end subroutine test_refused

end module test_halfspace_scale_filter
