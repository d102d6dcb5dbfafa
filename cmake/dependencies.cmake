# Debian packages only. LCM 1.3.1 ships neither a CMake config nor a pkg-config file that works
# without glib's, so it is found by its files.
find_package(Eigen3 3.4 REQUIRED NO_MODULE)
find_package(CLI11 REQUIRED)
find_package(nlohmann_json REQUIRED)
find_package(Threads REQUIRED)

find_path(SODIUM_INCLUDE_DIR sodium.h REQUIRED)
find_library(SODIUM_LIBRARY sodium REQUIRED)
add_library(sodium INTERFACE)
target_include_directories(sodium SYSTEM INTERFACE ${SODIUM_INCLUDE_DIR})
target_link_libraries(sodium INTERFACE ${SODIUM_LIBRARY})

find_path(TOMLPP_INCLUDE_DIR toml++/toml.h REQUIRED)

find_path(LCM_INCLUDE_DIR lcm/lcm-cpp.hpp REQUIRED)
find_library(LCM_LIBRARY lcm REQUIRED)
find_program(LCM_GEN lcm-gen REQUIRED)
add_library(lcm_bus INTERFACE)
target_include_directories(lcm_bus SYSTEM INTERFACE ${LCM_INCLUDE_DIR})
target_link_libraries(lcm_bus INTERFACE ${LCM_LIBRARY})
