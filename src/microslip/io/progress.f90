!> The progress line of a time integration on stderr.
!>
!> On a terminal one line is redrawn in place; otherwise plain lines, one per tenth of the simulated time and at most
!> one every ten seconds. It may be called every step: the clock is looked at only every so many calls, which adapts
!> to the speed of the run.
module microslip_io_progress
   use, intrinsic :: iso_c_binding, only: c_int
   use, intrinsic :: iso_fortran_env, only: error_unit
   use microslip_core_kinds, only: wp, i8
   use microslip_core_standard_streams, only: put_line
   use microslip_core_text, only: to_text
   implicit none(type, external)
   private

   public :: progress_t, progress_text, wall_clock

   !> s, wall time: between two drawings on a terminal, between two plain lines, over which the rate is averaged.
   real(wp), parameter :: redraw_interval = 0.2_wp, plain_interval = 10.0_wp, averaging_time = 10.0_wp
   !> Most calls between two looks at the clock.
   integer, parameter :: longest_stride = 65536

   type :: progress_t
      private
      logical :: silent = .true., terminal = .false.
      integer :: unit = error_unit
      character(len=:), allocatable :: label
      !> s, simulated: whole run, at the last look, at the last plain line
      real(wp) :: duration = 0.0_wp, seen_time = 0.0_wp, written_time = 0.0_wp
      !> s, simulated, at the first call: not zero if a run is continued; negative before
      real(wp) :: first_time = -1.0_wp
      !> s on the wall clock: start, last look, last line
      real(wp) :: started = 0.0_wp, seen = 0.0_wp, written = 0.0_wp
      !> Wall seconds per simulated second
      real(wp) :: rate = 0.0_wp
      !> Calls between two looks at the clock, and left until the next
      integer :: stride = 1, calls_left = 1
      !> Length of the line on the terminal
      integer :: drawn = 0
   contains
      procedure :: start
      procedure :: update
      procedure :: finish
   end type progress_t

   interface
      function c_isatty(descriptor) bind(c, name='isatty') result(yes)
         import :: c_int
         implicit none(type, external)
         integer(c_int), value :: descriptor
         integer(c_int) :: yes
      end function c_isatty
   end interface

contains

   !> Begin a run.
   subroutine start(self, label, duration, quiet, unit, terminal)
      class(progress_t), intent(out) :: self
      !> What runs
      character(len=*), intent(in) :: label
      !> s, simulated
      real(wp), intent(in) :: duration
      !> Print nothing
      logical, intent(in) :: quiet
      !> Where to instead of stderr, and whether that is a terminal
      integer, intent(in), optional :: unit
      logical, intent(in), optional :: terminal
      integer(c_int), parameter :: descriptor_of_stderr = 2

      self%silent = quiet
      self%label = label
      self%duration = duration
      self%terminal = c_isatty(descriptor_of_stderr) == 1
      if (present(unit)) self%unit = unit
      if (present(terminal)) self%terminal = terminal
      self%started = wall_clock()
      self%seen = self%started
      self%written = self%started
   end subroutine start

   !> Hear where the run is; may be called every step.
   subroutine update(self, time, counts)
      class(progress_t), intent(inout) :: self
      !> s, simulated
      real(wp), intent(in) :: time
      !> Points that are open, stick, slip
      integer, intent(in) :: counts(3)
      real(wp) :: now, elapsed, weight, speed

      if (self%silent) return
      if (self%first_time < 0.0_wp) then
         self%first_time = time
         self%seen_time = time
         self%written_time = time
      end if
      self%calls_left = self%calls_left - 1
      if (self%calls_left > 0) return
      now = wall_clock()
      elapsed = now - self%seen
      if (elapsed < 0.25_wp*redraw_interval) self%stride = min(2*self%stride, longest_stride)
      if (elapsed > 0.5_wp*redraw_interval) self%stride = max(self%stride/2, 1)
      self%calls_left = self%stride
      ! The latest rate counts most: a run gets faster as its motion decays.
      if (time > self%seen_time) then
         ! Speeds are averaged over wall time, at first over all of it, so that a slow start is soon forgotten.
         weight = min(1.0_wp, elapsed/max(tiny(1.0_wp), min(now - self%started, averaging_time)))
         speed = weight*(time - self%seen_time)/max(tiny(1.0_wp), elapsed)
         if (self%rate > 0.0_wp) speed = speed + (1.0_wp - weight)/self%rate
         if (speed > 0.0_wp) self%rate = 1.0_wp/speed
      end if
      self%seen = now
      self%seen_time = time
      if (self%terminal) then
         if (now - self%written >= redraw_interval) call draw(self, time, counts)
      else if (now - self%written >= plain_interval .and. time - self%written_time >= 0.1_wp*self%duration) then
         call draw(self, time, counts)
      end if
   end subroutine update

   !> Write the last state of the run, on a terminal with the end of the line.
   subroutine finish(self, time, counts)
      class(progress_t), intent(inout) :: self
      !> s, simulated
      real(wp), intent(in) :: time
      !> Points that are open, stick, slip
      integer, intent(in) :: counts(3)

      if (self%silent) return
      ! Over the whole run; what is left of an unfinished run is not known.
      self%rate = 0.0_wp
      if (time > self%first_time) self%rate = (wall_clock() - self%started)/(time - max(0.0_wp, self%first_time))
      call draw(self, time, counts)
      if (self%terminal) call put_line(self%unit, '')
      self%silent = .true.
   end subroutine finish

   !> Write the line.
   subroutine draw(self, time, counts)
      class(progress_t), intent(inout) :: self
      real(wp), intent(in) :: time
      integer, intent(in) :: counts(3)
      character(len=:), allocatable :: line

      line = self%label//'  '//progress_text(time, self%duration, self%rate, counts)
      if (self%terminal) then
         call put_line(self%unit, achar(13)//line//repeat(' ', max(0, self%drawn - len(line))), advance=.false.)
         self%drawn = len(line)
      else
         call put_line(self%unit, line)
      end if
      self%written = wall_clock()
      self%written_time = time
   end subroutine draw

   !> The text of the line: simulated time, rate, contact counts, time left.
   pure function progress_text(time, duration, rate, counts) result(text)
      !> s, simulated
      real(wp), intent(in) :: time, duration
      !> Wall seconds per simulated second
      real(wp), intent(in) :: rate
      !> Points that are open, stick, slip
      integer, intent(in) :: counts(3)
      character(len=:), allocatable :: text
      real(wp), parameter :: ms = 1.0e-3_wp

      text = to_text(time/ms, 4)//' of '//to_text(duration/ms, 4)//' ms, '//to_text(rate*ms, 3)//' s/ms, stick '// &
         & to_text(counts(2))//' slip '//to_text(counts(3))//' open '//to_text(counts(1))// &
         & ', left '//clock_text(rate*max(0.0_wp, duration - time))
   end function progress_text

   !> Hours, minutes and seconds: '1:02:03' or '2:03'.
   pure function clock_text(seconds) result(text)
      real(wp), intent(in) :: seconds
      character(len=:), allocatable :: text
      character(len=24) :: buffer
      integer(i8) :: s

      s = nint(min(seconds, 1.0e9_wp), i8)
      if (s >= 3600) then
         write (buffer, '(i0,":",i2.2,":",i2.2)') s/3600, mod(s, 3600_i8)/60, mod(s, 60_i8)
      else
         write (buffer, '(i0,":",i2.2)') s/60, mod(s, 60_i8)
      end if
      text = trim(buffer)
   end function clock_text

   !> Seconds on a clock that never goes back.
   real(wp) function wall_clock()
      integer(i8) :: count, rate

      call system_clock(count, rate)
      wall_clock = real(count, wp)/real(rate, wp)
   end function wall_clock

end module microslip_io_progress
