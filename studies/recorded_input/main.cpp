// Recorded inputs: error of the state against the analytic scene by samples per period, and the CPU
// time of the master against that of a harmonic scene.
//
//   recorded_input convergence > convergence.csv
//   recorded_input speed
#include <cstdio>
#include <string_view>

#include "studies/recorded_input/study.h"

int main(int argc, char** argv) {
  const std::string_view study = argc == 2 ? argv[1] : "";
  if (study == "convergence") {
    sprag::recorded_input::convergence();
  } else if (study == "speed") {
    sprag::recorded_input::speed();
  } else {
    std::fputs("usage: recorded_input convergence|speed\n", stderr);
    return 2;
  }
  return 0;
}
