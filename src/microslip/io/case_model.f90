!> Keys of `&case`, `&model`, `&reduction`, `&damping` and `&contact` (doc/namelists.md).
module microslip_io_case_model
   use microslip_contact_factory, only: contact_solver_names
   use microslip_core_kinds, only: wp
   use microslip_io_case, only: case_t, model_case_t, reduction_case_t, damping_case_t, contact_case_t, name_length
   use microslip_io_group_keys, only: group_keys_t
   use microslip_io_value_range, only: positive, non_negative, at_least, between
   implicit none(type, external)
   private

   public :: case_keys, model_keys, reduction_keys, damping_keys, contact_keys, length_units, smallest_tolerance

   !> What rounding leaves.
   real(wp), parameter :: smallest_tolerance = 1.0e-15_wp

   character(len=*), parameter :: length_units(3) = ['m ', 'mm', 'um']
   character(len=*), parameter :: available(8) = [character(len=16) :: 'preload', 'linear_modes', 'transient', 'qsma', &
      'ringdown', 'settling', 'harmonic_balance', 'epmc']

contains

   !> `&case`: title and analyses.
   subroutine case_keys(keys, input)
      !> The group
      type(group_keys_t), intent(inout) :: keys
      !> The case, whose title and analyses are read or written
      type(case_t), intent(inout) :: input
      integer :: k

      call keys%name_key('title', input%title)
      call keys%name_list('analyses', input%analyses, available, required=.true.)
      if (keys%is_reading .and. allocated(input%analyses)) then
         do k = 2, size(input%analyses)
            if (.not. any(input%analyses(:k - 1) == input%analyses(k))) cycle
            call keys%fault('analyses', 'every analysis once')
            exit
         end do
      end if
      call keys%finish()
   end subroutine case_keys

   !> `&model`.
   subroutine model_keys(keys, record)
      !> The group
      type(group_keys_t), intent(inout) :: keys
      !> Its record
      type(model_case_t), intent(inout) :: record

      call keys%name_key('source', record%source, [character(len=name_length) :: 'hdf5', 'calculix'], &
         [character(len=name_length) :: 'abaqus', 'matrix_market'], required=.true.)
      call keys%name_key('file', record%file, required=.true.)
      if (record%source == 'calculix') then
         call keys%name_key('mesh_file', record%mesh_file, required=.true.)
         call keys%name_key('unit_length', record%unit_length, length_units)
         call keys%name_key('unit_mass', record%unit_mass, ['kg', 't ', 'g '])
         call keys%name_key('unit_time', record%unit_time, ['s ', 'ms'])
      else
         call keys%ignored([character(len=16) :: 'mesh_file', 'unit_length', 'unit_mass', 'unit_time'], &
            "with source = 'calculix'", decided_by='source')
      end if
      call keys%finish()
   end subroutine model_keys

   !> `&reduction`.
   subroutine reduction_keys(keys, record)
      !> The group
      type(group_keys_t), intent(inout) :: keys
      !> Its record
      type(reduction_case_t), intent(inout) :: record

      call keys%name_key('method', record%method, [character(len=name_length) :: 'craig_bampton_massless', 'macneal'])
      call keys%optional_integer('n_modes', record%n_modes, at_least(1))
      call keys%optional_real('cutoff_frequency', record%cutoff_frequency, positive)
      call keys%exactly_one([character(len=16) :: 'n_modes', 'cutoff_frequency'])
      if (record%method == 'macneal') then
         call keys%ignored([character(len=13) :: 'residual_mass'], "with method = 'craig_bampton_massless'", decided_by='method')
      else
         call keys%name_key('residual_mass', record%residual_mass, [character(len=name_length) :: 'kept', 'dropped'])
      end if
      call keys%name_key('cache', record%cache)
      call keys%finish()
   end subroutine reduction_keys

   !> `&damping`.
   subroutine damping_keys(keys, record)
      !> The group
      type(group_keys_t), intent(inout) :: keys
      !> Its record
      type(damping_case_t), intent(inout) :: record

      call keys%real_list('modal_ratio', record%modal_ratio, between(0.0_wp, 1.0_wp, closed_lower=.true.))
      call keys%optional_real('mass_proportional', record%mass_proportional, non_negative)
      call keys%optional_real('ratio', record%ratio, between(0.0_wp, 1.0_wp, closed_lower=.true.))
      call keys%exactly_one([character(len=20) :: 'modal_ratio', 'mass_proportional', 'ratio'])
      if (allocated(record%ratio)) then
         call keys%integer_key('reference_mode', record%reference_mode, at_least(1), required=.true.)
         call keys%name_key('reference', record%reference, [character(len=name_length) :: 'tied', 'preloaded'])
      else
         call keys%ignored([character(len=14) :: 'reference_mode', 'reference'], 'with ratio', decided_by='ratio')
      end if
      call keys%finish()
   end subroutine damping_keys

   !> `&contact`.
   subroutine contact_keys(keys, record)
      !> The group
      type(group_keys_t), intent(inout) :: keys
      !> Its record
      type(contact_case_t), intent(inout) :: record

      call keys%name_key('solver', record%solver, contact_solver_names)
      call keys%real_key('tolerance', record%tolerance, between(smallest_tolerance, 1.0_wp, closed_lower=.true.))
      call keys%integer_key('max_iterations', record%max_iterations, at_least(1))
      call keys%name_key('normal_law', record%normal_law, [character(len=name_length) :: 'gap', 'velocity'])
      if (record%solver == 'condensed') then
         call keys%name_key('compliance', record%compliance, [character(len=name_length) :: 'auto', 'dense', 'fft'])
      else
         call keys%ignored(['compliance'], "with solver = 'condensed'", decided_by='solver')
      end if
      call keys%finish()
   end subroutine contact_keys

end module microslip_io_case_model
