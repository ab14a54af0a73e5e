// A whole train: the real service programs over DDS on a short simulated dataset, judged against its ground truth.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <map>
#include <nlohmann/json.hpp>
#include <set>

#include "core/csv.hpp"
#include "dataset/dataset.hpp"
#include "mcap/reader.hpp"
#include "messaging/topics.hpp"
#include "service/service.hpp"
#include "support/program.hpp"
#include "track/map.hpp"

namespace railfix {
namespace {

using ::testing::ContainsRegex;
using ::testing::HasSubstr;
namespace fs = std::filesystem;

constexpr double kSimulateS = 1200;
constexpr double kRunS = 600;

// One row of train_state.csv that matters here.
struct State {
  int64_t stamp_ns;
  double easting_m, northing_m, heading_rad, over_m, under_m;
  bool track_known;
};

class Train : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder_ = fs::temp_directory_path() / ("railfix-train-" + std::to_string(getpid()));
    simulated_ = simulate(sequence(), "72", "11");
    ran_ = test::run_program({"railfix", "run", "--dataset", sequence(), "--start", "1:250:+", "--out", out()}, kRunS);
  }
  static test::Outcome simulate(const std::string& sequence, const std::string& speed_kmh, const std::string& seed) {
    return test::run_program(
        {"railfix", "simulate", "--out", sequence, "--length-m", "450", "--speed-kmh", speed_kmh, "--size", "640x512",
         "--rate-hz", "30", "--format", "jpg", "--seed", seed, "--start", "1:250"},
        kSimulateS);
  }
  static void TearDownTestSuite() { fs::remove_all(folder_); }
  static std::string sequence() { return (folder_ / "seq").string(); }
  static std::string out() { return (folder_ / "out").string(); }
  void SetUp() override {
    ASSERT_EQ(simulated_.exit_code, 0) << simulated_.err;
    ASSERT_EQ(ran_.exit_code, 0) << ran_.err << ran_.out;
  }

  static std::vector<State> states() {
    auto reader = core::CsvReader::open(fs::path(out()) / "train_state.csv");
    EXPECT_TRUE(reader.ok());
    auto& csv = reader.value();
    const auto number = [&](const char* name) { return csv.number(*csv.column({name})).value(); };
    std::vector<State> states;
    while (csv.next()) {
      states.push_back({csv.integer(*csv.column({"stamp_ns"})).value(), number("easting_m"), number("northing_m"),
                        number("heading_rad"), number("over_m"), number("under_m"),
                        csv.text(*csv.column({"track_known"})) == "1"});
    }
    return states;
  }
  static size_t rows(const std::string& table) {
    auto reader = core::CsvReader::open(fs::path(out()) / table);
    EXPECT_TRUE(reader.ok()) << table;
    size_t count = 0;
    while (reader.value().next()) ++count;
    return count;
  }

  static fs::path folder_;
  static test::Outcome simulated_;
  static test::Outcome ran_;
};
fs::path Train::folder_;
test::Outcome Train::simulated_;
test::Outcome Train::ran_;

TEST_F(Train, EveryPictureWentThroughDetectorOdometryAndFusion) {
  const auto truth = dataset::read_truth(fs::path(sequence()) / "truth" / "track.csv");
  ASSERT_TRUE(truth.ok());
  const size_t pictures = dataset::open_pictures(sequence(), {}).value()->count().value();
  ASSERT_GT(pictures, 300U);
  EXPECT_EQ(rows("track_view.csv"), pictures);
  EXPECT_EQ(rows("odometry.csv"), pictures);
  EXPECT_EQ(rows("train_state.csv"), pictures);
}

TEST_F(Train, TheTrueTrainIsInsideTheConfidenceInterval) {
  const auto truth = dataset::read_truth(fs::path(sequence()) / "truth" / "track.csv").value();
  std::map<int64_t, const dataset::TruthRow*> by_stamp;
  for (const auto& row : truth) by_stamp[row.stamp_ns] = &row;
  size_t compared = 0;
  double worst_m = 0;
  for (const auto& state : states()) {
    if (!state.track_known) continue;
    const auto found = by_stamp.lower_bound(state.stamp_ns);
    if (found == by_stamp.end() || found->first != state.stamp_ns) continue;
    const auto& true_row = *found->second;
    // Heading is clockwise from north: forward is (sin, cos) in (east, north).
    const double ahead_m = (true_row.easting_m - state.easting_m) * std::sin(state.heading_rad) +
                           (true_row.northing_m - state.northing_m) * std::cos(state.heading_rad);
    ASSERT_LE(ahead_m, state.under_m) << "at " << state.stamp_ns;
    ASSERT_GE(ahead_m, -state.over_m) << "at " << state.stamp_ns;
    worst_m = std::max(worst_m, std::abs(ahead_m));
    ++compared;
  }
  EXPECT_GT(compared, 300U);
  EXPECT_LT(worst_m, 2.0);
}

// Also when it learns for a next trip.
TEST_F(Train, ASecondRunGivesTheSameTablesByteForByte) {
  const std::string again = (folder_ / "again").string();
  const fs::path state = folder_ / "state";
  const auto ran = test::run_program({"railfix", "run", "--dataset", sequence(), "--start", "1:250:+", "--no-pictures",
                                      "--state", state.string(), "--out", again},
                                     kRunS);
  ASSERT_EQ(ran.exit_code, 0) << ran.err << ran.out;
  size_t compared = 0;
  for (const auto& file : fs::directory_iterator(out())) {
    const std::string name = file.path().filename().string();
    if (file.path().extension() != ".csv" || name == "status.csv") continue;  // the services' health: host times
    EXPECT_TRUE(test::slurp(file.path()) == test::slurp(fs::path(again) / name)) << name << " differs";
    ++compared;
  }
  EXPECT_GE(compared, 5U);
  EXPECT_THAT(test::slurp(state / "scales.yaml"), HasSubstr("camera_id: cam0=640x512,"));
}

TEST_F(Train, ReportsAreValidMessages136) {
  auto reader = core::CsvReader::open(fs::path(out()) / "tpr.csv");
  ASSERT_TRUE(reader.ok());
  auto& csv = reader.value();
  size_t reports = 0;
  bool with_group = false;
  while (csv.next()) {
    const std::string hex(csv.text(*csv.column({"hex"})));
    const auto decoded = test::run_program({"railfix", "tpr", "decode", hex, "--json"}, 10);
    ASSERT_EQ(decoded.exit_code, 0) << hex << ": " << decoded.err;
    const auto fields = nlohmann::json::parse(decoded.out);
    EXPECT_EQ(fields["NID_MESSAGE"], 136);
    EXPECT_EQ(fields["L_MESSAGE"], hex.size() / 2);
    with_group = with_group || csv.integer(*csv.column({"nid_lrbg"})).value() != 16777215;
    ++reports;
  }
  // 25 s of running with a report every 6 s, and events.
  EXPECT_GE(reports, 4U);
  EXPECT_TRUE(with_group) << "no report refers to a balise group";
}

// The recording's reports beside those of the tables, which are the same, and both beside the truth.
TEST_F(Train, ReportsAreComparedWithTheTruth) {
  const auto map = dataset::find_map(sequence());
  ASSERT_TRUE(map.has_value());
  const auto compared =
      test::run_program({"railfix", "tpr", "compare", "--ours", out() + "/recording.mcap", "--certified", out(),
                         "--map", map->string(), "--start", "1:250:+", "--truth", sequence() + "/truth"},
                        60);
  ASSERT_EQ(compared.exit_code, 0) << compared.err;
  EXPECT_THAT(compared.out, HasSubstr("mean +0.00 m, |.| p50 0.00, p95 0.00, max 0.00 m"));
  double mean_m = 0;
  double p95_m = 0;
  double max_m = 0;
  const auto row = compared.out.find("error, size");
  ASSERT_NE(row, std::string::npos) << compared.out;
  ASSERT_EQ(std::sscanf(compared.out.c_str() + row, "error, size %lf %lf %lf", &mean_m, &p95_m, &max_m), 3);
  EXPECT_LT(max_m, 2.0);
  EXPECT_THAT(compared.out, ContainsRegex("outside the interval     ours on 0 of [1-9][0-9]*, certified on 0 of"));
}

// `railfix map learn` on the tables of two rides, for a map that has forgotten all but its frogs. A copy of one is no
// second one.
TEST_F(Train, MapLearnFindsTheLandmarksAgain) {
  const auto file = dataset::find_map(sequence());
  ASSERT_TRUE(file.has_value());
  const auto truth = core::value_or_throw(track::Map::load(*file));
  auto poor = truth;
  std::erase_if(poor.landmarks, [](const auto& mark) { return mark.kind != track::LandmarkKind::frog; });
  for (size_t i = 0; i < poor.landmarks.size(); ++i) poor.landmarks[i].id = static_cast<uint32_t>(i + 1);
  poor.balise_groups.clear();
  const auto poor_file = (folder_ / "poor.map").string();
  const auto learned_file = (folder_ / "learned.map").string();
  core::ok_or_throw(poor.save(poor_file));
  const auto learn = [&](const std::string& from, const fs::path& second, const std::string& to) {
    return test::run_program({"railfix", "map", "learn", from, out(), second.string(), "--out", to}, 60);
  };
  const auto copy = folder_ / "copy";
  fs::copy(out(), copy, fs::copy_options::recursive);
  const auto refused = learn(poor_file, copy, learned_file);
  EXPECT_EQ(refused.exit_code, 2);
  EXPECT_THAT(refused.err, HasSubstr("is the same run as"));
  const auto again = folder_ / "second_ride";
  const auto second = folder_ / "second";
  const auto simulated = simulate(again.string(), "90", "12");
  ASSERT_EQ(simulated.exit_code, 0) << simulated.err;
  const auto ran = test::run_program(
      {"railfix", "run", "--dataset", again.string(), "--start", "1:250:+", "--out", second.string()}, kRunS);
  ASSERT_EQ(ran.exit_code, 0) << ran.err;
  const auto learned = learn(poor_file, second, learned_file);
  ASSERT_EQ(learned.exit_code, 0) << learned.err;
  EXPECT_THAT(learn(learned_file, second, (folder_ / "twice.map").string()).err, HasSubstr("has learnt from"));
  const auto map = core::value_or_throw(track::Map::load(learned_file));
  EXPECT_GE(map.landmarks.size(), poor.landmarks.size() + 3) << learned.out;
  for (size_t i = poor.landmarks.size(); i < map.landmarks.size(); ++i) {
    const auto& mark = map.landmarks[i];
    double error_m = HUGE_VAL;
    for (const auto& real : truth.landmarks) {
      if (real.kind == mark.kind && real.edge == mark.edge)
        error_m = std::min(error_m, std::abs(real.offset_m - mark.offset_m));
    }
    EXPECT_LT(error_m, 4 * mark.sigma_m) << track::to_string(mark.kind) << " at " << mark.offset_m;
    EXPECT_LT(mark.sigma_m, 1.5)  // GNSS alone: a quarter of the promised interval
        << track::to_string(mark.kind) << " at " << mark.offset_m;
  }
}

TEST_F(Train, TheRecordingHoldsEveryTopic) {
  auto recording = mcap::Reader::open(fs::path(out()) / "recording.mcap");
  ASSERT_TRUE(recording.ok()) << recording.error().message;
  std::set<std::string> recorded;
  for (const auto& [id, channel] : recording.value()->channels())
    recorded.insert(channel.topic.substr(0, channel.topic.find('/')));
  for (const auto& topic : messaging::all_topics()) {
    if (topic.name == "position_fix" || topic.name == "log_record") continue;  // events: may not happen in a short run
    if (topic.name == "onboard_status") continue;                              // nothing of ours writes it
    if (topic.name == "player_status") continue;                               // nobody plays to this train
    EXPECT_TRUE(recorded.contains(topic.name)) << topic.name;
  }
}

TEST_F(Train, NothingWasDropped) {
  auto reader = core::CsvReader::open(fs::path(out()) / "status.csv");
  ASSERT_TRUE(reader.ok());
  auto& csv = reader.value();
  std::set<std::string> services;
  while (csv.next()) {
    services.emplace(csv.text(*csv.column({"service"})));
    EXPECT_EQ(csv.integer(*csv.column({"dropped"})).value(), 0) << csv.text(*csv.column({"service"}));
  }
  EXPECT_THAT(services, ::testing::UnorderedElementsAreArray(service::service_names()));
}

TEST(TrainRefuses, WhatItCannotRunWithOneSentence) {
  const auto missing =
      test::run_program({"railfix", "run", "--dataset", "/no/such/dataset", "--out", "/tmp/railfix-never"}, 20);
  EXPECT_EQ(missing.exit_code, 2);
  EXPECT_THAT(missing.err, HasSubstr("/no/such/dataset"));
  EXPECT_FALSE(fs::exists("/tmp/railfix-never"));
}

}  // namespace
}  // namespace railfix
