// Follows upright edges over the way that was run: the bearing of a thing beside the track grows as it comes nearer,
// and how it grows says where it stands and how far from the track.
#pragma once

#include <array>
#include <optional>
#include <vector>

#include "track_detector/upright_search.hpp"

namespace railfix::track_detector {

constexpr size_t kMostMeasurements = 48;

/// Where an edge was seen, and what the picture's pose was.
struct EdgeMeasurement {
  double way_m, bearing, curvature_per_m, eye_lateral_m;
};

/// An edge that went out of sight, on the scale of the way.
struct SettledEdge {
  double place_m = 0;
  double lateral_m = 0;  // of the track centre, left positive
  double sigma_m = 0;    // of place_m
  double lateral_sigma_m = 0;
  double inner_grey = 0;  // beside it towards the track, mean
  double outer_grey = 0;
  double deep_grey = 0;  // farther away towards the track, mean
  int pictures = 0;
  size_t count = 0;  // of the measurements that were kept
  std::array<EdgeMeasurement, kMostMeasurements> measured{};
};

class EdgeTracker {
 public:
  EdgeTracker();
  /// Edges of the picture at way_m; `widest` is the bearing at which edges leave the picture. Gives the edges that are
  /// settled now; valid until the next call.
  const std::vector<SettledEdge>& follow(const std::vector<UprightEdge>& found, const LandmarkPicture& picture,
                                         double way_m, double widest);
  void forget();

 private:
  // x/y, which falls by 1/y per metre of the way, in a Kalman filter.
  struct Track {
    double side = 1;  // +1 left
    double ratio = 0, inverse_m = 0;
    double p00 = 0, p01 = 0, p11 = 0;
    double way_m = 0;
    double inner_grey = 0, outer_grey = 0, deep_grey = 0;  // sums
    int sign = 1;                                          // of the contrast
    int seen = 0, missed = 0, gaps = 0;
    bool hit = false;
    size_t count = 0;
    std::array<EdgeMeasurement, kMostMeasurements> measured;
    [[nodiscard]] double bearing() const { return side / std::max(0.3, ratio); }
    [[nodiscard]] double ahead_m() const { return ratio / inverse_m; }
  };
  static void predict(Track& track, double way_m);
  static void update(Track& track, const UprightEdge& edge, const LandmarkPicture& picture);
  static void remember(Track& track, const EdgeMeasurement& measurement);
  [[nodiscard]] static double straightened(const Track& track, double bearing, const LandmarkPicture& picture);
  [[nodiscard]] static std::optional<SettledEdge> settle(const Track& track);

  std::vector<Track> tracks_;
  std::vector<uint8_t> used_;
  std::vector<SettledEdge> settled_;
};

}  // namespace railfix::track_detector
