!> A recorder that keeps in memory what the identification of a ring-down needs, and hands everything on to another one.
module microslip_analysis_decay_recorder
   use microslip_analysis_harmonic_meter, only: harmonic_window_t
   use microslip_analysis_ringdown, only: decay_t
   use microslip_analysis_transient, only: sample_t, transient_recorder_t
   use microslip_contact_problem, only: contact_state_t
   use microslip_core_error, only: error_t
   use microslip_core_kinds, only: wp
   use microslip_system_jointed_system, only: jointed_system_t
   implicit none(type, external)
   private

   public :: decay_recorder_t

   type, extends(transient_recorder_t) :: decay_recorder_t
      !> Who writes the results
      class(transient_recorder_t), pointer :: onward => null()
      !> (modes) mode shape of unit modal mass whose coordinate is kept, and the modal coordinates it is counted from;
      !> not allocated: sensors only
      real(wp), allocatable :: phi(:), origin(:)
      !> Samples kept: room for more than there are
      real(wp), allocatable, private :: time(:), sensor(:, :), modal(:)
      integer, private :: kept = 0
   contains
      procedure :: record
      procedure :: snapshot
      procedure :: progress
      procedure :: harmonics
      procedure :: verified
      procedure :: decay
   end type decay_recorder_t

contains

   !> Keep samples and hand them on.
   subroutine record(self, samples, error)
      class(decay_recorder_t), intent(inout) :: self
      type(sample_t), intent(in) :: samples(:)
      type(error_t), allocatable, intent(out) :: error
      integer :: k

      do k = 1, size(samples)
         call make_room(self, size(samples(k)%sensor))
         self%kept = self%kept + 1
         self%time(self%kept) = samples(k)%time
         self%sensor(:, self%kept) = samples(k)%sensor
         if (allocated(self%phi)) self%modal(self%kept) = dot_product(self%phi, samples(k)%modal - self%origin)
      end do
      call self%onward%record(samples, error)
   end subroutine record

   !> Room for one more sample.
   subroutine make_room(self, sensors)
      class(decay_recorder_t), intent(inout) :: self
      integer, intent(in) :: sensors
      real(wp), allocatable :: time(:), sensor(:, :), modal(:)
      integer :: room

      if (.not. allocated(self%time)) allocate (self%time(0), self%sensor(sensors, 0), self%modal(0))
      if (self%kept < size(self%time)) return
      room = max(1024, 2*self%kept)
      allocate (time(room), sensor(sensors, room), modal(room))
      time(:self%kept) = self%time
      sensor(:, :self%kept) = self%sensor
      modal(:self%kept) = self%modal
      call move_alloc(time, self%time)
      call move_alloc(sensor, self%sensor)
      call move_alloc(modal, self%modal)
   end subroutine make_room

   !> Hand on.
   subroutine snapshot(self, system, time, contact, error)
      class(decay_recorder_t), intent(inout) :: self
      type(jointed_system_t), intent(in) :: system
      real(wp), intent(in) :: time
      type(contact_state_t), intent(in) :: contact
      type(error_t), allocatable, intent(out) :: error

      call self%onward%snapshot(system, time, contact, error)
   end subroutine snapshot

   !> Hand on.
   subroutine progress(self, time, counts)
      class(decay_recorder_t), intent(inout) :: self
      real(wp), intent(in) :: time
      integer, intent(in) :: counts(3)

      call self%onward%progress(time, counts)
   end subroutine progress

   !> Hand on.
   subroutine harmonics(self, windows, error)
      class(decay_recorder_t), intent(inout) :: self
      type(harmonic_window_t), intent(in) :: windows(:)
      type(error_t), allocatable, intent(out) :: error

      call self%onward%harmonics(windows, error)
   end subroutine harmonics

   !> Hand on.
   subroutine verified(self, system, contact, slipped)
      class(decay_recorder_t), intent(inout) :: self
      type(jointed_system_t), intent(in) :: system
      type(contact_state_t), intent(in) :: contact
      logical, intent(in) :: slipped(:)

      call self%onward%verified(system, contact, slipped)
   end subroutine verified

   !> What was kept.
   function decay(self)
      class(decay_recorder_t), intent(in) :: self
      type(decay_t) :: decay

      allocate (decay%time(0), decay%sensor(0, 0))
      if (self%kept == 0) return
      decay%time = self%time(:self%kept)
      decay%sensor = self%sensor(:, :self%kept)
      if (allocated(self%phi)) decay%modal = self%modal(:self%kept)
   end function decay

end module microslip_analysis_decay_recorder
