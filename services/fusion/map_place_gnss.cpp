// GNSS: where it puts the train on its path, and who is wrong where the two contradict each other.
#include <algorithm>
#include <cmath>

#include "fusion/map_place.hpp"

namespace railfix::fusion {
namespace {

constexpr int kAgreementsOfGnss = 5;  // in a row: where it scatters one agrees by chance
constexpr double kSharpGnssM = 2.0;   // one sigma of an RTK solution that knows a told start as a landmark does
constexpr double kOffTrackM = 15.0;   // a GNSS fix further beside the track is none
// Of the sigma of a GNSS fix; squares add up to the whole.
constexpr double kGnssLastingShare = 0.866;
constexpr double kGnssNewShare = 0.5;

bool is_rtk(const GnssInput& sample) {
  return sample.fix == 4 || sample.fix == 5;
}

double gnss_sigma_m(const GnssInput& sample, const FusionParameters& p) {
  const double hdop = std::max(sample.hdop, 0.5);
  if (sample.fix == 4) return p.gnss_rtk_fixed_sigma_m * hdop;
  if (sample.fix == 5) return p.gnss_rtk_float_sigma_m * hdop;
  return p.gnss_single_sigma_m * hdop;
}

struct FootOnPath {
  double distance_m;
  double lateral_m;
  double straight_on_m;  // the same where the path would go straight on beyond its ends
};

// Newton steps along the path; converges in two or three because the start is near.
FootOnPath foot_on_path(const track::Path& path, double start_m, double easting_m, double northing_m) {
  double s = start_m;
  double lateral_m = 0;
  double foot_m = s;
  for (int k = 0; k < 6; ++k) {
    const auto pose = path.at(s).pose;
    const double east = easting_m - pose.easting_m;
    const double north = northing_m - pose.northing_m;
    const double sine = std::sin(pose.heading_rad);
    const double cosine = std::cos(pose.heading_rad);
    const double ahead = east * sine + north * cosine;
    lateral_m = north * sine - east * cosine;
    foot_m = s + ahead;
    s = std::clamp(foot_m, path.begin_m(), path.end_m());
    if (std::abs(ahead) < 1e-3) break;
  }
  return {s, lateral_m, foot_m};
}

}  // namespace

bool MapPlace::gnss_denies() const {
  const bool never_agreed =
      gnss_.watch.used_ns == 0 || (gnss_.contradicts_direction && known_.told.may_be_turned_round());
  return gnss_.watch.isolated && ((never_agreed && !known_.told.believed()) || known_.wrong_place.lost());
}

double MapPlace::gnss_bound_m(const TrainMotion& motion) const {
  return parameters_->gnss_bound_m + parameters_->gnss_lag_s * std::abs(motion.filter().speed_mps());
}

void MapPlace::exclude_gnss(const MapPlace& other, int64_t stamp_ns) {
  gnss_.watch = other.gnss_.watch;
  gnss_.watch.convict(stamp_ns);
  known_.told.gnss_contradicts();
}

bool MapPlace::may_be_beyond(double end_m, const TrainMotion& motion) const {
  const auto known = widened(interval(motion), motion);
  return end_m > known_.path->begin_m() ? known.front_m >= end_m : known.rear_m <= end_m;
}

// Tested as it is; what is new in it beside the fix before is little, because its error lasts.
void MapPlace::use(const GnssInput& sample, TrainMotion& motion) {
  gnss_.watch.seen_ns = sample.stamp_ns;
  if (sample.fix == 0 || !known_.path) {
    gnss_.agreed = 0;
    return;
  }
  auto& filter = motion.filter();
  const auto place = foot_on_path(*known_.path, filter.path_distance_m(), sample.easting_m, sample.northing_m);
  const double once_m = std::hypot(gnss_sigma_m(sample, *parameters_), parameters_->gnss_map_sigma_m);
  const double antenna_m = parameters_->gnss_antenna_ahead_m;
  // The map ends before: its end is not where the train is, if it may have come there at all.
  const bool beyond = std::abs(place.straight_on_m - place.distance_m) > once_m;
  const auto agrees_at = [&](double foot_m) {
    return filter.test_position(foot_m - antenna_m, once_m, parameters_->gate_gnss).used;
  };
  if (beyond && (may_be_beyond(place.distance_m, motion) || agrees_at(place.straight_on_m))) return;
  const double foot_m = place.distance_m - antenna_m;
  const bool beside = beyond || std::abs(place.lateral_m) > kOffTrackM + 3 * once_m;
  const bool agrees = !beside && agrees_at(place.distance_m);
  const MeasuredPlace measured{foot_m, kGnssNewShare * once_m, StateIndex::gnss_error, kGnssLastingShare * once_m};
  const bool tells_direction = known_.told.tells_direction(once_m, motion.distance_m());
  gnss_.contradicts_direction = !agrees && tells_direction;
  if (gnss_.watch.isolated) {
    gnss_.watch.hear(agrees, kAgreementsOfGnss, sample.stamp_ns);
    hold_gnss(foot_m, once_m, motion);
  } else if (agrees && filter.offer_position(measured, parameters_->gate_gnss).used) {
    gnss_.watch.accept(sample.stamp_ns);
    ++gnss_.agreed;
    if (tells_direction) known_.told.gnss_agrees(sample.tells_track, is_rtk(sample) && once_m <= kSharpGnssM);
    // The rival without GNSS stays lost: the interval holds what GNSS may be wrong by.
    if (gnss_proven()) known_.wrong_place.found();
  } else if (++gnss_.watch.refused >= kRefusalsToIsolate) {
    gnss_.was_proven = gnss_proven();
    gnss_.watch.isolate(sample.stamp_ns);
    gnss_.agreed = 0;
    known_.told.gnss_contradicts();
  }
}

// A wheel that nobody sees may slide, proven GNSS may be wrong: who is, nobody knows. Of the last word of each. A
// camera that comes back does not undo it.
void MapPlace::hold_gnss(double foot_m, double sigma_m, const TrainMotion& motion) {
  const bool began_unseen = !motion.sensors().camera_sees() || gnss_.held.behind_m + gnss_.held.ahead_m > 0;
  if (!gnss_.watch.isolated) {
    gnss_.held = {};
  } else if (gnss_.was_proven && began_unseen) {
    const double off_m = foot_m - motion.filter().path_distance_m();
    const double reach_m = parameters_->interval_factor * sigma_m;
    gnss_.held = {std::max(0.0, reach_m - off_m), std::max(0.0, reach_m + off_m)};
  }
}

}  // namespace railfix::fusion
