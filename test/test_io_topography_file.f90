!> Tests of reading measured topography: the shipped scan, layouts, units, errors.
module test_io_topography_file
   use, intrinsic :: ieee_arithmetic, only: ieee_is_nan, ieee_quiet_nan, ieee_value
   use microslip_core_error, only: error_t
   use microslip_core_kinds, only: wp
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

   subroutine test_square(error)
      type(testing_error), allocatable, intent(out) :: error
      real(wp), allocatable :: x(:), y(:), z(:, :), z_other(:, :)
      type(hdf5_file_t) :: file
      type(error_t), allocatable :: lib

      call file%create(scratch, lib)
      call file%write('a', y_mm, 'm', 'axis', lib)
      call file%write('b', reshape([1.0_wp, 2.0_wp, 3.0_wp, 4.0_wp], [2, 2]), 'm', 'heights', lib)
      call file%close(lib)
      call read_topography_hdf5(scratch, x, y, z, lib, x_name='a', y_name='a', z_name='b')
      call file%open(scratch, lib, writable=.true.)
      call file%set_attribute('b', 'layout', 'z[y,x], rows are lines of the scan', lib)
      call file%close(lib)
      call read_topography_hdf5(scratch, x, y, z_other, lib, x_name='a', y_name='a', z_name='b')
      ! The Fortran array (1, 2; 3, 4 by columns) is [[1, 2], [3, 4]] in the file.
      call check(error, z(1, 2) == 2.0_wp .and. z_other(1, 2) == 3.0_wp, 'wrong layout')
      call remove()
   end subroutine test_square

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
