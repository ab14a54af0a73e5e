// The tables that a run leaves in its folder (docs/dataset), as rows in memory.
#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "core/result.hpp"
#include "etcs/train_position_report.hpp"
#include "evaluation/statistics.hpp"
#include "evaluation/time_gaps.hpp"

namespace railfix::evaluation {

struct OdometryRow {
  int64_t stamp_ns = 0;
  bool valid = false;
  double distance_m = 0;
  double speed_mps = 0;
  std::string mode;
  double yaw_rate_rps = kUnknown;  // left positive
};

struct StateRow {
  int64_t stamp_ns = 0;
  bool track_known = false;
  double distance_m = 0;
  double speed_mps = 0;
  double over_m = 0;
  double under_m = 0;
  std::string integrity;
  double easting_m = 0;
  double northing_m = 0;
  double track_probability = 1;
};

/// In the order of the table: roll, pitch, yaw, lateral, height, curvature, vertical curvature.
constexpr size_t kViewFields = 7;
constexpr std::array<const char*, kViewFields> kViewFieldNames = {
    "roll_rad", "pitch_rad", "yaw_rad", "lateral_m", "height_m", "curvature_per_m", "vertical_curvature_per_m"};
struct ViewRow {
  int64_t stamp_ns = 0;
  bool seen = false;
  std::array<double, kViewFields> value{};
  std::array<double, kViewFields> sigma{};
};

struct RailPoint {
  int64_t stamp_ns = 0;
  bool left = false;
  double u_px = 0;
  double v_px = 0;
};

struct SightingRow {
  int64_t stamp_ns = 0;
  std::string kind;
  double distance_ahead_m = 0;
};

struct FixRow {
  std::string kind;
};

struct ReportRow {
  int64_t stamp_ns = 0;
  std::optional<uint32_t> nid_lrbg{};
  double d_lrbg_m = kUnknown;
  double doubt_over_m = 0;
  double doubt_under_m = 0;
  uint32_t q_dirlrbg = etcs::kUnknownSide;
  uint32_t q_dlrbg = etcs::kUnknownSide;
  uint32_t q_dirtrain = etcs::kUnknownSide;
  [[nodiscard]] bool position_known() const { return std::isfinite(d_lrbg_m); }
};

struct StatusRow {
  std::string service;
  std::string host;
  std::string state;
  double frames_in = 0;
  double frames_out = 0;
  double dropped = 0;
  double latency_p50_ms = 0;
  double latency_p99_ms = 0;
  double cpu_percent = 0;
  double rss_mb = 0;
};

/// Nothing where the run has no such table. Rows with stamps are in the order of their stamps.
struct RunTables {
  std::optional<std::vector<OdometryRow>> odometry;
  std::optional<std::vector<StateRow>> states;
  std::optional<std::vector<ViewRow>> views;
  std::optional<std::vector<RailPoint>> rails;
  std::optional<std::vector<SightingRow>> sightings;
  std::optional<std::vector<FixRow>> fixes;
  std::optional<std::vector<ReportRow>> reports;
  std::optional<std::vector<StatusRow>> status;
  std::vector<std::string> missing;  // names of the tables that are not in this run
  std::vector<std::string> empty{};  // ... that hold a header alone where every step has a row; as if not there
  /// By the table's name: rows that stood below a newer one.
  std::map<std::string, size_t> out_of_order{};

  struct Span {
    int64_t from_ns = 0;
    int64_t to_ns = 0;
    bool every_step = false;  // of a table that has a row for every step of its service
    TimeGaps gaps{};          // of such a table
  };
  /// Of the stamps, by the name of the table that has any.
  std::map<std::string, Span> spans{};
};

/// A folder that does not exist, or that holds none of the tables, is an error; so is a broken row (file and line).
core::Result<RunTables> read_run(const std::filesystem::path& folder);

}  // namespace railfix::evaluation
