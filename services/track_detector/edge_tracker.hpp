// Where upright edges stand: an edge that is about to leave the picture is looked for in the pictures before, from
// every place on its line of sight; it stands where it was to be seen all the time. What lies farther behind moves
// otherwise (parallax), so that even a faint edge before a background like itself is found.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "track_detector/upright_search.hpp"

namespace railfix::track_detector {

constexpr size_t kMostMeasurements = 56;
constexpr size_t kMostStripes = 12;

struct EdgeMeasurement {
  double way_m, bearing, eye_lateral_m;
  double residual;  // of the bearing: measured less the settled edge's
  int64_t stamp_ns = 0;
};

/// Where the train was on the way when a picture was taken.
struct LookAt {
  double way_m = 0;
  int64_t stamp_ns = 0;
};

/// How far from an edge the brightness stepped back, in one look.
struct StripeMeasurement {
  double way_m, bearing;
  double outward, inward;  // bearing to the next edge; 0 = the brightness does not step back there
};

/// An edge that is measured as well as it will be, on the scale of the way.
struct SettledEdge {
  double place_m = 0;
  double lateral_m = 0;  // of the track centre, left positive
  double sigma_m = 0;    // of place_m
  double lateral_sigma_m = 0;
  double inner_grey = 0;  // beside it towards the track, mean
  double outer_grey = 0;
  double wall_grey = 0;        // behind it towards the track, mean
  double deep_grey = 0;        // the same, farther away
  double cell = 0;             // bearing between two columns
  double curvature_per_m = 0;  // of the track there
  int pictures = 0;
  size_t count = 0;                                           // of the measurements
  std::array<EdgeMeasurement, kMostMeasurements> measured{};  // far to near
  [[nodiscard]] LookAt last_look() const { return {measured[count - 1].way_m, measured[count - 1].stamp_ns}; }
  size_t stripe_count = 0;
  std::array<StripeMeasurement, kMostStripes> stripe{};
};

/// use(of one, of the other): every look in which both edges were measured, far to near.
template <class Use>
void together(const SettledEdge& one, const SettledEdge& other, const Use& use) {
  for (size_t i = 0, k = 0; i < one.count; ++i) {
    while (k < other.count && other.measured[k].way_m < one.measured[i].way_m) ++k;
    if (k == other.count) return;
    if (other.measured[k].way_m == one.measured[i].way_m) use(one.measured[i], other.measured[k]);
  }
}

/// Where the brightness steps along a wall, the last place first.
struct WallSteps {
  std::array<double, 4> place_m{};
  size_t count = 0;
  [[nodiscard]] std::optional<double> last() const { return count > 0 ? std::optional(place_m[0]) : std::nullopt; }
};

/// All rows together, or the lower and the upper ones each by themselves: more is seen so, not all of it of the wall.
enum class Rows : uint8_t { all, halves };

class EdgeTracker {
 public:
  EdgeTracker();
  /// Edges and profile of the picture at way_m. Gives the edges that are settled now; valid until the next call.
  const std::vector<SettledEdge>& follow(const std::vector<UprightEdge>& found, const UprightProfile& profile,
                                         const LandmarkPicture& picture, double way_m);
  void forget();
  /// Along the wall at that lateral offset: places in the range where the brightness steps clearly, seen over the near
  /// looks together.
  [[nodiscard]] WallSteps steps(double wall_m, double from_m, double to_m, Rows rows = Rows::all) const;
  /// What stands so far beside the eye leaves the picture so far ahead.
  [[nodiscard]] double leaves_ahead_m(double lateral_m) const;
  /// The newest look that shows what stands there; nothing before any has.
  [[nodiscard]] std::optional<LookAt> last_look_at(double place_m, double lateral_m) const;

 private:
  // Where the eye was in the plan, and what it saw.
  struct Look {
    int64_t stamp_ns = 0;
    double way_m = 0, x_m = 0, y_m = 0, heading_rad = 0;
    double curvature_per_m = 0, eye_lateral_m = 0;
    std::vector<float> step;
    std::array<std::vector<float>, 2> half_step;
    std::array<std::vector<float>, 2> evidence;  // 0..1 of an edge that darkens, brightens to the left
  };
  // A look as seen from the newest one.
  struct Relative {
    const Look* look = nullptr;
    double back_m = 0, x_m = 0, y_m = 0, cosine = 1, sine = 0;
  };
  struct Candidate {
    double x_m = 0, y_m = 0;  // plan
    int sign = 1;
    double support = 0;
    double hit_m = 0;                                                     // way where it was seen last
    double inner_grey = 0, outer_grey = 0, wall_grey = 0, deep_grey = 0;  // sums
    int hits = 0;
    size_t stripe_count = 0;
    std::array<StripeMeasurement, kMostStripes> stripe{};
    SettledEdge edge;
  };
  struct Spot {
    double x_m = 0, y_m = 0;  // from the newest look
    double back_m = 0;        // it is seen since so long
    double support = 0;
    size_t looks = 0;
  };
  // Place, lateral offset from the newest look, and what the curvature was wrong by; which looks count.
  struct Fit {
    Eigen::Vector3d state;
    double sure_back_m = 0;
    bool only_sure = true;
    int sign = 1;
  };
  struct Pass;
  void advance(const LandmarkPicture& picture, double way_m);
  void remember(const UprightProfile& profile, const LandmarkPicture& picture);
  void relate();
  /// The newest for 0.
  [[nodiscard]] const Look& look_back(size_t i) const { return looks_[(newest_ + looks_.size() - i) % looks_.size()]; }
  void take(const UprightEdge& edge);
  [[nodiscard]] double bearing_of(const Relative& relative, double x_m, double y_m, double bend) const;
  [[nodiscard]] std::array<Spot, 2> locate(double bearing, int sign) const;
  [[nodiscard]] std::optional<double> measure(const Relative& relative, double bearing, int sign) const;
  [[nodiscard]] std::optional<SettledEdge> refine(Spot& spot, int sign) const;
  void add(const Relative& relative, const Fit& fit, Pass& pass, SettledEdge& edge) const;
  void place(const Fit& fit, const Pass& pass, SettledEdge& edge) const;
  [[nodiscard]] double step_at(double place_m, double wall_m, Rows rows) const;
  [[nodiscard]] static Relative itself(const Look& look) { return {&look, 0, 0, 0, 1, 0}; }
  void settle();

  std::vector<Look> looks_;  // ring
  size_t newest_ = 0;
  size_t count_ = 0;
  std::vector<Relative> relatives_;  // near to far, without the newest look
  std::vector<Candidate> candidates_;
  std::vector<SettledEdge> settled_;
  double way_m_ = 0, x_m_ = 0, y_m_ = 0, heading_rad_ = 0, curvature_per_m_ = 0;  // plan of the track
  double cell_ = 0, middle_ = 0, widest_ = 0;
};

}  // namespace railfix::track_detector
