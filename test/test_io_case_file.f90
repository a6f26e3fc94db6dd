!> A case file becomes a case, and a case becomes namelist text that gives the same case again.
module test_io_case_file
   use microslip_core_error, only: error_t, status_bad_input
   use microslip_core_kinds, only: wp
   use microslip_io_case, only: case_t
   use microslip_io_case_file, only: read_case, case_from_text, resolved_text
   use test_io_case_faults, only: beam_case
   use testdrive, only: new_unittest, unittest_type, error_type, check, test_failed
   implicit none(type, external)
   private

   public :: collect_io_case_file

   character(len=*), parameter :: nl = new_line('a')

contains

   subroutine collect_io_case_file(testsuite)
      type(unittest_type), allocatable, intent(out) :: testsuite(:)

      testsuite = [ &
         new_unittest('values', test_values), &
         new_unittest('defaults', test_defaults), &
         new_unittest('every_option', test_every_option), &
         new_unittest('round_trip', test_round_trip), &
         new_unittest('modal_parameters', test_modal_parameters), &
         new_unittest('periodic_motions', test_periodic_motions), &
         new_unittest('native_read', test_native_read), &
         new_unittest('ground', test_ground), &
         new_unittest('file', test_file)]
   end subroutine collect_io_case_file

   !> A case with the options that `beam_case` does not use.
   function other_case() result(text)
      character(len=:), allocatable :: text
      text = "! a comment with 'quotes' & / signs"//nl// &
         "&Case title = ""it's 'quoted' / & ! ""  analyses = 'PRELOAD' 'transient' /"//nl// &
         "&model source = 'calculix', file = 'sub/beam', mesh_file = 'beam.inp', unit_length = 'mm',"//nl// &
         "   unit_mass = 't' ! tonnes"//nl//"/"//nl// &
         "&interface plane_point = 3*0.0, plane_normal = 0, 0, 1, region = -1, 1, -1, 1, -1, 1, axis_1 = 1, 0, 0"//nl// &
         "   friction = 0.3, young_modulus = 2.1d11, 0.7d11, poisson_ratio(2) = 0.33, poisson_ratio(1) = 0.3"//nl// &
         "   nx = 20, ny = 10, extent = -1, 1, -0.1, 0.1, holes(:,1) = 0, 0, 0.1, holes(:,2) = 0.5, 0, 0.1"//nl// &
         "   topography = 'SCAN', potential_margin = 1e-6 /"//nl// &
         "&interface side_a = 'a' side_b = 'Ground' friction = 0 young_modulus = 1e11 poisson_ratio = 0.3"//nl// &
         "   nx = 1 ny = 1 topography = 'smooth' potential = 'all' &end"//nl// &
         "&topography name = 'smooth' source = 'hill' height = 1e-6 center = 0.1, 0 level = 'mean' /"//nl// &
         "&topography name = 'scan' source = 'file' file = 'scan.h5' z_name = 'gap' unit_length = 'um' sense = 'gap'"//nl// &
         "   level = 'plane' filter_wavelength = 1e-3 offset = 1e-3, 0 rotation = 90 scale = 0.5 /"//nl// &
         "&reduction method = 'macneal' cutoff_frequency = 5000 cache = 'beam.cache' /"//nl// &
         "&damping modal_ratio = 1e-3, 2e-3 /"//nl// &
         "&contact solver = 'jacobi' tolerance = 1e-8 max_iterations = 50 normal_law = 'velocity' /"//nl// &
         "&load node_set = 'up', 'down' direction(:,1) = 0, 0, 1 direction(3,2) = -1 direction(1:2,2) = 2*0"//nl// &
         "   size = 2*0.1 distribution = 'area', 'uniform' /"//nl// &
         "&preload loads = 'load_1' load_scale = 2.5 steps = 3 /"//nl// &
         "&transient duration = 0.3333333333333333 time_step = 1e-5 /"//nl// &
         "&excitation load = 'load_1' kind = 'harmonic' amplitude = 3 start = 0.1 frequency = 210 phase = -90 /"//nl// &
         "&output file = 'out.h5' sensors = 's1' 's2' sensor_direction(:,1) = 1, 0, 0 sensor_direction(:,2) = 0, 1, 0"//nl// &
         "   stride = 4 snapshots = 0.1 /"//nl
   end function other_case

   subroutine test_values(error)
      type(error_type), allocatable, intent(out) :: error
      type(case_t) :: input

      call valid_case(error, beam_case(), input)
      if (allocated(error)) return
      call check(error, size(input%interfaces), 2)
      if (allocated(error)) return
      call check(error, trim(input%title) == 'beam' .and. all(input%analyses == [character(len=12) :: &
         'preload', 'linear_modes', 'transient']) .and. trim(input%model%file) == 'beam.h5')
      if (allocated(error)) return
      call check(error, input%interfaces(2)%friction, 0.5_wp)
      if (allocated(error)) return
      call check(error, all(same(input%interfaces(1)%young_modulus, [194.0e9_wp, 194.0e9_wp])), 'second as first')
      if (allocated(error)) return
      call check(error, input%reduction%n_modes == 30 .and. .not. allocated(input%reduction%cutoff_frequency))
      if (allocated(error)) return
      call check(error, all(same(input%loads(1)%direction(3, :), [1.0_wp, -1.0_wp])))
      if (allocated(error)) return
      call check(error, input%find_load('BOLT RIGHT') == 2 .and. input%find_load('') == 0 .and. input%loads(3)%mode == 1)
      if (allocated(error)) return
      call check(error, all(same(input%preload%interface_force, [2210.0_wp, 2210.0_wp])) &
         .and. .not. allocated(input%preload%load_scale))
      if (allocated(error)) return
      call check(error, input%located('beam.h5') == 'cases/beam.h5' .and. input%located('/beam.h5') == '/beam.h5')
   end subroutine test_values

   subroutine test_defaults(error)
      type(error_type), allocatable, intent(out) :: error
      type(case_t) :: input

      call valid_case(error, beam_case(), input)
      if (allocated(error)) return
      call check(error, all(input%interfaces%topography == 'hill'), 'the only topography is the default')
      if (allocated(error)) return
      call check(error, all(input%loads(1)%distribution == 'uniform') .and. size(input%loads(1)%distribution) == 2)
      if (allocated(error)) return
      call check(error, all(same(input%output%sensor_direction(:, 1), [0.0_wp, 0.0_wp, 1.0_wp])))
      if (allocated(error)) return
      call check(error, same(input%transient%safety, 0.74_wp) .and. .not. allocated(input%transient%time_step))
      if (allocated(error)) return
      call check(error, input%linear_modes%n_modes == 10 .and. input%preload%steps == 1 .and. input%contact%solver == 'condensed')
   end subroutine test_defaults

   subroutine test_every_option(error)
      type(error_type), allocatable, intent(out) :: error
      type(case_t) :: input

      call valid_case(error, other_case(), input)
      if (allocated(error)) return
      call check(error, trim(input%title), "it's 'quoted' / & !")
      if (allocated(error)) return
      call check(error, all(same(input%interfaces(1)%poisson_ratio, [0.3_wp, 0.33_wp])), 'elements in any order')
      if (allocated(error)) return
      call check(error, all(same(input%interfaces(1)%holes(:, 2), [0.5_wp, 0.0_wp, 0.1_wp])), 'table by columns')
      if (allocated(error)) return
      call check(error, all(same(input%loads(1)%direction(:, 2), [0.0_wp, 0.0_wp, -1.0_wp])), 'part of a column')
      if (allocated(error)) return
      call check(error, input%find_topography(input%interfaces(1)%topography), 2, 'names in any case')
      if (allocated(error)) return
      call check(error, trim(input%interfaces(1)%name), 'interface_1')
      if (allocated(error)) return
      call check(error, input%runs('preload') .and. .not. input%runs('linear_modes'))
   end subroutine test_every_option

   !> The resolved text of a case gives the same case, shown by its own resolved text.
   subroutine test_round_trip(error)
      type(error_type), allocatable, intent(out) :: error
      type(case_t) :: input, again
      character(len=:), allocatable :: text

      call valid_case(error, beam_case(), input)
      if (allocated(error)) return
      text = resolved_text(input)
      call valid_case(error, text, again)
      if (allocated(error)) return
      call check(error, resolved_text(again), text)
      if (allocated(error)) return
      call check(error, index(text, 'tolerance = 1.0') > 0 .and. index(text, 'safety = 0.74') > 0, 'defaults are shown'//text)
      if (allocated(error)) return

      call valid_case(error, other_case(), input)
      if (allocated(error)) return
      text = resolved_text(input)
      call valid_case(error, text, again)
      if (allocated(error)) return
      call check(error, resolved_text(again), text)
      if (allocated(error)) return
      call check(error, same(again%transient%duration, 0.3333333333333333_wp), 'to the last digit')
      if (allocated(error)) return
      call check(error, all(same(again%interfaces(1)%holes, input%interfaces(1)%holes)))
      if (allocated(error)) return
      call check(error, trim(again%title), trim(input%title))
   end subroutine test_round_trip

   !> `&qsma` and `&ringdown`: defaults, every key, and the same again from the resolved text.
   subroutine test_modal_parameters(error)
      type(error_type), allocatable, intent(out) :: error
      type(case_t) :: input, again
      character(len=:), allocatable :: text
      integer :: at

      text = beam_case()
      at = index(text, "'transient' /")
      text = text(:at - 1)//"'qsma', 'transient', 'ringdown' /"//nl//"&qsma largest_amplitude = 1e-4 /"//nl//"&ringdown /"// &
         text(at + len("'transient' /"):)
      call valid_case(error, text, input)
      if (allocated(error)) return
      call check(error, input%qsma%mode == 1 .and. input%qsma%levels == 20 .and. .not. allocated(input%qsma%cycle) .and. &
         .not. allocated(input%ringdown%mode) .and. same(input%ringdown%periods, 10.0_wp) .and. &
         all(input%find_sensors(input%qsma%sensor) == [1]), 'defaults')
      if (allocated(error)) return
      at = index(text, "&qsma")
      text = text(:at - 1)//"&qsma mode = 2, amplitudes = 1e-6, 1e-5, sensor = 'MIDDLE', steps = 3, cycle = .TRUE., "// &
         "cycle_steps = 7 /"//nl//"&ringdown mode = 2, sensor = 'middle', periods = 5.5, overlap = 0.0, start = 0.01 /"// &
         text(index(text, "&ringdown /") + len("&ringdown /"):)
      call valid_case(error, text, input)
      if (allocated(error)) return
      call valid_case(error, resolved_text(input), again)
      if (allocated(error)) return
      call check(error, resolved_text(again), resolved_text(input))
      if (allocated(error)) return
      call check(error, again%qsma%mode == 2 .and. all(same(again%qsma%amplitudes, [1.0e-6_wp, 1.0e-5_wp])) .and. &
         again%qsma%steps == 3 .and. again%qsma%cycle .and. again%qsma%cycle_steps == 7 .and. again%ringdown%mode == 2 .and. &
         same(again%ringdown%periods, 5.5_wp) .and. same(again%ringdown%start, 0.01_wp), 'every key')
   end subroutine test_modal_parameters

   !> `&harmonic_balance` and `&epmc`: every key, and the same again from the resolved text.
   subroutine test_periodic_motions(error)
      type(error_type), allocatable, intent(out) :: error
      type(case_t) :: input, again
      character(len=:), allocatable :: text
      integer :: at

      text = beam_case()
      at = index(text, "'transient' /")
      text = text(:at - 1)//"'transient', 'harmonic_balance', 'epmc' /"//nl// &
         "&harmonic_balance load = 'IMPACT', sensor = 'middle', levels = 0.1, 2*1.5, frequency_range = 210.0, 190.0"//nl// &
         "   harmonics = 7, samples = 64, frequency_step = 0.5, response_step = 0.1, tolerance = 1e-7, max_points = 9 /"//nl// &
         "&epmc amplitude_range = 1e-6, 1e-4 /"//text(at + len("'transient' /"):)
      call valid_case(error, text, input)
      if (allocated(error)) return
      call valid_case(error, resolved_text(input), again)
      if (allocated(error)) return
      call check(error, resolved_text(again), resolved_text(input))
      if (allocated(error)) return
      associate (hb => again%harmonic_balance)
         call check(error, all(same(hb%levels, [0.1_wp, 1.5_wp, 1.5_wp])) .and. all(same(hb%frequency_range, &
            [210.0_wp, 190.0_wp])) .and. hb%harmonics == 7 .and. hb%samples == 64 .and. same(hb%frequency_step, 0.5_wp) .and. &
            same(hb%response_step, 0.1_wp) .and. same(hb%tolerance, 1.0e-7_wp) .and. hb%max_points == 9 .and. &
            again%find_load(hb%load) == 3, 'every key')
      end associate
      if (allocated(error)) return
      associate (epmc => again%epmc)
         call check(error, epmc%mode == 1 .and. epmc%points == 20 .and. epmc%harmonics == 5 .and. epmc%samples == 50 .and. &
            all(same(epmc%amplitude_range, [1.0e-6_wp, 1.0e-4_wp])) .and. same(epmc%tolerance, 1.0e-8_wp), 'defaults')
      end associate
   end subroutine test_periodic_motions

   !> The compiler's own namelist read understands the resolved text and finds the same values.
   subroutine test_native_read(error)
      type(error_type), allocatable, intent(out) :: error
      type(case_t) :: input
      character(len=120) :: title, analyses(3), node_set(8), distribution(8), name, kind
      real(wp) :: direction(3, 8), size(8)
      character(len=:), allocatable :: text
      character(len=200) :: reason
      integer :: unit, status
      namelist /case/ title, analyses
      namelist /load/ name, kind, node_set, direction, size, distribution

      call valid_case(error, other_case(), input)
      if (allocated(error)) return
      text = resolved_text(input)
      reason = ''
      open (newunit=unit, status='scratch', action='readwrite')
      write (unit, '(a)') text
      rewind (unit)
      read (unit, nml=case, iostat=status, iomsg=reason)
      if (status == 0) read (unit, nml=load, iostat=status, iomsg=reason)
      close (unit)
      call check(error, status, 0, trim(reason)//nl//text)
      if (allocated(error)) return
      call check(error, title == input%title .and. all(analyses(:2) == input%analyses))
      if (allocated(error)) return
      call check(error, all(node_set(:2) == input%loads(1)%node_set) .and. all(distribution(:2) == input%loads(1)%distribution))
      if (allocated(error)) return
      call check(error, all(same(direction(:, :2), input%loads(1)%direction)) .and. all(same(size(:2), input%loads(1)%size)))
   end subroutine test_native_read

   !> One elastic constant: rigid ground; two: elastic ground.
   subroutine test_ground(error)
      type(error_type), allocatable, intent(out) :: error
      type(case_t) :: input

      call valid_case(error, other_case(), input)
      if (allocated(error)) return
      call check(error, size(input%interfaces(2)%young_modulus) == 1 .and. input%interfaces(2)%side_b == 'ground')
   end subroutine test_ground

   !> From a file with Windows line ends and a byte order mark; a missing file is a bad input.
   subroutine test_file(error)
      type(error_type), allocatable, intent(out) :: error
      type(case_t) :: input
      type(error_t), allocatable :: fault
      character(len=*), parameter :: path = 'test_io_case_file.nml'
      character(len=:), allocatable :: source, text
      integer :: unit, k

      text = char(239)//char(187)//char(191)
      source = beam_case()
      do k = 1, len(source)
         if (source(k:k) == nl) text = text//achar(13)
         text = text//source(k:k)
      end do
      open (newunit=unit, file=path, access='stream', form='unformatted', status='replace')
      write (unit) text
      close (unit)
      call read_case(path, input, fault)
      open (newunit=unit, file=path)
      close (unit, status='delete')
      if (allocated(fault)) then
         call test_failed(error, fault%message)
         return
      end if
      call check(error, size(input%loads), 3)
      if (allocated(error)) return
      call check(error, input%located('beam.h5'), 'beam.h5')
      if (allocated(error)) return
      call read_case('no_such_case.nml', input, fault)
      call check(error, allocated(fault))
      if (allocated(error)) return
      call check(error, fault%status == status_bad_input .and. index(fault%message, 'no_such_case.nml') == 1)
   end subroutine test_file

   !> Read a case that is expected to be valid.
   subroutine valid_case(error, text, input)
      type(error_type), allocatable, intent(out) :: error
      character(len=*), intent(in) :: text
      type(case_t), intent(out) :: input
      type(error_t), allocatable :: fault

      call case_from_text(text, 'cases/beam.nml', input, fault)
      if (allocated(fault)) call test_failed(error, fault%message)
   end subroutine valid_case

   !> Equal to the last bit: what is read is a decimal number, not a computed one.
   elemental logical function same(a, b)
      real(wp), intent(in) :: a, b
      same = abs(a - b) <= 0.0_wp
   end function same

end module test_io_case_file
