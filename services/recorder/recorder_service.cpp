#include "recorder/recorder_service.hpp"

#include <algorithm>
#include <chrono>
#include <fstream>
#include <stdexcept>

#include "core/time.hpp"
#include "recorder/recorder_status.hpp"
#include "service/release.hpp"

namespace railfix::recorder {

namespace {

constexpr std::chrono::milliseconds kStatePeriod{200};
// A loss is shown for this long after the last one: of a recorder that does not keep up, and of samples that never
// came, which is over when the cable is back.
constexpr int64_t kLossShownNs = 10 * core::kNsPerSecond;
constexpr int64_t kLossOnWayShownNs = core::kNsPerSecond;

uint64_t lost_here(const std::vector<TopicLosses>& losses) {
  uint64_t sum = 0;
  for (const auto& topic : losses) {
    for (const auto& [cause, count] : topic.by_cause) sum += cause == Loss::transport ? 0 : count;
  }
  return sum;
}

}  // namespace

RecorderService::RecorderService(const Config& config, service::Context& context)
    : config_(config),
      context_(context),
      status_(context.writer(messaging::topics::recorder_status)),
      recorder_(config, context.participant(), about(), [this, &context](int64_t stamp_ns) {
        if (context.common().lock_step) {
          context.post([this, stamp_ns] { recorded_ns_ = std::max(recorded_ns_, stamp_ns); });
        }
      }) {
  context_.turn_ends_when([this](int64_t data_ns) { return recorded_ns_ >= data_ns || !recorder_.state().recording; });
  add_commands();
  context_.every(kStatePeriod, [this] { show_state(); });
  context_.at_stop([this] {
    const bool closed = !recorder_.state().recording || stop().ok();
    show_state();
    // Whoever started it must not take the recording for one that is there.
    if (!closed) throw std::runtime_error("the recording could not be closed: see the error before");
  });
  if (config_.autostart) {
    const auto started = start("");
    if (!started.ok() && !recorder_.state().goes_on_by_itself) throw core::BadInput(started.error().message);
  }
  for (const auto& file : {config_.map, config_.train_file}) warn_if_unreadable(file);
  recorder_.housekeeper().recover();  // takes minutes for a large file: what is recorded now comes first
}

void RecorderService::add_commands() {
  context_.on_command("start", [this](const std::string& file) { return start(file); });
  context_.on_command("stop", [this](const std::string&) { return stop(); });
  context_.on_command("pause", [this](const std::string&) { return logged(recorder_.pause()); });
  context_.on_command("resume", [this](const std::string&) { return logged(recorder_.resume()); });
  context_.on_command("event", [this](const std::string& text) {
    context_.log().info("event by hand: {}", text);
    return logged(recorder_.event(text));
  });
  context_.on_command("protect", [this](const std::string& file) {
    return logged(recorder_.housekeeper().protect(file, "protected by hand"));
  });
  context_.on_command("unprotect",
                      [this](const std::string& file) { return logged(recorder_.housekeeper().unprotect(file)); });
}

core::Result<std::string> RecorderService::logged(core::Result<std::string> done) {
  if (done.ok()) context_.log().info("{}", done.value());
  show_state();
  return done;
}

std::map<std::string, std::string> RecorderService::about() const {
  const auto& common = context_.common();
  return {{"train_id", common.train_id},
          {"host", common.host},
          {"version", service::release()},
          {"domain", std::to_string(common.domain)},
          {"pictures", config_.pictures},
          {"map", fingerprint(config_.map)},
          {"configuration", fingerprint(config_.train_file)}};
}

void RecorderService::warn_if_unreadable(const std::string& file) {
  if (file.empty() || std::ifstream(file)) return;
  context_.log().warn(
      "{} cannot be read, so recordings will not say which it was; correct recorder.map or recorder.train_file", file);
}

core::Result<std::string> RecorderService::start(const std::string& file) {
  auto started = recorder_.start(file);
  if (started.ok()) {
    lost_ = lost_here_ = 0;
    context_.log().info("recording {}", started.value());
  }
  return started;
}

core::Result<std::string> RecorderService::stop() {
  auto stopped = recorder_.stop();
  if (stopped.ok()) {
    context_.log().info("closed {}", stopped.value());
  } else {
    context_.log().error("{}", stopped.error().message);
  }
  return stopped;
}

void RecorderService::show_state() {
  const RecorderState now = recorder_.take_state();
  if (!now.failure.empty()) throw std::runtime_error(now.failure);
  for (; received_ < now.received; ++received_) context_.health().input();
  for (; written_ < now.written; ++written_) context_.health().output(0);
  note_losses(now);
  for (const auto& news : now.news) {
    context_.log().log(news.bad ? spdlog::level::err : spdlog::level::info, "{}", news.sentence);
  }
  for (const auto& sentence : recorder_.housekeeper().take_sentences()) context_.log().info("{}", sentence);
  for (const auto& sentence : recorder_.housekeeper().take_warnings()) context_.log().warn("{}", sentence);
  show_health(now);
  publish(now);
}

void RecorderService::note_losses(const RecorderState& now) {
  const uint64_t here = lost_here(now.losses_by_topic);
  const int64_t now_ns = core::monotonic_ns();
  if (now.lost > lost_) {
    context_.health().dropped(now.lost - lost_);
    losses_ = now.losses;
    const bool by_us = here > lost_here_;
    loses_until_ns_ = std::max(loses_until_ns_, now_ns + (by_us ? kLossShownNs : kLossOnWayShownNs));
    if (!by_us && now_ns >= lost_on_way_told_ns_ + kLossShownNs) {
      context_.log().warn("samples never came: {}", now.losses);
      lost_on_way_told_ns_ = now_ns;
    }
  }
  lost_ = now.lost;
  lost_here_ = here;
}

void RecorderService::show_health(const RecorderState& now) {
  const bool loses = core::monotonic_ns() < loses_until_ns_;
  const std::string recovering = recorder_.housekeeper().recovering();
  if (!now.problem.empty()) {
    context_.health().degraded(now.problem);
  } else if (now.recording && loses) {
    context_.health().degraded("samples are lost: " + losses_);
  } else if (!recovering.empty()) {
    context_.health().degraded("recovers what a crash left, beside its work: " + recovering);
  } else if (now.recording && now.written > 0) {
    context_.health().active();
  } else {
    context_.health().ready();
  }
}

void RecorderService::publish(const RecorderState& state) {
  const auto now = status_of(state, recorder_.housekeeper().survey(), config_.file.empty() ? config_.quota_mb : 0);
  const int64_t now_ns = core::monotonic_ns();
  if (!changed(published_, now) && now_ns - published_ns_ < core::kNsPerSecond) return;
  published_ = now;
  published_ns_ = now_ns;
  status_.write(now);
}

}  // namespace railfix::recorder
