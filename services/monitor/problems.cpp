#include "monitor/problems.hpp"

#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <set>

#include "core/time.hpp"

namespace railfix::monitor {
namespace {

// Services that are just being started are not missing yet.
constexpr double kStartS = 10;
constexpr double kSilentS = 2;
constexpr double kSilentGaps = 8;
constexpr double kBehindS = 1;
constexpr double kSharedMemoryLowMb = 64;
// So the recorder begins its reason while it loses samples.
constexpr std::string_view kRecorderLoses = "samples are lost";

/// Topics that come all the time while data flows, and whose writer says nothing when they do not.
const std::set<std::string>& flowing_topics() {
  static const std::set<std::string> topics{"camera_preview", "imu_sample",    "wheel_sample", "gnss_fix",
                                            "track_view",     "odometry_step", "train_state"};
  return topics;
}

using Problems = std::vector<Problem>;

bool is_heard(const messaging::ServiceBoard& board, const Expected& wanted) {
  return std::ranges::any_of(board.services(), [&](const auto& entry) {
    return entry.first.second == wanted.service && (wanted.host.empty() || entry.first.first == wanted.host);
  });
}

bool runs_elsewhere(const TrainSeen& train, const messaging::ServiceBoard::Key& key) {
  return std::ranges::any_of(train.services->services(), [&](const auto& entry) {
    return entry.first.second == key.second && entry.first.first != key.first && entry.second.runs();
  });
}

void judge_missing(const TrainSeen& train, Problems& problems) {
  const bool starting = core::seconds(train.now_ns - train.watched_since_ns) < kStartS;
  const auto is_other = [](const auto& entry) { return entry.first.second != "monitor"; };
  const bool nobody = std::ranges::none_of(train.services->services(), is_other);
  if (nobody && !train.played && (starting || train.expected.empty())) {
    problems.push_back({"nobody", Level::warning, "No service of this train has been heard yet",
                        "Its services are found within seconds; if not, see that train_id and domain are theirs."});
  }
  if (train.played || starting) return;
  for (const auto& wanted : train.expected) {
    if (is_heard(*train.services, wanted)) continue;
    const std::string on_host = wanted.service + (wanted.host.empty() ? "" : " on " + wanted.host);
    std::string program = "railfix-" + wanted.service;
    std::ranges::replace(program, '_', '-');
    problems.push_back(
        {"missing " + on_host, Level::error, on_host + " is not there",
         "Start it (railfix train up, or its program " + program + "), or take it out of monitor.expected."});
  }
}

// Numbers that only grow make no other problem.
std::string without_digits(std::string text) {
  std::erase_if(text, [](unsigned char c) { return std::isdigit(c) != 0; });
  return text;
}

void judge_service(const TrainSeen& train, const messaging::ServiceBoard::Key& key, const messaging::ServiceSeen& seen,
                   Problems& problems) {
  const std::string name = seen.name();
  const std::string id = key.first + "/" + name;
  const std::string on_host = train.services->find(name) == &seen ? name : name + " on " + key.first;
  const std::string reason = seen.status.reason().c_str();
  const double silent_s = core::seconds(train.now_ns - seen.received_ns);
  if (seen.stopped()) {
    problems.push_back({"stopped " + id, train.needs(key) ? Level::error : Level::warning, on_host + " was stopped",
                        "Start it again when it is needed."});
  } else if (!seen.alive) {
    problems.push_back({"silent " + id, Level::error, on_host + " is dead or frozen: no sign of life",
                        std::string("Look at the last lines of its log, then start it again.") +
                            (runs_elsewhere(train, key) ? " If it has moved to another host for good, start the "
                                                          "monitor again, which then forgets this one."
                                                        : "")});
  } else if (seen.status.state() == msg::STATE_FAILED) {
    problems.push_back(
        {"failed " + id, Level::error, on_host + " has failed: " + reason, "Mend what it says, then start it again."});
  } else if (name == "recorder" && reason.starts_with(kRecorderLoses) && train.recorder) {
    return;  // judge_recorder() says it
  } else if (seen.status.state() == msg::STATE_DEGRADED) {
    problems.push_back({"degraded " + id + ": " + without_digits(reason), Level::warning,
                        on_host + " works with less: " + reason,
                        "See to what it says; its README says what each is and when it ends."});
  } else if (silent_s > kSilentS && !train.data_stands) {
    problems.push_back({"late " + id, Level::warning, on_host + " has said nothing lately",
                        "The computer or the network is overloaded: look at its processor load."});
  }
}

void judge_services(const TrainSeen& train, Problems& problems) {
  judge_missing(train, problems);
  for (const auto& [key, seen] : train.services->services()) judge_service(train, key, seen, problems);
}

void judge_topics(const TrainSeen& train, Problems& problems) {
  if (train.data_stands) return;
  for (const auto& topic : train.topics) {
    const std::string base = topic.name.substr(0, topic.name.find('/'));
    if (!flowing_topics().contains(base) || !topic.written || !topic.numbers.age_s || topic.usual_gap_s <= 0) continue;
    if (*topic.numbers.age_s < std::max(kSilentS, kSilentGaps * topic.usual_gap_s)) continue;
    problems.push_back({"quiet " + topic.name, base == "train_state" ? Level::error : Level::warning,
                        topic.name + " has stopped coming",
                        "See whether its service is degraded and whether its own inputs come."});
  }
}

void judge_silence_of_fusion(const TrainSeen& train, Problems& problems) {
  const auto* fusion = train.services->find("fusion");
  if (train.played || fusion == nullptr || !fusion->runs()) return;  // that it is not there is said
  if (const auto* waits = waiting_source(*train.services)) {
    if (core::seconds(train.now_ns - waits->since_ns) < kStartS) return;
    const std::string name = waits->name();
    problems.push_back({"not begun", Level::warning, "No position yet: " + name + " is ready, and waits to begin",
                        "Recorded data: give it the command (railfix tell " + name + " start), or set " + name +
                            ".start: immediately. A live device: see its log."});
    return;
  }
  if (train.awaited_s.value_or(0) < kStartS) return;
  problems.push_back({"no position", Level::error, "No position of this train has been heard yet",
                      "See what fusion says, and whether camera, odometry and sensors give anything."});
}

void judge_place(const TrainSeen& train, const msg::TrainState& state, Problems& problems) {
  if (!train.on_map()) {
    problems.push_back({"map", Level::warning,
                        "The monitor has no map, and fusion names no place: distance and speed, but no position",
                        "Give the train a map (map of the train, or fusion.map and monitor.map); where fusion has one, "
                        "see why it knows no place on it."});
  } else if (state.track_known() == 0) {
    problems.push_back(
        {"track", Level::warning,
         "It is not known which track the train is on" +
             (state.edge() == 0
                  ? ""
                  : fmt::format(" ({:.1f} % for edge {})", 100 * state.track_probability(), state.edge())),
         "It becomes known behind the next switch, curve or balise; if not, see what map_matcher says."});
  } else if (const double wide_m = state.over_m() + state.under_m(); wide_m > train.interval_wide_m) {
    problems.push_back({"wide", Level::warning,
                        std::isfinite(wide_m) ? fmt::format("The confidence interval is {:.0f} m wide", wide_m)
                                              : "The confidence interval has no bound",
                        "The next landmark on the map narrows it; if none comes, see whether the camera sees them."});
  }
}

std::string reason_of_fusion(const TrainSeen& train) {
  const auto* fusion = train.services->find("fusion");
  return fusion == nullptr || !fusion->alive ? "" : fusion->status.reason().c_str();
}

void judge_position(const TrainSeen& train, Problems& problems) {
  if (train.data_stands) return;
  if (!train.state) return judge_silence_of_fusion(train, problems);
  const auto* state = train.position_now();
  if (state == nullptr) return;  // that its service or its topic is silent is said
  if (train.state_behind_s && *train.state_behind_s > kBehindS) {
    problems.push_back(
        {"behind", Level::error,
         fmt::format("The position that comes now is {:.1f} s old: fusion is late, or the computers' clocks differ",
                     *train.state_behind_s),
         "See the processor load of fusion's computer, and that all computers get their time from one source (NTP, "
         "PTP)."});
  }
  judge_place(train, *state, problems);
  const std::string reason = reason_of_fusion(train);
  if (state->integrity() == msg::INTEGRITY_UNUSABLE) {
    problems.push_back({"unusable", Level::error,
                        "The position must not be used" + (reason.empty() ? "" : ": " + reason),
                        "See which sensors and services are degraded or silent."});
  } else if (state->integrity() == msg::INTEGRITY_DEGRADED) {
    problems.push_back({"integrity", Level::warning, "The position is held by less than usual",
                        "See the reason that fusion gives, and which sensors are degraded."});
  }
}

void judge_recorder(const TrainSeen& train, Problems& problems) {
  if (!train.recorder || train.played) return;
  const auto& recorder = *train.recorder;
  uint64_t lost = 0;
  std::string topics;
  for (const auto& one : recorder.lost()) {
    lost += one.transport() + one.encoder() + one.queue() + one.disk();
    topics += (topics.empty() ? "" : ", ") + std::string(one.topic().c_str());
  }
  if (lost > 0) {
    problems.push_back({"recorder lost", Level::warning,
                        fmt::format("The recording lacks {} {} of {}", lost, lost == 1 ? "sample" : "samples", topics),
                        "See the causes in the recorder panel; record fewer pictures or use a faster disk."});
  }
  if (recorder.disk_free_mb() < train.disk_low_mb) {  // NaN: cannot be told
    problems.push_back({"disk", Level::warning,
                        fmt::format("The recorder's disk has {:.0f} MB left", recorder.disk_free_mb()),
                        "Fetch recordings from it, or set recorder.quota_mb."});
  }
  if (recorder.state() == msg::RECORDER_STOPPED || recorder.state() == msg::RECORDER_PAUSED) {
    const auto* service = train.services->find("recorder");
    const bool cannot = service != nullptr && service->status.state() == msg::STATE_DEGRADED;
    problems.push_back(
        {"not recording", Level::warning, "Nothing is being recorded",
         cannot ? "See to what the recorder says, then start it in its panel." : "Start the recorder in its panel."});
  }
}

void judge_certificates(const TrainSeen& train, Problems& problems) {
  for (const auto& one : train.certificates) {
    if (one.days_left >= train.certificate_days) continue;
    const bool over = one.days_left < 0;
    const std::string whose = one.service + " on " + one.host;
    problems.push_back({"certificate " + whose, over ? Level::error : Level::warning,
                        over ? fmt::format("The certificate of {} has run out", whose)
                             : fmt::format("The certificate of {} runs out in {} days", whose, one.days_left),
                        train.keys_command + " --renew, then railfix train upgrade on each host."});
  }
}

void judge_rest(const TrainSeen& train, Problems& problems) {
  if (train.gnss && !train.data_stands && train.gnss->fix() == msg::GNSS_NONE) {
    problems.push_back({"gnss", Level::warning, "The satellite receiver has no fix",
                        "In tunnels and halls this is right; under open sky check antenna and cable."});
  }
  if (train.shared_memory_free_mb >= 0 && train.shared_memory_free_mb < kSharedMemoryLowMb) {
    problems.push_back({"shared memory", Level::error,
                        fmt::format("/dev/shm has {:.0f} MB left: pictures will be lost", train.shared_memory_free_mb),
                        "End programs that use it, or make it larger (mount option size, docker --shm-size)."});
  }
}

}  // namespace

Expected Expected::of(const std::string& text) {
  const size_t at = text.find('@');
  return at == std::string::npos ? Expected{text, ""} : Expected{text.substr(0, at), text.substr(at + 1)};
}

const messaging::ServiceSeen* waiting_source(const messaging::ServiceBoard& services) {
  const messaging::ServiceSeen* waits = nullptr;
  for (const auto& [key, seen] : services.services()) {
    const bool gives_data = key.second == "frame_grabber" || key.second == "sensor_gateway";
    if (!gives_data || !seen.runs()) continue;
    if (seen.status.state() != msg::STATE_READY) return nullptr;
    if (waits == nullptr || key.second == "frame_grabber") waits = &seen;  // which the other one follows
  }
  return waits;
}

bool TrainSeen::needs(const messaging::ServiceBoard::Key& key) const {
  return std::ranges::any_of(expected, [&](const Expected& wanted) {
    if (wanted.service != key.second) return false;
    return wanted.host.empty() ? !runs_elsewhere(*this, key) : wanted.host == key.first;
  });
}

std::vector<Problem> find_problems(const TrainSeen& train) {
  Problems problems;
  judge_services(train, problems);
  judge_topics(train, problems);
  judge_position(train, problems);
  judge_recorder(train, problems);
  judge_certificates(train, problems);
  judge_rest(train, problems);
  return problems;
}

bool ProblemList::update(std::vector<Problem> found, int64_t now_ns) {
  std::map<std::string, int64_t> since_ns;
  for (Problem& problem : found) {
    const auto known = since_ns_.find(problem.id);
    problem.since_ns = since_ns[problem.id] = known == since_ns_.end() ? now_ns : known->second;
  }
  since_ns_ = std::move(since_ns);
  std::ranges::stable_sort(found, [](const Problem& a, const Problem& b) {
    return a.level != b.level ? a.level > b.level : a.since_ns < b.since_ns;
  });
  if (found == problems_) return false;
  problems_ = std::move(found);
  return true;
}

}  // namespace railfix::monitor
