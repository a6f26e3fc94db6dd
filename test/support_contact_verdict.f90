!> Judges what a contact solver returns, by the laws as they are written down and by nothing that a solver uses.
!>
!> A step is judged from the full relation u = r_0 + R q + G force at both ends. Per point, with the own stiffness k =
!> 1/G_nn of the point to turn displacements into forces:
!>     penetration            -k u_n                       tension         -force_n
!>     complementarity        min(k u_n, force_n)          Coulomb cone    |force_t| - mu force_n
!>     maximal dissipation    |force_t - w|, w the return of force_t - k slip to the disk of radius mu force_n
!>     closed points          k |u_n - gap_n of the state|, k |slip - slip of the state|
module support_contact_verdict
   use microslip_contact_factory, only: contact_options_t, new_contact_solver
   use microslip_contact_laws, only: state_open, state_slip
   use microslip_contact_problem, only: contact_problem_t, contact_solver_t, contact_state_t, gap_of, new_state, &
      & solve_record_t
   use microslip_core_error, only: error_t
   use microslip_core_kinds, only: wp
   use microslip_core_stopwatch, only: wall_time
   use support_dense_compliance, only: with_operator
   implicit none(type, external)
   private

   public :: verdict_t, judge_solver, law_violation, all_solvers

   !> Every solver the factory offers.
   character(len=*), parameter :: all_solvers(6) = [character(len=17) :: 'condensed', 'jacobi', 'jacobi_eliminated', &
      & 'gauss_seidel', 'newton', 'matrix_free']

   !> Largest force over what closes the largest gap at one point alone: forces beyond that are no measure.
   real(wp), parameter :: runaway = 1.0e3_wp

   !> How a scene went with a solver.
   type :: verdict_t
      !> 'holds': every step converged and obeys the laws; 'reported': the record says that steps did not converge, the
      !> others obey the laws; 'refused': the solver does not take the problem; 'WRONG'
      character(len=8) :: word = 'WRONG'
      integer :: steps = 0, unconverged = 0
      !> Largest violation of a law in a converged step, over the largest force of the converged steps
      real(wp) :: residual = 0.0_wp
      !> Largest error of the books of a converged step, contact energy and friction loss, over the largest energy
      real(wp) :: energy_error = 0.0_wp
      !> s
      real(wp) :: seconds = 0.0_wp
      !> (3, points) forces at the end, N
      real(wp), allocatable :: force(:, :)
      !> What a refusal says
      character(len=:), allocatable :: message
   end type verdict_t

contains

   !> Drive a solver along a path and judge every step.
   subroutine judge_solver(problem, path, solver_name, tolerance, max_iterations, allowed, verdict)
      !> With its matrix; 'matrix_free' is given it as an operator
      type(contact_problem_t), intent(in) :: problem
      !> (drivers, steps)
      real(wp), intent(in) :: path(:, :)
      character(len=*), intent(in) :: solver_name
      !> Asked of the solver
      real(wp), intent(in) :: tolerance
      integer, intent(in) :: max_iterations
      !> Violation of the laws and error of the books that rounding and tolerance excuse
      real(wp), intent(in) :: allowed
      type(verdict_t), intent(out) :: verdict
      class(contact_solver_t), allocatable :: solver
      type(contact_problem_t) :: given
      type(contact_state_t) :: before, state
      type(solve_record_t) :: record
      type(error_t), allocatable :: error
      real(wp), dimension(size(path, 2)) :: violation, books, largest, energy
      real(wp) :: started
      integer :: k

      given = problem
      if (solver_name == 'matrix_free') given = with_operator(problem)
      state = new_state(problem)
      verdict%force = state%force
      started = wall_time()
      call new_contact_solver(contact_options_t(trim(solver_name), tolerance, max_iterations), solver, error)
      if (.not. allocated(error)) call solver%start(given, state, error)
      if (allocated(error)) then
         verdict%word = 'refused'
         verdict%message = error%message
         return
      end if
      violation = 0.0_wp
      books = 0.0_wp
      largest = 0.0_wp
      energy = 0.0_wp
      do k = 1, size(path, 2)
         before = state
         call solver%advance(given, path(:, k), state, record)
         verdict%steps = k
         if (.not. all(abs(state%force) <= huge(1.0_wp)) .or. .not. all(abs(state%gap) <= huge(1.0_wp))) return
         call check_books(problem, before, state, record, books(k), energy(k))
         if (record%converged) then
            largest(k) = min(maxval(state%force), runaway*unhindered_scale(problem, before, state%q))
            violation(k) = law_violation(problem, before, state)
         else
            verdict%unconverged = verdict%unconverged + 1
            books(k) = 0.0_wp
         end if
      end do
      verdict%seconds = wall_time() - started
      verdict%force = state%force
      ! A scene in which nothing ever touches has no force to compare with: nothing may be violated at all.
      verdict%residual = maxval(violation)/max(maxval(largest), tiny(1.0_wp))
      verdict%energy_error = maxval(books)/max(maxval(energy), tiny(1.0_wp))
      if (.not. max(verdict%residual, verdict%energy_error) <= allowed) return
      verdict%word = 'holds'
      if (verdict%unconverged > 0) verdict%word = 'reported'
   end subroutine judge_solver

   !> Largest violation of the laws in a step, N.
   function law_violation(problem, before, state) result(worst)
      !> With its matrix
      type(contact_problem_t), intent(in) :: problem
      !> Both ends of the step
      type(contact_state_t), intent(in) :: before, state
      real(wp) :: worst
      real(wp) :: gap(3, problem%n_points), old(3, problem%n_points), slip(2), returned(2), k, limit
      integer :: p

      gap = gap_of(problem, state%q, state%force)
      old = gap_of(problem, before%q, before%force)
      worst = 0.0_wp
      do p = 1, problem%n_points
         k = 1.0_wp/problem%G(3*p - 2, 3*p - 2)
         slip = gap(2:3, p) - old(2:3, p)
         associate (normal => state%force(1, p), friction => state%force(2:3, p))
            limit = problem%friction(p)*normal
            worst = max(worst, -k*gap(1, p), -normal, min(k*gap(1, p), normal), norm2(friction) - limit)
            returned = friction - k*slip
            if (norm2(returned) > limit) returned = returned*(max(0.0_wp, limit)/norm2(returned))
            worst = max(worst, norm2(friction - returned))
         end associate
         if (state%status(p) == state_open) cycle
         worst = max(worst, k*abs(gap(1, p) - state%gap(1, p)))
         if (before%status(p) /= state_open) worst = max(worst, &
            & k*norm2(slip - (state%gap(2:3, p) - before%gap(2:3, p))))
      end do
   end function law_violation

   !> What it takes to undo, at one point alone, the largest gap and slip that there would be without contact forces, N.
   function unhindered_scale(problem, before, q) result(scale)
      type(contact_problem_t), intent(in) :: problem
      type(contact_state_t), intent(in) :: before
      real(wp), intent(in) :: q(:)
      real(wp) :: scale
      real(wp) :: gap(3, problem%n_points)
      integer :: p

      gap = gap_of(problem, q, 0.0_wp*before%force)
      gap(2:3, :) = gap(2:3, :) - before%gap(2:3, :)
      scale = maxval([(norm2(gap(:, p))/problem%G(3*p - 2, 3*p - 2), p=1, problem%n_points)])
   end function unhindered_scale

   !> Error of the contact energy and of the friction loss that the record gives, and the energy now, J.
   subroutine check_books(problem, before, state, record, books, energy)
      type(contact_problem_t), intent(in) :: problem
      type(contact_state_t), intent(in) :: before, state
      type(solve_record_t), intent(in) :: record
      real(wp), intent(out) :: books, energy
      real(wp) :: gap(3, problem%n_points), old(3, problem%n_points), free(3, problem%n_points), loss
      integer :: p

      gap = gap_of(problem, state%q, state%force)
      old = gap_of(problem, before%q, before%force)
      free = gap_of(problem, state%q, 0.0_wp*state%force)
      energy = 0.5_wp*sum(state%force*(gap - free))
      ! The friction force of a slipping point is at its limit all the way: trapezoids over the normal force.
      loss = 0.0_wp
      do p = 1, problem%n_points
         associate (slip => gap(2:3, p) - old(2:3, p))
            if (state%status(p) == state_slip) then
               loss = loss + problem%friction(p)*0.5_wp*(before%force(1, p) + state%force(1, p))*norm2(slip)
            else
               loss = loss - dot_product(state%force(2:3, p), slip)
            end if
         end associate
      end do
      books = max(abs(record%contact_energy - energy), abs(record%friction_loss - loss), -record%friction_loss)
      energy = max(abs(energy), abs(loss))
   end subroutine check_books

end module support_contact_verdict
