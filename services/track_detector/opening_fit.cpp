#include "track_detector/opening_fit.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <span>

namespace railfix::track_detector {
namespace {

constexpr size_t kFewestTogether = 8;   // looks that show both sides
constexpr double kGrowth = 1.4;         // of how far apart they show
constexpr double kApartSigma = 3e-4;    // bearing
constexpr double kWaySigmaM = 0.015;    // of the way to one look: the pitch of the pose
constexpr double kOutlierSigmas = 3.0;  // of the scatter is another edge
constexpr double kWorstFit = 4.0;       // sigmas: what is worse are two things
constexpr size_t kMostStrayed = 4;      // looks in a row that do not fit: the sides are lost
constexpr double kCorrelated = 4.0;     // so many neighbouring looks err together
constexpr double kNoTurn = 1e-6;        // rad

struct Look {
  LookAt at;
  double apart = 0;  // bearing
};

/// That show both sides.
struct Looks {
  std::array<Look, kMostMeasurements> of{};
  size_t count = 0;
  [[nodiscard]] std::span<const Look> all() const { return {of.data(), count}; }
};

Looks looks_at_both(const SettledEdge& left, const SettledEdge& right) {
  Looks looks;
  together(left, right, [&looks](const EdgeMeasurement& one, const EdgeMeasurement& other) {
    looks.of[looks.count++] = {{one.way_m, one.stamp_ns}, one.bearing - other.bearing};
  });
  return looks;
}

// way = place - width * narrow, where narrow = turn / sin(turn) / apart on straight track, with turn = curvature * the
// way that is left. In a curve the place is on the train's own track, and the inner side of the curve is nearer.
class ApartFit {
 public:
  ApartFit(const SettledEdge& left, const SettledEdge& right)
      : place_m_(0.5 * (left.place_m + right.place_m)),
        width_m_(left.lateral_m - right.lateral_m),
        curvature_per_m_(0.5 * (left.curvature_per_m + right.curvature_per_m)),
        nearer_(1 + curvature_per_m_ * (left.lateral_m + right.lateral_m)) {}

  void solve(std::span<const Look> looks) {
    Eigen::Matrix2d normal = Eigen::Matrix2d::Zero();
    Eigen::Vector2d right = Eigen::Vector2d::Zero();
    for (const Look& look : looks) {
      const Eigen::Vector2d row(1, -narrow(look));
      const double weight = 1 / std::pow(sigma_m(look), 2);
      normal += weight * row * row.transpose();
      right += weight * row * (look.at.way_m - place_m_);
    }
    covariance_ = normal.inverse();
    fitted_ = covariance_ * right;
    double squared = 0;
    for (const Look& look : looks) squared += std::pow(off(look), 2);
    rms_ = std::sqrt(squared / static_cast<double>(looks.size()));
  }
  /// In sigmas.
  [[nodiscard]] double off(const Look& look) const {
    return (look.at.way_m - place_m_ - fitted_(0) + fitted_(1) * narrow(look)) / sigma_m(look);
  }
  [[nodiscard]] double rms() const { return rms_; }
  [[nodiscard]] bool nearing() const { return fitted_(1) > 0; }
  [[nodiscard]] Opening opening(const Look& last) const {
    const double scatter = std::max(1.0, rms_) * std::sqrt(kCorrelated);
    const double width_sigma_m = scatter * std::sqrt(covariance_(1, 1));
    return {place_m_ + fitted_(0),
            fitted_(1),
            width_sigma_m,
            last.at,
            fitted_(1) * narrow(last),
            std::hypot(width_sigma_m * narrow(last), apart_sigma_m(last))};
  }

 private:
  [[nodiscard]] double narrow(const Look& look) const {
    const double turn = curvature_per_m_ * (place_m_ - look.at.way_m);
    return (std::abs(turn) < kNoTurn ? 1.0 : turn / std::sin(turn)) * nearer_ / look.apart;
  }
  [[nodiscard]] double apart_sigma_m(const Look& look) const {
    return kApartSigma * width_m_ / (look.apart * look.apart);
  }
  [[nodiscard]] double sigma_m(const Look& look) const { return std::hypot(kWaySigmaM, apart_sigma_m(look)); }

  double place_m_, width_m_;  // about
  double curvature_per_m_;
  double nearer_;
  Eigen::Matrix2d covariance_ = Eigen::Matrix2d::Zero();
  Eigen::Vector2d fitted_ = Eigen::Vector2d::Zero();  // place beyond that, and width
  double rms_ = 0;
};

}  // namespace

// From near to far, and no farther than both sides are followed: what shows close beside one of them far away (a board,
// the next panel) runs together with it and moves it.
std::optional<Opening> opening_between(const SettledEdge& left, const SettledEdge& right) {
  const Looks all = looks_at_both(left, right);
  if (all.count < kFewestTogether) return std::nullopt;
  ApartFit fit(left, right);
  Looks good;
  size_t strayed = 0;
  for (size_t i = all.count; i-- > 0 && strayed < kMostStrayed;) {
    const Look& look = all.of[i];
    const bool first = good.count < kFewestTogether;
    if (!first && std::abs(fit.off(look)) > kOutlierSigmas * std::max(fit.rms(), 1.0)) {
      ++strayed;
      continue;
    }
    strayed = 0;
    good.of[good.count++] = look;
    if (good.count >= kFewestTogether) fit.solve(good.all());
  }
  const Look& last = good.of[0];
  if (last.apart < kGrowth * good.all().back().apart || fit.rms() > kWorstFit || !fit.nearing()) return std::nullopt;
  return fit.opening(last);
}

}  // namespace railfix::track_detector
