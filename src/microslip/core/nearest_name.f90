!> The known name nearest to a misspelled one, for messages ("did you mean ...?").
module microslip_core_nearest_name
   use microslip_core_text, only: lower_case
   implicit none(type, external)
   private

   public :: nearest_name, edit_distance, quoted_list

contains

   !> The known name with the fewest edits, '' if none is near (more than a third of the letters differ).
   pure function nearest_name(name, known) result(nearest)
      !> The name as the user wrote it
      character(len=*), intent(in) :: name
      !> The names that exist
      character(len=*), intent(in) :: known(:)
      character(len=:), allocatable :: nearest
      integer :: k, distance, least

      nearest = ''
      least = huge(least)
      do k = 1, size(known)
         distance = edit_distance(lower_case(trim(name)), lower_case(trim(known(k))))
         if (distance >= least .or. 3*distance > max(len_trim(known(k)), len_trim(name)) + 1) cycle
         least = distance
         nearest = trim(known(k))
      end do
   end function nearest_name

   !> Levenshtein distance: letters to insert, remove or replace to turn one string into the other.
   pure integer function edit_distance(a, b)
      !> The strings, in any order
      character(len=*), intent(in) :: a, b
      integer :: row(0:len(b)), i, j, diagonal, above

      row = [(j, j=0, len(b))]
      do i = 1, len(a)
         diagonal = row(0)
         row(0) = i
         do j = 1, len(b)
            above = row(j)
            row(j) = min(above + 1, row(j - 1) + 1, diagonal + merge(0, 1, a(i:i) == b(j:j)))
            diagonal = above
         end do
      end do
      edit_distance = row(len(b))
   end function edit_distance

   !> 'a', 'b', 'c': the names in quotes, with commas.
   pure function quoted_list(names) result(text)
      !> The names; trailing blanks are dropped
      character(len=*), intent(in) :: names(:)
      character(len=:), allocatable :: text
      integer :: k

      text = ''
      do k = 1, size(names)
         if (k > 1) text = text//', '
         text = text//"'"//trim(names(k))//"'"
      end do
   end function quoted_list

end module microslip_core_nearest_name
