// The text of a shipped scene with a recorded excitation, changed to a streamed one.
#pragma once

#include <gtest/gtest.h>

#include <string>

#include "tests/support/temporary_directory.h"

namespace sprag::test {

/// The swept beam with a streamed excitation and these further lines in [excitation]. The stop
/// holds the beam at times, so that clutches lock under the input.
inline std::string streamed_scene(const std::string& lines = {}) {
  std::string text = read_text(SPRAG_SOURCE_DIR "/scenes/swept_beam.toml");
  const auto replace = [&](const std::string& what, const std::string& by) {
    const std::size_t at = text.find(what);
    ASSERT_NE(at, std::string::npos) << what;
    text.replace(at, what.size(), by);
  };
  replace("\"records/swept_base.csv\"", "\"" SPRAG_SOURCE_DIR "/scenes/records/swept_base.csv\"");
  replace("interpolation = \"spline\"",
          "interpolation = \"linear\"\noutside = \"hold\"\nstream = true\n" + lines);
  return text;
}

}  // namespace sprag::test
