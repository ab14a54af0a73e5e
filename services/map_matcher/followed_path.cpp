#include "map_matcher/followed_path.hpp"

#include <cmath>

#include "core/time.hpp"

namespace railfix::map_matcher {
namespace {

constexpr double kAheadM = 30000;
constexpr double kBehindM = 5000;
constexpr double kLeftM = 3000;   // the path is followed on when less of it is left, ...
constexpr double kAgainM = 1000;  // ... and tried again so much further on where it could not be

}  // namespace

core::Result<FollowedPath::Way> FollowedPath::follow(const PlacedTrain& train) {
  if (path_) {
    const auto place_m = path_->distance_of(train.place, place_m_);
    if (place_m) {
      place_m_ = *place_m;
      return follow_on() ? Way::other_path : Way::same;
    }
    // The same track the other way round is another trip.
    const bool other_track = !path_->distance_of(train.place.edge, train.place.offset_m);
    auto way = other_track ? track::rerouted(*path_, *ways_, train.place, place_m_, kAheadM, kBehindM) : std::nullopt;
    if (way) {
      path_ = std::make_shared<const track::Path>(std::move(way->path));
      place_m_ = path_->distance_of(train.place, place_m_).value_or(place_m_);
      followed_on_at_m_.reset();
      return Way::other_path;
    }
  }
  auto path = track::Path::follow(map_, train.place, kAheadM, kBehindM);
  if (!path.ok()) return path.error();
  path_ = std::make_shared<const track::Path>(std::move(path).value());
  place_m_ = 0;
  followed_on_at_m_.reset();
  return Way::anew;
}

bool FollowedPath::follow_on() {
  const bool ends = path_->end_m() - place_m_ < kLeftM;
  const bool begins = place_m_ - path_->begin_m() < kLeftM;
  if (!ends && !begins) return false;
  if (followed_on_at_m_ && std::abs(place_m_ - *followed_on_at_m_) < kAgainM) return false;
  followed_on_at_m_ = place_m_;
  auto longer = track::followed_on(*path_, *ways_, place_m_, ends ? kAheadM : 0, begins ? kBehindM : 0);
  if (!longer) return false;
  path_ = std::make_shared<const track::Path>(std::move(*longer));
  return true;
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
