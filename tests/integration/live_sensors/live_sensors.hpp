// sensor_gateway as a program with live sensors, and what it sends.
#pragma once

#include <gmock/gmock.h>

#include "support/on_train.hpp"
#include "support/program.hpp"
#include "support/pseudo_terminal.hpp"
#include "unit/dataset/temporary_folder.hpp"

namespace railfix {

class LiveSensors : public railfix::testing::TemporaryFolder, protected test::OnTrain {
 protected:
  static constexpr int kDomain = 84;
  LiveSensors() : OnTrain("sensors-" + std::to_string(getpid()), kDomain) {
    listen(messaging::topics::gnss_fix, [this](const msg::GnssFix& one) { fixes_.push_back(one); });
    listen(messaging::topics::service_status, [this](const msg::ServiceStatus& status) { status_ = status; });
  }

  std::unique_ptr<test::Program> gateway(std::vector<std::string> more) {
    std::vector<std::string> sets{"common.train_id=" + train_, "common.domain=" + std::to_string(kDomain),
                                  "common.log_level=error", "sensor_gateway.source=live",
                                  "sensor_gateway.live.reconnect_s=0.2"};
    sets.insert(sets.end(), more.begin(), more.end());
    return std::make_unique<test::Program>(test::with_settings("railfix-sensor-gateway", sets));
  }
  [[nodiscard]] std::string reason() const { return status_.reason().c_str(); }
  bool told(const std::string& part) {
    return run_until(
        [&] { return status_.state() == msg::STATE_DEGRADED && reason().find(part) != std::string::npos; });
  }
  bool active() {
    return run_until([this] { return status_.state() == msg::STATE_ACTIVE; });
  }
  template <class Samples>
  static void expect_growing(const Samples& samples) {
    for (size_t i = 1; i < samples.size(); ++i) {
      EXPECT_GT(samples[i].stamp_ns(), samples[i - 1].stamp_ns()) << i;
      EXPECT_EQ(samples[i].seq(), samples[i - 1].seq() + 1) << i;
    }
  }

  std::vector<msg::GnssFix> fixes_;
  msg::ServiceStatus status_;
};

}  // namespace railfix
