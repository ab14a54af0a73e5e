#include "evaluation/run_tables.hpp"

#include <algorithm>
#include <cmath>
#include <type_traits>

#include "core/csv_table.hpp"
#include "core/joined.hpp"
#include "core/train_limits.hpp"
#include "messaging/message_words.hpp"

namespace railfix::evaluation {
namespace {

namespace fs = std::filesystem;
using core::CsvTable;
using core::Error;
using core::Status;

// One that nobody knows would be judged as another.
template <size_t N>
std::string word(CsvTable& table, size_t column, const std::string& what, const std::array<const char*, N>& words) {
  std::string said = table.text(column);
  if (std::ranges::find(words, said) == words.end())
    table.refuse("has the " + what + " '" + said + "', which must be one of " + core::joined(words));
  return said;
}

Status read(const fs::path& file, std::vector<OdometryRow>& rows) {
  CsvTable table(file);
  const size_t stamp = table.required({"stamp_ns"});
  const size_t valid = table.required({"valid"});
  const size_t distance = table.required({"distance_m"});
  const size_t speed = table.required({"speed_mps"});
  const size_t mode = table.required({"mode"});
  const std::optional<size_t> yaw_rate = table.optional({"yaw_rate_rps"});
  while (table.next()) {
    rows.push_back({table.integer(stamp), table.integer(valid) != 0, table.number_or_nan(distance, core::kFarthestM),
                    table.number_or_nan(speed, core::kFastestTrainMps),
                    word(table, mode, "mode", messaging::kOdometryModeNames), table.number_or_nan(yaw_rate)});
  }
  return table.status();
}

Status read(const fs::path& file, std::vector<StateRow>& rows) {
  CsvTable table(file);
  const size_t stamp = table.required({"stamp_ns"});
  const size_t known = table.required({"track_known"});
  const size_t distance = table.required({"distance_m"});
  const size_t speed = table.required({"speed_mps"});
  const size_t over = table.required({"over_m"});
  const size_t under = table.required({"under_m"});
  const size_t integrity = table.required({"integrity"});
  const size_t easting = table.required({"easting_m"});
  const size_t northing = table.required({"northing_m"});
  const std::optional<size_t> track = table.optional({"track_probability"});
  while (table.next()) {
    StateRow row;
    if (track) row.track_probability = table.number_or_nan(*track);
    row.stamp_ns = table.integer(stamp);
    row.track_known = table.integer(known) != 0;
    row.distance_m = table.number_or_nan(distance, core::kFarthestM);
    row.speed_mps = table.number_or_nan(speed, core::kFastestTrainMps);
    row.over_m = table.number_or_nan(over, core::kWidestM);
    row.under_m = table.number_or_nan(under, core::kWidestM);
    if (row.over_m < 0 || row.under_m < 0) table.refuse("has an interval that ends before it begins");
    row.integrity = word(table, integrity, "integrity", messaging::kIntegrityNames);
    row.easting_m = table.number_or_nan(easting, core::kFarthestM);
    row.northing_m = table.number_or_nan(northing, core::kFarthestM);
    rows.push_back(row);
  }
  return table.status();
}

Status read(const fs::path& file, std::vector<ViewRow>& rows) {
  CsvTable table(file);
  const size_t stamp = table.required({"stamp_ns"});
  const size_t seen = table.required({"seen"});
  std::array<size_t, kViewFields> values{};
  std::array<size_t, kViewFields> sigmas{};
  for (size_t i = 0; i < kViewFields; ++i) {
    values[i] = table.required({kViewFieldNames[i]});
    sigmas[i] = table.required({std::string(kViewFieldNames[i]) + "_sigma"});
  }
  while (table.next()) {
    ViewRow row;
    row.stamp_ns = table.integer(stamp);
    row.seen = table.integer(seen) != 0;
    for (size_t i = 0; i < kViewFields; ++i) {
      row.value[i] = table.number_or_nan(values[i], core::kFarthestM);
      row.sigma[i] = table.number_or_nan(sigmas[i], core::kWidestM);
    }
    rows.push_back(row);
  }
  return table.status();
}

Status read(const fs::path& file, std::vector<RailPoint>& rows) {
  CsvTable table(file);
  const size_t stamp = table.required({"stamp_ns"});
  const size_t rail = table.required({"rail"});
  const size_t u = table.required({"u_px"});
  const size_t v = table.required({"v_px"});
  while (table.next()) {
    const std::string side = table.text(rail);
    if (side != "L" && side != "R") table.refuse("has the rail '" + side + "', which must be L or R");
    rows.push_back(
        {table.integer(stamp), side == "L", table.finite(u, core::kFarthestM), table.finite(v, core::kFarthestM)});
  }
  return table.status();
}

Status read(const fs::path& file, std::vector<SightingRow>& rows) {
  CsvTable table(file);
  const size_t stamp = table.required({"stamp_ns"});
  const size_t kind = table.required({"kind"});
  const size_t ahead = table.required({"distance_ahead_m"});
  while (table.next())
    rows.push_back({table.integer(stamp), table.text(kind), table.finite(ahead, core::kFarthestSeenM)});
  return table.status();
}

Status read(const fs::path& file, std::vector<FixRow>& rows) {
  CsvTable table(file);
  const size_t kind = table.required({"kind"});
  while (table.next()) rows.push_back({table.text(kind)});
  return table.status();
}

Status read(const fs::path& file, std::vector<ReportRow>& rows) {
  CsvTable table(file);
  const size_t stamp = table.required({"stamp_ns"});
  const size_t distance = table.required({"d_lrbg_m"});
  const size_t over = table.required({"l_doubtover_m"});
  const size_t under = table.required({"l_doubtunder_m"});
  const std::optional<size_t> group = table.optional({"nid_lrbg"});
  const std::optional<size_t> sides[] = {table.optional({"q_dirlrbg"}), table.optional({"q_dlrbg"}),
                                         table.optional({"q_dirtrain"})};
  const auto side = [&](size_t i) {
    const double said = table.number_or_nan(sides[i]);
    return said == 0 || said == 1 ? static_cast<uint32_t>(said) : uint32_t{etcs::kUnknownSide};
  };
  while (table.next()) {
    ReportRow row{.stamp_ns = table.integer(stamp),
                  .d_lrbg_m = table.number_or_nan(distance, core::kFarthestM),
                  .doubt_over_m = table.number_or_nan(over, core::kWidestM),
                  .doubt_under_m = table.number_or_nan(under, core::kWidestM),
                  .q_dirlrbg = side(0),
                  .q_dlrbg = side(1),
                  .q_dirtrain = side(2)};
    const double nid_lrbg = table.number_or_nan(group, etcs::kUnknownBaliseGroup);
    if (nid_lrbg >= 0) row.nid_lrbg = static_cast<uint32_t>(nid_lrbg);
    rows.push_back(row);
  }
  return table.status();
}

Status read(const fs::path& file, std::vector<StatusRow>& rows) {
  CsvTable table(file);
  const size_t service = table.required({"service"});
  const size_t host = table.required({"host"});
  const size_t state = table.required({"state"});
  const size_t numbers[] = {table.required({"frames_in"}),      table.required({"frames_out"}),
                            table.required({"dropped"}),        table.required({"latency_p50_ms"}),
                            table.required({"latency_p99_ms"}), table.required({"cpu_percent"}),
                            table.required({"rss_mb"})};
  while (table.next()) {
    double value[std::size(numbers)];
    for (size_t i = 0; i < std::size(numbers); ++i) value[i] = table.number_or_nan(numbers[i]);
    rows.push_back({table.text(service), table.text(host), table.text(state), value[0], value[1], value[2], value[3],
                    value[4], value[5], value[6]});
  }
  return table.status();
}

/// What stands beside the track is told up to half a second after the picture that showed it nearest.
template <class Row>
constexpr int64_t kToldLateNs = std::is_same_v<Row, SightingRow> ? 1'000'000'000 : 0;

template <class Row>
size_t put_in_order(std::vector<Row>& rows) {
  size_t older = 0;
  int64_t newest_ns = rows.empty() ? 0 : rows.front().stamp_ns;
  for (const Row& row : rows) {
    if (row.stamp_ns < newest_ns - kToldLateNs<Row>) ++older;
    newest_ns = std::max(newest_ns, row.stamp_ns);
  }
  const auto earlier = [](const Row& a, const Row& b) { return a.stamp_ns < b.stamp_ns; };
  if (!std::is_sorted(rows.begin(), rows.end(), earlier)) std::stable_sort(rows.begin(), rows.end(), earlier);
  return older;
}

/// Its service writes a row at every step: without any there is nothing to judge. In other tables none is a result.
template <class Row>
constexpr bool kEveryStep =
    std::is_same_v<Row, OdometryRow> || std::is_same_v<Row, StateRow> || std::is_same_v<Row, ViewRow>;

template <class Row>
Status read_if_there(const fs::path& folder, const std::string& name, std::optional<std::vector<Row>>& rows,
                     RunTables& run) {
  if (!fs::exists(folder / name)) {
    run.missing.push_back(name);
    return {};
  }
  rows.emplace();
  const Status status = read(folder / name, *rows);
  if constexpr (requires(Row row) { row.stamp_ns; }) {
    if (const size_t older = put_in_order(*rows)) run.out_of_order[name] = older;
    if (!rows->empty())
      run.spans[name] = {rows->front().stamp_ns, rows->back().stamp_ns, kEveryStep<Row>,
                         kEveryStep<Row> ? gaps_in(stamps_of(*rows)) : TimeGaps{}};
  }
  if constexpr (kEveryStep<Row>) {
    if (status.ok() && rows->empty()) {
      run.empty.push_back(name);
      rows.reset();
    }
  }
  return status;
}

}  // namespace

core::Result<RunTables> read_run(const fs::path& folder) {
  if (!fs::is_directory(folder)) return Error{folder.string() + " is not a folder; give the --out folder of a run"};
  RunTables run;
  for (const Status& status :
       {read_if_there(folder, "odometry.csv", run.odometry, run),
        read_if_there(folder, "train_state.csv", run.states, run),
        read_if_there(folder, "track_view.csv", run.views, run), read_if_there(folder, "rails.csv", run.rails, run),
        read_if_there(folder, "sightings.csv", run.sightings, run),
        read_if_there(folder, "position_fix.csv", run.fixes, run), read_if_there(folder, "tpr.csv", run.reports, run),
        read_if_there(folder, "status.csv", run.status, run)}) {
    if (!status.ok()) return status.error();
  }
  constexpr size_t kTables = 8;
  if (run.missing.size() == kTables)
    return Error{folder.string() + " holds no table of a run (odometry.csv, train_state.csv, ...)"};
  return run;
}

}  // namespace railfix::evaluation
