#include "recorder/event_file.hpp"

#include <chrono>

#include "core/time.hpp"
#include "recorder/recordings_folder.hpp"

namespace railfix::recorder {

namespace {

constexpr std::chrono::milliseconds kTick{250};
// What is written is freed while the rest still waits.
constexpr size_t kTakenAtOnce = 16;

}  // namespace

core::Result<std::unique_ptr<EventFile>> EventFile::create(const std::filesystem::path& file,
                                                           const mcap::WriterOptions& options,
                                                           const std::map<std::string, std::string>& about,
                                                           const EventNote& note, const Ring::Snapshot& before,
                                                           uint64_t most_waiting_bytes) {
  auto recording = Recording::create(file, options, about);
  if (!recording.ok()) return recording.error();
  const auto status = protect(file, "event: " + note.text);
  if (!status.ok()) return status.error();
  return std::unique_ptr<EventFile>(new EventFile(std::move(recording).value(), note, before, most_waiting_bytes));
}

EventFile::EventFile(std::unique_ptr<Recording> recording, const EventNote& note, const Ring::Snapshot& before,
                     uint64_t most_waiting_bytes)
    : recording_(std::move(recording)) {
  items_.push_back({nullptr, 0, note});
  // A file whose first message is an hour old would look an hour long.
  const int64_t begin_ns = before.samples.empty() ? core::wall_ns() : before.samples.front()->received_ns;
  for (const auto& sample : before.standing) items_.push_back({sample, begin_ns, {}});
  for (const auto& sample : before.samples) items_.push_back({sample, sample->received_ns, {}});
  for (const Item& item : items_) waiting_bytes_ += item.sample ? item.sample->cdr.size() : 0;
  most_waiting_bytes_ = most_waiting_bytes + waiting_bytes_;
  thread_ = std::thread([this] { run(); });
}

EventFile::~EventFile() {
  finish();
  if (thread_.joinable()) thread_.join();
}

void EventFile::add(const SamplePtr& sample) {
  {
    const std::lock_guard lock(mutex_);
    if (waiting_bytes_ + sample->cdr.size() > most_waiting_bytes_) {
      ++dropped_[sample->channel->topic];
      return;
    }
    waiting_bytes_ += sample->cdr.size();
    items_.push_back({sample, sample->received_ns, {}});
  }
  filled_.notify_one();
}

void EventFile::note(const EventNote& note) {
  const std::lock_guard lock(mutex_);
  items_.push_back({nullptr, 0, note});
}

void EventFile::finish() {
  {
    const std::lock_guard lock(mutex_);
    finished_ = true;
  }
  filled_.notify_one();
}

core::Result<std::string> EventFile::wait() {
  finish();
  if (thread_.joinable()) thread_.join();
  if (!status_.ok()) return status_.error();
  const std::string losses = recording_->loss_text();
  return file().string() + ": " + std::to_string(recording_->samples()) + " samples around the event" +
         (losses.empty() ? "" : ", lost " + losses);
}

uint64_t EventFile::waiting_bytes() const {
  const std::lock_guard lock(mutex_);
  return waiting_bytes_;
}

std::deque<EventFile::Item> EventFile::take(bool& finished) {
  std::unique_lock lock(mutex_);
  filled_.wait_for(lock, kTick, [this] { return finished_ || !items_.empty(); });
  std::deque<Item> taken;
  while (!items_.empty() && taken.size() < kTakenAtOnce) {
    taken.push_back(std::move(items_.front()));
    items_.pop_front();
    if (taken.back().sample) waiting_bytes_ -= taken.back().sample->cdr.size();
  }
  finished = finished_ && taken.empty();
  return taken;
}

void EventFile::run() {
  const auto keep = [this](const core::Status& status) {
    if (!status.ok()) status_ = status;
  };
  try {
    for (bool finished = false; !finished;) {
      for (const Item& item : take(finished)) {
        keep(item.sample ? recording_->write(*item.sample, item.log_time_ns) : recording_->write_event(item.note));
      }
      keep(recording_->tick(core::monotonic_ns()));
    }
    for (const auto& [topic, count] : dropped_) recording_->add_dropped(topic, Loss::queue, count);
    keep(recording_->close());
  } catch (const std::exception& error) {
    keep(core::Error{file().string() + " is not whole: " + error.what()});
  }
  done_ = true;
}

}  // namespace railfix::recorder
