#include "track/import/osm/osm_stray_nodes.hpp"

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <optional>
#include <unordered_set>

#include "core/units.hpp"
#include "track/import/fit/plane.hpp"

namespace railfix::track {
namespace {

constexpr double kLeastOffM = 10;  // less is usual in drawings
constexpr double kLeastTurnRad = core::kPi / 12.0;
constexpr double kSharpestLegRad = core::kPi / 6.0;  // of the straightest way over a switch or crossing
constexpr double kTurnsLess = 3;                     // without the node

double distance_m(const Eigen::Vector2d& point, const Eigen::Vector2d& a, const Eigen::Vector2d& b) {
  const Eigen::Vector2d along = b - a;
  const double part = along.squaredNorm() > 0 ? (point - a).dot(along) / along.squaredNorm() : 0.0;
  return (point - a - std::clamp(part, 0.0, 1.0) * along).norm();
}

class Search {
 public:
  Search(const OsmPlaces& places, const OsmNeighbours& neighbours) : places_(places), neighbours_(neighbours) {}

  std::vector<StrayNode> run() {
    std::vector<Found> found;
    for (const auto& [node, around] : neighbours_) {
      if (const std::optional<Found> one = judge(node, around)) found.push_back(*one);
    }
    // A node far off makes its neighbours look stray too: of those near each other the one that spoils most.
    std::ranges::sort(found, std::greater{}, [](const Found& one) { return std::pair(one.turns_less_rad, one.node); });
    std::unordered_set<int64_t> explained;
    std::vector<StrayNode> out;
    for (const Found& one : found) {
      if (explained.contains(one.node)) continue;
      out.push_back({one.node, one.off_m});
      for (const int64_t next : neighbours_.at(one.node)) {
        explained.insert(next);
        explained.insert(neighbours_.at(next).begin(), neighbours_.at(next).end());
      }
    }
    std::ranges::stable_sort(out, std::greater{}, &StrayNode::off_m);
    return out;
  }

 private:
  struct Found {
    int64_t node = 0;
    double off_m = 0;
    double turns_less_rad = 0;  // the track without the node
  };

  [[nodiscard]] double turn_rad(int64_t from, int64_t over, int64_t to) const {
    const Eigen::Vector2d& middle = places_.at(over);
    return std::abs(core::wrap_pi(heading_of(places_.at(to) - middle) - heading_of(middle - places_.at(from))));
  }

  /// Where the track goes on most straightly.
  [[nodiscard]] std::optional<int64_t> beyond(int64_t from, int64_t over, int64_t without) const {
    std::optional<int64_t> out;
    double least_rad = std::numeric_limits<double>::infinity();
    for (const int64_t next : neighbours_.at(over)) {
      if (next == from || next == without) continue;
      const double rad = turn_rad(from, over, next);
      if (rad < least_rad) out = next;
      least_rad = std::min(least_rad, rad);
    }
    return out;
  }

  [[nodiscard]] std::optional<Found> judge(int64_t node, const std::vector<int64_t>& around) const {
    std::optional<Found> worst;
    for (size_t a = 0; a < around.size(); ++a) {
      for (size_t b = a + 1; b < around.size(); ++b) {
        const double turn = turn_rad(around[a], node, around[b]);
        if (turn < kLeastTurnRad) return std::nullopt;
        if (around.size() > 2 && turn < kSharpestLegRad) return std::nullopt;
        const std::optional<Found> one = judge_between(around[a], node, around[b], turn);
        if (one && (!worst || one->turns_less_rad > worst->turns_less_rad)) worst = one;
      }
    }
    return worst;
  }

  [[nodiscard]] std::optional<Found> judge_between(int64_t before, int64_t node, int64_t after, double turn) const {
    const double off_m = distance_m(places_.at(node), places_.at(before), places_.at(after));
    if (off_m < kLeastOffM) return std::nullopt;
    double with_rad = turn;
    double without_rad = 0;
    bool is_judged = false;
    for (const auto& [from, over] : {std::pair(after, before), std::pair(before, after)}) {
      const std::optional<int64_t> next = beyond(from, over, node);
      if (!next) continue;
      is_judged = true;
      with_rad += turn_rad(node, over, *next);
      without_rad += turn_rad(from, over, *next);
    }
    if (!is_judged || with_rad < kTurnsLess * without_rad) return std::nullopt;
    return Found{node, off_m, with_rad - without_rad};
  }

  const OsmPlaces& places_;
  const OsmNeighbours& neighbours_;
};

}  // namespace

std::vector<StrayNode> stray_nodes(const OsmPlaces& places, const OsmNeighbours& neighbours) {
  return Search(places, neighbours).run();
}

}  // namespace railfix::track
