// What goes into fusion and what comes out of it, without DDS. Stamps are Unix nanoseconds of the measurement, not of
// its arrival.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <memory>
#include <string>
#include <variant>

#include "fusion/fusion_parameters.hpp"
#include "track/path.hpp"

namespace railfix::fusion {

/// Motion of the camera's foot since the reference picture.
struct OdometryInput {
  int64_t stamp_ns = 0;
  int64_t reference_stamp_ns = 0;
  double step_m = 0;
  double step_sigma_m = 0;
  bool valid = false;        // false: blind, the step means nothing
  double yaw_rad = 0;        // turned meanwhile, left positive
  double yaw_sigma_rad = 0;  // 0, or no number: not told
};

struct WheelInput {
  int64_t stamp_ns = 0;
  int64_t pulses = 0;  // cumulative, signed
  double pulses_per_metre = 0;
};

struct ImuInput {
  int64_t stamp_ns = 0;
  double accel_x_mps2 = 0;  // specific force along the body's forward axis
  double rate_z_rps = 0;
};

struct GnssInput {
  int64_t stamp_ns = 0;
  double easting_m = 0;  // in the map's coordinates
  double northing_m = 0;
  double hdop = 0;
  int fix = 0;              // 0 none, 1 single, 4 RTK fixed, 5 RTK float
  bool tells_track = true;  // set by Fusion: there is no track beside the one
};

/// So far behind and ahead of a place, or beyond an interval's ends.
struct Sides {
  double behind_m = 0;
  double ahead_m = 0;
  void add(const Sides& more) {
    behind_m += more.behind_m;
    ahead_m += more.ahead_m;
  }
  void hold(const Sides& other) {
    behind_m = std::max(behind_m, other.behind_m);
    ahead_m = std::max(ahead_m, other.ahead_m);
  }
};

enum class FixKind : uint8_t { curvature = 1, landmark = 2, network = 3, track = 4, gnss = 5 };

/// How all that is sighted fits the map near the place: SIGHTINGS_FIT_* of idl/position.idl.
enum class SightingsFit : uint8_t { not_told, nowhere, here };

/// A network fix begins the position from this probability on.
inline constexpr double kBeginProbability = 0.95;

/// A place on the map, of the camera's foot at the stamp.
struct FixInput {
  int64_t stamp_ns = 0;
  uint32_t edge = 0;
  double offset_m = 0;
  double sigma_m = 0;
  double probability = 0;
  uint32_t landmark = 0;
  FixKind kind = FixKind::landmark;
  track::Direction direction = track::Direction::unknown;
  std::shared_ptr<const track::Path> new_path;  // set by Fusion when the fix starts the position on the map, or
                                                // says that the train is on another track
  SightingsFit sightings_fit = SightingsFit::not_told;
  Sides otherwise{};        // kind track: over ways of another length that have led here it is up to so far away
  bool tells_track = true;  // set by Fusion: no track beside it would give the same
  bool only_told = false;   // kind network: nothing has confirmed it
  bool of_before = false;   // kind network: what the fusion before this one knew
  bool in_doubt = false;    // kind network: no position until landmarks or proven GNSS agree
};

/// The next picture will be measured against the one of this stamp: remember where the train was.
struct PictureInput {
  int64_t stamp_ns = 0;
};

/// In the order in which events of the same stamp are used.
using Event = std::variant<ImuInput, WheelInput, PictureInput, OdometryInput, GnssInput, FixInput>;

inline int64_t stamp_of(const Event& event) {
  return std::visit([](const auto& input) { return input.stamp_ns; }, event);
}

/// What the wheel said then is taken back: behind from_ns, up to until_ns, when its slip was found.
struct WheelBlock {
  int64_t from_ns = 0;
  int64_t until_ns = 0;

  bool operator==(const WheelBlock&) const = default;
};

enum class Source : uint8_t { camera, wheel, imu, gnss, landmark, curvature };
constexpr int kSources = 6;
inline constexpr std::array kMotionSources{Source::camera, Source::wheel, Source::imu};
inline constexpr std::array kOdometers{Source::camera, Source::wheel};
enum class Integrity : uint8_t { ok, degraded, unusable };

/// State of the train at one stamp; fields as in msg::TrainState.
struct TrainEstimate {
  int64_t stamp_ns = 0;
  bool track_known = false;
  track::EdgePosition position;
  std::shared_ptr<const track::Path> path;  // of that moment; nullptr = the track is not known
  double path_distance_m = 0;               // on it
  double distance_m = 0;
  double speed_mps = 0;
  double acceleration_mps2 = 0;
  double over_m = 0;   // the true position may lie this far behind
  double under_m = 0;  // ... and this far in front
  double sigma_m = 0;
  double visual_scale = 1;
  double wheel_scale = 1;
  double since_reference_m = 0;
  double since_sure_m = 0;  // way since the last place that is beyond doubt: the interval's budget counts from there
  double lat_deg = 0;
  double lon_deg = 0;
  double easting_m = 0;
  double northing_m = 0;
  double heading_rad = 0;
  double track_probability = 0;  // that it is this track and no other behind a switch
  uint32_t reference = 0;
  uint32_t sources = 0;  // bit 1 << Source
  Integrity integrity = Integrity::unusable;
  bool standstill = false;
  bool place_in_doubt = false;  // something speaks against it: it is no position, however narrow the interval
  std::string reason;           // why it is not ok, one sentence

  void degrade(const std::string& why);
  /// Degraded with an interval beyond the budget, unusable beyond so many of it.
  void judge_width(const FusionParameters& parameters);
};

}  // namespace railfix::fusion
