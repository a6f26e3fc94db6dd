!> Number kinds and the few constants that several rooms share.
module microslip_core_kinds
   use, intrinsic :: iso_fortran_env, only: real64, int64
   implicit none(type, external)
   private

   public :: wp, i8, pi

   !> Working precision: everything is computed in double precision.
   integer, parameter :: wp = real64
   !> Integers that count bytes or matrix entries.
   integer, parameter :: i8 = int64

   real(wp), parameter :: pi = acos(-1.0_wp)
end module microslip_core_kinds
