# Other simulation programs for the comparison of methods, used if they are installed.
# Sets SPRAG_HAS_SICONOS, SPRAG_HAS_MUJOCO and SPRAG_HAS_CVODE, with the targets sprag_siconos,
# sprag_mujoco and sprag_cvode. Debian: libsiconos-kernel-dev libsiconos-numerics-dev,
# libmujoco-dev, libsundials-dev. Siconos has neither a CMake config nor a pkg-config file, so all are
# found by their files.
find_path(SICONOS_INCLUDE_DIR SiconosConfig.h PATH_SUFFIXES siconos)
find_library(SICONOS_KERNEL_LIBRARY siconos_kernel)
find_library(SICONOS_NUMERICS_LIBRARY siconos_numerics)
find_library(SICONOS_EXTERNALS_LIBRARY siconos_externals)
find_path(SICONOS_BOOST_INCLUDE_DIR boost/numeric/ublas/storage.hpp)
set(SPRAG_HAS_SICONOS OFF)
if(SICONOS_INCLUDE_DIR AND EXISTS ${SICONOS_INCLUDE_DIR}/kernel/SiconosKernel.hpp
   AND EXISTS ${SICONOS_INCLUDE_DIR}/numerics/SiconosNumerics.h AND SICONOS_BOOST_INCLUDE_DIR
   AND SICONOS_KERNEL_LIBRARY AND SICONOS_NUMERICS_LIBRARY AND SICONOS_EXTERNALS_LIBRARY)
  set(SPRAG_HAS_SICONOS ON)
  add_library(sprag_siconos INTERFACE)
  target_include_directories(sprag_siconos SYSTEM INTERFACE
    ${SICONOS_INCLUDE_DIR} ${SICONOS_INCLUDE_DIR}/kernel ${SICONOS_INCLUDE_DIR}/numerics
    ${SICONOS_BOOST_INCLUDE_DIR})
  target_link_libraries(sprag_siconos INTERFACE ${SICONOS_KERNEL_LIBRARY}
    ${SICONOS_NUMERICS_LIBRARY} ${SICONOS_EXTERNALS_LIBRARY} ${CMAKE_DL_LIBS})
endif()

find_path(MUJOCO_INCLUDE_DIR mujoco/mujoco.h)
find_library(MUJOCO_LIBRARY mujoco)
set(SPRAG_HAS_MUJOCO OFF)
if(MUJOCO_INCLUDE_DIR AND MUJOCO_LIBRARY)
  set(SPRAG_HAS_MUJOCO ON)
  add_library(sprag_mujoco INTERFACE)
  target_include_directories(sprag_mujoco SYSTEM INTERFACE ${MUJOCO_INCLUDE_DIR})
  target_link_libraries(sprag_mujoco INTERFACE ${MUJOCO_LIBRARY})
endif()

find_path(SUNDIALS_INCLUDE_DIR cvode/cvode.h)
find_library(SUNDIALS_CVODE_LIBRARY sundials_cvode)
find_library(SUNDIALS_NVECSERIAL_LIBRARY sundials_nvecserial)
find_library(SUNDIALS_CORE_LIBRARY sundials_core)
set(SPRAG_HAS_CVODE OFF)
if(SUNDIALS_INCLUDE_DIR AND SUNDIALS_CVODE_LIBRARY AND SUNDIALS_NVECSERIAL_LIBRARY)
  set(SPRAG_HAS_CVODE ON)
  add_library(sprag_cvode INTERFACE)
  target_include_directories(sprag_cvode SYSTEM INTERFACE ${SUNDIALS_INCLUDE_DIR})
  target_link_libraries(sprag_cvode INTERFACE
    ${SUNDIALS_CVODE_LIBRARY} ${SUNDIALS_NVECSERIAL_LIBRARY})
  # Version 7 has an additional library. If it was built with MPI, as in Debian, it includes MPI's header.
  if(SUNDIALS_CORE_LIBRARY)
    target_link_libraries(sprag_cvode INTERFACE ${SUNDIALS_CORE_LIBRARY})
    find_path(MPI_INCLUDE_DIR mpi.h PATH_SUFFIXES mpi)
    find_library(MPI_LIBRARY mpi)
    if(MPI_INCLUDE_DIR AND MPI_LIBRARY)
      target_include_directories(sprag_cvode SYSTEM INTERFACE ${MPI_INCLUDE_DIR})
      target_link_libraries(sprag_cvode INTERFACE ${MPI_LIBRARY})
    endif()
  endif()
endif()
