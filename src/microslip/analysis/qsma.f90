!> Quasi-static modal analysis (paper section 3.2, METHOD section 7): frequency and damping of a mode over amplitude.
!>
!> The load f = M phi alpha is put on the preloaded structure, from zero to +largest and, from the preload again, to
!> -largest. With q = phi^T M (u - u_0), the secant frequency and the damping ratio at a load are
!>
!>     omega^2 = alpha / q,        zeta = D / (2 pi alpha q)
!>
!> D: energy that a cycle of this amplitude loses to friction. By Masing's rule from the loading curve alone,
!>
!>     D = 8 (W - alpha q / 2),    W = integral of alpha dq = stored energy + friction loss
!>
!> (exact where the normal forces stay constant), or from a hysteresis loop +alpha -> -alpha -> +alpha that branches off
!> the loading curve and is gone round until it closes: D is its friction loss, omega^2 = (alpha_+ - alpha_-)/(q_+ - q_-).
!> Masing's rule is not trusted where it contradicts itself, in that the two directions give different losses or one of them
!> a negative one, or where it contradicts a loop at the largest amplitude (a symmetric joint has like directions, whether
!> the rule holds or not). Then loops are the result, at all levels, unless they are ruled out.
!> Linear viscous damping adds zeta_v = phi^T D_ii phi / (2 omega).
!> Amplitude: half the way of the sensor between both turning points, L2 norm over its directions.
module microslip_analysis_qsma
   use microslip_analysis_operating_state, only: operating_state_t
   use microslip_analysis_potential_set, only: potential_points, carry_over
   use microslip_analysis_slip_size, only: slip_in_cells
   use microslip_analysis_static_path, only: modal_statics_t, static_path_t, static_point_t, new_modal_statics, start_path
   use microslip_contact_factory, only: contact_options_t
   use microslip_core_error, only: error_t, failure
   use microslip_core_kinds, only: wp, pi
   use microslip_system_jointed_system, only: jointed_system_t
   implicit none(type, external)
   private

   public :: qsma_options_t, qsma_record_t, qsma_recorder_t, modal_parameters_t, run_qsma, spaced_amplitudes
   public :: loops_where_needed, loops_always, loops_never, masing_tolerance

   !> Hysteresis loops: where Masing's rule does not hold, at all levels, or not at all.
   integer, parameter :: loops_where_needed = 0, loops_always = 1, loops_never = 2
   !> Masing's rule holds where the losses of both directions, and that of a loop, differ by no more than this part of the
   !> larger one: the mean of both directions is wrong by about as much as they differ.
   real(wp), parameter :: masing_tolerance = 0.05_wp
   !> Damping ratios of friction that are zero but for the contact solver's tolerance, as a multiple of it.
   real(wp), parameter :: no_damping = 1.0e2_wp

   !> The trial step that tells load per amplitude, as a part of the smallest amplitude.
   real(wp), parameter :: trial_share = 1.0e-3_wp
   !> A sensor moves by rounding alone in a mode: its displacement over what it could be for a mode of this size.
   real(wp), parameter :: no_reach = 1.0e-8_wp
   !> A loop is closed where its ends are as close as this part of its width; rounds until then.
   real(wp), parameter :: closed_within = 1.0e-6_wp
   integer, parameter :: most_loops = 10
   !> How often the potential contact set may grow.
   integer, parameter :: most_rounds = 20

   type :: qsma_options_t
      !> (modes) mode shape of unit modal mass, and its frequency, Hz
      real(wp), allocatable :: phi(:)
      real(wp) :: frequency = 0.0_wp
      !> (levels) m, ascending: amplitudes at the sensor to aim at
      real(wp), allocatable :: amplitude(:)
      !> Sensors whose L2 norm is the amplitude
      integer, allocatable :: sensors(:)
      !> Load steps from one level to the next
      integer :: steps = 1
      !> When hysteresis loops are gone round, and load steps of each half of a loop
      integer :: loops = loops_where_needed
      integer :: cycle_steps = 10
   end type qsma_options_t

   !> The mode at an amplitude.
   type :: modal_parameters_t
      !> m, at the sensor
      real(wp) :: amplitude = 0.0_wp
      !> Hz
      real(wp) :: frequency = 0.0_wp
      !> J per cycle, to friction
      real(wp) :: dissipated_energy = 0.0_wp
      !> Of friction, of the linear viscous damping, and of both
      real(wp) :: friction_damping_ratio = 0.0_wp, viscous_damping_ratio = 0.0_wp, damping_ratio = 0.0_wp
   end type modal_parameters_t

   type :: qsma_record_t
      !> (levels, 2) the loading curves towards + and -, and what Masing's rule makes of each
      type(static_point_t), allocatable :: curve(:, :)
      type(modal_parameters_t), allocatable :: direction(:, :)
      !> (levels) of both directions together
      type(modal_parameters_t), allocatable :: combined(:)
      !> (levels) how far Masing's rule contradicts itself: difference of both directions' losses over the larger one
      real(wp), allocatable :: contradiction(:)
      !> The loop at the largest amplitude against the mean of both directions likewise, where there is one
      real(wp), allocatable :: masing_error
      !> Whether Masing's rule holds at all levels
      logical :: masing_holds = .true.
      !> (levels) from the hysteresis loops, where they are the result
      type(modal_parameters_t), allocatable :: loop(:)
      !> (levels) distance of the loop's ends over its width, and how often it was gone round
      real(wp), allocatable :: closure(:)
      integer, allocatable :: rounds(:)
      !> Load steps that did not converge; iterations of all steps; points that joined the potential contact set
      integer :: unconverged = 0, iterations = 0, points_added = 0
      !> Largest of all steps
      real(wp) :: residual = 0.0_wp, error_estimate = 0.0_wp
      !> Largest tangential displacement of a closed point at a level, in cells of its grid
      real(wp) :: largest_slip = 0.0_wp
   contains
      procedure :: modes
      procedure :: open_loops
   end type qsma_record_t

   !> Who hears of every level that is finished. An error of it ends the analysis; it may want just that.
   type, abstract :: qsma_recorder_t
   contains
      procedure(level_interface), deferred :: level
   end type qsma_recorder_t

   abstract interface
      !> Take the levels so far.
      subroutine level_interface(self, record, levels, error)
         import :: qsma_recorder_t, qsma_record_t, error_t
         implicit none(type, external)
         class(qsma_recorder_t), intent(inout) :: self
         !> Up to this level
         type(qsma_record_t), intent(in) :: record
         !> How many of them are finished
         integer, intent(in) :: levels
         type(error_t), allocatable, intent(out) :: error
      end subroutine level_interface
   end interface

contains

   !> Amplitudes up to a largest one, at equal distances or equal ratios.
   pure function spaced_amplitudes(smallest, largest, levels, logarithmic) result(amplitude)
      !> m
      real(wp), intent(in) :: smallest, largest
      integer, intent(in) :: levels
      logical, intent(in) :: logarithmic
      real(wp) :: amplitude(levels)
      integer :: k

      if (logarithmic) then
         amplitude = [(largest*(smallest/largest)**(real(levels - k, wp)/max(1, levels - 1)), k=1, levels)]
      else
         amplitude = [(largest - (largest - smallest)*(levels - k)/max(1, levels - 1), k=1, levels)]
      end if
   end function spaced_amplitudes

   !> Modal parameters over amplitude.
   subroutine run_qsma(system, state, options, contact, record, error, recorder)
      !> Its potential contact set may grow
      type(jointed_system_t), intent(inout) :: system
      !> The preloaded structure; it is carried over to a set that has grown
      type(operating_state_t), intent(inout) :: state
      type(qsma_options_t), intent(in) :: options
      type(contact_options_t), intent(in) :: contact
      type(qsma_record_t), intent(out) :: record
      type(error_t), allocatable, intent(out) :: error
      !> Where points join the potential contact set, or loops turn out to be needed, it hears of the levels again from the
      !> first one
      class(qsma_recorder_t), intent(inout), optional :: recorder
      logical, allocatable :: before(:)
      integer :: round, added, total
      logical :: loops, doubt

      total = 0
      loops = options%loops == loops_always
      do round = 1, most_rounds
         before = potential_points(system)
         call follow_curves(system, state, options, contact, loops, record, added, doubt, error, recorder)
         if (allocated(error)) return
         if (added > 0) call carry_over(system, before, state%contact)
         total = total + added
         if (added == 0 .and. .not. (doubt .and. .not. loops)) exit
         loops = loops .or. doubt
      end do
      record%points_added = total
      if (added > 0) call failure(error, 'qsma: the set of points in potential contact does not settle')
   end subroutine run_qsma

   !> The result at every level, (levels): from the loops where there are any, else by Masing's rule.
   pure function modes(self)
      class(qsma_record_t), intent(in) :: self
      type(modal_parameters_t) :: modes(size(self%combined))

      modes = self%combined
      if (allocated(self%loop)) modes = self%loop
   end function modes

   !> Levels whose loop did not close in as many rounds as there may be.
   pure integer function open_loops(self)
      class(qsma_record_t), intent(in) :: self
      open_loops = 0
      if (allocated(self%closure)) open_loops = count(self%closure > closed_within)
   end function open_loops

   !> Both loading curves and the loops, up to where a point that was left out would close or loops turn out to be needed.
   subroutine follow_curves(system, state, options, contact, loops, record, added, doubt, error, recorder)
      type(jointed_system_t), intent(inout) :: system
      type(operating_state_t), intent(in) :: state
      type(qsma_options_t), intent(in) :: options
      type(contact_options_t), intent(in) :: contact
      !> Whether loops are gone round
      logical, intent(in) :: loops
      type(qsma_record_t), intent(out) :: record
      !> Points that joined the potential contact set: all is to be done again
      integer, intent(out) :: added
      !> Masing's rule does not hold, and loops are allowed: without them all is to be done again with them
      logical, intent(out) :: doubt
      type(error_t), allocatable, intent(out) :: error
      class(qsma_recorder_t), intent(inout), optional :: recorder
      type(modal_statics_t) :: statics
      type(static_path_t) :: path(2)
      real(wp) :: load_per_amplitude
      integer :: k, side, levels

      added = 0
      doubt = .false.
      levels = size(options%amplitude)
      allocate (record%curve(levels, 2), record%direction(levels, 2), record%combined(levels), record%contradiction(levels))
      if (options%loops /= loops_never) then
         allocate (record%loop(levels), record%closure(levels))
         allocate (record%rounds(levels), source=0)
      end if
      call new_modal_statics(system, state, options%phi, statics, error)
      if (.not. allocated(error)) call start_path(statics, contact, path(1), error)
      if (.not. allocated(error)) call try_load(system, options, statics, path(1), load_per_amplitude, error)
      if (allocated(error)) return
      path(2) = path(1)
      do k = 1, levels
         do side = 1, 2
            ! The positive side sets the loads, following the secant; the negative one takes the same.
            if (side == 1) then
               call path(1)%advance(statics, options%amplitude(k)*load_per_amplitude, options%steps)
            else
               call path(2)%advance(statics, -record%curve(k, 1)%load, options%steps)
            end if
            record%curve(k, side) = statics%point(system, path(side))
            call verify(system, state, statics, path(side), record%curve(k, side), added, error)
            if (added > 0 .or. allocated(error)) return
            record%largest_slip = max(record%largest_slip, slip_in_cells(system, path(side)%contact))
         end do
         load_per_amplitude = path(1)%load/norm2(record%curve(k, 1)%sensor(options%sensors))
         call evaluate(system, options, no_damping*contact%tolerance, record, k)
         doubt = options%loops /= loops_never .and. .not. record%masing_holds
         if (doubt .and. .not. loops) return
         if (loops .or. (options%loops == loops_where_needed .and. k == levels)) then
            call go_round(system, state, options, statics, path(1), record, k, added, error)
            if (added > 0 .or. allocated(error)) return
         end if
         if (present(recorder)) call tell(recorder, record, k, loops, error)
         if (allocated(error)) exit
      end do
      call book(path(1), record)
      call book(path(2), record)
      if (allocated(error) .or. .not. allocated(record%loop)) return
      record%masing_error = contradiction_of(record%loop(levels)%friction_damping_ratio, &
         & record%combined(levels)%friction_damping_ratio, no_damping*contact%tolerance)
      record%masing_holds = record%masing_holds .and. record%masing_error <= masing_tolerance
      doubt = .not. record%masing_holds
      if (.not. loops) deallocate (record%loop, record%closure, record%rounds)
   end subroutine follow_curves

   !> Tell of a level; a loop that only checks Masing's rule is not told.
   subroutine tell(recorder, record, k, loops, error)
      class(qsma_recorder_t), intent(inout) :: recorder
      type(qsma_record_t), intent(in) :: record
      integer, intent(in) :: k
      logical, intent(in) :: loops
      type(error_t), allocatable, intent(out) :: error
      type(qsma_record_t) :: without

      if (loops) then
         call recorder%level(record, k, error)
      else
         without = record
         if (allocated(without%loop)) deallocate (without%loop, without%closure, without%rounds)
         call recorder%level(without, k, error)
      end if
   end subroutine tell

   !> Difference of two damping ratios over the larger one; none where both are no larger than the solver's tolerance makes them.
   pure real(wp) function contradiction_of(one, other, negligible)
      real(wp), intent(in) :: one, other, negligible
      contradiction_of = abs(one - other)/max(abs(one), abs(other), negligible)
      if (max(abs(one), abs(other)) <= negligible) contradiction_of = 0.0_wp
   end function contradiction_of

   !> Load per amplitude while everything sticks, from a small step on a branch of its own.
   subroutine try_load(system, options, statics, start, load_per_amplitude, error)
      type(jointed_system_t), intent(in) :: system
      type(qsma_options_t), intent(in) :: options
      type(modal_statics_t), intent(in) :: statics
      type(static_path_t), intent(in) :: start
      real(wp), intent(out) :: load_per_amplitude
      type(error_t), allocatable, intent(out) :: error
      type(static_path_t) :: trial
      type(static_point_t) :: reached
      real(wp) :: reach

      load_per_amplitude = 0.0_wp
      reach = norm2(matmul(options%phi, system%sensor_modal(:, options%sensors)))
      if (reach <= no_reach*norm2(options%phi)*norm2(system%sensor_modal(:, options%sensors))) reach = 0.0_wp
      if (reach > 0.0_wp) then
         trial = start
         call trial%advance(statics, trial_share*options%amplitude(1)*(2.0_wp*pi*options%frequency)**2/reach, 1)
         reached = statics%point(system, trial)
         reach = norm2(reached%sensor(options%sensors))
      end if
      if (reach > 0.0_wp) then
         load_per_amplitude = trial%load/reach
      else
         call failure(error, 'qsma: the sensor does not move in this mode, it is no measure of its amplitude')
      end if
   end subroutine try_load

   !> Check the points left out of the potential contact set.
   subroutine verify(system, state, statics, path, reached, added, error)
      type(jointed_system_t), intent(inout) :: system
      type(operating_state_t), intent(in) :: state
      type(modal_statics_t), intent(in) :: statics
      type(static_path_t), intent(in) :: path
      type(static_point_t), intent(in) :: reached
      integer, intent(out) :: added
      type(error_t), allocatable, intent(out) :: error
      real(wp), allocatable :: modal(:)

      ! alpha acts on the modes alone: the boundary sees it through d.
      modal = state%modal + reached%modal
      call system%widen_where_closed(modal, path%contact%force, state%amplitude, added, error)
   end subroutine verify

   !> The hysteresis loop at the load that a path has reached.
   subroutine go_round(system, state, options, statics, path, record, k, added, error)
      type(jointed_system_t), intent(inout) :: system
      type(operating_state_t), intent(in) :: state
      type(qsma_options_t), intent(in) :: options
      type(modal_statics_t), intent(in) :: statics
      type(static_path_t), intent(in) :: path
      type(qsma_record_t), intent(inout) :: record
      !> Level
      integer, intent(in) :: k
      integer, intent(out) :: added
      type(error_t), allocatable, intent(out) :: error
      type(static_path_t) :: loop
      type(static_point_t) :: upper, lower
      real(wp) :: loss, q, width

      loop = path
      do
         record%rounds(k) = record%rounds(k) + 1
         q = loop%displacement
         loss = loop%friction_loss
         call loop%advance(statics, -path%load, options%cycle_steps)
         lower = statics%point(system, loop)
         call verify(system, state, statics, loop, lower, added, error)
         if (added > 0 .or. allocated(error)) return
         call loop%advance(statics, path%load, options%cycle_steps)
         width = loop%displacement - lower%displacement
         record%closure(k) = abs(loop%displacement - q)/width
         if (record%closure(k) <= closed_within .or. record%rounds(k) == most_loops) exit
      end do
      upper = statics%point(system, loop)
      record%loop(k) = parameters(system, options, path%load, 0.5_wp*(upper%displacement - lower%displacement), &
         & 0.5_wp*norm2(upper%sensor(options%sensors) - lower%sensor(options%sensors)), loop%friction_loss - loss)
      loop%iterations = loop%iterations - path%iterations
      loop%unconverged = loop%unconverged - path%unconverged
      call book(loop, record)
   end subroutine go_round

   !> How a path went, into the record.
   pure subroutine book(path, record)
      type(static_path_t), intent(in) :: path
      type(qsma_record_t), intent(inout) :: record

      record%iterations = record%iterations + path%iterations
      record%unconverged = record%unconverged + path%unconverged
      record%residual = max(record%residual, path%residual)
      record%error_estimate = max(record%error_estimate, path%error_estimate)
   end subroutine book

   !> Masing's rule on each loading curve and on both together, at a level.
   subroutine evaluate(system, options, negligible, record, k)
      type(jointed_system_t), intent(in) :: system
      type(qsma_options_t), intent(in) :: options
      !> Damping ratio that is zero but for the solver's tolerance
      real(wp), intent(in) :: negligible
      type(qsma_record_t), intent(inout) :: record
      !> Level
      integer, intent(in) :: k
      real(wp) :: loss(2)
      integer :: side

      do side = 1, 2
         associate (p => record%curve(k, side))
            loss(side) = 8.0_wp*(p%friction_loss + (p%stored_energy - 0.5_wp*p%load*p%displacement))
            record%direction(k, side) = parameters(system, options, abs(p%load), abs(p%displacement), &
               & norm2(p%sensor(options%sensors)), loss(side))
         end associate
      end do
      associate (upper => record%curve(k, 1), lower => record%curve(k, 2))
         record%combined(k) = parameters(system, options, upper%load, 0.5_wp*(upper%displacement - lower%displacement), &
            & 0.5_wp*norm2(upper%sensor(options%sensors) - lower%sensor(options%sensors)), 0.5_wp*sum(loss))
      end associate
      associate (ratio => record%direction(k, :)%friction_damping_ratio)
         record%contradiction(k) = contradiction_of(ratio(1), ratio(2), negligible)
         record%masing_holds = record%masing_holds .and. record%contradiction(k) <= masing_tolerance &
            & .and. minval(ratio) >= -negligible
      end associate
   end subroutine evaluate

   !> Modal parameters from a load, the modal displacement it makes, the amplitude and the loss of a cycle.
   pure type(modal_parameters_t) function parameters(system, options, load, q, amplitude, loss) result(mode)
      type(jointed_system_t), intent(in) :: system
      type(qsma_options_t), intent(in) :: options
      real(wp), intent(in) :: load, q, amplitude, loss

      mode%amplitude = amplitude
      mode%frequency = sqrt(load/q)/(2.0_wp*pi)
      mode%dissipated_energy = loss
      mode%friction_damping_ratio = loss/(2.0_wp*pi*load*q)
      mode%viscous_damping_ratio = dot_product(options%phi, system%damping*options%phi)/(4.0_wp*pi*mode%frequency)
      mode%damping_ratio = mode%friction_damping_ratio + mode%viscous_damping_ratio
   end function parameters

end module microslip_analysis_qsma
