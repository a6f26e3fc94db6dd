!> Labels of nodes or elements as ranges: consecutive labels take no more memory than their two ends, however large they are.
module microslip_io_label_list
   use microslip_core_kinds, only: i8
   implicit none(type, external)
   private

   public :: label_list_t, find_label, ascending_order

   !> Labels in any order, with repetitions.
   type :: label_list_t
      private
      integer :: count = 0
      !> (4, ranges) first label, last label, step, and 1 where every label must exist
      integer, allocatable :: range(:, :)
   contains
      procedure :: add
      procedure :: add_range
      procedure :: mark
   end type label_list_t

contains

   !> Add one label, which must exist.
   pure subroutine add(self, label)
      class(label_list_t), intent(inout) :: self
      integer, intent(in) :: label

      if (self%count > 0) then
         associate (last => self%range(:, self%count))
            if (last(3) == 1 .and. last(4) == 1 .and. last(2) < label) then
               if (label - 1 == last(2)) then
                  last(2) = label
                  return
               end if
            end if
         end associate
      end if
      call append(self, [label, label, 1, 1])
   end subroutine add

   !> Add the labels first, first + step, ... up to last; those that do not exist are left out.
   pure subroutine add_range(self, first, last, step)
      class(label_list_t), intent(inout) :: self
      !> first <= last, step >= 1
      integer, intent(in) :: first, last, step
      call append(self, [first, last, step, 0])
   end subroutine add_range

   pure subroutine append(self, range)
      type(label_list_t), intent(inout) :: self
      integer, intent(in) :: range(4)
      integer, allocatable :: more(:, :)

      if (.not. allocated(self%range)) allocate (self%range(4, 4))
      if (self%count == size(self%range, 2)) then
         allocate (more(4, 2*self%count))
         more(:, :self%count) = self%range
         call move_alloc(more, self%range)
      end if
      self%count = self%count + 1
      self%range(:, self%count) = range
   end subroutine append

   !> Mark the labels of the list among those that exist.
   pure subroutine mark(self, known, inside, missing, absent)
      class(label_list_t), intent(in) :: self
      !> Labels that exist, strictly ascending
      integer, intent(in) :: known(:)
      !> (known) becomes true for those in the list
      logical, intent(inout) :: inside(:)
      !> First label that must exist and does not, 0 if there is none
      integer, intent(out) :: missing
      !> How many labels of ranges do not exist
      integer(i8), intent(out) :: absent
      integer(i8) :: found
      integer :: k, p

      missing = 0
      absent = 0
      do k = 1, self%count
         associate (first => self%range(1, k), last => self%range(2, k), step => self%range(3, k))
            p = first_not_below(known, first)
            found = 0
            do while (p <= size(known))
               if (known(p) > last) exit
               if (mod(known(p) - first, step) == 0) then
                  if (self%range(4, k) == 1 .and. known(p) > first + found) exit
                  inside(p) = .true.
                  found = found + 1
               end if
               p = p + 1
            end do
            if (found == (int(last, i8) - first)/step + 1) cycle
            if (self%range(4, k) == 0) absent = absent + (int(last, i8) - first)/step + 1 - found
            if (self%range(4, k) == 1 .and. missing == 0) missing = int(first + found)
         end associate
      end do
   end subroutine mark

   !> Index of the first value of an ascending list that is not below a value, its length + 1 if all are.
   pure integer function first_not_below(list, value) result(low)
      integer, intent(in) :: list(:), value
      integer :: high, middle

      low = 1
      high = size(list) + 1
      do while (low < high)
         middle = low + (high - low)/2
         if (list(middle) < value) then
            low = middle + 1
         else
            high = middle
         end if
      end do
   end function first_not_below

   !> Index of a value in an ascending list, 0 if it is not there.
   pure integer function find_label(list, value)
      !> Ascending
      integer, intent(in) :: list(:)
      integer, intent(in) :: value

      find_label = first_not_below(list, value)
      if (find_label <= size(list)) then
         if (list(find_label) == value) return
      end if
      find_label = 0
   end function find_label

   !> The order that sorts a list, by merging; equal values keep theirs.
   pure function ascending_order(list) result(order)
      integer, intent(in) :: list(:)
      integer, allocatable :: order(:)
      integer, allocatable :: merged(:)
      integer :: n, width, left, middle, right, i, j, k

      n = size(list)
      allocate (order(n), merged(n))
      do k = 1, n
         order(k) = k
      end do
      width = 1
      do while (width < n)
         do left = 1, n, 2*width
            middle = min(left + width, n + 1)
            right = min(left + 2*width, n + 1)
            i = left
            j = middle
            do k = left, right - 1
               if (i < middle .and. j < right) then
                  if (list(order(i)) <= list(order(j))) then
                     merged(k) = order(i)
                     i = i + 1
                  else
                     merged(k) = order(j)
                     j = j + 1
                  end if
               else if (i < middle) then
                  merged(k) = order(i)
                  i = i + 1
               else
                  merged(k) = order(j)
                  j = j + 1
               end if
            end do
         end do
         order = merged
         width = 2*width
      end do
   end function ascending_order

end module microslip_io_label_list
