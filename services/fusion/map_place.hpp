// Where on the map the train is: who has told it, what agrees and what speaks against it, and how far away from it the
// train may be. Where no place is known, the distance run stands for it.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>

#include "fusion/fix_outcome.hpp"
#include "fusion/fusion_parameters.hpp"
#include "fusion/fusion_types.hpp"
#include "fusion/motion_filter.hpp"
#include "fusion/other_ways.hpp"
#include "fusion/sensor_watch.hpp"
#include "fusion/told_place.hpp"
#include "fusion/track_doubt.hpp"
#include "fusion/train_motion.hpp"
#include "fusion/turned_way.hpp"
#include "fusion/wrong_place.hpp"
#include "track/path.hpp"

namespace railfix::fusion {

/// Where the train is for certain: the two ends on the path (on the distance run when the place is not known).
struct Interval {
  double rear_m = 0;
  double front_m = 0;
};

/// What a fix must know of those beside whom it is used.
struct FixContext {
  /// They promise so much more: a fix that is used must not be weighed against the filter's sigma alone.
  double excess_m = 0;
  /// The interval is asked without widened(): a vague fix leaves what slips may have added as it is, instead of making
  /// it part of what the interval holds.
  bool unwidened = false;
};

/// A plain value. The numbers of the place are the filter's: every call is given the motion that has it.
class MapPlace {
 public:
  explicit MapPlace(const FusionParameters* parameters) : parameters_(parameters) {}

  /// Somebody tells that the train is at the path's distance 0.
  void start_on(std::shared_ptr<const track::Path> path, const TrainMotion& motion);
  /// The same way, which goes on beyond the ends of `path`: nothing else changes.
  void follow_on(const std::shared_ptr<const track::Path>& path, const std::shared_ptr<const track::Path>& longer);
  /// A new event: fix() is of it.
  void begin() { fix_ = {}; }
  void use(const FixInput& fix, const FixContext& context, TrainMotion& motion);
  void use(const GnssInput& sample, TrainMotion& motion);
  void use(const YawRate& rate, TrainMotion& motion);
  /// The train has run so far.
  void move(double way_m, const TrainMotion& motion);
  void set_clock(int64_t stamp_ns);

  /// Goes on from the other one's place. Who has refused what stays its own: fixes are told to all of them.
  void place_like(const MapPlace& other) { known_ = other.known_; }
  /// Nobody knows any more where the train is.
  void give_up(Against because);
  /// The train may be so far beyond the interval's ends, until a fix says where it is.
  void doubt(const Sides& beyond, const TrainMotion& motion);
  /// Its last reference lies so far back.
  void refer_back(double since_reference_m, const TrainMotion& motion);
  void exclude_gnss(const MapPlace& other, int64_t stamp_ns);
  void do_without_gnss() { gnss_.watch.leave_out(); }

  [[nodiscard]] double centre_m(const TrainMotion& motion) const;
  [[nodiscard]] double sigma_m(const TrainMotion& motion) const;
  /// Of the sensors that work, without widened().
  [[nodiscard]] Interval interval(const TrainMotion& motion) const;
  /// With what slips may have added since the reference that no camera watched.
  [[nodiscard]] Interval widened(const Interval& interval, const TrainMotion& motion) const;
  /// Way since the last fix that settled what was in doubt ...
  [[nodiscard]] double since_fix_m(const TrainMotion& motion) const;
  /// ... and since the last one that was sharp enough for the budget to count from.
  [[nodiscard]] double since_reference_m(const TrainMotion& motion) const;

  /// nullptr: the place is not known.
  [[nodiscard]] const std::shared_ptr<const track::Path>& path() const { return known_.path; }
  /// Who spoke against the last place; nothing where there is one, or was none yet.
  [[nodiscard]] std::optional<Against> given_up() const { return known_.given_up; }
  [[nodiscard]] const ToldPlace& told() const { return known_.told; }
  [[nodiscard]] const TrackDoubt& track_doubt() const { return known_.track_doubt; }
  [[nodiscard]] const WrongPlace& wrong_place() const { return known_.wrong_place; }
  /// The landmark that the budget counts from.
  [[nodiscard]] uint32_t reference() const { return known_.reference; }
  [[nodiscard]] const SensorWatch& gnss() const { return gnss_.watch; }
  [[nodiscard]] const SensorWatch& landmarks() const { return landmarks_; }
  [[nodiscard]] const SensorWatch& curves() const { return curves_; }
  /// GNSS has agreed with the motion for a while, and with a place that it had not given itself.
  [[nodiscard]] bool gnss_proven() const {
    return gnss_.agreed >= kGnssProof && known_.told.by() != ToldBy::gnss && !known_.told.may_be_turned_round();
  }
  /// GNSS, which has never agreed with it under way, says otherwise, and hardly anything speaks for it.
  [[nodiscard]] bool gnss_denies() const;
  /// What GNSS that agrees with the motion may still be wrong by.
  [[nodiscard]] double gnss_bound_m(const TrainMotion& motion) const;

  /// What became of the last event, when it was a fix.
  [[nodiscard]] const FixOutcome& fix() const { return fix_; }
  /// A fix was refused, none has been used since.
  [[nodiscard]] bool has_refused() const { return refused_.has_value(); }
  /// It was moved against the filter's word, not confirmed yet.
  [[nodiscard]] bool was_corrected() const { return corrected_; }
  /// A fix was on another track, none on this one since.
  [[nodiscard]] bool seen_beside() const { return off_path_.has_value(); }

 private:
  static constexpr int kGnssProof = 30;
  /// What is known of the place, beside the filter's numbers.
  struct Known {
    std::shared_ptr<const track::Path> path;
    std::optional<Against> given_up;
    ToldPlace told;
    TrackDoubt track_doubt;
    TurnedWay turned_way;
    WrongPlace wrong_place;
    OtherWays other_ways;
    uint32_t reference = 0;
    double fix_m = 0;                // the distance run at the last fix that settled what was in doubt ...
    double reference_m = 0;          // ... and at the reference
    std::array<uint32_t, 16> met{};  // landmarks that were used last, newest first; 0 = none
  };
  struct RefusedFix {
    double residual_m = 0;
    double sigma_m = 0;
    double distance_m = 0;
  };
  struct Gnss {
    SensorWatch watch;
    int agreed = 0;                      // fixes, since three in a row were refused or one had no place
    bool contradicts_direction = false;  // its last word, where it tells where the cab looks
    bool was_proven = false;             // when three in a row were
    Sides held;                          // where it contradicts a wheel alone, it says that the train is so far away
  };

  void use_track(const FixInput& fix, const TrainMotion& motion);
  void begin_with(const FixInput& fix, const FixContext& context, TrainMotion& motion);
  void compare(const FixInput& fix, double path_distance_m, const FixContext& context, TrainMotion& motion);
  [[nodiscard]] bool fits_a_named_way(const MeasuredPlace& place, const MotionFilter& filter) const;
  Offer offer(const MeasuredPlace& place, const FixContext& context, TrainMotion& motion) const;
  Offer offer_again(const MeasuredPlace& place, MotionFilter& filter) const;
  [[nodiscard]] bool has_met(uint32_t landmark) const;
  [[nodiscard]] bool may_fit_by_chance(const FixInput& fix) const;
  void speak_for_track(const FixInput& fix, bool by_chance, const TrainMotion& motion);
  void accept(const FixInput& fix, const FixContext& context, TrainMotion& motion);
  void settle(const FixInput& fix, const FixContext& context, TrainMotion& motion);
  void mark_reference(const FixInput& fix, const TrainMotion& motion);
  void refuse(const FixInput& fix, double path_distance_m, const FixContext& context, TrainMotion& motion);
  [[nodiscard]] bool says_as_refused(const FixInput& fix, double distance_m) const;
  void move_to(const FixInput& fix, double path_distance_m, const FixContext& context, TrainMotion& motion);
  /// So far away may the train be by the last fix.
  [[nodiscard]] double reach_m(double sigma_m) const;
  [[nodiscard]] double fix_sigma_m(const FixInput& fix) const;
  SensorWatch& watch_of(const FixInput& fix) { return fix.kind == FixKind::curvature ? curves_ : landmarks_; }

  [[nodiscard]] bool may_be_beyond(double end_m, const TrainMotion& motion) const;
  [[nodiscard]] bool is_off_map(const TrainMotion& motion) const;
  void tell(ToldBy by, const TrainMotion& motion);
  void hold_gnss(double foot_m, double sigma_m, const TrainMotion& motion);

  void doubt_points_behind(const TrainMotion& motion);
  void compare_turns(const TrainMotion& motion);
  /// What the interval reaches to either side where nothing is in doubt, ...
  [[nodiscard]] double known_to_m(const TrainMotion& motion) const;
  /// ... where the train is lost, ...
  [[nodiscard]] double lost_to_m(const TrainMotion& motion) const;
  /// ... and what the promised interval holds more than the first.
  [[nodiscard]] double doubted_m(const FixContext& context, const TrainMotion& motion) const;

  const FusionParameters* parameters_;
  Known known_;
  SensorWatch landmarks_;
  SensorWatch curves_;
  Gnss gnss_;
  FixOutcome fix_;
  std::optional<RefusedFix> refused_;
  Sides claimed_;  // a fix that was refused, or a surprising one, says that it is so far away
  std::optional<track::EdgePosition> off_path_;  // a fix was there since the last one that was used
  bool corrected_ = false;
};

}  // namespace railfix::fusion
