// Fixes: what says where on the map the train is.
#include <algorithm>
#include <cmath>

#include "fusion/map_place.hpp"

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

}  // namespace

double MapPlace::fix_sigma_m(const FixInput& fix) const {
  return std::max(fix.sigma_m, parameters_->fix_sigma_floor_m);
}

void MapPlace::use(const FixInput& fix, const FixContext& context, TrainMotion& motion) {
  if (fix.kind == FixKind::track) {
    if (known_.path) use_track(fix, motion);
    return;
  }
  watch_of(fix).seen_ns = fix.stamp_ns;
  if (fix.new_path) {
    begin_with(fix, context, motion);
    return;
  }
  if (!known_.path || fix.kind == FixKind::gnss || fix.probability < parameters_->fix_min_probability) return;
  // Some curve fits in every window so wide.
  if (known_.wrong_place.lost() && fix.kind == FixKind::curvature) return;
  const track::EdgePosition place{fix.edge, fix.offset_m, fix.direction};
  const auto path_distance_m = known_.path->distance_of(place, motion.filter().path_distance_m());
  if (path_distance_m) {
    compare(fix, *path_distance_m, context, motion);
    return;
  }
  off_path_ = place;
  known_.track_doubt.seen_elsewhere(fix.probability);
  known_.told.disagrees(fix);
}

void MapPlace::use_track(const FixInput& fix, const TrainMotion& motion) {
  const auto& filter = motion.filter();
  if (fix.new_path) {
    known_.path = fix.new_path;
    known_.track_doubt.changed();
    compare_turns(motion);
    known_.other_ways.join(fix.otherwise);
    // What was seen beside the old way lies on the new one: it spoke for it.
    if (off_path_ && known_.path->distance_of(*off_path_, filter.path_distance_m())) {
      off_path_.reset();
      known_.track_doubt.seen_here();
    }
  }
  // What is said of another track is no more than its rest for this one.
  const double here_m = filter.path_distance_m();
  const auto of_m = known_.path->distance_of({fix.edge, fix.offset_m, fix.direction}, here_m);
  // A word that comes beside a landmark is of before it.
  known_.wrong_place.said(fix.sightings_fit == SightingsFit::nowhere &&
                          !landmarks_.used_within(kBesideLandmarkS, filter.stamp_ns()));
  known_.track_doubt.said(of_m ? fix.probability : std::min(fix.probability, 1 - fix.probability), of_m, here_m);
  if (of_m) known_.other_ways.said(fix.otherwise, *of_m - here_m);
}

void MapPlace::begin_with(const FixInput& fix, const FixContext& context, TrainMotion& motion) {
  known_.path = fix.new_path;
  known_.given_up.reset();
  motion.filter().set_origin(0, fix_sigma_m(fix));
  known_.track_doubt = {};
  known_.track_doubt.said(fix.probability, std::nullopt, motion.filter().path_distance_m());
  accept(fix, context, motion);
  if (fix.of_before) doubt_points_behind(motion);
  tell(fix.kind == FixKind::gnss ? ToldBy::gnss : fix.only_told ? ToldBy::start : ToldBy::nobody, motion);
  if (fix.in_doubt) known_.wrong_place.doubt();
}

void MapPlace::compare(const FixInput& fix, double path_distance_m, const FixContext& context, TrainMotion& motion) {
  const auto lasting = fix.kind == FixKind::curvature ? std::optional(StateIndex::shape_error) : std::nullopt;
  const MeasuredPlace place{path_distance_m, fix_sigma_m(fix), lasting};
  fix_.again = has_met(fix.landmark) && motion.filter().path_sigma_m() < kForgotten * place.sigma_m;
  fix_.offer = fix_.again ? offer_again(place, motion.filter()) : offer(place, context, motion);
  if (!fix_.offer.used) {
    known_.told.disagrees(fix);
    refuse(fix, path_distance_m, context, motion);
    return;
  }
  corrected_ = false;
  const bool is_new = fix.kind == FixKind::landmark && !fix_.again;
  if (is_new) known_.told.agrees(fix);
  accept(fix, context, motion);
  if (!is_new) return;
  // It or the one before is wrong by more than it says, or both are: what makes one err makes its neighbour err alike.
  // Until the next one.
  if (fix_.sigmas_off(context.excess_m) >= kSurprisingSigmas) claimed_ = {reach_m(fix.sigma_m), reach_m(fix.sigma_m)};
}

bool MapPlace::has_met(uint32_t landmark) const {
  return landmark != 0 && std::ranges::find(known_.met, landmark) != known_.met.end();
}

// No further off than the train would be over the way that is followed, over one that was named or between them. A
// place that map_matcher says without naming a way to it is none: its landmarks say the same, and who is wrong is not
// known.
bool MapPlace::fits_a_named_way(const MeasuredPlace& place, const MotionFilter& filter) const {
  const Sides ways = known_.other_ways.named();
  if (ways.behind_m + ways.ahead_m == 0) return false;
  const auto offer = filter.test_position(place.path_distance_m, place.sigma_m, parameters_->gate_fix);
  const double way_m = offer.residual < 0 ? ways.behind_m : ways.ahead_m;
  return offer.used || std::abs(offer.residual) * (1 - parameters_->gate_fix / std::sqrt(offer.nis)) < way_m;
}

// While other ways are named, a fix that fits one of them says where the train is and not the filter, and says nothing
// of the scales. So it does where more is in doubt than a vague fix leaves open: else it would end the doubt and move
// nothing. What a sharp one leaves open is little anyway.
Offer MapPlace::offer(const MeasuredPlace& place, const FixContext& context, TrainMotion& motion) const {
  auto& filter = motion.filter();
  const double gate = parameters_->gate_fix;
  if (fits_a_named_way(place, filter)) {
    const Sides ways = known_.other_ways.named();
    filter.loosen_origin(kLoose * std::max(ways.behind_m, ways.ahead_m));
    return filter.offer_position(place, gate);
  }
  const double doubted_m = place.lasting ? this->doubted_m(context, motion) : 0;
  if (doubted_m <= parameters_->interval_factor * place.sigma_m) return filter.offer_position(place, gate);
  const auto offer = MotionFilter(filter).offer_position(place, gate);
  if (!offer.used) return offer;
  filter.loosen_origin(doubted_m / parameters_->interval_factor);
  filter.offer_position(place, gate);
  return offer;
}

// What the map has wrong about a landmark is in the place already since it was met: no number of sightings makes that
// surer than one (the bound of covariance intersection, Julier and Uhlmann 1997).
Offer MapPlace::offer_again(const MeasuredPlace& place, MotionFilter& filter) const {
  const auto offer = filter.test_position(place.path_distance_m, place.sigma_m, parameters_->gate_fix);
  const double news = 1 / (place.sigma_m * place.sigma_m) - 1 / (filter.path_sigma_m() * filter.path_sigma_m());
  if (offer.used && news > 0) {
    filter.offer_position({place.path_distance_m, 1 / std::sqrt(news)}, parameters_->gate_fix);
  }
  return offer;
}

// Some curve fits at a place that nobody has confirmed, though the train turns otherwise than the track there; and some
// landmark, where masts stand everywhere, at a start that nobody has.
bool MapPlace::may_fit_by_chance(const FixInput& fix) const {
  const auto& told = known_.told;
  if (fix.kind == FixKind::landmark) return told.may_be_elsewhere();
  if (fix.kind != FixKind::curvature) return false;
  return told.is_only_told() || told.by() == ToldBy::gnss || known_.track_doubt.turns_otherwise();
}

// It was sighted here, perhaps by chance, or was searched for and is here most likely.
void MapPlace::speak_for_track(const FixInput& fix, bool by_chance, const TrainMotion& motion) {
  if (!by_chance) {
    const bool searched = fix.kind == FixKind::network || fix.kind == FixKind::gnss;
    searched ? known_.track_doubt.found_here() : known_.track_doubt.seen_here();
  } else if (fix.kind == FixKind::landmark) {
    known_.track_doubt.may_be_here();
    known_.wrong_place.may_be_here();
  } else {
    return;
  }
  known_.turned_way.corrected(fix_.offer.residual);
  compare_turns(motion);
}

void MapPlace::accept(const FixInput& fix, const FixContext& context, TrainMotion& motion) {
  const auto& filter = motion.filter();
  watch_of(fix).accept(fix.stamp_ns);
  off_path_.reset();
  const bool by_chance = may_fit_by_chance(fix);
  speak_for_track(fix, by_chance, motion);
  const bool bends_here = fix.kind == FixKind::curvature && std::abs(fix_.offer.residual) < kBendsHereM;
  if (by_chance && bends_here) known_.wrong_place.forget_turning();
  if (bends_here) known_.told.curve_agrees(fix.tells_track, known_.track_doubt.turns_otherwise());
  if (fix.kind == FixKind::network) known_.told.confirm();
  // A vague fix helps, but settles no doubt and is nothing to measure a distance from. Landmarks are sharp by
  // themselves.
  if (fix.kind != FixKind::landmark && fix.sigma_m > 2 * filter.path_sigma_m()) return;
  fix_.verdict = FixOutcome::Verdict::used;
  refused_.reset();
  if (!by_chance) known_.wrong_place.found();
  settle(fix, context, motion);
}

// Where the train is, is known now.
void MapPlace::settle(const FixInput& fix, const FixContext& context, TrainMotion& motion) {
  motion.settle_doubts();
  if (!context.unwidened || fix.kind != FixKind::curvature) motion.settle_unwatched();
  claimed_ = gnss_.held = {};
  const double here_m = motion.filter().path_distance_m();
  if (known_.other_ways.told_apart_by(fix, *known_.path, here_m)) known_.other_ways = {};
  known_.fix_m = motion.distance_m();
  mark_reference(fix, motion);
  if (fix.landmark == 0 || has_met(fix.landmark)) return;
  std::rotate(known_.met.begin(), known_.met.end() - 1, known_.met.end());
  known_.met.front() = fix.landmark;
}

// What the track's shape tells may be good for the place and still vaguer than the budget is where it begins: such a
// place is none to count it from.
void MapPlace::mark_reference(const FixInput& fix, const TrainMotion& motion) {
  const auto& p = *parameters_;
  const bool sharp = p.interval_factor * motion.filter().path_sigma_m() + p.interval_floor_m <= p.budget_m;
  if (fix.kind == FixKind::curvature && !sharp) return;
  known_.reference = fix.landmark;
  known_.reference_m = motion.distance_m();
}

double MapPlace::reach_m(double sigma_m) const {
  return std::abs(fix_.offer.residual) + parameters_->interval_factor * sigma_m;
}

// One fix alone never moves the train against the filter; a second one elsewhere that says the same does.
void MapPlace::refuse(const FixInput& fix, double path_distance_m, const FixContext& context, TrainMotion& motion) {
  if (says_as_refused(fix, motion.distance_m())) {
    move_to(fix, path_distance_m, context, motion);
    return;
  }
  fix_.verdict = FixOutcome::Verdict::refused;
  refused_ = RefusedFix{fix_.offer.residual, fix.sigma_m, motion.distance_m()};
  auto& claimed_m = fix_.offer.residual < 0 ? claimed_.behind_m : claimed_.ahead_m;
  claimed_m = std::max(claimed_m, reach_m(fix.sigma_m));
}

bool MapPlace::says_as_refused(const FixInput& fix, double distance_m) const {
  if (!refused_) return false;
  const double way_m = std::abs(distance_m - refused_->distance_m);
  const double apart_m = std::abs(fix_.offer.residual - refused_->residual_m);
  const double same_m = kSameSigmas * std::hypot(fix.sigma_m, refused_->sigma_m) + kSameDriftPerM * way_m;
  return way_m > kElsewhereM && apart_m < same_m;
}

void MapPlace::move_to(const FixInput& fix, double path_distance_m, const FixContext& context, TrainMotion& motion) {
  // What was wrong may have taught a wrong scale, too.
  motion.filter().loosen_origin(std::abs(fix_.offer.residual) + fix.sigma_m);
  motion.filter().loosen_scale(*parameters_);
  motion.filter().offer_position({path_distance_m, fix_sigma_m(fix)}, parameters_->gate_fix);
  corrected_ = true;
  // How it turned was held against the place before.
  known_.track_doubt.changed();
  known_.turned_way.clear();
  known_.wrong_place.forget_turning();
  known_.told.moved_to(fix);
  accept(fix, context, motion);
  // Either side: what told where to look for these two was wrong by as much. Until a third one agrees.
  claimed_ = {reach_m(fix.sigma_m), reach_m(fix.sigma_m)};
  fix_.verdict = FixOutcome::Verdict::corrected;
}

}  // namespace railfix::fusion
