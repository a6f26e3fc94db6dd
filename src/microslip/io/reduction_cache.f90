!> The reduced model kept in an HDF5 file, under a digest of everything it depends on: FE matrices, interfaces,
!> force patterns, options. A cache of another digest is ignored and written anew.
module microslip_io_reduction_cache
   use microslip_core_digest, only: digest_t
   use microslip_core_error, only: error_t
   use microslip_core_kinds, only: wp
   use microslip_core_text, only: to_text
   use microslip_fe_interface, only: contact_interface_t
   use microslip_fe_model, only: fe_model_t
   use microslip_fe_reduced_model, only: reduced_model_t
   use microslip_fe_reduction, only: reduction_options_t
   use microslip_io_hdf5, only: hdf5_file_t, is_hdf5_file
   implicit none(type, external)
   private

   public :: reduction_digest, read_cache, write_cache

   !> Grows with every change of the reduction that changes its numbers, or of the layout.
   integer, parameter :: cache_version = 1

contains

   !> Digest of what a reduction depends on.
   function reduction_digest(model, interfaces, patterns, options) result(text)
      type(fe_model_t), intent(in) :: model
      type(contact_interface_t), intent(in) :: interfaces(:)
      !> (rows, patterns)
      real(wp), intent(in) :: patterns(:, :)
      type(reduction_options_t), intent(in) :: options
      character(len=16) :: text
      type(digest_t) :: digest
      integer :: k

      call digest%add('reduction '//to_text(cache_version)//' '//options%method//' '//to_text(options%modes))
      call digest%add([options%cutoff_frequency])
      call digest%add(model%row_node)
      call digest%add(model%row_component)
      call digest%add(model%stiffness%column)
      call digest%add(model%stiffness%value)
      call digest%add(model%mass%column)
      call digest%add(model%mass%value)
      do k = 1, size(interfaces)
         call digest%add(interfaces(k)%node_a)
         call digest%add(interfaces(k)%node_b)
         call digest%add(reshape(interfaces(k)%frame, [9]))
      end do
      do k = 1, size(patterns, 2)
         call digest%add(patterns(:, k))
      end do
      text = digest%hexadecimal()
   end function reduction_digest

   !> Take the reduced model from the cache if it is there and fits; `found` tells.
   subroutine read_cache(path, digest, reduced, found)
      character(len=*), intent(in) :: path
      character(len=*), intent(in) :: digest
      type(reduced_model_t), intent(out) :: reduced
      logical, intent(out) :: found
      type(hdf5_file_t) :: file
      type(error_t), allocatable :: error
      character(len=:), allocatable :: stored

      found = .false.
      if (.not. is_hdf5_file(path)) return
      call file%open(path, error)
      if (allocated(error)) return
      call file%get_attribute('/', 'digest', stored, error, default='')
      if (.not. allocated(error) .and. stored == digest) then
         call file%get_attribute('/', 'method', reduced%method, error)
         if (.not. allocated(error)) call file%read('/frequency', reduced%frequency, error)
         if (.not. allocated(error)) call file%read('/K_ii', reduced%K_ii, error)
         if (.not. allocated(error)) call file%read('/K_bi', reduced%K_bi, error)
         if (.not. allocated(error)) call file%read('/K_bb', reduced%K_bb, error)
         if (.not. allocated(error)) call file%read('/pattern_i', reduced%pattern_i, error)
         if (.not. allocated(error)) call file%read('/pattern_b', reduced%pattern_b, error)
         found = .not. allocated(error)
      end if
      call file%close(error)
   end subroutine read_cache

   !> Keep a reduced model.
   subroutine write_cache(path, digest, reduced, error)
      character(len=*), intent(in) :: path
      character(len=*), intent(in) :: digest
      type(reduced_model_t), intent(in) :: reduced
      type(error_t), allocatable, intent(out) :: error
      type(hdf5_file_t) :: file
      type(error_t), allocatable :: ignored

      call file%create(path, error)
      if (allocated(error)) return
      file%compression = 0
      call file%write('/frequency', reduced%frequency, 'Hz', 'frequencies of the component modes', error)
      if (.not. allocated(error)) call file%write('/K_ii', reduced%K_ii, '1/s^2', 'modal stiffness', error)
      if (.not. allocated(error)) call file%write('/K_bi', reduced%K_bi, 'N/(m sqrt(kg))', 'coupling stiffness', error)
      if (.not. allocated(error)) call file%write('/K_bb', reduced%K_bb, 'N/m', 'boundary stiffness', error)
      if (.not. allocated(error)) call file%write('/pattern_i', reduced%pattern_i, 'N/sqrt(kg)', &
         & 'force patterns and sensor rows on the modes', error)
      if (.not. allocated(error)) call file%write('/pattern_b', reduced%pattern_b, 'N', &
         & 'force patterns and sensor rows on the boundary', error)
      if (.not. allocated(error)) call file%set_attribute('/', 'method', reduced%method, error)
      ! Last: a file that was cut off has no digest and is ignored.
      if (.not. allocated(error)) call file%set_attribute('/', 'digest', digest, error)
      call file%close(ignored)
   end subroutine write_cache

end module microslip_io_reduction_cache
