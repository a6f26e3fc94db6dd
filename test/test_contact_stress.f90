!> Contact at the limits: every solver the factory offers on scenes it is not made for. What it calls converged obeys the laws,
!> judged independently (`support_contact_verdict`); the long version is `example/stress`.
module test_contact_stress
   use microslip_core_kinds, only: wp
   use microslip_core_text, only: to_text
   use support_contact_verdict, only: all_solvers, judge_solver, verdict_t
   use support_stress_dynamics, only: judge_motion, motion_scene_t, motion_scenes
   use support_stress_scenes, only: in_units, random_scene, stress_scene_t, stress_scenes
   use testdrive, only: check, error_type, new_unittest, unittest_type
   implicit none(type, external)
   private

   public :: collect_contact_stress

   real(wp), parameter :: tolerance = 1.0e-10_wp
   integer, parameter :: max_iterations = 500
   !> Violation that the tolerance excuses: iterations stop on estimates, and a scene's steps differ in size.
   real(wp), parameter :: allowed = 1.0e3_wp*tolerance
   !> Solvers that a positive definite compliance must not stop.
   character(len=*), parameter :: robust(3) = [character(len=12) :: 'condensed', 'newton', 'matrix_free']

contains

   subroutine collect_contact_stress(testsuite)
      type(unittest_type), allocatable, intent(out) :: testsuite(:)
      testsuite = [ &
         & new_unittest('scenes at the limits', test_scenes), &
         & new_unittest('random positive definite problems', test_random), &
         & new_unittest('random hyperstatic problems', test_hyperstatic), &
         & new_unittest('the same forces whatever the unit of length', test_units), &
         & new_unittest('motions at the limits', test_motions)]
   end subroutine collect_contact_stress

   !> No verdict is wrong, and where the laws have one solution the robust solvers find it.
   subroutine judge(error, scene)
      type(error_type), allocatable, intent(inout) :: error
      type(stress_scene_t), intent(in) :: scene
      type(verdict_t) :: verdict
      integer :: s

      do s = 1, size(all_solvers)
         if (allocated(error)) return
         call judge_solver(scene%problem, scene%path, trim(all_solvers(s)), tolerance, max_iterations, allowed, verdict)
         call check(error, verdict%word /= 'WRONG', scene%name//' by '//trim(all_solvers(s))//': violation ' &
            & //to_text(verdict%residual)//', books '//to_text(verdict%energy_error))
         if (allocated(error)) return
         if (scene%regular .and. any(robust == all_solvers(s))) call check(error, verdict%word == 'holds', &
            & scene%name//' by '//trim(all_solvers(s))//': '//trim(verdict%word))
      end do
   end subroutine judge

   subroutine test_scenes(error)
      type(error_type), allocatable, intent(out) :: error
      type(stress_scene_t), allocatable :: scenes(:)
      integer :: k

      scenes = stress_scenes(short=.true.)
      do k = 1, size(scenes)
         call judge(error, scenes(k))
         if (allocated(error)) return
      end do
   end subroutine test_scenes

   subroutine test_random(error)
      type(error_type), allocatable, intent(out) :: error
      integer :: seed

      do seed = 1, 10
         call judge(error, random_scene(seed, 8, 24))
         if (allocated(error)) return
      end do
   end subroutine test_random

   subroutine test_hyperstatic(error)
      type(error_type), allocatable, intent(out) :: error
      integer :: seed

      do seed = 1, 10
         call judge(error, random_scene(seed, 8, 10))
         if (allocated(error)) return
      end do
   end subroutine test_hyperstatic

   !> m, mm, um: the exact solvers agree to rounding, which the condition of G (up to some hundreds) magnifies.
   subroutine test_units(error)
      type(error_type), allocatable, intent(out) :: error
      type(stress_scene_t), allocatable :: scenes(:)
      type(stress_scene_t) :: same
      type(verdict_t) :: metre, other
      real(wp), parameter :: per_metre(2) = [1.0e3_wp, 1.0e6_wp], sharp = 1.0e-12_wp, agreement = 1.0e-12_wp
      integer :: k, s, u

      scenes = stress_scenes(short=.true.)
      do k = 1, size(scenes)
         if (scenes(k)%name /= 'friction 1' .and. scenes(k)%name /= 'different materials') cycle
         do s = 1, 2
            call judge_solver(scenes(k)%problem, scenes(k)%path, trim(robust(s)), sharp, max_iterations, allowed, metre)
            do u = 1, size(per_metre)
               same = in_units(scenes(k), per_metre(u))
               call judge_solver(same%problem, same%path, trim(robust(s)), sharp, max_iterations, allowed, other)
               call check(error, maxval(abs(other%force - metre%force)) <= agreement*maxval(metre%force), &
                  & scenes(k)%name//' by '//trim(robust(s))//': '// &
                  & to_text(maxval(abs(other%force - metre%force))/maxval(metre%force)))
               if (allocated(error)) return
            end do
         end do
      end do
   end subroutine test_units

   !> Steps up to the limit keep the books, a step past it is refused in words.
   subroutine test_motions(error)
      type(error_type), allocatable, intent(out) :: error
      type(motion_scene_t), allocatable :: scenes(:)
      type(verdict_t) :: verdict
      integer :: k

      scenes = motion_scenes(short=.true.)
      do k = 1, size(scenes)
         call judge_motion(scenes(k), 'condensed', tolerance, max_iterations, verdict)
         if (scenes(k)%step_ratio > 1.0_wp) then
            call check(error, verdict%word == 'refused' .and. index(verdict%message, 'stability limit') > 0, scenes(k)%name)
         else
            call check(error, verdict%word, 'holds', scenes(k)%name//': unconverged '//to_text(verdict%unconverged) &
               & //', residual '//to_text(verdict%residual)//', books '//to_text(verdict%energy_error))
         end if
         if (allocated(error)) return
      end do
   end subroutine test_motions

end module test_contact_stress
