!> Which face of an interface holds a point, and where in the face.
module microslip_fe_face_location
   use microslip_core_kinds, only: wp
   use microslip_fe_element, only: face_size
   use microslip_fe_shape_functions, only: local_coordinates
   implicit none(type, external)
   private

   public :: locate_points

   !> Bins over the bounding rectangle; each lists the faces whose boxes touch it.
   type :: bins_t
      real(wp) :: low(2) = 0.0_wp, width(2) = 1.0_wp
      integer :: count(2) = 1
      !> (bins + 1) first entry of each bin, and the face of each entry
      integer, allocatable :: start(:), face(:)
   end type bins_t

   !> Points this far outside a face, in local coordinates, still count as on its edge (rounding).
   real(wp), parameter :: rounding = 1.0e-8_wp
   !> The sides of an 8-node face may bulge out of the box of its nodes by this part of the box.
   real(wp), parameter :: bulge = 0.25_wp

contains

   !> Find the face and the local coordinates of points in the plane of the interface.
   !>
   !> A point that lies in no face, but within `overhang` of one (local coordinates up to 1 + overhang),
   !> is given to the face it is nearest to, in local coordinates, with the local coordinates
   !> extrapolated: shape functions there still sum to 1 and reproduce linear fields, so that rigid
   !> motion, force and moment stay exact. This is meant for the sliver between the polygon of a
   !> meshed circle and the circle; without `overhang` only points on faces are found.
   pure subroutine locate_points(position, faces, points, face, local, overhang)
      !> (2, nodes) in-plane coordinates of the nodes, m
      real(wp), intent(in) :: position(:, :)
      !> (8, faces) node indices, zeros behind the fourth for 4-node faces
      integer, intent(in) :: faces(:, :)
      !> (2, points) in-plane coordinates, m
      real(wp), intent(in) :: points(:, :)
      !> (points) face that holds the point, 0 if none does
      integer, intent(out) :: face(:)
      !> (2, points) xi, eta in that face, zero if there is none
      real(wp), intent(out) :: local(:, :)
      !> Limit of the extrapolation in local coordinates (2 is the width of a face)
      real(wp), intent(in), optional :: overhang
      type(bins_t) :: bins
      real(wp), allocatable :: box(:, :, :)
      real(wp) :: limit, best, trial(2)
      integer :: p, m, f, bin(2), slot
      logical :: converged

      face = 0
      local = 0.0_wp
      if (size(faces, 2) == 0) return
      limit = 1.0_wp + rounding
      if (present(overhang)) limit = limit + overhang
      call face_boxes(position, faces, bulge + 0.5_wp*(limit - 1.0_wp), box)
      call sort_into_bins(box, bins)
      do p = 1, size(points, 2)
         if (any(points(:, p) < bins%low .or. points(:, p) > bins%low + bins%count*bins%width)) cycle
         bin = bin_of(bins, points(:, p))
         slot = bin(1) + bins%count(1)*(bin(2) - 1)
         best = limit
         do m = bins%start(slot), bins%start(slot + 1) - 1
            f = bins%face(m)
            if (any(points(:, p) < box(:, 1, f) .or. points(:, p) > box(:, 2, f))) cycle
            call local_coordinates(position(:, faces(:face_size(faces(:, f)), f)), points(:, p), trial, converged)
            if (.not. converged .or. maxval(abs(trial)) > best) cycle
            best = maxval(abs(trial))
            face(p) = f
            local(:, p) = trial
         end do
      end do
   end subroutine locate_points

   !> Bounding rectangles of the faces, widened by a part of their size.
   pure subroutine face_boxes(position, faces, widening, box)
      real(wp), intent(in) :: position(:, :)
      integer, intent(in) :: faces(:, :)
      real(wp), intent(in) :: widening
      !> (2, low and high, faces)
      real(wp), allocatable, intent(out) :: box(:, :, :)
      real(wp) :: margin
      integer :: f

      allocate (box(2, 2, size(faces, 2)))
      do f = 1, size(faces, 2)
         associate (nodes => faces(:face_size(faces(:, f)), f))
            box(:, 1, f) = minval(position(:, nodes), dim=2)
            box(:, 2, f) = maxval(position(:, nodes), dim=2)
         end associate
         margin = widening*maxval(box(:, 2, f) - box(:, 1, f))
         box(:, 1, f) = box(:, 1, f) - margin
         box(:, 2, f) = box(:, 2, f) + margin
      end do
   end subroutine face_boxes

   !> About one bin per face over the rectangle that holds all boxes.
   pure subroutine sort_into_bins(box, bins)
      real(wp), intent(in) :: box(:, :, :)
      type(bins_t), intent(out) :: bins
      integer, allocatable :: place(:)
      integer :: f, i, j, slot, pass, low(2), high(2)

      bins%low = minval(box(:, 1, :), dim=2)
      bins%count = max(1, nint(sqrt(real(size(box, 3), wp))))
      bins%width = (maxval(box(:, 2, :), dim=2) - bins%low)/bins%count
      allocate (bins%start(product(bins%count) + 1), source=0)
      do pass = 1, 2
         do f = 1, size(box, 3)
            low = bin_of(bins, box(:, 1, f))
            high = bin_of(bins, box(:, 2, f))
            do j = low(2), high(2)
               do i = low(1), high(1)
                  slot = i + bins%count(1)*(j - 1)
                  if (pass == 1) then
                     bins%start(slot + 1) = bins%start(slot + 1) + 1
                  else
                     bins%face(place(slot)) = f
                     place(slot) = place(slot) + 1
                  end if
               end do
            end do
         end do
         if (pass == 2) exit
         bins%start(1) = 1
         do slot = 1, product(bins%count)
            bins%start(slot + 1) = bins%start(slot + 1) + bins%start(slot)
         end do
         place = bins%start
         allocate (bins%face(bins%start(product(bins%count) + 1) - 1))
      end do
   end subroutine sort_into_bins

   !> Column and row of the bin that holds a point.
   pure function bin_of(bins, point) result(bin)
      type(bins_t), intent(in) :: bins
      real(wp), intent(in) :: point(2)
      integer :: bin(2)
      bin = min(max(int((point - bins%low)/bins%width) + 1, 1), bins%count)
   end function bin_of

end module microslip_fe_face_location
