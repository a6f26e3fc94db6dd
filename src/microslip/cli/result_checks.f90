!> What is doubtful about results: the thresholds, and the words of the warnings.
module microslip_cli_result_checks
   use microslip_analysis_operating_state, only: operating_state_t
   use microslip_analysis_qsma, only: masing_tolerance, qsma_record_t
   use microslip_core_kinds, only: wp
   use microslip_core_text, only: to_text
   use microslip_core_warning_list, only: severity_doubtful, severity_note, severity_wrong, warning_list_t
   use microslip_system_coupling_error, only: coupling_error_t
   use microslip_system_jointed_system, only: jointed_system_t
   use microslip_system_pad, only: pad_t
   implicit none(type, external)
   private

   public :: check_preload, check_masing, check_slip, check_energy, check_coupling

   !> Energy that is not accounted for, as a part of what went through: doubtful, most likely wrong.
   real(wp), parameter :: doubtful_balance = 1.0e-2_wp, wrong_balance = 1.0e-1_wp
   !> Tangential displacement of a closed point over the width of a cell: from here on it faces its neighbour's height.
   real(wp), parameter :: much_slip = 0.5_wp
   !> Tangential resultant of an interface over what its friction can hold: doubtful for a preload, sliding.
   real(wp), parameter :: much_friction = 0.5_wp, sliding = 0.99_wp
   !> Deviation of the scale-split coupling from the half space: doubtful. Meshes as they are asked for show a tenth to a quarter.
   real(wp), parameter :: doubtful_coupling = 0.3_wp

contains

   !> A preload that pulls, opens or slides.
   subroutine check_preload(system, state, names, amplitude, imposed, by_force, warnings)
      type(jointed_system_t), intent(in) :: system
      !> What the preload ended in
      type(operating_state_t), intent(in) :: state
      !> (loads) names and amplitudes of its loads
      character(len=*), intent(in) :: names(:)
      real(wp), intent(in) :: amplitude(:)
      !> (loads) whether they are imposed motions
      logical, intent(in) :: imposed(:)
      !> Whether the amplitudes were found from interface forces
      logical, intent(in) :: by_force
      type(warning_list_t), intent(inout) :: warnings
      real(wp), allocatable :: normal(:)
      real(wp) :: resultant(2), limit
      integer :: k

      if (by_force) then
         do k = 1, size(names)
            if (imposed(k) .or. amplitude(k) >= 0.0_wp) cycle
            call warnings%add(severity_wrong, "preload: load '"//trim(names(k))//"' is scaled by "//to_text(amplitude(k), 4) &
               & //': as it is given it pulls the interface open; turn its direction round in &load')
         end do
      end if
      normal = system%interface_forces(state%contact%force)
      do k = 1, size(normal)
         associate (pad => system%pads(k), first => system%pads(k)%point_offset)
            if (.not. normal(k) > 0.0_wp) then
               call warnings%add(severity_wrong, "preload: interface '"//pad%contact%name//"' is open: nothing presses it " &
                  & //'together; are the directions and sizes of the loads in &preload right?')
               cycle
            end if
            resultant = sum(state%contact%force(2:3, first + 1:first + size(pad%potential)), dim=2)
            limit = pad%friction*normal(k)
            if (norm2(resultant) > much_friction*limit) call warnings%add(merge(severity_wrong, severity_doubtful, &
               & norm2(resultant) > sliding*limit), "preload: interface '"//pad%contact%name//"' carries " &
               & //to_text(norm2(resultant), 4)//' N along its plane and '//to_text(normal(k), 4)//' N across it, ' &
               & //to_text(1.0e2_wp*norm2(resultant)/limit, 3)//' % of what friction holds: the preload ' &
               & //trim(merge('slides it     ', 'nearly slides ', norm2(resultant) > sliding*limit)) &
               & //'; are the directions of the loads right?')
         end associate
      end do
   end subroutine check_preload

   !> The scale-split coupling's estimate of its own error.
   subroutine check_coupling(pad, estimate, warnings)
      type(pad_t), intent(in) :: pad
      type(coupling_error_t), intent(in) :: estimate
      type(warning_list_t), intent(inout) :: warnings
      character(len=:), allocatable :: place

      place = "interface '"//pad%contact%name//"': "
      if (.not. estimate%radius > 0.0_wp) then
         call warnings%add(severity_note, place//'the pad has no room for a disc of 1.5 FE node distances: the scale-split ' &
            & //'coupling could not be checked against the half space; a finer FE mesh makes room')
      else if (maxval(estimate%deviation) > doubtful_coupling) then
         call warnings%add(severity_doubtful, place//'the scale-split coupling is '// &
            & to_text(1.0e2_wp*maxval(estimate%deviation), 2)//' % away from the half space (more than ' &
            & //to_text(1.0e2_wp*doubtful_coupling)//' %): is young_modulus that of the mesh, are the elements there regular, ' &
            & //'and the bodies thick against the node distance?')
      end if
   end subroutine check_coupling

   !> Masing's rule where it does not hold, and loops that do not close.
   subroutine check_masing(record, only_masing, warnings)
      type(qsma_record_t), intent(in) :: record
      !> Loops are ruled out
      logical, intent(in) :: only_masing
      type(warning_list_t), intent(inout) :: warnings
      character(len=:), allocatable :: found
      integer :: k

      if (.not. record%masing_holds) then
         k = maxloc(record%contradiction, dim=1)
         found = "qsma: Masing's rule does not hold: at "//to_text(1.0e6_wp*record%combined(k)%amplitude, 4) &
            & //' um the two directions give friction damping ratios of ' &
            & //to_text(record%direction(k, 1)%friction_damping_ratio, 3)//' and ' &
            & //to_text(record%direction(k, 2)%friction_damping_ratio, 3)
         if (only_masing .or. .not. allocated(record%loop)) then
            call warnings%add(merge(severity_wrong, severity_doubtful, any(record%direction%friction_damping_ratio < 0.0_wp)), &
               & found//': the normal forces vary. Leave out cycle = .false. in &qsma: then hysteresis loops are the result')
         else
            if (record%contradiction(k) <= masing_tolerance) found = "qsma: Masing's rule does not hold: it is " &
               & //to_text(1.0e2_wp*record%masing_error, 2)//' % away from a hysteresis loop at the largest amplitude'
            call warnings%add(severity_note, found//'; the result comes from hysteresis loops at all amplitudes')
         end if
      end if
      if (record%open_loops() > 0) call warnings%add(severity_doubtful, 'qsma: '//to_text(record%open_loops())//' of ' &
         & //to_text(size(record%closure))//' hysteresis loops do not close (by '//to_text(maxval(record%closure), 2) &
         & //' of their width): the joint creeps under this load, so its damping has no one value; smaller amplitudes, or a ' &
         & //'ring-down, tell more')
   end subroutine check_masing

   !> Slip that is not small.
   subroutine check_slip(analysis, cells, warnings)
      !> Who found it
      character(len=*), intent(in) :: analysis
      !> Largest tangential displacement of a closed point, in cells
      real(wp), intent(in) :: cells
      type(warning_list_t), intent(inout) :: warnings

      if (cells > much_slip) call warnings%add(severity_doubtful, analysis//': a closed point moves by '//to_text(cells, 2) &
         & //' cells along the interface, where slip is taken to be small (below '//to_text(much_slip)//'): the surfaces are not ' &
         & //'moved past one another; results hold for flat surfaces far from edges only')
   end subroutine check_slip

   !> Energy that is not accounted for.
   subroutine check_energy(analysis, unaccounted, warnings)
      !> Who found it
      character(len=*), intent(in) :: analysis
      !> Largest energy balance error over the largest of kinetic energy, external work and losses
      real(wp), intent(in) :: unaccounted
      type(warning_list_t), intent(inout) :: warnings

      if (unaccounted > doubtful_balance) call warnings%add(merge(severity_wrong, severity_doubtful, &
         & unaccounted > wrong_balance), analysis//': the energy balance misses '//to_text(1.0e2_wp*unaccounted, 2) &
         & //' % of the energy that went through (more than '//to_text(1.0e2_wp*doubtful_balance)//' %): the time step is too ' &
         & //'large for what happens in the contact; a smaller safety (or time_step) helps')
   end subroutine check_energy

end module microslip_cli_result_checks
