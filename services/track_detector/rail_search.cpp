#include "track_detector/rail_search.hpp"

#include <algorithm>
#include <cmath>

namespace railfix::track_detector {
namespace {

// The coarse search looks at every second row and column of the ridges, which are spread first.
constexpr int kCoarse = 2;
constexpr int kSpread = 2;
constexpr double kSpreadColumns = 3.0;
constexpr double kMostCells = 6e7;     // to add up in one picture: some 40 ms, ten times the usual
constexpr double kHandicap = 0.03;     // of the score at each limit
constexpr double kWorthKeeping = 0.5;  // of the best score

std::vector<double> steps(double limit, double step) {
  const int half = static_cast<int>(std::ceil(limit / step));
  std::vector<double> values;
  for (int i = -half; i <= half; ++i) values.push_back(half == 0 ? 0.0 : limit * i / half);
  return values;
}

double squared_share(double value, double limit) {
  return limit > 0 ? value * value / (limit * limit) : 0.0;
}

/// Tangent of the depression of a row's rays.
double depression(const TopView& view, int row, double pitch_rad) {
  return std::max(view.pose().height_m / view.ahead_m(row) + pitch_rad, 1e-3);
}

}  // namespace

RailSearch::RailSearch(const TopView& view, const SearchLimits& limits, double gauge_m, double head_m)
    : view_(view),
      limits_(limits),
      width_m_(gauge_m + head_m),
      left_grid_(slope_grid(width_m_ / 2)),
      right_grid_(slope_grid(-width_m_ / 2)),
      row_count_((view.rows() + kCoarse - 1) / kCoarse),
      shift_per_yaw_(static_cast<size_t>(row_count_)),
      shift_per_curvature_(static_cast<size_t>(row_count_)),
      shifts_(static_cast<size_t>(row_count_)) {
  const double far_m = view.ahead_m(view.rows() - 1);
  const double height_m = view.pose().height_m;
  const double spread_m = kSpreadColumns * view.column_m();
  const double yaw_step = 2.0 * spread_m / far_m;
  yaws_ = steps(limits.yaw_rad, yaw_step);
  pitches_ = steps(limits.pitch_rad, yaw_step * std::min(4.0, 2.0 * height_m / width_m_));
  curvatures_ = steps(limits.curvature_per_m, 8.0 * spread_m / (far_m * far_m));
  const double hypotheses = static_cast<double>(pitches_.size() * yaws_.size() * curvatures_.size());
  const double cells = hypotheses * row_count_ * (left_grid_.count + right_grid_.count);
  turns_ = std::clamp(static_cast<int>(std::ceil(cells / kMostCells)), 1, static_cast<int>(curvatures_.size()));
  slack_ = std::max(1, static_cast<int>(std::lround(width_m_ / height_m * limits.height_fraction / left_grid_.step)));
  for (int k = 0; k < left_grid_.count + right_grid_.count; ++k) {
    const double slope = left_grid_.first + right_grid_.first + k * left_grid_.step;
    lateral_handicap_.push_back(static_cast<float>(lateral_handicap(slope, 0)));
  }
  const double flattest = depression(view, view.rows() - 1, -limits.pitch_rad);
  const double farthest = (limits.curvature_per_m * height_m / (2 * flattest) + limits.yaw_rad) / flattest;
  farthest_shift_ = std::min(view.columns() / kCoarse, static_cast<int>(std::ceil(farthest / left_grid_.step)) + 1);
  found_.reserve(pitches_.size() * yaws_.size() * curvatures_.size());
}

RailSearch::SlopeGrid RailSearch::slope_grid(double half_gauge_m) const {
  const auto& pose = view_.pose();
  const double middle = (half_gauge_m - pose.lateral_m) / pose.height_m;
  const double reach = (limits_.lateral_m + std::abs(half_gauge_m) * limits_.height_fraction) / pose.height_m;
  SlopeGrid grid;
  grid.step = kCoarse * view_.column_m() / pose.height_m;
  const int half = static_cast<int>(std::ceil(reach / grid.step));
  grid.count = 2 * half + 1;
  grid.first = middle - half * grid.step;
  return grid;
}

void RailSearch::resample(const SlopeGrid& grid, double pitch_rad, ShiftableRows& rows) const {
  const int width = grid.count + 2 * farthest_shift_;
  rows.cells.assign(static_cast<size_t>(row_count_) * static_cast<size_t>(width), 0.0F);
  rows.sums.resize(static_cast<size_t>(grid.count));
  for (int k = 0; k < row_count_; ++k) {
    const int r = k * kCoarse;
    const double gain = depression(view_, r, pitch_rad) * view_.ahead_m(r) / view_.column_m();
    const auto step = static_cast<float>(gain * grid.step);
    const auto first = static_cast<float>(view_.column_of(view_.pose().lateral_m) + gain * grid.first + 0.5);
    const auto* row = spread_.ptr<float>(r);
    float* cells = rows.cells.data() + static_cast<ptrdiff_t>(k) * width;
    for (int i = 0; i < width; ++i) {
      const float column = first + static_cast<float>(i - farthest_shift_) * step;
      if (column >= 0.0F && column < static_cast<float>(spread_.cols)) cells[i] = row[static_cast<int>(column)];
    }
  }
}

/// Mean score along the line of every slope, the rows moved by shifts_.
void RailSearch::sum(const SlopeGrid& grid, ShiftableRows& rows) const {
  const int width = grid.count + 2 * farthest_shift_;
  float* sums = rows.sums.data();
  std::fill(rows.sums.begin(), rows.sums.end(), 0.0F);
  for (int k = 0; k < row_count_; ++k) {
    const float* cells = rows.cells.data() + static_cast<ptrdiff_t>(k) * width + shifts_[static_cast<size_t>(k)];
    for (int i = 0; i < grid.count; ++i) sums[i] += cells[i];
  }
  for (auto& value : rows.sums) value /= static_cast<float>(row_count_);
}

void RailSearch::coarse(int turn) {
  found_.clear();
  best_ = 0;
  const double middle = farthest_shift_ + 0.5;  // a cast cuts off
  for (const double pitch : pitches_) {
    resample(left_grid_, pitch, left_);
    resample(right_grid_, pitch, right_);
    for (int k = 0; k < row_count_; ++k) {
      const double b = depression(view_, k * kCoarse, pitch);
      shift_per_yaw_[static_cast<size_t>(k)] = 1 / (b * left_grid_.step);
      shift_per_curvature_[static_cast<size_t>(k)] = view_.pose().height_m / (2 * b * b * left_grid_.step);
    }
    for (size_t i = static_cast<size_t>(turn % turns_); i < curvatures_.size(); i += static_cast<size_t>(turns_)) {
      const double curvature = curvatures_[i];
      for (const double yaw : yaws_) {
        for (size_t k = 0; k < shifts_.size(); ++k) {
          const double shift = curvature * shift_per_curvature_[k] - yaw * shift_per_yaw_[k];
          shifts_[k] = std::clamp(static_cast<int>(shift + middle), 0, 2 * farthest_shift_);
        }
        try_coarse({.pitch_rad = pitch, .yaw_rad = yaw, .curvature_per_m = curvature});
      }
    }
  }
}

void RailSearch::try_coarse(const RailHypothesis& h) {
  sum(left_grid_, left_);
  sum(right_grid_, right_);
  // The handicap only lowers a score: most hypotheses and pairs need no closer look.
  const auto shared = static_cast<float>(handicap(h));
  float best = static_cast<float>(kWorthKeeping * best_);
  float enough = (best + shared) * (best + shared);
  if (*std::max_element(left_.sums.begin(), left_.sums.end()) *
          *std::max_element(right_.sums.begin(), right_.sums.end()) <
      enough)
    return;
  int best_i = -1;
  int best_j = -1;
  for (int i = 0; i < left_grid_.count; ++i) {  // the grids are parallel: the same index is the nominal gauge
    const float left = left_.sums[static_cast<size_t>(i)];
    for (int j = std::max(0, i - slack_); j <= std::min(right_grid_.count - 1, i + slack_); ++j) {
      const float product = left * right_.sums[static_cast<size_t>(j)];
      if (product <= enough) continue;
      const float score = std::sqrt(product) - shared - lateral_handicap_[static_cast<size_t>(i + j)];
      if (score <= best) continue;
      best = score;
      enough = (best + shared) * (best + shared);
      best_i = i;
      best_j = j;
    }
  }
  if (best_i < 0) return;
  RailHypothesis found = h;
  found.left_slope = left_grid_.at(best_i);
  found.right_slope = right_grid_.at(best_j);
  found.score = static_cast<double>(best);
  best_ = std::max(best_, found.score);
  found_.push_back(found);
}

/// Coordinate descent with shrinking steps on the unspread scores.
RailHypothesis RailSearch::refined(RailHypothesis h, const cv::Mat& ridges) const {
  evaluate(h, ridges);
  const double far_m = view_.ahead_m(view_.rows() - 1);
  double size_m = kSpreadColumns * view_.column_m();
  for (int round = 0; round < 5; ++round, size_m *= 0.6) {
    const double slope = size_m / view_.pose().height_m;
    const double yaw = size_m / far_m;
    const double bend = 4 * size_m / (far_m * far_m);
    const double moves[7][5]{{yaw, 0, 0, 0, 0},        {0, 3 * yaw, 0, 0, 0}, {0, 0, bend, 0, 0},
                             {2 * yaw, 0, bend, 0, 0}, {0, 0, 0, slope, 0},   {0, 0, 0, 0, slope},
                             {0, 0, 0, slope, slope}};
    bool better = true;
    for (int sweep = 0; better && sweep < 6; ++sweep) {
      better = false;
      for (const auto& move : moves)
        better = try_move(h, move, 1.0, ridges) || try_move(h, move, -1.0, ridges) || better;
    }
  }
  return h;
}

/// Nothing in the picture prefers one of two equal answers: then the one nearer to the mount.
double RailSearch::handicap(const RailHypothesis& h) const {
  return kHandicap * (squared_share(h.pitch_rad, limits_.pitch_rad) + squared_share(h.yaw_rad, limits_.yaw_rad) +
                      squared_share(h.curvature_per_m, limits_.curvature_per_m));
}

double RailSearch::lateral_handicap(double left_slope, double right_slope) const {
  const double lateral_m = (left_slope + right_slope) / 2 * view_.pose().height_m + view_.pose().lateral_m;
  return kHandicap * squared_share(lateral_m, limits_.lateral_m);
}

void RailSearch::evaluate(RailHypothesis& h, const cv::Mat& ridges) const {
  const double height_m = view_.pose().height_m;
  const double middle = view_.column_of(view_.pose().lateral_m);
  double sums[2]{};
  for (int r = 0; r < view_.rows(); ++r) {
    const double b = depression(view_, r, h.pitch_rad);
    const double columns_per_slope = view_.ahead_m(r) / view_.column_m();
    const double offset = middle + (h.curvature_per_m * height_m / (2 * b) - h.yaw_rad) * columns_per_slope;
    const auto* row = ridges.ptr<float>(r);
    for (int side = 0; side < 2; ++side) {
      const double column = offset + (side == 0 ? h.left_slope : h.right_slope) * b * columns_per_slope;
      if (column < 0 || column >= ridges.cols - 1) continue;
      const int c = static_cast<int>(column);
      const double part = column - c;
      sums[side] += (1 - part) * static_cast<double>(row[c]) + part * static_cast<double>(row[c + 1]);
    }
  }
  h.left_score = sums[0] / view_.rows();
  h.right_score = sums[1] / view_.rows();
  h.score = std::sqrt(h.left_score * h.right_score) - handicap(h) - lateral_handicap(h.left_slope, h.right_slope);
}

bool RailSearch::try_move(RailHypothesis& h, const double (&move)[5], double sign, const cv::Mat& ridges) const {
  RailHypothesis trial = h;
  trial.yaw_rad += sign * move[0];
  trial.pitch_rad += sign * move[1];
  trial.curvature_per_m += sign * move[2];
  trial.left_slope += sign * move[3];
  trial.right_slope += sign * move[4];
  evaluate(trial, ridges);
  if (trial.score <= h.score + 1e-6) return false;
  h = trial;
  return true;
}

RailCandidate RailSearch::to_candidate(const RailHypothesis& h) const {
  RailCandidate candidate;
  auto& camera = candidate.shape.camera;
  camera = view_.pose();
  camera.pitch_rad += h.pitch_rad;
  camera.yaw_rad += h.yaw_rad;
  camera.height_m = width_m_ / (h.left_slope - h.right_slope);
  camera.lateral_m = -(h.left_slope + h.right_slope) / 2 * camera.height_m;
  candidate.shape.curvature_per_m = h.curvature_per_m * view_.pose().height_m / camera.height_m;
  candidate.score = h.score;
  candidate.left_score = h.left_score;
  candidate.right_score = h.right_score;
  return candidate;
}

/// Two hypotheses mean the same rails when they agree near the train.
bool RailSearch::alike(const RailHypothesis& a, const RailHypothesis& b) const {
  const double near_m = 1.5 * view_.ahead_m(0);
  const double height_m = view_.pose().height_m;
  const double left = (a.left_slope - b.left_slope) * height_m - (a.yaw_rad - b.yaw_rad) * near_m;
  const double right = (a.right_slope - b.right_slope) * height_m - (a.yaw_rad - b.yaw_rad) * near_m;
  return std::abs(left) < 0.12 && std::abs(right) < 0.12;
}

/// Every cell the largest of its row within kSpread columns.
void RailSearch::spread(const cv::Mat& ridges) {
  spread_.create(ridges.rows, ridges.cols, CV_32F);
  for (int r = 0; r < ridges.rows; r += kCoarse) {
    const auto* from = ridges.ptr<float>(r);
    auto* to = spread_.ptr<float>(r);
    for (int c = 0; c < ridges.cols; ++c) {
      const int first = std::max(0, c - kSpread);
      const int end = std::min(ridges.cols, c + kSpread + 1);
      to[c] = *std::max_element(from + first, from + end);
    }
  }
}

const std::vector<RailCandidate>& RailSearch::find(const cv::Mat& ridges, size_t max_candidates, int turn) {
  // Coarse steps are allowed because every ridge is spread by as much as a step moves a line.
  spread(ridges);
  coarse(turn);
  candidates_.clear();
  kept_.clear();
  const double worth = kWorthKeeping * best_;
  while (kept_.size() < max_candidates) {
    const RailHypothesis* next = nullptr;
    for (const auto& h : found_) {
      if (h.score < worth || (next != nullptr && h.score <= next->score)) continue;
      if (std::none_of(kept_.begin(), kept_.end(), [&](const auto& other) { return alike(h, other); })) next = &h;
    }
    if (next == nullptr) break;
    kept_.push_back(*next);
  }
  for (const auto& h : kept_) candidates_.push_back(to_candidate(refined(h, ridges)));
  std::sort(candidates_.begin(), candidates_.end(), [](const auto& a, const auto& b) { return a.score > b.score; });
  return candidates_;
}

}  // namespace railfix::track_detector
