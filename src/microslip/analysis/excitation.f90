!> Time functions of the loads.
module microslip_analysis_excitation
   use microslip_core_kinds, only: wp, pi
   implicit none(type, external)
   private

   public :: excitation_t, load_amplitudes, kind_half_sine, kind_harmonic

   integer, parameter :: kind_half_sine = 1, kind_harmonic = 2

   !> A load pattern times a function of time.
   type :: excitation_t
      !> Index of the load in the system
      integer :: load = 0
      integer :: kind = kind_half_sine
      !> Factor on the load pattern
      real(wp) :: amplitude = 0.0_wp
      !> Nothing before this time, s
      real(wp) :: start = 0.0_wp
      !> half_sine: length of the pulse, s (paper eq. (21))
      real(wp) :: duration = 0.0_wp
      !> harmonic: Hz, and phase of the cosine in rad
      real(wp) :: frequency = 0.0_wp, phase = 0.0_wp
   contains
      procedure :: at
   end type excitation_t

contains

   !> The factor on the load pattern at a time.
   pure real(wp) function at(self, time)
      class(excitation_t), intent(in) :: self
      !> s
      real(wp), intent(in) :: time
      real(wp) :: t

      t = time - self%start
      at = 0.0_wp
      if (t < 0.0_wp) return
      select case (self%kind)
      case (kind_half_sine)
         if (t <= self%duration) at = self%amplitude*sin(pi*t/self%duration)
      case (kind_harmonic)
         at = self%amplitude*cos(2.0_wp*pi*self%frequency*t + self%phase)
      end select
   end function at

   !> Amplitudes of all loads: what stays on, plus the excitations at this time, (loads).
   pure function load_amplitudes(constant, excitations, time) result(amplitude)
      !> (loads) amplitudes that stay on
      real(wp), intent(in) :: constant(:)
      type(excitation_t), intent(in) :: excitations(:)
      !> s
      real(wp), intent(in) :: time
      real(wp) :: amplitude(size(constant))
      integer :: k

      amplitude = constant
      do k = 1, size(excitations)
         amplitude(excitations(k)%load) = amplitude(excitations(k)%load) + excitations(k)%at(time)
      end do
   end function load_amplitudes

end module microslip_analysis_excitation
