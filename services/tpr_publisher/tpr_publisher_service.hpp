// train_state and onboard_status in, train_position_report out.
#pragma once

#include <memory>
#include <optional>
#include <string>

#include "messaging/onboard_topic.hpp"
#include "service/data_time.hpp"
#include "service/service.hpp"
#include "tpr_publisher/told_parameters.hpp"
#include "tpr_publisher/tpr_publisher_config.hpp"

namespace railfix::tpr_publisher {

class TprPublisherService {
 public:
  using Config = TprPublisherConfig;
  TprPublisherService(const Config& config, service::Context& context);

 private:
  void on_state(const msg::TrainState& state);
  void on_onboard(const msg::OnboardStatus& status);
  void on_tick();
  void notice_gap();
  /// `just_come`: it did not stand in an onboard_status of some seconds ago.
  void hear_packet_58(const msg::OnboardStatus& status, bool just_come);
  void remember();
  /// `taken`: one is used from now on.
  void note_packet_58(bool taken);
  /// For a later process.
  void keep_notes();
  void go_on_with_trainborne(int64_t stamp_ns);
  void share_charge();
  void hear_other(const msg::TrainPositionReport& report);
  void say_what_is_assumed();
  [[nodiscard]] int fitness() const;
  /// Not in charge: works along and sends nothing.
  void stand_by(const msg::TrainState& state, int64_t now_ns);
  void restart();
  /// Now, in the time of the data: the host's clock on a train, what data_clock says where data is played.
  [[nodiscard]] int64_t now_ns(int64_t stamp_ns) const;
  void send(const Report& report, int64_t grabbed_ns);
  void to_ground(const Report& report);
  /// What is wrong with the reports, and with the way to the ground, as status and log.
  void show();

  service::Context& context_;
  Settings settings_;
  std::shared_ptr<const track::Map> map_;  // nullptr = none is set
  TprPublisher publisher_;
  ToldParameters told_;
  std::string kept_;                // of told_ and T_TRAIN, as a later process finds it
  int64_t kept_trainborne_ns_ = 0;  // of the process before, until it is used
  messaging::Writer<msg::TrainPositionReport> writer_;
  std::optional<service::DataTime> data_time_;  // of played data
  bool state_seen_ = false;
  int64_t state_monotonic_ns_ = 0;  // when the last one came
  int64_t listens_until_ns_ = 0;    // sends nothing before
  bool reference_known_ = false;    // in the last report
  int ticks_unheard_ = 0;           // until it was looked whether onboard_status has come
  uint64_t seq_ = 0;
  std::unique_ptr<GroundLink> ground_link_;  // nullptr = no broker
  std::string report_trouble_;
  std::string remark_;           // of the ground link, as it was logged
  std::string onboard_refusal_;  // empty = used
};

}  // namespace railfix::tpr_publisher
