#include "evaluation/evaluation.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>

#include "core/time.hpp"

namespace railfix::evaluation {

namespace {

/// A service that is started anew counts from 0 again.
double counted(const std::vector<const StatusRow*>& rows, double StatusRow::*field) {
  double before = 0;
  double last = kUnknown;
  for (const StatusRow* row : rows) {
    const double now = row->*field;
    if (!std::isfinite(now)) continue;
    if (now < last) before += last;
    last = now;
  }
  return before + last;
}

size_t restarts_in(const std::vector<const StatusRow*>& rows) {
  size_t restarts = 0;
  for (size_t i = 1; i < rows.size(); ++i) restarts += rows[i]->frames_in < rows[i - 1]->frames_in ? 1 : 0;
  return restarts;
}

}  // namespace

std::vector<ServiceResult> judge_services(const std::vector<StatusRow>& rows) {
  std::map<std::pair<std::string, std::string>, std::vector<const StatusRow*>> by_service;
  for (const StatusRow& row : rows) by_service[{row.service, row.host}].push_back(&row);
  std::vector<ServiceResult> results;
  for (const auto& [name, its] : by_service) {
    const auto of = [&its = its](double StatusRow::*field) {
      std::vector<double> values;
      values.reserve(its.size());
      for (const StatusRow* row : its) values.push_back(row->*field);
      return summarise(std::move(values));
    };
    // Where nothing went out there was no latency, which a service says as 0.
    const auto latency_of = [&its = its](double StatusRow::*field) {
      std::vector<double> values;
      for (const StatusRow* row : its)
        if (row->latency_p99_ms > 0) values.push_back(row->*field);
      return summarise(std::move(values));
    };
    ServiceResult result;
    result.service = name.first;
    result.host = name.second;
    result.frames_in = counted(its, &StatusRow::frames_in);
    result.frames_out = counted(its, &StatusRow::frames_out);
    result.dropped = counted(its, &StatusRow::dropped);
    result.restarts = restarts_in(its);
    result.latency_p50_ms = latency_of(&StatusRow::latency_p50_ms).p50;
    result.latency_p99_ms = latency_of(&StatusRow::latency_p99_ms).max;
    result.cpu_percent = of(&StatusRow::cpu_percent).mean;
    result.rss_mb = of(&StatusRow::rss_mb).max;
    result.last_state = its.back()->state;
    results.push_back(result);
  }
  return results;
}

core::Status check_times(const Truth& truth, const RunTables& run) {
  using Span = RunTables::Span;
  const Span real{truth.rows().front().stamp_ns, truth.rows().back().stamp_ns};
  const auto apart = [&real](const Span& span) { return span.from_ns > real.to_ns || span.to_ns < real.from_ns; };
  const auto text = [](const Span& span) {
    std::array<char, 80> seconds{};
    std::snprintf(seconds.data(), seconds.size(), "from %.3f to %.3f s", core::seconds(span.from_ns),
                  core::seconds(span.to_ns));
    return std::string(seconds.data());
  };
  const auto refusal = [&](const std::string& what, const Span& span, const char* advice) {
    return core::Error{what + " is " + text(span) + " and the truth " + text(real) + ", with no time in common; " +
                       advice};
  };
  if (run.spans.empty()) return {};
  Span all = run.spans.begin()->second;
  for (const auto& [name, span] : run.spans)
    all = {std::min(all.from_ns, span.from_ns), std::max(all.to_ns, span.to_ns)};
  if (apart(all)) return refusal("the run", all, "give the truth of the dataset that was run");
  // Tables of single events may well begin after a truth that is short.
  for (const auto& [name, span] : run.spans) {
    if (span.every_step && apart(span)) return refusal(name, span, "put all tables of one run into the folder");
  }
  return {};
}

namespace {

/// What the tables cover that have a row for every step.
std::optional<Stretch> steps_of(const RunTables& run) {
  std::optional<Stretch> stretch;
  for (const auto& [name, span] : run.spans) {
    if (!span.every_step) continue;
    if (!stretch) stretch = {span.from_ns, span.to_ns};
    stretch = {std::min(stretch->from_ns, span.from_ns), std::max(stretch->to_ns, span.to_ns)};
  }
  return stretch;
}

/// What was run of the truth, all of it but for what a start and an end take.
Stretch covered(const Truth& truth, const std::optional<Stretch>& ran) {
  const Stretch whole = truth.whole();
  if (!ran) return whole;
  Stretch stretch = *ran;
  if (stretch.from_ns < whole.from_ns + core::kNsPerSecond) stretch.from_ns = whole.from_ns;
  if (stretch.to_ns > whole.to_ns - core::kNsPerSecond) stretch.to_ns = whole.to_ns;
  return stretch;
}

}  // namespace

Evaluation evaluate(const Truth& truth, const RunTables& run, const ReportGround& ground) {
  Evaluation result;
  const auto ran = steps_of(run);
  const Stretch stretch = covered(truth, ran);
  result.duration_s = core::seconds(stretch.to_ns - stretch.from_ns);
  result.travelled_m = truth.travelled_m(stretch);
  result.ride_s = core::seconds(truth.whole().to_ns - truth.whole().from_ns);
  result.ride_m = truth.travelled_m(truth.whole());
  if (ran) result.run_s = core::seconds(ran->to_ns - ran->from_ns);
  result.truth_gaps = truth.gaps();
  result.truth_between_rows_m = truth.between_rows_m();
  result.missing = run.missing;
  result.empty = run.empty;
  result.out_of_order = run.out_of_order;
  for (const auto& [name, span] : run.spans)
    if (span.gaps.count > 0) result.gaps[name] = span.gaps;
  if (run.odometry) result.odometry = judge_odometry(truth, *run.odometry);
  if (run.states) result.position = judge_position(truth, *run.states);
  if (run.views) result.views = judge_views(truth, *run.views);
  if (run.rails) result.edges = judge_edges(truth, *run.rails);
  if (run.sightings) result.sightings = judge_sightings(truth, *run.sightings, stretch);
  if (run.fixes) {
    result.fixes.emplace();
    for (const FixRow& fix : *run.fixes) ++(*result.fixes)[fix.kind];
  }
  if (run.reports) result.reports = judge_reports(truth, *run.reports, ground);
  if (run.status) result.services = judge_services(*run.status);
  return result;
}

}  // namespace railfix::evaluation
