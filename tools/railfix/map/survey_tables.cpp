// The tables of a run as sightings on the map.
#include <algorithm>
#include <cmath>
#include <limits>
#include <map>

#include "core/csv_table.hpp"
#include "core/fnv.hpp"
#include "core/time.hpp"
#include "core/train_limits.hpp"
#include "core/whole_file.hpp"
#include "map/survey.hpp"
#include "track/path.hpp"
#include "track/same_map.hpp"

namespace railfix::tool {

namespace {

constexpr uint64_t kInterleavedNs = 1'000'000'000;  // several cameras, or a standby that takes over, write in turn
constexpr double kNearM = 50;  // a state's place lies so near to where the speed would have brought the train

struct State {
  int64_t stamp_ns = 0;
  track::EdgePosition place;
  double way_m = 0;          // by the speed alone: fixes do not move it
  double place_ahead_m = 0;  // the place along the track minus way_m; changes where a fix moved the place
  double sigma_m = 0;
};

/// The way between two places, along the train; nothing where no short way leads from one to the other.
std::optional<double> way_between(const std::shared_ptr<const track::Map>& map, const State& a, const State& b) {
  if (a.place.edge == b.place.edge) {
    const double grown_m = b.place.offset_m - a.place.offset_m;
    return a.place.direction == track::Direction::reverse ? -grown_m : grown_m;
  }
  const double reach_m = std::abs(b.way_m - a.way_m) + kNearM;
  const auto path = track::Path::follow(map, a.place, reach_m, reach_m, {b.place.edge});
  return path.ok() ? path.value().distance_of(b.place.edge, b.place.offset_m) : std::nullopt;
}

/// An infinite sigma counts for nothing, one of 0 for everything.
double sigma_in(core::CsvTable& table, size_t column) {
  const double sigma_m = table.number_or_nan(column, core::kWidestM);
  if (!std::isfinite(sigma_m) || sigma_m <= 0) table.refuse_cell(column, "is not a length of more than 0 m");
  return sigma_m;
}

void check_confidence(core::CsvTable& table, std::optional<size_t> column) {
  if (!column) return;
  const double confidence = table.number_or_nan(column);
  if (confidence < 0 || confidence > 1) table.refuse_cell(*column, "is not a probability from 0 to 1");
}

/// The stamps of a table, in the order of its rows.
class Stamps {
 public:
  /// Of this row, which is refused where that lies far before the one of a row above.
  int64_t next(core::CsvTable& table, size_t column) {
    const int64_t stamp_ns = table.integer(column);
    is_late_ = newest_ns_ && stamp_ns < *newest_ns_;
    if (is_late_ && static_cast<uint64_t>(*newest_ns_) - static_cast<uint64_t>(stamp_ns) > kInterleavedNs)
      table.refuse("the stamp " + std::to_string(stamp_ns) +
                   " goes back by more than 1 s; was the clock set, or are these two runs?");
    if (!is_late_) newest_ns_ = stamp_ns;
    return stamp_ns;
  }
  /// A row above is newer.
  [[nodiscard]] bool late() const { return is_late_; }

 private:
  std::optional<int64_t> newest_ns_;
  bool is_late_ = false;
};

/// The way that the speeds give, trapezoids; an empty cell is a train that stands or is not known to move.
class WayBySpeed {
 public:
  double at(int64_t stamp_ns, double speed_mps) {
    const double now_mps = std::isfinite(speed_mps) ? speed_mps : 0;
    if (begun_) way_m_ += 0.5 * (now_mps + speed_mps_) * core::seconds(stamp_ns - stamp_ns_);
    begun_ = true;
    stamp_ns_ = stamp_ns;
    speed_mps_ = now_mps;
    return way_m_;
  }

 private:
  bool begun_ = false;
  int64_t stamp_ns_ = 0;
  double speed_mps_ = 0;
  double way_m_ = 0;
};

/// The place in a row, which must be one of this map, and where this map has it.
class PlaceColumns {
 public:
  explicit PlaceColumns(core::CsvTable& table)
      : edge_(table.required({"edge"})),
        offset_(table.required({"offset_m"})),
        direction_(table.required({"direction"})),
        easting_(table.optional({"easting_m"})),
        northing_(table.optional({"northing_m"})) {}

  [[nodiscard]] bool empty(const core::CsvTable& table) const { return table.text(edge_).empty(); }
  /// Nothing where the row was refused.
  [[nodiscard]] std::optional<track::EdgePosition> read(core::CsvTable& table, const track::Map& map) const {
    const int64_t edge = table.integer(edge_);
    const bool possible = edge >= 0 && edge <= std::numeric_limits<uint32_t>::max();
    const track::EdgePosition place{
        possible ? static_cast<uint32_t>(edge) : 0, table.number_or_nan(offset_, core::kFarthestM),
        table.text(direction_) == "-" ? track::Direction::reverse : track::Direction::forward};
    if (!possible || map.edge(place.edge) == nullptr) {
      table.refuse("edge " + std::to_string(edge) + " is not on the map; was the run made on it?");
    } else if (easting_ && northing_ &&
               !track::lies_there(map, place, table.number_or_nan(easting_, core::kFarthestM),
                                  table.number_or_nan(northing_, core::kFarthestM))) {
      table.refuse("this map has edge " + std::to_string(edge) +
                   " elsewhere than at the row's easting_m and northing_m; give the map that the run was made on");
    }
    return table.status().ok() ? std::optional(place) : std::nullopt;
  }

 private:
  size_t edge_, offset_, direction_;
  std::optional<size_t> easting_, northing_;
};

core::Result<std::vector<State>> read_states(const std::shared_ptr<const track::Map>& map,
                                             const std::filesystem::path& file) {
  core::CsvTable table(file);
  const size_t stamp = table.required({"stamp_ns"});
  const size_t speed = table.required({"speed_mps"});
  const size_t sigma = table.required({"sigma_m"});
  const size_t known = table.required({"track_known"});
  const PlaceColumns places(table);
  Stamps stamps;
  WayBySpeed way;
  std::vector<State> out;
  while (table.next()) {
    State state;
    state.stamp_ns = stamps.next(table, stamp);
    if (stamps.late()) continue;
    state.way_m = way.at(state.stamp_ns, table.number_or_nan(speed, core::kFastestTrainMps));
    const std::string is_known = table.text(known);
    if (places.empty(table) || is_known == "0" || is_known == "false") continue;
    const auto place = places.read(table, *map);
    state.sigma_m = table.number_or_nan(sigma, core::kWidestM);
    if (!place || !std::isfinite(place->offset_m) || !std::isfinite(state.sigma_m)) continue;
    state.place = *place;
    if (state.sigma_m < 0) table.refuse_cell(sigma, "is less than 0 m");
    if (!out.empty()) {
      const double run_m = state.way_m - out.back().way_m;
      state.place_ahead_m = out.back().place_ahead_m + way_between(map, out.back(), state).value_or(run_m) - run_m;
    }
    out.push_back(state);
  }
  if (!table.status().ok()) return table.status().error();
  return out;
}

/// The place at a time between two states, on the map along the way that the cab looks; the train may run back.
std::optional<track::EdgePosition> place_at(const std::shared_ptr<const track::Map>& map, const State& before,
                                            const State& after, int64_t stamp_ns, double ahead_m) {
  const double span = static_cast<double>(after.stamp_ns - before.stamp_ns);
  const double part = span > 0 ? static_cast<double>(stamp_ns - before.stamp_ns) / span : 0.0;
  const double ahead = part * (after.way_m - before.way_m) + ahead_m;
  track::EdgePosition from = before.place;
  from.offset_m = std::clamp(from.offset_m, 0.0, map->edge(from.edge)->alignment.length_m());
  const auto path = track::Path::follow(map, from, std::max(ahead, 0.0) + 1, std::max(-ahead, 0.0) + 1);
  if (!path.ok() || ahead > path.value().end_m() || ahead < path.value().begin_m()) return std::nullopt;
  return path.value().position_at(ahead);
}

core::Error same_run(const std::filesystem::path& run, const std::filesystem::path& as) {
  return {run.string() + " is the same run as " + as.string() + "; give every run once"};
}

/// The same for a copy, also one that was saved with other line ends; another for every other ride.
core::Result<std::string> content_of(const std::filesystem::path& file) {
  constexpr std::string_view kByteOrderMark = "\xEF\xBB\xBF";
  auto read = core::read_whole(file);
  if (!read.ok()) return read.error();
  std::string text = std::move(read).value();
  if (text.starts_with(kByteOrderMark)) text.erase(0, kByteOrderMark.size());
  std::erase(text, '\r');
  core::Fnv fnv;
  fnv.add(text);
  return fnv.hex();
}

}  // namespace

core::Result<ReadSightings> read_sightings(const std::shared_ptr<const track::Map>& map,
                                           const std::filesystem::path& run_folder, size_t run) {
  const auto read = read_states(map, run_folder / "train_state.csv");
  if (!read.ok()) return read.error();
  const std::vector<State>& states = read.value();
  core::CsvTable table(run_folder / "sightings.csv");
  const size_t stamp = table.required({"stamp_ns"});
  const size_t kind = table.required({"kind"});
  const size_t ahead = table.required({"distance_ahead_m"});
  const size_t lateral = table.required({"lateral_m"});
  const size_t sigma = table.required({"sigma_m"});
  const std::optional<size_t> confidence = table.optional({"confidence"});
  ReadSightings out;
  Stamps stamps;
  while (table.next()) {
    const int64_t when = stamps.next(table, stamp);
    const auto what = track::landmark_kind_from(table.text(kind));
    if (!what) table.refuse("\"" + table.text(kind) + "\" is no kind of landmark");
    const double ahead_m = table.finite(ahead, core::kFarthestSeenM);
    const double sigma_m = sigma_in(table, sigma);
    const double side = table.number_or_nan(lateral, core::kFarthestSeenM);
    check_confidence(table, confidence);
    if (!table.status().ok()) break;
    const auto after = std::lower_bound(states.begin(), states.end(), when,
                                        [](const State& state, int64_t ns) { return state.stamp_ns < ns; });
    const bool between_states = after != states.begin() && after != states.end();
    const auto place = between_states ? place_at(map, *(after - 1), *after, when, ahead_m) : std::nullopt;
    if (!place) {
      ++out.placeless;
      continue;
    }
    const State& before = *(after - 1);
    const bool is_reverse = place->direction == track::Direction::reverse;
    out.placed.push_back({run, before.way_m, track::seen_along(*what, !is_reverse), place->edge, place->offset_m,
                          std::isfinite(side) ? (is_reverse ? -side : side) : 0.0, sigma_m, before.sigma_m,
                          before.place_ahead_m, is_reverse});
  }
  if (!table.status().ok()) return table.status().error();
  if (!out.placed.empty()) {
    const auto content = content_of(run_folder / "sightings.csv");
    if (!content.ok()) return content.error();
    out.runs.push_back(content.value());
  }
  return out;
}

core::Result<ReadSightings> read_runs(const std::shared_ptr<const track::Map>& map,
                                      const std::vector<std::filesystem::path>& run_folders) {
  ReadSightings out;
  std::map<std::string, std::filesystem::path> folder_of;
  for (size_t i = 0; i < run_folders.size(); ++i) {
    for (size_t before = 0; before < i; ++before) {
      std::error_code unreadable;  // told below
      if (std::filesystem::equivalent(run_folders[i], run_folders[before], unreadable))
        return same_run(run_folders[i], run_folders[before]);
    }
    const auto read = read_sightings(map, run_folders[i], i);
    if (!read.ok()) return read.error();
    const auto& [placed, placeless, runs] = read.value();
    for (const std::string& run : runs) {
      const auto [first, is_new] = folder_of.emplace(run, run_folders[i]);
      if (!is_new) return same_run(run_folders[i], first->second);
      if (std::ranges::count(map->learnt_runs, run) > 0)
        return core::Error{"the map has learnt from " + run_folders[i].string() +
                           " before, and its sightings would count twice; leave it out, or learn from all runs at once "
                           "on the map of before"};
      out.runs.push_back(run);
    }
    out.placed.insert(out.placed.end(), placed.begin(), placed.end());
    out.placeless += placeless;
  }
  return out;
}

}  // namespace railfix::tool
