!> Tests of the result file: a made-up joint is preloaded, shaken and written; what is in the file is what was computed.
module test_io_results
   use, intrinsic :: ieee_arithmetic, only: ieee_is_nan
   use microslip_analysis_excitation, only: excitation_t, kind_half_sine
   use microslip_analysis_linear_modes, only: linear_modes_t, solve_linear_modes
   use microslip_analysis_operating_state, only: operating_state_t
   use microslip_analysis_preload, only: preload_record_t
   use microslip_analysis_transient, only: run_transient, sample_t, transient_options_t, transient_record_t
   use microslip_contact_factory, only: contact_options_t
   use microslip_core_error, only: error_t, status_bad_input
   use microslip_core_kinds, only: wp
   use microslip_core_stopwatch, only: stopwatch_t
   use microslip_fe_reduced_model, only: reduced_model_t
   use microslip_io_hdf5, only: hdf5_file_t
   use microslip_io_results, only: results_t
   use microslip_io_transient_results, only: transient_results_t
   use microslip_system_jointed_system, only: jointed_system_t
   use support_joint, only: load_names, make_joint, preload_joint, sensor_names
   use support_checks, only: good, remove
   use testdrive, only: check, new_unittest, test_failed, testing_error => error_type, unittest_type
   implicit none(type, external)
   private

   public :: collect_io_results

   !> File of these tests, removed by each.
   character(len=*), parameter :: scratch = 'build/test_io_results.h5'
   integer, parameter :: nx = 20, ny = 12
   real(wp), parameter :: hill = 8.0e-6_wp, dt = 4.0e-5_wp
   integer, parameter :: n_steps = 300, n_snapshots = 2
   !> Sums over some hundred rounded numbers.
   real(wp), parameter :: rounding = 1.0e4_wp*epsilon(1.0_wp)
   character(len=*), parameter :: maps(5) = ['pressure  ', 'traction_1', 'traction_2', 'gap       ', 'slip_ratio']

contains

   subroutine collect_io_results(testsuite)
      type(unittest_type), allocatable, intent(out) :: testsuite(:)

      testsuite = [ &
         & new_unittest('provenance, setup and timing', test_provenance), &
         & new_unittest('model and interfaces', test_model), &
         & new_unittest('preload maps add up', test_preload), &
         & new_unittest('time series and snapshots', test_transient), &
         & new_unittest('samples are in the file after a failure', test_failed_run), &
         & new_unittest('all datasets have units and description', test_attributes), &
         & new_unittest('a file is replaced as a whole', test_publish), &
         & new_unittest('a missing folder is an error', test_missing_folder)]
   end subroutine collect_io_results

   !> Write everything there is into the scratch file.
   subroutine write_all(system, state, preload, record, lib)
      type(jointed_system_t), intent(out) :: system
      type(operating_state_t), intent(out) :: state
      type(preload_record_t), intent(out) :: preload
      type(transient_record_t), intent(out) :: record
      type(error_t), allocatable, intent(out) :: lib
      type(reduced_model_t) :: reduced
      type(results_t), target :: results
      type(transient_results_t) :: recorder
      type(transient_options_t) :: options
      type(linear_modes_t) :: modes
      type(contact_options_t) :: contact
      type(stopwatch_t) :: clock

      contact%solver = 'condensed'
      call make_joint(nx, ny, hill, reduced, system, lib)
      if (.not. allocated(lib)) call preload_joint(system, contact, state, preload, lib)
      if (.not. allocated(lib)) call solve_linear_modes(system, state%contact%status, 3, modes, lib)
      if (.not. allocated(lib)) call results%create(scratch, lib)
      if (.not. allocated(lib)) call results%write_provenance('0.1.0', '', 'microslip case.nml', 2, lib)
      if (.not. allocated(lib)) call results%write_setup('&case /', '&case title = "" /', lib)
      if (.not. allocated(lib)) call results%write_model(system, reduced, lib)
      if (.not. allocated(lib)) call results%write_interfaces(system, lib)
      if (.not. allocated(lib)) call results%write_preload(system, state, preload, load_names, lib)
      if (.not. allocated(lib)) call results%write_linear_modes(modes, lib)
      if (.not. allocated(lib)) call recorder%create(results, system, sensor_names, lib)
      if (allocated(lib)) return
      options = transient_options_t(duration=n_steps*dt, time_step=dt, snapshots=[0.5_wp, 1.0_wp]*n_steps*dt, &
         & excitations=[excitation_t(load=3, kind=kind_half_sine, amplitude=400.0_wp, duration=5.0e-4_wp)])
      call clock%start()
      call run_transient(system, state, options, contact, recorder, clock, record, lib)
      if (.not. allocated(lib)) call recorder%write_summary(record, lib)
      if (.not. allocated(lib)) call recorder%close(lib)
      if (.not. allocated(lib)) call results%write_interfaces(system, lib)
      if (.not. allocated(lib)) call results%write_timing(['preload  ', 'transient'], [0.5_wp, 2.0_wp], [1, n_steps], lib)
      if (.not. allocated(lib)) call results%close(lib)
   end subroutine write_all

   subroutine test_provenance(error)
      type(testing_error), allocatable, intent(out) :: error
      type(results_t) :: results
      type(hdf5_file_t) :: file
      type(error_t), allocatable :: lib
      character(len=:), allocatable :: program, commit, compiler, call_line, date, host, input, resolved, stages(:)
      real(wp), allocatable :: seconds(:)
      integer :: threads, version

      call results%create(scratch, lib)
      if (.not. allocated(lib)) call results%write_provenance('0.1.0', '', 'microslip --quiet case.nml', 2, lib)
      if (.not. allocated(lib)) call results%write_setup('&case'//new_line('a')//'/', 'resolved', lib)
      if (.not. allocated(lib)) call results%write_timing(['one  ', 'three'], [1.0_wp, 3.0_wp], [1, 3], lib)
      if (.not. allocated(lib)) call results%close(lib)
      if (.not. allocated(lib)) call file%open(scratch, lib)
      if (.not. allocated(lib)) call file%get_attribute('/', 'program', program, lib)
      if (.not. allocated(lib)) call file%get_attribute('/', 'format_version', version, lib)
      if (.not. allocated(lib)) call file%get_attribute('/', 'commit', commit, lib)
      if (.not. allocated(lib)) call file%get_attribute('/', 'compiler', compiler, lib)
      if (.not. allocated(lib)) call file%get_attribute('/', 'command line', call_line, lib)
      if (.not. allocated(lib)) call file%get_attribute('/', 'date', date, lib)
      if (.not. allocated(lib)) call file%get_attribute('/', 'host', host, lib)
      if (.not. allocated(lib)) call file%get_attribute('/', 'threads', threads, lib)
      if (.not. allocated(lib)) call file%read('/setup/input', input, lib)
      if (.not. allocated(lib)) call file%read('/setup/resolved', resolved, lib)
      if (.not. allocated(lib)) call file%read('/timing/stage', stages, lib)
      if (.not. allocated(lib)) call file%read('/timing/seconds', seconds, lib)
      call good(error, lib)
      if (allocated(error)) return
      call check(error, program == 'microslip' .and. commit == 'unknown' .and. threads == 2 .and. version >= 1 &
         & .and. call_line == 'microslip --quiet case.nml', 'wrong program, commit, version or command line')
      if (allocated(error)) return
      call check(error, index(compiler, 'GCC') > 0 .and. len(host) > 0, 'no compiler or host')
      if (allocated(error)) return
      call check(error, len(date) == 20 .and. date(5:5)//date(8:8)//date(11:11)//date(20:20) == '--TZ' &
         & .and. date(:2) == '20', 'not an ISO 8601 date: '//date)
      if (allocated(error)) return
      call check(error, input == '&case'//new_line('a')//'/' .and. resolved == 'resolved', 'the setup differs')
      if (allocated(error)) return
      call check(error, size(stages) == 2 .and. stages(2) == 'three' .and. seconds(2) == 3.0_wp, 'the timing differs')
      call file%close(lib)
      call remove(scratch)
   end subroutine test_provenance

   subroutine test_model(error)
      type(testing_error), allocatable, intent(out) :: error
      type(jointed_system_t) :: system
      type(operating_state_t) :: state
      type(preload_record_t) :: preload
      type(transient_record_t) :: record
      type(hdf5_file_t) :: file
      type(error_t), allocatable :: lib
      real(wp), allocatable :: x(:), height(:, :), tied(:), linear(:), alpha(:, :)
      integer, allocatable :: potential(:, :)
      integer :: points, k, total

      call write_all(system, state, preload, record, lib)
      if (.not. allocated(lib)) call file%open(scratch, lib)
      if (.not. allocated(lib)) call file%read('/model/contact_points', points, lib)
      if (.not. allocated(lib)) call file%read('/model/tied_frequency', tied, lib)
      if (.not. allocated(lib)) call file%read('/model/modal_participation', alpha, lib)
      if (.not. allocated(lib)) call file%read('/linear_modes/frequency', linear, lib)
      call good(error, lib)
      if (allocated(error)) return
      call check(error, all(tied == system%frequency) .and. size(linear) == 3 .and. all(linear > 0.0_wp) &
         & .and. size(alpha, 2) == system%n_modes, 'the modes differ')
      if (allocated(error)) return
      total = 0
      do k = 1, 2
         associate (grid => system%pads(k)%grid, group => merge('/interface_1', '/interface_2', k == 1))
            call file%read(group//'/x', x, lib)
            if (.not. allocated(lib)) call file%read(group//'/height', height, lib)
            if (.not. allocated(lib)) call file%read(group//'/potential', potential, lib)
            call good(error, lib)
            if (allocated(error)) return
            call check(error, all(x == grid%x) .and. all(grid%from_map(height) == system%pads(k)%height), &
               & 'grid or heights differ')
            if (allocated(error)) return
            call check(error, all(ieee_is_nan(height) .neqv. grid%inside), 'cells outside are not NaN')
            if (allocated(error)) return
            call check(error, file%has_attribute(group//'/height', 'DIMENSION_LIST') &
               & .and. file%has_attribute(group//'/potential', 'DIMENSION_LIST'), 'maps have no axes')
            if (allocated(error)) return
            total = total + sum(potential)
         end associate
      end do
      call check(error, total == system%problem%n_points .and. points <= total, 'the potential contact set differs')
      call file%close(lib)
      call remove(scratch)
   end subroutine test_model

   !> Pressure times area is the interface force, friction stays in the cone, left-out points have a gap.
   subroutine test_preload(error)
      type(testing_error), allocatable, intent(out) :: error
      type(jointed_system_t) :: system
      type(operating_state_t) :: state
      type(preload_record_t) :: preload
      type(transient_record_t) :: record
      type(hdf5_file_t) :: file
      type(error_t), allocatable :: lib
      real(wp), allocatable :: pressure(:, :), gap(:, :), ratio(:, :), t1(:, :), force(:), amplitude(:)
      character(len=:), allocatable :: names(:), group
      real(wp) :: tolerance
      integer :: k

      call write_all(system, state, preload, record, lib)
      if (.not. allocated(lib)) call file%open(scratch, lib)
      if (.not. allocated(lib)) call file%read('/preload/interface_force', force, lib)
      if (.not. allocated(lib)) call file%read('/preload/load_amplitude', amplitude, lib)
      if (.not. allocated(lib)) call file%read('/preload/load_name', names, lib)
      call good(error, lib)
      if (allocated(error)) return
      call check(error, all(force == preload%interface_force) .and. all(amplitude == state%amplitude) &
         & .and. all(names == load_names), 'forces, amplitudes or names differ')
      if (allocated(error)) return
      do k = 1, 2
         group = merge('/preload/interface_1/', '/preload/interface_2/', k == 1)
         call file%read(group//'pressure', pressure, lib)
         if (.not. allocated(lib)) call file%read(group//'traction_1', t1, lib)
         if (.not. allocated(lib)) call file%read(group//'gap', gap, lib)
         if (.not. allocated(lib)) call file%read(group//'slip_ratio', ratio, lib)
         call good(error, lib)
         if (allocated(error)) return
         associate (grid => system%pads(k)%grid)
            call check(error, sum(grid%from_map(pressure))*grid%cell_area(), force(k), rel=.true., thr=rounding)
            if (allocated(error)) return
            call check(error, all(ieee_is_nan(pressure) .neqv. grid%inside), 'cells outside are not NaN')
            if (allocated(error)) return
            where (.not. grid%inside)
               pressure = 0.0_wp
               gap = 0.0_wp
               t1 = 0.0_wp
            end where
            call check(error, all(ieee_is_nan(ratio) .eqv. .not. pressure > 0.0_wp), 'slip ratio missing, or without a pressure')
            if (allocated(error)) return
            where (ieee_is_nan(ratio)) ratio = 0.0_wp
            call check(error, all(ratio <= 1 + rounding), 'slip ratio beyond the friction cone')
            if (allocated(error)) return
            ! The wanted accuracy of the contact forces, as a displacement.
            tolerance = 1.0e-8_wp*hill
            call check(error, .not. any(gap < -tolerance) .and. .not. any(pressure > 0.0_wp .and. gap > tolerance), &
               & 'pressure and gap are not complementary')
            if (allocated(error)) return
            call check(error, any(gap > 0.1_wp*hill) .and. any(pressure > 0.0_wp) .and. any(abs(t1) > 0.0_wp), &
               & 'nothing closed, nothing open or no friction: the scene tests little')
            if (allocated(error)) return
            call check(error, size(system%pads(k)%potential) < grid%point_count(), 'no point is left out')
            if (allocated(error)) return
         end associate
      end do
      call file%close(lib)
      call remove(scratch)
   end subroutine test_preload

   subroutine test_transient(error)
      type(testing_error), allocatable, intent(out) :: error
      type(jointed_system_t) :: system
      type(operating_state_t) :: state
      type(preload_record_t) :: preload
      type(transient_record_t) :: record
      type(hdf5_file_t) :: file
      type(error_t), allocatable :: lib
      real(wp), allocatable :: time(:), sensor(:, :), modal(:, :), kinetic(:), elastic(:), work(:), viscous(:), &
         & friction(:), balance(:), instants(:), pressure(:, :, :)
      integer, allocatable :: stick(:), slip(:), open(:), converged(:)
      integer :: k, steps

      call write_all(system, state, preload, record, lib)
      if (.not. allocated(lib)) call file%open(scratch, lib)
      if (.not. allocated(lib)) call file%read('/transient/time', time, lib)
      if (.not. allocated(lib)) call file%read('/transient/sensor', sensor, lib)
      if (.not. allocated(lib)) call file%read('/transient/modal_displacement', modal, lib)
      if (.not. allocated(lib)) call file%read('/transient/energy/kinetic', kinetic, lib)
      if (.not. allocated(lib)) call file%read('/transient/energy/elastic', elastic, lib)
      if (.not. allocated(lib)) call file%read('/transient/energy/external_work', work, lib)
      if (.not. allocated(lib)) call file%read('/transient/energy/viscous_loss', viscous, lib)
      if (.not. allocated(lib)) call file%read('/transient/energy/friction_loss', friction, lib)
      if (.not. allocated(lib)) call file%read('/transient/energy/balance_error', balance, lib)
      if (.not. allocated(lib)) call file%read('/transient/contact/stick', stick, lib)
      if (.not. allocated(lib)) call file%read('/transient/contact/slip', slip, lib)
      if (.not. allocated(lib)) call file%read('/transient/contact/open', open, lib)
      if (.not. allocated(lib)) call file%read('/transient/contact/converged', converged, lib)
      if (.not. allocated(lib)) call file%read('/transient/steps', steps, lib)
      if (.not. allocated(lib)) call file%read('/transient/snapshot/time', instants, lib)
      if (.not. allocated(lib)) call file%read('/transient/snapshot/interface_2/pressure', pressure, lib)
      call good(error, lib)
      if (allocated(error)) return
      ! More than one block of samples, the last one not full.
      call check(error, size(time) == n_steps + 1 .and. steps == n_steps, 'wrong number of samples')
      if (allocated(error)) return
      call check(error, maxval(abs(time - [(k*dt, k=0, n_steps)])) < rounding*dt*n_steps, 'wrong times')
      if (allocated(error)) return
      call check(error, all(shape(sensor) == [2, n_steps + 1]) .and. all(shape(modal) == [6, n_steps + 1]), 'wrong shapes')
      if (allocated(error)) return
      call check(error, all(modal(:, 1) == state%modal) .and. &
         & all(sensor(:, 1) == system%sensor_values(state%modal, state%contact%force, state%amplitude)) &
         & .or. record%points_added > 0, 'the first sample is not the preload')
      if (allocated(error)) return
      call check(error, maxval(abs(work - viscous - friction - kinetic - elastic - balance)) &
         & <= rounding*maxval(work) .and. maxval(work) > 0.0_wp, 'the energies differ')
      if (allocated(error)) return
      call check(error, stick(1) + slip(1) + open(1) == size(state%contact%status) .and. all(converged == 1) &
         & .and. any(slip > 0), 'the contact counts differ, or nothing slips')
      if (allocated(error)) return
      call check(error, all(shape(pressure) == [nx, ny, n_snapshots]) .and. size(instants) == n_snapshots, &
         & 'wrong shape of a snapshot')
      if (allocated(error)) return
      call check(error, all(abs(instants - [0.5_wp, 1.0_wp]*n_steps*dt) < rounding), 'wrong times of snapshots')
      if (allocated(error)) return
      call check(error, sum(system%pads(2)%grid%from_map(pressure(:, :, 2))) > 0.0_wp, 'no pressure in a snapshot')
      call file%close(lib)
      call remove(scratch)
   end subroutine test_transient

   !> The recorder was closed after a failure: few samples, all of them in the file.
   subroutine test_failed_run(error)
      type(testing_error), allocatable, intent(out) :: error
      type(reduced_model_t) :: reduced
      type(jointed_system_t) :: system
      type(results_t), target :: results
      type(transient_results_t) :: recorder
      type(sample_t) :: samples(3)
      type(hdf5_file_t) :: file
      type(error_t), allocatable :: lib
      real(wp), allocatable :: time(:)
      integer :: k

      do k = 1, size(samples)
         samples(k) = sample_t(time=k*dt, modal=[(0.0_wp, k=1, 6)], sensor=[0.0_wp, 0.0_wp])
      end do
      call make_joint(nx, ny, hill, reduced, system, lib)
      if (.not. allocated(lib)) call results%create(scratch, lib)
      if (.not. allocated(lib)) call results%write_interfaces(system, lib)
      if (.not. allocated(lib)) call recorder%create(results, system, sensor_names, lib)
      if (.not. allocated(lib)) call recorder%record(samples, lib)
      if (.not. allocated(lib)) call recorder%record(samples(:0), lib)
      if (.not. allocated(lib)) call recorder%close(lib)
      if (.not. allocated(lib)) call results%close(lib)
      if (.not. allocated(lib)) call file%open(scratch, lib)
      if (.not. allocated(lib)) call file%read('/transient/time', time, lib)
      call good(error, lib)
      if (allocated(error)) return
      call check(error, size(time) == 3 .and. all(time == samples%time), 'samples are missing')
      if (allocated(error)) return
      call check(error, .not. file%has('/transient/snapshot'), 'snapshots that were not taken')
      call file%close(lib)
      call remove(scratch)
   end subroutine test_failed_run

   subroutine test_attributes(error)
      type(testing_error), allocatable, intent(out) :: error
      type(jointed_system_t) :: system
      type(operating_state_t) :: state
      type(preload_record_t) :: preload
      type(transient_record_t) :: record
      type(hdf5_file_t) :: file
      type(error_t), allocatable :: lib
      character(len=:), allocatable :: units
      integer :: k

      call write_all(system, state, preload, record, lib)
      if (.not. allocated(lib)) call file%open(scratch, lib)
      call good(error, lib)
      if (.not. allocated(error)) call look_at('')
      do k = 1, size(maps)
         if (allocated(error)) return
         call check(error, file%has_attribute('/preload/interface_1/'//trim(maps(k)), 'DIMENSION_LIST') .and. &
            & file%has_attribute('/transient/snapshot/interface_1/'//trim(maps(k)), 'DIMENSION_LIST'), &
            & 'no axes: '//maps(k))
      end do
      if (allocated(error)) return
      call check(error, file%has_attribute('/transient/sensor', 'DIMENSION_LIST') .and. &
         & file%has_attribute('/transient/energy/elastic', 'DIMENSION_LIST') .and. &
         & file%has_attribute('/transient/contact/slip', 'DIMENSION_LIST'), 'a time series has no axis')
      if (allocated(error)) return
      call file%get_attribute('/transient/snapshot/interface_2/traction_1', 'units', units, lib)
      call check(error, units == 'Pa', 'wrong units')
      call file%close(lib)
      call remove(scratch)

   contains

      !> All members of a group, and of theirs.
      recursive subroutine look_at(group)
         character(len=*), intent(in) :: group
         character(len=255), allocatable :: names(:)
         integer, allocatable :: extent(:)
         character(len=:), allocatable :: path, text
         type(error_t), allocatable :: no_dataset, no_text
         integer :: j

         call file%members(merge('/', ' ', group == '')//group, names, lib)
         if (allocated(lib)) call file%members(group, names, lib)
         call good(error, lib)
         do j = 1, size(names)
            if (allocated(error)) return
            path = group//'/'//trim(names(j))
            call file%shape_of(path, extent, no_dataset)
            if (allocated(no_dataset)) then
               call look_at(path)
               cycle
            end if
            call check(error, file%has_attribute(path, 'description'), 'no description: '//path)
            if (allocated(error)) return
            if (size(extent) == 0) then
               call file%read(path, text, no_text)
               if (.not. allocated(no_text)) cycle
            end if
            if (is_list_of_texts(path)) cycle
            call check(error, file%has_attribute(path, 'units'), 'no units: '//path)
         end do
      end subroutine look_at

      logical function is_list_of_texts(path)
         character(len=*), intent(in) :: path
         character(len=:), allocatable :: list(:)
         type(error_t), allocatable :: no_list
         call file%read(path, list, no_list)
         is_list_of_texts = .not. allocated(no_list)
      end function is_list_of_texts

   end subroutine test_attributes

   !> The old file is there until the new one is published; what is published can be read while the run goes on.
   subroutine test_publish(error)
      type(testing_error), allocatable, intent(out) :: error
      type(results_t) :: results, other
      type(hdf5_file_t) :: file
      type(error_t), allocatable :: lib, in_use
      character(len=:), allocatable :: input

      call results%create(scratch, lib)
      if (.not. allocated(lib)) call results%write_setup('old', '', lib)
      if (.not. allocated(lib)) call results%close(lib)
      if (.not. allocated(lib)) call results%create(scratch, lib)
      if (.not. allocated(lib)) call results%write_setup('new', '', lib)
      call expect('old')
      if (.not. allocated(lib)) call results%publish(lib)
      call expect('new')
      if (.not. allocated(lib)) call results%write_setup('newer', '', lib)
      if (.not. allocated(lib)) call results%publish_if_due(lib)
      call expect('new')
      call other%resume(scratch, in_use)
      if (.not. allocated(error)) call check(error, allocated(in_use), 'two runs work on one file')
      call results%discard()
      call expect('new')
      if (.not. allocated(lib)) call results%resume(scratch, lib)
      if (.not. allocated(lib)) call results%write_setup('newest', '', lib)
      if (.not. allocated(lib)) call results%close(lib)
      call expect('newest')
      call remove(scratch)

   contains

      subroutine expect(text)
         character(len=*), intent(in) :: text
         if (.not. allocated(lib)) call file%open(scratch, lib)
         if (.not. allocated(lib)) call file%read('/setup/input', input, lib)
         if (.not. allocated(lib)) call file%close(lib)
         if (allocated(error)) return
         call good(error, lib)
         if (.not. allocated(error)) call check(error, input == text, input//' in place of '//text)
      end subroutine expect

   end subroutine test_publish

   subroutine test_missing_folder(error)
      type(testing_error), allocatable, intent(out) :: error
      type(results_t) :: results
      type(error_t), allocatable :: lib

      call results%create('build/no_such_folder/result.h5', lib)
      call check(error, allocated(lib), 'no error')
      if (allocated(error)) return
      call check(error, lib%status == status_bad_input .and. index(lib%message, 'no_such_folder') > 0, lib%message)
      if (allocated(error)) return
      call results%write_setup('', '', lib)
      call check(error, allocated(lib), 'writing into a closed file is no error')
      if (allocated(error)) return
      call results%close(lib)
      call check(error, .not. allocated(lib), 'closing a closed file fails')
   end subroutine test_missing_folder

end module test_io_results
