!> Points on a response curve in the result file: /harmonic_balance and /epmc (doc/results.md).
!>
!> Every point is appended as it is found; the file is published every so often, and where a run ends early.
module microslip_io_response_results
   use, intrinsic :: ieee_arithmetic, only: ieee_value, ieee_quiet_nan
   use microslip_analysis_continuation, only: curve_record_t, ended_at_last
   use microslip_analysis_response_point, only: response_point_t, response_recorder_t, truncation_t
   use microslip_core_error, only: error_t
   use microslip_core_interruption, only: hold_signals, release_signals, stop_requested
   use microslip_core_kinds, only: wp
   use microslip_io_hdf5, only: hdf5_file_t, series_t
   use microslip_io_results, only: results_t
   implicit none(type, external)
   private

   public :: response_results_t

   !> A series of one number per point.
   type :: column_t
      character(len=18) :: name
      character(len=9) :: units
      character(len=110) :: description
   end type column_t

   !> In the order of `real_values` and `integer_values`.
   type(column_t), parameter :: reals(10) = [ &
      & column_t('frequency', 'Hz', 'frequency of the motion'), &
      & column_t('amplitude', 'm', 'amplitude at the sensor: L2 norm of all harmonics, over all of its directions'), &
      & column_t('residual', '1', 'largest residual: over the load, or over the restoring force of the linear mode'), &
      & column_t('friction_loss', 'J', 'energy lost to friction in a period'), &
      & column_t('repeat_error', '1', 'bound of what later periods would still change the contact forces by, over their range'), &
      & column_t('peak', 'm', 'at the sensor: largest distance from the mean position over the samples'), &
      & column_t('neglected_velocity', '1', 'velocity that the harmonics beyond the series would add, over that of the sensor'), &
      & column_t('level', '1', 'factor on the load pattern'), &
      & column_t('phase', 'rad', 'phase of the fundamental harmonic at the sensor, u = A cos(omega t + phase)'), &
      & column_t('damping_ratio', '1', 'damping ratio, of friction and linear viscous damping')]
   type(column_t), parameter :: integers(6) = [ &
      & column_t('contact/open', '1', 'most points of the potential contact set that were open at a time'), &
      & column_t('contact/stick', '1', 'most points that stuck at a time'), &
      & column_t('contact/slip', '1', 'most points that slipped at a time'), &
      & column_t('iterations', '1', 'corrections that led to the point'), &
      & column_t('evaluations', '1', 'evaluations of the contact forces that led to the point'), &
      & column_t('periods', '1', 'periods that the contact was marched until its forces repeated')]
   !> Series of a forced response and of a nonlinear mode.
   logical, parameter :: forced(10) = [.true., .true., .true., .true., .true., .true., .true., .true., .true., .false.]
   logical, parameter :: free(10) = [.true., .true., .true., .true., .true., .true., .true., .false., .false., .true.]

   !> Recorder that writes into a result file.
   type, extends(response_recorder_t) :: response_results_t
      private
      type(results_t), pointer :: results => null()
      type(hdf5_file_t) :: file
      character(len=:), allocatable :: group
      type(series_t) :: number(size(reals)), count(size(integers)), modal_amplitude, harmonics, sensor
      logical :: wanted(size(reals)) = .false., is_mode = .false.
      !> Points so far
      integer, public :: points = 0
   contains
      procedure :: create
      procedure :: record
      procedure :: write_summary
      procedure :: close => close_response
   end type response_results_t

contains

   !> Make the series.
   subroutine create(self, results, analysis, sensor_names, n_modes, harmonics, error)
      class(response_results_t), intent(inout) :: self
      !> Open result file; it must stay open until `close`
      type(results_t), intent(in), target :: results
      !> 'harmonic_balance' or 'epmc'
      character(len=*), intent(in) :: analysis
      !> (sensors)
      character(len=*), intent(in) :: sensor_names(:)
      !> Modal coordinates and harmonics
      integer, intent(in) :: n_modes, harmonics
      type(error_t), allocatable, intent(out) :: error
      integer :: k

      self%results => results
      self%file = results%file
      call hold_signals()
      self%group = '/'//analysis
      self%is_mode = analysis == 'epmc'
      self%wanted = merge(free, forced, self%is_mode)
      call self%file%write(self%group//'/sensor_name', sensor_names, 'names of the sensors', error)
      do k = 1, size(reals)
         if (allocated(error)) return
         if (self%wanted(k)) call self%number(k)%create(self%file, self%group//'/'//trim(reals(k)%name), [integer ::], &
            & trim(reals(k)%units), '[point]: '//trim(reals(k)%description), error)
      end do
      do k = 1, size(integers)
         if (.not. allocated(error)) call self%count(k)%create(self%file, self%group//'/'//trim(integers(k)%name), &
            & [integer ::], '1', '[point]: '//trim(integers(k)%description), error, integers=.true.)
      end do
      if (self%is_mode .and. .not. allocated(error)) call self%modal_amplitude%create(self%file, self%group// &
         & '/modal_amplitude', [integer ::], 'm sqrt(kg)', '[point]: amplitude of the fundamental harmonic of all '// &
         & 'modal coordinates', error)
      if (.not. allocated(error)) call self%harmonics%create(self%file, self%group//'/harmonics', &
         & [n_modes, 2*harmonics + 1], 'm sqrt(kg)', '[point, coefficient, mode]: Fourier coefficients mean, cos, sin, '// &
         & 'cos 2, ... of the modal coordinates, less the preload', error)
      if (.not. allocated(error)) call self%sensor%create(self%file, self%group//'/sensor_harmonics', &
         & [size(sensor_names), 2*harmonics + 1], 'm', '[point, coefficient, sensor]: the same of the sensors', error)
   end subroutine create

   !> Take a point.
   subroutine record(self, point, error)
      class(response_results_t), intent(inout) :: self
      type(response_point_t), intent(in) :: point
      type(error_t), allocatable, intent(out) :: error
      real(wp) :: number(size(reals))
      integer :: count(size(integers))
      integer :: k

      number = [point%frequency, point%amplitude, point%correction%residual, point%friction_loss, point%repeat_error, &
         & point%peak, point%neglected_velocity, &
         & point%level, point%phase, point%damping_ratio]
      count = [point%counts, point%correction%iterations, point%correction%evaluations, point%periods]
      do k = 1, size(reals)
         if (self%wanted(k) .and. .not. allocated(error)) call self%number(k)%append([number(k)], error)
      end do
      do k = 1, size(integers)
         if (.not. allocated(error)) call self%count(k)%append([count(k)], error)
      end do
      if (self%is_mode .and. .not. allocated(error)) call self%modal_amplitude%append([point%modal_amplitude], error)
      if (.not. allocated(error)) call self%harmonics%append(reshape(point%modal, [shape(point%modal), 1]), error)
      if (.not. allocated(error)) call self%sensor%append(reshape(point%sensor, [shape(point%sensor), 1]), error)
      self%points = self%points + 1
      if (.not. allocated(error)) call self%results%publish_if_due(error)
      if (.not. allocated(error)) call stop_requested(error)
   end subroutine record

   !> How the curves went.
   subroutine write_summary(self, records, truncation, error)
      class(response_results_t), intent(in) :: self
      !> (curves)
      type(curve_record_t), intent(in) :: records(:)
      !> (curves)
      type(truncation_t), intent(in) :: truncation(:)
      type(error_t), allocatable, intent(out) :: error
      character(len=:), allocatable :: first
      real(wp) :: known(size(truncation))

      call counts('curve/points', records%points, 'points')
      call counts('curve/complete', merge(1, 0, records%reason == ended_at_last), '1 if the curve came to its end')
      call counts('curve/failed_steps', records%failures, 'steps that had to be shortened')
      call counts('curve/evaluations', records%evaluations, 'evaluations of the contact forces over a motion')
      call counts('curve/jacobians', records%jacobians, 'derivatives of the contact forces computed anew')
      known = merge(1.0_wp, ieee_value(1.0_wp, ieee_quiet_nan), truncation%known)
      first = 'amplitude'
      if (self%is_mode) first = 'damping ratio'
      call values('curve/error_at', 'Hz', truncation%frequency, 'frequency of the point that the errors are estimated for')
      call values('curve/samples_error', '1', truncation%by_samples(1), &
         & 'estimated relative change of the '//first//' with twice the samples')
      call values('curve/truncation_error', '1', truncation%by_both(1), &
         & 'the same with twice the samples and the harmonics that they tell')
      call values('curve/frequency_error', '1', truncation%by_both(2), 'the same of the frequency')

   contains

      subroutine values(name, unit, numbers, description)
         character(len=*), intent(in) :: name, unit, description
         real(wp), intent(in) :: numbers(:)
         if (.not. allocated(error)) &
            & call self%file%write(self%group//'/'//name, known*numbers, unit, '[curve]: '//description, error)
      end subroutine values

      subroutine counts(name, values, description)
         character(len=*), intent(in) :: name, description
         integer, intent(in) :: values(:)
         if (.not. allocated(error)) call self%file%write(self%group//'/'//name, values, '1', '[curve]: '//description, error)
      end subroutine counts

   end subroutine write_summary

   !> Close the series; also after a failed run.
   subroutine close_response(self)
      class(response_results_t), intent(inout) :: self
      type(error_t), allocatable :: ignored
      integer :: k

      call release_signals()
      if (.not. self%file%is_open()) return
      do k = 1, size(reals)
         if (self%wanted(k)) call self%number(k)%close(ignored)
      end do
      do k = 1, size(integers)
         call self%count(k)%close(ignored)
      end do
      if (self%is_mode) call self%modal_amplitude%close(ignored)
      call self%harmonics%close(ignored)
      call self%sensor%close(ignored)
   end subroutine close_response

end module microslip_io_response_results
