!> What is doubtful about loads, damping, times and frequencies of a case: numbers in another unit, and what has no effect.
!>
!> Nothing here is refused: every check has a named threshold (doc/namelists.md, "What is doubted").
module microslip_cli_motion_checks
   use microslip_analysis_excitation, only: end_of_all, excitation_t
   use microslip_cli_motion_input, only: excitations_of
   use microslip_cli_scene, only: scene_t
   use microslip_core_kinds, only: wp, pi
   use microslip_core_text, only: to_text
   use microslip_core_warning_list, only: severity_doubtful, severity_note, severity_wrong, warning_list_t
   use microslip_io_case, only: case_t, excitation_case_t
   implicit none(type, external)
   private

   public :: check_loads, check_times

   !> Damping ratio of a structure.
   real(wp), parameter :: largest_damping = 0.05_wp
   !> Length of a time integration, or from one impact to the next, in periods of the lowest mode.
   real(wp), parameter :: most_periods = 1.0e4_wp, fewest_periods = 1.0_wp
   !> Length of a half-sine, in periods of the lowest and of the highest mode that is kept.
   real(wp), parameter :: longest_pulse = 10.0_wp, shortest_pulse = 0.1_wp
   !> Frequency over that of the lowest mode.
   real(wp), parameter :: lowest_frequency = 1.0e-3_wp
   !> Distance of a range of frequencies from the next mode, as a factor.
   real(wp), parameter :: near = 1.5_wp
   !> Samples of a period of the lowest mode, and in all.
   real(wp), parameter :: fewest_samples = 8.0_wp, fewest_stored = 2.0_wp
   !> Time step over the longest that is stable.
   real(wp), parameter :: shortest_step = 1.0e-2_wp
   !> Lowest frequency that counts as elastic, over the highest.
   real(wp), parameter :: rigid = 1.0e-6_wp

contains

   !> What can be said before the reduction: loads and damping.
   subroutine check_loads(case, scene, warnings)
      type(case_t), intent(in) :: case
      type(scene_t), intent(in) :: scene
      type(warning_list_t), intent(inout) :: warnings
      integer :: k

      do k = 1, size(case%loads)
         if (any(case%loads(k)%kind == [character(len=6) :: 'modal', 'motion'])) cycle
         if (is_zero(scene%patterns(:, scene%load_index(k)))) call warnings%add(severity_wrong, "&load '"// &
            & trim(case%loads(k)%name)//"': its parts cancel at every node, it has no force")
      end do
      if (allocated(case%preload%load_scale) .and. allocated(case%preload%loads)) then
         do k = 1, min(size(case%preload%load_scale), size(case%preload%loads))
            if (.not. abs(case%preload%load_scale(k)) > 0.0_wp) call warnings%add(severity_doubtful, "&preload: load '"// &
               & trim(case%preload%loads(k))//"' has load_scale 0, it is no part of the preload")
         end do
      end if
      do k = 1, size(case%excitations)
         if (.not. abs(case%excitations(k)%amplitude) > 0.0_wp) call warnings%add(severity_doubtful, excitation_name(case, k)// &
            & 'amplitude = 0, it does nothing')
      end do
      if (allocated(case%settling%amplitude)) then
         if (.not. any(abs(case%settling%amplitude) > 0.0_wp)) call warnings%add(severity_doubtful, &
            & '&settling: all amplitudes are 0, the impacts do nothing')
      end if
      associate (damping => case%damping)
         if (allocated(damping%ratio)) call check_damping('ratio', damping%ratio, warnings)
         if (allocated(damping%modal_ratio)) call check_damping('modal_ratio', maxval(damping%modal_ratio), warnings)
         if ((allocated(damping%ratio) .or. allocated(damping%modal_ratio) .or. allocated(damping%mass_proportional)) .and. .not. &
            & any([case%runs('transient'), case%runs('settling'), case%runs('qsma'), case%runs('harmonic_balance'), &
            & case%runs('epmc')])) call warnings%add(severity_note, '&damping: no analysis of this case uses it')
      end associate
   end subroutine check_loads

   !> A damping ratio may be in percent.
   subroutine check_damping(key, ratio, warnings)
      character(len=*), intent(in) :: key
      real(wp), intent(in) :: ratio
      type(warning_list_t), intent(inout) :: warnings

      if (ratio > largest_damping) call warnings%add(severity_doubtful, '&damping: '//key//' = '//to_text(ratio)//', that is '// &
         & to_text(1.0e2_wp*ratio)//' % of critical damping, more than '//to_text(1.0e2_wp*largest_damping)//' %: is it in '// &
         & 'percent? '//to_text(ratio)//' % are '//to_text(1.0e-2_wp*ratio))
   end subroutine check_damping

   pure logical function is_zero(vector)
      real(wp), intent(in) :: vector(:)
      is_zero = .not. any(abs(vector) > 0.0_wp)
   end function is_zero

   !> An excitation in words.
   function excitation_name(case, k) result(text)
      type(case_t), intent(in) :: case
      integer, intent(in) :: k
      character(len=:), allocatable :: text
      text = '&excitation '//to_text(k)//" (load '"//trim(case%excitations(k)%load)//"'): "
   end function excitation_name

   !> What can be said when the frequencies of the modes that are kept are known.
   subroutine check_times(case, scene, frequency, warnings)
      type(case_t), intent(in) :: case
      type(scene_t), intent(in) :: scene
      !> (modes) Hz, with tied interfaces
      real(wp), intent(in) :: frequency(:)
      type(warning_list_t), intent(inout) :: warnings
      real(wp) :: lowest, highest
      integer :: k

      highest = maxval(frequency)
      if (.not. highest > 0.0_wp) return
      lowest = minval(frequency, frequency > rigid*highest)
      if (allocated(case%damping%mass_proportional)) then
         associate (ratio => case%damping%mass_proportional/(4.0_wp*pi*lowest))
            if (ratio > largest_damping) call warnings%add(severity_doubtful, '&damping: mass_proportional = '// &
               & to_text(case%damping%mass_proportional)//' 1/s is '//to_text(1.0e2_wp*ratio, 3)//' % of critical damping in '// &
               & 'the lowest mode ('//to_text(lowest, 4)//' Hz), more than '//to_text(1.0e2_wp*largest_damping)//' %')
         end associate
      end if
      if (case%runs('transient')) then
         call check_transient(case, scene, lowest, highest, warnings)
         do k = 1, size(case%excitations)
            call check_excitation(case, scene, k, frequency, lowest, highest, warnings)
         end do
      end if
      if (case%runs('settling')) then
         call check_pulse('&settling: ', case%settling%duration, lowest, highest, warnings)
         call check_duration('&settling: interval', case%settling%interval, lowest, warnings)
      end if
      if (case%runs('harmonic_balance') .and. allocated(case%harmonic_balance%frequency_range)) call check_frequencies( &
         & '&harmonic_balance: frequency_range', minval(case%harmonic_balance%frequency_range), &
         & maxval(case%harmonic_balance%frequency_range), frequency, lowest, highest, warnings)
   end subroutine check_times

   !> Length, step and samples of the time integration.
   subroutine check_transient(case, scene, lowest, highest, warnings)
      type(case_t), intent(in) :: case
      type(scene_t), intent(in) :: scene
      !> Hz
      real(wp), intent(in) :: lowest, highest
      type(warning_list_t), intent(inout) :: warnings
      type(excitation_t), allocatable :: excitations(:)
      real(wp) :: step, duration, samples
      logical :: measures

      measures = any(case%excitations%kind == 'stepped_sine' .or. case%excitations%kind == 'swept_sine')
      duration = case%transient%duration
      if (duration > 0.0_wp .and. .not. measures) call check_duration('&transient: duration', duration, lowest, warnings)
      if (duration <= 0.0_wp) then
         excitations = excitations_of(case, scene)
         duration = end_of_all(excitations)
      end if
      step = case%transient%safety/(2.0_wp*pi*highest)
      if (allocated(case%transient%time_step)) then
         step = case%transient%time_step
         if (pi*highest*step < shortest_step) call warnings%add(severity_note, '&transient: time_step = '//to_text(step)// &
            & ' s is less than '//to_text(1.0e2_wp*shortest_step)//' % of what is stable, '//to_text(1.0_wp/(pi*highest), 3)// &
            & ' s: is it in s?')
      end if
      samples = duration/(step*case%output%stride)
      if (samples < fewest_stored) then
         call warnings%add(severity_doubtful, '&output: stride = '//to_text(case%output%stride)//', but there are about '// &
            & to_text(duration/step, 4)//' time steps: hardly anything is stored')
      else if (.not. measures .and. 1.0_wp/(lowest*step*case%output%stride) < fewest_samples) then
         call warnings%add(severity_doubtful, '&output: stride = '//to_text(case%output%stride)//' leaves '// &
            & to_text(1.0_wp/(lowest*step*case%output%stride), 2)//' samples of a period of the lowest mode ('// &
            & to_text(lowest, 4)//' Hz), fewer than '//to_text(fewest_samples))
      end if
      if (allocated(case%output%snapshots)) then
         if (any(case%output%snapshots > duration)) call warnings%add(severity_wrong, '&output: '// &
            & to_text(count(case%output%snapshots > duration))//' of the snapshots lie behind the end of the run, '// &
            & to_text(duration)//' s')
      end if
   end subroutine check_transient

   !> A time against the lowest mode.
   subroutine check_duration(place, duration, lowest, warnings)
      character(len=*), intent(in) :: place
      !> s; Hz
      real(wp), intent(in) :: duration, lowest
      type(warning_list_t), intent(inout) :: warnings
      character(len=:), allocatable :: text

      text = place//' = '//to_text(duration)//' s is '//to_text(duration*lowest, 3)//' periods of the lowest mode ('// &
         & to_text(lowest, 4)//' Hz), '
      if (duration*lowest > most_periods) then
         call warnings%add(severity_doubtful, text//'more than '//to_text(most_periods)//': is it in ms?')
      else if (duration*lowest < fewest_periods) then
         call warnings%add(severity_doubtful, text//'less than '//to_text(fewest_periods)//': is it in s?')
      end if
   end subroutine check_duration

   !> One excitation.
   subroutine check_excitation(case, scene, k, frequency, lowest, highest, warnings)
      type(case_t), intent(in) :: case
      type(scene_t), intent(in) :: scene
      !> Excitation
      integer, intent(in) :: k
      !> Hz
      real(wp), intent(in) :: frequency(:), lowest, highest
      type(warning_list_t), intent(inout) :: warnings
      character(len=:), allocatable :: place
      real(wp) :: run, ends

      place = excitation_name(case, k)
      run = case%transient%duration
      associate (record => case%excitations(k))
         select case (trim(record%kind))
         case ('half_sine')
            call check_pulse(place, record%duration, lowest, highest, warnings)
            ends = record%start + record%duration
            if (allocated(record%times)) ends = maxval(record%times) + record%duration
            if (run > 0.0_wp .and. ends > run) call warnings%add(severity_doubtful, place//'its pulse ends at '//to_text(ends)// &
               & ' s, behind the end of the run, '//to_text(run)//' s')
         case ('harmonic')
            call check_frequencies(place//'frequency', record%frequency, record%frequency, frequency, lowest, highest, warnings)
         case ('stepped_sine', 'swept_sine')
            if (allocated(record%frequencies)) then
               call check_frequencies(place//'frequencies', minval(record%frequencies), maxval(record%frequencies), frequency, &
                  & lowest, highest, warnings)
            else
               call check_frequencies(place//'frequency_from and frequency_to', min(record%frequency_from, record%frequency_to), &
                  & max(record%frequency_from, record%frequency_to), frequency, lowest, highest, warnings)
            end if
         case ('file')
            if (run > 0.0_wp) call check_table(place, record, scene%tables(k)%points, run, warnings)
         end select
         if (record%ramp > 0.0_wp .and. run > 0.0_wp .and. record%start + record%ramp >= run) call warnings%add( &
            & severity_doubtful, place//'its ramp ends at '//to_text(record%start + record%ramp)// &
            & ' s, behind the end of the run, '//to_text(run)//' s')
      end associate
   end subroutine check_excitation

   !> A half-sine against the modes that are kept.
   subroutine check_pulse(place, duration, lowest, highest, warnings)
      character(len=*), intent(in) :: place
      !> s; Hz
      real(wp), intent(in) :: duration, lowest, highest
      type(warning_list_t), intent(inout) :: warnings
      character(len=:), allocatable :: text

      text = place//'a half-sine of duration = '//to_text(duration)//' s is '
      if (duration*lowest > longest_pulse) then
         call warnings%add(severity_doubtful, text//to_text(duration*lowest, 3)//' periods of the lowest mode ('// &
            & to_text(lowest, 4)//' Hz), more than '//to_text(longest_pulse)//', and hardly excites it: is it in ms?')
      else if (duration*highest < shortest_pulse) then
         call warnings%add(severity_doubtful, text//to_text(duration*highest, 2)//' periods of the highest mode that is kept ('// &
            & to_text(highest, 4)//' Hz), less than '//to_text(shortest_pulse)//': is it in s?')
      end if
   end subroutine check_pulse

   !> Frequencies against the modes that are kept; angular frequencies are 2 pi times as large.
   subroutine check_frequencies(place, from, to, frequency, lowest, highest, warnings)
      character(len=*), intent(in) :: place
      !> Hz
      real(wp), intent(in) :: from, to, frequency(:), lowest, highest
      type(warning_list_t), intent(inout) :: warnings
      character(len=:), allocatable :: text

      text = place//' = '//to_text(from)//' Hz'
      if (to > from) text = place//' = '//to_text(from)//' to '//to_text(to)//' Hz'
      if (to > highest) then
         call warnings%add(severity_wrong, text//' goes beyond the highest mode that is kept, '//to_text(highest, 6)// &
            & ' Hz: more modes are needed, or it is in rad/s ('//to_text(to/(2.0_wp*pi), 6)//' Hz)')
      else if (to < lowest_frequency*lowest) then
         call warnings%add(severity_doubtful, text//' is less than a thousandth of the lowest mode, '//to_text(lowest, 6)// &
            & ' Hz: is it in kHz?')
      else if (.not. any(frequency > from/near .and. frequency < to*near)) then
         if (any(frequency > from/(2.0_wp*pi*near) .and. frequency < to*near/(2.0_wp*pi))) call warnings%add(severity_note, &
            & text//' is far from all modes with tied interfaces; is it in rad/s? '//to_text(from/(2.0_wp*pi), 6)// &
            & ' Hz is near one')
      end if
   end subroutine check_frequencies

   !> A function of time against the run.
   subroutine check_table(place, record, points, run, warnings)
      character(len=*), intent(in) :: place
      type(excitation_case_t), intent(in) :: record
      !> (2, points) s, and value
      real(wp), intent(in) :: points(:, :)
      !> s
      real(wp), intent(in) :: run
      type(warning_list_t), intent(inout) :: warnings
      real(wp) :: first, last

      first = record%start + points(1, 1)
      last = record%start + points(1, size(points, 2))
      if (first >= run) then
         call warnings%add(severity_wrong, place//trim(record%file)//' begins at '//to_text(first)// &
            & ' s, behind the end of the run, '//to_text(run)//' s: are its times in ms?')
      else if (last > run) then
         call warnings%add(severity_note, place//trim(record%file)//' goes on to '//to_text(last)// &
            & ' s, behind the end of the run, '//to_text(run)//' s')
      else if (last < 1.0e-2_wp*run) then
         call warnings%add(severity_note, place//trim(record%file)//' ends at '//to_text(last)//' s, the run at '//to_text(run)// &
            & ' s')
      end if
      if (is_zero(points(2, :))) call warnings%add(severity_doubtful, place//trim(record%file)//' is zero at all times')
   end subroutine check_table

end module microslip_cli_motion_checks
