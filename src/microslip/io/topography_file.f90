!> Topography on a regular or stretched grid from an HDF5 file: axes x, y and heights z, NaN where unknown
!> (doc/surface_file.md).
!>
!> In the view of h5py and C the heights are z[x, y] or z[y, x]. Which of them is said by the argument `layout`, the attribute
!> `layout` of the heights, dimension scales (netCDF), or else by the shape; where none of these does, the file is refused.
!> Numbers that seem to stand for unknown points are refused where they lie beyond all heights, and told where they lie among them.
module microslip_io_topography_file
   use, intrinsic :: ieee_arithmetic, only: ieee_is_finite, ieee_is_nan
   use microslip_core_error, only: bad_input, error_t
   use microslip_core_kinds, only: wp
   use microslip_core_text, only: lower_case, to_text
   use microslip_core_warning_list, only: severity_doubtful, severity_note, severity_wrong, &
      warning_list_t
   use microslip_io_file_kind, only: kind_of_file
   use microslip_io_hdf5, only: hdf5_file_t, is_hdf5_file
   use microslip_io_topography_attributes, only: find_unit, in_metres, remove_missing, report_attributes, &
      report_masks, unpack
   use microslip_surface_scan_check, only: find_stand_in, stand_in_t
   implicit none(type, external)
   private

   public :: read_topography_hdf5

   !> Names under which heights are looked for.
   character(len=*), parameter :: height_names(*) = [character(len=6) :: 'z', 'gap', 'height']
   !> Distance of two points of an axis over the mean distance: below it a warning.
   real(wp), parameter :: smallest_distance = 1.0e-2_wp
   !> Order of the dimensions as h5py shows them.
   integer, parameter :: order_unknown = 0, order_xy = 1, order_yx = 2

contains

   !> Read axes and heights in metres.
   subroutine read_topography_hdf5(path, x, y, z, error, x_name, y_name, z_name, unit, layout, warnings)
      !> Where the file is
      character(len=*), intent(in) :: path
      !> (nx) and (ny) axes, ascending, m
      real(wp), allocatable, intent(out) :: x(:), y(:)
      !> (nx, ny) heights, m; NaN where unknown
      real(wp), allocatable, intent(out) :: z(:, :)
      type(error_t), allocatable, intent(out) :: error
      !> Names of the datasets ('x', 'y', and 'z', 'gap' or 'height' by default)
      character(len=*), intent(in), optional :: x_name, y_name, z_name
      !> Unit of datasets that do not tell theirs ('m', 'mm', 'um', 'nm')
      character(len=*), intent(in), optional :: unit
      !> 'z[x,y]' or 'z[y,x]', as h5py shows the heights
      character(len=*), intent(in), optional :: layout
      !> What is doubtful about the file
      type(warning_list_t), intent(inout), optional :: warnings
      type(hdf5_file_t) :: file
      type(error_t), allocatable :: ignored
      type(warning_list_t) :: found
      character(len=1024) :: names(3)
      integer :: k

      call open_surface(file, path, error)
      if (allocated(error)) return
      names = [character(len=1) :: 'x', 'y', '']
      if (present(x_name)) names(1) = x_name
      if (present(y_name)) names(2) = y_name
      if (present(z_name)) names(3) = z_name
      call read_axis(file, trim(names(1)), x, found, error, unit)
      if (.not. allocated(error)) call read_axis(file, trim(names(2)), y, found, error, unit)
      if (.not. (allocated(error) .or. present(z_name))) call find_heights(file, names(3), error)
      if (.not. allocated(error)) call read_heights(file, names, size(x), size(y), z, found, error, unit, layout)
      if (.not. allocated(error) .and. present(unit)) call check_unit(file, names, unit, error)
      do k = 1, 3
         if (.not. allocated(error)) call report_attributes(file, trim(names(k)), found)
      end do
      if (.not. allocated(error)) call report_attributes(file, '/', found)
      if (.not. allocated(error)) call report_masks(file, found)
      call file%close(ignored)
      if (present(warnings)) call warnings%append(found)
   end subroutine read_topography_hdf5

   !> Open an HDF5 file; say what another one looks like.
   subroutine open_surface(file, path, error)
      type(hdf5_file_t), intent(inout) :: file
      character(len=*), intent(in) :: path
      type(error_t), allocatable, intent(out) :: error
      character(len=:), allocatable :: kind

      kind = kind_of_file(path)
      if (kind /= '' .and. .not. is_hdf5_file(path)) then
         call bad_input(error, path//': format not known (it looks like '//kind//'); readable are HDF5 files with axes x, y '// &
            'and heights z (doc/surface_file.md)')
         return
      end if
      call file%open(path, error)
   end subroutine open_surface

   !> Name of the dataset of heights.
   subroutine find_heights(file, name, error)
      type(hdf5_file_t), intent(in) :: file
      character(len=*), intent(inout) :: name
      type(error_t), allocatable, intent(out) :: error
      integer :: k

      do k = 1, size(height_names)
         name = height_names(k)
         if (file%has(trim(name))) return
      end do
      call bad_input(error, file%path//": holds no dataset 'z', 'gap' or 'height': name the one with the heights")
   end subroutine find_heights

   !> An ascending axis in metres.
   subroutine read_axis(file, name, axis, warnings, error, unit)
      type(hdf5_file_t), intent(in) :: file
      character(len=*), intent(in) :: name
      real(wp), allocatable, intent(out) :: axis(:)
      type(warning_list_t), intent(inout) :: warnings
      type(error_t), allocatable, intent(out) :: error
      character(len=*), intent(in), optional :: unit
      character(len=:), allocatable :: text
      real(wp) :: factor, scale, offset
      logical :: stated
      integer :: n

      call file%read(name, axis, error)
      if (.not. allocated(error)) call find_unit(file, name, factor, text, stated, error, unit)
      if (.not. allocated(error)) call unpack(file, name, scale, offset, warnings, error)
      if (allocated(error)) return
      n = size(axis)
      if (n < 2) then
         call bad_input(error, file%path//": '"//name//"' has "//to_text(n)//' points, at least 2 are needed')
      else if (.not. all(ieee_is_finite(axis)) .or. .not. all(scale*(axis(2:) - axis(:n - 1)) > 0.0_wp)) then
         call bad_input(error, file%path//": '"//name//"' must hold ascending finite numbers")
      else
         axis = factor*(scale*axis + offset)
         if (minval(axis(2:) - axis(:n - 1)) < smallest_distance*(axis(n) - axis(1))/(n - 1)) call warnings%add( &
            severity_doubtful, file%path//": '"//name//"' has points that are only "// &
            to_text(minval(axis(2:) - axis(:n - 1)), 3)//' m apart, the mean distance is '// &
            to_text((axis(n) - axis(1))/(n - 1), 3)//' m')
      end if
   end subroutine read_axis

   !> Heights in metres, (nx, ny).
   subroutine read_heights(file, names, nx, ny, z, warnings, error, unit, layout)
      type(hdf5_file_t), intent(in) :: file
      !> Datasets of x, y, z
      character(len=*), intent(in) :: names(3)
      integer, intent(in) :: nx, ny
      real(wp), allocatable, intent(out) :: z(:, :)
      type(warning_list_t), intent(inout) :: warnings
      type(error_t), allocatable, intent(out) :: error
      character(len=*), intent(in), optional :: unit, layout
      character(len=:), allocatable :: text, name
      real(wp), allocatable :: stored(:, :)
      real(wp) :: factor, scale, offset
      logical :: stated
      integer :: order

      name = trim(names(3))
      call file%read(name, stored, error)
      if (.not. allocated(error)) call find_unit(file, name, factor, text, stated, error, unit)
      if (.not. allocated(error)) call unpack(file, name, scale, offset, warnings, error)
      ! Fortran sees the dimensions in the reverse of the file's order.
      if (.not. allocated(error)) call find_order(file, names, [size(stored, 2), size(stored, 1)], [nx, ny], order, warnings, &
         error, layout)
      if (.not. allocated(error)) call remove_missing(file, name, stored, warnings, error)
      if (abs(scale - 1.0_wp) > 0.0_wp) text = '(packed)'
      if (.not. allocated(error)) call check_numbers(file, name, stored, text, warnings, error)
      if (allocated(error)) return
      if (order == order_yx) then
         z = factor*(scale*stored + offset)
      else
         z = factor*(scale*transpose(stored) + offset)
      end if
   end subroutine read_heights

   !> Order of the dimensions of the heights.
   subroutine find_order(file, names, shape, expected, order, warnings, error, layout)
      type(hdf5_file_t), intent(in) :: file
      !> Datasets of x, y, z
      character(len=*), intent(in) :: names(3)
      !> Shape of the heights as h5py shows it, and numbers of points of x and y
      integer, intent(in) :: shape(2), expected(2)
      integer, intent(out) :: order
      type(warning_list_t), intent(inout) :: warnings
      type(error_t), allocatable, intent(out) :: error
      character(len=*), intent(in), optional :: layout
      character(len=:), allocatable :: text, place
      integer :: by(3), k

      place = file%path//": '"//trim(names(3))//"'"
      by = order_unknown
      if (present(layout)) by(1) = order_named(layout)
      call file%get_attribute(trim(names(3)), 'layout', text, error, default='')
      if (allocated(error)) return
      by(2) = order_named(text)
      by(3) = order_of_scales(file, names)
      order = maxval(by)
      if (any(by /= order_unknown .and. by /= order)) then
         call bad_input(error, place//': its layout is said in two ways that contradict one another (key layout, attribute '// &
            'layout, dimension scales)')
         return
      end if
      if (text /= '' .and. by(2) == order_unknown) call warnings%add(severity_note, place//" has the layout '"//text// &
         "', which is not understood: it must begin with z[x,y] or z[y,x] (or z[i,j], at x[i], y[j]), as h5py shows it")
      if (.not. (all(shape == expected) .or. all(shape([2, 1]) == expected))) then
         call bad_input(error, place//' is ('//to_text(shape(1))//', '//to_text(shape(2))//'), expected ('// &
            to_text(expected(1))//', '//to_text(expected(2))//') as the axes tell')
         return
      end if
      if (expected(1) /= expected(2)) then
         k = merge(order_xy, order_yx, shape(1) == expected(1))
         if (order /= order_unknown .and. order /= k) call bad_input(error, place//' is ('//to_text(shape(1))//', '// &
            to_text(shape(2))//'), which its layout contradicts: x has '//to_text(expected(1))//' points, y has '// &
            to_text(expected(2)))
         order = k
      else if (order == order_unknown) then
         call bad_input(error, place//' is square ('//to_text(shape(1))//', '//to_text(shape(2))//'), and nothing says which '// &
            "axis comes first: give layout = 'z[x,y]' or 'z[y,x]' in &topography, or as an attribute of '"//trim(names(3))// &
            "' (as h5py shows it: z[x,y] if z[3, 0] is at x[3], y[0])")
      end if
   end subroutine find_order

   !> The order that a text says: 'z[x,y]', 'gap[i,j] at x[i], y[j]', ...
   pure integer function order_named(text)
      character(len=*), intent(in) :: text
      character(len=:), allocatable :: inner
      integer :: first, last, k

      order_named = order_unknown
      inner = ''
      first = index(text, '[')
      last = index(text, ']')
      if (first == 0 .or. last < first) return
      do k = first + 1, last - 1
         if (text(k:k) /= ' ') inner = inner//lower_case(text(k:k))
      end do
      select case (inner)
      case ('x,y', 'i,j', 'ix,iy')
         order_named = order_xy
      case ('y,x', 'j,i', 'iy,ix')
         order_named = order_yx
      end select
   end function order_named

   !> The order that dimension scales say.
   integer function order_of_scales(file, names)
      type(hdf5_file_t), intent(in) :: file
      character(len=*), intent(in) :: names(3)

      character(len=:), allocatable :: x, y, z

      order_of_scales = order_unknown
      x = trim(names(1))
      y = trim(names(2))
      z = trim(names(3))
      if (x == y) return
      if (file%is_attached(z, 2, x) .and. file%is_attached(z, 1, y)) order_of_scales = order_xy
      if (file%is_attached(z, 1, x) .and. file%is_attached(z, 2, y)) order_of_scales = order_yx
   end function order_of_scales

   !> Heights are numbers, and none of them seems to stand for unknown points.
   subroutine check_numbers(file, name, stored, unit, warnings, error)
      type(hdf5_file_t), intent(in) :: file
      character(len=*), intent(in) :: name, unit
      real(wp), intent(in) :: stored(:, :)
      type(warning_list_t), intent(inout) :: warnings
      type(error_t), allocatable, intent(out) :: error
      type(stand_in_t) :: found
      character(len=:), allocatable :: place, points, remedy

      place = file%path//": '"//name//"'"
      remedy = "unknown points must be NaN, or named by an attribute '_FillValue' of '"//name//"'"
      if (.not. any(ieee_is_finite(stored))) then
         call bad_input(error, place//' holds no finite number')
      else if (any(.not. (ieee_is_finite(stored) .or. ieee_is_nan(stored)))) then
         call bad_input(error, place//' holds infinite values at '// &
            to_text(count(.not. (ieee_is_finite(stored) .or. ieee_is_nan(stored))))//' points (unknown points must be NaN)')
      end if
      if (allocated(error)) return
      found = find_stand_in(stored)
      if (found%points == 0) return
      points = to_text(found%points)//' points are exactly '//to_text(found%value)//' '//unit
      if (found%beyond) then
         call bad_input(error, place//': '//points//', the others '//to_text(found%lowest)//' to '//to_text(found%highest)// &
            ': that number seems to stand for unknown points; '//remedy)
      else
         call warnings%add(severity_wrong, place//': '//points//', in the mean '//to_text(found%step, 3)//' from their '// &
            'neighbours, more than the steps between all others: that number seems to stand for unknown points, and counts '// &
            'as a height; '//remedy)
      end if
   end subroutine check_numbers

   !> A unit that no dataset needs, as all state theirs, is refused where it is not that of the heights either.
   subroutine check_unit(file, names, unit, error)
      type(hdf5_file_t), intent(in) :: file
      !> Datasets of x, y and the heights
      character(len=*), intent(in) :: names(3)
      !> By unit_length
      character(len=*), intent(in) :: unit
      type(error_t), allocatable, intent(out) :: error
      character(len=:), allocatable :: text
      real(wp) :: factor
      logical :: stated
      integer :: k

      do k = 1, 3
         call find_unit(file, trim(names(k)), factor, text, stated, error, unit)
         if (allocated(error) .or. .not. stated) return
      end do
      if (abs(factor - in_metres(unit)) > 0.0_wp) call bad_input(error, file%path//": unit_length = '"//unit// &
         "' would be ignored: all datasets state their units, the heights another one; leave it out")
   end subroutine check_unit

end module microslip_io_topography_file
