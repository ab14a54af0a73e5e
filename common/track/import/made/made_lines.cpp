#include "track/import/made/made_lines.hpp"

#include <algorithm>
#include <cmath>

#include "core/units.hpp"
#include "track/import/fit/plane.hpp"

namespace railfix::track {
namespace {

constexpr double kJunctionM = 1200.0;
constexpr double kTurnoutRadiusM = 500.0;
constexpr double kBranchRadiusM = 1200.0;
constexpr double kBranchTurnRad = 0.08;
constexpr double kClearM = 120.0;  // from a junction's turnout, beyond its frog
constexpr double kMostCantM = 0.15;
constexpr double kCantBaseM = 1.5;
constexpr double kLeastRamp = 500.0;  // metres of clothoid per metre of cant
constexpr std::array<Terrain, 3> kTerrains{
    {{2200, 0.10, 1200, 4000, 0.006, 44}, {1300, 0.20, 450, 1500, 0.013, 33}, {800, 0.28, 250, 600, 0.025, 22}}};

Eigen::Vector2d place_of(const PlanPose& pose) {
  return {pose.easting_m, pose.northing_m};
}

/// The way out of a junction: nothing, or the arc of a turnout.
struct WayOut {
  std::vector<Element> elements;
  PlanPose start;
  PlanPose end;
};

class LineMaker {
 public:
  LineMaker(MadeLine& line, const std::vector<MadeJunction>& junctions, double spacing_m, core::Random random)
      : line_(line), junctions_(junctions), spacing_m_(spacing_m), random_(random) {}

  void make(size_t index, bool has_second) {
    for (const size_t i : {0U, 1U}) ways_[i] = way_out(index, i);
    draw_polygon();
    make_main();
    if (has_second) make_second();
  }

 private:
  [[nodiscard]] WayOut way_out(size_t index, size_t end) const {
    const MadeJunction& junction = junctions_[line_.junctions[end]];
    const size_t side = line_.sides[end];
    WayOut out;
    out.start = out.end = junction.leaving(side);
    if (junction.lines[side].front() == index) return out;
    // A branch leaves towards the junction at its other end.
    const Eigen::Vector2d away = place_of(junctions_[line_.junctions[1 - end]].middle) - place_of(junction.middle);
    const Eigen::Vector2d ahead = direction_of(out.start.heading_rad);
    const double side_of = std::copysign(1.0, ahead.x() * away.y() - ahead.y() * away.x());
    out.elements = {{kBranchRadiusM * kBranchTurnRad, side_of / kBranchRadiusM, side_of / kBranchRadiusM}};
    out.end = advance(out.start, out.elements[0], out.elements[0].length_m);
    return out;
  }

  void draw_polygon() {
    begin_ = place_of(ways_[0].end);
    end_ = place_of(ways_[1].end);
    const double first = std::min(random_.uniform(1200, 2400), 0.15 * spacing_m_);
    const double last = std::min(random_.uniform(1200, 2400), 0.15 * spacing_m_);
    const Eigen::Vector2d from = begin_ + first * direction_of(ways_[0].end.heading_rad);
    const Eigen::Vector2d to = end_ + last * direction_of(ways_[1].end.heading_rad);
    const Eigen::Vector2d way = to - from;
    const Eigen::Vector2d left = Eigen::Vector2d(-way.y(), way.x()).normalized();
    const auto legs = std::max<size_t>(2, static_cast<size_t>(way.norm() / line_.terrain.leg_m));
    const double leg = way.norm() / static_cast<double>(legs);
    add_corner(from);
    double aside = 0;
    for (size_t i = 1; i < legs; ++i) {
      aside = 0.7 * aside + random_.uniform(-1, 1) * line_.terrain.wander * leg;
      const double along = static_cast<double>(i) + random_.uniform(-0.25, 0.25);
      add_corner(from + along / static_cast<double>(legs) * way + aside * left);
    }
    add_corner(to);
  }

  void add_corner(const Eigen::Vector2d& at) {
    const Terrain& terrain = line_.terrain;
    // Radii as they are designed, in steps; small ones as frequent as large ones on a scale of logarithms.
    const double radius = std::exp(random_.uniform(std::log(terrain.least_radius_m), std::log(terrain.most_radius_m)));
    const double round_radius = 25.0 * std::round(radius / 25.0);
    const double transition = std::max(40.0, 10.0 * std::round(60.0 * cant(1.0 / round_radius)));
    corners_.push_back({at, round_radius, transition});
  }

  /// Half of what balances the speed, as on lines of mixed traffic.
  [[nodiscard]] double cant(double curvature_per_m) const {
    const double balance =
        kCantBaseM * line_.terrain.speed_mps * line_.terrain.speed_mps * curvature_per_m / core::kGravityMps2;
    return std::clamp(0.6 * balance, -kMostCantM, kMostCantM);
  }

  void make_main() {
    const RoundedPolygon round = round_corners(begin_, corners_, end_);
    std::vector<Element> elements = ways_[0].elements;
    std::vector<PlanPose> starts(elements.size(), ways_[0].start);
    const double before = elements.empty() ? 0.0 : elements[0].length_m;
    append(round, elements, starts);
    for (const Element& out : ways_[1].elements) {  // run towards the junction
      elements.push_back({out.length_m, -out.curvature_start_per_m, -out.curvature_start_per_m});
      starts.push_back(turned_round(ways_[1].end));
    }
    for (StraightStretch stretch : round.straights)
      line_.straights.push_back({stretch.from_m + before, stretch.to_m + before});
    std::vector<CantPoint> canted = cant_of(elements, ways_[0].elements.size(), ways_[1].elements.size());
    const double length = before + round.length_m + (ways_[1].elements.empty() ? 0.0 : elements.back().length_m);
    line_.main = {.name = line_.name, .line = line_.name, .alignment = {}, .marks = {}, .groups = {}};
    line_.main.alignment = Alignment(std::move(elements), std::move(starts), profile_over(length), std::move(canted));
  }

  static void append(const RoundedPolygon& round, std::vector<Element>& elements, std::vector<PlanPose>& starts) {
    elements.insert(elements.end(), round.elements.begin(), round.elements.end());
    starts.insert(starts.end(), round.starts.begin(), round.starts.end());
  }

  /// Cant follows the curvature, but for the turnouts at the ends.
  [[nodiscard]] std::vector<CantPoint> cant_of(const std::vector<Element>& elements, size_t skip_first,
                                               size_t skip_last) const {
    std::vector<CantPoint> out;
    double offset = 0;
    for (size_t i = 0; i < elements.size(); ++i) {
      double applied = 0;
      if (i > skip_first && i + skip_last < elements.size()) {
        // A curve whose clothoids had to be short has as little cant as they can ramp up.
        const Element& before = elements[i - 1];
        const bool ramps_up = before.curvature_start_per_m == 0.0;
        const double most = (ramps_up ? before : elements[i]).length_m / kLeastRamp;
        applied = std::clamp(cant(elements[i].curvature_start_per_m), -most, most);
      }
      out.push_back({offset, applied});
      offset += elements[i].length_m;
    }
    out.push_back({offset, 0.0});
    return out;
  }

  /// Grades one after the other, tilted so that the line ends at the height of the junction there.
  [[nodiscard]] std::vector<GradePoint> profile_over(double length_m) {
    const double begin = junctions_[line_.junctions[0]].elevation_m;
    const double end = junctions_[line_.junctions[1]].elevation_m;
    std::vector<GradePoint> out{{0, begin, 0}};
    double grade = 0;
    while (true) {
      const double step = random_.uniform(500, 1500);
      if (out.back().offset_m + step > length_m - 400) break;
      // Grades turn back towards level, so that the walk does not run away over a long line.
      grade = 0.5 * grade + random_.uniform(-0.6, 0.6) * line_.terrain.grade;
      out.push_back({out.back().offset_m + step, out.back().elevation_m + grade * step, 80});
    }
    out.push_back({length_m, out.back().elevation_m, 0});
    const double tilt = (end - out.back().elevation_m) / length_m;
    for (GradePoint& point : out) point.elevation_m += tilt * point.offset_m;
    return out;
  }

  /// Leaves the main track to the left on its first straight and comes back on its last.
  void make_second() {
    const double swing = sideways_length_m(kMadeTrackSpacingM, kTurnoutRadiusM);
    const StraightStretch& first = line_.straights.front();
    const StraightStretch& last = line_.straights.back();
    if (first.to_m - first.from_m < swing + 2.0 * kClearM || last.to_m - last.from_m < swing + 2.0 * kClearM) return;
    line_.second_from_m = first.from_m + kClearM;
    line_.second_to_m = last.to_m - kClearM;
    std::vector<Element> elements = sideways(kMadeTrackSpacingM, kTurnoutRadiusM);
    std::vector<PlanPose> starts;
    PlanPose pose = line_.main.alignment.at(line_.second_from_m).pose;
    for (const Element& element : elements) {
      starts.push_back(pose);
      pose = advance(pose, element, element.length_m);
    }
    std::vector<Element> back = sideways(-kMadeTrackSpacingM, kTurnoutRadiusM);
    std::vector<PlanPose> back_starts;
    PlanPose joined = line_.main.alignment.at(line_.second_to_m).pose;
    for (auto element = back.rbegin(); element != back.rend(); ++element) {
      joined = advance(joined, *element, -element->length_m);
      back_starts.insert(back_starts.begin(), joined);
    }
    append(
        round_corners(place_of(pose), parallel_corners(begin_, corners_, end_, kMadeTrackSpacingM), place_of(joined)),
        elements, starts);
    elements.insert(elements.end(), back.begin(), back.end());
    starts.insert(starts.end(), back_starts.begin(), back_starts.end());
    std::vector<CantPoint> canted = cant_of(elements, 2, 2);
    const double second_length = canted.back().offset_m;
    std::vector<GradePoint> profile;
    const double scale = second_length / (line_.second_to_m - line_.second_from_m);
    for (GradePoint point : line_.main.alignment.profile()) {
      point.offset_m = scale * (point.offset_m - line_.second_from_m);
      profile.push_back(point);
    }
    line_.second = {.name = line_.name + "b", .line = line_.name + "b", .alignment = {}, .marks = {}, .groups = {}};
    line_.second.alignment = Alignment(std::move(elements), std::move(starts), std::move(profile), std::move(canted));
  }

  MadeLine& line_;
  const std::vector<MadeJunction>& junctions_;
  double spacing_m_;
  core::Random random_;
  std::array<WayOut, 2> ways_;
  Eigen::Vector2d begin_ = Eigen::Vector2d::Zero();
  Eigen::Vector2d end_ = Eigen::Vector2d::Zero();
  std::vector<Corner> corners_;
};

std::vector<MadeJunction> make_junctions(size_t n, double spacing_m, core::Random& random) {
  std::vector<MadeJunction> out;
  for (size_t row = 0; row < n; ++row) {
    for (size_t column = 0; column < n; ++column) {
      const double x = static_cast<double>(column) + random.uniform(-0.2, 0.2) - 0.5 * static_cast<double>(n - 1);
      const double y = static_cast<double>(row) + random.uniform(-0.2, 0.2) - 0.5 * static_cast<double>(n - 1);
      MadeJunction junction;
      junction.middle = {500000 + spacing_m * x, 5500000 + spacing_m * y, 0.5 * core::kPi + random.uniform(-0.5, 0.5)};
      junction.length_m = std::min(kJunctionM, 0.1 * spacing_m);
      junction.elevation_m = 500 + 100 * std::sin(0.9 * x) * std::cos(0.7 * y);
      out.push_back(junction);
    }
  }
  return out;
}

}  // namespace

PlanPose MadeJunction::leaving(size_t side) const {
  const PlanPose along = side == 1 ? middle : turned_round(middle);
  return advance(along, {length_m, 0, 0}, 0.5 * length_m);
}

std::vector<Element> sideways(double left_m, double radius_m) {
  const double turn = std::acos(1.0 - 0.5 * std::abs(left_m) / radius_m);
  const double curvature = std::copysign(1.0 / radius_m, left_m);
  return {{turn * radius_m, curvature, curvature}, {turn * radius_m, -curvature, -curvature}};
}

double sideways_length_m(double left_m, double radius_m) {
  return 2.0 * radius_m * std::sin(std::acos(1.0 - 0.5 * std::abs(left_m) / radius_m));
}

double MadeLines::length_m() const {
  double sum = 0;
  for (const MadeLine& line : lines) sum += line.main.alignment.length_m() + line.second.alignment.length_m();
  for (const MadeJunction& junction : junctions) sum += junction.length_m;
  return sum;
}

MadeLines make_lines(size_t n, double spacing_m, uint64_t seed) {
  core::Random random(seed);
  MadeLines out;
  out.junctions = make_junctions(n, spacing_m, random);
  const auto connect = [&](size_t a, size_t side_a, size_t b, size_t side_b) {
    const uint64_t terrain = random.next();
    if (n > 2 && random.uniform() < 0.1) return;
    const size_t index = out.lines.size();
    MadeLine& line = out.lines.emplace_back();
    line.name = "L" + std::to_string(index + 1);
    line.junctions = {a, b};
    line.sides = {side_a, side_b};
    line.terrain = kTerrains[terrain % kTerrains.size()];
    out.junctions[a].lines[side_a].push_back(index);
    out.junctions[b].lines[side_b].push_back(index);
  };
  for (size_t row = 0; row < n; ++row) {
    for (size_t i = row * n; i + 1 < (row + 1) * n; ++i) connect(i, 1, i + 1, 0);  // ahead of a junction is the east
  }
  for (size_t i = 0; i + n < n * n; ++i) connect(i, random.next() % 2, i + n, random.next() % 2);
  for (size_t i = 0; i < out.lines.size(); ++i) {
    core::Random own(seed * 1000003 + i);
    const bool has_second = own.uniform() < 0.5;
    LineMaker(out.lines[i], out.junctions, spacing_m, own).make(i, has_second);
  }
  return out;
}

}  // namespace railfix::track
