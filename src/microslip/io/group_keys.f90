!> The keys of a namelist group by type: real numbers, integers, switches, names, lists and tables of them.
!>
!> A group's procedure (`interface_keys`, ...) calls one of these once per key, with the component of the record,
!> the allowed values, and whether the key is required. While reading, values go from the text into the record, and
!> everything wrong becomes a fault; a value with a fault leaves the record as it was.
!> While writing, the record's values become namelist text. One description for both directions: the resolved input
!> cannot drift from what is read.
module microslip_io_group_keys
   use microslip_core_kinds, only: wp
   use microslip_core_nearest_name, only: quoted_list
   use microslip_core_text, only: to_text, lower_case
   use microslip_io_group_text, only: group_text_t
   use microslip_io_namelist_text, only: namelist_group_t, namelist_value_t
   use microslip_io_namelist_values, only: text_to_real, text_to_integer, real_literal, string_literal
   use microslip_io_value_range, only: range_t
   implicit none(type, external)
   private

   public :: group_keys_t, reading, writing

   !> Beyond this size, and below its inverse, products and quotients of numbers leave the range of double precision.
   real(wp), parameter :: largest_size = 1.0e100_wp

   !> One group, being read or being written.
   type, extends(group_text_t) :: group_keys_t
   contains
      procedure :: real_key
      procedure :: optional_real
      procedure :: real_list
      procedure :: real_table
      procedure :: integer_key
      procedure :: logical_key
      procedure :: optional_integer
      procedure :: optional_logical
      procedure :: name_key
      procedure :: name_list
      procedure, private :: read_real
      procedure, private :: read_integer
      procedure, private :: read_name
   end type group_keys_t

contains

   !> The keys of a group of a case file, to be read.
   type(group_keys_t) function reading(group, number, many, file) result(keys)
      !> The group as scanned
      type(namelist_group_t), intent(in) :: group
      !> Its number among the groups of this name
      integer, intent(in) :: number
      !> Whether there may be several groups of this name, so that faults must say which
      logical, intent(in) :: many
      !> Name of the file, for the fault lines
      character(len=*), intent(in) :: file
      call keys%start_reading(group, number, many, file)
   end function reading

   !> A group to be written as namelist text.
   type(group_keys_t) function writing(name) result(keys)
      !> Name of the group
      character(len=*), intent(in) :: name
      call keys%start_writing(name)
   end function writing

   !> A real number.
   subroutine real_key(self, key, value, range, required)
      class(group_keys_t), intent(inout) :: self
      !> Name of the key
      character(len=*), intent(in) :: key
      !> Holds the default on entry, the given value on return
      real(wp), intent(inout) :: value
      !> Allowed values
      type(range_t), intent(in) :: range
      !> Whether a missing key is a fault (no by default)
      logical, intent(in), optional :: required
      type(namelist_value_t), allocatable :: elements(:)

      if (self%is_reading) then
         call self%fetch(key, 'a number '//range%describe(), 1, [1, 1], elements, required)
         if (size(elements) == 1) call self%read_real(key, elements(1), range, value)
      else
         call self%write_values(key, [real_text(value)])
      end if
   end subroutine real_key

   !> A real number that may be left unset.
   subroutine optional_real(self, key, value, range)
      class(group_keys_t), intent(inout) :: self
      !> Name of the key
      character(len=*), intent(in) :: key
      !> Allocated if the key is given
      real(wp), allocatable, intent(inout) :: value
      !> Allowed values
      type(range_t), intent(in) :: range
      real(wp) :: found

      found = 0.0_wp
      if (allocated(value)) found = value
      if (self%is_reading .or. allocated(value)) call self%real_key(key, found, range)
      if (self%is_reading .and. self%given(key) .and. self%sound(key)) value = found
   end subroutine optional_real

   !> A list of real numbers; not allocated if the key is not given.
   subroutine real_list(self, key, values, range, counts, required)
      class(group_keys_t), intent(inout) :: self
      !> Name of the key
      character(len=*), intent(in) :: key
      !> Holds the default on entry (not allocated: none), the given values on return
      real(wp), allocatable, intent(inout) :: values(:)
      !> Allowed values
      type(range_t), intent(in) :: range
      !> Fewest and most values (any number by default)
      integer, intent(in), optional :: counts(2)
      !> Whether a missing key is a fault (no by default)
      logical, intent(in), optional :: required
      type(namelist_value_t), allocatable :: elements(:)
      real(wp), allocatable :: found(:)
      integer :: k

      if (.not. self%is_reading) then
         if (allocated(values)) call self%write_values(key, real_text(values))
         return
      end if
      call self%fetch(key, 'a number '//range%describe(), 1, counts, elements, required)
      allocate (found(size(elements)))
      do k = 1, size(elements)
         call self%read_real(element_name(key, k, 1, size(elements)), elements(k), range, found(k))
      end do
      if (size(found) > 0 .and. self%sound(key)) values = found
   end subroutine real_list

   !> A table of real numbers, one column per thing; not allocated if the key is not given.
   subroutine real_table(self, key, values, rows, range, counts, required)
      class(group_keys_t), intent(inout) :: self
      !> Name of the key
      character(len=*), intent(in) :: key
      !> (rows, columns) default on entry (not allocated: none), the given values on return
      real(wp), allocatable, intent(inout) :: values(:, :)
      !> Rows of the table
      integer, intent(in) :: rows
      !> Allowed values
      type(range_t), intent(in) :: range
      !> Fewest and most columns
      integer, intent(in) :: counts(2)
      !> Whether a missing key is a fault (no by default)
      logical, intent(in), optional :: required
      type(namelist_value_t), allocatable :: elements(:)
      real(wp), allocatable :: found(:)
      integer :: k

      if (.not. self%is_reading) then
         if (.not. allocated(values)) return
         do k = 1, size(values, 2)
            call self%write_values(key//'(:,'//to_text(k)//')', real_text(values(:, k)))
         end do
         return
      end if
      call self%fetch(key, 'a column of '//to_text(rows)//' numbers', rows, counts, elements, required)
      allocate (found(size(elements)))
      do k = 1, size(elements)
         call self%read_real(element_name(key, k, rows, size(elements)), elements(k), range, found(k))
      end do
      if (size(found) > 0 .and. self%sound(key)) values = reshape(found, [rows, size(found)/rows])
   end subroutine real_table

   !> An integer.
   subroutine integer_key(self, key, value, range, required)
      class(group_keys_t), intent(inout) :: self
      !> Name of the key
      character(len=*), intent(in) :: key
      !> Holds the default on entry, the given value on return
      integer, intent(inout) :: value
      !> Allowed values
      type(range_t), intent(in) :: range
      !> Whether a missing key is a fault (no by default)
      logical, intent(in), optional :: required
      type(namelist_value_t), allocatable :: elements(:)

      if (self%is_reading) then
         call self%fetch(key, 'an integer '//range%describe(), 1, [1, 1], elements, required)
         if (size(elements) == 1) call self%read_integer(key, elements(1), range, value)
      else
         call self%write_values(key, [to_text(value)])
      end if
   end subroutine integer_key

   !> A switch, .true. or .false.
   subroutine logical_key(self, key, value)
      class(group_keys_t), intent(inout) :: self
      !> Name of the key
      character(len=*), intent(in) :: key
      !> Holds the default on entry, the given value on return
      logical, intent(inout) :: value
      type(namelist_value_t), allocatable :: elements(:)

      if (.not. self%is_reading) then
         call self%write_values(key, [merge('.true. ', '.false.', value)])
         return
      end if
      call self%fetch(key, '.true. or .false.', 1, [1, 1], elements)
      if (size(elements) /= 1) return
      if (any(lower_case(elements(1)%text) == ['.true. ', '.false.']) .and. .not. elements(1)%quoted) then
         value = lower_case(elements(1)%text) == '.true.'
      else
         call self%fault(key, '.true. or .false.', elements(1))
      end if
   end subroutine logical_key

   !> A switch that may be left unset.
   subroutine optional_logical(self, key, value)
      class(group_keys_t), intent(inout) :: self
      !> Name of the key
      character(len=*), intent(in) :: key
      !> Allocated if the key is given
      logical, allocatable, intent(inout) :: value
      logical :: found

      found = .false.
      if (allocated(value)) found = value
      if (self%is_reading .or. allocated(value)) call self%logical_key(key, found)
      if (self%is_reading .and. self%given(key) .and. self%sound(key)) value = found
   end subroutine optional_logical

   !> An integer that may be left unset.
   subroutine optional_integer(self, key, value, range)
      class(group_keys_t), intent(inout) :: self
      !> Name of the key
      character(len=*), intent(in) :: key
      !> Allocated if the key is given
      integer, allocatable, intent(inout) :: value
      !> Allowed values
      type(range_t), intent(in) :: range
      integer :: found

      found = 0
      if (allocated(value)) found = value
      if (self%is_reading .or. allocated(value)) call self%integer_key(key, found, range)
      if (self%is_reading .and. self%given(key) .and. self%sound(key)) value = found
   end subroutine optional_integer

   !> A name or any other text in quotes.
   subroutine name_key(self, key, value, allowed, announced, required)
      class(group_keys_t), intent(inout) :: self
      !> Name of the key
      character(len=*), intent(in) :: key
      !> Holds the default on entry, the given value on return (in lower case if it is one of `allowed`).
      !> Only a blank default that is not required may be given as blank
      character(len=*), intent(inout) :: value
      !> Allowed names (any text by default)
      character(len=*), intent(in), optional :: allowed(:)
      !> Names that will be allowed one day
      character(len=*), intent(in), optional :: announced(:)
      !> Whether a missing key is a fault (no by default)
      logical, intent(in), optional :: required
      type(namelist_value_t), allocatable :: elements(:)

      if (self%is_reading) then
         call self%fetch(key, name_noun(len(value), allowed), 1, [1, 1], elements, required)
         if (size(elements) == 1) call self%read_name(key, elements(1), value, allowed, announced, required)
      else
         call self%write_values(key, [string_literal(value)])
      end if
   end subroutine name_key

   !> A list of names; not allocated if the key is not given.
   subroutine name_list(self, key, values, allowed, announced, counts, required)
      class(group_keys_t), intent(inout) :: self
      !> Name of the key
      character(len=*), intent(in) :: key
      !> Holds the default on entry (not allocated: none), the given values on return
      character(len=*), allocatable, intent(inout) :: values(:)
      !> Allowed names (any text by default)
      character(len=*), intent(in), optional :: allowed(:)
      !> Names that will be allowed one day
      character(len=*), intent(in), optional :: announced(:)
      !> Fewest and most values (any number by default)
      integer, intent(in), optional :: counts(2)
      !> Whether a missing key is a fault (no by default)
      logical, intent(in), optional :: required
      type(namelist_value_t), allocatable :: elements(:)
      character(len=len(values)), allocatable :: found(:)
      character(len=2*len(values) + 2), allocatable :: literals(:)
      integer :: k

      if (.not. self%is_reading) then
         if (.not. allocated(values)) return
         allocate (literals(size(values)))
         do k = 1, size(values)
            literals(k) = string_literal(values(k))
         end do
         call self%write_values(key, literals)
         return
      end if
      call self%fetch(key, name_noun(len(values), allowed), 1, counts, elements, required)
      allocate (found(size(elements)))
      found = ''
      do k = 1, size(elements)
         call self%read_name(element_name(key, k, 1, size(elements)), elements(k), found(k), allowed, announced, .true.)
      end do
      if (size(found) > 0 .and. self%sound(key)) values = found
   end subroutine name_list

   !> Element to real number.
   subroutine read_real(self, element, given, range, value)
      class(group_keys_t), intent(inout) :: self
      !> Key, with subscripts in a list
      character(len=*), intent(in) :: element
      type(namelist_value_t), intent(in) :: given
      type(range_t), intent(in) :: range
      real(wp), intent(inout) :: value
      real(wp) :: found
      logical :: good

      good = .not. given%quoted
      if (good) good = text_to_real(given%text, found)
      if (good) then
         if (abs(found) > largest_size .or. (abs(found) < 1.0_wp/largest_size .and. abs(found) > 0.0_wp)) then
            call self%fault(element, '0, or a number of size 1e-100 to 1e100', given)
            return
         end if
         good = range%includes(found)
      end if
      if (good) then
         value = found
      else
         call self%fault(element, 'a finite number '//range%describe(), given)
      end if
   end subroutine read_real

   !> Element to integer.
   subroutine read_integer(self, element, given, range, value)
      class(group_keys_t), intent(inout) :: self
      character(len=*), intent(in) :: element
      type(namelist_value_t), intent(in) :: given
      type(range_t), intent(in) :: range
      integer, intent(inout) :: value
      integer :: found
      logical :: good

      good = .not. given%quoted
      if (good) good = text_to_integer(given%text, found)
      if (good) good = range%includes(real(found, wp))
      if (good) then
         value = found
      else
         call self%fault(element, 'an integer '//range%describe(), given)
      end if
   end subroutine read_integer

   !> Element to name.
   subroutine read_name(self, element, given, value, allowed, announced, required)
      class(group_keys_t), intent(inout) :: self
      character(len=*), intent(in) :: element
      type(namelist_value_t), intent(in) :: given
      character(len=*), intent(inout) :: value
      character(len=*), intent(in), optional :: allowed(:), announced(:)
      logical, intent(in), optional :: required

      if (.not. given%quoted .or. len_trim(given%text) > len(value)) then
         call self%fault(element, name_noun(len(value), allowed), given)
      else if (present(allowed)) then
         if (any(allowed == lower_case(given%text))) then
            value = lower_case(given%text)
         else if (is_one_of(lower_case(given%text), announced)) then
            call self%fault(element, quoted_list(allowed)//' (this one is announced, but not available yet)', given)
         else
            call self%fault(element, quoted_list(allowed), given)
         end if
      else if (given%text == '' .and. (value /= '' .or. is_true(required))) then
         call self%fault(element, 'a name that is not blank', given)
      else
         value = given%text
      end if
   end subroutine read_name

   !> What a name may be, in words.
   pure function name_noun(longest, allowed) result(noun)
      integer, intent(in) :: longest
      character(len=*), intent(in), optional :: allowed(:)
      character(len=:), allocatable :: noun

      noun = 'a text in quotes, at most '//to_text(longest)//' letters'
      if (present(allowed)) noun = 'one of '//quoted_list(allowed)
   end function name_noun

   !> key(3) or key(2,1) of the k-th element; just the key if it is the only one.
   pure function element_name(key, k, rows, elements) result(name)
      character(len=*), intent(in) :: key
      integer, intent(in) :: k, rows, elements
      character(len=:), allocatable :: name

      name = key
      if (rows > 1) then
         name = key//'('//to_text(mod(k - 1, rows) + 1)//','//to_text((k - 1)/rows + 1)//')'
      else if (elements > 1) then
         name = key//'('//to_text(k)//')'
      end if
   end function element_name

   impure elemental character(len=40) function real_text(value)
      real(wp), intent(in) :: value
      real_text = real_literal(value)
   end function real_text

   pure logical function is_one_of(name, names)
      character(len=*), intent(in) :: name
      character(len=*), intent(in), optional :: names(:)
      is_one_of = .false.
      if (present(names)) is_one_of = any(names == name)
   end function is_one_of

   pure logical function is_true(flag)
      logical, intent(in), optional :: flag
      is_true = .false.
      if (present(flag)) is_true = flag
   end function is_true

end module microslip_io_group_keys
