!> Tests of the reduction cache: it comes back to the last bit, or not at all.
module test_io_reduction_cache
   use microslip_core_error, only: error_t
   use microslip_core_kinds, only: wp
   use microslip_core_warning_list, only: warning_list_t
   use microslip_fe_reduced_model, only: reduced_model_t
   use microslip_io_hdf5, only: hdf5_file_t
   use microslip_io_own_files, only: copy_of
   use microslip_io_reduction_cache, only: read_cache, write_cache
   use support_case_run, only: file_text, write_text
   use support_checks, only: good, remove
   use testdrive, only: check, new_unittest, testing_error => error_type, unittest_type
   implicit none(type, external)
   private

   public :: collect_io_reduction_cache

   character(len=*), parameter :: path = 'build/test_reduction_cache.h5', digest = '0123456789ABCDEF'

contains

   subroutine collect_io_reduction_cache(testsuite)
      type(unittest_type), allocatable, intent(out) :: testsuite(:)

      testsuite = [ &
         & new_unittest('a reduced model comes back exactly', test_return), &
         & new_unittest('the cache of another model is not used', test_other), &
         & new_unittest('a changed bit anywhere', test_bits), &
         & new_unittest('cut off anywhere, or longer', test_lengths), &
         & new_unittest('changed by another program', test_changed), &
         & new_unittest('what cannot be written is a warning', test_unwritable)]
   end subroutine collect_io_reduction_cache

   subroutine make(reduced)
      type(reduced_model_t), intent(out) :: reduced
      integer, parameter :: n_i = 3, n_b = 6
      integer :: k

      reduced%method = 'craig_bampton_massless'
      reduced%frequency = [(100.0_wp*k, k=1, n_i)]
      reduced%K_ii = reshape([(sqrt(real(k, wp)), k=1, n_i*n_i)], [n_i, n_i])
      reduced%K_bi = reshape([(-sqrt(real(k, wp)), k=1, n_b*n_i)], [n_b, n_i])
      reduced%K_bb = reshape([(1.0_wp/k, k=1, n_b*n_b)], [n_b, n_b])
      reduced%pattern_i = reshape([(1.0_wp*k, k=1, n_i)], [n_i, 1])
      reduced%pattern_b = reshape([(2.0_wp*k, k=1, n_b)], [n_b, 1])
   end subroutine make

   !> Write one; its bytes.
   subroutine write_one(error, bytes)
      type(testing_error), allocatable, intent(out) :: error
      character(len=:), allocatable, intent(out) :: bytes
      type(reduced_model_t) :: reduced
      type(warning_list_t) :: warnings

      call remove(path)
      call make(reduced)
      call write_cache(path, digest, reduced, warnings)
      call check(error, warnings%number(), 0)
      if (.not. allocated(error)) bytes = file_text(path)
   end subroutine write_one

   !> Not used, and told, or used and right: there is nothing between.
   subroutine expect_refused(error, what)
      type(testing_error), allocatable, intent(inout) :: error
      character(len=*), intent(in) :: what
      type(reduced_model_t) :: reduced
      type(warning_list_t) :: warnings
      logical :: found

      if (allocated(error)) return
      call read_cache(path, digest, reduced, found, warnings)
      call check(error, .not. found .and. warnings%number() == 1, what)
   end subroutine expect_refused

   subroutine test_return(error)
      type(testing_error), allocatable, intent(out) :: error
      type(reduced_model_t) :: reduced, again
      type(warning_list_t) :: warnings
      character(len=:), allocatable :: bytes
      logical :: found

      call write_one(error, bytes)
      if (allocated(error)) return
      call make(reduced)
      call read_cache(path, digest, again, found, warnings)
      call remove(path)
      call check(error, found .and. warnings%number() == 0, 'not found')
      if (allocated(error)) return
      call check(error, again%method == reduced%method .and. all(again%frequency == reduced%frequency) .and. &
         & all(again%K_ii == reduced%K_ii) .and. all(again%K_bi == reduced%K_bi) .and. all(again%K_bb == reduced%K_bb) .and. &
         & all(again%pattern_i == reduced%pattern_i) .and. all(again%pattern_b == reduced%pattern_b), 'other numbers')
   end subroutine test_return

   subroutine test_other(error)
      type(testing_error), allocatable, intent(out) :: error
      type(reduced_model_t) :: reduced
      type(warning_list_t) :: warnings
      character(len=:), allocatable :: bytes
      logical :: found

      call write_one(error, bytes)
      if (allocated(error)) return
      call read_cache(path, 'FEDCBA9876543210', reduced, found, warnings)
      call check(error, .not. found .and. warnings%number() == 0, 'another digest')
      call remove(path)
      call read_cache(path, digest, reduced, found, warnings)
      if (.not. allocated(error)) call check(error, .not. found .and. warnings%number() == 0, 'there is none')
   end subroutine test_other

   subroutine test_bits(error)
      type(testing_error), allocatable, intent(out) :: error
      character(len=:), allocatable :: bytes, damaged
      integer :: k

      call write_one(error, bytes)
      ! A prime step: all columns of all words are met.
      do k = 1, merge(len(bytes), 0, .not. allocated(error)), 97
         damaged = bytes
         damaged(k:k) = char(ieor(ichar(bytes(k:k)), 2**mod(k, 8)))
         call write_text(path, damaged)
         call expect_refused(error, 'a changed bit was not seen')
         if (allocated(error)) exit
      end do
      call remove(path)
   end subroutine test_bits

   subroutine test_lengths(error)
      type(testing_error), allocatable, intent(out) :: error
      character(len=:), allocatable :: bytes
      integer :: k

      call write_one(error, bytes)
      do k = 0, merge(len(bytes), 0, .not. allocated(error)) - 1, 997
         call write_text(path, bytes(:k))
         call expect_refused(error, 'cut off')
      end do
      call write_text(path, bytes(:len(bytes) - 1))
      call expect_refused(error, 'the last byte is missing')
      call write_text(path, bytes//'x')
      call expect_refused(error, 'a byte more')
      call remove(path)
   end subroutine test_lengths

   subroutine test_changed(error)
      type(testing_error), allocatable, intent(out) :: error
      type(error_t), allocatable :: lib
      type(hdf5_file_t) :: file
      character(len=:), allocatable :: bytes

      call write_one(error, bytes)
      if (allocated(error)) return
      call file%open(path, lib, writable=.true.)
      if (.not. allocated(lib)) call file%write('/frequency', [1.0_wp, 2.0_wp, 3.0_wp], 'Hz', '', lib)
      if (.not. allocated(lib)) call file%close(lib)
      call good(error, lib)
      call expect_refused(error, 'other frequencies were taken')
      call write_text(path, file_text(path)//bytes(len(bytes) - 34:))
      call expect_refused(error, 'other frequencies with the old checksum were taken')
      call remove(path)
   end subroutine test_changed

   subroutine test_unwritable(error)
      type(testing_error), allocatable, intent(out) :: error
      type(reduced_model_t) :: reduced
      type(warning_list_t) :: missing, foreign
      character(len=*), parameter :: users = 'written by hand'

      call make(reduced)
      call write_cache('build/no_such_folder/cache.h5', digest, reduced, missing)
      call check(error, missing%number(), 1)
      call remove(path)
      call write_text(copy_of(path), users)
      call write_cache(path, digest, reduced, foreign)
      if (.not. allocated(error)) call check(error, foreign%number() == 1 .and. file_text(copy_of(path)) == users, &
         & 'a file of the user')
      call remove(copy_of(path))
   end subroutine test_unwritable

end module test_io_reduction_cache
