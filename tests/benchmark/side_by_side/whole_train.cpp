#include "side_by_side/whole_train.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "core/random.hpp"
#include "core/time.hpp"
#include "fusion/fusion_messages.hpp"
#include "map_matcher/matcher_messages.hpp"
#include "tpr_publisher/tpr_messages.hpp"
#include "tpr_publisher/tpr_publisher.hpp"
#include "track/path.hpp"

namespace railfix::measure {
namespace {

constexpr double kPeriodS = 0.1;
constexpr int kImuSamples = 10;  // in a period
constexpr double kStepNoise = 0.003;
constexpr double kYawNoiseRad = 1e-4;
constexpr double kGyroNoiseRps = 2e-4;
constexpr double kPulsesPerM = 100;
constexpr double kRoundedM = 0.06;  // in a report

class WholeTrain {
 public:
  explicit WholeTrain(const Ride& ride)
      : ride_(ride),
        truth_(route_of(ride.way)),
        path_(track::Path::along(ride.map, truth_, track::Ways(*ride.map))),
        fusion_(core::value_or_throw(fusion::Fusion::create({}, ride.map, ride.told))),
        matcher_(std::in_place, map_matcher::MapMatcherParameters{}, ride.map),
        reports_(ride.map, report_settings()),
        random_(ride.seed),
        way_m_(ride.begin_m),
        declared_m_(ride.begin_m) {
    const auto& marks = path_.landmarks();
    next_mark_ = std::ranges::find_if(marks, [&](const auto& mark) { return mark.distance_m >= way_m_; });
  }

  Tally run() {
    while (way_m_ < ride_.end_m) {
      stamp_ns_ += core::to_ns(kPeriodS);
      before_m_ = std::exchange(way_m_, way_m_ + ride_.speed_mps * kPeriodS);
      start_matcher_anew();
      estimate_.reset();
      measure();
      use_fixes();
      if (estimate_) match(map_matcher::input_of(state_));
      match(step());
      match_sightings();
      use_fixes();
      if (!estimate_) continue;
      const auto position = tpr_publisher::position_of(ride_.map.get(), state_);
      judge_state(position.place_known() && position.track_declared());
      judge_report(position);
    }
    return tally_;
  }

 private:
  static track::Route route_of(const std::vector<track::Run>& way) {
    track::Route route(way.front(), way.front().offset_m(0), 0);
    for (size_t i = 1; i < way.size(); ++i) route.push_ahead(way[i]);
    return route;
  }
  static tpr_publisher::Settings report_settings() {
    tpr_publisher::Settings settings;
    settings.parameters.t_cycloc = 1;
    settings.report.nid_engine = 1;
    return settings;
  }
  [[nodiscard]] bool in_the_dark() const {
    return std::ranges::any_of(ride_.dark, [&](const Stretch& s) { return way_m_ > s.from_m && way_m_ < s.to_m; });
  }
  void start_matcher_anew() {
    const bool anew = std::ranges::any_of(ride_.matcher_anew, [&](double m) { return m > before_m_ && m <= way_m_; });
    if (anew) matcher_.emplace(map_matcher::MapMatcherParameters{}, ride_.map);
  }

  void give(const fusion::Event& event) {
    if (const auto estimate = fusion_.add(event)) {
      estimate_ = estimate;
      state_ = fusion::message_of(*estimate);
    }
  }
  void measure() {
    const double turn_rps = truth_.curvature_at(0.5 * (before_m_ + way_m_)) * ride_.speed_mps;
    const bool gyro_fails = way_m_ > ride_.gyro_fails.from_m && way_m_ < ride_.gyro_fails.to_m;
    for (int i = 1; ride_.gyro && i <= kImuSamples; ++i) {
      const int64_t stamp_ns = stamp_ns_ - core::to_ns(kPeriodS * (kImuSamples - i) / kImuSamples) - 1;
      const double rate_rps = gyro_.told_rps(random_.normal(turn_rps, kGyroNoiseRps), gyro_fails, random_);
      give(fusion::ImuInput{stamp_ns, random_.normal(0, 0.01), rate_rps});
      matcher_->add(map_matcher::GyroInput{rate_rps, stamp_ns});
    }
    give(fusion::WheelInput{stamp_ns_, static_cast<int64_t>(way_m_ * kPulsesPerM), kPulsesPerM});
    step_m_ = (way_m_ - before_m_) / (1 + ride_.camera_scale) * random_.normal(1, kStepNoise);
    yaw_rad_ = random_.normal(turn_rps * kPeriodS, kYawNoiseRad);
    give(fusion::input_of(step_message()));
    if (ride_.gnss && ++since_gnss_ % 10 == 0) hear_gnss();
  }
  [[nodiscard]] msg::OdometryStep step_message() const {
    msg::OdometryStep step;
    step.stamp_ns(stamp_ns_);
    step.reference_stamp_ns(stamp_ns_ - core::to_ns(kPeriodS));
    step.step_m(step_m_);
    step.step_sigma_m(0.005);
    step.yaw_rad(yaw_rad_);
    step.yaw_sigma_rad(2 * kYawNoiseRad);
    step.distance_m(way_m_ / (1 + ride_.camera_scale));
    step.speed_mps(ride_.speed_mps / (1 + ride_.camera_scale));
    step.mode(in_the_dark() ? msg::ODOMETRY_BLIND : msg::ODOMETRY_TRACK);
    step.valid(in_the_dark() ? 0 : 1);
    return step;
  }
  [[nodiscard]] map_matcher::StepInput step() const { return map_matcher::input_of(step_message()); }
  void hear_gnss() {
    const auto pose = path_.at(way_m_).pose;
    gnss_east_m_ = 0.98 * gnss_east_m_ + random_.normal(0, 0.2);
    gnss_north_m_ = 0.98 * gnss_north_m_ + random_.normal(0, 0.2);
    const double east_m = pose.easting_m + gnss_east_m_;
    const double north_m = pose.northing_m + gnss_north_m_;
    give(fusion::GnssInput{stamp_ns_, east_m, north_m, 1.0, 1});
    if (matcher_->wants_gnss()) match(map_matcher::GnssInput{east_m, north_m, 1.0, stamp_ns_});
  }
  template <class Input>
  void match(const Input& input) {
    for (const auto& fix : matcher_->add(input)) fixes_.push_back(map_matcher::message_of(*ride_.map, fix));
  }
  void use_fixes() {
    for (const auto& fix : std::exchange(fixes_, {})) fusion_.add(fusion::input_of(fix));
  }
  void match_sightings() {
    for (; next_mark_ != path_.landmarks().end() && next_mark_->distance_m <= way_m_; ++next_mark_) {
      const bool sighted = track::can_be_sighted(next_mark_->kind) && random_.uniform() < ride_.detection;
      if (in_the_dark() || !sighted) continue;
      match(map_matcher::Sighting{stamp_ns_, next_mark_->kind,
                                  next_mark_->distance_m - way_m_ + random_.normal(0, 0.05), next_mark_->lateral_m, 0.1,
                                  0.95});
    }
  }

  void judge_state(bool declared) {
    const auto& e = *estimate_;
    ++tally_.states;
    tally_.ok += e.integrity == fusion::Integrity::ok ? 1 : 0;
    if (!declared) {
      tally_.undeclared_m = std::max(tally_.undeclared_m, way_m_ - declared_m_);
      return;
    }
    declared_m_ = way_m_;
    ++tally_.declared;
    if (const auto said_m = truth_.distance_of(e.position, way_m_)) {
      const double error_m = *said_m - way_m_;
      tally_.outside += error_m > e.over_m || -error_m > e.under_m ? 1 : 0;
    } else if (!is_at_an_end(e)) {
      ++tally_.wrong;
      tally_.wrong_ok += e.integrity == fusion::Integrity::ok ? 1 : 0;
    }
  }
  /// Of another edge, where the interval reaches over its end.
  [[nodiscard]] bool is_at_an_end(const fusion::TrainEstimate& e) const {
    const double length_m = ride_.map->edge(e.position.edge)->alignment.length_m();
    return std::min(e.position.offset_m, length_m - e.position.offset_m) < e.over_m + e.under_m + 1;
  }
  void judge_report(const tpr_publisher::TrainPosition& position) {
    const auto outcome = reports_.update(position, stamp_ns_);
    if (!outcome.report) return;
    const auto& fields = outcome.report->fields;
    const auto distance_m = etcs::metres_if_known(fields.d_lrbg, fields.q_scale);
    const auto over_m = etcs::metres_if_known(fields.l_doubtover, fields.q_scale);
    const auto under_m = etcs::metres_if_known(fields.l_doubtunder, fields.q_scale);
    if (fields.nid_lrbg == etcs::kUnknownBaliseGroup || !distance_m || !over_m || !under_m) return;
    ++tally_.reports;
    const double reach_m = state_.over_m() + state_.under_m() + 1;
    const bool holds = std::ranges::any_of(path_.balise_groups(), [&](const track::PathBaliseGroup& group) {
      const double true_m = way_m_ - group.distance_m;
      return group.group->nid_lrbg() == fields.nid_lrbg && group.distance_m <= way_m_ + reach_m &&
             *distance_m - true_m <= *over_m + kRoundedM && true_m - *distance_m <= *under_m + kRoundedM;
    });
    tally_.false_ones += holds ? 0 : 1;
  }

  const Ride& ride_;
  const track::Route truth_;
  const track::Path path_;
  fusion::Fusion fusion_;
  std::optional<map_matcher::MapMatcher> matcher_;
  tpr_publisher::TprPublisher reports_;
  core::Random random_;
  int64_t stamp_ns_ = 1'600'000'000'000'000'000;
  double way_m_ = 0;
  double before_m_ = 0;
  double step_m_ = 0;
  double yaw_rad_ = 0;
  int since_gnss_ = 0;
  testing::FailingGyro gyro_{ride_.gyro_fault, ride_.gyro_fault_rps};
  double gnss_east_m_ = 0, gnss_north_m_ = 0;  // its error
  std::vector<track::PathLandmark>::const_iterator next_mark_;
  std::vector<msg::PositionFix> fixes_;
  std::optional<fusion::TrainEstimate> estimate_;  // of this period
  msg::TrainState state_;                          // the same
  double declared_m_ = 0;
  Tally tally_;
};

}  // namespace

void Tally::add(const Tally& other) {
  states += other.states;
  declared += other.declared;
  ok += other.ok;
  outside += other.outside;
  wrong += other.wrong;
  wrong_ok += other.wrong_ok;
  reports += other.reports;
  false_ones += other.false_ones;
  undeclared_m = std::max(undeclared_m, other.undeclared_m);
}

std::string Tally::text() const {
  char text[240];
  std::snprintf(
      text, sizeof text,
      "%zu states, declared %zu, ok %zu; declared and outside %zu, on another track %zu (ok %zu); %zu reports, "
      "false %zu; longest way undeclared %.0f m",
      states, declared, ok, outside, wrong, wrong_ok, reports, false_ones, undeclared_m);
  return text;
}

Tally run(const Ride& ride) {
  return WholeTrain(ride).run();
}

}  // namespace railfix::measure
