// Fixes: what says where on the map the train is.
#include <algorithm>
#include <cmath>

#include "core/time.hpp"
#include "fusion/estimator.hpp"

namespace railfix::fusion {
namespace {

constexpr double kSurprisingSigmas = 3.0;
constexpr double kForgotten = 2.0;  // of a landmark's sigmas is the place's when the way since has outgrown it
constexpr double kBesideLandmarkS = 1.0;
constexpr double kBendsHereM = 3.0;      // in a window of some 50 m to either side that is rarely by chance
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
    place_.other_ways.join(fix.otherwise);
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
  if (of_m) place_.other_ways.said(fix.otherwise, *of_m - here_m);
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
    place_.told.tell(fix.kind == FixKind::gnss ? ToldBy::gnss : fix.only_told ? ToldBy::start : ToldBy::nobody);
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
    place_.told.disagrees(fix);
    return;
  }
  const double sigma_m = fix_sigma_m(fix, *parameters_);
  const auto lasting = fix.kind == FixKind::curvature ? std::optional(StateIndex::shape_error) : std::nullopt;
  fix_.again = has_met(fix.landmark) && filter_.path_sigma_m() < kForgotten * sigma_m;
  fix_.offer =
      fix_.again ? offer_place_again(*path_distance_m, sigma_m) : offer_place({*path_distance_m, sigma_m, lasting});
  if (fix_.offer.used) {
    corrected_ = false;
    accept(fix);
    if (fix_.used() && fix.kind == FixKind::landmark && !fix_.again) {
      place_.told.agrees(fix);
      doubt_surprise(fix.sigma_m);
    }
  } else {
    place_.told.disagrees(fix);
    refuse(fix, *path_distance_m, fix_.offer);
  }
}

bool Estimator::has_met(uint32_t landmark) const {
  return landmark != 0 && std::ranges::find(place_.met, landmark) != place_.met.end();
}

// No further off than the train would be over the way that is followed, over one that was named or between them. A
// place that map_matcher says without naming a way to it is none: its landmarks say the same, and who is wrong is not
// known.
bool Estimator::fits_a_named_way(const MeasuredPlace& place) const {
  const Sides ways = place_.other_ways.named();
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
    const Sides ways = place_.other_ways.named();
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
  const bool far_off = place_.told.is_only_told() || place_.told.by() == ToldBy::gnss;
  const bool by_chance = fix.kind == FixKind::curvature && (far_off || place_.track_doubt.turns_otherwise());
  const bool searched = fix.kind == FixKind::network || fix.kind == FixKind::gnss;
  if (!by_chance) {
    searched ? place_.track_doubt.found_here() : place_.track_doubt.seen_here();
    place_.turned_way.corrected(fix_.offer.residual);
    compare_turns();
  }
  const bool bends_here = fix.kind == FixKind::curvature && std::abs(fix_.offer.residual) < kBendsHereM;
  if (by_chance && bends_here) place_.wrong_place.bends_here();
  if (bends_here) place_.told.curve_agrees(fix.tells_track, place_.track_doubt.turns_otherwise());
  if (fix.kind == FixKind::network) place_.told.confirm();
  // A vague fix helps, but settles no doubt and is nothing to measure a distance from. Landmarks are sharp by
  // themselves.
  if (fix.kind != FixKind::landmark && fix.sigma_m > 2 * filter_.path_sigma_m()) return;
  fix_.verdict = FixOutcome::Verdict::used;
  refused_fix_.reset();
  if (!by_chance) place_.wrong_place.found();
  doubts_ = {};
  gap_.settle();
  if (place_.other_ways.told_apart_by(fix, *place_.path, filter_.path_distance_m())) place_.other_ways = {};
  if (!context_.unwidened || fix.kind != FixKind::curvature) unwatched_.settle();
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

double Estimator::reach_m(const Offer& offer, double sigma_m) const {
  return std::abs(offer.residual) + parameters_->interval_factor * sigma_m;
}

// It or the one before is wrong by more than it says, or both are: what makes one err makes its neighbour err alike.
// Until the next one.
void Estimator::doubt_surprise(double sigma_m) {
  if (fix_.sigmas_off(context_.excess_m) < kSurprisingSigmas) return;
  const double reach_m = this->reach_m(fix_.offer, sigma_m);
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
      fix_.verdict = FixOutcome::Verdict::corrected;
      place_.told.moved_to(fix);
      return;
    }
  }
  fix_.verdict = FixOutcome::Verdict::refused;
  refused_fix_ = RefusedFix{offer.residual, fix.sigma_m, distance_m};
  auto& doubt_m = offer.residual < 0 ? doubts_.refused.behind_m : doubts_.refused.ahead_m;
  doubt_m = std::max(doubt_m, reach_m(offer, fix.sigma_m));
}

}  // namespace railfix::fusion
