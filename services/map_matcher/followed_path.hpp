// The way of the train, kept some way ahead of and behind it while its states come in: what the matchers search on, and
// where on it.
#pragma once

#include <memory>
#include <optional>
#include <utility>

#include "core/result.hpp"
#include "map_matcher/match_types.hpp"
#include "track/path.hpp"

namespace railfix::map_matcher {

/// What train_state says of a train whose place is known.
struct PlacedTrain {
  int64_t stamp_ns = 0;
  track::EdgePosition place;
  double speed_mps = 0;   // NaN = not known
  double distance_m = 0;  // travelled
  double over_m = 0;
  double under_m = 0;
};

class FollowedPath {
 public:
  /// A state says nothing of the train longer than that before or after its stamp.
  static constexpr double kOldStateS = 2.0;

  FollowedPath(std::shared_ptr<const track::Map> map, std::shared_ptr<const track::Ways> ways)
      : map_(std::move(map)), ways_(std::move(ways)) {}

  enum class Way : uint8_t {
    same,        // as before
    other_path,  // a longer one or one over another track, whose distances go on from the old one's
    anew         // another path with distances of its own: nothing measured so far belongs to it
  };
  /// The train's next state. An error when it is nowhere on the map.
  core::Result<Way> follow(const PlacedTrain& train);

  /// The place is not known any more.
  void forget() { path_.reset(); }
  /// Nullptr while the place is not known.
  [[nodiscard]] const std::shared_ptr<const track::Path>& path() const { return path_; }
  /// The window at a stamp, extrapolated from a state; nothing when that is too old, not on the path or too vague to be
  /// searched.
  [[nodiscard]] std::optional<Prior> prior_at(int64_t stamp_ns, const PlacedTrain& train) const;

 private:
  /// Whether the path is a longer one now.
  bool follow_on();
  std::shared_ptr<const track::Map> map_;
  std::shared_ptr<const track::Ways> ways_;
  std::shared_ptr<const track::Path> path_;
  double place_m_ = 0;                      // on the path, of the last state
  std::optional<double> followed_on_at_m_;  // where the path was followed on last, or could not be
};

}  // namespace railfix::map_matcher
