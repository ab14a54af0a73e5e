// Which track? Pictures of both legs of a switch through the real services over DDS, against the truth.
#include <gtest/gtest.h>

#include <map>

#include "core/csv.hpp"
#include "dataset/dataset.hpp"
#include "support/program.hpp"

namespace railfix {
namespace {

namespace fs = std::filesystem;

constexpr double kPatienceS = 240;
constexpr double kDeclared = 0.999;  // of track_probability
constexpr int64_t kStem = 1;
constexpr int64_t kStraight = 2;
constexpr int64_t kLoop = 4;
constexpr double kStartM = 1335;
constexpr double kStemM = 1380;  // the built-in line's first edge
constexpr double kFrogM = 29.3;  // behind the blades
constexpr double kPlaceM = 3;    // fusion's place may be off by so much at the blades

struct State {
  double behind_blades_m;  // truth
  int64_t edge;
  double probability;
};

class Switches : public ::testing::TestWithParam<int64_t> {
 protected:
  void SetUp() override {
    folder_ = fs::temp_directory_path() / ("railfix-switches-" + std::to_string(getpid()));
    std::vector<std::string> simulate{
        "railfix",     "simulate", "--out",     sequence(), "--start",        place(),   "--length-m",      "115",
        "--speed-kmh", "40",       "--dwell-s", "1",        "--size",         "640x512", "--rate-hz",       "10",
        "--format",    "jpg",      "--seed",    "23",       "--only-ahead-m", "40",      "--only-beside-m", "3"};
    if (GetParam() == kLoop) simulate.insert(simulate.end(), {"--via", "loop"});
    const auto simulated = test::run_program(simulate, kPatienceS);
    ASSERT_EQ(simulated.exit_code, 0) << simulated.err;
    const auto ran = test::run_program(
        {"railfix", "run", "--dataset", sequence(), "--start", place() + ":+", "--no-pictures", "--out", out()},
        kPatienceS);
    ASSERT_EQ(ran.exit_code, 0) << ran.err << ran.out;
  }
  void TearDown() override { fs::remove_all(folder_); }
  [[nodiscard]] std::string sequence() const { return (folder_ / "seq").string(); }
  [[nodiscard]] std::string out() const { return (folder_ / "out").string(); }
  static std::string place() { return "1:" + std::to_string(static_cast<int>(kStartM)); }

  [[nodiscard]] std::vector<State> states() const {
    std::map<int64_t, double> way_m;
    const auto truth = dataset::read_truth(fs::path(sequence()) / "truth" / "track.csv");
    EXPECT_TRUE(truth.ok());
    for (const auto& row : truth.value()) way_m[row.stamp_ns] = row.distance_m;
    auto reader = core::CsvReader::open(fs::path(out()) / "train_state.csv");
    EXPECT_TRUE(reader.ok());
    auto& csv = reader.value();
    std::vector<State> states;
    while (csv.next()) {
      const auto found = way_m.find(csv.integer(*csv.column({"stamp_ns"})).value());
      if (found == way_m.end()) continue;
      states.push_back({found->second + kStartM - kStemM, csv.integer(*csv.column({"edge"})).value(),
                        csv.number(*csv.column({"track_probability"})).value()});
    }
    return states;
  }

  fs::path folder_;
};

TEST_P(Switches, TheOwnLegIsDeclaredSoonAndNeverTheOther) {
  const auto all = states();
  ASSERT_GT(all.size(), 100U);
  size_t behind_frog = 0;
  for (const auto& state : all) {
    const bool declared = state.probability >= kDeclared;
    if (state.behind_blades_m < -kPlaceM) {
      EXPECT_EQ(state.edge, kStem) << state.behind_blades_m;
      EXPECT_TRUE(declared) << state.behind_blades_m;
    } else if (declared && state.edge != kStem) {
      EXPECT_EQ(state.edge, GetParam()) << "declared wrongly " << state.behind_blades_m << " m behind the blades";
    }
    if (state.behind_blades_m < kFrogM + 30) continue;
    EXPECT_EQ(state.edge, GetParam()) << state.behind_blades_m;
    EXPECT_TRUE(declared) << state.behind_blades_m << ": " << state.probability;
    ++behind_frog;
  }
  EXPECT_GT(behind_frog, 5U);
}

INSTANTIATE_TEST_SUITE_P(Legs, Switches, ::testing::Values(kStraight, kLoop),
                         [](const auto& leg) { return leg.param == kLoop ? "Diverging" : "Straight"; });

}  // namespace
}  // namespace railfix
