!> Tests of the loads' functions of time.
module test_analysis_excitation
   use microslip_analysis_excitation, only: excitation_t, end_of_all, kind_half_sine, kind_harmonic, kind_stepped_sine, &
      & kind_swept_sine, kind_table, load_amplitudes
   use microslip_core_kinds, only: wp, pi
   use testdrive, only: check, new_unittest, testing_error => error_type, unittest_type
   implicit none(type, external)
   private

   public :: collect_analysis_excitation

   real(wp), parameter :: rounding = 1.0e-9_wp

contains

   subroutine collect_analysis_excitation(testsuite)
      type(unittest_type), allocatable, intent(out) :: testsuite(:)

      testsuite = [ &
         & new_unittest('half-sines, once and at several times', test_half_sine), &
         & new_unittest('ramp and phase of a sine', test_harmonic), &
         & new_unittest('stepped sine: whole periods, continuous phase', test_stepped), &
         & new_unittest('swept sine: its angle is the integral of its frequency', test_swept), &
         & new_unittest('table: straight lines, zero outside', test_table), &
         & new_unittest('loads add up', test_amplitudes)]
   end subroutine collect_analysis_excitation

   subroutine test_half_sine(error)
      type(testing_error), allocatable, intent(out) :: error
      type(excitation_t) :: one, many

      one = excitation_t(kind=kind_half_sine, amplitude=3.0_wp, start=1.0_wp, duration=0.1_wp)
      many = one
      many%times = [0.0_wp, 0.5_wp, 0.55_wp]
      call check(error, all(abs([one%at(0.99_wp), one%at(1.05_wp), one%at(1.11_wp), one%end()] - &
         & [0.0_wp, 3.0_wp, 0.0_wp, 1.1_wp]) < rounding), 'one')
      if (allocated(error)) return
      ! The second and the third overlap.
      call check(error, all(abs([many%at(1.05_wp), many%at(1.3_wp), many%at(1.575_wp), many%end()] - &
         & [3.0_wp, 0.0_wp, 3.0_wp*(sin(0.75_wp*pi) + sin(0.25_wp*pi)), 1.65_wp]) < rounding), 'many')
   end subroutine test_half_sine

   subroutine test_harmonic(error)
      type(testing_error), allocatable, intent(out) :: error
      type(excitation_t) :: sine

      sine = excitation_t(kind=kind_harmonic, amplitude=2.0_wp, start=1.0_wp, frequency=10.0_wp, phase=-0.5_wp*pi, &
         & ramp=0.3_wp)
      call check(error, all(abs([sine%at(0.9_wp), sine%at(1.125_wp), sine%at(1.425_wp)] - &
         & [0.0_wp, 2.0_wp*sin(0.125_wp*pi/0.6_wp)**2, 2.0_wp]) < rounding) .and. sine%end() > 1.0e30_wp)
   end subroutine test_harmonic

   subroutine test_stepped(error)
      type(testing_error), allocatable, intent(out) :: error
      type(excitation_t) :: sine
      real(wp) :: t
      integer :: k
      integer, parameter :: fine = 10000

      sine = excitation_t(kind=kind_stepped_sine, amplitude=1.0_wp, start=0.2_wp, frequencies=[5.0_wp, 8.0_wp, 4.0_wp], &
         & periods=[10, 16, 3])
      call check(error, all(abs([sine%cycles(2.2_wp), sine%cycles(4.2_wp), sine%cycles(9.0_wp), sine%frequency_at(2.1_wp), &
         & sine%frequency_at(2.3_wp), sine%end()] - [10.0_wp, 26.0_wp, 29.0_wp, 5.0_wp, 8.0_wp, 4.95_wp]) < rounding) &
         & .and. sine%at(5.0_wp) == 0.0_wp)
      do k = 1, fine
         if (allocated(error)) return
         t = 0.2_wp + 4.75_wp*(k - 1)/fine
         call check(error, abs(sine%at(t + 4.75_wp/fine) - sine%at(t)) < 2.0_wp*pi*8.0_wp*4.75_wp/fine + rounding .or. &
            & k == fine, 'jump')
      end do
   end subroutine test_stepped

   subroutine test_swept(error)
      type(testing_error), allocatable, intent(out) :: error
      type(excitation_t) :: sweep
      real(wp) :: cycles, h
      integer :: k, round
      integer, parameter :: fine = 20000
      !> Of the midpoint rule with so many steps.
      real(wp), parameter :: quadrature = 1.0e-6_wp

      do round = 1, 4
         sweep = excitation_t(kind=kind_swept_sine, amplitude=1.0_wp, start=0.1_wp, frequency=20.0_wp, &
            & frequency_to=merge(80.0_wp, 5.0_wp, mod(round, 2) == 0), rate=2.0_wp, logarithmic=round > 2)
         h = (sweep%end() - sweep%start)/fine
         cycles = 0.0_wp
         do k = 1, fine
            cycles = cycles + h*sweep%frequency_at(sweep%start + (k - 0.5_wp)*h)
         end do
         call check(error, abs(cycles/sweep%cycles(sweep%end() + 1.0_wp) - 1.0_wp) < quadrature, 'integral')
         if (.not. allocated(error)) call check(error, abs(sweep%frequency_at(sweep%end())/sweep%frequency_to - 1.0_wp) &
            & < rounding, 'last frequency')
         if (.not. allocated(error)) call check(error, abs(sweep%end() - 0.1_wp - merge(1.0_wp, &
            & merge(30.0_wp, 7.5_wp, mod(round, 2) == 0), round > 2)) < rounding, 'length')
         if (allocated(error)) return
      end do
   end subroutine test_swept

   subroutine test_table(error)
      type(testing_error), allocatable, intent(out) :: error
      type(excitation_t) :: blow

      blow = excitation_t(kind=kind_table, amplitude=2.0_wp, start=1.0_wp, &
         & table=reshape([0.0_wp, 1.0_wp, 0.1_wp, 3.0_wp, 0.4_wp, 0.0_wp], [2, 3]))
      call check(error, all(abs([blow%at(0.99_wp), blow%at(1.05_wp), blow%at(1.1_wp), blow%at(1.25_wp), blow%at(1.5_wp), &
         & blow%end()] - [0.0_wp, 4.0_wp, 6.0_wp, 3.0_wp, 0.0_wp, 1.4_wp]) < rounding))
      if (allocated(error)) return
      ! What ends at 3 stays there if it is to.
      blow%table(2, 3) = 3.0_wp
      call check(error, abs(blow%at(1.5_wp)) <= 0.0_wp)
      if (allocated(error)) return
      blow%stays = .true.
      call check(error, abs(blow%at(1.5_wp) - 6.0_wp) < rounding .and. abs(blow%at(0.9_wp)) <= 0.0_wp)
   end subroutine test_table

   subroutine test_amplitudes(error)
      type(testing_error), allocatable, intent(out) :: error
      type(excitation_t) :: both(2)

      both(1) = excitation_t(load=2, kind=kind_half_sine, amplitude=3.0_wp, duration=0.1_wp)
      both(2) = excitation_t(load=2, kind=kind_harmonic, amplitude=1.0_wp, frequency=20.0_wp)
      call check(error, all(abs(load_amplitudes([5.0_wp, 7.0_wp], both, 0.05_wp) - [5.0_wp, 11.0_wp]) < rounding) .and. &
         & end_of_all(both(:1)) < 0.11_wp .and. end_of_all(both(:0)) <= 0.0_wp)
   end subroutine test_amplitudes

end module test_analysis_excitation
