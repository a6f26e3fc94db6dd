!> Forces on every node in the simplest motions of all nodes, from sums over the rows of the matrices:
!>
!>     T_i(c, d)    = sum_j K_(ic),(jd)                    stiffness, unit translation along d
!>     P_i(c, d, b) = sum_j K_(ic),(jd) (x_j - x_i)_b      stiffness, displacement (x - x_i)_b along d
!>     m_i(c, d)    = sum_j M_(ic),(jd)                    mass, unit acceleration along d
!>
!> Where no support, spring or other material is near, T_i = 0, P_i(c, d, b) = P_i(c, b, d) (no force in a rotation about
!> the node), and m_i is a multiple of the unit matrix. The sums of the sizes of the terms bound what rounding leaves:
!> entries that err by u of themselves give a force that errs by u times that sum at most.
module microslip_fe_node_sums
   use microslip_core_kinds, only: wp
   use microslip_fe_model, only: fe_model_t
   implicit none(type, external)
   private

   public :: node_sums_t, sum_rows

   type :: node_sums_t
      !> (3, 3, nodes) N/m
      real(wp), allocatable :: translation(:, :, :)
      !> (3, 3, 3, nodes) N per unit gradient
      real(wp), allocatable :: gradient(:, :, :, :)
      !> (3, 3, nodes) kg
      real(wp), allocatable :: mass(:, :, :)
      !> (3, nodes) sums of |K_ij|, N/m, of |K_ij| |x_j - x_i|, N, and of |M_ij|, kg, in the node's rows
      real(wp), allocatable :: translation_size(:, :), gradient_size(:, :), mass_size(:, :)
      !> (3, nodes) diagonal of the stiffness and of the mass, 0 where there is no row
      real(wp), allocatable :: stiffness_diagonal(:, :), mass_diagonal(:, :)
   end type node_sums_t

contains

   !> All sums, in one pass over the entries.
   subroutine sum_rows(model, sums)
      type(fe_model_t), intent(in) :: model
      type(node_sums_t), intent(out) :: sums
      real(wp) :: step(3), distance, v
      integer :: n, i, j, k, a, b, c, d

      n = model%node_count()
      allocate (sums%translation(3, 3, n), sums%gradient(3, 3, 3, n), sums%mass(3, 3, n), sums%translation_size(3, n), &
         & sums%gradient_size(3, n), sums%mass_size(3, n), sums%stiffness_diagonal(3, n), sums%mass_diagonal(3, n), &
         & source=0.0_wp)
      associate (matrix => model%stiffness)
         do i = 1, matrix%n
            a = model%row_node(i)
            c = model%row_component(i)
            do k = matrix%row_start(i), matrix%row_start(i + 1) - 1
               j = matrix%column(k)
               b = model%row_node(j)
               d = model%row_component(j)
               v = matrix%value(k)
               step = model%coordinates(:, b) - model%coordinates(:, a)
               distance = norm2(step)
               call add(a, c, d, step)
               if (i /= j) call add(b, d, c, -step)
               if (i == j) sums%stiffness_diagonal(c, a) = v
            end do
         end do
      end associate
      associate (matrix => model%mass)
         do i = 1, matrix%n
            a = model%row_node(i)
            c = model%row_component(i)
            do k = matrix%row_start(i), matrix%row_start(i + 1) - 1
               j = matrix%column(k)
               b = model%row_node(j)
               d = model%row_component(j)
               v = matrix%value(k)
               sums%mass(c, d, a) = sums%mass(c, d, a) + v
               sums%mass_size(c, a) = sums%mass_size(c, a) + abs(v)
               if (i == j) then
                  sums%mass_diagonal(c, a) = v
               else
                  sums%mass(d, c, b) = sums%mass(d, c, b) + v
                  sums%mass_size(d, b) = sums%mass_size(d, b) + abs(v)
               end if
            end do
         end do
      end associate

   contains

      !> One entry of the stiffness in the row of a node.
      subroutine add(node, row, column, from_node)
         integer, intent(in) :: node, row, column
         real(wp), intent(in) :: from_node(3)
         sums%translation(row, column, node) = sums%translation(row, column, node) + v
         sums%gradient(row, column, :, node) = sums%gradient(row, column, :, node) + v*from_node
         sums%translation_size(row, node) = sums%translation_size(row, node) + abs(v)
         sums%gradient_size(row, node) = sums%gradient_size(row, node) + abs(v)*distance
      end subroutine add

   end subroutine sum_rows

end module microslip_fe_node_sums
