// Private to this folder: lock step. The samples of a step are kept until this service's turn has come and all of them
// are here, and are then used in an order that does not depend on which thread of the middleware was faster. So one
// recording gives the same output on every machine. Knows no DDS.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <string>
#include <vector>

namespace railfix::service {

class Turns {
 public:
  using Work = std::function<void()>;

  /// A topic that this service reads; topics of equal stamps are used in the order of these calls.
  void reads(const std::string& topic);
  /// A sample came; `sequence` counts its writer's samples from 1. REQUIRES: reads(topic).
  void keep(const std::string& topic, uint64_t sequence, int64_t stamp_ns, Work work);
  /// It is our turn; `sent` says how many samples there are of each topic by now.
  void begin(std::map<std::string, uint64_t> sent) { sent_ = std::move(sent); }
  /// Every sample of the turn is here.
  [[nodiscard]] bool ready() const;
  /// All that is kept, by stamp, then topic, then sequence.
  std::vector<Work> take();

 private:
  struct Sample {
    int64_t stamp_ns;
    size_t topic;
    uint64_t sequence;
    Work work;
  };
  struct Topic {
    size_t place;
    uint64_t received = 0;
  };
  std::map<std::string, Topic> topics_;
  std::vector<Sample> samples_;
  std::map<std::string, uint64_t> sent_;
};

}  // namespace railfix::service
