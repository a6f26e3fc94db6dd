!> Contact solvers by name.
module microslip_contact_factory
   use microslip_contact_condensed, only: condensed_solver_t
   use microslip_contact_matrix_free, only: matrix_free_solver_t
   use microslip_contact_plain_jacobi, only: plain_jacobi_t
   use microslip_contact_problem, only: contact_solver_t
   use microslip_core_error, only: error_t, bad_input
   use microslip_core_kinds, only: wp
   implicit none(type, external)
   private

   public :: contact_options_t, new_contact_solver

   !> What the user may choose about the contact.
   type :: contact_options_t
      !> 'condensed', 'jacobi' (the paper's, all points), 'jacobi_eliminated' (sticking points eliminated), or, where the
      !> compliance is an operator, 'matrix_free'
      character(len=:), allocatable :: solver
      !> Wanted relative accuracy of the contact forces
      real(wp) :: tolerance = 1.0e-10_wp
      !> Of the projected Jacobi, per step
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
      case default
         call bad_input(error, "no contact solver '"//options%solver// &
            & "' (allowed: 'condensed', 'jacobi', 'jacobi_eliminated', 'matrix_free')")
         return
      end select
      solver%tolerance = options%tolerance
      solver%max_iterations = options%max_iterations
   end subroutine new_contact_solver

end module microslip_contact_factory
