#include "track_detector/platform_search.hpp"

#include <algorithm>
#include <cmath>

namespace railfix::track_detector {
namespace {

constexpr double kNearM = 3.0;
constexpr double kFarM = 22.0;
constexpr double kRowM = 0.12;
constexpr double kInnerM = 1.32;
constexpr double kColumnM = 0.025;
constexpr int kColumns = 45;
constexpr int kEdge = 3;            // columns on each side that are compared
constexpr float kFullStep = 0.15F;  // share of the brightness that is a whole step
constexpr float kSteepest = 6.0F;   // whole steps
constexpr float kDarkGrey = 8.0F;
constexpr int kEdgeRows = 24;  // of edge behind its beginning
constexpr int kFreeRows = 10;  // without edge in front of it
constexpr double kNearestEndM = 8.0;
constexpr float kEdgeLevel = 0.75F;
constexpr float kFreeLevel = 0.35F;  // of the edge

}  // namespace

PlatformSearch::PlatformSearch(const geometry::Intrinsics& camera)
    : lines_(camera), rows_(static_cast<int>((kFarM - kNearM) / kRowM) + 1) {
  grey_.create(rows_, kColumns, CV_32F);
  steps_.create(rows_, kColumns, CV_32F);
  sums_.resize(static_cast<size_t>(rows_) + 1);
  steep_sums_.resize(sums_.size());
  first_row_.resize(kColumns);
  found_.reserve(8);
}

const std::vector<PlatformMark>& PlatformSearch::find(const LandmarkPicture& picture) {
  found_.clear();
  for (const int side : {-1, 1}) {
    look(picture, side);
    rate_steps();
    for (const double polarity : {-1.0, 1.0}) collect(side, polarity);
  }
  return found_;
}

void PlatformSearch::look(const LandmarkPicture& picture, int side) {
  const Eigen::Matrix3d camera_from_track = geometry::rotation_camera_from_track(picture.pose);
  const Eigen::Vector3d eye(0, picture.pose.lateral_m, picture.pose.height_m);
  for (int row = 0; row < rows_; ++row) {
    const double s = kNearM + row * kRowM;
    const double turn = picture.curvature_per_m * s;
    const Eigen::Vector3d out = side * Eigen::Vector3d(-std::sin(turn), std::cos(turn), 0);
    const Eigen::Vector3d centre(s, 0.5 * s * turn, kUsualPlatformM);
    lines_.sample(picture.grey, (camera_from_track * (centre + out * kInnerM - eye)).cast<float>(),
                  (camera_from_track * out * kColumnM).cast<float>(), kColumns, grey_.ptr<float>(row));
  }
}

void PlatformSearch::rate_steps() {
  std::fill(first_row_.begin(), first_row_.end(), 0);
  for (int row = 0; row < rows_; ++row) {
    const float* grey = grey_.ptr<float>(row);
    float* step = steps_.ptr<float>(row);
    std::fill(step, step + kColumns, 0.0F);
    for (int c = kEdge; c + kEdge < kColumns; ++c) {
      if (*std::min_element(grey + c - kEdge, grey + c + kEdge + 1) < 0) {
        first_row_[static_cast<size_t>(c)] = row + 1;
        continue;
      }
      const float inner = grey[c - 1] + grey[c - 2] + grey[c - 3];
      const float outer = grey[c + 1] + grey[c + 2] + grey[c + 3];
      step[c] = std::clamp((outer - inner) / (kFullStep * std::max(inner + outer, 6 * kDarkGrey)) * 2.0F, -kSteepest,
                           kSteepest);
    }
  }
}

void PlatformSearch::collect(int side, double polarity) {
  Best begin;
  Best end;
  for (int c = kEdge + 1; c + kEdge + 1 < kColumns; ++c) {
    add_up(c, static_cast<float>(polarity));
    const int first_row = std::max(first_row_[static_cast<size_t>(c - 1)], first_row_[static_cast<size_t>(c + 1)]);
    for (int row = first_row + kFreeRows; row + kEdgeRows < rows_; ++row) {
      rate(begin, c, row, row, row + kEdgeRows, row - kFreeRows, row);
    }
    for (int row = first_row + kEdgeRows; row + kFreeRows < rows_; ++row) {
      rate(end, c, row, row - kEdgeRows, row, row, row + kFreeRows);
    }
  }
  for (const Best* best : {&begin, &end}) {
    if (best->edge <= 0) continue;
    const bool begins = best == &begin;
    // Nearer there are too few rows of the edge left, and the place would be a guess.
    if (!begins && kNearM + best->row * kRowM < kNearestEndM) continue;
    // Where the step would have to be cut off to be as long as it is in the rows around.
    add_up(best->column, static_cast<float>(polarity));
    const float around = steep_mean(best->row - kFreeRows, best->row + kFreeRows);
    const double edge_rows = static_cast<double>((around - best->free) / (best->edge - best->free)) * 2 * kFreeRows;
    const double at = begins ? best->row + kFreeRows - edge_rows : best->row - kFreeRows + edge_rows;
    found_.push_back({side, begins, kNearM + (at - 0.5) * kRowM, kInnerM + best->column * kColumnM,
                      1 - static_cast<double>(best->free / best->edge)});
  }
}

// Sums of one column's steps from the nearest row; a column to each side counts, because the edge may bend a little.
void PlatformSearch::add_up(int column, float sign) {
  sums_[0] = steep_sums_[0] = 0;
  for (int row = 0; row < rows_; ++row) {
    const float* step = steps_.ptr<float>(row) + column;
    const float value = std::max(0.0F, std::max(sign * step[0], std::max(sign * step[-1], sign * step[1])));
    sums_[static_cast<size_t>(row) + 1] = sums_[static_cast<size_t>(row)] + std::min(1.0F, value);
    steep_sums_[static_cast<size_t>(row) + 1] = steep_sums_[static_cast<size_t>(row)] + std::max(0.0F, sign * step[0]);
  }
}

float PlatformSearch::steep_mean(int first, int last) const {
  return (steep_sums_[static_cast<size_t>(last)] - steep_sums_[static_cast<size_t>(first)]) /
         static_cast<float>(last - first);
}

// The stones behind an end have steps, too; how steep they are against the edge's own tells them apart.
void PlatformSearch::rate(Best& best, int column, int row, int first_edge, int last_edge, int first_free,
                          int last_free) const {
  const auto last = static_cast<size_t>(last_edge);
  const auto first = static_cast<size_t>(first_edge);
  if (sums_[last] - sums_[first] < kEdgeLevel * static_cast<float>(last_edge - first_edge)) return;
  const float edge = steep_mean(first_edge, last_edge);
  const float free = steep_mean(first_free, last_free);
  if (free > kFreeLevel * edge || edge - free < best.edge - best.free) return;
  best = {column, row, edge, free};
}

}  // namespace railfix::track_detector
