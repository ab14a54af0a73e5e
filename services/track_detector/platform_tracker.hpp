// Follows the ends of platform edges over the way and settles each once, when it leaves the picture.
#pragma once

#include <array>
#include <optional>
#include <vector>

#include "track_detector/platform_search.hpp"

namespace railfix::track_detector {

constexpr size_t kMostMarks = 40;

struct SettledPlatform {
  double place_m = 0;  // on the scale of the way
  double lateral_m = 0;
  double sigma_m = 0;
  int pictures = 0;
};

/// On the plane that is looked at, an end comes nearer by `factor` metres per metre of the way, and lies at `factor`
/// times its real distance beside: so its height is known, and what lies on the ground or stands higher is no platform.
class PlatformTracker {
 public:
  PlatformTracker();
  /// Marks of the picture at way_m. Gives what is settled now; valid until the next call.
  const std::vector<SettledPlatform>& follow(const std::vector<PlatformMark>& found, double way_m);
  void forget() {
    marks_.clear();
    held_.clear();
  }

 private:
  struct Measurement {
    double way_m, ahead_m, beside_m;  // way since the first one
  };
  struct Mark {
    int side = 1;
    bool begins = true;
    double first_way_m = 0;
    double last_way_m = 0, last_ahead_m = 0, beside_m = 0;
    size_t count = 0;
    std::array<Measurement, kMostMarks> measured{};
    int seen = 0, missed = 0, gaps = 0;
    bool hit = false;
  };
  struct Held {
    SettledPlatform settled;
    int side = 1;
    double way_m = 0;
  };
  void hold(const SettledPlatform& settled, const Mark& mark, double way_m);
  void release(double way_m);
  static void add(Mark& mark, const PlatformMark& found, double way_m);
  [[nodiscard]] double usual_factor(const Mark& mark);
  [[nodiscard]] std::optional<SettledPlatform> settle(const Mark& mark);

  std::array<double, 2> last_m_{-1e9, -1e9};  // settled last, right and left
  std::vector<Mark> marks_;
  std::vector<Held> held_;  // until no better one can follow
  std::vector<SettledPlatform> settled_;
  std::vector<double> slopes_;
};

}  // namespace railfix::track_detector
