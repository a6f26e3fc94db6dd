!> Which unit was meant.
module test_fe_unit_guess
   use microslip_core_kinds, only: wp
   use microslip_fe_left_out_faces, only: find_left_out, left_out_t
   use microslip_fe_model, only: fe_model_t, node_set_t
   use microslip_fe_unit_guess, only: guess_modulus_unit, guess_stored_units, guess_unit_keys, is_material, unit_in_si
   use support_brick, only: block_model, block_t, facing_interface
   use testdrive, only: new_unittest, unittest_type, error_type, check
   implicit none(type, external)
   private

   public :: collect_fe_unit_guess

   real(wp), parameter :: materials(2, 5) = reshape([2.1e11_wp, 7850.0_wp, 7.0e10_wp, 2700.0_wp, 1.1e11_wp, 4430.0_wp, &
      & 3.0e9_wp, 1200.0_wp, 6.0e11_wp, 15000.0_wp], [2, 5])

contains

   subroutine collect_fe_unit_guess(testsuite)
      type(unittest_type), allocatable, intent(out) :: testsuite(:)
      testsuite = [new_unittest('unit_keys', test_keys), &
                   new_unittest('stored_units', test_stored), &
                   new_unittest('unit_of_a_modulus', test_modulus), &
                   new_unittest('faces_left_out', test_left_out)]
   end subroutine collect_fe_unit_guess

   !> mm-t-s files of metals read in other units: the right keys are found.
   subroutine test_keys(error)
      type(error_type), allocatable, intent(out) :: error
      character(len=2), parameter :: lengths(3) = ['m ', 'mm', 'um'], masses(3) = ['kg', 't ', 'g ']
      real(wp) :: l, m, young, density
      integer :: i, j, k

      do k = 1, 3
         call check(error, is_material(materials(1, k), materials(2, k)))
         if (allocated(error)) return
         do i = 1, 3
            do j = 1, 3
               if (lengths(i) == 'mm' .and. masses(j) == 't') cycle
               ! What is shown when mm and t are read as the units of the case.
               l = unit_in_si(trim(lengths(i)))/1.0e-3_wp
               m = unit_in_si(trim(masses(j)))/1.0e3_wp
               young = materials(1, k)*m/l
               density = materials(2, k)*m/l**3
               call check(error, .not. is_material(young, density))
               if (allocated(error)) return
               call check(error, index(guess_unit_keys(young, density, trim(lengths(i)), trim(masses(j)), 's'), &
                  & "unit_length = 'mm', unit_mass = 't', unit_time = 's'") > 0, trim(lengths(i))//' '//trim(masses(j)))
               if (allocated(error)) return
            end do
         end do
      end do
   end subroutine test_keys

   subroutine test_stored(error)
      type(error_type), allocatable, intent(out) :: error
      integer :: k

      do k = 1, 3
         associate (young => materials(1, k), density => materials(2, k))
            call check(error, guess_stored_units(young*1.0e-3_wp, density*1.0e-9_wp), 'coordinates in mm')
            if (.not. allocated(error)) call check(error, guess_stored_units(young*1.0e-3_wp, density), 'stiffness in N/mm')
            if (.not. allocated(error)) call check(error, guess_stored_units(young, density*1.0e-3_wp), 'mass in t')
            if (.not. allocated(error)) call check(error, guess_stored_units(young*1.0e-6_wp, density*1.0e-12_wp), &
               & 'coordinates in mm, stiffness in N/mm, mass in t')
         end associate
         if (allocated(error)) return
      end do
      call check(error, guess_stored_units(1.0e20_wp, 1.0_wp), '')
   end subroutine test_stored

   subroutine test_modulus(error)
      type(error_type), allocatable, intent(out) :: error

      call check(error, guess_modulus_unit(2.1e5_wp, 1.94e11_wp), 'MPa (N/mm^2)')
      if (.not. allocated(error)) call check(error, guess_modulus_unit(210.0_wp, 1.94e11_wp), 'GPa')
      if (.not. allocated(error)) call check(error, guess_modulus_unit(7.0e10_wp, 2.1e11_wp), '')
   end subroutine test_modulus

   !> A joint that leaves out one row of faces of two.
   subroutine test_left_out(error)
      type(error_type), allocatable, intent(out) :: error
      type(fe_model_t) :: model
      type(left_out_t), allocatable :: left_out(:)
      integer, allocatable :: upper(:), lower(:)

      call block_model([block_t('lower', [0.0_wp, 0.0_wp, -0.02_wp], [0.06_wp, 0.04_wp, 0.02_wp], [3, 2, 1]), &
                        block_t('upper', [0.0_wp, 0.0_wp, 0.0_wp], [0.06_wp, 0.04_wp, 0.03_wp], [3, 2, 1])], &
                       ['lower_zmin'], model)
      call find_left_out(model, [facing_interface(model, 'upper_zmin', 'lower_zmax', 'joint')], left_out)
      call check(error, left_out(1)%faces, 0)
      if (allocated(error)) return
      upper = model%node_sets(model%find_node_set('upper_zmin'))%nodes
      lower = model%node_sets(model%find_node_set('lower_zmax'))%nodes
      model%node_sets = [model%node_sets, node_set_t('a', pack(upper, model%coordinates(2, upper) < 0.03_wp)), &
                         node_set_t('b', pack(lower, model%coordinates(2, lower) < 0.03_wp))]
      call find_left_out(model, [facing_interface(model, 'a', 'b', 'joint')], left_out)
      call check(error, left_out(1)%faces, 3)
      if (.not. allocated(error)) call check(error, left_out(1)%area, left_out(1)%area_of_interface, &
         & thr=1.0e-12_wp, rel=.true.)
      if (.not. allocated(error)) call check(error, model%coordinates(2, left_out(1)%first_node) > 0.03_wp)
   end subroutine test_left_out

end module test_fe_unit_guess
