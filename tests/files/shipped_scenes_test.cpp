// Scenes are found by name in the program's own installation, and only there.
#include "sprag/detail/files/shipped_scenes.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

#include "tests/support/temporary_directory.h"

namespace sprag {
namespace {

using std::filesystem::path;

class ShippedScenesTest : public testing::Test {
 protected:
  ShippedScenesTest() {
    for (const char* name : {"paper_beam", "stiff_beam", "ball"})
      write(scenes_ / (std::string(name) + ".toml"));
    write(scenes_ / "studies" / "jitter.toml");
    std::filesystem::create_directories(work_);
    before_ = std::filesystem::current_path();
    std::filesystem::current_path(work_);
  }
  ~ShippedScenesTest() override { std::filesystem::current_path(before_); }

  static void write(const path& file) {
    std::filesystem::create_directories(file.parent_path());
    std::ofstream(file) << "# text\n";
  }

  test::TemporaryDirectory directory_;
  path prefix_ = std::filesystem::canonical(directory_ / "") / "prefix";
  path scenes_ = prefix_ / "share" / "sprag" / "scenes";
  path work_ = directory_ / "work";
  path before_;
};

TEST_F(ShippedScenesTest, FolderIsNearestAboveTheProgram) {
  EXPECT_EQ(shipped_scenes(prefix_ / "libexec" / "sprag" / "observer"), scenes_);
  EXPECT_EQ(shipped_scenes(prefix_ / "bin" / "sprag"), scenes_);
  const path inner = prefix_ / "inner" / "share" / "sprag" / "scenes";
  std::filesystem::create_directories(inner);
  EXPECT_EQ(shipped_scenes(prefix_ / "inner" / "lib" / "python3" / "x.so"), inner);
  EXPECT_EQ(shipped_scenes(work_ / "observer"), path());
  EXPECT_EQ(shipped_scenes(path()), path());
}

TEST_F(ShippedScenesTest, LinksAreResolved) {
  std::filesystem::create_symlink(prefix_, work_ / "link");
  EXPECT_EQ(shipped_scenes(work_ / "link" / "bin" / "sprag"), scenes_);
  const path other = work_ / "build" / "share" / "sprag";
  std::filesystem::create_directories(other);
  std::filesystem::create_directory_symlink(scenes_, other / "scenes");
  EXPECT_EQ(shipped_scenes(work_ / "build" / "tools" / "plot"), scenes_);
}

TEST_F(ShippedScenesTest, NamesAreFoundWithAndWithoutTheirEnding) {
  EXPECT_EQ(find_scene("paper_beam", scenes_), scenes_ / "paper_beam.toml");
  EXPECT_EQ(find_scene("paper_beam.toml", scenes_), scenes_ / "paper_beam.toml");
  EXPECT_EQ(find_scene("jitter", scenes_ / "studies"), scenes_ / "studies" / "jitter.toml");
  for (const char* other : {"jitter", "paper", "", ".", "..", ".toml", "studies", "paper_beam.csv",
                            "./paper_beam", "scenes/paper_beam.toml", "../paper_beam"}) {
    EXPECT_EQ(find_scene(other, scenes_), path(other));
    EXPECT_EQ(shipped_file(other, scenes_), path());
  }
  EXPECT_EQ(find_scene("paper_beam", path()), "paper_beam");
}

TEST_F(ShippedScenesTest, FileTakesPrecedenceAndFolderDoesNot) {
  std::filesystem::create_directories("paper_beam");
  EXPECT_EQ(find_scene("paper_beam", scenes_), scenes_ / "paper_beam.toml");
  write(work_ / "paper_beam.toml");
  EXPECT_EQ(find_scene("paper_beam.toml", scenes_), "paper_beam.toml");
  EXPECT_EQ(find_scene("paper_beam", scenes_), scenes_ / "paper_beam.toml");
  write(work_ / "ball");
  EXPECT_EQ(find_scene("ball", scenes_), "ball");
  EXPECT_EQ(scene_not_found("ball", scenes_), "");
  EXPECT_EQ(find_scene("/dev/null", scenes_), "/dev/null");
}

TEST_F(ShippedScenesTest, MessageNamesFolderAndNearestName) {
  EXPECT_EQ(
      scene_not_found("paper_baem", scenes_),
      "no such file, and none of this name in " + scenes_.string() + "; did you mean paper_beam?");
  EXPECT_EQ(scene_not_found("beam.toml", scenes_), "no such file, and none of this name in " +
                                                       scenes_.string() +
                                                       "; did you mean paper_beam or stiff_beam?");
  EXPECT_EQ(scene_not_found("unlike_any", scenes_), "no such file, and none of this name in " +
                                                        scenes_.string() +
                                                        "; choose ball, paper_beam or stiff_beam");
  EXPECT_NE(scene_not_found("paper_beam", path()).find("not installed"), std::string::npos);
  EXPECT_EQ(scene_not_found("scenes/paper_baem.toml", scenes_), "");
}

}  // namespace
}  // namespace sprag
