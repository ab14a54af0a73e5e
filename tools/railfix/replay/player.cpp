#include "replay/player.hpp"

#include <algorithm>
#include <thread>
#include <utility>

#include "core/cut_text.hpp"
#include "core/time.hpp"
#include "recording/standing_values.hpp"

namespace railfix::tool {

namespace {

namespace topics = messaging::topics;

constexpr int64_t kTurnNs = 60 * core::kNsPerSecond;
constexpr std::chrono::milliseconds kLinger{300};  // for the last samples to get out
constexpr int64_t kServeNs = 50'000'000;
constexpr int64_t kStatusNs = 100'000'000;
constexpr uint64_t kMostJudged = 10'000'000;
constexpr size_t kMostInAStep = 100;  // samples without a picture: no reader's queue may run over

}  // namespace

void Player::go_to(int64_t at_ns) {
  feed_.reset();
  next_.reset();
  unused_ = 0;
  timeline_.seek(at_ns, core::monotonic_ns());
  restart_clock(at_ns);
  send_standing_values(at_ns);
  sent_to_ns_ = at_ns;
  // The last sample belongs to the part: `to` is exclusive.
  const bool to_the_end = to_ns_ == reader_->statistics().end_ns;
  mcap::Selection part{recorded_names(), at_ns, to_the_end ? std::nullopt : std::optional(to_ns_)};
  feed_ = std::make_unique<SampleFeed>(*reader_, std::move(part),
                                       [this](const mcap::Channel& channel, const mcap::Message& message,
                                              PreparedSample& out) { return prepare(channel, message, out); });
  // Filled before the clock runs, so that the first samples are not late.
  while (!next_ && !feed_->ended() && !stopped_) {
    next_ = feed_->next(core::monotonic_ns() + kServeNs);
    say_status(core::monotonic_ns());
  }
  timeline_.seek(at_ns, core::monotonic_ns());
}

// Says where the data goes on before anything of it is sent: who has learnt from what came before begins anew.
void Player::restart_clock(int64_t at_ns) {
  data_ns_ = 0;
  data_time_ns_ = 0;
  clocks_ = 0;
  if (leader_) return leader_->restart();
  if (!clock_) return;
  std::set<std::string> frames = recorded_names();
  if (frame_channel_)
    std::erase_if(frames, [this](const auto& name) { return channel_of_.at(name) != frame_channel_; });
  auto messages = reader_->messages({frames, at_ns, {}});
  while (const auto message = messages.next()) {
    const auto* structure = types_.structure(reader_->channels().at(message->channel_id));
    data_ns_ = structure != nullptr ? leading_int64(*structure, "stamp_ns", message->data).value_or(0) : 0;
    data_time_ns_ = message->log_time_ns;
    if (data_ns_ != 0) break;
  }
  publish_clock(false);
}

// Standing values that were said before this moment are said again, so that everyone is as they were.
void Player::send_standing_values(int64_t at_ns) {
  for (const auto& value : standing_values(*reader_, recorded_names(), at_ns)) {
    const auto& channel = reader_->channels().at(value.channel_id);
    PreparedSample sample;
    const mcap::Message message{value.channel_id, value.sequence, at_ns, value.publish_time_ns, value.cdr};
    if (prepare(channel, message, sample)) publish(sample);
  }
}

std::set<std::string> Player::recorded_names() const {
  std::set<std::string> names;
  for (const auto& [name, channel] : channel_of_) names.insert(name);
  return names;
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
  late_ms_.reserve(std::min<uint64_t>(reader_->statistics().messages, kMostJudged));
  go_to(from_ns_);
  if (!options_.paused) (void)play();
  while (!stopped_) play_on();
  publish_status();
  if (state_ != msg::PLAYER_ENDED) publish_clock(true);
  feed_.reset();
  std::this_thread::sleep_for(kLinger);
  return report();
}

void Player::play_on() {
  const int64_t now_ns = core::monotonic_ns();
  serve(now_ns);
  if (seek_to_) return seek_now();
  if (state_ != msg::PLAYER_PLAYING && !stepping_) return serve(now_ns + kServeNs);
  if (!next_) next_ = feed_->next(now_ns + kServeNs);
  if (!next_ && feed_->ended()) return at_end();
  if (!next_ || hold_back(now_ns)) return;
  const bool frame = next_->channel == frame_channel_ || !frame_channel_;
  const int64_t time_ns = next_->time_ns;
  const int64_t due_ns = timeline_.playing() && !leader_ ? timeline_.due_ns(time_ns) : 0;
  send();
  feed_->give_back(*std::exchange(next_, std::nullopt));
  ++unused_;
  if (due_ns != 0) late_ms_.push_back(static_cast<float>(1e3 * core::seconds(core::monotonic_ns() - due_ns)));
  if (!stepping_ || !frame) return;
  stepping_ = false;
  timeline_.seek(time_ns + 1, now_ns);
  if (leader_) (void)wait_for_turns();
}

void Player::seek_now() {
  if (leader_ && unused_ > 0 && !wait_for_turns()) return;
  go_to(*std::exchange(seek_to_, std::nullopt));
  status_due_ns_ = 0;
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

/// Lock step: everyone uses what was sent. False when the player was stopped meanwhile.
bool Player::wait_for_turns() {
  leader_->begin(data_ns_);
  unused_ = 0;
  const int64_t begun_ns = core::monotonic_ns();
  while (!leader_->done()) {
    serve(core::monotonic_ns() + kServeNs);
    if (stopped_) return false;
    if (core::monotonic_ns() - begun_ns < kTurnNs) continue;
    throw std::runtime_error("no answer on data_progress from " + leader_->waiting_for() +
                             " for 60 s; see that it runs with common.lock_step");
  }
  return true;
}

void Player::send() {
  sent_to_ns_ = next_->time_ns;
  if (next_->stamp_ns > data_ns_ && (next_->channel == frame_channel_ || !frame_channel_)) {
    data_ns_ = next_->stamp_ns;
    data_time_ns_ = next_->time_ns;
    if (timeline_.rate() > 1) publish_clock(false);  // readers let it run at rate 1
  }
  publish(*next_);
}

void Player::publish(const PreparedSample& sample) {
  auto& channel = channels_[sample.channel];
  if (channel.send(sample)) {
    ++published_;
  } else {
    ++unsent_[channel.written_as()];
  }
}

void Player::at_end() {
  if (leader_ && unused_ > 0 && !wait_for_turns()) return;
  stepping_ = false;
  if (options_.loop) return go_to(from_ns_);
  if (leader_) leader_->end();
  publish_clock(true);
  timeline_.pause(core::monotonic_ns());
  timeline_.seek(to_ns_, core::monotonic_ns());
  state_ = msg::PLAYER_ENDED;
  status_due_ns_ = 0;
  if (!options_.controlled) stop();
}

/// Handles one thing that came, or waits for it until then; says meanwhile how the player stands.
void Player::serve(int64_t until_ns) {
  say_status(core::monotonic_ns());
  queue_.run_one(std::min(until_ns, status_due_ns_));
}

void Player::say_status(int64_t now_ns) {
  if (now_ns < status_due_ns_) return;
  publish_status();
  if (state_ != msg::PLAYER_ENDED) publish_clock(false);
  status_due_ns_ = now_ns + kStatusNs;
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
  status.file(core::cut_text(options_.file.string(), 255));
  status_.write(status);
  if (on_status_) on_status_(status);
}

// The data's time runs as the recording is played, from the newest picture on, and stands with it.
void Player::publish_clock(bool ended) {
  if (!clock_ || data_ns_ == 0) return;
  msg::DataClock clock;
  clock.data_ns(data_ns_ + (ended ? 0 : std::max<int64_t>(0, at_ns() - data_time_ns_)));
  clock.wall_ns(core::wall_ns());
  clock.seq(++clocks_);
  clock.ended(ended ? 1 : 0);
  clock_->write(clock);
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
