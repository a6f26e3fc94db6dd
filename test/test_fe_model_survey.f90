!> What mesh and matrices show of each other, and the faults that are told from it.
module test_fe_model_survey
   use microslip_core_error, only: error_t, status_bad_input
   use microslip_core_kinds, only: wp
   use microslip_core_warning_list, only: warning_list_t
   use microslip_fe_load_pattern, only: load_vector, sensor_row
   use microslip_fe_matrix_check, only: check_matrices
   use microslip_fe_model, only: fe_model_t, row_dependent, row_supported
   use microslip_fe_model_survey, only: median, model_survey_t, survey_model
   use microslip_linalg_sparse, only: from_triplets, symmetric_sparse_t
   use support_brick, only: block_model, block_t, to_dense
   use support_mesh, only: pseudo_random
   use testdrive, only: new_unittest, unittest_type, error_type, check
   implicit none(type, external)
   private

   public :: collect_fe_model_survey

   !> Of sums over some hundred entries of one row.
   real(wp), parameter :: rounding = 1.0e4_wp*epsilon(1.0_wp)
   real(wp), parameter :: steel(2) = [2.0e11_wp, 0.3_wp], density = 7800.0_wp

contains

   subroutine collect_fe_model_survey(testsuite)
      type(unittest_type), allocatable, intent(out) :: testsuite(:)
      testsuite = [ &
                  new_unittest('material_and_mass_are_seen', test_material), &
                  new_unittest('springs_and_supports_are_no_fault', test_springs), &
                  new_unittest('constraints_are_no_fault', test_constraint), &
                  new_unittest('exchanged_nodes', test_exchanged), &
                  new_unittest('a_node_that_was_moved', test_moved), &
                  new_unittest('a_nodal_frame_that_is_rotated', test_rotated_frame), &
                  new_unittest('all_nodal_frames_rotated_alike', test_rotated_axes), &
                  new_unittest('diagonals_counted_twice', test_doubled), &
                  new_unittest('stiffness_and_mass_exchanged', test_swapped), &
                  new_unittest('mass_of_another_numbering', test_other_mass), &
                  new_unittest('one_triangle_only', test_triangle), &
                  new_unittest('median', test_median)]
   end subroutine collect_fe_model_survey

   !> A block of 4 x 3 x 3 bricks, held at x = 0.
   subroutine held_block(model)
      type(fe_model_t), intent(out) :: model
      call block_model([block_t('block', [0.0_wp, 0.0_wp, 0.0_wp], [0.06_wp, 0.04_wp, 0.03_wp], [4, 3, 3])], &
         & ['block_xmin'], model)
   end subroutine held_block

   !> The verdict on a model, and that it is one.
   subroutine expect_fault(error, model, words)
      type(error_type), allocatable, intent(out) :: error
      type(fe_model_t), intent(inout) :: model
      !> Part of the message; '': none
      character(len=*), intent(in) :: words
      type(model_survey_t) :: survey
      type(warning_list_t) :: warnings
      type(error_t), allocatable :: fault

      call survey_model(model, survey)
      call check_matrices(model, survey, warnings, fault)
      if (words == '') then
         call check(error, .not. allocated(fault))
         if (.not. allocated(error)) call check(error, warnings%number(), 0)
         return
      end if
      call check(error, allocated(fault), 'no fault found')
      if (allocated(error)) return
      call check(error, fault%status, status_bad_input)
      if (.not. allocated(error)) call check(error, index(fault%message, words) > 0, fault%message)
   end subroutine expect_fault

   subroutine test_material(error)
      type(error_type), allocatable, intent(out) :: error
      type(fe_model_t) :: model
      type(model_survey_t) :: survey
      real(wp), parameter :: size_of_block(3) = [0.06_wp, 0.04_wp, 0.03_wp]
      real(wp) :: mass

      call block_model([block_t('block', [0.0_wp, 0.0_wp, 0.0_wp], size_of_block, [4, 3, 3])], [character(len=1) ::], model)
      call survey_model(model, survey)
      mass = density*product(size_of_block)
      call check(error, all(survey%inner))
      if (.not. allocated(error)) call check(error, count(survey%young > 0.0_wp), 5*4*4 - 3*2*2, 'nodes of the surface')
      if (.not. allocated(error)) call check(error, all(abs(survey%young - steel(1)) <= rounding*steel(1) &
         & .or. survey%young <= 0.0_wp))
      if (.not. allocated(error)) call check(error, abs(median(survey%poisson) - steel(2)) <= rounding)
      if (.not. allocated(error)) call check(error, all(abs(survey%density - density) <= rounding*density))
      if (.not. allocated(error)) call check(error, all(abs(survey%mass - mass) <= rounding*mass))
      if (.not. allocated(error)) call check(error, all(abs(survey%centre - 0.5_wp*size_of_block) <= rounding))
      if (.not. allocated(error)) call check(error, abs(survey%volume - product(size_of_block)) <= rounding)
      if (.not. allocated(error)) call expect_fault(error, model, '')
   end subroutine test_material

   !> Springs to the ground, oblique ones too, are told from faults.
   subroutine test_springs(error)
      type(error_type), allocatable, intent(out) :: error
      type(fe_model_t) :: model
      type(model_survey_t) :: survey
      integer, allocatable :: rows(:, :)
      real(wp) :: along(3)
      integer :: node, c, d

      call held_block(model)
      call expect_fault(error, model, '')
      if (allocated(error)) return
      rows = model%rows_of_nodes()
      node = model%node_sets(model%find_node_set('block_xmax'))%nodes(3)
      along = [1.0_wp, 2.0_wp, -2.0_wp]/3.0_wp
      do c = 1, 3
         do d = c, 3
            call add_entry(model%stiffness, rows(c, node), rows(d, node), 1.0e8_wp*along(c)*along(d))
         end do
      end do
      call expect_fault(error, model, '')
      if (allocated(error)) return
      call survey_model(model, survey)
      call check(error, count(survey%grounded), 1)
      if (.not. allocated(error)) call check(error, survey%grounded(node))
      if (.not. allocated(error)) call check(error, count(model%absence == row_supported), 3*4*4)
   end subroutine test_springs

   !> u_p = u_q for two nodes: p is found to depend on others, supports stay supports, sensors and loads on p are refused.
   subroutine test_constraint(error)
      type(error_type), allocatable, intent(out) :: error
      type(fe_model_t) :: model, whole
      type(model_survey_t) :: survey
      type(error_t), allocatable :: fault
      integer, allocatable :: rows(:, :), row(:), column(:), place(:)
      real(wp), allocatable :: sensor(:)
      integer :: p, q, c, i

      call held_block(whole)
      rows = whole%rows_of_nodes()
      associate (tip => whole%node_sets(whole%find_node_set('block_xmax'))%nodes)
         p = tip(1)
         q = tip(size(tip))
      end associate
      ! The rows of p are added to those of q and dropped.
      place = [(i, i=1, whole%row_count())]
      do c = 1, 3
         place(rows(c, p)) = place(rows(c, q))
      end do
      model = whole
      model%row_node = pack(whole%row_node, whole%row_node /= p)
      model%row_component = pack(whole%row_component, whole%row_node /= p)
      place = [(count(whole%row_node(:place(i) - 1) /= p) + 1, i=1, size(place))]
      allocate (row(whole%stiffness%entries()))
      do i = 1, whole%row_count()
         row(whole%stiffness%row_start(i):whole%stiffness%row_start(i + 1) - 1) = i
      end do
      column = whole%stiffness%column
      model%stiffness = from_triplets(model%row_count(), place(row), place(column), &
         & whole%stiffness%value*merge(2, 1, row /= column .and. place(row) == place(column)))
      deallocate (row)
      allocate (row(whole%mass%entries()))
      do i = 1, whole%row_count()
         row(whole%mass%row_start(i):whole%mass%row_start(i + 1) - 1) = i
      end do
      column = whole%mass%column
      model%mass = from_triplets(model%row_count(), place(row), place(column), &
         & whole%mass%value*merge(2, 1, row /= column .and. place(row) == place(column)))
      call expect_fault(error, model, '')
      if (allocated(error)) return
      call survey_model(model, survey)
      call check(error, all(model%absence(:, p) == row_dependent))
      if (.not. allocated(error)) call check(error, count(model%absence == row_dependent), 3)
      if (.not. allocated(error)) call check(error, count(model%absence == row_supported), 3*4*4)
      if (.not. allocated(error)) call check(error, survey%foreign > 0)
      if (allocated(error)) return
      call sensor_row(model, 'block_xmax', [0.0_wp, 0.0_wp, 1.0_wp], sensor, fault)
      call check(error, allocated(fault))
      if (.not. allocated(error)) call check(error, index(fault%message, 'node 50 depends on other nodes in z') > 0, &
         & fault%message)
      if (allocated(error)) return
      call sensor_row(model, 'block_xmin', [0.0_wp, 0.0_wp, 1.0_wp], sensor, fault)
      call check(error, index(fault%message, 'supported in the given direction') > 0, fault%message)
      if (allocated(error)) return
      call load_vector(model, 'block_xmax', [0.0_wp, 0.0_wp, 1.0_wp], 1.0_wp, 'uniform', sensor, fault)
      call check(error, index(fault%message, 'node 50 depends on other nodes in z') > 0, fault%message)
   end subroutine test_constraint

   !> Any two nodes of the mesh exchanged, neighbours and such with the same neighbours too.
   subroutine test_exchanged(error)
      type(error_type), allocatable, intent(out) :: error
      type(fe_model_t) :: right, model
      integer :: k, p, q

      call held_block(right)
      do k = 1, 20
         p = 1 + int(pseudo_random(2*k)*right%node_count())
         q = 1 + int(pseudo_random(2*k + 1)*right%node_count())
         if (k == 1) p = 5
         if (k == 1) q = 4
         if (p == q .or. right%coordinates(1, p) <= 0.0_wp .or. right%coordinates(1, q) <= 0.0_wp) cycle
         model = right
         where (right%elements(1)%connectivity == p) model%elements(1)%connectivity = q
         where (right%elements(1)%connectivity == q) model%elements(1)%connectivity = p
         model%coordinates(:, [p, q]) = right%coordinates(:, [q, p])
         call expect_fault(error, model, 'mesh and matrices do not belong together')
         if (allocated(error)) return
      end do
   end subroutine test_exchanged

   subroutine test_moved(error)
      type(error_type), allocatable, intent(out) :: error
      type(fe_model_t) :: model

      call held_block(model)
      model%coordinates(:, 58) = model%coordinates(:, 58) + [3.0e-3_wp, 0.0_wp, 1.0e-3_wp]
      call expect_fault(error, model, 'exchanged or moved')
   end subroutine test_moved

   subroutine test_rotated_frame(error)
      type(error_type), allocatable, intent(out) :: error
      type(fe_model_t) :: model

      call held_block(model)
      call rotate_frames(model, [43], 30.0_wp)
      call expect_fault(error, model, 'nodal frames that are rotated')
   end subroutine test_rotated_frame

   subroutine test_rotated_axes(error)
      type(error_type), allocatable, intent(out) :: error
      type(fe_model_t) :: model
      real(wp), parameter :: angles(2) = [30.0_wp, 90.0_wp]
      integer :: k, i

      do k = 1, 2
         call held_block(model)
         call rotate_frames(model, [(i, i=1, model%node_count())], angles(k))
         call expect_fault(error, model, 'rigid rotations')
         if (allocated(error)) return
      end do
   end subroutine test_rotated_axes

   subroutine test_doubled(error)
      type(error_type), allocatable, intent(out) :: error
      type(fe_model_t) :: right, model

      call held_block(right)
      model = right
      model%stiffness%value(right%stiffness%row_start(:right%row_count())) = 2.0_wp*right%stiffness%diagonal()
      call expect_fault(error, model, 'counted twice')
      if (allocated(error)) return
      model = right
      model%mass%value(right%mass%row_start(:right%row_count())) = 2.0_wp*right%mass%diagonal()
      call expect_fault(error, model, 'diagonal of the mass matrix is counted twice')
   end subroutine test_doubled

   subroutine test_swapped(error)
      type(error_type), allocatable, intent(out) :: error
      type(fe_model_t) :: right, model

      call held_block(right)
      model = right
      model%stiffness = right%mass
      model%mass = right%stiffness
      call expect_fault(error, model, 'stiffness in place of the mass')
   end subroutine test_swapped

   subroutine test_other_mass(error)
      type(error_type), allocatable, intent(out) :: error
      type(fe_model_t) :: right, model
      integer, allocatable :: row(:)
      integer :: i, n

      call held_block(right)
      model = right
      n = right%row_count()
      allocate (row(right%mass%entries()))
      do i = 1, n
         row(right%mass%row_start(i):right%mass%row_start(i + 1) - 1) = i
      end do
      ! Six rows on: another node's, the same component.
      model%mass = from_triplets(n, 1 + modulo(row + 5, n), 1 + modulo(right%mass%column + 5, n), right%mass%value)
      call expect_fault(error, model, 'mass of another model')
   end subroutine test_other_mass

   subroutine test_triangle(error)
      type(error_type), allocatable, intent(out) :: error
      type(fe_model_t) :: model
      integer :: i

      call held_block(model)
      model%stiffness = from_triplets(model%row_count(), [(i, i=1, model%row_count())], [(i, i=1, model%row_count())], &
         & model%stiffness%diagonal())
      call expect_fault(error, model, 'half of a matrix')
   end subroutine test_triangle

   subroutine test_median(error)
      type(error_type), allocatable, intent(out) :: error
      integer :: k

      call check(error, abs(median([0.0_wp, 3.0_wp, 1.0_wp, 0.0_wp, 2.0_wp]) - 2.0_wp) <= 0.0_wp)
      if (.not. allocated(error)) call check(error, abs(median([real(wp) :: ])) <= 0.0_wp)
      if (.not. allocated(error)) call check(error, abs(median([(real(modulo(37*k, 101) + 1, wp), k=1, 100)]) - 51.0_wp) <= 1.0_wp)
   end subroutine test_median

   !> Rows of some nodes become displacements along axes turned about x: Q K Q^T, Q M Q^T.
   subroutine rotate_frames(model, nodes, degrees)
      type(fe_model_t), intent(inout) :: model
      integer, intent(in) :: nodes(:)
      real(wp), intent(in) :: degrees
      real(wp), allocatable :: q(:, :)
      integer, allocatable :: rows(:, :)
      real(wp) :: s, c
      integer :: k

      rows = model%rows_of_nodes()
      allocate (q(model%row_count(), model%row_count()), source=0.0_wp)
      do k = 1, model%row_count()
         q(k, k) = 1.0_wp
      end do
      s = sin(degrees*acos(-1.0_wp)/180.0_wp)
      c = cos(degrees*acos(-1.0_wp)/180.0_wp)
      do k = 1, size(nodes)
         associate (r => rows(:, nodes(k)))
            if (any(r == 0)) cycle
            q(r(2), r(2)) = c
            q(r(2), r(3)) = s
            q(r(3), r(2)) = -s
            q(r(3), r(3)) = c
         end associate
      end do
      call transform(model%stiffness)
      call transform(model%mass)

   contains

      subroutine transform(matrix)
         type(symmetric_sparse_t), intent(inout) :: matrix
         real(wp), allocatable :: full(:, :), value(:)
         integer, allocatable :: row(:), column(:)
         integer :: i, j, n, m

         full = matmul(q, matmul(to_dense(matrix), transpose(q)))
         n = matrix%n
         allocate (row(n*n), column(n*n), value(n*n))
         m = 0
         do i = 1, n
            do j = i, n
               ! What rounding leaves of zero is no entry.
               if (abs(full(i, j)) <= rounding*maxval(abs(full)) .and. i /= j) cycle
               m = m + 1
               row(m) = i
               column(m) = j
               value(m) = full(i, j)
            end do
         end do
         matrix = from_triplets(n, row(:m), column(:m), value(:m))
      end subroutine transform

   end subroutine rotate_frames

   !> Add to an entry.
   subroutine add_entry(matrix, row, column, value)
      type(symmetric_sparse_t), intent(inout) :: matrix
      integer, intent(in) :: row, column
      real(wp), intent(in) :: value
      integer :: i
      integer, allocatable :: rows(:)

      allocate (rows(matrix%entries()))
      do i = 1, matrix%n
         rows(matrix%row_start(i):matrix%row_start(i + 1) - 1) = i
      end do
      matrix = from_triplets(matrix%n, [rows, row], [matrix%column, column], [matrix%value, value])
   end subroutine add_entry

end module test_fe_model_survey
