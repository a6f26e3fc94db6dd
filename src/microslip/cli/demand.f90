!> What a run asks of the machine: memory at its peak and space for its result file, estimated before anything is computed,
!> and refused with the figures where the machine has less.
!>
!> Memory is counted in the matrices that are alive at the same time, with b boundary coordinates, u contact unknowns, m modes:
!>     reduction          the sparse factor with half as much for MUMPS to work in, 2 b^2, the modes
!>     contact, dense     3 b^2 + 4 u^2: K_bb, F, its normal rows; G, that of statics, the inverse on the closed points and
!>                        what it is made of
!>     contact, operator  4 b^2 + 500 u
!>     periodic motions   those of the contact, 4 (m (2H + 1))^2, and the steps of the periods
!> beyond what the process has when the case is read. Numbers are stored compressed; their shares are measured
!> (doc/limits.md). What is not known before the reduction (modes by a cut-off frequency, the time step) is looked at again
!> behind it.
module microslip_cli_demand
   use microslip_analysis_excitation, only: end_of_all, excitation_t
   use microslip_analysis_harmonic_meter, only: harmonic_meter_t
   use microslip_cli_motion_input, only: excitations_of, meter_of
   use microslip_cli_scene, only: scene_t
   use microslip_core_error, only: error_t, failure
   use microslip_core_kinds, only: i8, wp
   use microslip_core_machine_disk, only: free_space
   use microslip_core_machine_memory, only: available_memory, peak_memory, resident_memory
   use microslip_core_text, only: to_text
   use microslip_fe_reduced_model, only: reduced_model_t, find_highest_frequency
   use microslip_io_case, only: case_t
   use microslip_system_compliance_choice, only: compliance_named, takes_fft, dense_memory
   implicit none(type, external)
   private

   public :: demand_t, estimate_demand, check_demand, check_grids, check_reading, demand_in_words, memory_estimate, in_words
   public :: expected_unknowns, takes_all, uses_fft, boundary_count, factor_entries

   type :: demand_t
      !> Bytes: what the process has now, what will be added to it, and the estimate for what was before (reading: the peak)
      real(wp) :: memory_now = 0.0_wp, memory_more = 0.0_wp, memory_before = 0.0_wp
      !> What needs most of it
      character(len=:), allocatable :: largest
      !> Bytes of the result file but for the time series, and of one of their samples
      real(wp) :: file = 0.0_wp, sample = 0.0_wp
      !> Samples of the time series; negative: the time step is not known yet
      real(wp) :: samples = 0.0_wp
   end type demand_t

   !> Share of the grid points that is expected in potential contact where points are left out.
   real(wp), parameter :: expected_share = 0.2_wp
   !> Modes where they are chosen by a frequency.
   real(wp), parameter :: guessed_modes = 50.0_wp
   !> Of the FFT operator: vectors that are alive at once.
   real(wp), parameter :: fft_columns = 500.0_wp
   !> Bytes: what libraries take, and a point of a grid before the contact matrices.
   real(wp), parameter :: libraries = 3.0e7_wp, grid_point = 400.0_wp
   !> Bytes that reading an entry of a stiffness matrix takes at the same time (as triplets 16, to sort them 40, the matrix of
   !> before 12) over those of its line in the file.
   real(wp), parameter :: read_share = 68.0_wp/27.0_wp
   !> Bytes of a real and an integer.
   real(wp), parameter :: real_bytes = 8.0_wp, integer_bytes = 4.0_wp
   !> What compression leaves of series, maps and counts; bytes of a dataset without its numbers; datasets of a file, of an
   !> interface, of an analysis.
   real(wp), parameter :: series_share = 0.9_wp, map_share = 0.4_wp, count_share = 0.1_wp, dataset = 2000.0_wp
   integer, parameter :: file_datasets = 40, interface_datasets = 15, analysis_datasets = 20
   !> Files of the size of the result: the one that is worked on, the published one, its successor.
   real(wp), parameter :: file_copies = 3.0_wp
   !> Periods until the contact forces repeat, as a rule; bytes that are kept of a point in a step.
   real(wp), parameter :: periods_to_repeat = 5.0_wp, step_point = 32.0_wp

contains

   !> The estimate for a case.
   function estimate_demand(case, scene, reduced) result(demand)
      type(case_t), intent(in) :: case
      type(scene_t), intent(in) :: scene
      !> Empty before the reduction
      type(reduced_model_t), intent(in) :: reduced
      type(demand_t) :: demand
      real(wp) :: modes

      modes = guessed_modes
      if (allocated(case%reduction%n_modes)) modes = case%reduction%n_modes
      if (allocated(reduced%frequency)) modes = size(reduced%frequency)
      call count_file(case, scene, modes, demand)
      call count_samples(case, scene, reduced, demand)
      call count_memory(case, scene, modes, allocated(reduced%frequency), demand)
   end function estimate_demand

   ! ---------------------------------------------------------------------------------------------- memory

   !> Memory of the stages; the largest counts.
   subroutine count_memory(case, scene, modes, is_reduced, demand)
      type(case_t), intent(in) :: case
      type(scene_t), intent(in) :: scene
      real(wp), intent(in) :: modes
      !> Whether the reduction is behind us
      logical, intent(in) :: is_reduced
      type(demand_t), intent(inout) :: demand
      real(wp) :: reduction, contact, periodic, b, u
      logical :: fft

      b = boundary_count(scene)
      u = expected_unknowns(case, scene)
      fft = uses_fft(case, scene)
      reduction = 0.0_wp
      if (.not. (is_reduced .or. has_cache(case))) reduction = real_bytes*(1.5_wp*factor_entries(scene) + 2.0_wp*b**2 &
         & + scene%model%row_count()*(3.0_wp*modes + size(scene%patterns, 2)) + 5.0_wp*scene%model%stiffness%entries())
      contact = real_bytes*(3.0_wp*b**2 + 2.0_wp*u*(modes + size(scene%patterns, 2))) + dense_memory(u)
      if (fft) contact = real_bytes*(4.0_wp*b**2 + fft_columns*u)
      periodic = 0.0_wp
      if (case%runs('harmonic_balance')) periodic = &
         & periodic_memory(modes, u, case%harmonic_balance%harmonics, case%harmonic_balance%samples)
      if (case%runs('epmc')) periodic = max(periodic, periodic_memory(modes, u, case%epmc%harmonics, case%epmc%samples))

      demand%memory_now = resident_memory()
      demand%memory_before = peak_memory()
      demand%memory_more = libraries + max(reduction, contact + periodic)
      ! The decay is read back from the file as a whole, and once more for its windows.
      if (case%runs('ringdown')) demand%memory_more = demand%memory_more &
         & + 2.0_wp*real_bytes*(2 + sensor_count(scene))*max(demand%samples, 0.0_wp)
      if (reduction > contact + periodic) then
         demand%largest = 'the reduction with its sparse factor '//in_words(reduction)
      else if (periodic > contact) then
         demand%largest = 'periodic motions '//in_words(periodic)
      else
         demand%largest = 'contact matrices of '//to_text(nint(b))//' boundary coordinates and about '//to_text(u, 3) &
            & //' unknowns '//in_words(contact)
      end if
   end subroutine count_memory

   !> Memory of a periodic motion beyond that of the contact, bytes.
   pure real(wp) function periodic_memory(modes, unknowns, harmonics, samples)
      real(wp), intent(in) :: modes, unknowns
      integer, intent(in) :: harmonics, samples
      periodic_memory = real_bytes*((2*harmonics + 1)*modes*(4.0_wp*(2*harmonics + 1)*modes + unknowns)) &
         & + periods_to_repeat*samples*step_point*unknowns/3.0_wp
   end function periodic_memory

   !> Whether there is a cache to take the reduced model from (whether it fits is not known before it is read).
   logical function has_cache(case)
      type(case_t), intent(in) :: case

      has_cache = case%reduction%cache /= ''
      if (has_cache) inquire (file=case%located(case%reduction%cache), exist=has_cache)
   end function has_cache

   !> Entries of the sparse factor: measured, within 15 %, on meshes of jointed beams from 16 000 to 144 000 rows.
   pure real(wp) function factor_entries(scene)
      type(scene_t), intent(in) :: scene
      factor_entries = 2.2_wp*real(scene%model%row_count(), wp)**1.5_wp
   end function factor_entries

   !> Boundary coordinates of all interfaces.
   pure real(wp) function boundary_count(scene)
      type(scene_t), intent(in) :: scene
      integer :: k
      boundary_count = sum([(real(scene%pads(k)%boundary_count(), wp), k=1, size(scene%pads))])
   end function boundary_count

   !> Whether the contact compliance will be an operator.
   logical function uses_fft(case, scene)
      type(case_t), intent(in) :: case
      type(scene_t), intent(in) :: scene
      uses_fft = takes_fft(compliance_named(case%contact%compliance, case%contact%solver, all(scene%pads%half_space)), &
         & expected_unknowns(case, scene))
   end function uses_fft

   !> Contact unknowns to be expected: three per point, of a share of the points where some are left out.
   pure real(wp) function expected_unknowns(case, scene)
      type(case_t), intent(in) :: case
      type(scene_t), intent(in) :: scene
      integer :: k

      expected_unknowns = 0.0_wp
      do k = 1, size(scene%pads)
         expected_unknowns = expected_unknowns &
            & + 3.0_wp*scene%pads(k)%grid%point_count()*merge(1.0_wp, expected_share, takes_all(case, scene, k))
      end do
   end function expected_unknowns

   !> Whether all points of an interface are in potential contact.
   pure logical function takes_all(case, scene, k)
      type(case_t), intent(in) :: case
      type(scene_t), intent(in) :: scene
      integer, intent(in) :: k
      takes_all = case%interfaces(k)%potential == 'all' .or. .not. case%runs('preload') &
         & .or. all(scene%pads(k)%height == 0.0_wp)
   end function takes_all

   ! ------------------------------------------------------------------------------------------------ disk

   !> The result file but for its time series.
   subroutine count_file(case, scene, modes, demand)
      type(case_t), intent(in) :: case
      type(scene_t), intent(in) :: scene
      real(wp), intent(in) :: modes
      type(demand_t), intent(inout) :: demand
      !> Maps of an interface: height, area; those of a contact state; those of the settling for every impact and at rest
      integer, parameter :: own_maps = 2, state_maps = 5, settling_maps = 5
      real(wp) :: points, maps, sensors
      integer :: k

      points = sum([(real(scene%pads(k)%grid%nx, wp)*scene%pads(k)%grid%ny, k=1, size(scene%pads))])
      sensors = sensor_count(scene)
      maps = own_maps + merge(state_maps, 0, case%runs('preload'))
      if (case%runs('transient') .and. allocated(case%output%snapshots)) maps = maps + state_maps*size(case%output%snapshots)
      if (case%runs('settling')) maps = maps + settling_maps*(impacts(case) + 1) + state_maps
      demand%file = dataset*(file_datasets + interface_datasets*size(scene%pads) + analysis_datasets*size(case%analyses)) &
         & + 2*len(case%text) + real_bytes*(map_share*maps*points + series_share*modes*boundary_count(scene))
      associate (balance => case%harmonic_balance, mode => case%epmc)
         if (case%runs('harmonic_balance')) demand%file = demand%file + real_bytes*series_share*size(balance%levels) &
            & *balance%max_points*(12.0_wp + (2*balance%harmonics + 1)*(modes + sensors))
         if (case%runs('epmc')) demand%file = demand%file + real_bytes*series_share*mode%max_points &
            & *(12.0_wp + (2*mode%harmonics + 1)*(modes + sensors))
      end associate
      ! Time, sensors, modal coordinates, energies, residual; counts of the contact.
      demand%sample = real_bytes*series_share*(8.0_wp + sensors + modes) + integer_bytes*count_share*5.0_wp
   end subroutine count_file

   !> Samples of the time integrations.
   subroutine count_samples(case, scene, reduced, demand)
      type(case_t), intent(in) :: case
      type(scene_t), intent(in) :: scene
      type(reduced_model_t), intent(in) :: reduced
      type(demand_t), intent(inout) :: demand
      type(excitation_t), allocatable :: excitations(:)
      type(harmonic_meter_t) :: meter
      real(wp) :: duration, omega
      type(error_t), allocatable :: error

      omega = 0.0_wp
      if (allocated(reduced%frequency)) call find_highest_frequency(reduced, omega, error)
      if (case%runs('transient')) then
         excitations = excitations_of(case, scene)
         meter = meter_of(case)
         duration = case%transient%duration
         if (duration <= 0.0_wp) duration = end_of_all(excitations)
         call add(duration, case%transient%time_step, case%transient%safety)
         ! Windows that share a half with the next one, amplitude and phase of all sensors.
         if (meter%excitation > 0) demand%file = demand%file + real_bytes*series_share*2.0_wp/meter%window &
            & *excitations(meter%excitation)%cycles(duration)*(4 + 2*sensor_count(scene)*(1 + meter%harmonics))
      end if
      if (case%runs('settling')) call add(impacts(case)*case%settling%interval, case%settling%time_step, case%settling%safety)

   contains

      subroutine add(duration, time_step, safety)
         real(wp), intent(in) :: duration
         real(wp), allocatable, intent(in) :: time_step
         real(wp), intent(in) :: safety
         real(wp) :: step

         step = 0.0_wp
         if (omega > 0.0_wp) step = safety/omega
         if (allocated(time_step)) step = time_step
         if (step > 0.0_wp .and. demand%samples >= 0.0_wp) then
            demand%samples = demand%samples + 1.0_wp + duration/step/case%output%stride
         else
            demand%samples = -1.0_wp
         end if
      end subroutine add

   end subroutine count_samples

   !> Sensors.
   pure integer function sensor_count(scene)
      type(scene_t), intent(in) :: scene
      sensor_count = size(scene%patterns, 2) - scene%n_pattern_loads
   end function sensor_count

   !> Impacts of the settling.
   pure integer function impacts(case)
      type(case_t), intent(in) :: case
      impacts = max(size(case%settling%amplitude), case%settling%impacts)
   end function impacts

   !> Memory at the peak, bytes: of reading, or of what comes then.
   pure real(wp) function memory_estimate(demand)
      type(demand_t), intent(in) :: demand
      memory_estimate = max(demand%memory_before, demand%memory_now + demand%memory_more)
   end function memory_estimate

   ! --------------------------------------------------------------------------------------------- refusal

   !> Whether memory has room to read the matrices of CalculiX: before they are read.
   subroutine check_reading(case, error)
      type(case_t), intent(in) :: case
      type(error_t), allocatable, intent(out) :: error
      integer(i8) :: bytes
      real(wp) :: free

      if (case%model%source /= 'calculix') return
      inquire (file=case%located(case%model%file)//'.sti', size=bytes)
      free = available_memory()
      if (free <= 0.0_wp .or. read_share*bytes <= free) return
      call failure(error, 'reading '//case%located(case%model%file)//'.sti of '//in_words(real(bytes, wp))// &
         & ' would need about '//in_words(read_share*bytes)//' of memory, '//in_words(free)//' are free: a coarser mesh')
   end subroutine check_reading

   !> Whether memory has room for the grids at all: before they are made.
   subroutine check_grids(case, error)
      type(case_t), intent(in) :: case
      type(error_t), allocatable, intent(out) :: error
      real(wp) :: points, free
      integer :: k

      points = sum([(real(case%interfaces(k)%nx, wp)*case%interfaces(k)%ny, k=1, size(case%interfaces))])
      free = available_memory()
      if (free <= 0.0_wp .or. grid_point*points <= free) return
      call failure(error, 'the grids of '//to_text(points, 3)//' points would need about '//in_words(grid_point*points) &
         & //' of memory, '//in_words(free)//' are free: make nx and ny smaller')
   end subroutine check_grids

   !> Refuse what is more than the machine has.
   subroutine check_demand(demand, path, error)
      type(demand_t), intent(in) :: demand
      !> Result file
      character(len=*), intent(in) :: path
      type(error_t), allocatable, intent(out) :: error
      real(wp) :: free, needed, bytes
      integer(i8) :: there
      character(len=:), allocatable :: text

      free = available_memory()
      if (free > 0.0_wp .and. demand%memory_more > free) then
         call failure(error, 'the run would need about '//in_words(demand%memory_more)//' of memory ('//demand%largest//'), ' &
            & //in_words(free)//" are free: fewer grid points (nx, ny), modes or harmonics, or compliance = 'fft' in &contact")
         return
      end if
      free = free_space(path(:index(path, '/', back=.true.)))
      inquire (file=path, size=there)
      bytes = demand%file + demand%sample*max(demand%samples, 0.0_wp)
      needed = file_copies*bytes - max(there, 0_i8)
      if (free < 0.0_wp .or. needed <= free) return
      text = in_words(bytes)
      if (demand%samples > 0.0_wp) text = text//', '//to_text(demand%samples, 3)//' recorded steps of ' &
         & //to_text(demand%sample, 3)//' B'
      call failure(error, 'the result file '//path//' would need about '//in_words(needed)//' on the disk ('//text &
         & //', up to three times while it is published), '//in_words(free) &
         & //' are free: a shorter duration, fewer snapshots, or a larger stride in &output')
   end subroutine check_demand

   !> The estimates, for the log.
   function demand_in_words(demand) result(text)
      type(demand_t), intent(in) :: demand
      character(len=:), allocatable :: text

      text = 'memory '//in_words(memory_estimate(demand))//' ('//demand%largest//'); result file '
      if (demand%memory_before > demand%memory_now + demand%memory_more) text = 'memory '//in_words(demand%memory_before)// &
         & ' (reading the files); result file '
      if (demand%samples < 0.0_wp) then
         text = text//in_words(demand%file)//' and '//to_text(demand%sample, 3) &
            & //' B for every recorded step (how many follows from the reduction)'
      else
         text = text//in_words(demand%file + demand%sample*demand%samples)
         if (demand%samples > 0.0_wp) text = text//' ('//to_text(demand%samples, 3)//' recorded steps of ' &
            & //to_text(demand%sample, 3)//' B)'
      end if
   end function demand_in_words

   !> Bytes in words.
   pure function in_words(bytes) result(text)
      real(wp), intent(in) :: bytes
      character(len=:), allocatable :: text

      if (bytes < 1.0e9_wp) then
         text = to_text(bytes/1.0e6_wp, 3)//' MB'
      else
         text = to_text(bytes/1.0e9_wp, 3)//' GB'
      end if
   end function in_words

end module microslip_cli_demand
