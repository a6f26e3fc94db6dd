!> Keys of `&qsma` and `&ringdown`, the analyses that end in frequency and damping over amplitude (doc/namelists.md).
module microslip_io_case_modal
   use microslip_core_kinds, only: wp
   use microslip_io_case, only: qsma_case_t, ringdown_case_t, name_length
   use microslip_io_group_keys, only: group_keys_t
   use microslip_io_value_range, only: positive, non_negative, at_least, between
   implicit none(type, external)
   private

   public :: qsma_keys, ringdown_keys

   !> Most levels, most load steps between two of them, fewest and most periods in a window.
   integer, parameter :: most_levels = 10000, most_steps = 10000, fewest_periods = 2, most_periods = 10000

contains

   !> `&qsma`.
   subroutine qsma_keys(keys, record)
      !> The group
      type(group_keys_t), intent(inout) :: keys
      !> Its record
      type(qsma_case_t), intent(inout) :: record
      logical :: loops

      call keys%integer_key('mode', record%mode, at_least(1))
      call keys%real_list('amplitudes', record%amplitudes, positive, [1, most_levels])
      call keys%optional_real('largest_amplitude', record%largest_amplitude, positive)
      call keys%exactly_one([character(len=18) :: 'amplitudes', 'largest_amplitude'])
      if (allocated(record%amplitudes)) then
         if (any(record%amplitudes(2:) <= record%amplitudes(:size(record%amplitudes) - 1))) &
            call keys%fault('amplitudes', 'ascending numbers')
         call keys%ignored([character(len=18) :: 'smallest_amplitude', 'levels', 'spacing'], 'with largest_amplitude', &
            decided_by='amplitudes')
      else
         call keys%integer_key('levels', record%levels, at_least(1, most_levels))
         call keys%name_key('spacing', record%spacing, [character(len=name_length) :: 'log', 'linear'])
         call keys%optional_real('smallest_amplitude', record%smallest_amplitude, positive)
         if (allocated(record%smallest_amplitude) .and. allocated(record%largest_amplitude)) then
            if (record%smallest_amplitude >= record%largest_amplitude) &
               call keys%fault('smallest_amplitude', 'a number below largest_amplitude')
         end if
      end if
      call keys%name_key('sensor', record%sensor)
      call keys%integer_key('steps', record%steps, at_least(1, most_steps))
      call keys%optional_logical('cycle', record%cycle)
      loops = .true.
      if (allocated(record%cycle)) loops = record%cycle
      if (loops) then
         call keys%integer_key('cycle_steps', record%cycle_steps, at_least(1, most_steps))
      else
         call keys%ignored(['cycle_steps'], 'where loops are not ruled out', decided_by='cycle')
      end if
      call keys%finish()
   end subroutine qsma_keys

   !> `&ringdown`.
   subroutine ringdown_keys(keys, record)
      !> The group
      type(group_keys_t), intent(inout) :: keys
      !> Its record
      type(ringdown_case_t), intent(inout) :: record

      call keys%optional_integer('mode', record%mode, at_least(1))
      call keys%name_key('sensor', record%sensor)
      call keys%real_key('periods', record%periods, &
         between(real(fewest_periods, wp), real(most_periods, wp), closed_lower=.true., closed_upper=.true.))
      call keys%real_key('overlap', record%overlap, between(0.0_wp, 1.0_wp, closed_lower=.true.))
      call keys%optional_real('start', record%start, non_negative)
      call keys%finish()
   end subroutine ringdown_keys

end module microslip_io_case_modal
