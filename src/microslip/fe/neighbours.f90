!> Which nodes are neighbours: by the elements of the mesh, and by the entries of a matrix.
module microslip_fe_neighbours
   use microslip_core_kinds, only: wp
   use microslip_fe_model, only: element_block_t
   use microslip_linalg_sparse, only: symmetric_sparse_t
   implicit none(type, external)
   private

   public :: neighbours_t, element_neighbours, matrix_neighbours

   !> Every node's neighbours, each once, without itself.
   type :: neighbours_t
      !> (nodes + 1) first neighbour of every node
      integer, allocatable :: start(:)
      !> Node indices
      integer, allocatable :: node(:)
   end type neighbours_t

contains

   !> Nodes that share an element.
   pure function element_neighbours(elements, nodes) result(neighbours)
      type(element_block_t), intent(in) :: elements(:)
      !> Number of nodes
      integer, intent(in) :: nodes
      type(neighbours_t) :: neighbours
      integer, allocatable :: start(:), block_of(:), element_of(:), seen(:)
      integer :: k, e, a, b, m, pass, found

      allocate (start(nodes + 1), source=0)
      do k = 1, size(elements)
         do e = 1, size(elements(k)%connectivity, 2)
            do m = 1, size(elements(k)%connectivity, 1)
               a = elements(k)%connectivity(m, e)
               start(a) = start(a) + 1
            end do
         end do
      end do
      call sums_before(start)
      allocate (block_of(start(nodes + 1) - 1), element_of(start(nodes + 1) - 1))
      do k = 1, size(elements)
         do e = 1, size(elements(k)%connectivity, 2)
            do m = 1, size(elements(k)%connectivity, 1)
               a = elements(k)%connectivity(m, e)
               block_of(start(a)) = k
               element_of(start(a)) = e
               start(a) = start(a) + 1
            end do
         end do
      end do
      start = [1, start(:nodes)]

      allocate (neighbours%start(nodes + 1), seen(nodes))
      do pass = 1, 2
         seen = 0
         found = 0
         do a = 1, nodes
            neighbours%start(a) = found + 1
            seen(a) = a
            do k = start(a), start(a + 1) - 1
               associate (list => elements(block_of(k))%connectivity(:, element_of(k)))
                  do m = 1, size(list)
                     b = list(m)
                     if (seen(b) == a) cycle
                     seen(b) = a
                     found = found + 1
                     if (pass == 2) neighbours%node(found) = b
                  end do
               end associate
            end do
         end do
         neighbours%start(nodes + 1) = found + 1
         if (pass == 1) allocate (neighbours%node(found))
      end do
   end function element_neighbours

   !> Nodes that an entry other than zero joins.
   pure function matrix_neighbours(matrix, row_node, nodes) result(neighbours)
      type(symmetric_sparse_t), intent(in) :: matrix
      !> (rows) node index of every row
      integer, intent(in) :: row_node(:)
      !> Number of nodes
      integer, intent(in) :: nodes
      type(neighbours_t) :: neighbours
      integer, allocatable :: start(:), list(:), seen(:)
      integer :: pass, row, k, a, b, last, found

      allocate (start(nodes + 1), source=0)
      do pass = 1, 2
         do row = 1, matrix%n
            a = row_node(row)
            last = a
            do k = matrix%row_start(row) + 1, matrix%row_start(row + 1) - 1
               b = row_node(matrix%column(k))
               ! The components of a node often follow one another.
               if (b == last .or. b == a .or. .not. abs(matrix%value(k)) > 0.0_wp) cycle
               last = b
               if (pass == 2) then
                  list(start(a)) = b
                  list(start(b)) = a
               end if
               start(a) = start(a) + 1
               start(b) = start(b) + 1
            end do
         end do
         if (pass == 1) then
            call sums_before(start)
            allocate (list(start(nodes + 1) - 1))
         end if
      end do
      start = [1, start(:nodes)]

      allocate (neighbours%start(nodes + 1), seen(nodes), neighbours%node(size(list)))
      seen = 0
      found = 0
      do a = 1, nodes
         neighbours%start(a) = found + 1
         do k = start(a), start(a + 1) - 1
            if (seen(list(k)) == a) cycle
            seen(list(k)) = a
            found = found + 1
            neighbours%node(found) = list(k)
         end do
      end do
      neighbours%start(nodes + 1) = found + 1
      neighbours%node = neighbours%node(:found)
   end function matrix_neighbours

   !> Counts to the first place of each.
   pure subroutine sums_before(start)
      !> (n + 1) the counts of 1 to n on entry
      integer, intent(inout) :: start(:)
      integer :: k, count, place

      place = 1
      do k = 1, size(start)
         count = start(k)
         start(k) = place
         place = place + count
      end do
   end subroutine sums_before

end module microslip_fe_neighbours
