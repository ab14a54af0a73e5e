#include "track_detector/landmark_finder.hpp"

#include <algorithm>
#include <cmath>
#include <optional>

#include "core/time.hpp"
#include "track_detector/plate_search.hpp"

namespace railfix::track_detector {
namespace {

constexpr double kNearM = 3.5;
constexpr double kCellM = 0.02;
constexpr double kShakeMarginRad = 0.02;
constexpr double kFollowM = 0.12;  // a known object may be off its prediction by so much
constexpr double kSidewaysM = 0.10;
constexpr double kFitReachM = 2.0;   // pictures used around the reference distance
constexpr double kWorstFitM = 0.06;  // an object whose places do not lie on a line is none
constexpr double kSpotSigmaM = 0.02;
constexpr double kAccelerationMps2 = 3.0;
constexpr double kSeenM = 0.25;     // to be seen before and behind the reference distance
constexpr double kSeenShare = 0.6;  // of the pictures meanwhile
constexpr int kMostMissed = 3;
constexpr size_t kLongestTrack = 400;

struct Line {  // ahead = at_m - speed * (stamp - reference stamp)
  int64_t stamp_ns = 0;
  double at_m = 0;
  double speed_mps = 0;
  double rms_m = 0;
  int count = 0;
};

template <class Spots>
std::optional<Line> fit_line(const Spots& spots, double around_m, double reach_m) {
  Line line;
  line.stamp_ns = spots.back().stamp_ns;
  double t = 0, x = 0, tt = 0, tx = 0;
  const auto used = [&](const auto& spot) { return std::abs(spot.ahead_m - around_m) <= reach_m; };
  const auto time = [&](const auto& spot) { return core::seconds(spot.stamp_ns - line.stamp_ns); };
  for (const auto& spot : spots) {
    if (!used(spot)) continue;
    ++line.count;
    t += time(spot);
    x += spot.ahead_m;
    tt += time(spot) * time(spot);
    tx += time(spot) * spot.ahead_m;
  }
  if (line.count < 2) return std::nullopt;
  const double spread = tt - t * t / line.count;
  if (spread <= 0) return std::nullopt;
  line.speed_mps = -(tx - t * x / line.count) / spread;
  line.at_m = (x + line.speed_mps * t) / line.count;
  for (const auto& spot : spots) {
    if (!used(spot)) continue;
    const double error = spot.ahead_m - (line.at_m - line.speed_mps * time(spot));
    line.rms_m += error * error / line.count;
  }
  line.rms_m = std::sqrt(line.rms_m);
  return line;
}

}  // namespace

LandmarkFinder::LandmarkFinder(const geometry::Intrinsics& camera, const LandmarkOptions& options)
    : camera_(camera), options_(options) {}

std::vector<Sighting> LandmarkFinder::process(const LandmarkPicture& picture) {
  const vision::SheetPose pose{picture.pose, options_.balise_depth_m, picture.curvature_per_m,
                               picture.vertical_curvature_per_m};
  if (!maker_) {
    const vision::Sheet sheet =
        vision::fit_sheet(camera_, pose, kNearM, options_.far_m, options_.half_width_m, kCellM, kShakeMarginRad);
    if (sheet.rows < 100) return {};  // this pose shows no ground; the next may
    maker_ = std::make_unique<vision::TopViewMaker>(camera_, sheet);
  }
  maker_->make(picture.grey, pose, view_);
  follow(find_plates(view_, maker_->sheet(), options_), picture.stamp_ns);

  std::vector<Sighting> settled;
  for (Track& track : tracks_) {
    Sighting sighting;
    if (track.reported || !settle(track, picture, sighting)) continue;
    track.reported = true;
    settled.push_back(sighting);
  }
  std::erase_if(tracks_, [](const Track& track) { return track.missed > kMostMissed; });
  return settled;
}

LandmarkFinder::Track* LandmarkFinder::owner_of(const PlateCandidate& candidate, int64_t stamp_ns) {
  Track* owner = nullptr;
  double nearest_m = 1e9;
  for (Track& track : tracks_) {
    const Spot& last = track.spots.back();
    if (last.stamp_ns == stamp_ns || std::abs(last.lateral_m - candidate.lateral_m) > kSidewaysM) continue;
    const double dt_s = core::seconds(stamp_ns - last.stamp_ns);
    const size_t newest = std::min<size_t>(track.spots.size(), 6);
    const std::vector<Spot> recent(track.spots.end() - static_cast<std::ptrdiff_t>(newest), track.spots.end());
    double off_m = 0;
    if (const auto line = fit_line(recent, last.ahead_m, 1e3)) {
      const double predicted_m = line->at_m - line->speed_mps * dt_s;
      off_m = std::abs(candidate.ahead_m - predicted_m);
      if (off_m > kFollowM + kAccelerationMps2 * dt_s * dt_s) continue;
    } else {
      const double step_m = last.ahead_m - candidate.ahead_m;
      if (step_m < -0.2 || step_m > options_.max_speed_mps * dt_s + 0.05) continue;
      off_m = std::abs(step_m);
    }
    if (off_m < nearest_m) {
      nearest_m = off_m;
      owner = &track;
    }
  }
  return owner;
}

void LandmarkFinder::follow(const std::vector<PlateCandidate>& found, int64_t stamp_ns) {
  std::vector<PlateCandidate> near_first = found;
  std::sort(near_first.begin(), near_first.end(),
            [](const PlateCandidate& a, const PlateCandidate& b) { return a.ahead_m < b.ahead_m; });
  for (const PlateCandidate& plate : near_first) {
    const Spot spot{stamp_ns, plate.ahead_m, plate.lateral_m, plate.contrast};
    if (Track* owner = owner_of(plate, stamp_ns)) {
      owner->spots.push_back(spot);
      owner->missed = 0;
      if (owner->spots.size() > kLongestTrack) owner->spots.erase(owner->spots.begin() + 1);
    } else {
      tracks_.push_back({{spot}, false, 0, 0});
    }
  }
  for (Track& track : tracks_) {
    if (track.spots.back().stamp_ns == stamp_ns) continue;
    ++track.missed;
    ++track.gaps;
  }
}

// An object is settled when it was seen on both sides of the reference distance and its places lie on a line.
bool LandmarkFinder::settle(const Track& track, const LandmarkPicture& picture, Sighting& sighting) const {
  if (static_cast<int>(track.spots.size()) < options_.fewest_pictures) return false;
  const double first_m = track.spots.front().ahead_m;
  const double last_m = track.spots.back().ahead_m;
  const double reference_m = options_.reference_m;
  // Seen on half a metre of its way at least, so that a stain on the lens or a standing train reports nothing.
  if (last_m > reference_m - kSeenM || first_m < reference_m + kSeenM) return false;
  if (static_cast<double>(track.spots.size()) <
      kSeenShare * static_cast<double>(track.spots.size() + static_cast<size_t>(track.gaps))) {
    return false;
  }
  auto line = fit_line(track.spots, reference_m, kFitReachM);
  if (!line || line->count < options_.fewest_pictures) line = fit_line(track.spots, reference_m, 1e3);
  if (!line || line->rms_m > kWorstFitM || line->speed_mps <= 0) return false;
  sighting.stamp_ns = line->stamp_ns + core::to_ns((line->at_m - reference_m) / line->speed_mps);
  sighting.distance_ahead_m = reference_m;
  double contrast = 0;
  for (const Spot& spot : track.spots) {
    sighting.lateral_m += spot.lateral_m / static_cast<double>(track.spots.size());
    contrast += spot.contrast / static_cast<double>(track.spots.size());
  }
  const double height_m = picture.pose.height_m + options_.balise_depth_m;
  const double noise_m = std::hypot(kSpotSigmaM, line->rms_m) / std::sqrt(static_cast<double>(line->count));
  const double depth_m = options_.balise_depth_sigma_m * reference_m / height_m;
  const double pitch_m = picture.pitch_sigma_rad * (reference_m * reference_m + height_m * height_m) / height_m;
  sighting.sigma_m = std::sqrt(noise_m * noise_m + depth_m * depth_m + pitch_m * pitch_m);
  const double by_pictures = 1.0 - std::exp(-0.5 * static_cast<double>(track.spots.size()));
  const double by_contrast = 1.0 - std::exp(-contrast / options_.lowest_contrast);
  sighting.confidence = by_pictures * (0.5 + 0.5 * by_contrast);
  if (sighting.confidence < options_.lowest_confidence) return false;
  sighting.frame_seq = picture.frame_seq;
  sighting.grabbed_ns = picture.grabbed_ns;
  return true;
}

}  // namespace railfix::track_detector
