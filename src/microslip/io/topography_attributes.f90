!> Attributes of the datasets of a surface file that change what the numbers mean: units, packing, unknown points.
!>
!> An attribute that is neither applied nor known to be harmless is told: it may mean something.
module microslip_io_topography_attributes
   use, intrinsic :: ieee_arithmetic, only: ieee_is_finite, ieee_is_nan, ieee_quiet_nan, ieee_value
   use microslip_core_error, only: bad_input, error_t
   use microslip_core_kinds, only: wp
   use microslip_core_text, only: lower_case, to_text
   use microslip_core_warning_list, only: severity_doubtful, severity_note, warning_list_t
   use microslip_io_hdf5, only: hdf5_file_t
   implicit none(type, external)
   private

   public :: find_unit, in_metres, unpack, remove_missing, report_attributes, report_masks

   !> Attributes of x, y, z that are applied or compared.
   character(len=*), parameter :: applied(*) = [character(len=20) :: 'units', 'unit', 'layout', 'scale_factor', 'add_offset', &
      'height_scale_factor', '_FillValue', 'missing_value', 'nodata', 'nodata_value']
   !> Attributes that say nothing about the numbers.
   character(len=*), parameter :: harmless(*) = [character(len=20) :: 'description', 'long_name', 'standard_name', 'comment', &
      'comments', 'title', 'name', 'axis', 'source', 'reference', 'references', 'history', 'license', 'licence', 'author', &
      'date', 'instrument', 'class', 'dimension_list', 'reference_list', 'dimension_labels', '_netcdf4dimid', &
      '_netcdf4coordinates', '_ncproperties', '_nc3_strict', 'coordinates', 'conventions', 'institution', 'attribution', &
      'format', 'version', 'program', 'unit_description']
   !> Attributes with numbers for unknown points.
   character(len=*), parameter :: missing(*) = [character(len=13) :: '_FillValue', 'missing_value', 'nodata', 'nodata_value']
   !> Parts of names of attributes that change what numbers mean.
   character(len=*), parameter :: meaningful(*) = [character(len=8) :: 'scale', 'factor', 'offset', 'unit', 'positive', &
      'direct', 'sign', 'valid', 'fill', 'missing', 'nodata', 'invalid', 'order', 'origin', 'spacing', 'invert', 'mask']

contains

   !> What a dataset's unit is in metres.
   subroutine find_unit(file, name, factor, text, stated, error, unit)
      type(hdf5_file_t), intent(in) :: file
      character(len=*), intent(in) :: name
      real(wp), intent(out) :: factor
      !> The unit as it was given
      character(len=:), allocatable, intent(out) :: text
      !> Whether the dataset states it
      logical, intent(out) :: stated
      type(error_t), allocatable, intent(out) :: error
      !> Unit of datasets that do not tell theirs
      character(len=*), intent(in), optional :: unit

      factor = 0.0_wp
      text = ''
      stated = .true.
      if (file%has_attribute(name, 'units')) then
         call file%get_attribute(name, 'units', text, error)
      else if (file%has_attribute(name, 'unit')) then
         call file%get_attribute(name, 'unit', text, error)
      end if
      if (allocated(error)) return
      text = trim(adjustl(text))
      if (text == '') then
         stated = .false.
         if (present(unit)) text = unit
      end if
      factor = in_metres(text)
      if (factor > 0.0_wp) return
      if (text == '') then
         call bad_input(error, file%path//": '"//name//"' has no attribute 'units': give its unit (m, mm, um, nm)")
      else
         call bad_input(error, file%path//": '"//name//"' has the unit '"//printable(text)//"' (m, mm, um, nm are known)")
      end if
   end subroutine find_unit

   !> A unit of length in metres, 0 if it is not known.
   pure real(wp) function in_metres(text)
      character(len=*), intent(in) :: text
      !> The micro sign in Latin-1
      character, parameter :: micro = char(181)

      in_metres = 0.0_wp
      select case (text)
      case ('m', 'metre', 'metres', 'meter', 'meters')
         in_metres = 1.0_wp
      case ('mm', 'millimetre', 'millimetres', 'millimeter', 'millimeters')
         in_metres = 1.0e-3_wp
      case ('um', 'µm', 'μm', micro//'m', 'micron', 'microns', 'micrometre', 'micrometres', 'micrometer', 'micrometers')
         in_metres = 1.0e-6_wp
      case ('nm', 'nanometre', 'nanometres', 'nanometer', 'nanometers')
         in_metres = 1.0e-9_wp
      end select
   end function in_metres

   !> A text without control characters and bytes that are no ASCII.
   pure function printable(text) result(clean)
      character(len=*), intent(in) :: text
      character(len=len(text)) :: clean
      integer :: k

      clean = text
      do k = 1, len(text)
         if (ichar(text(k:k)) < 32 .or. ichar(text(k:k)) > 126) clean(k:k) = '?'
      end do
   end function printable

   !> How stored numbers become values: value = factor * stored + offset, in the dataset's unit (CF conventions).
   subroutine unpack(file, name, factor, offset, warnings, error)
      type(hdf5_file_t), intent(in) :: file
      character(len=*), intent(in) :: name
      real(wp), intent(out) :: factor, offset
      type(warning_list_t), intent(inout) :: warnings
      type(error_t), allocatable, intent(out) :: error
      real(wp) :: own

      factor = 1.0_wp
      offset = 0.0_wp
      call file%get_attribute(name, 'scale_factor', factor, error, default=1.0_wp)
      if (.not. allocated(error)) call file%get_attribute(name, 'add_offset', offset, error, default=0.0_wp)
      if (.not. allocated(error) .and. file%has_attribute(name, 'height_scale_factor')) then
         call file%get_attribute(name, 'height_scale_factor', own, error)
         if (.not. allocated(error) .and. file%has_attribute(name, 'scale_factor')) call bad_input(error, file%path//": '"// &
            name//"' has both 'scale_factor' and 'height_scale_factor': leave one")
         if (.not. allocated(error)) factor = own
      end if
      if (allocated(error)) return
      if (.not. (ieee_is_finite(factor) .and. ieee_is_finite(offset))) then
         call bad_input(error, file%path//": '"//name//"': its scale factor and offset must be finite")
      else if (factor == 0.0_wp) then
         call bad_input(error, file%path//": '"//name//"': its scale factor is 0")
      else if (abs(factor - 1.0_wp) > 0.0_wp .or. abs(offset) > 0.0_wp) then
         if (file%holds_integers(name)) then
            call warnings%add(severity_note, file%path//": '"//name//"' holds packed numbers: multiplied by "// &
               to_text(factor)//', plus '//to_text(offset)//', as its attributes say')
         else
            call warnings%add(severity_doubtful, file%path//": '"//name//"' was multiplied by "//to_text(factor)//', plus '// &
               to_text(offset)//', as its attributes say, but it holds no integers: is it unpacked already?')
         end if
      end if
   end subroutine unpack

   !> Points with a number that an attribute names as missing become unknown, NaN.
   subroutine remove_missing(file, name, z, warnings, error)
      type(hdf5_file_t), intent(in) :: file
      character(len=*), intent(in) :: name
      !> Stored numbers
      real(wp), intent(inout) :: z(:, :)
      type(warning_list_t), intent(inout) :: warnings
      type(error_t), allocatable, intent(out) :: error
      real(wp) :: value
      integer :: k, n

      do k = 1, size(missing)
         if (.not. file%has_attribute(name, trim(missing(k)))) cycle
         call file%get_attribute(name, trim(missing(k)), value, error)
         if (allocated(error)) return
         if (ieee_is_nan(value)) cycle
         ! Numbers in single precision may have lost their last digits in the attribute or in the data.
         n = count(is_equal(z, value))
         where (is_equal(z, value)) z = ieee_value(1.0_wp, ieee_quiet_nan)
         if (n > 0) call warnings%add(severity_note, file%path//": '"//name//"': "//to_text(n)//' points have the number '// &
            to_text(value)//" of the attribute '"//trim(missing(k))//"': they count as unknown")
      end do
   end subroutine remove_missing

   !> Equal in single precision.
   elemental logical function is_equal(number, value)
      real(wp), intent(in) :: number, value

      is_equal = .false.
      if (ieee_is_nan(number)) return
      if (ieee_is_finite(number) .and. ieee_is_finite(value)) then
         is_equal = abs(number - value) <= epsilon(1.0)*abs(value)
      else
         is_equal = number == value
      end if
   end function is_equal

   !> Attributes that are not used.
   subroutine report_attributes(file, name, warnings)
      type(hdf5_file_t), intent(in) :: file
      !> A dataset, or '/'
      character(len=*), intent(in) :: name
      type(warning_list_t), intent(inout) :: warnings
      type(error_t), allocatable :: error
      character(len=255), allocatable :: names(:)
      character(len=:), allocatable :: unknown, doubtful
      integer :: k

      call file%attributes(name, names, error)
      if (allocated(error)) return
      unknown = ''
      doubtful = ''
      do k = 1, size(names)
         if (any(names(k) == applied) .and. name /= '/') cycle
         if (any(lower_case(names(k)) == harmless)) cycle
         if (is_meaningful(lower_case(trim(names(k))))) then
            doubtful = doubtful//" '"//printable(trim(names(k)))//"'"
         else
            unknown = unknown//" '"//printable(trim(names(k)))//"'"
         end if
      end do
      if (doubtful /= '') call warnings%add(severity_doubtful, file%path//": '"//name//"' has the attributes"//doubtful// &
         ', which are not used: if they change what its numbers mean, apply them before')
      if (unknown /= '' .and. name /= '/') call warnings%add(severity_note, file%path//": '"//name//"' has the attributes"// &
         unknown//', which are not known and not used')
   end subroutine report_attributes

   !> Datasets beside axes and heights that say which heights are known.
   subroutine report_masks(file, warnings)
      type(hdf5_file_t), intent(in) :: file
      type(warning_list_t), intent(inout) :: warnings
      type(error_t), allocatable :: error
      character(len=255), allocatable :: names(:)
      integer :: k

      call file%members('/', names, error)
      if (allocated(error)) return
      do k = 1, size(names)
         if (any([index(lower_case(names(k)), 'mask'), index(lower_case(names(k)), 'valid'), &
            index(lower_case(names(k)), 'missing')] > 0)) call warnings%add(severity_doubtful, file%path// &
            ": the dataset '"//trim(names(k))//"' is not used: unknown points must be NaN in the heights")
      end do
   end subroutine report_masks

   !> Whether the name of an attribute sounds as if it changed what numbers mean.
   pure logical function is_meaningful(name)
      character(len=*), intent(in) :: name
      integer :: k

      is_meaningful = any([(index(name, trim(meaningful(k))) > 0, k=1, size(meaningful))])
   end function is_meaningful

end module microslip_io_topography_attributes
