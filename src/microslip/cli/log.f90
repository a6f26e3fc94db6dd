!> The log on standard output.
module microslip_cli_log
   use, intrinsic :: iso_fortran_env, only: output_unit
   use microslip_core_kinds, only: wp
   use microslip_core_stopwatch, only: stopwatch_t
   use microslip_core_text, only: to_text
   implicit none(type, external)
   private

   public :: log_t, listed

   type :: log_t
      logical :: quiet = .false., verbose = .false.
      !> Where it goes
      integer :: unit = output_unit
   contains
      procedure :: title
      procedure :: line
      procedure :: detail
      procedure :: timing
   end type log_t

contains

   !> A heading.
   subroutine title(self, text)
      class(log_t), intent(in) :: self
      character(len=*), intent(in) :: text
      if (.not. self%quiet) write (self%unit, '(a)') text
   end subroutine title

   !> A line of the log.
   subroutine line(self, text)
      class(log_t), intent(in) :: self
      character(len=*), intent(in) :: text
      if (.not. self%quiet) write (self%unit, '(2x,a)') text
      flush (self%unit)
   end subroutine line

   !> Numbers that only the verbose log has.
   subroutine detail(self, text, values)
      class(log_t), intent(in) :: self
      character(len=*), intent(in) :: text
      real(wp), intent(in) :: values(:)
      if (self%verbose) write (self%unit, '(2x,a,*(1x,g0.8))') text, values
   end subroutine detail

   !> Wall seconds of the stages.
   subroutine timing(self, clock)
      class(log_t), intent(in) :: self
      type(stopwatch_t), intent(in) :: clock
      character(len=:), allocatable :: text
      integer :: k

      text = 'wall time, s:'
      do k = 1, size(clock%stage)
         text = text//' '//trim(clock%stage(k))//' '//to_text(clock%seconds(k), 3)//merge(',', ' ', k < size(clock%stage))
      end do
      call self%line(trim(text))
   end subroutine timing

   !> Numbers with blanks in front.
   pure function listed(values) result(text)
      real(wp), intent(in) :: values(:)
      character(len=:), allocatable :: text
      integer :: k

      text = ''
      do k = 1, size(values)
         text = text//' '//to_text(values(k), 7)
      end do
   end function listed

end module microslip_cli_log
