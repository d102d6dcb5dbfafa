# Installation: libraries with headers, message types and a CMake package; programs; scenes and documents.
include(CMakePackageConfigHelpers)

set(package ${CMAKE_INSTALL_LIBDIR}/cmake/sprag)
install(TARGETS sprag sprag_analysis EXPORT sprag-targets COMPONENT development)
install(DIRECTORY sprag DESTINATION ${CMAKE_INSTALL_INCLUDEDIR} COMPONENT development
        FILES_MATCHING PATTERN "*.h")
install(EXPORT sprag-targets NAMESPACE sprag:: DESTINATION ${package} COMPONENT development)
if(SPRAG_HAS_LCM)
  install(TARGETS sprag_lcm EXPORT sprag-lcm-targets COMPONENT development)
  # In a subfolder of include/sprag, since every LCM project has a folder of this name.
  install(DIRECTORY lcmtypes DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}/sprag COMPONENT development
          FILES_MATCHING PATTERN "*.h")
  install(DIRECTORY ${PROJECT_BINARY_DIR}/lcmtypes/generated/sprag
          DESTINATION ${CMAKE_INSTALL_INCLUDEDIR} COMPONENT development)
  install(EXPORT sprag-lcm-targets NAMESPACE sprag:: DESTINATION ${package} COMPONENT development)
  file(GLOB types ${PROJECT_SOURCE_DIR}/lcmtypes/*.lcm)
  install(FILES ${types} DESTINATION ${CMAKE_INSTALL_DATADIR}/sprag/lcmtypes COMPONENT runtime)
endif()
configure_package_config_file(cmake/sprag-config.cmake.in ${PROJECT_BINARY_DIR}/sprag-config.cmake
  INSTALL_DESTINATION ${package})
write_basic_package_version_file(${PROJECT_BINARY_DIR}/sprag-config-version.cmake
  COMPATIBILITY SameMinorVersion)
install(FILES ${PROJECT_BINARY_DIR}/sprag-config.cmake ${PROJECT_BINARY_DIR}/sprag-config-version.cmake
        DESTINATION ${package} COMPONENT development)

# The names `observer` and `diagnose` are too general for a PATH; the command `sprag` runs the programs.
if(SPRAG_PROGRAMS)
  set(folder ${CMAKE_INSTALL_LIBEXECDIR}/sprag)
  install(TARGETS ${SPRAG_PROGRAM_TARGETS} RUNTIME DESTINATION ${folder} COMPONENT runtime)
  file(RELATIVE_PATH SPRAG_PROGRAM_FOLDERS /prefix/${CMAKE_INSTALL_BINDIR} /prefix/${folder})
  file(RELATIVE_PATH SPRAG_SCENES /prefix/${CMAKE_INSTALL_BINDIR} /prefix/${CMAKE_INSTALL_DATADIR}/sprag/scenes)
  set(SPRAG_HINT "this installation was built without it")
  configure_file(command_line/sprag.in ${PROJECT_BINARY_DIR}/sprag_command/sprag @ONLY)
  install(PROGRAMS ${PROJECT_BINARY_DIR}/sprag_command/sprag DESTINATION ${CMAKE_INSTALL_BINDIR}
          COMPONENT runtime)
  install(FILES command_line/completion.bash
          DESTINATION ${CMAKE_INSTALL_DATADIR}/bash-completion/completions RENAME sprag COMPONENT runtime)

  # Man pages contain the text of --help: `man sprag`, `man sprag-observer`.
  find_program(HELP2MAN help2man)
  if(HELP2MAN)
    set(man_pages)
    function(sprag_man_page page name executable)
      set(output ${PROJECT_BINARY_DIR}/man/${page}.1.gz)
      add_custom_command(OUTPUT ${output} VERBATIM
        COMMAND ${PROJECT_SOURCE_DIR}/command_line/man_page ${name} ${executable} ${PROJECT_VERSION} ${output}
        DEPENDS ${PROJECT_SOURCE_DIR}/command_line/man_page ${executable} ${ARGN})
      set(man_pages ${man_pages} ${output} PARENT_SCOPE)
    endfunction()
    # From the build tree's command, which lists the programs that were built.
    sprag_man_page(sprag sprag ${PROJECT_BINARY_DIR}/sprag ${SPRAG_PROGRAM_TARGETS})
    foreach(program IN LISTS SPRAG_PROGRAM_TARGETS)
      sprag_man_page(sprag-${program} "sprag ${program}" $<TARGET_FILE:${program}>)
    endforeach()
    # A program in Python imports the compiled part, if there is one.
    get_property(python_programs GLOBAL PROPERTY SPRAG_PYTHON_PROGRAMS)
    foreach(program IN LISTS python_programs)
      sprag_man_page(sprag-${program} "sprag ${program}" ${PROJECT_BINARY_DIR}/tools/${program}
        $<$<TARGET_EXISTS:sprag_python>:sprag_python>)
    endforeach()
    add_custom_target(man_pages ALL DEPENDS ${man_pages})
    install(FILES ${man_pages} DESTINATION ${CMAKE_INSTALL_MANDIR}/man1 COMPONENT runtime)
  else()
    message(STATUS "No man pages: help2man makes them")
  endif()
endif()
install(DIRECTORY scenes DESTINATION ${CMAKE_INSTALL_DATADIR}/sprag COMPONENT runtime)
install(FILES README.md LICENSE CITATION.cff CHANGELOG.md DESTINATION ${CMAKE_INSTALL_DOCDIR}
        COMPONENT runtime)
install(DIRECTORY docs DESTINATION ${CMAKE_INSTALL_DOCDIR} COMPONENT runtime
        FILES_MATCHING PATTERN "*.md" PATTERN "*.png")

# cpack -G DEB: sprag, libsprag-dev and, with SPRAG_PYTHON, python3-sprag.
set(CPACK_GENERATOR DEB)
set(CPACK_PACKAGE_NAME sprag)
set(CPACK_PACKAGE_CONTACT "The Sprag developers <sprag@localhost>")
set(CPACK_PACKAGE_DESCRIPTION_SUMMARY "${PROJECT_DESCRIPTION}")
set(CPACK_PACKAGING_INSTALL_PREFIX /usr)
set(CPACK_STRIP_FILES ON)
set(CPACK_COMPONENTS_ALL runtime development)
set(CPACK_DEB_COMPONENT_INSTALL ON)
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CPACK_DEBIAN_PACKAGE_SECTION science)
set(CPACK_DEBIAN_RUNTIME_PACKAGE_NAME sprag)
set(CPACK_DEBIAN_RUNTIME_PACKAGE_SHLIBDEPS ON)
set(CPACK_DEBIAN_DEVELOPMENT_PACKAGE_NAME libsprag-dev)
set(CPACK_DEBIAN_DEVELOPMENT_PACKAGE_SECTION libdevel)
set(CPACK_DEBIAN_DEVELOPMENT_PACKAGE_DEPENDS "libeigen3-dev, liblcm-dev, libsodium-dev")
set(CPACK_COMPONENT_RUNTIME_DESCRIPTION "Programs, scenes and documents")
set(CPACK_COMPONENT_DEVELOPMENT_DESCRIPTION "Headers, static libraries and the CMake package")
if(SPRAG_PYTHON)
  list(APPEND CPACK_COMPONENTS_ALL python)
  set(CPACK_DEBIAN_PYTHON_PACKAGE_NAME python3-sprag)
  set(CPACK_DEBIAN_PYTHON_PACKAGE_SECTION python)
  set(CPACK_DEBIAN_PYTHON_PACKAGE_SHLIBDEPS ON)
  # The module works with one version of Python only.
  set(CPACK_DEBIAN_PYTHON_PACKAGE_DEPENDS "${SPRAG_PYTHON_DEPENDS}")
  # The command `sprag` and the scenes; pictures and tables. Each is imported where it is used.
  set(CPACK_DEBIAN_PYTHON_PACKAGE_RECOMMENDS
    "sprag, python3-aiohttp, python3-matplotlib, python3-pandas, python3-jinja2, python3-scipy, python3-openpyxl")
  set(CPACK_DEBIAN_PYTHON_PACKAGE_SUGGESTS "python3-xarray, python3-mpi4py, python3-distributed, weasyprint")
  set(CPACK_COMPONENT_PYTHON_DESCRIPTION "The package sprag for Python, and the programs in it")
endif()
include(CPack)
