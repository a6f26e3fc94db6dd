!> The product of the half-space compliance with the contact forces of all points, by FFT (METHOD section 3).
!>
!> C is block-Toeplitz, so u = C lambda is a convolution over the cells of the grid. Zero-padding to at least
!> 2 n - 1 cells each way makes the cyclic convolution of the FFT exact. Cells without a contact point carry
!> no force. Every part of C is even or odd in both offsets, so its spectrum is real (nn, 11, 22, 12) or
!> imaginary (n1, n2), and one real number per frequency is kept:
!>
!>     u_n = K_nn l_n + i (K_n1 l_1 + K_n2 l_2)
!>     u_1 = K_11 l_1 + K_12 l_2 - i K_n1 l_n
!>     u_2 = K_12 l_1 + K_22 l_2 - i K_n2 l_n
!>
!> Plans are made with FFTW_ESTIMATE: the timing-driven choice of FFTW_MEASURE varies from run to run, and the
!> last digits of the results with it.
module microslip_halfspace_convolution
   use, intrinsic :: iso_c_binding, only: c_ptr, c_null_ptr, c_associated, c_int, c_double, c_double_complex
   use microslip_core_kinds, only: wp
   use microslip_halfspace_compliance, only: compliance_t, part_nn, part_11, part_22, part_12, part_n1, part_n2
   use microslip_linalg_fftw, only: fftw_plan_many_dft_r2c, fftw_plan_many_dft_c2r, fftw_execute_dft_r2c, &
      & fftw_execute_dft_c2r, fftw_destroy_plan, FFTW_ESTIMATE
   implicit none(type, external)
   private

   public :: convolution_t, new_convolution, approximate_inverse

   !> C of one interface as an operator. Copies share the plans; `release` frees them, once no copy is in use.
   type :: convolution_t
      private
      !> Padded size
      integer :: mx = 0, my = 0
      !> (points) cell indices
      integer, allocatable :: ix(:), iy(:)
      !> (mx/2+1, my, 4 or 6) spectra of the parts over mx*my, m/N
      real(wp), allocatable :: spectrum(:, :, :)
      type(c_ptr) :: forward = c_null_ptr, backward = c_null_ptr
      !> The same for one component
      type(c_ptr) :: forward_one = c_null_ptr, backward_one = c_null_ptr
   contains
      procedure :: apply
      procedure :: apply_normal
      procedure :: diagonal
      procedure :: release
   end type convolution_t

contains

   !> Make the operator from the table of coefficients.
   subroutine new_convolution(convolution, compliance)
      !> The operator
      type(convolution_t), intent(out) :: convolution
      !> Coefficients and contact points
      type(compliance_t), intent(in) :: compliance
      real(wp), allocatable :: field(:, :, :)
      complex(wp), allocatable :: transform(:, :, :)
      integer :: parts

      parts = size(compliance%table, 1)
      convolution%mx = good_size(2*size(compliance%table, 2) - 1)
      convolution%my = good_size(2*size(compliance%table, 3) - 1)
      convolution%ix = compliance%ix
      convolution%iy = compliance%iy
      allocate (convolution%spectrum(convolution%mx/2 + 1, convolution%my, parts))
      call make_workspace(convolution, field, transform)
      call make_plans(convolution, field, transform)
      call transform_parts(convolution, compliance%table, field, transform)
   end subroutine new_convolution

   !> Arrays on the padded grid: (mx, my, 3) forces, then displacements, and (mx/2+1, my, 3) their transforms.
   subroutine make_workspace(convolution, field, transform)
      type(convolution_t), intent(in) :: convolution
      real(wp), allocatable, intent(out) :: field(:, :, :)
      complex(wp), allocatable, intent(out) :: transform(:, :, :)

      allocate (field(convolution%mx, convolution%my, 3))
      allocate (transform(convolution%mx/2 + 1, convolution%my, 3))
   end subroutine make_workspace

   !> Plans for the three components at once and for one.
   subroutine make_plans(convolution, field, transform)
      type(convolution_t), intent(inout) :: convolution
      real(wp), intent(inout) :: field(:, :, :)
      complex(wp), intent(inout) :: transform(:, :, :)

      call make_pair(3_c_int, convolution%forward, convolution%backward)
      call make_pair(1_c_int, convolution%forward_one, convolution%backward_one)

   contains

      subroutine make_pair(components, forward, backward)
         integer(c_int), intent(in) :: components
         type(c_ptr), intent(out) :: forward, backward
         integer(c_int) :: n(2), n_half(2)

         n = [convolution%my, convolution%mx]
         n_half = [convolution%my, convolution%mx/2 + 1]
         forward = fftw_plan_many_dft_r2c(2_c_int, n, components, field, n, 1_c_int, product(n), &
            & transform, n_half, 1_c_int, product(n_half), FFTW_ESTIMATE)
         backward = fftw_plan_many_dft_c2r(2_c_int, n, components, transform, n_half, 1_c_int, &
            & product(n_half), field, n, 1_c_int, product(n), FFTW_ESTIMATE)
      end subroutine make_pair

   end subroutine make_plans

   !> Spectra of the parts, three at a time. The part that vanishes by symmetry is rounding and is dropped,
   !> which makes the operator symmetric to the last bit of its spectrum.
   subroutine transform_parts(convolution, table, field, transform)
      type(convolution_t), intent(inout) :: convolution
      real(wp), intent(in) :: table(:, 0:, 0:)
      real(wp), intent(inout), contiguous :: field(:, :, :)
      complex(wp), intent(inout), contiguous :: transform(:, :, :)
      integer :: first, part

      do first = 1, size(table, 1), 3
         field = 0.0_wp
         do part = first, min(first + 2, size(table, 1))
            call wrap_part(part, table(part, :, :), field(:, :, part - first + 1))
         end do
         call fftw_execute_dft_r2c(convolution%forward, field, transform)
         do part = first, min(first + 2, size(table, 1))
            associate (values => transform(:, :, part - first + 1))
               if (part == part_n1 .or. part == part_n2) then
                  convolution%spectrum(:, :, part) = aimag(values)
               else
                  convolution%spectrum(:, :, part) = real(values, wp)
               end if
            end associate
         end do
      end do
      convolution%spectrum = convolution%spectrum/(real(convolution%mx, wp)*convolution%my)
   end subroutine transform_parts

   !> Continue one part to negative offsets, which wrap round the padded grid. Odd parts vanish at offset zero.
   pure subroutine wrap_part(part, values, field)
      integer, intent(in) :: part
      real(wp), intent(in) :: values(0:, 0:)
      real(wp), intent(inout) :: field(0:, 0:)
      integer :: i, j, parity_x, parity_y, mx, my

      parity_x = merge(-1, 1, part == part_12 .or. part == part_n1)
      parity_y = merge(-1, 1, part == part_12 .or. part == part_n2)
      mx = size(field, 1)
      my = size(field, 2)
      do j = 0, ubound(values, 2)
         if (j == 0 .and. parity_y < 0) cycle
         do i = 0, ubound(values, 1)
            if (i == 0 .and. parity_x < 0) cycle
            field(i, j) = values(i, j)
            field(modulo(-i, mx), j) = parity_x*values(i, j)
            field(i, modulo(-j, my)) = parity_y*values(i, j)
            field(modulo(-i, mx), modulo(-j, my)) = parity_x*parity_y*values(i, j)
         end do
      end do
   end subroutine wrap_part

   !> u = C lambda for all contact points.
   subroutine apply(self, lambda, u)
      class(convolution_t), intent(in) :: self
      !> (3, points) contact forces (n, t1, t2), N
      real(wp), intent(in) :: lambda(:, :)
      !> (3, points) relative displacements (n, t1, t2), m
      real(wp), intent(out) :: u(:, :)
      real(wp), allocatable :: field(:, :, :)
      complex(wp), allocatable :: transform(:, :, :)
      integer :: point

      call make_workspace(self, field, transform)
      field = 0.0_wp
      do point = 1, size(self%ix)
         field(self%ix(point), self%iy(point), :) = lambda(:, point)
      end do
      call fftw_execute_dft_r2c(self%forward, field, transform)
      call multiply_spectra(self%spectrum, transform)
      call fftw_execute_dft_c2r(self%backward, transform, field)
      do point = 1, size(self%ix)
         u(:, point) = field(self%ix(point), self%iy(point), :)
      end do
   end subroutine apply

   !> u_n, the normal part of u = C lambda, for all contact points: one transform each way where the materials do
   !> not couple n with t.
   subroutine apply_normal(self, lambda, u_n)
      class(convolution_t), intent(in) :: self
      !> (3, points) contact forces (n, t1, t2), N
      real(wp), intent(in) :: lambda(:, :)
      !> (points) normal relative displacements, m
      real(wp), intent(out) :: u_n(:)
      real(wp), allocatable :: field(:, :, :)
      complex(wp), allocatable :: transform(:, :, :)
      integer :: point, components
      logical :: coupled

      call make_workspace(self, field, transform)
      coupled = size(self%spectrum, 3) > part_12
      components = merge(3, 1, coupled)
      field(:, :, :components) = 0.0_wp
      do point = 1, size(self%ix)
         field(self%ix(point), self%iy(point), :components) = lambda(:components, point)
      end do
      if (coupled) then
         call fftw_execute_dft_r2c(self%forward, field, transform)
      else
         call fftw_execute_dft_r2c(self%forward_one, field, transform)
      end if
      call multiply_normal(self%spectrum, transform)
      call fftw_execute_dft_c2r(self%backward_one, transform, field)
      do point = 1, size(self%ix)
         u_n(point) = field(self%ix(point), self%iy(point), 1)
      end do
   end subroutine apply_normal

   !> The normal component of the product at every frequency, in place.
   pure subroutine multiply_normal(k, f)
      !> (mx/2+1, my, 4 or 6) spectra of the parts of C
      real(wp), intent(in), contiguous :: k(:, :, :)
      !> (mx/2+1, my, 3) transformed forces; normal displacements in the first component
      complex(wp), intent(inout), contiguous :: f(:, :, :)
      complex(wp), parameter :: imaginary = (0.0_wp, 1.0_wp)

      f(:, :, 1) = k(:, :, part_nn)*f(:, :, 1)
      if (size(k, 3) == part_12) return
      f(:, :, 1) = f(:, :, 1) + imaginary*(k(:, :, part_n1)*f(:, :, 2) + k(:, :, part_n2)*f(:, :, 3))
   end subroutine multiply_normal

   !> The three-component product at every frequency, in place.
   pure subroutine multiply_spectra(k, f)
      !> (mx/2+1, my, 4 or 6) spectra of the parts of C
      real(wp), intent(in), contiguous :: k(:, :, :)
      !> (mx/2+1, my, 3) transformed forces, then displacements
      complex(wp), intent(inout), contiguous :: f(:, :, :)
      complex(wp), parameter :: imaginary = (0.0_wp, 1.0_wp)
      complex(wp) :: l(3)
      integer :: i, j
      logical :: coupled

      coupled = size(k, 3) > part_12
      do j = 1, size(f, 2)
         do i = 1, size(f, 1)
            l = f(i, j, :)
            f(i, j, 1) = k(i, j, part_nn)*l(1)
            f(i, j, 2) = k(i, j, part_11)*l(2) + k(i, j, part_12)*l(3)
            f(i, j, 3) = k(i, j, part_12)*l(2) + k(i, j, part_22)*l(3)
            if (coupled) then
               f(i, j, 1) = f(i, j, 1) + imaginary*(k(i, j, part_n1)*l(2) + k(i, j, part_n2)*l(3))
               f(i, j, 2) = f(i, j, 2) - imaginary*(k(i, j, part_n1)*l(1))
               f(i, j, 3) = f(i, j, 3) - imaginary*(k(i, j, part_n2)*l(1))
            end if
         end do
      end do
   end subroutine multiply_spectra

   !> The convolution whose spectrum is the inverse of that of C, normal and tangential parts apart: C on an unbounded
   !> plane undone. Restricted to a contact area it is near the inverse of C there, symmetric positive definite, and a
   !> preconditioner. Spectral values that truncation has made small or negative are raised. Shares the plans.
   function approximate_inverse(convolution) result(inverse)
      type(convolution_t), intent(in) :: convolution
      type(convolution_t) :: inverse
      real(wp), parameter :: least = 1.0e-3_wp
      real(wp) :: cells, floor_n, floor_t, a, b, c, half, root, mean, big, small
      integer :: i, j

      inverse = convolution
      deallocate (inverse%spectrum)
      cells = real(convolution%mx, wp)*convolution%my
      associate (k => convolution%spectrum)
         allocate (inverse%spectrum(size(k, 1), size(k, 2), part_12))
         floor_n = least*maxval(k(:, :, part_nn))
         floor_t = least*maxval(k(:, :, part_11:part_22))
         do j = 1, size(k, 2)
            do i = 1, size(k, 1)
               inverse%spectrum(i, j, part_nn) = 1.0_wp/(max(k(i, j, part_nn), floor_n)*cells**2)
               a = k(i, j, part_11)
               b = k(i, j, part_22)
               c = k(i, j, part_12)
               ! Eigenvalues mean +- root of the tangential block, raised; the inverse has the same eigenvectors.
               mean = 0.5_wp*(a + b)
               half = 0.5_wp*(a - b)
               root = max(hypot(half, c), tiny(1.0_wp))
               big = 1.0_wp/(max(mean + root, floor_t)*cells**2)
               small = 1.0_wp/(max(mean - root, floor_t)*cells**2)
               inverse%spectrum(i, j, part_11) = 0.5_wp*((big + small) + (big - small)*half/root)
               inverse%spectrum(i, j, part_22) = 0.5_wp*((big + small) - (big - small)*half/root)
               inverse%spectrum(i, j, part_12) = 0.5_wp*(big - small)*c/root
            end do
         end do
      end associate
   end function approximate_inverse

   !> The factor between force and displacement of one point alone, (n, t1, t2).
   pure function diagonal(self) result(values)
      class(convolution_t), intent(in) :: self
      real(wp) :: values(3)
      integer :: part, columns

      ! A real transform keeps half of the spectrum: all but the first column (and the last of an even size) count twice.
      columns = size(self%spectrum, 1)
      do part = part_nn, part_22
         associate (k => self%spectrum(:, :, part))
            values(part) = 2.0_wp*sum(k) - sum(k(1, :))
            if (mod(self%mx, 2) == 0) values(part) = values(part) - sum(k(columns, :))
         end associate
      end do
   end function diagonal

   !> Free the plans.
   subroutine release(self)
      class(convolution_t), intent(inout) :: self

      call destroy(self%forward)
      call destroy(self%backward)
      call destroy(self%forward_one)
      call destroy(self%backward_one)
   end subroutine release

   subroutine destroy(plan)
      type(c_ptr), intent(inout) :: plan

      if (c_associated(plan)) call fftw_destroy_plan(plan)
      plan = c_null_ptr
   end subroutine destroy

   !> The smallest size from n on that has only the factors 2, 3, 5 and 7.
   pure integer function good_size(n)
      integer, intent(in) :: n
      integer, parameter :: factors(4) = [2, 3, 5, 7]
      integer :: rest, k

      good_size = n
      do
         rest = good_size
         do k = 1, size(factors)
            do while (modulo(rest, factors(k)) == 0)
               rest = rest/factors(k)
            end do
         end do
         if (rest == 1) return
         good_size = good_size + 1
      end do
   end function good_size

end module microslip_halfspace_convolution
