// Would catch a change of numbers in a scene's text that also changes comments, order or other
// tables.
#include "sprag/detail/files/scene_text.h"

#include <gtest/gtest.h>

#include "sprag/scene_file.h"

namespace sprag {
namespace {

constexpr const char* commented = R"(# A comment.
name = "é"   # beyond ASCII
[beam]
damping = 0.17   # d [N s/m²]
[[contact]]
position = 0.8
[[contact]]   # the second
position = 0.9   # x_c
clearance = 0.1
motion = { amplitude = 0.1, frequency = 2 }
[system]
K = [
  [1.0, 2.0],   # first
  [2.0, 3.0],
]
[master]
q = [0.1,
     0.2]  # start
[events]
)";

std::string with(const std::vector<SceneValue>& values) {
  return with_values(commented, values, "x.toml");
}

std::string replaced(const std::string& what, const std::string& by) {
  std::string expected = commented;
  const auto at = expected.find(what);
  EXPECT_NE(at, std::string::npos);
  return expected.replace(at, what.size(), by);
}

TEST(SceneText, OnlyTheNumbersChange) {
  EXPECT_EQ(with({}), commented);
  EXPECT_EQ(with({{"beam.damping", {0.25}}}), replaced("0.17 ", "0.25 "));
  EXPECT_EQ(with({{"contact.2.position", {0.95}}}), replaced("0.9 ", "0.95 "));
  EXPECT_EQ(with({{"system.K.2.1", {-7}}}), replaced("[2.0, 3.0]", "[-7, 3.0]"));
  EXPECT_EQ(with({{"contact.2.motion.frequency", {3}}}),
            replaced("frequency = 2", "frequency = 3"));
  EXPECT_EQ(with({{"master.q", {1, 2, 3}, true}}), replaced("[0.1,\n     0.2]", "[1, 2, 3]"));
}

TEST(SceneText, MissingKeysAreAdded) {
  EXPECT_EQ(with({{"contact.1.clearance", {0.5}}}),
            replaced("position = 0.8\n", "position = 0.8\nclearance = 0.5\n"));
  EXPECT_EQ(with({{"contact.2.motion.phase", {0.5}}}),
            replaced("frequency = 2 }", "frequency = 2, phase = 0.5 }"));
  EXPECT_EQ(with({{"beam.length", {2}}}), replaced("# d [N s/m²]\n", "# d [N s/m²]\nlength = 2\n"));
  EXPECT_EQ(with({{"events.jitter", {1e-4}}}),
            replaced("[events]\n", "[events]\njitter = 1e-04\n"));
  EXPECT_EQ(with({{"replica.q", {1}, true}, {"replica.u", {0}, true}}),
            std::string(commented) + "\n[replica]\nq = [1]\nu = [0]\n");
  EXPECT_THROW(with({{"contact.3.clearance", {1}}}), SceneError);
}

TEST(SceneText, ChangesManyKeysAtOnce) {
  const std::string edited = with({{"master.q", {5}, true},
                                   {"beam.damping", {1}},
                                   {"contact.2.clearance", {2}},
                                   {"contact.1.clearance", {3}},
                                   {"system.K.1.1", {4}}});
  EXPECT_EQ(number_of(edited, "beam.damping", 0.0, "x"), 1.0);
  EXPECT_EQ(number_of(edited, "contact.2.clearance", 0.0, "x"), 2.0);
  EXPECT_EQ(number_of(edited, "contact.1.clearance", 0.0, "x"), 3.0);
  EXPECT_EQ(number_of(edited, "system.K.1.1", 0.0, "x"), 4.0);
  EXPECT_EQ(number_of(edited, "master.q.1", 0.0, "x"), 5.0);
  EXPECT_EQ(number_of(edited, "master.q.2", -1.0, "x"), -1.0);
  EXPECT_TRUE(has_key(edited, "contact.1.clearance", "x"));
  EXPECT_FALSE(has_key(commented, "contact.1.clearance", "x"));
  EXPECT_NE(edited.find("# x_c"), std::string::npos);
}

TEST(SceneText, TableIsRemovedWithItsContent) {
  // The marked lines are removed.
  constexpr const char* text = R"(name = "x"
parameters.beam.damping = { sigma = 1 } # goes
 "parameters" . a = [ # goes
   1, # goes ]
] # goes
parametersx = """ [parameters]
"""
# before
[parameters] # goes
# goes
a = { sigma = 1 } # goes
b = [ # goes
[ "[", '[', ''], # goes
# goes [
] # goes

# goes
["parameters".c ] # goes
sigma = 2 # goes
[parametersx]
parameters = 2

[ parameters.d] # goes
# after

[beam]
parameters = 1
)";
  std::string left;
  for (std::string_view rest = text; !rest.empty();) {
    const std::string_view line = rest.substr(0, rest.find('\n') + 1);
    rest.remove_prefix(line.size());
    const bool blank_inside = line == "\n" && rest.starts_with("# goes");
    if (line.find("# goes") == std::string_view::npos && !blank_inside) left += line;
  }
  EXPECT_EQ(without_table(text, "parameters"), left);
  EXPECT_EQ(without_table(left, "events"), left);
  EXPECT_EQ(without_table("[a]\r\nb = 1\r\n[c]\r\nd = 2", "a"), "[c]\r\nd = 2");
  EXPECT_EQ(without_table("[c]\nd = 2\n[a]\nb = 1", "a"), "[c]\nd = 2\n");
  EXPECT_EQ(without_table("", "a"), "");
}

}  // namespace
}  // namespace sprag
