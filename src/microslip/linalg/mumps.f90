!> Sparse direct factorisation of symmetric matrices with MUMPS (sequential).
!>
!> A = L D L^T, or of a part of it: with `schur_rows` (the rows b, all others being r) the interior block A_rr is
!> factorised and the Schur complement A_bb - A_br A_rr^-1 A_rb is formed.
!>
!> MUMPS controls used (its users' guide, version 5.5):
!>   ICNTL(7) = 3   SCOTCH ordering (another one where MUMPS is built without it). With Schur rows MUMPS quietly takes
!>                  a minimum degree ordering; SCOTCH's own order with these rows moved to its end (ICNTL(7) = 1)
!>                  needs half the operations of that, PORD's needs 0.9 times
!>   ICNTL(14)      spare workspace in per cent
!>   ICNTL(19) = 3  Schur complement with both triangles
!>   ICNTL(24) = 1  null pivots, their rows in PIVNUL_LIST; works with SYM = 2 and CNTL(1) > 0 only, and misses
!>                  them quietly otherwise
!>   ICNTL(26) = 0  solutions with A_rr, zero on the rows b
!>   ICNTL(27)      right-hand sides treated together
!>   INFOG(12)      negative pivots
module microslip_linalg_mumps
   use, intrinsic :: iso_c_binding, only: c_associated, c_char, c_f_procpointer, c_funptr, c_int, c_null_char, &
      & c_null_ptr, c_ptr
   use omp_lib, only: omp_get_max_threads, omp_set_num_threads
   use microslip_core_error, only: error_t, failure
   use microslip_core_kinds, only: wp, i8
   use microslip_core_machine_memory, only: available_memory
   use microslip_core_text, only: to_text
   use microslip_linalg_sparse, only: symmetric_sparse_t
   implicit none(type, external)
   private

   public :: symmetric_factor_t

   include 'dmumps_struc.h'

   !> The factor of a sparse symmetric matrix. It owns memory of MUMPS: not to be copied by assignment.
   type :: symmetric_factor_t
      private
      type(dmumps_struc), pointer :: id => null()
   contains
      procedure :: factorise
      procedure, private :: solve_one
      procedure, private :: solve_many
      generic :: solve => solve_one, solve_many
      procedure :: active_rows
      procedure :: negative_pivots
      procedure :: factor_entries
      procedure :: release
      final :: finalise
   end type symmetric_factor_t

   interface
      subroutine dmumps(id)
         import :: dmumps_struc
         type(dmumps_struc), intent(inout) :: id
      end subroutine dmumps
   end interface

   interface
      integer(c_int) function c_setenv(name, value, overwrite) bind(c, name='setenv')
         import :: c_char, c_int
         character(kind=c_char), intent(in) :: name(*), value(*)
         integer(c_int), value :: overwrite
      end function c_setenv

      type(c_funptr) function c_dlsym(library, name) bind(c, name='dlsym')
         import :: c_char, c_funptr, c_ptr
         type(c_ptr), value :: library
         character(kind=c_char), intent(in) :: name(*)
      end function c_dlsym

      subroutine c_reset() bind(c)
      end subroutine c_reset
   end interface

   !> What MUMPS does
   integer, parameter :: job_start = -1, job_end = -2, job_analyse = 1, job_factorise = 2, job_solve = 3
   !> Spare workspace in per cent, first and last try
   integer, parameter :: workspace_first = 30, workspace_last = 480
   !> Right-hand sides that one pass through the factor serves
   integer, parameter :: solve_block = 32
   !> A pivot below this share of the norm of the scaled matrix is a null pivot. Those of a mechanism are rounding
   !> errors (up to 1e-12 on 150 000 rows); the softest point of a held structure has its stiffness over that of an
   !> element, 1e-5 for a cantilever 40 times as long as high.
   real(wp), parameter :: null_pivot = 1.0e-10_wp
   !> Threshold of pivoting for a positive definite matrix: practically none, but zero would turn the detection of
   !> null pivots off
   real(wp), parameter :: no_pivoting = 1.0e-6_wp

contains

   !> Factorise a matrix; what the object held before is released.
   subroutine factorise(self, matrix, error, positive_definite, schur_rows, schur, singular_row)
      class(symmetric_factor_t), intent(inout) :: self
      type(symmetric_sparse_t), intent(in), target :: matrix
      !> Out of memory, a singular matrix, or one that should be positive definite and is not
      type(error_t), allocatable, intent(out) :: error
      !> The matrix should be positive definite (default false): no pivoting for stability, negative pivots are an error
      logical, intent(in), optional :: positive_definite
      !> (n_b) rows to be left out of the factor
      integer, intent(in), optional :: schur_rows(:)
      !> (n_b, n_b) Schur complement on the rows left out, in their order
      real(wp), allocatable, target, intent(out), optional :: schur(:, :)
      !> Row in which a singular matrix was found out, 0 otherwise
      integer, intent(out), optional :: singular_row
      integer :: row
      logical :: definite

      if (present(singular_row)) singular_row = 0
      definite = .false.
      if (present(positive_definite)) definite = positive_definite
      call self%release()
      call start(self, matrix)
      if (definite) self%id%cntl(1) = no_pivoting
      self%id%job = job_analyse
      call dmumps(self%id)
      if (present(schur_rows)) call prepare_schur(self%id, schur_rows, schur)
      if (self%id%infog(1) >= 0) call check_memory(self%id, error)
      if (self%id%infog(1) >= 0 .and. .not. allocated(error)) call factorise_with_enough_room(self%id)
      nullify (self%id%jcn, self%id%a, self%id%schur)
      if (allocated(error)) then
         call self%release()
         return
      end if

      row = 0
      if (self%id%infog(1) >= 0 .and. self%id%infog(28) > 0) then
         row = self%id%pivnul_list(1)
         call failure(error, 'singular matrix: '//to_text(self%id%infog(28))//' null pivots, the first in row ' &
                      //to_text(row))
      else if (self%id%infog(1) < 0) then
         call report(self%id, error)
      else if (definite .and. self%negative_pivots() > 0) then
         call failure(error, 'matrix of '//to_text(matrix%n)//' rows is not positive definite: '// &
                      to_text(self%negative_pivots())//' negative pivots')
      end if
      if (present(singular_row)) singular_row = row
      if (allocated(error)) call self%release()
   end subroutine factorise

   !> A new MUMPS instance that looks at the matrix.
   subroutine start(self, matrix)
      type(symmetric_factor_t), intent(inout) :: self
      type(symmetric_sparse_t), intent(in), target :: matrix
      integer :: i

      call make_ordering_reproducible()
      allocate (self%id)
      self%id%comm = 0
      self%id%par = 1
      self%id%sym = 2
      self%id%job = job_start
      call dmumps(self%id)
      self%id%icntl(1:4) = [-1, -1, -1, 0]
      ! In a full matrix the order does not matter
      self%id%icntl(7) = merge(3, 0, 2_i8*matrix%entries() < int(matrix%n, i8)*(matrix%n + 1))
      self%id%icntl(12) = 1
      self%id%icntl(14) = workspace_first
      self%id%icntl(24) = 1
      self%id%icntl(27) = solve_block
      self%id%icntl(28) = 1
      self%id%cntl(3) = null_pivot

      self%id%n = matrix%n
      self%id%nnz = int(matrix%entries(), i8)
      allocate (self%id%irn(matrix%entries()))
      do i = 1, matrix%n
         self%id%irn(matrix%row_start(i):matrix%row_start(i + 1) - 1) = i
      end do
      self%id%jcn => matrix%column
      self%id%a => matrix%value
   end subroutine start

   !> Let SCOTCH find the same order every time: in one thread, unless the user has set another number, and from the
   !> same random numbers. It is MUMPS that links SCOTCH, or does not: hence the search by name.
   subroutine make_ordering_reproducible()
      procedure(c_reset), pointer :: reset
      type(c_funptr) :: address
      integer(c_int) :: status

      status = c_setenv('SCOTCH_PTHREAD_NUMBER'//c_null_char, '1'//c_null_char, 0_c_int)
      address = c_dlsym(c_null_ptr, 'SCOTCH_randomReset'//c_null_char)
      if (.not. c_associated(address)) return
      call c_f_procpointer(address, reset)
      call reset()
   end subroutine make_ordering_reproducible

   !> Ask for a Schur complement; the analysis is repeated with its own order, the Schur rows moved to the end.
   subroutine prepare_schur(id, rows, schur)
      type(dmumps_struc), intent(inout) :: id
      integer, intent(in) :: rows(:)
      real(wp), allocatable, target, intent(out) :: schur(:, :)
      integer :: n_b

      n_b = size(rows)
      allocate (schur(n_b, n_b))
      if (n_b == 0 .or. id%infog(1) < 0) return
      allocate (id%perm_in(id%n), id%listvar_schur(n_b))
      id%perm_in = moved_to_the_end(id%sym_perm, rows)
      id%icntl(7) = 1
      id%listvar_schur = rows
      id%size_schur = n_b
      id%icntl(19) = 3
      id%nprow = 1
      id%npcol = 1
      id%mblock = 100
      id%nblock = 100
      id%schur_mloc = n_b
      id%schur_nloc = n_b
      id%schur_lld = n_b
      id%schur(1:n_b*n_b) => schur
      id%job = job_analyse
      call dmumps(id)
      deallocate (id%perm_in)
   end subroutine prepare_schur

   !> An elimination order in which some rows come last.
   pure function moved_to_the_end(place, last_rows) result(moved)
      !> (n) place of every row in the elimination order
      integer, intent(in) :: place(:)
      integer, intent(in) :: last_rows(:)
      integer :: moved(size(place)), row_at(size(place))
      integer :: k, m

      moved = 0
      moved(last_rows) = [(size(place) - size(last_rows) + k, k=1, size(last_rows))]
      row_at(place) = [(k, k=1, size(place))]
      m = 0
      do k = 1, size(place)
         if (moved(row_at(k)) > 0) cycle
         m = m + 1
         moved(row_at(k)) = m
      end do
   end function moved_to_the_end

   !> Whether there is the memory that MUMPS estimates after its analysis.
   subroutine check_memory(id, error)
      type(dmumps_struc), intent(in) :: id
      type(error_t), allocatable, intent(out) :: error
      real(wp) :: needed, free

      needed = 1.0e6_wp*id%infog(17)
      free = available_memory()
      if (free > 0.0_wp .and. needed > free) call failure(error, 'sparse factorisation of '//to_text(id%n)// &
         & ' rows: MUMPS estimates '//to_text(1.0e-9_wp*needed, 3)//' GB of memory, '//to_text(1.0e-9_wp*free, 3)//' GB are free')
   end subroutine check_memory

   !> Numerical factorisation; repeated with more workspace where MUMPS asks for it.
   subroutine factorise_with_enough_room(id)
      type(dmumps_struc), intent(inout) :: id

      do
         id%job = job_factorise
         call dmumps(id)
         if (.not. any(id%infog(1) == [-8, -9, -14, -15, -17, -20])) exit
         if (id%icntl(14) >= workspace_last) exit
         id%icntl(14) = 2*id%icntl(14)
      end do
   end subroutine factorise_with_enough_room

   !> MUMPS's error codes in words.
   subroutine report(id, error)
      type(dmumps_struc), intent(in) :: id
      type(error_t), allocatable, intent(out) :: error
      character(len=:), allocatable :: place

      place = 'sparse factorisation of '//to_text(id%n)//' rows: '
      select case (id%infog(1))
      case (-7, -8, -9, -13, -19)
         call failure(error, place//'out of memory; MUMPS estimated '//to_text(id%infog(17))//' MB')
      case (-10)
         call failure(error, place//'singular matrix')
      case default
         call failure(error, place//'MUMPS failed with code '//to_text(id%infog(1))//', '//to_text(id%infog(2)))
      end select
   end subroutine report

   !> Solve A x = b; with Schur rows A_rr x_r = b_r, whatever b holds on the Schur rows, and x = 0 there.
   subroutine solve_one(self, rhs)
      class(symmetric_factor_t), intent(inout) :: self
      !> (n) right-hand side, the solution on return
      real(wp), intent(inout), contiguous, target :: rhs(:)
      real(wp), pointer, contiguous :: block(:, :)

      block(1:size(rhs), 1:1) => rhs
      call self%solve_many(block)
   end subroutine solve_one

   !> The same for many right-hand sides.
   subroutine solve_many(self, rhs)
      class(symmetric_factor_t), intent(inout) :: self
      !> (n, columns) right-hand sides, the solutions on return
      real(wp), intent(inout), contiguous, target :: rhs(:, :)
      integer :: threads

      if (size(rhs) == 0) return
      self%id%rhs(1:size(rhs)) => rhs
      self%id%nrhs = size(rhs, 2)
      self%id%lrhs = size(rhs, 1)
      self%id%job = job_solve
      ! The many small BLAS calls of a solution gain nothing from threads and lose much on a busy machine.
      threads = omp_get_max_threads()
      call omp_set_num_threads(1)
      call dmumps(self%id)
      call omp_set_num_threads(threads)
      nullify (self%id%rhs)
   end subroutine solve_many

   !> The rows that are in the factor: all but the Schur rows, ascending.
   pure function active_rows(self) result(rows)
      class(symmetric_factor_t), intent(in) :: self
      integer, allocatable :: rows(:)
      logical :: active(self%id%n)
      integer :: k

      active = .true.
      if (self%id%size_schur > 0) active(self%id%listvar_schur) = .false.
      rows = pack([(k, k=1, self%id%n)], active)
   end function active_rows

   !> Number of negative pivots = negative eigenvalues of the matrix (of A_rr with Schur rows).
   pure integer function negative_pivots(self)
      class(symmetric_factor_t), intent(in) :: self
      negative_pivots = self%id%infog(12)
   end function negative_pivots

   !> Entries of the factor.
   pure integer(i8) function factor_entries(self)
      class(symmetric_factor_t), intent(in) :: self
      factor_entries = int(self%id%infog(29), i8)
      if (factor_entries < 0) factor_entries = -factor_entries*1000000_i8
   end function factor_entries

   !> Give the memory back; harmless on an empty object.
   subroutine release(self)
      class(symmetric_factor_t), intent(inout) :: self

      if (.not. associated(self%id)) return
      if (associated(self%id%irn)) deallocate (self%id%irn)
      if (associated(self%id%listvar_schur)) deallocate (self%id%listvar_schur)
      self%id%job = job_end
      call dmumps(self%id)
      deallocate (self%id)
      self%id => null()
   end subroutine release

   subroutine finalise(self)
      type(symmetric_factor_t), intent(inout) :: self
      call self%release()
   end subroutine finalise

end module microslip_linalg_mumps
