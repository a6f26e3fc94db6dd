!> Which unit was meant: Young's modulus and density that a model shows, against those of materials.
!>
!> With lengths, masses and times in units of l, m and t (SI) instead of those assumed, stiffness / length and mass / volume
!> turn into
!>
!>     E' = E (m/l) t^-2,        rho' = rho m l^-3        (ratios of the units)
module microslip_fe_unit_guess
   use microslip_core_kinds, only: wp
   use microslip_core_text, only: to_text
   implicit none(type, external)
   private

   public :: is_usual, is_material, guess_unit_keys, guess_stored_units, guess_modulus_unit, unit_in_si

   !> Pa, kg/m^3, and m/s of sqrt(E/rho): polymers to tungsten carbide, wood to osmium, lead to beryllium.
   real(wp), parameter :: young_range(2) = [1.0e9_wp, 1.3e12_wp], density_range(2) = [500.0_wp, 23000.0_wp], &
      & speed_range(2) = [800.0_wp, 13500.0_wp]
   !> Below: rubber; nothing else structural is softer.
   real(wp), parameter :: softest = 1.0e6_wp

contains

   !> Whether constants are those of a structural material.
   pure logical function is_material(young, density)
      !> Pa, kg/m^3
      real(wp), intent(in) :: young, density
      is_material = within(young, young_range) .and. within(density, density_range)
      if (is_material) is_material = within(sqrt(young/density), speed_range)
   end function is_material

   !> Whether a modulus may be that of a solid, rubber included.
   pure logical function is_usual(young)
      !> Pa
      real(wp), intent(in) :: young
      is_usual = within(young, [softest, young_range(2)])
   end function is_usual

   pure logical function within(value, range)
      real(wp), intent(in) :: value, range(2)
      within = value >= range(1) .and. value <= range(2)
   end function within

   !> Unit keys of CalculiX files under which the constants are those of a material, in words; '' if there are none.
   pure function guess_unit_keys(young, density, length, mass, time) result(text)
      !> Pa, kg/m^3, as read
      real(wp), intent(in) :: young, density
      !> Units as given in the case: 'm', 'mm', 'um'; 'kg', 't', 'g'; 's', 'ms'
      character(len=*), intent(in) :: length, mass, time
      character(len=:), allocatable :: text
      character(len=2), parameter :: lengths(3) = ['mm', 'm ', 'um'], masses(3) = ['t ', 'kg', 'g '], times(2) = ['s ', 'ms']
      real(wp) :: l, m, t
      integer :: i, j, k, changes, fewest

      text = ''
      fewest = 4
      do i = 1, 3
         do j = 1, 3
            do k = 1, 2
               l = unit_in_si(lengths(i))/unit_in_si(length)
               m = unit_in_si(masses(j))/unit_in_si(mass)
               t = unit_in_si(times(k))/unit_in_si(time)
               if (.not. is_material(young*m/(l*t**2), density*m/l**3)) cycle
               changes = count([lengths(i) /= length, masses(j) /= mass, times(k) /= time])
               if (changes >= fewest) cycle
               fewest = changes
               text = "unit_length = '"//trim(lengths(i))//"', unit_mass = '"//trim(masses(j))//"', unit_time = '"// &
                  & trim(times(k))//"' (E "//to_text(young*m/(l*t**2), 3)//' Pa, density '//to_text(density*m/l**3, 3)//' kg/m^3)'
            end do
         end do
      end do
   end function guess_unit_keys

   !> Units of stored numbers under which the constants are those of a material, in words; '' if there are none.
   pure function guess_stored_units(young, density) result(text)
      !> Pa, kg/m^3, as if all was in SI units
      real(wp), intent(in) :: young, density
      character(len=:), allocatable :: text
      character(len=20), parameter :: places(2) = ['                    ', 'coordinates in mm   '], &
         & forces(2) = ['                    ', 'stiffness in N/mm   '], &
         & masses(3) = ['                    ', 'mass in t           ', 'mass in g           ']
      real(wp) :: l, f, m
      integer :: i, j, k, changes, fewest

      text = ''
      fewest = 4
      do i = 1, 2
         do j = 1, 2
            do k = 1, 3
               l = merge(1.0_wp, 1.0e-3_wp, i == 1)
               f = merge(1.0_wp, 1.0e3_wp, j == 1)
               m = merge(1.0_wp, merge(1.0e3_wp, 1.0e-3_wp, k == 2), k == 1)
               if (.not. is_material(young*f/l, density*m/l**3)) cycle
               changes = count([i, j, k] > 1)
               if (changes >= fewest) cycle
               fewest = changes
               text = joined([character(len=20) :: places(i), forces(j), masses(k)])
            end do
         end do
      end do
   end function guess_stored_units

   !> The words that are not blank, with commas.
   pure function joined(words) result(text)
      character(len=*), intent(in) :: words(:)
      character(len=:), allocatable :: text
      integer :: k

      text = ''
      do k = 1, size(words)
         if (words(k) == '') cycle
         if (text /= '') text = text//', '
         text = text//trim(words(k))
      end do
   end function joined

   !> In which unit a modulus was meant, '' if none is near: given / meant is a power of 1000.
   pure function guess_modulus_unit(given, meant) result(unit)
      !> Pa
      real(wp), intent(in) :: given, meant
      character(len=:), allocatable :: unit

      select case (power_of_thousand(given/meant))
      case (-1)
         unit = 'kPa'
      case (-2)
         unit = 'MPa (N/mm^2)'
      case (-3)
         unit = 'GPa'
      case (1)
         unit = 'mPa'
      case default
         unit = ''
      end select
   end function guess_modulus_unit

   !> The power of 1000 that a ratio is within a factor of 5 of; 0 if it is near 1 or between two.
   pure integer function power_of_thousand(ratio)
      real(wp), intent(in) :: ratio
      real(wp) :: power

      power_of_thousand = 0
      if (.not. ratio > 0.0_wp) return
      power = log10(ratio)/3.0_wp
      if (abs(power - nint(power)) < log10(5.0_wp)/3.0_wp) power_of_thousand = nint(power)
   end function power_of_thousand

   !> A unit in SI units.
   pure real(wp) function unit_in_si(name)
      !> 'm', 'mm', 'um'; 'kg', 't', 'g'; 's', 'ms'
      character(len=*), intent(in) :: name

      select case (trim(name))
      case ('mm', 'ms', 'g')
         unit_in_si = 1.0e-3_wp
      case ('um')
         unit_in_si = 1.0e-6_wp
      case ('t')
         unit_in_si = 1.0e3_wp
      case default
         unit_in_si = 1.0_wp
      end select
   end function unit_in_si

end module microslip_fe_unit_guess
