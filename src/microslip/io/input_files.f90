!> The files that the case at hand was read from: no result may replace one of them.
!>
!> Everything that opens an input notes it here (`line_reader_t`, `hdf5_file_t`, the case reader), so that no reader and no
!> file named within a file (`*INCLUDE`) can be forgotten. scripts/check_imports sees to it that nothing else opens files.
module microslip_io_input_files
   implicit none(type, external)
   private

   public :: note_input, forget_inputs, input_count, input_path

   type :: path_t
      character(len=:), allocatable :: text
   end type path_t

   type(path_t), allocatable, save :: paths(:)
   integer, save :: count = 0

contains

   !> A file is opened to be read.
   subroutine note_input(path)
      character(len=*), intent(in) :: path
      type(path_t), allocatable :: more(:)
      integer :: k

      do k = 1, count
         if (paths(k)%text == path) return
      end do
      if (.not. allocated(paths)) allocate (paths(16))
      if (count == size(paths)) then
         allocate (more(2*count))
         do k = 1, count
            call move_alloc(paths(k)%text, more(k)%text)
         end do
         call move_alloc(more, paths)
      end if
      count = count + 1
      paths(count)%text = path
   end subroutine note_input

   !> Another case begins.
   subroutine forget_inputs()
      count = 0
   end subroutine forget_inputs

   !> How many files were read.
   integer function input_count()
      input_count = count
   end function input_count

   !> One of them.
   function input_path(k) result(path)
      !> 1 to `input_count()`
      integer, intent(in) :: k
      character(len=:), allocatable :: path
      path = paths(k)%text
   end function input_path

end module microslip_io_input_files
