!> What no structure has: nodes far away, elements without volume, matrix entries that the diagonal does not allow.
!>
!> A matrix A that is positive semidefinite has |a_ij| <= sqrt(a_ii a_jj): stiffness and mass whatever the elements. An
!> element is inside out where the Jacobian of its corner nodes is not positive in its middle.
module microslip_fe_model_check
   use microslip_core_error, only: bad_input, error_t
   use microslip_core_kinds, only: wp
   use microslip_core_text, only: to_text
   use microslip_fe_model, only: fe_model_t
   use microslip_linalg_sparse, only: symmetric_sparse_t
   implicit none(type, external)
   private

   public :: check_model

   !> m
   real(wp), parameter :: farthest = 1.0e6_wp
   !> N/m or kg, of a diagonal entry.
   real(wp), parameter :: largest = 1.0e30_wp
   !> Rounding of entries in text files, and of condensed ones.
   real(wp), parameter :: rounding = 1.0e-6_wp
   !> Volume over that of a cube of the longest edge, below which there is none.
   real(wp), parameter :: flat = 1.0e-12_wp
   !> (corners) where a corner of a brick is along its three edges, Abaqus order.
   real(wp), parameter :: along(8, 3) = reshape([real(wp) :: -1, 1, 1, -1, -1, 1, 1, -1, -1, -1, 1, 1, -1, -1, 1, 1, &
      & -1, -1, -1, -1, 1, 1, 1, 1], [8, 3])

contains

   !> The first fault of a model.
   subroutine check_model(model, error)
      type(fe_model_t), intent(in) :: model
      !> Names node, element or entry; not the file
      type(error_t), allocatable, intent(out) :: error
      integer :: k

      k = findloc(maxval(abs(model%coordinates), 1) <= farthest, .false., dim=1)
      if (k > 0) then
         call bad_input(error, 'node '//to_text(model%node_label(k))//' is at '// &
            & to_text(model%coordinates(maxloc(abs(model%coordinates(:, k)), 1), k))//' m, allowed are '//to_text(farthest) &
            & //' m from the origin at most: is the unit of length right?')
         return
      end if
      call check_elements(model, error)
      if (.not. allocated(error)) call check_matrix(model, 'stiffness', model%stiffness, error)
      if (.not. allocated(error)) call check_matrix(model, 'mass', model%mass, error)
   end subroutine check_model

   !> Every element has a volume.
   subroutine check_elements(model, error)
      type(fe_model_t), intent(in) :: model
      type(error_t), allocatable, intent(out) :: error
      real(wp) :: edge(3, 3)
      integer :: k, e

      do k = 1, size(model%elements)
         associate (connectivity => model%elements(k)%connectivity)
            do e = 1, size(connectivity, 2)
               edge = matmul(model%coordinates(:, connectivity(:8, e)), along)
               if (triple_product(edge) > flat*maxval(norm2(edge, 1))**3) cycle
               call bad_input(error, 'element '//to_text(e)//' of type '//model%elements(k)%type//' (nodes '// &
                  & to_text(model%node_label(connectivity(1, e)))//', '//to_text(model%node_label(connectivity(2, e)))// &
                  & ', ...) is inside out or has no volume: are its nodes in the order of Abaqus, and in their places?')
               return
            end do
         end associate
      end do
   end subroutine check_elements

   !> a . (b x c) of the columns.
   pure real(wp) function triple_product(edge)
      real(wp), intent(in) :: edge(3, 3)

      triple_product = dot_product(edge(:, 1), [edge(2, 2)*edge(3, 3) - edge(3, 2)*edge(2, 3), &
         & edge(3, 2)*edge(1, 3) - edge(1, 2)*edge(3, 3), edge(1, 2)*edge(2, 3) - edge(2, 2)*edge(1, 3)])
   end function triple_product

   !> No entry is larger than its diagonal entries allow.
   subroutine check_matrix(model, name, matrix, error)
      type(fe_model_t), intent(in) :: model
      character(len=*), intent(in) :: name
      type(symmetric_sparse_t), intent(in) :: matrix
      type(error_t), allocatable, intent(out) :: error
      real(wp), allocatable :: root(:)
      integer :: row, k

      root = sqrt(max(matrix%diagonal(), 0.0_wp))
      if (.not. any(root > 0.0_wp)) then
         call bad_input(error, 'the '//name//' matrix is zero')
         return
      end if
      row = findloc(root <= sqrt(largest), .false., dim=1)
      if (row > 0) then
         call bad_input(error, 'the '//name//' matrix is not that of a structure: the diagonal entry of '//row_name(row)// &
            & ' is '//to_text(matrix%value(matrix%row_start(row)))//', allowed are '//to_text(largest)//' at most')
         return
      end if
      do row = 1, matrix%n
         do k = matrix%row_start(row) + 1, matrix%row_start(row + 1) - 1
            if (abs(matrix%value(k)) <= (1.0_wp + rounding)*root(row)*root(matrix%column(k))) cycle
            call bad_input(error, 'the '//name//' matrix is not that of a structure: its entry of '//row_name(row)//' and '// &
               & row_name(matrix%column(k))//' is '//to_text(matrix%value(k))//', with diagonal entries of '// &
               & to_text(root(row)**2)//' and '//to_text(root(matrix%column(k))**2)//' it is at most the root of their product')
            return
         end do
      end do

   contains

      !> 'node 12.3'
      function row_name(row) result(name)
         integer, intent(in) :: row
         character(len=:), allocatable :: name
         name = 'node '//to_text(model%node_label(model%row_node(row)))//'.'//to_text(model%row_component(row))
      end function row_name

   end subroutine check_matrix

end module microslip_fe_model_check
