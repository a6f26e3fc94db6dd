!> Contact points at the FE nodes, rigid ground, imposed motions of it, and initial pressures.
module test_system_node_contact
   use microslip_analysis_excitation, only: excitation_t, kind_table
   use microslip_analysis_linear_modes, only: linear_modes_t, solve_linear_modes
   use microslip_analysis_operating_state, only: operating_state_t, undeformed_state
   use microslip_analysis_preload, only: preload_options_t, preload_record_t, run_preload
   use microslip_analysis_transient, only: transient_record_t
   use microslip_contact_factory, only: contact_options_t
   use microslip_contact_laws, only: state_slip, state_stick
   use microslip_contact_problem, only: gap_of
   use microslip_core_error, only: error_t
   use microslip_core_kinds, only: pi, wp
   use microslip_fe_interface, only: contact_interface_t, interface_from_sets
   use microslip_fe_model, only: fe_model_t
   use microslip_fe_reduced_model, only: reduced_model_t
   use microslip_fe_reduction, only: reduce, reduction_options_t
   use microslip_halfspace_coupling, only: coupling_t
   use microslip_halfspace_grid, only: be_grid_t, new_grid
   use microslip_halfspace_love_cerruti, only: elastic_material, half_space_pair, material_t
   use microslip_halfspace_node_points, only: consistent_areas, points_at_nodes
   use microslip_io_calculix, only: read_model_calculix
   use microslip_system_jointed_system, only: jointed_system_t, new_system
   use microslip_system_pad, only: new_node_pad, new_pad, pad_t
   use support_brick, only: block_model, block_t, facing_interface, to_dense, two_blocks
   use support_checks, only: good
   use support_history, only: history_t, integrate
   use testdrive, only: check, new_unittest, test_failed, testing_error => error_type, unittest_type
   implicit none(type, external)
   private

   public :: collect_system_node_contact

   !> Rounding of sums over some ten to hundred terms, and the same times the condition of the small models.
   real(wp), parameter :: rounding = 1.0e-13_wp, tolerance = 1.0e-9_wp
   !> The block on the ground: m, m, and Pa.
   real(wp), parameter :: extent(3) = [0.06_wp, 0.04_wp, 0.03_wp], modulus = 2.0e11_wp

contains

   subroutine collect_system_node_contact(testsuite)
      type(unittest_type), allocatable, intent(out) :: testsuite(:)

      testsuite = [new_unittest('areas of 4-node faces', test_areas_of_4), &
         & new_unittest('areas of 8-node faces: patch test with C3D20R', test_areas_of_8), &
         & new_unittest('no face, no area', test_no_face), &
         & new_unittest('block pressed by rigid ground: uniform pressure', test_patch), &
         & new_unittest('the limit of rigid half spaces', test_rigid_half_space), &
         & new_unittest('initial pressure: equilibrium, stuck modes, rest', test_initial_pressure), &
         & new_unittest('initial pressure: what a load takes off', test_relief), &
         & new_unittest('gaps at all points under a motion', test_gaps), &
         & new_unittest('mass on moving ground: stick, then steady sliding', test_sliding)]
   end subroutine collect_system_node_contact

   !> The contact solver of all these tests.
   function condensed() result(options)
      type(contact_options_t) :: options
      options%solver = 'condensed'
   end function condensed

   !> Every pair a point of its own; the areas are the integrals of the shape functions, on skewed faces too.
   subroutine test_areas_of_4(error)
      type(testing_error), allocatable, intent(out) :: error
      type(fe_model_t) :: model
      type(contact_interface_t), allocatable :: joints(:)
      type(error_t), allocatable :: lib
      type(be_grid_t) :: grid
      type(coupling_t) :: coupling
      integer :: k

      call two_blocks(model, joints, [4, 3, 1])
      associate (joint => joints(1))
         ! A shear with a bend keeps the outline's area: x + 0.2 y + 20 y^2 has determinant 1.
         joint%position(1, :) = joint%position(1, :) + 0.2_wp*joint%position(2, :)
         call points_at_nodes(joint, grid, coupling, lib)
         call good(error, lib)
         if (allocated(error)) return
         call check(error, sum(grid%area), 0.04_wp*0.045_wp, rel=.true., thr=rounding)
         if (allocated(error)) return
         ! Every corner node of an inner pair belongs to four parallelograms.
         call check(error, maxval(grid%area), 0.015_wp*0.04_wp/3.0_wp, rel=.true., thr=rounding)
         if (allocated(error)) return
         call check(error, all(coupling%pair == [(k, k=1, joint%pair_count())]) .and. all(coupling%weight == 1.0_wp), &
            & 'W is not the identity')
         if (allocated(error)) return
         call check(error, all(grid%position == joint%position) .and. .not. grid%regular)
      end associate
   end subroutine test_areas_of_4

   !> The nodal forces of a uniform pressure on C3D20R elements (from the matrix that CalculiX wrote) are W times pressure
   !> times area; linear fields are interpolated exactly, so moments are kept.
   subroutine test_areas_of_8(error)
      type(testing_error), allocatable, intent(out) :: error
      character(len=*), parameter :: base = 'test/data/joined_blocks'
      real(wp), parameter :: strain = 1.0e-3_wp, bottom = -0.02_wp, young = 2.1e11_wp, nu = 0.3_wp, digits = 1.0e-9_wp
      type(fe_model_t) :: model
      type(contact_interface_t) :: joint
      type(error_t), allocatable :: lib
      type(be_grid_t) :: grid
      type(coupling_t) :: coupling
      real(wp), allocatable :: u(:), f(:), lambda(:, :), nodal(:, :), place(:, :), gap(:, :)
      integer, allocatable :: rows(:, :)
      real(wp) :: stress

      call read_model_calculix(base, base//'.inp', 1.0e-3_wp, 1.0e3_wp, 1.0_wp, model, lib)
      if (.not. allocated(lib)) call interface_from_sets(model, 'joint', 'joint_upper', 'joint_lower', joint, error=lib)
      if (.not. allocated(lib)) call points_at_nodes(joint, grid, coupling, lib)
      call good(error, lib)
      if (allocated(error)) return
      call check(error, minval(grid%area) > 0.0_wp .and. any(consistent_areas(joint) < 0.0_wp))
      if (allocated(error)) return
      call check(error, sum(grid%area), 0.024_wp*0.018_wp, rel=.true., thr=rounding)
      if (allocated(error)) return

      ! Uniaxial strain of the lower block, which is fixed at its bottom; the upper one stays.
      rows = model%rows_of_nodes()
      u = merge(strain*(model%coordinates(3, model%row_node) - bottom), 0.0_wp, model%row_component == 3)
      u(pack(rows, spread(model%coordinates(3, :) > 1.0e-6_wp, 1, 3) .and. rows > 0)) = 0.0_wp
      u(pack(rows(:, joint%node_a), rows(:, joint%node_a) > 0)) = 0.0_wp
      f = matmul(to_dense(model%stiffness), u)
      stress = young*(1.0_wp - nu)/((1.0_wp + nu)*(1.0_wp - 2.0_wp*nu))*strain
      allocate (lambda(3, grid%point_count()), nodal(3, grid%point_count()), source=0.0_wp)
      lambda(1, :) = stress*grid%area
      call coupling%distribute(lambda, nodal)
      call check(error, maxval(abs(nodal(1, :) - f(rows(3, joint%node_b)))) <= digits*maxval(abs(nodal)), &
         & 'uniform stress and uniform pressure differ')
      if (allocated(error)) return

      place = reshape([0.0_wp*joint%position(1, :), joint%position(1, :), joint%position(2, :)], [joint%pair_count(), 3])
      place = transpose(place)
      allocate (gap, mold=place)
      call coupling%interpolate(place, gap)
      call check(error, maxval(abs(gap - place)) <= rounding, 'a linear field is not kept')
   end subroutine test_areas_of_8

   !> A pair that no face holds up is refused.
   subroutine test_no_face(error)
      type(testing_error), allocatable, intent(out) :: error
      type(fe_model_t) :: model
      type(contact_interface_t), allocatable :: joints(:)
      type(error_t), allocatable :: lib
      type(be_grid_t) :: grid
      type(coupling_t) :: coupling

      call two_blocks(model, joints, [2, 1, 1])
      joints(1)%faces = joints(1)%faces(:, :0)
      call points_at_nodes(joints(1), grid, coupling, lib)
      if (.not. allocated(lib)) then
         call test_failed(error, 'points without an area were taken')
      else
         call check(error, index(lib%message, 'no area') > 0, lib%message)
      end if
   end subroutine test_no_face

   !> A block held at its top over rigid ground, with the points at its nodes. Poisson's ratio 0 by default.
   subroutine make_block(friction, pressure, system, lib, poisson_ratio)
      real(wp), intent(in) :: friction, pressure
      type(jointed_system_t), intent(out) :: system
      type(error_t), allocatable, intent(out) :: lib
      real(wp), intent(in), optional :: poisson_ratio
      type(pad_t) :: pad
      type(reduced_model_t) :: reduced
      type(contact_interface_t) :: contact

      call reduce_block(reduced, contact, lib, poisson_ratio)
      if (.not. allocated(lib)) call new_node_pad(contact, friction, pad, lib)
      if (allocated(lib)) return
      pad%initial_pressure = pressure
      call finish_block(reduced, pad, system, lib)
   end subroutine make_block

   !> The block alone. Pattern 1: 1 N on the ends x = max along x, pattern 2 the same nodes as a sensor along z.
   subroutine reduce_block(reduced, contact, lib, poisson_ratio)
      type(reduced_model_t), intent(out) :: reduced
      type(contact_interface_t), intent(out) :: contact
      type(error_t), allocatable, intent(out) :: lib
      real(wp), intent(in), optional :: poisson_ratio
      type(fe_model_t) :: model
      type(block_t) :: block
      type(reduction_options_t) :: options
      real(wp), allocatable :: patterns(:, :)
      integer, allocatable :: rows(:, :), loaded(:)
      integer :: c

      block = block_t('block', [0.0_wp, 0.0_wp, 0.0_wp], extent, [3, 2, 2], modulus, 0.0_wp)
      if (present(poisson_ratio)) block%poisson_ratio = poisson_ratio
      call block_model([block], ['block_zmax'], model)
      contact = facing_interface(model, 'block_zmin', '', 'ground')
      rows = model%rows_of_nodes()
      allocate (patterns(model%row_count(), 2), source=0.0_wp)
      do c = 1, 2
         loaded = rows(2*c - 1, model%node_sets(model%find_node_set('block_xmax'))%nodes)
         loaded = pack(loaded, loaded > 0)
         patterns(loaded, c) = 1.0_wp/size(loaded)
      end do
      options%method = 'craig_bampton_massless'
      options%modes = 6
      call reduce(model, [contact], patterns, options, reduced, lib)
   end subroutine reduce_block

   !> The system with load 1, the initial pressure if there is one, and the ground moving along n, t1 as the last two.
   subroutine finish_block(reduced, pad, system, lib)
      type(reduced_model_t), intent(in) :: reduced
      type(pad_t), intent(in) :: pad
      type(jointed_system_t), intent(out) :: system
      type(error_t), allocatable, intent(out) :: lib
      integer :: c

      call new_system(reduced, [pad], 1, spread(10.0_wp, 1, size(reduced%frequency)), system, lib)
      if (.not. allocated(lib)) call system%restrict(spread(.true., 1, system%grid_point_count()), lib)
      if (allocated(lib)) return
      do c = 1, 2
         call system%add_motion(1, spread(merge([1.0_wp, 0.0_wp, 0.0_wp], [0.0_wp, 1.0_wp, 0.0_wp], c == 1), 2, &
            & pad%grid%point_count()))
      end do
   end subroutine finish_block

   !> With Poisson's ratio 0 the ground that moves up by s presses with E s/height everywhere.
   subroutine test_patch(error)
      type(testing_error), allocatable, intent(out) :: error
      real(wp), parameter :: s = 2.0e-6_wp
      type(jointed_system_t) :: system
      type(operating_state_t) :: state
      type(preload_record_t) :: record
      type(preload_options_t) :: options
      type(error_t), allocatable :: lib
      real(wp) :: pressure, force

      call make_block(0.3_wp, 0.0_wp, system, lib)
      options%loads = [2]
      options%scale = [s]
      options%steps = 3
      if (.not. allocated(lib)) call run_preload(system, options, condensed(), state, record, lib)
      call good(error, lib)
      if (allocated(error)) return
      pressure = modulus*s/extent(3)
      force = pressure*extent(1)*extent(2)
      associate (lambda => state%contact%force, area => system%pads(1)%grid%area)
         call check(error, maxval(abs(lambda(1, :)/area - pressure)) <= tolerance*pressure, 'the pressure is not uniform')
         if (allocated(error)) return
         call check(error, maxval(abs(lambda(2:, :))) <= tolerance*force, 'there is friction')
      end associate
      if (allocated(error)) return
      call check(error, record%interface_force(1), force, rel=.true., thr=tolerance)
      if (allocated(error)) return
      call check(error, record%elastic_energy, 0.5_wp*force*s, rel=.true., thr=tolerance)
      if (allocated(error)) return
      call check(error, record%work, 0.5_wp*force*s, rel=.true., thr=tolerance)
   end subroutine test_patch

   !> Half spaces stiffer by 1e8 on cells whose centres are the nodes: the same forces, to about that ratio.
   subroutine test_rigid_half_space(error)
      type(testing_error), allocatable, intent(out) :: error
      real(wp), parameter :: ratio = 1.0e8_wp, alike = 1.0e-6_wp
      type(jointed_system_t) :: at_nodes, at_cells
      type(operating_state_t) :: state, other
      type(preload_record_t) :: record
      type(reduced_model_t) :: reduced
      type(contact_interface_t) :: contact
      type(preload_options_t) :: options
      type(pad_t) :: pad
      type(be_grid_t) :: grid
      type(material_t) :: body
      type(error_t), allocatable :: lib
      real(wp) :: half(2)
      integer :: p, q

      call reduce_block(reduced, contact, lib, 0.3_wp)
      if (.not. allocated(lib)) call make_block(0.3_wp, 0.0_wp, at_nodes, lib, 0.3_wp)
      half = 0.5_wp*extent(:2)/[3, 2]
      if (.not. allocated(lib)) call new_grid(grid, minval(contact%position, dim=2) - half, &
         & maxval(contact%position, dim=2) + half, 4, 3, lib)
      if (.not. allocated(lib)) call elastic_material(body, ratio*modulus, 0.3_wp, lib)
      if (.not. allocated(lib)) call new_pad(contact, grid, spread(0.0_wp, 1, 12), half_space_pair(body, body), 0.3_wp, &
         & 1.0e-6_wp, pad, lib)
      if (.not. allocated(lib)) call finish_block(reduced, pad, at_cells, lib)
      options%loads = [2, 1]
      options%scale = [2.0e-6_wp, 3000.0_wp]
      options%steps = 4
      if (.not. allocated(lib)) call run_preload(at_nodes, options, condensed(), state, record, lib)
      if (.not. allocated(lib)) call run_preload(at_cells, options, condensed(), other, record, lib)
      call good(error, lib)
      if (allocated(error)) return
      call check(error, any(state%contact%status == state_slip), 'nothing slips')
      do p = 1, 12
         if (allocated(error)) return
         q = minloc(norm2(grid%position - spread(contact%position(:, p), 2, 12), dim=1), dim=1)
         call check(error, maxval(abs(state%contact%force(:, p) - other%contact%force(:, q))) &
            & <= alike*maxval(state%contact%force), 'forces differ')
      end do
   end subroutine test_rigid_half_space

   !> Under an initial pressure the undeformed structure is in equilibrium: with lambda = p A, all points stuck, and modes
   !> that are the tied ones where the points are the nodes; it stays at rest. With half spaces the same, but softer modes.
   subroutine test_initial_pressure(error)
      type(testing_error), allocatable, intent(out) :: error
      real(wp), parameter :: pressure = 3.0e6_wp
      type(jointed_system_t) :: system
      type(operating_state_t) :: state
      type(preload_record_t) :: record
      type(linear_modes_t) :: modes
      type(history_t) :: history
      type(transient_record_t) :: summary
      type(error_t), allocatable :: lib
      logical :: nodes
      integer :: form

      do form = 1, 2
         nodes = form == 1
         if (nodes) then
            call make_block(0.3_wp, pressure, system, lib, 0.3_wp)
         else
            call pressed_half_space(pressure, system, lib)
         end if
         if (.not. allocated(lib)) call run_preload(system, preload_options_t(loads=[1], scale=[0.0_wp]), condensed(), &
            & state, record, lib)
         call good(error, lib)
         if (allocated(error)) return
         call check_rest(error, system, state, pressure, tolerance)
         if (allocated(error)) return
         call check(error, abs(record%elastic_energy) + abs(record%work) + abs(record%friction_loss) <= tolerance, 'energies')
         if (allocated(error)) return

         state = undeformed_state(system)
         call check_rest(error, system, state, pressure, 0.0_wp)
         if (allocated(error)) return
         call check(error, maxval(abs(gap_of(system%problem, state%contact%q, state%contact%force))) <= tolerance*1.0e-6_wp, &
            & 'there is a gap')
         if (allocated(error)) return
         call solve_linear_modes(system, state%contact%status, system%n_modes, modes, lib)
         call good(error, lib)
         if (allocated(error)) return
         if (nodes) then
            call check(error, all(abs(modes%frequency/system%frequency - 1.0_wp) <= tolerance), 'not the tied modes')
         else
            call check(error, all(modes%frequency < system%frequency*(1.0_wp + tolerance)), 'stiffer than tied')
         end if
         if (allocated(error)) return

         call integrate(system, state, 0.5_wp/system%highest_angular_frequency(), 100, [excitation_t ::], condensed(), &
            & history, summary, lib)
         call good(error, lib)
         if (allocated(error)) return
         call check(error, maxval(abs(history%sensor())) <= tolerance*1.0e-6_wp, 'it does not stay at rest')
         if (allocated(error)) return
         deallocate (history%samples)
      end do
   end subroutine test_initial_pressure

   !> The block with half spaces of unequal bodies on a grid, under an initial pressure.
   subroutine pressed_half_space(pressure, system, lib)
      real(wp), intent(in) :: pressure
      type(jointed_system_t), intent(out) :: system
      type(error_t), allocatable, intent(out) :: lib
      type(reduced_model_t) :: reduced
      type(contact_interface_t) :: contact
      type(material_t) :: body(2)
      type(be_grid_t) :: grid
      type(pad_t) :: pad

      call reduce_block(reduced, contact, lib, 0.3_wp)
      if (.not. allocated(lib)) call new_grid(grid, minval(contact%position, dim=2), maxval(contact%position, dim=2), 6, 4, lib)
      if (.not. allocated(lib)) call elastic_material(body(1), modulus, 0.3_wp, lib)
      if (.not. allocated(lib)) call elastic_material(body(2), 0.5_wp*modulus, 0.2_wp, lib)
      if (.not. allocated(lib)) call new_pad(contact, grid, spread(0.0_wp, 1, 24), half_space_pair(body(1), body(2)), 0.3_wp, &
         & 1.0e-6_wp, pad, lib)
      if (allocated(lib)) return
      pad%initial_pressure = pressure
      call finish_block(reduced, pad, system, lib)
   end subroutine pressed_half_space

   !> lambda = p A, no motion of anything, all points stuck.
   subroutine check_rest(error, system, state, pressure, allowed)
      type(testing_error), allocatable, intent(out) :: error
      type(jointed_system_t), intent(in) :: system
      type(operating_state_t), intent(in) :: state
      real(wp), intent(in) :: pressure
      !> Relative
      real(wp), intent(in) :: allowed
      real(wp) :: force(3, system%problem%n_points)

      force = 0.0_wp
      force(1, :) = pressure*system%pads(1)%grid%area
      call check(error, maxval(abs(state%contact%force - force)) <= allowed*maxval(force), 'lambda is not p A')
      if (allocated(error)) return
      call check(error, all(state%contact%status == state_stick), 'not all points stick')
      if (allocated(error)) return
      ! A modal coordinate of the size of the static one under the whole force would be some 1e-6.
      call check(error, maxval(abs(state%modal)) <= allowed*1.0e-6_wp, 'the modes moved')
      if (allocated(error)) return
      call check(error, maxval(abs(system%sensor_values(state%modal, state%contact%force, state%amplitude))) &
         & <= max(allowed, rounding)*1.0e-6_wp, 'the sensor moved')
   end subroutine check_rest

   !> The ground moves away: the pressure falls by E s/height, and the contact opens where s takes all of it off.
   subroutine test_relief(error)
      type(testing_error), allocatable, intent(out) :: error
      real(wp), parameter :: pressure = 4.0e6_wp
      type(jointed_system_t) :: system
      type(operating_state_t) :: state
      type(preload_record_t) :: record
      type(error_t), allocatable :: lib
      real(wp) :: s

      call make_block(0.3_wp, pressure, system, lib)
      s = 0.25_wp*pressure*extent(3)/modulus
      ! Loads: 1 the force, 2 the pressure, 3 and 4 the motions.
      if (.not. allocated(lib)) call run_preload(system, preload_options_t(loads=[3], scale=[-s]), condensed(), &
         & state, record, lib)
      call good(error, lib)
      if (allocated(error)) return
      call check(error, maxval(abs(state%contact%force(1, :)/system%pads(1)%grid%area - 0.75_wp*pressure)) &
         & <= tolerance*pressure, 'not three quarters of the pressure')
      if (allocated(error)) return
      call check(error, state%amplitude(2), 1.0_wp)
      if (allocated(error)) return
      call run_preload(system, preload_options_t(loads=[3], scale=[-6.0_wp*s]), condensed(), state, record, lib)
      call good(error, lib)
      if (allocated(error)) return
      call check(error, maxval(abs(state%contact%force)), 0.0_wp)
      if (allocated(error)) return
      call check(error, maxval(abs(state%contact%gap(1, :) - 2.0_wp*s)) <= tolerance*s, 'gap: what is left of the motion')
   end subroutine test_relief

   !> Both ways to all gaps, points left out included, agree with the contact problem's.
   subroutine test_gaps(error)
      type(testing_error), allocatable, intent(out) :: error
      type(jointed_system_t) :: system
      type(error_t), allocatable :: lib
      real(wp), allocatable :: force(:, :), all_gaps(:, :), normal(:), gap(:, :), modal(:), amplitude(:)
      integer :: k, form

      do form = 1, 2
         if (form == 1) then
            call make_block(0.3_wp, 1.0e6_wp, system, lib, 0.3_wp)
         else
            call pressed_half_space(1.0e6_wp, system, lib)
         end if
         call good(error, lib)
         if (allocated(error)) return
         force = reshape([(100.0_wp*sin(real(k, wp)), k=1, 3*system%problem%n_points)], [3, system%problem%n_points])
         modal = [(1.0e-6_wp*cos(real(k, wp)), k=1, system%n_modes)]
         amplitude = [1000.0_wp, 1.0_wp, 3.0e-6_wp, -2.0e-6_wp]
         gap = gap_of(system%problem, [modal, amplitude], force)
         all_gaps = system%gaps_everywhere(modal, force, amplitude)
         allocate (normal(size(all_gaps, 2)))
         call system%normal_gaps_everywhere(modal, force, amplitude, normal)
         call check(error, maxval(abs(gap - all_gaps)) <= tolerance*maxval(abs(gap)), 'gaps everywhere')
         if (allocated(error)) return
         call check(error, maxval(abs(gap(1, :) - normal)) <= tolerance*maxval(abs(gap)), 'normal gaps everywhere')
         if (allocated(error)) return
         deallocate (normal)
      end do
   end subroutine test_gaps

   !> A mass m = 1 kg on a spring k, coupled by springs k_b to four contact points under an initial pressure, on a ground
   !> that moves with speed V: the points stick until 4 k_b (s - u) reaches mu N, then slide for good with
   !>     u'' + d u' + k u = mu N,      u -> mu N/k,     power of the ground mu N V, of which mu N (V - u') is lost.
   subroutine test_sliding(error)
      type(testing_error), allocatable, intent(out) :: error
      real(wp), parameter :: k = 1.0e4_wp, k_b = 1.0e5_wp, pressure = 2.0e4_wp, mu = 0.5_wp, side = 0.1_wp, V = 0.5_wp
      real(wp), parameter :: duration = 0.4_wp, dt = 1.0e-5_wp, damping = 100.0_wp
      type(jointed_system_t) :: system
      type(operating_state_t) :: state
      type(excitation_t) :: belt
      type(history_t) :: history
      type(transient_record_t) :: summary
      type(error_t), allocatable :: lib
      real(wp) :: normal, middle, omega, u, sigma
      integer :: steps

      normal = pressure*side**2
      call make_mass(k, k_b, side, pressure, mu, damping, system, lib)
      if (.not. allocated(lib)) call system%add_motion(1, spread([0.0_wp, 1.0_wp, 0.0_wp], 2, 4))
      call good(error, lib)
      if (allocated(error)) return
      belt = excitation_t(load=2, kind=kind_table, amplitude=1.0_wp)
      belt%table = reshape([0.0_wp, 0.0_wp, duration, V*duration], [2, 2])
      state = undeformed_state(system)
      steps = nint(duration/dt)
      call integrate(system, state, dt, steps, [belt], condensed(), history, summary, lib)
      call good(error, lib)
      if (allocated(error)) return
      associate (samples => history%samples)
         ! Stuck at first, slipping at all points in the end.
         call check(error, samples(2)%counts(2) == 4 .and. samples(steps + 1)%counts(3) == 4, 'stick, then slip')
         if (allocated(error)) return
         ! What is left of the oscillation after 20 of its times of decay is 2e-9.
         call check(error, samples(steps + 1)%sensor(1), mu*normal/k, rel=.true., thr=1.0e-6_wp)
         if (allocated(error)) return
         middle = samples(steps/2)%time
         call check(error, samples(steps + 1)%energy%external_work - samples(steps/2)%energy%external_work, &
            & mu*normal*V*(duration - middle), rel=.true., thr=1.0e-9_wp)
         if (allocated(error)) return
         call check(error, samples(steps + 1)%energy%friction_loss - samples(steps/2)%energy%friction_loss, &
            & mu*normal*(V*(duration - middle) - samples(steps + 1)%sensor(1) + samples(steps/2)%sensor(1)), rel=.true., &
            & thr=1.0e-9_wp)
         if (allocated(error)) return
         ! Friction is booked with the force at the end of a step: of first order in the one step where the slip begins.
         call check(error, abs(samples(steps + 1)%energy%balance_error) <= mu*normal*V*dt, 'the balance does not close')
         if (allocated(error)) return
         ! While everything sticks: u'' + d u' + (k + 4 k_b) u = 4 k_b V t, by its closed form from rest. It begins like t^3,
         ! of which the leapfrog makes t^3 (1 - 1/n^2) in n steps.
         omega = sqrt(k + 4.0_wp*k_b)
         sigma = 0.5_wp*damping
         steps = nint(0.2_wp*mu*normal/(4.0_wp*k_b*V)/dt)
         call check(error, all([samples(steps)%counts == [0, 4, 0]]), 'slip begins early')
         if (allocated(error)) return
         u = stuck_motion(samples(steps)%time)
         call check(error, samples(steps)%sensor(1), u, rel=.true., thr=1.1_wp/(steps - 1)**2)
      end associate

   contains

      !> u(t) of the mass dragged by the ground through the springs.
      pure real(wp) function stuck_motion(t)
         real(wp), intent(in) :: t
         real(wp) :: damped, slope, offset

         damped = sqrt(omega**2 - sigma**2)
         slope = 4.0_wp*k_b*V/omega**2
         offset = -slope*damping/omega**2
         ! u = slope t + offset + exp(-sigma t)(A cos + B sin), u(0) = u'(0) = 0
         stuck_motion = slope*t + offset + exp(-sigma*t)*(-offset*cos(damped*t) &
            & + (-slope - sigma*offset)/damped*sin(damped*t))
      end function stuck_motion

   end subroutine test_sliding

   !> The mass as a reduced model: one modal coordinate, four node pairs of one square face. Sensor: the mass.
   subroutine make_mass(k, k_b, side, pressure, mu, damping, system, lib)
      real(wp), intent(in) :: k, k_b, side, pressure, mu, damping
      type(jointed_system_t), intent(out) :: system
      type(error_t), allocatable, intent(out) :: lib
      type(contact_interface_t) :: contact
      type(reduced_model_t) :: reduced
      type(pad_t) :: pad
      integer :: j

      contact%name = 'belt'
      contact%frame = reshape([0.0_wp, 0.0_wp, 1.0_wp, 1.0_wp, 0.0_wp, 0.0_wp, 0.0_wp, 1.0_wp, 0.0_wp], [3, 3])
      contact%node_a = [1, 2, 3, 4]
      contact%node_b = [0, 0, 0, 0]
      contact%position = side*reshape([0.0_wp, 0.0_wp, 1.0_wp, 0.0_wp, 1.0_wp, 1.0_wp, 0.0_wp, 1.0_wp], [2, 4])
      contact%faces = reshape([1, 2, 3, 4, 0, 0, 0, 0], [8, 1])
      reduced%method = 'macneal'
      reduced%frequency = [sqrt(k + 4.0_wp*k_b)/(2.0_wp*pi)]
      allocate (reduced%K_ii(1, 1), source=k + 4.0_wp*k_b)
      allocate (reduced%K_bi(12, 1), reduced%K_bb(12, 12), reduced%pattern_b(12, 1), source=0.0_wp)
      allocate (reduced%pattern_i(1, 1), source=1.0_wp)
      do j = 1, 12
         reduced%K_bb(j, j) = k_b
      end do
      reduced%K_bi(2::3, 1) = -k_b
      call new_node_pad(contact, mu, pad, lib)
      if (allocated(lib)) return
      pad%initial_pressure = pressure
      call new_system(reduced, [pad], 0, [damping], system, lib)
      if (.not. allocated(lib)) call system%restrict(spread(.true., 1, 4), lib)
   end subroutine make_mass

end module test_system_node_contact
