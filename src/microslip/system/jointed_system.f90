!> The structure with its joints as the analyses see it: modal coordinates, contact points, loads, sensors.
!>
!> The boundary is eliminated (METHOD section 4), F = K_bb^-1:
!>     d_b  = F (W lambda + f_b - K_bi d_i)                                      (15)
!>     gap  = -h + R d_i + W^T F f_b + G lambda,   G = C + W^T F W,  R = -W^T F K_bi     (19)
!>     a_i + D v_i + Khat d_i = f_i - K_bi^T F f_b + R^T lambda,    Khat = K_ii - K_bi^T F K_bi
!> A load pattern and a sensor are the same thing seen from two sides (reciprocity): both reduce to a modal
!> part (n_i), a contact part (3P) and, between them, a static compliance of the boundary.
!>
!> Two more things are columns of the same kind. An imposed motion s(t) of the surface of side B (a rigid counter-body, or the
!> ground) has no modal part, and the contact part -psi: gap = ... - psi s, psi (3 per point) the motion of the points. An
!> initial pressure, lambda_0 = p A in the undeformed state without any gap, is a load of amplitude 1 that is always on,
!> f_b = -W lambda_0, together with -C lambda_0 in the gap: then gap = G (lambda - lambda_0) + R d_i + ..., and the modes are
!> loaded by R^T (lambda - lambda_0).
module microslip_system_jointed_system
   use microslip_contact_compliance_operator, only: contact_compliance_t
   use microslip_contact_problem, only: contact_problem_t
   use microslip_core_error, only: error_t, failure
   use microslip_core_kinds, only: wp
   use microslip_fe_reduced_model, only: find_highest_frequency, reduced_model_t
   use microslip_halfspace_coupling, only: add_gathered
   use microslip_linalg_dense, only: cholesky_factor, cholesky_solve, inverse_spd, product_of, product_symmetric
   use microslip_system_compliance_choice, only: compliance_auto, compliance_dense, check_memory, compliance_fft, takes_fft
   use microslip_system_fft_compliance, only: fft_compliance_t, new_fft_compliance
   use microslip_system_pad, only: pad_t
   implicit none(type, external)
   private

   public :: jointed_system_t, new_system

   !> A motion of side B of a pad.
   type :: counter_motion_t
      !> Its index among the loads, and its pad
      integer :: load = 0, pad = 0
      !> psi (3, grid points): m per unit of the amplitude, along n, t1, t2
      real(wp), allocatable :: shape(:, :)
   end type counter_motion_t

   type :: jointed_system_t
      integer :: n_modes = 0, n_loads = 0
      !> (modes) frequencies of the component modes, Hz
      real(wp), allocatable :: frequency(:)
      !> Khat, (modes, modes): the structure with traction-free interfaces, 1/s^2
      real(wp), allocatable :: stiffness(:, :)
      !> (modes) diagonal of D, 1/s
      real(wp), allocatable :: damping(:)
      type(pad_t), allocatable :: pads(:)
      !> gap = r_0 + R [d_i; load amplitudes] + G lambda on the points in potential contact
      type(contact_problem_t) :: problem
      !> How `restrict` makes G: compliance_dense, compliance_fft, or whichever suits the machine
      integer :: compliance = compliance_auto
      !> (modes, loads) and (loads, loads)
      real(wp), allocatable :: load_modal(:, :), load_load(:, :)
      !> (loads) amplitudes that are always on: 1 for the initial pressure of the pads, else 0
      real(wp), allocatable :: held(:)
      !> (loads) whether the amplitude is an imposed motion, whose conjugate is the contact force -R^T lambda
      logical, allocatable :: imposed(:)
      type(counter_motion_t), allocatable, private :: motions(:)
      !> (modes, sensors) and (loads, sensors): u = modal^T d_i + outputs^T lambda + load^T a, the outputs in `problem`
      real(wp), allocatable :: sensor_modal(:, :), sensor_load(:, :)
      !> Highest angular frequency with all of the boundary tied, rad/s
      real(wp), private :: omega_max = 0.0_wp
      !> (points) index that each point had before the potential contact set was last changed, 0: it is new
      integer, allocatable :: previous_index(:)
      !> F, (boundary, boundary), and K_bi, (boundary, modes)
      real(wp), allocatable, private :: flexibility(:, :), K_bi(:, :)
      !> Normal rows of F, (pairs, boundary), and of F [-K_bi, f_b], (pairs, modes + loads on nodes)
      real(wp), allocatable, private :: flexibility_normal(:, :), static_normal(:, :)
      !> (boundary, loads) and (boundary, sensors)
      real(wp), allocatable, private :: load_boundary(:, :), sensor_boundary(:, :)
   contains
      procedure :: highest_angular_frequency
      procedure :: restrict
      procedure :: static_compliance
      procedure :: widen_where_closed
      procedure :: grid_point_count
      procedure :: modal_force
      procedure :: sensor_values
      procedure :: boundary_displacement
      procedure :: static_boundary
      procedure :: gaps_everywhere
      procedure :: normal_gaps_everywhere
      procedure :: interface_forces
      procedure :: add_modal_load
      procedure :: add_motion
      procedure :: initial_force
   end type jointed_system_t

contains

   !> Eliminate the boundary of a reduced model. `restrict` must be called next: it couples the pads.
   subroutine new_system(reduced, pads, n_loads, damping, system, error)
      !> Reduced model; its patterns are the loads, then the sensors
      type(reduced_model_t), intent(in) :: reduced
      type(pad_t), intent(in) :: pads(:)
      !> How many of the patterns are loads
      integer, intent(in) :: n_loads
      !> (modes) diagonal of D, 1/s
      real(wp), intent(in) :: damping(:)
      type(jointed_system_t), intent(out) :: system
      type(error_t), allocatable, intent(out) :: error
      real(wp), allocatable :: work(:, :), loads_modal(:, :)
      integer :: k

      system%n_modes = size(reduced%frequency)
      system%frequency = reduced%frequency
      system%damping = damping
      system%pads = pads
      do k = 2, size(pads)
         system%pads(k)%boundary_offset = system%pads(k - 1)%boundary_offset + pads(k - 1)%boundary_count()
      end do
      system%K_bi = reduced%K_bi
      system%load_boundary = reduced%pattern_b(:, :n_loads)
      loads_modal = reduced%pattern_i(:, :n_loads)
      allocate (system%held(n_loads), source=0.0_wp)
      if (any(pads%initial_pressure > 0.0_wp)) then
         system%load_boundary = reshape([system%load_boundary, -initial_nodal_force(system)], [size(reduced%K_bb, 1), n_loads + 1])
         loads_modal = reshape([loads_modal, spread(0.0_wp, 1, system%n_modes)], [system%n_modes, n_loads + 1])
         system%held = [system%held, 1.0_wp]
      end if
      system%n_loads = size(system%held)
      allocate (system%imposed(system%n_loads), source=.false.)
      allocate (system%motions(0))
      system%sensor_boundary = reduced%pattern_b(:, n_loads + 1:)
      system%flexibility = reduced%K_bb
      call inverse_spd(system%flexibility, error)
      if (allocated(error)) then
         error%message = 'boundary stiffness K_bb is not positive definite: '//error%message
         return
      end if

      call find_highest_frequency(reduced, system%omega_max, error)
      if (allocated(error)) return

      work = reduced%K_bi
      call product_symmetric(system%flexibility, reduced%K_bi, work)
      system%stiffness = reduced%K_ii
      call product_of(reduced%K_bi, work, system%stiffness, transpose_a=.true., factor=-1.0_wp, keep=1.0_wp)
      system%stiffness = 0.5_wp*(system%stiffness + transpose(system%stiffness))

      system%flexibility_normal = system%flexibility(1::3, :)
      system%static_normal = matmul(system%flexibility_normal, system%load_boundary)
      system%static_normal = reshape([-work(1::3, :), system%static_normal], &
         & [size(work, 1)/3, system%n_modes + system%n_loads])

      ! Reduced patterns: modal part p_i - K_bi^T F p_b, boundary compliance p_b^T F p_b.
      system%load_modal = loads_modal - matmul(transpose(work), system%load_boundary)
      system%sensor_modal = reduced%pattern_i(:, n_loads + 1:) - matmul(transpose(work), system%sensor_boundary)
      system%load_load = matmul(transpose(system%load_boundary), matmul(system%flexibility, system%load_boundary))
      system%sensor_load = matmul(transpose(system%load_boundary), matmul(system%flexibility, system%sensor_boundary))
   end subroutine new_system

   !> Highest angular frequency that any contact state can have, rad/s: it limits the time step. It is that of the tied
   !> structure, from K_ii (with Craig-Bampton the highest component mode, with MacNeal above it).
   pure real(wp) function highest_angular_frequency(self)
      class(jointed_system_t), intent(in) :: self
      highest_angular_frequency = self%omega_max
   end function highest_angular_frequency

   !> Number of grid points of all pads, whether in potential contact or not.
   pure integer function grid_point_count(self)
      class(jointed_system_t), intent(in) :: self
      integer :: k
      grid_point_count = sum([(self%pads(k)%grid%point_count(), k=1, size(self%pads))])
   end function grid_point_count

   !> Choose the points in potential contact and build G, R and -h on them.
   subroutine restrict(self, potential, error)
      class(jointed_system_t), intent(inout) :: self
      !> (grid points of all pads)
      logical, intent(in) :: potential(:)
      type(error_t), allocatable, intent(out) :: error
      real(wp), allocatable :: gap(:, :)
      integer :: was(size(potential))
      integer :: k, p, first, n, rows

      if (.not. any(potential)) then
         call failure(error, 'no point is in potential contact')
         return
      end if
      was = 0
      first = 0
      n = 0
      do k = 1, size(self%pads)
         associate (pad => self%pads(k))
            if (allocated(self%previous_index)) was(first + pad%potential) = [(pad%point_offset + p, p=1, size(pad%potential))]
            pad%point_offset = n
            pad%potential = pack([(p, p=1, pad%grid%point_count())], potential(first + 1:first + pad%grid%point_count()))
            first = first + pad%grid%point_count()
            n = n + size(pad%potential)
         end associate
      end do
      self%previous_index = pack(was, potential)
      self%problem%n_points = n
      if (allocated(self%problem%R)) deallocate (self%problem%R, self%problem%r_0, self%problem%friction, &
         & self%problem%group)
      if (allocated(self%problem%G)) deallocate (self%problem%G)
      if (allocated(self%problem%compliance)) deallocate (self%problem%compliance)
      if (allocated(self%problem%outputs)) deallocate (self%problem%outputs)
      allocate (self%problem%R(3*n, self%n_modes + self%n_loads), &
         & self%problem%outputs(3*n, size(self%sensor_modal, 2)), source=0.0_wp)
      allocate (self%problem%r_0(3*n), self%problem%friction(n), self%problem%group(n))
      do k = 1, size(self%pads)
         associate (pad => self%pads(k))
            rows = pad%point_offset
            self%problem%friction(rows + 1:rows + size(pad%potential)) = pad%friction
            self%problem%group(rows + 1:rows + size(pad%potential)) = k
            gap = pad%initial_gap()
            self%problem%r_0(3*rows + 1:3*(rows + size(pad%potential))) = reshape(gap(:, pad%potential), [3*size(pad%potential)])
         end associate
      end do
      if (takes_fft(self%compliance, 3.0_wp*n) .and. all(self%pads%half_space)) then
         call make_operator(self)
      else
         call check_memory(3.0_wp*n, error)
         if (allocated(error)) return
         call fill_compliance(self)
      end if
      call fill_columns(self, -1.0_wp, self%K_bi, self%problem%R(:, :self%n_modes))
      n = self%n_modes + size(self%load_boundary, 2)
      call fill_columns(self, 1.0_wp, self%load_boundary, self%problem%R(:, self%n_modes + 1:n))
      call fill_columns(self, 1.0_wp, self%sensor_boundary, self%problem%outputs)
      do k = 1, size(self%motions)
         call fill_motion(self, self%motions(k))
      end do
   end subroutine restrict

   !> R of a motion: -psi on the points of its pad.
   subroutine fill_motion(self, motion)
      class(jointed_system_t), intent(inout) :: self
      type(counter_motion_t), intent(in) :: motion

      associate (pad => self%pads(motion%pad))
         self%problem%R(3*pad%point_offset + 1:3*(pad%point_offset + size(pad%potential)), self%n_modes + motion%load) = &
            & -reshape(motion%shape(:, pad%potential), [3*size(pad%potential)])
      end associate
   end subroutine fill_motion

   !> G as an operator.
   subroutine make_operator(self)
      class(jointed_system_t), intent(inout) :: self
      type(fft_compliance_t), allocatable :: compliance

      allocate (compliance)
      call new_fft_compliance(self%pads, self%flexibility, compliance)
      call move_alloc(compliance, self%problem%compliance)
   end subroutine make_operator

   !> The compliance of statics where G is an operator: G + R Khat^-1 R^T, which is G with F + F K_bi Khat^-1 K_bi^T F.
   !> With `root`, root root^T takes the place of Khat^-1.
   subroutine static_compliance(self, factor, compliance, root)
      class(jointed_system_t), intent(in) :: self
      !> Cholesky factor of Khat
      real(wp), intent(in), contiguous :: factor(:, :)
      class(contact_compliance_t), allocatable, intent(out) :: compliance
      !> (modes, columns)
      real(wp), intent(in), optional :: root(:, :)
      real(wp), allocatable :: moved(:, :), response(:, :), flexibility(:, :)

      allocate (moved, mold=self%K_bi)
      call product_symmetric(self%flexibility, self%K_bi, moved)
      if (present(root)) then
         moved = matmul(moved, root)
         response = transpose(moved)
      else
         response = transpose(moved)
         call cholesky_solve(factor, response)
      end if
      flexibility = self%flexibility
      call product_of(moved, response, flexibility, keep=1.0_wp)
      select type (dynamic => self%problem%compliance)
      type is (fft_compliance_t)
         allocate (compliance, source=dynamic%with_flexibility(flexibility))
      end select
   end subroutine static_compliance

   !> G = C + W^T F W, pad by pad.
   subroutine fill_compliance(self)
      class(jointed_system_t), intent(inout) :: self
      real(wp), allocatable :: block(:, :)
      integer :: j, k

      allocate (self%problem%G(3*self%problem%n_points, 3*self%problem%n_points), source=0.0_wp)
      do k = 1, size(self%pads)
         do j = 1, size(self%pads)
            associate (row => self%pads(j), column => self%pads(k), G => self%problem%G)
               allocate (block(3*size(row%potential), 3*size(column%potential)), source=0.0_wp)
               call add_gathered(row%coupling, row%potential, column%coupling, column%potential, self%flexibility( &
                  & row%boundary_offset + 1:row%boundary_offset + row%boundary_count(), &
                  & column%boundary_offset + 1:column%boundary_offset + column%boundary_count()), block)
               if (j == k .and. row%half_space) call row%add_local_compliance(block)
               G(3*row%point_offset + 1:3*row%point_offset + size(block, 1), &
                  & 3*column%point_offset + 1:3*column%point_offset + size(block, 2)) = block
               deallocate (block)
            end associate
         end do
      end do
      ! Rounding leaves the last bit unsymmetric; everything that follows relies on symmetry.
      do k = 1, size(self%problem%G, 2)
         self%problem%G(k, :k - 1) = self%problem%G(:k - 1, k)
      end do
   end subroutine fill_compliance

   !> target = factor W^T F x on the points in potential contact.
   subroutine fill_columns(self, factor, x, target_rows)
      class(jointed_system_t), intent(in) :: self
      real(wp), intent(in) :: factor
      !> (boundary, columns)
      real(wp), intent(in), contiguous :: x(:, :)
      !> (3 points, columns)
      real(wp), intent(out) :: target_rows(:, :)
      real(wp), allocatable :: moved(:, :)
      integer :: k, rows, first

      if (size(x, 2) == 0) return
      allocate (moved, mold=x)
      call product_symmetric(self%flexibility, x, moved)
      target_rows = 0.0_wp
      do k = 1, size(self%pads)
         associate (pad => self%pads(k))
            rows = 3*pad%point_offset
            first = pad%boundary_offset
            call pad%coupling%interpolate_columns(pad%potential, moved(first + 1:first + pad%boundary_count(), :), &
               & target_rows(rows + 1:rows + 3*size(pad%potential), :))
         end associate
      end do
      target_rows = factor*target_rows
   end subroutine fill_columns

   !> R^T lambda: the contact forces on the modes, (modes).
   function modal_force(self, force) result(f)
      class(jointed_system_t), intent(in) :: self
      !> (3, points) N
      real(wp), intent(in) :: force(:, :)
      real(wp) :: f(self%n_modes)
      integer :: p, c, k

      f = 0.0_wp
      do p = 1, size(force, 2)
         if (force(1, p) == 0.0_wp) cycle
         do c = 1, 3
            k = 3*p - 3 + c
            f = f + self%problem%R(k, :self%n_modes)*force(c, p)
         end do
      end do
   end function modal_force

   !> Displacements at the sensors, (sensors), m.
   function sensor_values(self, modal, force, amplitude) result(u)
      class(jointed_system_t), intent(in) :: self
      !> (modes)
      real(wp), intent(in) :: modal(:)
      !> (3, points) N
      real(wp), intent(in) :: force(:, :)
      !> (loads)
      real(wp), intent(in) :: amplitude(:)
      real(wp) :: u(size(self%sensor_modal, 2))

      u = matmul(modal, self%sensor_modal) + matmul(reshape(force, [size(force)]), self%problem%outputs) &
         & + matmul(amplitude, self%sensor_load)
   end function sensor_values

   !> d_b = F (W lambda + f_b - K_bi d_i), (boundary), m.
   function boundary_displacement(self, modal, force, amplitude) result(d_b)
      class(jointed_system_t), intent(in) :: self
      real(wp), intent(in) :: modal(:)
      !> (3, points) N
      real(wp), intent(in) :: force(:, :)
      !> (loads)
      real(wp), intent(in) :: amplitude(:)
      real(wp) :: d_b(size(self%K_bi, 1)), load(size(self%K_bi, 1))

      load = matmul(self%load_boundary, amplitude(:size(self%load_boundary, 2))) - matmul(self%K_bi, modal) &
         & + nodal_force(self, force)
      call product_symmetric(self%flexibility, load, d_b)
   end function boundary_displacement

   !> Relative displacements F_s W lambda of the node pairs of a pad under contact forces there alone, in statics. Rigid
   !> motion that nothing holds is held by a weak spring: the forces should be in balance then.
   subroutine static_boundary(self, k, force, boundary, error)
      class(jointed_system_t), intent(in) :: self
      !> Which pad
      integer, intent(in) :: k
      !> (3, grid points of the pad) N
      real(wp), intent(in), contiguous :: force(:, :)
      !> (3, pairs of the pad) m
      real(wp), allocatable, intent(out) :: boundary(:, :)
      type(error_t), allocatable, intent(out) :: error
      !> Of the largest diagonal term
      real(wp), parameter :: weak = 1.0e-10_wp
      real(wp) :: load(size(self%K_bi, 1)), d_b(size(self%K_bi, 1)), modal(self%n_modes), spring
      real(wp), allocatable :: factor(:, :), nodal(:, :)
      integer :: m, first, n

      n = self%pads(k)%boundary_count()
      first = self%pads(k)%boundary_offset
      allocate (nodal(3, n/3))
      call self%pads(k)%coupling%distribute(force, nodal)
      load = 0.0_wp
      load(first + 1:first + n) = reshape(nodal, [n])
      call product_symmetric(self%flexibility, load, d_b)
      factor = self%stiffness
      spring = weak*maxval(self%stiffness)
      do m = 1, self%n_modes
         factor(m, m) = factor(m, m) + spring
      end do
      call cholesky_factor(factor, error)
      if (allocated(error)) return
      modal = -matmul(d_b, self%K_bi)
      call cholesky_solve(factor, modal)
      load = load - matmul(self%K_bi, modal)
      call product_symmetric(self%flexibility, load, d_b)
      boundary = reshape(d_b(first + 1:first + n), [3, n/3])
   end subroutine static_boundary

   !> W lambda: the contact forces on the boundary, (boundary), N.
   pure function nodal_force(self, force) result(load)
      class(jointed_system_t), intent(in) :: self
      !> (3, points) N
      real(wp), intent(in) :: force(:, :)
      real(wp) :: load(size(self%K_bi, 1))
      real(wp), allocatable :: nodal(:, :)
      integer :: k, n

      do k = 1, size(self%pads)
         associate (pad => self%pads(k))
            n = pad%boundary_count()
            allocate (nodal(3, n/3))
            call pad%coupling%distribute(spread_to_grid(pad, force), nodal)
            load(pad%boundary_offset + 1:pad%boundary_offset + n) = reshape(nodal, [n])
            deallocate (nodal)
         end associate
      end do
   end function nodal_force

   !> Contact forces of a pad on its whole grid, zero on points left out, (3, grid points).
   pure function spread_to_grid(pad, force) result(everywhere)
      type(pad_t), intent(in) :: pad
      !> (3, points of all pads)
      real(wp), intent(in) :: force(:, :)
      real(wp), allocatable :: everywhere(:, :)

      allocate (everywhere(3, pad%grid%point_count()), source=0.0_wp)
      everywhere(:, pad%potential) = force(:, pad%point_offset + 1:pad%point_offset + size(pad%potential))
   end function spread_to_grid

   !> Relative displacement minus height at all grid points of all pads, left-out points included,
   !> (3, grid points of all pads), m: the check that leaving points out was safe.
   function gaps_everywhere(self, modal, force, amplitude) result(gap)
      class(jointed_system_t), intent(in) :: self
      real(wp), intent(in) :: modal(:)
      !> (3, points) N
      real(wp), intent(in) :: force(:, :)
      !> (loads)
      real(wp), intent(in) :: amplitude(:)
      real(wp), allocatable :: gap(:, :), pad_gap(:, :)
      real(wp) :: d_b(size(self%K_bi, 1))
      integer :: k, n, first

      d_b = self%boundary_displacement(modal, force, amplitude)
      allocate (gap(3, sum([(self%pads(k)%grid%point_count(), k=1, size(self%pads))])))
      first = 0
      do k = 1, size(self%pads)
         associate (pad => self%pads(k))
            n = pad%boundary_count()
            pad_gap = pad%displacement(spread_to_grid(pad, force), &
               & reshape(d_b(pad%boundary_offset + 1:pad%boundary_offset + n), [3, n/3]))
            pad_gap = pad_gap + pad%initial_gap() - moved_surface(self, k, amplitude)
            gap(:, first + 1:first + size(pad_gap, 2)) = pad_gap
            first = first + size(pad_gap, 2)
         end associate
      end do
   end function gaps_everywhere

   !> psi s of all motions of a pad, (3, grid points), m.
   pure function moved_surface(self, k, amplitude) result(moved)
      class(jointed_system_t), intent(in) :: self
      !> Which pad
      integer, intent(in) :: k
      !> (loads)
      real(wp), intent(in) :: amplitude(:)
      real(wp), allocatable :: moved(:, :)
      integer :: m

      allocate (moved(3, self%pads(k)%grid%point_count()), source=0.0_wp)
      do m = 1, size(self%motions)
         if (self%motions(m)%pad == k) moved = moved + self%motions(m)%shape*amplitude(self%motions(m)%load)
      end do
   end function moved_surface

   !> The normal part of `gaps_everywhere`, made cheap for the check of every so many time steps: what is constant
   !> in F is at hand, and only the columns of node pairs that carry a contact force are read.
   subroutine normal_gaps_everywhere(self, modal, force, amplitude, gap)
      !> The workspaces of its pads are used
      class(jointed_system_t), intent(inout) :: self
      real(wp), intent(in) :: modal(:)
      !> (3, points) N
      real(wp), intent(in) :: force(:, :)
      !> (loads)
      real(wp), intent(in) :: amplitude(:)
      !> (grid points of all pads) m
      real(wp), intent(out) :: gap(:)
      real(wp) :: load(size(self%K_bi, 1)), normal(size(self%K_bi, 1)/3)
      real(wp), allocatable :: moved(:, :), initial(:, :)
      integer :: k, first, points, pairs

      normal = matmul(self%static_normal, [modal, amplitude(:size(self%load_boundary, 2))])
      load = nodal_force(self, force)
      do k = 1, size(load)
         if (load(k) /= 0.0_wp) normal = normal + self%flexibility_normal(:, k)*load(k)
      end do
      first = 0
      do k = 1, size(self%pads)
         associate (pad => self%pads(k))
            points = pad%grid%point_count()
            pairs = pad%boundary_offset/3
            call pad%normal_displacement(spread_to_grid(pad, force), &
               & normal(pairs + 1:pairs + pad%boundary_count()/3), gap(first + 1:first + points))
            moved = moved_surface(self, k, amplitude)
            initial = pad%initial_gap()
            gap(first + 1:first + points) = gap(first + 1:first + points) + initial(1, :) - moved(1, :)
            first = first + points
         end associate
      end do
   end subroutine normal_gaps_everywhere

   !> Check the points left out of the potential contact set; where one penetrates, it joins, and with it all
   !> whose gap is less than a twentieth of the largest initial gap.
   subroutine widen_where_closed(self, modal, force, amplitude, added, error)
      class(jointed_system_t), intent(inout) :: self
      real(wp), intent(in) :: modal(:)
      !> (3, points) N
      real(wp), intent(in) :: force(:, :)
      !> (loads)
      real(wp), intent(in) :: amplitude(:)
      !> Number of points that joined
      integer, intent(out) :: added
      type(error_t), allocatable, intent(out) :: error
      real(wp), allocatable :: gap(:)
      logical, allocatable :: potential(:)
      integer :: k, first, asked
      real(wp) :: deepest

      added = 0
      if (self%problem%n_points == self%grid_point_count()) return
      allocate (gap(self%grid_point_count()))
      call self%normal_gaps_everywhere(modal, force, amplitude, gap)
      allocate (potential(size(gap)), source=.false.)
      first = 0
      deepest = 0.0_wp
      do k = 1, size(self%pads)
         potential(first + self%pads(k)%potential) = .true.
         first = first + size(self%pads(k)%height)
         deepest = min(deepest, minval(self%pads(k)%height))
      end do
      if (.not. any(gap < 0.0_wp .and. .not. potential)) return
      potential = potential .or. gap < -0.05_wp*deepest
      added = count(potential) - self%problem%n_points
      ! Solvers at work know one form of G: it stays.
      asked = self%compliance
      self%compliance = merge(compliance_fft, compliance_dense, allocated(self%problem%compliance))
      call self%restrict(potential, error)
      self%compliance = asked
   end subroutine widen_where_closed

   !> Normal force of every pad, (pads), N.
   pure function interface_forces(self, force) result(total)
      class(jointed_system_t), intent(in) :: self
      !> (3, points) N
      real(wp), intent(in) :: force(:, :)
      real(wp) :: total(size(self%pads))
      integer :: k

      do k = 1, size(self%pads)
         associate (first => self%pads(k)%point_offset)
            total(k) = sum(force(1, first + 1:first + size(self%pads(k)%potential)))
         end associate
      end do
   end function interface_forces

   !> lambda_0 on the points in potential contact, (3, points), N.
   pure function initial_force(self) result(force)
      class(jointed_system_t), intent(in) :: self
      real(wp) :: force(3, self%problem%n_points)
      real(wp), allocatable :: everywhere(:, :)
      integer :: k

      do k = 1, size(self%pads)
         associate (pad => self%pads(k))
            everywhere = pad%initial_force()
            force(:, pad%point_offset + 1:pad%point_offset + size(pad%potential)) = everywhere(:, pad%potential)
         end associate
      end do
   end function initial_force

   !> W lambda_0 of all pads, (boundary), N.
   pure function initial_nodal_force(system) result(load)
      type(jointed_system_t), intent(in) :: system
      real(wp) :: load(size(system%K_bi, 1))
      real(wp), allocatable :: nodal(:, :)
      integer :: k

      do k = 1, size(system%pads)
         associate (pad => system%pads(k))
            allocate (nodal(3, pad%boundary_count()/3))
            call pad%coupling%distribute(pad%initial_force(), nodal)
            load(pad%boundary_offset + 1:pad%boundary_offset + pad%boundary_count()) = reshape(nodal, [pad%boundary_count()])
            deallocate (nodal)
         end associate
      end do
   end function initial_nodal_force

   !> Add the load f = M phi for a modal shape: it acts on the modes alone (no mass on the boundary).
   subroutine add_modal_load(self, phi)
      class(jointed_system_t), intent(inout) :: self
      !> (modes)
      real(wp), intent(in) :: phi(:)

      call add_load(self, phi, .false.)
   end subroutine add_modal_load

   !> Add an imposed motion of side B of a pad as a load.
   subroutine add_motion(self, pad, shape)
      class(jointed_system_t), intent(inout) :: self
      !> Which pad
      integer, intent(in) :: pad
      !> psi (3, grid points of the pad): displacement of side B's surface along n, t1, t2, m per unit of the amplitude
      real(wp), intent(in) :: shape(:, :)
      type(counter_motion_t) :: motion

      call add_load(self, spread(0.0_wp, 1, self%n_modes), .true.)
      motion%load = self%n_loads
      motion%pad = pad
      motion%shape = shape
      self%motions = [self%motions, motion]
      if (allocated(self%problem%R)) call fill_motion(self, motion)
   end subroutine add_motion

   !> A load more, with a modal part alone.
   subroutine add_load(self, modal, imposed)
      class(jointed_system_t), intent(inout) :: self
      !> (modes)
      real(wp), intent(in) :: modal(:)
      logical, intent(in) :: imposed
      real(wp), allocatable :: wider(:, :)
      integer :: n

      n = self%n_loads
      self%load_modal = reshape([self%load_modal, modal], [self%n_modes, n + 1])
      self%held = [self%held, 0.0_wp]
      self%imposed = [self%imposed, imposed]
      allocate (wider(n + 1, n + 1), source=0.0_wp)
      wider(:n, :n) = self%load_load
      call move_alloc(wider, self%load_load)
      allocate (wider(n + 1, size(self%sensor_load, 2)), source=0.0_wp)
      wider(:n, :) = self%sensor_load
      call move_alloc(wider, self%sensor_load)
      self%n_loads = n + 1
      if (.not. allocated(self%problem%R)) return
      allocate (wider(size(self%problem%R, 1), self%n_modes + n + 1), source=0.0_wp)
      wider(:, :self%n_modes + n) = self%problem%R
      call move_alloc(wider, self%problem%R)
   end subroutine add_load

end module microslip_system_jointed_system
