#include "map_matcher/locate/way_walker.hpp"

#include <algorithm>
#include <cmath>
#include <memory>

namespace railfix::map_matcher {
namespace {

constexpr int kMostRunsAStep = 12;
constexpr double kSamePlaceM = 15.0;
constexpr double kMostBeyondM = 100.0;
constexpr double kNearlyAsGood = 20.0;  // a log likelihood

}  // namespace

/// The runs so far, newest first; walks share what they have in common.
struct WayWalker::Step {
  track::Run run;
  std::shared_ptr<const Step> before;
};

struct WayWalker::Walk {
  double into_m = 0;    // of the newest run
  double turn_rad = 0;  // of the present step
  TurnSum turns;
  double marks = 0;     // log likelihood
  double log = 0;       // of both
  double beyond_m = 0;  // of the end of the track
  std::shared_ptr<const Step> steps;
  [[nodiscard]] const track::Run& run() const { return steps->run; }
};

// One step of the way, with all ways at switches; negative = backwards in time.
void WayWalker::step(const Walk& from, double way_m, std::vector<Walk>& to, int depth) const {
  const track::Run& run = from.run();
  const double end_m = from.into_m + way_m;
  const double length_m = run.length_m();
  const bool within = end_m >= 0 && end_m <= length_m;
  const double border_m = within ? end_m : (way_m > 0 ? length_m : 0.0);
  const double turn_rad = from.turn_rad + index_.turned(run, border_m) - index_.turned(run, from.into_m);
  if (within) {
    to.push_back(from);
    to.back().into_m = end_m;
    to.back().turn_rad = turn_rad;
    return;
  }
  if (depth == 0) return;
  const auto go_on = [&](const track::Run& next_run) {
    Walk next = from;
    next.into_m = way_m > 0 ? 0.0 : next_run.length_m();
    next.turn_rad = turn_rad;
    next.beyond_m = 0;
    next.steps = std::make_shared<const Step>(Step{next_run, from.steps});
    step(next, way_m - (border_m - from.into_m), to, depth - 1);
  };
  const auto next_runs = way_m > 0 ? index_.ways().after(run) : index_.ways().before(run);
  for (const auto& next_run : next_runs) go_on(next_run);
  // The place is not known exactly: the end of the track may seem to be passed.
  const double beyond_m = from.beyond_m + std::abs(way_m - (border_m - from.into_m));
  if (!next_runs.empty() || beyond_m > kMostBeyondM) return;
  to.push_back(from);
  to.back().into_m = border_m;
  to.back().turn_rad = turn_rad;
  to.back().beyond_m = beyond_m;
}

// On the run of the step's beginning, or where it ended.
double WayWalker::of_marks(const Walk& before, const Walk& after, size_t bin, double scale, bool ahead,
                           double rough_m) const {
  const Walk& early = ahead ? before : after;
  const Walk& late = ahead ? after : before;
  double log = 0;
  for (const Mark& seen : model_.way()[bin].marks) {
    double likelihood = model_.of_false_mark();
    const auto look = [&](const track::Run& run, double at_m) {
      for (const Mark& mapped : index_.marks_on(run)) {
        if (alike(seen, mapped)) likelihood += model_.of_mark(mapped.along_m - at_m, rough_m);
      }
    };
    look(early.run(), early.into_m + scale * seen.along_m);
    if (!(late.run() == early.run())) look(late.run(), late.into_m - scale * (kBinM - seen.along_m));
    log += std::log(std::min(likelihood, 1.0));
  }
  return log;
}

std::vector<WayWalker::Walk> WayWalker::go(std::vector<Walk> walks, size_t bin, bool ahead, const Candidate& candidate,
                                           const Trial& trial, double least_log) {
  const double from_anchor_m = kBinM * std::abs(static_cast<double>(bin) - static_cast<double>(candidate.bin));
  const double rough_m = trial.rough_m + trial.rough_scale * from_anchor_m;
  const auto weigh = [&](const Walk& before, Walk& after) {
    // Behind the anchor the step was taken backwards: its turn counts the other way round.
    model_.add(after.turns, bin, (ahead ? 1 : -1) * after.turn_rad, rough_m);
    if (!model_.way()[bin].marks.empty()) {
      after.marks += of_marks(before, after, bin, candidate.scale, ahead, rough_m);
    }
    after.log = model_.log_of(after.turns) + after.marks;
  };
  compared_bins_ += walks.size();
  const double way_m = (ahead ? 1 : -1) * candidate.scale * kBinM;
  if (walks.size() == 1) {
    // Mostly: one walk, and no end of its run is near.
    Walk& walk = walks.front();
    const double into_m = walk.into_m + way_m;
    if (into_m >= 0 && into_m <= walk.run().length_m()) {
      Walk before = walk;
      walk.turn_rad = index_.turned(walk.run(), into_m) - index_.turned(walk.run(), walk.into_m);
      walk.into_m = into_m;
      weigh(before, walk);
      if (walk.log < least_log) walks.clear();
      return walks;
    }
  }
  std::vector<Walk> next;
  for (const Walk& walk : walks) {
    Walk from = walk;
    from.turn_rad = 0;
    const size_t first = next.size();
    step(from, way_m, next, kMostRunsAStep);
    for (size_t i = first; i < next.size(); ++i) weigh(from, next[i]);
  }
  std::erase_if(next, [&](const Walk& w) { return w.log < least_log; });
  if (next.size() < 2) return next;
  std::sort(next.begin(), next.end(), [](const Walk& a, const Walk& b) { return a.log > b.log; });
  // Ways that have met again are one from here on.
  std::vector<Walk> kept;
  for (const Walk& w : next) {
    const bool met = std::any_of(kept.begin(), kept.end(), [&](const Walk& k) {
      return k.run() == w.run() && std::abs(k.into_m - w.into_m) < kSamePlaceM;
    });
    if (met) continue;
    if (kept.size() == trial.most_ways) {
      cut_ = cut_ || w.log > kept.front().log - kNearlyAsGood;
      break;
    }
    kept.push_back(w);
  }
  return kept;
}

std::vector<WalkedWay> WayWalker::follow(const Candidate& candidate, const Trial& trial, double least_log) {
  cut_ = false;
  Walk anchor;
  anchor.into_m = candidate.into_m;
  anchor.turns = model_.begin();
  anchor.steps = std::make_shared<const Step>(Step{candidate.run, nullptr});
  std::vector<Walk> behind{anchor};
  for (size_t i = candidate.bin; i > 0 && !behind.empty(); --i) {
    behind = go(std::move(behind), i - 1, false, candidate, trial, least_log);
  }
  if (behind.empty()) return {};
  std::vector<Walk> ahead{anchor};
  for (size_t i = candidate.bin; i < model_.way().size() && !ahead.empty(); ++i) {
    ahead = go(std::move(ahead), i, true, candidate, trial, least_log - behind.front().log);
  }
  std::vector<WalkedWay> ways;
  for (const Walk& before : behind) {
    for (const Walk& after : ahead) {
      if (before.log + after.log >= least_log) ways.push_back(joined(before, after, candidate));
    }
  }
  std::sort(ways.begin(), ways.end(), [](const WalkedWay& a, const WalkedWay& b) { return a.log > b.log; });
  if (ways.size() > trial.most_ways) {
    cut_ = cut_ || ways[trial.most_ways].log > ways.front().log - kNearlyAsGood;
    ways.resize(trial.most_ways);
  }
  return ways;
}

WalkedWay WayWalker::joined(const Walk& behind, const Walk& ahead, const Candidate& candidate) {
  WalkedWay way{{}, candidate.into_m, candidate.bin, candidate.scale, behind.log + ahead.log};
  for (const Step* s = behind.steps.get(); s != nullptr; s = s->before.get()) way.runs.push_back(s->run);
  for (size_t i = 0; i + 1 < way.runs.size(); ++i) way.anchor_m += way.runs[i].length_m();
  const auto at = static_cast<std::ptrdiff_t>(way.runs.size());
  for (const Step* s = ahead.steps.get(); s->before != nullptr; s = s->before.get()) {
    way.runs.insert(way.runs.begin() + at, s->run);
  }
  return way;
}

}  // namespace railfix::map_matcher
