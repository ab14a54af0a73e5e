// railfix map coverage
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>

#include "fusion/fusion_config.hpp"
#include "map/coverage.hpp"
#include "map/group_gaps.hpp"
#include "map/map_commands.hpp"
#include "map/map_text.hpp"
#include "number_between.hpp"
#include "service/service.hpp"

namespace railfix::tool {
namespace {

using nlohmann::ordered_json;

struct CoverageRequest {
  std::string map;
  std::string start = "1:0";
  std::string config;
  double length_m = 1e7;
  double speed_kmh = 80;
  std::vector<std::string> sighted;
  std::optional<double> scale_sigma;
  std::optional<double> sigmas;
  bool as_json = false;
  CoverageOptions options;
};

std::string place_text(const track::Path& path, double distance_m) {
  const track::EdgePosition place = path.position_at(distance_m);
  char text[64];
  std::snprintf(text, sizeof text, ":%.0f%s", place.offset_m, place.direction == track::Direction::reverse ? ":-" : "");
  return path.map().edge_text(place.edge) + text;
}

CoverageOptions options_of(const CoverageRequest& request) {
  CoverageOptions options = request.options;
  options.speed_mps = request.speed_kmh / 3.6;
  if (!request.config.empty()) {
    const auto config =
        service::read_config<fusion::FusionConfig>("fusion", request.config, {}, service::service_names());
    options.fusion = core::value_or_throw(config).parameters;
  }
  auto& p = options.fusion;
  if (request.scale_sigma) p.visual_scale_sigma = p.wheel_scale_sigma = *request.scale_sigma;
  if (request.sigmas) p.interval_factor = *request.sigmas;
  for (const std::string& name : request.sighted) {
    const auto kind = track::landmark_kind_from(name);
    if (!kind || !track::can_be_sighted(*kind))
      throw core::BadInput("--sighted: '" + name + "' is no kind of landmark that the camera sights; give of " +
                           track::sighted_kinds());
    options.sighted.push_back(*kind);
  }
  return options;
}

ordered_json extent_json(const track::Path& path, const Extent& extent) {
  ordered_json gaps = ordered_json::array();
  for (const CoverageGap& gap : extent.gaps) {
    gaps.push_back({{"from", place_text(path, gap.from_m)},
                    {"to", place_text(path, gap.to_m)},
                    {"length_m", std::abs(gap.to_m - gap.from_m)},
                    {"largest_half_interval_m", gap.largest_m},
                    {"outside_subset_041", gap.outside_budget}});
  }
  return {{"covered_m", extent.covered_m}, {"largest_half_interval_m", extent.largest_m}, {"gaps", gaps}};
}

ordered_json coverage_json(const track::Path& path, const Coverage& found) {
  ordered_json json = extent_json(path, found.now.there);
  json["back"] = extent_json(path, found.now.back);
  ordered_json places = ordered_json::array();
  for (const double at_m : found.markers_m) places.push_back(place_text(path, at_m));
  json["markers"] = places;
  json["with_markers"] = extent_json(path, found.with_markers.there);
  json["with_markers"]["back"] = extent_json(path, found.with_markers.back);
  return json;
}

/// As --virtual-balises-at takes it: on the edge, whatever is rounded.
std::string group_place_text(const track::Path& path, double distance_m) {
  const track::EdgePosition place = path.position_at(distance_m);
  char text[64];
  std::snprintf(text, sizeof text, ":%.1f", std::floor(10 * place.offset_m) / 10);
  return path.map().edge_text(place.edge) + text;
}

ordered_json groups_json(const track::Path& path, const std::vector<GroupGap>& gaps) {
  ordered_json json = ordered_json::array();
  for (const GroupGap& gap : gaps) {
    ordered_json missing = ordered_json::array();
    for (const double at_m : gap.missing_m) missing.push_back(group_place_text(path, at_m));
    json.push_back({{"from", place_text(path, gap.from_m)},
                    {"to", place_text(path, gap.to_m)},
                    {"length_m", gap.to_m - gap.from_m},
                    {"missing", missing}});
  }
  return json;
}

void print_groups(const track::Path& path, const std::vector<GroupGap>& gaps, const CoverageRequest& request) {
  std::printf("balise groups    at most %.0f m apart: %s\n", request.options.group_limit_m,
              !gaps.empty() ? "no"
              : path.balise_groups().empty()
                  ? "the way is shorter than that; it has none, and reports say \"LRBG unknown\""
                  : "yes, real and virtual ones");
  std::string missing;
  for (const GroupGap& gap : gaps) {
    std::printf("  none           %s to %s (%.0f m)\n", place_text(path, gap.from_m).c_str(),
                place_text(path, gap.to_m).c_str(), gap.to_m - gap.from_m);
    for (const double at_m : gap.missing_m) missing += (missing.empty() ? "" : ",") + group_place_text(path, at_m);
  }
  if (missing.empty()) return;
  std::printf("  virtual ones   railfix map build %s --nid-c NID_C --virtual-balises-at %s --out MAP\n",
              request.map.c_str(), missing.c_str());
}

ordered_json references_json(const References& references) {
  ordered_json counted = ordered_json::object();
  for (const auto& [kind, number] : references.counted) counted[track::to_string(kind)] = number;
  return {{"landmarks", counted},
          {"virtual_groups_not_counted", references.virtual_groups},
          {"unsighted_groups_not_counted", references.unsighted_groups}};
}

void print_references(const References& references) {
  std::string counted = "the curves of the track";
  for (const auto& [kind, number] : references.counted)
    counted += ", " + std::to_string(number) + " " + track::to_string(kind);
  std::printf("references       %s\n", counted.c_str());
  if (references.virtual_groups + references.unsighted_groups == 0) return;
  std::printf(
      "not counted      %zu virtual balise groups and %zu whose balises are not sighted: reports refer to them, they "
      "tell no place\n",
      references.virtual_groups, references.unsighted_groups);
}

std::string within_text(const track::Path& path, const Extent& extent) {
  char text[96];
  std::snprintf(text, sizeof text, "%.1f km (%.1f %%), largest %.1f m", extent.covered_m / 1e3,
                100 * extent.covered_m / std::max(path.end_m() - path.begin_m(), 1.0), extent.largest_m);
  return text;
}

void print_extent(const char* way_name, const track::Path& path, const Extent& extent) {
  std::printf("within, %-8s %s\n", way_name, within_text(path, extent).c_str());
  for (const CoverageGap& gap : extent.gaps) {
    std::printf("  too wide       %s to %s (%.0f m), up to %.1f m%s\n", place_text(path, gap.from_m).c_str(),
                place_text(path, gap.to_m).c_str(), std::abs(gap.to_m - gap.from_m), gap.largest_m,
                gap.outside_budget ? ", beyond 5 m + 5 %" : "");
  }
}

void print_coverage(const track::Path& path, const Coverage& found) {
  print_extent("there", path, found.now.there);
  print_extent("back", path, found.now.back);
  if (found.now.there.gaps.empty() && found.now.back.gaps.empty()) return;
  if (found.markers_m.empty()) {
    std::printf("would help       nothing that the camera sights\n");
    return;
  }
  std::printf("would help       a mast, a marker or a real balise that the camera sights, for both directions at");
  for (const double at_m : found.markers_m) std::printf(" %s", place_text(path, at_m).c_str());
  std::printf("\n  with these     there %s\n", within_text(path, found.with_markers.there).c_str());
  std::printf("                 back %s\n", within_text(path, found.with_markers.back).c_str());
}

int coverage(const CoverageRequest& request) {
  const CoverageOptions options = options_of(request);
  const auto map = std::make_shared<const track::Map>(core::value_or_throw(track::Map::load(request.map)));
  const track::EdgePosition start = core::value_or_throw(map->parse_position(request.start));
  const track::Path path = core::value_or_throw(way_from(map, start, request.length_m));
  const References references = references_on(path, options);
  const Coverage found = coverage_of(path, options);
  const double way_m = path.end_m() - path.begin_m();
  if (request.as_json) {
    ordered_json json{{"way_m", way_m}, {"map_m", total_length_m(*map)}, {"references", references_json(references)}};
    json.update(coverage_json(path, found));
    json["without_balise_group"] = groups_json(path, group_gaps(path, options));
    print_json(json);
    return 0;
  }
  std::printf("way              %.1f of the map's %.1f km of track: from %s over the straight way of every switch\n",
              way_m / 1e3, total_length_m(*map) / 1e3, request.start.c_str());
  print_references(references);
  std::printf("limit            %.1f m on either side at %.0f km/h without GNSS, %.1f sigma\n", options.limit_m,
              request.speed_kmh, options.fusion.interval_factor);
  print_coverage(path, found);
  print_groups(path, group_gaps(path, options), request);
  return 0;
}

}  // namespace

void add_map_coverage(CLI::App& map, Action& chosen) {
  const auto request = std::make_shared<CoverageRequest>();
  CLI::App* command = map.add_subcommand(
      "coverage",
      "Where references are missing on a way through the map: the confidence interval outgrows a limit, or balise "
      "groups are far apart");
  command->add_option("MAP", request->map, "A map made by `railfix map build`")->required();
  command->add_option("--start", request->start, "EDGE:OFFSET[:+|-] where the way begins")->capture_default_str();
  command->add_option("--length", request->length_m, "Metres of way; without, to where its track ends");
  command->add_option("--limit", request->options.limit_m, "Metres that half the interval may be long")
      ->check(number_between(0.1, 1e5))
      ->capture_default_str();
  command->add_option("--speed-kmh", request->speed_kmh, "Of the train")
      ->check(number_between(5.0, 400.0))
      ->capture_default_str();
  command
      ->add_option("--sighted", request->sighted,
                   "The camera sights landmarks of these kinds alone, for example frog,portal_in,portal_out (default: "
                   "all that it can)")
      ->transform([](std::string kind) { return CLI::detail::trim(kind); })
      ->delimiter(',');
  command->add_option("--config", request->config, "YAML of the train, for its section fusion; its defaults without");
  command
      ->add_option("--scale-sigma", request->scale_sigma,
                   "Instead of fusion.visual_scale_sigma and wheel_scale_sigma: how far their metres may be off")
      ->check(number_between(1e-5, 0.2));
  command->add_option("--sigmas", request->sigmas, "Instead of fusion.interval_factor")
      ->check(number_between(1.0, 20.0));
  command
      ->add_option("--marker-sigma", request->options.marker_sigma_m,
                   "How exactly the map knows a proposed marker, metres (one sigma)")
      ->check(number_between(0.0, 10.0))
      ->capture_default_str();
  command
      ->add_option("--group-limit", request->options.group_limit_m,
                   "Metres that balise groups, real or virtual, may be apart: reports refer to the last one")
      ->check(number_between(100.0, 1e5))
      ->capture_default_str();
  command->add_flag("--json", request->as_json, "JSON on standard output");
  command->footer(
      "It looks at one way, there and back: over the straight way of every switch from --start on. The rest of the map "
      "is "
      "not looked at; the output says how much of it the way is.\n"
      "Example:\n  railfix map coverage line.map --start 1:0 --limit 15 --sighted frog,portal_in,portal_out");
  command->callback([request, &chosen] { chosen = [request] { return coverage(*request); }; });
}

}  // namespace railfix::tool
