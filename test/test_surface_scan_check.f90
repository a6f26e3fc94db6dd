!> Numbers that stand for unknown points and outliers in scans.
module test_surface_scan_check
   use, intrinsic :: ieee_arithmetic, only: ieee_quiet_nan, ieee_value
   use microslip_core_kinds, only: wp, pi
   use microslip_surface_scan_check, only: find_outliers, find_stand_in, stand_in_t
   use testdrive, only: check, new_unittest, test_error => error_type, unittest_type
   implicit none(type, external)
   private

   public :: collect_surface_scan_check

   integer, parameter :: nx = 41, ny = 31

contains

   subroutine collect_surface_scan_check(testsuite)
      type(unittest_type), allocatable, intent(out) :: testsuite(:)

      testsuite = [ &
         & new_unittest('numbers-beyond-the-heights', test_beyond), &
         & new_unittest('numbers-among-the-heights', test_among), &
         & new_unittest('zeros-near-a-summit-at-zero', test_small_steps), &
         & new_unittest('sound-surfaces', test_sound), &
         & new_unittest('outliers', test_outliers) &
         & ]
   end subroutine collect_surface_scan_check

   !> A hill of 10 with its top at point (30, 20), on a tilt.
   subroutine make_hill(x, y, z)
      real(wp), intent(out) :: x(nx), y(ny), z(nx, ny)
      integer :: k

      x = [(real(k, wp), k=1, nx)]
      y = [(real(k, wp), k=1, ny)]
      z = spread(0.3_wp*x, 2, ny) + 10.0_wp*exp(-((spread(x, 2, ny) - 30.0_wp)/10.0_wp)**2 &
         & - ((spread(y, 1, nx) - 20.0_wp)/8.0_wp)**2)
   end subroutine make_hill

   !> Noise without a random number: rounded fractional parts.
   subroutine make_noise(z)
      real(wp), intent(out) :: z(nx, ny)
      integer :: i, j

      do j = 1, ny
         do i = 1, nx
            z(i, j) = modulo(0.6180339887_wp*(i + nx*j)**2, 1.0_wp) - 0.5_wp
         end do
      end do
   end subroutine make_noise

   subroutine test_beyond(error)
      type(test_error), allocatable, intent(out) :: error
      real(wp), parameter :: numbers(5) = [-9999.0_wp, 1.0e10_wp, 3.4e38_wp, -3.4e38_wp, -32768.0_wp]
      real(wp) :: x(nx), y(ny), z(nx, ny)
      type(stand_in_t) :: found
      integer :: k

      do k = 1, size(numbers)
         call make_hill(x, y, z)
         z(28:32, 18:21) = numbers(k)
         z(1, 1) = ieee_value(1.0_wp, ieee_quiet_nan)
         found = find_stand_in(z)
         call check(error, found%points == 20 .and. found%beyond .and. abs(found%value - numbers(k)) <= 0.0_wp)
         if (allocated(error)) return
      end do
   end subroutine test_beyond

   !> Zeros beside a summit that is at zero: their steps are no ten times the usual ones. Cut off at that level they are sound.
   subroutine test_small_steps(error)
      type(test_error), allocatable, intent(out) :: error
      real(wp) :: x(nx), y(ny), z(nx, ny)
      type(stand_in_t) :: found

      call make_hill(x, y, z)
      z = z - maxval(z)
      z(22:24, 19:21) = 0.0_wp
      found = find_stand_in(z)
      call check(error, found%points >= 9 .and. .not. found%beyond)
      if (allocated(error)) return
      call make_hill(x, y, z)
      z = min(z - maxval(z) + 2.0_wp, 0.0_wp)
      found = find_stand_in(z)
      call check(error, found%points, 0)
   end subroutine test_small_steps

   !> Zeros on the summit, and a number just below all heights.
   subroutine test_among(error)
      type(test_error), allocatable, intent(out) :: error
      real(wp) :: x(nx), y(ny), z(nx, ny)
      type(stand_in_t) :: found

      call make_hill(x, y, z)
      z(28:32, 18:21) = 0.0_wp
      found = find_stand_in(z)
      call check(error, found%points == 20 .and. .not. found%beyond .and. abs(found%value) <= 0.0_wp)
      if (allocated(error)) return
      call check(error, found%lowest > 0.0_wp .and. found%step > 5.0_wp)
      if (allocated(error)) return
      call make_hill(x, y, z)
      z(5::9, 5::9) = -30.0_wp
      found = find_stand_in(z)
      call check(error, found%points == 5*3 .and. .not. found%beyond .and. abs(found%value + 30.0_wp) <= 0.0_wp)
   end subroutine test_among

   !> Nothing is found in a smooth surface, in noise, in steps of a converter, on plateaus, and in a flat surface.
   subroutine test_sound(error)
      type(test_error), allocatable, intent(out) :: error
      real(wp) :: x(nx), y(ny), hill(nx, ny), noise(nx, ny), z(nx, ny)
      type(stand_in_t) :: found
      integer :: k, outliers, worst(2)
      real(wp) :: deviation

      call make_hill(x, y, hill)
      call make_noise(noise)
      do k = 1, 6
         select case (k)
         case (1)
            z = hill
         case (2)
            z = noise
         case (3)
            z = hill + noise
         case (4)
            z = 0.25_wp*anint(4.0_wp*(hill + noise))
         case (5)
            z = merge(1.0_wp, 0.0_wp, hill > 8.0_wp)
         case (6)
            z = 2.0_wp
         end select
         found = find_stand_in(z)
         call check(error, found%points, 0, 'a number for unknown points was found')
         if (allocated(error)) return
         if (k == 5) cycle
         call find_outliers(x, y, z, outliers, worst, deviation)
         call check(error, outliers, 0, 'an outlier was found')
         if (allocated(error)) return
      end do
   end subroutine test_sound

   subroutine test_outliers(error)
      type(test_error), allocatable, intent(out) :: error
      real(wp) :: x(nx), y(ny), z(nx, ny), noise(nx, ny), deviation
      integer :: outliers, worst(2)

      call make_hill(x, y, z)
      call make_noise(noise)
      z = z + 0.1_wp*noise
      z(7, 9) = z(7, 9) + 40.0_wp
      z(20, 25) = z(20, 25) - 20.0_wp
      z(30, 20) = ieee_value(1.0_wp, ieee_quiet_nan)
      call find_outliers(x, y, z, outliers, worst, deviation)
      call check(error, outliers == 2 .and. all(worst == [7, 9]))
      if (allocated(error)) return
      ! The tilt over one point, the hill over one, and the noise.
      call check(error, deviation, 40.0_wp, thr=2.0_wp)
   end subroutine test_outliers

end module test_surface_scan_check
