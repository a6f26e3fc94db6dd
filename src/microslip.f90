!> microslip: vibration and friction damping of bolted structures with resolved contact topography.
!> The facade: re-exports what a program needs that builds its scene itself, in the order of the data's way.
module microslip
   use microslip_core_kinds, only: wp
   use microslip_core_error, only: error_t
   use microslip_core_stopwatch, only: stopwatch_t
   use microslip_fe_model, only: fe_model_t
   use microslip_fe_interface, only: contact_interface_t, interface_from_sets, interface_from_plane
   use microslip_fe_load_pattern, only: load_vector, sensor_row
   use microslip_fe_reduced_model, only: reduced_model_t
   use microslip_fe_reduction, only: reduce, reduction_options_t
   use microslip_halfspace_grid, only: be_grid_t, new_grid
   use microslip_halfspace_love_cerruti, only: material_t, elastic_material, rigid_material, half_space_pair
   use microslip_contact_factory, only: contact_options_t
   use microslip_system_pad, only: pad_t, new_node_pad, new_pad
   use microslip_system_jointed_system, only: jointed_system_t, new_system
   use microslip_analysis_operating_state, only: operating_state_t, undeformed_state
   use microslip_analysis_preload, only: preload_options_t, preload_record_t, run_preload
   use microslip_analysis_linear_modes, only: linear_modes_t, solve_linear_modes
   use microslip_analysis_excitation, only: excitation_t
   use microslip_analysis_harmonic_meter, only: harmonic_meter_t, harmonic_window_t
   use microslip_analysis_transient, only: transient_options_t, transient_record_t, transient_recorder_t, sample_t, &
      & run_transient
   use microslip_analysis_settling, only: residual_t, settling_options_t, settling_record_t, run_settling
   use microslip_analysis_qsma, only: qsma_options_t, qsma_record_t, run_qsma
   use microslip_analysis_ringdown, only: decay_t, ringdown_options_t, ringdown_t, identify_ringdown
   use microslip_analysis_response_point, only: response_point_t, response_recorder_t
   use microslip_analysis_harmonic_balance, only: harmonic_balance_options_t, run_harmonic_balance
   use microslip_analysis_epmc, only: epmc_options_t, run_epmc
   implicit none(type, external)
   public
end module microslip
