!> Keys of `&load`, `&preload`, `&linear_modes`, `&transient` and `&output` (doc/namelists.md).
module microslip_io_case_analyses
   use microslip_core_kinds, only: wp
   use microslip_core_text, only: to_text
   use microslip_io_case, only: load_case_t, preload_case_t, linear_modes_case_t, transient_case_t, &
      output_case_t, name_length
   use microslip_io_group_keys, only: group_keys_t
   use microslip_io_value_range, only: any_value, positive, non_negative, at_least, between
   implicit none(type, external)
   private

   public :: load_keys, preload_keys, linear_modes_keys, transient_keys, output_keys

   !> Most parts of one load, most loads of the preload, most sensors.
   integer, parameter :: most_parts = 8, most_loads = 100, most_sensors = 1000

contains

   !> `&load`.
   subroutine load_keys(keys, record)
      !> The group
      type(group_keys_t), intent(inout) :: keys
      !> Its record
      type(load_case_t), intent(inout) :: record
      integer :: parts

      call keys%name_key('name', record%name)
      call keys%name_key('kind', record%kind, ['nodes ', 'modal ', 'base  ', 'motion'])
      if (record%kind == 'modal') then
         call keys%integer_key('mode', record%mode, at_least(1), required=.true.)
         call keys%ignored(['direction'], "with kind = 'nodes', 'base' or 'motion'", decided_by='kind')
      else
         call keys%ignored(['mode'], "with kind = 'modal'", decided_by='kind')
      end if
      call motion_keys(keys, record)
      if (record%kind == 'base' .or. record%kind == 'motion') then
         call keys%real_table('direction', record%direction, 3, any_value, [1, 1], required=.true.)
         call check_directions(keys, 'direction', record%direction)
      end if
      if (record%kind /= 'nodes') then
         call keys%ignored([character(len=12) :: 'node_set', 'size', 'distribution'], "with kind = 'nodes'", decided_by='kind')
      else
         call keys%name_list('node_set', record%node_set, counts=[1, most_parts], required=.true.)
         parts = most_parts
         if (allocated(record%node_set)) parts = size(record%node_set)
         call keys%real_table('direction', record%direction, 3, any_value, part_count(record%node_set), required=.true.)
         call check_directions(keys, 'direction', record%direction)
         call keys%real_list('size', record%size, any_value, part_count(record%node_set), required=.true.)
         if (keys%is_reading .and. allocated(record%size)) then
            if (any(.not. abs(record%size) > 0.0_wp)) call keys%fault('size', 'numbers other than 0')
         end if
         if (.not. allocated(record%distribution)) then
            allocate (record%distribution(parts))
            record%distribution = 'uniform'
         end if
         call keys%name_list('distribution', record%distribution, [character(len=name_length) :: 'uniform', 'area'], &
            counts=part_count(record%node_set))
      end if
      call keys%finish()
   end subroutine load_keys

   !> How the counter-body of an interface moves.
   subroutine motion_keys(keys, record)
      type(group_keys_t), intent(inout) :: keys
      type(load_case_t), intent(inout) :: record
      real(wp), allocatable :: center(:)

      if (record%kind /= 'motion') then
         call keys%ignored([character(len=9) :: 'interface', 'motion', 'center'], "with kind = 'motion'", decided_by='kind')
         return
      end if
      call keys%name_key('interface', record%interface, required=.true.)
      call keys%name_key('motion', record%motion, ['translation', 'rotation   '])
      if (record%motion == 'rotation') then
         center = record%center
         call keys%real_list('center', center, any_value, [2, 2])
         record%center = center
      else
         call keys%ignored(['center'], "with motion = 'rotation'", decided_by='motion')
      end if
   end subroutine motion_keys

   !> Fewest and most values of a key with one value per node set.
   pure function part_count(node_set) result(counts)
      character(len=*), allocatable, intent(in) :: node_set(:)
      integer :: counts(2)

      counts = [1, most_parts]
      if (allocated(node_set)) counts = size(node_set)
   end function part_count

   !> `&preload`.
   subroutine preload_keys(keys, record)
      !> The group
      type(group_keys_t), intent(inout) :: keys
      !> Its record
      type(preload_case_t), intent(inout) :: record

      call keys%name_list('loads', record%loads, counts=[1, most_loads], required=.true.)
      call keys%real_list('interface_force', record%interface_force, positive, [1, most_loads])
      call keys%real_list('load_scale', record%load_scale, any_value, [1, most_loads])
      call keys%exactly_one([character(len=16) :: 'interface_force', 'load_scale'])
      if (allocated(record%loads) .and. allocated(record%load_scale)) then
         if (size(record%load_scale) /= size(record%loads)) &
            call keys%fault('load_scale', 'one number per load, '//to_text(size(record%loads)))
      end if
      call keys%integer_key('steps', record%steps, at_least(1))
      call keys%finish()
   end subroutine preload_keys

   !> `&linear_modes`.
   subroutine linear_modes_keys(keys, record)
      !> The group
      type(group_keys_t), intent(inout) :: keys
      !> Its record
      type(linear_modes_case_t), intent(inout) :: record

      call keys%integer_key('n_modes', record%n_modes, at_least(1))
      record%asked = record%asked .or. keys%given('n_modes')
      call keys%finish()
   end subroutine linear_modes_keys

   !> `&transient`.
   subroutine transient_keys(keys, record)
      !> The group
      type(group_keys_t), intent(inout) :: keys
      !> Its record
      type(transient_case_t), intent(inout) :: record

      ! Not given: as long as a stepped or swept sine takes.
      if (keys%is_reading .or. record%duration > 0.0_wp) call keys%real_key('duration', record%duration, positive)
      call keys%optional_real('time_step', record%time_step, positive)
      if (allocated(record%time_step)) then
         call keys%ignored(['safety'], 'without time_step')
      else
         call keys%real_key('safety', record%safety, between(0.0_wp, 2.0_wp))
      end if
      call keys%finish()
   end subroutine transient_keys

   !> `&output`. Sensors point along z by default.
   subroutine output_keys(keys, record)
      !> The group
      type(group_keys_t), intent(inout) :: keys
      !> Its record
      type(output_case_t), intent(inout) :: record
      integer :: counts(2)

      call keys%name_key('file', record%file)
      call keys%name_list('sensors', record%sensors, counts=[1, most_sensors])
      counts = [1, most_sensors]
      if (allocated(record%sensors)) then
         counts = size(record%sensors)
         if (.not. allocated(record%sensor_direction)) &
            record%sensor_direction = spread([0.0_wp, 0.0_wp, 1.0_wp], 2, size(record%sensors))
         call keys%real_table('sensor_direction', record%sensor_direction, 3, any_value, counts)
         call check_directions(keys, 'sensor_direction', record%sensor_direction)
      else
         call keys%ignored(['sensor_direction'], 'with sensors', decided_by='sensors')
      end if
      call keys%integer_key('stride', record%stride, at_least(1))
      call keys%real_list('snapshots', record%snapshots, non_negative)
      call keys%real_key('checkpoint_interval', record%checkpoint_interval, positive)
      call keys%integer_key('checkpoint_steps', record%checkpoint_steps, at_least(1))
      call keys%finish()
   end subroutine output_keys

   !> No direction may be the zero vector.
   subroutine check_directions(keys, key, directions)
      type(group_keys_t), intent(inout) :: keys
      character(len=*), intent(in) :: key
      real(wp), allocatable, intent(in) :: directions(:, :)

      if (.not. (keys%is_reading .and. allocated(directions))) return
      if (any(maxval(abs(directions), 1) <= 0.0_wp)) &
         call keys%fault(key, 'three numbers per direction that are not all 0')
   end subroutine check_directions

end module microslip_io_case_analyses
