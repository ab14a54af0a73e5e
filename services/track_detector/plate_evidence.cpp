#include "track_detector/plate_evidence.hpp"

#include <algorithm>
#include <cmath>

namespace railfix::track_detector {
namespace {

constexpr int kPatchCells = 2;          // of the sheet to a cell of the patch
constexpr double kPatchMarginM = 0.14;  // of ground around a plate
constexpr double kSoftPx = 0.8;         // lens and pixel, one sigma
constexpr double kSheetSigmaM = 0.014;  // the sheet's own smoothing
constexpr double kInsetM = 0.06;        // the plate's rim
constexpr double kGapM = 0.05;          // its shadow
constexpr double kStripM = 0.10;        // ground on each side
constexpr double kClearOfBlur = 2.0;    // sigmas
constexpr double kGrain = 0.08;         // metres: nearer places of the ground err together

// Log of the spread inside against the ground's, both as shares of their brightness: normal about these.
constexpr double kEvenPlate = -2.0;
constexpr double kEvenStain = 0.3;
constexpr double kEvenSigma = 0.6;
// One feature alone shall not decide.
constexpr double kMostEvenness = 6.0;
constexpr double kShapeTrust = 0.25;
constexpr double kMostShape = 3.0;
constexpr double kUsualSharpness = 0.85;  // of what the blur allows
constexpr double kSharpnessTrust = 10.0;
constexpr double kLeastSharpness = -3.0;
constexpr double kMostSharpness = 1.0;
constexpr double kDark = -3.0;     // stains and puddles are dark, few balises are
constexpr double kSurelyNot = -4;  // evenness below which the shape need not be looked at

double step(double x, double half, double sigma) {
  const double scale = 1 / (std::sqrt(2.0) * sigma);
  return 0.5 * (std::erf((x + half) * scale) - std::erf((x - half) * scale));
}

}  // namespace

double PlateBlur::along_m(double ahead_m) const {
  const double pixel_m = (ahead_m * ahead_m + height_m * height_m) / (focal_px * height_m);
  return std::hypot(kSoftPx * pixel_m, kSheetSigmaM, moved_m / std::sqrt(12.0));
}

double PlateBlur::across_m(double ahead_m) const {
  return std::hypot(kSoftPx * std::hypot(ahead_m, height_m) / focal_px, kSheetSigmaM);
}

void AreaSums::set(const cv::Mat& grey) {
  step_ = static_cast<size_t>(grey.cols) + 1;
  const size_t size = step_ * (static_cast<size_t>(grey.rows) + 1);
  sums_.resize(size);
  squared_.resize(size);
  std::fill(sums_.begin(), sums_.begin() + static_cast<ptrdiff_t>(step_), 0.0);
  std::fill(squared_.begin(), squared_.begin() + static_cast<ptrdiff_t>(step_), 0.0);
  for (int r = 0; r < grey.rows; ++r) {
    const auto* line = grey.ptr<float>(r);
    double* sum = sums_.data() + static_cast<size_t>(r + 1) * step_;
    double* squared = squared_.data() + static_cast<size_t>(r + 1) * step_;
    double row_sum = 0;
    double row_squared = 0;
    sum[0] = squared[0] = 0;
    for (size_t c = 1; c < step_; ++c) {
      const auto value = static_cast<double>(line[c - 1]);
      row_sum += value;
      row_squared += value * value;
      sum[c] = *(sum + c - step_) + row_sum;
      squared[c] = *(squared + c - step_) + row_squared;
    }
  }
}

double AreaSums::of(const std::vector<double>& sums, const CellBox& box) const {
  const double* top = sums.data() + static_cast<size_t>(box.row) * step_ + box.col;
  const double* bottom = top + static_cast<size_t>(box.rows) * step_;
  return bottom[box.cols] - bottom[0] - top[box.cols] + top[0];
}

double AreaSums::spread(const CellBox& box) const {
  const double m = mean(box);
  return std::sqrt(std::max(0.0, of(squared_, box) / (box.rows * box.cols) - m * m));
}

PlateEvidence::PlateEvidence(const vision::Sheet& sheet, const LandmarkOptions& options)
    : sheet_(sheet),
      half_length_m_(0.5 * options.balise_length_m),
      half_width_m_(0.5 * options.balise_width_m),
      cell_m_(kPatchCells * sheet.cell_m),
      rows_(static_cast<int>(std::lround(2 * (half_length_m_ + kPatchMarginM) / cell_m_))),
      cols_(static_cast<int>(std::lround(2 * (half_width_m_ + kPatchMarginM) / cell_m_))),
      patch_(static_cast<size_t>(rows_ * cols_)),
      across_(static_cast<size_t>(cols_)) {}

std::optional<double> PlateEvidence::of(const AreaSums& sums, const PlateSpot& spot, const PlateBlur& blur) {
  if (!take_patch(sums, spot)) return std::nullopt;
  const double sigma_s_m = blur.along_m(spot.ahead_m);
  const double sigma_d_m = blur.across_m(spot.ahead_m);
  const double even = std::clamp(evenness(sums, spot, blur), -kMostEvenness, kMostEvenness);
  const double shaped =
      even < kSurelyNot ? -kMostShape : std::clamp(kShapeTrust * shape(sigma_s_m, sigma_d_m), -kMostShape, kMostShape);
  const double possible = std::erf(kEdgeM / (std::sqrt(2.0) * sigma_d_m));
  const double sharp =
      std::clamp(kSharpnessTrust * (spot.sharpness / possible - kUsualSharpness), kLeastSharpness, kMostSharpness);
  return even + shaped + sharp + (spot.sign > 0 ? 0 : kDark);
}

// A plate hides the ground's texture; through a stain it shows.
double PlateEvidence::evenness(const AreaSums& sums, const PlateSpot& spot, const PlateBlur& blur) const {
  const auto cells = [this](double m) { return static_cast<int>(std::lround(m / sheet_.cell_m)); };
  const int row = static_cast<int>(std::lround(spot.row));
  const int col = static_cast<int>(std::lround(spot.col));
  const double soft_s_m = kClearOfBlur * blur.along_m(spot.ahead_m);
  const double soft_d_m = kClearOfBlur * blur.across_m(spot.ahead_m);
  const int half_rows = std::max(1, cells(half_length_m_ - std::max(kInsetM, 0.02 + soft_s_m)));
  const int half_cols = std::max(1, cells(half_width_m_ - std::max(kInsetM, 0.02 + soft_d_m)));
  const CellBox inside{row - half_rows, col - half_cols, 2 * half_rows + 1, 2 * half_cols + 1};
  const int strip = cells(kStripM);
  const int beyond_rows = cells(half_length_m_ + std::max(kGapM, soft_s_m));
  const int beyond_cols = cells(half_width_m_ + std::max(kGapM, soft_d_m));
  const CellBox sides[] = {{row - beyond_rows - strip, inside.col, strip, inside.cols},
                           {row + beyond_rows + 1, inside.col, strip, inside.cols},
                           {inside.row, col - beyond_cols - strip, inside.rows, strip},
                           {inside.row, col + beyond_cols + 1, inside.rows, strip}};
  double ground = 0;
  int count = 0;
  for (const CellBox& side : sides) {
    if (side.row < 0 || side.col < 0 || side.row + side.rows > sheet_.rows || side.col + side.cols > sheet_.cols)
      continue;
    ground += sums.spread(side) / std::max(1.0, sums.mean(side));
    ++count;
  }
  if (count == 0) return -kMostEvenness;
  const double plate = sums.spread(inside) / std::max(1.0, sums.mean(inside));
  const double x = std::log(std::max(plate, 1e-3) * count / std::max(ground, 1e-3));
  const double plate_off = x - kEvenPlate;
  const double stain_off = x - kEvenStain;
  return (stain_off * stain_off - plate_off * plate_off) / (2 * kEvenSigma * kEvenSigma);
}

// The patch around a plate; false where it leaves the sheet.
bool PlateEvidence::take_patch(const AreaSums& sums, const PlateSpot& spot) {
  const int first_row = static_cast<int>(std::lround(spot.row - 0.5 * (kPatchCells * rows_ - 1)));
  const int first_col = static_cast<int>(std::lround(spot.col - 0.5 * (kPatchCells * cols_ - 1)));
  if (first_row < 0 || first_col < 0 || first_row + kPatchCells * rows_ > sheet_.rows ||
      first_col + kPatchCells * cols_ > sheet_.cols) {
    return false;
  }
  double mean = 0;
  size_t k = 0;
  for (int r = 0; r < rows_; ++r) {
    for (int c = 0; c < cols_; ++c, ++k) {
      patch_[k] = sums.mean({first_row + kPatchCells * r, first_col + kPatchCells * c, kPatchCells, kPatchCells});
      mean += patch_[k];
    }
  }
  mean /= static_cast<double>(k);
  squares_ = 1e-9;
  for (double& value : patch_) {
    value -= mean;
    squares_ += value * value;
  }
  return true;
}

// A blurred rectangle of the plate's size against rectangles of other sizes and soft and sharp ellipses.
double PlateEvidence::shape(double along_sigma_m, double across_sigma_m) {
  const double plate = rectangle_rest(half_length_m_, half_width_m_, along_sigma_m, across_sigma_m);
  double other = 1;
  for (const double length : {0.6, 1.0, 1.5, 3.0}) {
    for (const double width : {0.6, 1.0, 1.5}) {
      if (length == 1.0 && width == 1.0) continue;
      other = std::min(other,
                       rectangle_rest(length * half_length_m_, width * half_width_m_, along_sigma_m, across_sigma_m));
    }
  }
  for (const double length : {0.9, 1.2, 1.7, 2.3, 3.9}) {
    for (const double width : {0.75, 1.0, 1.25, 1.6}) {
      for (const double steepness : {1.2, 2.5, 6.0})
        other = std::min(other, ellipse_rest(length * half_length_m_, width * half_width_m_, steepness));
    }
  }
  const double grain_s_m = std::max(kGrain, 2 * along_sigma_m);
  const double grain_d_m = std::max(kGrain, 2 * across_sigma_m);
  const double independent = static_cast<double>(patch_.size()) * cell_m_ * cell_m_ / (grain_s_m * grain_d_m);
  return 0.5 * independent * std::log(other / plate);
}

double PlateEvidence::rectangle_rest(double half_s_m, double half_d_m, double sigma_s_m, double sigma_d_m) {
  double across = 0, across_squares = 0;
  for (int c = 0; c < cols_; ++c) {
    const double v = step(across_m(c), half_d_m, sigma_d_m);
    across_[static_cast<size_t>(c)] = v;
    across += v;
    across_squares += v * v;
  }
  double along = 0, along_squares = 0, product = 0;
  for (int r = 0; r < rows_; ++r) {
    const double v = step(along_m(r), half_s_m, sigma_s_m);
    const double* line = patch_.data() + r * cols_;
    double sum = 0;
    for (int c = 0; c < cols_; ++c) sum += line[c] * across_[static_cast<size_t>(c)];
    along += v;
    along_squares += v * v;
    product += v * sum;
  }
  return rest(along * across, along_squares * across_squares, product);
}

double PlateEvidence::ellipse_rest(double half_s_m, double half_d_m, double steepness) const {
  double sum = 0, squares = 0, product = 0;
  const double* cell = patch_.data();
  for (int r = 0; r < rows_; ++r) {
    const double s = along_m(r) / half_s_m;
    for (int c = 0; c < cols_; ++c, ++cell) {
      const double d = across_m(c) / half_d_m;
      const double v = std::clamp(steepness * (1 - s * s - d * d), 0.0, 1.0);
      sum += v;
      squares += v * v;
      product += v * *cell;
    }
  }
  return rest(sum, squares, product);
}

// Share of the patch's squares that a shape leaves when its height is fitted.
double PlateEvidence::rest(double sum, double squares, double product) const {
  const double spread = squares - sum * sum / static_cast<double>(patch_.size());
  return spread < 1e-9 ? 1.0 : std::max(1e-3, 1 - product * product / (spread * squares_));
}

}  // namespace railfix::track_detector
