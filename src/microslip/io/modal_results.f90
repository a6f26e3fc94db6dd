!> Frequency and damping over amplitude in the result file: /qsma and /ringdown (doc/results.md).
!>
!> The levels of /qsma that are finished are published every so often, and where a run ends early.
module microslip_io_modal_results
   use microslip_analysis_qsma, only: modal_parameters_t, qsma_record_t, qsma_recorder_t
   use microslip_analysis_ringdown, only: ringdown_t
   use microslip_analysis_static_path, only: static_point_t
   use microslip_core_error, only: error_t
   use microslip_core_interruption, only: stop_requested
   use microslip_core_kinds, only: wp
   use microslip_io_hdf5, only: hdf5_file_t
   use microslip_io_results, only: results_t
   implicit none(type, external)
   private

   public :: qsma_results_t, write_qsma, write_ringdown

   !> Writes the levels of a quasi-static modal analysis into a result file.
   type, extends(qsma_recorder_t) :: qsma_results_t
      !> The open result file
      type(results_t), pointer :: results => null()
   contains
      procedure :: level
   end type qsma_results_t

contains

   !> Take the levels so far.
   subroutine level(self, record, levels, error)
      class(qsma_results_t), intent(inout) :: self
      type(qsma_record_t), intent(in) :: record
      integer, intent(in) :: levels
      type(error_t), allocatable, intent(out) :: error
      type(error_t), allocatable :: stop_here

      call stop_requested(stop_here)
      if (allocated(stop_here) .or. self%results%is_due()) call write_qsma(self%results%file, record, error, levels)
      if (.not. allocated(error)) call self%results%publish_if_due(error)
      if (.not. allocated(error)) call move_alloc(stop_here, error)
   end subroutine level

   !> Quasi-static modal analysis: /qsma.
   subroutine write_qsma(file, record, error, levels)
      !> Open result file
      type(hdf5_file_t), intent(in) :: file
      type(qsma_record_t), intent(in) :: record
      type(error_t), allocatable, intent(out) :: error
      !> How many of them are finished, all by default
      integer, intent(in), optional :: levels
      character(len=*), parameter :: side(2) = ['/qsma/positive', '/qsma/negative']
      type(modal_parameters_t), allocatable :: modes(:)
      integer :: k, n

      n = size(record%combined)
      if (present(levels)) n = levels
      ! Fewer levels may be there.
      call file%delete('/qsma', error)
      if (allocated(error)) return
      modes = record%modes()
      call put_parameters(file, '/qsma', modes(:n), error)
      if (.not. allocated(error)) call file%write('/qsma/rule', trim(merge('hysteresis loops', "Masing's rule   ", &
         & allocated(record%loop))), 'what the frequency and the damping in this group come from', error)
      call put_parameters(file, '/qsma/masing', record%combined(:n), error)
      call put(file, '/qsma/masing/contradiction', record%contradiction(:n), '1', "[level]: difference of both directions' " &
         & //'losses over the larger one', error, '/qsma/masing/amplitude')
      if (allocated(record%masing_error)) call put_number(file, '/qsma/masing/error', record%masing_error, &
         & "difference of Masing's rule and a hysteresis loop at the largest amplitude, over the larger loss", error)
      do k = 1, 2
         call put_parameters(file, side(k), record%direction(:n, k), error)
         call put_curve(file, side(k), record%curve(:n, k), error)
      end do
      if (allocated(record%loop)) then
         call put_parameters(file, '/qsma/cycle', record%loop(:n), error)
         call put(file, '/qsma/cycle/closure', record%closure(:n), '1', &
            & '[level]: distance of the ends of the last loop over its width', error, '/qsma/cycle/amplitude')
         call put_integers(file, '/qsma/cycle/rounds', record%rounds(:n), 'how often the loop was gone round', error, &
            & '/qsma/cycle/amplitude')
      end if
      call put_integer(file, '/qsma/iterations', record%iterations, 'iterations of the contact solver in all load steps', error)
      call put_integer(file, '/qsma/unconverged_steps', record%unconverged, 'load steps that did not converge', error)
      call put_integer(file, '/qsma/points_added', record%points_added, 'points that joined the potential contact set', error)
      call put_number(file, '/qsma/largest_residual', record%residual, &
         & 'largest violation of the contact laws over the contact force', error)
      call put_number(file, '/qsma/largest_error_estimate', record%error_estimate, &
         & 'largest estimated error over the contact force', error)
      call put_number(file, '/qsma/largest_slip', record%largest_slip, &
         & 'largest tangential displacement of a closed point at a level, over the width of a cell', error)
   end subroutine write_qsma

   !> Modal parameters over amplitude.
   subroutine put_parameters(file, group, modes, error)
      type(hdf5_file_t), intent(in) :: file
      character(len=*), intent(in) :: group
      type(modal_parameters_t), intent(in) :: modes(:)
      type(error_t), allocatable, intent(inout) :: error
      character(len=:), allocatable :: axis

      axis = group//'/amplitude'
      call put(file, axis, modes%amplitude, 'm', '[level]: amplitude at the sensor', error)
      if (.not. allocated(error)) call file%make_scale(axis, 'amplitude', error)
      call put(file, group//'/frequency', modes%frequency, 'Hz', '[level]: natural frequency', error, axis)
      call put(file, group//'/damping_ratio', modes%damping_ratio, '1', &
         & '[level]: damping ratio, of friction and linear viscous damping', error, axis)
      call put(file, group//'/friction_damping_ratio', modes%friction_damping_ratio, '1', &
         & '[level]: damping ratio, of friction alone', error, axis)
      call put(file, group//'/viscous_damping_ratio', modes%viscous_damping_ratio, '1', &
         & '[level]: damping ratio, of linear viscous damping alone', error, axis)
      call put(file, group//'/dissipated_energy', modes%dissipated_energy, 'J', &
         & '[level]: energy that a cycle loses to friction', error, axis)
   end subroutine put_parameters

   !> A loading curve.
   subroutine put_curve(file, group, points, error)
      type(hdf5_file_t), intent(in) :: file
      character(len=*), intent(in) :: group
      type(static_point_t), intent(in) :: points(:)
      type(error_t), allocatable, intent(inout) :: error
      character(len=:), allocatable :: axis
      real(wp), allocatable :: sensor(:, :)
      integer :: k

      axis = group//'/amplitude'
      call put(file, group//'/load', points%load, 'm sqrt(kg)/s^2', '[level]: factor on the load M phi', error, axis)
      call put(file, group//'/modal_displacement', points%displacement, 'm sqrt(kg)', &
         & '[level]: modal displacement from the preload', error, axis)
      sensor = reshape([(points(k)%sensor, k=1, size(points))], [size(points(1)%sensor), size(points)])
      if (.not. allocated(error)) call file%write(group//'/sensor', sensor, 'm', &
         & '[level, sensor]: displacement from the preload', error)
      if (.not. allocated(error)) call file%attach_scale(group//'/sensor', 2, axis, error)
      call put(file, group//'/work', points%work, 'J', '[level]: work of the load (trapezoids over the load steps)', error, axis)
      call put(file, group//'/stored_energy', points%stored_energy, 'J', &
         & '[level]: elastic energy, with the potential of the loads that are held, since the preload', error, axis)
      call put(file, group//'/friction_loss', points%friction_loss, 'J', '[level]: energy lost to friction', error, axis)
      call put(file, group//'/balance_error', points%balance_error, 'J', &
         & '[level]: work less stored energy and friction loss', error, axis)
      call put_integers(file, group//'/iterations', points%iterations, &
         & 'iterations of the contact solver up to here', error, axis)
      call put(file, group//'/residual', points%residual, '1', &
         & '[level]: largest violation of the contact laws over the contact force up to here', error, axis)
      call put(file, group//'/error_estimate', points%error_estimate, '1', &
         & '[level]: largest estimated error over the contact force up to here', error, axis)
      call put_integers(file, group//'/contact/open', [(points(k)%counts(1), k=1, size(points))], &
         & 'open points of the potential contact set', error, axis)
      call put_integers(file, group//'/contact/stick', [(points(k)%counts(2), k=1, size(points))], &
         & 'sticking points', error, axis)
      call put_integers(file, group//'/contact/slip', [(points(k)%counts(3), k=1, size(points))], &
         & 'slipping points', error, axis)
   end subroutine put_curve

   !> Identification of a free decay: /ringdown, or another group.
   subroutine write_ringdown(file, found, error, in_group)
      !> Open result file
      type(hdf5_file_t), intent(in) :: file
      type(ringdown_t), intent(in) :: found
      type(error_t), allocatable, intent(out) :: error
      !> '/ringdown' by default
      character(len=*), intent(in), optional :: in_group
      character(len=:), allocatable :: group, axis

      group = '/ringdown'
      if (present(in_group)) group = in_group
      axis = group//'/time'
      call put(file, axis, found%time, 's', 'middle of the windows', error)
      if (.not. allocated(error)) call file%make_scale(axis, 'time', error)
      call put(file, group//'/amplitude', found%amplitude, 'm', '[time]: amplitude at the sensor', error, axis)
      call put(file, group//'/frequency', found%frequency, 'Hz', '[time]: frequency, from the Fourier transform', error, axis)
      call put(file, group//'/damping_ratio', found%damping_ratio, '1', &
         & '[time]: damping ratio, from the Fourier transform', error, axis)
      call put(file, group//'/signal_amplitude', found%signal_amplitude, 'SI', &
         & '[time]: amplitude of the signal, m sqrt(kg) of a mode, m of a sensor, from the Fourier transform', error, axis)
      call put(file, group//'/peaks/signal_amplitude', found%peak_amplitude, 'SI', &
         & '[time]: amplitude of the signal, from its peaks', error, axis)
      call put(file, group//'/peaks/frequency', found%peak_frequency, 'Hz', '[time]: frequency, from the peaks', error, axis)
      call put(file, group//'/peaks/damping_ratio', found%peak_damping_ratio, '1', &
         & '[time]: damping ratio, from the peaks', error, axis)
      if (.not. allocated(error)) call file%write(group//'/window', found%window, 's', 'length of a window', error)
   end subroutine write_ringdown

   !> Write numbers, and their axis, unless an earlier write failed.
   subroutine put(file, path, values, units, description, error, axis)
      type(hdf5_file_t), intent(in) :: file
      character(len=*), intent(in) :: path, units, description
      real(wp), intent(in) :: values(:)
      type(error_t), allocatable, intent(inout) :: error
      character(len=*), intent(in), optional :: axis

      if (.not. allocated(error)) call file%write(path, values, units, description, error)
      if (.not. allocated(error) .and. present(axis)) call file%attach_scale(path, 1, axis, error)
   end subroutine put

   !> The same for counts, one per level.
   subroutine put_integers(file, path, values, description, error, axis)
      type(hdf5_file_t), intent(in) :: file
      character(len=*), intent(in) :: path, description, axis
      integer, intent(in) :: values(:)
      type(error_t), allocatable, intent(inout) :: error

      if (.not. allocated(error)) call file%write(path, values, '1', '[level]: '//description, error)
      if (.not. allocated(error)) call file%attach_scale(path, 1, axis, error)
   end subroutine put_integers

   !> A single count.
   subroutine put_integer(file, path, value, description, error)
      type(hdf5_file_t), intent(in) :: file
      character(len=*), intent(in) :: path, description
      integer, intent(in) :: value
      type(error_t), allocatable, intent(inout) :: error
      if (.not. allocated(error)) call file%write(path, value, '1', description, error)
   end subroutine put_integer

   !> A single number.
   subroutine put_number(file, path, value, description, error)
      type(hdf5_file_t), intent(in) :: file
      character(len=*), intent(in) :: path, description
      real(wp), intent(in) :: value
      type(error_t), allocatable, intent(inout) :: error
      if (.not. allocated(error)) call file%write(path, value, '1', description, error)
   end subroutine put_number

end module microslip_io_modal_results
