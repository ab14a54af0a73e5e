// `railfix tpr compare` on rides where one side looks better than it is: stamps that are late, reports between the
// certified ones, legs that promise nothing, reports held for long, a train that stands.
#include <gmock/gmock.h>

#include <cmath>
#include <filesystem>
#include <functional>

#include "core/random.hpp"
#include "core/time.hpp"
#include "core/units.hpp"
#include "etcs/train_position_report.hpp"
#include "support/program.hpp"
#include "track/map.hpp"

namespace railfix::compare_fairness_test {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

constexpr double kPatienceS = 60;
constexpr double kFirstStampS = 1000;
constexpr double kSpacingM = 1000;
constexpr int kLegs = 130;

/// One group every kilometre, also of the track beside it: those have numbers from kBeside on. The two are joined at
/// the beginning.
constexpr uint32_t kBeside = 9000;
track::Map long_line(bool joined) {
  track::Map map;
  const double length_m = (kLegs + 10) * kSpacingM;
  const auto straight = [&](double northing_m) {
    return track::Alignment::chained({0, northing_m, core::kPi / 2}, {{length_m, 0, 0}});
  };
  map.edges = {{1, "main", 1, 2, "", straight(0)}, {2, "beside", joined ? 1U : 3U, 4, "", straight(joined ? 0 : 4)}};
  map.nodes = {{1, track::NodeKind::end, "", 0, 0},
               {2, track::NodeKind::end, "", length_m, 0},
               {3, track::NodeKind::end, "", 0, 4},
               {4, track::NodeKind::end, "", length_m, 4}};
  if (joined) {
    map.edges.push_back({3, "stem", 3, 1, "", track::Alignment::chained({-100, 0, core::kPi / 2}, {{100, 0, 0}})});
    map.nodes[0].kind = track::NodeKind::railway_switch;
    map.nodes[2].easting_m = -100;
    map.connections = {{1, 3, 1, false}, {1, 3, 2, true}};
  }
  for (uint32_t i = 1; i * kSpacingM < length_m; ++i)
    for (const uint32_t edge : {1U, 2U})
      map.balise_groups.push_back({85, edge == 1 ? i : kBeside + i, edge, i * kSpacingM, true, true, 1, {}});
  return map;
}

/// Edge 1, and a loop of 900 m beside it at each kilometre n with n % 5 == 3, from 50 m before its group on.
track::Map loops() {
  track::Map map;
  const auto straight = [](double from_m, double length_m) {
    return track::Alignment::chained({from_m, 0, core::kPi / 2}, {{length_m, 0, 0}});
  };
  const auto add_node = [&](double at_m) {
    map.nodes.push_back({static_cast<uint32_t>(map.nodes.size() + 1), track::NodeKind::railway_switch, "", at_m, 0});
  };
  const auto add_edge = [&](double from_m, double length_m, uint32_t from, uint32_t to) {
    const auto id = static_cast<uint32_t>(map.edges.size() + 1);
    map.edges.push_back({id, "e" + std::to_string(id), from, to, "", straight(from_m, length_m)});
    return id;
  };
  add_node(0);
  double from_m = 0;
  uint32_t before = 0;  // edges that end here
  uint32_t loop_before = 0;
  for (uint32_t k = 3; k <= kLegs; k += 5) {
    const double switch_m = k * kSpacingM - 50;
    const auto node = static_cast<uint32_t>(map.nodes.size());
    add_node(switch_m);
    add_node(switch_m + 900);
    const auto plain = add_edge(from_m, switch_m - from_m, node, node + 1);
    for (uint32_t i = static_cast<uint32_t>(from_m / kSpacingM) + 1; i < k; ++i)
      map.balise_groups.push_back({85, i, plain, i * kSpacingM - from_m, true, true, 1, {}});
    if (before != 0) map.connections.push_back({node, before, plain, false});
    if (loop_before != 0) map.connections.push_back({node, loop_before, plain, true});
    before = add_edge(switch_m, 900, node + 1, node + 2);
    loop_before = add_edge(switch_m, 900, node + 1, node + 2);
    map.balise_groups.push_back({85, k, before, 50, true, true, 1, {}});
    map.balise_groups.push_back({85, kBeside + k, loop_before, 50, true, true, 1, {}});
    map.connections.push_back({node + 1, plain, before, false});
    map.connections.push_back({node + 1, plain, loop_before, true});
    from_m = switch_m + 900;
  }
  return map;
}

uint32_t group_at(double place_m) {
  return static_cast<uint32_t>(place_m / kSpacingM);
}

/// A line of a table; `doubt_m` below 0 is not known.
std::string line_from(uint32_t group, double stamp_s, double since_m, double doubt_m, double speed_mps) {
  etcs::TrainPositionReport report;
  report.nid_lrbg = 85U << 14U | group;
  report.q_scale = 0;
  report.d_lrbg = static_cast<uint32_t>(std::lround(since_m * 10));
  report.q_dirlrbg = report.q_dlrbg = report.q_dirtrain = etcs::kNominal;
  report.l_doubtover = report.l_doubtunder =
      doubt_m < 0 ? uint32_t{etcs::kUnknownDistance} : static_cast<uint32_t>(std::lround(doubt_m * 10));
  report.v_train = static_cast<uint32_t>(std::lround(speed_mps * 3.6 / etcs::kSpeedStepKmh));
  return std::to_string(core::to_ns(kFirstStampS + stamp_s)) + ',' +
         etcs::to_hex(core::value_or_throw(etcs::encode(report, etcs::Baseline::b3))) + '\n';
}

std::string line(double stamp_s, double front_m, double doubt_m, double speed_mps, uint32_t group_number_more = 0) {
  const uint32_t group = group_at(front_m);
  return line_from(group + group_number_more, stamp_s, front_m - group * kSpacingM, doubt_m, speed_mps);
}

// From 20 to 40 m/s and back in ten minutes, from 1 km of the line on.
constexpr double kMiddleMps = 30;
constexpr double kSwingMps = 10;
constexpr double kSwingS = 97;

double speed_mps(double run_s) {
  return kMiddleMps + kSwingMps * std::sin(run_s / kSwingS);
}
double way_m(double run_s) {
  return kMiddleMps * run_s + kSwingMps * kSwingS * (1 - std::cos(run_s / kSwingS));
}
double run_s() {
  return (kLegs - 1) * kSpacingM / kMiddleMps;
}

class TprCompareFairness : public ::testing::Test {
 protected:
  TprCompareFairness() {
    std::filesystem::create_directories(folder_ / "truth");
    write_map(long_line(true));
  }
  ~TprCompareFairness() override { std::filesystem::remove_all(folder_); }

  void write_map(const track::Map& map) const { core::ok_or_throw(map.save(folder_ / "line.map")); }
  /// Lines of the table.
  void write(const std::string& name, const std::string& lines) const {
    std::ofstream(folder_ / name) << "stamp_ns,hex\n" << lines;
  }
  void write_truth(const std::function<double(double)>& way_m, double length_s) const {
    std::ofstream truth(folder_ / "truth" / "track.csv");
    truth << "timestamp,distance\n";
    for (double t = 0; t < length_s; t += 0.5)
      truth << core::to_ns(kFirstStampS + t) << ',' << std::to_string(way_m(t)) << '\n';
  }
  [[nodiscard]] std::string said(const std::vector<std::string>& more = {},
                                 const std::string& start = "1:1000:+") const {
    std::vector<std::string> arguments{"--map",   (folder_ / "line.map").string(), "--start", start,
                                       "--truth", (folder_ / "truth").string()};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return said_without_map(arguments);
  }
  [[nodiscard]] std::string said_without_map(const std::vector<std::string>& more = {}) const {
    const auto file = [&](const char* name) { return (folder_ / name).string(); };
    std::vector<std::string> arguments{
        "railfix", "tpr", "compare", "--ours", file("ours.csv"), "--certified", file("certified.csv")};
    arguments.insert(arguments.end(), more.begin(), more.end());
    const auto outcome = test::run_program(arguments, kPatienceS);
    return outcome.out + outcome.err;
  }

 private:
  std::filesystem::path folder_ =
      std::filesystem::temp_directory_path() / ("tpr-compare-fairness-" + std::to_string(getpid()));
};

/// Errors that stay the same on each leg, and reports every `every_s`.
std::string wavy_ride(double every_s, double sigma_m, double doubt_m, uint64_t seed, double late_s = 0) {
  core::Random random(seed);
  std::string lines;
  double error_m = 0;
  uint32_t group = 0;
  for (double t = 5; t < run_s(); t += every_s) {
    const double place_m = kSpacingM + way_m(t);
    if (group_at(place_m) != group) error_m = random.normal(0, sigma_m);
    group = group_at(place_m);
    const double front_m = std::max(place_m + error_m, group * kSpacingM);
    lines += line(t + late_s, std::min(front_m, (group + 1) * kSpacingM - 0.1), doubt_m, speed_mps(t));
  }
  return lines;
}

// Ours is three times worse, and the certified system's stamps are half a second late.
TEST_F(TprCompareFairness, LateStampsMakeNobodyAsGood) {
  write_truth(way_m, run_s());
  write("ours.csv", wavy_ride(5, 3, 14, 1));
  write("certified.csv", wavy_ride(5, 1, 15, 2, 0.5));
  auto text = said();
  EXPECT_THAT(text, HasSubstr("not shown; stamps are off"));
  EXPECT_THAT(text, HasSubstr("the stamps of the certified system are off by 0.475 s; say --offset-s -0.475"));
  EXPECT_THAT(said({"--offset-s", "-0.5"}), HasSubstr("verdict                  WORSE"));
  // Ours as good, and the stamps right: what is left of the shift is chance or small.
  write("ours.csv", wavy_ride(5, 0.5, 5, 1));
  EXPECT_THAT(said({"--offset-s", "-0.5"}), HasSubstr("verdict                  at least as good"));
}

// Every second, with a true place in the interval only when the certified system reports, too.
TEST_F(TprCompareFairness, APromiseNeedsNoPartner) {
  write_truth(way_m, run_s());
  std::string ours;
  for (int t = 5; t < run_s(); ++t) {
    const double front_m = kSpacingM + way_m(t) + (t % 10 == 5 ? 0 : 40);
    ours += line(t, front_m, 5, speed_mps(t));
  }
  write("ours.csv", ours);
  write("certified.csv", wavy_ride(10, 1, 15, 2));
  const auto text = said();
  EXPECT_THAT(text, HasSubstr("error, size                   0.0"));
  EXPECT_THAT(text, HasSubstr("outside the interval     ours on 1"));
  EXPECT_THAT(text, HasSubstr("verdict                  WORSE"));
}

// The interval is known on every sixth leg.
TEST_F(TprCompareFairness, ALegWithoutAnyIntervalKeepsNoPromise) {
  write_truth(way_m, run_s());
  std::string lines;
  for (double t = 5; t < run_s(); t += 5) {
    const double front_m = kSpacingM + way_m(t);
    lines += line(t, front_m, group_at(front_m) % 6 == 0 ? 5 : -1, speed_mps(t));
  }
  write("ours.csv", lines);
  write("certified.csv", lines);
  EXPECT_THAT(said(),
              HasSubstr("outside the interval     ours on 0 of 21, certified on 0 of 21 legs; ours at most 0.13"));
}

/// 5 % of the way since the group as doubt and 2 % as error, at 30 m/s; a report behind each group, then every so
/// often.
std::string odometer(double every_s, uint64_t seed) {
  core::Random random(seed);
  std::string lines;
  double scale = 0;
  uint32_t group = 0;
  double last_s = 0;
  for (double t = 5; t < run_s(); t += 0.5) {
    const double place_m = kSpacingM + kMiddleMps * t;
    const bool new_group = group_at(place_m) != group;
    group = group_at(place_m);
    if (new_group) scale = std::clamp(random.normal(0, 0.01), -0.02, 0.02);
    if (!new_group && t - last_s < every_s) continue;
    last_s = t;
    const double since_m = place_m - group * kSpacingM;
    lines +=
        line(t, std::min(place_m + scale * since_m, (group + 1) * kSpacingM - 0.1), 1 + 0.05 * since_m, kMiddleMps);
  }
  return lines;
}

TEST_F(TprCompareFairness, WhatIsHeldForLongIsNotShown) {
  write_truth([](double t) { return kMiddleMps * t; }, run_s());
  write("ours.csv", odometer(12, 1));
  write("certified.csv", odometer(1, 1));
  auto text = said();
  EXPECT_THAT(text, HasSubstr("not shown; ours reports too seldom"));
  EXPECT_THAT(
      text,
      HasSubstr("ours reports every 11.3 s, the certified system every 0.995 s; let both run on the same packet 58"));
  EXPECT_THAT(text, HasSubstr("the speed hardly changes, stamps that are off would not be seen"));
  // The other way round nothing is gained: the same intervals are not shorter.
  write("ours.csv", odometer(1, 1));
  write("certified.csv", odometer(12, 1));
  text = said();
  EXPECT_THAT(text, Not(HasSubstr("packet 58")));
  EXPECT_THAT(text, HasSubstr("interval length, mean    ratio 1."));
  write("certified.csv", odometer(1, 1));
  EXPECT_THAT(said(), HasSubstr("ratio 1.000 (0.955 to 1.047), 4338 pairs in 129 legs: at least as good"));
}

// Ours is three times worse on the way and better while the train stands for ten minutes.
TEST_F(TprCompareFairness, AStandstillCountsOnce) {
  constexpr int kRunS = 48;
  constexpr int kStandS = 600;
  const auto way_m = [](double t) {
    const int leg = static_cast<int>(t / (kRunS + kStandS));
    return kSpacingM * leg + 20 * std::min(t - leg * (kRunS + kStandS), double{kRunS});
  };
  core::Random random(3);
  std::string ours;
  std::string certified;
  constexpr int kStops = 70;
  for (int t = 0; t < kStops * (kRunS + kStandS); t += 6) {
    const bool runs = t % (kRunS + kStandS) < kRunS;
    const double place_m = kSpacingM + 10 + way_m(t);
    ours += line(t, place_m + (runs ? random.normal(0, 1.5) : 0.2), runs ? 9 : 2, runs ? 20 : 0);
    certified += line(t, place_m + (runs ? random.normal(0, 0.5) : 1), 3, runs ? 20 : 0);
  }
  write("ours.csv", ours);
  write("certified.csv", certified);
  write_truth([&](double t) { return 10 + way_m(t); }, kStops * (kRunS + kStandS));
  const auto text = said({}, "1:1010:+");
  EXPECT_THAT(text, HasSubstr("repeats at standstill    6860 of 7560 pairs"));
  EXPECT_THAT(text, HasSubstr("verdict                  WORSE"));
}

/// At 30 m/s, a report a second with 5 % of the way since the group as doubt; `change` makes another one of it, or
/// none.
std::string steady_ride(const std::function<std::string(int second, double place_m, double since_m)>& change) {
  std::string lines;
  for (int t = 5; t < run_s(); ++t) {
    const double place_m = kSpacingM + kMiddleMps * t;
    lines += change(t, place_m, place_m - group_at(place_m) * kSpacingM);
  }
  return lines;
}
std::string good_line(int t, double place_m, double since_m) {
  return line(t, place_m, 5 + 0.05 * since_m, kMiddleMps);
}

// Ours is as good as the certified system, and on the track beside for two thirds of each leg.
TEST_F(TprCompareFairness, AnotherTrackIsNeverAsGood) {
  write_truth([](double t) { return kMiddleMps * t; }, run_s());
  write("certified.csv", steady_ride(good_line));
  const auto ours = [](uint32_t more) {
    return steady_ride([&](int t, double place_m, double since_m) {
      return line(t, place_m, 5 + 0.05 * since_m, kMiddleMps, since_m > 300 ? more : 0);
    });
  };
  write("ours.csv", ours(kBeside));
  auto text = said();
  // The group of the first leg was passed before the log begins.
  EXPECT_THAT(text, HasSubstr("outside the interval     ours on 128 of 129, certified on 0 of 129 legs"));
  EXPECT_THAT(text, HasSubstr("verdict                  WORSE; ours refers to groups of another track"));
  write_map(long_line(false));  // it may lack the switch that the train ran over
  text = said();
  EXPECT_THAT(text, HasSubstr("outside the interval     ours on 0 of 129, certified on 0 of 129 legs"));
  EXPECT_THAT(text, HasSubstr("not shown; ours refers to groups that are not on the line"));
  EXPECT_THAT(text, HasSubstr("not shown: on 129 legs ours refers to a group that is not on the line"));
  write_map(long_line(true));
  text = said_without_map();
  EXPECT_THAT(text, HasSubstr("not shown: on 129 legs ours refers to a group that cannot be compared"));
  write("ours.csv", ours(5000));  // on no map
  EXPECT_THAT(said(), HasSubstr("not shown: on 129 legs ours refers to a group that is not on the line"));
  write("ours.csv", ours(0));
  EXPECT_THAT(said(), HasSubstr("verdict                  at least as good"));
  EXPECT_THAT(said_without_map(), HasSubstr("verdict                  intervals at least as good"));
}

// Between the certified reports only, every 10 s.
TEST_F(TprCompareFairness, AnotherTrackBetweenTheCertifiedReportsIsNotAsGood) {
  write_map(long_line(false));
  write_truth([](double t) { return kMiddleMps * t; }, run_s());
  const auto every_tenth = [](int t, double place_m, double since_m) {
    return t % 10 == 0 ? good_line(t, place_m, since_m) : "";
  };
  write("certified.csv", steady_ride(every_tenth));
  write("ours.csv", steady_ride([&](int t, double place_m, double since_m) {
          return line(t, place_m, 5 + 0.05 * since_m, kMiddleMps, t % 10 > 2 && t % 10 < 8 ? kBeside : 0);
        }));
  EXPECT_THAT(said(), HasSubstr("legs ours refers to a group that is not on the line"));
}

// Every fifth kilometre is a loop that --via does not name: as long as the line, with groups of its own.
TEST_F(TprCompareFairness, ALoopThatTheLineDoesNotTakeProvesNothing) {
  write_map(loops());
  write_truth([](double t) { return kMiddleMps * t; }, run_s());
  // Groups are heard of at once or late; where this side has none in the loop it counts from the one before.
  const auto ride = [&](double late_s, bool has_loops) {
    std::string lines;
    for (double t = 5; t < run_s(); t += 0.5) {
      const double place_m = kSpacingM + kMiddleMps * t;
      auto group = group_at(place_m - late_s * kMiddleMps);
      const bool loop = group % 5 == 3;
      if (loop && !has_loops) --group;
      const double since_m = place_m - group * kSpacingM;
      lines += line_from(loop && has_loops ? kBeside + group : group, t, since_m, 5 + 0.05 * since_m, kMiddleMps);
    }
    return lines;
  };
  for (const auto& [ours_s, certified_s] : {std::pair(0.0, 0.6), std::pair(0.6, 0.0)}) {
    for (const bool ours_has : {true, false}) {
      for (const bool certified_has : {true, false}) {
        write("ours.csv", ride(ours_s, ours_has));
        write("certified.csv", ride(certified_s, certified_has));
        const auto text = said();
        EXPECT_THAT(text, HasSubstr("outside the interval     ours on 0 of"));
        EXPECT_THAT(text, HasSubstr(", certified on 0 of"));
        EXPECT_EQ(text.find("lead the line along with --via") != std::string::npos, ours_has && !certified_has) << text;
      }
    }
  }
}

// Ours is vaguer on the way, and silent there for little longer than it is carried.
TEST_F(TprCompareFairness, SilenceWinsNothing) {
  write_truth([](double t) { return kMiddleMps * t; }, run_s());
  write("certified.csv", steady_ride(good_line));
  const auto ours = [](double silent_from_m) {
    return steady_ride([&](int t, double place_m, double since_m) {
      return since_m >= silent_from_m ? "" : line(t, place_m, 3 + 0.07 * since_m, kMiddleMps);
    });
  };
  write("ours.csv", ours(kSpacingM));
  EXPECT_THAT(said(), HasSubstr("verdict                  WORSE"));
  for (const auto& [silent_from_m, longest_gap_s] : {std::pair(30.0, "32.5"), std::pair(150.0, "28.5")}) {
    write("ours.csv", ours(silent_from_m));
    const auto text = said({"--longest-gap-s", longest_gap_s});
    EXPECT_THAT(text, HasSubstr("not shown; ours is silent where it could be worse"));
    EXPECT_THAT(text, HasSubstr("ours is silent for longer than --longest-gap-s"));
  }
}

TEST_F(TprCompareFairness, ALogThatBeginsLaterShowsNothing) {
  write_truth([](double t) { return kMiddleMps * t; }, run_s());
  write("certified.csv", steady_ride(good_line));
  write("ours.csv", steady_ride([](int t, double place_m, double since_m) {
          return t < 1000 ? "" : good_line(t, place_m, since_m);
        }));
  const auto text = said();
  EXPECT_THAT(text, HasSubstr("beyond our log           980 certified reports"));
  EXPECT_THAT(text, HasSubstr("not shown: 980 of 4295 certified reports are from before ours begin"));
}

}  // namespace
}  // namespace railfix::compare_fairness_test
