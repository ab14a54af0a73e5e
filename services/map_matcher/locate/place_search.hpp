// The search for a place that nobody knows: by the way that the track bent and the landmarks on it, and by GNSS, which
// is quicker where one track alone is within its reach.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "map_matcher/locate/gnss_search.hpp"
#include "map_matcher/locate/network_locator.hpp"

namespace railfix::map_matcher {

struct PlaceSearchParameters {
  LocatorParameters locator;
  GnssSearchParameters gnss;
  double every_m = 250.0;  // a place is asked for once in this way
};

class PlaceSearch {
 public:
  PlaceSearch(const PlaceSearchParameters& parameters, std::shared_ptr<const track::Map> map)
      : parameters_(parameters), map_(std::move(map)) {}

  /// Fusion's last word; before the first one nothing is searched for. A place that is no position may soon be given
  /// up: the way is measured already, and searched for then.
  void follow(bool track_known, bool usable);
  /// The train has moved on; without a turn nobody knows how. The places, best first, when it is certain where the
  /// train is.
  [[nodiscard]] std::vector<LocatedPlace> move(const std::optional<Turn>& turn);
  void sight(const Sighting& sighting);
  /// odometer_m, speed_mps: as for GnssSearch.
  [[nodiscard]] std::optional<LocatedPlace> hear(const GnssPosition& position, double odometer_m, double speed_mps);
  /// Nobody knows the place.
  [[nodiscard]] bool searches() const { return stage_ == Stage::unknown; }
  /// GNSS has told the place that is known.
  [[nodiscard]] bool of_gnss() const { return of_gnss_; }
  /// So many tracks are where GNSS says the train is, as far as that is known.
  [[nodiscard]] std::optional<size_t> tracks() const { return gnss_ ? gnss_->tracks() : std::nullopt; }
  void forget();

 private:
  enum class Stage : uint8_t { known, no_position, unknown };
  const std::shared_ptr<const NetworkIndex>& index();

  PlaceSearchParameters parameters_;
  std::shared_ptr<const track::Map> map_;
  std::shared_ptr<const NetworkIndex> index_;  // from when it is first needed on
  Stage stage_ = Stage::known;
  std::optional<NetworkLocator> locator_;
  std::optional<GnssSearch> gnss_;
  bool of_gnss_ = false;
  double since_search_m_ = 0;  // way
};

}  // namespace railfix::map_matcher
