!> The result file, all but the time series (these are in `microslip_io_transient_results`): doc/results.md.
!>
!> Axes are dimension scales: /interface_K/x and y of all maps of interface K. A Fortran map (nx, ny) is [y, x] in
!> other languages.
!>
!> The program works on a file with `.part` behind its name, which it has locked. Readers see the file without: a copy that is replaced as a
!> whole every so often (published), and in the end the file itself. It can be read at any moment and survives any end of
!> the process, a full disk and a loss of power; nothing has to be known of HDF5's caches.
module microslip_io_results
   use, intrinsic :: iso_fortran_env, only: compiler_options, compiler_version
   use microslip_analysis_linear_modes, only: linear_modes_t
   use microslip_analysis_operating_state, only: operating_state_t
   use microslip_analysis_preload, only: preload_record_t
   use microslip_contact_problem, only: count_states
   use microslip_core_error, only: bad_input, error_t
   use microslip_core_kinds, only: wp, pi
   use microslip_core_stopwatch, only: wall_time
   use microslip_core_warning_list, only: warning_list_t
   use microslip_fe_reduced_model, only: reduced_model_t
   use microslip_io_contact_fields, only: contact_fields, field_maps_t, fields, interface_group
   use microslip_io_file_identity, only: link_target, place_of
   use microslip_io_hdf5, only: hdf5_file_t
   use microslip_io_interface_maps, only: attach_axes, write_map
   use microslip_io_provenance, only: host_name, utc_now
   use microslip_io_own_files, only: check_leftover, check_replaceable, copy_of, mark, part_of, result_file
   use microslip_io_whole_files, only: copy_bytes, copy_file
   use microslip_io_working_file, only: working_file_t
   use microslip_system_jointed_system, only: jointed_system_t
   use microslip_system_pad, only: pad_t
   implicit none(type, external)
   private

   public :: results_t, format_version

   !> Changes when a script that reads result files has to.
   integer, parameter :: format_version = 1

   character(len=*), parameter :: warnings_group = '/warnings'
   !> Largest part of the wall time that may go into publishing.
   real(wp), parameter :: publishing_share = 0.02_wp

   !> An open result file.
   type :: results_t
      type(hdf5_file_t) :: file
      !> Where readers find it
      character(len=:), allocatable :: path
      !> s, wall time from one publication to the next
      real(wp) :: interval = 60.0_wp
      !> Where that is if the path is a symbolic link, which stays; the path itself otherwise
      character(len=:), allocatable, private :: place
      !> The file that is worked on
      type(working_file_t), private :: part
      !> s on the clock
      real(wp), private :: due = huge(1.0_wp)
   contains
      procedure :: create
      procedure :: resume
      procedure, private :: begin
      procedure :: publish
      procedure :: publish_if_due
      procedure :: is_due
      procedure :: discard
      procedure :: write_provenance
      procedure :: write_setup
      procedure :: write_model
      procedure :: write_interfaces
      procedure :: write_preload
      procedure :: write_linear_modes
      procedure :: write_timing
      procedure :: write_warnings
      procedure :: read_warnings
      procedure :: close => close_results
   end type results_t

   !> Write a dataset unless an earlier write failed: a sequence of these needs one look at `error`, at its end.
   interface put
      procedure :: put_real, put_reals, put_table, put_integer, put_integers, put_integer_map, put_texts
   end interface put

contains

   !> Start a new result file. What has its name stays until the new one is published.
   subroutine create(self, path, error)
      class(results_t), intent(inout) :: self
      !> Where to; a result file that is there is replaced, anything else is not
      character(len=*), intent(in) :: path
      type(error_t), allocatable, intent(out) :: error

      call self%begin(path, error)
      if (allocated(error)) return
      call self%file%create(self%part%path, error)
      if (.not. allocated(error)) call mark(self%file, result_file, format_version, error)
      if (allocated(error)) call self%discard()
   end subroutine create

   !> Go on with a result file that was published before.
   subroutine resume(self, path, error)
      class(results_t), intent(inout) :: self
      !> Where it is
      character(len=*), intent(in) :: path
      type(error_t), allocatable, intent(out) :: error

      call self%begin(path, error)
      if (allocated(error)) return
      call copy_bytes(self%place, self%part%path, error)
      if (.not. allocated(error)) call self%file%open(self%part%path, error, writable=.true., own=.true.)
      if (allocated(error)) call self%discard()
   end subroutine resume

   !> Have the names that are needed for this run alone.
   subroutine begin(self, path, error)
      class(results_t), intent(inout) :: self
      character(len=*), intent(in) :: path
      type(error_t), allocatable, intent(out) :: error

      self%path = path
      self%place = path
      if (link_target(path) /= '') self%place = place_of(path)
      call check_replaceable(path, result_file, error)
      if (.not. allocated(error)) call self%part%take(part_of(self%place), result_file, error)
      if (allocated(error)) return
      ! Only who has the working file makes copies.
      call check_leftover(copy_of(self%place), result_file, error)
      if (allocated(error)) call self%part%give_up()
      self%due = wall_time() + self%interval
   end subroutine begin

   !> Everything written so far goes into the file that readers see.
   subroutine publish(self, error)
      class(results_t), intent(inout) :: self
      type(error_t), allocatable, intent(out) :: error
      real(wp) :: began

      began = wall_time()
      call self%file%flush(error)
      if (.not. allocated(error)) call check_replaceable(self%path, result_file, error)
      if (.not. allocated(error)) call copy_file(self%part%path, self%place, result_file, error)
      self%due = wall_time() + max(self%interval, (wall_time() - began)/publishing_share)
   end subroutine publish

   !> Publish if the time has come.
   subroutine publish_if_due(self, error)
      class(results_t), intent(inout) :: self
      type(error_t), allocatable, intent(out) :: error

      if (self%is_due()) call self%publish(error)
   end subroutine publish_if_due

   !> Whether the time has come to publish.
   logical function is_due(self)
      class(results_t), intent(in) :: self
      is_due = wall_time() >= self%due
   end function is_due

   !> Finish, close and publish; harmless if the file is not open. If that fails, what was published before stays.
   subroutine close_results(self, error)
      class(results_t), intent(inout) :: self
      type(error_t), allocatable, intent(out) :: error

      if (.not. self%file%is_open()) return
      call self%file%close(error)
      if (allocated(error)) then
         call self%part%give_up()
         return
      end if
      ! What has the name by now may be another file than at the beginning.
      call check_replaceable(self%path, result_file, error)
      if (allocated(error)) then
         error%message = error%message//'; '//self%part%path//' has the results'
      else
         call self%part%publish_as(self%place, error)
      end if
   end subroutine close_results

   !> Close and remove what is not published; harmless if the file is not open.
   subroutine discard(self)
      class(results_t), intent(inout) :: self
      type(error_t), allocatable :: ignored

      call self%file%close(ignored)
      call self%part%give_up()
   end subroutine discard

   !> Who made this file, when, where and how: attributes of '/'.
   subroutine write_provenance(self, version, commit, command_line, threads, error)
      class(results_t), intent(in) :: self
      !> Version of the program
      character(len=*), intent(in) :: version
      !> Commit of its source, '' if not known
      character(len=*), intent(in) :: commit
      !> As it was called
      character(len=*), intent(in) :: command_line
      !> Number of threads
      integer, intent(in) :: threads
      type(error_t), allocatable, intent(out) :: error
      character(len=:), allocatable :: known_commit

      known_commit = trim(commit)
      if (known_commit == '') known_commit = 'unknown'
      ! Program and format are marked from the beginning.
      call self%file%set_attribute('/', 'version', version, error)
      if (.not. allocated(error)) call self%file%set_attribute('/', 'commit', known_commit, error)
      if (.not. allocated(error)) call self%file%set_attribute('/', 'compiler', compiler_version()//' '// &
         & compiler_options(), error)
      if (.not. allocated(error)) call self%file%set_attribute('/', 'command line', command_line, error)
      if (.not. allocated(error)) call self%file%set_attribute('/', 'date', utc_now(), error)
      if (.not. allocated(error)) call self%file%set_attribute('/', 'host', host_name(), error)
      if (.not. allocated(error)) call self%file%set_attribute('/', 'threads', threads, error)
   end subroutine write_provenance

   !> The case as it was given and as it was understood: /setup.
   subroutine write_setup(self, input_text, resolved_text, error)
      class(results_t), intent(in) :: self
      !> Text of the case file
      character(len=*), intent(in) :: input_text
      !> Every key with the value that is used
      character(len=*), intent(in) :: resolved_text
      type(error_t), allocatable, intent(out) :: error

      call self%file%write('/setup/input', input_text, 'text of the case file', error)
      if (.not. allocated(error)) call self%file%write('/setup/resolved', resolved_text, &
         & 'every key with the value that was used', error)
   end subroutine write_setup

   !> Sizes, component modes and what the reduction cost: /model.
   subroutine write_model(self, system, reduced, error)
      class(results_t), intent(in) :: self
      type(jointed_system_t), intent(in) :: system
      !> Where the system comes from
      type(reduced_model_t), intent(in) :: reduced
      type(error_t), allocatable, intent(out) :: error

      associate (file => self%file, record => reduced%record)
         call put(file, '/model/modes', system%n_modes, '1', 'retained component modes', error)
         call put(file, '/model/boundary_coordinates', size(reduced%K_bb, 1), '1', &
            & 'relative displacements of the interface nodes', error)
         call put(file, '/model/grid_points', system%grid_point_count(), '1', 'points of all interface grids', error)
         call put(file, '/model/contact_points', system%problem%n_points, '1', 'points in potential contact', error)
         call put(file, '/model/compliance', [form_of(system)], &
            & 'contact compliance at the start: dense matrix or FFT operator', error)
         call put(file, '/model/tied_frequency', reduced%frequency(:reduced%tied_modes), 'Hz', &
            & 'frequencies of the component modes with tied interfaces', error)
         call put(file, '/model/damping', system%damping, '1/s', 'viscous damping of the modal coordinates, 2 zeta omega', &
            & error)
         if (reduced%method == 'craig_bampton_massless') call put(file, '/model/modal_participation', &
            & participation(reduced), 'sqrt(kg)', 'alpha [mode, boundary coordinate] of the massless boundary', error)
         if (.not. allocated(error)) call write_masses(file, reduced, error)
         call put(file, '/model/reduction/method', [reduced%method], 'method of reduction', error)
         call put(file, '/model/reduction/rows', record%rows, '1', 'rows of the finite-element matrices', error)
         call put(file, '/model/reduction/factor_entries', real(record%factor_entries, wp), '1', &
            & 'entries of the sparse factor', error)
         call put(file, '/model/reduction/solves', record%solves, '1', 'solutions with the sparse factor', error)
         call put(file, '/model/reduction/iterations', record%iterations, '1', 'blocks of the eigenvalue iteration', error)
         call put(file, '/model/reduction/residual', record%residual, '1', 'relative residual of the component modes', error)
         call put(file, '/model/reduction/seconds_schur', record%seconds_schur, 's', &
            & 'wall time of the static condensation', error)
         call put(file, '/model/reduction/seconds_modes', record%seconds_modes, 's', 'wall time of the modes', error)
         call put(file, '/model/reduction/seconds', record%seconds, 's', 'wall time of the reduction', error)
      end associate
   end subroutine write_model

   !> Mass of the bodies and what the reduced model carries of it: /model/bodies; motions that are soft: /model/soft_motions.
   subroutine write_masses(file, reduced, error)
      type(hdf5_file_t), intent(in) :: file
      type(reduced_model_t), intent(in) :: reduced
      type(error_t), allocatable, intent(out) :: error
      integer :: k

      k = 0
      if (allocated(reduced%soft_frequency)) k = size(reduced%soft_frequency)
      if (k > 0) then
         call put(file, '/model/soft_motions/frequency', reduced%soft_frequency, 'Hz', &
            & '[motion]: of boundary motions with the mass alone that the tied modes do not carry', error)
         call put(file, '/model/soft_motions/residual_share', reduced%soft_share, '1', &
            & '[motion]: that mass over all mass of the motion', error)
         call put(file, '/model/soft_motions/kept', size(reduced%frequency) - reduced%tied_modes, '1', &
            & 'motions whose residual mass the reduced model keeps', error)
      end if
      if (.not. allocated(reduced%bodies)) return
      if (size(reduced%bodies) == 0) return
      associate (bodies => reduced%bodies)
         call put(file, '/model/bodies/first_node', bodies%first_label, '1', '[body]: smallest node number', error)
         call put(file, '/model/bodies/nodes', bodies%nodes, '1', '[body]: number of nodes', error)
         call put(file, '/model/bodies/inertia', reshape([(bodies(k)%inertia, k=1, size(bodies))], [6, size(bodies)]), '1', &
            & '[body, motion]: mass along x, y, z in kg, moment of inertia about x, y, z in kg m^2, supported '// &
            & 'rows left out', error)
         call put(file, '/model/bodies/kept_mass', reshape([(bodies(k)%kept, k=1, size(bodies))], [6, size(bodies)]), '1', &
            & '[body, motion]: part of mass or moment of inertia that the reduced model carries when the body moves as a '// &
            & 'whole along x, y, z or turns about x, y, z', error)
         call put(file, '/model/bodies/rigid_frequency', reshape([(bodies(k)%frequency, k=1, size(bodies))], &
            & [6, size(bodies)]), 'Hz', '[body, motion]: frequency of that motion on supports and springs', error)
      end associate
   end subroutine write_masses

   !> How the contact compliance is held.
   pure character(len=5) function form_of(system)
      type(jointed_system_t), intent(in) :: system
      form_of = merge('fft  ', 'dense', allocated(system%problem%compliance))
   end function form_of

   !> alpha^T = -K_bi Lambda^-1, (boundary, modes).
   pure function participation(reduced) result(alpha)
      type(reduced_model_t), intent(in) :: reduced
      real(wp), allocatable :: alpha(:, :)
      integer :: k

      allocate (alpha, mold=reduced%K_bi)
      do k = 1, size(alpha, 2)
         alpha(:, k) = -reduced%K_bi(:, k)/(2.0_wp*pi*reduced%frequency(k))**2
      end do
   end function participation

   !> Grids, surfaces and potential contact sets: /interface_K. May be called again when the sets have grown.
   subroutine write_interfaces(self, system, error)
      class(results_t), intent(in) :: self
      type(jointed_system_t), intent(in) :: system
      type(error_t), allocatable, intent(out) :: error
      integer :: k

      do k = 1, size(system%pads)
         call write_interface(self%file, system%pads(k), '/'//interface_group(k), error)
         if (allocated(error)) return
      end do
   end subroutine write_interfaces

   !> One interface.
   subroutine write_interface(file, pad, group, error)
      type(hdf5_file_t), intent(in) :: file
      type(pad_t), intent(in) :: pad
      character(len=*), intent(in) :: group
      type(error_t), allocatable, intent(out) :: error
      logical :: potential(pad%grid%point_count())
      integer, allocatable :: map(:, :)

      potential = .false.
      potential(pad%potential) = .true.
      call put(file, group//'/x', pad%grid%x, 'm', points_of(pad)//' along t1', error)
      call put(file, group//'/y', pad%grid%y, 'm', points_of(pad)//' along t2', error)
      if (.not. allocated(error)) call file%make_scale(group//'/x', 'x', error)
      if (.not. allocated(error)) call file%make_scale(group//'/y', 'y', error)
      call write_map(file, pad%grid, group, group//'/height', pad%grid%to_map(pad%height), 'm', &
         & 'composite surface height, 0 at the highest point; NaN where there is no contact point', error)
      call write_map(file, pad%grid, group, group//'/area', pad%grid%to_map(pad%grid%area), 'm^2', &
         & 'area of the contact points: force over pressure', error)
      map = unpack(merge(1, 0, potential), pad%grid%inside, 0)
      if (pad%grid%regular) then
         call put(file, group//'/potential', map, '1', '1 for points in potential contact, 0 for the others', error)
      else
         call put(file, group//'/potential', map(:, 1), '1', '1 for points in potential contact, 0 for the others', error)
      end if
      call attach_axes(file, pad%grid, group, group//'/potential', error)
      call put(file, group//'/friction', pad%friction, '1', 'friction coefficient', error)
      call put(file, group//'/origin', pad%contact%origin, 'm', 'point with x = y = 0 in the axes of the model', error)
      call put(file, group//'/frame', pad%contact%frame, '1', &
         & '[axis, component]: n (from body B to body A), t1 (x), t2 (y) in the axes of the model', error)
      if (.not. allocated(error)) call file%set_attribute(group, 'name', pad%contact%name, error)
   end subroutine write_interface

   !> Where the contact points of a pad lie, in words.
   pure function points_of(pad) result(text)
      type(pad_t), intent(in) :: pad
      character(len=:), allocatable :: text

      text = 'contact points (FE nodes)'
      if (pad%grid%regular) text = 'cell centres'
   end function points_of

   !> Equilibrium under the preload: /preload. The interfaces must have been written.
   subroutine write_preload(self, system, state, record, load_names, error)
      class(results_t), intent(in) :: self
      type(jointed_system_t), intent(in) :: system
      type(operating_state_t), intent(in) :: state
      type(preload_record_t), intent(in) :: record
      !> (loads) names of the system's loads
      character(len=*), intent(in) :: load_names(:)
      type(error_t), allocatable, intent(out) :: error
      type(field_maps_t), allocatable :: maps(:)
      character(len=:), allocatable :: group, path
      integer :: k, f

      call write_preload_record(self%file, state, record, load_names, error)
      maps = contact_fields(system, state%contact)
      do k = 1, size(maps)
         group = interface_group(k)
         do f = 1, size(fields)
            path = '/preload/'//group//'/'//trim(fields(f)%name)
            call write_map(self%file, system%pads(k)%grid, '/'//group, path, maps(k)%map(:, :, f), trim(fields(f)%units), &
               & trim(fields(f)%description), error)
         end do
      end do
   end subroutine write_preload

   !> The numbers of the preload.
   subroutine write_preload_record(file, state, record, load_names, error)
      type(hdf5_file_t), intent(in) :: file
      type(operating_state_t), intent(in) :: state
      type(preload_record_t), intent(in) :: record
      character(len=*), intent(in) :: load_names(:)
      type(error_t), allocatable, intent(out) :: error
      integer :: counts(3)

      counts = count_states(state%contact)
      call put(file, '/preload/interface_force', record%interface_force, 'N', '[interface]: normal force', error)
      call put(file, '/preload/load_name', load_names, 'names of the loads', error)
      call put(file, '/preload/load_amplitude', state%amplitude, '1', '[load]: factor on the load pattern', error)
      call put(file, '/preload/modal_displacement', state%modal, 'm sqrt(kg)', '[mode]: modal coordinates', error)
      call put(file, '/preload/contact/open', counts(1), '1', 'open points of the potential contact set', error)
      call put(file, '/preload/contact/stick', counts(2), '1', 'sticking points', error)
      call put(file, '/preload/contact/slip', counts(3), '1', 'slipping points', error)
      call put(file, '/preload/solves', record%solves, '1', 'contact solves', error)
      call put(file, '/preload/iterations', record%iterations, '1', 'iterations of all contact solves', error)
      call put(file, '/preload/residual', record%residual, '1', &
         & 'largest violation of the contact laws over the largest contact force', error)
      call put(file, '/preload/error_estimate', record%error_estimate, '1', &
         & 'estimated error of the contact forces over the largest contact force', error)
      call put(file, '/preload/force_deviation', record%force_deviation, '1', &
         & 'largest relative deviation of an interface force from what was asked', error)
      call put(file, '/preload/elastic_energy', record%elastic_energy, 'J', 'elastic energy of structure and contact', &
         & error)
      call put(file, '/preload/work', record%work, 'J', 'work of the loads', error)
      call put(file, '/preload/friction_loss', record%friction_loss, 'J', 'work lost to friction', error)
      call put(file, '/preload/balance_error', record%work - record%elastic_energy - record%friction_loss, 'J', &
         & 'work less elastic energy and friction loss', error)
   end subroutine write_preload_record

   !> Modes with all closed points stuck: /linear_modes.
   subroutine write_linear_modes(self, modes, error)
      class(results_t), intent(in) :: self
      type(linear_modes_t), intent(in) :: modes
      type(error_t), allocatable, intent(out) :: error

      call put(self%file, '/linear_modes/frequency', modes%frequency, 'Hz', &
         & 'natural frequencies with all closed points stuck', error)
      call put(self%file, '/linear_modes/shape', modes%shape, '1', &
         & '[mode, modal coordinate]: mode shapes of unit modal mass', error)
      call put(self%file, '/linear_modes/residual', modes%residual, '1', &
         & 'largest residual of the eigenvalue problem over the largest eigenvalue', error)
   end subroutine write_linear_modes

   !> Where the time went: /timing.
   subroutine write_timing(self, names, seconds, counts, error)
      class(results_t), intent(in) :: self
      !> (stages)
      character(len=*), intent(in) :: names(:)
      !> (stages) wall time, s
      real(wp), intent(in), contiguous :: seconds(:)
      !> (stages) steps, solves, ... done in a stage
      integer, intent(in), contiguous :: counts(:)
      type(error_t), allocatable, intent(out) :: error

      call put(self%file, '/timing/stage', names, 'stages of the run', error)
      call put(self%file, '/timing/seconds', seconds, 's', '[stage]: wall time', error)
      if (.not. allocated(error)) call self%file%write('/timing/count', counts, '1', &
         & '[stage]: steps, modes, points, ... done', error)
   end subroutine write_timing

   ! ------------------------------------------------------------------------------------------------- put

   !> Warnings up to now, worst first: attribute `warnings` of '/' (how many), and /warnings if there are any.
   subroutine write_warnings(self, warnings, error)
      class(results_t), intent(in) :: self
      type(warning_list_t), intent(in) :: warnings
      type(error_t), allocatable, intent(out) :: error
      character(len=:), allocatable :: text(:)
      integer :: k

      call self%file%set_attribute('/', 'warnings', warnings%number(), error)
      if (.not. allocated(error)) call self%file%delete(warnings_group, error)
      if (allocated(error) .or. warnings%number() == 0) return
      allocate (character(len=maxval([(len(warnings%text(k)), k=1, warnings%number())])) :: text(warnings%number()))
      do k = 1, size(text)
         text(k) = warnings%text(k)
      end do
      call put(self%file, warnings_group//'/text', text, 'what is doubtful about the input or the results, worst first', error)
      call put(self%file, warnings_group//'/severity', [(warnings%severity(k), k=1, size(text))], '1', &
         & '1: worth a look, 2: doubtful, 3: most likely wrong', error)
   end subroutine write_warnings

   !> Warnings that an interrupted run left in the file.
   subroutine read_warnings(self, warnings, error)
      class(results_t), intent(in) :: self
      !> They are added to it
      type(warning_list_t), intent(inout) :: warnings
      type(error_t), allocatable, intent(out) :: error
      character(len=:), allocatable :: text(:)
      integer, allocatable :: severity(:)
      integer :: k

      if (.not. self%file%has(warnings_group)) return
      call self%file%read(warnings_group//'/text', text, error)
      if (.not. allocated(error)) call self%file%read(warnings_group//'/severity', severity, error)
      if (allocated(error)) return
      do k = 1, min(size(text), size(severity))
         call warnings%add(severity(k), trim(text(k)))
      end do
   end subroutine read_warnings

   subroutine put_real(file, path, value, units, description, error)
      type(hdf5_file_t), intent(in) :: file
      character(len=*), intent(in) :: path, units, description
      real(wp), intent(in) :: value
      type(error_t), allocatable, intent(inout) :: error
      if (.not. allocated(error)) call file%write(path, value, units, description, error)
   end subroutine put_real

   subroutine put_reals(file, path, value, units, description, error)
      type(hdf5_file_t), intent(in) :: file
      character(len=*), intent(in) :: path, units, description
      real(wp), intent(in), contiguous :: value(:)
      type(error_t), allocatable, intent(inout) :: error
      if (.not. allocated(error)) call file%write(path, value, units, description, error)
   end subroutine put_reals

   subroutine put_table(file, path, value, units, description, error)
      type(hdf5_file_t), intent(in) :: file
      character(len=*), intent(in) :: path, units, description
      real(wp), intent(in), contiguous :: value(:, :)
      type(error_t), allocatable, intent(inout) :: error
      if (.not. allocated(error)) call file%write(path, value, units, description, error)
   end subroutine put_table

   subroutine put_integer(file, path, value, units, description, error)
      type(hdf5_file_t), intent(in) :: file
      character(len=*), intent(in) :: path, units, description
      integer, intent(in) :: value
      type(error_t), allocatable, intent(inout) :: error
      if (.not. allocated(error)) call file%write(path, value, units, description, error)
   end subroutine put_integer

   subroutine put_integers(file, path, value, units, description, error)
      type(hdf5_file_t), intent(in) :: file
      character(len=*), intent(in) :: path, units, description
      integer, intent(in), contiguous :: value(:)
      type(error_t), allocatable, intent(inout) :: error
      if (.not. allocated(error)) call file%write(path, value, units, description, error)
   end subroutine put_integers

   subroutine put_integer_map(file, path, value, units, description, error)
      type(hdf5_file_t), intent(in) :: file
      character(len=*), intent(in) :: path, units, description
      integer, intent(in), contiguous :: value(:, :)
      type(error_t), allocatable, intent(inout) :: error
      if (.not. allocated(error)) call file%write(path, value, units, description, error)
   end subroutine put_integer_map

   subroutine put_texts(file, path, value, description, error)
      type(hdf5_file_t), intent(in) :: file
      character(len=*), intent(in) :: path, description
      character(len=*), intent(in) :: value(:)
      type(error_t), allocatable, intent(inout) :: error
      if (.not. allocated(error)) call file%write(path, value, description, error)
   end subroutine put_texts

end module microslip_io_results
