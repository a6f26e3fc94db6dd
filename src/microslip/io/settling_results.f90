!> Impact sequences in the result file: /settling, beside the time series there (doc/results.md).
module microslip_io_settling_results
   use microslip_analysis_operating_state, only: operating_state_t
   use microslip_analysis_settling, only: settling_record_t
   use microslip_core_error, only: error_t
   use microslip_core_kinds, only: wp
   use microslip_io_contact_fields, only: contact_fields, field_maps_t, field_t, fields, interface_group
   use microslip_io_hdf5, only: hdf5_file_t
   use microslip_io_interface_maps, only: map_axes, write_map, write_maps
   use microslip_system_jointed_system, only: jointed_system_t
   implicit none(type, external)
   private

   public :: write_settling

   !> What there is of every impact, in the order of `values_of`.
   type(field_t), parameter :: residual_fields(5) = [ &
      & field_t('slip_ratio', '1', 'residual friction stress over friction coefficient times pressure; NaN where open'), &
      & field_t('slip_1', 'm', 'residual slip along t1 (x) since the start; NaN where a point was open'), &
      & field_t('slip_2', 'm', 'residual slip along t2 (y) since the start; NaN where a point was open'), &
      & field_t('largest_slip_ratio', '1', 'largest slip ratio since the residual state before'), &
      & field_t('largest_slip', 'm', 'largest distance from the residual state before, where the motion turns')]

contains

   !> Write what the impacts left, and the equilibrium in the end. The interfaces must have been written.
   subroutine write_settling(file, system, amplitude, record, state, error)
      !> Open result file
      type(hdf5_file_t), intent(in) :: file
      type(jointed_system_t), intent(in) :: system
      !> (impacts) factors on the load pattern
      real(wp), intent(in) :: amplitude(:)
      type(settling_record_t), intent(in) :: record
      !> Equilibrium in the end
      type(operating_state_t), intent(in) :: state
      type(error_t), allocatable, intent(out) :: error
      type(field_maps_t), allocatable :: maps(:)
      integer :: f, k, first

      call file%write('/settling/amplitude', amplitude, '1', '[impact]: factor on the load pattern', error)
      if (.not. allocated(error)) call file%write('/settling/static_position', positions(record), 'm', &
         & '[impact, sensor]: mean displacement at the sensors before the next impact; row 0 before the first', error)
      if (.not. allocated(error)) call file%write('/settling/rest/residual', record%residual, '1', &
         & 'largest violation of the contact laws over the contact force on the way to rest', error)
      if (.not. allocated(error)) call file%write('/settling/rest/error_estimate', record%error_estimate, '1', &
         & 'largest estimated error over the contact force on the way to rest', error)
      if (.not. allocated(error)) call file%write('/settling/rest/modal_displacement', state%modal, 'm sqrt(kg)', &
         & '[mode]: modal coordinates of the equilibrium in the end', error)
      maps = contact_fields(system, state%contact)
      first = 0
      do k = 1, size(system%pads)
         do f = 1, size(residual_fields)
            call put_fields(file, system, record, k, first, f, error)
         end do
         do f = 1, size(fields)
            call write_map(file, system%pads(k)%grid, '/'//interface_group(k), '/settling/rest/'//interface_group(k)//'/' &
               & //trim(fields(f)%name), maps(k)%map(:, :, f), trim(fields(f)%units), trim(fields(f)%description), error)
         end do
         first = first + system%pads(k)%grid%point_count()
      end do
   end subroutine write_settling

   !> Mean displacements, (sensors, 1 + impacts).
   pure function positions(record) result(sensor)
      type(settling_record_t), intent(in) :: record
      real(wp), allocatable :: sensor(:, :)
      integer :: k

      allocate (sensor(size(record%after(0)%sensor), 0:ubound(record%after, 1)))
      do k = 0, ubound(record%after, 1)
         sensor(:, k) = record%after(k)%sensor
      end do
   end function positions

   !> One field of one interface after all impacts.
   subroutine put_fields(file, system, record, k, first, f, error)
      type(hdf5_file_t), intent(in) :: file
      type(jointed_system_t), intent(in) :: system
      type(settling_record_t), intent(in) :: record
      !> Interface, grid points before its own, field
      integer, intent(in) :: k, first, f
      type(error_t), allocatable, intent(inout) :: error
      real(wp), allocatable :: maps(:, :, :)
      character(len=:), allocatable :: path
      type(field_t) :: field
      integer :: impact

      if (allocated(error)) return
      field = residual_fields(f)
      associate (grid => system%pads(k)%grid, last => ubound(record%after, 1))
         path = '/settling/'//interface_group(k)//'/'//trim(field%name)
         allocate (maps(grid%nx, grid%ny, 1 + last))
         do impact = 0, last
            maps(:, :, 1 + impact) = grid%to_map(values_of(record, impact, f, first, grid%point_count()))
         end do
         call write_maps(file, grid, '/'//interface_group(k), path, maps, trim(field%units), '[impact, '//map_axes(grid) &
            & //']: '//trim(field%description)//'; row 0 before the first', error)
      end associate
   end subroutine put_fields

   !> A field at the points of one interface, (points).
   pure function values_of(record, impact, f, first, points) result(values)
      type(settling_record_t), intent(in) :: record
      integer, intent(in) :: impact, f, first, points
      real(wp) :: values(points)

      associate (after => record%after(impact), last => first + points)
         select case (f)
         case (1)
            values = after%slip_ratio(first + 1:last)
         case (2, 3)
            values = after%slip(f - 1, first + 1:last)
         case (4)
            values = after%largest_slip_ratio(first + 1:last)
         case default
            values = after%largest_slip(first + 1:last)
         end select
      end associate
   end function values_of

end module microslip_io_settling_results
