!> Element types of Abaqus and CalculiX: how many nodes they have. Only bricks have faces that the program knows; the others
!> join nodes, and are read so that the mesh is known as a whole.
module microslip_io_element_types
   use microslip_fe_element, only: element_faces
   implicit none(type, external)
   private

   public :: nodes_per_element, is_brick, most_nodes

   !> Of the known types; elements of others may have as many.
   integer, parameter :: most_nodes = 64

contains

   !> Whether elements of this type have faces that can be joints.
   pure logical function is_brick(type)
      !> In capitals
      character(len=*), intent(in) :: type
      is_brick = size(element_faces(type), 2) > 0
   end function is_brick

   !> Number of nodes of an element type, 0 for a type the program has not heard of.
   pure integer function nodes_per_element(type)
      !> In capitals
      character(len=*), intent(in) :: type

      select case (type)
      case ('MASS', 'ROTARYI', 'SPRING1', 'DASHPOT1', 'DCOUP3D', 'HEATCAP')
         nodes_per_element = 1
      case ('SPRING2', 'SPRINGA', 'DASHPOT2', 'DASHPOTA', 'GAPUNI', 'B21', 'B23', 'B31', 'B31R', 'B31H', 'B33', 'PIPE31', &
            'T2D2', 'T3D2', 'R2D2', 'RB3D2', 'CONN3D2', 'CONN2D2', 'JOINTC')
         nodes_per_element = 2
      case ('B22', 'B32', 'B32R', 'B32H', 'PIPE32', 'T2D3', 'T3D3', 'S3', 'S3R', 'S3RS', 'STRI3', 'CPS3', 'CPE3', 'CAX3', &
            'M3D3', 'R3D3', 'SFM3D3', 'DS3', 'D')
         nodes_per_element = 3
      case ('C3D4', 'C3D4H', 'DC3D4', 'F3D4', 'AC3D4', 'S4', 'S4R', 'S4RS', 'S4R5', 'CPS4', 'CPS4R', 'CPS4I', 'CPE4', &
            'CPE4R', 'CPE4I', 'CPE4H', 'CAX4', 'CAX4R', 'CAX4I', 'M3D4', 'M3D4R', 'R3D4', 'SFM3D4', 'SFM3D4R', 'DS4')
         nodes_per_element = 4
      case ('C3D5', 'C3D5H')
         nodes_per_element = 5
      case ('C3D6', 'C3D6H', 'DC3D6', 'F3D6', 'AC3D6', 'SC6R', 'S6', 'STRI65', 'CPS6', 'CPS6M', 'CPE6', 'CPE6M', 'CAX6', &
            'CAX6M', 'M3D6', 'SFM3D6', 'DS6', 'COH3D6')
         nodes_per_element = 6
      case ('C3D8', 'C3D8I', 'C3D8R', 'C3D8H', 'C3D8IH', 'C3D8RH', 'DC3D8', 'F3D8', 'AC3D8', 'SC8R', 'COH3D8', 'S8', 'S8R', &
            'S8R5', 'CPS8', 'CPS8R', 'CPE8', 'CPE8R', 'CPE8H', 'CAX8', 'CAX8R', 'M3D8', 'M3D8R', 'SFM3D8', 'SFM3D8R', 'DS8')
         nodes_per_element = 8
      case ('C3D10', 'C3D10T', 'C3D10M', 'C3D10H', 'C3D10I', 'C3D10HS', 'C3D10MH', 'DC3D10', 'AC3D10')
         nodes_per_element = 10
      case ('C3D13')
         nodes_per_element = 13
      case ('C3D15', 'C3D15H', 'DC3D15', 'AC3D15')
         nodes_per_element = 15
      case ('C3D20', 'C3D20R', 'C3D20RI', 'C3D20H', 'C3D20RH', 'DC3D20', 'AC3D20')
         nodes_per_element = 20
      case default
         nodes_per_element = 0
      end select
   end function nodes_per_element

end module microslip_io_element_types
