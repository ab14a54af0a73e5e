// What upright edges belong to: two close ones are a mast, one on each side of the track a portal or a bridge.
#pragma once

#include <array>
#include <optional>
#include <vector>

#include "track_detector/edge_tracker.hpp"
#include "track_detector/ground_shade.hpp"
#include "track_detector/mast_fit.hpp"

namespace railfix::track_detector {

struct UprightObject {
  LandmarkType type = LandmarkType::mast;
  double place_m = 0;  // on the scale of the way
  double lateral_m = 0;
  double sigma_m = 0;
  int pictures = 0;
  double outer_grey = 0;               // of a portal
  std::array<double, 2> wall_m{0, 0};  // right and left
  /// When it was measured last, nearest to the train, and how far ahead it was then.
  int64_t seen_ns = 0;
  double seen_ahead_m = 0;
  void seen_at(const LookAt& look) {
    seen_ns = look.stamp_ns;
    seen_ahead_m = place_m - look.way_m;
  }
};

class UprightObjects {
 public:
  UprightObjects();
  /// Edges that were settled in the picture at way_m, who followed them, the ground so far, and how bright it is beside
  /// the track there.
  /// Gives what is certain now; valid until the next call.
  const std::vector<UprightObject>& add(const std::vector<SettledEdge>& edges, const EdgeTracker& tracker,
                                        const GroundShade& shade, double way_m, double beside_grey);
  /// How far the train has run is not known any more; that it is in a tunnel is kept until there is daylight.
  void forget();
  /// Behind a portal in that daylight led to, and since then neither a portal out nor daylight for long.
  [[nodiscard]] bool in_tunnel(double way_m) const;
  /// Without daylight, between walls in the headlamp's light: perhaps a tunnel.
  [[nodiscard]] bool lit_walls() const;

 private:
  // What finding sides and finding a tunnel's end have in common.
  static constexpr double kSidesM = 1.3;      // both sides stand at one place
  static constexpr double kDarkShare = 0.93;  // of the outer brightness
  static constexpr double kSameWallM = 0.3;
  static constexpr double kOneSideSigmaM = 0.2;
  static constexpr double kOutShare = 0.7;  // of the daylight before the tunnel
  static constexpr double kHoldM = 1.0;

  struct Edge {
    SettledEdge edge;
    double way_m = 0;  // when it was settled
    bool used = false;
  };
  void look_at_light(double beside_grey, double way_m);
  [[nodiscard]] bool daylight() const;
  void pair_masts();
  void find_stripes(double way_m);
  void tell_mast(const SettledEdge& inner, const MastPlace& at);
  void pair_sides(const GroundShade& shade, double way_m);
  [[nodiscard]] bool roofed(const GroundShade& shade, double place_m);
  [[nodiscard]] static UprightObject between_sides(const SettledEdge& left, const SettledEdge& right);
  [[nodiscard]] bool belongs_to_mast(const SettledEdge& edge) const;
  void move_to_mouth(UprightObject& portal, const SettledEdge& left, const SettledEdge& right) const;
  void follow_wall(const SettledEdge& edge);
  void look_for_exit(const SettledEdge& edge);
  void release(double way_m);
  void release_exit(const EdgeTracker& tracker, double way_m, double beside_grey);
  [[nodiscard]] double beyond_m(const EdgeTracker& tracker, double place_m) const;
  [[nodiscard]] double exit_hold_m(const EdgeTracker& tracker) const;
  [[nodiscard]] double mean_of_walls_m(double right_m, double left_m) const;
  [[nodiscard]] size_t near_wall() const;
  [[nodiscard]] bool walls_alike() const;
  struct End {
    double place_m = 0, sigma_m = 0;
  };
  [[nodiscard]] End end_of_both(const std::array<WallSteps, 2>& steps) const;
  [[nodiscard]] std::optional<End> end_of_walls(const EdgeTracker& tracker, double place_m) const;
  void hold(const UprightObject& object);

  struct Tunnel {
    double since_m = -1e9;               // the portal in that no portal out has followed yet
    double daylight_grey = 0;            // beside it
    std::array<double, 2> wall_m{0, 0};  // right and left, where the last edges on them stood
    std::array<double, 2> wall_sigma_m{0, 0};
    bool left_unseen = false;  // perhaps: nothing was seen for a while, and not yet again that it is dark
  };
  struct Light {
    bool known = false;
    double way_m = 0;
    double usual_grey = 0, near_grey = 0;  // beside the track, over a long and a short way; usual: outside tunnels
    double tunnel_like_m = 0;              // way where it was last darker than before the tunnel
  };
  struct Exit {
    double place_m = -1e9, sigma_m = 0;
    int pictures = 0;
    bool burnt_out = false;  // what is behind it
  };
  std::vector<Edge> edges_;             // not yet forgotten
  std::vector<UprightObject> held_;     // told when nothing better can follow
  std::vector<UprightObject> objects_;  // told now
  std::vector<UprightObject> masts_;    // told, not yet forgotten
  double last_bridge_m_ = -1e9;
  double open_above_m_ = -1e9;  // the last place between walls that had no roof
  Tunnel tunnel_;
  Light light_;
  std::array<Exit, 2> exits_;  // seen so far, right and left
};

}  // namespace railfix::track_detector
