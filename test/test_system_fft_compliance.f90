!> The compliance as an operator against the matrix: products, preload, linear modes, and steps through stick, slip,
!> gross slip, lift-off and re-closing.
module test_system_fft_compliance
   use microslip_analysis_linear_modes, only: stuck_stiffness
   use microslip_analysis_operating_state, only: operating_state_t
   use microslip_analysis_preload, only: preload_options_t, preload_record_t, run_preload
   use microslip_analysis_statics, only: static_problem
   use microslip_contact_condensed, only: condensed_solver_t
   use microslip_contact_factory, only: contact_options_t
   use microslip_contact_laws, only: state_open
   use microslip_contact_matrix_free, only: matrix_free_solver_t
   use microslip_contact_problem, only: contact_problem_t, contact_state_t, solve_record_t, count_states, gap_of
   use microslip_core_error, only: error_t
   use microslip_core_kinds, only: wp
   use microslip_core_text, only: to_text
   use microslip_fe_reduced_model, only: reduced_model_t
   use microslip_system_compliance_choice, only: compliance_auto, compliance_dense, compliance_fft, compliance_named, &
      & dense_memory, takes_fft
   use microslip_system_jointed_system, only: jointed_system_t
   use support_checks, only: good
   use support_joint, only: make_joint, preload_joint
   use testdrive, only: check, new_unittest, testing_error => error_type, unittest_type
   implicit none(type, external)
   private

   public :: collect_system_fft_compliance

   !> Rounding of a product, relative.
   real(wp), parameter :: rounding = 1.0e-13_wp
   !> Solver tolerance, and what it leaves of forces on the way through a hundred steps.
   real(wp), parameter :: tolerance = 1.0e-10_wp, agreement = 1.0e-7_wp
   !> m, of the hills
   real(wp), parameter :: peak_to_peak = 2.0e-6_wp

contains

   subroutine collect_system_fft_compliance(testsuite)
      type(unittest_type), allocatable, intent(out) :: testsuite(:)

      testsuite = [ &
         & new_unittest('operator = matrix', test_products), &
         & new_unittest('preconditioner is symmetric positive definite', test_preconditioner), &
         & new_unittest('preload, modes: operator = matrix', test_preload), &
         & new_unittest('steps: operator = matrix', test_steps), &
         & new_unittest('set grows: the form stays', test_widen), &
         & new_unittest('choice of the form', test_choice)]
   end subroutine collect_system_fft_compliance

   !> A joint with its compliance in the given form, on the points of a mask or all.
   subroutine joint_with(form, cells, system, lib, leave_out)
      integer, intent(in) :: form, cells(2)
      type(jointed_system_t), intent(out) :: system
      type(error_t), allocatable, intent(out) :: lib
      !> Leave out every so manyth point
      integer, intent(in), optional :: leave_out
      type(reduced_model_t) :: reduced
      logical, allocatable :: potential(:)

      call make_joint(cells(1), cells(2), peak_to_peak, reduced, system, lib)
      if (allocated(lib)) return
      system%compliance = form
      allocate (potential(system%grid_point_count()), source=.true.)
      if (present(leave_out)) potential(leave_out::leave_out) = .false.
      call system%restrict(potential, lib)
   end subroutine joint_with

   !> G of dynamics and of statics, with points left out.
   subroutine test_products(error)
      type(testing_error), allocatable, intent(out) :: error
      type(error_t), allocatable :: lib
      type(jointed_system_t) :: dense, fft
      type(contact_problem_t) :: static_dense, static_fft
      real(wp), allocatable :: response(:, :)

      call joint_with(compliance_dense, [11, 8], dense, lib, leave_out=3)
      if (.not. allocated(lib)) call joint_with(compliance_fft, [11, 8], fft, lib, leave_out=3)
      if (.not. allocated(lib)) call static_problem(dense, [1, 2], static_dense, response, lib)
      if (.not. allocated(lib)) call static_problem(fft, [1, 2], static_fft, response, lib)
      call good(error, lib)
      if (allocated(error)) return
      call check(error, .not. allocated(fft%problem%G) .and. .not. allocated(static_fft%G), 'there is a matrix')
      if (allocated(error)) return
      call check(error, maxval(abs(static_dense%R - static_fft%R)) <= rounding*maxval(abs(static_dense%R)), 'R differs')
      if (allocated(error)) return
      call compare(dense%problem, fft%problem)
      if (allocated(error)) return
      call compare(static_dense, static_fft)

   contains

      subroutine compare(with_matrix, with_operator)
         type(contact_problem_t), intent(in) :: with_matrix, with_operator
         real(wp), allocatable :: force(:, :), one(:, :), other(:, :)
         real(wp) :: q(size(with_matrix%R, 2))

         q = 0.0_wp
         allocate (force(3, with_matrix%n_points))
         call random_number(force)
         force(2:3, :) = force(2:3, :) - 0.5_wp
         one = gap_of(with_matrix, q, force)
         other = gap_of(with_operator, q, force)
         call check(error, maxval(abs(one - other)) <= rounding*maxval(abs(one)), 'products differ')
      end subroutine compare

   end subroutine test_products

   subroutine test_preconditioner(error)
      type(testing_error), allocatable, intent(out) :: error
      type(error_t), allocatable :: lib
      type(jointed_system_t) :: fft
      real(wp), allocatable, dimension(:, :) :: x, y, Bx, By, stiffness

      call joint_with(compliance_fft, [12, 7], fft, lib, leave_out=4)
      call good(error, lib)
      if (allocated(error)) return
      associate (operator => fft%problem%compliance)
         allocate (x(3, fft%problem%n_points))
         allocate (y, Bx, By, mold=x)
         call random_number(x)
         call random_number(y)
         x = x - 0.5_wp
         call operator%precondition(x, Bx)
         call operator%precondition(y, By)
         call check(error, abs(sum(y*Bx) - sum(x*By)) <= rounding*norm2(x)*norm2(By), 'not symmetric')
         if (allocated(error)) return
         call check(error, sum(x*Bx) > 0.0_wp .and. sum(y*By) > 0.0_wp, 'not positive')
         if (allocated(error)) return
         ! The diagonal is what one point alone feels.
         x = 0.0_wp
         x(1, 5) = 1.0_wp
         x(3, 9) = 1.0_wp
         call operator%precondition(x, Bx)
         stiffness = operator%local_stiffness()
         call operator%precondition(unit_vector(fft%problem%n_points, 3, 9), By)
         call check(error, abs(By(3, 9)/stiffness(3, 9) - 1.0_wp) <= rounding, 'diagonal')
         if (allocated(error)) return
         call check(error, abs((Bx(1, 5) - By(1, 5))/stiffness(1, 5) - 1.0_wp) <= rounding, 'diagonal, normal')
      end associate
   end subroutine test_preconditioner

   pure function unit_vector(points, component, point) result(x)
      integer, intent(in) :: points, component, point
      real(wp) :: x(3, points)
      x = 0.0_wp
      x(component, point) = 1.0_wp
   end function unit_vector

   !> The choice of points, the preload and the stuck structure.
   subroutine test_preload(error)
      type(testing_error), allocatable, intent(out) :: error
      type(error_t), allocatable :: lib
      type(jointed_system_t) :: dense, fft
      type(operating_state_t) :: a, b
      type(preload_record_t) :: record_a, record_b
      type(reduced_model_t) :: reduced
      real(wp), allocatable :: stiffness_a(:, :), stiffness_b(:, :)
      real(wp), parameter :: high = 3.0e-5_wp

      call make_joint(20, 14, high, reduced, dense, lib)
      call good(error, lib)
      if (allocated(error)) return
      fft = dense
      dense%compliance = compliance_dense
      fft%compliance = compliance_fft
      call preload_joint(dense, by('condensed'), a, record_a, lib)
      if (.not. allocated(lib)) call preload_joint(fft, by('matrix_free'), b, record_b, lib)
      if (.not. allocated(lib)) call stuck_stiffness(dense, a%contact%status, stiffness_a, lib)
      if (.not. allocated(lib)) call stuck_stiffness(fft, b%contact%status, stiffness_b, lib)
      call good(error, lib)
      if (allocated(error)) return
      call check(error, dense%problem%n_points == fft%problem%n_points .and. dense%problem%n_points < dense%grid_point_count(), &
         & 'points in potential contact')
      if (allocated(error)) return
      call check(error, all(a%contact%status == b%contact%status) .and. any(a%contact%status == state_open), 'states')
      if (allocated(error)) return
      call check(error, maxval(abs(a%contact%force - b%contact%force)) <= agreement*maxval(a%contact%force), 'forces')
      if (allocated(error)) return
      call check(error, maxval(abs(a%contact%gap - b%contact%gap)) <= agreement*maxval(abs(a%contact%gap)), 'gaps')
      if (allocated(error)) return
      call check(error, maxval(abs(a%amplitude - b%amplitude)) <= agreement*maxval(abs(a%amplitude)), 'amplitudes')
      if (allocated(error)) return
      call check(error, record_b%residual <= 10.0_wp*tolerance .and. record_b%error_estimate <= 10.0_wp*tolerance, 'residual')
      if (allocated(error)) return
      call check(error, maxval(abs(stiffness_a - stiffness_b)) <= agreement*maxval(abs(stiffness_a)), 'stuck stiffness')
      if (allocated(error)) return
      dense%problem%friction(::3) = 0.0_wp
      fft%problem%friction(::3) = 0.0_wp
      call stuck_stiffness(dense, a%contact%status, stiffness_a, lib)
      if (.not. allocated(lib)) call stuck_stiffness(fft, b%contact%status, stiffness_b, lib)
      call good(error, lib)
      if (allocated(error)) return
      call check(error, maxval(abs(stiffness_a - stiffness_b)) <= agreement*maxval(abs(stiffness_a)), &
         & 'stuck stiffness, some points without friction')
   end subroutine test_preload

   !> Contact options with a solver.
   function by(solver) result(options)
      character(len=*), intent(in) :: solver
      type(contact_options_t) :: options
      options%solver = solver
      options%tolerance = tolerance
   end function by

   !> Modal coordinates driven along a path that meets every regime.
   subroutine test_steps(error)
      type(testing_error), allocatable, intent(out) :: error
      type(error_t), allocatable :: lib
      type(jointed_system_t) :: dense, fft
      type(operating_state_t) :: start
      type(preload_options_t) :: options
      type(preload_record_t) :: record
      type(condensed_solver_t) :: one
      type(matrix_free_solver_t) :: other
      type(contact_state_t) :: a, b
      type(solve_record_t) :: record_a, record_b
      real(wp) :: q(6 + 3), difference
      integer :: k, counts(3), open_before, closings, openings, gross

      call joint_with(compliance_dense, [9, 6], dense, lib)
      if (.not. allocated(lib)) call joint_with(compliance_fft, [9, 6], fft, lib)
      options%loads = [1, 2]
      options%interface_force = [2210.0_wp, 2210.0_wp]
      if (.not. allocated(lib)) call run_preload(dense, options, by('condensed'), start, record, lib)
      a = start%contact
      b = a
      if (.not. allocated(lib)) call one%start(dense%problem, a, lib)
      if (.not. allocated(lib)) call other%start(fft%problem, b, lib)
      call good(error, lib)
      if (allocated(error)) return
      difference = 0.0_wp
      closings = 0
      openings = 0
      gross = 0
      do k = 1, 60
         q = start%contact%q
         q(:6) = q(:6) + amplitude_of(k)*[1.0_wp, 0.4_wp*sin(0.3_wp*k), 0.2_wp, 0.1_wp, 0.0_wp, 0.02_wp]
         open_before = count(b%status == state_open)
         call one%advance(dense%problem, q, a, record_a)
         call other%advance(fft%problem, q, b, record_b)
         call check(error, record_a%converged .and. record_b%converged, 'not converged')
         if (allocated(error)) return
         counts = count_states(b)
         if (counts(1) > open_before) openings = openings + 1
         if (counts(1) < open_before) closings = closings + 1
         if (counts(2) == 0 .and. counts(3) > 0) gross = gross + 1
         difference = max(difference, maxval(abs(a%force - b%force))/maxval(start%contact%force))
      end do
      call check(error, difference <= agreement, 'forces differ')
      if (allocated(error)) return
      call check(error, openings > 2 .and. closings > 2 .and. gross > 2, 'a regime was not visited: '//to_text(openings)//', ' &
         & //to_text(closings)//', '//to_text(gross))

   contains

      !> Growing oscillation of the first mode, m sqrt(kg).
      pure real(wp) function amplitude_of(k)
         integer, intent(in) :: k
         amplitude_of = 4.0e-6_wp*k*sin(0.5_wp*k)
      end function amplitude_of

   end subroutine test_steps

   !> Points that join while solvers are at work do not change the form.
   subroutine test_widen(error)
      type(testing_error), allocatable, intent(out) :: error
      type(error_t), allocatable :: lib
      type(jointed_system_t) :: fft
      real(wp), allocatable :: force(:, :), modal(:), load(:)
      integer :: added

      call joint_with(compliance_fft, [9, 6], fft, lib, leave_out=5)
      call good(error, lib)
      if (allocated(error)) return
      fft%compliance = compliance_auto
      allocate (force(3, fft%problem%n_points), modal(fft%n_modes), load(fft%n_loads), source=0.0_wp)
      load(1) = 1.0e5_wp
      call fft%widen_where_closed(modal, force, load, added, lib)
      call good(error, lib)
      if (allocated(error)) return
      call check(error, added > 0 .and. allocated(fft%problem%compliance) .and. .not. allocated(fft%problem%G))
      if (allocated(error)) return
      call check(error, fft%compliance == compliance_auto)
   end subroutine test_widen

   subroutine test_choice(error)
      type(testing_error), allocatable, intent(out) :: error

      call check(error, takes_fft(compliance_fft, 3.0_wp) .and. .not. takes_fft(compliance_dense, 1.0e6_wp))
      if (allocated(error)) return
      ! A matrix of 300 rows fits everywhere, one of a million nowhere.
      call check(error, .not. takes_fft(compliance_auto, 300.0_wp) .and. takes_fft(compliance_auto, 1.0e6_wp))
      if (allocated(error)) return
      call check(error, dense_memory(1000.0_wp) >= 8.0e6_wp)
      if (allocated(error)) return
      call check(error, compliance_named('auto', 'condensed', .true.) == compliance_auto &
         & .and. compliance_named('fft', 'condensed', .true.) == compliance_fft &
         & .and. compliance_named('dense', 'condensed', .true.) == compliance_dense &
         & .and. compliance_named('auto', 'jacobi', .true.) == compliance_dense &
         & .and. compliance_named('auto', 'condensed', .false.) == compliance_dense)
   end subroutine test_choice

end module test_system_fft_compliance
