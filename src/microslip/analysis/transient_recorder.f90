!> Who takes the results of a time integration: knows files or memory, the integrator knows neither.
module microslip_analysis_transient_recorder
   use microslip_analysis_harmonic_meter, only: harmonic_window_t
   use microslip_contact_problem, only: contact_state_t
   use microslip_core_archive, only: archive_t
   use microslip_core_error, only: error_t
   use microslip_core_kinds, only: wp
   use microslip_system_jointed_system, only: jointed_system_t
   implicit none(type, external)
   private

   public :: energy_t, sample_t, transient_recorder_t

   !> Energies since the start, J.
   type :: energy_t
      real(wp) :: kinetic = 0.0_wp, elastic = 0.0_wp, external_work = 0.0_wp, viscous_loss = 0.0_wp, &
         & friction_loss = 0.0_wp, balance_error = 0.0_wp
   end type energy_t

   !> What is recorded of a step.
   type :: sample_t
      integer :: step = 0
      !> s
      real(wp) :: time = 0.0_wp
      !> (modes)
      real(wp), allocatable :: modal(:)
      !> (sensors) m
      real(wp), allocatable :: sensor(:)
      type(energy_t) :: energy
      !> Points that are open, stick, slip
      integer :: counts(3) = 0
      integer :: iterations = 0
      real(wp) :: residual = 0.0_wp
      logical :: converged = .true.
   end type sample_t

   !> An error of it stops the run; it may want just that.
   type, abstract :: transient_recorder_t
   contains
      procedure(record_interface), deferred :: record
      procedure(snapshot_interface), deferred :: snapshot
      procedure(progress_interface), deferred :: progress
      procedure :: harmonics => ignore_harmonics
      procedure :: verified => ignore_verified
      procedure :: restart_point => ignore_restart_point
   end type transient_recorder_t

   abstract interface
      !> Take verified samples, in order of time.
      subroutine record_interface(self, samples, error)
         import :: transient_recorder_t, sample_t, error_t
         implicit none(type, external)
         class(transient_recorder_t), intent(inout) :: self
         type(sample_t), intent(in) :: samples(:)
         type(error_t), allocatable, intent(out) :: error
      end subroutine record_interface

      !> Take the contact fields at a time that was asked for.
      subroutine snapshot_interface(self, system, time, contact, error)
         import :: transient_recorder_t, jointed_system_t, contact_state_t, error_t, wp
         implicit none(type, external)
         class(transient_recorder_t), intent(inout) :: self
         type(jointed_system_t), intent(in) :: system
         real(wp), intent(in) :: time
         type(contact_state_t), intent(in) :: contact
         type(error_t), allocatable, intent(out) :: error
      end subroutine snapshot_interface

      !> Hear how far the run is; called every step.
      subroutine progress_interface(self, time, counts)
         import :: transient_recorder_t, wp
         implicit none(type, external)
         class(transient_recorder_t), intent(inout) :: self
         real(wp), intent(in) :: time
         integer, intent(in) :: counts(3)
      end subroutine progress_interface
   end interface

contains

   !> Most recorders have no use for harmonics.
   subroutine ignore_harmonics(self, windows, error)
      class(transient_recorder_t), intent(inout) :: self
      !> New ones, in order of time
      type(harmonic_window_t), intent(in) :: windows(:)
      type(error_t), allocatable, intent(out) :: error
   end subroutine ignore_harmonics

   !> Nor for the contact at every check of the points left out, which is where the motion turns.
   subroutine ignore_verified(self, system, contact, slipped)
      class(transient_recorder_t), intent(inout) :: self
      type(jointed_system_t), intent(in) :: system
      type(contact_state_t), intent(in) :: contact
      !> (points) whether they have slipped since the check before
      logical, intent(in) :: slipped(:)
   end subroutine ignore_verified

   !> Add the recorder's own state to a restart point, behind that of the motion, or take it from there. Who writes files
   !> is last and keeps the point. Most recorders have no state of their own.
   subroutine ignore_restart_point(self, archive, error)
      class(transient_recorder_t), intent(inout) :: self
      type(archive_t), intent(inout) :: archive
      type(error_t), allocatable, intent(out) :: error
   end subroutine ignore_restart_point

end module microslip_analysis_transient_recorder
