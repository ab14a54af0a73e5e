#include "map/nominal_ride.hpp"

#include <algorithm>
#include <cmath>
#include <memory>
#include <utility>

#include "core/random.hpp"
#include "core/time.hpp"
#include "core/units.hpp"
#include "fusion/fusion_messages.hpp"
#include "map_matcher/matcher_messages.hpp"

namespace railfix::tool {
namespace {

using track::LandmarkKind;

constexpr int64_t kBeginNs = 1'700'000'000'000'000'000;
constexpr double kStandS = 1;
constexpr double kAccelerationMps2 = 1;
constexpr double kPictureEveryM = 2;  // finer than the 4 m over which map_matcher takes means, and still quick
constexpr double kLongestPeriodS = 0.1;
constexpr double kInertialS = 0.025;
constexpr double kPulsesPerM = 100;
// What the services say of themselves in runs with pictures of 640x512 (docs/figures/sightings.md).
constexpr double kStepSigmaM = 0.004;
constexpr double kYawSigmaRad = 3e-4;
constexpr double kCurvatureSigmaPerM = 2e-4;
constexpr double kCurvatureAheadM = 5;  // of so short a view it belongs to its middle, as map_matcher has it
constexpr double kSightedAheadM = 7;
constexpr double kConfidence = 0.995;
constexpr double kVaguely = 4;  // times the usual sigma: portals out are sighted to 0.1 to 1.1 m
// An accelerometer that repeats itself to the last digit is taken for stuck.
constexpr double kAccelNoiseMps2 = 0.05;
constexpr double kRateNoiseRps = 0.002;

double usual_sigma_m(LandmarkKind kind) {
  switch (kind) {
    case LandmarkKind::frog:
    case LandmarkKind::balise:
      return 0.07;
    case LandmarkKind::portal_in:
    case LandmarkKind::portal_out:
    case LandmarkKind::bridge:
      return 0.13;
    default:
      return 0.25;
  }
}

std::shared_ptr<const track::Map> map_of(const RideWay& way) {
  auto map = std::make_shared<track::Map>();
  std::vector<track::Element> elements;
  for (size_t i = 0; RideWay::kSampledEveryM * static_cast<double>(i) < way.length_m; ++i) {
    const double begin_m = RideWay::kSampledEveryM * static_cast<double>(i);
    elements.push_back({std::min(RideWay::kSampledEveryM, way.length_m - begin_m), way.curvature_per_m.at(i),
                        way.curvature_per_m.at(i + 1)});
  }
  map->nodes = {{1, track::NodeKind::end, "", 0, 0}, {2, track::NodeKind::end, "", 0, 0}};
  map->edges.push_back({1, "way", 1, 2, "", track::Alignment::chained({0, 0, 0}, std::move(elements), way.profile)});
  map->landmarks = way.landmarks;
  uint32_t id = 0;
  for (track::Landmark& mark : map->landmarks) {
    mark.id = ++id;
    mark.edge = 1;
  }
  return map;
}

// The track is known: no other one is on the map.
map_matcher::MapMatcherParameters matcher_parameters() {
  map_matcher::MapMatcherParameters parameters;
  parameters.choose_track = parameters.locate = false;
  return parameters;
}

class NominalRide {
 public:
  NominalRide(const RideWay& way, const fusion::FusionParameters& parameters, double speed_mps, double vagueness)
      : parameters_(parameters),
        vagueness_(vagueness),
        most_mps_(speed_mps),
        period_s_(std::min(kLongestPeriodS, kPictureEveryM / speed_mps)),
        map_(map_of(way)),
        track_(map_->edges.front().alignment),
        fusion_(core::value_or_throw(fusion::Fusion::create(parameters, map_, track::EdgePosition{1, 0}))),
        matcher_(matcher_parameters(), map_) {}

  std::vector<PromisedPlace> run() {
    std::vector<PromisedPlace> promised;
    while (move()) {
      feel();
      fusion_.add(fusion::WheelInput{now_ns_, std::llround(at_m_ * kPulsesPerM), kPulsesPerM});
      const auto state = fusion_.add(fusion::OdometryInput{now_ns_, before_ns_, at_m_ - was_m_, kStepSigmaM, true});
      if (!state) continue;
      const double half_m = std::max(state->over_m, state->under_m);
      promised.push_back({at_m_, half_m, half_m > parameters_.allowed_m(state->since_sure_m)});
      match(*state);
    }
    return promised;
  }

 private:
  /// To the next picture; false beyond the end of the way.
  bool move() {
    before_ns_ = std::exchange(now_ns_, kBeginNs + core::to_ns(++pictures_ * period_s_));
    was_m_ = at_m_;
    was_mps_ = speed_mps_;
    if (pictures_ * period_s_ > kStandS) speed_mps_ = std::min(most_mps_, speed_mps_ + kAccelerationMps2 * period_s_);
    at_m_ += 0.5 * (was_mps_ + speed_mps_) * period_s_;
    return at_m_ < track_.length_m();
  }

  void feel() {
    const int samples = static_cast<int>(std::ceil(period_s_ / kInertialS));
    for (int i = 1; i <= samples; ++i) {
      const auto point = track_.at(was_m_ + (at_m_ - was_m_) * i / samples);
      const double force_mps2 =
          (speed_mps_ - was_mps_) / period_s_ + core::kGravityMps2 * point.grade / std::hypot(1.0, point.grade);
      fusion_.add(fusion::ImuInput{before_ns_ + (now_ns_ - before_ns_) * i / samples,
                                   force_mps2 + kAccelNoiseMps2 * random_.normal(),
                                   speed_mps_ * point.curvature_per_m + kRateNoiseRps * random_.normal()});
    }
  }

  void match(const fusion::TrainEstimate& state) {
    const double step_m = at_m_ - was_m_;
    use(matcher_.add(map_matcher::input_of(fusion::message_of(state))));
    use(matcher_.add(map_matcher::StepInput{now_ns_, before_ns_, true, step_m, track_.curvature_at(at_m_) * step_m,
                                            kYawSigmaRad, at_m_, speed_mps_}));
    matcher_.add(map_matcher::ViewInput{track_.curvature_at(at_m_ + kCurvatureAheadM),
                                        kCurvatureSigmaPerM * kCurvatureSigmaPerM, now_ns_});
    const auto& marks = map_->landmarks;
    for (; sighted_ < marks.size() && marks[sighted_].offset_m < at_m_ + kSightedAheadM; ++sighted_) {
      const track::Landmark& mark = marks[sighted_];
      if (mark.offset_m < at_m_) continue;
      use(matcher_.add(map_matcher::Sighting{now_ns_, mark.kind, mark.offset_m - at_m_, mark.lateral_m,
                                             vagueness_ * usual_sigma_m(mark.kind), kConfidence}));
    }
  }

  void use(const map_matcher::PlaceFixes& fixes) {
    for (const map_matcher::PlaceFix& fix : fixes) fusion_.add(fusion::input_of(map_matcher::message_of(*map_, fix)));
  }

  const fusion::FusionParameters& parameters_;
  double vagueness_;  // of sightings, against the usual one
  double most_mps_;
  double period_s_;
  std::shared_ptr<const track::Map> map_;
  const track::Alignment& track_;
  fusion::Fusion fusion_;
  map_matcher::MapMatcher matcher_;
  core::Random random_{1};
  int pictures_ = 0;
  int64_t before_ns_ = kBeginNs;
  int64_t now_ns_ = kBeginNs;
  double was_m_ = 0;
  double at_m_ = 0;
  double was_mps_ = 0;
  double speed_mps_ = 0;
  size_t sighted_ = 0;  // so many landmarks lie behind or have been sighted
};

}  // namespace

std::vector<PromisedPlace> nominal_ride(const RideWay& way, const fusion::FusionParameters& parameters,
                                        double speed_mps) {
  std::vector<PromisedPlace> promised = NominalRide(way, parameters, speed_mps, 1).run();
  const std::vector<PromisedPlace> vague = NominalRide(way, parameters, speed_mps, kVaguely).run();
  for (size_t i = 0; i < promised.size(); ++i) {  // the same pictures
    promised[i].half_m = std::max(promised[i].half_m, vague.at(i).half_m);
    promised[i].outside_budget = promised[i].outside_budget || vague.at(i).outside_budget;
  }
  return promised;
}

}  // namespace railfix::tool
