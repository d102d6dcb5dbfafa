// identification: repeats the trials of docs/identification.md.
#include <cstdio>
#include <cstdlib>

#include "studies/identification/table.h"

int main(int argc, char** argv) {
  if (argc < 2) {
    std::fprintf(stderr, "usage: identification SCENES [FIRST_SEED [ROW]]\n");
    return 2;
  }
  sprag::identification_study::print_table(
      argv[1], argc > 2 ? std::strtoull(argv[2], nullptr, 10) : 1, argc > 3 ? argv[3] : "");
}
