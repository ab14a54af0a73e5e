#include "replay/sample_feed.hpp"

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
  std::unique_lock lock(mutex_);
  changed_.wait(lock, [this] { return stopped_ || (samples_.size() < kMostSamples && bytes_ < kMostBytes); });
  if (stopped_) return false;
  bytes_ += bytes_of(sample);
  samples_.push_back(std::move(sample));
  if (samples_.size() == 1) changed_.notify_all();
  return true;
}

std::optional<PreparedSample> SampleFeed::next(int64_t deadline_ns) {
  std::unique_lock lock(mutex_);
  const auto left = std::chrono::nanoseconds(std::max<int64_t>(0, deadline_ns - core::monotonic_ns()));
  changed_.wait_for(lock, left, [this] { return read_all_ || !samples_.empty(); });
  if (samples_.empty()) return std::nullopt;
  PreparedSample sample = std::move(samples_.front());
  samples_.pop_front();
  bytes_ -= bytes_of(sample);
  // Half full before the reader goes on: it need not be woken for every sample.
  if (samples_.size() <= kMostSamples / 2 && bytes_ <= kMostBytes / 2) changed_.notify_all();
  return sample;
}

bool SampleFeed::ended() {
  const std::lock_guard lock(mutex_);
  return read_all_ && samples_.empty();
}

}  // namespace railfix::tool
