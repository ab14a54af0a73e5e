#include "map_matcher/locate/network_index.hpp"

#include <algorithm>
#include <cmath>

#include "core/units.hpp"

namespace railfix::map_matcher {
namespace {

constexpr int kParts = 8;  // of a cell, to integrate the curvature

}  // namespace

NetworkIndex::NetworkIndex(std::shared_ptr<const track::Map> map)
    : map_(std::move(map)), ways_(*map_), finder_(map_), marks_(2 * map_->edges.size()), after_(marks_.size()) {
  for (const auto& edge : map_->edges) {
    first_cells_.push_back(headings_.size());
    const double length_m = edge.alignment.length_m();
    lengths_m_.push_back(static_cast<float>(length_m));
    double heading = 0;
    headings_.push_back(0);
    for (double from_m = 0; from_m < length_m || from_m == 0; from_m += kCellM) {
      // Elements of real maps may be as short as a few metres.
      for (int i = 0; i < kParts; ++i) {
        heading += kCellM / kParts * edge.alignment.curvature_at(from_m + kCellM * (i + 0.5) / kParts);
      }
      headings_.push_back(static_cast<float>(heading));
    }
  }
  first_cells_.push_back(headings_.size());
  for (uint32_t i = 0; i < lengths_m_.size(); ++i) ends_rad_.push_back(heading_on<float>(i, lengths_m_[i]));
  for (uint32_t i = 0; i < after_.size(); ++i) {
    for (const auto& next : ways_.after(run(i))) after_[i].push_back(number(next));
  }
  for (const auto& l : map_->landmarks) {
    const auto* edge = map_->edge(l.edge);
    if (edge == nullptr || !is_mark(l.kind)) continue;
    const double length_m = edge->alignment.length_m();
    const size_t run = 2 * (size_t{l.edge} - 1);
    marks_[run].push_back({l.offset_m, mark_kind(l.kind), l.lateral_m});
    marks_[run + 1].push_back({length_m - l.offset_m, mark_kind(l.kind), -l.lateral_m});
  }
  for (auto& marks : marks_) {
    std::sort(marks.begin(), marks.end(), [](const Mark& a, const Mark& b) { return a.along_m < b.along_m; });
  }
}

std::vector<NetworkIndex::Beside> NetworkIndex::beside(const track::Run& run, double into_m, double within_m) const {
  const auto pose = run.pose_at(into_m);
  std::vector<Beside> found;
  for (const auto& near : finder_.near(pose.easting_m, pose.northing_m, within_m)) {
    for (const bool forward : {true, false}) {
      const track::Run other{map_->edge(near.edge), forward};
      const double into = other.into_m(near.offset_m);
      const double turn_rad = core::wrap_pi(other.pose_at(into).heading_rad - pose.heading_rad);
      if (std::abs(turn_rad) < kParallelRad) found.push_back({other, into});
    }
  }
  return found;
}

}  // namespace railfix::map_matcher
