!> The namelist scanner agrees with the compiler's namelist read, and survives any text.
module test_io_namelist_text
   use microslip_core_error, only: error_t
   use microslip_core_fault_list, only: fault_list_t
   use microslip_core_kinds, only: wp
   use microslip_core_nearest_name, only: nearest_name, edit_distance
   use microslip_core_text, only: to_text
   use microslip_io_case, only: case_t
   use microslip_io_case_file, only: case_from_text
   use microslip_io_namelist_text, only: namelist_group_t, namelist_value_t, scan_namelists
   use microslip_io_namelist_values, only: gather_elements, text_to_real, real_literal
   use test_io_case_faults, only: beam_case
   use testdrive, only: new_unittest, unittest_type, error_type, check
   implicit none(type, external)
   private

   public :: collect_io_namelist_text

   character(len=*), parameter :: nl = new_line('a')

contains

   subroutine collect_io_namelist_text(testsuite)
      type(unittest_type), allocatable, intent(out) :: testsuite(:)

      testsuite = [ &
         new_unittest('like_the_compiler', test_like_the_compiler), &
         new_unittest('subscript_faults', test_subscript_faults), &
         new_unittest('lines', test_lines), &
         new_unittest('real_literals', test_real_literals), &
         new_unittest('nearest_name', test_nearest_name), &
         new_unittest('damaged_texts', test_damaged_texts), &
         new_unittest('long_lists', test_long_lists)]
   end subroutine collect_io_namelist_text

   !> The same values as gfortran's own read; what is not given keeps its preset.
   subroutine test_like_the_compiler(error)
      type(error_type), allocatable, intent(out) :: error

      call compare(error, "&g list = 1, 2.5, -3e-2 /")
      call compare(error, "&g LIST = 1 2 3 ! four"//nl//" 4 /")
      call compare(error, "&g list(3) = 7 /")
      call compare(error, "&g list(2) = 1, 2, 3 list(1) = 9/")
      call compare(error, "&g list(2:4) = 3*0.5 /")
      call compare(error, "&g list(:) = 1, 2 /")
      call compare(error, "&g list = 2*1.0, , 4 /")
      call compare(error, "&g list = 2*, 3 /")
      call compare(error, "&g table = 1, 2, 3, 4, 5, 6 /")
      call compare(error, "&g table(:,2) = 1, 2, 3 table(2,1) = 8 /")
      call compare(error, "&g table(2,1) = 1 table(3,3) = 2 /")
      call compare(error, "&g table(1:2,3) = 1, 2 table(3,1:2) = 5, 6 /")
      call compare(error, "&g list = 1.d0, 2., .5 table(1, 1) = 3"//nl//"&end")
      call compare(error, "&g"//achar(9)//"list"//achar(9)//"="//achar(9)//"1,2, /")
   end subroutine test_like_the_compiler

   subroutine compare(error, text)
      type(error_type), allocatable, intent(inout) :: error
      character(len=*), intent(in) :: text
      real(wp) :: list(6), table(3, 3), native_list(6), native_table(3, 3)
      type(namelist_group_t), allocatable :: groups(:)
      type(fault_list_t) :: faults
      integer :: status

      if (allocated(error)) return
      list = -1.0_wp
      table = -1.0_wp
      call scan_namelists(text, 'text', groups, faults)
      call fill(groups(1), 'list', 1, list)
      call fill_table(groups(1), table)
      call native_read(text, native_list, native_table, status)
      call check(error, faults%number(), 0, text)
      if (allocated(error)) return
      call check(error, status, 0, 'the compiler does not read '//text)
      if (allocated(error)) return
      call check(error, all(abs(list - native_list) <= 0.0_wp) .and. all(abs(table - native_table) <= 0.0_wp), text)
   end subroutine compare

   subroutine fill_table(group, table)
      type(namelist_group_t), intent(in) :: group
      real(wp), intent(inout) :: table(3, 3)
      real(wp) :: flat(9)

      flat = reshape(table, [9])
      call fill(group, 'table', 3, flat)
      table = reshape(flat, [3, 3])
   end subroutine fill_table

   subroutine fill(group, key, rows, values)
      type(namelist_group_t), intent(in) :: group
      character(len=*), intent(in) :: key
      integer, intent(in) :: rows
      real(wp), intent(inout) :: values(:)
      type(namelist_value_t), allocatable :: elements(:)
      character(len=:), allocatable :: problem
      integer :: k

      call gather_elements(group, key, rows, size(values), elements, problem)
      if (problem /= '') values = huge(1.0_wp)
      do k = 1, size(elements)
         if (.not. allocated(elements(k)%text)) cycle
         if (.not. text_to_real(elements(k)%text, values(k))) values = huge(1.0_wp)
      end do
   end subroutine fill

   subroutine native_read(text, list, table, status)
      character(len=*), intent(in) :: text
      real(wp), intent(out) :: list(6), table(3, 3)
      integer, intent(out) :: status
      integer :: unit
      namelist /g/ list, table

      list = -1.0_wp
      table = -1.0_wp
      open (newunit=unit, status='scratch', action='readwrite')
      write (unit, '(a)') text
      rewind (unit)
      read (unit, nml=g, iostat=status)
      close (unit)
   end subroutine native_read

   !> Subscripts that fit no list or table are named.
   subroutine test_subscript_faults(error)
      type(error_type), allocatable, intent(out) :: error

      call expect_problem(error, 'list(1,2) = 3', 'takes one subscript')
      call expect_problem(error, 'list(2:3) = 3*1', 'more values than elements')
      call expect_problem(error, 'list(99999999) = 1', 'too many values')
      call expect_problem(error, 'list(2) = 1 list = 3*1', 'given twice (lines 1 and 1)')
      call expect_problem(error, 'table(2) = 1', 'takes two subscripts', 3)
      call expect_problem(error, 'list(1:3) = 1, 2', 'fewer values than the subscript names')
      call expect_problem(error, 'table(1:2,3) = 1', 'fewer values than the subscript names', 3)
      call expect_problem(error, 'table(2,1) = 1, 2', 'more values than elements', 3)
      call expect_problem(error, 'table(4,1) = 1', 'the first subscript goes from 1 to 3', 3)
      call expect_problem(error, 'table(1,99999999) = 1', 'too many values', 3)
   end subroutine test_subscript_faults

   subroutine expect_problem(error, keys, expected, rows)
      type(error_type), allocatable, intent(inout) :: error
      character(len=*), intent(in) :: keys, expected
      integer, intent(in), optional :: rows
      type(namelist_group_t), allocatable :: groups(:)
      type(namelist_value_t), allocatable :: elements(:)
      type(fault_list_t) :: faults
      character(len=:), allocatable :: problem
      integer :: height

      if (allocated(error)) return
      height = 1
      if (present(rows)) height = rows
      call scan_namelists('&g '//keys//' /', 'text', groups, faults)
      call gather_elements(groups(1), keys(:index(keys, '(') - 1), height, 9, elements, problem)
      call check(error, problem, expected, keys)
      if (allocated(error)) return
      call check(error, size(elements), 0)
   end subroutine expect_problem

   !> Groups and keys know their lines.
   subroutine test_lines(error)
      type(error_type), allocatable, intent(out) :: error
      type(namelist_group_t), allocatable :: groups(:)
      type(fault_list_t) :: faults

      call scan_namelists('! first'//nl//nl//'&a x = 1'//nl//'y = 2,'//nl//'3 /'//nl//'&B /', 'text', groups, faults)
      call check(error, size(groups) == 2 .and. faults%number() == 0)
      if (allocated(error)) return
      call check(error, groups(1)%line == 3 .and. groups(2)%line == 6 .and. groups(2)%name == 'b')
      if (allocated(error)) return
      call check(error, groups(1)%assignments(2)%line == 4 .and. groups(1)%assignments(2)%count == 2)
   end subroutine test_lines

   !> Written numbers read back to the last bit, over the whole range.
   subroutine test_real_literals(error)
      type(error_type), allocatable, intent(out) :: error
      real(wp) :: value, again
      integer :: k

      do k = -300, 300, 7
         value = -sqrt(2.0_wp)*10.0_wp**k
         call check(error, text_to_real(real_literal(value), again), real_literal(value))
         if (allocated(error)) return
         call check(error, abs(value - again) <= 0.0_wp, real_literal(value))
         if (allocated(error)) return
      end do
      call check(error, real_literal(0.74_wp)//' '//real_literal(2210.0_wp)//' '//real_literal(0.0_wp), '0.74 2210 0')
      if (allocated(error)) return
      call check(error, real_literal(1.94e11_wp)//' '//real_literal(-1.0e-120_wp), '1.94E+11 -1.0E-120')
   end subroutine test_real_literals

   subroutine test_nearest_name(error)
      type(error_type), allocatable, intent(out) :: error
      character(len=9), parameter :: known(3) = ['friction ', 'stride   ', 'nx       ']

      call check(error, edit_distance('kitten', 'sitting'), 3)
      if (allocated(error)) return
      call check(error, edit_distance('', 'abc'), 3)
      if (allocated(error)) return
      call check(error, nearest_name('Fricton', known), 'friction')
      if (allocated(error)) return
      call check(error, nearest_name('temperature', known), '')
   end subroutine test_nearest_name

   !> A case text with damaged letters is read to the end, whatever stands in it.
   subroutine test_damaged_texts(error)
      type(error_type), allocatable, intent(out) :: error
      character(len=*), parameter :: letters = '&/,=()*:''"!; 0a9'//nl//achar(0)//achar(200)
      character(len=:), allocatable :: text
      type(case_t) :: input
      type(error_t), allocatable :: fault
      integer :: k, j, at, letter, state, accepted

      state = 1
      accepted = 0
      do k = 1, 400
         text = beam_case()
         do j = 1, 3
            at = 1 + mod(next(state), len(text))
            letter = 1 + mod(next(state), len(letters))
            text(at:at) = letters(letter:letter)
         end do
         if (mod(k, 4) == 0) text = text(:at)
         call case_from_text(text, 'damaged', input, fault)
         if (.not. allocated(fault)) accepted = accepted + 1
      end do
      call check(error, accepted < 200, 'most damaged texts are refused, accepted: '//to_text(accepted))
   end subroutine test_damaged_texts

   !> A small linear congruential generator, so that the test is the same every time.
   integer function next(state)
      integer, intent(inout) :: state
      state = iand(state*1103 + 12345, 1048575)
      next = state/16
   end function next

   !> Long lists take no quadratic time, and endless repeat counts no memory.
   subroutine test_long_lists(error)
      type(error_type), allocatable, intent(out) :: error
      type(namelist_group_t), allocatable :: groups(:)
      type(fault_list_t) :: faults

      call scan_namelists('&g x = '//repeat('1.0, '//nl, 10000)//' /', 'text', groups, faults)
      call check(error, groups(1)%assignments(1)%count, 10000)
      if (allocated(error)) return
      call scan_namelists('&g x = '//repeat('10000*1.0 ', 100)//' 99999999999*1 0*1 /', 'text', groups, faults)
      call check(error, faults%number(), 2)
      if (allocated(error)) return
      call check(error, groups(1)%assignments(1)%count <= 20000)
   end subroutine test_long_lists

end module test_io_namelist_text
