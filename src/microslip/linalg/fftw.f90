!> The Fortran 2003 interface of FFTW 3, as a module. https://www.fftw.org/fftw3_doc
module microslip_linalg_fftw
   use, intrinsic :: iso_c_binding
   implicit none(type, external)
   public

   include 'fftw3.f03'
end module microslip_linalg_fftw
