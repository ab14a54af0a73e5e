// What is said of a computer whose services run.
#include "train/verdict.hpp"

#include <gmock/gmock.h>
#include <unistd.h>

#include <fstream>

namespace railfix::tool {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;
using ::testing::StartsWith;

service::HealthAnswer heard(std::optional<double> input_s) {
  return {.healthy = true, .input_s = input_s, .text = "active"};
}

TEST(Verdict, ServicesThatRunAndHearNothingAreNamed) {
  EXPECT_THAT(deaf_services({{"frame_grabber", heard({})}, {"odometry", heard(0.1)}, {"fusion", heard(4.0)}}),
              IsEmpty())
      << "a camera listens to nobody";
  EXPECT_THAT(deaf_services({{"map_matcher", heard({})}, {"fusion", heard({})}, {"odometry", heard(61.4)}}),
              ElementsAre(StartsWith("running, but nothing yet has reached map_matcher, fusion: look at camera"),
                          StartsWith("running, but nothing for more than 5 s has reached odometry: ")));
  EXPECT_THAT(deaf_services({{"fusion", {.text = "does not run"}}}), IsEmpty()) << "its own line says it";
}

TEST(Verdict, AStandbySaysWhetherItIsInCharge) {
  PlannedService fusion;
  fusion.name = "fusion";
  auto health = heard(0.1);
  EXPECT_EQ(standby_text(fusion, health), "");
  fusion.standby = true;
  EXPECT_EQ(standby_text(fusion, health), " (standby, in charge at present)");
  health.stands_by = true;
  EXPECT_EQ(standby_text(fusion, health), " (standby)");
  EXPECT_EQ(standby_text(fusion, {.text = "does not run"}), " (configured as standby)");
}

TEST(Verdict, OtherComputersAreNotSeenFromHere) {
  namespace fs = std::filesystem;
  const auto root = fs::temp_directory_path() / ("railfix-verdict-" + std::to_string(getpid()));
  const HostFolder here(root);
  HostPlan plan;
  plan.generation = 3;
  fs::create_directories(here.generation(3));
  const auto told = [&](const char* peers) {
    std::ofstream(here.generation(3) / "config.yaml") << "common: { host: cab" << peers << " }\n";
    return not_seen_from_here(here, plan);
  };
  EXPECT_EQ(told(""), "");
  EXPECT_THAT(told(", peers: [10.42.1.12]"), StartsWith("not asked: the other computer 10.42.1.12; railfix top"));
  fs::remove_all(root);
}

}  // namespace
}  // namespace railfix::tool
