program main
   implicit none(type, external)
end program main
