!> From the records of a case to the objects that compute: FE model, pads, force patterns. Nothing is solved here.
module microslip_cli_scene
   use microslip_cli_plausibility, only: check_base, check_pad, check_sizes, check_units
   use microslip_cli_surface_input, only: read_surface, surface_record_t
   use microslip_core_error, only: bad_input, error_t
   use microslip_core_kinds, only: wp
   use microslip_core_text, only: to_text
   use microslip_core_warning_list, only: severity_doubtful, severity_wrong, warning_list_t
   use microslip_fe_element, only: cross_product
   use microslip_fe_interface, only: contact_interface_t, interface_from_sets, interface_from_plane
   use microslip_fe_interface_mesh, only: interface_mesh_t, measure_interface_mesh
   use microslip_fe_left_out_faces, only: find_left_out, left_out_t
   use microslip_fe_load_pattern, only: base_load, load_vector, sensor_row
   use microslip_fe_mid_sides, only: check_mid_sides
   use microslip_fe_model, only: fe_model_t
   use microslip_fe_matrix_check, only: check_matrices
   use microslip_fe_model_check, only: check_model
   use microslip_fe_model_survey, only: model_survey_t, survey_model
   use microslip_fe_relative_coordinates, only: check_interface_nodes
   use microslip_fe_selection, only: node_text
   use microslip_fe_unit_guess, only: unit_in_si
   use microslip_halfspace_coupling, only: points_on_faces
   use microslip_halfspace_grid, only: be_grid_t, new_grid
   use microslip_halfspace_love_cerruti, only: material_t, elastic_material, half_space_pair
   use microslip_io_calculix, only: read_model_calculix
   use microslip_io_case, only: case_t, interface_case_t, load_case_t
   use microslip_io_model_file, only: read_model_hdf5
   use microslip_io_time_series_file, only: read_time_series
   use microslip_system_jointed_system, only: jointed_system_t
   use microslip_system_pad, only: pad_t, new_pad, new_node_pad
   implicit none(type, external)
   private

   public :: scene_t, table_t, build_scene, read_model, add_motions, contact_interfaces

   !> How far outside the faces a grid point may lie, in face coordinates (width 2): the slivers between the
   !> chords of a meshed outline and the outline itself.
   real(wp), parameter :: overhang = 0.2_wp

   !> Faces left out beside an interface, as a part of its area, from which on the joint is another one.
   real(wp), parameter :: serious_share = 0.05_wp

   !> A function of time.
   type :: table_t
      !> (2, points) s, and value
      real(wp), allocatable :: points(:, :)
   end type table_t

   !> What a case describes, read and checked.
   type :: scene_t
      type(fe_model_t) :: model
      !> What its mesh and matrices show of each other
      type(model_survey_t) :: survey
      type(pad_t), allocatable :: pads(:)
      !> (pads) FE meshes at the interfaces
      type(interface_mesh_t), allocatable :: meshes(:)
      !> (pads) how their surfaces were read
      type(surface_record_t), allocatable :: surfaces(:)
      !> (rows, loads with a force pattern + sensors) N per unit amplitude; sensor rows
      real(wp), allocatable :: patterns(:, :)
      !> (case loads) index of the load in the system: those with a force pattern, the initial pressure if there is one,
      !> motions, modal loads
      integer, allocatable :: load_index(:)
      !> How many loads have a force pattern
      integer :: n_pattern_loads = 0
      !> Names of the system's loads, without the modal ones
      character(len=64), allocatable :: load_names(:)
      !> (excitations) functions of time from files
      type(table_t), allocatable :: tables(:)
      !> What is doubtful about the input
      type(warning_list_t) :: warnings
   end type scene_t

contains

   !> Read the FE model of a case and look at it.
   subroutine read_model(case, model, survey, warnings, error)
      type(case_t), intent(in) :: case
      type(fe_model_t), intent(out) :: model
      !> What mesh and matrices show of each other
      type(model_survey_t), intent(out) :: survey
      !> What is doubtful
      type(warning_list_t), intent(inout) :: warnings
      type(error_t), allocatable, intent(out) :: error

      associate (source => case%model)
         if (source%source == 'hdf5') then
            call read_model_hdf5(case%located(source%file), model, error)
         else
            call read_model_calculix(case%located(source%file), case%located(source%mesh_file), &
               & unit_in_si(source%unit_length), unit_in_si(source%unit_mass), unit_in_si(source%unit_time), model, error, &
               & warnings=warnings)
         end if
      end associate
      if (.not. allocated(error)) then
         call check_mid_sides(model, error)
         if (.not. allocated(error)) call check_model(model, error)
         if (.not. allocated(error)) call survey_model(model, survey)
         if (.not. allocated(error)) call check_matrices(model, survey, warnings, error)
         if (allocated(error)) error%message = case%located(case%model%file)//': '//error%message
      end if
      if (allocated(error)) error%message = case%path//': &model: '//error%message
   end subroutine read_model

   !> Read everything a case names and bring it together.
   subroutine build_scene(case, scene, error)
      type(case_t), intent(in) :: case
      type(scene_t), intent(out) :: scene
      type(error_t), allocatable, intent(out) :: error
      integer :: k

      call read_model(case, scene%model, scene%survey, scene%warnings, error)
      if (allocated(error)) return
      allocate (scene%pads(size(case%interfaces)), scene%meshes(size(case%interfaces)), scene%surfaces(size(case%interfaces)))
      do k = 1, size(case%interfaces)
         call build_pad(case, case%interfaces(k), scene%model, scene%pads(k), scene%surfaces(k), scene%warnings, error)
         if (allocated(error)) return
         scene%meshes(k) = measure_interface_mesh(scene%model, scene%pads(k)%contact)
         call check_pad(case, case%interfaces(k), scene%survey, scene%pads(k), scene%warnings)
      end do
      call check_interface_nodes(scene%model, contact_interfaces(scene), error)
      if (allocated(error)) then
         error%message = case%path//': '//error%message
         return
      end if
      call warn_of_left_out(scene)
      call check_units(case, scene%survey, scene%warnings)
      call check_sizes(case, scene%model, scene%pads, scene%warnings)
      call check_base(case, scene%model, scene%survey, scene%warnings)
      call check_modes(case, scene, error)
      if (.not. allocated(error)) call build_patterns(case, scene, error)
      allocate (scene%tables(size(case%excitations)))
      do k = 1, size(case%excitations)
         if (allocated(error)) return
         if (case%excitations(k)%kind == 'file') call read_time_series(case%located(case%excitations(k)%file), &
            & scene%tables(k)%points, error)
      end do
   end subroutine build_scene

   !> Places beside the interfaces where the bodies meet as well.
   subroutine warn_of_left_out(scene)
      type(scene_t), intent(inout) :: scene
      type(contact_interface_t), allocatable :: contacts(:)
      type(left_out_t), allocatable :: left_out(:)
      integer :: k

      contacts = contact_interfaces(scene)
      call find_left_out(scene%model, contacts, left_out)
      do k = 1, size(left_out)
         associate (found => left_out(k))
            if (found%faces == 0) cycle
            call scene%warnings%add(merge(severity_wrong, severity_doubtful, found%area > serious_share*found%area_of_interface), &
               & "interface '"//contacts(k)%name//"': the bodies meet beside it too: "//to_text(found%faces)//' faces with '// &
               & to_text(100.0_wp*found%area/found%area_of_interface, 3)//' % of its area are left out on each side, first at '// &
               & node_text(scene%model, found%first_node)//'; they carry nothing: should their nodes be in the node sets?')
         end associate
      end do
   end subroutine warn_of_left_out

   !> The model has as many modes.
   subroutine check_modes(case, scene, error)
      type(case_t), intent(in) :: case
      type(scene_t), intent(in) :: scene
      type(error_t), allocatable, intent(out) :: error
      integer :: k, most

      if (.not. allocated(case%reduction%n_modes)) return
      most = scene%model%row_count()
      if (case%reduction%method == 'craig_bampton_massless') &
         & most = most - sum([(scene%pads(k)%boundary_count(), k=1, size(scene%pads))])
      if (case%reduction%n_modes > most) call bad_input(error, case%path//': &reduction: n_modes = ' &
         & //to_text(case%reduction%n_modes)//': allowed: an integer <= '//to_text(most)//', the model has no more modes')
   end subroutine check_modes

   !> One interface: node pairs, grid, surface, half space.
   subroutine build_pad(case, record, model, pad, surface, warnings, error)
      type(case_t), intent(in) :: case
      type(interface_case_t), intent(in) :: record
      type(fe_model_t), intent(in) :: model
      type(pad_t), intent(out) :: pad
      type(surface_record_t), intent(out) :: surface
      type(warning_list_t), intent(inout) :: warnings
      type(error_t), allocatable, intent(out) :: error
      type(contact_interface_t) :: contact
      type(be_grid_t) :: grid
      type(material_t) :: body(2)
      real(wp), allocatable :: height(:)
      integer :: k

      call find_interface(record, model, contact, error)
      if (allocated(error)) then
         error%message = case%path//': '//error%message
         return
      end if
      if (record%grid == 'fe_nodes') then
         call new_node_pad(contact, record%friction, pad, error)
         grid = pad%grid
      else
         call make_grid(record, contact, grid, error)
      end if
      if (.not. allocated(error)) call read_surface(case, record, grid, height, surface, warnings, error)
      if (record%grid == 'fe_nodes') then
         if (.not. allocated(error)) pad%height = height
      else
         do k = 1, size(record%young_modulus)
            if (.not. allocated(error)) call elastic_material(body(k), record%young_modulus(k), record%poisson_ratio(k), error)
         end do
         if (.not. allocated(error)) call new_pad(contact, grid, height, half_space_pair(body(1), body(2)), record%friction, &
            & overhang, pad, error, scale_split=record%coupling == 'scale_split')
      end if
      if (allocated(record%initial_pressure)) pad%initial_pressure = record%initial_pressure
      if (allocated(error)) error%message = case%path//": interface '"//trim(record%name)//"': "//error%message
   end subroutine build_pad

   !> Node pairs of an interface, from node sets or from a plane.
   subroutine find_interface(record, model, contact, error)
      type(interface_case_t), intent(in) :: record
      type(fe_model_t), intent(in) :: model
      type(contact_interface_t), intent(out) :: contact
      type(error_t), allocatable, intent(out) :: error
      real(wp), allocatable :: region(:, :)

      if (record%side_a /= '') then
         call interface_from_sets(model, trim(record%name), trim(record%side_a), trim(record%side_b), contact, &
            & tangent=record%axis_1, error=error)
      else
         if (allocated(record%region)) region = transpose(reshape(record%region, [2, 3]))
         call interface_from_plane(model, trim(record%name), record%plane_point, record%plane_normal, contact, &
            & region=region, tangent=record%axis_1, error=error)
      end if
   end subroutine find_interface

   !> The boundary-element grid: extent, holes, and cut where there is no face.
   subroutine make_grid(record, contact, grid, error)
      type(interface_case_t), intent(in) :: record
      type(contact_interface_t), intent(in) :: contact
      type(be_grid_t), intent(out) :: grid
      type(error_t), allocatable, intent(out) :: error
      real(wp) :: lower(2), upper(2)
      real(wp), allocatable :: holes(:, :)
      logical, allocatable :: mask(:, :)

      lower = minval(contact%position, dim=2)
      upper = maxval(contact%position, dim=2)
      if (allocated(record%extent)) then
         lower = record%extent([1, 3])
         upper = record%extent([2, 4])
      end if
      allocate (holes(3, 0))
      if (allocated(record%holes)) holes = record%holes
      ! First the whole rectangle, to learn which cells lie on faces.
      call new_grid(grid, lower, upper, record%nx, record%ny, error)
      if (allocated(error)) return
      mask = reshape(points_on_faces(contact, grid%position, overhang), [record%nx, record%ny])
      call new_grid(grid, lower, upper, record%nx, record%ny, error, holes=holes, mask=mask)
   end subroutine make_grid

   !> Force patterns of the loads, then the sensor rows.
   subroutine build_patterns(case, scene, error)
      type(case_t), intent(in) :: case
      type(scene_t), intent(inout) :: scene
      type(error_t), allocatable, intent(out) :: error
      real(wp), allocatable :: part(:)
      integer :: k, n_sensors

      n_sensors = 0
      if (allocated(case%output%sensors)) n_sensors = size(case%output%sensors)
      call list_loads(case, scene)
      allocate (scene%patterns(scene%model%row_count(), scene%n_pattern_loads + n_sensors), source=0.0_wp)
      do k = 1, size(case%loads)
         if (any(case%loads(k)%kind == [character(len=6) :: 'modal', 'motion'])) cycle
         call add_parts(case, k, scene%model, scene%patterns(:, scene%load_index(k)), error)
         if (allocated(error)) return
      end do
      do k = 1, n_sensors
         call sensor_row(scene%model, trim(case%output%sensors(k)), case%output%sensor_direction(:, k), part, error)
         if (allocated(error)) then
            error%message = case%path//': &output: sensors: '//error%message
            return
         end if
         scene%patterns(:, scene%n_pattern_loads + k) = part
      end do
   end subroutine build_patterns

   !> The node pairs of all interfaces. (As an array constructor gfortran 12 would lose their memory.)
   function contact_interfaces(scene) result(interfaces)
      type(scene_t), intent(in) :: scene
      type(contact_interface_t), allocatable :: interfaces(:)
      integer :: k

      allocate (interfaces(size(scene%pads)))
      do k = 1, size(interfaces)
         interfaces(k) = scene%pads(k)%contact
      end do
   end function contact_interfaces

   !> The loads in the order that they have in the system.
   subroutine list_loads(case, scene)
      type(case_t), intent(in) :: case
      type(scene_t), intent(inout) :: scene
      integer :: kind_of(size(case%loads)), k, rank, n

      kind_of = 1
      where (case%loads%kind == 'motion') kind_of = 2
      where (case%loads%kind == 'modal') kind_of = 3
      scene%n_pattern_loads = count(kind_of == 1)
      allocate (scene%load_index(size(case%loads)))
      n = 0
      do rank = 1, 3
         do k = 1, size(case%loads)
            if (kind_of(k) /= rank) cycle
            n = n + 1
            scene%load_index(k) = n
         end do
         if (rank == 1 .and. any(scene%pads%initial_pressure > 0.0_wp)) n = n + 1
      end do
      allocate (scene%load_names(n - count(kind_of == 3)))
      scene%load_names = 'initial pressure'
      do k = 1, size(case%loads)
         if (kind_of(k) < 3) scene%load_names(scene%load_index(k)) = case%loads(k)%name
      end do
   end subroutine list_loads

   !> The motions of counter-bodies join the system.
   subroutine add_motions(case, system)
      type(case_t), intent(in) :: case
      type(jointed_system_t), intent(inout) :: system
      integer :: k

      do k = 1, size(case%loads)
         if (case%loads(k)%kind /= 'motion') cycle
         associate (pad => case%find_interface(case%loads(k)%interface))
            call system%add_motion(pad, motion_shape(case%loads(k), system%pads(pad)%grid%position))
         end associate
      end do
   end subroutine add_motions

   !> Displacement of the points of a rigid body, along n, t1, t2, (3, points), per m of a translation or rad of a rotation.
   pure function motion_shape(load, position) result(shape)
      type(load_case_t), intent(in) :: load
      !> (2, points) m
      real(wp), intent(in) :: position(:, :)
      real(wp) :: shape(3, size(position, 2)), along(3)
      integer :: p

      along = load%direction(:, 1)/norm2(load%direction(:, 1))
      shape = spread(along, 2, size(position, 2))
      if (load%motion == 'translation') return
      do p = 1, size(position, 2)
         shape(:, p) = cross_product(along, [0.0_wp, position(:, p) - load%center])
      end do
   end function motion_shape

   !> The force vector of one load: the sum of its parts.
   subroutine add_parts(case, index, model, pattern, error)
      type(case_t), intent(in) :: case
      integer, intent(in) :: index
      type(fe_model_t), intent(in) :: model
      real(wp), intent(inout) :: pattern(:)
      type(error_t), allocatable, intent(out) :: error
      real(wp), allocatable :: part(:)
      integer :: k

      associate (load => case%loads(index))
         if (load%kind == 'base') then
            call base_load(model, load%direction(:, 1), part, error)
            if (allocated(error)) then
               error%message = case%path//": load '"//trim(load%name)//"': "//error%message
            else
               pattern = part
            end if
            return
         end if
         do k = 1, size(load%node_set)
            call load_vector(model, trim(load%node_set(k)), load%direction(:, k), load%size(k), &
               & trim(load%distribution(k)), part, error)
            if (allocated(error)) then
               error%message = case%path//": load '"//trim(load%name)//"': "//error%message
               return
            end if
            pattern = pattern + part
         end do
      end associate
   end subroutine add_parts

end module microslip_cli_scene
