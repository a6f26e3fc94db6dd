!> The log on standard output. Warnings of a quiet run are written to standard error.
module microslip_cli_log
   use, intrinsic :: iso_fortran_env, only: error_unit, output_unit
   use microslip_core_kinds, only: wp
   use microslip_core_standard_streams, only: put_line
   use microslip_core_stopwatch, only: stopwatch_t
   use microslip_core_text, only: to_text
   use microslip_core_warning_list, only: severity_doubtful, severity_wrong, warning_list_t
   implicit none(type, external)
   private

   public :: log_t, listed, warnings_in_words

   type :: log_t
      logical :: quiet = .false., verbose = .false.
      !> Where it goes
      integer :: unit = output_unit
   contains
      procedure :: title
      procedure :: line
      procedure :: detail
      procedure :: timing
      procedure :: warnings
   end type log_t

contains

   !> A heading.
   subroutine title(self, text)
      class(log_t), intent(in) :: self
      character(len=*), intent(in) :: text
      if (.not. self%quiet) call put_line(self%unit, text)
   end subroutine title

   !> A line of the log.
   subroutine line(self, text)
      class(log_t), intent(in) :: self
      character(len=*), intent(in) :: text
      if (.not. self%quiet) call put_line(self%unit, '  '//text)
   end subroutine line

   !> Numbers that only the verbose log has.
   subroutine detail(self, text, values)
      class(log_t), intent(in) :: self
      character(len=*), intent(in) :: text
      real(wp), intent(in) :: values(:)
      character(len=25*size(values)) :: numbers

      if (.not. self%verbose) return
      write (numbers, '(*(1x,g0.8))') values
      call put_line(self%unit, '  '//text//trim(numbers))
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

   !> All warnings, worst first.
   subroutine warnings(self, list)
      class(log_t), intent(in) :: self
      type(warning_list_t), intent(in) :: list
      integer :: k

      if (list%number() > 0) call self%line('warnings, worst first:')
      do k = 1, list%number()
         if (self%quiet) then
            call put_line(error_unit, 'microslip: warning: '//severity_name(list%severity(k))//': '//list%text(k))
         else
            call self%line('  '//to_text(k)//'. '//severity_name(list%severity(k))//': '//list%text(k))
         end if
      end do
   end subroutine warnings

   !> A severity in words.
   pure function severity_name(severity) result(name)
      integer, intent(in) :: severity
      character(len=:), allocatable :: name

      select case (severity)
      case (severity_wrong)
         name = 'most likely wrong'
      case (severity_doubtful)
         name = 'doubtful'
      case default
         name = 'note'
      end select
   end function severity_name

   !> How many warnings there are, for the closing line: '', or '; 3 warnings (1 most likely wrong)'.
   pure function warnings_in_words(list) result(text)
      type(warning_list_t), intent(in) :: list
      character(len=:), allocatable :: text
      integer :: wrong, k

      text = ''
      if (list%number() == 0) return
      text = '; '//to_text(list%number())//trim(merge(' warning ', ' warnings', list%number() == 1))
      wrong = count([(list%severity(k) == severity_wrong, k=1, list%number())])
      if (wrong > 0) text = text//' ('//to_text(wrong)//' '//severity_name(severity_wrong)//')'
   end function warnings_in_words

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
