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
  struct Sum {
    double off_rad = 0, variance = 0, bend_rad = 0, time_s = 0, curvature_per_m = 0;
  };
  if (pieces_.empty()) return 0;
  std::vector<Sum> sums{{.curvature_per_m = path.curvature_at(pieces_.front().from_m)}};
  double most = 0;
  for (const Piece& piece : pieces_) {
    const auto end = path.at(piece.to_m);
    // Headings grow to the right.
    const double bend_rad = core::wrap_pi(path.at(piece.from_m).pose.heading_rad - end.pose.heading_rad);
    const Sum& before = sums.back();
    const Sum sum{before.off_rad + piece.turn_rad - bend_rad, before.variance + piece.sigma_rad * piece.sigma_rad,
                  before.bend_rad + std::abs(bend_rad), before.time_s + piece.time_s, end.curvature_per_m};
    for (const Sum& from : sums) {
      const double sigma_rad = std::hypot(std::hypot(std::sqrt(sum.variance - from.variance), kMapHeadingRad),
                                          kMapTurnShare * (sum.bend_rad - from.bend_rad),
                                          std::hypot(errors.bias_rps * (sum.time_s - from.time_s),
                                                     errors.place_m * (sum.curvature_per_m - from.curvature_per_m)));
      most = std::max(most, std::abs(sum.off_rad - from.off_rad) / sigma_rad);
    }
    sums.push_back(sum);
  }
  return most;
}

}  // namespace railfix::fusion
