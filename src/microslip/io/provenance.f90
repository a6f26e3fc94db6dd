!> Where and when a result was made.
module microslip_io_provenance
   use, intrinsic :: iso_c_binding, only: c_char, c_int, c_long, c_null_char, c_null_ptr, c_ptr, c_size_t
   implicit none(type, external)
   private

   public :: utc_now, host_name

   interface
      function c_gethostname(name, length) bind(c, name='gethostname') result(status)
         import :: c_char, c_int, c_size_t
         implicit none(type, external)
         character(kind=c_char), intent(out) :: name(*)
         integer(c_size_t), value :: length
         integer(c_int) :: status
      end function c_gethostname

      function c_time(place) bind(c, name='time') result(seconds)
         import :: c_long, c_ptr
         implicit none(type, external)
         type(c_ptr), value :: place
         integer(c_long) :: seconds
      end function c_time

      function c_gmtime(seconds) bind(c, name='gmtime') result(calendar)
         import :: c_long, c_ptr
         implicit none(type, external)
         integer(c_long), intent(in) :: seconds
         type(c_ptr) :: calendar
      end function c_gmtime

      function c_strftime(text, length, form, calendar) bind(c, name='strftime') result(written)
         import :: c_char, c_ptr, c_size_t
         implicit none(type, external)
         character(kind=c_char), intent(out) :: text(*)
         integer(c_size_t), value :: length
         character(kind=c_char), intent(in) :: form(*)
         type(c_ptr), value :: calendar
         integer(c_size_t) :: written
      end function c_strftime
   end interface

contains

   !> Date and time now, ISO 8601 in UTC: '2026-01-31T12:34:56Z'.
   function utc_now() result(text)
      character(len=:), allocatable :: text
      character(len=32) :: buffer
      integer(c_size_t) :: n

      n = c_strftime(buffer, int(len(buffer), c_size_t), '%Y-%m-%dT%H:%M:%SZ'//c_null_char, c_gmtime(c_time(c_null_ptr)))
      text = buffer(:n)
   end function utc_now

   !> Name of this machine; 'unknown' if it has none.
   function host_name() result(text)
      character(len=:), allocatable :: text
      character(len=256) :: buffer
      integer :: last

      text = 'unknown'
      if (c_gethostname(buffer, int(len(buffer), c_size_t)) /= 0) return
      last = index(buffer, c_null_char) - 1
      if (last > 0) text = buffer(:last)
   end function host_name

end module microslip_io_provenance
