# The command `sprag` of the build tree, BUILD/sprag, which runs the programs of this build.
set(SPRAG_PROGRAM_TARGETS master_sim observer sync_logger check_scene listen diagnose identify reduce)
# Multi-configuration generators have one folder per configuration.
set(SPRAG_PROGRAM_FOLDERS)
foreach(folder master_sim observer tools)
  list(APPEND SPRAG_PROGRAM_FOLDERS ${folder})
  foreach(configuration IN LISTS CMAKE_CONFIGURATION_TYPES)
    list(APPEND SPRAG_PROGRAM_FOLDERS ${folder}/${configuration})
  endforeach()
endforeach()
list(JOIN SPRAG_PROGRAM_FOLDERS " " SPRAG_PROGRAM_FOLDERS)
set(SPRAG_SCENES ${CMAKE_INSTALL_DATADIR}/sprag/scenes)
set(SPRAG_HINT [[build it with: cmake --build $here --target $1]])
configure_file(command_line/sprag.in ${PROJECT_BINARY_DIR}/sprag @ONLY)
