// What a whole train sends in a second, from one thread: pictures and every topic of data at its usual rate.
#pragma once

#include <map>
#include <memory>

#include "messaging/topics.hpp"

namespace railfix {

struct LoadOptions {
  double rate_hz = 60;
  uint32_t width_px = 1280;
  uint32_t height_px = 1024;
};

class TrainLoad {
 public:
  TrainLoad(messaging::Participant& participant, const LoadOptions& options);
  ~TrainLoad();
  TrainLoad(const TrainLoad&) = delete;
  TrainLoad& operator=(const TrainLoad&) = delete;

  /// Every topic has a reader.
  [[nodiscard]] bool heard() const;
  /// Sends at the pace of this host's clock for so long.
  void send(double seconds);
  /// By topic ("camera_frame/cam0").
  [[nodiscard]] const std::map<std::string, uint64_t>& sent() const { return sent_; }
  /// Pictures that were sent more than one period late, because this machine was busy.
  [[nodiscard]] uint64_t late() const { return late_; }

 private:
  struct Stream;
  template <class T>
  void add(const messaging::Topic<T>& topic, double rate_hz);
  void add_camera();

  messaging::Participant& participant_;
  LoadOptions options_;
  std::vector<std::vector<uint8_t>> pictures_;
  std::vector<std::unique_ptr<Stream>> streams_;
  std::map<std::string, uint64_t> sent_;
  uint64_t late_ = 0;
};

}  // namespace railfix
