!> The coupling W_b: exact for rigid and linear fields, true to force and moment, gathered compliance.
module test_halfspace_coupling
   use microslip_core_error, only: error_t, status_bad_input
   use microslip_core_kinds, only: wp
   use microslip_fe_interface, only: contact_interface_t, interface_from_sets
   use microslip_fe_model, only: fe_model_t
   use microslip_halfspace_coupling, only: coupling_t, build_coupling, points_on_faces, add_gathered
   use support_mesh, only: two_blocks, pseudo_random, pad_size, turn
   use testdrive, only: new_unittest, unittest_type, error_type, check
   implicit none(type, external)
   private

   public :: collect_halfspace_coupling

   character(len=*), parameter :: types(2) = ['C3D8I ', 'C3D20R']
   real(wp), parameter :: rounding = 1000*epsilon(1.0_wp)
   integer, parameter :: grid(2) = [21, 15]

contains

   subroutine collect_halfspace_coupling(testsuite)
      type(unittest_type), allocatable, intent(out) :: testsuite(:)
      testsuite = [new_unittest('columns_sum_to_one', test_partition), &
                   new_unittest('rigid_motion_is_exact', test_rigid), &
                   new_unittest('linear_fields_are_exact', test_linear), &
                   new_unittest('force_and_moment_are_kept', test_moment), &
                   new_unittest('bore_is_cut_out', test_mask), &
                   new_unittest('gather_equals_products', test_gather), &
                   new_unittest('interpolated_columns', test_columns), &
                   new_unittest('points_off_the_faces_are_refused', test_refused)]
   end subroutine collect_halfspace_coupling

   !> A distorted, rotated pad with a square bore and the coupling of the cells on it.
   subroutine make_pad(type, contact, position, coupling)
      character(len=*), intent(in) :: type
      type(contact_interface_t), intent(out) :: contact
      real(wp), allocatable, intent(out) :: position(:, :)
      type(coupling_t), intent(out) :: coupling
      type(error_t), allocatable :: failed
      logical, allocatable :: inside(:)
      integer :: k

      call interface_from_sets(two_blocks(trim(type), [5, 3, 1], .true., 0.3_wp, turn()), 'pad', &
                               'top_pad', 'bottom_pad', contact, error=failed)
      position = cell_centres()
      position = matmul(in_plane_turn(contact), position)
      inside = points_on_faces(contact, position)
      position = position(:, pack([(k, k=1, size(inside))], inside))
      call build_coupling(contact, position, coupling, error=failed)
   end subroutine make_pad

   !> From the pad's own axes (centre of the pad) to the axes t1, t2 of the interface.
   function in_plane_turn(contact) result(q)
      type(contact_interface_t), intent(in) :: contact
      real(wp) :: q(2, 2), axes(3, 3)
      axes = turn()
      q = matmul(transpose(contact%frame(:, 2:)), axes(:, :2))
   end function in_plane_turn

   !> Centres of the cells of the whole grid, from the centre of the pad.
   function cell_centres() result(position)
      real(wp), allocatable :: position(:, :)
      integer :: i, j
      position = reshape([((pad_size*([i, j] - 0.5_wp)/grid - 0.5_wp*pad_size, i=1, grid(1)), j=1, grid(2))], &
                         [2, product(grid)])
   end function cell_centres

   function noise(rows, columns) result(x)
      integer, intent(in) :: rows, columns
      real(wp) :: x(rows, columns)
      integer :: i, j
      do j = 1, columns
         x(:, j) = [(pseudo_random(i + 1000*j) - 0.5_wp, i=1, rows)]
      end do
   end function noise

   subroutine test_partition(error)
      type(error_type), allocatable, intent(out) :: error
      type(contact_interface_t) :: contact
      type(coupling_t) :: coupling
      real(wp), allocatable :: position(:, :)
      integer :: t, p

      do t = 1, 2
         call make_pad(types(t), contact, position, coupling)
         call check(error, coupling%points, size(position, 2))
         if (.not. allocated(error)) call check(error, coupling%pairs, contact%pair_count())
         if (allocated(error)) return
         do p = 1, coupling%points
            call check(error, sum(coupling%weight(coupling%start(p):coupling%start(p + 1) - 1)), 1.0_wp, thr=rounding)
            if (allocated(error)) return
         end do
      end do
   end subroutine test_partition

   !> d(x) = d0 + omega x (0, x1, x2) in the components (n, t1, t2).
   subroutine test_rigid(error)
      type(error_type), allocatable, intent(out) :: error
      real(wp), parameter :: shift(3) = [0.3_wp, -1.1_wp, 0.7_wp]
      real(wp), parameter :: spin(3, 3) = reshape(real([0, 3, -2, -3, 0, 5, 2, -5, 0], wp), [3, 3])
      call check_field(error, shift, spin(:, 2:))
   end subroutine test_rigid

   subroutine test_linear(error)
      type(error_type), allocatable, intent(out) :: error
      real(wp), parameter :: gradient(3, 2) = reshape([2.0_wp, -0.4_wp, 7.0_wp, 3.0_wp, 0.1_wp, -1.0_wp], [3, 2])
      call check_field(error, [0.0_wp, 0.0_wp, 0.0_wp], gradient)
   end subroutine test_linear

   !> The field shift + gradient x is the same at the points whether interpolated or evaluated.
   subroutine check_field(error, shift, gradient)
      type(error_type), allocatable, intent(out) :: error
      real(wp), intent(in) :: shift(3), gradient(3, 2)
      type(contact_interface_t) :: contact
      type(coupling_t) :: coupling
      real(wp), allocatable :: position(:, :), nodal(:, :), at_points(:, :), expected(:, :)
      integer :: t

      do t = 1, 2
         call make_pad(types(t), contact, position, coupling)
         nodal = spread(shift, 2, coupling%pairs) + matmul(gradient, contact%position)
         expected = spread(shift, 2, coupling%points) + matmul(gradient, position)
         allocate (at_points(3, coupling%points))
         call coupling%interpolate(nodal, at_points)
         call check(error, maxval(abs(at_points - expected)) <= rounding)
         if (allocated(error)) return
         deallocate (at_points)
      end do
   end subroutine check_field

   subroutine test_moment(error)
      type(error_type), allocatable, intent(out) :: error
      type(contact_interface_t) :: contact
      type(coupling_t) :: coupling
      real(wp), allocatable :: position(:, :), forces(:, :), nodal(:, :)
      integer :: t

      do t = 1, 2
         call make_pad(types(t), contact, position, coupling)
         forces = noise(3, coupling%points)
         allocate (nodal(3, coupling%pairs))
         call coupling%distribute(forces, nodal)
         call check(error, maxval(abs(sum(nodal, dim=2) - sum(forces, dim=2))) <= rounding)
         ! All first moments, those of the moment vector among them
         if (.not. allocated(error)) call check(error, maxval(abs(matmul(nodal, transpose(contact%position)) &
            - matmul(forces, transpose(position)))) <= rounding)
         if (allocated(error)) return
         deallocate (nodal)
      end do
   end subroutine test_moment

   !> The middle cell of 5 x 3 is missing, the outline and the bore are straight.
   subroutine test_mask(error)
      type(error_type), allocatable, intent(out) :: error
      type(contact_interface_t) :: contact
      type(error_t), allocatable :: failed
      logical, allocatable :: inside(:), expected(:)
      real(wp), allocatable :: x(:, :)
      integer :: t

      x = cell_centres()
      expected = abs(x(1, :)) > 0.1_wp*pad_size(1) .or. abs(x(2, :)) > pad_size(2)/6
      do t = 1, 2
         call interface_from_sets(two_blocks(trim(types(t)), [5, 3, 1], hole=.true.), 'pad', &
                                  'top_pad', 'bottom_pad', contact, error=failed)
         inside = points_on_faces(contact, x)
         call check(error, all(inside .eqv. expected))
         if (.not. allocated(error)) call check(error, count(points_on_faces(contact, 2*x)) < size(inside)/3)
         if (.not. allocated(error)) call check(error, count(points_on_faces(contact, x, 0.3_wp)) > count(inside))
         if (allocated(error)) return
      end do
   end subroutine test_mask

   !> W as a dense matrix (3 pairs, 3 points) at chosen points.
   function dense(coupling, points) result(w)
      type(coupling_t), intent(in) :: coupling
      integer, intent(in) :: points(:)
      real(wp), allocatable :: w(:, :)
      integer :: k, m, c

      allocate (w(3*coupling%pairs, 3*size(points)), source=0.0_wp)
      do k = 1, size(points)
         do m = coupling%start(points(k)), coupling%start(points(k) + 1) - 1
            do c = -2, 0
               w(3*coupling%pair(m) + c, 3*k + c) = coupling%weight(m)
            end do
         end do
      end do
   end function dense

   !> Two interfaces of different meshes in one F, chosen points of each.
   subroutine test_gather(error)
      type(error_type), allocatable, intent(out) :: error
      type(contact_interface_t) :: contact
      type(coupling_t) :: first, second
      real(wp), allocatable :: position(:, :), f(:, :), g(:, :), expected(:, :), w1(:, :), w2(:, :)
      integer, allocatable :: points_1(:), points_2(:)
      integer :: n1, p1, k

      call make_pad(types(1), contact, position, first)
      call make_pad(types(2), contact, position, second)
      points_1 = [(k, k=1, first%points, 5)]
      points_2 = [(k, k=3, second%points, 7)]
      n1 = 3*first%pairs
      p1 = 3*size(points_1)
      f = noise(n1 + 3*second%pairs, n1 + 3*second%pairs)
      allocate (g(p1 + 3*size(points_2), p1 + 3*size(points_2)), source=1.0_wp)
      call add_gathered(first, points_1, first, points_1, f(:n1, :n1), g(:p1, :p1))
      call add_gathered(first, points_1, second, points_2, f(:n1, n1 + 1:), g(:p1, p1 + 1:))
      call add_gathered(second, points_2, first, points_1, f(n1 + 1:, :n1), g(p1 + 1:, :p1))
      call add_gathered(second, points_2, second, points_2, f(n1 + 1:, n1 + 1:), g(p1 + 1:, p1 + 1:))

      w1 = dense(first, points_1)
      w2 = dense(second, points_2)
      allocate (expected, mold=g)
      expected(:p1, :p1) = 1 + matmul(transpose(w1), matmul(f(:n1, :n1), w1))
      expected(:p1, p1 + 1:) = 1 + matmul(transpose(w1), matmul(f(:n1, n1 + 1:), w2))
      expected(p1 + 1:, :p1) = 1 + matmul(transpose(w2), matmul(f(n1 + 1:, :n1), w1))
      expected(p1 + 1:, p1 + 1:) = 1 + matmul(transpose(w2), matmul(f(n1 + 1:, n1 + 1:), w2))
      call check(error, maxval(abs(g - expected)) <= rounding)
   end subroutine test_gather

   subroutine test_columns(error)
      type(error_type), allocatable, intent(out) :: error
      type(contact_interface_t) :: contact
      type(coupling_t) :: coupling
      real(wp), allocatable :: position(:, :), x(:, :), y(:, :), at_points(:, :)
      integer, allocatable :: points(:)
      integer :: k

      call make_pad(types(2), contact, position, coupling)
      points = [(k, k=coupling%points, 1, -3)]
      x = noise(3*coupling%pairs, 4)
      allocate (y(3*size(points), 4), source=0.0_wp)
      allocate (at_points(3, coupling%points))
      call coupling%interpolate_columns(points, x, y)
      do k = 1, 4
         call coupling%interpolate(reshape(x(:, k), [3, coupling%pairs]), at_points)
         call check(error, maxval(abs(reshape(y(:, k), [3, size(points)]) - at_points(:, points))) <= rounding)
         if (allocated(error)) return
      end do
   end subroutine test_columns

   subroutine test_refused(error)
      type(error_type), allocatable, intent(out) :: error
      type(contact_interface_t) :: contact
      type(coupling_t) :: coupling
      type(error_t), allocatable :: failed
      real(wp), allocatable :: position(:, :)

      call make_pad(types(1), contact, position, coupling)
      call build_coupling(contact, matmul(in_plane_turn(contact), cell_centres()), coupling, error=failed)
      call check(error, allocated(failed))
      if (.not. allocated(error)) call check(error, failed%status, status_bad_input)
      if (.not. allocated(error)) call check(error, index(failed%message, "interface 'pad'") > 0 &
         .and. index(failed%message, 'of 315 grid points lie on no element face') > 0, failed%message)
   end subroutine test_refused

end module test_halfspace_coupling
