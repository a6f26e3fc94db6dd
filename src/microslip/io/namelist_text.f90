!> Fortran namelist text to groups, keys and values, each with its line number.
!>
!> Why not the compiler's namelist read: its errors do not name the key of a bad value, it skips
!> misspelled groups and second copies in silence, and it lets NaN, 1e400, repeated keys and
!> truncated strings pass. Accepted here is what gfortran accepts: `!` comments, single and double quotes
!> (doubled inside), repeat counts, `a(2) =`, `a(1:3) =`, `a(:,2) =`, `&end`. Stricter: strings need quotes and
!> end on their line, and text outside the groups is refused (it may be a group's rest behind a stray '/').
module microslip_io_namelist_text
   use microslip_core_fault_list, only: fault_list_t
   use microslip_core_text, only: to_text, lower_case
   use microslip_io_text_cursor, only: text_cursor_t, cursor_at_start, letters, digits, blanks, newline
   implicit none(type, external)
   private

   public :: namelist_group_t, namelist_assignment_t, namelist_value_t, scan_namelists, longest_list

   !> More values than this in one list are refused.
   integer, parameter :: longest_list = 10000

   !> One value as it stands in the text. `text` is not allocated for a null value (nothing between two commas).
   type :: namelist_value_t
      character(len=:), allocatable :: text
      logical :: quoted = .false.
   end type namelist_value_t

   !> `key = values` or `key(subscripts) = values`.
   type :: namelist_assignment_t
      !> In lower case
      character(len=:), allocatable :: key
      !> (2, number of subscripts) first and last index; 0: not given (an end of ':')
      integer, allocatable :: subscript(:, :)
      integer :: line = 0
      !> The first `count` entries are in use
      type(namelist_value_t), allocatable :: values(:)
      integer :: count = 0
   end type namelist_assignment_t

   !> `&name ... /`
   type :: namelist_group_t
      !> In lower case
      character(len=:), allocatable :: name
      integer :: line = 0
      type(namelist_assignment_t), allocatable :: assignments(:)
   end type namelist_group_t

contains

   !> All groups of a namelist text, in order. What is not namelist text becomes a fault.
   subroutine scan_namelists(text, file, groups, faults)
      !> The text, lines separated by newlines
      character(len=*), intent(in) :: text
      !> Name of the file, for the fault lines
      character(len=*), intent(in) :: file
      !> The groups in the order of the text
      type(namelist_group_t), allocatable, intent(out) :: groups(:)
      !> Faults are added here
      type(fault_list_t), intent(inout) :: faults
      type(text_cursor_t) :: cursor

      cursor = cursor_at_start(text, file)
      allocate (groups(0))
      call cursor%skip_blank()
      do while (.not. cursor%finished())
         if (cursor%letter() == '&') then
            call scan_group(cursor, groups, faults)
            call cursor%skip_blank()
         else
            call faults%add(cursor%place()//'outside of the groups: '//shortened(cursor%rest())// &
               ': allowed: comments behind ! (was a group closed too early by a / ?)')
            do while (.not. cursor%finished() .and. cursor%letter() /= '&')
               call cursor%skip_line()
               call cursor%skip_blank()
            end do
         end if
      end do
   end subroutine scan_namelists

   !> One group from its '&' to its '/'.
   subroutine scan_group(cursor, groups, faults)
      type(text_cursor_t), intent(inout) :: cursor
      type(namelist_group_t), allocatable, intent(inout) :: groups(:)
      type(fault_list_t), intent(inout) :: faults
      type(namelist_group_t) :: group
      logical :: after_value

      group%line = cursor%line
      cursor%at = cursor%at + 1
      group%name = lower_case(cursor%take_name())
      allocate (group%assignments(0))
      after_value = .false.
      do
         call cursor%skip_blank()
         if (cursor%letter() == '/') then
            cursor%at = cursor%at + 1
            exit
         else if (at_end_keyword(cursor)) then
            cursor%at = cursor%at + 4
            exit
         else if (cursor%finished() .or. cursor%letter() == '&') then
            call faults%add(cursor%file//', line '//to_text(group%line)//': &'//group%name// &
               ': the group is not closed: allowed: a / behind its last key')
            exit
         else if (cursor%letter() == ',') then
            cursor%at = cursor%at + 1
            if (.not. after_value) call add_value(group, namelist_value_t(), 1)
            after_value = .false.
         else if (starts_assignment(cursor)) then
            call scan_key(cursor, group, faults)
            after_value = .false.
         else
            call scan_value(cursor, group, faults)
            after_value = .true.
         end if
      end do
      call add_group(groups, group)
   end subroutine scan_group

   !> `key =` or `key(subscripts) =`; the cursor stands behind the '=' afterwards.
   subroutine scan_key(cursor, group, faults)
      type(text_cursor_t), intent(inout) :: cursor
      type(namelist_group_t), intent(inout) :: group
      type(fault_list_t), intent(inout) :: faults
      type(namelist_assignment_t) :: assignment
      character(len=:), allocatable :: before
      integer :: open
      logical :: good

      assignment%line = cursor%line
      assignment%key = lower_case(cursor%take_name())
      before = cursor%rest()
      before = before(:index(before, '='))
      cursor%at = cursor%at + len(before)
      open = index(before, '(')
      if (open > 0) then
         before = before(open + 1:index(before, ')') - 1)
         call read_subscripts(before, assignment%subscript, good)
         if (.not. good) call faults%add(cursor%place()//'&'//group%name//': '//assignment%key//'('//before// &
            ') is not understood: allowed: subscripts like (2), (1:3), (:,2)')
      end if
      if (.not. allocated(assignment%subscript)) allocate (assignment%subscript(2, 0))
      allocate (assignment%values(1))
      call add_assignment(group, assignment)
   end subroutine scan_key

   !> '2', '1:3', ':,2' to first and last indices.
   subroutine read_subscripts(text, subscript, good)
      character(len=*), intent(in) :: text
      integer, allocatable, intent(out) :: subscript(:, :)
      !> Whether the text was understood; `subscript` is allocated only then
      logical, intent(out) :: good
      integer :: first, last, colon, rank, work(2, 2)

      rank = 0
      first = 1
      work = 0
      do while (first <= len(text) + 1)
         last = index(text(first:)//',', ',') + first - 2
         rank = rank + 1
         good = rank <= 2
         if (.not. good) return
         colon = index(text(first:last), ':')
         if (colon > 0) then
            call read_index(text(first:first + colon - 2), work(1, rank), good)
            if (good) call read_index(text(first + colon:last), work(2, rank), good)
         else
            call read_index(text(first:last), work(1, rank), good)
            good = good .and. work(1, rank) > 0
            work(2, rank) = work(1, rank)
         end if
         if (.not. good) return
         first = last + 2
      end do
      subscript = work(:, :rank)
   end subroutine read_subscripts

   !> A positive integer, 0 where the text is blank.
   subroutine read_index(text, value, good)
      character(len=*), intent(in) :: text
      integer, intent(out) :: value
      logical, intent(out) :: good
      integer :: status

      value = 0
      good = verify(trim(adjustl(text)), digits) == 0 .and. len_trim(adjustl(text)) < 9
      if (.not. good .or. len_trim(text) == 0) return
      read (text, *, iostat=status) value
      good = status == 0 .and. value > 0
   end subroutine read_index

   !> One value, with its repeat count, added to the last key of the group.
   subroutine scan_value(cursor, group, faults)
      type(text_cursor_t), intent(inout) :: cursor
      type(namelist_group_t), intent(inout) :: group
      type(fault_list_t), intent(inout) :: faults
      type(namelist_value_t) :: value
      character(len=:), allocatable :: line, place
      integer :: count, star, first, status
      logical :: closed

      first = cursor%at
      place = cursor%place()//'&'//group%name//': '
      count = 1
      line = cursor%rest()
      star = verify(line, digits)
      if (star > 1 .and. line(star:star) == '*') then
         read (line(:star - 1), *, iostat=status) count
         if (status /= 0) count = 0
         cursor%at = first + star
      end if
      closed = .true.
      if (scan(cursor%letter(), '''"') == 1) then
         call take_string(cursor, value, closed)
      else
         call take_word(cursor, value)
      end if
      line = shortened(cursor%text(first:cursor%at - 1))
      if (size(group%assignments) == 0) then
         call faults%add(place//line//' is not understood: allowed: key = value')
         return
      end if
      place = place//group%assignments(size(group%assignments))%key//' = '//line
      if (.not. closed) call faults%add(place//': allowed: a closing quote on the same line')
      if (count < 1 .or. count > longest_list) then
         call faults%add(place//': allowed: repeat counts from 1 to '//to_text(longest_list))
         count = 1
      end if
      call add_value(group, value, count)
   end subroutine scan_value

   !> A string in quotes; a doubled quote inside stands for one.
   subroutine take_string(cursor, value, closed)
      type(text_cursor_t), intent(inout) :: cursor
      type(namelist_value_t), intent(out) :: value
      !> Whether the closing quote was found before the end of the line
      logical, intent(out) :: closed
      character(len=1) :: quote

      quote = cursor%letter()
      value%quoted = .true.
      value%text = ''
      closed = .false.
      do
         cursor%at = cursor%at + 1
         if (cursor%letter() == newline) return
         if (cursor%letter() == quote) then
            cursor%at = cursor%at + 1
            if (cursor%letter() /= quote) exit
         end if
         value%text = value%text//cursor%letter()
      end do
      closed = .true.
   end subroutine take_string

   !> A value without quotes, up to the next separator; none there: a null value.
   subroutine take_word(cursor, value)
      type(text_cursor_t), intent(inout) :: cursor
      type(namelist_value_t), intent(out) :: value
      character(len=:), allocatable :: line
      integer :: length

      line = cursor%rest()
      length = scan(line, blanks//newline//',/!=&''"') - 1
      if (line(1:1) == '=') length = 1
      if (length > 0) value%text = line(:length)
      cursor%at = cursor%at + length
   end subroutine take_word

   !> Whether a key and its '=' follow.
   pure logical function starts_assignment(cursor)
      type(text_cursor_t), intent(in) :: cursor
      character(len=:), allocatable :: line

      starts_assignment = .false.
      line = cursor%rest()
      if (verify(line(1:1), letters) > 0) return
      line = line(verify(line, letters//digits//'_'):)
      line = line(verify(line, blanks):)
      if (line(1:1) == '(') then
         line = line(scan(line, ')'//newline):)
         if (line(1:1) == ')') line = line(2:)
         line = line(verify(line, blanks):)
      end if
      starts_assignment = line(1:1) == '='
   end function starts_assignment

   !> Whether the old form `&end` of a closing '/' follows.
   pure logical function at_end_keyword(cursor)
      type(text_cursor_t), intent(in) :: cursor
      character(len=:), allocatable :: line

      at_end_keyword = .false.
      if (cursor%finished()) return
      line = cursor%rest()
      if (len(line) < 5) return
      at_end_keyword = lower_case(line(:4)) == '&end' .and. verify(line(5:5), letters//digits//'_') == 1
   end function at_end_keyword

   !> The first 60 letters, without blanks and newline at the end.
   pure function shortened(text)
      character(len=*), intent(in) :: text
      character(len=:), allocatable :: shortened

      shortened = text(:verify(text, blanks//newline, back=.true.))
      if (len(shortened) > 60) shortened = shortened(:60)//'...'
   end function shortened

   !> Append `count` copies of a value to the last key of the group (no more once the list is too long anyway).
   pure subroutine add_value(group, value, count)
      type(namelist_group_t), intent(inout) :: group
      type(namelist_value_t), intent(in) :: value
      integer, intent(in) :: count
      type(namelist_value_t), allocatable :: longer(:)

      if (size(group%assignments) == 0) return
      associate (last => group%assignments(size(group%assignments)))
         if (last%count > longest_list) return
         if (last%count + count > size(last%values)) then
            allocate (longer(2*(last%count + count)))
            longer(:last%count) = last%values(:last%count)
            call move_alloc(longer, last%values)
         end if
         last%values(last%count + 1:last%count + count) = value
         last%count = last%count + count
      end associate
   end subroutine add_value

   !> Append a key to the group.
   pure subroutine add_assignment(group, assignment)
      type(namelist_group_t), intent(inout) :: group
      type(namelist_assignment_t), intent(in) :: assignment
      type(namelist_assignment_t), allocatable :: longer(:)

      allocate (longer(size(group%assignments) + 1))
      longer(:size(group%assignments)) = group%assignments
      longer(size(longer)) = assignment
      call move_alloc(longer, group%assignments)
   end subroutine add_assignment

   !> Append a group to the list.
   pure subroutine add_group(groups, group)
      type(namelist_group_t), allocatable, intent(inout) :: groups(:)
      type(namelist_group_t), intent(in) :: group
      type(namelist_group_t), allocatable :: longer(:)

      allocate (longer(size(groups) + 1))
      longer(:size(groups)) = groups
      longer(size(longer)) = group
      call move_alloc(longer, groups)
   end subroutine add_group

end module microslip_io_namelist_text
