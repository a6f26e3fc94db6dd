!> Tests of who a file belongs to: the same file by other names, marks, working files, locks.
module test_io_own_files
   use microslip_core_error, only: error_t, status_bad_input
   use microslip_io_file_identity, only: file_identity_t, identity_of, kind_folder, kind_none, kind_regular, place_of, same_file
   use microslip_io_hdf5, only: hdf5_file_t
   use microslip_io_own_files, only: cache_file, check_replaceable, copy_of, is_leftover, mark, model_file, part_of, recognise, &
      & result_file
   use microslip_io_working_file, only: working_file_t
   use support_case_run, only: file_text, write_text
   use support_checks, only: good, remove
   use testdrive, only: check, new_unittest, testing_error => error_type, unittest_type
   implicit none(type, external)
   private

   public :: collect_io_own_files

   character(len=*), parameter :: path = 'build/test_own_files.h5', link = 'build/test_own_files_link.h5', &
      & far = 'build/test_own_files_far.h5', users = 'written by hand'

contains

   subroutine collect_io_own_files(testsuite)
      type(unittest_type), allocatable, intent(out) :: testsuite(:)

      testsuite = [ &
         & new_unittest('one file by several names', test_same), &
         & new_unittest('names of files that are not there', test_places), &
         & new_unittest('own files are known by their marks', test_marks), &
         & new_unittest('files of others are not replaced', test_replaceable), &
         & new_unittest('a working file is had by one run', test_lock), &
         & new_unittest('what an ended run left is taken', test_leftover), &
         & new_unittest('a final name keeps its permissions', test_publish)]
   end subroutine collect_io_own_files

   subroutine clean_up()
      ! Links themselves, wherever they lead.
      call execute_command_line('rm -f '//path//' '//link//' '//far//' '//part_of(path)//' '//copy_of(path))
   end subroutine clean_up

   !> Two names of one file, and names of two.
   subroutine test_same(error)
      type(testing_error), allocatable, intent(out) :: error
      type(file_identity_t) :: one, other

      call clean_up()
      call write_text(path, users)
      call execute_command_line('ln -s test_own_files.h5 '//link//'; ln '//path//' '//far)
      one = identity_of(path)
      call check(error, one%exists() .and. one%kind == kind_regular .and. one%bytes == len(users) .and. one%names == 2, &
         & 'what it is')
      call expect('./'//path, .true.)
      call expect('build/../'//path, .true.)
      call expect(link, .true.)
      call expect(far, .true.)
      call expect('build', .false.)
      call expect('build/no_such_file', .false.)
      if (.not. allocated(error)) then
         other = identity_of('build')
         call check(error, other%kind == kind_folder, 'a folder')
      end if
      call clean_up()

   contains

      subroutine expect(name, same)
         character(len=*), intent(in) :: name
         logical, intent(in) :: same

         if (allocated(error)) return
         other = identity_of(name)
         call check(error, same_file(one, other) .eqv. same, name)
      end subroutine expect

   end subroutine test_same

   !> A name is followed to where the file would appear.
   subroutine test_places(error)
      type(testing_error), allocatable, intent(out) :: error
      type(file_identity_t) :: one, other

      call execute_command_line('ln -s test_own_files.h5 '//link//'; ln -s test_own_files_far.h5 '//far)
      one = identity_of(path)
      other = identity_of(link)
      call check(error, one%kind == kind_none .and. other%kind == kind_none, 'there is nothing yet')
      if (.not. allocated(error)) call check(error, same_file(one, other), 'a link that leads nowhere yet')
      if (.not. allocated(error)) call check(error, place_of('./'//path) == place_of(path) .and. index(place_of(path), '/') == 1, &
         & place_of(path))
      ! A link to itself, a folder that is not there: no file can be.
      if (.not. allocated(error)) call check(error, place_of(far) == '' .and. place_of('build/none/a.h5') == '', 'no place')
      call clean_up()
   end subroutine test_places

   !> Make a file of a kind.
   subroutine make(kind, lib)
      integer, intent(in) :: kind
      type(error_t), allocatable, intent(out) :: lib
      type(hdf5_file_t) :: file
      type(error_t), allocatable :: ignored

      call file%create(path, lib)
      if (allocated(lib)) return
      select case (kind)
      case (1); call mark(file, result_file, 7, lib)
      case (2); call mark(file, cache_file, 2, lib)
      case (3); call mark(file, model_file, 1, lib)
      case (4); call file%set_attribute('/', 'format', 'microslip model', lib)
      case (5)
         ! A result of version 0.1.0
         call file%set_attribute('/', 'program', 'microslip', lib)
         if (.not. allocated(lib)) call file%set_attribute('/', 'format_version', 1, lib)
      case (6); call file%set_attribute('/', 'program', 'another', lib)
      end select
      call file%close(ignored)
   end subroutine make

   subroutine test_marks(error)
      type(testing_error), allocatable, intent(out) :: error
      !> Columns: result, cache, model; rows as in `make`
      logical, parameter :: own(3, 6) = reshape([.true., .false., .false., .false., .true., .false., .false., .false., .true., &
         & .false., .false., .false., .true., .false., .false., .false., .false., .false.], [3, 6])
      type(error_t), allocatable :: lib
      character(len=:), allocatable :: what
      integer :: k, version
      logical :: found(3)

      do k = 1, size(own, 2)
         call make(k, lib)
         call good(error, lib)
         if (allocated(error)) exit
         call recognise(path, result_file, found(1), version, what)
         if (k == 1) call check(error, version, 7)
         call recognise(path, cache_file, found(2), version, what)
         call recognise(path, model_file, found(3), version, what)
         if (.not. allocated(error)) call check(error, all(found .eqv. own(:, k)), 'kind '//achar(48 + k)//': '//what)
         call remove(path)
         if (allocated(error)) exit
      end do
      call clean_up()
   end subroutine test_marks

   subroutine test_replaceable(error)
      type(testing_error), allocatable, intent(out) :: error
      type(error_t), allocatable :: lib

      call check_replaceable(path, result_file, lib)
      call good(error, lib)
      call write_text(path, users)
      call expect(path, 'not overwritten')
      call write_text(path, '')
      call expect(path, 'not overwritten')
      call remove(path)
      call execute_command_line('mkfifo '//path)
      call expect(path, 'FIFO')
      call clean_up()
      call expect('build', 'cannot be replaced')
      call expect('build/', 'slash')
      call expect('build/none/a.h5', 'no folder')
      call expect('build/'//repeat('a', 252), 'letters')
      call expect('-', 'standard output')
      call expect('', 'file name')
      call make(1, lib)
      if (.not. allocated(error)) then
         call check_replaceable(path, result_file, lib)
         call good(error, lib)
      end if
      call execute_command_line('chmod 400 '//path)
      call expect(path, 'write-protected')
      call clean_up()

   contains

      subroutine expect(name, part)
         character(len=*), intent(in) :: name, part

         if (allocated(error)) return
         call check_replaceable(name, result_file, lib)
         call check(error, allocated(lib), name//' would be replaced')
         if (.not. allocated(error)) call check(error, lib%status == status_bad_input .and. index(lib%message, part) > 0, &
            & lib%message)
      end subroutine expect

   end subroutine test_replaceable

   subroutine test_lock(error)
      type(testing_error), allocatable, intent(out) :: error
      type(error_t), allocatable :: lib, refused
      type(working_file_t) :: one, other
      logical :: in_use, there

      call one%take(part_of(path), result_file, lib)
      call good(error, lib)
      if (allocated(error)) return
      call other%take(part_of(path), result_file, refused, in_use)
      call check(error, allocated(refused) .and. in_use .and. one%is_held() .and. .not. other%is_held(), 'two have it')
      call other%give_up()
      inquire (file=part_of(path), exist=there)
      if (.not. allocated(error)) call check(error, there, 'who was refused has removed it')
      call one%give_up()
      inquire (file=part_of(path), exist=there)
      if (.not. allocated(error)) call check(error, .not. there, 'given up, but there')
      if (.not. allocated(error)) then
         call other%take(part_of(path), result_file, lib)
         call good(error, lib)
      end if
      ! Somebody puts another file there: it is not this run's to remove or to publish.
      call remove(part_of(path))
      call write_text(part_of(path), users)
      if (.not. allocated(error)) call check(error, .not. other%is_held(), 'holds a file of another')
      call other%publish_as(path, refused)
      if (.not. allocated(error)) call check(error, allocated(refused) .and. file_text(part_of(path)) == users, 'published')
      call other%give_up()
      if (.not. allocated(error)) call check(error, file_text(part_of(path)) == users, 'removed')
      call clean_up()
   end subroutine test_lock

   subroutine test_leftover(error)
      type(testing_error), allocatable, intent(out) :: error
      type(error_t), allocatable :: lib
      type(working_file_t) :: working
      character(len=:), allocatable :: head

      call make(1, lib)
      call good(error, lib)
      if (allocated(error)) return
      head = file_text(path)
      call expect(head, .true.)
      call expect(head(:4500), .true.)
      call expect('', .true.)
      call expect(head(:100), .false.)
      call expect(users, .false.)
      call make(6, lib)
      call expect(file_text(path), .false.)
      call make(3, lib)
      call expect(file_text(path), .false.)
      ! By another name the bytes would be lost too.
      call remove(part_of(path))
      call write_text(path, head)
      call execute_command_line('ln '//path//' '//part_of(path))
      if (.not. allocated(error)) call check(error, .not. is_leftover(part_of(path), result_file), 'two names')
      call remove(part_of(path))
      call execute_command_line('ln -s none '//part_of(path))
      if (.not. allocated(error)) call check(error, .not. is_leftover(part_of(path), result_file), 'a link')
      call clean_up()

   contains

      subroutine expect(text, taken)
         character(len=*), intent(in) :: text
         logical, intent(in) :: taken

         if (allocated(error)) return
         call remove(part_of(path))
         call write_text(part_of(path), text)
         call working%take(part_of(path), result_file, lib)
         call check(error, allocated(lib) .neqv. taken, 'taken or not')
         if (allocated(lib) .and. .not. allocated(error)) call check(error, file_text(part_of(path)) == text, 'changed')
         call working%give_up()
      end subroutine expect

   end subroutine test_leftover

   subroutine test_publish(error)
      type(testing_error), allocatable, intent(out) :: error
      type(error_t), allocatable :: lib
      type(working_file_t) :: working
      type(file_identity_t) :: before, after

      call write_text(path, 'old')
      call execute_command_line('chmod 640 '//path)
      before = identity_of(path)
      call working%take(part_of(path), result_file, lib)
      if (.not. allocated(lib)) call working%publish_as(path, lib)
      call good(error, lib)
      after = identity_of(path)
      if (.not. allocated(error)) call check(error, after%bytes == 0 .and. .not. same_inode() .and. &
         & after%permissions == before%permissions, 'not replaced, or other permissions')
      call clean_up()

   contains

      logical function same_inode()
         same_inode = before%inode == after%inode
      end function same_inode

   end subroutine test_publish

end module test_io_own_files
