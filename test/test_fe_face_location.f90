!> Locating points in the faces of an interface.
module test_fe_face_location
   use microslip_core_kinds, only: wp, pi
   use microslip_fe_face_location, only: locate_points
   use microslip_fe_shape_functions, only: shape_values
   use support_mesh, only: pseudo_random
   use testdrive, only: new_unittest, unittest_type, error_type, check
   implicit none(type, external)
   private

   public :: collect_fe_face_location

   real(wp), parameter :: rounding = 100*epsilon(1.0_wp)

contains

   subroutine collect_fe_face_location(testsuite)
      type(unittest_type), allocatable, intent(out) :: testsuite(:)
      testsuite = [new_unittest('many_points_in_a_ring', test_ring), &
                   new_unittest('curved_faces_hold_the_circle', test_curved), &
                   new_unittest('sliver_needs_overhang', test_sliver), &
                   new_unittest('points_on_edges_belong', test_edges), &
                   new_unittest('no_faces_no_points', test_none)]
   end subroutine collect_fe_face_location

   !> Ring of radii 1 ... 2 round the origin: `around` x `rings` faces of 4 or 8 nodes, nodes on true circles.
   subroutine ring(around, rings, quadratic, position, faces)
      integer, intent(in) :: around, rings
      logical, intent(in) :: quadratic
      real(wp), allocatable, intent(out) :: position(:, :)
      integer, allocatable, intent(out) :: faces(:, :)
      integer :: i, j

      allocate (faces(8, around*rings), source=0)
      allocate (position(2, 2*around*(2*rings + 1)))
      do j = 0, 2*rings
         do i = 0, 2*around - 1
            position(:, number(i, j)) = (1.0_wp + 0.5_wp*j/rings)*[cos(pi*i/around), sin(pi*i/around)]
         end do
      end do
      do j = 0, rings - 1
         do i = 0, around - 1
            associate (a => 2*i, b => 2*j)
               faces(:4, 1 + i + around*j) = [number(a, b), number(a, b + 2), number(a + 2, b + 2), number(a + 2, b)]
               if (quadratic) faces(5:, 1 + i + around*j) = &
                  [number(a, b + 1), number(a + 1, b + 2), number(a + 2, b + 1), number(a + 1, b)]
            end associate
         end do
      end do

   contains

      pure integer function number(i, j)
         integer, intent(in) :: i, j
         number = 1 + mod(i, 2*around) + 2*around*j
      end function number

   end subroutine ring

   !> Points spread over the ring between two radii.
   function spread_points(n, inner, outer) result(points)
      integer, intent(in) :: n
      real(wp), intent(in) :: inner, outer
      real(wp) :: points(2, n)
      integer :: k
      do k = 1, n
         points(:, k) = (inner + (outer - inner)*pseudo_random(k))*[cos(0.7_wp*k), sin(0.7_wp*k)]
      end do
   end function spread_points

   !> Largest distance between points and the places that their local coordinates stand for.
   function largest_miss(position, faces, points, face, local) result(miss)
      real(wp), intent(in) :: position(:, :), points(:, :), local(:, :)
      integer, intent(in) :: faces(:, :), face(:)
      real(wp) :: miss
      integer :: k, n

      miss = 0.0_wp
      do k = 1, size(face)
         if (face(k) == 0) cycle
         n = merge(8, 4, faces(5, face(k)) > 0)
         miss = max(miss, norm2(points(:, k) - matmul(position(:, faces(:n, face(k))), shape_values(n, local(:, k)))))
      end do
   end function largest_miss

   subroutine test_ring(error)
      type(error_type), allocatable, intent(out) :: error
      integer, parameter :: n = 5000, around = 60, rings = 10
      real(wp), allocatable :: position(:, :)
      integer, allocatable :: faces(:, :)
      real(wp) :: points(2, n), local(2, n)
      integer :: face(n), k

      call ring(around, rings, .false., position, faces)
      ! The chords lie inside the circles by up to 1 - cos(pi/around)
      points = spread_points(n, 1.0_wp, 2.0_wp*cos(pi/around))
      call locate_points(position, faces, points, face, local)
      call check(error, all(face > 0), 'every point is found')
      if (.not. allocated(error)) call check(error, maxval(abs(local)) <= 1.0_wp + 1.0e-7_wp)
      if (.not. allocated(error)) call check(error, largest_miss(position, faces, points, face, local) <= rounding)
      if (allocated(error)) return
      ! The sector follows from the angle
      do k = 1, n
         call check(error, mod(face(k) - 1, around), &
                    mod(int(modulo(atan2(points(2, k), points(1, k)), 2*pi)*around/(2*pi)), around))
         if (allocated(error)) return
      end do
      call locate_points(position, faces, spread_points(n, 0.0_wp, cos(pi/around) - 1.0e-6_wp), face, local)
      call check(error, all(face == 0), 'the bore is cut out')
      if (allocated(error)) return
      call locate_points(position, faces, spread_points(n, 2.0_wp + 1.0e-6_wp, 9.0_wp), face, local)
      call check(error, all(face == 0), 'outside is cut off')
   end subroutine test_ring

   subroutine test_curved(error)
      type(error_type), allocatable, intent(out) :: error
      integer, parameter :: n = 2000, around = 16
      real(wp), allocatable :: position(:, :)
      integer, allocatable :: faces(:, :)
      real(wp) :: points(2, n), local(2, n), sag
      integer :: face(n)

      call ring(around, 3, .true., position, faces)
      ! A parabola through three points of a circle misses it by about (angle/2)^4/4 of the radius at most
      sag = 2.0_wp*(pi/around)**4/4
      points = spread_points(n, 1.0_wp + sag, 2.0_wp - sag)
      call locate_points(position, faces, points, face, local)
      call check(error, all(face > 0))
      if (.not. allocated(error)) call check(error, largest_miss(position, faces, points, face, local) <= rounding)
   end subroutine test_curved

   subroutine test_sliver(error)
      type(error_type), allocatable, intent(out) :: error
      integer, parameter :: n = 1000, around = 12
      real(wp), allocatable :: position(:, :)
      integer, allocatable :: faces(:, :)
      real(wp) :: points(2, n), local(2, n), overhang
      integer :: face(n)

      call ring(around, 2, .false., position, faces)
      points = spread_points(n, 2.0_wp - 1.0e-6_wp, 2.0_wp)
      call locate_points(position, faces, points, face, local)
      call check(error, count(face == 0) > n/2, 'most of the circle lies outside the polygon')
      if (allocated(error)) return
      ! Sag of the chord, in half widths of the outer faces (about 0.25, a little less on the chord side)
      overhang = 2.0_wp*(1 - cos(pi/around))/0.24_wp
      call locate_points(position, faces, points, face, local, overhang)
      call check(error, all(face > around), 'given to the outer faces')
      if (.not. allocated(error)) call check(error, maxval(abs(local)) <= 1.0_wp + 1.0e-7_wp + overhang)
      if (.not. allocated(error)) call check(error, largest_miss(position, faces, points, face, local) <= rounding)
   end subroutine test_sliver

   subroutine test_edges(error)
      type(error_type), allocatable, intent(out) :: error
      real(wp), allocatable :: position(:, :)
      integer, allocatable :: faces(:, :), face(:)
      real(wp), allocatable :: local(:, :)

      call ring(9, 4, .true., position, faces)
      allocate (face(size(position, 2)), local(2, size(position, 2)))
      call locate_points(position, faces, position, face, local)
      ! Middles of faces are no nodes of them but lie inside
      call check(error, all(face > 0))
   end subroutine test_edges

   subroutine test_none(error)
      type(error_type), allocatable, intent(out) :: error
      real(wp) :: local(2, 3)
      integer :: face(3), no_faces(8, 0)

      call locate_points(reshape([0.0_wp, 0.0_wp], [2, 1]), no_faces, spread_points(3, 0.0_wp, 1.0_wp), face, local)
      call check(error, all(face == 0))
   end subroutine test_none

end module test_fe_face_location
