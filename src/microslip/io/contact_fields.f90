!> The contact as maps on the grid of every interface: what the result file holds of a contact state.
!>
!> Points that are not on the grid (holes) are NaN. The gap is known at all grid points; points left out of
!> the potential contact set carry no force.
module microslip_io_contact_fields
   use, intrinsic :: ieee_arithmetic, only: ieee_quiet_nan, ieee_value
   use microslip_contact_problem, only: contact_state_t
   use microslip_core_kinds, only: wp
   use microslip_system_jointed_system, only: jointed_system_t
   implicit none(type, external)
   private

   public :: field_maps_t, field_t, contact_fields, fields, interface_group

   !> A field as it is named in the result file.
   type :: field_t
      character(len=18) :: name
      character(len=2) :: units
      character(len=90) :: description
   end type field_t

   !> The fields, in the order of the maps.
   type(field_t), parameter :: fields(5) = [ &
      & field_t('pressure', 'Pa', 'contact pressure, positive in compression'), &
      & field_t('traction_1', 'Pa', 'friction stress on body A along t1 (x)'), &
      & field_t('traction_2', 'Pa', 'friction stress on body A along t2 (y)'), &
      & field_t('gap', 'm', 'normal gap between the bodies'), &
      & field_t('slip_ratio', '1', 'friction stress over friction coefficient times pressure; NaN where open')]

   !> Maps of one interface.
   type :: field_maps_t
      !> (nx, ny, fields)
      real(wp), allocatable :: map(:, :, :)
   end type field_maps_t

contains

   !> All fields of all interfaces, (pads).
   function contact_fields(system, contact) result(maps)
      type(jointed_system_t), intent(in) :: system
      !> Its driver is [modal coordinates; load amplitudes]
      type(contact_state_t), intent(in) :: contact
      type(field_maps_t), allocatable :: maps(:)
      real(wp), allocatable :: gap(:, :), values(:, :)
      integer :: k, f, first

      ! Points in potential contact have their gap from the contact solver, the others need a product with C.
      if (system%problem%n_points == system%grid_point_count()) then
         gap = contact%gap
      else
         gap = system%gaps_everywhere(contact%q(:system%n_modes), contact%force, contact%q(system%n_modes + 1:))
      end if
      allocate (maps(size(system%pads)))
      first = 0
      do k = 1, size(system%pads)
         associate (grid => system%pads(k)%grid)
            values = point_values(system, k, contact, gap(1, first + 1:first + grid%point_count()))
            allocate (maps(k)%map(grid%nx, grid%ny, size(fields)))
            do f = 1, size(fields)
               maps(k)%map(:, :, f) = grid%to_map(values(:, f))
            end do
            first = first + grid%point_count()
         end associate
      end do
   end function contact_fields

   !> All fields at the points of one pad, (grid points, fields).
   pure function point_values(system, k, contact, gap) result(values)
      type(jointed_system_t), intent(in) :: system
      !> Which pad
      integer, intent(in) :: k
      type(contact_state_t), intent(in) :: contact
      !> (grid points) m
      real(wp), intent(in) :: gap(:)
      real(wp) :: values(size(gap), size(fields))
      real(wp) :: limit
      integer :: p

      values(:, :3) = 0.0_wp
      values(:, 4) = gap
      values(:, 5) = ieee_value(1.0_wp, ieee_quiet_nan)
      associate (pad => system%pads(k))
         do p = 1, size(pad%potential)
            associate (force => contact%force(:, pad%point_offset + p), row => pad%potential(p))
               values(row, :3) = force/pad%grid%area(row)
               values(row, 4) = contact%gap(1, pad%point_offset + p)
               limit = pad%friction*force(1)
               if (limit > 0.0_wp) values(row, 5) = norm2(force(2:3))/limit
            end associate
         end do
      end associate
   end function point_values

   !> Name of the group of an interface: 'interface_1', ...
   pure function interface_group(k) result(name)
      !> Which interface
      integer, intent(in) :: k
      character(len=:), allocatable :: name
      character(len=22) :: buffer

      write (buffer, '(a,i0)') 'interface_', k
      name = trim(buffer)
   end function interface_group

end module microslip_io_contact_fields
