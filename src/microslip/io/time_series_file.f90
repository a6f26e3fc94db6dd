!> A function of time from a text file: two columns, time and value; blank lines, and lines that begin with #, ! or %,
!> are passed over. The columns are separated by blanks, tabulators, a comma or a semicolon.
module microslip_io_time_series_file
   use microslip_core_error, only: error_t, bad_input
   use microslip_core_kinds, only: wp
   use microslip_core_text, only: to_text
   use microslip_io_line_reader, only: line_reader_t, next_real
   implicit none(type, external)
   private

   public :: read_time_series

contains

   !> Read a file.
   subroutine read_time_series(path, table, error)
      !> Where it is
      character(len=*), intent(in) :: path
      !> (2, points) time, ascending, and value
      real(wp), allocatable, intent(out) :: table(:, :)
      type(error_t), allocatable, intent(out) :: error
      type(line_reader_t) :: reader
      real(wp), allocatable :: longer(:, :)
      real(wp) :: point(2)
      integer :: points
      logical :: found

      points = 0
      allocate (table(2, 1024))
      call reader%open(path, error)
      if (allocated(error)) return
      do
         call reader%next_line(found, error)
         if (allocated(error) .or. .not. found) exit
         if (is_remark(reader%text())) cycle
         call read_point(reader, point, error)
         if (allocated(error)) exit
         if (points > 0) then
            if (.not. point(1) > table(1, points)) then
               call bad_input(error, reader%place()//'times must ascend: '//to_text(point(1))//' s after '// &
                  to_text(table(1, points))//' s')
               exit
            end if
         end if
         if (points == size(table, 2)) then
            allocate (longer(2, 2*points))
            longer(:, :points) = table
            call move_alloc(longer, table)
         end if
         points = points + 1
         table(:, points) = point
      end do
      call reader%close()
      if (.not. allocated(error) .and. points < 2) &
         call bad_input(error, path//': at least two lines with time and value are needed, there are '//to_text(points))
      table = table(:, :points)
   end subroutine read_time_series

   !> Whether a line has no numbers to give.
   pure logical function is_remark(line)
      character(len=*), intent(in) :: line
      integer :: at

      at = verify(line, ' '//achar(9))
      is_remark = at == 0
      if (.not. is_remark) is_remark = scan(line(at:at), '#!%') > 0
   end function is_remark

   !> Time and value of a line.
   subroutine read_point(reader, point, error)
      type(line_reader_t), intent(in) :: reader
      real(wp), intent(out) :: point(2)
      type(error_t), allocatable, intent(out) :: error
      character(len=:), allocatable :: line
      integer :: at
      logical :: ok(2)

      line = reader%text()
      at = scan(line, ',;')
      if (at > 0) line(at:at) = ' '
      at = 1
      point = 0.0_wp
      call next_real(line, at, point(1), ok(1))
      call next_real(line, at, point(2), ok(2))
      if (.not. all(ok)) then
         call bad_input(error, reader%place()//"two numbers are needed, time and value: '"//reader%text()//"'")
      else if (at <= len(line)) then
         if (verify(line(at:), ' '//achar(9)) > 0) call bad_input(error, reader%place()// &
            "two numbers and no more are allowed: '"//reader%text()//"'")
      end if
   end subroutine read_point

end module microslip_io_time_series_file
