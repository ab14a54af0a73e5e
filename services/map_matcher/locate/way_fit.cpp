#include "map_matcher/locate/way_fit.hpp"

#include <algorithm>
#include <array>
#include <cmath>

namespace railfix::map_matcher {
namespace {

constexpr double kShiftStepM = 40.0;
constexpr int kShiftSteps = 1;
constexpr double kScaleStep = 0.01;
constexpr double kBeyondM = 150.0;
constexpr double kGridM = 5.0;
constexpr size_t kFineEnough = 60;  // trials nearly as good as the best
constexpr size_t kLookEvery = 8;    // bins, whether it is worth going on
constexpr double kNearlyAsGood = 3.0;
constexpr size_t kStretchBins = 10;

}  // namespace

/// Heading of the car body along the runs: the mean of the track's under it.
class WayFitter::Shape {
 public:
  Shape(const NetworkIndex& index, std::vector<track::Run> runs, double lag_m) : runs_(std::move(runs)) {
    double begin_m = 0;
    double heading = 0;
    std::vector<double> track;
    for (const auto& run : runs_) {
      const double end_m = begin_m + run.length_m();
      for (double m = kGridM * static_cast<double>(track.size()); m < end_m; m += kGridM) {
        track.push_back(heading + index.turned(run, m - begin_m));
      }
      for (Mark mark : index.marks_on(run)) {
        mark.along_m += begin_m;
        marks_.push_back(mark);
      }
      heading += index.turned(run, run.length_m());
      begin_m = end_m;
    }
    if (track.empty()) track.push_back(0);
    const auto lag = static_cast<size_t>(std::lround(lag_m / kGridM));
    headings_.reserve(track.size());
    for (size_t i = 0; i < track.size(); ++i) {
      double sum = 0;
      for (size_t k = 0; k <= lag; ++k) {
        sum += (k == 0 || k == lag ? 0.5 : 1.0) * track[i > k ? i - k : 0];
      }
      headings_.push_back(lag > 0 ? sum / static_cast<double>(lag) : track[i]);
    }
  }
  [[nodiscard]] double heading(double m) const {
    const double cell = std::clamp(m / kGridM, 0.0, static_cast<double>(headings_.size() - 1));
    const auto i = std::min(static_cast<size_t>(cell), headings_.size() > 1 ? headings_.size() - 2 : 0);
    if (headings_.size() < 2) return headings_[0];
    return headings_[i] + (cell - static_cast<double>(i)) * (headings_[i + 1] - headings_[i]);
  }
  /// Log likelihood of a landmark that was sighted here, give or take rough_m.
  [[nodiscard]] double of_mark(const TurnModel& model, const Mark& seen, double m, double rough_m) const {
    double likelihood = model.of_false_mark();
    auto mapped = std::lower_bound(marks_.begin(), marks_.end(), m - kBinM - rough_m,
                                   [](const Mark& mark, double at_m) { return mark.along_m < at_m; });
    for (; mapped != marks_.end() && mapped->along_m < m + kBinM + rough_m; ++mapped) {
      if (alike(seen, *mapped)) likelihood += model.of_mark(mapped->along_m - m, rough_m);
    }
    return std::log(std::min(likelihood, 1.0));
  }
  [[nodiscard]] const std::vector<track::Run>& runs() const { return runs_; }
  [[nodiscard]] size_t cells() const { return headings_.size(); }

 private:
  std::vector<track::Run> runs_;
  std::vector<double> headings_;
  std::vector<Mark> marks_;  // in order
};

// Given up as soon as it falls below least_log: what is still to come cannot make it better.
void WayFitter::weigh(const Shape& shape, const WalkedWay& walked, Trial& trial, double rough_m, double rough_scale,
                      double least_log) {
  const auto& way = model_.way();
  const auto bins_from_anchor = [&](double i) { return i - static_cast<double>(walked.bin); };
  const auto place_m = [&](size_t i) {
    return walked.anchor_m + trial.shift_m + trial.scale * kBinM * bins_from_anchor(static_cast<double>(i));
  };
  const double most_squared = model_.most_squared(least_log);
  TurnSum sum = model_.begin();
  double marks = 0;
  double worst = 0;
  std::array<double, kStretchBins> squared{};  // of the last sums
  double from_m = place_m(0);
  double before = shape.heading(from_m);
  bool worth = true;
  size_t i = 0;
  for (; i < way.size() && worth; ++i) {
    const double to_m = place_m(i + 1);
    const double after = shape.heading(to_m);
    const double away_m = kBinM * std::abs(bins_from_anchor(static_cast<double>(i) + 0.5));
    const double here_rough_m = rough_m + rough_scale * away_m;
    model_.add(sum, i, after - before, here_rough_m);
    for (const Mark& seen : way[i].marks) {
      marks += shape.of_mark(model_, seen, from_m + trial.scale * seen.along_m, here_rough_m);
    }
    if (i + 1 >= kStretchBins) worst = std::max(worst, sum.squared - squared[i % kStretchBins]);
    squared[i % kStretchBins] = sum.squared;
    before = after;
    from_m = to_m;
    if (i % kLookEvery == 0) worth = model_.squared_of(sum) < most_squared;
  }
  compared_bins_ += i;
  trial.log = worth ? model_.log_of(sum) + marks : -INFINITY;
  trial.misfit = model_.misfit_of(sum);
  trial.worst_misfit = worst / static_cast<double>(kStretchBins);
}

// From a wide grid to finer ones around what fits; on the wider ones the errors may be as large as the steps make them.
WayFitter::Grid WayFitter::search(const Shape& shape, const WalkedWay& walked, const Effort& effort, double least_log) {
  const double range = model_.parameters().scale_range;
  const int scales = static_cast<int>(std::ceil(range / kScaleStep));
  Grid grid{{}, kShiftStepM, range / scales};
  for (int a = -kShiftSteps; a <= kShiftSteps; ++a) {
    for (int b = -scales; b <= scales; ++b) {
      grid.trials.push_back({0.5 * model_.parameters().lag_m + a * grid.shift_step_m, 1 + b * grid.scale_step, 0, 0});
    }
  }
  int halvings = effort.halvings;
  for (int level = 0;; ++level) {
    const bool last = level == halvings;
    double best = -INFINITY;
    for (Trial& t : grid.trials) {
      weigh(shape, walked, t, last ? 0 : 0.5 * grid.shift_step_m, last ? 0 : 0.5 * grid.scale_step,
            std::max(least_log, best - effort.kept_below));
      best = std::max(best, t.log);
    }
    if (best < least_log) return {};
    std::erase_if(grid.trials, [&](const Trial& t) { return t.log < best - effort.kept_below; });
    if (last) return grid;
    const auto good = std::count_if(grid.trials.begin(), grid.trials.end(),
                                    [&](const Trial& t) { return t.log > best - kNearlyAsGood; });
    if (static_cast<size_t>(good) >= kFineEnough) {
      halvings = level + 1;
      continue;
    }
    std::sort(grid.trials.begin(), grid.trials.end(), [](const Trial& a, const Trial& b) { return a.log > b.log; });
    if (grid.trials.size() > effort.most_kept) grid.trials.resize(effort.most_kept);
    grid.shift_step_m *= 0.5;
    grid.scale_step *= 0.5;
    std::vector<Trial> finer;
    for (const Trial& t : grid.trials) {
      for (const double a : {-0.5, 0.5}) {
        for (const double b : {-0.5, 0.5}) {
          finer.push_back({t.shift_m + a * grid.shift_step_m, t.scale + b * grid.scale_step, 0, 0});
        }
      }
    }
    grid.trials = std::move(finer);
  }
}

// Straight on at both ends, as far as another place and scale may need it.
WalkedWay WayFitter::lengthened(WalkedWay walked) const {
  const auto bins = static_cast<double>(model_.way().size());
  const double more_m = kBeyondM + model_.parameters().scale_range * kBinM * bins;
  const double behind_m = kBinM * static_cast<double>(walked.bin) + more_m;
  while (walked.anchor_m < behind_m) {
    const auto before = index_.ways().before(walked.runs.front());
    if (before.empty()) break;
    walked.anchor_m += before.front().length_m();
    walked.runs.insert(walked.runs.begin(), before.front());
  }
  const double needed_m = walked.anchor_m + kBinM * (bins - static_cast<double>(walked.bin)) + more_m;
  double length_m = 0;
  for (const auto& run : walked.runs) length_m += run.length_m();
  while (length_m < needed_m) {
    const auto& after = index_.ways().after(walked.runs.back());
    if (after.empty()) break;
    length_m += after.front().length_m();
    walked.runs.push_back(after.front());
  }
  return walked;
}

std::optional<WayFit> WayFitter::fit(const WalkedWay& walked, const Effort& effort, double least_log) {
  const WalkedWay way = lengthened(walked);
  const Shape shape(index_, way.runs, model_.parameters().lag_m);
  compared_bins_ += shape.cells();
  const Grid grid = search(shape, way, effort, least_log);
  if (grid.trials.empty()) return std::nullopt;
  const Trial& best = *std::max_element(grid.trials.begin(), grid.trials.end(),
                                        [](const Trial& a, const Trial& b) { return a.log < b.log; });
  const double bins_ahead = static_cast<double>(model_.way().size()) - static_cast<double>(way.bin);
  const auto end_m = [&](const Trial& t) { return way.anchor_m + t.shift_m + t.scale * kBinM * bins_ahead; };
  double sum = 0;
  double mean_m = 0;
  double square = 0;
  for (const Trial& t : grid.trials) {
    const double weight = std::exp(t.log - best.log);
    const double off_m = end_m(t) - end_m(best);
    sum += weight;
    mean_m += weight * off_m;
    square += weight * off_m * off_m;
  }
  mean_m /= sum;
  WayFit result;
  result.runs = way.runs;
  result.end_m = end_m(best) + mean_m;
  result.sigma_m = std::sqrt(std::max(0.0, square / sum - mean_m * mean_m));
  result.anchor_m = way.anchor_m + best.shift_m;
  result.bin = way.bin;
  result.scale = best.scale;
  result.best_log = best.log;
  result.log_evidence = best.log + std::log(sum * grid.shift_step_m * grid.scale_step);
  result.misfit = best.misfit;
  result.worst_misfit = best.worst_misfit;
  return result;
}

const WayFit& best_of(const std::vector<WayFit>& fits) {
  return *std::ranges::max_element(fits, {}, &WayFit::log_evidence);
}

Candidate place_on(const std::vector<track::Run>& runs, double along_m) {
  size_t i = 0;
  for (; i + 1 < runs.size() && along_m > runs[i].length_m(); ++i) along_m -= runs[i].length_m();
  return {runs[i], std::clamp(along_m, 0.0, runs[i].length_m())};
}

}  // namespace railfix::map_matcher
