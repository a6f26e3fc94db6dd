!> The numbers of a state in a row, to be stored and taken back.
!>
!> A type with a state has one procedure, `pass(archive)`, that hands its components over one by one. It serves both
!> ways, so that they cannot differ: an archive that stores takes copies, one that loads gives them back, to the last bit.
!> What does not fit (cut off, of another kind) leaves the components as they are and the archive not `sound`.
module microslip_core_archive
   use microslip_core_kinds, only: wp
   implicit none(type, external)
   private

   public :: archive_t

   !> Words that a real takes.
   integer, parameter :: real_words = storage_size(1.0_wp)/storage_size(1)

   type :: archive_t
      private
      !> Room for more than there are
      integer, allocatable :: words(:)
      !> Words stored or given back
      integer :: position = 0
      logical, public :: loading = .false.
      logical :: broken = .false.
   contains
      procedure :: load
      procedure :: contents
      procedure :: sound
      procedure :: refuse
      procedure, private :: words_of
      procedure, private :: pass_real, pass_reals, pass_table, pass_integer, pass_integers, pass_logical, pass_logicals, &
         & pass_complex_table
      generic :: pass => pass_real, pass_reals, pass_table, pass_integer, pass_integers, pass_logical, pass_logicals, &
         & pass_complex_table
   end type archive_t

contains

   !> Begin to give back. A new archive stores.
   subroutine load(self, words)
      class(archive_t), intent(out) :: self
      !> What `contents` gave
      integer, intent(in) :: words(:)

      self%words = words
      self%loading = .true.
   end subroutine load

   !> What was stored.
   pure function contents(self) result(words)
      class(archive_t), intent(in) :: self
      integer, allocatable :: words(:)

      if (allocated(self%words)) then
         words = self%words(:self%position)
      else
         allocate (words(0))
      end if
   end function contents

   !> Whether everything was there.
   pure logical function sound(self)
      class(archive_t), intent(in) :: self
      sound = .not. self%broken
   end function sound

   !> What was given back does not fit.
   subroutine refuse(self)
      class(archive_t), intent(inout) :: self
      self%broken = .true.
   end subroutine refuse

   !> Take words, or give them back: all procedures below end here.
   subroutine words_of(self, words)
      class(archive_t), intent(inout) :: self
      integer, intent(inout) :: words(:)
      integer, allocatable :: more(:)

      if (self%broken) return
      if (.not. allocated(self%words)) allocate (self%words(1024))
      associate (last => self%position + size(words))
         if (self%loading) then
            self%broken = last > size(self%words)
            if (self%broken) return
            words = self%words(self%position + 1:last)
         else
            if (last > size(self%words)) then
               allocate (more(2*last))
               more(:self%position) = self%words(:self%position)
               call move_alloc(more, self%words)
            end if
            self%words(self%position + 1:last) = words
         end if
      end associate
      self%position = self%position + size(words)
   end subroutine words_of

   subroutine pass_integer(self, value)
      class(archive_t), intent(inout) :: self
      integer, intent(inout) :: value
      integer :: words(1)

      words = value
      call self%words_of(words)
      value = words(1)
   end subroutine pass_integer

   subroutine pass_logical(self, value)
      class(archive_t), intent(inout) :: self
      logical, intent(inout) :: value
      integer :: word

      word = merge(1, 0, value)
      call self%pass_integer(word)
      value = word == 1
   end subroutine pass_logical

   subroutine pass_real(self, value)
      class(archive_t), intent(inout) :: self
      real(wp), intent(inout) :: value
      integer :: words(real_words)

      words = transfer(value, words)
      call self%words_of(words)
      value = transfer(words, value)
   end subroutine pass_real

   !> The size of an array, -1 where it is not allocated. Sizes that cannot be are met with an empty array.
   subroutine pass_size(self, length, words_each)
      class(archive_t), intent(inout) :: self
      integer, intent(inout) :: length
      !> Of an element
      integer, intent(in) :: words_each

      call self%pass_integer(length)
      if (.not. self%loading) return
      if (self%broken .or. length > (size(self%words) - self%position)/words_each) then
         self%broken = .true.
         length = -1
      end if
   end subroutine pass_size

   subroutine pass_integers(self, values)
      class(archive_t), intent(inout) :: self
      integer, allocatable, intent(inout) :: values(:)
      integer :: length

      length = -1
      if (allocated(values)) length = size(values)
      call pass_size(self, length, 1)
      if (self%loading) then
         if (allocated(values)) deallocate (values)
         if (length >= 0) allocate (values(length))
      end if
      if (length > 0) call self%words_of(values)
   end subroutine pass_integers

   subroutine pass_logicals(self, values)
      class(archive_t), intent(inout) :: self
      logical, allocatable, intent(inout) :: values(:)
      integer, allocatable :: numbers(:)

      if (allocated(values)) numbers = merge(1, 0, values)
      call self%pass_integers(numbers)
      if (.not. self%loading) return
      if (allocated(values)) deallocate (values)
      if (allocated(numbers)) values = numbers == 1
   end subroutine pass_logicals

   subroutine pass_reals(self, values)
      class(archive_t), intent(inout) :: self
      real(wp), allocatable, intent(inout) :: values(:)
      integer, allocatable :: words(:)
      integer :: length

      length = -1
      if (allocated(values)) length = size(values)
      call pass_size(self, length, real_words)
      if (self%loading) then
         if (allocated(values)) deallocate (values)
         if (length >= 0) allocate (values(length))
      end if
      if (length <= 0) return
      allocate (words(real_words*length))
      words = transfer(values, words)
      call self%words_of(words)
      values = transfer(words, values)
   end subroutine pass_reals

   subroutine pass_table(self, values)
      class(archive_t), intent(inout) :: self
      real(wp), allocatable, intent(inout) :: values(:, :)
      real(wp), allocatable :: row(:)
      integer :: first

      first = -1
      if (allocated(values)) then
         first = size(values, 1)
         row = reshape(values, [size(values)])
      end if
      call self%pass_integer(first)
      call self%pass_reals(row)
      if (.not. self%loading) return
      if (allocated(values)) deallocate (values)
      if (allocated(row) .and. first > 0) values = reshape(row, [first, size(row)/first])
      if (allocated(row) .and. first == 0) allocate (values(0, 0))
   end subroutine pass_table

   subroutine pass_complex_table(self, values)
      class(archive_t), intent(inout) :: self
      complex(wp), allocatable, intent(inout) :: values(:, :)
      real(wp), allocatable :: parts(:, :)
      integer :: n

      if (allocated(values)) parts = reshape([real(values), aimag(values)], [size(values, 1), 2*size(values, 2)])
      call self%pass_table(parts)
      if (.not. self%loading) return
      if (allocated(values)) deallocate (values)
      if (.not. allocated(parts)) return
      n = size(parts, 2)/2
      values = cmplx(parts(:, :n), parts(:, n + 1:), wp)
   end subroutine pass_complex_table

end module microslip_core_archive
