#include "fusion/turned_way.hpp"

#include <algorithm>
#include <cmath>

#include "core/units.hpp"

namespace railfix::fusion {
namespace {

constexpr double kJumpM = 3.0;
constexpr double kJumpShare = 0.1;        // of a piece: the speed changes in it
constexpr double kMapTurnShare = 0.1;     // a map has its curves so wrong, ...
constexpr double kMapHeadingRad = 0.005;  // ... and every heading
constexpr double kBogiesM = 20.0;         // the rear one is up to so far behind the camera's foot
constexpr double kBogiesStepM = 5.0;

}  // namespace

void TurnedWay::add(Piece piece) {
  const double jump_m = kJumpM + kJumpShare * std::abs(piece.to_m - piece.from_m);
  if (!pieces_.empty()) {
    if (std::abs(piece.from_m - pieces_.back().to_m) < jump_m) {
      piece.from_m = pieces_.back().to_m;
    } else {
      pieces_.clear();
    }
  }
  if (pieces_.size() == kMost) pieces_.erase(pieces_.begin());
  pieces_.push_back(piece);
}

double TurnedWay::strays(const track::Path& path, const Errors& errors) const {
  double least = INFINITY;
  for (double behind_m = 0; behind_m <= kBogiesM; behind_m += kBogiesStepM)
    least = std::min(least, strays_of_body(path, errors, behind_m));
  return least;
}

double TurnedWay::strays_of_body(const track::Path& path, const Errors& errors, double behind_m) const {
  struct Sum {
    double off_rad = 0, variance = 0, bend_rad = 0, time_s = 0, curvature_per_m = 0;
  };
  if (pieces_.empty()) return 0;
  track::TrackPoint begin = path.at(pieces_.front().from_m - behind_m);
  std::vector<Sum> sums{{.curvature_per_m = begin.curvature_per_m}};
  double most = 0;
  for (const Piece& piece : pieces_) {
    const track::TrackPoint end = path.at(piece.to_m - behind_m);
    // Headings grow to the right.
    const double bend_rad = core::wrap_pi(begin.pose.heading_rad - end.pose.heading_rad);
    begin = end;
    const Sum& before = sums.back();
    const Sum sum{before.off_rad + piece.turn_rad - bend_rad, before.variance + piece.sigma_rad * piece.sigma_rad,
                  before.bend_rad + std::abs(bend_rad), before.time_s + piece.time_s, end.curvature_per_m};
    for (const Sum& from : sums) {
      const double gyro_rad =
          std::hypot(std::sqrt(sum.variance - from.variance), errors.bias_rps * (sum.time_s - from.time_s));
      const double map_rad = std::hypot(kMapHeadingRad, kMapTurnShare * (sum.bend_rad - from.bend_rad));
      const double place_rad = errors.place_m * (sum.curvature_per_m - from.curvature_per_m);
      most = std::max(most, std::abs(sum.off_rad - from.off_rad) / std::hypot(gyro_rad, map_rad, place_rad));
    }
    sums.push_back(sum);
  }
  return most;
}

}  // namespace railfix::fusion
