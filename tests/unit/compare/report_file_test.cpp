#include "compare/report_file.hpp"

#include <gmock/gmock.h>
#include <unistd.h>

#include <fstream>

namespace railfix::compare {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

const std::string kHex = "880601D6F345402AF34000E48F68EB84D250014010C38830";

class ReportFile : public ::testing::Test {
 protected:
  ReportFile() { std::filesystem::create_directories(folder_); }
  ~ReportFile() override { std::filesystem::remove_all(folder_); }
  core::Result<ReportLog> read(const std::string& name, const std::string& text) {
    std::ofstream(folder_ / name) << text;
    return read_reports(folder_ / name, etcs::Baseline::b3);
  }
  std::filesystem::path folder_ = std::filesystem::temp_directory_path() / ("report-file-" + std::to_string(getpid()));
};

TEST_F(ReportFile, TableOrLinesSayTheSame) {
  const auto table = read("a.csv", "time_ns,message\n2000," + kHex + "\n1000," + kHex + "\n").value().reports;
  ASSERT_EQ(table.size(), 2U);
  EXPECT_EQ(table[0].stamp_ns, 1000);  // sorted
  EXPECT_EQ(table[0].fields.d_lrbg, 1234U);
  const auto lines =
      read("a.jsonl", "{\"stamp_ns\": 1000, \"hex\": \"" + kHex + "\", \"baseline\": 3}\n\n").value().reports;
  ASSERT_EQ(lines.size(), 1U);
  EXPECT_EQ(lines[0].fields, table[0].fields);
  ASSERT_TRUE(read("tpr.csv", "stamp_ns,hex\n5," + kHex + "\n").ok());
  EXPECT_EQ(read_reports(folder_, etcs::Baseline::b3).value().reports.at(0).stamp_ns, 5);
}

TEST_F(ReportFile, TheOtherBaselineIsNamedWhereItFits) {
  const auto refusal = read("a.csv", "stamp_ns,hex,baseline\n1," + kHex + ",4\n").error().message;
  EXPECT_THAT(refusal, HasSubstr("line 2"));
  EXPECT_THAT(refusal, HasSubstr("It reads well as baseline 3."));
}

TEST_F(ReportFile, AStampThatIsNoTimeIsRefused) {
  for (const char* stamp : {"-5", "9223372036854775807"}) {
    const auto said = HasSubstr("line 3: the stamp " + std::string(stamp) + " is no time");
    EXPECT_THAT(read("a.csv", "stamp_ns,hex\n1," + kHex + "\n" + stamp + "," + kHex + "\n").value().lines_refused,
                ElementsAre(said));
    EXPECT_THAT(
        read("a.jsonl", "\n\n{\"stamp_ns\": " + std::string(stamp) + ", \"hex\": \"" + kHex + "\"}\n").error().message,
        said);
  }
}

TEST_F(ReportFile, ReadingGoesOnBehindALineWithoutReport) {
  const auto table =
      read("a.csv", "stamp_ns,hex\n1," + kHex + "\n2,88\n3\nx," + kHex + "\n5," + kHex + "\n6,880").value();
  EXPECT_EQ(table.reports.size(), 2U);
  EXPECT_THAT(table.lines_refused, ElementsAre(HasSubstr("a.csv line 3: "), HasSubstr("a.csv line 4: has 1 values"),
                                               HasSubstr("a.csv line 5: 'x'"), HasSubstr("a.csv line 7: ")));
  const std::string good = "{\"stamp_ns\": 1, \"hex\": \"" + kHex + "\"}\n";
  const auto lines = read("a.jsonl", good + "{\"stamp_ns\": 2}\n" + good + "{\"stamp").value();
  EXPECT_EQ(lines.reports.size(), 2U);
  EXPECT_THAT(lines.lines_refused, ElementsAre(HasSubstr("a.jsonl line 2: "), HasSubstr("a.jsonl line 4: ")));
}

TEST_F(ReportFile, ErrorsNameTheLine) {
  EXPECT_THAT(read("a.csv", "stamp_ns,hex\n2,88\n").error().message, HasSubstr("line 2"));
  EXPECT_THAT(read("a.csv", "stamp_ns\n1\n").error().message, HasSubstr("hex"));
  EXPECT_THAT(read("a.jsonl", "[1]\n").error().message, HasSubstr("line 1: not a JSON object"));
  EXPECT_THAT(read("a.jsonl", "{\"stamp_ns\": 1}\n").error().message, HasSubstr("\"hex\""));
  EXPECT_THAT(read("a.jsonl", "{\"stamp_ns\": 1, \"hex\": \"" + kHex + "\", \"baseline\": 4}").error().message,
              HasSubstr("line 1"));
  EXPECT_THAT(read("a.jsonl", "\n{\"stamp_ns\": 1,}\n").error().message, HasSubstr("line 2: not JSON at byte 16."));
  const std::string deep = std::string(150'000, '[') + std::string(150'000, ']');
  EXPECT_THAT(read("a.jsonl", "{\"stamp_ns\": " + deep + "}\n").error().message, HasSubstr("line 1: its lists"));
  EXPECT_THAT(read_reports("/no/such.jsonl", etcs::Baseline::b3).error().message, HasSubstr("/no/such.jsonl"));
}

}  // namespace
}  // namespace railfix::compare
