#include "map/survey_known.hpp"

#include <algorithm>
#include <map>
#include <tuple>

namespace railfix::tool {
namespace {

using Marks = std::vector<const track::Landmark*>;

bool may_be(const SurveySighting& seen, const track::Landmark& mark) {
  return alike(seen, mark.kind, mark.edge, mark.lateral_m, track::is_aside_measured(mark));
}

/// The marks of one pass of a run, by dynamic programming over its sightings in the order along the edge: of all
/// choices in that order the one whose squared distances are the least together.
class PassMarks {
 public:
  /// marks: in the same order.
  PassMarks(const std::vector<SurveySighting>& all, const std::vector<double>& places, const std::vector<size_t>& pass,
            const Marks& marks, double gate_m)
      : marks_(marks), choices_(pass.size(), std::vector<Choice>(marks.size() + 1)) {
    for (size_t i = 0; i < pass.size(); ++i) {
      const auto& seen = all[pass[i]];
      size_t before = 0;  // the mark up to which it costs least
      for (size_t last = 0; last <= marks.size(); ++last) {
        Choice& choice = choices_[i][last];
        choice = {cost(i, last) + 1, last, first_of(i, last), false};  // a thing that the map does not have
        if (last > 0 && may_be(seen, *marks[last - 1])) {
          const double reach_m = gate_m + 3.0 * std::hypot(marks[last - 1]->sigma_m, seen.run_sigma_m);
          const double off = std::abs(marks[last - 1]->offset_m - places[pass[i]]) / reach_m;
          if (off < 1) choice = std::min(choice, Choice{cost(i, before) + off * off, before, pass[i], true});
          if (off < 1 && std::isfinite(cost(i, last)) && !told_apart(seen, all[first_of(i, last)]))
            choice = std::min(choice, Choice{cost(i, last) + off * off, last, first_of(i, last), true});
        }
        if (cost(i, last) < cost(i, before)) before = last;
      }
    }
  }
  /// Of every sighting.
  [[nodiscard]] Marks best() const {
    Marks best(choices_.size(), nullptr);
    size_t last = 0;
    for (size_t k = 0; k <= marks_.size(); ++k) {
      if (cost(choices_.size(), k) < cost(choices_.size(), last)) last = k;
    }
    for (size_t i = choices_.size(); i-- > 0;) {
      const Choice& choice = choices_[i][last];
      if (choice.is_mark) best[i] = marks_[last - 1];
      last = choice.before;
    }
    return best;
  }

 private:
  /// Marks count from 1; 0 = none yet.
  struct Choice {
    double cost = INFINITY;
    size_t before = 0;  // the last mark of the sightings before
    size_t first = 0;   // sighting of the last mark now
    bool is_mark = false;
    auto operator<=>(const Choice&) const = default;
  };
  /// Of the first i sightings, when `last` is the last mark among them.
  [[nodiscard]] double cost(size_t i, size_t last) const {
    if (i == 0) return last == 0 ? 0.0 : INFINITY;
    return choices_[i - 1][last].cost;
  }
  [[nodiscard]] size_t first_of(size_t i, size_t last) const { return i == 0 ? 0 : choices_[i - 1][last].first; }

  const Marks& marks_;
  std::vector<std::vector<Choice>> choices_;  // by sighting and last mark
};

/// Where one pass ends and the next one of the same run, edge, kind and side begins.
std::vector<std::vector<size_t>> passes_of(const std::vector<SurveySighting>& all) {
  const auto key = [&](size_t i) {
    const bool left = has_side(all[i].kind) && all[i].lateral_m >= 0;
    return std::tuple(all[i].run, all[i].stretch, all[i].edge, all[i].kind, left);
  };
  std::vector<size_t> sorted(all.size());
  for (size_t i = 0; i < sorted.size(); ++i) sorted[i] = i;
  std::sort(sorted.begin(), sorted.end(),
            [&](size_t a, size_t b) { return std::pair(key(a), all[a].way_m) < std::pair(key(b), all[b].way_m); });
  std::vector<std::vector<size_t>> passes;
  for (const size_t i : sorted) {
    const bool goes_on = !passes.empty() && key(i) == key(passes.back().back()) &&
                         std::abs(all[i].way_m - all[passes.back().back()].way_m) < kOnePassM;
    if (!goes_on) passes.emplace_back();
    passes.back().push_back(i);
  }
  for (auto& pass : passes) {
    std::sort(pass.begin(), pass.end(), [&](size_t a, size_t b) { return all[a].unmoved_m() < all[b].unmoved_m(); });
  }
  return passes;
}

}  // namespace

std::vector<const track::Landmark*> known_marks(const track::Map& map, const std::vector<SurveySighting>& all,
                                                const std::vector<double>& places, double gate_m) {
  std::map<std::pair<uint32_t, track::LandmarkKind>, Marks> marks_on;  // edges, along them
  for (const track::Landmark& mark : map.landmarks) marks_on[{mark.edge, mark.kind}].push_back(&mark);
  for (auto& [key, marks] : marks_on) std::ranges::sort(marks, {}, &track::Landmark::offset_m);
  Marks known(all.size(), nullptr);
  for (const auto& pass : passes_of(all)) {
    const auto& first = all[pass.front()];
    const Marks& marks = marks_on[{first.edge, first.kind}];
    const auto best = PassMarks(all, places, pass, marks, gate_m).best();
    for (size_t i = 0; i < pass.size(); ++i) known[pass[i]] = best[i];
  }
  return known;
}

}  // namespace railfix::tool
