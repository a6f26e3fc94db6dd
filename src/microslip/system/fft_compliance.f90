!> The contact compliance of all pads as an operator, G = C + W^T F W (METHOD section 4, (19)), or C_s in place of C.
!>
!> C by FFT, pad by pad, and the structure in factored form: nodal forces W lambda, a product with the dense flexibility F
!> of the boundary, and back to the points. With F = K_bb^-1 it is the G of dynamics, with F = K_s^-1 that of statics.
module microslip_system_fft_compliance
   use microslip_contact_compliance_operator, only: contact_compliance_t
   use microslip_core_kinds, only: wp
   use microslip_halfspace_convolution, only: convolution_t, approximate_inverse
   use microslip_halfspace_coupling, only: coupling_t
   use microslip_halfspace_scale_filter, only: scale_filter_t
   use microslip_halfspace_split_compliance, only: local_product
   use microslip_linalg_dense, only: product_symmetric
   use microslip_system_pad, only: pad_t
   implicit none(type, external)
   private

   public :: fft_compliance_t, new_fft_compliance

   !> What a product needs of one pad.
   type :: pad_operator_t
      type(convolution_t) :: half_space, inverse
      type(coupling_t) :: coupling
      !> Not allocated: coupling in series
      type(scale_filter_t), allocatable :: filter
      !> Points in potential contact: their indices in the grid
      integer, allocatable :: potential(:)
      !> Points of the whole grid, contact points of the pads before, boundary coordinates and those of the pads before
      integer :: grid_points = 0, point_offset = 0, boundary_count = 0, boundary_offset = 0
   end type pad_operator_t

   type, extends(contact_compliance_t) :: fft_compliance_t
      private
      type(pad_operator_t), allocatable :: pads(:)
      !> F, (boundary, boundary), m/N
      real(wp), allocatable :: flexibility(:, :)
   contains
      procedure :: product => product_with
      procedure :: precondition
      procedure :: local_stiffness
      procedure :: with_flexibility
   end type fft_compliance_t

contains

   !> The operator on the points in potential contact of the pads.
   subroutine new_fft_compliance(pads, flexibility, compliance)
      type(pad_t), intent(in) :: pads(:)
      !> F, (boundary, boundary), m/N
      real(wp), intent(in) :: flexibility(:, :)
      type(fft_compliance_t), intent(out) :: compliance
      integer :: k

      compliance%flexibility = flexibility
      allocate (compliance%pads(size(pads)))
      do k = 1, size(pads)
         associate (pad => compliance%pads(k))
            pad%half_space = pads(k)%convolution
            pad%inverse = approximate_inverse(pads(k)%convolution)
            pad%coupling = pads(k)%coupling
            if (allocated(pads(k)%filter)) pad%filter = pads(k)%filter
            pad%potential = pads(k)%potential
            pad%grid_points = pads(k)%grid%point_count()
            pad%point_offset = pads(k)%point_offset
            pad%boundary_count = pads(k)%boundary_count()
            pad%boundary_offset = pads(k)%boundary_offset
         end associate
      end do
   end subroutine new_fft_compliance

   !> The same operator with another structure: F_s = K_s^-1 makes it that of statics.
   function with_flexibility(self, flexibility) result(compliance)
      class(fft_compliance_t), intent(in) :: self
      !> (boundary, boundary) symmetric, m/N
      real(wp), intent(in) :: flexibility(:, :)
      type(fft_compliance_t) :: compliance

      compliance%pads = self%pads
      compliance%flexibility = flexibility
   end function with_flexibility

   !> y = G x.
   subroutine product_with(self, x, y)
      class(fft_compliance_t), intent(in) :: self
      !> (3, points) N
      real(wp), intent(in), contiguous :: x(:, :)
      !> (3, points) m
      real(wp), intent(out), contiguous :: y(:, :)
      real(wp) :: nodal_force(size(self%flexibility, 1)), moved(size(self%flexibility, 1))
      integer :: k

      !$omp parallel do default(none) shared(self, x, y, nodal_force) schedule(static)
      do k = 1, size(self%pads)
         call half_space_part(self%pads(k), x, y, nodal_force)
      end do
      call product_symmetric(self%flexibility, nodal_force, moved)
      !$omp parallel do default(none) shared(self, y, moved) schedule(static)
      do k = 1, size(self%pads)
         call add_structure_part(self%pads(k), moved, y)
      end do
   end subroutine product_with

   !> C x or C_s x on the points of a pad, and its nodal forces W x.
   subroutine half_space_part(pad, x, y, nodal_force)
      type(pad_operator_t), intent(in) :: pad
      real(wp), intent(in), contiguous :: x(:, :)
      real(wp), intent(inout), contiguous :: y(:, :), nodal_force(:)
      real(wp), allocatable :: force(:, :), gap(:, :), nodal(:, :)

      allocate (force(3, pad%grid_points), source=0.0_wp)
      allocate (gap(3, pad%grid_points), nodal(3, pad%boundary_count/3))
      force(:, pad%potential) = x(:, pad%point_offset + 1:pad%point_offset + size(pad%potential))
      call pad%coupling%distribute(force, nodal)
      nodal_force(pad%boundary_offset + 1:pad%boundary_offset + pad%boundary_count) = reshape(nodal, [pad%boundary_count])
      call local_product(pad%half_space, force, gap, pad%filter)
      y(:, pad%point_offset + 1:pad%point_offset + size(pad%potential)) = gap(:, pad%potential)
   end subroutine half_space_part

   !> y = y + W^T d_b on the points of a pad.
   subroutine add_structure_part(pad, boundary, y)
      type(pad_operator_t), intent(in) :: pad
      real(wp), intent(in), contiguous :: boundary(:)
      real(wp), intent(inout), contiguous :: y(:, :)
      real(wp), allocatable :: gap(:, :)

      allocate (gap(3, pad%grid_points))
      call pad%coupling%interpolate(reshape(boundary(pad%boundary_offset + 1:pad%boundary_offset + pad%boundary_count), &
         & [3, pad%boundary_count/3]), gap)
      associate (own => y(:, pad%point_offset + 1:pad%point_offset + size(pad%potential)))
         own = own + gap(:, pad%potential)
      end associate
   end subroutine add_structure_part

   !> y = B x with the inverse Fourier symbol of C.
   subroutine precondition(self, x, y)
      class(fft_compliance_t), intent(in) :: self
      !> (3, points) m
      real(wp), intent(in), contiguous :: x(:, :)
      !> (3, points) N
      real(wp), intent(out), contiguous :: y(:, :)
      integer :: k

      !$omp parallel do default(none) shared(self, x, y) schedule(static)
      do k = 1, size(self%pads)
         call precondition_pad(self%pads(k), x, y)
      end do
   end subroutine precondition

   !> y = B x on the points of a pad.
   subroutine precondition_pad(pad, x, y)
      type(pad_operator_t), intent(in) :: pad
      real(wp), intent(in), contiguous :: x(:, :)
      real(wp), intent(inout), contiguous :: y(:, :)
      real(wp), allocatable :: gap(:, :), force(:, :)

      allocate (gap(3, pad%grid_points), source=0.0_wp)
      allocate (force(3, pad%grid_points))
      gap(:, pad%potential) = x(:, pad%point_offset + 1:pad%point_offset + size(pad%potential))
      call pad%inverse%apply(gap, force)
      y(:, pad%point_offset + 1:pad%point_offset + size(pad%potential)) = force(:, pad%potential)
   end subroutine precondition_pad

   !> Diagonal of B, (3, points), N/m.
   function local_stiffness(self) result(stiffness)
      class(fft_compliance_t), intent(in) :: self
      real(wp), allocatable :: stiffness(:, :)
      integer :: k, n

      n = sum([(size(self%pads(k)%potential), k=1, size(self%pads))])
      allocate (stiffness(3, n))
      do k = 1, size(self%pads)
         associate (pad => self%pads(k))
            stiffness(:, pad%point_offset + 1:pad%point_offset + size(pad%potential)) = &
               & spread(pad%inverse%diagonal(), 2, size(pad%potential))
         end associate
      end do
   end function local_stiffness

end module microslip_system_fft_compliance
