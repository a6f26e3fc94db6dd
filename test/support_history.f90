!> A recorder that keeps the time integration in memory.
module support_history
   use microslip, only: contact_options_t, error_t, excitation_t, harmonic_meter_t, harmonic_window_t, &
      & jointed_system_t, operating_state_t, run_transient, &
      & sample_t, stopwatch_t, transient_options_t, transient_record_t, transient_recorder_t, wp
   use microslip_contact_problem, only: contact_state_t
   implicit none(type, external)
   private

   public :: history_t, integrate

   type, extends(transient_recorder_t) :: history_t
      type(sample_t), allocatable :: samples(:)
      !> s, of the snapshots
      real(wp), allocatable :: snapshots(:)
      type(harmonic_window_t), allocatable :: windows(:)
      !> Calls of `progress`
      integer :: steps = 0
   contains
      procedure :: record
      procedure :: snapshot
      procedure :: progress
      procedure :: harmonics
      procedure :: modal
      procedure :: sensor
   end type history_t

contains

   !> Integrate and keep the history; the system and the options are left as they were.
   subroutine integrate(system, state, dt, steps, excitations, contact, history, summary, error, stride, verify_stride, &
      & meter)
      type(jointed_system_t), intent(in) :: system
      type(operating_state_t), intent(in) :: state
      !> s
      real(wp), intent(in) :: dt
      !> 0: until the excitations end
      integer, intent(in) :: steps
      type(excitation_t), intent(in) :: excitations(:)
      type(contact_options_t), intent(in) :: contact
      type(history_t), intent(out) :: history
      type(transient_record_t), intent(out) :: summary
      type(error_t), allocatable, intent(out) :: error
      integer, intent(in), optional :: stride, verify_stride
      type(harmonic_meter_t), intent(in), optional :: meter
      type(jointed_system_t) :: copy
      type(transient_options_t) :: options
      type(stopwatch_t) :: clock

      copy = system
      options = transient_options_t(duration=steps*dt, time_step=dt)
      options%excitations = excitations
      if (present(stride)) options%stride = stride
      if (present(verify_stride)) options%verify_stride = verify_stride
      if (present(meter)) options%meter = meter
      allocate (history%samples(0), history%snapshots(0), history%windows(0))
      call clock%start()
      call run_transient(copy, state, options, contact, history, clock, summary, error)
   end subroutine integrate

   subroutine record(self, samples, error)
      class(history_t), intent(inout) :: self
      type(sample_t), intent(in) :: samples(:)
      type(error_t), allocatable, intent(out) :: error
      type(sample_t), allocatable :: longer(:)
      integer :: n

      if (allocated(error)) return
      n = size(self%samples)
      allocate (longer(n + size(samples)))
      longer(:n) = self%samples
      longer(n + 1:) = samples
      call move_alloc(longer, self%samples)
   end subroutine record

   subroutine snapshot(self, system, time, contact, error)
      class(history_t), intent(inout) :: self
      type(jointed_system_t), intent(in) :: system
      real(wp), intent(in) :: time
      type(contact_state_t), intent(in) :: contact
      type(error_t), allocatable, intent(out) :: error

      if (allocated(error) .or. size(contact%status) /= system%problem%n_points) return
      self%snapshots = [self%snapshots, time]
   end subroutine snapshot

   subroutine progress(self, time, counts)
      class(history_t), intent(inout) :: self
      real(wp), intent(in) :: time
      integer, intent(in) :: counts(3)

      if (time >= 0.0_wp .and. all(counts >= 0)) self%steps = self%steps + 1
   end subroutine progress

   subroutine harmonics(self, windows, error)
      class(history_t), intent(inout) :: self
      type(harmonic_window_t), intent(in) :: windows(:)
      type(error_t), allocatable, intent(out) :: error

      if (allocated(error)) return
      self%windows = [self%windows, windows]
   end subroutine harmonics

   !> Modal coordinates, (modes, samples).
   pure function modal(self) result(values)
      class(history_t), intent(in) :: self
      real(wp), allocatable :: values(:, :)
      integer :: k

      allocate (values(size(self%samples(1)%modal), size(self%samples)))
      do k = 1, size(self%samples)
         values(:, k) = self%samples(k)%modal
      end do
   end function modal

   !> Sensors, (sensors, samples), m.
   pure function sensor(self) result(values)
      class(history_t), intent(in) :: self
      real(wp), allocatable :: values(:, :)
      integer :: k

      allocate (values(size(self%samples(1)%sensor), size(self%samples)))
      do k = 1, size(self%samples)
         values(:, k) = self%samples(k)%sensor
      end do
   end function sensor

end module support_history
