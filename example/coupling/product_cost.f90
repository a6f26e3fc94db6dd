!> What one product of the contact compliance costs with both couplings of half space and FE model.
!>
!> One pad of the size of the S4 Beam's with 25 x 17 FE nodes and grids of several sizes, all points in potential contact;
!> G x = C x + W^T F W x with C by FFT, and with C_s in place of C. Prints CSV: least seconds of alternating repeats, which other
!> work on the machine changes less than their mean.
program product_cost
   use, intrinsic :: iso_fortran_env, only: error_unit, output_unit
   use omp_lib, only: omp_get_max_threads, omp_get_wtime
   use microslip_core_error, only: error_t
   use microslip_core_kinds, only: wp
   use microslip_fe_interface, only: contact_interface_t
   use microslip_halfspace_grid, only: be_grid_t, new_grid
   use microslip_halfspace_love_cerruti, only: elastic_material, half_space_pair, material_t
   use microslip_system_fft_compliance, only: fft_compliance_t, new_fft_compliance
   use microslip_system_pad, only: new_pad, pad_t
   implicit none(type, external)

   integer, parameter :: cells(2, 4) = reshape([42, 26, 80, 50, 160, 100, 240, 150], [2, 4]), nodes(2) = [25, 17], repeats = 41
   !> m
   real(wp), parameter :: size_of_pad(2) = [50.8e-3_wp, 31.75e-3_wp]
   !> Young's moduli, Pa, of equal and unequal bodies
   real(wp), parameter :: upper = 194.0e9_wp, lower(2) = [194.0e9_wp, 70.0e9_wp], poisson = 0.2854_wp
   character(len=*), parameter :: materials(2) = ['equal  ', 'unequal']
   type(error_t), allocatable :: error
   integer :: k, m

   write (output_unit, '(a)') 'materials,points,node_pairs,threads,series_s,scale_split_s,quotient'
   do m = 1, 2
      do k = 1, size(cells, 2)
         call measure(cells(:, k), m, error)
         if (.not. allocated(error)) cycle
         write (error_unit, '(a)') error%message
         stop 2, quiet=.true.
      end do
   end do

contains

   !> One line.
   subroutine measure(n, which, error)
      !> Cells each way, and which of the materials
      integer, intent(in) :: n(2), which
      type(error_t), allocatable, intent(out) :: error
      type(be_grid_t) :: grid
      type(contact_interface_t) :: contact
      type(material_t) :: body(2)
      type(pad_t) :: pad
      type(fft_compliance_t) :: compliance(2)
      real(wp), allocatable :: flexibility(:, :), x(:, :), y(:, :)
      real(wp) :: seconds(repeats, 2), start
      integer :: j, c

      contact = rectangle()
      call elastic_material(body(1), upper, poisson, error)
      if (.not. allocated(error)) call elastic_material(body(2), lower(which), poisson, error)
      if (.not. allocated(error)) call new_grid(grid, [0.0_wp, 0.0_wp], size_of_pad, n(1), n(2), error)
      if (allocated(error)) return
      allocate (flexibility(3*product(nodes), 3*product(nodes)), x(3, product(n)), y(3, product(n)))
      call random_number(flexibility)
      flexibility = flexibility + transpose(flexibility)
      call random_number(x)
      do c = 1, 2
         call new_pad(contact, grid, spread(0.0_wp, 1, product(n)), half_space_pair(body(1), body(2)), 0.6_wp, 0.0_wp, pad, &
            & error, scale_split=c == 2)
         if (allocated(error)) return
         call new_fft_compliance([pad], flexibility, compliance(c))
         call compliance(c)%product(x, y)
      end do
      do j = 1, repeats
         do c = 1, 2
            start = omp_get_wtime()
            call compliance(c)%product(x, y)
            seconds(j, c) = omp_get_wtime() - start
         end do
      end do
      write (output_unit, '(2a,3(i0,a),2(es9.3,a),f5.2)') trim(materials(which)), ',', product(n), ',', product(nodes), ',', &
         & omp_get_max_threads(), ',', minval(seconds(:, 1)), ',', minval(seconds(:, 2)), ',', &
         & minval(seconds(:, 2))/minval(seconds(:, 1))
   end subroutine measure

   !> Node pairs and faces of the pad.
   pure function rectangle() result(contact)
      type(contact_interface_t) :: contact
      integer :: i, j, k

      contact%name = 'pad'
      contact%node_a = [(k, k=1, product(nodes))]
      contact%node_b = contact%node_a
      allocate (contact%position(2, product(nodes)))
      allocate (contact%faces(8, product(nodes - 1)), source=0)
      contact%position = reshape([((size_of_pad*[i, j]/(nodes - 1), i=0, nodes(1) - 1), j=0, nodes(2) - 1)], [2, product(nodes)])
      do j = 1, nodes(2) - 1
         do i = 1, nodes(1) - 1
            k = i + nodes(1)*(j - 1)
            contact%faces(:4, i + (nodes(1) - 1)*(j - 1)) = [k, k + 1, k + 1 + nodes(1), k + nodes(1)]
         end do
      end do
   end function rectangle

end program product_cost
