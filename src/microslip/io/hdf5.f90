!> HDF5 files: the only module that uses the HDF5 library.
!>
!> A dataset is named by its path, '/transient/energy/kinetic'; groups on the way are made on demand. Every dataset of
!> numbers carries the attributes `units` and `description`. Strings are variable-length UTF-8. A Fortran array of shape
!> (a, b) appears as (b, a) in C, Python and MATLAB, so a series that grows along its last Fortran dimension has time as
!> its first axis there.
!>
!> A wrong file or a missing dataset is `bad_input`, a write that does not succeed is `failure`. HDF5's own messages are
!> switched off. Not thread-safe: call from one thread only.
module microslip_io_hdf5
   use, intrinsic :: iso_c_binding, only: c_char, c_f_pointer, c_int, c_loc, c_null_char, c_null_ptr, c_associated, c_ptr
   use h5ds, only: h5dsattach_scale_f, h5dsis_attached_f, h5dsis_scale_f, h5dsset_scale_f
   use hdf5, only: h5aclose_f, h5acreate_by_name_f, h5adelete_by_name_f, h5aexists_by_name_f, h5aget_name_f, &
      h5aget_num_attrs_f, h5aget_space_f, h5aget_type_f, h5aopen_by_idx_f, h5aopen_by_name_f, h5aread_f, &
      h5awrite_f, h5dclose_f, h5dcreate_f, h5dget_space_f, &
      h5dget_type_f, h5dont_atexit_f, h5dopen_f, h5dread_f, h5dset_extent_f, &
      h5dvlen_reclaim_f, h5dwrite_f, h5eset_auto_f, h5fclose_f, &
      h5fcreate_f, h5fflush_f, h5fis_hdf5_f, h5fopen_f, h5gclose_f, h5gcreate_f, h5gget_obj_info_idx_f, &
      h5gn_members_f, h5ldelete_f, h5lexists_f, h5oclose_f, h5oopen_f, &
      h5open_f, h5pclose_f, h5pcreate_f, h5pset_chunk_f, &
      h5pset_create_inter_group_f, h5pset_deflate_f, h5pset_fclose_degree_f, h5pset_shuffle_f, h5sclose_f, &
      h5screate_f, h5screate_simple_f, h5sget_simple_extent_dims_f, h5sget_simple_extent_ndims_f, &
      h5sget_simple_extent_npoints_f, h5sselect_hyperslab_f, h5tclose_f, h5tcopy_f, h5tequal_f, h5tget_class_f, &
      h5tget_size_f, h5tis_variable_str_f, h5tset_cset_f, hid_t, hsize_t, size_t, h5f_acc_rdonly_f, h5f_acc_rdwr_f, &
      h5f_acc_trunc_f, h5f_close_strong_f, h5f_scope_global_f, h5_index_name_f, h5_iter_inc_f, &
      h5p_dataset_create_f, h5p_default_f, &
      h5p_file_access_f, h5p_link_create_f, h5s_scalar_f, h5s_select_set_f, h5s_unlimited_f, h5t_cset_utf8_f, &
      h5t_float_f, h5t_integer_f, h5t_native_double, h5t_native_integer, h5t_string, h5t_string_f
   use microslip_core_error, only: bad_input, error_t, failure
   use microslip_core_kinds, only: wp
   use microslip_core_text, only: to_text
   use microslip_io_file_identity, only: file_identity_t, identity_of, kind_in_words, kind_regular, kind_unknown
   use microslip_io_file_lock, only: is_locked
   use microslip_io_input_files, only: note_input
   implicit none(type, external)
   private

   public :: hdf5_file_t, series_t, is_hdf5_file

   !> Smallest number of elements that is worth chunks and compression, and the size of a chunk.
   integer, parameter :: chunk_threshold = 512, chunk_elements = 32768
   !> Most steps in one chunk of a series.
   integer, parameter :: chunk_steps = 1024
   !> Longest name of a group's member.
   integer, parameter :: name_length = 255

   logical, save :: library_is_open = .false.

   interface
      function c_setenv(name, value, overwrite) bind(c, name='setenv') result(status)
         import :: c_char, c_int
         implicit none(type, external)
         character(kind=c_char), intent(in) :: name(*), value(*)
         integer(c_int), value :: overwrite
         integer(c_int) :: status
      end function c_setenv
   end interface

   !> An open HDF5 file.
   type :: hdf5_file_t
      !> Where the file is
      character(len=:), allocatable :: path
      !> gzip level of large arrays, 0 to 9; 0 stores them as they are
      integer :: compression = 4
      integer(hid_t), private :: id = -1
   contains
      procedure :: create
      procedure :: open => open_file
      procedure :: close => close_file
      procedure :: flush => flush_file
      procedure :: is_open
      procedure :: has
      procedure :: members
      procedure :: delete
      procedure :: require_group
      procedure :: shape_of
      procedure :: make_scale
      procedure :: attach_scale
      procedure :: is_attached
      procedure :: holds_integers
      procedure :: has_attribute
      procedure :: attributes
      generic :: write => write_real_0, write_real_1, write_real_2, write_real_3, write_integer_0, write_integer_1, &
         write_integer_2, write_integer_3, write_string, write_strings
      generic :: read => read_real_0, read_real_1, read_real_2, read_real_3, read_integer_0, read_integer_1, &
         read_integer_2, read_integer_3, read_string, read_strings
      generic :: set_attribute => set_attribute_real, set_attribute_integer, set_attribute_string
      generic :: get_attribute => get_attribute_real, get_attribute_integer, get_attribute_string
      procedure, private :: write_real_0, write_real_1, write_real_2, write_real_3
      procedure, private :: write_integer_0, write_integer_1, write_integer_2, write_integer_3
      procedure, private :: write_string, write_strings
      procedure, private :: read_real_0, read_real_1, read_real_2, read_real_3
      procedure, private :: read_integer_0, read_integer_1, read_integer_2, read_integer_3
      procedure, private :: read_string, read_strings
      procedure, private :: set_attribute_real, set_attribute_integer, set_attribute_string
      procedure, private :: get_attribute_real, get_attribute_integer, get_attribute_string
   end type hdf5_file_t

   !> A dataset that grows along its last Fortran dimension, one step after the other. Its handle stays open: close
   !> it before the file.
   type :: series_t
      private
      character(len=:), allocatable :: label
      integer(hid_t) :: id = -1
      integer(hsize_t), allocatable :: leading(:)
      integer(hsize_t) :: steps = 0
      logical :: holds_integers = .false.
   contains
      procedure :: create => create_series
      procedure :: open => open_series
      procedure :: step_count
      procedure :: close => close_series
      procedure :: read_steps
      generic :: append => append_real_1, append_real_2, append_real_3, append_integer_1, append_integer_2
      procedure, private :: append_real_1, append_real_2, append_real_3, append_integer_1, append_integer_2
   end type series_t

contains

   !> Open the library once and silence its error printing.
   subroutine start_library()
      integer :: status

      if (library_is_open) return
      ! The locks are the program's own (`microslip_io_file_lock`): HDF5's would be in their way, and can be switched off.
      status = c_setenv('HDF5_USE_FILE_LOCKING'//c_null_char, 'FALSE'//c_null_char, 1_c_int)
      ! All files are closed by hand; at its end the library would write again what could not be written, and crash.
      call h5dont_atexit_f(status)
      call h5open_f(status)
      call h5eset_auto_f(0, status)
      library_is_open = .true.
   end subroutine start_library

   !> Whether there is a regular file at this path that starts like an HDF5 file.
   logical function is_hdf5_file(path)
      !> Where the file is
      character(len=*), intent(in) :: path
      type(file_identity_t) :: there
      integer :: status

      is_hdf5_file = .false.
      there = identity_of(path)
      if (there%kind /= kind_regular .and. there%kind /= kind_unknown) return
      call start_library()
      call h5fis_hdf5_f(path, is_hdf5_file, status)
      if (status < 0) is_hdf5_file = .false.
   end function is_hdf5_file

   ! ---------------------------------------------------------------------------------------------- files

   !> Make a new file; one that is there is emptied.
   subroutine create(self, path, error, compression)
      class(hdf5_file_t), intent(inout) :: self
      !> Where to
      character(len=*), intent(in) :: path
      type(error_t), allocatable, intent(out) :: error
      !> gzip level of large arrays, 0 (none) to 9
      integer, intent(in), optional :: compression
      integer(hid_t) :: access
      integer :: status

      call start_library()
      self%path = path
      if (present(compression)) self%compression = max(0, min(9, compression))
      access = strong_close()
      call h5fcreate_f(path, h5f_acc_trunc_f, self%id, status, access_prp=access)
      if (status < 0) then
         self%id = -1
         call bad_input(error, path//': cannot write this file (does its folder exist, may it be written, is it in use?)')
      end if
      call h5pclose_f(access, status)
   end subroutine create

   !> Open a file for reading or, with `writable`, for reading and writing.
   subroutine open_file(self, path, error, writable, own)
      class(hdf5_file_t), intent(inout) :: self
      !> Where it is
      character(len=*), intent(in) :: path
      type(error_t), allocatable, intent(out) :: error
      !> Whether to write too (no by default)
      logical, intent(in), optional :: writable
      !> Whether it is a file of this program, which may be replaced, and no input (no by default)
      logical, intent(in), optional :: own
      type(file_identity_t) :: there
      integer(hid_t) :: access
      integer :: status, mode
      logical :: is_own

      self%path = path
      is_own = .false.
      if (present(own)) is_own = own
      if (.not. is_own) call note_input(path)
      there = identity_of(path)
      if (.not. there%exists()) then
         call bad_input(error, path//': no such file')
         return
      end if
      if (there%kind /= kind_regular .and. there%kind /= kind_unknown) then
         call bad_input(error, path//': is '//kind_in_words(there%kind)//': an HDF5 file is allowed')
         return
      end if
      ! Its own working file this program has locked itself.
      if (.not. is_own) then
         if (is_locked(path)) then
            call bad_input(error, path//': is being written by another program')
            return
         end if
      end if
      if (.not. is_hdf5_file(path)) then
         call bad_input(error, path//': not an HDF5 file, or not readable')
         return
      end if
      mode = h5f_acc_rdonly_f
      if (present(writable)) mode = merge(h5f_acc_rdwr_f, h5f_acc_rdonly_f, writable)
      access = strong_close()
      call h5fopen_f(path, mode, self%id, status, access_prp=access)
      if (status < 0) then
         self%id = -1
         call bad_input(error, path//': HDF5 cannot open this file (cut off, damaged, or in use by another program)')
      end if
      call h5pclose_f(access, status)
   end subroutine open_file

   !> Access properties: closing the file closes what is still open in it.
   function strong_close() result(access)
      integer(hid_t) :: access
      integer :: status

      call h5pcreate_f(h5p_file_access_f, access, status)
      call h5pset_fclose_degree_f(access, h5f_close_strong_f, status)
   end function strong_close

   !> Write what is pending and close; harmless if the file is not open.
   subroutine close_file(self, error)
      class(hdf5_file_t), intent(inout) :: self
      type(error_t), allocatable, intent(out) :: error
      integer :: flushed, closed

      if (self%id < 0) return
      call h5fflush_f(self%id, h5f_scope_global_f, flushed)
      call h5fclose_f(self%id, closed)
      self%id = -1
      if (flushed < 0 .or. closed < 0) call failure(error, self%path//': cannot finish writing (disk full?)')
   end subroutine close_file

   !> Hand everything written so far to the operating system.
   subroutine flush_file(self, error)
      class(hdf5_file_t), intent(in) :: self
      type(error_t), allocatable, intent(out) :: error
      integer :: status

      call h5fflush_f(self%id, h5f_scope_global_f, status)
      if (status < 0) call failure(error, self%path//': cannot write (disk full?)')
   end subroutine flush_file

   !> Whether the file is open.
   pure logical function is_open(self)
      class(hdf5_file_t), intent(in) :: self
      is_open = self%id >= 0
   end function is_open

   ! ----------------------------------------------------------------------------- objects and their names

   !> Whether there is a group or dataset at this path.
   logical function has(self, path)
      class(hdf5_file_t), intent(in) :: self
      !> Group or dataset
      character(len=*), intent(in) :: path
      integer :: k, status

      has = self%id >= 0
      do k = 2, len_trim(path)
         if (.not. has) return
         if (path(k:k) == '/') call h5lexists_f(self%id, path(:k - 1), has, status)
      end do
      if (has .and. path /= '/') then
         call h5lexists_f(self%id, trim(path), has, status)
         has = has .and. status >= 0
      end if
   end function has

   !> Names of the groups and datasets in a group, in alphabetical order.
   subroutine members(self, group, names, error)
      class(hdf5_file_t), intent(in) :: self
      !> Path of the group
      character(len=*), intent(in) :: group
      !> (members)
      character(len=name_length), allocatable, intent(out) :: names(:)
      type(error_t), allocatable, intent(out) :: error
      integer :: count, k, status, kind

      status = -1
      if (self%has(group)) call h5gn_members_f(self%id, group, count, status)
      if (status < 0) then
         call bad_input(error, about(self, group)//'there is no such group')
         return
      end if
      allocate (names(count))
      do k = 1, count
         call h5gget_obj_info_idx_f(self%id, group, k - 1, names(k), kind, status)
      end do
   end subroutine members

   !> Remove a group or dataset; harmless if there is none. Its space in the file is reused only until it is closed.
   subroutine delete(self, path, error)
      class(hdf5_file_t), intent(in) :: self
      !> Group or dataset
      character(len=*), intent(in) :: path
      type(error_t), allocatable, intent(out) :: error
      integer :: status

      if (.not. self%has(path)) return
      call h5ldelete_f(self%id, path, status)
      if (status < 0) call failure(error, about(self, path)//'cannot be removed')
   end subroutine delete

   !> Make a group (and those above it) if it is not there.
   subroutine require_group(self, path, error)
      class(hdf5_file_t), intent(in) :: self
      !> Path of the group
      character(len=*), intent(in) :: path
      type(error_t), allocatable, intent(out) :: error
      integer(hid_t) :: group, link
      integer :: status

      if (self%has(path)) return
      link = with_parents()
      call h5gcreate_f(self%id, path, group, status, lcpl_id=link)
      if (status < 0) then
         call failure(error, about(self, path)//'cannot make this group')
      else
         call h5gclose_f(group, status)
      end if
      call h5pclose_f(link, status)
   end subroutine require_group

   !> Link properties: make the groups on the way.
   function with_parents() result(link)
      integer(hid_t) :: link
      integer :: status

      call h5pcreate_f(h5p_link_create_f, link, status)
      call h5pset_create_inter_group_f(link, 1, status)
   end function with_parents

   !> Start of a message about an object.
   pure function about(self, path) result(text)
      class(hdf5_file_t), intent(in) :: self
      character(len=*), intent(in) :: path
      character(len=:), allocatable :: text
      text = self%path//": '"//path//"': "
   end function about

   !> Open a dataset.
   subroutine open_dataset(self, path, id, error)
      class(hdf5_file_t), intent(in) :: self
      character(len=*), intent(in) :: path
      integer(hid_t), intent(out) :: id
      type(error_t), allocatable, intent(out) :: error
      integer :: status

      id = -1
      if (.not. self%has(path)) then
         call bad_input(error, about(self, path)//'there is no such dataset')
         return
      end if
      call h5dopen_f(self%id, path, id, status)
      if (status < 0) call bad_input(error, about(self, path)//'is not a dataset, or damaged')
   end subroutine open_dataset

   !> Shape of a dataset in Fortran order (last dimension first for h5py); no elements for a scalar.
   subroutine shape_of(self, path, shape, error)
      class(hdf5_file_t), intent(in) :: self
      !> Dataset
      character(len=*), intent(in) :: path
      !> (rank)
      integer, allocatable, intent(out) :: shape(:)
      type(error_t), allocatable, intent(out) :: error
      integer(hsize_t), allocatable :: dims(:)
      integer(hid_t) :: id
      integer :: status

      call open_dataset(self, path, id, error)
      if (allocated(error)) return
      dims = dataset_shape(id)
      call h5dclose_f(id, status)
      if (any(dims > huge(1))) then
         call bad_input(error, about(self, path)//'is too large')
         return
      end if
      shape = int(dims)
   end subroutine shape_of

   !> Current shape of an open dataset.
   function dataset_shape(id) result(dims)
      integer(hid_t), intent(in) :: id
      integer(hsize_t), allocatable :: dims(:)
      integer(hsize_t), allocatable :: largest(:)
      integer(hid_t) :: space
      integer :: rank, status

      call h5dget_space_f(id, space, status)
      call h5sget_simple_extent_ndims_f(space, rank, status)
      allocate (dims(rank), largest(rank))
      if (rank > 0) call h5sget_simple_extent_dims_f(space, dims, largest, status)
      call h5sclose_f(space, status)
   end function dataset_shape

   ! --------------------------------------------------------------------------------------------- writing

   subroutine write_real_0(self, path, value, units, description, error)
      class(hdf5_file_t), intent(in) :: self
      character(len=*), intent(in) :: path
      real(wp), intent(in), target :: value
      character(len=*), intent(in) :: units, description
      type(error_t), allocatable, intent(out) :: error
      call write_numbers(self, path, h5t_native_double, [integer ::], c_loc(value), units, description, error)
   end subroutine write_real_0

   subroutine write_real_1(self, path, value, units, description, error)
      class(hdf5_file_t), intent(in) :: self
      character(len=*), intent(in) :: path
      real(wp), intent(in), contiguous, target :: value(:)
      character(len=*), intent(in) :: units, description
      type(error_t), allocatable, intent(out) :: error
      call write_numbers(self, path, h5t_native_double, shape(value), c_loc(value), units, description, error)
   end subroutine write_real_1

   subroutine write_real_2(self, path, value, units, description, error)
      class(hdf5_file_t), intent(in) :: self
      character(len=*), intent(in) :: path
      real(wp), intent(in), contiguous, target :: value(:, :)
      character(len=*), intent(in) :: units, description
      type(error_t), allocatable, intent(out) :: error
      call write_numbers(self, path, h5t_native_double, shape(value), c_loc(value), units, description, error)
   end subroutine write_real_2

   subroutine write_real_3(self, path, value, units, description, error)
      class(hdf5_file_t), intent(in) :: self
      character(len=*), intent(in) :: path
      real(wp), intent(in), contiguous, target :: value(:, :, :)
      character(len=*), intent(in) :: units, description
      type(error_t), allocatable, intent(out) :: error
      call write_numbers(self, path, h5t_native_double, shape(value), c_loc(value), units, description, error)
   end subroutine write_real_3

   subroutine write_integer_0(self, path, value, units, description, error)
      class(hdf5_file_t), intent(in) :: self
      character(len=*), intent(in) :: path
      integer, intent(in), target :: value
      character(len=*), intent(in) :: units, description
      type(error_t), allocatable, intent(out) :: error
      call write_numbers(self, path, h5t_native_integer, [integer ::], c_loc(value), units, description, error)
   end subroutine write_integer_0

   subroutine write_integer_1(self, path, value, units, description, error)
      class(hdf5_file_t), intent(in) :: self
      character(len=*), intent(in) :: path
      integer, intent(in), contiguous, target :: value(:)
      character(len=*), intent(in) :: units, description
      type(error_t), allocatable, intent(out) :: error
      call write_numbers(self, path, h5t_native_integer, shape(value), c_loc(value), units, description, error)
   end subroutine write_integer_1

   subroutine write_integer_2(self, path, value, units, description, error)
      class(hdf5_file_t), intent(in) :: self
      character(len=*), intent(in) :: path
      integer, intent(in), contiguous, target :: value(:, :)
      character(len=*), intent(in) :: units, description
      type(error_t), allocatable, intent(out) :: error
      call write_numbers(self, path, h5t_native_integer, shape(value), c_loc(value), units, description, error)
   end subroutine write_integer_2

   subroutine write_integer_3(self, path, value, units, description, error)
      class(hdf5_file_t), intent(in) :: self
      character(len=*), intent(in) :: path
      integer, intent(in), contiguous, target :: value(:, :, :)
      character(len=*), intent(in) :: units, description
      type(error_t), allocatable, intent(out) :: error
      call write_numbers(self, path, h5t_native_integer, shape(value), c_loc(value), units, description, error)
   end subroutine write_integer_3

   !> Write numbers with their attributes.
   subroutine write_numbers(self, path, type, shape, data, units, description, error)
      class(hdf5_file_t), intent(in) :: self
      character(len=*), intent(in) :: path
      integer(hid_t), intent(in) :: type
      integer, intent(in) :: shape(:)
      type(c_ptr), intent(in) :: data
      character(len=*), intent(in) :: units, description
      type(error_t), allocatable, intent(out) :: error

      call write_dataset(self, path, type, shape, data, error)
      if (.not. allocated(error)) call self%set_attribute(path, 'units', units, error)
      if (.not. allocated(error)) call self%set_attribute(path, 'description', description, error)
   end subroutine write_numbers

   subroutine write_string(self, path, value, description, error)
      class(hdf5_file_t), intent(in) :: self
      character(len=*), intent(in) :: path
      character(len=*), intent(in) :: value
      character(len=*), intent(in) :: description
      type(error_t), allocatable, intent(out) :: error
      character(len=:), allocatable, target :: buffer
      type(c_ptr), target :: pointers(1)
      integer(hid_t) :: type
      integer :: status

      buffer = value//c_null_char
      pointers(1) = c_loc(buffer)
      type = text_type()
      call write_dataset(self, path, type, [integer ::], c_loc(pointers), error)
      call h5tclose_f(type, status)
      if (.not. allocated(error)) call self%set_attribute(path, 'description', description, error)
   end subroutine write_string

   subroutine write_strings(self, path, value, description, error)
      class(hdf5_file_t), intent(in) :: self
      character(len=*), intent(in) :: path
      character(len=*), intent(in) :: value(:)
      character(len=*), intent(in) :: description
      type(error_t), allocatable, intent(out) :: error
      character(len=len(value) + 1), allocatable, target :: buffer(:)
      type(c_ptr), allocatable, target :: pointers(:)
      integer(hid_t) :: type
      integer :: k, status

      allocate (buffer(size(value)), pointers(size(value)))
      do k = 1, size(value)
         buffer(k) = trim(value(k))//c_null_char
         pointers(k) = c_loc(buffer(k))
      end do
      type = text_type()
      call write_dataset(self, path, type, [size(value)], c_loc(pointers), error)
      call h5tclose_f(type, status)
      if (.not. allocated(error)) call self%set_attribute(path, 'description', description, error)
   end subroutine write_strings

   !> The type of every string: variable length, UTF-8.
   function text_type() result(type)
      integer(hid_t) :: type
      integer :: status

      call h5tcopy_f(h5t_string, type, status)
      call h5tset_cset_f(type, h5t_cset_utf8_f, status)
   end function text_type

   !> Write a dataset: in place if one of the same type and shape is there, anew otherwise.
   subroutine write_dataset(self, path, type, shape, data, error)
      class(hdf5_file_t), intent(in) :: self
      character(len=*), intent(in) :: path
      integer(hid_t), intent(in) :: type
      integer, intent(in) :: shape(:)
      type(c_ptr), intent(in) :: data
      type(error_t), allocatable, intent(out) :: error
      integer(hid_t) :: id
      integer :: status

      call open_matching(self, path, type, shape, id)
      if (id < 0) then
         call self%delete(path, error)
         if (allocated(error)) return
         call create_dataset(self, path, type, int(shape, hsize_t), .false., id, error)
         if (allocated(error)) return
      end if
      if (all(shape > 0)) then
         call h5dwrite_f(id, type, data, status)
         if (status < 0) call failure(error, about(self, path)//'cannot be written (disk full?)')
      end if
      call h5dclose_f(id, status)
      if (status < 0 .and. .not. allocated(error)) call failure(error, about(self, path)//'cannot be written (disk full?)')
   end subroutine write_dataset

   !> Open the dataset at this path if it has this type and shape; -1 otherwise.
   subroutine open_matching(self, path, type, shape, id)
      class(hdf5_file_t), intent(in) :: self
      character(len=*), intent(in) :: path
      integer(hid_t), intent(in) :: type
      integer, intent(in) :: shape(:)
      integer(hid_t), intent(out) :: id
      integer(hsize_t), allocatable :: dims(:)
      integer(hid_t) :: stored
      integer :: status
      logical :: same

      id = -1
      if (.not. self%has(path)) return
      call h5dopen_f(self%id, path, id, status)
      if (status < 0) then
         id = -1
         return
      end if
      call h5dget_type_f(id, stored, status)
      call h5tequal_f(stored, type, same, status)
      call h5tclose_f(stored, status)
      dims = dataset_shape(id)
      if (same) same = size(dims) == size(shape)
      if (same) same = all(dims == shape)
      if (same) return
      call h5dclose_f(id, status)
      id = -1
   end subroutine open_matching

   !> Make an empty dataset, chunked and compressed if it is large; a growing one starts with no steps.
   subroutine create_dataset(self, path, type, dims, growing, id, error)
      class(hdf5_file_t), intent(in) :: self
      character(len=*), intent(in) :: path
      integer(hid_t), intent(in) :: type
      integer(hsize_t), intent(in) :: dims(:)
      logical, intent(in) :: growing
      integer(hid_t), intent(out) :: id
      type(error_t), allocatable, intent(out) :: error
      integer(hid_t) :: space, properties, link
      integer(hsize_t) :: largest(size(dims)), start(size(dims)), chunk(size(dims))
      integer :: status, rank, class

      rank = size(dims)
      call h5pcreate_f(h5p_dataset_create_f, properties, status)
      call h5tget_class_f(type, class, status)
      largest = dims
      start = dims
      chunk = chunk_shape(dims)
      if (growing) then
         largest(rank) = h5s_unlimited_f
         start(rank) = 0
         chunk(rank) = min(chunk(rank), int(chunk_steps, hsize_t))
      end if
      if (rank == 0) then
         call h5screate_f(h5s_scalar_f, space, status)
      else
         call h5screate_simple_f(rank, start, space, status, largest)
         if (growing .or. (product(dims) >= chunk_threshold .and. class /= h5t_string_f)) then
            call h5pset_chunk_f(properties, rank, chunk, status)
            if (self%compression > 0) then
               call h5pset_shuffle_f(properties, status)
               call h5pset_deflate_f(properties, self%compression, status)
            end if
         end if
      end if
      link = with_parents()
      call h5dcreate_f(self%id, path, type, space, id, status, dcpl_id=properties, lcpl_id=link)
      if (status < 0) call failure(error, about(self, path)//'cannot be made (is the file open for writing?)')
      call h5pclose_f(link, status)
      call h5pclose_f(properties, status)
      call h5sclose_f(space, status)
   end subroutine create_dataset

   !> Chunks of about `chunk_elements` elements, whole in the first dimensions.
   pure function chunk_shape(dims) result(chunk)
      integer(hsize_t), intent(in) :: dims(:)
      integer(hsize_t) :: chunk(size(dims))
      integer(hsize_t) :: room
      integer :: k

      room = chunk_elements
      do k = 1, size(dims)
         chunk(k) = max(1_hsize_t, min(dims(k), room))
         room = max(1_hsize_t, room/chunk(k))
      end do
   end function chunk_shape

   ! --------------------------------------------------------------------------------------------- reading

   subroutine read_real_0(self, path, value, error)
      class(hdf5_file_t), intent(in) :: self
      character(len=*), intent(in) :: path
      real(wp), intent(out), target :: value
      type(error_t), allocatable, intent(out) :: error
      integer, allocatable :: s(:)
      value = 0.0_wp
      call expect(self, path, 0, .false., s, error)
      if (.not. allocated(error)) call read_numbers(self, path, h5t_native_double, c_loc(value), error)
   end subroutine read_real_0

   subroutine read_real_1(self, path, value, error)
      class(hdf5_file_t), intent(in) :: self
      character(len=*), intent(in) :: path
      real(wp), allocatable, intent(out), target :: value(:)
      type(error_t), allocatable, intent(out) :: error
      integer, allocatable :: s(:)
      integer :: memory
      call expect(self, path, 1, .false., s, error)
      if (allocated(error)) return
      allocate (value(s(1)), stat=memory)
      call check_memory(self, path, memory, error)
      if (.not. allocated(error)) call read_numbers(self, path, h5t_native_double, c_loc(value), error)
   end subroutine read_real_1

   subroutine read_real_2(self, path, value, error)
      class(hdf5_file_t), intent(in) :: self
      character(len=*), intent(in) :: path
      real(wp), allocatable, intent(out), target :: value(:, :)
      type(error_t), allocatable, intent(out) :: error
      integer, allocatable :: s(:)
      integer :: memory
      call expect(self, path, 2, .false., s, error)
      if (allocated(error)) return
      allocate (value(s(1), s(2)), stat=memory)
      call check_memory(self, path, memory, error)
      if (.not. allocated(error)) call read_numbers(self, path, h5t_native_double, c_loc(value), error)
   end subroutine read_real_2

   subroutine read_real_3(self, path, value, error)
      class(hdf5_file_t), intent(in) :: self
      character(len=*), intent(in) :: path
      real(wp), allocatable, intent(out), target :: value(:, :, :)
      type(error_t), allocatable, intent(out) :: error
      integer, allocatable :: s(:)
      integer :: memory
      call expect(self, path, 3, .false., s, error)
      if (allocated(error)) return
      allocate (value(s(1), s(2), s(3)), stat=memory)
      call check_memory(self, path, memory, error)
      if (.not. allocated(error)) call read_numbers(self, path, h5t_native_double, c_loc(value), error)
   end subroutine read_real_3

   subroutine read_integer_0(self, path, value, error)
      class(hdf5_file_t), intent(in) :: self
      character(len=*), intent(in) :: path
      integer, intent(out), target :: value
      type(error_t), allocatable, intent(out) :: error
      integer, allocatable :: s(:)
      value = 0
      call expect(self, path, 0, .true., s, error)
      if (.not. allocated(error)) call read_numbers(self, path, h5t_native_integer, c_loc(value), error)
   end subroutine read_integer_0

   subroutine read_integer_1(self, path, value, error)
      class(hdf5_file_t), intent(in) :: self
      character(len=*), intent(in) :: path
      integer, allocatable, intent(out), target :: value(:)
      type(error_t), allocatable, intent(out) :: error
      integer, allocatable :: s(:)
      integer :: memory
      call expect(self, path, 1, .true., s, error)
      if (allocated(error)) return
      allocate (value(s(1)), stat=memory)
      call check_memory(self, path, memory, error)
      if (.not. allocated(error)) call read_numbers(self, path, h5t_native_integer, c_loc(value), error)
   end subroutine read_integer_1

   subroutine read_integer_2(self, path, value, error)
      class(hdf5_file_t), intent(in) :: self
      character(len=*), intent(in) :: path
      integer, allocatable, intent(out), target :: value(:, :)
      type(error_t), allocatable, intent(out) :: error
      integer, allocatable :: s(:)
      integer :: memory
      call expect(self, path, 2, .true., s, error)
      if (allocated(error)) return
      allocate (value(s(1), s(2)), stat=memory)
      call check_memory(self, path, memory, error)
      if (.not. allocated(error)) call read_numbers(self, path, h5t_native_integer, c_loc(value), error)
   end subroutine read_integer_2

   subroutine read_integer_3(self, path, value, error)
      class(hdf5_file_t), intent(in) :: self
      character(len=*), intent(in) :: path
      integer, allocatable, intent(out), target :: value(:, :, :)
      type(error_t), allocatable, intent(out) :: error
      integer, allocatable :: s(:)
      integer :: memory
      call expect(self, path, 3, .true., s, error)
      if (allocated(error)) return
      allocate (value(s(1), s(2), s(3)), stat=memory)
      call check_memory(self, path, memory, error)
      if (.not. allocated(error)) call read_numbers(self, path, h5t_native_integer, c_loc(value), error)
   end subroutine read_integer_3

   !> Whether a dataset stores integers.
   logical function holds_integers(self, path)
      class(hdf5_file_t), intent(in) :: self
      !> Dataset
      character(len=*), intent(in) :: path
      type(error_t), allocatable :: error
      integer(hid_t) :: id, type
      integer :: class, status

      holds_integers = .false.
      call open_dataset(self, path, id, error)
      if (allocated(error)) return
      call h5dget_type_f(id, type, status)
      call h5tget_class_f(type, class, status)
      call h5tclose_f(type, status)
      call h5dclose_f(id, status)
      holds_integers = class == h5t_integer_f
   end function holds_integers

   !> Check rank and kind of a dataset of numbers and get its shape. Integers are read as reals, never the reverse.
   subroutine expect(self, path, rank, integers, shape, error)
      class(hdf5_file_t), intent(in) :: self
      character(len=*), intent(in) :: path
      integer, intent(in) :: rank
      logical, intent(in) :: integers
      integer, allocatable, intent(out) :: shape(:)
      type(error_t), allocatable, intent(out) :: error
      integer(hid_t) :: id, type
      integer :: class, status

      call self%shape_of(path, shape, error)
      if (allocated(error)) return
      if (size(shape) /= rank) then
         call bad_input(error, about(self, path)//'has '//to_text(size(shape))//' dimensions, expected '//to_text(rank))
         return
      end if
      call open_dataset(self, path, id, error)
      if (allocated(error)) return
      call h5dget_type_f(id, type, status)
      call h5tget_class_f(type, class, status)
      call h5tclose_f(type, status)
      call h5dclose_f(id, status)
      if (integers .and. class /= h5t_integer_f) then
         call bad_input(error, about(self, path)//'does not hold integers')
      else if (class /= h5t_integer_f .and. class /= h5t_float_f) then
         call bad_input(error, about(self, path)//'does not hold numbers')
      end if
   end subroutine expect

   subroutine check_memory(self, path, status, error)
      class(hdf5_file_t), intent(in) :: self
      character(len=*), intent(in) :: path
      integer, intent(in) :: status
      type(error_t), allocatable, intent(out) :: error
      if (status /= 0) call failure(error, about(self, path)//'not enough memory to read it')
   end subroutine check_memory

   !> Read a whole dataset into memory of the right size.
   subroutine read_numbers(self, path, type, data, error)
      class(hdf5_file_t), intent(in) :: self
      character(len=*), intent(in) :: path
      integer(hid_t), intent(in) :: type
      type(c_ptr), intent(in) :: data
      type(error_t), allocatable, intent(out) :: error
      type(c_ptr) :: place
      integer(hid_t) :: id
      integer :: status

      call open_dataset(self, path, id, error)
      if (allocated(error)) return
      place = data
      if (all(dataset_shape(id) > 0)) then
         call h5dread_f(id, type, place, status)
         if (status < 0) call bad_input(error, about(self, path)//'cannot be read (file cut off or damaged?)')
      end if
      call h5dclose_f(id, status)
   end subroutine read_numbers

   subroutine read_string(self, path, value, error)
      class(hdf5_file_t), intent(in) :: self
      character(len=*), intent(in) :: path
      character(len=:), allocatable, intent(out) :: value
      type(error_t), allocatable, intent(out) :: error
      character(len=:), allocatable :: values(:)

      call read_texts(self, path, 0, values, error)
      if (.not. allocated(error)) value = values(1)
   end subroutine read_string

   subroutine read_strings(self, path, value, error)
      class(hdf5_file_t), intent(in) :: self
      character(len=*), intent(in) :: path
      character(len=:), allocatable, intent(out) :: value(:)
      type(error_t), allocatable, intent(out) :: error

      call read_texts(self, path, 1, value, error)
   end subroutine read_strings

   !> Read a dataset of strings of rank 0 or 1.
   subroutine read_texts(self, path, rank, value, error)
      class(hdf5_file_t), intent(in) :: self
      character(len=*), intent(in) :: path
      integer, intent(in) :: rank
      character(len=:), allocatable, intent(out) :: value(:)
      type(error_t), allocatable, intent(out) :: error
      integer(hid_t) :: id, type, space
      integer, allocatable :: s(:)
      integer :: status
      logical :: ok

      call self%shape_of(path, s, error)
      if (allocated(error)) return
      if (size(s) /= rank) then
         call bad_input(error, about(self, path)//'has '//to_text(size(s))//' dimensions, expected '//to_text(rank))
         return
      end if
      call open_dataset(self, path, id, error)
      if (allocated(error)) return
      call h5dget_type_f(id, type, status)
      call h5dget_space_f(id, space, status)
      call get_texts(id, .false., type, space, value, ok)
      call h5sclose_f(space, status)
      call h5tclose_f(type, status)
      call h5dclose_f(id, status)
      if (.not. ok) call bad_input(error, about(self, path)//'does not hold text that can be read')
   end subroutine read_texts

   !> Text of fixed or variable length from a dataset or an attribute.
   subroutine get_texts(id, is_attribute, type, space, value, ok)
      integer(hid_t), intent(in) :: id
      logical, intent(in) :: is_attribute
      integer(hid_t), intent(in) :: type, space
      character(len=:), allocatable, intent(out) :: value(:)
      logical, intent(out) :: ok
      character(len=1), allocatable, target :: fixed(:, :)
      character(len=1), pointer :: text(:)
      type(c_ptr), allocatable, target :: pointers(:)
      type(c_ptr) :: place
      integer(hsize_t) :: count
      integer(size_t) :: width
      integer :: class, status, k, longest
      logical :: variable

      ok = .false.
      call h5tget_class_f(type, class, status)
      call h5sget_simple_extent_npoints_f(space, count, status)
      if (class /= h5t_string_f .or. status < 0) return
      call h5tis_variable_str_f(type, variable, status)
      if (variable) then
         allocate (pointers(count))
         pointers = c_null_ptr
         place = c_loc(pointers)
      else
         call h5tget_size_f(type, width, status)
         allocate (fixed(width, count), source=c_null_char)
         place = c_loc(fixed)
      end if
      status = 0
      if (count > 0) then
         if (is_attribute) then
            call h5aread_f(id, type, place, status)
         else
            call h5dread_f(id, type, place, status)
         end if
      end if
      ok = status >= 0
      if (.not. ok) return
      if (.not. variable) then
         allocate (character(len=int(width)) :: value(count))
         do k = 1, int(count)
            value(k) = text_of(fixed(:, k))
         end do
         return
      end if
      longest = 0
      do k = 1, int(count)
         longest = max(longest, c_length(pointers(k)))
      end do
      allocate (character(len=longest) :: value(count))
      do k = 1, int(count)
         value(k) = ''
         if (c_length(pointers(k)) == 0) cycle
         call c_f_pointer(pointers(k), text, [c_length(pointers(k))])
         value(k) = text_of(text)
      end do
      if (count > 0) call h5dvlen_reclaim_f(type, space, h5p_default_f, place, status)
   end subroutine get_texts

   !> Characters up to the first null, as a string.
   pure function text_of(characters) result(text)
      character(len=1), intent(in) :: characters(:)
      character(len=size(characters)) :: text
      integer :: k

      text = ''
      do k = 1, size(characters)
         if (characters(k) == c_null_char) exit
         text(k:k) = characters(k)
      end do
   end function text_of

   !> Length of a C string, 0 for a null pointer.
   integer function c_length(pointer)
      type(c_ptr), intent(in) :: pointer
      character(kind=c_char, len=1), pointer :: text(:)

      c_length = 0
      if (.not. c_associated(pointer)) return
      call c_f_pointer(pointer, text, [huge(1)])
      do while (text(c_length + 1) /= c_null_char)
         c_length = c_length + 1
      end do
   end function c_length

   ! ------------------------------------------------------------------------------------------ attributes

   !> Set an attribute of a group or dataset ('/' for the file); one that is there is replaced.
   subroutine set_attribute_real(self, path, name, value, error)
      class(hdf5_file_t), intent(in) :: self
      character(len=*), intent(in) :: path, name
      real(wp), intent(in), target :: value
      type(error_t), allocatable, intent(out) :: error
      call put_attribute(self, path, name, h5t_native_double, c_loc(value), error)
   end subroutine set_attribute_real

   subroutine set_attribute_integer(self, path, name, value, error)
      class(hdf5_file_t), intent(in) :: self
      character(len=*), intent(in) :: path, name
      integer, intent(in), target :: value
      type(error_t), allocatable, intent(out) :: error
      call put_attribute(self, path, name, h5t_native_integer, c_loc(value), error)
   end subroutine set_attribute_integer

   subroutine set_attribute_string(self, path, name, value, error)
      class(hdf5_file_t), intent(in) :: self
      character(len=*), intent(in) :: path, name, value
      type(error_t), allocatable, intent(out) :: error
      character(len=:), allocatable, target :: buffer
      type(c_ptr), target :: pointers(1)
      integer(hid_t) :: type
      integer :: status

      buffer = value//c_null_char
      pointers(1) = c_loc(buffer)
      type = text_type()
      call put_attribute(self, path, name, type, c_loc(pointers), error)
      call h5tclose_f(type, status)
   end subroutine set_attribute_string

   !> Write a scalar attribute.
   subroutine put_attribute(self, path, name, type, data, error)
      class(hdf5_file_t), intent(in) :: self
      character(len=*), intent(in) :: path, name
      integer(hid_t), intent(in) :: type
      type(c_ptr), intent(in) :: data
      type(error_t), allocatable, intent(out) :: error
      type(c_ptr) :: place
      integer(hid_t) :: id, space
      integer :: status, ignored

      if (.not. self%has(path)) then
         call failure(error, about(self, path)//"no such object to carry the attribute '"//name//"'")
         return
      end if
      if (self%has_attribute(path, name)) call h5adelete_by_name_f(self%id, path, name, status)
      call h5screate_f(h5s_scalar_f, space, status)
      call h5acreate_by_name_f(self%id, path, name, type, space, id, status)
      if (status >= 0) then
         place = data
         call h5awrite_f(id, type, place, status)
         call h5aclose_f(id, ignored)
      end if
      if (status < 0) call failure(error, about(self, path)//"cannot write the attribute '"//name//"'")
      call h5sclose_f(space, ignored)
   end subroutine put_attribute

   !> Whether a group or dataset has this attribute.
   logical function has_attribute(self, path, name)
      class(hdf5_file_t), intent(in) :: self
      !> Group or dataset, '/' for the file
      character(len=*), intent(in) :: path
      !> Name of the attribute
      character(len=*), intent(in) :: name
      integer :: status

      has_attribute = .false.
      if (.not. self%has(path)) return
      call h5aexists_by_name_f(self%id, path, name, has_attribute, status)
      if (status < 0) has_attribute = .false.
   end function has_attribute

   !> Names of the attributes of a group or dataset, in alphabetical order.
   subroutine attributes(self, path, names, error)
      class(hdf5_file_t), intent(in) :: self
      !> Group or dataset, '/' for the file
      character(len=*), intent(in) :: path
      !> (attributes)
      character(len=name_length), allocatable, intent(out) :: names(:)
      type(error_t), allocatable, intent(out) :: error
      integer(hid_t) :: object, id
      integer(hsize_t) :: k
      integer :: count, status

      status = -1
      if (self%has(path)) call h5oopen_f(self%id, path, object, status)
      if (status < 0) then
         call bad_input(error, about(self, path)//'there is no such group or dataset')
         return
      end if
      call h5aget_num_attrs_f(object, count, status)
      allocate (names(max(0, count)))
      names = ''
      do k = 1, size(names)
         call h5aopen_by_idx_f(object, '.', h5_index_name_f, h5_iter_inc_f, k - 1, id, status)
         if (status < 0) cycle
         call h5aget_name_f(id, int(name_length, size_t), names(k), status)
         call h5aclose_f(id, status)
      end do
      call h5oclose_f(object, status)
   end subroutine attributes

   subroutine get_attribute_real(self, path, name, value, error, default)
      class(hdf5_file_t), intent(in) :: self
      character(len=*), intent(in) :: path, name
      real(wp), intent(out), target :: value
      type(error_t), allocatable, intent(out) :: error
      real(wp), intent(in), optional :: default
      value = 0.0_wp
      if (present(default)) value = default
      if (present(default) .and. .not. self%has_attribute(path, name)) return
      call fetch_attribute(self, path, name, h5t_native_double, .false., c_loc(value), error)
   end subroutine get_attribute_real

   subroutine get_attribute_integer(self, path, name, value, error, default)
      class(hdf5_file_t), intent(in) :: self
      character(len=*), intent(in) :: path, name
      integer, intent(out), target :: value
      type(error_t), allocatable, intent(out) :: error
      integer, intent(in), optional :: default
      value = 0
      if (present(default)) value = default
      if (present(default) .and. .not. self%has_attribute(path, name)) return
      call fetch_attribute(self, path, name, h5t_native_integer, .true., c_loc(value), error)
   end subroutine get_attribute_integer

   subroutine get_attribute_string(self, path, name, value, error, default)
      class(hdf5_file_t), intent(in) :: self
      character(len=*), intent(in) :: path, name
      character(len=:), allocatable, intent(out) :: value
      type(error_t), allocatable, intent(out) :: error
      character(len=*), intent(in), optional :: default
      character(len=:), allocatable :: values(:)
      integer(hid_t) :: id, type, space
      integer :: status
      logical :: ok

      value = ''
      if (present(default)) value = default
      if (present(default) .and. .not. self%has_attribute(path, name)) return
      call open_attribute(self, path, name, id, type, space, error)
      if (allocated(error)) return
      call get_texts(id, .true., type, space, values, ok)
      if (ok) ok = size(values) == 1
      if (ok) then
         value = trim(values(1))
      else
         call bad_input(error, about(self, path)//"attribute '"//name//"' is not text")
      end if
      call h5sclose_f(space, status)
      call h5tclose_f(type, status)
      call h5aclose_f(id, status)
   end subroutine get_attribute_string

   !> Read an attribute of one number.
   subroutine fetch_attribute(self, path, name, type, integers, data, error)
      class(hdf5_file_t), intent(in) :: self
      character(len=*), intent(in) :: path, name
      integer(hid_t), intent(in) :: type
      logical, intent(in) :: integers
      type(c_ptr), intent(in) :: data
      type(error_t), allocatable, intent(out) :: error
      type(c_ptr) :: place
      integer(hid_t) :: id, stored, space
      integer(hsize_t) :: count
      integer :: class, status

      call open_attribute(self, path, name, id, stored, space, error)
      if (allocated(error)) return
      call h5tget_class_f(stored, class, status)
      call h5sget_simple_extent_npoints_f(space, count, status)
      place = data
      if (count /= 1 .or. .not. (class == h5t_integer_f .or. (class == h5t_float_f .and. .not. integers))) then
         call bad_input(error, about(self, path)//"attribute '"//name//"' is not "// &
            trim(merge('an integer', 'one number', integers)))
      else
         call h5aread_f(id, type, place, status)
         if (status < 0) call bad_input(error, about(self, path)//"attribute '"//name//"' cannot be read")
      end if
      call h5sclose_f(space, status)
      call h5tclose_f(stored, status)
      call h5aclose_f(id, status)
   end subroutine fetch_attribute

   !> Open an attribute with its type and extent.
   subroutine open_attribute(self, path, name, id, type, space, error)
      class(hdf5_file_t), intent(in) :: self
      character(len=*), intent(in) :: path, name
      integer(hid_t), intent(out) :: id, type, space
      type(error_t), allocatable, intent(out) :: error
      integer :: status

      id = -1
      type = -1
      space = -1
      status = -1
      if (self%has_attribute(path, name)) call h5aopen_by_name_f(self%id, path, name, id, status)
      if (status < 0) then
         call bad_input(error, about(self, path)//"there is no attribute '"//name//"'")
         return
      end if
      call h5aget_type_f(id, type, status)
      call h5aget_space_f(id, space, status)
   end subroutine open_attribute

   ! ------------------------------------------------------------------------------------ dimension scales

   !> Make a dataset of one dimension a dimension scale (an axis).
   subroutine make_scale(self, path, name, error)
      class(hdf5_file_t), intent(in) :: self
      !> Dataset
      character(len=*), intent(in) :: path
      !> Name of the axis
      character(len=*), intent(in) :: name
      type(error_t), allocatable, intent(out) :: error
      integer(hid_t) :: id
      integer :: status
      logical :: already

      call open_dataset(self, path, id, error)
      if (allocated(error)) return
      call h5dsis_scale_f(id, already, status)
      if (.not. already) then
         call h5dsset_scale_f(id, status, name)
         if (status < 0) call failure(error, about(self, path)//'cannot become a dimension scale')
      end if
      call h5dclose_f(id, status)
   end subroutine make_scale

   !> Make a dimension scale the axis of one dimension of a dataset; harmless if it is already. (Asking first would follow
   !> all references of the scale, also those to datasets that were replaced meanwhile.)
   subroutine attach_scale(self, path, dimension, scale, error)
      class(hdf5_file_t), intent(in) :: self
      !> Dataset
      character(len=*), intent(in) :: path
      !> Which dimension, counted as in Fortran
      integer, intent(in) :: dimension
      !> Path of the scale
      character(len=*), intent(in) :: scale
      type(error_t), allocatable, intent(out) :: error
      integer(hid_t) :: id, axis
      integer :: status, rank

      call open_dataset(self, path, id, error)
      if (allocated(error)) return
      call open_dataset(self, scale, axis, error)
      if (.not. allocated(error)) then
         rank = size(dataset_shape(id))
         status = -1
         if (dimension >= 1 .and. dimension <= rank) then
            ! The library counts dimensions as C does, from 1.
            call h5dsattach_scale_f(id, axis, rank - dimension + 1, status)
         end if
         if (status < 0) call failure(error, about(self, path)//"cannot take '"//scale//"' as axis of dimension "// &
            to_text(dimension))
         call h5dclose_f(axis, status)
      end if
      call h5dclose_f(id, status)
   end subroutine attach_scale

   !> Whether a dataset is the axis of one dimension of another one. No: there is nothing that says so.
   logical function is_attached(self, path, dimension, scale)
      class(hdf5_file_t), intent(in) :: self
      !> Dataset
      character(len=*), intent(in) :: path
      !> Which dimension, counted as in Fortran
      integer, intent(in) :: dimension
      !> Path of the axis
      character(len=*), intent(in) :: scale
      type(error_t), allocatable :: error
      integer(hid_t) :: id, axis
      integer :: status, rank

      is_attached = .false.
      call open_dataset(self, path, id, error)
      if (allocated(error)) return
      call open_dataset(self, scale, axis, error)
      if (.not. allocated(error)) then
         rank = size(dataset_shape(id))
         call h5dsis_scale_f(axis, is_attached, status)
         if (status < 0) is_attached = .false.
         if (is_attached) call h5dsis_attached_f(id, axis, rank - dimension + 1, is_attached, status)
         if (status < 0) is_attached = .false.
         call h5dclose_f(axis, status)
      end if
      call h5dclose_f(id, status)
   end function is_attached

   ! ---------------------------------------------------------------------------------------------- series

   !> Make a dataset that grows along its last Fortran dimension; one that is there is replaced.
   subroutine create_series(self, file, path, leading, units, description, error, integers)
      class(series_t), intent(inout) :: self
      !> Open for writing
      type(hdf5_file_t), intent(in) :: file
      !> Dataset
      character(len=*), intent(in) :: path
      !> Shape of one step: empty for a scalar, at most two dimensions
      integer, intent(in) :: leading(:)
      !> Attributes of the dataset
      character(len=*), intent(in) :: units, description
      type(error_t), allocatable, intent(out) :: error
      !> Whether it holds integers (reals by default)
      logical, intent(in), optional :: integers

      self%label = about(file, path)
      self%leading = int(leading, hsize_t)
      self%steps = 0
      self%holds_integers = .false.
      if (present(integers)) self%holds_integers = integers
      call file%delete(path, error)
      if (allocated(error)) return
      call create_dataset(file, path, merge(h5t_native_integer, h5t_native_double, self%holds_integers), &
         [self%leading, int(huge(1), hsize_t)], .true., self%id, error)
      if (.not. allocated(error)) call file%set_attribute(path, 'units', units, error)
      if (.not. allocated(error)) call file%set_attribute(path, 'description', description, error)
   end subroutine create_series

   !> Go on with a series that is there; what lies behind `keep` steps is dropped.
   subroutine open_series(self, file, path, error, keep)
      class(series_t), intent(inout) :: self
      !> Open for writing
      type(hdf5_file_t), intent(in) :: file
      !> Dataset
      character(len=*), intent(in) :: path
      type(error_t), allocatable, intent(out) :: error
      !> Number of steps to keep (all by default)
      integer, intent(in), optional :: keep
      integer(hsize_t), allocatable :: dims(:)
      integer(hid_t) :: type
      integer :: class, status

      self%label = about(file, path)
      call open_dataset(file, path, self%id, error)
      if (allocated(error)) return
      call h5dget_type_f(self%id, type, status)
      call h5tget_class_f(type, class, status)
      call h5tclose_f(type, status)
      self%holds_integers = class == h5t_integer_f
      dims = dataset_shape(self%id)
      if (size(dims) == 0) then
         call bad_input(error, self%label//'is not a series')
         return
      end if
      self%leading = dims(:size(dims) - 1)
      self%steps = dims(size(dims))
      if (.not. present(keep)) return
      if (keep < 0 .or. keep > self%steps) then
         call bad_input(error, self%label//'has '//to_text(int(self%steps))//' steps, expected at least '//to_text(keep))
         return
      end if
      self%steps = keep
      call h5dset_extent_f(self%id, [self%leading, self%steps], status)
      if (status < 0) call failure(error, self%label//'cannot be shortened')
   end subroutine open_series

   !> Number of steps written.
   pure integer function step_count(self)
      class(series_t), intent(in) :: self
      step_count = int(self%steps)
   end function step_count

   !> Close the dataset; harmless if it is not open.
   subroutine close_series(self, error)
      class(series_t), intent(inout) :: self
      type(error_t), allocatable, intent(out) :: error
      integer :: status

      if (self%id < 0) return
      call h5dclose_f(self%id, status)
      self%id = -1
      if (status < 0) call failure(error, self%label//'cannot finish writing (disk full?)')
   end subroutine close_series

   !> Read some steps of a series of reals, (numbers of a step, steps).
   subroutine read_steps(self, first, count, block, error)
      class(series_t), intent(in) :: self
      !> The first of them, from 1, and how many
      integer, intent(in) :: first, count
      real(wp), allocatable, target, intent(out) :: block(:, :)
      type(error_t), allocatable, intent(out) :: error
      integer(hsize_t) :: counts(size(self%leading) + 1), offset(size(self%leading) + 1)
      type(c_ptr) :: data
      integer(hid_t) :: memory, space
      integer :: status, ignored

      if (self%id < 0 .or. self%holds_integers .or. first < 1 .or. count < 1 .or. first - 1 + count > self%steps) then
         call failure(error, self%label//'is closed, or has no such steps of reals')
         return
      end if
      allocate (block(int(product(self%leading)), count))
      if (size(block) == 0) return
      counts = [self%leading, int(count, hsize_t)]
      offset = 0
      offset(size(offset)) = first - 1
      call h5screate_simple_f(size(counts), counts, memory, ignored)
      call h5dget_space_f(self%id, space, ignored)
      call h5sselect_hyperslab_f(space, h5s_select_set_f, offset, counts, ignored)
      data = c_loc(block)
      call h5dread_f(self%id, h5t_native_double, data, status, memory, space)
      call h5sclose_f(space, ignored)
      call h5sclose_f(memory, ignored)
      if (status < 0) call failure(error, self%label//'cannot be read')
   end subroutine read_steps

   !> Append steps of a scalar, (steps).
   subroutine append_real_1(self, block, error)
      class(series_t), intent(inout) :: self
      real(wp), intent(in), contiguous, target :: block(:)
      type(error_t), allocatable, intent(out) :: error
      call append_block(self, h5t_native_double, shape(block), c_loc(block), error)
   end subroutine append_real_1

   !> Append steps of a vector, (components, steps).
   subroutine append_real_2(self, block, error)
      class(series_t), intent(inout) :: self
      real(wp), intent(in), contiguous, target :: block(:, :)
      type(error_t), allocatable, intent(out) :: error
      call append_block(self, h5t_native_double, shape(block), c_loc(block), error)
   end subroutine append_real_2

   !> Append steps of a field, (nx, ny, steps).
   subroutine append_real_3(self, block, error)
      class(series_t), intent(inout) :: self
      real(wp), intent(in), contiguous, target :: block(:, :, :)
      type(error_t), allocatable, intent(out) :: error
      call append_block(self, h5t_native_double, shape(block), c_loc(block), error)
   end subroutine append_real_3

   !> Append steps of an integer, (steps).
   subroutine append_integer_1(self, block, error)
      class(series_t), intent(inout) :: self
      integer, intent(in), contiguous, target :: block(:)
      type(error_t), allocatable, intent(out) :: error
      call append_block(self, h5t_native_integer, shape(block), c_loc(block), error)
   end subroutine append_integer_1

   !> Append steps of several integers, (components, steps).
   subroutine append_integer_2(self, block, error)
      class(series_t), intent(inout) :: self
      integer, intent(in), contiguous, target :: block(:, :)
      type(error_t), allocatable, intent(out) :: error
      call append_block(self, h5t_native_integer, shape(block), c_loc(block), error)
   end subroutine append_integer_2

   !> Append a block of steps.
   subroutine append_block(self, type, shape, data, error)
      class(series_t), intent(inout) :: self
      integer(hid_t), intent(in) :: type
      integer, intent(in) :: shape(:)
      type(c_ptr), intent(in) :: data
      type(error_t), allocatable, intent(out) :: error
      integer(hsize_t) :: count(size(shape)), offset(size(shape))
      integer(hid_t) :: memory, space
      integer :: rank, status, ignored
      logical :: fits

      rank = size(shape)
      fits = self%id >= 0 .and. (self%holds_integers .eqv. (type == h5t_native_integer))
      if (fits) fits = rank == size(self%leading) + 1
      if (fits) fits = all(shape(:rank - 1) == self%leading)
      if (.not. fits) then
         call failure(error, self%label//'is closed or does not take steps of this kind or shape')
         return
      end if
      if (any(shape == 0)) return
      count = shape
      offset = 0
      offset(rank) = self%steps
      call h5dset_extent_f(self%id, [self%leading, self%steps + count(rank)], status)
      if (status >= 0) then
         call h5screate_simple_f(rank, count, memory, ignored)
         call h5dget_space_f(self%id, space, ignored)
         call h5sselect_hyperslab_f(space, h5s_select_set_f, offset, count, ignored)
         call h5dwrite_f(self%id, type, data, status, memory, space)
         call h5sclose_f(space, ignored)
         call h5sclose_f(memory, ignored)
      end if
      if (status < 0) then
         call failure(error, self%label//'cannot be extended (disk full?)')
         return
      end if
      self%steps = self%steps + count(rank)
   end subroutine append_block

end module microslip_io_hdf5
