#include "python/src/random.h"

namespace sprag::python {

std::array<std::uint32_t, 4> philox(std::array<std::uint32_t, 4> counter,
                                    std::array<std::uint32_t, 2> key) {
  constexpr std::uint64_t multiplier_0 = 0xD2511F53, multiplier_1 = 0xCD9E8D57;
  constexpr std::uint32_t weyl_0 = 0x9E3779B9, weyl_1 = 0xBB67AE85;
  const auto high = [](std::uint64_t product) {
    return static_cast<std::uint32_t>(product >> 32U);
  };
  const auto low = [](std::uint64_t product) { return static_cast<std::uint32_t>(product); };
  for (int round = 0; round < 10; ++round) {
    const std::uint64_t a = multiplier_0 * counter[0];
    const std::uint64_t b = multiplier_1 * counter[2];
    counter = {high(b) ^ counter[1] ^ key[0], low(b), high(a) ^ counter[3] ^ key[1], low(a)};
    key[0] += weyl_0;
    key[1] += weyl_1;
  }
  return counter;
}

double Random::uniform() {
  if (left_ == 0) {
    const auto low = [](std::uint64_t word) { return static_cast<std::uint32_t>(word); };
    const auto high = [](std::uint64_t word) { return static_cast<std::uint32_t>(word >> 32U); };
    words_ = philox({block_++, static_cast<std::uint32_t>(purpose_), low(run_), high(run_)},
                    {low(seed_), high(seed_)});
    left_ = 2;
  }
  const std::size_t first = left_ == 2 ? 0 : 2;
  --left_;
  const std::uint64_t word = std::uint64_t{words_[first + 1]} << 32U | words_[first];
  return static_cast<double>(word >> 11U) * 0x1p-53;
}

}  // namespace sprag::python
