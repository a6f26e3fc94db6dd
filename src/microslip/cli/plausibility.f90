!> What is right by its form, but hardly meant: units, sizes and amplitudes that no such structure has.
!>
!> The model shows Young's modulus and density by itself (`microslip_fe_model_survey`); the case is compared with them.
module microslip_cli_plausibility
   use microslip_core_kinds, only: wp
   use microslip_core_text, only: to_text
   use microslip_core_warning_list, only: severity_doubtful, severity_note, severity_wrong, warning_list_t
   use microslip_fe_interface, only: contact_interface_t
   use microslip_fe_model, only: fe_model_t
   use microslip_fe_model_survey, only: median, model_survey_t
   use microslip_fe_unit_guess, only: guess_modulus_unit, guess_stored_units, guess_unit_keys, is_material, is_usual
   use microslip_fe_selection, only: node_text
   use microslip_io_case, only: case_t, interface_case_t
   use microslip_system_pad, only: pad_t
   implicit none(type, external)
   private

   public :: check_units, check_pad, check_sizes, check_base

   !> kg/m^3: balsa to osmium.
   real(wp), parameter :: density_range(2) = [500.0_wp, 23000.0_wp]
   !> m/s: a metal whose mass matrix lost its entries beside the diagonal comes out above it.
   real(wp), parameter :: fast_sound = 7500.0_wp
   !> Young's modulus of a half space over that of the mesh at the pad, either way.
   real(wp), parameter :: other_modulus = 1.25_wp
   !> Pads of joints, m.
   real(wp), parameter :: largest_pad = 5.0_wp, smallest_pad = 1.0e-4_wp
   !> Pa, mean pressure of a joint: below, the force was hardly meant in N; above, metals yield; above, nothing bears it.
   real(wp), parameter :: smallest_pressure = 1.0e3_wp, yield_pressure = 2.0e9_wp, largest_pressure = 1.0e11_wp
   !> Amplitudes over the diagonal of the structure: beyond what linear elastic bodies do; beyond the structure itself.
   real(wp), parameter :: large_motion = 0.1_wp
   !> Force under a translation, as a part of the sum of the sizes of its terms, that is not rounding.
   real(wp), parameter :: held_by_more = 1.0e-4_wp
   !> m/s^2, of a base: 10 000 g.
   real(wp), parameter :: largest_acceleration = 1.0e5_wp

contains

   !> Units of the model.
   subroutine check_units(case, survey, warnings)
      type(case_t), intent(in) :: case
      type(model_survey_t), intent(in) :: survey
      type(warning_list_t), intent(inout) :: warnings
      real(wp) :: young, density
      character(len=:), allocatable :: shown, likely

      young = median(survey%young)
      density = median(survey%density)
      if (density <= 0.0_wp) then
         if (survey%volume > 0.0_wp) density = sum(survey%mass)/(3.0_wp*survey%volume)
      end if
      shown = '&model: mesh and matrices show a density of '//to_text(density, 3)//' kg/m^3'
      if (young > 0.0_wp) shown = shown//" and Young's modulus "//to_text(young, 3)//' Pa'
      if (young > 0.0_wp) then
         if (is_material(young, density)) then
            if (sqrt(young/density) > fast_sound .and. is_diagonal(survey)) call warnings%add(severity_doubtful, shown// &
               & ', stiffer for its mass than metals are, and the mass matrix is diagonal: the diagonal of a consistent mass ' &
               & //'matrix alone has less than half of the mass')
            return
         end if
         if (is_usual(young) .and. density >= density_range(1) .and. density <= density_range(2) &
            & .and. young < 1.0e9_wp) then
            likely = guess()
            if (likely == '') return
            call warnings%add(severity_doubtful, shown//', which is soft: rubber, or '//likely)
            return
         end if
      else if (density >= density_range(1) .and. density <= density_range(2)) then
         return
      end if
      likely = ''
      if (young > 0.0_wp) likely = guess()
      if (likely /= '') likely = '; likely '//likely
      call warnings%add(severity_wrong, shown//', which is no structural material'//likely//': are the units right?')

   contains

      function guess() result(text)
         character(len=:), allocatable :: text
         if (case%model%source == 'calculix') then
            text = guess_unit_keys(young, density, trim(case%model%unit_length), trim(case%model%unit_mass), &
               & trim(case%model%unit_time))
            if (text /= '') text = text//' is meant'
         else
            text = guess_stored_units(young, density)
            if (text /= '') text = 'the file holds '//text//', where m, N/m and kg are expected'
         end if
      end function guess

   end subroutine check_units

   !> Whether the mass has no entries beside the diagonal.
   pure logical function is_diagonal(survey)
      type(model_survey_t), intent(in) :: survey
      is_diagonal = .not. sum(survey%sums%mass_size) > sum(survey%sums%mass_diagonal)*(1.0_wp + epsilon(1.0_wp)*1.0e3_wp)
   end function is_diagonal

   !> A pad: its size, the modulus of its half spaces against the mesh, its pressure.
   subroutine check_pad(case, record, survey, pad, warnings)
      type(case_t), intent(in) :: case
      type(interface_case_t), intent(in) :: record
      type(model_survey_t), intent(in) :: survey
      type(pad_t), intent(in) :: pad
      type(warning_list_t), intent(inout) :: warnings
      character(len=:), allocatable :: where
      real(wp) :: length
      integer :: side

      where = "interface '"//trim(record%name)//"': "
      length = maxval(maxval(pad%contact%position, 2) - minval(pad%contact%position, 2))
      if (length > largest_pad .or. length < smallest_pad) call warnings%add(severity_wrong, where//'the pad is '// &
         & to_text(length, 3)//' m long: '//length_hint(case, length > largest_pad))
      if (allocated(record%initial_pressure)) then
         if (record%initial_pressure > 0.0_wp .and. record%initial_pressure < smallest_pressure) &
            & call warnings%add(severity_doubtful, where//'initial_pressure = '//to_text(record%initial_pressure)// &
            & ' Pa is next to nothing: was MPa meant?')
         if (record%initial_pressure > yield_pressure) call warnings%add(severity_wrong, where//'initial_pressure = '// &
            & to_text(record%initial_pressure)//' Pa is more than metals bear')
      end if
      if (.not. allocated(record%young_modulus)) return
      do side = 1, size(record%young_modulus)
         call check_modulus(record%young_modulus(side), modulus_at(survey, pad%contact, side), 'AB'(side:side))
      end do
      if (size(record%young_modulus) == 1) then
         if (any(pad%contact%node_b > 0)) &
            & call check_modulus(record%young_modulus(1), modulus_at(survey, pad%contact, 2), 'B')
      end if

   contains

      subroutine check_modulus(given, shown, body)
         !> Pa, 0 where nothing is shown
         real(wp), intent(in) :: given, shown
         character(len=1), intent(in) :: body
         character(len=:), allocatable :: unit

         unit = ''
         if (shown > 0.0_wp) then
            if (given < other_modulus*shown .and. shown < other_modulus*given) return
            unit = guess_modulus_unit(given, shown)
            if (unit /= '') unit = ': was it meant in '//unit//'?'
            if (unit == '') unit = ', by a factor of '//to_text(max(given/shown, shown/given), 3)//': is it the same material?'
            call warnings%add(merge(severity_wrong, severity_doubtful, index(unit, 'meant') > 0), where//'young_modulus = '// &
               & to_text(given)//' Pa of body '//body//' is not the '//to_text(shown, 4)//' Pa that the mesh shows at the ' &
               & //'pad'//unit)
         else if (.not. is_usual(given)) then
            unit = guess_modulus_unit(given, 1.0e11_wp)
            if (unit /= '') unit = ': was it meant in '//unit//'?'
            call warnings%add(severity_wrong, where//'young_modulus = '//to_text(given)//' Pa of body '//body// &
               & ' is that of no structural material'//unit)
         end if
      end subroutine check_modulus

   end subroutine check_pad

   !> Median modulus that the nodes of a pad's side show, of all nodes if these do not; 0 if none does.
   pure real(wp) function modulus_at(survey, contact, side)
      type(model_survey_t), intent(in) :: survey
      type(contact_interface_t), intent(in) :: contact
      !> 1 for A, 2 for B
      integer, intent(in) :: side
      real(wp), allocatable :: values(:)

      if (side == 1) values = survey%young(contact%node_a)
      if (side == 2) values = survey%young(pack(contact%node_b, contact%node_b > 0))
      modulus_at = median(values)
      if (modulus_at <= 0.0_wp .and. (side == 1 .or. any(contact%node_b > 0))) modulus_at = median(survey%young)
   end function modulus_at

   !> What a length that is too large or too small probably is.
   pure function length_hint(case, is_large) result(text)
      type(case_t), intent(in) :: case
      logical, intent(in) :: is_large
      character(len=:), allocatable :: text

      if (case%model%source == 'calculix') then
         text = "unit_length = '"//trim(case%model%unit_length)//"', "
         if (is_large) text = text//"was 'mm' meant?"
         if (.not. is_large) text = text//"was a larger unit meant?"
      else if (is_large) then
         text = 'the coordinates of the file are likely in mm, where m is expected'
      else
         text = 'are the coordinates of the file in m?'
      end if
   end function length_hint

   !> A moving base: the structure must be free of forces when all rows move alike.
   subroutine check_base(case, model, survey, warnings)
      type(case_t), intent(in) :: case
      type(fe_model_t), intent(in) :: model
      type(model_survey_t), intent(in) :: survey
      type(warning_list_t), intent(inout) :: warnings
      logical, allocatable :: held(:)
      integer :: k

      held = survey%away .and. .not. survey%grounded .and. survey%held > held_by_more
      if (.not. any(held)) return
      do k = 1, size(case%loads)
         if (case%loads(k)%kind /= 'base') cycle
         call warnings%add(severity_wrong, "load '"//trim(case%loads(k)%name)//"': when all rows move alike, forces act on "// &
            & to_text(count(held))//' nodes away from supports, first '//node_text(model, findloc(held, .true., 1))// &
            & ': rows that are rotations of a rigid body, or a constraint that a translation breaks; M r is not the inertia ' &
            & //'force of a moving base then')
      end do
   end subroutine check_base

   !> Loads and amplitudes against the size of the structure and of the pads.
   subroutine check_sizes(case, model, pads, warnings)
      type(case_t), intent(in) :: case
      type(fe_model_t), intent(in) :: model
      type(pad_t), intent(in) :: pads(:)
      type(warning_list_t), intent(inout) :: warnings
      real(wp) :: size_of_all
      integer :: k

      size_of_all = norm2(maxval(model%coordinates, 2) - minval(model%coordinates, 2))
      if (allocated(case%preload%interface_force)) then
         do k = 1, min(size(pads), size(case%preload%interface_force))
            call check_pressure('&preload: interface_force = '//to_text(case%preload%interface_force(k))//" N gives '"// &
               & trim(pads(k)%contact%name)//"'", case%preload%interface_force(k), sum(pads(k)%grid%area), warnings)
         end do
      end if
      call check_scaled_loads()
      if (case%runs('qsma')) then
         if (allocated(case%qsma%largest_amplitude)) call check_amplitude('&qsma: largest_amplitude', case%qsma%largest_amplitude)
         if (allocated(case%qsma%amplitudes)) call check_amplitude('&qsma: amplitudes', maxval(case%qsma%amplitudes))
      end if
      if (case%runs('epmc') .and. allocated(case%epmc%amplitude_range)) &
         & call check_amplitude('&epmc: amplitude_range', maxval(case%epmc%amplitude_range))
      do k = 1, size(case%excitations)
         call check_excitation(case%excitations(k)%load, case%excitations(k)%amplitude, '&excitation '//to_text(k)//': amplitude')
      end do
      if (case%runs('harmonic_balance') .and. allocated(case%harmonic_balance%levels)) &
         & call check_excitation(case%harmonic_balance%load, maxval(abs(case%harmonic_balance%levels)), '&harmonic_balance: levels')
      if (allocated(case%preload%load_scale)) then
         do k = 1, min(size(case%preload%load_scale), size(case%preload%loads))
            call check_excitation(case%preload%loads(k), case%preload%load_scale(k), '&preload: load_scale')
         end do
      end if

   contains

      !> Loads of given sizes: together they press no harder on all pads than a joint bears.
      subroutine check_scaled_loads()
         real(wp) :: force, area
         integer :: i, load

         if (.not. allocated(case%preload%load_scale)) return
         force = 0.0_wp
         do i = 1, min(size(case%preload%load_scale), size(case%preload%loads))
            load = case%find_load(case%preload%loads(i))
            if (load == 0) cycle
            if (case%loads(load)%kind == 'nodes') &
               & force = force + abs(case%preload%load_scale(i))*sum(abs(case%loads(load)%size))
         end do
         area = sum([(sum(pads(i)%grid%area), i=1, size(pads))])
         if (force > yield_pressure*area) call check_pressure('&preload: the loads times load_scale, '//to_text(force)// &
            & ' N in all, give the interfaces', force, area, warnings)
      end subroutine check_scaled_loads

      !> A displacement.
      subroutine check_amplitude(place, amplitude)
         character(len=*), intent(in) :: place
         !> m
         real(wp), intent(in) :: amplitude

         if (abs(amplitude) <= large_motion*size_of_all) return
         call warnings%add(severity_wrong, place//' = '//to_text(amplitude)//' m is '//to_text(abs(amplitude)/size_of_all, 3)// &
            & ' times the size of the structure ('//to_text(size_of_all, 3)//' m): amplitudes are in m, was '// &
            & trim(merge('mm', 'um', abs(amplitude)*1.0e-3_wp <= large_motion*size_of_all))//' meant?')
      end subroutine check_amplitude

      !> The amplitude of a load that is a motion or an acceleration.
      subroutine check_excitation(name, amplitude, place)
         character(len=*), intent(in) :: name, place
         real(wp), intent(in) :: amplitude
         integer :: load

         load = case%find_load(name)
         if (load == 0) return
         associate (record => case%loads(load))
            if (record%kind == 'motion' .and. record%motion == 'translation') then
               call check_amplitude(place//" of the motion '"//trim(name)//"'", amplitude)
            else if (record%kind == 'motion') then
               if (abs(amplitude) > 1.0_wp) call warnings%add(severity_wrong, place//" of the rotation '"//trim(name)//"' = "// &
                  & to_text(amplitude)//' rad: were degrees meant?')
            else if (record%kind == 'base') then
               if (abs(amplitude) > largest_acceleration) call warnings%add(severity_doubtful, place//" of the base load '"// &
                  & trim(name)//"' = "//to_text(amplitude)//' m/s^2 is more than 10000 g: were mm/s^2 meant?')
            end if
         end associate
      end subroutine check_excitation

   end subroutine check_sizes

   !> The mean pressure of pads under a force.
   subroutine check_pressure(cause, force, area, warnings)
      !> Begin of the message
      character(len=*), intent(in) :: cause
      !> N, m^2
      real(wp), intent(in) :: force, area
      type(warning_list_t), intent(inout) :: warnings
      character(len=:), allocatable :: found

      if (.not. area > 0.0_wp) return
      found = cause//' a mean pressure of '//to_text(force/area, 3)//' Pa'
      if (force/area > largest_pressure) then
         call warnings%add(severity_wrong, found//', which nothing bears: are the units of force and mesh right?')
      else if (force/area > yield_pressure) then
         call warnings%add(severity_doubtful, found//', at which metals yield')
      else if (force/area < smallest_pressure .and. force > 0.0_wp) then
         call warnings%add(severity_note, found//', next to nothing: was kN meant?')
      end if
   end subroutine check_pressure

end module microslip_cli_plausibility
