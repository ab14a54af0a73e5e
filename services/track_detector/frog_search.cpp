#include "track_detector/frog_search.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

namespace railfix::track_detector {
namespace {

constexpr double kNearM = 3.0;
constexpr double kFarM = 21.0;
constexpr double kRowM = 0.1;
constexpr double kColumnM = 0.02;
constexpr double kHalfWidthM = 1.5;
constexpr int kColumns = 2 * 75 + 1;
constexpr double kHalfHeadM = 0.036;
constexpr double kInsideM[] = {-0.45, -0.13};  // where the other rail is looked for, outward from the crossing
constexpr double kOutsideM[] = {0.13, 0.45};
constexpr double kApartM = 0.22;  // outside, from here on its head stands clear of ours and of the wing rail
constexpr double kSlopes[] = {0.04, 0.05, 0.06, 0.07, 0.08, 0.09, 0.10, 0.11, 0.12, 0.135, 0.15, 0.17};
constexpr double kStepM = 0.2;  // between crossings that are tried
constexpr double kCrossingM[] = {5.0, 16.0};
constexpr double kPartSeen = 0.6;         // of a part's rows ...
constexpr double kPartSeenM = 2;          // ... or so much of it
constexpr double kFlatSlope = 0.075;      // the rail of a flatter crossing lies between ours from so far before it ...
constexpr double kFlatReferenceM = 12.0;  // ... that it is below the picture when the crossing comes near
constexpr double kCoarseScore = 0.45;
constexpr double kLowestScore = 0.55;
constexpr double kLowestFlatScore = 0.65;  // two rails along ours, one inside, one outside, have up to 0.58
constexpr float kLowestContrast = 5.0F;    // grey levels of our own rails
constexpr double kPeakReachM = 0.05;
constexpr double kEdgeReachM = 0.03;
constexpr double kNextM = 0.1;
constexpr size_t kFewestPoints = 16;
constexpr double kSlopeShare = 0.5;  // the fit's slope is that of the search, give or take
constexpr double kWorstFitM = 0.012;
constexpr double kEdgeSigmaM = 0.004;  // light and dirt on the rails, the same in all looks; wear is the map's to say

double lateral_of(int column) {
  return (column - 0.5 * (kColumns - 1)) * kColumnM;
}

}  // namespace

FrogSearch::FrogSearch(const geometry::Intrinsics& camera, const LandmarkOptions& options)
    : options_(options), lines_(camera), rows_(static_cast<int>((kFarM - kNearM) / kRowM) + 1) {
  grey_.create(rows_, kColumns, CV_32F);
  ridges_.create(rows_, kColumns, CV_32F);
  spread_ = cv::Mat::zeros(rows_, kColumns, CV_32F);
  sums_.resize(kColumns + 1);
  points_.reserve(static_cast<size_t>(rows_));
  found_.reserve(1);
}

const std::vector<GroundCandidate>& FrogSearch::find(const LandmarkPicture& picture) {
  found_.clear();
  look(picture);
  for (int row = 0; row < rows_; ++row) rate_ridges(row);
  // The nearest rows may lie below the picture.
  first_row_ = 0;
  while (first_row_ < rows_ && grey_.at<float>(first_row_, kColumns / 4) < 0) ++first_row_;
  Crossing crossing = best_crossing();
  GroundCandidate candidate;
  if (crossing.score() > kCoarseScore && refine(picture, crossing, candidate)) found_.push_back(candidate);
  return found_;
}

// On the plane of the rail heads.
Eigen::Vector3d FrogSearch::point_at(double ahead_m, double lateral_m) const {
  const double turn = curvature_per_m_ * ahead_m;
  const Eigen::Vector3d left(-std::sin(turn), std::cos(turn), 0);
  const Eigen::Vector3d centre(ahead_m, 0.5 * ahead_m * turn, 0.5 * vertical_curvature_per_m_ * ahead_m * ahead_m);
  return centre + left * lateral_m;
}

void FrogSearch::look(const LandmarkPicture& picture) {
  curvature_per_m_ = picture.curvature_per_m;
  vertical_curvature_per_m_ = picture.vertical_curvature_per_m;
  const Eigen::Matrix3d camera_from_track = geometry::rotation_camera_from_track(picture.pose);
  const Eigen::Vector3d eye(0, picture.pose.lateral_m, picture.pose.height_m);
  for (int row = 0; row < rows_; ++row) {
    const double s = kNearM + row * kRowM;
    const Eigen::Vector3d first = point_at(s, -kHalfWidthM);
    const Eigen::Vector3d across = (point_at(s, kHalfWidthM) - first) / (2 * kHalfWidthM);
    lines_.sample(picture.grey, (camera_from_track * (first - eye)).cast<float>(),
                  (camera_from_track * across * kColumnM).cast<float>(), kColumns, grey_.ptr<float>(row));
  }
}

// Bands as wide as a rail head that are brighter than both sides, against our own rails' contrast in the row.
void FrogSearch::rate_ridges(int row) {
  constexpr int kHalf = 1;
  constexpr int kGap = 1;
  constexpr int kSide = 3;
  constexpr int kReach = kHalf + kGap + kSide;
  const float* grey = grey_.ptr<float>(row);
  float* ridge = ridges_.ptr<float>(row);
  sums_[0] = 0;
  for (size_t c = 0; c < kColumns; ++c) sums_[c + 1] = sums_[c] + grey[c];
  const auto mean = [&](int first, int last) {
    return (sums_[static_cast<size_t>(last)] - sums_[static_cast<size_t>(first)]) / static_cast<float>(last - first);
  };
  std::fill(ridge, ridge + kColumns, 0.0F);
  for (int c = kReach; c + kReach < kColumns; ++c) {
    if (grey[c - kReach] < 0 || grey[c + kReach] < 0) continue;
    const float head = mean(c - kHalf, c + kHalf + 1);
    ridge[c] = std::max(
        0.0F, std::min(head - mean(c - kReach, c - kHalf - kGap), head - mean(c + kHalf + kGap + 1, c + kReach + 1)));
  }
  float own = 1e9F;
  for (const int side : {-1, 1}) {
    const int at =
        static_cast<int>(std::lround((side * (0.5 * options_.gauge_m + kHalfHeadM) + kHalfWidthM) / kColumnM));
    own = std::min(own, *std::max_element(ridge + at - 2, ridge + at + 3));
  }
  const float scale = own < kLowestContrast ? 0.0F : 1.0F / own;
  for (int c = 0; c < kColumns; ++c) ridge[c] = std::min(1.0F, ridge[c] * scale);
  float* spread = spread_.ptr<float>(row);
  for (int c = 1; c + 1 < kColumns; ++c) spread[c] = std::max(ridge[c], std::max(ridge[c - 1], ridge[c + 1]));
}

// Mean ridge along the other rail, inside and outside of ours.
void FrogSearch::rate(Crossing& crossing) const {
  const double zero_m = 0.5 * options_.gauge_m - kHalfHeadM;  // the other head's middle where the inner edges cross
  const auto part = [&](const double(&out_m)[2]) {
    const double a = crossing.at_m + out_m[0] / crossing.slope;
    const double b = crossing.at_m + out_m[1] / crossing.slope;
    const int begin = static_cast<int>(std::ceil((std::min(a, b) - kNearM) / kRowM));
    const int end = static_cast<int>((std::max(a, b) - kNearM) / kRowM);
    const int first = std::max(begin, first_row_);
    const int last = std::min(end, rows_ - 1);
    if (last - first < std::min(kPartSeen * (end - begin), kPartSeenM / kRowM)) return 0.0;
    // The column where the other rail is in a row, for rounding down; the parts never reach the view's sides.
    const auto column = [&](int row) {
      const double out = (kNearM + row * kRowM - crossing.at_m) * crossing.slope;
      return static_cast<float>((crossing.side * (zero_m + out) + kHalfWidthM) / kColumnM + 0.5);
    };
    const auto turn = static_cast<float>(crossing.side * 2 * kRowM * crossing.slope / kColumnM);
    float at = column(first);
    float total = 0;
    int count = 0;
    for (int row = first; row <= last; row += 2, ++count, at += turn)
      total += spread_.ptr<float>(row)[static_cast<int>(at)];
    const auto sum = static_cast<double>(total);
    return count > 3 ? sum / count : 0.0;
  };
  crossing.inside = part(kInsideM);
  crossing.outside = crossing.inside > kCoarseScore ? part(kOutsideM) : 0.0;
}

FrogSearch::Crossing FrogSearch::best_crossing() const {
  Crossing best;
  for (double at_m = kCrossingM[0]; at_m < kCrossingM[1]; at_m += kStepM) {
    for (const int side : {-1, 1}) {
      for (const double slope : kSlopes) {
        for (const double direction : {-1.0, 1.0}) {
          Crossing crossing{side, at_m, direction * slope, 0, 0};
          rate(crossing);
          if (crossing.score() > best.score()) best = crossing;
        }
      }
    }
  }
  return best;
}

// Middle of the ridge near a lateral position, to a fraction of a column.
bool FrogSearch::peak_near(int row, double lateral_m, double& found_m) const {
  const float* line = ridges_.ptr<float>(row);
  const int at = static_cast<int>(std::lround((lateral_m + kHalfWidthM) / kColumnM));
  const int reach = static_cast<int>(std::lround(kPeakReachM / kColumnM));
  if (at - reach < 1 || at + reach + 1 >= kColumns) return false;
  const float* top = std::max_element(line + at - reach, line + at + reach + 1);
  const int c = static_cast<int>(top - line);
  if (*top < 0.3F) return false;
  // Centre of gravity: the score of a wide head is flat on top.
  double sum = 0;
  double moment = 0;
  for (int k = c - 2; k <= c + 2; ++k) {
    if (k < 0 || k >= kColumns) continue;
    sum += static_cast<double>(line[k]);
    moment += static_cast<double>(line[k]) * lateral_of(k);
  }
  found_m = moment / sum;
  return true;
}

// Inner edge of a rail of the side's kind, near the middle that its ridge has there, where it has it. The middle of a
// ridge alone is drawn to one side by the dark flank of the head, most where the rail runs across the line of sight.
std::optional<double> FrogSearch::inner_edge(const cv::Mat& grey, const geometry::View& view, const Place& place) {
  double middle_m = 0;
  if (!peak_near(place.row, place.lateral_m, middle_m)) return std::nullopt;
  const double inner_m = middle_m - place.kind * kHalfHeadM;
  const double ahead_m = kNearM + place.row * kRowM;
  const auto inner = view.project(point_at(ahead_m, inner_m));
  const auto outer = view.project(point_at(ahead_m, inner_m + place.kind * 2 * kHalfHeadM));
  const auto next = view.project(point_at(ahead_m + kNextM, inner_m + place.slope * kNextM));
  if (!inner || !outer || !next) return std::nullopt;
  EdgeOptions options;
  options.head_m = 2 * kHalfHeadM;
  options.reach_m = kEdgeReachM;
  RailEdge edge;
  if (edges_.find_at(grey, {*inner, *outer, *next}, options, edge) != EdgeFinder::Look::found) return std::nullopt;
  return inner_m + place.kind * edge.offset_m;
}

bool FrogSearch::refine(const LandmarkPicture& picture, Crossing& crossing, GroundCandidate& candidate) {
  const geometry::View view(lines_.camera(), picture.pose);
  const double half_gauge_m = 0.5 * options_.gauge_m;
  const double zero_m = half_gauge_m - kHalfHeadM;
  const double own_m = half_gauge_m + kHalfHeadM;
  points_.clear();
  double own_off_m = 0;
  int own_count = 0;
  for (int row = 0; row < rows_; ++row) {
    const double ahead_m = kNearM + row * kRowM;
    const double out_m = (ahead_m - crossing.at_m) * crossing.slope;
    if (out_m < kInsideM[0] || out_m > kOutsideM[1]) continue;
    if (out_m > kInsideM[1] && out_m < kApartM) continue;
    const int side = crossing.side;
    // Of its own track it is the rail on the other side.
    if (const auto edge =
            inner_edge(picture.grey, view, {row, side * (zero_m + out_m), -side, side * crossing.slope})) {
      points_.push_back({ahead_m - crossing.at_m, side * *edge - half_gauge_m});
    }
    // Our opposite rail is the same rail of its track: light from one side shifts both alike.
    if (const auto edge = inner_edge(picture.grey, view, {row, -side * own_m, -side, 0})) {
      own_off_m += side * *edge + half_gauge_m;
      ++own_count;
    }
  }
  if (points_.size() < kFewestPoints || own_count < static_cast<int>(kFewestPoints)) return false;
  own_off_m /= own_count;
  // A parabola, because the other rail is curved; crossing where it is own_off_m outward. Behind a flat crossing its
  // rail is too far and thin for edges: what is between ours tells alone.
  Eigen::Vector3d fit = Eigen::Vector3d::Zero();
  double rms_m = 0;
  for (int pass = 0; pass < 3; ++pass) {
    Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
    Eigen::Vector3d right = Eigen::Vector3d::Zero();
    double sum = 0;
    double weights = 0;
    for (const Point& point : points_) {
      const Eigen::Vector3d basis(1, point.ahead_m, point.ahead_m * point.ahead_m);
      const double residual = point.out_m - basis.dot(fit);
      const double weight = pass == 0 ? 1.0 : 1.0 / (1.0 + std::pow(residual / 0.008, 2));
      normal += weight * basis * basis.transpose();
      right += weight * basis * point.out_m;
      sum += weight * residual * residual;
      weights += weight;
    }
    rms_m = std::sqrt(sum / weights);
    fit = normal.ldlt().solve(right);
  }
  const double slope = std::abs(crossing.slope);
  const bool is_flat = slope < kFlatSlope;
  if (rms_m > kWorstFitM || std::abs(fit(1) - crossing.slope) > kSlopeShare * slope) return false;
  const double shift_m = (own_off_m - fit(0)) / fit(1);
  if (std::abs(shift_m) > 1.0 || crossing.score() < (is_flat ? kLowestFlatScore : kLowestScore)) return false;
  candidate = {crossing.at_m + shift_m, crossing.side * half_gauge_m, crossing.score(), is_flat ? kFlatReferenceM : 0,
               kEdgeSigmaM / slope};
  return true;
}

}  // namespace railfix::track_detector
