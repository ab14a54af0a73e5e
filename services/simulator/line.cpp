#include "simulator/line.hpp"

#include <algorithm>
#include <cmath>

#include "core/units.hpp"

namespace railfix::simulator {
namespace {

constexpr double kShortestPathM = 50.0;
constexpr double kSeenBehindM = 10.0;
constexpr double kSeenAheadM = 260.0;
constexpr double kLonePlatformM = 120.0;
constexpr double kSameSideM = 1.0;     // marks of one platform are as far from the track
constexpr double kNearM = 40.0;        // edges so near to the path are drawn
constexpr double kBesideM = 9.0;       // landmarks of other tracks so near are landmarks of the path ...
constexpr double kAlongCosine = 0.94;  // ... but not of those that cross it at more than 20 degrees, on a bridge mostly
constexpr double kLongestTunnelM = 60000.0;
constexpr double kOneTunnelM = 6.0;  // tracks so near share a tunnel
constexpr double kTunnelHalfWidthM = 2.7;
constexpr double kAbutmentM = 4.5;      // from the outermost track
constexpr size_t kCoarse = 40;          // samples, 10 m
constexpr double kCountedM = 100000.0;  // places are counted from the track's beginning, at most so far behind
constexpr size_t kVeryCoarse = 80;

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
void add_to_spans(std::vector<Span>& spans, std::vector<bool>& open, const Thing& mark, double lone_length_m) {
  for (size_t i = 0; i < spans.size(); ++i) {
    if (open[i] && std::abs(spans[i].lateral_m - mark.lateral_m) < kSameSideM) {
      spans[i].end_m = mark.distance_m;
      open[i] = false;
      return;
    }
  }
  Span span{mark.distance_m, mark.distance_m + lone_length_m, mark.lateral_m};
  span.outward = mark.outward;
  spans.push_back(span);
  open.push_back(true);
}

double squared_gap(const CentreSample& a, double easting_m, double northing_m) {
  const double de = a.pose.easting_m - easting_m;
  const double dn = a.pose.northing_m - northing_m;
  return de * de + dn * dn;
}

// The sample nearest to a point: looked for in steps, then around the best one.
size_t nearest_sample(const CentreLine& line, double easting_m, double northing_m) {
  const auto best_of = [&](size_t from, size_t to, size_t step) {
    size_t best = from;
    for (size_t i = from; i < to; i += step) {
      if (squared_gap(line.samples[i], easting_m, northing_m) < squared_gap(line.samples[best], easting_m, northing_m))
        best = i;
    }
    return best;
  };
  const size_t coarse = best_of(0, line.samples.size(), kCoarse);
  return best_of(coarse > kCoarse ? coarse - kCoarse : 0, std::min(coarse + kCoarse, line.samples.size()), 1);
}

// Turns a branch so that it runs as the main line does, with the main line's distance where they are nearest.
void lay_beside(const CentreLine& main, CentreLine& branch) {
  double least = 1e18;
  size_t meeting = 0;
  size_t main_index = 0;
  const auto look_at = [&](size_t i) {
    const auto& place = branch.samples[i].pose;
    const size_t near = nearest_sample(main, place.easting_m, place.northing_m);
    const double gap = squared_gap(main.samples[near], place.easting_m, place.northing_m);
    if (gap >= least - 1e-9) return;
    least = gap;
    meeting = i;
    main_index = near;
  };
  for (size_t i = 0; i < branch.samples.size(); i += kVeryCoarse) look_at(i);
  look_at(branch.samples.size() - 1);
  const double turn = branch.samples[meeting].pose.heading_rad - main.samples[main_index].pose.heading_rad;
  if (std::cos(turn) < 0.0) {
    std::reverse(branch.samples.begin(), branch.samples.end());
    meeting = branch.samples.size() - 1 - meeting;
    for (auto& sample : branch.samples) {
      sample.pose.heading_rad += core::kPi;
      sample.curvature_per_m = -sample.curvature_per_m;
      sample.cant_m = -sample.cant_m;
    }
  }
  branch.begin_m = main.begin_m + (static_cast<double>(main_index) - static_cast<double>(meeting)) * kCentreStepM;
}

// Squares of the ground that are near the path.
class Neighbourhood {
 public:
  explicit Neighbourhood(const CentreLine& main) {
    for (size_t i = 0; i < main.samples.size(); i += kCoarse) {
      const auto& pose = main.samples[i].pose;
      for (const int64_t a : {-1, 0, 1}) {
        for (const int64_t b : {-1, 0, 1}) squares_.insert({square(pose.easting_m) + a, square(pose.northing_m) + b});
      }
    }
  }
  [[nodiscard]] bool has(const track::PlanPose& pose) const {
    return squares_.contains({square(pose.easting_m), square(pose.northing_m)});
  }

 private:
  static int64_t square(double metres) { return static_cast<int64_t>(std::floor(metres / kNearM)); }
  std::set<std::pair<int64_t, int64_t>> squares_;
};

bool comes_near(const Neighbourhood& neighbourhood, const track::Alignment& alignment) {
  for (double s = 0.0; s < alignment.length_m(); s += 10.0) {
    if (neighbourhood.has(alignment.at(s).pose)) return true;
  }
  return neighbourhood.has(alignment.at(alignment.length_m()).pose);
}

// The last portal behind its beginning was a way in.
bool begins_in_tunnel(const track::Path& way_here, double begin_m) {
  bool inside = false;
  for (const auto& mark : way_here.landmarks()) {
    if (mark.distance_m > begin_m) break;
    if (mark.kind == track::LandmarkKind::portal_in) inside = true;
    if (mark.kind == track::LandmarkKind::portal_out) inside = false;
  }
  return inside;
}

}  // namespace

std::set<uint32_t> edges_between(const track::Path& path, double from_m, double to_m) {
  std::set<uint32_t> edges{path.position_at(to_m).edge};
  for (double s = from_m; s < to_m; s += 1.0) edges.insert(path.position_at(s).edge);
  return edges;
}

core::Result<Line> Line::make(std::shared_ptr<const track::Map> map, const track::EdgePosition& start, double ahead_m,
                              const std::vector<uint32_t>& via) {
  auto counted = start;
  counted.direction = track::Direction::forward;
  const auto before = track::Path::follow(map, counted, 0.0, kCountedM);
  const auto way_here = track::Path::follow(map, start, 0.0, kLongestTunnelM);
  auto path = track::Path::follow(std::move(map), start, ahead_m + kSeenAheadM, kSeenBehindM, via);
  if (!path.ok()) return path.error();
  if (path.value().end_m() < kShortestPathM) {
    return core::Error{"the track ends " + std::to_string(static_cast<int>(path.value().end_m())) +
                       " m behind the start; start where at least 50 m lie ahead"};
  }
  Line line(std::move(path).value());
  line.counted_from_m_ = before.ok() ? -before.value().begin_m() : 0.0;
  line.counted_forward_ = start.direction != track::Direction::reverse;
  line.begins_in_tunnel_ = way_here.ok() && begins_in_tunnel(way_here.value(), line.path_.begin_m());
  line.sample_main();
  line.sample_branches();
  line.collect_things();
  line.collect_objects();
  line.place_distractors();
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
  const auto on_path = edges_between(path_, path_.begin_m(), path_.end_m());
  const Neighbourhood neighbourhood(main_);
  for (const auto& edge : path_.map().edges) {
    if (on_path.contains(edge.id) || !comes_near(neighbourhood, edge.alignment)) continue;
    CentreLine branch;
    branch.edge = edge.id;
    for (double s = 0.0; s <= edge.alignment.length_m(); s += kCentreStepM)
      branch.samples.push_back(sample_of(edge.alignment.at(s)));
    lay_beside(main_, branch);
    branches_.push_back(std::move(branch));
  }
}

Spot Line::spot_of(double easting_m, double northing_m) const {
  const size_t near = nearest_sample(main_, easting_m, northing_m);
  const auto& pose = main_.samples[near].pose;
  const double de = easting_m - pose.easting_m;
  const double dn = northing_m - pose.northing_m;
  const double along_m = de * std::sin(pose.heading_rad) + dn * std::cos(pose.heading_rad);
  return {main_.begin_m + static_cast<double>(near) * kCentreStepM + along_m,
          -de * std::cos(pose.heading_rad) + dn * std::sin(pose.heading_rad)};
}

void Line::collect_things() {
  for (const auto& mark : path_.landmarks())
    things_.push_back({mark.kind, mark.distance_m, mark.lateral_m, true, mark.lateral_m < 0.0 ? -1.0 : 1.0});
  for (const auto& branch : branches_) {
    const auto& alignment = path_.map().edge(branch.edge)->alignment;
    for (const auto* mark : path_.map().landmarks_on(branch.edge)) {
      const bool stands_beside = mark->kind == track::LandmarkKind::mast ||
                                 mark->kind == track::LandmarkKind::platform ||
                                 mark->kind == track::LandmarkKind::balise;
      if (!stands_beside) continue;
      const auto pose = alignment.at(mark->offset_m).pose;
      const auto centre = spot_of(pose.easting_m, pose.northing_m);
      const double turn = pose.heading_rad - sample_at(centre.distance_m).pose.heading_rad;
      if (std::abs(std::cos(turn)) < kAlongCosine) continue;
      const auto spot = spot_of(pose.easting_m - mark->lateral_m * std::cos(pose.heading_rad),
                                pose.northing_m + mark->lateral_m * std::sin(pose.heading_rad));
      const bool within = spot.distance_m > path_.begin_m() && spot.distance_m < path_.end_m();
      if (!within || std::abs(spot.lateral_m) > kBesideM) continue;
      const double outward = spot.lateral_m < centre.lateral_m ? -1.0 : 1.0;
      things_.push_back({mark->kind, spot.distance_m, spot.lateral_m, false, outward});
    }
  }
  std::stable_sort(things_.begin(), things_.end(),
                   [](const Thing& a, const Thing& b) { return a.distance_m < b.distance_m; });
}

void Line::collect_objects() {
  std::vector<bool> open_tunnels;
  std::vector<bool> open_platforms;
  const auto nearest_track = [&](const Spot& spot) {
    double nearest = 0.0;
    for (const double lateral_m : tracks_at(spot.distance_m)) {
      if (std::abs(lateral_m - spot.lateral_m) < std::abs(nearest - spot.lateral_m)) nearest = lateral_m;
    }
    return nearest;
  };
  if (begins_in_tunnel_) {
    tunnels_.push_back({path_.begin_m() - kSeenAheadM, path_.end_m() + kSeenAheadM});
    open_tunnels.push_back(true);
  }
  for (const auto& thing : things_) {
    const Spot spot{thing.distance_m, thing.lateral_m};
    switch (thing.kind) {
      case track::LandmarkKind::balise:
        balises_.push_back(spot);
        break;
      case track::LandmarkKind::mast:
        masts_.push_back({spot.distance_m, spot.lateral_m, nearest_track(spot)});
        break;
      case track::LandmarkKind::bridge:
        bridges_.push_back({spot.distance_m, kAbutmentM, -kAbutmentM});
        for (const double lateral_m : tracks_at(spot.distance_m)) {
          auto& bridge = bridges_.back();
          bridge.left_m = std::max(bridge.left_m, lateral_m + kAbutmentM);
          bridge.right_m = std::min(bridge.right_m, lateral_m - kAbutmentM);
        }
        break;
      case track::LandmarkKind::portal_in:
      case track::LandmarkKind::portal_out: {
        auto centred = thing;
        centred.lateral_m = 0.0;
        const bool inside_one = std::find(open_tunnels.begin(), open_tunnels.end(), true) != open_tunnels.end();
        if (thing.kind == track::LandmarkKind::portal_out && !inside_one) {
          // Of a tunnel whose way in the map lacks.
          tunnels_.push_back({path_.begin_m() - kSeenAheadM, thing.distance_m});
          open_tunnels.push_back(false);
          break;
        }
        add_to_spans(tunnels_, open_tunnels, centred, path_.end_m() + kSeenAheadM - thing.distance_m);
        break;
      }
      case track::LandmarkKind::platform:
        add_to_spans(platforms_, open_platforms, thing, kLonePlatformM);
        break;
      case track::LandmarkKind::frog:
      case track::LandmarkKind::level_crossing:
      case track::LandmarkKind::underbridge:
      case track::LandmarkKind::unknown:
        break;
    }
  }
  for (auto& tunnel : tunnels_) {
    for (const double lateral_m : tracks_at(tunnel.begin_m)) {
      if (std::abs(lateral_m) > kOneTunnelM) continue;
      tunnel.left_m = std::max(tunnel.left_m, lateral_m + kTunnelHalfWidthM);
      tunnel.right_m = std::min(tunnel.right_m, lateral_m - kTunnelHalfWidthM);
    }
  }
}

// Signals before stations and on the way, a board every 100 m, cabinets: where no track and nothing else is.
void Line::place_distractors() {
  const auto free = [&](double s, double d) {
    if (depth_in_tunnel_m(s) > 0.0) return false;
    for (const double lateral_m : tracks_at(s)) {
      if (std::abs(lateral_m - d) < 2.3) return false;
    }
    for (const auto& platform : platforms_) {
      if (s > platform.begin_m - 5.0 && s < platform.end_m + 5.0 && platform.outward * d > 0.0) return false;
    }
    return std::none_of(masts_.begin(), masts_.end(), [&](const Mast& mast) {
      return std::abs(mast.distance_m - s) < 2.0 && mast.lateral_m * d > 0.0;
    });
  };
  const auto add = [&](Distractor::Kind kind, double s, double d) {
    if (s > path_.begin_m() && free(s, d)) distractors_.push_back({kind, s, d});
  };
  // Counted along the edges, so that they stand at the same place in every run.
  for (double s = std::ceil(path_.begin_m()); s < path_.end_m(); s += 1.0) {
    const auto place = path_.position_at(s);
    const auto metre = static_cast<int64_t>(std::floor(place.offset_m));
    const double side = place.direction == track::Direction::reverse ? -1.0 : 1.0;
    if (metre % 100 == 50) add(Distractor::Kind::distance_board, s, -2.7 * side);
    if (metre % 430 == 215) add(Distractor::Kind::signal, s, -2.9);
    if (metre % 610 == 333) add(Distractor::Kind::speed_board, s, -2.6);
    if (metre % 370 == 111) add(Distractor::Kind::cabinet, s, 3.6 * side);
  }
}

const CentreSample& Line::sample_at(double distance_m) const {
  const double position =
      std::clamp((distance_m - main_.begin_m) / kCentreStepM, 0.0, static_cast<double>(main_.samples.size() - 1));
  return main_.samples[static_cast<size_t>(position)];
}

std::vector<double> Line::tracks_at(double distance_m) const {
  std::vector<double> laterals{0.0};
  const auto& here = sample_at(distance_m).pose;
  for (const auto& branch : branches_) {
    if (distance_m < branch.begin_m - 40.0 ||
        distance_m > branch.begin_m + static_cast<double>(branch.samples.size()) * kCentreStepM + 40.0)
      continue;
    const auto& near = branch.samples[nearest_sample(branch, here.easting_m, here.northing_m)].pose;
    const double de = near.easting_m - here.easting_m;
    const double dn = near.northing_m - here.northing_m;
    const double along_m = de * std::sin(here.heading_rad) + dn * std::cos(here.heading_rad);
    if (std::abs(along_m) < 1.0) laterals.push_back(-de * std::cos(here.heading_rad) + dn * std::sin(here.heading_rad));
  }
  return laterals;
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
