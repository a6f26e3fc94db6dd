!> Name and version of the program, and of the files it writes.
module microslip_core_version
   implicit none(type, external)
   private

   public :: program_version, result_format_version

   character(len=*), parameter :: program_version = '0.1.0'
   !> Grows with every change of the result file that can break a reader.
   integer, parameter :: result_format_version = 1
end module microslip_core_version
