module test_fe_residual_mass
   use microslip_core_error, only: error_t
   use microslip_core_kinds, only: wp, pi
   use microslip_core_text, only: to_text
   use microslip_fe_interface, only: contact_interface_t
   use microslip_fe_model, only: fe_model_t
   use microslip_fe_reduced_model, only: reduced_model_t
   use microslip_fe_reduction, only: craig_bampton_massless, reduce, reduction_options_t
   use microslip_linalg_dense, only: eigen_symmetric, inverse_spd
   use support_brick, only: block_model, block_t, facing_interface
   use testdrive, only: new_unittest, unittest_type, error_type, check
   implicit none(type, external)
   private

   public :: collect_fe_residual_mass

   !> Rounding times the condition of the small models
   real(wp), parameter :: tolerance = 1.0e-9_wp
   !> Mass of the upper block, kg
   real(wp), parameter :: block_mass = 7800.0_wp*0.06_wp*0.04_wp*0.03_wp
   integer, parameter :: few = 4

contains

   subroutine collect_fe_residual_mass(testsuite)
      type(unittest_type), allocatable, intent(out) :: testsuite(:)
      testsuite = [ &
                  new_unittest('rigid_mass_is_exact', test_rigid_mass), &
                  new_unittest('statics_stay', test_statics), &
                  new_unittest('tied_modes_stay', test_tied_modes), &
                  new_unittest('block_on_springs', test_block_on_springs), &
                  new_unittest('kept_mass_of_bodies', test_kept_mass), &
                  new_unittest('stiff_boundary', test_stiff_boundary)]
   end subroutine collect_fe_residual_mass

   !> A block held at its bottom, and one on it that only the contact and springs hold.
   subroutine loose_block(spring, model, joint)
      !> N/m in all, along x, y and z each, shared out evenly among the nodes of the top
      real(wp), intent(in) :: spring
      type(fe_model_t), intent(out) :: model
      type(contact_interface_t), intent(out) :: joint
      integer, allocatable :: rows(:, :), nodes(:)
      integer :: k, c

      call block_model([block_t('lower', [0.0_wp, 0.0_wp, -0.02_wp], [0.06_wp, 0.04_wp, 0.02_wp], [3, 2, 2]), &
                        block_t('upper', [0.0_wp, 0.0_wp, 0.0_wp], [0.06_wp, 0.04_wp, 0.03_wp], [3, 2, 2])], &
                       ['lower_zmin'], model)
      joint = facing_interface(model, 'upper_zmin', 'lower_zmax', 'joint')
      rows = model%rows_of_nodes()
      nodes = model%node_sets(model%find_node_set('upper_zmax'))%nodes
      do k = 1, size(nodes)
         do c = 1, 3
            associate (entry => model%stiffness%row_start(rows(c, nodes(k))))
               model%stiffness%value(entry) = model%stiffness%value(entry) + spring/size(nodes)
            end associate
         end do
      end do
   end subroutine loose_block

   !> Craig-Bampton of the loose block.
   subroutine reduce_loose(spring, modes, keep, model, joint, reduced, fault)
      real(wp), intent(in) :: spring
      integer, intent(in) :: modes
      !> Whether residual mass is kept
      logical, intent(in) :: keep
      type(fe_model_t), intent(out) :: model
      type(contact_interface_t), intent(out) :: joint
      type(reduced_model_t), intent(out) :: reduced
      type(error_t), allocatable, intent(out) :: fault
      type(reduction_options_t) :: options
      real(wp), allocatable :: patterns(:, :)

      call loose_block(spring, model, joint)
      allocate (patterns(model%row_count(), 0))
      options%method = craig_bampton_massless
      options%modes = modes
      options%residual_mass = keep
      call reduce(model, [joint], patterns, options, reduced, fault)
   end subroutine reduce_loose

   !> Displacement at x of the six motions of a rigid body, (3, 6).
   pure function rigid_displacement(x) result(u)
      real(wp), intent(in) :: x(3)
      real(wp) :: u(3, 6)

      u = 0.0_wp
      u(1, 1) = 1.0_wp
      u(2, 2) = 1.0_wp
      u(3, 3) = 1.0_wp
      u(:, 4) = [0.0_wp, -x(3), x(2)]
      u(:, 5) = [x(3), 0.0_wp, -x(1)]
      u(:, 6) = [-x(2), x(1), 0.0_wp]
   end function rigid_displacement

   !> Mass matrix of the upper block as a rigid body, from M and from the reduced model: D^T alpha^T alpha D, (6, 6).
   subroutine rigid_masses(model, joint, reduced, exact, carried)
      type(fe_model_t), intent(in) :: model
      type(contact_interface_t), intent(in) :: joint
      type(reduced_model_t), intent(in) :: reduced
      real(wp), intent(out) :: exact(6, 6), carried(6, 6)
      real(wp), allocatable :: u(:, :), mu(:, :), d(:, :), z(:, :)
      real(wp) :: motion(3, 6)
      logical, allocatable :: upper(:)
      integer :: k

      allocate (upper(model%node_count()), source=.false.)
      upper(model%node_sets(model%find_node_set('upper'))%nodes) = .true.
      allocate (u(model%row_count(), 6), mu(model%row_count(), 6), d(3*joint%pair_count(), 6))
      u = 0.0_wp
      do k = 1, model%row_count()
         if (.not. upper(model%row_node(k))) cycle
         motion = rigid_displacement(model%coordinates(:, model%row_node(k)))
         u(k, :) = motion(model%row_component(k), :)
      end do
      do k = 1, 6
         call model%mass%multiply(u(:, k), mu(:, k))
      end do
      exact = matmul(transpose(u), mu)
      do k = 1, joint%pair_count()
         d(3*k - 2:3*k, :) = matmul(transpose(joint%frame), rigid_displacement(model%coordinates(:, joint%node_a(k))))
      end do
      z = matmul(transpose(reduced%K_bi), d)
      do k = 1, size(z, 1)
         z(k, :) = z(k, :)/reduced%K_ii(k, k)
      end do
      carried = matmul(transpose(z), z)
   end subroutine rigid_masses

   !> Largest deviation of two mass matrices over their diagonals.
   pure real(wp) function deviation(carried, exact)
      real(wp), intent(in) :: carried(:, :), exact(:, :)
      integer :: i, j

      deviation = 0.0_wp
      do j = 1, size(exact, 2)
         do i = 1, size(exact, 1)
            deviation = max(deviation, abs(carried(i, j) - exact(i, j))/sqrt(exact(i, i)*exact(j, j)))
         end do
      end do
   end function deviation

   !> The block without springs has the mass matrix of a rigid body, however few the modes; without the residual mass it lacks
   !> a part that no number of modes brings.
   subroutine test_rigid_mass(error)
      type(error_type), allocatable, intent(out) :: error
      type(error_t), allocatable :: fault
      type(fe_model_t) :: model
      type(contact_interface_t) :: joint
      type(reduced_model_t) :: reduced
      integer, parameter :: modes(3) = [1, few, 30]
      real(wp) :: exact(6, 6), carried(6, 6)
      integer :: k

      do k = 1, size(modes)
         call reduce_loose(0.0_wp, modes(k), .true., model, joint, reduced, fault)
         call check(error,.not. allocated(fault))
         if (allocated(error)) return
         call rigid_masses(model, joint, reduced, exact, carried)
         call check(error, deviation(carried, exact) < tolerance, &
                    to_text(modes(k))//' modes: '//to_text(deviation(carried, exact)))
         if (allocated(error)) return
         call check(error, abs(exact(1, 1)/block_mass - 1.0_wp) < tolerance)
         if (allocated(error)) return
      end do
      call reduce_loose(0.0_wp, 120, .false., model, joint, reduced, fault)
      call rigid_masses(model, joint, reduced, exact, carried)
      call check(error, deviation(carried, exact) > 0.05_wp, to_text(deviation(carried, exact)))
   end subroutine test_rigid_mass

   !> K_s does not depend on what is kept.
   subroutine test_statics(error)
      type(error_type), allocatable, intent(out) :: error
      type(error_t), allocatable :: fault
      type(fe_model_t) :: model
      type(contact_interface_t) :: joint
      type(reduced_model_t) :: reduced
      real(wp), allocatable :: seen(:, :), reference(:, :)
      integer :: k

      do k = 1, 2
         call reduce_loose(1.0e4_wp, few, k == 2, model, joint, reduced, fault)
         call check(error,.not. allocated(fault))
         if (allocated(error)) return
         seen = reduced%K_ii
         call inverse_spd(seen, fault)
         seen = reduced%K_bb - matmul(reduced%K_bi, matmul(seen, transpose(reduced%K_bi)))
         if (k == 1) reference = seen
      end do
      call check(error, size(reduced%frequency) > few)
      if (allocated(error)) return
      call check(error, maxval(abs(seen - reference)) < tolerance*maxval(abs(reference)))
   end subroutine test_statics

   !> The tied modes stay as they are, and so does the highest frequency.
   subroutine test_tied_modes(error)
      type(error_type), allocatable, intent(out) :: error
      type(error_t), allocatable :: fault
      type(fe_model_t) :: model
      type(contact_interface_t) :: joint
      type(reduced_model_t) :: reduced, dropped

      call reduce_loose(1.0e4_wp, few, .true., model, joint, reduced, fault)
      call reduce_loose(1.0e4_wp, few, .false., model, joint, dropped, fault)
      call check(error, reduced%tied_modes == few .and. size(dropped%frequency) == few)
      if (allocated(error)) return
      call check(error, maxval(abs(reduced%frequency(:few)/dropped%frequency - 1.0_wp)) < tolerance)
      if (allocated(error)) return
      call check(error, maxval(reduced%frequency) <= dropped%frequency(few)*(1.0_wp + tolerance))
   end subroutine test_tied_modes

   !> Lifted off, the block moves on its springs at sqrt(k/m). The frequency is a 1e-3 part of the first tied one's; deflection of
   !> the block and the coordinates' own frequency change it by a square of that.
   subroutine test_block_on_springs(error)
      type(error_type), allocatable, intent(out) :: error
      type(error_t), allocatable :: fault
      type(fe_model_t) :: model
      type(contact_interface_t) :: joint
      type(reduced_model_t) :: reduced
      real(wp), parameter :: spring = 1.0e4_wp
      real(wp), allocatable :: khat(:, :), inverse(:, :), lambda(:)
      real(wp) :: distance(2), exact
      integer :: k

      exact = sqrt(spring/block_mass)
      do k = 1, 2
         call reduce_loose(spring, few, k == 1, model, joint, reduced, fault)
         inverse = reduced%K_bb
         call inverse_spd(inverse, fault)
         call check(error,.not. allocated(fault))
         if (allocated(error)) return
         khat = reduced%K_ii - matmul(transpose(reduced%K_bi), matmul(inverse, reduced%K_bi))
         if (allocated(lambda)) deallocate (lambda)
         allocate (lambda(size(khat, 1)))
         call eigen_symmetric(khat, lambda, fault, values_only=.true.)
         distance(k) = minval(abs(sqrt(lambda)/exact - 1.0_wp))
      end do
      call check(error, exact < 1.0e-2_wp*2.0_wp*pi*reduced%frequency(1))
      if (allocated(error)) return
      call check(error, distance(1) < 1.0e-5_wp, to_text(distance(1)))
      if (allocated(error)) return
      call check(error, distance(2) > 1.0e-2_wp, to_text(distance(2)))
   end subroutine test_block_on_springs

   !> All of the loose body is kept, and no more than all of the held one; what the tied modes miss is told.
   subroutine test_kept_mass(error)
      type(error_type), allocatable, intent(out) :: error
      type(error_t), allocatable :: fault
      type(fe_model_t) :: model
      type(contact_interface_t) :: joint
      type(reduced_model_t) :: reduced
      real(wp), parameter :: spring = 1.0e4_wp
      !> K u of a rigid motion is zero but for rounding of entries of 1e10 N/m
      real(wp), parameter :: rigid_rounding = 1.0e10_wp*1.0e3_wp*epsilon(1.0_wp)/spring

      call reduce_loose(spring, few, .true., model, joint, reduced, fault)
      call check(error, size(reduced%bodies), 2)
      if (allocated(error)) return
      associate (lower => reduced%bodies(1), upper => reduced%bodies(2))
         call check(error, maxval(abs(upper%inertia(:3)/block_mass - 1.0_wp)) < tolerance)
         if (allocated(error)) return
         call check(error, maxval(abs(upper%kept - 1.0_wp)) < tolerance, to_text(minval(upper%kept)))
         if (allocated(error)) return
         call check(error, maxval(lower%kept) < 1.0_wp + tolerance .and. minval(lower%kept) >= 0.0_wp)
         if (allocated(error)) return
         call check(error, maxval(abs(2.0_wp*pi*upper%frequency(:3)/sqrt(spring/block_mass) - 1.0_wp)) < rigid_rounding)
         if (allocated(error)) return
         call check(error, minval(lower%frequency) > 10.0_wp*maxval(upper%frequency))
         if (allocated(error)) return
      end associate
      call reduce_loose(spring, few, .false., model, joint, reduced, fault)
      call check(error, minval(reduced%bodies(2)%kept) < 0.9_wp .and. maxval(reduced%soft_share) > 0.1_wp, &
                 to_text(minval(reduced%bodies(2)%kept))//' '//to_text(maxval(reduced%soft_share)))
   end subroutine test_kept_mass

   !> One mode of a structure that is stiff without contact too: nothing is soft, nothing is added.
   subroutine test_stiff_boundary(error)
      type(error_type), allocatable, intent(out) :: error
      type(error_t), allocatable :: fault
      type(fe_model_t) :: model
      type(contact_interface_t) :: joint
      type(reduced_model_t) :: reduced
      type(reduction_options_t) :: options
      real(wp), allocatable :: patterns(:, :)

      call block_model([block_t('lower', [0.0_wp, 0.0_wp, -0.02_wp], [0.06_wp, 0.04_wp, 0.02_wp], [3, 2, 2]), &
                        block_t('upper', [0.0_wp, 0.0_wp, 0.0_wp], [0.06_wp, 0.04_wp, 0.03_wp], [3, 2, 2])], &
                       ['lower_xmin', 'upper_xmin'], model)
      joint = facing_interface(model, 'upper_zmin', 'lower_zmax', 'joint')
      allocate (patterns(model%row_count(), 0))
      options%method = craig_bampton_massless
      options%modes = 1
      call reduce(model, [joint], patterns, options, reduced, fault)
      call check(error,.not. allocated(fault))
      if (allocated(error)) return
      call check(error, size(reduced%frequency), 1)
      if (allocated(error)) return
      call check(error, size(reduced%soft_frequency), 0)
   end subroutine test_stiff_boundary

end module test_fe_residual_mass
