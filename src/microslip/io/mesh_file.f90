!> Reads a mesh: Abaqus/CalculiX input (.inp) or gmsh (.msh). What the file holds decides, not its name.
module microslip_io_mesh_file
   use microslip_core_error, only: bad_input, error_t
   use microslip_core_warning_list, only: warning_list_t
   use microslip_fe_model, only: fe_model_t
   use microslip_io_mesh_abaqus, only: read_mesh_abaqus
   use microslip_io_mesh_builder, only: mesh_builder_t
   use microslip_io_mesh_format, only: format_gmsh, format_unknown, readable_meshes, tell_mesh_format
   use microslip_io_mesh_gmsh, only: read_mesh_gmsh
   implicit none(type, external)
   private

   public :: read_mesh

contains

   !> Read nodes (labels ascending), elements and node sets.
   subroutine read_mesh(path, model, warnings, error)
      !> Where the mesh is
      character(len=*), intent(in) :: path
      !> The mesh, in the file's unit of length; no matrices
      type(fe_model_t), intent(out) :: model
      !> What is doubtful about the file
      type(warning_list_t), intent(out) :: warnings
      type(error_t), allocatable, intent(out) :: error
      type(mesh_builder_t) :: builder
      integer :: format

      call tell_mesh_format(path, format, error)
      if (allocated(error)) return
      call builder%start()
      if (format == format_gmsh) then
         call read_mesh_gmsh(path, builder, error)
      else
         call read_mesh_abaqus(path, builder, error)
         if (.not. allocated(error) .and. builder%nodes == 0 .and. format == format_unknown) call bad_input(error, path// &
            ': format not known, there is no *NODE card; '//readable_meshes)
      end if
      if (.not. allocated(error)) call builder%finish(path, model, error)
      warnings = builder%warnings
   end subroutine read_mesh

end module microslip_io_mesh_file
