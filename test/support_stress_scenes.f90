!> Contact scenes at the limits of what solvers are made for, each with the path of its drivers.
module support_stress_scenes
   use microslip_contact_problem, only: contact_problem_t
   use microslip_core_error, only: error_t
   use microslip_core_kinds, only: wp
   use microslip_halfspace_love_cerruti, only: elastic_material, half_space_pair, material_t
   use support_half_space, only: new_spheres, spheres_t
   use support_mesh, only: pseudo_random
   use test_contact_solvers, only: driver, half_space_like_problem
   implicit none(type, external)
   private

   public :: stress_scene_t, stress_scenes, random_scene, in_units, contact_scene

   type :: stress_scene_t
      character(len=:), allocatable :: name
      type(contact_problem_t) :: problem
      !> (drivers, steps)
      real(wp), allocatable :: path(:, :)
      !> The laws have a solution along the whole path, and one only: solvers for positive definite compliances find it
      logical :: regular = .true.
   end type stress_scene_t

   !> Steps of the path that meets all regimes, and of its short version.
   integer, parameter :: full_path = 60, short_path = 36

contains

   !> All scenes but the random ones; `short` leaves out what takes long.
   function stress_scenes(short) result(scenes)
      logical, intent(in) :: short
      type(stress_scene_t), allocatable :: scenes(:)
      real(wp), parameter :: friction(4) = [0.0_wp, 0.01_wp, 1.0_wp, 5.0_wp]
      character(len=*), parameter :: word(4) = [character(len=4) :: '0', '0.01', '1', '5']
      integer :: k, n, size_of(2)

      size_of = merge([4, 3], [7, 5], short)
      associate (nx => size_of(1), ny => size_of(2))
         allocate (scenes(0))
         do k = 1, size(friction)
            scenes = [scenes, scene_of('friction '//trim(word(k)), half_space_like_problem(nx, ny, friction(k)), &
               & all_regimes())]
         end do
         scenes = [scenes, &
            & scene_of('zero preload', half_space_like_problem(nx, ny, 0.4_wp), all_regimes(approach=0.0_wp)), &
            & scene_of('huge preload', half_space_like_problem(nx, ny, 0.4_wp), all_regimes(approach=1.0e6_wp)), &
            & scene_of('a single point', half_space_like_problem(1, 1, 0.4_wp), all_regimes()), &
            & scene_of('one point per interface', two_patches([1, 1], [1, 1], 0.5_wp), all_regimes()), &
            & scene_of('dissimilar grids', two_patches(size_of, [2, 2*ny], 0.05_wp), all_regimes()), &
            & scene_of('stiffness ratio 1e6', uneven(half_space_like_problem(nx, ny, 0.4_wp), 3.0_wp), all_regimes()), &
            & scene_of('strip along t1', half_space_like_problem(merge(12, 40, short), 1, 0.4_wp), all_regimes()), &
            & scene_of('strip along t2', half_space_like_problem(1, merge(12, 40, short), 0.4_wp), all_regimes()), &
            & scene_of('all but coincident points', coincident(half_space_like_problem(nx, ny, 0.4_wp), 1.0e-8_wp), &
            & all_regimes()), &
            & scene_of('coincident points', coincident(half_space_like_problem(nx, ny, 0.4_wp), 0.0_wp), all_regimes()), &
            & scene_of('impact from lift-off', half_space_like_problem(nx, ny, 0.4_wp), impacts()), &
            & scene_of('grazing', half_space_like_problem(nx, ny, 0.4_wp), grazing()), &
            & scene_of('reversal within a step', half_space_like_problem(nx, ny, 0.4_wp), reversals()), &
            & different_materials(merge(2, 4, short))]
         ! Takes some solvers long to give up.
         if (.not. short) scenes = [scenes, scene_of('nearly coincident points', &
            & coincident(half_space_like_problem(nx, ny, 0.4_wp), 1.0e-5_wp), all_regimes())]
         n = size(scenes)
         do k = 1, n
            if (short) scenes(k)%path = scenes(k)%path(:, :min(short_path, size(scenes(k)%path, 2)))
            ! Grazing with slip: the normal force can be rounding of the tangential one.
            scenes(k)%regular = index(scenes(k)%name, 'coincident') == 0 .and. scenes(k)%name /= 'grazing'
         end do
      end associate
   end function stress_scenes

   !> gfortran 12 loses components of allocatable length in structure constructors.
   function scene_of(name, problem, path) result(scene)
      character(len=*), intent(in) :: name
      type(contact_problem_t), intent(in) :: problem
      real(wp), intent(in) :: path(:, :)
      type(stress_scene_t) :: scene

      scene%name = name
      scene%problem = problem
      scene%path = path
   end function scene_of

   !> One step from the unloaded state to driver 1, for a problem with one driver.
   function contact_scene(name, problem) result(scene)
      character(len=*), intent(in) :: name
      type(contact_problem_t), intent(in) :: problem
      type(stress_scene_t) :: scene

      scene = scene_of(name, problem, reshape([1.0_wp], [1, 1]))
      scene%regular = .false.
   end function contact_scene

   !> Press, shear back and forth into gross slip, tilt into lift-off, unload and press again.
   function all_regimes(approach) result(path)
      !> Factor on the approach
      real(wp), intent(in), optional :: approach
      real(wp) :: path(3, full_path)
      integer :: k

      path = reshape([(driver(k), k=1, full_path)], shape(path))
      if (present(approach)) path(1, :) = approach*path(1, :)
   end function all_regimes

   !> From wide open to closed with shear in one step, and back.
   pure function impacts() result(path)
      real(wp) :: path(3, 8)

      path(:, 1) = [-1.0_wp, 0.0_wp, 0.0_wp]
      path(:, 2) = [1.0_wp, 0.4_wp, 0.0_wp]
      path(:, 3) = [-1.0_wp, 0.9_wp, 0.0_wp]
      path(:, 4) = [-5.0_wp, -0.9_wp, 0.3_wp]
      path(:, 5) = [1.5_wp, -0.5_wp, 0.1_wp]
      path(:, 6) = [0.0_wp, 0.0_wp, 0.0_wp]
      path(:, 7) = [-1.0e-3_wp, 0.0_wp, 0.0_wp]
      path(:, 8) = [10.0_wp, 20.0_wp, 0.0_wp]
   end function impacts

   !> About the touch of one point, by less and more than rounding.
   pure function grazing() result(path)
      real(wp) :: path(3, 16)
      real(wp), parameter :: approach(16) = [0.0_wp, -1.0e-15_wp, 1.0e-15_wp, 0.0_wp, 1.0e-12_wp, 0.0_wp, -1.0e-12_wp, &
         & 1.0e-9_wp, 0.0_wp, 1.0e-6_wp, 0.0_wp, -1.0e-6_wp, 1.0e-3_wp, 0.0_wp, 2.0e-2_wp, 1.9e-2_wp]
      integer :: k

      path = 0.0_wp
      path(1, :) = approach
      path(2, :) = [(1.0e-3_wp*(-1)**k, k=1, 16)]
   end function grazing

   !> Gross slip to and fro, the whole way in one step each.
   pure function reversals() result(path)
      real(wp) :: path(3, 12)
      integer :: k

      path(1, :) = 1.0_wp
      path(2, :) = [(3.0_wp*(-1)**k/max(1, k - 6)**2, k=1, 12)]
      path(3, :) = [(0.05_wp*(-1)**(k/2), k=1, 12)]
   end function reversals

   !> The compliance of every second point smaller by 10^decades, that of the others larger.
   function uneven(even, decades) result(problem)
      type(contact_problem_t), intent(in) :: even
      real(wp), intent(in) :: decades
      type(contact_problem_t) :: problem
      real(wp) :: factor(3*even%n_points)
      integer :: k

      problem = even
      factor = [(10.0_wp**merge(0.5_wp*decades, -0.5_wp*decades, mod((k - 1)/3, 2) == 0), k=1, size(factor))]
      do k = 1, size(factor)
         problem%G(:, k) = factor(k)*factor*problem%G(:, k)
      end do
   end function uneven

   !> The third point once more, in place of the second, but for a small own compliance.
   function coincident(apart, own) result(problem)
      type(contact_problem_t), intent(in) :: apart
      !> Over the compliance of the third
      real(wp), intent(in) :: own
      type(contact_problem_t) :: problem
      integer :: k

      problem = apart
      problem%G(4:6, :) = problem%G(7:9, :)
      problem%G(:, 4:6) = problem%G(:, 7:9)
      problem%R(4:6, :) = problem%R(7:9, :)
      problem%r_0(4:6) = problem%r_0(7:9)
      do k = 4, 6
         problem%G(k, k) = problem%G(k, k)*(1.0_wp + own)
      end do
   end function coincident

   !> Two patches that feel one another through three smooth patterns; the second is stiffer by a factor.
   function two_patches(cells, other_cells, factor) result(problem)
      integer, intent(in) :: cells(2), other_cells(2)
      real(wp), intent(in) :: factor
      type(contact_problem_t) :: problem, one, other
      real(wp), allocatable :: pattern(:, :)
      integer :: m, n, k

      one = half_space_like_problem(cells(1), cells(2), 0.4_wp)
      other = half_space_like_problem(other_cells(1), other_cells(2), 0.6_wp)
      m = 3*one%n_points
      n = m + 3*other%n_points
      problem%n_points = n/3
      problem%friction = [one%friction, other%friction]
      problem%r_0 = [one%r_0, 1.1_wp*other%r_0]
      allocate (problem%G(n, n), source=0.0_wp)
      allocate (problem%R(n, 3))
      problem%R(:m, :) = one%R
      problem%R(m + 1:, :) = 0.9_wp*other%R
      pattern = reshape([(cos(0.01_wp*k*[1.0_wp, 2.0_wp, 3.0_wp]), k=1, n)], [3, n])
      problem%G(:m, :m) = one%G
      problem%G(m + 1:, m + 1:) = factor*other%G
      problem%G = problem%G + 0.02_wp*matmul(transpose(pattern), pattern)
      allocate (problem%group(n/3), source=1)
      problem%group(m/3 + 1:) = 2
   end function two_patches

   !> A sphere of steel on one of a material that is a hundred times softer and laterally compressible: normal and
   !> tangential displacements are coupled. Drivers in m.
   function different_materials(cells) result(scene)
      !> Per contact radius
      integer, intent(in) :: cells
      type(stress_scene_t) :: scene
      type(spheres_t) :: spheres
      type(material_t) :: steel, soft
      type(error_t), allocatable :: error
      integer :: k
      real(wp), parameter :: radius = 0.1_wp, contact_radius = 1.0e-3_wp

      call elastic_material(steel, 2.0e11_wp, 0.3_wp, error)
      call elastic_material(soft, 2.0e9_wp, 0.0_wp, error)
      call new_spheres(spheres, half_space_pair(steel, soft), radius, contact_radius, cells, 0.3_wp)
      scene = scene_of('different materials', spheres%problem, &
         & reshape([(spheres%approach*[1.0_wp, 0.6_wp, 0.6_wp]*driver(k), k=1, full_path)], [3, full_path]))
   end function different_materials

   !> A random compliance B B^T of a rank, friction 0 to 2, and one driver that leads anywhere.
   function random_scene(seed, points, rank) result(scene)
      integer, intent(in) :: seed, points
      !> 3 points: positive definite; less: hyperstatic, the laws may have many solutions, or none
      integer, intent(in) :: rank
      type(stress_scene_t) :: scene
      type(contact_problem_t) :: problem
      real(wp) :: B(3*points, rank)
      integer :: i, k, start

      start = 7919*seed
      do k = 1, rank
         B(:, k) = [(pseudo_random(start + i + 3*points*k) - 0.5_wp, i=1, 3*points)]
      end do
      problem%n_points = points
      problem%G = matmul(B, transpose(B))
      do k = 1, 3*points
         problem%G(k, :k - 1) = problem%G(:k - 1, k)
         if (rank >= 3*points) problem%G(k, k) = problem%G(k, k) + 1.0e-2_wp
      end do
      problem%r_0 = spread(0.0_wp, 1, 3*points)
      problem%friction = [(2.0_wp*pseudo_random(start + 31*i), i=1, points)]
      allocate (problem%R(3*points, 1))
      ! Every second one in the range of G: then there is a force for every gap.
      problem%R(:, 1) = [(pseudo_random(start + 57*i) - 0.6_wp, i=1, 3*points)]
      if (mod(seed, 2) == 0) problem%R(:, 1) = matmul(problem%G, problem%R(:, 1))
      scene = contact_scene(merge('random positive definite', 'random hyperstatic      ', rank >= 3*points), problem)
      scene%name = trim(scene%name)
   end function random_scene

   !> The same scene with lengths in another unit.
   function in_units(scene, per_metre) result(same)
      type(stress_scene_t), intent(in) :: scene
      !> How many of the unit make the old one
      real(wp), intent(in) :: per_metre
      type(stress_scene_t) :: same

      same = scene
      same%problem%G = per_metre*scene%problem%G
      same%problem%R = per_metre*scene%problem%R
      same%problem%r_0 = per_metre*scene%problem%r_0
   end function in_units

end module support_stress_scenes
