!> Closed-form influence coefficients of a uniformly loaded rectangle on elastic half spaces:
!> Love (normal load) and Cerruti (tangential load). METHOD section 3. SI units.
!>
!> Signs. n points from body B into body A. The contact force lambda = (n, t1, t2) acts on A along the
!> axes and on B against them; g = u_A - u_B, so g_n > 0 opens and lambda_n > 0 presses on both bodies.
!> With x = t1, y = t2 and r the vector from the centre of the loaded rectangle to the field point:
!>
!>     C_nn = N I[1/r]                          N = sum of (1 - nu^2)/(pi E) over both bodies
!>     C_11 = N I[1/r] + S I[x^2/r^3]           S = sum of nu (1 + nu)/(pi E)
!>     C_22 = N I[1/r] + S I[y^2/r^3]
!>     C_12 = C_21 = S I[x y/r^3]
!>     C_n1 = -C_1n = D I[x/r^2]                D = difference A - B of (1 + nu)(1 - 2 nu)/(2 pi E)
!>     C_n2 = -C_2n = D I[y/r^2]
!>
!> I[.] is the integral over the rectangle divided by its area (lambda is a force). Body B is the mirror
!> image of A and carries the reaction, hence the sums, and the difference in D: equal materials have no
!> normal-tangential coupling. For a single loaded half space, make the other body rigid.
!> Pressing a compressible body pulls its surface towards the load (u_t1 < 0 at x > 0): C_1n < 0 there.
!>
!> References: A. E. H. Love, Phil. Trans. R. Soc. A 228 (1929) 377; K. L. Johnson, Contact Mechanics,
!> Cambridge 1985, sections 3.2, 3.3 and 3.6.
module microslip_halfspace_love_cerruti
   use, intrinsic :: ieee_arithmetic, only: ieee_is_finite
   use microslip_core_error, only: error_t, bad_input
   use microslip_core_kinds, only: wp, pi
   use microslip_core_text, only: to_text
   implicit none(type, external)
   private

   public :: material_t, elastic_material, rigid_material
   public :: half_space_pair_t, half_space_pair, influence, rectangle_integrals

   !> Isotropic linear elastic body, or a rigid one. Made by `elastic_material` or `rigid_material`.
   type :: material_t
      !> N/m^2, not used when rigid
      real(wp) :: young_modulus = 0.0_wp
      real(wp) :: poisson_ratio = 0.0_wp
      logical :: rigid = .true.
   end type material_t

   !> What the surface displacement of two half spaces in contact depends on, m^2/N.
   type :: half_space_pair_t
      !> N = sum of (1 - nu^2)/(pi E)
      real(wp) :: normal = 0.0_wp
      !> S = sum of nu (1 + nu)/(pi E)
      real(wp) :: shear = 0.0_wp
      !> D = (1 + nu)(1 - 2 nu)/(2 pi E) of body A less that of body B
      real(wp) :: coupling = 0.0_wp
   end type half_space_pair_t

contains

   !> An elastic material; refuses a modulus that is not positive and a Poisson ratio outside (-1, 0.5].
   subroutine elastic_material(material, young_modulus, poisson_ratio, error)
      !> The material
      type(material_t), intent(out) :: material
      !> Young's modulus, N/m^2
      real(wp), intent(in) :: young_modulus
      !> Poisson's ratio
      real(wp), intent(in) :: poisson_ratio
      !> Set when a value is not allowed
      type(error_t), allocatable, intent(out) :: error

      if (.not. (ieee_is_finite(young_modulus) .and. young_modulus > 0.0_wp)) then
         call bad_input(error, 'Young''s modulus must be positive and finite, got '//to_text(young_modulus)// &
            & ' (a rigid body is asked for as such)')
         return
      end if
      if (.not. (poisson_ratio > -1.0_wp .and. poisson_ratio <= 0.5_wp)) then
         call bad_input(error, 'Poisson''s ratio must be above -1 and at most 0.5, got '//to_text(poisson_ratio))
         return
      end if
      material = material_t(young_modulus, poisson_ratio, rigid=.false.)
   end subroutine elastic_material

   !> A body that does not deform.
   pure function rigid_material() result(material)
      type(material_t) :: material
      material = material_t(rigid=.true.)
   end function rigid_material

   !> The constants N, S, D of two bodies; n points from B into A.
   pure function half_space_pair(body_a, body_b) result(pair)
      !> The body that lambda pushes along +n
      type(material_t), intent(in) :: body_a
      !> The body that lambda pushes along -n
      type(material_t), intent(in) :: body_b
      type(half_space_pair_t) :: pair
      type(half_space_pair_t) :: a, b

      a = single_half_space(body_a)
      b = single_half_space(body_b)
      pair = half_space_pair_t(a%normal + b%normal, a%shear + b%shear, a%coupling - b%coupling)
   end function half_space_pair

   !> The constants of one body.
   pure function single_half_space(body) result(constants)
      type(material_t), intent(in) :: body
      type(half_space_pair_t) :: constants

      if (body%rigid) return
      associate (e => body%young_modulus, nu => body%poisson_ratio)
         constants%normal = (1.0_wp - nu)*(1.0_wp + nu)/(pi*e)
         constants%shear = nu*(1.0_wp + nu)/(pi*e)
         constants%coupling = (1.0_wp + nu)*(1.0_wp - 2.0_wp*nu)/(2.0_wp*pi*e)
      end associate
   end function single_half_space

   !> The 3 x 3 block C(field point, loaded rectangle), order (n, t1, t2), m/N: relative displacement at
   !> (x, y) from the centre of a rectangle dx x dy that carries a unit force, evenly spread.
   !> Reciprocity: the block at (-x, -y) is the transpose.
   pure function influence(pair, x, y, dx, dy) result(block)
      !> The two bodies
      type(half_space_pair_t), intent(in) :: pair
      !> Field point less centre of the rectangle, along t1 and t2, m
      real(wp), intent(in) :: x, y
      !> Full widths of the rectangle, m
      real(wp), intent(in) :: dx, dy
      real(wp) :: block(3, 3)
      real(wp) :: integral(5), area

      area = dx*dy
      integral = rectangle_integrals(x, y, dx, dy)/area
      block(1, 1) = pair%normal*(integral(1) + integral(2))
      block(2, 2) = block(1, 1) + pair%shear*integral(1)
      block(3, 3) = block(1, 1) + pair%shear*integral(2)
      block(2, 3) = pair%shear*integral(3)
      block(3, 2) = block(2, 3)
      block(1, 2:3) = pair%coupling*integral(4:5)
      block(2:3, 1) = -block(1, 2:3)
   end function influence

   !> Integrals of x^2/r^3, y^2/r^3, xy/r^3, x/r^2 and y/r^2 over the rectangle, m; 1/r is the sum of the
   !> first two.
   !>
   !> Each is the difference F(x+a,y+b) - F(x-a,y+b) - F(x+a,y-b) + F(x-a,y-b) of an antiderivative F, a and
   !> b the half widths. All F are of degree one in the lengths (up to terms that cancel), so they are
   !> evaluated in units of sqrt(dx dy): the result does not depend on the unit of length.
   pure function rectangle_integrals(x, y, dx, dy) result(integral)
      !> Field point less centre of the rectangle, m
      real(wp), intent(in) :: x, y
      !> Full widths of the rectangle, m
      real(wp), intent(in) :: dx, dy
      real(wp) :: integral(5)
      real(wp) :: unit, x_high, x_low, y_high, y_low

      unit = sqrt(dx*dy)
      x_high = (x + 0.5_wp*dx)/unit
      x_low = (x - 0.5_wp*dx)/unit
      y_high = (y + 0.5_wp*dy)/unit
      y_low = (y - 0.5_wp*dy)/unit
      integral = unit*((antiderivatives(x_high, y_high) - antiderivatives(x_low, y_high)) &
         & - (antiderivatives(x_high, y_low) - antiderivatives(x_low, y_low)))
   end function rectangle_integrals

   !> F of x^2/r^3, y^2/r^3, xy/r^3, x/r^2, y/r^2 with d2F/(dx dy) = the integrand. Products of zero and
   !> infinity are zero, so points on edges, corners and the centre need no special case elsewhere.
   pure function antiderivatives(x, y) result(f)
      real(wp), intent(in) :: x, y
      real(wp) :: f(5)
      real(wp) :: r

      r = hypot(x, y)
      f = 0.0_wp
      f(3) = -r
      if (x /= 0.0_wp) then
         f(2) = x*asinh(y/abs(x))
         f(4) = x*atan(y/x)
         f(5) = x*log(r)
      end if
      if (y /= 0.0_wp) then
         f(1) = y*asinh(x/abs(y))
         f(4) = f(4) + y*log(r)
         f(5) = f(5) + y*atan(x/y)
      end if
   end function antiderivatives

end module microslip_halfspace_love_cerruti
