// `railfix evaluate` as scripts use it: what it refuses, in which words, and what it leaves as it was.
#include "integration/commands/refusal.hpp"
#include "unit/dataset/temporary_folder.hpp"

namespace railfix {
namespace {

using ::testing::HasSubstr;
namespace fs = std::filesystem;

class EvaluateCommand : public testing::TemporaryFolder {
 protected:
  void SetUp() override {
    TemporaryFolder::SetUp();
    write("seq/truth/track.csv", "timestamp,distance,speed\n0,0,20\n20000000000,400,20\n");
    write("run/odometry.csv",
          "stamp_ns,valid,distance_m,speed_mps,mode\n0,1,0,20,track\n10000000000,1,202,20,track\n"
          "20000000000,1,404,20,track\n");
  }
  [[nodiscard]] test::Outcome evaluate(std::vector<std::string> arguments) const {
    arguments.insert(arguments.begin(),
                     {"railfix", "evaluate", "--truth", root_ / "seq/truth", "--run", root_ / "run"});
    return test::run_program(arguments, kPatienceS);
  }
  void refuses(const std::vector<std::string>& arguments, const std::string& words) const {
    expect_refusal(evaluate(arguments), words);
  }
};

TEST_F(EvaluateCommand, WritesItsFilesBesideTheTables) {
  for (int time = 0; time < 2; ++time) {
    const auto outcome = evaluate({"--json", root_ / "run/figures.json", "--report", root_ / "run/report.html"});
    EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
    EXPECT_THAT(test::slurp(root_ / "run/figures.json"), HasSubstr("drift_percent"));
    EXPECT_THAT(test::slurp(root_ / "run/report.html"), HasSubstr("</html>"));
  }
}

TEST_F(EvaluateCommand, NeverWritesOverATable) {
  const auto table = root_ / "run/odometry.csv";
  const auto before = test::slurp(table);
  refuses({"--json", table}, "which is read; give another name");
  refuses({"--report", root_ / "seq/truth/track.csv"}, "which is read; give another name");
  EXPECT_EQ(test::slurp(table), before);
}

TEST_F(EvaluateCommand, RefusesTheTruthOfAnotherTime) {
  write("seq/truth/track.csv", "timestamp,distance,speed\n30000000000,0,20\n40000000000,400,20\n");
  refuses({}, "the run is from 0.000 to 20.000 s and the truth from 30.000 to 40.000 s");
}

TEST_F(EvaluateCommand, LooksForTheFoldersBeforeItWorks) {
  refuses({"--report", root_ / "report.html", "--json", root_ / "none/figures.json"}, "/none; make it first");
  EXPECT_FALSE(fs::exists(root_ / "report.html"));
}

TEST_F(EvaluateCommand, RefusesOneNameForTwoFiles) {
  refuses({"--report", root_ / "same", "--json", root_ / "same"}, "--json and --report are both ");
  EXPECT_FALSE(fs::exists(root_ / "same"));
  refuses({"--report", "/dev/stdout", "--json", "-"}, "--json and --report are both ");
}

TEST_F(EvaluateCommand, TellsBesideWhatItWritesToStandardOutput) {
  const auto piped = evaluate({"--json", "/dev/stdout"});
  EXPECT_EQ(piped.exit_code, 0) << piped.err;
  EXPECT_EQ(piped.out, evaluate({"--json", "-"}).out);
  EXPECT_EQ(piped.err, evaluate({}).out);
}

}  // namespace
}  // namespace railfix
