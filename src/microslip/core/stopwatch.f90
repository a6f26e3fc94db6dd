!> Wall-clock times of the stages of a run.
module microslip_core_stopwatch
   use microslip_core_archive, only: archive_t
   use microslip_core_kinds, only: wp, i8
   implicit none(type, external)
   private

   public :: stopwatch_t, wall_time

   !> Seconds spent in named stages, in the order they were first met.
   type :: stopwatch_t
      character(len=24), allocatable :: stage(:)
      real(wp), allocatable :: seconds(:)
      !> How often a stage was stopped
      integer, allocatable :: count(:)
      real(wp), private :: started = 0.0_wp
   contains
      procedure :: start
      procedure :: stop => stop_stage
      procedure :: pass
   end type stopwatch_t

contains

   !> Seconds on a clock that only runs forward.
   real(wp) function wall_time()
      integer(i8) :: ticks, rate
      call system_clock(ticks, rate)
      wall_time = real(ticks, wp)/real(rate, wp)
   end function wall_time

   !> The clock runs from now on.
   subroutine start(self)
      class(stopwatch_t), intent(inout) :: self
      if (.not. allocated(self%stage)) allocate (self%stage(0), self%seconds(0), self%count(0))
      self%started = wall_time()
   end subroutine start

   !> Book the time since the last start or stop on a stage; the clock runs on.
   subroutine stop_stage(self, stage)
      class(stopwatch_t), intent(inout) :: self
      character(len=*), intent(in) :: stage
      character(len=24) :: name
      real(wp) :: now
      integer :: k

      now = wall_time()
      name = stage
      k = findloc(self%stage, name, dim=1)
      if (k == 0) then
         self%stage = [character(len=24) :: self%stage, name]
         self%seconds = [self%seconds, 0.0_wp]
         self%count = [self%count, 0]
         k = size(self%stage)
      end if
      self%seconds(k) = self%seconds(k) + (now - self%started)
      self%count(k) = self%count(k) + 1
      self%started = now
   end subroutine stop_stage

   !> Store the stages, or take them back; the clock runs on.
   subroutine pass(self, archive)
      class(stopwatch_t), intent(inout) :: self
      type(archive_t), intent(inout) :: archive
      integer, allocatable :: letters(:)
      integer :: k, j

      letters = [((iachar(self%stage(k) (j:j)), j=1, len(self%stage)), k=1, size(self%stage))]
      call archive%pass(letters)
      call archive%pass(self%seconds)
      call archive%pass(self%count)
      if (.not. archive%loading .or. .not. archive%sound()) return
      deallocate (self%stage)
      allocate (self%stage(size(self%seconds)))
      do k = 1, size(self%stage)
         do j = 1, len(self%stage)
            self%stage(k) (j:j) = achar(letters((k - 1)*len(self%stage) + j))
         end do
      end do
   end subroutine pass

end module microslip_core_stopwatch
