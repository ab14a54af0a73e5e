// `railfix map` as scripts use it: what it refuses, in which words, and what it leaves as it was.
#include "integration/commands/refusal.hpp"
#include "unit/dataset/temporary_folder.hpp"
#include "unit/track/small_map.hpp"

namespace railfix {
namespace {

using ::testing::HasSubstr;
namespace fs = std::filesystem;

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
  static void refuses(const std::vector<std::string>& arguments, const std::string& words) {
    expect_refusal(map(arguments), words);
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

TEST_F(MapCommand, SaysWhyAFileCannotBeRead) {
  const auto empty = write("empty.map", "").string();
  refuses({"info", empty}, "empty.map is empty; make it again");
  refuses({"info", root_}, "(Is a directory); is the path right?");
  refuses({"info", root_ / "none.map"}, "(No such file or directory); is the path right?");
  fs::create_directories(root_ / "folder.landxml");
  const std::string out = root_ / "out.map";
  refuses({"build", root_ / "folder.landxml", "--out", out}, "(Is a directory); is the path right?");
  refuses({"build", root_ / "none.osm", "--out", out}, "(No such file or directory); is the path right?");
  refuses({"draw", root_ / "folder.landxml", "--out", root_ / "out.svg"}, "(Is a directory); is the path right?");
}

TEST_F(MapCommand, RefusesValuesThatMeanNothing) {
  for (const char* command : {"info", "draw"}) {
    const auto refused = map({command, map_, "--out", root_ / "out.svg", "--at", ""});
    EXPECT_EQ(refused.exit_code, 2) << command << refused.out;
  }
  refuses({"info", map_, "--at", ""}, "is not a place on the map");
  refuses({"coverage", map_, "--sighted", "frog,pole"},
          "--sighted: 'pole' is no kind of landmark that the camera sights; give of frog, balise, portal_in, ");
  refuses({"coverage", map_, "--start", "1:0:-"}, "the track ends where the way begins");
  const auto seed = map({"make", "--seed", "-1", "--out", root_ / "made.map"});
  EXPECT_EQ(seed.exit_code, 2);
  EXPECT_THAT(seed.err, HasSubstr("--seed: -1 is not a whole number from 0 on"));
}

TEST_F(MapCommand, CoverageSaysHowMuchOfTheMapItLooksAt) {
  EXPECT_THAT(map({"coverage", map_}).out,
              HasSubstr("1.8 of the map's 2.3 km of track: from 1:0 over the straight way"));
  EXPECT_THAT(map({"coverage", "--help"}).out, HasSubstr("The rest of the map is not looked at"));
}

TEST(Help, IsAWordToo) {
  const auto same = [](const std::vector<std::string>& word, const std::vector<std::string>& flag) {
    const auto a = test::run_program(word, kPatienceS);
    EXPECT_EQ(a.exit_code, 0) << a.err;
    EXPECT_EQ(a.out, test::run_program(flag, kPatienceS).out);
    EXPECT_THAT(a.out, HasSubstr("Usage: railfix"));
  };
  same({"railfix", "help"}, {"railfix", "--help"});
  same({"railfix", "help", "map"}, {"railfix", "map", "--help"});
  same({"railfix", "help", "tpr", "decode"}, {"railfix", "tpr", "decode", "--help"});
  const auto unknown = test::run_program({"railfix", "help", "maps"}, kPatienceS);
  EXPECT_EQ(unknown.exit_code, 2);
  EXPECT_THAT(unknown.err, HasSubstr("there is no command 'maps'"));
}

TEST(Help, IsPointedToWhereACommandIsMissing) {
  for (const std::vector<std::string>& typed : {std::vector<std::string>{"railfix"}, {"railfix", "map"}}) {
    const auto ran = test::run_program(typed, kPatienceS);
    EXPECT_EQ(ran.exit_code, 2);
    EXPECT_THAT(ran.err, HasSubstr(typed.back() + " COMMAND --help explains each"));
  }
}

TEST(Help, OfACommandThatIsNotThereIsNoneOfTheOneAboveIt) {
  const auto ran = test::run_program({"railfix", "map", "check", "--help"}, kPatienceS);
  EXPECT_EQ(ran.exit_code, 2);
  EXPECT_EQ(ran.out, "");
  EXPECT_THAT(ran.err, HasSubstr("railfix map: there is no command 'check'; there are: build, info"));
}

TEST_F(MapCommand, LocateSaysSinceWhenOdometryWasOfUse) {
  // A row every 0.1 s; none from 20 s to 22 s.
  const auto located = [&](int blind_row) {
    std::string table = "stamp_ns,valid,distance_m,yaw_rate_rps\n";
    for (int row = 0; row < 300; ++row) {
      if (row >= 200 && row < 220) continue;
      table += std::to_string(row * 100'000'000LL) + (row == blind_row ? ",0," : ",1,") + std::to_string(row) + ",0\n";
    }
    write("run/odometry.csv", table);
    return map({"locate", map_, "--run", root_ / "run"}).out;
  };
  EXPECT_THAT(located(100), HasSubstr("since 1970-01-01T00:00:22.000Z, when odometry broke off last (2 in all)"));
  EXPECT_THAT(located(250), HasSubstr("since 1970-01-01T00:00:25.000Z, when odometry broke off last (2 in all)"));
}

}  // namespace
}  // namespace railfix
