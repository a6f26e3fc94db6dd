!> How fine the FE mesh is at an interface: distance of the nodes in its plane, and thickness of the first layer of elements.
module microslip_fe_interface_mesh
   use microslip_core_kinds, only: wp
   use microslip_fe_element, only: element_faces, face_size
   use microslip_fe_interface, only: contact_interface_t
   use microslip_fe_model, only: fe_model_t
   implicit none(type, external)
   private

   public :: interface_mesh_t, measure_interface_mesh

   !> Lengths are from node to node: half of an element with mid-side nodes.
   type :: interface_mesh_t
      !> Mean distance of the nodes in the plane, sqrt(area/number) of the faces, m
      real(wp) :: spacing = 0.0_wp
      !> Mean thickness of the first layer of bodies A and B, m; 0: there is no body
      real(wp) :: layer(2) = 0.0_wp
   end type interface_mesh_t

contains

   !> Measure the mesh at an interface.
   pure function measure_interface_mesh(model, contact) result(mesh)
      type(fe_model_t), intent(in) :: model
      type(contact_interface_t), intent(in) :: contact
      type(interface_mesh_t) :: mesh
      real(wp) :: area
      integer :: f, patches

      area = 0.0_wp
      patches = 0
      do f = 1, size(contact%faces, 2)
         area = area + face_area(contact%position(:, contact%faces(:4, f)))
         patches = patches + merge(4, 1, face_size(contact%faces(:, f)) == 8)
      end do
      mesh%spacing = sqrt(area/max(1, patches))
      mesh%layer(1) = layer_thickness(model, contact, contact%node_a)
      mesh%layer(2) = layer_thickness(model, contact, contact%node_b)
   end function measure_interface_mesh

   !> Area of a quadrilateral, m^2.
   pure real(wp) function face_area(corners)
      !> (2, 4) m
      real(wp), intent(in) :: corners(:, :)

      associate (a => corners(:, 3) - corners(:, 1), b => corners(:, 4) - corners(:, 2))
         face_area = 0.5_wp*abs(a(1)*b(2) - a(2)*b(1))
      end associate
   end function face_area

   !> Mean distance from the plane of the corners that lie across from the faces of one side.
   pure real(wp) function layer_thickness(model, contact, nodes)
      type(fe_model_t), intent(in) :: model
      type(contact_interface_t), intent(in) :: contact
      !> Of one side; 0: rigid ground
      integer, intent(in) :: nodes(:)
      logical :: on_side(0:model%node_count())
      integer, allocatable :: table(:, :)
      real(wp) :: total
      integer :: block, element, f, k, elements, corner

      on_side = .false.
      on_side(nodes) = .true.
      on_side(0) = .false.
      total = 0.0_wp
      elements = 0
      do block = 1, size(model%elements)
         table = element_faces(model%elements(block)%type)
         do element = 1, size(model%elements(block)%connectivity, 2)
            associate (own => model%elements(block)%connectivity(:, element))
               do f = 1, size(table, 2)
                  k = face_size(table(:, f))
                  if (.not. all(on_side(own(table(:k, f))))) cycle
                  elements = elements + 1
                  do corner = 1, 8
                     total = total + merge(0.25_wp, 0.125_wp, k == 4)*abs(dot_product(contact%frame(:, 1), &
                        & model%coordinates(:, own(corner)) - contact%origin))
                  end do
               end do
            end associate
         end do
      end do
      layer_thickness = total/max(1, elements)
   end function layer_thickness

end module microslip_fe_interface_mesh
