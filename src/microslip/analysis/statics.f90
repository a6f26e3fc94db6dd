!> Contact problem of the statics: the modal coordinates d_i are eliminated (METHOD section 4):
!>     d_i = Khat^-1 (load_modal a + R^T lambda),   gap = -h + R_a a + G_static lambda,
!>     G_static = G + R Khat^-1 R^T,   R_a = W^T F f_b + R Khat^-1 load_modal
!>
!> A structure that is held by weak springs moves, as a whole, many orders of magnitude more than its contact gives way, and
!> G_static would have no digits left for the contact. Such modes are kept apart in the contact problem
!> (`microslip_contact_problem`): with Khat = Q Lambda Q^T,
!>     V = R q_k / sqrt(lambda_k),   D = q_k^T load_modal / sqrt(lambda_k)
!> for each of them; G_static and R_a hold the other modes.
!>
!> An initial pressure is on before the first load: r_0 = -G_static lambda_0, and in the modes lambda - lambda_0 takes the
!> place of lambda.
module microslip_analysis_statics
   use microslip_analysis_free_motion, only: factor_of_statics, free_motion_t
   use microslip_contact_problem, only: contact_problem_t
   use microslip_core_error, only: error_t, bad_input
   use microslip_core_kinds, only: wp
   use microslip_linalg_dense, only: cholesky_solve, eigen_symmetric, product_of
   use microslip_system_jointed_system, only: jointed_system_t
   implicit none(type, external)
   private

   public :: static_problem, static_modal

   !> A mode is kept apart where it gives way more than this times what a point does on its own: each digit more is a digit less
   !> in G.
   real(wp), parameter :: far_softer = 1.0e5_wp

contains

   !> Contact problem of the statics, its drivers are the amplitudes of `loads`; `response` = Khat^-1 [loads, R^T].
   subroutine static_problem(system, loads, problem, response, error, split, free)
      type(jointed_system_t), intent(in) :: system
      integer, intent(in) :: loads(:)
      type(contact_problem_t), intent(out) :: problem
      !> (modes, loads + 3 points)
      real(wp), allocatable, intent(out) :: response(:, :)
      type(error_t), allocatable, intent(out) :: error
      !> Whether modes that are far softer than the contact are kept apart (default: no)
      logical, intent(in), optional :: split
      !> What only the contact holds: its anchors are further drivers. Without it such a structure is refused
      type(free_motion_t), intent(out), optional :: free
      type(free_motion_t) :: motion
      real(wp), allocatable :: factor(:, :), still(:, :), soft(:, :), stiff(:, :)
      real(wp) :: held(system%n_loads)
      integer :: n, m, k

      n = 3*system%problem%n_points
      m = size(loads)
      call factor_of_statics(system, factor, motion, error)
      if (.not. allocated(error) .and. motion%count > 0 .and. .not. present(free)) call bad_input(error, &
         & 'the structure can move freely while its interfaces carry no force: it needs supports, or bolts that hold it')
      if (allocated(error)) return
      allocate (response(system%n_modes, m + n))
      response(:, :m) = system%load_modal(:, loads)
      response(:, m + 1:) = transpose(system%problem%R(:, :system%n_modes))
      call cholesky_solve(factor, response)

      problem%n_points = system%problem%n_points
      problem%friction = system%problem%friction
      problem%r_0 = system%problem%r_0
      held = system%held
      held(loads) = 0.0_wp
      if (present(split)) then
         if (split .and. motion%count == 0) call split_modes(system, soft, stiff, error)
         if (allocated(error)) return
      end if
      if (allocated(soft)) then
         call keep_apart(system, loads, held, factor, soft, stiff, problem)
         return
      end if
      if (any(held /= 0.0_wp)) then
         still = reshape(matmul(system%load_modal, held), [system%n_modes, 1])
         call cholesky_solve(factor, still)
         problem%r_0 = problem%r_0 + matmul(system%problem%R, [still(:, 1), held])
      end if
      if (allocated(system%problem%compliance)) then
         call system%static_compliance(factor, problem%compliance)
      else
         problem%G = system%problem%G
         call product_of(system%problem%R(:, :system%n_modes), response(:, m + 1:), problem%G, keep=1.0_wp)
         do k = 1, n
            problem%G(k, :k - 1) = problem%G(:k - 1, k)
         end do
      end if
      allocate (problem%R(n, m + motion%count))
      problem%R(:, :m) = system%problem%R(:, system%n_modes + loads) &
         & + matmul(system%problem%R(:, :system%n_modes), response(:, :m))
      if (.not. present(free)) return
      if (motion%count > 0) then
         problem%R(:, m + 1:) = motion%contact
         motion%load = matmul(transpose(motion%shape), system%load_modal(:, loads))
         motion%reference = system%initial_force()
      end if
      free = motion
   end subroutine static_problem

   !> Which modes of Khat are far softer than the contact: q_k / sqrt(lambda_k) of those, (modes, directions), and of the others.
   !> Neither is allocated where there are none.
   subroutine split_modes(system, soft, stiff, error)
      type(jointed_system_t), intent(in) :: system
      real(wp), allocatable, intent(out) :: soft(:, :), stiff(:, :)
      type(error_t), allocatable, intent(out) :: error
      real(wp), allocatable :: modes(:, :), lambda(:), gives(:), local(:, :)
      integer, allocatable :: apart(:), others(:)
      real(wp) :: own
      integer :: k, n

      modes = system%stiffness
      allocate (lambda(system%n_modes))
      call eigen_symmetric(modes, lambda, error)
      if (allocated(error)) return
      n = 3*system%problem%n_points
      if (allocated(system%problem%compliance)) then
         local = system%problem%compliance%local_stiffness()
         own = sum(1.0_wp/local)/n
      else
         own = sum([(system%problem%G(k, k), k=1, n)])/n
      end if
      do k = 1, system%n_modes
         modes(:, k) = modes(:, k)/sqrt(max(lambda(k), tiny(1.0_wp)))
      end do
      gives = sum(matmul(system%problem%R(:, :system%n_modes), modes)**2, dim=1)
      apart = pack([(k, k=1, system%n_modes)], gives > far_softer*own)
      if (size(apart) == 0) return
      others = pack([(k, k=1, system%n_modes)], gives <= far_softer*own)
      soft = modes(:, apart)
      stiff = modes(:, others)
   end subroutine split_modes

   !> G, R and r_0 of the stiff modes, and the soft ones beside them.
   subroutine keep_apart(system, loads, held, factor, soft, stiff, problem)
      type(jointed_system_t), intent(in) :: system
      integer, intent(in) :: loads(:)
      !> (loads) amplitudes that are always on
      real(wp), intent(in) :: held(:)
      !> Cholesky factor of Khat
      real(wp), intent(in), contiguous :: factor(:, :)
      !> From `split_modes`
      real(wp), intent(in) :: soft(:, :), stiff(:, :)
      type(contact_problem_t), intent(inout) :: problem
      real(wp), allocatable :: moved(:, :)

      associate (R => system%problem%R(:, :system%n_modes), R_loads => system%problem%R(:, system%n_modes + 1:))
         moved = matmul(R, stiff)
         problem%soft = matmul(R, soft)
         problem%soft_drive = matmul(transpose(soft), system%load_modal(:, loads))
         problem%soft_0 = matmul(transpose(soft), matmul(system%load_modal, held))
         problem%R = R_loads(:, loads) + matmul(moved, matmul(transpose(stiff), system%load_modal(:, loads)))
         problem%r_0 = problem%r_0 + matmul(R_loads, held) &
            & + matmul(moved, matmul(transpose(stiff), matmul(system%load_modal, held)))
      end associate
      if (allocated(system%problem%compliance)) then
         call system%static_compliance(factor, problem%compliance, stiff)
      else
         problem%G = system%problem%G
         call product_of(moved, moved, problem%G, transpose_b=.true., keep=1.0_wp)
         problem%G = 0.5_wp*(problem%G + transpose(problem%G))
      end if
   end subroutine keep_apart

   !> d_i of the statics under load amplitudes and contact forces, (modes).
   pure function static_modal(system, response, amplitude, force) result(modal)
      type(jointed_system_t), intent(in) :: system
      !> (modes, loads + 3 points) of `static_problem`
      real(wp), intent(in) :: response(:, :)
      !> (loads)
      real(wp), intent(in) :: amplitude(:)
      !> (3, points) N
      real(wp), intent(in) :: force(:, :)
      real(wp) :: modal(size(response, 1))

      modal = matmul(response(:, :size(amplitude)), amplitude) &
         & + matmul(response(:, size(amplitude) + 1:), reshape(force - system%initial_force(), [size(force)]))
   end function static_modal

end module microslip_analysis_statics
