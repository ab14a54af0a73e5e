#include "track_detector/plate_search.hpp"

#include <algorithm>
#include <cmath>

namespace railfix::track_detector {
namespace {

constexpr double kInsetM = 0.06;      // the plate's rim, blurred by distance, is left out of its mean
constexpr double kGapM = 0.05;        // around the plate: its shadow and blur
constexpr double kStripM = 0.10;      // ground compared on each side
constexpr double kOffCentreM = 0.06;  // a balise lies in the middle of the track
constexpr double kSizeToleranceM = 0.09;
constexpr double kEvenness = 0.75;     // spread inside, as a share of the weakest contrast
constexpr double kEdgeM = 0.03;        // a plate's edge is made within so much to either side ...
constexpr double kBesideEdgeM = 0.10;  // ... of what the brightness changes within this
constexpr double kSharpEdge = 0.7;
constexpr double kRimM = 0.03;
constexpr double kCornerM = 0.07;
constexpr double kFullCorners = 0.85;
constexpr double kDarkGrey = 12;  // below it shares of brightness mean nothing

// The plate's box and its surroundings around a centre, in cells.
struct Layout {
  int half_rows, half_cols, inset, gap, strip;
  Layout(const LandmarkOptions& options, double cell_m)
      : half_rows(static_cast<int>(std::lround(0.5 * options.balise_length_m / cell_m))),
        half_cols(static_cast<int>(std::lround(0.5 * options.balise_width_m / cell_m))),
        inset(static_cast<int>(std::lround(kInsetM / cell_m))),
        gap(static_cast<int>(std::lround(kGapM / cell_m))),
        strip(static_cast<int>(std::lround(kStripM / cell_m))) {}
};

// Signed contrast of the weakest side, share of brightness; nothing when the sides disagree or the inside is uneven.
std::optional<double> plate_contrast(const AreaSums& sums, const Layout& l, int row, int col, double lowest) {
  const CellBox inside{row - l.half_rows + l.inset, col - l.half_cols + l.inset, 2 * (l.half_rows - l.inset) + 1,
                       2 * (l.half_cols - l.inset) + 1};
  const double grey = sums.mean(inside);
  const int rows = inside.rows;
  const int cols = inside.cols;
  const double sides[4] = {sums.mean({row - l.half_rows - l.gap - l.strip, inside.col, l.strip, cols}),
                           sums.mean({row + l.half_rows + l.gap + 1, inside.col, l.strip, cols}),
                           sums.mean({inside.row, col - l.half_cols - l.gap - l.strip, rows, l.strip}),
                           sums.mean({inside.row, col + l.half_cols + l.gap + 1, rows, l.strip})};
  const double sign = grey > sides[0] ? 1.0 : -1.0;
  double weakest = 1e9;
  double brightest = grey;
  for (const double side : sides) {
    weakest = std::min(weakest, sign * (grey - side));
    brightest = std::max(brightest, side);
  }
  if (brightest < kDarkGrey || weakest < lowest * brightest) return std::nullopt;
  if (sums.spread(inside) > kEvenness * weakest) return std::nullopt;
  return sign * weakest / brightest;
}

// Place of the steepest step of this sign in a profile near `at`, to a fraction of a cell.
std::optional<double> find_edge(const std::vector<double>& profile, int at, int reach, double sign) {
  int best = -1;
  double steepest = 0;
  const auto slope = [&](int i) {
    return sign * (profile[static_cast<size_t>(i) + 1] - profile[static_cast<size_t>(i) - 1]);
  };
  for (int i = std::max(2, at - reach); i <= std::min(static_cast<int>(profile.size()) - 3, at + reach); ++i) {
    if (slope(i) > steepest) {
      steepest = slope(i);
      best = i;
    }
  }
  if (best < 0) return std::nullopt;
  const double before = slope(best - 1);
  const double after = slope(best + 1);
  const double bend = before - 2 * steepest + after;
  return bend < 0 ? best + std::clamp(0.5 * (before - after) / bend, -0.5, 0.5) : best;
}

struct Extent {
  double middle;
  double length;
  double sharpness;  // of the softer edge: share of the step from outside to inside that it makes within kEdgeM
};

double at(const std::vector<double>& profile, double place) {
  const double inside = std::clamp(place, 0.0, static_cast<double>(profile.size()) - 1.001);
  const auto i = static_cast<size_t>(inside);
  const double f = inside - static_cast<double>(i);
  return (1 - f) * profile[i] + f * profile[i + 1];
}

double edge_sharpness(const std::vector<double>& profile, double edge, double inwards, double reach, double far) {
  const double step = at(profile, edge + inwards * far) - at(profile, edge - inwards * far);
  return step == 0 ? 0 : (at(profile, edge + inwards * reach) - at(profile, edge - inwards * reach)) / step;
}

// Both edges of the plate in a profile through it.
std::optional<Extent> measure_extent(const std::vector<double>& profile, int centre, int half, int reach, double sign,
                                     double cell_m) {
  const auto low = find_edge(profile, centre - half, reach, sign);
  const auto high = find_edge(profile, centre + half, reach, -sign);
  if (!low || !high) return std::nullopt;
  const double near = kEdgeM / cell_m;
  const double far = kBesideEdgeM / cell_m;
  return Extent{0.5 * (*low + *high), *high - *low,
                std::min(edge_sharpness(profile, *low, 1, near, far), edge_sharpness(profile, *high, -1, near, far))};
}

// How much the emptiest corner has of the contrast of the middle against both sides: a plate fills its corners, a stain
// does not.
double corner_fill(const AreaSums& sums, const Layout& l, const vision::Sheet& sheet, const Extent& length,
                   const Extent& width) {
  const double cell_m = sheet.cell_m;
  const int row = static_cast<int>(std::lround(length.middle));
  const int col = static_cast<int>(std::lround(width.middle));
  const int half_rows = static_cast<int>(0.5 * length.length);
  const int half_cols = static_cast<int>(0.5 * width.length);
  const int rim = static_cast<int>(std::lround(kRimM / cell_m));
  const int corner = std::max(1, static_cast<int>(std::lround(kCornerM / cell_m)));
  const int beside = half_cols + l.gap + l.strip;
  // A wide plate off the middle may reach so far that its sides are not in the sheet: then nothing is known of it.
  if (col < beside || col + beside >= sheet.cols) return 0.0;
  const double middle = sums.mean({row - half_rows / 2, col - half_cols / 2, half_rows, half_cols});
  const double side = 0.5 * (sums.mean({row - half_rows / 2, col - half_cols - l.gap - l.strip, half_rows, l.strip}) +
                             sums.mean({row - half_rows / 2, col + half_cols + l.gap + 1, half_rows, l.strip}));
  double emptiest = 1.0;
  for (const int top : {row - half_rows + rim, row + half_rows - rim - corner}) {
    for (const int left : {col - half_cols + rim, col + half_cols - rim - corner}) {
      emptiest = std::min(emptiest, (sums.mean({top, left, corner, corner}) - side) / (middle - side));
    }
  }
  return emptiest;
}

}  // namespace

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

PlateSearch::PlateSearch(const vision::Sheet& sheet, const LandmarkOptions& options)
    : sheet_(sheet),
      options_(options),
      along_(static_cast<size_t>(sheet.rows)),
      across_(static_cast<size_t>(sheet.cols)) {
  hits_.reserve(static_cast<size_t>(sheet.rows * (2 * static_cast<int>(kOffCentreM / sheet.cell_m) + 1)));
  found_.reserve(64);
}

std::optional<GroundCandidate> PlateSearch::refine(const cv::Mat& grey, const Hit& hit) {
  const Layout l(options_, sheet_.cell_m);
  const double sign = hit.contrast > 0 ? 1.0 : -1.0;
  const int reach = static_cast<int>(std::lround(0.10 / sheet_.cell_m));
  std::fill(along_.begin(), along_.end(), 0.0);
  std::fill(across_.begin(), across_.end(), 0.0);
  const int in_cols = l.half_cols - l.inset;
  const int in_rows = l.half_rows - l.inset;
  for (int r = std::max(0, hit.row - 3 * l.half_rows); r < std::min(grey.rows, hit.row + 3 * l.half_rows); ++r) {
    const auto* line = grey.ptr<float>(r);
    for (int c = hit.col - in_cols; c <= hit.col + in_cols; ++c) along_[static_cast<size_t>(r)] += line[c];
    along_[static_cast<size_t>(r)] /= 2.0 * in_cols + 1.0;
  }
  for (int r = hit.row - in_rows; r <= hit.row + in_rows; ++r) {
    const auto* line = grey.ptr<float>(r);
    for (int c = 0; c < grey.cols; ++c) across_[static_cast<size_t>(c)] += line[c] / (2.0 * in_rows + 1.0);
  }
  const auto length = measure_extent(along_, hit.row, l.half_rows, reach, sign, sheet_.cell_m);
  const auto width = measure_extent(across_, hit.col, l.half_cols, reach, sign, sheet_.cell_m);
  if (!length || !width) return std::nullopt;
  if (std::abs(length->length * sheet_.cell_m - options_.balise_length_m) > kSizeToleranceM) return std::nullopt;
  if (std::abs(width->length * sheet_.cell_m - options_.balise_width_m) > kSizeToleranceM) return std::nullopt;
  if (std::abs(sheet_.offset_m(width->middle)) > kOffCentreM) return std::nullopt;
  if (width->sharpness < kSharpEdge || corner_fill(sums_, l, sheet_, *length, *width) < kFullCorners)
    return std::nullopt;
  return GroundCandidate{sheet_.ahead_m(length->middle), sheet_.offset_m(width->middle), std::abs(hit.contrast)};
}

const std::vector<GroundCandidate>& PlateSearch::find(const vision::TopView& view) {
  found_.clear();
  hits_.clear();
  const Layout l(options_, sheet_.cell_m);
  sums_.set(view.grey);
  const int row_margin = l.half_rows + l.gap + l.strip + 1;
  const int col_margin = l.half_cols + l.gap + l.strip + 1;
  const int off = static_cast<int>(kOffCentreM / sheet_.cell_m);
  const int middle = (sheet_.cols - 1) / 2;
  for (int row = row_margin; row < sheet_.rows - row_margin; ++row) {
    if (view.row_seen[static_cast<size_t>(row - row_margin)] == 0 ||
        view.row_seen[static_cast<size_t>(row + row_margin)] == 0) {
      continue;
    }
    for (int col = std::max(col_margin, middle - off); col <= std::min(sheet_.cols - 1 - col_margin, middle + off);
         ++col) {
      if (const auto contrast = plate_contrast(sums_, l, row, col, options_.lowest_contrast)) {
        hits_.push_back({row, col, *contrast});
      }
    }
  }
  std::sort(hits_.begin(), hits_.end(),
            [](const Hit& a, const Hit& b) { return std::abs(a.contrast) > std::abs(b.contrast); });
  for (const Hit& hit : hits_) {
    const double ahead_m = sheet_.ahead_m(hit.row);
    const bool known = std::any_of(found_.begin(), found_.end(), [&](const GroundCandidate& plate) {
      return std::abs(plate.ahead_m - ahead_m) < 2.0 * options_.balise_length_m;
    });
    if (known) continue;
    if (const auto plate = refine(view.grey, hit)) found_.push_back(*plate);
  }
  return found_;
}

}  // namespace railfix::track_detector
