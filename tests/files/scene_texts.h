// Two small valid scenes, and changes that make them invalid.
#pragma once

#include <gtest/gtest.h>

#include <string>
#include <string_view>

#include "sprag/scene_file.h"

namespace sprag {

inline constexpr std::string_view beam_text = R"([beam]
modes = 3
length = 1.0
bending_stiffness = 1.0
mass_per_length = 1.0
damping = 0.17
[excitation]
amplitude = 0.03
frequency = 9.5
phase = 0.25
[impact]
law = "poisson"
restitution = 0.7
chatter_time = 1e-7
[[contact]]
position = 0.868
clearance = 0.01
side = "below"
mount = "ground"
[master]
q = [-0.05, 0.0, 0.0]
u = [0.0, 0.0, 0.0]
[replica]
q = [0.1, 2]
u = []
)";

inline constexpr std::string_view system_text = R"([system]
M = [[2.0, 0.5], [0.5, 1.0]]
C = [[0.1, 0.0], [0.0, 0.2]]
K = [[3, -1], [-1, 3.0]]
[[force]]
direction = [1.0, 2.0]
constant = -9.81
amplitude = 0.3
frequency = 2.0
[impact]
restitution = 0.5
[[contact]]
direction = [0.0, 1.0]
clearance = 0.1
motion = { amplitude = 0.01, frequency = 4.0, phase = 0.5 }
[master]
q = [0.1, 0.2]
)";

inline Scene parse(std::string_view text) { return parse_scene(text, "x.toml"); }

/// The message of the error that the action throws, without the folder.
template <typename Action>
std::string message_of(const Action& action, const std::string& folder = "") {
  try {
    action();
  } catch (const Error& error) {
    std::string what = error.what();
    while (!folder.empty() && what.find(folder) != std::string::npos) {
      what.erase(what.find(folder), folder.size());
    }
    return what;
  }
  return "no error";
}

inline std::string error_of(std::string_view text) {
  return message_of([&] { parse(text); });
}

inline std::string replaced(std::string_view text, std::string_view from, std::string_view to) {
  std::string result(text);
  const std::size_t at = result.find(from);
  EXPECT_NE(at, std::string::npos) << "nothing to replace: " << from;
  return at == std::string::npos ? result : result.replace(at, from.size(), to);
}

}  // namespace sprag
