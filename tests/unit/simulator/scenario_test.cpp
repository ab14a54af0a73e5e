// Scenario files, and what they do to time: brightness, lost pictures, wrong stamps.
#include "simulator/scenario.hpp"

#include <gmock/gmock.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <set>

#include "scene.hpp"
#include "simulator/simulator_config.hpp"

namespace railfix::simulator {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

Trajectory run(const std::string& start, double length_m) {
  RunOptions options;
  options.length_m = length_m;
  return {line_from(start), options, {0.0, 0.2094, 0.0, 0.0, 2.5}, {}, 7};
}

Scenario make(const ScenarioOptions& options) {
  return core::value_or_throw(Scenario::make(options, 1));
}

TEST(When, IsAStretchOfTimeOrWay) {
  const auto when = core::value_or_throw(When::parse("10..20 s, 300..450 m"));
  EXPECT_EQ(when.strength(15.0, 0.0), 1.0);
  EXPECT_EQ(when.strength(5.0, 0.0), 0.0);
  EXPECT_EQ(when.strength(5.0, 400.0), 1.0);
  EXPECT_EQ(when.strength(5.0, 455.0), 0.0);
  EXPECT_NEAR(when.strength(10.25, 0.0), 0.5, 1e-9);
  EXPECT_EQ(core::value_or_throw(When::parse("always")).strength(1e6, 1e6), 1.0);
  EXPECT_EQ(core::value_or_throw(When::parse("never")).strength(0.0, 0.0), 0.0);
}

TEST(When, RefusesWhatItCannotRead) {
  for (const char* text : {"", "sometimes", "10..20", "20..10 s", "10..20 km", "1..2 s 3..4 s"}) {
    const auto when = When::parse(text);
    EXPECT_FALSE(when.ok()) << text;
  }
  ScenarioOptions options;
  options.rain.when = "at noon";
  const auto scenario = Scenario::make(options, 1);
  ASSERT_FALSE(scenario.ok());
  EXPECT_THAT(scenario.error().message, HasSubstr("simulator.rain.when 'at noon'"));
}

TEST(ScenarioFiles, AllCanBeRead) {
  size_t count = 0;
  for (const auto& entry : fs::directory_iterator(fs::path(RAILFIX_SOURCE_DIR) / "deploy/scenarios")) {
    const auto config = service::read_config<SimulatorConfig>("simulator", entry.path());
    ASSERT_TRUE(config.ok()) << config.error().message;
    EXPECT_TRUE(Scenario::make(config.value().scenario, 1).ok()) << entry.path();
    ++count;
  }
  EXPECT_GE(count, 12U);
}

TEST(ScenarioFiles, TheDocumentedOneIsWhatTheProgramSays) {
  const fs::path file = fs::path(RAILFIX_SOURCE_DIR) / "services/simulator/simulator.yaml";
  std::ifstream stream(file);
  const std::string text{std::istreambuf_iterator<char>(stream), {}};
  EXPECT_EQ(text, service::document_config<SimulatorConfig>("simulator"))
      << "write it anew: railfix simulate --document > " << file;
}

TEST(Gain, FollowsTheTunnelLateAndInSteps) {
  const auto trajectory = run("3:700", 250.0);  // portal at 60 m, 150 m long
  ScenarioOptions options;
  options.exposure.wander = 0.0;
  double before_s = 0.0;  // 30 m before the portal, then deep inside
  double inside_s = 0.0;
  while (trajectory.motion(before_s).distance_m < 30.0) before_s += 0.01;
  while (trajectory.motion(inside_s).distance_m < 130.0) inside_s += 0.01;
  EXPECT_NEAR(make(options).gain(trajectory, before_s), 1.0, 1e-6);
  EXPECT_GT(make(options).gain(trajectory, inside_s), 3.0);
  double portal_s = before_s;
  while (trajectory.motion(portal_s).distance_m < 56.0) portal_s += 0.01;  // the meter looks 8 m ahead
  const double fast = make(options).gain(trajectory, portal_s);
  options.exposure.adapt_s = 1.0;
  EXPECT_LT(make(options).gain(trajectory, portal_s), fast);
  options.exposure.step = 0.25;
  std::set<double> levels;
  for (double t = before_s; t < inside_s; t += 0.02) levels.insert(make(options).gain(trajectory, t));
  EXPECT_GT(levels.size(), 2U);
  EXPECT_LT(levels.size(), 9U);
  for (const double level : levels) EXPECT_NEAR(std::remainder(std::log(level), 0.25), 0.0, 1e-9);
}

TEST(Frames, GetLostInRunsAndLeaveGaps) {
  const auto trajectory = run("1:100", 300.0);
  ScenarioOptions options;
  EXPECT_EQ(std::ssize(make(options).exposures(trajectory, 30.0)), std::floor(trajectory.duration_s() * 30.0) + 1);
  options.frames.drop_share = 0.2;
  options.frames.drop_run = 4;
  const auto exposures = make(options).exposures(trajectory, 30.0);
  EXPECT_FALSE(exposures.front().dropped);
  size_t dropped = 0;
  size_t run_length = 0;
  size_t shortest = 1000;
  for (const auto& exposure : exposures) {
    dropped += exposure.dropped;
    if (!exposure.dropped && run_length > 0) shortest = std::min(shortest, run_length);
    run_length = exposure.dropped ? run_length + 1 : 0;
  }
  EXPECT_NEAR(static_cast<double>(dropped) / static_cast<double>(exposures.size()), 0.18, 0.06);
  EXPECT_EQ(shortest, 4U);
  options.frames.drop_when = "5..6 s";
  for (const auto& exposure : make(options).exposures(trajectory, 30.0)) {
    const double t = 1e-9 * static_cast<double>(exposure.exposed_ns - trajectory.begin_ns());
    EXPECT_FALSE(exposure.dropped && (t < 5.0 || t > 6.2)) << t;
  }
}

TEST(Frames, StampsAreOffByTheJitterAndStayInOrder) {
  const auto trajectory = run("1:100", 300.0);
  ScenarioOptions options;
  for (const auto& exposure : make(options).exposures(trajectory, 30.0))
    EXPECT_EQ(exposure.stamp_ns, exposure.exposed_ns);
  options.frames.jitter_s = 0.001;
  double squares = 0.0;
  int64_t before_ns = 0;
  const auto exposures = make(options).exposures(trajectory, 60.0);
  for (const auto& exposure : exposures) {
    const double off_s = 1e-9 * static_cast<double>(exposure.stamp_ns - exposure.exposed_ns);
    squares += off_s * off_s;
    EXPECT_GT(exposure.stamp_ns, before_ns);
    before_ns = exposure.stamp_ns;
  }
  EXPECT_NEAR(std::sqrt(squares / static_cast<double>(exposures.size())), 0.001, 0.0002);
}

}  // namespace
}  // namespace railfix::simulator
