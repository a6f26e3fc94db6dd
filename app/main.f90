program main
   use microslip_analysis_transient, only: run_transient
   use microslip_analysis_linear_modes, only: solve_linear_modes
   use microslip_analysis_potential_set, only: choose_potential_set
   implicit none(type, external)
end program main
