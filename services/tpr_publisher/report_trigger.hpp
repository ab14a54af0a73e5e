// When to report: first of all, then as packet 58 asks, and whatever it asks at standstill and where mode, level, train
// integrity or the on-board unit itself call for it (SUBSET-026 3.6.5.1.4).
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "core/result.hpp"
#include "etcs/report_parameters.hpp"
#include "tpr_publisher/front_end.hpp"

namespace railfix::tpr_publisher {

/// Values as in REPORT_* of idl/position.idl, from mode on of idl/onboard.idl.
enum class Reason : uint8_t {
  cycle_time = 1,
  cycle_distance = 2,
  standstill = 3,
  moving = 4,
  balise_group = 5,
  location = 6,
  start = 7,
  mode = 8,
  level = 9,
  integrity_confirmed = 10,
  integrity_lost = 11,
  border = 12,
  session = 13,
  error = 14,
};

/// What the ETCS on-board unit says, as OnboardStatus of idl/onboard.idl.
struct Onboard {
  int64_t stamp_ns = 0;
  int64_t integrity_ns = 0;
  double train_length_m = 0;
  uint32_t m_mode = 0;
  uint32_t m_level = etcs::kLevel2;
  uint32_t nid_ntc = 0;
  uint32_t q_integrity = 0;
  ActiveCab active_cab = ActiveCab::not_said;
  uint32_t reports_wanted = 0;  // counts up; begins again at 0 with its writer
  Reason wanted_because = Reason::session;
};

/// What the rules look at. Distances are on the train's own travelled distance.
struct Moment {
  int64_t now_ns = 0;
  double front_m = 0;           // estimated front end
  double max_safe_front_m = 0;  // infinite when not known: a location then counts as passed
  double min_safe_front_m = 0;
  bool standstill = false;
  Motion motion = Motion::unknown;
  uint32_t nid_lrbg = etcs::kUnknownBaliseGroup;
  uint32_t q_dirlrbg = etcs::kUnknownSide;
  uint32_t taken_back = 0;                // counts up whenever an LRBG that was told turns out to be none
  uint32_t passed_again = 0;              // counts up whenever the train goes over its LRBG once more
  std::optional<double> beyond_lrbg_m;    // front end beyond the LRBG, along the train
  std::optional<double> beyond_origin_m;  // ... beyond the group that origin() names
  double origin_doubt_m = 0;              // that way may be longer or shorter by so much more than the one to the LRBG
  double foot_to_front_m = 0;             // the foot passes groups so much later
  Onboard onboard;
  uint32_t mode_changes = 0;  // of what is reported: count up, so that one there and back is noticed
  uint32_t level_changes = 0;
  uint32_t wants = 0;  // reports that the on-board unit has asked for
  Reason wanted_because = Reason::session;
};

class ReportTrigger {
 public:
  static constexpr double kOriginWaitM = 500;

  /// train_length_m: 0 = not known; then nothing is reported where the rear end passes.
  ReportTrigger(const etcs::ReportParameters& parameters, double train_length_m);

  /// A packet 58. T_CYCLOC 0 and D_CYCLOC 0 ask for reports as often as possible: once a second at most, for D_CYCLOC
  /// once a metre at most, too. Its locations count along the train from `origin`, the LRBG when it came; nothing = the
  /// next one that is known, because it has only just come, kUnknownBaliseGroup = nobody knows any more, and locations
  /// are left out. A group that nobody knows is waited for, kOriginWaitM long: trackside's antenna may be ahead of our
  /// estimate. Locations behind the train have been passed long ago, unless the packet has `waited` to be used.
  void set_parameters(const etcs::ReportParameters& parameters, std::optional<uint32_t> origin = std::nullopt,
                      bool waited = false);
  /// The group that locations count from; nothing before it is known and when there are no locations.
  [[nodiscard]] std::optional<uint32_t> origin() const { return locations_.empty() ? std::nullopt : origin_; }
  /// Its travelled distance, as far as that is known.
  [[nodiscard]] std::optional<double> origin_m() const { return origin_m_; }
  /// Locations are asked for, but where they are is not known, or not yet.
  [[nodiscard]] bool locations_left_out() const {
    return (locations_.empty() || waits_since_m_) && !parameters_.locations.empty();
  }
  /// ... nor will it be known.
  [[nodiscard]] bool locations_given_up() const { return locations_.empty() && !parameters_.locations.empty(); }
  /// A location waits for the rear end of a train whose length is not known.
  [[nodiscard]] bool rear_end_left_out() const;
  void set_train_length(double train_length_m) { train_length_m_ = train_length_m; }
  /// Moments before and after this one have no distance in common.
  void lose_way();
  /// The front is at the other end now: the next report is a first one, and what the trackside asked to know at
  /// locations ahead is over.
  void turn();
  /// The most urgent reason to report now; the same again until sent() is called.
  [[nodiscard]] std::optional<Reason> due(const Moment& moment);
  void sent(const Moment& moment);
  /// Somebody else reports: follows what passes, and the next report of this one is a first one.
  void watch(const Moment& moment);

 private:
  struct Location {
    double at_m = 0;  // beyond the origin
    bool rear_end = false;
    bool passed = false;
  };
  void place_locations(const Moment& moment);
  void wait_for_origin(const Moment& moment);
  [[nodiscard]] bool group_taken_back(const Moment& moment) const;
  [[nodiscard]] bool group_found_again(const Moment& moment) const;
  [[nodiscard]] bool motion_turned(const Moment& moment) const;
  [[nodiscard]] bool comes_and_goes(const Moment& moment) const;
  [[nodiscard]] std::optional<Reason> correction(const Moment& moment) const;
  void note_events(const Moment& moment);
  /// By the max safe front end, or by the min safe rear end. REQUIRES: the origin's place is known.
  [[nodiscard]] double beyond_origin_m(const Moment& moment, bool rear_end) const;
  [[nodiscard]] std::optional<Reason> onboard_reason(const Moment& moment) const;
  [[nodiscard]] int64_t since_report_ns(const Moment& moment) const;
  void count_way(const Moment& moment);
  [[nodiscard]] bool cycle_distance_over(const Moment& moment) const;
  [[nodiscard]] bool cycle_time_over(const Moment& moment) const;

  etcs::ReportParameters parameters_;
  double train_length_m_;
  std::vector<Location> locations_;
  std::optional<uint32_t> origin_;  // balise group
  std::optional<double> origin_m_;  // its travelled distance; nothing = must be found
  double origin_doubt_m_ = 0;
  std::optional<double> waits_since_m_;  // for the origin; the front end's travelled distance
  bool passed_before_ = true;            // locations that lie behind when the origin is found were passed long ago
  std::optional<Moment> reported_;       // last moment that was sent
  std::optional<int64_t> corrected_ns_;  // when one was sent last that took back what was said
  double way_m_ = 0;                     // run since the last report, there and back, up to ...
  double way_to_m_ = 0;                  // ... this front end
  uint32_t last_group_ = etcs::kUnknownBaliseGroup;
  uint32_t passed_again_ = 0;  // when it was looked at last
  uint32_t taken_back_ = 0;    // the same
  bool asked_ = false;         // "now"
  bool group_passed_ = false;
  bool location_passed_ = false;
  bool way_lost_ = false;  // since the last report
};

}  // namespace railfix::tpr_publisher
