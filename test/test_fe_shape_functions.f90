!> Quadrilateral shape functions and the inverse mapping.
module test_fe_shape_functions
   use microslip_core_kinds, only: wp
   use microslip_fe_shape_functions, only: shape_values, shape_gradients, local_coordinates
   use support_mesh, only: pseudo_random
   use testdrive, only: new_unittest, unittest_type, error_type, check
   implicit none(type, external)
   private

   public :: collect_fe_shape_functions

   real(wp), parameter :: rounding = 100*epsilon(1.0_wp)
   integer, parameter :: sizes(2) = [4, 8]
   !> A strongly distorted convex quadrilateral, and bulged mid-side nodes on its edges
   real(wp), parameter :: distorted(2, 8) = reshape([ &
      0.0_wp, 0.0_wp, 1.5_wp, 0.2_wp, 0.8_wp, 1.3_wp, 0.1_wp, 0.4_wp, &
      0.75_wp, 0.02_wp, 1.22_wp, 0.77_wp, 0.42_wp, 0.9_wp, 0.02_wp, 0.21_wp], [2, 8])

contains

   subroutine collect_fe_shape_functions(testsuite)
      type(unittest_type), allocatable, intent(out) :: testsuite(:)
      testsuite = [new_unittest('partition_of_unity', test_partition), &
                   new_unittest('one_at_own_node', test_nodes), &
                   new_unittest('gradients_by_differences', test_gradients), &
                   new_unittest('inverse_of_the_mapping', test_inverse), &
                   new_unittest('collapsed_face_is_refused', test_collapsed)]
   end subroutine collect_fe_shape_functions

   !> Points that reach beyond the face.
   pure function some_point(k) result(local)
      integer, intent(in) :: k
      real(wp) :: local(2)
      local = 2.4_wp*[pseudo_random(k), pseudo_random(k + 500)] - 1.2_wp
   end function some_point

   subroutine test_partition(error)
      type(error_type), allocatable, intent(out) :: error
      integer :: k, s

      do s = 1, 2
         do k = 1, 50
            call check(error, sum(shape_values(sizes(s), some_point(k))), 1.0_wp, thr=rounding)
            if (.not. allocated(error)) call check(error, &
               maxval(abs(sum(shape_gradients(sizes(s), some_point(k)), dim=2))) <= rounding)
            if (allocated(error)) return
         end do
      end do
   end subroutine test_partition

   subroutine test_nodes(error)
      type(error_type), allocatable, intent(out) :: error
      real(wp), parameter :: nodes(2, 8) = reshape(real([ &
         -1, -1, 1, -1, 1, 1, -1, 1, 0, -1, 1, 0, 0, 1, -1, 0], wp), [2, 8])
      real(wp) :: expected(8)
      integer :: k, s

      do s = 1, 2
         do k = 1, sizes(s)
            expected = 0.0_wp
            expected(k) = 1.0_wp
            call check(error, maxval(abs(shape_values(sizes(s), nodes(:, k)) - expected(:sizes(s)))) <= rounding)
            if (allocated(error)) return
         end do
      end do
   end subroutine test_nodes

   subroutine test_gradients(error)
      type(error_type), allocatable, intent(out) :: error
      !> Central differences are exact for the second-degree parts; the cubic ones leave h^2
      real(wp), parameter :: h = 1.0e-5_wp, tolerance = 10*(h**2 + epsilon(h)/h)
      real(wp) :: shift(2), difference(8)
      integer :: k, s, c

      do s = 1, 2
         do k = 1, 20
            associate (gradient => shape_gradients(sizes(s), some_point(k)))
               do c = 1, 2
                  shift = 0.0_wp
                  shift(c) = h
                  difference(:sizes(s)) = (shape_values(sizes(s), some_point(k) + shift) &
                                           - shape_values(sizes(s), some_point(k) - shift))/(2*h)
                  call check(error, maxval(abs(gradient(c, :) - difference(:sizes(s)))) <= tolerance)
                  if (allocated(error)) return
               end do
            end associate
         end do
      end do
   end subroutine test_gradients

   subroutine test_inverse(error)
      type(error_type), allocatable, intent(out) :: error
      !> The smallest singular value of the mapping is about 0.05
      real(wp), parameter :: tolerance = 100*rounding
      real(wp) :: point(2), local(2)
      logical :: converged
      integer :: k, s

      do s = 1, 2
         do k = 1, 200
            point = matmul(distorted(:, :sizes(s)), shape_values(sizes(s), some_point(k)/1.2_wp))
            call local_coordinates(distorted(:, :sizes(s)), point, local, converged)
            call check(error, converged)
            if (.not. allocated(error)) call check(error, maxval(abs(local - some_point(k)/1.2_wp)) <= tolerance)
            if (allocated(error)) return
         end do
      end do
   end subroutine test_inverse

   subroutine test_collapsed(error)
      type(error_type), allocatable, intent(out) :: error
      real(wp) :: line(2, 4), local(2)
      logical :: converged

      line(1, :) = [0.0_wp, 1.0_wp, 2.0_wp, 3.0_wp]
      line(2, :) = 0.0_wp
      call local_coordinates(line, [0.5_wp, 0.0_wp], local, converged)
      call check(error,.not. converged)
   end subroutine test_collapsed

end module test_fe_shape_functions
