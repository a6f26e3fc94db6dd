!> Motions of the structure that only the contact holds: of a block that lies on a base and is pressed on it, say.
!>
!> Statics eliminate the modal coordinates with Khat^-1, Khat the structure with traction-free interfaces. Where that can move
!> freely, Khat is singular. With Z the free motions (Khat Z = 0, Z^T Z = 1) and a spring E that is anchored at Z c,
!>
!>     (Khat + E Z Z^T) d = f + R^T lambda + E Z c
!>
!> has the solution of statics where the spring carries no force, Z^T d = c, which is Z^T (f + R^T lambda) = 0. The anchor c
!> is a driver of the contact problem like a load amplitude. In every load step it follows the force of the spring, c <- c +
!> Z^T (f + R^T lambda)/E, until that is gone. With E a small part of the contact's own stiffness, about that part of
!> the force is left by each move.
module microslip_analysis_free_motion
   use microslip_contact_problem, only: contact_problem_t, contact_solver_t, contact_state_t, solve_record_t
   use microslip_core_error, only: error_t, bad_input
   use microslip_core_kinds, only: wp
   use microslip_linalg_dense, only: cholesky_factor, eigen_symmetric
   use microslip_system_jointed_system, only: jointed_system_t
   implicit none(type, external)
   private

   public :: free_motion_t, factor_of_statics

   !> Eigenvalues of Khat below this part of the largest one are zero but for rounding: Khat is a difference of matrices of the
   !> size of its largest eigenvalue.
   real(wp), parameter :: rounding = 1.0e-11_wp
   !> The spring over what the contact would have if its points were springs of their own.
   real(wp), parameter :: weak = 1.0e-3_wp
   !> Force of the spring that is left, over the sum of the sizes of all forces on the motion; moves of the anchor.
   real(wp), parameter :: balance = 1.0e-9_wp
   integer, parameter :: most_moves = 60

   type :: free_motion_t
      !> How many there are; nothing else is set where there is none
      integer :: count = 0
      !> (modes, motions) Z, and E, 1/s^2
      real(wp), allocatable :: shape(:, :)
      real(wp) :: spring = 0.0_wp
      !> (3 points, motions) R Z
      real(wp), allocatable :: contact(:, :)
      !> (motions, drivers) Z^T f of the drivers that are not anchors, and (motions) of what is always on
      real(wp), allocatable :: load(:, :), constant(:)
      !> (3, points) contact forces that do not count, N
      real(wp), allocatable :: reference(:, :)
   contains
      procedure :: advance
   end type free_motion_t

contains

   !> Cholesky factor of Khat, with the spring where the structure can move freely.
   subroutine factor_of_statics(system, factor, free, error)
      type(jointed_system_t), intent(in) :: system
      !> (modes, modes)
      real(wp), allocatable, intent(out) :: factor(:, :)
      !> Its motions and spring; the caller sets the rest
      type(free_motion_t), intent(out) :: free
      type(error_t), allocatable, intent(out) :: error
      real(wp), allocatable :: vectors(:, :)
      real(wp) :: values(size(system%stiffness, 1))

      vectors = system%stiffness
      call eigen_symmetric(vectors, values, error)
      if (allocated(error)) return
      free%count = count(values <= rounding*maxval(values))
      factor = system%stiffness
      if (free%count > 0) then
         free%shape = vectors(:, :free%count)
         free%contact = matmul(system%problem%R(:, :system%n_modes), free%shape)
         free%spring = weak*contact_stiffness(system, free%contact)
         if (.not. free%spring > 0.0_wp) then
            call refuse(error)
            return
         end if
         factor = factor + free%spring*matmul(free%shape, transpose(free%shape))
         allocate (free%constant(free%count), source=0.0_wp)
         allocate (free%reference(3, system%problem%n_points), source=0.0_wp)
      end if
      call cholesky_factor(factor, error)
      if (allocated(error)) call refuse(error)
   end subroutine factor_of_statics

   subroutine refuse(error)
      type(error_t), allocatable, intent(out) :: error
      call bad_input(error, 'the structure can move freely while its interfaces carry no force, in a way that no contact '// &
         & 'holds: it needs supports, or bolts that hold it, for a static preload')
   end subroutine refuse

   !> Smallest stiffness of the free motions if all points were closed and springs of their own, 1/s^2.
   real(wp) function contact_stiffness(system, motion) result(smallest)
      type(jointed_system_t), intent(in) :: system
      !> (3 points, motions) R Z
      real(wp), intent(in) :: motion(:, :)
      real(wp), allocatable :: own(:, :), joint(:, :)
      real(wp) :: values(size(motion, 2))
      type(error_t), allocatable :: error
      integer :: k

      if (allocated(system%problem%compliance)) then
         own = system%problem%compliance%local_stiffness()
      else
         own = reshape([(1.0_wp/system%problem%G(k, k), k=1, size(motion, 1))], [3, system%problem%n_points])
      end if
      joint = matmul(transpose(motion), motion*spread(reshape(own, [size(own)]), 2, size(motion, 2)))
      joint = 0.5_wp*(joint + transpose(joint))
      call eigen_symmetric(joint, values, error)
      smallest = 0.0_wp
      if (.not. allocated(error)) smallest = max(0.0_wp, minval(values))
      if (smallest <= rounding*maxval(values)) smallest = 0.0_wp
   end function contact_stiffness

   !> Take the contact to load amplitudes, and the anchor to where the spring carries nothing. Friction does not remember the
   !> moves: each of them starts from the state before.
   subroutine advance(self, problem, solver, loads, state, record, held)
      class(free_motion_t), intent(in) :: self
      !> Its drivers are the loads, then the anchors
      type(contact_problem_t), intent(in) :: problem
      class(contact_solver_t), allocatable, intent(inout) :: solver
      !> (drivers that are no anchors)
      real(wp), intent(in) :: loads(:)
      type(contact_state_t), intent(inout) :: state
      !> Of the last move, with the iterations of all; it has not converged where the contact does not hold the structure
      type(solve_record_t), intent(out) :: record
      !> Whether the contact holds the structure
      logical, intent(out), optional :: held
      class(contact_solver_t), allocatable :: trial_solver
      type(contact_state_t) :: trial
      real(wp), dimension(self%count) :: anchor, force, size_of_all
      real(wp), allocatable :: counted(:)
      integer :: move, k, iterations

      if (present(held)) held = .true.
      if (self%count == 0) then
         call solver%advance(problem, loads, state, record)
         return
      end if
      anchor = state%q(size(loads) + 1:)
      iterations = 0
      do move = 1, most_moves
         if (allocated(trial_solver)) deallocate (trial_solver)
         allocate (trial_solver, source=solver)
         trial = state
         call trial_solver%advance(problem, [loads, anchor], trial, record)
         iterations = iterations + record%iterations
         if (.not. record%converged) exit
         counted = reshape(trial%force - self%reference, [size(trial%force)])
         do k = 1, self%count
            force(k) = dot_product(self%load(k, :), loads) + self%constant(k) + dot_product(self%contact(:, k), counted)
            ! The contact solver's tolerance is a part of the whole contact force, not of its change.
            size_of_all(k) = sum(abs(self%load(k, :)*loads)) + abs(self%constant(k)) + sum(abs(self%contact(:, k)*counted)) &
               & + sum(abs(self%contact(:, k)*reshape(trial%force, [size(trial%force)])))
         end do
         if (all(abs(force) <= balance*maxval(size_of_all))) exit
         anchor = anchor + force/self%spring
      end do
      record%iterations = iterations
      if (move > most_moves) then
         record%converged = .false.
         if (present(held)) held = .false.
      end if
      call move_alloc(trial_solver, solver)
      state = trial
   end subroutine advance

end module microslip_analysis_free_motion
