!> Going on with an interrupted run: what is behind the finished analyses is kept in the result file and taken back from it.
module microslip_cli_restart
   use microslip_cli_run, only: run_t
   use microslip_cli_scene, only: contact_interfaces
   use microslip_core_archive, only: archive_t
   use microslip_core_digest, only: digest_t
   use microslip_core_error, only: bad_input, error_t, failure
   use microslip_core_text, only: to_text
   use microslip_fe_interface, only: contact_interface_t
   use microslip_fe_reduction, only: reduction_options_t
   use microslip_io_checkpoint, only: begin_checkpoints, checkpoint_t, keep_analysis, read_checkpoint
   use microslip_io_reduction_cache, only: reduction_digest
   use microslip_analysis_potential_set, only: potential_points
   implicit none(type, external)
   private

   public :: open_results, examine_results, keep_run, take_run_back

contains

   !> Begin a result file, or find the one to go on with.
   subroutine open_results(run, path, restart, threads, finished, error)
      type(run_t), intent(inout) :: run
      !> Result file
      character(len=*), intent(in) :: path
      !> Whether to go on with what is there
      logical, intent(in) :: restart
      !> Of this process
      integer, intent(in) :: threads
      !> Whether there is nothing left to be done
      logical, intent(out) :: finished
      type(error_t), allocatable, intent(out) :: error
      logical :: there

      finished = .false.
      run%results%interval = run%case%output%checkpoint_interval
      inquire (file=path, exist=there)
      if (.not. (restart .and. there)) then
         if (restart) call run%log%line('restart: there is no '//path//' yet: from the beginning')
         call run%results%create(path, error)
         if (.not. allocated(error)) call begin_checkpoints(run%results, input_digest(run), error)
         return
      end if
      call examine_results(run, path, error, finished)
      if (allocated(error) .or. finished) return
      call run%results%resume(path, error)
      if (.not. allocated(error)) call run%results%read_warnings(run%warnings, error)
      if (allocated(error)) return
      call run%log%line('restart: goes on with '//path//', finished: '//to_text(run%checkpoint%analyses)//' of ' &
         & //to_text(size(run%case%analyses))//' analyses')
      if (run%checkpoint%threads /= threads) call run%log%line('restart: with '//to_text(threads)//' threads in place of ' &
         & //to_text(run%checkpoint%threads)//': not the same to the last bit')
   end subroutine open_results

   !> Whether a run can go on with what is there.
   subroutine examine_results(run, path, error, finished)
      type(run_t), intent(inout) :: run
      !> Result file; it need not be there
      character(len=*), intent(in) :: path
      type(error_t), allocatable, intent(out) :: error
      !> Whether there is nothing left to be done
      logical, intent(out), optional :: finished
      logical :: there, unfinished

      if (present(finished)) finished = .false.
      inquire (file=path, exist=there)
      if (.not. there) return
      call read_checkpoint(path, run%checkpoint, unfinished, error)
      if (allocated(error)) return
      if (run%checkpoint%case_text /= run%case%text) then
         call bad_input(error, '--restart: '//path//' has the results of another case than '//run%case%path// &
            & ': only the very same case can be continued')
         return
      end if
      if (present(finished)) finished = .not. unfinished
      if (.not. unfinished) return
      if (run%checkpoint%digest /= input_digest(run)) call bad_input(error, '--restart: the model, a surface or a table of ' &
         & //run%case%path//' is no longer what it was in '//path)
   end subroutine examine_results

   !> Digest of what the case takes from other files.
   function input_digest(run) result(text)
      type(run_t), intent(in) :: run
      character(len=16) :: text
      type(digest_t) :: digest
      type(contact_interface_t), allocatable :: interfaces(:)
      integer :: k

      interfaces = contact_interfaces(run%scene)
      call digest%add(reduction_digest(run%scene%model, interfaces, run%scene%patterns, reduction_options_t(method='')))
      do k = 1, size(run%scene%pads)
         call digest%add(run%scene%pads(k)%height)
      end do
      if (allocated(run%scene%tables)) then
         do k = 1, size(run%scene%tables)
            if (allocated(run%scene%tables(k)%points)) &
               & call digest%add(reshape(run%scene%tables(k)%points, [size(run%scene%tables(k)%points)]))
         end do
      end if
      text = digest%hexadecimal()
   end function input_digest

   !> An analysis is finished (or none): keep the run as it is behind it.
   subroutine keep_run(run, analyses, error)
      type(run_t), intent(inout) :: run
      !> How many are finished
      integer, intent(in) :: analyses
      type(error_t), allocatable, intent(out) :: error
      type(archive_t) :: archive

      call pass(run, archive)
      call run%results%write_warnings(run%warnings, error)
      if (.not. allocated(error)) call keep_analysis(run%results, analyses, archive%contents(), error)
      call run%clock%stop('write')
   end subroutine keep_run

   !> The run behind the analyses that are finished.
   subroutine take_run_back(run, error)
      type(run_t), intent(inout) :: run
      type(error_t), allocatable, intent(out) :: error
      type(archive_t) :: archive

      call archive%load(run%checkpoint%run)
      call pass(run, archive, error)
      if (.not. allocated(error) .and. .not. archive%sound()) &
         & call failure(error, run%results%path//': what was kept of the run is cut off')
   end subroutine take_run_back

   !> Store what analyses leave to the next ones, or take it back. The system is there, but not yet restricted.
   subroutine pass(run, archive, error)
      type(run_t), intent(inout) :: run
      type(archive_t), intent(inout) :: archive
      type(error_t), allocatable, intent(out), optional :: error
      logical, allocatable :: potential(:)
      integer :: n_loads, k

      call archive%pass(run%modes%frequency)
      call archive%pass(run%modes%shape)
      call archive%pass(run%modes%residual)
      call archive%pass(run%system%damping)
      n_loads = run%system%n_loads
      call archive%pass(n_loads)
      if (.not. archive%loading) potential = potential_points(run%system)
      call archive%pass(potential)
      call archive%pass(run%state%modal)
      call archive%pass(run%state%amplitude)
      call run%state%contact%pass(archive)
      call run%clock%pass(archive)
      if (.not. archive%loading .or. .not. archive%sound()) return
      call run%system%restrict(potential, error)
      if (allocated(error) .or. n_loads == run%system%n_loads) return
      do k = 1, size(run%case%loads)
         if (run%case%loads(k)%kind == 'modal') call run%system%add_modal_load(run%modes%shape(:, run%case%loads(k)%mode))
      end do
   end subroutine pass

end module microslip_cli_restart
