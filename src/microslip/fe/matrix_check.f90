!> Whether mesh and matrices belong together, judged by what `microslip_fe_model_survey` found.
!>
!> Refused, with what it looks like:
!>
!>     stiffness joins no nodes at all, or not all that share an element     one triangle of half a matrix; other numbering
!>     mass joins nodes that the stiffness does not join                     mass of another model
!>     no mass under a rigid translation                                     stiffness in place of the mass
!>     T_i = half the diagonal of the stiffness                              diagonal counted twice
!>     T_i not zero, and not that of a spring to the ground                  rotated nodal frames
!>     T_i zero, but forces under a rigid rotation                           nodes exchanged or moved, axes exchanged
!>     sum of m_i not the same along x, y, z; m_i not of one sign with the volume       half a mass matrix, mass of another model
!>
!> The last four look at inner nodes only, so that supports, constraints, springs between nodes and elements that the mesh
!> file leaves out are not mistaken for faults. Digits of the files are allowed for (node_sums); beyond them small residues
!> are told: those of rotations are what a stress in the structure (geometric stiffness) leaves.
module microslip_fe_matrix_check
   use microslip_core_error, only: bad_input, error_t
   use microslip_core_kinds, only: wp
   use microslip_core_text, only: to_text
   use microslip_core_warning_list, only: severity_doubtful, severity_note, warning_list_t
   use microslip_fe_model, only: fe_model_t
   use microslip_fe_model_survey, only: median, model_survey_t, rounding_of_entries, stressed_rotation
   implicit none(type, external)
   private

   public :: check_matrices

   !> T_i, as a part of the sum of the sizes of its terms, from which on nothing but a fault is left; moments of rotations from
   !> `stressed_rotation` on.
   real(wp), parameter :: wrong_translation = 1.0e-3_wp
   !> Differences between the masses along x, y and z: those of condensed mass at the rim of the inner nodes stay below.
   real(wp), parameter :: wrong_mass = 0.05_wp
   !> Nodal densities this far from the median on that share of the nodes are not those of several materials.
   real(wp), parameter :: density_factor = 20.0_wp, density_share = 0.2_wp

contains

   !> The first fault of the matrices.
   subroutine check_matrices(model, survey, warnings, error)
      type(fe_model_t), intent(in) :: model
      type(model_survey_t), intent(in) :: survey
      !> What is doubtful
      type(warning_list_t), intent(inout) :: warnings
      !> Names nodes; not the file
      type(error_t), allocatable, intent(out) :: error
      type(warning_list_t) :: found

      call check_couplings(model, survey, error)
      if (.not. allocated(error)) call check_total_mass(survey, error)
      if (.not. allocated(error)) call check_diagonal(model, survey, error)
      if (.not. allocated(error)) call check_translations(model, survey, found, error)
      if (.not. allocated(error)) call check_rotations(model, survey, found, error)
      if (.not. allocated(error)) call check_mass(model, survey, found, error)
      ! A fault explains what is doubtful.
      if (.not. allocated(error)) call warnings%append(found)
   end subroutine check_matrices

   !> The entries join the nodes that share an element.
   subroutine check_couplings(model, survey, error)
      type(fe_model_t), intent(in) :: model
      type(model_survey_t), intent(in) :: survey
      type(error_t), allocatable, intent(out) :: error
      character(len=:), allocatable :: cause

      if (survey%pairs == 0) return
      if (survey%missing == survey%pairs .and. survey%foreign == 0) then
         call bad_input(error, 'the stiffness matrix joins none of the '//to_text(survey%pairs)//' pairs of nodes that ' &
            & //'share an element: this looks like half of a matrix, the other triangle than the expected one')
      else if (survey%missing > 0) then
         cause = 'nodes are numbered in another way in the mesh than in the matrices'
         if (survey%foreign == 0) cause = 'elements of the mesh are missing in the matrices'
         call bad_input(error, 'mesh and matrices do not belong together: of '//to_text(survey%pairs)//' pairs of nodes that ' &
            & //'share an element the stiffness matrix joins '//to_text(survey%missing)//' not, first '// &
            & pair_text(survey%first_missing)//other_couplings()//'; this looks as if '//cause)
      else if (survey%mass_alone > 0) then
         call bad_input(error, 'stiffness and mass do not belong together: the mass matrix joins '//to_text(survey%mass_alone) &
            & //' pairs of nodes that neither share an element nor are joined by the stiffness, first '// &
            & pair_text(survey%first_mass_alone)//'; this looks like the mass of another model or of another numbering')
      end if

   contains

      function pair_text(pair) result(text)
         integer, intent(in) :: pair(2)
         character(len=:), allocatable :: text
         text = 'nodes '//to_text(model%node_label(pair(1)))//' and '//to_text(model%node_label(pair(2)))
      end function pair_text

      function other_couplings() result(text)
         character(len=:), allocatable :: text
         text = ''
         if (survey%foreign > 0) text = ', and it joins '//to_text(survey%foreign)//' pairs that share none, first '// &
            & pair_text(survey%first_foreign)
      end function other_couplings

   end subroutine check_couplings

   !> A rigid translation moves mass.
   subroutine check_total_mass(survey, error)
      type(model_survey_t), intent(in) :: survey
      type(error_t), allocatable, intent(out) :: error
      logical, allocatable :: away(:)
      real(wp) :: total, entries
      integer :: a, c

      away = survey%inner
      if (.not. any(away)) away = survey%complete .and. survey%in_element
      if (.not. any(away)) return
      total = 0.0_wp
      entries = 0.0_wp
      do a = 1, size(away)
         if (.not. away(a)) cycle
         total = total + sum([(survey%sums%mass(c, c, a), c=1, 3)])
         entries = entries + sum(survey%sums%mass_size(:, a))
      end do
      if (total > rounding_of_entries*entries) return
      call bad_input(error, 'the mass matrix gives a mass of '//to_text(total/3.0_wp, 3)//' kg to a rigid translation of the '// &
         & to_text(count(away))//' nodes away from supports, its entries add up to '//to_text(entries/3.0_wp, 3)// &
         & ' kg: this looks like a stiffness in place of the mass')
   end subroutine check_total_mass

   !> The diagonal is not counted twice.
   subroutine check_diagonal(model, survey, error)
      type(fe_model_t), intent(in) :: model
      type(model_survey_t), intent(in) :: survey
      type(error_t), allocatable, intent(out) :: error
      integer :: a, c, twice

      twice = 0
      do a = 1, model%node_count()
         if (.not. (survey%inner(a) .and. survey%grounded(a))) cycle
         if (all([(abs(survey%sums%translation(c, c, a) - 0.5_wp*survey%sums%stiffness_diagonal(c, a)) <= &
            & rounding_of_entries*survey%sums%translation_size(c, a), c=1, 3)])) twice = twice + 1
      end do
      if (twice == 0) return
      call bad_input(error, 'the stiffness matrix resists rigid translations of '//to_text(twice)//' of '// &
         & to_text(count(survey%inner))//' nodes away from supports by half of its diagonal: this looks as if the diagonal was ' &
         & //'counted twice, or the rest halved, when two triangles were put together')
   end subroutine check_diagonal

   !> No forces under rigid translations.
   subroutine check_translations(model, survey, warnings, error)
      type(fe_model_t), intent(in) :: model
      type(model_survey_t), intent(in) :: survey
      type(warning_list_t), intent(inout) :: warnings
      type(error_t), allocatable, intent(out) :: error
      logical, allocatable :: judged(:), bad(:)
      integer :: worst

      judged = survey%inner .and. .not. survey%grounded
      bad = judged .and. survey%held > wrong_translation
      if (any(bad)) then
         worst = maxloc(survey%held, 1, bad)
         call bad_input(error, 'the stiffness matrix resists rigid translations at '//to_text(count(bad))//' of '// &
            & to_text(count(survey%inner))//' nodes away from supports and springs, most at node '// &
            & to_text(model%node_label(worst))//' ('//to_text(100.0_wp*survey%held(worst), 2)//' % of the forces that its ' &
            & //'entries give): this looks like nodal frames that are rotated against x, y, z; rows must be displacements ' &
            & //'along the axes of the mesh')
         return
      end if
      bad = judged .and. survey%held > rounding_of_entries
      if (any(bad)) then
         worst = maxloc(survey%held, 1, bad)
         call warnings%add(severity_doubtful, '&model: the stiffness matrix resists rigid translations at '// &
            & to_text(count(bad))//' nodes away from supports and springs by '//to_text(survey%held(worst), 2)// &
            & ' of the forces that its entries give at most (node '//to_text(model%node_label(worst))// &
            & '): entries with too few digits, or something pushes')
      end if
   end subroutine check_translations

   !> No forces under rigid rotations.
   subroutine check_rotations(model, survey, warnings, error)
      type(fe_model_t), intent(in) :: model
      type(model_survey_t), intent(in) :: survey
      type(warning_list_t), intent(inout) :: warnings
      type(error_t), allocatable, intent(out) :: error
      logical, allocatable :: judged(:), bad(:)
      integer :: worst
      character(len=:), allocatable :: cause

      judged = survey%inner .and. .not. survey%grounded
      bad = judged .and. survey%turned > stressed_rotation + survey%turn_rounding
      if (any(bad)) then
         worst = maxloc(survey%turned, 1, bad)
         cause = 'nodes that were exchanged or moved in the mesh after the matrices were made'
         if (2*count(bad) > count(judged)) cause = 'axes that were exchanged or turned, in all nodal frames or in the mesh'
         call bad_input(error, 'mesh and matrices do not belong together: the stiffness matrix resists rigid rotations at '// &
            & to_text(count(bad))//' of '//to_text(count(survey%inner))//' nodes away from supports and springs, most at node ' &
            & //to_text(model%node_label(worst))//' ('//to_text(100.0_wp*survey%turned(worst), 2)//' % of the forces that its ' &
            & //'entries give): this looks like '//cause)
         return
      end if
      bad = judged .and. survey%turned > survey%turn_rounding
      if (any(bad)) then
         worst = maxloc(survey%turned, 1, bad)
         call warnings%add(severity_note, '&model: the stiffness matrix resists rigid rotations at '//to_text(count(bad))// &
            & ' nodes away from supports and springs by '//to_text(survey%turned(worst), 2)//' of the forces that its entries ' &
            & //'give at most (node '//to_text(model%node_label(worst))//'): a structure under stress (geometric stiffness), ' &
            & //'or coordinates with too few digits')
      end if
   end subroutine check_rotations

   !> The same mass along x, y and z, and as the volume has it.
   subroutine check_mass(model, survey, warnings, error)
      type(fe_model_t), intent(in) :: model
      type(model_survey_t), intent(in) :: survey
      type(warning_list_t), intent(inout) :: warnings
      type(error_t), allocatable, intent(out) :: error
      logical, allocatable :: bad(:), shown(:)
      real(wp) :: total(3), middle
      integer :: a, c, first

      ! Of single nodes this does not hold: condensed incompatible modes move mass from node to node, along each axis in
      ! another way.
      total = 0.0_wp
      do a = 1, model%node_count()
         if (survey%inner(a)) total = total + [(survey%sums%mass(c, c, a), c=1, 3)]
      end do
      if (maxval(total) - minval(total) > wrong_mass*maxval(total)) then
         call bad_input(error, 'the mass matrix gives a mass of '//to_text(total(1), 4)//', '//to_text(total(2), 4)//', '// &
            & to_text(total(3), 4)//' kg to rigid translations along x, y, z of the '//to_text(count(survey%inner))// &
            & ' nodes away from supports; they must be the same: this looks like half of a matrix, or rotated nodal frames')
         return
      end if
      shown = abs(survey%density) > 0.0_wp
      if (.not. any(shown)) return
      if (2*count(survey%doubled) > count(shown)) then
         call bad_input(error, 'the diagonal of the mass matrix is counted twice: at '//to_text(count(survey%doubled))//' of ' &
            & //to_text(count(shown))//' nodes away from supports it is to the rest of its row as twice the diagonal of a ' &
            & //'consistent mass matrix')
         return
      end if
      middle = median(survey%density)
      bad = shown .and. (survey%density < middle/density_factor .or. survey%density > middle*density_factor)
      if (middle <= 0.0_wp) bad = shown
      if (count(bad) <= density_share*count(shown)) return
      if (is_diagonal()) then
         call warnings%add(severity_note, '&model: the mass matrix is diagonal, and its shares of the mass are not those of '// &
            & 'the shape functions at '//to_text(count(bad))//' of '//to_text(count(shown))//' nodes')
      else
         first = findloc(bad, .true., 1)
         call bad_input(error, 'mass and mesh do not belong together: at '//to_text(count(bad))//' of '// &
            & to_text(count(shown))//' nodes away from supports mass over volume is not within a factor '// &
            & to_text(density_factor)//' of the median '//to_text(middle, 3)//' kg/m^3, first node '// &
            & to_text(model%node_label(first))//' ('//to_text(survey%density(first), 3)//' kg/m^3): this looks like the mass ' &
            & //'of another model')
      end if

   contains

      pure logical function is_diagonal()
         is_diagonal = sum(survey%sums%mass_size) <= sum(survey%sums%mass_diagonal)*(1.0_wp + rounding_of_entries)
      end function is_diagonal

   end subroutine check_mass

end module microslip_fe_matrix_check
