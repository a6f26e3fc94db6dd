!> Height h of the composite surface of an interface (both bodies' deviations from flat, added), as in the
!> gap law g = -h + C lambda + W^T d_b: h > 0 is material that sticks out.
!>
!> The reference configuration barely touches (METHOD section 8 and paper, section 2): by default the heights are
!> shifted so that the highest contact point is at zero, and -h >= 0 is the initial gap. SI units.
!>
!> This module holds the surfaces given by a formula; measured ones are in `microslip_surface_height_map`.
module microslip_surface_topography
   use, intrinsic :: ieee_arithmetic, only: ieee_is_finite
   use microslip_core_error, only: error_t, bad_input
   use microslip_core_kinds, only: wp, pi
   use microslip_core_text, only: to_text, lower_case
   use microslip_surface_plane, only: plane_t, fit_plane
   implicit none(type, external)
   private

   public :: topography_t, flat_t, hill_t, waviness_t, new_hill, new_waviness
   public :: level_none, level_mean, level_plane

   !> What is subtracted from the heights: nothing, their mean, their least-squares plane.
   integer, parameter :: level_none = 0, level_mean = 1, level_plane = 2

   !> A surface that can be evaluated at contact points.
   type, abstract :: topography_t
      private
      integer :: levelling = level_none
      logical :: touching = .true.
   contains
      procedure :: heights
      procedure :: set_levelling
      procedure(evaluate_surface), deferred :: evaluate
   end type topography_t

   abstract interface
      !> Heights as the surface gives them, before levelling.
      subroutine evaluate_surface(self, position, height, estimated, error)
         import :: topography_t, error_t, wp
         implicit none(type, external)
         class(topography_t), intent(in) :: self
         !> (2, points) along t1, t2, m
         real(wp), intent(in) :: position(:, :)
         !> (points) m
         real(wp), intent(out) :: height(:)
         !> (points) whether the height is not known but estimated from neighbours
         logical, intent(out) :: estimated(:)
         !> Set when the surface does not give the heights
         type(error_t), allocatable, intent(out) :: error
      end subroutine evaluate_surface
   end interface

   !> The ideal plane, h = 0.
   type, extends(topography_t) :: flat_t
   contains
      procedure :: evaluate => evaluate_flat
   end type flat_t

   !> A synthetic, smooth hill (not a measured surface): a raised cosine of the distance r from the summit,
   !>
   !>     h = H cos^2(pi r/(2 r_max)),
   !>
   !> r_max being the distance of the farthest corner of the rectangle. It is flat at the summit and flattens
   !> towards the corners. H makes the difference of highest and lowest contact point equal to `peak_to_peak`,
   !> so all contact points of the interface must be evaluated together.
   type, extends(topography_t) :: hill_t
      private
      real(wp) :: lower(2) = 0.0_wp, upper(2) = 0.0_wp, summit(2) = 0.0_wp, peak_to_peak = 0.0_wp
      !> Factor on the heights
      real(wp) :: scale = 1.0_wp
   contains
      procedure :: evaluate => evaluate_hill
   end type hill_t

   !> A sinusoidal wave, h = amplitude cos(2 pi (x cos(angle) + y sin(angle))/wavelength).
   type, extends(topography_t) :: waviness_t
      private
      real(wp) :: amplitude = 0.0_wp, wavelength = 1.0_wp, angle = 0.0_wp
   contains
      procedure :: evaluate => evaluate_waviness
   end type waviness_t

contains

   !> Choose what is subtracted from the heights, and whether the highest point is then put at zero.
   subroutine set_levelling(self, method, error, touching)
      class(topography_t), intent(inout) :: self
      !> 'none', 'mean' or 'plane'
      character(len=*), intent(in) :: method
      !> Set for an unknown method
      type(error_t), allocatable, intent(out) :: error
      !> True (default): the highest point is put at zero, so that the surfaces barely touch
      logical, intent(in), optional :: touching

      select case (lower_case(trim(method)))
      case ('none')
         self%levelling = level_none
      case ('mean')
         self%levelling = level_mean
      case ('plane')
         self%levelling = level_plane
      case default
         call bad_input(error, 'unknown levelling '''//trim(method)//''', known are ''none'', ''mean'' and ''plane''')
      end select
      if (present(touching)) self%touching = touching
   end subroutine set_levelling

   !> Heights of the contact points as they enter the gap law: evaluated, levelled, and put into touch.
   subroutine heights(self, position, height, error, estimated)
      class(topography_t), intent(in) :: self
      !> (2, points) all contact points of the interface, along t1, t2, m
      real(wp), intent(in) :: position(:, :)
      !> (points) m
      real(wp), allocatable, intent(out) :: height(:)
      !> Set when the surface does not give the heights
      type(error_t), allocatable, intent(out) :: error
      !> (points) whether the height is not known but estimated from neighbours
      logical, allocatable, intent(out), optional :: estimated(:)
      type(plane_t) :: plane
      logical, allocatable :: guessed(:)
      integer :: k

      allocate (height(size(position, 2)), guessed(size(position, 2)))
      call self%evaluate(position, height, guessed, error)
      if (present(estimated)) estimated = guessed
      if (allocated(error) .or. size(height) == 0) return
      select case (self%levelling)
      case (level_mean)
         height = height - sum(height)/size(height)
      case (level_plane)
         plane = fit_plane(position, height)
         do k = 1, size(height)
            height(k) = height(k) - plane%at(position(1, k), position(2, k))
         end do
      end select
      if (self%touching) height = height - maxval(height)
   end subroutine heights

   !> h = 0.
   subroutine evaluate_flat(self, position, height, estimated, error)
      class(flat_t), intent(in) :: self
      !> (2, points) m
      real(wp), intent(in) :: position(:, :)
      !> (points) m
      real(wp), intent(out) :: height(:)
      !> (points) false
      logical, intent(out) :: estimated(:)
      !> Never set
      type(error_t), allocatable, intent(out) :: error

      height = 0.0_wp
      estimated = .false.
   end subroutine evaluate_flat

   !> A hill on a rectangle.
   subroutine new_hill(hill, lower, upper, summit, peak_to_peak, error, scale)
      !> The surface
      type(hill_t), intent(out) :: hill
      !> Corners of the rectangle along t1, t2, m
      real(wp), intent(in) :: lower(2), upper(2)
      !> Position of the summit (centre of the bore), inside the rectangle, m
      real(wp), intent(in) :: summit(2)
      !> Height of the highest contact point above the lowest, m
      real(wp), intent(in) :: peak_to_peak
      !> Set when the values make no hill
      type(error_t), allocatable, intent(out) :: error
      !> Factor on the heights, 1 by default; negative: a hollow
      real(wp), intent(in), optional :: scale

      if (present(scale)) hill%scale = scale
      if (.not. (all(lower < summit) .and. all(summit < upper))) then
         call bad_input(error, 'the summit of the hill ('//to_text(summit(1))//', '//to_text(summit(2))// &
            & ') must lie inside its rectangle')
      else if (.not. (ieee_is_finite(peak_to_peak) .and. peak_to_peak >= 0.0_wp)) then
         call bad_input(error, 'the peak-to-peak height of the hill must not be negative, got '//to_text(peak_to_peak))
      else
         hill%lower = lower
         hill%upper = upper
         hill%summit = summit
         hill%peak_to_peak = peak_to_peak
      end if
   end subroutine new_hill

   !> Raised cosine of the distance from the summit.
   subroutine evaluate_hill(self, position, height, estimated, error)
      class(hill_t), intent(in) :: self
      !> (2, points) m
      real(wp), intent(in) :: position(:, :)
      !> (points) m
      real(wp), intent(out) :: height(:)
      !> (points) false
      logical, intent(out) :: estimated(:)
      !> Never set
      type(error_t), allocatable, intent(out) :: error
      real(wp) :: farthest, span
      integer :: k

      estimated = .false.
      farthest = norm2(max(self%upper - self%summit, self%summit - self%lower))
      do k = 1, size(height)
         height(k) = cos(0.5_wp*pi*min(1.0_wp, norm2(position(:, k) - self%summit)/farthest))**2
      end do
      if (size(height) == 0) return
      span = maxval(height) - minval(height)
      if (span > 0.0_wp) height = height*(self%scale*self%peak_to_peak/span)
   end subroutine evaluate_hill

   !> A wave.
   subroutine new_waviness(waviness, amplitude, wavelength, angle, error)
      !> The surface
      type(waviness_t), intent(out) :: waviness
      !> Half the peak-to-valley height, m
      real(wp), intent(in) :: amplitude
      !> m
      real(wp), intent(in) :: wavelength
      !> Direction of the wave vector from t1, rad
      real(wp), intent(in) :: angle
      !> Set when the values make no wave
      type(error_t), allocatable, intent(out) :: error

      if (.not. (ieee_is_finite(amplitude) .and. ieee_is_finite(angle))) then
         call bad_input(error, 'amplitude and angle of the waviness must be finite')
      else if (.not. (ieee_is_finite(wavelength) .and. wavelength > 0.0_wp)) then
         call bad_input(error, 'the wavelength of the waviness must be positive, got '//to_text(wavelength))
      else
         waviness%amplitude = amplitude
         waviness%wavelength = wavelength
         waviness%angle = angle
      end if
   end subroutine new_waviness

   !> One cosine.
   subroutine evaluate_waviness(self, position, height, estimated, error)
      class(waviness_t), intent(in) :: self
      !> (2, points) m
      real(wp), intent(in) :: position(:, :)
      !> (points) m
      real(wp), intent(out) :: height(:)
      !> (points) false
      logical, intent(out) :: estimated(:)
      !> Never set
      type(error_t), allocatable, intent(out) :: error

      estimated = .false.
      height = self%amplitude*cos(2.0_wp*pi/self%wavelength* &
         & (position(1, :)*cos(self%angle) + position(2, :)*sin(self%angle)))
   end subroutine evaluate_waviness

end module microslip_surface_topography
