!> What a result file keeps to be continued: /checkpoint, in files of runs that have not come to their end.
module microslip_io_checkpoint
   use microslip_core_digest, only: digest_t
   use microslip_core_error, only: bad_input, error_t
   use microslip_core_text, only: to_text
   use microslip_io_hdf5, only: hdf5_file_t
   use microslip_io_own_files, only: recognise, result_file
   use microslip_io_results, only: format_version, results_t
   implicit none(type, external)
   private

   public :: checkpoint_t, read_checkpoint, begin_checkpoints, keep_analysis, keep_point, end_checkpoints

   character(len=*), parameter :: group = '/checkpoint'

   type :: checkpoint_t
      !> Text of the case, digest of the files it names, threads of the process
      character(len=:), allocatable :: case_text, digest
      integer :: threads = 0
      !> Analyses that are finished
      integer :: analyses = 0
      !> The run behind them, and the restart point of the analysis that follows; not allocated: none
      integer, allocatable :: run(:), point(:)
   end type checkpoint_t

contains

   !> Read it; `unfinished` tells whether there is one.
   subroutine read_checkpoint(path, checkpoint, unfinished, error)
      !> Result file
      character(len=*), intent(in) :: path
      type(checkpoint_t), intent(out) :: checkpoint
      logical, intent(out) :: unfinished
      type(error_t), allocatable, intent(out) :: error
      type(hdf5_file_t) :: file
      type(error_t), allocatable :: ignored
      character(len=:), allocatable :: what
      integer :: version
      logical :: is_own

      unfinished = .false.
      call recognise(path, result_file, is_own, version, what)
      if (.not. is_own) then
         call bad_input(error, path//': --restart goes on with a result file of this program, this is '//what)
      else if (version /= format_version) then
         call bad_input(error, path//': --restart goes on with result files of format_version '//to_text(format_version)// &
            & ', this one has '//to_text(version)//': another version of the program wrote it')
      end if
      if (allocated(error)) return
      call file%open(path, error, own=.true.)
      if (allocated(error)) return
      unfinished = file%has(group)
      call file%read('/setup/input', checkpoint%case_text, error)
      if (.not. allocated(error)) call file%get_attribute('/', 'threads', checkpoint%threads, error)
      if (unfinished) then
         if (.not. allocated(error)) call file%read(group//'/digest', checkpoint%digest, error)
         if (.not. allocated(error)) call file%read(group//'/analyses', checkpoint%analyses, error)
         if (.not. allocated(error) .and. file%has(group//'/run')) call read_words(file, group//'/run', checkpoint%run, error)
         if (.not. allocated(error) .and. file%has(group//'/point')) &
            & call read_words(file, group//'/point', checkpoint%point, error)
      end if
      call file%close(ignored)
   end subroutine read_checkpoint

   !> Words of a state, with their digest: a bit that has changed would be a wrong number somewhere.
   subroutine write_words(file, path, words, description, error)
      type(hdf5_file_t), intent(in) :: file
      character(len=*), intent(in) :: path, description
      integer, intent(in) :: words(:)
      type(error_t), allocatable, intent(out) :: error

      call file%write(path, words, '1', description, error)
      if (.not. allocated(error)) call file%set_attribute(path, 'digest', digest_of(words), error)
   end subroutine write_words

   !> Take them back, as they were written.
   subroutine read_words(file, path, words, error)
      type(hdf5_file_t), intent(in) :: file
      character(len=*), intent(in) :: path
      integer, allocatable, intent(out) :: words(:)
      type(error_t), allocatable, intent(out) :: error
      character(len=:), allocatable :: digest

      call file%read(path, words, error)
      if (.not. allocated(error)) call file%get_attribute(path, 'digest', digest, error)
      if (allocated(error)) return
      if (digest /= digest_of(words)) call bad_input(error, file%path//": '"//path(2:)// &
         & "' is damaged, --restart cannot go on from it")
   end subroutine read_words

   !> Digest of words.
   pure function digest_of(words) result(text)
      integer, intent(in) :: words(:)
      character(len=16) :: text
      type(digest_t) :: digest

      call digest%add(words)
      text = digest%hexadecimal()
   end function digest_of

   !> Nothing is finished yet.
   subroutine begin_checkpoints(results, digest, error)
      type(results_t), intent(in) :: results
      !> Of the files that the case names
      character(len=*), intent(in) :: digest
      type(error_t), allocatable, intent(out) :: error

      call results%file%write(group//'/digest', digest, 'digest of model, surfaces and tables', error)
      if (.not. allocated(error)) call results%file%write(group//'/analyses', 0, '1', 'analyses that are finished', error)
   end subroutine begin_checkpoints

   !> An analysis is finished (or none yet): its results are published.
   subroutine keep_analysis(results, analyses, run, error)
      type(results_t), intent(inout) :: results
      !> How many are finished
      integer, intent(in) :: analyses
      !> The run behind them
      integer, intent(in) :: run(:)
      type(error_t), allocatable, intent(out) :: error

      call results%file%delete(group//'/point', error)
      if (.not. allocated(error)) call write_words(results%file, group//'/run', run, &
         & 'state behind them, in words', error)
      if (.not. allocated(error)) call results%file%write(group//'/analyses', analyses, '1', 'analyses that are finished', error)
      if (.not. allocated(error) .and. analyses > 0) call results%publish(error)
   end subroutine keep_analysis

   !> A restart point of the running analysis.
   subroutine keep_point(results, point, error)
      type(results_t), intent(inout) :: results
      integer, intent(in) :: point(:)
      type(error_t), allocatable, intent(out) :: error

      call write_words(results%file, group//'/point', point, 'restart point of the running analysis, in words', error)
   end subroutine keep_point

   !> The run has come to its end.
   subroutine end_checkpoints(results, error)
      type(results_t), intent(inout) :: results
      type(error_t), allocatable, intent(out) :: error
      call results%file%delete(group, error)
   end subroutine end_checkpoints

end module microslip_io_checkpoint
