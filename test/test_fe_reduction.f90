module test_fe_reduction
   use microslip_core_error, only: error_t, status_bad_input, status_failed
   use microslip_core_kinds, only: wp, pi
   use microslip_core_text, only: to_text
   use microslip_fe_interface, only: contact_interface_t
   use microslip_fe_model, only: fe_model_t
   use microslip_fe_reduced_model, only: reduced_model_t
   use microslip_fe_reduction, only: craig_bampton_massless, macneal, reduce, reduction_options_t
   use microslip_fe_relative_coordinates, only: new_relative_coordinates, relative_coordinates_t
   use microslip_linalg_dense, only: eigen_generalised, eigen_symmetric, inverse_spd, solve_general
   use support_brick, only: block_model, block_t, facing_interface, to_dense, two_blocks
   use testdrive, only: new_unittest, unittest_type, error_type, check
   implicit none(type, external)
   private

   public :: collect_fe_reduction

   !> Rounding times the condition of the small models
   real(wp), parameter :: tolerance = 1.0e-9_wp

   !> The full model in relative coordinates, dense.
   type :: full_model_t
      real(wp), allocatable :: stiffness(:, :), mass(:, :), forces(:, :)
      !> Rows of d_b and of d_r
      integer, allocatable :: b(:), r(:)
   end type full_model_t

contains

   subroutine collect_fe_reduction(testsuite)
      type(unittest_type), allocatable, intent(out) :: testsuite(:)
      testsuite = [ &
                  new_unittest('static_stiffness', test_static_stiffness), &
                  new_unittest('static_response', test_static_response), &
                  new_unittest('tied_frequencies', test_tied_frequencies), &
                  new_unittest('all_modes_kept', test_all_modes_kept), &
                  new_unittest('macneal_free_frequencies', test_macneal_free_frequencies), &
                  new_unittest('convergence', test_convergence), &
                  new_unittest('cutoff_frequency', test_cutoff_frequency), &
                  new_unittest('no_interface', test_no_interface), &
                  new_unittest('missing_support', test_missing_support), &
                  new_unittest('macneal_loose_body', test_macneal_loose_body), &
                  new_unittest('wrong_options', test_wrong_options)]
   end subroutine collect_fe_reduction

   !> Two held blocks with a tilted interface and a second one to the ground; patterns on nodes inside, on side A,
   !> on side B and everywhere.
   subroutine scene(model, joints, patterns)
      type(fe_model_t), intent(out) :: model
      type(contact_interface_t), allocatable, intent(out) :: joints(:)
      real(wp), allocatable, intent(out) :: patterns(:, :)
      type(contact_interface_t) :: ground
      integer, allocatable :: rows(:, :)
      integer :: k

      call two_blocks(model, joints, [2, 1, 1])
      joints(1)%frame(:, 2) = [0.6_wp, 0.8_wp, 0.0_wp]
      joints(1)%frame(:, 3) = [-0.8_wp, 0.6_wp, 0.0_wp]
      ground = facing_interface(model, 'lower_zmin', '', 'ground')
      ground%node_a = ground%node_a(:2)
      ground%node_b = ground%node_b(:2)
      joints = [joints, ground]
      rows = model%rows_of_nodes()
      allocate (patterns(model%row_count(), 4), source=0.0_wp)
      patterns(rows(3, model%node_sets(model%find_node_set('upper'))%nodes(12)), 1) = 1.0_wp
      patterns(rows(2, joints(1)%node_a(3)), 2) = 1.0_wp
      patterns(rows(:, joints(1)%node_b(2)), 3) = [1.0_wp, 2.0_wp, 3.0_wp]
      patterns(:, 4) = [(sin(real(k, wp)), k=1, model%row_count())]
   end subroutine scene

   subroutine make_full(model, joints, patterns, full)
      type(fe_model_t), intent(in) :: model
      type(contact_interface_t), intent(in) :: joints(:)
      real(wp), intent(in) :: patterns(:, :)
      type(full_model_t), intent(out) :: full
      type(relative_coordinates_t) :: coordinates
      type(error_t), allocatable :: fault
      integer :: k

      call new_relative_coordinates(model, joints, coordinates, fault)
      full%stiffness = to_dense(coordinates%transformed_matrix(model%stiffness))
      full%mass = to_dense(coordinates%transformed_matrix(model%mass))
      full%forces = coordinates%transformed_forces(patterns)
      full%b = coordinates%boundary_rows
      full%r = pack([(k, k=1, model%row_count())], [(all(full%b /= k), k=1, model%row_count())])
   end subroutine make_full

   !> [d_i; d_b] under the reduced patterns at an angular frequency; K - omega^2 M solved densely.
   function reduced_response(reduced, omega) result(d)
      type(reduced_model_t), intent(in) :: reduced
      real(wp), intent(in) :: omega
      real(wp), allocatable :: d(:, :), a(:, :)
      type(error_t), allocatable :: fault
      integer :: n_i, n_b, k

      n_i = size(reduced%K_ii, 1)
      n_b = size(reduced%K_bb, 1)
      allocate (a(n_i + n_b, n_i + n_b), d(n_i + n_b, size(reduced%pattern_i, 2)))
      a(:n_i, :n_i) = reduced%K_ii
      a(n_i + 1:, :n_i) = reduced%K_bi
      a(:n_i, n_i + 1:) = transpose(reduced%K_bi)
      a(n_i + 1:, n_i + 1:) = reduced%K_bb
      do k = 1, n_i
         a(k, k) = a(k, k) - omega**2
      end do
      d(:n_i, :) = reduced%pattern_i
      d(n_i + 1:, :) = reduced%pattern_b
      call solve_general(a, d, fault)
   end function reduced_response

   !> Frequencies of the reduced model with a traction-free boundary: eigenvalues of K_ii - K_ib K_bb^-1 K_bi, Hz.
   function free_frequencies(reduced) result(frequency)
      type(reduced_model_t), intent(in) :: reduced
      real(wp), allocatable :: frequency(:), khat(:, :), inverse(:, :)
      type(error_t), allocatable :: fault

      inverse = reduced%K_bb
      call inverse_spd(inverse, fault)
      khat = reduced%K_ii - matmul(transpose(reduced%K_bi), matmul(inverse, reduced%K_bi))
      allocate (frequency(size(khat, 1)))
      call eigen_symmetric(khat, frequency, fault, values_only=.true.)
      frequency = sqrt(frequency)/(2.0_wp*pi)
   end function free_frequencies

   !> Frequencies of some rows of the full model, the others held, Hz.
   function full_frequencies(full, rows) result(frequency)
      type(full_model_t), intent(in) :: full
      integer, intent(in) :: rows(:)
      real(wp), allocatable :: frequency(:), a(:, :), b(:, :)
      type(error_t), allocatable :: fault

      a = full%stiffness(rows, rows)
      b = full%mass(rows, rows)
      allocate (frequency(size(rows)))
      call eigen_generalised(a, b, frequency, fault, values_only=.true.)
      frequency = sqrt(frequency)/(2.0_wp*pi)
   end function full_frequencies

   pure real(wp) function relative_difference(a, b)
      real(wp), intent(in) :: a(:, :), b(:, :)
      relative_difference = maxval(abs(a - b))/maxval(abs(b))
   end function relative_difference

   pure function options_for(method, modes) result(options)
      character(len=*), intent(in) :: method
      integer, intent(in) :: modes
      type(reduction_options_t) :: options
      options%method = method
      options%modes = modes
      options%residual_mass = .false.
   end function options_for

   pure function method_name(which) result(name)
      integer, intent(in) :: which
      character(len=:), allocatable :: name
      name = craig_bampton_massless
      if (which == 2) name = macneal
   end function method_name

   !> The stiffness seen from the boundary is the Schur complement of the full model, however few the modes.
   subroutine test_static_stiffness(error)
      type(error_type), allocatable, intent(out) :: error
      type(error_t), allocatable :: fault
      type(fe_model_t) :: model
      type(contact_interface_t), allocatable :: joints(:)
      type(reduced_model_t) :: reduced
      type(full_model_t) :: full
      real(wp), allocatable :: patterns(:, :), compliance(:, :), inverse(:, :), seen(:, :)
      integer :: which

      call scene(model, joints, patterns)
      call make_full(model, joints, patterns, full)
      inverse = full%stiffness
      call inverse_spd(inverse, fault)
      compliance = inverse(full%b, full%b)
      do which = 1, 2
         call reduce(model, joints, patterns, options_for(method_name(which), 3), reduced, fault)
         call check(error,.not. allocated(fault))
         if (allocated(error)) return
         call check(error, relative_difference(reduced%K_bb, transpose(reduced%K_bb)) <= 0.0_wp)
         if (allocated(error)) return
         seen = reduced%K_ii
         call inverse_spd(seen, fault)
         seen = reduced%K_bb - matmul(reduced%K_bi, matmul(seen, transpose(reduced%K_bi)))
         call inverse_spd(seen, fault)
         call check(error, relative_difference(seen, compliance) < tolerance)
         if (allocated(error)) return
      end do
   end subroutine test_static_stiffness

   !> Statics: d_b is exact under every pattern, and by reciprocity a sensor reads the exact displacement under
   !> forces on the boundary.
   subroutine test_static_response(error)
      type(error_type), allocatable, intent(out) :: error
      type(error_t), allocatable :: fault
      type(fe_model_t) :: model
      type(contact_interface_t), allocatable :: joints(:)
      type(reduced_model_t) :: reduced, pushed
      type(full_model_t) :: full
      real(wp), allocatable :: patterns(:, :), inverse(:, :), d(:, :), exact(:, :), sensed(:, :)
      integer :: which, n_i, k, n_b

      call scene(model, joints, patterns)
      call make_full(model, joints, patterns, full)
      inverse = full%stiffness
      call inverse_spd(inverse, fault)
      n_i = 3
      n_b = size(full%b)
      exact = matmul(inverse(full%b, :), full%forces)
      do which = 1, 2
         call reduce(model, joints, patterns, options_for(method_name(which), n_i), reduced, fault)
         d = reduced_response(reduced, 0.0_wp)
         call check(error, relative_difference(d(n_i + 1:, :), exact) < tolerance)
         if (allocated(error)) return

         pushed = reduced
         pushed%pattern_i = reshape([(0.0_wp, k=1, n_i*n_b)], [n_i, n_b])
         pushed%pattern_b = reshape([(merge(1.0_wp, 0.0_wp, mod(k - 1, n_b + 1) == 0), k=1, n_b*n_b)], [n_b, n_b])
         d = reduced_response(pushed, 0.0_wp)
         sensed = matmul(transpose(reduced%pattern_i), d(:n_i, :)) + matmul(transpose(reduced%pattern_b), d(n_i + 1:, :))
         call check(error, relative_difference(sensed, transpose(exact)) < tolerance)
         if (allocated(error)) return
      end do
   end subroutine test_static_response

   subroutine test_tied_frequencies(error)
      type(error_type), allocatable, intent(out) :: error
      type(error_t), allocatable :: fault
      type(fe_model_t) :: model
      type(contact_interface_t), allocatable :: joints(:)
      type(reduced_model_t) :: reduced
      type(full_model_t) :: full
      real(wp), allocatable :: patterns(:, :), exact(:)

      call scene(model, joints, patterns)
      call make_full(model, joints, patterns, full)
      exact = full_frequencies(full, full%r)
      call reduce(model, joints, patterns, options_for(craig_bampton_massless, 8), reduced, fault)
      call check(error, maxval(abs(reduced%frequency/exact(:8) - 1.0_wp)) < tolerance)
      if (allocated(error)) return
      call check(error, reduced%record%residual < tolerance .and. reduced%record%solves > 8)
   end subroutine test_tied_frequencies

   !> With all tied modes the reduced model is the full one whose boundary has lost the inertia
   !> M_bb - M_br M_rr^-1 M_rb: same frequency response between all patterns.
   subroutine test_all_modes_kept(error)
      type(error_type), allocatable, intent(out) :: error
      type(error_t), allocatable :: fault
      type(fe_model_t) :: model
      type(contact_interface_t), allocatable :: joints(:)
      type(reduced_model_t) :: reduced
      type(full_model_t) :: full
      real(wp), allocatable :: patterns(:, :), inverse(:, :), a(:, :), x(:, :), d(:, :), response(:, :)
      real(wp) :: omega

      call scene(model, joints, patterns)
      call make_full(model, joints, patterns, full)
      inverse = full%mass(full%r, full%r)
      call inverse_spd(inverse, fault)
      full%mass(full%b, full%b) = matmul(full%mass(full%b, full%r), matmul(inverse, full%mass(full%r, full%b)))

      call reduce(model, joints, patterns, options_for(craig_bampton_massless, size(full%r)), reduced, fault)
      call check(error,.not. allocated(fault))
      if (allocated(error)) return
      omega = 2.0_wp*pi*0.5_wp*(reduced%frequency(2) + reduced%frequency(3))
      a = full%stiffness - omega**2*full%mass
      x = full%forces
      call solve_general(a, x, fault)
      d = reduced_response(reduced, omega)
      response = matmul(transpose(reduced%pattern_i), d(:size(full%r), :)) &
                 + matmul(transpose(reduced%pattern_b), d(size(full%r) + 1:, :))
      call check(error, relative_difference(response, matmul(transpose(full%forces), x)) < 10.0_wp*tolerance)
   end subroutine test_all_modes_kept

   !> Free frequencies of the MacNeal model are exact for any number of modes; its tied ones, which it is turned to, converge.
   subroutine test_macneal_free_frequencies(error)
      type(error_type), allocatable, intent(out) :: error
      type(error_t), allocatable :: fault
      type(fe_model_t) :: model
      type(contact_interface_t), allocatable :: joints(:)
      type(reduced_model_t) :: reduced
      type(full_model_t) :: full
      real(wp), allocatable :: patterns(:, :), exact(:), tied(:)
      real(wp) :: deviation(3)
      integer, parameter :: modes(3) = [3, 8, 20]
      integer :: k, j

      call scene(model, joints, patterns)
      call make_full(model, joints, patterns, full)
      exact = full_frequencies(full, [(j, j=1, model%row_count())])
      tied = full_frequencies(full, full%r)
      do k = 1, size(modes)
         call reduce(model, joints, patterns, options_for(macneal, modes(k)), reduced, fault)
         call check(error,.not. allocated(fault))
         if (allocated(error)) return
         call check(error, maxval(abs(free_frequencies(reduced)/exact(:modes(k)) - 1.0_wp)) < tolerance)
         if (allocated(error)) return
         deviation(k) = abs(reduced%frequency(1)/tied(1) - 1.0_wp)
      end do
      call check(error, deviation(2) < deviation(1) .and. deviation(3) < 0.5_wp*deviation(2))
   end subroutine test_macneal_free_frequencies

   !> Craig-Bampton: the free frequencies come nearer to the full model's with every mode and every refinement of the
   !> mesh (which takes the boundary's inertia away).
   subroutine test_convergence(error)
      type(error_type), allocatable, intent(out) :: error
      type(error_t), allocatable :: fault
      type(fe_model_t) :: model
      type(contact_interface_t), allocatable :: joints(:)
      type(reduced_model_t) :: reduced, exact
      real(wp), allocatable :: patterns(:, :), found(:), free(:)
      real(wp) :: deviation(3), mesh_deviation(2)
      integer, parameter :: modes(3, 2) = reshape([6, 15, 80, 6, 40, 200], [3, 2])
      integer :: k, mesh

      do mesh = 1, 2
         call two_blocks(model, joints, mesh*[3, 2, 1])
         allocate (patterns(model%row_count(), 0))
         call reduce(model, joints, patterns, options_for(macneal, 4), exact, fault)
         free = free_frequencies(exact)
         do k = 1, 3
            call reduce(model, joints, patterns, options_for(craig_bampton_massless, modes(k, mesh)), reduced, fault)
            found = free_frequencies(reduced)
            deviation(k) = maxval(abs(found(:4)/free - 1.0_wp))
         end do
         call check(error, deviation(3) < deviation(2) .and. deviation(2) < deviation(1), &
                    to_text(deviation(1))//' '//to_text(deviation(2))//' '//to_text(deviation(3)))
         if (allocated(error)) return
         mesh_deviation(mesh) = deviation(3)
         deallocate (patterns)
      end do
      call check(error, mesh_deviation(2) < 0.7_wp*mesh_deviation(1), &
                 to_text(mesh_deviation(1))//' '//to_text(mesh_deviation(2)))
   end subroutine test_convergence

   !> The cut-off counts the component modes of the method: tied ones or free ones.
   subroutine test_cutoff_frequency(error)
      type(error_type), allocatable, intent(out) :: error
      type(error_t), allocatable :: fault
      type(fe_model_t) :: model
      type(contact_interface_t), allocatable :: joints(:)
      type(reduced_model_t) :: reduced, reference
      type(reduction_options_t) :: options
      real(wp), allocatable :: patterns(:, :), component(:)
      integer :: which

      call scene(model, joints, patterns)
      do which = 1, 2
         options = options_for(method_name(which), 8)
         call reduce(model, joints, patterns, options, reference, fault)
         options%modes = 0
         component = reference%frequency
         if (which == 2) component = free_frequencies(reference)
         options%cutoff_frequency = 0.5_wp*(component(5) + component(6))
         call reduce(model, joints, patterns, options, reduced, fault)
         call check(error, size(reduced%frequency), 5)
         if (allocated(error)) return
         options%cutoff_frequency = 0.5_wp*component(1)
         call reduce(model, joints, patterns, options, reduced, fault)
         call check(error, allocated(fault))
         if (allocated(error)) return
         call check(error, index(fault%message, 'no mode below') > 0, fault%message)
         if (allocated(error)) return
      end do
   end subroutine test_cutoff_frequency

   !> Without an interface there are just modes.
   subroutine test_no_interface(error)
      type(error_type), allocatable, intent(out) :: error
      type(error_t), allocatable :: fault
      type(fe_model_t) :: model
      type(contact_interface_t), allocatable :: joints(:)
      type(reduced_model_t) :: reduced, other
      real(wp), allocatable :: patterns(:, :)

      call scene(model, joints, patterns)
      call reduce(model, joints(:0), patterns, options_for(craig_bampton_massless, 3), reduced, fault)
      call check(error,.not. allocated(fault))
      if (allocated(error)) return
      call reduce(model, joints(:0), patterns, options_for(macneal, 3), other, fault)
      call check(error,.not. allocated(fault))
      if (allocated(error)) return
      call check(error, size(reduced%K_bb) == 0 .and. &
                 maxval(abs(reduced%frequency - other%frequency)) < tolerance*reduced%frequency(3))
   end subroutine test_no_interface

   !> The tied structure floats.
   subroutine test_missing_support(error)
      type(error_type), allocatable, intent(out) :: error
      type(error_t), allocatable :: fault
      type(fe_model_t) :: model
      type(contact_interface_t) :: joint
      type(reduced_model_t) :: reduced
      real(wp), allocatable :: patterns(:, :)

      call block_model([block_t('lower', cells=[4, 2, 2]), block_t('upper', [0.0_wp, 0.0_wp, 1.0_wp], cells=[4, 2, 2])], &
                       [character(len=1) ::], model)
      joint = facing_interface(model, 'upper_zmin', 'lower_zmax', 'joint')
      allocate (patterns(model%row_count(), 0))
      call reduce(model, [joint], patterns, options_for(craig_bampton_massless, 4), reduced, fault)
      call check(error, allocated(fault))
      if (allocated(error)) return
      call check(error, fault%status, status_bad_input)
      if (allocated(error)) return
      call check(error, index(fault%message, 'the structure can move freely at node ') == 1 .and. &
                 index(fault%message, ': missing support?') > 0, fault%message)
   end subroutine test_missing_support

   !> Held by the lower block only: fine when tied, but without contact the upper block is loose.
   subroutine test_macneal_loose_body(error)
      type(error_type), allocatable, intent(out) :: error
      type(error_t), allocatable :: fault
      type(fe_model_t) :: model
      type(contact_interface_t) :: joint
      type(reduced_model_t) :: reduced
      real(wp), allocatable :: patterns(:, :)

      call block_model([block_t('lower', cells=[4, 2, 2]), block_t('upper', [0.0_wp, 0.0_wp, 1.0_wp], cells=[4, 2, 2])], &
                       ['lower_xmin'], model)
      joint = facing_interface(model, 'upper_zmin', 'lower_zmax', 'joint')
      allocate (patterns(model%row_count(), 0))
      call reduce(model, [joint], patterns, options_for(craig_bampton_massless, 4), reduced, fault)
      call check(error,.not. allocated(fault))
      if (allocated(error)) return
      call reduce(model, [joint], patterns, options_for(macneal, 4), reduced, fault)
      call check(error, allocated(fault))
      if (allocated(error)) return
      call check(error, index(fault%message, 'can move freely') > 0, fault%message)
   end subroutine test_macneal_loose_body

   subroutine test_wrong_options(error)
      type(error_type), allocatable, intent(out) :: error
      type(error_t), allocatable :: fault
      type(fe_model_t) :: model
      type(contact_interface_t), allocatable :: joints(:)
      type(reduced_model_t) :: reduced
      type(reduction_options_t) :: none
      real(wp), allocatable :: patterns(:, :)

      call scene(model, joints, patterns)
      call reduce(model, joints, patterns, none, reduced, fault)
      call check(error, allocated(fault))
      if (allocated(error)) return
      call reduce(model, joints, patterns, options_for('guyan', 3), reduced, fault)
      call check(error, allocated(fault))
      if (allocated(error)) return
      call check(error, index(fault%message, 'known are "craig_bampton_massless" and "macneal"') > 0, fault%message)
      if (allocated(error)) return
      call reduce(model, joints, patterns, options_for(macneal, 0), reduced, fault)
      call check(error, allocated(fault))
      if (allocated(error)) return
      call check(error, fault%status, status_bad_input)
      if (allocated(error)) return
      call reduce(model, joints, patterns, options_for(macneal, model%row_count()), reduced, fault)
      call check(error, allocated(fault))
      if (allocated(error)) return
      call check(error, fault%status, status_failed)
      if (allocated(error)) return
      call check(error, index(fault%message, 'ask for fewer modes') > 0, fault%message)
      if (allocated(error)) return
      call reduce(model, joints, patterns, options_for(craig_bampton_massless, model%row_count()), reduced, fault)
      call check(error, allocated(fault))
   end subroutine test_wrong_options

end module test_fe_reduction
