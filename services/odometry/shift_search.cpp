#include "odometry/shift_search.hpp"

#include <algorithm>
#include <cmath>

namespace railfix::odometry {
namespace {

constexpr float kClip = 3.0F;      // one bright stone must not rule the sum
constexpr float kUnit = 64.0F;     // of the 16-bit numbers: 3 sigma squared times 10,000 cells fit into 32 bits
constexpr int kContrastRows = 15;  // local contrast over 0.6 m
constexpr int kLocalCols = 3;      // to either side: a sleeper's shape changes across the track over longer ways
constexpr int kFewestRows = 30;    // 1.2 m of common ground
constexpr int kLane = 8;

double correlation(const CoarseView& reference, const CoarseView& now, RowRange section, int shift, int side) {
  int64_t ab = 0;
  int64_t aa = 0;
  int64_t bb = 0;
  int rows = 0;
  const int width = (reference.cols + kLane - 1) / kLane * kLane;
  const int first = std::max(section.first, shift);
  const int last = std::min(section.last, now.rows - 1 + shift);
  for (int r = first; r <= last; ++r) {
    const auto at = static_cast<size_t>(r);
    const auto there = static_cast<size_t>(r - shift);
    if (reference.row_seen[at] == 0 || now.row_seen[there] == 0) continue;
    const int16_t* a = reference.row(r);
    const int16_t* b = now.row(r - shift) - side;
    int32_t sum = 0;
    for (int c = 0; c < width; ++c) sum += a[c] * b[c];
    ab += sum;
    aa += reference.energy[at];
    bb += now.energy[there];
    ++rows;
  }
  if (rows < std::min(kFewestRows, (section.last - section.first + 1) / 2) || aa <= 0 || bb <= 0) return -1;
  const double common = static_cast<double>(reference.cols) / static_cast<double>(reference.cols - std::abs(side));
  return common * static_cast<double>(ab) / std::sqrt(static_cast<double>(aa) * static_cast<double>(bb));
}

}  // namespace

void CoarseViewMaker::make(const vision::TopView& view, CoarseView& out) {
  out.rows = view.grey.rows / 2;
  out.cols = view.grey.cols / 2;
  out.stride = 2 * CoarseView::kMostSide + (out.cols + kLane - 1) / kLane * kLane;
  out.texture.assign(static_cast<size_t>(out.rows * out.stride), 0);
  out.energy.assign(static_cast<size_t>(out.rows), 0);
  out.row_seen.resize(static_cast<size_t>(out.rows));
  halve(view, out);
  remove_means(out);
  normalise(out);
}

void CoarseViewMaker::halve(const vision::TopView& view, CoarseView& out) {
  half_.assign(static_cast<size_t>(out.rows * out.cols), 0.0F);
  for (int r = 0; r < out.rows; ++r) {
    const auto at = static_cast<size_t>(r);
    out.row_seen[at] = view.row_seen[2 * at] & view.row_seen[2 * at + 1];
    if (out.row_seen[at] == 0) continue;
    const auto* top = view.grey.ptr<float>(2 * r);
    const auto* bottom = view.grey.ptr<float>(2 * r + 1);
    float* line = &half_[static_cast<size_t>(r * out.cols)];
    for (int c = 0; c < out.cols; ++c)
      line[c] = 0.25F * (top[2 * c] + top[2 * c + 1] + bottom[2 * c] + bottom[2 * c + 1]);
  }
}

// Sleepers that sag in their middle are not the same across the track; over a few columns they are.
void CoarseViewMaker::remove_local_mean(float* line, int cols) {
  sums_.resize(static_cast<size_t>(cols) + 1);
  sums_[0] = 0;
  for (int c = 0; c < cols; ++c) sums_[static_cast<size_t>(c) + 1] = sums_[static_cast<size_t>(c)] + line[c];
  for (int c = 0; c < cols; ++c) {
    const int low = std::max(0, c - kLocalCols);
    const int high = std::min(cols, c + kLocalCols + 1);
    line[c] -= (sums_[static_cast<size_t>(high)] - sums_[static_cast<size_t>(low)]) / static_cast<float>(high - low);
  }
}

void CoarseViewMaker::remove_means(const CoarseView& shape) {
  const int cols = shape.cols;
  column_.assign(static_cast<size_t>(cols), 0.0F);
  int rows = 0;
  for (int r = 0; r < shape.rows; ++r) {
    if (shape.row_seen[static_cast<size_t>(r)] == 0) continue;
    float* line = &half_[static_cast<size_t>(r * cols)];
    remove_local_mean(line, cols);
    for (int c = 0; c < cols; ++c) column_[static_cast<size_t>(c)] += line[c];
    ++rows;
  }
  if (rows == 0) return;
  for (float& sum : column_) sum /= static_cast<float>(rows);
  for (int r = 0; r < shape.rows; ++r) {
    if (shape.row_seen[static_cast<size_t>(r)] == 0) continue;
    float* line = &half_[static_cast<size_t>(r * cols)];
    for (int c = 0; c < cols; ++c) line[c] -= column_[static_cast<size_t>(c)];
  }
}

// Scales rows so that dark and bright stretches weigh the same.
void CoarseViewMaker::normalise(CoarseView& out) {
  const auto rows = static_cast<size_t>(out.rows);
  energy_.assign(rows + 1, 0.0);
  seen_.assign(rows + 1, 0);
  for (size_t r = 0; r < rows; ++r) {
    const float* line = &half_[r * static_cast<size_t>(out.cols)];
    float sum = 0;
    for (int c = 0; c < out.cols; ++c) sum += line[c] * line[c];
    energy_[r + 1] = energy_[r] + static_cast<double>(sum) / out.cols;
    seen_[r + 1] = seen_[r] + out.row_seen[r];
  }
  for (int r = 0; r < out.rows; ++r) {
    const auto low = static_cast<size_t>(std::max(0, r - kContrastRows / 2));
    const auto high = static_cast<size_t>(std::min(out.rows, r + kContrastRows / 2 + 1));
    const int count = seen_[high] - seen_[low];
    if (count == 0) continue;
    const auto scale = static_cast<float>(1.0 / (std::sqrt((energy_[high] - energy_[low]) / count) + 0.05));
    const float* line = &half_[static_cast<size_t>(r * out.cols)];
    int16_t* texture = &out.texture[static_cast<size_t>(r * out.stride + CoarseView::kMostSide)];
    int64_t energy = 0;
    for (int c = 0; c < out.cols; ++c) {
      texture[c] = static_cast<int16_t>(kUnit * std::clamp(line[c] * scale, -kClip, kClip));
      energy += texture[c] * texture[c];
    }
    out.energy[static_cast<size_t>(r)] = energy;
  }
  out.contrast_grey = seen_[rows] == 0 ? 0.0 : std::sqrt(energy_[rows] / seen_[rows]);
}

void take_out(const CoarseView& reference, const CoarseView& now, int shift, CoarseView& left_over) {
  left_over = now;
  for (int r = 0; r < now.rows; ++r) {
    const auto at = static_cast<size_t>(r);
    const int there = r + shift;
    const bool common = there >= 0 && there < reference.rows && now.row_seen[at] != 0 &&
                        reference.row_seen[static_cast<size_t>(there)] != 0;
    left_over.row_seen[at] = common ? 1 : 0;
    left_over.energy[at] = 0;
    if (!common) continue;
    const int16_t* then = reference.row(there);
    int16_t* line = &left_over.texture[static_cast<size_t>(r * now.stride + CoarseView::kMostSide)];
    int64_t energy = 0;
    for (int c = 0; c < now.cols; ++c) {
      line[c] = static_cast<int16_t>(line[c] - then[c]);
      energy += line[c] * line[c];
    }
    left_over.energy[at] = energy;
  }
}

ShiftPeak ShiftSearch::find(const CoarseView& reference, const CoarseView& now, RowRange section, RowRange shifts,
                            int side, int apart) {
  best_.assign(static_cast<size_t>(shifts.last - shifts.first + 1), -1.0);
  ShiftPeak peak;
  int peak_shift = shifts.first;
  for (int shift = shifts.first; shift <= shifts.last; ++shift) {
    double& here = best_[static_cast<size_t>(shift - shifts.first)];
    for (int s = -side; s <= side; ++s) {
      const double score = correlation(reference, now, section, shift, s);
      here = std::max(here, score);
      if (score > peak.score) {
        peak.score = score;
        peak.cols = s;
        peak_shift = shift;
      }
    }
  }
  peak.rows = peak_shift;
  const auto at = [&](int shift) {
    return shift < shifts.first || shift > shifts.last ? -1.0 : best_[static_cast<size_t>(shift - shifts.first)];
  };
  for (int shift = shifts.first; shift <= shifts.last; ++shift) {
    if (std::abs(shift - peak_shift) > apart) peak.runner_up = std::max(peak.runner_up, at(shift));
  }
  const double before = at(peak_shift - 1);
  const double after = at(peak_shift + 1);
  const double bend = before - 2.0 * peak.score + after;
  if (before > -1 && after > -1 && bend < 0) peak.rows += 0.5 * (before - after) / bend;
  return peak;
}

}  // namespace railfix::odometry
