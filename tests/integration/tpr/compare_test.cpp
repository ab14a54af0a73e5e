// `railfix tpr compare` as a program: on files, with map and truth, and on what the service sends now over DDS.
#include <gmock/gmock.h>

#include <filesystem>

#include "etcs/train_position_report.hpp"
#include "integration/tpr/tpr_service.hpp"
#include "support/program.hpp"

namespace railfix::compare_test {
namespace {

using ::testing::HasSubstr;

constexpr double kPatienceS = 60;

std::string hex_of(const etcs::TrainPositionReport& report) {
  return etcs::to_hex(core::value_or_throw(etcs::encode(report, etcs::Baseline::b3)));
}

/// 20 m/s away from one group after the other, a report every 5 s; `error_m` in front of the true place. Of the five
/// reports of a leg the first ones have an interval.
std::string table(double error_m, uint32_t doubt_m, int legs = 12, int with_interval = 5) {
  std::ostringstream text;
  text << "stamp_ns,hex\n";
  for (int leg = 0; leg < legs; ++leg) {
    for (int i = 0; i < 5; ++i) {
      etcs::TrainPositionReport report;
      report.nid_lrbg = static_cast<uint32_t>(85 << 14 | (leg + 1));
      report.q_scale = 0;
      report.d_lrbg = static_cast<uint32_t>(10 * (10 + i * 100 + error_m));
      report.q_dirlrbg = report.q_dlrbg = report.q_dirtrain = etcs::kNominal;
      report.l_doubtover = report.l_doubtunder = i < with_interval ? doubt_m * 10 : uint32_t{etcs::kUnknownDistance};
      report.v_train = 14;
      text << (leg * 5 + i) * 5'000'000'000LL << ',' << hex_of(report) << '\n';
    }
  }
  return text.str();
}

/// Relative to the group A of balise_map() at 100 m of edge 1, or to C at 700 m; the front end is at `front_m`.
etcs::TrainPositionReport beyond(uint32_t group, double front_m, uint32_t doubt_m) {
  etcs::TrainPositionReport report;
  report.nid_lrbg = group;
  report.q_scale = 0;
  report.d_lrbg =
      static_cast<uint32_t>(std::lround(10 * (front_m - (group == tpr_publisher::testing::kA ? 100 : 700))));
  report.q_dirlrbg = report.q_dlrbg = report.q_dirtrain = etcs::kNominal;
  report.l_doubtover = report.l_doubtunder = doubt_m * 10;
  report.v_train = 14;
  return report;
}

class TprCompareFiles : public ::testing::Test {
 protected:
  TprCompareFiles() {
    std::filesystem::create_directories(folder_ / "truth");
    core::ok_or_throw(tpr_publisher::testing::balise_map()->save(folder_ / "line.map"));
  }
  ~TprCompareFiles() override { std::filesystem::remove_all(folder_); }
  [[nodiscard]] std::string file(const std::string& name) const { return (folder_ / name).string(); }
  [[nodiscard]] test::Outcome compare(const std::vector<std::string>& more) const {
    std::vector<std::string> arguments{
        "railfix", "tpr", "compare", "--ours", file("ours.csv"), "--certified", file("certified.csv")};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return test::run_program(arguments, kPatienceS);
  }
  /// 20 reports of a train that runs away from A, each as often as told.
  template <class Change>
  void write_reports(const std::string& name, const Change& change, int times = 1) const {
    std::ofstream out(file(name));
    out << "stamp_ns,hex\n";
    for (int i = 0; i < 20; ++i) {
      auto report = beyond(tpr_publisher::testing::kA, 400 + 20 * i, 10);
      change(report);
      for (int n = 0; n < times; ++n) out << i * core::kNsPerSecond << ',' << hex_of(report) << '\n';
    }
  }

 private:
  std::filesystem::path folder_ =
      std::filesystem::temp_directory_path() / ("tpr-compare-map-" + std::to_string(getpid()));
};

TEST(TprCompare, SaysWhatIsShownAndWhatIsNot) {
  const auto folder = std::filesystem::temp_directory_path() / ("tpr-compare-" + std::to_string(getpid()));
  std::filesystem::create_directories(folder);
  std::ofstream(folder / "ours.csv") << table(0.5, 5);
  std::ofstream(folder / "certified.csv") << table(-1.5, 20);
  const std::string ours = (folder / "ours.csv").string();
  const std::string certified = (folder / "certified.csv").string();
  auto outcome = test::run_program({"railfix", "tpr", "compare", "--ours", ours, "--certified", certified}, kPatienceS);
  EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_THAT(outcome.out, HasSubstr("60 in 12 legs"));
  EXPECT_THAT(outcome.out, HasSubstr("mean +2.00 m"));
  EXPECT_THAT(outcome.out, HasSubstr("overlap        60 of 60"));
  EXPECT_THAT(outcome.out, HasSubstr("ratio 0.250 (0.158 to 0.396)"));
  EXPECT_THAT(outcome.out,
              HasSubstr("interval known           ours 100.0 %, certified 100.0 % of 60 certified reports"));
  EXPECT_THAT(outcome.out, HasSubstr("verdict                  not shown")) << "a silent leg among the next 12?";
  outcome = test::run_program({"railfix", "tpr", "compare", "--ours", certified, "--certified", ours}, kPatienceS);
  EXPECT_THAT(outcome.out, HasSubstr("verdict                  WORSE"));
  EXPECT_EQ(outcome.exit_code, 3);
  std::ofstream(ours) << table(0.5, 5, 70);
  std::ofstream(certified) << table(-1.5, 20, 70);
  outcome = test::run_program({"railfix", "tpr", "compare", "--ours", ours, "--certified", certified}, kPatienceS);
  EXPECT_THAT(outcome.out, HasSubstr("intervals at least as good, and as often known; errors not known"));
  std::ofstream(ours) << table(40, 5, 70);
  outcome = test::run_program({"railfix", "tpr", "compare", "--ours", ours, "--certified", certified}, kPatienceS);
  EXPECT_THAT(outcome.out, HasSubstr("overlap        0 of 350"));
  EXPECT_THAT(outcome.out, HasSubstr("not shown: on 70 legs the intervals have nothing in common")) << "however short";
  std::ofstream(ours) << table(0.5, 5, 70, 1);
  outcome = test::run_program({"railfix", "tpr", "compare", "--ours", ours, "--certified", certified}, kPatienceS);
  EXPECT_THAT(outcome.out, HasSubstr("interval known           ours 20.0 %, certified 100.0 % of 350"));
  EXPECT_THAT(outcome.out, HasSubstr("verdict                  WORSE"));
  std::ofstream(certified, std::ios::app) << "5,88\n7\n";
  outcome = test::run_program({"railfix", "tpr", "compare", "--ours", ours, "--certified", certified}, kPatienceS);
  EXPECT_THAT(outcome.out, HasSubstr("no report can be read    from 0 lines of ours, 2 of the certified"));
  EXPECT_THAT(outcome.err, HasSubstr(certified + " line 352: "));
  EXPECT_THAT(outcome.err, HasSubstr(certified + " line 353: has 1 values"));
  outcome = test::run_program({"railfix", "tpr", "compare", "--ours", ours, "--certified", "/no/such.csv"}, kPatienceS);
  EXPECT_EQ(outcome.exit_code, 2);
  EXPECT_THAT(outcome.err, HasSubstr("/no/such.csv"));
  std::filesystem::remove_all(folder);
}

// From 150 to 950 m of edge 1 at 20 m/s, front end 2 m before the foot: ours changes to group C at 700 m, the certified
// system misses it. Ours is 0.5 m in front of the truth, the certified 1.5 m behind it, with an interval that misses it
// in the end.
TEST_F(TprCompareFiles, OneLineAndItsTruth) {
  std::ofstream ours(file("ours.csv"));
  std::ofstream certified(file("certified.csv"));
  std::ofstream truth(file("truth/track.csv"));
  ours << "stamp_ns,hex\n";
  certified << "stamp_ns,hex\n";
  truth << "timestamp,distance\n";
  for (int i = 0; i <= 40; ++i) {
    const double foot_m = 150 + 20 * i;
    const int64_t stamp_ns = i * core::kNsPerSecond;
    truth << stamp_ns << ',' << foot_m - 150 << '\n';
    const double front_m = foot_m + 2;
    const bool beyond_c = front_m > 700;
    ours << stamp_ns << ','
         << hex_of(beyond(beyond_c ? tpr_publisher::testing::kC : tpr_publisher::testing::kA, front_m + 0.5, 5))
         << '\n';
    certified << stamp_ns << ',' << hex_of(beyond(tpr_publisher::testing::kA, front_m - 1.5, i < 35 ? 10 : 1)) << '\n';
  }
  ours.close();
  certified.close();
  truth.close();
  auto outcome = compare({});
  EXPECT_THAT(outcome.out, HasSubstr("paired in time           28 in")) << "behind C the groups differ";
  outcome = compare({"--map", file("line.map")});
  EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_THAT(outcome.out, HasSubstr("paired in time           41 in"));
  EXPECT_THAT(outcome.out, HasSubstr("mean +2.00 m"));
  EXPECT_THAT(outcome.out, HasSubstr("error                    not known without --truth"));
  outcome =
      compare({"--map", file("line.map"), "--start", "1:150:+", "--truth", file("truth"), "--foot-to-front-m", "2"});
  EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_THAT(outcome.out, HasSubstr("error, size                   0.50      0.50      0.50        1.50      1.50"));
  EXPECT_THAT(outcome.out, HasSubstr("outside the interval     ours on 0 of 1, certified on 1 of 1 legs"));
  outcome = compare({"--truth", file("truth")});
  EXPECT_EQ(outcome.exit_code, 2);
  EXPECT_THAT(outcome.err, HasSubstr("--truth needs --map and --start"));
}

// Ours 1.5 m in front of the certified position at 20 m/s and level with it at 5 m/s, 300 m and more beyond A; the
// truth begins at 5 km of its own count.
TEST_F(TprCompareFiles, TheTruthCountsFromItsFirstRow) {
  std::ofstream ours(file("ours.csv"));
  std::ofstream certified(file("certified.csv"));
  std::ofstream truth(file("truth/track.csv"));
  ours << "stamp_ns,hex\n";
  certified << "stamp_ns,hex\n";
  truth << "timestamp,distance\n";
  for (int i = 0; i < 20; ++i) {
    const int64_t stamp_ns = i * core::kNsPerSecond;
    const double way_m = i < 10 ? 20 * i : 200 + 5 * (i - 10);
    auto report = beyond(tpr_publisher::testing::kA, 400 + way_m, 10);
    report.v_train = i < 10 ? 14 : 4;
    ours << stamp_ns << ',' << hex_of(report) << '\n';
    report.d_lrbg -= i < 10 ? 15 : 0;
    certified << stamp_ns << ',' << hex_of(report) << '\n';
    truth << stamp_ns << ',' << 5000 + way_m << '\n';
  }
  ours.close();
  certified.close();
  truth.close();
  const std::vector<std::string> arguments{"--map", file("line.map"), "--start", "1:400:+", "--truth", file("truth")};
  auto outcome = compare(arguments);
  EXPECT_THAT(outcome.out, HasSubstr("error, size                   0.00      0.00      0.00        0.75"));
  EXPECT_THAT(outcome.out, HasSubstr("stamps of the certified system are late by that much, or ours early"));
  EXPECT_THAT(outcome.out, HasSubstr("needs 10 legs at least, how many is not known yet"));
  std::ofstream(file("truth/track.csv")) << "timestamp,distance\n90000000000,0\n100000000000,5\n";
  outcome = compare(arguments);
  EXPECT_EQ(outcome.exit_code, 2);
  EXPECT_THAT(outcome.err, HasSubstr("the truth is from 90.000 to 100.000 s and does not overlap with the paired "
                                     "reports, from 0.000 to 19.000 s."));
}

TEST_F(TprCompareFiles, GroupsThatTheMapDoesNotHaveAreCounted) {
  std::ofstream ours(file("ours.csv"));
  ours << "stamp_ns,hex\n";
  for (int i = 0; i < 20; ++i) {
    const uint32_t group = i < 10 ? tpr_publisher::testing::kA : 300U << 14U | 1U;
    ours << i * core::kNsPerSecond << ',' << hex_of(beyond(group, 700 + 20 * i, 10)) << '\n';
  }
  ours.close();
  std::filesystem::copy(file("ours.csv"), file("certified.csv"));
  const auto outcome = compare({"--map", file("line.map")});
  EXPECT_THAT(outcome.out, HasSubstr("group not on the line    ours 10, certified 10 reports"));
  EXPECT_THAT(outcome.out, HasSubstr("ours 100.0 %, certified 100.0 % of 20 certified reports"));
}

TEST_F(TprCompareFiles, WhatContradictsOrComesTwiceIsTold) {
  const auto write = [&](const char* name, uint32_t q_dirlrbg, bool placed, int times = 1,
                         uint32_t q_dirtrain = etcs::kNominal) {
    write_reports(
        name,
        [&](auto& report) {
          report.q_dirlrbg = q_dirlrbg;
          report.q_dirtrain = q_dirtrain;
          if (!placed) report.d_lrbg = etcs::kUnknownDistance;
        },
        times);
  };
  write("ours.csv", etcs::kNominal, true);
  write("certified.csv", etcs::kReverse, true, 2);
  auto outcome = compare({});
  EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_THAT(outcome.out, HasSubstr("reports                  ours 20, 20 with a place; certified 20, 20"));
  EXPECT_THAT(outcome.out, HasSubstr("delivered once more      ours 0, certified 20 reports"));
  EXPECT_THAT(outcome.out, HasSubstr("train turned round       in 20 of 20"));
  EXPECT_THAT(outcome.out, HasSubstr("not shown: on 1 legs the train looks the other way in ours"));
  EXPECT_THAT(outcome.out, HasSubstr("ratio 1.000 (too few legs for bounds)"));
  EXPECT_THAT(outcome.out, ::testing::Not(HasSubstr("nan")));
  write("certified.csv", etcs::kNominal, true, 1, etcs::kReverse);
  outcome = compare({});
  EXPECT_THAT(outcome.out, HasSubstr("train runs the other way in 20 of 20"));
  EXPECT_THAT(outcome.out, HasSubstr("not shown: on 1 legs the train runs the other way in ours (Q_DIRTRAIN)"));
  write("certified.csv", etcs::kNominal, false);
  outcome = compare({});
  EXPECT_EQ(outcome.exit_code, 2);
  EXPECT_THAT(outcome.err, HasSubstr(file("certified.csv") + ": none of its 20 reports has a place"));
}

TEST_F(TprCompareFiles, ASpeedThatIsOffAndAnotherModeAreTold) {
  const auto write = [&](const char* name, uint32_t v_train, uint32_t m_mode) {
    write_reports(name, [&](auto& report) {
      report.v_train = v_train;
      report.m_mode = m_mode;
    });
  };
  write("ours.csv", 18, 0);
  write("certified.csv", 14, 2);
  const auto outcome = compare({});
  EXPECT_THAT(outcome.out, HasSubstr("speed, ours - certified  mean +20.0 km/h, |.| p50 20.0"));
  EXPECT_THAT(outcome.out, HasSubstr("speeds apart             in 20 of 20"));
  EXPECT_THAT(outcome.out, HasSubstr("not shown: on 1 legs the speeds differ by more than both may be off (V_TRAIN)"));
  EXPECT_THAT(outcome.out, HasSubstr("M_MODE 20, M_LEVEL 0, Q_LENGTH 0 of 20; not judged"));
}

TEST_F(TprCompareFiles, ASideWithoutReportsIsNamed) {
  const auto refusal = [&](const std::vector<std::string>& more) {
    const auto outcome = compare(more);
    EXPECT_EQ(outcome.exit_code, 2) << outcome.out;
    return outcome.err;
  };
  std::ofstream(file("certified.csv")) << table(1, 10);
  std::ofstream(file("ours.csv")) << "stamp_ns,hex\n";
  EXPECT_THAT(refusal({}), HasSubstr("--ours " + file("ours.csv") + ": it holds no position report"));
  std::ofstream(file("ours.csv")) << table(1, 10);
  std::ofstream(file("certified.csv")) << "stamp_ns,hex\n";
  EXPECT_THAT(refusal({}), HasSubstr("--certified " + file("certified.csv") + ": it holds no position report"));
  const auto nameless = test::run_program(
      {"railfix", "tpr", "compare", "--ours", "topic:", "--certified", file("certified.csv")}, kPatienceS);
  EXPECT_EQ(nameless.exit_code, 2);
  EXPECT_THAT(nameless.err, HasSubstr("lacks the name of the train; write topic:TRAIN"));
}

TEST_F(TprCompareFiles, OptionsOutOfRangeAreRefused) {
  const auto refusal = [&](const std::vector<std::string>& more) {
    const auto outcome = compare(more);
    EXPECT_EQ(outcome.exit_code, 2) << more[1];
    return outcome.err;
  };
  EXPECT_THAT(refusal({"--confidence", "nan"}), HasSubstr("--confidence: nan is not a number from 0.5 to 0.9999"));
  EXPECT_THAT(refusal({"--margin", "nan"}), HasSubstr("--margin: nan is not a number from 0 to 1"));
  EXPECT_THAT(refusal({"--broken-at-most", "nan"}), HasSubstr("--broken-at-most: nan is not a number from 0 to 1"));
  for (const std::string wrong : {"nan", "-5", "1e300"}) {
    EXPECT_THAT(refusal({"--longest-gap-s", wrong}),
                HasSubstr("--longest-gap-s: " + wrong + " is not a number of seconds from 0 to 86400"));
  }
  for (const std::string wrong : {"nan", "inf", "1e300"}) {
    EXPECT_THAT(refusal({"--offset-s", wrong}),
                HasSubstr("--offset-s: " + wrong + " is not a number of seconds from -4e+09 to 4e+09"));
  }
  EXPECT_THAT(refusal({"--for-s", "inf"}), HasSubstr("--for-s: inf is not a number of seconds"));
  EXPECT_THAT(refusal({"--start", "1:0"}), HasSubstr("--start needs --map"));
  EXPECT_THAT(refusal({"--via", "2"}), HasSubstr("--via needs --map"));
}

// What the service sends now, beside a certified system whose reports come as another train's.
TEST_F(TprService, IsComparedWhileItRuns) {
  const auto evc_options = test::network(train_ + "-evc", kDomain);
  messaging::Participant evc(evc_options);
  messaging::Writer<msg::TrainPositionReport> certified(evc, topics::train_position_report);
  test::Program program(service({"tpr_publisher.t_cycloc_s=1"}));
  const auto said = map_file_.string() + ".said";
  test::Program compare(
      {"railfix", "tpr", "compare", "--ours", "topic:" + train_, "--certified", "topic:" + train_ + "-evc", "--domain",
       std::to_string(kDomain), "--map", map_file_.string(), "--start", "1:0:+"},
      {said, said + "-err", {}});
  ASSERT_TRUE(run_until([&] { return connected() && certified.matched_readers() > 0; }, [] {}));
  // 2 m behind ours, whose front is 2 m before the foot: at the foot itself.
  const auto write_certified = [&](double front_m) {
    const auto bytes =
        core::value_or_throw(etcs::encode(beyond(tpr_publisher::testing::kA, front_m, 10), etcs::Baseline::b3));
    msg::TrainPositionReport message;
    message.stamp_ns(core::wall_ns());
    message.baseline(3);
    message.message_bytes(static_cast<uint32_t>(bytes.size()));
    std::copy(bytes.begin(), bytes.end(), message.message().begin());
    certified.write(message);
  };
  int turn = 0;
  const auto pairs = [&] {
    const auto text = test::slurp(said);
    size_t count = 0;
    for (size_t at = text.find("ours - certified"); at != std::string::npos; at = text.find("ours - certified", at + 1))
      ++count;
    return count;
  };
  ASSERT_TRUE(run_until([&] { return pairs() >= 5; },
                        [&] {
                          write_state(450, 0, 0);
                          if (++turn % 10 == 0) write_certified(450);
                        }));
  EXPECT_EQ(compare.end(SIGINT), 0) << test::slurp(said + "-err");
  const auto text = test::slurp(said);
  EXPECT_THAT(text, HasSubstr("ours - certified +2.00 m, intervals overlap"));
  EXPECT_THAT(text, HasSubstr("mean +2.00 m"));
  EXPECT_THAT(text, HasSubstr("verdict                  not shown")) << "one leg shows nothing";
  for (const auto& file : {said, said + "-err"}) std::filesystem::remove(file);
}

}  // namespace
}  // namespace railfix::compare_test
