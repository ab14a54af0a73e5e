#include "monitor/live_messages.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "core/time.hpp"
#include "etcs/train_position_report.hpp"
#include "messaging/message_words.hpp"
#include "messaging/samples.hpp"

namespace railfix::monitor {
namespace {

using nlohmann::json;

json known(double value) {
  return std::isfinite(value) ? json(value) : json(nullptr);
}

const char* direction_name(uint8_t direction) {
  return direction == msg::DIRECTION_FORWARD ? "forward" : direction == msg::DIRECTION_REVERSE ? "reverse" : "unknown";
}

const char* reason_name(uint8_t reason) {
  switch (reason) {
    case msg::REPORT_CYCLE_TIME:
      return "time";
    case msg::REPORT_CYCLE_DISTANCE:
      return "distance";
    case msg::REPORT_STANDSTILL:
      return "standstill";
    case msg::REPORT_MOVING:
      return "moving";
    case msg::REPORT_BALISE_GROUP:
      return "balise group";
    case msg::REPORT_LOCATION:
      return "location";
    case msg::REPORT_START:
      return "start";
    default:
      return "on-board unit";
  }
}

json sources_of(uint32_t sources) {
  constexpr std::array<std::pair<uint32_t, const char*>, 6> kNames{{{msg::SOURCE_CAMERA, "camera"},
                                                                    {msg::SOURCE_WHEEL, "wheel"},
                                                                    {msg::SOURCE_IMU, "imu"},
                                                                    {msg::SOURCE_GNSS, "gnss"},
                                                                    {msg::SOURCE_LANDMARK, "landmark"},
                                                                    {msg::SOURCE_CURVATURE, "curvature"}}};
  json names = json::array();
  for (const auto& [bit, name] : kNames) {
    if ((sources & bit) != 0) names.push_back(name);
  }
  return names;
}

json reference_of(uint32_t id, const track::Map* map) {
  if (id == 0) return nullptr;
  const auto* landmark = map == nullptr ? nullptr : map->landmark(id);
  if (landmark == nullptr) return "landmark " + std::to_string(id);
  return landmark->name.empty() ? track::to_string(landmark->kind) + " " + std::to_string(id) : landmark->name;
}

json alternatives_of(const msg::PositionFix* choice) {
  json alternatives = json::array();
  if (choice == nullptr) return alternatives;
  for (size_t i = 0; i < std::min<size_t>(choice->alternatives(), msg::FIX_ALTERNATIVES); ++i) {
    alternatives.push_back({{"edge", choice->alternative_edge()[i]},
                            {"offset_m", known(choice->alternative_offset_m()[i])},
                            {"probability", known(choice->alternative_probability()[i])}});
  }
  return alternatives;
}

}  // namespace

json services_message(const messaging::ServiceBoard& board, int64_t now_ns, int64_t wall_ns) {
  json services = json::array();
  for (const auto& [key, seen] : board.services()) {
    const auto& status = seen.status;
    services.push_back({{"service", seen.name()},
                        {"host", key.first},
                        {"state", messaging::name_of_state(status.state())},
                        {"reason", status.reason().c_str()},
                        {"since_ns", wall_ns - (now_ns - seen.since_ns)},
                        {"age_s", core::seconds(now_ns - seen.received_ns)},
                        {"alive", seen.runs()},
                        {"version", status.version().c_str()},
                        {"pid", status.pid()},
                        {"cpu_percent", status.cpu_percent()},
                        {"rss_mb", status.rss_mb()},
                        {"frames_in", status.frames_in()},
                        {"frames_out", status.frames_out()},
                        {"dropped", status.dropped()},
                        {"latency_p50_ms", status.latency_p50_ms()},
                        {"latency_p99_ms", status.latency_p99_ms()},
                        {"matches", status.matches()}});
  }
  return {{"kind", "services"}, {"services", std::move(services)}};
}

json topics_message(const std::vector<TopicShown>& topics) {
  json shown = json::array();
  for (const auto& topic : topics) {
    const auto& numbers = topic.numbers;
    shown.push_back({{"topic", topic.name},
                     {"type", topic.type},
                     {"writers", topic.writers},
                     {"measured", topic.measured},
                     {"samples", numbers.samples},
                     {"hz", numbers.hz},
                     {"bytes_per_s", numbers.bytes_per_s},
                     {"age_s", numbers.age_s ? json(*numbers.age_s) : json(nullptr)},
                     {"latency_p50_ms", known(numbers.latency_p50_ms)},
                     {"latency_p95_ms", known(numbers.latency_p95_ms)},
                     {"latency_p99_ms", known(numbers.latency_p99_ms)},
                     {"lost", numbers.lost},
                     {"gaps", numbers.gaps},
                     {"longest_gap_s", numbers.longest_gap_s}});
  }
  return {{"kind", "topics"}, {"topics", std::move(shown)}};
}

json log_record(const msg::LogRecord& record) {
  return {{"stamp_ns", record.stamp_ns()},
          {"service", record.service().c_str()},
          {"host", record.host().c_str()},
          {"level", messaging::name_of_level(record.level())},
          {"text", record.text().c_str()}};
}

json log_message(json records) {
  return {{"kind", "log"}, {"records", std::move(records)}};
}

json state_message(const msg::TrainState& state, double age_s, const msg::TrainPose* pose,
                   const msg::PositionFix* choice, const track::Map* map) {
  json message{{"kind", "state"},
               {"stamp_ns", state.stamp_ns()},
               {"age_s", age_s},
               {"edge", state.edge()},
               {"offset_m", known(state.offset_m())},
               {"distance_m", known(state.distance_m())},
               {"speed_mps", known(state.speed_mps())},
               {"acceleration_mps2", known(state.acceleration_mps2())},
               {"over_m", known(state.over_m())},
               {"under_m", known(state.under_m())},
               {"sigma_m", known(state.sigma_m())},
               {"integrity", messaging::name_of_integrity(state.integrity())},
               {"track_known", state.track_known() != 0},
               {"track_probability", known(state.track_probability())},
               {"direction", direction_name(state.direction())},
               {"standstill", state.standstill() != 0},
               {"sources", sources_of(state.sources())},
               {"reference", reference_of(state.reference(), map)},
               {"since_reference_m", known(state.since_reference_m())},
               {"lat", known(state.lat_deg())},
               {"lon", known(state.lon_deg())},
               {"easting_m", known(state.easting_m())},
               {"northing_m", known(state.northing_m())},
               {"heading_rad", known(state.heading_rad())},
               {"pose", nullptr},
               {"alternatives", alternatives_of(choice)}};
  if (pose != nullptr) {
    message["pose"] = {{"height_m", known(pose->height_m())},
                       {"pitch_rad", known(pose->pitch_rad())},
                       {"roll_rad", known(pose->roll_rad())}};
  }
  return message;
}

json report_message(const msg::TrainPositionReport& report) {
  const bool placed = etcs::names_group(report.nid_lrbg());
  return {{"kind", "report"},
          {"stamp_ns", report.stamp_ns()},
          {"sent_ns", report.sent_ns()},
          {"seq", report.seq()},
          {"reason", reason_name(report.reason())},
          {"nid_packet", report.nid_packet()},
          {"baseline", report.baseline()},
          {"nid_lrbg", placed ? json(report.nid_lrbg()) : json(nullptr)},
          {"d_lrbg_m", known(report.d_lrbg_m())},
          {"q_dirlrbg", report.q_dirlrbg()},
          {"q_dlrbg", report.q_dlrbg()},
          {"l_doubtover_m", known(report.l_doubtover_m())},
          {"l_doubtunder_m", known(report.l_doubtunder_m())},
          {"v_train_kmh", known(report.v_train_kmh())},
          {"hex", etcs::to_hex(messaging::bytes_of(report))}};
}

json problems_message(const std::vector<Problem>& problems, int64_t now_ns, int64_t wall_ns) {
  json shown = json::array();
  for (const auto& problem : problems) {
    shown.push_back({{"id", problem.id},
                     {"level", problem.level == Level::error ? "error" : "warning"},
                     {"what", problem.what},
                     {"what_to_do", problem.what_to_do},
                     {"since_ns", wall_ns - (now_ns - problem.since_ns)}});
  }
  return {{"kind", "problems"}, {"now_ns", wall_ns}, {"problems", std::move(shown)}};
}

}  // namespace railfix::monitor
