!> Surfaces by formula, levelling and touching.
module test_surface_topography
   use microslip_core_error, only: error_t, status_bad_input
   use microslip_core_kinds, only: wp
   use microslip_surface_topography, only: topography_t, flat_t, hill_t, waviness_t, new_hill, new_waviness
   use testdrive, only: new_unittest, unittest_type, test_error => error_type, check
   implicit none(type, external)
   private

   public :: collect_surface_topography

   real(wp), parameter :: lower(2) = [-25.4e-3_wp, -15.875e-3_wp], upper(2) = -lower
   real(wp), parameter :: height_pp = 12.14e-6_wp
   !> Rounding relative to the heights
   real(wp), parameter :: tol = 1.0e-13_wp

contains

   subroutine collect_surface_topography(testsuite)
      type(unittest_type), allocatable, intent(out) :: testsuite(:)

      testsuite = [ &
         & new_unittest('flat', test_flat), &
         & new_unittest('hill', test_hill), &
         & new_unittest('hill-off-centre', test_hill_off_centre), &
         & new_unittest('waviness', test_waviness), &
         & new_unittest('levelling', test_levelling), &
         & new_unittest('bad-input', test_bad_input) &
         & ]
   end subroutine collect_surface_topography

   !> Points of the pad, outside the bore round the summit.
   function pad_points(summit) result(position)
      real(wp), intent(in) :: summit(2)
      real(wp), allocatable :: position(:, :)
      integer, parameter :: nx = 40, ny = 26
      real(wp) :: all_points(2, nx*ny)
      integer :: i, j, k

      do j = 1, ny
         do i = 1, nx
            all_points(:, i + nx*(j - 1)) = lower + (upper - lower)*[(i - 0.5_wp)/nx, (j - 0.5_wp)/ny]
         end do
      end do
      associate (r => hypot(all_points(1, :) - summit(1), all_points(2, :) - summit(2)))
         position = all_points(:, pack([(k, k=1, nx*ny)], r > 4.365e-3_wp))
      end associate
   end function pad_points

   subroutine test_flat(error)
      type(test_error), allocatable, intent(out) :: error
      class(topography_t), allocatable :: surface
      type(error_t), allocatable :: problem
      real(wp), allocatable :: h(:)

      allocate (flat_t :: surface)
      call surface%heights(pad_points([0.0_wp, 0.0_wp]), h, problem)
      call check(error, .not. allocated(problem) .and. all(h == 0.0_wp))
   end subroutine test_flat

   !> Asked peak-to-peak, highest point at zero and next to the bore, falling outwards, flat at the edges.
   subroutine test_hill(error)
      type(test_error), allocatable, intent(out) :: error
      type(hill_t) :: hill
      type(error_t), allocatable :: problem
      real(wp), allocatable :: position(:, :), h(:)
      integer :: highest

      call new_hill(hill, lower, upper, [0.0_wp, 0.0_wp], height_pp, problem)
      position = pad_points([0.0_wp, 0.0_wp])
      call hill%heights(position, h, problem)
      call check(error, maxval(h) >= 0.0_wp .and. maxval(h) <= 0.0_wp)
      if (allocated(error)) return
      call check(error, -minval(h), height_pp, thr=tol*height_pp)
      if (allocated(error)) return
      highest = maxloc(h, dim=1)
      call check(error, norm2(position(:, highest)) < 5.5e-3_wp, 'the summit is not at the bore')
      if (allocated(error)) return
      call check(error, maxval(h + height_pp, mask=norm2(position, dim=1) > 0.95_wp*norm2(upper)) < 0.02_wp*height_pp, &
         & 'not flat at the corner')
      if (allocated(error)) return
      ! Round: the height falls with the distance alone, the same along both axes.
      call hill%heights(reshape([0.0_wp, 0.0_wp, 7.0e-3_wp, 0.0_wp, 0.0_wp, -7.0e-3_wp, 9.0e-3_wp, 0.0_wp, upper], [2, 5]), &
         & h, problem)
      call check(error, abs(h(2) - h(3)) <= tol*height_pp .and. h(4) < h(3), 'not round')
   end subroutine test_hill

   !> Continuous over the summit's lines and symmetric only where it should be.
   subroutine test_hill_off_centre(error)
      type(test_error), allocatable, intent(out) :: error
      real(wp), parameter :: summit(2) = [5.0e-3_wp, -2.0e-3_wp]
      type(hill_t) :: hill, hollow
      type(error_t), allocatable :: problem
      real(wp), allocatable :: h(:), turned(:)

      call new_hill(hill, lower, upper, summit, height_pp, problem)
      call hill%heights(reshape([summit, summit - [1.0e-9_wp, 0.0_wp], summit + [1.0e-9_wp, 0.0_wp], upper, lower, &
         & lower(1), upper(2)], [2, 6]), h, problem)
      call check(error, h(1) >= h(2) .and. maxval(abs(h(:3))) < 1.0e-12_wp*height_pp)
      if (allocated(error)) return
      ! Upside down and half as high: the corner that is farthest touches.
      call new_hill(hollow, lower, upper, summit, height_pp, problem, scale=-0.5_wp)
      call hollow%heights(reshape([summit, lower(1), upper(2)], [2, 2]), turned, problem)
      call check(error, abs(turned(1) + 0.5_wp*height_pp) <= tol*height_pp .and. abs(turned(2)) <= tol*height_pp)
      if (allocated(error)) return
      ! The lowest point is the farthest corner, here that of low t1 and high t2.
      call check(error, abs(h(6) + height_pp) <= tol*height_pp .and. all(h(4:5) > h(6)))
   end subroutine test_hill_off_centre

   subroutine test_waviness(error)
      type(test_error), allocatable, intent(out) :: error
      type(waviness_t) :: wave
      type(error_t), allocatable :: problem
      real(wp), allocatable :: h(:)

      call new_waviness(wave, 1.0e-6_wp, 2.0e-3_wp, acos(0.6_wp), problem)
      call wave%heights(reshape([0.0_wp, 0.0_wp, 0.6e-3_wp, 0.8e-3_wp, -0.8e-3_wp, 0.6e-3_wp], [2, 3]), h, problem)
      call check(error, maxval(abs(h - [0.0_wp, -2.0e-6_wp, 0.0_wp])) <= tol*1.0e-6_wp)
   end subroutine test_waviness

   !> Plane levelling makes the surface orthogonal to planes, and does nothing the second time; mean levelling without
   !> touching gives zero mean.
   subroutine test_levelling(error)
      type(test_error), allocatable, intent(out) :: error
      type(hill_t) :: hill
      type(error_t), allocatable :: problem
      real(wp), allocatable :: position(:, :), h(:)

      call new_hill(hill, lower, upper, [5.0e-3_wp, -2.0e-3_wp], height_pp, problem)
      position = pad_points([5.0e-3_wp, -2.0e-3_wp])
      call hill%set_levelling('mean', problem, touching=.false.)
      call hill%heights(position, h, problem)
      call check(error, abs(sum(h)) <= tol*height_pp*size(h))
      if (allocated(error)) return
      call check(error, abs(dot_product(h, position(1, :))) > 1.0e-3_wp*size(h)*height_pp*upper(1), 'nothing to level')
      if (allocated(error)) return
      call hill%set_levelling('Plane', problem, touching=.false.)
      call hill%heights(position, h, problem)
      call check(error, maxval(abs([sum(h), matmul(position, h)/upper])) <= tol*height_pp*size(h))
      if (allocated(error)) return
      call hill%set_levelling('plane', problem, touching=.true.)
      call hill%heights(position, h, problem)
      call check(error, maxval(h), 0.0_wp, thr=tol*height_pp)
   end subroutine test_levelling

   subroutine test_bad_input(error)
      type(test_error), allocatable, intent(out) :: error
      type(hill_t) :: hill
      type(waviness_t) :: wave
      type(error_t), allocatable :: problem

      call new_hill(hill, lower, upper, [0.0_wp, 0.1_wp], height_pp, problem)
      call expect('summit outside')
      if (allocated(error)) return
      call new_hill(hill, lower, upper, [0.0_wp, 0.0_wp], -height_pp, problem)
      call expect('negative height')
      if (allocated(error)) return
      call new_waviness(wave, 1.0_wp, 0.0_wp, 0.0_wp, problem)
      call expect('wavelength zero')
      if (allocated(error)) return
      call hill%set_levelling('cubic', problem)
      call expect('unknown levelling')

   contains

      subroutine expect(what)
         character(len=*), intent(in) :: what
         call check(error, allocated(problem), what//' accepted')
         if (allocated(error)) return
         call check(error, problem%status, status_bad_input)
      end subroutine expect

   end subroutine test_bad_input

end module test_surface_topography
