!> Every kind of fault of a case file gives exactly one line with group, key, value and what is allowed.
module test_io_case_faults
   use microslip_core_error, only: error_t, status_bad_input
   use microslip_io_case, only: case_t
   use microslip_io_case_file, only: case_from_text
   use support_case_run, only: changed
   use testdrive, only: new_unittest, unittest_type, error_type, check, test_failed
   implicit none(type, external)
   private

   public :: collect_io_case_faults, beam_case

   character(len=*), parameter :: nl = new_line('a')

contains

   subroutine collect_io_case_faults(testsuite)
      type(unittest_type), allocatable, intent(out) :: testsuite(:)

      testsuite = [ &
         new_unittest('groups', test_groups), &
         new_unittest('keys', test_keys), &
         new_unittest('numbers', test_numbers), &
         new_unittest('names', test_names), &
         new_unittest('arrays', test_arrays), &
         new_unittest('missing', test_missing), &
         new_unittest('ignored', test_ignored), &
         new_unittest('alternatives', test_alternatives), &
         new_unittest('references', test_references), &
         new_unittest('interface_values', test_interface_values), &
         new_unittest('several', test_several), &
         new_unittest('modal_parameters', test_modal_parameters), &
         new_unittest('periodic_motions', test_periodic_motions), &
         new_unittest('announced', test_announced)]
   end subroutine collect_io_case_faults

   !> A valid case with two interfaces, used with one change at a time.
   function beam_case() result(text)
      character(len=:), allocatable :: text
      text = "&case title = 'beam'" //nl// &
         "   analyses = 'preload', 'linear_modes', 'transient' /"//nl// &
         "&model source = 'hdf5', file = 'beam.h5' /"//nl// &
         "&interface name = 'left', side_a = 'la', side_b = 'lb', friction = 0.6"//nl// &
         "   young_modulus = 194e9, poisson_ratio = 0.2854, nx = 80, ny = 50 /"//nl// &
         "&interface name = 'right', side_a = 'ra', side_b = 'rb', friction = 0.5"//nl// &
         "   young_modulus = 194e9, poisson_ratio = 0.2854, nx = 80, ny = 50 /"//nl// &
         "&topography name = 'hill', source = 'hill', height = 12.14e-6 /"//nl// &
         "&reduction n_modes = 30 /"//nl// &
         "&damping ratio = 1e-3, reference_mode = 1 /"//nl// &
         "&load name = 'bolt left', node_set = 'up', 'down', direction = 0, 0, 1, 0, 0, -1, size = 2*1.0 /"//nl// &
         "&load name = 'bolt right', node_set = 'rup', direction = 0, 0, 1, size = 1.0 /"//nl// &
         "&load name = 'impact', kind = 'modal', mode = 1 /"//nl// &
         "&preload loads = 'bolt left', 'bolt right', interface_force = 2*2210.0 /"//nl// &
         "&transient duration = 0.1 /"//nl// &
         "&excitation load = 'impact', kind = 'half_sine', amplitude = 1.0, duration = 5e-4 /"//nl// &
         "&output sensors = 'middle', snapshots = 0.0, 0.05 /"//nl
   end function beam_case

   subroutine test_groups(error)
      type(error_type), allocatable, intent(out) :: error

      call one_fault(error, "&damping ratio", "&dampng ratio", &
         "line 10: &dampng: unknown group: allowed: did you mean 'damping'?")
      call one_fault(error, "&damping", "&oil /"//nl//"&damping", "&oil: unknown group: allowed: 'case', 'model',")
      call one_fault(error, "&transient", "&reduction n_modes = 3 /"//nl//"&transient", &
         "line 15: &reduction: second group of this name: allowed: one &reduction")
      call one_fault(error, "n_modes = 30 /", "n_modes = 30", &
         "line 9: &reduction: the group is not closed: allowed: a / behind its last key")
      call one_fault(error, "0.0, 0.05 /", "0.0, 0.05", "line 17: &output: the group is not closed")
      call one_fault(error, "n_modes = 30 /", "n_modes = 30 / method = 'macneal' /", &
         "line 9: outside of the groups: method = 'macneal' /: allowed: comments behind !")
      call one_fault(error, "&model source = 'hdf5', file = 'beam.h5' /", "", "&model: the group is missing")
      call one_fault(error, "&transient duration = 0.1 /", "", "&transient: the group is missing")
   end subroutine test_groups

   subroutine test_keys(error)
      type(error_type), allocatable, intent(out) :: error

      call one_fault(error, "height = ", "hieght = 1e-6, height = ", &
         "line 8: &topography 1 'hill': hieght = 1e-6: allowed: unknown key, did you mean 'height'?")
      call one_fault(error, "n_modes = 30", "n_modes = 30 oil = 3", &
         "&reduction: oil = 3: allowed: unknown key, the keys are 'method', 'n_modes', 'cutoff_frequency', "// &
         & "'residual_mass', 'cache'")
      call one_fault(error, "friction = 0.6", "friction = 0.6, Friction = 0.7", &
         "line 4: &interface 1 'left': friction = 0.6, 0.7: allowed: a number >= 0 (given twice (lines 4 and 4))")
      call one_fault(error, "&reduction n_modes = 30", "&reduction 5 n_modes = 30", &
         "line 9: &reduction: 5 is not understood: allowed: key = value")
      call one_fault(error, "n_modes = 30", "n_modes = 30, cache =", &
         "&reduction: cache = nothing: allowed: a text in quotes, at most 1024 letters")
   end subroutine test_keys

   subroutine test_numbers(error)
      type(error_type), allocatable, intent(out) :: error
      character(len=*), parameter :: place = "line 6: &interface 2 'right': friction = "
      character(len=*), parameter :: allowed = ": allowed: a finite number >= 0"

      call one_fault(error, "friction = 0.5", "friction = -0.5", place//"-0.5"//allowed)
      call one_fault(error, "friction = 0.5", "friction = NaN", place//"NaN"//allowed)
      call one_fault(error, "friction = 0.5", "friction = +inf", place//"+inf"//allowed)
      call one_fault(error, "friction = 0.5", "friction = 1e400", place//"1e400"//allowed)
      call one_fault(error, "friction = 0.5", "friction = 0,5", place//"0, 5: allowed: a number >= 0 (too many values)")
      call one_fault(error, "friction = 0.5", "friction = '0.5'", place//"'0.5'"//allowed)
      call one_fault(error, "friction = 0.5", "friction = half", place//"half"//allowed)
      call one_fault(error, "friction = 0.5", "friction = 5-1", place//"5-1"//allowed)
      call one_fault(error, "friction = 0.5", "friction = 5e", place//"5e"//allowed)
      call one_fault(error, "friction = 0.5", "friction = 0.5.1", place//"0.5.1"//allowed)
      call one_fault(error, "duration = 0.1 /", "duration = 0 /", "&transient: duration = 0: allowed: a finite number > 0")
      call one_fault(error, "duration = 0.1", "duration = 0.1, safety = 2", &
         "&transient: safety = 2: allowed: a finite number > 0 and < 2")
      call one_fault(error, "n_modes = 30", "n_modes = 30.5", "&reduction: n_modes = 30.5: allowed: an integer >= 1")
      call one_fault(error, "n_modes = 30", "n_modes = 99999999999", "n_modes = 99999999999: allowed: an integer >= 1")
      call one_fault(error, "n_modes = 30", "n_modes = 0", "&reduction: n_modes = 0: allowed: an integer >= 1")
      call one_fault(error, "duration = 0.1", "duration = 0.1, time_step = 1e-11", &
         "&transient: time_step = 1e-11: allowed: at most 1.00000E+09 steps in all, a number >= 1.00000E-10")
      call one_fault(error, "&reduction", "&contact tolerance = 1e-16 /"//nl//"&reduction", &
         "&contact: tolerance = 1e-16: allowed: a finite number >= 1.00000E-15 and < 1")
      call one_fault(error, "nx = 80", "nx = 10001", "nx = 10001: allowed: an integer >= 1 and <= 10000")
   end subroutine test_numbers

   subroutine test_names(error)
      type(error_type), allocatable, intent(out) :: error
      character(len=*), parameter :: long = repeat('x', 65)

      call one_fault(error, "source = 'hdf5'", "source = 'hdf'", "&model: source = 'hdf': allowed: 'hdf5', 'calculix'")
      call one_fault(error, "source = 'hdf5'", "source = hdf5", "&model: source = hdf5: allowed: one of 'hdf5', 'calculix'")
      call one_fault(error, "&transient", "&contact compliance = 'sparse' /"//nl//"&transient", &
         "&contact: compliance = 'sparse': allowed: 'auto', 'dense', 'fft'")
      call one_fault(error, "&transient", "&contact solver = 'jacobi', compliance = 'fft' /"//nl//"&transient", &
         "&contact: compliance = 'fft': allowed: only with solver = 'condensed'")
      call one_fault(error, "kind = 'half_sine'", "kind = 'sine'", "&excitation 1: kind = 'sine': allowed: 'half_sine', ")
      call one_fault(error, "sensors = 'middle'", "sensors = '"//long//"'", &
         "&output: sensors = '"//repeat('x', 59)//"...: allowed: a text in quotes, at most 64 letters")
      call one_fault(error, "title = 'beam'", "title = '"//repeat('x', 1025)//"'", "a text in quotes, at most 1024 letters")
      call one_fault(error, "sensors = 'middle'", "sensors = ' '", "&output: sensors = '': allowed: a name that is not blank")
      call one_fault(error, "file = 'beam.h5'", "file = 'beam.h5"//nl, &
         "line 3: &model: file = 'beam.h5: allowed: a closing quote on the same line")
      call one_fault(error, "name = 'right'", "name = 'LEFT'", &
         "&interface 2 'LEFT': name = 'LEFT': allowed: a name of its own, &interface 1 has this one")
   end subroutine test_names

   subroutine test_arrays(error)
      type(error_type), allocatable, intent(out) :: error
      character(len=*), parameter :: right = "node_set = 'rup', direction = 0, 0, 1, size = 1.0"

      call one_fault(error, right, "node_set = 'rup', direction = 0, 1, size = 1.0", &
         "&load 2 'bolt right': direction = 0, 1: allowed: a column of 3 numbers (2 values given)")
      call one_fault(error, right, "node_set = 'rup', direction = 0, 0, 1, size(2) = 1.0", &
         "&load 2 'bolt right': size = 1.0: allowed: a number (too many values)")
      call one_fault(error, right, "node_set(1) = 'rup', node_set(3) = 'r', direction = 9*1, size = 3*1.0", &
         "node_set = 'rup', 'r': allowed: 1 to 8 values, each a text in quotes, at most 64 letters (value 2 is missing)")
   end subroutine test_arrays

   subroutine test_missing(error)
      type(error_type), allocatable, intent(out) :: error

      call one_fault(error, "friction = 0.6", "", &
         "line 4: &interface 1 'left': friction: missing: allowed: a number >= 0")
      call one_fault(error, "file = 'beam.h5'", "", "&model: file: missing: allowed: a text in quotes")
      call one_fault(error, "n_modes = 30", "", "&reduction: allowed: exactly one of 'n_modes', 'cutoff_frequency'")
      call one_fault(error, "title = 'beam'"//nl//"   analyses = 'preload', 'linear_modes', 'transient'", "", &
         "&case: analyses: missing: allowed: 1 or more values, each one of 'preload', 'linear_modes', 'transient'")
   end subroutine test_missing

   subroutine test_ignored(error)
      type(error_type), allocatable, intent(out) :: error

      call one_fault(error, "file = 'beam.h5'", "file = 'beam.h5', unit_mass = 't'", &
         "&model: unit_mass = 't': allowed: only with source = 'calculix', it would be ignored here")
      call one_fault(error, "source = 'hill',", "source = 'flat',", &
         "height = 12.14e-6: allowed: only with source = 'hill', it would be ignored here")
      call one_fault(error, "duration = 5e-4", "duration = 5e-4, phase = 90", &
         "&excitation 1: phase = 90: allowed: only with sines")
      call one_fault(error, "'modal', mode = 1", "'modal', mode = 1, size = 2.0", "size = 2.0: allowed: only with kind = 'nodes'")
      call one_fault(error, "&load name = 'impact'", &
         "&load name = 'rest', node_set = 'a', direction = 1, 0, 0, size = 1.0 /"//nl//"&load name = 'impact'", &
         "&load 3 'rest': allowed: a &load that &preload, &settling, &harmonic_balance or an &excitation uses")
      call one_fault(error, "&transient duration = 0.1 /"//nl// &
         "&excitation load = 'impact', kind = 'half_sine', amplitude = 1.0, duration = 5e-4 /"//nl// &
         "&output sensors = 'middle', snapshots = 0.0, 0.05 /"//nl, "", "&load 3 'impact': allowed: a &load that", lines=2)
   end subroutine test_ignored

   subroutine test_alternatives(error)
      type(error_type), allocatable, intent(out) :: error

      call one_fault(error, "n_modes = 30", "n_modes = 30, cutoff_frequency = 5000", &
         "&reduction: cutoff_frequency = 5000: allowed: only one of 'n_modes', 'cutoff_frequency'")
      call one_fault(error, "duration = 0.1", "duration = 0.1, time_step = 1e-5, safety = 0.5", &
         "&transient: safety = 0.5: allowed: only without time_step")
      call one_fault(error, "side_a = 'la'", "side_a = 'la', plane_point = 3*0", &
         "&interface 1 'left': plane_point = 0, 0, 0: allowed: only one of 'side_a', 'plane_point'")
      call one_fault(error, "side_a = 'la'", "side_a = 'la', plane_normal = 0, 0, 1", &
         "plane_normal = 0, 0, 1: allowed: only with plane_point")
      call one_fault(error, "2*2210.0", "2*2210.0, load_scale = 1, 1", "load_scale = 1, 1: allowed: only one of")
      call one_fault(error, "ratio = 1e-3", "modal_ratio = 1e-3", "reference_mode = 1: allowed: only with ratio")
      call one_fault(error, "ratio = 1e-3, reference_mode = 1", "modal_ratio = 2*1e-3", &
         "&damping: modal_ratio = 1e-3, 1e-3: allowed: one number, or one for each of the 30 modes of &reduction")
      call one_fault(error, "reference_mode = 1", "reference_mode = 31", &
         "reference_mode = 31: allowed: one of the 30 modes of &reduction")
   end subroutine test_alternatives

   subroutine test_references(error)
      type(error_type), allocatable, intent(out) :: error

      call one_fault(error, "side_a = 'la'", "side_a = 'la', topography = 'hil'", &
         "&interface 1 'left': topography = 'hil': allowed: the name of a &topography, did you mean 'hill'?")
      call one_fault(error, "&reduction", "&topography source = 'flat' /"//nl//"&reduction", &
         "&interface 1 'left': topography: missing: allowed: one of the topographies 'hill', 'topography_2'", lines=2)
      call one_fault(error, "&preload loads = 'bolt left'", "&preload loads = 'bold left'", &
         "&preload: loads = 'bold left', 'bolt right': allowed: the name of a &load, did you mean 'bolt left'?")
      call one_fault(error, "&preload loads = 'bolt left', 'bolt right'", "&preload loads = 'bolt left', 'impact'", &
         "allowed: loads of another kind than 'modal'", lines=2)
      call one_fault(error, "interface_force = 2*2210.0", "interface_force = 2210.0", &
         "&preload: interface_force = 2210.0: allowed: one number per interface, 2")
      call one_fault(error, "load = 'impact'", "load = 'kick'", &
         "&excitation 1: load = 'kick': allowed: the name of a &load: 'bolt left', 'bolt right', 'impact'")
      call one_fault(error, "'modal', mode = 1", "'modal', mode = 11", &
         "load = 'impact': allowed: a mode (here 11) out of the 10 of &linear_modes")
      call one_fault(error, ", 'linear_modes', 'transient'", ", 'transient'", &
         "&excitation 1: load = 'impact': allowed: a modal load only with 'linear_modes' before 'transient'")
      call one_fault(error, "amplitude = 1.0", "amplitude = 1.0, start = 0.1", &
         "start = 0.1: allowed: before the end of the &transient, < 0.1 s")
      call one_fault(error, "0.0, 0.05", "0.0, 0.5", "snapshots = 0.0, 0.5: allowed: times within the &transient, <= 0.1 s")
      call one_fault(error, "'preload', 'linear_modes'", "'linear_modes', 'preload'", &
         "&case: analyses = 'linear_modes', 'preload', 'transient': allowed: 'preload' first")
      call one_fault(error, "'preload', 'linear_modes'", "'preload', 'linear_modes', 'preload'", "allowed: every analysis once")
   end subroutine test_references

   subroutine test_interface_values(error)
      type(error_type), allocatable, intent(out) :: error

      call one_fault(error, "side_b = 'lb'", "side_b = 'LA'", "side_b = 'LA': allowed: another node set than side_a")
      call one_fault(error, "nx = 80", "extent = 0, 1, 1, 0 nx = 80", &
         "extent = 0, 1, 1, 0: allowed: 2 pairs of numbers, min < max")
      call one_fault(error, "nx = 80", "axis_1 = 3*0 nx = 80", "axis_1 = 0, 0, 0: allowed: three numbers that are not all 0")
      call one_fault(error, "nx = 80", "holes = 0, 0, 0 nx = 80", "holes = 0, 0, 0: allowed: x, y, radius of every hole")
      call one_fault(error, "0.2854", "0.51", "poisson_ratio = 0.51: allowed: a finite number > -1 and <= 0.5")
      call one_fault(error, "nx = 80", "potential = 'all', potential_margin = 1e-6, nx = 80", &
         "potential_margin = 1e-6: allowed: only with potential = 'auto'")
      call one_fault(error, "side_b = 'lb'", "side_b = 'ground', poisson_ratio(2) = 0.3", &
         "poisson_ratio = 0.3, 0.2854: allowed: one value: the ground is rigid")
      call one_fault(error, "nx = 80", "coupling = 'parallel', nx = 80", &
         "coupling = 'parallel': allowed: 'series', 'scale_split'")
      call one_fault(error, "side_b = 'lb'", "side_b = 'ground', coupling = 'scale_split', young_modulus(2) = 2e11", &
         "coupling = 'scale_split': allowed: 'series', or one young_modulus: elastic ground is not in the FE model")
      call one_fault(error, "size = 2*1.0", "size = 0.0, 1.0", "size = 0.0, 1.0: allowed: numbers other than 0")
      call one_fault(error, "height = 12.14e-6", "height = 12.14e-6, filter_wavelength = 1e-3", &
         "filter_wavelength = 1e-3: allowed: only with source = 'file'")
      call one_fault(error, "height = 12.14e-6", "height = 12.14e-6, layout = 'z[x,y]'", &
         "layout = 'z[x,y]': allowed: only with source = 'file'")
      call one_fault(error, "direction = 0, 0, 1, 0, 0, -1", "direction = 0, 0, 1, 0, 0, 0", &
         "direction = 0, 0, 1, 0, 0, 0: allowed: three numbers per direction that are not all 0")
   end subroutine test_interface_values

   !> All faults are reported at once, whatever kind they are.
   subroutine test_several(error)
      type(error_type), allocatable, intent(out) :: error
      character(len=:), allocatable :: text, faults

      text = changed(changed(changed(changed(beam_case(), "friction = 0.6", "friction = -1"), &
         "n_modes = 30", "n_mode = 30"), "load = 'impact'", "load = 'kick'"), "&damping", "&dampin")
      faults = faults_of(text)
      call check(error, line_count(faults), 5, faults)
      call expect(error, faults, "friction = -1")
      call expect(error, faults, "did you mean 'n_modes'?")
      call expect(error, faults, "exactly one of 'n_modes'")
      call expect(error, faults, "load = 'kick'")
      call expect(error, faults, "did you mean 'damping'?")
   end subroutine test_several

   !> `&qsma` and `&ringdown`.
   subroutine test_modal_parameters(error)
      type(error_type), allocatable, intent(out) :: error

      call one_fault(error, "'transient'", "'qsma', 'transient'", "&qsma: the group is missing")
      call one_fault(error, "&transient", "&qsma largest_amplitude = 1e-4 /"//nl//"&transient", &
         "&qsma: allowed: only with 'qsma' in the analyses of &case")
      call one_fault(error, "&transient", "&ringdown /"//nl//"&transient", &
         "&ringdown: allowed: only with 'ringdown' in the analyses of &case")
      call qsma_fault("", "exactly one of 'amplitudes', 'largest_amplitude'")
      call qsma_fault("amplitudes = 1e-6, 2e-6, largest_amplitude = 1e-4", &
         "largest_amplitude = 1e-4: allowed: only one of 'amplitudes', 'largest_amplitude'")
      call qsma_fault("amplitudes = 1e-6, 2e-6, 2e-6", "amplitudes = 1e-6, 2e-6, 2e-6: allowed: ascending numbers")
      call qsma_fault("amplitudes = 1e-6, 0", "amplitudes(2) = 0: allowed: a finite number > 0")
      call qsma_fault("amplitudes = 1e-6, levels = 3", "levels = 3: allowed: only with largest_amplitude")
      call qsma_fault("largest_amplitude = 1e-4, smallest_amplitude = 1e-4", &
         "smallest_amplitude = 1e-4: allowed: a number below largest_amplitude")
      call qsma_fault("largest_amplitude = 1e-4, spacing = 'cubic'", "spacing = 'cubic': allowed: 'log', 'linear'")
      call qsma_fault("largest_amplitude = 1e-4, cycle = yes", "cycle = yes: allowed: .true. or .false.")
      call qsma_fault("largest_amplitude = 1e-4, cycle = '.true.'", "cycle = '.true.': allowed: .true. or .false.")
      call qsma_fault("largest_amplitude = 1e-4, cycle = .false., cycle_steps = 3", &
         "cycle_steps = 3: allowed: only where loops are not ruled out")
      call qsma_fault("largest_amplitude = 1e-4, mode = 11", "mode = 11: allowed: a mode (here 11) out of the 10")
      call qsma_fault("largest_amplitude = 1e-4, sensor = 'end'", &
         "sensor = 'end': allowed: one of the sensors of &output, 'middle'")
      call one_fault(error, "'linear_modes', 'transient' /", "'qsma', 'linear_modes', 'transient' /"//nl// &
         "&qsma largest_amplitude = 1e-4 /", "mode: missing: allowed: a linear mode only with 'linear_modes' before 'qsma'")
      call one_fault(error, "'transient' /", "'transient', 'ringdown' /", "&ringdown: the group is missing")
      call ringdown_fault("periods = 1", "periods = 1: allowed: a finite number >= 2 and <= 10000")
      call ringdown_fault("overlap = 1", "overlap = 1: allowed: a finite number >= 0 and < 1")
      call ringdown_fault("start = 0.1", "start = 0.1: allowed: before the end of the &transient, < 0.1 s")
      call ringdown_fault("mode = 12", "mode = 12: allowed: a mode (here 12) out of the 10")
      call ringdown_fault("/ &excitation load = 'impact', kind = 'harmonic', amplitude = 1.0, frequency = 200.0", &
         "&ringdown: allowed: only with excitations that end")
      call one_fault(error, "'transient' /", "'ringdown', 'transient' /"//nl//"&ringdown /", &
         "&ringdown: allowed: only with 'transient' before 'ringdown'")

   contains

      subroutine qsma_fault(keys, expected)
         character(len=*), intent(in) :: keys, expected
         call one_fault(error, "'transient' /", "'qsma', 'transient' /"//nl//"&qsma "//keys//" /", expected)
      end subroutine qsma_fault

      subroutine ringdown_fault(keys, expected)
         character(len=*), intent(in) :: keys, expected
         call one_fault(error, "'transient' /", "'transient', 'ringdown' /"//nl//"&ringdown "//keys//" /", expected)
      end subroutine ringdown_fault

   end subroutine test_modal_parameters

   !> `&harmonic_balance` and `&epmc`.
   subroutine test_periodic_motions(error)
      type(error_type), allocatable, intent(out) :: error
      character(len=*), parameter :: good_hb = "load = 'impact', levels = 1.0, frequency_range = 190, 210", &
         good_epmc = "amplitude_range = 1e-6, 1e-4"

      call one_fault(error, "'transient' /", "'transient', 'harmonic_balance' /", "&harmonic_balance: the group is missing")
      call one_fault(error, "'transient' /", "'transient', 'epmc' /", "&epmc: the group is missing")
      call one_fault(error, "&transient", "&epmc "//good_epmc//" /"//nl//"&transient", &
         "&epmc: allowed: only with 'epmc' in the analyses of &case")
      call hb_fault("levels = 1.0, frequency_range = 190, 210", "load: missing")
      call hb_fault("load = 'impakt', levels = 1.0, frequency_range = 190, 210", "did you mean 'impact'?")
      call hb_fault("load = 'impact', levels = 1.0, -2.0, frequency_range = 190, 210", &
         "levels(2) = -2.0: allowed: a finite number > 0")
      call hb_fault("load = 'impact', levels = 1.0, frequency_range = 190", "frequency_range = 190: allowed: ")
      call hb_fault(good_hb//", harmonics = 30", "samples: missing: allowed: more than twice the harmonics, > 60")
      call hb_fault(good_hb//", response_step = 1.5", "response_step = 1.5: allowed: a finite number > 0 and <= 1")
      call hb_fault(good_hb//", sensor = 'end'", "sensor = 'end': allowed: one of the sensors of &output, 'middle'")
      call hb_fault(good_hb//" / &contact normal_law = 'velocity'", &
         "&harmonic_balance: allowed: only with normal_law = 'gap' in &contact")
      call hb_fault(good_hb//" / &contact compliance = 'fft'", "&harmonic_balance: allowed: not with compliance = 'fft'")
      call one_fault(error, "'linear_modes', 'transient' /", "'harmonic_balance', 'linear_modes', 'transient' /"//nl// &
         "&harmonic_balance "//good_hb//" /", "load = 'impact': allowed: a modal load only with 'linear_modes' before "// &
         "'harmonic_balance'")
      call epmc_fault("mode = 1", "amplitude_range: missing")
      call epmc_fault("amplitude_range = 1e-6, 1e-6", "amplitude_range = 1e-6, 1e-6: allowed: two different numbers")
      call epmc_fault(good_epmc//", mode = 11", "mode = 11: allowed: a mode (here 11) out of the 10")
      call epmc_fault(good_epmc//", points = 1", "points = 1: allowed: an integer >= 2")

   contains

      subroutine hb_fault(keys, expected)
         character(len=*), intent(in) :: keys, expected
         call one_fault(error, "'transient' /", "'transient', 'harmonic_balance' /"//nl//"&harmonic_balance "//keys//" /", &
            expected)
      end subroutine hb_fault

      subroutine epmc_fault(keys, expected)
         character(len=*), intent(in) :: keys, expected
         call one_fault(error, "'transient' /", "'transient', 'epmc' /"//nl//"&epmc "//keys//" /", expected)
      end subroutine epmc_fault

   end subroutine test_periodic_motions

   subroutine test_announced(error)
      type(error_type), allocatable, intent(out) :: error

      call one_fault(error, "source = 'hdf5'", "source = 'abaqus'", &
         "source = 'abaqus': allowed: 'hdf5', 'calculix' (this one is announced, but not available yet)")
   end subroutine test_announced

   !> Change the valid case in one place: one line (or `lines`) of faults, with this text in it.
   subroutine one_fault(error, old, new, expected, lines)
      type(error_type), allocatable, intent(inout) :: error
      character(len=*), intent(in) :: old, new, expected
      integer, intent(in), optional :: lines
      character(len=:), allocatable :: faults
      integer :: wanted

      if (allocated(error)) return
      wanted = 1
      if (present(lines)) wanted = lines
      faults = faults_of(changed(beam_case(), old, new, once=.true.))
      if (line_count(faults) /= wanted .or. index(faults, expected) == 0) &
         call test_failed(error, nl//'expected: '//expected//nl//'got:      '//faults)
   end subroutine one_fault

   subroutine expect(error, text, part)
      type(error_type), allocatable, intent(inout) :: error
      character(len=*), intent(in) :: text, part

      if (allocated(error)) return
      if (index(text, part) == 0) call test_failed(error, part//' not in:'//nl//text)
   end subroutine expect

   !> The message for a case text, '' if it is valid.
   function faults_of(text) result(faults)
      character(len=*), intent(in) :: text
      character(len=:), allocatable :: faults
      type(case_t) :: input
      type(error_t), allocatable :: error

      faults = ''
      call case_from_text(text, 'beam.nml', input, error)
      if (.not. allocated(error)) return
      if (error%status == status_bad_input) faults = error%message
   end function faults_of

   pure integer function line_count(text)
      character(len=*), intent(in) :: text
      integer :: k

      line_count = 0
      if (text == '') return
      line_count = 1 + count([(text(k:k) == nl, k=1, len(text))])
   end function line_count

end module test_io_case_faults
