!> The contact compliance G as an operator, for grids on which the matrix does not fit.
!>
!> Solvers see products and an approximate inverse only; who implements it (FFT, structure) they do not know.
module microslip_contact_compliance_operator
   use microslip_core_kinds, only: wp
   implicit none(type, external)
   private

   public :: contact_compliance_t

   !> Symmetric positive definite on the points in potential contact. Unknown order (n, t1, t2) per point.
   type, abstract :: contact_compliance_t
   contains
      procedure(product_interface), deferred :: product
      procedure(product_interface), deferred :: precondition
      procedure(stiffness_interface), deferred :: local_stiffness
   end type contact_compliance_t

   abstract interface
      !> product: the gap that contact forces make, y = G x. precondition: y = B x with B symmetric positive definite and
      !> near the inverse of the short-range part of G.
      subroutine product_interface(self, x, y)
         import :: contact_compliance_t, wp
         implicit none(type, external)
         class(contact_compliance_t), intent(in) :: self
         !> (3, points) forces, N (precondition: gaps, m)
         real(wp), intent(in), contiguous :: x(:, :)
         !> (3, points) gaps, m (precondition: forces, N)
         real(wp), intent(out), contiguous :: y(:, :)
      end subroutine product_interface

      !> Stiffness of every point against a change of its own force alone, the diagonal of B, (3, points), N/m.
      function stiffness_interface(self) result(stiffness)
         import :: contact_compliance_t, wp
         implicit none(type, external)
         class(contact_compliance_t), intent(in) :: self
         real(wp), allocatable :: stiffness(:, :)
      end function stiffness_interface
   end interface

end module microslip_contact_compliance_operator
