#include "fusion/told_place.hpp"

#include <algorithm>
#include <cmath>

namespace railfix::fusion {
namespace {

constexpr int kCurvesConfirm = 3;          // a place that was only told
constexpr double kDirectionSigmas = 10.0;  // of way: where the cab looks the other way GNSS is off by twice as much
constexpr double kDirectionM = 10.0;       // ... at least

}  // namespace

void ToldPlace::agrees(const FixInput& landmark) {
  ++landmarks_agreed_;
  confirm_by(landmark);
}

// Once so many in a row have agreed they are believed, whatever one says later.
void ToldPlace::disagrees(const FixInput& fix) {
  if (fix.kind != FixKind::landmark) return;
  along_known_ = false;
  if (!believed()) landmarks_agreed_ = 0;
}

void ToldPlace::moved_to(const FixInput& fix) {
  landmarks_agreed_ = fix.kind == FixKind::landmark ? 2 : 0;
  if (fix.kind == FixKind::landmark) confirm_by(fix);
}

// What agrees with the place says whether it is the right track, too.
bool ToldPlace::confirms_start(bool tells_track) {
  if (!is_only_told()) return false;
  alike_beside_ = alike_beside_ || !tells_track;
  return tells_track;
}

// Any number of masts fits where others stand as far apart, and what stands among them may by chance: map_matcher says
// when no other place near would have given the same. GNSS is never so far off.
void ToldPlace::confirm_by(const FixInput& landmark) {
  along_known_ = along_known_ || landmark.sightings_fit == SightingsFit::here;
  if (is_only_told() && !confirms_start(landmark.tells_track)) return;
  if (!is_only_told() || along_known_) confirm();
}

// One may fit by chance, and there is none on a straight line that lies elsewhere.
void ToldPlace::curve_agrees(bool tells_track, bool turns_otherwise) {
  if (by_ != ToldBy::start_and_gnss && !confirms_start(tells_track)) return;
  bends_agreed_ = turns_otherwise ? 0 : bends_agreed_ + 1;
  if (bends_agreed_ >= kCurvesConfirm) confirm();
}

// A single fix errs by metres that last, however low its HDOP is.
void ToldPlace::gnss_agrees(bool tells_track, bool is_sharp) {
  gnss_agreed_ = true;
  if (confirms_start(tells_track)) by_ = is_sharp ? ToldBy::nobody : ToldBy::start_and_gnss;
}

bool ToldPlace::tells_direction(double gnss_sigma_m, double distance_m) const {
  const double least_m = std::max(kDirectionM, kDirectionSigmas * std::hypot(gnss_sigma_m, sigma_m_));
  return std::abs(distance_m - distance_m_) >= least_m;
}

}  // namespace railfix::fusion
