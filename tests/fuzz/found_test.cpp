// Repeats the findings of fuzzing and its seeds, and random changes of them.
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <iostream>
#include <vector>

#include "tests/fuzz/targets.h"
#include "tests/support/random.h"
#include "tests/support/repetitions.h"
#include "tests/support/temporary_directory.h"

namespace sprag::fuzz {
namespace {

using Bytes = std::vector<std::uint8_t>;

std::vector<Bytes> inputs(const std::string& target) {
  std::vector<std::filesystem::path> files;
  const std::filesystem::path source = SPRAG_SOURCE_DIR;
  const auto add = [&files](const std::filesystem::path& directory) {
    for (const auto& entry : std::filesystem::directory_iterator(directory)) {
      if (!entry.is_regular_file()) continue;
      files.push_back(entry.path());
    }
  };
  add(source / "tests/fuzz/found" / target);
  if (target == "scene") add(source / "scenes");
  std::sort(files.begin(), files.end());
  std::vector<Bytes> result;
  for (const auto& file : files) {
    const std::string text = test::read_text(file);
    result.emplace_back(text.begin(), text.end());
  }
  return result;
}

class Found : public testing::TestWithParam<Target> {};

TEST_P(Found, InputsAreHandled) {
  const auto all = inputs(GetParam().name);
  EXPECT_FALSE(all.empty());
  for (const Bytes& input : all) GetParam().run(input);
}

TEST_P(Found, RandomChangesOfInputsAreHandled) {
  const std::uint64_t seed = 7;
  std::cout << "seed " << seed << '\n';
  Random random(seed);
  const auto all = inputs(GetParam().name);
  ASSERT_FALSE(all.empty());
  for (int i = 0; i < repetitions(2000); ++i) {
    Bytes input =
        all[static_cast<std::size_t>(random.integer(0, static_cast<int>(all.size()) - 1))];
    for (int k = random.integer(1, 8); k > 0 && !input.empty(); --k) {
      const auto at =
          static_cast<std::size_t>(random.integer(0, static_cast<int>(input.size()) - 1));
      if (random.chance(0.2)) {
        input.resize(at);
      } else if (random.chance(0.3)) {
        input.insert(input.begin() + static_cast<std::ptrdiff_t>(at),
                     static_cast<std::uint8_t>(random.integer(0, 255)));
      } else {
        input[at] = static_cast<std::uint8_t>(random.integer(0, 255));
      }
    }
    GetParam().run(input);
  }
}

INSTANTIATE_TEST_SUITE_P(Targets, Found, testing::ValuesIn(targets),
                         [](const auto& target) { return std::string(target.param.name); });

}  // namespace
}  // namespace sprag::fuzz
