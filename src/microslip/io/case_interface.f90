!> Keys of `&interface` and `&topography` (doc/namelists.md).
module microslip_io_case_interface
   use microslip_core_kinds, only: wp
   use microslip_core_text, only: lower_case, to_text
   use microslip_io_case, only: interface_case_t, topography_case_t, name_length
   use microslip_io_group_keys, only: group_keys_t
   use microslip_io_value_range, only: any_value, positive, non_negative, at_least, between
   implicit none(type, external)
   private

   public :: interface_keys, topography_keys

   character(len=*), parameter :: length_units(4) = ['m ', 'mm', 'um', 'nm'], layouts(2) = ['z[x,y]', 'z[y,x]']
   integer, parameter :: most_cells = 10000, most_holes = 20

contains

   !> `&interface`.
   subroutine interface_keys(keys, record)
      !> The group
      type(group_keys_t), intent(inout) :: keys
      !> Its record
      type(interface_case_t), intent(inout) :: record

      call keys%name_key('name', record%name)
      call place_keys(keys, record)
      call keys%real_list('axis_1', record%axis_1, any_value, [3, 3])
      call check_direction(keys, 'axis_1', record%axis_1)
      call keys%real_key('friction', record%friction, non_negative, required=.true.)
      call keys%name_key('grid', record%grid, ['half_space', 'fe_nodes  '])
      if (record%grid == 'fe_nodes') then
         call keys%ignored([character(len=13) :: 'young_modulus', 'poisson_ratio', 'nx', 'ny', 'extent', 'holes', &
            'coupling'], &
            "with grid = 'half_space'", decided_by='grid')
      else
         call grid_keys(keys, record)
      end if
      call keys%optional_real('initial_pressure', record%initial_pressure, positive)
      if (allocated(record%initial_pressure)) then
         call keys%ignored(['topography'], 'without initial_pressure', decided_by='initial_pressure')
      else
         call keys%name_key('topography', record%topography)
      end if
      call keys%name_key('potential', record%potential, ['auto', 'all '])
      if (record%potential == 'auto') then
         call keys%optional_real('potential_margin', record%potential_margin, positive)
      else
         call keys%ignored(['potential_margin'], "with potential = 'auto'", decided_by='potential')
      end if
      call keys%finish()
   end subroutine interface_keys

   !> Half spaces and the grid of their boundary elements.
   subroutine grid_keys(keys, record)
      type(group_keys_t), intent(inout) :: keys
      type(interface_case_t), intent(inout) :: record
      logical :: needed

      needed = keys%sound('grid')
      call material_keys(keys, record, needed)
      call keys%integer_key('nx', record%nx, at_least(1, most_cells), required=needed)
      call keys%integer_key('ny', record%ny, at_least(1, most_cells), required=needed)
      call keys%real_list('extent', record%extent, any_value, [4, 4])
      call check_box(keys, 'extent', record%extent)
      call keys%real_table('holes', record%holes, 3, any_value, [1, most_holes])
      if (has_elastic_ground(record)) record%coupling = 'series'
      call keys%name_key('coupling', record%coupling, ['series     ', 'scale_split'])
      if (keys%is_reading .and. has_elastic_ground(record) .and. record%coupling /= 'series') call keys%fault('coupling', &
         & "'series', or one young_modulus: elastic ground is not in the FE model, which has to hold the long waves of both bodies")
      if (.not. (keys%is_reading .and. allocated(record%holes))) return
      if (any(record%holes(3, :) <= 0.0_wp)) call keys%fault('holes', 'x, y, radius of every hole, with a radius > 0')
   end subroutine grid_keys

   !> The two ways to say where the interface is: two node sets, or a plane.
   subroutine place_keys(keys, record)
      type(group_keys_t), intent(inout) :: keys
      type(interface_case_t), intent(inout) :: record
      logical :: by_plane

      by_plane = allocated(record%plane_point)
      if (keys%is_reading) by_plane = keys%given('plane_point') .and. .not. keys%given('side_a')
      if (by_plane) then
         call keys%real_list('plane_point', record%plane_point, any_value, [3, 3], required=.true.)
         call keys%real_list('plane_normal', record%plane_normal, any_value, [3, 3], required=.true.)
         call check_direction(keys, 'plane_normal', record%plane_normal)
         call keys%real_list('region', record%region, any_value, [6, 6])
         call check_box(keys, 'region', record%region)
         call keys%ignored(['side_b'], 'with side_a')
      else
         call keys%exactly_one([character(len=12) :: 'side_a', 'plane_point'])
         call keys%name_key('side_a', record%side_a, required=keys%given('side_a'))
         call keys%name_key('side_b', record%side_b, required=keys%given('side_a'))
         if (lower_case(record%side_b) == 'ground') record%side_b = 'ground'
         if (keys%is_reading .and. record%side_a /= '' .and. lower_case(record%side_a) == lower_case(record%side_b)) &
            call keys%fault('side_b', "another node set than side_a, or 'ground'")
         call keys%ignored([character(len=12) :: 'plane_normal', 'region'], 'with plane_point', decided_by='plane_point')
      end if
   end subroutine place_keys

   !> Elastic constants: one value serves both bodies, except for ground, which is rigid then.
   subroutine material_keys(keys, record, needed)
      type(group_keys_t), intent(inout) :: keys
      type(interface_case_t), intent(inout) :: record
      !> Whether a missing one is a fault
      logical, intent(in) :: needed
      integer :: bodies

      call keys%real_list('young_modulus', record%young_modulus, positive, [1, 2], required=needed)
      call keys%real_list('poisson_ratio', record%poisson_ratio, &
         between(-1.0_wp, 0.5_wp, closed_upper=.true.), [1, 2], required=needed)
      if (.not. keys%is_reading) return
      if (.not. (allocated(record%young_modulus) .and. allocated(record%poisson_ratio))) return
      bodies = 2
      if (record%side_b == 'ground') bodies = size(record%young_modulus)
      if (size(record%young_modulus) < bodies) record%young_modulus = spread(record%young_modulus(1), 1, bodies)
      if (size(record%poisson_ratio) < bodies) record%poisson_ratio = spread(record%poisson_ratio(1), 1, bodies)
      if (size(record%poisson_ratio) > bodies) call keys%fault('poisson_ratio', &
         "one value: the ground is rigid, young_modulus has one value")
   end subroutine material_keys

   !> Whether the ground deforms as a half space without being in the FE model.
   pure logical function has_elastic_ground(record)
      type(interface_case_t), intent(in) :: record

      has_elastic_ground = .false.
      if (allocated(record%young_modulus)) has_elastic_ground = record%side_b == 'ground' .and. size(record%young_modulus) > 1
   end function has_elastic_ground

   !> `&topography`.
   subroutine topography_keys(keys, record)
      !> The group
      type(group_keys_t), intent(inout) :: keys
      !> Its record
      type(topography_case_t), intent(inout) :: record
      real(wp), allocatable :: offset(:)

      call keys%name_key('name', record%name)
      call keys%name_key('source', record%source, [character(len=name_length) :: 'flat', 'hill', 'file'], required=.true.)
      if (record%source == 'hill') then
         call keys%real_key('height', record%height, non_negative, required=.true.)
         call keys%real_list('center', record%center, any_value, [2, 2])
      else
         call keys%ignored([character(len=8) :: 'height', 'center'], "with source = 'hill'", decided_by='source')
      end if
      if (record%source == 'file') then
         call keys%name_key('file', record%file, required=.true.)
         call keys%name_key('x_name', record%x_name)
         call keys%name_key('y_name', record%y_name)
         call keys%name_key('z_name', record%z_name)
         if (keys%is_reading .or. record%unit_length /= '') &
            call keys%name_key('unit_length', record%unit_length, length_units)
         if (keys%is_reading .or. record%layout /= '') call keys%name_key('layout', record%layout, layouts)
         call keys%name_key('sense', record%sense, ['height', 'gap   '], required=.true.)
      else
         call keys%ignored([character(len=12) :: 'file', 'x_name', 'y_name', 'z_name', 'unit_length', 'layout', &
            'sense'], &
            "with source = 'file'", decided_by='source')
      end if
      if (record%source /= 'flat') then
         offset = record%offset
         call keys%name_key('level', record%level, ['none ', 'mean ', 'plane'])
         if (record%source == 'file') then
            call keys%optional_real('filter_wavelength', record%filter_wavelength, positive)
         else
            call keys%ignored(['filter_wavelength'], "with source = 'file' (a hill has no short waves)", decided_by='source')
         end if
         call keys%real_list('offset', offset, any_value, [2, 2])
         record%offset = offset
         call keys%real_key('rotation', record%rotation, any_value)
         call keys%real_key('scale', record%scale, any_value)
      else
         call keys%ignored([character(len=20) :: 'level', 'filter_wavelength', 'offset', 'rotation', 'scale'], &
            "with source = 'hill' or 'file'", decided_by='source')
      end if
      call keys%finish()
   end subroutine topography_keys

   !> A direction must not be the zero vector.
   subroutine check_direction(keys, key, direction)
      type(group_keys_t), intent(inout) :: keys
      character(len=*), intent(in) :: key
      real(wp), allocatable, intent(in) :: direction(:)

      if (.not. (keys%is_reading .and. allocated(direction))) return
      if (maxval(abs(direction)) <= 0.0_wp) call keys%fault(key, 'three numbers that are not all 0')
   end subroutine check_direction

   !> Pairs min, max must ascend.
   subroutine check_box(keys, key, box)
      type(group_keys_t), intent(inout) :: keys
      character(len=*), intent(in) :: key
      real(wp), allocatable, intent(in) :: box(:)

      if (.not. (keys%is_reading .and. allocated(box))) return
      if (any(box(1::2) >= box(2::2))) call keys%fault(key, to_text(size(box)/2)//' pairs of numbers, min < max')
   end subroutine check_box

end module microslip_io_case_interface
