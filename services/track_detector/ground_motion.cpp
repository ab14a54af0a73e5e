#include "track_detector/ground_motion.hpp"

#include <algorithm>
#include <cmath>

#include "core/time.hpp"

namespace railfix::track_detector {
namespace {

constexpr int kStrips = 8;
constexpr int kRowsPerCell = 2;
constexpr double kSlowM = 0.5;         // changes over longer ways are light, not texture
constexpr double kWindowM = 0.24;      // around the predicted step: less than half a sleeper spacing
constexpr double kLowestMatch = 0.35;  // correlation
constexpr double kFirstMatch = 0.5;    // ... of a step that is believed without a prediction
constexpr double kAgreeMps2 = 4.0;
constexpr double kAgreeM = 0.03;
constexpr double kSpeedHoldsS = 0.15;  // one bad match, as over points, must not lead to the next sleeper
constexpr int64_t kPatienceNs = core::kNsPerSecond;
constexpr double kLongestGapS = 0.5;  // of pictures; the speed may have changed by more than the window
constexpr int64_t kLookElsewhereNs = core::kNsPerSecond / 2;
constexpr double kBetterBy = 0.05;  // in correlation (0.97, and 0.7 to 0.88 at the next sleeper), ...
constexpr int kBetterLooks = 2;     // ... so often
constexpr int kFewestRows = 40;

}  // namespace

void GroundMotion::forget() {
  rows_ = 0;
  locked_ = false;
  speed_mps_.reset();
}

void GroundMotion::take_profile(const vision::TopView& view, const vision::Sheet& sheet) {
  const int rows = sheet.rows / kRowsPerCell;
  const int width = sheet.cols / kStrips;
  const int slow = static_cast<int>(std::lround(kSlowM / (kRowsPerCell * sheet.cell_m)));
  now_.assign(static_cast<size_t>(kStrips * rows), 0.0F);
  raw_.resize(static_cast<size_t>(rows));
  sums_.resize(static_cast<size_t>(rows) + 1);
  for (int strip = 0; strip < kStrips; ++strip) {
    for (int row = 0; row < rows; ++row) {
      double sum = 0;
      for (int k = 0; k < kRowsPerCell; ++k) {
        const auto* line = view.grey.ptr<float>(row * kRowsPerCell + k) + strip * width;
        for (int c = 0; c < width; ++c) sum += static_cast<double>(line[c]);
      }
      raw_[static_cast<size_t>(row)] = sum / (width * kRowsPerCell);
      sums_[static_cast<size_t>(row) + 1] = sums_[static_cast<size_t>(row)] + raw_[static_cast<size_t>(row)];
    }
    for (int row = 0; row < rows; ++row) {
      if (view.row_seen[static_cast<size_t>(row * kRowsPerCell)] == 0) continue;
      const int first = std::max(0, row - slow);
      const int last = std::min(rows, row + slow + 1);
      const double mean = (sums_[static_cast<size_t>(last)] - sums_[static_cast<size_t>(first)]) / (last - first);
      now_[static_cast<size_t>(strip * rows + row)] =
          static_cast<float>((raw_[static_cast<size_t>(row)] - mean) / (mean + 4.0));
    }
  }
  rows_ = rows;
}

double GroundMotion::correlation(int shift) const {
  const int first = std::max(0, -shift);
  const int last = std::min(rows_, rows_ - shift);
  if (last - first < kFewestRows) return -1;
  float product = 0;
  float now2 = 1e-6F;
  float before2 = 1e-6F;
  for (int strip = 0; strip < kStrips; ++strip) {
    const float* a = &now_[static_cast<size_t>(strip * rows_)];
    const float* b = &before_[static_cast<size_t>(strip * rows_)] + shift;
    for (int row = first; row < last; ++row) {
      product += a[row] * b[row];
      now2 += a[row] * a[row];
      before2 += b[row] * b[row];
    }
  }
  return static_cast<double>(product) / std::sqrt(static_cast<double>(now2) * static_cast<double>(before2));
}

GroundMotion::Match GroundMotion::match(double from_m, double to_m, double cell_m) const {
  const auto first_shift = static_cast<int>(std::lround(from_m / cell_m));
  const auto last_shift = static_cast<int>(std::lround(to_m / cell_m));
  int best = first_shift;
  double highest = -1;
  for (int shift = first_shift; shift <= last_shift; ++shift) {
    const double value = correlation(shift);
    if (value > highest) {
      highest = value;
      best = shift;
    }
  }
  const double low = correlation(best - 1);
  const double high = correlation(best + 1);
  const double bend = low - 2 * highest + high;
  const double part = bend < 0 && low > -1 && high > -1 ? std::clamp(0.5 * (low - high) / bend, -0.5, 0.5) : 0.0;
  return {(best + part) * cell_m, highest};
}

GroundMotion::Match GroundMotion::match_anywhere(double dt_s, double cell_m) const {
  return match(-kWindowM, std::min(max_speed_mps_ * dt_s, rows_ * cell_m), cell_m);
}

// A step that is wrong by the distance of sleepers fits for ever, but the ballast between them does not.
bool GroundMotion::fits_better_elsewhere(const Match& found, double dt_s, double cell_m) {
  if (stamp_ns_ - looked_elsewhere_ns_ < kLookElsewhereNs) return false;
  looked_elsewhere_ns_ = stamp_ns_;
  const Match any = match_anywhere(dt_s, cell_m);
  const bool better = any.correlation > std::max(found.correlation + kBetterBy, kFirstMatch);
  better_elsewhere_ = better ? better_elsewhere_ + 1 : 0;
  if (better_elsewhere_ < kBetterLooks) return false;
  better_elsewhere_ = 0;
  return true;
}

std::optional<double> GroundMotion::step(const vision::TopView& view, const vision::Sheet& sheet, int64_t stamp_ns) {
  std::swap(now_, before_);
  const bool first = rows_ == 0;
  take_profile(view, sheet);
  const double dt_s = core::seconds(stamp_ns - stamp_ns_);
  stamp_ns_ = stamp_ns;
  if (first || dt_s <= 0 || dt_s > kLongestGapS || before_.size() != now_.size()) {
    speed_mps_.reset();
    locked_ = false;
    measured_ns_ = stamp_ns;
    return std::nullopt;
  }
  const double cell_m = kRowsPerCell * sheet.cell_m;
  if (locked_) {
    const double expected_m = *speed_mps_ * dt_s;
    const Match found = match(expected_m - kWindowM, expected_m + kWindowM, cell_m);
    const bool lost = fits_better_elsewhere(found, dt_s, cell_m);
    if (!lost && found.correlation > kLowestMatch) {
      *speed_mps_ += (1 - std::exp(-dt_s / kSpeedHoldsS)) * (found.metres / dt_s - *speed_mps_);
      measured_ns_ = stamp_ns;
      return found.metres;
    }
    if (!lost && stamp_ns - measured_ns_ < kPatienceNs) return expected_m;
    locked_ = false;
    speed_mps_.reset();
    return std::nullopt;
  }
  const Match found = match_anywhere(dt_s, cell_m);
  if (found.correlation < kFirstMatch) {
    speed_mps_.reset();
    return std::nullopt;
  }
  const double speed_mps = found.metres / dt_s;
  locked_ = speed_mps_ && std::abs(speed_mps - *speed_mps_) * dt_s < kAgreeM + kAgreeMps2 * dt_s * dt_s;
  speed_mps_ = speed_mps;
  measured_ns_ = looked_elsewhere_ns_ = stamp_ns;
  return locked_ ? std::optional<double>(found.metres) : std::nullopt;
}

}  // namespace railfix::track_detector
