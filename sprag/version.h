/// \file
/// \brief Version of the library. CMake, the programs and the Python package read it from here.
#pragma once

/// \brief Version "MAJOR.MINOR.PATCH".
#define SPRAG_VERSION "0.3.0"
