#include <unistd.h>

#include <algorithm>
#include <iostream>
#include <map>
#include <memory>
#include <optional>

#include "commands.hpp"
#include "core/result.hpp"
#include "core/time.hpp"
#include "messaging/connected.hpp"
#include "messaging/topics.hpp"
#include "topic_listener.hpp"

namespace railfix::tool {

namespace {

namespace topics = messaging::topics;

constexpr int64_t kPatienceNs = 10 * core::kNsPerSecond;
// Tools that listen say nothing of their connections; then this is long enough for a network at rest.
constexpr int64_t kDiscoveryNs = 3 * core::kNsPerSecond;
constexpr int64_t kTellTurnNs = core::kNsPerSecond / 20;

struct TellOptions {
  std::string service;
  std::string command;
  std::string argument;
  TrainNetwork network;
};

/// One request to one service, and its answer.
class Teller {
 public:
  explicit Teller(const TellOptions& options)
      : options_(options),
        participant_(participant_options(options.network, "railfix-tell")),
        control_(participant_, topics::service_control),
        replies_(participant_, topics::service_reply, "", queue_,
                 [this](const msg::ControlReply& reply) {
                   if (reply.request_id() == id_) reply_ = reply;
                 }),
        statuses_(participant_, topics::service_status, "", queue_, [this](const msg::ServiceStatus& status) {
          if (status.state() != msg::STATE_STOPPED) {
            known_[std::string(status.service().c_str()) + "@" + status.host().c_str()] = status;
          }
        }) {}

  int tell() {
    if (options_.service.empty() || options_.command.empty())
      throw core::BadInput("a service and a command have names, e.g. railfix tell recorder stop");
    const std::string here = where(options_.network);
    if (!wait_until([this] { return heard_of_it(); })) {
      throw core::BadInput(
          "there is no service " + options_.service + " on " + here +
          "; is it running, and are --train and --domain right? On a secured train --config is needed");
    }
    const int64_t found_ns = core::monotonic_ns();
    (void)wait_until([&] { return connected() || core::monotonic_ns() - found_ns > kDiscoveryNs; });
    msg::ControlRequest request;
    request.request_id(id_);
    request.service(options_.service);
    request.command(options_.command);
    request.argument(options_.argument);
    control_.write(request);
    if (!wait_until([this] { return reply_.has_value(); })) {
      std::cerr << options_.service << " on " << here << " does not answer\n";
      return 1;
    }
    (reply_->done() ? std::cout : std::cerr) << reply_->text().c_str() << '\n';
    return reply_->done() ? 0 : 1;
  }

 private:
  template <class Condition>
  bool wait_until(const Condition& condition) {
    const int64_t deadline_ns = core::monotonic_ns() + kPatienceNs;
    while (!condition()) {
      if (core::monotonic_ns() > deadline_ns) return false;
      queue_.run_one(core::monotonic_ns() + kTellTurnNs);
    }
    return true;
  }
  [[nodiscard]] bool heard_of_it() const {
    // `railfix replay` is no service.
    if (options_.service == "player")
      return std::ranges::binary_search(participant_.written_topics(), topics::player_status.name);
    const auto first = known_.lower_bound(options_.service + "@");
    return first != known_.end() && first->first.starts_with(options_.service + "@");
  }
  [[nodiscard]] bool connected() const { return messaging::all_connected(participant_.connections(), known_); }

  TellOptions options_;
  uint64_t id_ = static_cast<uint64_t>(core::wall_ns()) ^ static_cast<uint64_t>(getpid());
  std::optional<msg::ControlReply> reply_;
  std::map<std::string, msg::ServiceStatus> known_;
  messaging::Queue queue_;
  messaging::Participant participant_;
  messaging::Writer<msg::ControlRequest> control_;
  messaging::Reader<msg::ControlReply> replies_;
  messaging::Reader<msg::ServiceStatus> statuses_;
};

}  // namespace

void add_tell(CLI::App& app, Action& chosen) {
  auto options = std::make_shared<TellOptions>();
  auto* tell = app.add_subcommand(
      "tell",
      "Give a running service a command and print its answer, e.g. railfix tell recorder event \"a jolt at km 12\"; "
      "the commands stand in the README of the service");
  tell->add_option("service", options->service, "recorder, fusion, ...")->required();
  tell->add_option("command", options->command)->required();
  tell->add_option("argument", options->argument);
  add_network(*tell, options->network);
  find_running_train(*tell, options->network);
  tell->callback([options, &chosen] { chosen = [options] { return Teller(*options).tell(); }; });
}

}  // namespace railfix::tool
