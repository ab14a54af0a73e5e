#include "track_detector/edge_tracker.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

namespace railfix::track_detector {
namespace {

constexpr size_t kMostLooks = 56;
constexpr double kLookM = 0.4;           // way between two looks
constexpr double kReachM = 26.0;         // way back
constexpr double kFirstBearing = 0.055;  // narrower ones tell nothing
constexpr double kWideShare = 0.62;      // of the widest bearing: from here an edge is looked for in the looks before
constexpr double kPatienceM = 1.3;       // an edge that was not seen on so much of the way has left
constexpr double kTolerance = 0.002;     // bearing, of the pose
constexpr float kFullScore = 5.0F;
constexpr double kLateralsM[] = {1.5, 14.0};
constexpr double kDepthStep = 0.003;  // bearing at kDepthBackM, between two depths that are tried
constexpr double kDepthBackM = 16.0;
constexpr size_t kFewestLooks = 5;
constexpr int kPasses = 6;               // the second half with the looks before it was sure, too
constexpr float kUsualEvidence = 0.35F;  // by chance
constexpr double kLeastSupport = 0.2;    // a look, over the usual
constexpr double kSureSupport = 0.65;
constexpr double kGate = 0.008;           // bearing, of a known edge in another look
constexpr double kBearingSigma = 0.0012;  // of one edge, yaw of the pose included
constexpr double kLeastSigma = 0.0008;    // what does not average out
constexpr double kBendSigma = 3e-4;       // 1/m, of the curvature that the way was followed with
constexpr double kCorrelated = 4.0;       // so many neighbouring measurements err together
constexpr double kWorstFit = 0.004;       // bearing
constexpr double kGrowth = 1.4;           // of the bearing while it was seen
constexpr float kLeastStep = 1.5F;        // grey levels
constexpr double kSameM = 0.35;

}  // namespace

EdgeTracker::EdgeTracker() : looks_(kMostLooks) {
  relatives_.reserve(kMostLooks);
  candidates_.reserve(200);
  settled_.reserve(200);
}

void EdgeTracker::forget() {
  count_ = 0;
  candidates_.clear();
}

const std::vector<SettledEdge>& EdgeTracker::follow(const std::vector<UprightEdge>& found,
                                                    const UprightProfile& profile, const LandmarkPicture& picture,
                                                    double way_m) {
  settled_.clear();
  advance(picture, way_m);
  if (count_ > 0 && std::abs(way_m - looks_[newest_].way_m) < kLookM) return settled_;
  remember(profile, picture);
  relate();
  for (const UprightEdge& edge : found) {
    if (std::abs(edge.bearing) > kWideShare * widest_) take(edge);
  }
  settle();
  return settled_;
}

// The track's own plan: heading from the curvature that the rails show at the train.
void EdgeTracker::advance(const LandmarkPicture& picture, double way_m) {
  const double step_m = way_m - way_m_;
  const double turn = 0.5 * (curvature_per_m_ + picture.curvature_per_m) * step_m;
  if (count_ > 0) {
    x_m_ += step_m * std::cos(heading_rad_ + 0.5 * turn);
    y_m_ += step_m * std::sin(heading_rad_ + 0.5 * turn);
    heading_rad_ += turn;
  }
  way_m_ = way_m;
  curvature_per_m_ = picture.curvature_per_m;
}

void EdgeTracker::remember(const UprightProfile& profile, const LandmarkPicture& picture) {
  newest_ = (newest_ + 1) % kMostLooks;
  count_ = std::min(count_ + 1, kMostLooks);
  cell_ = profile.cell;
  middle_ = profile.column(0);
  widest_ = profile.widest;
  Look& look = looks_[newest_];
  if (look.step.size() != profile.step.size()) {
    for (Look& any : looks_) {
      any.step.resize(profile.step.size());
      for (auto* rows : {&any.half_step, &any.evidence}) {
        for (auto& row : *rows) row.resize(profile.step.size());
      }
    }
  }
  look.way_m = way_m_;
  look.stamp_ns = picture.stamp_ns;
  look.x_m = x_m_ - picture.pose.lateral_m * std::sin(heading_rad_);
  look.y_m = y_m_ + picture.pose.lateral_m * std::cos(heading_rad_);
  look.heading_rad = heading_rad_;
  look.curvature_per_m = curvature_per_m_;
  look.eye_lateral_m = picture.pose.lateral_m;
  look.step = profile.step;
  look.half_step = profile.half_step;
  const int width = static_cast<int>(profile.score.size());
  const int reach = std::max(1, static_cast<int>(std::lround(0.6 * kTolerance / cell_)));
  for (const int sign : {-1, 1}) {
    auto& evidence = look.evidence[sign > 0 ? 1 : 0];
    evidence.assign(static_cast<size_t>(width), 0.0F);
    for (int c = reach; c < width - reach; ++c) {
      const float value = std::min(1.0F, static_cast<float>(sign) * profile.score[static_cast<size_t>(c)] / kFullScore);
      if (value <= 0) continue;
      for (int k = -reach; k <= reach; ++k) {
        const int beside = c + k;
        float& at = evidence[static_cast<size_t>(beside)];
        at = std::max(at, value);
      }
    }
  }
}

void EdgeTracker::relate() {
  relatives_.clear();
  const Look& now = looks_[newest_];
  const double cosine = std::cos(now.heading_rad);
  const double sine = std::sin(now.heading_rad);
  for (size_t i = 1; i < count_; ++i) {
    const Look& look = look_back(i);
    const double dx = look.x_m - now.x_m;
    const double dy = look.y_m - now.y_m;
    const double turn = look.heading_rad - now.heading_rad;
    if (std::abs(now.way_m - look.way_m) > kReachM) break;
    relatives_.push_back({&look, now.way_m - look.way_m, cosine * dx + sine * dy, -sine * dx + cosine * dy,
                          std::cos(turn), std::sin(turn)});
  }
}

// Of a place (metres ahead and left of the newest look's eye) in another look; `bend`: error of the curvature.
double EdgeTracker::bearing_of(const Relative& relative, double x_m, double y_m, double bend) const {
  const double dx = x_m - relative.x_m;
  const double dy = y_m - relative.y_m;
  const double ahead = relative.cosine * dx + relative.sine * dy;
  const double left = -relative.sine * dx + relative.cosine * dy;
  return left / std::max(0.5, ahead) + bend * relative.back_m;
}

// The place on the line of sight that was to be seen longest, and the one that was to be seen best over all.
std::array<EdgeTracker::Spot, 2> EdgeTracker::locate(double bearing, int sign) const {
  const double width = std::abs(bearing);
  const auto columns = static_cast<int>(looks_[newest_].step.size());
  const double nearest = middle_ + 0.5;  // column, cut off
  Spot longest;
  Spot best;
  double inverse_m = width / kLateralsM[1];
  while (inverse_m < width / kLateralsM[0]) {
    const double x_m = 1 / inverse_m;
    const double y_m = bearing * x_m;
    float sum = 0;
    size_t n = 0;
    for (const Relative& relative : relatives_) {
      const double at = bearing_of(relative, x_m, y_m, 0);
      if (std::abs(at) < kFirstBearing) break;
      const int column = static_cast<int>(at / cell_ + nearest);
      if (column < 0 || column >= columns) continue;
      sum += relative.look->evidence[sign > 0 ? 1 : 0][static_cast<size_t>(column)] - kUsualEvidence;
      if (++n < kFewestLooks || kGrowth * std::abs(at) > width || static_cast<double>(sum) < longest.support) continue;
      longest = {x_m, y_m, relative.back_m, static_cast<double>(sum), n};
    }
    const double mean = static_cast<double>(sum) / static_cast<double>(n + 1);
    if (n >= kFewestLooks && mean > best.support) best = {x_m, y_m, kReachM, mean, 1};
    const double spread = 1 + kDepthBackM * inverse_m;
    inverse_m += kDepthStep * spread * spread / (width * kDepthBackM);
  }
  return {best, longest};
}

// Sub-pixel place of the clearest step of that sign near a bearing.
std::optional<double> EdgeTracker::measure(const Relative& relative, double bearing, int sign) const {
  const auto& step = relative.look->step;
  const int gate = static_cast<int>(std::lround(kGate / cell_));
  const int centre = static_cast<int>(std::lround(bearing / cell_ + middle_));
  if (centre - gate < 1 || centre + gate + 1 >= static_cast<int>(step.size())) return std::nullopt;
  const auto at = [&](int c) { return static_cast<float>(sign) * step[static_cast<size_t>(c)]; };
  int best = -1;
  float most = 0;
  for (int c = centre - gate; c <= centre + gate; ++c) {
    if (at(c) < kLeastStep || at(c) < at(c - 1) || at(c) < at(c + 1)) continue;
    const float off = static_cast<float>(c - centre) / static_cast<float>(gate + 1);
    const float value = at(c) * (1 - off * off);
    if (value <= most) continue;
    most = value;
    best = c;
  }
  if (best < 0) return std::nullopt;
  const float bend = at(best - 1) - 2 * at(best) + at(best + 1);
  const double part =
      bend < 0 ? std::clamp(0.5 * static_cast<double>((at(best - 1) - at(best + 1)) / bend), -0.5, 0.5) : 0.0;
  return (best + part - middle_) * cell_;
}

/// One pass of the fit: its normal equations and what it has measured.
struct EdgeTracker::Pass {
  Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
  Eigen::Vector3d right = Eigen::Vector3d::Zero();
  double squared = 0;
  double weights = 0;
  size_t tried = 0;
  size_t kept = 0;
  double narrowest = 1;
  double widest = 0;
  [[nodiscard]] double rms() const { return std::sqrt(squared / weights); }
};

void EdgeTracker::add(const Relative& relative, const Fit& fit, Pass& pass, SettledEdge& edge) const {
  const auto& s = fit.state;
  const double model = bearing_of(relative, s(0), s(1), s(2));
  if (std::abs(model) < kFirstBearing || std::abs(model) > widest_) return;
  const bool sure = relative.back_m <= fit.sure_back_m;
  if (!sure && fit.only_sure) return;
  const auto measured = measure(relative, model, fit.sign);
  pass.tried += sure ? 1 : 0;
  if (!measured) return;
  const double residual = *measured - model;
  const Eigen::Vector3d slope((bearing_of(relative, s(0) + 0.01, s(1), s(2)) - model) / 0.01,
                              (bearing_of(relative, s(0), s(1) + 0.01, s(2)) - model) / 0.01, relative.back_m);
  const double weight = 1 / (1 + std::pow(residual / (2 * kBearingSigma), 2));
  pass.normal += weight * slope * slope.transpose();
  pass.right += weight * slope * residual;
  pass.squared += weight * residual * residual;
  pass.weights += weight;
  if (weight < 0.3 || edge.count == kMostMeasurements) return;
  pass.kept += sure ? 1 : 0;
  pass.narrowest = std::min(pass.narrowest, std::abs(*measured));
  pass.widest = std::max(pass.widest, std::abs(*measured));
  const Look& look = *relative.look;
  edge.measured[edge.count++] = {look.way_m, *measured, look.eye_lateral_m, residual, look.stamp_ns};
}

// Gauss-Newton with Cauchy weights over all looks: place, lateral offset and what the curvature was wrong by.
std::optional<SettledEdge> EdgeTracker::refine(Spot& spot, int sign) const {
  Fit fit{{spot.x_m, spot.y_m, 0}, spot.back_m, true, sign};
  SettledEdge edge;
  Pass pass;
  for (int i = 0; i < kPasses; ++i) {
    pass = {};
    pass.normal(2, 2) = std::pow(kBearingSigma / kBendSigma, 2);
    pass.right(2) = -pass.normal(2, 2) * fit.state(2);
    edge.count = 0;
    fit.only_sure = 2 * i < kPasses;
    for (size_t k = relatives_.size(); k-- > 0;) add(relatives_[k], fit, pass, edge);
    add(itself(looks_[newest_]), fit, pass, edge);
    if (pass.kept < kFewestLooks || 2 * pass.kept < pass.tried) return std::nullopt;
    const Eigen::Vector3d step = pass.normal.ldlt().solve(pass.right);
    fit.state(0) += std::clamp(step(0), -2.0, 2.0);
    fit.state(1) += std::clamp(step(1), -1.0, 1.0);
    fit.state(2) += step(2);
    spot.support = static_cast<double>(pass.kept) / static_cast<double>(pass.tried);
  }
  if (pass.rms() > kWorstFit || pass.widest < kGrowth * pass.narrowest || !(fit.state(0) > 1.0)) return std::nullopt;
  spot.x_m = fit.state(0);
  spot.y_m = fit.state(1);
  place(fit, pass, edge);
  return edge;
}

// On the way, and beside the track.
void EdgeTracker::place(const Fit& fit, const Pass& pass, SettledEdge& edge) const {
  const Look& now = looks_[newest_];
  const double sigma = std::max(pass.rms(), kLeastSigma);
  const Eigen::Matrix3d covariance = pass.normal.inverse() * (sigma * sigma * kCorrelated);
  const double left_m = fit.state(1) + now.eye_lateral_m;
  const double k = std::abs(now.curvature_per_m) < 1e-7 ? 1e-7 : now.curvature_per_m;
  edge.place_m = now.way_m + std::atan2(k * fit.state(0), 1 - k * left_m) / k;
  edge.lateral_m = left_m - 0.5 * k * fit.state(0) * fit.state(0);
  edge.sigma_m = std::sqrt(covariance(0, 0));
  edge.lateral_sigma_m = std::sqrt(covariance(1, 1));
  edge.pictures = static_cast<int>(edge.count);
  edge.cell = cell_;
  edge.curvature_per_m = now.curvature_per_m;
}

void EdgeTracker::take(const UprightEdge& found) {
  const Look& now = looks_[newest_];
  const int sign = (found.contrast() > 0) == (found.bearing > 0) ? 1 : -1;
  const double cosine = std::cos(now.heading_rad);
  const double sine = std::sin(now.heading_rad);
  const auto see = [&](Candidate& candidate) {
    candidate.hit_m = now.way_m;
    candidate.inner_grey += found.inner_grey;
    candidate.outer_grey += found.outer_grey;
    candidate.wall_grey += found.wall_grey;
    candidate.deep_grey += found.deep_grey;
    ++candidate.hits;
    if (candidate.stripe_count < kMostStripes)
      candidate.stripe[candidate.stripe_count++] = {now.way_m, found.bearing, found.outward, found.inward};
  };
  Candidate* known = nullptr;
  double nearest = kGate;
  for (Candidate& candidate : candidates_) {
    const double dx = candidate.x_m - now.x_m;
    const double dy = candidate.y_m - now.y_m;
    const double ahead = cosine * dx + sine * dy;
    const double off = std::abs((-sine * dx + cosine * dy) / std::max(0.5, ahead) - found.bearing);
    if (candidate.sign != sign || off > nearest) continue;
    nearest = off;
    known = &candidate;
  }
  if (known != nullptr && known->support > kSureSupport && known->hits % 2 == 1) return see(*known);
  // Of both places the one that fits more looks.
  Spot spot;
  std::optional<SettledEdge> edge;
  for (Spot& tried : locate(found.bearing, sign)) {
    if (tried.looks == 0 || tried.support < kLeastSupport * static_cast<double>(tried.looks)) continue;
    const auto refined = refine(tried, sign);
    if (!refined || (edge && refined->count <= edge->count)) continue;
    edge = refined;
    spot = tried;
  }
  if (!edge) return;
  Candidate* same = nullptr;
  for (Candidate& candidate : candidates_) {
    if (candidate.sign == sign && std::abs(candidate.edge.place_m - edge->place_m) < kSameM + edge->sigma_m &&
        std::abs(candidate.edge.lateral_m - edge->lateral_m) < kSameM)
      same = &candidate;
  }
  if (same == nullptr) {
    candidates_.emplace_back();
    same = &candidates_.back();
    same->sign = sign;
  }
  same->x_m = now.x_m + cosine * spot.x_m - sine * spot.y_m;
  same->y_m = now.y_m + sine * spot.x_m + cosine * spot.y_m;
  same->support = spot.support;
  same->edge = *edge;
  see(*same);
}

void EdgeTracker::settle() {
  for (Candidate& candidate : candidates_) {
    if (way_m_ - candidate.hit_m < kPatienceM) continue;
    SettledEdge edge = candidate.edge;
    edge.inner_grey = candidate.inner_grey / candidate.hits;
    edge.outer_grey = candidate.outer_grey / candidate.hits;
    edge.wall_grey = candidate.wall_grey / candidate.hits;
    edge.deep_grey = candidate.deep_grey / candidate.hits;
    edge.stripe = candidate.stripe;
    edge.stripe_count = candidate.stripe_count;
    settled_.push_back(edge);
  }
  // Those that a train backs away from are seen anew when it comes again.
  std::erase_if(candidates_,
                [this](const Candidate& candidate) { return std::abs(way_m_ - candidate.hit_m) >= kPatienceM; });
}

}  // namespace railfix::track_detector
