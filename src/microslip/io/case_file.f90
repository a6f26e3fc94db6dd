!> The case file: namelist text to a checked case, and a case back to namelist text.
!>
!> All faults are collected and reported at once, one line each:
!> file, line, group (with number and name), key, value, what is allowed.
module microslip_io_case_file
   use microslip_core_error, only: error_t, bad_input
   use microslip_core_fault_list, only: fault_list_t
   use microslip_core_nearest_name, only: nearest_name, quoted_list
   use microslip_core_text, only: to_text
   use microslip_io_case, only: case_t
   use microslip_io_case_analyses, only: load_keys, preload_keys, linear_modes_keys, transient_keys, output_keys
   use microslip_io_case_checks, only: check_case
   use microslip_io_case_excitation, only: excitation_keys, settling_keys
   use microslip_io_case_interface, only: interface_keys, topography_keys
   use microslip_io_case_modal, only: qsma_keys, ringdown_keys
   use microslip_io_case_periodic, only: harmonic_balance_keys, epmc_keys
   use microslip_io_case_model, only: case_keys, model_keys, reduction_keys, damping_keys, contact_keys
   use microslip_io_group_keys, only: group_keys_t, reading, writing
   use microslip_io_input_files, only: note_input
   use microslip_io_namelist_text, only: namelist_group_t, scan_namelists
   implicit none(type, external)
   private

   public :: read_case, case_from_text, resolved_text

   character(len=*), parameter :: single(14) = [character(len=16) :: 'case', 'model', 'reduction', 'damping', &
      'contact', 'preload', 'linear_modes', 'transient', 'qsma', 'ringdown', 'settling', 'harmonic_balance', 'epmc', 'output']
   character(len=*), parameter :: repeated(4) = [character(len=16) :: 'interface', 'topography', 'load', 'excitation']
   !> Larger files are no case files (characters).
   integer, parameter :: largest_file = 4000000

contains

   !> Read and check a case file.
   subroutine read_case(path, input, error)
      !> Path of the case file
      character(len=*), intent(in) :: path
      !> The checked case; not to be used if there is an error
      type(case_t), intent(out) :: input
      !> Every fault of the file, one line each
      type(error_t), allocatable, intent(out) :: error
      character(len=:), allocatable :: text
      character(len=200) :: reason
      integer :: unit, length, status

      call note_input(path)
      open (newunit=unit, file=path, access='stream', form='unformatted', status='old', action='read', &
         iostat=status, iomsg=reason)
      if (status /= 0) then
         call bad_input(error, path//': cannot be opened: '//trim(reason))
         return
      end if
      inquire (unit=unit, size=length)
      if (length > 0) then
         allocate (character(len=min(length, largest_file + 1)) :: text)
         read (unit, iostat=status, iomsg=reason) text
      else
         call read_pipe(unit, text)
      end if
      close (unit)
      if (status /= 0) then
         call bad_input(error, path//': cannot be read: '//trim(reason))
      else if (len(text) > largest_file) then
         call bad_input(error, path//': is no case file: allowed: a text of at most '//to_text(largest_file)//' letters')
      else
         call case_from_text(text, path, input, error)
      end if
   end subroutine read_case

   !> All that comes out of a pipe or standard input, whose length is known at its end only; cut off beyond a case file's length.
   subroutine read_pipe(unit, text)
      integer, intent(in) :: unit
      character(len=:), allocatable, intent(out) :: text
      character(len=:), allocatable :: more
      character :: letter
      integer :: length, status

      allocate (character(len=4096) :: text)
      length = 0
      do while (length <= largest_file)
         read (unit, iostat=status) letter
         if (status /= 0) exit
         if (length == len(text)) then
            more = text//repeat(' ', len(text))
            call move_alloc(more, text)
         end if
         length = length + 1
         text(length:length) = letter
      end do
      text = text(:length)
   end subroutine read_pipe

   !> Check a case that is already in memory.
   subroutine case_from_text(text, path, input, error)
      !> What would stand in the file
      character(len=*), intent(in) :: text
      !> The file's path, for messages and for files named relative to it
      character(len=*), intent(in) :: path
      !> The checked case; not to be used if there is an error
      type(case_t), intent(out) :: input
      !> Every fault of the text, one line each
      type(error_t), allocatable, intent(out) :: error
      type(namelist_group_t), allocatable :: found(:)
      type(group_keys_t), allocatable :: groups(:)
      type(fault_list_t) :: faults
      integer :: k

      input%path = path
      input%text = text
      call scan_namelists(text, path, found, faults)
      call select_groups(found, path, groups, faults)
      call allocate_records(input, groups)
      do k = 1, size(groups)
         call transfer_group(groups(k), input)
      end do
      call require_groups(groups, path, input, faults)
      call check_case(groups, input)
      do k = 1, size(groups)
         call faults%append(groups(k)%faults)
      end do
      call faults%raise(error)
   end subroutine case_from_text

   !> The case as namelist text, every key with the value that is used; it reads back to the same case.
   function resolved_text(input) result(text)
      !> A checked case
      type(case_t), intent(in) :: input
      character(len=:), allocatable :: text
      type(case_t) :: copy

      copy = input
      text = written('case')//written('model')//all_written('interface', size(input%interfaces))// &
         all_written('topography', size(input%topographies))//written('reduction')
      if (allocated(input%damping%modal_ratio) .or. allocated(input%damping%mass_proportional) .or. &
          allocated(input%damping%ratio)) text = text//written('damping')
      text = text//written('contact')//all_written('load', size(input%loads))
      if (input%runs('preload')) text = text//written('preload')
      if (input%runs('linear_modes')) text = text//written('linear_modes')
      if (input%runs('transient')) text = text//written('transient')//all_written('excitation', size(input%excitations))
      if (input%runs('qsma')) text = text//written('qsma')
      if (input%runs('ringdown')) text = text//written('ringdown')
      if (input%runs('harmonic_balance')) text = text//written('harmonic_balance')
      if (input%runs('epmc')) text = text//written('epmc')
      if (input%runs('settling')) text = text//written('settling')
      text = text//written('output')

   contains

      function written(name, number) result(group_text)
         character(len=*), intent(in) :: name
         integer, intent(in), optional :: number
         character(len=:), allocatable :: group_text
         type(group_keys_t) :: keys

         keys = writing(name)
         if (present(number)) keys%number = number
         call transfer_group(keys, copy)
         group_text = keys%text()
      end function written

      function all_written(name, many) result(group_text)
         character(len=*), intent(in) :: name
         integer, intent(in) :: many
         character(len=:), allocatable :: group_text
         integer :: k

         group_text = ''
         do k = 1, many
            group_text = group_text//written(name, k)
         end do
      end function all_written

   end function resolved_text

   !> Between one group and its record, in the direction the group is made for.
   subroutine transfer_group(keys, input)
      type(group_keys_t), intent(inout) :: keys
      type(case_t), intent(inout) :: input

      select case (keys%name)
      case ('case'); call case_keys(keys, input)
      case ('model'); call model_keys(keys, input%model)
      case ('interface'); call interface_keys(keys, input%interfaces(keys%number))
      case ('topography'); call topography_keys(keys, input%topographies(keys%number))
      case ('reduction'); call reduction_keys(keys, input%reduction)
      case ('damping'); call damping_keys(keys, input%damping)
      case ('contact'); call contact_keys(keys, input%contact)
      case ('load'); call load_keys(keys, input%loads(keys%number))
      case ('preload'); call preload_keys(keys, input%preload)
      case ('linear_modes'); call linear_modes_keys(keys, input%linear_modes)
      case ('transient'); call transient_keys(keys, input%transient)
      case ('qsma'); call qsma_keys(keys, input%qsma)
      case ('ringdown'); call ringdown_keys(keys, input%ringdown)
      case ('harmonic_balance'); call harmonic_balance_keys(keys, input%harmonic_balance)
      case ('epmc'); call epmc_keys(keys, input%epmc)
      case ('settling'); call settling_keys(keys, input%settling)
      case ('excitation'); call excitation_keys(keys, input%excitations(keys%number))
      case ('output'); call output_keys(keys, input%output)
      end select
   end subroutine transfer_group

   !> The known groups, numbered; unknown ones and second copies of single ones are faults.
   subroutine select_groups(found, path, groups, faults)
      type(namelist_group_t), intent(in) :: found(:)
      character(len=*), intent(in) :: path
      type(group_keys_t), allocatable, intent(out) :: groups(:)
      type(fault_list_t), intent(inout) :: faults
      logical :: wanted(size(found))
      character(len=:), allocatable :: place
      integer :: k, j, number

      do k = 1, size(found)
         place = path//', line '//to_text(found(k)%line)//': &'//found(k)%name//': '
         wanted(k) = any(repeated == found(k)%name)
         if (any(single == found(k)%name)) then
            wanted(k) = number_of(found, k) == 1
            if (.not. wanted(k)) call faults%add(place//'second group of this name: allowed: one &'//found(k)%name)
         else if (.not. wanted(k)) then
            call faults%add(place//'unknown group: allowed: '//suggestion(found(k)%name))
         end if
      end do
      allocate (groups(count(wanted)))
      j = 0
      do k = 1, size(found)
         if (.not. wanted(k)) cycle
         j = j + 1
         number = number_of(found, k)
         groups(j) = reading(found(k), number, any(repeated == found(k)%name), path)
      end do
   end subroutine select_groups

   !> Which of the groups of its name the k-th group is.
   pure integer function number_of(found, k)
      type(namelist_group_t), intent(in) :: found(:)
      integer, intent(in) :: k
      integer :: j

      number_of = 0
      do j = 1, k
         if (found(j)%name == found(k)%name) number_of = number_of + 1
      end do
   end function number_of

   !> The group that was probably meant, or all groups.
   pure function suggestion(name) result(text)
      character(len=*), intent(in) :: name
      character(len=:), allocatable :: text

      text = nearest_name(name, [single, repeated])
      if (text /= '') then
         text = "did you mean '"//text//"'?"
      else
         text = quoted_list([single, repeated])
      end if
   end function suggestion

   !> One record for each of the groups that may be repeated, with a name by default.
   subroutine allocate_records(input, groups)
      type(case_t), intent(inout) :: input
      type(group_keys_t), intent(in) :: groups(:)
      integer :: k

      allocate (input%interfaces(how_many(groups, 'interface')), input%topographies(how_many(groups, 'topography')))
      allocate (input%loads(how_many(groups, 'load')), input%excitations(how_many(groups, 'excitation')))
      do k = 1, size(input%interfaces)
         input%interfaces(k)%name = 'interface_'//to_text(k)
      end do
      do k = 1, size(input%topographies)
         input%topographies(k)%name = 'topography_'//to_text(k)
      end do
      do k = 1, size(input%loads)
         input%loads(k)%name = 'load_'//to_text(k)
      end do
   end subroutine allocate_records

   !> Groups without which there is nothing to compute.
   subroutine require_groups(groups, path, input, faults)
      type(group_keys_t), intent(in) :: groups(:)
      character(len=*), intent(in) :: path
      type(case_t), intent(in) :: input
      type(fault_list_t), intent(inout) :: faults

      call require('case', .true.)
      call require('model', .true.)
      call require('interface', .true.)
      call require('reduction', .true.)
      call require('preload', input%runs('preload'))
      call require('transient', input%runs('transient'))
      call require('qsma', input%runs('qsma'))
      call require('ringdown', input%runs('ringdown'))
      call require('harmonic_balance', input%runs('harmonic_balance'))
      call require('epmc', input%runs('epmc'))
      call require('settling', input%runs('settling'))

   contains

      subroutine require(name, needed)
         character(len=*), intent(in) :: name
         logical, intent(in) :: needed
         if (needed .and. how_many(groups, name) == 0) &
            call faults%add(path//': &'//name//': the group is missing')
      end subroutine require

   end subroutine require_groups

   !> Number of groups of a name.
   pure integer function how_many(groups, name)
      type(group_keys_t), intent(in) :: groups(:)
      character(len=*), intent(in) :: name
      integer :: k

      how_many = 0
      do k = 1, size(groups)
         if (groups(k)%name == name) how_many = how_many + 1
      end do
   end function how_many

end module microslip_io_case_file
