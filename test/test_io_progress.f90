!> Tests of the progress line: text, silence, sparse lines in a file, redrawn lines on a terminal, cost.
module test_io_progress
   use microslip_core_kinds, only: wp
   use microslip_io_progress, only: progress_t, progress_text, wall_clock
   use testdrive, only: check, new_unittest, testing_error => error_type, unittest_type
   implicit none(type, external)
   private

   public :: collect_io_progress

   integer, parameter :: counts(3) = [3, 1, 2]

contains

   subroutine collect_io_progress(testsuite)
      type(unittest_type), allocatable, intent(out) :: testsuite(:)

      testsuite = [ &
         & new_unittest('the text of the line', test_text), &
         & new_unittest('quiet prints nothing', test_quiet), &
         & new_unittest('few plain lines in a file', test_plain), &
         & new_unittest('one redrawn line on a terminal', test_terminal), &
         & new_unittest('calls cost next to nothing', test_cost)]
   end subroutine collect_io_progress

   subroutine test_text(error)
      type(testing_error), allocatable, intent(out) :: error
      character(len=:), allocatable :: text

      text = progress_text(0.025_wp, 0.1_wp, 40.0_wp, counts)
      call check(error, text, '25 of 100 ms, 0.04 s/ms, stick 1 slip 2 open 3, left 0:03')
      if (allocated(error)) return
      text = progress_text(1.0_wp, 4.0_wp, 1241.0_wp, counts)
      call check(error, index(text, 'left 1:02:03') > 0, text)
   end subroutine test_text

   !> Run a progress line into a scratch file; the text that it left there.
   function written(quiet, terminal, calls, pause) result(text)
      logical, intent(in) :: quiet, terminal
      integer, intent(in) :: calls
      !> s, wall time of a call
      real(wp), intent(in) :: pause
      character(len=:), allocatable :: text
      type(progress_t) :: line
      integer :: unit, k, length
      real(wp) :: until
      character(len=*), parameter :: scratch = 'build/test_io_progress.txt'

      open (newunit=unit, file=scratch, access='stream', form='formatted', status='replace')
      call line%start('transient', calls*1.0e-3_wp, quiet, unit, terminal)
      do k = 1, calls
         until = wall_clock() + pause
         do while (wall_clock() < until)
         end do
         call line%update(k*1.0e-3_wp, counts)
      end do
      call line%finish(calls*1.0e-3_wp, counts)
      close (unit)
      inquire (file=scratch, size=length)
      allocate (character(len=length) :: text)
      open (newunit=unit, file=scratch, access='stream', form='unformatted')
      read (unit) text
      close (unit, status='delete')
   end function written

   pure integer function count_of(text, letter)
      character(len=*), intent(in) :: text, letter
      integer :: k
      count_of = count([(text(k:k) == letter, k=1, len(text))])
   end function count_of

   subroutine test_quiet(error)
      type(testing_error), allocatable, intent(out) :: error
      call check(error, written(.true., .true., 3, 0.0_wp), '')
      if (allocated(error)) return
      call check(error, written(.true., .false., 3, 0.0_wp), '')
   end subroutine test_quiet

   subroutine test_plain(error)
      type(testing_error), allocatable, intent(out) :: error
      character(len=:), allocatable :: text

      text = written(.false., .false., 100, 0.0_wp)
      call check(error, count_of(text, new_line('a')) == 1 .and. count_of(text, achar(13)) == 0 &
         & .and. index(text, 'transient  100 of 100 ms') == 1, text)
   end subroutine test_plain

   subroutine test_terminal(error)
      type(testing_error), allocatable, intent(out) :: error
      character(len=:), allocatable :: text
      integer :: drawn
      real(wp) :: began

      began = wall_clock()
      text = written(.false., .true., 60, 0.01_wp)
      drawn = count_of(text, achar(13))
      call check(error, drawn >= 3 .and. drawn <= 2 + int((wall_clock() - began)/0.2_wp), 'not redrawn every 0.2 s: '//text)
      if (allocated(error)) return
      call check(error, count_of(text, new_line('a')) == 1 .and. text(len(text):) == new_line('a') &
         & .and. index(text, '60 of 60 ms') > 0, 'more than one line: '//text)
   end subroutine test_terminal

   !> A million calls in much less than the microseconds of a million steps.
   subroutine test_cost(error)
      type(testing_error), allocatable, intent(out) :: error
      type(progress_t) :: line
      integer, parameter :: calls = 1000000
      real(wp), parameter :: limit = 1.0e-7_wp*calls
      real(wp) :: began
      integer :: k

      call line%start('transient', 1.0_wp, quiet=.false., terminal=.false.)
      began = wall_clock()
      do k = 1, calls
         call line%update(real(k, wp)/calls, counts)
      end do
      call check(error, wall_clock() - began < limit, 'too slow')
   end subroutine test_cost

end module test_io_progress
