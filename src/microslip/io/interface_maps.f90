!> Fields of an interface in the result file: maps [y, x] on a regular grid, lists [point] of points at the FE nodes.
!>
!> Their axes are /interface_K/x and y: one for each dimension of a map, both for the points of a list.
module microslip_io_interface_maps
   use microslip_core_error, only: error_t
   use microslip_core_kinds, only: wp
   use microslip_halfspace_grid, only: be_grid_t
   use microslip_io_hdf5, only: hdf5_file_t, series_t
   implicit none(type, external)
   private

   public :: write_map, write_maps, append_map, attach_axes, map_shape, map_axes

contains

   !> Write one field of an interface. Nothing is done if an earlier write failed.
   subroutine write_map(file, grid, group, path, map, units, description, error)
      type(hdf5_file_t), intent(in) :: file
      type(be_grid_t), intent(in) :: grid
      !> Group of the interface, '/interface_K'
      character(len=*), intent(in) :: group
      !> Where to
      character(len=*), intent(in) :: path
      !> (nx, ny)
      real(wp), intent(in) :: map(:, :)
      character(len=*), intent(in) :: units, description
      type(error_t), allocatable, intent(inout) :: error

      if (allocated(error)) return
      if (grid%regular) then
         call file%write(path, map, units, description, error)
      else
         call file%write(path, map(:, 1), units, description, error)
      end if
      call attach_axes(file, grid, group, path, error)
   end subroutine write_map

   !> Write a series of fields of an interface at once.
   subroutine write_maps(file, grid, group, path, maps, units, description, error)
      type(hdf5_file_t), intent(in) :: file
      type(be_grid_t), intent(in) :: grid
      !> Group of the interface, '/interface_K'
      character(len=*), intent(in) :: group
      !> Where to
      character(len=*), intent(in) :: path
      !> (nx, ny, fields)
      real(wp), intent(in) :: maps(:, :, :)
      character(len=*), intent(in) :: units, description
      type(error_t), allocatable, intent(inout) :: error

      if (allocated(error)) return
      if (grid%regular) then
         call file%write(path, maps, units, description, error)
      else
         call file%write(path, maps(:, 1, :), units, description, error)
      end if
      call attach_axes(file, grid, group, path, error)
   end subroutine write_maps

   !> Append a field to a series of `map_shape`.
   subroutine append_map(series, grid, map, error)
      type(series_t), intent(inout) :: series
      type(be_grid_t), intent(in) :: grid
      !> (nx, ny)
      real(wp), intent(in) :: map(:, :)
      type(error_t), allocatable, intent(out) :: error

      if (grid%regular) then
         call series%append(reshape(map, [shape(map), 1]), error)
      else
         call series%append(map, error)
      end if
   end subroutine append_map

   !> x and y of an interface become the axes of a field, its first dimensions.
   subroutine attach_axes(file, grid, group, path, error)
      type(hdf5_file_t), intent(in) :: file
      type(be_grid_t), intent(in) :: grid
      !> Group of the interface, '/interface_K'
      character(len=*), intent(in) :: group
      !> The dataset
      character(len=*), intent(in) :: path
      type(error_t), allocatable, intent(inout) :: error

      if (.not. allocated(error)) call file%attach_scale(path, 1, group//'/x', error)
      if (.not. allocated(error)) call file%attach_scale(path, merge(2, 1, grid%regular), group//'/y', error)
   end subroutine attach_axes

   !> Shape of a field in the file, in the order of Fortran.
   pure function map_shape(grid) result(sizes)
      type(be_grid_t), intent(in) :: grid
      integer, allocatable :: sizes(:)

      sizes = [grid%nx, grid%ny]
      if (.not. grid%regular) sizes = [grid%nx]
   end function map_shape

   !> Axes of a field in words, as languages with the last index first see them.
   pure function map_axes(grid) result(text)
      type(be_grid_t), intent(in) :: grid
      character(len=:), allocatable :: text

      text = 'point'
      if (grid%regular) text = 'y, x'
   end function map_axes

end module microslip_io_interface_maps
