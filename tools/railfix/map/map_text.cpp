#include "map/map_text.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <map>
#include <numeric>

#include "core/units.hpp"
#include "track/import/scale.hpp"
#include "track/import/whereabouts.hpp"

namespace railfix::tool {

namespace {

using nlohmann::ordered_json;

/// Track with a speed limit in one direction or both.
double limited_m(const track::Map& map) {
  double sum = 0;
  for (const track::Edge& edge : map.edges) {
    std::vector<std::pair<double, double>> parts;
    for (const track::SpeedLimit& limit : edge.speed_limits) parts.emplace_back(limit.from_m, limit.to_m);
    std::sort(parts.begin(), parts.end());
    double reached = 0;
    for (const auto& [from, to] : parts) {
      sum += std::max(0.0, to - std::max(from, reached));
      reached = std::max(reached, to);
    }
  }
  return sum;
}

size_t count_of(const track::Map& map, track::NodeKind kind) {
  return static_cast<size_t>(
      std::count_if(map.nodes.begin(), map.nodes.end(), [&](const track::Node& node) { return node.kind == kind; }));
}

}  // namespace

double total_length_m(const track::Map& map) {
  return std::accumulate(map.edges.begin(), map.edges.end(), 0.0,
                         [](double sum, const track::Edge& edge) { return sum + edge.alignment.length_m(); });
}

const char* kind_of(const track::Element& element) {
  if (element.curvature_start_per_m != element.curvature_end_per_m) return "clothoid";
  return element.curvature_start_per_m == 0 ? "straight" : "arc";
}

void print_problems(const std::vector<std::string>& problems, size_t most) {
  if (problems.empty()) {
    std::puts("problems         none found");
    return;
  }
  std::printf("problems         %zu\n", problems.size());
  for (size_t i = 0; i < std::min(most, problems.size()); ++i) std::printf("  - %s\n", problems[i].c_str());
  if (problems.size() > most)
    std::printf("  ... and %zu more; `railfix map info MAP` lists all\n", problems.size() - most);
}

void print_summary(const track::Map& map) {
  std::printf("map              %s, from %s\n", map.name.c_str(), map.source.c_str());
  std::printf("coordinates      %s\n", map.crs.empty() ? "local metres, no latitude and longitude" : map.crs.c_str());
  if (const auto middle = track::middle_on_earth(map)) {
    std::printf("lies around      latitude %.3f, longitude %.3f\n", middle->lat_deg, middle->lon_deg);
  }
  if (const auto scale = track::scale_over(map)) {
    std::printf("scale            %+.2f to %+.2f m per km on the map\n", scale->least_m_per_km, scale->most_m_per_km);
  }
  std::printf("track            %.3f km in %zu edges\n", total_length_m(map) / 1000.0, map.edges.size());
  std::printf("nodes            %zu switches, %zu crossings, %zu joints, %zu ends\n",
              count_of(map, track::NodeKind::railway_switch), count_of(map, track::NodeKind::crossing),
              count_of(map, track::NodeKind::joint), count_of(map, track::NodeKind::end));
  std::printf("landmarks        %zu, balise groups %zu\n", map.landmarks.size(), map.balise_groups.size());
  std::map<track::LandmarkKind, size_t> of_kind;
  for (const track::Landmark& mark : map.landmarks) ++of_kind[mark.kind];
  for (const auto& [kind, count] : of_kind) std::printf("  %-14s %zu\n", track::to_string(kind).c_str(), count);
  const double limited = limited_m(map);
  if (limited > 0) std::printf("speed limits     on %.3f km\n", limited / 1000.0);
}

void print_figures(const char* source, const track::FitFigures& figures) {
  if (figures.elements == 0) return;
  std::printf("%s\n", source);
  std::printf("  elements                      %zu\n", figures.elements);
  std::printf("  integrated end against file   %.6f mm at most\n", figures.max_end_error_m * 1e3);
  std::printf("  heading from one to the next  %.6f rad at most\n", figures.max_heading_step_rad);
  if (figures.max_chord_deviation_m > 0) {
    std::printf("  track from the mapped points  %.3f m at most\n", figures.max_point_distance_m);
    std::printf("  track against the polyline    %.3f m at most\n", figures.max_chord_deviation_m);
  } else {
    std::printf("  length against file           %.6f mm at most\n", figures.max_length_change_m * 1e3);
    std::printf("  gaps between the file's own   %.6f mm at most\n", figures.max_gap_m * 1e3);
  }
}

void print_virtual_balises(const track::VirtualBalises& groups) {
  if (!groups.was_asked_for()) return;
  std::printf("virtual groups   %zu\n", groups.groups);
  if (groups.short_edges == 0) return;
  std::printf(
      "  none           on %zu edges shorter than %.1f m, half the distance: %.3f km of track; a smaller "
      "distance puts some there\n",
      groups.short_edges, 0.5 * groups.every_m, groups.short_m / 1000.0);
}

/// Straights, clothoids and arcs, and the elements that fit worst.
void print_fit(const track::FitReport& fit) {
  if (fit.tracks + fit.left_as_arcs + fit.two_points == 0) return;
  std::map<std::string, size_t> count;
  for (const track::FittedElement& element : fit.elements) ++count[kind_of(element.element)];
  std::printf("polylines as straights, clothoids and arcs\n");
  std::printf("  tracks                        %zu, %zu more left as arcs through their points, %zu of two points\n",
              fit.tracks, fit.left_as_arcs, fit.two_points);
  std::printf("  left out, still arcs          %zu points apart from their track, %.0f m of these tracks\n",
              fit.left_out, fit.arcs_m);
  std::printf("  elements                      %zu straights, %zu clothoids, %zu arcs\n", count["straight"],
              count["clothoid"], count["arc"]);
  std::printf("  points from the track         %.3f m rms, %.3f m at most\n", fit.rms_m(), fit.max_m);
  std::vector<track::FittedElement> worst = fit.elements;
  const auto shown = static_cast<ptrdiff_t>(std::min<size_t>(5, worst.size()));
  std::partial_sort(worst.begin(), worst.begin() + shown, worst.end(),
                    [](const auto& a, const auto& b) { return a.max_m > b.max_m; });
  for (ptrdiff_t i = 0; i < shown; ++i) {
    std::printf("  worst                         %.3f m beside the %s of %s at %.1f m\n", worst[i].max_m,
                kind_of(worst[i].element), worst[i].track.c_str(), worst[i].offset_m);
  }
}

void print_info(const track::Map& map, size_t most_edges) {
  print_summary(map);
  std::printf("\n%6s  %12s  %6s  %6s  %-24s %s\n", "edge", "length [m]", "from", "to", "name", "line");
  for (size_t i = 0; i < std::min(most_edges, map.edges.size()); ++i) {
    const track::Edge& edge = map.edges[i];
    std::printf("%6u  %12.3f  %6u  %6u  %-24s %s\n", edge.id, edge.alignment.length_m(), edge.from_node, edge.to_node,
                edge.name.c_str(), edge.line.c_str());
  }
  if (map.edges.size() > most_edges)
    std::printf("  ... and %zu more; --json lists all\n", map.edges.size() - most_edges);
  std::puts("");
  print_problems(map.problems, map.problems.size());
}

namespace {

/// Seen the other way twist stays: the cant and the way change their signs together.
void print_height_and_cant(const track::Alignment& alignment, double offset_m, const track::TrackPoint& point,
                           double sign) {
  if (!alignment.cant().empty()) {
    const double cant_mm = sign * point.cant_m * 1e3;
    const char* higher = std::abs(cant_mm) < 0.05 ? "" : cant_mm > 0 ? " (right rail higher)" : " (left rail higher)";
    std::printf("cant, twist      %.1f mm%s, %.3f mm per m\n", cant_mm + 0.0, higher, point.twist * 1e3 + 0.0);
  } else {
    std::puts("cant, twist      not on the map");
  }
  if (!alignment.profile().empty()) {
    std::printf("height, grade    %.3f m, %.2f per mille%s\n", point.elevation_m, sign * point.grade * 1e3 + 0.0,
                alignment.grade_known_at(offset_m) ? "" : " (a guess, which no service uses)");
  } else {
    std::puts("height, grade    not on the map");
  }
}

}  // namespace

void print_place(const track::Map& map, const track::EdgePosition& place, bool as_json) {
  // Seen along growing offset, or against it where the place says so; + 0.0 makes -0 a plain 0.
  const bool reverse = place.direction == track::Direction::reverse;
  const double sign = reverse ? -1.0 : 1.0;
  const track::Alignment& alignment = map.edge(place.edge)->alignment;
  const track::TrackPoint point = alignment.at(place.offset_m);
  const bool has_heights = !alignment.profile().empty();
  const bool has_cant = !alignment.cant().empty();
  const auto if_known = [](bool known, double value) { return known ? ordered_json(value + 0.0) : ordered_json(); };
  const double heading = core::wrap_pi(point.pose.heading_rad + (reverse ? core::kPi : 0.0));
  const auto geo = map.to_geo(point.pose.easting_m, point.pose.northing_m);
  const bool on_earth = geo && !map.edge(place.edge)->is_drawn;
  const auto limit =
      map.edge(place.edge)
          ->speed_limit_mps(place.offset_m, reverse ? track::Direction::reverse : track::Direction::forward);
  if (as_json) {
    print_json({{"edge", place.edge},
                {"offset_m", place.offset_m},
                {"easting_m", point.pose.easting_m},
                {"northing_m", point.pose.northing_m},
                {"heading_rad", heading},
                {"curvature_per_m", sign * point.curvature_per_m + 0.0},
                {"curvature_rate_per_m2", point.curvature_rate_per_m2},
                {"cant_m", if_known(has_cant, sign * point.cant_m)},
                {"twist", if_known(has_cant, point.twist)},
                {"elevation_m", if_known(has_heights, point.elevation_m)},
                {"grade", if_known(has_heights, sign * point.grade)},
                {"grade_is_guess", has_heights && !alignment.grade_known_at(place.offset_m)},
                {"speed_limit_mps", limit ? ordered_json(*limit) : ordered_json()},
                {"lat_deg", on_earth ? ordered_json(geo->lat_deg) : ordered_json()},
                {"lon_deg", on_earth ? ordered_json(geo->lon_deg) : ordered_json()}});
    return;
  }
  std::printf("edge %u at %.3f m%s\n", place.edge, place.offset_m, reverse ? ", seen against growing offset" : "");
  std::printf("easting          %.4f m\nnorthing         %.4f m\n", point.pose.easting_m, point.pose.northing_m);
  std::printf("heading          %.6f rad (%.3f degrees clockwise from grid north)\n", heading,
              core::deg_from_rad(heading));
  const double curvature = sign * point.curvature_per_m;
  if (std::abs(curvature) < 1e-7) {
    std::puts("curvature        straight");
  } else {
    std::printf("curvature        %.3e per m (radius %.1f m to the %s)\n", curvature, 1.0 / std::abs(curvature),
                curvature > 0 ? "left" : "right");
  }
  // Seen the other way it stays: the curvature and the way change their signs together.
  std::printf("its rate         %.3e per m2\n", point.curvature_rate_per_m2 + 0.0);
  print_height_and_cant(alignment, place.offset_m, point, sign);
  if (limit) std::printf("speed limit      %.0f km/h\n", core::kmh_from_mps(*limit));
  if (on_earth) std::printf("latitude         %.8f\nlongitude        %.8f\n", geo->lat_deg, geo->lon_deg);
}

}  // namespace railfix::tool
