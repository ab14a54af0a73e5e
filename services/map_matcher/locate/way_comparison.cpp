#include "map_matcher/locate/way_comparison.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <unordered_map>

namespace railfix::map_matcher {
namespace {

constexpr std::array<double, 3> kScales = {0, -2.0 / 3, 2.0 / 3};  // of the range
constexpr double kRoughM = 20.0;
constexpr double kLeastRoughScale = 0.001;
constexpr size_t kRoughWays = 12;
constexpr WayWalker::Trial kExactly{8.0, 0.001, 24};
constexpr size_t kMostComparedBins = 8'000'000;  // a quarter of a second
constexpr size_t kMostTried = 16;
constexpr WayFitter::Effort kFirst{3, 10, 4.0};
constexpr WayFitter::Effort kFull{5, 120, 10.0};
constexpr double kSamePlaceM = 60.0;
constexpr double kRepeatedM = 45.0;

bool same_way(const WayFit& a, const WayFit& b) {
  const auto at = place_on(a.runs, a.end_m);
  const auto other = place_on(b.runs, b.end_m);
  return at.run == other.run && std::abs(at.into_m - other.into_m) < kSamePlaceM;
}

// The better one where the place is the same.
void add(const WayFit& fit, std::vector<WayFit>& fits) {
  const auto same = std::find_if(fits.begin(), fits.end(), [&](const WayFit& f) { return same_way(f, fit); });
  if (same == fits.end()) {
    fits.push_back(fit);
  } else if (fit.log_evidence > same->log_evidence) {
    *same = fit;
  }
}

/// Ways that were fitted already: several candidates and scales lead to the same one.
class FittedWays {
 public:
  explicit FittedWays(size_t bins) : bins_(static_cast<double>(bins)) {}
  bool add(const WalkedWay& way) {
    const auto end = place_on(way.runs, way.anchor_m + kBinM * (bins_ - static_cast<double>(way.bin)));
    auto& ways = ways_[end.run.edge];
    const bool known = std::any_of(ways.begin(), ways.end(), [&](const Fitted& f) {
      return f.end.run == end.run && std::abs(f.end.into_m - end.into_m) < kRepeatedM && f.runs == way.runs;
    });
    if (!known) ways.push_back({end, way.runs});
    return !known;
  }

 private:
  struct Fitted {
    Candidate end;
    std::vector<track::Run> runs;
  };
  double bins_;
  std::unordered_map<const track::Edge*, std::vector<Fitted>> ways_;  // by where they end
};

}  // namespace

// Several scales where it is not known yet.
std::vector<WalkedWay> WayComparison::roughly(const Candidate& candidate, double least_log) {
  const double range = model_.parameters().scale_range;
  const double step = 2 * range / static_cast<double>(kScales.size());
  const bool known = 2 * candidate.scale_sigma < step;
  std::vector<WalkedWay> ways;
  for (const double share : kScales) {
    Candidate scaled = candidate;
    if (!known) scaled.scale = 1 + share * range;
    const double rough_scale = known ? std::max(kLeastRoughScale, 2 * candidate.scale_sigma) : 0.5 * step;
    const WayWalker::Trial trial{kRoughM, rough_scale, kRoughWays};
    for (auto& way : walker_.follow(scaled, trial, least_log)) ways.push_back(std::move(way));
    if (known) break;
  }
  return ways;
}

// Best first.
std::vector<WayFit> WayComparison::first_fits(const std::vector<Candidate>& candidates, bool& complete) {
  double best = -INFINITY;
  std::vector<WayFit> fits;
  FittedWays fitted(model_.way().size());
  for (const Candidate& candidate : candidates) {
    if (walker_.compared_bins() + fitter_.compared_bins() > kMostComparedBins) {
      complete = false;
      break;
    }
    for (const WalkedWay& way : roughly(candidate, best - kFarBelow)) {
      if (!fitted.add(way)) continue;
      if (auto fit = fitter_.fit(way, kFirst, best - kFarBelow)) {
        best = std::max(best, fit->best_log);
        fits.push_back(std::move(*fit));
      }
    }
  }
  std::erase_if(fits, [&](const WayFit& f) { return f.best_log < best - kFarBelow; });
  std::sort(fits.begin(), fits.end(), [](const WayFit& a, const WayFit& b) { return a.best_log > b.best_log; });
  return fits;
}

// Walked again as exactly as the fit knows it, which may find other legs, and fitted in full.
bool WayComparison::fit_exactly(const WayFit& first, std::vector<WayFit>& fits, double& best) {
  Candidate anchor = place_on(first.runs, first.anchor_m - 0.5 * model_.parameters().lag_m);
  anchor.bin = first.bin;
  anchor.scale = first.scale;
  for (const WalkedWay& way : walker_.follow(anchor, kExactly, -INFINITY)) {
    const auto full = fitter_.fit(way, kFull, best - kFarBelow);
    if (!full) continue;
    best = std::max(best, full->best_log);
    add(*full, fits);
  }
  return !walker_.cut();
}

ComparedWays WayComparison::compare(const std::vector<Candidate>& candidates) {
  ComparedWays compared;
  const auto first = first_fits(candidates, compared.complete);
  std::vector<WayFit> tried;
  double best = -INFINITY;
  for (const WayFit& fit : first) {
    if (std::any_of(tried.begin(), tried.end(), [&](const WayFit& t) { return same_way(t, fit); })) continue;
    if (tried.size() == kMostTried) {
      compared.complete = false;
      break;
    }
    tried.push_back(fit);
    if (!fit_exactly(fit, compared.fits, best)) compared.complete = false;
  }
  if (!add_beside(compared.fits)) compared.complete = false;
  return compared;
}

// The tracks beside the best place are compared too: the filter need not have kept them.
bool WayComparison::add_beside(std::vector<WayFit>& fits) {
  if (fits.empty()) return true;
  const WayFit best = best_of(fits);
  if (best.misfit > model_.parameters().most_misfit()) return true;
  const auto end = place_on(best.runs, best.end_m);
  bool all = true;
  for (const auto& beside : index_.beside(end.run, end.into_m, kBesideM)) {
    Candidate candidate{beside.run, std::max(0.0, beside.into_m - 0.5 * model_.parameters().lag_m)};
    candidate.bin = model_.way().size();
    candidate.scale = best.scale;
    for (const WalkedWay& way : walker_.follow(candidate, kExactly, -INFINITY)) {
      if (const auto fit = fitter_.fit(way, kFull, best.best_log - kFarBelow)) add(*fit, fits);
    }
    all = all && !walker_.cut();
  }
  return all;
}

}  // namespace railfix::map_matcher
