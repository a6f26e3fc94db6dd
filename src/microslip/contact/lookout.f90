!> Which points need a look: a bound on how far a margin may have shrunk since it was last known.
!>
!> A margin is what a sticking point has left to its cone, mu force_n - |force_t|, or the gap of an open point. A closed
!> point without friction has its normal force left, force_n.
!> In a step it shrinks by no more than
!>     slope |D^-1 dq|  +  sum over tiles of influence_n |x_n,tile| + influence_t |x_t,tile|
!> (Cauchy-Schwarz): D weighs the drivers by how far they move in a step and how much they matter - the bound is
!> tightest with D^2 = |dq|/|slope|. A tile is a run of base points, x are their gap increments; slip hardly matters to
!> gaps, so it counts by itself. What the steps have used up is added up; only where it reaches the margin must the
!> point be looked at. In a stretch without slip that is one multiplication per point.
module microslip_contact_lookout
   use microslip_contact_base_set, only: base_set_t
   use microslip_contact_problem, only: contact_problem_t
   use microslip_core_kinds, only: wp
   implicit none(type, external)
   private

   public :: lookout_t, margin_of

   !> Base points in a tile.
   integer, parameter :: tile_size = 4

   !> Watched: the points of the base set, then those outside it.
   type :: lookout_t
      !> (watched) margin when last looked at, and what has been used up since; N or m
      real(wp), allocatable :: margin(:), used(:)
      !> (drivers) by how much they move in a step, and D
      real(wp), allocatable, private :: moves(:), weight(:)
      !> (watched) and (watched, tiles)
      real(wp), allocatable, private :: slope(:), influence_n(:, :), influence_t(:, :)
   contains
      procedure :: survey
      procedure :: weigh
      procedure :: watch
      procedure :: watch_all
      procedure :: forget
      procedure :: spend_drivers
      procedure :: spend_moves
   end type lookout_t

contains

   !> Margin of a closed point that does not move, N.
   pure real(wp) function margin_of(force, friction)
      !> (3) N
      real(wp), intent(in) :: force(3)
      real(wp), intent(in) :: friction

      margin_of = normal_share(friction)*force(1) - norm2(force(2:3))
   end function margin_of

   !> Weight of the normal force in the margin.
   pure real(wp) function normal_share(friction)
      real(wp), intent(in) :: friction

      normal_share = merge(friction, 1.0_wp, friction > 0.0_wp)
   end function normal_share

   !> Bounds for a new base set.
   subroutine survey(self, problem, base)
      class(lookout_t), intent(inout) :: self
      type(contact_problem_t), intent(in) :: problem
      type(base_set_t), intent(in) :: base
      integer :: n, m, t, j, k, first, last
      real(wp) :: effect(3)

      n = size(base%inside)
      m = size(base%outside)
      if (allocated(self%margin)) deallocate (self%margin, self%used, self%influence_n, self%influence_t)
      allocate (self%margin(n + m), self%used(n + m), source=0.0_wp)
      t = (n + tile_size - 1)/tile_size
      allocate (self%influence_n(n + m, t), self%influence_t(n + m, t), source=0.0_wp)
      !$omp parallel do default(none) shared(self, problem, base, n, m) &
      !$omp& private(first, last, j, k, effect) schedule(static)
      do t = 1, size(self%influence_n, 2)
         first = 3*tile_size*(t - 1) + 1
         last = min(3*tile_size*t, 3*n)
         do j = 1, n
            do k = 1, 3
               effect(k) = norm2([norm2(base%M(first + k - 1:last:3, 3*j - 1)), norm2(base%M(first + k - 1:last:3, 3*j))]) &
                  & + normal_share(problem%friction(base%inside(j)))*norm2(base%M(first + k - 1:last:3, 3*j - 2))
            end do
            self%influence_n(j, t) = effect(1)
            self%influence_t(j, t) = norm2(effect(2:3))
         end do
         do j = 1, m
            self%influence_n(n + j, t) = norm2(base%T_t(first:last:3, j))
            self%influence_t(n + j, t) = norm2([norm2(base%T_t(first + 1:last:3, j)), norm2(base%T_t(first + 2:last:3, j))])
         end do
      end do
      !$omp end parallel do
      if (allocated(self%moves)) call self%weigh(problem, base, self%moves)
   end subroutine survey

   !> Choose D.
   subroutine weigh(self, problem, base, moves)
      class(lookout_t), intent(inout) :: self
      type(contact_problem_t), intent(in) :: problem
      type(base_set_t), intent(in) :: base
      !> (drivers) by how much they move in a step, not all zero
      real(wp), intent(in) :: moves(:)
      real(wp) :: size_of(size(moves)), effect(size(moves))
      integer :: n, m, j

      n = size(base%inside)
      m = size(base%outside)
      self%moves = moves
      size_of = [(norm2(base%slope(j, :)), j=1, size(moves))]
      effect = moves*size_of
      ! Drivers that stood still may move: they get a small part. Those without any effect get what they like.
      self%weight = spread(1.0_wp, 1, size(moves))
      where (size_of > 0.0_wp) self%weight = sqrt(max(effect, 1.0e-4_wp*maxval(effect), tiny(1.0_wp)))/size_of
      if (allocated(self%slope)) deallocate (self%slope)
      allocate (self%slope(n + m))
      do j = 1, n
         self%slope(j) = norm2([norm2(base%slope(:, 3*j - 1)*self%weight), norm2(base%slope(:, 3*j)*self%weight)]) &
            & + normal_share(problem%friction(base%inside(j)))*norm2(base%slope(:, 3*j - 2)*self%weight)
      end do
      do j = 1, m
         self%slope(n + j) = norm2(base%slope_outside(:, j)*self%weight)
      end do
   end subroutine weigh

   !> A base point's force is known: its margin begins anew.
   pure subroutine watch(self, place, force, friction)
      class(lookout_t), intent(inout) :: self
      integer, intent(in) :: place
      !> (3) N
      real(wp), intent(in) :: force(3)
      real(wp), intent(in) :: friction

      self%margin(place) = margin_of(force, friction)
      self%used(place) = 0.0_wp
   end subroutine watch

   !> All forces and gaps are known.
   pure subroutine watch_all(self, problem, base, force, gap)
      class(lookout_t), intent(inout) :: self
      type(contact_problem_t), intent(in) :: problem
      type(base_set_t), intent(in) :: base
      !> (3, inside) N and (outside) m
      real(wp), intent(in) :: force(:, :), gap(:)
      integer :: j, n

      n = size(base%inside)
      do j = 1, n
         call self%watch(j, force(:, j), problem%friction(base%inside(j)))
      end do
      self%margin(n + 1:) = gap
      self%used(n + 1:) = 0.0_wp
   end subroutine watch_all

   !> A base point that is followed needs no look.
   pure subroutine forget(self, place)
      class(lookout_t), intent(inout) :: self
      integer, intent(in) :: place

      self%margin(place) = huge(1.0_wp)
      self%used(place) = 0.0_wp
   end subroutine forget

   !> Add what a change of the drivers uses up.
   pure subroutine spend_drivers(self, dq, spent)
      class(lookout_t), intent(in) :: self
      !> (drivers)
      real(wp), intent(in) :: dq(:)
      !> (watched)
      real(wp), intent(inout) :: spent(:)

      spent = spent + self%slope*norm2(dq/self%weight)
   end subroutine spend_drivers

   !> Add what base points that move use up.
   pure subroutine spend_moves(self, places, x, spent)
      class(lookout_t), intent(in) :: self
      !> Base points that move
      integer, intent(in) :: places(:)
      !> (3, places or more) their increments, m
      real(wp), intent(in) :: x(:, :)
      !> (watched)
      real(wp), intent(inout) :: spent(:)
      real(wp) :: squares_n(size(self%influence_n, 2)), squares_t(size(self%influence_n, 2))
      integer :: k, t

      if (size(places) == 0) return
      squares_n = 0.0_wp
      squares_t = 0.0_wp
      do k = 1, size(places)
         t = (places(k) - 1)/tile_size + 1
         squares_n(t) = squares_n(t) + x(1, k)**2
         squares_t(t) = squares_t(t) + x(2, k)**2 + x(3, k)**2
      end do
      do t = 1, size(squares_n)
         if (squares_n(t) > 0.0_wp) spent = spent + self%influence_n(:, t)*sqrt(squares_n(t))
         if (squares_t(t) > 0.0_wp) spent = spent + self%influence_t(:, t)*sqrt(squares_t(t))
      end do
   end subroutine spend_moves

end module microslip_contact_lookout
