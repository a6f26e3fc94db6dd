!> What is wrong with the points of a scan: numbers that stand for unknown points, and outliers.
!>
!> Numbers for unknown points. (1) A lowest or highest value that many points share, further from all others than
!> `far_apart` times their range. (2) Nearer ones: the lowest value, the highest value, or zero, exactly the same at `few`
!> points at least, whose differences to their neighbours are on average more than `jump` times those between all others
!> (`jump_of_distinct` times where all others differ from their neighbours).
!> (Surfaces of plateaus, where at least half of the neighbours have equal heights, are left alone.)
!>
!> Outliers. A point that deviates from the median of its neighbours by more than `rare` times the robust standard
!> deviation (1.4826 times the median absolute value) of these deviations, and by more than `large` times the distance of the 5 %
!> and 95 % quantiles of the heights about their mean plane.
module microslip_surface_scan_check
   use, intrinsic :: ieee_arithmetic, only: ieee_is_finite
   use microslip_core_kinds, only: wp
   use microslip_surface_plane, only: fit_plane, plane_t
   implicit none(type, external)
   private

   public :: stand_in_t, find_stand_in, find_outliers, about_plane

   !> Distance of a number for unknown points from all heights, over the range of these.
   real(wp), parameter :: far_apart = 10.0_wp
   !> Fewest points with the same height, and their steps to their neighbours over those elsewhere.
   integer, parameter :: few = 4
   real(wp), parameter :: jump = 10.0_wp
   !> The same where no two neighbours elsewhere have equal heights: then equal heights are no measurement. Heights that were
   !> cut off at a level have smaller steps at its rim than elsewhere.
   real(wp), parameter :: jump_of_distinct = 1.5_wp
   !> Outliers: deviation from the neighbours over its robust standard deviation, and over the range of the heights.
   real(wp), parameter :: rare = 20.0_wp, large = 0.5_wp
   !> Values from which a quantile is estimated.
   integer, parameter :: most_values = 100000

   !> A number that stands for unknown points.
   type :: stand_in_t
      !> How many points have it; 0: there is none
      integer :: points = 0
      !> The number, in the unit of the heights
      real(wp) :: value = 0.0_wp
      !> Whether it lies beyond all heights (1), or among them (2)
      logical :: beyond = .false.
      !> Least and largest of the others; mean step to the neighbours
      real(wp) :: lowest = 0.0_wp, highest = 0.0_wp, step = 0.0_wp
   end type stand_in_t

contains

   !> The number that stands for unknown points, if there is one.
   pure function find_stand_in(z) result(found)
      !> (nx, ny) heights; what is not finite is left out
      real(wp), intent(in) :: z(:, :)
      type(stand_in_t) :: found
      real(wp) :: ends(2), others(2), candidates(3)
      logical, allocatable :: known(:, :), rest(:, :)
      integer :: k

      known = ieee_is_finite(z)
      if (count(known) < 2*few) return
      ends = [minval(z, known), maxval(z, known)]
      do k = 1, 2
         rest = known .and. .not. is_equal(z, ends(k))
         if (count(rest) < few .or. count(known) - count(rest) < 2) cycle
         others = [minval(z, rest), maxval(z, rest)]
         if (.not. others(2) > others(1)) cycle
         if (.not. abs(ends(k) - others(k)) > far_apart*(others(2) - others(1))) cycle
         found = stand_in_t(count(known) - count(rest), ends(k), .true., others(1), others(2), abs(ends(k) - others(k)))
         return
      end do
      candidates = [0.0_wp, ends]
      do k = 1, 3
         found = among_heights(z, known, candidates(k))
         if (found%points > 0) return
      end do
   end function find_stand_in

   !> Whether a number among the heights stands for unknown points.
   pure function among_heights(z, known, value) result(found)
      real(wp), intent(in) :: z(:, :)
      logical, intent(in) :: known(:, :)
      real(wp), intent(in) :: value
      type(stand_in_t) :: found
      logical, allocatable :: has_value(:, :)
      real(wp) :: step_sum(2)
      integer :: steps(2), equal, i, j

      has_value = known .and. is_equal(z, value)
      if (count(has_value) < few .or. count(known) - count(has_value) < few) return
      step_sum = 0.0_wp
      steps = 0
      equal = 0
      do j = 1, size(z, 2)
         do i = 1, size(z, 1)
            if (.not. known(i, j)) cycle
            if (i < size(z, 1)) then
               if (known(i + 1, j)) call add_step(z(i:i + 1, j), has_value(i:i + 1, j), step_sum, steps, equal)
            end if
            if (j < size(z, 2)) then
               if (known(i, j + 1)) call add_step(z(i, j:j + 1), has_value(i, j:j + 1), step_sum, steps, equal)
            end if
         end do
      end do
      if (any(steps == 0) .or. 2*equal >= steps(2)) return
      if (.not. step_sum(1)/steps(1) > merge(jump_of_distinct, jump, equal == 0)*step_sum(2)/steps(2)) return
      found%points = count(has_value)
      found%value = value
      found%lowest = minval(z, known .and. .not. has_value)
      found%highest = maxval(z, known .and. .not. has_value)
      found%step = step_sum(1)/steps(1)
   end function among_heights

   !> One pair of neighbours: one of both has the value (1), or none of them (2).
   pure subroutine add_step(z, has_value, step_sum, steps, equal)
      real(wp), intent(in) :: z(2)
      logical, intent(in) :: has_value(2)
      real(wp), intent(inout) :: step_sum(2)
      integer, intent(inout) :: steps(2), equal
      integer :: kind

      if (all(has_value)) return
      kind = merge(1, 2, any(has_value))
      steps(kind) = steps(kind) + 1
      step_sum(kind) = step_sum(kind) + abs(z(2) - z(1))
      if (kind == 2 .and. is_equal(z(1), z(2))) equal = equal + 1
   end subroutine add_step

   !> The same number.
   elemental logical function is_equal(a, b)
      real(wp), intent(in) :: a, b
      is_equal = a == b
   end function is_equal

   !> Points that deviate from their neighbours as no other does.
   subroutine find_outliers(x, y, z, outliers, worst, deviation)
      !> (nx), (ny) coordinates, m
      real(wp), intent(in) :: x(:), y(:)
      !> (nx, ny) heights, NaN where unknown, m
      real(wp), intent(in) :: z(:, :)
      !> How many there are
      integer, intent(out) :: outliers
      !> Indices of the worst one
      integer, intent(out) :: worst(2)
      !> Its deviation from the median of its neighbours, m
      real(wp), intent(out) :: deviation
      real(wp), allocatable :: off(:, :), flat(:)
      logical, allocatable :: known(:, :)
      real(wp) :: limit
      integer :: i, j

      outliers = 0
      worst = 0
      deviation = 0.0_wp
      known = ieee_is_finite(z)
      if (count(known) < 9) return
      allocate (off(size(x), size(y)), source=0.0_wp)
      do j = 1, size(y)
         do i = 1, size(x)
            if (known(i, j)) off(i, j) = z(i, j) - median_of_neighbours(z, known, i, j)
         end do
      end do
      flat = about_plane(x, y, z, known)
      limit = max(rare*1.4826_wp*quantile(pack(abs(off), known), 0.5_wp), &
         & large*(quantile(flat, 0.95_wp) - quantile(flat, 0.05_wp)))
      if (.not. limit > 0.0_wp) return
      outliers = count(abs(off) > limit)
      if (outliers == 0) return
      worst = maxloc(abs(off))
      deviation = off(worst(1), worst(2))
   end subroutine find_outliers

   !> Median of the known ones of up to eight neighbours; the height itself if none is known.
   pure real(wp) function median_of_neighbours(z, known, i, j)
      real(wp), intent(in) :: z(:, :)
      logical, intent(in) :: known(:, :)
      integer, intent(in) :: i, j
      real(wp) :: list(8)
      integer :: n, k, a, b

      n = 0
      do b = max(1, j - 1), min(size(z, 2), j + 1)
         do a = max(1, i - 1), min(size(z, 1), i + 1)
            if ((a == i .and. b == j) .or. .not. known(a, b)) cycle
            k = n
            do while (k > 0)
               if (list(k) <= z(a, b)) exit
               list(k + 1) = list(k)
               k = k - 1
            end do
            list(k + 1) = z(a, b)
            n = n + 1
         end do
      end do
      median_of_neighbours = z(i, j)
      if (n > 0) median_of_neighbours = 0.5_wp*(list((n + 1)/2) + list(n/2 + 1))
   end function median_of_neighbours

   !> Known heights about their least-squares plane.
   function about_plane(x, y, z, known) result(flat)
      !> (nx), (ny) coordinates, m
      real(wp), intent(in) :: x(:), y(:)
      !> (nx, ny) m
      real(wp), intent(in) :: z(:, :)
      !> (nx, ny)
      logical, intent(in) :: known(:, :)
      !> (known points) m
      real(wp), allocatable :: flat(:)
      real(wp), allocatable :: position(:, :)
      type(plane_t) :: plane
      integer :: k

      flat = pack(z, known)
      allocate (position(2, size(flat)))
      position(1, :) = pack(spread(x, 2, size(y)), known)
      position(2, :) = pack(spread(y, 1, size(x)), known)
      plane = fit_plane(position, flat)
      do k = 1, size(flat)
         flat(k) = flat(k) - plane%at(position(1, k), position(2, k))
      end do
   end function about_plane

   !> Quantile of values (of evenly chosen ones where they are many); 0 if there is none.
   pure real(wp) function quantile(values, share)
      real(wp), intent(in) :: values(:)
      !> 0 to 1
      real(wp), intent(in) :: share
      real(wp), allocatable :: list(:)
      integer :: n

      quantile = 0.0_wp
      if (size(values) == 0) return
      list = values(::(size(values) - 1)/most_values + 1)
      n = size(list)
      call sort(list)
      quantile = list(min(n, nint(share*(n - 1)) + 1))
   end function quantile

   !> Ascending order (heap sort).
   pure subroutine sort(list)
      real(wp), intent(inout) :: list(:)
      real(wp) :: last
      integer :: k

      do k = size(list)/2, 1, -1
         call sift(list, k, size(list))
      end do
      do k = size(list), 2, -1
         last = list(k)
         list(k) = list(1)
         list(1) = last
         call sift(list, 1, k - 1)
      end do
   end subroutine sort

   !> Let the root of a heap sink to its place.
   pure subroutine sift(list, root, n)
      real(wp), intent(inout) :: list(:)
      integer, intent(in) :: root, n
      real(wp) :: value
      integer :: parent, child

      value = list(root)
      parent = root
      do
         child = 2*parent
         if (child > n) exit
         if (child < n) then
            if (list(child + 1) > list(child)) child = child + 1
         end if
         if (value >= list(child)) exit
         list(parent) = list(child)
         parent = child
      end do
      list(parent) = value
   end subroutine sift

end module microslip_surface_scan_check
