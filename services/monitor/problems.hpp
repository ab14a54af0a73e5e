// What is wrong with the train, in plain sentences, and since when. Knows no DDS and no clock.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "idl/position.h"
#include "idl/recorder.h"
#include "idl/sensors.h"
#include "messaging/service_board.hpp"
#include "monitor/topic_statistics.hpp"

namespace railfix::monitor {

enum class Level : uint8_t { warning, error };

struct Problem {
  std::string id;  // stays the same while the problem lasts
  Level level = Level::warning;
  std::string what;
  std::string what_to_do;
  int64_t since_ns = 0;  // monotonic: no clock that is set moves it
  friend bool operator==(const Problem&, const Problem&) = default;
};

/// A position that came longer ago says nothing of the train as it is now.
inline constexpr double kPositionOldS = 2;

/// A service that must be there, written SERVICE or SERVICE@HOST.
struct Expected {
  std::string service;
  std::string host;  // empty = on whichever
  static Expected of(const std::string& text);
};

/// The train as it is seen at one moment.
struct TrainSeen {
  int64_t now_ns = 0;  // of the clock that the services were noted by
  int64_t watched_since_ns = 0;
  const messaging::ServiceBoard* services = nullptr;
  std::vector<Expected> expected;
  struct Topic {
    std::string name;
    TopicNumbers numbers;
    double usual_gap_s = 0;
    bool written = false;  // has a writer now
  };
  std::vector<Topic> topics;  // those that are listened to
  std::optional<msg::TrainState> state;
  double state_age_s = 0;
  std::optional<double> awaited_s;       // without a state: since fusion was first heard, or since the data began
  bool no_map = false;                   // the monitor has none
  std::optional<double> state_behind_s;  // its stamp behind the wall clock when it came; live data only
  std::optional<msg::RecorderStatus> recorder;
  std::optional<msg::GnssFix> gnss;
  bool data_stands = false;           // played data has ended or is paused: silence is right
  bool played = false;                // a player stands in for the services
  double shared_memory_free_mb = -1;  // < 0 = not known
  struct Certificate {
    std::string service;
    std::string host;
    int64_t days_left = 0;
  };
  std::vector<Certificate> certificates;  // of every service that is there
  int64_t certificate_days = 0;
  std::string keys_command = "railfix train keys TRAIN";
  double interval_wide_m = 100;
  double disk_low_mb = 1000;

  /// The last one, unless it is too old to be the train's.
  [[nodiscard]] const msg::TrainState* position_now() const {
    return state && state_age_s < kPositionOldS ? &*state : nullptr;
  }
  /// Whether a map is known of on which the place can be: the monitor's, or one that only fusion has, which it does not
  /// show before it has placed the train.
  [[nodiscard]] bool on_map() const { return !no_map || (state && (state->edge() != 0 || state->track_known() != 0)); }
  /// Whether the train lacks this service when it is not there: not if another host has it in its place.
  [[nodiscard]] bool needs(const messaging::ServiceBoard::Key& key) const;
};

/// Has data and waits to begin, as recorded data does for its command; nullptr while anybody has begun or cannot.
[[nodiscard]] const messaging::ServiceSeen* waiting_source(const messaging::ServiceBoard& services);

/// Without since_ns.
std::vector<Problem> find_problems(const TrainSeen& train);

/// Remembers since when.
class ProblemList {
 public:
  /// True when the list has changed.
  bool update(std::vector<Problem> found, int64_t now_ns);
  /// The worst first, then the oldest.
  [[nodiscard]] const std::vector<Problem>& problems() const { return problems_; }

 private:
  std::map<std::string, int64_t> since_ns_;
  std::vector<Problem> problems_;
};

}  // namespace railfix::monitor
