!> Contact of spheres on the half space alone, as a contact problem, with the closed forms to compare with.
!>
!> The gap is the paraboloid r^2/(2 R); the drivers are the rigid approach and the rigid tangential
!> displacements along t1 and t2. Formulas: METHOD section 3, Johnson, Contact Mechanics, 4.2 and 7.2.
module support_half_space
   use microslip_contact_condensed, only: condensed_solver_t
   use microslip_contact_frictionless, only: solve_frictionless
   use microslip_contact_laws, only: state_stick, state_slip
   use microslip_contact_problem, only: contact_problem_t, contact_state_t, solve_record_t, new_state, gap_of
   use microslip_core_error, only: mslip_error => error_t
   use microslip_core_kinds, only: wp, pi
   use microslip_halfspace_compliance, only: compliance_t, new_compliance
   use microslip_halfspace_grid, only: be_grid_t, new_grid
   use microslip_halfspace_love_cerruti, only: half_space_pair_t
   implicit none(type, external)
   private

   public :: spheres_t, new_spheres, new_quarter, press, press_frictionless, hertz_force, hertz_pressure, stick_stiffness, violation

   !> Two spheres, the points in potential contact, and what the closed forms need.
   type :: spheres_t
      type(contact_problem_t) :: problem
      type(half_space_pair_t) :: pair
      !> Effective radius of curvature and the contact radius that `approach` leads to, m
      real(wp) :: curvature_radius, contact_radius
      !> contact_radius^2 / curvature_radius, m
      real(wp) :: approach
      !> Cell width, m
      real(wp) :: cell
      !> Cells that one point stands for: 1, or 4 where a quarter is modelled
      integer :: images = 1
      !> (2, points) m
      real(wp), allocatable :: position(:, :)
   contains
      procedure :: radius_of
   end type spheres_t

contains

   !> All points up to 1.5 cells beyond the contact radius.
   subroutine new_spheres(spheres, pair, curvature_radius, contact_radius, cells, friction)
      type(spheres_t), intent(out) :: spheres
      type(half_space_pair_t), intent(in) :: pair
      !> m
      real(wp), intent(in) :: curvature_radius, contact_radius
      !> Cells per contact radius
      integer, intent(in) :: cells
      real(wp), intent(in) :: friction
      type(be_grid_t) :: grid
      type(compliance_t) :: compliance
      integer, allocatable :: points(:)

      call fill_geometry(spheres, grid, points, pair, curvature_radius, contact_radius, cells, friction)
      call new_compliance(compliance, pair, grid)
      spheres%problem%G = 0.0_wp
      call compliance%add_to_dense(points, spheres%problem%G)
   end subroutine new_spheres

   !> The points with x, y > 0 only, for loads along t1 and materials that do not couple n and t: the forces n
   !> and t1 are even in x and y and t2 is odd in both, so the compliance is the signed sum over four images.
   subroutine new_quarter(spheres, pair, curvature_radius, contact_radius, cells, friction)
      type(spheres_t), intent(out) :: spheres
      type(half_space_pair_t), intent(in) :: pair
      !> m
      real(wp), intent(in) :: curvature_radius, contact_radius
      !> Cells per contact radius
      integer, intent(in) :: cells
      real(wp), intent(in) :: friction
      type(be_grid_t) :: grid
      type(compliance_t) :: compliance
      integer, allocatable :: points(:)
      integer :: j, k, offset(2), image(2)
      real(wp) :: block(3, 3), odd(3, 3)

      call fill_geometry(spheres, grid, points, pair, curvature_radius, contact_radius, cells, friction, quarter=.true.)
      call new_compliance(compliance, pair, grid)
      spheres%images = 4
      do k = 1, size(points)
         do j = 1, k
            offset = [grid%ix(points(j)) - grid%ix(points(k)), grid%iy(points(j)) - grid%iy(points(k))]
            image = [grid%ix(points(j)) + grid%ix(points(k)), grid%iy(points(j)) + grid%iy(points(k))] - grid%nx - 1
            block = compliance%entry(offset(1), offset(2)) + compliance%entry(image(1), image(2))
            odd = compliance%entry(image(1), offset(2)) + compliance%entry(offset(1), image(2))
            odd(:, 3) = -odd(:, 3)
            spheres%problem%G(3*j - 2:3*j, 3*k - 2:3*k) = block + odd
            spheres%problem%G(3*k - 2:3*k, 3*j - 2:3*j) = transpose(block + odd)
         end do
      end do
   end subroutine new_quarter

   !> Everything but the compliance.
   subroutine fill_geometry(spheres, grid, points, pair, curvature_radius, contact_radius, cells, friction, quarter)
      type(spheres_t), intent(inout) :: spheres
      type(be_grid_t), intent(out) :: grid
      integer, allocatable, intent(out) :: points(:)
      type(half_space_pair_t), intent(in) :: pair
      real(wp), intent(in) :: curvature_radius, contact_radius, friction
      integer, intent(in) :: cells
      logical, intent(in), optional :: quarter
      type(mslip_error), allocatable :: error
      logical, allocatable :: used(:)
      real(wp) :: width
      integer :: n, k

      n = cells + 2
      spheres%pair = pair
      spheres%curvature_radius = curvature_radius
      spheres%contact_radius = contact_radius
      spheres%approach = contact_radius**2/curvature_radius
      spheres%cell = contact_radius/cells
      width = n*spheres%cell
      call new_grid(grid, -[width, width], [width, width], 2*n, 2*n, error)
      used = norm2(grid%position, 1) < (cells + 1.5_wp)*spheres%cell
      if (present(quarter)) used = used .and. all(grid%position > 0.0_wp, 1)
      points = pack([(k, k=1, grid%point_count())], used)
      spheres%position = grid%position(:, points)

      n = size(points)
      spheres%problem%n_points = n
      allocate (spheres%problem%G(3*n, 3*n))
      allocate (spheres%problem%R(3*n, 3), spheres%problem%r_0(3*n), source=0.0_wp)
      spheres%problem%friction = spread(friction, 1, n)
      spheres%problem%r_0(1::3) = sum(spheres%position**2, 1)/(2.0_wp*curvature_radius)
      spheres%problem%R(1::3, 1) = -1.0_wp
      spheres%problem%R(2::3, 2) = 1.0_wp
      spheres%problem%R(3::3, 3) = 1.0_wp
   end subroutine fill_geometry

   !> Normal contact alone at the full approach.
   subroutine press_frictionless(spheres, closed, force, settled)
      type(spheres_t), intent(in) :: spheres
      !> (points)
      logical, allocatable, intent(out) :: closed(:)
      !> (points) N
      real(wp), allocatable, intent(out) :: force(:)
      logical, intent(out) :: settled
      type(mslip_error), allocatable :: error
      real(wp) :: no_drivers(spheres%problem%n_points, 0), sensitivity(spheres%problem%n_points, 0)

      closed = spheres%problem%r_0(1::3) < 0.5_wp*spheres%approach
      allocate (force(size(closed)))
      call solve_frictionless(spheres%problem%G(1::3, 1::3), spheres%problem%r_0(1::3) - spheres%approach, no_drivers, &
         & closed, force, sensitivity, error)
      settled = .not. allocated(error)
   end subroutine press_frictionless

   !> Press to the full approach in one step.
   subroutine press(spheres, solver, state, converged)
      type(spheres_t), intent(in) :: spheres
      type(condensed_solver_t), intent(inout) :: solver
      type(contact_state_t), intent(out) :: state
      logical, intent(out) :: converged
      type(mslip_error), allocatable :: error
      type(solve_record_t) :: record
      real(wp), allocatable :: force(:)

      call press_frictionless(spheres, solver%expected_closed, force, converged)
      if (.not. converged) return
      state = new_state(spheres%problem)
      call solver%start(spheres%problem, state, error)
      converged = .not. allocated(error)
      if (.not. converged) return
      call solver%advance(spheres%problem, [spheres%approach, 0.0_wp, 0.0_wp], state, record)
      converged = record%converged
   end subroutine press

   !> Radius of the circle with the area of the chosen points, m.
   pure real(wp) function radius_of(self, chosen)
      class(spheres_t), intent(in) :: self
      logical, intent(in) :: chosen(:)
      radius_of = sqrt(count(chosen)*self%images/pi)*self%cell
   end function radius_of

   !> P = 4 E* a^3 / (3 R), N; 1/E* = pi N of the pair.
   pure real(wp) function hertz_force(spheres)
      type(spheres_t), intent(in) :: spheres
      hertz_force = 4.0_wp*spheres%contact_radius**3/(3.0_wp*pi*spheres%pair%normal*spheres%curvature_radius)
   end function hertz_force

   !> Peak pressure p_0 = 2 E* a / (pi R), N/m^2.
   pure real(wp) function hertz_pressure(spheres)
      type(spheres_t), intent(in) :: spheres
      hertz_pressure = 2.0_wp*spheres%contact_radius/(pi**2*spheres%pair%normal*spheres%curvature_radius)
   end function hertz_pressure

   !> Tangential stiffness 8 a / B of the contact without slip, N/m; B = sum of (2 - nu)/G = 2 pi (2 N + S).
   pure real(wp) function stick_stiffness(spheres)
      type(spheres_t), intent(in) :: spheres
      stick_stiffness = 4.0_wp*spheres%contact_radius/(pi*(2.0_wp*spheres%pair%normal + spheres%pair%shear))
   end function stick_stiffness

   !> Largest violation of the laws in a step, from the definition, over the largest force and over the
   !> displacement `length`: Signorini, Coulomb's limit, no slip where it sticks, friction against the slip.
   real(wp) function violation(problem, before, state, length)
      type(contact_problem_t), intent(in) :: problem
      !> States at both ends of the step
      type(contact_state_t), intent(in) :: before, state
      !> m
      real(wp), intent(in) :: length
      real(wp) :: gap(3, problem%n_points), old(3, problem%n_points), force(3, problem%n_points), slip(2), limit
      integer :: p

      gap = gap_of(problem, state%q, state%force)/length
      old = gap_of(problem, before%q, before%force)/length
      force = state%force/max(maxval(state%force), tiny(1.0_wp))
      violation = 0.0_wp
      do p = 1, problem%n_points
         slip = gap(2:3, p) - old(2:3, p)
         limit = problem%friction(p)*force(1, p)
         violation = max(violation, -gap(1, p), -force(1, p), min(gap(1, p), force(1, p)), norm2(force(2:3, p)) - limit)
         if (state%status(p) == state_stick) violation = max(violation, norm2(slip))
         if (state%status(p) == state_slip) violation = max(violation, norm2(force(2:3, p)*norm2(slip) + limit*slip))
      end do
   end function violation

end module support_half_space
