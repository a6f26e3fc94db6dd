!> Tests of reading measured topography: the shipped scan, layouts, units, errors.
module test_io_topography_file
   use, intrinsic :: ieee_arithmetic, only: ieee_is_nan, ieee_quiet_nan, ieee_value
   use microslip_core_error, only: error_t
   use microslip_core_kinds, only: wp
   use microslip_core_warning_list, only: severity_doubtful, severity_note, severity_wrong, warning_list_t
   use microslip_io_hdf5, only: hdf5_file_t
   use microslip_io_topography_file, only: read_topography_hdf5
   use testdrive, only: check, new_unittest, test_failed, testing_error => error_type, unittest_type
   implicit none(type, external)
   private

   public :: collect_io_topography_file

   character(len=*), parameter :: scratch = 'build/test_io_topography_file.h5'
   real(wp), parameter :: x_mm(3) = [0.0_wp, 1.0_wp, 2.0_wp], y_mm(2) = [-1.0_wp, 1.0_wp]
   !> Rounding of one multiplication by the unit.
   real(wp), parameter :: tolerance = 4*epsilon(1.0_wp)

contains

   subroutine collect_io_topography_file(testsuite)
      type(unittest_type), allocatable, intent(out) :: testsuite(:)

      testsuite = [ &
         new_unittest('the shipped Brake-Reuss scan', test_shipped), &
         new_unittest('both layouts and units', test_layouts), &
         new_unittest('a square grid goes by its layout', test_square), &
         new_unittest('units in words', test_units), &
         new_unittest('packed numbers', test_packed), &
         new_unittest('numbers for unknown points', test_stand_ins), &
         new_unittest('attributes that are not used', test_attributes), &
         new_unittest('other formats are named', test_formats), &
         new_unittest('wrong files are named', test_wrong)]
   end subroutine collect_io_topography_file

   !> What is known of it: 120 x 25.4 mm and some margin, 109 um peak to valley, 596 points unknown, least gap 0.
   subroutine test_shipped(error)
      type(testing_error), allocatable, intent(out) :: error
      real(wp), allocatable :: x(:), y(:), z(:, :)
      type(error_t), allocatable :: lib

      call read_topography_hdf5('input/brb_mesoscale_gap.h5', x, y, z, lib)
      if (allocated(lib)) then
         call test_failed(error, lib%message)
         return
      end if
      call check(error, all(shape(z) == [246, 54]) .and. size(x) == 246 .and. size(y) == 54, 'shape differs')
      if (allocated(error)) return
      call check(error, count(ieee_is_nan(z)), 596)
      if (allocated(error)) return
      call check(error, minval(z, .not. ieee_is_nan(z)), 0.0_wp)
      if (allocated(error)) return
      call check(error, maxval(z, .not. ieee_is_nan(z)), 109.0e-6_wp, thr=0.5e-6_wp)
      if (allocated(error)) return
      call check(error, x(246) - x(1) > 0.120_wp .and. y(54) - y(1) > 0.0254_wp, 'extent differs')
   end subroutine test_shipped

   subroutine test_layouts(error)
      type(testing_error), allocatable, intent(out) :: error
      real(wp), allocatable :: x(:), y(:), z(:, :)
      real(wp) :: z_um(3, 2)
      type(error_t), allocatable :: lib
      integer :: layout

      z_um = reshape([1.0_wp, 2.0_wp, 3.0_wp, 4.0_wp, ieee_value(1.0_wp, ieee_quiet_nan), 6.0_wp], [3, 2])
      do layout = 1, 2
         if (layout == 1) call write_grid(z_um)
         if (layout == 2) call write_grid(transpose(z_um))
         call read_topography_hdf5(scratch, x, y, z, lib)
         if (allocated(lib)) then
            call test_failed(error, lib%message)
            return
         end if
         call check(error, all(shape(z) == [3, 2]), 'shape differs')
         if (allocated(error)) return
         call check(error, maxval(abs(x - 1.0e-3_wp*x_mm)) <= tolerance .and. maxval(abs(y - 1.0e-3_wp*y_mm)) <= tolerance, &
            'axes differ')
         if (allocated(error)) return
         call check(error, ieee_is_nan(z(2, 2)) .and. abs(z(3, 1) - 3.0e-6_wp) <= tolerance, 'heights differ')
         if (allocated(error)) return
      end do
      call remove()
   end subroutine test_layouts

   !> By key, attribute or dimension scales, and not at all where these are missing or contradict one another.
   subroutine test_square(error)
      type(testing_error), allocatable, intent(out) :: error
      character(len=*), parameter :: texts(5) = [character(len=40) :: 'z[y,x], rows are lines of the scan', 'z[J, I]', &
         'gap[i,j] at x[i], y[j]; NaN = no data', 'z[x,y]', 'rows are lines']
      !> Of z(1, 2): the Fortran array (1, 2; 3, 4 by columns) is [[1, 2], [3, 4]] in the file; 0: refused.
      real(wp), parameter :: right(5) = [3.0_wp, 3.0_wp, 2.0_wp, 2.0_wp, 0.0_wp]
      real(wp), allocatable :: x(:), y(:), z(:, :)
      type(hdf5_file_t) :: file
      type(error_t), allocatable :: lib
      integer :: k

      call write_square(file)
      call read_square(layout='')
      call check(error, allocated(lib), 'a square was taken without a layout')
      if (allocated(error)) return
      call check(error, index(lib%message, 'layout') > 0, lib%message)
      if (allocated(error)) return
      call read_square(layout='z[x,y]')
      call expect(2.0_wp, 'key z[x,y]')
      if (allocated(error)) return
      call read_square(layout='z[y,x]')
      call expect(3.0_wp, 'key z[y,x]')
      if (allocated(error)) return
      do k = 1, size(texts)
         call write_square(file, trim(texts(k)))
         call read_square(layout='')
         call expect(right(k), trim(texts(k)))
         if (allocated(error)) return
      end do
      call write_square(file, 'z[y,x]')
      call read_square(layout='z[x,y]')
      call expect(0.0_wp, 'key and attribute contradict one another')
      if (allocated(error)) return
      do k = 1, 2
         call write_square(file, scale_of_x=k)
         call read_square(layout='')
         call expect(merge(3.0_wp, 2.0_wp, k == 1), 'dimension scales')
         if (allocated(error)) return
      end do
      call remove()

   contains

      subroutine read_square(layout)
         character(len=*), intent(in) :: layout
         if (layout == '') then
            call read_topography_hdf5(scratch, x, y, z, lib)
         else
            call read_topography_hdf5(scratch, x, y, z, lib, layout=layout)
         end if
      end subroutine read_square

      subroutine expect(value, what)
         real(wp), intent(in) :: value
         character(len=*), intent(in) :: what
         if (value > 0.0_wp) then
            call check(error, .not. allocated(lib), what//' was refused')
            if (.not. allocated(error)) call check(error, z(1, 2), value, what)
         else
            call check(error, allocated(lib), what//' was not refused')
         end if
      end subroutine expect

   end subroutine test_square

   !> Two by two heights in m.
   subroutine write_square(file, layout, scale_of_x)
      type(hdf5_file_t), intent(inout) :: file
      character(len=*), intent(in), optional :: layout
      !> Dimension of the heights, as Fortran counts, whose scale x becomes; y that of the other
      integer, intent(in), optional :: scale_of_x
      type(error_t), allocatable :: lib

      call file%create(scratch, lib)
      call file%write('x', y_mm, 'm', 'axis', lib)
      call file%write('y', y_mm, 'm', 'axis', lib)
      call file%write('z', reshape([1.0_wp, 2.0_wp, 3.0_wp, 4.0_wp], [2, 2]), 'm', 'heights', lib)
      if (present(layout)) call file%set_attribute('z', 'layout', layout, lib)
      if (present(scale_of_x)) then
         call file%make_scale('x', 'x', lib)
         call file%make_scale('y', 'y', lib)
         call file%attach_scale('z', scale_of_x, 'x', lib)
         call file%attach_scale('z', 3 - scale_of_x, 'y', lib)
      end if
      call file%close(lib)
   end subroutine write_square

   subroutine test_units(error)
      type(testing_error), allocatable, intent(out) :: error
      character(len=*), parameter :: texts(9) = [character(len=12) :: 'm', 'mm', 'um', 'nm', 'micrometer', 'micrometre', &
         char(181)//'m', 'µm', 'μm']
      real(wp), parameter :: factor(9) = [1.0_wp, 1.0e-3_wp, 1.0e-6_wp, 1.0e-9_wp, 1.0e-6_wp, 1.0e-6_wp, 1.0e-6_wp, 1.0e-6_wp, &
         1.0e-6_wp]
      real(wp), allocatable :: x(:), y(:), z(:, :)
      type(hdf5_file_t) :: file
      type(error_t), allocatable :: lib
      integer :: k

      do k = 1, size(texts)
         call write_grid(spread(x_mm, 2, 2))
         call file%open(scratch, lib, writable=.true.)
         call file%set_attribute('z', 'units', trim(texts(k)), lib)
         call file%close(lib)
         call read_topography_hdf5(scratch, x, y, z, lib)
         call check(error, .not. allocated(lib), 'refused: '//trim(texts(k)))
         if (.not. allocated(error)) call check(error, z(3, 1), 2.0_wp*factor(k), thr=4*epsilon(1.0_wp)*factor(k))
         if (allocated(error)) return
      end do
      ! The last one is in um: a unit for datasets that state none contradicts it and is used by none.
      call read_topography_hdf5(scratch, x, y, z, lib, unit='m')
      call check(error, allocated(lib), 'a unit that no dataset takes was ignored')
      call remove()
   end subroutine test_units

   !> scale_factor, add_offset and height_scale_factor are applied.
   subroutine test_packed(error)
      type(testing_error), allocatable, intent(out) :: error
      real(wp), allocatable :: x(:), y(:), z(:, :)
      type(hdf5_file_t) :: file
      type(error_t), allocatable :: lib
      type(warning_list_t) :: warnings

      call write_grid(spread(x_mm, 2, 2))
      call file%open(scratch, lib, writable=.true.)
      call file%set_attribute('z', 'scale_factor', 0.5_wp, lib)
      call file%set_attribute('z', 'add_offset', 3.0_wp, lib)
      call file%set_attribute('x', 'scale_factor', 2.0_wp, lib)
      call file%close(lib)
      call read_topography_hdf5(scratch, x, y, z, lib, warnings=warnings)
      call check(error, .not. allocated(lib))
      if (allocated(error)) return
      call check(error, abs(z(3, 2) - 4.0e-6_wp) <= tolerance .and. abs(x(3) - 4.0e-3_wp) <= tolerance, 'packing was not applied')
      if (allocated(error)) return
      ! Of x and of z, which hold no integers.
      call check(error, warnings%number() == 2 .and. warnings%severity(2) == severity_doubtful)
      if (allocated(error)) return
      call file%open(scratch, lib, writable=.true.)
      call file%write('z', spread([0, 1, 2], 2, 2), 'um', 'heights', lib)
      call file%set_attribute('z', 'scale_factor', 0.5_wp, lib)
      call file%write('x', x_mm, 'mm', 'axis', lib)
      call file%set_attribute('x', 'scale_factor', 1.0_wp, lib)
      call file%write('mask', [0, 1], '1', 'which are known', lib)
      call file%close(lib)
      warnings = warning_list_t()
      call read_topography_hdf5(scratch, x, y, z, lib, warnings=warnings)
      call check(error, warnings%number() == 2 .and. index(warnings%text(1), 'mask') > 0)
      if (allocated(error)) return
      call write_grid(spread(x_mm, 2, 2))
      call file%open(scratch, lib, writable=.true.)
      call file%set_attribute('z', 'height_scale_factor', 0.01_wp, lib)
      call file%close(lib)
      call read_topography_hdf5(scratch, x, y, z, lib)
      call check(error, abs(z(3, 2) - 0.02e-6_wp) <= tolerance, 'height_scale_factor was not applied')
      if (allocated(error)) return
      call file%open(scratch, lib, writable=.true.)
      call file%set_attribute('z', 'scale_factor', 0.01_wp, lib)
      call file%close(lib)
      call read_topography_hdf5(scratch, x, y, z, lib)
      call check(error, allocated(lib), 'two factors were taken')
      call remove()
   end subroutine test_packed

   !> A number that an attribute names is unknown; one that none names is refused or told.
   subroutine test_stand_ins(error)
      type(testing_error), allocatable, intent(out) :: error
      integer, parameter :: n = 9
      real(wp) :: slope(n, n)
      real(wp), allocatable :: x(:), y(:), z(:, :)
      type(hdf5_file_t) :: file
      type(error_t), allocatable :: lib
      type(warning_list_t) :: warnings
      integer :: k

      slope = spread([(10.0_wp + 0.1_wp*k, k=1, n)], 2, n) + spread([(0.01_wp*k, k=1, n)], 1, n)
      call write_heights(-9999.0_wp)
      call read_topography_hdf5(scratch, x, y, z, lib, layout='z[x,y]')
      call check(error, allocated(lib), '-9999 was taken as a height')
      if (allocated(error)) return
      call check(error, index(lib%message, '9 points are exactly -9999 um') > 0, lib%message)
      if (allocated(error)) return
      call file%open(scratch, lib, writable=.true.)
      call file%set_attribute('z', '_FillValue', -9999.0_wp, lib)
      call file%close(lib)
      call read_topography_hdf5(scratch, x, y, z, lib, layout='z[x,y]', warnings=warnings)
      call check(error, .not. allocated(lib) .and. warnings%number() == 1)
      if (allocated(error)) return
      call check(error, count(ieee_is_nan(z)), 9)
      if (allocated(error)) return
      call write_heights(0.0_wp)
      warnings = warning_list_t()
      call read_topography_hdf5(scratch, x, y, z, lib, layout='z[x,y]', warnings=warnings)
      ! Zero is beyond the heights of this slope.
      call check(error, allocated(lib), '0 was taken as a height')
      if (allocated(error)) return
      slope = slope - 10.0_wp
      slope(1, 1) = -0.2_wp
      call write_heights(0.0_wp)
      call read_topography_hdf5(scratch, x, y, z, lib, layout='z[x,y]', warnings=warnings)
      call check(error, .not. allocated(lib) .and. warnings%number() == 1)
      if (allocated(error)) return
      call check(error, warnings%severity(1), severity_wrong)
      call remove()

   contains

      subroutine write_heights(unknown)
         real(wp), intent(in) :: unknown
         real(wp) :: heights(n, n)
         integer :: i

         heights = slope
         heights(6:8, 6:8) = unknown
         call file%create(scratch, lib)
         call file%write('x', [(real(i, wp), i=1, n)], 'mm', 'axis', lib)
         call file%write('y', [(real(i, wp), i=1, n)], 'mm', 'axis', lib)
         call file%write('z', heights, 'um', 'heights', lib)
         call file%close(lib)
      end subroutine write_heights

   end subroutine test_stand_ins

   subroutine test_attributes(error)
      type(testing_error), allocatable, intent(out) :: error
      real(wp), allocatable :: x(:), y(:), z(:, :)
      type(hdf5_file_t) :: file
      type(error_t), allocatable :: lib
      type(warning_list_t) :: warnings

      call write_grid(spread(x_mm, 2, 2))
      call file%open(scratch, lib, writable=.true.)
      call file%set_attribute('z', 'operator', 'somebody', lib)
      call file%set_attribute('z', 'positive', 'down', lib)
      call file%close(lib)
      call read_topography_hdf5(scratch, x, y, z, lib, warnings=warnings)
      call check(error, .not. allocated(lib) .and. warnings%number() == 2)
      if (allocated(error)) return
      call check(error, warnings%severity(1) == severity_doubtful .and. index(warnings%text(1), "'positive'") > 0)
      if (allocated(error)) return
      call check(error, warnings%severity(2) == severity_note .and. index(warnings%text(2), "'operator'") > 0)
      call remove()
   end subroutine test_attributes

   !> What is not HDF5 is named by its first bytes.
   subroutine test_formats(error)
      type(testing_error), allocatable, intent(out) :: error
      character(len=*), parameter :: bytes(8) = [character(len=12) :: 'PK'//achar(3)//achar(4)//achar(20), 'DIGITAL SURF', &
         'aISO-1.0'//new_line('a'), char(147)//'NUMPY'//achar(1)//achar(0), '0 0 1'//new_line('a'), 'CDF'//achar(1)//achar(0), &
         char(255)//char(254)//'x'//achar(0), char(137)//'PNG'//achar(0)]
      character(len=*), parameter :: names(8) = [character(len=8) :: '.x3p', '.sur', '.sdf', '.npy', 'a text', 'netCDF', &
         'UTF-16', 'binary']
      real(wp), allocatable :: x(:), y(:), z(:, :)
      type(error_t), allocatable :: lib
      integer :: unit, k

      do k = 1, size(bytes)
         open (newunit=unit, file=scratch, access='stream', form='unformatted', status='replace', action='write')
         write (unit) trim(bytes(k))
         close (unit)
         call read_topography_hdf5(scratch, x, y, z, lib)
         call check(error, allocated(lib))
         if (allocated(error)) return
         call check(error, index(lib%message, 'format not known') > 0 .and. index(lib%message, trim(names(k))) > 0, lib%message)
         if (allocated(error)) return
      end do
      call remove()
   end subroutine test_formats

   subroutine test_wrong(error)
      type(testing_error), allocatable, intent(out) :: error
      real(wp) :: z(3, 2)
      type(hdf5_file_t) :: file
      type(error_t), allocatable :: lib

      z = 1.0_wp
      call write_grid(z(:2, :))
      call expect('expected (3, 2)')
      if (allocated(error)) return
      call write_grid(ieee_value(1.0_wp, ieee_quiet_nan)*z)
      call expect('no finite number')
      if (allocated(error)) return
      call write_grid(z)
      call file%open(scratch, lib, writable=.true.)
      call file%set_attribute('y', 'units', 'inch', lib)
      call file%close(lib)
      call expect("'y' has the unit 'inch'")
      if (allocated(error)) return
      call file%open(scratch, lib, writable=.true.)
      call file%write('y', [1.0_wp, 1.0_wp], 'mm', 'not ascending', lib)
      call file%close(lib)
      call expect("'y' must hold ascending")
      if (allocated(error)) return
      call file%open(scratch, lib, writable=.true.)
      call file%delete('z', lib)
      call file%write('y', y_mm, 'mm', 'good again', lib)
      call file%close(lib)
      call expect("'height'")
      call remove()

   contains

      subroutine expect(needle)
         character(len=*), intent(in) :: needle
         real(wp), allocatable :: x(:), y(:), z(:, :)
         type(error_t), allocatable :: lib
         call read_topography_hdf5(scratch, x, y, z, lib)
         if (.not. allocated(lib)) then
            call test_failed(error, 'no error reported, expected one about '//needle)
         else if (index(lib%message, needle) == 0) then
            call test_failed(error, 'message does not name '//needle//': '//lib%message)
         end if
      end subroutine expect

   end subroutine test_wrong

   !> Axes in mm, heights in um.
   subroutine write_grid(z)
      real(wp), intent(in) :: z(:, :)
      type(hdf5_file_t) :: file
      type(error_t), allocatable :: lib
      call file%create(scratch, lib)
      call file%write('x', x_mm, 'mm', 'axis', lib)
      call file%write('y', y_mm, 'mm', 'axis', lib)
      call file%write('z', z, 'um', 'heights', lib)
      call file%close(lib)
   end subroutine write_grid

   subroutine remove()
      integer :: unit
      open (newunit=unit, file=scratch)
      close (unit, status='delete')
   end subroutine remove

end module test_io_topography_file
