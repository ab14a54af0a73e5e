// The measuring tools: each explains itself, and says what is wrong with its arguments.
#include <gmock/gmock.h>

#include <fstream>

#include "support/program.hpp"

namespace railfix::measuring_tools_test {
namespace {

using ::testing::HasSubstr;

constexpr double kPatienceS = 20;

const std::vector<std::vector<std::string>> kTools{
    {"railfix-measure-survey", "a", "b", "c"},  {"railfix-measure-confidence", "--fault", "none", "--map", "none.map"},
    {"railfix-measure-filter-health", "x"},     {"railfix-measure-map-fit", "none.landxml"},
    {"railfix-measure-gamab", "x", "y"},        {"railfix-measure-matching", "locate", "--map", "none.map"},
    {"railfix-bench-rails-on-dataset", "none"}, {"railfix-bench-picture-health", "none"}};

TEST(MeasuringTools, ExplainThemselves) {
  for (const auto& tool : kTools) {
    const auto help = test::run_program({tool[0], "--help"}, kPatienceS);
    EXPECT_EQ(help.exit_code, 0) << tool[0] << help.err;
    EXPECT_THAT(help.out, HasSubstr("Usage: " + tool[0]));
    EXPECT_EQ(test::run_program({tool[0], "--none"}, kPatienceS).exit_code, 2) << tool[0];
  }
}

TEST(MeasuringTools, SayWhatIsWrong) {
  for (const auto& arguments : kTools) {
    const auto outcome = test::run_program(arguments, kPatienceS);
    EXPECT_EQ(outcome.exit_code, 2) << arguments[0] << outcome.out << outcome.err;
    EXPECT_NE(outcome.err, "") << arguments[0];
  }
}

TEST(MeasuringTools, FindTheRealAlignmentFromAnyFolder) {
  const std::string tool = RAILFIX_BIN_DIR "/railfix-measure-matching";
  const auto outcome =
      test::run_program({"/usr/bin/env", "RAILFIX_DATA=/no/such/data", tool, "curvature", "--count", "1"}, kPatienceS);
  EXPECT_EQ(outcome.exit_code, 2);
  EXPECT_EQ(outcome.err,
            "railfix-measure-matching: /no/such/data/alignment/sbb_mszw_a2.landxml does not exist; give --map, or its "
            "folder's place as RAILFIX_DATA\n");
}

TEST(MeasuringTools, OptionsGoOverScenarioFiles) {
  const auto measured = [](const std::string& scenario_time_s) {
    const auto file = ::testing::TempDir() + "railfix_scenario_" + scenario_time_s + ".yaml";
    std::ofstream(file) << "simulator:\n  exposure: {time_s: " << scenario_time_s << "}\n";
    const auto outcome = test::run_program({"railfix-measure-odometry",
                                            "--simulate",
                                            "1:100",
                                            "--line",
                                            "long",
                                            "--length-m",
                                            "2",
                                            "--speed-kmh",
                                            "36",
                                            "--accelerate",
                                            "3",
                                            "--dwell-s",
                                            "0.1",
                                            "--rate-hz",
                                            "10",
                                            "--steps",
                                            "--exposure-s",
                                            "0.001",
                                            "--scenario",
                                            file},
                                           kPatienceS);
    EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
    return outcome.out.substr(0, outcome.out.find("processor time"));
  };
  EXPECT_EQ(measured("0.05"), measured("0.001"));
}

TEST(MeasuringTools, TheCampaignOnAMapAsksWhereItBegins) {
  const auto no_start = test::run_program({"railfix-measure-confidence", "--map", "some.map"}, kPatienceS);
  EXPECT_EQ(no_start.exit_code, 2);
  EXPECT_NE(no_start.err.find("Give --start EDGE:OFFSET"), std::string::npos) << no_start.err;
  const auto no_map = test::run_program({"railfix-measure-confidence", "--start", "1:5"}, kPatienceS);
  EXPECT_EQ(no_map.exit_code, 2);
  EXPECT_NE(no_map.err.find("give --map, too"), std::string::npos) << no_map.err;
}

TEST(MeasuringTools, RefuseNumbersThatMeanNothing) {
  const std::vector<std::vector<std::string>> wrong{
      {"railfix-measure-confidence", "--threads", "0"},
      {"railfix-measure-confidence", "--km", "nan"},
      {"railfix-measure-confidence", "--km", "-1"},
      {"railfix-measure-confidence", "--seed", "-1"},
      {"railfix-measure-filter-health", "0"},
      {"railfix-measure-map-fit", "made:x"},
      {"railfix-measure-gamab", "1", "0"},
      {"railfix-measure-matching", "switches", "--count", "x"},
      {"railfix-measure-matching", "nothing"},
      {"railfix-bench-picture-health", "none", "--fps", "nan"},
      {"railfix-bench-rails-on-dataset", "none", "--draw", "folder", "0"}};
  for (const auto& arguments : wrong) {
    const auto outcome = test::run_program(arguments, kPatienceS);
    EXPECT_EQ(outcome.exit_code, 2) << arguments[0] << arguments[1] << outcome.out;
    EXPECT_NE(outcome.err, "");
  }
}

}  // namespace
}  // namespace railfix::measuring_tools_test
