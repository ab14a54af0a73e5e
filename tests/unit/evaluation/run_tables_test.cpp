#include "evaluation/run_tables.hpp"

#include <gmock/gmock.h>
#include <unistd.h>

#include <fstream>

namespace railfix::evaluation {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;

constexpr const char* kHeader =
    "stamp_ns,track_known,distance_m,speed_mps,over_m,under_m,integrity,easting_m,northing_m\n";

class EvaluatedRun : public ::testing::Test {
 protected:
  void SetUp() override { fs::create_directories(folder_); }
  void TearDown() override { fs::remove_all(folder_); }
  [[nodiscard]] core::Result<RunTables> with_states(const std::string& rows) const {
    std::ofstream(folder_ / "train_state.csv") << kHeader << rows;
    return read_run(folder_);
  }
  const fs::path folder_ = fs::temp_directory_path() / ("railfix-evaluated-" + std::to_string(::getpid()));
};

TEST_F(EvaluatedRun, AnIntervalMayBeUnknownButNotNegative) {
  const auto run = with_states("1,1,10,5,,,unusable,0,0\n2,1,11,5,3,4,ok,1,0\n");
  ASSERT_TRUE(run.ok()) << run.error().message;
  EXPECT_EQ(run.value().states->size(), 2U);
  EXPECT_THAT(with_states("1,1,10,5,3,4,ok,0,0\n2,1,11,5,-5,-5,ok,1,0\n").error().message,
              HasSubstr("train_state.csv line 3: has an interval that ends before it begins"));
}

TEST_F(EvaluatedRun, AWordThatStandsForNothingIsNotTakenForAnother) {
  EXPECT_THAT(with_states("1,1,10,5,3,4,UNUSABLE,0,0\n").error().message,
              HasSubstr("line 2: has the integrity 'UNUSABLE', which must be one of ok, degraded, unusable"));
  std::ofstream(folder_ / "odometry.csv") << "stamp_ns,valid,distance_m,speed_mps,mode\n1,1,0,5,blnd\n";
  EXPECT_THAT(with_states("1,1,10,5,3,4,ok,0,0\n").error().message,
              HasSubstr("has the mode 'blnd', which must be one of search, track, keyframe, blind"));
}

}  // namespace
}  // namespace railfix::evaluation
