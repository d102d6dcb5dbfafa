// The trials of adaptive observers in docs/measurements/identification.md, one row each.
#pragma once

#include <cstdint>
#include <filesystem>

namespace sprag::adaptation_study {

/// Runs every trial with `runs` seeds, starting with the first, and prints one table row each: the
/// medians and the worst of the runs.
void print_table(const std::filesystem::path& scenes, std::uint64_t first_seed, int runs);

/// One parameter wrong at a time, by 10 % and 20 %, and all parameters wrong: the medians of the
/// floors of replica, both and adaptive.
void print_single(const std::filesystem::path& scenes, std::uint64_t first_seed, int runs);

/// With a jitter of 1e-4: the lower limit of V after a number of impacts (bound.h), and the mean
/// and median V of the observer right after them.
void print_bound(const std::filesystem::path& scenes, std::uint64_t first_seed, int runs);

/// V over time of three trials with one seed, as CSV on stdout: trial,t,adaptive,replica,both.
void print_chart(const std::filesystem::path& scenes, std::uint64_t seed);

}  // namespace sprag::adaptation_study
