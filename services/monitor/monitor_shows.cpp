// What the monitor service says to those who look.
#include <algorithm>

#include "cdr/decode.hpp"
#include "core/time.hpp"
#include "messaging/direction.hpp"
#include "monitor/cab_view.hpp"
#include "monitor/foxglove_messages.hpp"
#include "monitor/monitor_service.hpp"

namespace railfix::monitor {
namespace {

using nlohmann::json;
namespace topics = messaging::topics;

constexpr double kCurvatureBehindM = 300;
constexpr double kCurvatureAheadM = 300;

}  // namespace

std::optional<track::EdgePosition> MonitorService::place() const {
  if (!recent(state_) || state_.sample->track_known() == 0) return std::nullopt;
  return messaging::place_of(*state_.sample);
}

void MonitorService::publish_log() {
  if (log_fresh_.empty()) return;
  live_.publish("log", log_message(std::exchange(log_fresh_, json::array())), true);
}

void MonitorService::publish_curvature() {
  if (!live_.watched("curvature")) return;
  for (const auto& message : first("curvature")) live_.publish("curvature", message);
}

json MonitorService::curvature_message() const {
  const auto at = place();
  return {{"kind", "curvature"},
          {"stamp_ns", state_.sample->stamp_ns()},
          {"edge", at ? json(at->edge) : json(nullptr)},
          {"offset_m", at ? json(at->offset_m) : json(nullptr)},
          {"measured", trail_.seen_from(state_.sample->distance_m())},
          {"map", map_view_ && at ? map_view_->curvature(*at, kCurvatureBehindM, kCurvatureAheadM) : json::array()}};
}

void MonitorService::publish_pictures() {
  for (const auto& due : cab_.due(core::monotonic_ns())) {
    const auto& preview = *due.preview;
    const auto message =
        view_message({due.camera, preview.stamp_ns(), preview.width_px(), preview.height_px(), preview.health(),
                      due.track ? &*due.track : nullptr, cab_.intrinsics(due.camera), map_view_.get(), place()});
    const std::string_view jpeg(reinterpret_cast<const char*>(preview.jpeg().data()), preview.jpeg().size());
    live_.publish_picture("view:" + due.camera, message,
                          {{"kind", "picture"}, {"camera", due.camera}, {"stamp_ns", preview.stamp_ns()}}, jpeg);
    const int64_t now_ns = core::wall_ns();
    if (foxglove_.watched(foxglove_picture(due.camera))) {
      foxglove_.publish(foxglove_picture(due.camera), {now_ns, compressed_image(preview, due.camera)});
    }
    if (foxglove_.watched(foxglove_rails(due.camera))) {
      foxglove_.publish(foxglove_rails(due.camera), {now_ns, image_annotations(message)});
    }
  }
}

void MonitorService::publish_state() {
  if (!live_.watched("state")) return;
  state_sent_ns_ = state_.arrived_ns;
  for (const auto& message : first("state")) live_.publish("state", message);
}

void MonitorService::publish_topics() {
  if (!live_.watched("topics")) return;
  for (const auto& message : first("topics")) live_.publish("topics", message);
}

// So that a page which asks for little, too, knows that it is heard, how late and from which time of day; and which
// cameras there are.
void MonitorService::publish_beat() {
  live_.tell_all(
      "beat",
      {{"kind", "beat"}, {"sent_ns", core::monotonic_ns()}, {"now_ns", core::wall_ns()}, {"cameras", cameras()}});
}

json MonitorService::status_message(const std::string& kind, const messaging::TopicInfo& info,
                                    const void* sample) const {
  cdr::DecodeOptions options;
  options.name_constants = true;
  const auto decoded = cdr::decode(cdr::own_types(), info.type->name(), info.type->serialize(sample), options);
  if (!decoded.ok()) {
    context_.log().warn("{} cannot be shown: {}", info.name, decoded.error().message);
    return {{"kind", kind}, {"absent", true}};
  }
  json message = decoded.value();
  if (message["state"].is_string()) {
    auto state = message["state"].get<std::string>();
    std::ranges::transform(state, state.begin(), [](unsigned char c) { return std::tolower(c); });
    message["state"] = state;
  }
  message["kind"] = kind;
  return message;
}

std::vector<TopicShown> MonitorService::topics_shown() const {
  std::set<std::string> names(written_.begin(), written_.end());
  for (const auto& [name, topic] : watch_.topics()) {
    if (topic.reader) names.insert(name);
  }
  std::vector<TopicShown> shown;
  for (const auto& name : names) {
    const auto read = watch_.topics().find(name);
    const bool measured = read != watch_.topics().end() && read->second.reader;
    const auto* info = messaging::find_topic(name);
    TopicShown one{name, info == nullptr ? "unknown" : info->type->name(), 1, measured, {}};
    if (measured) {
      one.writers = read->second.reader->matched_writers();
      one.numbers = read->second.statistics.numbers(core::monotonic_ns());
    }
    shown.push_back(std::move(one));
  }
  return shown;
}

std::vector<json> MonitorService::first(const std::string& kind) {
  const int64_t now_ns = core::monotonic_ns();
  if (kind == "state") {
    if (!state_.sample) return {{{"kind", "state"}, {"age_s", nullptr}}};
    auto message = state_message(*state_.sample, state_.age_s(now_ns), recent(pose_) ? &*pose_.sample : nullptr,
                                 recent(choice_) ? &*choice_.sample : nullptr, map_ ? &*map_ : nullptr);
    message["sent_ns"] = now_ns;  // by a clock that nobody sets: who gets it sees whether the link delays it
    return {std::move(message)};
  }
  if (kind == "curvature") return recent(state_) ? std::vector{curvature_message()} : std::vector<json>{};
  if (kind == "services") return {services_message(services_, now_ns, core::wall_ns())};
  if (kind == "topics") return {topics_message(topics_shown())};
  if (kind == "log") return {log_message(json(log_))};
  if (kind == "reports") return reports_.messages();
  if (kind == "problems") {
    if (!looked_) look_for_problems(train_seen());
    return {problems_message(problems_.problems(), now_ns, core::wall_ns())};
  }
  if (kind == "recorder" && recent(recorder_)) {
    return {status_message(kind, messaging::info_of(topics::recorder_status), &*recorder_.sample)};
  }
  if (kind == "player" && recent(player_)) {
    return {status_message(kind, messaging::info_of(topics::player_status), &*player_.sample)};
  }
  if (kind == "recorder" || kind == "player") return {{{"kind", kind}, {"absent", true}}};
  return {};
}

}  // namespace railfix::monitor
