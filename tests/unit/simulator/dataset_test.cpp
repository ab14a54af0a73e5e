#include <gmock/gmock.h>
#include <unistd.h>

#include <cstdio>
#include <filesystem>
#include <fstream>
#include <iterator>

#include "dataset/dataset.hpp"
#include "simulator/builtin_line.hpp"
#include "simulator/dataset_writer.hpp"
#include "simulator/simulation.hpp"
#include "simulator/traffic.hpp"

namespace railfix::simulator {
namespace {

namespace fs = std::filesystem;

class Folder {
 public:
  explicit Folder(const std::string& name) : path(fs::temp_directory_path() / (name + std::to_string(::getpid()))) {
    fs::remove_all(path);
  }
  ~Folder() { fs::remove_all(path); }
  Folder(const Folder&) = delete;
  Folder& operator=(const Folder&) = delete;
  fs::path path;
};

SimulationOptions short_run(const fs::path& out) {
  SimulationOptions options;
  options.out = out;
  options.run.length_m = 30.0;
  options.rate_hz = 1.0;
  options.format = "pgm";
  options.threads = 2;
  options.render.camera = {144.0, 144.0, 79.5, 63.5, 0.0, 0.0, 0.0, 0.0, 160, 128};
  return options;
}

core::Result<SimulationReport> simulate_quietly(const SimulationOptions& options) {
  return simulate(options, [](size_t, size_t) {});
}

std::string bytes(const fs::path& file) {
  std::ifstream stream(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(stream), {}};
}

TEST(Dataset, IsCompleteAndReadsBack) {
  const Folder folder("railfix-sim-complete");
  const auto report = simulate_quietly(short_run(folder.path));
  ASSERT_TRUE(report.ok()) << report.error().message;
  auto pictures = dataset::open_pictures(folder.path, {});
  ASSERT_TRUE(pictures.ok()) << pictures.error().message;
  const auto truth = dataset::read_truth(folder.path / "truth/track.csv");
  ASSERT_TRUE(truth.ok()) << truth.error().message;
  EXPECT_EQ(truth.value().size(), report.value().pictures);
  for (const auto& row : truth.value()) {
    const auto picture = pictures.value()->next();
    ASSERT_TRUE(picture.ok() && picture.value());
    EXPECT_EQ(picture.value()->stamp_ns, row.stamp_ns);
    EXPECT_EQ(picture.value()->grey.cols, 160);
  }
  EXPECT_NEAR(truth.value().back().distance_m, 30.0, 0.6);
  EXPECT_NEAR(truth.value().front().heading_rad, 1.1, 1e-9);
  EXPECT_DOUBLE_EQ(truth.value().front().camera.height_m, 2.5);
  const auto sensors = dataset::read_sensors(folder.path);
  ASSERT_TRUE(sensors.ok()) << sensors.error().message;
  EXPECT_GT(sensors.value().imu.size(), 2000U);
  EXPECT_DOUBLE_EQ(sensors.value().pulses_per_metre, 50.0);
  EXPECT_GT(sensors.value().gnss.size(), 10U);
  const auto calibration = dataset::read_calibration(folder.path / "mav0/cam0/sensor.yaml");
  ASSERT_TRUE(calibration.ok()) << calibration.error().message;
  ASSERT_TRUE(calibration.value().mount);
  EXPECT_NEAR(calibration.value().mount->pitch_rad, 0.2094, 1e-9);
  const auto landmarks = dataset::read_truth_landmarks(folder.path / "truth/landmarks.csv");
  ASSERT_TRUE(landmarks.ok()) << landmarks.error().message;
  EXPECT_GT(landmarks.value().size(), 3U);
  EXPECT_TRUE(dataset::find_map(folder.path));
}

TEST(Dataset, MapRoundTrip) {
  const Folder folder("railfix-sim-map");
  fs::create_directories(folder.path);
  const auto map = builtin_line();
  ASSERT_TRUE(map.save(folder.path / "line.map").ok());
  const auto again = track::Map::load(folder.path / "line.map");
  ASSERT_TRUE(again.ok()) << again.error().message;
  ASSERT_EQ(again.value().edges.size(), 5U);
  EXPECT_EQ(again.value().balise_groups.size(), map.balise_groups.size());
  // The loop ends where the station track ends.
  const auto& station = map.edges[1].alignment;
  const auto& loop = map.edges[3].alignment;
  EXPECT_NEAR(station.at(station.length_m()).pose.easting_m, loop.at(loop.length_m()).pose.easting_m, 1e-6);
  EXPECT_NEAR(station.at(station.length_m()).pose.northing_m, loop.at(loop.length_m()).pose.northing_m, 1e-6);
}

TEST(Dataset, SameSeedSameBytesWithAnyThreads) {
  const Folder a("railfix-sim-a");
  const Folder b("railfix-sim-b");
  auto options = short_run(a.path);
  ASSERT_TRUE(simulate_quietly(options).ok());
  options.out = b.path;
  options.threads = 1;
  ASSERT_TRUE(simulate_quietly(options).ok());
  size_t compared = 0;
  for (const auto& entry : fs::recursive_directory_iterator(a.path)) {
    if (!entry.is_regular_file()) continue;
    const auto other = b.path / fs::relative(entry.path(), a.path);
    EXPECT_EQ(bytes(entry.path()), bytes(other)) << other;
    ++compared;
  }
  EXPECT_GT(compared, 20U);
}

// The row of a picture says what it shows, whatever its stamp says; lost pictures are in the truth only.
TEST(Dataset, LostPicturesAndWrongStampsAreToldByTheTruth) {
  const Folder folder("railfix-sim-lost");
  auto options = short_run(folder.path);
  options.rate_hz = 10.0;
  options.render.camera.width_px = 64;
  options.render.camera.height_px = 48;
  options.scenario.frames.drop_share = 0.2;
  options.scenario.frames.jitter_s = 0.01;
  options.scenario.frames.drop_when = "3..8 s";
  const auto report = simulate_quietly(options);
  ASSERT_TRUE(report.ok()) << report.error().message;
  const auto truth = core::value_or_throw(dataset::read_truth(folder.path / "truth/track.csv"));
  EXPECT_LT(report.value().pictures, truth.size());
  const auto pictures = core::value_or_throw(dataset::open_pictures(folder.path, {}));
  EXPECT_EQ(pictures->count(), report.value().pictures);
  std::ifstream stream(folder.path / "truth/visibility.csv");
  std::string line;
  std::getline(stream, line);
  EXPECT_EQ(line, "stamp_ns,exposed_ns,sequence,rails_visible,gain");
  size_t rows = 0;
  size_t off = 0;
  while (std::getline(stream, line)) {
    long long stamp_ns = 0;
    long long exposed_ns = 0;
    size_t sequence = 0;
    double visible = -1.0;
    ASSERT_EQ(std::sscanf(line.c_str(), "%lld,%lld,%zu,%lf", &stamp_ns, &exposed_ns, &sequence, &visible), 4) << line;
    ASSERT_LT(sequence, truth.size());
    EXPECT_EQ(truth[sequence].stamp_ns, stamp_ns);
    EXPECT_NEAR(static_cast<double>(exposed_ns), 1.7e18 + 1e8 * static_cast<double>(sequence), 1e3);
    EXPECT_TRUE(fs::exists(folder.path / "mav0/cam0/data" / picture_name(stamp_ns, "pgm")));
    EXPECT_GE(visible, 0.0);
    EXPECT_LE(visible, 1.0);
    off += stamp_ns != exposed_ns;
    ++rows;
  }
  EXPECT_EQ(rows, report.value().pictures);
  EXPECT_GT(off, rows / 2);
}

TEST(Traffic, MeetsTheRunOnTheTracksBesideIt) {
  const auto map = std::make_shared<const track::Map>(builtin_line());
  const auto on = [&](const char* start, double length_m) {
    RunOptions run;
    run.length_m = length_m;
    const auto line =
        std::make_shared<const Line>(Line::make(map, map->parse_position(start).value(), length_m).value());
    const Trajectory trajectory(line, run, {0.0, 0.2094, 0.0, 0.0, 2.5}, {}, 1);
    return plan_traffic(trajectory, 3, 1);
  };
  EXPECT_TRUE(on("1:100", 300.0).empty());
  const auto standing = on("2:20", 300.0);
  ASSERT_EQ(standing.size(), 3U);
  EXPECT_EQ(standing[0].edge, 4U);
  EXPECT_DOUBLE_EQ(standing[0].speed_mps, 0.0);
  const auto moving = on("3:1050", 700.0);
  ASSERT_EQ(moving.size(), 3U);
  EXPECT_LT(moving[0].speed_mps, 0.0);
  EXPECT_GT(moving[2].speed_mps, 0.0);
}

TEST(Dataset, RefusesWhatCannotBe) {
  const Folder folder("railfix-sim-refuse");
  auto options = short_run(folder.path);
  options.start = "3:2150";
  EXPECT_FALSE(simulate_quietly(options).ok());
  options.start = "nowhere:5";
  EXPECT_FALSE(simulate_quietly(options).ok());
  fs::create_directories(folder.path);
  std::ofstream(folder.path / "precious") << "x";
  options.start = "1:100";
  const auto report = simulate_quietly(options);
  ASSERT_FALSE(report.ok());
  EXPECT_THAT(report.error().message, testing::HasSubstr("not empty"));
}

TEST(Dataset, OfAWayThatIsNotRunIsRefusedBeforeAnythingIsWritten) {
  const Folder folder("railfix-sim-refused");
  auto options = short_run(folder.path);
  options.start = "1:100";
  options.via = {"loop"};
  EXPECT_THAT(simulate_quietly(options).error().message, testing::HasSubstr("--via loop"));
  options.via = {};
  options.run.stop_at_m = 40;
  EXPECT_THAT(simulate_quietly(options).error().message, testing::HasSubstr("--stop-at-m: the train runs 30 m only"));
  EXPECT_FALSE(fs::exists(folder.path));
}

}  // namespace
}  // namespace railfix::simulator
