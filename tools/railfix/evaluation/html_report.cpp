#include "evaluation/html_report.hpp"

#include <array>
#include <cmath>
#include <cstdio>
#include <functional>
#include <sstream>

#include "core/time.hpp"
#include "escape_html.hpp"
#include "evaluation/plot.hpp"

namespace railfix::evaluation {
namespace {

constexpr const char* kTruthColor = "#2e7d32";
constexpr const char* kOdometryColor = "#1565c0";
constexpr const char* kStateColor = "#c62828";
constexpr const char* kBoundColor = "#9aa5b1";

constexpr const char* kHead = R"(<!doctype html>
<html lang="en"><head><meta charset="utf-8"><meta name="viewport" content="width=device-width, initial-scale=1">
<style>
body { font: 15px/1.5 system-ui, sans-serif; color: #222; background: #fff; margin: 2rem auto; max-width: 1500px; padding: 0 1rem; }
h1 { font-size: 1.5rem; margin: 0; } h2 { font-size: 1.1rem; margin: 2rem 0 .5rem; } p { color: #555; margin: .2rem 0 1rem; }
.figures { display: grid; grid-template-columns: repeat(auto-fill, minmax(170px, 1fr)); gap: .7rem; }
.figures div { border: 1px solid #e4e7eb; border-radius: 6px; padding: .5rem .8rem; }
.figures b { display: block; font-size: 1.25rem; } .figures span { color: #555; font-size: .85rem; }
.plots { display: grid; grid-template-columns: repeat(auto-fill, minmax(min(100%, 600px), 1fr)); gap: 1rem; }
svg { width: 100%; border: 1px solid #e4e7eb; border-radius: 6px; } svg text { font: 12px system-ui, sans-serif; fill-opacity: .9; }
svg text.title { font-weight: 600; font-size: 14px; }
table { border-collapse: collapse; } td, th { padding: .25rem .8rem; border-bottom: 1px solid #e4e7eb; text-align: right; }
td:first-child, th:first-child { text-align: left; }
</style>
)";

std::string number(double value, const char* format) {
  if (!std::isfinite(value)) return "not known";
  std::array<char, 64> text{};
  std::snprintf(text.data(), text.size(), format, value);
  return text.data();
}

class Html {
 public:
  explicit Html(const Truth& truth) : begin_ns_(truth.rows().front().stamp_ns) {}
  void figure(const std::string& what, const std::string& value) {
    out_ << "<div><b>" << tool::escape_html(value) << "</b><span>" << tool::escape_html(what) << "</span></div>\n";
  }
  void raw(const std::string& text) { out_ << text; }
  void plot(const std::string& title, const std::string& x, const std::string& y, std::vector<Series> series) {
    out_ << line_svg({title, x, y, std::move(series)});
  }
  [[nodiscard]] double second(int64_t stamp_ns) const { return core::seconds(stamp_ns - begin_ns_); }
  [[nodiscard]] std::string text() const { return out_.str(); }

 private:
  int64_t begin_ns_;
  std::ostringstream out_;
};

void headline_figures(Html& html, const Evaluation& e) {
  html.raw("<div class=\"figures\">\n");
  html.figure(is_part(e) ? "run, a part of the ride" : "run",
              number(e.travelled_m / 1000, "%.3f km") + ", " + number(e.duration_s, "%.0f s"));
  if (e.odometry) {
    html.figure("odometry drift", number(e.odometry->drift.percent, "%.4f %%"));
    html.figure("drift per 100 m, p95", number(e.odometry->drift.window_percent.p95, "%.4f %%"));
    html.figure("turn leads the foot", number(e.odometry->turn.lead_m, "%.1f m"));
  }
  if (e.position) {
    html.figure("position error, p95", number(e.position->error_m.p95, "%.3f m"));
    html.figure("position error, max", number(e.position->error_m.max, "%.3f m"));
    html.figure("interval coverage", number(e.position->coverage_percent, "%.2f %%"));
    if (e.position->samples.size() < e.position->states)
      html.figure("states judged",
                  std::to_string(e.position->samples.size()) + " of " + std::to_string(e.position->states));
    html.figure("track known", number(e.position->known_percent, "%.1f %%"));
    html.figure("on the right track", number(e.position->right_percent, "%.1f %%"));
  }
  if (e.views) html.figure("rails seen", number(e.views->seen_percent, "%.2f %%"));
  if (e.edges) html.figure("edge error, median", number(e.edges->normal_px.p50, "%.2f px"));
  if (e.sightings) {
    html.figure("sightings: precision", number(e.sightings->all.precision_percent(), "%.1f %%"));
    html.figure("sightings: recall", number(e.sightings->all.recall_percent(), "%.1f %%"));
  }
  html.raw("</div>\n");
}

using SampleToPoint = std::function<std::pair<double, double>(const MotionSample&)>;

/// One line for the odometry and one for the train state.
void add_motion(std::vector<Series>& series, const Evaluation& e, const SampleToPoint& point) {
  const auto add = [&](const char* name, const char* color, const std::vector<MotionSample>& samples) {
    Points points;
    for (const MotionSample& sample : samples) points.push_back(point(sample));
    series.push_back({name, color, std::move(points)});
  };
  if (e.odometry) add("odometry", kOdometryColor, e.odometry->samples);
  if (e.position) add("train state", kStateColor, e.position->motion);
}

void distance_plot(Html& html, const Evaluation& e) {
  std::vector<Series> series;
  add_motion(series, e,
             [](const MotionSample& s) { return std::pair(s.true_distance_m, s.distance_m - s.true_distance_m); });
  if (!series.empty())
    html.plot("Distance error since the start", "distance (m)", "measured - true (m)", std::move(series));
}

void position_plots(Html& html, const PositionResult& position) {
  Series error{"error", kStateColor, {}};
  Series upper{"interval", kBoundColor, {}};
  Series lower{"", kBoundColor, {}};
  Series cross{"", kStateColor, {}};
  for (const PositionSample& sample : position.samples) {
    error.points.emplace_back(sample.true_distance_m, sample.along_m);
    // Where the error may lie when the interval holds: -under <= error <= over.
    upper.points.emplace_back(sample.true_distance_m, sample.over_m);
    lower.points.emplace_back(sample.true_distance_m, -sample.under_m);
    cross.points.emplace_back(sample.true_distance_m, sample.cross_m);
  }
  html.plot("Position error along the track", "distance (m)", "estimated - true (m)", {upper, lower, error});
  if (position.cross_m.count > 0)
    html.plot("Position error across the track", "distance (m)", "left positive (m)", {cross});
}

void speed_plot(Html& html, const Truth& truth, const Evaluation& e) {
  Points real;
  for (const auto& row : truth.rows()) real.emplace_back(html.second(row.stamp_ns), row.speed_mps);
  std::vector<Series> series = {{"truth", kTruthColor, std::move(real)}};
  add_motion(series, e, [&](const MotionSample& s) { return std::pair(html.second(s.stamp_ns), s.speed_mps); });
  html.plot("Speed", "time (s)", "speed (m/s)", std::move(series));
}

void curvature_plot(Html& html, const Truth& truth, const ViewResult& views) {
  Series real{"truth", kTruthColor, {}};
  Series measured{"track view", kOdometryColor, {}};
  for (const CurvatureSample& sample : views.curvature)
    measured.points.emplace_back(sample.true_distance_m, sample.measured_per_m * 1000);
  for (const auto& row : truth.rows()) real.points.emplace_back(row.distance_m, row.curvature_per_m * 1000);
  html.plot("Curvature", "distance (m)", "left positive (1/km)", {measured, real});
}

void map_plot(Html& html, const Truth& truth, const Evaluation& e) {
  Plot plot{"Path on the map", "easting (m)", "northing (m)", {}, true};
  Points real;
  for (const auto& row : truth.rows()) real.emplace_back(row.easting_m, row.northing_m);
  plot.series.push_back({"truth", kTruthColor, std::move(real)});
  Points estimated;
  if (e.position) {
    for (const PositionSample& sample : e.position->samples)
      estimated.emplace_back(sample.easting_m, sample.northing_m);
  }
  if (!estimated.empty()) plot.series.push_back({"train state", kStateColor, std::move(estimated)});
  html.raw(line_svg(plot));
}

void stanford_plot(Html& html, const PositionResult& position) {
  Points points;
  for (const PositionSample& sample : position.samples) {
    if (!sample.has_interval()) continue;
    points.emplace_back(std::abs(sample.along_m), sample.along_m >= 0 ? sample.over_m : sample.under_m);
  }
  if (!points.empty()) html.raw(stanford_svg(points));
}

void kinds_table(Html& html, const SightingResult& sightings) {
  html.raw(
      "<h2>Sightings</h2>\n<table><tr><th>kind</th><th>real</th><th>said</th><th>right</th><th>precision</"
      "th><th>recall</th>"
      "<th>error p95</th></tr>\n");
  for (const auto& [name, kind] : sightings.kinds) {
    html.raw("<tr><td>" + tool::escape_html(name) + "</td><td>" + std::to_string(kind.real) + "</td><td>" +
             std::to_string(kind.said) + "</td><td>" + std::to_string(kind.right) + "</td><td>" +
             number(kind.precision_percent(), "%.1f %%") + "</td><td>" + number(kind.recall_percent(), "%.1f %%") +
             "</td><td>" + number(kind.error_m.p95, "%.3f m") + "</td></tr>\n");
  }
  html.raw("</table>\n");
}

void services_table(Html& html, const std::vector<ServiceResult>& services) {
  html.raw(
      "<h2>Services</h2>\n<table><tr><th>service</th><th>in</th><th>out</th><th>dropped</th><th>latency p50</th>"
      "<th>latency p99</th><th>processor</th><th>memory</th><th>state</th></tr>\n");
  for (const ServiceResult& s : services) {
    html.raw("<tr><td>" + tool::escape_html(s.service) + "</td><td>" + number(s.frames_in, "%.0f") + "</td><td>" +
             number(s.frames_out, "%.0f") + "</td><td>" + number(s.dropped, "%.0f") + "</td><td>" +
             number(s.latency_p50_ms, "%.2f ms") + "</td><td>" + number(s.latency_p99_ms, "%.2f ms") + "</td><td>" +
             number(s.cpu_percent, "%.0f %%") + "</td><td>" + number(s.rss_mb, "%.0f MB") + "</td><td>" +
             tool::escape_html(s.last_state) + "</td></tr>\n");
  }
  html.raw("</table>\n");
}

}  // namespace

std::string html_report(const Truth& truth, const Evaluation& evaluation, const std::string& run_name) {
  Html html(truth);
  html.raw(std::string(kHead) + "<title>Railfix: " + tool::escape_html(run_name) + "</title></head><body>\n<h1>" +
           tool::escape_html(run_name) + "</h1>\n<p>railfix evaluate: this run beside the truth of its dataset.");
  const auto tables = [&html](const char* what, const std::vector<std::string>& names) {
    if (names.empty()) return;
    html.raw(what);
    for (const std::string& name : names) html.raw(" " + tool::escape_html(name));
    html.raw(".");
  };
  tables(" Not in this run:", evaluation.missing);
  tables(" Without a row:", evaluation.empty);
  for (const auto& [name, rows] : evaluation.out_of_order)
    html.raw(" Out of order: " + std::to_string(rows) + " rows of " + tool::escape_html(name) + ".");
  html.raw("</p>\n");
  headline_figures(html, evaluation);
  html.raw("<h2>Plots</h2>\n<div class=\"plots\">\n");
  distance_plot(html, evaluation);
  if (evaluation.position) position_plots(html, *evaluation.position);
  speed_plot(html, truth, evaluation);
  if (evaluation.views) curvature_plot(html, truth, *evaluation.views);
  map_plot(html, truth, evaluation);
  if (evaluation.position) stanford_plot(html, *evaluation.position);
  html.raw("</div>\n");
  if (evaluation.sightings) kinds_table(html, *evaluation.sightings);
  if (evaluation.services) services_table(html, *evaluation.services);
  html.raw("</body></html>\n");
  return html.text();
}

}  // namespace railfix::evaluation
