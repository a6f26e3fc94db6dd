!> The number of threads of OpenMP and of the BLAS: asked of the run time before it is used.
!>
!> A BLAS that splits a product over more threads than it is given waits for the missing ones for ever. The environment can
!> give fewer than it says (OMP_THREAD_LIMIT, OMP_DYNAMIC, OMP_MAX_ACTIVE_LEVELS), so the threads are counted in a
!> parallel region, and both are told that number.
module microslip_cli_threads
   use, intrinsic :: iso_c_binding, only: c_int
   use microslip_core_error, only: bad_input, error_t
   use microslip_core_text, only: to_text
   use microslip_core_warning_list, only: severity_note, warning_list_t
   implicit none(type, external)
   private

   public :: choose_threads, thread_count

   !> More threads than this, or than four for every processor, are a typing mistake: they only get in each other's way.
   integer, parameter :: many_threads = 64

   interface
      subroutine openblas_set_num_threads(n) bind(c)
         import :: c_int
         implicit none(type, external)
         integer(c_int), value :: n
      end subroutine openblas_set_num_threads
   end interface

contains

   !> Settle the number of threads.
   subroutine choose_threads(asked, warnings, error)
      use omp_lib, only: omp_get_max_active_levels, omp_get_max_threads, omp_get_num_procs, omp_get_num_threads, &
         & omp_get_thread_limit, omp_set_dynamic, omp_set_max_active_levels, omp_set_num_threads
      !> By --threads; 0: as the environment says
      integer, intent(in) :: asked
      !> Told if it is not the number that the environment asks for
      type(warning_list_t), intent(inout) :: warnings
      !> If --threads asks for more than there can be
      type(error_t), allocatable, intent(out) :: error
      integer :: wanted, given, most

      most = max(many_threads, 4*omp_get_num_procs())
      if (asked > min(most, omp_get_thread_limit())) then
         call bad_input(error, 'command line: --threads '//to_text(asked)//': allowed are at most ' &
            & //to_text(min(most, omp_get_thread_limit()))//trim(merge(' (OMP_THREAD_LIMIT)', repeat(' ', 19), &
            & omp_get_thread_limit() < most)))
         return
      end if
      call omp_set_dynamic(.false.)
      call omp_set_max_active_levels(max(1, omp_get_max_active_levels()))
      wanted = merge(asked, omp_get_max_threads(), asked > 0)
      if (wanted > most) then
         call warnings%add(severity_note, 'OMP_NUM_THREADS='//to_text(wanted)//': more threads than '//to_text(most) &
            & //' only slow each other down, '//to_text(omp_get_num_procs())//' are used')
         wanted = omp_get_num_procs()
      end if
      call omp_set_num_threads(min(wanted, omp_get_thread_limit()))
      given = 1
      !$omp parallel default(none) shared(given)
      !$omp single
      given = omp_get_num_threads()
      !$omp end single
      !$omp end parallel
      call omp_set_num_threads(given)
      call openblas_set_num_threads(int(given, c_int))
      if (given < wanted) call warnings%add(severity_note, to_text(given)//' threads are used, not '//to_text(wanted) &
         & //': the environment gives no more (OMP_THREAD_LIMIT = '//to_text(omp_get_thread_limit())//')')
   end subroutine choose_threads

   !> Threads that OpenMP uses.
   integer function thread_count()
      use omp_lib, only: omp_get_max_threads
      thread_count = omp_get_max_threads()
   end function thread_count

end module microslip_cli_threads
