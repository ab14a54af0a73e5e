// The service program itself, over DDS: states in, reports and status out.
#include <gmock/gmock.h>

#include <algorithm>

#include "etcs/report_parameters.hpp"
#include "integration/tpr/tpr_service.hpp"
#include "messaging/onboard_topic.hpp"

namespace railfix {
namespace {

using ::testing::ContainsRegex;
using ::testing::HasSubstr;

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

TEST_F(TprService, AStateOfAnotherMapIsNoPlace) {
  test::Program program(service());
  ASSERT_TRUE(run_until([&] { return connected(); }, [] {}));
  ASSERT_TRUE(run_until([&] { return reports_.size() == 1; }, [&] { write_state(450, 0, 20, 9000); }));
  EXPECT_EQ(reports_[0].nid_lrbg(), etcs::kUnknownBaliseGroup);
  ASSERT_TRUE(run_until([&] { return !reason().empty(); }, [&] { write_state(450, 0, 20, 9000); }));
  EXPECT_THAT(reason(), HasSubstr("of another map"));
  ASSERT_TRUE(run_until([&] { return reports_.size() == 2; }, [&] { write_state(450, 0, 20, 450); }));
  EXPECT_EQ(reports_[1].nid_lrbg(), tpr_publisher::testing::kB);
}

// What the on-board unit says goes over DDS into the very next report, and back out when it falls silent.
TEST_F(TprService, TakesModeLevelAndIntegrityFromTheOnboardUnit) {
  messaging::Writer<msg::OnboardStatus> onboard(participant_, topics::onboard_status);
  test::Program program(service());
  ASSERT_TRUE(run_until([&] { return connected() && onboard.matched_readers() > 0; }, [] {}));
  ASSERT_TRUE(run_until([&] { return reports_.size() == 1; }, [&] { write_state(450); }));
  const auto last = [&] {
    const auto& report = reports_.back();
    return etcs::decode({report.message().data(), report.message_bytes()}, etcs::Baseline::b3).value();
  };
  EXPECT_EQ(last().q_length, 0U);
  msg::OnboardStatus status;
  const auto say = [&] {
    status.stamp_ns(core::wall_ns());
    onboard.write(status);
  };
  status.m_mode(1);  // on sight
  status.m_level(etcs::kLevel2);
  say();
  const auto reported = [&](uint8_t reason) {
    return run_until([&] { return reports_.back().reason() == reason; }, [&] { write_state(450); });
  };
  ASSERT_TRUE(reported(msg::REPORT_MODE));
  EXPECT_EQ(last().m_mode, 1U);
  status.m_level(0);
  say();
  ASSERT_TRUE(reported(msg::REPORT_LEVEL));
  EXPECT_EQ(last().m_level, 0U);
  status.q_integrity(2);  // the driver, just now
  status.integrity_ns(core::wall_ns());
  status.train_length_m(200);
  say();
  ASSERT_TRUE(reported(msg::REPORT_INTEGRITY_CONFIRMED));
  ASSERT_TRUE(run_until([&] { return last().q_length == 2; },
                        [&] {
                          status.integrity_ns(core::wall_ns());
                          say();
                          write_state(450);
                        }));
  // From the front (2 m before the foot) back over length, over-reading amount and Q_LOCACC.
  ASSERT_TRUE(last().l_trainint.has_value());
  EXPECT_GE(*last().l_trainint, 200U + 3U);
  EXPECT_LE(*last().l_trainint, 200U + 3U + 5U + 1U);
  status.q_integrity(3);
  say();
  ASSERT_TRUE(reported(msg::REPORT_INTEGRITY_LOST));
  EXPECT_EQ(last().q_length, 3U);
  status.reports_wanted(1);
  status.wanted_because(msg::REPORT_SESSION);
  say();
  ASSERT_TRUE(reported(msg::REPORT_SESSION));
  status.q_integrity(9);  // no such value: told, and the old one stays
  say();
  ASSERT_TRUE(
      run_until([&] { return reason().find("q_integrity is 9") != std::string::npos; }, [&] { write_state(450); }));
  EXPECT_EQ(program.end(SIGTERM), 0);
}

/// Standard input of a program that is started while this lives.
class StandardInput {
 public:
  StandardInput() {
    if (pipe(ends_) != 0) throw std::runtime_error("pipe");
    kept_ = dup(STDIN_FILENO);
    dup2(ends_[0], STDIN_FILENO);
    fcntl(ends_[1], F_SETFD, FD_CLOEXEC);
  }
  ~StandardInput() {
    dup2(kept_, STDIN_FILENO);
    for (const int end : {kept_, ends_[0], ends_[1]}) close(end);
  }
  StandardInput(const StandardInput&) = delete;
  StandardInput& operator=(const StandardInput&) = delete;
  void say(const std::string& line) const {
    ASSERT_EQ(write(ends_[1], (line + "\n").data(), line.size() + 1), static_cast<ssize_t>(line.size() + 1));
  }

 private:
  int ends_[2] = {-1, -1};
  int kept_ = -1;
};

TEST_F(TprService, AValueOfTheOnboardUnitThatIsNoneTakesNothingAlong) {
  messaging::Writer<msg::OnboardStatus> onboard(participant_, topics::onboard_status);
  test::Program program(service());
  ASSERT_TRUE(run_until([&] { return connected() && onboard.matched_readers() > 0; }, [] {}));
  ASSERT_TRUE(run_until([&] { return reports_.size() == 1; }, [&] { write_state(450); }));
  msg::OnboardStatus status;
  status.stamp_ns(core::wall_ns());
  status.m_mode(2);
  status.m_level(etcs::kLevel2);
  status.q_integrity(etcs::kIntegrityLost);
  status.active_cab(7);
  status.reports_wanted(1);  // for no reason that there is
  onboard.write(status);
  ASSERT_TRUE(run_until([&] { return reports_.size() == 2 && !reason().empty(); }, [&] { write_state(450); }));
  EXPECT_THAT(reason(), ::testing::HasSubstr("Not all of onboard_status is used: active_cab is 7, not 0 to 2."));
  const auto& report = reports_.back();
  const auto said = etcs::decode({report.message().data(), report.message_bytes()}, etcs::Baseline::b3).value();
  EXPECT_EQ(said.m_mode, 2U);
  EXPECT_EQ(said.q_length, uint32_t{etcs::kIntegrityLost});
}

TEST_F(TprService, ThatModeAndLevelAreAssumedStandsInTheLog) {
  const auto log = std::filesystem::temp_directory_path() / (train_ + ".log");
  test::Program program(service({"common.log_level=warning"}), {{}, log, {}});
  ASSERT_TRUE(run_until([&] { return connected(); }, [] {}));
  const auto said = [&] { return test::slurp(log).find("nobody has sent onboard_status") != std::string::npos; };
  EXPECT_TRUE(run_until(said, [&] { write_state(450); })) << test::slurp(log);
  std::filesystem::remove(log);
}

// The clock of the other host is 5 s ahead, as its reports say.
TEST_F(TprService, TrainborneTimeGoesOnWhereTheOtherOneReported) {
  messaging::Writer<msg::TrainPositionReport> other(participant_, topics::train_position_report);
  test::Program program(service({"common.ownership_strength=1", "tpr_publisher.t_cycloc_s=1"}));
  ASSERT_TRUE(run_until([&] { return connected() && other.matched_readers() > 1; }, [] {}));
  const auto t_train = [](const msg::TrainPositionReport& report) {
    return etcs::decode({report.message().data(), report.message_bytes()}, etcs::Baseline::b3).value().t_train;
  };
  ASSERT_TRUE(run_until([&] { return !reports_.empty(); }, [&] { write_state(450); }));
  auto ahead = reports_.back();
  auto fields = etcs::decode({ahead.message().data(), ahead.message_bytes()}, etcs::Baseline::b3).value();
  fields.t_train += 500;
  const auto bytes = etcs::encode(fields, etcs::Baseline::b3).value();
  std::ranges::copy(bytes, ahead.message().begin());
  ahead.seq(ahead.seq() + 100);
  other.write(ahead);
  ASSERT_TRUE(run_until([&] { return reports_.back().seq() > ahead.seq(); }, [&] { write_state(450); }));
  EXPECT_GT(t_train(reports_.back()), fields.t_train);
}

// `railfix tpr onboard` in place of the on-board unit: the command line, then lines on its standard input.
TEST_F(TprService, HearsTheOnboardCommand) {
  test::Program program(service({"tpr_publisher.t_cycloc_s=1"}));
  ASSERT_TRUE(run_until([&] { return connected(); }, [] {}));
  ASSERT_TRUE(run_until([&] { return reports_.size() == 1; }, [&] { write_state(450); }));
  const StandardInput input;
  test::Program onboard(
      {"railfix", "tpr", "onboard", "mode=OS", "level=1", "--train", train_, "--domain", std::to_string(kDomain)});
  const auto reported = [&](uint8_t reason) {
    return run_until([&] { return reports_.back().reason() == reason; }, [&] { write_state(450); });
  };
  const auto last = [&] {
    const auto& report = reports_.back();
    return etcs::decode({report.message().data(), report.message_bytes()}, etcs::Baseline::b3).value();
  };
  ASSERT_TRUE(reported(msg::REPORT_MODE));
  EXPECT_EQ(last().m_mode, 1U);
  EXPECT_EQ(last().m_level, etcs::kLevel1);
  input.say("no such word");
  input.say("level=NTC ntc=20");
  ASSERT_TRUE(reported(msg::REPORT_LEVEL));
  EXPECT_EQ(last().nid_ntc, 20U);
  input.say("integrity=driver length=200 packet_58=3A80908303E82103E9");
  ASSERT_TRUE(reported(msg::REPORT_INTEGRITY_CONFIRMED));
  const auto kept = [&] { return test::slurp(notes_file()); };
  EXPECT_THAT(kept(), HasSubstr("3A80908303E82103E9"));
  input.say("packet_58=none");
  ASSERT_TRUE(run_until([&] { return kept().starts_with('\n'); }, [&] { write_state(450); }))
      << "it does not outlive the service";
  input.say("report=session");
  ASSERT_TRUE(reported(msg::REPORT_SESSION));
  ASSERT_TRUE(run_until([&] { return last().q_length == 2; }, [&] { write_state(450); }));
  EXPECT_GE(last().l_trainint.value_or(0), 200U);
  input.say("integrity=lost");
  ASSERT_TRUE(reported(msg::REPORT_INTEGRITY_LOST));
  input.say("cab=other");  // nobody has said where that end is
  ASSERT_TRUE(reported(msg::REPORT_START));
  EXPECT_EQ(last().nid_lrbg, etcs::kUnknownBaliseGroup);
  EXPECT_TRUE(run_until([&] { return reason().find("foot_to_rear_m is not set") != std::string::npos; },
                        [&] { write_state(450); }));
  input.say("cab=camera");
  ASSERT_TRUE(run_until([&] { return last().nid_lrbg == tpr_publisher::testing::kB; }, [&] { write_state(450); }));
  EXPECT_EQ(onboard.end(SIGTERM), 0);
  EXPECT_TRUE(run_until([&] { return reason().find("onboard_status is silent") != std::string::npos; },
                        [&] { write_state(450); }));
}

// As if the clock had been set back by an hour between the two processes.
TEST_F(TprService, TrainborneTimeIsLaterThanOfTheProcessBefore) {
  const auto each = [&] { write_state(450); };
  const auto steps = [](int64_t time_ns) { return time_ns / 10'000'000 % etcs::kUnknownTime; };
  const auto t_train = [&] {
    const auto& report = reports_.back();
    return etcs::decode({report.message().data(), report.message_bytes()}, etcs::Baseline::b3).value().t_train;
  };
  auto program = std::make_unique<test::Program>(service());
  ASSERT_TRUE(run_until([&] { return connected(); }, [] {}));
  ASSERT_TRUE(run_until([&] { return !reports_.empty(); }, each));
  const auto kept = [&] { return test::slurp(notes_file()); };
  ASSERT_TRUE(run_until([&] { return kept().size() > 1; }, each));
  const int64_t said_ns = std::stoll(kept());
  EXPECT_EQ(t_train(), steps(said_ns));
  program.reset();
  ASSERT_TRUE(run_until([&] { return states_.matched_readers() == 0; }, [] {}));
  const int64_t later_ns = said_ns + 3600 * core::kNsPerSecond;
  std::ofstream(notes_file()) << '\n' << later_ns;
  const size_t before = reports_.size();
  program = std::make_unique<test::Program>(service());
  ASSERT_TRUE(run_until([&] { return connected() && states_.matched_readers() > 0; }, [] {}));
  ASSERT_TRUE(run_until([&] { return reports_.size() > before; }, each));
  EXPECT_EQ(t_train(), steps(later_ns) + 1);
}

// The trackside sends it once, with locations that count from the LRBG of that moment. It outlives the service, with
// its LRBG; of one that came while the service was down nobody knows where its locations are.
TEST_F(TprService, KeepsPacket58AndTheBaliseGroupThatItCountsFrom) {
  messaging::Writer<msg::OnboardStatus> onboard(participant_, topics::onboard_status);
  std::string said;
  double offset_m = 450;
  const auto go_on = [&](double to_m) {
    msg::OnboardStatus status;
    const auto packet = said.empty() ? std::vector<uint8_t>{} : etcs::parse_hex(said).value();
    std::ranges::copy(packet, status.packet_58().begin());
    status.packet_58_bytes(static_cast<uint32_t>(packet.size()));
    status.m_level(etcs::kLevel2);
    status.stamp_ns(core::wall_ns());
    onboard.write(status);
    write_state(offset_m = std::min(offset_m + 4, to_m));
  };
  const auto says = [&](const std::string& what) {
    return run_until([&] { return reason().find(what) != std::string::npos; }, [&] { go_on(450); });
  };
  auto program = std::make_unique<test::Program>(service());
  const auto begin_again = [&](const std::string& packet) {
    program->end(SIGKILL);
    ASSERT_TRUE(run_until([&] { return states_.matched_readers() == 0; }, [] {}));
    reports_.clear();
    said = packet;
    program = std::make_unique<test::Program>(service());
  };
  ASSERT_TRUE(run_until([&] { return connected() && onboard.matched_readers() > 0; }, [] {}));
  said = "3A80";
  ASSERT_TRUE(says("ends inside"));
  said = "3A80908303E82103E9";  // T_CYCLOC 6 s, D_CYCLOC 1000 m, a location 500 m beyond the LRBG, which is B at 400 m
  ASSERT_TRUE(run_until([&] { return reason().empty(); }, [&] { go_on(450); }));
  for (const bool still_said : {true, false}) {
    begin_again(still_said ? said : "");
    offset_m = 750;  // beyond C
    ASSERT_TRUE(run_until([&] { return !reports_.empty(); }, [&] { go_on(750); }));
    ASSERT_TRUE(run_until([&] { return reports_.back().reason() == msg::REPORT_LOCATION; }, [&] { go_on(950); }));
    EXPECT_EQ(reports_.back().nid_lrbg(), tpr_publisher::testing::kC);
    EXPECT_NEAR(reports_.back().d_lrbg_m(), 200 - 4, 4.1) << "the front end may be 4 m farther than it seems";
  }
  auto other = etcs::decode_report_parameters(etcs::parse_hex("3A80908303E82103E9").value()).value();
  other.locations[0].d_loc = 100;
  begin_again(etcs::to_hex(etcs::encode(other).value()));
  offset_m = 450;
  EXPECT_TRUE(says("No reports at the locations of packet 58"));
}

// The on-board unit says it once, before the train's direction is known, and is silent from then on.
TEST_F(TprService, Packet58ForOneDirectionWaitsForItAndOutlivesTheService) {
  messaging::Writer<msg::OnboardStatus> onboard(participant_, topics::onboard_status);
  etcs::ReportParameters parameters;
  parameters.q_dir = etcs::kReverse;  // of group B, which looks against the edge
  parameters.locations = {{150, 1}};
  auto program = std::make_unique<test::Program>(service());
  ASSERT_TRUE(run_until([&] { return connected() && onboard.matched_readers() > 0; }, [] {}));
  msg::OnboardStatus status;
  const auto say = [&] {
    status.m_level(etcs::kLevel2);
    status.stamp_ns(core::wall_ns());
    onboard.write(status);
  };
  double offset_m = 50;  // before the first group
  const auto wait_there = [&] { write_state(offset_m); };
  ASSERT_TRUE(run_until([&] { return !reports_.empty(); }, wait_there));
  status.m_mode(1);
  say();
  ASSERT_TRUE(run_until([&] { return reports_.back().reason() == msg::REPORT_MODE; }, wait_there));
  const auto packet = etcs::encode(parameters).value();
  std::ranges::copy(packet, status.packet_58().begin());
  status.packet_58_bytes(static_cast<uint32_t>(packet.size()));
  say();  // it has just come
  ASSERT_TRUE(
      run_until([&] { return reason().find("the train's is not known yet") != std::string::npos; }, wait_there));
  offset_m = 405;
  ASSERT_TRUE(run_until([&] { return reason().find("packet 58") == std::string::npos; }, wait_there));
  int more = 10;  // the LRBG that its locations count from is kept with the next state
  ASSERT_TRUE(run_until([&] { return more == 0; },
                        [&] {
                          wait_there();
                          --more;
                        }));
  program->end(SIGKILL);
  ASSERT_TRUE(run_until([&] { return states_.matched_readers() == 0; }, [] {}));
  reports_.clear();
  program = std::make_unique<test::Program>(service());
  offset_m = 450;
  ASSERT_TRUE(run_until([&] { return !reports_.empty(); }, wait_there));
  ASSERT_TRUE(run_until([&] { return reports_.back().reason() == msg::REPORT_LOCATION; },
                        [&] { write_state(offset_m = std::min(offset_m + 2, 600.0)); }));
  for (const auto& report : reports_) EXPECT_NE(report.reason(), msg::REPORT_CYCLE_TIME) << "that is the keys'";
}

}  // namespace
}  // namespace railfix
