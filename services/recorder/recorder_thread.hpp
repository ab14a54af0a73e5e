// The recorder's own threads: one that takes samples from the topics and writes them, one that encodes pictures. The
// disk may stall there without the service looking frozen.
#pragma once

#include <atomic>
#include <functional>
#include <future>
#include <map>
#include <mutex>
#include <thread>

#include "messaging/topics.hpp"
#include "recorder/recorder_config.hpp"
#include "recorder/recording.hpp"

namespace railfix::recorder {

/// What the service says about the recording.
struct RecorderState {
  bool recording = false;
  std::string file;
  uint64_t received = 0;  // since the program began
  uint64_t written = 0;
  uint64_t lost = 0;
  std::string losses;   // of the present recording, by topic and cause
  std::string problem;  // why nothing can be written, empty = all well
};

class RecorderThread {
 public:
  /// `on_picture` is called from the recorder's thread with the stamp of each picture that was dealt with.
  RecorderThread(const RecorderConfig& config, messaging::Participant& participant,
                 std::map<std::string, std::string> about, std::function<void(int64_t stamp_ns)> on_picture);
  /// Closes the recording.
  ~RecorderThread();
  RecorderThread(const RecorderThread&) = delete;
  RecorderThread& operator=(const RecorderThread&) = delete;

  /// Any thread, one after the other. Give the file's name.
  core::Result<std::string> start(const std::filesystem::path& file);
  core::Result<std::string> stop();
  [[nodiscard]] RecorderState state() const;

 private:
  /// One topic that is listened to; the source counts encoded pictures waiting for the disk.
  struct Listening {
    std::unique_ptr<messaging::AnyReader> reader;
    messaging::Queue::Source encoded;
    Loss cause = Loss::queue;
    uint64_t dropped_before = 0;  // the present file was begun
    uint64_t encoded_dropped_before = 0;
  };
  /// The last sample of a standing value, which every file must hold.
  struct Standing {
    ChannelOf channel;
    messaging::SampleInfo info;
    std::vector<uint8_t> cdr;
  };
  using Sample = std::shared_ptr<const void>;

  core::Result<std::string> in_thread(const std::function<core::Result<std::string>()>& work);
  core::Result<std::string> begin(const std::filesystem::path& file);
  core::Status create(const std::filesystem::path& file);
  core::Result<std::string> end();
  void split_if_due();
  void keep_standing(const ChannelOf& channel, const messaging::SampleInfo& info, const std::vector<uint8_t>& cdr);
  void turn();
  void tick();
  void stop_listening();
  void count_dropped();
  void find_cameras();
  void guard_disk();
  void publish_state();
  void listen(const messaging::TopicInfo& topic, const std::string& instance);
  void listen_camera(const messaging::TopicInfo& topic, const std::string& instance);
  void encode(const std::string& name, Listening& listening, const msg::CameraFrame& frame,
              const messaging::SampleInfo& info);
  void write(const ChannelOf& channel, const messaging::SampleInfo& info, const std::vector<uint8_t>& cdr);
  [[nodiscard]] bool left_out(const std::string& topic) const;
  [[nodiscard]] ChannelOf channel_of(const messaging::TopicInfo& topic, const std::string& name) const;

  RecorderConfig config_;
  messaging::Participant& participant_;
  std::map<std::string, std::string> about_;
  std::function<void(int64_t)> on_picture_;

  messaging::Queue queue_;
  messaging::Queue encode_queue_;
  std::map<std::string, Listening> listening_;
  std::unique_ptr<Recording> recording_;
  int64_t recording_begun_ns_ = 0;
  std::map<std::string, Standing> standing_;
  std::string problem_;
  uint64_t received_ = 0;
  uint64_t written_ = 0;
  int64_t ticked_ns_ = 0;

  mutable std::mutex state_mutex_;
  RecorderState state_;
  std::atomic<bool> ending_ = false;
  std::thread writer_thread_;
  std::thread encoder_thread_;
};

}  // namespace railfix::recorder
