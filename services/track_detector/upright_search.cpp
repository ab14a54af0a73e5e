#include "track_detector/upright_search.hpp"

#include <algorithm>
#include <cmath>

namespace railfix::track_detector {
namespace {

constexpr int kRows = 22;
constexpr double kRowSlope = 0.004;      // rise per metre ahead between two rows
constexpr double kHighestSlope = -0.02;  // of the uppermost row, where the picture reaches so far up
constexpr double kShakeSlope = 0.012;
constexpr double kCellPx = 1.15;
constexpr double kWidestBearing = 0.75;
constexpr double kLeanStep = 0.025;
constexpr double kFading = 0.85;
constexpr int kEdge = 2;                // columns on each side that are compared
constexpr float kLeastContrast = 3.0F;  // grey levels
constexpr float kLeastScore = 5.0F;     // of the mean step against its scatter over the rows
constexpr float kHintScore = 3.0F;
constexpr float kScoreNoise = 0.3F;

constexpr size_t kUpright = 4;          // index of no lean
constexpr double kNothingClear = 20.0;  // grey levels

constexpr double kWall[] = {0.75, 0.94};  // of an edge's bearing: so much farther away, if it is a wall along the track
constexpr double kDeep[] = {0.3, 0.5};
constexpr double kBeside[] = {0.6, 0.95};  // of the widest bearing

double lean_of(size_t index) {
  return (static_cast<double>(index) - static_cast<double>(kUpright)) * kLeanStep;
}

}  // namespace

UprightSearch::UprightSearch(const geometry::Intrinsics& camera)
    : lines_(camera), cell_(kCellPx / camera.fu_px), columns_(2 * static_cast<int>(kWidestBearing / cell_) + 1) {
  grey_.create(kRows, columns_, CV_32F);
  step_.create(kRows, columns_, CV_32F);
  for (auto* row : {&profile_.step, &squared_, &profile_.score, &profile_.half_step[0], &profile_.half_step[1]}) {
    row->resize(static_cast<size_t>(columns_));
  }
  profile_.cell = cell_;
  found_.reserve(200);
  lean_ = kUpright;
}

const std::vector<UprightEdge>& UprightSearch::find(const LandmarkPicture& picture) {
  found_.clear();
  look(picture);
  differentiate();
  look_beside();
  size_t best = lean_;
  for (size_t index = lean_ > 0 ? lean_ - 1 : 0; index <= std::min(lean_ + 1, clear_.size() - 1); ++index) {
    sum_up(lean_of(index));
    clear_[index] = kFading * clear_[index] + clearness();
    if (clear_[index] > 1.02 * clear_[best]) best = index;
  }
  if (clear_[best] < kNothingClear) best = lean_ > kUpright ? lean_ - 1 : std::min(lean_ + 1, kUpright);
  lean_ = best;
  sum_up(lean_of(lean_));
  sum_up_halves();
  collect();
  pair();
  return found_;
}

double UprightSearch::slope_of(int row) const {
  return top_slope_ - (kRows - 1 - row) * kRowSlope;
}

int UprightSearch::shift_of(int row, double lean) const {
  return static_cast<int>(std::lround(lean * slope_of(row) / cell_));
}

void UprightSearch::look(const LandmarkPicture& picture) {
  const auto& camera = lines_.camera();
  // The uppermost row lies in the picture even when the camera pitches.
  const double reach = picture.pose.pitch_rad - std::atan((camera.cv_px - 2) / camera.fv_px);
  top_slope_ = std::min(kHighestSlope, -std::tan(reach) - kShakeSlope);
  const Eigen::Matrix3d camera_from_track = geometry::rotation_camera_from_track(picture.pose);
  const double right = -0.5 * (columns_ - 1) * cell_;
  for (int row = 0; row < kRows; ++row) {
    const double slope = slope_of(row);
    lines_.sample(picture.grey, (camera_from_track * Eigen::Vector3d(1, right, slope)).cast<float>(),
                  (camera_from_track * Eigen::Vector3d(0, cell_, 0)).cast<float>(), columns_, grey_.ptr<float>(row));
  }
}

void UprightSearch::differentiate() {
  int first = 0;
  int last = columns_ - 1;
  for (const int row : {0, kRows - 1}) {
    const float* grey = grey_.ptr<float>(row);
    while (first < last && grey[first] < 0) ++first;
    while (last > first && grey[last] < 0) --last;
  }
  profile_.widest = (0.5 * (columns_ - 1) - std::max(first, columns_ - 1 - last) - 2 * kEdge) * cell_;
  for (int row = 0; row < kRows; ++row) {
    const float* grey = grey_.ptr<float>(row);
    float* step = step_.ptr<float>(row);
    std::fill(step, step + columns_, 0.0F);
    for (int c = first + kEdge; c <= last - kEdge; ++c) {
      step[c] = (grey[c + 1] + grey[c + 2] - grey[c - 1] - grey[c - 2]) * (1.0F / kEdge);
    }
  }
}

void UprightSearch::look_beside() {
  const double left = mean_grey(profile_.widest, kBeside);
  const double right = mean_grey(-profile_.widest, kBeside);
  profile_.beside_grey = std::max(0.0, std::min(left, right));
}

void UprightSearch::sum_up(double lean) {
  auto& sum = profile_.step;
  std::fill(sum.begin(), sum.end(), 0.0F);
  std::fill(squared_.begin(), squared_.end(), 0.0F);
  for (int row = 0; row < kRows; ++row) {
    const int shift = shift_of(row, lean);
    const float* step = step_.ptr<float>(row);
    const int first = std::max(0, -shift);
    const int last = std::min(columns_, columns_ - shift);
    for (int c = first; c < last; ++c) {
      const float value = step[c + shift];
      sum[static_cast<size_t>(c)] += value;
      squared_[static_cast<size_t>(c)] += value * value;
    }
  }
  for (size_t c = 0; c < sum.size(); ++c) {
    const float mean = sum[c] = sum[c] * (1.0F / kRows);
    const float variance = std::max(0.0F, squared_[c] * (1.0F / kRows) - mean * mean);
    profile_.score[c] = mean / (std::sqrt(variance * (1.0F / kRows)) + kScoreNoise);
  }
}

void UprightSearch::sum_up_halves() {
  for (auto& half : profile_.half_step) std::fill(half.begin(), half.end(), 0.0F);
  for (int row = 0; row < kRows; ++row) {
    auto& half = profile_.half_step[2 * row < kRows ? 0 : 1];
    const int shift = shift_of(row, lean_of(lean_));
    const float* step = step_.ptr<float>(row);
    const int last = std::min(columns_, columns_ - shift);
    for (int c = std::max(0, -shift); c < last; ++c) {
      half[static_cast<size_t>(c)] += step[c + shift] * (2.0F / kRows);
    }
  }
}

double UprightSearch::clearness() const {
  double sum = 0;
  for (size_t c = 0; c < profile_.score.size(); ++c) {
    const float over = std::abs(profile_.score[c]) - kHintScore;
    if (over > 0) sum += static_cast<double>(over * std::abs(profile_.step[c]));
  }
  return sum;
}

void UprightSearch::collect() {
  for (int c = kEdge; c < columns_ - kEdge; ++c) {
    const auto at = [&](int k) { return std::abs(profile_.step[static_cast<size_t>(k)]); };
    if (at(c) < kLeastContrast || std::abs(profile_.score[static_cast<size_t>(c)]) < kLeastScore) continue;
    bool top = true;
    for (int k = 1; k <= kEdge && top; ++k) top = at(c) > at(c - k) && at(c) >= at(c + k);
    if (!top) continue;
    const double low = static_cast<double>(at(c - 1));
    const double high = static_cast<double>(at(c + 1));
    const double bend = low - 2.0 * static_cast<double>(at(c)) + high;
    const double part = bend < 0 ? std::clamp(0.5 * (low - high) / bend, -0.5, 0.5) : 0.0;
    const double bearing = profile_.bearing(c + part);
    const int outward = bearing > 0 ? 2 : -2;
    found_.push_back({bearing, column_grey(c - outward), column_grey(c + outward), mean_grey(bearing, kWall),
                      mean_grey(bearing, kDeep)});
  }
}

void UprightSearch::pair() {
  for (size_t i = 1; i < found_.size(); ++i) {
    UprightEdge& a = found_[i - 1];
    UprightEdge& b = found_[i];
    const bool left = b.bearing > 0;
    if ((a.bearing > 0) != left || (a.contrast() > 0) == (b.contrast() > 0)) continue;
    (left ? a.outward : a.inward) = b.bearing - a.bearing;
    (left ? b.inward : b.outward) = b.bearing - a.bearing;
  }
}

double UprightSearch::column_grey(int column) const {
  double sum = 0;
  for (int row = 0; row < kRows; ++row) {
    const int c = column + shift_of(row, lean_of(lean_));
    sum += static_cast<double>(grey_.ptr<float>(row)[std::clamp(c, 0, columns_ - 1)]);
  }
  return sum / kRows;
}

double UprightSearch::mean_grey(double bearing, const double (&share)[2]) const {
  const double from = profile_.column(share[bearing > 0 ? 0 : 1] * bearing);
  const double to = profile_.column(share[bearing > 0 ? 1 : 0] * bearing);
  const int first = static_cast<int>(std::lround(from));
  const int last = static_cast<int>(std::lround(to));
  if (first < 0 || last >= columns_ || last < first) return -1;
  double sum = 0;
  int count = 0;
  for (int row = 0; row < kRows; row += 3) {
    const float* grey = grey_.ptr<float>(row);
    for (int c = first; c <= last; ++c, ++count) {
      if (grey[c] < 0) return -1;
      sum += static_cast<double>(grey[c]);
    }
  }
  return sum / count;
}

}  // namespace railfix::track_detector
