!> What the groups of a case say about each other: names that must exist, counts that must agree, groups and
!> keys that the chosen analyses would ignore.
module microslip_io_case_checks
   use microslip_analysis_transient, only: most_steps
   use microslip_core_kinds, only: wp
   use microslip_core_nearest_name, only: nearest_name, quoted_list
   use microslip_core_text, only: to_text, lower_case
   use microslip_io_case, only: case_t, excitation_case_t, name_length
   use microslip_io_group_keys, only: group_keys_t
   implicit none(type, external)
   private

   public :: check_case

contains

   !> Check everything that involves more than one group; values with a fault are left out.
   subroutine check_case(groups, input)
      !> All groups of the file, already read; faults are noted with the group they belong to
      type(group_keys_t), intent(inout) :: groups(:)
      !> The case; an interface's topography is filled in where there is only one
      type(case_t), intent(inout) :: input
      character(len=name_length) :: interfaces(size(input%interfaces)), topographies(size(input%topographies)), &
         loads(size(input%loads))
      integer :: k

      interfaces = input%interfaces%name
      topographies = input%topographies%name
      loads = input%loads%name
      call check_names(groups, 'interface', interfaces)
      call check_names(groups, 'topography', topographies)
      call check_names(groups, 'load', loads)
      do k = 1, size(groups)
         if (groups(k)%name == 'interface') call check_topography_name(groups(k), input, topographies)
      end do
      do k = 1, size(groups)
         select case (groups(k)%name)
         case ('case')
            call check_first(groups(k), input)
         case ('topography')
            call check_topography_use(groups(k), input)
         case ('load')
            call check_load_use(groups(k), input)
            call check_motion(groups(k), input, interfaces)
         case ('interface')
            if (.not. input%runs('preload') .and. allocated(input%analyses)) call groups(k)%ignored(['potential_margin'], &
               "with 'preload' in the analyses of &case (without it all points take part)")
         case ('contact')
            if (input%contact%normal_law == 'velocity' .and. allocated(input%analyses) .and. .not. (input%runs('transient') .or. &
               input%runs('settling'))) call groups(k)%fault('normal_law', "'gap': the others are for the time integration "// &
               "('transient', 'settling'), this one would be ignored here")
            if (input%contact%compliance == 'fft' .and. any(input%interfaces%grid == 'fe_nodes')) call groups(k)%fault( &
               'compliance', "'auto' or 'dense': an interface with grid = 'fe_nodes' has no half space")
         case ('damping')
            call check_damping(groups(k), input)
         case ('preload')
            call check_preload(groups(k), input, loads)
         case ('excitation')
            call check_excitation(groups(k), input, loads)
         case ('transient')
            call check_transient(groups(k), input)
         case ('settling')
            call check_settling(groups(k), input, loads)
         case ('qsma')
            call check_mode(groups(k), input, 'mode', 'qsma', input%qsma%mode, 'a linear mode')
            call check_sensor(groups(k), input, input%qsma%sensor)
         case ('ringdown')
            call check_ringdown(groups(k), input)
         case ('harmonic_balance')
            call check_harmonic_balance(groups(k), input, loads)
         case ('epmc')
            call check_mode(groups(k), input, 'mode', 'epmc', input%epmc%mode, 'a linear mode')
            call check_periodic(groups(k), input, input%epmc%sensor)
            call check_range(groups(k), 'amplitude_range', input%epmc%amplitude_range)
         case ('output')
            call check_output(groups(k), input)
         end select
         if (allocated(input%analyses)) call check_use(groups(k), input)
      end do
   end subroutine check_case

   !> The preload comes first; only what is pressed together from the beginning needs none.
   subroutine check_first(group, input)
      type(group_keys_t), intent(inout) :: group
      type(case_t), intent(in) :: input
      integer :: k

      if (.not. (allocated(input%analyses) .and. group%sound('analyses'))) return
      if (input%analyses(1) == 'preload') return
      if (.not. input%runs('preload') .and. size(input%interfaces) > 0 &
          .and. all([(allocated(input%interfaces(k)%initial_pressure), k=1, size(input%interfaces))])) return
      call group%fault('analyses', "'preload' first, the other analyses start from its result (none needed where all "// &
         'interfaces have an initial_pressure)')
   end subroutine check_first

   !> Names of the groups of one kind differ.
   subroutine check_names(groups, kind, names)
      type(group_keys_t), intent(inout) :: groups(:)
      character(len=*), intent(in) :: kind, names(:)
      integer :: k, other

      do k = 1, size(groups)
         if (groups(k)%name /= kind) cycle
         other = position_of(names(groups(k)%number), names(:groups(k)%number - 1))
         if (other > 0) call groups(k)%fault('name', &
            'a name of its own, &'//kind//' '//to_text(other)//' has this one')
      end do
   end subroutine check_names

   !> Position of a name in a list (case does not matter), 0 if it is not there.
   pure integer function position_of(name, names)
      character(len=*), intent(in) :: name, names(:)
      integer :: k

      position_of = 0
      do k = size(names), 1, -1
         if (lower_case(names(k)) == lower_case(name)) position_of = k
      end do
   end function position_of

   !> A group or key that no chosen analysis uses is refused.
   subroutine check_use(group, input)
      type(group_keys_t), intent(inout) :: group
      type(case_t), intent(in) :: input

      select case (group%name)
      case ('preload', 'linear_modes', 'transient', 'qsma', 'ringdown', 'settling', 'harmonic_balance', 'epmc')
         if (.not. input%runs(group%name)) call group%fault('', "only with '"//group%name// &
            "' in the analyses of &case, the group would be ignored here")
      case ('excitation')
         if (.not. input%runs('transient')) call group%fault('', &
            "only with 'transient' in the analyses of &case, the group would be ignored here")
      case ('output')
         if (.not. input%runs('transient')) call group%ignored(['snapshots'], "with 'transient' in the analyses of &case")
         if (.not. (input%runs('transient') .or. input%runs('settling'))) call group%ignored( &
            [character(len=16) :: 'stride', 'checkpoint_steps'], "with 'transient' or 'settling' in the analyses of &case")
         if (.not. any([input%runs('transient'), input%runs('qsma'), input%runs('settling'), &
            input%runs('harmonic_balance'), input%runs('epmc')])) &
            call group%ignored([character(len=16) :: 'sensors', 'sensor_direction'], &
            "with 'transient', 'settling', 'qsma', 'harmonic_balance' or 'epmc' in the analyses of &case")
      end select
   end subroutine check_use

   !> The topography of an interface exists; the only one is the default.
   subroutine check_topography_name(group, input, topographies)
      type(group_keys_t), intent(inout) :: group
      type(case_t), intent(inout) :: input
      character(len=*), intent(in) :: topographies(:)

      associate (name => input%interfaces(group%number)%topography)
         if (.not. group%sound('topography') .or. allocated(input%interfaces(group%number)%initial_pressure)) return
         if (name == '' .and. size(input%topographies) == 1) then
            name = input%topographies(1)%name
         else if (name == '' .and. size(input%topographies) > 1) then
            call group%fault('topography', 'one of the topographies '//quoted_list(topographies))
         else if (name /= '' .and. input%find_topography(name) == 0) then
            call group%fault('topography', known_names('topography', name, topographies))
         end if
      end associate
   end subroutine check_topography_name

   !> A topography that no interface uses is refused (unless a name elsewhere is wrong).
   subroutine check_topography_use(group, input)
      type(group_keys_t), intent(inout) :: group
      type(case_t), intent(in) :: input
      integer :: k

      do k = 1, size(input%interfaces)
         if (allocated(input%interfaces(k)%initial_pressure)) cycle
         if (any(input%find_topography(input%interfaces(k)%topography) == [0, group%number])) return
      end do
      call group%fault('', 'a &topography that an &interface uses, this one would be ignored')
   end subroutine check_topography_use

   !> A load that nothing uses, neither an analysis nor an excitation, is refused (unless a name elsewhere is wrong).
   subroutine check_load_use(group, input)
      type(group_keys_t), intent(inout) :: group
      type(case_t), intent(in) :: input
      integer :: k

      if (allocated(input%preload%loads)) then
         do k = 1, size(input%preload%loads)
            if (any(input%find_load(input%preload%loads(k)) == [0, group%number])) return
         end do
      else if (input%runs('preload')) then
         return
      end if
      do k = 1, size(input%excitations)
         if (any(input%find_load(input%excitations(k)%load) == [0, group%number])) return
      end do
      if (input%runs('harmonic_balance') .and. any(input%find_load(input%harmonic_balance%load) == [0, group%number])) return
      if (input%settling%load /= '' .and. any(input%find_load(input%settling%load) == [0, group%number])) return
      call group%fault('', 'a &load that &preload, &settling, &harmonic_balance or an &excitation uses, '// &
         'this one would be ignored')
   end subroutine check_load_use

   !> The interface of a motion exists.
   subroutine check_motion(group, input, interfaces)
      type(group_keys_t), intent(inout) :: group
      type(case_t), intent(in) :: input
      character(len=*), intent(in) :: interfaces(:)

      associate (load => input%loads(group%number))
         if (load%kind /= 'motion' .or. .not. group%sound('interface')) return
         if (input%find_interface(load%interface) == 0) &
            call group%fault('interface', known_names('interface', load%interface, interfaces))
      end associate
   end subroutine check_motion

   !> Modal damping fits the number of modes, the reference mode is among them.
   subroutine check_damping(group, input)
      type(group_keys_t), intent(inout) :: group
      type(case_t), intent(in) :: input

      if (.not. allocated(input%reduction%n_modes)) return
      if (allocated(input%damping%modal_ratio)) then
         if (all(size(input%damping%modal_ratio) /= [1, input%reduction%n_modes])) call group%fault('modal_ratio', &
            'one number, or one for each of the '//to_text(input%reduction%n_modes)//' modes of &reduction')
      end if
      if (allocated(input%damping%ratio) .and. input%damping%reference_mode > input%reduction%n_modes) &
         call group%fault('reference_mode', 'one of the '//to_text(input%reduction%n_modes)//' modes of &reduction')
   end subroutine check_damping

   !> The loads of the preload exist; one per interface when interface forces are prescribed.
   subroutine check_preload(group, input, loads)
      type(group_keys_t), intent(inout) :: group
      type(case_t), intent(in) :: input
      character(len=*), intent(in) :: loads(:)
      integer :: k, interfaces

      interfaces = size(input%interfaces)
      if (allocated(input%preload%interface_force)) then
         if (size(input%preload%interface_force) /= interfaces .and. interfaces > 0) call group%fault('interface_force', &
            'one number per interface, '//to_text(interfaces))
         do k = 1, interfaces
            if (.not. allocated(input%interfaces(k)%initial_pressure)) cycle
            call group%fault('interface_force', "load_scale in its place: interface '"//trim(input%interfaces(k)%name)// &
               "' has an initial_pressure, which says its force")
            exit
         end do
      end if
      if (.not. allocated(input%preload%loads)) return
      do k = 1, size(input%preload%loads)
         associate (load => input%find_load(input%preload%loads(k)))
            if (load == 0) then
               call group%fault('loads', known_names('load', input%preload%loads(k), loads))
            else if (input%loads(load)%kind == 'modal') then
               call group%fault('loads', "loads of another kind than 'modal', modes are known only after the preload")
            end if
         end associate
         if (position_of(input%preload%loads(k), input%preload%loads(:k - 1)) > 0) &
            call group%fault('loads', 'every load once')
      end do
      if (allocated(input%preload%interface_force) .and. size(input%preload%loads) /= interfaces .and. interfaces > 0) &
         call group%fault('loads', 'one load per interface, '//to_text(interfaces)//', with interface_force')
   end subroutine check_preload

   !> The load of an excitation exists, and so does the mode of a modal load; the excitation begins in time.
   subroutine check_excitation(group, input, loads)
      type(group_keys_t), intent(inout) :: group
      type(case_t), intent(in) :: input
      character(len=*), intent(in) :: loads(:)
      integer :: load

      associate (excitation => input%excitations(group%number))
         load = input%find_load(excitation%load)
         if (group%sound('load') .and. load == 0) then
            call group%fault('load', known_names('load', excitation%load, loads))
         else if (load > 0 .and. allocated(input%analyses)) then
            if (input%loads(load)%kind == 'modal') &
               call check_mode(group, input, 'load', 'transient', input%loads(load)%mode, 'a modal load')
         end if
         if (input%transient%duration > 0.0_wp .and. excitation%start >= input%transient%duration &
             .and. group%sound('start')) &
            call group%fault('start', 'before the end of the &transient, < '//to_text(input%transient%duration)//' s')
         if (allocated(excitation%times) .and. input%transient%duration > 0.0_wp) then
            if (any(excitation%times >= input%transient%duration)) call group%fault('times', &
               'before the end of the &transient, < '//to_text(input%transient%duration)//' s')
         end if
         if (excitation%kind == 'swept_sine') call check_sweep(group, excitation)
         if (.not. is_measured(excitation%kind)) return
         if (.not. allocated(input%output%sensors)) call group%fault('kind', &
            "one of 'half_sine', 'harmonic', 'file': the others measure at the sensors of &output, but there is none")
         if (any(is_measured(input%excitations(:group%number - 1)%kind))) call group%fault('kind', &
            'one stepped or swept sine at most, this is the second one')
      end associate
   end subroutine check_excitation

   !> A sweep leaves time for a window to measure in.
   subroutine check_sweep(group, excitation)
      type(group_keys_t), intent(inout) :: group
      type(excitation_case_t), intent(in) :: excitation
      real(wp) :: periods, of_rate

      if (.not. (group%sound('rate') .and. group%sound('frequency_from') .and. group%sound('frequency_to'))) return
      if (min(excitation%rate, excitation%frequency_from, excitation%frequency_to) <= 0.0_wp) return
      ! Cycles times the rate, Hz/s or octaves per minute.
      of_rate = abs(excitation%frequency_to - excitation%frequency_from)
      if (excitation%sweep == 'log') then
         of_rate = of_rate*60.0_wp/log(2.0_wp)
      else
         of_rate = of_rate*0.5_wp*(excitation%frequency_to + excitation%frequency_from)
      end if
      periods = of_rate/excitation%rate
      if (periods < excitation%measure_periods) call group%fault('rate', 'a number <= '// &
         to_text(of_rate/excitation%measure_periods)//': the sweep holds '//to_text(periods, 3)//' periods, a window '// &
         to_text(excitation%measure_periods))
   end subroutine check_sweep

   !> Whether harmonics are measured under an excitation.
   elemental logical function is_measured(kind)
      character(len=*), intent(in) :: kind
      is_measured = kind == 'stepped_sine' .or. kind == 'swept_sine'
   end function is_measured

   !> The time integration has an end.
   subroutine check_transient(group, input)
      type(group_keys_t), intent(inout) :: group
      type(case_t), intent(in) :: input

      call check_steps(group, input%transient%time_step, input%transient%duration)
      if (input%transient%duration > 0.0_wp .or. .not. group%sound('duration')) return
      if (.not. any(is_measured(input%excitations%kind)) .or. any(input%excitations%kind == 'harmonic')) call group%fault( &
         'duration', 'a number > 0, unless a stepped or swept sine sets the end and no harmonic excitation goes on')
   end subroutine check_transient

   !> The steps can be counted.
   subroutine check_steps(group, time_step, duration)
      type(group_keys_t), intent(inout) :: group
      !> s; not allocated: found when the model is known
      real(wp), allocatable, intent(in) :: time_step
      real(wp), intent(in) :: duration

      if (.not. allocated(time_step)) return
      if (duration > most_steps*time_step) call group%fault('time_step', 'at most '//to_text(most_steps)// &
         ' steps in all, a number >= '//to_text(duration/most_steps))
   end subroutine check_steps

   !> The load of the impacts exists, and so do the modes.
   subroutine check_settling(group, input, loads)
      type(group_keys_t), intent(inout) :: group
      type(case_t), intent(in) :: input
      character(len=*), intent(in) :: loads(:)
      integer :: load

      call check_mode(group, input, 'mode', 'settling', input%settling%mode, 'the period of a linear mode')
      if (allocated(input%settling%amplitude)) call check_steps(group, input%settling%time_step, &
         input%settling%interval*max(input%settling%impacts, size(input%settling%amplitude)))
      load = input%find_load(input%settling%load)
      if (group%sound('load') .and. load == 0) then
         call group%fault('load', known_names('load', input%settling%load, loads))
      else if (load > 0 .and. allocated(input%analyses)) then
         if (input%loads(load)%kind == 'modal') &
            call check_mode(group, input, 'load', 'settling', input%loads(load)%mode, 'a modal load')
      end if
      if (.not. allocated(input%output%sensors)) call group%fault('', &
         'only with sensors in &output, which tell the shift of the static position')
   end subroutine check_settling

   !> A linear mode is there when an analysis needs it.
   subroutine check_mode(group, input, key, analysis, mode, what)
      type(group_keys_t), intent(inout) :: group
      type(case_t), intent(in) :: input
      character(len=*), intent(in) :: key, analysis
      integer, intent(in) :: mode
      !> What needs the mode, in words
      character(len=*), intent(in) :: what

      if (.not. allocated(input%analyses)) return
      if (.not. input%runs(analysis)) return
      if (.not. comes_before(input, 'linear_modes', analysis)) then
         call group%fault(key, what//" only with 'linear_modes' before '"//analysis//"' in the analyses of &case")
      else if (mode > input%linear_modes%n_modes) then
         call group%fault(key, 'a mode (here '//to_text(mode)//') out of the '//to_text(input%linear_modes%n_modes)// &
            ' of &linear_modes')
      end if
   end subroutine check_mode

   !> Whether an analysis is run before another one.
   pure logical function comes_before(input, first, second)
      type(case_t), intent(in) :: input
      character(len=*), intent(in) :: first, second

      associate (at => findloc(input%analyses, first, 1))
         comes_before = at > 0 .and. at < findloc(input%analyses, second, 1)
      end associate
   end function comes_before

   !> A sensor measures the amplitude: it exists.
   subroutine check_sensor(group, input, sensor)
      type(group_keys_t), intent(inout) :: group
      type(case_t), intent(in) :: input
      character(len=*), intent(in) :: sensor

      if (.not. allocated(input%output%sensors)) then
         call group%fault('sensor', 'one of the sensors of &output, but there is none')
      else if (size(input%find_sensors(sensor)) == 0) then
         call group%fault('sensor', 'one of the sensors of &output, '//quoted_list(input%output%sensors))
      end if
   end subroutine check_sensor

   !> A ring-down is identified from a time integration whose excitations end before its start.
   subroutine check_ringdown(group, input)
      type(group_keys_t), intent(inout) :: group
      type(case_t), intent(in) :: input

      if (.not. allocated(input%analyses)) return
      if (.not. input%runs('ringdown')) return
      if (.not. comes_before(input, 'transient', 'ringdown')) call group%fault('', &
         "only with 'transient' before 'ringdown' in the analyses of &case")
      if (allocated(input%ringdown%mode)) &
         call check_mode(group, input, 'mode', 'transient', input%ringdown%mode, 'a linear mode')
      call check_sensor(group, input, input%ringdown%sensor)
      if (any(input%excitations%kind == 'harmonic')) call group%fault('', &
         "only with excitations that end, 'harmonic' ones never do")
      if (allocated(input%ringdown%start) .and. input%transient%duration > 0.0_wp) then
         if (input%ringdown%start >= input%transient%duration) call group%fault('start', &
            'before the end of the &transient, < '//to_text(input%transient%duration)//' s')
      end if
   end subroutine check_ringdown

   !> The load of a frequency response exists, and the mode of a modal load.
   subroutine check_harmonic_balance(group, input, loads)
      type(group_keys_t), intent(inout) :: group
      type(case_t), intent(in) :: input
      character(len=*), intent(in) :: loads(:)
      integer :: load

      load = input%find_load(input%harmonic_balance%load)
      if (group%sound('load') .and. load == 0) then
         call group%fault('load', known_names('load', input%harmonic_balance%load, loads))
      else if (load > 0) then
         if (input%loads(load)%kind == 'motion') call group%fault('load', &
            "a load of another kind than 'motion', which is for static loads and the time integration")
         if (input%loads(load)%kind == 'modal') &
            call check_mode(group, input, 'load', 'harmonic_balance', input%loads(load)%mode, 'a modal load')
      end if
      call check_periodic(group, input, input%harmonic_balance%sensor)
   end subroutine check_harmonic_balance

   !> What all analyses of periodic motions need.
   subroutine check_periodic(group, input, sensor)
      type(group_keys_t), intent(inout) :: group
      type(case_t), intent(in) :: input
      character(len=*), intent(in) :: sensor

      call check_sensor(group, input, sensor)
      if (input%contact%normal_law == 'velocity') call group%fault('', "only with normal_law = 'gap' in &contact")
      if (input%contact%compliance == 'fft') call group%fault('', "not with compliance = 'fft' in &contact")
   end subroutine check_periodic

   !> Both ends of a range differ.
   subroutine check_range(group, key, range)
      type(group_keys_t), intent(inout) :: group
      character(len=*), intent(in) :: key
      real(wp), allocatable, intent(in) :: range(:)

      if (.not. allocated(range)) return
      if (size(range) == 2 .and. abs(range(2) - range(1)) <= 0.0_wp) call group%fault(key, 'two different numbers')
   end subroutine check_range

   !> Snapshots lie within the time integration.
   subroutine check_output(group, input)
      type(group_keys_t), intent(inout) :: group
      type(case_t), intent(in) :: input

      if (.not. allocated(input%output%snapshots) .or. input%transient%duration <= 0.0_wp) return
      if (any(input%output%snapshots > input%transient%duration)) call group%fault('snapshots', &
         'times within the &transient, <= '//to_text(input%transient%duration)//' s')
   end subroutine check_output

   !> The names that exist, for a name that does not.
   pure function known_names(kind, name, names) result(text)
      character(len=*), intent(in) :: kind, name, names(:)
      character(len=:), allocatable :: text

      if (size(names) == 0) then
         text = 'the name of a &'//kind//', but there is none'
      else if (nearest_name(name, names) /= '') then
         text = 'the name of a &'//kind//", did you mean '"//nearest_name(name, names)//"'?"
      else
         text = 'the name of a &'//kind//': '//quoted_list(names)
      end if
   end function known_names

end module microslip_io_case_checks
