// `railfix tpr compare` on two small files.
#include <gmock/gmock.h>

#include <filesystem>

#include "etcs/train_position_report.hpp"
#include "support/program.hpp"

namespace railfix {
namespace {

using ::testing::HasSubstr;

constexpr double kPatienceS = 60;

/// 20 m/s away from one group after the other, a report every 5 s; `error_m` in front of the true place.
std::string table(double error_m, uint32_t doubt_m) {
  std::ostringstream text;
  text << "stamp_ns,hex\n";
  for (int leg = 0; leg < 12; ++leg) {
    for (int i = 0; i < 5; ++i) {
      etcs::TrainPositionReport report;
      report.nid_lrbg = static_cast<uint32_t>(85 << 14 | (leg + 1));
      report.q_scale = 0;
      report.d_lrbg = static_cast<uint32_t>(10 * (10 + i * 100 + error_m));
      report.q_dirlrbg = report.q_dlrbg = report.q_dirtrain = etcs::kNominal;
      report.l_doubtover = report.l_doubtunder = doubt_m * 10;
      report.v_train = 14;
      text << (leg * 5 + i) * 5'000'000'000LL << ','
           << etcs::to_hex(core::value_or_throw(etcs::encode(report, etcs::Baseline::b3))) << '\n';
    }
  }
  return text.str();
}

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
  EXPECT_THAT(outcome.out, HasSubstr("ratio 0.250 (0.250 to 0.250)"));
  EXPECT_THAT(outcome.out, HasSubstr("intervals at least as good; errors not known"));
  outcome = test::run_program({"railfix", "tpr", "compare", "--ours", certified, "--certified", ours}, kPatienceS);
  EXPECT_THAT(outcome.out, HasSubstr("verdict                  WORSE"));
  outcome = test::run_program({"railfix", "tpr", "compare", "--ours", ours, "--certified", "/no/such.csv"}, kPatienceS);
  EXPECT_EQ(outcome.exit_code, 2);
  EXPECT_THAT(outcome.err, HasSubstr("/no/such.csv"));
  std::filesystem::remove_all(folder);
}

}  // namespace
}  // namespace railfix
