// Identifies drawn records of right and wrong machines and counts the verdicts.
//
//   identification [--kind NAME] [--trials N] [--first N] [--verbose]
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <iostream>

#include "sprag/identification.h"
#include "studies/identification/records.h"

namespace sprag::identification_study {
namespace {

struct Outcome {
  FitProblem problem = FitProblem::no_convergence;
  std::vector<FittedUnknown> unknowns;
  std::string note;
};

Outcome run(const Record& record) {
  try {
    const Identification found = identify(record.nominal, record.events, record.settings);
    char text[96];
    std::snprintf(text, sizeof text, " misfit %d cause %d left out %d/%d scatter %.2e",
                  static_cast<int>(found.misfit), static_cast<int>(found.departure.cause),
                  found.left_out, found.events, found.scatter);
    std::string note = text;
    for (const MissingImpact& impact : found.missing) note += " +" + std::to_string(impact.t);
    for (const std::size_t i : found.spurious) note += " -" + std::to_string(record.events[i].t);
    return {found.problem, found.unknowns, note};
  } catch (const TooFewImpacts&) {
    return {FitProblem::no_convergence, {}, "too few"};
  }
}

struct Row {
  int accepted = 0, right = 0, near = 0, wrong = 0, undetermined = 0, wrong_model = 0, covered = 0,
      values = 0;
  double seconds = 0.0, longest = 0.0;
};

void run_trial(const std::string& kind, std::uint64_t trial, bool verbose, Row& row) {
  const Record record = drawn(kind, trial);
  const auto begin = std::chrono::steady_clock::now();
  const Outcome outcome = run(record);
  const double seconds =
      std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  row.seconds += seconds;
  row.longest = std::max(row.longest, seconds);
  const bool accepted = outcome.problem == FitProblem::none;
  row.accepted += accepted;
  row.wrong_model += outcome.problem == FitProblem::wrong_model;
  double worst = 0.0;
  bool any = false;
  std::string errors;
  for (std::size_t k = 0; k < outcome.unknowns.size(); ++k) {
    const FittedUnknown& of = outcome.unknowns[k];
    const double truth = record.truth[k];
    char text[96] = "";
    if (!std::isnan(truth)) {
      const double error = std::abs(error_of(of.unknown, of.value, truth));
      const double sigma =
          std::max(of.sigma, (of.high - of.low) / 3.92) / std::abs(of.unknown.slope(of.value));
      const double z = error < 1e-7 ? 0.0 : error / std::max(sigma, 1e-300);
      std::snprintf(text, sizeof text, " %.1f%s (%.4g+-%.1e)", z, of.determined ? "" : "?",
                    of.value, of.sigma);
      if (of.determined) {
        worst = std::max(worst, z);
        if (accepted && error > 1e-7) row.covered += z < 1.96, ++row.values;
      }
    }
    any = any || of.determined;
    errors += text;
  }
  if (accepted && !any) ++row.undetermined;
  if (accepted && any) ++(worst < 3.0 ? row.right : worst < 6.0 ? row.near : row.wrong);
  if (verbose) {
    std::printf("  %s %d: %.2f s problem %d%s jitter %.2e%s %s\n", kind.c_str(),
                static_cast<int>(trial), seconds, static_cast<int>(outcome.problem), errors.c_str(),
                record.jitter, record.settings.jitter ? "" : " (not given)", outcome.note.c_str());
    std::fflush(stdout);
  }
}

int main(int argc, char** argv) {
  bool verbose = false;
  std::string only;
  std::uint64_t trials = 9, first = 0;
  for (int i = 1; i < argc; ++i) {
    const std::string option = argv[i];
    if (option == "--verbose")
      verbose = true;
    else if (i + 1 >= argc)
      return 2;
    else if (option == "--kind")
      only = argv[++i];
    else if (option == "--trials")
      trials = std::strtoull(argv[++i], nullptr, 10);
    else if (option == "--first")
      first = std::strtoull(argv[++i], nullptr, 10);
  }
  std::printf("accepted (right/3-6/beyond 6/undetermined)  wrong_model  covered  s (longest)\n");
  for (const std::string& kind : kinds) {
    if (!only.empty() && kind != only) continue;
    Row row;
    for (std::uint64_t trial = first; trial < first + trials; ++trial)
      run_trial(kind, trial, verbose, row);
    std::printf("%-24s %2d of %2d (%d/%d/%d/%d)  %d  %d of %d  %.1f (%.1f)\n", kind.c_str(),
                row.accepted, static_cast<int>(trials), row.right, row.near, row.wrong,
                row.undetermined, row.wrong_model, row.covered, row.values, row.seconds,
                row.longest);
    std::fflush(stdout);
  }
  return 0;
}

}  // namespace
}  // namespace sprag::identification_study

int main(int argc, char** argv) { return sprag::identification_study::main(argc, argv); }
