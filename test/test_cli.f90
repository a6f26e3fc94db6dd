!> Tests of the command line and of the driver: a small model, written here, goes all the way to a result file.
module test_cli
   use microslip_cli_command_line, only: command_line_t, help_text, parse_command_line, text_t
   use microslip_cli_driver, only: run_cases
   use microslip_core_error, only: error_t, status_bad_input, status_failed
   use microslip_core_kinds, only: wp, pi
   use microslip_core_text, only: to_text
   use microslip_fe_model, only: fe_model_t, node_set_t
   use microslip_io_hdf5, only: hdf5_file_t
   use microslip_io_model_file, only: read_model_hdf5, write_model_hdf5
   use support_brick, only: block_model, block_t
   use support_case_run, only: changed, run_case, write_text
   use support_checks, only: good, remove
   use testdrive, only: check, new_unittest, test_failed, testing_error => error_type, unittest_type
   implicit none(type, external)
   private

   public :: collect_cli

   !> Files of these tests, removed by each.
   character(len=*), parameter :: folder = 'build/', case_name = 'test_cli_case', model_name = 'test_cli_model.h5'
   character(len=*), parameter :: case_path = folder//case_name//'.nml', model_path = folder//model_name, &
      & result_path = folder//'test_cli_result.h5', cache_name = 'test_cli_cache.h5', nl = new_line('a')
   real(wp), parameter :: density = 7800.0_wp

contains

   subroutine collect_cli(testsuite)
      type(unittest_type), allocatable, intent(out) :: testsuite(:)

      testsuite = [ &
         & new_unittest('all options', test_options), &
         & new_unittest('damping set on the preloaded mode', test_damping_reference), &
         & new_unittest('faults of the command line, all at once', test_option_faults), &
         & new_unittest('a case from model to results', test_run), &
         & new_unittest('scale-split coupling, checked', test_scale_split), &
         & new_unittest('points that join are in the file', test_points_added), &
         & new_unittest('--check computes and writes nothing', test_check), &
         & new_unittest('wrong input: status 2, one message, no file', test_bad_input), &
         & new_unittest('failed computation: status 1, results are kept', test_failed_run), &
         & new_unittest('cached reduction', test_cache), &
         & new_unittest('--write-model', test_write_model), &
         & new_unittest('a case that fails does not stop the next', test_two_cases)]
   end subroutine collect_cli

   !> Remove the files of these tests.
   subroutine clean_up()
      call remove(case_path)
      call remove(model_path)
      call remove(result_path)
      call remove(folder//cache_name)
   end subroutine clean_up

   logical function is_there(path)
      character(len=*), intent(in) :: path
      inquire (file=path, exist=is_there)
   end function is_there

   !> Words to arguments.
   function words(text) result(arguments)
      character(len=*), intent(in) :: text
      type(text_t), allocatable :: arguments(:)
      integer :: first, length

      allocate (arguments(0))
      first = 1
      do while (first <= len(text))
         length = index(text(first:)//' ', ' ') - 1
         if (length > 0) arguments = [arguments, text_t(text(first:first + length - 1))]
         first = first + length + 1
      end do
   end function words

   !> Two blocks held at one end, on each other; sets of the nodes that are free.
   subroutine write_blocks(steel_density, lib)
      real(wp), intent(in) :: steel_density
      type(error_t), allocatable, intent(out) :: lib
      type(fe_model_t) :: model
      type(node_set_t) :: extra(3)
      character(len=*), parameter :: from(3) = ['upper_zmin', 'lower_zmax', 'upper_zmax']
      character(len=*), parameter :: names(3) = ['upper_pad', 'lower_pad', 'top_face ']
      integer, parameter :: cells(3) = [4, 3, 2]
      integer, allocatable :: rows(:, :)
      integer :: k

      call block_model([block_t('lower', [0.0_wp, 0.0_wp, -0.02_wp], [0.06_wp, 0.04_wp, 0.02_wp], cells, &
         & density=steel_density), block_t('upper', [0.0_wp, 0.0_wp, 0.0_wp], [0.06_wp, 0.04_wp, 0.03_wp], cells, &
         & density=steel_density)], ['lower_xmin', 'upper_xmin'], model)
      rows = model%rows_of_nodes()
      do k = 1, size(extra)
         associate (nodes => model%node_sets(model%find_node_set(from(k)))%nodes)
            extra(k)%name = trim(names(k))
            extra(k)%nodes = pack(nodes, rows(1, nodes) > 0)
         end associate
      end do
      model%node_sets = [model%node_sets, extra]
      call write_model_hdf5(model_path, model, lib)
   end subroutine write_blocks

   !> A case with all analyses; `find` becomes `replacement`.
   function case_text(find, replacement) result(text)
      character(len=*), intent(in), optional :: find, replacement
      character(len=:), allocatable :: text

      text = "&case title = 'two blocks', analyses = 'preload', 'linear_modes', 'transient' /"//nl// &
         & "&model source = 'hdf5', file = '"//model_name//"' /"//nl// &
         & "&interface name = 'joint', side_a = 'upper_pad', side_b = 'lower_pad', friction = 0.5,"//nl// &
         & "  young_modulus = 2e11, poisson_ratio = 0.3, nx = 8, ny = 6 /"//nl// &
         & "&topography source = 'hill', height = 1e-6 /"//nl// &
         & "&reduction n_modes = 12 /"//nl// &
         & "&damping modal_ratio = 0.01 /"//nl// &
         & "&load name = 'press', node_set = 'top_face', direction = 0, 0, -1, size = 1.0 /"//nl// &
         & "&load name = 'hit', kind = 'modal', mode = 2 /"//nl// &
         & "&preload loads = 'press', interface_force = 2000.0 /"//nl// &
         & "&linear_modes n_modes = 4 /"//nl// &
         & "&transient duration = 1e-4 /"//nl// &
         & "&excitation load = 'hit', kind = 'half_sine', amplitude = 2000.0, duration = 3e-5 /"//nl// &
         & "&output sensors = 'upper_xmax', sensor_direction = 0, 0, 1, snapshots = 5e-5 /"//nl
      if (present(find)) text = changed(text, find, replacement)
   end function case_text

   !> Write a case and run it in silence.
   subroutine run(text, lib, check_only)
      character(len=*), intent(in) :: text
      type(error_t), allocatable, intent(out) :: lib
      logical, intent(in), optional :: check_only

      call run_case(text, case_path, result_path, lib, check_only)
   end subroutine run

   subroutine test_options(error)
      type(testing_error), allocatable, intent(out) :: error
      type(error_t), allocatable :: lib
      type(command_line_t) :: line

      call parse_command_line(words('--check --quiet --threads 2 --output out.h5 case.nml'), line, lib)
      call good(error, lib)
      if (allocated(error)) return
      call check(error, line%check .and. line%quiet .and. .not. line%verbose .and. line%threads == 2 &
         & .and. line%output == 'out.h5' .and. size(line%cases) == 1 .and. .not. allocated(line%write_model), &
         & 'an option was not understood')
      if (allocated(error)) return
      call check(error, line%cases(1)%text == 'case.nml', 'another case')
      if (allocated(error)) return
      call parse_command_line(words('a.nml --verbose b.nml'), line, lib)
      call good(error, lib)
      if (allocated(error)) return
      call check(error, line%verbose .and. line%threads == 0 .and. .not. line%check &
         & .and. .not. allocated(line%output) .and. size(line%cases) == 2, 'options between the cases')
      if (allocated(error)) return
      call check(error, line%cases(1)%text == 'a.nml' .and. line%cases(2)%text == 'b.nml', 'the order of the cases')
      if (allocated(error)) return
      ! No case is needed to be told about the program.
      call parse_command_line(words('--help'), line, lib)
      if (.not. allocated(lib)) call check(error, line%help .and. index(help_text(), '--threads N') > 0, 'no help')
      if (allocated(error)) return
      call good(error, lib)
      if (allocated(error)) return
      call parse_command_line(words('--version'), line, lib)
      call check(error,.not. allocated(lib) .and. line%version, 'no version')
   end subroutine test_options

   subroutine test_option_faults(error)
      type(testing_error), allocatable, intent(out) :: error

      call expect('', 'no case file')
      if (.not. allocated(error)) call expect('--quiet', 'no case file')
      if (.not. allocated(error)) call expect('case.nml --fast', "'--fast'")
      if (.not. allocated(error)) call expect('case.nml --threads', '--threads: a value must follow')
      if (.not. allocated(error)) call expect('case.nml --threads 0', "--threads '0'")
      if (.not. allocated(error)) call expect('case.nml --threads -2', "--threads '-2'")
      if (.not. allocated(error)) call expect('case.nml --threads two', "--threads 'two'")
      if (.not. allocated(error)) call expect('case.nml --threads 2.5', "--threads '2.5'")
      if (.not. allocated(error)) call expect('case.nml --threads 2,x', "--threads '2,x'")
      if (.not. allocated(error)) call expect('case.nml --threads 99999999999', '--threads')
      if (.not. allocated(error)) call expect('case.nml --output', '--output: a value must follow')
      if (.not. allocated(error)) call expect('case.nml --output --check', '--output: a value must follow')
      if (.not. allocated(error)) call expect('a.nml b.nml --output o.h5', '--output: only with one case')
      if (.not. allocated(error)) call expect('a.nml b.nml --write-model m.h5', '--write-model: only with one case')
      if (.not. allocated(error)) call expect('a.nml --output o.h5 --output p.h5', '--output: only once')
      if (.not. allocated(error)) call expect('a.nml --output o.h5 --write-model m.h5', '--write-model and --output')
      if (.not. allocated(error)) call expect('a.nml --restart --write-model m.h5', '--write-model and --restart')
      if (.not. allocated(error)) call expect('a.nml --quiet --verbose', 'exclude one another')
      if (.not. allocated(error)) call expect('--quiet --slow --verbose --threads x', "'--slow'")
      if (.not. allocated(error)) call expect('--quiet --slow --verbose --threads x', 'exclude')
      if (.not. allocated(error)) call expect('--quiet --slow --verbose --threads x', "'x'")

   contains

      !> The arguments are refused with a message that has the given words.
      subroutine expect(arguments, part)
         character(len=*), intent(in) :: arguments, part
         type(command_line_t) :: line
         type(error_t), allocatable :: lib

         call parse_command_line(words(arguments), line, lib)
         call check(error, allocated(lib), "'"//arguments//"' was taken")
         if (allocated(error)) return
         call check(error, lib%status == status_bad_input .and. index(lib%message, part) > 0, lib%message)
      end subroutine expect

   end subroutine test_option_faults

   !> Everything the result file promises is there, and the numbers are those of the case.
   subroutine test_run(error)
      type(testing_error), allocatable, intent(out) :: error
      type(error_t), allocatable :: lib
      type(hdf5_file_t) :: file
      real(wp), allocatable :: force(:), time(:), sensor(:, :), frequency(:), pressure(:, :)
      real(wp) :: balance
      character(len=:), allocatable :: input, command, stages(:)
      integer :: k, unconverged
      character(len=*), parameter :: promised(*) = [character(len=40) :: '/setup/input', '/setup/resolved', &
         & '/timing/seconds', '/model/tied_frequency', '/model/modal_participation', '/interface_1/x', '/interface_1/y', &
         & '/interface_1/height', '/interface_1/potential', '/interface_1/coupling/kind', '/preload/interface_1/pressure', &
         & '/preload/interface_1/traction_1', '/preload/interface_1/traction_2', '/preload/interface_1/gap', &
         & '/preload/interface_1/slip_ratio', '/linear_modes/frequency', '/transient/time', '/transient/sensor', &
         & '/transient/modal_displacement', '/transient/energy/kinetic', '/transient/energy/elastic', &
         & '/transient/energy/external_work', '/transient/energy/viscous_loss', '/transient/energy/friction_loss', &
         & '/transient/energy/balance_error', '/transient/contact/stick', '/transient/contact/slip', &
         & '/transient/contact/open', '/transient/contact/iterations', '/transient/snapshot/interface_1/pressure']

      call write_blocks(density, lib)
      if (.not. allocated(lib)) call run(case_text(), lib)
      if (.not. allocated(lib)) call file%open(result_path, lib)
      call good(error, lib)
      if (allocated(error)) return
      do k = 1, size(promised)
         call check(error, file%has(trim(promised(k))), 'missing: '//promised(k))
         if (allocated(error)) exit
      end do
      if (.not. allocated(error)) then
         call file%read('/preload/interface_force', force, lib)
         if (.not. allocated(lib)) call file%read('/preload/interface_1/pressure', pressure, lib)
         if (.not. allocated(lib)) call file%read('/transient/time', time, lib)
         if (.not. allocated(lib)) call file%read('/transient/sensor', sensor, lib)
         if (.not. allocated(lib)) call file%read('/linear_modes/frequency', frequency, lib)
         if (.not. allocated(lib)) call file%read('/transient/largest_balance_error', balance, lib)
         if (.not. allocated(lib)) call file%read('/transient/unconverged_steps', unconverged, lib)
         if (.not. allocated(lib)) call file%read('/setup/input', input, lib)
         if (.not. allocated(lib)) call file%read('/timing/stage', stages, lib)
         if (.not. allocated(lib)) call file%get_attribute('/', 'command line', command, lib)
         call good(error, lib)
      end if
      call file%close(lib)
      call clean_up()
      if (allocated(error)) return
      call check(error, all(abs(force - 2000.0_wp) < 1.0e-9_wp*force) .and. all(shape(pressure) == [8, 6]), 'preload')
      if (allocated(error)) return
      call check(error, any(stages == 'transient start') .and. any(stages == 'transient'), 'stages of the time integration')
      if (allocated(error)) return
      call check(error, time(1) == 0.0_wp .and. time(size(time)) >= 1.0e-4_wp .and. size(sensor, 2) == size(time) &
         & .and. size(sensor, 1) == 1, 'time series')
      if (allocated(error)) return
      call check(error, size(frequency) == 4 .and. all(frequency(2:) > frequency(:3)) .and. frequency(1) > 0.0_wp, &
         & 'linear modes')
      if (allocated(error)) return
      call check(error, balance < 3.0e-3_wp .and. unconverged == 0, 'balance error '//to_text(balance, 3))
      if (allocated(error)) return
      call check(error, maxval(abs(sensor - sensor(1, 1))) > 0.0_wp, 'nothing moves')
      if (allocated(error)) return
      call check(error, input == case_text() .and. len(command) > 0, 'input or command line')
   end subroutine test_run

   !> The coupling and what it was checked for are in the file; this pad has no room for the disc.
   subroutine test_scale_split(error)
      type(testing_error), allocatable, intent(out) :: error
      type(error_t), allocatable :: lib, ignored
      type(hdf5_file_t) :: file
      character(len=:), allocatable :: kind(:)
      real(wp) :: distance, radius

      call write_blocks(density, lib)
      if (.not. allocated(lib)) call run(case_text('nx = 8, ny = 6', "nx = 20, ny = 15, coupling = 'scale_split'"), lib)
      if (.not. allocated(lib)) call file%open(result_path, lib)
      if (.not. allocated(lib)) call file%read('/interface_1/coupling/kind', kind, lib)
      if (.not. allocated(lib)) call file%read('/interface_1/coupling/node_distance', distance, lib)
      if (.not. allocated(lib)) call file%read('/interface_1/coupling/disc_radius', radius, lib)
      call file%close(ignored)
      call clean_up()
      call good(error, lib)
      if (allocated(error)) return
      ! Elements of 15 mm x 13.3 mm
      call check(error, kind(1) == 'scale_split' .and. radius == 0.0_wp .and. abs(distance - sqrt(2.0e-4_wp)) < 1.0e-12_wp)
   end subroutine test_scale_split

   !> A hard blow on the closed points alone: others join, and the file has the set as it is at the end.
   subroutine test_points_added(error)
      type(testing_error), allocatable, intent(out) :: error
      type(error_t), allocatable :: lib
      type(hdf5_file_t) :: file
      character(len=:), allocatable :: text
      integer, allocatable :: potential(:, :), open(:), stick(:), slip(:)
      integer :: added, points, at

      text = changed(case_text('nx = 8, ny = 6 /', 'nx = 24, ny = 16, potential_margin = 1e-9 /'), &
         & [character(len=18) :: 'height = 1e-6', 'mode = 2', 'amplitude = 2000.0'], &
         & [character(len=18) :: 'height = 5e-6', 'mode = 1', 'amplitude = 1.0e6'])
      call write_blocks(density, lib)
      if (.not. allocated(lib)) call run(text, lib)
      if (.not. allocated(lib)) call file%open(result_path, lib)
      if (.not. allocated(lib)) call file%read('/transient/points_added', added, lib)
      if (.not. allocated(lib)) call file%read('/model/contact_points', points, lib)
      if (.not. allocated(lib)) call file%read('/interface_1/potential', potential, lib)
      if (.not. allocated(lib)) call file%read('/transient/contact/open', open, lib)
      if (.not. allocated(lib)) call file%read('/transient/contact/stick', stick, lib)
      if (.not. allocated(lib)) call file%read('/transient/contact/slip', slip, lib)
      call good(error, lib)
      call file%close(lib)
      call clean_up()
      if (allocated(error)) return
      call check(error, added > 0 .and. points < 24*16, 'not the scene that was meant: '//to_text(added)//' points joined, ' &
         & //to_text(points)//' in the set, '//to_text(minval(open))//' to '//to_text(maxval(open))//' open')
      if (allocated(error)) return
      at = size(open)
      call check(error, sum(potential) == points .and. open(at) + stick(at) + slip(at) == points, &
         & 'the set is not that of the end')
   end subroutine test_points_added

   subroutine test_check(error)
      type(testing_error), allocatable, intent(out) :: error
      type(error_t), allocatable :: lib
      logical :: there

      call write_blocks(density, lib)
      if (.not. allocated(lib)) call run(case_text('n_modes = 12', "n_modes = 12, cache = '"//cache_name//"'"), lib, &
         & check_only=.true.)
      there = is_there(result_path) .or. is_there(folder//cache_name) .or. is_there(case_name//'.h5')
      call clean_up()
      call good(error, lib)
      if (allocated(error)) return
      call check(error,.not. there, 'a file was written')
   end subroutine test_check

   subroutine test_bad_input(error)
      type(testing_error), allocatable, intent(out) :: error
      type(error_t), allocatable :: lib

      call write_blocks(density, lib)
      call good(error, lib)
      if (.not. allocated(error)) call expect(model_name, 'no_such_model.h5', 'no_such_model.h5')
      if (.not. allocated(error)) call expect("'upper_pad'", "'uper_pad'", case_path//": interface 'joint'")
      if (.not. allocated(error)) call expect("'top_face'", "'top_fase'", "'top_face'")
      if (.not. allocated(error)) call expect("'upper_xmax'", "'uper_xmax'", "'upper_xmax'")
      if (.not. allocated(error)) call expect('friction = 0.5', 'friction = NaN', 'friction')
      if (.not. allocated(error)) call expect('friction = 0.5', 'frction = 0.5', "'friction'")
      if (.not. allocated(error)) call expect("'top_face'", "'upper_zmax'", 'supported')
      if (.not. allocated(error)) call expect('mode = 2', 'mode = 7', 'mode')
      call clean_up()
      if (allocated(error)) return
      call run_missing()

   contains

      !> The change of the case is refused with a message that has the given words.
      subroutine expect(find, replacement, part)
         character(len=*), intent(in) :: find, replacement, part

         call run(case_text(find, replacement), lib)
         call check(error, allocated(lib), replacement//' was taken')
         if (allocated(error)) return
         call check(error, lib%status == status_bad_input .and. index(lib%message, part) > 0, lib%message)
         if (allocated(error)) return
         call check(error,.not. is_there(result_path), replacement//': a result file was written')
      end subroutine expect

      !> The case file itself is missing.
      subroutine run_missing()
         type(command_line_t) :: line

         line%cases = words(folder//'no_such_case.nml')
         line%quiet = .true.
         call run_cases(line, lib)
         call check(error, allocated(lib), 'a case that is not there was run')
         if (allocated(error)) return
         call check(error, lib%status == status_bad_input .and. index(lib%message, 'no_such_case.nml') > 0 &
            & .and. index(lib%message, nl) == 0, lib%message)
      end subroutine run_missing

   end subroutine test_bad_input

   !> A time step past the stability limit is found after the preload, whose results stay.
   subroutine test_failed_run(error)
      type(testing_error), allocatable, intent(out) :: error
      type(error_t), allocatable :: lib, reading
      type(hdf5_file_t) :: file
      real(wp), allocatable :: force(:), frequency(:), time(:)
      real(wp), parameter :: wanted = 2000.0_wp

      call write_blocks(density, lib)
      if (.not. allocated(lib)) call run(case_text('duration = 1e-4 /', 'duration = 1e-4, time_step = 1e-5 /'), lib)
      call file%open(result_path, reading)
      if (.not. allocated(reading)) call file%read('/preload/interface_force', force, reading)
      if (.not. allocated(reading)) call file%read('/linear_modes/frequency', frequency, reading)
      if (.not. allocated(reading)) call file%read('/transient/time', time, reading)
      call good(error, reading)
      call file%close(reading)
      call clean_up()
      if (allocated(error)) return
      call check(error, allocated(lib), 'the time step was taken')
      if (allocated(error)) return
      call check(error, lib%status == status_failed .and. index(lib%message, 'stability limit') > 0, lib%message)
      if (allocated(error)) return
      call check(error, abs(force(1) - wanted) < 1.0e-9_wp*wanted .and. size(frequency) == 4 .and. size(time) == 0, &
         & 'results before the failure are not kept')
   end subroutine test_failed_run

   !> Mass-proportional damping set on the mode about the preload: viscous loss over twice the integral of the
   !> kinetic energy is beta = 2 ratio omega of that mode, and not of the tied one.
   subroutine test_damping_reference(error)
      type(testing_error), allocatable, intent(out) :: error
      type(error_t), allocatable :: lib, ignored
      type(hdf5_file_t) :: file
      real(wp), allocatable :: frequency(:), tied(:), time(:), kinetic(:), loss(:)
      real(wp) :: beta
      integer :: n

      call write_blocks(density, lib)
      if (.not. allocated(lib)) call run(case_text('modal_ratio = 0.01', &
         & "ratio = 0.01, reference_mode = 2, reference = 'preloaded'"), lib)
      if (.not. allocated(lib)) call file%open(result_path, lib)
      if (.not. allocated(lib)) call file%read('/linear_modes/frequency', frequency, lib)
      if (.not. allocated(lib)) call file%read('/model/tied_frequency', tied, lib)
      if (.not. allocated(lib)) call file%read('/transient/time', time, lib)
      if (.not. allocated(lib)) call file%read('/transient/energy/kinetic', kinetic, lib)
      if (.not. allocated(lib)) call file%read('/transient/energy/viscous_loss', loss, lib)
      call file%close(ignored)
      call good(error, lib)
      call clean_up()
      if (allocated(error)) return
      n = size(time)
      beta = loss(n)/sum((kinetic(2:) + kinetic(:n - 1))*(time(2:) - time(:n - 1)))
      call check(error, abs(beta/(0.04_wp*pi*frequency(2)) - 1.0_wp) < 0.01_wp, 'beta is not that of the preloaded mode')
      if (allocated(error)) return
      call check(error, abs(tied(2)/frequency(2) - 1.0_wp) > 0.02_wp, 'the scene cannot tell both modes apart')
   end subroutine test_damping_reference

   !> The reduction is computed, then taken from the cache with the same numbers; another model is computed anew.
   subroutine test_cache(error)
      type(testing_error), allocatable, intent(out) :: error
      real(wp), allocatable :: first(:, :), again(:, :), other(:, :)
      integer :: solves(3)

      call run_cached(density, first, solves(1))
      if (.not. allocated(error)) call run_cached(density, again, solves(2))
      if (.not. allocated(error)) call run_cached(1.01_wp*density, other, solves(3))
      call clean_up()
      if (allocated(error)) return
      call check(error, solves(1) > 0 .and. solves(2) == 0 .and. solves(3) > 0, 'the cache was not used as it should')
      if (allocated(error)) return
      call check(error, all(shape(first) == shape(again)), 'another number of steps')
      if (allocated(error)) return
      call check(error, all(first == again), 'the cached reduction gives other numbers')
      if (allocated(error)) return
      call check(error, any(abs(other(:, :20) - first(:, :20)) > 0.0_wp), 'another density, the same motion')

   contains

      !> Sensor and solves of the reduction.
      subroutine run_cached(steel_density, sensor, solves)
         real(wp), intent(in) :: steel_density
         real(wp), allocatable, intent(out) :: sensor(:, :)
         integer, intent(out) :: solves
         type(error_t), allocatable :: lib, ignored
         type(hdf5_file_t) :: file

         solves = -1
         call write_blocks(steel_density, lib)
         if (.not. allocated(lib)) call run(case_text('n_modes = 12', "n_modes = 12, cache = '"//cache_name//"'"), lib)
         if (.not. allocated(lib)) call file%open(result_path, lib)
         if (.not. allocated(lib)) call file%read('/transient/sensor', sensor, lib)
         if (.not. allocated(lib)) call file%read('/model/reduction/solves', solves, lib)
         call file%close(ignored)
         call good(error, lib)
      end subroutine run_cached

   end subroutine test_cache

   subroutine test_write_model(error)
      type(testing_error), allocatable, intent(out) :: error
      type(error_t), allocatable :: lib
      type(command_line_t) :: line
      type(fe_model_t) :: model, written
      logical :: there

      call write_blocks(density, lib)
      call write_text(case_path, case_text())
      line%cases = words(case_path)
      line%quiet = .true.
      line%write_model = result_path
      if (.not. allocated(lib)) call run_cases(line, lib)
      if (.not. allocated(lib)) call read_model_hdf5(model_path, model, lib)
      if (.not. allocated(lib)) call read_model_hdf5(result_path, written, lib)
      there = is_there(case_name//'.h5')
      call clean_up()
      call good(error, lib)
      if (allocated(error)) return
      call check(error, all(written%stiffness%value == model%stiffness%value) .and. all(written%mass%value &
         & == model%mass%value) .and. size(written%node_sets) == size(model%node_sets) .and. .not. there, &
         & 'not the model, or more than the model was written')
   end subroutine test_write_model

   !> Results go to the case's name in the current folder; the status is the worst one.
   subroutine test_two_cases(error)
      type(testing_error), allocatable, intent(out) :: error
      type(error_t), allocatable :: lib
      type(command_line_t) :: line
      logical :: there

      call write_blocks(density, lib)
      call good(error, lib)
      if (allocated(error)) return
      call write_text(case_path, case_text())
      line%cases = words(folder//'no_such_case.nml '//case_path//' '//folder//'no_other_case.nml')
      line%quiet = .true.
      call run_cases(line, lib)
      there = is_there(case_name//'.h5')
      call remove(case_name//'.h5')
      call clean_up()
      call check(error, there, 'the case after the wrong one was not run')
      if (allocated(error)) return
      call check(error, allocated(lib), 'no error')
      if (allocated(error)) return
      call check(error, lib%status == status_bad_input .and. index(lib%message, 'no_such_case.nml') > 0 &
         & .and. index(lib%message, 'no_other_case.nml') > 0, lib%message)
   end subroutine test_two_cases

end module test_cli
