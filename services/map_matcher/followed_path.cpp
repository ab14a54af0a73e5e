#include "map_matcher/followed_path.hpp"

#include <cmath>

#include "core/time.hpp"

namespace railfix::map_matcher {
namespace {

constexpr double kAheadM = 30000;
constexpr double kBehindM = 5000;
constexpr double kLeftM = 3000;  // the path is followed anew when less of it is left

}  // namespace

core::Result<FollowedPath::Way> FollowedPath::follow(const PlacedTrain& train) {
  if (path_) {
    const auto place_m = path_->distance_of(train.place, place_m_);
    const bool ends = place_m && path_->end_m() > 0.5 * kAheadM && path_->end_m() - *place_m < kLeftM;
    if (place_m && !ends) {
      place_m_ = *place_m;
      return Way::same;
    }
    // The same track the other way round is another trip.
    const bool other_track = !place_m && !path_->distance_of(train.place.edge, train.place.offset_m);
    auto way = other_track ? track::rerouted(*path_, *ways_, train.place, place_m_, kAheadM, kBehindM) : std::nullopt;
    if (way) {
      path_ = std::make_shared<const track::Path>(std::move(way->path));
      place_m_ = path_->distance_of(train.place, place_m_).value_or(place_m_);
      return Way::other_track;
    }
  }
  auto path = track::Path::follow(map_, train.place, kAheadM, kBehindM);
  if (!path.ok()) return path.error();
  path_ = std::make_shared<const track::Path>(std::move(path).value());
  place_m_ = 0;
  return Way::anew;
}

std::optional<Prior> FollowedPath::prior_at(int64_t stamp_ns, const PlacedTrain& train) const {
  if (!path_) return std::nullopt;
  const double dt_s = core::seconds(stamp_ns - train.stamp_ns);
  const auto place_m = path_->distance_of(train.place, place_m_);
  if (!place_m || std::abs(dt_s) > kOldStateS) return std::nullopt;
  const double way_m = std::isnan(train.speed_mps) ? 0.0 : train.speed_mps * dt_s;
  const Prior prior{*place_m + way_m, train.over_m, train.under_m, train.distance_m + way_m};
  return prior.usable() ? std::optional(prior) : std::nullopt;
}

}  // namespace railfix::map_matcher
