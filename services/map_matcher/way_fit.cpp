#include "map_matcher/way_fit.hpp"

#include <algorithm>
#include <cmath>

namespace railfix::map_matcher {
namespace {

constexpr double kShiftStepM = 10.0;
constexpr int kShiftSteps = 6;
constexpr double kScaleStep = 0.002;
constexpr double kBeyondM = 150.0;
constexpr double kGridM = 5.0;
constexpr double kKeptBelow = 12.0;  // on the coarser grids
constexpr size_t kMostKept = 150;
constexpr size_t kFineEnough = 60;  // trials nearly as good as the best
constexpr double kLargeProduct = 1e200;
constexpr double kNearlyAsGood = 3.0;

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
      for (const auto* balise : index.balises_on(*run.edge)) {
        balises_m_.push_back(begin_m + (run.forward ? balise->offset_m : run.length_m() - balise->offset_m));
      }
      heading += index.turned(run, run.length_m());
      begin_m = end_m;
    }
    length_m_ = begin_m;
    if (track.empty()) track.push_back(0);
    const auto lag = static_cast<size_t>(std::lround(lag_m / kGridM));
    for (size_t i = 0; i < track.size(); ++i) {
      double sum = 0;
      for (size_t k = 0; k <= lag; ++k) {
        sum += (k == 0 || k == lag ? 0.5 : 1.0) * track[i > k ? i - k : 0];
      }
      headings_.push_back(lag > 0 ? sum / static_cast<double>(lag) : track[i]);
    }
    std::sort(balises_m_.begin(), balises_m_.end());
  }
  [[nodiscard]] double heading(double m) const {
    const double cell = std::clamp(m / kGridM, 0.0, static_cast<double>(headings_.size() - 1));
    const auto i = std::min(static_cast<size_t>(cell), headings_.size() > 1 ? headings_.size() - 2 : 0);
    if (headings_.size() < 2) return headings_[0];
    return headings_[i] + (cell - static_cast<double>(i)) * (headings_[i + 1] - headings_[i]);
  }
  /// To the mapped balises around.
  [[nodiscard]] std::vector<double> balises_from(double m) const {
    std::vector<double> distances_m;
    for (auto b = std::lower_bound(balises_m_.begin(), balises_m_.end(), m - kBinM);
         b != balises_m_.end() && *b < m + kBinM; ++b) {
      distances_m.push_back(*b - m);
    }
    return distances_m;
  }
  [[nodiscard]] const std::vector<track::Run>& runs() const { return runs_; }
  [[nodiscard]] double length_m() const { return length_m_; }

 private:
  std::vector<track::Run> runs_;
  std::vector<double> headings_;
  std::vector<double> balises_m_;
  double length_m_ = 0;
};

// Given up as soon as it falls below least_log: what is still to come cannot make it better.
void WayFitter::weigh(const Shape& shape, const WalkedWay& walked, Trial& trial, double rough_m, double rough_scale,
                      double least_log) const {
  const auto& way = model_.way();
  const auto bins_from_anchor = [&](double i) { return i - static_cast<double>(walked.bin); };
  const auto place_m = [&](size_t i) {
    return walked.anchor_m + trial.shift_m + trial.scale * kBinM * bins_from_anchor(static_cast<double>(i));
  };
  // The likelihood is summed up in the end; squares alone tell earlier that it is too small.
  const double most_squared = -2 * model_.parameters().correlated_bins * least_log;
  trial.squared = 0;
  double capped = 0;
  double variance = 1;
  double variances = 0;
  double balises = 0;
  double from_m = place_m(0);
  double before = shape.heading(from_m);
  for (size_t i = 0; i < way.size() && capped < most_squared; ++i) {
    const double to_m = place_m(i + 1);
    const double after = shape.heading(to_m);
    const double away_m = kBinM * std::abs(bins_from_anchor(static_cast<double>(i) + 0.5));
    const auto error = model_.of_turn(i, after - before, rough_m + rough_scale * away_m);
    trial.squared += error.squared;
    capped += std::min(error.squared, TurnModel::kMostSquared);
    variance *= error.variance;
    if (variance > kLargeProduct) {
      variances += std::log(variance);
      variance = 1;
    }
    for (const double balise_m : way[i].balises_m) {
      balises += model_.of_balise(shape.balises_from(from_m + trial.scale * balise_m));
    }
    before = after;
    from_m = to_m;
  }
  trial.log = model_.log_of(capped + variances, variance) + balises;
}

// From a wide grid to finer ones around what fits; on the wider ones the errors may be as large as the steps make them.
WayFitter::Grid WayFitter::search(const Shape& shape, const WalkedWay& walked, int halvings, double least_log) const {
  const double range = model_.parameters().scale_range;
  const int scales = static_cast<int>(std::ceil(range / kScaleStep));
  Grid grid{{}, kShiftStepM, range / scales};
  for (int a = -kShiftSteps; a <= kShiftSteps; ++a) {
    for (int b = -scales; b <= scales; ++b) {
      grid.trials.push_back({0.5 * model_.parameters().lag_m + a * grid.shift_step_m, 1 + b * grid.scale_step, 0, 0});
    }
  }
  for (int level = 0;; ++level) {
    const bool last = level == halvings;
    double best = -INFINITY;
    for (Trial& t : grid.trials) {
      weigh(shape, walked, t, last ? 0 : 0.5 * grid.shift_step_m, last ? 0 : 0.5 * grid.scale_step,
            std::max(least_log, best - kKeptBelow));
      best = std::max(best, t.log);
    }
    if (best < least_log) return {};
    std::erase_if(grid.trials, [&](const Trial& t) { return t.log < best - kKeptBelow; });
    if (last) return grid;
    const auto good = std::count_if(grid.trials.begin(), grid.trials.end(),
                                    [&](const Trial& t) { return t.log > best - kNearlyAsGood; });
    if (static_cast<size_t>(good) >= kFineEnough) {
      halvings = level + 1;
      continue;
    }
    std::sort(grid.trials.begin(), grid.trials.end(), [](const Trial& a, const Trial& b) { return a.log > b.log; });
    if (grid.trials.size() > kMostKept) grid.trials.resize(kMostKept);
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

std::optional<WayFit> WayFitter::fit(const WalkedWay& walked, int halvings, double least_log) const {
  const WalkedWay way = lengthened(walked);
  const Shape shape(index_, way.runs, model_.parameters().lag_m);
  const Grid grid = search(shape, way, halvings, least_log);
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
  result.misfit = best.squared / static_cast<double>(model_.way().size());
  return result;
}

Candidate place_on(const std::vector<track::Run>& runs, double along_m) {
  size_t i = 0;
  for (; i + 1 < runs.size() && along_m > runs[i].length_m(); ++i) along_m -= runs[i].length_m();
  return {runs[i], std::clamp(along_m, 0.0, runs[i].length_m()), 0, 1, 0};
}

}  // namespace railfix::map_matcher
