!> What a case will compute, what it will cost, and what it skips and why.
module microslip_cli_scene_report
   use microslip_analysis_excitation, only: end_of_all, excitation_t
   use microslip_analysis_harmonic_meter, only: harmonic_meter_t
   use microslip_cli_demand, only: boundary_count, demand_in_words, demand_t, expected_unknowns, factor_entries, takes_all, &
      & uses_fft
   use microslip_cli_log, only: log_t
   use microslip_cli_motion_input, only: excitations_of, meter_of
   use microslip_cli_scene, only: scene_t
   use microslip_core_kinds, only: wp
   use microslip_core_text, only: to_text
   use microslip_fe_model, only: element_counts, fe_model_t
   use microslip_io_case, only: case_t
   use microslip_system_compliance_choice, only: why_form
   use microslip_system_pad, only: pad_t
   implicit none(type, external)
   private

   public :: report_scene, report_elements, reduction_seconds

   !> Rates that the time estimates rest on: dense and sparse factorisation, memory traffic of one core.
   real(wp), parameter :: dense_rate = 3.0e10_wp, sparse_rate = 5.0e9_wp, memory_rate = 5.0e9_wp
   !> Of the FFT operator: unknowns per second of a product, products of a preload.
   real(wp), parameter :: fft_rate = 3.0e6_wp, fft_products = 2000.0_wp

contains

   !> Print sizes, estimates and what is skipped.
   subroutine report_scene(log, case, scene, demand)
      type(log_t), intent(in) :: log
      type(case_t), intent(in) :: case
      type(scene_t), intent(in) :: scene
      !> Memory and disk
      type(demand_t), intent(in) :: demand
      integer :: k

      call log%line('FE model: '//to_text(scene%model%node_count())//' nodes, '//to_text(scene%model%row_count()) &
         & //' rows, '//to_text(scene%model%stiffness%entries())//' entries in the stiffness triangle')
      do k = 1, size(scene%pads)
         associate (pad => scene%pads(k))
            call log%line("interface '"//pad%contact%name//"': "//to_text(pad%contact%pair_count())//' node pairs, ' &
               & //to_text(size(pad%contact%faces, 2))//' faces; '//points_of(pad)//'; '//surface_of(pad)//'; friction ' &
               & //to_text(pad%friction))
         end associate
      end do
      call report_cost(log, case, scene, demand)
      call report_skipped(log, case, scene)
   end subroutine report_scene

   !> Which elements the model has, if some of them cannot be joints.
   subroutine report_elements(log, model)
      type(log_t), intent(in) :: log
      type(fe_model_t), intent(in) :: model

      if (.not. allocated(model%other_elements)) return
      if (size(model%other_elements) > 0) call log%line('elements: '//element_counts(model%elements) &
         & //'; others, which cannot be joints: '//element_counts(model%other_elements))
   end subroutine report_elements

   !> Where the contact points of a pad come from, in words.
   function points_of(pad) result(text)
      type(pad_t), intent(in) :: pad
      character(len=:), allocatable :: text

      associate (grid => pad%grid)
         if (pad%half_space) then
            text = 'grid '//to_text(grid%nx)//' x '//to_text(grid%ny)//' cells of '//to_text(1.0e3_wp*grid%dx, 4)//' x ' &
               & //to_text(1.0e3_wp*grid%dy, 4)//' mm, '//to_text(grid%point_count())//' points'
         else
            text = to_text(grid%point_count())//' points at the FE nodes with areas of ' &
               & //to_text(1.0e6_wp*minval(grid%area), 4)//' to '//to_text(1.0e6_wp*maxval(grid%area), 4)//' mm^2'
         end if
      end associate
   end function points_of

   !> The undeformed surface of a pad, in words.
   function surface_of(pad) result(text)
      type(pad_t), intent(in) :: pad
      character(len=:), allocatable :: text

      text = 'height range '//to_text(-1.0e6_wp*minval(pad%height), 4)//' um'
      if (pad%initial_pressure > 0.0_wp) text = 'initial pressure '//to_text(pad%initial_pressure, 6)//' Pa'
   end function surface_of

   !> Sizes, memory, disk, and time as an order of magnitude.
   subroutine report_cost(log, case, scene, demand)
      type(log_t), intent(in) :: log
      type(case_t), intent(in) :: case
      type(scene_t), intent(in) :: scene
      type(demand_t), intent(in) :: demand
      real(wp) :: boundary, unknowns, seconds
      logical :: fft

      boundary = boundary_count(scene)
      unknowns = expected_unknowns(case, scene)
      fft = uses_fft(case, scene)
      seconds = reduction_seconds(scene)
      if (fft) then
         seconds = seconds + fft_products*(boundary**2*8.0_wp/memory_rate + unknowns/fft_rate)
      else
         seconds = seconds + unknowns**3/(27.0_wp*dense_rate) + 8.0_wp*unknowns**2/memory_rate
      end if
      call log%line('sizes: '//to_text(nint(boundary))//' boundary coordinates, about '//to_text(unknowns, 3) &
         & //' contact unknowns; estimate: set-up and preload '//to_text(seconds, 2)//' s')
      call log%line('estimates: '//demand_in_words(demand))
      call log%line('contact compliance: '//why_form(fft, unknowns))
      if (case%runs('transient')) call report_transient(log, case, scene)
      if (case%runs('settling')) call log%line('settling: '//to_text(max(size(case%settling%amplitude), case%settling%impacts)) &
         & //' impacts, '//to_text(case%settling%interval)//' s from one to the next, residual state over the last ' &
         & //to_text(case%settling%periods)//' periods of mode '//to_text(case%settling%mode))
      call report_modal(log, case)
   end subroutine report_cost

   !> What the reduction takes, s, as an order of magnitude.
   real(wp) function reduction_seconds(scene)
      type(scene_t), intent(in) :: scene

      reduction_seconds = 40.0_wp*factor_entries(scene)*real(scene%model%row_count(), wp)**(1.0_wp/3.0_wp)/sparse_rate &
         & + boundary_count(scene)**3/dense_rate
   end function reduction_seconds

   !> How long the time integration will be, and what is measured under a sine.
   subroutine report_transient(log, case, scene)
      type(log_t), intent(in) :: log
      type(case_t), intent(in) :: case
      type(scene_t), intent(in) :: scene
      type(excitation_t), allocatable :: excitations(:)
      type(harmonic_meter_t) :: meter
      real(wp) :: duration

      meter = meter_of(case)
      duration = case%transient%duration
      excitations = excitations_of(case, scene)
      if (duration <= 0.0_wp) duration = end_of_all(excitations)
      call log%line('transient: '//to_text(duration)//' s'//trim(merge(' at most', '        ', meter%tolerance > 0.0_wp)) &
         & //'; the time step follows from the highest retained frequency unless it is given')
      if (meter%excitation > 0) call log%line('harmonics: 0 to '//to_text(meter%harmonics)//' of all sensors in windows ' &
         & //'of '//to_text(meter%window)//' periods, under '//to_text(excitations(meter%excitation)%cycles(duration), 7) &
         & //' periods')
   end subroutine report_transient

   !> The analyses that end in modal parameters over amplitude.
   subroutine report_modal(log, case)
      type(log_t), intent(in) :: log
      type(case_t), intent(in) :: case
      integer :: levels

      if (case%runs('qsma')) then
         levels = case%qsma%levels
         if (allocated(case%qsma%amplitudes)) levels = size(case%qsma%amplitudes)
         call log%line('qsma: mode '//to_text(case%qsma%mode)//', '//to_text(levels)//' amplitudes in both directions, ' &
            & //to_text(case%qsma%steps)//' load steps each')
         if (.not. allocated(case%qsma%cycle)) then
            call log%line("qsma: Masing's rule, or where it does not hold hysteresis loops of 2 x " &
               & //to_text(case%qsma%cycle_steps)//' load steps at every amplitude')
         else if (case%qsma%cycle) then
            call log%line('qsma: hysteresis loops of 2 x '//to_text(case%qsma%cycle_steps)//' load steps at every amplitude')
         else
            call log%line("skipped, qsma: hysteresis loops (cycle = .false., Masing's rule on the loading curves alone)")
         end if
      end if
      if (case%runs('harmonic_balance')) call log%line('harmonic_balance: '//to_text(size(case%harmonic_balance%levels)) &
         & //' levels, '//to_text(case%harmonic_balance%frequency_range(1))//' to ' &
         & //to_text(case%harmonic_balance%frequency_range(2))//' Hz, '//to_text(case%harmonic_balance%harmonics) &
         & //' harmonics; skipped: stability')
      if (case%runs('epmc')) call log%line('epmc: mode '//to_text(case%epmc%mode)//', '//to_text(case%epmc%points) &
         & //' amplitudes, '//to_text(case%epmc%harmonics)//' harmonics')
      if (case%runs('ringdown')) call log%line('ringdown: windows of '//to_text(case%ringdown%periods) &
         & //' periods, overlap '//to_text(case%ringdown%overlap))
   end subroutine report_modal

   !> What this case does not need.
   subroutine report_skipped(log, case, scene)
      type(log_t), intent(in) :: log
      type(case_t), intent(in) :: case
      type(scene_t), intent(in) :: scene
      integer :: k

      do k = 1, size(scene%pads)
         associate (pad => scene%pads(k))
            if (.not. pad%half_space) then
               call log%line("skipped, interface '"//pad%contact%name//"': half space (contact points at the FE nodes)")
            else if (.not. pad%compliance%coupled()) then
               call log%line("skipped, interface '"//pad%contact%name &
                  & //"': normal-tangential coupling of the half spaces (equal materials cancel it)")
            end if
            if (pad%friction <= 0.0_wp .and. any(case%contact%solver == [character(len=17) :: 'condensed', &
               & 'jacobi_eliminated'])) call log%line("skipped, interface '"//pad%contact%name &
               & //"': tangential directions of the contact (no friction: its unknowns are the points that lift off)")
            if (takes_all(case, scene, k)) then
               call log%line("skipped, interface '"//pad%contact%name//"': choice of the points in potential contact " &
                  & //'(all take part: asked for, flat, or no preload)')
            else
               call log%line("skipped, interface '"//pad%contact%name//"': unknowns of the points that stay open " &
                  & //'(chosen by the frictionless preload, verified during the run)')
            end if
         end associate
      end do
      if (case%runs('transient') .and. case%contact%solver == 'condensed') then
         call log%line('skipped: unknowns of points that stick, and their forces until a bound on their change has used up ' &
            & //'the margin to the friction cone (solver condensed)')
         if (size(scene%pads) > 1) call log%line('skipped: coupling between interfaces beyond the rank it has in the ' &
            & //'condensed stiffness to rounding')
      end if
      if (.not. allocated(case%output%snapshots)) call log%line('skipped: contact fields over time (no snapshots asked for)')
      if (case%reduction%cache == '') call log%line('skipped: cache of the reduction (no file given)')
   end subroutine report_skipped

end module microslip_cli_scene_report
