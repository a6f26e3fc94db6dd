!> Truncated Fourier series of periodic vectors, and the alternation between samples and coefficients.
!>
!>     x(tau) = x_0 + sum_h x_c,h cos(h tau) + x_s,h sin(h tau),      tau = omega t,  h = 1 ... H
!> Coefficients are columns: (n, 2H + 1) = [x_0, x_c,1, x_s,1, x_c,2, ...]. The N samples of a period begin at tau = 0.
!> They are equally spaced, or closer where `refined` has split intervals. Coefficients of N > 2H samples are those of the
!> least-squares fit, a sample counting with half the intervals beside it: with equal spacing the DFT.
module microslip_analysis_fourier
   use microslip_core_kinds, only: wp, i8, pi
   use microslip_linalg_dense, only: inverse_spd, product_of
   use microslip_core_error, only: error_t
   implicit none(type, external)
   private

   public :: fourier_t, new_fourier, series_coefficients

   !> Parts that an interval is split into, and how often that can be repeated.
   integer, parameter :: parts = 4, deepest = 5
   !> Ticks of the finest interval in one of equal spacing
   integer(i8), parameter :: ticks = int(parts, i8)**deepest

   type :: fourier_t
      !> H and N
      integer :: harmonics = 0, samples = 0
      !> (2H + 1, N) x(:, tau_k) = coefficients * basis(:, k)
      real(wp), allocatable :: basis(:, :)
      !> (2H + 1, N) coefficients = samples * projection^T
      real(wp), allocatable :: projection(:, :)
      !> (N) place of a sample in the period, and length of the period, in ticks
      integer(i8), allocatable, private :: place(:)
      integer(i8), private :: period = 0
   contains
      procedure :: columns
      procedure :: phase_derivative
      procedure :: refined
      procedure :: can_be_split
      procedure :: widths
   end type fourier_t

contains

   !> Basis and projection for H harmonics and N equally spaced samples.
   pure function new_fourier(harmonics, samples) result(fourier)
      integer, intent(in) :: harmonics
      !> More than twice the harmonics
      integer, intent(in) :: samples
      type(fourier_t) :: fourier
      integer :: k

      fourier%harmonics = harmonics
      fourier%samples = samples
      fourier%place = [((k - 1)*ticks, k=1, samples)]
      fourier%period = samples*ticks
      fourier%basis = basis_at(harmonics, fourier%place, fourier%period)
      fourier%projection = 2.0_wp/samples*fourier%basis
      fourier%projection(1, :) = 1.0_wp/samples
   end function new_fourier

   !> 1, cos(tau), sin(tau), cos(2 tau), ... at the samples, (2H + 1, N).
   pure function basis_at(harmonics, place, period) result(basis)
      integer, intent(in) :: harmonics
      integer(i8), intent(in) :: place(:), period
      real(wp) :: basis(2*harmonics + 1, size(place))
      integer :: h, k

      basis(1, :) = 1.0_wp
      do k = 1, size(place)
         do h = 1, harmonics
            ! The angle is reduced in integers, so that opposite samples are opposite to the last bit.
            basis(2*h, k) = cosine(modulo(h*place(k), period), period)
            basis(2*h + 1, k) = cosine(modulo(4*h*place(k) - period, 4*period), 4*period)
         end do
      end do
   end function basis_at

   !> cos(2 pi part/whole).
   elemental real(wp) function cosine(part, whole)
      integer(i8), intent(in) :: part, whole
      cosine = cos(2.0_wp*pi*real(part, wp)/real(whole, wp))
   end function cosine

   !> The same series with some intervals between samples split into equal parts.
   function refined(self, split) result(fine)
      class(fourier_t), intent(in) :: self
      !> (N) whether the interval that ends at a sample is split; that of the first sample begins at the last one
      logical, intent(in) :: split(:)
      type(fourier_t) :: fine
      type(error_t), allocatable :: error
      integer(i8) :: before, width
      real(wp), allocatable :: weighted(:, :), normal(:, :), weight(:)
      integer :: j, k, n

      n = self%samples
      fine%harmonics = self%harmonics
      fine%samples = n + (parts - 1)*count(split)
      fine%period = self%period
      allocate (fine%place(fine%samples), weight(fine%samples))
      j = 0
      do k = 1, n + 1
         if (split(modulo(k - 1, n) + 1) .and. k > 1) then
            before = self%place(k - 1)
            width = interval(self, modulo(k - 1, n) + 1)/parts
            fine%place(j + 1:j + parts - 1) = before + width*[1, 2, 3]
            j = j + parts - 1
         end if
         if (k > n) exit
         j = j + 1
         fine%place(j) = self%place(k)
      end do
      fine%basis = basis_at(fine%harmonics, fine%place, fine%period)
      weight = weights(fine)
      weighted = fine%basis*spread(weight, 1, size(fine%basis, 1))
      allocate (normal(size(weighted, 1), size(weighted, 1)), fine%projection(size(weighted, 1), fine%samples))
      call product_of(weighted, fine%basis, normal, transpose_b=.true.)
      call inverse_spd(normal, error)
      call product_of(normal, weighted, fine%projection)
   end function refined

   !> Length of the interval that ends at sample k, in ticks.
   pure integer(i8) function interval(self, k)
      class(fourier_t), intent(in) :: self
      integer, intent(in) :: k
      if (k == 1) then
         interval = self%period - self%place(self%samples)
      else
         interval = self%place(k) - self%place(k - 1)
      end if
   end function interval

   !> Part of the period that a sample stands for, (N).
   pure function weights(self) result(weight)
      type(fourier_t), intent(in) :: self
      real(wp) :: weight(self%samples)
      integer :: k

      do k = 1, self%samples
         weight(k) = 0.5_wp*real(interval(self, k) + interval(self, modulo(k, self%samples) + 1), wp)/real(self%period, wp)
      end do
   end function weights

   !> (N) Lengths of the intervals that end at the samples, rad.
   pure function widths(self) result(width)
      class(fourier_t), intent(in) :: self
      real(wp) :: width(self%samples)
      integer :: k
      width = [(2.0_wp*pi*real(interval(self, k), wp)/real(self%period, wp), k=1, self%samples)]
   end function widths

   !> (N) Whether the interval that ends at a sample is longer than the shortest allowed.
   pure function can_be_split(self) result(can)
      class(fourier_t), intent(in) :: self
      logical :: can(self%samples)
      integer :: k
      can = [(interval(self, k) >= parts, k=1, self%samples)]
   end function can_be_split

   !> Coefficients (n, 2 harmonics + 1) of samples (n, N) by the trapezoidal rule, also of harmonics beyond H.
   pure function series_coefficients(fourier, samples, harmonics) result(coefficients)
      type(fourier_t), intent(in) :: fourier
      real(wp), intent(in) :: samples(:, :)
      integer, intent(in) :: harmonics
      real(wp) :: coefficients(size(samples, 1), 2*harmonics + 1)

      coefficients = matmul(samples*spread(weights(fourier), 1, size(samples, 1)), &
         & transpose(basis_at(harmonics, fourier%place, fourier%period)))
      coefficients(:, 2:) = 2.0_wp*coefficients(:, 2:)
   end function series_coefficients

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
