!> The points in potential contact: valleys of the surface that stay open are left out (paper section 3.1).
!>
!> A point takes part if its initial gap is at most that of the deepest point that closes under the preload
!> without friction, plus a margin. Leaving out is verified by the analyses afterwards; where points had to join, the
!> state an analysis started from is carried over to the wider set.
module microslip_analysis_potential_set
   use microslip_analysis_free_motion, only: free_motion_t
   use microslip_analysis_preload, only: preload_options_t, frictionless_preload
   use microslip_analysis_statics, only: static_problem, static_modal
   use microslip_contact_laws, only: state_open
   use microslip_contact_problem, only: contact_problem_t, contact_state_t, gap_of
   use microslip_core_error, only: error_t, failure
   use microslip_core_kinds, only: wp
   use microslip_system_jointed_system, only: jointed_system_t
   implicit none(type, external)
   private

   public :: choose_potential_set, potential_points, carry_over

   !> Share of the points that the search starts from, and number of points below which none is left out.
   real(wp), parameter :: first_share = 0.15_wp
   integer, parameter :: few_points = 300
   !> Default margin over the largest initial gap.
   real(wp), parameter :: relative_margin = 0.1_wp

contains

   !> Choose the potential contact set for a preload and restrict the system to it.
   subroutine choose_potential_set(system, options, everything, margin, error)
      type(jointed_system_t), intent(inout) :: system
      !> The preload; its first load step is not looked at on its own
      type(preload_options_t), intent(in) :: options
      !> (pads) leave nothing out on this pad
      logical, intent(in) :: everything(:)
      !> (pads) m; negative: a tenth of the largest initial gap
      real(wp), intent(in) :: margin(:)
      type(error_t), allocatable, intent(out) :: error
      real(wp), allocatable :: initial_gap(:), allowed(:), reach(:), amplitude(:), force(:), slope(:, :), response(:, :)
      logical, allocatable :: potential(:), closed(:)
      type(contact_problem_t) :: problem
      !> Without friction its springs hold it: the choice of the points need not be exact
      type(free_motion_t) :: free
      integer, allocatable :: pad_of(:)
      integer :: round

      call list_points(system, initial_gap, pad_of)
      call first_guess(initial_gap, pad_of, everything, potential)
      allocate (allowed(size(everything)), reach(size(everything)))
      allowed = merge(margin, relative_margin*maxval(initial_gap), margin >= 0.0_wp)
      do round = 1, 30
         call system%restrict(potential, error)
         if (allocated(error) .or. all(potential)) return
         call static_problem(system, options%loads, problem, response, error, .true., free)
         if (allocated(error)) return
         allocate (closed(problem%n_points), source=.true.)
         allocate (force(problem%n_points), slope(size(system%pads), size(options%loads)))
         allocate (amplitude(size(options%loads)), source=0.0_wp)
         call frictionless_preload(system, problem, options, 1.0_wp, amplitude, closed, force, slope, error)
         if (allocated(error)) return
         call find_reach(system, problem, response, amplitude, closed, force, initial_gap, pad_of, options, potential, reach)
         deallocate (closed, force, slope, amplitude)
         closed = everything(pad_of) .or. initial_gap <= reach(pad_of) + allowed(pad_of)
         if (.not. any(closed .and. .not. potential)) then
            call system%restrict(closed, error)
            return
         end if
         potential = potential .or. closed
         deallocate (closed)
      end do
      call failure(error, 'the set of points in potential contact does not settle')
   end subroutine choose_potential_set

   !> Whether a grid point is in potential contact, (grid points of all pads).
   pure function potential_points(system) result(potential)
      type(jointed_system_t), intent(in) :: system
      logical, allocatable :: potential(:)
      integer :: k, first

      allocate (potential(system%grid_point_count()), source=.false.)
      first = 0
      do k = 1, size(system%pads)
         potential(first + system%pads(k)%potential) = .true.
         first = first + system%pads(k)%grid%point_count()
      end do
   end function potential_points

   !> A contact state of an earlier, smaller potential contact set on the present one: points that joined are open.
   subroutine carry_over(system, before, contact)
      type(jointed_system_t), intent(in) :: system
      !> (grid points of all pads) the set that the state belongs to
      logical, intent(in) :: before(:)
      type(contact_state_t), intent(inout) :: contact
      type(contact_state_t) :: old
      logical, allocatable :: known(:)
      integer, allocatable :: place(:)
      integer :: k

      known = pack(before, potential_points(system))
      place = pack([(k, k=1, size(known))], known)
      old = contact
      deallocate (contact%force, contact%status)
      allocate (contact%force(3, size(known)), source=0.0_wp)
      allocate (contact%status(size(known)), source=state_open)
      contact%force(:, place) = old%force
      contact%status(place) = old%status
      contact%gap = gap_of(system%problem, contact%q, contact%force)
      do k = 1, size(place)
         if (old%status(k) /= state_open) contact%gap(:, place(k)) = old%gap(:, k)
      end do
   end subroutine carry_over

   !> Initial gap and pad of every grid point.
   subroutine list_points(system, initial_gap, pad_of)
      type(jointed_system_t), intent(in) :: system
      real(wp), allocatable, intent(out) :: initial_gap(:)
      integer, allocatable, intent(out) :: pad_of(:)
      integer :: k

      allocate (initial_gap(0), pad_of(0))
      do k = 1, size(system%pads)
         initial_gap = [initial_gap, -system%pads(k)%height]
         pad_of = [pad_of, spread(k, 1, size(system%pads(k)%height))]
      end do
   end subroutine list_points

   !> The highest points of every pad; all of them where the surface is flat or the points are few.
   pure subroutine first_guess(initial_gap, pad_of, everything, potential)
      real(wp), intent(in) :: initial_gap(:)
      integer, intent(in) :: pad_of(:)
      logical, intent(in) :: everything(:)
      logical, allocatable, intent(out) :: potential(:)
      real(wp) :: low, high, level
      integer :: k, step, wanted

      allocate (potential(size(initial_gap)), source=.true.)
      if (size(initial_gap) <= few_points) return
      do k = 1, size(everything)
         if (everything(k)) cycle
         wanted = ceiling(first_share*count(pad_of == k))
         low = 0.0_wp
         high = maxval(initial_gap, pad_of == k)
         do step = 1, 40
            level = 0.5_wp*(low + high)
            if (count(pad_of == k .and. initial_gap <= level) < wanted) then
               low = level
            else
               high = level
            end if
         end do
         where (pad_of == k) potential = initial_gap <= high
      end do
   end subroutine first_guess

   !> Largest initial gap, on every pad, of a point that closes (or penetrates, if it was left out).
   subroutine find_reach(system, problem, response, amplitude, closed, force, initial_gap, pad_of, options, potential, reach)
      type(jointed_system_t), intent(inout) :: system
      type(contact_problem_t), intent(in) :: problem
      real(wp), intent(in) :: response(:, :), amplitude(:), force(:), initial_gap(:)
      logical, intent(in) :: closed(:), potential(:)
      integer, intent(in) :: pad_of(:)
      type(preload_options_t), intent(in) :: options
      real(wp), intent(out) :: reach(:)
      real(wp) :: forces(3, problem%n_points), loads(system%n_loads)
      real(wp), allocatable :: gap(:, :)
      logical :: touched(size(initial_gap))
      integer :: k

      forces = 0.0_wp
      forces(1, :) = force
      loads = system%held
      loads(options%loads) = amplitude
      gap = system%gaps_everywhere(static_modal(system, response, amplitude, forces), forces, loads)
      touched = unpack(closed, potential, gap(1, :) < 0.0_wp)
      do k = 1, size(reach)
         reach(k) = maxval(initial_gap, touched .and. pad_of == k)
         if (.not. any(touched .and. pad_of == k)) reach(k) = 0.0_wp
      end do
   end subroutine find_reach

end module microslip_analysis_potential_set
