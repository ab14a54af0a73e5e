// The service program itself, over DDS: states in, reports and status out.
#include <gmock/gmock.h>

#include <filesystem>

#include "core/time.hpp"
#include "etcs/train_position_report.hpp"
#include "messaging/topics.hpp"
#include "support/program.hpp"
#include "unit/tpr_publisher/balise_map.hpp"

namespace railfix {
namespace {

using ::testing::ContainsRegex;
using ::testing::HasSubstr;
namespace topics = messaging::topics;

constexpr int kDomain = 79;
constexpr int64_t kPatienceNs = 15 * core::kNsPerSecond;
constexpr int64_t kPeriodNs = 20'000'000;

class TprService : public ::testing::Test {
 protected:
  TprService()
      : train_("tpr-" + std::to_string(getpid())),
        map_file_(std::filesystem::temp_directory_path() / (train_ + ".map")),
        participant_(options(train_)),
        states_(participant_, topics::train_state),
        commands_(participant_, topics::service_control),
        reports_reader_(participant_, topics::train_position_report, "", queue_,
                        [this](const msg::TrainPositionReport& report) { reports_.push_back(report); }),
        status_reader_(participant_, topics::service_status, "", queue_,
                       [this](const msg::ServiceStatus& status) { status_ = status; }),
        reply_reader_(participant_, topics::service_reply, "", queue_,
                      [this](const msg::ControlReply& reply) { reply_ = reply.text().c_str(); }) {
    core::ok_or_throw(tpr_publisher::testing::balise_map()->save(map_file_));
  }
  ~TprService() override { std::filesystem::remove(map_file_); }

  static messaging::ParticipantOptions options(const std::string& train) {
    messaging::ParticipantOptions options;
    options.train_id = train;
    options.domain = kDomain;
    return options;
  }
  [[nodiscard]] std::vector<std::string> service() const {
    return test::with_settings("railfix-tpr-publisher",
                               {"common.train_id=" + train_, "common.domain=" + std::to_string(kDomain),
                                "common.log_level=error", "tpr_publisher.map=" + map_file_.string(),
                                "tpr_publisher.foot_to_front_m=2", "tpr_publisher.nid_engine=4711"});
  }
  /// Handles what comes until the condition holds; `each` runs every 20 ms.
  template <class Condition, class Each>
  bool run_until(Condition condition, Each each) {
    const int64_t deadline_ns = core::monotonic_ns() + kPatienceNs;
    int64_t next_ns = core::monotonic_ns();
    while (!condition()) {
      const int64_t now_ns = core::monotonic_ns();
      if (now_ns > deadline_ns) return false;
      if (now_ns >= next_ns) {
        each();
        participant_.assert_liveliness();
        next_ns = now_ns + kPeriodNs;
      }
      queue_.run_one(next_ns);
    }
    return true;
  }
  void write_state(double offset_m, int64_t age_ns = 0) {
    msg::TrainState state;
    state.stamp_ns(core::wall_ns() - age_ns);
    state.seq(seq_++);
    state.edge(1);
    state.offset_m(offset_m);
    state.distance_m(offset_m);
    state.direction(msg::DIRECTION_FORWARD);
    state.track_known(1);
    state.speed_mps(20);
    state.over_m(3);
    state.under_m(4);
    states_.write(state);
  }
  [[nodiscard]] bool connected() const {
    return states_.matched_readers() > 0 && reports_reader_.matched_writers() > 0;
  }
  [[nodiscard]] std::string reason() const { return status_ ? status_->reason().c_str() : ""; }

  std::string train_;
  std::filesystem::path map_file_;
  messaging::Queue queue_;
  messaging::Participant participant_;
  messaging::Writer<msg::TrainState> states_;
  messaging::Writer<msg::ControlRequest> commands_;
  messaging::Reader<msg::TrainPositionReport> reports_reader_;
  messaging::Reader<msg::ServiceStatus> status_reader_;
  messaging::Reader<msg::ControlReply> reply_reader_;
  std::vector<msg::TrainPositionReport> reports_;
  std::optional<msg::ServiceStatus> status_;
  std::string reply_;
  uint64_t seq_ = 0;
};

TEST_F(TprService, ReportsOverTheNetwork) {
  test::Program program(service());
  ASSERT_TRUE(run_until([&] { return connected(); }, [] {}));
  double offset_m = 380;
  ASSERT_TRUE(run_until([&] { return reports_.size() == 2; },
                        [&] { write_state(offset_m = std::min(offset_m + 0.4, 420.0)); }));
  EXPECT_EQ(reports_[0].reason(), msg::REPORT_START);
  EXPECT_EQ(reports_[0].nid_lrbg(), tpr_publisher::testing::kA);
  EXPECT_EQ(reports_[1].reason(), msg::REPORT_BALISE_GROUP);
  for (const auto& report : reports_) {
    const auto fields = etcs::decode({report.message().data(), report.message_bytes()}, etcs::Baseline::b3).value();
    EXPECT_EQ(fields.nid_engine, 4711U);
    EXPECT_EQ(fields.nid_lrbg, report.nid_lrbg());
    EXPECT_DOUBLE_EQ(fields.d_lrbg * etcs::scale_m(fields.q_scale), report.d_lrbg_m());
    EXPECT_LT(report.sent_ns() - report.stamp_ns(), core::kNsPerSecond);
  }
  EXPECT_EQ(reports_[1].nid_lrbg(), tpr_publisher::testing::kB);
  EXPECT_EQ(reports_[1].q_dirlrbg(), etcs::kReverse);
  EXPECT_NEAR(reports_[1].d_lrbg_m(), 2.2, 0.3);  // the front is 2 m in front of the foot
  EXPECT_GE(reports_[1].l_doubtover_m(), 8.0 - 0.05);
  EXPECT_TRUE(
      run_until([&] { return status_ && status_->state() == msg::STATE_ACTIVE; }, [&] { write_state(offset_m); }));
  EXPECT_EQ(program.end(SIGTERM), 0);
}

TEST_F(TprService, OldStatesAreNotReportedAndTheStatusSaysWhy) {
  test::Program program(service());
  ASSERT_TRUE(run_until([&] { return connected(); }, [] {}));
  ASSERT_TRUE(run_until([&] { return status_ && status_->state() == msg::STATE_DEGRADED; },
                        [&] { write_state(450, 3 * core::kNsPerSecond); }));
  EXPECT_THAT(reason(), ContainsRegex("is [0-9.]+ s old, the limit is 1 s"));
  EXPECT_TRUE(reports_.empty());
  ASSERT_TRUE(run_until([&] { return reports_.size() == 1; }, [&] { write_state(450); }));
}

TEST_F(TprService, TakesPacket58FromACommand) {
  test::Program program(service());
  ASSERT_TRUE(run_until([&] { return connected() && commands_.matched_readers() > 0; }, [] {}));
  ASSERT_TRUE(run_until([&] { return reports_.size() == 1; }, [&] { write_state(450); }));
  msg::ControlRequest request;
  request.service("tpr_publisher");
  request.command("packet_58");
  request.argument("3A80");
  commands_.write(request);
  ASSERT_TRUE(run_until([&] { return !reply_.empty(); }, [&] { write_state(450); }));
  EXPECT_THAT(reply_, HasSubstr("ends inside"));
  reply_.clear();
  request.argument("3A80908303E82103E9");  // T_CYCLOC 6 s, D_CYCLOC 1000 m, a location 500 m beyond the LRBG
  commands_.write(request);
  double offset_m = 450;
  ASSERT_TRUE(run_until([&] { return !reply_.empty(); }, [&] { write_state(offset_m); }));
  EXPECT_THAT(reply_, HasSubstr("taken over"));
  ASSERT_TRUE(run_until([&] { return reports_.back().reason() == msg::REPORT_LOCATION; },
                        [&] { write_state(offset_m = std::min(offset_m + 4, 920.0)); }));
  EXPECT_EQ(reports_.back().nid_lrbg(), tpr_publisher::testing::kC);
}

}  // namespace
}  // namespace railfix
