!> What the log and the result file say of half space and FE mesh: lines, warnings at their limits, the error estimate.
module test_cli_coupling_report
   use microslip_cli_coupling_report, only: check_mesh, report_estimate, report_mesh
   use microslip_cli_log, only: log_t
   use microslip_core_error, only: error_t
   use microslip_core_kinds, only: wp
   use microslip_core_warning_list, only: warning_list_t
   use microslip_fe_interface_mesh, only: interface_mesh_t
   use microslip_io_coupling_results, only: write_couplings
   use microslip_io_hdf5, only: hdf5_file_t
   use microslip_system_coupling_error, only: coupling_error_t
   use microslip_system_pad, only: pad_t
   use support_checks, only: good, remove
   use testdrive, only: check, new_unittest, testing_error => error_type, unittest_type
   implicit none(type, external)
   private

   public :: collect_cli_coupling_report

   character(len=*), parameter :: path = 'build/test_cli_coupling_report.h5'
   character(len=*), parameter :: warning = "interface 'joint': "

contains

   subroutine collect_cli_coupling_report(testsuite)
      type(unittest_type), allocatable, intent(out) :: testsuite(:)

      testsuite = [new_unittest('mesh and grid in the log', test_mesh), &
         & new_unittest('warnings where the mesh is too fine or its layer too thick', test_warnings), &
         & new_unittest('no demands in series, nothing without half space', test_other_pads), &
         & new_unittest('the error estimate in the log', test_estimate), &
         & new_unittest('the error estimate in the result file', test_file)]
   end subroutine collect_cli_coupling_report

   !> A pad with cells of 1.0 x 0.8 mm, split by scale.
   subroutine make_pad(pad)
      type(pad_t), intent(out) :: pad

      pad%contact%name = 'joint'
      pad%grid%dx = 1.0e-3_wp
      pad%grid%dy = 0.8e-3_wp
      allocate (pad%filter)
   end subroutine make_pad

   !> All lines that the reports put into the log, one after the other.
   function logged(pad, mesh, estimate) result(text)
      type(pad_t), intent(in) :: pad
      type(interface_mesh_t), intent(in), optional :: mesh
      type(coupling_error_t), intent(in), optional :: estimate
      character(len=:), allocatable :: text
      type(log_t) :: log
      type(warning_list_t) :: warnings
      character(len=400) :: line
      integer :: status

      open (newunit=log%unit, status='scratch', action='readwrite')
      if (present(mesh)) then
         call report_mesh(log, pad, mesh)
         call check_mesh(pad, mesh, warnings)
         call log%warnings(warnings)
      end if
      if (present(estimate)) call report_estimate(log, pad, estimate)
      rewind (log%unit)
      text = ''
      do
         read (log%unit, '(a)', iostat=status) line
         if (status /= 0) exit
         text = text//trim(line)//new_line('a')
      end do
      close (log%unit)
   end function logged

   subroutine test_mesh(error)
      type(testing_error), allocatable, intent(out) :: error
      type(pad_t) :: pad
      character(len=:), allocatable :: text

      call make_pad(pad)
      text = logged(pad, interface_mesh_t(3.0e-3_wp, [1.5e-3_wp, 2.25e-3_wp]))
      call check(error, index(text, "interface 'joint': FE nodes 3 mm apart (3 cells), first layer of elements 2.25 mm " &
         & //'(0.75 of that); coupling: split by scale') > 0 .and. index(text, 'warning') == 0, text)
   end subroutine test_mesh

   !> The limits are 2.5 of the wider cells and 1 node distance, of the thicker layer; they count as met.
   subroutine test_warnings(error)
      type(testing_error), allocatable, intent(out) :: error
      type(pad_t) :: pad
      character(len=:), allocatable :: text

      call make_pad(pad)
      text = logged(pad, interface_mesh_t(2.5e-3_wp, [2.5e-3_wp, 1.0e-3_wp]))
      call check(error, index(text, 'warning') == 0, 'at the limits: '//text)
      if (allocated(error)) return
      text = logged(pad, interface_mesh_t(2.4e-3_wp, [1.0e-3_wp, 2.4e-3_wp]))
      call check(error, index(text, warning//'the FE nodes are 2.4 cells apart') > 0 &
         & .and. index(text, 'first layer of elements is') == 0, 'cells: '//text)
      if (allocated(error)) return
      text = logged(pad, interface_mesh_t(4.0e-3_wp, [1.0e-3_wp, 6.0e-3_wp]))
      call check(error, index(text, warning//'the first layer of elements is 1.5 times as thick as its nodes are apart') > 0 .and. &
         & index(text, warning//'the FE nodes are') == 0, 'layer: '//text)
   end subroutine test_warnings

   subroutine test_other_pads(error)
      type(testing_error), allocatable, intent(out) :: error
      type(interface_mesh_t), parameter :: fine = interface_mesh_t(1.0e-3_wp, [5.0e-3_wp, 5.0e-3_wp])
      type(pad_t) :: pad
      character(len=:), allocatable :: text

      call make_pad(pad)
      deallocate (pad%filter)
      text = logged(pad, fine)
      call check(error, index(text, 'coupling: in series') > 0 .and. index(text, 'warning') == 0, &
         & 'series: '//text)
      if (allocated(error)) return
      pad%half_space = .false.
      call check(error, logged(pad, fine) == '', 'no half space')
   end subroutine test_other_pads

   subroutine test_estimate(error)
      type(testing_error), allocatable, intent(out) :: error
      type(pad_t) :: pad
      character(len=:), allocatable :: text

      call make_pad(pad)
      text = logged(pad, estimate=coupling_error_t(6.0e-3_wp, [0.067_wp, 0.063_wp, 0.11_wp]))
      call check(error, index(text, "interface 'joint': scale-split coupling against the half space on a disc of 6 mm radius: " &
         & //'deviation 6.7 % along n, 6.3 % along t1, 11 % along t2') > 0, text)
      if (allocated(error)) return
      text = logged(pad, estimate=coupling_error_t())
      call check(error, index(text, 'no room for a disc') > 0, text)
   end subroutine test_estimate

   !> Split by scale with and without room for the disc, in series, and at the FE nodes.
   subroutine test_file(error)
      type(testing_error), allocatable, intent(out) :: error
      real(wp), parameter :: deviation(3) = [0.067_wp, 0.063_wp, 0.11_wp]
      type(error_t), allocatable :: lib, ignored
      type(hdf5_file_t) :: file
      type(pad_t) :: pads(4)
      type(interface_mesh_t) :: meshes(4)
      type(coupling_error_t) :: estimates(4)
      character(len=:), allocatable :: kind(:), units
      real(wp), allocatable :: found(:), layer(:)
      real(wp) :: distance, radius
      integer :: k

      do k = 1, 4
         call make_pad(pads(k))
         meshes(k) = interface_mesh_t(3.0e-3_wp, [1.5e-3_wp, 0.0_wp])
      end do
      estimates(1) = coupling_error_t(6.0e-3_wp, deviation)
      deallocate (pads(3)%filter)
      pads(4)%half_space = .false.
      call file%create(path, lib)
      do k = 1, 4
         if (.not. allocated(lib)) call file%write('/interface_'//achar(iachar('0') + k)//'/friction', 0.5_wp, '1', 'group', lib)
      end do
      if (.not. allocated(lib)) call write_couplings(file, pads, meshes, estimates, lib)
      if (.not. allocated(lib)) call file%read('/interface_1/coupling/kind', kind, lib)
      if (.not. allocated(lib)) call file%read('/interface_1/coupling/node_distance', distance, lib)
      if (.not. allocated(lib)) call file%read('/interface_1/coupling/first_layer', layer, lib)
      if (.not. allocated(lib)) call file%read('/interface_1/coupling/error_estimate', found, lib)
      if (.not. allocated(lib)) call file%get_attribute('/interface_1/coupling/error_estimate', 'units', units, lib)
      if (.not. allocated(lib)) call file%read('/interface_2/coupling/disc_radius', radius, lib)
      call good(error, lib)
      if (.not. allocated(error)) call check(error, kind(1) == 'scale_split' .and. units == '1' .and. all(found == deviation) &
         & .and. distance == 3.0e-3_wp .and. all(layer == meshes(1)%layer), 'values')
      if (.not. allocated(error)) call check(error, radius == 0.0_wp .and. .not. file%has('/interface_2/coupling/error_estimate'), &
         & 'no room')
      if (.not. allocated(error)) call check(error, file%has('/interface_3/coupling/kind') .and. &
         & .not. file%has('/interface_3/coupling/disc_radius') .and. .not. file%has('/interface_4/coupling'), 'others')
      call file%close(ignored)
      call remove(path)
   end subroutine test_file

end module test_cli_coupling_report
