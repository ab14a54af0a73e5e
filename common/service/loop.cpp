#include "service/loop.hpp"

#include <algorithm>

#include "core/time.hpp"
#include "service/log.hpp"

namespace railfix::service {
namespace {

constexpr std::chrono::milliseconds kAssertPeriod{50};
// Four times a second, so that a dead or frozen service shows within half a second.
constexpr std::chrono::milliseconds kStatusPeriod{250};
constexpr int64_t kIdleNs = core::kNsPerSecond;

}  // namespace

Loop::Loop(std::string service, const CommonConfig& common)
    : service_(std::move(service)),
      common_(common),
      participant_(
          {common.train_id, common.host, service_, common.domain, common.ownership_strength, common.qos_profiles}),
      log_(make_logger(participant_, service_, common)),
      health_(std::make_unique<PublishedHealth>(participant_, service_, common.host)),
      reply_(std::make_unique<messaging::Writer<msg::ControlReply>>(participant_, messaging::topics::service_reply)) {
  if (common_.lock_step) {
    progress_ = std::make_unique<messaging::Writer<msg::DataProgress>>(participant_, messaging::topics::data_progress);
  }
  on<msg::ControlRequest>(messaging::topics::service_control,
                          [this](const msg::ControlRequest& request) { answer(request); });
  every(kAssertPeriod, [this] { participant_.assert_liveliness(); });
  every(kStatusPeriod, [this] {
    health_->dropped(queue_.take_dropped());
    health_->publish();
  });
}

Loop::~Loop() {
  readers_.clear();  // no more samples before the rest goes
  health_->stopped();
}

void Loop::every(std::chrono::nanoseconds period, std::function<void()> handler) {
  timers_.push_back({period.count(), core::monotonic_ns() + period.count(), std::move(handler)});
}

void Loop::on_command(const std::string& command,
                      std::function<core::Result<std::string>(const std::string&)> handler) {
  commands_[command] = std::move(handler);
}

void Loop::answer(const msg::ControlRequest& request) {
  const std::string service = request.service().c_str();
  if (service != service_ && service != "*") return;
  const std::string command = request.command().c_str();
  const auto known = commands_.find(command);
  if (known == commands_.end() && service == "*") return;
  msg::ControlReply reply;
  reply.request_id(request.request_id());
  reply.service(service_);
  if (known == commands_.end()) {
    std::string names;
    for (const auto& [name, handler] : commands_) names += (names.empty() ? "" : ", ") + name;
    reply.done(false);
    reply.text(service_ + " does not know the command " + command + (names.empty() ? "" : "; it knows: " + names));
  } else {
    const auto result = known->second(request.argument().c_str());
    reply.done(result.ok());
    reply.text(result.ok() ? result.value() : result.error().message.substr(0, 255));
  }
  reply_->write(reply);
}

void Loop::used_up_to(int64_t data_ns) {
  if (!progress_) return;
  msg::DataProgress progress;
  progress.data_ns(data_ns);
  progress.service(service_);
  progress_->write(progress);
}

void Loop::finish(const std::string& why) {
  if (finished_) return;
  log_->info("stopping: {}", why);
  finished_ = true;
}

void Loop::run_due_timers() {
  // By index: a handler may add a timer.
  for (size_t i = 0; i < timers_.size(); ++i) {
    const int64_t now_ns = core::monotonic_ns();
    if (now_ns < timers_[i].due_ns) continue;
    timers_[i].due_ns = std::max(timers_[i].due_ns + timers_[i].period_ns, now_ns);
    const auto handler = timers_[i].handler;
    handler();
  }
}

void Loop::turn() {
  while (!finished_) {
    run_due_timers();
    int64_t due_ns = core::monotonic_ns() + kIdleNs;
    for (const auto& timer : timers_) due_ns = std::min(due_ns, timer.due_ns);
    queue_.run_one(due_ns);
  }
  for (const auto& handler : at_stop_) handler();
}

}  // namespace railfix::service
