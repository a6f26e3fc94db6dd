module test_fe_relative_coordinates
   use microslip_core_error, only: error_t, status_bad_input
   use microslip_core_kinds, only: wp
   use microslip_fe_interface, only: contact_interface_t
   use microslip_fe_model, only: fe_model_t, node_set_t
   use microslip_fe_relative_coordinates, only: new_relative_coordinates, relative_coordinates_t
   use microslip_linalg_sparse, only: symmetric_sparse_t
   use support_brick, only: block_model, block_t, facing_interface, two_blocks
   use testdrive, only: new_unittest, unittest_type, error_type, check
   implicit none(type, external)
   private

   public :: collect_fe_relative_coordinates

   real(wp), parameter :: rounding = 1.0e4_wp*epsilon(1.0_wp)

contains

   subroutine collect_fe_relative_coordinates(testsuite)
      type(unittest_type), allocatable, intent(out) :: testsuite(:)
      testsuite = [ &
                  new_unittest('energy_and_work', test_energy_and_work), &
                  new_unittest('supported_side_b', test_supported_side_b), &
                  new_unittest('rigid_ground', test_rigid_ground), &
                  new_unittest('nodes_shared_by_sides_b', test_shared_side_b), &
                  new_unittest('boundary_order', test_boundary_order), &
                  new_unittest('supported_side_a', test_supported_side_a), &
                  new_unittest('node_used_twice', test_node_used_twice)]
   end subroutine collect_fe_relative_coordinates

   !> u = T d as the definition says it: u_a = u_b + R d_b.
   function displacements(model, joints, boundary, d) result(u)
      type(fe_model_t), intent(in) :: model
      type(contact_interface_t), intent(in) :: joints(:)
      integer, intent(in) :: boundary(:)
      real(wp), intent(in) :: d(:)
      real(wp), allocatable :: u(:)
      real(wp) :: ground(3)
      integer, allocatable :: rows(:, :)
      integer :: k, j, m, c

      u = d
      rows = model%rows_of_nodes()
      m = 0
      do k = 1, size(joints)
         do j = 1, joints(k)%pair_count()
            ground = 0.0_wp
            do c = 1, 3
               if (joints(k)%node_b(j) == 0) cycle
               if (rows(c, joints(k)%node_b(j)) > 0) ground(c) = d(rows(c, joints(k)%node_b(j)))
            end do
            u(rows(:, joints(k)%node_a(j))) = ground + matmul(joints(k)%frame, d(boundary(m + 1:m + 3)))
            m = m + 3
         end do
      end do
   end function displacements

   !> d^T (T^T A T) d = u^T A u and d . T^T f = u . f for u = T d.
   subroutine compare(error, model, joints)
      type(error_type), allocatable, intent(out) :: error
      type(fe_model_t), intent(in) :: model
      type(contact_interface_t), intent(in) :: joints(:)
      type(error_t), allocatable :: fault
      type(relative_coordinates_t) :: coordinates
      real(wp), allocatable :: d(:), u(:), forces(:, :), transformed(:, :)
      integer :: k, sample

      call new_relative_coordinates(model, joints, coordinates, fault)
      call check(error,.not. allocated(fault))
      if (allocated(error)) return
      do sample = 1, 3
         d = [(sin(real(sample*k*k, wp)), k=1, model%row_count())]
         u = displacements(model, joints, coordinates%boundary_rows, d)
         call check(error, quadratic_form(coordinates%transformed_matrix(model%stiffness), d), &
                    quadratic_form(model%stiffness, u), thr=rounding, rel=.true.)
         if (allocated(error)) return
         call check(error, quadratic_form(coordinates%transformed_matrix(model%mass), d), &
                    quadratic_form(model%mass, u), thr=rounding, rel=.true.)
         if (allocated(error)) return
         forces = reshape([(cos(real(k, wp)), k=1, 2*size(d))], [size(d), 2])
         transformed = coordinates%transformed_forces(forces)
         call check(error, maxval(abs(matmul(d, transformed) - matmul(u, forces))) < rounding*size(d))
         if (allocated(error)) return
      end do
   end subroutine compare

   real(wp) function quadratic_form(matrix, x)
      type(symmetric_sparse_t), intent(in) :: matrix
      real(wp), intent(in) :: x(:)
      real(wp) :: y(size(x))
      call matrix%multiply(x, y)
      quadratic_form = dot_product(x, y)
   end function quadratic_form

   !> A frame that is not along the axes.
   pure function tilted_frame() result(frame)
      real(wp) :: frame(3, 3)
      real(wp), parameter :: n(3) = [2.0_wp, 3.0_wp, 6.0_wp]/7.0_wp
      real(wp), parameter :: t1(3) = [3.0_wp, -6.0_wp, 2.0_wp]/7.0_wp
      real(wp), parameter :: t2(3) = [6.0_wp, 2.0_wp, -3.0_wp]/7.0_wp
      frame = reshape([n, t1, t2], [3, 3])
   end function tilted_frame

   subroutine test_energy_and_work(error)
      type(error_type), allocatable, intent(out) :: error
      type(fe_model_t) :: model
      type(contact_interface_t), allocatable :: joints(:)

      call two_blocks(model, joints, [3, 2, 1])
      call compare(error, model, joints)
      if (allocated(error)) return
      joints(1)%frame = tilted_frame()
      call compare(error, model, joints)
   end subroutine test_energy_and_work

   !> Nodes of side B that are fixed: u_b = 0.
   subroutine test_supported_side_b(error)
      type(error_type), allocatable, intent(out) :: error
      type(fe_model_t) :: model
      type(contact_interface_t) :: joint

      call block_model([block_t('lower', cells=[2, 2, 1]), &
                        block_t('upper', [0.0_wp, 0.0_wp, 1.0_wp], cells=[2, 2, 1])], ['lower_xmin'], model)
      joint = facing_interface(model, 'upper_zmin', 'lower_zmax', 'joint')
      joint%frame = tilted_frame()
      call check(error, joint%pair_count(), 9)
      if (allocated(error)) return
      call compare(error, model, [joint])
   end subroutine test_supported_side_b

   !> Two blocks side by side on one base: the nodes below their common edge belong to side B of both joints.
   subroutine test_shared_side_b(error)
      type(error_type), allocatable, intent(out) :: error
      type(fe_model_t) :: model
      type(contact_interface_t), allocatable :: joints(:)
      integer, allocatable :: left(:), right(:), base(:)
      integer :: k

      call block_model([block_t('base', [0.0_wp, 0.0_wp, -0.02_wp], [0.08_wp, 0.04_wp, 0.02_wp], [4, 2, 1]), &
                        block_t('left', [0.0_wp, 0.0_wp, 0.0_wp], [0.04_wp, 0.04_wp, 0.03_wp], [2, 2, 1]), &
                        block_t('right', [0.04_wp, 0.0_wp, 0.0_wp], [0.04_wp, 0.04_wp, 0.03_wp], [2, 2, 1])], &
                       ['base_zmin'], model)
      base = model%node_sets(model%find_node_set('base_zmax'))%nodes
      left = pack(base, model%coordinates(1, base) < 0.041_wp)
      right = pack(base, model%coordinates(1, base) > 0.039_wp)
      model%node_sets = [model%node_sets, node_set_t('base_left', left), node_set_t('base_right', right)]
      allocate (joints(2))
      joints(1) = facing_interface(model, 'left_zmin', 'base_left', 'first')
      joints(2) = facing_interface(model, 'right_zmin', 'base_right', 'second')
      call check(error, count([(any(joints(1)%node_b == joints(2)%node_b(k)), k=1, 9)]), 3)
      if (.not. allocated(error)) call compare(error, model, joints)
   end subroutine test_shared_side_b

   subroutine test_rigid_ground(error)
      type(error_type), allocatable, intent(out) :: error
      type(fe_model_t) :: model
      type(contact_interface_t) :: ground, joint

      call block_model([block_t('lower', cells=[2, 2, 1]), &
                        block_t('upper', [0.0_wp, 0.0_wp, 1.0_wp], cells=[2, 2, 1])], ['upper_zmax'], model)
      joint = facing_interface(model, 'upper_zmin', 'lower_zmax', 'joint')
      ground = facing_interface(model, 'lower_zmin', '', 'ground')
      ground%frame = tilted_frame()
      call check(error, all(ground%node_b == 0))
      if (allocated(error)) return
      call compare(error, model, [ground, joint])
   end subroutine test_rigid_ground

   !> Interface by interface, pair by pair, three rows each.
   subroutine test_boundary_order(error)
      type(error_type), allocatable, intent(out) :: error
      type(error_t), allocatable :: fault
      type(fe_model_t) :: model
      type(contact_interface_t), allocatable :: joints(:)
      type(contact_interface_t) :: ground
      type(relative_coordinates_t) :: coordinates
      integer, allocatable :: rows(:, :)

      call two_blocks(model, joints, [2, 1, 1])
      ground = facing_interface(model, 'lower_zmin', '', 'ground')
      call new_relative_coordinates(model, [ground, joints], coordinates, fault)
      rows = model%rows_of_nodes()
      call check(error, size(coordinates%boundary_rows), 3*(ground%pair_count() + joints(1)%pair_count()))
      if (allocated(error)) return
      call check(error, all(coordinates%boundary_rows(4:6) == rows(:, ground%node_a(2))) .and. &
                 all(coordinates%boundary_rows(3*ground%pair_count() + 1:3*ground%pair_count() + 3) == &
                     rows(:, joints(1)%node_a(1))))
   end subroutine test_boundary_order

   subroutine test_supported_side_a(error)
      type(error_type), allocatable, intent(out) :: error
      type(error_t), allocatable :: fault
      type(fe_model_t) :: model
      type(contact_interface_t), allocatable :: joints(:)
      type(relative_coordinates_t) :: coordinates

      call two_blocks(model, joints, [2, 1, 1])
      ! The first node of the upper block is fixed; labels are ten times the index.
      joints(1)%node_a(2) = model%node_sets(model%find_node_set('upper'))%nodes(1)
      call new_relative_coordinates(model, joints, coordinates, fault)
      call check(error, allocated(fault))
      if (allocated(error)) return
      call check(error, fault%status, status_bad_input)
      if (allocated(error)) return
      call check(error, index(fault%message, 'side A: node 130 is supported in x') > 0, fault%message)
   end subroutine test_supported_side_a

   subroutine test_node_used_twice(error)
      type(error_type), allocatable, intent(out) :: error
      type(error_t), allocatable :: fault
      type(fe_model_t) :: model
      type(contact_interface_t), allocatable :: joints(:)
      type(contact_interface_t) :: second
      type(relative_coordinates_t) :: coordinates

      call two_blocks(model, joints, [2, 1, 1])
      second = joints(1)
      second%name = 'other'
      call new_relative_coordinates(model, [joints, second], coordinates, fault)
      call check(error, allocated(fault))
      if (allocated(error)) return
      call check(error, index(fault%message, 'interface "other": node 140 is used twice (also in interface "joint")') > 0, &
                 fault%message)
      if (allocated(error)) return
      second%node_a = joints(1)%node_b
      second%node_b = 0*joints(1)%node_b
      call new_relative_coordinates(model, [joints, second], coordinates, fault)
      call check(error, allocated(fault))
   end subroutine test_node_used_twice

end module test_fe_relative_coordinates
