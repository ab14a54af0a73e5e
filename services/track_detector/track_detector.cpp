#include "track_detector/track_detector.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace railfix::track_detector {
namespace {

constexpr size_t kMostPoints = 80;  // two rails at the last pass's stations
constexpr size_t kLongestReason = 80;
constexpr double kSigmas = 3.0;       // limits of the search, in sigmas of the suspension
constexpr double kSearchFarM = 28.0;  // farther, pitch errors move the rails too much for a coarse search
constexpr double kMinSearchScore = 0.12;
constexpr size_t kCandidates = 4;
constexpr int kPatience = 3;        // pictures without rails before the search saves time
constexpr double kHopeful = 0.4;    // share of the places with an edge, below which a candidate is given up
constexpr double kSupportPx = 1.5;  // a point within this of the fit ...
constexpr double kSupportM = 0.02;  // ... or this supports the rail
constexpr double kClosePx = 0.6;    // edges of rails lie together, those of noise anywhere within the support
constexpr double kQuietGrey = 0.5;  // noise of a picture without any
constexpr double kLeastClear = 1.5;
constexpr double kLeastClearOfPair = 1.2;  // of one rail, where the other makes up for it
constexpr double kLoneShare = 0.65;        // of the stations, where no other rail at the gauge vouches for one, ...
constexpr double kLoneDisplacement = 2.0;  // ... sigmas squared, ...
constexpr double kLoneSigmaM = 0.03;       // ... and it may be the other edge of its head, or a shadow's
constexpr int kMoment = 10;                // pictures
constexpr double kFitTolerance = 0.05;     // sigmas
constexpr double kLeastSigmaFactor = 0.15;
constexpr int kFitIterations = 15;
constexpr double kSettled = 0.5;  // sigmas; points that leave one by one keep a fit creeping
constexpr double kGoodResidualPx = 2.0;
constexpr double kHeadPx = 3.0;  // rails are followed until their heads are as narrow as this ...
constexpr double kSmallestHeadPx = 1.5;
constexpr double kShortestLook = 2.5;  // ... but at least to so many times the nearest visible distance
constexpr double kUsualWeight = 0.02;  // of a picture in the slow mean of the pose
constexpr double kPartsNearM = 4.0;    // legs that part so little beyond the nearest visible place are two shapes
constexpr double kLegRollRad = 0.008;  // how well a pose on one leg of a switch is known
constexpr double kLegYawRad = 0.02;
constexpr double kLegLateralM = 0.1;
constexpr double kSureMargin = 2.0;     // sigmas squared by which the train stands better on one leg
constexpr double kStillOneM = 0.03;     // legs this close are one
constexpr double kShortestM = 3.0;      // of rail that is reported at least
constexpr double kUnsureLeg = 0.7;      // of the confidence while the own leg is not known
constexpr double kSure = 0.8;           // confidence that ends the search
constexpr double kTrackReachM = 0.08;   // how far rails are looked for from the previous picture's ...
constexpr double kSearchReachM = 0.10;  // ... and from the search's

/// They come first.
size_t left_count(const std::vector<RailEdge>& edges) {
  return static_cast<size_t>(
      std::count_if(edges.begin(), edges.end(), [](const RailEdge& edge) { return edge.point.side == Side::left; }));
}

int rails(const TrackObservation& o) {
  return (o.seen_left ? 1 : 0) + (o.seen_right ? 1 : 0);
}

bool is_better(const TrackObservation& a, const TrackObservation& b) {
  return rails(a) != rails(b) ? rails(a) > rails(b) : a.confidence > b.confidence;
}

}  // namespace

TrackDetector::TrackDetector(const geometry::Intrinsics& camera, const geometry::CameraPose& mount,
                             const DetectorOptions& options)
    : camera_(camera), options_(options) {
  mount_.camera = mount;
  usual_ = last_ = to_vector(mount_);
  const auto& limits = options.limits;
  search_limits_.pitch_rad = kSigmas * limits.pitch_rad;
  search_limits_.yaw_rad = kSigmas * limits.yaw_rad;
  search_limits_.lateral_m = kSigmas * (limits.lateral_m + limits.roll_rad * mount.height_m);
  search_limits_.height_fraction = kSigmas * limits.height_m / mount.height_m;
  search_limits_.curvature_per_m = 2 * limits.curvature_per_m;
  near_m_ = nearest_visible_m(camera, mount, options.gauge_m / 2 + 0.1, options.far_m / 3);
  TopViewSize size;
  size.far_m = std::min(std::max(kSearchFarM, 3 * near_m_), options.far_m);
  size.half_width_m =
      std::min(5.0, options.gauge_m / 2 + 0.3 + search_limits_.lateral_m + search_limits_.yaw_rad * size.far_m +
                        search_limits_.curvature_per_m * size.far_m * size.far_m / 2);
  top_view_ = std::make_unique<TopView>(camera, mount, size);
  search_ = std::make_unique<RailSearch>(*top_view_, search_limits_, options.gauge_m, options.head_m);
  points_.reserve(kMostPoints);
  clear_.reserve(kMostPoints);
  for (TrackObservation* one : {&observation_, &found_, &trial_}) {
    one->points.reserve(kMostPoints);
    one->reason.reserve(kLongestReason);
  }
}

void TrackObservation::clear() {
  TrackObservation fresh;
  points.clear();
  reason.clear();
  fresh.points.swap(points);
  fresh.reason.swap(reason);
  *this = std::move(fresh);
}

const TrackObservation& TrackDetector::detect(const cv::Mat& grey, const std::optional<RollHint>& roll) {
  roll_ = roll;
  top_view_->look(grey);
  // One search a picture when following has already cost its time; the other kind of rails waits for the next.
  const bool lost = previous_.has_value();
  if (lost && follow(grey)) return observation_;
  previous_.reset();
  // While nothing is seen for long, bright and dark rails take turns: that keeps up with the camera.
  const bool both = misses_ < kPatience;
  observation_.clear();
  forget(observation_);
  for (const bool dark : {false, true}) {
    if (lost && dark != dark_) continue;
    if (!both && dark != (misses_ % 2 == 1)) continue;
    search(grey, dark, found_);
    if (!is_better(observation_, found_)) std::swap(observation_, found_);
    if (observation_.seen()) {
      choose_leg(grey, dark, observation_);
      previous_ = observation_.shape;
      last_ = to_vector(observation_.shape);
      dark_ = dark;
      misses_ = 0;
      return observation_;
    }
  }
  ++misses_;
  return observation_;
}

const TrackObservation& TrackDetector::not_seen(const char* why) {
  observation_.clear();
  forget(observation_);
  observation_.reason = why;
  return observation_;
}

bool TrackDetector::follow(const cv::Mat& grey) {
  refine(grey, *previous_, dark_, kTrackReachM, observation_);
  if (!observation_.seen()) return false;
  choose_leg(grey, dark_, observation_);
  previous_ = observation_.shape;
  last_ = to_vector(observation_.shape);
  return true;
}

void TrackDetector::search(const cv::Mat& grey, bool dark, TrackObservation& best) {
  best.clear();
  best.reason = "no pair of rails at the gauge";
  forget(best);
  for (const auto& candidate : search_->find(top_view_->ridges(dark), kCandidates, misses_ / 2)) {
    if (candidate.score < kMinSearchScore) continue;
    refine(grey, candidate.shape, dark, kSearchReachM, trial_);
    if (is_better(trial_, best)) std::swap(best, trial_);
    if (best.seen() && best.confidence > kSure) break;
  }
}

const RailFit& TrackDetector::fit(const std::vector<EdgePoint>& points, const TrackShape& start, bool last,
                                  double rail_offset_sigma_m) {
  RailFitOptions fit_options;
  fit_options.gauge_m = options_.gauge_m;
  fit_options.prior = mount_;
  fit_options.prior_sigma = options_.limits;
  if (roll_) {
    fit_options.prior.camera.roll_rad = roll_->roll_rad;
    fit_options.prior_sigma.roll_rad = std::min(roll_->sigma_rad, options_.limits.roll_rad);
  }
  fit_options.least_sigma_factor = last ? kLeastSigmaFactor : 0;
  fit_options.rail_offset_sigma_m = std::max(options_.rail_offset_sigma_m, rail_offset_sigma_m);
  fit_options.step_tolerance = kFitTolerance;
  fit_options.max_iterations = kFitIterations;
  return fitter_.fit(camera_, points, start, fit_options);
}

void TrackDetector::refine(const cv::Mat& grey, const TrackShape& start, bool dark, double first_reach_m,
                           TrackObservation& observation) {
  TrackShape shape = start;  // may be the observation's own
  observation.clear();
  EdgeOptions edge_options;
  edge_options.gauge_m = options_.gauge_m;
  edge_options.head_m = options_.head_m;
  edge_options.near_m = near_m_;
  edge_options.min_contrast = options_.min_contrast;
  edge_options.dark = dark;
  // A camera of few pixels must make do with narrower heads, or it would see no length of rail at all.
  edge_options.smallest_head_px =
      std::clamp(camera_.fu_px * options_.head_m / (kShortestLook * near_m_), kSmallestHeadPx, kHeadPx);
  std::array<int, 2> tried{};
  // Near first, where little can go wrong; then farther and narrower with what the near part has taught.
  const double far_m[] = {std::min(25.0, options_.far_m), std::min(40.0, options_.far_m), options_.far_m};
  const double reach_m[] = {first_reach_m, 0.06, 0.045};
  const int stations[] = {20, 28, 40};
  const std::vector<RailEdge>* edges = nullptr;
  const RailFit* result = nullptr;
  for (int pass = 0; pass < 3; ++pass) {
    edge_options.far_m = far_m[pass];
    edge_options.reach_m = reach_m[pass];
    edge_options.stations = stations[pass];
    edge_options.noise = pass == 2;
    edges = &edge_finder_.find(grey, camera_, shape, edge_options, tried.data());
    if (edges->size() < 8 || static_cast<double>(edges->size()) < kHopeful * (tried[0] + tried[1])) {
      observation.reason = "too few edges of rail heads";
      forget(observation);
      return;
    }
    points_.clear();
    for (const auto& edge : *edges) points_.push_back(edge.point);
    result = &fit(points_, shape, pass == 2);
    shape = result->shape;
  }
  observation.near_m = edge_options.near_m;
  observation.far_m = edge_options.far_m;
  judge(*edges, tried, *result, observation);
  if (observation.seen()) edge_finder_.learn(dark);
  if (observation.seen_left != observation.seen_right) keep_one_rail(*edges, tried, observation);
  if (!observation.seen_left && !observation.seen_right) forget(observation);
}

void TrackDetector::judge(const std::vector<RailEdge>& edges, const std::array<int, 2>& tried, const RailFit& fit,
                          TrackObservation& observation) {
  std::array<int, 2> supported{};
  for (size_t i = 0; i < edges.size(); ++i) {
    if (std::abs(fit.residuals_px[i]) > support_px(edges[i])) continue;
    ++supported[edges[i].point.side == Side::left ? 0 : 1];
    observation.points.push_back(edges[i].point);
  }
  std::array<double, 2> share{};
  for (size_t side = 0; side < 2; ++side)
    share[side] = tried[side] < 6 ? 0.0 : supported[side] / static_cast<double>(tried[side]);
  observation.shape = fit.shape;
  observation.covariance = fit.covariance;
  observation.condition = fit.condition;
  observation.residual_px = fit.residual_px;
  observation.confidence = std::sqrt(share[0] * share[1]) / (1.0 + fit.residual_px / kGoodResidualPx);
  if (fit.last_step > kSettled) {
    observation.reason = "the fit does not settle";
  } else if (const char* reason = outside_limits(fit.shape)) {
    observation.reason = reason;
  } else if (clearness(edges, fit.residuals_px) < kLeastClear) {
    observation.reason = "the rails stand out no more than noise does";
  } else {
    const std::span all(edges);
    const std::span residuals_px(fit.residuals_px);
    const size_t lefts = left_count(edges);
    const double left = clearness(all.first(lefts), residuals_px.first(lefts));
    const double right = clearness(all.subspan(lefts), residuals_px.subspan(lefts));
    observation.seen_left = share[0] >= options_.min_supported && left >= kLeastClearOfPair;
    observation.seen_right = share[1] >= options_.min_supported && right >= kLeastClearOfPair;
    if (!observation.seen()) observation.reason = "too few rows show both rails, or no clearer than noise";
  }
}

double TrackDetector::clearness(std::span<const RailEdge> edges, std::span<const double> residuals_px) {
  clear_.clear();
  int supported = 0;
  int close = 0;
  for (size_t i = 0; i < edges.size(); ++i) {
    clear_.push_back(edges[i].contrast / (edges[i].noise + kQuietGrey));
    const double off_px = std::abs(residuals_px[i]);
    supported += off_px <= support_px(edges[i]) ? 1 : 0;
    close += off_px <= kClosePx ? 1 : 0;
  }
  if (supported == 0) return 0;
  const auto middle = clear_.begin() + static_cast<std::ptrdiff_t>(clear_.size() / 2);
  std::nth_element(clear_.begin(), middle, clear_.end());
  return *middle * std::min(1.0, close / static_cast<double>(supported));
}

double TrackDetector::support_px(const RailEdge& edge) const {
  return std::max(kSupportPx, kSupportM * camera_.fu_px / std::max(1.0, edge.ahead_m));
}

// What was taken for the other rail must not bend the answer. A line alone may be anything (a shadow, a kerb, the next
// track's rail): it must be whole, clear, and where the camera is wont to have its rail.
void TrackDetector::keep_one_rail(const std::vector<RailEdge>& edges, const std::array<int, 2>& tried,
                                  TrackObservation& observation) {
  const Side side = observation.seen_left ? Side::left : Side::right;
  const size_t lefts = left_count(edges);
  const std::span all(edges);
  const auto rail = side == Side::left ? all.first(lefts) : all.subspan(lefts);
  points_.clear();
  for (const auto& edge : rail) points_.push_back(edge.point);
  std::erase_if(observation.points, [side](const EdgePoint& point) { return point.side != side; });
  const double whole = static_cast<double>(observation.points.size()) / std::max(1, tried[side == Side::left ? 0 : 1]);
  const RailFit& one = fit(points_, observation.shape, true, kLoneSigmaM);
  if (whole < kLoneShare || !is_usual(one.shape) || outside_limits(one.shape) != nullptr ||
      clearness(rail, one.residuals_px) < kLeastClear) {
    observation.seen_left = observation.seen_right = false;
    observation.reason = "one rail is not to be seen, and the other alone is doubtful";
    return;
  }
  observation.shape = one.shape;
  observation.covariance = one.covariance;
  observation.condition = one.condition;
  observation.residual_px = one.residual_px;
}

bool TrackDetector::is_usual(const TrackShape& shape) const {
  return displacement(shape, usual_) < kLoneDisplacement ||
         (misses_ < kMoment && displacement(shape, last_) < kLoneDisplacement);
}

double TrackDetector::displacement(const TrackShape& shape, const ShapeVector& from) const {
  const ShapeVector apart = to_vector(shape) - from;
  const auto& limits = options_.limits;
  // However stiff the suspension is, over a switch the fit itself is no better than this.
  const double roll = apart(0) / std::max(limits.roll_rad, kLegRollRad);
  const double yaw = apart(2) / std::max(limits.yaw_rad, kLegYawRad);
  const double lateral = apart(3) / std::max(limits.lateral_m, kLegLateralM);
  return roll * roll + yaw * yaw + lateral * lateral;
}

void TrackDetector::choose_leg(const cv::Mat& grey, bool dark, TrackObservation& observation) {
  const auto branch = branch_search_.find(*top_view_, top_view_->ridges(dark), camera_, observation.shape,
                                          options_.gauge_m, options_.head_m);
  if (!branch) {
    usual_.head<5>() += kUsualWeight * (to_vector(observation.shape) - usual_).head<5>();
    return;
  }
  if (branch->from_m < near_m_ + kPartsNearM) {
    refine(grey, other_leg(observation.shape, *branch), dark, kSearchReachM, trial_);
    if (trial_.seen()) {
      const double margin = displacement(observation.shape, usual_) - displacement(trial_.shape, usual_);
      if (margin > 0) std::swap(observation, trial_);
      if (std::abs(margin) > kSureMargin) return;
    }
  }
  // The legs are one until they are a fraction of a head apart.
  const double common_m = branch->from_m + std::sqrt(2 * kStillOneM / std::abs(branch->bend_per_m));
  end_at(common_m, observation);
}

void TrackDetector::end_at(double far_m, TrackObservation& observation) {
  observation.branches = true;
  far_m = std::max(far_m, kShortestM + near_m_);
  if (far_m >= observation.far_m) return;
  const geometry::View view(camera_, observation.shape.camera);
  std::erase_if(observation.points, [&](const EdgePoint& point) {
    const auto ground = view.on_plane(point.pixel, 0);
    return !ground || ground->x() > far_m;
  });
  const RailFit& near = fit(observation.points, observation.shape, true);
  observation.shape = near.shape;
  observation.covariance = near.covariance;
  observation.condition = near.condition;
  observation.residual_px = near.residual_px;
  observation.far_m = far_m;
  observation.confidence *= kUnsureLeg;
}

void TrackDetector::forget(TrackObservation& observation) const {
  observation.shape = mount_;
  observation.covariance = to_vector(options_.limits).head<7>().cwiseAbs2().asDiagonal();
  observation.condition = std::numeric_limits<double>::infinity();
  observation.points.clear();
}

const char* TrackDetector::outside_limits(const TrackShape& shape) const {
  static constexpr const char* kReasons[] = {
      "the roll is outside the suspension limits",   "the pitch is outside the suspension limits",
      "the yaw is outside the suspension limits",    "the sideways position is outside the suspension limits",
      "the height is outside the suspension limits", "the curvature is outside the limits",
      "the vertical curvature is outside the limits"};
  const ShapeVector deviation = to_vector(shape) - to_vector(mount_);
  const ShapeVector sigma = to_vector(options_.limits);
  for (int k = 0; k < 7; ++k) {
    if (std::abs(deviation(k)) > 4 * sigma(k)) return kReasons[k];
  }
  return nullptr;
}

}  // namespace railfix::track_detector
