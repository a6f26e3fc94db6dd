!> Tests of the linear modes: all closed points stuck, against the boundary with springs written out.
module test_analysis_linear_modes
   use microslip_analysis_linear_modes, only: linear_modes_t, solve_linear_modes, stuck_stiffness
   use microslip_analysis_operating_state, only: operating_state_t
   use microslip_analysis_preload, only: preload_options_t, preload_record_t, run_preload
   use microslip_contact_factory, only: contact_options_t
   use microslip_contact_laws, only: state_open, state_stick
   use microslip_core_error, only: error_t
   use microslip_core_kinds, only: wp, pi
   use microslip_linalg_dense, only: cholesky_factor, cholesky_solve, eigen_generalised, eigen_symmetric
   use support_brick, only: to_dense
   use support_brick_joint, only: brick_joint_t, dense_coupling, dense_half_space, make_brick_joint
   use support_checks, only: good
   use testdrive, only: check, new_unittest, testing_error => error_type, unittest_type
   implicit none(type, external)
   private

   public :: collect_analysis_linear_modes

   character(len=*), parameter :: methods(2) = [character(len=22) :: 'craig_bampton_massless', 'macneal']
   real(wp), parameter :: exactness = 1.0e-9_wp

contains

   subroutine collect_analysis_linear_modes(testsuite)
      type(unittest_type), allocatable, intent(out) :: testsuite(:)

      testsuite = [ &
         & new_unittest('stuck: the boundary with contact springs', test_stuck), &
         & new_unittest('some without friction: springs along the normal alone', test_frictionless), &
         & new_unittest('open: the structure without traction', test_open), &
         & new_unittest('open: frequencies of the FE model', test_fe_frequencies), &
         & new_unittest('between free and tied', test_bounds), &
         & new_unittest('shapes are normalised, as many as asked for', test_shapes)]
   end subroutine collect_analysis_linear_modes

   !> A preloaded brick joint with open and closed points.
   subroutine make_preloaded(method, joint, state, lib)
      character(len=*), intent(in) :: method
      type(brick_joint_t), intent(out) :: joint
      type(operating_state_t), intent(out) :: state
      type(error_t), allocatable, intent(out) :: lib
      type(preload_options_t) :: options
      type(preload_record_t) :: record
      type(contact_options_t) :: contact

      contact%solver = 'condensed'
      options%loads = [1]
      options%interface_force = [2000.0_wp]
      call make_brick_joint(1.0e-6_wp, 0.5_wp, joint, lib, method=method, elastic=[2.0e11_wp, 0.7e11_wp])
      if (.not. allocated(lib)) call run_preload(joint%system, options, contact, state, record, lib)
   end subroutine make_preloaded

   !> K_ii - K_bi^T (K_bb + springs)^-1 K_bi, springs = W_c C_cc^-1 W_c^T over the unknowns c. None: K_bb alone.
   subroutine condensed_stiffness(joint, held, stiffness, lib)
      type(brick_joint_t), intent(in) :: joint
      !> (3, points) n, t1, t2
      logical, intent(in) :: held(:, :)
      real(wp), allocatable, intent(out) :: stiffness(:, :)
      type(error_t), allocatable, intent(out) :: lib
      real(wp), allocatable :: W(:, :), C(:, :), springs(:, :), boundary(:, :), x(:, :)
      integer, allocatable :: rows(:)
      integer :: k

      rows = pack([(k, k=1, size(held))], [held])
      boundary = joint%reduced%K_bb
      if (size(rows) > 0) then
         W = dense_coupling(joint%system%pads(1))
         C = dense_half_space(joint%system%pads(1))
         C = C(rows, rows)
         springs = transpose(W(:, rows))
         call cholesky_factor(C, lib)
         if (allocated(lib)) return
         call cholesky_solve(C, springs)
         boundary = boundary + matmul(W(:, rows), springs)
      end if
      call cholesky_factor(boundary, lib)
      if (allocated(lib)) return
      x = joint%reduced%K_bi
      call cholesky_solve(boundary, x)
      stiffness = joint%reduced%K_ii - matmul(transpose(joint%reduced%K_bi), x)
   end subroutine condensed_stiffness

   !> Frequencies of a stiffness over the identity, Hz.
   subroutine frequencies_of(stiffness, frequency, lib)
      real(wp), intent(in) :: stiffness(:, :)
      real(wp), allocatable, intent(out) :: frequency(:)
      type(error_t), allocatable, intent(out) :: lib
      real(wp), allocatable :: work(:, :)

      work = 0.5_wp*(stiffness + transpose(stiffness))
      allocate (frequency(size(work, 1)))
      call eigen_symmetric(work, frequency, lib, values_only=.true.)
      frequency = sqrt(max(0.0_wp, frequency))/(2.0_wp*pi)
   end subroutine frequencies_of

   subroutine test_stuck(error)
      type(testing_error), allocatable, intent(out) :: error
      type(error_t), allocatable :: lib
      type(brick_joint_t) :: joint
      type(operating_state_t) :: state
      type(linear_modes_t) :: modes
      real(wp), allocatable :: stiffness(:, :), frequency(:)
      integer :: k

      do k = 1, size(methods)
         call make_preloaded(trim(methods(k)), joint, state, lib)
         if (.not. allocated(lib)) call solve_linear_modes(joint%system, state%contact%status, joint%system%n_modes, modes, lib)
         if (.not. allocated(lib)) call condensed_stiffness(joint, spread(state%contact%status /= state_open, 1, 3), stiffness, lib)
         if (.not. allocated(lib)) call frequencies_of(stiffness, frequency, lib)
         call good(error, lib)
         if (allocated(error)) return
         call check(error, maxval(abs(modes%frequency/frequency - 1.0_wp)) <= exactness, trim(methods(k))//': frequencies')
         if (allocated(error)) return
      end do
   end subroutine test_stuck

   !> Every third point has no friction; unequal materials, so that tangential forces would lift.
   subroutine test_frictionless(error)
      type(testing_error), allocatable, intent(out) :: error
      type(error_t), allocatable :: lib
      type(brick_joint_t) :: joint
      type(operating_state_t) :: state
      type(linear_modes_t) :: modes, stuck
      real(wp), allocatable :: stiffness(:, :), frequency(:)
      logical, allocatable :: held(:, :)

      call make_preloaded(trim(methods(1)), joint, state, lib)
      if (.not. allocated(lib)) call solve_linear_modes(joint%system, state%contact%status, joint%system%n_modes, stuck, lib)
      if (.not. allocated(lib)) then
         joint%system%problem%friction(::3) = 0.0_wp
         held = spread(state%contact%status /= state_open, 1, 3)
         held(2:3, ::3) = .false.
         call solve_linear_modes(joint%system, state%contact%status, joint%system%n_modes, modes, lib)
      end if
      if (.not. allocated(lib)) call condensed_stiffness(joint, held, stiffness, lib)
      if (.not. allocated(lib)) call frequencies_of(stiffness, frequency, lib)
      call good(error, lib)
      if (allocated(error)) return
      call check(error, maxval(abs(modes%frequency/frequency - 1.0_wp)) <= exactness, 'frequencies')
      if (.not. allocated(error)) call check(error, any(modes%frequency < (1.0_wp - 1.0e-4_wp)*stuck%frequency), &
         & 'friction makes no difference')
   end subroutine test_frictionless

   subroutine test_open(error)
      type(testing_error), allocatable, intent(out) :: error
      type(error_t), allocatable :: lib
      type(brick_joint_t) :: joint
      type(linear_modes_t) :: modes
      real(wp), allocatable :: stiffness(:, :), frequency(:)

      call make_brick_joint(0.0_wp, 0.5_wp, joint, lib)
      if (.not. allocated(lib)) call solve_linear_modes(joint%system, spread(state_open, 1, joint%system%problem%n_points), &
         & joint%system%n_modes, modes, lib)
      if (.not. allocated(lib)) call condensed_stiffness(joint, spread(spread(.false., 1, 3), 2, &
         & joint%system%problem%n_points), stiffness, lib)
      if (.not. allocated(lib)) call frequencies_of(stiffness, frequency, lib)
      call good(error, lib)
      if (allocated(error)) return
      call check(error, maxval(abs(modes%frequency/frequency - 1.0_wp)) <= exactness, 'frequencies differ')
   end subroutine test_open

   !> MacNeal keeps the free modes of the full model.
   subroutine test_fe_frequencies(error)
      type(testing_error), allocatable, intent(out) :: error
      type(error_t), allocatable :: lib
      type(brick_joint_t) :: joint
      type(linear_modes_t) :: modes
      real(wp), allocatable :: stiffness(:, :), mass(:, :), lambda(:)
      real(wp), parameter :: eigenvalue_accuracy = 1.0e-8_wp
      integer, parameter :: lowest = 8

      call make_brick_joint(0.0_wp, 0.5_wp, joint, lib, method='macneal')
      if (.not. allocated(lib)) call solve_linear_modes(joint%system, spread(state_open, 1, joint%system%problem%n_points), &
         & lowest, modes, lib)
      if (.not. allocated(lib)) then
         stiffness = to_dense(joint%model%stiffness)
         mass = to_dense(joint%model%mass)
         allocate (lambda(size(mass, 1)))
         call eigen_generalised(stiffness, mass, lambda, lib, values_only=.true.)
      end if
      call good(error, lib)
      if (allocated(error)) return
      call check(error, maxval(abs(2.0_wp*pi*modes%frequency/sqrt(lambda(:lowest)) - 1.0_wp)) < eigenvalue_accuracy, &
         & 'frequencies of the FE model')
   end subroutine test_fe_frequencies

   !> Open, some points stuck, all stuck, tied: every frequency rises, and none passes what the time step is bound to.
   subroutine test_bounds(error)
      type(testing_error), allocatable, intent(out) :: error
      type(error_t), allocatable :: lib
      type(brick_joint_t) :: joint
      type(operating_state_t) :: state
      type(linear_modes_t) :: open, some, all_stuck
      real(wp), allocatable :: tied(:)
      integer :: k
      real(wp), parameter :: slack = 1.0_wp + exactness

      do k = 1, size(methods)
         call make_preloaded(trim(methods(k)), joint, state, lib)
         associate (n => joint%system%problem%n_points, m => joint%system%n_modes)
            if (.not. allocated(lib)) call solve_linear_modes(joint%system, spread(state_open, 1, n), m, open, lib)
            if (.not. allocated(lib)) call solve_linear_modes(joint%system, state%contact%status, m, some, lib)
            if (.not. allocated(lib)) call solve_linear_modes(joint%system, spread(state_stick, 1, n), m, all_stuck, lib)
            if (.not. allocated(lib)) call frequencies_of(joint%reduced%K_ii, tied, lib)
         end associate
         call good(error, lib)
         if (allocated(error)) return
         call check(error, all(open%frequency <= some%frequency*slack) &
            & .and. all(some%frequency <= all_stuck%frequency*slack) &
            & .and. all(all_stuck%frequency <= tied*slack), trim(methods(k))//': frequencies out of order')
         if (allocated(error)) return
         call check(error, any(some%frequency > 1.01_wp*open%frequency), 'the contact has no effect')
         if (allocated(error)) return
         call check(error, abs(joint%system%highest_angular_frequency()/(2.0_wp*pi*maxval(tied)) - 1.0_wp) < exactness, &
            & trim(methods(k))//': highest angular frequency')
         if (allocated(error)) return
      end do
   end subroutine test_bounds

   subroutine test_shapes(error)
      type(testing_error), allocatable, intent(out) :: error
      type(error_t), allocatable :: lib
      type(brick_joint_t) :: joint
      type(operating_state_t) :: state
      type(linear_modes_t) :: modes
      real(wp), allocatable :: stiffness(:, :), gram(:, :)
      integer :: k
      integer, parameter :: wanted = 4

      call make_preloaded(trim(methods(1)), joint, state, lib)
      if (.not. allocated(lib)) call solve_linear_modes(joint%system, state%contact%status, wanted, modes, lib)
      if (.not. allocated(lib)) call stuck_stiffness(joint%system, state%contact%status, stiffness, lib)
      call good(error, lib)
      if (allocated(error)) return
      call check(error, all(shape(modes%shape) == [joint%system%n_modes, wanted]) .and. size(modes%frequency) == wanted, &
         & 'number of modes')
      if (allocated(error)) return
      gram = matmul(transpose(modes%shape), modes%shape)
      do k = 1, wanted
         gram(k, k) = gram(k, k) - 1.0_wp
         call check(error, maxval(abs(modes%shape(:, k))) == maxval(modes%shape(:, k)), 'sign of a shape')
         if (allocated(error)) return
      end do
      call check(error, maxval(abs(gram)) <= exactness, 'shapes are not orthonormal')
      if (allocated(error)) return
      call check(error, modes%residual <= exactness, 'residual')
      if (allocated(error)) return
      ! More than there are: all there are.
      call solve_linear_modes(joint%system, state%contact%status, 1000, modes, lib)
      call good(error, lib)
      if (allocated(error)) return
      call check(error, size(modes%frequency) == joint%system%n_modes, 'more modes than coordinates')
   end subroutine test_shapes

end module test_analysis_linear_modes
