!> Time functions of the loads, t counted from `start`:
!>
!>     half_sine     A sin(pi t/T) for 0 <= t <= T, once or at several times              (paper eq. (21))
!>     harmonic      A w(t) cos(2 pi c(t) + phase),   c = f t                             cycles since the start
!>     stepped_sine  the same, c' = f_j for a given number of periods, step after step
!>     swept_sine    the same, c' = f + r t (linear) or f 2^(r t) (logarithmic)
!>     table         A times a given function, straight lines between its points
!> w(t) = sin^2(pi t/(2 ramp)) up to the end of the ramp, then 1. c is continuous, and so is the phase. Stepped and
!> swept sines and tables are zero behind their end; a table that stays keeps its last value.
module microslip_analysis_excitation
   use microslip_core_kinds, only: wp, pi
   implicit none(type, external)
   private

   public :: excitation_t, load_amplitudes, end_of_all
   public :: kind_half_sine, kind_harmonic, kind_stepped_sine, kind_swept_sine, kind_table

   integer, parameter :: kind_half_sine = 1, kind_harmonic = 2, kind_stepped_sine = 3, kind_swept_sine = 4, kind_table = 5

   !> A load pattern times a function of time.
   type :: excitation_t
      !> Index of the load in the system
      integer :: load = 0
      integer :: kind = kind_half_sine
      !> Factor on the load pattern
      real(wp) :: amplitude = 0.0_wp
      !> Nothing before this time, s
      real(wp) :: start = 0.0_wp
      !> half_sine: length of a pulse, s
      real(wp) :: duration = 0.0_wp
      !> half_sine: begins of the pulses after `start`, s; not allocated: one, at `start`
      real(wp), allocatable :: times(:)
      !> harmonic, and begin of a sweep: Hz
      real(wp) :: frequency = 0.0_wp
      !> Sines: of the cosine, rad, and s
      real(wp) :: phase = 0.0_wp, ramp = 0.0_wp
      !> swept_sine: Hz; Hz/s or octaves per second, > 0; whether the latter
      real(wp) :: frequency_to = 0.0_wp, rate = 0.0_wp
      logical :: logarithmic = .false.
      !> stepped_sine: (steps) Hz, and how many periods each of them lasts
      real(wp), allocatable :: frequencies(:)
      integer, allocatable :: periods(:)
      !> table: (2, points) time, ascending, and value
      real(wp), allocatable :: table(:, :)
      !> table: whether the last value goes on behind its end
      logical :: stays = .false.
   contains
      procedure :: at
      procedure :: angle
      procedure :: cycles
      procedure :: frequency_at
      procedure :: end => end_of
   end type excitation_t

contains

   !> The factor on the load pattern at a time.
   pure real(wp) function at(self, time)
      class(excitation_t), intent(in) :: self
      !> s
      real(wp), intent(in) :: time
      real(wp) :: t

      t = time - self%start
      at = 0.0_wp
      if (t < 0.0_wp) return
      if (time > self%end()) then
         if (self%stays) at = self%amplitude*self%table(2, size(self%table, 2))
         return
      end if
      select case (self%kind)
      case (kind_half_sine)
         at = self%amplitude*pulses(self, t)
      case (kind_table)
         at = self%amplitude*table_value(self%table, t)
      case default
         at = self%amplitude*cos(self%angle(time))
         if (t < self%ramp) at = at*sin(0.5_wp*pi*t/self%ramp)**2
      end select
   end function at

   !> Sum of the half-sines at a time.
   pure real(wp) function pulses(self, t)
      class(excitation_t), intent(in) :: self
      real(wp), intent(in) :: t
      integer :: k

      pulses = 0.0_wp
      if (.not. allocated(self%times)) then
         pulses = sin(pi*t/self%duration)
         return
      end if
      do k = 1, size(self%times)
         if (t >= self%times(k) .and. t <= self%times(k) + self%duration) &
            & pulses = pulses + sin(pi*(t - self%times(k))/self%duration)
      end do
   end function pulses

   !> Straight lines between the points of a table, zero outside.
   pure real(wp) function table_value(table, t)
      real(wp), intent(in) :: table(:, :)
      real(wp), intent(in) :: t
      integer :: low, high, middle

      table_value = 0.0_wp
      low = 1
      high = size(table, 2)
      if (t < table(1, low) .or. t > table(1, high)) return
      do while (high - low > 1)
         middle = (low + high)/2
         if (table(1, middle) <= t) then
            low = middle
         else
            high = middle
         end if
      end do
      table_value = table(2, low) + (table(2, high) - table(2, low))*(t - table(1, low))/(table(1, high) - table(1, low))
   end function table_value

   !> Argument of the cosine of a sine, rad.
   pure real(wp) function angle(self, time)
      class(excitation_t), intent(in) :: self
      !> s
      real(wp), intent(in) :: time
      real(wp) :: c

      ! Whole cycles are left out: the cosine of large numbers would lose digits.
      c = self%cycles(time)
      angle = 2.0_wp*pi*(c - aint(c)) + self%phase
   end function angle

   !> Cycles of a sine since its start; they stay as they are behind its end.
   pure real(wp) function cycles(self, time)
      class(excitation_t), intent(in) :: self
      !> s
      real(wp), intent(in) :: time
      real(wp) :: t, growth, length
      integer :: j

      t = max(0.0_wp, time - self%start)
      cycles = 0.0_wp
      select case (self%kind)
      case (kind_harmonic)
         cycles = self%frequency*t
      case (kind_swept_sine)
         t = min(t, sweep_length(self))
         growth = sign(self%rate, self%frequency_to - self%frequency)
         if (self%logarithmic) then
            cycles = self%frequency*(2.0_wp**(growth*t) - 1.0_wp)/(growth*log(2.0_wp))
         else
            cycles = (self%frequency + 0.5_wp*growth*t)*t
         end if
      case (kind_stepped_sine)
         do j = 1, size(self%frequencies)
            length = self%periods(j)/self%frequencies(j)
            cycles = cycles + self%frequencies(j)*min(t, length)
            if (t < length) return
            t = t - length
         end do
      end select
   end function cycles

   !> Frequency of a sine at a time, Hz; behind the end of a stepped or swept one it is the last.
   pure real(wp) function frequency_at(self, time)
      class(excitation_t), intent(in) :: self
      !> s
      real(wp), intent(in) :: time
      real(wp) :: t, growth
      integer :: j

      t = max(0.0_wp, time - self%start)
      frequency_at = self%frequency
      select case (self%kind)
      case (kind_swept_sine)
         growth = sign(self%rate, self%frequency_to - self%frequency)*min(t, sweep_length(self))
         frequency_at = merge(self%frequency*2.0_wp**growth, self%frequency + growth, self%logarithmic)
      case (kind_stepped_sine)
         do j = 1, size(self%frequencies)
            frequency_at = self%frequencies(j)
            t = t - self%periods(j)/self%frequencies(j)
            if (t < 0.0_wp) return
         end do
      end select
   end function frequency_at

   !> How long a sweep takes, s.
   pure real(wp) function sweep_length(self)
      class(excitation_t), intent(in) :: self

      if (self%logarithmic) then
         sweep_length = abs(log(self%frequency_to/self%frequency))/(log(2.0_wp)*self%rate)
      else
         sweep_length = abs(self%frequency_to - self%frequency)/self%rate
      end if
   end function sweep_length

   !> When the excitation ends, s; a harmonic one never does.
   pure real(wp) function end_of(self)
      class(excitation_t), intent(in) :: self

      select case (self%kind)
      case (kind_half_sine)
         end_of = self%start + self%duration
         if (allocated(self%times)) end_of = end_of + maxval(self%times)
      case (kind_stepped_sine)
         end_of = self%start + sum(self%periods/self%frequencies)
      case (kind_swept_sine)
         end_of = self%start + sweep_length(self)
      case (kind_table)
         end_of = self%start + self%table(1, size(self%table, 2))
      case default
         end_of = huge(1.0_wp)
      end select
   end function end_of

   !> When the last of some excitations ends, s; zero if there is none.
   pure real(wp) function end_of_all(excitations)
      type(excitation_t), intent(in) :: excitations(:)
      integer :: k

      end_of_all = 0.0_wp
      do k = 1, size(excitations)
         end_of_all = max(end_of_all, excitations(k)%end())
      end do
   end function end_of_all

   !> Amplitudes of all loads: what stays on, plus the excitations at this time, (loads).
   pure function load_amplitudes(constant, excitations, time) result(amplitude)
      !> (loads) amplitudes that stay on
      real(wp), intent(in) :: constant(:)
      type(excitation_t), intent(in) :: excitations(:)
      !> s
      real(wp), intent(in) :: time
      real(wp) :: amplitude(size(constant))
      integer :: k

      amplitude = constant
      do k = 1, size(excitations)
         amplitude(excitations(k)%load) = amplitude(excitations(k)%load) + excitations(k)%at(time)
      end do
   end function load_amplitudes

end module microslip_analysis_excitation
