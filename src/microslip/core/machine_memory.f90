!> How much memory this process can still have, and how much it uses.
module microslip_core_machine_memory
   use microslip_core_kinds, only: wp
   use microslip_core_process_limits, only: address_space_limit
   implicit none(type, external)
   private

   public :: available_memory, resident_memory, peak_memory, group_memory

contains

   !> Memory that this process can still have without swapping, bytes: what the machine has left, what its control group
   !> has left (containers, job schedulers), and what its limit of address space (`ulimit -v`) leaves, whichever is least. 0 where
   !> the system tells none of them (only Linux does).
   real(wp) function available_memory()
      available_memory = least(bytes_of('MemAvailable:', '/proc/meminfo'), group_memory('/proc/self/cgroup', '/sys/fs/cgroup'))
      if (address_space_limit() < huge(1.0_wp)) available_memory = least(available_memory, &
         & max(1.0_wp, address_space_limit() - bytes_of('VmSize:', '/proc/self/status')))
   end function available_memory

   !> The smaller of two amounts; 0 stands for an amount that is not known.
   pure real(wp) function least(a, b)
      real(wp), intent(in) :: a, b

      least = min(a, b)
      if (a <= 0.0_wp .or. b <= 0.0_wp) least = max(a, b)
   end function least

   !> Memory that the control group of this process has left, with all groups above it, bytes: limit less usage, where file
   !> pages that are given back on demand do not count as used. 0 if there is no limit.
   real(wp) function group_memory(list, root)
      !> The groups of this process (/proc/self/cgroup), and where groups are found (/sys/fs/cgroup)
      character(len=*), intent(in) :: list, root
      character(len=4096) :: line
      character(len=:), allocatable :: controllers
      integer :: unit, status, first, second

      group_memory = 0.0_wp
      open (newunit=unit, file=list, status='old', action='read', iostat=status)
      if (status /= 0) return
      do
         read (unit, '(a)', iostat=status) line
         if (status /= 0) exit
         ! number:controllers:path; version 2 has no controllers
         first = index(line, ':')
         second = first + index(line(first + 1:), ':')
         if (first == 0 .or. second == first) cycle
         controllers = ','//line(first + 1:second - 1)//','
         if (controllers == ',,') then
            group_memory = least(group_memory, left_in(root, trim(line(second + 1:)), 'memory.max', 'memory.current', &
               & 'inactive_file'))
         else if (index(controllers, ',memory,') > 0) then
            group_memory = least(group_memory, left_in(root//'/memory', trim(line(second + 1:)), 'memory.limit_in_bytes', &
               & 'memory.usage_in_bytes', 'total_inactive_file'))
         end if
      end do
      close (unit)
   end function group_memory

   !> The least that a group and all above it have left, bytes; 0 if none has a limit.
   real(wp) function left_in(root, group, limit_file, usage_file, reclaimable)
      character(len=*), intent(in) :: root
      !> Path of the group below the root; inside a container it may not be there, and the root is the container's own
      character(len=*), intent(in) :: group
      !> Names of the files, and of a key in memory.stat
      character(len=*), intent(in) :: limit_file, usage_file, reclaimable
      character(len=:), allocatable :: path
      real(wp) :: limit

      left_in = 0.0_wp
      path = group
      do
         path = path(:len_trim(path) - merge(1, 0, index(path, '/', back=.true.) == len(path) .and. len(path) > 0))
         limit = number_in(root//path//'/'//limit_file)
         ! Version 1 writes a number near 2^63 where there is no limit.
         if (limit > 0.0_wp .and. limit < 1.0e18_wp) left_in = least(left_in, max(1.0_wp, limit &
            & - number_in(root//path//'/'//usage_file) &
            & + bytes_of(reclaimable//' ', root//path//'/memory.stat', 1.0_wp)))
         if (path == '') exit
         path = path(:index(path, '/', back=.true.) - 1)
      end do
   end function left_in

   !> The number that a file consists of; 0 if there is none.
   real(wp) function number_in(path)
      character(len=*), intent(in) :: path
      integer :: unit, status

      number_in = 0.0_wp
      open (newunit=unit, file=path, status='old', action='read', iostat=status)
      if (status /= 0) return
      read (unit, *, iostat=status) number_in
      if (status /= 0) number_in = 0.0_wp
      close (unit)
   end function number_in

   !> Memory that this process has now, bytes; 0 where the system does not tell.
   real(wp) function resident_memory()
      resident_memory = bytes_of('VmRSS:', '/proc/self/status')
   end function resident_memory

   !> The most memory that this process has had, bytes; 0 where the system does not tell.
   real(wp) function peak_memory()
      peak_memory = bytes_of('VmHWM:', '/proc/self/status')
   end function peak_memory

   !> The number after a key in a file, in bytes; 0 if it is not there.
   real(wp) function bytes_of(key, path, unit_in_bytes)
      character(len=*), intent(in) :: key, path
      !> Kibibytes if not given
      real(wp), intent(in), optional :: unit_in_bytes
      character(len=80) :: line
      real(wp) :: number
      integer :: unit, status

      bytes_of = 0.0_wp
      open (newunit=unit, file=path, status='old', action='read', iostat=status)
      if (status /= 0) return
      do
         read (unit, '(a)', iostat=status) line
         if (status /= 0) exit
         if (index(line, key) /= 1) cycle
         read (line(len(key) + 1:), *, iostat=status) number
         if (status == 0) bytes_of = 1024.0_wp*number
         if (status == 0 .and. present(unit_in_bytes)) bytes_of = unit_in_bytes*number
         exit
      end do
      close (unit)
   end function bytes_of

end module microslip_core_machine_memory
