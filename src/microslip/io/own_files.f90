!> Which files this program wrote, and may therefore replace: everything else belongs to the user and stays.
!>
!> The first bytes of a file are looked at before HDF5 is: a damaged or foreign file can make the library fall over.
module microslip_io_own_files
   use, intrinsic :: iso_c_binding, only: c_associated, c_char, c_int, c_int8_t, c_null_char, c_ptr, c_size_t
   use microslip_core_error, only: bad_input, error_t
   use microslip_core_text, only: to_text
   use microslip_io_file_identity, only: file_identity_t, folder_of, identity_of, kind_in_words, kind_none, kind_regular, &
      & kind_unknown, link_target, may_be_written
   use microslip_io_hdf5, only: hdf5_file_t
   implicit none(type, external)
   private

   public :: own_file_t, result_file, cache_file, model_file, recognise, check_replaceable, check_leftover, is_leftover
   public :: part_of, copy_of, mark

   !> A kind of file that the program writes.
   type :: own_file_t
      !> Attribute `format` of the file
      character(len=20) :: format = ''
      !> In messages
      character(len=20) :: name = ''
      !> How the user gives it another name
      character(len=80) :: renaming = ''
   end type own_file_t

   type(own_file_t), parameter :: &
      & result_file = own_file_t('microslip result', 'result file', &
      & "give the results another name (&output file = '...' or --output)"), &
      & cache_file = own_file_t('microslip reduction', 'reduction cache', &
      & "give the cache another name (&reduction cache = '...')"), &
      & model_file = own_file_t('microslip model', 'written model', &
      & 'give --write-model another name')

   !> Behind the name of the file that is worked on, and of a copy until it is complete.
   character(len=*), parameter :: unfinished = '.part', incomplete = '.new'
   !> A file's first bytes in which its attributes are; every HDF5 file begins with the signature.
   integer, parameter :: head_size = 65536
   character(len=*), parameter :: signature = char(137)//'HDF'//achar(13)//achar(10)//achar(26)//achar(10)
   !> Longest name of a file on Linux
   integer, parameter :: longest_name = 255

   interface
      function c_fopen(path, mode) bind(c, name='fopen') result(stream)
         import :: c_char, c_ptr
         implicit none(type, external)
         character(kind=c_char), intent(in) :: path(*), mode(*)
         type(c_ptr) :: stream
      end function c_fopen

      function c_fread(bytes, length, count, stream) bind(c, name='fread') result(done)
         import :: c_char, c_ptr, c_size_t
         implicit none(type, external)
         character(kind=c_char), intent(inout) :: bytes(*)
         integer(c_size_t), value :: length, count
         type(c_ptr), value :: stream
         integer(c_size_t) :: done
      end function c_fread

      function c_fclose(stream) bind(c, name='fclose') result(status)
         import :: c_int, c_ptr
         implicit none(type, external)
         type(c_ptr), value :: stream
         integer(c_int) :: status
      end function c_fclose
   end interface

contains

   !> The working file of a file.
   pure function part_of(path)
      character(len=*), intent(in) :: path
      character(len=:), allocatable :: part_of
      part_of = path//unfinished
   end function part_of

   !> The name of a copy that is not complete.
   pure function copy_of(path)
      character(len=*), intent(in) :: path
      character(len=:), allocatable :: copy_of
      copy_of = path//incomplete
   end function copy_of

   !> Mark a new file, so that it is known again whatever becomes of the run.
   subroutine mark(file, kind, version, error)
      !> Empty
      type(hdf5_file_t), intent(in) :: file
      type(own_file_t), intent(in) :: kind
      !> Version of its format
      integer, intent(in) :: version
      type(error_t), allocatable, intent(out) :: error

      call file%set_attribute('/', 'program', 'microslip', error)
      if (.not. allocated(error)) call file%set_attribute('/', 'format', trim(kind%format), error)
      if (.not. allocated(error)) call file%set_attribute('/', 'format_version', version, error)
      if (.not. allocated(error)) call file%flush(error)
   end subroutine mark

   !> Whether a file is one of a kind that this program wrote, and in which version of its format.
   subroutine recognise(path, kind, is_own, version, what)
      !> A regular file
      character(len=*), intent(in) :: path
      type(own_file_t), intent(in) :: kind
      logical, intent(out) :: is_own
      integer, intent(out) :: version
      !> What it is if not, in words
      character(len=:), allocatable, intent(out) :: what
      type(hdf5_file_t) :: file
      type(error_t), allocatable :: error, ignored
      character(len=:), allocatable :: head, program, format

      is_own = .false.
      version = 0
      head = head_of(path)
      if (head == '') then
         what = 'an empty file, or one that cannot be read'
      else if (index(head, signature) /= 1) then
         what = 'no HDF5 file'
      else if (index(head, 'microslip') == 0 .and. .not. is_early_cache(head)) then
         what = 'an HDF5 file of another program'
      end if
      if (allocated(what)) return
      if (kind%format == cache_file%format) then
         ! Never by HDF5: its checksum is not known to fit.
         is_own = index(head, trim(kind%format)) > 0 .or. is_early_cache(head)
         version = merge(2, 1, index(head, 'microslip') > 0)
         what = trim(kind%name)
         if (.not. is_own) what = 'another file of microslip'
         return
      end if
      call file%open(path, error, own=.true.)
      if (.not. allocated(error)) call file%get_attribute('/', 'program', program, error, default='')
      if (.not. allocated(error)) call file%get_attribute('/', 'format', format, error, default='')
      if (.not. allocated(error)) call file%get_attribute('/', 'format_version', version, error, default=0)
      if (.not. allocated(error)) then
         ! Version 0.1.0 did not write the format into results, nor anything of it into caches.
         if (format == '' .and. program == 'microslip' .and. version > 0) format = result_file%format
         if (format == '' .and. file%has_attribute('/', 'digest') .and. file%has('/K_bb') .and. file%has('/pattern_b')) then
            format = cache_file%format
            program = 'microslip'
         end if
      end if
      call file%close(ignored)
      if (allocated(error)) then
         what = 'a damaged HDF5 file'
      else if (program == 'microslip' .and. format == kind%format) then
         is_own = .true.
         what = trim(kind%name)
      else
         what = kind_of_format(format)
      end if
   end subroutine recognise

   !> Whether the head of a file is that of a cache of version 0.1.0, which has no mark.
   pure logical function is_early_cache(head)
      character(len=*), intent(in) :: head
      is_early_cache = index(head, 'K_ii') > 0 .and. index(head, 'K_bi') > 0 .and. index(head, 'pattern_b') > 0
   end function is_early_cache

   !> A format in words.
   pure function kind_of_format(format) result(text)
      character(len=*), intent(in) :: format
      character(len=:), allocatable :: text

      if (format == result_file%format) then
         text = 'a result file of microslip'
      else if (format == cache_file%format) then
         text = 'a reduction cache of microslip'
      else if (format == model_file%format) then
         text = 'a finite-element model'
      else
         text = 'an HDF5 file of another program'
      end if
   end function kind_of_format

   !> First bytes of a file; '' if it cannot be read.
   function head_of(path) result(head)
      character(len=*), intent(in) :: path
      character(len=:), allocatable :: head
      character(kind=c_char), allocatable :: bytes(:)
      type(c_ptr) :: stream
      integer(c_int) :: ignored
      integer :: length, k

      head = ''
      stream = c_fopen(path//c_null_char, 'rb'//c_null_char)
      if (.not. c_associated(stream)) return
      allocate (bytes(head_size))
      length = int(c_fread(bytes, 1_c_size_t, int(head_size, c_size_t), stream))
      ignored = c_fclose(stream)
      deallocate (head)
      allocate (character(len=length) :: head)
      do k = 1, length
         head(k:k) = bytes(k)
      end do
   end function head_of

   !> Whether a file may get this name: there is none and one could be made there, or one that this program wrote.
   subroutine check_replaceable(path, kind, error)
      character(len=*), intent(in) :: path
      !> What it is going to be
      type(own_file_t), intent(in) :: kind
      type(error_t), allocatable, intent(out) :: error
      type(file_identity_t) :: there
      character(len=:), allocatable :: what
      integer :: version
      logical :: is_own

      there = identity_of(path)
      call check_place(path, there, error)
      if (allocated(error) .or. .not. there%exists()) return
      if (there%kind /= kind_regular .and. there%kind /= kind_unknown) then
         call bad_input(error, path//': is '//kind_in_words(there%kind)//', which cannot be replaced by a '//trim(kind%name))
      else if (.not. may_be_written(path)) then
         call bad_input(error, path//': cannot be replaced, it is write-protected')
      else
         call recognise(path, kind, is_own, version, what)
         if (.not. is_own) call bad_input(error, path//': is there already, and is no '//trim(kind%name)// &
            & ' of this program ('//what//'): it is not overwritten; move it away, or '//trim(kind%renaming))
      end if
   end subroutine check_replaceable

   !> Whether a file of this name, and its working file, could be made.
   subroutine check_place(path, there, error)
      character(len=*), intent(in) :: path
      !> What the path leads to
      type(file_identity_t), intent(in) :: there
      type(error_t), allocatable, intent(out) :: error
      type(file_identity_t) :: folder
      character(len=:), allocatable :: place, name

      if (path == '' .or. path == '-') then
         call bad_input(error, "'"//path//"' (standard output?) cannot be written: a file name is allowed, for instance ./-")
         return
      else if (index(path, '/', back=.true.) == len(path)) then
         call bad_input(error, path//': ends in a slash, so it names a folder: a file name is allowed')
         return
      end if
      ! Through links the folder is another one.
      place = path
      if (there%place /= '') place = there%place
      folder = identity_of(folder_of(place))
      name = place(index(place, '/', back=.true.) + 1:)
      if (there%place == '' .and. link_target(path) /= '') then
         call bad_input(error, path//': cannot be written: this is a symbolic link to '//link_target(path)// &
            & ', where no file can be made (a folder is missing, or links run in a circle)')
      else if (folder%kind == kind_none .or. there%place == '') then
         call bad_input(error, path//': cannot be written: there is no folder '//folder_of(place)// &
            & ' (or the path is too long)')
      else if (.not. may_be_written(folder_of(place))) then
         call bad_input(error, path//': cannot be written: the folder '//folder_of(place)//' is write-protected')
      else if (len(part_of(name)) > longest_name) then
         call bad_input(error, path//': cannot be written: allowed is a name of at most '// &
            & to_text(longest_name - len(unfinished))//' letters')
      end if
   end subroutine check_place

   !> A file that has the name of a working file must be the remains of a run that was ended: then it may be replaced.
   subroutine check_leftover(path, kind, error)
      !> Of the working file
      character(len=*), intent(in) :: path
      !> What is worked on
      type(own_file_t), intent(in) :: kind
      type(error_t), allocatable, intent(out) :: error

      if (is_leftover(path, kind)) return
      call bad_input(error, path//': is there already, but the program needs this name for its working file, and this is not ' &
         & //'what a run of it leaves behind: it is left alone; move it away, or '//trim(kind%renaming))
   end subroutine check_leftover

   !> Whether there is nothing, or what a run that was ended has left: an empty file, or one that begins like those of its kind.
   logical function is_leftover(path, kind)
      character(len=*), intent(in) :: path
      type(own_file_t), intent(in) :: kind
      type(file_identity_t) :: there
      character(len=:), allocatable :: head

      is_leftover = .false.
      if (link_target(path) /= '') return
      there = identity_of(path)
      is_leftover = .not. there%exists()
      if (is_leftover) return
      is_leftover = there%kind == kind_regular .and. there%names == 1
      if (.not. is_leftover .or. there%bytes == 0) return
      head = head_of(path)
      is_leftover = index(head, signature) == 1 .and. index(head, trim(kind%format)) > 0
      ! What version 0.1.0 left has no format.
      if (kind%format == result_file%format .and. .not. is_leftover) is_leftover = index(head, signature) == 1 .and. &
         & index(head, 'microslip') > 0 .and. index(head, 'format_version') > 0 .and. index(head, 'checkpoint') > 0
   end function is_leftover

end module microslip_io_own_files
