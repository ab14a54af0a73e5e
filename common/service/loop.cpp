#include "service/loop.hpp"

#include <algorithm>
#include <iterator>

#include "core/cut_text.hpp"
#include "core/joined.hpp"
#include "core/kernel_clock.hpp"
#include "core/time.hpp"
#include "messaging/lock_step.hpp"
#include "messaging/security.hpp"
#include "messaging/unheard.hpp"
#include "service/log.hpp"

namespace railfix::service {
namespace {

// Four times a second, so that a dead or frozen service shows within a second (messaging::ServiceBoard).
constexpr std::chrono::milliseconds kStatusPeriod{250};
// To this host's supervisor, which starts one that hangs anew (tools/railfix/train/supervise.cpp).
constexpr std::chrono::milliseconds kBeatPeriod{100};
constexpr std::chrono::seconds kCablePeriod{1};
constexpr std::chrono::seconds kWritersPeriod{1};
constexpr std::chrono::seconds kKeeperPeriod{10};
constexpr std::chrono::hours kCertificatePeriod{6};
constexpr int64_t kIdleNs = core::kNsPerSecond;

// Anybody may ask anything: what a handler did not think of must not end the service.
core::Result<std::string> answered(const std::function<core::Result<std::string>(const std::string&)>& handler,
                                   const std::string& argument) {
  try {
    return handler(argument);
  } catch (const std::exception& error) {
    return core::Error{error.what()};
  }
}

// Standing values and the words of operation are never held back.
bool waits_for_turn(const messaging::TopicInfo& topic) {
  return topic.idl != "operation" && !topic.qos.transient_local;
}

// Empty while there is time.
std::string end_of(const std::filesystem::path& certificate) {
  const auto left = messaging::days_left(certificate);
  return left.ok() && left.value() < messaging::kCertificateWarningDays ? messaging::end_text(left.value()) : "";
}

}  // namespace

Loop::Loop(std::string service, const CommonConfig& common, bool beside)
    : service_(std::move(service)),
      common_(common),
      beside_(beside),
      participant_({common.train_id, common.host, service_, common.domain, common.qos_profiles, common.interfaces,
                    common.peers, common.security}),
      log_(make_logger(participant_, service_, common)),
      health_(std::make_unique<PublishedHealth>(participant_, service_, common, beside, *log_)),
      reply_(std::make_unique<messaging::Writer<msg::ControlReply>>(participant_, messaging::topics::service_reply)),
      notes_(notes_path(common, service_)),
      clocks_(common.host),
      born_ns_(core::monotonic_ns()) {
  if (common_.lock_step) {
    progress_ = std::make_unique<messaging::Writer<msg::DataProgress>>(participant_, messaging::topics::data_progress);
    read_clock();
  }
  on<msg::ControlRequest>(messaging::topics::service_control,
                          [this](const msg::ControlRequest& request) { answer(request); });
  every(kBeatPeriod, [this] { health_->beat(); });
  every(kStatusPeriod, [this] {
    health_->dropped(queue_.take_dropped());
    health_->publish();
  });
  watch_writers();
  if (!common_.interfaces.empty()) watch_cable();
  if (!common_.security.empty()) watch_own_certificate();
  if (!common_.peers.empty() && !common_.lock_step) watch_clocks();
}

void Loop::read_clock() {
  if (clock_is_read_) return;
  clock_is_read_ = true;
  readers_.push_back(
      std::make_unique<messaging::AnyReader>(participant_, messaging::info_of(messaging::topics::data_clock), "",
                                             queue_, [this](const auto& sample, const auto& info) {
                                               clock(*static_cast<const msg::DataClock*>(sample.get()), info.writer);
                                             }));
}

void Loop::at_restart(std::function<void(int64_t)> handler) {
  read_clock();
  at_restart_.push_back(std::move(handler));
}

// Started without the cable, this process would never use it.
void Loop::watch_cable() {
  every(kCablePeriod, [this] {
    if (participant_.interface_appeared())
      finish("a network interface of common.interfaces has come up; whoever started this service starts it again");
  });
}

// A writer that is there and not heard looks like one that has nothing to say. Who is not reached does not know it.
void Loop::watch_writers() {
  every(kWritersPeriod, [this] {
    auto unheard = messaging::unheard_writers(participant_);
    std::ranges::copy(messaging::unreached_readers(participant_), std::back_inserter(unheard));
    if (unheard == unheard_) return;
    for (const auto& sentence : unheard) log_->warn("{}", sentence);
    health_->trouble(Trouble::writers, unheard.empty() ? "" : unheard.front());
    unheard_ = std::move(unheard);
  });
}

// What runs goes on when it has run out, but would not be let in again after a restart.
void Loop::watch_own_certificate() {
  const auto look = [this] {
    const auto end = end_of(messaging::certificate_of(common_.security, service_));
    if (!end.empty())
      log_->warn("this service's certificate {}; {} --renew, then railfix train upgrade on each host", end,
                 messaging::keys_command(common_.security));
  };
  look();
  every(kCertificatePeriod, look);
}

void Loop::watch_certificate(const std::string& what, const std::filesystem::path& file) {
  if (file.empty()) return;
  certificates_[what] = file;
  const auto look = [this] {
    std::string text;
    for (const auto& [name, certificate] : certificates_) {
      const auto end = end_of(certificate);
      if (!end.empty()) text += (text.empty() ? "" : " ") + name + " (" + certificate.string() + ") " + end + ".";
    }
    health_->trouble(Trouble::certificates, text);
  };
  look();
  if (certificates_.size() == 1) every(kCertificatePeriod, look);
}

// Of no use when this thread was held up between the two.
void Loop::look_at_clock() {
  const int64_t before_ns = core::monotonic_ns();
  const int64_t wall_ns = core::wall_ns();
  if (core::monotonic_ns() - before_ns < ClockWatch::kToleratedNs / 10) clocks_.look(wall_ns, before_ns);
}

// Every service stamps its status with its host's clock.
void Loop::watch_clocks() {
  every(kKeeperPeriod, [this] { clocks_.kept(core::clock_error_ns()); });
  every(kBeatPeriod, [this] { look_at_clock(); });
  readers_.push_back(std::make_unique<messaging::AnyReader>(
      participant_, messaging::info_of(messaging::topics::service_status), "", queue_,
      [this](const auto& sample, const auto& info) {
        const auto& status = *static_cast<const msg::ServiceStatus*>(sample.get());
        look_at_clock();
        clocks_.hear(status.host().c_str(), status.stamp_ns(), info.received_ns);
        health_->trouble(Trouble::clock, clocks_.trouble());
      }));
}

Loop::~Loop() {
  readers_.clear();  // no more samples before the rest goes
  health_->stopped();
}

void Loop::every(std::chrono::nanoseconds period, std::function<void()> handler) {
  every_while({}, period, std::move(handler));
}

void Loop::every_while(std::function<bool()> wanted, std::chrono::nanoseconds period, std::function<void()> handler) {
  timers_.push_back({period.count(), next_due_ns(period.count()), std::move(handler), std::move(wanted)});
}

// Periods that are multiples of each other fall due together: the processor is woken once.
int64_t Loop::next_due_ns(int64_t period_ns) const {
  return born_ns_ + ((core::monotonic_ns() - born_ns_) / period_ns + 1) * period_ns;
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
    const auto names = core::joined(commands_, [](const auto& one) { return one.first; });
    reply.done(false);
    reply.text(service_ + " does not know the command " + command + (names.empty() ? "" : "; it knows: " + names));
  } else {
    const auto result = answered(known->second, request.argument().c_str());
    reply.done(result.ok());
    reply.text(result.ok() ? result.value() : core::cut_text(result.error().message, 255));
  }
  reply_->write(reply);
}

void Loop::listen(const messaging::TopicInfo& topic, const std::string& instance, Handler handler, StampOf stamp_of) {
  if (topic.name == messaging::topics::data_clock.name) {
    read_clock();
    on_clock_.push_back(std::move(handler));
  } else if (common_.lock_step && waits_for_turn(topic)) {
    keep_in_turn(topic, instance, std::move(handler), stamp_of);
  } else {
    readers_.push_back(std::make_unique<messaging::AnyReader>(
        participant_, topic, instance, queue_,
        [this, handler = std::move(handler), stamp_of = waits_for_turn(topic) ? stamp_of : nullptr](const auto& sample,
                                                                                                    const auto&) {
          if (stamp_of && restarts_.outdated(stamp_of(sample.get()), core::monotonic_ns())) return;
          handler(sample.get());
        }));
  }
}

void Loop::keep_in_turn(const messaging::TopicInfo& topic, const std::string& instance, Handler handler,
                        StampOf stamp_of) {
  const std::string name = instance.empty() ? topic.name : topic.name + "/" + instance;
  turns_.reads(name);
  readers_.push_back(std::make_unique<messaging::AnyReader>(
      participant_, topic, instance, queue_,
      [this, name, handler = std::move(handler), stamp_of](const auto& sample, const auto& info) {
        const int64_t stamp_ns = stamp_of(sample.get());
        turns_.keep(name, info.sequence, stamp_ns, [this, handler, sample, stamp_ns] {
          if (!restarts_.outdated(stamp_ns, core::monotonic_ns())) handler(sample.get());
        });
      }));
}

// What belongs to no turn: the end of the data, and real pace.
void Loop::clock(const msg::DataClock& clock, uint64_t writer) {
  if (restarts_.heard(clock, writer, core::monotonic_ns())) {
    if (!at_restart_.empty()) log_->info("the data begins anew: what was known of the data before is forgotten");
    for (const auto& handler : at_restart_) handler(clock.data_ns());
  }
  if (clock.lock_step() == 0 || clock.ended() != 0) {
    for (const auto& handler : on_clock_) handler(&clock);
    return;
  }
  if (service_ != clock.turn().c_str()) return;
  std::map<std::string, uint64_t> sent;
  for (const auto& topic : clock.sent()) sent[topic.topic().c_str()] = topic.samples();
  turns_.begin(std::move(sent));
  turn_ = clock;
  turn_taken_ = false;
}

void Loop::take_turn() {
  for (const auto& work : turns_.take()) work();
  for (const auto& handler : on_clock_) handler(&*turn_);
  turn_taken_ = true;
}

void Loop::end_turn() {
  msg::DataProgress progress;
  progress.data_ns(turn_->data_ns());
  progress.seq(turn_->seq());
  progress.service(service_);
  progress.sent(messaging::sent_samples(participant_));
  turn_.reset();
  progress_->write(progress);
}

void Loop::share_charge(ChargeHandlers handlers) {
  if (common_.lock_step) return;
  handlers.changed = [this, changed = std::move(handlers.changed)](bool taken) {
    log_->info(taken ? "in charge from now on" : "stands by from now on");
    if (changed) changed(taken);
  };
  standby_ = std::make_unique<Standby>(participant_, queue_, service_, common_, beside_, std::move(handlers));
  every(Standby::kPeriod, [this] {
    standby_->update();
    const auto holder = standby_->holder();
    health_->stands_by(in_charge()      ? ""
                       : holder.empty() ? "nobody is in charge yet"
                                        : "stands by, " + holder + " is in charge");
  });
}

void Loop::finish(const std::string& why) {
  if (finished_) return;
  log_->info("stopping: {}", why);
  finished_ = true;
}

void Loop::run_due_timers() {
  // By index: a handler may add a timer.
  for (size_t i = 0; i < timers_.size(); ++i) {
    if (core::monotonic_ns() < timers_[i].due_ns || !timers_[i].is_wanted()) continue;
    timers_[i].due_ns = next_due_ns(timers_[i].period_ns);
    const auto handler = timers_[i].handler;
    handler();
  }
}

void Loop::turn() {
  while (!finished_) {
    run_due_timers();
    int64_t due_ns = core::monotonic_ns() + kIdleNs;
    for (const auto& timer : timers_) {
      if (timer.due_ns < due_ns && timer.is_wanted()) due_ns = timer.due_ns;
    }
    queue_.run_one(due_ns);
    if (turn_ && !turn_taken_ && turns_.ready()) take_turn();
    if (turn_ && turn_taken_ && (!turn_ended_ || turn_ended_(turn_->data_ns()))) end_turn();
  }
  if (standby_) standby_->leave();
  for (const auto& handler : at_stop_) handler();
}

}  // namespace railfix::service
