#include "map/survey_states.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/csv_table.hpp"
#include "core/time.hpp"
#include "core/train_limits.hpp"
#include "evaluation/time_gaps.hpp"
#include "fusion/fusion_parameters.hpp"
#include "map/survey_stamps.hpp"
#include "track/declared.hpp"
#include "track/path.hpp"
#include "track/same_map.hpp"

namespace railfix::tool {
namespace {

constexpr double kNearM = 50;  // a state's place lies so near to where the speed would have brought the train
constexpr double kLeadM = 30;  // the camera has seen what lies so far behind the first place

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
    } else if (easting_ && northing_ && !track::lies_there(map, place, pose(table))) {
      table.refuse("this map has edge " + std::to_string(edge) +
                   " elsewhere than at the row's easting_m and northing_m; give the map that the run was made on");
    }
    return table.status().ok() ? std::optional(place) : std::nullopt;
  }

 private:
  [[nodiscard]] track::PlanPose pose(core::CsvTable& table) const {
    return {table.number_or_nan(easting_, core::kFarthestM), table.number_or_nan(northing_, core::kFarthestM),
            std::numeric_limits<double>::quiet_NaN()};
  }

  size_t edge_, offset_, direction_;
  std::optional<size_t> easting_, northing_;
};

/// What a row says of its place besides where it is.
class TrustColumns {
 public:
  explicit TrustColumns(core::CsvTable& table)
      : known_(table.required({"track_known"})),
        sigma_(table.required({"sigma_m"})),
        probability_(table.optional({"track_probability"})),
        integrity_(table.optional({"integrity"})),
        over_(table.optional({"over_m"})),
        under_(table.optional({"under_m"})) {}

  void read(core::CsvTable& table, RunState& state) const {
    const std::string known = table.text(known_);
    const std::string integrity = integrity_ ? table.text(*integrity_) : "ok";
    state.is_confirmed = integrity == "ok";
    state.is_lost = known == "0" || known == "false" || integrity == "unusable";
    state.is_undeclared = !state.is_lost && table.number_or_nan(probability_) < track::kDeclaredProbability;
    state.sigma_m = table.number_or_nan(sigma_, core::kWidestM);
    if (state.sigma_m < 0) table.refuse_cell(sigma_, "is less than 0 m");
    constexpr double kFactor = fusion::FusionParameters{}.interval_factor;
    const double over_m = table.number_or_nan(over_, core::kWidestM);
    const double under_m = table.number_or_nan(under_, core::kWidestM);
    const bool has_interval = !std::isnan(over_m) && !std::isnan(under_m);
    state.promise_m = has_interval ? std::max(over_m, under_m) : kFactor * state.sigma_m;
    state.sigma_m = std::max(state.sigma_m, state.promise_m / kFactor);
  }

 private:
  size_t known_, sigma_;
  std::optional<size_t> probability_, integrity_, over_, under_;
};

}  // namespace

core::Result<RunStates> RunStates::read(const std::shared_ptr<const track::Map>& map,
                                        const std::filesystem::path& file) {
  core::CsvTable table(file);
  const size_t stamp = table.required({"stamp_ns"});
  const size_t speed = table.required({"speed_mps"});
  const TrustColumns trust(table);
  const PlaceColumns places(table);
  Stamps stamps;
  RunStates run(map);
  while (table.next()) {
    RunState state;
    state.stamp_ns = stamps.next(table, stamp);
    if (stamps.late()) continue;
    const double speed_mps = table.number_or_nan(speed, core::kFastestTrainMps);
    if (std::isfinite(speed_mps)) state.speed_mps = speed_mps;
    trust.read(table, state);
    state.is_lost = state.is_lost || places.empty(table);
    const auto place = state.is_lost ? std::nullopt : places.read(table, *map);
    const bool is_known = place && state.speed_mps && std::isfinite(place->offset_m) && std::isfinite(state.sigma_m);
    if (is_known && !state.is_undeclared) state.place = place;
    run.states_.push_back(state);
  }
  if (!table.status().ok()) return table.status().error();
  run.find_ways();
  run.find_stretches();
  run.drop_what_was_only_told();
  return run;
}

/// The ways that the speeds give, trapezoids. Over rows without a speed, or far apart, nobody knows it.
void RunStates::find_ways() {
  longest_step_ns_ = evaluation::longest_step_ns(evaluation::stamps_of(states_));
  const RunState* last = nullptr;  // with a speed
  for (RunState& state : states_) {
    if (last != nullptr) {
      state.way_m = last->way_m;
      state.stretch = last->stretch;
    }
    if (!state.speed_mps) continue;
    if (last != nullptr) {
      const int64_t step_ns = state.stamp_ns - last->stamp_ns;
      state.way_m += 0.5 * (*state.speed_mps + *last->speed_mps) * core::seconds(step_ns);
      if (step_ns > longest_step_ns_) ++state.stretch;
    }
    last = &state;
  }
}

/// Where a place has run on by far more than the way, or no way leads to it, that is no fix: the run is placed anew.
void RunStates::find_stretches() {
  const RunState* last = nullptr;  // with a place
  size_t more = 0;
  for (RunState& state : states_) {
    state.stretch += more;
    if (!state.place) continue;
    if (last != nullptr && last->stretch == state.stretch) {
      const double run_m = state.way_m - last->way_m;
      const auto way_m = way_between(*last, state);
      if (way_m && std::abs(*way_m - run_m) < kNearM) {
        state.place_ahead_m = last->place_ahead_m + *way_m - run_m;
      } else {
        ++more;
        ++state.stretch;
      }
    }
    last = &state;
  }
}

/// A place that was told, and not yet confirmed, counts where the first confirmed one bears it out: that one lies no
/// farther from it, along the way, than its interval promised.
void RunStates::drop_what_was_only_told() {
  std::vector<const RunState*> confirmed_next(states_.size(), nullptr);
  const RunState* next = nullptr;
  bool had_place = false;
  for (size_t i = states_.size(); i-- > 0;) {
    const RunState& state = states_[i];
    had_place = had_place || state.place;
    if (next != nullptr && next->stretch != state.stretch) next = nullptr;
    if (state.place && state.is_confirmed) next = &state;
    confirmed_next[i] = next;
  }
  bool ever = false;
  bool confirmed = false;
  for (size_t i = 0; i < states_.size(); ++i) {
    RunState& state = states_[i];
    if (state.is_lost || (i > 0 && state.stretch != states_[i - 1].stretch)) confirmed = false;
    if (!state.place) continue;
    confirmed = confirmed || state.is_confirmed;
    ever = ever || confirmed;
    if (confirmed) continue;
    const RunState* by = confirmed_next[i];
    if (by == nullptr || std::abs(by->place_ahead_m - state.place_ahead_m) > state.promise_m) state.place.reset();
  }
  never_confirmed_ = had_place && !ever;
}

/// Along the train; nothing where no short way leads from one to the other.
std::optional<double> RunStates::way_between(const RunState& a, const RunState& b) const {
  if (a.place->edge == b.place->edge) {
    const double grown_m = b.place->offset_m - a.place->offset_m;
    return a.place->direction == track::Direction::reverse ? -grown_m : grown_m;
  }
  const double reach_m = std::abs(b.way_m - a.way_m) + kNearM;
  const auto path = track::Path::follow(map_, *a.place, reach_m, reach_m, {b.place->edge});
  return path.ok() ? path.value().distance_of(b.place->edge, b.place->offset_m) : std::nullopt;
}

std::optional<RunMoment> RunStates::at(int64_t stamp_ns) const {
  const auto after = std::ranges::lower_bound(states_, stamp_ns, {}, &RunState::stamp_ns);
  if (after == states_.begin() || after == states_.end()) return std::nullopt;
  const auto before = after - 1;
  if (before->stretch != after->stretch || after->is_lost) return std::nullopt;
  if (after->stamp_ns - before->stamp_ns > longest_step_ns_ || !before->speed_mps || !after->speed_mps)
    return std::nullopt;
  auto from = before;
  while (from->is_undeclared && from != states_.begin() && std::abs(before->way_m - from->way_m) < kNearM) --from;
  if (!from->place || from->stretch != before->stretch) return std::nullopt;
  const double step_s = core::seconds(after->stamp_ns - before->stamp_ns);
  const double into_s = core::seconds(stamp_ns - before->stamp_ns);
  const double mean_mps = *before->speed_mps + 0.5 * (*after->speed_mps - *before->speed_mps) * into_s / step_s;
  return RunMoment{&*from, before->way_m - from->way_m + mean_mps * into_s, from != before};
}

std::vector<const RunState*> RunStates::states_ahead(const RunState& from, double ahead_m) const {
  const auto begin = &from - states_.data();
  const auto end = static_cast<ptrdiff_t>(states_.size());
  std::vector<const RunState*> best;
  for (const ptrdiff_t step : {1, -1}) {  // what lies ahead of a train that runs back it has passed before
    std::vector<const RunState*> passed;
    for (auto i = begin + step; i >= 0 && i < end; i += step) {
      const RunState& state = states_[static_cast<size_t>(i)];
      if (state.stretch != from.stretch || state.way_m < from.way_m - kNearM) break;
      if (state.place) passed.push_back(&state);
      if (state.place && state.way_m >= from.way_m + ahead_m) return passed;
    }
    if (step == 1) best = std::move(passed);
  }
  return best;
}

std::optional<track::EdgePosition> RunStates::place_ahead(const RunMoment& moment, double ahead_m) const {
  const double ahead = moment.run_m + ahead_m;
  const RunState& from = *moment.from;
  const auto later = states_ahead(from, std::max(ahead, moment.run_m));
  std::vector<uint32_t> via;
  double reach_m = std::max(ahead, 0.0) + 1;
  for (const RunState* state : later) {
    if (via.empty() || via.back() != state->place->edge) via.push_back(state->place->edge);
    reach_m = std::max(reach_m, state->way_m - from.way_m + kNearM);
  }
  track::EdgePosition start = *from.place;
  start.offset_m = std::clamp(start.offset_m, 0.0, map_->edge(start.edge)->alignment.length_m());
  const auto path = track::Path::follow(map_, start, reach_m, std::max(-ahead, 0.0) + 1, via);
  if (!path.ok() || ahead > path.value().end_m() || ahead < path.value().begin_m()) return std::nullopt;
  double known_to_m = -HUGE_VAL;
  for (const RunState* state : later) {
    if (const auto at_m = path.value().distance_of(*state->place, state->way_m - from.way_m))
      known_to_m = std::max(known_to_m, *at_m);
  }
  const bool declared_later =
      !later.empty() && path.value().distance_of(*later.front()->place, later.front()->way_m - from.way_m);
  if (moment.undeclared && !declared_later) return std::nullopt;
  for (const track::PathSwitch& division : path.value().switches()) {
    const double at_m = division.distance_m;
    const bool open = division.ahead ? at_m >= 0 && at_m < ahead && known_to_m <= at_m : at_m <= 0 && at_m > ahead;
    if (open) return std::nullopt;
  }
  return path.value().position_at(ahead);
}

std::vector<PassedTrack> RunStates::passed(size_t run) const {
  std::vector<PassedTrack> out;
  const RunState* first = nullptr;  // of the places that follow each other
  const RunState* last = nullptr;
  bool extends = false;
  for (const RunState& state : states_) {
    if (!state.place) continue;
    const bool goes_on = last != nullptr && last->stretch == state.stretch && state.way_m >= last->way_m &&
                         state.way_m - last->way_m < kNearM;
    if (!goes_on) first = &state;
    const bool saw = goes_on && last->place->edge == state.place->edge && last->way_m - first->way_m > kLeadM;
    if (saw) {
      const auto [from_m, to_m] = std::minmax(last->place->offset_m, state.place->offset_m);
      if (!extends) out.push_back({run, state.place->edge, from_m, to_m});
      out.back().from_m = std::min(out.back().from_m, from_m);
      out.back().to_m = std::max(out.back().to_m, to_m);
    }
    extends = saw;
    last = &state;
  }
  return out;
}

}  // namespace railfix::tool
