!> Influence coefficients against quadrature of the point kernels, known values, signs and symmetries.
module test_halfspace_love_cerruti
   use microslip_core_error, only: error_t, status_bad_input
   use microslip_core_kinds, only: wp, pi
   use microslip_halfspace_love_cerruti, only: material_t, elastic_material, rigid_material, half_space_pair_t, &
      & half_space_pair, influence
   use testdrive, only: new_unittest, unittest_type, test_error => error_type, check
   implicit none(type, external)
   private

   public :: collect_halfspace_love_cerruti

   !> Rounding of differences of order-one antiderivatives at up to 24 half widths, and of the quadrature.
   real(wp), parameter :: tol = 1.0e-12_wp
   real(wp), parameter :: dx = 1.3_wp, dy = 0.7_wp

contains

   subroutine collect_halfspace_love_cerruti(testsuite)
      type(unittest_type), allocatable, intent(out) :: testsuite(:)

      testsuite = [ &
         & new_unittest('quadrature', test_quadrature), &
         & new_unittest('far-field', test_far_field), &
         & new_unittest('square-patch', test_square_patch), &
         & new_unittest('reciprocity', test_reciprocity), &
         & new_unittest('pressing-pulls-inward', test_inward), &
         & new_unittest('equal-materials', test_equal_materials), &
         & new_unittest('unit-of-length', test_unit_of_length), &
         & new_unittest('bad-materials', test_bad_materials) &
         & ]
   end subroutine collect_halfspace_love_cerruti

   !> A material that must be accepted.
   function elastic(young_modulus, poisson_ratio) result(material)
      real(wp), intent(in) :: young_modulus, poisson_ratio
      type(material_t) :: material
      type(error_t), allocatable :: problem

      call elastic_material(material, young_modulus, poisson_ratio, problem)
      if (allocated(problem)) error stop 'material refused'
   end function elastic

   !> Self, neighbour, edge, corner, inside off-centre, and far points; two bodies and one.
   subroutine test_quadrature(error)
      type(test_error), allocatable, intent(out) :: error
      real(wp), parameter :: field(2, 11) = reshape([0.0_wp, 0.0_wp, dx, 0.0_wp, 0.0_wp, -dy, dx, dy, -dx, dy, &
         & 0.5_wp*dx, 0.1_wp, 0.5_wp*dx, 0.5_wp*dy, -0.2_wp, 0.3_wp, 0.64_wp, -0.349_wp, 12.0_wp, -7.0_wp, &
         & -3.0_wp, 0.0_wp], [2, 11])
      type(material_t) :: a, b
      real(wp) :: c(3, 3), reference(3, 3), largest
      integer :: k

      a = elastic(2.0_wp, 0.2854_wp)
      b = elastic(0.7_wp, 0.4_wp)
      largest = maxval(abs(influence(half_space_pair(a, b), 0.0_wp, 0.0_wp, dx, dy)))
      do k = 1, size(field, 2)
         c = influence(half_space_pair(a, b), field(1, k), field(2, k), dx, dy)
         reference = integrated(a, field(:, k)) + mirrored(integrated(b, field(:, k)))
         call check(error, maxval(abs(c - reference)) <= tol*largest, 'two bodies')
         if (allocated(error)) return
         c = influence(half_space_pair(rigid_material(), b), field(1, k), field(2, k), dx, dy)
         call check(error, maxval(abs(c - mirrored(integrated(b, field(:, k))))) <= tol*largest, 'one body')
         if (allocated(error)) return
      end do
   end subroutine test_quadrature

   !> Body B in its own frame (t1, t2, -n) carries the reaction: its share of g is T^T U T with T = diag(-1,1,1).
   pure function mirrored(u) result(c)
      real(wp), intent(in) :: u(3, 3)
      real(wp) :: c(3, 3)

      c = u
      c(1, 2:3) = -u(1, 2:3)
      c(2:3, 1) = -u(2:3, 1)
   end function mirrored

   !> Mean of the point kernel over the rectangle by polar coordinates about the field point: the kernel is k(direction)/r,
   !> so the radial integral is exact, and each edge at distance d contributes d int k dt with s = d sinh t along it.
   function integrated(material, point) result(u)
      type(material_t), intent(in) :: material
      real(wp), intent(in) :: point(2)
      real(wp) :: u(3, 3)
      integer, parameter :: panels = 12, order = 24
      real(wp) :: corner(2, 5), along(2), normal(2), d, t0, t1, t, width, node(order), weight(order), r(2)
      integer :: edge, panel, k

      call gauss_legendre(node, weight)
      corner = 0.5_wp*reshape([-dx, -dy, dx, -dy, dx, dy, -dx, dy, -dx, -dy], [2, 5])
      u = 0.0_wp
      do edge = 1, 4
         along = (corner(:, edge + 1) - corner(:, edge))/norm2(corner(:, edge + 1) - corner(:, edge))
         normal = [along(2), -along(1)]
         d = dot_product(corner(:, edge) - point, normal)
         if (d == 0.0_wp) cycle
         t0 = asinh(dot_product(corner(:, edge) - point, along)/abs(d))
         t1 = asinh(dot_product(corner(:, edge + 1) - point, along)/abs(d))
         width = (t1 - t0)/panels
         do panel = 1, panels
            do k = 1, order
               t = t0 + width*(panel - 0.5_wp + 0.5_wp*node(k))
               r = -(d*normal + abs(d)*sinh(t)*along)
               u = u + 0.5_wp*width*weight(k)*d*point_kernel(material, r/norm2(r))
            end do
         end do
      end do
      u = u/(dx*dy)
   end function integrated

   !> Boussinesq and Cerruti at the distance r, order (n, t1, t2), n into the body.
   pure function point_kernel(material, r) result(k)
      type(material_t), intent(in) :: material
      real(wp), intent(in) :: r(2)
      real(wp) :: k(3, 3)
      real(wp) :: c, nu, length

      nu = material%poisson_ratio
      c = (1.0_wp + nu)/(2.0_wp*pi*material%young_modulus)
      length = norm2(r)
      k(1, 1) = 2*c*(1 - nu)/length
      k(1, 2:3) = c*(1 - 2*nu)*r/length**2
      k(2:3, 1) = -k(1, 2:3)
      k(2, 2) = 2*c*((1 - nu)/length + nu*r(1)**2/length**3)
      k(3, 3) = 2*c*((1 - nu)/length + nu*r(2)**2/length**3)
      k(2, 3) = 2*c*nu*r(1)*r(2)/length**3
      k(3, 2) = k(2, 3)
   end function point_kernel

   !> Nodes and weights on (-1, 1), by Newton on the Legendre polynomial.
   pure subroutine gauss_legendre(node, weight)
      real(wp), intent(out) :: node(:), weight(:)
      real(wp) :: p(3), slope
      integer :: n, k, m, sweep

      n = size(node)
      do k = 1, n
         node(k) = cos(pi*(k - 0.25_wp)/(n + 0.5_wp))
         do sweep = 1, 8
            p = [0.0_wp, 1.0_wp, 0.0_wp]
            do m = 1, n
               p(3) = p(1)
               p(1) = p(2)
               p(2) = ((2*m - 1)*node(k)*p(1) - (m - 1)*p(3))/m
            end do
            slope = n*(node(k)*p(2) - p(1))/(node(k)**2 - 1.0_wp)
            node(k) = node(k) - p(2)/slope
         end do
         weight(k) = 2.0_wp/((1.0_wp - node(k)**2)*slope**2)
      end do
   end subroutine gauss_legendre

   !> Far away the rectangle acts as a point: relative error (size/r)^2/20.
   subroutine test_far_field(error)
      type(test_error), allocatable, intent(out) :: error
      type(material_t) :: a
      real(wp) :: k(3, 3)

      a = elastic(1.0_wp, 0.3_wp)
      k = point_kernel(a, [80.0_wp, -60.0_wp])
      call check(error, maxval(abs(influence(half_space_pair(a, rigid_material()), 80.0_wp, -60.0_wp, 1.0_wp, 1.0_wp) - k)) &
         & <= 1.0e-5_wp*maxval(abs(k)))
   end subroutine test_far_field

   !> Displacement under a square patch in units of p s (1 - nu^2)/E: centre, corner and mean.
   subroutine test_square_patch(error)
      type(test_error), allocatable, intent(out) :: error
      integer, parameter :: order = 40
      real(wp), parameter :: s = 3.0_wp, e = 5.0_wp, nu = 0.3_wp
      type(half_space_pair_t) :: pair
      real(wp) :: node(order), weight(order), unit, mean
      integer :: i, j

      pair = half_space_pair(elastic(e, nu), rigid_material())
      unit = (1.0_wp - nu**2)/(e*s)
      call check(error, normal(0.0_wp, 0.0_wp), 1.12219970_wp*unit, thr=1.0e-8_wp*unit)
      if (allocated(error)) return
      call check(error, normal(0.5_wp*s, -0.5_wp*s), 0.56109985_wp*unit, thr=1.0e-8_wp*unit)
      if (allocated(error)) return
      call gauss_legendre(node, weight)
      mean = 0.0_wp
      do j = 1, order
         do i = 1, order
            mean = mean + 0.25_wp*weight(i)*weight(j)*normal(0.5_wp*s*node(i), 0.5_wp*s*node(j))
         end do
      end do
      call check(error, mean, 0.94640201_wp*unit, thr=1.0e-6_wp*unit)

   contains

      real(wp) function normal(x, y)
         real(wp), intent(in) :: x, y
         real(wp) :: block(3, 3)
         block = influence(pair, x, y, s, s)
         normal = block(1, 1)
      end function normal

   end subroutine test_square_patch

   !> C(-x, -y) = C(x, y)^T.
   subroutine test_reciprocity(error)
      type(test_error), allocatable, intent(out) :: error
      type(half_space_pair_t) :: pair
      real(wp) :: c(3, 3)

      pair = half_space_pair(elastic(1.0_wp, 0.1_wp), elastic(3.0_wp, 0.45_wp))
      c = influence(pair, 0.9_wp, -2.1_wp, dx, dy)
      call check(error, maxval(abs(c - transpose(influence(pair, -0.9_wp, 2.1_wp, dx, dy)))) <= 1.0e-14_wp*c(1, 1))
      if (allocated(error)) return
      call check(error, abs(c(1, 2)) > 1.0e-3_wp*c(1, 1), 'the materials must couple for this test to say anything')
   end subroutine test_reciprocity

   !> Pressing pulls the surface of the compressible body towards the load; g is A less B, so the sign depends on which
   !> of them deforms. A drag along +t1 on A raises what lies ahead of it into A (opens, g_n > 0).
   subroutine test_inward(error)
      type(test_error), allocatable, intent(out) :: error
      type(material_t) :: steel
      real(wp) :: on_a(3, 3), on_b(3, 3)

      steel = elastic(1.0_wp, 0.3_wp)
      on_a = influence(half_space_pair(steel, rigid_material()), 2.0_wp, 0.0_wp, 1.0_wp, 1.0_wp)
      on_b = influence(half_space_pair(rigid_material(), steel), 2.0_wp, 0.0_wp, 1.0_wp, 1.0_wp)
      call check(error, on_a(2, 1) < 0.0_wp .and. on_b(2, 1) > 0.0_wp)
      if (allocated(error)) return
      call check(error, on_a(1, 2) > 0.0_wp .and. on_a(1, 1) > 0.0_wp .and. on_b(1, 1) > 0.0_wp)
      if (allocated(error)) return
      on_a = influence(half_space_pair(elastic(1.0_wp, 0.5_wp), rigid_material()), 2.0_wp, 0.0_wp, 1.0_wp, 1.0_wp)
      call check(error, all(on_a(2:3, 1) == 0.0_wp), 'an incompressible body does not couple')
   end subroutine test_inward

   !> Equal materials: no coupling at all, and twice the compliance of one body.
   subroutine test_equal_materials(error)
      type(test_error), allocatable, intent(out) :: error
      type(material_t) :: steel
      real(wp) :: both(3, 3), one(3, 3)

      steel = elastic(194.0e9_wp, 0.2854_wp)
      both = influence(half_space_pair(steel, steel), 2.0e-3_wp, 1.0e-3_wp, 1.0e-3_wp, 1.0e-3_wp)
      one = influence(half_space_pair(steel, rigid_material()), 2.0e-3_wp, 1.0e-3_wp, 1.0e-3_wp, 1.0e-3_wp)
      call check(error, all(both(1, 2:3) == 0.0_wp) .and. all(both(2:3, 1) == 0.0_wp))
      if (allocated(error)) return
      call check(error, maxval(abs(both(2:3, 2:3) - 2.0_wp*one(2:3, 2:3))) <= 4.0_wp*epsilon(1.0_wp)*both(2, 2))
   end subroutine test_equal_materials

   !> C E L has no unit: metres and pascal give what millimetres and megapascal give.
   subroutine test_unit_of_length(error)
      type(test_error), allocatable, intent(out) :: error
      real(wp) :: metre(3, 3), millimetre(3, 3)

      metre = influence(half_space_pair(elastic(70.0e9_wp, 0.33_wp), elastic(210.0e9_wp, 0.3_wp)), &
         & 2.3e-3_wp, -4.1e-3_wp, 0.5e-3_wp, 0.4e-3_wp)*70.0e9_wp*1.0e-3_wp
      millimetre = influence(half_space_pair(elastic(70.0e3_wp, 0.33_wp), elastic(210.0e3_wp, 0.3_wp)), &
         & 2.3_wp, -4.1_wp, 0.5_wp, 0.4_wp)*70.0e3_wp
      call check(error, maxval(abs(metre - millimetre)) <= 1.0e-14_wp*self_term(), 'the units differ')

   contains

      real(wp) function self_term()
         real(wp) :: c(3, 3)
         c = influence(half_space_pair(elastic(70.0e3_wp, 0.33_wp), elastic(210.0e3_wp, 0.3_wp)), &
            & 0.0_wp, 0.0_wp, 0.5_wp, 0.4_wp)*70.0e3_wp
         self_term = c(1, 1)
      end function self_term

   end subroutine test_unit_of_length

   subroutine test_bad_materials(error)
      type(test_error), allocatable, intent(out) :: error
      real(wp), parameter :: bad(2, 5) = reshape([0.0_wp, 0.3_wp, -1.0_wp, 0.3_wp, huge(1.0_wp), 0.51_wp, &
         & 1.0_wp, -1.0_wp, 1.0_wp, 2.0_wp], [2, 5])
      type(material_t) :: material
      type(error_t), allocatable :: problem
      integer :: k

      do k = 1, size(bad, 2)
         call elastic_material(material, bad(1, k), bad(2, k), problem)
         call check(error, allocated(problem), 'bad material accepted')
         if (allocated(error)) return
         call check(error, problem%status, status_bad_input)
         if (allocated(error)) return
      end do
   end subroutine test_bad_materials

end module test_halfspace_love_cerruti
