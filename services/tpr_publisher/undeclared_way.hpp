// The way of a train from the last place on a track that was declared: how it ran to and fro, and once the track is
// declared again, by which edges it came.
#pragma once

#include <optional>
#include <vector>

#include "track/ways.hpp"

namespace railfix::tpr_publisher {

/// Where a train turned round, in metres along from where it began. What lies inside a later, longer stretch is left
/// out: it changes nothing in which balise groups were passed last.
class Turns {
 public:
  void run(double step_m);
  [[nodiscard]] double way_m() const { return points_.back(); }
  /// The first is 0, the last is the place now.
  [[nodiscard]] const std::vector<double>& points() const { return points_; }

 private:
  std::vector<double> points_{0};
};

/// A way from one place to another; `to` has the distance 0.
struct WayBetween {
  track::Route route;
  double length_m = 0;  // signed: negative when it runs against the direction of the places
};

/// Ways of one train over different legs, about `way_m` long, differ by so much at most.
double legs_differ_m(double way_m);
/// All ways that lead there and are about `way_m` long, the one nearest to it first. Nothing when there are too many to
/// look at. REQUIRES: both edges are on the map.
std::optional<std::vector<WayBetween>> ways_between(const track::Map& map, const track::Ways& ways,
                                                    const track::EdgePosition& from, const track::EdgePosition& to,
                                                    double way_m);

/// The train may have come by any of the ways: their lengths differ by so much from this one at most.
double most_apart_m(const std::vector<WayBetween>& ways, double length_m);

/// Whether a train that runs on from a place, along its direction or against it, comes to that edge within `most_m`
/// whichever way it takes. False when there are too many to look at. REQUIRES: the edge is on the map.
bool every_way_leads_to(const track::Map& map, const track::Ways& ways, const track::EdgePosition& from, bool along,
                        uint32_t edge, double most_m);

}  // namespace railfix::tpr_publisher
