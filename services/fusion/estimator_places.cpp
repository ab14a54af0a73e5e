// Fixes: what says where on the map the train is.
#include <algorithm>
#include <cmath>

#include "core/time.hpp"
#include "fusion/estimator.hpp"
#include "fusion/jump_evidence.hpp"

namespace railfix::fusion {
namespace {

constexpr double kSurprisingSigmas = 3.0;
constexpr double kForgotten = 2.0;  // of a landmark's sigmas is the place's when the way since has outgrown it
constexpr double kBesideLandmarkS = 1.0;
constexpr double kBendsHereM = 3.0;  // in a window of some 50 m to either side that is rarely by chance
constexpr int kCurvesConfirm = 3;    // ... a place that was only told
constexpr double kCorrectedM = 5.0;
constexpr double kAsFarM = 3.0;
constexpr double kElsewhereM = 10.0;     // a second fix nearer than that to the first may be wrong as that one is
constexpr double kSameSigmas = 4.0;      // two that say the same are no further apart, ...
constexpr double kSameDriftPerM = 0.04;  // ... but for what the scales may be wrong by on the way between
constexpr double kLoose = 3.0;           // times by what ways differ: then a fix moves the place and hardly a scale

double fix_sigma_m(const FixInput& fix, const FusionParameters& p) {
  return std::max(fix.sigma_m, p.fix_sigma_floor_m);
}

}  // namespace

void Estimator::use_track(const FixInput& fix) {
  if (fix.new_path) {
    place_.path = fix.new_path;
    place_.track_doubt.changed();
    compare_turns();
    place_.joined.add(fix.otherwise);
    // What was seen beside the old way lies on the new one: it spoke for it.
    if (off_path_ && place_.path->distance_of(*off_path_, filter_.path_distance_m())) {
      off_path_.reset();
      place_.track_doubt.seen_here();
    }
  }
  // What is said of another track is no more than its rest for this one.
  const double here_m = filter_.path_distance_m();
  const auto of_m = place_.path->distance_of({fix.edge, fix.offset_m, fix.direction}, here_m);
  // A word that comes beside a landmark is of before it.
  place_.wrong_place.said(fix.sightings_fit == SightingsFit::nowhere &&
                          !used_within(Source::landmark, kBesideLandmarkS));
  place_.track_doubt.said(of_m ? fix.probability : std::min(fix.probability, 1 - fix.probability), of_m, here_m);
  if (of_m) hold_other_ways(fix, *of_m, here_m);
}

// Who says it follows the place that fusion has told: what it is off by is a correction of a moment ago, or more than
// that, and then nobody knows who is right. Ways that were named once stay: who does not name them any more may have
// been started anew.
void Estimator::hold_other_ways(const FixInput& fix, double place_m, double here_m) {
  const double off_m = std::abs(place_m - here_m) > kCorrectedM ? place_m - here_m : 0;
  const Sides said{std::max(0.0, fix.otherwise.behind_m - off_m), std::max(0.0, fix.otherwise.ahead_m + off_m)};
  const bool named = fix.otherwise.behind_m > 0 || fix.otherwise.ahead_m > 0;
  if (named) place_.other_ways.hold(said);
  place_.said_elsewhere = named ? Sides{} : said;
}

Sides Estimator::named_ways() const {
  Sides ways = place_.joined;
  ways.hold(place_.other_ways);
  return ways;
}

Sides Estimator::held_ways() const {
  Sides ways = named_ways();
  ways.hold(place_.said_elsewhere);
  return ways;
}

// Where another one of its kind stands just where it would be over the other way, it was that one as well.
bool Estimator::tells_ways_apart(const FixInput& fix) const {
  const Sides ways = held_ways();
  if (fix.kind != FixKind::landmark || ways.behind_m + ways.ahead_m == 0) return true;
  const auto place_m = place_.path->distance_of({fix.edge, fix.offset_m, fix.direction}, filter_.path_distance_m());
  if (!place_m) return true;
  const auto* seen = place_.path->map().landmark(fix.landmark);
  if (seen == nullptr) return true;
  const auto stands_at = [&](double m) {
    return std::ranges::any_of(place_.path->landmarks_between(m - kAsFarM, m + kAsFarM),
                               [&](const track::PathLandmark& other) { return other.landmark->kind == seen->kind; });
  };
  return !(ways.behind_m > 0 && stands_at(*place_m - ways.behind_m)) &&
         !(ways.ahead_m > 0 && stands_at(*place_m + ways.ahead_m));
}

void Estimator::use(const FixInput& fix) {
  if (fix.kind == FixKind::track) {
    if (place_.path) use_track(fix);
    return;
  }
  watched(fix.kind == FixKind::curvature ? Source::curvature : Source::landmark).seen_ns = fix.stamp_ns;
  if (fix.new_path) {
    place_.path = fix.new_path;
    place_.given_up.reset();
    filter_.set_origin(0, fix_sigma_m(fix, *parameters_));
    place_.track_doubt = {};
    place_.track_doubt.said(fix.probability, std::nullopt, filter_.path_distance_m());
    accept(fix);
    if (fix.of_before) doubt_points_behind();
    place_.told_by = fix.kind == FixKind::gnss ? ToldBy::gnss : fix.only_told ? ToldBy::start : ToldBy::nobody;
    place_.bends_agreed = 0;
    if (fix.in_doubt) place_.wrong_place.doubt();
    return;
  }
  if (!place_.path || fix.kind == FixKind::gnss || fix.probability < parameters_->fix_min_probability) return;
  if (place_.wrong_place.lost() && fix.kind == FixKind::curvature) return;  // some curve fits in every window so wide
  const track::EdgePosition place{fix.edge, fix.offset_m, fix.direction};
  const auto path_distance_m = place_.path->distance_of(place, filter_.path_distance_m());
  if (!path_distance_m) {
    off_path_ = place;
    place_.track_doubt.seen_elsewhere(fix.probability);
    disagrees(fix);
    return;
  }
  const double sigma_m = fix_sigma_m(fix, *parameters_);
  const auto lasting = fix.kind == FixKind::curvature ? std::optional(StateIndex::shape_error) : std::nullopt;
  fix_again_ = has_met(fix.landmark) && filter_.path_sigma_m() < kForgotten * sigma_m;
  fix_offer_ =
      fix_again_ ? offer_place_again(*path_distance_m, sigma_m) : offer_place({*path_distance_m, sigma_m, lasting});
  if (fix_offer_.used) {
    corrected_ = false;
    accept(fix);
    if (fix_used() && fix.kind == FixKind::landmark && !fix_again_) {
      ++place_.landmarks_agreed;
      confirm_by(fix);
      doubt_surprise(fix.sigma_m);
    }
  } else {
    disagrees(fix);
    refuse(fix, *path_distance_m, fix_offer_);
  }
}

// Once so many in a row have agreed they are believed, whatever one says later.
void Estimator::disagrees(const FixInput& fix) {
  const bool believed = place_.landmarks_agreed >= kLandmarksBelieved;
  if (fix.kind == FixKind::landmark && !believed) place_.landmarks_agreed = 0;
}

bool Estimator::has_met(uint32_t landmark) const {
  return landmark != 0 && std::ranges::find(place_.met, landmark) != place_.met.end();
}

bool Estimator::fix_unexpected() const {
  return fix_refused() || fix_sigmas_off(0) >= kUnlikelySigmas;
}

double Estimator::fix_sigmas_off(double excused_m) const {
  const double off_m = std::abs(fix_offer_.residual);
  return off_m > excused_m ? std::sqrt(fix_offer_.nis) * (1 - excused_m / off_m) : 0;
}

// No further off than the train would be over the way that is followed, over one that was named or between them. A
// place that map_matcher says without naming a way to it is none: its landmarks say the same, and who is wrong is not
// known.
bool Estimator::fits_a_named_way(const MeasuredPlace& place) const {
  const Sides ways = named_ways();
  if (ways.behind_m + ways.ahead_m == 0) return false;
  const auto offer = filter_.test_position(place.path_distance_m, place.sigma_m, parameters_->gate_fix);
  const double way_m = offer.residual < 0 ? ways.behind_m : ways.ahead_m;
  return offer.used || std::abs(offer.residual) * (1 - parameters_->gate_fix / std::sqrt(offer.nis)) < way_m;
}

// While other ways are named, a fix that fits one of them says where the train is and not the filter, and says nothing
// of the scales. So it does where more is in doubt than a vague fix leaves open: else it would end the doubt and move
// nothing. What a sharp one leaves open is little anyway.
Offer Estimator::offer_place(const MeasuredPlace& place) {
  if (fits_a_named_way(place)) {
    const Sides ways = named_ways();
    filter_.loosen_origin(kLoose * std::max(ways.behind_m, ways.ahead_m));
    return filter_.offer_position(place, parameters_->gate_fix);
  }
  const double doubted_m = place.lasting ? doubted_beyond_sigma_m() : 0;
  if (doubted_m <= parameters_->interval_factor * place.sigma_m) {
    return filter_.offer_position(place, parameters_->gate_fix);
  }
  const auto offer = MotionFilter(filter_).offer_position(place, parameters_->gate_fix);
  if (!offer.used) return offer;
  filter_.loosen_origin(doubted_m / parameters_->interval_factor);
  filter_.offer_position(place, parameters_->gate_fix);
  return offer;
}

// What the map has wrong about a landmark is in the place already since it was met: no number of sightings makes that
// surer than one (the bound of covariance intersection, Julier and Uhlmann 1997).
Offer Estimator::offer_place_again(double path_distance_m, double sigma_m) {
  const auto offer = filter_.test_position(path_distance_m, sigma_m, parameters_->gate_fix);
  const double news = 1 / (sigma_m * sigma_m) - 1 / (filter_.path_sigma_m() * filter_.path_sigma_m());
  if (offer.used && news > 0) filter_.offer_position({path_distance_m, 1 / std::sqrt(news)}, parameters_->gate_fix);
  return offer;
}

double Estimator::doubted_beyond_sigma_m() const {
  const auto promised = context_.unwidened ? interval() : widened(interval());
  return std::max(centre_m() - promised.rear_m, promised.front_m - centre_m()) - known_to_m() + context_.excess_m;
}

void Estimator::accept(const FixInput& fix) {
  watched(fix.kind == FixKind::curvature ? Source::curvature : Source::landmark).accept(fix.stamp_ns);
  off_path_.reset();
  // Some curve may fit at a place that nobody has confirmed, though the train turns otherwise than the track there.
  const bool far_off = place_.told_by == ToldBy::start || place_.told_by == ToldBy::gnss;
  const bool by_chance = fix.kind == FixKind::curvature && (far_off || place_.track_doubt.turns_otherwise());
  const bool searched = fix.kind == FixKind::network || fix.kind == FixKind::gnss;
  if (!by_chance) {
    searched ? place_.track_doubt.found_here() : place_.track_doubt.seen_here();
    place_.turned_way.corrected(fix_offer_.residual);
    compare_turns();
  }
  const bool bends_here = fix.kind == FixKind::curvature && std::abs(fix_offer_.residual) < kBendsHereM;
  if (by_chance && bends_here) place_.wrong_place.bends_here();
  if (bends_here) confirm_by_curve(fix.tells_track);
  if (fix.kind == FixKind::network) place_.told_by = ToldBy::nobody;
  // A vague fix helps, but settles no doubt and is nothing to measure a distance from. Landmarks are sharp by
  // themselves.
  if (fix.kind != FixKind::landmark && fix.sigma_m > 2 * filter_.path_sigma_m()) return;
  fix_verdict_ = FixVerdict::used;
  refused_fix_.reset();
  if (!by_chance) place_.wrong_place.found();
  doubts_ = {};
  if (tells_ways_apart(fix)) place_.joined = place_.other_ways = place_.said_elsewhere = {};
  if (!context_.unwidened || fix.kind != FixKind::curvature) unwatched_ = {.distance_m = unwatched_.distance_m};
  place_.fix_m = distance_m();
  mark_reference(fix);
  if (fix.landmark != 0 && !has_met(fix.landmark)) {
    std::rotate(place_.met.begin(), place_.met.end() - 1, place_.met.end());
    place_.met.front() = fix.landmark;
  }
}

// What the track's shape tells may be good for the place and still vaguer than the budget is where it begins: such a
// place is none to count it from.
void Estimator::mark_reference(const FixInput& fix) {
  const auto& p = *parameters_;
  const bool sharp = p.interval_factor * filter_.path_sigma_m() + p.interval_floor_m <= p.budget_m;
  if (fix.kind == FixKind::curvature && !sharp) return;
  place_.reference = fix.landmark;
  place_.reference_m = distance_m();
}

void Estimator::refer_back(double since_reference_m) {
  place_.fix_m = place_.reference_m = distance_m() - since_reference_m;
}

bool Estimator::confirms_start(bool tells_track) {
  if (!is_only_told()) return false;
  place_.alike_beside = place_.alike_beside || !tells_track;
  return tells_track;
}

// Any number of masts fits where others stand as far apart: map_matcher says when no other place near would have given
// the same, and behind five in a row what is no mast tells. GNSS is never so far off.
void Estimator::confirm_by(const FixInput& landmark) {
  if (is_only_told() && !confirms_start(landmark.tells_track)) return;
  const auto* seen = place_.path->map().landmark(landmark.landmark);
  const bool tells = seen != nullptr && seen->kind != track::LandmarkKind::mast;
  const bool confirms =
      landmark.sightings_fit == SightingsFit::here || (tells && place_.landmarks_agreed >= kLandmarksBelieved);
  if (place_.told_by != ToldBy::start || confirms) place_.told_by = ToldBy::nobody;
}

// One may fit by chance, and there is none on a straight line that lies elsewhere.
void Estimator::confirm_by_curve(bool tells_track) {
  if (place_.told_by != ToldBy::start_and_gnss && !confirms_start(tells_track)) return;
  place_.bends_agreed = place_.track_doubt.turns_otherwise() ? 0 : place_.bends_agreed + 1;
  if (place_.bends_agreed >= kCurvesConfirm) place_.told_by = ToldBy::nobody;
}

double Estimator::reach_m(const Offer& offer, double sigma_m) const {
  return std::abs(offer.residual) + parameters_->interval_factor * sigma_m;
}

// It or the one before is wrong by more than it says, or both are: what makes one err makes its neighbour err alike.
// Until the next one.
void Estimator::doubt_surprise(double sigma_m) {
  if (fix_sigmas_off(context_.excess_m) < kSurprisingSigmas) return;
  const double reach_m = this->reach_m(fix_offer_, sigma_m);
  doubts_.refused = {reach_m, reach_m};
}

// One fix alone never moves the train against the filter; a second one elsewhere that says the same does.
void Estimator::refuse(const FixInput& fix, double path_distance_m, const Offer& offer) {
  const double distance_m = filter_.value(StateIndex::distance);
  if (refused_fix_ && std::abs(distance_m - refused_fix_->distance_m) > kElsewhereM) {
    const double drift_m = kSameDriftPerM * std::abs(distance_m - refused_fix_->distance_m);
    const double apart_m = std::abs(offer.residual - refused_fix_->residual_m);
    if (apart_m < kSameSigmas * std::hypot(fix.sigma_m, refused_fix_->sigma_m) + drift_m) {
      // What was wrong may have taught a wrong scale, too.
      filter_.loosen_origin(std::abs(offer.residual) + fix.sigma_m);
      filter_.loosen_scale(*parameters_);
      filter_.offer_position({path_distance_m, fix_sigma_m(fix, *parameters_)}, parameters_->gate_fix);
      corrected_ = true;
      accept(fix);
      // Either side: what told where to look for these two was wrong by as much. Until a third one agrees.
      const double reach_m = this->reach_m(offer, fix.sigma_m);
      doubts_.refused = {reach_m, reach_m};
      fix_verdict_ = FixVerdict::corrected;
      place_.landmarks_agreed = fix.kind == FixKind::landmark ? 2 : 0;
      if (fix.kind == FixKind::landmark) confirm_by(fix);
      return;
    }
  }
  fix_verdict_ = FixVerdict::refused;
  refused_fix_ = RefusedFix{offer.residual, fix.sigma_m, distance_m};
  auto& doubt_m = offer.residual < 0 ? doubts_.refused.behind_m : doubts_.refused.ahead_m;
  doubt_m = std::max(doubt_m, reach_m(offer, fix.sigma_m));
}

}  // namespace railfix::fusion
