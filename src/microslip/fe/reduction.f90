!> Reduction of an FE model with contact interfaces to a few modes and the massless interface coordinates
!> (METHOD section 2): Craig-Bampton with tied modes, or MacNeal with free modes and residual flexibility.
!>
!> Constraint modes are never formed: K_s is a Schur complement of the sparse factorisation, and everything else
!> follows from modes and one solution per force pattern. References: Monjaraz-Tec, Gross, Krack, J. Sound Vib.
!> (2022) for the massless boundary; MacNeal, Comput. Struct. 1 (1971) 581-601.
module microslip_fe_reduction
   use microslip_core_error, only: error_t, bad_input, failure
   use microslip_core_kinds, only: wp, i8, pi
   use microslip_core_text, only: to_text
   use microslip_fe_bodies, only: find_bodies
   use microslip_fe_condensed_forces, only: condensed_forces
   use microslip_fe_interface, only: contact_interface_t
   use microslip_fe_model, only: fe_model_t
   use microslip_fe_reduced_model, only: reduced_model_t, reduction_record_t
   use microslip_fe_relative_coordinates, only: new_relative_coordinates, relative_coordinates_t
   use microslip_fe_residual_mass, only: find_soft_motions, soft_motions_t
   use microslip_linalg_dense, only: eigen_symmetric, gram_product, inverse_spd, product_of, product_symmetric
   use microslip_linalg_eigenpairs, only: eigen_record_t, nearest_eigenpairs
   use microslip_linalg_mumps, only: symmetric_factor_t
   use microslip_linalg_sparse, only: symmetric_sparse_t
   use microslip_linalg_sparse_algebra, only: combination, multiply_many, submatrix
   implicit none(type, external)
   private

   public :: reduce, reduction_options_t, craig_bampton_massless, macneal

   character(len=*), parameter :: craig_bampton_massless = 'craig_bampton_massless'
   character(len=*), parameter :: macneal = 'macneal'
   character(len=*), parameter :: axis = 'xyz'
   !> A mode with less than this share of the mean of K_kk over the mean of M_kk is a free motion made stiff by
   !> rounding: a tenth of a hertz where the mesh's own highest frequencies are a megahertz
   real(wp), parameter :: free_motion = 1.0e-14_wp

   !> What is wanted: a number of modes, or all modes below a frequency.
   type :: reduction_options_t
      !> 'craig_bampton_massless' or 'macneal'
      character(len=:), allocatable :: method
      !> Number of modes; 0: as the cut-off frequency says
      integer :: modes = 0
      !> All modes up to this frequency are retained, Hz
      real(wp) :: cutoff_frequency = 0.0_wp
      !> Whether soft motions of the boundary keep the mass that the modes do not carry (Craig-Bampton)
      logical :: residual_mass = .true.
   end type reduction_options_t

contains

   !> Reduce a model.
   subroutine reduce(model, interfaces, patterns, options, reduced, error)
      type(fe_model_t), intent(in) :: model
      type(contact_interface_t), intent(in) :: interfaces(:)
      !> (rows, patterns) force patterns on the FE rows, N; also the rows of sensors. May have no columns
      real(wp), intent(in) :: patterns(:, :)
      type(reduction_options_t), intent(in) :: options
      type(reduced_model_t), intent(out) :: reduced
      !> Wrong options or interfaces, a structure that can move freely, no convergence
      type(error_t), allocatable, intent(out) :: error
      type(relative_coordinates_t) :: coordinates
      type(symmetric_sparse_t) :: stiffness, mass
      real(wp), allocatable :: forces(:, :), inertia(:, :)
      integer(i8) :: clock

      call start_clock(clock)
      call check_options(options, error)
      if (allocated(error)) return
      call new_relative_coordinates(model, interfaces, coordinates, error)
      if (allocated(error)) return
      stiffness = coordinates%transformed_matrix(model%stiffness)
      mass = coordinates%transformed_matrix(model%mass)
      forces = coordinates%transformed_forces(patterns)
      call find_bodies(model, reduced%bodies, inertia)
      inertia = coordinates%transformed_forces(inertia)

      reduced%method = options%method
      reduced%record%rows = model%row_count()
      if (options%method == macneal) then
         call reduce_macneal(model, stiffness, mass, coordinates%boundary_rows, forces, inertia, options, reduced, error)
      else
         call reduce_craig_bampton(model, stiffness, mass, coordinates%boundary_rows, forces, inertia, options, reduced, error)
      end if
      reduced%record%seconds = seconds_since(clock)
   end subroutine reduce

   subroutine check_options(options, error)
      type(reduction_options_t), intent(in) :: options
      type(error_t), allocatable, intent(out) :: error

      if (.not. allocated(options%method)) then
         call bad_input(error, 'reduction: no method given')
      else if (options%method /= craig_bampton_massless .and. options%method /= macneal) then
         call bad_input(error, 'reduction: unknown method "'//options%method//'"; known are "' &
                        //craig_bampton_massless//'" and "'//macneal//'"')
      else if (options%modes < 0 .or. (options%modes == 0 .and. .not. options%cutoff_frequency > 0.0_wp)) then
         call bad_input(error, 'reduction: the number of modes or the cut-off frequency must be positive')
      end if
   end subroutine check_options

   !> Tied modes Theta and static condensation:
   !> alpha = Theta^T M_rb - Lambda^-1 Theta^T K_rb, K_bi = -alpha^T Lambda, K_bb = K_s + alpha^T Lambda alpha.
   !> The residual mass of soft motions adds rows to alpha and Lambda (`microslip_fe_residual_mass`).
   subroutine reduce_craig_bampton(model, stiffness, mass, boundary, forces, inertia, options, reduced, error)
      type(fe_model_t), intent(in) :: model
      !> K~, M~, (n_b) boundary rows, (rows, patterns) f~
      type(symmetric_sparse_t), intent(in) :: stiffness, mass
      integer, intent(in) :: boundary(:)
      real(wp), intent(in), contiguous :: forces(:, :)
      !> (rows, 6 bodies) T^T M u of their rigid motions
      real(wp), intent(in), contiguous :: inertia(:, :)
      type(reduction_options_t), intent(in) :: options
      type(reduced_model_t), intent(inout) :: reduced
      type(error_t), allocatable, intent(out) :: error
      type(symmetric_factor_t) :: factor
      type(soft_motions_t) :: motions
      real(wp), allocatable :: lambda(:), theta(:, :), alpha_t(:, :), product(:, :), scaled(:, :), extra(:)
      integer :: k, tied

      call static_condensation(model, stiffness, boundary, factor, reduced%K_bb, reduced%record, error)
      if (allocated(error)) return
      call find_modes(model, stiffness, mass, factor, options, lambda, theta, reduced, error)
      if (allocated(error)) return

      allocate (product, mold=theta)
      call multiply_many(mass, theta, product)
      alpha_t = product(boundary, :)
      call multiply_many(stiffness, theta, product)
      do k = 1, size(lambda)
         alpha_t(:, k) = alpha_t(:, k) - product(boundary, k)/lambda(k)
      end do

      tied = size(lambda)
      call find_soft_motions(stiffness, mass, factor, boundary, reduced%K_bb, lambda, theta, alpha_t, motions, error)
      if (allocated(error)) return
      reduced%record%solves = reduced%record%solves + motions%solves
      reduced%soft_frequency = motions%omega/(2.0_wp*pi)
      reduced%soft_share = motions%share
      if (options%residual_mass) then
         extra = spread(lambda(tied), 1, size(motions%omega))
         lambda = [lambda, extra]
         alpha_t = reshape([alpha_t, motions%mass_root], [size(boundary), size(lambda)])
      else
         deallocate (motions%shape)
         allocate (motions%shape(size(boundary), 0))
      end if

      reduced%frequency = sqrt(lambda)/(2.0_wp*pi)
      reduced%K_ii = diagonal_matrix(lambda)
      reduced%K_bi = alpha_t*spread(-lambda, 1, size(boundary))
      scaled = spread(sqrt(lambda), 2, size(boundary))*transpose(alpha_t)
      call gram_product(scaled, reduced%K_bb, keep=1.0_wp)

      allocate (reduced%pattern_i(size(lambda), size(forces, 2)), source=0.0_wp)
      product = matmul(transpose(theta), forces)
      reduced%pattern_i(:tied, :) = product
      reduced%pattern_b = condensed_forces(stiffness, factor, boundary, forces)
      call product_of(alpha_t, reduced%pattern_i, reduced%pattern_b, factor=-1.0_wp, keep=1.0_wp)
      reduced%record%solves = reduced%record%solves + size(forces, 2)

      product = condensed_forces(stiffness, factor, boundary, inertia)
      call measure_kept_mass(inertia, theta, reduced, alpha_t(:, :tied), motions%shape, product)
      reduced%record%solves = reduced%record%solves + size(inertia, 2)
   end subroutine reduce_craig_bampton

   !> |z|^2/u^T M u, z = [Theta^T M u; V^T R^T M u]: the part of the bodies' mass that the retained motions carry.
   subroutine measure_kept_mass(inertia, theta, reduced, alpha_t, v, condensed)
      !> M u (rows, 6 bodies), modes Theta
      real(wp), intent(in), contiguous :: inertia(:, :), theta(:, :)
      type(reduced_model_t), intent(inout) :: reduced
      !> alpha^T, soft motions V (boundary, motions), P^T M u (boundary, 6 bodies)
      real(wp), intent(in), contiguous, optional :: alpha_t(:, :), v(:, :), condensed(:, :)
      real(wp), allocatable :: z(:, :), left(:, :), s(:, :), kept(:)
      integer :: k, r

      allocate (z(size(theta, 2), size(inertia, 2)))
      call product_of(theta, inertia, z, transpose_a=.true.)
      kept = sum(z**2, 1)
      if (present(v)) then
         left = condensed
         call product_of(alpha_t, z, left, factor=-1.0_wp, keep=1.0_wp)
         allocate (s(size(v, 2), size(inertia, 2)))
         call product_of(v, left, s, transpose_a=.true.)
         kept = kept + sum(s**2, 1)
      end if
      do k = 1, size(reduced%bodies)
         do r = 1, 6
            associate (total => reduced%bodies(k)%inertia(r))
               if (total > 0.0_wp) reduced%bodies(k)%kept(r) = kept(6*(k - 1) + r)/total
            end associate
         end do
      end do
   end subroutine measure_kept_mass

   !> Free modes Phi and residual flexibility F_res = K_s^-1 - Phi_b Lambda^-1 Phi_b^T:
   !> K_bb = F_res^-1, K_bi = -K_bb Phi_b, K_ii = Lambda + Phi_b^T K_bb Phi_b,
   !> f_b = K_bb (K~^-1 f~ - Phi Lambda^-1 Phi^T f~)_b, f_i = Phi^T f~ - Phi_b^T f_b.
   !> At the end the modal coordinates are turned so that K_ii is diagonal: they are then the tied modes of the reduced model.
   subroutine reduce_macneal(model, stiffness, mass, boundary, forces, inertia, options, reduced, error)
      type(fe_model_t), intent(in) :: model
      !> K~, M~, (n_b) boundary rows, (rows, patterns) f~
      type(symmetric_sparse_t), intent(in) :: stiffness, mass
      integer, intent(in) :: boundary(:)
      real(wp), intent(in), contiguous :: forces(:, :)
      !> (rows, 6 bodies) T^T M u of their rigid motions
      real(wp), intent(in), contiguous :: inertia(:, :)
      type(reduction_options_t), intent(in) :: options
      type(reduced_model_t), intent(inout) :: reduced
      type(error_t), allocatable, intent(out) :: error
      type(symmetric_factor_t) :: factor
      real(wp), allocatable :: lambda(:), phi(:, :), phi_b(:, :), scaled(:, :), x(:, :), residual(:, :)
      character(len=:), allocatable :: message
      integer :: row

      call factor%factorise(stiffness, error, positive_definite=.true., singular_row=row)
      call name_free_row(model, row, error)
      if (row > 0) error%message = error%message//" (method = 'macneal' needs supports that hold every body while the " &
         & //"interfaces are open; 'craig_bampton_massless', the default, does not)"
      if (allocated(error)) return
      call find_modes(model, stiffness, mass, factor, options, lambda, phi, reduced, error)
      if (allocated(error)) return
      x = forces
      call factor%solve(x)
      reduced%record%solves = reduced%record%solves + size(forces, 2)

      call static_condensation(model, stiffness, boundary, factor, reduced%K_bb, reduced%record, error)
      if (allocated(error)) return
      call factor%release()
      call inverse_spd(reduced%K_bb, error)
      if (allocated(error)) return
      phi_b = phi(boundary, :)
      scaled = spread(1.0_wp/sqrt(lambda), 2, size(boundary))*transpose(phi_b)
      call gram_product(scaled, reduced%K_bb, factor=-1.0_wp, keep=1.0_wp)
      call inverse_spd(reduced%K_bb, error)
      if (allocated(error)) then
         message = error%message
         call failure(error, 'MacNeal reduction: with '//to_text(size(lambda))//' modes nothing is left of the '// &
                      'boundary flexibility; ask for fewer modes ('//message//')')
         return
      end if

      allocate (reduced%K_bi, mold=phi_b)
      call product_symmetric(reduced%K_bb, phi_b, reduced%K_bi)
      reduced%K_bi = -reduced%K_bi
      reduced%K_ii = diagonal_matrix(lambda)
      call product_of(phi_b, reduced%K_bi, reduced%K_ii, transpose_a=.true., factor=-1.0_wp, keep=1.0_wp)
      reduced%K_ii = 0.5_wp*(reduced%K_ii + transpose(reduced%K_ii))

      allocate (reduced%pattern_i(size(lambda), size(forces, 2)))
      call product_of(phi, forces, reduced%pattern_i, transpose_a=.true.)
      residual = x(boundary, :)
      scaled = reduced%pattern_i/spread(lambda, 2, size(forces, 2))
      call product_of(phi_b, scaled, residual, factor=-1.0_wp, keep=1.0_wp)
      allocate (reduced%pattern_b, mold=residual)
      call product_symmetric(reduced%K_bb, residual, reduced%pattern_b)
      call product_of(phi_b, reduced%pattern_b, reduced%pattern_i, transpose_a=.true., factor=-1.0_wp, keep=1.0_wp)
      call measure_kept_mass(inertia, phi, reduced)
      call turn_to_tied_modes(reduced, error)
   end subroutine reduce_macneal

   !> K_ii = U Lambda U^T: d_i <- U^T d_i.
   subroutine turn_to_tied_modes(reduced, error)
      type(reduced_model_t), intent(inout) :: reduced
      type(error_t), allocatable, intent(out) :: error
      real(wp), allocatable :: u(:, :), lambda(:), turned(:, :)

      u = reduced%K_ii
      allocate (lambda(size(u, 1)))
      call eigen_symmetric(u, lambda, error)
      if (allocated(error)) return
      reduced%frequency = sqrt(lambda)/(2.0_wp*pi)
      reduced%K_ii = diagonal_matrix(lambda)
      allocate (turned, mold=reduced%K_bi)
      call product_of(reduced%K_bi, u, turned)
      call move_alloc(turned, reduced%K_bi)
      allocate (turned, mold=reduced%pattern_i)
      call product_of(u, reduced%pattern_i, turned, transpose_a=.true.)
      call move_alloc(turned, reduced%pattern_i)
   end subroutine turn_to_tied_modes

   !> K_s and the factor of K~_rr.
   subroutine static_condensation(model, stiffness, boundary, factor, schur, record, error)
      type(fe_model_t), intent(in) :: model
      type(symmetric_sparse_t), intent(in) :: stiffness
      integer, intent(in) :: boundary(:)
      type(symmetric_factor_t), intent(inout) :: factor
      !> (n_b, n_b)
      real(wp), allocatable, intent(out) :: schur(:, :)
      type(reduction_record_t), intent(inout) :: record
      type(error_t), allocatable, intent(out) :: error
      integer(i8) :: clock
      integer :: row

      call start_clock(clock)
      call factor%factorise(stiffness, error, positive_definite=.true., schur_rows=boundary, schur=schur, &
                            singular_row=row)
      call name_free_row(model, row, error)
      if (allocated(error)) return
      record%factor_entries = factor%factor_entries()
      record%seconds_schur = seconds_since(clock)
   end subroutine static_condensation

   !> The lowest modes, as many as the options ask for.
   subroutine find_modes(model, stiffness, mass, factor, options, lambda, vectors, reduced, error)
      type(fe_model_t), intent(in) :: model
      type(symmetric_sparse_t), intent(in) :: stiffness, mass
      !> Of K~ (free modes) or of K~_rr (tied modes)
      type(symmetric_factor_t), intent(inout) :: factor
      type(reduction_options_t), intent(in) :: options
      !> (n_i) (rad/s)^2, (rows, n_i)
      real(wp), allocatable, intent(out) :: lambda(:), vectors(:, :)
      type(reduced_model_t), intent(inout) :: reduced
      type(error_t), allocatable, intent(out) :: error
      type(eigen_record_t) :: record
      integer(i8) :: clock
      integer :: count

      call start_clock(clock)
      count = options%modes
      if (count == 0) call count_modes(stiffness, mass, factor%active_rows(), options%cutoff_frequency, count, error)
      if (allocated(error)) return
      call nearest_eigenpairs(mass, factor, 0.0_wp, count, lambda, vectors, record, error)
      if (allocated(error)) return
      if (lambda(1) < free_motion*sum(stiffness%diagonal())/sum(mass%diagonal())) then
         call name_free_row(model, maxloc(abs(vectors(:, 1)), dim=1), error)
         return
      end if
      reduced%tied_modes = count
      reduced%record%solves = reduced%record%solves + record%solves
      reduced%record%iterations = record%iterations
      reduced%record%residual = record%residual
      reduced%record%seconds_modes = seconds_since(clock)
   end subroutine find_modes

   !> Number of eigenvalues below a frequency = negative pivots of K - omega^2 M (Sylvester).
   subroutine count_modes(stiffness, mass, active, frequency, count, error)
      type(symmetric_sparse_t), intent(in) :: stiffness, mass
      !> Rows that take part
      integer, intent(in) :: active(:)
      !> Hz
      real(wp), intent(in) :: frequency
      integer, intent(out) :: count
      !> No mode below the frequency, one just there, or the factorisation failed
      type(error_t), allocatable, intent(out) :: error
      type(symmetric_factor_t) :: shifted
      integer :: singular_row

      count = 0
      call shifted%factorise(submatrix(combination(stiffness, -(2.0_wp*pi*frequency)**2, mass), active), error, &
                             singular_row=singular_row)
      if (singular_row > 0) call bad_input(error, 'reduction: the cut-off frequency of '//to_text(frequency)// &
                                           ' Hz is a natural frequency; choose one between two of them')
      if (allocated(error)) return
      count = shifted%negative_pivots()
      if (count == 0) call bad_input(error, 'reduction: the structure has no mode below the cut-off frequency of ' &
                                     //to_text(frequency)//' Hz')
   end subroutine count_modes

   !> Replace "singular in row ..." by the node and the component that can move.
   subroutine name_free_row(model, row, error)
      type(fe_model_t), intent(in) :: model
      !> From the factorisation; 0: nothing to say
      integer, intent(in) :: row
      type(error_t), allocatable, intent(inout) :: error

      if (row == 0) return
      call bad_input(error, 'the structure can move freely at node '// &
                     to_text(model%node_label(model%row_node(row)))//', component '// &
                     axis(model%row_component(row):model%row_component(row))//': missing support?')
   end subroutine name_free_row

   pure function diagonal_matrix(d) result(matrix)
      real(wp), intent(in) :: d(:)
      real(wp), allocatable :: matrix(:, :)
      integer :: k

      allocate (matrix(size(d), size(d)), source=0.0_wp)
      do k = 1, size(d)
         matrix(k, k) = d(k)
      end do
   end function diagonal_matrix

   subroutine start_clock(clock)
      integer(i8), intent(out) :: clock
      call system_clock(clock)
   end subroutine start_clock

   !> Wall time since `start_clock`, s.
   real(wp) function seconds_since(clock)
      integer(i8), intent(in) :: clock
      integer(i8) :: now, rate

      call system_clock(now, rate)
      seconds_since = real(now - clock, wp)/real(rate, wp)
   end function seconds_since

end module microslip_fe_reduction
