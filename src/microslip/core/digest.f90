!> A fingerprint of data: two polynomial hashes modulo 2^31 - 1, 16 hexadecimal digits.
!> It recognises whether stored results belong to an input; it is no protection against intent.
module microslip_core_digest
   use, intrinsic :: iso_fortran_env, only: int32
   use microslip_core_kinds, only: wp, i8
   implicit none(type, external)
   private

   public :: digest_t

   integer(i8), parameter :: modulus = 2147483647_i8
   integer(i8), parameter :: base(2) = [1103515245_i8, 742938285_i8]

   !> Collects data; the order counts.
   type :: digest_t
      integer(i8), private :: hash(2) = [1_i8, 1_i8]
   contains
      procedure, private :: add_words
      procedure, private :: add_reals
      procedure, private :: add_integers
      procedure, private :: add_text
      generic :: add => add_reals, add_integers, add_text
      procedure :: hexadecimal
   end type digest_t

contains

   !> Take in 32-bit words.
   pure subroutine add_words(self, words)
      class(digest_t), intent(inout) :: self
      integer(int32), intent(in) :: words(:)
      integer(i8) :: word
      integer :: k

      do k = 1, size(words)
         word = iand(int(words(k), i8), int(z'FFFFFFFF', i8))
         self%hash = mod(self%hash*base + word + 1_i8, modulus)
      end do
   end subroutine add_words

   pure subroutine add_reals(self, values)
      class(digest_t), intent(inout) :: self
      real(wp), intent(in) :: values(:)
      integer :: k

      call self%add_words([int(size(values), int32)])
      do k = 1, size(values)
         call self%add_words(transfer(values(k), [0_int32]))
      end do
   end subroutine add_reals

   pure subroutine add_integers(self, values)
      class(digest_t), intent(inout) :: self
      integer, intent(in) :: values(:)

      call self%add_words([int(size(values), int32)])
      call self%add_words(int(values, int32))
   end subroutine add_integers

   pure subroutine add_text(self, text)
      class(digest_t), intent(inout) :: self
      character(len=*), intent(in) :: text
      integer :: k

      call self%add_words([int(len(text), int32)])
      call self%add_words([(int(iachar(text(k:k)), int32), k=1, len(text))])
   end subroutine add_text

   !> The fingerprint, 16 characters.
   pure function hexadecimal(self) result(text)
      class(digest_t), intent(in) :: self
      character(len=16) :: text
      write (text, '(2z8.8)') self%hash
   end function hexadecimal

end module microslip_core_digest
