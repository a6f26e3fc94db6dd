!> Shape functions of the 4-node (bilinear) and 8-node (serendipity) quadrilateral on xi, eta in [-1, 1].
!>
!> Node order: corners (-1,-1), (1,-1), (1,1), (-1,1), then the middles of the edges 1-2, 2-3, 3-4, 4-1.
!>
!>     4 nodes   N_k = (1 + xi xi_k)(1 + eta eta_k)/4
!>     8 nodes   N_k = (1 + xi xi_k)(1 + eta eta_k)(xi xi_k + eta eta_k - 1)/4      corners
!>               N_k = (1 - xi^2)(1 + eta eta_k)/2,  (1 + xi xi_k)(1 - eta^2)/2     mid-side nodes
module microslip_fe_shape_functions
   use microslip_core_kinds, only: wp
   implicit none(type, external)
   private

   public :: shape_values, shape_gradients, local_coordinates

   !> (2, 8) local coordinates of the nodes
   real(wp), parameter :: node(2, 8) = reshape(real([ &
      -1, -1, 1, -1, 1, 1, -1, 1, 0, -1, 1, 0, 0, 1, -1, 0], wp), [2, 8])

contains

   !> N_k at a point, for k = 1 ... nodes.
   pure function shape_values(nodes, local) result(value)
      !> 4 or 8
      integer, intent(in) :: nodes
      !> xi, eta
      real(wp), intent(in) :: local(2)
      real(wp) :: value(nodes)
      real(wp) :: along(2)
      integer :: k

      do k = 1, 4
         along = local*node(:, k)
         value(k) = 0.25_wp*(1.0_wp + along(1))*(1.0_wp + along(2))
         if (nodes == 8) value(k) = value(k)*(along(1) + along(2) - 1.0_wp)
      end do
      if (nodes == 4) return
      do k = 5, 7, 2
         value(k) = 0.5_wp*(1.0_wp - local(1)**2)*(1.0_wp + local(2)*node(2, k))
         value(k + 1) = 0.5_wp*(1.0_wp + local(1)*node(1, k + 1))*(1.0_wp - local(2)**2)
      end do
   end function shape_values

   !> dN_k/dxi and dN_k/deta at a point, for k = 1 ... nodes.
   pure function shape_gradients(nodes, local) result(gradient)
      !> 4 or 8
      integer, intent(in) :: nodes
      !> xi, eta
      real(wp), intent(in) :: local(2)
      real(wp) :: gradient(2, nodes)
      real(wp) :: along(2)
      integer :: k

      do k = 1, 4
         along = local*node(:, k)
         if (nodes == 4) then
            gradient(:, k) = 0.25_wp*node(:, k)*(1.0_wp + along([2, 1]))
         else
            gradient(:, k) = 0.25_wp*node(:, k)*(1.0_wp + along([2, 1]))*(2.0_wp*along + along([2, 1]))
         end if
      end do
      if (nodes == 4) return
      do k = 5, 7, 2
         gradient(:, k) = [-local(1)*(1.0_wp + local(2)*node(2, k)), &
                           0.5_wp*(1.0_wp - local(1)**2)*node(2, k)]
         gradient(:, k + 1) = [0.5_wp*node(1, k + 1)*(1.0_wp - local(2)**2), &
                               -(1.0_wp + local(1)*node(1, k + 1))*local(2)]
      end do
   end function shape_gradients

   !> The local coordinates of a point of the plane: solves sum_k N_k(local) corner_k = point.
   !>
   !> Newton from the centre of the face; a step that would enlarge the residual is halved.
   !> Exit: a step below 1e-9 (the next one would be below rounding), a singular Jacobian, the point
   !> further away than three times the face, or 30 steps.
   pure subroutine local_coordinates(nodes, point, local, converged)
      !> (2, 4 or 8) in-plane coordinates of the nodes
      real(wp), intent(in) :: nodes(:, :)
      !> In-plane coordinates of the point
      real(wp), intent(in) :: point(2)
      !> xi, eta
      real(wp), intent(out) :: local(2)
      logical, intent(out) :: converged
      integer, parameter :: max_steps = 30, max_halvings = 5
      real(wp), parameter :: last_step = 1.0e-9_wp, far_away = 6.0_wp
      real(wp) :: jacobian(2, 2), residual(2), trial(2), step(2), det
      integer :: k, m

      converged = .false.
      local = 0.0_wp
      residual = point - matmul(nodes, shape_values(size(nodes, 2), local))
      do k = 1, max_steps
         jacobian = matmul(nodes, transpose(shape_gradients(size(nodes, 2), local)))
         det = jacobian(1, 1)*jacobian(2, 2) - jacobian(1, 2)*jacobian(2, 1)
         if (abs(det) <= epsilon(det)*sum(jacobian**2)) return
         step = [jacobian(2, 2)*residual(1) - jacobian(1, 2)*residual(2), &
                 jacobian(1, 1)*residual(2) - jacobian(2, 1)*residual(1)]/det
         converged = maxval(abs(step)) < last_step
         do m = 0, max_halvings
            trial = point - matmul(nodes, shape_values(size(nodes, 2), local + step))
            if (converged .or. norm2(trial) < norm2(residual)) exit
            step = 0.5_wp*step
         end do
         local = local + step
         residual = trial
         if (converged .or. maxval(abs(local)) > far_away) return
      end do
   end subroutine local_coordinates

end module microslip_fe_shape_functions
