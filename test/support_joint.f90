!> A made-up structure with two interfaces for tests of what comes after the reduction: no mesh matrices, plausible
!> stiffnesses. The surfaces are hills with a square bore; with a fine grid the rim never closes.
module support_joint
   use microslip_analysis_operating_state, only: operating_state_t
   use microslip_analysis_potential_set, only: choose_potential_set
   use microslip_analysis_preload, only: preload_options_t, preload_record_t, run_preload
   use microslip_contact_factory, only: contact_options_t
   use microslip_core_error, only: error_t
   use microslip_core_kinds, only: wp, pi
   use microslip_fe_interface, only: contact_interface_t, interface_from_sets
   use microslip_fe_reduced_model, only: reduced_model_t
   use microslip_halfspace_coupling, only: points_on_faces
   use microslip_halfspace_grid, only: be_grid_t, new_grid
   use microslip_halfspace_love_cerruti, only: material_t, elastic_material, half_space_pair
   use microslip_surface_topography, only: hill_t, new_hill
   use microslip_system_jointed_system, only: jointed_system_t, new_system
   use microslip_system_pad, only: pad_t, new_pad
   use support_mesh, only: two_blocks, pad_size, pseudo_random
   implicit none(type, external)
   private

   public :: make_joint, preload_joint, load_names, sensor_names

   integer, parameter :: n_modes = 6, n_loads = 3, n_sensors = 2
   character(len=*), parameter :: load_names(n_loads) = ['bolt_1', 'bolt_2', 'impact']
   character(len=*), parameter :: sensor_names(n_sensors) = ['mid_span', 'tip     ']
   !> N
   real(wp), parameter :: interface_force = 2210.0_wp

contains

   !> Two pads of nx x ny cells on six modes. Loads: two bolts and an impact on the modes; two sensors.
   subroutine make_joint(nx, ny, peak_to_peak, reduced, system, error)
      integer, intent(in) :: nx, ny
      !> m, of the hills
      real(wp), intent(in) :: peak_to_peak
      type(reduced_model_t), intent(out) :: reduced
      type(jointed_system_t), intent(out) :: system
      type(error_t), allocatable, intent(out) :: error
      type(pad_t) :: pads(2)
      real(wp), parameter :: damping_ratio = 1.0e-3_wp
      integer :: k

      do k = 1, 2
         call make_pad(nx, ny, peak_to_peak, k, pads(k), error)
         if (allocated(error)) return
      end do
      call make_reduced(pads(1)%contact, reduced)
      call new_system(reduced, pads, n_loads, 4.0_wp*pi*damping_ratio*reduced%frequency, system, error)
   end subroutine make_joint

   subroutine make_pad(nx, ny, peak_to_peak, which, pad, error)
      integer, intent(in) :: nx, ny, which
      real(wp), intent(in) :: peak_to_peak
      type(pad_t), intent(out) :: pad
      type(error_t), allocatable, intent(out) :: error
      type(contact_interface_t) :: contact
      type(be_grid_t) :: grid
      type(hill_t) :: hill
      type(material_t) :: steel
      real(wp), allocatable :: height(:)
      real(wp), parameter :: overhang = 1.0e-6_wp

      call interface_from_sets(two_blocks('C3D8I', [5, 3, 1], hole=.true.), trim(merge('left ', 'right', which == 1)), &
         & 'top_pad', 'bottom_pad', contact, error=error)
      if (.not. allocated(error)) call new_grid(grid, -0.5_wp*pad_size, 0.5_wp*pad_size, nx, ny, error)
      if (.not. allocated(error)) call new_grid(grid, -0.5_wp*pad_size, 0.5_wp*pad_size, nx, ny, error, &
         & mask=reshape(points_on_faces(contact, grid%position), [nx, ny]))
      if (.not. allocated(error)) call new_hill(hill, -0.5_wp*pad_size, 0.5_wp*pad_size, &
         & [0.002_wp*(2*which - 3), 0.0_wp], peak_to_peak, error)
      if (.not. allocated(error)) call hill%heights(grid%position, height, error)
      if (.not. allocated(error)) call elastic_material(steel, 194.0e9_wp, 0.2854_wp, error)
      if (.not. allocated(error)) call new_pad(contact, grid, height, half_space_pair(steel, steel), 0.6_wp, overhang, &
         & pad, error)
   end subroutine make_pad

   !> K_bb = K_s + alpha^T Lambda alpha, K_bi = -alpha^T Lambda with a smooth alpha and a local K_s.
   subroutine make_reduced(contact, reduced)
      !> Of both pads
      type(contact_interface_t), intent(in) :: contact
      type(reduced_model_t), intent(out) :: reduced
      !> N/m: of a node pair, of a whole pad against rigid motion
      real(wp), parameter :: local_stiffness = 2.0e8_wp, support = 2.0e7_wp
      real(wp), allocatable :: alpha(:, :), place(:, :)
      real(wp) :: lambda(n_modes)
      integer :: pairs, n, k, p, pad, row, c

      pairs = contact%pair_count()
      n = 6*pairs
      place = contact%position/spread(pad_size, 2, pairs)
      reduced%method = 'craig_bampton_massless'
      reduced%frequency = [220.0_wp, 265.0_wp, 640.0_wp, 1225.0_wp, 1900.0_wp, 2600.0_wp]
      reduced%tied_modes = n_modes
      lambda = (2.0_wp*pi*reduced%frequency)**2
      allocate (alpha(n_modes, n), reduced%K_ii(n_modes, n_modes), reduced%K_bb(n, n), source=0.0_wp)
      do pad = 1, 2
         do p = 1, pairs
            row = 3*((pad - 1)*pairs + p) - 2
            do k = 1, n_modes
               ! Bending tilts the pads, shear moves them along t1.
               alpha(k, row) = 0.25_wp*place(1, p)*(pseudo_random(k) - 0.2_wp)
               alpha(k, row + 1) = 6.0_wp*(pseudo_random(10*k + pad) - 0.3_wp)/pairs
               alpha(k, row + 2) = 2.0_wp*(pseudo_random(30*k + pad) - 0.5_wp)/pairs
            end do
            do c = 0, 2
               reduced%K_bb(row + c, row + c) = local_stiffness
               reduced%K_bb(row + c, [(3*((pad - 1)*pairs + k) - 2 + c, k=1, pairs)]) = &
                  & reduced%K_bb(row + c, [(3*((pad - 1)*pairs + k) - 2 + c, k=1, pairs)]) &
                  & + (support - local_stiffness)/pairs
            end do
         end do
      end do
      do k = 1, n_modes
         reduced%K_ii(k, k) = lambda(k)
      end do
      reduced%K_bi = -transpose(alpha)*spread(lambda, 1, n)
      reduced%K_bb = reduced%K_bb + matmul(transpose(alpha), -transpose(reduced%K_bi))
      allocate (reduced%pattern_i(n_modes, n_loads + n_sensors), reduced%pattern_b(n, n_loads + n_sensors), source=0.0_wp)
      do pad = 1, 2
         reduced%pattern_b([(3*((pad - 1)*pairs + p) - 2, p=1, pairs)], pad) = -1.0_wp/pairs
      end do
      reduced%pattern_i(:, 3) = [1.0_wp, 0.2_wp, 0.3_wp, 0.1_wp, 0.05_wp, 0.02_wp]
      reduced%pattern_i(:, 4) = [0.8_wp, 0.1_wp, -0.6_wp, 0.2_wp, 0.5_wp, -0.1_wp]
      reduced%pattern_i(:, 5) = [0.2_wp, 1.2_wp, 0.6_wp, -0.9_wp, 0.4_wp, 0.3_wp]
      reduced%record%rows = 3*n
   end subroutine make_reduced

   !> Choose the potential contact set and press the interfaces together.
   subroutine preload_joint(system, contact, state, record, error)
      type(jointed_system_t), intent(inout) :: system
      type(contact_options_t), intent(in) :: contact
      type(operating_state_t), intent(out) :: state
      type(preload_record_t), intent(out) :: record
      type(error_t), allocatable, intent(out) :: error
      type(preload_options_t) :: options

      options%loads = [1, 2]
      options%interface_force = [interface_force, interface_force]
      call choose_potential_set(system, options, [.false., .false.], [-1.0_wp, -1.0_wp], error)
      if (.not. allocated(error)) call run_preload(system, options, contact, state, record, error)
   end subroutine preload_joint

end module support_joint
