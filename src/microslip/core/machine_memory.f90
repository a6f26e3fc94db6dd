!> How much memory the machine has left, and how much this process has taken.
module microslip_core_machine_memory
   use microslip_core_kinds, only: wp
   implicit none(type, external)
   private

   public :: available_memory, resident_memory, peak_memory

contains

   !> Memory that a new program can have without swapping, bytes; 0 where the system does not tell (only Linux does).
   real(wp) function available_memory()
      available_memory = bytes_behind('MemAvailable:', '/proc/meminfo')
   end function available_memory

   !> Memory that this process has now, bytes; 0 where the system does not tell.
   real(wp) function resident_memory()
      resident_memory = bytes_behind('VmRSS:', '/proc/self/status')
   end function resident_memory

   !> The most memory that this process has had, bytes; 0 where the system does not tell.
   real(wp) function peak_memory()
      peak_memory = bytes_behind('VmHWM:', '/proc/self/status')
   end function peak_memory

   !> The kibibytes behind a key in a file, in bytes; 0 if they are not there.
   real(wp) function bytes_behind(key, path)
      character(len=*), intent(in) :: key, path
      character(len=80) :: line
      real(wp) :: kibibytes
      integer :: unit, status

      bytes_behind = 0.0_wp
      open (newunit=unit, file=path, status='old', action='read', iostat=status)
      if (status /= 0) return
      do
         read (unit, '(a)', iostat=status) line
         if (status /= 0) exit
         if (index(line, key) /= 1) cycle
         read (line(len(key) + 1:), *, iostat=status) kibibytes
         if (status == 0) bytes_behind = 1024.0_wp*kibibytes
         exit
      end do
      close (unit)
   end function bytes_behind

end module microslip_core_machine_memory
