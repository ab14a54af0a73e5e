#include "tpr_publisher/tpr_publisher_service.hpp"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <utility>

#include "core/time.hpp"
#include "tpr_publisher/tpr_messages.hpp"

namespace railfix::tpr_publisher {

namespace {

constexpr std::chrono::milliseconds kTickPeriod{500};
constexpr int kTicksUnheard = 10;  // of onboard_status, which comes once a second
constexpr int64_t kGapNs = 500'000'000;
constexpr int64_t kListenNs = 150'000'000;  // others in charge say so forty times a second

std::shared_ptr<const track::Map> load_map(const std::string& file) {
  if (file.empty()) return nullptr;
  return std::make_shared<const track::Map>(core::value_or_throw(track::Map::load(file)));
}

}  // namespace

TprPublisherService::TprPublisherService(const Config& config, service::Context& context)
    : context_(context),
      settings_(config.settings()),
      map_(load_map(config.map)),
      publisher_(map_, settings_),
      told_(publisher_),
      writer_(context.writer(messaging::topics::train_position_report)) {
  if (auto link = config.ground_link.settings(context.common().train_id, context.common().host)) {
    if (const auto plain = ground_link::plain_password(link->mqtt); !plain.empty())
      context.log().warn("Ground link: {}", plain);
    link->warn = [&context](const std::string& sentence) { context.log().warn("{}", sentence); };
    ground_link_ = std::make_unique<GroundLink>(*link);
    context.watch_certificate("The ground link's certificate", config.ground_link.certificate_file);
    context.watch_certificate("The certificate of the broker's authority", config.ground_link.ca_file);
  }
  context.on<msg::DataClock>(messaging::topics::data_clock, [this](const msg::DataClock& clock) {
    data_time_.emplace(clock, core::wall_ns(), core::monotonic_ns());
  });
  context.on<msg::TrainState>(messaging::topics::train_state,
                              [this](const msg::TrainState& state) { on_state(state); });
  context.on<msg::OnboardStatus>(messaging::topics::onboard_status,
                                 [this](const msg::OnboardStatus& status) { on_onboard(status); });
  context.every(kTickPeriod, [this] { on_tick(); });
  share_charge();
  context.at_restart([this](int64_t) { restart(); });
  remember();
}

// Packet 58 outlives a restart, also while the on-board unit is silent; T_TRAIN a clock that was set back meanwhile.
void TprPublisherService::remember() {
  if (context_.common().lock_step) return;
  kept_ = context_.kept();
  const auto end = kept_.find('\n');
  if (end != std::string::npos) kept_trainborne_ns_ = std::strtoll(kept_.c_str() + end, nullptr, 10);
  note_packet_58(told_.remember(kept_.substr(0, end)));
}

// Of the host's time only: data is played more than once.
void TprPublisherService::go_on_with_trainborne(int64_t stamp_ns) {
  if (data_time_ || std::abs(core::wall_ns() - stamp_ns) > core::kNsPerSecond) return;
  publisher_.go_on_after(std::exchange(kept_trainborne_ns_, 0));
}

// It stands in every onboard_status: who was away, or is the second one of two, hears it all the same.
void TprPublisherService::hear_packet_58(const msg::OnboardStatus& status, bool just_come) {
  if (status.packet_58_deleted() != 0) {
    if (told_.hear_deleted()) context_.log().info("position report parameters of packet 58 deleted");
    note_packet_58(false);
    return;
  }
  const size_t bytes = std::min<size_t>(status.packet_58_bytes(), status.packet_58().size());
  note_packet_58(
      told_.hear({status.packet_58().data(), bytes}, just_come, status.packet_58_lrbg(), status.packets_58()));
}

void TprPublisherService::note_packet_58(bool taken) {
  if (taken) context_.log().info("position report parameters of packet 58 taken over");
  keep_notes();
}

void TprPublisherService::keep_notes() {
  if (context_.common().lock_step) return;
  auto notes = told_.notes();
  const int64_t trainborne_ns = std::max(publisher_.trainborne_ns(), kept_trainborne_ns_);
  if (!data_time_ && trainborne_ns > 0) notes += '\n' + std::to_string(trainborne_ns);
  if (notes == kept_) return;
  kept_ = notes;
  context_.keep(notes);
}

void TprPublisherService::share_charge() {
  if (context_.common().ownership_strength == 0) return;
  context_.share_charge({[this] { return fitness(); }, {}});
  context_.on<msg::TrainPositionReport>(messaging::topics::train_position_report,
                                        [this](const msg::TrainPositionReport& report) { hear_other(report); });
}

// Numbers and T_TRAIN go on where the other one stopped, whatever its clock said.
void TprPublisherService::hear_other(const msg::TrainPositionReport& report) {
  seq_ = std::max(seq_, report.seq() + 1);
  const size_t bytes = std::min<size_t>(report.message_bytes(), report.message().size());
  const auto fields = etcs::decode({report.message().data(), bytes}, static_cast<etcs::Baseline>(report.baseline()));
  if (!fields.ok()) return;
  publisher_.hear_trainborne(fields.value().t_train, now_ns(report.sent_ns()));
  if (is_confirmed(fields.value().q_length)) publisher_.hear_confirmed(report.stamp_ns());
}

// Without a way to the ground reports only wait; without a store a power cut loses some; with a wrong clock they would
// say a wrong time.
int TprPublisherService::fitness() const {
  if (context_.clock_is_doubted()) return 0;
  const bool has_state = state_seen_ && core::monotonic_ns() - state_monotonic_ns_ < core::kNsPerSecond;
  const bool has_ground = !ground_link_ || ground_link_->connected();
  const bool has_store = !ground_link_ || ground_link_->stores();
  return (has_ground ? 4 : 0) + (has_store ? 2 : 0) + (has_state ? 1 : 0);
}

void TprPublisherService::stand_by(const msg::TrainState& state, int64_t now_ns) {
  publisher_.watch(position_of(map_.get(), state), now_ns);
  note_packet_58(told_.follow());
  report_trouble_.clear();
  context_.health().active();
}

void TprPublisherService::restart() {
  publisher_ = TprPublisher(map_, settings_);
  told_.begin_anew();
  state_seen_ = false;
  reference_known_ = false;
}

int64_t TprPublisherService::now_ns(int64_t stamp_ns) const {
  if (context_.common().lock_step) return stamp_ns;  // the data waits for us
  return data_time_ ? data_time_->at(core::monotonic_ns()) : core::wall_ns();
}

void TprPublisherService::on_state(const msg::TrainState& state) {
  context_.health().input();
  notice_gap();
  const int64_t now = now_ns(state.stamp_ns());
  if (!context_.in_charge() || state_monotonic_ns_ < listens_until_ns_) {
    stand_by(state, now);
    return;
  }
  go_on_with_trainborne(state.stamp_ns());
  const auto position = position_of(map_.get(), state);
  const auto outcome = publisher_.update(position, now);
  note_packet_58(told_.follow());
  if (outcome.report) send(*outcome.report, state.grabbed_ns());
  if (!outcome.refusal.empty()) {
    report_trouble_ = outcome.refusal;
  } else if (!onboard_refusal_.empty()) {
    report_trouble_ = onboard_refusal_;
  } else if (!told_.refusal().empty()) {
    report_trouble_ = told_.refusal();
  } else if (const auto unknown = publisher_.front_unknown(); !unknown.empty()) {
    report_trouble_ = "Reports say LRBG unknown: " + unknown;
  } else if (auto left_out = publisher_.left_out(now); !left_out.empty()) {
    report_trouble_ = std::move(left_out);
  } else if (!reference_known_) {
    report_trouble_ =
        !map_                        ? "Reports say LRBG unknown: tpr_publisher.map is not set."
        : state.track_known() == 0   ? "Reports say LRBG unknown: the track is not known."
        : !position.usable           ? "Reports say LRBG unknown: the position is unusable; fusion's status says why."
        : !position.track_known      ? "Reports say LRBG unknown: train_state is of another map than tpr_publisher.map."
        : !position.track_declared() ? "Reports say LRBG unknown: which track it is has not been declared yet."
                                     : "Reports say LRBG unknown: no balise group behind the train yet.";
  } else {
    report_trouble_ = publisher_.undeclared();
  }
  show();
}

// A cable that is plugged in again may bring the state before the word of the one that has taken charge meanwhile.
void TprPublisherService::notice_gap() {
  const bool one_of_two = context_.common().ownership_strength > 0 && !context_.common().lock_step;
  const int64_t now = core::monotonic_ns();
  if (one_of_two && state_seen_ && now - state_monotonic_ns_ > kGapNs) listens_until_ns_ = now + kListenNs;
  state_seen_ = true;
  state_monotonic_ns_ = now;
}

void TprPublisherService::on_onboard(const msg::OnboardStatus& status) {
  const int64_t now = now_ns(status.stamp_ns());
  if (publisher_.onboard_overtaken(status.stamp_ns(), now)) return;
  const bool heard_before = publisher_.onboard_heard(now);
  const auto heard = onboard_of(status);
  const auto taken = publisher_.set_onboard(heard.onboard, now);
  const auto refusal = taken.ok() ? heard.refusal : taken.error().message;
  onboard_refusal_ = refusal.empty() ? "" : "Not all of onboard_status is used: " + refusal;
  hear_packet_58(status, heard_before);
}

void TprPublisherService::on_tick() {
  if (!state_seen_ || !context_.in_charge()) return;  // ready, whatever the ground link says
  say_what_is_assumed();
  // The end of played data is no fault.
  if (!context_.common().lock_step && !(data_time_ && data_time_->stands())) {
    auto outcome = publisher_.tick(now_ns(0));
    if (!outcome.refusal.empty()) report_trouble_ = std::move(outcome.refusal);
  }
  show();
}

// No trouble of its own, because a train without that connection has it for good; but nobody shall take it for known.
void TprPublisherService::say_what_is_assumed() {
  if (ticks_unheard_ > kTicksUnheard || ++ticks_unheard_ <= kTicksUnheard) return;
  if (publisher_.mode_assumed())
    context_.log().warn(
        "M_MODE {} and M_LEVEL {} of the reports are those of the keys m_mode and m_level: nobody has sent "
        "onboard_status. Train integrity is not known.",
        settings_.report.m_mode, settings_.report.m_level);
}

void TprPublisherService::send(const Report& report, int64_t grabbed_ns) {
  to_ground(report);  // the store's thread begins with it at once, whatever becomes of the sample on the train
  auto message = message_of(report, settings_.report.baseline);
  message.seq(seq_);
  if (!writer_.write(message)) {
    context_.log().error("A position report could not be sent.");
    return;
  }
  ++seq_;
  reference_known_ = report.fields.nid_lrbg != etcs::kUnknownBaliseGroup;
  context_.health().output(grabbed_ns);
  context_.log().debug("reason {}: {}", message.reason(), etcs::to_hex(report.message));
}

void TprPublisherService::to_ground(const Report& report) {
  if (!ground_link_) return;
  ground_link::GroundReport ground;
  ground.train = context_.common().train_id;
  ground.host = context_.common().host;
  ground.stamp_ns = report.stamp_ns;
  ground.sent_ns = report.sent_ns;
  ground.baseline = static_cast<uint32_t>(settings_.report.baseline);
  ground.reason = static_cast<uint32_t>(report.reason);
  ground.message = report.message;
  ground_link_->send(std::move(ground));
}

void TprPublisherService::show() {
  std::string degraded_by = report_trouble_;
  if (const auto link = ground_link_ ? ground_link_->trouble() : ""; !link.empty())
    degraded_by += (degraded_by.empty() ? "" : " ") + link;
  if (degraded_by.empty()) {
    context_.health().active();
  } else {
    context_.health().degraded(degraded_by);
  }
  if (const auto remark = ground_link_ ? ground_link_->remark() : ""; remark != remark_) {
    remark_ = remark;
    if (!remark.empty()) context_.log().warn("{}", remark);
  }
}

}  // namespace railfix::tpr_publisher
