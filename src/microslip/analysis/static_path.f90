!> Quasi-static response to a modal load about an equilibrium (METHOD sections 4 and 7): f = M phi alpha, all other
!> loads held. Everything is counted from the equilibrium (index 0).
!>
!>     d - d_0 = Khat^-1 (phi alpha + R^T (lambda - lambda_0)),      q = phi^T (d - d_0)
!>     gap     = r_0 + R_s alpha + G_static lambda,                  R_s = R Khat^-1 phi
!>
!> The driver of the contact problem is alpha (and the anchors of motions that only the contact holds); r_0 follows
!> from the equilibrium. With gap - gap_0 = R_s alpha +
!> G_static (lambda - lambda_0) and no work of the normal forces on what opens and closes, the energies are, without
!> any quadrature along the path, and without differences of large numbers,
!>
!>     stored        = alpha q / 2 + (lambda_0 + lambda) . (gap - gap_0) / 2     (loads that are held: their potential)
!>     friction_loss = sum over the steps of mu (mean lambda_n) |slip| >= 0      (`friction_work`)
!> and the work of alpha, by trapezoids over the steps, is compared with their sum.
module microslip_analysis_static_path
   use microslip_analysis_free_motion, only: factor_of_statics, free_motion_t
   use microslip_analysis_operating_state, only: operating_state_t
   use microslip_analysis_statics, only: static_problem
   use microslip_contact_factory, only: contact_options_t, new_contact_solver
   use microslip_contact_laws, only: state_open
   use microslip_contact_problem, only: contact_problem_t, contact_state_t, contact_solver_t, solve_record_t, gap_of
   use microslip_core_error, only: error_t
   use microslip_core_kinds, only: wp
   use microslip_linalg_dense, only: cholesky_solve
   use microslip_system_jointed_system, only: jointed_system_t
   implicit none(type, external)
   private

   public :: modal_statics_t, static_path_t, static_point_t, new_modal_statics, start_path

   !> The static problem of a modal load, and the equilibrium that it starts from.
   type :: modal_statics_t
      type(contact_problem_t) :: problem
      !> The equilibrium; its driver is alpha = 0
      type(contact_state_t) :: start
      !> (modes) load pattern phi
      real(wp), allocatable :: phi(:)
      !> (modes) Khat^-1 phi and (modes, 3 points) Khat^-1 R^T
      real(wp), allocatable, private :: direct(:), response(:, :)
      !> What only the contact holds
      type(free_motion_t), private :: free
   contains
      procedure :: point
   end type modal_statics_t

   !> Where a path is, and how it went there. To copy it is to branch off.
   type :: static_path_t
      type(contact_state_t) :: contact
      !> alpha, m sqrt(kg)/s^2, and q, m sqrt(kg)
      real(wp) :: load = 0.0_wp, displacement = 0.0_wp
      !> Of alpha along the path (trapezoids), J
      real(wp) :: work = 0.0_wp, friction_loss = 0.0_wp
      !> Since the start; the residual and the error estimate are the largest of all steps
      integer :: iterations = 0, unconverged = 0
      real(wp) :: residual = 0.0_wp, error_estimate = 0.0_wp
      !> Points that are open, stick, slip
      integer :: counts(3) = 0
      class(contact_solver_t), allocatable, private :: solver
   contains
      procedure :: advance
   end type static_path_t

   !> An equilibrium on the path, all of it counted from the start.
   type :: static_point_t
      !> alpha and q
      real(wp) :: load = 0.0_wp, displacement = 0.0_wp
      !> (modes) d - d_0
      real(wp), allocatable :: modal(:)
      !> (sensors) m
      real(wp), allocatable :: sensor(:)
      !> J; the error is work - stored energy - friction loss
      real(wp) :: work = 0.0_wp, stored_energy = 0.0_wp, friction_loss = 0.0_wp, balance_error = 0.0_wp
      integer :: iterations = 0
      real(wp) :: residual = 0.0_wp, error_estimate = 0.0_wp
      integer :: counts(3) = 0
   end type static_point_t

contains

   !> Set up the statics of f = M phi alpha about an equilibrium.
   subroutine new_modal_statics(system, state, phi, statics, error)
      type(jointed_system_t), intent(in) :: system
      !> The equilibrium; its loads are held
      type(operating_state_t), intent(in) :: state
      !> (modes)
      real(wp), intent(in) :: phi(:)
      type(modal_statics_t), intent(out) :: statics
      type(error_t), allocatable, intent(out) :: error
      real(wp), allocatable :: factor(:, :), direct(:, :)
      type(free_motion_t) :: free

      call static_problem(system, [integer ::], statics%problem, statics%response, error, free=free)
      if (.not. allocated(error)) call factor_of_statics(system, factor, statics%free, error)
      if (allocated(error)) return
      direct = reshape(phi, [size(phi), 1])
      call cholesky_solve(factor, direct)
      statics%phi = phi
      statics%direct = direct(:, 1)
      statics%start = state%contact
      associate (problem => statics%problem)
         problem%R = matmul(system%problem%R(:, :system%n_modes), direct)
         statics%start%q = [0.0_wp]
         if (statics%free%count > 0) then
            problem%R = reshape([problem%R, statics%free%contact], [size(problem%R, 1), 1 + statics%free%count])
            statics%start%q = spread(0.0_wp, 1, 1 + statics%free%count)
            statics%free%load = reshape(matmul(phi, statics%free%shape), [statics%free%count, 1])
            statics%free%reference = state%contact%force
         end if
         problem%r_0 = 0.0_wp
         problem%r_0 = reshape(state%contact%gap - gap_of(problem, statics%start%q, state%contact%force), [3*problem%n_points])
      end associate
   end subroutine new_modal_statics

   !> A path at its start.
   subroutine start_path(statics, contact, path, error)
      type(modal_statics_t), intent(in) :: statics
      type(contact_options_t), intent(in) :: contact
      type(static_path_t), intent(out) :: path
      type(error_t), allocatable, intent(out) :: error

      call new_contact_solver(contact, path%solver, error)
      if (allocated(error)) return
      path%contact = statics%start
      call path%solver%start(statics%problem, path%contact, error)
   end subroutine start_path

   !> Go to another load in equal steps.
   subroutine advance(self, statics, load, steps)
      class(static_path_t), intent(inout) :: self
      type(modal_statics_t), intent(in) :: statics
      !> alpha to reach, m sqrt(kg)/s^2
      real(wp), intent(in) :: load
      integer, intent(in) :: steps
      type(solve_record_t) :: solved
      real(wp) :: from, now, moved
      integer :: k

      from = self%load
      do k = 1, steps
         now = from + (load - from)*k/steps
         call statics%free%advance(statics%problem, self%solver, [now], self%contact, solved)
         moved = modal_displacement(statics, self%contact) - self%displacement
         self%work = self%work + 0.5_wp*(self%load + now)*moved
         self%load = now
         self%displacement = self%displacement + moved
         self%friction_loss = self%friction_loss + solved%friction_loss
         self%iterations = self%iterations + solved%iterations
         self%residual = max(self%residual, solved%residual)
         self%error_estimate = max(self%error_estimate, solved%error_estimate)
         if (.not. solved%converged) self%unconverged = self%unconverged + 1
         self%counts = solved%counts
      end do
   end subroutine advance

   !> q = phi^T Khat^-1 phi alpha + R_s^T (lambda - lambda_0).
   pure real(wp) function modal_displacement(statics, contact) result(q)
      type(modal_statics_t), intent(in) :: statics
      type(contact_state_t), intent(in) :: contact

      q = dot_product(statics%phi, statics%direct)*contact%q(1) &
         & + dot_product(statics%problem%R(:, 1), reshape(contact%force - statics%start%force, [size(contact%force)]))
      if (statics%free%count > 0) q = q + dot_product(statics%free%load(:, 1), contact%q(2:))
   end function modal_displacement

   !> What there is to know about where a path is.
   function point(self, system, path)
      class(modal_statics_t), intent(in) :: self
      !> The system that the statics were made of
      type(jointed_system_t), intent(in) :: system
      type(static_path_t), intent(in) :: path
      type(static_point_t) :: point
      real(wp), allocatable :: change(:, :), moved(:, :), row(:)
      integer :: p

      change = path%contact%force - self%start%force
      row = reshape(change, [size(change)])
      ! What stuck has not moved, to the last digit; solvers need not know the tangential displacement of open points.
      moved = gap_of(self%problem, path%contact%q, change) - reshape(self%problem%r_0, shape(change))
      do p = 1, size(moved, 2)
         if (path%contact%status(p) /= state_open .and. self%start%status(p) /= state_open) &
            & moved(:, p) = path%contact%gap(:, p) - self%start%gap(:, p)
      end do
      point%load = path%load
      point%modal = self%direct*path%load + matmul(self%response, row)
      if (self%free%count > 0) point%modal = point%modal + matmul(self%free%shape, path%contact%q(2:))
      point%displacement = dot_product(self%phi, point%modal)
      point%sensor = matmul(point%modal, system%sensor_modal) + matmul(row, system%problem%outputs)
      point%work = path%work
      point%stored_energy = 0.5_wp*(path%load*point%displacement + sum((self%start%force + path%contact%force)*moved))
      point%friction_loss = path%friction_loss
      point%balance_error = point%work - point%stored_energy - point%friction_loss
      point%iterations = path%iterations
      point%residual = path%residual
      point%error_estimate = path%error_estimate
      point%counts = path%counts
   end function point

end module microslip_analysis_static_path
