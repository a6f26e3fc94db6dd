!> The reduced model: modal coordinates d_i with mass, boundary coordinates d_b without (METHOD section 2).
!>
!>     | I 0 | d_i''   | K_ii    K_bi^T | d_i     pattern_i^T         u_s = pattern_i^T d_i + pattern_b^T d_b
!>     | 0 0 | d_b'' + | K_bi    K_bb   | d_b  =  pattern_b^T  load,
!>
!> SI units: d_b in m, d_i in m sqrt(kg) (unit modal mass).
module microslip_fe_reduced_model
   use microslip_core_error, only: error_t
   use microslip_core_kinds, only: wp, i8
   use microslip_linalg_dense, only: eigen_symmetric
   implicit none(type, external)
   private

   public :: reduced_model_t, reduction_record_t, body_mass_t, find_highest_frequency

   !> What the reduction cost.
   type :: reduction_record_t
      !> Rows of the FE matrices; entries of the factor of K_rr
      integer :: rows = 0
      integer(i8) :: factor_entries = 0
      !> Solutions with a sparse factor in all; blocks of the eigenvalue iteration; its relative residual
      integer :: solves = 0, iterations = 0
      real(wp) :: residual = 0.0_wp
      !> Wall time of the Schur complement, the modes and everything, s
      real(wp) :: seconds_schur = 0.0_wp, seconds_modes = 0.0_wp, seconds = 0.0_wp
   end type reduction_record_t

   !> A body (elements that share nodes) moving as a whole: three translations, three rotations about its centre of mass.
   type :: body_mass_t
      !> Number of nodes, and the smallest number that one of them has in the FE program
      integer :: nodes = 0, first_label = 0
      !> (6) kg and kg m^2: mass along x, y, z, moment of inertia about x, y, z
      real(wp) :: inertia(6) = 0.0_wp
      !> (6) part of mass or moment of inertia that the reduced model carries
      real(wp) :: kept(6) = 0.0_wp
      !> (6) Hz: frequency of the rigid motion on supports and springs (Rayleigh's quotient)
      real(wp) :: frequency(6) = 0.0_wp
   end type body_mass_t

   !> Reduced matrices, load patterns and sensor rows.
   type :: reduced_model_t
      !> 'craig_bampton_massless' or 'macneal'
      character(len=:), allocatable :: method
      !> (n_i) Hz: tied frequencies (of the structure with Craig-Bampton, of the reduced model with MacNeal), then those
      !> lent to coordinates that carry residual mass
      real(wp), allocatable :: frequency(:)
      !> How many of them are tied modes
      integer :: tied_modes = 0
      !> (soft motions) Craig-Bampton: boundary motions whose residual mass matters (`microslip_fe_residual_mass`): frequency
      !> that each has with the residual mass alone, Hz, and that mass over all of its mass
      real(wp), allocatable :: soft_frequency(:), soft_share(:)
      type(body_mass_t), allocatable :: bodies(:)
      !> (n_i, n_i), (n_b, n_i), (n_b, n_b)
      real(wp), allocatable :: K_ii(:, :), K_bi(:, :), K_bb(:, :)
      !> (n_i, patterns), (n_b, patterns) force patterns; by reciprocity the same columns give the displacement
      !> u_s = e^T u of a sensor whose row e is the pattern
      real(wp), allocatable :: pattern_i(:, :), pattern_b(:, :)
      type(reduction_record_t) :: record
   end type reduced_model_t

contains

   !> Highest angular frequency with all of the boundary tied: that of K_ii.
   subroutine find_highest_frequency(reduced, omega, error)
      type(reduced_model_t), intent(in) :: reduced
      !> rad/s
      real(wp), intent(out) :: omega
      type(error_t), allocatable, intent(out) :: error
      real(wp), allocatable :: work(:, :), lambda(:)

      omega = 0.0_wp
      work = reduced%K_ii
      allocate (lambda(size(work, 1)))
      call eigen_symmetric(work, lambda, error, values_only=.true.)
      if (.not. allocated(error)) omega = sqrt(maxval(lambda))
   end subroutine find_highest_frequency

end module microslip_fe_reduced_model
