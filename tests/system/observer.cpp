#include "system/observer.hpp"

#include <arpa/inet.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/socket.h>

#include <algorithm>
#include <cmath>
#include <csignal>
#include <iostream>

#include "core/time.hpp"
#include "ground_link/ground_report.hpp"
#include "messaging/message_words.hpp"

namespace railfix::system_test {
namespace {

constexpr uint8_t kWarning = 3;
constexpr double kWholeS = 2;  // so long before a fault and after a repair
constexpr double kToldS = 10;
constexpr double kStateS = 0.4;   // ten a second
constexpr double kReportS = 2.5;  // T_CYCLOC is 1 s
constexpr double kAcrossM = 2;    // another track
constexpr double kSureOfTrack = 0.999;

volatile std::sig_atomic_t interrupted = 0;

messaging::ParticipantOptions options_of(const Rig& rig) {
  auto options = TwoHosts::network(TwoHosts::cab, rig.train_id(), Rig::kDomain);
  options.service = "railfix-measure-faults";
  options.host = "cab";
  options.security_folder = rig.keys().string();
  return options;
}

// Samples carry the host's clock: this thread may be busy with a fault when they come.
double wall_s() {
  return core::seconds(core::wall_ns());
}

// What the monitor answers on a path, without headers; empty when it does not answer within a second.
std::string ask(int port, const std::string& path) {
  const int socket_number = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
  const timeval patience{1, 0};
  setsockopt(socket_number, SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof patience);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_addr.s_addr = inet_addr(TwoHosts::kAddress[TwoHosts::coach]);
  address.sin_port = htons(static_cast<uint16_t>(port));
  std::string answer;
  const std::string request = "GET " + path + " HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n";
  if (connect(socket_number, reinterpret_cast<sockaddr*>(&address), sizeof address) == 0 &&
      send(socket_number, request.data(), request.size(), MSG_NOSIGNAL) == static_cast<ssize_t>(request.size())) {
    char part[4096];
    for (ssize_t got = 0; (got = recv(socket_number, part, sizeof part, 0)) > 0;)
      answer.append(part, static_cast<size_t>(got));
  }
  close(socket_number);
  const size_t body = answer.find("\r\n\r\n");
  return body == std::string::npos ? "" : answer.substr(body + 4);
}

// Figures in a sentence change; the sentence is the same.
std::string kind_of(const std::string& text) {
  std::string kind;
  for (const char c : text) kind += std::isdigit(static_cast<unsigned char>(c)) != 0 ? '#' : c;
  return kind;
}

}  // namespace

Observer::Observer(Rig& rig, const std::filesystem::path& truth_folder)
    : truth_(core::value_or_throw(evaluation::Truth::read(truth_folder))),
      participant_(
          rig.hosts().on(TwoHosts::cab, [&] { return std::make_unique<messaging::Participant>(options_of(rig)); })) {
  namespace topics = messaging::topics;
  for (const int signal : {SIGINT, SIGTERM}) std::signal(signal, [](int) { interrupted = 1; });
  for (const auto& service : rig.services()) expected_.insert(service);
  const auto listen = [&]<class T>(const messaging::Topic<T>& topic,
                                   std::function<void(const T&, const messaging::SampleInfo&)> handler) {
    readers_.push_back(std::make_shared<messaging::Reader<T>>(*participant_, topic, "", queue_, std::move(handler)));
  };
  listen(topics::train_state,
         std::function([this](const msg::TrainState& one, const messaging::SampleInfo& info) { state(one, info); }));
  listen(topics::train_position_report,
         std::function(
             [this](const msg::TrainPositionReport& one, const messaging::SampleInfo& info) { report(one, info); }));
  listen(topics::service_status, std::function([this](const msg::ServiceStatus& one,
                                                      const messaging::SampleInfo& info) { status(one, info); }));
  listen(topics::log_record, std::function([this](const msg::LogRecord& record, const messaging::SampleInfo&) {
           if (record.level() >= kWarning) say(std::string(record.service().c_str()) + ": " + record.text().c_str());
         }));
  rig.hosts().on(TwoHosts::coach, [&] {
    listen_on_the_ground(rig);
    monitor_thread_ = std::thread([this] { ask_monitor(); });
  });
}

Observer::~Observer() {
  ended_ = true;
  monitor_thread_.join();
}

void Observer::listen_on_the_ground(Rig& rig) {
  ground_link::MqttOptions options;
  if (!ground_link::parse_broker(Rig::kBroker, options).ok()) return;
  options.client_id = "ground-" + rig.train_id();
  options.subscribe_to = "railfix/" + rig.train_id() + "/position_report";
  options.longest_retry_s = 0.5;
  ground_link::MqttEvents events;
  events.received = [this](std::span<const uint8_t> payload) {
    const auto one = ground_link::ground_report_from(payload);
    if (!one.ok()) return;
    const std::lock_guard lock(mutex_);
    const auto arrival = sequences_.arrived(one.value().train, one.value().stream, one.value().sequence);
    if (arrival == ground_link::Arrival::fresh || arrival == ground_link::Arrival::gap) ground_.heard(wall_s());
  };
  ground_client_ = std::make_unique<ground_link::MqttClient>(options, std::move(events));
}

void Observer::ask_monitor() {
  while (!ended_) {
    const std::string answer = ask(Rig::kMonitorPort, "/healthz");
    if (!answer.empty() && answer != "ok\n" && answer != "ok") {
      const std::lock_guard lock(mutex_);
      monitor_said_.push_back("monitor: " + answer.substr(0, answer.find('\n')));
    }
    poll(nullptr, 0, 300);
  }
}

void Observer::state(const msg::TrainState& state, const messaging::SampleInfo& info) {
  state_ = state;
  states_.heard(core::seconds(info.received_ns));
  ++heard_.states;
  if (state.integrity() != msg::INTEGRITY_OK) ++heard_.not_ok;
  judge(state);
}

// The promise of TrainState: the true place lies within over_m behind and under_m in front of the estimate.
void Observer::judge(const msg::TrainState& state) {
  if (state.track_known() == 0 || state.integrity() == msg::INTEGRITY_UNUSABLE) return;
  ++heard_.located;
  const auto truth = truth_.at(state.stamp_ns());
  if (!truth || !std::isfinite(state.easting_m())) return;
  const double east = state.easting_m() - truth->easting_m;
  const double north = state.northing_m() - truth->northing_m;
  const double along_m = east * std::sin(truth->heading_rad) + north * std::cos(truth->heading_rad);
  const double across_m = std::abs(-east * std::cos(truth->heading_rad) + north * std::sin(truth->heading_rad));
  double excess_m = std::max(along_m - state.over_m(), -along_m - state.under_m());
  // Within one interval on a neighbouring track is wrong, too, for one who is sure of the track.
  if (std::abs(along_m) < 20 && across_m > kAcrossM && state.track_probability() >= kSureOfTrack)
    excess_m = std::max(excess_m, across_m);
  heard_.widest_m = std::max(heard_.widest_m, state.over_m() + state.under_m());
  if (excess_m > 0 && heard_.outside++ == 0) {
    char text[200];
    std::snprintf(text, sizeof text,
                  "train_state is wrong since its stamp %lld: %.1f m along and %.1f m across, although it says -%.1f m "
                  "to +%.1f m, edge %u at %.1f m with probability %.4f",
                  static_cast<long long>(state.stamp_ns()), along_m, across_m, state.over_m(), state.under_m(),
                  state.edge(), state.offset_m(), state.track_probability());
    say(text);
  }
  heard_.worst_excess_m = std::max(heard_.worst_excess_m, excess_m);
}

void Observer::report(const msg::TrainPositionReport& report, const messaging::SampleInfo& info) {
  reports_.heard(core::seconds(info.received_ns));
  // One that comes back from behind a cut cable goes on behind the numbers of the other one.
  numbers_.arrived("", 0, report.seq());
}

void Observer::status(const msg::ServiceStatus& status, const messaging::SampleInfo& info) {
  services_.note(status, core::wall_ns(), info.writer);
  const std::string name = std::string(status.service().c_str()) + "@" + status.host().c_str();
  const std::string reason = status.reason().c_str();
  if (!reason.empty()) say(name + ": " + reason);
  if (status.state() == msg::STATE_STOPPED) say(name + " stopped");
}

void Observer::look_for_silence() {
  if (!services_.note_silence_now_and_then(core::wall_ns())) return;
  for (const auto& [key, seen] : services_.services()) {
    if (!seen.alive && !seen.stopped()) say(seen.name() + "@" + key.first + " is silent");
  }
}

const messaging::ServiceSeen* Observer::service(const std::string& name) const {
  const size_t at = name.find('@');
  const auto found = services_.services().find({name.substr(at + 1), name.substr(0, at)});
  return found == services_.services().end() ? nullptr : &found->second;
}

void Observer::say(const std::string& text) {
  if (known_complaints_.insert(kind_of(text)).second) heard_.said.push_back(text);
}

std::set<std::string> Observer::not_usual() const {
  std::set<std::string> names;
  for (const auto& name : expected_) {
    const auto* seen = service(name);
    const bool usual = seen != nullptr && seen->alive &&
                       (seen->status.state() == msg::STATE_READY || seen->status.state() == msg::STATE_ACTIVE);
    if (!usual) names.insert(name);
  }
  if (!state_ || wall_s() - states_.last_s > kStateS) {
    names.insert("no train_state");
  } else if (state_->track_known() == 0 || state_->integrity() != msg::INTEGRITY_OK) {
    names.insert("position");
  }
  if (wall_s() - reports_.last_s > kReportS) names.insert("no reports");
  return names;
}

std::string Observer::with_reason(const std::string& name) const {
  const auto* seen = service(name);
  if (seen == nullptr) return name;
  return name + ": " + (seen->alive ? seen->status.reason().c_str() : "silent");
}

void Observer::turn() {
  if (interrupted != 0) throw std::runtime_error("interrupted");
  queue_.run_one(core::monotonic_ns() + 10'000'000);
  look_for_silence();
  std::vector<std::string> said;
  {
    const std::lock_guard lock(mutex_);
    said.swap(monitor_said_);
  }
  for (const auto& text : said) say(text);
  heard_.not_usual = not_usual();
  if (!heard_.not_usual.empty()) heard_.not_whole_s = now_s();
  note_course();
}

void Observer::note_course() {
  std::set<std::string> what;
  for (const auto& name : heard_.not_usual) what.insert(kind_of(with_reason(name)));
  if (what != (heard_.course.empty() ? std::set<std::string>() : heard_.course.back().what))
    heard_.course.push_back({now_s(), std::move(what)});
}

void Observer::run(double seconds) {
  for (const double until_s = now_s() + seconds; now_s() < until_s;) turn();
}

bool Observer::wait_whole(double patience_s) {
  const double begun_s = now_s();
  for (double told_s = begun_s; now_s() < begun_s + patience_s;) {
    turn();
    if (now_s() - heard_.not_whole_s > kWholeS) return true;
    if (now_s() - told_s < kToldS) continue;
    told_s = now_s();
    std::cerr << "  waits for:";
    for (const auto& name : heard_.not_usual) std::cerr << ' ' << name << ',';
    std::cerr << '\n';
  }
  return false;
}

void Observer::begin() {
  heard_ = {};
  const std::lock_guard lock(mutex_);
  monitor_said_.clear();
  known_complaints_.clear();
  missing_before_ = sequences_.missing();
  numbers_missing_before_ = numbers_.missing();
  for (auto* pause : {&states_, &reports_, &ground_}) pause->longest_s = 0;
}

Heard Observer::end() {
  const std::lock_guard lock(mutex_);
  const auto gap = [](Pause pause) {
    pause.heard(wall_s());
    return pause.longest_s;
  };
  heard_.state_gap_s = gap(states_);
  heard_.report_gap_s = gap(reports_);
  heard_.ground_gap_s = ground_client_ ? gap(ground_) : 0;
  heard_.reports_lost = numbers_.missing() - std::min(numbers_.missing(), numbers_missing_before_);
  heard_.ground_lost = sequences_.missing() - std::min(sequences_.missing(), missing_before_);
  return heard_;
}

}  // namespace railfix::system_test
