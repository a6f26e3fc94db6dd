!> The surface of an interface: from its `&topography` to heights at the contact points, with what is doubtful about it.
module microslip_cli_surface_input
   use microslip_cli_log, only: log_t
   use microslip_core_error, only: bad_input, error_t
   use microslip_core_kinds, only: wp, pi
   use microslip_core_text, only: to_text
   use microslip_core_warning_list, only: severity_doubtful, severity_note, severity_wrong, warning_list_t
   use microslip_halfspace_grid, only: be_grid_t
   use microslip_io_case, only: case_t, interface_case_t, topography_case_t
   use microslip_io_topography_file, only: read_topography_hdf5
   use microslip_surface_height_map, only: height_map_t, new_height_map, sampling_t, scan_record_t
   use microslip_surface_plane, only: fit_plane, plane_t
   use microslip_surface_topography, only: flat_t, hill_t, new_hill, topography_t
   implicit none(type, external)
   private

   public :: surface_record_t, read_surface, report_surface, check_closed_points

   !> Range of the heights over the length of the interface: above it a warning.
   real(wp), parameter :: largest_range = 1.0e-2_wp
   !> Part of the range, from the top, in which heights count as high.
   real(wp), parameter :: high_part = 0.2_wp
   !> Scan points on an interface: below it a warning.
   integer, parameter :: fewest_points = 9
   !> Roughness shorter than a cell over the rms of the mean heights of the cells: above it a warning.
   real(wp), parameter :: largest_roughness = 0.1_wp
   !> Part of the contact force on points without a measured height: above the first the result is doubtful, above the second
   !> most likely wrong.
   real(wp), parameter :: small_guess = 1.0e-2_wp, largest_guess = 0.1_wp
   !> Tilt of the heights over the interface, over their largest deviation from the plane: above it a warning.
   real(wp), parameter :: largest_tilt = 4.0_wp
   !> Roundness of "a thousand times".
   real(wp), parameter :: about = 3.0_wp

   !> The surface of an interface as it was read.
   type :: surface_record_t
      !> Whether there is anything to tell
      logical :: measured = .false.
      !> In words: topography and file
      character(len=:), allocatable :: place
      !> m; not allocated: no filter
      real(wp), allocatable :: filter_wavelength
      type(scan_record_t) :: scan
      type(sampling_t) :: sampling
      !> At the contact points: rms about their mean plane, range, m; where the top is, m
      real(wp) :: rms = 0.0_wp, range = 0.0_wp, top(2) = 0.0_wp
      !> rms of the mean heights of the cells about their mean plane, m
      real(wp) :: rms_of_means = 0.0_wp
      !> (points) whether the height is not measured
      logical, allocatable :: estimated(:)
   end type surface_record_t

contains

   !> Heights of the contact points of an interface.
   subroutine read_surface(case, interface, grid, height, record, warnings, error)
      type(case_t), intent(in) :: case
      type(interface_case_t), intent(in) :: interface
      type(be_grid_t), intent(in) :: grid
      !> (points) m
      real(wp), allocatable, intent(out) :: height(:)
      type(surface_record_t), intent(out) :: record
      type(warning_list_t), intent(inout) :: warnings
      type(error_t), allocatable, intent(out) :: error
      class(topography_t), allocatable :: surface

      call make_surface(case, interface, grid, surface, record, warnings, error)
      if (allocated(error)) return
      call surface%heights(grid%position, height, error, record%estimated)
      if (allocated(error)) then
         select type (surface)
         type is (height_map_t)
            error%message = record%place//': '//error%message//'; '//where_scan_lies(surface%record, grid, case, interface)
         end select
         return
      end if
      record%range = maxval(height) - minval(height)
      record%top = grid%position(:, maxloc(height, 1))
      record%rms = rms_about_plane(grid%position, height)
      call check_range(grid, record, interface, warnings, error)
      if (allocated(error)) return
      select type (surface)
      type is (height_map_t)
         record%measured = .true.
         record%scan = surface%record
         if (grid%regular) call compare_with_cells(surface, grid, record)
         call check_scan(grid, height, record, warnings)
      end select
   end subroutine read_surface

   !> The surface of an interface.
   subroutine make_surface(case, interface, grid, surface, record, warnings, error)
      type(case_t), intent(in) :: case
      type(interface_case_t), intent(in) :: interface
      type(be_grid_t), intent(in) :: grid
      class(topography_t), allocatable, intent(out) :: surface
      type(surface_record_t), intent(inout) :: record
      type(warning_list_t), intent(inout) :: warnings
      type(error_t), allocatable, intent(out) :: error
      type(hill_t) :: hill
      type(height_map_t) :: map
      integer :: k

      record%place = "interface '"//trim(interface%name)//"'"
      k = case%find_topography(interface%topography)
      if (k == 0) then
         allocate (flat_t :: surface)
         return
      end if
      associate (topography => case%topographies(k))
         record%place = "topography '"//trim(topography%name)//"'"
         select case (trim(topography%source))
         case ('hill')
            call make_hill(topography, grid, hill, error)
            allocate (surface, source=hill)
         case ('file')
            record%place = record%place//' ('//trim(topography%file)//')'
            if (allocated(topography%filter_wavelength)) record%filter_wavelength = topography%filter_wavelength
            call make_map(case, topography, map, warnings, error)
            if (allocated(error)) error%message = "topography '"//trim(topography%name)//"': "//error%message
            allocate (surface, source=map)
         case default
            allocate (flat_t :: surface)
         end select
         if (.not. allocated(error)) call surface%set_levelling(trim(topography%level), error)
      end associate
   end subroutine make_surface

   !> A hill: offset and rotation move its top, p = offset + Rot(rotation) center.
   subroutine make_hill(topography, grid, hill, error)
      type(topography_case_t), intent(in) :: topography
      type(be_grid_t), intent(in) :: grid
      type(hill_t), intent(out) :: hill
      type(error_t), allocatable, intent(out) :: error
      real(wp) :: top(2), angle

      top = 0.5_wp*(grid%lower + grid%upper)
      if (allocated(topography%center)) top = topography%center
      angle = topography%rotation*pi/180.0_wp
      top = topography%offset + [cos(angle)*top(1) - sin(angle)*top(2), sin(angle)*top(1) + cos(angle)*top(2)]
      call new_hill(hill, grid%lower, grid%upper, top, topography%height, error, topography%scale)
      if (allocated(error)) error%message = "topography '"//trim(topography%name)//"': "//error%message
   end subroutine make_hill

   !> A surface from a file.
   subroutine make_map(case, topography, map, warnings, error)
      type(case_t), intent(in) :: case
      type(topography_case_t), intent(in) :: topography
      type(height_map_t), intent(out) :: map
      type(warning_list_t), intent(inout) :: warnings
      type(error_t), allocatable, intent(out) :: error
      real(wp), allocatable :: x(:), y(:), z(:, :)
      character(len=:), allocatable :: unit, z_name, layout

      ! An argument that is not allocated counts as absent.
      if (topography%unit_length /= '') unit = trim(topography%unit_length)
      if (topography%z_name /= '') z_name = trim(topography%z_name)
      if (topography%layout /= '') layout = trim(topography%layout)
      call read_topography_hdf5(case%located(topography%file), x, y, z, error, trim(topography%x_name), &
         & trim(topography%y_name), z_name, unit, layout, warnings)
      if (allocated(error)) return
      call new_height_map(map, x, y, z, trim(topography%sense), error, topography%scale, topography%filter_wavelength)
      if (allocated(error)) return
      call map%place(topography%offset, topography%rotation*pi/180.0_wp, 'none', error)
   end subroutine make_map

   !> Root mean square of heights about their mean plane, m.
   function rms_about_plane(position, height) result(rms)
      !> (2, points) m
      real(wp), intent(in) :: position(:, :)
      !> (points) m
      real(wp), intent(in) :: height(:)
      real(wp) :: rms
      real(wp), allocatable :: flat(:)
      type(plane_t) :: plane
      integer :: k

      rms = 0.0_wp
      if (size(height) == 0) return
      plane = fit_plane(position, height)
      flat = height
      do k = 1, size(flat)
         flat(k) = height(k) - plane%at(position(1, k), position(2, k))
      end do
      if (maxval(abs(flat)) > 0.0_wp) rms = maxval(abs(flat))*norm2(flat/maxval(abs(flat)))/sqrt(real(size(flat), wp))
   end function rms_about_plane

   !> The cells of the grid against the scan points in them.
   subroutine compare_with_cells(map, grid, record)
      type(height_map_t), intent(in) :: map
      type(be_grid_t), intent(in) :: grid
      type(surface_record_t), intent(inout) :: record
      logical, allocatable :: used(:)
      real(wp), allocatable :: mean(:), position(:, :)
      integer, allocatable :: cell(:)
      integer :: k

      record%sampling = map%sample(grid%lower, grid%upper, grid%nx, grid%ny)
      cell = grid%ix + grid%nx*(grid%iy - 1)
      used = record%sampling%filled(cell)
      mean = pack(record%sampling%mean(cell), used)
      allocate (position(2, size(mean)))
      do k = 1, 2
         position(k, :) = pack(grid%position(k, :), used)
      end do
      record%rms_of_means = rms_about_plane(position, mean)
   end subroutine compare_with_cells

   !> No surface is steeper than its interface is long; no joint's surface is nearly as steep.
   subroutine check_range(grid, record, interface, warnings, error)
      type(be_grid_t), intent(in) :: grid
      type(surface_record_t), intent(in) :: record
      type(interface_case_t), intent(in) :: interface
      type(warning_list_t), intent(inout) :: warnings
      type(error_t), allocatable, intent(out) :: error
      real(wp) :: length

      length = norm2(maxval(grid%position, 2) - minval(grid%position, 2))
      if (size(grid%area) < 2) return
      if (record%range > length) then
         call bad_input(error, record%place//': the heights differ by '//to_text(record%range, 3)//' m on '// &
            & to_text(length, 3)//' m, allowed is no more than that length: are units and scale right, and unknown points NaN?')
      else if (record%range > largest_range*length) then
         call warnings%add(severity_wrong, record%place//": on interface '"//trim(interface%name)//"' the heights differ by "// &
            & millimetres(record%range)//' mm on '//millimetres(length)//' mm, more than '//to_text(1.0e2_wp*largest_range)// &
            & ' % of that length'//likely_height(record%range))
      end if
   end subroutine check_range

   !> Which unit may be wrong where heights are large.
   pure function likely_height(range) result(text)
      !> m
      real(wp), intent(in) :: range
      character(len=:), allocatable :: text
      !> Usual ranges of surfaces that are bolted together, m
      real(wp), parameter :: least = 1.0e-7_wp, most = 2.0e-4_wp

      text = ': is the unit right?'
      if (1.0e-3_wp*range >= least .and. 1.0e-3_wp*range <= most) then
         text = ': a thousandth of it, '//to_text(1.0e3_wp*range, 3)//' um, would be usual; are heights in um read as mm, or '// &
            & 'in mm as m?'
      else if (1.0e-6_wp*range >= least .and. 1.0e-6_wp*range <= most) then
         text = ': a millionth of it, '//to_text(range, 3)//' um, would be usual; are heights in um read as m?'
      end if
      text = text//" (Or is the surface tilted: level = 'plane'?)"
   end function likely_height

   !> What is doubtful about a scan on an interface.
   subroutine check_scan(grid, height, record, warnings)
      type(be_grid_t), intent(in) :: grid
      !> (points) m, the highest one at 0
      real(wp), intent(in) :: height(:)
      type(surface_record_t), intent(in) :: record
      type(warning_list_t), intent(inout) :: warnings
      integer :: guesses, high
      character(len=:), allocatable :: text

      if (.not. record%range > 0.0_wp) call warnings%add(severity_doubtful, record%place//': all heights are equal, the '// &
         & 'surface is flat; are scale and file right?')
      associate (scan => record%scan)
         if (scan%outliers > 0) then
            text = record%place//': '//to_text(scan%outliers)//' scan points far from all their neighbours, '// &
               & 'the worst, at x = '//millimetres(scan%outlier_at(1))//' mm, y = '//millimetres(scan%outlier_at(2))// &
               & ' mm of the scan, by '//to_text(1.0e6_wp*scan%outlier, 4)//' um'
            if (allocated(record%filter_wavelength)) text = text//'; the filter spreads it out'
            call warnings%add(merge(severity_wrong, severity_doubtful, scan%outlier > 0.0_wp), text//'; dust, or a fault of '// &
               & 'the instrument? On a contact point it counts as a height, between contact points it is not seen: make it NaN')
         end if
      end associate
      guesses = count(record%estimated)
      if (guesses > 0) then
         high = count(record%estimated .and. height >= -high_part*record%range)
         text = record%place//': '//to_text(guesses)//' of '//to_text(size(height))//' contact points have no measured '// &
            & 'height and take one from their neighbours'
         if (high > 0) text = text//', '//to_text(high)//' of them in the highest '//to_text(1.0e2_wp*high_part)//' % of the '// &
            & 'range, where contact is expected'
         call warnings%add(merge(severity_doubtful, severity_note, high > 0), text)
      end if
      call check_tilt(grid, height, record, warnings)
      if (grid%regular) call check_sampling(grid, record, warnings)
   end subroutine check_scan

   !> Bodies that are pressed together turn until their surfaces meet; scans are hardly ever level.
   subroutine check_tilt(grid, height, record, warnings)
      type(be_grid_t), intent(in) :: grid
      !> (points) m
      real(wp), intent(in) :: height(:)
      type(surface_record_t), intent(in) :: record
      type(warning_list_t), intent(inout) :: warnings
      type(plane_t) :: plane
      real(wp) :: tilt, largest
      integer :: k

      plane = fit_plane(grid%position, height)
      tilt = dot_product(abs(plane%slope), maxval(grid%position, 2) - minval(grid%position, 2))
      largest = maxval(abs([(height(k) - plane%at(grid%position(1, k), grid%position(2, k)), k=1, size(height))]))
      if (tilt <= largest_tilt*largest) return
      call warnings%add(severity_note, record%place//': the surface is tilted by '//to_text(1.0e3_wp*norm2(plane%slope), 3)// &
         & ' mrad, '//micrometres(tilt)//' um over the interface, and deviates from that plane by '//micrometres(largest)// &
         & ' um at most; level = ''plane'' takes it out where it is that of the measurement')
   end subroutine check_tilt

   !> Scan against grid: far fewer points than cells, or far more.
   subroutine check_sampling(grid, record, warnings)
      type(be_grid_t), intent(in) :: grid
      type(surface_record_t), intent(in) :: record
      type(warning_list_t), intent(inout) :: warnings

      associate (sampling => record%sampling, scan => record%scan)
         if (sampling%points < fewest_points) call warnings%add(severity_wrong, record%place//': only '// &
            & to_text(sampling%points)//' scan points lie on the interface of '//millimetres(grid%upper(1) - grid%lower(1))// &
            & ' x '//millimetres(grid%upper(2) - grid%lower(2))//' mm, the scan is '// &
            & millimetres(scan%upper(1) - scan%lower(1))//' x '//millimetres(scan%upper(2) - scan%lower(2))//' mm'// &
            & likely_axes(norm2(scan%upper - scan%lower)/norm2(grid%upper - grid%lower)))
         if (sampling%cells > 0 .and. sampling%within > largest_roughness*record%rms_of_means) call warnings%add( &
            & severity_doubtful, record%place//': the scan is finer than the grid ('// &
            & to_text(real(sampling%points, wp)/(grid%nx*grid%ny), 3)//' points per cell) and rough within the cells: rms '// &
            & micrometres(sampling%within)//' um on waves shorter than a cell; every contact point takes the height at '// &
            & 'its centre, which leaves rms '//micrometres(record%rms)//' um on the grid, where the means of the cells have '// &
            & micrometres(record%rms_of_means)//' um: set filter_wavelength to two cells or more, or refine the grid')
      end associate
   end subroutine check_sampling

   !> Which unit may be wrong where the axes of a scan are too long.
   pure function likely_axes(ratio) result(text)
      !> Length of the scan over that of the interface
      real(wp), intent(in) :: ratio
      character(len=:), allocatable :: text

      text = ': are the units of its axes right?'
      if (ratio > 1.0e3_wp/about .and. ratio < 1.0e3_wp*about) then
         text = ', some 1000 times as long: are axes in mm read as m, or in um as mm?'
      else if (ratio > 1.0e6_wp/about .and. ratio < 1.0e6_wp*about) then
         text = ', some 1e6 times as long: are axes in um read as m?'
      end if
   end function likely_axes

   !> Where a scan lies and where it should, for a message about missing heights.
   function where_scan_lies(scan, grid, case, interface) result(text)
      type(scan_record_t), intent(in) :: scan
      type(be_grid_t), intent(in) :: grid
      type(case_t), intent(in) :: case
      type(interface_case_t), intent(in) :: interface
      character(len=:), allocatable :: text
      real(wp) :: ratio, shift(2)

      shift = 0.5_wp*(grid%lower + grid%upper - scan%lower - scan%upper)
      ratio = norm2(grid%upper - grid%lower)/norm2(scan%upper - scan%lower)
      text = 'the scan covers x = '//span(scan%lower(1), scan%upper(1))//', y = '//span(scan%lower(2), scan%upper(2))// &
         & ", interface '"//trim(interface%name)//"' (local coordinates) x = "//span(grid%lower(1), grid%upper(1))//', y = '// &
         & span(grid%lower(2), grid%upper(2))
      associate (topography => case%topographies(case%find_topography(interface%topography)))
         if (any(abs(topography%offset) > 0.0_wp) .or. abs(topography%rotation) > 0.0_wp) text = text//', after offset = '// &
            & to_text(topography%offset(1))//', '//to_text(topography%offset(2))//' m and rotation = '// &
            & to_text(topography%rotation)//' degrees'
      end associate
      if (ratio > 1.0e3_wp/about .and. ratio < 1.0e3_wp*about) then
         text = text//': some 1000 times too small, are axes in m read as mm, or in mm as um?'
      else if (any(abs(shift) > 0.1_wp*(scan%upper - scan%lower))) then
         text = text//': offset = '//to_text(shift(1), 4)//', '//to_text(shift(2), 4)//' would put its middle on the middle '// &
            & 'of the interface'
      end if

   contains

      function span(lower, upper) result(words)
         real(wp), intent(in) :: lower, upper
         character(len=:), allocatable :: words
         words = millimetres(lower)//' to '//millimetres(upper)//' mm'
      end function span

   end function where_scan_lies

   !> Closed points whose height was not measured.
   subroutine check_closed_points(record, points, closed, force, warnings)
      type(surface_record_t), intent(in) :: record
      !> Grid points that may come into contact
      integer, intent(in) :: points(:)
      !> (points) whether they are closed under the preload
      logical, intent(in) :: closed(:)
      !> (points) normal force, N
      real(wp), intent(in) :: force(:)
      type(warning_list_t), intent(inout) :: warnings
      real(wp) :: share
      integer :: severity

      if (.not. record%measured) return
      if (.not. (any(closed .and. record%estimated(points)) .and. sum(force) > 0.0_wp)) return
      share = sum(force, record%estimated(points))/sum(force)
      severity = severity_note
      if (share > small_guess) severity = severity_doubtful
      if (share > largest_guess) severity = severity_wrong
      call warnings%add(severity, record%place//': '//to_text(count(closed .and. record%estimated(points)))//' of the '// &
         & to_text(count(closed))//' points that the preload closes have no measured height; they carry '// &
         & to_text(1.0e2_wp*share, 2)//' % of the force, and their pressure is a guess')
   end subroutine check_closed_points

   !> A measured surface in the log.
   subroutine report_surface(log, record)
      type(log_t), intent(in) :: log
      type(surface_record_t), intent(in) :: record
      character(len=:), allocatable :: text

      if (.not. record%measured) return
      associate (scan => record%scan)
         text = record%place//': '//to_text(scan%points(1))//' x '//to_text(scan%points(2))//' points on '// &
            & millimetres(scan%upper(1) - scan%lower(1))//' x '//millimetres(scan%upper(2) - scan%lower(2))//' mm, '// &
            & to_text(scan%unknown)//' unknown; about the mean plane rms '//micrometres(scan%rms(1))//' um, largest '// &
            & micrometres(scan%largest(1))//' um'
         if (allocated(record%filter_wavelength)) text = text//'; after the filter of '// &
            & millimetres(record%filter_wavelength)//' mm rms '//micrometres(scan%rms(2))//' um, largest '// &
            & micrometres(scan%largest(2))//' um'
         text = text//'; at the contact points rms '//micrometres(record%rms)//' um, range '//micrometres(record%range)// &
            & ' um, top at x = '//millimetres(record%top(1))//', y = '//millimetres(record%top(2))//' mm'
      end associate
      call log%line(text)
   end subroutine report_surface

   pure function millimetres(length) result(text)
      real(wp), intent(in) :: length
      character(len=:), allocatable :: text
      text = to_text(1.0e3_wp*length, 4)
   end function millimetres

   pure function micrometres(length) result(text)
      real(wp), intent(in) :: length
      character(len=:), allocatable :: text
      text = to_text(1.0e6_wp*length, 3)
   end function micrometres

end module microslip_cli_surface_input
