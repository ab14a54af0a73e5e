// What the page is told, as JSON; the fields are described in docs/monitor.md. Not known is null.
#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "idl/pose.h"
#include "idl/position.h"
#include "messaging/service_board.hpp"
#include "monitor/problems.hpp"
#include "monitor/topic_statistics.hpp"
#include "track/map.hpp"

namespace railfix::monitor {

/// `now_ns` by the clock that the services were noted by; since when is told by the wall clock.
nlohmann::json services_message(const messaging::ServiceBoard& board, int64_t now_ns, int64_t wall_ns);

struct TopicShown {
  std::string name;
  std::string type;
  int writers = 0;
  bool measured = false;
  TopicNumbers numbers;
};
nlohmann::json topics_message(const std::vector<TopicShown>& topics);

nlohmann::json log_record(const msg::LogRecord& record);
nlohmann::json log_message(nlohmann::json records);

/// `choice`: the last position_fix that says which track; `pose`: the newest, both may be null. `map` may be null.
nlohmann::json state_message(const msg::TrainState& state, double age_s, const msg::TrainPose* pose,
                             const msg::PositionFix* choice, const track::Map* map);

nlohmann::json report_message(const msg::TrainPositionReport& report);
nlohmann::json problems_message(const std::vector<Problem>& problems, int64_t now_ns, int64_t wall_ns);

}  // namespace railfix::monitor
