!> How half space and FE mesh of the interfaces go together, in the result file: /interface_K/coupling (doc/results.md).
module microslip_io_coupling_results
   use microslip_core_error, only: error_t
   use microslip_core_kinds, only: wp
   use microslip_fe_interface_mesh, only: interface_mesh_t
   use microslip_io_contact_fields, only: interface_group
   use microslip_io_hdf5, only: hdf5_file_t
   use microslip_system_coupling_error, only: coupling_error_t
   use microslip_system_pad, only: pad_t
   implicit none(type, external)
   private

   public :: write_couplings

contains

   !> All interfaces with half spaces.
   subroutine write_couplings(file, pads, meshes, estimates, error)
      !> Open result file
      type(hdf5_file_t), intent(in) :: file
      type(pad_t), intent(in) :: pads(:)
      !> (pads) FE meshes
      type(interface_mesh_t), intent(in) :: meshes(:)
      !> (pads) of the scale-split coupling, where it is
      type(coupling_error_t), intent(in) :: estimates(:)
      type(error_t), allocatable, intent(out) :: error
      integer :: k

      do k = 1, size(pads)
         if (pads(k)%half_space) call write_coupling(file, '/'//interface_group(k)//'/coupling/', pads(k), meshes(k), &
            & estimates(k), error)
         if (allocated(error)) return
      end do
   end subroutine write_couplings

   subroutine write_coupling(file, group, pad, mesh, estimate, error)
      type(hdf5_file_t), intent(in) :: file
      !> With a slash at its end
      character(len=*), intent(in) :: group
      type(pad_t), intent(in) :: pad
      type(interface_mesh_t), intent(in) :: mesh
      type(coupling_error_t), intent(in) :: estimate
      type(error_t), allocatable, intent(out) :: error

      call file%write(group//'kind', [trim(merge('scale_split', 'series     ', allocated(pad%filter)))], &
         & 'what the half space adds to the FE model', error)
      if (.not. allocated(error)) call file%write(group//'node_distance', mesh%spacing, 'm', &
         & 'mean distance of the FE nodes in the plane of the interface', error)
      if (.not. allocated(error)) call file%write(group//'first_layer', mesh%layer, 'm', &
         & '[body]: mean thickness of the first layer of elements of A and B; 0: no body', error)
      if (allocated(error) .or. .not. allocated(pad%filter)) return
      call file%write(group//'disc_radius', estimate%radius, 'm', &
         & 'of the disc on which the coupling is tried against the half space; 0: the pad has no room for one', error)
      if (allocated(error) .or. estimate%radius <= 0.0_wp) return
      call file%write(group//'error_estimate', estimate%deviation, '1', &
         & '[n, t1, t2]: deviation from the half space on that disc and its ring, relative norm', error)
   end subroutine write_coupling

end module microslip_io_coupling_results
