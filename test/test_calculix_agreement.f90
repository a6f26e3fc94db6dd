!> Tied frequencies of two joined blocks against those that CalculiX finds when the blocks share their joint nodes:
!> the way from the matrix files through the interface and the relative coordinates to the reduced model.
!>
!> Files and printed frequencies: test/data/make_joined_blocks.py with CalculiX 2.20.
module test_calculix_agreement
   use microslip_core_error, only: error_t
   use microslip_core_kinds, only: pi, wp
   use microslip_core_text, only: to_text
   use microslip_fe_interface, only: contact_interface_t, interface_from_plane, interface_from_sets
   use microslip_fe_model, only: fe_model_t
   use microslip_fe_reduced_model, only: reduced_model_t
   use microslip_fe_reduction, only: craig_bampton_massless, reduce, reduction_options_t
   use microslip_fe_relative_coordinates, only: new_relative_coordinates, relative_coordinates_t
   use microslip_io_calculix, only: calculix_matrices_t, read_calculix_matrices, read_model_calculix
   use microslip_linalg_dense, only: eigen_generalised
   use support_brick, only: to_dense
   use testdrive, only: check, new_unittest, test_failed, testing_error => error_type, unittest_type
   implicit none(type, external)
   private

   public :: collect_calculix_agreement

   !> Files of the fixtures without ending: elements without hidden nodes, and with them.
   character(len=*), parameter :: quadratic = 'test/data/joined_blocks', incompatible = 'test/data/joined_blocks_c3d8i'
   !> The files' units in m, kg, s.
   real(wp), parameter :: mm = 1.0e-3_wp, tonne = 1.0e3_wp, second = 1.0_wp
   !> Hz, as CalculiX's *FREQUENCY printed them in 7 digits, joint nodes shared.
   integer, parameter :: modes = 8
   real(wp), parameter :: printed_quadratic(modes) = [0.5809242e+04_wp, 0.7121783e+04_wp, 0.1501168e+05_wp, &
      0.2620937e+05_wp, 0.2683774e+05_wp, 0.2870291e+05_wp, 0.4718268e+05_wp, 0.6888644e+05_wp]
   real(wp), parameter :: printed_incompatible(modes) = [0.5909965e+04_wp, 0.7566793e+04_wp, 0.1568312e+05_wp, &
      0.2506160e+05_wp, 0.2996005e+05_wp, 0.3088913e+05_wp, 0.3385598e+05_wp, 0.4831357e+05_wp]
   !> Digits after the point of 0.ddddddd, and what their rounding leaves: half a unit of the last one, at most 5e-7 of the
   !> frequency. The matrices' own 14 digits, times a condition of some 1e4, leave a thousandth of that.
   integer, parameter :: digits_printed = 7
   real(wp), parameter :: half_unit = 0.501_wp
   !> Equality of places, against edges of some mm.
   real(wp), parameter :: same_place = 1.0e-12_wp

contains

   subroutine collect_calculix_agreement(testsuite)
      type(unittest_type), allocatable, intent(out) :: testsuite(:)

      testsuite = [ &
         new_unittest('tied frequencies to the last printed digit', test_quadratic), &
         new_unittest('sets and plane give the same pairs', test_same_pairs), &
         new_unittest('hidden nodes kept: to the last printed digit', test_hidden_kept), &
         new_unittest('hidden nodes condensed: within (f/f_hidden)^2', test_hidden_condensed)]
   end subroutine collect_calculix_agreement

   !> Largest rounding of a printed frequency, Hz.
   elemental real(wp) function rounding(frequency)
      real(wp), intent(in) :: frequency
      rounding = half_unit*10.0_wp**(floor(log10(frequency)) + 1 - digits_printed)
   end function rounding

   !> Model and joint of a fixture.
   subroutine read_fixture(base, model, joint, lib)
      character(len=*), intent(in) :: base
      type(fe_model_t), intent(out) :: model
      type(contact_interface_t), intent(out) :: joint
      type(error_t), allocatable, intent(out) :: lib

      call read_model_calculix(base, base//'.inp', mm, tonne, second, model, lib)
      if (.not. allocated(lib)) call interface_from_sets(model, 'joint', 'joint_upper', 'joint_lower', joint, error=lib)
   end subroutine read_fixture

   !> Tied frequencies of a fixture by Craig-Bampton, Hz.
   subroutine tied_frequencies(base, frequency, lib)
      character(len=*), intent(in) :: base
      real(wp), intent(out) :: frequency(modes)
      type(error_t), allocatable, intent(out) :: lib
      type(fe_model_t) :: model
      type(contact_interface_t) :: joint
      type(reduced_model_t) :: reduced
      real(wp), allocatable :: no_patterns(:, :)

      frequency = 0.0_wp
      call read_fixture(base, model, joint, lib)
      if (allocated(lib)) return
      allocate (no_patterns(model%row_count(), 0))
      call reduce(model, [joint], no_patterns, reduction_options_t(craig_bampton_massless, modes=modes), reduced, lib)
      if (.not. allocated(lib)) frequency = reduced%frequency(:reduced%tied_modes)
   end subroutine tied_frequencies

   subroutine test_quadratic(error)
      type(testing_error), allocatable, intent(out) :: error
      type(error_t), allocatable :: lib
      real(wp) :: f(modes)

      call tied_frequencies(quadratic, f, lib)
      call agree(error, lib, f, printed_quadratic, rounding(printed_quadratic))
   end subroutine test_quadratic

   !> 13 pairs under two 8-node faces; the plane is the joint's own, and the coincident nodes are told apart by side.
   subroutine test_same_pairs(error)
      type(testing_error), allocatable, intent(out) :: error
      integer, parameter :: pairs(2) = [13, 6], nodes_per_face(2) = [8, 4]
      character(len=30), parameter :: base(2) = [character(len=30) :: quadratic, incompatible]
      type(fe_model_t) :: model
      type(contact_interface_t) :: joint, cut
      type(error_t), allocatable :: lib
      integer :: k

      do k = 1, size(base)
         call read_fixture(trim(base(k)), model, joint, lib)
         if (.not. allocated(lib)) call interface_from_plane(model, 'joint', [0.0_wp, 0.0_wp, 0.0_wp], &
            [0.0_wp, 0.0_wp, 1.0_wp], cut, error=lib)
         if (allocated(lib)) then
            call test_failed(error, lib%message)
            return
         end if
         call check(error, joint%pair_count(), pairs(k))
         if (.not. allocated(error)) call check(error, cut%pair_count(), pairs(k))
         if (.not. allocated(error)) call check(error, all(cut%node_a == joint%node_a .and. cut%node_b == joint%node_b), &
            'sets and plane give different pairs')
         if (.not. allocated(error)) call check(error, maxval(abs(model%coordinates(:, joint%node_a) &
            - model%coordinates(:, joint%node_b))) <= same_place, 'nodes of a pair lie apart')
         if (.not. allocated(error)) call check(error, all(count(joint%faces > 0, dim=1) == nodes_per_face(k)) &
            .and. size(joint%faces, 2) == 2, 'faces differ')
         if (.not. allocated(error)) call check(error, all(abs(cut%frame - joint%frame) <= same_place), 'frames differ')
         if (allocated(error)) return
      end do
   end subroutine test_same_pairs

   !> The tied problem with the hidden nodes as nodes of their own, dense: nothing is lost before the condensation.
   !> Largest eigenvalues of M x = omega^-2 K x, as CalculiX's mass of the hidden nodes is not positive definite.
   subroutine test_hidden_kept(error)
      type(testing_error), allocatable, intent(out) :: error
      type(fe_model_t) :: model
      type(contact_interface_t) :: joint
      type(calculix_matrices_t) :: matrices
      type(relative_coordinates_t) :: coordinates
      type(error_t), allocatable :: lib
      integer, allocatable :: tied(:)
      real(wp) :: f(modes)
      integer :: k

      call read_fixture(incompatible, model, joint, lib)
      if (.not. allocated(lib)) call read_calculix_matrices(incompatible, matrices, lib)
      if (.not. allocated(lib)) then
         ! Labels of the mesh run from 1 without gaps, those of the hidden nodes follow.
         model%node_label = [(k, k=1, maxval(matrices%label))]
         model%row_node = matrices%label
         model%row_component = matrices%component
         call new_relative_coordinates(model, [joint], coordinates, lib)
      end if
      f = 0.0_wp
      if (.not. allocated(lib)) then
         tied = pack([(k, k=1, size(matrices%label))], [(all(coordinates%boundary_rows /= k), k=1, size(matrices%label))])
         call lowest_frequencies(to_dense(coordinates%transformed_matrix(matrices%stiffness)), &
            to_dense(coordinates%transformed_matrix(matrices%mass)), tied, f, lib)
      end if
      call agree(error, lib, f, printed_incompatible, rounding(printed_incompatible))
   end subroutine test_hidden_kept

   !> Guyan's error is (f/f_hidden)^2 times a part of the mass; it means little where f comes near f_hidden, the lowest
   !> frequency of the hidden nodes with all others held.
   subroutine test_hidden_condensed(error)
      type(testing_error), allocatable, intent(out) :: error
      real(wp), parameter :: far_below = 1.0_wp/3.0_wp
      type(fe_model_t) :: model
      type(contact_interface_t) :: joint
      type(calculix_matrices_t) :: matrices
      type(error_t), allocatable :: lib
      integer, allocatable :: hidden(:)
      real(wp) :: f(modes), f_hidden(1)
      integer :: k, low

      f_hidden = huge(1.0_wp)
      call read_fixture(incompatible, model, joint, lib)
      if (.not. allocated(lib)) call read_calculix_matrices(incompatible, matrices, lib)
      if (.not. allocated(lib)) then
         hidden = pack([(k, k=1, size(matrices%label))], matrices%label > maxval(model%node_label))
         call lowest_frequencies(to_dense(matrices%stiffness), to_dense(matrices%mass), hidden, f_hidden, lib)
      end if
      if (.not. allocated(lib)) call tied_frequencies(incompatible, f, lib)
      low = count(printed_incompatible < far_below*f_hidden(1))
      call agree(error, lib, f(:low), printed_incompatible(:low), &
         rounding(printed_incompatible(:low)) + printed_incompatible(:low)*(printed_incompatible(:low)/f_hidden(1))**2)
      if (.not. allocated(error)) call check(error, low >= 3, 'too few modes below the hidden ones')
   end subroutine test_hidden_condensed

   !> Lowest frequencies of some rows, the others held, Hz.
   subroutine lowest_frequencies(stiffness, mass, rows, frequency, lib)
      real(wp), intent(in) :: stiffness(:, :), mass(:, :)
      integer, intent(in) :: rows(:)
      real(wp), intent(out) :: frequency(:)
      type(error_t), allocatable, intent(out) :: lib
      real(wp), allocatable :: a(:, :), b(:, :), lambda(:)

      a = mass(rows, rows)
      b = stiffness(rows, rows)
      allocate (lambda(size(rows)))
      call eigen_generalised(a, b, lambda, lib, values_only=.true.)
      frequency = 0.0_wp
      if (.not. allocated(lib)) frequency = 1.0_wp/(2.0_wp*pi*sqrt(lambda(size(rows):size(rows) - size(frequency) + 1:-1)))
   end subroutine lowest_frequencies

   !> Every frequency within its tolerance.
   subroutine agree(error, lib, frequency, printed, tolerance)
      type(testing_error), allocatable, intent(out) :: error
      type(error_t), allocatable, intent(in) :: lib
      !> Hz
      real(wp), intent(in) :: frequency(:), printed(:), tolerance(:)
      integer :: k

      if (allocated(lib)) then
         call test_failed(error, lib%message)
         return
      end if
      do k = 1, size(printed)
         call check(error, abs(frequency(k) - printed(k)) <= tolerance(k), 'mode '//to_text(k)//': '// &
            to_text(frequency(k), 10)//' Hz, CalculiX '//to_text(printed(k), 10)//' Hz')
         if (allocated(error)) return
      end do
   end subroutine agree

end module test_calculix_agreement
