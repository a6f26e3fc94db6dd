!> A point on a response curve - periodic motions found by harmonic balance - and who takes it.
module microslip_analysis_response_point
   use microslip_analysis_continuation, only: correction_t
   use microslip_core_error, only: error_t
   use microslip_core_kinds, only: wp
   implicit none(type, external)
   private

   public :: response_point_t, response_recorder_t, truncation_t, most_refinements, changes_on, no_velocity, much_velocity

   !> Times that the harmonics beyond the series are found anew; relative change from which that is worth it; part of the
   !> change that may be left.
   integer, parameter :: most_refinements = 8
   real(wp), parameter :: worth_it = 5.0e-3_wp, left = 0.05_wp
   !> Neglected velocity that moves no turning point so far that it would show.
   real(wp), parameter :: no_velocity = 1.0e-3_wp
   !> Neglected velocity that may be a large error, whose estimate is worth a derivative of its own.
   real(wp), parameter :: much_velocity = 1.0e-2_wp

   type :: response_point_t
      !> Forced: factor on the load pattern
      real(wp) :: level = 0.0_wp
      !> Hz
      real(wp) :: frequency = 0.0_wp
      !> Nonlinear mode: damping ratio, and amplitude of the fundamental harmonic of all modal coordinates, m sqrt(kg)
      real(wp) :: damping_ratio = 0.0_wp, modal_amplitude = 0.0_wp
      !> (modes, 2H + 1) Fourier coefficients [mean, cos, sin, cos, ...] of the modal coordinates, less the operating
      !> state, m sqrt(kg)
      real(wp), allocatable :: modal(:, :)
      !> (sensors, 2H + 1) the same of the sensors, m
      real(wp), allocatable :: sensor(:, :)
      !> At the chosen sensor, m: L2 norm of all harmonics' amplitudes (and over its directions), which is sqrt(2) times the
      !> root mean square of the vibration
      real(wp) :: amplitude = 0.0_wp
      !> The same sensor, m: largest distance from the mean over all samples
      real(wp) :: peak = 0.0_wp
      !> What the harmonics beyond the series would add to the velocity of the sensor where they all meet, over the size of the
      !> velocity: the part by which turning points are shifted
      real(wp) :: neglected_velocity = 0.0_wp
      !> rad, fundamental harmonic of the direction that moves most: u = A cos(tau + phase)
      real(wp) :: phase = 0.0_wp
      !> Most points that were open, stuck, slipped at one sample
      integer :: counts(3) = 0
      !> Periods that the contact was marched
      integer :: periods = 0
      !> Bound of what later periods would still change the forces by, over their range
      real(wp) :: repeat_error = 0.0_wp
      !> J per period
      real(wp) :: friction_loss = 0.0_wp
      type(correction_t) :: correction
   end type response_point_t

   !> What harmonics and samples miss at one point of a curve: its motion is put on twice the samples, first as it is, then
   !> with the harmonics that its contact forces excite beyond the series; a step of Newton's method tells what that changes.
   !> Where that is much, turning points move so far that the high harmonics no longer meet there: their forces are then
   !> found anew for the changed motion, and so on (`most_refinements` times).
   type :: truncation_t
      logical :: known = .false.
      !> Hz and m: the point, that of the largest `neglected_velocity`
      real(wp) :: frequency = 0.0_wp, amplitude = 0.0_wp
      !> Relative changes, by the samples alone and by both: forced response: of amplitude and frequency, at right angles to
      !> the curve; nonlinear mode: of damping ratio and frequency, at the same amplitude
      real(wp) :: by_samples(2) = 0.0_wp, by_both(2) = 0.0_wp
   end type truncation_t

   !> Who takes the points: knows files or memory, the analyses know neither.
   type, abstract :: response_recorder_t
   contains
      procedure(record_interface), deferred :: record
   end type response_recorder_t

   abstract interface
      !> Take a point; they come in the order of the curve.
      subroutine record_interface(self, point, error)
         import :: response_recorder_t, response_point_t, error_t
         implicit none(type, external)
         class(response_recorder_t), intent(inout) :: self
         type(response_point_t), intent(in) :: point
         type(error_t), allocatable, intent(out) :: error
      end subroutine record_interface
   end interface

contains

   !> Whether estimated changes are worth to be found anew.
   pure logical function changes_on(now, before)
      real(wp), intent(in) :: now(:), before(:)
      changes_on = maxval(abs(now)) > worth_it .and. maxval(abs(now - before)) > left*maxval(abs(now))
   end function changes_on

end module microslip_analysis_response_point
