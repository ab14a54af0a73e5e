// The DDS side of watching: readers that come and go with those who want to see, and the statistics of every topic.
// Readers ask for nothing again and take part in no turn: a train is never slower or different for being watched.
#pragma once

#include <functional>
#include <map>
#include <memory>
#include <set>
#include <string>

#include "messaging/topics.hpp"
#include "monitor/topic_statistics.hpp"

namespace railfix::monitor {

/// One sample on its way to a handler.
struct Arrived {
  const std::string& name;  // "camera_preview/cam0"
  const messaging::TopicInfo& topic;
  std::shared_ptr<const void> sample;
  messaging::SampleInfo info;
  template <class T>
  [[nodiscard]] const T& as() const {
    return *static_cast<const T*>(sample.get());
  }
};

class TrainWatch {
 public:
  using Handler = std::function<void(const Arrived&)>;
  TrainWatch(messaging::Participant& participant, Handler handler)
      : participant_(participant), handler_(std::move(handler)) {}

  /// From now on exactly these topics ("track_view", "camera_preview/cam0") are read; unknown names are left out.
  void read(const std::set<std::string>& names);
  /// Handles what has come since the last call.
  void drain();
  /// Samples that waited too long for drain(), since the last call.
  uint64_t take_dropped() { return queue_.take_dropped(); }

  struct Topic {
    const messaging::TopicInfo* info = nullptr;
    TopicStatistics statistics;
    BeforeListening before;
    std::unique_ptr<messaging::AnyReader> reader;
    size_t fixed_bytes = 0;  // of every sample, 0 = not fixed
  };
  /// All that were ever read.
  [[nodiscard]] const std::map<std::string, Topic>& topics() const { return topics_; }
  [[nodiscard]] messaging::Participant& participant() { return participant_; }

 private:
  void arrived(const std::string& name, Topic& topic, const std::shared_ptr<const void>& sample,
               const messaging::SampleInfo& info);

  messaging::Participant& participant_;
  Handler handler_;
  messaging::Queue queue_;
  std::map<std::string, Topic> topics_;
};

}  // namespace railfix::monitor
