!> Which file a path leads to: device and inode through symbolic and hard links, its kind, and for a name that is not there
!> yet the place where it would appear. Nothing is opened: to open a FIFO could wait for ever.
!>
!> statx(2) has the same layout on all Linux systems, which stat(2) has not.
module microslip_io_file_identity
   use, intrinsic :: iso_c_binding, only: c_associated, c_char, c_f_pointer, c_int, c_int16_t, c_int32_t, c_int64_t, &
      & c_null_char, c_null_ptr, c_ptr, c_size_t
   use microslip_core_kinds, only: i8
   implicit none(type, external)
   private

   public :: file_identity_t, identity_of, identity_of_descriptor, same_file, kind_in_words, place_of, folder_of, &
      & link_target, may_be_written
   public :: kind_none, kind_regular, kind_folder, kind_unknown

   !> Kinds of files, by the bits of the mode that tell them.
   integer, parameter :: kind_none = 0, kind_unknown = -1, kind_fifo = int(o'010000'), kind_characters = int(o'020000'), &
      & kind_folder = int(o'040000'), kind_blocks = int(o'060000'), kind_regular = int(o'100000'), &
      & kind_link = int(o'120000'), kind_socket = int(o'140000')
   integer, parameter :: kind_bits = int(o'170000'), permission_bits = int(o'7777')

   !> Of the C library: the current folder, do not follow a link, the descriptor itself, all there is to know.
   integer(c_int), parameter :: at_fdcwd = -100, at_symlink_nofollow = int(z'100'), at_empty_path = int(z'1000'), &
      & statx_basic_stats = int(z'7ff')
   !> access(2): may be written, may be searched, is there
   integer(c_int), parameter :: w_ok = 2, x_ok = 1, f_ok = 0
   !> Most symbolic links one after the other, and the longest path.
   integer, parameter :: most_links = 40, longest_path = 4096

   !> What a path leads to.
   type :: file_identity_t
      !> One of the kinds; `kind_none`: there is nothing
      integer :: kind = kind_none
      integer(i8) :: device = 0, inode = 0
      !> bytes
      integer(i8) :: bytes = 0
      !> Number of names that this file has; its permissions
      integer :: names = 0, permissions = 0
      !> Absolute path, all links followed; '' where no file can be (its folder is missing, links in a circle)
      character(len=:), allocatable :: place
   contains
      procedure :: exists
   end type file_identity_t

   type, bind(c) :: statx_t
      integer(c_int32_t) :: mask, block_size
      integer(c_int64_t) :: attributes
      integer(c_int32_t) :: links, user, group
      integer(c_int16_t) :: mode, spare_1
      integer(c_int64_t) :: inode, size, blocks, attributes_mask
      integer(c_int64_t) :: times(8)
      integer(c_int32_t) :: rdev_major, rdev_minor, dev_major, dev_minor
      integer(c_int64_t) :: spare_2(14)
   end type statx_t

   interface
      function c_statx(folder, path, flags, mask, answer) bind(c, name='statx') result(status)
         import :: c_char, c_int, statx_t
         implicit none(type, external)
         integer(c_int), value :: folder, flags, mask
         character(kind=c_char), intent(in) :: path(*)
         type(statx_t), intent(out) :: answer
         integer(c_int) :: status
      end function c_statx

      function c_access(path, mode) bind(c, name='access') result(status)
         import :: c_char, c_int
         implicit none(type, external)
         character(kind=c_char), intent(in) :: path(*)
         integer(c_int), value :: mode
         integer(c_int) :: status
      end function c_access

      function c_realpath(path, buffer) bind(c, name='realpath') result(resolved)
         import :: c_char, c_ptr
         implicit none(type, external)
         character(kind=c_char), intent(in) :: path(*)
         type(c_ptr), value :: buffer
         type(c_ptr) :: resolved
      end function c_realpath

      function c_readlink(path, buffer, length) bind(c, name='readlink') result(done)
         import :: c_char, c_size_t
         implicit none(type, external)
         character(kind=c_char), intent(in) :: path(*)
         character(kind=c_char), intent(out) :: buffer(*)
         integer(c_size_t), value :: length
         integer(c_size_t) :: done
      end function c_readlink

      function c_strlen(text) bind(c, name='strlen') result(length)
         import :: c_ptr, c_size_t
         implicit none(type, external)
         type(c_ptr), value :: text
         integer(c_size_t) :: length
      end function c_strlen

      subroutine c_free(memory) bind(c, name='free')
         import :: c_ptr
         implicit none(type, external)
         type(c_ptr), value :: memory
      end subroutine c_free
   end interface

contains

   !> What a path leads to, through links.
   function identity_of(path) result(identity)
      character(len=*), intent(in) :: path
      type(file_identity_t) :: identity
      type(statx_t) :: answer

      identity%place = place_of(path)
      if (c_statx(at_fdcwd, path//c_null_char, 0_c_int, statx_basic_stats, answer) == 0) then
         call take_over(answer, identity)
      else if (c_access(path//c_null_char, f_ok) == 0) then
         ! A system without statx: only the place is known.
         identity%kind = kind_unknown
      end if
   end function identity_of

   !> The open file of a descriptor.
   function identity_of_descriptor(descriptor) result(identity)
      integer(c_int), intent(in) :: descriptor
      type(file_identity_t) :: identity
      type(statx_t) :: answer

      identity%place = ''
      if (c_statx(descriptor, c_null_char, at_empty_path, statx_basic_stats, answer) == 0) call take_over(answer, identity)
   end function identity_of_descriptor

   !> The answer of the system.
   pure subroutine take_over(answer, identity)
      type(statx_t), intent(in) :: answer
      type(file_identity_t), intent(inout) :: identity

      identity%kind = iand(int(answer%mode), kind_bits)
      identity%permissions = iand(int(answer%mode), permission_bits)
      identity%device = ior(ishft(int(answer%dev_major, i8), 32), iand(int(answer%dev_minor, i8), int(z'FFFFFFFF', i8)))
      identity%inode = answer%inode
      identity%bytes = answer%size
      identity%names = answer%links
   end subroutine take_over

   !> Whether there is a file.
   pure logical function exists(self)
      class(file_identity_t), intent(in) :: self
      exists = self%kind /= kind_none
   end function exists

   !> Whether two paths lead to one file, or would once it is there.
   pure logical function same_file(a, b)
      type(file_identity_t), intent(in) :: a, b

      same_file = a%place /= '' .and. a%place == b%place .and. len(a%place) == len(b%place)
      if (same_file .or. .not. (a%exists() .and. b%exists())) return
      if (a%kind == kind_unknown .or. b%kind == kind_unknown) return
      same_file = a%device == b%device .and. a%inode == b%inode
   end function same_file

   !> 'a folder', 'a FIFO', ...
   pure function kind_in_words(kind) result(text)
      integer, intent(in) :: kind
      character(len=:), allocatable :: text

      select case (kind)
      case (kind_regular); text = 'a file'
      case (kind_folder); text = 'a folder'
      case (kind_fifo); text = 'a FIFO'
      case (kind_socket); text = 'a socket'
      case (kind_characters, kind_blocks); text = 'a device'
      case (kind_link); text = 'a symbolic link'
      case default; text = 'not known'
      end select
   end function kind_in_words

   !> Absolute path of a file that is or could be there, all links followed; '' if it cannot be there.
   recursive function place_of(path, links) result(place)
      character(len=*), intent(in) :: path
      !> Followed so far
      integer, intent(in), optional :: links
      character(len=:), allocatable :: place, target
      integer :: slash, followed

      followed = 0
      if (present(links)) followed = links
      place = real_path(path)
      slash = index(path, '/', back=.true.)
      if (place /= '' .or. slash == len(path)) return
      target = link_target(path)
      if (target /= '') then
         if (followed >= most_links) return
         if (target(1:1) /= '/') target = path(:slash)//target
         place = place_of(target, followed + 1)
         return
      end if
      place = real_path(folder_of(path))
      if (place == '') return
      if (place /= '/') place = place//'/'
      place = place//path(slash + 1:)
   end function place_of

   !> The folder of a path, '.' for the current one.
   pure function folder_of(path) result(folder)
      character(len=*), intent(in) :: path
      character(len=:), allocatable :: folder
      integer :: slash

      slash = index(path, '/', back=.true.)
      folder = '.'
      if (slash > 0) folder = path(:slash)
   end function folder_of

   !> Where a symbolic link points to, as it is written there; '' if this is none.
   function link_target(path) result(target)
      character(len=*), intent(in) :: path
      character(len=:), allocatable :: target
      character(kind=c_char) :: buffer(longest_path)
      integer :: length, k

      length = int(c_readlink(path//c_null_char, buffer, int(longest_path, c_size_t)))
      allocate (character(len=max(0, length)) :: target)
      do k = 1, length
         target(k:k) = buffer(k)
      end do
   end function link_target

   !> Absolute path of what is there, '' if there is nothing.
   function real_path(path) result(resolved)
      character(len=*), intent(in) :: path
      character(len=:), allocatable :: resolved
      character(kind=c_char), pointer :: text(:)
      type(c_ptr) :: memory
      integer :: k

      resolved = ''
      if (path == '') return
      memory = c_realpath(path//c_null_char, c_null_ptr)
      if (.not. c_associated(memory)) return
      call c_f_pointer(memory, text, [c_strlen(memory)])
      resolved = repeat(' ', size(text))
      do k = 1, size(text)
         resolved(k:k) = text(k)
      end do
      call c_free(memory)
   end function real_path

   !> Whether this process may write a file, or make files in a folder.
   logical function may_be_written(path)
      character(len=*), intent(in) :: path
      type(file_identity_t) :: identity

      identity = identity_of(path)
      if (identity%kind == kind_folder) then
         may_be_written = c_access(path//c_null_char, ior(w_ok, x_ok)) == 0
      else
         ! Whoever took all rights to write from a file meant it, even if the system lets this process do it.
         may_be_written = c_access(path//c_null_char, w_ok) == 0 .and. &
            & (iand(identity%permissions, int(o'222')) /= 0 .or. identity%kind == kind_unknown)
      end if
   end function may_be_written

end module microslip_io_file_identity
