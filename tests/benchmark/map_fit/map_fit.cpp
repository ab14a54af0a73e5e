// How well a hand-drawn polyline gives a real alignment back: its longest track is sampled with noise, as OpenStreetMap
// has it, fitted, and compared with the truth.
//
//   railfix-measure-map-fit LINE.landxml
//   railfix-measure-map-fit made:SEED      # a line of a made-up network instead
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <ctime>

#include "core/random.hpp"
#include "measuring_tool.hpp"
#include "track/import/fit/biarc.hpp"
#include "track/import/fit/clothoid_fit.hpp"
#include "track/import/fit/smooth.hpp"
#include "track/import/made/made_lines.hpp"
#include "track/import/xml/landxml.hpp"
#include "whole_number.hpp"

namespace {

using namespace railfix;         // NOLINT(google-build-using-namespace)
using namespace railfix::track;  // NOLINT(google-build-using-namespace)

std::vector<Eigen::Vector2d> drawn(const Alignment& truth, double spacing_m, double sigma_m, uint64_t seed) {
  core::Random random(seed);
  std::vector<Eigen::Vector2d> points;
  for (double s = 0; s <= truth.length_m(); s += spacing_m * random.uniform(0.7, 1.3)) {
    const PlanPose pose = truth.at(s).pose;
    const double left = random.normal(0, sigma_m);
    points.emplace_back(pose.easting_m - left * std::cos(pose.heading_rad),
                        pose.northing_m + left * std::sin(pose.heading_rad));
  }
  return points;
}

void judge(const char* name, const Alignment& fit, const Alignment& truth, double seconds) {
  double squares = 0;
  double worst = 0;
  std::vector<double> curvature;
  for (double s = 20; s < fit.length_m() - 20; s += 5) {
    const PlanPose pose = fit.at(s).pose;
    const Alignment::Nearest nearest = truth.nearest(pose.easting_m, pose.northing_m);
    squares += nearest.lateral_m * nearest.lateral_m;
    worst = std::max(worst, std::abs(nearest.lateral_m));
    curvature.push_back(std::abs(fit.curvature_at(s) - truth.curvature_at(nearest.offset_m)));
  }
  double curvature_squares = 0;
  for (const double error : curvature) curvature_squares += error * error;
  std::sort(curvature.begin(), curvature.end());
  const auto count = static_cast<double>(curvature.size());
  std::printf(
      "  %-26s %5zu elements, position rms %.3f m max %.3f m, curvature rms %.2e p95 %.2e per m, length %+.2f m, %.2f "
      "s\n",
      name, fit.elements().size(), std::sqrt(squares / count), worst, std::sqrt(curvature_squares / count),
      curvature[curvature.size() * 95 / 100], fit.length_m() - truth.length_m(), seconds);
}

Alignment truth_of(const std::string& name) {
  if (name.starts_with("made:")) {
    std::string text = name.substr(5);
    if (const auto wrong = tool::whole_number()(text); !wrong.empty()) throw core::BadInput(name + ": " + wrong);
    for (const MadeLine& line : make_lines(3, 25e3, std::stoull(text)).lines) {
      if (line.main.alignment.length_m() > 10e3) return line.main.alignment;
    }
    throw core::BadInput(name + ": no line of 10 km in this network");
  }
  const LandXml read = core::value_or_throw(read_landxml(name));
  const auto& tracks = read.tracks;
  return std::max_element(tracks.begin(), tracks.end(),
                          [](const auto& a, const auto& b) { return a.alignment.length_m() < b.alignment.length_m(); })
      ->alignment;
}

int measure_fits(const Alignment& truth) {
  std::printf("truth: %.3f km, %zu elements\n", truth.length_m() / 1e3, truth.elements().size());
  for (const auto& [spacing_m, sigma_m] : {std::pair(20.0, 0.0), {20.0, 0.2}, {20.0, 0.5}, {20.0, 1.0}, {30.0, 0.5}}) {
    const std::vector<Eigen::Vector2d> points = drawn(truth, spacing_m, sigma_m, 21);
    std::printf("a point every %.0f m, %.1f m off (1 sigma); scatter as estimated %.2f m\n", spacing_m, sigma_m,
                scatter_of(points));
    judge("arcs through the points", fit_polyline(points, std::nullopt, std::nullopt).alignment, truth, 0);
    judge("the same, smoothed", fit_polyline(smoothed(points, 2 * sigma_m), std::nullopt, std::nullopt).alignment,
          truth, 0);
    const std::clock_t begin = std::clock();
    const auto fit = fit_clothoids(points, {});
    const double seconds = static_cast<double>(std::clock() - begin) / CLOCKS_PER_SEC;
    if (fit) judge("straights, clothoids, arcs", fit->alignment, truth, seconds);
    if (!fit) std::puts("  straights, clothoids, arcs: no fit");
  }
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app("How well a hand-drawn polyline gives a real alignment back", "railfix-measure-map-fit");
  std::string line;
  app.add_option("LINE", line, "LINE.landxml, or made:SEED for a line of a made-up network")->required();
  return measure::run_tool(app, argc, argv, [&] { return measure_fits(truth_of(line)); });
}
