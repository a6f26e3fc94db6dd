!> Reading problems of FCLib: the three storage forms, and files that are refused.
module test_io_fclib
   use microslip_contact_problem, only: contact_problem_t
   use microslip_core_error, only: mslip_error => error_t, status_bad_input
   use microslip_core_kinds, only: wp
   use microslip_io_fclib, only: read_fclib
   use microslip_io_hdf5, only: hdf5_file_t
   use support_checks, only: good, remove
   use testdrive, only: new_unittest, unittest_type, error_type, check
   implicit none(type, external)
   private

   public :: collect_io_fclib

   character(len=*), parameter :: path = 'test_fclib.hdf5'
   !> W = [4 0 1; 0 5 0; 2 0 6], with room for more entries than there are.
   real(wp), parameter :: W(3, 3) = reshape([4.0_wp, 0.0_wp, 2.0_wp, 0.0_wp, 5.0_wp, 0.0_wp, 1.0_wp, 0.0_wp, 6.0_wp], [3, 3])
   real(wp), parameter :: by_columns(7) = [4.0_wp, 2.0_wp, 5.0_wp, 1.0_wp, 6.0_wp, 9.0_wp, 9.0_wp]
   real(wp), parameter :: by_rows(7) = [4.0_wp, 1.0_wp, 5.0_wp, 2.0_wp, 6.0_wp, 9.0_wp, 9.0_wp]

contains

   subroutine collect_io_fclib(testsuite)
      type(unittest_type), allocatable, intent(out) :: testsuite(:)
      testsuite = [ &
         & new_unittest('three storage forms', test_forms), &
         & new_unittest('files that are refused', test_refused)]
   end subroutine collect_io_fclib

   !> A file of one contact; `extra` is a further dataset.
   subroutine write_file(nz, p, i, x, q, dimensions, extra)
      integer, intent(in) :: nz, p(:), i(:), dimensions
      real(wp), intent(in) :: x(:), q(:)
      character(len=*), intent(in) :: extra
      type(hdf5_file_t) :: file
      type(mslip_error), allocatable :: failed

      call file%create(path, failed)
      call file%require_group('/fclib_local/W', failed)
      call file%require_group('/fclib_local/vectors', failed)
      call file%write('/fclib_local/spacedim', [dimensions], '1', 'dimensions', failed)
      call file%write('/fclib_local/W/m', [3], '1', 'rows', failed)
      call file%write('/fclib_local/W/n', [3], '1', 'columns', failed)
      call file%write('/fclib_local/W/nz', [nz], '1', 'form', failed)
      call file%write('/fclib_local/W/p', p, '1', 'pointers', failed)
      call file%write('/fclib_local/W/i', i, '1', 'indices', failed)
      call file%write('/fclib_local/W/x', x, '1', 'entries', failed)
      call file%write('/fclib_local/vectors/q', q, '1', 'free velocities', failed)
      call file%write('/fclib_local/vectors/mu', [0.7_wp], '1', 'friction', failed)
      if (extra /= '') call file%write('/fclib_local/'//extra, [1], '1', 'more', failed)
      call file%close(failed)
   end subroutine write_file

   subroutine test_forms(error)
      type(error_type), allocatable, intent(out) :: error
      real(wp), parameter :: q(3) = [-1.0_wp, 0.2_wp, 0.3_wp]

      call write_file(-1, [0, 2, 3, 5], [0, 2, 1, 0, 2, 7, 7], by_columns, q, 3, '')
      call expect_problem('columns')
      if (allocated(error)) return
      call write_file(-2, [0, 2, 3, 5], [0, 2, 1, 0, 2, 7, 7], by_rows, q, 3, '')
      call expect_problem('rows')
      if (allocated(error)) return
      call write_file(5, [0, 0, 1, 2, 2, 7, 7], [0, 2, 1, 0, 2, 7, 7], by_columns, q, 3, '')
      call expect_problem('triplets')
      call remove(path)

   contains

      subroutine expect_problem(form)
         character(len=*), intent(in) :: form
         type(contact_problem_t) :: problem
         type(mslip_error), allocatable :: failed

         call read_fclib(path, problem, failed)
         call good(error, failed)
         if (allocated(error)) return
         call check(error, problem%n_points == 1 .and. all(problem%G == W) .and. all(problem%R(:, 1) == q) &
            & .and. all(problem%r_0 == 0.0_wp) .and. all(problem%friction == [0.7_wp]), form)
      end subroutine expect_problem

   end subroutine test_forms

   subroutine test_refused(error)
      type(error_type), allocatable, intent(out) :: error
      real(wp), parameter :: q(3) = [-1.0_wp, 0.2_wp, 0.3_wp]
      integer, parameter :: p(4) = [0, 2, 3, 5], i(5) = [0, 2, 1, 0, 2]

      call write_file(-1, p, i, by_columns, q, 2, '')
      call expect_refusal('two dimensions')
      if (allocated(error)) return
      call write_file(-1, p, i, by_columns, q, 3, 'R')
      call expect_refusal('bilateral constraints')
      if (allocated(error)) return
      call write_file(-1, p, [0, 2, 1, 0, 3], by_columns, q, 3, '')
      call expect_refusal('row out of range')
      if (allocated(error)) return
      call write_file(-2, [0, 2, 3, 8], i, by_columns, q, 3, '')
      call expect_refusal('pointers beyond the entries')
      if (allocated(error)) return
      call write_file(9, i, i, by_columns, q, 3, '')
      call expect_refusal('too few triplets')
      if (allocated(error)) return
      call write_file(-1, p, i, by_columns, [q, q], 3, '')
      call expect_refusal('q of another size')
      call remove(path)
      if (.not. allocated(error)) call expect_refusal('no file')

   contains

      subroutine expect_refusal(what)
         character(len=*), intent(in) :: what
         type(contact_problem_t) :: problem
         type(mslip_error), allocatable :: failed

         call read_fclib(path, problem, failed)
         call check(error, allocated(failed), what)
         if (.not. allocated(error)) call check(error, failed%status, status_bad_input, what)
      end subroutine expect_refusal

   end subroutine test_refused

end module test_io_fclib
