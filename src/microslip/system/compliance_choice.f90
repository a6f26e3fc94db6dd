!> Dense matrix or FFT operator: which form of the contact compliance suits the problem and the machine.
!>
!> With the dense matrix a time step costs milliseconds and with the operator tenths of a second, so the matrix is taken as
!> long as it, and what is made from it, fits into four fifths of the memory that is left, and its factors take minutes at most.
module microslip_system_compliance_choice
   use microslip_core_error, only: error_t, failure
   use microslip_core_kinds, only: wp
   use microslip_core_text, only: to_text
   use microslip_core_machine_memory, only: available_memory
   implicit none(type, external)
   private

   public :: compliance_auto, compliance_dense, compliance_fft, compliance_named, takes_fft, dense_memory, check_memory, why_form

   integer, parameter :: compliance_auto = 0, compliance_dense = 1, compliance_fft = 2

   !> Matrices of this size that are alive at once in the preload: G, that of statics, the inverse on the closed points and
   !> what it is made of; 3.8 measured. Later analyses do with less.
   real(wp), parameter :: dense_copies = 4.0_wp
   !> Part of the memory that is left which they may take.
   real(wp), parameter :: most_memory = 0.8_wp
   !> Unknowns beyond which the factors take too long.
   integer, parameter :: most_dense = 30000
   !> Assumed where the machine does not tell, bytes.
   real(wp), parameter :: modest_memory = 4.0e9_wp

contains

   !> The choice of a case file. Only the condensed solver has a form for the operator, and only half spaces have one.
   pure integer function compliance_named(name, solver, half_spaces)
      !> 'auto', 'dense' or 'fft'
      character(len=*), intent(in) :: name
      !> Contact solver
      character(len=*), intent(in) :: solver
      !> Whether the bodies are half spaces at all interfaces
      logical, intent(in) :: half_spaces

      compliance_named = compliance_auto
      if (name == 'fft') compliance_named = compliance_fft
      if (name == 'dense' .or. solver /= 'condensed' .or. .not. half_spaces) compliance_named = compliance_dense
   end function compliance_named

   !> Whether the compliance of that many unknowns is to be the operator.
   logical function takes_fft(choice, unknowns)
      !> compliance_auto, compliance_dense or compliance_fft
      integer, intent(in) :: choice
      !> Three per point in potential contact
      real(wp), intent(in) :: unknowns

      takes_fft = choice == compliance_fft
      if (choice == compliance_auto) takes_fft = unknowns > most_dense .or. dense_memory(unknowns) > most_memory*memory()
   end function takes_fft

   !> Memory of the dense form, bytes.
   pure real(wp) function dense_memory(unknowns)
      real(wp), intent(in) :: unknowns
      dense_memory = 8.0_wp*dense_copies*unknowns**2
   end function dense_memory

   !> Whether there is memory for the dense form.
   subroutine check_memory(unknowns, error)
      real(wp), intent(in) :: unknowns
      type(error_t), allocatable, intent(out) :: error
      real(wp) :: free

      free = available_memory()
      if (free > 0.0_wp .and. dense_memory(unknowns) > free) call failure(error, 'the contact matrices of '// &
         & to_text(unknowns, 6)//' unknowns would need about '//to_text(dense_memory(unknowns)/1.0e9_wp, 3)// &
         & ' GB of memory, '//to_text(free/1.0e9_wp, 3)//" GB are free: fewer grid points, or compliance = 'fft' in &contact")
   end subroutine check_memory

   !> What the machine has, or is assumed to have, bytes.
   real(wp) function memory()
      memory = available_memory()
      if (memory <= 0.0_wp) memory = modest_memory
   end function memory

   !> The form in words, for the log, with what the choice looks at.
   function why_form(fft, unknowns) result(text)
      !> Operator, not matrix
      logical, intent(in) :: fft
      real(wp), intent(in) :: unknowns
      character(len=:), allocatable :: text

      text = trim(merge('FFT operator', 'dense matrix', fft))//' for '//to_text(anint(unknowns), 8)//' unknowns (dense matrices: ' &
         & //to_text(dense_memory(unknowns)/1.0e9_wp, 2)//' GB of '//to_text(memory()/1.0e9_wp, 2)//' GB that are free)'
   end function why_form

end module microslip_system_compliance_choice
