!> Reads a mesh: Abaqus/CalculiX input (.inp) or gmsh (.msh).
module microslip_io_mesh_file
   use microslip_core_error, only: error_t
   use microslip_core_text, only: lower_case
   use microslip_core_warning_list, only: warning_list_t
   use microslip_fe_model, only: fe_model_t
   use microslip_io_mesh_abaqus, only: read_mesh_abaqus
   use microslip_io_mesh_builder, only: mesh_builder_t
   use microslip_io_mesh_gmsh, only: read_mesh_gmsh
   implicit none(type, external)
   private

   public :: read_mesh

contains

   !> Read nodes (labels ascending), elements and node sets; a name ending in .msh means gmsh, any other Abaqus.
   subroutine read_mesh(path, model, warnings, error)
      !> Where the mesh is
      character(len=*), intent(in) :: path
      !> The mesh, in the file's unit of length; no matrices
      type(fe_model_t), intent(out) :: model
      !> What is doubtful about the file
      type(warning_list_t), intent(out) :: warnings
      type(error_t), allocatable, intent(out) :: error
      type(mesh_builder_t) :: builder

      if (lower_case(path(max(1, len(path) - 3):)) == '.msh') then
         call read_mesh_gmsh(path, builder, error)
      else
         call read_mesh_abaqus(path, builder, error)
      end if
      if (.not. allocated(error)) call builder%finish(path, model, error)
   end subroutine read_mesh

end module microslip_io_mesh_file
