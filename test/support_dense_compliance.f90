!> A dense compliance behind the interface of the operator, with its diagonal as preconditioner: solvers for operators meet
!> problems whose matrix is known.
module support_dense_compliance
   use microslip_contact_compliance_operator, only: contact_compliance_t
   use microslip_contact_problem, only: contact_problem_t
   use microslip_core_kinds, only: wp
   implicit none(type, external)
   private

   public :: with_operator

   type, extends(contact_compliance_t) :: dense_compliance_t
      real(wp), allocatable :: G(:, :)
   contains
      procedure :: product => product_with
      procedure :: precondition
      procedure :: local_stiffness
   end type dense_compliance_t

contains

   !> The same problem with its matrix behind an operator.
   function with_operator(problem) result(same)
      type(contact_problem_t), intent(in) :: problem
      type(contact_problem_t) :: same

      same%n_points = problem%n_points
      same%R = problem%R
      same%r_0 = problem%r_0
      same%friction = problem%friction
      same%velocity_level = problem%velocity_level
      if (allocated(problem%soft)) then
         same%soft = problem%soft
         same%soft_drive = problem%soft_drive
         same%soft_0 = problem%soft_0
      end if
      allocate (same%compliance, source=dense_compliance_t(G=problem%G))
   end function with_operator

   subroutine product_with(self, x, y)
      class(dense_compliance_t), intent(in) :: self
      real(wp), intent(in), contiguous :: x(:, :)
      real(wp), intent(out), contiguous :: y(:, :)

      y = reshape(matmul(self%G, reshape(x, [size(x)])), shape(y))
   end subroutine product_with

   subroutine precondition(self, x, y)
      class(dense_compliance_t), intent(in) :: self
      real(wp), intent(in), contiguous :: x(:, :)
      real(wp), intent(out), contiguous :: y(:, :)

      y = self%local_stiffness()*x
   end subroutine precondition

   function local_stiffness(self) result(stiffness)
      class(dense_compliance_t), intent(in) :: self
      real(wp), allocatable :: stiffness(:, :)
      integer :: k

      stiffness = reshape([(1.0_wp/self%G(k, k), k=1, size(self%G, 1))], [3, size(self%G, 1)/3])
   end function local_stiffness

end module support_dense_compliance
