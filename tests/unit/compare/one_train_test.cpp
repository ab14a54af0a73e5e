#include "compare/one_train.hpp"

#include <gmock/gmock.h>

#include "unit/compare/made_up_reports.hpp"

namespace railfix::compare {
namespace {

using ::testing::HasSubstr;
using testing::kA;
using testing::report;
using ::testing::SizeIs;

std::vector<TimedReport> of(std::initializer_list<uint32_t> engines) {
  std::vector<TimedReport> reports;
  for (const uint32_t engine : engines) {
    reports.push_back(report(static_cast<double>(reports.size()), kA, 100));
    reports.back().fields.nid_engine = engine;
  }
  return reports;
}

TEST(OneTrain, ReportsOfOthersInTheLogAreLeftOutAndTold) {
  const auto one = core::value_or_throw(of_one_train(of({1, 1}), of({1, 2, 1, 3})));
  EXPECT_THAT(one.certified, SizeIs(2));
  EXPECT_EQ(one.remark, "2 certified reports are of other trains (2 beside NID_ENGINE 1), left out");
}

TEST(OneTrain, AnotherNumberOnTheOtherSideIsAsked) {
  EXPECT_EQ(core::value_or_throw(of_one_train(of({1}), of({1, 1}))).remark, "");
  const auto other = core::value_or_throw(of_one_train(of({1}), of({777, 777})));
  EXPECT_THAT(other.certified, SizeIs(2));
  EXPECT_THAT(other.remark, HasSubstr("NID_ENGINE is 1 in ours and 777 in the certified reports"));
}

TEST(OneTrain, WhereNobodyKnowsWhichTrainItIsNothingIsCompared) {
  EXPECT_THAT(of_one_train(of({1, 2}), of({1})).error().message, HasSubstr("ours are reports of several trains"));
  EXPECT_THAT(of_one_train(of({4}), of({1, 2, 3, 5, 6, 7, 8})).error().message,
              HasSubstr("NID_ENGINE 1, 2, 3, 5, 6 and 2 more, and ours of none of them, NID_ENGINE 4"));
}

}  // namespace
}  // namespace railfix::compare
