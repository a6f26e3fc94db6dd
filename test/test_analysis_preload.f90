!> Tests of the preload: statics of a brick model against its full FE matrices, the contact laws on all points, the
!> forces asked for, load steps, and structures that cannot be preloaded.
module test_analysis_preload
   use microslip_analysis_operating_state, only: operating_state_t
   use microslip_analysis_potential_set, only: choose_potential_set
   use microslip_analysis_preload, only: frictionless_preload, preload_options_t, preload_record_t, run_preload
   use microslip_analysis_statics, only: static_problem
   use microslip_contact_factory, only: contact_options_t
   use microslip_contact_frictionless, only: solve_frictionless
   use microslip_contact_laws, only: state_open, state_slip, state_stick
   use microslip_contact_problem, only: contact_problem_t, gap_of
   use microslip_core_error, only: error_t, status_bad_input, status_failed
   use microslip_core_kinds, only: wp
   use microslip_core_text, only: to_text
   use microslip_fe_reduced_model, only: reduced_model_t
   use microslip_linalg_dense, only: cholesky_factor, cholesky_solve
   use microslip_system_jointed_system, only: jointed_system_t
   use support_brick, only: to_dense
   use support_brick_joint, only: brick_joint_t, dense_coupling, dense_half_space, make_brick_joint
   use support_joint, only: make_joint
   use support_checks, only: good
   use testdrive, only: check, new_unittest, testing_error => error_type, unittest_type
   implicit none(type, external)
   private

   public :: collect_analysis_preload

   !> N, and the hill of the brick joint, m: about half of its points close.
   real(wp), parameter :: pressing = 2000.0_wp, brick_hill = 1.0e-6_wp, joint_hill = 4.0e-6_wp
   !> Steel on something softer: normal forces pull tangentially.
   real(wp), parameter :: unequal(2) = [2.0e11_wp, 0.7e11_wp]
   !> Relative accuracy of interface forces and of contact forces.
   real(wp), parameter :: force_tolerance = 1.0e-9_wp, contact_tolerance = 1.0e-10_wp

contains

   subroutine collect_analysis_preload(testsuite)
      type(unittest_type), allocatable, intent(out) :: testsuite(:)

      testsuite = [ &
         & new_unittest('static compliance is that of the FE model', test_static_problem), &
         & new_unittest('equilibrium with the forces asked for', test_equilibrium), &
         & new_unittest('two pads with different forces', test_two_pads), &
         & new_unittest('given load amplitudes', test_load_scale), &
         & new_unittest('without friction', test_frictionless), &
         & new_unittest('a symmetric scene has symmetric pressures', test_symmetry), &
         & new_unittest('load steps', test_load_steps), &
         & new_unittest('solvers agree', test_solvers), &
         & new_unittest('points left out stay open', test_potential_set), &
         & new_unittest('normal gaps of all points', test_normal_gaps), &
         & new_unittest('one path: forces asked for are met at the end of it', test_one_path), &
         & new_unittest('a block that only the contact holds', test_free_structure), &
         & new_unittest('a block that nothing holds is refused', test_lost_structure), &
         & new_unittest('loads that press nothing are refused', test_useless_load)]
   end subroutine collect_analysis_preload

   !> Contact options with a solver.
   function by(solver) result(options)
      character(len=*), intent(in) :: solver
      type(contact_options_t) :: options
      options%solver = solver
      options%tolerance = contact_tolerance
   end function by

   !> Press the brick joint together.
   function press_only(steps) result(options)
      integer, intent(in) :: steps
      type(preload_options_t) :: options
      options%loads = [1]
      options%interface_force = [pressing]
      options%steps = steps
   end function press_only

   !> G_static = C + W^T K_s^-1 W and R = W^T d_b(loads) (METHOD, end of section 5) from the full FE stiffness:
   !> K_s^-1 = D K^-1 D^T, D the relative displacements of the node pairs. The reduction must be exact in statics.
   subroutine test_static_problem(error)
      type(testing_error), allocatable, intent(out) :: error
      type(error_t), allocatable :: lib
      type(brick_joint_t) :: joint
      type(contact_problem_t) :: problem
      real(wp), allocatable :: response(:, :), K(:, :), D(:, :), X(:, :), W(:, :), G(:, :), R(:, :)
      integer, allocatable :: rows(:, :)
      integer :: j, c, i
      real(wp), parameter :: exactness = 1.0e-9_wp

      call make_brick_joint(brick_hill, 0.5_wp, joint, lib, elastic=unequal)
      if (.not. allocated(lib)) call static_problem(joint%system, [1, 2], problem, response, lib)
      call good(error, lib)
      if (allocated(error)) return
      rows = joint%model%rows_of_nodes()
      associate (contact => joint%contact, pad => joint%system%pads(1))
         allocate (D(joint%model%row_count(), 3*contact%pair_count()), source=0.0_wp)
         do j = 1, contact%pair_count()
            do c = 1, 3
               do i = 1, 3
                  D(rows(i, contact%node_a(j)), 3*j - 3 + c) = contact%frame(i, c)
                  D(rows(i, contact%node_b(j)), 3*j - 3 + c) = -contact%frame(i, c)
               end do
            end do
         end do
         K = to_dense(joint%model%stiffness)
         call cholesky_factor(K, lib)
         call good(error, lib)
         if (allocated(error)) return
         X = D
         call cholesky_solve(K, X)
         W = dense_coupling(pad)
         G = dense_half_space(pad) + matmul(transpose(W), matmul(matmul(transpose(D), X), W))
         R = matmul(transpose(W), matmul(transpose(X), joint%patterns(:, :2)))
      end associate
      call check(error, maxval(abs(problem%G - G)) <= exactness*maxval(abs(G)), 'static compliance differs')
      if (allocated(error)) return
      call check(error, maxval(abs(problem%R - R)) <= exactness*maxval(abs(R)), 'gaps by the loads differ')
   end subroutine test_static_problem

   !> The contact laws at all grid points of all pads, and the equilibrium of the dynamic model at rest.
   subroutine check_equilibrium(system, state, error)
      type(jointed_system_t), intent(in) :: system
      type(operating_state_t), intent(in) :: state
      type(testing_error), allocatable, intent(out) :: error
      real(wp), allocatable :: everywhere(:, :), gap(:, :)
      real(wp) :: residual(system%n_modes), load(system%n_modes), length, force
      integer :: p

      associate (contact => state%contact, problem => system%problem)
         load = matmul(system%load_modal, state%amplitude)
         residual = matmul(system%stiffness, state%modal) - load - system%modal_force(contact%force)
         call check(error, maxval(abs(residual)) <= force_tolerance*(maxval(abs(load)) &
            & + maxval(abs(system%modal_force(contact%force)))), 'not in equilibrium')
         if (allocated(error)) return
         gap = gap_of(problem, [state%modal, state%amplitude], contact%force)
         length = maxval(abs(gap)) + maxval(abs(problem%r_0))
         call check(error, all(contact%q == [state%modal, state%amplitude]) &
            & .and. maxval(abs(contact%gap - gap)) <= force_tolerance*length, 'the gap does not belong to the forces')
         if (allocated(error)) return
         force = maxval(contact%force(1, :))
         do p = 1, problem%n_points
            associate (f => contact%force(:, p))
               if (contact%status(p) == state_open) then
                  call check(error, gap(1, p) >= -force_tolerance*length .and. all(f == 0.0_wp), 'open point with a force')
               else
                  call check(error, abs(gap(1, p)) <= force_tolerance*length .and. f(1) >= 0.0_wp .and. norm2(f(2:3)) &
                     & <= problem%friction(p)*f(1) + force_tolerance*force, 'closed point outside its laws')
               end if
            end associate
            if (allocated(error)) return
         end do
         everywhere = system%gaps_everywhere(state%modal, contact%force, state%amplitude)
         call check(error, minval(everywhere(1, :)) >= -force_tolerance*length, 'a point penetrates')
      end associate
   end subroutine check_equilibrium

   subroutine test_equilibrium(error)
      type(testing_error), allocatable, intent(out) :: error
      type(error_t), allocatable :: lib
      type(brick_joint_t) :: joint
      type(operating_state_t) :: state
      type(preload_record_t) :: record

      call make_brick_joint(brick_hill, 1.5_wp, joint, lib, elastic=unequal)
      if (.not. allocated(lib)) call run_preload(joint%system, press_only(5), by('condensed'), state, record, lib)
      call good(error, lib)
      if (allocated(error)) return
      associate (closed => count(state%contact%status /= state_open), all_points => joint%system%problem%n_points)
         call check(error, closed > all_points/5 .and. closed < all_points .and. any(state%contact%status == state_slip) &
            & .and. any(state%contact%status == state_stick), 'not the scene that was meant')
      end associate
      if (allocated(error)) return
      call check(error, abs(sum(state%contact%force(1, :)) - pressing) <= force_tolerance*pressing &
         & .and. record%force_deviation <= force_tolerance, 'the interface force is not that asked for')
      if (allocated(error)) return
      call check(error, state%amplitude(2) == 0.0_wp, 'a load that is not of the preload acts')
      if (allocated(error)) return
      call check_equilibrium(joint%system, state, error)
   end subroutine test_equilibrium

   subroutine test_two_pads(error)
      type(testing_error), allocatable, intent(out) :: error
      type(error_t), allocatable :: lib
      type(reduced_model_t) :: reduced
      type(jointed_system_t) :: system
      type(operating_state_t) :: state
      type(preload_options_t) :: options
      type(preload_record_t) :: record
      real(wp), parameter :: forces(2) = [1500.0_wp, 2600.0_wp]

      call make_joint(8, 5, joint_hill, reduced, system, lib)
      if (.not. allocated(lib)) call system%restrict(spread(.true., 1, system%grid_point_count()), lib)
      options%loads = [1, 2]
      options%interface_force = forces
      options%steps = 3
      if (.not. allocated(lib)) call run_preload(system, options, by('condensed'), state, record, lib)
      call good(error, lib)
      if (allocated(error)) return
      call check(error, all(abs(system%interface_forces(state%contact%force) - forces) <= force_tolerance*forces) &
         & .and. all(abs(record%interface_force - forces) <= force_tolerance*forces), 'forces differ')
      if (allocated(error)) return
      call check_equilibrium(system, state, error)
   end subroutine test_two_pads

   !> The amplitudes that a preload found, given as `scale`, give the same state.
   subroutine test_load_scale(error)
      type(testing_error), allocatable, intent(out) :: error
      type(error_t), allocatable :: lib
      type(brick_joint_t) :: joint
      type(operating_state_t) :: found, given
      type(preload_options_t) :: options
      type(preload_record_t) :: record

      call make_brick_joint(brick_hill, 0.5_wp, joint, lib, elastic=unequal)
      if (.not. allocated(lib)) call run_preload(joint%system, press_only(1), by('condensed'), found, record, lib)
      options%loads = [1]
      if (.not. allocated(lib)) options%scale = found%amplitude(:1)
      if (.not. allocated(lib)) call run_preload(joint%system, options, by('condensed'), given, record, lib)
      call good(error, lib)
      if (allocated(error)) return
      call check(error, maxval(abs(given%contact%force - found%contact%force)) &
         & <= 10*contact_tolerance*maxval(found%contact%force), 'contact forces differ')
      if (allocated(error)) return
      call check(error, all(given%amplitude == found%amplitude) .and. record%solves == 1, 'not the given amplitudes')
   end subroutine test_load_scale

   !> Friction zero: the normal contact problem of Signorini, solved by another algorithm.
   subroutine test_frictionless(error)
      type(testing_error), allocatable, intent(out) :: error
      type(error_t), allocatable :: lib
      type(brick_joint_t) :: joint
      type(contact_problem_t) :: problem
      type(operating_state_t) :: state
      type(preload_record_t) :: record
      real(wp), allocatable :: response(:, :), force(:), sensitivity(:, :)
      logical, allocatable :: closed(:)

      call make_brick_joint(brick_hill, 0.0_wp, joint, lib, elastic=unequal)
      if (.not. allocated(lib)) call run_preload(joint%system, press_only(1), by('condensed'), state, record, lib)
      if (.not. allocated(lib)) call static_problem(joint%system, [1], problem, response, lib)
      if (.not. allocated(lib)) then
         allocate (closed(problem%n_points), source=.true.)
         allocate (force(problem%n_points), sensitivity(problem%n_points, 1))
         call solve_frictionless(problem%G(1::3, 1::3), problem%r_0(1::3) + problem%R(1::3, 1)*state%amplitude(1), &
            & problem%R(1::3, :), closed, force, sensitivity, lib)
      end if
      call good(error, lib)
      if (allocated(error)) return
      call check(error, maxval(abs(state%contact%force(2:3, :))) <= contact_tolerance*maxval(force), 'there is friction')
      if (allocated(error)) return
      call check(error, maxval(abs(state%contact%force(1, :) - force)) <= 10*contact_tolerance*maxval(force), &
         & 'pressures differ')
   end subroutine test_frictionless

   !> The brick joint and its load are symmetric about its middle plane y: so are pressures and tractions.
   subroutine test_symmetry(error)
      type(testing_error), allocatable, intent(out) :: error
      type(error_t), allocatable :: lib
      type(brick_joint_t) :: joint
      type(operating_state_t) :: state
      type(preload_record_t) :: record
      real(wp), allocatable :: map(:, :)
      integer :: c

      call make_brick_joint(brick_hill, 0.5_wp, joint, lib, elastic=unequal)
      if (.not. allocated(lib)) call run_preload(joint%system, press_only(2), by('condensed'), state, record, lib)
      call good(error, lib)
      if (allocated(error)) return
      do c = 1, 3
         map = joint%system%pads(1)%grid%to_map(state%contact%force(c, :))
         call check(error, maxval(abs(map - merge(-1, 1, c == 3)*map(:, size(map, 2):1:-1))) &
            & <= 100*force_tolerance*maxval(state%contact%force), 'component '//to_text(c)//' is not symmetric')
         if (allocated(error)) return
      end do
   end subroutine test_symmetry

   !> Friction remembers the way: other steps, slightly other forces; every one an equilibrium.
   subroutine test_load_steps(error)
      type(testing_error), allocatable, intent(out) :: error
      type(error_t), allocatable :: lib
      type(brick_joint_t) :: joint
      type(operating_state_t) :: state(3)
      type(preload_options_t) :: options
      type(preload_record_t) :: record
      real(wp) :: change(2), scale
      integer :: k
      integer, parameter :: steps(3) = [1, 10, 20]

      call make_brick_joint(brick_hill, 0.3_wp, joint, lib, elastic=unequal)
      call good(error, lib)
      if (allocated(error)) return
      options%loads = [1, 2]
      options%scale = [4000.0_wp, 400.0_wp]
      do k = 1, 3
         options%steps = steps(k)
         call run_preload(joint%system, options, by('condensed'), state(k), record, lib)
         call good(error, lib)
         if (allocated(error)) return
         call check(error, record%solves == steps(k) .and. record%friction_loss > 0.0_wp, 'steps or friction missing')
         if (allocated(error)) return
         call check(error, any(state(k)%contact%status == state_slip), 'nothing slips')
         if (allocated(error)) return
         call check_equilibrium(joint%system, state(k), error)
         if (allocated(error)) return
      end do
      scale = maxval(state(3)%contact%force)
      change = [(maxval(abs(state(k)%contact%force - state(3)%contact%force))/scale, k=1, 2)]
      call check(error, change(1) > change(2) .and. change(2) > contact_tolerance .and. change(1) < 0.1_wp, &
         & 'changes '//to_text(change(1), 3)//', '//to_text(change(2), 3))
   end subroutine test_load_steps

   !> Newton and the paper's projected Jacobi find the same preload.
   subroutine test_solvers(error)
      type(testing_error), allocatable, intent(out) :: error
      type(error_t), allocatable :: lib
      type(brick_joint_t) :: joint
      type(operating_state_t) :: state, other
      type(preload_record_t) :: record
      integer :: k
      character(len=*), parameter :: solvers(2) = [character(len=17) :: 'jacobi', 'jacobi_eliminated']

      call make_brick_joint(brick_hill, 0.5_wp, joint, lib, elastic=unequal)
      if (.not. allocated(lib)) call run_preload(joint%system, press_only(2), by('condensed'), state, record, lib)
      do k = 1, 2
         if (.not. allocated(lib)) call run_preload(joint%system, press_only(2), by(trim(solvers(k))), other, record, lib)
         call good(error, lib)
         if (allocated(error)) return
         call check(error, maxval(abs(other%contact%force - state%contact%force)) &
            & <= 10*force_tolerance*maxval(state%contact%force), trim(solvers(k))//': other forces')
         if (allocated(error)) return
      end do
      call run_preload(joint%system, press_only(2), by('magic'), other, record, lib)
      call check(error, allocated(lib), 'an unknown solver was taken')
      if (allocated(error)) return
      call check(error, lib%status == status_bad_input .and. index(lib%message, 'magic') > 0, lib%message)
   end subroutine test_solvers

   !> The chosen set leaves points out, all of them open, and the forces are those with all points.
   subroutine test_potential_set(error)
      type(testing_error), allocatable, intent(out) :: error
      type(error_t), allocatable :: lib
      type(reduced_model_t) :: reduced
      type(jointed_system_t) :: system, full
      type(operating_state_t) :: state, full_state
      type(preload_options_t) :: options
      type(preload_record_t) :: record
      real(wp), allocatable :: everywhere(:, :)
      integer, allocatable :: chosen(:)
      integer :: added, k

      call make_joint(20, 12, 2.0_wp*joint_hill, reduced, system, lib)
      full = system
      options%loads = [1, 2]
      options%interface_force = [2210.0_wp, 2210.0_wp]
      if (.not. allocated(lib)) call full%restrict(spread(.true., 1, full%grid_point_count()), lib)
      if (.not. allocated(lib)) call choose_potential_set(system, options, [.false., .false.], [0.0_wp, -1.0_wp], lib)
      if (.not. allocated(lib)) call run_preload(system, options, by('condensed'), state, record, lib)
      if (.not. allocated(lib)) call run_preload(full, options, by('condensed'), full_state, record, lib)
      call good(error, lib)
      if (allocated(error)) return
      chosen = [(system%pads(k)%potential + (k - 1)*system%pads(1)%grid%point_count(), k=1, 2)]
      call check(error, size(chosen) < full%problem%n_points .and. size(system%pads(1)%potential) &
         & < size(system%pads(2)%potential), 'no points were left out, or the margin has no effect')
      if (allocated(error)) return
      call check(error, maxval(abs(state%contact%force - full_state%contact%force(:, chosen))) &
         & <= 100*force_tolerance*maxval(state%contact%force), 'forces differ from those with all points')
      if (allocated(error)) return
      everywhere = system%gaps_everywhere(state%modal, state%contact%force, state%amplitude)
      call check(error, minval(everywhere(1, :)) >= -force_tolerance*joint_hill, 'a point left out penetrates')
      if (allocated(error)) return
      call system%widen_where_closed(state%modal, state%contact%force, state%amplitude, added, lib)
      call check(error,.not. allocated(lib) .and. added == 0, 'points join that need not')
   end subroutine test_potential_set

   !> The quick normal gaps are those of the full evaluation: one pad of equal and of unequal materials, two pads.
   subroutine test_normal_gaps(error)
      type(testing_error), allocatable, intent(out) :: error
      type(error_t), allocatable :: lib
      type(brick_joint_t) :: joint
      type(reduced_model_t) :: reduced
      type(jointed_system_t) :: system

      call make_brick_joint(brick_hill, 0.6_wp, joint, lib)
      if (.not. allocated(lib)) call compare_gaps(joint%system, error, lib)
      if (.not. (allocated(lib) .or. allocated(error))) call make_brick_joint(brick_hill, 0.6_wp, joint, lib, elastic=unequal)
      if (.not. (allocated(lib) .or. allocated(error))) call compare_gaps(joint%system, error, lib)
      if (.not. (allocated(lib) .or. allocated(error))) call make_joint(20, 12, joint_hill, reduced, system, lib)
      if (.not. (allocated(lib) .or. allocated(error))) call compare_gaps(system, error, lib)
      if (allocated(lib)) call good(error, lib)
   end subroutine test_normal_gaps

   !> Random motion, forces on every other of the points in potential contact, which are two in three.
   subroutine compare_gaps(system, error, lib)
      type(jointed_system_t), intent(inout) :: system
      type(testing_error), allocatable, intent(out) :: error
      type(error_t), allocatable, intent(out) :: lib
      real(wp), allocatable :: force(:, :), everywhere(:, :), gap(:)
      real(wp) :: modal(system%n_modes), amplitude(system%n_loads)
      integer :: k
      !> Rounding of some thousand terms
      real(wp), parameter :: rounding = 1.0e4_wp*epsilon(1.0_wp)

      call system%restrict([(modulo(k, 3) /= 0, k=1, system%grid_point_count())], lib)
      if (allocated(lib)) return
      allocate (force(3, system%problem%n_points), gap(system%grid_point_count()))
      call random_number(force)
      call random_number(modal)
      call random_number(amplitude)
      force(2:3, :) = force(2:3, :) - 0.5_wp
      force(:, ::2) = 0.0_wp
      modal = 1.0e-6_wp*modal
      everywhere = system%gaps_everywhere(modal, force, amplitude)
      call system%normal_gaps_everywhere(modal, force, amplitude, gap)
      call check(error, maxval(abs(gap - everywhere(1, :))) <= rounding*maxval(abs(everywhere)), 'the normal gaps differ')
   end subroutine compare_gaps

   !> Ten load steps to forces asked for, and the amplitudes that they end in, given: the same path, which is not that of one
   !> step.
   subroutine test_one_path(error)
      type(testing_error), allocatable, intent(out) :: error
      type(error_t), allocatable :: lib
      type(brick_joint_t) :: joint
      type(operating_state_t) :: found, given, at_once
      type(preload_options_t) :: options
      type(preload_record_t) :: record
      real(wp) :: scale

      call make_brick_joint(brick_hill, 0.3_wp, joint, lib, elastic=unequal)
      if (.not. allocated(lib)) call run_preload(joint%system, press_only(1), by('condensed'), at_once, record, lib)
      if (.not. allocated(lib)) call run_preload(joint%system, press_only(10), by('condensed'), found, record, lib)
      call good(error, lib)
      if (allocated(error)) return
      call check(error, record%force_deviation <= force_tolerance, 'the forces are not met')
      if (allocated(error)) return
      options%loads = [1]
      options%scale = found%amplitude(:1)
      options%steps = 10
      call run_preload(joint%system, options, by('condensed'), given, record, lib)
      call good(error, lib)
      if (allocated(error)) return
      scale = maxval(found%contact%force)
      call check(error, maxval(abs(given%contact%force - found%contact%force)) <= 10*contact_tolerance*scale, &
         & 'another path: '//to_text(maxval(abs(given%contact%force - found%contact%force))/scale, 3))
      if (allocated(error)) return
      call check(error, record%solves == 10 .and. maxval(abs(at_once%contact%force - found%contact%force)) &
         & > 1.0e3_wp*contact_tolerance*scale, 'the path does not count here')
   end subroutine test_one_path

   !> The upper block lies on the lower one, pressed by its load and held by nothing else: an equilibrium, with the same
   !> pressure for a friction that cannot slip, and energies in balance.
   subroutine test_free_structure(error)
      type(testing_error), allocatable, intent(out) :: error
      type(error_t), allocatable :: lib
      type(brick_joint_t) :: joint
      type(operating_state_t) :: state
      type(preload_record_t) :: record
      type(preload_options_t) :: options
      real(wp) :: tangential(2)
      !> Trapezoids over 16 load steps while the hill closes; of the load
      real(wp), parameter :: trapezoids = 2.0e-2_wp, equilibrium = 1.0e-8_wp

      call make_brick_joint(brick_hill, 0.5_wp, joint, lib, supports=['lower_xmin'])
      if (.not. allocated(lib)) call run_preload(joint%system, press_only(16), by('condensed'), state, record, lib)
      call good(error, lib)
      if (allocated(error)) return
      call check(error, abs(state%amplitude(1)/pressing - 1.0_wp) < equilibrium, 'the load is not the force that it makes: ' &
         & //to_text(state%amplitude(1)))
      if (allocated(error)) return
      tangential = sum(state%contact%force(2:3, :), dim=2)
      call check(error, norm2(tangential) < equilibrium*pressing, 'a tangential resultant')
      if (allocated(error)) return
      call check(error, record%elastic_energy > 0.0_wp .and. abs(record%work - record%elastic_energy - record%friction_loss) &
         & < trapezoids*record%work, 'energies: '//to_text(record%work)//' '//to_text(record%elastic_energy)//' ' &
         & //to_text(record%friction_loss))
      if (allocated(error)) return
      call check_equilibrium(joint%system, state, error)
      if (allocated(error)) return
      ! A fifth of the weight along the plane: friction holds it.
      options%loads = [1, 2]
      options%scale = pressing*[1.0_wp, 0.2_wp]
      call run_preload(joint%system, options, by('condensed'), state, record, lib)
      call good(error, lib)
      if (allocated(error)) return
      tangential = sum(state%contact%force(2:3, :), dim=2)
      call check(error, abs(norm2(tangential)/(0.2_wp*pressing) - 1.0_wp) < equilibrium, 'the shear does not arrive')
      if (.not. allocated(error)) call check_equilibrium(joint%system, state, error)
   end subroutine test_free_structure

   !> Pulled off, and pushed along beyond what friction holds.
   subroutine test_lost_structure(error)
      type(testing_error), allocatable, intent(out) :: error
      type(error_t), allocatable :: lib
      type(brick_joint_t) :: joint
      type(operating_state_t) :: state
      type(preload_record_t) :: record
      type(preload_options_t) :: options
      real(wp), parameter :: shares(2, 2) = reshape([-1.0_wp, 0.0_wp, 1.0_wp, 0.6_wp], [2, 2])
      integer :: k

      call make_brick_joint(brick_hill, 0.5_wp, joint, lib, supports=['lower_xmin'])
      call good(error, lib)
      if (allocated(error)) return
      options%loads = [1, 2]
      do k = 1, 2
         options%scale = pressing*shares(:, k)
         call run_preload(joint%system, options, by('condensed'), state, record, lib)
         call check(error, allocated(lib), 'a structure that nothing holds was taken')
         if (allocated(error)) return
         call check(error, lib%status == status_failed .and. index(lib%message, 'moves freely') > 0, lib%message)
         if (allocated(error)) return
      end do
   end subroutine test_lost_structure

   subroutine test_useless_load(error)
      type(testing_error), allocatable, intent(out) :: error
      type(error_t), allocatable :: lib
      type(reduced_model_t) :: reduced
      type(jointed_system_t) :: system
      type(operating_state_t) :: state
      type(preload_options_t) :: options
      type(preload_record_t) :: record

      call make_joint(6, 4, joint_hill, reduced, system, lib)
      if (.not. allocated(lib)) call system%restrict(spread(.true., 1, system%grid_point_count()), lib)
      call good(error, lib)
      if (allocated(error)) return
      ! The second bolt is the first one again.
      options%loads = [1, 1]
      options%interface_force = [2210.0_wp, 2210.0_wp]
      call run_preload(system, options, by('condensed'), state, record, lib)
      call check(error, allocated(lib), 'a pad without load was pressed')
      if (allocated(error)) return
      call check(error, lib%status == status_failed .and. index(lib%message, 'do not press') > 0, lib%message)
   end subroutine test_useless_load

end module test_analysis_preload
