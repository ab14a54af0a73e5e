#include "track/import/osm/osm_heights.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <functional>
#include <map>
#include <set>

#include "core/units.hpp"
#include "track/import/told.hpp"
#include "track/import/xml/net_heights.hpp"

namespace railfix::track {
namespace {

constexpr double kSteepest = 0.5;  // of rack railways
constexpr double kLowestM = -500;
constexpr double kHighestM = 5500;
constexpr double kHeightToldM = 3;  // of whole metres, of the ground or the rails, over sums of rounded grades
constexpr double kLevelM = 0.05;
constexpr double kSamePointM = 1e-6;
constexpr size_t kMostCutsNamed = 5;

/// A number and what stands behind it; nothing where it begins with none.
std::optional<std::pair<double, std::string>> number_and_unit(const std::string& text) {
  double value = 0;
  const char* const end = text.data() + text.size();
  const auto [rest, error] = std::from_chars(text.data() + (text.starts_with('+') ? 1 : 0), end, value);
  if (error != std::errc() || text.starts_with("+-")) return std::nullopt;
  return std::pair(value, std::string(rest + (rest != end && *rest == ' ' ? 1 : 0), end));
}

class OsmHeights {
 public:
  OsmHeights(const OsmData& data, const std::vector<OsmChain>& chains, Draft& draft, std::vector<std::string>& problems)
      : data_(data), chains_(chains), draft_(draft), problems_(problems) {}

  void add() {
    read_elevations();
    for (size_t chain = 0; chain < chains_.size(); ++chain) cut(chain);
    const auto has_grade = [](const NetTrack& stretch) { return !stretch.slopes.empty(); };
    if (elevations_.empty() && std::ranges::none_of(net_.tracks, has_grade)) return;
    for (size_t node = 0; node < nodes_.size(); ++node) {
      if (!relative_m_.contains(node)) place_run(node);
    }
    tell_contradictions();
    tell_known();
    const std::vector<std::vector<GradePoint>> profiles = net_profiles(net_, ends_, heights_);
    std::ranges::move(net_.problems, std::back_inserter(problems_));
    for (size_t first = 0, next = 0; first < stretches_.size(); first = next) {
      while (next < stretches_.size() && stretches_[next].chain == stretches_[first].chain) ++next;
      join(profiles, first, next);
    }
  }

 private:
  /// Part of a chain of one grade, or without any, between nodes; the track of the same number in net_.
  struct Stretch {
    size_t chain = 0;
    double from_m = 0;
  };
  /// A node of the source that says how high it lies.
  struct Elevation {
    int64_t node = 0;
    int64_t way = 0;  // one that it is on
    double height_m = 0;
  };

  [[nodiscard]] const OsmWay& way_at(size_t chain, size_t segment) const {
    return data_.ways[chains_[chain].ways[segment]];
  }

  void read_elevations() {
    size_t unread = 0;
    std::string first;
    for (size_t chain = 0; chain < chains_.size(); ++chain) {
      const std::vector<int64_t>& nodes = chains_[chain].nodes;
      for (size_t i = 0; i < nodes.size(); ++i) {
        const OsmNode& node = data_.nodes.at(nodes[i]);
        const std::string text = value_of(node.tags, "ele");
        if (text.empty() || !seen_.insert(nodes[i]).second) continue;
        const int64_t way = way_at(chain, std::min(i, nodes.size() - 2)).id;
        if (const auto height_m = elevation_of(text)) {
          elevations_.emplace(number_of(nodes[i]), Elevation{nodes[i], way, *height_m});
        } else if (unread++ == 0) {
          first = "\"" + text + "\" of " + called(nodes[i], node.place, way);
        }
      }
    }
    if (unread == 0) return;
    problems_.push_back(std::to_string(unread) +
                        " heights of nodes (ele) are no number of metres at which a track can lie, the first one is " +
                        first + "; left out");
  }

  size_t number_of(int64_t node) {
    const auto [entry, is_new] = numbers_.try_emplace(node, nodes_.size());
    if (is_new) nodes_.emplace_back();
    return entry->second;
  }

  /// Along the chain, whichever way its ways are drawn.
  [[nodiscard]] std::optional<double> grade_at(size_t chain, size_t segment) const {
    const std::optional<double> grade = grade_of(value_of(way_at(chain, segment).tags, "incline"));
    return grade && !chains_[chain].along_way[segment] ? -*grade : grade;
  }

  /// Where the grade changes, and at nodes that say their height.
  void cut(size_t number) {
    const OsmChain& chain = chains_[number];
    std::vector<double> along_m(1, 0.0);
    for (size_t i = 1; i < chain.points.size(); ++i)
      along_m.push_back(along_m.back() + (chain.points[i] - chain.points[i - 1]).norm());
    const double scale = draft_.edges[number].track.alignment.length_m() / along_m.back();
    std::optional<double> grade = grade_at(number, 0);
    for (size_t begin = 0, i = 1; i < chain.nodes.size(); ++i) {
      const std::optional<double> next = i < chain.ways.size() ? grade_at(number, i) : std::nullopt;
      if (i < chain.ways.size() && next == grade && !says_height(chain.nodes[i])) continue;
      add_stretch(number, begin, i, along_m[begin] * scale, along_m[i] * scale, grade);
      begin = i;
      grade = next;
    }
  }

  [[nodiscard]] bool says_height(int64_t node) const {
    const auto number = numbers_.find(node);
    return number != numbers_.end() && elevations_.contains(number->second);
  }

  void add_stretch(size_t chain, size_t begin, size_t end, double from_m, double to_m, std::optional<double> grade) {
    NetTrack track{.track = {.name = "way/" + std::to_string(way_at(chain, begin).id),
                             .line = "",
                             .alignment = Alignment::chained({}, {{to_m - from_m, 0, 0}})},
                   .length_m = to_m - from_m,
                   .shape = {},
                   .bends = {},
                   .slopes = {},
                   .cant = {}};
    const std::pair ends(number_of(chains_[chain].nodes[begin]), number_of(chains_[chain].nodes[end]));
    if (grade) {
      track.slopes.push_back({0, *grade});
      nodes_[ends.first].emplace_back(ends.second, *grade * track.length_m);
      nodes_[ends.second].emplace_back(ends.first, -*grade * track.length_m);
      known_m_ += track.length_m;
    }
    all_m_ += track.length_m;
    stretches_.push_back({chain, from_m});
    ends_.push_back(ends);
    net_.tracks.push_back(std::move(track));
  }

  /// Stretches whose grades are known and that hang together lie as high as most of their nodes say: a wrong height of
  /// one must not bend them.
  void place_run(size_t first) {
    std::vector<size_t> run{first};
    relative_m_[first] = 0;
    for (size_t i = 0; i < run.size(); ++i) {
      for (const auto& [next, rise_m] : nodes_[run[i]]) {
        if (relative_m_.try_emplace(next, relative_m_[run[i]] + rise_m).second) run.push_back(next);
      }
    }
    std::vector<double> begins_m;
    for (const size_t node : run) {
      if (const auto told = elevations_.find(node); told != elevations_.end())
        begins_m.push_back(told->second.height_m - relative_m_[node]);
    }
    if (begins_m.empty()) {
      if (run.size() > 1) ++loose_runs_;
      return;
    }
    std::ranges::sort(begins_m);
    const double begin_m = 0.5 * (begins_m[(begins_m.size() - 1) / 2] + begins_m[begins_m.size() / 2]);
    for (const size_t node : run) {
      const auto told = elevations_.find(node);
      if (told == elevations_.end()) continue;
      heights_[node] = begin_m + relative_m_[node];
      off_m_.emplace_back(told->second.height_m - heights_[node], &told->second);
    }
  }

  void tell_contradictions() {
    std::erase_if(off_m_, [](const auto& off) { return std::abs(off.first) < kHeightToldM; });
    std::ranges::stable_sort(off_m_, std::greater{}, [](const auto& off) { return std::abs(off.first); });
    for (size_t i = 0; i < std::min(kMostCutsNamed, off_m_.size()); ++i) {
      const auto& [off, told] = off_m_[i];
      problems_.push_back(
          called(told->node, data_.nodes.at(told->node).place, told->way) + " has a height (ele) of " +
          told_m(told->height_m) + ", " + told_m(std::abs(off)) + (off > 0 ? " above" : " below") +
          " where the inclines put it, in the middle of what all nodes with one say; the inclines count");
    }
    if (off_m_.size() > kMostCutsNamed)
      problems_.push_back(std::to_string(off_m_.size() - kMostCutsNamed) +
                          " more nodes have a height (ele) that the inclines contradict, by less");
  }

  void tell_known() {
    const auto km = [](double length_m) { return told_number(length_m / 1000, 2); };
    if (known_m_ < all_m_)
      problems_.push_back(
          "a grade (incline) is on " + km(known_m_) + " of " + km(all_m_) +
          " km of track; elsewhere the track is taken to climb evenly, and all of it is a guess that no service uses");
    if (!heights_.empty() && loose_runs_ > 0)
      problems_.push_back(std::to_string(loose_runs_) +
                          " stretches with incline hold no node with a height (ele): how high they lie is a guess");
  }

  /// The profile of an edge, of its stretches. Where nothing says a grade or holds both ends up there is none.
  void join(const std::vector<std::vector<GradePoint>>& profiles, size_t first, size_t next) {
    std::vector<GradePoint> joined;
    bool is_told = false;
    for (size_t i = first; i < next; ++i) {
      const std::vector<GradePoint>& own = profiles[i];
      is_told = is_told || !net_.tracks[i].slopes.empty() ||
                std::abs(own.back().elevation_m - own.front().elevation_m) > kLevelM ||
                (heights_.contains(ends_[i].first) && heights_.contains(ends_[i].second));
      for (GradePoint point : own) {
        point.offset_m += stretches_[i].from_m;
        point.is_guess = true;
        const bool goes_on = !joined.empty() && point.offset_m - joined.back().offset_m < kSamePointM;
        if (goes_on) point.offset_m = joined.back().offset_m;
        if (goes_on && std::abs(point.elevation_m - joined.back().elevation_m) < kLevelM) joined.pop_back();
        joined.push_back(point);
      }
    }
    if (!is_told) return;
    Alignment& plan = draft_.edges[stretches_[first].chain].track.alignment;
    plan = Alignment(plan.elements(), plan.starts(), std::move(joined), plan.cant());
  }

  const OsmData& data_;
  const std::vector<OsmChain>& chains_;
  Draft& draft_;
  std::vector<std::string>& problems_;
  std::set<int64_t> seen_;
  std::map<int64_t, size_t> numbers_;                          // of nodes
  std::vector<std::vector<std::pair<size_t, double>>> nodes_;  // where known grades lead from each, and how far up
  std::map<size_t, Elevation> elevations_;                     // nodes
  RailNet net_;
  std::vector<Stretch> stretches_;
  std::vector<std::pair<size_t, size_t>> ends_;  // of the stretches
  std::map<size_t, double> relative_m_;          // nodes, within their run
  std::map<size_t, double> heights_;             // nodes
  std::vector<std::pair<double, const Elevation*>> off_m_;
  size_t loose_runs_ = 0;
  double known_m_ = 0;
  double all_m_ = 0;
};

}  // namespace

std::optional<double> grade_of(const std::string& text) {
  const auto said = number_and_unit(text);
  if (!said) return std::nullopt;
  const auto& [value, unit] = *said;
  std::optional<double> grade;
  if (unit == "%") grade = 1e-2 * value;
  if (unit == "‰") grade = 1e-3 * value;
  if (unit == "°" && std::abs(value) < 90) grade = std::tan(core::rad_from_deg(value));
  if (unit.empty() && value == 0) grade = 0;  // level in any unit
  return grade && std::abs(*grade) <= kSteepest ? grade : std::nullopt;
}

std::optional<double> elevation_of(const std::string& text) {
  const auto said = number_and_unit(text);
  const bool is_height =
      said && (said->second.empty() || said->second == "m") && said->first >= kLowestM && said->first <= kHighestM;
  return is_height ? std::optional(said->first) : std::nullopt;
}

void add_heights(const OsmData& data, const std::vector<OsmChain>& chains, Draft& draft,
                 std::vector<std::string>& problems) {
  OsmHeights(data, chains, draft, problems).add();
}

}  // namespace railfix::track
