!> One namelist group, being read or being written: which keys it knows, which are given, what is wrong with them.
!>
!> Unknown keys are those that were never described. Every fault line says file, line, group
!> (with number and name where there may be several), key, value and what is allowed.
module microslip_io_group_text
   use microslip_core_fault_list, only: fault_list_t
   use microslip_core_nearest_name, only: nearest_name, quoted_list
   use microslip_core_text, only: to_text
   use microslip_io_namelist_text, only: namelist_group_t, namelist_value_t, longest_list
   use microslip_io_namelist_values, only: gather_elements, string_literal
   implicit none(type, external)
   private

   public :: group_text_t

   !> Longest key, and longest line of the resolved text.
   integer, parameter :: key_length = 32, line_length = 100

   !> The text of one group and the faults found in it.
   type :: group_text_t
      !> Everything wrong found so far
      type(fault_list_t) :: faults
      !> Name of the group, and its number among those of this name
      character(len=:), allocatable :: name
      integer :: number = 1
      logical :: is_reading = .false.
      type(namelist_group_t), private :: source
      character(len=:), allocatable, private :: file, label, lines
      !> The keys described so far, and whether they have a fault
      character(len=key_length), allocatable, private :: known(:)
      logical, allocatable, private :: faulty(:)
   contains
      procedure :: start_reading
      procedure :: start_writing
      procedure :: exactly_one
      procedure :: ignored
      procedure :: fault
      procedure :: given
      procedure :: sound
      procedure :: finish
      procedure :: text
      procedure :: fetch
      procedure :: write_values
      procedure, private :: register
      procedure, private :: line_of
   end type group_text_t

contains

   !> Begin to read a group of a case file.
   subroutine start_reading(self, group, number, many, file)
      class(group_text_t), intent(inout) :: self
      !> The group as scanned
      type(namelist_group_t), intent(in) :: group
      !> Its number among the groups of this name
      integer, intent(in) :: number
      !> Whether there may be several groups of this name, so that faults must say which
      logical, intent(in) :: many
      !> Name of the file, for the fault lines
      character(len=*), intent(in) :: file
      type(namelist_value_t), allocatable :: name(:)
      character(len=:), allocatable :: problem

      self%is_reading = .true.
      self%source = group
      self%name = group%name
      self%number = number
      self%file = file
      self%label = '&'//group%name
      if (many) then
         self%label = self%label//' '//to_text(number)
         call gather_elements(group, 'name', 1, 1, name, problem)
         if (size(name) == 1) then
            if (allocated(name(1)%text)) self%label = self%label//' '//string_literal(name(1)%text)
         end if
      end if
      allocate (self%known(0), self%faulty(0))
   end subroutine start_reading

   !> Begin to write a group as namelist text.
   subroutine start_writing(self, name)
      class(group_text_t), intent(inout) :: self
      !> Name of the group
      character(len=*), intent(in) :: name
      self%name = name
      self%lines = '&'//name//new_line('a')
   end subroutine start_writing

   !> The values of a key while reading; empty if it is not given or has a fault.
   subroutine fetch(self, key, noun, rows, counts, elements, required)
      class(group_text_t), intent(inout) :: self
      !> Name of the key
      character(len=*), intent(in) :: key
      !> What one value is, in words, with its article
      character(len=*), intent(in) :: noun
      !> Rows of a table, 1 for a list
      integer, intent(in) :: rows
      !> Fewest and most values (columns of a table); any number of them by default
      integer, intent(in), optional :: counts(2)
      !> In array element order, every one with its text
      type(namelist_value_t), allocatable, intent(out) :: elements(:)
      !> Whether a missing key is a fault (no by default)
      logical, intent(in), optional :: required
      character(len=:), allocatable :: problem, allowed
      integer :: limits(2), k, hole

      call self%register(key)
      limits = [1, longest_list/rows]
      if (present(counts)) limits = counts
      allowed = how_many(limits)//trim(noun)
      call gather_elements(self%source, key, rows, rows*limits(2), elements, problem)
      hole = 0
      do k = size(elements), 1, -1
         if (.not. allocated(elements(k)%text)) hole = k
      end do
      if (.not. self%given(key)) then
         if (present(required)) then
            if (required) call self%fault(key, allowed)
         end if
      else if (problem /= '') then
         call self%fault(key, allowed//' ('//problem//')')
      else if (hole > 0) then
         call self%fault(key, allowed//' (value '//to_text(hole)//' is missing)')
      else if (size(elements) < rows*limits(1) .or. mod(size(elements), rows) > 0) then
         call self%fault(key, allowed//' ('//to_text(size(elements))//' values given)')
      end if
      if (.not. self%sound(key)) elements = elements(:0)
   end subroutine fetch

   !> Add a key and its values to the text being written.
   subroutine write_values(self, key, values)
      class(group_text_t), intent(inout) :: self
      !> Key, with subscripts where needed
      character(len=*), intent(in) :: key
      !> Values in namelist form; trailing blanks are dropped
      character(len=*), intent(in) :: values(:)
      character(len=:), allocatable :: line
      integer :: k

      line = '   '//key//' ='
      do k = 1, size(values)
         if (len(line) + len_trim(values(k)) > line_length .and. k > 1) then
            self%lines = self%lines//line//new_line('a')
            line = '     '
         end if
         line = line//' '//trim(values(k))
         if (k < size(values)) line = line//','
      end do
      self%lines = self%lines//line//new_line('a')
   end subroutine write_values

   !> The text of the group that was written.
   pure function text(self)
      class(group_text_t), intent(in) :: self
      character(len=:), allocatable :: text
      text = self%lines//'/'//new_line('a')
   end function text

   !> Demand that one, and only one, of some keys is given.
   subroutine exactly_one(self, keys)
      class(group_text_t), intent(inout) :: self
      !> Names of the keys
      character(len=*), intent(in) :: keys(:)
      integer :: k, found

      if (.not. self%is_reading) return
      found = 0
      do k = 1, size(keys)
         call self%register(trim(keys(k)))
         if (.not. self%given(trim(keys(k)))) cycle
         found = found + 1
         if (found == 2) call self%fault(trim(keys(k)), 'only one of '//quoted_list(keys))
      end do
      if (found == 0) call self%fault('', 'exactly one of '//quoted_list(keys))
   end subroutine exactly_one

   !> Refuse keys that the value of another key makes meaningless.
   subroutine ignored(self, keys, reason, decided_by)
      class(group_text_t), intent(inout) :: self
      !> Names of the keys
      character(len=*), intent(in) :: keys(:)
      !> When they are used, in words
      character(len=*), intent(in) :: reason
      !> The key that decides; nothing is refused if it has a fault itself
      character(len=*), intent(in), optional :: decided_by
      integer :: k

      if (.not. self%is_reading) return
      do k = 1, size(keys)
         call self%register(trim(keys(k)))
         if (.not. self%given(trim(keys(k)))) cycle
         if (present(decided_by)) then
            if (.not. self%sound(decided_by)) cycle
         end if
         call self%fault(trim(keys(k)), 'only '//reason//', it would be ignored here')
      end do
   end subroutine ignored

   !> Note a fault of a key, or of the group if the key is ''.
   subroutine fault(self, key, allowed, element)
      class(group_text_t), intent(inout) :: self
      !> Name of the key, with subscripts if it is about one element
      character(len=*), intent(in) :: key
      !> What is allowed, in words
      character(len=*), intent(in) :: allowed
      !> The element with the fault (the whole value by default)
      type(namelist_value_t), intent(in), optional :: element
      character(len=:), allocatable :: name, value
      integer :: k

      name = key(:scan(key//'(', '(') - 1)
      do k = 1, size(self%known)
         if (self%known(k) == name) self%faulty(k) = .true.
      end do
      if (key == '') then
         value = ''
      else if (present(element)) then
         value = ': '//key//' = '//shown([element])
      else if (self%given(name)) then
         value = ': '//key//' = '//shown_values(self%source, name)
      else
         value = ': '//key//': missing'
      end if
      call self%faults%add(self%file//', line '//to_text(self%line_of(name))//': '//self%label//value// &
         ': allowed: '//trim(allowed))
   end subroutine fault

   !> Whether a key stands in the group's text.
   pure logical function given(self, key)
      class(group_text_t), intent(in) :: self
      !> Name of the key
      character(len=*), intent(in) :: key
      integer :: k

      given = .false.
      if (.not. self%is_reading) return
      do k = 1, size(self%source%assignments)
         if (self%source%assignments(k)%key == key) given = .true.
      end do
   end function given

   !> Whether no fault of this key was noted.
   pure logical function sound(self, key)
      class(group_text_t), intent(in) :: self
      !> Name of the key
      character(len=*), intent(in) :: key

      sound = .true.
      if (self%is_reading) sound = .not. any(self%faulty .and. self%known == key)
   end function sound

   !> After the last key: unknown keys become faults.
   subroutine finish(self)
      class(group_text_t), intent(inout) :: self
      character(len=:), allocatable :: key, nearest
      integer :: k, described

      if (.not. self%is_reading) return
      described = size(self%known)
      do k = 1, size(self%source%assignments)
         key = self%source%assignments(k)%key
         if (any(self%known == key)) cycle
         nearest = nearest_name(key, self%known(:described))
         call self%register(key)
         if (nearest /= '') then
            call self%fault(key, "unknown key, did you mean '"//nearest//"'?")
         else
            call self%fault(key, 'unknown key, the keys are '//quoted_list(self%known(:described)))
         end if
      end do
   end subroutine finish

   !> Note that a key exists.
   subroutine register(self, key)
      class(group_text_t), intent(inout) :: self
      character(len=*), intent(in) :: key

      if (any(self%known == key)) return
      self%known = [character(len=key_length) :: self%known, key]
      self%faulty = [self%faulty, .false.]
   end subroutine register

   !> Line of the first assignment to a key, of the group itself if there is none.
   pure integer function line_of(self, key)
      class(group_text_t), intent(in) :: self
      character(len=*), intent(in) :: key
      integer :: k

      line_of = self%source%line
      do k = size(self%source%assignments), 1, -1
         if (self%source%assignments(k)%key == key) line_of = self%source%assignments(k)%line
      end do
   end function line_of

   !> All values of a key as they stand in the text.
   pure function shown_values(group, key) result(text)
      type(namelist_group_t), intent(in) :: group
      character(len=*), intent(in) :: key
      character(len=:), allocatable :: text
      integer :: k

      text = ''
      do k = 1, size(group%assignments)
         if (group%assignments(k)%key /= key) cycle
         if (text /= '') text = text//', '
         text = text//shown(group%assignments(k)%values(:group%assignments(k)%count))
      end do
      if (text == '') text = 'nothing'
   end function shown_values

   !> Values as text, shortened.
   pure function shown(values) result(text)
      type(namelist_value_t), intent(in) :: values(:)
      character(len=:), allocatable :: text
      integer :: k

      text = ''
      do k = 1, size(values)
         if (k > 1) text = text//', '
         if (.not. allocated(values(k)%text)) cycle
         if (values(k)%quoted) then
            text = text//string_literal(values(k)%text)
         else
            text = text//values(k)%text
         end if
         if (len(text) > 60) exit
      end do
      if (len(text) > 60) text = text(:60)//'...'
   end function shown

   !> How many values, in front of what one value is.
   pure function how_many(limits) result(text)
      integer, intent(in) :: limits(2)
      character(len=:), allocatable :: text

      if (all(limits == 1)) then
         text = ''
      else if (limits(1) == limits(2)) then
         text = to_text(limits(1))//' values, each '
      else if (4*limits(2) < longest_list) then
         text = to_text(limits(1))//' to '//to_text(limits(2))//' values, each '
      else
         text = to_text(limits(1))//' or more values, each '
      end if
   end function how_many

end module microslip_io_group_text
