!> Periodic motions: frequency response and nonlinear mode.
module microslip_cli_periodic_analyses
   use microslip_analysis_continuation, only: curve_record_t
   use microslip_analysis_epmc, only: epmc_options_t, run_epmc
   use microslip_analysis_harmonic_balance, only: harmonic_balance_options_t, run_harmonic_balance
   use microslip_analysis_response_point, only: truncation_t
   use microslip_cli_run, only: run_t, contact_options, write_system, sensor_names, settle_damping, add_modal_loads, &
      & shape_of_mode
   use microslip_core_error, only: error_t
   use microslip_core_kinds, only: wp
   use microslip_core_text, only: to_text
   use microslip_core_warning_list, only: severity_doubtful
   use microslip_io_response_results, only: response_results_t
   implicit none(type, external)
   private

   public :: harmonic_balance, epmc

   !> Estimated relative error of an amplitude, a damping ratio or a frequency above which a warning is given.
   real(wp), parameter :: doubtful_truncation = 1.0e-2_wp

contains

   !> Frequency response.
   subroutine harmonic_balance(run, error)
      type(run_t), intent(inout), target :: run
      type(error_t), allocatable, intent(out) :: error
      type(harmonic_balance_options_t) :: options
      type(response_results_t) :: recorder
      type(curve_record_t), allocatable :: records(:)
      type(truncation_t), allocatable :: truncation(:)

      call add_modal_loads(run, error)
      if (.not. allocated(error)) call settle_damping(run, error)
      if (allocated(error)) return
      associate (record => run%case%harmonic_balance)
         options = harmonic_balance_options_t(load=run%scene%load_index(run%case%find_load(record%load)), &
            & sensors=run%case%find_sensors(record%sensor), levels=record%levels, frequency_range=record%frequency_range, &
            & harmonics=record%harmonics, samples=record%samples, response_step=record%response_step, &
            & tolerance=record%tolerance, max_iterations=record%max_iterations, max_points=record%max_points)
         options%frequency_step = max(0.02_wp*abs(record%frequency_range(2) - record%frequency_range(1)), tiny(1.0_wp))
         if (allocated(record%frequency_step)) options%frequency_step = record%frequency_step
      end associate
      call recorder%create(run%results, 'harmonic_balance', sensor_names(run), run%system%n_modes, options%harmonics, error)
      if (allocated(error)) return
      call run_harmonic_balance(run%system, run%state, options, contact_options(run), recorder, records, error, &
         & truncation)
      call finish_response(run, 'harmonic balance', recorder, records, truncation, error)
   end subroutine harmonic_balance

   !> Nonlinear mode.
   subroutine epmc(run, error)
      type(run_t), intent(inout), target :: run
      type(error_t), allocatable, intent(out) :: error
      type(epmc_options_t) :: options
      type(response_results_t) :: recorder
      type(curve_record_t) :: record
      type(truncation_t) :: truncation

      call settle_damping(run, error)
      if (.not. allocated(error)) call shape_of_mode(run, 'epmc', run%case%epmc%mode, options%shape, error)
      if (allocated(error)) return
      associate (chosen => run%case%epmc)
         options%frequency = run%modes%frequency(chosen%mode)
         options%sensors = run%case%find_sensors(chosen%sensor)
         options%amplitude_range = chosen%amplitude_range
         options%points = chosen%points
         options%harmonics = chosen%harmonics
         options%samples = chosen%samples
         options%response_step = chosen%response_step
         options%tolerance = chosen%tolerance
         options%max_iterations = chosen%max_iterations
         options%max_points = chosen%max_points
      end associate
      call recorder%create(run%results, 'epmc', sensor_names(run), run%system%n_modes, options%harmonics, error)
      if (allocated(error)) return
      call run_epmc(run%system, run%state, options, contact_options(run), recorder, record, error, truncation)
      call finish_response(run, 'epmc', recorder, [record], [truncation], error)
   end subroutine epmc

   !> What follows when response curves have been traced, or given up.
   subroutine finish_response(run, analysis, recorder, records, truncation, error)
      type(run_t), intent(inout) :: run
      character(len=*), intent(in) :: analysis
      type(response_results_t), intent(inout) :: recorder
      type(curve_record_t), intent(in) :: records(:)
      type(truncation_t), intent(in) :: truncation(:)
      !> Of the curves on entry
      type(error_t), allocatable, intent(inout) :: error
      type(error_t), allocatable :: ignored
      integer :: k

      call run%clock%stop(analysis)
      call recorder%write_summary(records, truncation, ignored)
      call recorder%close()
      if (.not. allocated(ignored)) call write_system(run, ignored)
      call run%log%line(analysis//': '//to_text(recorder%points)//' points, '//to_text(sum(records%evaluations)) &
         & //' evaluations of the contact forces, '//to_text(sum(records%jacobians))//' of their derivative, ' &
         & //to_text(sum(records%failures))//' steps shortened')
      do k = 1, size(truncation)
         if (truncation(k)%known) call tell_truncation(run, analysis, k, truncation(k))
      end do
      call run%clock%stop('write')
      if (.not. allocated(error) .and. allocated(ignored)) call move_alloc(ignored, error)
   end subroutine finish_response

   !> Estimated errors of a curve into the log; a warning where they are large.
   subroutine tell_truncation(run, analysis, curve, truncation)
      type(run_t), intent(inout) :: run
      character(len=*), intent(in) :: analysis
      integer, intent(in) :: curve
      type(truncation_t), intent(in) :: truncation
      character(len=:), allocatable :: first, text

      first = 'amplitude'
      if (analysis == 'epmc') first = 'damping ratio'
      text = analysis//', curve '//to_text(curve)//': at '//to_text(truncation%frequency)//' Hz, where the series misses most, ' &
         & //'more harmonics and samples would change the '//first//' by '//percent(truncation%by_both(1))//' (samples alone: ' &
         & //percent(truncation%by_samples(1))//'), the frequency by '//percent(truncation%by_both(2))
      call run%log%line(text)
      if (maxval(abs([truncation%by_both, truncation%by_samples])) > doubtful_truncation) call run%warnings%add(severity_doubtful, &
         & text//': raise harmonics or samples')
   end subroutine tell_truncation

   !> A share in per cent, with its sign.
   pure function percent(share) result(text)
      real(wp), intent(in) :: share
      character(len=:), allocatable :: text
      text = to_text(100.0_wp*share, 2)//' %'
      if (share > 0.0_wp) text = '+'//text
   end function percent

end module microslip_cli_periodic_analyses
