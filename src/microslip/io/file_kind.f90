!> What a file that is not HDF5 looks like, by its first bytes: for messages about files of another format.
module microslip_io_file_kind
   use microslip_io_file_identity, only: file_identity_t, identity_of, kind_in_words, kind_regular, kind_unknown
   implicit none(type, external)
   private

   public :: kind_of_file

   !> Bytes that are looked at.
   integer, parameter :: first_bytes = 512

contains

   !> The kind of a file in words ('a zip archive (x3p, plux)'); '' if it cannot be read.
   function kind_of_file(path) result(kind)
      !> Where the file is
      character(len=*), intent(in) :: path
      character(len=:), allocatable :: kind
      character(len=first_bytes) :: bytes
      type(file_identity_t) :: there
      integer :: unit, status, length

      there = identity_of(path)
      kind = ''
      if (.not. there%exists()) return
      kind = kind_in_words(there%kind)
      if (there%kind /= kind_regular .and. there%kind /= kind_unknown) return
      kind = ''
      open (newunit=unit, file=path, access='stream', form='unformatted', status='old', action='read', iostat=status)
      if (status /= 0) return
      inquire (unit=unit, size=length)
      length = min(length, first_bytes)
      if (length > 0) read (unit, iostat=status) bytes(:length)
      close (unit)
      if (status == 0) kind = kind_of_bytes(bytes(:max(0, length)))
   end function kind_of_file

   !> The kind of a file from its first bytes.
   pure function kind_of_bytes(bytes) result(kind)
      character(len=*), intent(in) :: bytes
      character(len=:), allocatable :: kind

      if (len(bytes) == 0) then
         kind = 'an empty file'
      else if (begins(bytes, 'PK'//achar(3)//achar(4))) then
         kind = 'a zip archive (.x3p, .plux, .opdx, .npz)'
      else if (begins(bytes, 'DIGITAL SURF') .or. begins(bytes, 'DSCOMPRESSED')) then
         kind = 'Digital Surf .sur'
      else if (begins(bytes, 'aISO-') .or. begins(bytes, 'bISO-') .or. begins(bytes, 'aBCR-') .or. begins(bytes, 'bBCR-')) then
         kind = 'ISO 25178-71 .sdf'
      else if (begins(bytes(2:), 'NUMPY')) then
         kind = 'NumPy .npy'
      else if (begins(bytes, 'CDF'//achar(1)) .or. begins(bytes, 'CDF'//achar(2)) .or. begins(bytes, 'CDF'//achar(5))) then
         kind = 'netCDF classic'
      else if (begins(bytes, char(136)//char(27)//char(3))) then
         kind = 'MetroPro .dat'
      else if (begins(bytes, 'MATLAB 5.0')) then
         kind = 'MATLAB .mat of version 5'
      else if (begins(bytes, 'GWYP') .or. begins(bytes, 'GWYO')) then
         kind = 'Gwyddion .gwy'
      else if (begins(bytes, char(31)//char(139))) then
         kind = 'a gzip archive'
      else if (begins(bytes, char(255)//char(254)) .or. begins(bytes, char(254)//char(255))) then
         kind = 'a text in UTF-16'
      else if (is_text(bytes)) then
         kind = 'a text'
      else
         kind = 'an unknown binary file'
      end if
   end function kind_of_bytes

   pure logical function begins(bytes, signature)
      character(len=*), intent(in) :: bytes, signature
      begins = .false.
      if (len(bytes) >= len(signature)) begins = bytes(:len(signature)) == signature
   end function begins

   !> No control characters but tab, line feed, form feed, carriage return.
   pure logical function is_text(bytes)
      character(len=*), intent(in) :: bytes
      integer :: k, code

      is_text = .true.
      do k = 1, len(bytes)
         code = ichar(bytes(k:k))
         is_text = is_text .and. (code >= 32 .or. any(code == [9, 10, 12, 13]))
      end do
   end function is_text

end module microslip_io_file_kind
