!> Tests of the condensation of hidden degrees of freedom against dense algebra.
module test_fe_condensation
   use microslip_core_error, only: error_t
   use microslip_core_kinds, only: wp
   use microslip_fe_condensation, only: condense_hidden
   use microslip_linalg_sparse, only: from_triplets, symmetric_sparse_t
   use testdrive, only: check, new_unittest, test_failed, testing_error => error_type, unittest_type
   implicit none(type, external)
   private

   public :: collect_fe_condensation

   !> A chain of springs and masses with hidden points 2, 3 (one block), 5 and 8.
   integer, parameter :: n = 8
   logical, parameter :: hidden(n) = [.false., .true., .true., .false., .true., .false., .false., .true.]
   real(wp), parameter :: tolerance = 100*n*epsilon(1.0_wp)

contains

   subroutine collect_fe_condensation(testsuite)
      type(unittest_type), allocatable, intent(out) :: testsuite(:)

      testsuite = [ &
         new_unittest('static exactness', test_static), &
         new_unittest('rigid-body mass is kept', test_mass), &
         new_unittest('mass can be left out', test_without_mass), &
         new_unittest('a singular block is an error', test_singular)]
   end subroutine collect_fe_condensation

   !> Springs k between neighbours and to the ground at point 1; consistent masses.
   subroutine chain(stiffness, mass, spring_to_8)
      type(symmetric_sparse_t), intent(out) :: stiffness, mass
      real(wp), intent(in) :: spring_to_8
      integer :: k, i
      real(wp) :: spring(n - 1)
      integer :: row(3*(n - 1) + 1), column(3*(n - 1) + 1)
      real(wp) :: stiff(3*(n - 1) + 1), heavy(3*(n - 1) + 1)

      spring = [(real(k, wp), k=1, n - 1)]
      spring(n - 1) = spring_to_8
      do k = 1, n - 1
         i = 3*(k - 1)
         row(i + 1:i + 3) = [k, k, k + 1]
         column(i + 1:i + 3) = [k, k + 1, k + 1]
         stiff(i + 1:i + 3) = spring(k)*[1.0_wp, -1.0_wp, 1.0_wp]
         heavy(i + 1:i + 3) = k*[2.0_wp, 1.0_wp, 2.0_wp]
      end do
      row(size(row)) = 1
      column(size(row)) = 1
      stiff(size(row)) = 1.0_wp
      heavy(size(row)) = 0.0_wp
      stiffness = from_triplets(n, row, column, stiff)
      mass = from_triplets(n, row, column, heavy)
   end subroutine chain

   !> Full solution under a load on kept points: K u = f in full gives K' u_kept = f_kept.
   subroutine test_static(error)
      type(testing_error), allocatable, intent(out) :: error
      type(symmetric_sparse_t) :: stiffness, mass, full
      type(error_t), allocatable :: lib
      integer, allocatable :: kept(:)
      real(wp) :: u(n), force, flow
      real(wp), allocatable :: f(:)
      integer :: k

      call chain(stiffness, mass, 7.0_wp)
      full = stiffness
      call condense_hidden(stiffness, mass, hidden, .true., kept, lib)
      if (allocated(lib)) then
         call test_failed(error, lib%message)
         return
      end if
      call check(error, all(kept == pack([(k, k=1, n)],.not. hidden)), 'wrong rows kept')
      if (allocated(error)) return
      ! A unit force at point 7 and -2 at point 4: the flow through the springs is known.
      u(1) = -1.0_wp
      do k = 1, n - 1
         flow = 0.0_wp
         if (k < 4) flow = -1.0_wp
         if (k >= 4 .and. k < 7) flow = 1.0_wp
         u(k + 1) = u(k) + flow/k
      end do
      allocate (f(size(kept)))
      call stiffness%multiply(u(kept), f)
      do k = 1, size(kept)
         force = 0.0_wp
         if (kept(k) == 4) force = -2.0_wp
         if (kept(k) == 7) force = 1.0_wp
         call check(error, f(k), force, thr=tolerance*maxval(full%value))
         if (allocated(error)) return
      end do
   end subroutine test_static

   !> The hidden points follow T u; under a uniform motion of a chain that is not tied down the mass is the sum of all.
   subroutine test_mass(error)
      type(testing_error), allocatable, intent(out) :: error
      type(symmetric_sparse_t) :: stiffness, mass
      type(error_t), allocatable :: lib
      integer, allocatable :: kept(:)
      real(wp) :: total, x(n), y(n)
      real(wp), allocatable :: yk(:)

      call chain(stiffness, mass, 7.0_wp)
      x = 1.0_wp
      call mass%multiply(x, y)
      total = sum(y)
      call condense_hidden(stiffness, mass, hidden, .true., kept, lib)
      allocate (yk(size(kept)))
      call mass%multiply(x(:size(kept)), yk)
      call check(error, sum(yk), total, thr=tolerance*total)
   end subroutine test_mass

   subroutine test_without_mass(error)
      type(testing_error), allocatable, intent(out) :: error
      type(symmetric_sparse_t) :: stiffness, mass, full
      type(error_t), allocatable :: lib
      integer, allocatable :: kept(:)
      real(wp), allocatable :: d(:)

      call chain(stiffness, mass, 7.0_wp)
      full = mass
      call condense_hidden(stiffness, mass, hidden, .false., kept, lib)
      d = full%diagonal()
      call check(error, all(mass%diagonal() == d(kept)) .and. mass%entries() == size(kept) + 1, 'mass differs')
   end subroutine test_without_mass

   subroutine test_singular(error)
      type(testing_error), allocatable, intent(out) :: error
      type(symmetric_sparse_t) :: stiffness, mass
      type(error_t), allocatable :: lib
      integer, allocatable :: kept(:)

      call chain(stiffness, mass, 0.0_wp)
      call condense_hidden(stiffness, mass, hidden, .true., kept, lib)
      call check(error, allocated(lib), 'a hidden point without stiffness was condensed')
      if (allocated(error)) return
      call check(error, index(lib%message, 'row 8') > 0, 'message does not name the row: '//lib%message)
   end subroutine test_singular

end module test_fe_condensation
