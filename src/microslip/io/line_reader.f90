!> Fast reading of text files line by line: blocks from the disk, hand-written number parsing.
!>
!> Lines end in LF, CR LF or, in files without any LF at their beginning, CR. A byte order mark of UTF-8 is skipped, UTF-16 is
!> refused.
module microslip_io_line_reader
   use microslip_core_error, only: bad_input, error_t
   use microslip_core_kinds, only: i8, wp
   use microslip_core_text, only: to_text
   use microslip_io_file_identity, only: file_identity_t, identity_of, kind_in_words, kind_regular, kind_unknown
   use microslip_io_input_files, only: note_input
   implicit none(type, external)
   private

   public :: line_reader_t, next_integer, next_real

   !> Bytes read from the disk at once, and the longest line.
   integer, parameter :: block_size = 2**20
   !> Powers of ten that are exact in double precision.
   real(wp), parameter :: power_of_ten(0:22) = [1e0_wp, 1e1_wp, 1e2_wp, 1e3_wp, 1e4_wp, 1e5_wp, 1e6_wp, 1e7_wp, &
      1e8_wp, 1e9_wp, 1e10_wp, 1e11_wp, 1e12_wp, 1e13_wp, 1e14_wp, 1e15_wp, 1e16_wp, 1e17_wp, 1e18_wp, 1e19_wp, &
      1e20_wp, 1e21_wp, 1e22_wp]
   !> Integers up to here are exact in double precision.
   integer(i8), parameter :: largest_mantissa = 2_i8**53

   !> A text file that is read line by line. The current line is buffer(first:last).
   type :: line_reader_t
      !> Where the file is
      character(len=:), allocatable :: path
      !> Number of the current line, from 1
      integer :: line = 0
      !> Text in memory and the place of the current line in it
      character(len=:), allocatable :: buffer
      integer :: first = 1, last = 0
      !> Whether the current line has an end; that of a file that was cut off has none as a rule
      logical :: has_end = .true.
      character(len=1), private :: line_end = new_line('a')
      integer, private :: unit = -1, filled = 0, next = 1
      integer(i8), private :: left = 0
   contains
      procedure :: open => open_lines
      procedure :: next_line
      procedure :: text
      procedure :: shown
      procedure :: beginning
      procedure :: place
      procedure :: close => close_lines
   end type line_reader_t

contains

   !> Open a file.
   subroutine open_lines(self, path, error)
      class(line_reader_t), intent(inout) :: self
      !> Where it is
      character(len=*), intent(in) :: path
      type(error_t), allocatable, intent(out) :: error
      type(file_identity_t) :: there
      integer :: status
      logical :: exists

      self%path = path
      call note_input(path)
      there = identity_of(path)
      if (there%exists() .and. there%kind /= kind_regular .and. there%kind /= kind_unknown) then
         call bad_input(error, path//': is '//kind_in_words(there%kind)//': a text file is allowed')
         return
      end if
      inquire (file=path, exist=exists, size=self%left)
      status = 1
      if (exists) open (newunit=self%unit, file=path, access='stream', form='unformatted', action='read', iostat=status)
      if (status /= 0) then
         call bad_input(error, path//trim(merge(': cannot be read', ': no such file  ', exists)))
         return
      end if
      allocate (character(len=2*block_size) :: self%buffer)
      self%line = 0
      self%filled = 0
      self%next = 1
      self%line_end = new_line('a')
   end subroutine open_lines

   !> Go to the next line; `found` is false behind the last one.
   subroutine next_line(self, found, error)
      class(line_reader_t), intent(inout) :: self
      !> Whether there is one
      logical, intent(out) :: found
      type(error_t), allocatable, intent(out) :: error
      integer :: length, part, status

      found = .false.
      length = index(self%buffer(self%next:self%filled), self%line_end)
      if (length == 0 .and. self%left > 0) then
         ! Move the beginning of the line to the front and read on behind it.
         self%buffer(:self%filled - self%next + 1) = self%buffer(self%next:self%filled)
         self%filled = self%filled - self%next + 1
         self%next = 1
         part = int(min(self%left, int(len(self%buffer) - self%filled, i8)))
         read (self%unit, iostat=status) self%buffer(self%filled + 1:self%filled + part)
         if (status /= 0) then
            call bad_input(error, self%path//': cannot be read behind line '//to_text(self%line))
            return
         end if
         self%filled = self%filled + part
         self%left = self%left - part
         if (self%line == 0) call look_at_beginning(self, error)
         if (allocated(error)) return
         length = index(self%buffer(self%next:self%filled), self%line_end)
         if (length == 0 .and. self%left > 0) then
            call bad_input(error, self%path//': line '//to_text(self%line + 1)//' is too long, is this a text file?')
            return
         end if
      end if
      if (self%next > self%filled) return
      self%has_end = length > 0
      if (length == 0) length = self%filled - self%next + 2
      found = .true.
      self%line = self%line + 1
      self%first = self%next
      self%last = self%next + length - 2
      self%next = self%next + length
      do while (self%last >= self%first)
         if (self%buffer(self%last:self%last) /= achar(13)) exit
         self%last = self%last - 1
      end do
   end subroutine next_line

   !> Byte order mark and line ends.
   subroutine look_at_beginning(self, error)
      type(line_reader_t), intent(inout) :: self
      type(error_t), allocatable, intent(out) :: error

      associate (bytes => self%buffer(:self%filled))
         if (index(bytes, char(239)//char(187)//char(191)) == 1) self%next = 4
         if (index(bytes, char(255)//char(254)) == 1 .or. index(bytes, char(254)//char(255)) == 1) &
            call bad_input(error, self%path//': a text in UTF-16: save it as ASCII or UTF-8')
         if (index(bytes, new_line('a')) == 0 .and. index(bytes, achar(13)) > 0) self%line_end = achar(13)
      end associate
   end subroutine look_at_beginning

   !> The first bytes of the file, while the first line is the current one.
   pure function beginning(self, most) result(bytes)
      class(line_reader_t), intent(in) :: self
      !> No more than these
      integer, intent(in) :: most
      character(len=:), allocatable :: bytes
      bytes = self%buffer(:min(most, self%filled))
   end function beginning

   !> The current line for messages: cut, and without control characters.
   pure function shown(self) result(text)
      class(line_reader_t), intent(in) :: self
      character(len=:), allocatable :: text
      integer, parameter :: longest = 100
      integer :: k

      text = self%buffer(self%first:min(self%last, self%first + longest - 1))
      do k = 1, len(text)
         if (ichar(text(k:k)) < 32 .or. ichar(text(k:k)) == 127) text(k:k) = merge(' ', '?', text(k:k) == achar(9))
      end do
      if (self%last - self%first + 1 > longest) text = text//'...'
   end function shown

   !> The current line.
   pure function text(self)
      class(line_reader_t), intent(in) :: self
      character(len=:), allocatable :: text
      text = self%buffer(self%first:self%last)
   end function text

   !> 'file, line 12: ', the start of a message.
   pure function place(self)
      class(line_reader_t), intent(in) :: self
      character(len=:), allocatable :: place
      place = self%path//', line '//to_text(self%line)//': '
   end function place

   !> Close the file; harmless if it is not open.
   subroutine close_lines(self)
      class(line_reader_t), intent(inout) :: self
      if (self%unit /= -1) close (self%unit)
      self%unit = -1
      if (allocated(self%buffer)) deallocate (self%buffer)
   end subroutine close_lines

   !> Parse an integer at text(position:), behind blanks; position ends behind it.
   pure subroutine next_integer(text, position, value, ok)
      !> Text
      character(len=*), intent(in) :: text
      !> Where to begin; on success, behind the number
      integer, intent(inout) :: position
      !> The number
      integer, intent(out) :: value
      !> Whether there was one that fits
      logical, intent(out) :: ok
      integer(i8) :: number
      integer :: p, digit, start
      logical :: negative

      ok = .false.
      value = 0
      p = position
      call skip_blanks(text, p)
      if (p > len(text)) return
      negative = text(p:p) == '-'
      if (negative .or. text(p:p) == '+') p = p + 1
      start = p
      number = 0
      do while (p <= len(text))
         digit = iachar(text(p:p)) - 48
         if (digit < 0 .or. digit > 9) exit
         number = 10*number + digit
         if (number > huge(1)) return
         p = p + 1
      end do
      ok = p > start
      if (.not. ok) return
      value = int(number)
      if (negative) value = -value
      position = p
   end subroutine next_integer

   !> Parse a real number at text(position:), behind blanks, correctly rounded; position ends behind it. Exponents
   !> may be written with e or d; infinities, NaN and numbers out of range are refused.
   pure subroutine next_real(text, position, value, ok)
      !> Text
      character(len=*), intent(in) :: text
      !> Where to begin; on success, behind the number
      integer, intent(inout) :: position
      !> The number
      real(wp), intent(out) :: value
      !> Whether there was one
      logical, intent(out) :: ok
      integer(i8) :: mantissa
      integer :: p, digit, digits, start, exponent, decimals, status
      logical :: negative, point

      ok = .false.
      value = 0.0_wp
      p = position
      call skip_blanks(text, p)
      if (p > len(text)) return
      start = p
      negative = text(p:p) == '-'
      if (negative .or. text(p:p) == '+') p = p + 1
      mantissa = 0
      digits = 0
      decimals = 0
      point = .false.
      do while (p <= len(text))
         digit = iachar(text(p:p)) - 48
         if (digit >= 0 .and. digit <= 9) then
            digits = digits + 1
            ! More than 18 digits would overflow: too large a mantissa sends them to the internal read.
            if (mantissa <= largest_mantissa) mantissa = 10*mantissa + digit
            if (point) decimals = decimals + 1
         else if (digit == -2 .and. .not. point) then
            point = .true.
         else
            exit
         end if
         p = p + 1
      end do
      if (digits == 0) return
      exponent = 0
      if (p < len(text)) then
         select case (text(p:p))
         case ('e', 'E', 'd', 'D')
            if (text(p + 1:p + 1) == ' ') return
            p = p + 1
            call next_integer(text, p, exponent, ok)
            if (.not. ok .or. abs(exponent) > 999) return
            ok = .false.
         end select
      end if
      exponent = exponent - decimals
      if (mantissa <= largest_mantissa .and. abs(exponent) <= 22) then
         if (exponent < 0) then
            value = real(mantissa, wp)/power_of_ten(-exponent)
         else
            value = real(mantissa, wp)*power_of_ten(exponent)
         end if
         if (negative) value = -value
      else if (mantissa /= 0) then
         read (text(start:p - 1), *, iostat=status) value
         if (status /= 0 .or. .not. abs(value) <= huge(1.0_wp)) return
      end if
      ok = .true.
      position = p
   end subroutine next_real

   !> Move to the next character that is neither blank nor tabulator.
   pure subroutine skip_blanks(text, p)
      character(len=*), intent(in) :: text
      integer, intent(inout) :: p

      do while (p <= len(text))
         if (text(p:p) /= ' ' .and. text(p:p) /= achar(9)) return
         p = p + 1
      end do
   end subroutine skip_blanks

end module microslip_io_line_reader
