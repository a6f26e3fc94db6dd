!> What a file holds, by its first bytes: which reader is for it, and for messages about files of other formats.
module microslip_io_mesh_format
   use microslip_core_error, only: bad_input, error_t
   use microslip_core_text, only: lower_case
   use microslip_io_line_reader, only: line_reader_t
   implicit none(type, external)
   private

   public :: tell_mesh_format, mesh_format_in_words, format_gmsh, format_abaqus, format_unknown, readable_meshes

   !> Meshes that are read.
   integer, parameter :: format_unknown = 0, format_abaqus = 1, format_gmsh = 2
   character(len=*), parameter :: readable_meshes = &
      'readable are Abaqus/CalculiX decks (.inp) and gmsh meshes (.msh, ASCII, versions 4.1 and 2.2)'
   !> Bytes that are looked at.
   integer, parameter :: first_bytes = 8192

contains

   !> Which reader is for a mesh file. A file that is not recognised may be a deck that begins with something else.
   subroutine tell_mesh_format(path, format, error)
      !> Where it is
      character(len=*), intent(in) :: path
      !> `format_abaqus`, `format_gmsh` or `format_unknown`
      integer, intent(out) :: format
      !> A file that cannot be read, or is known as something else
      type(error_t), allocatable, intent(out) :: error
      character(len=:), allocatable :: bytes, kind

      format = format_unknown
      call read_beginning(path, bytes, error)
      if (allocated(error)) return
      kind = kind_of(bytes)
      if (kind == 'a gmsh mesh') then
         format = format_gmsh
      else if (kind == 'an Abaqus/CalculiX deck') then
         format = format_abaqus
      else if (kind == 'an HDF5 file') then
         call bad_input(error, path//': format not known, it is an HDF5 file: a model of this program is named by '// &
            "source = 'hdf5' and file; "//readable_meshes)
      else if (kind == 'empty') then
         call bad_input(error, path//': is empty, a mesh is expected; '//readable_meshes)
      else if (kind /= '') then
         call bad_input(error, path//': format not known, it looks like '//kind//'; '//readable_meshes)
      end if
   end subroutine tell_mesh_format

   !> What a file looks like; '' where nothing is known.
   function mesh_format_in_words(path) result(kind)
      !> Where it is
      character(len=*), intent(in) :: path
      character(len=:), allocatable :: kind
      character(len=:), allocatable :: bytes
      type(error_t), allocatable :: error

      kind = ''
      call read_beginning(path, bytes, error)
      if (.not. allocated(error)) kind = kind_of(bytes)
   end function mesh_format_in_words

   subroutine read_beginning(path, bytes, error)
      character(len=*), intent(in) :: path
      character(len=:), allocatable, intent(out) :: bytes
      type(error_t), allocatable, intent(out) :: error
      type(line_reader_t) :: lines
      type(error_t), allocatable :: long_line
      logical :: found

      call lines%open(path, error)
      if (allocated(error)) return
      ! A binary file may have no line that can be read: its first bytes are there all the same.
      call lines%next_line(found, long_line)
      bytes = lines%beginning(first_bytes)
      if (allocated(long_line) .and. kind_of(bytes) == '') call move_alloc(long_line, error)
      call lines%close()
   end subroutine read_beginning

   !> The kind of a file from its first bytes.
   pure function kind_of(bytes) result(kind)
      character(len=*), intent(in) :: bytes
      character(len=:), allocatable :: kind
      character(len=:), allocatable :: first

      if (len(bytes) == 0) then
         kind = 'empty'
      else if (begins(char(255)//char(254)) .or. begins(char(254)//char(255))) then
         kind = 'a text in UTF-16: save it as ASCII or UTF-8'
      else if (begins(char(137)//'HDF'//char(13))) then
         kind = 'an HDF5 file'
      else if (begins('PK'//achar(3)//achar(4))) then
         kind = 'a zip archive: unpack it'
      else if (begins(char(31)//char(139)) .or. begins('BZh') .or. begins(char(253)//'7zXZ') .or. begins('7z'//char(188))) then
         kind = 'a compressed file: unpack it'
      else if (begins('CDF'//achar(1)) .or. begins('CDF'//achar(2)) .or. begins('CDF'//achar(5))) then
         kind = 'netCDF (Exodus)'
      else if (begins('%PDF') .or. begins(char(137)//'PNG') .or. begins(char(208)//char(207)//char(17)) &
         .or. begins(char(127)//'ELF')) then
         kind = 'a document, a picture or a program'
      else if (has_line('$meshformat') .or. has_line('$nod')) then
         kind = 'a gmsh mesh'
      else
         first = first_line()
         if (index(first, '# vtk') == 1 .or. index(bytes, '<VTKFile') > 0) then
            kind = 'a VTK file'
         else if (index(first, '<?xml') == 1 .or. index(first, '<!doctype') == 1 .or. index(first, '<html') == 1) then
            kind = 'XML or HTML'
         else if (index(first, 'iso-10303-21') == 1) then
            kind = 'a STEP geometry: mesh it first'
         else if (index(first, 'solid') == 1 .or. index(first, 'cascade topology') == 1 .or. index(first, 'dbrep_draw') == 1) then
            kind = 'a geometry (STL, BREP): mesh it first'
         else if (first == '-1') then
            kind = 'an I-DEAS universal file (.unv)'
         else if (index(first, '1c') == 1 .or. index(first, '1uversion') == 1) then
            kind = 'a CalculiX result file (.frd)'
         else if (has_line('begin bulk') .or. has_line('cend') .or. has_line('grid ') .or. has_line('grid*') &
            .or. has_line('grid,')) then
            kind = 'a Nastran deck (.bdf, .nas, .dat)'
         else if (has_line('/prep7') .or. has_line('/com') .or. has_line('nblock,')) then
            kind = 'an Ansys file (.cdb, .dat)'
         else if (has_line('*keyword')) then
            kind = 'an LS-DYNA deck (.k)'
         else if (index(first, '&') == 1 .and. has_line('&model')) then
            kind = 'a case file of this program'
         else if (index(first, 'meshversionformatted') == 1) then
            kind = 'a Medit mesh (.mesh)'
         else if (index(first, 'mesh3d') == 1 .or. index(first, 'netgen') == 1) then
            kind = 'a Netgen mesh (.vol)'
         else if (index(first, '(0 "') == 1 .or. index(first, '(2 ') == 1) then
            kind = 'a Fluent mesh'
         else if (index(first, '{') == 1) then
            kind = 'JSON'
         else if (index(bytes, achar(0)) > 0) then
            kind = 'a binary file'
         else if (index(first, '*') == 1) then
            kind = 'an Abaqus/CalculiX deck'
         else
            kind = ''
         end if
      end if

   contains

      pure logical function begins(signature)
         character(len=*), intent(in) :: signature
         begins = .false.
         if (len(bytes) >= len(signature)) begins = bytes(:len(signature)) == signature
      end function begins

      !> Whether a line begins with a word (in lower case).
      pure logical function has_line(word)
         character(len=*), intent(in) :: word
         integer :: p, place
         character(len=:), allocatable :: text

         text = new_line('a')//lower_case(bytes)
         has_line = .false.
         p = 1
         do
            place = index(text(p:), new_line('a')//word)
            if (place == 0) return
            p = p + place + len(word)
            ! The word ends there.
            if (p > len(text)) exit
            if (scan(text(p:p), ' ,'//achar(13)//achar(10)//achar(9)) > 0 .or. scan(word(len(word):), ' ,*') > 0) exit
         end do
         has_line = .true.
      end function has_line

      !> The first line that is not blank, in lower case, without blanks around it.
      pure function first_line() result(line)
         character(len=:), allocatable :: line
         integer :: start, length

         line = ''
         start = 1
         if (begins(char(239)//char(187)//char(191))) start = 4
         do while (start <= len(bytes) .and. line == '')
            length = scan(bytes(start:)//new_line('a'), new_line('a')//achar(13)) - 1
            line = trim(adjustl(lower_case(bytes(start:start + length - 1))))
            start = start + length + 1
         end do
      end function first_line

   end function kind_of

end module microslip_io_mesh_format
