!> Tests of the archive: everything comes back to the last bit, and what does not fit is noticed.
module test_core_archive
   use, intrinsic :: ieee_arithmetic, only: ieee_is_nan, ieee_quiet_nan, ieee_value
   use microslip_core_archive, only: archive_t
   use microslip_core_kinds, only: wp
   use testdrive, only: check, new_unittest, testing_error => error_type, unittest_type
   implicit none(type, external)
   private

   public :: collect_core_archive

contains

   subroutine collect_core_archive(testsuite)
      type(unittest_type), allocatable, intent(out) :: testsuite(:)

      testsuite = [ &
         & new_unittest('all kinds there and back', test_there_and_back), &
         & new_unittest('an archive that is cut off', test_cut_off)]
   end subroutine collect_core_archive

   subroutine test_there_and_back(error)
      type(testing_error), allocatable, intent(out) :: error
      type(archive_t) :: archive
      integer :: number, other
      integer, allocatable :: numbers(:), others(:), none(:), words(:)
      logical :: flag, other_flag
      logical, allocatable :: flags(:), other_flags(:)
      real(wp) :: x, y
      real(wp), allocatable :: row(:), other_row(:), table(:, :), other_table(:, :), long(:), other_long(:)
      complex(wp), allocatable :: wave(:, :), other_wave(:, :)
      integer :: k

      number = -7
      numbers = [1, -huge(1), 0]
      flag = .true.
      flags = [.true., .false., .true.]
      x = 0.1_wp
      row = [tiny(1.0_wp), -0.0_wp, ieee_value(1.0_wp, ieee_quiet_nan), huge(1.0_wp)]
      table = reshape([1.0_wp, 2.0_wp, 3.0_wp, 4.0_wp, 5.0_wp, 6.0_wp], [2, 3])
      wave = cmplx(table, -table, wp)
      long = [(1.0_wp/k, k=1, 5000)]
      call archive%pass(number)
      call archive%pass(numbers)
      call archive%pass(none)
      call archive%pass(flag)
      call archive%pass(flags)
      call archive%pass(x)
      call archive%pass(row)
      call archive%pass(table)
      call archive%pass(wave)
      call archive%pass(long)
      words = archive%contents()
      none = [1]
      call archive%load(words)
      call archive%pass(other)
      call archive%pass(others)
      call archive%pass(none)
      call archive%pass(other_flag)
      call archive%pass(other_flags)
      call archive%pass(y)
      call archive%pass(other_row)
      call archive%pass(other_table)
      call archive%pass(other_wave)
      call archive%pass(other_long)
      call check(error, archive%sound() .and. other == number .and. all(others == numbers) .and..not. allocated(none) &
         & .and. other_flag .and. all(other_flags .eqv. flags) .and. y == x, 'numbers')
      if (allocated(error)) return
      call check(error, other_row(1) == row(1) .and. sign(1.0_wp, other_row(2)) < 0.0_wp .and. ieee_is_nan(other_row(3)) &
         & .and. other_row(4) == row(4), 'row')
      if (allocated(error)) return
      call check(error, all(shape(other_table) == [2, 3]) .and. all(other_table == table) .and. all(other_wave == wave) &
         & .and. all(other_long == long), 'tables')
   end subroutine test_there_and_back

   subroutine test_cut_off(error)
      type(testing_error), allocatable, intent(out) :: error
      type(archive_t) :: archive
      real(wp), allocatable :: row(:)
      integer, allocatable :: words(:)

      row = [1.0_wp, 2.0_wp, 3.0_wp]
      call archive%pass(row)
      words = archive%contents()
      call archive%load(words(:size(words) - 1))
      call archive%pass(row)
      call check(error, .not. archive%sound() .and. .not. allocated(row), 'not noticed')
      if (allocated(error)) return
      call archive%load([huge(1)])
      call archive%pass(row)
      call check(error, .not. archive%sound() .and. .not. allocated(row), 'a size that cannot be')
   end subroutine test_cut_off

end module test_core_archive
