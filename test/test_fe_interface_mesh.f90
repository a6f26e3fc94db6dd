!> Measures of the FE mesh at an interface: distances from node to node, for faces with and without mid-side nodes.
module test_fe_interface_mesh
   use microslip_core_error, only: error_t
   use microslip_core_kinds, only: wp
   use microslip_fe_interface, only: contact_interface_t, interface_from_sets
   use microslip_fe_interface_mesh, only: interface_mesh_t, measure_interface_mesh
   use microslip_fe_model, only: fe_model_t
   use support_checks, only: good
   use support_mesh, only: block_height, pad_size, turn, two_blocks
   use testdrive, only: check, error_type, new_unittest, unittest_type
   implicit none(type, external)
   private

   public :: collect_fe_interface_mesh

   real(wp), parameter :: rounding = 1.0e-12_wp

contains

   subroutine collect_fe_interface_mesh(testsuite)
      type(unittest_type), allocatable, intent(out) :: testsuite(:)
      testsuite = [new_unittest('spacing_and_layers', test_measures), &
                   new_unittest('ground_has_no_layer', test_ground)]
   end subroutine collect_fe_interface_mesh

   subroutine test_measures(error)
      type(error_type), allocatable, intent(out) :: error

      call compare(error, 'C3D8I', 1.0_wp)
      if (.not. allocated(error)) call compare(error, 'C3D20R', 0.5_wp)
   end subroutine test_measures

   !> Distances between nodes as a part of the elements.
   subroutine compare(error, type, part)
      type(error_type), allocatable, intent(out) :: error
      character(len=*), intent(in) :: type
      real(wp), intent(in) :: part
      type(error_t), allocatable :: lib
      type(fe_model_t) :: model
      type(contact_interface_t) :: contact
      type(interface_mesh_t) :: mesh
      integer, parameter :: cells(3) = [5, 4, 3]

      ! Turned in space; shifts of inner nodes keep the area.
      model = two_blocks(type, cells, .false., 0.3_wp, turn())
      call interface_from_sets(model, 'pad', 'top_pad', 'bottom_pad', contact, error=lib)
      call good(error, lib)
      if (allocated(error)) return
      mesh = measure_interface_mesh(model, contact)
      call check(error, mesh%spacing, part*sqrt(product(pad_size/cells(:2))), thr=rounding)
      if (allocated(error)) return
      call check(error, all(abs(mesh%layer - part*block_height/cells(3)) <= rounding), 'layers')
   end subroutine compare

   subroutine test_ground(error)
      type(error_type), allocatable, intent(out) :: error
      type(error_t), allocatable :: lib
      type(fe_model_t) :: model
      type(contact_interface_t) :: contact
      type(interface_mesh_t) :: mesh

      model = two_blocks('C3D8', [3, 3, 2])
      call interface_from_sets(model, 'pad', 'top_pad', 'ground', contact, error=lib)
      call good(error, lib)
      if (allocated(error)) return
      mesh = measure_interface_mesh(model, contact)
      call check(error, abs(mesh%layer(1) - 0.5_wp*block_height) <= rounding .and. mesh%layer(2) <= 0.0_wp)
   end subroutine test_ground

end module test_fe_interface_mesh
