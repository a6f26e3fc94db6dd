!> Models from CalculiX: the matrices of `*FREQUENCY, SOLVER=MATRIXSTORAGE` and the mesh they belong to.
!>
!> `base.dof` names every matrix row, one 'node.component' per line; `base.sti` and `base.mas` hold one triangle of
!> stiffness and mass as lines 'row column value'. Incompatible-mode bricks (C3D8I) add 3 hidden nodes each, numbered
!> above the last node of the mesh: they are condensed (`microslip_fe_condensation`).
module microslip_io_calculix
   use microslip_core_error, only: bad_input, error_t
   use microslip_core_kinds, only: i8, wp
   use microslip_core_text, only: to_text
   use microslip_core_warning_list, only: warning_list_t
   use microslip_fe_condensation, only: condense_hidden
   use microslip_fe_model, only: fe_model_t
   use microslip_io_label_list, only: ascending_order, find_label
   use microslip_io_line_reader, only: line_reader_t, next_integer, next_real
   use microslip_io_mesh_file, only: read_mesh
   use microslip_linalg_sparse, only: from_triplets, symmetric_sparse_t
   implicit none(type, external)
   private

   public :: calculix_matrices_t, read_calculix_matrices, read_model_calculix

   !> Hidden nodes of a C3D8I element.
   integer, parameter :: hidden_per_element = 3
   !> Fewest characters of a line of a matrix file: '1 1  9.5542980155796e+05' and its end.
   integer, parameter :: shortest_line = 24
   character(len=*), parameter :: cut_off = 'the last line has no end: the file is cut off'

   !> The matrices as CalculiX wrote them, in its units.
   type :: calculix_matrices_t
      !> (rows) node label and component (1, 2, 3) of every row
      integer, allocatable :: label(:), component(:)
      type(symmetric_sparse_t) :: stiffness, mass
   end type calculix_matrices_t

contains

   !> Read matrices and mesh and make a model in SI units of them.
   subroutine read_model_calculix(matrix_base, mesh_path, unit_length, unit_mass, unit_time, model, error, &
      condense_hidden_mass, warnings)
      !> Path of the matrix files without .sti, .mas, .dof
      character(len=*), intent(in) :: matrix_base
      !> .inp or .msh file with all nodes
      character(len=*), intent(in) :: mesh_path
      !> The model's units in m, kg and s
      real(wp), intent(in) :: unit_length, unit_mass, unit_time
      !> The model
      type(fe_model_t), intent(out) :: model
      type(error_t), allocatable, intent(out) :: error
      !> Whether the hidden nodes' mass goes to the others as CalculiX has it (default), or is left out: then the mass
      !> couples equal components of nodes only and is stored in a ninth of the space
      logical, intent(in), optional :: condense_hidden_mass
      !> Grows by what is doubtful about the files
      type(warning_list_t), intent(inout), optional :: warnings
      type(calculix_matrices_t) :: matrices
      type(warning_list_t) :: found
      integer, allocatable :: kept(:), node(:)
      logical :: with_mass

      call read_mesh(mesh_path, model, found, error)
      if (present(warnings)) call warnings%append(found)
      if (allocated(error)) return
      call read_calculix_matrices(matrix_base, matrices, error)
      if (allocated(error)) return
      call match_rows(matrices, model, matrix_base, mesh_path, node, error)
      if (allocated(error)) return
      with_mass = .true.
      if (present(condense_hidden_mass)) with_mass = condense_hidden_mass
      if (any(node == 0)) then
         call condense_hidden(matrices%stiffness, matrices%mass, node == 0, with_mass, kept, error)
         if (allocated(error)) then
            error%message = matrix_base//'.sti: '//error%message
            return
         end if
         node = node(kept)
         matrices%component = matrices%component(kept)
      end if
      model%row_node = node
      model%row_component = matrices%component
      model%coordinates = unit_length*model%coordinates
      model%stiffness = matrices%stiffness
      model%stiffness%value = unit_mass/unit_time**2*model%stiffness%value
      model%mass = matrices%mass
      model%mass%value = unit_mass*model%mass%value
   end subroutine read_model_calculix

   !> The mesh node of every row, 0 for a row of a hidden node.
   subroutine match_rows(matrices, model, matrix_base, mesh_path, node, error)
      type(calculix_matrices_t), intent(in) :: matrices
      type(fe_model_t), intent(in) :: model
      character(len=*), intent(in) :: matrix_base, mesh_path
      integer, allocatable, intent(out) :: node(:)
      type(error_t), allocatable, intent(out) :: error
      integer(i8) :: last, hidden
      integer :: k, extra

      last = maxval(model%node_label)
      hidden = 0
      do k = 1, size(model%elements)
         if (index(model%elements(k)%type, 'C3D8') == 1) &
            hidden = hidden + hidden_per_element*size(model%elements(k)%connectivity, 2)
      end do
      allocate (node(size(matrices%label)), source=0)
      do k = 1, size(node)
         node(k) = find_label(model%node_label, matrices%label(k))
         if (node(k) == 0 .and. (matrices%label(k) <= last .or. matrices%label(k) > last + hidden)) then
            call bad_input(error, matrix_base//'.dof, line '//to_text(k)//': node '//to_text(matrices%label(k))// &
               ' is not in the mesh '//mesh_path)
            return
         end if
      end do
      extra = count(node == 0)
      if (mod(extra, 3*hidden_per_element) == 0) return
      k = findloc(node, 0, dim=1)
      call bad_input(error, matrix_base//'.dof, line '//to_text(k)//': node '//to_text(matrices%label(k))// &
         ' is not in the mesh '//mesh_path//'. (The '//to_text(extra)//' rows of nodes that are not in it cannot be the hidden '// &
         'nodes of C3D8I bricks: those are '//to_text(3*hidden_per_element)//' for every brick)')
   end subroutine match_rows

   !> Read the three matrix files.
   subroutine read_calculix_matrices(base, matrices, error)
      !> Path of the matrix files without .sti, .mas, .dof
      character(len=*), intent(in) :: base
      !> What they hold
      type(calculix_matrices_t), intent(out) :: matrices
      type(error_t), allocatable, intent(out) :: error
      real(wp), allocatable :: diagonal(:)
      integer :: row

      call read_dof(base//'.dof', matrices, error)
      if (allocated(error)) return
      call read_triplets(base//'.sti', matrices, matrices%stiffness, error)
      if (allocated(error)) return
      call read_triplets(base//'.mas', matrices, matrices%mass, error)
      if (allocated(error)) return
      diagonal = matrices%stiffness%diagonal()
      row = findloc(diagonal > 0.0_wp, .false., dim=1)
      if (row > 0) then
         call bad_input(error, base//'.sti: the diagonal entry of '//row_name(matrices, row)//' is '// &
            to_text(diagonal(row))//', it must be positive')
         return
      end if
      diagonal = matrices%mass%diagonal()
      row = findloc(diagonal >= 0.0_wp, .false., dim=1)
      if (row > 0) call bad_input(error, base//'.mas: the diagonal entry of '//row_name(matrices, row)//' is '// &
         to_text(diagonal(row))//', it must not be negative')
   end subroutine read_calculix_matrices

   !> 'row 7 (node 12.3)'
   pure function row_name(matrices, row) result(name)
      type(calculix_matrices_t), intent(in) :: matrices
      integer, intent(in) :: row
      character(len=:), allocatable :: name
      name = 'row '//to_text(row)//' (node '//to_text(matrices%label(row))//', component '// &
         to_text(matrices%component(row))//')'
   end function row_name

   !> The rows: one 'node.component' per line.
   subroutine read_dof(path, matrices, error)
      character(len=*), intent(in) :: path
      type(calculix_matrices_t), intent(inout) :: matrices
      type(error_t), allocatable, intent(out) :: error
      type(line_reader_t) :: lines
      integer, allocatable :: label(:), component(:)
      integer(i8) :: bytes
      integer :: p, rows
      logical :: found, ok

      call lines%open(path, error)
      if (allocated(error)) return
      inquire (file=path, size=bytes)
      allocate (label(bytes/4 + 1), component(bytes/4 + 1))
      rows = 0
      do
         call lines%next_line(found, error)
         if (allocated(error) .or. .not. found) exit
         associate (text => lines%buffer(lines%first:lines%last))
            if (text == '') cycle
            p = 1
            rows = rows + 1
            call next_integer(text, p, label(rows), ok)
            if (ok) ok = p < len(text)
            if (ok) ok = text(p:p) == '.'
            p = p + 1
            if (ok) call next_integer(text, p, component(rows), ok)
            if (ok) ok = label(rows) > 0 .and. component(rows) >= 1 .and. component(rows) <= 3 .and. text(p:) == ''
            if (.not. ok) then
               call bad_input(error, lines%place()//"'"//lines%shown()//"' is not node.component with a component of 1 to 3")
               exit
            end if
         end associate
      end do
      if (.not. (allocated(error) .or. lines%has_end)) call bad_input(error, lines%place()//cut_off)
      call lines%close()
      if (allocated(error)) return
      if (rows == 0) call bad_input(error, path//': holds no rows')
      matrices%label = label(:rows)
      matrices%component = component(:rows)
      if (.not. allocated(error)) call check_rows(path, matrices, error)
   end subroutine read_dof

   !> Every component of a node has one row.
   subroutine check_rows(path, matrices, error)
      character(len=*), intent(in) :: path
      type(calculix_matrices_t), intent(in) :: matrices
      type(error_t), allocatable, intent(out) :: error
      integer, allocatable :: order(:)
      integer :: first(3), k, row

      order = ascending_order(matrices%label)
      do k = 1, size(order)
         row = order(k)
         if (k == 1) then
            first = 0
         else if (matrices%label(row) /= matrices%label(order(k - 1))) then
            first = 0
         end if
         associate (earlier => first(matrices%component(row)))
            if (earlier > 0) then
               call bad_input(error, path//': the lines '//to_text(earlier)//' and '//to_text(row)//' are both node '// &
                  to_text(matrices%label(row))//', component '//to_text(matrices%component(row))//': CalculiX writes so where '// &
                  'it makes solids of beams and shells (B31, B32R, S8R, ...), which is not supported yet: replace them by '// &
                  'solids, springs or masses')
               return
            end if
            earlier = row
         end associate
      end do
   end subroutine check_rows

   !> One triangle of a matrix as lines 'row column value'. Zeros off the diagonal are dropped.
   subroutine read_triplets(path, matrices, matrix, error)
      character(len=*), intent(in) :: path
      type(calculix_matrices_t), intent(in) :: matrices
      type(symmetric_sparse_t), intent(out) :: matrix
      type(error_t), allocatable, intent(out) :: error
      type(line_reader_t) :: lines
      integer, allocatable :: row(:), column(:)
      real(wp), allocatable :: value(:)
      logical, allocatable :: has_diagonal(:)
      integer(i8) :: bytes
      integer :: n, p, count, largest
      logical :: found, ok

      n = size(matrices%label)
      call lines%open(path, error)
      if (allocated(error)) return
      inquire (file=path, size=bytes)
      largest = int(min(bytes/6 + 1, max(bytes/shortest_line + 1, 1000_i8)))
      allocate (row(largest), column(largest), value(largest))
      allocate (has_diagonal(n), source=.false.)
      count = 0
      do
         call lines%next_line(found, error)
         if (allocated(error) .or. .not. found) exit
         if (lines%last < lines%first) cycle
         if (count == size(row)) call grow()
         p = lines%first
         call next_integer(lines%buffer(:lines%last), p, row(count + 1), ok)
         if (ok) call next_integer(lines%buffer(:lines%last), p, column(count + 1), ok)
         if (ok) call next_real(lines%buffer(:lines%last), p, value(count + 1), ok)
         if (ok) ok = p > lines%last
         if (.not. ok) then
            call bad_input(error, lines%place()//"'"//lines%shown()//"' is not 'row column value' with a finite value")
         else if (min(row(count + 1), column(count + 1)) < 1 .or. max(row(count + 1), column(count + 1)) > n) then
            call bad_input(error, lines%place()//'row '//to_text(row(count + 1))//', column '// &
               to_text(column(count + 1))//' is outside the '//to_text(n)//' rows that the .dof file lists: it is cut off, '// &
               'or that of another run')
         else if (row(count + 1) == column(count + 1)) then
            if (has_diagonal(row(count + 1))) call bad_input(error, lines%place()//'the diagonal entry of '// &
               row_name(matrices, row(count + 1))//' is given twice')
            has_diagonal(row(count + 1)) = .true.
            count = count + 1
         else if (abs(value(count + 1)) > 0.0_wp) then
            count = count + 1
         end if
         if (allocated(error)) exit
      end do
      if (.not. (allocated(error) .or. lines%has_end)) call bad_input(error, lines%place()//cut_off)
      call lines%close()
      if (allocated(error)) return
      if (.not. all(has_diagonal)) then
         p = findloc(has_diagonal, .false., dim=1)
         call bad_input(error, path//': '//row_name(matrices, p)//' of the .dof file has no diagonal entry: do the files '// &
            'belong together?')
         if (.not. any(has_diagonal(p:))) error%message = error%message//' None of the '//to_text(n)//' rows from there on '// &
            'has one: the file is cut off, or it is that of another run'
         return
      end if
      matrix = from_triplets(n, row(:count), column(:count), value(:count))
      if (matrix%entries() /= count) call report_repeated(path, matrices, row(:count), column(:count), error)

   contains

      subroutine grow()
         row = [row, spread(0, 1, count/2)]
         column = [column, spread(0, 1, count/2)]
         value = [value, spread(0.0_wp, 1, count/2)]
      end subroutine grow

   end subroutine read_triplets

   !> Say which entry is given more than once.
   subroutine report_repeated(path, matrices, row, column, error)
      character(len=*), intent(in) :: path
      type(calculix_matrices_t), intent(in) :: matrices
      integer, intent(in) :: row(:), column(:)
      type(error_t), allocatable, intent(out) :: error
      type(symmetric_sparse_t) :: times
      integer :: k, i

      times = from_triplets(size(matrices%label), row, column, spread(1.0_wp, 1, size(row)))
      k = findloc(times%value > 1.5_wp, .true., dim=1)
      i = count(times%row_start <= k)
      call bad_input(error, path//': the entry of '//row_name(matrices, i)//' and '// &
         row_name(matrices, times%column(k))//' is given more than once: one triangle of a symmetric matrix is expected')
      if (any(row == i .and. column == times%column(k)) .and. any(row == times%column(k) .and. column == i)) &
         error%message = error%message//', and the file holds both'
   end subroutine report_repeated

end module microslip_io_calculix
