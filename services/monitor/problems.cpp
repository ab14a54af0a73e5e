#include "monitor/problems.hpp"

#include <spdlog/fmt/fmt.h>

#include <algorithm>
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

void judge_services(const TrainSeen& train, Problems& problems) {
  const bool starting = core::seconds(train.now_ns - train.watched_since_ns) < kStartS;
  const auto is_other = [](const auto& entry) { return entry.first.second != "monitor"; };
  const bool nobody = std::ranges::none_of(train.services->services(), is_other);
  if (nobody && !train.played && (starting || train.expected.empty())) {
    problems.push_back({"nobody", Level::warning, "No service of this train has been heard yet",
                        "Its services are found within seconds; if not, see that train_id and domain are theirs."});
  }
  for (const std::string& name : train.expected) {
    if (train.played || starting || train.services->find(name) != nullptr) continue;
    problems.push_back({"missing " + name, Level::error, name + " is not there",
                        "Start railfix-" + name + ", or take it out of monitor.expected."});
  }
  for (const auto& [key, seen] : train.services->services()) {
    const std::string name = seen.name();
    const std::string id = key.first + "/" + name;
    const std::string on_host = train.services->find(name) == &seen ? name : name + " on " + key.first;
    const std::string reason = seen.status.reason().c_str();
    const double silent_s = core::seconds(train.now_ns - seen.received_ns);
    if (seen.stopped()) {
      const bool is_expected = std::ranges::find(train.expected, name) != train.expected.end();
      problems.push_back({"stopped " + id, is_expected ? Level::error : Level::warning, on_host + " was stopped",
                          "Start it again when it is needed."});
    } else if (!seen.alive) {
      problems.push_back({"silent " + id, Level::error, on_host + " is dead or frozen: no sign of life",
                          "Look at the last lines of its log, then start it again."});
    } else if (seen.status.state() == msg::STATE_FAILED) {
      problems.push_back({"failed " + id, Level::error, on_host + " has failed: " + reason,
                          "Mend what it says, then start it again."});
    } else if (name == "recorder" && reason.starts_with(kRecorderLoses) && train.recorder) {
      continue;  // judge_recorder() says it
    } else if (seen.status.state() == msg::STATE_DEGRADED) {
      problems.push_back({"degraded " + id, Level::warning, on_host + " works with less: " + reason,
                          "See to what it says; its README says what each is and when it ends."});
    } else if (silent_s > kSilentS && !train.data_stands) {
      problems.push_back({"late " + id, Level::warning, on_host + " has said nothing lately",
                          "The computer or the network is overloaded: look at its processor load."});
    }
  }
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

void judge_position(const TrainSeen& train, Problems& problems) {
  if (!train.state || train.data_stands) return;
  if (train.state_behind_s && *train.state_behind_s > kBehindS) {
    problems.push_back(
        {"behind", Level::error,
         fmt::format("The position that comes now is {:.1f} s old: fusion is late, or the computers' clocks differ",
                     *train.state_behind_s),
         "See the processor load of fusion's computer, and that all computers get their time from one source (NTP, "
         "PTP)."});
  }
  const auto& state = *train.state;
  if (state.track_known() == 0) {
    problems.push_back(
        {"track", Level::warning,
         "It is not known which track the train is on" +
             (state.edge() == 0
                  ? ""
                  : fmt::format(" ({:.1f} % for edge {})", 100 * state.track_probability(), state.edge())),
         "It becomes known behind the next switch, curve or balise; if not, see what map_matcher says."});
  } else if (state.over_m() + state.under_m() > train.interval_wide_m) {
    problems.push_back({"wide", Level::warning,
                        fmt::format("The confidence interval is {:.0f} m wide", state.over_m() + state.under_m()),
                        "The next landmark on the map narrows it; if none comes, see whether the camera sees them."});
  }
  if (state.integrity() == msg::INTEGRITY_UNUSABLE) {
    problems.push_back({"unusable", Level::error, "The position must not be used: its sources contradict each other",
                        "See the reason that fusion gives, and which sensors are degraded."});
  } else if (state.integrity() == msg::INTEGRITY_DEGRADED) {
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
  if (recorder.disk_free_mb() > 0 && recorder.disk_free_mb() < train.disk_low_mb) {
    problems.push_back({"disk", Level::warning,
                        fmt::format("The recorder's disk has {:.0f} MB left", recorder.disk_free_mb()),
                        "Fetch recordings from it, or set recorder.quota_mb."});
  }
  if (recorder.state() == msg::RECORDER_STOPPED || recorder.state() == msg::RECORDER_PAUSED) {
    problems.push_back(
        {"not recording", Level::warning, "Nothing is being recorded", "Start the recorder in its panel."});
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
