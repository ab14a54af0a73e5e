#include "replay/player.hpp"

#include <sched.h>

#include <algorithm>
#include <thread>
#include <utility>

#include "core/time.hpp"
#include "recording/standing_values.hpp"

namespace railfix::tool {

namespace {

namespace topics = messaging::topics;

constexpr int64_t kDiscoveryNs = 1'500'000'000;
constexpr int64_t kLookNs = 100'000'000;
constexpr int kSteadyLooks = 10;  // a recorder looks for new cameras four times a second
constexpr int64_t kConnectNs = 15 * core::kNsPerSecond;
constexpr int64_t kServicesNs = 60 * core::kNsPerSecond;  // for services to start, and for a turn
constexpr std::chrono::milliseconds kLinger{300};         // for the last samples to get out
constexpr int64_t kAliveNs = 50'000'000;
constexpr int64_t kStatusNs = 100'000'000;
constexpr size_t kMostInAStep = 100;  // samples without a picture: no reader's queue may run over
constexpr double kLeastRate = 0.01;
constexpr double kMostRate = 1000;
constexpr double kMostPromptRate = 20;

/// On a busy machine a thread of the usual kind wakes up to 10 ms late. Where the system does not permit it, so it
/// stays. Threads made by this one are not concerned. Not for rates at which it would hardly sleep.
void wake_promptly(bool promptly) {
  const sched_param priority{promptly ? 1 : 0};
  (void)sched_setscheduler(0, (promptly ? SCHED_FIFO : SCHED_OTHER) | SCHED_RESET_ON_FORK, &priority);
}

messaging::ParticipantOptions network(const ReplayOptions& options) {
  messaging::ParticipantOptions network;
  network.train_id = options.train;
  network.domain = options.domain;
  network.service = "railfix-replay";
  return network;
}

std::optional<double> number_of(const std::string& text) {
  size_t used = 0;
  try {
    const double value = std::stod(text, &used);
    if (used == text.size() && std::isfinite(value)) return value;
  } catch (const std::exception&) {
  }
  return std::nullopt;
}

}  // namespace

Player::Player(const ReplayOptions& options)
    : options_(options),
      reader_(core::value_or_throw(mcap::Reader::open(options.file))),
      types_(*reader_),
      participant_(network(options)),
      gathering_(options.lock_step),
      commands_(make_commands()),
      status_(participant_, topics::player_status),
      replies_(participant_, topics::service_reply),
      requests_(participant_, topics::service_control, "", queue_,
                [this](const msg::ControlRequest& request) { answer(request); }),
      timeline_(0, options.rate) {
  if (!options.lock_step.empty()) leader_.emplace(participant_, queue_, options.lock_step);
  services_ = std::make_unique<messaging::Reader<msg::ServiceStatus>>(
      participant_, topics::service_status, "", queue_, [this](const msg::ServiceStatus& status) {
        if (status.state() == msg::STATE_STARTING || status.state() == msg::STATE_STOPPED) return;
        live_services_.insert(status.service().c_str());
        gathering_.heard(status.service().c_str(), {status.endpoints(), status.matches()});
      });
  find_part();
  discover();
  open_channels();
  connect();
  services_.reset();
}

Player::~Player() = default;

void Player::find_part() {
  const auto& statistics = reader_->statistics();
  const double length_s = core::seconds(statistics.end_ns - statistics.start_ns);
  if (options_.from_s > length_s) {
    throw core::BadInput("--from " + std::to_string(options_.from_s) + " is behind the end of " +
                         options_.file.string() + ", which is " + std::to_string(length_s) + " s long");
  }
  if (options_.to_s <= options_.from_s) throw core::BadInput("--to must be behind --from");
  from_ns_ = statistics.start_ns + core::to_ns(options_.from_s);
  to_ns_ = options_.to_s < length_s ? statistics.start_ns + core::to_ns(options_.to_s) : statistics.end_ns;
  timeline_.seek(from_ns_, core::monotonic_ns());
}

// Who is there already; in lock step: until all are there that shall take turns.
void Player::discover() {
  const int64_t begun_ns = core::monotonic_ns();
  const auto missing = [this] {
    std::string names;
    for (const auto& name : options_.lock_step) {
      if (!live_services_.contains(name)) names += (names.empty() ? "" : ", ") + name;
    }
    return names;
  };
  while (!stopped_) {
    queue_.run_one(core::monotonic_ns() + kLookNs);
    const int64_t waited_ns = core::monotonic_ns() - begun_ns;
    if (waited_ns < kDiscoveryNs) continue;
    if (missing().empty()) return;
    if (waited_ns > kServicesNs) {
      throw core::BadInput("--lock-step: no sign of " + missing() + " on train " + options_.train + ", domain " +
                           std::to_string(options_.domain) + "; start with --set common.lock_step=true");
    }
  }
}

void Player::open_channels() {
  auto choice = choose_channels(*reader_, options_, participant_.written_topics());
  left_out_ = std::move(choice.left_out);
  size_t rank = SIZE_MAX;
  // What a step ends with: the first of these that is played.
  const std::vector<std::string> frames{"camera_frame", "track_view", "odometry_step", "camera_preview", "train_state"};
  for (const auto& chosen : choice.channels) {
    const std::string base = chosen.recorded_as.substr(0, chosen.recorded_as.find('/'));
    const size_t here = static_cast<size_t>(std::ranges::find(frames, base) - frames.begin());
    if (chosen.messages > 0 && here < std::min(rank, frames.size())) {
      rank = here;
      frame_channel_ = channels_.size();
    }
    channel_of_[chosen.recorded_as] = channels_.size();
    channels_.emplace_back(participant_, *chosen.topic, chosen.written_as, chosen.as_jpeg);
  }
  // Its turn ends when it has written the picture.
  if (rank != 0 && std::ranges::find(options_.lock_step, "recorder") != options_.lock_step.end()) {
    throw core::BadInput(
        "--lock-step recorder needs camera_frame to be replayed; without pictures the recorder keeps up "
        "by itself: leave it out of --lock-step");
  }
}

// In lock step no sample may be lost; else it is enough that nobody new has been found for a while.
void Player::connect() {
  const int64_t begun_ns = core::monotonic_ns();
  int64_t look_ns = begun_ns;
  uint32_t matches = 0;
  int steady_looks = 0;
  while (!stopped_ && core::monotonic_ns() - begun_ns < kConnectNs) {
    queue_.run_one(look_ns);
    if (core::monotonic_ns() < look_ns) continue;
    look_ns += kLookNs;
    const auto here = participant_.connections();
    steady_looks = here.matches == std::exchange(matches, here.matches) ? steady_looks + 1 : 0;
    if (leader_ ? gathering_.complete(here) : steady_looks >= kSteadyLooks) return;
  }
}

std::map<std::string, Player::Command> Player::make_commands() {
  return {{"play", [this](const std::string&) { return play(); }},
          {"pause",
           [this](const std::string&) -> core::Result<std::string> {
             timeline_.pause(core::monotonic_ns());
             if (state_ == msg::PLAYER_PLAYING) state_ = msg::PLAYER_PAUSED;
             return std::string("paused");
           }},
          {"step",
           [this](const std::string&) -> core::Result<std::string> {
             if (state_ == msg::PLAYER_ENDED) return core::Error{"the end is reached; seek or play"};
             timeline_.pause(core::monotonic_ns());
             state_ = msg::PLAYER_PAUSED;
             stepping_ = true;
             return std::string("one picture on");
           }},
          {"seek", [this](const std::string& argument) { return seek(argument); }},
          {"rate", [this](const std::string& argument) { return set_rate(argument); }},
          {"loop",
           [this](const std::string& argument) -> core::Result<std::string> {
             if (argument != "on" && argument != "off") return core::Error{"loop needs on or off"};
             options_.loop = argument == "on";
             return "loop " + argument;
           }},
          {"stop", [this](const std::string&) -> core::Result<std::string> {
             stop();
             return std::string("ends");
           }}};
}

core::Result<std::string> Player::carry_out(const std::string& name, const std::string& argument) {
  const auto known = commands_.find(name);
  if (known != commands_.end()) {
    auto result = known->second(argument);
    status_due_ns_ = 0;
    return result;
  }
  std::string names;
  for (const auto& [one, command] : commands_) names += (names.empty() ? "" : ", ") + one;
  return core::Error{"player does not know the command " + name + "; it knows: " + names};
}

void Player::post(const std::string& name, const std::string& argument) {
  queue_.push(nullptr, [this, name, argument] { (void)carry_out(name, argument); });
}

void Player::answer(const msg::ControlRequest& request) {
  if (std::string("player") != request.service().c_str()) return;
  const auto result = carry_out(request.command().c_str(), request.argument().c_str());
  msg::ControlReply reply;
  reply.request_id(request.request_id());
  reply.service("player");
  reply.done(result.ok());
  reply.text(result.ok() ? result.value() : result.error().message.substr(0, 255));
  replies_.write(reply);
}

core::Result<std::string> Player::play() {
  if (state_ == msg::PLAYER_ENDED) go_to(from_ns_);
  state_ = msg::PLAYER_PLAYING;
  stepping_ = false;
  timeline_.play(core::monotonic_ns());
  return std::string("plays");
}

core::Result<std::string> Player::seek(const std::string& argument) {
  const auto into_s = number_of(argument);
  const double length_s = core::seconds(to_ns_ - from_ns_);
  if (!into_s || *into_s < 0 || *into_s > length_s) {
    return core::Error{"seek needs seconds from 0 to " + std::to_string(length_s) + ", not '" + argument + "'"};
  }
  if (state_ == msg::PLAYER_ENDED) state_ = msg::PLAYER_PAUSED;
  stepping_ = false;
  go_to(from_ns_ + core::to_ns(*into_s));
  return "at " + argument + " s";
}

core::Result<std::string> Player::set_rate(const std::string& argument) {
  const auto rate = number_of(argument);
  if (leader_) return core::Error{"in lock step the services set the rate"};
  if (!rate || *rate < kLeastRate || *rate > kMostRate) return core::Error{"rate needs a number from 0.01 to 1000"};
  timeline_.set_rate(*rate, core::monotonic_ns());
  wake_promptly(*rate <= kMostPromptRate);
  return "rate " + argument;
}

// Standing values that were said before this moment are said again, so that everyone is as they were.
void Player::go_to(int64_t at_ns) {
  ++moves_;
  feed_.reset();
  next_.reset();
  std::set<std::string> names;
  for (const auto& [name, channel] : channel_of_) names.insert(name);
  for (const auto& value : standing_values(*reader_, names, at_ns)) {
    const auto& channel = reader_->channels().at(value.channel_id);
    next_.emplace();
    const mcap::Message message{value.channel_id, value.sequence, at_ns, value.publish_time_ns, value.cdr};
    if (prepare(channel, message, *next_)) send();
  }
  next_.reset();
  sent_to_ns_ = at_ns;
  data_ns_ = 0;
  // The last sample belongs to the part: `to` is exclusive.
  const bool to_the_end = to_ns_ == reader_->statistics().end_ns;
  mcap::Selection part{names, at_ns, to_the_end ? std::nullopt : std::optional(to_ns_)};
  feed_ = std::make_unique<SampleFeed>(*reader_, std::move(part),
                                       [this](const mcap::Channel& channel, const mcap::Message& message,
                                              PreparedSample& out) { return prepare(channel, message, out); });
  // Filled before the clock runs, so that the first samples are not late.
  while (!next_ && !feed_->ended() && !stopped_) {
    next_ = feed_->next(core::monotonic_ns() + kAliveNs);
    keep_alive(core::monotonic_ns());
  }
  timeline_.seek(at_ns, core::monotonic_ns());
}

bool Player::prepare(const mcap::Channel& channel, const mcap::Message& message, PreparedSample& sample) {
  const auto to = channel_of_.find(channel.topic);
  if (to == channel_of_.end()) return false;
  sample.time_ns = message.log_time_ns;
  sample.channel = to->second;
  sample.cdr.assign(message.data.begin(), message.data.end());
  if (const auto* structure = types_.structure(channel)) {
    sample.stamp_ns = leading_int64(*structure, "stamp_ns", message.data).value_or(0);
  }
  // A service that runs now speaks for itself.
  if (msg::ServiceStatus status; channel.topic == topics::service_status.name &&
                                 messaging::deserialize(sample.cdr, status) &&
                                 live_services_.contains(status.service().c_str())) {
    return false;
  }
  if (channels_[sample.channel].prepare(sample)) return true;
  ++unreadable_[channel.topic];
  return false;
}

ReplayReport Player::run() {
  begun_ns_ = core::monotonic_ns();
  go_to(from_ns_);
  wake_promptly(!leader_ && options_.rate <= kMostPromptRate);
  if (!options_.paused) (void)play();
  while (!stopped_) play_on();
  publish_status();
  feed_.reset();
  std::this_thread::sleep_for(kLinger);
  return report();
}

void Player::play_on() {
  const int64_t now_ns = core::monotonic_ns();
  serve(now_ns);
  if (state_ != msg::PLAYER_PLAYING && !stepping_) return serve(now_ns + kAliveNs);
  if (!next_) next_ = feed_->next(now_ns + kAliveNs);
  if (!next_ && feed_->ended()) return at_end();
  if (!next_ || hold_back(now_ns)) return;
  const bool frame = next_->channel == frame_channel_ || !frame_channel_;
  const int64_t time_ns = next_->time_ns;
  const int64_t due_ns = timeline_.playing() && !leader_ ? timeline_.due_ns(time_ns) : 0;
  send();
  next_.reset();
  ++unused_;
  if (due_ns != 0) late_ms_.push_back(static_cast<float>(1e3 * core::seconds(core::monotonic_ns() - due_ns)));
  if (!stepping_ || !frame) return;
  stepping_ = false;
  timeline_.seek(time_ns + 1, now_ns);
  if (leader_) (void)wait_for_turns();
}

/// The next sample has to wait; does so for a while.
bool Player::hold_back(int64_t now_ns) {
  if (leader_) {
    const bool step_is_full = next_->channel == frame_channel_ || unused_ >= kMostInAStep;
    return unused_ > 0 && step_is_full && !wait_for_turns();
  }
  if (stepping_) return false;
  const int64_t due_ns = timeline_.due_ns(next_->time_ns);
  if (due_ns <= now_ns) return false;
  serve(due_ns);
  return true;
}

/// Lock step: everyone uses what was sent. False when the player was stopped, or moved by a command, meanwhile.
bool Player::wait_for_turns() {
  const uint64_t moves = moves_;
  leader_->begin(data_ns_);
  unused_ = 0;
  const int64_t begun_ns = core::monotonic_ns();
  while (!leader_->done()) {
    serve(core::monotonic_ns() + kAliveNs);
    if (stopped_) return false;
    if (core::monotonic_ns() - begun_ns < kServicesNs) continue;
    throw std::runtime_error("no answer on data_progress from " + leader_->waiting_for() +
                             " for 60 s; see that it runs with common.lock_step");
  }
  return moves == moves_;
}

void Player::send() {
  sent_to_ns_ = next_->time_ns;
  if (next_->stamp_ns > data_ns_ && (next_->channel == frame_channel_ || !frame_channel_)) data_ns_ = next_->stamp_ns;
  if (channels_[next_->channel].send(*next_)) {
    ++published_;
  } else {
    ++unsent_[channels_[next_->channel].written_as()];
  }
}

void Player::at_end() {
  if (leader_ && unused_ > 0 && !wait_for_turns()) return;
  stepping_ = false;
  if (options_.loop) return go_to(from_ns_);
  if (leader_) leader_->end();
  timeline_.pause(core::monotonic_ns());
  timeline_.seek(to_ns_, core::monotonic_ns());
  state_ = msg::PLAYER_ENDED;
  status_due_ns_ = 0;
  if (!options_.controlled) stop();
}

/// Handles one thing that came, or waits for it until then; tells meanwhile that the player lives.
void Player::serve(int64_t until_ns) {
  keep_alive(core::monotonic_ns());
  queue_.run_one(std::min({until_ns, alive_due_ns_, status_due_ns_}));
}

void Player::keep_alive(int64_t now_ns) {
  if (now_ns >= alive_due_ns_) {
    participant_.assert_liveliness();
    alive_due_ns_ = now_ns + kAliveNs;
  }
  if (now_ns >= status_due_ns_) {
    publish_status();
    status_due_ns_ = now_ns + kStatusNs;
  }
}

int64_t Player::at_ns() const {
  const int64_t at_ns = leader_ ? sent_to_ns_ : timeline_.at_ns(core::monotonic_ns());
  return std::clamp(at_ns, from_ns_, to_ns_);
}

void Player::publish_status() {
  msg::PlayerStatus status;
  status.stamp_ns(core::wall_ns());
  status.from_ns(from_ns_);
  status.to_ns(to_ns_);
  status.at_ns(at_ns());
  const double run_s = core::seconds(core::monotonic_ns() - begun_ns_);
  status.rate(leader_ ? core::seconds(at_ns() - from_ns_) / std::max(run_s, 1e-3) : timeline_.rate());
  status.state(state_);
  status.looped(options_.loop ? 1 : 0);
  status.lock_step(leader_ ? 1 : 0);
  status.file(options_.file.string().substr(0, 255));
  status_.write(status);
  if (on_status_) on_status_(status);
}

ReplayReport Player::report() {
  ReplayReport report{published_, channels_.size(), 0, 0, 0, left_out_};
  report.problems.insert(report.problems.end(), reader_->problems().begin(), reader_->problems().end());
  for (const auto& [name, count] : unsent_) unreadable_[name] += count;
  for (const auto& [name, count] : unreadable_) {
    report.problems.push_back(name + ": " + std::to_string(count) +
                              " samples are not of this version's type and were left out");
  }
  if (late_ms_.empty()) return report;
  std::ranges::sort(late_ms_);
  report.late_p50_ms = late_ms_[late_ms_.size() / 2];
  report.late_p99_ms = late_ms_[late_ms_.size() * 99 / 100];
  report.late_max_ms = late_ms_.back();
  return report;
}

}  // namespace railfix::tool
