#include "recorder/recorder_status.hpp"

#include <limits>

#include "core/cut_text.hpp"
#include "core/time.hpp"

namespace railfix::recorder {

namespace {

// Of the strings and the list in recorder.idl.
constexpr size_t kMostText = 255;
constexpr size_t kMostTopic = 63;
constexpr size_t kMostTopics = 64;
constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();

double megabytes(uint64_t bytes) {
  return static_cast<double>(bytes) / kBytesPerMb;
}

uint8_t state_of(const RecorderState& state) {
  if (state.paused) return msg::RECORDER_PAUSED;
  if (state.recording) return msg::RECORDER_RECORDING;
  return state.ring && !state.is_wanted ? msg::RECORDER_WAITING : msg::RECORDER_STOPPED;
}

msg::LostSamples lost_of(const TopicLosses& losses) {
  const auto count = [&](Loss cause) {
    const auto found = losses.by_cause.find(cause);
    return found == losses.by_cause.end() ? 0 : found->second;
  };
  msg::LostSamples lost;
  lost.topic(core::cut_text(losses.topic, kMostTopic));
  lost.transport(count(Loss::transport));
  lost.encoder(count(Loss::encoder));
  lost.queue(count(Loss::queue));
  lost.disk(count(Loss::disk));
  return lost;
}

}  // namespace

msg::RecorderStatus status_of(const RecorderState& state, const Survey& folder, double quota_mb) {
  msg::RecorderStatus status;
  status.stamp_ns(core::wall_ns());
  status.started_ns(state.started_ns);
  status.event_ns(state.event ? state.event->time_ns : 0);
  status.messages(state.messages);
  status.bytes(state.bytes);
  status.bytes_per_s(state.bytes_per_s);
  status.queue_mb(megabytes(state.waiting_bytes));
  status.ring_s(state.ring_s);
  status.kept_mb(megabytes(folder.bytes));
  status.quota_mb(quota_mb);
  status.disk_free_mb(folder.disk_free_bytes ? megabytes(*folder.disk_free_bytes) : kUnknown);
  status.files(folder.files);
  status.protected_files(folder.protected_files);
  status.state(state_of(state));
  status.file(core::cut_text(state.file, kMostText));
  status.event(state.event ? core::cut_text(state.event->text, kMostText) : "");
  for (const auto& losses : state.losses_by_topic) {
    if (status.lost().size() < kMostTopics) status.lost().push_back(lost_of(losses));
  }
  return status;
}

bool changed(const msg::RecorderStatus& before, const msg::RecorderStatus& now) {
  return before.state() != now.state() || before.file() != now.file() || before.event_ns() != now.event_ns() ||
         before.protected_files() != now.protected_files() || before.lost().size() != now.lost().size();
}

}  // namespace railfix::recorder
