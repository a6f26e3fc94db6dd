!> The log's lines on the reduction: sizes, the mass that the reduced model carries of every body, and a warning where
!> something can move whose mass is not there.
module microslip_cli_reduction_report
   use microslip_cli_log, only: log_t
   use microslip_core_kinds, only: wp
   use microslip_core_text, only: to_text
   use microslip_core_warning_list, only: warning_list_t, severity_doubtful, severity_note
   use microslip_fe_reduced_model, only: body_mass_t, reduced_model_t
   implicit none(type, external)
   private

   public :: report_reduction

   !> A soft motion that lacks more of its mass than this is worth a warning: its frequency is half of that too high.
   real(wp), parameter :: noticeable_share = 0.002_wp
   !> A body whose motion as a whole is slower than this part of the first tied mode is not held.
   real(wp), parameter :: loose = 0.5_wp
   !> Bodies that the log names.
   integer, parameter :: bodies_named = 6

contains

   !> Log and warn.
   subroutine report_reduction(log, rows, reduced, warnings)
      type(log_t), intent(in) :: log
      !> Of the FE matrices
      integer, intent(in) :: rows
      type(reduced_model_t), intent(in) :: reduced
      type(warning_list_t), intent(inout) :: warnings
      character(len=:), allocatable :: extra
      integer :: k, kept

      kept = size(reduced%frequency) - reduced%tied_modes
      extra = ''
      if (kept > 0) extra = ', '//to_text(kept)//' coordinates for the mass of soft motions'
      call log%line('reduction: '//to_text(rows)//' rows to '//to_text(reduced%tied_modes)//' modes (to ' &
         & //to_text(reduced%frequency(reduced%tied_modes))//' Hz)'//extra//' and '//to_text(size(reduced%K_bb, 1)) &
         & //' boundary coordinates; residual of the modes '//to_text(reduced%record%residual, 2))
      call log%detail('tied frequencies, Hz:', reduced%frequency(:reduced%tied_modes))
      if (allocated(reduced%soft_frequency)) then
         call log%detail('soft motions of the boundary, Hz with the mass alone that the tied modes do not carry:', &
            & reduced%soft_frequency)
         call log%detail('that mass over all mass of the motion:', reduced%soft_share)
         if (kept == 0) call warn_of_soft(reduced, warnings)
      end if
      if (.not. allocated(reduced%bodies)) return
      do k = 1, min(size(reduced%bodies), bodies_named)
         call log%line(mass_line(reduced, k))
      end do
      if (allocated(reduced%soft_frequency)) then
         if (kept < size(reduced%soft_frequency)) return
      end if
      do k = 1, size(reduced%bodies)
         call warn_of_body(reduced, k, warnings)
      end do
   end subroutine report_reduction

   !> What the reduced model carries of a body.
   function mass_line(reduced, k) result(line)
      type(reduced_model_t), intent(in) :: reduced
      integer, intent(in) :: k
      character(len=:), allocatable :: line
      integer :: r

      associate (body => reduced%bodies(k))
         line = 'mass kept of body '//to_text(k)//' (node '//to_text(body%first_label)//' and '//to_text(body%nodes - 1)// &
            & ' others, '//to_text(maxval(body%inertia(:3)), 4)//' kg) as it moves as a whole along x, y, z:'
         do r = 1, 3
            line = line//' '//percent(body%kept(r))
         end do
         line = line//'; as it turns about x, y, z:'
         do r = 4, 6
            line = line//' '//percent(body%kept(r))
         end do
         if (.not. any(can_move(reduced, body))) line = line//' (it is held)'
      end associate
   end function mass_line

   !> Whether supports and springs let a body move as a whole.
   pure function can_move(reduced, body)
      type(reduced_model_t), intent(in) :: reduced
      type(body_mass_t), intent(in) :: body
      logical :: can_move(6)

      can_move = body%frequency < loose*reduced%frequency(1) .and. body%inertia > 0.0_wp
   end function can_move

   pure function percent(share)
      real(wp), intent(in) :: share
      character(len=:), allocatable :: percent
      percent = to_text(100.0_wp*share, 4)//' %'
   end function percent

   !> Soft motions whose residual mass was dropped.
   subroutine warn_of_soft(reduced, warnings)
      type(reduced_model_t), intent(in) :: reduced
      type(warning_list_t), intent(inout) :: warnings
      integer :: worst, soft

      soft = count(reduced%soft_share > noticeable_share)
      if (soft == 0) return
      worst = maxloc(reduced%soft_share, dim=1)
      call warnings%add(severity_doubtful, '&reduction residual_mass = ''dropped'': '//to_text(soft)// &
         & ' motions of the interfaces lack up to '//percent(reduced%soft_share(worst))//' of their mass; a body that slides '// &
         & 'or lifts as a whole moves too fast. ''kept'' gives it back')
   end subroutine warn_of_soft

   !> A body that can move while its mass is not all there.
   subroutine warn_of_body(reduced, k, warnings)
      type(reduced_model_t), intent(in) :: reduced
      integer, intent(in) :: k
      type(warning_list_t), intent(inout) :: warnings
      character(len=*), parameter :: motion(6) = [character(len=7) :: 'along x', 'along y', 'along z', &
         & 'about x', 'about y', 'about z']
      logical :: movable(6)
      integer :: r

      associate (body => reduced%bodies(k))
         movable = can_move(reduced, body)
         if (.not. any(movable)) return
         r = minloc(body%kept, dim=1, mask=movable)
         if (body%kept(r) >= 1.0_wp - noticeable_share) return
         call warnings%add(severity_note, 'body '//to_text(k)//' (node '//to_text(body%first_label)//' and '// &
            & to_text(body%nodes - 1)//' others) can move '//motion(r)//' at '//to_text(body%frequency(r), 4)//' Hz, but '// &
            & 'the reduced model has '//percent(body%kept(r))//' of its mass there: keep more modes in &reduction')
      end associate
   end subroutine warn_of_body

end module microslip_cli_reduction_report
