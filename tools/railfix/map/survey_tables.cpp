// The tables of a run as sightings on the map.
#include <algorithm>
#include <cmath>

#include "core/csv_table.hpp"
#include "core/train_limits.hpp"
#include "map/survey.hpp"
#include "map/survey_content.hpp"
#include "map/survey_stamps.hpp"
#include "map/survey_states.hpp"

namespace railfix::tool {

namespace {

/// An infinite sigma counts for nothing, one of 0 for everything.
double sigma_in(core::CsvTable& table, size_t column) {
  const double sigma_m = table.number_or_nan(column, core::kWidestM);
  if (!std::isfinite(sigma_m) || sigma_m <= 0) table.refuse_cell(column, "is not a length of more than 0 m");
  return sigma_m;
}

double confidence_in(core::CsvTable& table, std::optional<size_t> column) {
  const double confidence = table.number_or_nan(column);
  if (confidence < 0 || confidence > 1) table.refuse_cell(*column, "is not a probability from 0 to 1");
  return confidence;
}

/// As it stands in the table.
struct SightingRow {
  int64_t stamp_ns = 0;
  track::LandmarkKind kind = track::LandmarkKind::unknown;
  double ahead_m = 0;
  double lateral_m = 0;  // left positive, seen from the cab
  double sigma_m = 0;
  double confidence = 0;
  /// Not worth a landmark.
  [[nodiscard]] bool doubtful() const { return !track::can_be_sighted(kind) || confidence < kLeastConfidence; }
};

core::Result<std::vector<SightingRow>> read_rows(const std::filesystem::path& file) {
  core::CsvTable table(file);
  const size_t stamp = table.required({"stamp_ns"});
  const size_t kind = table.required({"kind"});
  const size_t ahead = table.required({"distance_ahead_m"});
  const size_t lateral = table.required({"lateral_m"});
  const size_t sigma = table.required({"sigma_m"});
  const std::optional<size_t> confidence = table.optional({"confidence"});
  Stamps stamps;
  std::vector<SightingRow> rows;
  while (table.next()) {
    SightingRow row;
    row.stamp_ns = stamps.next(table, stamp);
    const auto what = track::landmark_kind_from(table.text(kind));
    if (!what) table.refuse("\"" + table.text(kind) + "\" is no kind of landmark");
    row.kind = what.value_or(row.kind);
    row.ahead_m = table.finite(ahead, core::kFarthestSeenM);
    row.sigma_m = sigma_in(table, sigma);
    const double side_m = table.number_or_nan(lateral, core::kFarthestSeenM);
    row.lateral_m = std::isfinite(side_m) ? side_m : 0;
    row.confidence = confidence_in(table, confidence);
    rows.push_back(row);
  }
  if (!table.status().ok()) return table.status().error();
  return rows;
}

core::Result<RunContent> content_of(const std::filesystem::path& file, const std::vector<SightingRow>& rows) {
  RunContent content;
  if (const auto added = content.add_table(file); !added.ok()) return added.error();
  for (const SightingRow& row : rows) content.add(row.stamp_ns, row.kind, row.ahead_m);
  return content;
}

struct ReadRun {
  ReadSightings sightings;
  RunContent content;
};

core::Result<ReadRun> read_run(const std::shared_ptr<const track::Map>& map, const std::filesystem::path& folder,
                               size_t run) {
  const auto read = RunStates::read(map, folder / "train_state.csv");
  if (!read.ok()) return read.error();
  const RunStates& states = read.value();
  const auto rows = read_rows(folder / "sightings.csv");
  if (!rows.ok()) return rows.error();
  const auto content = content_of(folder / "sightings.csv", rows.value());
  if (!content.ok()) return content.error();
  ReadRun out{{}, content.value()};
  for (const SightingRow& row : rows.value()) {
    const auto moment = states.at(row.stamp_ns);
    const auto place = moment ? states.place_ahead(*moment, row.ahead_m) : std::nullopt;
    if (!place || row.doubtful()) {
      ++(row.doubtful() ? out.sightings.doubtful : out.sightings.placeless);
      continue;
    }
    const RunState& from = *moment->from;
    const bool is_reverse = place->direction == track::Direction::reverse;
    out.sightings.placed.push_back({run, from.way_m, track::seen_along(row.kind, !is_reverse), place->edge,
                                    place->offset_m, is_reverse ? -row.lateral_m : row.lateral_m, row.sigma_m,
                                    from.sigma_m, from.place_ahead_m, is_reverse, from.stretch});
  }
  if (!out.sightings.placed.empty()) out.sightings.runs.push_back(out.content.text());
  out.sightings.passed = states.passed(run);
  if (states.never_confirmed()) out.sightings.never_confirmed.push_back(run);
  return out;
}

core::Error same_run(const std::filesystem::path& run, const std::filesystem::path& as) {
  return {run.string() + " is the same run as " + as.string() + "; give every run once"};
}

template <class T>
void append(std::vector<T>& to, const std::vector<T>& more) {
  to.insert(to.end(), more.begin(), more.end());
}

}  // namespace

core::Result<ReadSightings> read_sightings(const std::shared_ptr<const track::Map>& map,
                                           const std::filesystem::path& run_folder, size_t run) {
  auto read = read_run(map, run_folder, run);
  if (!read.ok()) return read.error();
  return std::move(read).value().sightings;
}

core::Result<ReadSightings> read_runs(const std::shared_ptr<const track::Map>& map,
                                      const std::vector<std::filesystem::path>& run_folders) {
  ReadSightings out;
  std::vector<std::pair<RunContent, std::filesystem::path>> seen;
  for (size_t i = 0; i < run_folders.size(); ++i) {
    for (size_t before = 0; before < i; ++before) {
      std::error_code unreadable;  // told below
      if (std::filesystem::equivalent(run_folders[i], run_folders[before], unreadable))
        return same_run(run_folders[i], run_folders[before]);
    }
    const auto read = read_run(map, run_folders[i], i);
    if (!read.ok()) return read.error();
    const auto& [sightings, content] = read.value();
    for (const auto& [other, folder] : seen) {
      if (content.same_run(other)) return same_run(run_folders[i], folder);
    }
    const auto learnt = [&content = content](const std::string& run) { return content.same_run(RunContent(run)); };
    if (std::ranges::any_of(map->learnt_runs, learnt))
      return core::Error{"the map has learnt from " + run_folders[i].string() +
                         " before, and its sightings would count twice; leave it out, or learn from all runs at once "
                         "on the map of before"};
    seen.emplace_back(content, run_folders[i]);
    append(out.runs, sightings.runs);
    append(out.placed, sightings.placed);
    append(out.passed, sightings.passed);
    append(out.never_confirmed, sightings.never_confirmed);
    out.placeless += sightings.placeless;
    out.doubtful += sightings.doubtful;
  }
  return out;
}

}  // namespace railfix::tool
