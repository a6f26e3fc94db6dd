!> Runs the tests: all of them, one suite, or one test (`tester [suite [test]]`).
program main
   use, intrinsic :: iso_fortran_env, only: error_unit
   use test_analysis_continuation, only: collect_analysis_continuation
   use test_analysis_harmonic_balance, only: collect_analysis_harmonic_balance
   use test_analysis_epmc, only: collect_analysis_epmc
   use test_cli_periodic_motions, only: collect_cli_periodic_motions
   use test_analysis_excitation, only: collect_analysis_excitation
   use test_analysis_harmonic_meter, only: collect_analysis_harmonic_meter
   use test_analysis_settling, only: collect_analysis_settling
   use test_cli_coupling_report, only: collect_cli_coupling_report
   use test_cli_excitations, only: collect_cli_excitations
   use test_cli_file_guard, only: collect_cli_file_guard
   use test_io_own_files, only: collect_io_own_files
   use test_io_reduction_cache, only: collect_io_reduction_cache
   use test_cli_demand, only: collect_cli_demand
   use test_cli_interface_checks, only: collect_cli_interface_checks
   use test_cli_node_contact, only: collect_cli_node_contact
   use test_fe_base_load, only: collect_fe_base_load
   use test_analysis_linear_modes, only: collect_analysis_linear_modes
   use test_analysis_preload, only: collect_analysis_preload
   use test_analysis_qsma, only: collect_analysis_qsma
   use test_analysis_ringdown, only: collect_analysis_ringdown
   use test_cli_restart, only: collect_cli_restart
   use test_analysis_restart, only: collect_analysis_restart
   use test_core_archive, only: collect_core_archive
   use test_core_warning_list, only: collect_core_warning_list
   use test_core_machine_memory, only: collect_core_machine_memory
   use test_analysis_transient, only: collect_analysis_transient
   use test_calculix_agreement, only: collect_calculix_agreement
   use test_cli, only: collect_cli
   use test_cli_modal_parameters, only: collect_cli_modal_parameters
   use test_contact_half_space, only: collect_contact_half_space
   use test_system_fft_compliance, only: collect_system_fft_compliance
   use test_system_node_contact, only: collect_system_node_contact
   use test_io_fclib, only: collect_io_fclib
   use test_contact_any_compliance, only: collect_contact_any_compliance
   use test_contact_cold_starts, only: collect_contact_cold_starts
   use test_contact_matrix_free, only: collect_contact_matrix_free
   use test_contact_soft_directions, only: collect_contact_soft_directions
   use test_contact_solvers, only: collect_contact_solvers
   use test_contact_stress, only: collect_contact_stress
   use test_contact_without_friction, only: collect_contact_without_friction
   use test_fe_condensation, only: collect_fe_condensation
   use test_fe_element, only: collect_fe_element
   use test_fe_face_location, only: collect_fe_face_location
   use test_fe_interface, only: collect_fe_interface
   use test_fe_load_pattern, only: collect_fe_load_pattern
   use test_fe_mid_sides, only: collect_fe_mid_sides
   use test_fe_model_survey, only: collect_fe_model_survey
   use test_fe_pairing, only: collect_fe_pairing
   use test_fe_reduction, only: collect_fe_reduction
   use test_fe_relative_coordinates, only: collect_fe_relative_coordinates
   use test_fe_residual_mass, only: collect_fe_residual_mass
   use test_fe_shape_functions, only: collect_fe_shape_functions
   use test_fe_unit_guess, only: collect_fe_unit_guess
   use test_halfspace_compliance, only: collect_halfspace_compliance
   use test_halfspace_convolution, only: collect_halfspace_convolution
   use test_halfspace_coupling, only: collect_halfspace_coupling
   use test_halfspace_grid, only: collect_halfspace_grid
   use test_fe_interface_mesh, only: collect_fe_interface_mesh
   use test_halfspace_scale_filter, only: collect_halfspace_scale_filter
   use test_system_scale_split, only: collect_system_scale_split
   use test_halfspace_love_cerruti, only: collect_halfspace_love_cerruti
   use test_io_calculix, only: collect_io_calculix
   use test_io_case_excitation, only: collect_io_case_excitation
   use test_io_case_faults, only: collect_io_case_faults
   use test_io_case_file, only: collect_io_case_file
   use test_io_case_node_contact, only: collect_io_case_node_contact
   use test_io_hdf5, only: collect_io_hdf5
   use test_io_mesh_decks, only: collect_io_mesh_decks
   use test_io_mesh_file, only: collect_io_mesh_file
   use test_io_model_file, only: collect_io_model_file
   use test_io_namelist_text, only: collect_io_namelist_text
   use test_io_progress, only: collect_io_progress
   use test_io_results, only: collect_io_results
   use test_io_time_series_file, only: collect_io_time_series_file
   use test_io_topography_file, only: collect_io_topography_file
   use test_linalg_dense, only: collect_linalg_dense
   use test_linalg_eigenpairs, only: collect_linalg_eigenpairs
   use test_linalg_mumps, only: collect_linalg_mumps
   use test_linalg_sparse_algebra, only: collect_linalg_sparse_algebra
   use test_surface_height_map, only: collect_surface_height_map
   use test_surface_scan_check, only: collect_surface_scan_check
   use test_surface_topography, only: collect_surface_topography
   use microslip_cli_process_environment, only: prepare_process
   use microslip_cli_threads, only: choose_threads
   use microslip_core_error, only: error_t
   use microslip_core_warning_list, only: warning_list_t
   use testdrive, only: run_testsuite, run_selected, new_testsuite, testsuite_type, unittest_type, select_suite, &
      & get_argument
   implicit none(type, external)
   type(testsuite_type), allocatable :: suites(:)
   type(unittest_type), allocatable :: tests(:)
   character(len=:), allocatable :: suite, test
   type(warning_list_t) :: warnings
   type(error_t), allocatable :: error
   integer :: k, total, failed

   call prepare_process(warnings, error)
   if (.not. allocated(error)) call choose_threads(0, warnings, error)
   do k = 1, warnings%number()
      write (error_unit, '(a)') warnings%text(k)
   end do
   if (allocated(error)) then
      write (error_unit, '(a)') error%message
      stop 1, quiet=.true.
   end if

   suites = [ &
      & new_testsuite('analysis_continuation', collect_analysis_continuation), &
      & new_testsuite('analysis_harmonic_balance', collect_analysis_harmonic_balance), &
      & new_testsuite('analysis_epmc', collect_analysis_epmc), &
      & new_testsuite('cli_periodic_motions', collect_cli_periodic_motions), &
      & new_testsuite('analysis_excitation', collect_analysis_excitation), &
      & new_testsuite('analysis_harmonic_meter', collect_analysis_harmonic_meter), &
      & new_testsuite('analysis_settling', collect_analysis_settling), &
      & new_testsuite('cli_excitations', collect_cli_excitations), &
      & new_testsuite('cli_demand', collect_cli_demand), &
      & new_testsuite('cli_file_guard', collect_cli_file_guard), &
      & new_testsuite('io_own_files', collect_io_own_files), &
      & new_testsuite('io_reduction_cache', collect_io_reduction_cache), &
      & new_testsuite('cli_coupling_report', collect_cli_coupling_report), &
      & new_testsuite('cli_node_contact', collect_cli_node_contact), &
      & new_testsuite('cli_interface_checks', collect_cli_interface_checks), &
      & new_testsuite('fe_base_load', collect_fe_base_load), &
      & new_testsuite('analysis_linear_modes', collect_analysis_linear_modes), &
      & new_testsuite('analysis_preload', collect_analysis_preload), &
      & new_testsuite('cli_modal_parameters', collect_cli_modal_parameters), &
      & new_testsuite('analysis_qsma', collect_analysis_qsma), &
      & new_testsuite('analysis_ringdown', collect_analysis_ringdown), &
      & new_testsuite("cli_restart", collect_cli_restart), &
      & new_testsuite("analysis_restart", collect_analysis_restart), &
      & new_testsuite("core_archive", collect_core_archive), &
      & new_testsuite("core_warning_list", collect_core_warning_list), &
      & new_testsuite("core_machine_memory", collect_core_machine_memory), &
      & new_testsuite('analysis_transient', collect_analysis_transient), &
      & new_testsuite('calculix_agreement', collect_calculix_agreement), &
      & new_testsuite('cli', collect_cli), &
      & new_testsuite('contact_half_space', collect_contact_half_space), &
      & new_testsuite('system_fft_compliance', collect_system_fft_compliance), &
      & new_testsuite('system_node_contact', collect_system_node_contact), &
      & new_testsuite('io_fclib', collect_io_fclib), &
      & new_testsuite('contact_any_compliance', collect_contact_any_compliance), &
         & new_testsuite('contact_cold_starts', collect_contact_cold_starts), &
      & new_testsuite('contact_matrix_free', collect_contact_matrix_free), &
      & new_testsuite('contact_soft_directions', collect_contact_soft_directions), &
         & new_testsuite('contact_solvers', collect_contact_solvers), &
      & new_testsuite('contact_stress', collect_contact_stress), &
      & new_testsuite('contact_without_friction', collect_contact_without_friction), &
      & new_testsuite('fe_condensation', collect_fe_condensation), &
      & new_testsuite('fe_element', collect_fe_element), &
      & new_testsuite('fe_face_location', collect_fe_face_location), &
      & new_testsuite('fe_interface', collect_fe_interface), &
      & new_testsuite('fe_load_pattern', collect_fe_load_pattern), &
      & new_testsuite('fe_mid_sides', collect_fe_mid_sides), &
      & new_testsuite('fe_unit_guess', collect_fe_unit_guess), &
      & new_testsuite('fe_model_survey', collect_fe_model_survey), &
      & new_testsuite('fe_pairing', collect_fe_pairing), &
      & new_testsuite('fe_reduction', collect_fe_reduction), &
      & new_testsuite('fe_relative_coordinates', collect_fe_relative_coordinates), &
      & new_testsuite('fe_residual_mass', collect_fe_residual_mass), &
      & new_testsuite('fe_shape_functions', collect_fe_shape_functions), &
      & new_testsuite('halfspace_compliance', collect_halfspace_compliance), &
      & new_testsuite('halfspace_convolution', collect_halfspace_convolution), &
      & new_testsuite('halfspace_coupling', collect_halfspace_coupling), &
      & new_testsuite('halfspace_grid', collect_halfspace_grid), &
      & new_testsuite('halfspace_love_cerruti', collect_halfspace_love_cerruti), &
      & new_testsuite('fe_interface_mesh', collect_fe_interface_mesh), &
      & new_testsuite('halfspace_scale_filter', collect_halfspace_scale_filter), &
      & new_testsuite('system_scale_split', collect_system_scale_split), &
      & new_testsuite('io_calculix', collect_io_calculix), &
      & new_testsuite('io_case_excitation', collect_io_case_excitation), &
      & new_testsuite('io_case_faults', collect_io_case_faults), &
      & new_testsuite('io_case_file', collect_io_case_file), &
      & new_testsuite('io_case_node_contact', collect_io_case_node_contact), &
      & new_testsuite('io_hdf5', collect_io_hdf5), &
      & new_testsuite('io_mesh_decks', collect_io_mesh_decks), &
      & new_testsuite('io_mesh_file', collect_io_mesh_file), &
      & new_testsuite('io_model_file', collect_io_model_file), &
      & new_testsuite('io_namelist_text', collect_io_namelist_text), &
      & new_testsuite('io_progress', collect_io_progress), &
      & new_testsuite('io_results', collect_io_results), &
      & new_testsuite('io_time_series_file', collect_io_time_series_file), &
      & new_testsuite('io_topography_file', collect_io_topography_file), &
      & new_testsuite('linalg_dense', collect_linalg_dense), &
      & new_testsuite('linalg_eigenpairs', collect_linalg_eigenpairs), &
      & new_testsuite('linalg_mumps', collect_linalg_mumps), &
      & new_testsuite('linalg_sparse_algebra', collect_linalg_sparse_algebra), &
      & new_testsuite('surface_height_map', collect_surface_height_map), &
      & new_testsuite('surface_scan_check', collect_surface_scan_check), &
      & new_testsuite('surface_topography', collect_surface_topography)]

   failed = 0
   total = 0
   call get_argument(1, suite)
   call get_argument(2, test)
   if (allocated(suite)) then
      k = select_suite(suites, suite)
      if (k == 0) then
         write (error_unit, '(2a)') 'no such suite: ', suite
         stop 2, quiet=.true.
      end if
      if (allocated(test)) then
         total = 1
         call run_selected(suites(k)%collect, test, error_unit, failed)
      else
         call run_suite(suites(k))
      end if
   else
      do k = 1, size(suites)
         call run_suite(suites(k))
      end do
   end if
   write (error_unit, '(i0,a,i0,a)') total - failed, ' passed, ', failed, ' failed'
   if (failed > 0) stop 1, quiet=.true.

contains

   !> All tests of a suite, one after the other: HDF5, MUMPS and FFTW plans are not thread-safe.
   subroutine run_suite(suite)
      type(testsuite_type), intent(in) :: suite

      write (error_unit, '(2a)') '# ', suite%name
      call suite%collect(tests)
      total = total + size(tests)
      call run_testsuite(suite%collect, error_unit, failed, parallel=.false.)
   end subroutine run_suite

end program main
