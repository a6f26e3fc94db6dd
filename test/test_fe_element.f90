!> Faces of bricks: orientation, mid-side nodes, surface of a mesh.
module test_fe_element
   use microslip_core_kinds, only: wp
   use microslip_fe_element, only: element_faces, faces_within, surface_faces, twin_faces, area_vector, shortest_edge
   use microslip_fe_model, only: fe_model_t
   use support_mesh, only: two_blocks, pad_size, block_height
   use testdrive, only: new_unittest, unittest_type, error_type, check
   implicit none(type, external)
   private

   public :: collect_fe_element

   real(wp), parameter :: rounding = 100*epsilon(1.0_wp)

contains

   subroutine collect_fe_element(testsuite)
      type(unittest_type), allocatable, intent(out) :: testsuite(:)
      testsuite = [new_unittest('faces_point_outward', test_outward), &
                   new_unittest('midside_nodes_between_corners', test_midsides), &
                   new_unittest('surface_of_two_blocks', test_surface), &
                   new_unittest('unknown_type_has_no_faces', test_unknown)]
   end subroutine collect_fe_element

   subroutine test_outward(error)
      type(error_type), allocatable, intent(out) :: error
      type(fe_model_t) :: model
      integer, allocatable :: faces(:, :)
      real(wp) :: middle(3), total(3)
      integer :: e, f

      model = two_blocks('C3D8I', [1, 1, 1])
      faces = element_faces('C3D8I')
      call check(error, size(faces, 2), 6)
      if (allocated(error)) return
      do e = 1, 2
         total = 0.0_wp
         associate (x => model%coordinates(:, model%elements(1)%connectivity(:, e)))
            middle = sum(x, dim=2)/8
            do f = 1, 6
               total = total + area_vector(x(:, faces(:4, f)))
               call check(error, dot_product(area_vector(x(:, faces(:4, f))), &
                                             sum(x(:, faces(:4, f)), dim=2)/4 - middle) > 0.0_wp)
               if (allocated(error)) return
            end do
         end associate
         call check(error, norm2(total) <= rounding*product(pad_size), 'closed surface')
         if (allocated(error)) return
      end do
   end subroutine test_outward

   subroutine test_midsides(error)
      type(error_type), allocatable, intent(out) :: error
      type(fe_model_t) :: model
      integer, allocatable :: faces(:, :)
      real(wp) :: halfway(3)
      integer :: f, k

      model = two_blocks('C3D20R', [1, 1, 1])
      faces = element_faces('C3D20R')
      associate (x => model%coordinates(:, model%elements(1)%connectivity(:, 1)))
         do f = 1, 6
            do k = 1, 4
               halfway = 0.5_wp*(x(:, faces(k, f)) + x(:, faces(1 + mod(k, 4), f)))
               call check(error, norm2(x(:, faces(4 + k, f)) - halfway) <= rounding*maxval(pad_size))
               if (allocated(error)) return
            end do
         end do
      end associate
   end subroutine test_midsides

   subroutine test_surface(error)
      type(error_type), allocatable, intent(out) :: error
      integer, parameter :: cells(3) = [4, 3, 2]
      type(fe_model_t) :: model
      integer, allocatable :: faces(:, :), twin(:)
      logical, allocatable :: selected(:)
      real(wp) :: area
      integer :: surface, f

      model = two_blocks('C3D20', cells, distortion=0.3_wp)
      allocate (selected(model%node_count()), source=.true.)
      faces = faces_within(model%elements, selected)
      twin = twin_faces(faces)
      surface = 4*(cells(1)*cells(2) + cells(1)*cells(3) + cells(2)*cells(3))
      call check(error, size(faces, 2), 12*product(cells))
      if (.not. allocated(error)) call check(error, count(twin == 0), surface)
      if (allocated(error)) return
      do f = 1, size(twin)
         if (twin(f) == 0) cycle
         call check(error, twin(twin(f)), f)
         if (allocated(error)) return
      end do
      faces = surface_faces(model%elements, selected)
      area = sum([(norm2(area_vector(model%coordinates(:, faces(:4, f)))), f=1, size(faces, 2))])
      call check(error, area, 4*(product(pad_size) + sum(pad_size)*block_height), thr=rounding)
      if (allocated(error)) return
      call check(error, shortest_edge(model%coordinates, faces) <= block_height/cells(3)*(1 + rounding))
   end subroutine test_surface

   subroutine test_unknown(error)
      type(error_type), allocatable, intent(out) :: error
      call check(error, size(element_faces('C3D4'), 2), 0)
   end subroutine test_unknown

end module test_fe_element
