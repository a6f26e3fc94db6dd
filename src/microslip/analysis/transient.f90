!> Semi-explicit leapfrog (paper eqs. (8)-(20), METHOD section 6).
!>
!>     v_{k+1/2} = (I/dt + D/2)^-1 [ f_k + (I/dt - D/2) v_{k-1/2} - Khat d_k + R^T lambda_k ]
!>     d_{k+1}   = d_k + dt v_{k+1/2},   then the contact step at t_{k+1} gives lambda_{k+1}
!>
!> Energy books, every step. With v_{k-1/2} . v_{k+1/2} / 2 as kinetic energy and works by the trapezoidal
!> rule the linear scheme keeps its books exactly; friction is booked as mu (mean lambda_n) |slip| >= 0
!> (`friction_work`), of the order of the scheme, which is the second. What the books then miss is the error of the
!> time discretisation at the contact, where slip begins, turns or ends and where points open or close, and the proof
!> that the scheme has no other loss:
!>     balance_error = external_work - viscous_loss - friction_loss - (kinetic + elastic - initial)
!>
!> Points left out of the potential contact set are checked on the whole grid where the motion turns (the kinetic
!> energy passes a minimum: the load extremes), every `verify_stride` steps at the latest, and at the end; samples are
!> handed on only after that. If one would close, it joins and the run repeats from the last check.
!> The harmonics of the sensors under a sine are found on the way, and may lead a stepped sine on
!> (`microslip_analysis_harmonic_meter`).
!>
!> Every `restart_stride` steps, at the next check, the run is brought to a restart point: the contact solver begins
!> anew from the contact state, so that what follows depends on the motion alone, and the motion goes to the recorder.
!> A run that is resumed from such a point has the same bits as one that was never interrupted.
module microslip_analysis_transient
   use microslip_analysis_excitation, only: excitation_t, end_of_all, load_amplitudes
   use microslip_analysis_harmonic_meter, only: harmonic_meter_t
   use microslip_analysis_motion, only: motion_t
   use microslip_analysis_operating_state, only: operating_state_t
   use microslip_analysis_potential_set, only: potential_points
   use microslip_analysis_slip_size, only: slip_in_cells
   use microslip_analysis_transient_recorder, only: energy_t, sample_t, transient_recorder_t
   use microslip_contact_factory, only: contact_options_t, new_contact_solver
   use microslip_contact_laws, only: state_open, state_slip
   use microslip_contact_problem, only: contact_solver_t, gap_of, book_step
   use microslip_core_archive, only: archive_t
   use microslip_core_error, only: error_t, failure
   use microslip_core_kinds, only: wp
   use microslip_core_stopwatch, only: stopwatch_t
   use microslip_core_text, only: to_text
   use microslip_system_jointed_system, only: jointed_system_t
   implicit none(type, external)
   private

   public :: transient_options_t, transient_record_t, sample_t, transient_recorder_t, energy_t, run_transient, most_steps

   !> Steps are counted in integers.
   real(wp), parameter :: most_steps = 1.0e9_wp

   type :: transient_options_t
      !> s; 0: until the excitations end
      real(wp) :: duration = 0.0_wp
      !> s
      real(wp) :: time_step = 0.0_wp
      !> Every `stride`-th step is recorded
      integer :: stride = 1
      type(excitation_t), allocatable :: excitations(:)
      !> Harmonics of the sensors under one of the excitations
      type(harmonic_meter_t) :: meter
      !> s, ascending: times of snapshots
      real(wp), allocatable :: snapshots(:)
      !> Steps between two checks of the points left out
      integer :: verify_stride = 200
      !> Steps between two restart points
      integer :: restart_stride = 20000
   end type transient_options_t

   !> How the run went.
   type :: transient_record_t
      integer :: steps = 0
      integer :: iterations = 0
      integer :: rescues = 0
      integer :: set_changes = 0
      !> Steps whose contact solve did not converge
      integer :: unconverged = 0
      !> Largest residual and error estimate of a step, over the largest contact force
      real(wp) :: residual = 0.0_wp, error_estimate = 0.0_wp
      !> Largest energy balance error over the largest kinetic energy
      real(wp) :: balance_error = 0.0_wp
      !> The same over the largest of kinetic energy, external work and losses: energy that went through
      real(wp) :: unaccounted_energy = 0.0_wp
      !> Largest tangential displacement of a closed point at the checks, in cells of its grid
      real(wp) :: largest_slip = 0.0_wp
      !> Points that joined the potential contact set on the way
      integer :: points_added = 0
   end type transient_record_t

contains

   !> Integrate from an equilibrium at rest, or go on from a restart point.
   subroutine run_transient(system, start, options, contact_options, recorder, clock, record, error, point)
      !> Its potential contact set may grow
      type(jointed_system_t), intent(inout) :: system
      type(operating_state_t), intent(in) :: start
      type(transient_options_t), intent(in) :: options
      type(contact_options_t), intent(in) :: contact_options
      class(transient_recorder_t), intent(inout) :: recorder
      !> Running; books 'transient start', 'transient' (the steps) and 'write' (what the recorder takes)
      type(stopwatch_t), intent(inout) :: clock
      type(transient_record_t), intent(out) :: record
      type(error_t), allocatable, intent(out) :: error
      !> Of the same run, as the recorder was given it
      integer, intent(in), optional :: point(:)
      class(contact_solver_t), allocatable :: solver
      type(motion_t) :: motion, safe
      type(sample_t), allocatable :: samples(:)
      integer :: block_end, added, next_point
      real(wp) :: through

      call check_time_step(system, options%time_step, error)
      if (allocated(error)) return
      system%problem%velocity_level = contact_options%velocity_level
      call begin(system, start, options, motion, error)
      if (.not. allocated(error)) call check_duration(options, motion, error)
      if (allocated(error)) return
      allocate (samples(0))
      call add_sample(system, options, motion, samples)
      if (present(point)) then
         call resume(system, motion, record, recorder, clock, point, error)
         samples = samples(:0)
      end if
      if (.not. allocated(error)) call renew(system, contact_options, motion, solver, error)
      if (allocated(error)) return
      next_point = motion%step + options%restart_stride
      call clock%stop('transient start')
      if (.not. present(point)) call take_snapshots(system, options, motion, recorder, error)
      if (allocated(error)) return

      do while (motion%step < last_step(options, motion))
         safe = motion
         block_end = min(motion%step + options%verify_stride, next_snapshot(options, motion%step))
         call advance_block(system, options, block_end, solver, motion, samples, record, recorder, error)
         if (allocated(error)) exit
         call solver%complete(system%problem, motion%contact)
         call system%widen_where_closed(motion%d, motion%contact%force, motion%amplitude, added, error)
         if (allocated(error)) exit
         record%points_added = record%points_added + added
         if (added > 0) then
            call resume_from(system, safe, solver, motion, samples, error)
            if (allocated(error)) exit
            cycle
         end if
         record%largest_slip = max(record%largest_slip, slip_in_cells(system, motion%contact))
         call clock%stop('transient')
         call hand_on(system, options, motion, samples, recorder, error)
         if (motion%step >= next_point .and. .not. allocated(error)) then
            call keep_point(system, motion, record, recorder, clock, error)
            call clock%stop('write')
            if (.not. allocated(error)) call renew(system, contact_options, motion, solver, error)
            next_point = motion%step + options%restart_stride
            call clock%stop('transient start')
         end if
         call clock%stop('write')
         if (allocated(error)) exit
      end do
      record%steps = motion%step
      if (motion%largest_kinetic > 0.0_wp) record%balance_error = motion%largest_error/motion%largest_kinetic
      associate (e => motion%energy)
         through = max(motion%largest_kinetic, abs(e%external_work), e%viscous_loss + e%friction_loss)
      end associate
      if (through > 0.0_wp) record%unaccounted_energy = motion%largest_error/through
      if (allocated(error)) call keep_results(recorder, samples)
   end subroutine run_transient

   !> A solver that knows nothing but the contact state.
   subroutine renew(system, contact_options, motion, solver, error)
      type(jointed_system_t), intent(in) :: system
      type(contact_options_t), intent(in) :: contact_options
      type(motion_t), intent(in) :: motion
      class(contact_solver_t), allocatable, intent(out) :: solver
      type(error_t), allocatable, intent(out) :: error

      call new_contact_solver(contact_options, solver, error)
      if (allocated(error)) return
      solver%lazy = .true.
      call solver%start(system%problem, motion%contact, error)
   end subroutine renew

   !> Hand a restart point to the recorder.
   subroutine keep_point(system, motion, record, recorder, clock, error)
      type(jointed_system_t), intent(in) :: system
      type(motion_t), intent(inout) :: motion
      type(transient_record_t), intent(inout) :: record
      class(transient_recorder_t), intent(inout) :: recorder
      type(stopwatch_t), intent(inout) :: clock
      type(error_t), allocatable, intent(out) :: error
      type(archive_t) :: archive
      logical, allocatable :: potential(:)

      potential = potential_points(system)
      call archive%pass(potential)
      call motion%pass(archive)
      call pass_record(record, archive)
      call clock%pass(archive)
      call recorder%restart_point(archive, error)
   end subroutine keep_point

   !> Go back to a restart point.
   subroutine resume(system, motion, record, recorder, clock, point, error)
      type(jointed_system_t), intent(inout) :: system
      !> As the run began
      type(motion_t), intent(inout) :: motion
      type(transient_record_t), intent(inout) :: record
      class(transient_recorder_t), intent(inout) :: recorder
      type(stopwatch_t), intent(inout) :: clock
      integer, intent(in) :: point(:)
      type(error_t), allocatable, intent(out) :: error
      type(archive_t) :: archive
      logical, allocatable :: potential(:)

      call archive%load(point)
      call archive%pass(potential)
      call motion%pass(archive)
      call pass_record(record, archive)
      call clock%pass(archive)
      if (archive%sound()) then
         if (size(potential) /= system%grid_point_count()) call archive%refuse()
      end if
      if (.not. archive%sound()) then
         call failure(error, 'the restart point does not belong to this run')
         return
      end if
      call recorder%restart_point(archive, error)
      if (allocated(error)) return
      if (any(potential .neqv. potential_points(system))) call system%restrict(potential, error)
   end subroutine resume

   !> Store the record, or take it back.
   subroutine pass_record(record, archive)
      type(transient_record_t), intent(inout) :: record
      type(archive_t), intent(inout) :: archive

      call archive%pass(record%iterations)
      call archive%pass(record%rescues)
      call archive%pass(record%set_changes)
      call archive%pass(record%unconverged)
      call archive%pass(record%residual)
      call archive%pass(record%error_estimate)
      call archive%pass(record%points_added)
      call archive%pass(record%largest_slip)
   end subroutine pass_record

   !> The last step of the run, as far as it is known now.
   pure integer function last_step(options, motion)
      type(transient_options_t), intent(in) :: options
      type(motion_t), intent(in) :: motion
      real(wp) :: duration

      duration = options%duration
      if (duration <= 0.0_wp) duration = end_of_all(motion%excitations)
      last_step = ceiling(min(duration/options%time_step, most_steps)*(1.0_wp - 4.0_wp*epsilon(1.0_wp)))
   end function last_step

   !> Whether the steps can be counted.
   subroutine check_duration(options, motion, error)
      type(transient_options_t), intent(in) :: options
      !> As it begins
      type(motion_t), intent(in) :: motion
      type(error_t), allocatable, intent(out) :: error
      real(wp) :: duration

      duration = options%duration
      if (duration <= 0.0_wp) duration = end_of_all(motion%excitations)
      if (.not. duration/options%time_step <= most_steps) call failure(error, to_text(duration)//' s are more than '// &
         & to_text(most_steps)//' time steps of '//to_text(options%time_step)//' s')
   end subroutine check_duration

   !> The step at which the next snapshot is due: the first one not before its time.
   pure integer function next_snapshot(options, step)
      type(transient_options_t), intent(in) :: options
      integer, intent(in) :: step
      integer :: k

      next_snapshot = huge(1)
      if (.not. allocated(options%snapshots)) return
      do k = 1, size(options%snapshots)
         if (snapshot_step(options, k) > step) next_snapshot = min(next_snapshot, snapshot_step(options, k))
      end do
   end function next_snapshot

   !> The step of a snapshot.
   pure integer function snapshot_step(options, k)
      type(transient_options_t), intent(in) :: options
      integer, intent(in) :: k
      snapshot_step = ceiling(options%snapshots(k)/options%time_step*(1.0_wp - 4.0_wp*epsilon(1.0_wp)))
   end function snapshot_step

   !> The leapfrog is stable for omega_max dt < 2.
   subroutine check_time_step(system, time_step, error)
      type(jointed_system_t), intent(in) :: system
      real(wp), intent(in) :: time_step
      type(error_t), allocatable, intent(out) :: error

      if (time_step*system%highest_angular_frequency() >= 2.0_wp) then
         call failure(error, 'time step '//to_text(time_step)//' s is past the stability limit of the leapfrog, '// &
            & to_text(2.0_wp/system%highest_angular_frequency())//' s (2/omega_max of the retained modes)')
      end if
   end subroutine check_time_step

   !> Motion at time zero: equilibrium, v_0 = 0, v_{-1/2} half a step back.
   subroutine begin(system, start, options, motion, error)
      type(jointed_system_t), intent(in) :: system
      type(operating_state_t), intent(in) :: start
      type(transient_options_t), intent(in) :: options
      type(motion_t), intent(out) :: motion
      type(error_t), allocatable, intent(out) :: error
      real(wp) :: acceleration(system%n_modes)

      motion%d = start%modal
      motion%contact = start%contact
      motion%solved%converged = .true.
      call book_step(system%problem, start%contact, start%contact, motion%solved)
      motion%constant = start%amplitude
      motion%excitations = options%excitations
      motion%meter = options%meter
      allocate (motion%slipped(system%problem%n_points), source=.false.)
      if (motion%meter%excitation > 0) then
         call motion%meter%start(motion%excitations(motion%meter%excitation), options%time_step, &
            & size(system%sensor_modal, 2), error)
         if (allocated(error)) return
      end if
      motion%amplitude = load_amplitudes(motion%constant, motion%excitations, 0.0_wp)
      acceleration = matmul(system%load_modal, motion%amplitude) + motion%solved%reaction(:system%n_modes) &
         & - matmul(system%stiffness, motion%d)
      motion%v_before = -0.5_wp*options%time_step*acceleration
      call next_velocity(system, options%time_step, motion)
      motion%energy%kinetic = 0.5_wp*dot_product(motion%v_before, motion%v_after)
      motion%energy%elastic = elastic_energy(system, motion)
      motion%initial_energy = motion%energy%kinetic + motion%energy%elastic
      motion%energy%elastic = 0.0_wp
      call measure(system, options%time_step, motion)
   end subroutine begin

   !> v_{k+1/2} from v_{k-1/2} and the forces at t_k; Khat d_k is kept for the energy.
   pure subroutine next_velocity(system, dt, motion)
      type(jointed_system_t), intent(in) :: system
      real(wp), intent(in) :: dt
      type(motion_t), intent(inout) :: motion

      motion%restoring = matmul(system%stiffness, motion%d)
      motion%v_after = (matmul(system%load_modal, motion%amplitude) + motion%solved%reaction(:system%n_modes) &
         & - motion%restoring + (1.0_wp/dt - 0.5_wp*system%damping)*motion%v_before) &
         & /(1.0_wp/dt + 0.5_wp*system%damping)
   end subroutine next_velocity

   !> Energy stored in structure, boundary and half spaces: 1/2 d^T Khat d + 1/2 lambda^T G lambda, and the boundary's
   !> share under load amplitudes a, lambda^T R_a a + 1/2 a^T load_load a (imposed motions have none). The loads' potential
   !> is no part of it.
   pure real(wp) function elastic_energy(system, motion)
      type(jointed_system_t), intent(in) :: system
      type(motion_t), intent(in) :: motion
      elastic_energy = motion%solved%contact_energy &
         & + 0.5_wp*(dot_product(motion%d, motion%restoring) &
         & + dot_product(motion%amplitude, matmul(system%load_load, motion%amplitude))) &
         & + sum(motion%solved%reaction(system%n_modes + 1:)*motion%amplitude, .not. system%imposed)
   end function elastic_energy

   !> What the amplitudes do work on, (loads): displacements of loads, m; forces that drive imposed motions, -R^T lambda, N.
   pure function conjugates(system, motion) result(u)
      type(jointed_system_t), intent(in) :: system
      type(motion_t), intent(in) :: motion
      real(wp) :: u(system%n_loads)

      u = matmul(motion%d, system%load_modal) + matmul(system%load_load, motion%amplitude) &
         & + merge(-1.0_wp, 1.0_wp, system%imposed)*motion%solved%reaction(system%n_modes + 1:)
   end function conjugates

   !> Work of loads and imposed motions in a step, by trapezoids, J.
   pure real(wp) function work_of_step(system, motion, old_amplitude, old_conjugate) result(work)
      type(jointed_system_t), intent(in) :: system
      !> After the step
      type(motion_t), intent(in) :: motion
      !> (loads) before it
      real(wp), intent(in) :: old_amplitude(:), old_conjugate(:)
      real(wp) :: now(system%n_loads)

      now = conjugates(system, motion)
      work = 0.5_wp*(sum((old_amplitude + motion%amplitude)*(now - old_conjugate), .not. system%imposed) &
         & + sum((old_conjugate + now)*(motion%amplitude - old_amplitude), system%imposed))
   end function work_of_step

   !> Integrate to step `block_end`, or to where the motion turns.
   subroutine advance_block(system, options, block_end, solver, motion, samples, record, recorder, error)
      type(jointed_system_t), intent(in) :: system
      type(transient_options_t), intent(in) :: options
      integer, intent(in) :: block_end
      class(contact_solver_t), intent(inout) :: solver
      type(motion_t), intent(inout) :: motion
      type(sample_t), allocatable, intent(inout) :: samples(:)
      type(transient_record_t), intent(inout) :: record
      class(transient_recorder_t), intent(inout) :: recorder
      type(error_t), allocatable, intent(out) :: error

      do while (motion%step < min(block_end, last_step(options, motion)))
         call take_step(system, options, solver, motion)
         associate (solved => motion%solved)
            record%iterations = record%iterations + solved%iterations
            record%rescues = record%rescues + solved%rescues
            record%set_changes = record%set_changes + solved%set_changes
            record%residual = max(record%residual, solved%residual)
            record%error_estimate = max(record%error_estimate, solved%error_estimate)
            if (.not. solved%converged) record%unconverged = record%unconverged + 1
         end associate
         motion%largest_error = max(motion%largest_error, abs(motion%energy%balance_error))
         if (.not. all(abs(motion%d) < huge(1.0_wp))) then
            call failure(error, 'transient: the motion is no longer finite at '// &
               & to_text(motion%step*options%time_step)//' s')
            return
         end if
         if (mod(motion%step, options%stride) == 0) call add_sample(system, options, motion, samples)
         call recorder%progress(motion%step*options%time_step, motion%solved%counts)
         if (motion%turned) exit
      end do
   end subroutine advance_block

   !> One step, energy books included.
   subroutine take_step(system, options, solver, motion)
      type(jointed_system_t), intent(in) :: system
      type(transient_options_t), intent(in) :: options
      class(contact_solver_t), intent(inout) :: solver
      type(motion_t), intent(inout) :: motion
      real(wp), allocatable :: old_amplitude(:), old_conjugate(:), old_velocity(:)
      real(wp) :: dt, kinetic_before

      dt = options%time_step
      old_amplitude = motion%amplitude
      old_conjugate = conjugates(system, motion)
      old_velocity = 0.5_wp*(motion%v_before + motion%v_after)

      motion%v_before = motion%v_after
      motion%d = motion%d + dt*motion%v_before
      motion%step = motion%step + 1
      motion%amplitude = load_amplitudes(motion%constant, motion%excitations, motion%step*dt)

      call solver%advance(system%problem, [motion%d, motion%amplitude], motion%contact, motion%solved)
      call next_velocity(system, dt, motion)

      associate (e => motion%energy)
         kinetic_before = e%kinetic
         e%kinetic = 0.5_wp*dot_product(motion%v_before, motion%v_after)
         motion%turned = motion%slowing .and. e%kinetic > kinetic_before
         motion%slowing = e%kinetic < kinetic_before
         e%elastic = elastic_energy(system, motion) - motion%initial_energy
         e%external_work = e%external_work + work_of_step(system, motion, old_amplitude, old_conjugate)
         e%viscous_loss = e%viscous_loss + dt*dot_product(motion%v_before, &
            & 0.5_wp*system%damping*(old_velocity + 0.5_wp*(motion%v_before + motion%v_after)))
         e%friction_loss = e%friction_loss + motion%solved%friction_loss
         e%balance_error = e%external_work - e%viscous_loss - e%friction_loss - (e%kinetic + e%elastic)
         motion%largest_kinetic = max(motion%largest_kinetic, e%kinetic)
      end associate
      where (motion%contact%status == state_slip) motion%slipped = .true.
      call measure(system, dt, motion)
   end subroutine take_step

   !> The harmonics of the sensors take the present step.
   subroutine measure(system, dt, motion)
      type(jointed_system_t), intent(in) :: system
      real(wp), intent(in) :: dt
      type(motion_t), intent(inout) :: motion

      if (motion%meter%excitation == 0) return
      call motion%meter%observe(motion%excitations(motion%meter%excitation), motion%step*dt, dt, sensors_of(system, motion))
   end subroutine measure

   !> Displacements at the sensors, (sensors), m.
   function sensors_of(system, motion) result(u)
      type(jointed_system_t), intent(in) :: system
      type(motion_t), intent(in) :: motion
      real(wp) :: u(size(system%sensor_modal, 2))

      u = matmul(motion%d, system%sensor_modal) + matmul(motion%amplitude, system%sensor_load) + motion%solved%output
   end function sensors_of

   !> What is recorded of the present step.
   function sample_of(system, motion, options) result(sample)
      type(jointed_system_t), intent(in) :: system
      type(motion_t), intent(in) :: motion
      type(transient_options_t), intent(in) :: options
      type(sample_t) :: sample

      sample%step = motion%step
      sample%time = motion%step*options%time_step
      sample%modal = motion%d
      sample%sensor = sensors_of(system, motion)
      sample%energy = motion%energy
      sample%counts = motion%solved%counts
      sample%iterations = motion%solved%iterations
      sample%residual = motion%solved%residual
      sample%converged = motion%solved%converged
   end function sample_of

   !> Go back to a safe motion after the potential contact set has grown.
   subroutine resume_from(system, safe, solver, motion, samples, error)
      type(jointed_system_t), intent(in) :: system
      type(motion_t), intent(in) :: safe
      class(contact_solver_t), intent(inout) :: solver
      type(motion_t), intent(out) :: motion
      type(sample_t), allocatable, intent(inout) :: samples(:)
      type(error_t), allocatable, intent(out) :: error
      real(wp), allocatable :: gap(:, :)
      integer :: p, old

      motion = safe
      samples = pack_before(samples, safe%step)
      associate (contact => motion%contact, previous => system%previous_index)
         deallocate (contact%force, contact%gap, contact%status)
         allocate (contact%force(3, system%problem%n_points), source=0.0_wp)
         allocate (contact%status(system%problem%n_points), source=state_open)
         do p = 1, system%problem%n_points
            if (previous(p) > 0) contact%force(:, p) = safe%contact%force(:, previous(p))
         end do
         gap = gap_of(system%problem, contact%q, contact%force)
         contact%gap = gap
         do p = 1, system%problem%n_points
            old = previous(p)
            if (old == 0) cycle
            contact%status(p) = safe%contact%status(old)
            if (contact%status(p) /= state_open) contact%gap(:, p) = safe%contact%gap(:, old)
         end do
      end associate
      motion%slipped = [(system%previous_index(p) > 0, p=1, system%problem%n_points)]
      where (motion%slipped) motion%slipped = safe%slipped(max(1, system%previous_index))
      call solver%start(system%problem, motion%contact, error)
   end subroutine resume_from

   !> The present step becomes a sample. (By an array constructor gfortran 12 would lose its memory.)
   subroutine add_sample(system, options, motion, samples)
      type(jointed_system_t), intent(in) :: system
      type(transient_options_t), intent(in) :: options
      type(motion_t), intent(in) :: motion
      type(sample_t), allocatable, intent(inout) :: samples(:)
      type(sample_t), allocatable :: longer(:)
      integer :: n

      n = size(samples)
      allocate (longer(n + 1))
      longer(:n) = samples
      longer(n + 1) = sample_of(system, motion, options)
      call move_alloc(longer, samples)
   end subroutine add_sample

   !> The samples up to a step.
   pure function pack_before(samples, step) result(kept)
      type(sample_t), intent(in) :: samples(:)
      integer, intent(in) :: step
      type(sample_t), allocatable :: kept(:)
      integer :: k

      kept = samples(:count([(samples(k)%step <= step, k=1, size(samples))]))
   end function pack_before

   !> Verified samples and snapshots go to the recorder.
   subroutine hand_on(system, options, motion, samples, recorder, error)
      type(jointed_system_t), intent(in) :: system
      type(transient_options_t), intent(in) :: options
      type(motion_t), intent(inout) :: motion
      type(sample_t), allocatable, intent(inout) :: samples(:)
      class(transient_recorder_t), intent(inout) :: recorder
      type(error_t), allocatable, intent(out) :: error

      call recorder%record(samples, error)
      samples = samples(:0)
      if (allocated(error)) return
      call recorder%verified(system, motion%contact, motion%slipped)
      motion%slipped = .false.
      if (motion%meter%excitation > 0) then
         if (size(motion%meter%done) > 0) call recorder%harmonics(motion%meter%done, error)
         if (allocated(error)) return
         motion%meter%done = motion%meter%done(:0)
      end if
      call take_snapshots(system, options, motion, recorder, error)
   end subroutine hand_on

   !> Snapshots that are due at the present step go to the recorder.
   subroutine take_snapshots(system, options, motion, recorder, error)
      type(jointed_system_t), intent(in) :: system
      type(transient_options_t), intent(in) :: options
      type(motion_t), intent(in) :: motion
      class(transient_recorder_t), intent(inout) :: recorder
      type(error_t), allocatable, intent(out) :: error
      integer :: k

      if (.not. allocated(options%snapshots)) return
      do k = 1, size(options%snapshots)
         if (snapshot_step(options, k) /= motion%step) cycle
         call recorder%snapshot(system, motion%step*options%time_step, motion%contact, error)
         if (allocated(error)) return
      end do
   end subroutine take_snapshots

   !> A failed run hands on what it has.
   subroutine keep_results(recorder, samples)
      class(transient_recorder_t), intent(inout) :: recorder
      type(sample_t), intent(in) :: samples(:)
      type(error_t), allocatable :: ignored

      call recorder%record(samples, ignored)
   end subroutine keep_results

end module microslip_analysis_transient
