#include "map/survey.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <map>
#include <set>

#include "core/csv.hpp"
#include "track/path.hpp"

namespace railfix::tool {
namespace {

constexpr double kHuber = 2.0;  // sigmas beyond which a sighting loses weight
constexpr int kRounds = 15;
constexpr double kLeastSigmaM = 0.01;

/// Sightings that are of one thing.
struct Thing {
  const track::Landmark* known = nullptr;
  std::vector<size_t> sightings;
};

/// Same kind, same track, same side.
bool alike(const SurveySighting& a, track::LandmarkKind kind, uint32_t edge, double lateral_m) {
  const bool has_side = kind == track::LandmarkKind::mast || kind == track::LandmarkKind::platform;
  return a.kind == kind && a.edge == edge && (!has_side || a.lateral_m * lateral_m >= 0);
}

std::vector<Thing> things_of(const track::Map& map, const std::vector<SurveySighting>& all,
                             const SurveyOptions& options) {
  std::map<const track::Landmark*, Thing> known;
  std::vector<size_t> rest;
  for (size_t i = 0; i < all.size(); ++i) {
    const track::Landmark* nearest = nullptr;
    for (const track::Landmark& mark : map.landmarks) {
      if (!alike(all[i], mark.kind, mark.edge, mark.lateral_m)) continue;
      const double off = std::abs(mark.offset_m - all[i].offset_m);
      const double gate = options.gate_m + 3.0 * std::hypot(mark.sigma_m, all[i].run_sigma_m);
      if (off < gate && (nearest == nullptr || off < std::abs(nearest->offset_m - all[i].offset_m))) nearest = &mark;
    }
    if (nearest == nullptr) {
      rest.push_back(i);
    } else {
      known[nearest].known = nearest;
      known[nearest].sightings.push_back(i);
    }
  }
  std::vector<Thing> out;
  for (auto& [mark, thing] : known) out.push_back(std::move(thing));
  std::sort(rest.begin(), rest.end(), [&](size_t a, size_t b) {
    const auto key = [&](size_t i) {
      return std::tuple(all[i].edge, all[i].kind, all[i].lateral_m >= 0, all[i].offset_m);
    };
    return key(a) < key(b);
  });
  for (const size_t i : rest) {
    const bool joins = !out.empty() && out.back().known == nullptr &&
                       alike(all[i], all[out.back().sightings.back()].kind, all[out.back().sightings.back()].edge,
                             all[out.back().sightings.back()].lateral_m) &&
                       all[i].offset_m - all[out.back().sightings.back()].offset_m < options.gate_m;
    if (!joins) out.push_back({});
    out.back().sightings.push_back(i);
  }
  return out;
}

size_t runs_of(const Thing& thing, const std::vector<SurveySighting>& all) {
  std::set<size_t> runs;
  for (const size_t i : thing.sightings) runs.insert(all[i].run);
  return runs.size();
}

class Solver {
 public:
  Solver(const std::vector<SurveySighting>& all, const std::vector<Thing>& things, const SurveyOptions& options)
      : all_(all), things_(things) {
    for (const Thing& thing : things) {
      for (const size_t i : thing.sightings) {
        const auto key = std::pair(all[i].run, static_cast<int64_t>(std::floor(all[i].way_m / options.stretch_m)));
        const auto [entry, is_new] = stretch_.try_emplace(key, stretch_.size());
        stretch_of_[i] = entry->second;
        double& sigma = stretch_sigma_[entry->second];
        sigma = std::max({sigma, all[i].run_sigma_m, kLeastSigmaM});
      }
    }
    size_ = static_cast<Eigen::Index>(things.size() + stretch_.size());
    state_ = Eigen::VectorXd::Zero(size_);
    for (size_t t = 0; t < things.size(); ++t) state_[index(t)] = start_of(things[t]);
  }

  void run() {
    for (int round = 0; round < kRounds; ++round) {
      Eigen::MatrixXd normal = Eigen::MatrixXd::Zero(size_, size_);
      Eigen::VectorXd right = Eigen::VectorXd::Zero(size_);
      fill(normal, right);
      const Eigen::LDLT<Eigen::MatrixXd> solver(normal);
      state_ = solver.solve(right);
      covariance_ = solver.solve(Eigen::MatrixXd::Identity(size_, size_));
    }
  }

  [[nodiscard]] double place(size_t thing) const { return state_[index(thing)]; }
  [[nodiscard]] double sigma(size_t thing) const { return std::sqrt(covariance_(index(thing), index(thing))); }
  /// Error of a sighting over its sigma.
  [[nodiscard]] double error(size_t thing, size_t sighting) const {
    const double expected = state_[index(thing)] + state_[stretch_index(sighting)];
    return (all_[sighting].offset_m - expected) / std::max(all_[sighting].sigma_m, kLeastSigmaM);
  }

 private:
  [[nodiscard]] static Eigen::Index index(size_t thing) { return static_cast<Eigen::Index>(thing); }
  [[nodiscard]] Eigen::Index stretch_index(size_t sighting) const {
    return static_cast<Eigen::Index>(things_.size() + stretch_of_.at(sighting));
  }
  [[nodiscard]] double start_of(const Thing& thing) const {
    if (thing.known != nullptr) return thing.known->offset_m;
    std::vector<double> offsets;
    for (const size_t i : thing.sightings) offsets.push_back(all_[i].offset_m);
    std::nth_element(offsets.begin(), offsets.begin() + static_cast<ptrdiff_t>(offsets.size() / 2), offsets.end());
    return offsets[offsets.size() / 2];
  }

  void fill(Eigen::MatrixXd& normal, Eigen::VectorXd& right) const {
    for (size_t t = 0; t < things_.size(); ++t) {
      if (const track::Landmark* known = things_[t].known) {
        const double weight = 1.0 / std::pow(std::max(known->sigma_m, kLeastSigmaM), 2);
        normal(index(t), index(t)) += weight;
        right[index(t)] += weight * known->offset_m;
      }
      for (const size_t i : things_[t].sightings) {
        const double off = std::abs(error(t, i));
        const double weight =
            (off > kHuber ? kHuber / off : 1.0) / std::pow(std::max(all_[i].sigma_m, kLeastSigmaM), 2);
        const Eigen::Index s = stretch_index(i);
        normal(index(t), index(t)) += weight;
        normal(s, s) += weight;
        normal(index(t), s) += weight;
        normal(s, index(t)) += weight;
        right[index(t)] += weight * all_[i].offset_m;
        right[s] += weight * all_[i].offset_m;
      }
    }
    for (const auto& [stretch, sigma] : stretch_sigma_) {
      const auto at = static_cast<Eigen::Index>(things_.size() + stretch);
      normal(at, at) += 1.0 / (sigma * sigma);
    }
  }

  const std::vector<SurveySighting>& all_;
  const std::vector<Thing>& things_;
  std::map<std::pair<size_t, int64_t>, size_t> stretch_;
  std::map<size_t, size_t> stretch_of_;
  std::map<size_t, double> stretch_sigma_;
  Eigen::Index size_ = 0;
  Eigen::VectorXd state_;
  Eigen::MatrixXd covariance_;
};

}  // namespace

Survey survey_landmarks(const track::Map& map, const std::vector<SurveySighting>& sightings,
                        const SurveyOptions& options) {
  Survey out;
  std::vector<Thing> things = things_of(map, sightings, options);
  std::erase_if(things, [&](const Thing& thing) {
    const bool too_few = thing.known == nullptr && runs_of(thing, sightings) < options.least_runs;
    if (too_few) out.left_alone += thing.sightings.size();
    return too_few;
  });
  if (things.empty()) return out;
  Solver solver(sightings, things, options);
  solver.run();
  double squares = 0;
  for (size_t t = 0; t < things.size(); ++t) {
    for (const size_t i : things[t].sightings) {
      const double error = solver.error(t, i);
      ++out.sightings;
      if (std::abs(error) > 2.0 * kHuber) ++out.outliers;
      squares += std::min(error * error, 4.0 * kHuber * kHuber);
    }
  }
  out.spread = std::sqrt(squares / static_cast<double>(out.sightings));
  for (size_t t = 0; t < things.size(); ++t) {
    SurveyedLandmark found;
    double lateral = 0;
    for (const size_t i : things[t].sightings) lateral += sightings[i].lateral_m;
    const SurveySighting& first = sightings[things[t].sightings.front()];
    if (things[t].known != nullptr) {
      found.known_id = things[t].known->id;
      found.landmark = *things[t].known;
    } else {
      found.landmark = {0, first.kind, first.edge, 0, lateral / static_cast<double>(things[t].sightings.size()), 0, ""};
    }
    const double length = map.edge(first.edge)->alignment.length_m();
    found.landmark.offset_m = std::clamp(solver.place(t), 0.0, length);
    found.landmark.sigma_m = solver.sigma(t) * std::max(1.0, out.spread);
    found.moved_m = found.known_id != 0 ? found.landmark.offset_m - things[t].known->offset_m : 0.0;
    found.sightings = things[t].sightings.size();
    found.runs = runs_of(things[t], sightings);
    out.landmarks.push_back(found);
  }
  return out;
}

void apply_survey(const Survey& survey, track::Map& map) {
  for (const SurveyedLandmark& found : survey.landmarks) {
    if (found.known_id != 0) {
      map.landmarks[found.known_id - 1] = found.landmark;
      continue;
    }
    track::Landmark added = found.landmark;
    added.id = static_cast<uint32_t>(map.landmarks.size() + 1);
    added.name = "surveyed " + track::to_string(added.kind) + " " + std::to_string(added.id);
    map.landmarks.push_back(added);
  }
}

namespace {

struct State {
  int64_t stamp_ns = 0;
  track::EdgePosition place;
  double way_m = 0;
  double sigma_m = 0;
};

template <class T>
T read_or_throw(core::Result<T> cell) {
  return core::value_or_throw(std::move(cell));
}

size_t column_of(const core::CsvReader& table, const std::filesystem::path& file, std::string_view name) {
  const auto column = table.column({name});
  if (!column) throw core::BadInput(file.string() + " has no column " + std::string(name));
  return *column;
}

std::vector<State> read_states(const track::Map& map, const std::filesystem::path& file) {
  core::CsvReader table = core::value_or_throw(core::CsvReader::open(file));
  const auto at = [&](std::string_view name) { return column_of(table, file, name); };
  const size_t stamp = at("stamp_ns"), edge = at("edge"), offset = at("offset_m"), direction = at("direction");
  const size_t way = at("distance_m"), sigma = at("sigma_m"), known = at("track_known");
  std::vector<State> out;
  while (table.next()) {
    const std::string_view is_known = table.text(known);
    if (table.text(edge).empty() || is_known == "0" || is_known == "false") continue;
    State state;
    state.stamp_ns = read_or_throw(table.integer(stamp));
    state.place.edge = static_cast<uint32_t>(read_or_throw(table.integer(edge)));
    state.place.offset_m = read_or_throw(table.number(offset));
    const std::string_view facing = table.text(direction);
    const bool is_reverse = facing == "-";
    state.place.direction = is_reverse ? track::Direction::reverse : track::Direction::forward;
    state.way_m = read_or_throw(table.number(way));
    state.sigma_m = read_or_throw(table.number(sigma));
    if (map.edge(state.place.edge) == nullptr) {
      throw core::BadInput(
          table.error("edge " + std::to_string(state.place.edge) + " is not on the map; was the run made on it?"));
    }
    if (std::isfinite(state.place.offset_m) && std::isfinite(state.way_m) && std::isfinite(state.sigma_m))
      out.push_back(state);
  }
  core::ok_or_throw(table.status());
  return out;
}

/// The place at a time between two states, on the map along the way that the train takes.
std::optional<track::EdgePosition> place_at(const std::shared_ptr<const track::Map>& map, const State& before,
                                            const State& after, int64_t stamp_ns, double ahead_m) {
  const double span = static_cast<double>(after.stamp_ns - before.stamp_ns);
  const double part = span > 0 ? static_cast<double>(stamp_ns - before.stamp_ns) / span : 0.0;
  const double ahead = part * std::abs(after.way_m - before.way_m) + ahead_m;
  track::EdgePosition from = before.place;
  from.offset_m = std::clamp(from.offset_m, 0.0, map->edge(from.edge)->alignment.length_m());
  const auto path = track::Path::follow(map, from, std::max(ahead, 0.0) + 1, std::max(-ahead, 0.0) + 1);
  if (!path.ok() || ahead > path.value().end_m() || ahead < path.value().begin_m()) return std::nullopt;
  return path.value().position_at(ahead);
}

track::LandmarkKind as_on_map(track::LandmarkKind kind, track::Direction direction) {
  if (direction != track::Direction::reverse) return kind;
  if (kind == track::LandmarkKind::portal_in) return track::LandmarkKind::portal_out;
  return kind == track::LandmarkKind::portal_out ? track::LandmarkKind::portal_in : kind;
}

}  // namespace

core::Result<std::vector<SurveySighting>> read_sightings(const std::shared_ptr<const track::Map>& map,
                                                         const std::filesystem::path& run_folder, size_t run) {
  try {
    const std::vector<State> states = read_states(*map, run_folder / "train_state.csv");
    const std::filesystem::path file = run_folder / "sightings.csv";
    core::CsvReader table = core::value_or_throw(core::CsvReader::open(file));
    const auto at = [&](std::string_view name) { return column_of(table, file, name); };
    const size_t stamp = at("stamp_ns"), kind = at("kind"), ahead = at("distance_ahead_m"), lateral = at("lateral_m");
    const size_t sigma = at("sigma_m");
    std::vector<SurveySighting> out;
    while (table.next()) {
      const int64_t when = read_or_throw(table.integer(stamp));
      const auto what = track::landmark_kind_from(std::string(table.text(kind)));
      if (!what) return table.error("\"" + std::string(table.text(kind)) + "\" is no kind of landmark");
      const auto after = std::lower_bound(states.begin(), states.end(), when,
                                          [](const State& state, int64_t ns) { return state.stamp_ns < ns; });
      if (after == states.begin() || after == states.end()) continue;
      const State& before = *(after - 1);
      const auto place = place_at(map, before, *after, when, read_or_throw(table.number(ahead)));
      if (!place) continue;
      const bool is_reverse = place->direction == track::Direction::reverse;
      const double side = read_or_throw(table.number(lateral));
      out.push_back({run, before.way_m, as_on_map(*what, place->direction), place->edge, place->offset_m,
                     std::isfinite(side) ? (is_reverse ? -side : side) : 0.0, read_or_throw(table.number(sigma)),
                     before.sigma_m});
    }
    core::ok_or_throw(table.status());
    return out;
  } catch (const core::BadInput& bad) {
    return core::Error{bad.what()};
  }
}

}  // namespace railfix::tool
