// How far the train may be from where it is reckoned because nobody watches the one odometer that is left: a wheel may
// slip or slide, a camera may look at what stands still. Since the reference: a fix that is used ends it.
#pragma once

#include <algorithm>

#include "fusion/fusion_parameters.hpp"
#include "fusion/fusion_types.hpp"

namespace railfix::fusion {

/// What a wheel has counted since its sample before, and who would have seen it slip.
struct WheelCount {
  double way_m = 0;
  double scale = 1;  // true over counted metres
  double time_s = 0;
  double distance_m = 0;  // run by the train, by all sensors
  double speed_mps = 0;
  double unseen_share = 0;  // of what a slip may be: so much nobody would see
  bool isolated = false;
  bool watched = false;    // a camera does, or has just done so
  bool alone = false;      // nobody else measures
  bool came_back = false;  // in the dark, where an IMU alone had said that it is well again
};

/// A plain value.
class UnwatchedWay {
 public:
  void count(const WheelCount& now, const FusionParameters& parameters);
  /// A step of a camera that nobody else speaks for was refused, so far off.
  void refuse_step(double off_m) { since_reference_.refused.add(off_m); }
  /// An IMU feels so much more way than the one odometer says.
  void feel(double more_m) { since_reference_.felt.add(more_m); }
  /// A fix was used.
  void settle() { since_reference_ = {}; }
  /// Goes on from another one's reckoning since the reference.
  void go_on_from(const UnwatchedWay& other) {
    since_reference_ = other.since_reference_;
    distance_m_ = other.distance_m_;
  }
  /// The train may be so far from where it is reckoned. As an odometer's accuracy is stated: a share of the way, and
  /// one slip at the highest speed.
  [[nodiscard]] Sides may_be_off(const FusionParameters& parameters) const;

 private:
  /// How far one reckoning is from another, and the furthest that came to on either side.
  struct Apart {
    double now_m = 0;
    Sides most;
    void add(double way_m) {
      now_m += way_m;
      most.hold({-now_m, now_m});
    }
  };
  struct SinceReference {
    double way_m = 0;     // as far as nobody would have seen it slip
    double hidden_m = 0;  // what slips may have added that pass for a change of speed
    double fastest_mps = 0;
    Apart counted{};  // the wheel's way less the train's while it was isolated: who is wrong is not known for certain
    Apart refused{};
    Apart felt{};
  };
  double changed_alone_mps(bool alone, double speed_mps, const FusionParameters& parameters);

  SinceReference since_reference_;
  double distance_m_ = 0;         // of the train at the wheel's last sample
  double alone_slowest_mps_ = 0;  // that the wheel has said since it measures alone
  double alone_fastest_mps_ = 0;
};

}  // namespace railfix::fusion
