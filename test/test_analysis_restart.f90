!> A run that goes on from a restart point has the same bits as the run that left it.
module test_analysis_restart
   use microslip_analysis_excitation, only: excitation_t, kind_half_sine, kind_stepped_sine
   use microslip_analysis_harmonic_meter, only: harmonic_meter_t
   use microslip_analysis_operating_state, only: operating_state_t
   use microslip_analysis_preload, only: preload_record_t
   use microslip_analysis_settling, only: run_settling, settling_options_t, settling_record_t
   use microslip_analysis_transient, only: run_transient, sample_t, transient_options_t, transient_record_t
   use microslip_contact_factory, only: contact_options_t
   use microslip_core_archive, only: archive_t
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

   public :: collect_analysis_restart

   !> m; N
   real(wp), parameter :: hill = 4.0e-6_wp, blow = 6400.0_wp
   integer, parameter :: impact_load = 3

   type :: words_t
      integer, allocatable :: words(:)
   end type words_t

   !> Keeps the restart points too.
   type, extends(history_t) :: keeper_t
      type(words_t), allocatable :: points(:)
      !> Samples and windows before each of them, or before the point that was gone on from
      integer, allocatable :: samples_before(:), windows_before(:)
   contains
      procedure :: restart_point
   end type keeper_t

contains

   subroutine collect_analysis_restart(testsuite)
      type(unittest_type), allocatable, intent(out) :: testsuite(:)

      testsuite = [ &
         & new_unittest('ring-down with sliding: condensed', test_condensed), &
         & new_unittest('ring-down with sliding: projected Jacobi', test_jacobi), &
         & new_unittest('points join behind the restart point and before', test_joining), &
         & new_unittest('stepped sine that goes on early', test_stepped_sine), &
         & new_unittest('settling', test_settling), &
         & new_unittest('a point of another run', test_wrong_point)]
   end subroutine collect_analysis_restart

   subroutine restart_point(self, archive, error)
      class(keeper_t), intent(inout) :: self
      type(archive_t), intent(inout) :: archive
      type(error_t), allocatable, intent(out) :: error

      if (allocated(error) .or. archive%loading) return
      self%points = [self%points, words_t(archive%contents())]
      self%samples_before = [self%samples_before, size(self%samples)]
      self%windows_before = [self%windows_before, size(self%windows)]
   end subroutine restart_point

   function new_keeper() result(keeper)
      type(keeper_t) :: keeper
      allocate (keeper%samples(0), keeper%snapshots(0), keeper%windows(0), keeper%points(0), keeper%samples_before(0), &
         & keeper%windows_before(0))
   end function new_keeper

   !> A joint under its preload; `all_points`: also those that stay open.
   subroutine make_preloaded(cells, solver, all_points, system, state, contact, lib)
      integer, intent(in) :: cells(2)
      character(len=*), intent(in) :: solver
      logical, intent(in) :: all_points
      type(jointed_system_t), intent(out) :: system
      type(operating_state_t), intent(out) :: state
      type(contact_options_t), intent(out) :: contact
      type(error_t), allocatable, intent(out) :: lib
      type(reduced_model_t) :: reduced
      type(preload_record_t) :: record

      contact%solver = solver
      call make_joint(cells(1), cells(2), hill, reduced, system, lib)
      if (allocated(lib)) return
      call preload_joint(system, contact, state, record, lib)
      if (allocated(lib) .or. all_points) return
      ! The set without what is open, so that points have to join.
      block
         logical, allocatable :: closed(:)
         closed = state%contact%status > 0
         call system%restrict(closed, lib)
         state%contact%force = reshape(pack(state%contact%force, spread(closed, 1, 3)), [3, count(closed)])
         state%contact%gap = reshape(pack(state%contact%gap, spread(closed, 1, 3)), [3, count(closed)])
         state%contact%status = pack(state%contact%status, closed)
      end block
   end subroutine make_preloaded

   !> Run once from the start, then from every restart point; all must be the same.
   subroutine compare(system, state, options, contact, error, points_added)
      type(jointed_system_t), intent(in) :: system
      type(operating_state_t), intent(in) :: state
      type(transient_options_t), intent(in) :: options
      type(contact_options_t), intent(in) :: contact
      type(testing_error), allocatable, intent(out) :: error
      integer, intent(out) :: points_added
      type(error_t), allocatable :: lib
      type(jointed_system_t) :: copy
      type(keeper_t) :: whole, rest
      type(transient_record_t) :: record, rest_record
      type(stopwatch_t) :: clock
      integer :: k, j

      call clock%start()
      copy = system
      whole = new_keeper()
      call run_transient(copy, state, options, contact, whole, clock, record, lib)
      call good(error, lib)
      if (allocated(error)) return
      points_added = record%points_added
      call check(error, size(whole%points) >= 3, 'restart points: '//to_text(size(whole%points)))
      do k = 1, size(whole%points)
         if (allocated(error)) return
         copy = system
         rest = new_keeper()
         call run_transient(copy, state, options, contact, rest, clock, rest_record, lib, whole%points(k)%words)
         call good(error, lib)
         if (allocated(error)) return
         associate (before => whole%samples_before(k))
            call check(error, size(rest%samples) == size(whole%samples) - before, 'samples behind point '//to_text(k))
            if (allocated(error)) return
            do j = 1, size(rest%samples)
               if (same(rest%samples(j), whole%samples(before + j))) cycle
               call check(error, .false., 'point '//to_text(k)//', sample '//to_text(j)//' behind it')
               return
            end do
         end associate
         call check(error, rest_record%steps == record%steps .and. rest_record%iterations == record%iterations .and. &
            & rest_record%residual == record%residual .and. rest_record%points_added == record%points_added .and. &
            & rest_record%balance_error == record%balance_error, 'totals from point '//to_text(k))
         if (allocated(error)) return
         call check(error, size(rest%windows) == size(whole%windows) - whole%windows_before(k), 'windows')
         do j = 1, size(rest%windows)
            if (.not. allocated(error)) call check(error, all(rest%windows(j)%amplitude == &
               & whole%windows(whole%windows_before(k) + j)%amplitude), 'window '//to_text(j))
         end do
      end do
   end subroutine compare

   !> The same bits.
   pure logical function same(one, other)
      type(sample_t), intent(in) :: one, other
      same = one%step == other%step .and. all(one%modal == other%modal) .and. all(one%sensor == other%sensor) .and. &
         & all(one%counts == other%counts) .and. one%iterations == other%iterations .and. one%residual == other%residual &
         & .and. one%energy%friction_loss == other%energy%friction_loss .and. &
         & one%energy%balance_error == other%energy%balance_error .and. one%energy%elastic == other%energy%elastic
   end function same

   !> A ring-down of `steps` steps.
   subroutine ring_down(system, steps, options)
      type(jointed_system_t), intent(in) :: system
      integer, intent(in) :: steps
      type(transient_options_t), intent(out) :: options

      options%time_step = 0.74_wp/system%highest_angular_frequency()
      options%duration = steps*options%time_step
      options%restart_stride = steps/5
      options%verify_stride = steps/10
      options%stride = 3
      options%excitations = [excitation_t(load=impact_load, kind=kind_half_sine, amplitude=blow, duration=5.0e-4_wp)]
   end subroutine ring_down

   subroutine test_condensed(error)
      type(testing_error), allocatable, intent(out) :: error
      call run_ring_down('condensed', .true., error)
   end subroutine test_condensed

   subroutine test_jacobi(error)
      type(testing_error), allocatable, intent(out) :: error
      call run_ring_down('jacobi', .true., error)
   end subroutine test_jacobi

   subroutine test_joining(error)
      type(testing_error), allocatable, intent(out) :: error
      call run_ring_down('condensed', .false., error)
   end subroutine test_joining

   subroutine run_ring_down(solver, all_points, error)
      character(len=*), intent(in) :: solver
      logical, intent(in) :: all_points
      type(testing_error), allocatable, intent(out) :: error
      type(error_t), allocatable :: lib
      type(jointed_system_t) :: system
      type(operating_state_t) :: state
      type(contact_options_t) :: contact
      type(transient_options_t) :: options
      integer :: points_added

      call make_preloaded(merge([4, 3], [8, 5], solver == 'jacobi'), solver, all_points, system, state, contact, lib)
      call good(error, lib)
      if (allocated(error)) return
      call ring_down(system, merge(100, 600, solver == 'jacobi'), options)
      call compare(system, state, options, contact, error, points_added)
      if (.not. allocated(error)) call check(error, all_points .or. points_added > 0, 'no point joined')
   end subroutine run_ring_down

   subroutine test_stepped_sine(error)
      type(testing_error), allocatable, intent(out) :: error
      type(error_t), allocatable :: lib
      type(jointed_system_t) :: system
      type(operating_state_t) :: state
      type(contact_options_t) :: contact
      type(transient_options_t) :: options
      integer :: points_added

      call make_preloaded([5, 3], 'condensed', .true., system, state, contact, lib)
      call good(error, lib)
      if (allocated(error)) return
      options%time_step = 0.74_wp/system%highest_angular_frequency()
      options%restart_stride = 700
      options%excitations = [excitation_t(load=impact_load, kind=kind_stepped_sine, amplitude=100.0_wp, &
         & frequencies=[150.0_wp, 160.0_wp], periods=[22, 22])]
      options%meter = harmonic_meter_t(excitation=1, harmonics=3, window=4, settling=2, most_windows=5, tolerance=0.3_wp)
      call compare(system, state, options, contact, error, points_added)
   end subroutine test_stepped_sine

   subroutine test_settling(error)
      type(testing_error), allocatable, intent(out) :: error
      type(error_t), allocatable :: lib
      type(jointed_system_t) :: system, copy
      type(operating_state_t) :: start, state, rest_state
      type(contact_options_t) :: contact
      type(settling_options_t) :: options
      type(settling_record_t) :: record, rest_record
      type(keeper_t) :: whole, rest
      type(stopwatch_t) :: clock
      integer :: k, j

      call make_preloaded([5, 3], 'condensed', .true., system, start, contact, lib)
      call good(error, lib)
      if (allocated(error)) return
      options = settling_options_t(load=impact_load, amplitude=[2.0e3_wp, 1.0e3_wp], duration=5.0e-4_wp, interval=0.03_wp, &
         & period=5.0e-3_wp, periods=3, time_step=0.74_wp/system%highest_angular_frequency(), stride=50)
      options%restart_stride = int(0.3_wp*options%interval/options%time_step)
      call clock%start()
      whole = new_keeper()
      state = start
      copy = system
      call run_settling(copy, state, options, contact, whole, clock, record, lib)
      call good(error, lib)
      if (allocated(error)) return
      call check(error, size(whole%points) >= 5, 'restart points: '//to_text(size(whole%points)))
      do k = 1, size(whole%points)
         if (allocated(error)) return
         rest = new_keeper()
         rest_state = start
         copy = system
         call run_settling(copy, rest_state, options, contact, rest, clock, rest_record, lib, whole%points(k)%words)
         call good(error, lib)
         if (allocated(error)) return
         call check(error, all(rest_state%modal == state%modal) .and. all(rest_state%contact%force == state%contact%force), &
            & 'equilibrium in the end, from point '//to_text(k))
         do j = 0, 2
            if (allocated(error)) return
            associate (one => rest_record%after(j), other => record%after(j))
               call check(error, all(one%sensor == other%sensor) .and. alike(one%slip_ratio, other%slip_ratio) .and. &
                  & alike(one%largest_slip, other%largest_slip) .and. alike(one%largest_slip_ratio, &
                  & other%largest_slip_ratio) .and. alike(one%slip(1, :), other%slip(1, :)), 'impact '//to_text(j)// &
                  & ', from point '//to_text(k))
            end associate
         end do
      end do
   end subroutine test_settling

   !> Equal, or both not a number.
   pure logical function alike(one, other)
      real(wp), intent(in) :: one(:), other(:)
      alike = all(one == other .or. (one /= one .and. other /= other))
   end function alike

   subroutine test_wrong_point(error)
      type(testing_error), allocatable, intent(out) :: error
      type(error_t), allocatable :: lib
      type(jointed_system_t) :: system
      type(operating_state_t) :: state
      type(contact_options_t) :: contact
      type(transient_options_t) :: options
      type(transient_record_t) :: record
      type(keeper_t) :: keeper
      type(stopwatch_t) :: clock

      call make_preloaded([5, 3], 'condensed', .true., system, state, contact, lib)
      call good(error, lib)
      if (allocated(error)) return
      call ring_down(system, 100, options)
      keeper = new_keeper()
      call clock%start()
      call run_transient(system, state, options, contact, keeper, clock, record, lib, [1, 2, 3])
      call check(error, allocated(lib), 'a point of three words was taken')
      if (.not. allocated(error)) call check(error, index(lib%message, 'restart point') > 0, lib%message)
   end subroutine test_wrong_point

end module test_analysis_restart
