!> How much space the machine has left for files.
module microslip_core_machine_disk
   use, intrinsic :: iso_c_binding, only: c_char, c_int, c_int64_t, c_long, c_null_char
   use microslip_core_kinds, only: wp
   implicit none(type, external)
   private

   public :: free_space

   interface
      function c_statvfs(path, answer) bind(c, name='statvfs') result(status)
         import :: c_char, c_int, c_int64_t
         implicit none(type, external)
         character(kind=c_char), intent(in) :: path(*)
         integer(c_int64_t), intent(out) :: answer(*)
         integer(c_int) :: status
      end function c_statvfs
   end interface

contains

   !> Space that files in a folder can take, bytes; negative where the system does not tell (only Linux with 64 bits does).
   real(wp) function free_space(folder)
      !> Its path; blank: the current one
      character(len=*), intent(in) :: folder
      !> struct statvfs in words: block size, fragment size, blocks, free blocks, blocks free for everyone, ...
      integer(c_int64_t) :: answer(32)
      logical :: linux

      free_space = -1.0_wp
      inquire (file='/proc/meminfo', exist=linux)
      if (.not. linux .or. storage_size(0_c_long) /= storage_size(0_c_int64_t)) return
      if (folder == '') then
         if (c_statvfs('.'//c_null_char, answer) /= 0) return
      else
         if (c_statvfs(folder//c_null_char, answer) /= 0) return
      end if
      free_space = real(answer(2), wp)*real(answer(5), wp)
   end function free_space

end module microslip_core_machine_disk
