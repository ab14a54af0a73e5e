// From a place relative to its balise group to the fields of message 136 (SUBSET-026 3.6.1 to 3.6.4, units of chapter
// 7).
#pragma once

#include <cstdint>
#include <optional>

#include "etcs/train_position_report.hpp"
#include "tpr_publisher/balise_tracker.hpp"
#include "track/declared.hpp"

namespace railfix::tpr_publisher {

/// What is known of the train at one moment, along one axis of the train ("forward").
struct TrainPosition {
  int64_t stamp_ns = 0;
  track::EdgePosition foot;  // of the camera
  bool track_known = false;
  double track_probability = 0;  // that it is this track and no other behind a switch
  bool usable = true;            // false: integrity lost, the place must not be used
  double distance_m = 0;         // travelled since start, signed
  double speed_mps = 0;          // signed; NaN = not known
  double over_m = 0;             // the true foot may lie this far behind the estimate
  double under_m = 0;            // ... and this far in front of it
  bool standstill = false;

  [[nodiscard]] bool place_known() const {
    return track_known && usable && foot.direction != track::Direction::unknown;
  }
  [[nodiscard]] bool track_declared() const { return track_probability >= track::kDeclaredProbability; }
};

enum class Motion : uint8_t { unknown, forward, backward };

/// What the position does not say.
struct ReportSettings {
  etcs::Baseline baseline = etcs::Baseline::b3;
  uint32_t nid_engine = 0;
  uint32_t m_mode = 0;
  uint32_t m_level = etcs::kLevel2;
  uint32_t nid_ntc = 0;         // used with level NTC only
  uint32_t finest_q_scale = 0;  // coarser ones are taken when a distance does not fit
  double foot_to_front_m = 0;   // from the camera's foot forward to the train's front end
  bool train_data = false;      // the on-board unit has valid train data
  double train_over_m = -1;     // 4.0.0 only, see train_allowance(); below 0 = not known
  double train_under_m = -1;
};

/// An over- or under-reading amount; infinite where it is no distance, because none may be taken for certain then.
double amount_m(double value_m);

/// What 4.0.0 adds to the over- and under-reading amounts in supervised manoeuvre, and in stand-by without train data
/// where the consist length is known, because vehicles may stand in front of and behind the engine (L_TRAINOVER and
/// L_TRAINUNDER, SUBSET-026 4.0.0 3.6.4.1.5). Zero otherwise, infinite where a manoeuvre's is not known.
struct Allowance {
  double over_m = 0;
  double under_m = 0;
};
Allowance train_allowance(const ReportSettings& settings);

/// Q_DIRLRBG of a train that refers to this group: kUnknownSide for a single balise without a group before it.
uint32_t orientation(const Reference& reference);

/// REQUIRES: the speed is known, because V_TRAIN has no value for "unknown". No reference: NID_LRBG and all that is
/// relative to it is "unknown". A real group of a single balise gives packet 1, whose directions are relative to the
/// way from the group before it, and unknown without one (3.6.2.2, 3.4.2.3.3). Train integrity is left at "no
/// information". D_LRBG is rounded to its step; L_DOUBTOVER and L_DOUBTUNDER take up what the rounding moves, so that
/// the interval from min safe to max safe front end never shrinks.
etcs::TrainPositionReport make_report(const TrainPosition& position, const std::optional<Reference>& reference,
                                      Motion motion, const ReportSettings& settings, int64_t now_ns);

/// How far off the place of the group may be, from the map and from how it was found; infinite when nobody knows.
double place_doubt_m(const Reference& reference);
/// How far in front of it a report says the front end to be that is front_m beyond its group, along the train.
double reported_ahead_m(uint32_t d_lrbg, double step_m, double front_m);

/// Nearest step of 5 km/h; at standstill 0, or 127 in 4.0.0.
uint32_t v_train(double speed_mps, bool standstill, etcs::Baseline baseline);
/// Trainborne clock: steps of 10 ms, never the value "unknown"; starts anew after 497 days.
uint32_t t_train(int64_t now_ns);

}  // namespace railfix::tpr_publisher
