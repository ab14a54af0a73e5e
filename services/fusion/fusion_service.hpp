// DDS side of the fusion: sensors, odometry steps and position fixes in, train_state and train_pose out.
#pragma once

#include <memory>
#include <optional>

#include "fusion/fusion.hpp"
#include "fusion/fusion_config.hpp"
#include "fusion/train_pose.hpp"
#include "service/service.hpp"

namespace railfix::fusion {

class FusionService {
 public:
  using Config = FusionConfig;
  FusionService(const FusionConfig& config, service::Context& context);

 private:
  void listen(const FusionConfig& config);
  void use(const Event& event, int64_t grabbed_ns);
  void use_gnss(const msg::GnssFix& sample);
  void keep_time(const msg::DataClock& clock);
  void tick();
  void publish(const TrainEstimate& estimate, int64_t grabbed_ns);
  void publish_pose(const TrainEstimate& estimate);

  service::Context& context_;
  messaging::Writer<msg::TrainState> writer_;
  messaging::Writer<msg::TrainPose> pose_writer_;
  std::shared_ptr<const track::Map> map_;
  std::optional<Fusion> fusion_;
  TrainPose pose_;
  std::optional<msg::DataClock> clock_;
  bool live_ = false;
  bool no_projection_told_ = false;
  uint64_t seq_ = 0;
};

}  // namespace railfix::fusion
