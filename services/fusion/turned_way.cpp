#include "fusion/turned_way.hpp"

#include <algorithm>
#include <cmath>

#include "core/units.hpp"

namespace railfix::fusion {
namespace {

constexpr double kPieceM = 10.0;          // slower seconds are one piece: points are some 100 m long, at any speed
constexpr double kStandingPieceM = 20.0;  // what seems to move belongs to the last one, unless it creeps on and on
constexpr double kStandsMps = 0.5;        // a train that stands seems to move so fast, either way
constexpr double kFelt = 2.0;             // sigmas: a gyro that feels less has met no bump
constexpr double kJumpM = 3.0;
constexpr double kJumpShare = 0.1;        // of a piece: the speed changes in it
constexpr double kMapTurnShare = 0.15;    // a map has its curves so wrong, ...
constexpr double kMapHeadingRad = 0.005;  // ... every heading ...
constexpr double kMapPlaceM = 1.5;        // ... and every place, ...
constexpr double kPointsM = 10.0;         // ... but points, which may be drawn, so much
constexpr double kBogiesM = 20.0;         // the rear one is up to so far behind the camera's foot
constexpr double kShiftStepM = 5.0;

}  // namespace

void TurnedWay::add(Piece piece) {
  const double way_m = piece.to_m - piece.from_m;
  if (!pieces_.empty()) {
    const Piece& last = pieces_.back();
    const bool near = std::abs(piece.from_m - last.to_m) < kJumpM + kJumpShare * std::abs(way_m);
    const double last_m = last.to_m - last.from_m;
    const bool backs = way_m * last_m <= 0;
    const bool stands = std::abs(way_m) < kStandsMps * piece.time_s && (piece.to_m - last.from_m) * last_m > 0;
    if (!near || (backs && !stands)) {
      pieces_.clear();
    } else if (backs || std::abs(last_m) < (stands ? kStandingPieceM : kPieceM)) {
      piece = {last.from_m, piece.to_m, last.turn_rad + piece.turn_rad, std::hypot(last.sigma_rad, piece.sigma_rad),
               last.time_s + piece.time_s};
      pieces_.pop_back();
    } else {
      piece.from_m = last.to_m;
    }
  }
  if (pieces_.size() == kMost) pieces_.erase(pieces_.begin());
  pieces_.push_back(piece);
}

void TurnedWay::corrected(double by_m) {
  if (std::abs(by_m) > kJumpM) clear();
}

bool TurnedWay::holds(double distance_m) const {
  return !pieces_.empty() && (pieces_.front().from_m - distance_m) * (pieces_.back().to_m - distance_m) <= 0;
}

TurnedWay::Misfit TurnedWay::misfit(const track::Path& path, const Errors& errors) const {
  Misfit least{INFINITY, INFINITY};
  for (double behind_m = -kPointsM; behind_m <= kBogiesM + kPointsM; behind_m += kShiftStepM) {
    const Misfit shifted = misfit_shifted(path, errors, behind_m);
    if (shifted.most < least.most) least = shifted;
  }
  return least;
}

TurnedWay::Misfit TurnedWay::misfit_shifted(const track::Path& path, const Errors& errors, double behind_m) const {
  struct Sum {
    double off_rad = 0, variance = 0, bend_rad = 0, time_s = 0, curvature_per_m = 0;
    double bump_rad = 0;  // what the last piece alone may have brought
  };
  if (pieces_.empty()) return {};
  track::TrackPoint begin = path.at(pieces_.front().from_m - behind_m);
  std::vector<Sum> sums{{.curvature_per_m = begin.curvature_per_m}};
  Misfit misfit;
  for (const Piece& piece : pieces_) {
    const track::TrackPoint end = path.at(piece.to_m - behind_m);
    // Headings grow to the right.
    const double bend_rad = core::wrap_pi(begin.pose.heading_rad - end.pose.heading_rad);
    begin = end;
    const Sum& before = sums.back();
    const double piece_off_rad = piece.turn_rad - bend_rad;
    const bool felt = std::abs(piece.turn_rad) > kFelt * std::hypot(piece.sigma_rad, errors.bias_rps * piece.time_s);
    const Sum sum{before.off_rad + piece_off_rad,
                  before.variance + piece.sigma_rad * piece.sigma_rad,
                  before.bend_rad + std::abs(bend_rad),
                  before.time_s + piece.time_s,
                  end.curvature_per_m,
                  felt ? std::abs(piece_off_rad) : 0};
    sums.push_back(sum);
    double worst_rad = 0;
    for (size_t i = sums.size() - 1; i-- > 0;) {
      const Sum& from = sums[i];
      const double off_rad = sum.off_rad - from.off_rad;
      worst_rad = std::max(worst_rad, sums[i + 1].bump_rad);
      const double gyro_rad =
          std::hypot(std::sqrt(sum.variance - from.variance), errors.bias_rps * (sum.time_s - from.time_s));
      const double map_rad = std::hypot(kMapHeadingRad, kMapTurnShare * (sum.bend_rad - from.bend_rad));
      const double place_rad = std::hypot(errors.place_m, kMapPlaceM) * (sum.curvature_per_m - from.curvature_per_m);
      const double sigma_rad = std::hypot(gyro_rad, map_rad, place_rad);
      if (std::abs(off_rad) <= misfit.most * sigma_rad) continue;
      misfit = {std::abs(off_rad) / sigma_rad, std::max(0.0, std::abs(off_rad) - worst_rad) / sigma_rad};
    }
  }
  return misfit;
}

}  // namespace railfix::fusion
