#include "replay/sample_feed.hpp"

#include <algorithm>

#include "core/time.hpp"

namespace railfix::tool {

namespace {
size_t bytes_of(const PreparedSample& sample) {
  return sample.cdr.size() + sample.pixels.total();
}
}  // namespace

SampleFeed::SampleFeed(mcap::Reader& reader, mcap::Selection selection, Prepare prepare)
    : prepare_(std::move(prepare)),
      thread_([this, &reader, selection = std::move(selection)] { read(reader, selection); }) {}

SampleFeed::~SampleFeed() {
  {
    const std::lock_guard lock(mutex_);
    stopped_ = true;
    changed_.notify_all();
  }
  thread_.join();
}

void SampleFeed::read(mcap::Reader& reader, const mcap::Selection& selection) {
  reader.for_each(selection, [&](const mcap::Channel& channel, const mcap::Message& message) {
    PreparedSample sample;
    return !prepare_(channel, message, sample) || keep(std::move(sample));
  });
  const std::lock_guard lock(mutex_);
  read_all_ = true;
  changed_.notify_all();
}

bool SampleFeed::keep(PreparedSample sample) {
  std::vector<PreparedSample> discarded;  // goes after the lock
  std::unique_lock lock(mutex_);
  changed_.wait(lock, [this] { return stopped_ || (samples_.size() < kMostSamples && bytes_ < kMostBytes); });
  if (stopped_) return false;
  discarded.swap(discarded_);
  bytes_ += bytes_of(sample);
  samples_.push_back(std::move(sample));
  if (samples_.size() == 1) changed_.notify_all();
  return true;
}

void SampleFeed::fetch(int64_t deadline_ns) {
  std::unique_lock lock(mutex_, std::defer_lock);
  if (!coming_.empty()) {
    if (!lock.try_lock()) return;
  } else {
    lock.lock();
    const auto left = std::chrono::nanoseconds(std::max<int64_t>(0, deadline_ns - core::monotonic_ns()));
    changed_.wait_for(lock, left, [this] { return read_all_ || !samples_.empty(); });
  }
  std::ranges::move(samples_, std::back_inserter(coming_));
  samples_.clear();
  bytes_ = 0;
  std::ranges::move(used_, std::back_inserter(discarded_));
  used_.clear();
  changed_.notify_all();
}

std::optional<PreparedSample> SampleFeed::next(int64_t deadline_ns) {
  if (coming_.size() < kFewComing) fetch(deadline_ns);
  if (coming_.empty()) return std::nullopt;
  PreparedSample sample = std::move(coming_.front());
  coming_.pop_front();
  return sample;
}

bool SampleFeed::ended() {
  const std::lock_guard lock(mutex_);
  return read_all_ && samples_.empty() && coming_.empty();
}

}  // namespace railfix::tool
