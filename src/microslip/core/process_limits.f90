!> Limits that the system sets on this process (`ulimit`): stack and address space. Linux only; no limits elsewhere.
module microslip_core_process_limits
   use, intrinsic :: iso_c_binding, only: c_int, c_long
   use microslip_core_kinds, only: wp
   implicit none(type, external)
   private

   public :: stack_limit, raise_stack_limit, address_space_limit

   !> Numbers of Linux.
   integer(c_int), parameter :: resource_stack = 3, resource_address_space = 9
   !> "No limit" has all bits set.
   integer(c_long), parameter :: unlimited = -1_c_long

   !> As in C: what holds, and how far it may be raised; bytes.
   type, bind(c) :: limit_t
      integer(c_long) :: current = unlimited, most = unlimited
   end type limit_t

   interface
      function c_getrlimit(resource, limit) bind(c, name='getrlimit') result(status)
         import :: c_int, limit_t
         implicit none(type, external)
         integer(c_int), value :: resource
         type(limit_t), intent(out) :: limit
         integer(c_int) :: status
      end function c_getrlimit

      function c_setrlimit(resource, limit) bind(c, name='setrlimit') result(status)
         import :: c_int, limit_t
         implicit none(type, external)
         integer(c_int), value :: resource
         type(limit_t), intent(in) :: limit
         integer(c_int) :: status
      end function c_setrlimit
   end interface

contains

   !> Bytes that the stack of the main thread may have; `huge` if there is no limit.
   real(wp) function stack_limit()
      stack_limit = bytes(resource_stack)
   end function stack_limit

   !> Bytes of addresses that this process may have; `huge` if there is no limit.
   real(wp) function address_space_limit()
      address_space_limit = bytes(resource_address_space)
   end function address_space_limit

   !> Let the stack of the main thread grow to so many bytes, or as far as the system allows.
   subroutine raise_stack_limit(wanted)
      integer, intent(in) :: wanted
      type(limit_t) :: limit
      integer(c_int) :: ignored

      if (c_getrlimit(resource_stack, limit) /= 0) return
      if (limit%current == unlimited .or. limit%current >= wanted) return
      limit%current = wanted
      if (limit%most /= unlimited) limit%current = min(limit%current, limit%most)
      ignored = c_setrlimit(resource_stack, limit)
   end subroutine raise_stack_limit

   !> The current limit of a resource, bytes; `huge` if there is none.
   real(wp) function bytes(resource)
      integer(c_int), intent(in) :: resource
      type(limit_t) :: limit

      bytes = huge(1.0_wp)
      if (c_getrlimit(resource, limit) /= 0) return
      if (limit%current /= unlimited) bytes = real(limit%current, wp)
   end function bytes

end module microslip_core_process_limits
