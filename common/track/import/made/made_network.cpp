#include "track/import/made/made_network.hpp"

#include <algorithm>
#include <cmath>

#include "core/units.hpp"
#include "track/import/finish.hpp"
#include "track/import/made/made_lines.hpp"
#include "track/import/network.hpp"

namespace railfix::track {
namespace {

constexpr double kLineKm = 67.0;  // of track, about, between two junctions of a large network
constexpr double kCrossoverRadiusM = 300.0;
constexpr double kMarginM = 40.0;        // from a curve to the first switch, and between switches
constexpr double kShortestLoopM = 80.0;  // between the switches' curves
constexpr double kLongestLoopM = 700.0;
constexpr double kPlatformM = 1.6;
constexpr double kBaliseSpacingM = 3.0;
constexpr double kSurveyedM = 0.1;
constexpr uint32_t kGroupsPerCountry = 16000;

/// A track of a line with the nodes on it.
struct Laid {
  ImportedTrack* track = nullptr;
  std::vector<TrackCut> cuts;

  [[nodiscard]] PlanPose pose(double offset_m) const { return track->alignment.at(offset_m).pose; }
  /// The offset beside a place on the other track.
  [[nodiscard]] double beside(const PlanPose& pose) const {
    return track->alignment.nearest(pose.easting_m, pose.northing_m).offset_m;
  }
};

double length_of(const Map& map) {
  double sum = 0;
  for (const Edge& edge : map.edges) sum += edge.alignment.length_m();
  return sum;
}

class Assembler {
 public:
  Assembler(MadeLines lines, const MadeNetworkOptions& options)
      : lines_(std::move(lines)), options_(options), random_(options.seed + 77) {}

  Map assemble() {
    for (size_t i = 0; i < lines_.junctions.size(); ++i) add_junction(i);
    for (MadeLine& line : lines_.lines) add_line(line);
    Map map;
    map.name = "made network, seed " + std::to_string(options_.seed);
    map.source = "made up";
    map.q_locacc_m = 1;
    map.crs = "EPSG:32632";
    append(draft_, map);
    add_frogs(map, 0.1);
    return map;
  }

 private:
  size_t add_node(const PlanPose& pose, bool is_switch) {
    draft_.nodes.push_back(
        {is_switch ? "W" + std::to_string(++switches_) : "", pose.easting_m, pose.northing_m, is_switch, false});
    return draft_.nodes.size() - 1;
  }

  size_t cut(Laid& laid, double offset_m) {
    const size_t node = add_node(laid.pose(offset_m), true);
    laid.cuts.push_back({offset_m, node});
    return node;
  }

  void lay(Laid& laid) {
    std::sort(laid.cuts.begin(), laid.cuts.end(),
              [](const TrackCut& a, const TrackCut& b) { return a.offset_m < b.offset_m; });
    add_pieces(*laid.track, laid.cuts, draft_);
  }

  void add_junction(size_t index) {
    const MadeJunction& junction = lines_.junctions[index];
    PlanPose begin = junction.leaving(0);
    begin.heading_rad = junction.middle.heading_rad;
    ImportedTrack track{
        .name = "J" + std::to_string(index + 1),
        .line = "J" + std::to_string(index + 1),
        .alignment = Alignment::chained(begin, {{junction.length_m, 0, 0}}, {{0, junction.elevation_m, 0}}),
        .marks = {},
        .groups = {}};
    Laid laid{&track, {}};
    for (const size_t side : {0U, 1U}) {
      ends_.push_back(add_node(junction.leaving(side), junction.lines[side].size() > 1));
      laid.cuts.push_back({side == 0 ? 0.0 : junction.length_m, ends_.back()});
    }
    add_station(laid, nullptr, {0, junction.length_m}, track.name);
    add_balises(track);
    lay(laid);
  }

  [[nodiscard]] size_t end_node(size_t junction, size_t side) const { return ends_[2 * junction + side]; }

  void add_line(MadeLine& line) {
    Laid main{&line.main, {}};
    main.cuts = {{0, end_node(line.junctions[0], line.sides[0])},
                 {line.main.alignment.length_m(), end_node(line.junctions[1], line.sides[1])}};
    Laid second{&line.second, {}};
    if (line.has_second()) {
      second.cuts = {{0, cut(main, line.second_from_m)},
                     {line.second.alignment.length_m(), cut(main, line.second_to_m)}};
    }
    double next_station = random_.uniform(2000, 6000);
    size_t number = 0;
    for (size_t i = 1; i + 1 < line.straights.size(); ++i) {
      const StraightStretch& straight = line.straights[i];
      if (straight.to_m < next_station) continue;
      const std::string name = "S" + line.name.substr(1) + "." + std::to_string(number + 1);
      if (!add_station(main, line.has_second() ? &second : nullptr, straight, name)) continue;
      ++number;
      next_station = straight.to_m + random_.uniform(3000, 8000);
    }
    add_structures(line);
    for (ImportedTrack* track : {&line.main, &line.second}) {
      if (track->alignment.elements().empty()) continue;
      add_balises(*track);
      add_masts(*track);
    }
    lay(main);
    if (line.has_second()) lay(second);
  }

  /// Loops beside the tracks, crossovers between them, a platform. Nothing where the straight is too short.
  bool add_station(Laid& main, Laid* second, const StraightStretch& straight, const std::string& name) {
    const double crossover = sideways_length_m(kMadeTrackSpacingM, kCrossoverRadiusM);
    const double wide = random_.uniform() < 0.4 ? 10.5 : 4.75;
    const double swing = sideways_length_m(wide, kCrossoverRadiusM);
    double from = straight.from_m + kMarginM;
    double to = straight.to_m - kMarginM;
    const double least = 2.0 * swing + kShortestLoopM + (second != nullptr ? 2.0 * (crossover + kMarginM) : 0.0);
    if (to - from < least) return false;
    const double spare = std::max(0.0, to - from - least - kLongestLoopM);
    from += random_.uniform(0, spare);
    to = std::min(to, from + least + kLongestLoopM);
    if (second != nullptr) {
      add_crossover(main, *second, from, from + crossover, name + "x");
      add_crossover(main, *second, to, to - crossover, name + "y");
      from += crossover + kMarginM;
      to -= crossover + kMarginM;
      add_loop(*second, second->beside(main.pose(from)), second->beside(main.pose(to)), wide, name + "b");
    }
    add_loop(main, from, to, -wide, name + "a");
    const double platform = from + swing;
    main.track->marks.push_back({LandmarkKind::platform, platform, -kPlatformM, kSurveyedM, name + " begin"});
    main.track->marks.push_back({LandmarkKind::platform, to - swing, -kPlatformM, kSurveyedM, name + " end"});
    return true;
  }

  void add_crossover(Laid& main, Laid& second, double on_main_m, double on_second_at_m, const std::string& name) {
    const bool forward = on_second_at_m > on_main_m;
    const double on_second = second.beside(main.pose(on_second_at_m));
    const size_t a = cut(main, on_main_m);
    const size_t b = cut(second, on_second);
    // Drawn the way that offsets grow: from the main track, or from the second.
    const PlanPose begin = forward ? main.pose(on_main_m) : second.pose(on_second);
    add_side_track(
        name,
        Alignment::chained(begin, sideways(forward ? kMadeTrackSpacingM : -kMadeTrackSpacingM, kCrossoverRadiusM)),
        forward ? a : b, forward ? b : a, main, on_main_m);
  }

  void add_loop(Laid& track, double from_m, double to_m, double left_m, const std::string& name) {
    std::vector<Element> elements = sideways(left_m, kCrossoverRadiusM);
    const std::vector<Element> back = sideways(-left_m, kCrossoverRadiusM);
    elements.push_back({to_m - from_m - 2.0 * sideways_length_m(left_m, kCrossoverRadiusM), 0, 0});
    elements.insert(elements.end(), back.begin(), back.end());
    const size_t a = cut(track, from_m);
    const size_t b = cut(track, to_m);
    add_side_track(name, Alignment::chained(track.pose(from_m), elements), a, b, track, from_m);
  }

  void add_side_track(const std::string& name, const Alignment& plan, size_t from, size_t to, const Laid& beside,
                      double at_m) {
    const double grade = beside.track->alignment.at(at_m).grade;
    const double begin = beside.track->alignment.at(at_m).elevation_m;
    const ImportedTrack track{
        .name = name,
        .line = name,
        .alignment = Alignment(plan.elements(), plan.starts(),
                               {{0, begin, 0}, {plan.length_m(), begin + grade * plan.length_m(), 0}}, {}),
        .marks = {},
        .groups = {}};
    add_pieces(track, {{0, from}, {plan.length_m(), to}}, draft_);
  }

  void add_balises(ImportedTrack& track) {
    const double length = track.alignment.length_m();
    for (double s = random_.uniform(100, 900); s + kBaliseSpacingM + 1 < length; s += random_.uniform(900, 1900)) {
      TrackGroup group{.nid_c = 1 + groups_ / kGroupsPerCountry,
                       .nid_bg = 1 + groups_ % kGroupsPerCountry,
                       .offset_m = s,
                       .nominal_is_forward = random_.uniform() < 0.5,
                       .q_locacc_m = 1,
                       .balises = {}};
      ++groups_;
      // The reference is the balise that a train meets first in the nominal direction.
      const double step = group.nominal_is_forward ? kBaliseSpacingM : -kBaliseSpacingM;
      for (const double at : {s, s + step}) group.balises.push_back({LandmarkKind::balise, at, 0, kSurveyedM, ""});
      track.groups.push_back(std::move(group));
    }
  }

  /// Tunnels, bridges over the line; on both tracks at the same place.
  void add_structures(MadeLine& line) {
    const double length = line.main.alignment.length_m();
    const bool is_flat = line.terrain.grade < 0.01;
    for (double s = random_.uniform(500, 5000); s < length - 500; s += random_.uniform(1500, 7000)) {
      if (!is_flat && random_.uniform() < 0.4) {
        const double tunnel = std::min(random_.uniform(80, 1500), length - 300 - s);
        add_on_both(line, LandmarkKind::portal_in, s);
        add_on_both(line, LandmarkKind::portal_out, s + tunnel);
        s += tunnel;
      } else {
        add_on_both(line, LandmarkKind::bridge, s);
      }
    }
  }

  void add_on_both(MadeLine& line, LandmarkKind kind, double offset_m) {
    line.main.marks.push_back({kind, offset_m, 0, kSurveyedM, ""});
    if (!line.has_second() || offset_m < line.second_from_m + 50 || offset_m > line.second_to_m - 50) return;
    const PlanPose pose = line.main.alignment.at(offset_m).pose;
    const double beside = line.second.alignment.nearest(pose.easting_m, pose.northing_m).offset_m;
    line.second.marks.push_back({kind, beside, 0, kSurveyedM, ""});
  }

  void add_masts(ImportedTrack& track) {
    if (!(options_.mast_spacing_m > 0)) return;
    const double side = track.name.ends_with("b") ? 3.3 : -3.3;
    for (double s = 20; s < track.alignment.length_m(); s += options_.mast_spacing_m * random_.uniform(0.85, 1.15))
      track.marks.push_back({LandmarkKind::mast, s, side, kSurveyedM, ""});
  }

  MadeLines lines_;
  const MadeNetworkOptions& options_;
  core::Random random_;
  Draft draft_;
  std::vector<size_t> ends_;  // nodes, two a junction
  size_t switches_ = 0;
  uint32_t groups_ = 0;
};

}  // namespace

Map made_network(const MadeNetworkOptions& options) {
  const double lines = options.track_km / kLineKm;
  const auto n = std::max<size_t>(2, static_cast<size_t>(std::lround(0.5 + std::sqrt(0.25 + lines / 1.8))));
  const double wanted_m = options.track_km * 1e3;
  double spacing_m = 40000;
  for (int i = 0; i < 3; ++i) spacing_m *= wanted_m / make_lines(n, spacing_m, options.seed).length_m();
  // Then again with the stations' tracks counted.
  const Map first = Assembler(make_lines(n, spacing_m, options.seed), options).assemble();
  spacing_m *= wanted_m / length_of(first);
  return Assembler(make_lines(n, spacing_m, options.seed), options).assemble();
}

}  // namespace railfix::track
