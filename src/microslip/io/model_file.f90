!> The program's own model file: mesh, node sets and sparse matrices in one HDF5 file, SI units (doc/model_file.md).
!>
!> Matrices are stored as one triangle in compressed rows with column differences, which gzip packs well. A mass that
!> couples equal components of nodes only, with the same value for all three, is stored once per pair of nodes.
module microslip_io_model_file
   use, intrinsic :: ieee_arithmetic, only: ieee_is_finite
   use microslip_core_error, only: bad_input, error_t
   use microslip_core_kinds, only: i8, wp
   use microslip_core_text, only: to_text
   use microslip_fe_model, only: fe_model_t
   use microslip_io_element_types, only: is_brick, nodes_per_element
   use microslip_io_file_identity, only: link_target, place_of
   use microslip_io_hdf5, only: hdf5_file_t, is_hdf5_file
   use microslip_io_mesh_format, only: mesh_format_in_words
   use microslip_io_own_files, only: check_replaceable, copy_of, mark, model_file
   use microslip_io_working_file, only: working_file_t
   use microslip_linalg_sparse, only: from_triplets, symmetric_sparse_t
   implicit none(type, external)
   private

   public :: read_model_hdf5, write_model_hdf5

   character(len=*), parameter :: format_name = 'microslip model'
   integer, parameter :: format_version = 1
   !> How the mass is stored.
   character(len=*), parameter :: per_row = 'rows', per_node = 'nodes'

contains

   !> Write a model. Only a model that was written by this procedure is replaced, as a whole.
   subroutine write_model_hdf5(path, model, error, title, source)
      !> Where to
      character(len=*), intent(in) :: path
      !> The model, SI units
      type(fe_model_t), intent(in) :: model
      type(error_t), allocatable, intent(out) :: error
      !> What the model is, and where it comes from
      character(len=*), intent(in), optional :: title, source
      type(working_file_t) :: new
      type(hdf5_file_t) :: file
      type(error_t), allocatable :: close_error
      character(len=:), allocatable :: place

      place = path
      if (link_target(path) /= '') place = place_of(path)
      call check_replaceable(path, model_file, error)
      if (.not. allocated(error)) call new%take(copy_of(place), model_file, error)
      if (allocated(error)) return
      call file%create(new%path, error, compression=9)
      if (.not. allocated(error)) call mark(file, model_file, format_version, error)
      if (.not. allocated(error) .and. present(title)) call file%set_attribute('/', 'title', title, error)
      if (.not. allocated(error) .and. present(source)) call file%set_attribute('/', 'source', source, error)
      if (.not. allocated(error)) call write_mesh(file, model, error)
      if (.not. allocated(error)) call file%write('/rows/node', model%row_node, '1', &
         'index of the node of every matrix row, from 1', error)
      if (.not. allocated(error)) call file%write('/rows/component', model%row_component, '1', &
         'displacement component of every matrix row: 1 x, 2 y, 3 z', error)
      if (.not. allocated(error)) call write_matrix(file, '/stiffness', model%stiffness, 'N/m', error)
      if (.not. allocated(error)) call write_mass(file, model, error)
      call file%close(close_error)
      if (.not. allocated(error)) call move_alloc(close_error, error)
      if (.not. allocated(error)) call new%publish_as(place, error)
      if (allocated(error)) call new%give_up()
   end subroutine write_model_hdf5

   !> Nodes, elements, node sets.
   subroutine write_mesh(file, model, error)
      type(hdf5_file_t), intent(in) :: file
      type(fe_model_t), intent(in) :: model
      type(error_t), allocatable, intent(out) :: error
      integer :: k

      call file%write('/coordinates', model%coordinates, 'm', 'node positions (node, xyz)', error)
      if (.not. allocated(error)) call file%write('/node_label', model%node_label, '1', &
         'number of every node in the finite-element program, ascending', error)
      if (.not. allocated(error)) call file%require_group('/elements', error)
      if (.not. allocated(error)) call file%require_group('/node_sets', error)
      if (allocated(error)) return
      do k = 1, size(model%elements)
         call file%write('/elements/'//model%elements(k)%type, model%elements(k)%connectivity, '1', &
            'node indices from 1, Abaqus order (element, node)', error)
         if (allocated(error)) return
      end do
      if (allocated(model%other_elements)) call write_other_elements(file, model, error)
      if (allocated(error)) return
      do k = 1, size(model%node_sets)
         if (allocated(model%node_sets(k)%fault)) cycle
         if (scan(model%node_sets(k)%name, '/') > 0 .or. model%node_sets(k)%name == '.') then
            call bad_input(error, file%path//": the node set name '"//model%node_sets(k)%name//"' must not contain '/'")
            return
         end if
         call file%write('/node_sets/'//model%node_sets(k)%name, model%node_sets(k)%nodes, '1', &
            'node indices from 1, ascending', error)
         if (allocated(error)) return
      end do
   end subroutine write_mesh

   !> Elements without faces. A type that the program does not know has its number of nodes in the name.
   subroutine write_other_elements(file, model, error)
      type(hdf5_file_t), intent(in) :: file
      type(fe_model_t), intent(in) :: model
      type(error_t), allocatable, intent(out) :: error
      character(len=:), allocatable :: name
      integer :: k

      do k = 1, size(model%other_elements)
         associate (block => model%other_elements(k))
            if (size(block%connectivity) == 0) cycle
            name = block%type
            if (nodes_per_element(name) == 0) name = name//'_'//to_text(size(block%connectivity, 1))
            call file%write('/other_elements/'//name, block%connectivity, '1', &
               'node indices from 1 of elements that cannot be joints (element, node)', error)
         end associate
         if (allocated(error)) return
      end do
   end subroutine write_other_elements

   !> One triangle in compressed rows: lengths of the rows, differences of the columns, values.
   subroutine write_matrix(file, group, matrix, units, error)
      type(hdf5_file_t), intent(in) :: file
      character(len=*), intent(in) :: group, units
      type(symmetric_sparse_t), intent(in) :: matrix
      type(error_t), allocatable, intent(out) :: error
      integer, allocatable :: step(:)
      integer :: row, first, last

      allocate (step(matrix%entries()))
      do row = 1, matrix%n
         first = matrix%row_start(row)
         last = matrix%row_start(row + 1) - 1
         step(first) = 0
         step(first + 1:last) = matrix%column(first + 1:last) - matrix%column(first:last - 1)
      end do
      call file%write(group//'/row_length', matrix%row_start(2:) - matrix%row_start(:matrix%n), '1', &
         'entries of every row of the upper triangle, the diagonal first', error)
      if (.not. allocated(error)) call file%write(group//'/column_step', step, '1', &
         'column of every entry less the column of the entry before it; 0 at the diagonal', error)
      if (.not. allocated(error)) call file%write(group//'/value', matrix%value(:matrix%entries()), units, &
         'entries row by row', error)
   end subroutine write_matrix

   !> The mass: per pair of nodes if that says it all.
   subroutine write_mass(file, model, error)
      type(hdf5_file_t), intent(in) :: file
      type(fe_model_t), intent(in) :: model
      type(error_t), allocatable, intent(out) :: error
      type(symmetric_sparse_t) :: nodal

      nodal = nodal_mass(model)
      if (same(expanded(nodal, model), model%mass)) then
         call write_matrix(file, '/mass', nodal, 'kg', error)
         if (.not. allocated(error)) call file%set_attribute('/mass', 'form', per_node, error)
      else
         call write_matrix(file, '/mass', model%mass, 'kg', error)
         if (.not. allocated(error)) call file%set_attribute('/mass', 'form', per_row, error)
      end if
   end subroutine write_mass

   !> Mass per pair of nodes, taken from the first component that both nodes have.
   function nodal_mass(model) result(nodal)
      type(fe_model_t), intent(in) :: model
      type(symmetric_sparse_t) :: nodal
      integer, allocatable :: rows(:, :), node_a(:), node_b(:)
      real(wp), allocatable :: value(:)
      integer :: row, k, a, b, count

      rows = model%rows_of_nodes()
      allocate (node_a(model%mass%entries()), node_b(model%mass%entries()), value(model%mass%entries()))
      count = 0
      do row = 1, model%mass%n
         a = model%row_node(row)
         do k = model%mass%row_start(row), model%mass%row_start(row + 1) - 1
            b = model%row_node(model%mass%column(k))
            if (findloc(rows(:, a) > 0 .and. rows(:, b) > 0, .true., dim=1) /= model%row_component(row)) cycle
            if (model%row_component(model%mass%column(k)) /= model%row_component(row)) cycle
            count = count + 1
            node_a(count) = a
            node_b(count) = b
            value(count) = model%mass%value(k)
         end do
      end do
      nodal = from_triplets(model%node_count(), node_a(:count), node_b(:count), value(:count))
   end function nodal_mass

   !> The mass matrix of a mass per pair of nodes.
   function expanded(nodal, model) result(mass)
      type(symmetric_sparse_t), intent(in) :: nodal
      type(fe_model_t), intent(in) :: model
      type(symmetric_sparse_t) :: mass
      integer, allocatable :: rows(:, :), row(:), column(:)
      real(wp), allocatable :: value(:)
      integer :: a, b, c, k, count

      rows = model%rows_of_nodes()
      allocate (row(3*nodal%entries()), column(3*nodal%entries()), value(3*nodal%entries()))
      count = 0
      do a = 1, nodal%n
         do k = nodal%row_start(a), nodal%row_start(a + 1) - 1
            b = nodal%column(k)
            do c = 1, 3
               if (rows(c, a) == 0 .or. rows(c, b) == 0) cycle
               count = count + 1
               row(count) = rows(c, a)
               column(count) = rows(c, b)
               value(count) = nodal%value(k)
            end do
         end do
      end do
      mass = from_triplets(model%row_count(), row(:count), column(:count), value(:count))
   end function expanded

   !> Whether two matrices are equal to the last bit.
   pure logical function same(a, b)
      type(symmetric_sparse_t), intent(in) :: a, b

      same = a%n == b%n .and. a%entries() == b%entries()
      if (same) same = all(a%row_start == b%row_start)
      if (same) same = all(a%column == b%column)
      if (same) same = .not. any(a%value < b%value .or. a%value > b%value)
   end function same

   !> Read a model and check it.
   subroutine read_model_hdf5(path, model, error)
      !> Where it is
      character(len=*), intent(in) :: path
      !> The model, SI units
      type(fe_model_t), intent(out) :: model
      type(error_t), allocatable, intent(out) :: error
      type(hdf5_file_t) :: file
      type(error_t), allocatable :: ignored

      call file%open(path, error)
      if (allocated(error)) then
         call say_format(path, error)
         return
      end if
      call check_format(file, error)
      if (.not. allocated(error)) call read_nodes(file, model, error)
      if (.not. allocated(error)) call read_elements(file, model, error)
      if (.not. allocated(error)) call read_other_elements(file, model, error)
      if (.not. allocated(error)) call read_node_sets(file, model, error)
      if (.not. allocated(error)) call read_rows(file, model, error)
      if (.not. allocated(error)) call read_matrix(file, '/stiffness', 'N/m', model%row_count(), model%stiffness, error)
      if (.not. allocated(error)) call read_mass(file, model, error)
      if (.not. allocated(error)) call check_diagonals(file, model, error)
      call file%close(ignored)
   end subroutine read_model_hdf5

   !> A file that is not HDF5: what it looks like, and how a model of that kind is named.
   subroutine say_format(path, error)
      character(len=*), intent(in) :: path
      type(error_t), intent(inout) :: error
      character(len=:), allocatable :: kind

      kind = mesh_format_in_words(path)
      if (is_hdf5_file(path) .or. kind == '') return
      error%message = path//': not an HDF5 file, it looks like '//kind//'; a model file of this program is expected'
      if (kind == 'an Abaqus/CalculiX deck' .or. kind == 'a gmsh mesh') error%message = error%message// &
         " (a mesh with matrices of CalculiX: source = 'calculix', file = the matrices' name without .sti, mesh_file = this file)"
   end subroutine say_format

   !> Is this a model file, of a version the program knows?
   subroutine check_format(file, error)
      type(hdf5_file_t), intent(in) :: file
      type(error_t), allocatable, intent(out) :: error
      character(len=:), allocatable :: name
      integer :: version

      call file%get_attribute('/', 'format', name, error, default='')
      if (allocated(error)) return
      if (name /= format_name) then
         call bad_input(error, file%path//": not a model file (attribute 'format' is not '"//format_name//"')")
         if (index(name, 'microslip') == 1) error%message = error%message//": it is a file of the kind '"//name//"'"
         if (file%has('/ENS_MAA')) error%message = error%message//': it is a MED mesh (Salome), which cannot be read'
         if (file%has('/VTKHDF')) error%message = error%message//': it is a VTK file, which cannot be read'
         return
      end if
      call file%get_attribute('/', 'format_version', version, error)
      if (allocated(error)) return
      if (version /= format_version) call bad_input(error, file%path//': format_version '//to_text(version)// &
         ' is not known (this program reads '//to_text(format_version)//')')
   end subroutine check_format

   !> Coordinates and labels.
   subroutine read_nodes(file, model, error)
      type(hdf5_file_t), intent(in) :: file
      type(fe_model_t), intent(inout) :: model
      type(error_t), allocatable, intent(out) :: error

      call check_units(file, '/coordinates', 'm', error)
      if (.not. allocated(error)) call file%read('/coordinates', model%coordinates, error)
      if (.not. allocated(error)) call file%read('/node_label', model%node_label, error)
      if (allocated(error)) return
      if (size(model%coordinates, 1) /= 3 .or. size(model%coordinates, 2) /= size(model%node_label)) then
         call bad_input(error, file%path//": 'coordinates' must be (nodes, 3) with as many nodes as 'node_label'")
      else if (.not. all(ieee_is_finite(model%coordinates))) then
         call bad_input(error, file%path//": 'coordinates' holds values that are not finite")
      else if (size(model%node_label) == 0) then
         call bad_input(error, file%path//": 'node_label' is empty")
      else if (.not. strictly_ascending(model%node_label, huge(1))) then
         call bad_input(error, file%path//": 'node_label' must be positive and ascending")
      end if
   end subroutine read_nodes

   !> Elements by type.
   subroutine read_elements(file, model, error)
      type(hdf5_file_t), intent(in) :: file
      type(fe_model_t), intent(inout) :: model
      type(error_t), allocatable, intent(out) :: error
      character(len=:), allocatable :: names(:)
      integer :: k

      call member_names(file, '/elements', names, error)
      if (allocated(error)) return
      allocate (model%elements(size(names)))
      do k = 1, size(names)
         associate (block => model%elements(k))
            block%type = trim(names(k))
            call file%read('/elements/'//block%type, block%connectivity, error)
            if (allocated(error)) return
            if (.not. is_brick(block%type)) then
               call bad_input(error, file%path//": 'elements/"//block%type// &
                  "': no type of bricks (C3D8, C3D8I, C3D8R, C3D20, C3D20R are); other elements belong to 'other_elements'")
            else if (size(block%connectivity, 1) /= nodes_per_element(block%type)) then
               call bad_input(error, file%path//": 'elements/"//block%type//"' must be (elements, "// &
                  to_text(nodes_per_element(block%type))//')')
            else if (any(block%connectivity < 1 .or. block%connectivity > model%node_count())) then
               call bad_input(error, file%path//": 'elements/"//block%type//"' holds node indices outside 1 to "// &
                  to_text(model%node_count()))
            end if
         end associate
         if (allocated(error)) return
      end do
   end subroutine read_elements

   !> Elements without faces: any types.
   subroutine read_other_elements(file, model, error)
      type(hdf5_file_t), intent(in) :: file
      type(fe_model_t), intent(inout) :: model
      type(error_t), allocatable, intent(out) :: error
      character(len=:), allocatable :: names(:)
      integer :: k

      allocate (character(len=1) :: names(0))
      if (file%has('/other_elements')) call member_names(file, '/other_elements', names, error)
      if (allocated(error)) return
      allocate (model%other_elements(size(names)))
      do k = 1, size(names)
         associate (block => model%other_elements(k))
            block%type = trim(names(k))
            call file%read('/other_elements/'//block%type, block%connectivity, error)
            if (allocated(error)) return
            if (any(block%connectivity < 1 .or. block%connectivity > model%node_count())) call bad_input(error, file%path// &
               ": 'other_elements/"//block%type//"' holds node indices outside 1 to "//to_text(model%node_count()))
         end associate
         if (allocated(error)) return
      end do
   end subroutine read_other_elements

   !> Node sets.
   subroutine read_node_sets(file, model, error)
      type(hdf5_file_t), intent(in) :: file
      type(fe_model_t), intent(inout) :: model
      type(error_t), allocatable, intent(out) :: error
      character(len=:), allocatable :: names(:)
      integer :: k

      call member_names(file, '/node_sets', names, error)
      if (allocated(error)) return
      allocate (model%node_sets(size(names)))
      do k = 1, size(names)
         model%node_sets(k)%name = trim(names(k))
         call file%read('/node_sets/'//model%node_sets(k)%name, model%node_sets(k)%nodes, error)
         if (allocated(error)) return
         if (.not. strictly_ascending(model%node_sets(k)%nodes, model%node_count())) then
            call bad_input(error, file%path//": 'node_sets/"//model%node_sets(k)%name// &
               "' must hold ascending node indices from 1 to "//to_text(model%node_count()))
            return
         end if
      end do
   end subroutine read_node_sets

   !> Names of a group's members.
   subroutine member_names(file, group, names, error)
      type(hdf5_file_t), intent(in) :: file
      character(len=*), intent(in) :: group
      character(len=:), allocatable, intent(out) :: names(:)
      type(error_t), allocatable, intent(out) :: error
      character(len=255), allocatable :: list(:)

      call file%members(group, list, error)
      if (.not. allocated(error)) names = list
   end subroutine member_names

   !> Node and component of every matrix row.
   subroutine read_rows(file, model, error)
      type(hdf5_file_t), intent(in) :: file
      type(fe_model_t), intent(inout) :: model
      type(error_t), allocatable, intent(out) :: error
      logical, allocatable :: taken(:, :)
      integer :: k

      call file%read('/rows/node', model%row_node, error)
      if (.not. allocated(error)) call file%read('/rows/component', model%row_component, error)
      if (allocated(error)) return
      if (size(model%row_node) /= size(model%row_component) .or. size(model%row_node) == 0) then
         call bad_input(error, file%path//": 'rows/node' and 'rows/component' must have the same length, at least 1")
         return
      end if
      if (any(model%row_node < 1 .or. model%row_node > model%node_count())) then
         call bad_input(error, file%path//": 'rows/node' holds node indices outside 1 to "//to_text(model%node_count()))
         return
      end if
      if (any(model%row_component < 1 .or. model%row_component > 3)) then
         call bad_input(error, file%path//": 'rows/component' holds values outside 1 to 3")
         return
      end if
      allocate (taken(3, model%node_count()), source=.false.)
      do k = 1, model%row_count()
         if (taken(model%row_component(k), model%row_node(k))) then
            call bad_input(error, file%path//": 'rows' names component "//to_text(model%row_component(k))// &
               ' of node index '//to_text(model%row_node(k))//' twice')
            return
         end if
         taken(model%row_component(k), model%row_node(k)) = .true.
      end do
   end subroutine read_rows

   !> The mass in either form.
   subroutine read_mass(file, model, error)
      type(hdf5_file_t), intent(in) :: file
      type(fe_model_t), intent(inout) :: model
      type(error_t), allocatable, intent(out) :: error
      type(symmetric_sparse_t) :: nodal
      character(len=:), allocatable :: form

      call file%get_attribute('/mass', 'form', form, error)
      if (allocated(error)) return
      select case (form)
      case (per_row)
         call read_matrix(file, '/mass', 'kg', model%row_count(), model%mass, error)
      case (per_node)
         call read_matrix(file, '/mass', 'kg', model%node_count(), nodal, error)
         if (.not. allocated(error)) model%mass = expanded(nodal, model)
      case default
         call bad_input(error, file%path//": 'mass': form '"//form//"' is not known ('"//per_row//"' and '"// &
            per_node//"' are)")
      end select
   end subroutine read_mass

   !> One triangle of a symmetric n x n matrix.
   subroutine read_matrix(file, group, units, n, matrix, error)
      type(hdf5_file_t), intent(in) :: file
      character(len=*), intent(in) :: group, units
      integer, intent(in) :: n
      type(symmetric_sparse_t), intent(out) :: matrix
      type(error_t), allocatable, intent(out) :: error
      integer, allocatable :: length(:), step(:)
      integer :: row, k

      call check_units(file, group//'/value', units, error)
      if (.not. allocated(error)) call file%read(group//'/row_length', length, error)
      if (.not. allocated(error)) call file%read(group//'/column_step', step, error)
      if (.not. allocated(error)) call file%read(group//'/value', matrix%value, error)
      if (allocated(error)) return
      if (size(length) /= n) then
         call bad_input(error, file%path//": '"//group//"/row_length' has "//to_text(size(length))//' rows, expected '// &
            to_text(n))
      else if (size(step) /= size(matrix%value) .or. any(length < 1) .or. sum(int(length, i8)) /= size(step)) then
         call bad_input(error, file%path//": '"//group//"': row_length (each at least 1) must add up to the length of "// &
            'column_step and of value')
      else if (.not. all(ieee_is_finite(matrix%value))) then
         call bad_input(error, file%path//": '"//group//"/value' holds values that are not finite")
      end if
      if (allocated(error)) return
      matrix%n = n
      allocate (matrix%row_start(n + 1), matrix%column(size(step)))
      matrix%row_start(1) = 1
      do row = 1, n
         matrix%row_start(row + 1) = matrix%row_start(row) + length(row)
         k = matrix%row_start(row)
         matrix%column(k) = row
         if (step(k) == 0) then
            do k = matrix%row_start(row) + 1, matrix%row_start(row + 1) - 1
               if (step(k) < 1 .or. step(k) > n - matrix%column(k - 1)) exit
               matrix%column(k) = matrix%column(k - 1) + step(k)
            end do
         end if
         if (k < matrix%row_start(row + 1)) then
            call bad_input(error, file%path//": '"//group//"/column_step': the columns of row "//to_text(row)// &
               ' must start at the diagonal (0), ascend and end before '//to_text(n + 1))
            return
         end if
      end do
   end subroutine read_matrix

   !> Model files are in SI units: one that says otherwise is refused.
   subroutine check_units(file, path, units, error)
      type(hdf5_file_t), intent(in) :: file
      character(len=*), intent(in) :: path, units
      type(error_t), allocatable, intent(out) :: error
      character(len=:), allocatable :: found

      if (.not. file%has_attribute(path, 'units')) return
      call file%get_attribute(path, 'units', found, error)
      if (allocated(error)) return
      if (found /= units) call bad_input(error, file%path//": '"//path(2:)//"' is in '"//found// &
         "', model files are in SI units: '"//units//"'")
   end subroutine check_units

   !> A diagonal entry that no structure has.
   subroutine check_diagonals(file, model, error)
      type(hdf5_file_t), intent(in) :: file
      type(fe_model_t), intent(in) :: model
      type(error_t), allocatable, intent(out) :: error

      if (any(model%stiffness%diagonal() <= 0.0_wp)) then
         call bad_input(error, file%path//": 'stiffness' has a diagonal entry that is not positive")
      else if (any(model%mass%diagonal() < 0.0_wp)) then
         call bad_input(error, file%path//": 'mass' has a negative diagonal entry")
      end if
   end subroutine check_diagonals

   !> Whether a list ascends strictly from at least 1 to at most `largest`.
   pure logical function strictly_ascending(list, largest)
      integer, intent(in) :: list(:), largest
      integer :: n

      n = size(list)
      strictly_ascending = .true.
      if (n == 0) return
      strictly_ascending = list(1) >= 1 .and. list(n) <= largest .and. all(list(2:) > list(:n - 1))
   end function strictly_ascending

end module microslip_io_model_file
