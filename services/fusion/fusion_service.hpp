// DDS side of the fusion: sensors, odometry steps and position fixes in, train_state and train_pose out.
#pragma once

#include <memory>
#include <optional>

#include "fusion/fusion.hpp"
#include "fusion/fusion_config.hpp"
#include "fusion/fusion_notes.hpp"
#include "fusion/handover.hpp"
#include "fusion/map_extent.hpp"
#include "fusion/scale_file.hpp"
#include "fusion/train_pose.hpp"
#include "service/data_time.hpp"
#include "service/left_out.hpp"
#include "service/service.hpp"

namespace railfix::fusion {

class FusionService {
 public:
  using Config = FusionConfig;
  FusionService(const FusionConfig& config, service::Context& context);

 private:
  void listen(const FusionConfig& config);
  void restart(int64_t data_ns);
  void use(const Event& event, int64_t grabbed_ns);
  void note_left_out(const Event& event, const FusionCounts& before);
  void leave_out(const std::string& topic, const char* why);
  [[nodiscard]] std::string left_out() const;
  void use(const msg::PositionFix& fix);
  void use_gnss(const msg::GnssFix& sample);
  void keep_time(const msg::DataClock& clock);
  void tick();
  void publish(const TrainEstimate& measured, int64_t grabbed_ns);
  void send(const msg::TrainState& state);
  void publish_pose(const TrainEstimate& estimate);
  void share_charge();
  void charge_changed(bool taken);
  /// From the one in charge, while this one stands by.
  void hear(const msg::TrainState& state);
  bool tell_other_map(const msg::TrainState& state);
  void keep(const msg::TrainState& state);
  void begin_anew();
  /// Of a train that was under way when this one began: nobody knows where it is.
  void forget_start();
  [[nodiscard]] bool stands_at_start(const TrainEstimate& estimate);
  [[nodiscard]] TrainEstimate said_of(const TrainEstimate& measured) const;
  [[nodiscard]] bool is_played() const;
  bool take_over(const TrainEstimate& first);
  bool catches_up(double behind_s);

  FusionConfig config_;
  service::Context& context_;
  messaging::Writer<msg::TrainState> writer_;
  messaging::Writer<msg::TrainPose> pose_writer_;
  std::shared_ptr<const track::Map> map_;
  std::optional<MapExtent> extent_;  // from the first GNSS on
  ScaleFile scale_file_;
  std::optional<Fusion> fusion_;
  TrainPose pose_;
  std::string kept_for_;                        // map and start that the notes are for
  std::optional<service::DataTime> data_time_;  // of played data
  std::optional<int64_t> begun_ns_;  // stamp of the first measurement, when the train stood at the configured start
  int64_t newest_stamp_ns_ = 0;      // of the data ...
  int64_t newest_came_ns_ = 0;       // ... and when it was seen, monotonic
  bool no_projection_told_ = false;
  bool other_map_told_ = false;
  service::LeftOut left_out_;
  uint64_t seq_ = 0;
  std::optional<msg::TrainState> latest_;  // of this fusion, sent or not
  std::optional<KnownState> known_;        // by another one, not taken over yet
  bool in_doubt_ = false;                  // the place that is sent now
  std::optional<int64_t> behind_since_ns_;
  bool begun_anew_ = false;      // known_ is to be used in the new one
  bool learnt_ = false;          // nothing more to take over
  bool believes_start_ = false;  // no other fusion of this ride was heard of yet
  bool start_seen_ = false;      // the train's first speed
  int64_t heard_ns_ = 0;         // stamp of the newest state of the one in charge
  int64_t kept_ns_ = 0;
  double distance_offset_m_ = 0;  // of what is sent to what has been measured here
  int fitness_ = 0;
};

}  // namespace railfix::fusion
