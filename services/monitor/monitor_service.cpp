#include "monitor/monitor_service.hpp"

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <random>

#include "cdr/types.hpp"
#include "core/time.hpp"
#include "messaging/samples.hpp"
#include "messaging/security.hpp"
#include "monitor/foxglove_messages.hpp"

namespace railfix::monitor {
namespace {

using nlohmann::json;
namespace topics = messaging::topics;
using namespace std::chrono_literals;

constexpr size_t kLogKept = 200;
// Who reads /metrics counts as somebody who looks for this long.
constexpr int64_t kScrapeNs = 60 * core::kNsPerSecond;
// Readers go away this long after the last one looked, so that opening a page anew makes none.
constexpr int64_t kLingerNs = 10 * core::kNsPerSecond;
constexpr auto kBeat = 50ms;
// So long a service is told that stopped and that nobody needs.
constexpr int64_t kStoppedShownNs = 120 * core::kNsPerSecond;

std::filesystem::path page_folder(const std::string& configured) {
  if (!configured.empty()) return configured;
  return std::filesystem::read_symlink("/proc/self/exe").parent_path().parent_path() / "share" / "monitor" / "page";
}

std::optional<track::Map> load_map(const std::string& file) {
  if (file.empty()) return std::nullopt;
  return core::value_or_throw(track::Map::load(file));
}

MonitorConfig with_token(MonitorConfig config) {
  if (config.token_file.empty()) return config;
  if (!config.token.empty()) throw core::BadInput("monitor.token and monitor.token_file are both set; leave one out");
  if (std::ifstream file(config.token_file); !std::getline(file, config.token) || config.token.empty())
    throw core::BadInput("monitor.token_file: " + config.token_file + " has no word in its first line; put one there");
  return config;
}

}  // namespace

MonitorService::MonitorService(const Config& config, service::Context& context)
    : config_(with_token(config)),
      context_(context),
      map_(load_map(config.map)),
      map_view_(map_ ? std::make_unique<MapView>(*map_) : nullptr),
      map_api_(map_ ? std::make_unique<MapApi>(*map_, *map_view_) : nullptr),
      files_(page_folder(config.page_folder)),
      control_(context.writer(topics::service_control)),
      begun_ns_(core::monotonic_ns()),
      // Others count their requests too; replies go to everyone.
      next_request_((std::random_device()() & 0xFFFFFFFULL) << 24U),
      watch_(context.participant(), [this](const Arrived& arrived) { this->arrived(arrived); }),
      server_({config.address, static_cast<size_t>(config.client_queue_mb * 1e6), config.slow_client_s,
               static_cast<size_t>(config.most_clients), config.tls_certificate, config.tls_key},
              handlers()),
      cab_(config.picture_hz),
      live_(live_actions()),
      foxglove_(foxglove_actions()) {
  context_.watch_certificate("The page's certificate", config.tls_certificate);
  set_up_topics();
  choose_topics();
  port_ = server_.listen(static_cast<uint16_t>(config.port), static_cast<int>(config.port_search));
  if (config.foxglove_port > 0) {
    foxglove_port_ = server_.listen(static_cast<uint16_t>(config.foxglove_port), static_cast<int>(config.port_search));
    context_.log().info("Foxglove and Lichtblick connect to port {} or {}", foxglove_port_, port_);
  }
  const std::string host = config.address == "0.0.0.0" || config.address == "::" ? "localhost" : config.address;
  address_ = (config.tls_key.empty() ? "http://" : "https://") +
             (host.find(':') == std::string::npos ? host : "[" + host + "]") + ":" + std::to_string(port_) + "/";
  if (config.port != 0 && port_ != config.port) {
    context_.log().warn("port {} is taken by another program; the page is at {}", config.port, address_);
  } else {
    context_.log().info("the page is at {}", address_);
  }
  if (const std::string said = exposure(); !said.empty()) context_.log().warn("{}", said);
  context_.health().serves(address_);
  context_.on_command("address", [this](const std::string&) { return core::Result<std::string>(address_); });
  context_.at_restart([this](int64_t) { restart(); });
  start_timers();
  server_.start();
}

void MonitorService::restart() {
  state_ = {};
  state_sent_ns_ = 0;
  if (awaits_since_ns_) awaits_since_ns_ = core::monotonic_ns();
  pose_ = {};
  choice_ = {};
  gnss_ = {};
  trail_ = {};
  reports_.clear();
  standing_.erase(topics::train_position_report.name);
}

MonitorService::~MonitorService() = default;

void MonitorService::start_timers() {
  context_.every_while([this] { return !nobody_looks(); }, kBeat, [this] { beat(); });
  context_.every(std::chrono::nanoseconds(messaging::ServiceBoard::kLookNs), [this] {
    watch_.drain();
    look_for_silence();
  });
  context_.every(1s, [this] {
    written_ = context_.participant().written_topics();
    show_channels();
    choose_topics();
    await_data();
    const TrainSeen train = train_seen();
    forget_stopped(train);
    look_for_problems(train);
    publish_topics();
    publish_beat();
    give_up_waiting();
    context_.health().dropped(watch_.take_dropped());
    if (state_.age_s(core::monotonic_ns()) > 1) publish_state();
  });
}

// Twenty times a second while somebody looks.
void MonitorService::beat() {
  const auto each = [this](uint64_t beats) { return beats_ % beats == 0; };
  ++beats_;
  watch_.drain();
  publish_pictures();
  if (each(2) && state_.arrived_ns != state_sent_ns_) publish_state();
  if (each(4)) publish_curvature();
  if (each(5)) publish_log();
  if (each(10)) publish_services();
}

void MonitorService::set_up_topics() {
  on_topic_["service_status"] = [this](const Arrived& arrived) {
    const auto& status = arrived.as<msg::ServiceStatus>();
    services_.note(status, arrived.info.arrived_ns, arrived.info.writer);
    if (!awaits_since_ns_ && std::string(status.service().c_str()) == "fusion")
      awaits_since_ns_ = arrived.info.arrived_ns;
  };
  const auto keep = [this]<class T>(const messaging::Topic<T>& topic, Newest<T>& newest) {
    on_topic_[topic.name] = [&newest](const Arrived& arrived) { newest.take(arrived); };
  };
  keep(topics::train_pose, pose_);
  keep(topics::gnss_fix, gnss_);
  keep(topics::recorder_status, recorder_);
  keep(topics::player_status, player_);
  keep(topics::data_clock, clock_);
  on_topic_["train_state"] = [this](const Arrived& arrived) {
    state_.take(arrived);
    if (foxglove_.watched(kFoxglovePlace)) {
      const auto fix = location_fix(*state_.sample, recent(pose_) ? &*pose_.sample : nullptr);
      if (!fix.empty()) foxglove_.publish(kFoxglovePlace, {arrived.info.received_ns, fix});
    }
  };
  on_topic_["camera_calibration"] = [this](const Arrived& arrived) {
    cab_.calibration(arrived.as<msg::CameraCalibration>());
  };
  on_topic_["track_view"] = [this](const Arrived& arrived) { on_track(arrived.as<msg::TrackView>()); };
  on_topic_["camera_preview"] = [this](const Arrived& arrived) {
    cab_.picture(arrived.name.substr(arrived.name.find('/') + 1),
                 std::static_pointer_cast<const msg::CameraPreview>(arrived.sample), arrived.info);
  };
  on_topic_["position_fix"] = [this](const Arrived& arrived) {
    if (arrived.as<msg::PositionFix>().kind() == msg::FIX_TRACK) choice_.take(arrived);
  };
  on_topic_["log_record"] = [this](const Arrived& arrived) { on_log(arrived); };
  on_topic_["train_position_report"] = [this](const Arrived& arrived) { on_report(arrived); };
  on_topic_["service_reply"] = [this](const Arrived& arrived) { reply(arrived.as<msg::ControlReply>()); };
}

void MonitorService::arrived(const Arrived& arrived) {
  context_.health().input();
  context_.health().active();
  const auto handler = on_topic_.find(arrived.topic.name);
  if (handler != on_topic_.end()) handler->second(arrived);
  hand_to_foxglove(arrived);
  if (arrived.topic.name == "recorder_status" || arrived.topic.name == "player_status") {
    const std::string kind = arrived.topic.name == "recorder_status" ? "recorder" : "player";
    if (live_.watched(kind)) live_.publish(kind, status_message(kind, arrived.topic, arrived.sample.get()));
  }
}

// Every topic as it is; the last one of a standing value for those who subscribe later.
void MonitorService::hand_to_foxglove(const Arrived& arrived) {
  const bool standing = arrived.topic.qos.transient_local;
  if (!standing && !foxglove_.watched(arrived.name)) return;
  const auto cdr = arrived.topic.type->serialize(arrived.sample.get());
  FoxgloveMessage message{arrived.info.received_ns, std::string(cdr.begin(), cdr.end())};
  foxglove_.publish(arrived.name, message);
  const bool overtaken = arrived.topic.name == topics::train_position_report.name && !report_is_newest_;
  if (standing && !overtaken) standing_[arrived.name] = std::move(message);
}

// Curvature is the sixth of seven states in track_view's covariance (upper triangle, row by row).
void MonitorService::on_track(const msg::TrackView& view) {
  cab_.track(view);
  if (!state_.sample || view.seen_left() == 0 || view.seen_right() == 0) return;
  trail_.add(state_.sample->distance_m(), view.curvature_per_m(),
             std::sqrt(view.covariance()[messaging::kCurvatureVariance]));
}

void MonitorService::on_log(const Arrived& arrived) {
  const auto& record = arrived.as<msg::LogRecord>();
  if (foxglove_.watched(kFoxgloveLog)) {
    foxglove_.publish(kFoxgloveLog, {arrived.info.received_ns, foxglove_log(record)});
  }
  log_.push_back(log_record(record));
  if (live_.watched("log")) log_fresh_.push_back(log_.back());
  if (log_.size() > kLogKept) log_.pop_front();
}

void MonitorService::on_report(const Arrived& arrived) {
  ++reports_sent_;
  const auto& report = arrived.as<msg::TrainPositionReport>();
  report_is_newest_ = reports_.take(report, arrived.info.received_ns);
  if (report_is_newest_) live_.publish("reports", report_message(report), true);
}

// Cameras that have a preview now.
std::set<std::string> MonitorService::cameras() const {
  constexpr std::string_view kPreview = "camera_preview/";
  std::set<std::string> names;
  for (const auto& name : written_) {
    if (name.starts_with(kPreview)) names.insert(name.substr(kPreview.size()));
  }
  return names;
}

// What is light and needed to know whether the train is well is read all the time; the rest while somebody looks.
std::set<std::string> MonitorService::wanted_topics() const {
  std::set<std::string> names{
      "service_status",        "log_record", "recorder_status", "player_status",      "train_state",
      "train_position_report", "gnss_fix",   "service_reply",   "camera_calibration", "data_clock"};
  if (live_.watched("state")) names.insert({"train_pose", "position_fix"});
  if (live_.watched("curvature")) names.insert("track_view");
  if (live_.watched("topics") || scraped()) {
    for (const auto& topic : messaging::all_topics()) {
      if (!topic.name.starts_with("camera_")) names.insert(topic.name);
    }
  }
  for (const auto& camera : cameras()) {
    const bool drawn = foxglove_.watched(foxglove_picture(camera)) || foxglove_.watched(foxglove_rails(camera));
    if (drawn || live_.watched("view:" + camera)) names.insert({"track_view", "camera_preview/" + camera});
  }
  for (const auto& topic : foxglove_.watched()) {
    if (messaging::find_topic(topic) != nullptr) names.insert(topic);
  }
  if (foxglove_.watched(kFoxglovePlace)) names.insert("train_pose");
  return names;
}

bool MonitorService::scraped() const {
  return scraped_ns_ != 0 && core::monotonic_ns() - scraped_ns_ < kScrapeNs;
}

// A page in the background asks for the problems alone, and those are looked for once a second.
bool MonitorService::nobody_looks() const {
  const auto is_problems = [](const std::string& kind) { return kind == "problems"; };
  return std::ranges::all_of(live_.watched(), is_problems) && foxglove_.watched().empty() && waiting_.empty();
}

void MonitorService::choose_topics() {
  const int64_t now_ns = core::monotonic_ns();
  for (const auto& name : wanted_topics()) wanted_ns_[name] = now_ns;
  std::erase_if(wanted_ns_, [&](const auto& entry) { return now_ns - entry.second > kLingerNs; });
  std::set<std::string> names;
  for (const auto& [name, at_ns] : wanted_ns_) names.insert(name);
  watch_.read(names);
}

void MonitorService::show_channels() {
  if (config_.foxglove_port < 0) return;
  const auto now = cameras();
  if (shown_cameras_ == now) return;
  shown_cameras_ = now;
  auto channels = drawn_channels(now);
  const auto add = [&](const std::string& name, const messaging::TopicInfo& topic) {
    channels.push_back(cdr_channel(name, topic.type->name(), std::string(cdr::own_idl_of(topic.type->name()))));
  };
  for (const auto& topic : messaging::all_topics()) {
    if (!topic.name.starts_with("camera_") || topic.name == "camera_calibration") add(topic.name, topic);
    if (topic.name != "camera_preview") continue;
    for (const auto& camera : now) add(topic.name + "/" + camera, topic);
  }
  foxglove_.set_channels(channels);
}

// What is measured live has no clock that would end the silence which a replay has left.
bool MonitorService::played_data_has_ended() const {
  if (!clock_.sample || clock_.sample->ended() == 0) return false;
  const auto newest_ns = std::max(state_.arrived_ns, gnss_.arrived_ns);
  return core::seconds(newest_ns - clock_.arrived_ns) < kAbsentS;
}

// Played data keeps the stamps that it was recorded with; what comes after its end is live again.
bool MonitorService::is_live() const {
  if (recent(player_)) return false;
  return !clock_.sample || (clock_.sample->ended() != 0 && !played_data_has_ended());
}

TrainSeen MonitorService::train_seen() {
  TrainSeen train;
  train.now_ns = core::monotonic_ns();
  train.watched_since_ns = begun_ns_;
  train.services = &services_;
  for (const auto& name : config_.expected) train.expected.push_back(Expected::of(name));
  for (const auto& [name, topic] : watch_.topics()) {
    if (!topic.reader) continue;
    train.topics.push_back({name, topic.statistics.numbers(train.now_ns), topic.statistics.usual_gap_s(),
                            std::ranges::binary_search(written_, name)});
  }
  train.state = state_.sample;
  train.state_age_s = state_.age_s(train.now_ns);
  if (!state_.sample && awaits_since_ns_) train.awaited_s = core::seconds(train.now_ns - *awaits_since_ns_);
  train.no_map = !map_;
  if (state_.sample && is_live()) train.state_behind_s = state_.behind_s();
  if (recent(recorder_)) train.recorder = recorder_.sample;
  if (recent(gnss_)) train.gnss = gnss_.sample;
  train.played = recent(player_);
  train.data_stands = played_data_has_ended() || (train.played && player_.sample->state() != msg::PLAYER_PLAYING);
  std::error_code failed;
  const auto shared_memory = std::filesystem::space("/dev/shm", failed);
  if (!failed) train.shared_memory_free_mb = static_cast<double>(shared_memory.available) / 1e6;
  for (const auto& one : context_.participant().certificates()) {
    const size_t at = one.process.find('@');
    train.certificates.push_back(
        {one.process.substr(0, at), one.process.substr(at + 1), messaging::days_until(one.ends_ns)});
  }
  train.certificate_days = config_.certificate_days;
  train.keys_command = messaging::keys_command({});
  train.interval_wide_m = config_.interval_wide_m;
  train.disk_low_mb = config_.disk_low_mb;
  return train;
}

void MonitorService::look_for_silence() {
  if (recent(player_)) services_.note_player(player_.arrived_ns);
  if (!services_.note_silence(core::monotonic_ns())) return;
  publish_services();
  look_for_problems(train_seen());
}

void MonitorService::publish_services() {
  if (!live_.watched("services")) return;
  for (const auto& message : first("services")) live_.publish("services", message);
}

// From data that has not begun no position can come.
void MonitorService::await_data() {
  if (awaits_since_ns_ && waiting_source(services_) != nullptr) awaits_since_ns_ = core::monotonic_ns();
}

void MonitorService::look_for_problems(const TrainSeen& train) {
  looked_ = true;
  if (!problems_.update(find_problems(train), core::monotonic_ns())) return;
  for (const auto& message : first("problems")) live_.publish("problems", message);
}

void MonitorService::forget_stopped(const TrainSeen& train) {
  services_.forget_stopped(train.now_ns - kStoppedShownNs, [&](const auto& key) { return train.needs(key); });
}

}  // namespace railfix::monitor
