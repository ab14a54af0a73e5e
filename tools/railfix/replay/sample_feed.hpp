// Reads a part of a recording ahead of its time, in a thread of its own: neither the disk nor a picture's decoding
// delays what is due.
#pragma once

#include <condition_variable>
#include <deque>
#include <functional>
#include <map>
#include <mutex>
#include <optional>
#include <thread>
#include <vector>

#include "mcap/reader.hpp"
#include "replay/replayed_channel.hpp"

namespace railfix::tool {

class SampleFeed {
 public:
  /// Makes a sample ready; false leaves it out. Called in the feed's thread.
  using Prepare = std::function<bool(const mcap::Channel& channel, const mcap::Message& message, PreparedSample& out)>;
  /// REQUIRES: the reader outlives the feed and is used by nobody else meanwhile.
  SampleFeed(mcap::Reader& reader, mcap::Selection selection, Prepare prepare);
  ~SampleFeed();
  SampleFeed(const SampleFeed&) = delete;
  SampleFeed& operator=(const SampleFeed&) = delete;

  /// The next sample; waits for it until the deadline (monotonic ns). Nothing at the end, or when it is not ready yet.
  /// As long as some are here it never waits, not even for the lock: the feed's thread may be held up with it.
  std::optional<PreparedSample> next(int64_t deadline_ns);
  /// Its memory is given back where it was taken, which takes long for pictures.
  void give_back(PreparedSample sample) { used_.push_back(std::move(sample)); }
  /// All samples were taken.
  [[nodiscard]] bool ended();

 private:
  static constexpr size_t kMostSamples = 2048;
  static constexpr size_t kMostBytes = 32U << 20U;
  static constexpr size_t kFewComing = 64;
  void fetch(int64_t deadline_ns);
  void read(mcap::Reader& reader, const mcap::Selection& selection);
  bool keep(PreparedSample sample);
  std::deque<PreparedSample> coming_;  // the caller's
  std::vector<PreparedSample> used_;   // the caller's
  Prepare prepare_;
  std::mutex mutex_;
  std::condition_variable changed_;
  std::deque<PreparedSample> samples_;
  std::vector<PreparedSample> discarded_;
  size_t bytes_ = 0;  // of samples_
  bool stopped_ = false;
  bool read_all_ = false;
  std::thread thread_;  // last: it uses all of the above
};

}  // namespace railfix::tool
