#include "fusion/scale_trial.hpp"

#include <cmath>

#include "core/time.hpp"

namespace railfix::fusion {
namespace {

constexpr double kRatioSigmas = 5.0;
constexpr double kRatioApartS = 10.0;  // longer than slips last
constexpr double kTaughtShare = 0.1;   // of the sigma before any reference
constexpr double kMissingS = 300;      // a sensor that has not measured for so long does not measure any more
constexpr unsigned kBitsOfOne = 8;     // of Hypotheses::slipping

OdometerScales prior(const FusionParameters& parameters, const std::optional<OdometerScales>& saved) {
  return saved.value_or(unlearnt_scales(parameters));
}

}  // namespace

ScaleTrial::ScaleTrial(const FusionParameters* parameters, const std::optional<OdometerScales>& saved,
                       std::shared_ptr<const track::Path> path, int64_t stamp_ns)
    : parameters_(parameters),
      saved_(prior(*parameters, saved)),
      state_(saved ? SavedScalesAre::on_trial : SavedScalesAre::none),
      main_(parameters, saved_, path, stamp_ns) {
  if (saved) unlearnt_.emplace(parameters, unlearnt_scales(*parameters), std::move(path), stamp_ns);
}

void ScaleTrial::apply(const Event& event) {
  main_.apply(event);
  if (!unlearnt_) return;
  unlearnt_->apply(event);
  give_place_up();
  if (contradicted(event)) {
    drop_saved();
  } else if ((std::holds_alternative<FixInput>(event) || std::holds_alternative<GnssInput>(event)) && confirmed()) {
    // What was saved of a sensor that is missing was not tried: the set that does not know it goes on.
    const auto untried = [&](Odometer odometer) { return was_saved(odometer) && missing(odometer); };
    if (untried(Odometer::camera) || untried(Odometer::wheel)) main_ = *std::move(unlearnt_);
    unlearnt_.reset();
    state_ = SavedScalesAre::confirmed;
  }
}

// A place that one of the two sets has given up the other one must not go on with.
void ScaleTrial::give_place_up() {
  const auto& mine = main();
  const auto& free = unlearnt_->main();
  if (!mine.place().path() && free.place().path())
    unlearnt_->give_place_up(mine.place().given_up().value_or(Against::sightings));
  if (mine.place().path() && !free.place().path())
    main_.give_place_up(free.place().given_up().value_or(Against::sightings));
}

void ScaleTrial::drop_saved() {
  if (!unlearnt_) return;
  main_ = *std::move(unlearnt_);
  unlearnt_.reset();
  state_ = SavedScalesAre::contradicted;
}

// A landmark is where only those who know nothing of the saved scales expected it, GNSS likewise, or one of the two
// odometers is another one.
bool ScaleTrial::contradicted(const Event& event) {
  if (const auto* fix = std::get_if<FixInput>(&event)) {
    return fix->kind == FixKind::landmark && main_.fix_fitted() == false && unlearnt_->fix_fitted() == true;
  }
  if (std::holds_alternative<GnssInput>(event)) {
    return main().watch(Source::gnss).isolated && unlearnt_->main().place().gnss_proven();
  }
  if (!ratio_is_another()) {
    apart_since_ns_ = 0;
    return false;
  }
  if (apart_since_ns_ == 0) apart_since_ns_ = stamp_ns();
  return core::seconds(stamp_ns() - apart_since_ns_) > kRatioApartS;
}

bool ScaleTrial::ratio_is_another() const {
  const auto& free = unlearnt_->main();
  if (!free.sensors().has_ever_measured(Source::camera) || !free.sensors().has_ever_measured(Source::wheel) ||
      !free.sensors().are_consistent())
    return false;
  const auto& p = *parameters_;
  const auto& filter = free.filter();
  const double saved_sigma =
      std::sqrt(std::max(0.0, std::pow(saved_.camera_sigma, 2) + std::pow(saved_.wheel_sigma, 2) -
                                  2 * saved_.correlation * saved_.camera_sigma * saved_.wheel_sigma +
                                  (std::pow(p.visual_scale_walk, 2) + std::pow(p.wheel_scale_walk, 2)) *
                                      std::abs(free.motion().distance_m())));
  const double saved_ratio = (1 + saved_.wheel) / (1 + saved_.camera);
  const double ratio = filter.scale(Odometer::wheel) / filter.scale(Odometer::camera);
  return std::abs(ratio - saved_ratio) > kRatioSigmas * std::hypot(saved_sigma, filter.sigma(StateIndex::other_scale));
}

bool ScaleTrial::was_saved(Odometer odometer) const {
  const auto before = unlearnt_scales(*parameters_);
  return odometer == Odometer::camera ? saved_.camera_sigma < before.camera_sigma
                                      : saved_.wheel_sigma < before.wheel_sigma;
}

bool ScaleTrial::missing(Odometer odometer) const {
  const auto source = odometer == Odometer::camera ? Source::camera : Source::wheel;
  const int64_t used_ns = unlearnt_->main().watch(source).used_ns;
  return used_ns == 0 || core::seconds(stamp_ns() - used_ns) > kMissingS;
}

// Whatever is left to be wrong of the scales is less than the interval grows with the way since the reference.
bool ScaleTrial::confirmed() const {
  const auto& free = unlearnt_->main();
  if (!main().sensors().are_consistent() || !free.sensors().are_consistent()) return false;
  bool tried = false;
  bool untried = false;
  for (const auto odometer : {Odometer::camera, Odometer::wheel}) {
    if (!was_saved(odometer)) continue;
    (missing(odometer) ? untried : tried) = true;
    const double apart = std::abs(main().filter().scale(odometer) - free.filter().scale(odometer));
    const double unsure = apart + parameters_->interval_factor * free.filter().scale_sigma(odometer);
    if (!missing(odometer) && unsure > parameters_->interval_drift) return false;
  }
  return tried || !untried;
}

void ScaleTrial::predict_to(int64_t stamp_ns) {
  main_.predict_to(stamp_ns);
  if (unlearnt_) unlearnt_->predict_to(stamp_ns);
}

void ScaleTrial::rebase_clock(int64_t stamp_ns) {
  main_.rebase_clock(stamp_ns);
  if (unlearnt_) unlearnt_->rebase_clock(stamp_ns);
  apart_since_ns_ = 0;
}

void ScaleTrial::follow_on(const std::shared_ptr<const track::Path>& path,
                           const std::shared_ptr<const track::Path>& longer) {
  main_.follow_on(path, longer);
  if (unlearnt_) unlearnt_->follow_on(path, longer);
}

bool ScaleTrial::slip_began() const {
  return main().motion().slip_began() || (unlearnt_ && unlearnt_->main().motion().slip_began());
}

uint32_t ScaleTrial::slipping() const {
  return main_.slipping() | (unlearnt_ ? unlearnt_->slipping() << kBitsOfOne : 0U);
}

void ScaleTrial::block_wheel(const WheelBlock& block, uint32_t slipping) {
  main_.block_wheel(block, slipping);
  if (unlearnt_) unlearnt_->block_wheel(block, slipping >> kBitsOfOne);
}

TrainEstimate ScaleTrial::estimate() const {
  Promise promise = main_.promise();
  if (unlearnt_) promise.hold(unlearnt_->promise());
  return main_.estimate(promise);
}

std::optional<OdometerScales> ScaleTrial::learnt() const {
  if (unlearnt_ || !main().sensors().are_consistent()) return std::nullopt;
  const auto scales = main_.scales();
  const auto before = unlearnt_scales(*parameters_);
  const bool taught = scales.camera_sigma < kTaughtShare * before.camera_sigma ||
                      scales.wheel_sigma < kTaughtShare * before.wheel_sigma;
  return taught ? std::optional(scales) : std::nullopt;
}

}  // namespace railfix::fusion
