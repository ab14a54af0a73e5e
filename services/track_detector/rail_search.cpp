#include "track_detector/rail_search.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <opencv2/imgproc.hpp>

namespace railfix::track_detector {
namespace {

// The coarse search looks at every second row and column of the ridges, which are spread first.
constexpr int kCoarse = 2;

/// In the level frame of the view's pose a ray is (1, a, -b). A straight rail is a = slope * b with slope =
/// (y - lateral) / height; pitch and yaw errors shift b and a; curvature bends a by beta * height / (2 b).
struct Hypothesis {
  double pitch_rad = 0;
  double yaw_rad = 0;
  double curvature_per_m = 0;
  double left_slope = 0;
  double right_slope = 0;
  double score = 0;
  double left_score = 0;
  double right_score = 0;
};

/// Column = offset + slope * gain, in one row under one hypothesis.
struct RowLine {
  float offset;
  float gain;
};

RowLine row_line(const TopView& view, int row, const Hypothesis& h) {
  const double height_m = view.pose().height_m;
  const double ahead_m = view.ahead_m(row);
  const double b = std::max(height_m / ahead_m + h.pitch_rad, 1e-3);
  const double a0 = h.curvature_per_m * height_m / (2 * b) - h.yaw_rad;
  return {static_cast<float>(view.column_of(a0 * ahead_m + view.pose().lateral_m)),
          static_cast<float>(b * ahead_m / view.column_m())};
}

/// Slopes that one rail may have: first, first + step, ...
struct SlopeGrid {
  double first = 0;
  double step = 0;
  int count = 0;
  [[nodiscard]] double at(int i) const { return first + i * step; }
};

SlopeGrid slope_grid(const TopView& view, const SearchLimits& limits, double half_gauge_m) {
  const auto& pose = view.pose();
  const double middle = (half_gauge_m - pose.lateral_m) / pose.height_m;
  const double reach = (limits.lateral_m + std::abs(half_gauge_m) * limits.height_fraction) / pose.height_m;
  SlopeGrid grid;
  grid.step = kCoarse * view.column_m() / pose.height_m;
  const int half = static_cast<int>(std::ceil(reach / grid.step));
  grid.count = 2 * half + 1;
  grid.first = middle - half * grid.step;
  return grid;
}

/// Mean ridge score along the line of every slope.
void sum_along(const cv::Mat& ridges, const std::vector<RowLine>& lines, const SlopeGrid& grid,
               std::vector<float>& sums) {
  sums.assign(static_cast<size_t>(grid.count), 0.0F);
  const int columns = ridges.cols;
  for (size_t k = 0; k < lines.size(); ++k) {
    const auto* row = ridges.ptr<float>(static_cast<int>(k) * kCoarse);
    const auto& line = lines[k];
    const float step = line.gain * static_cast<float>(grid.step);
    float column = line.offset + line.gain * static_cast<float>(grid.first) + 0.5F;
    for (int i = 0; i < grid.count; ++i, column += step) {
      if (column >= 0.0F && column < static_cast<float>(columns))
        sums[static_cast<size_t>(i)] += row[static_cast<int>(column)];
    }
  }
  for (auto& sum : sums) sum /= static_cast<float>(lines.size());
}

class Search {
 public:
  Search(const TopView& view, const cv::Mat& ridges, const SearchLimits& limits, double gauge_m, double head_m)
      : view_(view),
        ridges_(ridges),
        limits_(limits),
        width_m_(gauge_m + head_m),
        left_grid_(slope_grid(view, limits, width_m_ / 2)),
        right_grid_(slope_grid(view, limits, -width_m_ / 2)) {
    // Coarse steps are allowed because every ridge is spread by as much as a step moves a line.
    cv::dilate(ridges, spread_, cv::Mat::ones(1, 5, CV_8U));
  }

  std::vector<Hypothesis> coarse() {
    const double far_m = view_.ahead_m(view_.rows() - 1);
    const double spread_m = 3.0 * view_.column_m();
    const double yaw_step = 2.0 * spread_m / far_m;
    const double pitch_step = yaw_step * std::min(4.0, 2.0 * view_.pose().height_m / width_m_);
    const double curvature_step = 8.0 * spread_m / (far_m * far_m);
    std::vector<Hypothesis> found;
    for (const double curvature : steps(limits_.curvature_per_m, curvature_step)) {
      for (const double pitch : steps(limits_.pitch_rad, pitch_step)) {
        for (const double yaw : steps(limits_.yaw_rad, yaw_step)) {
          Hypothesis h;
          h.curvature_per_m = curvature;
          h.pitch_rad = pitch;
          h.yaw_rad = yaw;
          best_pair(h);
          found.push_back(h);
        }
      }
    }
    return found;
  }

  /// Coordinate descent with shrinking steps on the unspread scores.
  Hypothesis refined(Hypothesis h) const {
    evaluate(h);
    const double far_m = view_.ahead_m(view_.rows() - 1);
    double size_m = 3.0 * view_.column_m();
    for (int round = 0; round < 5; ++round, size_m *= 0.6) {
      const double slope = size_m / view_.pose().height_m;
      const double yaw = size_m / far_m;
      bool better = true;
      for (int sweep = 0; better && sweep < 6; ++sweep) {
        better = false;
        const std::array<std::array<double, 5>, 7> moves{{{yaw, 0, 0, 0, 0},
                                                          {0, 3 * yaw, 0, 0, 0},
                                                          {0, 0, 4 * size_m / (far_m * far_m), 0, 0},
                                                          {2 * yaw, 0, 4 * size_m / (far_m * far_m), 0, 0},
                                                          {0, 0, 0, slope, 0},
                                                          {0, 0, 0, 0, slope},
                                                          {0, 0, 0, slope, slope}}};
        for (const auto& move : moves) better = try_move(h, move, 1.0) || try_move(h, move, -1.0) || better;
      }
    }
    return h;
  }

 private:
  static std::vector<double> steps(double limit, double step) {
    const int half = static_cast<int>(std::ceil(limit / step));
    std::vector<double> values;
    for (int i = -half; i <= half; ++i) values.push_back(half == 0 ? 0.0 : limit * i / half);
    return values;
  }

  /// Nothing in the picture prefers one of two equal answers: then the one nearer to the mount.
  [[nodiscard]] double handicap(const Hypothesis& h) const {
    const double lateral = (h.left_slope + h.right_slope) / 2 -
                           (left_grid_.at(left_grid_.count / 2) + right_grid_.at(right_grid_.count / 2)) / 2;
    const auto share = [](double value, double limit) { return limit > 0 ? value * value / (limit * limit) : 0.0; };
    return 0.03 * (share(h.pitch_rad, limits_.pitch_rad) + share(h.yaw_rad, limits_.yaw_rad) +
                   share(h.curvature_per_m, limits_.curvature_per_m) +
                   share(lateral * view_.pose().height_m, limits_.lateral_m));
  }

  void best_pair(Hypothesis& h) {
    lines_.clear();
    for (int r = 0; r < view_.rows(); r += kCoarse) lines_.push_back(row_line(view_, r, h));
    sum_along(spread_, lines_, left_grid_, left_);
    sum_along(spread_, lines_, right_grid_, right_);
    const double nominal = width_m_ / view_.pose().height_m;
    const int slack = std::max(1, static_cast<int>(std::lround(nominal * limits_.height_fraction / left_grid_.step)));
    Hypothesis best = h;
    best.score = -1;
    for (int i = 0; i < left_grid_.count; ++i) {  // the grids are parallel: the same index is the nominal gauge
      for (int j = std::max(0, i - slack); j <= std::min(right_grid_.count - 1, i + slack); ++j) {
        const float left = left_[static_cast<size_t>(i)];
        const float right = right_[static_cast<size_t>(j)];
        // The handicap only lowers a score: most pairs need no closer look.
        if (best.score > 0 && static_cast<double>(left * right) <= best.score * best.score) continue;
        h.left_slope = left_grid_.at(i);
        h.right_slope = right_grid_.at(j);
        set_score(h, static_cast<double>(left), static_cast<double>(right));
        if (h.score > best.score) best = h;
      }
    }
    h = best;
  }

  void set_score(Hypothesis& h, double left, double right) const {
    h.left_score = left;
    h.right_score = right;
    h.score = std::sqrt(left * right) - handicap(h);
  }

  void evaluate(Hypothesis& h) const {
    std::array<double, 2> sums{};
    for (int r = 0; r < view_.rows(); ++r) {
      const auto line = row_line(view_, r, h);
      const auto* row = ridges_.ptr<float>(r);
      for (size_t side = 0; side < 2; ++side) {
        const double slope = side == 0 ? h.left_slope : h.right_slope;
        const double column = static_cast<double>(line.offset) + slope * static_cast<double>(line.gain);
        if (column < 0 || column >= ridges_.cols - 1) continue;
        const int c = static_cast<int>(column);
        const double part = column - c;
        sums[side] += (1 - part) * static_cast<double>(row[c]) + part * static_cast<double>(row[c + 1]);
      }
    }
    set_score(h, sums[0] / view_.rows(), sums[1] / view_.rows());
  }

  bool try_move(Hypothesis& h, const std::array<double, 5>& move, double sign) const {
    Hypothesis trial = h;
    trial.yaw_rad += sign * move[0];
    trial.pitch_rad += sign * move[1];
    trial.curvature_per_m += sign * move[2];
    trial.left_slope += sign * move[3];
    trial.right_slope += sign * move[4];
    evaluate(trial);
    if (trial.score <= h.score + 1e-6) return false;
    h = trial;
    return true;
  }

  const TopView& view_;
  const cv::Mat& ridges_;
  cv::Mat spread_;
  SearchLimits limits_;
  double width_m_;
  SlopeGrid left_grid_;
  SlopeGrid right_grid_;
  std::vector<RowLine> lines_;
  std::vector<float> left_;
  std::vector<float> right_;
};

RailCandidate to_candidate(const TopView& view, const Hypothesis& h, double width_m) {
  RailCandidate candidate;
  auto& camera = candidate.shape.camera;
  camera = view.pose();
  camera.pitch_rad += h.pitch_rad;
  camera.yaw_rad += h.yaw_rad;
  camera.height_m = width_m / (h.left_slope - h.right_slope);
  camera.lateral_m = -(h.left_slope + h.right_slope) / 2 * camera.height_m;
  candidate.shape.curvature_per_m = h.curvature_per_m * view.pose().height_m / camera.height_m;
  candidate.score = h.score;
  candidate.left_score = h.left_score;
  candidate.right_score = h.right_score;
  return candidate;
}

/// Two hypotheses mean the same rails when they agree near the train.
bool alike(const TopView& view, const Hypothesis& a, const Hypothesis& b) {
  const double near_m = 1.5 * view.ahead_m(0);
  const double height_m = view.pose().height_m;
  const double left = (a.left_slope - b.left_slope) * height_m - (a.yaw_rad - b.yaw_rad) * near_m;
  const double right = (a.right_slope - b.right_slope) * height_m - (a.yaw_rad - b.yaw_rad) * near_m;
  return std::abs(left) < 0.12 && std::abs(right) < 0.12;
}

}  // namespace

std::vector<RailCandidate> search_rails(const TopView& view, const cv::Mat& ridges, const SearchLimits& limits,
                                        double gauge_m, double head_m, size_t max_candidates) {
  Search search(view, ridges, limits, gauge_m, head_m);
  auto coarse = search.coarse();
  std::sort(coarse.begin(), coarse.end(), [](const auto& a, const auto& b) { return a.score > b.score; });
  std::vector<Hypothesis> kept;
  for (const auto& h : coarse) {
    if (kept.size() >= max_candidates || h.score < 0.5 * coarse.front().score) break;
    if (std::none_of(kept.begin(), kept.end(), [&](const auto& other) { return alike(view, h, other); }))
      kept.push_back(h);
  }
  std::vector<RailCandidate> candidates;
  for (const auto& h : kept) candidates.push_back(to_candidate(view, search.refined(h), gauge_m + head_m));
  std::sort(candidates.begin(), candidates.end(), [](const auto& a, const auto& b) { return a.score > b.score; });
  return candidates;
}

}  // namespace railfix::track_detector
