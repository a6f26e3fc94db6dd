!> Time series of a time integration in the result file: /transient, or the group of the analysis that integrates
!> (doc/results.md).
!>
!> Samples are collected and appended in blocks; the file is published every so often, so that an interrupted run keeps
!> its results. The groups of snapshots and harmonics are made with the first of them. A run that is resumed opens its
!> series, and drops what lies behind the restart point.
module microslip_io_transient_results
   use microslip_analysis_harmonic_meter, only: harmonic_window_t
   use microslip_analysis_transient, only: energy_t, sample_t, transient_record_t, transient_recorder_t
   use microslip_contact_problem, only: contact_state_t
   use microslip_core_archive, only: archive_t
   use microslip_core_error, only: error_t, failure
   use microslip_core_interruption, only: hold_signals, release_signals, stop_requested
   use microslip_core_kinds, only: wp
   use microslip_io_checkpoint, only: keep_point
   use microslip_io_contact_fields, only: contact_fields, field_maps_t, fields, interface_group
   use microslip_io_hdf5, only: hdf5_file_t, series_t
   use microslip_io_interface_maps, only: append_map, attach_axes, map_axes, map_shape
   use microslip_io_progress, only: progress_t
   use microslip_io_results, only: results_t
   use microslip_system_jointed_system, only: jointed_system_t
   implicit none(type, external)
   private

   public :: transient_results_t

   !> Samples that are appended together.
   integer, parameter :: block_size = 256

   !> A series of one number per sample.
   type :: column_t
      character(len=13) :: name
      character(len=60) :: description
   end type column_t

   !> In the order of `energy_values` and `contact_values`.
   type(column_t), parameter :: energies(6) = [ &
      & column_t('kinetic', 'kinetic energy'), &
      & column_t('elastic', 'elastic energy less that at the start'), &
      & column_t('external_work', 'work of the loads'), &
      & column_t('viscous_loss', 'energy lost to viscous damping'), &
      & column_t('friction_loss', 'energy lost to friction'), &
      & column_t('balance_error', 'work less losses and change of energy')]
   type(column_t), parameter :: contacts(5) = [ &
      & column_t('open', 'open points of the potential contact set'), &
      & column_t('stick', 'sticking points'), &
      & column_t('slip', 'slipping points'), &
      & column_t('iterations', 'iterations of the contact solver in this step'), &
      & column_t('converged', '1 if the contact solver converged in this step, else 0')]

   !> What there is of a window: time, frequency, step, change, amplitude, phase.
   type :: harmonic_series_t
      type(series_t) :: time, frequency, step, change, amplitude, phase
   end type harmonic_series_t

   !> Recorder that writes into a result file.
   type, extends(transient_recorder_t) :: transient_results_t
      !> Started by the caller if a progress line is wanted
      type(progress_t) :: line
      !> The open result file, and a copy of its handle
      type(results_t), pointer, private :: results => null()
      type(hdf5_file_t), private :: file
      type(series_t), private :: time, sensor, modal, energy(size(energies)), contact(size(contacts)), residual
      type(series_t), private :: snapshot_time
      type(harmonic_series_t), allocatable, private :: windows
      !> Where in the file
      character(len=:), allocatable, private :: group
      !> (fields, interfaces)
      type(series_t), allocatable, private :: snapshots(:, :)
      !> Samples that are not yet in the file
      type(sample_t), private :: pending(block_size)
      integer, private :: n_pending = 0
      !> Last sample, for the end of the progress line
      type(sample_t), private :: last
   contains
      procedure :: create
      procedure :: record
      procedure :: snapshot
      procedure :: progress
      procedure :: harmonics
      procedure :: restart_point
      procedure :: write_summary
      procedure :: close => close_transient
   end type transient_results_t

contains

   !> Make the series, or find those of an interrupted run.
   subroutine create(self, results, system, sensor_names, error, group, resuming)
      class(transient_results_t), intent(inout) :: self
      !> Open result file with its interfaces written; it must stay open until `close`
      type(results_t), intent(in), target :: results
      type(jointed_system_t), intent(in) :: system
      !> (sensors)
      character(len=*), intent(in) :: sensor_names(:)
      type(error_t), allocatable, intent(out) :: error
      !> Group of the file, '/transient' by default
      character(len=*), intent(in), optional :: group
      !> `restart_point` will open the series
      logical, intent(in), optional :: resuming
      integer :: k

      self%group = '/transient'
      if (present(group)) self%group = group
      self%results => results
      self%file = results%file
      call hold_signals()
      if (present(resuming)) then
         if (resuming) return
      end if
      call self%file%write(self%group//'/sensor_name', sensor_names, 'names of the sensors', error)
      if (.not. allocated(error)) call self%time%create(self%file, self%group//'/time', [integer ::], 's', 'time', error)
      if (.not. allocated(error)) call self%file%make_scale(self%group//'/time', 'time', error)
      call add_series(self, self%sensor, self%group//'/sensor', [size(sensor_names)], 'm', &
         & '[time, sensor]: displacement at the sensors', error)
      call add_series(self, self%modal, self%group//'/modal_displacement', [system%n_modes], 'm sqrt(kg)', &
         & '[time, mode]: modal coordinates', error)
      do k = 1, size(energies)
         call add_series(self, self%energy(k), self%group//'/energy/'//trim(energies(k)%name), [integer ::], 'J', &
            & trim(energies(k)%description), error)
      end do
      do k = 1, size(contacts)
         call add_series(self, self%contact(k), self%group//'/contact/'//trim(contacts(k)%name), [integer ::], '1', &
            & trim(contacts(k)%description), error, integers=.true.)
      end do
      call add_series(self, self%residual, self%group//'/contact/residual', [integer ::], '1', &
         & 'largest violation of the contact laws over the largest contact force', error)
   end subroutine create

   !> Make a series over /transient/time, unless an earlier one failed.
   subroutine add_series(self, series, path, leading, units, description, error, integers)
      class(transient_results_t), intent(in) :: self
      type(series_t), intent(inout) :: series
      character(len=*), intent(in) :: path, units, description
      integer, intent(in) :: leading(:)
      type(error_t), allocatable, intent(inout) :: error
      logical, intent(in), optional :: integers

      if (.not. allocated(error)) call series%create(self%file, path, leading, units, description, error, integers)
      if (.not. allocated(error)) call self%file%attach_scale(path, size(leading) + 1, self%group//'/time', error)
   end subroutine add_series

   !> Take samples.
   subroutine record(self, samples, error)
      class(transient_results_t), intent(inout) :: self
      !> In order of time
      type(sample_t), intent(in) :: samples(:)
      type(error_t), allocatable, intent(out) :: error
      integer :: k

      do k = 1, size(samples)
         self%n_pending = self%n_pending + 1
         self%pending(self%n_pending) = samples(k)
         self%last = samples(k)
         if (self%n_pending == block_size) call append_pending(self, error)
         if (allocated(error)) return
      end do
      if (self%results%is_due()) call append_pending(self, error)
      if (.not. allocated(error)) call self%results%publish_if_due(error)
      if (.not. allocated(error)) call stop_requested(error)
   end subroutine record

   !> Append the collected samples to their series.
   subroutine append_pending(self, error)
      class(transient_results_t), intent(inout) :: self
      type(error_t), allocatable, intent(out) :: error
      real(wp) :: energy(self%n_pending, size(energies))
      integer :: contact(self%n_pending, size(contacts))
      integer :: k, n

      n = self%n_pending
      self%n_pending = 0
      if (n == 0) return
      associate (samples => self%pending(:n))
         call self%time%append([(samples(k)%time, k=1, n)], error)
         if (.not. allocated(error)) call self%sensor%append( &
            & reshape([(samples(k)%sensor, k=1, n)], [size(samples(1)%sensor), n]), error)
         if (.not. allocated(error)) call self%modal%append( &
            & reshape([(samples(k)%modal, k=1, n)], [size(samples(1)%modal), n]), error)
         if (.not. allocated(error)) call self%residual%append([(samples(k)%residual, k=1, n)], error)
         do k = 1, n
            energy(k, :) = energy_values(samples(k)%energy)
            contact(k, :) = contact_values(samples(k))
         end do
      end associate
      do k = 1, size(energies)
         if (.not. allocated(error)) call self%energy(k)%append(energy(:, k), error)
      end do
      do k = 1, size(contacts)
         if (.not. allocated(error)) call self%contact(k)%append(contact(:, k), error)
      end do
   end subroutine append_pending

   !> The energies in the order of their series.
   pure function energy_values(energy) result(values)
      type(energy_t), intent(in) :: energy
      real(wp) :: values(size(energies))
      values = [energy%kinetic, energy%elastic, energy%external_work, energy%viscous_loss, energy%friction_loss, &
         & energy%balance_error]
   end function energy_values

   !> What is told of the contact, in the order of its series.
   pure function contact_values(sample) result(values)
      type(sample_t), intent(in) :: sample
      integer :: values(size(contacts))
      values = [sample%counts, sample%iterations, merge(1, 0, sample%converged)]
   end function contact_values

   !> Samples, snapshots and windows so far. When a point is taken back, the series go on from there.
   subroutine restart_point(self, archive, error)
      class(transient_results_t), intent(inout) :: self
      type(archive_t), intent(inout) :: archive
      type(error_t), allocatable, intent(out) :: error
      integer :: samples, snapshots, windows

      if (.not. archive%loading) call append_pending(self, error)
      if (allocated(error)) return
      samples = self%time%step_count()
      snapshots = self%snapshot_time%step_count()
      windows = 0
      if (allocated(self%windows)) windows = self%windows%time%step_count()
      call archive%pass(samples)
      call archive%pass(snapshots)
      call archive%pass(windows)
      if (.not. archive%loading) then
         call keep_point(self%results, archive%contents(), error)
      else if (archive%sound()) then
         call open_again(self, samples, snapshots, windows, error)
      else
         call failure(error, self%file%path//': the restart point is cut off')
      end if
   end subroutine restart_point

   !> Open the series of an interrupted run.
   subroutine open_again(self, samples, snapshots, windows, error)
      class(transient_results_t), intent(inout) :: self
      !> How many to keep
      integer, intent(in) :: samples, snapshots, windows
      type(error_t), allocatable, intent(out) :: error
      character(len=255), allocatable :: names(:)
      integer :: k, f

      call self%time%open(self%file, self%group//'/time', error, samples)
      call again(self%sensor, 'sensor', samples)
      call again(self%modal, 'modal_displacement', samples)
      call again(self%residual, 'contact/residual', samples)
      do k = 1, size(energies)
         call again(self%energy(k), 'energy/'//trim(energies(k)%name), samples)
      end do
      do k = 1, size(contacts)
         call again(self%contact(k), 'contact/'//trim(contacts(k)%name), samples)
      end do
      ! Groups that were made behind the restart point are emptied, not made anew.
      if (self%file%has(self%group//'/harmonics')) then
         allocate (self%windows)
         call again(self%windows%time, 'harmonics/time', windows)
         call again(self%windows%frequency, 'harmonics/frequency', windows)
         call again(self%windows%step, 'harmonics/step', windows)
         call again(self%windows%change, 'harmonics/change', windows)
         call again(self%windows%amplitude, 'harmonics/amplitude', windows)
         call again(self%windows%phase, 'harmonics/phase', windows)
      end if
      if (allocated(error) .or. .not. self%file%has(self%group//'/snapshot')) return
      call self%file%members(self%group//'/snapshot', names, error)
      if (allocated(error)) return
      ! One of them is the time.
      allocate (self%snapshots(size(fields), size(names) - 1))
      call again(self%snapshot_time, 'snapshot/time', snapshots)
      do k = 1, size(self%snapshots, 2)
         do f = 1, size(fields)
            call again(self%snapshots(f, k), 'snapshot/'//interface_group(k)//'/'//trim(fields(f)%name), snapshots)
         end do
      end do

   contains

      subroutine again(series, name, keep)
         type(series_t), intent(inout) :: series
         character(len=*), intent(in) :: name
         integer, intent(in) :: keep
         if (.not. allocated(error)) call series%open(self%file, self%group//'/'//name, error, keep)
      end subroutine again

   end subroutine open_again

   !> Take the contact fields.
   subroutine snapshot(self, system, time, contact, error)
      class(transient_results_t), intent(inout) :: self
      type(jointed_system_t), intent(in) :: system
      !> s
      real(wp), intent(in) :: time
      type(contact_state_t), intent(in) :: contact
      type(error_t), allocatable, intent(out) :: error
      type(field_maps_t), allocatable :: maps(:)
      integer :: k, f

      if (.not. allocated(self%snapshots)) call create_snapshots(self, system, error)
      if (.not. allocated(error)) call self%snapshot_time%append([time], error)
      maps = contact_fields(system, contact)
      do k = 1, size(maps)
         do f = 1, size(fields)
            if (allocated(error)) return
            call append_map(self%snapshots(f, k), system%pads(k)%grid, maps(k)%map(:, :, f), error)
         end do
      end do
   end subroutine snapshot

   !> Make the series of the snapshots.
   subroutine create_snapshots(self, system, error)
      class(transient_results_t), intent(inout) :: self
      type(jointed_system_t), intent(in) :: system
      type(error_t), allocatable, intent(out) :: error
      character(len=:), allocatable :: group, path, axis
      integer :: k, f

      axis = self%group//'/snapshot/time'
      allocate (self%snapshots(size(fields), size(system%pads)))
      call self%snapshot_time%create(self%file, axis, [integer ::], 's', 'times of the snapshots', error)
      if (.not. allocated(error)) call self%file%make_scale(axis, 'time', error)
      do k = 1, size(system%pads)
         group = interface_group(k)
         associate (grid => system%pads(k)%grid)
            do f = 1, size(fields)
               path = self%group//'/snapshot/'//group//'/'//trim(fields(f)%name)
               if (.not. allocated(error)) call self%snapshots(f, k)%create(self%file, path, &
                  & map_shape(grid), trim(fields(f)%units), '[snapshot, '//map_axes(grid)//']: '//trim(fields(f)%description), &
                  & error)
               call attach_axes(self%file, grid, '/'//group, path, error)
               if (.not. allocated(error)) call self%file%attach_scale(path, size(map_shape(grid)) + 1, axis, error)
            end do
         end associate
      end do
   end subroutine create_snapshots

   !> Take the harmonics of windows.
   subroutine harmonics(self, windows, error)
      class(transient_results_t), intent(inout) :: self
      type(harmonic_window_t), intent(in) :: windows(:)
      type(error_t), allocatable, intent(out) :: error
      integer :: k

      if (.not. allocated(self%windows)) call create_windows(self, shape(windows(1)%amplitude), error)
      do k = 1, size(windows)
         associate (window => windows(k), series => self%windows)
            if (.not. allocated(error)) call series%time%append([window%time], error)
            if (.not. allocated(error)) call series%frequency%append([window%frequency], error)
            if (.not. allocated(error)) call series%step%append([window%step], error)
            if (.not. allocated(error)) call series%change%append([window%change], error)
            if (.not. allocated(error)) call series%amplitude%append(reshape(window%amplitude, &
               & [shape(window%amplitude), 1]), error)
            if (.not. allocated(error)) call series%phase%append(reshape(window%phase, [shape(window%phase), 1]), error)
         end associate
      end do
   end subroutine harmonics

   !> Make the series of the harmonics.
   subroutine create_windows(self, sizes, error)
      class(transient_results_t), intent(inout) :: self
      !> Sensors, and harmonics with the mean
      integer, intent(in) :: sizes(2)
      type(error_t), allocatable, intent(out) :: error

      allocate (self%windows)
      associate (series => self%windows)
         call make(series%time, 'time', [integer ::], 's', '[window]: middle of the window')
         if (.not. allocated(error)) call self%file%make_scale(self%group//'/harmonics/time', 'time', error)
         call make(series%frequency, 'frequency', [integer ::], 'Hz', '[window]: frequency of the excitation there')
         call make(series%step, 'step', [integer ::], '1', '[window]: which frequency of a stepped sine, else the window', &
            & .true.)
         call make(series%change, 'change', [integer ::], '1', '[window]: difference of the harmonics from the window ' &
            & //'before at the same frequency, over their size; negative where there is none')
         call make(series%amplitude, 'amplitude', sizes, 'm', &
            & '[window, harmonic, sensor]: amplitude of the harmonics, from 0 (the mean) on')
         call make(series%phase, 'phase', sizes, 'rad', '[window, harmonic, sensor]: p in cos(h theta + p), theta the ' &
            & //'argument of the excitation')
      end associate

   contains

      subroutine make(series, name, leading, units, description, integers)
         type(series_t), intent(inout) :: series
         character(len=*), intent(in) :: name, units, description
         integer, intent(in) :: leading(:)
         logical, intent(in), optional :: integers
         character(len=:), allocatable :: path

         path = self%group//'/harmonics/'//name
         if (.not. allocated(error)) call series%create(self%file, path, leading, units, description, error, integers)
         if (.not. allocated(error) .and. name /= 'time') call self%file%attach_scale(path, size(leading) + 1, &
            & self%group//'/harmonics/time', error)
      end subroutine make

   end subroutine create_windows

   !> Pass on how far the run is.
   subroutine progress(self, time, counts)
      class(transient_results_t), intent(inout) :: self
      !> s
      real(wp), intent(in) :: time
      !> Points that are open, stick, slip
      integer, intent(in) :: counts(3)

      call self%line%update(time, counts)
   end subroutine progress

   !> How the run went, as single numbers in /transient.
   subroutine write_summary(self, record, error)
      class(transient_results_t), intent(in) :: self
      type(transient_record_t), intent(in) :: record
      type(error_t), allocatable, intent(out) :: error

      call whole('steps', record%steps, 'time steps done')
      call whole('iterations', record%iterations, 'iterations of the contact solver in all steps')
      call whole('rescues', record%rescues, 'rescues of the contact solver in all steps')
      call whole('set_changes', record%set_changes, 'points that joined or left the base set of the contact solver')
      call whole('unconverged_steps', record%unconverged, 'steps whose contact solve did not converge')
      call whole('points_added', record%points_added, 'points that joined the potential contact set')
      call part('largest_residual', record%residual, 'largest violation of the contact laws over the contact force')
      call part('largest_error_estimate', record%error_estimate, 'largest estimated error over the contact force')
      call part('largest_balance_error', record%balance_error, &
         & 'largest energy balance error over the largest kinetic energy')
      call part('unaccounted_energy', record%unaccounted_energy, &
         & 'largest energy balance error over the largest of kinetic energy, external work and losses')
      call part('largest_slip', record%largest_slip, &
         & 'largest tangential displacement of a closed point at the checks, over the width of a cell')

   contains

      subroutine whole(name, value, description)
         character(len=*), intent(in) :: name, description
         integer, intent(in) :: value
         if (.not. allocated(error)) call self%file%write(self%group//'/'//name, value, '1', description, error)
      end subroutine whole

      subroutine part(name, value, description)
         character(len=*), intent(in) :: name, description
         real(wp), intent(in) :: value
         if (.not. allocated(error)) call self%file%write(self%group//'/'//name, value, '1', description, error)
      end subroutine part

   end subroutine write_summary

   !> Write what is pending, close the series, end the progress line; also after a failed run.
   subroutine close_transient(self, error)
      class(transient_results_t), intent(inout) :: self
      type(error_t), allocatable, intent(out) :: error
      type(error_t), allocatable :: ignored
      integer :: k, f

      call release_signals()
      call self%line%finish(self%last%time, self%last%counts)
      if (.not. self%file%is_open()) return
      call append_pending(self, error)
      call self%time%close(ignored)
      call self%sensor%close(ignored)
      call self%modal%close(ignored)
      call self%residual%close(ignored)
      do k = 1, size(energies)
         call self%energy(k)%close(ignored)
      end do
      do k = 1, size(contacts)
         call self%contact(k)%close(ignored)
      end do
      if (allocated(self%windows)) then
         call self%windows%time%close(ignored)
         call self%windows%frequency%close(ignored)
         call self%windows%step%close(ignored)
         call self%windows%change%close(ignored)
         call self%windows%amplitude%close(ignored)
         call self%windows%phase%close(ignored)
      end if
      if (.not. allocated(self%snapshots)) return
      call self%snapshot_time%close(ignored)
      do k = 1, size(self%snapshots, 2)
         do f = 1, size(fields)
            call self%snapshots(f, k)%close(ignored)
         end do
      end do
   end subroutine close_transient

end module microslip_io_transient_results
