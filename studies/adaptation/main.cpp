// adaptation: repeats the trials of adaptive observers in docs/measurements/identification.md.
#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <string_view>

#include "studies/adaptation/table.h"

int main(int argc, char** argv) try {
  if (argc != 4 && argc != 5) {
    std::fprintf(stderr, "usage: adaptation SCENES FIRST_SEED table|single|bound|chart [RUNS]\n");
    return 2;
  }
  const auto seed = std::strtoull(argv[2], nullptr, 10);
  const int runs = argc == 5 ? std::max(1, std::atoi(argv[4])) : 10;
  const std::string_view what = argv[3];
  if (what == "chart") {
    sprag::adaptation_study::print_chart(argv[1], seed);
  } else if (what == "bound") {
    sprag::adaptation_study::print_bound(argv[1], seed, runs);
  } else if (what == "single") {
    sprag::adaptation_study::print_single(argv[1], seed, runs);
  } else {
    sprag::adaptation_study::print_table(argv[1], seed, runs);
  }
} catch (const std::exception& error) {
  std::fprintf(stderr, "adaptation: %s\n", error.what());
  return 2;
}
