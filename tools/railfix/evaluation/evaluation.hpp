// `railfix evaluate`: a run's tables beside the truth, as figures, text and JSON.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <ostream>
#include <string>
#include <vector>

#include "evaluation/motion.hpp"
#include "evaluation/reports.hpp"
#include "evaluation/seeing.hpp"

namespace railfix::evaluation {

struct ServiceResult {
  std::string service;
  std::string host;
  double frames_in = 0;
  double frames_out = 0;
  double dropped = 0;
  size_t restarts = 0;               // its counters began again
  double latency_p50_ms = kUnknown;  // median of what the service said each second in which something went out
  double latency_p99_ms = kUnknown;  // the worst second
  double cpu_percent = kUnknown;     // mean
  double rss_mb = kUnknown;          // largest
  std::string last_state;
};
std::vector<ServiceResult> judge_services(const std::vector<StatusRow>& rows);

/// What is not in the run is nothing.
struct Evaluation {
  double duration_s = 0;  // of the run ...
  double travelled_m = 0;
  double ride_s = 0;  // ... and of the truth: a run that was broken off is shorter
  double ride_m = 0;
  double run_s = 0;  // of the tables that have a row for every step; a truth may be shorter
  TimeGaps truth_gaps;
  double truth_between_rows_m = 0;
  std::optional<OdometryResult> odometry;
  std::optional<PositionResult> position;
  std::optional<ViewResult> views;
  std::optional<EdgeResult> edges;
  std::optional<SightingResult> sightings;
  std::optional<std::map<std::string, size_t>> fixes;  // how many of each kind
  std::optional<ReportResult> reports;
  std::optional<std::vector<ServiceResult>> services;
  std::vector<std::string> missing;
  std::vector<std::string> empty;              // tables with a header alone, not judged
  std::map<std::string, size_t> out_of_order;  // rows that stood below a newer one, by table
  std::map<std::string, TimeGaps> gaps;        // of tables that have a row for every step
};
/// An error names both times where the truth has none in common with the run, or with a table of every step.
core::Status check_times(const Truth& truth, const RunTables& run);
Evaluation evaluate(const Truth& truth, const RunTables& run, const ReportGround& ground = {});

/// Of a ride that goes on without the run, or began before it.
inline bool is_part(const Evaluation& evaluation) {
  return evaluation.duration_s < evaluation.ride_s;
}
/// The run began before its truth or goes on behind it.
inline bool is_longer_than_truth(const Evaluation& evaluation) {
  return evaluation.run_s > evaluation.ride_s + 1;
}

void print(const Evaluation& evaluation, std::ostream& out);
nlohmann::ordered_json to_json(const Evaluation& evaluation);

}  // namespace railfix::evaluation
