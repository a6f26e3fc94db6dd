!> The blocks of all groups together: products that add what the groups cause in one another.
!>
!> Between groups M has a low rank (`base_set`): M_gh x_h = Z_g C_gh (Z_h^T x_h).
module microslip_contact_coupled_blocks
   use microslip_contact_block, only: contact_block_t
   use microslip_core_kinds, only: wp
   implicit none(type, external)
   private

   public :: predict_all, evaluate_columns, evaluate_others, apply_changes, assess_all, count_columns

contains

   !> Forces in all rows if no gap changed.
   subroutine predict_all(blocks, dq)
      type(contact_block_t), intent(inout) :: blocks(:)
      !> (drivers) change of the driver
      real(wp), intent(in) :: dq(:)
      integer :: g

      do g = 1, size(blocks)
         call blocks(g)%predict(dq)
      end do
   end subroutine predict_all

   !> trial = predicted + M x in the rows of the columns.
   subroutine evaluate_columns(blocks, coupling)
      type(contact_block_t), intent(inout) :: blocks(:)
      !> C of the base set, N/m
      real(wp), intent(in) :: coupling(:, :)
      real(wp) :: incoming(size(coupling, 1)/size(blocks), size(blocks))
      integer :: g

      call exchange(blocks, coupling, incoming, .false.)
      do g = 1, size(blocks)
         call blocks(g)%evaluate(1, blocks(g)%columns)
         call blocks(g)%add_incoming(incoming(:, g), 1, blocks(g)%columns)
      end do
   end subroutine evaluate_columns

   !> The same in the rows that are followed but do not move.
   subroutine evaluate_others(blocks, coupling)
      type(contact_block_t), intent(inout) :: blocks(:)
      real(wp), intent(in) :: coupling(:, :)
      real(wp) :: incoming(size(coupling, 1)/size(blocks), size(blocks))
      integer :: g

      call exchange(blocks, coupling, incoming, .false.)
      do g = 1, size(blocks)
         call blocks(g)%evaluate(blocks(g)%columns + 1, blocks(g)%rows)
         call blocks(g)%add_incoming(incoming(:, g), blocks(g)%columns + 1, blocks(g)%rows)
      end do
   end subroutine evaluate_others

   !> x = x + dx and trial = trial + M dx in the rows of the columns.
   subroutine apply_changes(blocks, coupling)
      type(contact_block_t), intent(inout) :: blocks(:)
      real(wp), intent(in) :: coupling(:, :)
      real(wp) :: incoming(size(coupling, 1)/size(blocks), size(blocks))
      integer :: g

      call exchange(blocks, coupling, incoming, .true.)
      do g = 1, size(blocks)
         call blocks(g)%apply()
         call blocks(g)%add_incoming(incoming(:, g), 1, blocks(g)%columns)
      end do
   end subroutine apply_changes

   !> What every group feels of the others: C times the outgoing of all, (rank, groups).
   subroutine exchange(blocks, coupling, incoming, changes)
      type(contact_block_t), intent(in) :: blocks(:)
      real(wp), intent(in) :: coupling(:, :)
      real(wp), intent(out) :: incoming(:, :)
      !> Of the changes dx instead of the increments x
      logical, intent(in) :: changes
      real(wp) :: outgoing(size(incoming, 1), size(blocks))
      integer :: g

      if (size(incoming) == 0) return
      do g = 1, size(blocks)
         if (changes) then
            outgoing(:, g) = blocks(g)%outgoing(blocks(g)%dx)
         else
            outgoing(:, g) = blocks(g)%outgoing(blocks(g)%x)
         end if
      end do
      incoming = reshape(matmul(coupling, reshape(outgoing, [size(outgoing)])), shape(incoming))
   end subroutine exchange

   !> States of all columns (unless they are held) and what the laws miss, (`contact_block_t%assess`).
   subroutine assess_all(blocks, changed, hold, residual)
      type(contact_block_t), intent(inout) :: blocks(:)
      !> Becomes true where a state changes
      logical, intent(inout) :: changed
      logical, intent(in) :: hold
      !> Largest violation of the laws, N
      real(wp), intent(out) :: residual
      integer :: g

      residual = 0.0_wp
      do g = 1, size(blocks)
         call blocks(g)%assess(changed, hold)
         residual = max(residual, blocks(g)%residual)
      end do
   end subroutine assess_all

   !> Number of points that may move.
   pure integer function count_columns(blocks)
      type(contact_block_t), intent(in) :: blocks(:)
      integer :: g

      count_columns = sum([(blocks(g)%columns, g=1, size(blocks))])
   end function count_columns

end module microslip_contact_coupled_blocks
