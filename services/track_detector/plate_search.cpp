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
constexpr double kEvenness = 0.75;  // spread inside, as a share of the weakest contrast
constexpr double kDarkGrey = 12;    // below it shares of brightness mean nothing

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
  const int first = std::max(2, at - reach);
  const int last = std::min(static_cast<int>(profile.size()) - 3, at + reach);
  for (int i = first; i <= last; ++i) {
    if (slope(i) > steepest) {
      steepest = slope(i);
      best = i;
    }
  }
  if (best <= first || best >= last) return std::nullopt;  // it goes on beyond
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

}  // namespace

PlateSearch::PlateSearch(const vision::Sheet& sheet, const LandmarkOptions& options)
    : sheet_(sheet),
      options_(options),
      evidence_(sheet, options),
      along_(static_cast<size_t>(sheet.rows)),
      across_(static_cast<size_t>(sheet.cols)) {
  hits_.reserve(static_cast<size_t>(sheet.rows * (2 * static_cast<int>(kOffCentreM / sheet.cell_m) + 1)));
  found_.reserve(64);
}

std::optional<GroundCandidate> PlateSearch::refine(const cv::Mat& grey, const Hit& hit, const PlateBlur& blur) {
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
  const double ahead_m = sheet_.ahead_m(length->middle);
  const auto evidence = evidence_.of(sums_, {length->middle, width->middle, ahead_m, width->sharpness, sign}, blur);
  if (!evidence) return std::nullopt;
  return GroundCandidate{ahead_m, sheet_.offset_m(width->middle), *evidence};
}

const std::vector<GroundCandidate>& PlateSearch::find(const vision::TopView& view, const PlateBlur& blur) {
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
    if (const auto plate = refine(view.grey, hit, blur)) found_.push_back(*plate);
  }
  return found_;
}

}  // namespace railfix::track_detector
