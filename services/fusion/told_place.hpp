// Who has told the place on the map, and what has confirmed it since. A start is somebody's word, GNSS that agrees with
// it knows it to some 10 m only, and where GNSS alone has told it, the train may be on the track beside.
#pragma once

#include <cstdint>

#include "fusion/fusion_types.hpp"

namespace railfix::fusion {

/// As long as nothing has confirmed it.
enum class ToldBy : uint8_t { nobody, start, start_and_gnss, gnss };

/// A plain value.
class ToldPlace {
 public:
  /// At this distance run; sigma_m: one standard deviation of the place.
  void tell(ToldBy by, double distance_m, double sigma_m) {
    by_ = by;
    distance_m_ = distance_m;
    sigma_m_ = sigma_m;
    bends_agreed_ = 0;
    along_known_ = gnss_agreed_ = false;
  }
  void confirm() { by_ = ToldBy::nobody; }
  /// A landmark agrees with it ...
  void agrees(const FixInput& landmark);
  /// ... or any fix does not.
  void disagrees(const FixInput& fix);
  /// A second fix in a row says this other place, to which the train was moved.
  void moved_to(const FixInput& fix);
  /// The track bends here as it should.
  void curve_agrees(bool tells_track, bool turns_otherwise);
  /// GNSS has agreed with it where it tells the direction.
  void gnss_agrees(bool tells_track, bool is_sharp);
  /// GNSS is isolated: what it had said for the place counts no more.
  void gnss_contradicts() {
    if (by_ == ToldBy::start_and_gnss) by_ = ToldBy::start;
  }

  [[nodiscard]] ToldBy by() const { return by_; }
  /// Nothing has confirmed yet the start that somebody has told.
  [[nodiscard]] bool is_only_told() const { return by_ == ToldBy::start; }
  /// ... not even how far along the track it is, or where the cab looks: landmarks that fit may do so by chance.
  [[nodiscard]] bool may_be_elsewhere() const { return is_only_told() && !along_known_; }
  /// ... and nothing has shown yet that the cab looks as it was told.
  [[nodiscard]] bool may_be_turned_round() const { return may_be_elsewhere() && !gnss_agreed_; }
  /// GNSS with that sigma tells by now, with the train at this distance run, where the cab looks: where it was told it
  /// agrees with one that looks the other way just as well.
  [[nodiscard]] bool tells_direction(double gnss_sigma_m, double distance_m) const;
  /// What has agreed with it agrees with a track beside it as well.
  [[nodiscard]] bool alike_beside() const { return alike_beside_; }
  /// So many landmarks say that it is here, the first kLandmarksBelieved of them in a row.
  [[nodiscard]] int landmarks_agreed() const { return landmarks_agreed_; }
  /// Enough of them, whoever says otherwise. Where masts stand everywhere, some are sighted by chance where the map has
  /// one.
  [[nodiscard]] bool believed() const { return landmarks_agreed_ >= kLandmarksBelieved; }

 private:
  static constexpr int kLandmarksBelieved = 5;
  [[nodiscard]] bool confirms_start(bool tells_track);
  void confirm_by(const FixInput& landmark);

  ToldBy by_ = ToldBy::nobody;
  double distance_m_ = 0;  // run when it was told ...
  double sigma_m_ = 0;     // ... and how well it was known then
  int bends_agreed_ = 0;   // curves that fitted a place that was only told
  bool alike_beside_ = false;
  bool gnss_agreed_ = false;  // with where the cab looks, too
  bool along_known_ = false;  // by landmarks that may stand beside another track as well
  int landmarks_agreed_ = 0;
};

}  // namespace railfix::fusion
