// What the recorder's thread does about events.
#include <algorithm>

#include "core/time.hpp"
#include "recorder/recorder.hpp"

namespace railfix::recorder {

namespace {

// One rule may make so many events: a rule that flickers must not fill the disk and the log.
constexpr int64_t kRulePeriodNs = core::kNsPerSecond;
// Events that follow each other share a file of at most so many times the length of one.
constexpr int64_t kMostWindows = 5;

}  // namespace

core::Result<std::string> Recorder::event(const std::string& text) {
  return in_thread([this, text] {
    return happened({core::wall_ns(), text.empty() ? "by hand" : text, "by hand"}, true);
  });
}

void Recorder::look_for_events(const StoredSample& sample) {
  for (EventRule& rule : rules_) {
    if (!rule.concerns(sample.channel->topic) || !rule.begins(sample)) continue;
    int64_t& last_ns = rule_happened_ns_[&rule];
    const int64_t now_ns = core::monotonic_ns();
    if (last_ns != 0 && now_ns - last_ns < kRulePeriodNs) continue;
    last_ns = now_ns;
    const bool in_file = event_file_ != nullptr;
    const auto kept = happened({core::wall_ns(), rule.text(), rule.text()}, false);
    if (!kept.ok()) {
      say("event " + rule.text() + ": " + kept.error().message, true);
    } else if (!in_file) {
      say("event " + rule.text() + ": " + kept.value(), false);
    }
  }
}

core::Result<std::string> Recorder::happened(const EventNote& note, bool by_hand) {
  if (!recording_ && !ring_) {
    return core::Error{"nothing is being recorded and no ring is kept (recorder.ring_s)"};
  }
  event_ = note;
  if (recording_) {
    const auto status = recording_->write_event(note);
    if (!status.ok()) problem_ = status.error().message;
  }
  if (ring_) return keep_event(note, by_hand);
  const std::string file = recording_->file().string();
  if (!by_hand) return "marked in " + file;
  const auto status = housekeeper_->protect(file, "event: " + note.text);
  if (!status.ok()) return status.error();
  return "marked in " + file + ", which is protected now";
}

core::Result<std::string> Recorder::keep_event(const EventNote& note, bool by_hand) {
  const int64_t now_ns = core::monotonic_ns();
  const int64_t longest_ns = kMostWindows * core::to_ns(config_.ring_s + config_.after_s);
  if (event_file_ && now_ns < event_begun_ns_ + longest_ns) {
    event_file_->note(note);
    event_ends_ns_ = std::min(now_ns + core::to_ns(config_.after_s), event_begun_ns_ + longest_ns);
    return "noted in " + event_file_->file().string();
  }
  event_ends_ns_ = 0;
  tend_event_files(false);
  if (disk_has_less_than(1, file_on_disk()))
    return core::Error{"no file for it: the disk has less than keep_free_mb free"};
  if (!by_hand && static_cast<double>(housekeeper_->survey().event_bytes) >= config_.events_mb * kBytesPerMb) {
    return core::Error{"no file for it: the files of events take more than events_mb; remove some"};
  }
  auto made = maker_.create_event_file(note, ring_->snapshot());
  if (!made.ok()) return made.error();
  event_file_ = std::move(made).value();
  event_begun_ns_ = now_ns;
  event_ends_ns_ = now_ns + core::to_ns(config_.after_s);
  return event_file_->file().string() + " is being made, from " + std::to_string(static_cast<int>(ring_->seconds())) +
         " s before";
}

void Recorder::tend_event_files(bool all) {
  if (event_file_ && (all || core::monotonic_ns() >= event_ends_ns_)) {
    event_file_->finish();
    closing_events_.push_back(std::move(event_file_));
  }
  std::erase_if(closing_events_, [&](const std::unique_ptr<EventFile>& file) {
    if (!all && !file->done()) return false;
    const auto result = file->wait();
    say(result.ok() ? result.value() : result.error().message, !result.ok());
    return true;
  });
}

}  // namespace railfix::recorder
