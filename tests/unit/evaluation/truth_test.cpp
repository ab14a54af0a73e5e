#include "evaluation/truth.hpp"

#include <gmock/gmock.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <functional>
#include <iomanip>

#include "core/units.hpp"
#include "evaluation/motion.hpp"
#include "unit/evaluation/made_truth.hpp"

namespace railfix::evaluation {
namespace {

TEST(TruthTable, WhatLiesInAGapIsNotJudged) {
  const MadeTruth made;
  std::vector<dataset::TruthRow> rows;
  for (int i = 0; i <= 500; ++i) {
    if (i <= 200 || i >= 400) rows.push_back(made.row(i / 10.0));
  }
  for (auto& row : rows) row.distance_m += row.stamp_ns > 30 * kSecond ? 200 : 0;  // it ran faster meanwhile
  const Truth truth(rows, std::nullopt, std::nullopt);
  EXPECT_TRUE(truth.at(20 * kSecond));
  EXPECT_FALSE(truth.at(30 * kSecond));
  EXPECT_TRUE(truth.at(40 * kSecond));
  EXPECT_EQ(truth.gaps().count, 1U);
  EXPECT_NEAR(truth.gaps().longest_s, 20, 1e-9);
  EXPECT_EQ(made.make().gaps().count, 0U);
}

// Between rows a second apart the way bends by an eighth of the acceleration.
TEST(TruthTable, SaysWhatRowsFarApartLeaveOpen) {
  std::vector<dataset::TruthRow> rows;
  for (int s = 0; s <= 10; ++s) {
    rows.push_back(MadeTruth().row(s));
    rows.back().distance_m = 0.5 * 0.8 * s * s;
  }
  EXPECT_NEAR(Truth(rows, {}, {}).between_rows_m(), 0.1, 1e-9);
  EXPECT_NEAR(MadeTruth().make().between_rows_m(), 0, 1e-9);
}

TEST(TruthTable, OneThatIsWrittenEverySecondHasNoGaps) {
  const MadeTruth made;
  std::vector<dataset::TruthRow> rows;
  for (int i = 0; i <= 50; i += i % 7 == 0 ? 2 : 1) rows.push_back(made.row(i));
  const Truth truth(rows, std::nullopt, std::nullopt);
  EXPECT_EQ(truth.gaps().count, 0U);
  EXPECT_TRUE(truth.at(1 * kSecond));
}

class TruthHeadings : public ::testing::Test {
 protected:
  ~TruthHeadings() override { std::filesystem::remove_all(sequence_); }
  std::string read_with(const std::function<double(double heading_rad)>& written) {
    MadeTruth made;
    made.heading_rad = 0.8;
    const auto folder = sequence_ / "truth";
    std::filesystem::create_directories(folder);
    std::ofstream table(folder / "track.csv");
    table << "stamp_ns,distance_m,speed_mps,easting_m,northing_m,heading_rad\n" << std::setprecision(12);
    for (int i = 0; i <= 100; ++i) {
      const auto row = made.row(i / 10.0);
      table << row.stamp_ns << ',' << row.distance_m << ',' << row.speed_mps << ',' << row.easting_m << ','
            << row.northing_m << ',' << written(row.heading_rad) << '\n';
    }
    table.close();
    const auto truth = Truth::read(folder);
    return truth.ok() ? "" : truth.error().message;
  }
  const std::filesystem::path sequence_ =
      std::filesystem::temp_directory_path() / ("truth-test-" + std::to_string(getpid()));
};

TEST_F(TruthHeadings, InDegreesOrFromTheEastAreRefused) {
  EXPECT_EQ(read_with([](double rad) { return rad; }), "");
  EXPECT_EQ(read_with([](double rad) { return rad + core::kPi; }), "") << "a train that runs backwards";
  for (const auto& written : std::vector<std::function<double(double)>>{
           [](double rad) { return core::deg_from_rad(rad); }, [](double rad) { return core::kPi / 2 - rad + 0.6; }}) {
    EXPECT_THAT(read_with(written), ::testing::HasSubstr("write them in radians, clockwise from north"));
  }
}

}  // namespace
}  // namespace railfix::evaluation
