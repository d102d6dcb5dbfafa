// adaptation: repeats the trials of adaptive observers in docs/identification.md.
#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <string_view>

#include "studies/adaptation/table.h"

int main(int argc, char** argv) {
  if (argc != 4) {
    std::fprintf(stderr, "usage: adaptation SCENES FIRST_SEED RUNS|chart\n");
    return 2;
  }
  const auto seed = std::strtoull(argv[2], nullptr, 10);
  if (std::string_view(argv[3]) == "chart") {
    sprag::adaptation_study::print_chart(argv[1], seed);
  } else {
    sprag::adaptation_study::print_table(argv[1], seed, std::max(1, std::atoi(argv[3])));
  }
}
