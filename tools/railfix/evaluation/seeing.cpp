#include "evaluation/seeing.hpp"

#include <algorithm>
#include <cmath>

namespace railfix::evaluation {
namespace {

constexpr double kVisibleShare = 0.5;  // of the own rails within 25 m
constexpr double kNearestM = 0.5;
constexpr double kFarthestM = 200.0;
constexpr double kGrowth = 1.05;  // each step along the rail is 5 % of its distance: near even steps in the picture

std::vector<double> distances_ahead() {
  std::vector<double> ahead;
  for (double x = kNearestM; x < kFarthestM; x *= kGrowth) ahead.push_back(x);
  return ahead;
}

using Line = std::vector<Eigen::Vector2d>;  // pixels, near to far

struct RailLines {
  Line left;
  Line right;
};

RailLines project_rails(const Truth& truth, const dataset::TruthRow& train) {
  static const std::vector<double> kAhead = distances_ahead();
  const geometry::View view(truth.calibration()->intrinsics, train.camera);
  const auto track = truth.track_ahead(train, kAhead);
  RailLines lines;
  for (size_t i = 0; i < kAhead.size(); ++i) {
    for (const double side : {1.0, -1.0}) {
      const auto pixel = view.project({kAhead[i], track[i].y_m + side * kGaugeM / 2, track[i].z_m});
      if (pixel) (side > 0 ? lines.left : lines.right).push_back(*pixel);
    }
  }
  return lines;
}

double horizontal_distance(const Line& line, const Eigen::Vector2d& point) {
  double best = kUnknown;
  for (size_t i = 1; i < line.size(); ++i) {
    const Eigen::Vector2d& a = line[i - 1];
    const Eigen::Vector2d& b = line[i];
    if ((a.y() - point.y()) * (b.y() - point.y()) > 0 || a.y() == b.y()) continue;
    const double u = a.x() + (point.y() - a.y()) / (b.y() - a.y()) * (b.x() - a.x());
    const double distance = std::abs(point.x() - u);
    if (!(best <= distance)) best = distance;
  }
  return best;
}

double normal_distance(const Line& line, const Eigen::Vector2d& point) {
  double best = kUnknown;
  for (size_t i = 1; i < line.size(); ++i) {
    const Eigen::Vector2d along = line[i] - line[i - 1];
    const double length2 = along.squaredNorm();
    const double share = length2 > 0 ? std::clamp((point - line[i - 1]).dot(along) / length2, 0.0, 1.0) : 0.0;
    const double distance = (point - line[i - 1] - share * along).norm();
    if (!(best <= distance)) best = distance;
  }
  return best;
}

bool pose_known(const dataset::TruthRow& row) {
  const auto& c = row.camera;
  return std::isfinite(c.roll_rad + c.pitch_rad + c.yaw_rad + c.lateral_m + c.height_m);
}

std::array<double, kViewFields> true_view(const dataset::TruthRow& row) {
  return {row.camera.roll_rad, row.camera.pitch_rad, row.camera.yaw_rad,          row.camera.lateral_m,
          row.camera.height_m, row.curvature_per_m,  row.vertical_curvature_per_m};
}

FieldError judge_field(const std::vector<double>& errors, const std::vector<double>& sigmas) {
  FieldError field;
  std::vector<double> absolute;
  size_t with_sigma = 0;
  size_t within = 0;
  for (size_t i = 0; i < errors.size(); ++i) {
    absolute.push_back(std::abs(errors[i]));
    if (!std::isfinite(errors[i]) || !std::isfinite(sigmas[i])) continue;
    ++with_sigma;
    within += absolute.back() <= 2.0 * sigmas[i] ? 1 : 0;
  }
  field.bias = summarise(errors).mean;
  field.rms = root_mean_square(errors);
  field.absolute = summarise(std::move(absolute));
  field.within_2_sigma_percent = percent(within, with_sigma);
  return field;
}

constexpr double kMatchM = 2.0;

struct Match {
  double real_m;
  double error_m;
};

/// Nearest pairs first; each landmark and each sighting is used once.
std::vector<Match> match(std::vector<double> real_m, const std::vector<double>& said_m) {
  struct Pair {
    size_t real;
    size_t said;
    double error_m;
  };
  std::sort(real_m.begin(), real_m.end());
  std::vector<Pair> pairs;
  for (size_t s = 0; s < said_m.size(); ++s) {
    auto near = std::lower_bound(real_m.begin(), real_m.end(), said_m[s] - kMatchM);
    for (; near != real_m.end() && *near <= said_m[s] + kMatchM; ++near) {
      pairs.push_back({static_cast<size_t>(near - real_m.begin()), s, said_m[s] - *near});
    }
  }
  std::sort(pairs.begin(), pairs.end(),
            [](const Pair& a, const Pair& b) { return std::abs(a.error_m) < std::abs(b.error_m); });
  std::vector<bool> real_used(real_m.size());
  std::vector<bool> said_used(said_m.size());
  std::vector<Match> matches;
  for (const Pair& pair : pairs) {
    if (real_used[pair.real] || said_used[pair.said]) continue;
    real_used[pair.real] = said_used[pair.said] = true;
    matches.push_back({real_m[pair.real], pair.error_m});
  }
  return matches;
}

/// Of one kind, along the run.
struct Kind {
  std::vector<double> real_m;
  std::vector<double> said_m;
  std::vector<double> ahead_m;  // of the train, where it was said
};

void sum_up(KindResult& kind, const std::vector<double>& errors) {
  std::vector<double> absolute;
  for (const double error : errors) absolute.push_back(std::abs(error));
  kind.right = errors.size();
  kind.error_m = summarise(std::move(absolute));
  kind.bias_m = summarise(errors).mean;
}

}  // namespace

EdgeResult judge_edges(const Truth& truth, const std::vector<RailPoint>& points) {
  EdgeResult result;
  result.points = points.size();
  if (!truth.calibration()) {
    result.not_possible = "no mav0/cam0/sensor.yaml beside the truth";
    return result;
  }
  std::vector<double> horizontal;
  std::vector<double> normal;
  RailLines lines;
  const RailPoint* before = nullptr;
  size_t rails = 0;
  bool judged = false;
  bool counted[2] = {};
  for (const RailPoint& point : points) {
    if (before == nullptr || before->stamp_ns != point.stamp_ns) {
      const auto real = truth.at(point.stamp_ns);
      judged = real && pose_known(*real);
      if (judged) lines = project_rails(truth, *real);
      counted[0] = counted[1] = false;
    }
    before = &point;
    rails += counted[point.left ? 0 : 1] ? 0 : 1;
    counted[point.left ? 0 : 1] = true;
    if (!judged) continue;
    const Line& line = point.left ? lines.left : lines.right;
    horizontal.push_back(horizontal_distance(line, {point.u_px, point.v_px}));
    normal.push_back(normal_distance(line, {point.u_px, point.v_px}));
  }
  if (rails > 0) result.points_per_rail = static_cast<double>(points.size()) / static_cast<double>(rails);
  result.horizontal_px = summarise(std::move(horizontal));
  result.normal_px = summarise(std::move(normal));
  if (result.normal_px.count == 0) {
    result.not_possible =
        points.empty() ? "rails.csv has no points" : "the truth has no camera pose for these pictures";
  }
  return result;
}

ViewResult judge_views(const Truth& truth, const std::vector<ViewRow>& rows) {
  ViewResult result;
  std::array<std::vector<double>, kViewFields> errors;
  std::array<std::vector<double>, kViewFields> sigmas;
  size_t seen = 0;
  size_t seen_of_visible = 0;
  for (const ViewRow& row : rows) {
    const bool visible = truth.rails_visible(row.stamp_ns).value_or(0.0) >= kVisibleShare;
    result.visible += visible;
    seen_of_visible += visible && row.seen;
    if (!row.seen) continue;
    ++seen;
    const auto real = truth.at(row.stamp_ns);
    if (!real) continue;
    const auto should = true_view(*real);
    for (size_t i = 0; i < kViewFields; ++i) {
      errors[i].push_back(row.value[i] - should[i]);
      sigmas[i].push_back(row.sigma[i]);
    }
    result.curvature.push_back({row.stamp_ns, real->distance_m, row.value[5]});
  }
  result.seen_percent = percent(seen, rows.size());
  if (result.visible > 0) result.seen_of_visible_percent = percent(seen_of_visible, result.visible);
  for (size_t i = 0; i < kViewFields; ++i) result.fields[i] = judge_field(errors[i], sigmas[i]);
  return result;
}

std::optional<SightingResult> judge_sightings(const Truth& truth, const std::vector<SightingRow>& rows,
                                              const Stretch& run) {
  if (!truth.landmarks()) return std::nullopt;
  std::map<std::string, Kind> kinds;
  std::vector<double> ahead;
  for (const SightingRow& row : rows) {
    const auto real = truth.at(row.stamp_ns);
    if (!real) continue;
    kinds[row.kind].said_m.push_back(real->distance_m + row.distance_ahead_m);
    kinds[row.kind].ahead_m.push_back(row.distance_ahead_m);
    ahead.push_back(row.distance_ahead_m);
  }
  // A kind that was never reported has a recall, too.
  for (const dataset::TruthLandmark& landmark : *truth.landmarks())
    kinds[landmark.kind].real_m.push_back(landmark.distance_m);
  const Summary usual = summarise(ahead);
  double nearest_m = HUGE_VAL;
  double farthest_m = -HUGE_VAL;
  for (const auto& row : truth.rows()) {
    if (!run.holds(row.stamp_ns)) continue;
    nearest_m = std::min(nearest_m, row.distance_m);
    farthest_m = std::max(farthest_m, row.distance_m);
  }
  SightingResult result;
  std::vector<double> all_errors;
  for (const auto& [name, kind] : kinds) {
    // Only what passed the reference point could be reported; the run itself says how far ahead it is for this kind.
    const Summary own = summarise(kind.ahead_m);
    const double reference_m = own.count > 0 ? own.p50 : (usual.count > 0 ? usual.p50 : 0.0);
    const auto passed = [&](double place_m) {
      return place_m >= nearest_m + reference_m && place_m <= farthest_m + reference_m;
    };
    const auto matches = match(kind.real_m, kind.said_m);
    std::vector<double> errors;
    KindResult judged;
    judged.real = static_cast<size_t>(std::count_if(kind.real_m.begin(), kind.real_m.end(), passed));
    judged.said = kind.said_m.size();
    for (const Match& one : matches) {
      judged.real += passed(one.real_m) ? 0 : 1;  // at an end of the run, and seen all the same
      errors.push_back(one.error_m);
    }
    if (judged.real + judged.said == 0) continue;
    sum_up(judged, errors);
    all_errors.insert(all_errors.end(), errors.begin(), errors.end());
    result.all.real += judged.real;
    result.all.said += judged.said;
    result.kinds[name] = std::move(judged);
  }
  sum_up(result.all, all_errors);
  return result;
}

}  // namespace railfix::evaluation
