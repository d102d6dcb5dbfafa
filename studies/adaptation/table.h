// The trials of docs/measurements/identification.md of adaptive observers: a row each.
#pragma once

#include <cstdint>
#include <filesystem>

namespace sprag::adaptation_study {

/// Runs every trial with `runs` seeds from the first on and prints a row of a table: the medians
/// and the worst of the runs.
void print_table(const std::filesystem::path& scenes, std::uint64_t first_seed, int runs);

/// One parameter wrong at a time, by 10 % and 20 %, and all: the medians of the floors of replica,
/// both and adaptive.
void print_single(const std::filesystem::path& scenes, std::uint64_t first_seed, int runs);

/// With a jitter of 1e-4: the least V that so many impacts allow (bound.h), and the mean and median
/// of the observer's right behind them.
void print_bound(const std::filesystem::path& scenes, std::uint64_t first_seed, int runs);

/// V over time of three trials with one seed, as CSV on stdout: trial,t,adaptive,replica,both.
void print_chart(const std::filesystem::path& scenes, std::uint64_t seed);

}  // namespace sprag::adaptation_study
