!> Keys of `&excitation` and `&settling`: what moves the structure (doc/namelists.md).
module microslip_io_case_excitation
   use microslip_core_kinds, only: wp
   use microslip_io_case, only: excitation_case_t, settling_case_t, name_length
   use microslip_io_group_keys, only: group_keys_t
   use microslip_io_value_range, only: any_value, positive, non_negative, at_least, between
   implicit none(type, external)
   private

   public :: excitation_keys, settling_keys

   !> Most pulses, most frequencies of a stepped sine, most periods, most windows at a frequency, most harmonics.
   integer, parameter :: most_pulses = 10000, most_frequencies = 10000, most_periods = 1000000, most_windows = 1000, &
      most_harmonics = 50

contains

   !> `&excitation`.
   subroutine excitation_keys(keys, record)
      !> The group
      type(group_keys_t), intent(inout) :: keys
      !> Its record
      type(excitation_case_t), intent(inout) :: record

      call keys%name_key('load', record%load, required=.true.)
      call keys%name_key('kind', record%kind, [character(len=name_length) :: 'half_sine', 'harmonic', 'stepped_sine', &
         'swept_sine', 'file'], required=.true.)
      if (record%kind == 'file' .and. keys%is_reading) record%amplitude = 1.0_wp
      call keys%real_key('amplitude', record%amplitude, any_value, required=record%kind /= 'file')
      call pulse_keys(keys, record)
      if (record%kind == 'file') then
         call keys%name_key('file', record%file, required=.true.)
      else
         call keys%ignored(['file'], "with kind = 'file'", decided_by='kind')
      end if
      if (record%kind == 'harmonic') then
         call keys%real_key('frequency', record%frequency, positive, required=.true.)
      else
         call keys%ignored(['frequency'], "with kind = 'harmonic'", decided_by='kind')
      end if
      if (any(record%kind == [character(len=12) :: 'harmonic', 'stepped_sine', 'swept_sine'])) then
         call keys%real_key('phase', record%phase, any_value)
         call keys%real_key('ramp', record%ramp, non_negative)
      else
         call keys%ignored(['phase', 'ramp '], 'with sines', decided_by='kind')
      end if
      call range_keys(keys, record)
      call measuring_keys(keys, record)
      call keys%finish()
   end subroutine excitation_keys

   !> When it begins; half-sines and their length.
   subroutine pulse_keys(keys, record)
      type(group_keys_t), intent(inout) :: keys
      type(excitation_case_t), intent(inout) :: record

      if (record%kind == 'half_sine') then
         call keys%real_key('duration', record%duration, positive, required=.true.)
         call keys%real_list('times', record%times, non_negative, [1, most_pulses])
      else
         call keys%ignored(['duration', 'times   '], "with kind = 'half_sine'", decided_by='kind')
      end if
      if (allocated(record%times)) then
         call keys%ignored(['start'], 'without times', decided_by='times')
      else
         call keys%real_key('start', record%start, non_negative)
      end if
   end subroutine pulse_keys

   !> The frequencies of a stepped sine and of a sweep.
   subroutine range_keys(keys, record)
      type(group_keys_t), intent(inout) :: keys
      type(excitation_case_t), intent(inout) :: record
      character(len=*), parameter :: ends(2) = [character(len=14) :: 'frequency_from', 'frequency_to']
      logical :: listed

      listed = allocated(record%frequencies)
      if (keys%is_reading) listed = keys%given('frequencies')
      if (record%kind == 'stepped_sine') then
         call keys%real_list('frequencies', record%frequencies, positive, [1, most_frequencies])
         call keys%exactly_one([character(len=14) :: 'frequencies', 'frequency_from'])
      else
         call keys%ignored(['frequencies'], "with kind = 'stepped_sine'", decided_by='kind')
      end if
      if (record%kind == 'swept_sine' .or. (record%kind == 'stepped_sine' .and. .not. listed)) then
         call keys%real_key('frequency_from', record%frequency_from, positive, required=record%kind == 'swept_sine')
         call keys%real_key('frequency_to', record%frequency_to, positive, required=.true.)
         if (keys%is_reading .and. record%frequency_from == record%frequency_to .and. record%frequency_to > 0.0_wp) &
            call keys%fault('frequency_to', 'another number than frequency_from')
      else if (record%kind == 'stepped_sine') then
         call keys%ignored(ends(2:), 'without frequencies', decided_by='frequencies')
      else
         call keys%ignored(ends, "with kind = 'stepped_sine' or 'swept_sine'", decided_by='kind')
      end if
      if (record%kind == 'stepped_sine' .and. .not. listed) then
         call keys%integer_key('frequency_count', record%frequency_count, at_least(2, most_frequencies), required=.true.)
      else
         call keys%ignored(['frequency_count'], 'with a stepped sine from frequency_from', decided_by='kind')
      end if
      if (record%kind == 'swept_sine') then
         call keys%name_key('sweep', record%sweep, [character(len=name_length) :: 'linear', 'log'])
         call keys%real_key('rate', record%rate, positive, required=.true.)
      else
         call keys%ignored(['sweep', 'rate '], "with kind = 'swept_sine'", decided_by='kind')
      end if
   end subroutine range_keys

   !> What is measured on the way, and for how long.
   subroutine measuring_keys(keys, record)
      type(group_keys_t), intent(inout) :: keys
      type(excitation_case_t), intent(inout) :: record

      if (any(record%kind == [character(len=12) :: 'stepped_sine', 'swept_sine'])) then
         call keys%integer_key('harmonics', record%harmonics, at_least(1, most_harmonics))
         call keys%integer_key('measure_periods', record%measure_periods, at_least(2, most_periods))
      else
         call keys%ignored([character(len=15) :: 'harmonics', 'measure_periods'], &
            "with kind = 'stepped_sine' or 'swept_sine'", decided_by='kind')
      end if
      if (record%kind == 'stepped_sine') then
         call keys%integer_key('settle_periods', record%settle_periods, at_least(0, most_periods))
         call keys%optional_real('steady_tolerance', record%steady_tolerance, positive)
      else
         call keys%ignored([character(len=16) :: 'settle_periods', 'steady_tolerance'], "with kind = 'stepped_sine'", &
            decided_by='kind')
      end if
      if (allocated(record%steady_tolerance)) then
         call keys%integer_key('most_windows', record%most_windows, at_least(2, most_windows))
      else
         call keys%ignored(['most_windows'], 'with steady_tolerance', decided_by='kind')
      end if
   end subroutine measuring_keys

   !> `&settling`.
   subroutine settling_keys(keys, record)
      !> The group
      type(group_keys_t), intent(inout) :: keys
      !> Its record
      type(settling_case_t), intent(inout) :: record

      call keys%name_key('load', record%load, required=.true.)
      call keys%real_list('amplitude', record%amplitude, any_value, [1, most_pulses], required=.true.)
      if (allocated(record%amplitude)) then
         if (size(record%amplitude) == 1) then
            call keys%integer_key('impacts', record%impacts, at_least(1, most_pulses))
         else
            call keys%ignored(['impacts'], 'with a single amplitude', decided_by='amplitude')
         end if
      end if
      call keys%real_key('duration', record%duration, positive, required=.true.)
      call keys%real_key('interval', record%interval, positive, required=.true.)
      if (keys%is_reading .and. record%duration >= record%interval .and. record%interval > 0.0_wp) &
         call keys%fault('duration', 'a number below interval')
      call keys%integer_key('mode', record%mode, at_least(1))
      call keys%integer_key('periods', record%periods, at_least(1, most_periods))
      call keys%logical_key('ringdown', record%ringdown)
      call keys%optional_real('time_step', record%time_step, positive)
      if (allocated(record%time_step)) then
         call keys%ignored(['safety'], 'without time_step')
      else
         call keys%real_key('safety', record%safety, between(0.0_wp, 2.0_wp))
      end if
      call keys%finish()
   end subroutine settling_keys

end module microslip_io_case_excitation
