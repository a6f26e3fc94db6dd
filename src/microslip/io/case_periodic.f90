!> Keys of `&harmonic_balance` and `&epmc`, the analyses of periodic motions (doc/namelists.md).
module microslip_io_case_periodic
   use microslip_core_kinds, only: wp
   use microslip_core_text, only: to_text
   use microslip_io_case, only: harmonic_balance_case_t, epmc_case_t
   use microslip_io_group_keys, only: group_keys_t
   use microslip_io_value_range, only: positive, at_least, between
   implicit none(type, external)
   private

   public :: harmonic_balance_keys, epmc_keys

   !> Most levels, harmonics, samples, points.
   integer, parameter :: most_levels = 1000, most_harmonics = 1000, most_samples = 100000, most_points = 1000000
   !> Most corrections of a point.
   integer, parameter :: most_iterations = 1000
   !> Part of the load that rounding of contact forces of its size leaves of a balance, with a margin; larger contact forces
   !> leave more, which the analysis tells before it begins (`noise_of` in analysis/periodic_balance.f90).
   real(wp), parameter :: smallest_tolerance = 1.0e-13_wp

contains

   !> `&harmonic_balance`.
   subroutine harmonic_balance_keys(keys, record)
      !> The group
      type(group_keys_t), intent(inout) :: keys
      !> Its record
      type(harmonic_balance_case_t), intent(inout) :: record

      call keys%name_key('load', record%load, required=.true.)
      call keys%name_key('sensor', record%sensor)
      call keys%real_list('levels', record%levels, positive, [1, most_levels], required=.true.)
      call keys%real_list('frequency_range', record%frequency_range, positive, [2, 2], required=.true.)
      call series_keys(keys, record%harmonics, record%samples)
      call keys%optional_real('frequency_step', record%frequency_step, positive)
      call keys%real_key('response_step', record%response_step, between(0.0_wp, 1.0_wp, closed_upper=.true.))
      call keys%real_key('tolerance', record%tolerance, between(smallest_tolerance, 1.0_wp, closed_lower=.true.))
      call keys%integer_key('max_iterations', record%max_iterations, at_least(1, most_iterations))
      call keys%integer_key('max_points', record%max_points, at_least(1, most_points))
      call keys%finish()
   end subroutine harmonic_balance_keys

   !> `&epmc`.
   subroutine epmc_keys(keys, record)
      !> The group
      type(group_keys_t), intent(inout) :: keys
      !> Its record
      type(epmc_case_t), intent(inout) :: record

      call keys%integer_key('mode', record%mode, at_least(1))
      call keys%name_key('sensor', record%sensor)
      call keys%real_list('amplitude_range', record%amplitude_range, positive, [2, 2], required=.true.)
      call keys%integer_key('points', record%points, at_least(2, most_points))
      call series_keys(keys, record%harmonics, record%samples)
      call keys%real_key('response_step', record%response_step, between(0.0_wp, 1.0_wp, closed_upper=.true.))
      call keys%real_key('tolerance', record%tolerance, between(smallest_tolerance, 1.0_wp, closed_lower=.true.))
      call keys%integer_key('max_iterations', record%max_iterations, at_least(1, most_iterations))
      call keys%integer_key('max_points', record%max_points, at_least(1, most_points))
      call keys%finish()
   end subroutine epmc_keys

   !> Harmonics and samples of a period.
   subroutine series_keys(keys, harmonics, samples)
      type(group_keys_t), intent(inout) :: keys
      integer, intent(inout) :: harmonics, samples

      call keys%integer_key('harmonics', harmonics, at_least(1, most_harmonics))
      call keys%integer_key('samples', samples, at_least(3, most_samples))
      if (keys%is_reading .and. samples <= 2*harmonics) &
         call keys%fault('samples', 'more than twice the harmonics, > '//to_text(2*harmonics))
   end subroutine series_keys

end module microslip_io_case_periodic
