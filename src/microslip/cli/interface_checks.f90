!> What is doubtful about the interfaces of a case: friction in percent, holes and grids beside the pad.
!>
!> Nothing here is refused: every check has a named threshold (doc/namelists.md, "What is doubted").
module microslip_cli_interface_checks
   use microslip_cli_scene, only: scene_t
   use microslip_core_kinds, only: wp
   use microslip_core_text, only: to_text
   use microslip_core_warning_list, only: severity_doubtful, severity_note, severity_wrong, warning_list_t
   use microslip_fe_interface, only: contact_interface_t
   use microslip_halfspace_grid, only: be_grid_t
   use microslip_io_case, only: case_t, interface_case_t
   implicit none(type, external)
   private

   public :: check_interfaces

   !> Coefficient of friction.
   real(wp), parameter :: largest_friction = 2.0_wp
   !> Poisson's ratio.
   real(wp), parameter :: most_incompressible = 0.49_wp
   !> Sine of the angle of axis_1 to the plane.
   real(wp), parameter :: largest_inclination = 0.1_wp
   !> How far the extent goes beyond the nodes, over its length; part of the faces that the grid covers.
   real(wp), parameter :: largest_excess = 1.0e-2_wp, smallest_part = 0.5_wp
   !> Length over width of a cell; width of a cell, m; cells per FE node distance.
   real(wp), parameter :: largest_aspect = 3.0_wp, smallest_cell = 1.0e-6_wp, most_cells = 200.0_wp
   !> Part of the rectangle that one hole cuts out.
   real(wp), parameter :: largest_hole = 0.5_wp
   !> Margin on the gap, m, and over the range of the heights.
   real(wp), parameter :: largest_margin = 1.0e-3_wp, smallest_margin = 1.0e-2_wp

contains

   !> Go through all interfaces.
   subroutine check_interfaces(case, scene, warnings)
      type(case_t), intent(in) :: case
      type(scene_t), intent(in) :: scene
      type(warning_list_t), intent(inout) :: warnings
      character(len=:), allocatable :: place
      integer :: k

      do k = 1, size(scene%pads)
         associate (record => case%interfaces(k), pad => scene%pads(k))
            place = "&interface '"//trim(record%name)//"': "
            if (record%friction > largest_friction) call warnings%add(severity_wrong, place//'friction = '// &
               & to_text(record%friction)//', more than '//to_text(largest_friction)//': is it in percent? '// &
               & to_text(record%friction)//' % are '//to_text(1.0e-2_wp*record%friction))
            call check_poisson(record, place, warnings)
            if (allocated(record%axis_1)) call check_axis(record%axis_1, pad%contact%frame(:, 1), place, warnings)
            call check_margin(record, scene%surfaces(k)%range, place, warnings)
            if (.not. pad%grid%regular) cycle
            call check_extent(record, pad%contact, pad%grid, place, warnings)
            call check_cells(pad%grid, scene%meshes(k)%spacing, place, warnings)
            if (allocated(record%holes)) call check_holes(record%holes, pad%grid, place, warnings)
         end associate
      end do
   end subroutine check_interfaces

   !> Poisson's ratio of the half spaces.
   subroutine check_poisson(record, place, warnings)
      type(interface_case_t), intent(in) :: record
      character(len=*), intent(in) :: place
      type(warning_list_t), intent(inout) :: warnings
      integer :: k

      if (.not. allocated(record%poisson_ratio)) return
      do k = 1, size(record%poisson_ratio)
         associate (nu => record%poisson_ratio(k))
            if (nu > most_incompressible .or. nu < 0.0_wp) call warnings%add(severity_note, place//'poisson_ratio = '// &
               & to_text(nu)//', metals have 0.25 to 0.35')
         end associate
      end do
   end subroutine check_poisson

   !> axis_1 is projected on the interface: it should lie in it.
   subroutine check_axis(axis, normal, place, warnings)
      real(wp), intent(in) :: axis(3), normal(3)
      character(len=*), intent(in) :: place
      type(warning_list_t), intent(inout) :: warnings

      associate (inclination => abs(dot_product(axis, normal))/norm2(axis))
         if (inclination > largest_inclination) call warnings%add(severity_doubtful, place//'axis_1 = '//listed(axis)// &
            & ' is inclined to the interface by '//to_text(asin(min(1.0_wp, inclination))*45.0_wp/atan(1.0_wp), 3)// &
            & ' degrees, its projection is taken')
      end associate
   end subroutine check_axis

   !> Margin on the gap in the choice of the points in potential contact.
   subroutine check_margin(record, range, place, warnings)
      type(interface_case_t), intent(in) :: record
      !> Of the heights, m
      real(wp), intent(in) :: range
      character(len=*), intent(in) :: place
      type(warning_list_t), intent(inout) :: warnings

      if (.not. allocated(record%potential_margin)) return
      if (record%potential_margin > largest_margin) then
         call warnings%add(severity_doubtful, place//'potential_margin = '//to_text(record%potential_margin)//' m, more than '// &
            & to_text(largest_margin)//' m: is it in um or mm? All points take part')
      else if (record%potential_margin < smallest_margin*range) then
         call warnings%add(severity_note, place//'potential_margin = '//to_text(record%potential_margin)//' m is less than '// &
            & to_text(1.0e2_wp*smallest_margin)//' % of the range of the heights, '//to_text(range, 3)// &
            & ' m: points that were left out will join later, which takes time')
      end if
   end subroutine check_margin

   !> The rectangle of the grid against nodes and faces.
   subroutine check_extent(record, contact, grid, place, warnings)
      type(interface_case_t), intent(in) :: record
      type(contact_interface_t), intent(in) :: contact
      type(be_grid_t), intent(in) :: grid
      character(len=*), intent(in) :: place
      type(warning_list_t), intent(inout) :: warnings
      real(wp) :: lower(2), upper(2), faces
      integer :: f

      if (.not. allocated(record%extent)) return
      lower = minval(contact%position, dim=2)
      upper = maxval(contact%position, dim=2)
      if (any(lower - grid%lower > largest_excess*(upper - lower)) .or. any(grid%upper - upper > largest_excess*(upper - lower))) &
         & call warnings%add(severity_note, place//'extent = '//listed([grid%lower(1), grid%upper(1), grid%lower(2), &
         & grid%upper(2)])//' m goes beyond the nodes, which span '//listed([lower(1), upper(1), lower(2), upper(2)])// &
         & ' m: cells without faces are left out')
      faces = 0.0_wp
      do f = 1, size(contact%faces, 2)
         associate (a => contact%position(:, contact%faces(3, f)) - contact%position(:, contact%faces(1, f)), &
            & b => contact%position(:, contact%faces(4, f)) - contact%position(:, contact%faces(2, f)))
            faces = faces + 0.5_wp*abs(a(1)*b(2) - a(2)*b(1))
         end associate
      end do
      if (sum(grid%area) < smallest_part*faces) call warnings%add(severity_doubtful, place//'the grid covers '// &
         & to_text(1.0e2_wp*sum(grid%area)/faces, 3)//' % of the faces, less than '//to_text(1.0e2_wp*smallest_part)// &
         & ' %: there is no contact on the others. Is extent right (local coordinates, m)?')
   end subroutine check_extent

   !> Shape and size of the cells.
   subroutine check_cells(grid, spacing, place, warnings)
      type(be_grid_t), intent(in) :: grid
      !> FE node distance, m
      real(wp), intent(in) :: spacing
      character(len=*), intent(in) :: place
      type(warning_list_t), intent(inout) :: warnings
      real(wp) :: aspect, turned
      character(len=:), allocatable :: text

      aspect = max(grid%dx/grid%dy, grid%dy/grid%dx)
      turned = grid%dx*grid%nx/grid%ny/(grid%dy*grid%ny/grid%nx)
      text = place//'nx = '//to_text(grid%nx)//', ny = '//to_text(grid%ny)//' make cells of '//to_text(1.0e3_wp*grid%dx, 3)// &
         & ' x '//to_text(1.0e3_wp*grid%dy, 3)//' mm'
      if (aspect > largest_aspect) then
         if (max(turned, 1.0_wp/turned) < aspect) then
            call warnings%add(severity_doubtful, text//', more than '//to_text(largest_aspect)//' times as long as wide: are '// &
               & 'nx and ny exchanged?')
         else
            call warnings%add(severity_doubtful, text//', more than '//to_text(largest_aspect)//' times as long as wide')
         end if
      end if
      if (min(grid%dx, grid%dy) < smallest_cell) then
         call warnings%add(severity_doubtful, text//', smaller than '//to_text(smallest_cell)//' m')
      else if (spacing > most_cells*min(grid%dx, grid%dy)) then
         call warnings%add(severity_note, text//', more than '//to_text(most_cells)//' per FE node distance: expensive')
      end if
   end subroutine check_cells

   !> Every hole cuts something out, and not nearly everything.
   subroutine check_holes(holes, grid, place, warnings)
      !> (3, holes) x, y, radius, m
      real(wp), intent(in) :: holes(:, :)
      type(be_grid_t), intent(in) :: grid
      character(len=*), intent(in) :: place
      type(warning_list_t), intent(inout) :: warnings
      character(len=:), allocatable :: text
      real(wp) :: middle(2)
      integer :: k, cells

      do k = 1, size(holes, 2)
         text = place//'hole '//to_text(k)//' (x, y, radius = '//listed(holes(:, k))//' m)'
         cells = cells_in(grid, holes(:, k))
         if (cells == 0) then
            text = text//' cuts no cell of the grid, which spans '//listed([grid%lower(1), grid%upper(1), grid%lower(2), &
               & grid%upper(2)])//' m'
            middle = 0.5_wp*(grid%upper - grid%lower)
            if (cells_in(grid, 1.0e-3_wp*holes(:, k)) > 0) then
               text = text//': is it in mm?'
            else if (cells_in(grid, [holes(:2, k) - middle, holes(3, k)]) > 0) then
               text = text//': is it counted from a corner? Local coordinates are counted from the middle of the nodes'
            end if
            call warnings%add(severity_wrong, text)
         else if (cells > largest_hole*grid%nx*grid%ny) then
            call warnings%add(severity_doubtful, text//' cuts out '//to_text(1.0e2_wp*cells/(grid%nx*grid%ny), 3)// &
               & ' % of the cells: is the last number the radius, in m?')
         else if (any(holes(:2, k) < grid%lower) .or. any(holes(:2, k) > grid%upper)) then
            call warnings%add(severity_doubtful, text//' has its centre beside the grid, which spans '//listed([grid%lower(1), &
               & grid%upper(1), grid%lower(2), grid%upper(2)])//' m')
         end if
      end do
   end subroutine check_holes

   !> Cells whose centres lie in a hole, those without faces too.
   pure integer function cells_in(grid, hole)
      type(be_grid_t), intent(in) :: grid
      real(wp), intent(in) :: hole(3)
      integer :: j

      cells_in = 0
      do j = 1, grid%ny
         cells_in = cells_in + count(hypot(grid%x - hole(1), grid%y(j) - hole(2)) < hole(3))
      end do
   end function cells_in

   !> Numbers with commas between them.
   pure function listed(values) result(text)
      real(wp), intent(in) :: values(:)
      character(len=:), allocatable :: text
      integer :: k

      text = to_text(values(1), 4)
      do k = 2, size(values)
         text = text//', '//to_text(values(k), 4)
      end do
   end function listed

end module microslip_cli_interface_checks
