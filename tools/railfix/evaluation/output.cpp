// The figures as text for people and as JSON for programs.
#include <array>
#include <cmath>
#include <cstdio>
#include <nlohmann/json.hpp>

#include "core/time.hpp"
#include "evaluation/evaluation.hpp"

namespace railfix::evaluation {
namespace {

using nlohmann::ordered_json;

/// "%g" with a unit, "-" when not known.
std::string figure(double value, const char* format, const char* unit) {
  if (!std::isfinite(value)) return "-";
  std::array<char, 64> text{};
  constexpr double kLongest = 1e15;  // written out; longer ones would not fit
  std::snprintf(text.data(), text.size(), std::abs(value) < kLongest ? format : "%.3g", value);
  return std::string(text.data()) + unit;
}
std::string metres(double value) {
  return figure(value, "%.3f", " m");
}
std::string share(double value) {
  return figure(value, "%.2f", " %");
}
std::string pixels(double value) {
  return figure(value, "%.2f", " px");
}

void line(std::ostream& out, const std::string& what, const std::string& figures) {
  out << "  " << what << std::string(what.size() < 24 ? 24 - what.size() : 1, ' ') << figures << '\n';
}

template <class Format>
std::string spread(const Summary& summary, Format format) {
  return "mean " + format(summary.mean) + ", p50 " + format(summary.p50) + ", p95 " + format(summary.p95) + ", max " +
         format(summary.max);
}

void print_drift(std::ostream& out, const Drift& drift) {
  line(out, "drift",
       figure(drift.percent, "%.4f", " %") + " of " + metres(drift.travelled_m) + " (" + metres(drift.error_m) + ")");
  line(out, "drift per 100 m",
       "mean " + figure(drift.window_percent.mean, "%.4f", " %") + ", p95 " +
           figure(drift.window_percent.p95, "%.4f", " %") + ", " + std::to_string(drift.window_percent.count) +
           " windows");
}

void print_odometry(std::ostream& out, const OdometryResult& odometry) {
  out << "odometry\n";
  print_drift(out, odometry.drift);
  line(out, "valid, blind", share(odometry.valid_percent) + ", " + share(odometry.blind_percent) + " of the steps");
  line(out, "speed error", figure(odometry.speed_rms_mps, "%.4f", " m/s") + " rms");
  if (odometry.turn.stretches == 0) return;
  line(out, "turn",
       figure(1e3 * odometry.turn.error_rad, "%.2f", " mrad") + " rms in " + std::to_string(odometry.turn.stretches) +
           " stretches of 300 m, leads the foot by " + figure(odometry.turn.lead_m, "%.1f", " m"));
}

void print_position(std::ostream& out, const PositionResult& position) {
  out << "position ("
      << (position.from_map              ? "on the map"
          : position.truth_lacks_heading ? "distance since the first state only: the truth has no heading"
                                         : "distance since the first state only: no map coordinates to compare")
      << ")\n";
  if (position.samples.size() < position.states) {
    const size_t placeless = position.beside_truth - position.samples.size();
    line(out, "states judged",
         std::to_string(position.samples.size()) + " of " + std::to_string(position.states) + ", " +
             std::to_string(placeless) + " have no place on the map, " +
             std::to_string(position.states - position.beside_truth) + " no truth");
  }
  line(out, "error along the track", spread(position.error_m, metres) + ", bias " + metres(position.bias_m));
  if (position.cross_m.count > 0) line(out, "error across", spread(position.cross_m, metres));
  line(out, "interval coverage",
       share(position.coverage_percent) + " of those judged, " + share(position.coverage_usable_percent) +
           " where not unusable (" + share(position.usable_percent) + ")");
  if (position.without_interval > 0)
    line(out, "without interval", std::to_string(position.without_interval) + " states");
  line(out, "interval width", spread(position.interval_width_m, metres));
  line(out, "distance drift", figure(position.drift.percent, "%.4f", " %"));
  line(out, "speed error", figure(position.speed_rms_mps, "%.4f", " m/s") + " rms");
  line(out, "track known",
       share(position.known_percent) + ", first after " + figure(position.known_after_s, "%.1f", " s"));
  line(out, "on the right track", share(position.right_percent));
}

void print_views(std::ostream& out, const ViewResult& views) {
  out << "track view\n";
  line(out, "rails seen", share(views.seen_percent));
  if (views.visible > 0)
    line(out, "... where visible", share(views.seen_of_visible_percent) + " of " + std::to_string(views.visible));
  for (size_t i = 0; i < kViewFields; ++i) {
    const FieldError& field = views.fields[i];
    const auto number = [](double value) { return figure(value, "%.3g", ""); };
    line(out, kViewFieldNames[i],
         "bias " + number(field.bias) + ", rms " + number(field.rms) + ", p95 " + number(field.absolute.p95) +
             ", within 2 sigma " + share(field.within_2_sigma_percent));
  }
}

void print_edges(std::ostream& out, const EdgeResult& edges) {
  out << "rail edges\n";
  if (!edges.not_possible.empty()) {
    line(out, "error", "not possible: " + edges.not_possible);
    return;
  }
  line(out, "points", std::to_string(edges.points) + ", " + figure(edges.points_per_rail, "%.1f", "") + " a rail");
  line(out, "error along the row",
       "median " + pixels(edges.horizontal_px.p50) + ", p95 " + pixels(edges.horizontal_px.p95));
  line(out, "error along the normal", "median " + pixels(edges.normal_px.p50) + ", p95 " + pixels(edges.normal_px.p95));
}

void print_kind(std::ostream& out, const std::string& name, const KindResult& kind) {
  line(out, name,
       "precision " + share(kind.precision_percent()) + ", recall " + share(kind.recall_percent()) + " (" +
           std::to_string(kind.right) + " right of " + std::to_string(kind.said) + " said, " +
           std::to_string(kind.real) + " real), error p50 " + metres(kind.error_m.p50) + ", p95 " +
           metres(kind.error_m.p95) + ", bias " + metres(kind.bias_m));
}

void print_services(std::ostream& out, const std::vector<ServiceResult>& services) {
  out << "services\n";
  for (const ServiceResult& s : services) {
    const auto ms = [](double value) { return figure(value, "%.2f", " ms"); };
    const auto count = [](double value) { return figure(value, "%.0f", ""); };
    line(out, s.service,
         "in " + count(s.frames_in) + ", out " + count(s.frames_out) + ", dropped " + count(s.dropped) +
             (s.restarts > 0 ? ", started anew " + std::to_string(s.restarts) + " times" : "") + ", latency p50 " +
             ms(s.latency_p50_ms) + ", of the worst second p99 " + ms(s.latency_p99_ms) + ", cpu " +
             figure(s.cpu_percent, "%.1f", " %") + ", " + figure(s.rss_mb, "%.0f", " MB") + ", " + s.last_state);
  }
}

void print_reports(std::ostream& out, const ReportResult& reports) {
  out << "position reports\n";
  line(out, "reports",
       std::to_string(reports.reports) + ", " + std::to_string(reports.with_position) + " with a position; doubt " +
           spread(reports.doubt_m, metres));
  if (reports.judged > 0)
    line(out, "wrong",
         std::to_string(reports.wrong) + " of " + std::to_string(reports.judged) + " judged; group elsewhere " +
             std::to_string(reports.wrong_group) + ", direction " + std::to_string(reports.wrong_direction) +
             ", interval without the front end " + std::to_string(reports.wrong_interval));
  for (const auto& [why, count] : reports.not_judged) line(out, "not judged", std::to_string(count) + " " + why);
}

ordered_json to_json(const Summary& summary) {
  return {{"count", summary.count},
          {"mean", summary.mean},
          {"p50", summary.p50},
          {"p95", summary.p95},
          {"max", summary.max}};
}

ordered_json drift_json(const Drift& drift) {
  return {{"travelled_m", drift.travelled_m},
          {"error_m", drift.error_m},
          {"drift_percent", drift.percent},
          {"drift_100m_mean_percent", drift.window_percent.mean},
          {"drift_100m_p95_percent", drift.window_percent.p95},
          {"drift_100m_windows", drift.window_percent.count}};
}

ordered_json odometry_json(const OdometryResult& odometry) {
  ordered_json json = drift_json(odometry.drift);
  json["valid_percent"] = odometry.valid_percent;
  json["blind_percent"] = odometry.blind_percent;
  json["speed_rms_mps"] = odometry.speed_rms_mps;
  json["turn_stretches"] = odometry.turn.stretches;
  json["turn_error_rad"] = odometry.turn.error_rad;
  json["turn_lead_m"] = odometry.turn.lead_m;
  return json;
}

ordered_json position_json(const PositionResult& position) {
  return {{"basis", position.from_map ? "map" : "distance"},
          {"states", position.states},
          {"judged", position.samples.size()},
          {"without_truth", position.states - position.beside_truth},
          {"position_error_m", to_json(position.error_m)},
          {"bias_m", position.bias_m},
          {"cross_error_m", to_json(position.cross_m)},
          {"coverage_percent", position.coverage_percent},
          {"coverage_usable_percent", position.coverage_usable_percent},
          {"usable_percent", position.usable_percent},
          {"without_interval", position.without_interval},
          {"interval_width_m", to_json(position.interval_width_m)},
          {"distance", drift_json(position.drift)},
          {"speed_rms_mps", position.speed_rms_mps}};
}

ordered_json choice_json(const PositionResult& position) {
  return {{"known_percent", position.known_percent},
          {"known_after_s", position.known_after_s},
          {"right_percent", position.right_percent}};
}

ordered_json views_json(const ViewResult& views) {
  ordered_json json = {{"seen_percent", views.seen_percent},
                       {"visible", views.visible},
                       {"seen_of_visible_percent", views.seen_of_visible_percent}};
  for (size_t i = 0; i < kViewFields; ++i) {
    const FieldError& field = views.fields[i];
    json[kViewFieldNames[i]] = {{"bias", field.bias},
                                {"rms", field.rms},
                                {"p95", field.absolute.p95},
                                {"max", field.absolute.max},
                                {"within_2_sigma_percent", field.within_2_sigma_percent}};
  }
  return json;
}

ordered_json edges_json(const EdgeResult& edges) {
  return {{"points", edges.points},
          {"points_per_rail", edges.points_per_rail},
          {"horizontal_median_px", edges.horizontal_px.p50},
          {"horizontal_p95_px", edges.horizontal_px.p95},
          {"normal_median_px", edges.normal_px.p50},
          {"normal_p95_px", edges.normal_px.p95}};
}

ordered_json kind_json(const KindResult& kind) {
  return {{"real", kind.real},
          {"said", kind.said},
          {"right", kind.right},
          {"precision_percent", kind.precision_percent()},
          {"recall_percent", kind.recall_percent()},
          {"position_error_m", to_json(kind.error_m)},
          {"bias_m", kind.bias_m}};
}

ordered_json sightings_json(const SightingResult& sightings) {
  ordered_json json = kind_json(sightings.all);
  json["kinds"] = ordered_json::object();
  for (const auto& [name, kind] : sightings.kinds) json["kinds"][name] = kind_json(kind);
  return json;
}

ordered_json reports_json(const ReportResult& reports) {
  return {{"count", reports.reports},
          {"with_position", reports.with_position},
          {"doubt_m", to_json(reports.doubt_m)},
          {"judged", reports.judged},
          {"wrong", reports.wrong},
          {"wrong_group", reports.wrong_group},
          {"wrong_direction", reports.wrong_direction},
          {"wrong_interval", reports.wrong_interval},
          {"not_judged", reports.not_judged}};
}

ordered_json services_json(const std::vector<ServiceResult>& services) {
  ordered_json json = ordered_json::array();
  for (const ServiceResult& s : services) {
    json.push_back({{"service", s.service},
                    {"host", s.host},
                    {"frames_in", s.frames_in},
                    {"frames_out", s.frames_out},
                    {"dropped", s.dropped},
                    {"restarts", s.restarts},
                    {"latency_p50_ms", s.latency_p50_ms},
                    {"latency_p99_ms", s.latency_p99_ms},
                    {"cpu_percent", s.cpu_percent},
                    {"rss_mb", s.rss_mb},
                    {"last_state", s.last_state}});
  }
  return json;
}

template <class T, class Write>
ordered_json or_null(const std::optional<T>& part, Write write) {
  return part ? write(*part) : ordered_json();
}

/// What the truth cannot tell.
void print_truth(std::ostream& out, const Evaluation& evaluation) {
  constexpr double kWorthSayingM = 0.01;
  const auto seconds = [](double value) { return figure(value, "%.1f", " s"); };
  if (is_longer_than_truth(evaluation))
    line(out, "truth",
         "of " + seconds(evaluation.ride_s) + " for a run of " + seconds(evaluation.run_s) +
             ": errors are of these, shares of steps, fixes, reports and services of all");
  if (const auto& gaps = evaluation.truth_gaps; gaps.count > 0)
    line(out, "gaps in the truth",
         std::to_string(gaps.count) + " of up to " + seconds(gaps.longest_s) + ", not judged there");
  if (evaluation.truth_between_rows_m > kWorthSayingM)
    line(out, "between its rows",
         "the truth itself is off by up to " + metres(evaluation.truth_between_rows_m) +
             ": they are far apart for its accelerations");
}

void print_gaps(std::ostream& out, const std::map<std::string, TimeGaps>& gaps_of) {
  for (const auto& [name, gaps] : gaps_of)
    out << name << ": NO ROWS for " << figure(gaps.longest_s, "%.1f", " s") << " from "
        << figure(core::seconds(gaps.longest_from_ns), "%.1f", " s") << " on"
        << (gaps.count > 1 ? ", and in " + std::to_string(gaps.count - 1) + " more gaps" : "") << '\n';
}

}  // namespace

void print(const Evaluation& evaluation, std::ostream& out) {
  out << "run of " << metres(evaluation.travelled_m) << " in " << figure(evaluation.duration_s, "%.1f", " s");
  if (is_part(evaluation))
    out << ", a part of the ride of " << metres(evaluation.ride_m) << " in " << figure(evaluation.ride_s, "%.1f", " s");
  out << '\n';
  print_truth(out, evaluation);
  if (evaluation.odometry) print_odometry(out, *evaluation.odometry);
  if (evaluation.position) print_position(out, *evaluation.position);
  if (evaluation.views) print_views(out, *evaluation.views);
  if (evaluation.edges) print_edges(out, *evaluation.edges);
  if (evaluation.sightings) {
    out << "sightings\n";
    print_kind(out, "all", evaluation.sightings->all);
    for (const auto& [name, kind] : evaluation.sightings->kinds) print_kind(out, name, kind);
  }
  if (evaluation.fixes) {
    out << "position fixes\n";
    for (const auto& [kind, count] : *evaluation.fixes) line(out, kind, std::to_string(count));
  }
  if (evaluation.reports) print_reports(out, *evaluation.reports);
  if (evaluation.services) print_services(out, *evaluation.services);
  for (const std::string& name : evaluation.missing) out << name << ": not in this run\n";
  for (const std::string& name : evaluation.empty) out << name << ": has a header and no row, not judged\n";
  for (const auto& [name, rows] : evaluation.out_of_order)
    out << name << ": OUT OF ORDER, " << rows << " rows are older than one above them\n";
  print_gaps(out, evaluation.gaps);
}

ordered_json to_json(const Evaluation& evaluation) {
  ordered_json json = {{"duration_s", evaluation.duration_s},
                       {"travelled_m", evaluation.travelled_m},
                       {"ride_s", evaluation.ride_s},
                       {"ride_m", evaluation.ride_m},
                       {"missing", evaluation.missing}};
  json["truth_gaps"] = {{"count", evaluation.truth_gaps.count}, {"longest_s", evaluation.truth_gaps.longest_s}};
  json["truth_between_rows_m"] = evaluation.truth_between_rows_m;
  json["run_s"] = evaluation.run_s;
  json["gaps"] = ordered_json::object();
  for (const auto& [name, gaps] : evaluation.gaps)
    json["gaps"][name] = {
        {"count", gaps.count}, {"longest_s", gaps.longest_s}, {"from_s", core::seconds(gaps.longest_from_ns)}};
  json["empty"] = evaluation.empty;
  json["out_of_order"] = evaluation.out_of_order;
  json["odometry"] = or_null(evaluation.odometry, odometry_json);
  json["position"] = or_null(evaluation.position, position_json);
  json["track_choice"] = or_null(evaluation.position, choice_json);
  json["track_view"] = or_null(evaluation.views, views_json);
  json["edges"] = or_null(evaluation.edges, edges_json);
  json["sightings"] = or_null(evaluation.sightings, sightings_json);
  json["position_fixes"] = or_null(evaluation.fixes, [](const auto& fixes) { return ordered_json(fixes); });
  json["reports"] = or_null(evaluation.reports, reports_json);
  json["services"] = or_null(evaluation.services, services_json);
  double dropped = 0;
  for (const ServiceResult& service : evaluation.services.value_or(std::vector<ServiceResult>{}))
    dropped += service.dropped;
  json["dropped"] = evaluation.services ? ordered_json(dropped) : ordered_json();
  return json;
}

}  // namespace railfix::evaluation
