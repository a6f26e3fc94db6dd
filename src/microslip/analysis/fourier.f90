!> Truncated Fourier series of periodic vectors, and the alternation between samples and coefficients.
!>
!>     x(tau) = x_0 + sum_h x_c,h cos(h tau) + x_s,h sin(h tau),      tau = omega t,  h = 1 ... H
!> Coefficients are columns: (n, 2H + 1) = [x_0, x_c,1, x_s,1, x_c,2, ...]. The N samples of a period are equally
!> spaced and begin at tau = 0. Coefficients of N > 2H samples are those of the least-squares fit (the DFT).
module microslip_analysis_fourier
   use microslip_core_kinds, only: wp, pi
   implicit none(type, external)
   private

   public :: fourier_t, new_fourier

   type :: fourier_t
      !> H and N
      integer :: harmonics = 0, samples = 0
      !> (2H + 1, N) x(:, tau_k) = coefficients * basis(:, k)
      real(wp), allocatable :: basis(:, :)
      !> (2H + 1, N) coefficients = samples * projection^T
      real(wp), allocatable :: projection(:, :)
   contains
      procedure :: columns
      procedure :: phase_derivative
   end type fourier_t

contains

   !> Basis and projection for H harmonics and N samples.
   pure function new_fourier(harmonics, samples) result(fourier)
      integer, intent(in) :: harmonics
      !> More than twice the harmonics
      integer, intent(in) :: samples
      type(fourier_t) :: fourier
      integer :: h, k

      fourier%harmonics = harmonics
      fourier%samples = samples
      allocate (fourier%basis(2*harmonics + 1, samples))
      fourier%basis(1, :) = 1.0_wp
      do k = 1, samples
         do h = 1, harmonics
            ! The angle is reduced in integers, so that opposite samples are opposite to the last bit.
            fourier%basis(2*h, k) = cosine(modulo(h*(k - 1), samples), samples)
            fourier%basis(2*h + 1, k) = cosine(modulo(4*h*(k - 1) - samples, 4*samples), 4*samples)
         end do
      end do
      fourier%projection = 2.0_wp/samples*fourier%basis
      fourier%projection(1, :) = 1.0_wp/samples
   end function new_fourier

   !> cos(2 pi part/whole).
   elemental real(wp) function cosine(part, whole)
      integer, intent(in) :: part, whole
      cosine = cos(2.0_wp*pi*real(part, wp)/real(whole, wp))
   end function cosine

   !> 2H + 1.
   pure integer function columns(self)
      class(fourier_t), intent(in) :: self
      columns = 2*self%harmonics + 1
   end function columns

   !> Coefficients of dx/dtau, (n, 2H + 1).
   pure function phase_derivative(self, x) result(dx)
      class(fourier_t), intent(in) :: self
      !> (n, 2H + 1)
      real(wp), intent(in) :: x(:, :)
      real(wp) :: dx(size(x, 1), size(x, 2))
      integer :: h

      dx(:, 1) = 0.0_wp
      do h = 1, self%harmonics
         dx(:, 2*h) = h*x(:, 2*h + 1)
         dx(:, 2*h + 1) = -h*x(:, 2*h)
      end do
   end function phase_derivative

end module microslip_analysis_fourier
