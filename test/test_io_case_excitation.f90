!> The keys of excitations and of the settling: what is refused, and that all of them come back from the resolved text.
module test_io_case_excitation
   use microslip_core_error, only: error_t
   use microslip_core_kinds, only: wp
   use microslip_io_case, only: case_t
   use microslip_io_case_file, only: case_from_text, resolved_text
   use test_io_case_faults, only: beam_case
   use support_case_run, only: changed
   use testdrive, only: check, new_unittest, test_failed, testing_error => error_type, unittest_type
   implicit none(type, external)
   private

   public :: collect_io_case_excitation

   character(len=*), parameter :: nl = new_line('a')
   !> What is replaced in the valid case.
   character(len=*), parameter :: transient = '&transient duration = 0.1 /', &
      & impact = "kind = 'half_sine', amplitude = 1.0, duration = 5e-4", snapshots = ', snapshots = 0.0, 0.05'

contains

   subroutine collect_io_case_excitation(testsuite)
      type(unittest_type), allocatable, intent(out) :: testsuite(:)

      testsuite = [new_unittest('valid: every kind, and back from the resolved text', test_valid), &
         & new_unittest('faults of excitations', test_faults), &
         & new_unittest('the end of the time integration', test_duration), &
         & new_unittest('faults of the settling', test_settling), &
         & new_unittest('base excitation', test_base)]
   end subroutine collect_io_case_excitation

   !> A case with another excitation; `tail` replaces the transient group.
   function excited(keys, tail) result(text)
      character(len=*), intent(in) :: keys
      character(len=*), intent(in), optional :: tail
      character(len=:), allocatable :: text

      text = changed(beam_case(), impact, keys)
      if (present(tail)) text = changed(changed(text, transient, tail), snapshots, '')
   end function excited

   !> A case with a settling analysis.
   function settled(keys) result(text)
      character(len=*), intent(in) :: keys
      character(len=:), allocatable :: text
      text = changed(changed(beam_case(), "'transient' /", "'settling', 'transient' /"), transient, &
         & '&settling '//keys//' /'//nl//transient)
   end function settled

   subroutine read_back(error, text)
      type(testing_error), allocatable, intent(inout) :: error
      character(len=*), intent(in) :: text
      type(case_t) :: input, again
      type(error_t), allocatable :: lib

      if (allocated(error)) return
      call case_from_text(text, 'beam.nml', input, lib)
      if (.not. allocated(lib)) call case_from_text(resolved_text(input), 'again.nml', again, lib)
      if (allocated(lib)) then
         call test_failed(error, lib%message)
      else
         call check(error, resolved_text(again), resolved_text(input))
      end if
   end subroutine read_back

   !> One line of faults, with this text in it.
   subroutine refused(error, text, expected)
      type(testing_error), allocatable, intent(inout) :: error
      character(len=*), intent(in) :: text, expected
      type(case_t) :: input
      type(error_t), allocatable :: lib

      if (allocated(error)) return
      call case_from_text(text, 'beam.nml', input, lib)
      if (.not. allocated(lib)) then
         call test_failed(error, 'not refused: '//expected)
      else
         call check(error, index(lib%message, expected) > 0 .and. index(lib%message, nl) == 0, nl//'expected: '//expected// &
            & nl//'got: '//lib%message)
      end if
   end subroutine refused

   subroutine test_valid(error)
      type(testing_error), allocatable, intent(out) :: error
      type(case_t) :: input
      type(error_t), allocatable :: lib

      call read_back(error, excited(impact//', times = 0.0, 0.05, 0.09'))
      call read_back(error, excited("kind = 'harmonic', amplitude = 1.0, frequency = 200.0, phase = -90.0, ramp = 0.01"))
      call read_back(error, excited("kind = 'file', file = 'blow.txt'"))
      call read_back(error, excited("kind = 'file', file = 'blow.txt', amplitude = -2.5, start = 0.01"))
      call read_back(error, excited("kind = 'stepped_sine', amplitude = 1.0, frequencies = 200.0, 210.0", '&transient /'))
      call read_back(error, excited("kind = 'stepped_sine', amplitude = 1.0, frequency_from = 220, frequency_to = 200, "// &
         & "frequency_count = 11, settle_periods = 0, measure_periods = 5, steady_tolerance = 1e-3, most_windows = 7, "// &
         & "harmonics = 3, phase = 10, ramp = 0.1, start = 0.01", '&transient safety = 0.5 /'))
      call read_back(error, excited("kind = 'swept_sine', amplitude = 1.0, frequency_from = 220, frequency_to = 200, "// &
         & "rate = 5, sweep = 'log', harmonics = 2, measure_periods = 20", '&transient duration = 1.0 /'))
      call read_back(error, settled("load = 'impact', amplitude = 1.0, impacts = 3, duration = 5e-4, interval = 0.5"))
      call read_back(error, settled("load = 'impact', amplitude = 1, 1, 4, duration = 5e-4, interval = 0.5, mode = 2, "// &
         & "periods = 20, ringdown = .true., time_step = 1e-5"))
      if (allocated(error)) return
      call case_from_text(excited("kind = 'file', file = 'blow.txt'"), 'beam.nml', input, lib)
      call check(error, abs(input%excitations(1)%amplitude - 1.0_wp) < 1.0e-15_wp, 'amplitude of a file')
   end subroutine test_valid

   subroutine test_faults(error)
      type(testing_error), allocatable, intent(out) :: error
      character(len=*), parameter :: stepped = "kind = 'stepped_sine', amplitude = 1.0, ", &
         & swept = "kind = 'swept_sine', amplitude = 1.0, frequency_from = 200, rate = 1, "

      call refused(error, excited("kind = 'square', amplitude = 1.0"), &
         & "kind = 'square': allowed: 'half_sine', 'harmonic', 'stepped_sine', 'swept_sine', 'file'")
      call refused(error, excited(impact//', times = 0.05, start = 0.01'), 'start = 0.01: allowed: only without times')
      call refused(error, excited(impact//', times = 0.05, 0.1'), 'times = 0.05, 0.1: allowed: before the end')
      call refused(error, excited("kind = 'file'"), 'file: missing')
      call refused(error, excited("kind = 'file', file = 'a', ramp = 1"), 'ramp = 1: allowed: only with sines')
      call refused(error, excited(impact//", file = 'a'"), "file = 'a': allowed: only with kind = 'file'")
      call refused(error, excited(stepped//'frequencies = 200, frequency_from = 100', '&transient /'), &
         & "frequency_from = 100: allowed: only one of 'frequencies', 'frequency_from'")
      call refused(error, excited(stepped//'frequency_from = 200, frequency_to = 210', '&transient /'), &
         & 'frequency_count: missing')
      call refused(error, excited(stepped//'frequencies = 200, 0', '&transient /'), &
         & 'frequencies(2) = 0: allowed: a finite number > 0')
      call refused(error, excited(stepped//'frequencies = 200, most_windows = 5', '&transient /'), &
         & 'most_windows = 5: allowed: only with steady_tolerance')
      call refused(error, excited(stepped//'frequencies = 200, measure_periods = 1', '&transient /'), &
         & 'measure_periods = 1: allowed: an integer >= 2')
      call refused(error, excited(stepped//'frequencies = 200, rate = 1', '&transient /'), &
         & "rate = 1: allowed: only with kind = 'swept_sine'")
      call refused(error, excited(swept//'frequency_to = 200', '&transient /'), &
         & 'frequency_to = 200: allowed: another number than frequency_from')
      call refused(error, excited(swept//'frequency_to = 200.001', '&transient /'), 'rate = 1: allowed: a number <= 0.02')
      call refused(error, excited(swept//"frequency_to = 210, sweep = 'cubic'", '&transient /'), &
         & "sweep = 'cubic': allowed: 'linear', 'log'")
      call refused(error, excited(swept//'frequency_to = 210, settle_periods = 5', '&transient /'), &
         & "settle_periods = 5: allowed: only with kind = 'stepped_sine'")
      call refused(error, excited(impact//', harmonics = 3'), "harmonics = 3: allowed: only with kind = 'stepped_sine' or")
      call refused(error, changed(excited(swept//'frequency_to = 210', '&transient /'), "sensors = 'middle'", ''), &
         & 'measure at the sensors of &output, but there is none')
      call refused(error, excited(swept//"frequency_to = 210 /"//nl//"&excitation load = 'impact', "//stepped// &
         & 'frequencies = 200.0', '&transient /'), 'one stepped or swept sine at most')
   end subroutine test_faults

   subroutine test_duration(error)
      type(testing_error), allocatable, intent(out) :: error

      call refused(error, changed(changed(beam_case(), transient, '&transient /'), snapshots, ''), &
         & 'duration: missing: allowed: a number > 0, unless a stepped or swept sine sets the end')
      call refused(error, excited("kind = 'stepped_sine', amplitude = 1, frequencies = 200 /"//nl// &
         & "&excitation load = 'impact', kind = 'harmonic', amplitude = 1.0, frequency = 50.0", '&transient /'), &
         & 'no harmonic excitation goes on')
   end subroutine test_duration

   subroutine test_settling(error)
      type(testing_error), allocatable, intent(out) :: error
      character(len=*), parameter :: keys = "load = 'impact', amplitude = 1.0, duration = 5e-4, "

      call refused(error, changed(beam_case(), "'transient' /", "'transient', 'settling' /"), '&settling: the group is missing')
      call refused(error, changed(beam_case(), '&transient', '&settling '//keys//'interval = 0.5 /'//nl//'&transient'), &
         & "&settling: allowed: only with 'settling' in the analyses of &case")
      call refused(error, settled(keys//'interval = 4e-4'), 'duration = 5e-4: allowed: a number below interval')
      call refused(error, settled(keys//'interval = 0.5, impacts = 0'), 'impacts = 0: allowed: an integer >= 1')
      call refused(error, settled("load = 'impact', amplitude = 1.0, 2.0, impacts = 2, duration = 5e-4, interval = 0.5"), &
         & 'impacts = 2: allowed: only with a single amplitude')
      call refused(error, settled(keys//'interval = 0.5, mode = 11'), 'mode = 11: allowed: a mode (here 11) out of the 10')
      call refused(error, settled("load = 'impct', amplitude = 1.0, duration = 5e-4, interval = 0.5"), &
         & "load = 'impct': allowed: the name of a &load, did you mean 'impact'?")
      call refused(error, settled(keys//'interval = 0.5, time_step = 1e-5, safety = 0.5'), &
         & 'safety = 0.5: allowed: only without time_step')
   end subroutine test_settling

   subroutine test_base(error)
      type(testing_error), allocatable, intent(out) :: error
      character(len=*), parameter :: modal = "kind = 'modal', mode = 1"

      call read_back(error, changed(beam_case(), modal, "kind = 'base', direction = 0, 0, 1"))
      call refused(error, changed(beam_case(), modal, "kind = 'base', direction = 0, 0, 0"), &
         & 'direction = 0, 0, 0: allowed: three numbers per direction that are not all 0')
      call refused(error, changed(beam_case(), modal, "kind = 'base'"), 'direction: missing')
      call refused(error, changed(beam_case(), modal, "kind = 'base', direction = 0, 0, 1, size = 1"), &
         & "size = 1: allowed: only with kind = 'nodes'")
      call refused(error, changed(beam_case(), modal, "kind = 'base', direction = 0, 0, 1, mode = 1"), &
         & "mode = 1: allowed: only with kind = 'modal'")
   end subroutine test_base

end module test_io_case_excitation
