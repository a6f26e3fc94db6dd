!> The files that a case names to be read: the one list of them. What these files name in turn is known when they are read
!> (`microslip_io_input_files`).
module microslip_io_case_inputs
   use microslip_io_case, only: case_t
   implicit none(type, external)
   private

   public :: case_input_t, list_inputs

   type :: case_input_t
      !> What it is, in words
      character(len=:), allocatable :: role
      !> As seen from the current folder
      character(len=:), allocatable :: path
   end type case_input_t

   !> Matrices of CalculiX
   character(len=*), parameter :: matrix_files(3) = ['.sti', '.mas', '.dof']

contains

   !> The case file itself, model, mesh, topographies, tables.
   subroutine list_inputs(case, inputs)
      type(case_t), intent(in) :: case
      type(case_input_t), allocatable, intent(out) :: inputs(:)
      integer :: k

      allocate (inputs(0))
      call add('case file', case%path)
      if (case%model%source == 'calculix') then
         do k = 1, size(matrix_files)
            call add('model', case%located(case%model%file)//matrix_files(k))
         end do
      else
         call add('model', case%located(case%model%file))
      end if
      if (case%model%mesh_file /= '') call add('mesh', case%located(case%model%mesh_file))
      do k = 1, size(case%topographies)
         if (case%topographies(k)%file /= '') call add('topography', case%located(case%topographies(k)%file))
      end do
      do k = 1, size(case%excitations)
         if (case%excitations(k)%file /= '') call add('table of an excitation', case%located(case%excitations(k)%file))
      end do

   contains

      subroutine add(role, path)
         character(len=*), intent(in) :: role, path
         type(case_input_t), allocatable :: more(:)
         integer :: n

         n = size(inputs)
         allocate (more(n + 1))
         more(:n) = inputs
         more(n + 1)%role = role
         more(n + 1)%path = path
         call move_alloc(more, inputs)
      end subroutine add

   end subroutine list_inputs

end module microslip_io_case_inputs
