// How well a run saw the track: rails in the picture, camera pose, curvature and objects against the truth.
#pragma once

#include <array>
#include <map>
#include <string>
#include <vector>

#include "evaluation/run_tables.hpp"
#include "evaluation/statistics.hpp"
#include "evaluation/truth.hpp"

namespace railfix::evaluation {

constexpr double kGaugeM = 1.435;

/// Distances in the picture between the reported rail points and the inner rail-head edges as the truth projects them.
struct EdgeResult {
  size_t points = 0;
  double points_per_rail = kUnknown;  // mean, where a rail has any
  Summary horizontal_px;              // along the row
  Summary normal_px;                  // to the nearest place of the edge
  std::string not_possible;           // why there is no figure, empty = there is one
};
EdgeResult judge_edges(const Truth& truth, const std::vector<RailPoint>& points);

struct FieldError {
  double bias = kUnknown;  // measured minus true
  double rms = kUnknown;
  Summary absolute;
  double within_2_sigma_percent = kUnknown;  // about 95 when the sigmas are honest
};
struct CurvatureSample {
  int64_t stamp_ns = 0;
  double true_distance_m = 0;
  double measured_per_m = 0;
};
struct ViewResult {
  double seen_percent = kUnknown;
  size_t visible = 0;  // pictures that show half of the own rails or more, where the truth says so
  double seen_of_visible_percent = kUnknown;   // of them
  std::array<FieldError, kViewFields> fields;  // where both rails were seen
  std::vector<CurvatureSample> curvature;
};
ViewResult judge_views(const Truth& truth, const std::vector<ViewRow>& rows);

struct KindResult {
  size_t real =
      0;  // landmarks that passed the point where this kind is reported (median), or were reported all the same
  size_t said = 0;   // sightings
  size_t right = 0;  // of them with a landmark of the same kind within 2 m
  Summary error_m;   // |distance| of the right ones
  double bias_m = kUnknown;
  [[nodiscard]] double precision_percent() const { return percent(right, said); }
  [[nodiscard]] double recall_percent() const { return percent(right, real); }
};
struct SightingResult {
  KindResult all;
  std::map<std::string, KindResult> kinds;
};
/// Nothing when the truth has no landmarks.
std::optional<SightingResult> judge_sightings(const Truth& truth, const std::vector<SightingRow>& rows,
                                              const Stretch& run);

}  // namespace railfix::evaluation
