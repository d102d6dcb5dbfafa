# What is installed: libraries with their headers, message types and a CMake package; programs; scenes and
# documents.
include(CMakePackageConfigHelpers)

set(package ${CMAKE_INSTALL_LIBDIR}/cmake/sprag)
install(TARGETS sprag EXPORT sprag-targets COMPONENT development)
install(DIRECTORY sprag DESTINATION ${CMAKE_INSTALL_INCLUDEDIR} COMPONENT development
        FILES_MATCHING PATTERN "*.h")
install(EXPORT sprag-targets NAMESPACE sprag:: DESTINATION ${package} COMPONENT development)
if(SPRAG_HAS_LCM)
  install(TARGETS sprag_lcm EXPORT sprag-lcm-targets COMPONENT development)
  # Below sprag/, since every LCM project has a folder of this name.
  install(DIRECTORY lcmtypes DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}/sprag COMPONENT development
          FILES_MATCHING PATTERN "*.h")
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

if(SPRAG_PROGRAMS)
  install(TARGETS master_sim observer sync_logger check_scene import_events diagnose
          RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR} COMPONENT runtime)
endif()
install(DIRECTORY scenes DESTINATION ${CMAKE_INSTALL_DATADIR}/sprag COMPONENT runtime)
install(FILES README.md LICENSE CITATION.cff CHANGELOG.md DESTINATION ${CMAKE_INSTALL_DOCDIR}
        COMPONENT runtime)
