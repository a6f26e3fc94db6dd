!> From the records of a case to what moves the structure: excitations, and the harmonics to be measured under a sine.
module microslip_cli_motion_input
   use microslip_analysis_excitation, only: excitation_t, kind_half_sine, kind_harmonic, kind_stepped_sine, &
      & kind_swept_sine, kind_table
   use microslip_analysis_harmonic_meter, only: harmonic_meter_t
   use microslip_cli_scene, only: scene_t
   use microslip_core_kinds, only: wp, pi
   use microslip_io_case, only: case_t, excitation_case_t
   implicit none(type, external)
   private

   public :: excitations_of, meter_of

contains

   !> All excitations of a case.
   function excitations_of(case, scene) result(excitations)
      type(case_t), intent(in) :: case
      type(scene_t), intent(in) :: scene
      type(excitation_t), allocatable :: excitations(:)
      integer :: k

      allocate (excitations(size(case%excitations)))
      do k = 1, size(excitations)
         associate (record => case%excitations(k), excitation => excitations(k))
            excitation%load = scene%load_index(case%find_load(record%load))
            excitation%amplitude = record%amplitude
            excitation%start = record%start
            excitation%phase = record%phase*pi/180.0_wp
            excitation%ramp = record%ramp
            select case (trim(record%kind))
            case ('half_sine')
               excitation%kind = kind_half_sine
               excitation%duration = record%duration
               if (allocated(record%times)) excitation%times = record%times
            case ('harmonic')
               excitation%kind = kind_harmonic
               excitation%frequency = record%frequency
            case ('stepped_sine')
               excitation%kind = kind_stepped_sine
               excitation%frequencies = frequencies_of(record)
               excitation%periods = spread(record%settle_periods + windows_of(record)*record%measure_periods, 1, &
                  & size(excitation%frequencies))
            case ('swept_sine')
               excitation%kind = kind_swept_sine
               excitation%frequency = record%frequency_from
               excitation%frequency_to = record%frequency_to
               excitation%logarithmic = record%sweep == 'log'
               ! Octaves per minute.
               excitation%rate = record%rate/merge(60.0_wp, 1.0_wp, excitation%logarithmic)
            case ('file')
               excitation%kind = kind_table
               excitation%table = scene%tables(k)%points
               excitation%stays = case%loads(case%find_load(record%load))%kind == 'motion'
            end select
         end associate
      end do
   end function excitations_of

   !> The frequencies of a stepped sine, Hz.
   pure function frequencies_of(record) result(frequencies)
      type(excitation_case_t), intent(in) :: record
      real(wp), allocatable :: frequencies(:)
      integer :: k

      if (allocated(record%frequencies)) then
         frequencies = record%frequencies
      else
         associate (n => record%frequency_count)
            ! Both ends to the last bit, however far apart.
            frequencies = [((record%frequency_from*(n - 1 - k) + record%frequency_to*k)/(n - 1), k=0, n - 1)]
         end associate
      end if
   end function frequencies_of

   !> Most windows at a frequency.
   pure integer function windows_of(record)
      type(excitation_case_t), intent(in) :: record
      windows_of = merge(record%most_windows, 1, allocated(record%steady_tolerance))
   end function windows_of

   !> What is measured under the stepped or swept sine of a case; nothing if there is none.
   function meter_of(case) result(meter)
      type(case_t), intent(in) :: case
      type(harmonic_meter_t) :: meter
      integer :: k

      do k = 1, size(case%excitations)
         associate (record => case%excitations(k))
            if (record%kind /= 'stepped_sine' .and. record%kind /= 'swept_sine') cycle
            meter%excitation = k
            meter%harmonics = record%harmonics
            meter%window = record%measure_periods
            meter%settling = record%settle_periods
            meter%most_windows = windows_of(record)
            if (allocated(record%steady_tolerance)) meter%tolerance = record%steady_tolerance
         end associate
      end do
   end function meter_of

end module microslip_cli_motion_input
