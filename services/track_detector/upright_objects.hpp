// What upright edges belong to: two close ones are a mast, one on each side of the track a portal or a bridge.
#pragma once

#include <vector>

#include "track_detector/edge_tracker.hpp"

namespace railfix::track_detector {

struct UprightObject {
  LandmarkType type = LandmarkType::mast;
  double place_m = 0;  // on the scale of the way
  double lateral_m = 0;
  double sigma_m = 0;
  int pictures = 0;
  double outer_grey = 0;  // of a portal
};

class UprightObjects {
 public:
  UprightObjects();
  /// Edges that were settled in the picture at way_m. Gives what is certain now; valid until the next call.
  const std::vector<UprightObject>& add(const std::vector<SettledEdge>& edges, double way_m);
  void forget();
  /// Behind a portal in, and no portal out since.
  [[nodiscard]] bool in_tunnel(double way_m) const;

 private:
  struct Edge {
    SettledEdge edge;
    bool used = false;
  };
  void pair_masts();
  void tell_mast(const SettledEdge& a, const SettledEdge& b);
  void pair_sides();
  void move_to_mouth(UprightObject& portal, const SettledEdge& left, const SettledEdge& right) const;
  void release(double way_m);
  void hold(const UprightObject& object);

  std::vector<Edge> edges_;             // not yet forgotten
  std::vector<UprightObject> held_;     // told when nothing better can follow
  std::vector<UprightObject> objects_;  // told now
  double last_mast_m_ = -1e9;
  double last_mast_lateral_m_ = 0;
  double last_bridge_m_ = -1e9;
  double inside_since_m_ = -1e9;  // the portal in that no portal out has followed yet
  double daylight_grey_ = 0;      // beside that portal
};

}  // namespace railfix::track_detector
