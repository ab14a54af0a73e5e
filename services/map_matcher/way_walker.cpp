#include "map_matcher/way_walker.hpp"

#include <algorithm>
#include <cmath>
#include <memory>

namespace railfix::map_matcher {
namespace {

constexpr int kMostRunsAStep = 12;
constexpr double kSamePlaceM = 15.0;
constexpr double kMostBeyondM = 100.0;

}  // namespace

/// The runs so far, newest first; walks share what they have in common.
struct WayWalker::Step {
  track::Run run;
  std::shared_ptr<const Step> before;
};

struct WayWalker::Walk {
  double into_m = 0;    // of the newest run
  double turn_rad = 0;  // of the present step
  double log = 0;
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
    Walk next{way_m > 0 ? 0.0 : next_run.length_m(), turn_rad, from.log, 0,
              std::make_shared<const Step>(Step{next_run, from.steps})};
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
double WayWalker::of_balises(const Walk& before, const Walk& after, size_t bin, double scale, bool ahead) const {
  const Walk& early = ahead ? before : after;
  const Walk& late = ahead ? after : before;
  double log = 0;
  for (const double balise_m : model_.way()[bin].balises_m) {
    std::vector<double> distances_m;
    const auto look = [&](const track::Run& run, double into_m) {
      const double offset_m = run.forward ? into_m : run.length_m() - into_m;
      for (const auto* mapped : index_.balises_on(*run.edge)) distances_m.push_back(mapped->offset_m - offset_m);
    };
    look(early.run(), early.into_m + scale * balise_m);
    if (!(late.run() == early.run())) look(late.run(), late.into_m - scale * (kBinM - balise_m));
    log += model_.of_balise(distances_m);
  }
  return log;
}

std::vector<WayWalker::Walk> WayWalker::go(const std::vector<Walk>& walks, size_t bin, bool ahead,
                                           const Candidate& candidate, const Trial& trial, double least_log) const {
  const double from_anchor_m = kBinM * std::abs(static_cast<double>(bin) - static_cast<double>(candidate.bin));
  const double rough_m = trial.rough_m + trial.rough_scale * from_anchor_m;
  std::vector<Walk> next;
  for (const Walk& walk : walks) {
    Walk from = walk;
    from.turn_rad = 0;
    const size_t first = next.size();
    step(from, (ahead ? 1 : -1) * candidate.scale * kBinM, next, kMostRunsAStep);
    for (size_t i = first; i < next.size(); ++i) {
      // Behind the anchor the step was taken backwards: its turn counts the other way round.
      const auto error = model_.of_turn(bin, (ahead ? 1 : -1) * next[i].turn_rad, rough_m);
      next[i].log += model_.log_of(std::min(error.squared, TurnModel::kMostSquared), error.variance);
      if (!model_.way()[bin].balises_m.empty()) next[i].log += of_balises(from, next[i], bin, candidate.scale, ahead);
    }
  }
  std::erase_if(next, [&](const Walk& w) { return w.log < least_log; });
  if (next.size() < 2) return next;
  std::sort(next.begin(), next.end(), [](const Walk& a, const Walk& b) { return a.log > b.log; });
  // Ways that have met again are one from here on.
  std::vector<Walk> kept;
  for (const Walk& w : next) {
    if (kept.size() == trial.most_ways) break;
    const bool met = std::any_of(kept.begin(), kept.end(), [&](const Walk& k) {
      return k.run() == w.run() && std::abs(k.into_m - w.into_m) < kSamePlaceM;
    });
    if (!met) kept.push_back(w);
  }
  return kept;
}

std::vector<WalkedWay> WayWalker::follow(const Candidate& candidate, const Trial& trial, double least_log) const {
  const Walk anchor{candidate.into_m, 0, 0, 0, std::make_shared<const Step>(Step{candidate.run, nullptr})};
  std::vector<Walk> behind{anchor};
  for (size_t i = candidate.bin; i > 0 && !behind.empty(); --i) {
    behind = go(behind, i - 1, false, candidate, trial, least_log);
  }
  if (behind.empty()) return {};
  std::vector<Walk> ahead{anchor};
  for (size_t i = candidate.bin; i < model_.way().size() && !ahead.empty(); ++i) {
    ahead = go(ahead, i, true, candidate, trial, least_log - behind.front().log);
  }
  std::vector<WalkedWay> ways;
  for (const Walk& before : behind) {
    for (const Walk& after : ahead) {
      if (before.log + after.log >= least_log) ways.push_back(joined(before, after, candidate));
    }
  }
  std::sort(ways.begin(), ways.end(), [](const WalkedWay& a, const WalkedWay& b) { return a.log > b.log; });
  if (ways.size() > trial.most_ways) ways.resize(trial.most_ways);
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
