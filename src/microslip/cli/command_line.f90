!> The command line: options and case files.
module microslip_cli_command_line
   use microslip_core_error, only: error_t, bad_input
   implicit none(type, external)
   private

   public :: command_line_t, text_t, parse_command_line, process_arguments, help_text

   !> What '-' stands for.
   character(len=*), parameter :: standard_input = '/dev/stdin'

   !> A string in an array of strings of different lengths.
   type :: text_t
      character(len=:), allocatable :: text
   end type text_t

   type :: command_line_t
      type(text_t), allocatable :: cases(:)
      !> Result file; not allocated: by the case
      character(len=:), allocatable :: output
      !> File to write the FE model to instead of running; not allocated: none
      character(len=:), allocatable :: write_model
      logical :: restart = .false., check = .false., quiet = .false., verbose = .false., version = .false., help = .false.
      !> 0: as the environment says
      integer :: threads = 0
   end type command_line_t

contains

   !> The arguments of the process.
   function process_arguments() result(arguments)
      type(text_t), allocatable :: arguments(:)
      integer :: k, length

      allocate (arguments(command_argument_count()))
      do k = 1, size(arguments)
         call get_command_argument(k, length=length)
         allocate (character(len=length) :: arguments(k)%text)
         call get_command_argument(k, arguments(k)%text)
      end do
   end function process_arguments

   !> Understand the arguments; all faults are reported at once.
   subroutine parse_command_line(arguments, line, error)
      type(text_t), intent(in) :: arguments(:)
      type(command_line_t), intent(out) :: line
      type(error_t), allocatable, intent(out) :: error
      character(len=:), allocatable :: faults, value
      integer :: k, status

      faults = ''
      allocate (line%cases(0))
      k = 0
      do while (k < size(arguments))
         k = k + 1
         associate (argument => arguments(k)%text)
            select case (argument)
            case ('--check'); line%check = .true.
            case ('--restart'); line%restart = .true.
            case ('--quiet'); line%quiet = .true.
            case ('--verbose'); line%verbose = .true.
            case ('--version'); line%version = .true.
            case ('--help', '-h'); line%help = .true.
            case ('--output')
               if (allocated(line%output)) call fault('--output: only once')
               call take_value(line%output)
            case ('--write-model')
               if (allocated(line%write_model)) call fault('--write-model: only once')
               call take_value(line%write_model)
            case ('--threads')
               call take_value(value)
               if (.not. allocated(value)) cycle
               status = verify(value, '0123456789')
               if (status == 0) read (value, '(i20)', iostat=status) line%threads
               if (status /= 0 .or. line%threads < 1) call fault("--threads '"//value//"': a number from 1 up is allowed")
            case default
               if (argument == '-') then
                  line%cases = [line%cases, text_t(standard_input)]
               else if (index(argument, '-') == 1) then
                  call fault("unknown option '"//argument//"' (see --help)")
               else
                  line%cases = [line%cases, arguments(k)]
               end if
            end select
         end associate
      end do
      if (line%help .or. line%version) return
      if (size(line%cases) == 0 .and. faults == '') call fault('no case file given (see --help)')
      if (size(line%cases) > 1 .and. allocated(line%output)) call fault('--output: only with one case file')
      if (size(line%cases) > 1 .and. allocated(line%write_model)) call fault('--write-model: only with one case file')
      if (allocated(line%write_model) .and. allocated(line%output)) call fault( &
         & '--write-model and --output exclude one another: nothing is run, there are no results')
      if (allocated(line%write_model) .and. line%restart) call fault('--write-model and --restart exclude one another')
      if (line%quiet .and. line%verbose) call fault('--quiet and --verbose exclude one another')
      if (faults /= '') call bad_input(error, faults)

   contains

      !> The argument after an option is its value, unless it is an option itself.
      subroutine take_value(target)
         character(len=:), allocatable, intent(out) :: target
         if (k < size(arguments)) then
            if (index(arguments(k + 1)%text, '--') /= 1) then
               k = k + 1
               target = arguments(k)%text
               return
            end if
         end if
         call fault(arguments(k)%text//': a value must follow')
      end subroutine take_value

      subroutine fault(message)
         character(len=*), intent(in) :: message
         if (faults /= '') faults = faults//new_line('a')
         faults = faults//'command line: '//message
      end subroutine fault

   end subroutine parse_command_line

   !> What --help prints.
   function help_text() result(text)
      character(len=:), allocatable :: text
      character(len=*), parameter :: nl = new_line('a')

      text = 'microslip [options] CASE.nml [CASE2.nml ...]      (- for a case from standard input)'//nl// &
         & nl// &
         & 'Vibration and friction damping of bolted structures with resolved contact topography.'//nl// &
         & nl// &
         & '  --check             read and validate everything, print the scene, run nothing'//nl// &
         & "  --output FILE       result file (default: the case's name with .h5, in the current folder)"//nl// &
         & '  --restart           go on with an interrupted run from its result file; without one, from the beginning'//nl// &
         & "  --write-model FILE  write the case's FE model as the program's own HDF5 model file, run nothing"//nl// &
         & '  --quiet, --verbose  less or more in the log'//nl// &
         & '  --threads N         number of threads'//nl// &
         & '  --version, --help'//nl// &
         & nl// &
         & 'Exit status: 0 done; 1 the computation failed (the result file holds everything up to there);'//nl// &
         & '2 the input or the command line is wrong; 129, 130, 141, 143 stopped by SIGHUP, Ctrl-C,'//nl// &
         & 'SIGPIPE (nobody reads the log any more) or SIGTERM: go on with --restart.'//nl// &
         & nl// &
         & 'Only files that the program wrote itself are replaced, and never one that a case reads.'
   end function help_text

end module microslip_cli_command_line
