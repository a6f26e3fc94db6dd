!> The reduced model kept in an HDF5 file, under a digest of everything it depends on: FE matrices, interfaces,
!> force patterns, options. A cache of another digest is ignored and written anew.
!>
!> Behind the end of the HDF5 file stands a checksum of all its bytes, so that no damaged file is ever handed to HDF5. A cache
!> that cannot be used, read or written is told in a warning: the reduction is computed then. It is replaced as a whole,
!> and runs that begin together do not wait for one another: one of them writes it.
module microslip_io_reduction_cache
   use, intrinsic :: iso_c_binding, only: c_associated, c_char, c_int, c_int32_t, c_null_char, c_ptr, c_size_t
   use microslip_core_digest, only: digest_t
   use microslip_core_error, only: error_t, failure
   use microslip_core_kinds, only: i8, wp
   use microslip_core_text, only: to_text
   use microslip_core_warning_list, only: severity_note, warning_list_t
   use microslip_fe_interface, only: contact_interface_t
   use microslip_fe_model, only: fe_model_t
   use microslip_fe_reduced_model, only: reduced_model_t
   use microslip_fe_reduction, only: reduction_options_t
   use microslip_io_file_identity, only: file_identity_t, identity_of, kind_regular, kind_unknown, link_target, place_of
   use microslip_io_hdf5, only: hdf5_file_t
   use microslip_io_own_files, only: cache_file, check_replaceable, copy_of, mark, recognise
   use microslip_io_working_file, only: working_file_t
   implicit none(type, external)
   private

   public :: reduction_digest, read_cache, write_cache, check_cache

   !> Grows with every change of the reduction that changes its numbers, or of the layout.
   integer, parameter :: cache_version = 3

   !> What stands behind the HDF5 file: these words and the checksum.
   character(len=*), parameter :: trailer = 'microslip checksum '
   integer, parameter :: checksum_length = 16, trailer_length = len(trailer) + checksum_length
   !> Bytes, and words of 4 bytes, that are read together.
   integer, parameter :: block_words = 2**18, block_bytes = 4*block_words

   !> One number, vector or matrix of the reduced model: written, or read.
   interface pass
      procedure :: pass_vector, pass_matrix
   end interface pass

   interface
      function c_fopen(path, mode) bind(c, name='fopen') result(stream)
         import :: c_char, c_ptr
         implicit none(type, external)
         character(kind=c_char), intent(in) :: path(*), mode(*)
         type(c_ptr) :: stream
      end function c_fopen

      function c_fread(words, length, count, stream) bind(c, name='fread') result(done)
         import :: c_int32_t, c_ptr, c_size_t
         implicit none(type, external)
         integer(c_int32_t), intent(inout) :: words(*)
         integer(c_size_t), value :: length, count
         type(c_ptr), value :: stream
         integer(c_size_t) :: done
      end function c_fread

      function c_fwrite(text, length, count, stream) bind(c, name='fwrite') result(done)
         import :: c_char, c_ptr, c_size_t
         implicit none(type, external)
         character(kind=c_char), intent(in) :: text(*)
         integer(c_size_t), value :: length, count
         type(c_ptr), value :: stream
         integer(c_size_t) :: done
      end function c_fwrite

      function c_fclose(stream) bind(c, name='fclose') result(status)
         import :: c_int, c_ptr
         implicit none(type, external)
         type(c_ptr), value :: stream
         integer(c_int) :: status
      end function c_fclose
   end interface

contains

   !> Digest of what a reduction depends on.
   function reduction_digest(model, interfaces, patterns, options) result(text)
      type(fe_model_t), intent(in) :: model
      type(contact_interface_t), intent(in) :: interfaces(:)
      !> (rows, patterns)
      real(wp), intent(in) :: patterns(:, :)
      type(reduction_options_t), intent(in) :: options
      character(len=16) :: text
      type(digest_t) :: digest
      integer :: k

      call digest%add('reduction '//to_text(cache_version)//' '//options%method//' '//to_text(options%modes) &
         & //' '//merge('kept   ', 'dropped', options%residual_mass))
      call digest%add([options%cutoff_frequency])
      call digest%add(model%row_node)
      call digest%add(model%row_component)
      call digest%add(model%stiffness%row_start)
      call digest%add(model%stiffness%column)
      call digest%add(model%stiffness%value)
      call digest%add(model%mass%row_start)
      call digest%add(model%mass%column)
      call digest%add(model%mass%value)
      do k = 1, size(interfaces)
         call digest%add(interfaces(k)%node_a)
         call digest%add(interfaces(k)%node_b)
         call digest%add(reshape(interfaces(k)%frame, [9]))
      end do
      do k = 1, size(patterns, 2)
         call digest%add(patterns(:, k))
      end do
      text = digest%hexadecimal()
   end function reduction_digest

   !> Take the reduced model from the cache if it is there, sound and fits; `found` tells.
   subroutine read_cache(path, digest, reduced, found, warnings)
      character(len=*), intent(in) :: path
      character(len=*), intent(in) :: digest
      type(reduced_model_t), intent(out) :: reduced
      logical, intent(out) :: found
      !> What is wrong with a cache that is there is added
      type(warning_list_t), intent(inout) :: warnings
      type(hdf5_file_t) :: file
      type(error_t), allocatable :: error, ignored
      character(len=:), allocatable :: stored

      found = .false.
      call check_cache(path, warnings, found)
      if (.not. found) return
      call file%open(path, error, own=.true.)
      if (.not. allocated(error)) call file%get_attribute('/', 'digest', stored, error, default='')
      if (.not. allocated(error)) then
         found = stored == digest
         if (found) call pass_reduced(file, .false., reduced, error)
      end if
      call file%close(ignored)
      if (.not. allocated(error)) return
      found = .false.
      call warnings%add(severity_note, 'reduction cache not used: '//error%message)
   end subroutine read_cache

   !> Whether there is a sound cache of this version of the program. What is there and is none is warned of.
   subroutine check_cache(path, warnings, sound)
      character(len=*), intent(in) :: path
      type(warning_list_t), intent(inout) :: warnings
      logical, intent(out) :: sound
      type(file_identity_t) :: there
      character(len=:), allocatable :: what
      integer :: version
      logical :: is_own

      sound = .false.
      there = identity_of(path)
      if (there%kind /= kind_regular .and. there%kind /= kind_unknown) return
      call recognise(path, cache_file, is_own, version, what)
      if (.not. is_own) then
         call warnings%add(severity_note, path//': is no reduction cache of this program ('//what//'), it is not used and ' &
            & //'not overwritten: remove it, or give the cache another name (&reduction cache)')
         return
      end if
      sound = is_sound(path, there%bytes)
      if (sound) return
      what = 'is damaged or was changed (its checksum does not fit)'
      if (version == 1) what = 'is of an earlier version of the program, or was changed (it has no checksum)'
      call warnings%add(severity_note, path//': this reduction cache '//what//': it is not used, the reduction is computed anew')
   end subroutine check_cache

   !> Whether the checksum at the end of a file is that of the bytes before it.
   logical function is_sound(path, bytes)
      character(len=*), intent(in) :: path
      !> Length of the file
      integer(i8), intent(in) :: bytes
      character(len=trailer_length) :: found

      is_sound = bytes > trailer_length
      if (.not. is_sound) return
      is_sound = trailer//checksum(path, bytes - trailer_length, found) == found
   end function is_sound

   !> Checksum of the first bytes of a file; what stands behind them.
   function checksum(path, bytes, behind) result(text)
      character(len=*), intent(in) :: path
      integer(i8), intent(in) :: bytes
      character(len=trailer_length), intent(out) :: behind
      character(len=checksum_length) :: text
      type(digest_t) :: digest
      type(c_ptr) :: stream
      integer(c_int32_t), allocatable :: words(:)
      integer(i8) :: left
      integer(c_int) :: ignored
      integer :: length

      text = ''
      behind = ''
      stream = c_fopen(path//c_null_char, 'rb'//c_null_char)
      if (.not. c_associated(stream)) return
      allocate (words(block_words))
      left = bytes
      do while (left > 0)
         length = int(min(left, int(block_bytes, i8)))
         words((length + 3)/4) = 0
         if (c_fread(words, 1_c_size_t, int(length, c_size_t), stream) /= length) exit
         call digest%add(words(:(length + 3)/4))
         left = left - length
      end do
      length = int(c_fread(words, 1_c_size_t, int(trailer_length, c_size_t), stream))
      ignored = c_fclose(stream)
      if (left == 0 .and. length == trailer_length) behind = transfer(words(:(trailer_length + 3)/4), behind)
      if (left == 0) text = digest%hexadecimal()
   end function checksum

   !> Keep a reduced model. That this cannot be done is a warning, that another run does it is not.
   subroutine write_cache(path, digest, reduced, warnings)
      character(len=*), intent(in) :: path
      character(len=*), intent(in) :: digest
      type(reduced_model_t), intent(inout) :: reduced
      type(warning_list_t), intent(inout) :: warnings
      type(working_file_t) :: new
      type(hdf5_file_t) :: file
      type(error_t), allocatable :: error, close_error
      type(file_identity_t) :: there
      character(len=:), allocatable :: place, what
      integer :: version
      logical :: in_use, is_own

      there = identity_of(path)
      if (there%kind == kind_regular) then
         call recognise(path, cache_file, is_own, version, what)
         ! It stays, and was warned of when it was to be read.
         if (.not. is_own) return
      end if
      call check_replaceable(path, cache_file, error)
      place = path
      if (link_target(path) /= '') place = place_of(path)
      in_use = .false.
      if (.not. allocated(error)) call new%take(copy_of(place), cache_file, error, in_use)
      if (in_use) return
      if (.not. allocated(error)) then
         file%compression = 0
         call file%create(new%path, error)
         if (.not. allocated(error)) call mark(file, cache_file, cache_version, error)
         if (.not. allocated(error)) call file%set_attribute('/', 'digest', digest, error)
         if (.not. allocated(error)) call pass_reduced(file, .true., reduced, error)
         call file%close(close_error)
         if (.not. allocated(error)) call move_alloc(close_error, error)
         if (.not. allocated(error)) call append_checksum(new%path, error)
         if (.not. allocated(error)) call new%publish_as(place, error)
         if (allocated(error)) call new%give_up()
      end if
      if (allocated(error)) call warnings%add(severity_note, 'reduction cache not written: '//error%message)
   end subroutine write_cache

   !> Complete a file by its checksum.
   subroutine append_checksum(path, error)
      character(len=*), intent(in) :: path
      type(error_t), allocatable, intent(out) :: error
      type(file_identity_t) :: there
      character(len=trailer_length) :: text
      type(c_ptr) :: stream
      logical :: good

      there = identity_of(path)
      text = trailer//checksum(path, there%bytes, text)
      stream = c_fopen(path//c_null_char, 'ab'//c_null_char)
      good = c_associated(stream)
      if (good) good = c_fwrite(text, 1_c_size_t, int(trailer_length, c_size_t), stream) == trailer_length
      if (c_associated(stream)) good = c_fclose(stream) == 0 .and. good
      if (.not. good) call failure(error, path//': cannot be written (disk full?)')
   end subroutine append_checksum

   !> Write a reduced model, or read it: one list for both.
   subroutine pass_reduced(file, writing, reduced, error)
      type(hdf5_file_t), intent(in) :: file
      logical, intent(in) :: writing
      type(reduced_model_t), intent(inout) :: reduced
      type(error_t), allocatable, intent(out) :: error

      if (writing) then
         call file%set_attribute('/', 'method', reduced%method, error)
      else
         call file%get_attribute('/', 'method', reduced%method, error)
      end if
      call pass(file, writing, '/frequency', reduced%frequency, 'Hz', 'frequencies of the component modes', error)
      call pass(file, writing, '/K_ii', reduced%K_ii, '1/s^2', 'modal stiffness', error)
      call pass(file, writing, '/K_bi', reduced%K_bi, 'N/(m sqrt(kg))', 'coupling stiffness', error)
      call pass(file, writing, '/K_bb', reduced%K_bb, 'N/m', 'boundary stiffness', error)
      call pass(file, writing, '/pattern_i', reduced%pattern_i, 'N/sqrt(kg)', 'force patterns and sensor rows on the modes', error)
      call pass(file, writing, '/pattern_b', reduced%pattern_b, 'N', 'force patterns and sensor rows on the boundary', error)
      if (allocated(error)) return
      if (writing) then
         call write_masses(file, reduced, error)
      else
         call read_masses(file, reduced, error)
      end if
   end subroutine pass_reduced

   !> Soft motions and bodies.
   subroutine read_masses(file, reduced, error)
      type(hdf5_file_t), intent(in) :: file
      type(reduced_model_t), intent(inout) :: reduced
      type(error_t), allocatable, intent(out) :: error
      real(wp), allocatable :: table(:, :)
      integer :: k

      call file%read('/tied_modes', reduced%tied_modes, error)
      if (allocated(error)) return
      if (reduced%method == 'craig_bampton_massless') then
         allocate (reduced%soft_frequency(0), reduced%soft_share(0))
         if (file%has('/soft_motions')) then
            call file%read('/soft_motions', table, error)
            if (allocated(error)) return
            reduced%soft_frequency = table(1, :)
            reduced%soft_share = table(2, :)
         end if
      end if
      if (.not. file%has('/bodies')) then
         allocate (reduced%bodies(0))
         return
      end if
      call file%read('/bodies', table, error)
      if (allocated(error)) return
      allocate (reduced%bodies(size(table, 2)))
      do k = 1, size(table, 2)
         reduced%bodies(k)%nodes = nint(table(1, k))
         reduced%bodies(k)%first_label = nint(table(2, k))
         reduced%bodies(k)%inertia = table(3:8, k)
         reduced%bodies(k)%kept = table(9:14, k)
         reduced%bodies(k)%frequency = table(15:20, k)
      end do
   end subroutine read_masses

   !> Soft motions and bodies.
   subroutine write_masses(file, reduced, error)
      type(hdf5_file_t), intent(in) :: file
      type(reduced_model_t), intent(in) :: reduced
      type(error_t), allocatable, intent(out) :: error
      real(wp), allocatable :: table(:, :)
      integer :: k

      call file%write('/tied_modes', reduced%tied_modes, '1', 'how many of the modes are tied modes', error)
      if (allocated(error)) return
      if (allocated(reduced%soft_frequency)) then
         table = transpose(reshape([reduced%soft_frequency, reduced%soft_share], [size(reduced%soft_frequency), 2]))
         if (size(table) > 0) call file%write('/soft_motions', table, '1', &
            & '[motion]: frequency with the residual mass, Hz; its share of the mass', error)
         if (allocated(error)) return
         deallocate (table)
      end if
      if (.not. allocated(reduced%bodies)) return
      allocate (table(20, size(reduced%bodies)))
      do k = 1, size(reduced%bodies)
         associate (body => reduced%bodies(k))
            table(:2, k) = [real(body%nodes, wp), real(body%first_label, wp)]
            table(3:8, k) = body%inertia
            table(9:14, k) = body%kept
            table(15:20, k) = body%frequency
         end associate
      end do
      if (size(table) > 0) call file%write('/bodies', table, '1', '[body]: nodes, smallest number, mass '// &
         & 'and inertia (6), parts of it that are kept (6), frequencies as it moves as a whole in Hz (6)', error)
   end subroutine write_masses

   subroutine pass_vector(file, writing, path, values, units, description, error)
      type(hdf5_file_t), intent(in) :: file
      logical, intent(in) :: writing
      character(len=*), intent(in) :: path, units, description
      real(wp), allocatable, intent(inout) :: values(:)
      type(error_t), allocatable, intent(inout) :: error

      if (allocated(error)) return
      if (writing) then
         call file%write(path, values, units, description, error)
      else
         call file%read(path, values, error)
      end if
   end subroutine pass_vector

   subroutine pass_matrix(file, writing, path, values, units, description, error)
      type(hdf5_file_t), intent(in) :: file
      logical, intent(in) :: writing
      character(len=*), intent(in) :: path, units, description
      real(wp), allocatable, intent(inout) :: values(:, :)
      type(error_t), allocatable, intent(inout) :: error

      if (allocated(error)) return
      if (writing) then
         call file%write(path, values, units, description, error)
      else
         call file%read(path, values, error)
      end if
   end subroutine pass_matrix

end module microslip_io_reduction_cache
