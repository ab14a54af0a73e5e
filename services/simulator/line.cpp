#include "simulator/line.hpp"

#include <algorithm>
#include <cmath>
#include <set>

#include "core/units.hpp"

namespace railfix::simulator {
namespace {

constexpr double kShortestPathM = 50.0;
constexpr double kSeenBehindM = 10.0;
constexpr double kSeenAheadM = 260.0;
constexpr double kLonePlatformM = 120.0;

CentreSample sample_of(const track::TrackPoint& point) {
  return {point.pose, point.elevation_m, point.curvature_per_m, point.cant_m};
}

// Where the map ends the rails run straight on, so that the picture has something to show.
CentreSample straight_on(CentreSample from, double distance_m) {
  from.pose = track::advance(from.pose, track::Element{1.0, 0.0, 0.0}, distance_m);
  from.curvature_per_m = 0.0;
  return from;
}

// Pairs neighbouring marks to spans; a lone one gets a usual length.
void add_to_spans(std::vector<Span>& spans, std::vector<bool>& open, const track::PathLandmark& mark,
                  double lone_length_m) {
  for (size_t i = 0; i < spans.size(); ++i) {
    if (open[i] && spans[i].lateral_m * mark.lateral_m >= 0.0) {
      spans[i].end_m = mark.distance_m;
      open[i] = false;
      return;
    }
  }
  spans.push_back({mark.distance_m, mark.distance_m + lone_length_m, mark.lateral_m});
  open.push_back(true);
}

struct Nearest {
  double distance_m;  // on the main line
  double gap_m;
};
Nearest nearest_on(const CentreLine& main, const CentreSample& place) {
  Nearest nearest{0.0, 1e9};
  for (size_t i = 0; i < main.samples.size(); ++i) {
    const auto& pose = main.samples[i].pose;
    const double gap_m = std::hypot(pose.easting_m - place.pose.easting_m, pose.northing_m - place.pose.northing_m);
    if (gap_m < nearest.gap_m) nearest = {main.begin_m + static_cast<double>(i) * kCentreStepM, gap_m};
  }
  return nearest;
}

// Turns a branch so that it runs as the main line does, with the main line's distance where they meet.
void lay_beside(const CentreLine& main, CentreLine& branch) {
  auto first = nearest_on(main, branch.samples.front());
  auto last = nearest_on(main, branch.samples.back());
  if (last.distance_m < first.distance_m) {
    std::reverse(branch.samples.begin(), branch.samples.end());
    std::swap(first, last);
    for (auto& sample : branch.samples) {
      sample.pose.heading_rad += core::kPi;
      sample.curvature_per_m = -sample.curvature_per_m;
      sample.cant_m = -sample.cant_m;
    }
  }
  const double length_m = static_cast<double>(branch.samples.size() - 1) * kCentreStepM;
  branch.begin_m = first.gap_m <= last.gap_m ? first.distance_m : last.distance_m - length_m;
}

}  // namespace

core::Result<Line> Line::make(std::shared_ptr<const track::Map> map, const track::EdgePosition& start, double ahead_m) {
  auto path = track::Path::follow(std::move(map), start, ahead_m + kSeenAheadM, kSeenBehindM);
  if (!path.ok()) return path.error();
  if (path.value().end_m() < kShortestPathM) {
    return core::Error{"the track ends " + std::to_string(static_cast<int>(path.value().end_m())) +
                       " m behind the start; start where at least 50 m lie ahead"};
  }
  Line line(std::move(path).value());
  line.sample_main();
  line.sample_branches();
  line.collect_objects();
  return line;
}

void Line::sample_main() {
  main_.begin_m = path_.begin_m() - kSeenBehindM;
  const auto count = static_cast<size_t>((path_.end_m() + kSeenAheadM - main_.begin_m) / kCentreStepM);
  main_.samples.reserve(count);
  for (size_t i = 0; i < count; ++i) {
    const double distance_m = main_.begin_m + static_cast<double>(i) * kCentreStepM;
    const double inside_m = std::clamp(distance_m, path_.begin_m(), path_.end_m());
    auto sample = sample_of(path_.at(inside_m));
    if (inside_m != distance_m) sample = straight_on(sample, distance_m - inside_m);
    main_.samples.push_back(sample);
  }
}

void Line::sample_branches() {
  std::set<uint32_t> on_path;
  std::set<uint32_t> nodes;
  for (double s = path_.begin_m(); s <= path_.end_m(); s += 1.0) {
    const auto* edge = path_.map().edge(path_.position_at(s).edge);
    if (edge == nullptr || !on_path.insert(edge->id).second) continue;
    nodes.insert({edge->from_node, edge->to_node});
  }
  std::set<uint32_t> beside;
  const auto& map = path_.map();
  for (const auto& edge : map.edges) {
    const bool meets = nodes.contains(edge.from_node) || nodes.contains(edge.to_node);
    if (meets && !on_path.contains(edge.id)) beside.insert(edge.id);
  }
  for (const uint32_t id : beside) {
    const auto& alignment = map.edge(id)->alignment;
    CentreLine branch;
    for (double s = 0.0; s <= alignment.length_m(); s += kCentreStepM)
      branch.samples.push_back(sample_of(alignment.at(s)));
    lay_beside(main_, branch);
    branches_.push_back(std::move(branch));
  }
}

void Line::collect_objects() {
  std::vector<bool> open_tunnels;
  std::vector<bool> open_platforms;
  for (const auto& mark : path_.landmarks()) {
    const Spot spot{mark.distance_m, mark.lateral_m};
    switch (mark.landmark->kind) {
      case track::LandmarkKind::balise:
        balises_.push_back(spot);
        break;
      case track::LandmarkKind::mast:
        masts_.push_back(spot);
        break;
      case track::LandmarkKind::bridge:
        bridges_.push_back(spot);
        break;
      case track::LandmarkKind::portal_in:
      case track::LandmarkKind::portal_out: {
        auto centred = mark;
        centred.lateral_m = 0.0;
        add_to_spans(tunnels_, open_tunnels, centred, path_.end_m() + kSeenAheadM - mark.distance_m);
        break;
      }
      case track::LandmarkKind::platform:
        add_to_spans(platforms_, open_platforms, mark, kLonePlatformM);
        break;
      case track::LandmarkKind::frog:
      case track::LandmarkKind::unknown:
        break;
    }
  }
}

double Line::depth_in_tunnel_m(double distance_m) const {
  for (const auto& tunnel : tunnels_) {
    if (distance_m > tunnel.begin_m && distance_m < tunnel.end_m) {
      return std::min(distance_m - tunnel.begin_m, tunnel.end_m - distance_m);
    }
  }
  return 0.0;
}

}  // namespace railfix::simulator
