#include "monitor/monitor_service.hpp"

#include <algorithm>
#include <filesystem>
#include <random>

#include "cdr/decode.hpp"
#include "core/time.hpp"

namespace railfix::monitor {
namespace {

using nlohmann::json;
namespace topics = messaging::topics;
using namespace std::chrono_literals;

constexpr size_t kLogKept = 200;
constexpr size_t kReportsKept = 20;
constexpr int64_t kAnswerNs = 10 * core::kNsPerSecond;
// Whose status comes once a second is gone when none came for this long.
constexpr int64_t kAbsentNs = 5 * core::kNsPerSecond;

std::filesystem::path page_folder(const std::string& configured) {
  if (!configured.empty()) return configured;
  return std::filesystem::read_symlink("/proc/self/exe").parent_path().parent_path() / "share" / "monitor" / "page";
}

Response json_response(const json& body) {
  return {200, "application/json", text_of(body) + "\n", "", "no-store"};
}

std::optional<track::Map> load_map(const std::string& file) {
  if (file.empty()) return std::nullopt;
  return core::value_or_throw(track::Map::load(file));
}

}  // namespace

MonitorService::MonitorService(const Config& config, service::Context& context)
    : config_(config),
      context_(context),
      map_(load_map(config.map)),
      files_(page_folder(config.page_folder)),
      control_(context.writer(topics::service_control)),
      begun_ns_(core::wall_ns()),
      // Others count their requests too; replies go to everyone.
      next_request_((std::random_device()() & 0xFFFFFFFULL) << 24U),
      watch_(context.participant(), [this](const Arrived& arrived) { this->arrived(arrived); }),
      server_({config.address, static_cast<size_t>(config.client_queue_mb * 1e6), config.slow_client_s,
               static_cast<size_t>(config.most_clients)},
              handlers()),
      live_(live_actions()) {
  set_up_topics();
  choose_topics();
  port_ = server_.listen(static_cast<uint16_t>(config.port), static_cast<int>(config.port_search));
  const std::string host = config.address == "0.0.0.0" || config.address == "::" ? "localhost" : config.address;
  address_ =
      "http://" + (host.find(':') == std::string::npos ? host : "[" + host + "]") + ":" + std::to_string(port_) + "/";
  if (config.port != 0 && port_ != config.port) {
    context_.log().warn("port {} is taken by another program; the page is at {}", config.port, address_);
  } else {
    context_.log().info("the page is at {}", address_);
  }
  context_.on_command("address", [this](const std::string&) { return core::Result<std::string>(address_); });
  start_timers();
  server_.start();
}

MonitorService::~MonitorService() = default;

void MonitorService::start_timers() {
  context_.every(50ms, [this] { watch_.drain(); });
  context_.every(100ms, [this] {
    if (state_.received_ns != state_sent_ns_) publish_state();
  });
  context_.every(250ms, [this] { publish_log(); });
  context_.every(500ms, [this] { live_.publish("services", services_message(services_, core::wall_ns())); });
  context_.every(1s, [this] {
    written_ = context_.participant().written_topics();
    choose_topics();
    look_for_problems();
    publish_topics();
    give_up_waiting();
    if (core::wall_ns() - state_.received_ns > core::kNsPerSecond) publish_state();
  });
}

// ---- samples

void MonitorService::set_up_topics() {
  on_topic_["service_status"] = [this](const Arrived& arrived) {
    const auto& status = arrived.as<msg::ServiceStatus>();
    if (arrived.info.valid) {
      services_.note(status, core::wall_ns());
    } else {
      services_.note_silent(status, core::wall_ns());
    }
  };
  const auto keep = [this]<class T>(const messaging::Topic<T>& topic, Newest<T>& newest) {
    on_topic_[topic.name] = [&newest](const Arrived& arrived) {
      if (arrived.info.valid) newest.take(arrived);
    };
  };
  keep(topics::train_state, state_);
  keep(topics::train_pose, pose_);
  keep(topics::gnss_fix, gnss_);
  keep(topics::recorder_status, recorder_);
  keep(topics::player_status, player_);
  keep(topics::data_clock, clock_);
  on_topic_["position_fix"] = [this](const Arrived& arrived) {
    if (arrived.info.valid && arrived.as<msg::PositionFix>().kind() == msg::FIX_TRACK) choice_.take(arrived);
  };
  on_topic_["log_record"] = [this](const Arrived& arrived) { on_log(arrived); };
  on_topic_["train_position_report"] = [this](const Arrived& arrived) { on_report(arrived); };
  on_topic_["service_reply"] = [this](const Arrived& arrived) {
    if (arrived.info.valid) reply(arrived.as<msg::ControlReply>());
  };
}

void MonitorService::arrived(const Arrived& arrived) {
  context_.health().input();
  context_.health().active();
  const auto handler = on_topic_.find(arrived.topic.name);
  if (handler != on_topic_.end()) handler->second(arrived);
  if (arrived.info.valid && (arrived.topic.name == "recorder_status" || arrived.topic.name == "player_status")) {
    const std::string kind = arrived.topic.name == "recorder_status" ? "recorder" : "player";
    if (live_.watched(kind))
      live_.publish(kind, status_message(kind, arrived.name, arrived.topic, arrived.sample.get()));
  }
}

void MonitorService::on_log(const Arrived& arrived) {
  if (!arrived.info.valid) return;
  log_.push_back(log_record(arrived.as<msg::LogRecord>()));
  log_fresh_.push_back(log_.back());
  if (log_.size() > kLogKept) log_.pop_front();
}

void MonitorService::publish_log() {
  if (log_fresh_.empty()) return;
  live_.publish("log", log_message(std::exchange(log_fresh_, json::array())), true);
}

void MonitorService::on_report(const Arrived& arrived) {
  if (!arrived.info.valid) return;
  reports_.push_back(report_message(arrived.as<msg::TrainPositionReport>()));
  if (reports_.size() > kReportsKept) reports_.pop_front();
  live_.publish("reports", reports_.back(), true);
}

// What is light and needed to know whether the train is well is read all the time; the rest while somebody looks.
void MonitorService::choose_topics() {
  std::set<std::string> names{"service_status", "log_record",        "recorder_status",       "player_status",
                              "train_state",    "onboard_status",    "train_position_report", "gnss_fix",
                              "service_reply",  "landmark_sighting", "camera_calibration",    "data_clock"};
  if (live_.watched("state")) names.insert({"train_pose", "position_fix"});
  if (live_.watched("curvature")) names.insert("track_view");
  const bool scraped = scraped_ns_ != 0 && core::wall_ns() - scraped_ns_ < 60 * core::kNsPerSecond;
  if (live_.watched("topics") || scraped) {
    for (const auto& topic : messaging::all_topics()) {
      if (!topic.name.starts_with("camera_")) names.insert(topic.name);
    }
  }
  for (const std::string& kind : live_.watched()) {
    if (!kind.starts_with("view:")) continue;
    names.insert("track_view");
    names.insert("camera_preview/" + kind.substr(5));
  }
  watch_.read(names);
}

// ---- what is wrong

TrainSeen MonitorService::train_seen() {
  TrainSeen train;
  train.now_ns = core::wall_ns();
  train.watched_since_ns = begun_ns_;
  train.services = &services_;
  train.expected = config_.expected;
  for (const auto& [name, topic] : watch_.topics()) {
    if (!topic.reader) continue;
    train.topics.push_back({name, topic.statistics.numbers(train.now_ns), topic.statistics.usual_gap_s(),
                            std::ranges::binary_search(written_, name)});
  }
  train.state = state_.sample;
  train.state_age_s = core::seconds(train.now_ns - state_.received_ns);
  if (train.now_ns - recorder_.received_ns < kAbsentNs) train.recorder = recorder_.sample;
  if (train.now_ns - gnss_.received_ns < kAbsentNs) train.gnss = gnss_.sample;
  train.played = player_.sample && train.now_ns - player_.received_ns < kAbsentNs;
  train.data_stands = (clock_.sample && clock_.sample->ended() != 0) ||
                      (train.played && player_.sample->state() != msg::PLAYER_PLAYING);
  std::error_code failed;
  const auto shared_memory = std::filesystem::space("/dev/shm", failed);
  if (!failed) train.shared_memory_free_mb = static_cast<double>(shared_memory.available) / 1e6;
  train.interval_wide_m = config_.interval_wide_m;
  train.disk_low_mb = config_.disk_low_mb;
  return train;
}

void MonitorService::look_for_problems() {
  if (!problems_.update(find_problems(train_seen()), core::wall_ns())) return;
  live_.publish("problems", problems_message(problems_.problems()));
}

// ---- what is shown

void MonitorService::publish_state() {
  if (!live_.watched("state")) return;
  state_sent_ns_ = state_.received_ns;
  for (const auto& message : first("state")) live_.publish("state", message);
}

void MonitorService::publish_topics() {
  if (!live_.watched("topics")) return;
  for (const auto& message : first("topics")) live_.publish("topics", message);
}

json MonitorService::status_message(const std::string& kind, const std::string& topic, const messaging::TopicInfo& info,
                                    const void* sample) const {
  cdr::DecodeOptions options;
  options.name_constants = true;
  const auto decoded = cdr::decode(cdr::own_types(), info.type->name(), info.type->serialize(sample), options);
  if (!decoded.ok()) {
    context_.log().warn("{} cannot be shown: {}", topic, decoded.error().message);
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

std::vector<json> MonitorService::first(const std::string& kind) {
  const int64_t now_ns = core::wall_ns();
  if (kind == "state") {
    if (!state_.sample) return {{{"kind", "state"}, {"age_s", nullptr}}};
    const double age_s = core::seconds(now_ns - state_.received_ns);
    if (age_s > 1) return {{{"kind", "state"}, {"age_s", age_s}}};
    const auto recent = [&](int64_t received_ns) { return now_ns - received_ns < kAbsentNs; };
    return {state_message(*state_.sample, age_s, recent(pose_.received_ns) ? &*pose_.sample : nullptr,
                          recent(choice_.received_ns) ? &*choice_.sample : nullptr, map_ ? &*map_ : nullptr)};
  }
  if (kind == "services") return {services_message(services_, now_ns)};
  if (kind == "topics") {
    std::vector<TopicShown> shown;
    std::set<std::string> names(written_.begin(), written_.end());
    for (const auto& [name, topic] : watch_.topics()) {
      if (topic.reader) names.insert(name);
    }
    for (const auto& name : names) {
      const auto read = watch_.topics().find(name);
      const bool measured = read != watch_.topics().end() && read->second.reader;
      const auto* info = messaging::find_topic(name);
      TopicShown one{name, info == nullptr ? "unknown" : info->type->name(), 1, measured, {}};
      if (measured) {
        one.writers = read->second.reader->matched_writers();
        one.numbers = read->second.statistics.numbers(now_ns);
      }
      shown.push_back(std::move(one));
    }
    return {topics_message(shown)};
  }
  if (kind == "log") return {log_message(json(log_))};
  if (kind == "reports") return {reports_.begin(), reports_.end()};
  if (kind == "problems") return {problems_message(problems_.problems())};
  if (kind == "recorder") {
    if (!recorder_.sample || now_ns - recorder_.received_ns > kAbsentNs) return {{{"kind", kind}, {"absent", true}}};
    return {status_message(kind, kind, messaging::info_of(topics::recorder_status), &*recorder_.sample)};
  }
  if (kind == "player") {
    if (!player_.sample || now_ns - player_.received_ns > kAbsentNs) return {{{"kind", kind}, {"absent", true}}};
    return {status_message(kind, kind, messaging::info_of(topics::player_status), &*player_.sample)};
  }
  return {};
}

// ---- clients

Handlers MonitorService::handlers() {
  Handlers handlers;
  handlers.request = [this](const Request& request, std::function<void(Response)> answer) {
    const bool ours = request.path.starts_with("/api/") || request.path == "/healthz" || request.path == "/metrics";
    if (!ours) return answer(files_.get(request));
    context_.post([this, request, answer = std::move(answer)] { answer(this->answer(request)); });
  };
  handlers.upgrade = [this](const Request& request) { return upgrade(request); };
  handlers.opened = [this](const ClientPtr& client) { context_.post([this, client] { live_.opened(client); }); };
  handlers.message = [this](const ClientPtr& client, const std::string& text, bool) {
    context_.post([this, client, text] { live_.message(client, text); });
  };
  handlers.closed = [this](const ClientPtr& client, const std::string& why) {
    context_.post([this, client, why] {
      if (!why.empty()) context_.log().warn("a viewer was disconnected: {}", why);
      live_.closed(client);
    });
  };
  handlers.slow = [](const ClientPtr&, uint64_t) {};
  return handlers;
}

Handlers::Upgrade MonitorService::upgrade(const Request& request) const {
  const auto refuse = [](unsigned status, const char* why) {
    return Handlers::Upgrade{false, "", {status, "text/plain; charset=utf-8", why, "", "no-store"}};
  };
  if (request.path != "/api/live") return refuse(404, "there is no WebSocket here; the page uses /api/live\n");
  // Any page of the internet may try to open a WebSocket to this address from the viewer's browser.
  const size_t scheme = request.origin.find("://");
  const std::string origin = scheme == std::string::npos ? request.origin : request.origin.substr(scheme + 3);
  if (!origin.empty() && origin != request.host) return refuse(403, "only the monitor's own page may connect\n");
  return {true, "", {}};
}

LiveApi::Actions MonitorService::live_actions() {
  LiveApi::Actions actions;
  actions.hello = [this](const Client&) {
    return json{{"kind", "hello"},
                {"train", context_.common().train_id},
                {"version", RAILFIX_VERSION},
                {"host", context_.common().host},
                {"now_ns", core::wall_ns()}};
  };
  actions.first = [this](const std::string& kind) { return first(kind); };
  actions.watch_changed = [this] { choose_topics(); };
  actions.control = [this](const ClientPtr& client, const ControlAsk& ask) { control(client, ask); };
  return actions;
}

std::string MonitorService::control_of(const Request& request) const {
  if (!config_.control) return "off";
  if (!config_.token.empty()) return "token";
  return request.local ? "open" : "off";
}

json MonitorService::about(const Request& request) const {
  json cameras = json::array();
  for (const auto& name : written_) {
    constexpr std::string_view kPreview = "camera_preview/";
    if (name.starts_with(kPreview)) cameras.push_back(name.substr(kPreview.size()));
  }
  json map = nullptr;
  if (map_) {
    double length_m = 0;
    for (const auto& edge : map_->edges) length_m += edge.alignment.length_m();
    map = {{"name", map_->name}, {"edges", map_->edges.size()}, {"length_m", length_m}};
  }
  return {{"train", context_.common().train_id},
          {"version", RAILFIX_VERSION},
          {"host", context_.common().host},
          {"now_ns", core::wall_ns()},
          {"cameras", cameras},
          {"control", control_of(request)},
          {"map", map}};
}

Response MonitorService::answer(const Request& request) {
  if (request.method != "GET" && request.method != "HEAD") {
    return {405, "text/plain; charset=utf-8", "only GET and HEAD\n", "", "no-store"};
  }
  if (request.path == "/api/about") return json_response(about(request));
  if (request.path == "/healthz") {
    const auto& problems = problems_.problems();
    const bool bad = !problems.empty() && problems.front().level == Level::error;
    Response response;
    response.status = bad ? 503 : 200;
    response.body = bad ? problems.front().what + "\n" : "ok\n";
    return response;
  }
  return {404, "text/plain; charset=utf-8", "there is nothing here\n", "", "no-store"};
}

// ---- control

void MonitorService::control(const ClientPtr& client, const ControlAsk& ask) {
  const std::string allowed = control_of(client->request());
  const auto refuse = [&](const std::string& why) { live_.reply(ask.client, ask.id, false, why); };
  if (allowed == "off") {
    return refuse(config_.control ? "control is only allowed from this computer itself; set monitor.token for others"
                                  : "control is switched off (monitor.control)");
  }
  if (allowed == "token" && ask.token != config_.token) return refuse("the token is wrong");
  if (ask.service != "recorder" && ask.service != "player") {
    return refuse("only recorder and player can be controlled from here, not '" + ask.service + "'");
  }
  msg::ControlRequest request;
  request.request_id(++next_request_);
  request.service(ask.service);
  request.command(ask.command.substr(0, 32));
  request.argument(ask.argument.substr(0, 256));
  waiting_[next_request_] = {ask.client, ask.id, ask.service, core::monotonic_ns()};
  context_.log().info("from the page: {} {} {}", ask.service, ask.command, ask.argument);
  control_.write(request);
}

void MonitorService::reply(const msg::ControlReply& reply) {
  const auto waiting = waiting_.find(reply.request_id());
  if (waiting == waiting_.end()) return;
  live_.reply(waiting->second.client, waiting->second.id, reply.done(), reply.text().c_str());
  waiting_.erase(waiting);
}

void MonitorService::give_up_waiting() {
  std::erase_if(waiting_, [this](const auto& entry) {
    if (core::monotonic_ns() - entry.second.asked_ns < kAnswerNs) return false;
    live_.reply(entry.second.client, entry.second.id, false, entry.second.service + " does not answer; is it running?");
    return true;
  });
}

}  // namespace railfix::monitor
