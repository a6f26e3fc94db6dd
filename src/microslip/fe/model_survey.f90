!> What mesh and matrices show of each other, node by node; `microslip_fe_matrix_check` judges it.
!>
!> The nodes on which nothing but the solid elements of the mesh acts are called inner: all their components and those of all
!> their neighbours have rows, and the stiffness joins them to their neighbours alone. There
!>
!>     T_i = 0,       P_i(c, d, b) = lambda delta_db A_c + mu (delta_cd A_b + delta_cb A_d),       m_i = rho V_i 1
!>
!> (node_sums, element_volume; P_i in one isotropic material), so that surface nodes give lambda and mu, hence Young's
!> modulus and Poisson's ratio, by least squares, and all give the density.
!>
!> A component without a row is supported where the nodes around it are held against a translation, and dependent where
!> the whole neighbourhood can move along it: then a constraint carries it along.
module microslip_fe_model_survey
   use microslip_core_kinds, only: wp
   use microslip_fe_element_volume, only: node_volumes
   use microslip_fe_model, only: element_block_t, fe_model_t, has_row, row_dependent, row_supported, row_unknown
   use microslip_fe_neighbours, only: element_neighbours, matrix_neighbours, neighbours_t
   use microslip_fe_node_sums, only: node_sums_t, sum_rows
   implicit none(type, external)
   private

   public :: model_survey_t, survey_model, median, rounding_of_entries, stressed_rotation

   !> Half a unit of the last place of single precision: the least that a model file may hold.
   real(wp), parameter :: rounding_of_entries = 2.0_wp**(-24)
   !> Half a unit of the sixth digit, as mesh files are often written, of both nodes of a difference.
   real(wp), parameter :: digits_of_coordinates = 1.0e-5_wp
   !> Surface nodes whose area vector is shorter than this part of its elements' parts are left out: nearly inside.
   real(wp), parameter :: smallest_area = 0.01_wp
   !> What the best lambda and mu may leave of P_i, as a part of it, where a node counts as in one isotropic material.
   real(wp), parameter :: largest_misfit = 0.02_wp
   !> Moments of rotations that a stress in the structure (geometric stiffness) leaves at most, as a part of the sum of the sizes
   !> of their terms: a third of the stress over Young's modulus (600 MPa in a block of steel leave 9e-4).
   real(wp), parameter :: stressed_rotation = 1.0e-2_wp
   !> Two ratios of entries of the mass are the same.
   real(wp), parameter :: same_ratio = 1.0e-4_wp

   type :: model_survey_t
      !> (nodes) whether an element of the mesh uses the node, whether it has all three rows, whether all its neighbours have
      !> them too, whether something else than the solid elements of the mesh acts on it: an entry that joins it to a node
      !> without a common element, or a spring, mass, beam, ...; whether none of that
      logical, allocatable :: in_element(:), complete(:), away(:), touched(:), inner(:)
      !> (nodes) whether T_i, away from supports, is that of a spring to the ground
      logical, allocatable :: grounded(:)
      type(node_sums_t) :: sums
      !> (nodes) T_i and the moment of a rotation, as parts of the sums of the sizes of their terms; what the digits of
      !> the coordinates leave of the latter
      real(wp), allocatable :: held(:), turned(:), turn_rounding(:)
      !> Pairs of nodes with all rows that share an element; those of them that the stiffness does not join
      integer :: pairs = 0, missing = 0
      !> Pairs that the stiffness joins without a common element, and those that only the mass joins
      integer :: foreign = 0, mass_alone = 0
      !> (2) Node indices of the first of each
      integer :: first_missing(2) = 0, first_foreign(2) = 0, first_mass_alone(2) = 0
      !> (nodes) Pa, 1, kg/m^3; 0 where the node does not show it
      real(wp), allocatable :: young(:), poisson(:), density(:)
      !> (nodes) whether the diagonal entry of the mass is that of a consistent mass matrix whose diagonal is counted twice,
      !> 2 D_i/(V_i + D_i) of the row's sum (nodes of 8-node bricks in one material)
      logical, allocatable :: doubled(:)
      !> kg, m: mass that the rows have along x, y, z; its centre
      real(wp) :: mass(3) = 0.0_wp, centre(3) = 0.0_wp
      !> m^3
      real(wp) :: volume = 0.0_wp
   end type model_survey_t

contains

   !> Look at a model, and note in it why components have no row.
   subroutine survey_model(model, survey)
      type(fe_model_t), intent(inout) :: model
      type(model_survey_t), intent(out) :: survey
      type(element_block_t), allocatable :: all_elements(:)
      type(neighbours_t) :: shared, of_bricks

      of_bricks = element_neighbours(model%elements, model%node_count())
      all_elements = model%elements
      if (allocated(model%other_elements)) all_elements = [model%elements, model%other_elements]
      shared = element_neighbours(all_elements, model%node_count())
      call compare_couplings(model, shared, of_bricks, survey)
      call sum_rows(model, survey%sums)
      call measure_motions(model, survey)
      call measure_material(model, survey)
      call find_absence(model, shared, survey)
   end subroutine survey_model

   !> Couplings of the matrices against the elements; which nodes are inner.
   subroutine compare_couplings(model, shared, of_bricks, survey)
      type(fe_model_t), intent(in) :: model
      !> By all elements, by the bricks
      type(neighbours_t), intent(in) :: shared, of_bricks
      type(model_survey_t), intent(inout) :: survey
      type(neighbours_t) :: joined, moved
      integer, allocatable :: by_element(:), by_stiffness(:)
      integer :: a, b, k, n

      n = model%node_count()
      survey%complete = all(model%rows_of_nodes() > 0, dim=1)
      survey%in_element = [(shared%start(a + 1) > shared%start(a), a=1, n)]
      joined = matrix_neighbours(model%stiffness, model%row_node, n)
      moved = matrix_neighbours(model%mass, model%row_node, n)
      allocate (survey%touched(n), survey%away(n), survey%inner(n), source=.false.)
      call touch_by_structural_elements(model, survey%touched)
      allocate (by_element(n), by_stiffness(n), source=0)
      do a = 1, n
         by_element(shared%node(shared%start(a):shared%start(a + 1) - 1)) = a
         by_stiffness(joined%node(joined%start(a):joined%start(a + 1) - 1)) = a
         do k = joined%start(a), joined%start(a + 1) - 1
            b = joined%node(k)
            if (by_element(b) == a) cycle
            survey%touched(a) = .true.
            if (b > a) call note(survey%foreign, survey%first_foreign)
         end do
         do k = of_bricks%start(a), of_bricks%start(a + 1) - 1
            b = of_bricks%node(k)
            if (b < a .or. .not. (survey%complete(a) .and. survey%complete(b))) cycle
            survey%pairs = survey%pairs + 1
            if (by_stiffness(b) /= a) call note(survey%missing, survey%first_missing)
         end do
         do k = moved%start(a), moved%start(a + 1) - 1
            b = moved%node(k)
            if (b > a .and. by_element(b) /= a .and. by_stiffness(b) /= a) &
               & call note(survey%mass_alone, survey%first_mass_alone)
         end do
         survey%away(a) = survey%in_element(a) .and. survey%complete(a) .and. &
            & all(survey%complete(shared%node(shared%start(a):shared%start(a + 1) - 1)))
         survey%inner(a) = survey%away(a) .and. .not. survey%touched(a)
      end do

   contains

      subroutine note(count, first)
         integer, intent(inout) :: count, first(2)
         if (count == 0) first = [a, b]
         count = count + 1
      end subroutine note

   end subroutine compare_couplings

   !> Nodes of elements that are not solid.
   pure subroutine touch_by_structural_elements(model, touched)
      type(fe_model_t), intent(in) :: model
      logical, intent(inout) :: touched(:)
      integer :: k

      if (.not. allocated(model%other_elements)) return
      do k = 1, size(model%other_elements)
         if (index(model%other_elements(k)%type, 'C3D') == 1) cycle
         touched(pack(model%other_elements(k)%connectivity, .true.)) = .true.
      end do
   end subroutine touch_by_structural_elements

   !> How far T_i and the moments of rotations are from zero, and where that is a spring.
   subroutine measure_motions(model, survey)
      type(fe_model_t), intent(in) :: model
      type(model_survey_t), intent(inout) :: survey
      real(wp) :: t(3, 3), force(3), limit, place_error
      integer :: a, c, n

      n = model%node_count()
      allocate (survey%held(n), survey%turned(n), survey%turn_rounding(n), source=0.0_wp)
      allocate (survey%grounded(n), source=.false.)
      place_error = digits_of_coordinates*maxval(abs(model%coordinates))
      associate (sums => survey%sums)
         do a = 1, n
            t = sums%translation(:, :, a)
            do c = 1, 3
               if (.not. sums%gradient_size(c, a) > 0.0_wp) cycle
               survey%held(a) = max(survey%held(a), maxval(abs(t(c, :)))/sums%translation_size(c, a))
               force = [sums%gradient(c, 3, 2, a) - sums%gradient(c, 2, 3, a), sums%gradient(c, 1, 3, a) &
                  & - sums%gradient(c, 3, 1, a), sums%gradient(c, 2, 1, a) - sums%gradient(c, 1, 2, a)]
               survey%turned(a) = max(survey%turned(a), maxval(abs(force))/sums%gradient_size(c, a))
               survey%turn_rounding(a) = max(survey%turn_rounding(a), rounding_of_entries &
                  & + place_error*sums%translation_size(c, a)/sums%gradient_size(c, a))
            end do
            ! A spring to the ground, alone or spread over elements: symmetric, holds and does not push, and turns no more
            ! than its lever of one element or a stress lets it.
            limit = rounding_of_entries*maxval(sums%translation_size(:, a))
            if (survey%away(a) .and. survey%held(a) > rounding_of_entries .and. maxval(abs(t - transpose(t))) <= 2.0_wp*limit) &
               & survey%grounded(a) = is_semidefinite(t, 2.0_wp*limit) &
               & .and. survey%turned(a) <= max(survey%held(a), stressed_rotation) + survey%turn_rounding(a)
         end do
      end associate
   end subroutine measure_motions

   !> Whether a symmetric matrix has no negative principal minor of order 1 or 2 beyond rounding.
   pure logical function is_semidefinite(t, limit)
      real(wp), intent(in) :: t(3, 3), limit
      integer :: c, d

      is_semidefinite = all([(t(c, c) >= -limit, c=1, 3)])
      do c = 1, 3
         d = 1 + mod(c, 3)
         is_semidefinite = is_semidefinite .and. &
            & abs(t(c, d)) <= sqrt(max(t(c, c), 0.0_wp)*max(t(d, d), 0.0_wp)) + limit
      end do
   end function is_semidefinite

   !> Elastic constants and density that the inner nodes show; mass and its centre.
   subroutine measure_material(model, survey)
      type(fe_model_t), intent(in) :: model
      type(model_survey_t), intent(inout) :: survey
      real(wp), allocatable :: volume(:), square(:), area(:, :), size_of_area(:)
      logical, allocatable :: measured(:)
      real(wp) :: lambda, mu, misfit
      integer :: a, c, n

      n = model%node_count()
      call node_volumes(model, volume, square, area, size_of_area, measured)
      allocate (survey%young(n), survey%poisson(n), survey%density(n), source=0.0_wp)
      allocate (survey%doubled(n), source=.false.)
      survey%volume = sum(volume)
      do a = 1, n
         associate (m => survey%sums%mass(:, :, a))
            ! A node without elements whose mass depends on the direction stands for rotations of a rigid body.
            if (.not. survey%in_element(a) .and. m(1, 1)**2 + m(2, 2)**2 + m(3, 3)**2 - m(1, 1)*m(2, 2) - m(2, 2)*m(3, 3) &
               & - m(3, 3)*m(1, 1) > rounding_of_entries*sum(m**2)) cycle
            survey%mass = survey%mass + [(sum(m(:, c)), c=1, 3)]
            survey%centre = survey%centre + (m(1, 1) + m(2, 2) + m(3, 3))*model%coordinates(:, a)
         end associate
         if (.not. (survey%inner(a) .and. measured(a))) cycle
         associate (m => survey%sums%mass(:, :, a))
            survey%density(a) = (m(1, 1) + m(2, 2) + m(3, 3))/(3.0_wp*volume(a))
            if (square(a) > 0.0_wp) survey%doubled(a) = abs(survey%sums%mass_diagonal(1, a)*(volume(a) + square(a)) &
               & - 2.0_wp*m(1, 1)*square(a)) <= same_ratio*abs(m(1, 1))*volume(a)
         end associate
         if (survey%grounded(a) .or. norm2(area(:, a)) < smallest_area*size_of_area(a)) cycle
         call fit_constants(survey%sums%gradient(:, :, :, a), area(:, a), lambda, mu, misfit)
         if (misfit > largest_misfit .or. mu <= 0.0_wp .or. lambda + mu <= 0.0_wp) cycle
         survey%young(a) = mu*(3.0_wp*lambda + 2.0_wp*mu)/(lambda + mu)
         survey%poisson(a) = 0.5_wp*lambda/(lambda + mu)
      end do
      if (sum(survey%mass) > 0.0_wp) survey%centre = survey%centre/sum(survey%mass)
   end subroutine measure_material

   !> lambda and mu by least squares: the two basis tensors have the products 3 A^2, 2 A^2, 8 A^2.
   pure subroutine fit_constants(p, area, lambda, mu, misfit)
      !> (3, 3, 3) P_i, N
      real(wp), intent(in) :: p(3, 3, 3)
      !> A_i, m^2
      real(wp), intent(in) :: area(3)
      !> Pa
      real(wp), intent(out) :: lambda, mu
      !> What they leave of P_i as a part of it
      real(wp), intent(out) :: misfit
      real(wp) :: basis(3, 3, 3, 2), rhs(2), square
      integer :: c, d

      basis = 0.0_wp
      do c = 1, 3
         do d = 1, 3
            basis(c, d, d, 1) = area(c)
            basis(c, c, d, 2) = basis(c, c, d, 2) + area(d)
            basis(c, d, c, 2) = basis(c, d, c, 2) + area(d)
         end do
      end do
      square = dot_product(area, area)
      rhs = [sum(p*basis(:, :, :, 1)), sum(p*basis(:, :, :, 2))]
      lambda = (8.0_wp*rhs(1) - 2.0_wp*rhs(2))/(20.0_wp*square)
      mu = (3.0_wp*rhs(2) - 2.0_wp*rhs(1))/(20.0_wp*square)
      misfit = norm2([p - lambda*basis(:, :, :, 1) - mu*basis(:, :, :, 2)])/max(norm2([p]), tiny(1.0_wp))
   end subroutine fit_constants

   !> Why components have no row.
   subroutine find_absence(model, shared, survey)
      type(fe_model_t), intent(inout) :: model
      type(neighbours_t), intent(in) :: shared
      type(model_survey_t), intent(in) :: survey
      integer, allocatable :: rows(:, :)
      logical :: held, around(3)
      integer :: a, b, c, k

      rows = model%rows_of_nodes()
      model%absence = merge(has_row, row_unknown, rows > 0)
      do b = 1, model%node_count()
         ! Only a node with all rows tells whether its neighbourhood can move.
         if (.not. (survey%in_element(b) .and. survey%complete(b))) cycle
         associate (list => shared%node(shared%start(b):shared%start(b + 1) - 1))
            around = any(rows(:, list) == 0, dim=2)
            if (.not. any(around)) cycle
            do c = 1, 3
               held = holds(b, c)
               do k = 1, size(list)
                  a = list(k)
                  if (rows(c, a) > 0 .or. model%absence(c, a) == row_dependent) cycle
                  if (.not. held) then
                     model%absence(c, a) = row_dependent
                  else if (.not. survey%touched(b) .and. .not. any([holds(b, 1), holds(b, 2), holds(b, 3)] .and. .not. around)) &
                     & then
                     model%absence(c, a) = row_supported
                  end if
               end do
            end do
         end associate
      end do
      call spread_absence(model, shared, survey)

   contains

      !> Whether the neighbourhood of a node is held along a direction.
      pure logical function holds(node, direction)
         integer, intent(in) :: node, direction
         holds = any(abs(survey%sums%translation(:, direction, node)) > &
            & rounding_of_entries*survey%sums%translation_size(:, node))
      end function holds

   end subroutine find_absence

   !> Components of which no neighbour tells anything are supported where nothing in the model is a constraint, or where the
   !> nodes around them are.
   subroutine spread_absence(model, shared, survey)
      type(fe_model_t), intent(inout) :: model
      type(neighbours_t), intent(in) :: shared
      type(model_survey_t), intent(in) :: survey
      integer :: a, c, changes
      logical :: constrained

      constrained = any(model%absence == row_dependent) .or. survey%foreign > 0 .or. &
         & any(survey%complete .and. .not. survey%in_element)
      if (.not. constrained) then
         where (model%absence == row_unknown) model%absence = row_supported
         return
      end if
      do
         changes = 0
         do a = 1, model%node_count()
            associate (list => shared%node(shared%start(a):shared%start(a + 1) - 1))
               do c = 1, 3
                  if (model%absence(c, a) /= row_unknown .or. any(survey%complete(list))) cycle
                  if (.not. any(model%absence(c, list) == row_supported)) cycle
                  if (any(model%absence(c, list) == row_dependent)) cycle
                  model%absence(c, a) = row_supported
                  changes = changes + 1
               end do
            end associate
         end do
         if (changes == 0) exit
      end do
   end subroutine spread_absence

   !> The median of the values that are not zero, 0 if there is none.
   pure real(wp) function median(values)
      real(wp), intent(in) :: values(:)
      real(wp), allocatable :: left(:)
      integer :: low, high, i, j, wanted
      real(wp) :: pivot, swap

      left = pack(values, abs(values) > 0.0_wp)
      median = 0.0_wp
      if (size(left) == 0) return
      wanted = (size(left) + 1)/2
      low = 1
      high = size(left)
      do while (low < high)
         pivot = left((low + high)/2)
         i = low
         j = high
         do
            do while (left(i) < pivot)
               i = i + 1
            end do
            do while (left(j) > pivot)
               j = j - 1
            end do
            if (i <= j) then
               swap = left(i)
               left(i) = left(j)
               left(j) = swap
               i = i + 1
               j = j - 1
            end if
            if (i > j) exit
         end do
         if (wanted <= j) then
            high = j
         else if (wanted >= i) then
            low = i
         else
            exit
         end if
      end do
      median = left(wanted)
   end function median

end module microslip_fe_model_survey
