// What the readers of map sources hand over to the builder.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "track/aside.hpp"
#include "track/map.hpp"

namespace railfix::track {

/// From the track's middle to the edge of a platform, where the source does not say.
constexpr double kPlatformEdgeM = 1.7;

/// What no track has and no train runs (ETCS carries speeds up to 600 km/h), whatever a source says.
constexpr double kMostCantM = 0.3;
constexpr double kFastestKmh = 600.0;
constexpr bool is_cant(double cant_m) {
  return cant_m >= -kMostCantM && cant_m <= kMostCantM;
}
/// 0 is one: it ends a limit.
constexpr bool is_speed(double kmh) {
  return kmh >= 0 && kmh <= kFastestKmh;
}
constexpr const char* kNoTrackHas = "which no track has";
constexpr const char* kNoTrainRuns = "which no train runs";

/// A landmark on one track, not yet numbered.
struct TrackMark {
  LandmarkKind kind = LandmarkKind::unknown;
  double offset_m = 0;
  double lateral_m = 0;
  double sigma_m = 0;
  std::string name;
};

/// Q_LOCACC of a group whose source does not say it: the builder's options do.
inline constexpr double kUnsaidLocationM = 0;

/// A balise group on one track, its balises at offsets of the same track.
struct TrackGroup {
  uint32_t nid_c = 0;
  uint32_t nid_bg = 0;
  double offset_m = 0;
  bool nominal_is_forward = true;
  double q_locacc_m = kUnsaidLocationM;
  std::vector<TrackMark> balises;
};

/// The identity of a balise group, whole numbers that ETCS can carry; nothing where these are none.
struct EtcsIdentity {
  uint32_t nid_c = 0;
  uint32_t nid_bg = 0;
  auto operator<=>(const EtcsIdentity&) const = default;
};
std::optional<EtcsIdentity> etcs_identity(double nid_c, double nid_bg);
/// For the sentence that refuses another one.
constexpr const char* kNoEtcsIdentity =
    "an identity that ETCS cannot carry: NID_C is a whole number from 0 to 1023, NID_BG one from 0 to 16382";

/// One track as a source describes it, before it is cut at switches.
struct ImportedTrack {
  std::string name;
  std::string line;
  Alignment alignment;
  std::vector<TrackMark> marks{};
  std::vector<TrackGroup> groups{};
  std::vector<SpeedLimit> speed_limits{};
  bool is_drawn = false;  // as Edge::is_drawn
};

/// Adds limits that hold from a place on, as the train runs, up to the next one or the end of the track; 0 ends one.
/// `changes`: offset in metres, speed in m/s. REQUIRES: each is_speed().
void add_speeds(std::vector<std::pair<double, double>> changes, Direction running, double length_m,
                ImportedTrack& track);

/// Cant that holds from each place on up to the next one and steps there; 0 before the first. None where there are
/// none.
std::vector<CantPoint> held(std::vector<CantPoint> changes);

/// How well what was read closes: worst cases over all elements, in metres and radians.
struct FitFigures {
  size_t elements = 0;
  double max_end_error_m = 0;        // of an element, integrated over the source's length, against the source's
  double max_length_change_m = 0;    // of an element, against the source's length
  double max_heading_step_rad = 0;   // from one element to the next
  double max_gap_m = 0;              // from the source's end of one element to its start of the next
  double max_point_distance_m = 0;   // track from a polyline's points (left out where too near, moved by smoothing)
  double max_chord_deviation_m = 0;  // track against the straight lines between a polyline's points

  void include(const FitFigures& other);
};

}  // namespace railfix::track
