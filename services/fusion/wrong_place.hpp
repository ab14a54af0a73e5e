// Is the place on the map a wrong one altogether: a start that was told kilometres off, an element that the map lacks?
// Whoever speaks against it says so for long enough until it is given up; then the train is searched for on the whole
// map. GNSS alone never does: the train would be found by the one that had accused it.
#pragma once

#include <cstdint>
#include <optional>

namespace railfix::fusion {

/// Who has spoken against a place until it was given up.
enum class Against : uint8_t { sightings, turning, fusion_before, map_end };

/// What speaks against the place at a moment.
struct SpeaksAgainst {
  bool turning = false;      // the train turns otherwise than its track, by all that is known
  bool turning_now = false;  // ... and has just done so
  bool gnss = false;         // it contradicts the place
  bool off_map = false;      // wherever it is, its track has ended on the map
};

/// A plain value.
class WrongPlace {
 public:
  /// map_matcher's last word: what is sighted fits the map nowhere near the place, or it may fit.
  void said(bool fits_nowhere) {
    fits_nowhere_ = fits_nowhere;
    lost_ = lost_ || fits_nowhere;
    of_before_ = of_before_ && !fits_nowhere;
  }
  /// The fusion before this one has handed it over in doubt.
  void doubt() { lost_ = of_before_ = true; }
  /// The place is right, by a landmark or by GNSS that has proven itself.
  void found();
  /// A landmark is where it should be, which may be chance: what was sighted before it speaks no more, turning does.
  void may_be_here() {
    fits_nowhere_ = lost_ = of_before_ = false;
    lost_m_ = 0;
  }
  /// The track bends where the train does, by the camera, and it may be the gyro that is wrong; or the place is another
  /// one now.
  void forget_turning() { turning_m_ = 0; }
  /// The train has run so far.
  void move(double way_m, SpeaksAgainst now);

  [[nodiscard]] bool fits_nowhere() const { return fits_nowhere_; }
  /// It did not fit, or was doubted, and nothing has shown since that the place is right.
  [[nodiscard]] bool lost() const { return lost_; }
  /// Nobody but the fusion before has doubted it.
  [[nodiscard]] bool of_before() const { return of_before_; }
  /// It turned otherwise for longer than a wrong leg is followed or a gyro is out of order: it is no position any more.
  [[nodiscard]] bool is_no_position() const { return turning_m_ > kNoPositionM; }
  /// The place is to be given up.
  [[nodiscard]] std::optional<Against> proven() const;

 private:
  static constexpr double kNoPositionM = 300;
  bool fits_nowhere_ = false;
  bool lost_ = false;
  bool of_before_ = false;
  // Way so far against each.
  double lost_m_ = 0;
  double turning_m_ = 0;
  double since_turned_m_ = 1e9;
  double off_map_m_ = 0;
};

}  // namespace railfix::fusion
