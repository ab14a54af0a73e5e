// The line as the page draws it, and what the map says lies before the train. Knows no DDS.
#pragma once

#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "track/map.hpp"
#include "track/ways.hpp"

namespace railfix::monitor {

/// A landmark as it is met on the straight way ahead.
struct LandmarkAhead {
  track::LandmarkKind kind = track::LandmarkKind::unknown;
  std::string name;
  double ahead_m = 0;
  double across_m = 0;  // left of the track centre positive, as the train looks
};

class MapView {
 public:
  /// The map must outlive it.
  explicit MapView(const track::Map& map);

  /// Longer maps are given in parts only.
  static constexpr double kWholeMapM = 300'000;
  [[nodiscard]] double length_m() const { return length_m_; }
  /// {edges, switches, landmarks}: all of it, or what lies within the radius of a place. Lines have a point at least
  /// every 20 m in curves and every 500 m on straights.
  [[nodiscard]] nlohmann::json message(const std::optional<track::EdgePosition>& around, double radius_m) const;

  /// [[ahead_m, per_m], ...] along the straight way from -behind_m to ahead_m; empty when there is no such edge. Left
  /// curves positive as the train looks.
  [[nodiscard]] nlohmann::json curvature(const track::EdgePosition& train, double behind_m, double ahead_m) const;
  [[nodiscard]] std::vector<LandmarkAhead> landmarks_ahead(const track::EdgePosition& train, double ahead_m) const;
  /// How far left of the straight line ahead the track centre lies after these metres.
  [[nodiscard]] double bend_m(const track::EdgePosition& train, double ahead_m) const;

 private:
  [[nodiscard]] std::optional<track::Route> route(const track::EdgePosition& train, double behind_m,
                                                  double ahead_m) const;
  const track::Map& map_;
  track::Ways ways_;
  double length_m_ = 0;
};

}  // namespace railfix::monitor
