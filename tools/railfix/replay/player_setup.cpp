// How a player finds its part of the recording, the others on the train, and its channels.
#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <utility>

#include "core/time.hpp"
#include "replay/player.hpp"

namespace railfix::tool {

namespace {

namespace topics = messaging::topics;

constexpr int64_t kDiscoveryNs = 1'500'000'000;
constexpr int64_t kLookNs = 100'000'000;
constexpr int kSteadyLooks = 10;  // a recorder looks for new cameras four times a second
constexpr int64_t kConnectNs = 15 * core::kNsPerSecond;
constexpr int64_t kServicesNs = 60 * core::kNsPerSecond;

}  // namespace

Player::Player(const ReplayOptions& options)
    : options_(options),
      reader_(core::value_or_throw(mcap::Reader::open(options.file))),
      types_(*reader_),
      prompt_threads_(options),
      participant_(participant_options(options.network, "railfix-replay")),
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
  open_clock();
  connect();
  services_.reset();
  wake_promptly();
}

Player::~Player() = default;

void Player::find_part() {
  const auto& statistics = reader_->statistics();
  const double length_s = core::seconds(statistics.end_ns - statistics.start_ns);
  if (options_.from_s > length_s) {
    throw core::BadInput(fmt::format("--from {:g} is behind the end of {}, which is {:.1f} s long", options_.from_s,
                                     options_.file.string(), length_s));
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
      throw core::BadInput("--lock-step: no sign of " + missing() + " on " + where(options_.network) +
                           "; start with --set common.lock_step=true");
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

// Services that run beside a replay need the data's time: by the hosts' clock everything recorded is old. Whoever makes
// data of its own also makes the time.
void Player::open_clock() {
  const std::string name = topics::data_clock.name;
  const auto is_clock = [&](const std::string& one) { return one == name; };
  if (leader_ || channel_of_.contains(name) || std::ranges::any_of(options_.without, is_clock)) return;
  if (live_services_.contains("frame_grabber") || live_services_.contains("sensor_gateway")) return;
  if (std::ranges::none_of(participant_.written_topics(), is_clock)) clock_.emplace(participant_, topics::data_clock);
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

}  // namespace railfix::tool
