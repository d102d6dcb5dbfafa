// Would catch an output that overwrites another file of the command through an alias.
#include "command_line/named_files.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <vector>

#include "tests/support/temporary_directory.h"

namespace sprag {
namespace {

using enum NamedFile::Use;
using test::write_text;

class NamedFilesTest : public testing::Test {
 protected:
  static std::string clash(const std::filesystem::path& input,
                           const std::filesystem::path& output) {
    const std::vector<NamedFile> files{{"--replay", input, read}, {"--events", output, written}};
    return overwritten(files);
  }

  std::filesystem::path path(const std::string& name) const { return directory_ / name; }

  test::TemporaryDirectory directory_;
};

TEST_F(NamedFilesTest, DifferentFilesDoNotClash) {
  write_text(path("a"), "a");
  write_text(path("b"), "a");
  EXPECT_EQ(clash(path("a"), path("b")), "");
  EXPECT_EQ(clash(path("a"), path("absent")), "");
  EXPECT_EQ(clash(path("a"), ""), "");
  EXPECT_EQ(clash("", ""), "");
  EXPECT_EQ(overwritten({}), "");
}

TEST_F(NamedFilesTest, InputsMayBeTheSameFile) {
  const std::vector<NamedFile> files{{"--truth", write_text(path("a"), "a"), read},
                                     {"--estimate", path("a"), read}};
  EXPECT_EQ(overwritten(files), "");
}

TEST_F(NamedFilesTest, TheMessageNamesBothOptionsAndTheFile) {
  write_text(path("a"), "a");
  EXPECT_EQ(clash(path("a"), path("a")),
            "--replay and --events are the same file, " + path("a").string());
  std::filesystem::create_symlink("a", path("link"));
  EXPECT_EQ(clash(path("a"), path("link")), "--replay " + path("a").string() + " and --events " +
                                                path("link").string() + " are the same file");
}

TEST_F(NamedFilesTest, AliasesOfFileAreRecognized) {
  write_text(path("a"), "a");
  std::filesystem::create_directory(path("folder"));
  std::filesystem::create_directory_symlink("folder", path("other"));
  write_text(path("folder/b"), "b");
  std::filesystem::create_hard_link(path("a"), path("hard"));
  std::filesystem::create_symlink("hard", path("soft"));
  std::filesystem::create_symlink("soft", path("chain"));
  for (const char* name : {"hard", "soft", "chain", "./a", "folder/../a"}) {
    EXPECT_NE(clash(path("a"), path(name)), "") << name;
    EXPECT_NE(clash(path(name), path("a")), "") << name;
  }
  EXPECT_NE(clash(path("folder/b"), path("other/b")), "");
}

TEST_F(NamedFilesTest, AliasesOfFutureFileAreRecognized) {
  std::filesystem::create_directory(path("folder"));
  std::filesystem::create_directory_symlink("folder", path("other"));
  std::filesystem::create_symlink("folder/new", path("dangling"));
  std::filesystem::create_symlink(path("folder") / "new", path("absolute"));
  for (const char* name : {"folder/new", "other/new", "dangling", "absolute", "folder/./new"}) {
    EXPECT_NE(clash(path("folder/new"), path(name)), "") << name;
    EXPECT_NE(clash(path(name), path("folder/new")), "") << name;
  }
  const auto before = std::filesystem::current_path();
  std::filesystem::current_path(path("folder"));
  EXPECT_NE(clash("new", path("other/new")), "");
  std::filesystem::current_path(before);
  std::filesystem::create_symlink("round", path("round"));
  EXPECT_EQ(clash(path("a"), path("round")), "");
}

TEST_F(NamedFilesTest, NonRegularFileMayBeNamedTwice) {
  EXPECT_EQ(clash("/dev/null", "/dev/null"), "");
  const std::vector<NamedFile> outputs{{"--csv", "/dev/null", written},
                                       {"--report", "/dev/null", written}};
  EXPECT_EQ(overwritten(outputs), "");
}

}  // namespace
}  // namespace sprag
