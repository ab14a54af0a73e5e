// Is the train on the track that is followed? Certain where it starts, until it turns otherwise; behind every switch
// that could have led it elsewhere only as probable as somebody says who looked (map_matcher), else as one of the ways.
// He may be wrong: a place that was seen on another track, or a train that turns otherwise, speaks against him however
// often he repeats himself.
#pragma once

#include <optional>
#include <vector>

#include "track/path.hpp"

namespace railfix::fusion {

class TrackDoubt {
 public:
  /// Somebody says that the track is right with this probability, for a train at `of_m` (nothing: not on this path)
  /// while it is at `place_m`. Switches between the two stay open.
  void said(double probability, std::optional<double> of_m, double place_m);
  /// It begins there, without a word of how it came.
  void begin_at(double place_m) { place_m_ = place_m; }
  /// Another track is followed from now on.
  void changed();
  /// A place on another track was seen with this probability; a place on this one.
  void seen_elsewhere(double probability);
  void seen_here();
  /// The same, where it may be chance: the turns go on being asked.
  void may_be_here() { here_at_most_ = 1; }
  /// It was searched for, and this is where it fits best: the turns may show that it is elsewhere, switch or no switch.
  void found_here();
  /// The train turned as this track does, or not; bends: where that says something.
  void turned(bool fits, bool bends);
  /// A switch was run over since anything on this track was seen, or nothing was: only then another one is possible.
  [[nodiscard]] bool divided() const { return divided_; }
  /// Where on the path the last such switch was run over, ever; nothing: none was.
  [[nodiscard]] std::optional<double> divided_at_m() const { return divided_at_m_; }
  /// There all its turns together are none of this track's.
  void turned_elsewhere() { turns_otherwise_ = true; }
  [[nodiscard]] bool turns_otherwise() const { return turns_otherwise_; }
  /// ... and did so when it was looked at last.
  [[nodiscard]] bool turns_otherwise_now() const { return turns_otherwise_ && turned_otherwise_ > 0; }
  /// Who looked holds some other place to be far more probable.
  [[nodiscard]] bool disbelieved() const;
  /// The train is at `place_m` of its path now.
  void move(const track::Path& path, double place_m);
  [[nodiscard]] double probability() const;
  /// The same for a train that has gone on to `place_m`.
  [[nodiscard]] double probability_at(const track::Path& path, double place_m) const;

 private:
  double said_ = 1;
  std::optional<double> place_m_;
  std::vector<track::PathSwitch> open_;  // run over since somebody looked
  std::optional<double> divided_at_m_;
  bool divided_ = true;       // a switch was run over since a place on this track was seen, or none was
  double here_at_most_ = 1;   // by what was seen elsewhere
  int turned_otherwise_ = 0;  // in a row
  int turned_alike_ = 0;      // in bends, in a row
  bool turns_otherwise_ = false;
};

}  // namespace railfix::fusion
