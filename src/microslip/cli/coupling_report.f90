!> Half space and FE mesh of the interfaces in the log: how they go together, what the scale-split coupling asks of them,
!> and its estimate of its own error (doc/coupling.md).
module microslip_cli_coupling_report
   use microslip_cli_log, only: log_t
   use microslip_core_kinds, only: wp
   use microslip_core_text, only: to_text
   use microslip_core_warning_list, only: severity_doubtful, warning_list_t
   use microslip_fe_interface_mesh, only: interface_mesh_t
   use microslip_system_coupling_error, only: coupling_error_t
   use microslip_system_pad, only: pad_t
   implicit none(type, external)
   private

   public :: report_mesh, check_mesh, report_estimate

contains

   !> How the FE mesh and the grid go together.
   subroutine report_mesh(log, pad, mesh)
      type(log_t), intent(in) :: log
      type(pad_t), intent(in) :: pad
      type(interface_mesh_t), intent(in) :: mesh

      if (.not. pad%half_space) return
      call log%line("interface '"//pad%contact%name//"': FE nodes "//to_text(1.0e3_wp*mesh%spacing, 3)//' mm apart (' &
         & //to_text(spacing_in_cells(pad, mesh), 3)//' cells), first layer of elements ' &
         & //to_text(1.0e3_wp*maxval(mesh%layer), 3)//' mm ('//to_text(maxval(mesh%layer)/mesh%spacing, 3) &
         & //' of that); coupling: '//trim(merge('split by scale', 'in series     ', allocated(pad%filter))))
   end subroutine report_mesh

   !> FE node distance over cell width.
   pure real(wp) function spacing_in_cells(pad, mesh)
      type(pad_t), intent(in) :: pad
      type(interface_mesh_t), intent(in) :: mesh
      spacing_in_cells = mesh%spacing/max(pad%grid%dx, pad%grid%dy)
   end function spacing_in_cells

   !> Warnings where the scale-split coupling requires another mesh or another grid.
   subroutine check_mesh(pad, mesh, warnings)
      type(pad_t), intent(in) :: pad
      type(interface_mesh_t), intent(in) :: mesh
      type(warning_list_t), intent(inout) :: warnings
      !> FE node distance over cell width, at least; thickness of the first layer over FE node distance, at most
      real(wp), parameter :: coarse_enough = 2.5_wp, thin_enough = 1.0_wp
      !> Meshes are not built to the last digit.
      real(wp), parameter :: tolerance = 1.0e-3_wp
      real(wp) :: cells, layers
      character(len=:), allocatable :: place

      if (.not. allocated(pad%filter)) return
      place = "interface '"//pad%contact%name//"': "
      cells = spacing_in_cells(pad, mesh)
      layers = maxval(mesh%layer)/mesh%spacing
      if (cells < coarse_enough*(1.0_wp - tolerance)) call warnings%add(severity_doubtful, place//'the FE nodes are ' &
         & //to_text(cells, 3)//' cells apart, the scale-split coupling requires at least '//to_text(coarse_enough) &
         & //': refine the grid (nx, ny)')
      if (layers > thin_enough*(1.0_wp + tolerance)) call warnings%add(severity_doubtful, place//'the first layer of elements ' &
         & //'is '//to_text(layers, 3)//' times as thick as its nodes are apart, the scale-split coupling requires at most 1: ' &
         & //'make it thinner (0.6 is good)')
   end subroutine check_mesh

   !> The scale-split coupling's estimate of its own error.
   subroutine report_estimate(log, pad, estimate)
      type(log_t), intent(in) :: log
      type(pad_t), intent(in) :: pad
      type(coupling_error_t), intent(in) :: estimate
      character(len=:), allocatable :: place

      place = "interface '"//pad%contact%name//"': scale-split coupling"
      if (estimate%radius > 0.0_wp) then
         call log%line(place//' against the half space on a disc of '//to_text(1.0e3_wp*estimate%radius, 3) &
            & //' mm radius: deviation '//to_text(1.0e2_wp*estimate%deviation(1), 2)//' % along n, ' &
            & //to_text(1.0e2_wp*estimate%deviation(2), 2)//' % along t1, ' &
            & //to_text(1.0e2_wp*estimate%deviation(3), 2)//' % along t2')
      else
         call log%line(place//': the pad has no room for a disc of three FE node distances, no estimate of its error')
      end if
   end subroutine report_estimate

end module microslip_cli_coupling_report
