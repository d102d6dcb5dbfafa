// The version of the library. SPRAG_VERSION is the one place where it is written: CMake, the
// programs and the package for Python read it from here.
#pragma once

#define SPRAG_VERSION "0.2.0"
