!> How much memory the machine has left.
module microslip_core_machine_memory
   use microslip_core_kinds, only: wp
   implicit none(type, external)
   private

   public :: available_memory

contains

   !> Memory that a new program can have without swapping, bytes; 0 where the system does not tell (only Linux does).
   real(wp) function available_memory()
      character(len=80) :: line
      character(len=*), parameter :: key = 'MemAvailable:'
      real(wp) :: kibibytes
      integer :: unit, status

      available_memory = 0.0_wp
      open (newunit=unit, file='/proc/meminfo', status='old', action='read', iostat=status)
      if (status /= 0) return
      do
         read (unit, '(a)', iostat=status) line
         if (status /= 0) exit
         if (index(line, key) /= 1) cycle
         read (line(len(key) + 1:), *, iostat=status) kibibytes
         if (status == 0) available_memory = 1024.0_wp*kibibytes
         exit
      end do
      close (unit)
   end function available_memory

end module microslip_core_machine_memory
