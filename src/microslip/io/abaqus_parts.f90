!> *PART and *INSTANCE of a deck: where every part is placed.
!>
!> Coordinates of a part are its own; an instance places them: x + t, then a turn about an axis through two points (the
!> angle in degrees, right-handed from the first point to the second). A part that is placed once is read; one that is placed
!> twice has nodes that the file does not number.
module microslip_io_abaqus_parts
   use microslip_core_error, only: bad_input, error_t
   use microslip_core_kinds, only: pi, wp
   use microslip_core_text, only: lower_case
   use microslip_core_warning_list, only: severity_doubtful, warning_list_t
   use microslip_io_abaqus_line, only: field, field_count
   use microslip_io_line_reader, only: next_real
   use microslip_io_mesh_builder, only: mesh_builder_t
   implicit none(type, external)
   private

   public :: parts_t

   type :: part_t
      character(len=:), allocatable :: name
      !> Nodes in the order of the file
      integer :: first = 1, last = 0
      logical :: is_placed = .false.
   end type part_t

   type :: parts_t
      !> Name of the part that is being read, '' outside
      character(len=:), allocatable :: name
      type(part_t), allocatable, private :: parts(:)
      !> The part that an instance places, 0 for none, and its data lines so far
      integer, private :: current = 0, lines = 0
      real(wp), private :: translation(3) = 0.0_wp, axis(3, 2) = 0.0_wp, angle = 0.0_wp
   contains
      procedure :: begin
      procedure :: end => end_part
      procedure :: place
      procedure :: read_position
      procedure :: move
      procedure :: check
   end type parts_t

contains

   !> *PART
   subroutine begin(self, name, nodes)
      class(parts_t), intent(inout) :: self
      !> Name of the part
      character(len=*), intent(in) :: name
      !> Nodes read before
      integer, intent(in) :: nodes
      type(part_t), allocatable :: longer(:)
      integer :: n

      n = 0
      if (allocated(self%parts)) n = size(self%parts)
      allocate (longer(n + 1))
      if (n > 0) longer(:n) = self%parts
      longer(n + 1)%name = name
      longer(n + 1)%first = nodes + 1
      call move_alloc(longer, self%parts)
      self%name = name
   end subroutine begin

   !> *END PART
   subroutine end_part(self, nodes)
      class(parts_t), intent(inout) :: self
      !> Nodes read so far
      integer, intent(in) :: nodes

      if (self%name /= '' .and. allocated(self%parts)) self%parts(size(self%parts))%last = nodes
      self%name = ''
   end subroutine end_part

   !> *INSTANCE
   subroutine place(self, part, name, where, error)
      class(parts_t), intent(inout) :: self
      !> Names of the part and of the instance; file and line for messages
      character(len=*), intent(in) :: part, name, where
      type(error_t), allocatable, intent(out) :: error
      integer :: k

      self%current = 0
      self%lines = 0
      self%translation = 0.0_wp
      self%axis = 0.0_wp
      self%angle = 0.0_wp
      if (allocated(self%parts)) then
         do k = 1, size(self%parts)
            if (lower_case(self%parts(k)%name) == lower_case(part)) self%current = k
         end do
      end if
      if (self%current == 0) then
         call bad_input(error, where//"*INSTANCE '"//name//"': there is no part '"//part//"' before it")
      else if (self%parts(self%current)%is_placed) then
         call bad_input(error, where//"*INSTANCE '"//name//"' is the second one of part '"//part//"': its nodes have no "// &
            'numbers of their own. Write the deck without parts and assemblies (in Abaqus/CAE: Do not use parts and '// &
            'assemblies in input files), and make the matrices from that')
      else
         self%parts(self%current)%is_placed = .true.
      end if
   end subroutine place

   !> A data line of *INSTANCE: the translation, then the turn.
   subroutine read_position(self, line, where, error)
      class(parts_t), intent(inout) :: self
      !> The line; file and number of the line for messages
      character(len=*), intent(in) :: line, where
      type(error_t), allocatable, intent(out) :: error
      real(wp) :: numbers(7)
      integer :: k, n, p
      logical :: ok

      self%lines = self%lines + 1
      numbers = 0.0_wp
      n = field_count(line)
      do k = 1, min(n, 7)
         p = 1
         ok = field(line, k) == ''
         if (.not. ok) call next_real(field(line, k), p, numbers(k), ok)
         if (.not. ok) n = 0
      end do
      if (self%lines == 1 .and. n <= 3 .and. n > 0) then
         self%translation = numbers(:3)
      else if (self%lines == 2 .and. n == 7) then
         self%axis = reshape(numbers(:6), [3, 2])
         self%angle = numbers(7)
      else
         call bad_input(error, where//"'"//line//"' is not a position of an *INSTANCE (x, y, z; then two points of an axis "// &
            'and an angle)')
      end if
   end subroutine read_position

   !> *END INSTANCE: move the nodes of the part.
   subroutine move(self, builder)
      class(parts_t), intent(inout) :: self
      type(mesh_builder_t), intent(inout) :: builder

      if (self%current == 0) return
      call builder%move_nodes(self%parts(self%current)%first, self%parts(self%current)%last, self%translation, &
         self%axis(:, 1), turn(self%axis(:, 2) - self%axis(:, 1), self%angle*pi/180.0_wp))
      self%current = 0
   end subroutine move

   !> The matrix of a turn about an axis, after Rodrigues; none about an axis without length.
   pure function turn(axis, angle) result(r)
      real(wp), intent(in) :: axis(3)
      !> rad
      real(wp), intent(in) :: angle
      real(wp) :: r(3, 3)
      real(wp) :: a(3), cross(3, 3)
      integer :: k

      r = 0.0_wp
      do k = 1, 3
         r(k, k) = 1.0_wp
      end do
      if (.not. norm2(axis) > 0.0_wp) return
      a = axis/norm2(axis)
      cross = reshape([0.0_wp, a(3), -a(2), -a(3), 0.0_wp, a(1), a(2), -a(1), 0.0_wp], [3, 3])
      r = r + sin(angle)*cross + (1.0_wp - cos(angle))*matmul(cross, cross)
   end function turn

   !> The deck ends: a part that no instance places is not in the assembly.
   subroutine check(self, path, warnings, error)
      class(parts_t), intent(in) :: self
      !> Name of the file, for messages
      character(len=*), intent(in) :: path
      type(warning_list_t), intent(inout) :: warnings
      type(error_t), allocatable, intent(out) :: error
      integer :: k

      if (.not. allocated(self%parts)) return
      if (self%name /= '') then
         call bad_input(error, path//": part '"//self%name//"' has no *END PART: is the file cut off?")
         return
      end if
      do k = 1, size(self%parts)
         if (.not. self%parts(k)%is_placed) call warnings%add(severity_doubtful, path//": no *INSTANCE places part '"// &
            self%parts(k)%name//"': its nodes are read as they are")
      end do
   end subroutine check

end module microslip_io_abaqus_parts
