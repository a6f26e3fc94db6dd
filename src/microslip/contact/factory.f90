!> Contact solvers by name.
module microslip_contact_factory
   use microslip_contact_condensed, only: condensed_solver_t
   use microslip_contact_gauss_seidel, only: gauss_seidel_t
   use microslip_contact_matrix_free, only: matrix_free_solver_t
   use microslip_contact_newton, only: newton_t
   use microslip_contact_plain_jacobi, only: plain_jacobi_t
   use microslip_contact_problem, only: contact_solver_t
   use microslip_core_error, only: error_t, bad_input
   use microslip_core_kinds, only: wp
   implicit none(type, external)
   private

   public :: contact_options_t, new_contact_solver, contact_solver_names, knows_soft

   !> Stick predictor with corrector; projected Jacobi of the paper, on all points and with the sticking points
   !> eliminated; block Gauss-Seidel and semismooth Newton on the forces, which take any compliance.
   character(len=*), parameter :: contact_solver_names(5) = [character(len=17) :: 'condensed', 'jacobi', &
      & 'jacobi_eliminated', 'gauss_seidel', 'newton']

   !> What the user may choose about the contact.
   type :: contact_options_t
      !> One of `contact_solver_names`, or 'matrix_free' where the compliance is an operator
      character(len=:), allocatable :: solver
      !> Wanted relative accuracy of the contact forces
      real(wp) :: tolerance = 1.0e-10_wp
      !> Most iterations of a step: sweeps, Newton steps
      integer :: max_iterations = 100000
      !> Normal law on velocity level, as in the paper, instead of gap level
      logical :: velocity_level = .false.
   end type contact_options_t

contains

   !> Make the solver the options ask for.
   subroutine new_contact_solver(options, solver, error)
      type(contact_options_t), intent(in) :: options
      class(contact_solver_t), allocatable, intent(out) :: solver
      !> Unknown name
      type(error_t), allocatable, intent(out) :: error

      select case (options%solver)
      case ('condensed')
         allocate (condensed_solver_t :: solver)
      case ('matrix_free')
         allocate (matrix_free_solver_t :: solver)
      case ('jacobi_eliminated')
         allocate (solver, source=condensed_solver_t(by_jacobi=.true.))
      case ('jacobi')
         allocate (plain_jacobi_t :: solver)
      case ('gauss_seidel')
         allocate (gauss_seidel_t :: solver)
      case ('newton')
         allocate (newton_t :: solver)
      case default
         call bad_input(error, "no contact solver '"//options%solver//"' (allowed: '"// &
            & trim(contact_solver_names(1))//list_of(contact_solver_names(2:))//"')")
         return
      end select
      solver%tolerance = options%tolerance
      solver%max_iterations = options%max_iterations
   end subroutine new_contact_solver

   !> Whether the solver takes problems that keep soft directions apart.
   pure logical function knows_soft(options)
      type(contact_options_t), intent(in) :: options

      knows_soft = any(options%solver == [character(len=17) :: 'condensed', 'jacobi_eliminated', 'matrix_free'])
   end function knows_soft

   !> ', name' for each name, quoted.
   pure function list_of(names) result(text)
      character(len=*), intent(in) :: names(:)
      character(len=:), allocatable :: text
      integer :: k

      text = ''
      do k = 1, size(names)
         text = text//"', '"//trim(names(k))
      end do
   end function list_of

end module microslip_contact_factory
