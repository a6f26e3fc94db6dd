!> Topography on a regular or stretched grid from an HDF5 file: axes x, y and heights z(x, y), NaN where unknown.
!>
!> Units come from the attribute `units` or `unit` of each dataset (m, mm, um, nm), or from the caller. In the view of
!> h5py and C the heights are z[i, j] at x[i], y[j]; files in which they are z[j, i] are
!> recognised by their shape, or on a square grid by an attribute `layout` that begins with 'z[j,i]' or 'z[y,x]'.
module microslip_io_topography_file
   use, intrinsic :: ieee_arithmetic, only: ieee_is_finite, ieee_is_nan
   use microslip_core_error, only: bad_input, error_t
   use microslip_core_kinds, only: wp
   use microslip_core_text, only: lower_case, to_text
   use microslip_io_hdf5, only: hdf5_file_t
   implicit none(type, external)
   private

   public :: read_topography_hdf5

   !> Names under which heights are looked for.
   character(len=*), parameter :: height_names(*) = [character(len=6) :: 'z', 'gap', 'height']

contains

   !> Read axes and heights in metres.
   subroutine read_topography_hdf5(path, x, y, z, error, x_name, y_name, z_name, unit)
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
      type(hdf5_file_t) :: file
      type(error_t), allocatable :: ignored
      character(len=:), allocatable :: name

      call file%open(path, error)
      if (allocated(error)) return
      name = 'x'
      if (present(x_name)) name = x_name
      call read_axis(file, name, x, error, unit)
      name = 'y'
      if (present(y_name)) name = y_name
      if (.not. allocated(error)) call read_axis(file, name, y, error, unit)
      if (.not. allocated(error)) then
         if (present(z_name)) then
            name = z_name
         else
            call find_heights(file, name, error)
         end if
      end if
      if (.not. allocated(error)) call read_heights(file, name, size(x), size(y), z, error, unit)
      call file%close(ignored)
   end subroutine read_topography_hdf5

   !> Name of the dataset of heights.
   subroutine find_heights(file, name, error)
      type(hdf5_file_t), intent(in) :: file
      character(len=:), allocatable, intent(inout) :: name
      type(error_t), allocatable, intent(out) :: error
      integer :: k

      do k = 1, size(height_names)
         name = trim(height_names(k))
         if (file%has(name)) return
      end do
      call bad_input(error, file%path//": holds no dataset 'z', 'gap' or 'height': name the one with the heights")
   end subroutine find_heights

   !> An ascending axis in metres.
   subroutine read_axis(file, name, axis, error, unit)
      type(hdf5_file_t), intent(in) :: file
      character(len=*), intent(in) :: name
      real(wp), allocatable, intent(out) :: axis(:)
      type(error_t), allocatable, intent(out) :: error
      character(len=*), intent(in), optional :: unit
      real(wp) :: factor
      integer :: n

      call file%read(name, axis, error)
      if (.not. allocated(error)) call find_unit(file, name, factor, error, unit)
      if (allocated(error)) return
      n = size(axis)
      if (n < 2) then
         call bad_input(error, file%path//": '"//name//"' has "//to_text(n)//' points, at least 2 are needed')
      else if (.not. all(ieee_is_finite(axis)) .or. .not. all(axis(2:) > axis(:n - 1))) then
         call bad_input(error, file%path//": '"//name//"' must hold ascending finite numbers")
      end if
      axis = factor*axis
   end subroutine read_axis

   !> Heights in metres, (nx, ny).
   subroutine read_heights(file, name, nx, ny, z, error, unit)
      type(hdf5_file_t), intent(in) :: file
      character(len=*), intent(in) :: name
      integer, intent(in) :: nx, ny
      real(wp), allocatable, intent(out) :: z(:, :)
      type(error_t), allocatable, intent(out) :: error
      character(len=*), intent(in), optional :: unit
      character(len=:), allocatable :: layout
      real(wp), allocatable :: stored(:, :)
      real(wp) :: factor
      logical :: y_first_in_file

      call file%read(name, stored, error)
      if (.not. allocated(error)) call find_unit(file, name, factor, error, unit)
      if (.not. allocated(error)) call file%get_attribute(name, 'layout', layout, error, default='')
      if (allocated(error)) return
      ! Fortran sees the dimensions in the reverse of the file's order.
      if (nx == ny) then
         layout = lower_case(layout(index(layout, '[') + 1:))
         y_first_in_file = index(layout, 'j') == 1 .or. index(layout, 'y') == 1
      else
         y_first_in_file = size(stored, 1) == nx
      end if
      if (y_first_in_file) then
         z = factor*stored
      else
         z = factor*transpose(stored)
      end if
      if (any(shape(z) /= [nx, ny])) then
         call bad_input(error, file%path//": '"//name//"' is ("//to_text(size(stored, 2))//', '// &
            to_text(size(stored, 1))//'), expected ('//to_text(nx)//', '//to_text(ny)//') as the axes tell')
      else if (.not. any(ieee_is_finite(z))) then
         call bad_input(error, file%path//": '"//name//"' holds no finite number")
      else if (any(.not. (ieee_is_finite(z) .or. ieee_is_nan(z)))) then
         call bad_input(error, file%path//": '"//name//"' holds infinite values (unknown points must be NaN)")
      end if
   end subroutine read_heights

   !> What a dataset's unit is in metres.
   subroutine find_unit(file, name, factor, error, unit)
      type(hdf5_file_t), intent(in) :: file
      character(len=*), intent(in) :: name
      real(wp), intent(out) :: factor
      type(error_t), allocatable, intent(out) :: error
      character(len=*), intent(in), optional :: unit
      character(len=:), allocatable :: text

      factor = 1.0_wp
      text = ''
      if (present(unit)) text = unit
      if (file%has_attribute(name, 'units')) then
         call file%get_attribute(name, 'units', text, error)
      else if (file%has_attribute(name, 'unit')) then
         call file%get_attribute(name, 'unit', text, error)
      end if
      if (allocated(error)) return
      select case (trim(adjustl(text)))
      case ('m', 'metre', 'meter')
         factor = 1.0_wp
      case ('mm')
         factor = 1.0e-3_wp
      case ('um', 'µm', 'μm', 'micron')
         factor = 1.0e-6_wp
      case ('nm')
         factor = 1.0e-9_wp
      case ('')
         call bad_input(error, file%path//": '"//name//"' has no attribute 'units': give its unit (m, mm, um, nm)")
      case default
         call bad_input(error, file%path//": '"//name//"' has the unit '"//trim(text)//"' (m, mm, um, nm are known)")
      end select
   end subroutine find_unit

end module microslip_io_topography_file
