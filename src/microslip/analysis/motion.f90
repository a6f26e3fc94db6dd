!> The motion of a time integration: everything that a step changes.
module microslip_analysis_motion
   use microslip_analysis_excitation, only: excitation_t
   use microslip_analysis_harmonic_meter, only: harmonic_meter_t
   use microslip_analysis_transient_recorder, only: energy_t
   use microslip_contact_problem, only: contact_state_t, solve_record_t
   use microslip_core_archive, only: archive_t
   use microslip_core_kinds, only: wp
   implicit none(type, external)
   private

   public :: motion_t

   !> Copying it is a checkpoint in memory.
   type :: motion_t
      integer :: step = 0
      real(wp), allocatable :: d(:), v_before(:), v_after(:)
      !> Khat d, as `next_velocity` left it
      real(wp), allocatable :: restoring(:)
      !> (loads) amplitudes now, and the part that stays on
      real(wp), allocatable :: amplitude(:), constant(:)
      type(contact_state_t) :: contact
      !> How the last contact step went, with the forces on modes, loads and sensors and the contact's energy
      type(solve_record_t) :: solved
      type(energy_t) :: energy
      real(wp) :: initial_energy = 0.0_wp, largest_kinetic = 0.0_wp, largest_error = 0.0_wp
      !> As they are: a stepped sine may go on early
      type(excitation_t), allocatable :: excitations(:)
      type(harmonic_meter_t) :: meter
      !> (points) whether they have slipped since the last check
      logical, allocatable :: slipped(:)
      !> Whether the kinetic energy fell in the last step, and whether it has just passed a minimum
      logical :: slowing = .false., turned = .false.
   contains
      procedure :: pass
   end type motion_t

contains

   !> Store it, or take it back. Excitations and meter must have been begun: only what changes in them is stored.
   subroutine pass(self, archive)
      class(motion_t), intent(inout) :: self
      type(archive_t), intent(inout) :: archive
      integer :: k

      call archive%pass(self%step)
      call archive%pass(self%d)
      call archive%pass(self%v_before)
      call archive%pass(self%v_after)
      call archive%pass(self%amplitude)
      call archive%pass(self%constant)
      call self%contact%pass(archive)
      call self%solved%pass(archive)
      call archive%pass(self%energy%kinetic)
      call archive%pass(self%energy%elastic)
      call archive%pass(self%energy%external_work)
      call archive%pass(self%energy%viscous_loss)
      call archive%pass(self%energy%friction_loss)
      call archive%pass(self%energy%balance_error)
      call archive%pass(self%initial_energy)
      call archive%pass(self%largest_kinetic)
      call archive%pass(self%largest_error)
      do k = 1, size(self%excitations)
         call archive%pass(self%excitations(k)%periods)
      end do
      if (self%meter%excitation > 0) call self%meter%pass(archive)
      call archive%pass(self%slipped)
      call archive%pass(self%slowing)
      call archive%pass(self%turned)
   end subroutine pass

end module microslip_analysis_motion
