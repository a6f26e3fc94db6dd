!> The bodies of an FE model and their motions as a whole: elements that share nodes make a body.
!>
!> Rigid motions u: three translations, three rotations about the centre of mass; the other bodies and supported rows are at
!> rest. sqrt(u^T K u/u^T M u) tells whether a body is held: by supports it is high, by springs or nothing low.
module microslip_fe_bodies
   use microslip_core_kinds, only: wp, pi
   use microslip_fe_model, only: fe_model_t
   use microslip_fe_reduced_model, only: body_mass_t
   use microslip_linalg_sparse_algebra, only: multiply_many
   implicit none(type, external)
   private

   public :: find_bodies, bodies_of

contains

   !> Bodies of a model, their rigid motions' inertia forces M u (rows, 6 bodies), and how they are held.
   subroutine find_bodies(model, bodies, inertia)
      type(fe_model_t), intent(in) :: model
      type(body_mass_t), allocatable, intent(out) :: bodies(:)
      real(wp), allocatable, intent(out) :: inertia(:, :)
      integer, allocatable :: body(:)
      real(wp), allocatable :: u(:, :), force(:, :)
      integer :: k, r

      body = bodies_of(model)
      allocate (bodies(maxval([0, body])))
      allocate (inertia(model%row_count(), 6*size(bodies)))
      allocate (force(model%row_count(), 6))
      do k = 1, size(bodies)
         bodies(k)%nodes = count(body == k)
         bodies(k)%first_label = minval(model%node_label, body == k)
         u = rigid_motions(model, body == k)
         call multiply_many(model%mass, u, force)
         bodies(k)%inertia = [(dot_product(u(:, r), force(:, r)), r=1, 6)]
         inertia(:, 6*k - 5:6*k) = force
         call multiply_many(model%stiffness, u, force)
         do r = 1, 6
            if (bodies(k)%inertia(r) > 0.0_wp) bodies(k)%frequency(r) = &
               & sqrt(max(0.0_wp, dot_product(u(:, r), force(:, r)))/bodies(k)%inertia(r))/(2.0_wp*pi)
         end do
      end do
   end subroutine find_bodies

   !> Three translations and three rotations about the centre of mass, (rows, 6), m and rad.
   function rigid_motions(model, inside) result(u)
      type(fe_model_t), intent(in) :: model
      logical, intent(in) :: inside(:)
      real(wp), allocatable :: u(:, :), nodal(:)
      real(wp) :: centre(3), x(3)
      integer :: k, c

      allocate (u(model%row_count(), 6), nodal(model%row_count()))
      u = 0.0_wp
      do k = 1, size(u, 1)
         if (inside(model%row_node(k))) u(k, model%row_component(k)) = 1.0_wp
      end do
      centre = 0.0_wp
      do c = 1, 3
         call model%mass%multiply(u(:, c), nodal)
         if (.not. sum(nodal*u(:, c)) > 0.0_wp) cycle
         centre(c) = sum(nodal*u(:, c)*model%coordinates(c, model%row_node))/sum(nodal*u(:, c))
      end do
      do k = 1, size(u, 1)
         if (.not. inside(model%row_node(k))) cycle
         x = model%coordinates(:, model%row_node(k)) - centre
         select case (model%row_component(k))
         case (1)
            u(k, 4:6) = [0.0_wp, x(3), -x(2)]
         case (2)
            u(k, 4:6) = [-x(3), 0.0_wp, x(1)]
         case (3)
            u(k, 4:6) = [x(2), -x(1), 0.0_wp]
         end select
      end do
   end function rigid_motions

   !> (nodes) number of the body each node belongs to, in the order of the nodes; 0 for nodes without an element.
   function bodies_of(model) result(body)
      type(fe_model_t), intent(in) :: model
      integer, allocatable :: body(:)
      integer, allocatable :: parent(:)
      integer :: b, e, c, i, j, bodies

      parent = [(i, i=1, model%node_count())]
      allocate (body(model%node_count()), source=0)
      if (.not. allocated(model%elements)) return
      do b = 1, size(model%elements)
         associate (nodes => model%elements(b)%connectivity)
            do e = 1, size(nodes, 2)
               i = root(nodes(1, e))
               body(nodes(:, e)) = 1
               do c = 2, size(nodes, 1)
                  j = root(nodes(c, e))
                  parent(max(i, j)) = min(i, j)
                  i = min(i, j)
               end do
            end do
         end associate
      end do
      bodies = 0
      do i = 1, size(body)
         if (body(i) == 0) cycle
         j = root(i)
         if (j == i) then
            bodies = bodies + 1
            body(i) = bodies
         else
            body(i) = body(j)
         end if
      end do

   contains

      !> The smallest node of a node's body so far; the way there is halved.
      integer function root(node)
         integer, intent(in) :: node

         root = node
         do while (parent(root) /= root)
            parent(root) = parent(parent(root))
            root = parent(root)
         end do
      end function root

   end function bodies_of

end module microslip_fe_bodies
