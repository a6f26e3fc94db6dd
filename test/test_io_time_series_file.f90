!> Functions of time from text files.
module test_io_time_series_file
   use microslip_core_error, only: error_t, status_bad_input
   use microslip_core_kinds, only: wp
   use microslip_io_time_series_file, only: read_time_series
   use support_checks, only: good, remove
   use testdrive, only: check, new_unittest, test_failed, testing_error => error_type, unittest_type
   implicit none(type, external)
   private

   public :: collect_io_time_series_file

   character(len=*), parameter :: path = 'build/test_time_series.txt', nl = new_line('a')

contains

   subroutine collect_io_time_series_file(testsuite)
      type(unittest_type), allocatable, intent(out) :: testsuite(:)

      testsuite = [new_unittest('columns, separators and remarks', test_columns), &
         & new_unittest('many lines', test_many), &
         & new_unittest('what is wrong with a file is said', test_faults)]
   end subroutine collect_io_time_series_file

   subroutine write_file(text)
      character(len=*), intent(in) :: text
      integer :: unit
      open (newunit=unit, file=path, access='stream', form='unformatted', status='replace')
      write (unit) text
      close (unit)
   end subroutine write_file

   subroutine test_columns(error)
      type(testing_error), allocatable, intent(out) :: error
      type(error_t), allocatable :: lib
      real(wp), allocatable :: table(:, :)

      call write_file('# time force'//nl//nl//'0 1.5'//nl//'  1e-3, -2'//achar(13)//nl//'! remark'//nl//'0.5;3d2  '//nl// &
         & achar(9)//'1.0'//achar(9)//'4')
      call read_time_series(path, table, lib)
      call remove(path)
      call good(error, lib)
      if (allocated(error)) return
      call check(error, size(table, 2), 4)
      if (allocated(error)) return
      call check(error, all(abs(table - reshape([0.0_wp, 1.5_wp, 1.0e-3_wp, -2.0_wp, 0.5_wp, 300.0_wp, 1.0_wp, 4.0_wp], &
         & [2, 4])) < epsilon(1.0_wp)))
   end subroutine test_columns

   subroutine test_many(error)
      type(testing_error), allocatable, intent(out) :: error
      type(error_t), allocatable :: lib
      real(wp), allocatable :: table(:, :)
      integer :: unit, k

      open (newunit=unit, file=path, status='replace')
      write (unit, '(i0,1x,i0)') (k, -2*k, k=1, 3000)
      close (unit)
      call read_time_series(path, table, lib)
      call remove(path)
      call good(error, lib)
      if (allocated(error)) return
      call check(error, size(table, 2) == 3000 .and. nint(sum(table(1, :))) == 4501500 .and. nint(table(2, 3000)) == -6000)
   end subroutine test_many

   subroutine test_faults(error)
      type(testing_error), allocatable, intent(out) :: error

      call refused(error, '', 'at least two lines')
      call refused(error, '0 1'//nl, 'there are 1')
      call refused(error, '0 1'//nl//'0 2'//nl, 'line 2: times must ascend')
      call refused(error, '0 1'//nl//'1 x'//nl, "line 2: two numbers are needed, time and value: '1 x'")
      call refused(error, '0 1'//nl//'1'//nl, 'line 2: two numbers are needed')
      call refused(error, '0 1 2'//nl//'1 2'//nl, 'line 1: two numbers and no more')
      call refused(error, '0 NaN'//nl//'1 2'//nl, 'line 1: two numbers are needed')
      call refused(error, 'none', 'no such file')
   end subroutine test_faults

   subroutine refused(error, text, expected)
      type(testing_error), allocatable, intent(inout) :: error
      !> What the file holds; 'none': there is none
      character(len=*), intent(in) :: text, expected
      type(error_t), allocatable :: lib
      real(wp), allocatable :: table(:, :)

      if (allocated(error)) return
      if (text /= 'none') call write_file(text)
      call read_time_series(path, table, lib)
      call remove(path)
      if (.not. allocated(lib)) then
         call test_failed(error, 'not refused: '//expected)
      else
         call check(error, lib%status == status_bad_input .and. index(lib%message, expected) > 0, lib%message)
      end if
   end subroutine refused

end module test_io_time_series_file
