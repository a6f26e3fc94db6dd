!> What one product of the half-space compliance with the contact forces costs: by FFT, and with the dense matrix.
!>
!> One square interface of n x n cells, three components, of equal and of unequal materials. Prints CSV: the FFT's
!> cost grows as N log N with the number N of points (last column: seconds over N log2 N), the dense product's as
!> N^2. Both are medians of repeats. Columns without a value: the dense matrix would be too large.
program convolution_cost
   use, intrinsic :: iso_fortran_env, only: error_unit, output_unit
   use omp_lib, only: omp_get_max_threads, omp_get_wtime
   use microslip_core_error, only: error_t
   use microslip_core_kinds, only: wp
   use microslip_halfspace_compliance, only: compliance_t, new_compliance
   use microslip_halfspace_convolution, only: convolution_t, new_convolution
   use microslip_halfspace_grid, only: be_grid_t, new_grid
   use microslip_halfspace_love_cerruti, only: elastic_material, half_space_pair, material_t
   use microslip_linalg_dense, only: product_of
   implicit none(type, external)

   integer, parameter :: cells(8) = [32, 45, 64, 70, 100, 150, 224, 316], repeats = 25, dense_points = 4096
   !> Side of the square, m; Young's moduli of the upper and, equal and unequal, of the lower body, Pa
   real(wp), parameter :: side = 0.05_wp, upper = 194.0e9_wp, lower(2) = [194.0e9_wp, 70.0e9_wp], poisson = 0.2854_wp
   character(len=*), parameter :: materials(2) = ['equal  ', 'unequal']
   integer :: k, m

   write (output_unit, '(a)') 'materials,points,threads,fft_s,dense_s,deviation,fft_s_per_n_log2_n'
   do m = 1, 2
      do k = 1, size(cells)
         call measure(cells(k), m)
      end do
   end do

contains

   !> One line.
   subroutine measure(n, which)
      !> Cells each way, and which of the materials
      integer, intent(in) :: n, which
      type(be_grid_t) :: grid
      type(material_t) :: body(2)
      type(compliance_t) :: compliance
      type(convolution_t) :: convolution
      type(error_t), allocatable :: error
      real(wp), allocatable :: force(:, :), u(:, :)
      real(wp) :: seconds(repeats), start, points
      character(len=40) :: dense
      integer :: j

      call elastic_material(body(1), upper, poisson, error)
      if (.not. allocated(error)) call elastic_material(body(2), lower(which), poisson, error)
      if (.not. allocated(error)) call new_grid(grid, [0.0_wp, 0.0_wp], [side, side], n, n, error)
      if (allocated(error)) then
         write (error_unit, '(a)') error%message
         stop 2, quiet=.true.
      end if
      call new_compliance(compliance, half_space_pair(body(1), body(2)), grid)
      call new_convolution(convolution, compliance)
      allocate (force(3, n*n), u(3, n*n))
      call random_number(force)
      call convolution%apply(force, u)
      do j = 1, repeats
         start = omp_get_wtime()
         call convolution%apply(force, u)
         seconds(j) = omp_get_wtime() - start
      end do
      call convolution%release()
      dense = ','
      if (n*n <= dense_points) call measure_dense(compliance, force, u, dense)
      points = real(n, wp)**2
      write (output_unit, '(a, 2(",", i0), ",", es10.3, ",", a, ",", es10.3)') trim(materials(which)), n*n, &
         & omp_get_max_threads(), median(seconds), trim(dense), median(seconds)/(points*log(points)/log(2.0_wp))
   end subroutine measure

   !> Seconds of the dense product, and how far the other one is from it.
   subroutine measure_dense(compliance, force, u, columns)
      type(compliance_t), intent(in) :: compliance
      !> (3, points) forces, N, and displacements by FFT, m
      real(wp), intent(in) :: force(:, :), u(:, :)
      !> The two columns
      character(len=*), intent(out) :: columns
      real(wp), allocatable :: c(:, :), x(:, :), y(:, :)
      real(wp) :: seconds(5), start
      integer :: j, n

      n = size(force, 2)
      allocate (c(3*n, 3*n), y(3*n, 1))
      call compliance%gather([(j, j=1, n)], [(j, j=1, n)], c)
      x = reshape(force, [3*n, 1])
      do j = 1, size(seconds)
         start = omp_get_wtime()
         call product_of(c, x, y)
         seconds(j) = omp_get_wtime() - start
      end do
      write (columns, '(es10.3, ",", es9.2)') median(seconds), maxval(abs(reshape(y, [3, n]) - u))/maxval(abs(y))
   end subroutine measure_dense

   !> The middle one of an odd number of values.
   pure real(wp) function median(values)
      real(wp), intent(in) :: values(:)
      integer :: k

      median = values(1)
      do k = 1, size(values)
         if (count(values < values(k)) <= size(values)/2 .and. count(values <= values(k)) > size(values)/2) median = values(k)
      end do
   end function median

end program convolution_cost
