#include "map_matcher/locate/place_search.hpp"

#include <cmath>

namespace railfix::map_matcher {

void PlaceSearch::follow(bool track_known, bool usable) {
  if (!track_known && stage_ != Stage::unknown) of_gnss_ = false;
  stage_ = !track_known ? Stage::unknown : usable ? Stage::known : Stage::no_position;
  if (stage_ == Stage::known) locator_.reset();
  if (track_known) gnss_.reset();
}

std::vector<LocatedPlace> PlaceSearch::move(const std::optional<Turn>& turn) {
  if (stage_ == Stage::known) return {};
  if (!locator_) {
    locator_.emplace(parameters_.locator, index());
    since_search_m_ = 0;
  }
  if (!turn) {
    locator_->forget();
    return {};
  }
  if (std::abs(turn->way_m) > kLeastWayM) {
    locator_->move(turn->way_m, turn->turn_rad, turn->sigma_rad);
    since_search_m_ += std::abs(turn->way_m);
  }
  if (!searches()) return {};
  if (since_search_m_ < parameters_.every_m) {
    locator_->prepare();
    return {};
  }
  since_search_m_ = 0;
  auto location = locator_->locate();
  if (!location.certain()) return {};
  of_gnss_ = false;
  return std::move(location.places);
}

void PlaceSearch::sight(const Sighting& sighting) {
  if (locator_) locator_->sight(sighting);
}

std::optional<LocatedPlace> PlaceSearch::hear(const GnssPosition& position, double odometer_m, double speed_mps) {
  if (!searches()) return std::nullopt;
  if (!gnss_) gnss_.emplace(parameters_.gnss, index());
  if (!gnss_->add(position, odometer_m, speed_mps)) return std::nullopt;
  const auto found = gnss_->place();
  if (!found) return std::nullopt;
  of_gnss_ = true;
  return LocatedPlace{found->place, parameters_.locator.certain, found->sigma_m};
}

void PlaceSearch::forget() {
  stage_ = Stage::known;
  locator_.reset();
  gnss_.reset();
  of_gnss_ = false;
  since_search_m_ = 0;
}

const std::shared_ptr<const NetworkIndex>& PlaceSearch::index() {
  if (!index_) index_ = std::make_shared<const NetworkIndex>(map_);
  return index_;
}

}  // namespace railfix::map_matcher
