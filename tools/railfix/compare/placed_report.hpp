// Position reports as places on an axis that two systems share: the line of a map, or each balise group alone.
#pragma once

#include <map>
#include <optional>

#include "compare/network.hpp"
#include "compare/report_file.hpp"
#include "track/path.hpp"

namespace railfix::compare {

struct PlacedReport {
  int64_t stamp_ns = 0;
  uint64_t axis = 0;  // reports of different axes cannot be compared: the co-ordinate system, or 0 = the line
  uint32_t nid_lrbg = 0;
  double front_m = 0;  // estimated front end
  double low_m = 0;    // the front end lies between these two; infinite where a doubt is unknown
  double high_m = 0;
  double speed_mps = 0;  // along the axis, signed; NaN = its sign is not known
  double facing = 0;     // 1 or -1: the way its front end looks along the axis; 0 = it does not say
  double running = 1;  // 1 or -1: the way it runs or, where it does not say, looks, along the axis; also at standstill
  etcs::TrainPositionReport fields{};  // as they were sent
};

/// By the message alone, whatever map there is: a group, a distance, a side, and what "nominal" means.
bool position_known(const etcs::TrainPositionReport& fields);
/// ... and both doubts.
bool interval_known(const etcs::TrainPositionReport& fields);

/// The LRBG in packet 0, together with the group before in packet 1.
uint64_t co_ordinate_system(const etcs::TrainPositionReport& fields);

/// V_TRAIN says standstill or 0 km/h.
bool stands(const etcs::TrainPositionReport& fields);
/// V_TRAIN.
double speed_kmh(const etcs::TrainPositionReport& fields);

class Axes {
 public:
  /// Each balise group alone, along its nominal direction; that of packet 1 is the way from NID_PRVLRBG, an axis of its
  /// own.
  Axes() = default;
  /// The groups of this path, along it.
  explicit Axes(const track::Path& path);

  /// Nothing when the report says "unknown", or a group that it names is not on the path.
  [[nodiscard]] std::optional<PlacedReport> place(const TimedReport& report) const;
  /// Of a group, along the path.
  [[nodiscard]] std::optional<double> place_of(uint32_t nid_lrbg) const;
  /// The map has the LRBG, and the path has not.
  [[nodiscard]] bool names_other_track(const etcs::TrainPositionReport& fields) const;
  [[nodiscard]] const Network& network() const { return network_; }

 private:
  struct Group {
    double at_m;
    bool along;
  };
  [[nodiscard]] std::optional<Group> on_line(const etcs::TrainPositionReport& fields) const;
  std::optional<std::map<uint32_t, Group>> line_;
  Network network_;  // the path's map
};

}  // namespace railfix::compare
