// The last seconds of every topic, in memory, for the file of an event. Not thread safe.
#pragma once

#include <deque>
#include <utility>

#include "recorder/stored_sample.hpp"

namespace railfix::recorder {

class Ring {
 public:
  /// The oldest samples go when the ring is longer than this or holds more than this.
  Ring(double most_s, uint64_t most_bytes) : most_s_(most_s), most_bytes_(most_bytes) {}

  void add(SamplePtr sample, int64_t now_monotonic_ns);
  struct Snapshot {
    std::vector<SamplePtr> standing;  // values as they were where the ring begins
    std::vector<SamplePtr> samples;   // in the order of arrival
  };
  [[nodiscard]] Snapshot snapshot() const;
  /// How far back it reaches.
  [[nodiscard]] double seconds() const;
  [[nodiscard]] uint64_t bytes() const { return bytes_; }

 private:
  double most_s_;
  uint64_t most_bytes_;
  uint64_t bytes_ = 0;
  std::deque<std::pair<int64_t, SamplePtr>> samples_;
  std::map<std::string, SamplePtr> standing_before_;
};

}  // namespace railfix::recorder
