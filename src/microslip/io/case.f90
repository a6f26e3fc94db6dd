!> The records of a case: everything a case file says, checked, in SI units unless a unit key says otherwise.
!>
!> One type per namelist group, one component per key, with the defaults of doc/namelists.md. Every record can be built
!> without a file. An unset optional key is a component that is not allocated, or a blank name.
module microslip_io_case
   use microslip_core_kinds, only: wp
   use microslip_core_text, only: lower_case
   implicit none(type, external)
   private

   public :: case_t, model_case_t, interface_case_t, topography_case_t, reduction_case_t, damping_case_t
   public :: contact_case_t, load_case_t, preload_case_t, linear_modes_case_t, transient_case_t
   public :: excitation_case_t, settling_case_t, output_case_t, qsma_case_t, ringdown_case_t, harmonic_balance_case_t
   public :: epmc_case_t, name_length, path_length

   !> Longest name (of node sets, loads, options) and longest file path or title.
   integer, parameter :: name_length = 64, path_length = 1024

   !> `&model`: where the FE model comes from.
   type :: model_case_t
      !> 'hdf5' or 'calculix'
      character(len=name_length) :: source = ''
      !> Model file; for CalculiX the base name of .sti, .mas and .dof. See `case_t%located`
      character(len=path_length) :: file = ''
      !> CalculiX: the mesh (.inp or .msh)
      character(len=path_length) :: mesh_file = ''
      !> CalculiX: units of its files, 'm', 'mm', 'um'; 'kg', 't', 'g'; 's', 'ms'
      character(len=name_length) :: unit_length = 'm', unit_mass = 'kg', unit_time = 's'
   end type model_case_t

   !> `&interface`: one contact interface.
   type :: interface_case_t
      character(len=name_length) :: name = ''
      !> Node sets of the two sides; side_b = 'ground': rigid or elastic ground. Blank: found by the plane
      character(len=name_length) :: side_a = '', side_b = ''
      !> (3) m; (3) from side B towards side A; (6) xmin, xmax, ymin, ymax, zmin, zmax, m
      real(wp), allocatable :: plane_point(:), plane_normal(:), region(:)
      !> (3) direction of t1, projected on the interface
      real(wp), allocatable :: axis_1(:)
      real(wp) :: friction = 0.0_wp
      !> 'half_space': cells of a boundary-element grid; 'fe_nodes': the node pairs themselves, without half spaces
      character(len=name_length) :: grid = 'half_space'
      !> half_space: (2) Pa and 1, of bodies A and B; one value only: B is rigid ground
      real(wp), allocatable :: young_modulus(:), poisson_ratio(:)
      !> half_space: cells of the boundary-element grid along t1 and t2
      integer :: nx = 0, ny = 0
      !> half_space: (4) x_min, x_max, y_min, y_max in local coordinates, m; not allocated: bounding box of the nodes
      real(wp), allocatable :: extent(:)
      !> half_space: (3, holes) x, y, radius in local coordinates, m
      real(wp), allocatable :: holes(:, :)
      !> 'series' or 'scale_split': half space and FE model
      character(len=name_length) :: coupling = 'scale_split'
      !> Name of a topography; blank: flat
      character(len=name_length) :: topography = ''
      !> Pa, normal pressure in the undeformed state, in place of a topography
      real(wp), allocatable :: initial_pressure
      !> 'auto' or 'all': which points may come into contact
      character(len=name_length) :: potential = 'auto'
      !> m, 'auto': points whose initial gap exceeds the closed ones' by less than this take part
      real(wp), allocatable :: potential_margin
   end type interface_case_t

   !> `&topography`: form deviation of an interface.
   type :: topography_case_t
      character(len=name_length) :: name = ''
      !> 'flat', 'hill' or 'file'
      character(len=name_length) :: source = ''
      !> hill: m, peak to peak
      real(wp) :: height = 0.0_wp
      !> hill: (2) m, summit in local coordinates; not allocated: middle of the grid
      real(wp), allocatable :: center(:)
      !> file: HDF5 file and its datasets
      character(len=path_length) :: file = ''
      character(len=name_length) :: x_name = 'x', y_name = 'y', z_name = ''
      !> file: 'm', 'mm', 'um', 'nm'; blank: as the file says
      character(len=name_length) :: unit_length = ''
      !> file: 'z[x,y]' or 'z[y,x]', as h5py shows the heights; blank: as the file says
      character(len=name_length) :: layout = ''
      !> file: 'height' (of side B's surface towards A) or 'gap' (between both)
      character(len=name_length) :: sense = ''
      !> 'none', 'mean' or 'plane'
      character(len=name_length) :: level = 'none'
      !> m; not allocated: no filter
      real(wp), allocatable :: filter_wavelength
      !> m, shift in the interface plane
      real(wp) :: offset(2) = 0.0_wp
      !> degrees
      real(wp) :: rotation = 0.0_wp
      real(wp) :: scale = 1.0_wp
   end type topography_case_t

   !> `&reduction`: component mode synthesis. Either `n_modes` or `cutoff_frequency` is allocated.
   type :: reduction_case_t
      !> 'craig_bampton_massless' or 'macneal'
      character(len=name_length) :: method = 'craig_bampton_massless'
      integer, allocatable :: n_modes
      !> Hz
      real(wp), allocatable :: cutoff_frequency
      !> 'kept' or 'dropped': mass of soft motions that the tied modes do not carry
      character(len=name_length) :: residual_mass = 'kept'
      !> File that keeps the reduced model; blank: none
      character(len=path_length) :: cache = ''
   end type reduction_case_t

   !> `&damping`: at most one of modal_ratio, mass_proportional and ratio is allocated; none: undamped.
   type :: damping_case_t
      !> (1) for all modes, or one per mode
      real(wp), allocatable :: modal_ratio(:)
      !> 1/s, beta of D_ii = beta I
      real(wp), allocatable :: mass_proportional
      !> beta = 2 ratio omega, omega of the mode `reference_mode` with tied interfaces (the paper's way) or of the
      !> linear mode about the preload, where the ratio is then met exactly: 'tied' or 'preloaded'
      real(wp), allocatable :: ratio
      integer :: reference_mode = 1
      character(len=name_length) :: reference = 'tied'
   end type damping_case_t

   !> `&contact`: solver of the contact problem.
   type :: contact_case_t
      !> One of the contact solvers of the factory
      character(len=name_length) :: solver = 'condensed'
      real(wp) :: tolerance = 1.0e-10_wp
      integer :: max_iterations = 100000
      !> 'gap' or 'velocity'
      character(len=name_length) :: normal_law = 'gap'
      !> 'auto', 'dense' or 'fft': how the contact compliance is held
      character(len=name_length) :: compliance = 'auto'
   end type contact_case_t

   !> `&load`: a load pattern with a name.
   type :: load_case_t
      character(len=name_length) :: name = ''
      !> 'nodes', 'modal', 'base' or 'motion'
      character(len=name_length) :: kind = 'nodes'
      !> nodes: (parts)
      character(len=name_length), allocatable :: node_set(:)
      !> nodes: (3, parts) as given, any length but 0; base: (3, 1); motion: (3, 1) along n, t1, t2, axis of a rotation
      real(wp), allocatable :: direction(:, :)
      !> nodes: (parts) N
      real(wp), allocatable :: size(:)
      !> nodes: (parts) 'uniform' (same force on every node) or 'area'
      character(len=name_length), allocatable :: distribution(:)
      !> modal: f = M phi of this linear mode about the preload
      integer :: mode = 0
      !> motion: name of the interface whose side B moves; 'translation' or 'rotation'; (2) m, x and y of a point of the axis
      character(len=name_length) :: interface = '', motion = 'translation'
      real(wp) :: center(2) = 0.0_wp
   end type load_case_t

   !> `&preload`: either `interface_force` or `load_scale` is allocated.
   type :: preload_case_t
      !> (loads) names
      character(len=name_length), allocatable :: loads(:)
      !> (interfaces) N, normal force each interface is to carry; as many loads are scaled
      real(wp), allocatable :: interface_force(:)
      !> (loads) given multipliers
      real(wp), allocatable :: load_scale(:)
      integer :: steps = 1
   end type preload_case_t

   !> `&linear_modes`: modes about the preload.
   type :: linear_modes_case_t
      integer :: n_modes = 10
      !> Whether the number was given
      logical :: asked = .false.
   end type linear_modes_case_t

   !> `&transient`: time integration.
   type :: transient_case_t
      !> s; 0: as long as a stepped or swept sine takes
      real(wp) :: duration = 0.0_wp
      !> s; not allocated: safety/omega_max
      real(wp), allocatable :: time_step
      !> omega_max dt
      real(wp) :: safety = 0.74_wp
   end type transient_case_t

   !> `&excitation`: a load pattern times a function of time.
   type :: excitation_case_t
      !> Name of a load
      character(len=name_length) :: load = ''
      !> 'half_sine', 'harmonic', 'stepped_sine', 'swept_sine' or 'file'
      character(len=name_length) :: kind = ''
      !> Factor on the load pattern
      real(wp) :: amplitude = 0.0_wp
      !> s
      real(wp) :: start = 0.0_wp
      !> half_sine: s; begins of several pulses in place of `start`, s
      real(wp) :: duration = 0.0_wp
      real(wp), allocatable :: times(:)
      !> file: two columns, time and value
      character(len=path_length) :: file = ''
      !> harmonic: Hz
      real(wp) :: frequency = 0.0_wp
      !> sines: degrees, and s
      real(wp) :: phase = 0.0_wp, ramp = 0.0_wp
      !> stepped_sine: Hz; not allocated: `frequency_count` equally spaced ones
      real(wp), allocatable :: frequencies(:)
      !> stepped_sine and swept_sine: Hz
      real(wp) :: frequency_from = 0.0_wp, frequency_to = 0.0_wp
      integer :: frequency_count = 0
      !> swept_sine: 'linear' or 'log'; Hz/s or octaves per minute
      character(len=name_length) :: sweep = 'linear'
      real(wp) :: rate = 0.0_wp
      !> stepped_sine and swept_sine: harmonics that are measured, and periods of a window
      integer :: harmonics = 5, measure_periods = 10
      !> stepped_sine: periods before the first window; change below which a frequency is left, after how many windows
      !> at the latest
      integer :: settle_periods = 50
      real(wp), allocatable :: steady_tolerance
      integer :: most_windows = 20
   end type excitation_case_t

   !> `&settling`: a sequence of half-sine impacts.
   type :: settling_case_t
      !> Name of a load
      character(len=name_length) :: load = ''
      !> (impacts) or (1): factors on the load pattern; one only: `impacts` of them
      real(wp), allocatable :: amplitude(:)
      integer :: impacts = 1
      !> s, of an impact, and from one to the next
      real(wp) :: duration = 0.0_wp, interval = 0.0_wp
      !> Linear mode whose period counts, and how many of them the residual state is averaged over
      integer :: mode = 1, periods = 10
      !> Whether the free decay after every impact is identified
      logical :: ringdown = .false.
      !> s; not allocated: safety/omega_max
      real(wp), allocatable :: time_step
      !> omega_max dt
      real(wp) :: safety = 0.74_wp
   end type settling_case_t

   !> `&qsma`: quasi-static modal analysis. Either `amplitudes` or `largest_amplitude` is allocated.
   type :: qsma_case_t
      !> Linear mode about the preload
      integer :: mode = 1
      !> (levels) m, ascending
      real(wp), allocatable :: amplitudes(:)
      !> m; not allocated: a hundredth of the largest ('log'), or the distance of the levels ('linear')
      real(wp), allocatable :: largest_amplitude, smallest_amplitude
      integer :: levels = 20
      !> 'log' or 'linear'
      character(len=name_length) :: spacing = 'log'
      !> One of the sensors of `&output`; blank: the first
      character(len=name_length) :: sensor = ''
      !> Load steps between two levels
      integer :: steps = 1
      !> Hysteresis loops, always or never; not allocated: where Masing's rule does not hold. Load steps of half a loop
      logical, allocatable :: cycle
      integer :: cycle_steps = 10
   end type qsma_case_t

   !> `&ringdown`: identification from the free decay of the time integration.
   type :: ringdown_case_t
      !> Linear mode whose coordinate is looked at; not allocated: the sensor itself
      integer, allocatable :: mode
      !> One of the sensors of `&output`; blank: the first
      character(len=name_length) :: sensor = ''
      !> Window in periods of the mode, and the part of it that the next one shares
      real(wp) :: periods = 10.0_wp, overlap = 0.9_wp
      !> s, begin of the free decay; not allocated: the end of the last excitation
      real(wp), allocatable :: start
   end type ringdown_case_t

   !> `&harmonic_balance`: frequency response to a harmonic load.
   type :: harmonic_balance_case_t
      !> Name of a load
      character(len=name_length) :: load = ''
      !> One of the sensors of `&output`; blank: the first
      character(len=name_length) :: sensor = ''
      !> Factors on the load pattern, one curve each
      real(wp), allocatable :: levels(:)
      !> (2) Hz, from where to where
      real(wp), allocatable :: frequency_range(:)
      integer :: harmonics = 5, samples = 50
      !> Hz; not allocated: a fiftieth of the range
      real(wp), allocatable :: frequency_step
      real(wp) :: response_step = 0.25_wp
      real(wp) :: tolerance = 1.0e-6_wp
      !> Corrections of a point
      integer :: max_iterations = 12
      integer :: max_points = 1000
   end type harmonic_balance_case_t

   !> `&epmc`: nonlinear mode by the extended periodic motion concept.
   type :: epmc_case_t
      !> Linear mode about the preload
      integer :: mode = 1
      !> One of the sensors of `&output`; blank: the first
      character(len=name_length) :: sensor = ''
      !> (2) m, from where to where
      real(wp), allocatable :: amplitude_range(:)
      integer :: points = 20
      integer :: harmonics = 5, samples = 50
      real(wp) :: response_step = 0.5_wp
      real(wp) :: tolerance = 1.0e-8_wp
      !> Corrections of a point
      integer :: max_iterations = 12
      integer :: max_points = 1000
   end type epmc_case_t

   !> `&output`: what is stored, where and how often.
   type :: output_case_t
      !> Result file; blank: the case's name with .h5 in the current folder
      character(len=path_length) :: file = ''
      !> (sensors) node sets, whose mean displacement is stored
      character(len=name_length), allocatable :: sensors(:)
      !> (3, sensors) as given, any length but 0
      real(wp), allocatable :: sensor_direction(:, :)
      !> Every `stride`-th step is stored
      integer :: stride = 1
      !> s
      real(wp), allocatable :: snapshots(:)
      !> s, wall time from one publication of the result file to the next
      real(wp) :: checkpoint_interval = 60.0_wp
      !> Steps of a time integration from one restart point to the next
      integer :: checkpoint_steps = 50000
   end type output_case_t

   !> A whole case.
   type :: case_t
      !> Case file as the user gave it, and its text
      character(len=:), allocatable :: path, text
      !> `&case`
      character(len=path_length) :: title = ''
      !> In order
      character(len=name_length), allocatable :: analyses(:)
      type(model_case_t) :: model
      type(interface_case_t), allocatable :: interfaces(:)
      type(topography_case_t), allocatable :: topographies(:)
      type(reduction_case_t) :: reduction
      type(damping_case_t) :: damping
      type(contact_case_t) :: contact
      type(load_case_t), allocatable :: loads(:)
      type(preload_case_t) :: preload
      type(linear_modes_case_t) :: linear_modes
      type(transient_case_t) :: transient
      type(qsma_case_t) :: qsma
      type(ringdown_case_t) :: ringdown
      type(harmonic_balance_case_t) :: harmonic_balance
      type(epmc_case_t) :: epmc
      type(excitation_case_t), allocatable :: excitations(:)
      type(settling_case_t) :: settling
      type(output_case_t) :: output
   contains
      procedure :: runs
      procedure :: located
      procedure :: find_load
      procedure :: find_interface
      procedure :: find_topography
      procedure :: find_sensors
   end type case_t

contains

   !> Whether an analysis is to be run.
   pure logical function runs(self, analysis)
      class(case_t), intent(in) :: self
      !> One of the names of `&case`
      character(len=*), intent(in) :: analysis
      runs = .false.
      if (allocated(self%analyses)) runs = any(self%analyses == analysis)
   end function runs

   !> A file of the case as seen from the current folder: relative paths start at the case file's folder.
   pure function located(self, file) result(path)
      class(case_t), intent(in) :: self
      !> Path as it stands in the case
      character(len=*), intent(in) :: file
      character(len=:), allocatable :: path

      path = trim(file)
      ! A case from standard input or another pipe has no folder: its files are looked for in the current one.
      if (index(path, '/') /= 1 .and. index(self%path, '/dev/') /= 1 .and. index(self%path, '/proc/') /= 1) &
         & path = self%path(:index(self%path, '/', back=.true.))//path
   end function located

   !> Index of the load with this name (case does not matter), 0 if there is none.
   pure integer function find_load(self, name)
      class(case_t), intent(in) :: self
      !> Name of a `&load`
      character(len=*), intent(in) :: name
      integer :: k

      find_load = 0
      do k = 1, size(self%loads)
         if (name /= '' .and. lower_case(self%loads(k)%name) == lower_case(name)) find_load = k
      end do
   end function find_load

   !> Index of the interface with this name (case does not matter), 0 if there is none.
   pure integer function find_interface(self, name)
      class(case_t), intent(in) :: self
      !> Name of an `&interface`
      character(len=*), intent(in) :: name
      integer :: k

      find_interface = 0
      do k = 1, size(self%interfaces)
         if (name /= '' .and. lower_case(self%interfaces(k)%name) == lower_case(name)) find_interface = k
      end do
   end function find_interface

   !> Indices of the sensors with this name (case does not matter), of the first name if it is blank.
   pure function find_sensors(self, name) result(sensors)
      class(case_t), intent(in) :: self
      !> Node set of one or more sensors, which then differ by their directions
      character(len=*), intent(in) :: name
      integer, allocatable :: sensors(:)
      integer :: k

      allocate (sensors(0))
      if (.not. allocated(self%output%sensors)) return
      do k = 1, size(self%output%sensors)
         if (lower_case(self%output%sensors(k)) == lower_case(name) .or. &
            (name == '' .and. lower_case(self%output%sensors(k)) == lower_case(self%output%sensors(1)))) sensors = [sensors, k]
      end do
   end function find_sensors

   !> Index of the topography with this name (case does not matter), 0 if there is none: flat.
   pure integer function find_topography(self, name)
      class(case_t), intent(in) :: self
      !> Name of a `&topography`
      character(len=*), intent(in) :: name
      integer :: k

      find_topography = 0
      do k = 1, size(self%topographies)
         if (name /= '' .and. lower_case(self%topographies(k)%name) == lower_case(name)) find_topography = k
      end do
   end function find_topography

end module microslip_io_case
