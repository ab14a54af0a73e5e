// How the train turned over the last seconds, by its gyro, to be held against a track: the one that is followed, or one
// that is declared only now, behind the switch where it parted from another. A turnout is run over in two or three
// seconds, and what it turns adds up: that says more than each second does alone.
#pragma once

#include <cstddef>
#include <vector>

#include "track/path.hpp"

namespace railfix::fusion {

/// A plain value.
class TurnedWay {
 public:
  struct Piece {
    double from_m = 0;  // place on the path
    double to_m = 0;
    double turn_rad = 0;  // left positive, without the gyro's bias
    double sigma_rad = 0;
    double time_s = 0;
  };
  /// One standard deviation of what is the same for all pieces.
  struct Errors {
    double bias_rps = 0;
    double place_m = 0;
  };
  /// Forgets those before where it does not go on from them, or back over them: the points may be thrown meanwhile.
  void add(Piece piece);
  void clear() { pieces_.clear(); }
  /// The train is found to be so far from where it was taken to be: forgets what it felt at another place of the map.
  void corrected(double by_m);
  /// That place of the path is on the way that is remembered.
  [[nodiscard]] bool holds(double distance_m) const;
  /// By how much the part of the way that turned most otherwise than the path did so, in standard deviations.
  struct Misfit {
    double most = 0;
    double without_worst = 0;  // without the worst piece in which a turn was felt, which may be a bump
  };
  /// The body of a car turns up to a bogie distance behind the camera's foot, and a map has its points not quite where
  /// they are: shifted by what fits best.
  [[nodiscard]] Misfit misfit(const track::Path& path, const Errors& errors) const;

 private:
  [[nodiscard]] Misfit misfit_shifted(const track::Path& path, const Errors& errors, double behind_m) const;
  static constexpr size_t kMost = 12;  // seconds, or 10 m where that takes longer
  std::vector<Piece> pieces_;          // oldest first
};

}  // namespace railfix::fusion
