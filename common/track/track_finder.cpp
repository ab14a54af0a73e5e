#include "track/track_finder.hpp"

#include <algorithm>
#include <cmath>

namespace railfix::track {
namespace {

constexpr double kCellM = 400.0;
constexpr double kStepM = 200.0;
constexpr double kStepRad = 0.5;
constexpr double kFarthestM = 1e9;  // no projection leads there
constexpr double kRoundingM = 1e-6;

int64_t cell_of(double coordinate_m) {
  return static_cast<int64_t>(std::floor(coordinate_m / kCellM));
}
uint64_t key_of(int64_t column, int64_t row) {
  return static_cast<uint64_t>(column) << 32U ^ (static_cast<uint64_t>(row) & 0xFFFFFFFFU);
}

Alignment::Nearest nearest_on_element(const Alignment& track, uint32_t element, double easting_m, double northing_m) {
  const Alignment alone({track.elements()[element]}, {track.starts()[element]}, {}, {});
  Alignment::Nearest nearest = alone.nearest(easting_m, northing_m);
  nearest.offset_m += track.element_offsets()[element];
  return nearest;
}

/// Told by its ends alone, in far less time than where it is nearest.
bool may_be_within(double radius_m, const Alignment& track, uint32_t element_index, const Eigen::Vector2d& point) {
  const Element& element = track.elements()[element_index];
  const PlanPose& start = track.starts()[element_index];
  const PlanPose end = advance(start, element, element.length_m);
  const Eigen::Vector2d from(start.easting_m, start.northing_m);
  const Eigen::Vector2d chord = Eigen::Vector2d(end.easting_m, end.northing_m) - from;
  const double part = std::clamp((point - from).dot(chord) / std::max(chord.squaredNorm(), 1e-12), 0.0, 1.0);
  return (point - from - part * chord).norm() <= radius_m + bulge_m(element) + kRoundingM;
}

}  // namespace

TrackFinder::TrackFinder(std::shared_ptr<const Map> map) : map_(std::move(map)) {
  for (const Edge& edge : map_->edges) {
    for (uint32_t i = 0; i < edge.alignment.elements().size(); ++i) enter(edge, i);
  }
}

/// Puts an element into every cell that a stretch of it may touch.
void TrackFinder::enter(const Edge& edge, uint32_t element_index) {
  const Alignment& track = edge.alignment;
  const Element& element = track.elements()[element_index];
  const PlanPose& start = track.starts()[element_index];
  if (!(std::abs(start.easting_m) < kFarthestM && std::abs(start.northing_m) < kFarthestM)) return;
  const double sharpest = std::max(std::abs(element.curvature_start_per_m), std::abs(element.curvature_end_per_m));
  const double count = std::max(1.0, std::ceil(element.length_m * std::max(1.0 / kStepM, sharpest / kStepRad)));
  const double step = element.length_m / count;
  const double bulge = bulge_m({step, sharpest, sharpest});
  PlanPose from = start;
  for (double i = 1; i <= count; ++i) {
    const PlanPose to = advance(start, element, i * step);
    const auto [west, east] = std::minmax(from.easting_m, to.easting_m);
    const auto [south, north] = std::minmax(from.northing_m, to.northing_m);
    for (int64_t column = cell_of(west - bulge); column <= cell_of(east + bulge); ++column) {
      for (int64_t row = cell_of(south - bulge); row <= cell_of(north + bulge); ++row) {
        std::vector<Piece>& pieces = cells_[key_of(column, row)];
        if (pieces.empty() || pieces.back().edge != edge.id || pieces.back().element != element_index)
          pieces.push_back({edge.id, element_index});
      }
    }
    from = to;
  }
}

/// Every element in reach once, edge by edge.
std::vector<TrackFinder::Piece> TrackFinder::pieces_near(double easting_m, double northing_m, double radius_m) const {
  std::vector<Piece> pieces;
  for (int64_t column = cell_of(easting_m - radius_m); column <= cell_of(easting_m + radius_m); ++column) {
    for (int64_t row = cell_of(northing_m - radius_m); row <= cell_of(northing_m + radius_m); ++row) {
      const auto cell = cells_.find(key_of(column, row));
      if (cell != cells_.end()) pieces.insert(pieces.end(), cell->second.begin(), cell->second.end());
    }
  }
  std::sort(pieces.begin(), pieces.end(),
            [](const Piece& a, const Piece& b) { return a.edge != b.edge ? a.edge < b.edge : a.element < b.element; });
  const auto same = [](const Piece& a, const Piece& b) { return a.edge == b.edge && a.element == b.element; };
  pieces.erase(std::unique(pieces.begin(), pieces.end(), same), pieces.end());
  return pieces;
}

std::vector<NearTrack> TrackFinder::near(double easting_m, double northing_m, double radius_m) const {
  std::vector<NearTrack> out;
  for (const Piece& piece : pieces_near(easting_m, northing_m, radius_m)) {
    const Alignment& track = map_->edge(piece.edge)->alignment;
    if (!may_be_within(radius_m, track, piece.element, {easting_m, northing_m})) continue;
    const Alignment::Nearest nearest = nearest_on_element(track, piece.element, easting_m, northing_m);
    if (out.empty() || out.back().edge != piece.edge) {
      out.push_back({piece.edge, nearest.offset_m, nearest.lateral_m});
    } else if (std::abs(nearest.lateral_m) < std::abs(out.back().lateral_m)) {
      out.back() = {piece.edge, nearest.offset_m, nearest.lateral_m};
    }
  }
  std::erase_if(out, [&](const NearTrack& track) { return std::abs(track.lateral_m) > radius_m; });
  std::sort(out.begin(), out.end(),
            [](const NearTrack& a, const NearTrack& b) { return std::abs(a.lateral_m) < std::abs(b.lateral_m); });
  return out;
}

}  // namespace railfix::track
