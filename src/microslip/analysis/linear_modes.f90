!> Linear modes about the preload: all closed points stick (METHOD section 7).
!>
!>     (Khat + R_c^T G_cc^-1 R_c) phi = omega^2 phi,   phi^T phi = 1   (modal mass is the identity)
!> over the n_i modal coordinates; c: closed points, all three components, or the normal one where there is no friction.
module microslip_analysis_linear_modes
   use microslip_contact_closed_system, only: closed_system_t, state_frictionless
   use microslip_contact_laws, only: state_open, state_stick
   use microslip_core_error, only: error_t
   use microslip_core_kinds, only: wp, pi
   use microslip_linalg_dense, only: cholesky_factor, cholesky_solve, eigen_symmetric, product_of
   use microslip_system_jointed_system, only: jointed_system_t
   implicit none(type, external)
   private

   public :: linear_modes_t, solve_linear_modes, stuck_stiffness

   type :: linear_modes_t
      !> (modes) Hz, ascending
      real(wp), allocatable :: frequency(:)
      !> (modal coordinates, modes) mass-normalised; the largest component is positive
      real(wp), allocatable :: shape(:, :)
      !> Largest |K phi - omega^2 phi| over omega^2
      real(wp) :: residual = 0.0_wp
   end type linear_modes_t

contains

   !> Stiffness of the modal coordinates with all closed points stuck, (modes, modes), 1/s^2.
   subroutine stuck_stiffness(system, status, stiffness, error)
      type(jointed_system_t), intent(in) :: system
      !> (points) contact states
      integer, intent(in) :: status(:)
      real(wp), allocatable, intent(out) :: stiffness(:, :)
      type(error_t), allocatable, intent(out) :: error
      real(wp), allocatable :: factor(:, :), x(:, :)
      integer, allocatable :: rows(:)
      integer :: p, c

      associate (friction => system%problem%friction)
         rows = pack([((3*p - 3 + c, c=1, 3), p=1, size(status))], &
            & [((status(p) /= state_open .and. (c == 1 .or. friction(p) > 0.0_wp), c=1, 3), p=1, size(status))])
      end associate
      stiffness = system%stiffness
      if (size(rows) == 0) return
      if (allocated(system%problem%compliance)) then
         call add_stuck_points(system, status, stiffness, error)
         return
      end if
      factor = system%problem%G(rows, rows)
      call cholesky_factor(factor, error)
      if (allocated(error)) then
         error%message = 'contact compliance G is not positive definite on the closed points: '//error%message
         return
      end if
      x = system%problem%R(rows, :system%n_modes)
      call cholesky_solve(factor, x)
      stiffness = stiffness + matmul(transpose(system%problem%R(rows, :system%n_modes)), x)
      stiffness = 0.5_wp*(stiffness + transpose(stiffness))
   end subroutine stuck_stiffness

   !> The same with the compliance as an operator.
   subroutine add_stuck_points(system, status, stiffness, error)
      type(jointed_system_t), intent(in) :: system
      integer, intent(in) :: status(:)
      real(wp), intent(inout) :: stiffness(:, :)
      type(error_t), allocatable, intent(out) :: error
      type(closed_system_t) :: closed
      real(wp), allocatable :: R(:, :), x(:, :)
      integer, allocatable :: states(:)

      R = system%problem%R(:, :system%n_modes)
      associate (problem => system%problem)
         states = merge(state_stick, state_frictionless, problem%friction > 0.0_wp)
         where (status == state_open) states = state_open
         call closed%set_up(problem%compliance, problem%friction, states)
         call closed%learn(problem%compliance, error)
         if (allocated(error)) return
         allocate (x, mold=R)
         call closed%solve_columns(problem%compliance, R, x, error)
         if (allocated(error)) return
         call product_of(R, x, stiffness, transpose_a=.true., keep=1.0_wp)
      end associate
      stiffness = 0.5_wp*(stiffness + transpose(stiffness))
   end subroutine add_stuck_points

   !> The lowest linear modes with all closed points stuck.
   subroutine solve_linear_modes(system, status, n_modes, modes, error)
      type(jointed_system_t), intent(in) :: system
      !> (points) contact states
      integer, intent(in) :: status(:)
      !> How many; no more than there are modal coordinates are given
      integer, intent(in) :: n_modes
      type(linear_modes_t), intent(out) :: modes
      type(error_t), allocatable, intent(out) :: error
      real(wp), allocatable :: stiffness(:, :), vectors(:, :), lambda(:)
      integer :: k, n

      call stuck_stiffness(system, status, stiffness, error)
      if (allocated(error)) return
      vectors = stiffness
      allocate (lambda(size(stiffness, 1)))
      call eigen_symmetric(vectors, lambda, error)
      if (allocated(error)) return
      n = min(n_modes, size(lambda))
      modes%frequency = sqrt(max(0.0_wp, lambda(:n)))/(2.0_wp*pi)
      modes%shape = vectors(:, :n)
      do k = 1, n
         if (modes%shape(maxloc(abs(modes%shape(:, k)), dim=1), k) < 0.0_wp) modes%shape(:, k) = -modes%shape(:, k)
         modes%residual = max(modes%residual, norm2(matmul(stiffness, modes%shape(:, k)) &
            & - lambda(k)*modes%shape(:, k))/maxval(abs(lambda)))
      end do
   end subroutine solve_linear_modes

end module microslip_analysis_linear_modes
