!> Contact interfaces from node sets and planes: pairs, frame, faces, and what is refused.
module test_fe_interface
   use microslip_core_error, only: error_t, status_bad_input
   use microslip_core_kinds, only: wp
   use microslip_core_text, only: to_text
   use microslip_fe_interface, only: contact_interface_t, interface_from_sets, interface_from_plane
   use microslip_fe_model, only: fe_model_t
   use support_mesh, only: two_blocks, pad_size, block_height, turn
   use testdrive, only: new_unittest, unittest_type, error_type, check
   implicit none(type, external)
   private

   public :: collect_fe_interface

   real(wp), parameter :: rounding = 100*epsilon(1.0_wp)
   real(wp), parameter :: z_axis(3) = [0.0_wp, 0.0_wp, 1.0_wp], origin(3) = 0.0_wp

contains

   subroutine collect_fe_interface(testsuite)
      type(unittest_type), allocatable, intent(out) :: testsuite(:)
      testsuite = [new_unittest('pairs_of_shuffled_nodes', test_pairs), &
                   new_unittest('any_orientation', test_rotated), &
                   new_unittest('faces_fill_the_pad', test_faces), &
                   new_unittest('swapped_sides_turn_the_normal', test_swapped), &
                   new_unittest('axes_and_origin_on_request', test_axes), &
                   new_unittest('rigid_ground', test_ground), &
                   new_unittest('plane_equals_sets', test_plane), &
                   new_unittest('plane_in_a_region', test_region), &
                   new_unittest('solid_material_is_no_interface', test_solid), &
                   new_unittest('wrong_sets_are_refused', test_wrong_sets), &
                   new_unittest('merged_joints_are_named', test_merged), &
                   new_unittest('faces_without_shape_functions', test_unsupported_faces), &
                   new_unittest('wrong_pairs_are_refused', test_wrong_pairs), &
                   new_unittest('wrong_shape_is_refused', test_wrong_shape), &
                   new_unittest('wrong_directions_are_refused', test_wrong_directions)]
   end subroutine collect_fe_interface

   subroutine test_pairs(error)
      type(error_type), allocatable, intent(out) :: error
      type(fe_model_t) :: model
      type(contact_interface_t) :: contact
      type(error_t), allocatable :: failed
      real(wp), allocatable :: expected(:, :)

      model = two_blocks('C3D20', [25, 20, 1], hole=.true., distortion=0.3_wp)
      call interface_from_sets(model, 'pad', 'TOP_pad', 'bottom_pad', contact, error=failed)
      call check(error,.not. allocated(failed))
      if (allocated(error)) return
      ! Corners, edges, less what only the missing face has: nothing
      call check(error, contact%pair_count(), 26*21 + 25*21 + 26*20)
      if (allocated(error)) return
      call check(error, maxval(norm2(model%coordinates(:, contact%node_a) &
                                     - model%coordinates(:, contact%node_b), dim=1)) <= rounding)
      if (.not. allocated(error)) call check(error, all(contact%node_a /= contact%node_b))
      if (.not. allocated(error)) call check(error, &
         maxval(abs(contact%frame - reshape([0, 0, 1, 1, 0, 0, 0, 1, 0], [3, 3]))) <= rounding)
      if (allocated(error)) return
      expected = model%coordinates(:2, contact%node_a) - spread(0.5_wp*pad_size, 2, contact%pair_count())
      call check(error, maxval(abs(contact%position - expected)) <= rounding)
   end subroutine test_pairs

   subroutine test_rotated(error)
      type(error_type), allocatable, intent(out) :: error
      type(fe_model_t) :: model
      type(contact_interface_t) :: contact
      type(error_t), allocatable :: failed
      real(wp), allocatable :: rebuilt(:, :)
      integer :: k

      model = two_blocks('C3D8', [5, 4, 1], distortion=0.2_wp, rotation=turn())
      call interface_from_sets(model, 'pad', 'top_pad', 'bottom_pad', contact, error=failed)
      call check(error,.not. allocated(failed))
      if (allocated(error)) return
      associate (r => contact%frame)
         call check(error, norm2(r(:, 1) - matmul(turn(), z_axis)) <= rounding, 'normal from B to A')
         if (.not. allocated(error)) call check(error, &
            norm2(matmul(transpose(r), r) - reshape([1, 0, 0, 0, 1, 0, 0, 0, 1], [3, 3])) <= rounding, 'orthonormal')
         if (.not. allocated(error)) call check(error, r(1, 2) > 0.0_wp .and. abs(r(1, 3)) <= rounding, &
                                                't1 is x projected, t2 is normal to x')
         if (allocated(error)) return
         rebuilt = spread(contact%origin, 2, contact%pair_count()) + matmul(r(:, 2:), contact%position)
      end associate
      call check(error, maxval(abs(rebuilt - model%coordinates(:, contact%node_a))) <= rounding)
      if (.not. allocated(error)) call check(error, &
         maxval(abs([(minval(contact%position(k, :)) + maxval(contact%position(k, :)), k=1, 2)])) <= rounding)
      if (.not. allocated(error)) call check(error, pad_area(contact), product(pad_size), thr=rounding)
   end subroutine test_rotated

   !> Sum of the signed areas of the faces: positive where they run counter-clockwise.
   pure real(wp) function pad_area(contact)
      type(contact_interface_t), intent(in) :: contact
      integer :: f
      pad_area = 0.0_wp
      do f = 1, size(contact%faces, 2)
         pad_area = pad_area + signed_area(contact%position(:, contact%faces(:4, f)))
      end do
   end function pad_area

   pure real(wp) function signed_area(x)
      real(wp), intent(in) :: x(2, 4)
      signed_area = 0.5_wp*((x(1, 3) - x(1, 1))*(x(2, 4) - x(2, 2)) - (x(1, 4) - x(1, 2))*(x(2, 3) - x(2, 1)))
   end function signed_area

   subroutine test_faces(error)
      type(error_type), allocatable, intent(out) :: error
      type(fe_model_t) :: model
      type(contact_interface_t) :: contact
      type(error_t), allocatable :: failed
      real(wp) :: halfway(2)
      integer :: f, k

      model = two_blocks('C3D20R', [5, 3, 2], hole=.true.)
      call interface_from_sets(model, 'pad', 'top_pad', 'bottom_pad', contact, error=failed)
      call check(error,.not. allocated(failed))
      if (.not. allocated(error)) call check(error, size(contact%faces, 2), 14)
      if (.not. allocated(error)) call check(error, pad_area(contact), product(pad_size)*14/15, thr=rounding)
      if (allocated(error)) return
      do f = 1, 14
         do k = 1, 4
            halfway = 0.5_wp*(contact%position(:, contact%faces(k, f)) &
                              + contact%position(:, contact%faces(1 + mod(k, 4), f)))
            call check(error, norm2(contact%position(:, contact%faces(4 + k, f)) - halfway) <= rounding)
            if (allocated(error)) return
         end do
         call check(error, signed_area(contact%position(:, contact%faces(:4, f))) > 0.0_wp)
         if (allocated(error)) return
      end do
   end subroutine test_faces

   subroutine test_swapped(error)
      type(error_type), allocatable, intent(out) :: error
      type(fe_model_t) :: model
      type(contact_interface_t) :: contact
      type(error_t), allocatable :: failed

      model = two_blocks('C3D8I', [3, 2, 1])
      call interface_from_sets(model, 'pad', 'bottom_pad', 'top_pad', contact, error=failed)
      call check(error,.not. allocated(failed))
      if (.not. allocated(error)) call check(error, norm2(contact%frame(:, 1) + z_axis) <= rounding)
      if (.not. allocated(error)) call check(error, pad_area(contact), product(pad_size), thr=rounding)
      if (allocated(error)) return
      ! Without elements on side A the faces come from side B and the normal is the same
      model%elements(1)%connectivity = model%elements(1)%connectivity(:, :6)
      call interface_from_sets(model, 'pad', 'bottom_pad', 'top_pad', contact, error=failed)
      call check(error,.not. allocated(failed))
      if (.not. allocated(error)) call check(error, norm2(contact%frame(:, 1) + z_axis) <= rounding)
      if (.not. allocated(error)) call check(error, pad_area(contact), product(pad_size), thr=rounding)
   end subroutine test_swapped

   subroutine test_axes(error)
      type(error_type), allocatable, intent(out) :: error
      real(wp), parameter :: given_tangent(3) = [0.0_wp, 2.0_wp, 0.7_wp], given_origin(3) = [0.01_wp, 0.02_wp, 0.3_wp]
      type(fe_model_t) :: model
      type(contact_interface_t) :: contact
      type(error_t), allocatable :: failed

      model = two_blocks('C3D8', [3, 2, 1])
      call interface_from_sets(model, 'pad', 'top_pad', 'bottom_pad', contact, 3*z_axis, given_tangent, given_origin, failed)
      call check(error,.not. allocated(failed))
      if (.not. allocated(error)) call check(error, &
         maxval(abs(contact%frame - reshape([0, 0, 1, 0, 1, 0, -1, 0, 0], [3, 3]))) <= rounding)
      if (.not. allocated(error)) call check(error, norm2(contact%origin - [0.01_wp, 0.02_wp, 0.0_wp]) <= rounding)
      if (.not. allocated(error)) call check(error, &
         maxval(abs(contact%position(1, :) - (model%coordinates(2, contact%node_a) - 0.02_wp))) <= rounding)
      if (.not. allocated(error)) call check(error, &
         maxval(abs(contact%position(2, :) + (model%coordinates(1, contact%node_a) - 0.01_wp))) <= rounding)
   end subroutine test_axes

   subroutine test_ground(error)
      type(error_type), allocatable, intent(out) :: error
      type(fe_model_t) :: model
      type(contact_interface_t) :: contact
      type(error_t), allocatable :: failed

      model = two_blocks('C3D8', [3, 2, 1])
      call interface_from_sets(model, 'foot', 'bottom_end', 'Ground', contact, error=failed)
      call check(error,.not. allocated(failed))
      if (.not. allocated(error)) call check(error, all(contact%node_b == 0) .and. size(contact%node_b) == 12)
      if (.not. allocated(error)) call check(error, norm2(contact%frame(:, 1) - z_axis) <= rounding)
      if (.not. allocated(error)) call check(error, contact%origin(3), -block_height, thr=rounding)
      if (.not. allocated(error)) call check(error, pad_area(contact), product(pad_size), thr=rounding)
   end subroutine test_ground

   subroutine test_plane(error)
      type(error_type), allocatable, intent(out) :: error
      type(fe_model_t) :: model
      type(contact_interface_t) :: sets, plane
      type(error_t), allocatable :: failed

      model = two_blocks('C3D20', [5, 5, 2], hole=.true., distortion=0.3_wp, rotation=turn())
      call interface_from_sets(model, 'pad', 'top_pad', 'bottom_pad', sets, error=failed)
      call check(error,.not. allocated(failed))
      if (allocated(error)) return
      call interface_from_plane(model, 'pad', origin, 2*matmul(turn(), z_axis), plane, error=failed)
      call check(error,.not. allocated(failed))
      if (allocated(error)) return
      call check(error, all(plane%node_a == sets%node_a) .and. all(plane%node_b == sets%node_b))
      if (.not. allocated(error)) call check(error, all(plane%faces == sets%faces))
      if (.not. allocated(error)) call check(error, maxval(abs(plane%frame - sets%frame)) <= rounding)
      if (.not. allocated(error)) call check(error, maxval(abs(plane%position - sets%position)) <= rounding)
      if (allocated(error)) return
      ! The other way round: sides swapped
      call interface_from_plane(model, 'pad', origin, -matmul(turn(), z_axis), plane, error=failed)
      call check(error,.not. allocated(failed))
      if (.not. allocated(error)) call check(error, all(is_in(plane%node_a) .eqv. is_in(sets%node_b)))

   contains

      function is_in(nodes) result(inside)
         integer, intent(in) :: nodes(:)
         logical :: inside(model%node_count())
         inside = .false.
         inside(nodes) = .true.
      end function is_in

   end subroutine test_plane

   subroutine test_region(error)
      type(error_type), allocatable, intent(out) :: error
      type(fe_model_t) :: model
      type(contact_interface_t) :: contact
      type(error_t), allocatable :: failed

      model = two_blocks('C3D8', [5, 3, 1])
      call interface_from_plane(model, 'left', origin, z_axis, contact, error=failed, &
         region=reshape([-1.0_wp, -1.0_wp, -1.0_wp, 0.025_wp, 1.0_wp, 1.0_wp], [3, 2]))
      call check(error,.not. allocated(failed))
      if (.not. allocated(error)) call check(error, contact%pair_count(), 3*4)
      if (.not. allocated(error)) call check(error, contact%origin(1), 0.01_wp, thr=rounding)
      if (allocated(error)) return
      call interface_from_plane(model, 'left', origin, z_axis, contact, error=failed, &
         region=reshape([-1.0_wp, -1.0_wp, -1.0_wp, -0.5_wp, 1.0_wp, 1.0_wp], [3, 2]))
      call expect(error, failed, '(0 nodes)')
   end subroutine test_region

   subroutine test_solid(error)
      type(error_type), allocatable, intent(out) :: error
      type(fe_model_t) :: model
      type(contact_interface_t) :: contact
      type(error_t), allocatable :: failed

      model = two_blocks('C3D8', [3, 2, 2])
      call interface_from_plane(model, 'mid', [0.0_wp, 0.0_wp, 0.5_wp*block_height], z_axis, contact, error=failed)
      call expect(error, failed, '0 free element faces')
      if (allocated(error)) return
      call interface_from_plane(model, 'mid', origin, 0*z_axis, contact, error=failed)
      call expect(error, failed, 'no length')
   end subroutine test_solid

   !> The failure is wrong input, and its message names the place.
   subroutine expect(error, failed, words)
      type(error_type), allocatable, intent(out) :: error
      type(error_t), allocatable, intent(in) :: failed
      character(len=*), intent(in) :: words

      call check(error, allocated(failed), 'refused: '//words)
      if (.not. allocated(error)) call check(error, failed%status, status_bad_input)
      if (.not. allocated(error)) call check(error, index(failed%message, words) > 0, failed%message)
   end subroutine expect

   subroutine test_wrong_sets(error)
      type(error_type), allocatable, intent(out) :: error
      type(fe_model_t) :: model
      type(contact_interface_t) :: contact
      type(error_t), allocatable :: failed

      model = two_blocks('C3D8', [3, 2, 1])
      call interface_from_sets(model, 'pad', 'top_pda', 'bottom_pad', contact, error=failed)
      call expect(error, failed, "interface 'pad': there is no node set 'top_pda'; the model has 'top_pad', 'bottom_pad'")
      if (allocated(error)) return
      call interface_from_sets(model, 'pad', 'top_pad', 'empty', contact, error=failed)
      call expect(error, failed, "'empty' is empty")
      if (allocated(error)) return
      deallocate (model%elements)
      call interface_from_sets(model, 'pad', 'top_pad', 'bottom_pad', contact, error=failed)
      call expect(error, failed, 'no face')
      if (allocated(error)) return
      deallocate (model%node_sets)
      call interface_from_sets(model, 'pad', 'top_pad', 'bottom_pad', contact, error=failed)
      call expect(error, failed, 'no node sets')
   end subroutine test_wrong_sets

   !> Joints whose two sides are one: all nodes shared, and nodes in the middle of a body.
   subroutine test_merged(error)
      type(error_type), allocatable, intent(out) :: error
      type(fe_model_t) :: model
      type(contact_interface_t) :: contact
      type(error_t), allocatable :: failed
      integer, allocatable :: partner(:)
      integer :: k

      model = two_blocks('C3D8', [3, 2, 1])
      call interface_from_sets(model, 'pad', 'top_pad', 'bottom_pad', contact, error=failed)
      call check(error, .not. allocated(failed))
      if (allocated(error)) return
      allocate (partner(model%node_count()))
      partner = [(k, k=1, size(partner))]
      partner(contact%node_b) = contact%node_a
      do k = 1, size(model%elements)
         model%elements(k)%connectivity = reshape(partner(pack(model%elements(k)%connectivity, .true.)), &
            shape(model%elements(k)%connectivity))
      end do
      model%node_sets(2)%nodes = model%node_sets(1)%nodes
      call interface_from_sets(model, 'pad', 'top_pad', 'bottom_pad', contact, error=failed)
      call expect(error, failed, 'both sides share 12 of the 12 nodes of side B')
      if (.not. allocated(error)) call expect(error, failed, 'the joint is merged in the mesh')
      if (allocated(error)) return
      call interface_from_sets(model, 'pad', 'top_pad', 'ground', contact, error=failed)
      call expect(error, failed, '6 faces there lie between two elements, the joint is merged in the mesh')
      if (allocated(error)) return
      call interface_from_plane(model, 'pad', [0.0_wp, 0.0_wp, 0.0_wp], [0.0_wp, 0.0_wp, 1.0_wp], contact, error=failed)
      call expect(error, failed, '6 faces there lie between two elements, the joint is merged in the mesh')
   end subroutine test_merged

   !> A tetrahedron with a face in a joint, and two bodies on one side of it.
   subroutine test_unsupported_faces(error)
      type(error_type), allocatable, intent(out) :: error
      type(fe_model_t) :: model, good
      type(contact_interface_t) :: contact
      type(error_t), allocatable :: failed

      good = two_blocks('C3D8', [3, 2, 1])
      model = good
      allocate (model%other_elements(1))
      model%other_elements(1)%type = 'C3D4'
      model%other_elements(1)%connectivity = reshape([model%node_sets(1)%nodes(:3), model%node_sets(3)%nodes(1)], [4, 1])
      call interface_from_sets(model, 'pad', 'top_pad', 'bottom_pad', contact, error=failed)
      call expect(error, failed, 'C3D4 faces at joints are not supported yet')
      if (.not. allocated(error)) call expect(error, failed, "1 of C3D4 in the node set 'top_pad'")
      if (allocated(error)) return
      call interface_from_plane(model, 'pad', [0.0_wp, 0.0_wp, 0.0_wp], [0.0_wp, 0.0_wp, 1.0_wp], contact, error=failed)
      call expect(error, failed, 'C3D4 faces at joints are not supported yet')
      if (allocated(error)) return
      model = good
      ! The upper block as it is, and once more from other nodes.
      model%coordinates(3, :) = abs(model%coordinates(3, :))
      call interface_from_sets(model, 'pad', 'top_pad', 'bottom_pad', contact, error=failed)
      call check(error, .not. allocated(failed), 'a mirrored block has faces that point inward')
      if (allocated(error)) return
      model%elements(1)%connectivity(:, 7:) = model%elements(1)%connectivity([5, 6, 7, 8, 1, 2, 3, 4], 7:)
      call interface_from_sets(model, 'pad', 'top_pad', 'bottom_pad', contact, error=failed)
      call expect(error, failed, 'point the same way')
   end subroutine test_unsupported_faces

   subroutine test_wrong_pairs(error)
      type(error_type), allocatable, intent(out) :: error
      type(fe_model_t) :: model, good
      type(contact_interface_t) :: contact
      type(error_t), allocatable :: failed
      integer :: node

      good = two_blocks('C3D8', [3, 2, 1])
      model = good
      node = model%node_sets(2)%nodes(3)
      model%coordinates(1, node) = model%coordinates(1, node) + 1.0e-3_wp
      call interface_from_sets(model, 'pad', 'top_pad', 'bottom_pad', contact, error=failed)
      call expect(error, failed, 'node '//to_text(model%node_label(node))//' at')
      if (.not. allocated(error)) call expect(error, failed, '0.001 m away')
      if (allocated(error)) return
      model = good
      model%node_sets(2)%nodes = model%node_sets(2)%nodes(2:)
      call interface_from_sets(model, 'pad', 'top_pad', 'bottom_pad', contact, error=failed)
      call expect(error, failed, 'side A has 12 nodes and side B 11; 1 of side A have no partner')
      if (allocated(error)) return
      call interface_from_sets(model, 'pad', 'bottom_pad', 'top_pad', contact, error=failed)
      call expect(error, failed, '1 of side B have no partner')
      if (allocated(error)) return
      model = good
      model%node_sets(2)%nodes(4) = model%node_sets(1)%nodes(4)
      call interface_from_sets(model, 'pad', 'top_pad', 'bottom_pad', contact, error=failed)
      call expect(error, failed, 'both sides share')
      if (allocated(error)) return
      model = good
      model%node_sets(1)%nodes = [model%node_sets(1)%nodes, model%node_sets(3)%nodes(1)]
      model%coordinates(:, model%node_sets(3)%nodes(1)) = model%coordinates(:, model%node_sets(1)%nodes(1))
      call interface_from_sets(model, 'pad', 'top_pad', 'bottom_pad', contact, error=failed)
      call expect(error, failed, 'lie at the same place')
   end subroutine test_wrong_pairs

   subroutine test_wrong_shape(error)
      type(error_type), allocatable, intent(out) :: error
      type(fe_model_t) :: model
      type(contact_interface_t) :: contact
      type(error_t), allocatable :: failed
      integer :: node, k

      model = two_blocks('C3D8', [3, 2, 2])
      node = model%node_sets(1)%nodes(5)
      model%coordinates(3, node) = 0.1_wp*block_height
      call interface_from_sets(model, 'pad', 'top_pad', 'bottom_pad', contact, error=failed)
      call expect(error, failed, 'not plane: node '//to_text(model%node_label(node)))
      if (allocated(error)) return
      model = two_blocks('C3D8', [3, 2, 2])
      model%node_sets(5)%nodes = [(k, k=1, model%node_count())]
      call interface_from_sets(model, 'pad', 'empty', 'ground', contact, error=failed)
      call expect(error, failed, 'do not point one way')
      if (allocated(error)) return
      node = model%node_sets(1)%nodes(2)
      call move_out_of_faces(model, node)
      call interface_from_sets(model, 'pad', 'top_pad', 'ground', contact, error=failed)
      call expect(error, failed, 'nodes lie on no element face')
   end subroutine test_wrong_shape

   !> Take the elements with a node out of the mesh.
   subroutine move_out_of_faces(model, node)
      type(fe_model_t), intent(inout) :: model
      integer, intent(in) :: node
      integer :: e

      associate (block => model%elements(1))
         block%connectivity = block%connectivity(:, pack([(e, e=1, size(block%connectivity, 2))], &
                                                         [(all(block%connectivity(:, e) /= node), &
                                                           e=1, size(block%connectivity, 2))]))
      end associate
   end subroutine move_out_of_faces

   subroutine test_wrong_directions(error)
      type(error_type), allocatable, intent(out) :: error
      type(fe_model_t) :: model
      type(contact_interface_t) :: contact
      type(error_t), allocatable :: failed

      model = two_blocks('C3D8', [3, 2, 1])
      call interface_from_sets(model, 'pad', 'top_pad', 'bottom_pad', contact, normal=-z_axis, error=failed)
      call expect(error, failed, 'does not point from side B to side A')
      if (allocated(error)) return
      call interface_from_sets(model, 'pad', 'top_pad', 'bottom_pad', contact, tangent=-z_axis, error=failed)
      call expect(error, failed, 'no part in the plane')
   end subroutine test_wrong_directions

end module test_fe_interface
