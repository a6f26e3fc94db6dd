!> Load vectors and sensor rows.
module test_fe_load_pattern
   use microslip_core_error, only: error_t, status_bad_input
   use microslip_core_kinds, only: wp
   use microslip_fe_load_pattern, only: load_vector, sensor_row
   use microslip_fe_model, only: fe_model_t
   use support_mesh, only: two_blocks, pad_size, block_height
   use testdrive, only: new_unittest, unittest_type, error_type, check
   implicit none(type, external)
   private

   public :: collect_fe_load_pattern

   real(wp), parameter :: rounding = 1000*epsilon(1.0_wp)
   real(wp), parameter :: direction(3) = [1.0_wp, -2.0_wp, 2.0_wp], size_of_load = 30.0_wp
   character(len=*), parameter :: types(2) = ['C3D8 ', 'C3D20']

contains

   subroutine collect_fe_load_pattern(testsuite)
      type(unittest_type), allocatable, intent(out) :: testsuite(:)
      testsuite = [new_unittest('uniform_load', test_uniform), &
                   new_unittest('area_load_is_centred', test_area), &
                   new_unittest('area_load_on_an_inner_plane', test_inner), &
                   new_unittest('sensor_sees_the_mean', test_sensor), &
                   new_unittest('supported_direction_without_load', test_free_component), &
                   new_unittest('wrong_loads_are_refused', test_refused)]
   end subroutine collect_fe_load_pattern

   !> Total force and first moments sum_k x_k f_k^T of a load.
   subroutine resultant(model, load, total, moment)
      type(fe_model_t), intent(in) :: model
      real(wp), intent(in) :: load(:)
      real(wp), intent(out) :: total(3), moment(3, 3)
      integer :: k

      total = 0.0_wp
      moment = 0.0_wp
      do k = 1, size(load)
         associate (c => model%row_component(k))
            total(c) = total(c) + load(k)
            moment(:, c) = moment(:, c) + load(k)*model%coordinates(:, model%row_node(k))
         end associate
      end do
   end subroutine resultant

   subroutine test_uniform(error)
      type(error_type), allocatable, intent(out) :: error
      type(fe_model_t) :: model
      type(error_t), allocatable :: failed
      real(wp), allocatable :: load(:)
      real(wp) :: total(3), moment(3, 3)

      model = two_blocks('C3D8', [4, 3, 2], distortion=0.3_wp)
      call load_vector(model, 'top_end', direction, size_of_load, 'uniform', load, failed)
      call check(error,.not. allocated(failed))
      if (.not. allocated(error)) call check(error, size(load), model%row_count())
      if (allocated(error)) return
      call resultant(model, load, total, moment)
      call check(error, maxval(abs(total - size_of_load*direction/3)) <= rounding*size_of_load)
      if (.not. allocated(error)) call check(error, count(load > 0), 2*5*4)
      if (.not. allocated(error)) call check(error, maxval(load), size_of_load*2/3/20, thr=rounding)
   end subroutine test_uniform

   !> A uniform traction on the distorted pad acts in its centre, like one on an even mesh.
   subroutine test_area(error)
      type(error_type), allocatable, intent(out) :: error
      type(fe_model_t) :: model
      type(error_t), allocatable :: failed
      real(wp), allocatable :: load(:)
      real(wp) :: total(3), moment(3, 3)
      integer :: t

      do t = 1, 2
         model = two_blocks(trim(types(t)), [4, 3, 2], distortion=0.3_wp)
         call load_vector(model, 'top_end', direction, size_of_load, 'area', load, failed)
         call check(error,.not. allocated(failed))
         if (allocated(error)) return
         call resultant(model, load, total, moment)
         call check(error, maxval(abs(total - size_of_load*direction/3)) <= rounding*size_of_load)
         if (.not. allocated(error)) call check(error, maxval(abs(moment - outer( &
            [0.5_wp*pad_size, block_height], total))) <= rounding*size_of_load)
         if (allocated(error)) return
      end do
   contains
      pure function outer(a, b) result(c)
         real(wp), intent(in) :: a(3), b(3)
         real(wp) :: c(3, 3)
         c = spread(a, 2, 3)*spread(b, 1, 3)
      end function outer
   end subroutine test_area

   !> Inside the body every face has two elements; the load is that of the surface above it.
   subroutine test_inner(error)
      type(error_type), allocatable, intent(out) :: error
      type(fe_model_t) :: model
      type(error_t), allocatable :: failed
      real(wp), allocatable :: inner(:), outer(:)
      integer :: k

      model = two_blocks('C3D20', [2, 2, 2])
      call load_vector(model, 'top_end', direction, size_of_load, 'area', outer, failed)
      model%node_sets(5)%nodes = pack([(k, k=1, model%node_count())], &
                                      abs(model%coordinates(3, :) - 0.5_wp*block_height) < 1.0e-9_wp)
      call load_vector(model, 'empty', direction, size_of_load, 'area', inner, failed)
      call check(error,.not. allocated(failed))
      if (allocated(error)) return
      do k = 1, size(outer)
         if (outer(k) == 0.0_wp) cycle
         call check(error, abs(inner(row_below(k)) - outer(k)) <= rounding*size_of_load)
         if (allocated(error)) return
      end do
      call check(error, sum(abs(inner)), sum(abs(outer)), thr=rounding*size_of_load)

   contains

      !> The row of the same component half a block below.
      integer function row_below(row)
         integer, intent(in) :: row
         real(wp) :: place(3)
         integer :: m

         row_below = 0
         place = model%coordinates(:, model%row_node(row)) - [0.0_wp, 0.0_wp, 0.5_wp*block_height]
         do m = 1, model%row_count()
            if (model%row_component(m) /= model%row_component(row)) cycle
            if (norm2(model%coordinates(:, model%row_node(m)) - place) < 1.0e-9_wp) row_below = m
         end do
      end function row_below

   end subroutine test_inner

   subroutine test_sensor(error)
      type(error_type), allocatable, intent(out) :: error
      type(fe_model_t) :: model
      type(error_t), allocatable :: failed
      real(wp), allocatable :: row(:), displacement(:)

      model = two_blocks('C3D8', [4, 3, 2], distortion=0.3_wp)
      call sensor_row(model, 'top_end', direction, row, failed)
      call check(error,.not. allocated(failed))
      if (allocated(error)) return
      displacement = 0.1_wp*model%row_component
      call check(error, dot_product(row, displacement), (0.1_wp - 0.4_wp + 0.6_wp)/3, thr=rounding)
      if (allocated(error)) return
      call sensor_row(model, 'bottom_end', direction, row, failed)
      call check(error, allocated(failed))
      if (.not. allocated(error)) call check(error, index(failed%message, 'all its nodes are supported') > 0)
   end subroutine test_sensor

   !> Nodes held in z may carry a load along x.
   subroutine test_free_component(error)
      type(error_type), allocatable, intent(out) :: error
      type(fe_model_t) :: model
      type(error_t), allocatable :: failed
      real(wp), allocatable :: load(:)
      logical, allocatable :: kept(:)

      model = two_blocks('C3D8', [2, 2, 1])
      kept = .not. (model%row_component == 3 .and. &
                    abs(model%coordinates(3, model%row_node) - block_height) < 1.0e-9_wp)
      model%row_node = pack(model%row_node, kept)
      model%row_component = pack(model%row_component, kept)
      call load_vector(model, 'top_end', [1.0_wp, 0.0_wp, 0.0_wp], size_of_load, 'uniform', load, failed)
      call check(error,.not. allocated(failed))
      if (.not. allocated(error)) call check(error, sum(load), size_of_load, thr=rounding*size_of_load)
      if (allocated(error)) return
      call load_vector(model, 'top_end', direction, size_of_load, 'uniform', load, failed)
      call check(error, allocated(failed))
      if (.not. allocated(error)) call check(error, index(failed%message, 'is supported in z') > 0, failed%message)
   end subroutine test_free_component

   subroutine test_refused(error)
      type(error_type), allocatable, intent(out) :: error
      type(fe_model_t) :: model
      type(error_t), allocatable :: failed
      real(wp), allocatable :: load(:)

      model = two_blocks('C3D20', [2, 2, 1])
      call load_vector(model, 'bottom_end', direction, size_of_load, 'area', load, failed)
      call expect('is supported in x')
      if (allocated(error)) return
      call load_vector(model, 'nowhere', direction, size_of_load, 'area', load, failed)
      call expect("there is no node set 'nowhere'; the model has 'top_pad'")
      if (allocated(error)) return
      call load_vector(model, 'empty', direction, size_of_load, 'area', load, failed)
      call expect("'empty' is empty")
      if (allocated(error)) return
      call load_vector(model, 'top_end', 0*direction, size_of_load, 'area', load, failed)
      call expect('no length')
      if (allocated(error)) return
      call load_vector(model, 'top_end', direction, size_of_load, 'even', load, failed)
      call expect("unknown distribution 'even'")
      if (allocated(error)) return
      model%node_sets(3)%nodes = model%node_sets(3)%nodes(:4)
      call load_vector(model, 'top_end', direction, size_of_load, 'area', load, failed)
      call expect('no element face')

   contains

      subroutine expect(words)
         character(len=*), intent(in) :: words
         call check(error, allocated(failed), words)
         if (.not. allocated(error)) call check(error, failed%status, status_bad_input)
         if (.not. allocated(error)) call check(error, index(failed%message, words) > 0, failed%message)
      end subroutine expect

   end subroutine test_refused

end module test_fe_load_pattern
