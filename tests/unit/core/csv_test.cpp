#include "core/csv.hpp"

#include <gmock/gmock.h>
#include <unistd.h>

#include <cmath>
#include <limits>
#include <sstream>

namespace railfix::core {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

class CsvTest : public ::testing::Test {
 protected:
  void SetUp() override {
    file_ = std::filesystem::temp_directory_path() / ("railfix_csv_" + std::to_string(getpid()) + ".csv");
  }
  void TearDown() override { std::filesystem::remove(file_); }

  CsvReader reader(const std::string& content) {
    std::ofstream(file_) << content;
    return value_or_throw(CsvReader::open(file_));
  }
  std::filesystem::path file_;
};

TEST_F(CsvTest, HeaderLosesHashUnitsAndSpaces) {
  const auto table = reader("\xEF\xBB\xBF#timestamp [ns], camera height [m],w_x\r\n");
  EXPECT_THAT(table.header(), ElementsAre("timestamp", "camera_height", "w_x"));
  EXPECT_EQ(table.column({"missing", "camera_height"}), 1U);
  EXPECT_EQ(table.column({"missing"}), std::nullopt);
}

TEST_F(CsvTest, ReadsRowsAndSkipsEmptyLinesAndComments) {
  auto table = reader("a,b\n1,2.5\n\n# a comment\n-9223372036854775808,\r\n");
  ASSERT_TRUE(table.next());
  EXPECT_EQ(table.integer(0).value(), 1);
  EXPECT_EQ(table.number(1).value(), 2.5);
  ASSERT_TRUE(table.next());
  EXPECT_EQ(table.integer(0).value(), std::numeric_limits<int64_t>::min());
  EXPECT_TRUE(std::isnan(table.number(1).value()));
  EXPECT_FALSE(table.next());
  EXPECT_TRUE(table.status().ok());
}

TEST_F(CsvTest, ErrorsNameFileLineAndColumn) {
  auto table = reader("a,b\n1,x2\n3\n");
  ASSERT_TRUE(table.next());
  const auto broken = table.number(1);
  ASSERT_FALSE(broken.ok());
  EXPECT_THAT(broken.error().message, HasSubstr(file_.string() + " line 2: 'x2' in column b"));
  EXPECT_FALSE(table.next());
  EXPECT_THAT(table.status().error().message, HasSubstr(" line 3: has 1 values where the header names 2"));
}

TEST_F(CsvTest, ADecimalCommaShiftsNoColumns) {
  auto table = reader("a,b\n1,2,\n1,5,2\n");
  EXPECT_TRUE(table.next()) << "nothing stands behind the last comma";
  EXPECT_FALSE(table.next());
  EXPECT_THAT(
      table.status().error().message,
      HasSubstr(" line 3: has 3 values where the header names 2 columns; is a comma used as the decimal point"));
}

TEST_F(CsvTest, ANumberBeyondTheMostThatItCanBeIsAnError) {
  auto table = reader("a,b\n-200,\n200.1,-inf\n");
  ASSERT_TRUE(table.next());
  EXPECT_EQ(table.number(0, 200).value(), -200);
  EXPECT_TRUE(std::isnan(table.number(1, 200).value()));
  ASSERT_TRUE(table.next());
  EXPECT_THAT(table.number(0, 200).error().message, HasSubstr(" line 3: '200.1' in column a is beyond 200, the most"));
  EXPECT_FALSE(table.number(1, 200).ok());
  EXPECT_TRUE(std::isinf(table.number(1).value()));
}

TEST_F(CsvTest, MissingAndEmptyFilesAreErrors) {
  EXPECT_THAT(CsvReader::open(file_).error().message, HasSubstr("cannot be opened"));
  std::ofstream(file_).close();
  EXPECT_THAT(CsvReader::open(file_).error().message, HasSubstr("is empty"));
  EXPECT_EQ(CsvReader::open(file_ / "track.csv").error().message,
            file_.string() + " is a file; give the folder that holds track.csv");
  EXPECT_EQ(CsvReader::open(file_.parent_path()).error().message,
            file_.parent_path().string() + " is a folder, not a file");
}

TEST_F(CsvTest, WhatIsWrittenReadsBackTheSame) {
  const double number = 0.1 + 0.2;
  {
    CsvWriter writer(file_, "a,b,c,d");
    writer << int64_t{-5} << number << std::nan("") << "word";
    writer.end_row();
    writer.empty() << 1e-300 << uint64_t{18446744073709551615ULL} << 0;
    writer.end_row();
    EXPECT_TRUE(writer.close().ok());
  }
  auto table = value_or_throw(CsvReader::open(file_));
  ASSERT_TRUE(table.next());
  EXPECT_EQ(table.integer(0).value(), -5);
  EXPECT_EQ(table.number(1).value(), number);
  EXPECT_EQ(table.text(2), "");
  EXPECT_EQ(table.text(3), "word");
  ASSERT_TRUE(table.next());
  EXPECT_EQ(table.text(0), "");
  EXPECT_EQ(table.number(1).value(), 1e-300);
  EXPECT_EQ(table.text(2), "18446744073709551615");
  EXPECT_FALSE(table.next());
}

TEST_F(CsvTest, WritingIntoAMissingFolderThrowsASentence) {
  EXPECT_THROW(CsvWriter("/nowhere/at/all.csv", "a"), BadInput);
}

}  // namespace
}  // namespace railfix::core
