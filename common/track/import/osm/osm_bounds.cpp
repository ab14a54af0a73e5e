#include "track/import/osm/osm_bounds.hpp"

#include "track/import/swapped.hpp"
#include "track/import/told.hpp"

namespace railfix::track {
namespace {

bool holds(const OsmBounds& bounds, const GeoPoint& place) {
  const auto between = [](double low, double value, double high) { return low <= value && value <= high; };
  return between(bounds.south_west.lat_deg, place.lat_deg, bounds.north_east.lat_deg) &&
         between(bounds.south_west.lon_deg, place.lon_deg, bounds.north_east.lon_deg);
}

std::string told_range(double from_deg, double to_deg) {
  return told_number(from_deg, 4) + " to " + told_number(to_deg, 4);
}

}  // namespace

void tell_contradiction(const OsmBounds& declared, OsmData& data) {
  size_t count = 0;
  size_t within = 0;
  size_t swapped_within = 0;
  for (const OsmWay& way : data.ways) {
    for (const int64_t id : way.nodes) {
      const auto node = data.nodes.find(id);
      if (node == data.nodes.end()) continue;
      ++count;
      if (holds(declared, node->second.place)) ++within;
      if (holds(declared, swapped(node->second.place))) ++swapped_within;
    }
  }
  const bool would_fit = swapped_within > within && 2 * swapped_within > count;
  if (count == 0 || (within > 0 && !would_fit)) return;
  const GeoPoint& low = declared.south_west;
  const GeoPoint& high = declared.north_east;
  data.problems.push_back("the file declares bounds of latitude " + told_range(low.lat_deg, high.lat_deg) +
                          ", longitude " + told_range(low.lon_deg, high.lon_deg) + ", and " + std::to_string(within) +
                          " of the " + std::to_string(count) + " points of its tracks " +
                          (within == 1 ? "lies" : "lie") + " within" +
                          (would_fit ? std::string("; the other way round they would: ") + kMayBeSwapped
                                     : ": the bounds or the coordinates are wrong"));
}

}  // namespace railfix::track
