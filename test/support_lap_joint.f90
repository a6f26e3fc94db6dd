!> A single-lap joint in bending for tests: two plates of 120 x 30 x 8 mm that overlap by 40 mm, one of them clamped at its
!> far end, held together by a bolt (four springs through the thickness). What the joint carries opens one end of the
!> overlap and presses the other, so that the normal forces vary with the motion and Masing's rule does not hold.
!> Loads: the bolt. Sensor: the free end along z.
module support_lap_joint
   use microslip_analysis_operating_state, only: operating_state_t
   use microslip_analysis_preload, only: preload_options_t, preload_record_t, run_preload
   use microslip_contact_factory, only: contact_options_t
   use microslip_core_error, only: error_t
   use microslip_core_kinds, only: wp
   use microslip_fe_interface, only: contact_interface_t
   use microslip_fe_model, only: fe_model_t, node_set_t
   use microslip_fe_reduced_model, only: reduced_model_t
   use microslip_fe_reduction, only: reduce, reduction_options_t
   use microslip_halfspace_grid, only: be_grid_t, new_grid
   use microslip_halfspace_love_cerruti, only: elastic_material, half_space_pair, material_t
   use microslip_linalg_sparse, only: from_triplets, symmetric_sparse_t
   use microslip_surface_topography, only: hill_t, new_hill
   use microslip_system_jointed_system, only: jointed_system_t, new_system
   use microslip_system_pad, only: new_pad, pad_t
   use support_brick, only: block_model, block_t, facing_interface
   implicit none(type, external)
   private

   public :: make_lap_joint

   !> m: overlap from, to; places of the springs; N/m: of all four springs, in every direction; N: bolt force
   real(wp), parameter :: overlap(2) = [0.08_wp, 0.12_wp], spring_x(2) = [0.09_wp, 0.11_wp], spring_y(2) = [0.0075_wp, 0.0225_wp]
   real(wp), parameter :: bolt_stiffness = 6.0e8_wp, bolt_force = 10.0e3_wp
   !> m, from the middle of the overlap to its corners
   real(wp), parameter :: hill_height = 4.0e-6_wp
   integer, parameter :: cells(3) = [12, 4, 2], n_modes = 6, grid_cells(2) = [12, 9]
   real(wp), parameter :: near = 1.0e-6_wp, friction = 0.2_wp

contains

   !> The preloaded joint without viscous damping.
   subroutine make_lap_joint(system, state, error)
      type(jointed_system_t), intent(out) :: system
      type(operating_state_t), intent(out) :: state
      type(error_t), allocatable, intent(out) :: error
      type(fe_model_t) :: model
      type(contact_interface_t) :: contact
      type(reduced_model_t) :: reduced
      type(pad_t) :: pad
      type(preload_options_t) :: preload
      type(preload_record_t) :: record
      real(wp), allocatable :: patterns(:, :)

      call block_model([block_t('lower', [0.0_wp, 0.0_wp, -0.008_wp], [0.12_wp, 0.03_wp, 0.008_wp], cells), &
         & block_t('upper', [0.08_wp, 0.0_wp, 0.0_wp], [0.12_wp, 0.03_wp, 0.008_wp], cells)], ['lower_xmin'], model)
      call add_set(model, 'upper_zmin', 'pad_upper')
      call add_set(model, 'lower_zmax', 'pad_lower')
      contact = facing_interface(model, 'pad_upper', 'pad_lower', 'lap')
      allocate (patterns(model%row_count(), 2), source=0.0_wp)
      call bolt(model, patterns(:, 1))
      call spread_over(model, 'upper_xmax', patterns(:, 2))
      call reduce(model, [contact], patterns, reduction_options_t(method='craig_bampton_massless', modes=n_modes), reduced, error)
      if (.not. allocated(error)) call make_pad(contact, pad, error)
      if (.not. allocated(error)) call new_system(reduced, [pad], 1, spread(0.0_wp, 1, size(reduced%frequency)), system, error)
      if (.not. allocated(error)) call system%restrict(spread(.true., 1, system%grid_point_count()), error)
      preload%loads = [1]
      preload%interface_force = [bolt_force]
      if (.not. allocated(error)) call run_preload(system, preload, contact_options_t(solver='condensed', &
         & tolerance=1.0e-10_wp), state, record, error)
   end subroutine make_lap_joint

   !> The nodes of a set that are in the overlap, as a set of their own.
   subroutine add_set(model, from, name)
      type(fe_model_t), intent(inout) :: model
      character(len=*), intent(in) :: from, name
      type(node_set_t) :: found

      associate (nodes => model%node_sets(model%find_node_set(from))%nodes)
         found%name = name
         found%nodes = pack(nodes, model%coordinates(1, nodes) > overlap(1) - near &
            & .and. model%coordinates(1, nodes) < overlap(2) + near)
      end associate
      model%node_sets = [model%node_sets, found]
   end subroutine add_set

   !> Springs between the upper face of the upper plate and the lower face of the lower one, and the pull of 1 N on both.
   subroutine bolt(model, pattern)
      type(fe_model_t), intent(inout) :: model
      !> (rows) N
      real(wp), intent(inout) :: pattern(:)
      integer, allocatable :: rows(:, :), row(:), column(:)
      real(wp), allocatable :: value(:)
      integer :: ends(2), i, j, c

      rows = model%rows_of_nodes()
      call triplets_of(model%stiffness, row, column, value)
      do j = 1, 2
         do i = 1, 2
            ends = [node_at(model, [spring_x(i), spring_y(j), 0.008_wp]), node_at(model, [spring_x(i), spring_y(j), -0.008_wp])]
            do c = 1, 3
               row = [row, rows(c, ends), minval(rows(c, ends))]
               column = [column, rows(c, ends), maxval(rows(c, ends))]
               value = [value, 0.25_wp*bolt_stiffness*[1.0_wp, 1.0_wp, -1.0_wp]]
            end do
            pattern(rows(3, ends)) = [-0.25_wp, 0.25_wp]
         end do
      end do
      model%stiffness = from_triplets(model%row_count(), row, column, value)
   end subroutine bolt

   !> Upper triangle of a sparse matrix.
   subroutine triplets_of(matrix, row, column, value)
      type(symmetric_sparse_t), intent(in) :: matrix
      integer, allocatable, intent(out) :: row(:), column(:)
      real(wp), allocatable, intent(out) :: value(:)
      integer :: i, k

      row = [((i, k=matrix%row_start(i), matrix%row_start(i + 1) - 1), i=1, matrix%n)]
      column = matrix%column
      value = matrix%value
   end subroutine triplets_of

   integer function node_at(model, place)
      type(fe_model_t), intent(in) :: model
      real(wp), intent(in) :: place(3)
      node_at = minloc(norm2(model%coordinates - spread(place, 2, model%node_count()), dim=1), dim=1)
   end function node_at

   !> 1 N along z on the nodes of a set.
   subroutine spread_over(model, set, pattern)
      type(fe_model_t), intent(in) :: model
      character(len=*), intent(in) :: set
      real(wp), intent(inout) :: pattern(:)
      integer, allocatable :: rows(:, :), nodes(:)

      rows = model%rows_of_nodes()
      nodes = model%node_sets(model%find_node_set(set))%nodes
      pattern(rows(3, nodes)) = 1.0_wp/size(nodes)
   end subroutine spread_over

   subroutine make_pad(contact, pad, error)
      type(contact_interface_t), intent(in) :: contact
      type(pad_t), intent(out) :: pad
      type(error_t), allocatable, intent(out) :: error
      type(be_grid_t) :: grid
      type(hill_t) :: hill
      type(material_t) :: steel
      real(wp), allocatable :: height(:)
      real(wp) :: lower(2), upper(2)

      lower = minval(contact%position, dim=2)
      upper = maxval(contact%position, dim=2)
      call new_grid(grid, lower, upper, grid_cells(1), grid_cells(2), error)
      if (.not. allocated(error)) call new_hill(hill, lower, upper, 0.5_wp*(lower + upper), hill_height, error)
      if (.not. allocated(error)) call hill%heights(grid%position, height, error)
      if (.not. allocated(error)) call elastic_material(steel, 2.0e11_wp, 0.3_wp, error)
      if (.not. allocated(error)) call new_pad(contact, grid, height, half_space_pair(steel, steel), friction, near, pad, error)
   end subroutine make_pad

end module support_lap_joint
