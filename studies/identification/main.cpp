// identification: repeats the trials of docs/measurements/identification.md, or computes the data
// of its charts.
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <string>

#include "studies/identification/charts.h"
#include "studies/identification/table.h"

int main(int argc, char** argv) try {
  const std::string what = argc > 1 ? argv[1] : "";
  const auto seed = [&](int at) {
    return argc > at ? std::strtoull(argv[at], nullptr, 10) : 1001ULL;
  };
  if (what == "charts" && argc > 3) {
    sprag::identification_study::write_chart_data(argv[2], argv[3], seed(4));
    return 0;
  }
  if (what.empty() || what == "charts") {
    std::fprintf(stderr,
                 "usage: identification SCENES [FIRST_SEED [ROW]]\n"
                 "       identification charts SCENES DIR [FIRST_SEED]\n");
    return 2;
  }
  sprag::identification_study::print_table(what, seed(2), argc > 3 ? argv[3] : "");
} catch (const std::exception& error) {
  std::fprintf(stderr, "identification: %s\n", error.what());
  return 2;
}
