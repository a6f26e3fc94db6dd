!> Tests of impact sequences: what they leave behind, and the state they end in.
module test_analysis_settling
   use microslip_analysis_operating_state, only: operating_state_t
   use microslip_analysis_preload, only: preload_options_t, preload_record_t, run_preload
   use microslip_analysis_settling, only: run_settling, settling_options_t, settling_record_t
   use microslip_contact_factory, only: contact_options_t
   use microslip_contact_laws, only: state_open
   use microslip_core_error, only: error_t
   use microslip_core_kinds, only: wp
   use microslip_core_stopwatch, only: stopwatch_t
   use microslip_core_text, only: to_text
   use microslip_fe_reduced_model, only: reduced_model_t
   use microslip_system_jointed_system, only: jointed_system_t
   use support_checks, only: good
   use support_history, only: history_t
   use support_joint, only: make_joint, preload_joint
   use testdrive, only: check, new_unittest, testing_error => error_type, unittest_type
   implicit none(type, external)
   private

   public :: collect_analysis_settling

   !> Mass-proportional damping, 1/s: e^(-beta t/2) is 5e-5 after an interval; s.
   real(wp), parameter :: beta = 200.0_wp, interval = 0.1_wp, pulse = 5.0e-4_wp
   !> Contact forces, relative; what is left of the vibration, and averages out.
   real(wp), parameter :: tolerance = 1.0e-8_wp, vibration_left = 1.0e-3_wp
   real(wp), parameter :: medium = 6400.0_wp, heavy = 25600.0_wp, hill = 4.0e-6_wp

contains

   subroutine collect_analysis_settling(testsuite)
      type(unittest_type), allocatable, intent(out) :: testsuite(:)

      testsuite = [ &
         & new_unittest('equal impacts settle, the friction cone holds', test_equal), &
         & new_unittest('no impact: nothing changes', test_no_impact), &
         & new_unittest('the end is an equilibrium and repeatable', test_rest), &
         & new_unittest('points left out that close join', test_left_out), &
         & new_unittest('impacts too close are refused', test_too_close)]
   end subroutine collect_analysis_settling

   !> A joint under its preload, on cells(1) x cells(2) points per pad.
   subroutine make_preloaded(cells, system, state, options, contact, lib)
      integer, intent(in) :: cells(2)
      type(jointed_system_t), intent(out) :: system
      type(operating_state_t), intent(out) :: state
      type(settling_options_t), intent(out) :: options
      type(contact_options_t), intent(out) :: contact
      type(error_t), allocatable, intent(out) :: lib
      type(reduced_model_t) :: reduced
      type(preload_record_t) :: record

      call make_joint(cells(1), cells(2), hill, reduced, system, lib)
      if (allocated(lib)) return
      system%damping = beta
      contact%solver = 'condensed'
      call preload_joint(system, contact, state, record, lib)
      options = settling_options_t(load=3, amplitude=[medium, medium, medium], duration=pulse, interval=interval, &
         & period=1.0_wp/200.0_wp, periods=4, time_step=0.74_wp/system%highest_angular_frequency(), stride=50)
   end subroutine make_preloaded

   subroutine settle(system, state, options, contact, record, lib)
      type(jointed_system_t), intent(inout) :: system
      type(operating_state_t), intent(inout) :: state
      type(settling_options_t), intent(in) :: options
      type(contact_options_t), intent(in) :: contact
      type(settling_record_t), intent(out) :: record
      type(error_t), allocatable, intent(out) :: lib
      type(history_t) :: history
      type(stopwatch_t) :: clock

      call clock%start()
      allocate (history%samples(0), history%snapshots(0), history%windows(0))
      call run_settling(system, state, options, contact, history, clock, record, lib)
   end subroutine settle

   !> Largest of some numbers that are not NaN; zero if there is none.
   pure real(wp) function largest(values)
      real(wp), intent(in) :: values(:)
      integer :: k
      largest = 0.0_wp
      do k = 1, size(values)
         if (values(k) == values(k)) largest = max(largest, abs(values(k)))
      end do
   end function largest

   !> Largest tangential displacement that an impact left.
   real(wp) function change(record, impact)
      type(settling_record_t), intent(in) :: record
      integer, intent(in) :: impact
      change = largest(reshape(record%after(impact)%slip - record%after(impact - 1)%slip, &
         & [size(record%after(impact)%slip)]))
   end function change

   subroutine test_equal(error)
      type(testing_error), allocatable, intent(out) :: error
      type(error_t), allocatable :: lib
      type(jointed_system_t) :: system
      type(operating_state_t) :: state
      type(settling_options_t) :: options
      type(contact_options_t) :: contact
      type(settling_record_t) :: record
      integer :: k

      call make_preloaded([7, 5], system, state, options, contact, lib)
      if (.not. allocated(lib)) call settle(system, state, options, contact, record, lib)
      call good(error, lib)
      if (allocated(error)) return
      call check(error, size(record%after), 4)
      if (allocated(error)) return
      do k = 1, 3
         associate (after => record%after(k))
            call check(error, largest(after%slip_ratio) <= 1.0_wp + tolerance .and. &
               & abs(largest(after%largest_slip_ratio) - 1.0_wp) < tolerance, 'slip ratio '//to_text(largest(after%slip_ratio)))
            if (.not. allocated(error)) call check(error, largest(after%largest_slip) > &
               & 0.5_wp*change(record, k), 'less slip than is left')
         end associate
         if (allocated(error)) return
      end do
      call check(error, change(record, 1) > 1.0e-8_wp .and. change(record, 2) < 0.5_wp*change(record, 1), &
         & 'slip left: '//to_text(change(record, 1))//' '//to_text(change(record, 2))//' '//to_text(change(record, 3)))
      if (allocated(error)) return
      call check(error, largest(record%after(2)%sensor - record%after(1)%sensor) < &
         & 0.5_wp*largest(record%after(1)%sensor - record%after(0)%sensor), 'shift of the sensors')
   end subroutine test_equal

   subroutine test_no_impact(error)
      type(testing_error), allocatable, intent(out) :: error
      type(error_t), allocatable :: lib
      type(jointed_system_t) :: system
      type(operating_state_t) :: state, before
      type(settling_options_t) :: options
      type(contact_options_t) :: contact
      type(settling_record_t) :: record

      call make_preloaded([5, 3], system, state, options, contact, lib)
      if (.not. allocated(lib)) then
         before = state
         options%amplitude = [0.0_wp]
         call settle(system, state, options, contact, record, lib)
      end if
      call good(error, lib)
      if (allocated(error)) return
      call check(error, maxval(abs(state%contact%force - before%contact%force)) < tolerance*maxval(before%contact%force) .and. &
         & maxval(abs(state%modal - before%modal)) < tolerance*hill .and. &
         & all(state%contact%status == before%contact%status), 'state')
      if (allocated(error)) return
      call check(error, largest(record%after(1)%slip_ratio - record%after(0)%slip_ratio) < tolerance .and. &
         & largest(record%after(1)%sensor - record%after(0)%sensor) < tolerance*hill .and. &
         & change(record, 1) < tolerance*hill, 'residual state')
   end subroutine test_no_impact

   !> Started from its end without impact nothing moves any more; the sensors are where they were on average.
   subroutine test_rest(error)
      type(testing_error), allocatable, intent(out) :: error
      type(error_t), allocatable :: lib
      type(jointed_system_t) :: system
      type(operating_state_t) :: state, before
      type(settling_options_t) :: options
      type(contact_options_t) :: contact
      type(settling_record_t) :: record, again
      real(wp) :: shift

      call make_preloaded([5, 3], system, state, options, contact, lib)
      options%amplitude = [heavy]
      options%interval = 2.0_wp*interval
      if (.not. allocated(lib)) call settle(system, state, options, contact, record, lib)
      before = state
      options%amplitude = [0.0_wp]
      if (.not. allocated(lib)) call settle(system, state, options, contact, again, lib)
      call good(error, lib)
      if (allocated(error)) return
      shift = largest(record%after(1)%sensor - record%after(0)%sensor)
      call check(error, shift > 1.0e-8_wp .and. largest(again%after(0)%sensor - record%after(1)%sensor) < vibration_left*shift, &
         & 'mean and rest: '//to_text(largest(again%after(0)%sensor - record%after(1)%sensor)/shift))
      if (allocated(error)) return
      call check(error, largest(again%after(1)%sensor - again%after(0)%sensor) < tolerance*shift .and. &
         & maxval(abs(state%contact%force - before%contact%force)) < tolerance*maxval(before%contact%force), 'at rest')
      if (allocated(error)) return
      call check(error, all(state%contact%force(1, :) >= 0.0_wp) .and. &
         & all(state%contact%force(1, :) > 0.0_wp .or. state%contact%status == state_open) .and. &
         & all(state%contact%gap(1, :) > -tolerance*hill), 'contact laws')
   end subroutine test_rest

   !> Only what is closed under the preload takes part at first; impacts tilt the pads onto the rest.
   subroutine test_left_out(error)
      type(testing_error), allocatable, intent(out) :: error
      type(error_t), allocatable :: lib
      type(jointed_system_t) :: system
      type(operating_state_t) :: state
      type(settling_options_t) :: options
      type(contact_options_t) :: contact
      type(settling_record_t) :: record
      type(preload_record_t) :: preload

      call make_preloaded([8, 5], system, state, options, contact, lib)
      if (.not. allocated(lib)) call system%restrict(state%contact%status /= state_open, lib)
      if (.not. allocated(lib)) call run_preload(system, preload_options_t(loads=[1, 2], scale=state%amplitude(:2)), contact, &
         & state, preload, lib)
      options%interval = 0.03_wp
      options%amplitude = [medium]
      if (.not. allocated(lib)) call settle(system, state, options, contact, record, lib)
      call good(error, lib)
      if (allocated(error)) return
      call check(error, record%transient%points_added > 0, 'no point joined')
      if (.not. allocated(error)) call check(error, size(state%contact%status) == system%problem%n_points .and. &
         & size(record%after(1)%slip_ratio) == system%grid_point_count() .and. &
         & largest(record%after(1)%slip_ratio) <= 1.0_wp + tolerance, 'sizes')
   end subroutine test_left_out

   subroutine test_too_close(error)
      type(testing_error), allocatable, intent(out) :: error
      type(error_t), allocatable :: lib
      type(jointed_system_t) :: system
      type(operating_state_t) :: state
      type(settling_options_t) :: options
      type(contact_options_t) :: contact
      type(settling_record_t) :: record

      call make_preloaded([5, 3], system, state, options, contact, lib)
      options%interval = 0.02_wp
      if (.not. allocated(lib)) call settle(system, state, options, contact, record, lib)
      call check(error, allocated(lib))
      if (.not. allocated(error)) call check(error, index(lib%message, 'do not fit') > 0, lib%message)
   end subroutine test_too_close

end module test_analysis_settling
