// How the monitor service answers HTTP, lets WebSockets in, and passes on what they ask for.
#include <stdexcept>

#include "core/cut_text.hpp"
#include "core/time.hpp"
#include "messaging/reader_troubles.hpp"
#include "monitor/metrics.hpp"
#include "monitor/monitor_service.hpp"
#include "service/release.hpp"

namespace railfix::monitor {
namespace {

using nlohmann::json;

constexpr int64_t kAnswerNs = 10 * core::kNsPerSecond;
constexpr const char* kText = "text/plain; charset=utf-8";

Response json_response(const json& body) {
  return {200, "application/json", text_of(body) + "\n", "", "no-store"};
}

bool speaks_foxglove(const Request& request) {
  return request.path != "/api/live";
}

}  // namespace

Handlers MonitorService::handlers() {
  Handlers handlers;
  handlers.request = [this](const Request& request, std::function<void(Response)> answer) {
    const bool ours = request.path.starts_with("/api/") || request.path == "/healthz" || request.path == "/metrics";
    if (!ours) return answer(files_.get(request));
    context_.post([this, request, answer = std::move(answer)] { answer(this->answer(request)); });
  };
  handlers.upgrade = [this](const Request& request) { return upgrade(request); };
  handlers.opened = [this](const ClientPtr& client) {
    context_.post([this, client] {
      if (speaks_foxglove(client->request())) return foxglove_.opened(client);
      live_.opened(client);
    });
  };
  handlers.message = [this](const ClientPtr& client, const std::string& text, bool binary) {
    context_.post([this, client, text, binary] {
      if (speaks_foxglove(client->request())) return foxglove_.message(client, text, binary);
      live_.message(client, text);
    });
  };
  handlers.closed = [this](const ClientPtr& client, const std::string& why) {
    context_.post([this, client, why] {
      if (!why.empty()) {
        ++slow_viewers_;
        context_.log().warn("a viewer was disconnected: {}", why);
      }
      if (speaks_foxglove(client->request())) return foxglove_.closed(client);
      live_.closed(client);
    });
  };
  handlers.slow = [this](const ClientPtr& client) { context_.post([this, client] { foxglove_.slow(client); }); };
  handlers.handler_failed = [this](const std::string& why) {
    context_.post([this, why] { context_.log().error("the request of a viewer failed: {}", why); });
  };
  // Thrown in the service's thread it ends the service.
  handlers.server_failed = [this](const std::string& why) {
    context_.post([why] { throw std::runtime_error("the page cannot be served any more: " + why); });
  };
  return handlers;
}

Handlers::Upgrade MonitorService::upgrade(const Request& request) const {
  const auto refuse = [](unsigned status, const char* why) {
    return Handlers::Upgrade{false, "", {status, kText, why, "", "no-store"}};
  };
  if (speaks_foxglove(request)) {
    const std::string subprotocol = foxglove_subprotocol(request.subprotocols);
    if (config_.foxglove_port >= 0 && !subprotocol.empty()) return {true, subprotocol, {}};
    return refuse(400, "this WebSocket speaks foxglove.sdk.v1 and foxglove.websocket.v1; the page's is /api/live\n");
  }
  // Any page of the internet may try to open a WebSocket to this address from the viewer's browser.
  if (!request.origin.empty() && host_of(request.origin) != request.host)
    return refuse(403, "only the monitor's own page may connect\n");
  return {true, "", {}};
}

LiveApi::Actions MonitorService::live_actions() {
  LiveApi::Actions actions;
  actions.hello = [this] {
    return json{{"kind", "hello"},
                {"train", context_.common().train_id},
                {"version", service::release()},
                {"host", context_.common().host},
                {"now_ns", core::wall_ns()}};
  };
  actions.first = [this](const std::string& kind) { return first(kind); };
  actions.watch_changed = [this] { choose_topics(); };
  actions.control = [this](const ClientPtr& client, const ControlAsk& ask) { control(client, ask); };
  return actions;
}

FoxgloveApi::Actions MonitorService::foxglove_actions() {
  FoxgloveApi::Actions actions;
  actions.name = "Railfix, train " + context_.common().train_id;
  actions.metadata = {{"train", context_.common().train_id},
                      {"version", service::release()},
                      {"host", context_.common().host},
                      {"session", context_.common().train_id + "-" + std::to_string(core::wall_ns())}};
  actions.watch_changed = [this] { choose_topics(); };
  actions.first = [this](const std::string& topic) {
    const auto standing = standing_.find(topic);
    return standing == standing_.end() ? std::vector<FoxgloveMessage>{} : std::vector{standing->second};
  };
  return actions;
}

// What the operator should know who opens the page to others; empty = nobody but this computer.
std::string MonitorService::exposure() const {
  if (names_this_computer(config_.address)) return "";
  const bool tls = !config_.tls_key.empty();
  const std::string sees = "everybody who reaches " + config_.address + " sees the page, its pictures and /metrics" +
                           (tls ? "; " : ", without encryption; ");
  if (!config_.control) return sees + "nobody can control anything";
  if (config_.token.empty()) {
    const bool local_too = config_.address == "0.0.0.0" || config_.address == "::";
    return sees + (local_too ? "control only from this computer at localhost" : "nobody can control anything") +
           ", because neither monitor.token nor monitor.token_file is set";
  }
  if (tls) return sees + "control asks for the token";
  return sees +
         "control asks for the token, which travels as it is: use a network that only the train is on, or "
         "monitor.tls_certificate";
}

std::string MonitorService::control_of(const Request& request) const {
  if (!config_.control) return "off";
  if (!config_.token.empty()) return "token";
  return request.local ? "open" : "no_token";
}

json MonitorService::about(const Request& request) const {
  json map = nullptr;
  if (map_) map = {{"name", map_->name}, {"edges", map_->edges.size()}, {"length_m", map_view_->length_m()}};
  return {{"train", context_.common().train_id},
          {"version", service::release()},
          {"host", context_.common().host},
          {"now_ns", core::wall_ns()},
          {"cameras", cameras()},
          {"control", control_of(request)},
          {"map", map}};
}

Response MonitorService::map_answer(const Request& request) {
  if (!map_api_) return {404, kText, "no map is in use; set monitor.map\n", "", "no-store"};
  return map_api_->get(request, place());
}

Response MonitorService::metrics_answer() {
  scraped_ns_ = core::monotonic_ns();
  const TrainSeen seen = train_seen();
  MetricsInput input{context_.common().train_id, service::release(), context_.common().host, &seen,        {},
                     &problems_.problems(),      reports_sent_,      server_.clients(),      slow_viewers_};
  const auto troubles = messaging::reader_troubles(context_.participant());
  for (const auto& [name, topic] : watch_.topics()) {
    if (!topic.reader) continue;
    const auto found = troubles.find(name);
    const auto trouble = found == troubles.end() ? messaging::ReaderTroubles() : found->second;
    input.topics.push_back({name, topic.reader->matched_writers(), topic.statistics.numbers(seen.now_ns),
                            topic.reader->dropped(), trouble.rejected, trouble.deadlines_missed,
                            topic.statistics.latency_counts(), topic.statistics.latency_sum_s()});
  }
  return {200, "text/plain; version=0.0.4; charset=utf-8", metrics_text(input), "", "no-store"};
}

Response MonitorService::health_answer() {
  const auto& problems = problems_.problems();
  const bool bad = !problems.empty() && problems.front().level == Level::error;
  return {bad ? 503U : 200U, kText, bad ? problems.front().what + "\n" : "ok\n", "", "no-store"};
}

Response MonitorService::answer(const Request& request) {
  if (request.method != "GET" && request.method != "HEAD") {
    return {405, kText, "only GET and HEAD\n", "", "no-store"};
  }
  if (request.path == "/api/about") return json_response(about(request));
  if (request.path == "/api/map") return map_answer(request);
  if (request.path == "/metrics") return metrics_answer();
  if (request.path == "/healthz") return health_answer();
  return {404, kText, "there is nothing here\n", "", "no-store"};
}

void MonitorService::control(const ClientPtr& client, const ControlAsk& ask) {
  const std::string allowed = control_of(client->request());
  const auto refuse = [&](const std::string& why) { live_.reply(ask.client, ask.id, false, why); };
  if (allowed == "off") return refuse("control is switched off (monitor.control)");
  if (allowed == "no_token")
    return refuse("control is only allowed from this computer itself; set monitor.token for others");
  if (allowed == "token" && ask.token != config_.token) return refuse("the token is wrong");
  if (ask.service != "recorder" && ask.service != "player") {
    return refuse("only recorder and player can be controlled from here, not '" + ask.service + "'");
  }
  msg::ControlRequest request;
  request.request_id(++next_request_);
  request.service(ask.service);
  request.command(core::cut_text(ask.command, 32));
  request.argument(core::cut_text(ask.argument, 256));
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
