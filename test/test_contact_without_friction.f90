!> Points without friction: no tangential unknowns, whatever the solver, and the same forces, slips and counts as where
!> they are kept; alone, and among points with friction.
module test_contact_without_friction
   use microslip_contact_base_set, only: base_set_t
   use microslip_contact_condensed, only: condensed_solver_t
   use microslip_contact_factory, only: contact_options_t, new_contact_solver
   use microslip_contact_laws, only: state_open, state_slip, state_stick
   use microslip_contact_plain_jacobi, only: plain_jacobi_t
   use microslip_contact_problem, only: contact_problem_t, contact_state_t, solve_record_t, contact_solver_t, new_state, gap_of
   use microslip_core_error, only: mslip_error => error_t
   use microslip_core_kinds, only: wp
   use support_dense_compliance, only: with_operator
   use test_contact_solvers, only: half_space_like_problem, driver
   use testdrive, only: new_unittest, unittest_type, error_type, check
   implicit none(type, external)
   private

   public :: collect_contact_without_friction

   !> Solvers stop at 1e-10 of the largest force of a step; over steps with friction errors add up.
   real(wp), parameter :: step_error = 1.0e-9_wp
   integer, parameter :: steps = 60

contains

   subroutine collect_contact_without_friction(testsuite)
      type(unittest_type), allocatable, intent(out) :: testsuite(:)
      testsuite = [ &
         & new_unittest('condensed = all others', test_all), &
         & new_unittest('mixed friction: condensed = all others', test_mixed), &
         & new_unittest('velocity level', test_velocity_level), &
         & new_unittest('one interface of two without friction', test_groups), &
         & new_unittest('a closed contact takes no iterations', test_no_iterations), &
         & new_unittest('lift-off alone takes unknowns', test_lift_off), &
         & new_unittest('slips are there when asked for', test_lazy), &
         & new_unittest('tangential stiffness is zero in the base set', test_base_set)]
   end subroutine collect_contact_without_friction

   !> Points without friction, or every third one with.
   function scene(nx, ny, mixed) result(problem)
      integer, intent(in) :: nx, ny
      logical, intent(in) :: mixed
      type(contact_problem_t) :: problem

      problem = half_space_like_problem(nx, ny, 0.0_wp)
      if (mixed) problem%friction(::3) = 0.4_wp
      allocate (problem%outputs(3*problem%n_points, 1))
      problem%outputs(:, 1) = problem%R(:, 3)
   end function scene

   !> Drive both solvers along the path, and compare all that they tell.
   subroutine compare(problem, problem_other, one, other, error, last)
      !> The same for both, in the way that the solver wants it
      type(contact_problem_t), intent(in) :: problem, problem_other
      class(contact_solver_t), intent(inout) :: one, other
      type(error_type), allocatable, intent(out) :: error
      !> Last step, if it is not that of the whole path
      integer, intent(in), optional :: last
      type(contact_state_t) :: a, b
      type(solve_record_t) :: record_a, record_b
      type(mslip_error), allocatable :: failure
      real(wp) :: scale, gap_scale
      integer :: k, c, n, opened
      logical :: closed(problem%n_points), was_closed(problem%n_points)

      a = new_state(problem)
      b = a
      call one%start(problem, a, failure)
      if (.not. allocated(failure)) call other%start(problem_other, b, failure)
      call check(error,.not. allocated(failure), 'start failed')
      if (allocated(error)) return
      scale = 0.0_wp
      opened = 0
      closed = .false.
      gap_scale = maxval(abs(problem%G))
      n = steps
      if (present(last)) n = last
      do k = 1, n
         call one%advance(problem, driver(k), a, record_a)
         call other%advance(problem_other, driver(k), b, record_b)
         call check(error, record_a%converged .and. record_b%converged, 'not converged')
         if (allocated(error)) return
         scale = max(scale, maxval(b%force))
         call check(error, maxval(abs(a%force - b%force)) <= steps*step_error*scale, 'forces differ')
         if (allocated(error)) return
         call check(error, all(record_a%counts == record_b%counts), 'counts differ')
         if (allocated(error)) return
         was_closed = closed
         closed = a%status /= state_open
         opened = opened + count(was_closed .and. .not. closed)
         call check(error, all(a%status == state_slip .or. problem%friction > 0.0_wp .or. .not. closed), &
            & 'a closed point without friction does not slip')
         if (allocated(error)) return
         do c = 1, 3
            call check(error, maxval(abs(a%gap(c, :) - b%gap(c, :)), mask=closed) <= &
               & steps*step_error*scale*gap_scale*problem%n_points, 'gaps of closed points differ')
            if (allocated(error)) return
         end do
         call check(error, maxval(abs(record_a%reaction - record_b%reaction)) <= &
            & steps*step_error*scale*maxval(sum(abs(problem%R), dim=1)), 'reactions differ')
         if (allocated(error)) return
         call check(error, maxval(abs(record_a%output - record_b%output)) <= &
            & steps*step_error*scale*sum(abs(problem%outputs)), 'outputs differ')
         if (allocated(error)) return
         call check(error, abs(record_a%contact_energy - record_b%contact_energy) <= &
            & steps*step_error*scale**2*gap_scale*problem%n_points**2, 'energies differ')
         if (allocated(error)) return
         if (all(problem%friction <= 0.0_wp)) call check(error, record_a%friction_loss == 0.0_wp .and. &
            & all(a%force(2:3, :) == 0.0_wp), 'there is friction')
         if (allocated(error)) return
      end do
      ! The path leads through lift-off and closing again.
      call check(error, opened > problem%n_points/4, 'there was no lift-off')
   end subroutine compare

   subroutine test_all(error)
      type(error_type), allocatable, intent(out) :: error

      call compare_all(.false., [character(len=17) :: 'jacobi', 'newton', 'jacobi_eliminated', 'matrix_free'], error)
   end subroutine test_all

   subroutine test_mixed(error)
      type(error_type), allocatable, intent(out) :: error

      call compare_all(.true., [character(len=17) :: 'jacobi', 'jacobi_eliminated', 'matrix_free'], error)
   end subroutine test_mixed

   !> The condensed solver against others.
   subroutine compare_all(mixed, names, error)
      logical, intent(in) :: mixed
      character(len=*), intent(in) :: names(:)
      type(error_type), allocatable, intent(out) :: error
      type(contact_problem_t) :: problem, problem_other
      type(condensed_solver_t) :: fast, fresh
      class(contact_solver_t), allocatable :: other
      type(mslip_error), allocatable :: failure
      integer :: k

      problem = scene(7, 5, mixed)
      do k = 1, size(names)
         call new_contact_solver(contact_options_t(trim(names(k))), other, failure)
         call check(error,.not. allocated(failure), 'no solver '//names(k))
         if (allocated(error)) return
         problem_other = problem
         if (names(k) == 'matrix_free') problem_other = with_outputs(problem)
         fast = fresh
         call compare(problem, problem_other, fast, other, error)
         if (allocated(error)) then
            error%message = trim(names(k))//': '//error%message
            return
         end if
      end do
   end subroutine compare_all

   !> The problem behind an operator, with its outputs.
   function with_outputs(problem) result(same)
      type(contact_problem_t), intent(in) :: problem
      type(contact_problem_t) :: same

      same = with_operator(problem)
      same%outputs = problem%outputs
   end function with_outputs

   subroutine test_velocity_level(error)
      type(error_type), allocatable, intent(out) :: error
      type(condensed_solver_t) :: fast
      type(plain_jacobi_t) :: plain
      type(contact_problem_t) :: problem
      integer :: k

      do k = 1, 2
         problem = scene(6, 4, mixed=k == 2)
         problem%velocity_level = .true.
         call compare(problem, problem, fast, plain, error)
         if (allocated(error)) return
      end do
   end subroutine test_velocity_level

   !> Two patches far apart that feel one another through three smooth patterns, one without friction and one with: large
   !> enough for their unknowns to be coupled by a low rank.
   subroutine test_groups(error)
      type(error_type), allocatable, intent(out) :: error
      type(contact_problem_t) :: free, rough, apart, together
      type(condensed_solver_t) :: one, two
      type(base_set_t) :: base
      type(mslip_error), allocatable :: failure
      real(wp), allocatable :: pattern(:, :)
      integer :: m, n, k

      free = scene(14, 14, .false.)
      rough = half_space_like_problem(9, 8, 0.4_wp)
      m = size(free%r_0)
      n = m + size(rough%r_0)
      together%n_points = free%n_points + rough%n_points
      together%friction = [free%friction, rough%friction]
      together%r_0 = [free%r_0, 1.1_wp*rough%r_0]
      together%R = reshape([transpose(free%R), transpose(0.9_wp*rough%R)], [n, 3], order=[2, 1])
      together%outputs = together%R(:, 3:3)
      pattern = reshape([(cos(0.01_wp*k*[1.0_wp, 2.0_wp, 3.0_wp]), k=1, n)], [3, n])
      together%G = 0.02_wp*matmul(transpose(pattern), pattern)
      together%G(:m, :m) = together%G(:m, :m) + free%G
      together%G(m + 1:, m + 1:) = together%G(m + 1:, m + 1:) + rough%G
      apart = together
      apart%group = [(merge(1, 2, k <= free%n_points), k=1, apart%n_points)]
      call base%build(apart, [(k, k=1, apart%n_points)], failure)
      call check(error,.not. allocated(failure) .and. base%groups == 2, 'the points are one group')
      if (allocated(error)) return
      one%expected_closed = spread(.true., 1, apart%n_points)
      two%expected_closed = one%expected_closed
      call compare(apart, together, two, one, error, last=15)
   end subroutine test_groups

   !> A flat contact that is pressed, sheared and tilted but stays closed is linear: nothing is iterated.
   subroutine test_no_iterations(error)
      type(error_type), allocatable, intent(out) :: error
      type(contact_problem_t) :: problem
      type(condensed_solver_t) :: solver
      type(contact_state_t) :: state
      type(solve_record_t) :: record
      type(mslip_error), allocatable :: failure
      real(wp), allocatable :: gap(:, :)
      real(wp) :: t
      integer :: k

      problem = scene(8, 6, .false.)
      problem%r_0 = 0.0_wp
      state = new_state(problem)
      solver%expected_closed = spread(.true., 1, problem%n_points)
      solver%lazy = .true.
      call solver%start(problem, state, failure)
      call check(error,.not. allocated(failure), 'start failed')
      do k = 1, 300
         if (allocated(error)) return
         t = 0.1_wp*k
         call solver%advance(problem, [1.0_wp + 0.5_wp*sin(t), 2.0_wp*sin(0.7_wp*t), 0.01_wp*sin(1.3_wp*t)], state, record)
         call check(error, record%converged .and. all(record%counts == [0, 0, problem%n_points]), 'not all closed')
         if (allocated(error)) return
         if (k > 1) call check(error, record%iterations == 0, 'a closed contact was iterated')
      end do
      if (allocated(error)) return
      ! Signorini's law, from the definition.
      call solver%complete(problem, state)
      gap = gap_of(problem, state%q, state%force)
      call check(error, maxval(abs(gap(1, :))) < step_error .and. minval(state%force(1, :)) > 0.0_wp, 'gaps are not closed')
   end subroutine test_no_iterations

   !> Iterations in steps that open or close points only, and those that follow them; none once all is closed again.
   subroutine test_lift_off(error)
      type(error_type), allocatable, intent(out) :: error
      type(contact_problem_t) :: problem
      type(condensed_solver_t) :: solver
      type(contact_state_t) :: state
      type(solve_record_t) :: record
      type(mslip_error), allocatable :: failure
      real(wp) :: tilt
      integer :: k, lifted

      problem = scene(8, 6, .false.)
      problem%r_0 = 0.0_wp
      state = new_state(problem)
      solver%expected_closed = spread(.true., 1, problem%n_points)
      call solver%start(problem, state, failure)
      call check(error,.not. allocated(failure), 'start failed')
      lifted = 0
      do k = 1, 200
         if (allocated(error)) return
         tilt = 0.6_wp*max(0.0_wp, sin(0.1_wp*k))
         call solver%advance(problem, [1.0_wp, sin(0.3_wp*k), tilt], state, record)
         call check(error, record%converged, 'not converged')
         if (record%counts(1) == 0 .and. k > 1 .and. tilt == 0.0_wp .and. .not. allocated(error)) &
            & call check(error, record%iterations == 0 .or. sin(0.1_wp*(k - 1)) > 0.0_wp, 'a closed contact was iterated')
         lifted = max(lifted, record%counts(1))
      end do
      if (.not. allocated(error)) call check(error, lifted > 10, 'nothing lifted off')
   end subroutine test_lift_off

   !> A lazy solver leaves the slips behind; `complete` brings them up to what the definition says.
   subroutine test_lazy(error)
      type(error_type), allocatable, intent(out) :: error
      type(contact_problem_t) :: problem
      type(condensed_solver_t) :: solver
      type(contact_state_t) :: state
      type(solve_record_t) :: record
      type(mslip_error), allocatable :: failure
      real(wp), allocatable :: gap(:, :)
      integer :: k, c

      problem = scene(7, 5, .true.)
      state = new_state(problem)
      solver%lazy = .true.
      call solver%start(problem, state, failure)
      call check(error,.not. allocated(failure), 'start failed')
      do k = 1, steps
         if (allocated(error)) return
         call solver%advance(problem, driver(k), state, record)
         if (mod(k, 7) /= 0) cycle
         call solver%complete(problem, state)
         gap = gap_of(problem, state%q, state%force)
         do c = 1, 3
            call check(error, maxval(abs(gap(c, :) - state%gap(c, :)), mask=state%status /= state_open) <= &
               & step_error*maxval(state%force)*maxval(abs(problem%G))*problem%n_points, 'gaps of closed points are behind')
            if (allocated(error)) return
         end do
      end do
   end subroutine test_lazy

   !> M is the inverse of G among the unknowns that carry force, zero elsewhere, and stays so when points enter and leave.
   subroutine test_base_set(error)
      type(error_type), allocatable, intent(out) :: error
      type(contact_problem_t) :: problem
      type(base_set_t) :: base, anew
      type(mslip_error), allocatable :: failure
      integer, allocatable :: carry(:), free(:), rows(:)
      real(wp), allocatable :: product(:, :)
      integer :: k, p

      problem = scene(8, 6, .true.)
      call base%build(problem, [(k, k=1, 40)], failure)
      if (.not. allocated(failure)) call base%enter(problem, [44, 42, 47], failure)
      if (.not. allocated(failure)) call base%leave(problem, [3, 7, 11, 42], failure)
      if (.not. allocated(failure)) call anew%build(problem, base%inside, failure)
      call check(error,.not. allocated(failure), 'the base set fails')
      if (allocated(error)) return
      carry = [integer ::]
      free = [integer ::]
      rows = [integer ::]
      do k = 1, size(base%inside)
         p = base%inside(k)
         rows = [rows, 3*p - [2, 1, 0]]
         carry = [carry, 3*k - 2]
         if (problem%friction(p) > 0.0_wp) carry = [carry, 3*k - [1, 0]]
         if (problem%friction(p) <= 0.0_wp) free = [free, 3*k - [1, 0]]
      end do
      product = matmul(problem%G(rows(carry), rows(carry)), base%M(carry, carry))
      do k = 1, size(carry)
         product(k, k) = product(k, k) - 1.0_wp
      end do
      call check(error, maxval(abs(product)) < 1.0e-11_wp, 'M is not the inverse')
      if (.not. allocated(error)) call check(error, all(base%M(:, free) == 0.0_wp) .and. all(base%M(free, :) == 0.0_wp) &
         & .and. all(base%slope(:, free) == 0.0_wp) .and. all(base%T_t(free, :) == 0.0_wp) &
         & .and. all(base%output_slope(:, free) == 0.0_wp), 'what carries no force has a stiffness')
      if (.not. allocated(error)) call check(error, maxval(abs(base%T_t - anew%T_t)) < 1.0e-11_wp*maxval(abs(anew%T_t)) &
         & .and. maxval(abs(base%slope - anew%slope)) < 1.0e-11_wp*maxval(abs(anew%slope)), 'operators differ from new ones')
   end subroutine test_base_set

end module test_contact_without_friction
