!> Matching of points by position against the search through all of them.
module test_fe_pairing
   use microslip_core_kinds, only: wp
   use microslip_fe_pairing, only: match_points
   use support_mesh, only: pseudo_random
   use testdrive, only: new_unittest, unittest_type, error_type, check
   implicit none(type, external)
   private

   public :: collect_fe_pairing

contains

   subroutine collect_fe_pairing(testsuite)
      type(unittest_type), allocatable, intent(out) :: testsuite(:)
      testsuite = [new_unittest('same_as_full_search', test_search), &
                   new_unittest('no_candidates', test_empty)]
   end subroutine collect_fe_pairing

   !> Random points, from a tolerance below the slices' width to one that spans many points.
   subroutine test_search(error)
      type(error_type), allocatable, intent(out) :: error
      integer, parameter :: n = 300
      real(wp), parameter :: tolerances(3) = [1.0e-3_wp, 3.0e-2_wp, 0.3_wp]
      real(wp) :: a(3, n), b(3, n), distance(n)
      integer :: partner(n), expected(n), k, t

      do t = 1, size(tolerances)
         do k = 1, n
            b(:, k) = [pseudo_random(k), 2*pseudo_random(k + n), 0.1_wp*pseudo_random(k + 2*n)]
            a(:, n + 1 - k) = b(:, k) + tolerances(t)*(pseudo_random([k, k + 11, k + 23]) - 0.5_wp)*1.4_wp
         end do
         do k = 1, n
            distance = norm2(b - spread(a(:, k), 2, n), dim=1)
            expected(k) = minloc(distance, dim=1)
            if (minval(distance) > tolerances(t)) expected(k) = 0
         end do
         partner = match_points(a, b, tolerances(t))
         call check(error, all(partner == expected))
         if (.not. allocated(error)) call check(error, count(expected > 0) > n/2)
         if (allocated(error)) return
      end do
   end subroutine test_search

   subroutine test_empty(error)
      type(error_type), allocatable, intent(out) :: error
      real(wp) :: nothing(3, 0)

      call check(error, all(match_points(reshape([1.0_wp, 2.0_wp, 3.0_wp], [3, 1]), nothing, 1.0_wp) == 0))
   end subroutine test_empty

end module test_fe_pairing
