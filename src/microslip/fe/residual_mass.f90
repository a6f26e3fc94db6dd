!> The mass that fixed-interface modes do not carry, given back to the boundary motions that are soft enough to feel it.
!>
!> Theta are the retained modes with tied interfaces, Psi = -K_rr^-1 K_rb the static deflection under boundary displacements,
!> P = [I; Psi]. The displacement is d = P d_b + Theta q. With alpha = Theta^T M P and d_i = q + alpha d_b its kinetic energy is
!>
!>     1/2 |d_i'|^2 + 1/2 d_b'^T M_res d_b',       M_res = P^T M P - alpha^T alpha = R^T M R,   R = P - Theta alpha.
!>
!> The massless boundary drops M_res. That is harmless where the boundary is stiff: in a motion of frequency omega the kinetic
!> energy that a boundary motion v loses is at most (omega/omega_v)^2 of the elastic energy, omega_v^2 = v^T K_s v/v^T M_res v,
!> K_s the statically condensed stiffness. It is not harmless where a body can slide or lift as a whole: omega_v is then
!> (nearly) zero, and the body loses v^T M_res v of its mass. Even all of the modes do not help, as M_res keeps the mass of
!> the interface nodes themselves, M_bb - M_br M_rr^-1 M_rb.
!>
!> Hence the motions V with omega_v below a limit are looked for (subspace iteration on M_res v = omega_v^-2 K_s v), and their
!> residual mass is kept,
!>
!>     X = (V^T M_res V)^-1/2 V^T M_res,       X^T X V = M_res V,       0 <= X^T X <= M_res:
!>
!> exact for the motions in V and for their coupling to all others, and never more than what was dropped. The coordinates
!> s = X d_b get mass without the boundary getting any in the way that the modes do it: s is a coordinate of its own, of unit
!> mass, tied to X d_b by a spring omega_p^2. That is one more row of alpha (X) and of Lambda (omega_p^2) each: statics stay
!> exact, as s = X d_b leaves the spring without force, and so do the tied modes, as d_b = 0 leaves s by itself. Its own
!> frequency is spurious: omega_p is the highest tied frequency that is retained, so that the time step stays as it is. An
!> omega_p that is finite errs by (omega/omega_p)^2 of the residual mass, no more than the truncation of the modes does.
module microslip_fe_residual_mass
   use microslip_core_error, only: error_t
   use microslip_core_kinds, only: wp, i8
   use microslip_fe_condensed_forces, only: condensed_forces
   use microslip_linalg_dense, only: cholesky_factor, cholesky_solve, eigen_generalised, product_of
   use microslip_linalg_mumps, only: symmetric_factor_t
   use microslip_linalg_sparse, only: symmetric_sparse_t
   use microslip_linalg_sparse_algebra, only: multiply_many
   implicit none(type, external)
   private

   public :: find_soft_motions, soft_motions_t

   !> Motions softer than this part of the highest tied frequency are found. The residual mass of all stiffer ones changes the
   !> square of a frequency omega by no more than (omega/(softness omega_max))^2.
   real(wp), parameter :: softness = 0.3_wp
   !> Residual mass below this share of the motion's mass is none.
   real(wp), parameter :: negligible_share = 1.0e-6_wp
   !> Vectors of the subspace at the start: the six rigid motions of one body and two to spare.
   integer, parameter :: first_block = 8
   !> The iteration ends when the soft frequencies squared change by less than this part: the mass in the motions found is
   !> exact however far it has come.
   real(wp), parameter :: accuracy = 1.0e-3_wp
   integer, parameter :: max_iterations = 12
   !> A body without any springs is held by this part of the lowest tied frequency (M~_bb in place of its mass).
   real(wp), parameter :: shift = 1.0e-2_wp

   !> Boundary motions whose residual mass counts.
   type :: soft_motions_t
      !> (motions) omega_v, rad/s, ascending: frequency with the residual mass alone
      real(wp), allocatable :: omega(:)
      !> (motions) residual mass over all mass of the motion
      real(wp), allocatable :: share(:)
      !> X^T (boundary, motions), sqrt(kg)
      real(wp), allocatable :: mass_root(:, :)
      !> (boundary, motions) v, with v^T M_res v = 1
      real(wp), allocatable :: shape(:, :)
      !> Solutions with the factor of K_rr
      integer :: solves = 0
   end type soft_motions_t

contains

   !> Find them.
   subroutine find_soft_motions(stiffness, mass, factor, boundary, condensed, lambda, theta, alpha_t, motions, error)
      !> K~, M~ in relative coordinates
      type(symmetric_sparse_t), intent(in) :: stiffness, mass
      !> Of K~_rr
      type(symmetric_factor_t), intent(inout) :: factor
      !> (n_b) boundary rows
      integer, intent(in) :: boundary(:)
      !> K_s (n_b, n_b), N/m
      real(wp), intent(in), contiguous :: condensed(:, :)
      !> (n_i) (rad/s)^2, ascending; Theta (rows, n_i); alpha^T (n_b, n_i)
      real(wp), intent(in), contiguous :: lambda(:), theta(:, :), alpha_t(:, :)
      type(soft_motions_t), intent(out) :: motions
      !> K_s is not positive semidefinite
      type(error_t), allocatable, intent(out) :: error
      real(wp), allocatable :: held(:, :), v(:, :), force(:, :), inertia(:, :), mu(:)
      integer :: n, columns, soft
      real(wp) :: limit

      n = size(boundary)
      allocate (motions%omega(0), motions%share(0), motions%mass_root(n, 0), motions%shape(n, 0))
      if (n == 0) return
      limit = 1.0_wp/(softness**2*lambda(size(lambda)))
      held = condensed
      call add_shift(mass, boundary, shift**2*lambda(1), held)
      call cholesky_factor(held, error)
      if (allocated(error)) return
      columns = min(first_block, n)
      do
         call iterate(columns, v, force, inertia, mu, error)
         if (allocated(error)) return
         soft = count(mu > limit)
         if (soft < columns .or. columns == n) exit
         columns = min(2*columns, n)
      end do
      call keep(mu, inertia, alpha_t, v, soft, motions)

   contains

      !> The softest motions among `columns` vectors: v^T (K_s + shift) v = I, v^T M_res v = diag(mu).
      subroutine iterate(columns, v, force, inertia, mu, error)
         integer, intent(in) :: columns
         !> (n_b, columns) v, (K_s + shift) v, M_res v; mu, descending
         real(wp), allocatable, intent(out) :: v(:, :), force(:, :), inertia(:, :), mu(:)
         type(error_t), allocatable, intent(out) :: error
         real(wp) :: before(columns)
         integer :: k

         allocate (force(n, columns), inertia(n, columns), mu(columns))
         call fill_pseudo_random(force)
         before = 0.0_wp
         do k = 1, max_iterations
            v = force
            call cholesky_solve(held, v)
            call multiply_residual_mass(stiffness, mass, factor, boundary, theta, alpha_t, v, inertia)
            motions%solves = motions%solves + 2*columns
            call rotate(v, force, inertia, mu, error)
            if (allocated(error)) return
            if (all(abs(mu - before) <= accuracy*mu .or. mu < limit)) exit
            before = mu
            force = inertia/spread(max(mu, tiny(1.0_wp)), 1, n)
         end do
      end subroutine iterate

   end subroutine find_soft_motions

   !> The motions that are soft and have residual mass.
   subroutine keep(mu, inertia, alpha_t, v, soft, motions)
      real(wp), intent(in) :: mu(:)
      !> M_res v; alpha^T; v
      real(wp), intent(in), contiguous :: inertia(:, :), alpha_t(:, :), v(:, :)
      !> How many are soft: the first
      integer, intent(in) :: soft
      type(soft_motions_t), intent(inout) :: motions
      real(wp) :: share(soft), carried(size(alpha_t, 2), soft)
      integer, allocatable :: kept(:)
      integer :: k

      call product_of(alpha_t, v(:, :soft), carried, transpose_a=.true.)
      share = [(mu(k)/(mu(k) + dot_product(carried(:, k), carried(:, k))), k=1, soft)]
      kept = pack([(k, k=1, soft)], share > negligible_share)
      motions%omega = 1.0_wp/sqrt(mu(kept))
      motions%share = share(kept)
      motions%mass_root = inertia(:, kept)/spread(sqrt(mu(kept)), 1, size(inertia, 1))
      motions%shape = v(:, kept)/spread(sqrt(mu(kept)), 1, size(v, 1))
   end subroutine keep

   !> M_res v = P^T M (P - Theta alpha) v.
   subroutine multiply_residual_mass(stiffness, mass, factor, boundary, theta, alpha_t, v, product)
      type(symmetric_sparse_t), intent(in) :: stiffness, mass
      type(symmetric_factor_t), intent(inout) :: factor
      integer, intent(in) :: boundary(:)
      real(wp), intent(in), contiguous :: theta(:, :), alpha_t(:, :), v(:, :)
      !> (n_b, columns)
      real(wp), intent(out), contiguous :: product(:, :)
      real(wp), allocatable :: d(:, :), work(:, :), q(:, :)

      allocate (d(mass%n, size(v, 2)), work(mass%n, size(v, 2)), q(size(theta, 2), size(v, 2)))
      d = 0.0_wp
      d(boundary, :) = v
      call multiply_many(stiffness, d, work)
      call factor%solve(work)
      work(boundary, :) = 0.0_wp
      d = d - work
      call product_of(alpha_t, v, q, transpose_a=.true.)
      call product_of(theta, q, d, factor=-1.0_wp, keep=1.0_wp)
      call multiply_many(mass, d, work)
      product = condensed_forces(stiffness, factor, boundary, work)
   end subroutine multiply_residual_mass

   !> Rayleigh-Ritz in the subspace of v.
   subroutine rotate(v, force, inertia, mu, error)
      !> (n_b, columns) v, (K_s + shift) v, M_res v
      real(wp), intent(inout), contiguous :: v(:, :), force(:, :), inertia(:, :)
      !> (columns) descending
      real(wp), intent(out), contiguous :: mu(:)
      type(error_t), allocatable, intent(out) :: error
      real(wp) :: a(size(mu), size(mu)), b(size(mu), size(mu)), turned(size(v, 1), size(mu))
      integer :: n

      n = size(mu)
      call product_of(v, inertia, a, transpose_a=.true.)
      call product_of(v, force, b, transpose_a=.true.)
      a = 0.5_wp*(a + transpose(a))
      b = 0.5_wp*(b + transpose(b))
      call eigen_generalised(a, b, mu, error)
      if (allocated(error)) return
      mu = mu(n:1:-1)
      a = a(:, n:1:-1)
      call product_of(v, a, turned)
      v = turned
      call product_of(force, a, turned)
      force = turned
      call product_of(inertia, a, turned)
      inertia = turned
   end subroutine rotate

   !> A <- A + factor M~_bb.
   subroutine add_shift(mass, boundary, factor, a)
      type(symmetric_sparse_t), intent(in) :: mass
      integer, intent(in) :: boundary(:)
      real(wp), intent(in) :: factor
      real(wp), intent(inout) :: a(:, :)
      integer :: place(mass%n), i, j, k

      place = 0
      place(boundary) = [(k, k=1, size(boundary))]
      do i = 1, mass%n
         if (place(i) == 0) cycle
         do k = mass%row_start(i), mass%row_start(i + 1) - 1
            j = mass%column(k)
            if (place(j) == 0) cycle
            a(place(i), place(j)) = a(place(i), place(j)) + factor*mass%value(k)
            if (i /= j) a(place(j), place(i)) = a(place(j), place(i)) + factor*mass%value(k)
         end do
      end do
   end subroutine add_shift

   !> The same numbers between -1/2 and 1/2 every time.
   pure subroutine fill_pseudo_random(a)
      real(wp), intent(out) :: a(:, :)
      integer(i8), parameter :: multiplier = 48271_i8, modulus = 2147483647_i8
      integer(i8) :: state
      integer :: j, k

      state = 20260503_i8
      do j = 1, size(a, 2)
         do k = 1, size(a, 1)
            state = mod(multiplier*state, modulus)
            a(k, j) = real(state, wp)/real(modulus, wp) - 0.5_wp
         end do
      end do
   end subroutine fill_pseudo_random

end module microslip_fe_residual_mass
