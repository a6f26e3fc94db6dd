!> Contact solvers against one another and against the laws, on random problems driven through stick, slip,
!> lift-off and re-closing.
module test_contact_solvers
   use microslip_contact_base_set, only: base_set_t
   use microslip_contact_condensed, only: condensed_solver_t
   use microslip_contact_laws, only: state_open, state_stick, state_slip
   use microslip_contact_plain_jacobi, only: plain_jacobi_t
   use microslip_contact_problem, only: contact_problem_t, contact_state_t, solve_record_t, contact_solver_t, new_state, gap_of
   use microslip_core_error, only: mslip_error => error_t
   use microslip_core_kinds, only: wp
   use testdrive, only: new_unittest, unittest_type, error_type, check
   implicit none(type, external)
   private

   public :: collect_contact_solvers, half_space_like_problem, driver

contains

   subroutine collect_contact_solvers(testsuite)
      type(unittest_type), allocatable, intent(out) :: testsuite(:)
      testsuite = [ &
         & new_unittest('condensed obeys the laws', test_condensed_laws), &
         & new_unittest('condensed equals plain Jacobi', test_condensed_equals_plain), &
         & new_unittest('eliminated Jacobi equals condensed', test_eliminated_equals_condensed), &
         & new_unittest('velocity level: condensed equals plain', test_velocity_level), &
         & new_unittest('plain Jacobi bounds its error', test_error_bound), &
         & new_unittest('interfaces coupled by a low rank equal one group', test_groups), &
         & new_unittest('an unsymmetric compliance is refused', test_unsymmetric), &
         & new_unittest('unconverged is reported', test_unconverged), &
         & new_unittest('indefinite compliance is refused', test_indefinite)]
   end subroutine collect_contact_solvers

   !> Points on an nx x ny grid with compliances that decay with the distance, normal-tangential coupling,
   !> and three drivers: approach, shear along t1, and tilt. Lengths and forces of order one.
   function half_space_like_problem(nx, ny, friction) result(problem)
      integer, intent(in) :: nx, ny
      real(wp), intent(in) :: friction
      type(contact_problem_t) :: problem
      integer :: i, j, n
      real(wp) :: x(2, nx*ny), d(2), r

      n = nx*ny
      problem%n_points = n
      allocate (problem%G(3*n, 3*n), problem%R(3*n, 3), problem%r_0(3*n), problem%friction(n))
      problem%friction = friction
      do j = 1, n
         x(:, j) = [real(mod(j - 1, nx), wp), real((j - 1)/nx, wp)]
      end do
      do j = 1, n
         do i = 1, n
            d = x(:, i) - x(:, j)
            r = sqrt(sum(d**2) + 0.3_wp)
            problem%G(3*i - 2:3*i, 3*j - 2:3*j) = 0.0_wp
            problem%G(3*i - 2, 3*j - 2) = 1.0_wp/r
            problem%G(3*i - 1, 3*j - 1) = 0.8_wp/r + 0.2_wp*d(1)**2/r**3
            problem%G(3*i, 3*j) = 0.8_wp/r + 0.2_wp*d(2)**2/r**3
            problem%G(3*i - 1, 3*j) = 0.2_wp*d(1)*d(2)/r**3
            problem%G(3*i, 3*j - 1) = 0.2_wp*d(1)*d(2)/r**3
            problem%G(3*i - 2, 3*j - 1) = -0.1_wp*d(1)/r**2
            problem%G(3*i - 1, 3*j - 2) = 0.1_wp*d(1)/r**2
         end do
         problem%r_0(3*j - 2) = 0.02_wp*sum((x(:, j) - 0.5_wp*[nx - 1, ny - 1])**2)
         problem%r_0(3*j - 1:3*j) = 0.0_wp
         problem%R(3*j - 2, :) = [-1.0_wp, 0.0_wp, x(1, j) - 0.5_wp*(nx - 1)]
         problem%R(3*j - 1, :) = [0.0_wp, 1.0_wp, 0.1_wp]
         problem%R(3*j, :) = [0.0_wp, 0.0_wp, 0.2_wp*sin(real(j, wp))]
      end do
   end function half_space_like_problem

   !> The drivers of step k: press, shear back and forth into gross slip, tilt into lift-off, unload.
   pure function driver(k) result(q)
      integer, intent(in) :: k
      real(wp) :: q(3)
      real(wp) :: t
      t = real(k, wp)
      q = [min(1.0_wp, 0.2_wp*t) - merge(1.2_wp*max(0.0_wp, sin(0.3_wp*t)), 0.0_wp, k > 30), &
         & merge(0.6_wp*sin(0.45_wp*(t - 4.0_wp)), 0.0_wp, k > 4), merge(0.12_wp*sin(0.7_wp*t), 0.0_wp, k > 12)]
   end function driver

   !> Drive both solvers along the same path; report the largest difference of forces over the largest force.
   subroutine drive_both(problem, one, other, steps, difference, visited, error)
      type(contact_problem_t), intent(in) :: problem
      class(contact_solver_t), intent(inout) :: one, other
      integer, intent(in) :: steps
      real(wp), intent(out) :: difference
      !> Largest number of points seen open, sticking, slipping
      integer, intent(out) :: visited(3)
      type(error_type), allocatable, intent(out) :: error

      call start_and_drive(problem, problem, one, other, steps, difference, visited, error)
   end subroutine drive_both

   subroutine test_condensed_equals_plain(error)
      type(error_type), allocatable, intent(out) :: error
      type(contact_problem_t) :: problem
      type(condensed_solver_t) :: fast
      type(plain_jacobi_t) :: plain
      real(wp) :: difference
      integer :: visited(3)

      problem = half_space_like_problem(7, 5, 0.4_wp)
      plain%tolerance = 1.0e-10_wp
      call drive_both(problem, fast, plain, 60, difference, visited, error)
      if (allocated(error)) return
      call check(error, difference < 60*1.0e-9_wp, 'forces differ')
      if (allocated(error)) return
      ! All regimes were met: all open, all but a few closed, all closed points slipping.
      call check(error, visited(1) == 35 .and. visited(2) > 10 .and. visited(3) > 10, 'a regime was not visited')
   end subroutine test_condensed_equals_plain

   !> Two patches far apart, each a half space of its own, that feel one another through three smooth patterns: the
   !> solver that takes them as two groups finds what it finds for one.
   subroutine test_groups(error)
      type(error_type), allocatable, intent(out) :: error
      type(contact_problem_t) :: patch, apart, together
      type(condensed_solver_t) :: one, two
      type(base_set_t) :: base
      type(mslip_error), allocatable :: failure
      real(wp), allocatable :: pattern(:, :)
      real(wp) :: difference
      integer :: visited(3), n, k

      patch = half_space_like_problem(9, 8, 0.4_wp)
      n = 3*patch%n_points
      together%n_points = 2*patch%n_points
      together%friction = [patch%friction, patch%friction]
      together%r_0 = [patch%r_0, 1.1_wp*patch%r_0]
      allocate (together%G(2*n, 2*n), source=0.0_wp)
      allocate (together%R(2*n, 3))
      together%R(:n, :) = patch%R
      together%R(n + 1:, :) = 0.9_wp*patch%R
      pattern = reshape([(cos(0.01_wp*k*[1.0_wp, 2.0_wp, 3.0_wp]), k=1, 2*n)], [3, 2*n])
      together%G(:n, :n) = patch%G
      together%G(n + 1:, n + 1:) = patch%G
      together%G = together%G + 0.02_wp*matmul(transpose(pattern), pattern)
      apart = together
      allocate (apart%group(apart%n_points), source=1)
      apart%group(patch%n_points + 1:) = 2
      ! All points in the base set: only then are the groups large enough for a low rank to pay.
      call base%build(apart, [(k, k=1, apart%n_points)], failure)
      call check(error,.not. allocated(failure) .and. base%groups == 2, 'the points are one group')
      if (allocated(error)) return
      n = 3*patch%n_points
      call check(error, maxval(abs(base%M(:n, n + 1:) - matmul(transpose(base%basis(:, :n)), &
         & matmul(base%coupling(:size(base%basis, 1), size(base%basis, 1) + 1:), base%basis(:, n + 1:))))) &
         & < 1.0e-11_wp*maxval(base%M), 'the coupling is not that of M')
      if (allocated(error)) return
      two%expected_closed = spread(.true., 1, apart%n_points)
      call start_and_drive(apart, together, two, one, 45, difference, visited, error)
      if (allocated(error)) return
      call check(error, difference < 45*1.0e-11_wp, 'forces differ')
      if (allocated(error)) return
      call check(error, all(visited > 20), 'a regime was not visited')
   end subroutine test_groups

   !> As `drive_both`, with a problem for each solver.
   subroutine start_and_drive(problem_one, problem_other, one, other, steps, difference, visited, error)
      type(contact_problem_t), intent(in) :: problem_one, problem_other
      class(contact_solver_t), intent(inout) :: one, other
      integer, intent(in) :: steps
      real(wp), intent(out) :: difference
      !> Largest number of points seen open, sticking, slipping
      integer, intent(out) :: visited(3)
      type(error_type), allocatable, intent(out) :: error
      type(contact_state_t) :: a, b
      type(solve_record_t) :: record_a, record_b
      type(mslip_error), allocatable :: failure
      integer :: k
      real(wp) :: scale

      a = new_state(problem_one)
      b = a
      call one%start(problem_one, a, failure)
      if (.not. allocated(failure)) call other%start(problem_other, b, failure)
      call check(error,.not. allocated(failure), 'start failed')
      if (allocated(error)) return
      difference = 0.0_wp
      scale = 0.0_wp
      visited = 0
      do k = 1, steps
         call one%advance(problem_one, driver(k), a, record_a)
         call other%advance(problem_other, driver(k), b, record_b)
         call check(error, record_a%converged .and. record_b%converged, 'not converged')
         if (allocated(error)) return
         scale = max(scale, maxval(b%force))
         difference = max(difference, maxval(abs(a%force - b%force)))
         visited = max(visited, [count(a%status == state_open), count(a%status == state_stick), &
            & count(a%status == state_slip)])
      end do
      difference = difference/scale
   end subroutine start_and_drive

   subroutine test_unsymmetric(error)
      type(error_type), allocatable, intent(out) :: error
      type(contact_problem_t) :: problem
      type(condensed_solver_t) :: solver
      type(mslip_error), allocatable :: failure

      problem = half_space_like_problem(4, 3, 0.4_wp)
      problem%G(2, 8) = problem%G(2, 8) + 1.0e-6_wp
      call solver%start(problem, new_state(problem), failure)
      call check(error, allocated(failure), 'an unsymmetric G was taken')
   end subroutine test_unsymmetric

   subroutine test_eliminated_equals_condensed(error)
      type(error_type), allocatable, intent(out) :: error
      type(contact_problem_t) :: problem
      type(condensed_solver_t) :: fast, eliminated
      real(wp) :: difference
      integer :: visited(3)

      problem = half_space_like_problem(7, 5, 0.4_wp)
      eliminated%by_jacobi = .true.
      call drive_both(problem, fast, eliminated, 60, difference, visited, error)
      if (allocated(error)) return
      call check(error, difference < 60*1.0e-9_wp, 'forces differ')
   end subroutine test_eliminated_equals_condensed

   subroutine test_velocity_level(error)
      type(error_type), allocatable, intent(out) :: error
      type(contact_problem_t) :: problem
      type(condensed_solver_t) :: fast
      type(plain_jacobi_t) :: plain
      real(wp) :: difference
      integer :: visited(3)

      problem = half_space_like_problem(6, 4, 0.4_wp)
      problem%velocity_level = .true.
      call drive_both(problem, fast, plain, 60, difference, visited, error)
      if (allocated(error)) return
      call check(error, difference < 60*1.0e-9_wp, 'forces differ')
   end subroutine test_velocity_level

   !> Signorini and Coulomb, evaluated here from the definition with the full compliance.
   subroutine test_condensed_laws(error)
      type(error_type), allocatable, intent(out) :: error
      type(contact_problem_t) :: problem
      type(condensed_solver_t) :: solver
      type(contact_state_t) :: state
      type(solve_record_t) :: record
      type(mslip_error), allocatable :: failure
      real(wp), allocatable :: gap(:, :), old(:, :)
      real(wp) :: slip(2), scale, worst
      integer :: k, p

      problem = half_space_like_problem(9, 6, 0.5_wp)
      state = new_state(problem)
      call solver%start(problem, state, failure)
      call check(error,.not. allocated(failure))
      if (allocated(error)) return
      do k = 1, 80
         old = gap_of(problem, state%q, state%force)
         call solver%advance(problem, driver(k), state, record)
         call check(error, record%converged, 'not converged')
         if (allocated(error)) return
         gap = gap_of(problem, driver(k), state%force)
         scale = max(1.0e-3_wp, maxval(state%force))
         worst = 0.0_wp
         do p = 1, problem%n_points
            worst = max(worst, -gap(1, p), -state%force(1, p), min(gap(1, p), state%force(1, p)))
            slip = gap(2:3, p) - old(2:3, p)
            associate (t => state%force(2:3, p), limit => problem%friction(p)*state%force(1, p))
               worst = max(worst, norm2(t) - limit)
               ! No slip inside the cone; on its rim the friction is opposite to the slip.
               if (state%status(p) == state_stick) worst = max(worst, norm2(slip))
               if (state%status(p) == state_slip) worst = max(worst, norm2(t*norm2(slip) + limit*slip))
               worst = max(worst, maxval(abs(gap(:, p) - state%gap(:, p))*merge(1, 0, state%status(p) /= state_open)))
            end associate
         end do
         call check(error, worst <= 1.0e-9_wp*scale, 'a law is violated')
         if (allocated(error)) return
      end do
   end subroutine test_condensed_laws

   !> The bound that the iteration stops on is above the true error.
   subroutine test_error_bound(error)
      type(error_type), allocatable, intent(out) :: error
      type(contact_problem_t) :: problem
      type(plain_jacobi_t) :: loose, tight
      type(contact_state_t) :: a, b
      type(solve_record_t) :: record
      type(mslip_error), allocatable :: failure

      problem = half_space_like_problem(8, 6, 0.5_wp)
      loose%tolerance = 1.0e-4_wp
      tight%tolerance = 1.0e-11_wp
      a = new_state(problem)
      b = a
      call loose%start(problem, a, failure)
      call tight%start(problem, b, failure)
      call tight%advance(problem, [1.0_wp, 0.3_wp, 0.0_wp], b, record)
      call loose%advance(problem, [1.0_wp, 0.3_wp, 0.0_wp], a, record)
      call check(error, maxval(abs(a%force - b%force)) <= record%error_estimate*maxval(b%force))
      if (allocated(error)) return
      call check(error, record%error_estimate <= loose%tolerance)
   end subroutine test_error_bound

   subroutine test_unconverged(error)
      type(error_type), allocatable, intent(out) :: error
      type(contact_problem_t) :: problem
      type(plain_jacobi_t) :: plain
      type(contact_state_t) :: state
      type(solve_record_t) :: record
      type(mslip_error), allocatable :: failure

      problem = half_space_like_problem(5, 5, 0.5_wp)
      plain%max_iterations = 3
      state = new_state(problem)
      call plain%start(problem, state, failure)
      call plain%advance(problem, [1.0_wp, 0.3_wp, 0.0_wp], state, record)
      call check(error,.not. record%converged .and. record%iterations == 3)
      if (allocated(error)) return
      call check(error, record%error_estimate > plain%tolerance)
   end subroutine test_unconverged

   subroutine test_indefinite(error)
      type(error_type), allocatable, intent(out) :: error
      type(contact_problem_t) :: problem
      type(plain_jacobi_t) :: plain
      type(mslip_error), allocatable :: failure

      problem = half_space_like_problem(3, 3, 0.5_wp)
      problem%G(5, 5) = -problem%G(5, 5)
      call plain%start(problem, new_state(problem), failure)
      call check(error, allocated(failure))
      if (allocated(error)) return
      call check(error, index(failure%message, 'not positive definite') > 0)
   end subroutine test_indefinite

end module test_contact_solvers
