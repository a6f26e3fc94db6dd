!> Base excitation: inertia forces of a unit acceleration.
module test_fe_base_load
   use microslip_core_error, only: error_t
   use microslip_core_kinds, only: wp
   use microslip_fe_load_pattern, only: base_load
   use microslip_fe_model, only: fe_model_t
   use microslip_linalg_sparse, only: from_triplets
   use support_brick, only: block_model, block_t
   use support_checks, only: good
   use testdrive, only: check, new_unittest, testing_error => error_type, unittest_type
   implicit none(type, external)
   private

   public :: collect_fe_base_load

   real(wp), parameter :: size_of(3) = [0.3_wp, 0.2_wp, 0.1_wp], density = 7800.0_wp, mass = density*product(size_of), &
      & rounding = 1.0e-12_wp

contains

   subroutine collect_fe_base_load(testsuite)
      type(unittest_type), allocatable, intent(out) :: testsuite(:)

      testsuite = [new_unittest('all of the mass, along the direction', test_free), &
         & new_unittest('a support that the mass couples to is refused', test_supported)]
   end subroutine collect_fe_base_load

   !> A block; the ends at x = 0 are fixed if `held`.
   function block_of_steel(held) result(model)
      logical, intent(in) :: held
      type(fe_model_t) :: model
      character(len=10), allocatable :: supports(:)

      supports = pack(['steel_xmin'], [held])
      call block_model([block_t('steel', [0.0_wp, 0.0_wp, 0.0_wp], size_of, [3, 2, 2])], supports, model)
   end function block_of_steel

   !> Sum of the components of a load.
   pure function total(model, load)
      type(fe_model_t), intent(in) :: model
      real(wp), intent(in) :: load(:)
      real(wp) :: total(3)
      integer :: c
      total = [(sum(load, model%row_component == c), c=1, 3)]
   end function total

   subroutine test_free(error)
      type(testing_error), allocatable, intent(out) :: error
      type(error_t), allocatable :: lib
      type(fe_model_t) :: model
      real(wp), allocatable :: load(:)

      model = block_of_steel(.false.)
      call base_load(model, [0.0_wp, 3.0_wp, 4.0_wp], load, lib)
      call good(error, lib)
      if (allocated(error)) return
      call check(error, maxval(abs(total(model, load) + mass*[0.0_wp, 0.6_wp, 0.8_wp])) < rounding*mass)
   end subroutine test_free

   !> With a lumped mass matrix what is at the support moves with the base and puts no load on the rest.
   subroutine test_supported(error)
      type(testing_error), allocatable, intent(out) :: error
      type(error_t), allocatable :: lib
      type(fe_model_t) :: model
      real(wp), allocatable :: load(:)
      real(wp) :: lumped
      integer, allocatable :: rows(:)
      integer :: k

      model = block_of_steel(.true.)
      call base_load(model, [0.0_wp, 0.0_wp, 1.0_wp], load, lib)
      call check(error, allocated(lib))
      if (allocated(error)) return
      call check(error, index(lib%message, 'is supported') > 0 .and. index(lib%message, 'lumped mass') > 0, lib%message)
      if (allocated(error)) return
      ! The same elements as other ones: solids couple masses, springs do not.
      model%other_elements = model%elements
      deallocate (model%elements)
      model%other_elements(1)%type = 'C3D15'
      call base_load(model, [0.0_wp, 0.0_wp, 1.0_wp], load, lib)
      call check(error, allocated(lib), 'a wedge at the support')
      if (allocated(error)) return
      model%other_elements(1)%type = 'SPRINGA'
      call base_load(model, [0.0_wp, 0.0_wp, 1.0_wp], load, lib)
      call good(error, lib)
      if (allocated(error)) return
      rows = [(k, k=1, model%row_count())]
      lumped = 0.7_wp
      model%mass = from_triplets(size(rows), rows, rows, spread(lumped, 1, size(rows)))
      call base_load(model, [0.0_wp, 0.0_wp, 1.0_wp], load, lib)
      call good(error, lib)
      if (allocated(error)) return
      call check(error, all(abs(load + merge(lumped, 0.0_wp, model%row_component == 3)) < rounding))
   end subroutine test_supported

end module test_fe_base_load
