!> Frictional contact problems in the local format of FCLib, the Frictional Contact Library.
!>
!>     u = W r + q,   0 <= u_n _|_ r_n >= 0,   r_t in the disk of radius mu r_n, opposite to u_t on its rim
!>
!> is a contact problem with G = W, friction mu, and one driver that scales q: R = q, r_0 = 0. At driver 0 it is the
!> unloaded state without gaps; the problem of the file is the step to driver 1.
!>
!> Datasets: /fclib_local/spacedim = 3; /fclib_local/W/{m, n, nzmax, nz, p, i, x}, indices from 0, with nz = -1
!> compressed columns, -2 compressed rows, otherwise the number of triplets (row i, column p);
!> /fclib_local/vectors/{q, mu}. Acary, Bremond, Huber & Koziara, FCLib: a collection of discrete 3D Frictional
!> Contact problems, INRIA (2014). Problems with bilateral constraints are refused.
module microslip_io_fclib
   use microslip_contact_problem, only: contact_problem_t
   use microslip_core_error, only: bad_input, error_t
   use microslip_core_kinds, only: wp
   use microslip_core_text, only: to_text
   use microslip_io_hdf5, only: hdf5_file_t
   implicit none(type, external)
   private

   public :: read_fclib

   character(len=*), parameter :: root = '/fclib_local/', matrix = root//'W/', vectors = root//'vectors/'
   !> Values of nz that stand for compressed forms.
   integer, parameter :: by_columns = -1, by_rows = -2

contains

   !> Read the problem of a file.
   subroutine read_fclib(path, problem, error)
      !> The HDF5 file
      character(len=*), intent(in) :: path
      !> With the matrix G and one driver
      type(contact_problem_t), intent(out) :: problem
      !> Not such a file, or one of another kind
      type(error_t), allocatable, intent(out) :: error
      type(hdf5_file_t) :: file
      type(error_t), allocatable :: ignored

      call file%open(path, error)
      if (allocated(error)) return
      call read_problem(file, problem, error)
      call file%close(ignored)
   end subroutine read_fclib

   subroutine read_problem(file, problem, error)
      type(hdf5_file_t), intent(in) :: file
      type(contact_problem_t), intent(inout) :: problem
      type(error_t), allocatable, intent(out) :: error
      real(wp), allocatable :: q(:)
      integer, allocatable :: dimensions(:)

      call file%read(root//'spacedim', dimensions, error)
      if (allocated(error)) return
      if (any(dimensions /= 3)) then
         call bad_input(error, file%path//': not a problem of three dimensions')
      else if (file%has(root//'R') .or. file%has(root//'V')) then
         call bad_input(error, file%path//': problems with bilateral constraints are not supported')
      end if
      if (.not. allocated(error)) call read_matrix(file, problem%G, error)
      if (.not. allocated(error)) call file%read(vectors//'q', q, error)
      if (.not. allocated(error)) call file%read(vectors//'mu', problem%friction, error)
      if (allocated(error)) return
      problem%n_points = size(problem%friction)
      if (size(q) /= 3*problem%n_points .or. any(shape(problem%G) /= size(q))) then
         call bad_input(error, file%path//': W of '//to_text(size(problem%G, 1))//' rows, q of '//to_text(size(q))// &
            & ' and mu of '//to_text(problem%n_points)//' entries do not fit')
         return
      end if
      problem%R = reshape(q, [size(q), 1])
      allocate (problem%r_0(size(q)), source=0.0_wp)
   end subroutine read_problem

   !> The dense matrix W of one of the three sparse forms.
   subroutine read_matrix(file, W, error)
      type(hdf5_file_t), intent(in) :: file
      real(wp), allocatable, intent(out) :: W(:, :)
      type(error_t), allocatable, intent(out) :: error
      integer, allocatable :: m(:), n(:), nz(:), p(:), i(:), row(:), column(:)
      real(wp), allocatable :: x(:)
      integer :: k, entries

      call file%read(matrix//'m', m, error)
      if (.not. allocated(error)) call file%read(matrix//'n', n, error)
      if (.not. allocated(error)) call file%read(matrix//'nz', nz, error)
      if (.not. allocated(error)) call file%read(matrix//'p', p, error)
      if (.not. allocated(error)) call file%read(matrix//'i', i, error)
      if (.not. allocated(error)) call file%read(matrix//'x', x, error)
      if (allocated(error)) return
      if (size(m) /= 1 .or. size(n) /= 1 .or. size(nz) /= 1) then
         call bad_input(error, file%path//': m, n and nz of W are not single numbers')
         return
      end if

      select case (nz(1))
      case (by_columns)
         column = indices_of_pointers(p, n(1))
         row = i
         entries = size(column)
      case (by_rows)
         row = indices_of_pointers(p, m(1))
         column = i
         entries = size(row)
      case default
         row = i
         column = p
         entries = nz(1)
      end select
      ! Files may have room for more than the entries.
      if (min(size(row), size(column), size(x)) < entries .or. entries < 0) then
         call bad_input(error, file%path//': W has fewer entries than it says')
         return
      end if
      if (any(row(:entries) < 0 .or. row(:entries) >= m(1) .or. column(:entries) < 0 .or. column(:entries) >= n(1))) then
         call bad_input(error, file%path//': indices of W out of range')
         return
      end if
      allocate (W(m(1), n(1)), source=0.0_wp)
      do k = 1, entries
         W(row(k) + 1, column(k) + 1) = W(row(k) + 1, column(k) + 1) + x(k)
      end do
   end subroutine read_matrix

   !> Index, from 0, of the row or column that every entry of a compressed form belongs to; none for bad pointers.
   pure function indices_of_pointers(pointers, count) result(index)
      !> (count + 1) first entry of every row or column, from 0
      integer, intent(in) :: pointers(:)
      !> Rows or columns
      integer, intent(in) :: count
      integer, allocatable :: index(:)
      integer :: k, j

      index = [integer ::]
      if (size(pointers) <= count .or. count < 1) return
      if (any(pointers(2:count + 1) < pointers(:count)) .or. pointers(1) /= 0) return
      index = [((k - 1, j=pointers(k), pointers(k + 1) - 1), k=1, count)]
   end function indices_of_pointers

end module microslip_io_fclib
