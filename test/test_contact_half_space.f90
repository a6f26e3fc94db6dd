!> Contact mechanics on the half space alone: Hertz, Cattaneo-Mindlin, invariances, history, energy.
module test_contact_half_space
   use microslip_contact_condensed, only: condensed_solver_t
   use microslip_contact_laws, only: state_open, state_stick, state_slip
   use microslip_contact_plain_jacobi, only: plain_jacobi_t
   use microslip_contact_problem, only: contact_problem_t, contact_state_t, solve_record_t, new_state, &
      & count_states
   use microslip_core_error, only: mslip_error => error_t
   use microslip_core_kinds, only: wp, pi
   use microslip_halfspace_love_cerruti, only: material_t, elastic_material, rigid_material, half_space_pair_t, half_space_pair
   use support_half_space, only: spheres_t, new_spheres, new_quarter, press, press_frictionless, hertz_force, hertz_pressure, &
      & stick_stiffness, violation
   use testdrive, only: new_unittest, unittest_type, error_type, check
   implicit none(type, external)
   private

   public :: collect_contact_half_space

   !> Effective radius of curvature and contact radius, m; Young's modulus, N/m^2.
   real(wp), parameter :: curvature_radius = 0.1_wp, contact_radius = 1.0e-3_wp, young = 2.0e11_wp
   real(wp), parameter :: friction = 0.5_wp
   !> Accuracy of the forces that the solvers are asked for (their default).
   real(wp), parameter :: solver_tolerance = 1.0e-10_wp
   !> Errors of single steps add up over a path of up to 100 steps.
   real(wp), parameter :: path_tolerance = 100*solver_tolerance

contains

   subroutine collect_contact_half_space(testsuite)
      type(unittest_type), allocatable, intent(out) :: testsuite(:)
      testsuite = [ &
         & new_unittest('Hertz', test_hertz), &
         & new_unittest('Cattaneo-Mindlin', test_cattaneo_mindlin), &
         & new_unittest('a quarter equals the whole', test_quarter), &
         & new_unittest('units and modulus scale out', test_scaling), &
         & new_unittest('mirrored loads give mirrored forces', test_mirror), &
         & new_unittest('bodies exchanged: action and reaction', test_exchange), &
         & new_unittest('unequal materials obey the laws', test_unequal_materials), &
         & new_unittest('condensed equals plain Jacobi', test_condensed_equals_plain), &
         & new_unittest('a new contact has no memory', test_new_contact), &
         & new_unittest('energy balance', test_energy)]
   end subroutine collect_contact_half_space

   !> Two bodies of one material.
   function equal_pair(poisson_ratio, modulus) result(pair)
      real(wp), intent(in) :: poisson_ratio
      real(wp), intent(in), optional :: modulus
      type(half_space_pair_t) :: pair
      type(material_t) :: body
      type(mslip_error), allocatable :: error
      real(wp) :: e

      e = young
      if (present(modulus)) e = modulus
      call elastic_material(body, e, poisson_ratio, error)
      pair = half_space_pair(body, body)
   end function equal_pair

   !> An elastic body against a rigid one: the strongest coupling of n and t that a Poisson's ratio of 0.2 gives.
   function unequal_pair(exchanged) result(pair)
      !> The rigid body is A instead of B
      logical, intent(in) :: exchanged
      type(half_space_pair_t) :: pair
      type(material_t) :: body
      type(mslip_error), allocatable :: error

      call elastic_material(body, young, 0.2_wp, error)
      if (exchanged) then
         pair = half_space_pair(rigid_material(), body)
      else
         pair = half_space_pair(body, rigid_material())
      end if
   end function unequal_pair

   !> Press at half the approach, to the full one, shear along a direction and half way back, (3, steps).
   pure function press_and_shear(spheres, direction) result(path)
      type(spheres_t), intent(in) :: spheres
      real(wp), intent(in) :: direction(2)
      real(wp) :: path(3, 6)
      real(wp) :: sliding
      integer :: k
      real(wp), parameter :: approach(6) = [0.5_wp, 1.0_wp, 1.0_wp, 0.9_wp, 0.9_wp, 0.9_wp]
      real(wp), parameter :: shear(6) = [0.0_wp, 0.0_wp, 0.3_wp, 0.7_wp, 0.2_wp, -0.4_wp]

      ! The displacement where sliding begins, (3/2) mu P / (8 a / B).
      sliding = 1.5_wp*friction*hertz_force(spheres)/stick_stiffness(spheres)
      do k = 1, size(path, 2)
         path(:, k) = [approach(k)*spheres%approach, shear(k)*sliding*direction]
      end do
   end function press_and_shear

   !> Follow a path with the condensed solver.
   subroutine follow(problem, path, state, error, worst_violation, length, tolerance)
      type(contact_problem_t), intent(in) :: problem
      !> (3, steps) drivers
      real(wp), intent(in) :: path(:, :)
      type(contact_state_t), intent(out) :: state
      type(error_type), allocatable, intent(out) :: error
      !> Of the laws, over all steps, displacements measured by `length`
      real(wp), intent(out), optional :: worst_violation
      real(wp), intent(in), optional :: length
      !> Of the solver, instead of its own
      real(wp), intent(in), optional :: tolerance
      type(condensed_solver_t) :: solver
      type(contact_state_t) :: before
      type(solve_record_t) :: record
      type(mslip_error), allocatable :: failure
      integer :: k

      state = new_state(problem)
      if (present(tolerance)) solver%tolerance = tolerance
      call solver%start(problem, state, failure)
      call check(error,.not. allocated(failure), 'start failed')
      if (allocated(error)) return
      if (present(worst_violation)) worst_violation = 0.0_wp
      do k = 1, size(path, 2)
         before = state
         call solver%advance(problem, path(:, k), state, record)
         call check(error, record%converged, 'not converged')
         if (allocated(error)) return
         if (present(worst_violation)) worst_violation = max(worst_violation, violation(problem, before, state, length))
      end do
   end subroutine follow

   !> Force and peak pressure converge with the square of the cell width: the cell centres next to the middle lie
   !> cell/sqrt(2) off, where the pressure is p_0 (1 - (cell/a)^2/4); the force, a mean, is better than
   !> that. The circle of contact is right to half a cell, and better by the averaging along the circle.
   subroutine test_hertz(error)
      type(error_type), allocatable, intent(out) :: error
      integer, parameter :: cells(4) = [5, 10, 20, 40]
      type(spheres_t) :: spheres
      logical, allocatable :: closed(:)
      real(wp), allocatable :: force(:)
      real(wp) :: deviation(3)
      logical :: settled
      integer :: k

      do k = 1, size(cells)
         call new_quarter(spheres, equal_pair(0.3_wp), curvature_radius, contact_radius, cells(k), friction)
         call press_frictionless(spheres, closed, force, settled)
         call check(error, settled, 'not settled')
         if (allocated(error)) return
         deviation = abs([spheres%images*sum(force)/hertz_force(spheres), &
            & maxval(force)/spheres%cell**2/hertz_pressure(spheres), spheres%radius_of(closed)/contact_radius] - 1.0_wp)
         call check(error, all(deviation <= [0.25_wp/cells(k)**2, 0.25_wp/cells(k)**2, 0.5_wp/cells(k)]), &
            & 'force, peak pressure or radius off')
         if (allocated(error)) return
      end do
      call check(error, all(deviation < 1.0e-2_wp), 'more than 1 % off at 40 cells per radius')
   end subroutine test_hertz

   !> Stiffness without slip, force, stick radius and loss per cycle of one resolution over the closed form, at
   !> the same amplitude of the force. Pressure is constant and slip goes one way between the reversals, so one
   !> step from end to end is as good as many. (40 cells per radius: example/half_space.)
   subroutine mindlin_cycle(spheres, stiffness, force, stick_radius, loss, error)
      type(spheres_t), intent(in) :: spheres
      !> Over 8 a / B with the contact radius of the discrete contact
      real(wp), intent(out) :: stiffness
      real(wp), intent(out) :: force, stick_radius, loss
      type(error_type), allocatable, intent(out) :: error
      real(wp), parameter :: aim = 0.8_wp
      type(condensed_solver_t) :: solver
      type(contact_state_t) :: state
      real(wp) :: limit, amplitude, part, exact, dissipated
      logical :: converged

      call press(spheres, solver, state, converged)
      call check(error, converged, 'not converged')
      if (allocated(error)) return
      limit = friction*spheres%images*sum(state%force(1, :))
      amplitude = 1.5_wp*limit/stick_stiffness(spheres)*(1.0_wp - (1.0_wp - aim)**(2.0_wp/3.0_wp))

      call shear_to(1.0e-6_wp*amplitude)
      stiffness = tangential_force()/state%q(2)/stick_stiffness(spheres) &
         & *contact_radius/spheres%radius_of(state%status /= state_open)
      call shear_to(amplitude)
      part = tangential_force()/limit
      force = part/aim
      stick_radius = spheres%radius_of(state%status == state_stick)/(contact_radius*(1.0_wp - part)**(1.0_wp/3.0_wp))

      dissipated = 0.0_wp
      call shear_to(-amplitude)
      call shear_to(amplitude)
      part = tangential_force()/limit
      exact = 7.2_wp*limit**2/stick_stiffness(spheres)*(1.0_wp - (1.0_wp - part)**(5.0_wp/3.0_wp) &
         & - part*(5.0_wp/6.0_wp)*(1.0_wp + (1.0_wp - part)**(2.0_wp/3.0_wp)))
      loss = dissipated/exact
      call check(error, converged, 'not converged')

   contains

      subroutine shear_to(displacement)
         real(wp), intent(in) :: displacement
         type(solve_record_t) :: record
         real(wp) :: before(3, spheres%problem%n_points)

         before = state%gap
         call solver%advance(spheres%problem, [spheres%approach, displacement, 0.0_wp], state, record)
         dissipated = dissipated - spheres%images*sum(state%force(2:3, :)*(state%gap(2:3, :) - before(2:3, :)))
         converged = converged .and. record%converged
      end subroutine shear_to

      real(wp) function tangential_force()
         tangential_force = -spheres%images*sum(state%force(2, :))
      end function tangential_force

   end subroutine mindlin_cycle

   !> The stiffness without slip, whose traction is singular at the edge, converges with the first power of the
   !> cell width: the deviation halves. Force and loss do better. The stick radius is right to half a cell.
   subroutine test_cattaneo_mindlin(error)
      type(error_type), allocatable, intent(out) :: error
      integer, parameter :: cells(3) = [5, 10, 20]
      type(spheres_t) :: spheres
      real(wp), dimension(size(cells)) :: stiffness, force, stick_radius, loss
      real(wp), parameter :: stick = 0.2_wp**(1.0_wp/3.0_wp)
      integer :: k

      do k = 1, size(cells)
         call new_quarter(spheres, equal_pair(0.0_wp), curvature_radius, contact_radius, cells(k), friction)
         call mindlin_cycle(spheres, stiffness(k), force(k), stick_radius(k), loss(k), error)
         if (allocated(error)) return
      end do
      stiffness = abs(stiffness - 1.0_wp)
      force = abs(force - 1.0_wp)
      stick_radius = abs(stick_radius - 1.0_wp)
      loss = abs(loss - 1.0_wp)
      call check(error, all(abs(stiffness(2:)/stiffness(:size(cells) - 1) - 0.5_wp) < 0.05_wp), 'stiffness is not of first order')
      if (allocated(error)) return
      ! At 40 cells per radius: half of what is left at 20.
      call check(error, 0.5_wp*stiffness(3) < 1.0e-2_wp, 'stiffness more than 1 % off at 40 cells per radius')
      if (allocated(error)) return
      call check(error, all(force < 1.0e-2_wp/cells), 'tangential force')
      if (allocated(error)) return
      call check(error, all(stick_radius < 0.5_wp/(stick*cells)), 'stick radius more than half a cell off')
      if (allocated(error)) return
      call check(error, all(loss < 1.0_wp/cells**2) .and. all(loss(2:) < 0.5_wp*loss(:size(cells) - 1)), 'loss per cycle')
   end subroutine test_cattaneo_mindlin

   !> The signed sum over four images does what the whole contact does.
   subroutine test_quarter(error)
      type(error_type), allocatable, intent(out) :: error
      type(spheres_t) :: whole, quarter
      type(contact_state_t) :: state_w, state_q
      integer :: k
      integer, allocatable :: in_whole(:)

      call new_spheres(whole, equal_pair(0.3_wp), curvature_radius, contact_radius, 6, friction)
      call new_quarter(quarter, equal_pair(0.3_wp), curvature_radius, contact_radius, 6, friction)
      call follow(whole%problem, press_and_shear(whole, [1.0_wp, 0.0_wp]), state_w, error)
      if (allocated(error)) return
      call follow(quarter%problem, press_and_shear(quarter, [1.0_wp, 0.0_wp]), state_q, error)
      if (allocated(error)) return
      in_whole = pack([(k, k=1, whole%problem%n_points)], all(whole%position > 0.0_wp, 1))
      call check(error, difference(state_w%force(:, in_whole), state_q%force) < path_tolerance)
   end subroutine test_quarter

   !> Forces in N with lengths in m or in micrometres; forces at the same displacements are proportional to E.
   subroutine test_scaling(error)
      type(error_type), allocatable, intent(out) :: error
      ! Steps differ by rounding, so where the solver stops does too: it is asked for all it can do.
      real(wp), parameter :: per_m = 1.0e6_wp, stiffer = 3.0_wp, rounding = 1.0e-12_wp
      type(spheres_t) :: si, micro, stiff
      type(contact_state_t) :: state_si, state_micro, state_stiff

      call new_spheres(si, equal_pair(0.3_wp), curvature_radius, contact_radius, 5, friction)
      call new_spheres(micro, equal_pair(0.3_wp, young/per_m**2), per_m*curvature_radius, per_m*contact_radius, 5, friction)
      call new_spheres(stiff, equal_pair(0.3_wp, stiffer*young), curvature_radius, contact_radius, 5, friction)
      call follow(si%problem, press_and_shear(si, [0.8_wp, 0.6_wp]), state_si, error, tolerance=rounding)
      if (allocated(error)) return
      call follow(micro%problem, press_and_shear(micro, [0.8_wp, 0.6_wp]), state_micro, error, tolerance=rounding)
      if (allocated(error)) return
      call follow(stiff%problem, press_and_shear(stiff, [0.8_wp, 0.6_wp]), state_stiff, error, tolerance=rounding)
      if (allocated(error)) return
      call check(error, all(state_micro%status == state_si%status) .and. all(state_stiff%status == state_si%status))
      if (allocated(error)) return
      call check(error, difference(state_micro%force, state_si%force) < rounding, 'the unit of length matters')
      if (allocated(error)) return
      call check(error, difference(state_stiff%force/stiffer, state_si%force) < rounding, 'forces do not scale with E')
   end subroutine test_scaling

   !> Largest difference of two sets of forces over the largest force.
   pure real(wp) function difference(one, other)
      real(wp), intent(in) :: one(:, :), other(:, :)
      difference = maxval(abs(one - other))/maxval(abs(other))
   end function difference

   !> Mirrored at x = 0: the displacement along t1, and the force along t1, change sign.
   subroutine test_mirror(error)
      type(error_type), allocatable, intent(out) :: error
      type(spheres_t) :: spheres
      type(contact_state_t) :: state, mirrored
      integer, allocatable :: image(:)
      integer :: k

      call new_spheres(spheres, unequal_pair(.false.), curvature_radius, contact_radius, 6, friction)
      call follow(spheres%problem, press_and_shear(spheres, [0.8_wp, 0.6_wp]), state, error)
      if (allocated(error)) return
      call follow(spheres%problem, press_and_shear(spheres, [-0.8_wp, 0.6_wp]), mirrored, error)
      if (allocated(error)) return
      image = [(minloc((spheres%position(1, :) + spheres%position(1, k))**2 &
         & + (spheres%position(2, :) - spheres%position(2, k))**2, dim=1), k=1, size(state%status))]
      mirrored%force = mirrored%force(:, image)
      mirrored%force(2, :) = -mirrored%force(2, :)
      call check(error, difference(mirrored%force, state%force) < path_tolerance)
   end subroutine test_mirror

   !> Mirrored at the interface: the bodies change places and the relative tangential motion its sign. The same
   !> pressure then acts, and the opposite friction.
   subroutine test_exchange(error)
      type(error_type), allocatable, intent(out) :: error
      type(spheres_t) :: one, other
      type(contact_state_t) :: state, exchanged

      call new_spheres(one, unequal_pair(.false.), curvature_radius, contact_radius, 6, friction)
      call new_spheres(other, unequal_pair(.true.), curvature_radius, contact_radius, 6, friction)
      call follow(one%problem, press_and_shear(one, [0.8_wp, 0.6_wp]), state, error)
      if (allocated(error)) return
      call follow(other%problem, press_and_shear(other, -[0.8_wp, 0.6_wp]), exchanged, error)
      if (allocated(error)) return
      exchanged%force(2:3, :) = -exchanged%force(2:3, :)
      call check(error, difference(exchanged%force, state%force) < path_tolerance)
   end subroutine test_exchange

   !> Pressing an elastic body on a rigid one makes it slip inwards at the edge and stick in the middle (Goodman,
   !> Spence), with no resultant; then a path of shear and lift-off. All laws from the definition.
   subroutine test_unequal_materials(error)
      type(error_type), allocatable, intent(out) :: error
      type(spheres_t) :: spheres
      type(contact_state_t) :: state
      real(wp), allocatable :: path(:, :)
      real(wp) :: worst, resultant(2), torque
      logical, allocatable :: slips(:)
      integer :: k

      call new_spheres(spheres, unequal_pair(.false.), curvature_radius, contact_radius, 7, 0.15_wp)
      allocate (path(3, 10), source=0.0_wp)
      path(1, :) = [(0.1_wp*k*spheres%approach, k=1, 10)]
      call follow(spheres%problem, path, state, error, worst, spheres%approach)
      if (allocated(error)) return
      call check(error, worst < path_tolerance, 'a law is violated in pressing')
      if (allocated(error)) return
      slips = state%status == state_slip
      call check(error, any(slips) .and. any(state%status == state_stick), 'no slip or no stick')
      if (allocated(error)) return
      associate (x => spheres%position, force => state%force)
         ! The coupling pulls the surface of A inwards; friction on A points outwards where it slips.
         call check(error, minval(sum(x*force(2:3, :), 1), mask=slips) > 0.0_wp, 'friction points inwards')
         if (allocated(error)) return
         call check(error, maxval(norm2(x, 1), mask=state%status == state_stick) &
            & < maxval(norm2(x, 1), mask=slips), 'the edge sticks')
         if (allocated(error)) return
         resultant = abs(sum(force(2:3, :), 2))/sum(norm2(force(2:3, :), 1))
         torque = abs(sum(x(1, :)*force(3, :) - x(2, :)*force(2, :)))/sum(norm2(x, 1)*norm2(force(2:3, :), 1))
      end associate
      call check(error, all([resultant, torque] < path_tolerance), 'a resultant appears')
      if (allocated(error)) return
      path = through_everything(spheres, 40)
      call follow(spheres%problem, path, state, error, worst, spheres%approach)
      if (allocated(error)) return
      call check(error, worst < path_tolerance, 'a law is violated on the path')
   end subroutine test_unequal_materials

   !> A path through stick, partial slip, gross slip, lift-off and new contact, (3, steps): two rounds of an
   !> open figure; the approach is negative over part of it.
   pure function through_everything(spheres, steps) result(path)
      type(spheres_t), intent(in) :: spheres
      integer, intent(in) :: steps
      real(wp) :: path(3, steps)
      real(wp) :: t, sliding
      integer :: k

      sliding = 1.5_wp*friction*hertz_force(spheres)/stick_stiffness(spheres)
      do k = 1, steps
         t = 4.0_wp*pi*k/steps
         path(:, k) = [spheres%approach*min(1.0_wp, 0.6_wp - 0.8_wp*cos(t)), 1.5_wp*sliding*sin(2.0_wp*t), &
            & 0.6_wp*sliding*sin(3.0_wp*t)]
      end do
   end function through_everything

   !> Elastic on rigid, coupled n and t, up to 83 of 124 points in contact.
   subroutine test_condensed_equals_plain(error)
      type(error_type), allocatable, intent(out) :: error
      type(spheres_t) :: spheres
      type(condensed_solver_t) :: fast
      type(plain_jacobi_t) :: plain
      type(contact_state_t) :: state, reference
      type(solve_record_t) :: record, record_reference
      type(mslip_error), allocatable :: failure
      real(wp), allocatable :: path(:, :)
      real(wp) :: worst, scale
      integer :: k, most_closed
      logical :: stuck, gross_slip, lifted_off

      call new_spheres(spheres, unequal_pair(.false.), curvature_radius, contact_radius, 5, friction)
      path = through_everything(spheres, 30)
      state = new_state(spheres%problem)
      reference = state
      call fast%start(spheres%problem, state, failure)
      call plain%start(spheres%problem, reference, failure)
      worst = 0.0_wp
      scale = 0.0_wp
      most_closed = 0
      stuck = .false.
      gross_slip = .false.
      lifted_off = .false.
      do k = 1, size(path, 2)
         call fast%advance(spheres%problem, path(:, k), state, record)
         call plain%advance(spheres%problem, path(:, k), reference, record_reference)
         call check(error, record%converged .and. record_reference%converged, 'not converged')
         if (allocated(error)) return
         scale = max(scale, maxval(reference%force))
         worst = max(worst, maxval(abs(state%force - reference%force)))
         associate (counts => count_states(state))
            most_closed = max(most_closed, sum(counts(2:)))
            stuck = stuck .or. counts(2) > 20
            gross_slip = gross_slip .or. (counts(2) == 0 .and. counts(3) > 60)
            lifted_off = lifted_off .or. (k > 1 .and. sum(counts(2:)) == 0)
         end associate
      end do
      call check(error, worst < 1.0e-8_wp*scale, 'forces differ')
      if (allocated(error)) return
      call check(error, most_closed >= 60 .and. stuck .and. gross_slip .and. lifted_off, 'a regime was not met')
   end subroutine test_condensed_equals_plain

   !> After a full lift-off and a rigid shift, the same pressing gives the same forces as the first time: the new
   !> contact knows nothing of the friction before. (Equal materials: pressing alone then has no friction at all.)
   subroutine test_new_contact(error)
      type(error_type), allocatable, intent(out) :: error
      type(spheres_t) :: spheres
      type(condensed_solver_t) :: solver
      type(contact_state_t) :: state, first
      type(solve_record_t) :: record
      real(wp), allocatable :: path(:, :)
      logical :: converged
      integer :: k
      real(wp) :: apart

      call new_spheres(spheres, equal_pair(0.3_wp), curvature_radius, contact_radius, 6, friction)
      call press(spheres, solver, first, converged)
      state = first
      path = press_and_shear(spheres, [0.6_wp, 0.8_wp])
      apart = 0.1_wp*spheres%approach
      path = reshape([path, -apart, path(2:3, 6), -apart, 2.0_wp*path(2:3, 4), &
         & 0.4_wp*spheres%approach, 2.0_wp*path(2:3, 4), spheres%approach, 2.0_wp*path(2:3, 4)], [3, 10])
      do k = 1, size(path, 2)
         call solver%advance(spheres%problem, path(:, k), state, record)
         converged = converged .and. record%converged
         if (k == 7 .or. k == 8) then
            call check(error, all(state%force == 0.0_wp) .and. all(state%status == state_open), 'not lifted off')
            if (allocated(error)) return
            call check(error, record%residual <= solver_tolerance, 'residual of the open contact')
            if (allocated(error)) return
         end if
      end do
      call check(error, converged, 'not converged')
      if (allocated(error)) return
      call check(error, difference(state%force, first%force) < path_tolerance, 'the contact remembers')
   end subroutine test_new_contact

   !> Work of the drivers = elastic energy + loss. With the mean force of a step the balance is exact for
   !> force . d(gap); the loss by the force at its end then differs by the points that change their state within
   !> the step, which is of first order in the step: the mismatch halves when the steps do.
   subroutine test_energy(error)
      type(error_type), allocatable, intent(out) :: error
      integer, parameter :: steps(3) = [48, 96, 192]
      type(spheres_t) :: spheres
      real(wp) :: work, stored, lost, mismatch(size(steps))
      integer :: k

      call new_spheres(spheres, unequal_pair(.false.), curvature_radius, contact_radius, 4, friction)
      do k = 1, size(steps)
         call energies(spheres, steps(k), work, stored, lost, error)
         if (allocated(error)) return
         mismatch(k) = abs(work - stored - lost)/lost
      end do
      call check(error, all(mismatch(2:) < 0.6_wp*mismatch(:size(steps) - 1)), 'the balance does not close with the step')
      if (allocated(error)) return
      call check(error, mismatch(size(steps)) < 2.0_wp/steps(size(steps)), 'the balance is open')
   end subroutine test_energy

   !> Press, then two cycles of shear under a normal force that varies: work and loss, and the energy stored.
   subroutine energies(spheres, steps, work, stored, lost, error)
      type(spheres_t), intent(in) :: spheres
      integer, intent(in) :: steps
      !> J
      real(wp), intent(out) :: work, stored, lost
      type(error_type), allocatable, intent(out) :: error
      type(condensed_solver_t) :: solver
      type(contact_state_t) :: state, before
      type(solve_record_t) :: record
      real(wp) :: sliding, t, q(3)
      logical :: converged
      integer :: k

      sliding = 1.5_wp*friction*hertz_force(spheres)/stick_stiffness(spheres)
      call press(spheres, solver, state, converged)
      call check(error, converged, 'not converged')
      if (allocated(error)) return
      work = 0.0_wp
      lost = 0.0_wp
      stored = -elastic_energy(spheres%problem, state)
      do k = 1, steps
         before = state
         t = 2.0_wp*pi*k/steps
         q = [spheres%approach*(1.0_wp - 0.3_wp*sin(t)**2), 0.8_wp*sliding*sin(t), 0.3_wp*sliding*sin(2.0_wp*t)]
         call solver%advance(spheres%problem, q, state, record)
         call check(error, record%converged, 'not converged')
         if (allocated(error)) return
         work = work - 0.5_wp*dot_product(reshape(state%force + before%force, [3*spheres%problem%n_points]), &
            & matmul(spheres%problem%R, state%q - before%q))
         lost = lost - sum(state%force(2:3, :)*(state%gap(2:3, :) - before%gap(2:3, :)))
      end do
      stored = stored + elastic_energy(spheres%problem, state)
   end subroutine energies

   !> 1/2 force G force, J.
   pure real(wp) function elastic_energy(problem, state)
      type(contact_problem_t), intent(in) :: problem
      type(contact_state_t), intent(in) :: state
      real(wp) :: force(3*problem%n_points)

      force = reshape(state%force, [3*problem%n_points])
      elastic_energy = 0.5_wp*dot_product(force, matmul(problem%G, force))
   end function elastic_energy

end module test_contact_half_space
