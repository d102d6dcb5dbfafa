// libFuzzer's entry point to one target: SPRAG_FUZZ_TARGET.
#include "tests/fuzz/targets.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  sprag::fuzz::SPRAG_FUZZ_TARGET({data, size});
  return 0;
}
