module test_analysis_epmc
   use microslip_analysis_continuation, only: curve_record_t
   use microslip_analysis_epmc, only: epmc_options_t, run_epmc
   use microslip_analysis_linear_modes, only: linear_modes_t, solve_linear_modes
   use microslip_analysis_operating_state, only: operating_state_t
   use microslip_core_error, only: error_t
   use microslip_core_kinds, only: wp, pi
   use microslip_core_text, only: to_text
   use microslip_system_jointed_system, only: jointed_system_t
   use support_checks, only: good
   use support_periodic, only: collector_t, condensed, make_jenkins, make_preloaded
   use testdrive, only: check, new_unittest, testing_error => error_type, unittest_type
   implicit none(type, external)
   private

   public :: collect_analysis_epmc

contains

   subroutine collect_analysis_epmc(testsuite)
      type(unittest_type), allocatable, intent(out) :: testsuite(:)

      testsuite = [ &
         & new_unittest('dry-friction oscillator: closed form', test_jenkins)]
   end subroutine collect_analysis_epmc

   !> One harmonic of the Jenkins element (see test_analysis_harmonic_balance):
   !>     omega^2 = spring + element (theta - sin(2 theta)/2)/pi,  2 zeta omega^2 A = damping omega A + loss
   subroutine test_jenkins(error)
      type(testing_error), allocatable, intent(out) :: error
      type(error_t), allocatable :: lib
      type(jointed_system_t) :: system
      type(operating_state_t) :: state
      type(epmc_options_t) :: options
      type(collector_t) :: collector
      type(curve_record_t) :: record
      real(wp), parameter :: spring = 1.0e4_wp, element = 6.0e3_wp, limit = 3.0_wp, damping = 0.5_wp
      real(wp) :: a, b, theta, omega, zeta, largest
      integer :: k
      !> The samples see the kinks to second order
      real(wp), parameter :: accuracy = (2.0_wp*pi/400)**2

      call make_jenkins(spring, damping, element, limit, system, state, lib)
      b = limit/element
      options%sensors = [1]
      options%shape = [1.0_wp]
      options%frequency = sqrt(spring + element)/(2.0_wp*pi)
      options%amplitude_range = [0.1_wp*b, 100.0_wp*b]
      options%harmonics = 1
      options%samples = 400
      if (.not. allocated(lib)) call run_epmc(system, state, options, condensed(), collector, record, lib)
      call good(error, lib)
      if (allocated(error)) return
      largest = 0.0_wp
      do k = 1, size(collector%points)
         a = collector%points(k)%modal_amplitude
         omega = sqrt(spring + element)
         zeta = 0.5_wp*damping/omega
         if (a > b) then
            theta = acos(1.0_wp - 2.0_wp*b/a)
            omega = sqrt(spring + element/pi*(theta - 0.5_wp*sin(2.0_wp*theta)))
            zeta = 0.5_wp*damping/omega + 2.0_wp*limit*(a - b)/(pi*a*a*omega**2)
         end if
         largest = max(largest, abs(2.0_wp*pi*collector%points(k)%frequency/omega - 1.0_wp), &
            & abs(collector%points(k)%damping_ratio/zeta - 1.0_wp))
      end do
      call check(error, largest <= 10.0_wp*accuracy, 'deviation '//to_text(largest, 3))
   end subroutine test_jenkins

end module test_analysis_epmc
