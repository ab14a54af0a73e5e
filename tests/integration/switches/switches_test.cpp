// Which track? Pictures of both legs of a switch through the real services over DDS, against the truth.
#include <gtest/gtest.h>

#include <fstream>
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
constexpr double kForwardsM = 115;
constexpr double kLegM = 100;    // a train that backs goes so far behind the blades
constexpr double kStemM = 1380;  // the built-in line's first edge
constexpr double kFrogM = 29.3;  // behind the blades
constexpr double kPlaceM = 3;    // fusion's place may be off by so much at the blades

struct State {
  double behind_blades_m;  // truth
  int64_t edge;
  double probability;
};

struct Passage {
  int64_t leg;
  bool backs;  // the cab looks away from the legs, and only the camera tells how the train moves
};

class Switches : public ::testing::TestWithParam<Passage> {
 protected:
  void SetUp() override {
    folder_ = fs::temp_directory_path() / ("railfix-switches-" + std::to_string(getpid()));
    const bool backs = GetParam().backs;
    const std::string begin =
        backs ? std::to_string(GetParam().leg) + ":" + std::to_string(static_cast<int>(kLegM)) + ":-" : place();
    std::vector<std::string> simulate{"railfix",    "simulate", "--out",          sequence(), "--start",         begin,
                                      "--length-m", length(),   "--speed-kmh",    "40",       "--dwell-s",       "1",
                                      "--size",     "640x512",  "--rate-hz",      "10",       "--format",        "jpg",
                                      "--seed",     "23",       "--only-ahead-m", "40",       "--only-beside-m", "3"};
    if (GetParam().leg == kLoop && !backs) simulate.insert(simulate.end(), {"--via", "loop"});
    const auto simulated = test::run_program(simulate, kPatienceS);
    ASSERT_EQ(simulated.exit_code, 0) << simulated.err;
    read_truth();
    if (backs) play_backwards();
    std::vector<std::string> run{"railfix",       "run",     "--dataset",
                                 sequence(),      "--start", place() + (backs ? ":-" : ":+"),
                                 "--no-pictures", "--out",   out()};
    if (backs) run.emplace_back("--camera-only");
    const auto ran = test::run_program(run, kPatienceS);
    ASSERT_EQ(ran.exit_code, 0) << ran.err << ran.out;
  }
  static std::string length() {
    const double behind_m = kLegM + kStemM - kStartM;
    return std::to_string(static_cast<int>(GetParam().backs ? behind_m : kForwardsM));
  }
  void read_truth() {
    const auto truth = dataset::read_truth(fs::path(sequence()) / "truth" / "track.csv");
    ASSERT_TRUE(truth.ok());
    for (const auto& row : truth.value()) way_m_[row.stamp_ns] = row.distance_m;
  }
  /// Pictures in the order of a train that backs.
  void play_backwards() {
    const int64_t both_ns = way_m_.begin()->first + way_m_.rbegin()->first;
    const double length_m = way_m_.rbegin()->second;
    std::map<int64_t, double> way_m;
    for (const auto& [stamp_ns, forwards_m] : way_m_) way_m[both_ns - stamp_ns] = length_m - forwards_m;
    way_m_ = std::move(way_m);
    const fs::path list = fs::path(sequence()) / "mav0" / "cam0" / "data.csv";
    std::map<int64_t, std::string> pictures;
    {
      auto csv = core::value_or_throw(core::CsvReader::open(list));
      while (csv.next()) pictures[both_ns - csv.integer(0).value()] = csv.text(1);
    }
    std::ofstream out(list);
    out << "#timestamp [ns],filename\n";
    for (const auto& [stamp_ns, name] : pictures) out << stamp_ns << ',' << name << '\n';
  }
  void TearDown() override { fs::remove_all(folder_); }
  [[nodiscard]] std::string sequence() const { return (folder_ / "seq").string(); }
  [[nodiscard]] std::string out() const { return (folder_ / "out").string(); }
  static std::string place() { return "1:" + std::to_string(static_cast<int>(kStartM)); }

  [[nodiscard]] std::vector<State> states() const {
    auto reader = core::CsvReader::open(fs::path(out()) / "train_state.csv");
    EXPECT_TRUE(reader.ok());
    auto& csv = reader.value();
    std::vector<State> states;
    while (csv.next()) {
      const auto found = way_m_.find(csv.integer(*csv.column({"stamp_ns"})).value());
      if (found == way_m_.end()) continue;
      states.push_back({found->second + kStartM - kStemM, csv.integer(*csv.column({"edge"})).value(),
                        csv.number(*csv.column({"track_probability"})).value()});
    }
    return states;
  }

  fs::path folder_;
  std::map<int64_t, double> way_m_;  // by stamp, from the start of the run
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
      EXPECT_EQ(state.edge, GetParam().leg) << "declared wrongly " << state.behind_blades_m << " m behind the blades";
    }
    if (state.behind_blades_m < kFrogM + 30) continue;
    EXPECT_EQ(state.edge, GetParam().leg) << state.behind_blades_m;
    EXPECT_TRUE(declared) << state.behind_blades_m << ": " << state.probability;
    ++behind_frog;
  }
  EXPECT_GT(behind_frog, 5U);
}

INSTANTIATE_TEST_SUITE_P(Legs, Switches,
                         ::testing::Values(Passage{kStraight, false}, Passage{kLoop, false}, Passage{kStraight, true},
                                           Passage{kLoop, true}),
                         [](const auto& passage) {
                           return std::string(passage.param.backs ? "Backs" : "") +
                                  (passage.param.leg == kLoop ? "Diverging" : "Straight");
                         });

}  // namespace
}  // namespace railfix
