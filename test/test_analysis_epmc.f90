module test_analysis_epmc
   use microslip_analysis_continuation, only: curve_record_t
   use microslip_analysis_epmc, only: epmc_options_t, run_epmc
   use microslip_analysis_linear_modes, only: linear_modes_t, solve_linear_modes
   use microslip_analysis_operating_state, only: operating_state_t
   use microslip_analysis_harmonic_balance, only: harmonic_balance_options_t, run_harmonic_balance
   use microslip_core_error, only: error_t, status_failed
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
         & new_unittest('dry-friction oscillator: closed form', test_jenkins), &
         & new_unittest('sliding body: cold start at gross slip', test_cold_start), &
         & new_unittest('small amplitudes: the linear mode', test_linear), &
         & new_unittest('energy lost is what the damping ratio says', test_energy), &
         & new_unittest('a forced response at resonance lies on the mode', test_resonance), &
         & new_unittest('a sensor that does not see the mode', test_blind)]
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

   !> The same oscillator, of which the element is a hundred times stiffer, from amplitudes at which it slides: the linear mode
   !> is far off. Falling amplitudes too.
   subroutine test_cold_start(error)
      type(testing_error), allocatable, intent(out) :: error
      type(error_t), allocatable :: lib
      type(jointed_system_t) :: system
      type(operating_state_t) :: state
      type(epmc_options_t) :: options
      type(collector_t) :: collector
      type(curve_record_t) :: record
      real(wp), parameter :: spring = 1.0e4_wp, damping = 0.5_wp, element = 1.0e6_wp, limit = 3.0_wp
      real(wp) :: a, b, theta, omega, zeta, largest
      integer :: k
      !> Samples see the kinks to second order, and w^3 with those that are added
      real(wp), parameter :: accuracy = 10.0_wp*(2.0_wp*pi/400)**2

      call make_jenkins(spring, damping, element, limit, system, state, lib)
      b = limit/element
      options%sensors = [1]
      options%shape = [1.0_wp]
      options%frequency = sqrt(spring + element)/(2.0_wp*pi)
      options%amplitude_range = [300.0_wp*b, 100.0_wp*b]
      options%points = 5
      options%harmonics = 1
      options%samples = 400
      if (.not. allocated(lib)) call run_epmc(system, state, options, condensed(), collector, record, lib)
      call good(error, lib)
      if (allocated(error)) return
      largest = 0.0_wp
      do k = 1, size(collector%points)
         a = collector%points(k)%modal_amplitude
         theta = acos(1.0_wp - 2.0_wp*b/a)
         omega = sqrt(spring + element/pi*(theta - 0.5_wp*sin(2.0_wp*theta)))
         zeta = 0.5_wp*damping/omega + 2.0_wp*limit*(a - b)/(pi*a*a*omega**2)
         largest = max(largest, abs(2.0_wp*pi*collector%points(k)%frequency/omega - 1.0_wp), &
            & abs(collector%points(k)%damping_ratio/zeta - 1.0_wp))
      end do
      call check(error, size(collector%points) >= 5 .and. largest <= accuracy, 'deviation '//to_text(largest, 3))
   end subroutine test_cold_start

   !> Options for a mode of the joint.
   subroutine prepare(hill, mode, system, state, options, lib)
      real(wp), intent(in) :: hill
      integer, intent(in) :: mode
      type(jointed_system_t), intent(out) :: system
      type(operating_state_t), intent(out) :: state
      type(epmc_options_t), intent(out) :: options
      type(error_t), allocatable, intent(out) :: lib
      type(linear_modes_t) :: modes

      call make_preloaded([5, 3], hill, 0.4_wp, system, state, lib)
      if (.not. allocated(lib)) call solve_linear_modes(system, state%contact%status, mode, modes, lib)
      if (allocated(lib)) return
      options%sensors = [1]
      options%shape = modes%shape(:, mode)
      options%frequency = modes%frequency(mode)
   end subroutine prepare

   subroutine test_linear(error)
      type(testing_error), allocatable, intent(out) :: error
      type(error_t), allocatable :: lib
      type(jointed_system_t) :: system
      type(operating_state_t) :: state
      type(epmc_options_t) :: options
      type(collector_t) :: collector
      type(curve_record_t) :: record
      real(wp) :: zeta
      real(wp), parameter :: amplitude = 1.0e-11_wp
      integer :: k

      call prepare(4.0e-6_wp, 2, system, state, options, lib)
      options%amplitude_range = [amplitude, 3.0_wp*amplitude]
      options%points = 3
      if (.not. allocated(lib)) call run_epmc(system, state, options, condensed(), collector, record, lib)
      call good(error, lib)
      if (allocated(error)) return
      call check(error, size(collector%points) == 3 .and. abs(collector%points(1)%amplitude/amplitude - 1.0_wp) < 1.0e-6_wp &
         & .and. abs(collector%points(3)%amplitude/amplitude - 3.0_wp) < 1.0e-5_wp, 'amplitudes')
      if (allocated(error)) return
      ! The damping of this joint is not mass-proportional: the complex mode differs from the real one by zeta^2.
      zeta = 0.5_wp*dot_product(options%shape, system%damping*options%shape)/(2.0_wp*pi*options%frequency)
      do k = 1, 3
         associate (point => collector%points(k))
            call check(error, abs(point%frequency/options%frequency - 1.0_wp) < 10.0_wp*zeta**2 &
               & .and. abs(point%damping_ratio/zeta - 1.0_wp) < 10.0_wp*zeta, &
               & to_text(point%frequency/options%frequency - 1.0_wp, 3)//' '//to_text(point%damping_ratio/zeta - 1.0_wp, 3))
         end associate
         if (allocated(error)) return
      end do
   end subroutine test_linear

   !> In a period the artificial damping gives 2 zeta omega pi omega sum h^2 |x_h|^2, and friction and D take it. Samples
   !> see the friction loss to first order.
   subroutine test_energy(error)
      type(testing_error), allocatable, intent(out) :: error
      type(error_t), allocatable :: lib
      type(jointed_system_t) :: system
      type(operating_state_t) :: state
      type(epmc_options_t) :: options
      type(collector_t) :: collector
      type(curve_record_t) :: record
      real(wp) :: given, taken, omega, square(6)
      integer :: h, k
      real(wp), parameter :: accuracy = 2.0e-2_wp

      call prepare(4.0e-6_wp, 1, system, state, options, lib)
      options%amplitude_range = [1.0e-6_wp, 3.0e-4_wp]
      options%points = 8
      options%samples = 200
      if (.not. allocated(lib)) call run_epmc(system, state, options, condensed(), collector, record, lib)
      call good(error, lib)
      if (allocated(error)) return
      do k = 1, size(collector%points)
         associate (point => collector%points(k))
            omega = 2.0_wp*pi*point%frequency
            square = 0.0_wp
            do h = 1, options%harmonics
               square = square + h**2*(point%modal(:, 2*h)**2 + point%modal(:, 2*h + 1)**2)
            end do
            given = 2.0_wp*point%damping_ratio*pi*omega**2*sum(square)
            taken = point%friction_loss + pi*omega*sum(system%damping*square)
            call check(error, abs(taken/given - 1.0_wp) < accuracy, 'point '//to_text(k)//': '//to_text(taken/given - 1.0_wp, 3))
         end associate
         if (allocated(error)) return
      end do
      call check(error, collector%points(size(collector%points))%damping_ratio > 2.0_wp*collector%points(1)%damping_ratio, &
         & 'hardly any friction')
   end subroutine test_energy

   !> One mode, one harmonic: forced at its frequency by twice its damping force the oscillator moves as the mode does, a
   !> quarter of a period late.
   subroutine test_resonance(error)
      type(testing_error), allocatable, intent(out) :: error
      type(error_t), allocatable :: lib
      type(jointed_system_t) :: system
      type(operating_state_t) :: state
      type(epmc_options_t) :: options
      type(harmonic_balance_options_t) :: forced
      type(collector_t) :: mode, response
      type(curve_record_t) :: record
      type(curve_record_t), allocatable :: records(:)
      real(wp) :: omega
      !> The samples of both motions are shifted by a quarter of a period: they see the same kinks
      real(wp), parameter :: same = 1.0e-5_wp

      call make_jenkins(1.0e4_wp, 0.5_wp, 6.0e3_wp, 3.0_wp, system, state, lib)
      options%sensors = [1]
      options%shape = [1.0_wp]
      options%frequency = sqrt(1.6e4_wp)/(2.0_wp*pi)
      options%amplitude_range = [1.0e-4_wp, 1.5e-3_wp]
      options%points = 5
      options%harmonics = 1
      options%samples = 400
      if (.not. allocated(lib)) call run_epmc(system, state, options, condensed(), mode, record, lib)
      call good(error, lib)
      if (allocated(error)) return
      associate (point => mode%points(size(mode%points)))
         omega = 2.0_wp*pi*point%frequency
         forced = harmonic_balance_options_t(load=1, sensors=[1], levels=[2.0_wp*point%damping_ratio*omega**2* &
            & point%modal_amplitude], frequency_range=[point%frequency, point%frequency], harmonics=1, samples=400, &
            & frequency_step=1.0_wp, max_iterations=40)
         call run_harmonic_balance(system, state, forced, condensed(), response, records, lib)
         call good(error, lib)
         if (allocated(error)) return
         call check(error, abs(response%points(1)%amplitude/point%amplitude - 1.0_wp) < same .and. &
            & abs(response%points(1)%phase + 0.5_wp*pi) < same, to_text(response%points(1)%amplitude/point%amplitude, 8)//' ' &
            & //to_text(response%points(1)%phase, 8))
      end associate
   end subroutine test_resonance

   subroutine test_blind(error)
      type(testing_error), allocatable, intent(out) :: error
      type(error_t), allocatable :: lib
      type(jointed_system_t) :: system
      type(operating_state_t) :: state
      type(epmc_options_t) :: options
      type(collector_t) :: collector
      type(curve_record_t) :: record

      call make_jenkins(1.0e4_wp, 0.5_wp, 6.0e3_wp, 3.0_wp, system, state, lib)
      system%sensor_modal = 0.0_wp
      options%sensors = [1]
      options%shape = [1.0_wp]
      options%frequency = 20.0_wp
      options%amplitude_range = [1.0e-4_wp, 1.0e-3_wp]
      if (.not. allocated(lib)) call run_epmc(system, state, options, condensed(), collector, record, lib)
      call check(error, allocated(lib))
      if (.not. allocated(error)) call check(error, lib%status == status_failed .and. index(lib%message, 'sensor') > 0, lib%message)
   end subroutine test_blind

end module test_analysis_epmc
