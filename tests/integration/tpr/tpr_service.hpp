// The service program with a train around it: writes states, hears reports and status.
#pragma once

#include <gmock/gmock.h>

#include <filesystem>

#include "core/time.hpp"
#include "core/units.hpp"
#include "etcs/train_position_report.hpp"
#include "messaging/topics.hpp"
#include "support/network.hpp"
#include "support/program.hpp"
#include "unit/tpr_publisher/balise_map.hpp"

namespace railfix {

namespace topics = messaging::topics;

inline constexpr int kDomain = 79;
inline constexpr int64_t kPatienceNs = 60 * core::kNsPerSecond;
inline constexpr int64_t kPeriodNs = 20'000'000;

class TprService : public ::testing::Test {
 protected:
  TprService()
      : train_("tpr-" + std::to_string(getpid())),
        map_file_(std::filesystem::temp_directory_path() / (train_ + ".map")),
        participant_(test::network(train_, kDomain)),
        states_(participant_, topics::train_state),
        reports_reader_(participant_, topics::train_position_report, "", queue_,
                        [this](const msg::TrainPositionReport& report) { reports_.push_back(report); }),
        status_reader_(participant_, topics::service_status, "", queue_,
                       [this](const msg::ServiceStatus& status) { status_ = status; }) {
    core::ok_or_throw(tpr_publisher::testing::balise_map()->save(map_file_));
  }
  ~TprService() override {
    std::filesystem::remove(map_file_);
    std::filesystem::remove(notes_file());
  }
  [[nodiscard]] std::string notes_file() const { return "/dev/shm/railfix-notes-" + train_ + "-local-tpr_publisher"; }

  [[nodiscard]] std::vector<std::string> service(const std::vector<std::string>& more = {}) const {
    std::vector<std::string> settings{"common.train_id=" + train_,       "common.domain=" + std::to_string(kDomain),
                                      "common.log_level=error",          "tpr_publisher.map=" + map_file_.string(),
                                      "tpr_publisher.foot_to_front_m=2", "tpr_publisher.nid_engine=4711"};
    settings.insert(settings.end(), more.begin(), more.end());
    return test::with_settings("railfix-tpr-publisher", settings);
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
        next_ns = now_ns + kPeriodNs;
      }
      queue_.run_one(next_ns);
    }
    return true;
  }
  void write_state(double offset_m, int64_t age_ns = 0, double speed_mps = 20, double easting_m = 0) {
    msg::TrainState state;
    state.stamp_ns(core::wall_ns() - age_ns);
    state.seq(seq_++);
    state.edge(1);
    state.offset_m(offset_m);
    state.distance_m(offset_m);
    state.direction(msg::DIRECTION_FORWARD);
    state.track_known(1);
    state.track_probability(1);
    state.speed_mps(speed_mps);
    state.standstill(speed_mps == 0 ? 1 : 0);
    state.easting_m(easting_m);
    state.heading_rad(core::kPi / 2);  // the line runs eastwards
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
  messaging::Reader<msg::TrainPositionReport> reports_reader_;
  messaging::Reader<msg::ServiceStatus> status_reader_;
  std::vector<msg::TrainPositionReport> reports_;
  std::optional<msg::ServiceStatus> status_;
  uint64_t seq_ = 0;
};

}  // namespace railfix
