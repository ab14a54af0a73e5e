// What a player does when it is told to.
#include <sched.h>
#include <spdlog/fmt/fmt.h>

#include "core/cut_text.hpp"
#include "core/joined.hpp"
#include "core/time.hpp"
#include "replay/player.hpp"

namespace railfix::tool {

namespace {

constexpr double kLeastRate = 0.01;
constexpr double kMostRate = 1000;
constexpr double kMostPromptRate = 20;

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
  return core::Error{"player does not know the command " + name +
                     "; it knows: " + core::joined(commands_, [](const auto& one) { return one.first; })};
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
  reply.text(result.ok() ? result.value() : core::cut_text(result.error().message, 255));
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
    return core::Error{fmt::format("seek needs seconds from 0 to {:.3f}, not '{}'", length_s, argument)};
  }
  if (state_ == msg::PLAYER_ENDED) state_ = msg::PLAYER_PAUSED;
  stepping_ = false;
  seek_to_ = from_ns_ + core::to_ns(*into_s);
  return "at " + argument + " s";
}

core::Result<std::string> Player::set_rate(const std::string& argument) {
  const auto rate = number_of(argument);
  if (leader_) return core::Error{"in lock step the services set the rate"};
  if (!rate || *rate < kLeastRate || *rate > kMostRate) return core::Error{"rate needs a number from 0.01 to 1000"};
  timeline_.set_rate(*rate, core::monotonic_ns());
  wake_promptly();
  return "rate " + argument;
}

// On a busy machine a thread of the usual kind wakes up to 10 ms late. Where the system does not permit it, so it
// stays. Not for rates at which it would hardly sleep. Threads made by this one are not concerned.
void Player::wake_promptly() const {
  const bool promptly = !leader_ && timeline_.rate() <= kMostPromptRate;
  const sched_param priority{promptly ? 1 : 0};
  (void)sched_setscheduler(0, (promptly ? SCHED_FIFO : SCHED_OTHER) | SCHED_RESET_ON_FORK, &priority);
}

// Until wake_promptly() they are.
Player::PromptThreads::PromptThreads(const ReplayOptions& options) {
  if (!options.lock_step.empty() || options.rate > kMostPromptRate) return;
  const sched_param priority{1};
  (void)sched_setscheduler(0, SCHED_FIFO, &priority);
}

}  // namespace railfix::tool
