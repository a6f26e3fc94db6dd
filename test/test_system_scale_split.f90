!> The scale-split coupling in the whole system: matrix = operator, positive definite, one law for points in and out of the
!> potential contact set, and the identity C_s + W^T F_s W = C on a disc inside a pad.
module test_system_scale_split
   use microslip_analysis_operating_state, only: operating_state_t
   use microslip_analysis_preload, only: preload_record_t
   use microslip_analysis_statics, only: static_problem
   use microslip_contact_factory, only: contact_options_t
   use microslip_contact_problem, only: contact_problem_t, gap_of
   use microslip_core_error, only: error_t
   use microslip_core_kinds, only: wp
   use microslip_fe_interface, only: contact_interface_t
   use microslip_fe_interface_mesh, only: interface_mesh_t, measure_interface_mesh
   use microslip_fe_model, only: fe_model_t, node_set_t
   use microslip_fe_reduced_model, only: reduced_model_t
   use microslip_fe_reduction, only: reduce, reduction_options_t
   use microslip_halfspace_grid, only: be_grid_t, new_grid
   use microslip_halfspace_love_cerruti, only: elastic_material, half_space_pair, material_t, rigid_material
   use microslip_halfspace_scale_filter, only: new_scale_filter
   use microslip_linalg_dense, only: eigen_symmetric
   use microslip_system_compliance_choice, only: compliance_dense, compliance_fft
   use microslip_system_coupling_error, only: coupling_error_t, estimate_coupling_error
   use microslip_system_jointed_system, only: jointed_system_t, new_system
   use microslip_system_pad, only: new_pad, pad_t
   use support_brick, only: block_model, block_t, facing_interface
   use support_checks, only: good
   use support_joint, only: make_joint, preload_joint
   use testdrive, only: check, new_unittest, testing_error => error_type, unittest_type
   implicit none(type, external)
   private

   public :: collect_system_scale_split

   !> Rounding of a product, relative; solver tolerance, and what it leaves of forces.
   real(wp), parameter :: rounding = 1.0e-13_wp, tolerance = 1.0e-10_wp, agreement = 1.0e-7_wp
   !> m, of the hills: without and with points that never close
   real(wp), parameter :: low = 2.0e-6_wp, high = 3.0e-5_wp

contains

   subroutine collect_system_scale_split(testsuite)
      type(unittest_type), allocatable, intent(out) :: testsuite(:)

      testsuite = [ &
         & new_unittest('operator = matrix', test_products), &
         & new_unittest('symmetric positive definite', test_definite), &
         & new_unittest('points left out follow the same law', test_everywhere), &
         & new_unittest('matrices anew on other points', test_other_points), &
         & new_unittest('preload: operator = matrix', test_preload), &
         & new_unittest('half space made up again on a disc', test_identity)]
   end subroutine collect_system_scale_split

   !> The made-up joint with the scale-split coupling.
   subroutine split_joint(form, cells, peak_to_peak, system, lib, leave_out)
      integer, intent(in) :: form, cells(2)
      real(wp), intent(in) :: peak_to_peak
      type(jointed_system_t), intent(out) :: system
      type(error_t), allocatable, intent(out) :: lib
      !> Leave out every so manyth point
      integer, intent(in), optional :: leave_out
      type(reduced_model_t) :: reduced
      logical, allocatable :: potential(:)
      integer :: k

      call make_joint(cells(1), cells(2), peak_to_peak, reduced, system, lib)
      do k = 1, size(system%pads)
         if (allocated(lib)) return
         allocate (system%pads(k)%filter)
         call new_scale_filter(system%pads(k)%filter, system%pads(k)%contact, system%pads(k)%grid, 1.0e-6_wp, lib)
      end do
      system%compliance = form
      allocate (potential(system%grid_point_count()), source=.true.)
      if (present(leave_out)) potential(leave_out::leave_out) = .false.
      if (.not. allocated(lib)) call system%restrict(potential, lib)
   end subroutine split_joint

   !> G of dynamics and of statics, with points left out.
   subroutine test_products(error)
      type(testing_error), allocatable, intent(out) :: error
      type(error_t), allocatable :: lib
      type(jointed_system_t) :: dense, fft
      type(contact_problem_t) :: static_dense, static_fft
      real(wp), allocatable :: response(:, :)

      call split_joint(compliance_dense, [11, 8], low, dense, lib, leave_out=3)
      if (.not. allocated(lib)) call split_joint(compliance_fft, [11, 8], low, fft, lib, leave_out=3)
      if (.not. allocated(lib)) call static_problem(dense, [1, 2], static_dense, response, lib)
      if (.not. allocated(lib)) call static_problem(fft, [1, 2], static_fft, response, lib)
      call good(error, lib)
      if (allocated(error)) return
      call compare(dense%problem, fft%problem)
      if (allocated(error)) return
      call compare(static_dense, static_fft)

   contains

      subroutine compare(with_matrix, with_operator)
         type(contact_problem_t), intent(in) :: with_matrix, with_operator
         real(wp), allocatable :: force(:, :), one(:, :), other(:, :)
         real(wp) :: q(size(with_matrix%R, 2))

         q = 0.0_wp
         allocate (force(3, with_matrix%n_points))
         call random_number(force)
         force(2:3, :) = force(2:3, :) - 0.5_wp
         one = gap_of(with_matrix, q, force)
         other = gap_of(with_operator, q, force)
         call check(error, maxval(abs(one - other)) <= rounding*maxval(abs(one)), 'products differ')
      end subroutine compare

   end subroutine test_products

   subroutine test_definite(error)
      type(testing_error), allocatable, intent(out) :: error
      type(error_t), allocatable :: lib
      type(jointed_system_t) :: system
      real(wp), allocatable :: G(:, :), values(:)

      call split_joint(compliance_dense, [14, 9], low, system, lib)
      call good(error, lib)
      if (allocated(error)) return
      G = system%problem%G
      call check(error, maxval(abs(G - transpose(G))) <= 0.0_wp, 'not symmetric')
      if (allocated(error)) return
      allocate (values(size(G, 1)))
      call eigen_symmetric(G, values, lib, values_only=.true.)
      call good(error, lib)
      if (allocated(error)) return
      call check(error, minval(values) > 0.0_wp, 'not positive definite')
   end subroutine test_definite

   !> Gaps at all grid points, from the fields, agree with those of the contact problem where it has the points.
   subroutine test_everywhere(error)
      type(testing_error), allocatable, intent(out) :: error
      type(error_t), allocatable :: lib
      type(jointed_system_t) :: system
      real(wp), allocatable :: force(:, :), q(:), gap(:, :), everywhere(:, :), normal(:)
      logical, allocatable :: potential(:)
      integer :: k

      call split_joint(compliance_dense, [11, 8], low, system, lib, leave_out=4)
      call good(error, lib)
      if (allocated(error)) return
      allocate (force(3, system%problem%n_points), q(system%n_modes + system%n_loads), normal(system%grid_point_count()))
      call random_number(force)
      call random_number(q)
      q = 1.0e-4_wp*q
      gap = gap_of(system%problem, q, force)
      everywhere = system%gaps_everywhere(q(:system%n_modes), force, q(system%n_modes + 1:))
      call system%normal_gaps_everywhere(q(:system%n_modes), force, q(system%n_modes + 1:), normal)
      potential = [(mod(k, 4) /= 0, k=1, system%grid_point_count())]
      do k = 1, 3
         call check(error, maxval(abs(gap(k, :) - pack(everywhere(k, :), potential))) <= rounding*maxval(abs(everywhere)), 'gap')
         if (allocated(error)) return
      end do
      call check(error, maxval(abs(normal - everywhere(1, :))) <= rounding*maxval(abs(everywhere)), 'normal gap')
   end subroutine test_everywhere

   !> What is kept from one choice of the points to the next changes nothing: the same bits as without.
   subroutine test_other_points(error)
      type(testing_error), allocatable, intent(out) :: error
      type(error_t), allocatable :: lib
      type(jointed_system_t) :: once, again
      integer :: k

      call split_joint(compliance_dense, [11, 8], low, once, lib, leave_out=4)
      if (.not. allocated(lib)) call split_joint(compliance_dense, [11, 8], low, again, lib, leave_out=3)
      if (.not. allocated(lib)) call again%restrict([(mod(k, 4) /= 0, k=1, again%grid_point_count())], lib)
      call good(error, lib)
      if (allocated(error)) return
      call check(error, all(shape(once%problem%G) == shape(again%problem%G)), 'points')
      if (allocated(error)) return
      call check(error, all(once%problem%G == again%problem%G), 'matrices')
   end subroutine test_other_points

   subroutine test_preload(error)
      type(testing_error), allocatable, intent(out) :: error
      type(error_t), allocatable :: lib
      type(jointed_system_t) :: dense, fft
      type(operating_state_t) :: a, b
      type(preload_record_t) :: record
      type(contact_options_t) :: options

      options%tolerance = tolerance
      call split_joint(compliance_dense, [20, 14], high, dense, lib)
      if (.not. allocated(lib)) call split_joint(compliance_fft, [20, 14], high, fft, lib)
      options%solver = 'condensed'
      if (.not. allocated(lib)) call preload_joint(dense, options, a, record, lib)
      options%solver = 'matrix_free'
      if (.not. allocated(lib)) call preload_joint(fft, options, b, record, lib)
      call good(error, lib)
      if (allocated(error)) return
      call check(error, dense%problem%n_points == fft%problem%n_points .and. dense%problem%n_points < dense%grid_point_count(), &
         & 'points in potential contact')
      if (allocated(error)) return
      call check(error, maxval(abs(a%contact%force - b%contact%force)) <= agreement*maxval(a%contact%force), 'forces')
   end subroutine test_preload

   !> A steel block pressed on rigid ground by the middle of its lower face: the coupling makes up the half space again;
   !> the series coupling is about twice as soft.
   subroutine test_identity(error)
      type(testing_error), allocatable, intent(out) :: error
      type(error_t), allocatable :: lib
      type(coupling_error_t) :: split, series
      !> What a full-integration brick mesh with layers as thick as its elements are wide reaches
      real(wp), parameter :: mesh_error = 0.10_wp

      call block_on_ground(.true., split, lib)
      if (.not. allocated(lib)) call block_on_ground(.false., series, lib)
      call good(error, lib)
      if (allocated(error)) return
      call check(error, split%radius > 0.0_wp .and. all(split%deviation <= mesh_error), 'scale split')
      if (allocated(error)) return
      call check(error, all(series%deviation > 0.7_wp), 'series')
   end subroutine test_identity

   subroutine block_on_ground(scale_split, estimate, lib)
      logical, intent(in) :: scale_split
      type(coupling_error_t), intent(out) :: estimate
      type(error_t), allocatable, intent(out) :: lib
      !> m
      real(wp), parameter :: element = 3.0e-3_wp
      integer, parameter :: wide = 18, deep = 7, pad_elements = 10, cells = 30
      type(fe_model_t) :: model
      type(contact_interface_t) :: contact
      type(interface_mesh_t) :: mesh
      type(reduction_options_t) :: options
      type(reduced_model_t) :: reduced
      type(be_grid_t) :: grid
      type(material_t) :: steel
      type(pad_t) :: pad
      type(jointed_system_t) :: system
      real(wp), allocatable :: patterns(:, :)
      integer :: set

      call block_model([block_t('block', element*[-0.5_wp*wide, -0.5_wp*wide, 0.0_wp], element*[wide, wide, deep], &
         & [wide, wide, deep])], ['block_zmax'], model)
      set = model%find_node_set('block_zmin')
      associate (nodes => model%node_sets(set)%nodes)
         model%node_sets = [model%node_sets, node_set_t('middle', pack(nodes, &
            & all(abs(model%coordinates(:2, nodes)) < element*(0.5_wp*pad_elements + 0.1_wp), dim=1)))]
      end associate
      contact = facing_interface(model, 'middle', '', 'pad')
      allocate (patterns(model%row_count(), 0))
      options%method = 'craig_bampton_massless'
      options%modes = 3
      call reduce(model, [contact], patterns, options, reduced, lib)
      if (allocated(lib)) return
      call new_grid(grid, minval(contact%position, 2), maxval(contact%position, 2), cells, cells, lib)
      if (.not. allocated(lib)) call elastic_material(steel, 2.0e11_wp, 0.3_wp, lib)
      if (.not. allocated(lib)) call new_pad(contact, grid, spread(0.0_wp, 1, grid%point_count()), &
         & half_space_pair(steel, rigid_material()), 0.5_wp, 1.0e-6_wp, pad, lib, scale_split=scale_split)
      if (.not. allocated(lib)) call new_system(reduced, [pad], 0, spread(0.0_wp, 1, 3), system, lib)
      if (allocated(lib)) return
      mesh = measure_interface_mesh(model, contact)
      call estimate_coupling_error(system, 1, mesh%spacing, estimate, lib)
   end subroutine block_on_ground

end module test_system_scale_split
