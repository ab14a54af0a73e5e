#include "map_matcher/network_index.hpp"

#include <algorithm>
#include <cmath>

#include "core/units.hpp"

namespace railfix::map_matcher {
namespace {

constexpr double kParallelRad = 0.3;
constexpr int kParts = 8;  // of a cell, to integrate the curvature

}  // namespace

NetworkIndex::NetworkIndex(std::shared_ptr<const track::Map> map)
    : map_(std::move(map)), ways_(*map_), finder_(map_), headings_(map_->edges.size()), marks_(2 * map_->edges.size()) {
  for (const auto& edge : map_->edges) {
    auto& headings = headings_[edge.id - 1];
    double heading = 0;
    headings.push_back(0);
    for (double from_m = 0; from_m < edge.alignment.length_m(); from_m += kCellM) {
      // Elements of real maps may be as short as a few metres.
      for (int i = 0; i < kParts; ++i) {
        heading += kCellM / kParts * edge.alignment.curvature_at(from_m + kCellM * (i + 0.5) / kParts);
      }
      headings.push_back(static_cast<float>(heading));
    }
  }
  for (const auto& l : map_->landmarks) {
    const auto* edge = map_->edge(l.edge);
    if (edge == nullptr || !is_mark(l.kind)) continue;
    const double length_m = edge->alignment.length_m();
    marks_[2 * (l.edge - 1)].push_back({l.offset_m, mark_kind(l.kind), l.lateral_m});
    marks_[2 * (l.edge - 1) + 1].push_back({length_m - l.offset_m, mark_kind(l.kind), -l.lateral_m});
  }
  for (auto& marks : marks_) {
    std::sort(marks.begin(), marks.end(), [](const Mark& a, const Mark& b) { return a.along_m < b.along_m; });
  }
  std::vector<bool> used(map_->edges.size(), false);
  for (const auto& edge : map_->edges) {
    if (!used[edge.id - 1]) add_straight_on({&edge, true}, used);
    for (const bool forward : {true, false}) {
      const track::Run run{&edge, forward};
      const auto& legs = ways_.after(run);
      for (size_t i = 1; i < legs.size(); ++i) add_through(run, legs[i]);
    }
  }
}

double NetworkIndex::heading_on(const track::Edge& edge, double offset_m) const {
  const auto& headings = headings_[edge.id - 1];
  const double cell = std::clamp(offset_m / kCellM, 0.0, static_cast<double>(headings.size()) - 1.0);
  const size_t i = std::min(static_cast<size_t>(cell), headings.size() >= 2 ? headings.size() - 2 : 0);
  if (headings.size() < 2) return 0;
  return headings[i] + (cell - static_cast<double>(i)) * (headings[i + 1] - headings[i]);
}

void NetworkIndex::add_straight_on(const track::Run& first, std::vector<bool>& used) {
  std::deque<track::Run> runs{first};
  used[first.edge->id - 1] = true;
  for (const bool ahead : {true, false}) {
    while (true) {
      const track::Run end = ahead ? runs.back() : runs.front().reversed();
      const auto& next = ways_.after(end);
      if (next.empty() || used[next.front().edge->id - 1]) break;
      const auto& back = ways_.after(next.front().reversed());
      if (back.empty() || !(back.front() == end.reversed())) break;
      used[next.front().edge->id - 1] = true;
      ahead ? runs.push_back(next.front()) : runs.push_front(next.front().reversed());
    }
  }
  chains_.push_back(chain_of(runs));
}

void NetworkIndex::add_through(const track::Run& from, const track::Run& leg) {
  std::deque<track::Run> runs{from, leg};
  double ahead_m = leg.length_m();
  while (ahead_m < kReachM) {
    const auto& next = ways_.after(runs.back());
    if (next.empty()) break;
    ahead_m += next.front().length_m();
    runs.push_back(next.front());
  }
  double behind_m = from.length_m();
  while (behind_m < kReachM) {
    const auto& before = ways_.after(runs.front().reversed());
    if (before.empty()) break;
    behind_m += before.front().length_m();
    runs.push_front(before.front().reversed());
  }
  // Of the runs at the ends only what is near.
  Chain chain = chain_of(runs);
  const auto first = static_cast<std::ptrdiff_t>(std::max(0.0, behind_m - kReachM) / kCellM);
  const auto last = std::min(std::ssize(chain.heading_rad), static_cast<std::ptrdiff_t>((behind_m + kReachM) / kCellM));
  chain.heading_rad = {chain.heading_rad.begin() + first, chain.heading_rad.begin() + last};
  const double cut_m = kCellM * static_cast<double>(first);
  for (auto& l : chain.legs) l.begin_m -= cut_m;
  chain.through_m = behind_m - cut_m;
  chain.length_m = kCellM * static_cast<double>(last - first);
  chains_.push_back(std::move(chain));
}

NetworkIndex::Chain NetworkIndex::chain_of(const std::deque<track::Run>& runs) const {
  Chain chain;
  double heading = 0;
  for (const auto& run : runs) {
    chain.legs.push_back({run, chain.length_m});
    const double end_m = chain.length_m + run.length_m();
    for (double m = kCellM * static_cast<double>(chain.heading_rad.size()); m < end_m; m += kCellM) {
      chain.heading_rad.push_back(static_cast<float>(heading + turned(run, m - chain.length_m)));
    }
    heading += turned(run, run.length_m());
    chain.length_m = end_m;
  }
  return chain;
}

std::vector<NetworkIndex::Beside> NetworkIndex::beside(const track::Run& run, double into_m, double within_m) const {
  const auto heading = [](const track::Run& r, double into) {
    const auto pose = r.edge->alignment.at(r.forward ? into : r.length_m() - into).pose;
    return pose.heading_rad + (r.forward ? 0.0 : core::kPi);
  };
  const auto pose = run.edge->alignment.at(run.forward ? into_m : run.length_m() - into_m).pose;
  std::vector<Beside> found;
  for (const auto& near : finder_.near(pose.easting_m, pose.northing_m, within_m)) {
    for (const bool forward : {true, false}) {
      const track::Run other{map_->edge(near.edge), forward};
      const double into = forward ? near.offset_m : other.length_m() - near.offset_m;
      const double turn = core::wrap_pi(heading(other, into) - heading(run, into_m));
      if (std::abs(turn) < kParallelRad) found.push_back({other, into});
    }
  }
  return found;
}

double NetworkIndex::turned(const track::Run& run, double into_m) const {
  if (run.forward) return heading_on(*run.edge, into_m);
  const double length_m = run.length_m();
  return heading_on(*run.edge, length_m - into_m) - heading_on(*run.edge, length_m);
}

}  // namespace railfix::map_matcher
