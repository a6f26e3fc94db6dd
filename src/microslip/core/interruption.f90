!> Ending in order on SIGINT (Ctrl-C), SIGTERM and SIGHUP (the terminal is gone), and when nobody reads the log any more (SIGPIPE).
!>
!> Once `watch_signals` was called, such a signal ends the process at once with status 128 + signal, unless it is held:
!> between `hold_signals` and `release_signals` it is only noted, and whoever holds it asks `stop_requested` now and then. A
!> second signal ends the process in any case. Nothing is lost that is in a file under its final name.
!> SIGPIPE is noted in any case: it comes with a line of the log, and what was computed before is to be kept.
!> A signal that the process was started to ignore (nohup) stays ignored.
!> A file that grows past the limit of the process (SIGXFSZ) is an error of the write, not the end of the process.
module microslip_core_interruption
   use, intrinsic :: iso_c_binding, only: c_char, c_funloc, c_funptr, c_int, c_intptr_t, c_null_funptr, c_size_t
   use microslip_core_error, only: error_t, failure
   use microslip_core_text, only: to_text
   implicit none(type, external)
   private

   public :: watch_signals, hold_signals, release_signals, request_stop, forget_request, stop_requested, status_of_signal

   integer(c_int), parameter :: sighup = 1, sigint = 2, sigpipe = 13, sigterm = 15, sigxfsz = 25
   !> SIG_IGN of the C library
   integer(c_intptr_t), parameter :: ignore = 1
   !> Exit status of a process ended by signal 0
   integer, parameter :: status_of_signal = 128

   !> What is said of a signal that ends the process at once.
   character(len=*), parameter :: ended = 'microslip: stopped by ', what_stays = '; what was published stays'//new_line('a'), &
      & by_sigint = ended//'SIGINT'//what_stays, by_sigterm = ended//'SIGTERM'//what_stays, by_sighup = ended//'SIGHUP'//what_stays

   integer(c_int), volatile, save :: received = 0
   logical, volatile, save :: held = .false.

   interface
      function c_signal(number, handler) bind(c, name='signal') result(before)
         import :: c_funptr, c_int
         implicit none(type, external)
         integer(c_int), value :: number
         type(c_funptr), value :: handler
         type(c_funptr) :: before
      end function c_signal

      function c_write(descriptor, text, length) bind(c, name='write') result(done)
         import :: c_char, c_int, c_size_t
         implicit none(type, external)
         integer(c_int), value :: descriptor
         character(kind=c_char), intent(in) :: text(*)
         integer(c_size_t), value :: length
         integer(c_size_t) :: done
      end function c_write

      subroutine c_exit_now(status) bind(c, name='_exit')
         import :: c_int
         implicit none(type, external)
         integer(c_int), value :: status
      end subroutine c_exit_now
   end interface

contains

   !> From now on.
   subroutine watch_signals()
      type(c_funptr) :: before

      before = c_signal(sigint, c_funloc(note))
      before = c_signal(sigterm, c_funloc(note))
      before = c_signal(sigpipe, c_funloc(note))
      before = c_signal(sighup, c_funloc(note))
      if (transfer(before, ignore) == ignore) before = c_signal(sighup, before)
      before = c_signal(sigxfsz, transfer(ignore, c_null_funptr))
   end subroutine watch_signals

   !> What a signal does.
   subroutine note(number) bind(c)
      integer(c_int), value :: number

      if (number == sigpipe) then
         if (received == 0) received = number
         return
      end if
      if ((received /= 0 .and. received /= sigpipe) .or. .not. held) then
         select case (number)
         case (sigint); call say(by_sigint)
         case (sigterm); call say(by_sigterm)
         case (sighup); call say(by_sighup)
         end select
         call c_exit_now(status_of_signal + number)
      end if
      received = number
   end subroutine note

   !> A message from within a signal handler, where nothing of Fortran's input and output may be used.
   subroutine say(text)
      character(len=*), intent(in) :: text
      integer(c_size_t) :: ignored
      ignored = c_write(2_c_int, text, int(len(text), c_size_t))
   end subroutine say

   !> A signal is noted from now on.
   subroutine hold_signals()
      held = .true.
   end subroutine hold_signals

   !> Until here.
   subroutine release_signals()
      held = .false.
   end subroutine release_signals

   !> As if a signal had come that is held.
   subroutine request_stop(number)
      !> Which signal
      integer, intent(in) :: number
      received = int(number, c_int)
   end subroutine request_stop

   !> As if none had come.
   subroutine forget_request()
      received = 0
   end subroutine forget_request

   !> An error with the status of the signal if one has come.
   subroutine stop_requested(error)
      type(error_t), allocatable, intent(out) :: error

      select case (received)
      case (0)
         return
      case (sigint)
         call failure(error, 'stopped by SIGINT')
      case (sigterm)
         call failure(error, 'stopped by SIGTERM')
      case (sighup)
         call failure(error, 'stopped by SIGHUP')
      case (sigpipe)
         call failure(error, 'stopped by SIGPIPE, nobody reads the log any more')
      case default
         call failure(error, 'stopped by signal '//to_text(int(received)))
      end select
      error%status = status_of_signal + received
   end subroutine stop_requested

end module microslip_core_interruption
