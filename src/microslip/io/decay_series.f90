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

   !> Read the sensors and, with a mode shape, that mode's coordinate, counted from the first sample of the series.
   subroutine read_decay(file, group, decay, error, phi, span)
      !> Open result file
      type(hdf5_file_t), intent(in) :: file
      !> Of the time integration
      character(len=*), intent(in) :: group
      type(decay_t), intent(out) :: decay
      type(error_t), allocatable, intent(out) :: error
      !> (modes) mode shape of unit modal mass
      real(wp), intent(in), optional :: phi(:)
      !> s, only samples from span(1) on and before span(2)
      real(wp), intent(in), optional :: span(2)
      real(wp), allocatable :: time(:, :), coordinates(:, :)
      integer :: first, last

      call find_samples(file, group//'/time', first, last, error, span)
      if (.not. allocated(error)) call read_samples(file, group//'/time', first, last, time, error)
      if (.not. allocated(error)) call read_samples(file, group//'/sensor', first, last, decay%sensor, error)
      if (allocated(error)) return
      decay%time = time(1, :)
      if (.not. present(phi)) return
      call read_samples(file, group//'/modal_displacement', first, last, coordinates, error, phi)
      if (.not. allocated(error)) decay%modal = coordinates(1, :)
   end subroutine read_decay

   !> First and last sample of a span of time; all samples without one. They follow each other: samples are sorted by time.
   subroutine find_samples(file, path, first, last, error, span)
      type(hdf5_file_t), intent(in) :: file
      character(len=*), intent(in) :: path
      integer, intent(out) :: first, last
      type(error_t), allocatable, intent(out) :: error
      real(wp), intent(in), optional :: span(2)
      type(series_t) :: series
      type(error_t), allocatable :: ignored
      real(wp), allocatable :: block(:, :)
      integer :: start, count

      first = 1
      call series%open(file, path, error)
      if (allocated(error)) return
      last = series%step_count()
      if (present(span)) then
         last = 0
         do start = 1, series%step_count(), block_size
            count = min(block_size, series%step_count() - start + 1)
            call series%read_steps(start, count, block, error)
            if (allocated(error)) exit
            first = first + count_below(span(1))
            last = last + count_below(span(2))
         end do
      end if
      call series%close(ignored)

   contains

      !> Samples of the block before a time.
      integer function count_below(time)
         real(wp), intent(in) :: time
         integer :: k
         count_below = 0
         do k = 1, count
            if (block(1, k) < time) count_below = count_below + 1
         end do
      end function count_below

   end subroutine find_samples

   !> Some samples of a series, block by block; with phi in place of the values d of a sample phi^T (d - d_0), d_0 those of the
   !> first sample of the series: all modal coordinates may be many.
   subroutine read_samples(file, path, first, last, values, error, phi)
      type(hdf5_file_t), intent(in) :: file
      character(len=*), intent(in) :: path
      integer, intent(in) :: first, last
      !> (values or 1, samples)
      real(wp), allocatable, intent(out) :: values(:, :)
      type(error_t), allocatable, intent(out) :: error
      real(wp), intent(in), optional :: phi(:)
      type(series_t) :: series
      type(error_t), allocatable :: ignored
      real(wp), allocatable :: block(:, :), origin(:, :)
      integer :: start, count, k

      call series%open(file, path, error)
      if (allocated(error)) return
      if (series%step_count() > 0) call series%read_steps(1, 1, origin, error)
      if (.not. allocated(error) .and. allocated(origin)) then
         allocate (values(merge(1, size(origin, 1), present(phi)), max(0, last - first + 1)))
         do start = first, last, block_size
            count = min(block_size, last - start + 1)
            call series%read_steps(start, count, block, error)
            if (allocated(error)) exit
            do k = 1, count
               if (present(phi)) then
                  values(1, start - first + k) = dot_product(phi, block(:, k) - origin(:, 1))
               else
                  values(:, start - first + k) = block(:, k)
               end if
            end do
         end do
      else if (.not. allocated(error)) then
         allocate (values(1, 0))
      end if
      call series%close(ignored)
   end subroutine read_samples

end module microslip_io_decay_series
