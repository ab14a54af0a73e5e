#include "odometry/shift_search.hpp"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

namespace railfix::odometry {
namespace {

constexpr double kClip = 3.0;      // one bright stone must not rule the sum
constexpr int kContrastRows = 15;  // local contrast over 0.6 m
constexpr int kFewestRows = 30;    // 1.2 m of common ground

void remove_means(cv::Mat& texture, const std::vector<uint8_t>& row_seen) {
  std::vector<float> column(static_cast<size_t>(texture.cols), 0.0F);
  int rows = 0;
  for (int r = 0; r < texture.rows; ++r) {
    auto* line = texture.ptr<float>(r);
    if (row_seen[static_cast<size_t>(r)] == 0) {
      std::fill(line, line + texture.cols, 0.0F);
      continue;
    }
    float mean = 0;
    for (int c = 0; c < texture.cols; ++c) mean += line[c];
    mean /= static_cast<float>(texture.cols);
    for (int c = 0; c < texture.cols; ++c) {
      line[c] -= mean;
      column[static_cast<size_t>(c)] += line[c];
    }
    ++rows;
  }
  if (rows == 0) return;
  for (float& sum : column) sum /= static_cast<float>(rows);
  for (int r = 0; r < texture.rows; ++r) {
    if (row_seen[static_cast<size_t>(r)] == 0) continue;
    auto* line = texture.ptr<float>(r);
    for (int c = 0; c < texture.cols; ++c) line[c] -= column[static_cast<size_t>(c)];
  }
}

// Scales rows so that dark and bright stretches weigh the same; returns the contrast before.
double normalise(cv::Mat& texture, const std::vector<uint8_t>& row_seen) {
  const auto rows = static_cast<size_t>(texture.rows);
  std::vector<double> energy(rows + 1, 0.0);
  std::vector<int> seen(rows + 1, 0);
  for (int r = 0; r < texture.rows; ++r) {
    const auto* line = texture.ptr<float>(r);
    double sum = 0;
    for (int c = 0; c < texture.cols; ++c) sum += line[c] * line[c];
    energy[static_cast<size_t>(r) + 1] = energy[static_cast<size_t>(r)] + sum / texture.cols;
    seen[static_cast<size_t>(r) + 1] = seen[static_cast<size_t>(r)] + row_seen[static_cast<size_t>(r)];
  }
  for (int r = 0; r < texture.rows; ++r) {
    const auto low = static_cast<size_t>(std::max(0, r - kContrastRows / 2));
    const auto high = static_cast<size_t>(std::min(texture.rows, r + kContrastRows / 2 + 1));
    const int count = seen[high] - seen[low];
    if (count == 0) continue;
    const double sigma = std::sqrt((energy[high] - energy[low]) / count) + 0.05;
    auto* line = texture.ptr<float>(r);
    for (int c = 0; c < texture.cols; ++c) {
      line[c] = static_cast<float>(std::clamp(line[c] / sigma, -kClip, kClip));
    }
  }
  return seen[rows] == 0 ? 0.0 : std::sqrt(energy[rows] / seen[rows]);
}

double correlation(const CoarseView& reference, const CoarseView& now, RowRange section, int shift, int side) {
  const int first_col = std::max(0, side);
  const int cols = reference.texture.cols - std::abs(side);
  float ab = 0;
  float aa = 0;
  float bb = 0;
  int rows = 0;
  const int first = std::max(section.first, shift);
  const int last = std::min(section.last, now.texture.rows - 1 + shift);
  for (int r = first; r <= last; ++r) {
    if (reference.row_seen[static_cast<size_t>(r)] == 0 || now.row_seen[static_cast<size_t>(r - shift)] == 0) continue;
    const auto* a = reference.texture.ptr<float>(r) + first_col;
    const auto* b = now.texture.ptr<float>(r - shift) + first_col - side;
    for (int c = 0; c < cols; ++c) {
      ab += a[c] * b[c];
      aa += a[c] * a[c];
      bb += b[c] * b[c];
    }
    ++rows;
  }
  if (rows < std::min(kFewestRows, (section.last - section.first + 1) / 2) || aa <= 0 || bb <= 0) return -1;
  return ab / std::sqrt(static_cast<double>(aa) * bb);
}

}  // namespace

CoarseView make_coarse(const vision::TopView& view) {
  CoarseView coarse;
  cv::resize(view.grey, coarse.texture, cv::Size(view.grey.cols / 2, view.grey.rows / 2), 0, 0, cv::INTER_AREA);
  coarse.row_seen.resize(static_cast<size_t>(coarse.texture.rows));
  for (size_t r = 0; r < coarse.row_seen.size(); ++r) {
    coarse.row_seen[r] = view.row_seen[2 * r] & view.row_seen[2 * r + 1];
  }
  remove_means(coarse.texture, coarse.row_seen);
  coarse.contrast_grey = normalise(coarse.texture, coarse.row_seen);
  return coarse;
}

ShiftPeak find_shift(const CoarseView& reference, const CoarseView& now, RowRange section, RowRange shifts, int side,
                     int apart) {
  std::vector<double> best(static_cast<size_t>(shifts.last - shifts.first + 1), -1.0);
  ShiftPeak peak;
  int peak_shift = shifts.first;
  for (int shift = shifts.first; shift <= shifts.last; ++shift) {
    double& here = best[static_cast<size_t>(shift - shifts.first)];
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
    return shift < shifts.first || shift > shifts.last ? -1.0 : best[static_cast<size_t>(shift - shifts.first)];
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
