!> Two unequal blocks of bricks pressed together, as an FE model, reduced, and as a system with one pad.
!> Loads: 'press' on the top face downwards, 'shear' on the far end along x, 1 N each. Sensor: far end, z.
module support_brick_joint
   use microslip_core_error, only: error_t
   use microslip_core_kinds, only: wp, pi
   use microslip_fe_interface, only: contact_interface_t
   use microslip_fe_model, only: fe_model_t
   use microslip_fe_reduced_model, only: reduced_model_t
   use microslip_fe_reduction, only: reduce, reduction_options_t
   use microslip_halfspace_grid, only: be_grid_t, new_grid
   use microslip_halfspace_love_cerruti, only: elastic_material, half_space_pair, material_t
   use microslip_surface_topography, only: hill_t, new_hill
   use microslip_system_jointed_system, only: jointed_system_t, new_system
   use microslip_system_pad, only: new_pad, pad_t
   use support_brick, only: block_model, block_t, facing_interface
   implicit none(type, external)
   private

   public :: brick_joint_t, make_brick_joint, dense_coupling, dense_half_space

   !> Everything on the way from the mesh to the system.
   type :: brick_joint_t
      type(fe_model_t) :: model
      type(contact_interface_t) :: contact
      !> (rows, 2 loads and 1 sensor)
      real(wp), allocatable :: patterns(:, :)
      type(reduced_model_t) :: reduced
      type(jointed_system_t) :: system
   end type brick_joint_t

contains

   !> Build it; all grid points are in potential contact.
   subroutine make_brick_joint(peak_to_peak, friction, joint, error, method, supports, elastic)
      !> m, of the hill
      real(wp), intent(in) :: peak_to_peak, friction
      type(brick_joint_t), intent(out) :: joint
      type(error_t), allocatable, intent(out) :: error
      !> Reduction; default: 'craig_bampton_massless'
      character(len=*), intent(in), optional :: method
      !> Node sets that are fixed; default: one end of both blocks
      character(len=*), intent(in), optional :: supports(:)
      !> (2) Young's moduli of the half spaces, Pa; default: both 200 GPa
      real(wp), intent(in), optional :: elastic(2)
      type(reduction_options_t) :: options
      type(pad_t) :: pad
      integer, parameter :: cells(3) = [4, 3, 2], n_modes = 12
      real(wp) :: modulus(2)
      real(wp), allocatable :: damping(:)

      associate (blocks => [block_t('lower', [0.0_wp, 0.0_wp, -0.02_wp], [0.06_wp, 0.04_wp, 0.02_wp], cells), &
         & block_t('upper', [0.0_wp, 0.0_wp, 0.0_wp], [0.06_wp, 0.04_wp, 0.03_wp], cells)])
         if (present(supports)) then
            call block_model(blocks, supports, joint%model)
         else
            call block_model(blocks, ['lower_xmin', 'upper_xmin'], joint%model)
         end if
      end associate
      joint%contact = facing_interface(joint%model, 'upper_zmin', 'lower_zmax', 'joint')
      allocate (joint%patterns(joint%model%row_count(), 3), source=0.0_wp)
      call spread_over('upper_zmax', 3, -1.0_wp, joint%patterns(:, 1))
      call spread_over('upper_xmax', 1, 1.0_wp, joint%patterns(:, 2))
      call spread_over('upper_xmax', 3, 1.0_wp, joint%patterns(:, 3))
      options%method = 'craig_bampton_massless'
      if (present(method)) options%method = method
      options%modes = n_modes
      call reduce(joint%model, [joint%contact], joint%patterns, options, joint%reduced, error)
      if (allocated(error)) return
      modulus = 2.0e11_wp
      if (present(elastic)) modulus = elastic
      call make_pad(joint%contact, peak_to_peak, friction, modulus, pad, error)
      if (allocated(error)) return
      damping = spread(2.0_wp*pi*joint%reduced%frequency(1)*1.0e-2_wp, 1, size(joint%reduced%frequency))
      call new_system(joint%reduced, [pad], 2, damping, joint%system, error)
      if (.not. allocated(error)) call joint%system%restrict(spread(.true., 1, joint%system%grid_point_count()), error)

   contains

      !> A force on the free nodes of a set, the same on each.
      subroutine spread_over(set, component, force, pattern)
         character(len=*), intent(in) :: set
         integer, intent(in) :: component
         real(wp), intent(in) :: force
         real(wp), intent(inout) :: pattern(:)
         integer, allocatable :: rows(:, :), loaded(:)

         rows = joint%model%rows_of_nodes()
         loaded = rows(component, joint%model%node_sets(joint%model%find_node_set(set))%nodes)
         loaded = pack(loaded, loaded > 0)
         pattern(loaded) = force/size(loaded)
      end subroutine spread_over

   end subroutine make_brick_joint

   !> Grid of 8 x 6 cells with a hill in the middle.
   subroutine make_pad(contact, peak_to_peak, friction, modulus, pad, error)
      type(contact_interface_t), intent(in) :: contact
      real(wp), intent(in) :: peak_to_peak, friction, modulus(2)
      type(pad_t), intent(out) :: pad
      type(error_t), allocatable, intent(out) :: error
      type(be_grid_t) :: grid
      type(hill_t) :: hill
      type(material_t) :: body(2)
      real(wp), allocatable :: height(:)
      real(wp) :: lower(2), upper(2)
      integer :: k

      lower = minval(contact%position, dim=2)
      upper = maxval(contact%position, dim=2)
      call new_grid(grid, lower, upper, 8, 6, error)
      if (.not. allocated(error)) call new_hill(hill, lower, upper, 0.5_wp*(lower + upper), peak_to_peak, error)
      if (.not. allocated(error)) call hill%heights(grid%position, height, error)
      do k = 1, 2
         if (.not. allocated(error)) call elastic_material(body(k), modulus(k), 0.3_wp, error)
      end do
      if (.not. allocated(error)) call new_pad(contact, grid, height, half_space_pair(body(1), body(2)), friction, &
         & 1.0e-6_wp, pad, error)
   end subroutine make_pad

   !> W of all grid points written out, (3 pairs, 3 points).
   pure function dense_coupling(pad) result(W)
      type(pad_t), intent(in) :: pad
      real(wp), allocatable :: W(:, :)
      integer :: p, m, c

      associate (coupling => pad%coupling)
         allocate (W(3*coupling%pairs, 3*coupling%points), source=0.0_wp)
         do p = 1, coupling%points
            do m = coupling%start(p), coupling%start(p + 1) - 1
               do c = 1, 3
                  W(3*coupling%pair(m) - 3 + c, 3*p - 3 + c) = coupling%weight(m)
               end do
            end do
         end do
      end associate
   end function dense_coupling

   !> C of all grid points written out, (3 points, 3 points) m/N.
   function dense_half_space(pad) result(C)
      type(pad_t), intent(in) :: pad
      real(wp), allocatable :: C(:, :)
      integer :: k, n

      n = pad%grid%point_count()
      allocate (C(3*n, 3*n), source=0.0_wp)
      call pad%compliance%add_to_dense([(k, k=1, n)], C)
   end function dense_half_space

end module support_brick_joint
