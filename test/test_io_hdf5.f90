!> Tests of the HDF5 layer: what is written is read back, errors are values.
module test_io_hdf5
   use microslip_core_error, only: error_t, status_bad_input
   use microslip_core_kinds, only: wp
   use microslip_io_hdf5, only: hdf5_file_t, is_hdf5_file, series_t
   use support_checks, only: good, remove
   use testdrive, only: check, new_unittest, test_failed, testing_error => error_type, unittest_type
   implicit none(type, external)
   private

   public :: collect_io_hdf5

   !> File of these tests, removed by each.
   character(len=*), parameter :: scratch = 'build/test_io_hdf5.h5'

contains

   subroutine collect_io_hdf5(testsuite)
      type(unittest_type), allocatable, intent(out) :: testsuite(:)

      testsuite = [ &
         new_unittest('numbers come back', test_numbers), &
         new_unittest('text comes back', test_text), &
         new_unittest('large arrays are compressed', test_compression), &
         new_unittest('attributes', test_attributes), &
         new_unittest('a series grows and is resumed', test_series), &
         new_unittest('dimension scales', test_scales), &
         new_unittest('overwrite, delete, list', test_overwrite), &
         new_unittest('wrong files are errors', test_wrong_files), &
         new_unittest('a file cut off anywhere is an error', test_truncated), &
         new_unittest('wrong kind or shape is an error', test_wrong_kind)]
   end subroutine collect_io_hdf5

   !> Fail the test unless a library call reported bad input that names what it is about.
   subroutine bad(error, lib, needle)
      type(testing_error), allocatable, intent(out) :: error
      type(error_t), allocatable, intent(in) :: lib
      character(len=*), intent(in) :: needle
      if (.not. allocated(lib)) then
         call test_failed(error, 'no error reported, expected one about '//needle)
      else if (index(lib%message, needle) == 0) then
         call test_failed(error, 'message does not name '//needle//': '//lib%message)
      end if
   end subroutine bad

   subroutine test_numbers(error)
      type(testing_error), allocatable, intent(out) :: error
      type(hdf5_file_t) :: file
      type(error_t), allocatable :: lib
      real(wp) :: a0, b0, a1(5), a2(3, 4), a3(2, 3, 4)
      real(wp), allocatable :: b1(:), b2(:, :), b3(:, :, :)
      integer :: i0, i1(3), i2(2, 3), i3(2, 2, 2), j0
      integer, allocatable :: j1(:), j2(:, :), j3(:, :, :), s(:)

      call random_number(a0)
      call random_number(a1)
      call random_number(a2)
      call random_number(a3)
      i0 = -7
      i1 = [1, huge(1), -huge(1)]
      i2 = reshape([1, 2, 3, 4, 5, 6], [2, 3])
      i3 = reshape([1, 2, 3, 4, 5, 6, 7, 8], [2, 2, 2])
      call file%create(scratch, lib)
      if (.not. allocated(lib)) call file%write('/deep/in/groups/a0', a0, 'm', 'a number', lib)
      if (.not. allocated(lib)) call file%write('/a1', a1, 'm', 'numbers', lib)
      if (.not. allocated(lib)) call file%write('/deep/a2', a2, 'm', 'numbers', lib)
      if (.not. allocated(lib)) call file%write('/deep/a3', a3, 'm', 'numbers', lib)
      if (.not. allocated(lib)) call file%write('/row', a2(2, :), 'm', 'a row, not contiguous', lib)
      if (.not. allocated(lib)) call file%write('/i0', i0, '1', 'an integer', lib)
      if (.not. allocated(lib)) call file%write('/i1', i1, '1', 'integers', lib)
      if (.not. allocated(lib)) call file%write('/i2', i2, '1', 'integers', lib)
      if (.not. allocated(lib)) call file%write('/i3', i3, '1', 'integers', lib)
      if (.not. allocated(lib)) call file%write('/nothing', a1(:0), 'm', 'no numbers', lib)
      if (.not. allocated(lib)) call file%close(lib)
      if (.not. allocated(lib)) call file%open(scratch, lib)
      if (.not. allocated(lib)) call file%read('/deep/in/groups/a0', b0, lib)
      if (.not. allocated(lib)) call file%read('/a1', b1, lib)
      if (.not. allocated(lib)) call file%read('/deep/a2', b2, lib)
      if (.not. allocated(lib)) call file%read('/deep/a3', b3, lib)
      if (.not. allocated(lib)) call file%read('/i0', j0, lib)
      if (.not. allocated(lib)) call file%read('/i1', j1, lib)
      if (.not. allocated(lib)) call file%read('/i2', j2, lib)
      if (.not. allocated(lib)) call file%read('/i3', j3, lib)
      if (.not. allocated(lib)) call file%shape_of('/deep/a3', s, lib)
      call good(error, lib)
      if (allocated(error)) return
      call check(error, b0 == a0 .and. all(b1 == a1) .and. all(b2 == a2) .and. all(b3 == a3), 'reals differ')
      if (allocated(error)) return
      call check(error, j0 == i0 .and. all(j1 == i1) .and. all(j2 == i2) .and. all(j3 == i3), 'integers differ')
      if (allocated(error)) return
      call check(error, all(s == shape(a3)), 'shape differs')
      if (allocated(error)) return
      call file%read('/row', b1, lib)
      call check(error, all(b1 == a2(2, :)), 'a row that is not contiguous differs')
      if (allocated(error)) return
      call file%read('/nothing', b1, lib)
      call check(error, .not. allocated(lib) .and. size(b1) == 0, 'an empty array does not come back')
      if (allocated(error)) return
      call file%read('/i1', b1, lib)
      call check(error, .not. allocated(lib) .and. all(b1 == real(i1, wp)), 'integers read as reals differ')
      call file%close(lib)
      call remove(scratch)
   end subroutine test_numbers

   subroutine test_text(error)
      type(testing_error), allocatable, intent(out) :: error
      type(hdf5_file_t) :: file
      type(error_t), allocatable :: lib
      character(len=:), allocatable :: a, b(:), long, empty

      long = repeat('&case title = "µm" /'//new_line('a'), 5000)
      call file%create(scratch, lib)
      if (.not. allocated(lib)) call file%write('/setup/input', long, 'the input', lib)
      if (.not. allocated(lib)) call file%write('/names', [character(len=9) :: 'sensor 1', '', 'x'], 'names', lib)
      if (.not. allocated(lib)) call file%write('/empty', '', 'no text', lib)
      if (.not. allocated(lib)) call file%close(lib)
      if (.not. allocated(lib)) call file%open(scratch, lib)
      if (.not. allocated(lib)) call file%read('/setup/input', a, lib)
      if (.not. allocated(lib)) call file%read('/names', b, lib)
      if (.not. allocated(lib)) call file%read('/empty', empty, lib)
      call good(error, lib)
      if (allocated(error)) return
      call check(error, a == long .and. len(a) == len(long), 'long text differs')
      if (allocated(error)) return
      call check(error, size(b) == 3 .and. b(1) == 'sensor 1' .and. b(2) == '' .and. b(3) == 'x', 'names differ')
      if (allocated(error)) return
      call check(error, len(empty), 0)
      call file%close(lib)
      call remove(scratch)
   end subroutine test_text

   subroutine test_compression(error)
      type(testing_error), allocatable, intent(out) :: error
      integer, parameter :: n = 50000
      type(hdf5_file_t) :: file
      type(error_t), allocatable :: lib
      real(wp) :: a(2, n)
      real(wp), allocatable :: b(:, :)
      integer :: k, bytes(0:1), level

      a = spread([(real(k/10, wp), k=1, n)], 1, 2)
      do level = 0, 1
         call file%create(scratch, lib, compression=level)
         if (.not. allocated(lib)) call file%write('/a', a, 'm', 'repeating numbers', lib)
         if (.not. allocated(lib)) call file%close(lib)
         if (.not. allocated(lib)) call file%open(scratch, lib)
         if (.not. allocated(lib)) call file%read('/a', b, lib)
         call good(error, lib)
         if (allocated(error)) return
         call check(error, all(a == b), 'numbers differ')
         if (allocated(error)) return
         call file%close(lib)
         inquire (file=scratch, size=bytes(level))
      end do
      call check(error, bytes(1) < bytes(0)/10, 'compression does not compress')
      if (allocated(error)) return
      call check(error, bytes(0) > 16*n, 'level 0 compresses')
      call remove(scratch)
   end subroutine test_compression

   subroutine test_attributes(error)
      type(testing_error), allocatable, intent(out) :: error
      type(hdf5_file_t) :: file
      type(error_t), allocatable :: lib
      character(len=:), allocatable :: text, units, preset
      real(wp) :: x, y
      integer :: i, j

      call file%create(scratch, lib)
      if (.not. allocated(lib)) call file%set_attribute('/', 'program', 'something else', lib)
      if (.not. allocated(lib)) call file%set_attribute('/', 'program', 'microslip', lib)
      if (.not. allocated(lib)) call file%write('/group/a', 1.0_wp, 'N/m', 'a stiffness', lib)
      if (.not. allocated(lib)) call file%set_attribute('/group/a', 'factor', 0.1_wp, lib)
      if (.not. allocated(lib)) call file%set_attribute('/group', 'count', 3, lib)
      if (.not. allocated(lib)) call file%close(lib)
      if (.not. allocated(lib)) call file%open(scratch, lib)
      if (.not. allocated(lib)) call file%get_attribute('/', 'program', text, lib)
      if (.not. allocated(lib)) call file%get_attribute('/group/a', 'units', units, lib)
      if (.not. allocated(lib)) call file%get_attribute('/', 'missing', preset, lib, default='preset')
      if (.not. allocated(lib)) call file%get_attribute('/group/a', 'factor', x, lib)
      if (.not. allocated(lib)) call file%get_attribute('/group/a', 'missing', y, lib, default=2.0_wp)
      if (.not. allocated(lib)) call file%get_attribute('/group', 'count', i, lib)
      if (.not. allocated(lib)) call file%get_attribute('/group', 'missing', j, lib, default=5)
      call good(error, lib)
      if (allocated(error)) return
      call check(error, text == 'microslip' .and. units == 'N/m' .and. preset == 'preset', 'texts differ')
      if (allocated(error)) return
      call check(error, x == 0.1_wp .and. y == 2.0_wp .and. i == 3 .and. j == 5, 'numbers differ')
      if (allocated(error)) return
      call file%get_attribute('/group', 'missing', j, lib)
      call bad(error, lib, "'missing'")
      if (allocated(error)) return
      call file%get_attribute('/', 'program', x, lib)
      call bad(error, lib, "'program'")
      if (allocated(error)) return
      call file%get_attribute('/group/a', 'factor', text, lib)
      call bad(error, lib, "'factor'")
      call file%close(lib)
      call remove(scratch)
   end subroutine test_attributes

   subroutine test_series(error)
      type(testing_error), allocatable, intent(out) :: error
      integer, parameter :: components = 3, blocks = 5, steps = 400
      type(hdf5_file_t) :: file
      type(series_t) :: time, sensor, field, count
      type(error_t), allocatable :: lib
      real(wp) :: block(components, steps), fields(2, components, steps)
      real(wp), allocatable :: t(:), x(:, :), f(:, :, :), some(:, :)
      integer, allocatable :: c(:, :)
      integer :: k, b

      call file%create(scratch, lib)
      if (.not. allocated(lib)) call time%create(file, '/transient/time', [integer ::], 's', 'time', lib)
      if (.not. allocated(lib)) call sensor%create(file, '/transient/sensor', [components], 'm', 'sensors', lib)
      if (.not. allocated(lib)) call field%create(file, '/transient/gap', [2, components], 'm', 'gap', lib)
      if (.not. allocated(lib)) call count%create(file, '/transient/stick', [2], '1', 'count', lib, integers=.true.)
      do b = 1, blocks
         block = reshape([(real(k, wp), k=1, size(block))], shape(block)) + b*1000.0_wp
         fields = spread(block, 1, 2)
         if (.not. allocated(lib)) call time%append(block(1, :), lib)
         if (.not. allocated(lib)) call sensor%append(block, lib)
         if (.not. allocated(lib)) call field%append(fields, lib)
         if (.not. allocated(lib)) call count%append(nint(block(:2, :)), lib)
         if (b == 3 .and. .not. allocated(lib)) call file%flush(lib)
      end do
      call good(error, lib)
      if (allocated(error)) return
      call sensor%append(block(:2, :), lib)
      call bad(error, lib, '/transient/sensor')
      if (allocated(error)) return
      call count%append(block(1, :), lib)
      call bad(error, lib, '/transient/stick')
      if (allocated(error)) return
      call check(error, sensor%step_count(), blocks*steps)
      if (allocated(error)) return
      call time%close(lib)
      call sensor%close(lib)
      call field%close(lib)
      call count%close(lib)
      call file%close(lib)

      ! Resume after the first block, then read everything.
      call file%open(scratch, lib, writable=.true.)
      if (.not. allocated(lib)) call sensor%open(file, '/transient/sensor', lib, keep=steps)
      if (.not. allocated(lib)) call sensor%append(block(:, :1), lib)
      if (.not. allocated(lib)) call sensor%read_steps(2, steps, some, lib)
      if (.not. allocated(lib)) call sensor%close(lib)
      if (.not. allocated(lib)) call file%read('/transient/time', t, lib)
      if (.not. allocated(lib)) call file%read('/transient/sensor', x, lib)
      if (.not. allocated(lib)) call file%read('/transient/gap', f, lib)
      if (.not. allocated(lib)) call file%read('/transient/stick', c, lib)
      call good(error, lib)
      if (allocated(error)) return
      call check(error, size(t) == blocks*steps .and. t(steps + 1) == 2001.0_wp, 'time differs')
      if (allocated(error)) return
      call check(error, all(shape(x) == [components, steps + 1]), 'the series was not cut and continued')
      if (allocated(error)) return
      call check(error, all(some == x(:, 2:)), 'some steps differ')
      if (allocated(error)) return
      call check(error, all(x(:, steps + 1) == block(:, 1)) .and. x(2, 1) == 1002.0_wp, 'sensors differ')
      if (allocated(error)) return
      call check(error, all(f(:, :, (blocks - 1)*steps + 1:) == fields), 'fields differ')
      if (allocated(error)) return
      call check(error, all(c(:, (blocks - 1)*steps + 1:) == nint(block(:2, :))), 'counts differ')
      if (allocated(error)) return
      call sensor%open(file, '/transient/sensor', lib, keep=blocks*steps)
      call bad(error, lib, '/transient/sensor')
      call sensor%close(lib)
      call file%close(lib)
      call remove(scratch)
   end subroutine test_series

   subroutine test_scales(error)
      type(testing_error), allocatable, intent(out) :: error
      type(hdf5_file_t) :: file
      type(error_t), allocatable :: lib
      real(wp) :: a(2, 3)
      character(len=:), allocatable :: class, name

      a = 1.0_wp
      call file%create(scratch, lib)
      if (.not. allocated(lib)) call file%write('/grid/x', [1.0_wp, 2.0_wp], 'm', 'x', lib)
      if (.not. allocated(lib)) call file%write('/grid/y', [1.0_wp, 2.0_wp, 3.0_wp], 'm', 'y', lib)
      if (.not. allocated(lib)) call file%write('/grid/a', a, 'Pa', 'pressure', lib)
      if (.not. allocated(lib)) call file%make_scale('/grid/x', 'x', lib)
      if (.not. allocated(lib)) call file%make_scale('/grid/y', 'y', lib)
      if (.not. allocated(lib)) call file%attach_scale('/grid/a', 1, '/grid/x', lib)
      if (.not. allocated(lib)) call file%attach_scale('/grid/a', 2, '/grid/y', lib)
      if (.not. allocated(lib)) call file%attach_scale('/grid/a', 2, '/grid/y', lib)
      if (.not. allocated(lib)) call file%get_attribute('/grid/x', 'CLASS', class, lib)
      if (.not. allocated(lib)) call file%get_attribute('/grid/x', 'NAME', name, lib)
      call good(error, lib)
      if (allocated(error)) return
      call check(error, class == 'DIMENSION_SCALE' .and. name == 'x', 'not a dimension scale')
      if (allocated(error)) return
      call check(error, file%has_attribute('/grid/a', 'DIMENSION_LIST'), 'no scale attached')
      if (allocated(error)) return
      call file%attach_scale('/grid/a', 3, '/grid/x', lib)
      call bad(error, lib, '/grid/a')
      ! Datasets that were replaced leave the scale as useful as before, whatever lies where they were.
      call file%delete('/grid/a', lib)
      if (.not. allocated(lib)) call file%write('/grid/other', 'text', 'lies there now', lib)
      if (.not. allocated(lib)) call file%write('/grid/b', a, 'Pa', 'pressure', lib)
      if (.not. allocated(lib)) call file%attach_scale('/grid/b', 1, '/grid/x', lib)
      if (.not. allocated(lib)) call file%attach_scale('/grid/b', 2, '/grid/y', lib)
      if (.not. allocated(error)) call good(error, lib)
      call file%close(lib)
      call remove(scratch)
   end subroutine test_scales

   subroutine test_overwrite(error)
      type(testing_error), allocatable, intent(out) :: error
      type(hdf5_file_t) :: file
      type(error_t), allocatable :: lib
      real(wp), allocatable :: b(:)
      character(len=:), allocatable :: units
      character(len=255), allocatable :: names(:)

      call file%create(scratch, lib)
      if (.not. allocated(lib)) call file%write('/g/a', [1.0_wp, 2.0_wp], 'm', 'first', lib)
      if (.not. allocated(lib)) call file%write('/g/a', [3.0_wp, 4.0_wp], 'mm', 'same shape', lib)
      if (.not. allocated(lib)) call file%read('/g/a', b, lib)
      if (.not. allocated(lib)) call file%get_attribute('/g/a', 'units', units, lib)
      call good(error, lib)
      if (allocated(error)) return
      call check(error, all(b == [3.0_wp, 4.0_wp]) .and. units == 'mm', 'not written in place')
      if (allocated(error)) return
      call file%write('/g/a', [1, 2, 3], 'm', 'other kind and shape', lib)
      if (.not. allocated(lib)) call file%require_group('/g/more/groups', lib)
      if (.not. allocated(lib)) call file%read('/g/a', b, lib)
      if (.not. allocated(lib)) call file%members('/g', names, lib)
      call good(error, lib)
      if (allocated(error)) return
      call check(error, size(b), 3)
      if (allocated(error)) return
      call check(error, size(names) == 2 .and. names(1) == 'a' .and. names(2) == 'more', 'wrong list of members')
      if (allocated(error)) return
      call file%delete('/g/a', lib)
      call file%delete('/g/a', lib)
      call check(error, file%has('/g') .and. .not. file%has('/g/a') .and. .not. file%has('/nowhere/a'), 'not removed')
      call file%close(lib)
      call remove(scratch)
   end subroutine test_overwrite

   subroutine test_wrong_files(error)
      type(testing_error), allocatable, intent(out) :: error
      type(hdf5_file_t) :: file
      type(error_t), allocatable :: lib
      integer :: unit

      call file%create('build/no_such_folder/result.h5', lib)
      call bad(error, lib, 'build/no_such_folder/result.h5')
      if (allocated(error)) return
      call check(error, lib%status, status_bad_input)
      if (allocated(error)) return
      call file%open('build/no_such_file.h5', lib)
      call bad(error, lib, 'build/no_such_file.h5')
      if (allocated(error)) return
      open (newunit=unit, file=scratch)
      write (unit, '(a)') 'this is text'
      close (unit)
      call check(error,.not. is_hdf5_file(scratch), 'text taken for HDF5')
      if (allocated(error)) return
      call file%open(scratch, lib)
      call bad(error, lib, scratch)
      if (allocated(error)) return
      call check(error,.not. file%is_open(), 'open after an error')
      if (allocated(error)) return
      call file%close(lib)
      call check(error,.not. allocated(lib), 'closing a closed file fails')
      if (allocated(error)) return
      call check(error,.not. file%has('/'), 'a closed file holds something')
      call remove(scratch)
   end subroutine test_wrong_files

   subroutine test_truncated(error)
      type(testing_error), allocatable, intent(out) :: error
      type(hdf5_file_t) :: file
      type(error_t), allocatable :: lib, ignored
      real(wp) :: a(3000)
      real(wp), allocatable :: b(:)
      character(len=1), allocatable :: bytes(:)
      integer :: unit, length, part

      call random_number(a)
      call file%create(scratch, lib)
      if (.not. allocated(lib)) call file%write('/group/a', a, 'm', 'numbers', lib)
      if (.not. allocated(lib)) call file%close(lib)
      call good(error, lib)
      if (allocated(error)) return
      inquire (file=scratch, size=length)
      allocate (bytes(length))
      open (newunit=unit, file=scratch, access='stream', form='unformatted')
      read (unit) bytes
      close (unit)
      do part = 1, 10
         call remove(scratch)
         open (newunit=unit, file=scratch, access='stream', form='unformatted')
         write (unit) bytes(:length*(part - 1)/10)
         close (unit)
         call file%open(scratch, lib)
         if (.not. allocated(lib)) call file%read('/group/a', b, lib)
         call check(error, allocated(lib), 'a file that is cut off was read')
         if (allocated(error)) return
         call file%close(ignored)
      end do
      ! Damage in the middle: an error or other numbers, never a crash.
      do part = 1, 40
         call remove(scratch)
         open (newunit=unit, file=scratch, access='stream', form='unformatted')
         write (unit) bytes
         write (unit, pos=1 + 100*part) repeat(achar(171), 64)
         close (unit)
         call file%open(scratch, lib)
         if (.not. allocated(lib)) call file%read('/group/a', b, lib)
         call file%close(ignored)
      end do
      call remove(scratch)
   end subroutine test_truncated

   subroutine test_wrong_kind(error)
      type(testing_error), allocatable, intent(out) :: error
      type(hdf5_file_t) :: file
      type(error_t), allocatable :: lib
      real(wp), allocatable :: b(:), b2(:, :)
      integer, allocatable :: j(:)
      character(len=:), allocatable :: text

      call file%create(scratch, lib)
      call file%write('/a', [1.5_wp], 'm', 'reals', lib)
      call file%write('/text', 'text', 'text', lib)
      call file%read('/missing', b, lib)
      call bad(error, lib, '/missing')
      if (allocated(error)) return
      call file%read('/a', b2, lib)
      call bad(error, lib, '/a')
      if (allocated(error)) return
      call file%read('/a', j, lib)
      call bad(error, lib, '/a')
      if (allocated(error)) return
      call file%read('/a', text, lib)
      call bad(error, lib, '/a')
      if (allocated(error)) return
      call file%read('/text', b, lib)
      call bad(error, lib, '/text')
      if (allocated(error)) return
      call file%read('/', b, lib)
      call bad(error, lib, "'/'")
      if (allocated(error)) return
      call file%write('/a/b', 1.0_wp, 'm', 'below a dataset', lib)
      call bad(error, lib, '/a/b')
      if (allocated(error)) return
      call file%close(lib)
      call file%open(scratch, lib)
      call file%write('/c', 1.0_wp, 'm', 'into a file open for reading', lib)
      call bad(error, lib, '/c')
      call file%close(lib)
      call remove(scratch)
   end subroutine test_wrong_kind

end module test_io_hdf5
