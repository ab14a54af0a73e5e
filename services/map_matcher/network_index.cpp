#include "map_matcher/network_index.hpp"

#include <algorithm>
#include <cmath>
#include <deque>

#include "core/units.hpp"

namespace railfix::map_matcher {
namespace {

constexpr double kParallelRad = 0.3;
constexpr int kParts = 8;  // of a cell, to integrate the curvature

}  // namespace

NetworkIndex::NetworkIndex(std::shared_ptr<const track::Map> map)
    : map_(std::move(map)), ways_(*map_), finder_(map_), headings_(map_->edges.size()), balises_(map_->edges.size()) {
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
  for (const auto& landmark : map_->landmarks) {
    if (landmark.kind == track::LandmarkKind::balise && map_->edge(landmark.edge) != nullptr) {
      balises_[landmark.edge - 1].push_back(&landmark);
    }
  }
  std::vector<bool> used(map_->edges.size(), false);
  for (const auto& edge : map_->edges) {
    if (!used[edge.id - 1]) add_chain({&edge, true}, used);
  }
}

double NetworkIndex::heading_on(const track::Edge& edge, double offset_m) const {
  const auto& headings = headings_[edge.id - 1];
  const double cell = std::clamp(offset_m / kCellM, 0.0, static_cast<double>(headings.size()) - 1.0);
  const size_t i = std::min(static_cast<size_t>(cell), headings.size() >= 2 ? headings.size() - 2 : 0);
  if (headings.size() < 2) return 0;
  return headings[i] + (cell - static_cast<double>(i)) * (headings[i + 1] - headings[i]);
}

void NetworkIndex::add_chain(const track::Run& first, std::vector<bool>& used) {
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
  chains_.push_back(std::move(chain));
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
