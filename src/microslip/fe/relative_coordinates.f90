!> Relative interface coordinates (METHOD section 1): u = T d with u_a,j = u_b,j + R d_b,j at every node pair.
!>
!> The unknowns d keep the numbers of the FE rows: the three rows of a side-A node become its pair's d_b
!> (n, t1, t2), every other row keeps its displacement (d_r). `boundary_rows` lists the rows of d_b interface by
!> interface, pair by pair, (n, t1, t2). Displacements in m, forces in N.
module microslip_fe_relative_coordinates
   use microslip_core_error, only: error_t, bad_input
   use microslip_core_kinds, only: wp
   use microslip_core_text, only: to_text
   use microslip_fe_interface, only: contact_interface_t
   use microslip_fe_model, only: fe_model_t, has_row, row_supported
   use microslip_fe_selection, only: absence_text
   use microslip_linalg_sparse, only: symmetric_sparse_t, from_triplets
   implicit none(type, external)
   private

   public :: relative_coordinates_t, new_relative_coordinates, check_interface_nodes

   !> The transformation T, row by row.
   type :: relative_coordinates_t
      !> (n_b) matrix row of every boundary coordinate
      integer, allocatable :: boundary_rows(:)
      !> (rows + 1) first entry of every row of T; (entries) columns and values
      integer, allocatable, private :: start(:), column(:)
      real(wp), allocatable, private :: value(:)
   contains
      procedure :: transformed_matrix
      procedure :: transformed_forces
   end type relative_coordinates_t

contains

   !> Set up T for the interfaces of a model.
   subroutine new_relative_coordinates(model, interfaces, coordinates, error)
      type(fe_model_t), intent(in) :: model
      type(contact_interface_t), intent(in) :: interfaces(:)
      type(relative_coordinates_t), intent(out) :: coordinates
      !> A supported node on side A, or a node that is used twice
      type(error_t), allocatable, intent(out) :: error
      integer, allocatable :: rows(:, :), interface_of(:), pair_of(:)
      integer :: k, j

      call check_interface_nodes(model, interfaces, error)
      if (allocated(error)) return
      rows = model%rows_of_nodes()

      allocate (coordinates%boundary_rows(0), interface_of(model%node_count()), pair_of(model%node_count()))
      interface_of = 0
      do k = 1, size(interfaces)
         interface_of(interfaces(k)%node_a) = k
         pair_of(interfaces(k)%node_a) = [(j, j=1, interfaces(k)%pair_count())]
         coordinates%boundary_rows = [coordinates%boundary_rows, rows(:, interfaces(k)%node_a)]
      end do
      call fill_rows(model, interfaces, rows, interface_of, pair_of, coordinates)
   end subroutine new_relative_coordinates

   !> A node of side A is in no other interface, and free in all three components; one of side B is free or supported, and may
   !> be on side B of several interfaces.
   subroutine check_interface_nodes(model, interfaces, error)
      type(fe_model_t), intent(in) :: model
      type(contact_interface_t), intent(in) :: interfaces(:)
      type(error_t), allocatable, intent(out) :: error
      !> (nodes) interface of which a node is on side A; negative: on side B
      integer, allocatable :: used_in(:)
      integer, allocatable :: rows(:, :)
      integer :: k, j, c, side, node

      rows = model%rows_of_nodes()
      allocate (used_in(model%node_count()), source=0)
      do k = 1, size(interfaces)
         do j = 1, interfaces(k)%pair_count()
            ! A node of side A moves with its partner: its own displacement is given up. Several may follow one partner.
            do side = 1, 2
               node = merge(interfaces(k)%node_a(j), interfaces(k)%node_b(j), side == 1)
               if (node == 0) cycle
               if (used_in(node) == 0) then
                  used_in(node) = merge(k, -k, side == 1)
               else if (side == 1 .or. used_in(node) > 0) then
                  call bad_input(error, 'interface "'//interfaces(k)%name//'": node '// &
                                 to_text(model%node_label(node))//' is used twice (also in interface "'// &
                                 interfaces(abs(used_in(node)))%name//'"): only side B may share nodes with the sides B of '// &
                                 'other interfaces. Exchange the sides of one of them, or leave the node out of one')
                  return
               end if
            end do
            node = interfaces(k)%node_a(j)
            do c = 1, 3
               if (rows(c, node) > 0) cycle
               call bad_input(error, 'interface "'//interfaces(k)%name//'": side A: '//absence_text(model, node, c)// &
                              side_advice(model, interfaces(k)%node_b(j), c))
               return
            end do
            node = interfaces(k)%node_b(j)
            if (node == 0) cycle
            do c = 1, 3
               if (rows(c, node) > 0) cycle
               if (model%absence_of(node, c) == row_supported) cycle
               call bad_input(error, 'interface "'//interfaces(k)%name//'": side B: '//absence_text(model, node, c)// &
                              '; nodes of an interface must be free or supported, leave it out of the constraint')
               return
            end do
         end do
      end do
   end subroutine check_interface_nodes

   !> What to do about a node of side A without a row.
   function side_advice(model, node_b, component) result(text)
      type(fe_model_t), intent(in) :: model
      !> The other node of the pair, 0 for rigid ground, and the component
      integer, intent(in) :: node_b, component
      character(len=:), allocatable :: text

      text = '; leave it out of the interface'
      if (node_b == 0) return
      if (model%absence_of(node_b, component) == has_row) then
         text = text//', or exchange the sides'
      else
         text = text//' (its partner, node '//to_text(model%node_label(node_b))//' of side B, has no row there either: a '// &
            'support or a plane of symmetry that cuts the joint must leave the joint free)'
      end if
   end function side_advice

   !> The entries of T.
   subroutine fill_rows(model, interfaces, rows, interface_of, pair_of, coordinates)
      type(fe_model_t), intent(in) :: model
      type(contact_interface_t), intent(in) :: interfaces(:)
      !> (3, nodes); (nodes) interface and pair in which a node is on side A, 0 where it is not
      integer, intent(in) :: rows(:, :), interface_of(:), pair_of(:)
      type(relative_coordinates_t), intent(inout) :: coordinates
      integer :: i, k, m, c, node, node_b, component

      allocate (coordinates%start(model%row_count() + 1))
      allocate (coordinates%column(model%row_count() + 3*size(coordinates%boundary_rows)))
      allocate (coordinates%value(size(coordinates%column)))
      m = 0
      do i = 1, model%row_count()
         coordinates%start(i) = m + 1
         node = model%row_node(i)
         component = model%row_component(i)
         k = interface_of(node)
         if (k == 0) then
            call add(i, 1.0_wp)
            cycle
         end if
         node_b = interfaces(k)%node_b(pair_of(node))
         if (node_b > 0) call add(rows(component, node_b), 1.0_wp)
         do c = 1, 3
            call add(rows(c, node), interfaces(k)%frame(component, c))
         end do
      end do
      coordinates%start(model%row_count() + 1) = m + 1

   contains

      subroutine add(column, value)
         integer, intent(in) :: column
         real(wp), intent(in) :: value
         if (column == 0 .or. .not. abs(value) > 0.0_wp) return
         m = m + 1
         coordinates%column(m) = column
         coordinates%value(m) = value
      end subroutine add

   end subroutine fill_rows

   !> T^T A T. Entries that are zero are not kept (a mass matrix is full of them).
   pure function transformed_matrix(self, matrix) result(transformed)
      class(relative_coordinates_t), intent(in) :: self
      !> In FE coordinates
      type(symmetric_sparse_t), intent(in) :: matrix
      type(symmetric_sparse_t) :: transformed
      integer, allocatable :: row(:), column(:)
      real(wp), allocatable :: value(:)
      integer :: i, j, k, p, q, m, room, counts(matrix%n)

      counts = self%start(2:) - self%start(:matrix%n)
      room = 0
      do i = 1, matrix%n
         do k = matrix%row_start(i), matrix%row_start(i + 1) - 1
            room = room + counts(i)*counts(matrix%column(k))
         end do
      end do
      allocate (row(room), column(room), value(room))

      ! An off-diagonal entry A_ij stands for A_ji too: where both land on the diagonal it counts twice.
      m = 0
      do i = 1, matrix%n
         do k = matrix%row_start(i), matrix%row_start(i + 1) - 1
            j = matrix%column(k)
            if (.not. abs(matrix%value(k)) > 0.0_wp) cycle
            do p = self%start(i), self%start(i + 1) - 1
               do q = self%start(j), self%start(j + 1) - 1
                  if (i == j .and. q < p) cycle
                  m = m + 1
                  row(m) = self%column(p)
                  column(m) = self%column(q)
                  value(m) = self%value(p)*self%value(q)*matrix%value(k)
                  if (i /= j .and. row(m) == column(m)) value(m) = 2.0_wp*value(m)
               end do
            end do
         end do
      end do
      transformed = from_triplets(matrix%n, row(:m), column(:m), value(:m))
   end function transformed_matrix

   !> T^T F.
   pure function transformed_forces(self, forces) result(transformed)
      class(relative_coordinates_t), intent(in) :: self
      !> (rows, patterns) on the FE rows
      real(wp), intent(in) :: forces(:, :)
      real(wp), allocatable :: transformed(:, :)
      integer :: i, j, k

      allocate (transformed(size(forces, 1), size(forces, 2)), source=0.0_wp)
      do j = 1, size(forces, 2)
         do i = 1, size(forces, 1)
            do k = self%start(i), self%start(i + 1) - 1
               transformed(self%column(k), j) = transformed(self%column(k), j) + self%value(k)*forces(i, j)
            end do
         end do
      end do
   end function transformed_forces

end module microslip_fe_relative_coordinates
