!> The grid of boundary-element cells: geometry, numbering, holes, maps, refused input.
module test_halfspace_grid
   use, intrinsic :: ieee_arithmetic, only: ieee_is_nan
   use microslip_core_error, only: error_t, status_bad_input
   use microslip_core_kinds, only: wp, pi
   use microslip_halfspace_grid, only: be_grid_t, new_grid
   use testdrive, only: new_unittest, unittest_type, test_error => error_type, check
   implicit none(type, external)
   private

   public :: collect_halfspace_grid

   real(wp), parameter :: lower(2) = [-2.0_wp, 1.0_wp], upper(2) = [4.0_wp, 5.0_wp]

contains

   subroutine collect_halfspace_grid(testsuite)
      type(unittest_type), allocatable, intent(out) :: testsuite(:)

      testsuite = [ &
         & new_unittest('rectangle', test_rectangle), &
         & new_unittest('hole', test_hole), &
         & new_unittest('map', test_map), &
         & new_unittest('bad-input', test_bad_input) &
         & ]
   end subroutine collect_halfspace_grid

   subroutine test_rectangle(error)
      type(test_error), allocatable, intent(out) :: error
      type(be_grid_t) :: grid
      type(error_t), allocatable :: problem

      call new_grid(grid, lower, upper, 6, 8, problem)
      call check(error, .not. allocated(problem) .and. grid%point_count() == 48)
      if (allocated(error)) return
      call check(error, grid%cell_area()*grid%point_count(), 24.0_wp, thr=1.0e-14_wp)
      if (allocated(error)) return
      call check(error, all(grid%ix(:7) == [1, 2, 3, 4, 5, 6, 1]) .and. all(grid%iy(:7) == [1, 1, 1, 1, 1, 1, 2]))
      if (allocated(error)) return
      call check(error, maxval(abs(sum(grid%position, dim=2)/48 - 0.5_wp*(lower + upper))) <= 1.0e-14_wp)
   end subroutine test_rectangle

   !> The area that is left converges to rectangle less circle; the mask acts on top.
   subroutine test_hole(error)
      type(test_error), allocatable, intent(out) :: error
      real(wp), parameter :: hole(3, 1) = reshape([1.1_wp, 2.9_wp, 0.9_wp], [3, 1])
      type(be_grid_t) :: grid
      type(error_t), allocatable :: problem
      logical :: mask(120, 80)

      mask = .true.
      mask(1, :) = .false.
      call new_grid(grid, lower, upper, 120, 80, problem, holes=hole, mask=mask)
      call check(error, .not. allocated(problem))
      if (allocated(error)) return
      call check(error, grid%cell_area()*grid%point_count(), 24.0_wp - 0.05_wp*4.0_wp - pi*0.9_wp**2, thr=0.02_wp)
      if (allocated(error)) return
      call check(error, minval(hypot(grid%position(1, :) - 1.1_wp, grid%position(2, :) - 2.9_wp)) >= 0.9_wp)
      if (allocated(error)) return
      call check(error, minval(grid%ix) == 2)
   end subroutine test_hole

   !> Point values go to the map and back.
   subroutine test_map(error)
      type(test_error), allocatable, intent(out) :: error
      type(be_grid_t) :: grid
      type(error_t), allocatable :: problem
      real(wp), allocatable :: map(:, :), values(:)

      call new_grid(grid, lower, upper, 6, 4, problem, holes=reshape([1.0_wp, 3.0_wp, 0.8_wp], [3, 1]))
      call check(error, .not. allocated(problem) .and. grid%point_count() == 20)
      if (allocated(error)) return
      values = grid%position(1, :) + 10.0_wp*grid%position(2, :)
      map = grid%to_map(values)
      call check(error, all(ieee_is_nan(map) .neqv. grid%inside))
      if (allocated(error)) return
      call check(error, map(5, 2), grid%x(5) + 10.0_wp*grid%y(2))
      if (allocated(error)) return
      call check(error, all(grid%from_map(map) == values))
   end subroutine test_map

   subroutine test_bad_input(error)
      type(test_error), allocatable, intent(out) :: error
      type(be_grid_t) :: grid
      type(error_t), allocatable :: problem

      call new_grid(grid, lower, upper, 0, 4, problem)
      call expect('no cells')
      if (allocated(error)) return
      call new_grid(grid, upper, lower, 6, 4, problem)
      call expect('empty extent')
      if (allocated(error)) return
      call new_grid(grid, lower, upper, 6, 4, problem, holes=reshape([1.0_wp, 3.0_wp, 0.0_wp], [3, 1]))
      call expect('hole without radius')
      if (allocated(error)) return
      call new_grid(grid, lower, upper, 6, 4, problem, holes=reshape([1.0_wp, 3.0_wp, 9.0_wp], [3, 1]))
      call expect('hole over everything')
      if (allocated(error)) return
      call new_grid(grid, lower, upper, 2, 1, problem, mask=reshape([.true., .false.], [1, 2]))
      call expect('mask of another shape')

   contains

      subroutine expect(what)
         character(len=*), intent(in) :: what
         call check(error, allocated(problem), what//' accepted')
         if (allocated(error)) return
         call check(error, problem%status, status_bad_input)
      end subroutine expect

   end subroutine test_bad_input

end module test_halfspace_grid
