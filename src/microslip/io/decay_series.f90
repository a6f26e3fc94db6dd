!> The decay that a time integration left in the result file, for the identification of a ring-down.
module microslip_io_decay_series
   use microslip_analysis_ringdown, only: decay_t
   use microslip_core_error, only: error_t
   use microslip_core_kinds, only: wp
   use microslip_io_hdf5, only: hdf5_file_t, series_t
   implicit none(type, external)
   private

   public :: read_decay

   !> Samples that are read together.
   integer, parameter :: block_size = 4096

contains

   !> Read the sensors and, with a mode shape, that mode's coordinate, counted from the first sample.
   subroutine read_decay(file, group, decay, error, phi)
      !> Open result file
      type(hdf5_file_t), intent(in) :: file
      !> Of the time integration
      character(len=*), intent(in) :: group
      type(decay_t), intent(out) :: decay
      type(error_t), allocatable, intent(out) :: error
      !> (modes) mode shape of unit modal mass
      real(wp), intent(in), optional :: phi(:)
      real(wp), allocatable :: coordinates(:)

      call file%read(group//'/time', decay%time, error)
      if (.not. allocated(error)) call file%read(group//'/sensor', decay%sensor, error)
      if (allocated(error) .or. .not. present(phi)) return
      call project(file, group//'/modal_displacement', phi, coordinates, error)
      if (.not. allocated(error)) call move_alloc(coordinates, decay%modal)
   end subroutine read_decay

   !> phi^T (d - d_0), block by block: all modal coordinates may be many.
   subroutine project(file, path, phi, coordinates, error)
      type(hdf5_file_t), intent(in) :: file
      character(len=*), intent(in) :: path
      real(wp), intent(in) :: phi(:)
      !> (samples)
      real(wp), allocatable, intent(out) :: coordinates(:)
      type(error_t), allocatable, intent(out) :: error
      type(series_t) :: series
      type(error_t), allocatable :: ignored
      real(wp), allocatable :: block(:, :), origin(:)
      integer :: first, count, k

      call series%open(file, path, error)
      if (allocated(error)) return
      allocate (coordinates(series%step_count()))
      do first = 1, size(coordinates), block_size
         count = min(block_size, size(coordinates) - first + 1)
         call series%read_steps(first, count, block, error)
         if (allocated(error)) exit
         if (first == 1) origin = block(:, 1)
         do k = 1, count
            coordinates(first + k - 1) = dot_product(phi, block(:, k) - origin)
         end do
      end do
      call series%close(ignored)
   end subroutine project

end module microslip_io_decay_series
