!> Pairs of nodes at the same place: matching the two sides of an interface by position.
module microslip_fe_pairing
   use microslip_core_error, only: error_t, bad_input
   use microslip_core_kinds, only: wp
   use microslip_core_text, only: to_text
   use microslip_fe_model, only: fe_model_t
   use microslip_fe_selection, only: node_text
   implicit none(type, external)
   private

   public :: find_partners, match_points

contains

   !> The partner in side B of every node of side A.
   subroutine find_partners(model, nodes_a, nodes_b, tolerance, partners, error)
      type(fe_model_t), intent(in) :: model
      !> Node indices
      integer, intent(in) :: nodes_a(:), nodes_b(:)
      !> Largest distance of a pair, m
      real(wp), intent(in) :: tolerance
      !> (pairs) node indices
      integer, allocatable, intent(out) :: partners(:)
      type(error_t), allocatable, intent(out) :: error
      integer, allocatable :: match(:), taken(:)
      logical, allocatable :: unmatched_b(:)
      integer :: k

      allocate (taken(model%node_count()), source=0)
      taken(nodes_a) = 1
      k = findloc(taken(nodes_b), 1, dim=1)
      if (k > 0) then
         call bad_input(error, node_text(model, nodes_b(k))// &
            ' belongs to both sides; an interface needs two nodes at every place')
         return
      end if
      match = match_points(model%coordinates(:, nodes_a), model%coordinates(:, nodes_b), tolerance)
      if (any(match == 0)) then
         call report_lonely('A', nodes_a, match == 0, nodes_b)
         return
      end if
      allocate (unmatched_b(size(nodes_b)), source=.true.)
      unmatched_b(match) = .false.
      if (any(unmatched_b)) then
         call report_lonely('B', nodes_b, unmatched_b, nodes_a)
         return
      end if
      taken = 0
      do k = 1, size(nodes_a)
         if (taken(nodes_b(match(k))) /= 0) then
            call bad_input(error, node_text(model, taken(nodes_b(match(k))))//' and '// &
               node_text(model, nodes_a(k))//' of side A lie at the same place: two bodies on one side need an interface each')
            return
         end if
         taken(nodes_b(match(k))) = nodes_a(k)
      end do
      partners = nodes_b(match)

   contains

      !> Name the first node without a partner and the nearest candidate.
      subroutine report_lonely(side, nodes, lonely, candidates)
         character(len=1), intent(in) :: side
         integer, intent(in) :: nodes(:), candidates(:)
         logical, intent(in) :: lonely(:)
         real(wp) :: distance
         integer :: first, nearest

         first = nodes(findloc(lonely, .true., dim=1))
         call nearest_point(model%coordinates(:, candidates), model%coordinates(:, first), nearest, distance)
         call bad_input(error, 'side A has '//to_text(size(nodes_a))//' nodes and side B '// &
            to_text(size(nodes_b))//'; '//to_text(count(lonely))//' of side '//side//' have no partner, first '// &
            node_text(model, first)//'; the nearest, '//node_text(model, candidates(nearest))//', is '// &
            to_text(distance, 3)//' m away (allowed '//to_text(tolerance, 3)//' m)')
         if (all(lonely)) error%message = error%message//': the sides do not touch, or their meshes do not match anywhere'
      end subroutine report_lonely

   end subroutine find_partners

   !> For every point of side A the nearest point of side B within the tolerance, 0 where there is none.
   !>
   !> The points of B are put into slices along the longest extent, about as many as there are points,
   !> so that a point of A looks only at the few columns of points in its own and the two adjoining slices.
   pure function match_points(a, b, tolerance) result(partner)
      !> (3, points of A) and (3, points of B), m
      real(wp), intent(in) :: a(:, :), b(:, :)
      !> Largest distance of a pair, m
      real(wp), intent(in) :: tolerance
      !> (points of A) index into side B
      integer, allocatable :: partner(:)
      integer, allocatable :: order(:), first(:), place(:), slice(:)
      real(wp) :: lowest, width
      integer :: axis, slices, k, s

      allocate (partner(size(a, 2)), source=0)
      if (size(b, 2) == 0) return
      axis = maxloc(maxval(b, dim=2) - minval(b, dim=2), dim=1)
      lowest = minval(b(axis, :)) - tolerance
      width = max(tolerance, (maxval(b(axis, :)) - lowest)/size(b, 2))
      slices = int((maxval(b(axis, :)) - lowest)/width) + 1

      slice = int((b(axis, :) - lowest)/width) + 1
      allocate (first(slices + 1), source=0)
      do k = 1, size(b, 2)
         first(slice(k) + 1) = first(slice(k) + 1) + 1
      end do
      first(1) = 1
      do s = 1, slices
         first(s + 1) = first(s + 1) + first(s)
      end do
      place = first
      allocate (order(size(b, 2)))
      do k = 1, size(b, 2)
         order(place(slice(k))) = k
         place(slice(k)) = place(slice(k)) + 1
      end do

      do k = 1, size(a, 2)
         if (a(axis, k) < lowest - tolerance .or. a(axis, k) > lowest + (slices + 1)*width) cycle
         s = int((a(axis, k) - lowest)/width) + 1
         partner(k) = nearest_of(order(first(min(max(s - 1, 1), slices)):first(min(s + 2, slices + 1)) - 1), a(:, k))
      end do

   contains

      !> The nearest candidate within the tolerance, 0 if there is none.
      pure integer function nearest_of(candidates, point)
         integer, intent(in) :: candidates(:)
         real(wp), intent(in) :: point(3)
         real(wp) :: distance, best
         integer :: m

         nearest_of = 0
         best = tolerance
         do m = 1, size(candidates)
            distance = norm2(b(:, candidates(m)) - point)
            if (distance <= best) then
               best = distance
               nearest_of = candidates(m)
            end if
         end do
      end function nearest_of

   end function match_points

   !> Index of the point nearest to a place and its distance, by looking at all (for messages).
   pure subroutine nearest_point(points, place, nearest, distance)
      !> (3, points) m, at least one
      real(wp), intent(in) :: points(:, :)
      !> m
      real(wp), intent(in) :: place(3)
      integer, intent(out) :: nearest
      !> m
      real(wp), intent(out) :: distance

      nearest = minloc(norm2(points - spread(place, 2, size(points, 2)), dim=1), dim=1)
      distance = norm2(points(:, nearest) - place)
   end subroutine nearest_point

end module microslip_fe_pairing
