#include "odometry/texture_alignment.hpp"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>

namespace railfix::odometry {
namespace {

// Neighbouring cells share picture pixels and smoothing, so fewer of them are independent than there are.
constexpr double kCellsPerIndependent = 4.0;
constexpr double kFarthestStepCells = 2.0;
constexpr size_t kFewestPixels = 60;
constexpr float kFewestShare = 0.5F;         // of a patch's pixels that must still be in sight
constexpr double kWorstDirection = 0.25e-3;  // determinant over squared trace: less is texture in one direction only

}  // namespace

void TextureReference::set(const vision::TopView& view, const vision::Sheet& sheet) {
  sheet_ = sheet;
  pixels_.clear();
  patches_.clear();
  const int rows = std::max(8, static_cast<int>(options_.patch_length_m / sheet.cell_m));
  const int cols = (sheet.cols - 2) / options_.patches_across;
  ground_finder_.find(view, sheet, ground_);
  for (int row = 1; row + rows < sheet.rows; row += rows) {
    for (int part = 0; part < options_.patches_across; ++part) {
      const Area area{row, rows, 1 + part * cols, cols};
      add_patch(view, area, Ground::sleeper);
      add_patch(view, area, Ground::ballast);
    }
  }
}

void TextureReference::add_patch(const vision::TopView& view, const Area& area, Ground kind) {
  Patch patch;
  patch.ballast = kind == Ground::ballast;
  patch.normal.setZero();
  patch.begin = pixels_.size();
  // Camera noise in a smoothed, halved difference of cells is well below the noise of a pixel.
  const auto weakest = static_cast<float>(options_.noise_grey * options_.noise_grey);
  double sum = 0;
  for (int r = area.row; r < area.row + area.rows; ++r) {
    const auto at = static_cast<size_t>(r);
    if (view.row_seen[at - 1] == 0 || view.row_seen[at + 1] == 0 || ground_[at] != kind) continue;
    const auto* above = view.grey.ptr<float>(r - 1);
    const auto* line = view.grey.ptr<float>(r);
    const auto* below = view.grey.ptr<float>(r + 1);
    for (int c = area.col; c < area.col + area.cols; ++c) {
      const float along = 0.5F * (below[c] - above[c]);
      const float across = 0.5F * (line[c + 1] - line[c - 1]);
      if (along * along + across * across < weakest) continue;
      pixels_.push_back({static_cast<int16_t>(r), static_cast<int16_t>(c), line[c], along, across});
      sum += line[c];
    }
  }
  patch.end = pixels_.size();
  const size_t count = patch.end - patch.begin;
  if (count < kFewestPixels) {
    pixels_.resize(patch.begin);
    return;
  }
  finish(patch, sum / static_cast<double>(count));
}

void TextureReference::finish(Patch& patch, double mean) {
  Eigen::Vector2d gradient_sum(0, 0);
  Eigen::Vector2d gradient_grey(0, 0);
  Eigen::Vector2d centre(0, 0);
  patch.first_row = pixels_[patch.begin].row;
  patch.last_row = pixels_[patch.end - 1].row;
  patch.first_col = sheet_.cols;
  for (size_t i = patch.begin; i < patch.end; ++i) {
    Pixel& pixel = pixels_[i];
    pixel.grey -= static_cast<float>(mean);
    const Eigen::Vector2d gradient(pixel.along, pixel.across);
    patch.normal += gradient * gradient.transpose();
    gradient_sum += gradient;
    gradient_grey += gradient * pixel.grey;
    centre += Eigen::Vector2d(pixel.row, pixel.col) * gradient.squaredNorm();
    patch.energy += pixel.grey * pixel.grey;
    patch.first_col = std::min<int>(patch.first_col, pixel.col);
    patch.last_col = std::max<int>(patch.last_col, pixel.col);
  }
  const auto count = static_cast<double>(patch.end - patch.begin);
  centre /= patch.normal.trace();
  patch.place_m = {sheet_.ahead_m(centre.x()), sheet_.offset_m(centre.y())};
  patch.whole.count = static_cast<float>(count);
  patch.whole.aa = static_cast<float>(patch.energy);
  for (int k = 0; k < 2; ++k) {
    patch.whole.g[k] = static_cast<float>(gradient_sum(k));
    patch.whole.ga[k] = static_cast<float>(gradient_grey(k));
  }
  // Gain and bias are free: take what they explain out of the gradients' share (Schur complement).
  patch.normal -=
      gradient_sum * gradient_sum.transpose() / count + gradient_grey * gradient_grey.transpose() / patch.energy;
  patches_.push_back(patch);
}

TextureReference::Shift TextureReference::split(const Eigen::Vector2d& cells) {
  const int row = static_cast<int>(std::floor(cells.x()));
  const int col = static_cast<int>(std::floor(cells.y()));
  const auto fr = static_cast<float>(cells.x() - row);
  const auto fc = static_cast<float>(cells.y() - col);
  return {row, col, (1 - fr) * (1 - fc), (1 - fr) * fc, fr * (1 - fc), fr * fc};
}

// Is the whole patch in sight after the shift?
bool TextureReference::inside(const Patch& patch, const vision::TopView& now, const Shift& shift) const {
  const int first = patch.first_row + shift.row;
  const int last = patch.last_row + shift.row + 1;
  if (first < 0 || last >= sheet_.rows || patch.first_col + shift.col < 0 ||
      patch.last_col + shift.col + 1 >= sheet_.cols)
    return false;
  const auto* seen = now.row_seen.data();
  return std::find(seen + first, seen + last + 1, 0) == seen + last + 1;
}

TextureReference::Sums TextureReference::compare_whole(const Patch& patch, const vision::TopView& now,
                                                       const Shift& shift) const {
  const auto step = static_cast<std::ptrdiff_t>(now.grey.step1());
  const float* origin = now.grey.ptr<float>(0) + shift.row * step + shift.col;
  float b = 0, bb = 0, ab = 0, gb0 = 0, gb1 = 0;
  for (size_t i = patch.begin; i < patch.end; ++i) {
    const Pixel& pixel = pixels_[i];
    const float* top = origin + pixel.row * step + pixel.col;
    const float* bottom = top + step;
    const float value = shift.w00 * top[0] + shift.w01 * top[1] + shift.w10 * bottom[0] + shift.w11 * bottom[1];
    b += value;
    bb += value * value;
    ab += pixel.grey * value;
    gb0 += pixel.along * value;
    gb1 += pixel.across * value;
  }
  Sums sums = patch.whole;
  sums.b = b;
  sums.bb = bb;
  sums.ab = ab;
  sums.gb[0] = gb0;
  sums.gb[1] = gb1;
  return sums;
}

TextureReference::Sums TextureReference::compare_part(const Patch& patch, const vision::TopView& now,
                                                      const Shift& shift) const {
  Sums sums;
  for (size_t i = patch.begin; i < patch.end; ++i) {
    const Pixel& pixel = pixels_[i];
    const int row = pixel.row + shift.row;
    const int col = pixel.col + shift.col;
    if (row < 0 || row + 1 >= sheet_.rows || col < 0 || col + 1 >= sheet_.cols) continue;
    if (now.row_seen[static_cast<size_t>(row)] == 0 || now.row_seen[static_cast<size_t>(row) + 1] == 0) continue;
    const auto* top = now.grey.ptr<float>(row) + col;
    const auto* bottom = now.grey.ptr<float>(row + 1) + col;
    const float value = shift.w00 * top[0] + shift.w01 * top[1] + shift.w10 * bottom[0] + shift.w11 * bottom[1];
    const float gradient[2] = {pixel.along, pixel.across};
    sums.count += 1;
    sums.a += pixel.grey;
    sums.aa += pixel.grey * pixel.grey;
    sums.b += value;
    sums.bb += value * value;
    sums.ab += pixel.grey * value;
    for (int k = 0; k < 2; ++k) {
      sums.g[k] += gradient[k];
      sums.ga[k] += gradient[k] * pixel.grey;
      sums.gb[k] += gradient[k] * value;
    }
  }
  return sums;
}

TextureReference::Answer TextureReference::measure_patch(const Patch& patch, const vision::TopView& now,
                                                         const Eigen::Vector2d& expected_m, PatchMotion& out) const {
  const Shift shift = split(expected_m / sheet_.cell_m);
  const Sums sums = inside(patch, now, shift) ? compare_whole(patch, now, shift) : compare_part(patch, now, shift);
  if (sums.count < kFewestShare * patch.whole.count) return Answer::out_of_sight;
  return step(patch, sums, expected_m, out);
}

TextureReference::Answer TextureReference::step(const Patch& patch, const Sums& sums, const Eigen::Vector2d& expected_m,
                                                PatchMotion& out) const {
  const double count = sums.count;
  const double mean_a = sums.a / count;
  const double mean_b = sums.b / count;
  const double var_a = sums.aa / count - mean_a * mean_a;
  const double var_b = sums.bb / count - mean_b * mean_b;
  const double cov = sums.ab / count - mean_a * mean_b;
  if (var_a <= 0 || var_b <= 0 || cov <= 0) return Answer::differs;
  out.correlation = cov / std::sqrt(var_a * var_b);
  if (out.correlation < options_.lowest_correlation) return Answer::differs;
  // Both views are equally noisy, so the gain is the ratio of contrasts, not the regression.
  const double gain = std::sqrt(var_a / var_b);
  Eigen::Vector2d slope;
  for (int k = 0; k < 2; ++k) slope(k) = (sums.gb[k] - sums.g[k] * mean_b) * gain - (sums.ga[k] - sums.g[k] * mean_a);
  const Eigen::Matrix2d normal = patch.normal * (count / static_cast<double>(patch.whole.count));
  if (normal.determinant() <= kWorstDirection * normal.trace() * normal.trace()) return Answer::differs;
  // now(x + d) = reference(x): brightness left over is -gradient * (true - expected).
  const Eigen::Vector2d cells = -normal.inverse() * slope;
  if (cells.norm() > kFarthestStepCells) return Answer::differs;
  const double unexplained = 2.0 * var_a * (1.0 - out.correlation) + 0.05;
  out.place_m = patch.place_m;
  out.ballast = patch.ballast;
  out.displacement_m = expected_m + cells * sheet_.cell_m;
  out.information = normal / (unexplained * kCellsPerIndependent * sheet_.cell_m * sheet_.cell_m);
  return Answer::agrees;
}

size_t TextureReference::measure(const vision::TopView& now, const DisplacementField& expected,
                                 std::vector<PatchMotion>& out) const {
  out.clear();
  PatchMotion motion;
  size_t in_sight = 0;
  for (const Patch& patch : patches_) {
    const Answer answer = measure_patch(patch, now, expected(patch.place_m, patch.ballast), motion);
    if (answer != Answer::out_of_sight) ++in_sight;
    if (answer == Answer::agrees) out.push_back(motion);
  }
  return in_sight;
}

}  // namespace railfix::odometry
