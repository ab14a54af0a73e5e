#include "track_detector/landmark_finder.hpp"

#include <algorithm>
#include <cmath>

#include "core/time.hpp"

namespace railfix::track_detector {
namespace {

constexpr double kNearM = 3.5;
constexpr double kCellM = 0.02;
constexpr double kShakeMarginRad = 0.02;
constexpr double kFrogReferenceM = 9.5;
constexpr double kLookM = 0.55;  // frogs and platforms need no denser looks: that keeps up with 60 pictures a second
constexpr double kFrogScore = 0.36;  // a frog is false with half of exp(-(its score / this)^2)
constexpr double kPlateEvenOdds = -3.5;
constexpr double kPlateTrustALook = 0.8;
constexpr int kFewestPlatePictures = 3;
constexpr double kShutterS = 0.002;     // open about so long
constexpr double kLateS = 0.5;          // for so long the speed tells where the train was
constexpr double kOutOfPictureM = 6.0;  // what stands beside the track leaves it so far ahead

GroundTracking frog_tracking(const LandmarkOptions& options) {
  GroundTracking tracking;
  tracking.reference_m = kFrogReferenceM;
  tracking.spot_sigma_m = 0.06;
  tracking.worst_fit_m = 0.25;
  tracking.follow_m = 0.5;
  tracking.usual_score = kFrogScore;
  tracking.fewest_pictures = options.fewest_pictures;
  tracking.lowest_confidence = options.lowest_confidence;
  return tracking;
}

GroundTracking plate_tracking(const LandmarkOptions& options) {
  GroundTracking tracking;
  tracking.reference_m = options.reference_m;
  tracking.log_odds = true;
  tracking.usual_score = kPlateEvenOdds;
  tracking.trust_a_look = kPlateTrustALook;
  tracking.fewest_pictures = kFewestPlatePictures;
  tracking.lowest_confidence = options.lowest_confidence;
  return tracking;
}

}  // namespace

// When it was nearest and still in the picture it was known best: the way since then adds what it errs by.
Sighting sighting_of(const UprightObject& object, double way_m, int64_t now_ns, double way_sigma) {
  Sighting sighting{object.type, now_ns, object.place_m - way_m, object.lateral_m};
  double on_way_m = std::abs(sighting.distance_ahead_m) + kOutOfPictureM;
  if (core::seconds(now_ns - object.seen_ns) < kLateS) {
    sighting.stamp_ns = object.seen_ns;
    sighting.distance_ahead_m = object.seen_ahead_m;
    on_way_m = std::max(on_way_m, object.seen_ahead_m);
  }
  sighting.sigma_m = std::hypot(object.sigma_m, way_sigma * on_way_m);
  sighting.confidence = 1.0 - std::exp(-0.5 * object.pictures);
  return sighting;
}

double way_past_sigma(const LandmarkOptions& options, double height_m) {
  return std::hypot(options.way_sigma, options.texture_depth_sigma_m / (height_m + options.texture_depth_m));
}

LandmarkFinder::LandmarkFinder(const geometry::Intrinsics& camera, const LandmarkOptions& options)
    : camera_(camera),
      options_(options),
      motion_(options.max_speed_mps),
      plates_(plate_tracking(options), options.way_sigma),
      frog_search_(camera, options),
      frogs_(frog_tracking(options), options.way_sigma),
      platform_search_(camera),
      upright_search_(camera) {
  sightings_.reserve(32);
}

const std::vector<Sighting>& LandmarkFinder::process(const LandmarkPicture& picture) {
  sightings_.clear();
  if (!move(picture)) return sightings_;
  find_in_track(picture);
  if (options_.platforms) find_platforms(picture);
  if (options_.uprights) find_uprights(picture);
  return sightings_;
}

// Resamples the ground and adds what the train has run since the last picture; false while that is not known.
bool LandmarkFinder::move(const LandmarkPicture& picture) {
  const vision::SheetPose pose{picture.pose, options_.balise_depth_m, picture.curvature_per_m,
                               picture.vertical_curvature_per_m};
  if (!maker_) {
    const vision::Sheet sheet =
        vision::fit_sheet(camera_, pose, kNearM, options_.far_m, options_.half_width_m, kCellM, kShakeMarginRad);
    if (sheet.rows < 100) return false;  // this pose shows no ground; the next may
    maker_ = std::make_unique<vision::TopViewMaker>(camera_, sheet);
    plate_search_ = std::make_unique<PlateSearch>(sheet, options_);
  }
  maker_->make(picture.grey, pose, view_);
  const auto step_m = motion_.step(view_, maker_->sheet(), picture.stamp_ns);
  if (!step_m) {
    stamp_ns_ = picture.stamp_ns;
    plates_.forget();
    frogs_.forget();
    platforms_.forget();
    edges_.forget();
    uprights_.forget();
    shade_.forget();
    return false;
  }
  speed_mps_ = *step_m / core::seconds(picture.stamp_ns - stamp_ns_);
  stamp_ns_ = picture.stamp_ns;
  // The sheet lies at the height of balises, the texture that was followed lower.
  way_m_ +=
      *step_m * (picture.pose.height_m + options_.texture_depth_m) / (picture.pose.height_m + options_.balise_depth_m);
  shade_.add(view_, maker_->sheet(), way_m_);
  return true;
}

double LandmarkFinder::pitch_error_m(const LandmarkPicture& picture, double ahead_m, double depth_m) const {
  const double height_m = picture.pose.height_m + depth_m;
  return picture.pitch_sigma_rad * (ahead_m * ahead_m + height_m * height_m) / height_m;
}

void LandmarkFinder::find_in_track(const LandmarkPicture& picture) {
  const PlateBlur blur{camera_.fv_px, picture.pose.height_m + options_.balise_depth_m, kShutterS * speed_mps_};
  for (const SettledThing& plate : plates_.follow(plate_search_->find(view_, blur), way_m_)) {
    const double height_m = picture.pose.height_m + options_.balise_depth_m;
    const double depth_m = options_.balise_depth_sigma_m * options_.reference_m / height_m;
    const double pitch_m = pitch_error_m(picture, options_.reference_m, options_.balise_depth_m);
    report({LandmarkType::balise, picture.stamp_ns, plate.place_m - way_m_, plate.lateral_m,
            std::hypot(plate.sigma_m, depth_m, pitch_m), plate.confidence},
           picture);
  }
  if (!options_.frogs || std::abs(way_m_ - frog_look_m_) < kLookM) return;
  frog_look_m_ = way_m_;
  for (const SettledThing& frog : frogs_.follow(frog_search_.find(picture), way_m_)) {
    const double pitch_m = pitch_error_m(picture, frog.reference_m, 0);
    report({LandmarkType::frog, picture.stamp_ns, frog.place_m - way_m_, frog.lateral_m,
            std::hypot(frog.sigma_m, frog.lasting_sigma_m, pitch_m), frog.confidence},
           picture);
  }
}

void LandmarkFinder::find_platforms(const LandmarkPicture& picture) {
  const bool frogs_took_this_picture = frog_look_m_ == way_m_;
  if (std::abs(way_m_ - platform_look_m_) < (frogs_took_this_picture ? 1.5 : 1.0) * kLookM) return;
  platform_look_m_ = way_m_;
  for (const SettledPlatform& end : platforms_.follow(platform_search_.find(picture), way_m_)) {
    if (uprights_.in_tunnel(way_m_) || uprights_.lit_walls()) continue;  // walls, ducts and lamps look like platforms
    const double ahead_m = end.place_m - way_m_;
    report({LandmarkType::platform, picture.stamp_ns, ahead_m, end.lateral_m,
            std::hypot(end.sigma_m,
                       way_past_sigma(options_, picture.pose.height_m) * (std::abs(ahead_m) + kOutOfPictureM)),
            1.0 - std::exp(-0.5 * end.pictures)},
           picture);
  }
}

void LandmarkFinder::find_uprights(const LandmarkPicture& picture) {
  const auto& found = upright_search_.find(picture);
  const auto& settled = edges_.follow(found, upright_search_.profile(), picture, way_m_);
  for (const UprightObject& object :
       uprights_.add(settled, edges_, shade_, way_m_, upright_search_.profile().beside_grey)) {
    report(sighting_of(object, way_m_, picture.stamp_ns, way_past_sigma(options_, picture.pose.height_m)), picture);
  }
}

void LandmarkFinder::report(Sighting sighting, const LandmarkPicture& picture) {
  if (sighting.confidence < options_.lowest_confidence) return;
  sighting.sigma_m *= picture.sigma_factor;
  sighting.frame_seq = picture.frame_seq;
  sighting.grabbed_ns = picture.grabbed_ns;
  sightings_.push_back(sighting);
}

}  // namespace railfix::track_detector
