!> Two equal elastic spheres against the closed forms of Hertz (normal) and Cattaneo and Mindlin (tangential).
!>
!> A paraboloid gap r^2/(2 R) on the half-space compliance: pressed by the rigid approach d_n, then sheared
!> by the rigid displacement d_t through a full cycle. Poisson's ratio is zero: the closed form leaves out
!> slip across the load, which then does not occur. The contact has two planes of symmetry, so one quarter of
!> the points carries unknowns and its compliance is the sum over the four images.
!>
!> Formulas: K. L. Johnson, Contact Mechanics, Cambridge 1985, sections 4.2 and 7.2.
program contact_of_spheres
   use, intrinsic :: iso_fortran_env, only: output_unit, error_unit
   use microslip_contact_condensed, only: condensed_solver_t
   use microslip_contact_frictionless, only: solve_frictionless
   use microslip_contact_laws, only: state_stick
   use microslip_contact_problem, only: contact_problem_t, contact_state_t, solve_record_t, new_state
   use microslip_core_error, only: error_t
   use microslip_core_kinds, only: wp, pi
   use microslip_halfspace_compliance, only: compliance_t, new_compliance
   use microslip_halfspace_grid, only: be_grid_t, new_grid
   use microslip_halfspace_love_cerruti, only: material_t, elastic_material, half_space_pair_t, half_space_pair
   implicit none(type, external)

   !> Effective radius R and contact radius a, m; Young's modulus, N/m^2; friction coefficient.
   real(wp), parameter :: sphere_radius = 0.1_wp, contact_radius = 1.0e-3_wp, young = 2.0e11_wp, friction = 0.5_wp
   !> Amplitude of the tangential force over the limit of sliding that the cycle aims at.
   real(wp), parameter :: aim = 0.8_wp
   integer, parameter :: resolutions(4) = [5, 10, 20, 40]
   type(half_space_pair_t) :: pair
   type(material_t) :: body
   type(error_t), allocatable :: error
   integer :: k

   call elastic_material(body, young, 0.0_wp, error)
   call stop_on(error)
   pair = half_space_pair(body, body)
   write (output_unit, '(a)') 'deviation from the closed form, %', &
      & '  cells      Hertz                         Cattaneo-Mindlin', &
      & '  per a      force    peak p.   radius     stiffness Q(d_t)    stick rad. loop'
   do k = 1, size(resolutions)
      call compare(resolutions(k))
   end do

contains

   !> Run one resolution and print its line.
   subroutine compare(cells)
      !> Cells per contact radius
      integer, intent(in) :: cells
      type(contact_problem_t) :: problem
      type(condensed_solver_t) :: solver
      type(contact_state_t) :: state
      real(wp) :: hertz(3), mindlin(4), area, force, stiffness, amplitude, exact, part, loss

      call quarter_of_contact(cells, problem, area)
      call press(problem, area, solver, state, hertz)

      ! B of Johnson, 7.2: sum of (2 - nu)/G over both bodies, with nu = 0.
      stiffness = 8.0_wp*contact_radius/(2.0_wp*pi*(2.0_wp*pair%normal + pair%shear))
      force = 4.0_wp*sum(state%force(1, :))
      amplitude = 1.5_wp*friction*force/stiffness*(1.0_wp - (1.0_wp - aim)**(2.0_wp/3.0_wp))

      loss = shear(problem, solver, state, 1.0e-6_wp*amplitude)
      mindlin(1) = tangential(state)/(1.0e-6_wp*amplitude)/stiffness
      loss = shear(problem, solver, state, amplitude)
      part = tangential(state)/(friction*force)
      exact = 1.0_wp - (1.0_wp - amplitude*stiffness/(1.5_wp*friction*force))**1.5_wp
      mindlin(2) = part/exact
      mindlin(3) = sqrt(4.0_wp*count(state%status == state_stick)*area/pi)/(contact_radius*(1.0_wp - part)**(1.0_wp/3.0_wp))

      ! The loop, from one end to the other and back. Loading under constant pressure slips one way, so one
      ! step gives the same as many.
      loss = shear(problem, solver, state, -amplitude) + shear(problem, solver, state, amplitude)
      part = tangential(state)/(friction*force)
      exact = 7.2_wp*(friction*force)**2/stiffness*(1.0_wp - (1.0_wp - part)**(5.0_wp/3.0_wp) &
         & - part*(5.0_wp/6.0_wp)*(1.0_wp + (1.0_wp - part)**(2.0_wp/3.0_wp)))
      mindlin(4) = loss/exact
      write (output_unit, '(i6,3x,3f10.3,1x,4f10.3)') cells, 100.0_wp*(hertz - 1.0_wp), 100.0_wp*(mindlin - 1.0_wp)
   end subroutine compare

   !> The points of one quarter and their compliance; drivers: approach and displacement along t1.
   subroutine quarter_of_contact(cells, problem, area)
      integer, intent(in) :: cells
      type(contact_problem_t), intent(out) :: problem
      !> Area of a cell, m^2
      real(wp), intent(out) :: area
      type(be_grid_t) :: grid
      type(compliance_t) :: compliance
      integer, allocatable :: points(:)
      real(wp) :: width
      integer :: n, j, k, row, column

      n = cells + 2
      width = n*contact_radius/cells
      call new_grid(grid, -[width, width], [width, width], 2*n, 2*n, error)
      call stop_on(error)
      area = grid%cell_area()
      call new_compliance(compliance, pair, grid)
      points = pack([(k, k=1, grid%point_count())], all(grid%position > 0.0_wp, 1) &
         & .and. norm2(grid%position, 1) < (cells + 1.5_wp)/cells*contact_radius)
      problem%n_points = size(points)
      allocate (problem%G(3*size(points), 3*size(points)), problem%R(3*size(points), 2), problem%r_0(3*size(points)))
      problem%friction = spread(friction, 1, size(points))
      problem%R = 0.0_wp
      problem%r_0 = 0.0_wp
      do k = 1, size(points)
         column = 3*k - 2
         problem%r_0(column) = sum(grid%position(:, points(k))**2)/(2.0_wp*sphere_radius)
         problem%R(column, 1) = -1.0_wp
         problem%R(column + 1, 2) = 1.0_wp
         do j = 1, size(points)
            row = 3*j - 2
            problem%G(row:row + 2, column:column + 2) = images(compliance, grid%ix(points([j, k])), grid%iy(points([j, k])), 2*n)
         end do
      end do
   end subroutine quarter_of_contact

   !> Compliance of a point and the four images of another: n and t1 are even, t2 changes sign at each mirror.
   pure function images(compliance, ix, iy, cells) result(block)
      type(compliance_t), intent(in) :: compliance
      !> Cell indices of field and source point
      integer, intent(in) :: ix(2), iy(2)
      !> Cells along the whole grid
      integer, intent(in) :: cells
      real(wp) :: block(3, 3)
      real(wp) :: mirrored(3, 3)
      integer :: near_x, near_y, far_x, far_y

      near_x = ix(1) - ix(2)
      near_y = iy(1) - iy(2)
      far_x = ix(1) - (cells + 1 - ix(2))
      far_y = iy(1) - (cells + 1 - iy(2))
      block = compliance%entry(near_x, near_y) + compliance%entry(far_x, far_y)
      mirrored = compliance%entry(far_x, near_y) + compliance%entry(near_x, far_y)
      mirrored(:, 3) = -mirrored(:, 3)
      block = block + mirrored
   end function images

   !> Press to the wanted radius; ratios of force, peak pressure and radius to Hertz.
   subroutine press(problem, area, solver, state, ratio)
      type(contact_problem_t), intent(in) :: problem
      real(wp), intent(in) :: area
      type(condensed_solver_t), intent(inout) :: solver
      type(contact_state_t), intent(out) :: state
      real(wp), intent(out) :: ratio(3)
      type(solve_record_t) :: record
      logical :: closed(problem%n_points)
      real(wp) :: normal(problem%n_points), none(problem%n_points, 0), sensitivity(problem%n_points, 0), approach, modulus

      approach = contact_radius**2/sphere_radius
      closed = problem%r_0(1::3) < 0.5_wp*approach
      call solve_frictionless(problem%G(1::3, 1::3), problem%r_0(1::3) - approach, none, closed, normal, &
         & sensitivity, error)
      call stop_on(error)
      solver%expected_closed = closed
      state = new_state(problem)
      call solver%start(problem, state, error)
      call stop_on(error)
      call solver%advance(problem, [approach, 0.0_wp], state, record)
      call stop_unless(record%converged)
      modulus = 1.0_wp/(pi*pair%normal)
      ratio(1) = 4.0_wp*sum(state%force(1, :))/(4.0_wp/3.0_wp*modulus*contact_radius**3/sphere_radius)
      ratio(2) = maxval(state%force(1, :))/area/(2.0_wp*modulus*contact_radius/(pi*sphere_radius))
      ratio(3) = sqrt(4.0_wp*count(closed)*area/pi)/contact_radius
   end subroutine press

   !> Shear to a tangential displacement; the energy lost to friction, J.
   real(wp) function shear(problem, solver, state, displacement)
      type(contact_problem_t), intent(in) :: problem
      type(condensed_solver_t), intent(inout) :: solver
      type(contact_state_t), intent(inout) :: state
      real(wp), intent(in) :: displacement
      type(solve_record_t) :: record
      real(wp), allocatable :: before(:, :)

      before = state%gap
      call solver%advance(problem, [state%q(1), displacement], state, record)
      call stop_unless(record%converged)
      shear = -4.0_wp*sum(state%force(2:3, :)*(state%gap(2:3, :) - before(2:3, :)))
   end function shear

   !> The tangential force that drives the displacement, N.
   pure real(wp) function tangential(state)
      type(contact_state_t), intent(in) :: state
      tangential = -4.0_wp*sum(state%force(2, :))
   end function tangential

   subroutine stop_on(error)
      type(error_t), allocatable, intent(in) :: error
      if (.not. allocated(error)) return
      write (error_unit, '(a)') error%message
      stop 1, quiet=.true.
   end subroutine stop_on

   subroutine stop_unless(converged)
      logical, intent(in) :: converged
      if (converged) return
      write (error_unit, '(a)') 'the contact solver did not converge'
      stop 1, quiet=.true.
   end subroutine stop_unless

end program contact_of_spheres
