// 4.0.0: of two tpr_publishers only one says a confirmation of train integrity.
#include <algorithm>
#include <limits>

#include "integration/tpr/tpr_service.hpp"
#include "messaging/onboard_topic.hpp"

namespace railfix {
namespace {

etcs::TrainPositionReport four(const msg::TrainPositionReport& report) {
  return etcs::decode({report.message().data(), report.message_bytes()}, etcs::Baseline::b4).value();
}

// A speed that is not known holds this one's report back until the other one's has been heard: then T_TRAIN of that one
// stands in the notes.
TEST_F(TprService, DoesNotRepeatAConfirmationThatTheOtherOneReported) {
  messaging::Writer<msg::TrainPositionReport> other(participant_, topics::train_position_report);
  messaging::Writer<msg::OnboardStatus> onboard(participant_, topics::onboard_status);
  test::Program program(
      service({"common.ownership_strength=1", "tpr_publisher.baseline=4", "tpr_publisher.t_cycloc_s=255"}));
  ASSERT_TRUE(
      run_until([&] { return connected() && other.matched_readers() > 1 && onboard.matched_readers() > 0; }, [] {}));
  ASSERT_TRUE(run_until([&] { return !reports_.empty(); }, [&] { write_state(450); }));
  msg::OnboardStatus status;
  status.m_level(etcs::kLevel2);
  status.q_integrity(etcs::kConfirmedByDriver);
  status.train_length_m(200);
  status.integrity_ns(core::wall_ns());
  const auto held_back = [&] {
    status.stamp_ns(core::wall_ns());
    onboard.write(status);
    write_state(450, 0, std::numeric_limits<double>::quiet_NaN());
  };
  ASSERT_TRUE(run_until([&] { return reason().find("the speed is not known") != std::string::npos; }, held_back));
  auto said = reports_.back();
  auto fields = four(said);
  fields.t_train += 6000;
  fields.q_length = etcs::kConfirmedByDriver;
  fields.l_trainint = 220;
  const auto bytes = etcs::encode(fields, etcs::Baseline::b4).value();
  std::ranges::copy(bytes, said.message().begin());
  said.message_bytes(static_cast<uint32_t>(bytes.size()));
  said.stamp_ns(core::wall_ns());
  said.sent_ns(said.stamp_ns());
  said.seq(said.seq() + 100);
  other.write(said);
  const auto noted_steps = [&] {
    const auto notes = test::slurp(notes_file());
    return notes.size() > 1 ? static_cast<uint32_t>(std::stoll(notes) / 10'000'000 % etcs::kUnknownTime) : 0;
  };
  ASSERT_TRUE(run_until([&] { return noted_steps() == fields.t_train; }, held_back));
  ASSERT_TRUE(run_until([&] { return reports_.back().seq() > said.seq(); }, [&] { write_state(450); }));
  EXPECT_EQ(four(reports_.back()).q_length, etcs::kNoIntegrityInformation);
}

}  // namespace
}  // namespace railfix
