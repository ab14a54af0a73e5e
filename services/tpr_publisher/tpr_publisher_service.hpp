// train_state in, train_position_report out.
#pragma once

#include <optional>
#include <string>

#include "service/service.hpp"
#include "tpr_publisher/tpr_publisher_config.hpp"

namespace railfix::tpr_publisher {

class TprPublisherService {
 public:
  using Config = TprPublisherConfig;
  TprPublisherService(const Config& config, service::Context& context);

 private:
  void on_state(const msg::TrainState& state);
  void on_tick();
  /// Now, in the time of the data: the host's clock on a train, what data_clock says where data is played.
  [[nodiscard]] int64_t now_ns(int64_t stamp_ns) const;
  void send(const Report& report, int64_t grabbed_ns);
  void show(const std::string& degraded_by);

  service::Context& context_;
  bool has_map_;
  etcs::Baseline baseline_;
  TprPublisher publisher_;
  messaging::Writer<msg::TrainPositionReport> writer_;
  std::optional<msg::DataClock> data_clock_;
  bool state_seen_ = false;
  bool reference_known_ = false;  // in the last report
  uint64_t seq_ = 0;
  std::string degraded_by_;
};

}  // namespace railfix::tpr_publisher
