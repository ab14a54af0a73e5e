// Every topic of the train as samples that are ready to be stored. Pictures are made smaller or packed in a thread of
// their own before.
#pragma once

#include <atomic>
#include <functional>
#include <optional>
#include <string_view>
#include <thread>
#include <utility>

#include "messaging/topics.hpp"
#include "recorder/recorder_config.hpp"
#include "recorder/recording.hpp"

namespace railfix::recorder {

/// One sample that came. Recording and ring may want a picture in different forms.
struct Arrival {
  std::string_view topic;  // "camera_frame/cam0"
  uint64_t writer = 0;     // as the middleware counts them
  uint64_t sequence = 0;
  SamplePtr recorded;                       // null: not wanted in the recording
  SamplePtr ringed;                         // null: not wanted in the ring
  std::optional<int64_t> picture_stamp_ns;  // of pictures
  bool live = true;  // false: a standing value from before we listened; what comes next need not follow it
};

class TopicInlet {
 public:
  /// `use` is called in the thread that drains `queue`, as are the functions below.
  TopicInlet(const RecorderConfig& config, messaging::Participant& participant, std::string train_id,
             messaging::Queue& queue, std::function<void(const Arrival&)> use);
  ~TopicInlet();
  TopicInlet(const TopicInlet&) = delete;
  TopicInlet& operator=(const TopicInlet&) = delete;

  [[nodiscard]] bool is_open() const { return open_; }
  /// Error: a topic cannot be read; then none is.
  core::Status open();
  /// Everything that was received until now has been used when this returns.
  void drain();
  /// drain(), and no more after it. dropped() keeps its numbers.
  void close();
  void find_cameras();
  /// Of cameras that cannot be listened to, since the last call.
  std::vector<std::string> take_refused() { return std::exchange(refused_, {}); }
  /// Pictures are encoded for the recording only while there is one.
  void want_recorded(bool wanted) { recorded_wanted_ = wanted; }

  /// Samples dropped in front of `use` since open().
  struct Dropped {
    std::string topic;
    Loss cause;
    uint64_t total;
  };
  [[nodiscard]] std::vector<Dropped> dropped() const;
  /// Encoded pictures that wait.
  [[nodiscard]] uint64_t waiting_bytes() const { return waiting_bytes_; }

 private:
  using Sample = std::shared_ptr<const void>;
  struct Listening {
    std::unique_ptr<messaging::AnyReader> reader;
    messaging::Queue::Source encoded;  // pictures that wait behind the encoder
    bool pictures = false;
    std::shared_ptr<const ChannelOf> packed_pictures;  // JPEG or PGM
    std::shared_ptr<const ChannelOf> plain_pictures;   // too large for that
    uint64_t dropped_at_close = 0;
  };
  void listen(const messaging::TopicInfo& topic, const std::string& instance);
  void listen_camera(Listening& listening, const messaging::TopicInfo& topic, const std::string& name,
                     const std::string& instance);
  void encode(const std::string& name, Listening& listening, const msg::CameraFrame& frame,
              const messaging::SampleInfo& info);
  [[nodiscard]] SamplePtr encoded(const std::string& how, const Listening& listening, const msg::CameraFrame& frame,
                                  const messaging::SampleInfo& info) const;
  [[nodiscard]] bool left_out(const std::string& topic) const;
  [[nodiscard]] std::shared_ptr<const ChannelOf> channel_of(const messaging::TopicInfo& topic,
                                                            const messaging::Type& type, const std::string& name) const;
  void in_encoder(const std::function<void()>& work);

  RecorderConfig config_;
  std::string ring_pictures_;  // "none" without a ring
  messaging::Participant& participant_;
  std::string train_id_;
  messaging::Queue& queue_;
  std::function<void(const Arrival&)> use_;
  bool open_ = false;
  std::map<std::string, Listening> listening_;
  std::vector<std::string> refused_;
  std::atomic<bool> recorded_wanted_ = false;
  std::atomic<uint64_t> waiting_bytes_ = 0;
  messaging::Queue encode_queue_;
  std::atomic<bool> ending_ = false;
  std::thread encoder_;
};

}  // namespace railfix::recorder
