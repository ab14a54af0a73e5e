// Pictures of a camera, dataset, folder or video -> camera_frame, camera_preview, camera_calibration; recorded pictures
// also give data_clock to everyone.
#pragma once

#include <memory>
#include <optional>

#include "dataset/dataset.hpp"
#include "frame_grabber/frame_grabber_config.hpp"
#include "frame_grabber/live_feed.hpp"
#include "frame_grabber/pace.hpp"
#include "frame_grabber/player.hpp"
#include "messaging/lock_step.hpp"
#include "service/service.hpp"

namespace railfix::frame_grabber {

class FrameGrabberService {
 public:
  using Config = FrameGrabberConfig;
  FrameGrabberService(const Config& config, service::Context& context);

 private:
  void prepare_recorded();
  void prepare_live();
  core::Result<std::string> start();
  void shoot(const RawPicture& picture);
  void say_packets(uint64_t bad_packets);
  [[nodiscard]] std::optional<int64_t> began_ns() const;
  void play(const dataset::Picture& picture);
  void give_turn();
  void answered(const msg::DataProgress& progress);
  void publish(const RawPicture& picture, int64_t grabbed_ns);
  void publish_preview(const RawPicture& picture, int64_t grabbed_ns, uint32_t health);
  void publish_calibration(const std::optional<dataset::CameraCalibration>& calibration);
  void publish_clock(int64_t data_ns, int64_t wall_ns, bool ended);
  void say_health(uint32_t health);
  void broken(const std::string& why);
  void end();
  void start_when_connected();
  void check_wait();
  void finish_after_last_words();
  [[nodiscard]] bool lossless() const { return config_.pace == "lossless"; }

  Config config_;
  service::Context& context_;
  std::unique_ptr<dataset::PictureSource> source_;  // until it plays
  std::unique_ptr<LiveCamera> live_camera_;         // until its feed has it
  cv::Size size_;                                   // of every picture; empty while a live camera's is not known
  messaging::Writer<msg::CameraFrame> frames_;
  messaging::Writer<msg::CameraPreview> previews_;
  messaging::Writer<msg::CameraCalibration> calibrations_;
  messaging::Writer<msg::DataClock> clock_;
  PictureHealth picture_health_;
  LockStep lock_step_;
  Gathering gathering_;
  messaging::SentTotals sent_;
  uint64_t frame_seq_ = 0;
  uint64_t clock_seq_ = 0;
  int64_t clock_sent_ns_ = 0;  // monotonic
  int64_t newest_ns_ = INT64_MIN;
  std::optional<int64_t> preview_ns_;
  std::optional<int64_t> waiting_since_ns_;
  std::optional<int64_t> made_ns_;  // start immediately: until it has begun
  std::optional<int64_t> ended_ns_;
  std::optional<int64_t> gave_up_ns_;
  std::string gave_up_why_;
  int bad_in_a_row_ = 0;
  int unsent_in_a_row_ = 0;
  bool no_host_time_ = false;  // see RawPicture
  cv::Mat preview_grey_;
  uint64_t bad_packets_ = 0;
  std::unique_ptr<Player> player_;  // last, as the feed: their threads call the context
  std::unique_ptr<LiveFeed> feed_;
};

}  // namespace railfix::frame_grabber
