#include "map_matcher/locate/gnss_origins.hpp"

#include <cmath>

#include "core/units.hpp"

namespace railfix::map_matcher {
namespace {

// From one origin to the next and to the next bin, and the body behind the foot.
constexpr double kFurtherM = PlaceFilter::kOriginsM + 2 * kBinM + 20;

}  // namespace

std::vector<PlaceFilter::Origin> origins_near(const NetworkIndex& index, const GnssReach& reach, double moved_m,
                                              bool ahead) {
  const double radius_m = reach.along_m + std::abs(reach.antenna_ahead_m) + std::abs(moved_m) + kFurtherM;
  std::vector<PlaceFilter::Origin> origins;
  for (const auto& near : index.near(reach.easting_m, reach.northing_m, radius_m)) {
    for (const bool forward : {true, false}) {
      const uint32_t run = index.number({index.map().edge(near.edge), forward});
      // All along the edge: it may come by again.
      for (const float into_m : PlaceFilter::origins_on(index, run)) {
        const auto pose = index.run(run).pose_at(into_m);
        const double turned_rad = core::wrap_pi(pose.heading_rad + (ahead ? 0 : core::kPi) - reach.heading_rad);
        const double apart_m = std::hypot(pose.easting_m - reach.easting_m, pose.northing_m - reach.northing_m);
        if (apart_m < radius_m && std::abs(turned_rad) < GnssReach::kCrossesRad) origins.push_back({run, into_m});
      }
    }
  }
  return origins;
}

}  // namespace railfix::map_matcher
