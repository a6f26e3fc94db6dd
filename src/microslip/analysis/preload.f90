!> Preload: static equilibrium under loads that are scaled until every interface carries its normal force.
!>
!> Statics of the reduced model with d_i eliminated (`microslip_analysis_statics`).
!> Friction has a memory: the loads grow in proportion, in the given number of equal steps, each one an equilibrium. Where
!> interface forces are given, they are those at the end of this path: the amplitudes there are found by Broyden's method,
!> started from the frictionless contact, and every trial goes the whole path. So it is the path of the same amplitudes given.
!> Normal contact in statics is on gap level.
!>
!> Where the structure can move freely but for its contact, springs hold it that carry nothing in the end
!> (`microslip_analysis_free_motion`).
!>
!> An initial pressure is on before the first load: r_0 = -G_static lambda_0, and in the modes lambda - lambda_0 takes the
!> place of lambda. Energies then count from the undeformed state.
module microslip_analysis_preload
   use microslip_analysis_free_motion, only: free_motion_t
   use microslip_analysis_operating_state, only: operating_state_t
   use microslip_analysis_statics, only: static_modal, static_problem
   use microslip_contact_closed_system, only: closed_system_t, state_frictionless
   use microslip_contact_condensed, only: condensed_solver_t
   use microslip_contact_factory, only: contact_options_t, knows_soft, new_contact_solver
   use microslip_contact_frictionless, only: solve_beside_soft, solve_frictionless, solve_frictionless_by_operator
   use microslip_contact_laws, only: state_open
   use microslip_contact_matrix_free, only: matrix_free_solver_t
   use microslip_contact_problem, only: contact_problem_t, contact_state_t, solve_record_t, contact_solver_t, &
      & new_state, gap_of, free_gap, friction_work, settled_amplitude
   use microslip_core_error, only: error_t, failure
   use microslip_core_kinds, only: wp
   use microslip_core_text, only: to_text
   use microslip_linalg_dense, only: cholesky_factor, cholesky_solve, solve_general
   use microslip_system_jointed_system, only: jointed_system_t
   implicit none(type, external)
   private

   public :: preload_options_t, preload_record_t, run_preload, frictionless_preload

   !> Relative accuracy of the interface forces.
   real(wp), parameter :: force_tolerance = 1.0e-9_wp
   !> The same for the frictionless guess where it is found by iteration.
   real(wp), parameter :: rough_force_tolerance = 1.0e-5_wp
   integer, parameter :: max_trials = 30

   type :: preload_options_t
      !> Loads to be scaled (indices of the system's loads)
      integer, allocatable :: loads(:)
      !> (pads) N, normal force of each interface; as many as `loads`. Not allocated: `scale` is given
      real(wp), allocatable :: interface_force(:)
      !> (loads) given amplitudes
      real(wp), allocatable :: scale(:)
      !> Load steps, in which the loads grow in proportion
      integer :: steps = 1
   end type preload_options_t

   !> How the preload went.
   type :: preload_record_t
      !> Contact solves and iterations in them
      integer :: solves = 0, iterations = 0
      !> Of the last solve: see `solve_record_t`; the residual includes what gap = r_0 + R a + G lambda misses
      real(wp) :: residual = 0.0_wp, error_estimate = 0.0_wp
      !> Largest relative deviation of an interface force from what was asked
      real(wp) :: force_deviation = 0.0_wp
      !> (pads) N
      real(wp), allocatable :: interface_force(:)
      !> Elastic energy of structure and contact, and work of the loads on the way, J (balance: work - energy -
      !> friction loss; trapezoidal over the load steps)
      real(wp) :: elastic_energy = 0.0_wp, work = 0.0_wp, friction_loss = 0.0_wp
   end type preload_record_t

contains

   !> Load amplitudes and closed points of the frictionless preload.
   subroutine frictionless_preload(system, problem, options, share, amplitude, closed, force, slope, error)
      type(jointed_system_t), intent(in) :: system
      !> Static problem of the same loads
      type(contact_problem_t), intent(in) :: problem
      type(preload_options_t), intent(in) :: options
      !> Part of the load that is applied
      real(wp), intent(in) :: share
      !> (loads) start value (zero: none) in, amplitudes out
      real(wp), intent(inout) :: amplitude(:)
      !> (points)
      logical, intent(inout) :: closed(:)
      !> (points) normal forces, N
      real(wp), intent(out) :: force(:)
      !> (pads, loads) derivative of the interface forces by the amplitudes, N
      real(wp), intent(out) :: slope(:, :)
      type(error_t), allocatable, intent(out) :: error
      real(wp), allocatable :: G(:, :), R(:, :), sensitivity(:, :), step(:, :), matrix(:, :), r_0(:), soft(:, :), soft_free(:, :)
      type(closed_system_t) :: normal
      real(wp) :: deviation(size(system%pads)), wanted
      integer :: trial

      R = problem%R(1::3, :size(amplitude))
      r_0 = problem%r_0(1::3)
      wanted = force_tolerance
      if (allocated(problem%compliance)) then
         wanted = rough_force_tolerance
         call normal%set_up(problem%compliance, problem%friction, spread(state_frictionless, 1, problem%n_points), problem%soft)
         call normal%learn(problem%compliance, error)
         if (allocated(error)) return
      else
         G = problem%G(1::3, 1::3)
      end if
      if (allocated(problem%soft)) then
         soft = problem%soft(1::3, :)
         allocate (soft_free(size(soft, 2), 1 + size(amplitude)))
         soft_free(:, 2:) = problem%soft_drive
      else
         allocate (soft_free(0, 1 + size(amplitude)))
      end if
      force = 0.0_wp
      allocate (sensitivity(size(force), size(amplitude)))
      if (allocated(options%scale)) amplitude = share*options%scale
      do trial = 1, max_trials
         if (allocated(options%interface_force) .and. all(amplitude == 0.0_wp)) then
            ! First guess: all points closed and the surface flat, one load for all interfaces.
            call tied_guess(system, problem, normal, share*options%interface_force, amplitude, error)
            if (allocated(error)) return
            closed = free_normal_gap(problem, amplitude) < 0.0_wp
         end if
         if (allocated(soft)) soft_free(:, 1) = problem%soft_0 + matmul(problem%soft_drive, amplitude)
         if (allocated(problem%compliance)) then
            call solve_frictionless_by_operator(problem%compliance, normal, r_0 + matmul(R, amplitude), R, closed, force, &
               & sensitivity, error, soft_free)
         else
            call solve_frictionless(G, r_0 + matmul(R, amplitude), R, closed, force, sensitivity, error, soft, soft_free)
         end if
         if (allocated(error)) return
         slope = sums_over_pads(system, sensitivity)
         if (allocated(options%scale)) return
         deviation = share*options%interface_force &
            & - reshape(sums_over_pads(system, reshape(force, [size(force), 1])), [size(system%pads)])
         if (maxval(abs(deviation)) <= wanted*share*maxval(options%interface_force)) return
         matrix = slope
         step = reshape(deviation, [size(deviation), 1])
         call solve_general(matrix, step, error)
         if (allocated(error)) then
            call failure(error, 'preload: the loads do not press the interfaces together')
            return
         end if
         amplitude = amplitude + step(:, 1)
      end do
      call failure(error, 'preload: the interface forces cannot be reached without friction')
   end subroutine frictionless_preload

   !> Normal gaps without contact forces, (points), m.
   pure function free_normal_gap(problem, amplitude) result(gap)
      type(contact_problem_t), intent(in) :: problem
      real(wp), intent(in) :: amplitude(:)
      real(wp) :: gap(problem%n_points), whole(3*problem%n_points), drivers(size(problem%R, 2))

      ! Anchors of free motions, which come after the loads, stay where they are.
      drivers = 0.0_wp
      drivers(:size(amplitude)) = amplitude
      whole = free_gap(problem, drivers)
      gap = whole(1::3)
   end function free_normal_gap

   !> Amplitudes that would give the interface forces if all points were closed on a flat surface.
   subroutine tied_guess(system, problem, normal, target_force, amplitude, error)
      type(jointed_system_t), intent(in) :: system
      type(contact_problem_t), intent(in) :: problem
      !> Normal contact, where the compliance is an operator
      type(closed_system_t), intent(inout) :: normal
      real(wp), intent(in) :: target_force(:)
      real(wp), intent(out) :: amplitude(:)
      type(error_t), allocatable, intent(out) :: error
      real(wp), allocatable :: factor(:, :), x(:, :), step(:, :), matrix(:, :), V(:, :), z(:, :)

      if (allocated(problem%soft)) then
         z = problem%soft_drive
      else
         allocate (z(0, size(amplitude)))
      end if
      if (allocated(problem%compliance)) then
         allocate (x(size(problem%R, 1), size(amplitude)))
         call normal%solve_columns(problem%compliance, -problem%R(:, :size(amplitude)), x, error, balance=z)
         if (allocated(error)) return
         x = x(1::3, :)
      else
         factor = problem%G(1::3, 1::3)
         call cholesky_factor(factor, error)
         if (allocated(error)) then
            error%message = 'preload: contact compliance is not positive definite: '//error%message
            return
         end if
         x = -problem%R(1::3, :size(amplitude))
         call cholesky_solve(factor, x)
         if (allocated(problem%soft)) then
            V = problem%soft(1::3, :)
            call solve_beside_soft(factor, V, x, z, error)
            if (allocated(error)) return
         end if
      end if
      matrix = sums_over_pads(system, x)
      step = reshape(target_force, [size(target_force), 1])
      call solve_general(matrix, step, error)
      if (allocated(error)) then
         call failure(error, 'preload: the loads do not press the interfaces together')
         return
      end if
      amplitude = step(:, 1)
   end subroutine tied_guess

   !> Sums of the rows of `values` over the points of every pad, (pads, columns).
   pure function sums_over_pads(system, values) result(total)
      type(jointed_system_t), intent(in) :: system
      !> (points, columns)
      real(wp), intent(in) :: values(:, :)
      real(wp) :: total(size(system%pads), size(values, 2))
      integer :: k

      do k = 1, size(system%pads)
         associate (first => system%pads(k)%point_offset)
            total(k, :) = sum(values(first + 1:first + size(system%pads(k)%potential), :), dim=1)
         end associate
      end do
   end function sums_over_pads

   !> Find the equilibrium under the preload.
   subroutine run_preload(system, options, contact, state, record, error)
      type(jointed_system_t), intent(in) :: system
      type(preload_options_t), intent(in) :: options
      type(contact_options_t), intent(in) :: contact
      type(operating_state_t), intent(out) :: state
      type(preload_record_t), intent(out) :: record
      type(error_t), allocatable, intent(out) :: error
      type(contact_problem_t) :: problem
      type(contact_state_t) :: start, now
      type(free_motion_t) :: free
      class(contact_solver_t), allocatable :: solver
      real(wp), allocatable :: response(:, :), amplitude(:), slope(:, :), step(:, :), matrix(:, :), deviation(:), first_force(:, :)
      logical, allocatable :: closed(:)
      integer :: trial

      call static_problem(system, options%loads, problem, response, error, knows_soft(contact), free)
      if (allocated(error)) return
      call guess(system, problem, options, amplitude, closed, slope, error)
      if (allocated(error)) return
      start = new_state(problem, system%initial_force())
      call new_contact_solver(contact, solver, error)
      if (allocated(error)) return
      select type (solver)
      type is (condensed_solver_t)
         solver%expected_closed = closed
      type is (matrix_free_solver_t)
         solver%expected_closed = closed
      end select
      call solver%start(problem, start, error)
      if (allocated(error)) return
      do trial = 1, max_trials
         call load(problem, free, options, contact, amplitude, solver, start, now, first_force, record, error)
         if (allocated(error)) return
         record%interface_force = system%interface_forces(now%force)
         if (allocated(options%scale)) exit
         deviation = options%interface_force - record%interface_force
         record%force_deviation = maxval(abs(deviation)/options%interface_force)
         if (record%force_deviation <= force_tolerance) exit
         ! Broyden: the change that the last step left unexplained improves the slope.
         if (trial > 1) slope = slope - matmul(reshape(deviation, [size(deviation), 1]), transpose(step))/sum(step**2)
         matrix = slope
         step = reshape(deviation, [size(deviation), 1])
         call solve_general(matrix, step, error)
         if (allocated(error)) return
         amplitude = amplitude + step(:, 1)
         select type (solver)
         type is (matrix_free_solver_t)
            solver%expected_force = first_force
         end select
      end do
      if (trial > max_trials) then
         call failure(error, 'preload: the interface forces were not reached (deviation '// &
            & to_text(record%force_deviation)//')')
         return
      end if
      call finish(system, options, problem, response, free, now, state, record)
   end subroutine run_preload

   !> From the contact without friction: load amplitudes, how the interface forces change with them, and the points that
   !> close in the first load step.
   subroutine guess(system, problem, options, amplitude, closed, slope, error)
      type(jointed_system_t), intent(in) :: system
      type(contact_problem_t), intent(in) :: problem
      type(preload_options_t), intent(in) :: options
      !> (loads), (points), (pads, loads)
      real(wp), allocatable, intent(out) :: amplitude(:)
      logical, allocatable, intent(out) :: closed(:)
      real(wp), allocatable, intent(out) :: slope(:, :)
      type(error_t), allocatable, intent(out) :: error
      type(preload_options_t) :: first
      real(wp), allocatable :: part(:), other_slope(:, :)
      real(wp) :: force(problem%n_points)

      allocate (amplitude(size(options%loads)), source=0.0_wp)
      allocate (slope(size(system%pads), size(options%loads)))
      allocate (closed(problem%n_points), source=.true.)
      if (allocated(options%scale)) then
         amplitude = options%scale
      else
         call frictionless_preload(system, problem, options, 1.0_wp, amplitude, closed, force, slope, error)
         if (allocated(error) .or. options%steps == 1) return
      end if
      first%loads = options%loads
      first%scale = amplitude
      closed = .true.
      allocate (other_slope, mold=slope)
      part = amplitude
      call frictionless_preload(system, problem, first, 1.0_wp/options%steps, part, closed, force, other_slope, error)
   end subroutine guess

   !> Apply the loads in equal steps, each one an equilibrium with friction.
   subroutine load(problem, free, options, contact, amplitude, solver, start, now, first_force, record, error)
      type(contact_problem_t), intent(in) :: problem
      type(free_motion_t), intent(in) :: free
      type(preload_options_t), intent(in) :: options
      type(contact_options_t), intent(in) :: contact
      !> (loads) in the end
      real(wp), intent(in) :: amplitude(:)
      !> Started from the beginning, and the contact there: both are left as they are, friction must not remember trials
      class(contact_solver_t), allocatable, intent(in) :: solver
      type(contact_state_t), intent(in) :: start
      !> In the end
      type(contact_state_t), intent(out) :: now
      !> (3, points) contact forces of the first step, N
      real(wp), allocatable, intent(out) :: first_force(:, :)
      !> Energies count from the beginning
      type(preload_record_t), intent(inout) :: record
      type(error_t), allocatable, intent(out) :: error
      class(contact_solver_t), allocatable :: working
      type(contact_state_t) :: before
      type(solve_record_t) :: solved
      logical :: held
      integer :: step

      allocate (working, source=solver)
      now = start
      record%work = 0.0_wp
      record%friction_loss = 0.0_wp
      do step = 1, options%steps
         before = now
         call free%advance(problem, working, amplitude*(real(step, wp)/options%steps), now, solved, held)
         record%solves = record%solves + 1
         record%iterations = record%iterations + solved%iterations
         record%residual = solved%residual
         record%error_estimate = solved%error_estimate
         if (.not. held) then
            call failure(error, 'preload: the structure moves freely: nothing but the contact could hold it, and under these ' &
               & //'loads it lifts off or slides away; it needs supports, bolts, or loads that press it on')
         else if (.not. solved%converged) then
            call failure(error, 'preload: the contact did not converge (residual '//to_text(solved%residual)// &
               & ' of the largest force after '//to_text(solved%iterations)//' iterations); '// &
               & what_may_help(problem, options, contact, solved))
         end if
         if (allocated(error)) return
         call book_energy(problem, before, now, now%q, record)
         if (step == 1) first_force = now%force
      end do
   end subroutine load

   !> What a contact that did not converge may need and does not have yet.
   function what_may_help(problem, options, contact, solved) result(text)
      type(contact_problem_t), intent(in) :: problem
      type(preload_options_t), intent(in) :: options
      type(contact_options_t), intent(in) :: contact
      type(solve_record_t), intent(in) :: solved
      character(len=:), allocatable :: text

      text = ''
      if (solved%iterations >= contact%max_iterations) text = 'a larger max_iterations in &contact (now '// &
         & to_text(contact%max_iterations)//'), '
      if (any(problem%friction > 0.0_wp)) text = text//'more load steps (steps in &preload, now '//to_text(options%steps)//'), '
      if (all(contact%solver /= [character(len=17) :: 'condensed', 'matrix_free'])) text = text// &
         & "solver = 'condensed' in &contact, "
      if (contact%solver == 'matrix_free') text = text//"compliance = 'dense' in &contact, "
      text = text//'or a larger tolerance in &contact (now '//to_text(contact%tolerance, 2)//') may help'
   end function what_may_help

   !> Work of the loads' free gap on the contact forces and friction loss of one load step, trapezoidal.
   subroutine book_energy(problem, before, after, amplitude, record)
      type(contact_problem_t), intent(in) :: problem
      type(contact_state_t), intent(in) :: before, after
      real(wp), intent(in) :: amplitude(:)
      type(preload_record_t), intent(inout) :: record
      real(wp), allocatable :: slip(:, :), moved(:)
      integer :: p

      slip = gap_of(problem, after%q, after%force) - gap_of(problem, before%q, before%force)
      do p = 1, problem%n_points
         record%friction_loss = record%friction_loss + friction_work(after%status(p), problem%friction(p), before%force(1, p), &
            & after%force(:, p), slip(2:3, p))
      end do
      moved = free_gap(problem, amplitude) - free_gap(problem, before%q)
      record%work = record%work - 0.5_wp*dot_product(reshape(before%force + after%force, [size(after%force)]), moved)
   end subroutine book_energy

   !> The static solution as an operating state of the whole system.
   subroutine finish(system, options, problem, response, free, now, state, record)
      type(jointed_system_t), intent(in) :: system
      type(preload_options_t), intent(in) :: options
      type(contact_problem_t), intent(in) :: problem
      real(wp), intent(in) :: response(:, :)
      type(free_motion_t), intent(in) :: free
      type(contact_state_t), intent(in) :: now
      type(operating_state_t), intent(out) :: state
      type(preload_record_t), intent(inout) :: record
      real(wp), allocatable :: gap(:, :), local(:)
      real(wp) :: in_springs
      integer :: p

      if (allocated(problem%compliance)) then
         gap = problem%compliance%local_stiffness()
         local = 1.0_wp/gap(1, :)
      else
         local = [(problem%G(3*p - 2, 3*p - 2), p=1, problem%n_points)]
      end if
      state%amplitude = system%held
      state%amplitude(options%loads) = now%q(:size(options%loads))
      state%modal = static_modal(system, response, now%q(:size(options%loads)), now%force)
      if (free%count > 0) state%modal = state%modal + matmul(free%shape, now%q(size(options%loads) + 1:))
      state%contact = now
      state%contact%q = [state%modal, state%amplitude]
      ! Points outside the solver's base set know their normal gap only.
      gap = gap_of(problem, now%q, now%force, settled_amplitude(problem, now))
      do p = 1, problem%n_points
         if (now%status(p) == state_open) then
            state%contact%gap(:, p) = gap(:, p)
         else
            record%residual = max(record%residual, maxval(abs(gap(:, p) - now%gap(:, p)))/ &
               & (local(p)*maxval(now%force)))
         end if
      end do
      record%elastic_energy = 0.5_wp*sum(now%force*(gap - reshape(free_gap(problem, now%q), [3, problem%n_points]))) &
         & + 0.5_wp*sum(system%initial_force()*reshape(free_gap(problem, 0.0_wp*now%q), [3, problem%n_points]))
      if (free%count == 0) return
      ! What the springs of free motions hold is no energy of the structure.
      in_springs = 0.5_wp*(sum(matmul(reshape(now%force, [size(now%force)]), free%contact)**2) &
         & - sum(matmul(reshape(system%initial_force(), [size(now%force)]), free%contact)**2))/free%spring
      record%elastic_energy = record%elastic_energy - in_springs
      record%work = record%work - in_springs
   end subroutine finish

end module microslip_analysis_preload
