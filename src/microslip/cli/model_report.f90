!> What an engineer checks first of a model: size, mass, centre, material as mesh and matrices show it, what holds it.
module microslip_cli_model_report
   use microslip_cli_log, only: listed, log_t
   use microslip_cli_scene, only: contact_interfaces, scene_t
   use microslip_cli_scene_report, only: reduction_seconds
   use microslip_core_error, only: error_t
   use microslip_core_kinds, only: wp
   use microslip_core_text, only: to_text
   use microslip_fe_model, only: row_dependent, row_supported, row_unknown
   use microslip_fe_model_survey, only: median
   use microslip_fe_reduced_model, only: reduced_model_t
   use microslip_fe_reduction, only: craig_bampton_massless, reduce, reduction_options_t
   implicit none(type, external)
   private

   public :: report_model, report_tied

   !> Lengths below are told in mm, m.
   real(wp), parameter :: shown_in_mm = 10.0_wp
   !> s, that `--check` takes for the tied frequencies at most; how many are told.
   real(wp), parameter :: cheap = 2.0_wp
   integer, parameter :: shown_modes = 6
   !> Values that differ by less than this part of each other are told as one.
   real(wp), parameter :: one_value = 0.5_wp

contains

   !> Print them.
   subroutine report_model(log, scene)
      type(log_t), intent(in) :: log
      type(scene_t), intent(in) :: scene
      real(wp) :: low(3), high(3)
      integer :: k

      associate (model => scene%model, survey => scene%survey)
         low = minval(model%coordinates, 2)
         high = maxval(model%coordinates, 2)
         call log%line('structure: '//lengths(high - low, maxval(high - low), ' x ')//', from '// &
            & lengths(low, maxval(high - low), ', ')//' to '//lengths(high, maxval(high - low), ', '))
         call log%line('mass of all that has rows: '//masses()//' kg, centre at '// &
            & lengths(survey%centre, maxval(high - low), ', ')//'; volume of the mesh '// &
            & to_text(1.0e6_wp*survey%volume, 5)//' cm^3')
         call log%line('material that mesh and matrices show: '//material())
         call log%line('held: '//constraints())
      end associate

   contains

      !> One mass, or those along x, y, z.
      function masses() result(text)
         character(len=:), allocatable :: text
         associate (mass => scene%survey%mass)
            text = to_text(mass(1), 5)
            if (maxval(mass) - minval(mass) > 1.0e-5_wp*maxval(mass)) &
               & text = text//', '//to_text(mass(2), 5)//', '//to_text(mass(3), 5)
         end associate
      end function masses

      function material() result(text)
         character(len=:), allocatable :: text
         associate (survey => scene%survey)
            if (.not. (any(survey%young > 0.0_wp) .or. any(survey%density > 0.0_wp))) then
               text = 'none (no node has nothing but listed bricks around it)'
               return
            end if
            text = "Young's modulus "//spread_text(survey%young)//" Pa, Poisson's ratio "// &
               & to_text(rounded(median(survey%poisson)), 3)//' (surface nodes), density '//spread_text(survey%density)//' kg/m^3'
         end associate
      end function material

      !> What has no row, springs, couplings without elements.
      function constraints() result(text)
         character(len=:), allocatable :: text
         integer, allocatable :: absence(:, :)

         ! Nodes without elements and without rows are in no analysis.
         absence = scene%model%absence(:, pack([(k, k=1, scene%model%node_count())], scene%survey%in_element))
         associate (survey => scene%survey)
            text = to_text(count(absence == row_supported))//' components of nodes by supports'
            if (any(absence == row_dependent)) text = text//', '//to_text(count(absence == row_dependent)) &
               & //' by constraints (they depend on others)'
            if (any(absence == row_unknown)) text = text//', '//to_text(count(absence == row_unknown)) &
               & //' by supports or constraints'
            if (any(survey%grounded)) text = text//'; '//to_text(count(survey%grounded))//' nodes by springs to the ground'
            if (survey%foreign > 0) text = text//'; '//to_text(survey%foreign)//' pairs of nodes are joined without a common ' &
               & //'element (constraints, springs, elements that the mesh does not list)'
         end associate
      end function constraints

   end subroutine report_model

   !> Print the first frequencies with all interfaces tied, where they cost next to nothing.
   subroutine report_tied(log, scene)
      type(log_t), intent(in) :: log
      type(scene_t), intent(in) :: scene
      type(reduction_options_t) :: options
      type(reduced_model_t) :: reduced
      type(error_t), allocatable :: error
      real(wp) :: seconds
      integer :: k

      seconds = reduction_seconds(scene)
      if (seconds > cheap) then
         call log%line('tied frequencies: computed in the run (about '//to_text(seconds, 2)//' s; --check takes up to '// &
            & to_text(cheap)//' s for them)')
         return
      end if
      options%method = craig_bampton_massless
      options%modes = min(shown_modes, scene%model%row_count() - sum([(scene%pads(k)%boundary_count(), k=1, size(scene%pads))]))
      call reduce(scene%model, contact_interfaces(scene), scene%patterns(:, :0), options, reduced, error)
      if (allocated(error)) then
         call log%line('tied frequencies: none, '//error%message)
      else
         call log%line('tied frequencies, Hz:'//listed(reduced%frequency(:options%modes)))
      end if
   end subroutine report_tied

   !> Without what rounding leaves of zero.
   pure real(wp) function rounded(value)
      real(wp), intent(in) :: value
      rounded = 1.0e-6_wp*anint(1.0e6_wp*value)
   end function rounded

   !> The median of the values other than zero, and their range where it is wide.
   function spread_text(values) result(text)
      real(wp), intent(in) :: values(:)
      character(len=:), allocatable :: text
      real(wp) :: middle, low, high

      middle = median(values)
      low = minval(values, abs(values) > 0.0_wp)
      high = maxval(values, abs(values) > 0.0_wp)
      text = to_text(middle, 4)
      if (any(abs(values) > 0.0_wp) .and. high - low > one_value*abs(middle)) text = text//' ('//to_text(low, 3)//' to ' &
         & //to_text(high, 3)//')'
   end function spread_text

   !> Lengths with their unit.
   function lengths(values, largest, between) result(text)
      !> m
      real(wp), intent(in) :: values(:), largest
      character(len=*), intent(in) :: between
      character(len=:), allocatable :: text
      real(wp) :: factor, value
      integer :: k

      factor = merge(1.0e3_wp, 1.0_wp, largest < shown_in_mm)
      text = ''
      do k = 1, size(values)
         value = values(k)
         ! What rounding leaves of a zero is not told.
         if (abs(value) < 1.0e-6_wp*largest) value = 0.0_wp
         if (k > 1) text = text//between
         text = text//to_text(factor*value, 5)
      end do
      if (between == ', ') text = '('//text//')'
      text = text//trim(merge(' mm', ' m ', factor > 1.0_wp))
   end function lengths

end module microslip_cli_model_report
