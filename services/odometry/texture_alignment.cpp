#include "odometry/texture_alignment.hpp"

#include <Eigen/LU>
#include <cmath>

namespace railfix::odometry {
namespace {

// Neighbouring cells share picture pixels and smoothing, so fewer of them are independent than there are.
constexpr double kCellsPerIndependent = 4.0;
constexpr double kFarthestStepCells = 2.0;
constexpr size_t kFewestPixels = 60;

}  // namespace

TextureReference::TextureReference(const vision::TopView& view, const vision::Sheet& sheet, const Options& options)
    : sheet_(sheet), options_(options) {
  const int rows = std::max(8, static_cast<int>(options.patch_length_m / sheet.cell_m));
  const int cols = (sheet.cols - 2) / options.patches_across;
  const std::vector<Ground> ground = find_ground(view, sheet);
  for (int row = 1; row + rows < sheet.rows; row += rows) {
    for (int part = 0; part < options.patches_across; ++part) {
      const Area area{row, rows, 1 + part * cols, cols};
      add_patch(view, ground, area, Ground::sleeper);
      add_patch(view, ground, area, Ground::ballast);
    }
  }
}

void TextureReference::add_patch(const vision::TopView& view, const std::vector<Ground>& ground, const Area& area,
                                 Ground kind) {
  Patch patch;
  patch.ballast = kind == Ground::ballast;
  patch.normal.setZero();
  // Camera noise in a smoothed, halved difference of cells is well below the noise of a pixel.
  const auto weakest = static_cast<float>(options_.noise_grey);
  double sum = 0;
  for (int r = area.row; r < area.row + area.rows; ++r) {
    const auto at = static_cast<size_t>(r);
    if (view.row_seen[at - 1] == 0 || view.row_seen[at + 1] == 0 || ground[at] != kind) continue;
    const auto* above = view.grey.ptr<float>(r - 1);
    const auto* line = view.grey.ptr<float>(r);
    const auto* below = view.grey.ptr<float>(r + 1);
    for (int c = area.col; c < area.col + area.cols; ++c) {
      const float along = 0.5F * (below[c] - above[c]);
      const float across = 0.5F * (line[c + 1] - line[c - 1]);
      if (along * along + across * across < weakest * weakest) continue;
      patch.pixels.push_back({static_cast<int16_t>(r), static_cast<int16_t>(c), line[c], along, across});
      sum += line[c];
    }
  }
  if (patch.pixels.size() < kFewestPixels) return;
  finish(patch, sum / static_cast<double>(patch.pixels.size()));
}

void TextureReference::finish(Patch& patch, double mean) {
  const auto count = static_cast<double>(patch.pixels.size());
  Eigen::Vector2d gradient_sum(0, 0);
  Eigen::Vector2d gradient_grey(0, 0);
  Eigen::Vector2d centre(0, 0);
  for (Pixel& pixel : patch.pixels) {
    pixel.grey -= static_cast<float>(mean);
    const Eigen::Vector2d gradient(pixel.along, pixel.across);
    patch.normal += gradient * gradient.transpose();
    gradient_sum += gradient;
    gradient_grey += gradient * pixel.grey;
    centre += Eigen::Vector2d(pixel.row, pixel.col) * gradient.squaredNorm();
    patch.energy += pixel.grey * pixel.grey;
  }
  centre /= patch.normal.trace();
  patch.place_m = {sheet_.ahead_m(centre.x()), sheet_.offset_m(centre.y())};
  // Gain and bias are free: take what they explain out of the gradients' share (Schur complement).
  patch.normal -=
      gradient_sum * gradient_sum.transpose() / count + gradient_grey * gradient_grey.transpose() / patch.energy;
  patches_.push_back(std::move(patch));
}

TextureReference::Answer TextureReference::measure_patch(const Patch& patch, const vision::TopView& now,
                                                         const vision::Sheet& sheet, double lowest_correlation,
                                                         const Eigen::Vector2d& expected_m, PatchMotion& out) {
  const Eigen::Vector2d shift = expected_m / sheet.cell_m;
  const int row_shift = static_cast<int>(std::floor(shift.x()));
  const int col_shift = static_cast<int>(std::floor(shift.y()));
  const auto fr = static_cast<float>(shift.x() - row_shift);
  const auto fc = static_cast<float>(shift.y() - col_shift);
  const float w00 = (1 - fr) * (1 - fc);
  const float w01 = (1 - fr) * fc;
  const float w10 = fr * (1 - fc);
  const float w11 = fr * fc;
  float count = 0;
  float b = 0;
  float bb = 0;
  float ab = 0;
  float a = 0;
  float aa = 0;
  Eigen::Vector2f g(0, 0);
  Eigen::Vector2f ga(0, 0);
  Eigen::Vector2f gb(0, 0);
  for (const Pixel& pixel : patch.pixels) {
    const int row = pixel.row + row_shift;
    const int col = pixel.col + col_shift;
    if (row < 0 || row + 1 >= sheet.rows || col < 0 || col + 1 >= sheet.cols) continue;
    if (now.row_seen[static_cast<size_t>(row)] == 0 || now.row_seen[static_cast<size_t>(row) + 1] == 0) continue;
    const auto* top = now.grey.ptr<float>(row) + col;
    const auto* bottom = now.grey.ptr<float>(row + 1) + col;
    const float value = w00 * top[0] + w01 * top[1] + w10 * bottom[0] + w11 * bottom[1];
    const Eigen::Vector2f gradient(pixel.along, pixel.across);
    count += 1;
    a += pixel.grey;
    aa += pixel.grey * pixel.grey;
    b += value;
    bb += value * value;
    ab += pixel.grey * value;
    g += gradient;
    ga += gradient * pixel.grey;
    gb += gradient * value;
  }
  if (count < 0.5F * static_cast<float>(patch.pixels.size())) return Answer::out_of_sight;
  const double mean_a = a / count;
  const double mean_b = b / count;
  const double var_a = aa / count - mean_a * mean_a;
  const double var_b = bb / count - mean_b * mean_b;
  const double cov = ab / count - mean_a * mean_b;
  if (var_a <= 0 || var_b <= 0 || cov <= 0) return Answer::differs;
  out.correlation = cov / std::sqrt(var_a * var_b);
  if (out.correlation < lowest_correlation) return Answer::differs;
  // Both views are equally noisy, so the gain is the ratio of contrasts, not the regression.
  const double gain = std::sqrt(var_a / var_b);
  const Eigen::Vector2d slope = (gb - g * static_cast<float>(mean_b)).cast<double>() * gain -
                                (ga - g * static_cast<float>(mean_a)).cast<double>();
  const double share = count / static_cast<double>(patch.pixels.size());
  const Eigen::Matrix2d normal = patch.normal * share;
  const double determinant = normal.determinant();
  if (determinant <= 1e-3 * normal.trace() * normal.trace() * 0.25) return Answer::differs;
  // now(x + d) = reference(x): brightness left over is -gradient * (true - expected).
  const Eigen::Vector2d step = -normal.inverse() * slope;
  if (step.norm() > kFarthestStepCells) return Answer::differs;
  const double unexplained = 2.0 * var_a * (1.0 - out.correlation) + 0.05;
  out.place_m = patch.place_m;
  out.ballast = patch.ballast;
  out.displacement_m = expected_m + step * sheet.cell_m;
  out.information = normal / (unexplained * kCellsPerIndependent * sheet.cell_m * sheet.cell_m);
  return Answer::agrees;
}

size_t TextureReference::measure(const vision::TopView& now, const DisplacementField& expected,
                                 std::vector<PatchMotion>& out) const {
  out.clear();
  PatchMotion motion;
  size_t in_sight = 0;
  for (const Patch& patch : patches_) {
    const Answer answer =
        measure_patch(patch, now, sheet_, options_.lowest_correlation, expected(patch.place_m, patch.ballast), motion);
    if (answer != Answer::out_of_sight) ++in_sight;
    if (answer == Answer::agrees) out.push_back(motion);
  }
  return in_sight;
}

}  // namespace railfix::odometry
