#include "run/supervisor.hpp"

#include <algorithm>
#include <iterator>

#include "core/time.hpp"
#include "messaging/connected.hpp"

namespace railfix::tool {
namespace {

constexpr uint8_t kWarningLevel = 3;
constexpr size_t kLogLines = 5;
constexpr double kTurnS = 0.05;
constexpr int64_t kLostNs = 5 * core::kNsPerSecond;
constexpr int kIdleStatuses = 4;  // one second of statuses without new work

}  // namespace

Supervisor::Supervisor(const messaging::ParticipantOptions& options, std::vector<std::string> services)
    : services_(std::move(services)),
      participant_(options),
      control_(participant_, messaging::topics::service_control) {
  namespace topics = messaging::topics;
  const auto listen = [&]<class T>(const messaging::Topic<T>& topic, std::function<void(const T&)> handler) {
    readers_.push_back(std::make_shared<messaging::Reader<T>>(participant_, topic, "", queue_, std::move(handler)));
  };
  listen(topics::service_status, std::function([this](const msg::ServiceStatus& status) { note_status(status); }));
  listen(topics::service_reply,
         std::function([this](const msg::ControlReply& reply) { replies_[reply.request_id()] = reply; }));
  listen(topics::data_clock,
         std::function([this](const msg::DataClock& clock) { ended_ = ended_ || clock.ended() != 0; }));
  listen(topics::train_state, std::function([this](const msg::TrainState& state) {
           picture_.state = state;
           picture_.note_time(state.stamp_ns());
         }));
  listen(topics::train_position_report, std::function([this](const msg::TrainPositionReport& report) {
           picture_.report = report;
           ++picture_.reports;
         }));
  listen(topics::landmark_sighting, std::function([this](const msg::LandmarkSighting&) { ++picture_.sightings; }));
  listen(topics::track_view, std::function([this](const msg::TrackView& view) {
           ++picture_.views;
           if (view.seen_left() != 0 && view.seen_right() != 0) ++picture_.views_seen;
         }));
  listen(topics::odometry_step,
         std::function([this](const msg::OdometryStep& step) { picture_.note_time(step.stamp_ns()); }));
  listen(topics::recorder_status, std::function([this](const msg::RecorderStatus& status) {
           const bool records = status.state() == msg::RECORDER_RECORDING || status.state() == msg::RECORDER_PAUSED;
           picture_.recorded = picture_.recorded || records;
           picture_.recording_broke_off = picture_.recording_broke_off || (picture_.recorded && !records);
         }));
  listen(topics::log_record, std::function([this](const msg::LogRecord& record) {
           if (record.level() < kWarningLevel) return;
           picture_.log.push_back(std::string(record.service().c_str()) + ": " + record.text().c_str());
           if (picture_.log.size() > kLogLines) picture_.log.erase(picture_.log.begin());
         }));
}

void TrainPicture::note_time(int64_t stamp_ns) {
  if (data_begin_ns == 0) data_begin_ns = stamp_ns;
  data_ns = std::max(data_ns, stamp_ns);
}

bool TrainPicture::gone(const std::string& service) const {
  const auto* seen = services.find(service);
  return seen == nullptr || !seen->runs() || seen->status.state() == msg::STATE_FAILED;
}

void Supervisor::note_status(const msg::ServiceStatus& status) {
  const std::string service = status.service().c_str();
  picture_.services.note(status, core::wall_ns());
  if (service == "recorder" || service == "monitor") return;  // always have work: they hear the statuses too
  const uint64_t work = status.frames_in() + status.frames_out();
  unchanged_[service] = work_done_[service] == work ? unchanged_[service] + 1 : 0;
  work_done_[service] = work;
}

void Supervisor::turn(double seconds) {
  const int64_t deadline_ns = core::monotonic_ns() + core::to_ns(seconds);
  while (queue_.run_one(deadline_ns) && core::monotonic_ns() < deadline_ns) {
  }
  picture_.services.note_silence_now_and_then(core::wall_ns());
}

std::string Supervisor::missing() const {
  std::string names;
  for (const auto& service : services_) {
    const auto* seen = picture_.services.find(service);
    if (seen != nullptr && seen->status.state() != msg::STATE_STARTING) continue;
    names += (names.empty() ? "" : ", ") + service;
  }
  if (!names.empty()) return "not ready: " + names;
  const auto own = participant_.connections();
  uint32_t endpoints = 0;
  uint32_t matches = 0;
  for (const auto& [key, seen] : picture_.services.services()) {
    if (picture_.gone(key.second)) continue;
    endpoints += seen.status.endpoints();
    matches += seen.status.matches();
  }
  if (messaging::all_connected(own, endpoints, matches)) return "";
  return "services have not found each other (" + std::to_string((own.matches + matches) / 2) + " of " +
         std::to_string(own.pairs) + " connections)";
}

core::Status Supervisor::wait_connected(Processes& processes, double patience_s) {
  const int64_t deadline_ns = core::monotonic_ns() + core::to_ns(patience_s);
  while (true) {
    turn(kTurnS);
    const std::string what = missing();
    if (what.empty()) return {};
    if (const auto ended = processes.unexpected_end()) return core::Error{*ended};
    if (core::monotonic_ns() > deadline_ns)
      return core::Error{"after " + std::to_string(static_cast<int>(patience_s)) + " s " + what};
  }
}

core::Result<std::string> Supervisor::command(Processes& processes, const std::string& service,
                                              const std::string& command, const std::string& argument,
                                              double patience_s) {
  msg::ControlRequest request;
  const uint64_t id = next_request_++;
  request.request_id(id);
  request.service(service);
  request.command(command);
  request.argument(argument);
  control_.write(request);
  const int64_t deadline_ns = core::monotonic_ns() + core::to_ns(patience_s);
  while (core::monotonic_ns() < deadline_ns) {
    turn(kTurnS);
    if (const auto ended = processes.unexpected_end()) return core::Error{*ended};
    const auto reply = replies_.find(id);
    if (reply == replies_.end()) continue;
    if (!reply->second.done())
      return core::Error{service + " refused " + command + ": " + reply->second.text().c_str()};
    return std::string(reply->second.text().c_str());
  }
  return core::Error{service + " did not answer " + command};
}

bool Supervisor::drained(const std::string& source) const {
  return (ended_ || is_lost(source)) && std::all_of(unchanged_.begin(), unchanged_.end(), [this](const auto& entry) {
           return entry.second >= kIdleStatuses || is_lost(entry.first);
         });
}

std::vector<std::string> Supervisor::lost() const {
  std::vector<std::string> names;
  std::ranges::copy_if(services_, std::back_inserter(names), [this](const auto& name) { return is_lost(name); });
  return names;
}

// On a busy computer one is silent for a moment now and then.
bool Supervisor::is_lost(const std::string& service) const {
  const auto* seen = picture_.services.find(service);
  return seen != nullptr && picture_.gone(service) && core::wall_ns() - seen->since_ns > kLostNs;
}

}  // namespace railfix::tool
