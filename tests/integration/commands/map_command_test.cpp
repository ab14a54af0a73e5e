// `railfix map` as scripts use it: what it refuses, in which words, and what it leaves as it was.
#include <gmock/gmock.h>

#include "support/program.hpp"
#include "unit/dataset/temporary_folder.hpp"
#include "unit/track/small_map.hpp"

namespace railfix {
namespace {

using ::testing::HasSubstr;
namespace fs = std::filesystem;

constexpr double kPatienceS = 30;

class MapCommand : public testing::TemporaryFolder {
 protected:
  void SetUp() override {
    TemporaryFolder::SetUp();
    map_ = root_ / "small.map";
    ASSERT_TRUE(track::small_map().save(map_).ok());
  }
  static test::Outcome map(std::vector<std::string> arguments) {
    arguments.insert(arguments.begin(), {"railfix", "map"});
    return test::run_program(arguments, kPatienceS);
  }
  /// One sentence and exit code 2.
  static void refuses(const std::vector<std::string>& arguments, const std::string& words) {
    const auto outcome = map(arguments);
    EXPECT_EQ(outcome.exit_code, 2) << outcome.out;
    EXPECT_THAT(outcome.err, HasSubstr(words));
    EXPECT_EQ(std::count(outcome.err.begin(), outcome.err.end(), '\n'), 1) << outcome.err;
  }
  std::string map_;
};

TEST_F(MapCommand, NeverWritesOverWhatItReads) {
  const auto before = test::slurp(map_);
  const auto link = root_ / "link.map";
  fs::create_symlink("small.map", link);
  refuses({"build", map_, "--out", link}, "which is read; give another name");
  refuses({"learn", map_, root_, "--out", map_}, "which is read; give another name");
  const auto drawn = write("drawn.svg", before).string();
  refuses({"draw", drawn, "--out", drawn}, "which is read; give another name");
  EXPECT_EQ(test::slurp(map_), before);
  EXPECT_EQ(test::slurp(drawn), before);
}

}  // namespace
}  // namespace railfix
