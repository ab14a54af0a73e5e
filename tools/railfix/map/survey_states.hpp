// Where a run was while it looked: the places of its train_state.csv that a survey may build on.
#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <vector>

#include "core/result.hpp"
#include "map/survey.hpp"
#include "track/map.hpp"

namespace railfix::tool {

/// A row. Without a place where the run did not know its track or its speed, was unusable, or was only told its place
/// and nothing bore that out.
struct RunState {
  int64_t stamp_ns = 0;
  std::optional<double> speed_mps;
  std::optional<track::EdgePosition> place;
  double way_m = 0;            // by the speed alone: fixes do not move it
  double place_ahead_m = 0;    // the place along the track minus way_m; changes where a fix moved the place
  double sigma_m = 0;          // no less than the promised interval says
  double promise_m = 0;        // the longer side of that
  size_t stretch = 0;          // the way of the run is known within it, and not from one to the next
  bool is_confirmed = true;    // integrity ok
  bool is_undeclared = false;  // it is not yet known which way the run took at a switch
  bool is_lost = false;        // no track, or unusable: what is known afterwards is known anew
};

/// A time of a run, from the last state before it that has a place.
struct RunMoment {
  const RunState* from = nullptr;
  double run_m = 0;         // since then
  bool undeclared = false;  // which way it took since then, only later states tell
};

class RunStates {
 public:
  static core::Result<RunStates> read(const std::shared_ptr<const track::Map>& map, const std::filesystem::path& file);

  /// Nothing where the place was not known, and between rows that lie too far apart.
  [[nodiscard]] std::optional<RunMoment> at(int64_t stamp_ns) const;
  /// The place so far ahead of the train (behind it, negative) along the way that it took. Nothing beyond a switch over
  /// which it never said which way that was.
  [[nodiscard]] std::optional<track::EdgePosition> place_ahead(const RunMoment& moment, double ahead_m) const;
  /// What the camera had before it and passed.
  [[nodiscard]] std::vector<PassedTrack> passed(size_t run) const;
  /// There were places, and none was ever confirmed.
  [[nodiscard]] bool never_confirmed() const { return never_confirmed_; }

 private:
  explicit RunStates(std::shared_ptr<const track::Map> map) : map_(std::move(map)) {}

  void find_ways();
  void find_stretches();
  void drop_what_was_only_told();
  [[nodiscard]] std::optional<double> way_between(const RunState& a, const RunState& b) const;
  /// The states with a place from `from` to the first one that is so far ahead of it.
  [[nodiscard]] std::vector<const RunState*> states_ahead(const RunState& from, double ahead_m) const;

  std::shared_ptr<const track::Map> map_;
  std::vector<RunState> states_;
  int64_t longest_step_ns_ = 0;
  bool never_confirmed_ = false;
};

}  // namespace railfix::tool
